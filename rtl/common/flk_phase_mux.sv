// Operand of a unit in which results take turns (docs/reference/datapath.md): y_o is a_i in the cycles of phase 0, else b_i.
//
// odd_i is the phase of the next cycle. The choice stands in a register of its own, so that few gates load it.
module flk_phase_mux #(
  parameter int unsigned Width = 10
) (
  input  logic             clk_i,
  input  logic             odd_i,
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic [Width-1:0] y_o
);

  logic odd_q;

  always_ff @(posedge clk_i) begin
    odd_q <= odd_i;
  end

  assign y_o = odd_q ? b_i : a_i;

endmodule
