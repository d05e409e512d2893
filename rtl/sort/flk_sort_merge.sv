// A step of sorting: a list's sorted runs of Run entries, two by two, into runs of twice as many.
//
// A list is runs of Run entries, the last one perhaps shorter, then an element with in_end_i (no
// entry; in_flag_i goes with it). Runs go to two memories in turn, A first; the smaller of the two
// heads leaves, by the upper KeyBits (unsigned). A run without a second leaves as it is, once the
// list's end or in_flag_i with one of its entries says that none comes; out_flag_o says the same of
// the output's runs. Behind the list that leaves up to Lists whole lists and the one that arrives wait.
// Throughput: an entry a cycle. Latency: an entry is at its side's head three cycles after it was
// taken. Handshakes: in_ready_o comes from registers; out_valid_o from registers and drop_i;
// out_ready_i reaches the memories' read ports. clear_i (synchronous) empties it.
// drop_i: what there is of the list that leaves is left out, its end leaves; drop_o: what arrives at
// the input belongs to this list too. empty_o: no entry and no end inside.
module flk_sort_merge #(
  parameter  int unsigned Run         = 16,
  parameter  int unsigned Depth       = Run,  // entries of a memory: Run, 2 Run, 4 Run, ...
  parameter  int unsigned KeyBits     = 48,
  parameter  int unsigned PayloadBits = 4,
  parameter  int unsigned Lists       = 8,
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
  output logic                 empty_o
);

  if (Run < 2 || (Run & (Run - 1)) != 0) begin : gen_check
    $error("flk_sort_merge: Run must be a power of two, at least 2");
  end
  if (Depth < Run || (Depth & (Depth - 1)) != 0) begin : gen_check_depth
    $error("flk_sort_merge: Depth must be a power of two, at least Run");
  end

  localparam int unsigned SlotBits = $clog2(Depth);
  localparam int unsigned RunBits  = $clog2(Run);

  // Of a memory, with a bit that says how often it has gone round.
  typedef logic [SlotBits:0] place_t;

  typedef struct packed {
    logic         flag;
    place_t [1:0] place;  // behind its last entry, in both memories
  } finish_t;

  // A is 0, B is 1.
  place_t [1:0]                head_at, write_at;
  place_t [1:0]                limit_at_d, limit_at_q;  // behind the present run
  logic   [1:0]                head_valid, full;
  logic   [1:0][EntryBits-1:0] head;
  logic   [1:0]                at_limit, at_end, over, pop;
  logic                        complete, finish_pop, finish_ready, finish_empty;
  finish_t                     finish;
  logic                        pair_done, list_done, less, prefer_b, can, move, drop;

  // ---- input --------------------------------------------------------------------------------------

  logic               side_d, side_q;  // which memory's turn it is
  logic [RunBits-1:0] taken_d, taken_q;  // entries of the run
  logic               only_d, only_q;   // the list that arrives has no second run
  logic               take, take_end;

  assign in_ready_o = !full[side_q] && finish_ready;
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
    .in_data_i  ({in_flag_i, write_at}),
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
    if (clear_i) begin
      taken_d = '0;
      side_d  = 1'b0;
      only_d  = 1'b0;
    end
  end

  // ---- memories -----------------------------------------------------------------------------------

  for (genvar s = 0; s < 2; s++) begin : gen_side
    flk_sort_memory #(
      .Width(EntryBits),
      .Depth(Depth)
    ) i_side (
      .clk_i,
      .rst_ni,
      .clear_i,
      .write_i     (take && side_q == 1'(s)),
      .data_i      (in_entry_i),
      .full_o      (full[s]),
      .write_at_o  (write_at[s]),
      .head_valid_o(head_valid[s]),
      .head_o      (head[s]),
      .head_at_o   (head_at[s]),
      .pop_i       (pop[s]),
      .jump_i      (drop),
      .jump_at_i   (complete ? finish.place[s] : write_at[s])
    );

    assign at_limit[s] = head_at[s] == limit_at_q[s];
    assign at_end[s]   = complete && head_at[s] == finish.place[s];
  end

  // ---- choice -------------------------------------------------------------------------------------

  // Both runs have left: the next two begin in the same cycle. over: the run has left, or there is none.
  assign pair_done = at_limit == '1;
  assign list_done = at_end == '1;
  assign less      = head[1][EntryBits-1:PayloadBits] < head[0][EntryBits-1:PayloadBits];
  assign over[0]   = at_end[0] || (at_limit[0] && !pair_done);
  assign over[1]   = at_end[1] || (at_limit[1] && !pair_done) || (!complete && only_q);
  assign drop      = drop_i && !list_done;

  // What does not wait for the comparison: there is an entry to choose, and it is taken.
  assign can       = (head_valid | over) == '1 && over != '1;
  assign prefer_b  = over[0] || (less && !over[1]);
  assign move      = can && !drop && out_ready_i;
  assign pop       = {move && prefer_b, move && !prefer_b};

  assign finish_pop  = list_done && out_ready_i;
  assign out_valid_o = list_done || (can && !drop);
  assign out_end_o   = list_done;
  assign out_entry_o = prefer_b ? head[1] : head[0];

  // B had nothing of this list.
  logic second_d, second_q;

  assign second_d   = !finish_pop && !clear_i && (second_q || pop[1]);
  assign out_flag_o = list_done ? finish.flag
                    : !second_q && (complete ? at_end[1] : only_q);

  always_comb begin
    limit_at_d = limit_at_q;
    for (int unsigned s = 0; s < 2; s++) begin
      if (finish_pop) begin
        limit_at_d[s] = finish.place[s] + place_t'(Run);
      end else if (pair_done && !list_done) begin
        limit_at_d[s] = limit_at_q[s] + place_t'(Run);
      end
      if (clear_i) begin
        limit_at_d[s] = place_t'(Run);
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      side_q     <= 1'b0;
      taken_q    <= '0;
      only_q     <= 1'b0;
      limit_at_q <= {2{place_t'(Run)}};
      second_q   <= 1'b0;
    end else begin
      side_q     <= side_d;
      taken_q    <= taken_d;
      only_q     <= only_d;
      limit_at_q <= limit_at_d;
      second_q   <= second_d;
    end
  end

  assign drop_o  = drop_i && finish_empty;
  assign empty_o = finish_empty && write_at == head_at;

endmodule
