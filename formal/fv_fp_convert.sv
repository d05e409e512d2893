// flk_fp_convert against plain integers: the source's value in the finer of the two units, rounded
// to nearest even (fv_rounding); sign kept, infinities and NaN by their rules.
module fv_fp_convert #(
  parameter  int unsigned SrcExpBits  = 5,
  parameter  int unsigned SrcManBits  = 10,
  parameter  bit          SrcFn       = 1'b0,
  parameter  int unsigned DstExpBits  = 4,
  parameter  int unsigned DstManBits  = 3,
  parameter  bit          DstFn       = 1'b1,
  parameter  bit          DstSaturate = 1'b1,
  localparam int unsigned SrcWidth    = 1 + SrcExpBits + SrcManBits,
  localparam int unsigned DstWidth    = 1 + DstExpBits + DstManBits
) (
  input logic [SrcWidth-1:0] src_i
);

  typedef logic [SrcWidth-2:0] src_t;
  typedef logic [DstWidth-2:0] dst_t;

  localparam src_t SrcInf = {{SrcExpBits{1'b1}}, {SrcManBits{1'b0}}};
  localparam src_t SrcTop = SrcFn ? src_t'(-2) : SrcInf;
  localparam dst_t DstInf = {{DstExpBits{1'b1}}, {DstManBits{1'b0}}};
  localparam dst_t DstNan = DstFn ? '1 : DstInf | (dst_t'(1) << (DstManBits - 1));
  localparam dst_t Limit = !DstSaturate ? DstInf : DstFn ? DstNan - 1'b1 : DstInf - 1'b1;
  localparam int unsigned SrcValueBits = SrcManBits + 1 + (1 << SrcExpBits) - 2;
  // Fraction bits of the smallest subnormal numbers.
  localparam int unsigned SrcUnit = (1 << (SrcExpBits - 1)) - 2 + SrcManBits;
  localparam int unsigned DstUnit = (1 << (DstExpBits - 1)) - 2 + DstManBits;
  localparam int unsigned SrcScale = DstUnit > SrcUnit ? DstUnit - SrcUnit : 0;
  localparam int unsigned DstScale = SrcUnit > DstUnit ? SrcUnit - DstUnit : 0;
  localparam int unsigned ExactBits = SrcValueBits + SrcScale;

  logic [DstWidth-1:0] dst;

  flk_fp_convert #(
    .SrcExpBits (SrcExpBits),
    .SrcManBits (SrcManBits),
    .SrcFn      (SrcFn),
    .DstExpBits (DstExpBits),
    .DstManBits (DstManBits),
    .DstFn      (DstFn),
    .DstSaturate(DstSaturate)
  ) dut (
    .src_i,
    .dst_o(dst)
  );

  src_t mag;
  logic ok;
  logic [SrcValueBits-1:0] value;

  assign mag = src_i[SrcWidth-2:0];

  fv_value #(.ExpBits(SrcExpBits), .ManBits(SrcManBits)) i_value (.mag_i(mag), .value_o(value));

  fv_rounding #(
    .ExpBits  (DstExpBits),
    .ManBits  (DstManBits),
    .Fn       (DstFn),
    .Saturate (DstSaturate),
    .ExactBits(ExactBits),
    .Scale    (DstScale)
  ) i_rounding (
    .exact_i(ExactBits'(value) << SrcScale),
    .mag_i  (dst[DstWidth-2:0]),
    .ok_o   (ok)
  );

  always_comb begin
    if (mag > SrcTop) begin
      a_result_nan: assert (dst == {1'b0, DstNan});
    end else begin
      a_result_sign: assert (dst[DstWidth-1] == src_i[SrcWidth-1]);
      if (!SrcFn && mag == SrcInf) begin
        a_result_inf: assert (dst[DstWidth-2:0] == Limit);
      end else begin
        a_result_value: assert (ok);
      end
    end
    if (SrcScale == 0) begin
      c_subnormal: cover (mag <= SrcTop && dst[DstWidth-2:0] < (dst_t'(1) << DstManBits) && dst[0]);
    end else begin
      // The target is the finer of the two: no number of the source is rounded to zero.
      c_finer: cover (mag < (src_t'(1) << SrcManBits) && dst[DstWidth-2:0] != '0);
    end
    c_normal: cover (mag <= SrcTop && dst[DstWidth-2:0] > DstInf >> 1);
    c_nan: cover (mag > SrcTop);
  end

endmodule
