// Types of the rendering stage: splat record, stream elements, pixels.
//
// Formats and field meanings: docs/architecture.md.
package flk_pkg;

  typedef logic [15:0] fp16_t;

  // Pixel coordinates 0 to 7 in FP16 and E4M3: exact.
  localparam logic [7:0][15:0] PIXEL_FP16 = {
    16'h4700, 16'h4600, 16'h4500, 16'h4400, 16'h4200, 16'h4000, 16'h3c00, 16'h0000
  };
  localparam logic [7:0][7:0] PIXEL_E4M3 = {8'h4e, 8'h4c, 8'h4a, 8'h48, 8'h44, 8'h40, 8'h38, 8'h00};

  // The numbers a VRU needs of one splat.
  typedef struct packed {
    fp16_t red;
    fp16_t green;
    fp16_t blue;
    fp16_t opacity;
    fp16_t shape2;
    fp16_t shape1;
    fp16_t shape0;
    fp16_t mean_y;
    fp16_t mean_x;
  } feature_t;

  // The record of the sorted list.
  typedef struct packed {
    logic     spiky;
    feature_t feature;
  } splat_t;

  // Position of a sub-tile in the picture; in an end-of-sub-tile element it lies in the low bits.
  typedef struct packed {
    logic [flk_param_pkg::SUBTILE_COORD_BITS-1:0] row;
    logic [flk_param_pkg::SUBTILE_COORD_BITS-1:0] col;
  } subtile_t;

  // Stream element between sorting unit and CTU.
  typedef struct packed {
    logic   eos;
    splat_t splat;
  } splat_elem_t;

  // Stream element of a feature FIFO.
  typedef struct packed {
    logic     eos;
    feature_t feature;
  } feature_elem_t;

  // State of one pixel.
  typedef struct packed {
    fp16_t transmittance;
    fp16_t red;
    fp16_t green;
    fp16_t blue;
  } pixel_t;

  // Finished pixel of a channel: index within the mini-tile.
  typedef struct packed {
    subtile_t   subtile;
    logic [3:0] index;
    pixel_t     pixel;
  } channel_pixel_t;

  // Finished pixel of a core.
  typedef struct packed {
    subtile_t   subtile;
    logic [1:0] minitile;
    logic [3:0] index;
    pixel_t     pixel;
  } core_pixel_t;

  // What a CTU did in a cycle, for the performance counters.
  typedef struct packed {
    logic       busy;      // started a batch or took a token
    logic       stalled;   // had input, could not take it
    logic       idle;      // had no input
    logic       token;     // took an end of sub-tile
    logic       splat;     // took a splat
    logic       rejected;  // a splat's mask came out empty
    logic [2:0] tested;    // mask bits set by the test
  } ctu_events_t;

  // What the dispatch of a core did in a cycle.
  typedef struct packed {
    logic [2:0] delivered;  // splats written into feature FIFOs
    logic [2:0] filtered;   // mask bits dropped because the channel was finished
  } dispatch_events_t;

  // What a channel did in a cycle.
  typedef struct packed {
    logic       fifo_full;
    logic       vru_busy;   // issued a pixel to each VRU
    logic       sent;       // a splat met the unfinished mini-tile, in program order
    logic       discarded;  // dropped a splat of the finished mini-tile
    logic [2:0] finished;   // pixels that ended, at most one in each VRU
  } channel_events_t;

  localparam int unsigned SPLAT_ELEM_BITS = $bits(splat_elem_t);
  localparam int unsigned FEATURE_ELEM_BITS = $bits(feature_elem_t);
  localparam int unsigned CHANNEL_PIXEL_BITS = $bits(channel_pixel_t);
  localparam int unsigned CORE_PIXEL_BITS = $bits(core_pixel_t);

endpackage
