/* Firmware for a SoC with FLICKER: finds a scene in RAM, renders it, measures; keys on the UART are its commands (docs/reference/soc.md). */
#include "firmware.h"

#include <string.h>

enum { SLEEP_LIMIT = 200000000 }; /* cycles of a frame */
#define ENDS (FLK_INTERRUPT_FRAME_DONE_MASK | FLK_INTERRUPT_ERROR_MASK)

firmware_t g;

static const char *const STATUS_NAME[FLK_STATUSES] = {
    [FLK_OK] = "OK",
    [FLK_IMAGE_SHORT] = "IMAGE_SHORT",
    [FLK_IMAGE_MAGIC] = "IMAGE_MAGIC",
    [FLK_IMAGE_VERSION] = "IMAGE_VERSION",
    [FLK_IMAGE_HEADER_CRC] = "IMAGE_HEADER_CRC",
    [FLK_IMAGE_FORMAT] = "IMAGE_FORMAT",
    [FLK_IMAGE_COUNTS] = "IMAGE_COUNTS",
    [FLK_IMAGE_SIZE] = "IMAGE_SIZE",
    [FLK_IMAGE_PLACE] = "IMAGE_PLACE",
    [FLK_IMAGE_PART] = "IMAGE_PART",
    [FLK_IMAGE_RESERVED] = "IMAGE_RESERVED",
    [FLK_IMAGE_TABLE_CRC] = "IMAGE_TABLE_CRC",
    [FLK_IMAGE_HEADERS_CRC] = "IMAGE_HEADERS_CRC",
    [FLK_IMAGE_GEOMETRY_CRC] = "IMAGE_GEOMETRY_CRC",
    [FLK_IMAGE_COLOUR_CRC] = "IMAGE_COLOUR_CRC",
    [FLK_IMAGE_ADDRESS] = "IMAGE_ADDRESS",
    [FLK_CAMERA_SIZE] = "CAMERA_SIZE",
    [FLK_CAMERA_FOCAL] = "CAMERA_FOCAL",
    [FLK_CAMERA_POSITION] = "CAMERA_POSITION",
    [FLK_CAMERA_ROTATION] = "CAMERA_ROTATION",
    [FLK_CAMERA_CENTRE] = "CAMERA_CENTRE",
    [FLK_FRAME_MODE] = "FRAME_MODE",
    [FLK_FRAME_ALIGN] = "FRAME_ALIGN",
    [FLK_FRAME_RANGE] = "FRAME_RANGE",
    [FLK_FRAME_RECORDS] = "FRAME_RECORDS",
    [FLK_FRAME_CHUNKS] = "FRAME_CHUNKS",
    [FLK_FRAME_STRIDE] = "FRAME_STRIDE",
    [FLK_FRAME_OVERLAP] = "FRAME_OVERLAP",
    [FLK_FRAME_LISTS] = "FRAME_LISTS",
    [FLK_FRAME_DEADLINE] = "FRAME_DEADLINE",
    [FLK_FRAME_ORDER] = "FRAME_ORDER",
    [FLK_FRAME_SH_BITS] = "FRAME_SH_BITS",
    [FLK_FRAME_STORE] = "FRAME_STORE",
    [FLK_FRAME_TOLERANCE] = "FRAME_TOLERANCE",
    [FLK_FRAME_KEEPS] = "FRAME_KEEPS",
    [FLK_DEVICE_ID] = "DEVICE_ID",
    [FLK_DEVICE_VERSION] = "DEVICE_VERSION",
    [FLK_BUSY] = "BUSY",
    [FLK_DEAD] = "DEAD",
    [FLK_WAITED] = "WAITED",
};

