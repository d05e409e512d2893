/* Driver of FLICKER (docs/guide/programming.md): scenes, descriptors of frames, the sequence of a frame.
 *
 * C99 with libc and libm only; no memory is allocated, no state is kept but in flk_device_t. Addresses are the chip's, in bytes. The arithmetic of cameras is that
 * of the golden model bit for bit: IEEE 754 double, compiled without contraction of a product and a sum (-ffp-contract=off). */
#ifndef FLK_H
#define FLK_H

#include <stddef.h>
#include <stdint.h>

#include "flk_registers.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
  FLK_OK = 0,
  /* flk_scene_open */
  FLK_IMAGE_SHORT,      /* fewer bytes than an image header has */
  FLK_IMAGE_MAGIC,      /* not a memory image */
  FLK_IMAGE_VERSION,    /* of another version */
  FLK_IMAGE_HEADER_CRC, /* wrong checksum of the image header */
  FLK_IMAGE_FORMAT,     /* an unknown format */
  FLK_IMAGE_COUNTS,     /* counts of Gaussians, clusters and slots that no scene has */
  FLK_IMAGE_SIZE,       /* not as long as the image header says */
  FLK_IMAGE_PLACE,      /* a part that does not begin where the one before ends */
  FLK_IMAGE_PART,       /* a part whose size does not follow from the counts, or beyond the image */
  FLK_IMAGE_RESERVED,   /* reserved bytes that are not zero */
  FLK_IMAGE_TABLE_CRC,  /* wrong checksum of the cluster table, */
  FLK_IMAGE_HEADERS_CRC, /* of the cluster headers, */
  FLK_IMAGE_GEOMETRY_CRC, /* of the geometry, */
  FLK_IMAGE_COLOUR_CRC, /* of the colours */
  FLK_IMAGE_ADDRESS,    /* address that is no multiple of 4096, or ends beyond 40 bits */
  /* flk_camera_registers */
  FLK_CAMERA_SIZE,     /* width or height not 1 to 4096 */
  FLK_CAMERA_FOCAL,    /* focal length not positive, or beyond 1e30 */
  FLK_CAMERA_POSITION, /* position not finite, or beyond 1e30 */
  FLK_CAMERA_ROTATION, /* not a rotation */
  FLK_CAMERA_CENTRE,   /* principal point not finite, or beyond 32767 pixels */
  /* flk_frame_check */
  FLK_FRAME_MODE,    /* unknown mode of the contribution test, or unknown pixel format */
  FLK_FRAME_ALIGN,   /* an address or a size that is no multiple of 64, or kept colours' of 2048 */
  FLK_FRAME_RANGE,   /* a region that ends beyond 40 bits */
  FLK_FRAME_RECORDS, /* region of records too small for the scene, or the scene too large for the chip's records */
  FLK_FRAME_CHUNKS,  /* chunks not 1 to 2^24 */
  FLK_FRAME_STRIDE,  /* stride too small, too large or no multiple of 32 */
  FLK_FRAME_OVERLAP, /* regions that overlap */
  FLK_FRAME_LISTS,   /* more tiles than the chip has lists */
  FLK_FRAME_DEADLINE, /* a deadline, on a chip of version 3.0, which has none */
  FLK_FRAME_ORDER,    /* by distance, on a chip older than version 3.2, which sorts by depth alone */
  FLK_FRAME_SH_BITS,  /* a scene with SH codes of fewer than 8 bits, on a chip older than version 3.5 */
  FLK_FRAME_STORE,     /* region of kept colours too small for the scene, or generation 0 */
  FLK_FRAME_TOLERANCE, /* tolerance of kept colours not 0 to 1 */
  FLK_FRAME_KEEPS,     /* kept colours of a scene that is not in chunks, or on a chip that keeps none */
  /* the chip */
  FLK_DEVICE_ID,      /* no FLICKER at this address */
  FLK_DEVICE_VERSION, /* registers of another major version */
  FLK_BUSY,           /* not ready for a frame, or the frame has not ended */
  FLK_DEAD,           /* given up after a time-out: only flk_reset helps */
  FLK_WAITED,         /* the bound of flk_wait is reached */
  FLK_STATUSES
} flk_status_t;

