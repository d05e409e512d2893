// Piecewise quadratic function of a mantissa: the common part of flk_ff_recip, flk_ff_rsqrt, flk_ff_sqrt and flk_ff_exp2 (docs/reference/ff.md).
//
// Look up slope and curvature, square the distance from the segment's middle | multiply; look up the middle's value | add, round. With 4
// stages the multiplication takes two: look up, square | multiply by halves | add them; look up the middle's value | add, round.
// Tables are those of the smallest group of mantissas that has ManBits. value_o is between 2^ManBits and 2^(ManBits + 1), both included.
//
// Registers (= latency) are Stages - 1: with 2 at the second bar above, with 3 at both, with 4 at three; none with 0. Registers load while
// en_i is high and are not reset.
module flk_ff_poly
  import flk_ff_table_pkg::*;
#(
  parameter  int unsigned Function  = RECIP,
  parameter  int unsigned ManBits   = 19,
  parameter  int unsigned Stages    = 3,
  localparam int unsigned Group     = (ManBits <= 11) ? 0 : (ManBits - 8) / 4,
  localparam int unsigned ArgBits   = 32'(ARG_BITS[Function][Group])
) (
  input  logic               clk_i,
  input  logic               en_i,
  input  logic               odd_i,  // of the exponent; 0 where the function has but one table
  input  logic [ArgBits-1:0] arg_i,
  output logic [ManBits+1:0] value_o
);

  if (ManBits < 10 || ManBits > 23) begin : gen_check_size
    $error("flk_ff_poly: ManBits must be 10 to 23");
  end
  if (Stages > 4) begin : gen_check_stages
    $error("flk_ff_poly: Stages must be 0 to 4");
  end

  localparam int unsigned SegmentBits = 32'(INDEX_BITS[Function][Group]);
  localparam int unsigned IndexBits = SegmentBits + 32'(PARITY[Function]);
  localparam int unsigned DeltaBits = ArgBits - SegmentBits;
  localparam int unsigned SquareBits = 32'(SQUARE_BITS[Function][Group]);
  localparam int unsigned SquareDrop = 32'(SQUARE_DROP[Function][Group]);
  localparam int unsigned QBits = 2 * SquareBits - SquareDrop;
  localparam int unsigned C0Bits = 32'(C0_BITS[Function][Group]);
  localparam int unsigned C1Bits = 32'(C1_BITS[Function][Group]);
  localparam int unsigned C2Bits = 32'(C2_BITS[Function][Group]);
  localparam int unsigned Drop1 = 32'(C1_DROP[Function][Group]);
  localparam int unsigned Drop2 = 32'(C2_DROP[Function][Group]);
  localparam int unsigned P1Bits = C1Bits + DeltaBits + 1;  // signed
  // Fraction bits of value_o: results of the first two functions are up to 1, of the others up to 2.
  localparam bit Below1 = (Function == RECIP || Function == RSQRT);
  localparam int unsigned ResultBits = ManBits + 32'(Below1);
  localparam int unsigned RoundBits = 32'(FRAC_BITS[Function][Group]) - ResultBits;
  localparam int unsigned SumBits = ManBits + 2 + RoundBits;

  // ---- Look up and square --------------------------------------------------------------------------------

  logic [IndexBits-1:0] index, index_q, late;
  logic [DeltaBits-1:0] delta, delta_q;  // from the segment's middle, two's complement
  logic [DeltaBits-2:0] distance;
  logic [SquareBits-1:0] s;
  logic [2*SquareBits-1:0] square;
  logic [QBits-1:0] q_q;
  logic [C0Bits-1:0] c0;
  logic [C1Bits-1:0] c1, c1_q;
  logic [C2Bits-1:0] c2, c2_q;
  logic unused_low;

  if (PARITY[Function] != '0) begin : gen_parity
    assign index = {odd_i, arg_i[ArgBits-1-:SegmentBits]};
  end else begin : gen_single
    logic unused_odd;
    assign unused_odd = odd_i;
    assign index = arg_i[ArgBits-1-:SegmentBits];
  end
  assign delta = {~arg_i[DeltaBits-1], arg_i[DeltaBits-2:0]};
  assign distance = delta[DeltaBits-2:0] ^ {DeltaBits - 1{delta[DeltaBits-1]}};
  assign s = distance[DeltaBits-2-:SquareBits];
  // s (s + 1), the square of s + 1/2 but for a constant; of the products of two different bits one stands for both.
  always_comb begin
    square = (2 * SquareBits)'(s);
    for (int unsigned i = 0; i < SquareBits; i++) begin
      square = square + (s[i] ? (((2 * SquareBits)'(s >> (i + 1)) << (2 * i + 2))
                                 | (2 * SquareBits)'(1) << (2 * i)) : '0);
    end
  end
  assign unused_low = ^{1'b0, distance, square};

  flk_ff_rom #(
    .Function(Function),
    .Group   (Group)
  ) i_rom (
    .index_i(index),
    .late_i (late),
    .c0_o   (c0),
    .c1_o   (c1),
    .c2_o   (c2)
  );

  flk_delay #(
    .Width(IndexBits + DeltaBits + QBits + C1Bits + C2Bits),
    .Depth(32'(Stages >= 3))
  ) i_looked_up (
    .clk_i,
    .en_i,
    .d_i({index, delta, square[2*SquareBits-1:SquareDrop], c1, c2}),
    .q_o({index_q, delta_q, q_q, c1_q, c2_q})
  );

  // ---- Multiply ------------------------------------------------------------------------------------------

  // c0 - (p >> d) = c0 + 1 + (~p >> d) = ((c0 + 1) 2^d - 1 - p) >> d. The 1 of the first product and half a unit of the result go with c0.
  localparam bit Negative1 = C1_NEGATIVE[Function] != '0;
  localparam bit Negative2 = C2_NEGATIVE[Function] != '0;
  localparam int unsigned ROUNDING = 2 ** (RoundBits - 1) + 32'(Negative1);

  localparam int unsigned FieldBits = SumBits + Drop2;

  logic signed [P1Bits-1:0] product1;
  logic [FieldBits-1:0] value2;
  logic [SumBits-1:0] start, start_q;
  logic signed [P1Bits-Drop1-1:0] p1_q;
  logic unused_products;

  assign start = SumBits'(c0) + SumBits'(ROUNDING);

  if (Stages == 4) begin : gen_halves
    localparam int unsigned LowBits = DeltaBits / 2;
    localparam int unsigned HighBits = DeltaBits - LowBits;
    logic [C1Bits+LowBits-1:0] low, low_q;
    logic signed [C1Bits+HighBits:0] high, high_q;
    logic [C2Bits+QBits-1:0] product2;
    logic [C2Bits+QBits-Drop2-1:0] p2_q;
    logic unused_low2;

    assign low = (C1Bits + LowBits)'(c1_q) * (C1Bits + LowBits)'(delta_q[LowBits-1:0]);
    assign high = $signed({1'b0, c1_q}) * $signed(delta_q[DeltaBits-1:LowBits]);
    assign product2 = (C2Bits + QBits)'(c2_q) * (C2Bits + QBits)'(q_q);
    assign unused_low2 = ^product2[Drop2-1:0];

    flk_delay #(
      .Width(IndexBits + 2 * C1Bits + DeltaBits + 1 + C2Bits + QBits - Drop2),
      .Depth(1)
    ) i_halves (
      .clk_i,
      .en_i,
      .d_i({index_q, low, high, product2[C2Bits+QBits-1:Drop2]}),
      .q_o({late, low_q, high_q, p2_q})
    );

    assign product1 = $signed({high_q, LowBits'(0)}) + P1Bits'($signed({1'b0, low_q}));
    assign value2 = {start + (Negative2 ? -SumBits'(p2_q) : SumBits'(p2_q)), Drop2'(0)};
  end else begin : gen_whole
    logic [FieldBits-1:0] product2;

    assign late = index_q;
    assign product1 = $signed({1'b0, c1_q}) * $signed(delta_q);
    assign product2 = FieldBits'(c2_q) * FieldBits'(q_q);
    assign value2 = {start, {Drop2{Negative2}}} + (Negative2 ? -product2 : product2);
  end
  assign unused_products = ^{product1[Drop1-1:0], value2[Drop2-1:0]};

  flk_delay #(
    .Width(SumBits + P1Bits - Drop1),
    .Depth(32'(Stages >= 2))
  ) i_products (
    .clk_i,
    .en_i,
    .d_i({value2[FieldBits-1:Drop2], product1[P1Bits-1:Drop1] ^ {P1Bits - Drop1{Negative1}}}),
    .q_o({start_q, p1_q})
  );

  // ---- Add and round -------------------------------------------------------------------------------------

  logic [SumBits-1:0] sum;
  logic unused_sum;

  assign sum = start_q + SumBits'(p1_q);
  assign value_o = sum[SumBits-1:RoundBits];
  assign unused_sum = ^sum[RoundBits-1:0];

endmodule
