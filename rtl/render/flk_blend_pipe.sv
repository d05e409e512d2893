// Arithmetic of a VRU behind the weight: one pixel-Gaussian pair per cycle, FP16. It knows no pixels: T and C come from and go to
// flk_pixel_state.
//
// | cycle, conic | factored | taken | given |
// |---|---|---|---|
// | 0 | 0 | weight_i | |
// | 3 | 2 | opacity_i | g = e^-E or 2^-E |
// | 6 | 5 | | alpha = min(o g, 0.99); alpha >= 1/255? |
// | 9 = OMA | 8 | t_i | 1 - alpha |
// | 11 = BLEND | 10 | colour_i | contributes_o, ends_o, t_next_o = T (1 - alpha); w = T alpha |
// | 13 = COLOUR | 12 | c_i | w colour |
// | 15 = LAST | 14 | | c_next_o = C + w colour |
//
// ends_o: t_next_o is below 1e-4. Each operation is rounded to FP16. A negative or NaN weight gives g = 0, so that it does not contribute.
// Throughput one pair per cycle, no enable, no reset. ends_o depends on registers only; no combinational path.
module flk_blend_pipe
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form = FORM_FACTORED
) (
  input  logic             clk_i,
  input  fp16_t            weight_i,
  input  fp16_t            opacity_i,
  // at BLEND
  input  logic [14:0]      t_i,
  output logic             contributes_o,
  output logic             ends_o,
  output logic [14:0]      t_next_o,
  // colours: 0 red, 1 green, 2 blue; not negative
  input  logic [2:0][14:0] colour_i,
  input  logic [2:0][14:0] c_i,
  output logic [2:0][14:0] c_next_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_blend_pipe: Form must be FORM_CONIC or FORM_FACTORED");
  end

  // ---- Alpha -------------------------------------------------------------------------------------------------

  fp16_t g_q, product_q, alpha_q, alpha_late_q, oma_q;
  logic contributes_q;

  flk_exp_neg_pipe #(
    .Base2 (Form == FORM_FACTORED),
    .Stages(32'(EXP_STAGES[Form]))
  ) i_exp (
    .clk_i,
    .en_i(1'b1),
    .e_i (weight_i),
    .g_o (g_q)
  );
  flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_alpha (
    .clk_i, .en_i(1'b1), .a_i(opacity_i), .b_i(g_q), .prod_o(product_q)
  );

  // Products are not negative: their bits compare like integers.
  always_ff @(posedge clk_i) begin
    alpha_q       <= (product_q > ALPHA_MAX) ? ALPHA_MAX : product_q;
    contributes_q <= (product_q >= ALPHA_MIN);
  end

  flk_fp_add_pipe #(.Stages(FP16_ADD_STAGES)) i_oma (
    .clk_i,
    .en_i (1'b1),
    .a_i  (FP16_ONE),
    .b_i  ({~alpha_q[15], alpha_q[14:0]}),
    .sum_o(oma_q)
  );
  flk_delay #(
    .Width(16),
    .Depth(FP16_ADD_STAGES)
  ) i_alpha_late (
    .clk_i,
    .en_i(1'b1),
    .d_i (alpha_q),
    .q_o (alpha_late_q)
  );
  flk_delay #(
    .Width(1),
    .Depth(FP16_ADD_STAGES + FP16_MUL_STAGES)
  ) i_contributes (
    .clk_i,
    .en_i(1'b1),
    .d_i (contributes_q),
    .q_o (contributes_o)
  );

  // ---- Transmittance -----------------------------------------------------------------------------------------

  fp16_t t_next_q, w_q;

  flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_t_next (
    .clk_i,
    .en_i  (1'b1),
    .a_i   ({1'b0, t_i}),
    .b_i   (oma_q),
    .prod_o(t_next_q)
  );
  flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_w (
    .clk_i,
    .en_i  (1'b1),
    .a_i   ({1'b0, t_i}),
    .b_i   (alpha_late_q),
    .prod_o(w_q)
  );

  assign ends_o   = (t_next_q < TRANSMITTANCE_MIN);
  assign t_next_o = t_next_q[14:0];

  // ---- Colour ------------------------------------------------------------------------------------------------

  fp16_t [2:0] m_q, c_next_q;

  for (genvar k = 0; k < 3; k++) begin : gen_colour
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_m (
      .clk_i,
      .en_i  (1'b1),
      .a_i   (w_q),
      .b_i   ({1'b0, colour_i[k]}),
      .prod_o(m_q[k])
    );
    flk_fp_add_pipe #(.Cancel(0), .Stages(FP16_SUM_STAGES)) i_c (
      .clk_i,
      .en_i (1'b1),
      .a_i  ({1'b0, c_i[k]}),
      .b_i  (m_q[k]),
      .sum_o(c_next_q[k])
    );
    assign c_next_o[k] = c_next_q[k][14:0];
  end

endmodule
