// Reset of a proof: low in the first cycle, afterwards whenever again_i says so.
//
// again_i is a free input of the proof's top, so every proof holds for a reset at any time.
module fv_reset (
  input  logic clk_i,
  input  logic again_i,
  output logic rst_no
);

  logic started_q = 1'b0;

  always_ff @(posedge clk_i) begin
    started_q <= 1'b1;
  end

  assign rst_no = started_q && !again_i;

endmodule
