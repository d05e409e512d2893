// flk_entry_buffer: a stream of Depth + 2 elements (fv_stream), ends among them; no pair goes beyond an end; finish_o exactly
// while it is said and no end is inside. The queue is a stand-in. The assertions l_* say what is where, for induction.
module fv_entry_buffer #(
  parameter int unsigned Depth = 4
) (
  input logic       clk_i,
  input logic       again_i,
  input logic       clear_i,
  input logic       pick_i,
  input logic       in_valid_i,
  input logic       in_end_i,
  input logic [1:0] in_entry_i,
  input logic       out_ready_i,
  input logic       finish_i
);

  localparam int unsigned Held = Depth + 2;
  localparam int unsigned CountBits = $clog2(Held + 1);

  logic                 rst_n, in_ready, finish, empty, watching;
  logic [1:0]           out_valid, out_end;
  logic [1:0][1:0]      out_entry;
  logic [CountBits-1:0] count, ahead;
  logic [2:0]           watched;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_entry_buffer #(
    .Width(2),
    .Depth(Depth)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_end_i,
    .in_entry_i,
    .finish_o   (finish),
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_end_o  (out_end),
    .out_entry_o(out_entry),
    .finish_i,
    .empty_o    (empty)
  );

  fv_stream #(
    .Width   (3),
    .Capacity(Held),
    .Out     (2)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (in_valid_i && in_ready),
    .in_data_i  ({in_end_i, in_entry_i}),
    .out_valid_i(out_valid),
    .out_ready_i({2{out_ready_i}}),
    .out_data_i ({out_end[1], out_entry[1], out_end[0], out_entry[0]}),
    .inside_o   (count),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  logic [CountBits-1:0] ends;
  logic                 found;

  always_comb begin
    ends  = '0;
    found = 1'b0;
    for (int unsigned d = 0; d < Held; d++) begin
      if (CountBits'(d) < count) begin
        ends  = ends + CountBits'(dut.i_queue.words_q[d][2]);
        found = found || (ahead == CountBits'(d) && dut.i_queue.words_q[d] == watched);
      end
    end
  end

  always_comb begin
    if (rst_n) begin
      l_inside: assert (count == dut.i_queue.used_q);
      l_watched: assert (!watching || found);
      l_ends: assert (dut.ends_q == ends);
      a_beyond: assert (!(out_valid[1] && out_end[0]));
      a_finish: assert (finish == (finish_i && ends == '0));
      a_empty: assert (empty == (count == '0));
      c_pair: cover (out_valid[1] && out_end[1] && out_ready_i);
      c_full: cover (!in_ready);
    end
  end

endmodule
