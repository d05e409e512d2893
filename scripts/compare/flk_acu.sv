// Single-pixel test unit (ACU), the baseline of the PRTU in area comparisons: the weight of one leader pixel and its
// comparison with the threshold. Not part of the design.
//
// Four of them do what a PRTU does, each with its own coordinates and its own differences. Formats, stages, latency and
// throughput (one pixel per cycle) are the PRTU's; so is the threshold, which comes from outside.
module flk_acu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form      = FORM_FACTORED,
  parameter int unsigned Precision = PRECISION_MIXED,
  // Bits of the test's format: FP16 for PRECISION_FP16, else E4M3.
  localparam int unsigned QuadBits = (Precision == PRECISION_FP16) ? 16 : 8
) (
  input  logic                clk_i,
  input  logic [         2:0] x_i,
  input  logic [         2:0] y_i,
  input  fp16_t               mean_x_i,
  input  fp16_t               mean_y_i,
  input  fp16_t               shape0_i,
  input  fp16_t               shape1_i,
  input  fp16_t               shape2_i,
  input  logic [QuadBits-1:0] threshold_i,
  output logic                pass_o,
  output logic [QuadBits-1:0] weight_o
);

  localparam int unsigned ExpBits = (Precision == PRECISION_FP16) ? 5 : 4;
  localparam int unsigned ManBits = (Precision == PRECISION_FP16) ? 10 : 3;
  localparam bit Fn = (Precision != PRECISION_FP16);
  localparam bit Saturate = (Precision != PRECISION_FP16);

  typedef logic [QuadBits-1:0] quad_t;

  // Integer 0..7 in a format with at least 3 mantissa bits: exact.
  function automatic fp16_t pixel_fp16(logic [2:0] p);
    unique casez (p)
      3'b000:  return 16'h0000;
      3'b001:  return 16'h3c00;
      3'b01?:  return {6'b010000, p[0], 9'b0};
      default: return {6'b010001, p[1:0], 8'b0};
    endcase
  endfunction

  function automatic logic [7:0] pixel_e4m3(logic [2:0] p);
    unique casez (p)
      3'b000:  return 8'h00;
      3'b001:  return 8'h38;
      3'b01?:  return {5'b01000, p[0], 2'b0};
      default: return {5'b01001, p[1:0], 1'b0};
    endcase
  endfunction

  // ---- Stage 1: differences and conversion --------------------------------------------------------

  // Index 0 column, 1 row.
  logic [1:0][2:0] pixel;
  fp16_t [1:0] mean;
  quad_t [1:0] d_d, d_q;
  fp16_t [2:0] shape;
  quad_t [2:0] shape_d, shape_q1;

  assign pixel = {y_i, x_i};
  assign mean  = {mean_y_i, mean_x_i};
  assign shape = {shape2_i, shape1_i, shape0_i};

  for (genvar k = 0; k < 2; k++) begin : gen_difference
    if (Precision == PRECISION_FP8) begin : gen_fp8
      quad_t mean8;
      flk_fp_convert i_mean (.src_i(mean[k]), .dst_o(mean8));
      flk_fp_add #(.ExpBits(4), .ManBits(3), .Fn(1), .Saturate(1)) i_d (
        .a_i(pixel_e4m3(pixel[k])), .b_i({~mean8[7], mean8[6:0]}), .sum_o(d_d[k])
      );
    end else begin : gen_fp16
      fp16_t d16;
      flk_fp_add i_d (
        .a_i(pixel_fp16(pixel[k])), .b_i({~mean[k][15], mean[k][14:0]}), .sum_o(d16)
      );
      if (Precision == PRECISION_MIXED) begin : gen_convert
        flk_fp_convert i_d8 (.src_i(d16), .dst_o(d_d[k]));
      end else begin : gen_keep
        assign d_d[k] = d16;
      end
    end
  end

  for (genvar k = 0; k < 3; k++) begin : gen_shape
    if (Precision == PRECISION_FP16) begin : gen_keep
      assign shape_d[k] = shape[k];
    end else begin : gen_convert
      flk_fp_convert i_shape (.src_i(shape[k]), .dst_o(shape_d[k]));
    end
  end

  always_ff @(posedge clk_i) begin
    d_q      <= d_d;
    shape_q1 <= shape_d;
  end

  // ---- Stages 2 to 5: the weight ------------------------------------------------------------------

  quad_t weight_d, weight_q;

  if (Form == FORM_CONIC) begin : gen_conic
    quad_t xx_d, yy_d, xy_d, xx_q, yy_q, xy_q;
    quad_t sx_d, sy_d, t_d, sx_q, sy_q, t_q3, t_q4, h_d, h_q;
    quad_t [2:0] shape_q2;

    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_xx (
      .a_i(d_q[0]), .b_i(d_q[0]), .prod_o(xx_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_yy (
      .a_i(d_q[1]), .b_i(d_q[1]), .prod_o(yy_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_xy (
      .a_i(d_q[0]), .b_i(d_q[1]), .prod_o(xy_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_sx (
      .a_i(xx_q), .b_i(shape_q2[0]), .prod_o(sx_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_sy (
      .a_i(yy_q), .b_i(shape_q2[2]), .prod_o(sy_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_t (
      .a_i(xy_q), .b_i(shape_q2[1]), .prod_o(t_d)
    );
    flk_fp_add #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_h (
      .a_i(sx_q), .b_i(sy_q), .sum_o(h_d)
    );
    flk_fp_add #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_e (
      .a_i(h_q), .b_i(t_q4), .sum_o(weight_d)
    );

    always_ff @(posedge clk_i) begin
      {xx_q, yy_q, xy_q} <= {xx_d, yy_d, xy_d};
      shape_q2           <= shape_q1;
      {sx_q, sy_q}       <= {sx_d, sy_d};
      {t_q4, t_q3}       <= {t_q3, t_d};
      h_q                <= h_d;
    end
  end else begin : gen_factored
    quad_t p_d, q_d, v_d, p_q, q_q, v_q2, v_q3;
    quad_t u_d, u_q, uu_d, uu_q, vv_d, vv_q;

    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_p (
      .a_i(shape_q1[0]), .b_i(d_q[0]), .prod_o(p_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_q (
      .a_i(shape_q1[1]), .b_i(d_q[1]), .prod_o(q_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_v (
      .a_i(shape_q1[2]), .b_i(d_q[1]), .prod_o(v_d)
    );
    flk_fp_add #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_u (
      .a_i(p_q), .b_i(q_q), .sum_o(u_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_uu (
      .a_i(u_q), .b_i(u_q), .prod_o(uu_d)
    );
    flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_vv (
      .a_i(v_q3), .b_i(v_q3), .prod_o(vv_d)
    );
    flk_fp_add #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_e (
      .a_i(uu_q), .b_i(vv_q), .sum_o(weight_d)
    );

    always_ff @(posedge clk_i) begin
      {p_q, q_q}   <= {p_d, q_d};
      {v_q3, v_q2} <= {v_q2, v_d};
      u_q          <= u_d;
      {uu_q, vv_q} <= {uu_d, vv_d};
    end
  end

  // The threshold travels beside stages 1 to 5.
  quad_t [PRTU_LATENCY-2:0] threshold_q;

  always_ff @(posedge clk_i) begin
    weight_q    <= weight_d;
    threshold_q <= {threshold_q[PRTU_LATENCY-3:0], threshold_i};
  end

  // ---- Stage 6: comparison ------------------------------------------------------------------------

  logic pass_d;

  flk_fp_cmp #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn)) i_lt (
    .a_i(weight_q), .b_i(threshold_q[PRTU_LATENCY-2]), .lt_o(pass_d)
  );

  always_ff @(posedge clk_i) begin
    pass_o   <= pass_d;
    weight_o <= weight_q;
  end

endmodule