static const char *const ERROR_NAME[] = {
    [FLK_ERROR_FRONT_READ] = "FRONT_READ",       [FLK_ERROR_FRONT_WRITE] = "FRONT_WRITE", [FLK_ERROR_RECORD_REGION] = "RECORD_REGION",
    [FLK_ERROR_LIST_MEMORY] = "LIST_MEMORY",     [FLK_ERROR_LIST_READ] = "LIST_READ",     [FLK_ERROR_RECORD_READ] = "RECORD_READ",
    [FLK_ERROR_FRAME_WRITE] = "FRAME_WRITE",     [FLK_ERROR_DESCRIPTOR] = "DESCRIPTOR",   [FLK_ERROR_ABORTED] = "ABORTED",
    [FLK_ERROR_TIMED_OUT] = "TIMED_OUT",         [FLK_ERROR_BAD_TABLE] = "BAD_TABLE",     [FLK_ERROR_BAD_HEADER] = "BAD_HEADER",
    [FLK_ERROR_LATE] = "LATE",
};
enum { ERRORS = sizeof ERROR_NAME / sizeof *ERROR_NAME };

/* Counters of the table; of several units their sum. */
static const struct {
  const char *text;
  uint8_t index, count;
} COUNTER[] = {
    {"front end, cycles", FLK_COUNTER_FRONT_CYCLES, 1},
    {"rendering, cycles", FLK_COUNTER_RENDERING_CYCLES, 1},
    {"clusters culled", FLK_COUNTER_CULLED_CLUSTERS, 1},
    {"survivors", FLK_COUNTER_SURVIVORS, 1},
    {"list entries", FLK_COUNTER_LIST_ENTRIES, 4},
    {"waits: geometry", FLK_COUNTER_FRONT_GROUP_MISSING, 1},
    {"waits: lanes of the front end", FLK_COUNTER_FRONT_LANE_WAITS, 1},
    {"waits: colours requested", FLK_COUNTER_FRONT_REQUEST_WAITS, 1},
    {"waits: list writers", FLK_COUNTER_FRONT_MERGED_WAITS, 1},
    {"waits: lines of lists", FLK_COUNTER_FRONT_LINE_WAITS, 1},
    {"waits: sorting", FLK_COUNTER_LIST_LINE_WAITS, 1},
    {"waits: entry missing", FLK_COUNTER_ENTRY_MISSING, 1},
    {"waits: record from memory", FLK_COUNTER_CACHE_WAITS, 1},
    {"waits: cores", FLK_COUNTER_RECORD_WAITS, 1},
    {"waits: frame writer", FLK_COUNTER_PAIR_WAITS, 1},
    {"waits: frame buffer", FLK_COUNTER_FRAME_WAITS, 1},
};
enum { COUNTERS = sizeof COUNTER / sizeof *COUNTER };

static uint32_t bus_read(void *user, uint32_t offset)
{
  (void)user;
  return load(FLICKER_BASE + offset);
}

static void bus_write(void *user, uint32_t offset, uint32_t value)
{
  (void)user;
  store(FLICKER_BASE + offset, value);
}

const flk_bus_t *chip_bus(void)
{
  static const flk_bus_t bus = {bus_read, bus_write, NULL};
  return &bus;
}

void say_status(flk_status_t status)
{
  say("FLK_");
  say((unsigned)status < FLK_STATUSES ? STATUS_NAME[status] : "?");
  say(": ");
  say(flk_status_text(status));
  say("\n");
}

void say_errors(uint16_t error)
{
  for (unsigned bit = 0; bit < 16; bit++)
    if (error >> bit & 1) {
      say("FLK_ERROR_");
      say(bit < ERRORS ? ERROR_NAME[bit] : "?");
      say(": ");
      say(flk_error_text(bit));
      say("\n");
    }
}

static void say_line(const char *text, uint32_t value)
{
  int n = 0;
  say("  ");
  for (; text[n] != 0; n++)
    say_char(text[n]);
  for (; n < 32; n++)
    say_char(' ');
  say_number(value, 10);
  say("\n");
}