/* English, without a full stop; never NULL. */
const char *flk_status_text(flk_status_t status);

/* ---- scene ------------------------------------------------------------------------------------------------------------------------------ */

enum { FLK_FORMAT_CHUNK, FLK_FORMAT_FP16_LOCAL, FLK_FORMAT_FP16 };
enum { FLK_TABLE, FLK_HEADERS, FLK_GEOMETRY, FLK_COLOUR, FLK_PARTS };

/* A packed scene (docs/reference/memory_image.md) in the chip's memory. */
typedef struct {
  uint64_t address, bytes;     /* of the image */
  uint32_t format;             /* FLK_FORMAT_* */
  uint32_t degree;             /* largest SH degree */
  uint32_t gaussians, clusters, slots;
  uint64_t part[FLK_PARTS];    /* addresses */
  float low[3], high[3];       /* box of the means */
  float sigma;                 /* largest standard deviation */
  int antialiased;             /* drawn with the opacities of Mip-Splatting */
  int sh_bits;                 /* SH codes of some cluster have fewer than 8 bits */
} flk_scene_t;

#define FLK_NO_PART_CRC 1u /* flag: the parts' checksums are not computed, so that only the image header is read */

/* Check an image of `size` bytes at `image`, as the host sees it, that lies at `address` for the chip. Nothing beyond `size` is read. `scene` is written when all
 * is well. What the parts hold is checked by their checksums only. */
flk_status_t flk_scene_open(flk_scene_t *scene, const void *image, size_t size, uint64_t address, unsigned flags);

/* ---- camera ----------------------------------------------------------------------------------------------------------------------------- */

#define FLK_MAX_PICTURE 4096u

/* rotation: row by row, camera to world; columns right, down, forward. position: centre, in the world. fx, fy: focal lengths in pixels. off_x, off_y: of the
 * principal point from the middle of the picture, right and down, in pixels; of a file that counts from the picture's corner cx - width / 2, cy - height / 2. */
typedef struct {
  double rotation[9], position[3], fx, fy;
  uint32_t width, height;
  double off_x, off_y;
} flk_camera_t;

/* What the registers of the same names take. */
typedef struct {
  uint32_t position[FLK_POSITION_COUNT], normal[FLK_NORMAL_COUNT], offset[FLK_OFFSET_COUNT], reach[FLK_REACH_COUNT], view[FLK_VIEW_COUNT];
  uint32_t focal[FLK_FOCAL_COUNT], row_x[FLK_ROW_X_COUNT], row_x_z[FLK_ROW_X_Z_COUNT], row_y[FLK_ROW_Y_COUNT], row_y_z[FLK_ROW_Y_Z_COUNT];
  uint32_t least[FLK_LEAST_COUNT], limit[FLK_LIMIT_COUNT], middle[FLK_MIDDLE_COUNT];
  int off_centre; /* frame.off_centre */
} flk_camera_registers_t;

flk_status_t flk_camera_registers(flk_camera_registers_t *registers, const flk_camera_t *camera);

/* ff number nearest to a finite or infinite x, with 10 to 23 bits of mantissa (docs/reference/ff.md): its bits. */
uint32_t flk_ff_bits(double x, unsigned mantissa);

/* ---- sizes of regions, in bytes ------------------------------------------------------------------------------------------------------------ */

enum { FLK_RGB8, FLK_RGBA16F }; /* pixel format: 3 bytes over the background; red, green, blue, alpha in FP16 */

