/* Driver of FLICKER: flk.h says what, docs/guide/programming.md how to use it. */
#include "flk.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 1
#error "flk.c: double arithmetic must be done in double (on x86: -msse2 -mfpmath=sse)"
#endif

/* A field's value in its register. */
#define FIELD(name, value) (((uint32_t)(value) << name##_SHIFT) & name##_MASK)
#define GET(name, word) (((word)&name##_MASK) >> name##_SHIFT)

#define BEAT 64u
#define ADDRESS_END ((uint64_t)1 << 40)
#define TILE 16u
#define PAIR (2u * TILE)
#define STORE_SHARE 1.0125 /* of an angle's sine and of rounding, in the tolerance of kept colours */
#define MINOR_DEADLINE 1u /* of the version: since then there are deadlines, */
#define MINOR_BY_DISTANCE 2u /* frames by distance, */
#define MINOR_SH_BITS 5u     /* SH codes of fewer than 8 bits, */
#define MINOR_STORE 6u       /* kept colours, */
#define MINOR_INTERVAL 7u    /* and slower preprocessing lanes */

static const char *const STATUS_TEXT[FLK_STATUSES] = {
    [FLK_OK] = "no fault",
    [FLK_IMAGE_SHORT] = "image: shorter than its header",
    [FLK_IMAGE_MAGIC] = "image: not a memory image",
    [FLK_IMAGE_VERSION] = "image: of another version",
    [FLK_IMAGE_HEADER_CRC] = "image: wrong checksum of the image header",
    [FLK_IMAGE_FORMAT] = "image: unknown format",
    [FLK_IMAGE_COUNTS] = "image: counts that no scene has",
    [FLK_IMAGE_SIZE] = "image: not as long as its header says",
    [FLK_IMAGE_PLACE] = "image: a part does not begin where the one before ends",
    [FLK_IMAGE_PART] = "image: a part has a wrong size",
    [FLK_IMAGE_RESERVED] = "image: reserved bytes are not zero",
    [FLK_IMAGE_TABLE_CRC] = "image: wrong checksum of the cluster table",
    [FLK_IMAGE_HEADERS_CRC] = "image: wrong checksum of the cluster headers",
    [FLK_IMAGE_GEOMETRY_CRC] = "image: wrong checksum of the geometry",
    [FLK_IMAGE_COLOUR_CRC] = "image: wrong checksum of the colours",
    [FLK_IMAGE_ADDRESS] = "image: address not a multiple of 4096 or beyond 40 bits",
    [FLK_CAMERA_SIZE] = "camera: width or height not 1 to 4096",
    [FLK_CAMERA_FOCAL] = "camera: focal length not positive or too large",
    [FLK_CAMERA_POSITION] = "camera: position not finite or too large",
    [FLK_CAMERA_ROTATION] = "camera: not a rotation",
    [FLK_CAMERA_CENTRE] = "camera: principal point not finite or beyond 32767 pixels",
    [FLK_FRAME_MODE] = "frame: unknown mode or pixel format",
    [FLK_FRAME_ALIGN] = "frame: address or size not a multiple of 64",
    [FLK_FRAME_RANGE] = "frame: a region ends beyond 40 bits",
    [FLK_FRAME_RECORDS] = "frame: region of records too small, or more records than the chip counts",
    [FLK_FRAME_CHUNKS] = "frame: chunks not 1 to 2^24",
    [FLK_FRAME_DEADLINE] = "frame: the chip has no deadlines",
    [FLK_FRAME_ORDER] = "frame: the chip does not sort by distance",
    [FLK_FRAME_SH_BITS] = "frame: the chip takes SH codes of 8 bits alone",
    [FLK_FRAME_STORE] = "frame: region of kept colours too small, or generation 0",
    [FLK_FRAME_TOLERANCE] = "frame: tolerance of kept colours not 0 to 1",
    [FLK_FRAME_KEEPS] = "frame: colours are kept of scenes in chunks, on chips that can",
    [FLK_FRAME_STRIDE] = "frame: stride too small, too large or not a multiple of 32",
    [FLK_FRAME_OVERLAP] = "frame: regions overlap",
    [FLK_FRAME_LISTS] = "frame: more tiles than the chip has lists",
    [FLK_DEVICE_ID] = "chip: not found",
    [FLK_DEVICE_VERSION] = "chip: registers of another version",
    [FLK_BUSY] = "chip: not ready",
    [FLK_DEAD] = "chip: given up after a time-out",
    [FLK_WAITED] = "chip: the frame has not ended in time",
};

const char *flk_status_text(flk_status_t status)
{
  return (unsigned)status < FLK_STATUSES ? STATUS_TEXT[status] : "unknown status";
}

