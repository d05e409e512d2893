// All ff units for a list of mantissa bits, for a batch harness (ff_harness.cpp).
//
// An edge of load_i[f], either edge, registers the operands of format f; a rising edge of clk_i[f] clocks its pipelines.
// y_o[f][s][u]: unit u with s stages (the adder has three at most, the conversions two); s = 0: combinational.
module ff_harness #(
  parameter int unsigned Formats = 1,
  parameter logic [Formats-1:0][7:0] ManBitsOf = {8'd19}  // format 0 in the low bits
) (
  input  logic [Formats-1:0] load_i,
  input  logic [Formats-1:0] clk_i,
  input  logic               en_i,
  input  logic [       31:0] a_i,
  input  logic [       31:0] b_i,
  output logic [       31:0] y_o [Formats][5][13]
);

  for (genvar f = 0; f < Formats; f++) begin : gen_format
    localparam int unsigned ManBits = 32'(ManBitsOf[f]);
    localparam int unsigned Width = 9 + ManBits;

    logic clk;
    logic [31:0] a_q, b_q;
    logic [Width-1:0] a, b;

    assign clk = clk_i[f];
    always_ff @(edge load_i[f]) begin
      a_q <= a_i;
      b_q <= b_i;
    end
    assign a = a_q[Width-1:0];
    assign b = b_q[Width-1:0];

    for (genvar s = 0; s < 5; s++) begin : gen_stages
      localparam int unsigned Few = (s > 2) ? 2 : s;
      localparam int unsigned Most3 = (s > 3) ? 3 : s;
      logic [Width-1:0] add, mul, recip, rsqrt, sqrt, exp2, exp2_wide, wide, narrow;
      logic [19:0] down;
      logic [20:0] near;

      flk_ff_add #(.ManBits(ManBits), .Stages(Most3)) i_add (.clk_i(clk), .en_i, .a_i(a), .b_i(b), .sum_o(add));
      flk_ff_mul #(.ManBits(ManBits), .Stages(s)) i_mul (.clk_i(clk), .en_i, .a_i(a), .b_i(b), .prod_o(mul));
      flk_ff_recip #(.ManBits(ManBits), .Stages(s)) i_recip (.clk_i(clk), .en_i, .x_i(a), .y_o(recip));
      flk_ff_rsqrt #(.ManBits(ManBits), .Stages(s)) i_rsqrt (.clk_i(clk), .en_i, .x_i(a), .y_o(rsqrt));
      flk_ff_sqrt #(.ManBits(ManBits), .Stages(s)) i_sqrt (.clk_i(clk), .en_i, .x_i(a), .y_o(sqrt));
      flk_ff_exp2 #(.ManBits(ManBits), .IntBits(7), .FracBits(14), .Stages(s)) i_exp2 (
        .clk_i(clk), .en_i, .l_i(b_q[20:0]), .y_o(exp2)
      );
      flk_ff_exp2 #(.ManBits(ManBits), .IntBits(10), .FracBits(5), .Stages(s)) i_exp2_wide (
        .clk_i(clk), .en_i, .l_i(b_q[14:0]), .y_o(exp2_wide)
      );
      flk_ff_from_fixed #(.ManBits(ManBits), .Bits(32), .FracBits(8), .Stages(Few)) i_wide (
        .clk_i(clk), .en_i, .x_i(b_q), .y_o(wide)
      );
      flk_ff_from_fixed #(.ManBits(ManBits), .Bits(11), .FracBits(0), .Stages(Few)) i_narrow (
        .clk_i(clk), .en_i, .x_i(b_q[10:0]), .y_o(narrow)
      );
      flk_ff_to_fixed #(.ManBits(ManBits), .Bits(20), .FracBits(6), .Round(0), .Stages(Few)) i_down (
        .clk_i(clk), .en_i, .x_i(a), .y_o(down)
      );
      flk_ff_to_fixed #(.ManBits(ManBits), .Bits(21), .FracBits(14), .Round(1), .Stages(Few)) i_near (
        .clk_i(clk), .en_i, .x_i(a), .y_o(near)
      );

      assign y_o[f][s][0] = 32'(add);
      assign y_o[f][s][1] = 32'(mul);
      assign y_o[f][s][2] = 32'(recip);
      assign y_o[f][s][3] = 32'(rsqrt);
      assign y_o[f][s][4] = 32'(sqrt);
      assign y_o[f][s][5] = 32'(exp2);
      assign y_o[f][s][6] = 32'(exp2_wide);
      assign y_o[f][s][7] = 32'(wide);
      assign y_o[f][s][8] = 32'(narrow);
      assign y_o[f][s][9] = 32'($signed(down));
      assign y_o[f][s][10] = 32'($signed(near));
    end

    logic lt;
    logic [Width-1:0] half;
    flk_ff_from_fp16 #(.ManBits(ManBits)) i_half (.x_i(b_q[15:0]), .y_o(half));
    flk_ff_cmp #(.ManBits(ManBits)) i_cmp (.a_i(a), .b_i(b), .lt_o(lt));
    for (genvar s = 0; s < 5; s++) begin : gen_lt
      assign y_o[f][s][11] = 32'(lt);
      assign y_o[f][s][12] = 32'(half);
    end
  end

endmodule
