// FIFO monitor: watches the four feature FIFOs of a core, dispatches splats to them and stalls the CTU.
//
// Dispatch: a splat is written to all channels of its mask at once, as soon as each of them has room; channels whose mini-tile is
// finished for this sub-tile are left out. A token goes to all four channels.
// Stall (paper, Sec. IV-B): while any feature FIFO is full the CTU takes no new splat; what it has in flight waits in its own FIFO.
// Combinational throughout: in_ready_o depends on mask, token and the FIFOs' ready_i.
module flk_fifo_monitor
  import flk_pkg::*;
  import flk_param_pkg::*;
(
  // from the CTU
  input  logic                in_valid_i,
  output logic                in_ready_o,
  input  logic                in_eos_i,
  input  logic [CHANNELS-1:0] in_mask_i,
  output logic                stall_o,
  // feature FIFOs
  output logic [CHANNELS-1:0] write_o,
  input  logic [CHANNELS-1:0] ready_i,
  input  logic [CHANNELS-1:0] finished_i,
  // counters
  output dispatch_events_t    events_o
);

  logic [CHANNELS-1:0] target, filtered;
  logic transfer;

  assign filtered   = in_eos_i ? '0 : (in_mask_i & finished_i);
  assign target     = in_mask_i & ~filtered;
  assign in_ready_o = &(~target | ready_i);
  assign transfer   = in_valid_i && in_ready_o;
  assign write_o    = transfer ? target : '0;
  assign stall_o    = !(&ready_i);

  always_comb begin
    events_o = '0;
    if (transfer && !in_eos_i) begin
      for (int c = 0; c < CHANNELS; c++) begin
        events_o.delivered += 3'(target[c]);
        events_o.filtered  += 3'(filtered[c]);
      end
    end
  end

endmodule
