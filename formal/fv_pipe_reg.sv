// flk_pipe_reg: a stream of one element (fv_stream); ready when it is empty or its element leaves,
// valid when it is not empty.
module fv_pipe_reg #(
  parameter int unsigned Width = 2
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
  logic entries, ahead;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_pipe_reg #(
    .Width(Width)
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
    .Capacity(1)
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
      a_ready: assert (in_ready == (entries == '0 || out_ready_i));
      a_valid: assert (out_valid == (entries != '0));
      if (watching) begin
        a_kept: assert (out_data == watched && ahead == '0);
      end
      c_full: cover (!in_ready);
      c_through: cover (in_valid_i && in_ready && out_valid && out_ready_i);
      c_drained: cover (watching && entries != '0 && out_ready_i && !in_valid_i);
    end
  end

endmodule
