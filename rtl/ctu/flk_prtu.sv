// Pixel-rectangle test unit (PRTU): the Gaussian weights of four leader pixels and their comparison with the
// threshold (paper, Algorithm 1; factored form: docs/prtu.md).
//
// A pixel rectangle has two columns (x_top, x_bot) and two rows (y_top, y_bot). Leader i is
// 0 = (x_top, y_top), 1 = (x_bot, y_top), 2 = (x_top, y_bot), 3 = (x_bot, y_bot).
// Latency flk_param_pkg::PRTU_LATENCY cycles, throughput one rectangle per cycle. No handshake and no stall:
// what goes in comes out; the CTU keeps track of it. No register is reset.
// pass_o[i] is high when threshold_i > weight i; a NaN weight does not pass.
//
// The format of the test (`Quad`) is FP16 or E4M3; threshold_i is in it, and lies beside the rectangle's inputs in time.
module flk_prtu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form      = FORM_FACTORED,
  parameter int unsigned Precision = PRECISION_MIXED,
  // Bits of the quad format: FP16 for PRECISION_FP16, else E4M3.
  localparam int unsigned QuadBits = (Precision == PRECISION_FP16) ? 16 : 8
) (
  input  logic                     clk_i,
  input  logic [              2:0] x_top_i,
  input  logic [              2:0] x_bot_i,
  input  logic [              2:0] y_top_i,
  input  logic [              2:0] y_bot_i,
  input  fp16_t                    mean_x_i,
  input  fp16_t                    mean_y_i,
  input  fp16_t                    shape0_i,
  input  fp16_t                    shape1_i,
  input  fp16_t                    shape2_i,
  input  logic [     QuadBits-1:0] threshold_i,
  output logic [              3:0] pass_o,
  output logic [3:0][QuadBits-1:0] weight_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_prtu: Form must be FORM_CONIC or FORM_FACTORED");
  end
  if (Precision > PRECISION_FP8) begin : gen_check_precision
    $error("flk_prtu: Precision must be PRECISION_FP16, _MIXED or _FP8");
  end

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

  // ---- Stage 1: differences and conversion to the quad format (Alg. 1, line 1) -----------------

  // Index 0 top, 1 bottom.
  logic [1:0][2:0] px, py;
  quad_t [1:0] dx_d, dy_d, dx_q, dy_q;
  quad_t shape0_d, shape1_d, shape2_d;

  assign px = {x_bot_i, x_top_i};
  assign py = {y_bot_i, y_top_i};

  if (Precision == PRECISION_FP8) begin : gen_fp8_difference
    quad_t mean_x, mean_y;
    flk_fp_convert #(
      .SrcExpBits(5), .SrcManBits(10), .SrcFn(0),
      .DstExpBits(4), .DstManBits(3), .DstFn(1), .DstSaturate(1)
    ) i_mean_x (.src_i(mean_x_i), .dst_o(mean_x));
    flk_fp_convert #(
      .SrcExpBits(5), .SrcManBits(10), .SrcFn(0),
      .DstExpBits(4), .DstManBits(3), .DstFn(1), .DstSaturate(1)
    ) i_mean_y (.src_i(mean_y_i), .dst_o(mean_y));
    for (genvar k = 0; k < 2; k++) begin : gen_axis
      flk_fp_add #(.ExpBits(4), .ManBits(3), .Fn(1), .Saturate(1)) i_dx (
        .a_i(pixel_e4m3(px[k])), .b_i({~mean_x[7], mean_x[6:0]}), .sum_o(dx_d[k])
      );
      flk_fp_add #(.ExpBits(4), .ManBits(3), .Fn(1), .Saturate(1)) i_dy (
        .a_i(pixel_e4m3(py[k])), .b_i({~mean_y[7], mean_y[6:0]}), .sum_o(dy_d[k])
      );
    end
  end else begin : gen_fp16_difference
    fp16_t [1:0] dx16, dy16;
    for (genvar k = 0; k < 2; k++) begin : gen_axis
      flk_fp_add #(.ExpBits(5), .ManBits(10), .Fn(0), .Saturate(0)) i_dx (
        .a_i(pixel_fp16(px[k])), .b_i({~mean_x_i[15], mean_x_i[14:0]}), .sum_o(dx16[k])
      );
      flk_fp_add #(.ExpBits(5), .ManBits(10), .Fn(0), .Saturate(0)) i_dy (
        .a_i(pixel_fp16(py[k])), .b_i({~mean_y_i[15], mean_y_i[14:0]}), .sum_o(dy16[k])
      );
      if (Precision == PRECISION_MIXED) begin : gen_convert
        flk_fp_convert #(
          .SrcExpBits(5), .SrcManBits(10), .SrcFn(0),
          .DstExpBits(4), .DstManBits(3), .DstFn(1), .DstSaturate(1)
        ) i_dx8 (.src_i(dx16[k]), .dst_o(dx_d[k]));
        flk_fp_convert #(
          .SrcExpBits(5), .SrcManBits(10), .SrcFn(0),
          .DstExpBits(4), .DstManBits(3), .DstFn(1), .DstSaturate(1)
        ) i_dy8 (.src_i(dy16[k]), .dst_o(dy_d[k]));
      end else begin : gen_keep
        assign dx_d[k] = dx16[k];
        assign dy_d[k] = dy16[k];
      end
    end
  end

  if (Precision == PRECISION_FP16) begin : gen_shape16
    assign shape0_d = shape0_i;
    assign shape1_d = shape1_i;
    assign shape2_d = shape2_i;
  end else begin : gen_shape8
    flk_fp_convert #(
      .SrcExpBits(5), .SrcManBits(10), .SrcFn(0),
      .DstExpBits(4), .DstManBits(3), .DstFn(1), .DstSaturate(1)
    ) i_shape0 (.src_i(shape0_i), .dst_o(shape0_d));
    flk_fp_convert #(
      .SrcExpBits(5), .SrcManBits(10), .SrcFn(0),
      .DstExpBits(4), .DstManBits(3), .DstFn(1), .DstSaturate(1)
    ) i_shape1 (.src_i(shape1_i), .dst_o(shape1_d));
    flk_fp_convert #(
      .SrcExpBits(5), .SrcManBits(10), .SrcFn(0),
      .DstExpBits(4), .DstManBits(3), .DstFn(1), .DstSaturate(1)
    ) i_shape2 (.src_i(shape2_i), .dst_o(shape2_d));
  end

  quad_t shape0_q1, shape1_q1, shape2_q1;
  always_ff @(posedge clk_i) begin
    dx_q      <= dx_d;
    dy_q      <= dy_d;
    shape0_q1 <= shape0_d;
    shape1_q1 <= shape1_d;
    shape2_q1 <= shape2_d;
  end

  // ---- Stages 2 to 5: the weights ----------------------------------------------------------------

  quad_t [3:0] weight_d, weight_q;

  if (Form == FORM_CONIC) begin : gen_conic
    // Stage 2: squares and cross products; leader i has column i[0], row i[1].
    quad_t [1:0] xx_d, yy_d, xx_q, yy_q;
    quad_t [3:0] xy_d, xy_q;
    quad_t shape0_q2, shape1_q2, shape2_q2;
    // Stage 3: scaled by the conic.
    quad_t [1:0] sx_d, sy_d, sx_q, sy_q;
    quad_t [3:0] t_d, t_q3, t_q4;
    // Stage 4: sum of the squares.
    quad_t [3:0] h_d, h_q;

    for (genvar k = 0; k < 2; k++) begin : gen_axis
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_xx (
        .a_i(dx_q[k]), .b_i(dx_q[k]), .prod_o(xx_d[k])
      );
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_yy (
        .a_i(dy_q[k]), .b_i(dy_q[k]), .prod_o(yy_d[k])
      );
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_sx (
        .a_i(xx_q[k]), .b_i(shape0_q2), .prod_o(sx_d[k])
      );
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_sy (
        .a_i(yy_q[k]), .b_i(shape2_q2), .prod_o(sy_d[k])
      );
    end
    for (genvar i = 0; i < 4; i++) begin : gen_leader
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_xy (
        .a_i(dx_q[i%2]), .b_i(dy_q[i/2]), .prod_o(xy_d[i])
      );
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_t (
        .a_i(xy_q[i]), .b_i(shape1_q2), .prod_o(t_d[i])
      );
      flk_fp_add #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_h (
        .a_i(sx_q[i%2]), .b_i(sy_q[i/2]), .sum_o(h_d[i])
      );
      flk_fp_add #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_e (
        .a_i(h_q[i]), .b_i(t_q4[i]), .sum_o(weight_d[i])
      );
    end

    always_ff @(posedge clk_i) begin
      xx_q      <= xx_d;
      yy_q      <= yy_d;
      xy_q      <= xy_d;
      shape0_q2 <= shape0_q1;
      shape1_q2 <= shape1_q1;
      shape2_q2 <= shape2_q1;
      sx_q      <= sx_d;
      sy_q      <= sy_d;
      t_q3      <= t_d;
      t_q4      <= t_q3;
      h_q       <= h_d;
    end
  end else begin : gen_factored
    // Stage 2: products with the factors.
    quad_t [1:0] p_d, q_d, v_d, p_q, q_q, v_q2, v_q3;
    // Stage 3: u = p + q.
    quad_t [3:0] u_d, u_q;
    // Stage 4: squares.
    quad_t [3:0] uu_d, uu_q;
    quad_t [1:0] vv_d, vv_q;

    for (genvar k = 0; k < 2; k++) begin : gen_axis
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_p (
        .a_i(shape0_q1), .b_i(dx_q[k]), .prod_o(p_d[k])
      );
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_q (
        .a_i(shape1_q1), .b_i(dy_q[k]), .prod_o(q_d[k])
      );
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_v (
        .a_i(shape2_q1), .b_i(dy_q[k]), .prod_o(v_d[k])
      );
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_vv (
        .a_i(v_q3[k]), .b_i(v_q3[k]), .prod_o(vv_d[k])
      );
    end
    for (genvar i = 0; i < 4; i++) begin : gen_leader
      flk_fp_add #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_u (
        .a_i(p_q[i%2]), .b_i(q_q[i/2]), .sum_o(u_d[i])
      );
      flk_fp_mul #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_uu (
        .a_i(u_q[i]), .b_i(u_q[i]), .prod_o(uu_d[i])
      );
      flk_fp_add #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)) i_e (
        .a_i(uu_q[i]), .b_i(vv_q[i/2]), .sum_o(weight_d[i])
      );
    end

    always_ff @(posedge clk_i) begin
      p_q  <= p_d;
      q_q  <= q_d;
      v_q2 <= v_d;
      v_q3 <= v_q2;
      u_q  <= u_d;
      uu_q <= uu_d;
      vv_q <= vv_d;
    end
  end

  // The threshold travels beside stages 1 to 5.
  localparam int unsigned ThresholdDelay = PRTU_LATENCY - 1;
  quad_t [ThresholdDelay-1:0] threshold_q;

  always_ff @(posedge clk_i) begin
    weight_q    <= weight_d;
    threshold_q <= {threshold_q[ThresholdDelay-2:0], threshold_i};
  end

  // ---- Stage 6: comparison -------------------------------------------------------------------------

  logic [3:0] pass_d;

  for (genvar i = 0; i < 4; i++) begin : gen_compare
    flk_fp_cmp #(.ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn)) i_lt (
      .a_i(weight_q[i]), .b_i(threshold_q[ThresholdDelay-1]), .lt_o(pass_d[i])
    );
  end

  always_ff @(posedge clk_i) begin
    pass_o   <= pass_d;
    weight_o <= weight_q;
  end

endmodule