uint32_t crc(const uint8_t *data, uint32_t size)
{
  uint32_t step[16], value = 0xffffffffu;
  for (uint32_t i = 0; i < 16; i++) {
    step[i] = i;
    for (int k = 0; k < 4; k++)
      step[i] = step[i] >> 1 ^ (step[i] & 1u ? 0xedb88320u : 0u);
  }
  for (uint32_t i = 0; i < size; i++) {
    value ^= data[i];
    value = value >> 4 ^ step[value & 15u];
    value = value >> 4 ^ step[value & 15u];
  }
  return ~value;
}

/* ---- what is there ---------------------------------------------------------------------------------------------------------------------- */

static void find_chip(void)
{
  const flk_status_t status = flk_probe(&g.device, chip_bus());
  g.present = status == FLK_OK;
  if (!g.present) {
    say_status(status);
    return;
  }
  if (flk_interrupt_pending(&g.device) & FLK_INTERRUPT_FRAME_DONE_MASK)
    flk_release(&g.device); /* of whoever had the chip before */
  say("chip " FLICKER_CHIP ", registers ");
  say_number(FLK_VERSION_MAJOR_RESET, 0);
  say(".");
  say_number(g.device.minor, 0);
  say("\n");
  say_line("stage", g.device.stage);
  say_line("form", g.device.form);
  say_line("precision", g.device.precision);
  say_line("VRUs of a channel", g.device.vrus);
  say_line("mask generator", g.device.mask_generator);
  say_line("lanes", g.device.lanes);
  say_line("lists of a writer", g.device.lists);
  say_line("bytes of a beat", g.device.beat);
  say_line("cores", g.device.cores);
  say_line("preprocessing lanes", g.device.preproc_lanes);
  say_line("cycles a Gaussian of a lane", g.device.preproc_interval);
  say_line("list writers", g.device.list_writers);
  say_line("sorting units", g.device.sort_units);
  say_line("keeps colours", (uint32_t)g.device.colour_store);
}

static void take_view(uint32_t view)
{
  g.view = view;
  memcpy(&g.camera, (const void *)(uintptr_t)(g.path + PATH_HEAD + view * sizeof g.camera), sizeof g.camera);
}

/* Without a path: from before the scene's box, along z. */
static void look_at_box(void)
{
  const flk_scene_t *const scene = &g.scene;
  const double wide = (double)scene->high[0] - (double)scene->low[0];
  memset(&g.camera, 0, sizeof g.camera);
  g.camera.rotation[0] = g.camera.rotation[4] = g.camera.rotation[8] = 1;
  g.camera.position[0] = 0.5 * ((double)scene->low[0] + (double)scene->high[0]);
  g.camera.position[1] = 0.5 * ((double)scene->low[1] + (double)scene->high[1]);
  g.camera.position[2] = (double)scene->low[2] - wide;
  g.camera.fx = g.camera.fy = 160;
  g.camera.width = 160;
  g.camera.height = 90;
}

/* Bytes of a part that begins and ends within RAM. */
static int in_ram(uint32_t at, uint64_t size)
{
  return at >= RAM_BEGIN && at - RAM_BEGIN <= RAM_BYTES && size <= RAM_BYTES - (at - RAM_BEGIN);
}

/* parts: all checksums are computed, else those of the header and of the cluster table. */
static flk_status_t open_scene(uint32_t at, int parts)
{
  const uint8_t *const image = (const uint8_t *)(uintptr_t)at;
  const uint64_t size = (uint64_t)load(at + 28) * 64;
  const flk_status_t status = flk_scene_open(&g.scene, image, in_ram(at, size) ? (size_t)size : RAM_BYTES - (at - RAM_BEGIN), at, parts ? 0 : FLK_NO_PART_CRC);
  if (status == FLK_OK && !parts && crc(image + (uint64_t)load(at + 32) * 64, load(at + 36) * 64) != load(at + 40))
    return FLK_IMAGE_TABLE_CRC;
  return status;
}

