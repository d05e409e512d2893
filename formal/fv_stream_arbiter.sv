// flk_stream_arbiter: every transfer at the output is a transfer at exactly one input, with its
// data and index; the choice holds while the output waits; no input is passed over too often.
//
// Inputs follow the stream contract: valid and data hold until the transfer. One input (pick_i,
// constant) stands for all: the element in front of it and how often others went before it.
module fv_stream_arbiter #(
  parameter  int unsigned Inputs    = 4,
  parameter  int unsigned Width     = 2,
  localparam int unsigned IndexBits = $clog2(Inputs)
) (
  input logic                         clk_i,
  input logic                         again_i,
  input logic                         clear_i,
  input logic [IndexBits-1:0]         pick_i,
  input logic [Inputs-1:0]            in_valid_i,
  input logic [Inputs-1:0][Width-1:0] in_data_i,
  input logic                         out_ready_i
);

  logic rst_n, out_valid, transfer;
  logic [Inputs-1:0] in_ready, taken;
  logic [Width-1:0] out_data;
  logic [IndexBits-1:0] out_index, pick_q, index_q;
  logic [IndexBits:0] passed_q, behind;
  logic [Inputs-1:0] valid_q;
  logic [Inputs-1:0][Width-1:0] data_q;
  logic waited_q;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_stream_arbiter #(
    .Inputs(Inputs),
    .Width (Width)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
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

  // What waited in the last cycle, the choice then, and how often pick_q was passed over.
  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      valid_q  <= '0;
      waited_q <= 1'b0;
      passed_q <= '0;
    end else if (clear_i) begin
      valid_q  <= '0;
      waited_q <= 1'b0;
      passed_q <= '0;
    end else begin
      valid_q  <= in_valid_i & ~taken;
      waited_q <= out_valid && !out_ready_i;
      if (!in_valid_i[pick_q] || taken[pick_q]) begin
        passed_q <= '0;
      end else if (transfer) begin
        passed_q <= passed_q + 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    pick_q  <= pick_q;
    data_q  <= in_data_i;
    index_q <= out_index;
  end

  always_comb begin
    assume (pick_q < (IndexBits + 1)'(Inputs) && pick_i == pick_q);
    for (int i = 0; i < Inputs; i++) begin
      if (rst_n && valid_q[i]) begin
        assume (in_valid_i[i] && in_data_i[i] == data_q[i]);
      end
    end
  end

  // Inputs that the search visits before pick_q.
  assign behind = pick_q >= dut.first_q ? pick_q - dut.first_q
                                        : (IndexBits + 1)'(Inputs) + pick_q - dut.first_q;

  always_comb begin
    if (rst_n) begin
      a_valid: assert (out_valid == (in_valid_i != '0));
      a_one: assert (transfer == (taken != '0) && (taken & (taken - 1'b1)) == '0);
      if (taken[pick_q]) begin
        a_taken: assert (transfer && out_index == pick_q && out_data == in_data_i[pick_q]);
      end
      if (out_valid && out_index == pick_q) begin
        a_shown: assert (in_valid_i[pick_q] && out_data == in_data_i[pick_q]);
      end
      if (waited_q) begin
        a_stable: assert (out_valid && out_index == index_q && out_data == data_q[index_q]);
      end
      if (in_valid_i[pick_q]) begin
        a_fair: assert (passed_q < (IndexBits + 1)'(Inputs));
        l_turn: assert (passed_q == '0 || passed_q + behind < (IndexBits + 1)'(Inputs));
      end
      l_first: assert (dut.first_q < (IndexBits + 1)'(Inputs));
      a_index: assert (out_index < (IndexBits + 1)'(Inputs));
      if (waited_q) begin
        l_held: assert (dut.first_q == index_q && valid_q[index_q]);
      end
      c_worst: cover (taken[pick_q] && passed_q == (IndexBits + 1)'(Inputs - 1));
      c_waits: cover (waited_q && transfer && out_index == pick_q);
    end
  end

endmodule