/* form: of the chip (flk_device_t), FLK_FORM_*; records have 32 bytes in conic form, 16 in factored form. */
uint64_t flk_record_bytes(const flk_scene_t *scene, uint32_t form);
/* Chunks of each list writer for `entries` Gaussians in tiles, all together, in the worst order; two for each Gaussian of the scene are a good guess. When a frame ends with
 * list_memory, there were more: four times as many chunks, once more. */
uint32_t flk_list_chunks(uint32_t width, uint32_t height, uint64_t entries);
/* Of lists, and behind them of runs, which long lists are sorted in: 3.7 MB. */
uint64_t flk_list_bytes(uint32_t chunks);
uint64_t flk_pointer_bytes(uint32_t width, uint32_t height);
uint32_t flk_least_stride(uint32_t width, unsigned pixel_format);
uint64_t flk_frame_bytes(uint32_t height, uint32_t stride); /* of a frame buffer: whole rows of tiles */
uint64_t flk_store_bytes(const flk_scene_t *scene);         /* of kept colours */

/* ---- frame ------------------------------------------------------------------------------------------------------------------------------ */

/* Memory that the chip writes on the way, one for each frame under way. */
typedef struct {
  uint64_t records, record_bytes;
  uint64_t lists;
  uint32_t chunks; /* of each list writer */
  uint64_t pointers;
} flk_region_t;

/* Colours that are kept from frame to frame (docs/reference/colour_store.md). All frames of a scene may name the same one, those under way too. Its memory holds zeros before
 * its first frame, or what frames of other generations have left. After a frame with FLK_ERROR_FRONT_WRITE, and after flk_reset, take a new generation. */
typedef struct {
  uint64_t address, bytes; /* address: a multiple of 2048 */
  uint32_t generation; /* 1 to 2^32 - 1: another one for another scene */
  double tolerance;    /* by how much a channel may differ from what the camera would show, 0 to 1, such as 2.0 / 255; 0: of a camera that does not move alone */
} flk_store_t;

typedef struct {
  const flk_scene_t *scene;
  flk_camera_t camera;
  flk_region_t region;
  uint64_t frame_buffer;
  uint32_t stride;       /* bytes of a row of pixels */
  unsigned pixel_format; /* FLK_RGB8, FLK_RGBA16F */
  uint8_t background[3]; /* red, green, blue, of FLK_RGB8 */
  unsigned mode;         /* of the contribution test, FLK_CAT_* */
  int box;               /* lists by boxes of 3 standard deviations; else by ellipses */
  uint16_t tag;          /* comes back in the result */
  uint32_t deadline;     /* cycles from the start, after which the frame ends as it is, with FLK_ERROR_LATE; 0: none */
  int by_distance;       /* sorted by distance to the camera; else by depth along its axis */
  const flk_store_t *store; /* colours are kept there; NULL: none are */
} flk_frame_t;

/* What would make a wrong picture or write beyond regions. other: frame that may be under way beside this one, whose region this one must not touch; or NULL.
 * form, lists: of the chip (flk_device_t); lists 0: not known. The camera is checked by flk_frame_write. */
flk_status_t flk_frame_check(const flk_frame_t *frame, const flk_frame_t *other, uint32_t form, uint32_t lists);

/* ---- chip ------------------------------------------------------------------------------------------------------------------------------- */

/* How registers are reached: offset in bytes, a multiple of 4; 32 bits, in the order of the calls. */
typedef struct {
  uint32_t (*read)(void *user, uint32_t offset);
  void (*write)(void *user, uint32_t offset, uint32_t value);
  void *user;
} flk_bus_t;

typedef struct {
  flk_bus_t bus;
  uint32_t minor;                        /* of the version */
  uint32_t stage, form, precision; /* what the chip was built with */
  uint32_t vrus, mask_generator;   /* of a stage of channels */
  uint32_t lanes;                  /* of a stage of lanes */
  uint32_t lists;                        /* of a list writer: pictures have at most 4 as many tiles, whole pairs in each direction */
  uint32_t beat;                         /* bytes of the memory port's data */
  uint32_t cores, preproc_lanes, list_writers, sort_units; /* units of a kind */
  uint32_t preproc_interval;             /* cycles from a Gaussian of a preprocessing lane to the next */
  int colour_store;                      /* colours can be kept */
  uint16_t started;                      /* number of the frame that was started last, modulo 2^16 */
  unsigned region;                       /* 0 or 1 */
} flk_device_t;