static void find_scene(int parts)
{
  uint32_t end = RAM_BEGIN;
  flk_status_t status = FLK_IMAGE_MAGIC;
  g.found = 0;
  g.views = 0;
  forget_cache();
  for (uint32_t at = RAM_BEGIN; at < RAM_BEGIN + RAM_BYTES && !(g.found && g.views); at += BLOCK) {
    const char *const text = (const char *)(uintptr_t)at;
    if (!g.found && memcmp(text, "FLKSCENE", 8) == 0) {
      status = open_scene(at, parts);
      if (status != FLK_OK) {
        say("scene at ");
        say_hex(at);
        say(": ");
        say_status(status);
        continue;
      }
      g.found = 1;
      if (at + (uint32_t)g.scene.bytes > end)
        end = at + (uint32_t)g.scene.bytes;
    } else if (!g.views && memcmp(text, "FLKPATH", 8) == 0) {
      g.path = at;
      g.views = load(at + 8);
      if (at + BLOCK > end)
        end = at + BLOCK;
    }
  }
  if (!g.found) {
    if (status == FLK_IMAGE_MAGIC) {
      say("no scene: ");
      say_status(status);
    }
    return;
  }
  say("scene at ");
  say_hex((uint32_t)g.scene.address);
  say("\n");
  say_line("Gaussians", g.scene.gaussians);
  say_line("clusters", g.scene.clusters);
  say_line("SH degree", g.scene.degree);
  say_line("bytes", (uint32_t)g.scene.bytes);
  say_line("cameras of the path", g.views);
  if (g.views)
    take_view(0);
  else
    look_at_box();
  end = (end + 4095) & ~4095u;
  g.region_bytes = (RAM_BEGIN + RAM_BYTES - end) / 2 & ~4095u;
  g.region[0] = end;
  g.region[1] = end + g.region_bytes;
}

/* ---- frames ----------------------------------------------------------------------------------------------------------------------------- */

flk_frame_t frame_of(const flk_camera_t *camera, unsigned region)
{
  static uint16_t tag;
  flk_frame_t frame = {.scene = &g.scene, .camera = *camera, .mode = FLK_CAT_SMOOTH, .pixel_format = FLK_RGB8, .tag = ++tag};
  const uint32_t chunks = flk_list_chunks(camera->width, camera->height, 2 * (uint64_t)g.scene.gaussians);
  frame.stride = flk_least_stride(camera->width, frame.pixel_format);
  frame.frame_buffer = g.region[region];
  frame.region.records = (frame.frame_buffer + flk_frame_bytes(camera->height, frame.stride) + 63) & ~(uint64_t)63;
  frame.region.record_bytes = flk_record_bytes(&g.scene, g.device.form);
  frame.region.lists = frame.region.records + frame.region.record_bytes;
  frame.region.chunks = chunks;
  frame.region.pointers = frame.region.lists + flk_list_bytes(chunks);
  return frame;
}

/* A frame's memory lies in RAM. */
static int fits(const flk_frame_t *frame)
{
  const uint64_t end = frame->region.pointers + flk_pointer_bytes(frame->camera.width, frame->camera.height);
  return end <= frame->frame_buffer + g.region_bytes;
}

static flk_status_t start_frame(const flk_frame_t *frame, const flk_frame_t *other, cost_t *cost, uint32_t *from, uint16_t *number)
{
  const uint32_t begin = cycles();
  flk_status_t status = flk_frame_write(&g.device, frame, other);
  cost->set_up = cycles() - begin;
  flk_interrupt_enable(&g.device, ENDS);
  *from = cycles();
  if (status == FLK_OK)
    status = flk_start(&g.device, number);
  return status;
}

flk_status_t sleep_until(uint32_t mask, uint32_t *slept, uint32_t *when)
{
  flk_interrupt_enable(&g.device, mask);
  for (;;) {
    uint32_t begin;
    if (!sleep_until_chip(SLEEP_LIMIT, &begin, when)) {
      flk_interrupt_enable(&g.device, 0);
      return FLK_WAITED;
    }
    *slept += *when - begin;
    const uint32_t pending = flk_interrupt_pending(&g.device);
    flk_interrupt_acknowledge(&g.device, pending & ~FLK_INTERRUPT_FRAME_DONE_MASK);
    if (pending & mask)
      break;
  }
  flk_interrupt_enable(&g.device, 0);
  return FLK_OK;
}

