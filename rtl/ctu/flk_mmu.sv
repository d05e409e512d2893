// Mask merge unit (MMU): leader-pixel results of the two PRTUs to a mini-tile mask (paper, Fig. 7b).
//
// Sparse sampling: rectangle A holds the top-left, rectangle B the bottom-right leader of every mini-tile; one batch.
// Dense sampling: batch 0 brings mini-tiles 0 (A) and 1 (B), batch 1 mini-tiles 2 and 3; each rectangle is one mini-tile.
// `all_i` (end of sub-tile, test switched off) sets all four bits whatever the PRTUs say.
// mask_o is combinational and complete when valid_o is high: with batch 1 of a dense splat, at once otherwise.
module flk_mmu (
  input  logic       clk_i,
  input  logic       valid_i,
  input  logic       dense_i,
  input  logic       batch_i,
  input  logic       all_i,
  input  logic [3:0] pass_a_i,
  input  logic [3:0] pass_b_i,
  output logic       valid_o,
  output logic [3:0] mask_o
);

  // Mini-tiles 0 and 1 of the dense splat in progress.
  logic [1:0] first_q;

  always_ff @(posedge clk_i) begin
    if (valid_i && dense_i && !batch_i) begin
      first_q <= {|pass_b_i, |pass_a_i};
    end
  end

  assign valid_o = valid_i && (!dense_i || batch_i);

  always_comb begin
    mask_o = pass_a_i | pass_b_i;
    if (all_i) begin
      mask_o = 4'b1111;
    end else if (dense_i) begin
      mask_o = {|pass_b_i, |pass_a_i, first_q};
    end
  end

endmodule
