// Types of the preprocessing core: what its units hand to each other (docs/reference/front_end.md).
package flk_preproc_pkg;
  import flk_axi_pkg::*;
  import flk_front_pkg::*;

  localparam int unsigned LANES = 4;             // at most, and Gaussians of a group
  localparam int unsigned SEQ_BITS = 12;         // of a survivor's number in its frame, modulo
  localparam int unsigned NUMBER_BITS = 24;      // of a record
  localparam int unsigned BEAT_BITS = AXI_BEAT_BITS;
  localparam int unsigned PLACE_BEAT_BITS = 7;   // of a beat of records that is being put together

  // Ports of the front end, in the order in which they go at the chip's.
  localparam int unsigned FRONT_READERS = 4;
  localparam int unsigned FRONT_READ_POINTERS = 0;  // where not all are held
  localparam int unsigned FRONT_READ_COLOURS = 1;
  localparam int unsigned FRONT_READ_GEOMETRY = 2;  // and headers
  localparam int unsigned FRONT_READ_TABLE = 3;
  localparam int unsigned FRONT_WRITERS = 2;
  localparam int unsigned FRONT_WRITE_POINTERS = 0;
  localparam int unsigned FRONT_WRITE_LINES = 1;    // of records, lists, colours and pointers

  // Registers of a frame that the cluster test takes: ff numbers of 23 bits.
  typedef struct packed {
    cluster_t [2:0]      position;
    cluster_t [4:0][2:0] normal;
    cluster_t [4:0]      offset;
    cluster_t [4:0]      reach;
  } cull_setup_t;

  // Registers of a frame that the lanes take.
  typedef struct packed {
    logic                      chunked;  // the image's format
    logic                      box;      // lists by boxes of 3 standard deviations
    logic                      antialiased;  // opacities have their factor
    logic                      by_distance;  // keys of distances; else of depths
    logic [12:0]               width;    // pixels
    logic [12:0]               height;
    position_t [2:0][2:0]      view;
    position_t [1:0]           focal;
    shape_t [2:0]              row_x;
    shape_t [2:0]              row_x_z;
    shape_t [2:0]              row_y;
    shape_t [2:0]              row_y_z;
    shape_t [1:0]              least;    // of the slopes in the projection's derivative
    shape_t [1:0]              limit;
    logic signed [1:0][22:0]   middle;   // principal point, 1/128 pixel
  } lane_setup_t;

  // A cluster that is kept.
  typedef struct packed {
    logic [23:0] index;   // in the table
    logic [19:0] first;   // first slot / 16
    logic [7:0]  last;    // Gaussians - 1
    logic [1:0]  degree;  // of spherical harmonics
  } kept_t;

  // The same for the colour store: its box and the code of its colours' slope.
  typedef struct packed {
    logic [23:0]    index;
    cluster_t [2:0] low;
    cluster_t [2:0] high;
    logic [5:0]     slope;
  } boxed_t;

  // What the lanes take of a cluster's header, and where its colours lie.
  typedef struct packed {
    logic [31:0]               colour;      // first beat of its colours in their array
    logic [8:0]                sh_zero;
    position_t [2:0]           low;         // of the means, less the camera's position
    position_t [2:0]           step;
    logic signed [2:0][26:0]   scale_low;   // fixed point, 20 fraction bits
    logic [2:0][16:0]          scale_step;
    term_t [2:0]               dc_low;      // fixed point, 13 fraction bits
    colour_t [2:0]             dc_step;
    colour_t [2:0][2:0]        sh_step;     // by degree, channel
  } header_t;

  // Four neighbouring Gaussians of a cluster, as they lie in the image.
  typedef struct packed {
    kept_t                cluster;
    header_t              header;
    logic                 first;  // of its cluster
    logic                 last;
    logic [5:0]           group;  // number in the cluster: Gaussians 4 group to 4 group + 3
    logic [3:0]           used;   // which of them exist
    logic [3:0][4:0][31:0] word;  // geometry: three words of a chunk (0 to 2), or five of FP16
  } group_t;

  // Clusters whose colours may be under way, and what the lanes take of their headers for colours.
  localparam int unsigned CLUSTER_BITS = 4;  // of a running number, modulo
  localparam int unsigned COLOUR_CLUSTERS = 8;
  typedef logic [CLUSTER_BITS-1:0] cluster_index_t;

  typedef struct packed {
    logic [8:0]         sh_zero;
    term_t [2:0]        dc_low;   // fixed point, 13 fraction bits
    colour_t [2:0]      dc_step;
    colour_t [2:0][2:0] sh_step;  // by degree, channel
  } colour_header_t;

  // Half bytes from four SH coefficients of a Gaussian to the next four: of a chunk with codes of 3 to 6 or 8 bits, by the half codes of zero (8, 16, 32,
  // 64 of fewer than 8); of FP16.
  typedef logic [5:0] colour_step_t;

  function automatic colour_step_t colour_step(input logic chunked, input logic [8:0] zero);
    unique case (zero)
      9'd8: return chunked ? 6'd9 : 6'd48;
      9'd16: return chunked ? 6'd12 : 6'd48;
      9'd32: return chunked ? 6'd15 : 6'd48;
      9'd64: return chunked ? 6'd18 : 6'd48;
      default: return chunked ? 6'd24 : 6'd48;
    endcase
  endfunction

  // Bytes from a Gaussian's colour to the next: whole words with codes of 8 bits and in FP16.
  function automatic logic [6:0] colour_stride(input colour_step_t step, input logic [1:0] degree);
    unique case (degree)
      2'd0: return step == 6'd48 ? 7'd8 : 7'd4;
      2'd1: begin
        unique case (step)
          6'd9: return 7'd8;
          6'd12: return 7'd9;
          6'd15: return 7'd10;
          6'd18: return 7'd11;
          6'd24: return 7'd16;
          default: return 7'd28;
        endcase
      end
      2'd2: return step == 6'd48 ? 7'd56 : 7'd4 + 7'(step);
      default: begin
        unique case (step)
          6'd9: return 7'd21;
          6'd12: return 7'd27;
          6'd15: return 7'd33;
          6'd18: return 7'd38;
          6'd24: return 7'd52;
          default: return 7'd100;
        endcase
      end
    endcase
  endfunction

  // Survivors of a group, for their colours.
  typedef struct packed {
    cluster_index_t cluster;
    logic [31:0]    colour;  // first beat of the cluster's colours, from the colour array's first
    logic [6:0]     stride;  // of the cluster's Gaussians
    colour_step_t   step;
    logic [1:0]     degree;
    logic [5:0]     group;
    logic [1:0]     at;      // place in it of the first of those that come together
    logic [3:0]     alive;
  } survivors_t;

  // Part of a Gaussian's colour: the constant part and opacity with the first, up to four
  // coefficients. Codes of a chunk, or FP16.
  typedef struct packed {
    cluster_index_t          cluster;
    logic                    stored;   // dc holds a record's codes; there are no coefficients
    logic                    first;
    logic                    last;
    logic [1:0]              part;
    logic [3:0]              used;     // coefficients that exist
    logic [15:0]             opacity;
    logic [2:0][15:0]        dc;
    logic [3:0][2:0][15:0]   raw;      // by coefficient, channel
  } colour_part_t;

  // The colour store (docs/reference/colour_store.md): 32 beats a cluster, of which the first is the head and 22 are rows of 12 entries.
  localparam int unsigned STORE_ROW = 12;
  localparam int unsigned STORE_ROWS = 22;
  localparam int unsigned STORE_LINE_BITS = 5;
  typedef logic [BEAT_BITS-STORE_LINE_BITS-1:0] store_slot_t;  // of a cluster: its first beat / 32

  // Registers of a frame.
  typedef struct packed {
    logic                 enable;
    store_slot_t          first;       // of the first cluster
    logic [31:0]          generation;
    cluster_t             limit;       // square of what colours may differ by
  } store_setup_t;

  // A head: bits 255:0 of its beat are zero but for generation and position, which lie lowest.

  typedef struct packed {
    logic [3:0][63:0] there;       // colours that are stored, by Gaussian of the cluster
    logic [31:0]      generation;
    logic [2:0][31:0] position;    // of the camera that they are for
  } store_head_t;

  typedef struct packed {
    logic [7:0]      opacity;
    logic [2:0][9:0] colour;  // as in a record
  } store_entry_t;

  // A cluster with what may be shown of it.
  typedef struct packed {
    store_slot_t      slot;
    logic             storing;  // this frame's colours are stored
    logic [3:0][63:0] there;
  } stored_t;

  // Row of a group's Gaussians: a third of its number.
  function automatic logic [4:0] store_row(input logic [5:0] group);
    return 5'((12'(group) * 12'd43) >> 7);
  endfunction

  // Bits of a record that are not always zero: all of 16 bytes in factored form, the lowest of 32 in conic form.
  localparam int unsigned FACTORED_RECORD_BITS = 128;
  localparam int unsigned CONIC_RECORD_BITS = 177;

  // Where a survivor's record goes: beat and quarter of a ring of beats that are being put together. A record of 32
  // bytes takes two quarters; the place is that of the first.
  typedef struct packed {
    logic [PLACE_BEAT_BITS-1:0] beat;
    logic [1:0]                 quarter;
  } place_t;

  // A splat to be listed.
  typedef struct packed {
    logic [SEQ_BITS-1:0]    seq;
    logic [NUMBER_BITS-1:0] number;  // of its record
    logic [23:0]            key;
    logic                   empty;   // in no tile
    logic signed [30:0]     x;       // mean, 1/128 pixel
    logic signed [30:0]     y;
    logic [11:0]            x0;      // bounds, pixels
    logic [11:0]            x1;
    logic [11:0]            y0;
    logic [11:0]            y1;
    logic signed [29:0]     right;   // see flk_splat_band
    shape_t                 l2;
    shape_t                 i0;
    shape_t                 kappa;
    shape_t                 limit;
  } listed_t;

  // An entry of a tile's list.
  typedef struct packed {
    logic [SEQ_BITS-1:0]    seq;
    logic [7:0]             row;     // of the tile
    logic [7:0]             column;
    logic [23:0]            key;
    logic [NUMBER_BITS-1:0] number;
    logic [3:0]             mask;    // bit 2 y + x of its sub-tiles
  } entry_t;

  // A beat of records: where it goes and which quarters come.
  typedef struct packed {
    logic [BEAT_BITS-1:0] beat;
    logic [3:0]           quarters;
  } record_beat_t;

  // Registers of a frame.
  typedef struct packed {
    cull_setup_t          cull;
    lane_setup_t          lane;
    store_setup_t         store;
    logic [BEAT_BITS-1:0] table_beat;     // where the image's parts begin
    logic [BEAT_BITS-1:0] headers_beat;
    logic [BEAT_BITS-1:0] geometry_beat;
    logic [BEAT_BITS-1:0] colours_beat;
    logic [23:0]          clusters;
    logic [BEAT_BITS-1:0] records_beat;   // where records go, and how many beats there are
    logic [22:0]          record_beats;
    logic [BEAT_BITS-1:0] lists_beat;     // where lists go, and the chunks of each writer
    logic [24:0]          chunks;
    logic [BEAT_BITS-1:0] pointers_beat;  // where pointers go, and lines of each writer
    logic [10:0]          pointer_lines;
    logic [7:0]           list_columns;   // of a writer
  } front_registers_t;

  // Why a frame failed: bits.
  localparam int unsigned FRONT_ERROR_READ = 0;     // the memory answered a read with an error
  localparam int unsigned FRONT_ERROR_WRITE = 1;    // or a write
  localparam int unsigned FRONT_ERROR_RECORDS = 2;  // slots of a cluster lie beyond the records
  localparam int unsigned FRONT_ERROR_LISTS = 3;    // a list writer needed a chunk more than it has
  localparam int unsigned FRONT_ERROR_TABLE = 4;    // a float of the cluster table is not finite
  localparam int unsigned FRONT_ERROR_HEADER = 5;   // or of a cluster's header
  localparam int unsigned FRONT_ERRORS = 6;

endpackage
