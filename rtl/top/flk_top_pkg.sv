// The chip: descriptor of a frame, errors, managers of the memory port.
package flk_top_pkg;
  import flk_axi_pkg::*;
  import flk_preproc_pkg::*;
  import flk_rendering_pkg::*;

  typedef logic [AXI_ADDR_BITS-1:0] address_t;

  // A frame, as the registers describe it (docs/reference/registers.md).
  typedef struct packed {
    logic [15:0]     tag;
    logic [2:0]      mode;         // of the contribution test, CAT_*
    logic            rgba;         // RGBA16F instead of RGB8
    logic [2:0][7:0] background;   // red lowest
    cull_setup_t     cull;
    lane_setup_t     lane;
    address_t        scene_table;  // bytes
    address_t        headers;
    address_t        geometry;
    address_t        colours;
    address_t        records;
    address_t        lists;
    address_t        pointers;
    address_t        frame_buffer;
    address_t        store;        // of kept colours
    logic [23:0]     store_clusters;  // for which there is room
    logic [31:0]     generation;   // 0: no colours are kept
    logic [31:0]     tolerance;    // square of what kept colours may differ by
    logic [23:0]     clusters;
    logic [22:0]     record_beats;
    logic [24:0]     chunks;       // of a list writer
    logic [16:0]     stride;       // bytes
    logic [31:0]     deadline;     // cycles from the start; 0: none
  } descriptor_t;

  // Bits of a frame's error, in the order of the enumeration error_e of rtl/regs/flk_registers.rdl.
  typedef struct packed {
    logic late;
    logic bad_header;
    logic bad_table;
    logic timed_out;
    logic aborted;
    logic descriptor;
    logic frame_write;
    logic record_read;
    logic list_read;
    logic list_memory;
    logic record_region;
    logic front_write;
    logic front_read;
  } frame_error_t;

  // Managers of the memory port; the first reader and the first writer go first. The rendering half's come before the front end's.
  localparam int unsigned READERS = RENDERING_READERS + FRONT_READERS;
  localparam int unsigned WRITERS = RENDERING_WRITERS + FRONT_WRITERS;
  localparam int unsigned READ_ID_BITS = 3;  // of identifiers of its own that a reader has in use

endpackage
