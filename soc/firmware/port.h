/* The firmware's machine: VexRiscv in a SoC of LiteX. csr.h, soc.h and mem.h are what LiteX writes of the SoC. */
#ifndef PORT_H
#define PORT_H

#include <stdint.h>

#include "csr.h"
#include "mem.h"
#include "soc.h"

#define RAM_BEGIN ((uint32_t)MAIN_RAM_BASE)
#define RAM_BYTES ((uint32_t)MAIN_RAM_SIZE)

static inline uint32_t load(uint32_t address)
{
  return *(volatile uint32_t *)(uintptr_t)address;
}

static inline void store(uint32_t address, uint32_t value)
{
  *(volatile uint32_t *)(uintptr_t)address = value;
}

/* Cycles of the CPU, modulo 2^32. */
static inline uint32_t cycles(void)
{
  uint32_t value;
  __asm__ volatile("csrr %0, mcycle" : "=r"(value));
  return value;
}

/* What the data cache holds is forgotten: it writes through, so nothing is lost, and the next loads see what the chip has written. */
static inline void forget_cache(void)
{
  __asm__ volatile(".word 0x500f\n nop\n nop\n nop\n nop\n nop" ::: "memory");
}

static inline void interrupts(int on)
{
  if (on)
    __asm__ volatile("csrsi mstatus, 8" ::: "memory");
  else
    __asm__ volatile("csrci mstatus, 8" ::: "memory");
}

/* Which lines of LiteX' interrupt controller reach the CPU: VexRiscv's own CSR. */
static inline void lines(uint32_t mask)
{
  __asm__ volatile("csrw 0xbc0, %0" ::"r"(mask));
}

static inline uint32_t waiting_lines(void)
{
  uint32_t value;
  __asm__ volatile("csrr %0, 0xfc0" : "=r"(value));
  return value;
}

void port_start(void);
void say_char(char c);
void say(const char *text);
void say_number(uint32_t value, int width); /* decimal, right in `width` places */
void say_hex(uint32_t value);               /* eight digits behind 0x */
int key(void);                              /* waits for one */

/* Sleep until the chip's interrupt, at most `limit` cycles (0: without bound): 1, or 0. *from: cycles() when it falls asleep; *when: in the handler. */
int sleep_until_chip(uint32_t limit, uint32_t *from, uint32_t *when);

#endif
