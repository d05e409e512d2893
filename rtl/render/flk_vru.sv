// Volume rendering unit (VRU): blends splats into eight pixels, one pixel-Gaussian pair per cycle, FP16.
//
// Operations come in program order: `op_valid_i` with a splat and a pixel, or with `op_eos_i` (end of sub-tile). There is no
// back-pressure on operations, except that a token may only come while `eos_ready_o` is high. The transmittance loop takes one
// cycle, so the same pixel may come in consecutive cycles.
//
// | stage | conic | factored |
// |---|---|---|
// | 1 | dx, dy | dx, dy |
// | 2 | dx dx, dy dy, dx dy | l0 dx, l1 dy, l2 dy |
// | 3 | times a/2, c/2, b | u |
// | 4 | sum of the squares | u u, v v |
// | 5 | E | E |
// | 6 | e^-E | 2^-E |
// | 7 | alpha = min(o g, 0.99) | the same |
// | 8 | 1 - alpha; alpha >= 1/255? | |
// | 9 | T (1 - alpha) >= 1e-4? T, w = T alpha | |
// | 10 | w colour | |
// | 11 | C += w colour | |
//
// A token copies T (stage 9) and C (stage 11) into the output buffer and clears the pixel state: the next sub-tile's operations
// may follow at once. The buffer then leaves as a stream of eight pixels; the next token may come when it is empty.
module flk_vru
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form   = FORM_FACTORED,
  localparam int unsigned N      = PIXELS_PER_VRU,
  localparam int unsigned IndexW = $clog2(N)
) (
  input  logic              clk_i,
  input  logic              rst_ni,
  // First pixel's column and row in the sub-tile, constant; pixel i lies i % 4, i / 4 from it.
  input  logic [2:0]        first_x_i,
  input  logic [2:0]        first_y_i,
  // operations
  input  logic              op_valid_i,
  input  logic              op_eos_i,
  input  logic [IndexW-1:0] op_pixel_i,
  input  feature_t          op_feature_i,
  output logic              eos_ready_o,
  // state of the sub-tile at stage 9
  output logic              blend_valid_o,  // an operation is at stage 9
  output logic [IndexW-1:0] blend_pixel_o,
  output logic              blend_eos_o,    // a token is at stage 9
  output logic [N-1:0]      finished_o,     // before the operation at stage 9
  output logic              finish_o,       // the operation at stage 9 finishes its pixel
  // finished pixels
  output logic              out_valid_o,
  input  logic              out_ready_i,
  output vru_pixel_t        out_data_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_vru: Form must be FORM_CONIC or FORM_FACTORED");
  end
  localparam int unsigned STAGES = 11;
  localparam int unsigned BLEND = 9;  // stage of the transmittance loop

  // ---- Control pipeline: index s holds what is in the registers before stage s ------------------------

  logic [STAGES:2] valid_q, eos_q;
  logic [STAGES:2][IndexW-1:0] pixel_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= '0;
      eos_q   <= '0;
    end else begin
      valid_q <= {valid_q[STAGES-1:2], op_valid_i && !op_eos_i};
      eos_q   <= {eos_q[STAGES-1:2], op_valid_i && op_eos_i};
    end
  end

  always_ff @(posedge clk_i) begin
    pixel_q <= {pixel_q[STAGES-1:2], op_pixel_i};
  end

  // ---- Stage 1: differences -----------------------------------------------------------------------------

  // Integer 0..7 in FP16: exact.
  function automatic fp16_t pixel_fp16(logic [2:0] p);
    unique casez (p)
      3'b000:  return 16'h0000;
      3'b001:  return 16'h3c00;
      3'b01?:  return {6'b010000, p[0], 9'b0};
      default: return {6'b010001, p[1:0], 8'b0};
    endcase
  endfunction

  fp16_t dx_d, dy_d, dx_q, dy_q;

  flk_fp_add i_dx (
    .a_i  (pixel_fp16(first_x_i + 3'(op_pixel_i[1:0]))),
    .b_i  ({~op_feature_i.mean_x[15], op_feature_i.mean_x[14:0]}),
    .sum_o(dx_d)
  );
  flk_fp_add i_dy (
    .a_i  (pixel_fp16(first_y_i + 3'(op_pixel_i[2]))),
    .b_i  ({~op_feature_i.mean_y[15], op_feature_i.mean_y[14:0]}),
    .sum_o(dy_d)
  );

  // Shape numbers travel to stage 3, opacity to stage 7, colour to stage 10.
  fp16_t shape0_q2, shape1_q2, shape2_q2;
  fp16_t [7:2] opacity_q;
  fp16_t [10:2] red_q, green_q, blue_q;

  always_ff @(posedge clk_i) begin
    dx_q      <= dx_d;
    dy_q      <= dy_d;
    shape0_q2 <= op_feature_i.shape0;
    shape1_q2 <= op_feature_i.shape1;
    shape2_q2 <= op_feature_i.shape2;
    opacity_q <= {opacity_q[6:2], op_feature_i.opacity};
    red_q     <= {red_q[9:2], op_feature_i.red};
    green_q   <= {green_q[9:2], op_feature_i.green};
    blue_q    <= {blue_q[9:2], op_feature_i.blue};
  end

  // ---- Stages 2 to 5: weight -----------------------------------------------------------------------------

  fp16_t weight_d, weight_q;

  if (Form == FORM_CONIC) begin : gen_conic
    fp16_t xx_d, yy_d, xy_d, xx_q, yy_q, xy_q;
    fp16_t shape0_q3, shape1_q3, shape2_q3;
    fp16_t sx_d, sy_d, t_d, sx_q, sy_q, t_q4, t_q5;
    fp16_t h_d, h_q;

    flk_fp_mul i_xx (.a_i(dx_q), .b_i(dx_q), .prod_o(xx_d));
    flk_fp_mul i_yy (.a_i(dy_q), .b_i(dy_q), .prod_o(yy_d));
    flk_fp_mul i_xy (.a_i(dx_q), .b_i(dy_q), .prod_o(xy_d));
    flk_fp_mul i_sx (.a_i(xx_q), .b_i(shape0_q3), .prod_o(sx_d));
    flk_fp_mul i_sy (.a_i(yy_q), .b_i(shape2_q3), .prod_o(sy_d));
    flk_fp_mul i_t (.a_i(xy_q), .b_i(shape1_q3), .prod_o(t_d));
    flk_fp_add i_h (.a_i(sx_q), .b_i(sy_q), .sum_o(h_d));
    flk_fp_add i_e (.a_i(h_q), .b_i(t_q5), .sum_o(weight_d));

    always_ff @(posedge clk_i) begin
      xx_q      <= xx_d;
      yy_q      <= yy_d;
      xy_q      <= xy_d;
      shape0_q3 <= shape0_q2;
      shape1_q3 <= shape1_q2;
      shape2_q3 <= shape2_q2;
      sx_q      <= sx_d;
      sy_q      <= sy_d;
      t_q4      <= t_d;
      h_q       <= h_d;
      t_q5      <= t_q4;
    end
  end else begin : gen_factored
    fp16_t p_d, q_d, v_d, p_q, q_q, v_q3, v_q4;
    fp16_t u_d, u_q, uu_d, vv_d, uu_q, vv_q;

    flk_fp_mul i_p (.a_i(shape0_q2), .b_i(dx_q), .prod_o(p_d));
    flk_fp_mul i_q (.a_i(shape1_q2), .b_i(dy_q), .prod_o(q_d));
    flk_fp_mul i_v (.a_i(shape2_q2), .b_i(dy_q), .prod_o(v_d));
    flk_fp_add i_u (.a_i(p_q), .b_i(q_q), .sum_o(u_d));
    flk_fp_mul i_uu (.a_i(u_q), .b_i(u_q), .prod_o(uu_d));
    flk_fp_mul i_vv (.a_i(v_q4), .b_i(v_q4), .prod_o(vv_d));
    flk_fp_add i_e (.a_i(uu_q), .b_i(vv_q), .sum_o(weight_d));

    always_ff @(posedge clk_i) begin
      p_q  <= p_d;
      q_q  <= q_d;
      v_q3 <= v_d;
      u_q  <= u_d;
      v_q4 <= v_q3;
      uu_q <= uu_d;
      vv_q <= vv_d;
    end
  end

  // ---- Stages 6 to 8: alpha --------------------------------------------------------------------------------

  fp16_t g_d, g_q, product, alpha_d, alpha_q8, alpha_q9, oma_d, oma_q;
  logic contributes_q;

  // A negative or NaN weight gives g = 0, so that alpha is below 1/255.
  flk_exp_neg #(
    .Base2(Form == FORM_FACTORED)
  ) i_exp (
    .e_i(weight_q),
    .g_o(g_d)
  );
  flk_fp_mul i_alpha (.a_i(opacity_q[7]), .b_i(g_q), .prod_o(product));
  // Products are not negative: their bits compare like integers.
  assign alpha_d = (product > ALPHA_MAX) ? ALPHA_MAX : product;
  flk_fp_add i_oma (.a_i(FP16_ONE), .b_i({~alpha_q8[15], alpha_q8[14:0]}), .sum_o(oma_d));

  always_ff @(posedge clk_i) begin
    weight_q      <= weight_d;
    g_q           <= g_d;
    alpha_q8      <= alpha_d;
    alpha_q9      <= alpha_q8;
    oma_q         <= oma_d;
    contributes_q <= (alpha_q8 >= ALPHA_MIN);
  end

  // ---- Stage 9: transmittance --------------------------------------------------------------------------------

  fp16_t [N-1:0] t_q;
  logic [N-1:0] finished_q;
  fp16_t t_now, t_next, w_d, w_q;
  logic blend, finish, blend_q10, blend_q11;
  logic [IndexW-1:0] blend_pixel;

  assign blend_pixel = pixel_q[BLEND];
  assign t_now       = t_q[blend_pixel];

  flk_fp_mul i_t_next (.a_i(t_now), .b_i(oma_q), .prod_o(t_next));
  flk_fp_mul i_w (.a_i(t_now), .b_i(alpha_q9), .prod_o(w_d));

  always_comb begin
    blend  = 1'b0;
    finish = 1'b0;
    if (valid_q[BLEND] && contributes_q && !finished_q[blend_pixel]) begin
      if (t_next < TRANSMITTANCE_MIN) begin
        finish = 1'b1;
      end else begin
        blend = 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      t_q        <= {N{FP16_ONE}};
      finished_q <= '0;
      blend_q10  <= 1'b0;
      blend_q11  <= 1'b0;
    end else begin
      blend_q10 <= blend;
      blend_q11 <= blend_q10;
      if (eos_q[BLEND]) begin
        t_q        <= {N{FP16_ONE}};
        finished_q <= '0;
      end else begin
        if (blend) begin
          t_q[blend_pixel] <= t_next;
        end
        if (finish) begin
          finished_q[blend_pixel] <= 1'b1;
        end
      end
    end
  end

  assign blend_valid_o = valid_q[BLEND];
  assign blend_pixel_o = blend_pixel;
  assign blend_eos_o   = eos_q[BLEND];
  assign finished_o    = finished_q;
  assign finish_o      = finish;

  // ---- Stages 10 and 11: colour ----------------------------------------------------------------------------------

  // Index 0 red, 1 green, 2 blue.
  fp16_t [2:0] colour_10, m_d, m_q, c_now, c_next;
  fp16_t [N-1:0][2:0] c_q;

  assign colour_10 = {blue_q[10], green_q[10], red_q[10]};
  assign c_now     = c_q[pixel_q[STAGES]];

  for (genvar k = 0; k < 3; k++) begin : gen_colour
    flk_fp_mul i_m (.a_i(w_q), .b_i(colour_10[k]), .prod_o(m_d[k]));
    flk_fp_add i_c (.a_i(c_now[k]), .b_i(m_q[k]), .sum_o(c_next[k]));
  end

  always_ff @(posedge clk_i) begin
    w_q <= w_d;
    m_q <= m_d;
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      c_q <= '0;
    end else if (eos_q[STAGES]) begin
      c_q <= '0;
    end else if (blend_q11) begin
      c_q[pixel_q[STAGES]] <= c_next;
    end
  end

  // ---- Output buffer -----------------------------------------------------------------------------------------------

  fp16_t [N-1:0] out_t_q;
  fp16_t [N-1:0][2:0] out_c_q;
  logic busy_q, full_q, last;
  logic [IndexW-1:0] out_index_q;

  assign last = out_valid_o && out_ready_i && (out_index_q == IndexW'(N - 1));

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      busy_q      <= 1'b0;
      full_q      <= 1'b0;
      out_index_q <= '0;
    end else begin
      if (op_valid_i && op_eos_i) begin
        busy_q <= 1'b1;
      end else if (last) begin
        busy_q <= 1'b0;
      end
      if (eos_q[STAGES]) begin
        full_q <= 1'b1;
      end else if (last) begin
        full_q <= 1'b0;
      end
      if (out_valid_o && out_ready_i) begin
        out_index_q <= out_index_q + IndexW'(1);
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (eos_q[BLEND]) begin
      out_t_q <= t_q;
    end
    if (eos_q[STAGES]) begin
      out_c_q <= c_q;
    end
  end

  assign eos_ready_o = !busy_q;
  assign out_valid_o = full_q;
  always_comb begin
    out_data_o.index               = out_index_q;
    out_data_o.pixel.transmittance = out_t_q[out_index_q];
    out_data_o.pixel.red           = out_c_q[out_index_q][0];
    out_data_o.pixel.green         = out_c_q[out_index_q][1];
    out_data_o.pixel.blue          = out_c_q[out_index_q][2];
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) op_valid_i && op_eos_i |-> eos_ready_o)
  else $error("flk_vru: token while the output buffer is in use");
`endif

endmodule
