// Threshold of the contribution test, pipelined: log2(255 o) or ln(255 o) of an FP16 opacity, rounded toward +infinity to any
// format (docs/reference/arithmetic.md).
//
// Fixed point, one table with linear interpolation, all of it upper bounds: the result is never below the exact value.
// A subnormal opacity (0 included) counts as 2^-14, 2 and more as [1, 2); the sign is ignored.
// Interpolate in the table | add the exponent's share | normalise, round.
//
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the second bar above, 3 at both. Registers load while en_i is high and are not reset.
module flk_log_opacity_pipe #(
  parameter  bit          Base2    = 1'b1,  // log2, else ln
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,  // no infinity, NaN is all ones
  parameter  bit          Saturate = 1'b0,  // of no effect: the result is always finite
  parameter  int unsigned Stages   = 3,
  localparam int unsigned Width    = 1 + ExpBits + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [     15:0] opacity_i,
  output logic [Width-1:0] log_o
);

  import flk_table_pkg::*;

  if (ExpBits < 4 || ExpBits > 5) begin : gen_check_exp
    $error("flk_log_opacity_pipe: ExpBits must be 4 or 5, so that the result is finite");
  end
  if (ManBits < 1 || ManBits > 10) begin : gen_check_man
    $error("flk_log_opacity_pipe: ManBits must be 1 to 10");
  end
  if (Fn && !Saturate) begin : gen_check_saturate
    $error("flk_log_opacity_pipe: Fn has no infinity, so Saturate must be set");
  end

  if (Stages > 3) begin : gen_check_stages
    $error("flk_log_opacity_pipe: Stages must be 0 to 3");
  end

  localparam int unsigned Bias = (1 << (ExpBits - 1)) - 1;
  // Magnitude below 16: 4 integer bits.
  localparam int unsigned MagBits = 4 + LOG_FRAC_BITS;
  // Biased exponent of the top bit of the magnitude, [8, 16).
  localparam int unsigned TopExp = Bias + 3;
  // Shift to normalise: limited by the exponent, which stays at least 1.
  localparam int unsigned MaxShift = (TopExp - 1 < MagBits - 1) ? TopExp - 1 : MagBits - 1;
  localparam int unsigned ShiftBits = $clog2(MaxShift + 1);
  localparam int unsigned LineBits = LOG_VALUE_BITS - LOG_SLOPE_FRAC_BITS;
  // The magnitude below the result's last place.
  localparam int unsigned DropBits = MagBits - 1 - ManBits;

  // Unpack

  logic       normal;
  logic [3:0] exponent;
  logic [9:0] mantissa;
  logic       unused_sign;

  assign unused_sign = opacity_i[15];
  assign normal      = |opacity_i[14:10];
  assign exponent    = {opacity_i[13:11], opacity_i[10] || !normal} | {4{opacity_i[14]}};
  assign mantissa    = opacity_i[9:0] & {10{normal}};

  // Table: log(255 m), plus the exponent's share

  logic [LOG_INDEX_BITS-1:0] index;
  logic [LOG_DELTA_BITS-1:0] delta;
  logic [LOG_VALUE_BITS-1:0] line;
  logic [3:0]                exponent_q;
  logic [LineBits-1:0]       line_q;
  logic signed [MagBits:0]   log;
  logic                      sign, sign_q;
  logic [MagBits-1:0]        magnitude, magnitude_q;
  logic                      unused_line;

  assign {index, delta} = mantissa;
  assign line           = LOG_VALUE[Base2][index]
                        + LOG_VALUE_BITS'(LOG_SLOPE[Base2][index])
                        * LOG_VALUE_BITS'(delta);
  assign unused_line    = ^line[LOG_SLOPE_FRAC_BITS-1:0];

  flk_delay #(
    .Width(4 + LineBits),
    .Depth(32'(Stages >= 3))
  ) i_line (
    .clk_i,
    .en_i,
    .d_i({exponent, line[LOG_VALUE_BITS-1:LOG_SLOPE_FRAC_BITS]}),
    .q_o({exponent_q, line_q})
  );

  assign log       = (MagBits + 1)'(exponent_q) * (MagBits + 1)'(LOG_STEP[Base2])
                   - (MagBits + 1)'(LOG_OFFSET[Base2])
                   + (MagBits + 1)'(line_q);
  assign sign      = log[MagBits];
  assign magnitude = sign ? MagBits'(-log) : MagBits'(log);

  flk_delay #(
    .Width(1 + MagBits),
    .Depth(32'(Stages >= 2))
  ) i_magnitude (
    .clk_i,
    .en_i,
    .d_i({sign, magnitude}),
    .q_o({sign_q, magnitude_q})
  );

  // Normalise

  logic [MagBits-1:0] norm;
  logic [ShiftBits-1:0] shift;
  logic [ExpBits-1:0] result_exp;

  flk_lzc #(
    .Width(MaxShift)
  ) i_shift (
    .value_i(magnitude_q[MagBits-1-:MaxShift]),
    .count_o(shift)
  );
  assign norm       = magnitude_q << shift;
  assign result_exp = norm[MagBits-1] ? ExpBits'(TopExp) - ExpBits'(shift) : '0;

  // Round: up is away from 0 for a positive number only

  logic round_up;

  assign round_up = !sign_q && (norm[DropBits-1:0] != '0);

  // Pack

  logic [Width-1:0] result;

  assign result = {sign_q, {result_exp, norm[MagBits-2:DropBits]} + (ExpBits + ManBits)'(round_up)};

  flk_delay #(
    .Width(Width),
    .Depth(32'(Stages >= 1))
  ) i_result (
    .clk_i,
    .en_i,
    .d_i(result),
    .q_o(log_o)
  );

endmodule