typedef struct {
  uint16_t tag;   /* of the frame that ended last */
  uint16_t error; /* 1 << FLK_ERROR_*; 0: none */
  uint16_t pairs; /* of tiles written, the first ones of the walk (docs/reference/rendering.md); all of them in a frame without an error */
} flk_result_t;

/* Fill the picture in a frame buffer, which the host sees at `buffer`, with the background (of FLK_RGBA16F: transparent black): what a late frame does not write
 * shows it. Without that, the picture before shows through. Bytes behind the rows stay. */
void flk_frame_fill(const flk_frame_t *frame, void *buffer);

/* Called between polls; another value than 0 ends the wait. */
typedef int (*flk_pause_t)(void *user);

/* Find the chip; fills device. */
flk_status_t flk_probe(flk_device_t *device, const flk_bus_t *bus);

/* Check a frame and write its descriptor. FLK_BUSY while the chip is not ready: nothing is written. other: as in flk_frame_check. */
flk_status_t flk_frame_write(flk_device_t *device, const flk_frame_t *frame, const flk_frame_t *other);

/* Start the frame whose descriptor has been written; number, for flk_poll and flk_wait, may be NULL. FLK_BUSY while the chip is not ready: nothing happens. */
flk_status_t flk_start(flk_device_t *device, uint16_t *number);

/* Which of two regions the next frame takes, 0 or 1; a start moves on. */
unsigned flk_next_region(const flk_device_t *device);

/* FLK_OK: the frame has ended, with errors or without (an abort ends those that it forgets); FLK_BUSY: not yet. Of a frame before which all are released.
 * FLK_DEAD: a time-out has ended it; after a time-out FLK_OK tells of a frame that ended before and waits for flk_release, FLK_DEAD of all others. */
flk_status_t flk_poll(flk_device_t *device, uint16_t number);
/* FLK_OK: a start is taken; FLK_BUSY: not yet; FLK_DEAD. */
flk_status_t flk_ready(flk_device_t *device);

/* Poll until a frame has ended; those before it must have been released. polls: at most so many, 0: without bound. pause: may be NULL. FLK_WAITED when either has ended the wait. */
flk_status_t flk_wait(flk_device_t *device, uint16_t number, uint32_t polls, flk_pause_t pause, void *user);

/* Of the frame that ended last; it stays, with its counters, until flk_release, whatever happens meanwhile but flk_reset. Before the first frame: 0. After an
 * abort or a time-out it tells of that, as soon as no frame waits for its release. */
flk_result_t flk_result(flk_device_t *device);
/* The result has been read: the next frame may end. Once for each frame, or the one after it never ends. Clears interrupt.frame_done and no other interrupt. */
void flk_release(flk_device_t *device);
/* Text of bit `error` of a result; never NULL. */
const char *flk_error_text(unsigned error);

void flk_abort(flk_device_t *device); /* all frames under way are forgotten; one that has ended still waits for flk_release */
/* Of all but the registers; frames count from 0. The chip's side of memory must be in reset from before the call until flk_ready says FLK_OK. */
void flk_reset(flk_device_t *device);
void flk_set_timeout(flk_device_t *device, uint32_t cycles); /* without progress; 0: never */
uint32_t flk_counter(flk_device_t *device, uint32_t index);

/* Masks of FLK_INTERRUPT_*_MASK. */
void flk_interrupt_enable(flk_device_t *device, uint32_t mask);
uint32_t flk_interrupt_pending(flk_device_t *device);
void flk_interrupt_acknowledge(flk_device_t *device, uint32_t mask);

#ifdef __cplusplus
}
#endif

#endif
