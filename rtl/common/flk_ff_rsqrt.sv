// Reciprocal square root of ff numbers, pipelined (docs/reference/ff.md).
//
// Of 0 the largest number, of a negative number 0.
// Exponent and sign beside flk_ff_poly; pack.
//
// Stages registers (= latency): 0 none, 1 at the output, more also inside of flk_ff_poly, 4 at most. Registers load while en_i is high and are not
// reset.
module flk_ff_rsqrt
  import flk_ff_table_pkg::*;
#(
  parameter  int unsigned ManBits = 19,
  parameter  int unsigned Stages  = 3,
  localparam int unsigned Width   = 9 + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [Width-1:0] x_i,
  output logic [Width-1:0] y_o
);

  localparam int unsigned Group = (ManBits <= 11) ? 0 : (ManBits - 8) / 4;
  localparam int unsigned ArgBits = 32'(ARG_BITS[RSQRT][Group]);

  logic sign;
  logic [7:0] exp;
  logic [ManBits-1:0] man;
  logic [ManBits+1:0] value;

  assign {sign, exp, man} = x_i;

  flk_ff_poly #(
    .Function(RSQRT),
    .ManBits (ManBits),
    .Stages  (Stages)
  ) i_poly (
    .clk_i,
    .en_i,
    .odd_i  (!exp[0]),
    .arg_i  (ArgBits'(man) << (ArgBits - ManBits)),
    .value_o(value)
  );

  // Of a value below 1, biased: 126 - floor((exp - 127) / 2) = 190 - floor((exp + 1) / 2).
  logic sign_q, zero_q;
  logic [7:0] half_q;

  flk_delay #(
    .Width(10),
    .Depth((Stages >= 2) ? Stages - 1 : 0)
  ) i_side (
    .clk_i,
    .en_i,
    .d_i({sign, exp == '0, 8'd190 - 8'((9'(exp) + 9'd1) >> 1)}),
    .q_o({sign_q, zero_q, half_q})
  );

  // value is in [1/2, 1]; 1 only of a power of four.
  logic [7:0] half_more, result_exp;
  logic [Width-1:0] result;

  assign half_more = half_q + 8'd1;
  assign result_exp = value[ManBits+1] ? half_more : half_q;

  always_comb begin
    if (zero_q) begin
      result = {1'b0, 8'd254, {ManBits{1'b1}}};
    end else if (sign_q) begin
      result = '0;
    end else begin
      result = {1'b0, result_exp, value[ManBits-1:0]};
    end
  end

  logic unused_value;
  assign unused_value = value[ManBits];  // the leading bit

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
