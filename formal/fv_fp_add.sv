// flk_fp_add_pipe without registers, which is flk_fp_add, against plain integers: the exact sum in units of the smallest subnormal number,
// rounded to nearest even (fv_rounding); signs of zero, infinities and NaN by their rules.
module fv_fp_add #(
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,
  parameter  bit          Saturate = 1'b0,
  // A part of all operands, where the whole is too much for the solver: exponents that differ by Least to Most; only equal (0) or different
  // (1) signs, or both (2).
  parameter  int unsigned Least    = 0,
  parameter  int unsigned Most     = (1 << ExpBits) - 1,
  parameter  int unsigned Signs    = 2,
  // 0: the adder for operands of equal sign.
  parameter  bit          Cancel   = 1'b1,
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

  flk_fp_add_pipe #(
    .ExpBits (ExpBits),
    .ManBits (ManBits),
    .Fn      (Fn),
    .Saturate(Saturate),
    .Cancel  (Cancel),
    .Stages  (0)
  ) dut (
    .clk_i(1'b0),
    .en_i (1'b0),
    .a_i,
    .b_i,
    .sum_o(result)
  );

  mag_t a_mag, b_mag;
  logic a_nan, b_nan, a_inf, b_inf, ok;
  logic [ValueBits-1:0] a_value, b_value;
  logic [ValueBits:0] exact;
  logic a_sign, b_sign, sign;

  assign a_mag = a_i[Width-2:0];
  assign b_mag = b_i[Width-2:0];
  assign a_nan = a_mag > Top;
  assign b_nan = b_mag > Top;
  assign a_inf = !Fn && a_mag == Inf;
  assign b_inf = !Fn && b_mag == Inf;

  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_a (.mag_i(a_mag), .value_o(a_value));
  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_b (.mag_i(b_mag), .value_o(b_value));

  assign {a_sign, b_sign} = {a_i[Width-1], b_i[Width-1]};

  always_comb begin
    if (a_sign == b_sign) begin
      exact = {1'b0, a_value} + {1'b0, b_value};
      sign  = a_sign;
    end else if (a_value == b_value) begin
      exact = '0;
      sign  = 1'b0;
    end else if (a_value > b_value) begin
      exact = {1'b0, a_value - b_value};
      sign  = a_sign;
    end else begin
      exact = {1'b0, b_value - a_value};
      sign  = b_sign;
    end
  end

  fv_rounding #(
    .ExpBits  (ExpBits),
    .ManBits  (ManBits),
    .Fn       (Fn),
    .Saturate (Saturate),
    .ExactBits(ValueBits + 1),
    .Scale    (0)
  ) i_rounding (
    .exact_i(exact),
    .mag_i  (result[Width-2:0]),
    .ok_o   (ok)
  );

  // A subnormal number has the exponent of the smallest normal one.
  function automatic logic [ExpBits-1:0] exponent(mag_t mag);
    return mag[Width-2:ManBits] == '0 ? ExpBits'(1) : mag[Width-2:ManBits];
  endfunction

  logic [ExpBits-1:0] apart;

  assign apart = exponent(a_mag) > exponent(b_mag) ? exponent(a_mag) - exponent(b_mag)
                                                   : exponent(b_mag) - exponent(a_mag);

  always_comb begin
    assume (apart >= ExpBits'(Least) && apart <= ExpBits'(Most));
    assume (Signs == 2 || (a_sign ^ b_sign) == (Signs == 1));
    assume (Cancel || a_sign == b_sign);
    if (a_nan || b_nan || (a_inf && b_inf && a_sign != b_sign)) begin
      a_result_nan: assert (result == {1'b0, Nan});
    end else if (a_inf || b_inf) begin
      a_result_inf: assert (result == {sign, Limit});
    end else begin
      a_result_sign: assert (result[Width-1] == sign);
      a_result_value: assert (ok);
    end
    c_subnormal: cover (result[Width-2:0] < (mag_t'(1) << ManBits) && result[0] && !a_nan);
    c_tie: cover (i_rounding.twice == i_rounding.high && !a_nan && !b_nan && exact[ValueBits-2]);
    c_cancel: cover (!Cancel || exact == 1 && a_mag > (mag_t'(1) << ManBits));
    c_over: cover (result[Width-2:0] == Limit && a_mag < Limit && b_mag < Limit);
  end

endmodule
