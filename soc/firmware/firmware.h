/* What the parts of the firmware share. */
#ifndef FIRMWARE_H
#define FIRMWARE_H

#include "../../sw/flk.h"
#include "port.h"

enum { BLOCK = 65536, PATH_HEAD = 16 }; /* scene and path lie at multiples of BLOCK in RAM */

typedef struct {
  flk_device_t device;
  int present;        /* the chip is there */
  flk_scene_t scene;
  int found;          /* a scene is there */
  uint32_t path, views; /* cameras that lie in RAM, or none; how many */
  uint32_t view;        /* the one that is used */
  flk_camera_t camera;
  uint32_t region[2];   /* where two frames' memory begins, with their frame buffer; the end of RAM behind them */
  uint32_t region_bytes;
} firmware_t;

extern firmware_t g;

/* What a frame cost. */
typedef struct {
  uint32_t set_up, start_to_end, asleep;
  flk_result_t result;
} cost_t;

const flk_bus_t *chip_bus(void);
void say_status(flk_status_t status); /* a line: name and text of a status */
void say_errors(uint16_t error);      /* likewise of each bit of a result */
flk_frame_t frame_of(const flk_camera_t *camera, unsigned region);
/* Write, start, sleep until the end, read the result. The frame is not released: its counters are still there. */
flk_status_t run_frame(const flk_frame_t *frame, cost_t *cost);
uint32_t picture_sum(const flk_frame_t *frame);
flk_status_t reset_chip(void); /* the memory is taken away from it meanwhile */
uint32_t crc(const uint8_t *data, uint32_t size);
void refused_descriptor(void);
void provoke(void); /* every error */
flk_status_t sleep_until(uint32_t mask, uint32_t *slept, uint32_t *when); /* an interrupt of mask; acknowledges all but frame_done; adds to *slept */

#endif
