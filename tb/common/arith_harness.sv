// All arithmetic units under test, for arith_harness.cpp.
//
// Groups of units, each with its own clock that samples the operands, so that a step evaluates
// one group only. Results of group g: out_o[g][word].
//   group f               format f: sum, product, a < b
//   group FORMATS + f     conversion of format f to each format
//   group 2 FORMATS       exp base e, base 2; log base e to FP16, E4M3, E5M2; the same in base 2
module arith_harness #(
  localparam int unsigned FORMATS = 6,
  localparam int unsigned GROUPS  = 2 * FORMATS + 1,
  localparam int unsigned WORDS   = 8
) (
  input  logic [GROUPS-1:0]                  clk_i,
  input  logic [      15:0]                  a_i,
  input  logic [      15:0]                  b_i,
  output logic [GROUPS-1:0][WORDS-1:0][15:0] out_o
);

  // FP16, E4M3, E5M2, E5M3, E4M4, E3M4: the order of FORMATS in test_arith.py.
  localparam int unsigned ExpBits[FORMATS] = '{5, 4, 5, 5, 4, 3};
  localparam int unsigned ManBits[FORMATS] = '{10, 3, 2, 3, 4, 4};
  localparam bit Fn[FORMATS] = '{0, 1, 0, 0, 0, 0};
  localparam bit Saturate[FORMATS] = '{0, 1, 1, 0, 1, 0};

  for (genvar f = 0; f < FORMATS; f++) begin : gen_format
    localparam int unsigned Width = 1 + ExpBits[f] + ManBits[f];

    logic [Width-1:0] a_q, b_q, src_q, sum, product;
    logic             lt;

    always_ff @(posedge clk_i[f]) begin
      a_q <= a_i[Width-1:0];
      b_q <= b_i[Width-1:0];
    end

    always_ff @(posedge clk_i[FORMATS+f]) begin
      src_q <= a_i[Width-1:0];
    end

    flk_fp_add #(
      .ExpBits(ExpBits[f]), .ManBits(ManBits[f]), .Fn(Fn[f]), .Saturate(Saturate[f])
    ) i_add (.a_i(a_q), .b_i(b_q), .sum_o(sum));

    flk_fp_mul #(
      .ExpBits(ExpBits[f]), .ManBits(ManBits[f]), .Fn(Fn[f]), .Saturate(Saturate[f])
    ) i_mul (.a_i(a_q), .b_i(b_q), .prod_o(product));

    flk_fp_cmp #(
      .ExpBits(ExpBits[f]), .ManBits(ManBits[f]), .Fn(Fn[f])
    ) i_cmp (.a_i(a_q), .b_i(b_q), .lt_o(lt));

    assign out_o[f] = {80'd0, 16'(lt), 16'(product), 16'(sum)};

    assign out_o[FORMATS+f][WORDS-1:FORMATS] = '0;
    for (genvar d = 0; d < FORMATS; d++) begin : gen_convert
      localparam int unsigned DstWidth = 1 + ExpBits[d] + ManBits[d];
      logic [DstWidth-1:0] dst;
      flk_fp_convert #(
        .SrcExpBits(ExpBits[f]), .SrcManBits(ManBits[f]), .SrcFn(Fn[f]),
        .DstExpBits(ExpBits[d]), .DstManBits(ManBits[d]), .DstFn(Fn[d]), .DstSaturate(Saturate[d])
      ) i_convert (.src_i(src_q), .dst_o(dst));
      assign out_o[FORMATS+f][d] = 16'(dst);
    end
  end

  logic [15:0] x_q;

  always_ff @(posedge clk_i[GROUPS-1]) begin
    x_q <= a_i;
  end

  for (genvar base2 = 0; base2 < 2; base2++) begin : gen_base
    flk_exp_neg #(.Base2(base2)) i_exp (.e_i(x_q), .g_o(out_o[GROUPS-1][base2]));

    for (genvar f = 0; f < 3; f++) begin : gen_log
      localparam int unsigned Width = 1 + ExpBits[f] + ManBits[f];
      logic [Width-1:0] log;
      flk_log_opacity #(
        .Base2(base2), .ExpBits(ExpBits[f]), .ManBits(ManBits[f]), .Fn(Fn[f]), .Saturate(Saturate[f])
      ) i_log (.opacity_i(x_q), .log_o(log));
      assign out_o[GROUPS-1][2+3*base2+f] = 16'(log);
    end
  end

endmodule
