// Pipeline register of a stream: one entry.
//
// Latency 1, throughput 1 per cycle. Valid and data are registered; in_ready_o depends
// combinationally on out_ready_i, so a chain of these has a ready path as long as the chain
// (flk_skid_buffer cuts it). A bubble is filled while the output waits.
// clear_i (synchronous) empties it: what it holds, and what it takes in that cycle, is gone in the next.
// The payload register is not reset.
module flk_pipe_reg #(
  parameter int unsigned Width = 8
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
    $error("flk_pipe_reg: Width must be at least 1");
  end

  // Control

  logic valid_d, valid_q;

  assign in_ready_o = !valid_q || out_ready_i;
  assign valid_d    = (in_valid_i || !in_ready_o) && !clear_i;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= 1'b0;
    end else begin
      valid_q <= valid_d;
    end
  end

  // Payload

  logic [Width-1:0] data_q;

  always_ff @(posedge clk_i) begin
    if (in_valid_i && in_ready_o) begin
      data_q <= in_data_i;
    end
  end

  assign out_valid_o = valid_q;
  assign out_data_o  = data_q;

`ifndef SYNTHESIS
  // An element that waits stays as it is.
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_pipe_reg: output changed before its transfer");
`endif

endmodule
