// Is a result the exact number rounded to nearest, ties to even?
//
// It is if the exact number does not lie beyond the midpoints between the result and its two
// neighbours, nor on one of them when the result is odd. Above the largest finite number comes
// infinity, or with Saturate nothing. No step of this resembles the units under proof.
module fv_rounding #(
  parameter  int unsigned ExpBits   = 5,
  parameter  int unsigned ManBits   = 10,
  parameter  bit          Fn        = 1'b0,  // no infinity, NaN is all ones
  parameter  bit          Saturate  = 1'b0,
  parameter  int unsigned ExactBits = 41,
  parameter  int unsigned Scale     = 0,  // unit of exact_i: smallest subnormal number / 2^Scale
  localparam int unsigned MagBits   = ExpBits + ManBits
) (
  input  logic [ExactBits-1:0] exact_i,
  input  logic [  MagBits-1:0] mag_i,
  output logic                 ok_o
);

  typedef logic [MagBits-1:0] mag_t;

  localparam mag_t Inf = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam mag_t Finite = Fn ? mag_t'(-2) : Inf - 1'b1;
  localparam mag_t Top = Saturate ? Finite : Inf;
  localparam int unsigned ValueBits = ManBits + 1 + (1 << ExpBits) - 2;
  // Twice the exact number, or the sum of two neighbours.
  localparam int unsigned FormatBits = ValueBits + Scale;
  localparam int unsigned WideBits = ((ExactBits > FormatBits) ? ExactBits : FormatBits) + 1;

  logic [ValueBits-1:0] below, here, above;
  logic [WideBits-1:0] twice, low, high;

  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_below (
    .mag_i(mag_i - 1'b1), .value_o(below)
  );
  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_here (.mag_i, .value_o(here));
  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_above (
    .mag_i(mag_i + 1'b1), .value_o(above)
  );

  assign twice = WideBits'(exact_i) << 1;
  assign low   = (WideBits'(below) + WideBits'(here)) << Scale;
  assign high  = (WideBits'(here) + WideBits'(above)) << Scale;

  always_comb begin
    ok_o = mag_i <= Top;
    if (mag_i != '0) begin
      ok_o = ok_o && (mag_i[0] ? twice > low : twice >= low);
    end
    if (mag_i != Top) begin
      ok_o = ok_o && (mag_i[0] ? twice < high : twice <= high);
    end
  end

endmodule
