// flk_pair_fifo: a stream of Depth + 2 words, two in and two out a cycle (fv_stream); room for one with fewer than Depth inside, for
// two with fewer than Depth - 1; two enter together or not at all; what has been inside for two cycles is shown, two words if there are
// two. The memories' queues are stand-ins. This is what its stand-in in other proofs keeps, too. The assertions l_* say what is where, for induction.
module fv_pair_fifo #(
  parameter int unsigned Depth = 4
) (
  input logic            clk_i,
  input logic            again_i,
  input logic            clear_i,
  input logic [1:0]      pick_i,
  input logic [1:0]      in_valid_i,
  input logic [1:0][1:0] in_data_i,
  input logic [1:0]      out_ready_i
);

  localparam int unsigned Held = Depth + 2;
  localparam int unsigned Half = Depth / 2 + 1;
  localparam int unsigned CountBits = $clog2(Held + 1);

  logic                 rst_n, empty, watching;
  logic [1:0]           in_ready, out_valid, push, pop, watched;
  logic [1:0][1:0]      out_data;
  logic [CountBits-1:0] count, ahead;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_pair_fifo #(
    .Width(2),
    .Depth(Depth)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_data_i,
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o (out_data),
    .empty_o    (empty)
  );

  assign push = in_valid_i == 2'b11 ? (in_ready[1] ? 2'b11 : 2'b00) : (in_ready[0] ? in_valid_i : 2'b00);
  assign pop  = {out_ready_i[0] && out_ready_i[1], out_ready_i[0]};

  fv_stream #(
    .Width   (2),
    .Capacity(Held),
    .In      (2),
    .Out     (2)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (push),
    .in_data_i,
    .out_valid_i(out_valid),
    .out_ready_i(pop),
    .out_data_i (out_data),
    .inside_o   (count),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  // What each memory's queue holds, the oldest first.

  logic [1:0][CountBits-1:0] fill;
  logic [1:0]                shown;
  logic [1:0][Half-1:0][1:0] item;

  for (genvar k = 0; k < 2; k++) begin : gen_queue
    assign shown[k] = dut.gen_queue[k].i_queue.out_valid_q;
    assign fill[k]  = CountBits'(dut.gen_queue[k].i_queue.used_q) + CountBits'(shown[k]);
    for (genvar d = 0; d < Half; d++) begin : gen_word
      if (d == 0) begin : gen_first
        assign item[k][d] = shown[k] ? dut.gen_queue[k].i_queue.out_q : dut.gen_queue[k].i_queue.words_q[0];
      end else if (d == Half - 1) begin : gen_last
        assign item[k][d] = dut.gen_queue[k].i_queue.words_q[d-1];
      end else begin : gen_other
        assign item[k][d] = shown[k] ? dut.gen_queue[k].i_queue.words_q[d-1] : dut.gen_queue[k].i_queue.words_q[d];
      end
    end
  end

  logic found;

  always_comb begin
    found = 1'b0;
    for (int unsigned d = 0; d < Held; d++) begin
      found = found || (ahead == CountBits'(d) && CountBits'(d) < count && item[dut.read_q^d[0]][d/2] == watched);
    end
  end

  // How many have been inside for two cycles, none leaving in between: those are shown.
  logic [CountBits-1:0] old_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      old_q <= '0;
    end else begin
      old_q <= clear_i || (out_valid & pop) != '0 ? '0 : count;
    end
  end

  always_comb begin
    if (rst_n) begin
      l_used: assert (dut.gen_queue[0].i_queue.used_q <= Depth / 2 && dut.gen_queue[1].i_queue.used_q <= Depth / 2);
      l_fill: assert (fill[dut.read_q] + fill[!dut.read_q] == count && fill[dut.read_q] == fill[!dut.read_q] + CountBits'(count[0]));
      l_write: assert (dut.write_q == (dut.read_q ^ count[0]));
      l_watched: assert (!watching || found);
      l_old: assert (old_q <= count && (old_q == '0 || shown[dut.read_q]) && (old_q < 2 || (&shown)));
      a_empty: assert (empty == (count == '0));
      a_two: assert (!in_ready[1] || in_ready[0]);
      a_room: assert (in_ready[0] || count >= CountBits'(Depth));
      a_room_two: assert (in_ready[1] || count >= CountBits'(Depth - 1));
      a_shown: assert (old_q == '0 || out_valid[0]);
      a_shown_two: assert (old_q < 2 || out_valid[1]);
      c_full: cover (count == CountBits'(Held));
      c_two: cover (pop[1] && out_valid[1] && push == 2'b11);
    end
  end

endmodule
