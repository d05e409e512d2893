// The Gaussian weight E of the pixels in Cols columns and Rows rows, from their differences to the mean and the splat's shape.
//
// Pixel i lies in column i % Cols, row i / Cols. What depends on a column or a row only is computed once for it:
//
// | form | column | row | pixel |
// |---|---|---|---|
// | conic: shape a/2, b, c/2 | xx = dx dx, sx = xx (a/2) | yy = dy dy, sy = yy (c/2) | h = sx + sy, t = (dx dy) b, E = h + t |
// | factored: shape l0, l1, l2 | p = l0 dx | q = l1 dy, v = l2 dy, vv = v v | u = p + q, uu = u u, E = uu + vv |
//
// Each operation is rounded to the format (ExpBits, ManBits, Fn, Saturate; docs/reference/arithmetic.md), in the order printed. Formats of up to
// 8 bits have fewer registers in their operators than longer ones (`Wide`).
// weight_o comes WEIGHT_LATENCY[Form][Wide] cycles after dx_i and dy_i; shape_i is taken WEIGHT_SHAPE_DELAY[Form][Wide] cycles after them.
// Throughput one set of pixels per cycle. All registers load while en_i is high; none is reset. No handshake, no combinational path.
module flk_weight
  import flk_param_pkg::*;
#(
  parameter  int unsigned Form     = FORM_FACTORED,
  parameter  int unsigned Cols     = 1,
  parameter  int unsigned Rows     = 1,
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,
  parameter  bit          Saturate = 1'b0,
  localparam int unsigned Width    = 1 + ExpBits + ManBits,
  localparam int unsigned Pixels   = Cols * Rows
) (
  input  logic                         clk_i,
  input  logic                         en_i,
  input  logic [  Cols-1:0][Width-1:0] dx_i,
  input  logic [  Rows-1:0][Width-1:0] dy_i,
  input  logic [       2:0][Width-1:0] shape_i,
  output logic [Pixels-1:0][Width-1:0] weight_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_weight: Form must be FORM_CONIC or FORM_FACTORED");
  end
  if (Cols < 1 || Rows < 1) begin : gen_check_size
    $error("flk_weight: Cols and Rows must be at least 1");
  end

  localparam bit Wide = (Width > 8);
  localparam int unsigned ADD = Wide ? FP16_ADD_STAGES : FP8_ADD_STAGES;
  localparam int unsigned SUM = Wide ? FP16_SUM_STAGES : FP8_SUM_STAGES;
  localparam int unsigned MUL = Wide ? FP16_MUL_STAGES : FP8_MUL_STAGES;

  typedef logic [Width-1:0] number_t;

  if (Form == FORM_CONIC) begin : gen_conic
    // Squares and cross products, then times the conic, sum of the squares, weight.
    number_t [Cols-1:0] xx_q, sx_q;
    number_t [Rows-1:0] yy_q, sy_q;
    number_t [Pixels-1:0] xy_q, t_q, t_late_q, h_q;

    if (32'(WEIGHT_SHAPE_DELAY[Form][Wide]) != MUL
        || 32'(WEIGHT_LATENCY[Form][Wide]) != 2 * MUL + 2 * ADD) begin : gen_check_latency
      $error("flk_weight: its latency is not that of flk_param_pkg");
    end

    for (genvar k = 0; k < Cols; k++) begin : gen_col
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_xx (
        .clk_i, .en_i, .a_i(dx_i[k]), .b_i(dx_i[k]), .prod_o(xx_q[k])
      );
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_sx (
        .clk_i, .en_i, .a_i(xx_q[k]), .b_i(shape_i[0]), .prod_o(sx_q[k])
      );
    end
    for (genvar k = 0; k < Rows; k++) begin : gen_row
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_yy (
        .clk_i, .en_i, .a_i(dy_i[k]), .b_i(dy_i[k]), .prod_o(yy_q[k])
      );
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_sy (
        .clk_i, .en_i, .a_i(yy_q[k]), .b_i(shape_i[2]), .prod_o(sy_q[k])
      );
    end
    for (genvar i = 0; i < Pixels; i++) begin : gen_pixel
      localparam int unsigned Col = i % Cols;
      localparam int unsigned Row = i / Cols;
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_xy (
        .clk_i, .en_i, .a_i(dx_i[Col]), .b_i(dy_i[Row]), .prod_o(xy_q[i])
      );
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_t (
        .clk_i, .en_i, .a_i(xy_q[i]), .b_i(shape_i[1]), .prod_o(t_q[i])
      );
      flk_fp_add_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(ADD)
      ) i_h (
        .clk_i, .en_i, .a_i(sx_q[Col]), .b_i(sy_q[Row]), .sum_o(h_q[i])
      );
      flk_delay #(.Width(Width), .Depth(ADD)) i_t_late (
        .clk_i, .en_i, .d_i(t_q[i]), .q_o(t_late_q[i])
      );
      flk_fp_add_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(ADD)
      ) i_e (
        .clk_i, .en_i, .a_i(h_q[i]), .b_i(t_late_q[i]), .sum_o(weight_o[i])
      );
    end
  end else begin : gen_factored
    // Products with the factors, u = p + q, squares, weight: a sum of squares, which cannot cancel.
    number_t [Cols-1:0] p_q;
    number_t [Rows-1:0] q_q, v_q, v_late_q, vv_q;
    number_t [Pixels-1:0] u_q, uu_q;

    if (32'(WEIGHT_SHAPE_DELAY[Form][Wide]) != 0
        || 32'(WEIGHT_LATENCY[Form][Wide]) != 2 * MUL + ADD + SUM) begin : gen_check_latency
      $error("flk_weight: its latency is not that of flk_param_pkg");
    end

    for (genvar k = 0; k < Cols; k++) begin : gen_col
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_p (
        .clk_i, .en_i, .a_i(shape_i[0]), .b_i(dx_i[k]), .prod_o(p_q[k])
      );
    end
    for (genvar k = 0; k < Rows; k++) begin : gen_row
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_q (
        .clk_i, .en_i, .a_i(shape_i[1]), .b_i(dy_i[k]), .prod_o(q_q[k])
      );
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_v (
        .clk_i, .en_i, .a_i(shape_i[2]), .b_i(dy_i[k]), .prod_o(v_q[k])
      );
      flk_delay #(.Width(Width), .Depth(ADD)) i_v_late (
        .clk_i, .en_i, .d_i(v_q[k]), .q_o(v_late_q[k])
      );
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_vv (
        .clk_i, .en_i, .a_i(v_late_q[k]), .b_i(v_late_q[k]), .prod_o(vv_q[k])
      );
    end
    for (genvar i = 0; i < Pixels; i++) begin : gen_pixel
      localparam int unsigned Col = i % Cols;
      localparam int unsigned Row = i / Cols;
      flk_fp_add_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(ADD)
      ) i_u (
        .clk_i, .en_i, .a_i(p_q[Col]), .b_i(q_q[Row]), .sum_o(u_q[i])
      );
      flk_fp_mul_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Stages(MUL)
      ) i_uu (
        .clk_i, .en_i, .a_i(u_q[i]), .b_i(u_q[i]), .prod_o(uu_q[i])
      );
      flk_fp_add_pipe #(
        .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Cancel(0), .Stages(SUM)
      ) i_e (
        .clk_i, .en_i, .a_i(uu_q[i]), .b_i(vv_q[Row]), .sum_o(weight_o[i])
      );
    end
  end

endmodule
