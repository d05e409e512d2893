// flk_mmu: the mask of every splat equals its specification, whatever the PRTUs answer.
//
// Batches come as the controller sends them (fv_ctu proves that it does): a dense splat's two in
// order with nothing but pauses between them, one for everything else. The specification keeps all
// leaders of the splat in progress and forms the mask from them at the end.
module fv_mmu (
  input logic       clk_i,
  input logic       again_i,
  input logic       valid_i,
  input logic       dense_i,
  input logic       all_i,
  input logic [3:0] pass_a_i,
  input logic [3:0] pass_b_i
);

  logic rst_n, batch_q, valid_out, last;
  logic [3:0] mask;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_mmu dut (
    .clk_i,
    .valid_i (valid_i && rst_n),
    .dense_i,
    .batch_i (batch_q),
    .all_i,
    .pass_a_i,
    .pass_b_i,
    .valid_o (valid_out),
    .mask_o  (mask)
  );

  // Leaders by mini-tile: first batch of a dense splat 0 and 1, second 2 and 3.
  logic [1:0][3:0] first_q;
  logic [3:0] expected;

  assign last = !dense_i || batch_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      batch_q <= 1'b0;
    end else if (valid_i) begin
      batch_q <= dense_i && !batch_q;
    end
  end

  always_ff @(posedge clk_i) begin
    if (valid_i && !batch_q) begin
      first_q <= {pass_b_i, pass_a_i};
    end
  end

  always_comb begin
    for (int m = 0; m < 4; m++) begin
      expected[m] = pass_a_i[m] || pass_b_i[m];
    end
    if (dense_i) begin
      expected[0] = first_q[0] != '0;
      expected[1] = first_q[1] != '0;
      expected[2] = pass_a_i != '0;
      expected[3] = pass_b_i != '0;
    end
    if (all_i) begin
      expected = 4'b1111;
    end
  end

  always_comb begin
    assume (!batch_q || dense_i);
    if (rst_n) begin
      a_valid: assert (valid_out == (valid_i && last));
      if (valid_out) begin
        a_mask: assert (mask == expected);
      end
      if (batch_q) begin
        l_kept: assert (dut.first_q == {first_q[1] != '0, first_q[0] != '0});
      end
      c_dense: cover (valid_out && dense_i && !all_i && mask == 4'b1001);
      c_sparse: cover (valid_out && !dense_i && !all_i && mask == 4'b0110);
      c_empty: cover (valid_out && mask == '0);
      c_all: cover (valid_out && all_i && pass_a_i == '0);
    end
  end

endmodule
