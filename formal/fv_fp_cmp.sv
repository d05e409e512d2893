// flk_fp_cmp against plain integers: the order of the two values; false with a NaN.
module fv_fp_cmp #(
  parameter  int unsigned ExpBits = 5,
  parameter  int unsigned ManBits = 10,
  parameter  bit          Fn      = 1'b0,
  localparam int unsigned Width   = 1 + ExpBits + ManBits
) (
  input logic [Width-1:0] a_i,
  input logic [Width-1:0] b_i
);

  typedef logic [Width-2:0] mag_t;

  localparam mag_t Top = Fn ? mag_t'(-2) : {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam int unsigned ValueBits = ManBits + 1 + (1 << ExpBits) - 2;

  logic lt;

  flk_fp_cmp #(
    .ExpBits(ExpBits),
    .ManBits(ManBits),
    .Fn     (Fn)
  ) dut (
    .a_i,
    .b_i,
    .lt_o(lt)
  );

  logic [ValueBits-1:0] a_value, b_value;
  logic signed [ValueBits:0] a_signed, b_signed;
  logic nan;

  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_a (
    .mag_i(a_i[Width-2:0]), .value_o(a_value)
  );
  fv_value #(.ExpBits(ExpBits), .ManBits(ManBits)) i_b (
    .mag_i(b_i[Width-2:0]), .value_o(b_value)
  );

  assign a_signed = a_i[Width-1] ? -$signed({1'b0, a_value}) : $signed({1'b0, a_value});
  assign b_signed = b_i[Width-1] ? -$signed({1'b0, b_value}) : $signed({1'b0, b_value});
  assign nan      = a_i[Width-2:0] > Top || b_i[Width-2:0] > Top;

  always_comb begin
    a_less: assert (lt == (!nan && a_signed < b_signed));
    c_less: cover (lt && a_i[Width-1] && b_i[Width-1]);
    c_more: cover (!lt && !nan && a_i[Width-1] && b_i[Width-1] && a_i != b_i);
    c_zeros: cover (!lt && a_i[Width-2:0] == '0 && b_i == '0 && a_i != b_i);
    c_nan: cover (nan && a_signed < b_signed);
  end

endmodule
