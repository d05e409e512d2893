// Ff number to FP16: round to nearest even, subnormal numbers included, at most +-65504 (docs/reference/ff.md).
// Combinational. What is too small becomes a zero of its sign.
module flk_ff_to_fp16 #(
  parameter  int unsigned ManBits = 19,
  localparam int unsigned Width   = 9 + ManBits
) (
  input  logic [Width-1:0] x_i,
  output logic [     15:0] y_o
);

  if (ManBits <= 10) begin : gen_check
    $error("flk_ff_to_fp16: ManBits must be more than 10");
  end

  localparam logic [7:0] SUBNORMAL = 8'd112;  // largest exponent of subnormal FP16 numbers
  localparam logic [7:0] LEAST = 8'd102;      // of numbers of which half a step and more is left
  localparam logic [7:0] LARGEST = 8'd142;    // code 30
  localparam int unsigned MAX_DROP = 11;      // SUBNORMAL + 1 - LEAST
  // Mantissa with its leading one, and places for what a subnormal number is shifted by.
  localparam int unsigned FullBits = 1 + ManBits + MAX_DROP;
  localparam int unsigned RestBits = FullBits - 11;

  logic sign, normal, round_up, beyond;
  logic [7:0] exp;
  logic [ManBits-1:0] man;
  logic [3:0] drop;
  logic [FullBits-1:0] full;
  logic [4:0] code;
  logic [14:0] rounded;

  assign {sign, exp, man} = x_i;
  assign normal = exp > SUBNORMAL;

  // SUBNORMAL + 1 - exp in its low bits, and exp - SUBNORMAL.
  assign drop = normal ? '0 : 4'd1 - exp[3:0];
  assign code = normal ? {!exp[4], exp[3:0]} : '0;

  assign full     = {exp >= LEAST, man & {ManBits{exp >= LEAST}}, {MAX_DROP{1'b0}}} >> drop;
  assign round_up = full[RestBits-1] && (full[RestBits] || full[RestBits-2:0] != '0);
  assign rounded  = {code, full[RestBits+:10]} + 15'(round_up);
  // From 65504 on.
  assign beyond   = exp > LARGEST || (exp == LARGEST && &man[ManBits-1-:10]);
  assign y_o      = {sign, beyond ? 15'h7bff : rounded};

endmodule
