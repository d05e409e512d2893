// Rendering half of the chip: registers of a frame, ports.
package flk_rendering_pkg;
  import flk_axi_pkg::*;

  localparam int unsigned RENDERING_BEAT_BITS = AXI_BEAT_BITS;
  localparam int unsigned TILE_COORD_BITS = 8;
  localparam int unsigned STRIDE_BITS = 12;

  // Ports, in the order in which they go at the chip's.
  localparam int unsigned RENDERING_READERS = 2;
  localparam int unsigned RENDERING_READ_RECORDS = 0;
  localparam int unsigned RENDERING_READ_LISTS = 1;
  localparam int unsigned RENDERING_WRITERS = 1;

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

endpackage
