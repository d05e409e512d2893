// FIFO monitor: watches the four feature FIFOs of a core, dispatches splats to them and stalls the mask generator.
//
// Mask: one bit for each mini-tile (MaskBits 4) or for each pixel (64; bits 16 m to 16 m + 15 are the pixels of mini-tile m, which
// gets the splat when any of them is set).
// Dispatch: a splat is written to all channels of its mask at once, as soon as each of them has room; channels whose mini-tile is
// finished for this sub-tile are left out. A token goes to all four channels.
// Stall (paper, Sec. IV-B): while any feature FIFO is full the generator takes no new splat; what it has in flight waits there.
// Combinational throughout: in_ready_o depends on mask, token and the FIFOs' ready_i.
module flk_fifo_monitor
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned MaskBits = CHANNELS  // CHANNELS, or the pixels of a sub-tile
) (
  // from the mask generator
  input  logic                in_valid_i,
  output logic                in_ready_o,
  input  logic                in_eos_i,
  input  logic [MaskBits-1:0] in_mask_i,
  output logic                stall_o,
  // feature FIFOs
  output logic [CHANNELS-1:0] write_o,
  input  logic [CHANNELS-1:0] ready_i,
  input  logic [CHANNELS-1:0] finished_i,
  // counters
  output dispatch_events_t    events_o
);

  if (MaskBits != CHANNELS && MaskBits != SUBTILE * SUBTILE) begin : gen_check_mask
    $error("flk_fifo_monitor: MaskBits must be 4 (mini-tiles) or 64 (pixels)");
  end

  localparam int unsigned ChannelBits = MaskBits / CHANNELS;  // mask bits of a channel

  logic [CHANNELS-1:0] mask, target, filtered;
  logic transfer;

  for (genvar c = 0; c < CHANNELS; c++) begin : gen_mask
    assign mask[c] = |in_mask_i[ChannelBits*c+:ChannelBits];
  end

  assign filtered   = in_eos_i ? '0 : (mask & finished_i);
  assign target     = mask & ~filtered;
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
