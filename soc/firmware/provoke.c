/* Every error of the driver and of the chip (docs/guide/programming.md), each provoked and told in a line; then the next frame must be right. */
#include "firmware.h"

#include <math.h>
#include <string.h>

enum { HEAD = 256, IMAGE_BYTES = 256 + 64 + 64 + 320 + 64 };

static void put16(uint8_t *at, uint32_t value)
{
  at[0] = (uint8_t)value;
  at[1] = (uint8_t)(value >> 8);
}

static void put32(uint8_t *at, uint32_t value)
{
  put16(at, value);
  put16(at + 2, value >> 16);
}

static void seal(uint8_t *image)
{
  put32(image + 252, crc(image, 252));
}

/* The smallest image: a Gaussian in 16 slots of a cluster, of zeros. */
static void small_image(uint8_t *image)
{
  static const uint8_t beats[4] = {1, 1, 5, 1};
  memset(image, 0, IMAGE_BYTES);
  memcpy(image, "FLKSCENE", 8);
  put16(image + 8, 1);
  put16(image + 10, FLK_FORMAT_FP16);
  put32(image + 16, 1);
  put32(image + 20, 1);
  put32(image + 24, 16);
  put32(image + 28, IMAGE_BYTES / 64);
  uint32_t at = HEAD / 64;
  for (int part = 0; part < 4; part++) {
    put32(image + 32 + 12 * part, at);
    put32(image + 36 + 12 * part, beats[part]);
    put32(image + 40 + 12 * part, crc(image + 64 * at, 64u * beats[part]));
    at += beats[part];
  }
  seal(image);
}

static void images(void)
{
  /* Byte of the header, what is added to it; whether the header gets its checksum; whether the parts are looked at. */
  static const struct {
    uint8_t at, change, sealed, parts;
  } fault[] = {
      {0, 1, 0, 0},  {8, 2, 0, 0},  {12, 1, 0, 0},  {10, 1, 1, 0}, {16, 255, 1, 0}, {28, 1, 1, 0}, {32, 1, 1, 0},
      {36, 1, 1, 0}, {112, 1, 1, 0}, {40, 1, 1, 1}, {52, 1, 1, 1},  {64, 1, 1, 1}, {76, 1, 1, 1},
  };
  static uint8_t image[IMAGE_BYTES];
  flk_scene_t scene;
  small_image(image);
  say_status(flk_scene_open(&scene, image, IMAGE_BYTES, 0, 0));
  say_status(flk_scene_open(&scene, image, HEAD - 1, 0, 0));
  say_status(flk_scene_open(&scene, image, IMAGE_BYTES, 64, 0));
  for (unsigned i = 0; i < sizeof fault / sizeof *fault; i++) {
    small_image(image);
    image[fault[i].at] = (uint8_t)(image[fault[i].at] + fault[i].change);
    if (fault[i].sealed)
      seal(image);
    say_status(flk_scene_open(&scene, image, IMAGE_BYTES, 0, fault[i].parts ? 0 : FLK_NO_PART_CRC));
  }
}

static void camera(const flk_camera_t *changed)
{
  flk_camera_registers_t registers;
  say_status(flk_camera_registers(&registers, changed));
}

static void cameras(void)
{
  flk_camera_t c = g.camera;
  c.width = 0;
  camera(&c);
  c = g.camera;
  c.fx = 0;
  camera(&c);
  c = g.camera;
  c.position[1] = INFINITY;
  camera(&c);
  c = g.camera;
  c.rotation[4] += 1;
  camera(&c);
  c = g.camera;
  c.off_x = 40000;
  camera(&c);
}

static flk_frame_t small_frame(unsigned region)
{
  flk_camera_t c = g.camera;
  c.width = c.height = 16;
  return frame_of(&c, region);
}

static void check(const flk_frame_t *frame, const flk_frame_t *other, uint32_t lists)
{
  say_status(flk_frame_check(frame, other, g.device.form, lists));
}

