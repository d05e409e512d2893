// flk_ff_add without registers against plain integers: the exact sum in units of the smallest subnormal number that the format would have,
// rounded to nearest even (fv_rounding); below the smallest number zero, and there is no other zero than +0.
module fv_ff_add #(
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

  logic [Width-1:0] result;

  flk_ff_add #(
    .ExpBits(ExpBits),
    .ManBits(ManBits),
    .Stages (0)
  ) dut (
    .clk_i(1'b0),
    .en_i (1'b0),
    .a_i,
    .b_i,
    .sum_o(result)
  );

  mag_t a_mag, b_mag;
  logic [ValueBits-1:0] a_value, b_value;
  logic [ValueBits:0] exact;
  logic sign, ok;

  assign a_mag = a_i[Width-2:0];
  assign b_mag = b_i[Width-2:0];

  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_a (.mag_i(a_mag), .value_o(a_value));
  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_b (.mag_i(b_mag), .value_o(b_value));

  always_comb begin
    sign = a_i[Width-1];
    if (a_i[Width-1] == b_i[Width-1]) begin
      exact = {1'b0, a_value} + {1'b0, b_value};
    end else if (a_value >= b_value) begin
      exact = {1'b0, a_value - b_value};
    end else begin
      exact = {1'b0, b_value - a_value};
      sign  = b_i[Width-1];
    end
  end

  fv_rounding #(
    .ExpBits  (ExpBits),
    .ManBits  (ManBits),
    .Saturate (1'b1),
    .ExactBits(ValueBits + 1)
  ) i_rounding (
    .exact_i(exact),
    .mag_i  (result[Width-2:0]),
    .ok_o   (ok)
  );

  always_comb begin
    // The sign of a zero may be inverted by the user.
    assume (a_mag == '0 || (a_mag >= Least && a_mag <= Most));
    assume (b_mag == '0 || (b_mag >= Least && b_mag <= Most));
    if (exact < (ValueBits + 1)'(Least)) begin
      a_result_zero: assert (result == '0);
    end else begin
      a_result_sign: assert (result[Width-1] == sign);
      a_result_value: assert (ok && result[Width-2:0] >= Least);
    end
    c_zero: cover (result == '0 && a_mag != '0 && a_mag != b_mag);
    c_tie: cover (i_rounding.twice == i_rounding.high && exact[ValueBits-2]);
    c_cancel: cover (exact == (ValueBits + 1)'(Least) && a_mag > 2 * Least && b_mag > 2 * Least);
    c_over: cover (result[Width-2:0] == Most && a_mag < Most && b_mag < Most);
  end

endmodule