static uint32_t blocks(uint32_t count, uint32_t size)
{
  return count / size + (count % size != 0);
}

/* ---- scene ------------------------------------------------------------------------------------------------------------------------------ */

/* Byte places of the image header. */
enum { AT_VERSION = 8, AT_FORMAT = 10, AT_DEGREE = 12, AT_GAUSSIANS = 16, AT_CLUSTERS = 20, AT_SLOTS = 24, AT_BEATS = 28, AT_PARTS = 32 };
enum { AT_LOW = 80, AT_HIGH = 92, AT_SIGMA = 104, AT_FLAGS = 108, AT_RESERVED = 112, AT_CRC = 252, HEADER_BYTES = 256 };
enum { VERSION = 1, VERSION_SH_BITS = 2, SLOT_STEP = 16, SLOT_LIMIT = 1 << 24, CLUSTER_LIMIT = 256, MAX_DEGREE = 3, TABLE_BYTES = 32 };

static uint32_t read16(const uint8_t *at)
{
  return (uint32_t)at[0] | (uint32_t)at[1] << 8;
}

static uint32_t read32(const uint8_t *at)
{
  return read16(at) | read16(at + 2) << 16;
}

static float read_float(const uint8_t *at)
{
  const uint32_t bits = read32(at);
  float value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

/* CRC-32 of zlib, four bits at a time. */
static uint32_t crc32(const uint8_t *data, uint64_t size)
{
  uint32_t step[16], crc = 0xffffffffu;
  for (uint32_t i = 0; i < 16; i++) {
    step[i] = i;
    for (int k = 0; k < 4; k++)
      step[i] = step[i] >> 1 ^ (step[i] & 1u ? 0xedb88320u : 0u);
  }
  for (uint64_t i = 0; i < size; i++) {
    crc ^= data[i];
    crc = crc >> 4 ^ step[crc & 15u];
    crc = crc >> 4 ^ step[crc & 15u];
  }
  return ~crc;
}

flk_status_t flk_scene_open(flk_scene_t *scene, const void *image, size_t size, uint64_t address, unsigned flags)
{
  static const uint32_t cluster_header[] = {128, 64, 64}, gaussian[] = {12, 20, 20}; /* bytes, by format */
  const uint8_t *const data = image;
  flk_scene_t found;

  if (size < HEADER_BYTES)
    return FLK_IMAGE_SHORT;
  if (memcmp(data, "FLKSCENE", 8) != 0)
    return FLK_IMAGE_MAGIC;
  if (read16(data + AT_VERSION) != VERSION && read16(data + AT_VERSION) != VERSION_SH_BITS)
    return FLK_IMAGE_VERSION;
  if (crc32(data, AT_CRC) != read32(data + AT_CRC))
    return FLK_IMAGE_HEADER_CRC;
  memset(&found, 0, sizeof found);
  found.sh_bits = read16(data + AT_VERSION) == VERSION_SH_BITS;
  found.format = read16(data + AT_FORMAT);
  if (found.format > FLK_FORMAT_FP16)
    return FLK_IMAGE_FORMAT;
  found.degree = read32(data + AT_DEGREE);
  found.gaussians = read32(data + AT_GAUSSIANS);
  found.clusters = read32(data + AT_CLUSTERS);
  found.slots = read32(data + AT_SLOTS);
  if (found.degree > MAX_DEGREE || found.gaussians == 0 || found.clusters == 0 || found.slots % SLOT_STEP != 0 || found.slots > SLOT_LIMIT ||
      found.gaussians > found.slots || found.clusters > found.slots / SLOT_STEP || found.clusters < blocks(found.slots, CLUSTER_LIMIT))
    return FLK_IMAGE_COUNTS;
  found.bytes = (uint64_t)read32(data + AT_BEATS) * BEAT;
  if (size != found.bytes)
    return FLK_IMAGE_SIZE;

  /* Below 2^24 slots of at most 20 bytes and 2^20 clusters nothing here exceeds 64 bits. */
  const uint64_t bytes[FLK_COLOUR] = {
      (uint64_t)found.clusters * TABLE_BYTES, (uint64_t)found.clusters * cluster_header[found.format], (uint64_t)found.slots * gaussian[found.format]};
  uint64_t end = HEADER_BYTES / BEAT;
  for (unsigned part = 0; part < FLK_PARTS; part++) {
    const uint8_t *const entry = data + AT_PARTS + 12 * part;
    const uint64_t beats = read32(entry + 4);
    if (read32(entry) != end)
      return FLK_IMAGE_PLACE;
    if (part < FLK_COLOUR && beats != (bytes[part] + BEAT - 1) / BEAT)
      return FLK_IMAGE_PART;
    found.part[part] = address + end * BEAT;
    end += beats;
  }
  if (end * BEAT != found.bytes)
    return FLK_IMAGE_PART;
  const uint32_t image_flags = read32(data + AT_FLAGS);
  if (image_flags > 1)
    return FLK_IMAGE_RESERVED;
  found.antialiased = (int)image_flags;
  for (unsigned at = AT_RESERVED; at < AT_CRC; at++)
    if (data[at] != 0)
      return FLK_IMAGE_RESERVED;
  if (address % 4096 != 0 || address >= ADDRESS_END || found.bytes > ADDRESS_END - address)
    return FLK_IMAGE_ADDRESS;
  if ((flags & FLK_NO_PART_CRC) == 0)
    for (unsigned part = 0; part < FLK_PARTS; part++) {
      const uint8_t *const entry = data + AT_PARTS + 12 * part;
      if (crc32(data + (uint64_t)read32(entry) * BEAT, (uint64_t)read32(entry + 4) * BEAT) != read32(entry + 8))
        return (flk_status_t)(FLK_IMAGE_TABLE_CRC + part);
    }

  found.address = address;
  for (unsigned axis = 0; axis < 3; axis++) {
    found.low[axis] = read_float(data + AT_LOW + 4 * axis);
    found.high[axis] = read_float(data + AT_HIGH + 4 * axis);
  }
  found.sigma = read_float(data + AT_SIGMA);
  *scene = found;
  return FLK_OK;
}

/* ---- camera ----------------------------------------------------------------------------------------------------------------------------- */

enum { CLUSTER_M = 23, POSITION_M = 19, SHAPE_M = 11 }; /* bits of mantissa, by what the numbers are for */

uint32_t flk_ff_bits(double x, unsigned mantissa)
{
  const unsigned drop = 52 - mantissa;
  const uint64_t top = ((uint64_t)(1023 + 128) << 52) - ((uint64_t)1 << drop);
  uint64_t bits, magnitude;
  memcpy(&bits, &x, sizeof bits);
  magnitude = bits & 0x7fffffffffffffffu;
  magnitude += ((uint64_t)1 << (drop - 1)) - 1 + (magnitude >> drop & 1);
  magnitude = magnitude >> drop << drop;
  if (magnitude > top)
    magnitude = top;
  if (magnitude < (uint64_t)(1023 - 126) << 52)
    return 0;
  return (uint32_t)((magnitude >> drop) - ((uint64_t)(1023 - 127) << mantissa)) | (uint32_t)(bits >> 63) << (8 + mantissa);
}

static int usable(double x)
{
  return isfinite(x) && fabs(x) <= 1e30;
}

enum { MAX_MIDDLE = 32767 }; /* pixels */

/* Principal point on an axis: pixels, pixel centres on integers. */
static double centre(uint32_t size, double off)
{
  return 0.5 * ((double)size - 1.0) + off;
}

static flk_status_t camera_check(const flk_camera_t *camera)
{
  const double *const r = camera->rotation;
  if (camera->width < 1 || camera->width > FLK_MAX_PICTURE || camera->height < 1 || camera->height > FLK_MAX_PICTURE)
    return FLK_CAMERA_SIZE;
  if (!usable(camera->fx) || !usable(camera->fy) || !(camera->fx > 0) || !(camera->fy > 0))
    return FLK_CAMERA_FOCAL;
  for (int i = 0; i < 3; i++)
    if (!usable(camera->position[i]))
      return FLK_CAMERA_POSITION;
  for (int i = 0; i < 9; i++)
    if (!(fabs(r[i]) <= 2))
      return FLK_CAMERA_ROTATION;
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++)
      if (fabs(r[i] * r[k] + r[3 + i] * r[3 + k] + r[6 + i] * r[6 + k] - (i == k)) > 1e-3)
        return FLK_CAMERA_ROTATION;
  if (r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]) < 0)
    return FLK_CAMERA_ROTATION;
  if (!(fabs(centre(camera->width, camera->off_x)) <= MAX_MIDDLE) || !(fabs(centre(camera->height, camera->off_y)) <= MAX_MIDDLE))
    return FLK_CAMERA_CENTRE;
  return FLK_OK;
}