static void frames(void)
{
  const flk_frame_t good = small_frame(0);
  flk_frame_t f = good;
  flk_device_t old = g.device;
  f.mode = 9;
  check(&f, NULL, 0);
  f = good;
  f.frame_buffer += 1;
  check(&f, NULL, 0);
  f = good;
  f.frame_buffer = (uint64_t)1 << 40;
  check(&f, NULL, 0);
  f = good;
  f.region.record_bytes = 0;
  check(&f, NULL, 0);
  f = good;
  f.region.chunks = 0;
  check(&f, NULL, 0);
  f = good;
  f.stride = 1;
  check(&f, NULL, 0);
  check(&good, &good, 0);
  f = good;
  f.camera.width = 64;
  f.stride = flk_least_stride(64, f.pixel_format);
  check(&f, NULL, 1);
  /* A chip of an older version, which the driver has found. */
  old.minor = 0;
  f = good;
  f.deadline = 1;
  say_status(flk_frame_write(&old, &f, NULL));
  f = good;
  f.by_distance = 1;
  say_status(flk_frame_write(&old, &f, NULL));
  flk_scene_t narrow = *good.scene;
  narrow.sh_bits = 1;
  f = good;
  f.scene = &narrow;
  say_status(flk_frame_write(&old, &f, NULL));
  flk_store_t store = {.address = 0, .bytes = 0, .generation = 1, .tolerance = 0.0};
  f = good;
  f.store = &store;
  check(&f, NULL, 0);
  store.bytes = flk_store_bytes(good.scene);
  store.tolerance = 2.0;
  check(&f, NULL, 0);
  flk_scene_t halves = *good.scene;
  halves.format = FLK_FORMAT_FP16;
  f.scene = &halves;
  check(&f, NULL, 0);
}

/* A bus with nothing on it, and one with a chip of the next major version. */
static uint32_t read_nothing(void *user, uint32_t offset)
{
  (void)user;
  return offset == FLK_ID_OFFSET ? 0xffffffffu : 0;
}

static uint32_t read_newer(void *user, uint32_t offset)
{
  (void)user;
  return offset == FLK_ID_OFFSET ? FLK_ID_VALUE_RESET : offset == FLK_VERSION_OFFSET ? FLK_VERSION_MAJOR_RESET + 1 : 0;
}

static void devices(void)
{
  flk_device_t device;
  flk_bus_t bus = *chip_bus();
  bus.read = read_nothing;
  say_status(flk_probe(&device, &bus));
  bus.read = read_newer;
  say_status(flk_probe(&device, &bus));
}

/* A frame and its errors. */
static void run(const flk_frame_t *frame)
{
  cost_t cost;
  const flk_status_t status = run_frame(frame, &cost);
  if (status != FLK_OK) {
    say_status(status);
    return;
  }
  say_errors(cost.result.error);
  flk_release(&g.device);
}

/* The small frame again: its sum must be that of before. */
static void again(uint32_t wanted, const char *behind)
{
  cost_t cost;
  const flk_frame_t frame = small_frame(0);
  const flk_status_t status = run_frame(&frame, &cost);
  if (status == FLK_OK)
    flk_release(&g.device);
  else
    say_status(status);
  say(status == FLK_OK && cost.result.error == 0 && picture_sum(&frame) == wanted ? "the frame behind " : "WRONG: the frame behind ");
  say(behind);
  say(" is right\n");
}

