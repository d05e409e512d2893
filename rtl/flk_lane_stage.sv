// Rendering stage of lanes in the log domain (docs/reference/lanes.md): Cores cores, together one 16x16 tile, with performance counters.
//
// Stands where flk_render_stage stands and has its ports, but that it takes records as they lie in memory (record_elem_t), up to InWidth of
// each core in a cycle: the older lower, all that are valid together. Lanes is of all cores, 4, 8, 16 or 32 of each; the picture is the same.
//
// Sub-tile s of a tile is in column s % 2, row s / 2, and belongs to core s % Cores: of four cores each has one, of two each has those of a column.
// A core takes the sorted lists of its sub-tiles of a tile as one, one stream per core; each ends with a token. Every element carries its
// sub-tile's position, a token that of any of them. The cores run independently: no barrier between tiles.
// Finished pixels leave on one stream per core.
//
// Frames. idle_o: every list taken is complete and all its pixels have left. There is one mode: mode_i does not matter.
// clear_i (any number of cycles) aborts: nothing is taken while it is high, pixels that have not left are gone, and in the cycle after it the
// stage is as after reset, except for the counters.
// finished_o: of each sub-tile, about the tile of the element that in_* of its core takes: its splats change no picture any more, up to the token
// they need not come. It rises some cycles after the last pixel has finished, and is low in the cycle after the token was taken until it
// holds for the next tile.
//
// Counters: one is read at a time, COUNTER_LATENCY cycles after its address (core, then index flk_lane_pkg::LANE_CNT_*); 0 of a core that there is
// not. They stand still while hold_counters_i is high.
//
// Combinational paths: in_ready_o depends on clear_i; all other outputs come from registers.
module flk_lane_stage
  import flk_pkg::*;
  import flk_param_pkg::*;
  import flk_lane_pkg::*;
#(
  parameter int unsigned Cores   = CORES,  // 1, 2 or 4
  parameter int unsigned Lanes   = 32,     // 4, 8, 16 or 32 of each core
  parameter int unsigned InWidth = LANE_IN_WIDTH,
  parameter int unsigned Slots   = LANE_SLOTS,
  parameter int unsigned Depth   = LANE_QUEUE_DEPTH
) (
  input  logic                                  clk_i,
  input  logic                                  rst_ni,
  input  logic                                  clear_i,
  output logic                                  idle_o,
  input  logic                            [2:0] mode_i,
  // sorted lists
  input  logic         [Cores-1:0][InWidth-1:0] in_valid_i,
  output logic         [Cores-1:0]              in_ready_o,
  input  record_elem_t [Cores-1:0][InWidth-1:0] in_elem_i,
  output logic         [CORES-1:0]              finished_o,
  // finished pixels
  output logic         [Cores-1:0]              out_valid_o,
  input  logic         [Cores-1:0]              out_ready_i,
  output core_pixel_t  [Cores-1:0]              out_data_o,
  // counters
  input  logic                                  clear_counters_i,
  input  logic                                  hold_counters_i,
  input  logic          [COUNTER_ADDR_BITS-1:0] counter_addr_i,
  output logic               [COUNTER_BITS-1:0] counter_data_o
);

  if (Cores != 1 && Cores != 2 && Cores != 4) begin : gen_check_cores
    $error("flk_lane_stage: Cores must be 1, 2 or 4");
  end
  if (Lanes != 4 * Cores && Lanes != 8 * Cores && Lanes != 16 * Cores &&
      Lanes != 32 * Cores) begin : gen_check_lanes
    $error("flk_lane_stage: Lanes must be 4, 8, 16 or 32 times Cores");
  end
  if (InWidth != 1 && InWidth != 2) begin : gen_check_width
    $error("flk_lane_stage: InWidth must be 1 or 2");
  end
  if (Slots < 2 || Slots > 64 || Depth < 2 || Depth > 64) begin : gen_check_store
    $error("flk_lane_stage: Slots and Depth must be 2 to 64");
  end

  localparam int unsigned Subtiles = CORES / Cores;  // of a core

  logic [Cores-1:0] first_valid, valid, ready, core_idle, in_eos;
  logic [CORES-1:0][COUNTER_BITS-1:0] counter;
  logic [2:0] unused_mode;

  flk_stage_control #(
    .Cores(Cores)
  ) i_control (
    .clk_i,
    .rst_ni,
    .clear_i,
    .mode_i        ('0),
    .mode_o        (unused_mode),
    .idle_o,
    .in_valid_i    (first_valid),
    .in_ready_o,
    .in_eos_i      (in_eos),
    .valid_o       (valid),
    .ready_i       (ready),
    .idle_i        (core_idle),
    .counter_core_i(counter_addr_i[COUNTER_ADDR_BITS-1:COUNTER_INDEX_BITS]),
    .counter_i     (counter),
    .counter_data_o
  );

  for (genvar k = 0; k < Cores; k++) begin : gen_core
    lane_core_events_t events;
    logic [Subtiles-1:0] finished;

    for (genvar m = 0; m < Subtiles; m++) begin : gen_subtile
      assign finished_o[Cores*m+k] = finished[m];
    end

    assign first_valid[k] = in_valid_i[k][0];
    // Of the youngest: whether a list is open afterwards.
    assign in_eos[k] = in_valid_i[k][InWidth-1] ? in_elem_i[k][InWidth-1].eos
                                                : in_elem_i[k][0].eos;

    flk_lane_core #(
      .Lanes   (Lanes / Cores),
      .InWidth (InWidth),
      .Slots   (Slots),
      .Depth   (Depth),
      .Subtiles(Subtiles)
    ) i_core (
      .clk_i,
      .rst_ni,
      .clear_i,
      .idle_o     (core_idle[k]),
      .in_valid_i (valid[k] ? in_valid_i[k] : '0),
      .in_ready_o (ready[k]),
      .in_elem_i  (in_elem_i[k]),
      .finished_o (finished),
      .out_valid_o(out_valid_o[k]),
      .out_ready_i(out_ready_i[k]),
      .out_data_o (out_data_o[k]),
      .events_o   (events)
    );

    flk_lane_counters i_counters (
      .clk_i,
      .rst_ni,
      .clear_i (clear_counters_i),
      .hold_i  (hold_counters_i),
      .events_i(events),
      .addr_i  (counter_addr_i[COUNTER_INDEX_BITS-1:0]),
      .data_o  (counter[k])
    );
  end

  for (genvar k = Cores; k < CORES; k++) begin : gen_missing
    assign counter[k] = '0;
  end

  logic unused;
  assign unused = ^mode_i;

endmodule