flk_status_t flk_camera_registers(flk_camera_registers_t *registers, const flk_camera_t *camera)
{
  const flk_status_t status = camera_check(camera);
  if (status != FLK_OK)
    return status;
  const double *const r = camera->rotation;
  const double focal[2] = {camera->fx, camera->fy};
  const double off[2] = {camera->off_x, camera->off_y};
  const uint32_t size[2] = {camera->width, camera->height};
  const double slack = 1.0 + 0x1p-14;
  const double margin = 3.0 * sqrt(0.3 + sqrt(0.1)) + 2.0; /* of a radius in pixels: dilation, rounding */
  double least[2], limit[2], slope[2], normal[5][3] = {{0.0, 0.0, 1.0}};

  for (int axis = 0; axis < 2; axis++) {
    const double f = focal[axis], n = size[axis];
    const double middle = centre(size[axis], off[axis]), beyond = (double)(TILE * blocks(size[axis], TILE));
    const double half = 1.3 * 0.5 * n;
    least[axis] = (-half - off[axis]) / f;
    limit[axis] = (half - off[axis]) / f;
    slope[axis] = -least[axis] > limit[axis] ? -least[axis] : limit[axis];
    normal[1 + 2 * axis][axis] = f;
    normal[1 + 2 * axis][2] = middle + margin;
    normal[2 + 2 * axis][axis] = -f;
    normal[2 + 2 * axis][2] = beyond - middle + margin;
  }
  const double largest = focal[0] > focal[1] ? focal[0] : focal[1];
  const double reach = 3.0 * largest * sqrt(1.0 + (slope[0] * slope[0] + slope[1] * slope[1]));

  for (int i = 0; i < 3; i++) {
    registers->position[i] = flk_ff_bits(camera->position[i], CLUSTER_M);
    for (int k = 0; k < 3; k++)
      registers->view[3 * k + i] = flk_ff_bits(r[3 * i + k], POSITION_M);
    registers->row_x[i] = flk_ff_bits(camera->fx * r[3 * i], SHAPE_M);
    registers->row_x_z[i] = flk_ff_bits(camera->fx * r[3 * i + 2], SHAPE_M);
    registers->row_y[i] = flk_ff_bits(camera->fy * r[3 * i + 1], SHAPE_M);
    registers->row_y_z[i] = flk_ff_bits(camera->fy * r[3 * i + 2], SHAPE_M);
    for (int k = 0; k < 5; k++)
      registers->normal[3 * k + i] = flk_ff_bits(normal[k][0] * r[3 * i] + normal[k][1] * r[3 * i + 1] + normal[k][2] * r[3 * i + 2], CLUSTER_M);
  }
  for (int k = 0; k < 5; k++) {
    registers->offset[k] = k == 0 ? flk_ff_bits(-0.2 * (1.0 - 0x1p-14), CLUSTER_M) : 0;
    registers->reach[k] = flk_ff_bits((k == 0 ? 0x1p-14 : reach) * slack, CLUSTER_M);
  }
  for (int axis = 0; axis < 2; axis++) {
    registers->focal[axis] = flk_ff_bits(focal[axis], POSITION_M);
    registers->least[axis] = flk_ff_bits(least[axis], SHAPE_M);
    registers->limit[axis] = flk_ff_bits(limit[axis], SHAPE_M);
    registers->middle[axis] = (uint32_t)(int32_t)floor(centre(size[axis], off[axis]) * 128.0 + 0.5) & FLK_MIDDLE_VALUE_MASK;
  }
  registers->off_centre = off[0] != 0.0 || off[1] != 0.0;
  return FLK_OK;
}

