// flk_fp_mul against plain integers: the exact product in units of the squared smallest subnormal
// number, rounded to nearest even (fv_rounding); signs, infinities and NaN by their rules.
module fv_fp_mul #(
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,
  parameter  bit          Saturate = 1'b0,
  localparam int unsigned Width    = 1 + ExpBits + ManBits
) (
  input logic [Width-1:0] a_i,
  input logic [Width-1:0] b_i
);

  typedef logic [Width-2:0] mag_t;

  localparam mag_t Inf = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam mag_t Nan = Fn ? '1 : Inf | (mag_t'(1) << (ManBits - 1));
  // Largest number, infinity included if the format has it; what an infinite result becomes.
  localparam mag_t Top = Fn ? Nan - 1'b1 : Inf;
  localparam mag_t Limit = !Saturate ? Inf : Fn ? Top : Inf - 1'b1;
  localparam int unsigned ValueBits = ManBits + 1 + (1 << ExpBits) - 2;

  logic [Width-1:0] result;

  flk_fp_mul #(
    .ExpBits (ExpBits),
    .ManBits (ManBits),
    .Fn      (Fn),
    .Saturate(Saturate)
  ) dut (
    .a_i,
    .b_i,
    .prod_o(result)
  );

  mag_t a_mag, b_mag;
  logic a_nan, b_nan, a_inf, b_inf, ok;
  logic [2*ValueBits-1:0] exact;
  logic sign;

  // The squared smallest subnormal number is that number / 2^Scale.
  localparam int unsigned Scale = (1 << (ExpBits - 1)) - 2 + ManBits;

  assign a_mag = a_i[Width-2:0];
  assign b_mag = b_i[Width-2:0];
  assign a_nan = a_mag > Top;
  assign b_nan = b_mag > Top;
  assign a_inf = !Fn && a_mag == Inf;
  assign b_inf = !Fn && b_mag == Inf;

  // Values are small numbers with zeros behind them: multiply the numbers, append all zeros.
  function automatic logic [ExpBits-1:0] zeros(mag_t mag);
    return mag[Width-2:ManBits] == '0 ? '0 : mag[Width-2:ManBits] - 1'b1;
  endfunction

  logic [2*ManBits+1:0] product;

  assign product = (2 * ManBits + 2)'({a_mag[Width-2:ManBits] != '0, a_mag[ManBits-1:0]})
                 * (2 * ManBits + 2)'({b_mag[Width-2:ManBits] != '0, b_mag[ManBits-1:0]});
  assign exact   = (2 * ValueBits)'(product)
                 << ((ExpBits + 1)'(zeros(a_mag)) + (ExpBits + 1)'(zeros(b_mag)));
  assign sign    = a_i[Width-1] ^ b_i[Width-1];

  fv_rounding #(
    .ExpBits  (ExpBits),
    .ManBits  (ManBits),
    .Fn       (Fn),
    .Saturate (Saturate),
    .ExactBits(2 * ValueBits),
    .Scale    (Scale)
  ) i_rounding (
    .exact_i(exact),
    .mag_i  (result[Width-2:0]),
    .ok_o   (ok)
  );

  always_comb begin
    if (a_nan || b_nan || (a_inf && b_mag == '0) || (b_inf && a_mag == '0)) begin
      a_result_nan: assert (result == {1'b0, Nan});
    end else if (a_inf || b_inf) begin
      a_result_inf: assert (result == {sign, Limit});
    end else begin
      a_result_sign: assert (result[Width-1] == sign);
      a_result_value: assert (ok);
    end
    c_subnormal: cover (result[Width-2:0] < (mag_t'(1) << ManBits) && result[0] && !a_nan);
    c_tie: cover (i_rounding.twice == i_rounding.high && !a_nan && !b_nan && a_mag[0] && b_mag[0]);
    c_small: cover (a_mag == mag_t'(1) && result[Width-2:0] > (mag_t'(1) << ManBits)
                    && !b_nan && !b_inf);
    c_over: cover (result[Width-2:0] == Limit && a_mag < Limit && b_mag < Limit);
  end

endmodule
