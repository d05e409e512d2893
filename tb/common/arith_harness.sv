// All arithmetic units in a list of formats, for a batch harness (arith_harness.cpp).
//
// Operands are registered by an edge of one bit of clk_i, either edge: only the units behind that
// bit are evaluated. Bit f: adder, multiplier and comparison of format f; bit Formats + f:
// conversions of format f to all formats; bit 2 Formats: functions of FP16.
module arith_harness #(
  parameter int unsigned Formats = 1,
  // Per format, format 0 in the low bits: ExpBits, ManBits, Fn, Saturate.
  parameter logic [Formats-1:0][9:0] Table = {4'd5, 4'd10, 2'b00}
) (
  input  logic [2*Formats:0] clk_i,
  input  logic [       15:0] a_i,
  input  logic [       15:0] b_i,
  output logic [       15:0] sum_o  [Formats],
  output logic [       15:0] like_o [Formats],  // of the adder for operands of one sign
  output logic [       15:0] prod_o [Formats],
  output logic [       15:0] lt_o   [Formats],
  output logic [       15:0] conv_o [Formats][Formats],  // [source][target]
  output logic [       15:0] exp_o  [2],  // natural, base 2
  output logic [       15:0] log_o  [2][Formats]  // 0 where the exponent has less than 4 bits
);

  for (genvar f = 0; f < Formats; f++) begin : gen_format
    localparam int unsigned ExpBits = 32'(Table[f][9:6]);
    localparam int unsigned ManBits = 32'(Table[f][5:2]);
    localparam bit Fn = Table[f][1];
    localparam bit Saturate = Table[f][0];
    localparam int unsigned Width = 1 + ExpBits + ManBits;

    logic [Width-1:0] a_q, b_q, sum, like, prod, src_q;
    logic lt;

    always_ff @(edge clk_i[f]) begin
      a_q <= a_i[Width-1:0];
      b_q <= b_i[Width-1:0];
    end

    always_ff @(edge clk_i[Formats+f]) begin
      src_q <= a_i[Width-1:0];
    end

    flk_fp_add #(
      .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)
    ) i_add (.a_i(a_q), .b_i(b_q), .sum_o(sum));

    flk_fp_add_pipe #(
      .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate), .Cancel(0), .Stages(0)
    ) i_like (.clk_i(1'b0), .en_i(1'b0), .a_i(a_q), .b_i(b_q), .sum_o(like));

    flk_fp_mul #(
      .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn), .Saturate(Saturate)
    ) i_mul (.a_i(a_q), .b_i(b_q), .prod_o(prod));

    flk_fp_cmp #(
      .ExpBits(ExpBits), .ManBits(ManBits), .Fn(Fn)
    ) i_cmp (.a_i(a_q), .b_i(b_q), .lt_o(lt));

    assign sum_o[f]  = 16'(sum);
    assign like_o[f] = 16'(like);
    assign prod_o[f] = 16'(prod);
    assign lt_o[f]   = 16'(lt);

    for (genvar t = 0; t < Formats; t++) begin : gen_target
      localparam int unsigned DstExpBits = 32'(Table[t][9:6]);
      localparam int unsigned DstManBits = 32'(Table[t][5:2]);
      logic [DstExpBits+DstManBits:0] dst;

      flk_fp_convert #(
        .SrcExpBits(ExpBits), .SrcManBits(ManBits), .SrcFn(Fn),
        .DstExpBits(DstExpBits), .DstManBits(DstManBits),
        .DstFn(Table[t][1]), .DstSaturate(Table[t][0])
      ) i_convert (.src_i(src_q), .dst_o(dst));

      assign conv_o[f][t] = 16'(dst);
    end
  end

  logic [15:0] x_q;

  always_ff @(edge clk_i[2*Formats]) begin
    x_q <= a_i;
  end

  for (genvar base2 = 0; base2 < 2; base2++) begin : gen_base
    flk_exp_neg #(.Base2(base2 != 0)) i_exp (.e_i(x_q), .g_o(exp_o[base2]));

    for (genvar f = 0; f < Formats; f++) begin : gen_log
      localparam int unsigned ExpBits = 32'(Table[f][9:6]);
      localparam int unsigned ManBits = 32'(Table[f][5:2]);
      if (ExpBits >= 4) begin : gen_unit
        logic [ExpBits+ManBits:0] log;
        flk_log_opacity #(
          .Base2(base2 != 0), .ExpBits(ExpBits), .ManBits(ManBits),
          .Fn(Table[f][1]), .Saturate(Table[f][0])
        ) i_log (.opacity_i(x_q), .log_o(log));
        assign log_o[base2][f] = 16'(log);
      end else begin : gen_none
        assign log_o[base2][f] = '0;
      end
    end
  end

endmodule