/* ---- sizes of regions ------------------------------------------------------------------------------------------------------------------- */

enum { FACTORED_RECORD_BYTES = 16, CONIC_RECORD_BYTES = 32 };
/* Runs of lists that the chip's sorting units do not hold: four units, 64 runs of 228 lines. */
enum { RUN_BYTES = 4 * 64 * 228 * 64 };
enum { STORE_BYTES = 32 * 64 }; /* of kept colours, a cluster */
enum { WRITERS = 4, CHUNK_BYTES = 512, CHUNK_ENTRIES = 72, POINTERS_PER_LINE = 16, MAX_CHUNKS = 1 << 24 };

/* Lists of each writer: every other tile in both directions. */
static uint32_t lists_of(uint32_t width, uint32_t height)
{
  return blocks(width, PAIR) * blocks(height, PAIR);
}

uint64_t flk_record_bytes(const flk_scene_t *scene, uint32_t form)
{
  return (uint64_t)scene->slots * (form == FLK_FORM_CONIC ? CONIC_RECORD_BYTES : FACTORED_RECORD_BYTES);
}

uint32_t flk_list_chunks(uint32_t width, uint32_t height, uint64_t entries)
{
  const uint64_t chunks = lists_of(width, height) + entries / CHUNK_ENTRIES + 64;
  return chunks < MAX_CHUNKS ? (uint32_t)chunks : MAX_CHUNKS;
}

uint64_t flk_list_bytes(uint32_t chunks)
{
  return (uint64_t)chunks * WRITERS * CHUNK_BYTES + RUN_BYTES;
}

uint64_t flk_pointer_bytes(uint32_t width, uint32_t height)
{
  return (uint64_t)blocks(lists_of(width, height), POINTERS_PER_LINE) * WRITERS * BEAT;
}