/* Sleep until a frame has ended; interrupts of what was before wake and are forgotten. */
static flk_status_t sleep_until_end(uint16_t number, uint32_t *slept, uint32_t *when)
{
  flk_status_t status;
  *slept = 0;
  do {
    status = sleep_until(ENDS, slept, when);
    if (status == FLK_OK)
      status = flk_poll(&g.device, number);
  } while (status == FLK_BUSY);
  return status;
}

flk_status_t run_frame(const flk_frame_t *frame, cost_t *cost)
{
  uint32_t from, when;
  uint16_t number;
  flk_status_t status = start_frame(frame, NULL, cost, &from, &number);
  if (status != FLK_OK)
    return status;
  status = sleep_until_end(number, &cost->asleep, &when);
  cost->start_to_end = when - from;
  cost->result = flk_result(&g.device);
  return status;
}

/* Sum of the picture's bytes as words of 32 bits, row by row, the last word of a row filled with zeros; modulo 2^32. */
uint32_t picture_sum(const flk_frame_t *frame)
{
  const uint32_t bytes = 3 * frame->camera.width;
  uint32_t sum = 0;
  forget_cache();
  for (uint32_t y = 0; y < frame->camera.height; y++) {
    const uint32_t row = (uint32_t)frame->frame_buffer + y * frame->stride;
    for (uint32_t i = 0; i < bytes / 4; i++)
      sum += load(row + 4 * i);
    if (bytes % 4)
      sum += load(row + bytes / 4 * 4) & ((1u << 8 * (bytes % 4)) - 1);
  }
  return sum;
}

static void say_picture(const flk_frame_t *frame)
{
  say("picture ");
  say_number(frame->camera.width, 0);
  say("x");
  say_number(frame->camera.height, 0);
  say(" at ");
  say_hex((uint32_t)frame->frame_buffer);
  say(" stride ");
  say_number(frame->stride, 0);
  say(" sum ");
  say_hex(picture_sum(frame));
  say("\n");
}

static void say_cost(const cost_t *cost)
{
  const uint32_t taken = flk_counter(&g.device, FLK_COUNTER_STAMP_TAKEN);
  say_line("camera and descriptor, cycles", cost->set_up);
  say_line("start to interrupt, cycles", cost->start_to_end);
  say_line("of these CPU asleep, permille", (uint32_t)((uint64_t)cost->asleep * 1000 / cost->start_to_end));
  say_line("frame, cycles", flk_counter(&g.device, FLK_COUNTER_STAMP_RENDERING_DONE) - taken);
  for (unsigned i = 0; i < COUNTERS; i++) {
    uint32_t value = 0;
    for (unsigned k = 0; k < COUNTER[i].count; k++)
      value += flk_counter(&g.device, COUNTER[i].index + k);
    say_line(COUNTER[i].text, value);
  }
}

static int ready_for_frames(void)
{
  if (!g.present)
    say_status(FLK_DEVICE_ID);
  else if (!g.found)
    say_status(FLK_IMAGE_MAGIC);
  return g.present && g.found;
}

/* A frame with its table; list memory grows until it suffices. */
static void render(const flk_camera_t *camera)
{
  cost_t cost;
  flk_frame_t frame = frame_of(camera, 0);
  if (!ready_for_frames())
    return;
  for (;;) {
    if (!fits(&frame)) {
      say_status(FLK_FRAME_RANGE);
      return;
    }
    const flk_status_t status = run_frame(&frame, &cost);
    if (status != FLK_OK) {
      say_status(status);
      if (status == FLK_DEAD)
        say_status(reset_chip());
      return;
    }
    if (!(cost.result.error >> FLK_ERROR_LIST_MEMORY & 1))
      break;
    say_errors(cost.result.error);
    flk_release(&g.device);
    frame.region.chunks *= 4;
    frame.region.pointers = frame.region.lists + flk_list_bytes(frame.region.chunks);
  }
  say_errors(cost.result.error);
  say_cost(&cost);
  flk_release(&g.device);
  say_picture(&frame);
}

