// Reciprocal of ff numbers, pipelined (docs/reference/ff.md).
//
// 1 / 0 is the largest number; a result below 2^-126 is 0.
// Exponent and sign beside flk_ff_poly; pack.
//
// Stages registers (= latency): 0 none, 1 at the output, more also inside of flk_ff_poly, 4 at most. Registers load while en_i is high and are not
// reset.
module flk_ff_recip
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
  localparam int unsigned ArgBits = 32'(ARG_BITS[RECIP][Group]);

  logic sign;
  logic [7:0] exp;
  logic [ManBits-1:0] man;
  logic [ManBits+1:0] value;

  assign {sign, exp, man} = x_i;

  flk_ff_poly #(
    .Function(RECIP),
    .ManBits (ManBits),
    .Stages  (Stages)
  ) i_poly (
    .clk_i,
    .en_i,
    .odd_i  (1'b0),
    .arg_i  (ArgBits'(man) << (ArgBits - ManBits)),
    .value_o(value)
  );

  logic sign_q, zero_q;
  logic [7:0] exp_q;

  flk_delay #(
    .Width(10),
    .Depth((Stages >= 2) ? Stages - 1 : 0)
  ) i_side (
    .clk_i,
    .en_i,
    .d_i({sign, exp == '0, exp}),
    .q_o({sign_q, zero_q, exp_q})
  );

  // value is in [1/2, 1] of 2^(127 - exp); 1 only of a power of two.
  logic one;
  logic [7:0] exp_one, exp_less;
  logic [Width-1:0] result;

  assign one = value[ManBits+1];
  assign exp_one = 8'd254 - exp_q;
  assign exp_less = 8'd253 - exp_q;

  always_comb begin
    if (zero_q) begin
      result = {1'b0, 8'd254, {ManBits{1'b1}}};
    end else if (exp_q == 8'd254 || (exp_q == 8'd253 && !one)) begin
      result = '0;
    end else begin
      result = {sign_q, one ? exp_one : exp_less, value[ManBits-1:0]};
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
