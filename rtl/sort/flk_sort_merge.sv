// A step of sorting: a list's sorted runs of Run entries, two by two, into runs of twice as many.
//
// A list is runs of Run entries, the last one perhaps shorter, then an element with in_end_i (no
// entry; in_flag_i goes with it). Runs go to two memories in turn, A first; the smaller of the two
// heads leaves, by the upper KeyBits (unsigned). A run without a second leaves as it is, once the
// list's end or in_flag_i with one of its entries says that none comes; out_flag_o says the same of
// the output's runs. Behind the list that leaves up to Lists whole lists and the one that arrives wait.
// Throughput: an entry a cycle. Latency: an entry is at its side's head three cycles after it was
// taken. Handshakes: in_ready_o comes from registers; out_valid_o from registers, drop_i and closed_i;
// out_ready_i reaches the memories' read ports. clear_i (synchronous) empties it.
// drop_i: what there is of the list that leaves is left out, its end leaves; drop_o: what arrives at
// the input belongs to this list too. empty_o: no entry and no end inside.
//
// Select, for the last step: nothing of a list leaves before closed_i (its end is on the way) or its
// end. cut_i, for a list whose end is not on the way: when both memories are full, the 2 Run entries
// are reduced to the smallest Run: they are counted off from both heads (limit_o: out_entry_o is the
// last of them), the heads go back to where they were, and the counted entries are merged into A,
// where each entry read leaves room for one. They are then the list's first run; what follows is the
// second. busy_o is high meanwhile, done_o in its last cycle: 2 Run + 4 cycles from cut_i on.
module flk_sort_merge #(
  parameter  int unsigned Run         = 16,
  parameter  int unsigned Depth       = Run,  // entries of a memory: Run, 2 Run, 4 Run, ...
  parameter  int unsigned KeyBits     = 48,
  parameter  int unsigned PayloadBits = 4,
  parameter  int unsigned Lists       = 8,
  parameter  bit          Select      = 1'b0,
  localparam int unsigned EntryBits   = KeyBits + PayloadBits
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 clear_i,
  // Upstream
  input  logic                 in_valid_i,
  output logic                 in_ready_o,
  input  logic                 in_end_i,
  input  logic                 in_flag_i,
  input  logic [EntryBits-1:0] in_entry_i,
  // Downstream
  output logic                 out_valid_o,
  input  logic                 out_ready_i,
  output logic                 out_end_o,
  output logic                 out_flag_o,
  output logic [EntryBits-1:0] out_entry_o,
  // Control
  input  logic                 drop_i,
  output logic                 drop_o,
  output logic                 empty_o,
  // Selection
  input  logic                 closed_i,
  input  logic                 cut_i,
  output logic                 busy_o,
  output logic                 limit_o,
  output logic                 done_o
);

  if (Run < 2 || (Run & (Run - 1)) != 0) begin : gen_check
    $error("flk_sort_merge: Run must be a power of two, at least 2");
  end
  if (Depth < Run || (Depth & (Depth - 1)) != 0) begin : gen_check_depth
    $error("flk_sort_merge: Depth must be a power of two, at least Run");
  end
  if (Select && Depth != Run) begin : gen_check_select
    $error("flk_sort_merge: with Select, Depth must be Run");
  end

  localparam int unsigned SlotBits = $clog2(Depth);
  localparam int unsigned RunBits  = $clog2(Run);

  // Of a memory, with a bit that says how often it has gone round.
  typedef logic [SlotBits:0] place_t;

  typedef struct packed {
    logic         flag;
    place_t [1:0] place;  // behind its last entry, in both memories
  } finish_t;

  typedef enum logic [1:0] {NONE, COUNT, MOVE} cut_e;

  // A is 0, B is 1.
  place_t [1:0] head_at_d, head_at_q, head_passed;  // of the head, or of what becomes it
  place_t [1:0] fetch_at_d, fetch_at_q;             // of what is read next
  place_t [1:0] write_at_d, write_at_q;
  place_t [1:0] limit_at_d, limit_at_q;             // behind the present run
  logic   [1:0] head_valid_d, head_valid_q, read_valid_d, read_valid_q;
  logic   [1:0][EntryBits-1:0] head_q, read;  // the head; behind it the memory's register
  logic   [1:0]              at_limit, at_end, over, pop, load, fetch, write;
  logic                      complete, finish_pop, finish_ready, finish_empty;
  finish_t                   finish;
  logic                      pair_done, list_done, less, prefer_b, may, can, move, drop;
  cut_e                      cut_d, cut_q;
  logic [RunBits-1:0]        counted_d, counted_q;
  logic                      counted_all, begins;

  // ---- input --------------------------------------------------------------------------------------

  logic [1:0]         full;
  logic               side_d, side_q;  // which memory's turn it is
  logic [RunBits-1:0] taken_d, taken_q;  // entries of the run
  logic               only_d, only_q;   // the list that arrives has no second run
  logic               take, take_end;

  for (genvar s = 0; s < 2; s++) begin : gen_full
    assign full[s] = write_at_q[s] == {~head_at_q[s][SlotBits], head_at_q[s][SlotBits-1:0]};
  end

  assign in_ready_o = !full[side_q] && finish_ready && (!Select || cut_q == NONE);
  assign take       = in_valid_i && in_ready_o && !in_end_i;
  assign take_end   = in_valid_i && in_ready_o && in_end_i;

  logic [$clog2(Lists+1)-1:0] unused_usage;
  logic                       unused_full;

  // The list that leaves is whole when its end is here.
  flk_fifo #(
    .Width($bits(finish_t)),
    .Depth(Lists)
  ) i_finish (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (take_end),
    .in_ready_o (finish_ready),
    .in_data_i  ({in_flag_i, write_at_q}),
    .out_valid_o(complete),
    .out_ready_i(finish_pop),
    .out_data_o (finish),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (finish_empty)
  );

  always_comb begin
    side_d  = side_q;
    taken_d = taken_q;
    only_d  = only_q;
    if (take) begin
      taken_d = taken_q + 1'b1;
      side_d  = side_q ^ (taken_q == '1);
      only_d  = in_flag_i;
    end
    if (take_end) begin
      taken_d = '0;
      side_d  = 1'b0;
      only_d  = 1'b0;
    end
    if (done_o) begin
      side_d  = 1'b1;
    end
    if (clear_i) begin
      taken_d = '0;
      side_d  = 1'b0;
      only_d  = 1'b0;
    end
  end

  // ---- memories -----------------------------------------------------------------------------------

  for (genvar s = 0; s < 2; s++) begin : gen_side
    logic [EntryBits-1:0] write_data;

    if (Select && s == 0) begin : gen_back
      assign write_data = cut_q == MOVE ? out_entry_o : in_entry_i;
      assign write[s]   = (take && !side_q) || (cut_q == MOVE && move);
    end else begin : gen_in
      assign write_data = in_entry_i;
      assign write[s]   = take && side_q == 1'(s);
    end

    flk_sram #(
      .Width(EntryBits),
      .Depth(Depth)
    ) i_memory (
      .clk_i,
      .wr_en_i  (write[s]),
      .wr_addr_i(write_at_q[s][SlotBits-1:0]),
      .wr_data_i(write_data),
      .rd_en_i  (fetch[s]),
      .rd_addr_i(fetch_at_q[s][SlotBits-1:0]),
      .rd_data_o(read[s])
    );

    // A word that is written in this cycle is not there yet.
    assign head_passed[s] = head_at_q[s] + 1'b1;
    assign load[s]        = read_valid_q[s] && (!head_valid_q[s] || pop[s]);
    assign fetch[s]       = write_at_q[s] != fetch_at_q[s] && (!read_valid_q[s] || load[s]);

    always_ff @(posedge clk_i) begin
      if (load[s]) begin
        head_q[s] <= read[s];
      end
    end

    assign at_limit[s] = head_at_q[s] == limit_at_q[s];
    assign at_end[s]   = complete && head_at_q[s] == finish.place[s];
  end

  // ---- choice -------------------------------------------------------------------------------------

  // Both runs have left: the next two begin in the same cycle. over: the run has left, or there is none.
  assign pair_done = at_limit == '1;
  assign list_done = at_end == '1;
  assign less      = head_q[1][EntryBits-1:PayloadBits] < head_q[0][EntryBits-1:PayloadBits];
  assign over[0]   = at_end[0] || (at_limit[0] && !pair_done);
  assign over[1]   = at_end[1] || (at_limit[1] && !pair_done) || (!complete && only_q);
  assign may       = !Select || complete || closed_i;
  assign drop      = drop_i && !list_done && (!Select || cut_q == NONE);

  // What does not wait for the comparison: there is an entry to choose, and it is taken.
  assign can       = (head_valid_q | over) == '1 && over != '1;
  assign prefer_b  = over[0] || (less && !over[1]);
  assign move      = can && (Select && cut_q != NONE ? cut_q == COUNT || !pair_done
                                                     : may && !drop && out_ready_i);
  assign pop       = {move && prefer_b, move && !prefer_b};

  assign finish_pop  = list_done && out_ready_i;
  assign out_valid_o = (!Select || cut_q == NONE) && (list_done || (can && may && !drop));
  assign out_end_o   = list_done;
  assign out_entry_o = prefer_b ? head_q[1] : head_q[0];

  // B had nothing of this list.
  logic second_d, second_q;

  assign second_d   = !finish_pop && !clear_i && (second_q || pop[1]);
  assign out_flag_o = list_done ? finish.flag
                    : !second_q && (complete ? at_end[1] : only_q);

  // ---- selection ----------------------------------------------------------------------------------

  assign begins      = Select && cut_q == NONE && cut_i && !closed_i && !drop_i && !complete &&
                       write_at_q == limit_at_q;
  assign counted_all = Select && cut_q == COUNT && move && counted_q == '1;
  assign busy_o      = Select && cut_q != NONE;
  assign limit_o     = counted_all;
  assign done_o      = Select && cut_q == MOVE && pair_done;

  always_comb begin
    cut_d     = cut_q;
    counted_d = cut_q == COUNT && move ? counted_q + 1'b1 : counted_q;
    if (begins) begin
      cut_d     = COUNT;
      counted_d = '0;
    end
    if (counted_all) begin
      cut_d = MOVE;
    end
    if (done_o || clear_i) begin
      cut_d = NONE;
    end
  end

  always_comb begin
    for (int unsigned s = 0; s < 2; s++) begin
      head_at_d[s]    = pop[s] ? head_passed[s] : head_at_q[s];
      fetch_at_d[s]   = fetch[s] ? fetch_at_q[s] + 1'b1 : fetch_at_q[s];
      read_valid_d[s] = fetch[s] || (read_valid_q[s] && !load[s]);
      head_valid_d[s] = load[s] || (head_valid_q[s] && !pop[s]);
      write_at_d[s]   = write[s] ? write_at_q[s] + 1'b1 : write_at_q[s];
      limit_at_d[s]   = limit_at_q[s];
      if (drop) begin
        head_at_d[s]    = complete ? finish.place[s] : write_at_q[s];
        fetch_at_d[s]   = head_at_d[s];
        read_valid_d[s] = 1'b0;
        head_valid_d[s] = 1'b0;
      end
      if (finish_pop) begin
        limit_at_d[s] = finish.place[s] + place_t'(Run);
      end else if (pair_done && !list_done) begin
        limit_at_d[s] = limit_at_q[s] + place_t'(Run);
      end
      if (counted_all) begin
        // Back to the run's beginning; what was not counted is no more.
        head_at_d[s]    = limit_at_q[s] - place_t'(Run);
        fetch_at_d[s]   = head_at_d[s];
        read_valid_d[s] = 1'b0;
        head_valid_d[s] = 1'b0;
        limit_at_d[s]   = pop[s] ? head_passed[s] : head_at_q[s];
        write_at_d[s]   = pop[s] ? head_passed[s] : head_at_q[s];
      end
      if (clear_i) begin
        head_at_d[s]    = '0;
        fetch_at_d[s]   = '0;
        read_valid_d[s] = 1'b0;
        head_valid_d[s] = 1'b0;
        write_at_d[s]   = '0;
        limit_at_d[s]   = place_t'(Run);
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      side_q       <= 1'b0;
      taken_q      <= '0;
      only_q       <= 1'b0;
      head_at_q    <= '0;
      fetch_at_q   <= '0;
      read_valid_q <= '0;
      head_valid_q <= '0;
      write_at_q   <= '0;
      limit_at_q   <= {2{place_t'(Run)}};
      second_q     <= 1'b0;
      cut_q        <= NONE;
      counted_q    <= '0;
    end else begin
      side_q       <= side_d;
      taken_q      <= taken_d;
      only_q       <= only_d;
      head_at_q    <= head_at_d;
      fetch_at_q   <= fetch_at_d;
      read_valid_q <= read_valid_d;
      head_valid_q <= head_valid_d;
      write_at_q   <= write_at_d;
      limit_at_q   <= limit_at_d;
      second_q     <= second_d;
      cut_q        <= cut_d;
      counted_q    <= counted_d;
    end
  end

  assign drop_o  = drop_i && finish_empty && (!Select || cut_q == NONE);
  assign empty_o = finish_empty && write_at_q == head_at_q && (!Select || cut_q == NONE);

`ifndef SYNTHESIS
  for (genvar s = 0; s < 2; s++) begin : gen_check_side
    place_t held;
    assign held = write_at_q[s] - head_at_q[s];
    assert property (@(posedge clk_i) disable iff (!rst_ni) 32'(held) <= Depth)
    else $error("flk_sort_merge: more entries than Depth");
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        fetch[s] && write[s] |-> write_at_q[s][SlotBits-1:0] != fetch_at_q[s][SlotBits-1:0])
    else $error("flk_sort_merge: read where it is written");
  end
`endif

endmodule
