// Register slice of a stream that cuts every path: two entries.
//
// Latency 1, throughput 1 per cycle. in_ready_o, out_valid_o and out_data_o come from registers;
// no input reaches an output combinationally. The second entry catches the element that was
// accepted in the cycle in which the output stopped.
// in_ready_o falls one cycle after a stall and rises one cycle after its end.
// clear_i (synchronous) empties it: what it holds, and what it takes in that cycle, is gone in the next.
// Payload registers are not reset. Early: they load in_data_i whenever they have room, with in_valid_i or without, so that wide enables
// hang on fewer signals (an FPGA's paths are shorter, more registers toggle).
module flk_skid_buffer #(
  parameter int unsigned Width = 8,
  parameter bit          Early = 1'b0
) (
  input  logic             clk_i,
  input  logic             rst_ni,
  input  logic             clear_i,
  // Upstream
  input  logic             in_valid_i,
  output logic             in_ready_o,
  input  logic [Width-1:0] in_data_i,
  // Downstream
  output logic             out_valid_o,
  input  logic             out_ready_i,
  output logic [Width-1:0] out_data_o
);

  if (Width < 1) begin : gen_check_width
    $error("flk_skid_buffer: Width must be at least 1");
  end

  // Control: the skid entry is occupied only while the output entry is.

  logic out_valid_d, out_valid_q;
  logic skid_valid_d, skid_valid_q;
  logic move;  // the output entry is free in the next cycle

  assign move         = !out_valid_q || out_ready_i;
  assign out_valid_d  = (in_valid_i || skid_valid_q || !move) && !clear_i;
  assign skid_valid_d = (in_valid_i || skid_valid_q) && !move && !clear_i;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      out_valid_q  <= 1'b0;
      skid_valid_q <= 1'b0;
    end else begin
      out_valid_q  <= out_valid_d;
      skid_valid_q <= skid_valid_d;
    end
  end

  // Payload

  logic [Width-1:0] out_data_q;
  logic [Width-1:0] skid_data_q;

  always_ff @(posedge clk_i) begin
    if (move && (Early || skid_valid_q || in_valid_i)) begin
      out_data_q <= skid_valid_q ? skid_data_q : in_data_i;
    end
    if (!skid_valid_q && (Early || (!move && in_valid_i))) begin
      skid_data_q <= in_data_i;
    end
  end

  assign in_ready_o  = !skid_valid_q;
  assign out_valid_o = out_valid_q;
  assign out_data_o  = out_data_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) skid_valid_q |-> out_valid_q)
  else $error("flk_skid_buffer: skid entry occupied before the output entry");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_skid_buffer: output changed before its transfer");
`endif

endmodule
