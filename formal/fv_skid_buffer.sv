// flk_skid_buffer: a stream of two elements (fv_stream); ready while there is room, valid when it
// is not empty. Ready is a register's output: it may not follow out_ready_i in the same cycle.
module fv_skid_buffer #(
  parameter int unsigned Width = 2,
  parameter bit          Early = 1'b0
) (
  input logic             clk_i,
  input logic             again_i,
  input logic             clear_i,
  input logic             pick_i,
  input logic             in_valid_i,
  input logic [Width-1:0] in_data_i,
  input logic             out_ready_i
);

  logic rst_n, in_ready, out_valid, watching;
  logic [Width-1:0] out_data, watched;
  logic [1:0] entries, ahead;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_skid_buffer #(
    .Width(Width),
    .Early(Early)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_data_i,
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o (out_data)
  );

  fv_stream #(
    .Width   (Width),
    .Capacity(2)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (in_valid_i && in_ready),
    .in_data_i,
    .out_valid_i(out_valid),
    .out_ready_i,
    .out_data_i (out_data),
    .inside_o   (entries),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  always_comb begin
    if (rst_n) begin
      a_ready: assert (in_ready == (entries < 2'd2));
      a_valid: assert (out_valid == (entries != '0));
      if (watching) begin
        l_kept: assert ((ahead == '0 ? dut.out_data_q : dut.skid_data_q) == watched);
      end
      c_full: cover (!in_ready && out_ready_i);
      c_through: cover (in_valid_i && in_ready && out_valid && out_ready_i);
      c_drained: cover (watching && entries != '0 && out_ready_i && !in_valid_i);
    end
  end

endmodule
