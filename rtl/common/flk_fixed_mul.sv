// Multiplier of fixed-point numbers in two's complement: y_o = (a_i b_i + 2^(Drop - 1)) >> Drop, to the nearest, ties upwards.
//
// OutBits must hold every product. Stages registers (= latency): 0 none, 1 at the output. They load while en_i is high and are not reset.
module flk_fixed_mul #(
  parameter int unsigned ABits   = 13,
  parameter int unsigned BBits   = 13,
  parameter int unsigned Drop    = 12,  // fraction bits that are rounded off
  parameter int unsigned OutBits = 14,
  parameter int unsigned Stages  = 1
) (
  input  logic                      clk_i,
  input  logic                      en_i,
  input  logic signed [  ABits-1:0] a_i,
  input  logic signed [  BBits-1:0] b_i,
  output logic signed [OutBits-1:0] y_o
);

  if (Drop < 1 || OutBits + Drop > ABits + BBits) begin : gen_check_size
    $error("flk_fixed_mul: Drop must be 1 or more, OutBits at most what the product has above");
  end
  if (Stages > 1) begin : gen_check_stages
    $error("flk_fixed_mul: Stages must be 0 or 1");
  end

  localparam int unsigned ProdBits = ABits + BBits;
  localparam int unsigned AHigh = ABits - 1;  // place of the sign
  localparam int unsigned BHigh = BBits - 1;

  // a_i b_i of the bits below the signs; what the signs take off is added as inverted bits and a constant.
  localparam logic [ProdBits-1:0] CONSTANT =
      ProdBits'((1 << (ProdBits - 1)) + (1 << AHigh) + (1 << BHigh) + (1 << (Drop - 1)));

  logic [AHigh-1:0] a_low, a_off;
  logic [BHigh-1:0] b_low, b_off;
  logic [ProdBits-1:0] product;
  logic unused_product;

  assign a_low = a_i[AHigh-1:0];
  assign b_low = b_i[BHigh-1:0];
  assign a_off = ~(a_low & {AHigh{b_i[BHigh]}});
  assign b_off = ~(b_low & {BHigh{a_i[AHigh]}});
  assign product = ProdBits'(a_low) * ProdBits'(b_low)
                 + (ProdBits'(a_off) << BHigh) + (ProdBits'(b_off) << AHigh)
                 + (ProdBits'(a_i[AHigh] && b_i[BHigh]) << (AHigh + BHigh)) + CONSTANT;
  assign unused_product = ^product;

  flk_delay #(
    .Width(OutBits),
    .Depth(Stages)
  ) i_y (
    .clk_i,
    .en_i,
    .d_i(product[Drop+:OutBits]),
    .q_o(y_o)
  );

endmodule
