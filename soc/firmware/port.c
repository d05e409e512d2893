#include "port.h"

enum { CHIP_LINE = 1 << FLICKER_INTERRUPT, TIMER_LINE = 1 << TIMER0_INTERRUPT };

static volatile uint32_t g_lines, g_when; /* lines that have interrupted; when the last one did */

void port_start(void)
{
  lines(0);
  store(CSR_TIMER0_EN_ADDR, 0);
  store(CSR_UART_EV_ENABLE_ADDR, 0);
  __asm__ volatile("csrw mie, %0" ::"r"(0x800));
  interrupts(1);
}

void say_char(char c)
{
  while (load(CSR_UART_TXFULL_ADDR) != 0) {
  }
  store(CSR_UART_RXTX_ADDR, (uint8_t)c);
}

void say(const char *text)
{
  for (; *text != 0; text++)
    say_char(*text);
}

void say_number(uint32_t value, int width)
{
  char digits[10];
  int n = 0;
  do {
    digits[n++] = (char)('0' + value % 10);
    value /= 10;
  } while (value != 0);
  for (; width > n; width--)
    say_char(' ');
  while (n > 0)
    say_char(digits[--n]);
}

void say_hex(uint32_t value)
{
  say("0x");
  for (int shift = 28; shift >= 0; shift -= 4)
    say_char("0123456789abcdef"[value >> shift & 15]);
}

int key(void)
{
  while (load(CSR_UART_RXEMPTY_ADDR) != 0) {
  }
  const int c = (int)(load(CSR_UART_RXTX_ADDR) & 0xff);
  store(CSR_UART_EV_PENDING_ADDR, 2); /* the byte is taken */
  return c;
}

/* Called from start.S. A line stays shut until the program has looked. */
void interrupted(void)
{
  g_when = cycles();
  g_lines |= waiting_lines();
  lines(0);
}

int sleep_until_chip(uint32_t limit, uint32_t *from, uint32_t *when)
{
  g_lines = 0;
  if (limit != 0) {
    store(CSR_TIMER0_EN_ADDR, 0);
    store(CSR_TIMER0_RELOAD_ADDR, 0);
    store(CSR_TIMER0_LOAD_ADDR, limit);
    store(CSR_TIMER0_EN_ADDR, 1);
    store(CSR_TIMER0_EV_PENDING_ADDR, 1);
    store(CSR_TIMER0_EV_ENABLE_ADDR, 1);
  }
  interrupts(0);
  lines(CHIP_LINE | (limit != 0 ? TIMER_LINE : 0));
  *from = cycles();
  while (g_lines == 0) {
    __asm__ volatile("wfi"); /* an interrupt that waits ends it, though interrupts are off: none is missed between the look and the sleep */
    interrupts(1);
    __asm__ volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop"); /* the pipeline takes it some instructions later */
    interrupts(0);
  }
  lines(0);
  interrupts(1);
  store(CSR_TIMER0_EN_ADDR, 0);
  store(CSR_TIMER0_EV_ENABLE_ADDR, 0);
  *when = g_when;
  return (g_lines & CHIP_LINE) != 0;
}
