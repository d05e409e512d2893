// Small sizes of the lanes' types for the proof of flk_lane_core: setup and masks of one stage, and splats that carry their mask.
// What is counted, and which pixels a lane has, is as in the generated package.
package flk_lane_pkg;

  localparam int unsigned SETUP_STAGES = 1;
  localparam int unsigned ROW_MASK_STAGES = 1;
  localparam int unsigned RESULT_BITS = 1;
  localparam int unsigned C_BITS = 1;

  // w and z are the mask; s0 and the colours are what a proof wants to find again.
  typedef struct packed {
    logic [31:0] w;
    logic [31:0] z;
    logic [1:0]  s0;
    logic        s1;
    logic        s2;
    logic [21:0] lo;
    logic [1:0]  red;
    logic [1:0]  green;
    logic [1:0]  blue;
  } lane_splat_t;

  typedef struct packed {
    logic        w;
    logic        z;
    logic [1:0]  s0;
    logic        s1;
    logic        s2;
    logic [21:0] lo;
  } lane_shape_t;

  typedef logic [2:0][1:0] lane_colour_t;

  typedef struct packed {
    flk_pkg::subtile_t      subtile;
    logic [2:0]             column;
    logic [2:0]             row;
    logic [RESULT_BITS-1:0] s;
    logic [2:0][C_BITS-1:0] colour;
  } lane_pixel_t;

  typedef struct packed {
    logic visited;
    logic skipped;
    logic blended;
    logic finished;
  } lane_events_t;

  typedef struct packed {
    logic       busy;
    logic       stalled;
    logic       idle;
    logic [1:0] tokens;
    logic [1:0] splats;
    logic [1:0] rejected;
    logic [1:0] dropped;
    logic       dispatched;
    logic       no_slot;
    logic       no_room;
    logic [5:0] entries;
    logic [5:0] visits;
    logic [5:0] skipped;
    logic [5:0] blended;
    logic [5:0] finished;
    logic [5:0] starved;
    logic [5:0] waits;
  } lane_core_events_t;

  function automatic logic [2:0] lane_row(int unsigned lanes, int unsigned lane, int unsigned p);
    case (lanes)
      8:       return 3'(p);
      16:      return 3'(lane / 4 + 4 * (p / 2));
      default: return 3'(lane / 8 + 4 * p);
    endcase
  endfunction

  function automatic logic [2:0] lane_column(int unsigned lanes, int unsigned lane, int unsigned p);
    case (lanes)
      8:       return 3'(lane + 5 * p);
      16:      return 3'(lane % 4 + 4 * (p % 2));
      default: return 3'(lane % 8);
    endcase
  endfunction

  function automatic int unsigned lane_pixel(int unsigned lanes, int unsigned lane, int unsigned p);
    logic [2:0] row, column;
    row    = lane_row(lanes, lane, p);
    column = lane_column(lanes, lane, p);
    return 32'({row[2], column[2], row[1:0], column[1:0]});
  endfunction

  typedef struct packed {
    logic              eos;
    logic [127:0]      record;
    flk_pkg::subtile_t subtile;
  } record_elem_t;

endpackage