/* Frames of the path, the next one started while the one before is rendered. */
static void walk(uint32_t frames)
{
  flk_frame_t frame[2];
  cost_t cost;
  uint32_t slept, when, from, begin = 0;
  uint16_t number[2];
  if (!ready_for_frames())
    return;
  for (uint32_t n = 0; n <= frames; n++) {
    if (n < frames) {
      if (g.views)
        take_view(n % g.views);
      while (n > 0 && flk_ready(&g.device) == FLK_BUSY) {
      }
      frame[n % 2] = frame_of(&g.camera, n % 2);
      const flk_status_t status = start_frame(&frame[n % 2], n > 0 ? &frame[(n - 1) % 2] : NULL, &cost, &from, &number[n % 2]);
      if (status != FLK_OK) {
        say_status(status);
        return;
      }
      if (n == 0)
        begin = from;
      if (n == 0)
        continue;
    }
    const flk_status_t status = sleep_until_end(number[(n - 1) % 2], &slept, &when);
    if (status != FLK_OK) {
      say_status(status);
      return;
    }
    const flk_result_t result = flk_result(&g.device);
    say("frame ");
    say_number(n, 0);
    say(" ended after ");
    say_number(when - begin, 0);
    say(" cycles, its own ");
    say_number(flk_counter(&g.device, FLK_COUNTER_STAMP_RENDERING_DONE) - flk_counter(&g.device, FLK_COUNTER_STAMP_TAKEN), 0);
    say("\n");
    flk_release(&g.device);
    say_errors(result.error);
    say_picture(&frame[(n - 1) % 2]);
  }
}

flk_status_t reset_chip(void)
{
  /* What the memory still owes is waited for, at most so many times. */
  store(CSR_FLICKER_HOLD_ADDR, 1);
  for (int n = 0; n < 100000 && load(CSR_FLICKER_IDLE_ADDR) == 0; n++) {
  }
  flk_reset(&g.device);
  flk_status_t status = FLK_BUSY;
  for (int n = 0; n < 100000 && status != FLK_OK; n++)
    status = flk_ready(&g.device);
  store(CSR_FLICKER_HOLD_ADDR, 0);
  flk_interrupt_acknowledge(&g.device, flk_interrupt_pending(&g.device));
  return status;
}

/* ---- commands ------------------------------------------------------------------------------------------------------------------------------ */

static uint32_t hex_argument(void)
{
  uint32_t value = 0;
  int digits = 0;
  for (;;) {
    int c = key();
    if (c >= 'A' && c <= 'F')
      c += 'a' - 'A';
    const int digit = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
    if (digit < 0) {
      if (digits == 0 && c == ' ')
        continue;
      return value;
    }
    value = value << 4 | (uint32_t)digit;
    digits++;
  }
}

/* The camera turns on the spot, five degrees about its own down axis. */
static void turn(double s)
{
  const double c = 0.99619469809174555;
  for (int i = 0; i < 3; i++) {
    double *const r = &g.camera.rotation[3 * i];
    const double right = r[0], forward = r[2];
    r[0] = c * right - s * forward;
    r[2] = s * right + c * forward;
  }
}

