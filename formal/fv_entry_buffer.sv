// flk_entry_buffer: a stream of Depth + 2 elements (fv_pair_stream), ends among them; no pair goes beyond an end; finish_o exactly
// while it is said and no end is inside. The queues are stand-ins. The assertions l_* say what is where, for induction.
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
  localparam int unsigned Half = Depth / 2 + 1;

  logic            rst_n, in_ready, finish, empty, watching;
  logic [1:0]      out_valid, out_end;
  logic [1:0][1:0] out_entry;
  logic [3:0]      count, ahead;
  logic [2:0]      watched;

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

  fv_pair_stream #(
    .Width   (3),
    .Capacity(Held)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i     ({1'b0, pick_i}),
    .push_i     ({1'b0, in_valid_i && in_ready}),
    .in_data_i  ({3'd0, in_end_i, in_entry_i}),
    .out_valid_i(out_valid),
    .out_ready_i,
    .out_data_i ({out_end[1], out_entry[1], out_end[0], out_entry[0]}),
    .inside_o   (count),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  // What each queue holds, the oldest first.

  logic [1:0][3:0]           fill;
  logic [1:0][Half-1:0][2:0] item;

  for (genvar k = 0; k < 2; k++) begin : gen_queue
    logic shown;
    assign shown   = dut.gen_queue[k].i_queue.out_valid_q;
    assign fill[k] = 4'(dut.gen_queue[k].i_queue.used_q) + 4'(shown);
    for (genvar d = 0; d < Half; d++) begin : gen_word
      if (d == 0) begin : gen_first
        assign item[k][d] = shown ? dut.gen_queue[k].i_queue.out_q : dut.gen_queue[k].i_queue.words_q[0];
      end else if (d == Half - 1) begin : gen_last
        assign item[k][d] = dut.gen_queue[k].i_queue.words_q[d-1];
      end else begin : gen_other
        assign item[k][d] = shown ? dut.gen_queue[k].i_queue.words_q[d-1] : dut.gen_queue[k].i_queue.words_q[d];
      end
    end
  end

  logic [Held-1:0][2:0] element;
  logic [3:0]           ends;
  logic                 found;

  for (genvar d = 0; d < Held; d++) begin : gen_element
    assign element[d] = item[dut.read_q ^ 1'(d)][d/2];
  end

  always_comb begin
    ends  = '0;
    found = 1'b0;
    for (int unsigned d = 0; d < Held; d++) begin
      if (4'(d) < count) begin
        ends  = ends + 4'(element[d][2]);
        found = found || (ahead == 4'(d) && element[d] == watched);
      end
    end
  end

  always_comb begin
    if (rst_n) begin
      l_used: assert (dut.gen_queue[0].i_queue.used_q <= 3'(Depth / 2) && dut.gen_queue[1].i_queue.used_q <= 3'(Depth / 2));
      l_fill: assert (fill[dut.read_q] + fill[!dut.read_q] == count && fill[dut.read_q] == fill[!dut.read_q] + 4'(count[0]));
      l_write: assert (dut.write_q == (dut.read_q ^ count[0]));
      l_watched: assert (!watching || found);
      l_ends: assert (4'(dut.ends_q) == ends);
      a_beyond: assert (!(out_valid[1] && out_end[0]));
      a_finish: assert (finish == (finish_i && ends == '0));
      a_empty: assert (empty == (count == '0));
      c_pair: cover (out_valid[1] && out_end[1] && out_ready_i);
      c_full: cover (!in_ready);
    end
  end

endmodule
