// Rendering half of the chip: registers of a frame, counters.
package flk_rendering_pkg;

  localparam int unsigned RENDERING_BEAT_BITS = 34;  // of an address in 64 bytes
  localparam int unsigned TILE_COORD_BITS = 8;
  localparam int unsigned STRIDE_BITS = 12;

  typedef struct packed {
    logic [2:0]                     mode;        // of the contribution test, CAT_*
    logic                           rgba;        // RGBA16F instead of RGB8
    logic [2:0][7:0]                background;  // red lowest
    logic [TILE_COORD_BITS-1:0]     pairs;       // of tiles in a row
    logic [TILE_COORD_BITS:0]       rows;        // of tiles
    logic [15:0]                    all_pairs;   // pairs times rows
    logic [RENDERING_BEAT_BITS-1:0] lists_beat;
    logic [24:0]                    chunks;      // of a list writer
    logic [RENDERING_BEAT_BITS-1:0] pointers_beat;
    logic [RENDERING_BEAT_BITS-1:0] records_beat;
    logic [RENDERING_BEAT_BITS-1:0] frame_beat;
    logic [STRIDE_BITS-1:0]         stride;      // of a row of pixels, in 32 bytes
  } rendering_registers_t;

  typedef struct packed {
    logic [31:0]      cycles;    // from start_i to done_o
    logic [3:0][31:0] entries;   // delivered, by sorting unit
    logic [3:0][31:0] readings;  // of lists
    logic [3:0][31:0] dropped;   // of finished tiles
    logic [31:0]      lines;     // of 32 bytes that the record cache read
    // Cycles in which something waits, added up over sorting units and cores.
    logic [31:0]      list_waits;      // a line of a list for its sorting unit
    logic [31:0]      sorted_waits;    // a sorted entry for its buffer
    logic [31:0]      entry_missing;   // delivery for an entry, until all pixels are there
    logic [31:0]      entry_waits;     // an entry for delivery
    logic [31:0]      queue_waits;     // a record for a core's queue
    logic [31:0]      cache_waits;     // for its line
    logic [31:0]      record_waits;    // at the end of its queue for the core
    logic [31:0]      pair_waits;      // before a core for a place in the frame writer
    logic [31:0]      frame_waits;     // a line of the frame buffer for its write
  } rendering_counters_t;

endpackage
