// Performance counters of one mask generator and rendering core, read one at a time.
//
// Index of each counter: flk_param_pkg::CNT_*; channel c's counters follow at CORE_COUNTERS + c * CHANNEL_COUNTERS.
// Counters wrap. Each adds its events of the cycle, unless `hold_i` is high; `clear_i` sets all to zero. All of it takes effect one cycle
// late, behind a register. data_o is the counter at addr_i, combinationally; 0 where there is none.
module flk_perf_counters
  import flk_pkg::*;
  import flk_param_pkg::*;
(
  input  logic                                 clk_i,
  input  logic                                 rst_ni,
  input  logic                                 clear_i,
  input  logic                                 hold_i,
  // events
  input  generator_events_t                    generator_events_i,
  input  dispatch_events_t                     dispatch_events_i,
  input  channel_events_t [CHANNELS-1:0]       channel_events_i,
  // read port
  input  logic        [COUNTER_INDEX_BITS-1:0] addr_i,
  output logic              [COUNTER_BITS-1:0] data_o
);

  // Place of a channel's counter.
  function automatic int unsigned channel(int unsigned c, int unsigned counter);
    return CORE_COUNTERS + c * CHANNEL_COUNTERS + counter;
  endfunction

  // No event counts more than 4 in a cycle.
  logic [COUNTERS_PER_CORE-1:0][2:0] inc, inc_q;
  logic clear_q;
  logic [COUNTERS_PER_CORE-1:0][COUNTER_BITS-1:0] counters_q;

  always_comb begin
    inc = '0;
    inc[CNT_CYCLES]              = 3'd1;
    inc[CNT_SUBTILES]            = 3'(generator_events_i.token);
    inc[CNT_GAUSSIANS_IN]        = 3'(generator_events_i.splat);
    inc[CNT_GAUSSIANS_REJECTED]  = 3'(generator_events_i.rejected);
    inc[CNT_CTU_BUSY]            = 3'(generator_events_i.busy);
    inc[CNT_CTU_STALLED]         = 3'(generator_events_i.stalled);
    inc[CNT_CTU_IDLE]            = 3'(generator_events_i.idle);
    inc[CNT_MINITILES_TESTED]    = generator_events_i.tested;
    inc[CNT_MINITILES_DELIVERED] = dispatch_events_i.delivered;
    inc[CNT_MINITILES_FILTERED]  = dispatch_events_i.filtered;
    for (int unsigned c = 0; c < CHANNELS; c++) begin
      inc[channel(c, CNT_CH_FIFO_FULL)]           = 3'(channel_events_i[c].fifo_full);
      inc[channel(c, CNT_CH_VRU_BUSY)]            = 3'(channel_events_i[c].vru_busy);
      inc[channel(c, CNT_CH_MINITILES_SENT)]      = 3'(channel_events_i[c].sent);
      inc[channel(c, CNT_CH_MINITILES_DISCARDED)] = 3'(channel_events_i[c].discarded);
      inc[channel(c, CNT_CH_PIXELS_FINISHED)]     = channel_events_i[c].finished;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      inc_q      <= '0;
      clear_q    <= 1'b0;
      counters_q <= '0;
    end else begin
      inc_q   <= hold_i ? '0 : inc;
      clear_q <= clear_i;
      for (int unsigned i = 0; i < COUNTERS_PER_CORE; i++) begin
        counters_q[i] <= clear_q ? '0 : counters_q[i] + COUNTER_BITS'(inc_q[i]);
      end
    end
  end

  always_comb begin
    data_o = '0;
    for (int unsigned i = 0; i < COUNTERS_PER_CORE; i++) begin
      if (addr_i == COUNTER_INDEX_BITS'(i)) begin
        data_o = counters_q[i];
      end
    end
  end

endmodule
