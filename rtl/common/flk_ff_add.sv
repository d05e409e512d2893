// Adder of ff numbers, pipelined: round to nearest even, no subnormals, saturating (docs/reference/ff.md).
//
// A difference is a sum with the sign bit of b_i inverted by the user; an inverted zero (sign bit alone) is taken as zero.
// Single path: order by magnitude, align with guard, round and sticky bit | add or subtract, count leading zeros | normalise, round.
// A sum below the smallest number is exact, so what becomes zero is known before the rounding.
//
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the first bar above, 3 at both. Registers load while en_i is high and are
// not reset.
module flk_ff_add #(
  parameter  int unsigned ExpBits = 8,
  parameter  int unsigned ManBits = 19,
  parameter  int unsigned Stages  = 3,
  localparam int unsigned Width   = 1 + ExpBits + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic [Width-1:0] sum_o
);

  if (ExpBits < 2 || ManBits < 1) begin : gen_check_size
    $error("flk_ff_add: ExpBits must be at least 2, ManBits at least 1");
  end
  if (Stages > 3) begin : gen_check_stages
    $error("flk_ff_add: Stages must be 0 to 3");
  end

  localparam int unsigned SigBits = ManBits + 1;  // with the leading bit
  localparam int unsigned AddBits = SigBits + 3;  // guard, round, sticky below
  localparam int unsigned SumBits = AddBits + 1;  // one carry bit
  localparam int unsigned ShiftBits = $clog2(AddBits + 1);  // 0 to AddBits

  // ---- Order by magnitude and align ----------------------------------------------------------------

  typedef struct packed {
    logic               sign;
    logic               sub;
    logic [ExpBits-1:0] exp;    // of the larger operand
    logic [AddBits-1:0] big;
    logic [AddBits-1:0] addend;  // the smaller operand, inverted for a subtraction
  } aligned_t;

  aligned_t aligned_q;
  logic swap, sub, big_sign, small_sign;
  logic [ExpBits-1:0] big_exp, small_exp, diff;
  logic [ManBits-1:0] big_man, small_man;
  logic [ShiftBits-1:0] align;
  logic [AddBits-1:0] shifted, lost;

  assign swap = b_i[Width-2:0] > a_i[Width-2:0];
  assign {big_sign, big_exp, big_man} = swap ? b_i : a_i;
  assign {small_sign, small_exp, small_man} = swap ? a_i : b_i;
  assign sub = big_sign ^ small_sign;
  assign diff = big_exp - small_exp;
  assign align = (32'(diff) > AddBits) ? ShiftBits'(AddBits) : ShiftBits'(diff);
  assign {shifted, lost} = {small_exp != '0, small_man, 3'b0, AddBits'(0)} >> align;

  flk_delay #(
    .Width($bits(aligned_t)),
    .Depth(32'(Stages >= 2))
  ) i_aligned (
    .clk_i,
    .en_i,
    .d_i({
      big_sign, sub, big_exp, {big_exp != '0, big_man, 3'b0},
      (shifted | AddBits'(|lost)) ^ {AddBits{sub}}
    }),
    .q_o(aligned_q)
  );

  // ---- Add and count leading zeros -------------------------------------------------------------------

  typedef struct packed {
    logic                 sign;
    logic [ExpBits-1:0]   exp;
    logic [ShiftBits-1:0] zeros;
    logic [SumBits-1:0]   sum;
  } added_t;

  added_t added_q;
  logic [SumBits-1:0] sum;
  logic [ShiftBits-1:0] zeros;
  logic unused_carry;

  assign {sum, unused_carry} = {1'b0, aligned_q.big, 1'b1}
                             + {aligned_q.sub, aligned_q.addend, aligned_q.sub};

  // The lowest bit does not matter: where none above it is set the sum is zero.
  flk_lzc #(
    .Width(AddBits)
  ) i_zeros (
    .value_i(sum[SumBits-1:1]),
    .count_o(zeros)
  );

  flk_delay #(
    .Width($bits(added_t)),
    .Depth(32'(Stages >= 3))
  ) i_added (
    .clk_i,
    .en_i,
    .d_i({aligned_q.sign, aligned_q.exp, zeros, sum}),
    .q_o(added_q)
  );

  // ---- Normalise and round to nearest even -------------------------------------------------------------

  localparam int unsigned CodeBits = ExpBits + ManBits;
  localparam logic [CodeBits-1:0] TOP = {{ExpBits - 1{1'b1}}, 1'b0, {ManBits{1'b1}}};

  logic [SumBits-1:0] normal;
  logic [ExpBits-1:0] exp;  // of the leading bit
  logic [CodeBits-1:0] truncated, rounded;
  logic too_small, too_large, round_up;
  logic [Width-1:0] packed_sum;

  assign normal = added_q.sum << added_q.zeros;
  // The carry bit counts as one place above the larger operand's leading bit.
  assign exp = added_q.exp + ExpBits'(1) - ExpBits'(added_q.zeros);
  assign too_small = !normal[SumBits-1] || (32'(added_q.exp) < 32'(added_q.zeros));
  assign truncated = {exp, normal[SumBits-2-:ManBits]};
  assign round_up = normal[3] && (normal[4] || (|normal[2:0]));
  // A carry out of the mantissa raises the exponent; it must not from the largest number.
  assign too_large = (&exp) || (round_up && truncated == TOP);
  assign rounded = truncated + CodeBits'(round_up);

  always_comb begin
    if (too_small) begin
      packed_sum = '0;
    end else if (too_large) begin
      packed_sum = {added_q.sign, TOP};
    end else begin
      packed_sum = {added_q.sign, rounded};
    end
  end

  flk_delay #(
    .Width(Width),
    .Depth(32'(Stages >= 1))
  ) i_sum (
    .clk_i,
    .en_i,
    .d_i(packed_sum),
    .q_o(sum_o)
  );

endmodule
