// Round-robin arbiter of a core's lanes, whose choice is a register: the choices are those of flk_stream_arbiter, cycle for cycle.
//
// in  finished pixels of each lane (flk_lane). in_start_i: in_valid_i is high in the next cycle; without it, in_valid_i rises never. in_last_i: in_valid_i
//     falls with the transfer of this pixel; without it, it does not.
// out the pixel of the lane whose turn it is; out_valid_o as long as one has a pixel.
//
// Latency 0, throughput 1 per cycle. Combinational paths: in_valid_i and in_data_i to the output, out_ready_i to in_ready_o. clear_i (synchronous), with
// which all in_valid_i fall, lets the search start at lane 0 again.
module flk_lane_arbiter
  import flk_lane_pkg::*;
#(
  parameter  int unsigned Lanes = 8,
  localparam int unsigned LaneW = $clog2(Lanes)
) (
  input  logic                    clk_i,
  input  logic                    rst_ni,
  input  logic                    clear_i,
  // lanes
  input  logic        [Lanes-1:0] in_valid_i,
  output logic        [Lanes-1:0] in_ready_o,
  input  lane_pixel_t [Lanes-1:0] in_data_i,
  input  logic        [Lanes-1:0] in_start_i,
  input  logic        [Lanes-1:0] in_last_i,
  // finished pixels
  output logic                    out_valid_o,
  input  logic                    out_ready_i,
  output lane_pixel_t             out_data_o
);

  if (Lanes < 2 || 1 << LaneW != Lanes) begin : gen_check_lanes
    $error("flk_lane_arbiter: Lanes must be a power of two from 2 on");
  end

  // The search for the next choice takes the transfer for granted; out_ready_i, late, only says whether there is one.

  logic [LaneW-1:0] choice_d, choice_q, first;
  logic [Lanes-1:0] chosen, next;  // next: in_valid_i of the next cycle

  assign chosen = Lanes'(1) << choice_q;
  assign next   = in_start_i | (in_valid_i & ~(in_last_i & chosen));
  assign first  = out_valid_o ? choice_q + 1'b1 : choice_q;

  always_comb begin
    choice_d = first;
    for (int unsigned i = Lanes; i > 0; i--) begin
      if (next[i-1]) begin
        choice_d = LaneW'(i - 1);
      end
    end
    for (int unsigned i = Lanes; i > 0; i--) begin
      if (next[i-1] && LaneW'(i - 1) >= first) begin
        choice_d = LaneW'(i - 1);
      end
    end
    if (out_valid_o && !out_ready_i) begin
      choice_d = choice_q;
    end
    if (clear_i) begin
      choice_d = '0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      choice_q <= '0;
    end else begin
      choice_q <= choice_d;
    end
  end

  // Outputs

  assign out_valid_o = |in_valid_i;
  assign out_data_o  = in_data_i[choice_q];
  assign in_ready_o  = out_ready_i ? chosen : '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      1'b1 |=> in_valid_i == $past(clear_i ? '0 : in_start_i | (in_valid_i & ~in_last_i)
                                                  | (in_valid_i & ~in_ready_o)))
  else $error("flk_lane_arbiter: lanes with a pixel are not those that were announced");

  assert property (@(posedge clk_i) disable iff (!rst_ni) out_valid_o |-> in_valid_i[choice_q])
  else $error("flk_lane_arbiter: the lane whose turn it is has no pixel");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(choice_q))
  else $error("flk_lane_arbiter: choice changed before its transfer");
`endif

endmodule
