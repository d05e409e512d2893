// Turns at a flk_priority_arbiter inside a unit: nobody waits for more than Patience + Inputs - 1 transfers of others,
// and manager 0 only for those that were passed over Patience times.
//
// passed_i: the arbiter's counts. One input (pick_i, constant) stands for all. The inputs may do anything: one that
// takes its request back begins anew.
module fv_turns #(
  parameter  int unsigned Inputs    = 3,
  parameter  int unsigned Patience  = 2,
  localparam int unsigned IndexBits = Inputs > 1 ? $clog2(Inputs) : 1,
  localparam int unsigned PassBits  = $clog2(Patience + 1),
  localparam int unsigned CountBits = $clog2(Patience + Inputs + 1)
) (
  input logic                            clk_i,
  input logic                            rst_ni,
  input logic [IndexBits-1:0]            pick_i,
  input logic [Inputs-1:0]               valid_i,
  input logic [Inputs-1:0]               taken_i,
  input logic [Inputs-1:0][PassBits-1:0] passed_i
);

  logic [CountBits-1:0] waited_q, served;  // transfers of others while pick_i waits
  logic [Inputs-1:0]    served_q;          // who was served since it is urgent

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      waited_q <= '0;
      served_q <= '0;
    end else if (!valid_i[pick_i] || taken_i[pick_i]) begin
      waited_q <= '0;
      served_q <= '0;
    end else if (taken_i != '0) begin
      waited_q <= waited_q + 1'b1;
      if (32'(waited_q) >= Patience) begin
        served_q <= served_q | taken_i;
      end
    end
  end

  always_comb begin
    served = '0;
    for (int unsigned k = 0; k < Inputs; k++) begin
      served += CountBits'(served_q[k]);
    end
  end

  always_comb begin
    if (rst_ni) begin
      a_bound: assert (32'(waited_q) <= Patience + Inputs - 1);
      l_count: assert (32'(passed_i[pick_i]) == (32'(waited_q) < Patience ? 32'(waited_q) : Patience));
      l_served: assert (32'(waited_q) <= Patience ? served_q == '0 : 32'(waited_q) == Patience + 32'(served));
      l_pick: assert (!served_q[pick_i]);
      c_worst: cover (taken_i[pick_i] && 32'(waited_q) == Patience + Inputs - 2);
    end
  end

  for (genvar k = 0; k < Inputs; k++) begin : gen_input
    always_comb begin
      if (rst_ni) begin
        l_passed: assert (32'(passed_i[k]) <= Patience && (!served_q[k] || 32'(passed_i[k]) < 32'(served)));
        if (k > 0) begin
          a_first: assert (!(valid_i[0] && taken_i[k]) || 32'(passed_i[k]) == Patience);
        end
      end
    end
  end

endmodule
