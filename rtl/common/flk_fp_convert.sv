// Conversion between floating-point formats, round to nearest even (docs/reference/arithmetic.md).
//
// Combinational. Any format to any format; only the shifts that the pair needs are built.
module flk_fp_convert #(
  parameter  int unsigned SrcExpBits  = 5,
  parameter  int unsigned SrcManBits  = 10,
  parameter  bit          SrcFn       = 1'b0,  // no infinity, NaN is all ones
  parameter  int unsigned DstExpBits  = 4,
  parameter  int unsigned DstManBits  = 3,
  parameter  bit          DstFn       = 1'b1,
  parameter  bit          DstSaturate = 1'b1,  // infinity becomes the largest finite number
  localparam int unsigned SrcWidth    = 1 + SrcExpBits + SrcManBits,
  localparam int unsigned DstWidth    = 1 + DstExpBits + DstManBits
) (
  input  logic [SrcWidth-1:0] src_i,
  output logic [DstWidth-1:0] dst_o
);

  if (SrcExpBits < 2 || SrcManBits < 1 || DstExpBits < 2 || DstManBits < 1) begin : gen_check_size
    $error("flk_fp_convert: ExpBits must be at least 2, ManBits at least 1");
  end
  if (DstFn && !DstSaturate) begin : gen_check_saturate
    $error("flk_fp_convert: DstFn has no infinity, so DstSaturate must be set");
  end

  typedef logic [DstWidth-2:0] mag_t;

  localparam mag_t Inf = {{DstExpBits{1'b1}}, {DstManBits{1'b0}}};
  localparam mag_t Nan = DstFn ? '1 : Inf | (mag_t'(1) << (DstManBits - 1));
  localparam mag_t Finite = DstFn ? Nan - 1'b1 : Inf - 1'b1;
  localparam mag_t Limit = DstSaturate ? Finite : Inf;
  // What the biased exponent gains.
  localparam int Rebias = (1 << (DstExpBits - 1)) - (1 << (SrcExpBits - 1));
  // Signed exponent: the wider of the two and a sign, and one bit for the rebias.
  localparam int unsigned SignedBits = ((SrcExpBits > DstExpBits) ? SrcExpBits : DstExpBits) + 2;
  // Hidden bit, mantissa at least as wide as both formats', guard and sticky bit.
  localparam int unsigned ManBits = (SrcManBits > DstManBits) ? SrcManBits : DstManBits;
  localparam int unsigned SigBits = 1 + ManBits + 2;

  typedef logic signed [SignedBits-1:0] signed_t;
  typedef logic [SigBits-1:0] sig_t;

  // Unpack

  logic                  sign, normal;
  logic [SrcExpBits-1:0] src_exp;
  logic [SrcManBits-1:0] src_man;
  sig_t                  src_sig;

  assign {sign, src_exp, src_man} = src_i;
  assign normal                   = (src_exp != '0);
  assign src_sig                  = {normal, src_man, {SigBits - 1 - SrcManBits{1'b0}}};

  // Special cases

  logic is_nan, is_inf;

  if (SrcFn) begin : gen_special_fn
    assign is_nan = &src_i[SrcWidth-2:0];
    assign is_inf = 1'b0;
  end else begin : gen_special
    assign is_inf = &src_exp;
    assign is_nan = is_inf && (src_man != '0);
  end

  // Exponent, less 1 so that the hidden bit completes it in the sum below

  signed_t base;

  assign base = signed_t'({2'b00, src_exp}) - signed_t'(normal) + signed_t'(Rebias);

  // Normalise

  sig_t    sig;
  signed_t exponent;

  if (Rebias > 0) begin : gen_wider_range
    // Subnormals of the source become normal as far as the exponent allows.
    localparam int unsigned LzBits = $clog2(SrcManBits + 1);
    logic [LzBits-1:0] zeros;
    signed_t           shift;
    // The lowest bit does not matter: where none above it is set, it is the leading one or the number is zero.
    flk_lzc #(
      .Width(SrcManBits)
    ) i_zeros (
      .value_i(SrcManBits'({normal, src_man} >> 1)),
      .count_o(zeros)
    );
    assign shift    = (int'(zeros) > Rebias) ? signed_t'(Rebias) : signed_t'(zeros);
    assign sig      = src_sig << shift;
    assign exponent = sig[SigBits-1] ? base - shift : '0;
  end else if (Rebias < 0) begin : gen_narrower_range
    // Numbers below the target's smallest normal are shifted right; the last bit is sticky.
    // A shift by SigBits - 1 leaves the sticky bit alone.
    localparam int unsigned ShiftBits = $clog2(SigBits);
    signed_t               amount;
    logic [ShiftBits-1:0]  shift;
    assign amount = -base;
    assign shift  = (int'(amount) > int'(SigBits) - 1) ? ShiftBits'(SigBits - 1)
                                                      : ShiftBits'(amount);
    always_comb begin
      exponent = base;
      sig      = src_sig;
      if (base < 0) begin
        exponent = '0;
        for (int k = int'(ShiftBits) - 1; k >= 0; k--) begin
          if (shift[k]) begin
            sig = (sig >> (1 << k)) | sig_t'((sig & ((sig_t'(1) << (1 << k)) - 1'b1)) != '0);
          end
        end
      end
    end
  end else begin : gen_same_range
    assign sig      = src_sig;
    assign exponent = base;
  end

  // Round

  // Bits below the target's last place: guard and sticky bit, and what the mantissa is longer by.
  localparam int unsigned DropBits = SigBits - 1 - DstManBits;
  // Exponent and mantissa of the target.
  localparam int unsigned RoundedBits = SignedBits + DstManBits;
  logic                   round_up;
  logic [RoundedBits-1:0] rounded;

  assign round_up = sig[DropBits-1] && (sig[DropBits] || sig[DropBits-2:0] != '0);
  assign rounded  = {exponent, {DstManBits{1'b0}}}
                  + RoundedBits'(sig[SigBits-1:DropBits])
                  + RoundedBits'(round_up);

  // Pack

  logic overflow;

  assign overflow = is_inf || rounded > RoundedBits'(Finite);

  always_comb begin
    dst_o = {sign, overflow ? Limit : rounded[DstWidth-2:0]};
    if (is_nan) begin
      dst_o = {1'b0, Nan};
    end
  end

endmodule
