// Rendering half of the chip: registers of a frame.
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

endpackage
