// Clock gate: the place of a technology's cell.
//
// clk_o follows clk_i in the cycles that begin with en_i or test_en_i high (both from registers of clk_i, taken while
// clk_i is low; test_en_i may stand still as well); else it stays low. test_en_i: the clock passes in every cycle of a
// scan test, whatever the registers hold. In synthesis without a cell of its own (SYNTHESIS) the clock passes.
module flk_clock_gate (
  input  logic clk_i,
  input  logic en_i,
  input  logic test_en_i,
  output logic clk_o
);

`ifdef SYNTHESIS
  logic unused_en;
  assign unused_en = en_i ^ test_en_i;
  assign clk_o     = clk_i;
`else
  logic en;

  always_latch begin
    if (!clk_i) begin
      en = en_i || test_en_i;
    end
  end

  assign clk_o = clk_i & en;
`endif

endmodule