uint32_t flk_least_stride(uint32_t width, unsigned pixel_format)
{
  return blocks(width, PAIR) * PAIR * (pixel_format == FLK_RGBA16F ? 8u : 3u);
}

uint64_t flk_frame_bytes(uint32_t height, uint32_t stride)
{
  return (uint64_t)blocks(height, TILE) * TILE * stride;
}

uint64_t flk_store_bytes(const flk_scene_t *scene)
{
  return (uint64_t)scene->clusters * STORE_BYTES;
}

void flk_frame_fill(const flk_frame_t *frame, void *buffer)
{
  const uint32_t bytes = flk_least_stride(frame->camera.width, frame->pixel_format);
  const uint32_t rows = blocks(frame->camera.height, TILE) * TILE;
  for (uint32_t y = 0; y < rows; y++) {
    uint8_t *const row = (uint8_t *)buffer + (size_t)y * frame->stride;
    for (uint32_t i = 0; i < bytes; i++)
      row[i] = frame->pixel_format == FLK_RGBA16F ? 0 : frame->background[i % 3];
  }
}

/* ---- frame ------------------------------------------------------------------------------------------------------------------------------ */

typedef struct {
  uint64_t base, size;
} span_t;

enum { RECORDS, LISTS, POINTERS, OWN, FRAME_BUFFER = OWN, STORE, SCENE, SPANS };

static void spans_of(span_t span[SPANS], const flk_frame_t *frame)
{
  const flk_region_t *const region = &frame->region;
  span[RECORDS] = (span_t){region->records, region->record_bytes};
  span[LISTS] = (span_t){region->lists, flk_list_bytes(region->chunks)};
  span[POINTERS] = (span_t){region->pointers, flk_pointer_bytes(frame->camera.width, frame->camera.height)};
  span[FRAME_BUFFER] = (span_t){frame->frame_buffer, flk_frame_bytes(frame->camera.height, frame->stride)};
  span[STORE] = frame->store != NULL ? (span_t){frame->store->address, flk_store_bytes(frame->scene)} : (span_t){0, 0};
  span[SCENE] = (span_t){frame->scene->address, frame->scene->bytes};
}

static int overlap(const span_t *a, const span_t *b)
{
  return a->base < b->base + b->size && b->base < a->base + a->size;
}

flk_status_t flk_frame_check(const flk_frame_t *frame, const flk_frame_t *other, uint32_t form, uint32_t lists)
{
  const flk_camera_t *const camera = &frame->camera;
  const flk_region_t *const region = &frame->region;
  const uint64_t record_bytes = flk_record_bytes(frame->scene, form);
  span_t span[SPANS], others[SPANS];

  if (camera->width < 1 || camera->width > FLK_MAX_PICTURE || camera->height < 1 || camera->height > FLK_MAX_PICTURE)
    return FLK_CAMERA_SIZE;
  if (frame->mode > FLK_CAT_AUTO || frame->pixel_format > FLK_RGBA16F)
    return FLK_FRAME_MODE;
  if (region->chunks < 1 || region->chunks > MAX_CHUNKS)
    return FLK_FRAME_CHUNKS;
  if (region->record_bytes < record_bytes || record_bytes / BEAT > FLK_RECORD_BEATS_VALUE_MASK)
    return FLK_FRAME_RECORDS;
  if (frame->stride < flk_least_stride(camera->width, frame->pixel_format) || frame->stride % 32 != 0 || frame->stride > FLK_STRIDE_VALUE_MASK)
    return FLK_FRAME_STRIDE;
  if (lists != 0 && lists_of(camera->width, camera->height) > lists)
    return FLK_FRAME_LISTS;
  if (frame->store != NULL) {
    if (frame->scene->format != FLK_FORMAT_CHUNK || form != FLK_FORM_FACTORED)
      return FLK_FRAME_KEEPS;
    if (frame->store->generation == 0 || frame->store->bytes < flk_store_bytes(frame->scene))
      return FLK_FRAME_STORE;
    if (frame->store->address % STORE_BYTES != 0)
      return FLK_FRAME_ALIGN;
    if (!(frame->store->tolerance >= 0.0 && frame->store->tolerance <= 1.0))
      return FLK_FRAME_TOLERANCE;
  }
  spans_of(span, frame);
  for (unsigned i = 0; i < SCENE; i++) {
    if (span[i].base % BEAT != 0 || (i == RECORDS && span[i].size % BEAT != 0))
      return FLK_FRAME_ALIGN;
    if (span[i].base >= ADDRESS_END || span[i].size > ADDRESS_END - span[i].base)
      return FLK_FRAME_RANGE;
  }
  for (unsigned i = 0; i < SPANS; i++)
    for (unsigned k = 0; k < i; k++)
      if (overlap(&span[i], &span[k]))
        return FLK_FRAME_OVERLAP;
  if (other != NULL) {
    spans_of(others, other);
    for (unsigned i = 0; i < SPANS; i++)
      for (unsigned k = 0; k < SPANS; k++)
        /* Two frames may share scene, frame buffer and kept colours. */
        if ((i < OWN || i != k) && overlap(&span[i], &others[k]))
          return FLK_FRAME_OVERLAP;
  }
  return FLK_OK;
}

