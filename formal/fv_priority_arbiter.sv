// flk_priority_arbiter: every transfer at the output is a transfer at exactly one input, with its
// data and index; no input waits for more than Patience + Inputs - 1 transfers of others.
//
// Inputs follow the stream contract: valid and data hold until the transfer. One input (pick_i,
// constant) stands for all. l_*: what induction needs. An input that others are urgent with was
// passed over at least as often as those before it were served since it became urgent.
module fv_priority_arbiter #(
  parameter  int unsigned Inputs    = 4,
  parameter  int unsigned Width     = 2,
  parameter  int unsigned Patience  = 4,
  localparam int unsigned IndexBits = $clog2(Inputs),
  localparam int unsigned CountBits = $clog2(Patience + Inputs + 1)
) (
  input logic                         clk_i,
  input logic                         again_i,
  input logic [IndexBits-1:0]         pick_i,
  input logic [Inputs-1:0]            in_valid_i,
  input logic [Inputs-1:0][Width-1:0] in_data_i,
  input logic                         out_ready_i
);

  logic rst_n, out_valid, transfer;
  logic [Inputs-1:0] in_ready, taken, served_q, valid_q;
  logic [Inputs-1:0][Width-1:0] data_q;
  logic [Width-1:0] out_data;
  logic [IndexBits-1:0] out_index, pick_q;
  logic [CountBits-1:0] passed_q;
  logic [CountBits-1:0] served;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_priority_arbiter #(
    .Inputs  (Inputs),
    .Width   (Width),
    .Patience(Patience)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_data_i,
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o (out_data),
    .out_index_o(out_index)
  );

  assign taken    = in_valid_i & in_ready;
  assign transfer = out_valid && out_ready_i;

  // passed_q: transfers of others while pick_q waits. served_q: who was served since it is urgent.
  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      valid_q  <= '0;
      passed_q <= '0;
      served_q <= '0;
    end else begin
      valid_q <= in_valid_i & ~taken;
      if (!in_valid_i[pick_q] || taken[pick_q]) begin
        passed_q <= '0;
        served_q <= '0;
      end else if (transfer) begin
        passed_q <= passed_q + 1'b1;
        if (32'(passed_q) >= Patience) begin
          served_q[out_index] <= 1'b1;
        end
      end
    end
  end

  always_ff @(posedge clk_i) begin
    pick_q <= pick_q;
    data_q <= in_data_i;
  end

  always_comb begin
    served = '0;
    for (int i = 0; i < Inputs; i++) begin
      served += CountBits'(served_q[i]);
    end
  end

  always_comb begin
    assume (pick_q < (IndexBits + 1)'(Inputs) && pick_i == pick_q);
    for (int i = 0; i < Inputs; i++) begin
      if (rst_n && valid_q[i]) begin
        assume (in_valid_i[i] && in_data_i[i] == data_q[i]);
      end
    end
  end

  always_comb begin
    if (rst_n) begin
      a_valid: assert (out_valid == (in_valid_i != '0));
      a_one: assert (transfer == (taken != '0) && (taken & (taken - 1'b1)) == '0);
      if (out_valid) begin
        a_shown: assert (in_valid_i[out_index] && out_data == in_data_i[out_index]);
      end
      if (transfer) begin
        a_taken: assert (taken[out_index]);
      end
      a_bound: assert (32'(passed_q) <= Patience + Inputs - 1);
      // The first: nobody is before it unless somebody is urgent.
      if (pick_q == '0 && transfer && in_valid_i[0] && out_index != '0) begin
        a_first: assert (32'(dut.passed_q[out_index]) == Patience);
      end
      // The count of the arbiter is that of this module, saturated.
      l_count: assert (32'(dut.passed_q[pick_q]) ==
                       (32'(passed_q) < Patience ? 32'(passed_q) : Patience));
      // While it is urgent no one is served twice: who was served is not urgent again so soon.
      l_served: assert (32'(passed_q) <= Patience ? served_q == '0
                                                  : 32'(passed_q) == Patience + 32'(served));
      l_pick: assert (!served_q[pick_q]);
      for (int i = 0; i < Inputs; i++) begin
        assert (32'(dut.passed_q[i]) <= Patience);
        if (served_q[i]) begin
          assert (32'(dut.passed_q[i]) < 32'(served));
        end
      end
      c_worst: cover (taken[pick_q] && 32'(passed_q) == Patience + Inputs - 2);
      c_urgent: cover (taken[pick_q] && 32'(passed_q) == Patience);
    end
  end

endmodule
