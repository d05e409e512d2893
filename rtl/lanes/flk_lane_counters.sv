// Performance counters of one core of the lanes, read one at a time.
//
// Index of each counter: flk_lane_pkg::LANE_CNT_*. Counters wrap. Each adds its events of the cycle, unless hold_i is high; clear_i sets all to
// zero. All of it takes effect one cycle late, behind a register. data_o is the counter at addr_i, combinationally; 0 where there is none.
module flk_lane_counters
  import flk_param_pkg::*;
  import flk_lane_pkg::*;
(
  input  logic                          clk_i,
  input  logic                          rst_ni,
  input  logic                          clear_i,
  input  logic                          hold_i,
  // events
  input  lane_core_events_t             events_i,
  // read port
  input  logic [COUNTER_INDEX_BITS-1:0] addr_i,
  output logic       [COUNTER_BITS-1:0] data_o
);

  localparam int unsigned INC_BITS = 6;  // up to 32 lanes

  logic [LANE_COUNTERS-1:0][INC_BITS-1:0] inc, inc_q;
  logic clear_q;
  logic [LANE_COUNTERS-1:0][COUNTER_BITS-1:0] counters_q;

  always_comb begin
    inc = '0;
    inc[LANE_CNT_CYCLES]             = INC_BITS'(1);
    inc[LANE_CNT_SUBTILES]           = INC_BITS'(events_i.tokens);
    inc[LANE_CNT_GAUSSIANS_IN]       = INC_BITS'(events_i.splats);
    inc[LANE_CNT_GAUSSIANS_REJECTED] = INC_BITS'(events_i.rejected);
    inc[LANE_CNT_BUSY]               = INC_BITS'(events_i.busy);
    inc[LANE_CNT_STALLED]            = INC_BITS'(events_i.stalled);
    inc[LANE_CNT_IDLE]               = INC_BITS'(events_i.idle);
    inc[LANE_CNT_DROPPED]            = INC_BITS'(events_i.dropped);
    inc[LANE_CNT_DISPATCHED]         = INC_BITS'(events_i.dispatched);
    inc[LANE_CNT_NO_SLOT]            = INC_BITS'(events_i.no_slot);
    inc[LANE_CNT_NO_ROOM]            = INC_BITS'(events_i.no_room);
    inc[LANE_CNT_ENTRIES]            = events_i.entries;
    inc[LANE_CNT_VISITS]             = events_i.visits;
    inc[LANE_CNT_SKIPPED]            = events_i.skipped;
    inc[LANE_CNT_BLENDED]            = events_i.blended;
    inc[LANE_CNT_PIXELS_FINISHED]    = events_i.finished;
    inc[LANE_CNT_STARVED]            = events_i.starved;
    inc[LANE_CNT_BANK_WAITS]         = events_i.waits;
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      inc_q      <= '0;
      clear_q    <= 1'b0;
      counters_q <= '0;
    end else begin
      inc_q   <= hold_i ? '0 : inc;
      clear_q <= clear_i;
      for (int unsigned i = 0; i < LANE_COUNTERS; i++) begin
        counters_q[i] <= clear_q ? '0 : counters_q[i] + COUNTER_BITS'(inc_q[i]);
      end
    end
  end

  always_comb begin
    data_o = '0;
    for (int unsigned i = 0; i < LANE_COUNTERS; i++) begin
      if (addr_i == COUNTER_INDEX_BITS'(i)) begin
        data_o = counters_q[i];
      end
    end
  end

endmodule
