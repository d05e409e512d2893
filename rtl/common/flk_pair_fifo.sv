// First-in first-out queue of a stream, up to two words a cycle in and out, storage in two memories (flk_sram_fifo) in turn.
//
// Words at both inputs are in the order 0, 1; either may come alone. in_ready_o[0]: there is room for one word, at whichever input;
// in_ready_o[1]: for two. Two words are taken together or not at all.
// The two oldest words are at the outputs: out_valid_o[1] implies out_valid_o[0], and out_ready_i[1] is heard with out_ready_i[0]
// alone. Of what stays, the oldest word is at output 0 in the next cycle.
// Latency 2; with fewer than Depth words inside there is room for one, with fewer than Depth - 1 for two; it holds at most
// Depth + 2. in_ready_o, out_* and empty_o come from registers through a multiplexer; out_ready_i reaches the memories' read enables.
// clear_i (synchronous) empties it: what it holds, and what it takes in that cycle, is gone in the next.
module flk_pair_fifo #(
  parameter int unsigned Width = 8,
  parameter int unsigned Depth = 16
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  // Upstream
  input  logic [1:0]            in_valid_i,
  output logic [1:0]            in_ready_o,
  input  logic [1:0][Width-1:0] in_data_i,
  // Downstream
  output logic [1:0]            out_valid_o,
  input  logic [1:0]            out_ready_i,
  output logic [1:0][Width-1:0] out_data_o,
  output logic                  empty_o       // nothing inside
);

  if (Depth < 4 || Depth % 2 != 0) begin : gen_check
    $error("flk_pair_fifo: Depth must be even, at least 4");
  end

  logic                  write_q, read_q;  // the memory of the next word
  logic [1:0]            ready, valid, empty, push, pop;
  logic [1:0][Width-1:0] data;

  assign in_ready_o  = {&ready, ready[write_q]};
  assign push        = (&in_valid_i ? in_ready_o[1] : in_ready_o[0]) ? in_valid_i : '0;
  assign out_valid_o = {&valid, valid[read_q]};
  assign out_data_o  = {data[!read_q], data[read_q]};
  assign pop         = {out_valid_o[1] && (&out_ready_i), out_valid_o[0] && out_ready_i[0]};
  assign empty_o     = &empty;

  for (genvar k = 0; k < 2; k++) begin : gen_queue
    logic first;  // of the words that come

    assign first = push[0] && write_q == 1'(k);

    flk_sram_fifo #(
      .Width(Width),
      .Depth(Depth / 2)
    ) i_queue (
      .clk_i,
      .rst_ni,
      .clear_i,
      .in_valid_i (first || (push[1] && (write_q ^ push[0]) == 1'(k))),
      .in_ready_o (ready[k]),
      .in_data_i  (in_valid_i[0] && write_q == 1'(k) ? in_data_i[0] : in_data_i[1]),
      .out_valid_o(valid[k]),
      .out_ready_i(read_q == 1'(k) ? pop[0] : pop[1]),
      .out_data_o (data[k]),
      .empty_o    (empty[k])
    );
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q <= 1'b0;
      read_q  <= 1'b0;
    end else if (clear_i) begin
      write_q <= 1'b0;
      read_q  <= 1'b0;
    end else begin
      write_q <= write_q ^ (^push);
      read_q  <= read_q ^ (^pop);
    end
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o[0] && !out_ready_i[0] && !clear_i |=> out_valid_o[0] && $stable(out_data_o[0]))
  else $error("flk_pair_fifo: output changed before its transfer");
`endif

endmodule
