// flk_ff_mul without registers against plain integers: the exact product, rounded to nearest even (fv_rounding). Below the smallest number there
// would be numbers of half its unit: what is rounded to it from there is kept, anything else is zero, and there is no other zero than +0.
module fv_ff_mul #(
  parameter  int unsigned ExpBits = 4,
  parameter  int unsigned ManBits = 3,
  localparam int unsigned Width   = 1 + ExpBits + ManBits
) (
  input logic [Width-1:0] a_i,
  input logic [Width-1:0] b_i
);

  typedef logic [Width-2:0] mag_t;

  localparam mag_t Least = mag_t'(1) << ManBits;
  localparam mag_t Most = {{ExpBits - 1{1'b1}}, 1'b0, {ManBits{1'b1}}};
  localparam int unsigned ValueBits = ManBits + 1 + (1 << ExpBits) - 2;
  // The squared unit is the unit / 2^Scale.
  localparam int unsigned Scale = (1 << (ExpBits - 1)) - 2 + ManBits;

  logic [Width-1:0] result;

  flk_ff_mul #(
    .ExpBits(ExpBits),
    .ManBits(ManBits),
    .Stages (0)
  ) dut (
    .clk_i (1'b0),
    .en_i  (1'b0),
    .a_i,
    .b_i,
    .prod_o(result)
  );

  mag_t a_mag, b_mag;
  logic [2*ManBits+1:0] product;
  logic [2*ValueBits-1:0] exact;
  logic ok;

  assign a_mag = a_i[Width-2:0];
  assign b_mag = b_i[Width-2:0];

  // Values are small numbers with zeros behind them: multiply the numbers, append all zeros.
  function automatic logic [ExpBits-1:0] zeros(mag_t mag);
    return mag[Width-2:ManBits] == '0 ? '0 : mag[Width-2:ManBits] - 1'b1;
  endfunction

  assign product = (2 * ManBits + 2)'({a_mag[Width-2:ManBits] != '0, a_mag[ManBits-1:0]})
                 * (2 * ManBits + 2)'({b_mag[Width-2:ManBits] != '0, b_mag[ManBits-1:0]});
  assign exact   = (2 * ValueBits)'(product)
                 << ((ExpBits + 1)'(zeros(a_mag)) + (ExpBits + 1)'(zeros(b_mag)));

  fv_rounding #(
    .ExpBits  (ExpBits),
    .ManBits  (ManBits),
    .Saturate (1'b1),
    .ExactBits(2 * ValueBits),
    .Scale    (Scale)
  ) i_rounding (
    .exact_i(exact),
    .mag_i  (result[Width-2:0]),
    .ok_o   (ok)
  );

  // A quarter of the unit below the smallest number.
  localparam logic [2*ValueBits+1:0] Edge = ((2 * ValueBits + 2)'(4 * Least) - 1'b1) << Scale;

  always_comb begin
    assume (a_mag == '0 || (a_mag >= Least && a_mag <= Most));
    assume (b_mag == '0 || (b_mag >= Least && b_mag <= Most));
    if ({exact, 2'b00} < Edge) begin
      a_result_zero: assert (result == '0);
    end else begin
      a_result_sign: assert (result[Width-1] == (a_i[Width-1] ^ b_i[Width-1]));
      a_result_value: assert (ok && result[Width-2:0] >= Least);
    end
    c_zero: cover (result == '0 && a_mag > Least && b_mag > Least);
    c_raised: cover (result[Width-2:0] == Least && exact < (2 * ValueBits)'(Least) << Scale);
    c_tie: cover (i_rounding.twice == i_rounding.high && result[Width-2:0] > Least && exact != '0);
    c_over: cover (result[Width-2:0] == Most && a_mag < Most && b_mag < Most);
  end

endmodule
