// Threshold of the contribution test: log2(255 o) or ln(255 o) of an FP16 opacity, rounded toward
// +infinity to any format (docs/arithmetic.md).
//
// Combinational. Fixed point, one table with linear interpolation, all of it upper bounds: the
// result is never below the exact value.
// A subnormal opacity (0 included) counts as 2^-14, 2 and more as [1, 2); the sign is ignored.
module flk_log_opacity #(
  parameter  bit          Base2    = 1'b1,  // log2, else ln
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,  // no infinity, NaN is all ones
  parameter  bit          Saturate = 1'b0,  // of no effect: the result is always finite
  localparam int unsigned Width    = 1 + ExpBits + ManBits
) (
  input  logic [     15:0] opacity_i,
  output logic [Width-1:0] log_o
);

  import flk_table_pkg::*;

  if (ExpBits < 4 || ExpBits > 5) begin : gen_check_exp
    $error("flk_log_opacity: ExpBits must be 4 or 5, so that the result is finite");
  end
  if (ManBits < 1 || ManBits > 10) begin : gen_check_man
    $error("flk_log_opacity: ManBits must be 1 to 10");
  end
  if (Fn && !Saturate) begin : gen_check_saturate
    $error("flk_log_opacity: Fn has no infinity, so Saturate must be set");
  end

  localparam int unsigned Bias = (1 << (ExpBits - 1)) - 1;
  // Magnitude below 16: 4 integer bits.
  localparam int unsigned MagBits = 4 + LOG_FRAC_BITS;
  // Biased exponent of the top bit of the magnitude, [8, 16).
  localparam int unsigned TopExp = Bias + 3;
  // Shift to normalise: limited by the exponent, which stays at least 1.
  localparam int unsigned LzBits = $clog2(MagBits);
  localparam int unsigned MaxShift = (TopExp - 1 < MagBits - 1) ? TopExp - 1 : MagBits - 1;
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
  logic signed [MagBits:0]   log;
  logic                      unused_line;

  assign {index, delta} = mantissa;
  assign line           = LOG_VALUE[Base2][index]
                        + LOG_VALUE_BITS'(LOG_SLOPE[Base2][index])
                        * LOG_VALUE_BITS'(delta);
  assign log            = (MagBits + 1)'(exponent) * (MagBits + 1)'(LOG_STEP[Base2])
                        - (MagBits + 1)'(LOG_OFFSET[Base2])
                        + (MagBits + 1)'(line[LOG_VALUE_BITS-1:LOG_SLOPE_FRAC_BITS]);
  assign unused_line    = ^line[LOG_SLOPE_FRAC_BITS-1:0];

  // Normalise

  // Halves the vector, filled up to a power of two; the count of an empty one does not matter.
  function automatic logic [LzBits-1:0] leading_zeros(input logic [MagBits-1:0] value);
    logic [(1<<LzBits)-1:0] rest;
    rest          = (1 << LzBits)'(value) << ((1 << LzBits) - MagBits);
    leading_zeros = '0;
    for (int k = int'(LzBits) - 1; k >= 0; k--) begin
      if ((rest >> ((1 << LzBits) - (1 << k))) == '0) begin
        leading_zeros[k] = 1'b1;
        rest             = rest << (1 << k);
      end
    end
  endfunction

  logic               sign;
  logic [MagBits-1:0] magnitude, norm;
  logic [ LzBits-1:0] zeros, shift;
  logic [ExpBits-1:0] result_exp;

  assign sign      = log[MagBits];
  assign magnitude = sign ? MagBits'(-log) : MagBits'(log);

  assign zeros      = leading_zeros(magnitude);
  if (MaxShift < MagBits - 1) begin : gen_limit
    assign shift = (zeros > LzBits'(MaxShift)) ? LzBits'(MaxShift) : zeros;
  end else begin : gen_no_limit
    assign shift = zeros;
  end
  assign norm       = magnitude << shift;
  assign result_exp = norm[MagBits-1] ? ExpBits'(TopExp) - ExpBits'(shift) : '0;

  // Round: up is away from 0 for a positive number only

  logic round_up;

  assign round_up = !sign && (norm[DropBits-1:0] != '0);

  // Pack

  assign log_o = {sign, {result_exp, norm[MagBits-2:DropBits]} + (ExpBits + ManBits)'(round_up)};

endmodule
