// Pixel of the frame buffer: a finished pixel over a background in 8 bits, and as RGBA in FP16 (golden/frame_buffer.py).
//
// rgb8_o: red in the lowest byte; round(255 colour + transmittance background), colour and transmittance in fixed point with 14
// fraction bits, negative colours 0, sums above 255 are 255. rgba_o: red in the lowest 16 bits, alpha = 1 - transmittance, which
// must not be above 1. Latency 3 cycles with en_i, a pixel a cycle. No combinational path.
module flk_pixel_out
  import flk_pkg::*;
(
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [2:0][7:0]  background_i,
  input  pixel_t           pixel_i,
  output logic [2:0][7:0]  rgb8_o,
  output logic [3:0][15:0] rgba_o
);

  localparam int unsigned FracBits = 14;
  localparam int unsigned SumBits = FracBits + 10;  // below 2 * 255 + 255
  localparam fp16_t ONE = 16'h3C00;

  fp16_t [2:0] colour;
  assign colour = {pixel_i.blue, pixel_i.green, pixel_i.red};

  // ---- RGB ------------------------------------------------------------------------------------------

  logic [FracBits:0] through, through_q;
  logic              unused_sign;

  flk_fp_to_fixed #(
    .IntBits (1),
    .FracBits(FracBits)
  ) i_through (
    .src_i (pixel_i.transmittance),
    .sign_o(unused_sign),
    .mag_o (through)
  );

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      through_q <= through;
    end
  end

  for (genvar c = 0; c < 3; c++) begin : gen_channel
    logic [FracBits:0]    fixed, fixed_q;
    logic                 negative;
    logic [FracBits+8:0]  own_q, behind_q;  // 255 colour, transmittance times background
    logic [SumBits-1:0]   sum;
    logic                 unused_rest;
    logic [7:0]           byte_q;

    flk_fp_to_fixed #(
      .IntBits (1),
      .FracBits(FracBits)
    ) i_fixed (
      .src_i (colour[c]),
      .sign_o(negative),
      .mag_o (fixed)
    );

    assign sum = SumBits'(own_q) + SumBits'(behind_q) + SumBits'(1 << (FracBits - 1));

    assign unused_rest = ^sum[FracBits-1:0];

    always_ff @(posedge clk_i) begin
      if (en_i) begin
        fixed_q  <= negative ? '0 : fixed;
        own_q    <= {fixed_q, 8'b0} - (FracBits + 9)'(fixed_q);
        behind_q <= (FracBits + 9)'(through_q) * (FracBits + 9)'(background_i[c]);
        byte_q   <= (|sum[SumBits-1:FracBits+8]) ? '1 : sum[FracBits+:8];
      end
    end

    assign rgb8_o[c] = byte_q;
  end

  // ---- RGBA -----------------------------------------------------------------------------------------

  fp16_t             alpha, transmittance_q;
  fp16_t [2:0][2:0]  colour_q;  // stage, channel

  flk_fp_add_pipe #(
    .ExpBits(5),
    .ManBits(10),
    .Stages (2)
  ) i_alpha (
    .clk_i,
    .en_i,
    .a_i  (ONE),
    .b_i  (transmittance_q ^ 16'h8000),
    .sum_o(alpha)
  );

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      transmittance_q <= pixel_i.transmittance;
      colour_q        <= {colour_q[1:0], colour};
    end
  end

  assign rgba_o = {alpha, colour_q[2]};

endmodule