static void results(uint32_t wanted)
{
  const flk_frame_t good = small_frame(0);
  const uint32_t beyond = RAM_BEGIN + RAM_BYTES;
  uint32_t slept = 0, when;
  uint16_t number;
  flk_status_t status;
  flk_scene_t scene = g.scene;
  flk_frame_t f = good;

  /* Regions outside RAM. */
  scene.part[FLK_TABLE] = beyond;
  f.scene = &scene;
  run(&f);
  f = good;
  f.region.records = beyond;
  run(&f);
  f = good;
  f.frame_buffer = beyond;
  run(&f);
  /* Fewer records than the scene has, which the driver believes. */
  scene = g.scene;
  scene.slots = 16;
  f = good;
  f.scene = &scene;
  f.region.record_bytes = 256;
  run(&f);
  f = small_frame(0);
  f.camera.width = f.camera.height = 64;
  f.stride = flk_least_stride(64, f.pixel_format);
  f.region = frame_of(&f.camera, 0).region;
  f.region.chunks = 1;
  run(&f);
  /* Answers to reads of records, of lists are errors. */
  for (uint32_t fail = 1; fail <= 2; fail++) {
    store(CSR_FLICKER_FAIL_ADDR, fail);
    run(&good);
    store(CSR_FLICKER_FAIL_ADDR, 0);
  }
  refused_descriptor();
  f = good;
  f.deadline = 100;
  run(&f);

  /* Floats of the table and of a header that are not numbers; then the image is as before. */
  for (unsigned part = FLK_TABLE; part <= FLK_HEADERS; part++) {
    const uint32_t at = (uint32_t)g.scene.part[part];
    uint32_t kept[8];
    forget_cache();
    for (unsigned i = 0; i < 8; i++) {
      kept[i] = load(at + 4 * i);
      store(at + 4 * i, 0x7fc07fc0u);
    }
    run(&good);
    for (unsigned i = 0; i < 8; i++)
      store(at + 4 * i, kept[i]);
  }

  /* The chip does not interrupt: the firmware gives up its sleep, and polls. */
  status = flk_frame_write(&g.device, &good, NULL);
  if (status == FLK_OK)
    status = flk_start(&g.device, &number);
  if (status == FLK_OK) {
    say_status(flk_poll(&g.device, number));
    say_status(flk_wait(&g.device, number, 1, NULL, NULL));
    say_status(sleep_until_chip(2000, &slept, &when) ? FLK_OK : FLK_WAITED);
    say_status(flk_wait(&g.device, number, 0, NULL, NULL));
    flk_release(&g.device);
  }
  again(wanted, "an interrupt that did not come");

  status = flk_frame_write(&g.device, &good, NULL);
  if (status == FLK_OK)
    status = flk_start(&g.device, NULL);
  flk_abort(&g.device);
  if (status == FLK_OK)
    status = sleep_until(FLK_INTERRUPT_ABORTED_MASK, &slept, &when);
  say_errors(flk_result(&g.device).error);
  if (flk_interrupt_pending(&g.device) & FLK_INTERRUPT_FRAME_DONE_MASK)
    flk_release(&g.device); /* it had ended before */
  again(wanted, "an abort");

  flk_set_timeout(&g.device, 4);
  run(&good);
  say_errors(flk_result(&g.device).error);
  /* A start that is not waited for is ignored, and told. */
  chip_bus()->write(NULL, FLK_CONTROL_OFFSET, FLK_CONTROL_START_MASK);
  say(flk_interrupt_pending(&g.device) & FLK_INTERRUPT_REFUSED_MASK ? "FLK_INTERRUPT_REFUSED: a start while the chip was not ready\n" : "WRONG: a start was taken\n");
  flk_set_timeout(&g.device, FLK_TIMEOUT_CYCLES_RESET);
  say_status(reset_chip());
  again(wanted, "a time-out");

  status = flk_frame_write(&g.device, &good, NULL);
  if (status == FLK_OK)
    status = flk_start(&g.device, NULL);
  say_status(reset_chip());
  again(wanted, "a reset");
}

void provoke(void)
{
  cost_t cost;
  const flk_frame_t frame = small_frame(0);
  const flk_status_t status = run_frame(&frame, &cost);
  if (status != FLK_OK) {
    say_status(status);
    return;
  }
  say_errors(cost.result.error);
  flk_release(&g.device);
  const uint32_t wanted = picture_sum(&frame);
  images();
  cameras();
  frames();
  devices();
  results(wanted);
}
