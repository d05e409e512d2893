// Buffer of a sorting unit's entries: one a cycle in, two a cycle out (docs/reference/delivery.md).
//
// While delivery is at other units' tiles the unit fills it, and its tile then goes at two entries a cycle. The two oldest of what
// flk_pair_fifo holds, entries and ends, are at both outputs. out_valid_o[1] implies out_valid_o[0], and out_end_o[0] is low with
// it: a pair never goes beyond the end of a list. out_ready_i takes all that is valid; until then it stays, but for a second entry
// that may join.
// finish_i is about the list that the buffer gives, until its end has been taken; finish_o tells the unit so while that is the
// list that it gives, until its end has been taken: while no end is inside. What the buffer holds must still be taken.
// clear_i (synchronous) empties it: what it holds, and what it takes in that cycle, is gone in the next.
// Latency 2. in_ready_o, out_* and empty_o come from registers through a multiplexer, finish_o from registers and finish_i.
module flk_entry_buffer #(
  parameter int unsigned Width = 28,
  parameter int unsigned Depth = 704
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  // Sorting unit
  input  logic                  in_valid_i,
  output logic                  in_ready_o,
  input  logic                  in_end_i,
  input  logic [Width-1:0]      in_entry_i,
  output logic                  finish_o,
  // Delivery
  output logic [1:0]            out_valid_o,
  input  logic                  out_ready_i,
  output logic [1:0]            out_end_o,
  output logic [1:0][Width-1:0] out_entry_o,
  input  logic                  finish_i,
  output logic                  empty_o
);

  localparam int unsigned EndBits = $clog2(Depth + 3);  // the queue holds two more

  logic [1:0]         valid, take;
  logic               unused_ready;  // for two
  logic [EndBits-1:0] ends_q;
  logic               push, pop_end;

  assign push        = in_valid_i && in_ready_o;
  assign out_valid_o = {valid[1] && !out_end_o[0], valid[0]};
  assign take        = out_ready_i ? out_valid_o : '0;
  assign pop_end     = (take & out_end_o) != '0;
  assign finish_o    = finish_i && ends_q == '0;

  flk_pair_fifo #(
    .Width(1 + Width),
    .Depth(Depth)
  ) i_queue (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i ({1'b0, in_valid_i}),
    .in_ready_o ({unused_ready, in_ready_o}),
    .in_data_i  ({(1 + Width)'(0), in_end_i, in_entry_i}),
    .out_valid_o(valid),
    .out_ready_i(take),
    .out_data_o ({out_end_o[1], out_entry_o[1], out_end_o[0], out_entry_o[0]}),
    .empty_o
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      ends_q <= '0;
    end else if (clear_i) begin
      ends_q <= '0;
    end else begin
      ends_q <= ends_q + EndBits'(push && in_end_i) - EndBits'(pop_end);
    end
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o[1] |-> out_valid_o[0] && !out_end_o[0])
  else $error("flk_entry_buffer: a pair beyond the end of a list");
`endif

endmodule