/* ---- chip ------------------------------------------------------------------------------------------------------------------------------- */

static uint32_t get(const flk_device_t *device, uint32_t offset)
{
  return device->bus.read(device->bus.user, offset);
}

static void put(const flk_device_t *device, uint32_t offset, uint32_t value)
{
  device->bus.write(device->bus.user, offset, value);
}

static void put_all(const flk_device_t *device, uint32_t offset, const uint32_t *values, unsigned count)
{
  for (unsigned i = 0; i < count; i++)
    put(device, offset + 4 * i, values[i]);
}

static void put_address(const flk_device_t *device, uint32_t low, uint32_t high, uint64_t address)
{
  put(device, low, (uint32_t)address);
  put(device, high, (uint32_t)(address >> 32));
}

flk_status_t flk_probe(flk_device_t *device, const flk_bus_t *bus)
{
  memset(device, 0, sizeof *device);
  device->bus = *bus;
  if (get(device, FLK_ID_OFFSET) != FLK_ID_VALUE_RESET)
    return FLK_DEVICE_ID;
  const uint32_t version = get(device, FLK_VERSION_OFFSET);
  if (GET(FLK_VERSION_MAJOR, version) != FLK_VERSION_MAJOR_RESET)
    return FLK_DEVICE_VERSION;
  device->minor = GET(FLK_VERSION_MINOR, version);
  const uint32_t capability = get(device, FLK_CAPABILITY_OFFSET);
  device->stage = GET(FLK_CAPABILITY_STAGE, capability);
  device->form = GET(FLK_CAPABILITY_FORM, capability);
  device->precision = GET(FLK_CAPABILITY_PRECISION, capability);
  device->vrus = GET(FLK_CAPABILITY_VRUS, capability);
  device->mask_generator = GET(FLK_CAPABILITY_MASK_GENERATOR, capability);
  device->lanes = (uint32_t)1 << GET(FLK_CAPABILITY_LOG2_LANES, capability);
  device->lists = (uint32_t)1 << GET(FLK_CAPABILITY_LOG2_LISTS, capability);
  device->beat = (uint32_t)1 << GET(FLK_CAPABILITY_LOG2_BEAT, capability);
  /* Chips of before have four of each. */
  const uint32_t units = device->minor < 4 ? 0x2222 : get(device, FLK_CAPABILITY_UNITS_OFFSET);
  device->cores = (uint32_t)1 << (units & 15);
  device->preproc_lanes = (uint32_t)1 << (units >> 4 & 15);
  device->preproc_interval = device->minor < MINOR_INTERVAL ? 2 : (uint32_t)1 << (units >> 16 & 15);
  device->list_writers = (uint32_t)1 << (units >> 8 & 15);
  device->sort_units = (uint32_t)1 << (units >> 12 & 15);
  device->colour_store = device->minor >= MINOR_STORE && GET(FLK_CAPABILITY_COLOUR_STORE, capability) != 0;
  device->started = (uint16_t)GET(FLK_FRAMES_STARTED, get(device, FLK_FRAMES_OFFSET));
  return FLK_OK;
}

flk_status_t flk_ready(flk_device_t *device)
{
  const uint32_t status = get(device, FLK_STATUS_OFFSET);
  if (GET(FLK_STATUS_DEAD, status) != 0)
    return FLK_DEAD;
  return GET(FLK_STATUS_READY, status) != 0 ? FLK_OK : FLK_BUSY;
}