/* Words with all addresses and their complements through 64 KB behind the scene. */
static void memory_loop(void)
{
  const uint32_t base = g.found ? g.region[0] : RAM_BEGIN + RAM_BYTES - BLOCK;
  const uint32_t size = BLOCK / 8;
  uint32_t wrong = 0;
  for (uint32_t inverse = 0; inverse < 2; inverse++) {
    for (uint32_t at = base; at < base + size; at += 4)
      store(at, inverse ? ~at : at);
    forget_cache();
    for (uint32_t at = base; at < base + size; at += 4)
      wrong += load(at) != (inverse ? ~at : at);
  }
  say("memory: ");
  say_number(wrong, 0);
  say(" words wrong\n");
}

/* A descriptor that the chip must refuse: a stride of 0, which the driver would not write. */
void refused_descriptor(void)
{
  uint32_t slept, when;
  uint16_t number = 0;
  flk_camera_t camera = g.camera;
  if (!ready_for_frames())
    return;
  camera.width = camera.height = 16;
  const flk_frame_t frame = frame_of(&camera, 0);
  flk_status_t status = flk_frame_write(&g.device, &frame, NULL);
  if (status == FLK_OK) {
    bus_write(NULL, FLK_STRIDE_OFFSET, 0);
    status = flk_start(&g.device, &number);
  }
  if (status == FLK_OK)
    status = sleep_until_end(number, &slept, &when);
  if (status != FLK_OK) {
    say_status(status);
    return;
  }
  say_errors(flk_result(&g.device).error);
  flk_release(&g.device);
}

static void help(void)
{
  say("1 registers  2 memory loop  3 refused descriptor  4 frame of 16x16  5 frame of the path\n"
      "f frame  n, p next and last camera of the path  a, d turn  b three frames back to back  c set up a camera\n"
      "s find the scene  v with all checksums  e provoke every error  x reset the chip\n"
      "r ADDRESS, w ADDRESS VALUE: a word, in hexadecimal\n");
}

static void command(int c)
{
  flk_camera_t camera = g.camera;
  uint32_t address;
  switch (c) {
  case '1':
    find_chip();
    break;
  case '2':
    memory_loop();
    break;
  case '3':
    refused_descriptor();
    break;
  case '4':
    camera.width = camera.height = 16;
    render(&camera);
    break;
  case '5':
    if (g.views)
      take_view(0);
    render(&g.camera);
    break;
  case 'f':
    render(&g.camera);
    break;
  case 'n':
  case 'p':
    if (g.views)
      take_view((g.view + (c == 'n' ? 1 : g.views - 1)) % g.views);
    render(&g.camera);
    break;
  case 'a':
  case 'd':
    turn(c == 'a' ? 0.087155742747658174 : -0.087155742747658174);
    render(&g.camera);
    break;
  case 'b':
    walk(3);
    break;
  case 'c': {
    flk_camera_registers_t registers;
    const uint32_t begin = cycles();
    const flk_status_t status = flk_camera_registers(&registers, &camera);
    const uint32_t took = cycles() - begin;
    if (status != FLK_OK)
      say_status(status);
    say_line("camera, cycles", took);
    break;
  }
  case 's':
  case 'v':
    find_scene(c == 'v');
    break;
  case 'e':
    if (ready_for_frames())
      provoke();
    break;
  case 'x':
    say_status(reset_chip());
    break;
  case 'r':
    address = hex_argument();
    say_hex(load(address));
    say("\n");
    break;
  case 'w':
    address = hex_argument();
    store(address, hex_argument());
    break;
  case '\r':
  case '\n':
  case ' ':
    return;
  default:
    help();
  }
  say("> ");
}

__attribute__((noreturn)) static void loop(void)
{
  say("> ");
  for (;;)
    command(key());
}

/* Behind an exception (start.S): an address where nothing is, for example. */
__attribute__((noreturn)) void faulted(uint32_t cause, uint32_t at, uint32_t value)
{
  port_start();
  say("exception ");
  say_number(cause, 0);
  say(" at ");
  say_hex(at);
  say(", address ");
  say_hex(value);
  say("\n");
  loop();
}

int main(void)
{
  port_start();
  say("\nFLICKER firmware, ? for help\n");
  find_chip();
  find_scene(0);
  loop();
}
