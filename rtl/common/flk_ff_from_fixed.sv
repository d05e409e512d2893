// Fixed point (two's complement) to an ff number, pipelined: round to nearest even (docs/reference/ff.md).
//
// Magnitude, count leading zeros | normalise, round.
//
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the bar above. Registers load while en_i is high and are not reset.
module flk_ff_from_fixed #(
  parameter  int unsigned Bits     = 24,  // with the sign
  parameter  int unsigned FracBits = 0,
  parameter  int unsigned ManBits  = 19,
  parameter  int unsigned Stages   = 2,
  localparam int unsigned Width    = 9 + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [ Bits-1:0] x_i,
  output logic [Width-1:0] y_o
);

  if (Bits < 2 || Bits > 64 || FracBits > 64) begin : gen_check_size
    $error("flk_ff_from_fixed: Bits must be 2 to 64, FracBits at most 64");
  end
  if (Stages > 2) begin : gen_check_stages
    $error("flk_ff_from_fixed: Stages must be 0 to 2");
  end

  localparam int unsigned ZeroBits = $clog2(Bits + 1);
  // Room for a guard and a sticky bit below the mantissa.
  localparam int unsigned WideBits = (Bits > ManBits + 3) ? Bits : ManBits + 3;
  // Biased exponent of the magnitude's top bit.
  localparam int unsigned TOP_EXP = 127 + Bits - 1 - FracBits;

  logic sign, sign_q;
  logic [Bits-1:0] mag, mag_q;
  logic [ZeroBits-1:0] zeros, zeros_q;

  assign sign = x_i[Bits-1];
  assign mag = (x_i ^ {Bits{sign}}) + Bits'(sign);

  flk_lzc #(
    .Width(Bits)
  ) i_zeros (
    .value_i(mag),
    .count_o(zeros)
  );

  flk_delay #(
    .Width(1 + Bits + ZeroBits),
    .Depth(32'(Stages >= 2))
  ) i_magnitude (
    .clk_i,
    .en_i,
    .d_i({sign, mag, zeros}),
    .q_o({sign_q, mag_q, zeros_q})
  );

  logic [WideBits-1:0] normal;
  logic round_up;
  logic [ManBits+7:0] code;
  logic [Width-1:0] result;

  assign normal = (WideBits'(mag_q) << (WideBits - Bits)) << zeros_q;
  assign round_up = normal[WideBits-2-ManBits]
                 && ((|normal[WideBits-3-ManBits:0]) || normal[WideBits-1-ManBits]);
  // A carry out of the mantissa raises the exponent.
  assign code = {8'(TOP_EXP) - 8'(zeros_q), normal[WideBits-2-:ManBits]} + (ManBits + 8)'(round_up);
  assign result = normal[WideBits-1] ? {sign_q, code} : '0;

  flk_delay #(
    .Width(Width),
    .Depth(32'(Stages >= 1))
  ) i_y (
    .clk_i,
    .en_i,
    .d_i(result),
    .q_o(y_o)
  );

endmodule