flk_status_t flk_frame_write(flk_device_t *device, const flk_frame_t *frame, const flk_frame_t *other)
{
  const flk_scene_t *const scene = frame->scene;
  const flk_region_t *const region = &frame->region;
  flk_camera_registers_t camera;
  flk_status_t status = flk_frame_check(frame, other, device->form, device->lists);
  if (status == FLK_OK)
    status = flk_camera_registers(&camera, &frame->camera);
  if (status == FLK_OK && frame->deadline != 0 && device->minor < MINOR_DEADLINE)
    status = FLK_FRAME_DEADLINE;
  if (status == FLK_OK && frame->by_distance != 0 && device->minor < MINOR_BY_DISTANCE)
    status = FLK_FRAME_ORDER;
  if (status == FLK_OK && scene->sh_bits != 0 && device->minor < MINOR_SH_BITS)
    status = FLK_FRAME_SH_BITS;
  if (status == FLK_OK && frame->store != NULL && !device->colour_store)
    status = FLK_FRAME_KEEPS;
  if (status == FLK_OK)
    status = flk_ready(device);
  if (status != FLK_OK)
    return status;

  put(device, FLK_FRAME_OFFSET,
      FIELD(FLK_FRAME_TAG, frame->tag) | FIELD(FLK_FRAME_MODE, frame->mode) | FIELD(FLK_FRAME_RGBA, frame->pixel_format == FLK_RGBA16F) |
          FIELD(FLK_FRAME_BOX, frame->box != 0) | FIELD(FLK_FRAME_CHUNKED, scene->format == FLK_FORMAT_CHUNK) |
          FIELD(FLK_FRAME_ANTIALIASED, scene->antialiased != 0) | FIELD(FLK_FRAME_OFF_CENTRE, camera.off_centre != 0) |
          FIELD(FLK_FRAME_BY_DISTANCE, frame->by_distance != 0));
  put(device, FLK_BACKGROUND_OFFSET,
      FIELD(FLK_BACKGROUND_RED, frame->background[0]) | FIELD(FLK_BACKGROUND_GREEN, frame->background[1]) |
          FIELD(FLK_BACKGROUND_BLUE, frame->background[2]));
  put(device, FLK_SIZE_OFFSET, FIELD(FLK_SIZE_WIDTH, frame->camera.width) | FIELD(FLK_SIZE_HEIGHT, frame->camera.height));
  put_address(device, FLK_TABLE_LOW_OFFSET, FLK_TABLE_HIGH_OFFSET, scene->part[FLK_TABLE]);
  put_address(device, FLK_HEADERS_LOW_OFFSET, FLK_HEADERS_HIGH_OFFSET, scene->part[FLK_HEADERS]);
  put_address(device, FLK_GEOMETRY_LOW_OFFSET, FLK_GEOMETRY_HIGH_OFFSET, scene->part[FLK_GEOMETRY]);
  put_address(device, FLK_COLOURS_LOW_OFFSET, FLK_COLOURS_HIGH_OFFSET, scene->part[FLK_COLOUR]);
  put_address(device, FLK_RECORDS_LOW_OFFSET, FLK_RECORDS_HIGH_OFFSET, region->records);
  put_address(device, FLK_LISTS_LOW_OFFSET, FLK_LISTS_HIGH_OFFSET, region->lists);
  put_address(device, FLK_POINTERS_LOW_OFFSET, FLK_POINTERS_HIGH_OFFSET, region->pointers);
  put_address(device, FLK_FRAME_BUFFER_LOW_OFFSET, FLK_FRAME_BUFFER_HIGH_OFFSET, frame->frame_buffer);
  put(device, FLK_CLUSTERS_OFFSET, scene->clusters);
  /* A region may be larger than any scene's records. */
  const uint64_t record_beats = region->record_bytes / BEAT;
  put(device, FLK_RECORD_BEATS_OFFSET, record_beats < FLK_RECORD_BEATS_VALUE_MASK ? (uint32_t)record_beats : FLK_RECORD_BEATS_VALUE_MASK);
  put(device, FLK_CHUNKS_OFFSET, region->chunks);
  put(device, FLK_STRIDE_OFFSET, frame->stride);
  if (device->minor >= MINOR_DEADLINE)
    put(device, FLK_DEADLINE_OFFSET, frame->deadline);
  if (frame->store != NULL) {
    const double share = frame->store->tolerance / STORE_SHARE;
    put_address(device, FLK_STORE_LOW_OFFSET, FLK_STORE_HIGH_OFFSET, frame->store->address);
    put(device, FLK_STORE_BEATS_OFFSET, (uint32_t)(flk_store_bytes(scene) / BEAT));
    put(device, FLK_TOLERANCE_OFFSET, flk_ff_bits(share * share, CLUSTER_M));
  }
  if (device->colour_store)
    put(device, FLK_GENERATION_OFFSET, frame->store != NULL ? frame->store->generation : 0);
  put_all(device, FLK_POSITION_OFFSET, camera.position, FLK_POSITION_COUNT);
  put_all(device, FLK_NORMAL_OFFSET, camera.normal, FLK_NORMAL_COUNT);
  put_all(device, FLK_OFFSET_OFFSET, camera.offset, FLK_OFFSET_COUNT);
  put_all(device, FLK_REACH_OFFSET, camera.reach, FLK_REACH_COUNT);
  put_all(device, FLK_VIEW_OFFSET, camera.view, FLK_VIEW_COUNT);
  put_all(device, FLK_FOCAL_OFFSET, camera.focal, FLK_FOCAL_COUNT);
  put_all(device, FLK_ROW_X_OFFSET, camera.row_x, FLK_ROW_X_COUNT);
  put_all(device, FLK_ROW_X_Z_OFFSET, camera.row_x_z, FLK_ROW_X_Z_COUNT);
  put_all(device, FLK_ROW_Y_OFFSET, camera.row_y, FLK_ROW_Y_COUNT);
  put_all(device, FLK_ROW_Y_Z_OFFSET, camera.row_y_z, FLK_ROW_Y_Z_COUNT);
  put_all(device, FLK_LIMIT_OFFSET, camera.limit, FLK_LIMIT_COUNT);
  if (camera.off_centre != 0) {
    put_all(device, FLK_MIDDLE_OFFSET, camera.middle, FLK_MIDDLE_COUNT);
    put_all(device, FLK_LEAST_OFFSET, camera.least, FLK_LEAST_COUNT);
  }
  return FLK_OK;
}

