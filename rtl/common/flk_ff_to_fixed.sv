// Ff number to fixed point (two's complement), pipelined (docs/reference/ff.md).
//
// Round 0: floor; 1: to nearest, ties upwards. What is too large becomes the largest number of its sign.
// Align | round, negate, saturate.
//
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the bar above. Registers load while en_i is high and are not reset.
module flk_ff_to_fixed #(
  parameter  int unsigned Bits     = 24,  // with the sign
  parameter  int unsigned FracBits = 6,
  parameter  bit          Round    = 1'b0,
  parameter  int unsigned ManBits  = 19,
  parameter  int unsigned Stages   = 2,
  localparam int unsigned Width    = 9 + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [Width-1:0] x_i,
  output logic [ Bits-1:0] y_o
);

  if (Bits < 2 || Bits > 48 || FracBits > 48) begin : gen_check_size
    $error("flk_ff_to_fixed: Bits must be 2 to 48, FracBits at most 48");
  end
  if (Stages > 2) begin : gen_check_stages
    $error("flk_ff_to_fixed: Stages must be 0 to 2");
  end

  localparam int unsigned ShiftBits = $clog2(Bits + 1);
  // All bits that a shift by Bits places leaves: the magnitude, the bit below it, others.
  localparam int unsigned FieldBits = ManBits + 1 + Bits;
  // Largest biased exponent of a magnitude that fits.
  localparam int unsigned TOP_EXP = 127 + Bits - 2 - FracBits;

  logic sign, sign_q, too_large, too_large_q, half, half_q, rest, rest_q;
  logic [7:0] exp;
  logic [ManBits-1:0] man;
  logic [8:0] below;  // places down from the top
  logic [ShiftBits-1:0] shift;
  logic [FieldBits-1:0] field;
  logic [Bits-2:0] mag_q;

  assign {sign, exp, man} = x_i;
  assign too_large = exp > 8'(TOP_EXP);
  assign below = 9'(TOP_EXP) - 9'(exp);
  assign shift = (32'(below) > Bits) ? ShiftBits'(Bits) : ShiftBits'(below);
  assign field = {exp != '0, man, Bits'(0)} >> shift;
  assign half = field[FieldBits-Bits];
  assign rest = |field[FieldBits-Bits-1:0];

  flk_delay #(
    .Width(4 + Bits - 1),
    .Depth(32'(Stages >= 2))
  ) i_aligned (
    .clk_i,
    .en_i,
    .d_i({sign, too_large, half, rest, field[FieldBits-1-:Bits-1]}),
    .q_o({sign_q, too_large_q, half_q, rest_q, mag_q})
  );

  // One more magnitude, before the negation: -(m + 1) = ~m.
  logic more;
  logic [Bits-1:0] value, result;

  assign more = Round ? half_q && (rest_q || !sign_q) : sign_q && (half_q || rest_q);
  assign value = {sign_q, mag_q ^ {Bits - 1{sign_q}}} + Bits'(sign_q ^ more);

  always_comb begin
    if (too_large_q || (!sign_q && value[Bits-1])) begin
      result = {sign_q, {Bits - 1{!sign_q}}};
    end else begin
      result = value;
    end
  end

  flk_delay #(
    .Width(Bits),
    .Depth(32'(Stages >= 1))
  ) i_y (
    .clk_i,
    .en_i,
    .d_i(result),
    .q_o(y_o)
  );

endmodule
