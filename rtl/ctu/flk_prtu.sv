// Pixel-rectangle test unit (PRTU): the Gaussian weights of the leader pixels in Cols columns and Rows rows, and their comparison with
// the splat's threshold (paper, Algorithm 1: two columns, two rows; factored form: docs/reference/prtu.md). With one column and one row it is the
// plain test unit of a single pixel.
//
// Leader i lies in column i % Cols, row i / Cols: with two of each, 0 is top left, 1 top right, 2 bottom left, 3 bottom right.
// A splat's numbers are taken when they are needed: coordinates first, mean PRTU_MEAN_DELAY[Precision] and shape
// PRTU_SHAPE_DELAY[Precision] cycles later, threshold in the last cycle before the answer; pass_o comes
// PRTU_LATENCY[Form][Precision] cycles after the coordinates. Throughput one rectangle per cycle. All registers load while en_i is high;
// none is reset. No handshake: the CTU keeps track of what is inside.
// pass_o[i] is high when threshold_i > weight i; a NaN weight does not pass.
//
// The format of the test (`Quad`), in which shape, threshold and weights are, is FP16 or E4M3.
module flk_prtu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form      = FORM_FACTORED,
  parameter int unsigned Precision = PRECISION_FIXED,
  parameter int unsigned Cols      = 2,
  parameter int unsigned Rows      = 2,
  localparam int unsigned Leaders  = Cols * Rows,
  // Bits of the quad format: FP16 for PRECISION_FP16, else E4M3.
  localparam int unsigned QuadBits = (Precision == PRECISION_FP16) ? 16 : 8
) (
  input  logic                             clk_i,
  input  logic                             en_i,
  input  logic [   Cols-1:0][         2:0] x_i,
  input  logic [   Rows-1:0][         2:0] y_i,
  input  fp16_t                            mean_x_i,
  input  fp16_t                            mean_y_i,
  input  logic [        2:0][QuadBits-1:0] shape_i,
  input  logic [QuadBits-1:0]              threshold_i,
  output logic [Leaders-1:0]               pass_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_prtu: Form must be FORM_CONIC or FORM_FACTORED");
  end
  if (Precision > PRECISION_FIXED) begin : gen_check_precision
    $error("flk_prtu: Precision must be PRECISION_FP16, _MIXED, _FP8 or _FIXED");
  end

  localparam bit Wide = (Precision == PRECISION_FP16);
  localparam int unsigned ExpBits = Wide ? 5 : 4;
  localparam int unsigned ManBits = Wide ? 10 : 3;
  localparam bit Fn = !Wide;
  localparam bit Saturate = !Wide;

  typedef logic [QuadBits-1:0] quad_t;

  // ---- Differences, converted to the quad format (Alg. 1, line 1) ----------------------------------

  quad_t [Cols-1:0] dx_q;
  quad_t [Rows-1:0] dy_q;

  // Axis 0: columns and mean_x, axis 1: rows and mean_y.
  for (genvar axis = 0; axis < 2; axis++) begin : gen_axis
    localparam int unsigned Count = (axis == 0) ? Cols : Rows;
    logic [Count-1:0][2:0] pixel;
    quad_t [Count-1:0] d_q;
    fp16_t mean;

    if (axis == 0) begin : gen_x
      assign pixel = x_i;
      assign mean = mean_x_i;
      assign dx_q = d_q;
    end else begin : gen_y
      assign pixel = y_i;
      assign mean = mean_y_i;
      assign dy_q = d_q;
    end

    if (Precision == PRECISION_FP8) begin : gen_fp8
      logic [7:0] mean8, mean8_q;
      logic [Count-1:0][2:0] pixel_q;
      flk_fp_convert i_mean (
        .src_i(mean),
        .dst_o(mean8)
      );
      always_ff @(posedge clk_i) begin
        if (en_i) begin
          mean8_q <= mean8;
          pixel_q <= pixel;
        end
      end
      for (genvar k = 0; k < Count; k++) begin : gen_pixel
        flk_fp_add_pipe #(
          .ExpBits(4), .ManBits(3), .Fn(1), .Saturate(1), .Stages(FP8_ADD_STAGES)
        ) i_d (
          .clk_i,
          .en_i,
          .a_i  (PIXEL_E4M3[pixel_q[k]]),
          .b_i  ({~mean8_q[7], mean8_q[6:0]}),
          .sum_o(d_q[k])
        );
      end
    end else if (Precision == PRECISION_FIXED) begin : gen_fixed
      // Mean to fixed point; subtraction and magnitude; conversion.
      localparam int unsigned MeanBits = FIXED_INT_BITS + FIXED_FRAC_BITS;
      localparam int unsigned MagBits = MeanBits + 1;
      logic mean_sign, mean_sign_q;
      logic [MeanBits-1:0] mean_mag, mean_mag_q;
      logic [Count-1:0][2:0] pixel_q;
      flk_fp_to_fixed #(
        .IntBits (FIXED_INT_BITS),
        .FracBits(FIXED_FRAC_BITS)
      ) i_mean (
        .src_i (mean),
        .sign_o(mean_sign),
        .mag_o (mean_mag)
      );
      always_ff @(posedge clk_i) begin
        if (en_i) begin
          mean_sign_q <= mean_sign;
          mean_mag_q  <= mean_mag;
          pixel_q     <= pixel;
        end
      end
      for (genvar k = 0; k < Count; k++) begin : gen_pixel
        logic [MagBits-1:0] shifted;
        logic [MagBits:0] apart;  // |mean| plus the pixel, or less it
        logic sign_d, sign_q;
        logic [MagBits-1:0] mag_d, mag_q;
        quad_t code;
        assign shifted = MagBits'(pixel_q[k]) << FIXED_FRAC_BITS;
        assign apart = mean_sign_q ? (MagBits + 1)'(mean_mag_q) + (MagBits + 1)'(shifted)
                                   : (MagBits + 1)'(mean_mag_q) - (MagBits + 1)'(shifted);
        // Pixel less mean is negative if the mean is positive and the larger one.
        assign sign_d = !mean_sign_q && !apart[MagBits];
        assign mag_d = (!mean_sign_q && apart[MagBits]) ? -apart[MagBits-1:0] : apart[MagBits-1:0];
        flk_fixed_to_fp #(
          .MagBits (MagBits),
          .FracBits(FIXED_FRAC_BITS)
        ) i_code (
          .sign_i(sign_q),
          .mag_i (mag_q),
          .dst_o (code)
        );
        always_ff @(posedge clk_i) begin
          if (en_i) begin
            sign_q <= sign_d;
            mag_q  <= mag_d;
            d_q[k] <= code;
          end
        end
      end
    end else begin : gen_fp16
      // The CTU chooses the coordinates late in the cycle; the subtraction begins with the next.
      logic [Count-1:0][2:0] pixel_q;
      always_ff @(posedge clk_i) begin
        if (en_i) begin
          pixel_q <= pixel;
        end
      end
      for (genvar k = 0; k < Count; k++) begin : gen_pixel
        fp16_t d16_q;
        flk_fp_add_pipe #(
          .Stages(FP16_ADD_STAGES)
        ) i_d (
          .clk_i,
          .en_i,
          .a_i  (PIXEL_FP16[pixel_q[k]]),
          .b_i  ({~mean[15], mean[14:0]}),
          .sum_o(d16_q)
        );
        if (Precision == PRECISION_MIXED) begin : gen_convert
          quad_t d8;
          flk_fp_convert i_d8 (
            .src_i(d16_q),
            .dst_o(d8)
          );
          always_ff @(posedge clk_i) begin
            if (en_i) begin
              d_q[k] <= d8;
            end
          end
        end else begin : gen_keep
          assign d_q[k] = d16_q;
        end
      end
    end
  end

  // ---- Weights -----------------------------------------------------------------------------------------

  quad_t [Leaders-1:0] weight_q;
  quad_t [2:0] shape_late;

  flk_delay #(
    .Width($bits(shape_i)),
    .Depth(32'(WEIGHT_SHAPE_DELAY[Form][Wide]))
  ) i_shape (
    .clk_i,
    .en_i,
    .d_i(shape_i),
    .q_o(shape_late)
  );

  flk_weight #(
    .Form    (Form),
    .Cols    (Cols),
    .Rows    (Rows),
    .ExpBits (ExpBits),
    .ManBits (ManBits),
    .Fn      (Fn),
    .Saturate(Saturate)
  ) i_weight (
    .clk_i,
    .en_i,
    .dx_i    (dx_q),
    .dy_i    (dy_q),
    .shape_i (shape_late),
    .weight_o(weight_q)
  );

  // ---- Comparison (Alg. 1, line 7) -----------------------------------------------------------------------

  logic [Leaders-1:0] pass_d;

  for (genvar i = 0; i < Leaders; i++) begin : gen_compare
    flk_fp_cmp #(
      .ExpBits(ExpBits),
      .ManBits(ManBits),
      .Fn     (Fn)
    ) i_lt (
      .a_i (weight_q[i]),
      .b_i (threshold_i),
      .lt_o(pass_d[i])
    );
  end

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      pass_o <= pass_d;
    end
  end

endmodule