flk_status_t flk_start(flk_device_t *device, uint16_t *number)
{
  const flk_status_t status = flk_ready(device);
  if (status != FLK_OK)
    return status;
  put(device, FLK_CONTROL_OFFSET, FIELD(FLK_CONTROL_START, 1));
  device->started++;
  device->region ^= 1;
  if (number != NULL)
    *number = device->started;
  return FLK_OK;
}

unsigned flk_next_region(const flk_device_t *device)
{
  return device->region;
}

flk_status_t flk_poll(flk_device_t *device, uint16_t number)
{
  const uint32_t finished = GET(FLK_FRAMES_FINISHED, get(device, FLK_FRAMES_OFFSET));
  const int ended = (uint16_t)(finished - number) < 0x8000u;
  if (GET(FLK_STATUS_DEAD, get(device, FLK_STATUS_OFFSET)) == 0)
    return ended ? FLK_OK : FLK_BUSY;
  /* A time-out counts frames that it forgets as finished: only one whose result waits for its release has ended. */
  return ended && GET(FLK_INTERRUPT_FRAME_DONE, get(device, FLK_INTERRUPT_OFFSET)) != 0 ? FLK_OK : FLK_DEAD;
}

flk_status_t flk_wait(flk_device_t *device, uint16_t number, uint32_t polls, flk_pause_t pause, void *user)
{
  for (uint32_t done = 1;; done++) {
    const flk_status_t status = flk_poll(device, number);
    if (status != FLK_BUSY)
      return status;
    if ((polls != 0 && done >= polls) || (pause != NULL && pause(user) != 0))
      return FLK_WAITED;
  }
}

flk_result_t flk_result(flk_device_t *device)
{
  const uint32_t word = get(device, FLK_RESULT_OFFSET);
  const uint32_t pairs = device->minor >= MINOR_DEADLINE ? get(device, FLK_PROGRESS_OFFSET) : 0;
  return (flk_result_t){(uint16_t)GET(FLK_RESULT_TAG, word), (uint16_t)GET(FLK_RESULT_ERROR, word), (uint16_t)GET(FLK_PROGRESS_PAIRS, pairs)};
}

void flk_release(flk_device_t *device)
{
  put(device, FLK_INTERRUPT_OFFSET, FLK_INTERRUPT_FRAME_DONE_MASK);
}

const char *flk_error_text(unsigned error)
{
  static const char *const text[] = FLK_ERROR_TEXTS;
  return error < sizeof text / sizeof *text && text[error] != NULL ? text[error] : "unknown error";
}

void flk_abort(flk_device_t *device)
{
  put(device, FLK_CONTROL_OFFSET, FIELD(FLK_CONTROL_ABORT, 1));
}

void flk_reset(flk_device_t *device)
{
  put(device, FLK_CONTROL_OFFSET, FIELD(FLK_CONTROL_RESET, 1));
  device->started = 0;
  device->region = 0;
}

void flk_set_timeout(flk_device_t *device, uint32_t cycles)
{
  put(device, FLK_TIMEOUT_OFFSET, cycles);
}

uint32_t flk_counter(flk_device_t *device, uint32_t index)
{
  put(device, FLK_COUNTER_SELECT_OFFSET, FIELD(FLK_COUNTER_SELECT_INDEX, index));
  return get(device, FLK_COUNTER_VALUE_OFFSET);
}

void flk_interrupt_enable(flk_device_t *device, uint32_t mask)
{
  put(device, FLK_INTERRUPT_ENABLE_OFFSET, mask);
}

uint32_t flk_interrupt_pending(flk_device_t *device)
{
  return get(device, FLK_INTERRUPT_OFFSET);
}

void flk_interrupt_acknowledge(flk_device_t *device, uint32_t mask)
{
  put(device, FLK_INTERRUPT_OFFSET, mask);
}
