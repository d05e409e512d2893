// Volume rendering unit (VRU): blends splats into its pixels, one pixel-Gaussian pair per cycle, FP16.
//
// Operations come in program order: `op_valid_i` with a splat and a pixel, or with `op_eos_i` (end of sub-tile). There is no
// back-pressure on operations, except that a token may only come while `eos_ready_o` is high.
// A splat's pixels come in order, 0 to Pixels - 1, with op_feature_i held from the first to the last. So a pixel returns after Pixels
// operations at the soonest, and the read-modify-write loops of transmittance and colour take 4 cycles each; a splat may be broken off only
// when all pixels of the mini-tile are finished.
//
// | cycles, conic | factored | what |
// |---|---|---|
// | 1 | 1 | pixel and mean |
// | 3 | 3 | dx, dy |
// | 2 | 2 | dx dx, dy dy, dx dy; or l0 dx, l1 dy, l2 dy |
// | 2 | 3 | times a/2, c/2, b; or u |
// | 3 | 2 | sum of the squares; or u u, v v |
// | 3 | 2 | E |
// | 3 | 2 | e^-E or 2^-E |
// | 2 | 2 | o g |
// | 1 | 1 | alpha = min(o g, 0.99); alpha >= 1/255? |
// | 3 | 3 | 1 - alpha; the pixel's T is read |
// | 2 | 2 | T (1 - alpha), w = T alpha |
// | 0 | 0 | BLEND: T (1 - alpha) >= 1e-4? T is written |
// | 2 | 2 | w colour; the pixel's C is read |
// | 2 | 2 | C + w colour |
// | 0 | 0 | LAST: C is written |
//
// A token copies T (at BLEND) and C (at LAST) into the output buffer and clears the pixel state: the next sub-tile's operations
// may follow at once; what they read before the token has cleared it counts as cleared. The buffer then leaves as a stream of pixels; the
// next token may come when it is empty.
// Colours are not negative: their sign bits are ignored.
module flk_vru
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter  int unsigned Form   = FORM_FACTORED,
  parameter  int unsigned Pixels = PIXELS_PER_VRU,  // 4, 8 or 16
  localparam int unsigned IndexW = $clog2(Pixels),
  localparam int unsigned RowW   = 5 - IndexW  // of the rows 0 to 7, in which block of Pixels / 4
) (
  input  logic              clk_i,
  input  logic              rst_ni,
  input  logic              clear_i,  // forgets all operations, pixels and what waits to leave
  // Place in the sub-tile, constant: pixel i lies in column 4 col_i + i % 4, row (Pixels / 4) row_i + i / 4.
  input  logic              col_i,
  input  logic [RowW-1:0]   row_i,
  // operations
  input  logic              op_valid_i,
  input  logic              op_eos_i,
  input  logic [IndexW-1:0] op_pixel_i,
  input  feature_t          op_feature_i,
  output logic              eos_ready_o,
  // state of the sub-tile at BLEND
  output logic              blend_valid_o,  // an operation is at BLEND
  output logic [IndexW-1:0] blend_pixel_o,
  output logic              blend_eos_o,    // a token is at BLEND
  output logic [Pixels-1:0] finished_o,     // before the operation at BLEND
  output logic              finish_o,       // the operation at BLEND finishes its pixel
  // finished pixels
  output logic              out_valid_o,
  input  logic              out_ready_i,
  output logic [IndexW-1:0] out_index_o,
  output pixel_t            out_pixel_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_vru: Form must be FORM_CONIC or FORM_FACTORED");
  end
  if (Pixels != 4 && Pixels != 8 && Pixels != 16) begin : gen_check_pixels
    $error("flk_vru: Pixels must be 4, 8 or 16");
  end
  localparam bit Factored = (Form == FORM_FACTORED);

  // Cycles after the operation at which a value is in its register.
  localparam int unsigned DIFF = 1 + FP16_ADD_STAGES;
  localparam int unsigned PRODUCT = DIFF + FP16_MUL_STAGES;
  localparam int unsigned WEIGHT = Factored
      ? PRODUCT + FP16_ADD_STAGES + FP16_MUL_STAGES + FP16_SUM_STAGES
      : PRODUCT + FP16_MUL_STAGES + 2 * FP16_ADD_STAGES;
  localparam int unsigned EXP = 32'(EXP_STAGES[Form]);
  localparam int unsigned POWER = WEIGHT + EXP;
  localparam int unsigned ALPHA = POWER + FP16_MUL_STAGES + 1;
  localparam int unsigned OMA = ALPHA + FP16_ADD_STAGES;
  localparam int unsigned BLEND = OMA + FP16_MUL_STAGES;
  localparam int unsigned COLOUR = BLEND + FP16_MUL_STAGES;
  localparam int unsigned LAST = COLOUR + FP16_SUM_STAGES;

  // ---- Control pipeline: index s holds what came s cycles ago -----------------------------------------

  logic [LAST:1] valid_q, eos_q;
  logic [LAST:1][IndexW-1:0] pixel_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= '0;
      eos_q   <= '0;
    end else if (clear_i) begin
      valid_q <= '0;
      eos_q   <= '0;
    end else begin
      valid_q <= {valid_q[LAST-1:1], op_valid_i && !op_eos_i};
      eos_q   <= {eos_q[LAST-1:1], op_valid_i && op_eos_i};
    end
  end

  always_ff @(posedge clk_i) begin
    pixel_q <= {pixel_q[LAST-1:1], op_pixel_i};
  end

  if (Pixels < BLEND - OMA + 2 || Pixels < LAST - COLOUR + 2) begin : gen_check_loops
    $error("flk_vru: a pixel returns before its state is written");
  end

  // ---- A splat's numbers, each held for all pixels where it is needed -----------------------------------

  // Loaded when the splat's first pixel comes to the cycle in which it is used. Numbers needed long after the operation go through
  // holders on the way, Pixels cycles apart: the next splat follows at that distance at the soonest.
  localparam int unsigned SHAPE_AT = Factored ? DIFF : PRODUCT;
  localparam int unsigned OPACITY_AT = POWER;
  localparam int unsigned COLOUR_AT = BLEND;
  localparam int unsigned SHAPE_HOLDERS = (SHAPE_AT - 1) / Pixels;
  localparam int unsigned OPACITY_HOLDERS = (OPACITY_AT - 1) / Pixels;
  localparam int unsigned COLOUR_HOLDERS = (COLOUR_AT - 1) / Pixels;

  logic [LAST:2] first;  // the first pixel gets to cycle s at this edge
  for (genvar s = 2; s <= LAST; s++) begin : gen_first
    assign first[s] = valid_q[s-1] && (pixel_q[s-1] == '0);
  end

  fp16_t mean_x_q, mean_y_q;
  logic [2:0][15:0] shape_q;
  fp16_t opacity_q;
  logic [2:0][14:0] colour_q;  // 0 red, 1 green, 2 blue
  // What comes to each holder, the last entry being what is loaded where it is used.
  logic [SHAPE_HOLDERS:0][2:0][15:0] shape;
  fp16_t [OPACITY_HOLDERS:0] opacity;
  logic [COLOUR_HOLDERS:0][2:0][14:0] colour;

  assign shape[0]   = {op_feature_i.shape2, op_feature_i.shape1, op_feature_i.shape0};
  assign opacity[0] = op_feature_i.opacity;
  assign colour[0]  = {op_feature_i.blue[14:0], op_feature_i.green[14:0], op_feature_i.red[14:0]};

  for (genvar k = 1; k <= SHAPE_HOLDERS; k++) begin : gen_shape
    logic [2:0][15:0] held_q;
    always_ff @(posedge clk_i) begin
      if (first[k*Pixels]) begin
        held_q <= shape[k-1];
      end
    end
    assign shape[k] = held_q;
  end
  for (genvar k = 1; k <= OPACITY_HOLDERS; k++) begin : gen_opacity
    fp16_t held_q;
    always_ff @(posedge clk_i) begin
      if (first[k*Pixels]) begin
        held_q <= opacity[k-1];
      end
    end
    assign opacity[k] = held_q;
  end
  for (genvar k = 1; k <= COLOUR_HOLDERS; k++) begin : gen_colour_held
    logic [2:0][14:0] held_q;
    always_ff @(posedge clk_i) begin
      if (first[k*Pixels]) begin
        held_q <= colour[k-1];
      end
    end
    assign colour[k] = held_q;
  end

  always_ff @(posedge clk_i) begin
    if (op_pixel_i == '0) begin
      mean_x_q <= op_feature_i.mean_x;
      mean_y_q <= op_feature_i.mean_y;
    end
    if (first[SHAPE_AT]) begin
      shape_q <= shape[SHAPE_HOLDERS];
    end
    if (first[OPACITY_AT]) begin
      opacity_q <= opacity[OPACITY_HOLDERS];
    end
    if (first[COLOUR_AT]) begin
      colour_q <= colour[COLOUR_HOLDERS];
    end
  end

  // ---- Differences ---------------------------------------------------------------------------------------

  logic [4:0] place;  // row in the sub-tile, column in the mini-tile
  fp16_t dx_q, dy_q;

  assign place = {row_i, pixel_q[1]};

  flk_fp_add_pipe #(.Stages(FP16_ADD_STAGES)) i_dx (
    .clk_i,
    .en_i (1'b1),
    .a_i  (PIXEL_FP16[{col_i, place[1:0]}]),
    .b_i  ({~mean_x_q[15], mean_x_q[14:0]}),
    .sum_o(dx_q)
  );
  flk_fp_add_pipe #(.Stages(FP16_ADD_STAGES)) i_dy (
    .clk_i,
    .en_i (1'b1),
    .a_i  (PIXEL_FP16[place[4:2]]),
    .b_i  ({~mean_y_q[15], mean_y_q[14:0]}),
    .sum_o(dy_q)
  );

  // ---- Weight ----------------------------------------------------------------------------------------------

  fp16_t weight_q;

  if (Form == FORM_CONIC) begin : gen_conic
    fp16_t xx_q, yy_q, xy_q, sx_q, sy_q, t_q, t_late_q, h_q;

    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_xx (
      .clk_i, .en_i(1'b1), .a_i(dx_q), .b_i(dx_q), .prod_o(xx_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_yy (
      .clk_i, .en_i(1'b1), .a_i(dy_q), .b_i(dy_q), .prod_o(yy_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_xy (
      .clk_i, .en_i(1'b1), .a_i(dx_q), .b_i(dy_q), .prod_o(xy_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_sx (
      .clk_i, .en_i(1'b1), .a_i(xx_q), .b_i(shape_q[0]), .prod_o(sx_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_sy (
      .clk_i, .en_i(1'b1), .a_i(yy_q), .b_i(shape_q[2]), .prod_o(sy_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_t (
      .clk_i, .en_i(1'b1), .a_i(xy_q), .b_i(shape_q[1]), .prod_o(t_q)
    );
    flk_fp_add_pipe #(.Stages(FP16_ADD_STAGES)) i_h (
      .clk_i, .en_i(1'b1), .a_i(sx_q), .b_i(sy_q), .sum_o(h_q)
    );
    flk_delay #(.Width(16), .Depth(FP16_ADD_STAGES)) i_t_late (
      .clk_i, .en_i(1'b1), .d_i(t_q), .q_o(t_late_q)
    );
    flk_fp_add_pipe #(.Stages(FP16_ADD_STAGES)) i_e (
      .clk_i, .en_i(1'b1), .a_i(h_q), .b_i(t_late_q), .sum_o(weight_q)
    );
  end else begin : gen_factored
    fp16_t p_q, q_q, v_q, v_late_q, u_q, uu_q, vv_q;

    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_p (
      .clk_i, .en_i(1'b1), .a_i(shape_q[0]), .b_i(dx_q), .prod_o(p_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_q (
      .clk_i, .en_i(1'b1), .a_i(shape_q[1]), .b_i(dy_q), .prod_o(q_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_v (
      .clk_i, .en_i(1'b1), .a_i(shape_q[2]), .b_i(dy_q), .prod_o(v_q)
    );
    flk_fp_add_pipe #(.Stages(FP16_ADD_STAGES)) i_u (
      .clk_i, .en_i(1'b1), .a_i(p_q), .b_i(q_q), .sum_o(u_q)
    );
    flk_delay #(.Width(16), .Depth(FP16_ADD_STAGES)) i_v_late (
      .clk_i, .en_i(1'b1), .d_i(v_q), .q_o(v_late_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_uu (
      .clk_i, .en_i(1'b1), .a_i(u_q), .b_i(u_q), .prod_o(uu_q)
    );
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_vv (
      .clk_i, .en_i(1'b1), .a_i(v_late_q), .b_i(v_late_q), .prod_o(vv_q)
    );
    flk_fp_add_pipe #(.Cancel(0), .Stages(FP16_SUM_STAGES)) i_e (
      .clk_i, .en_i(1'b1), .a_i(uu_q), .b_i(vv_q), .sum_o(weight_q)
    );
  end

  // ---- Alpha -------------------------------------------------------------------------------------------------

  fp16_t g_q, product_q, alpha_q, alpha_late_q, oma_q;
  logic contributes_q, contributes_late_q;

  // A negative or NaN weight gives g = 0, so that alpha is below 1/255.
  flk_exp_neg_pipe #(
    .Base2 (Factored),
    .Stages(EXP)
  ) i_exp (
    .clk_i,
    .en_i(1'b1),
    .e_i (weight_q),
    .g_o (g_q)
  );
  flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_alpha (
    .clk_i, .en_i(1'b1), .a_i(opacity_q), .b_i(g_q), .prod_o(product_q)
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
    .Depth(OMA - ALPHA)
  ) i_alpha_late (
    .clk_i,
    .en_i(1'b1),
    .d_i (alpha_q),
    .q_o (alpha_late_q)
  );
  flk_delay #(
    .Width(1),
    .Depth(BLEND - ALPHA)
  ) i_contributes (
    .clk_i,
    .en_i(1'b1),
    .d_i (contributes_q),
    .q_o (contributes_late_q)
  );

  // ---- Transmittance: read for OMA, written at BLEND -----------------------------------------------------------

  logic [Pixels-1:0][14:0] t_q;  // not negative
  logic [Pixels-1:0] finished_q;
  fp16_t t_now_q, t_next_q, w_q;
  logic blend, finish;
  logic [IndexW-1:0] blend_pixel;

  always_ff @(posedge clk_i) begin
    // A token between here and BLEND will have cleared it.
    t_now_q <= (|eos_q[BLEND:OMA]) ? FP16_ONE : {1'b0, t_q[pixel_q[OMA-1]]};
  end

  flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_t_next (
    .clk_i,
    .en_i  (1'b1),
    .a_i   (t_now_q),
    .b_i   (oma_q),
    .prod_o(t_next_q)
  );
  flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_w (
    .clk_i,
    .en_i  (1'b1),
    .a_i   (t_now_q),
    .b_i   (alpha_late_q),
    .prod_o(w_q)
  );

  assign blend_pixel = pixel_q[BLEND];

  always_comb begin
    blend  = 1'b0;
    finish = 1'b0;
    if (valid_q[BLEND] && contributes_late_q && !finished_q[blend_pixel]) begin
      if (t_next_q < TRANSMITTANCE_MIN) begin
        finish = 1'b1;
      end else begin
        blend = 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      t_q        <= {Pixels{FP16_ONE[14:0]}};
      finished_q <= '0;
    end else if (clear_i || eos_q[BLEND]) begin
      t_q        <= {Pixels{FP16_ONE[14:0]}};
      finished_q <= '0;
    end else begin
      if (blend) begin
        t_q[blend_pixel] <= t_next_q[14:0];
      end
      if (finish) begin
        finished_q[blend_pixel] <= 1'b1;
      end
    end
  end

  assign blend_valid_o = valid_q[BLEND];
  assign blend_pixel_o = blend_pixel;
  assign blend_eos_o   = eos_q[BLEND];
  assign finished_o    = finished_q;
  assign finish_o      = finish;

  // ---- Colour: read for COLOUR, written at LAST ------------------------------------------------------------------

  fp16_t [2:0] m_q, c_next_q;
  logic [2:0][14:0] c_now_q;
  logic [Pixels-1:0][2:0][14:0] c_q;  // not negative
  logic [LAST:BLEND+1] blend_q;

  for (genvar k = 0; k < 3; k++) begin : gen_colour
    flk_fp_mul_pipe #(.Stages(FP16_MUL_STAGES)) i_m (
      .clk_i,
      .en_i  (1'b1),
      .a_i   (w_q),
      .b_i   ({1'b0, colour_q[k]}),
      .prod_o(m_q[k])
    );
    flk_fp_add_pipe #(.Cancel(0), .Stages(FP16_SUM_STAGES)) i_c (
      .clk_i,
      .en_i (1'b1),
      .a_i  ({1'b0, c_now_q[k]}),
      .b_i  (m_q[k]),
      .sum_o(c_next_q[k])
    );
  end

  always_ff @(posedge clk_i) begin
    c_now_q <= (|eos_q[LAST:COLOUR]) ? '0 : c_q[pixel_q[COLOUR-1]];
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      c_q     <= '0;
      blend_q <= '0;
    end else begin
      blend_q <= clear_i ? '0 : {blend_q[LAST-1:BLEND+1], blend};
      if (clear_i || eos_q[LAST]) begin
        c_q <= '0;
      end else if (blend_q[LAST]) begin
        for (int unsigned k = 0; k < 3; k++) begin
          c_q[pixel_q[LAST]][k] <= c_next_q[k][14:0];
        end
      end
    end
  end

  // ---- Output buffer -----------------------------------------------------------------------------------------------

  logic [Pixels-1:0][14:0] out_t_q;
  logic [Pixels-1:0][2:0][14:0] out_c_q;
  logic busy_q, full_q, last;
  logic [IndexW-1:0] out_index_q;

  assign last = out_valid_o && out_ready_i && (out_index_q == IndexW'(Pixels - 1));

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      busy_q      <= 1'b0;
      full_q      <= 1'b0;
      out_index_q <= '0;
    end else if (clear_i) begin
      busy_q      <= 1'b0;
      full_q      <= 1'b0;
      out_index_q <= '0;
    end else begin
      if (op_valid_i && op_eos_i) begin
        busy_q <= 1'b1;
      end else if (last) begin
        busy_q <= 1'b0;
      end
      if (eos_q[LAST]) begin
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
    if (eos_q[LAST]) begin
      out_c_q <= c_q;
    end
  end

  assign eos_ready_o = !busy_q;
  assign out_valid_o = full_q;
  always_comb begin
    out_index_o               = out_index_q;
    out_pixel_o.transmittance = {1'b0, out_t_q[out_index_q]};
    out_pixel_o.red           = {1'b0, out_c_q[out_index_q][0]};
    out_pixel_o.green         = {1'b0, out_c_q[out_index_q][1]};
    out_pixel_o.blue          = {1'b0, out_c_q[out_index_q][2]};
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) op_valid_i && op_eos_i |-> eos_ready_o)
  else $error("flk_vru: token while the output buffer is in use");

  // Pixels in order: so a pixel returns only when its state has been written.
  logic [IndexW-1:0] next_pixel_q;
  always_ff @(posedge clk_i) begin
    if (op_valid_i) begin
      next_pixel_q <= op_eos_i ? '0 : op_pixel_i + IndexW'(1);
    end
  end
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      op_valid_i && !op_eos_i && (op_pixel_i != '0) |-> op_pixel_i == next_pixel_q)
  else $error("flk_vru: pixel out of order");
`endif

endmodule
