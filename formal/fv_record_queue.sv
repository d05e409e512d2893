// flk_record_queue: words leave in the order in which they come, unchanged, none is lost or doubled; an end leaves by the outputs alone, and a
// record that does not leaves while drop_i is high, so that no end is before it; left_o counts what leaves. What has been inside for two cycles is
// shown, or dropped. Depth words have room. One word is followed, whichever pick_i chooses. The assertions l_* say what is where, for induction.
module fv_record_queue #(
  parameter  int unsigned Depth = 8,
  localparam int unsigned Half = Depth / 2,
  localparam int unsigned CountBits = $clog2(Depth + 1)
) (
  input logic            clk_i,
  input logic            again_i,
  input logic            clear_i,
  input logic [1:0]      pick_i,
  input logic [1:0]      some_valid_i,
  input logic [1:0]      in_last_i,
  input logic [1:0]      in_data_i,
  input logic            drop_i,
  input logic [1:0]      out_ready_i
);

  logic                 rst_n, empty;
  logic [1:0]           in_valid, out_valid, out_last, out_data, pop;
  logic [3:0]           left;
  logic [CountBits-1:0] count_q, room;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  // Who pushes counts what is inside; what leaves in this cycle is not counted yet.
  assign room     = CountBits'(Depth) - count_q;
  assign in_valid = room >= CountBits'(2) ? some_valid_i :
                    room == CountBits'(1) ? {some_valid_i[1] && !some_valid_i[0], some_valid_i[0]} : '0;

  flk_record_queue #(
    .Width(1),
    .Depth(Depth)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i (in_valid),
    .in_last_i,
    .in_data_i,
    .drop_i,
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_last_o (out_last),
    .out_data_o (out_data),
    .left_o     (left),
    .empty_o    (empty)
  );

  assign pop = out_valid & {&out_ready_i, out_ready_i[0]};

  // ---- the word that is followed: `ahead_q` words are before it ---------------------------------------

  logic                 watching_q, watching_d;
  logic [CountBits-1:0] ahead_q, ahead_d, place;
  logic [1:0]           watched_q, watched_d;  // end, data

  always_comb begin
    place      = count_q - CountBits'(left);
    watching_d = watching_q && 32'(ahead_q) >= 32'(left);
    ahead_d    = ahead_q - CountBits'(left);
    watched_d  = watched_q;
    for (int unsigned k = 0; k < 2; k++) begin
      if (!watching_q && !watching_d && in_valid[k] && pick_i[k]) begin
        watching_d = 1'b1;
        ahead_d    = place;
        watched_d  = {in_last_i[k], in_data_i[k]};
      end
      place = place + CountBits'(in_valid[k]);
    end
  end

  // How many have been inside for two cycles, none leaving in between.
  logic [CountBits-1:0] old_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      count_q    <= '0;
      watching_q <= 1'b0;
      old_q      <= '0;
    end else if (clear_i) begin
      count_q    <= '0;
      watching_q <= 1'b0;
      old_q      <= '0;
    end else begin
      count_q    <= place;
      watching_q <= watching_d;
      old_q      <= left != '0 ? '0 : count_q;
    end
  end

  always_ff @(posedge clk_i) begin
    ahead_q   <= ahead_d;
    watched_q <= watched_d;
  end

  // ---- where it lies ----------------------------------------------------------------------------------

  localparam int unsigned PlaceBits = $clog2(2 * Half);

  // Of each memory: words in its storage; place and round of the oldest that is inside.
  logic [1:0][PlaceBits:0]   fill;
  logic [1:0][PlaceBits-1:0] oldest, next;

  function automatic logic [PlaceBits-1:0] turned(logic [PlaceBits:0] at);
    turned = 32'(at) >= 2 * Half ? PlaceBits'(32'(at) - 2 * Half) : PlaceBits'(at);
  endfunction

  for (genvar k = 0; k < 2; k++) begin : gen_memory
    logic [PlaceBits:0] from, to;

    assign from      = (PlaceBits + 1)'(dut.read_at_q[k]) + (dut.read_round_q[k] ? (PlaceBits + 1)'(Half) : '0);
    assign to        = (PlaceBits + 1)'(dut.write_at_q[k]) + (dut.write_round_q[k] ? (PlaceBits + 1)'(Half) : '0);
    assign next[k]   = PlaceBits'(from);
    assign fill[k]   = to >= from ? to - from : to + (PlaceBits + 1)'(2 * Half) - from;
    assign oldest[k] = dut.shown_q[k] ? turned(from + (PlaceBits + 1)'(2 * Half - 1)) : PlaceBits'(from);

    always_comb begin
      if (rst_n) begin
        l_place: assert (32'(dut.read_at_q[k]) < Half && 32'(dut.write_at_q[k]) < Half && 32'(fill[k]) <= Half);
      end
    end
  end

  // In its memory: so many before it in the storage, none if it is shown.
  logic                 memory, shown, found, flagged;
  logic [CountBits-1:0] depth, inner;
  logic [PlaceBits:0]   at;
  logic [1:0]           stored;

  assign memory  = dut.read_q ^ ahead_q[0];
  assign depth   = ahead_q >> 1;
  assign shown   = dut.shown_q[memory] && depth == '0;
  assign inner   = depth - CountBits'(dut.shown_q[memory]);
  assign at      = (PlaceBits + 1)'(dut.read_at_q[memory]) + (PlaceBits + 1)'(inner);
  assign stored  = memory ? dut.gen_memory[1].i_storage.storage_q[32'(at) % Half]
                          : dut.gen_memory[0].i_storage.storage_q[32'(at) % Half];
  assign found   = (shown ? {dut.last[memory], dut.data[memory]} : stored) == watched_q;
  // Its group says that it has an end, at least while all of it lies before the reader.
  assign flagged = dut.ends_q[memory][(32'(at) % Half) / 4];

  always_comb begin
    if (rst_n) begin
      a_capacity: assert (count_q <= CountBits'(Depth));
      a_empty: assert (empty == (count_q == '0));
      a_left: assert (32'(left) <= 32'(count_q));
      a_taken: assert (pop == '0 || left == 4'(pop[0]) + 4'(pop[1]));
      a_pair: assert (!out_valid[1] || out_valid[0]);
      a_given: assert (drop_i || left == 4'(pop[0]) + 4'(pop[1]));
      a_dropped: assert (!drop_i || !out_valid[1] && (!out_valid[0] || out_last[0]));
      if (watching_q) begin
        a_end: assert (!watched_q[1] || 32'(ahead_q) >= 32'(left) || pop[ahead_q[0]] && ahead_q < 2);
        a_first: assert (ahead_q != '0 || !out_valid[0] || {out_last[0], out_data[0]} == watched_q);
        a_second: assert (ahead_q != CountBits'(1) || !out_valid[1] || {out_last[1], out_data[1]} == watched_q);
        l_ahead: assert (ahead_q < count_q);
        l_found: assert (found);
        l_flagged: assert (!watched_q[1] || shown || 32'(at) % Half % 4 > 32'(inner) || flagged);
      end
      a_shown: assert (old_q == '0 || out_valid[0] || left != '0);
      a_shown_two: assert (old_q < 2 || out_valid[1] || drop_i);
      l_old: assert (old_q <= count_q && (old_q == '0 || dut.shown_q[dut.read_q]) && (old_q < 2 || (&dut.shown_q)));
      l_shown: assert (dut.shown_q[dut.read_q] || !dut.shown_q[!dut.read_q]);
      l_fill: assert (32'(fill[0]) + 32'(fill[1]) + 32'(dut.shown_q[0]) + 32'(dut.shown_q[1]) == 32'(count_q));
      l_even: assert (32'(fill[dut.read_q]) + 32'(dut.shown_q[dut.read_q]) ==
                      32'(fill[!dut.read_q]) + 32'(dut.shown_q[!dut.read_q]) + 32'(count_q[0]));
      l_write: assert (dut.write_q == (dut.read_q ^ count_q[0]));
      l_turn: assert (oldest[0] == (dut.read_q ? turned((PlaceBits + 1)'(oldest[1]) + 1'b1) : oldest[1]));
      c_skip: cover (dut.skip && count_q == CountBits'(Depth));
      c_full: cover (count_q == CountBits'(Depth) && watching_q && watched_q[1] && drop_i);
    end
  end

endmodule
