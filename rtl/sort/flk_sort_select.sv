// Last step of sorting: a list's sorted runs of Run entries into one, Ways at a time.
//
// A list is up to Ways Run entries, in runs of Run, the last one perhaps shorter, then an element with
// in_end_i (no entry; in_flag_i goes with it and leaves as out_flag_o). Runs go to Ways memories in turn,
// from the one behind the last list's; the smallest head leaves, by the upper KeyBits (unsigned), through
// a tree of comparisons with registers between its levels. Nothing of a list leaves before closed_i (its
// end is on the way) or its end. in_flag_i with an entry: the list has no other run. Behind the list that leaves up to
// Lists whole lists and the one that arrives wait.
// Throughput: an entry a cycle, a list of n entries in n + $clog2(Ways) cycles, where its memories have
// room. Latency: an entry is at the root $clog2(Ways) + 2 cycles after it was taken. Handshakes:
// in_ready_o comes from registers; out_valid_o from registers, drop_i and closed_i; out_ready_i reaches
// the registers below the root, with two ways the memories' read ports. clear_i (synchronous) empties it.
// drop_i: what there is of the list that leaves is left out, its end leaves; drop_o: what arrives at the
// input belongs to this list too. empty_o: no entry and no end inside.
module flk_sort_select #(
  parameter  int unsigned Run         = 1024,  // entries of a memory
  parameter  int unsigned Ways        = 2,
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
  output logic                 empty_o,
  input  logic                 closed_i
);

  if (Run < 2 || (Run & (Run - 1)) != 0) begin : gen_check
    $error("flk_sort_select: Run must be a power of two, at least 2");
  end
  if (Ways < 2 || (Ways & (Ways - 1)) != 0) begin : gen_check_ways
    $error("flk_sort_select: Ways must be a power of two, at least 2");
  end

  localparam int unsigned RunBits   = $clog2(Run);
  localparam int unsigned WayBits   = $clog2(Ways);
  localparam int unsigned CountBits = RunBits + WayBits + 1;

  typedef logic [RunBits:0] place_t;  // with a bit that says how often a memory has gone round
  typedef logic [RunBits:0] run_t;    // 0 to Run
  typedef logic [EntryBits-1:0] entry_t;

  // Of a list: memories that it fills, the one that it begins last, and its entries there.
  typedef struct packed {
    logic               flag;
    logic [Ways-1:0]    whole;
    logic [Ways-1:0]    part;
    logic [RunBits-1:0] rest;
  } finish_t;

  // ---- input --------------------------------------------------------------------------------------

  logic [CountBits-1:0] length_d, length_q;  // entries of the list that arrives
  logic [WayBits-1:0]   first_d, first_q;    // its first memory
  logic                 only_d, only_q;      // it has no other run
  logic                 take, take_end;
  logic [WayBits-1:0]   side;
  logic [Ways-1:0]      full;
  logic                 complete, finish_pop, finish_ready, finish_empty;
  finish_t              taken, finish;

  assign side       = first_q + length_q[RunBits+:WayBits];
  assign in_ready_o = !full[side] && finish_ready;
  assign take       = in_valid_i && in_ready_o && !in_end_i;
  assign take_end   = in_valid_i && in_ready_o && in_end_i;

  always_comb begin
    taken.flag = in_flag_i;
    taken.rest = length_q[RunBits-1:0];
    for (int unsigned s = 0; s < Ways; s++) begin
      logic [WayBits-1:0] turn;
      turn           = WayBits'(s) - first_q;
      taken.whole[s] = {1'b0, turn} < length_q[CountBits-1:RunBits];
      taken.part[s]  = {1'b0, turn} == length_q[CountBits-1:RunBits];
    end
  end

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
    .in_data_i  (taken),
    .out_valid_o(complete),
    .out_ready_i(finish_pop),
    .out_data_o (finish),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (finish_empty)
  );

  always_comb begin
    length_d = length_q;
    first_d  = first_q;
    only_d   = only_q;
    if (take) begin
      length_d = length_q + 1'b1;
      only_d   = in_flag_i;
    end
    if (take_end || clear_i) begin
      length_d = '0;
      first_d  = clear_i ? '0 : length_q[RunBits-1:0] == '0 ? side : side + 1'b1;
      only_d   = 1'b0;
    end
  end

  // ---- tree -----------------------------------------------------------------------------------------

  // Node 1 is the root, those below node n are 2 n and 2 n + 1, Ways and on are the memories.
  logic drop, move;

  for (genvar n = 1; n < 2 * Ways; n++) begin : gen_node
    logic               valid, pop;
    logic               over;  // nothing of the list that leaves is left here, or comes
    entry_t             entry;

    if (n == 1) begin : gen_taken
      assign pop = move;
    end else begin : gen_pop
      assign pop = gen_node[n/2].gen_choice.pop_below[n%2];
    end

    if (n < Ways) begin : gen_choice
      logic [1:0]               valid_below, over_below, pop_below;
      entry_t [1:0]             entry_below;
      logic                     less, prefer_b, can, load;  // can: there is an entry to choose

      assign valid_below = {gen_node[2*n+1].valid, gen_node[2*n].valid};
      assign over_below  = {gen_node[2*n+1].over, gen_node[2*n].over};
      assign entry_below = {gen_node[2*n+1].entry, gen_node[2*n].entry};

      assign less      = entry_below[1][EntryBits-1:PayloadBits] <
                         entry_below[0][EntryBits-1:PayloadBits];
      assign prefer_b  = over_below[0] || (less && !over_below[1]);
      assign can       = (valid_below | over_below) == '1 && over_below != '1;
      assign pop_below = {load && prefer_b, load && !prefer_b};

      if (n == 1) begin : gen_root
        assign load  = pop;
        assign valid = can;
        assign over  = over_below == '1;
        assign entry = entry_below[prefer_b];
      end else begin : gen_inner
        logic ready;

        assign load = can && ready;
        assign over = !valid && over_below == '1;

        flk_skid_buffer #(
          .Width(EntryBits)
        ) i_node (
          .clk_i,
          .rst_ni,
          .clear_i    (clear_i || drop),
          .in_valid_i (can),
          .in_ready_o (ready),
          .in_data_i  (entry_below[prefer_b]),
          .out_valid_o(valid),
          .out_ready_i(pop),
          .out_data_o (entry)
        );
      end
    end else begin : gen_side
      localparam int unsigned S = n - Ways;

      place_t head_at, write_at, jump_at;
      place_t begin_d, begin_q;    // of the list's first entry
      run_t   popped_d, popped_q;  // entries of the list that have left
      run_t   due;                 // of the whole list

      flk_sort_memory #(
        .Width(EntryBits),
        .Depth(Run)
      ) i_side (
        .clk_i,
        .rst_ni,
        .clear_i,
        .write_i     (take && side == WayBits'(S)),
        .data_i      (in_entry_i),
        .full_o      (full[S]),
        .write_at_o  (write_at),
        .head_valid_o(valid),
        .head_o      (entry),
        .head_at_o   (head_at),
        .pop_i       (pop),
        .jump_i      (drop),
        .jump_at_i   (jump_at)
      );

      assign due     = finish.whole[S] ? run_t'(Run) : finish.part[S] ? run_t'(finish.rest) : '0;
      assign jump_at = complete ? begin_q + due : write_at;

      always_comb begin
        if (!complete || finish.whole[S]) begin
          over = popped_q[RunBits] || (!complete && only_q && first_q != WayBits'(S));
        end else begin
          over = popped_q == (finish.part[S] ? run_t'(finish.rest) : '0);
        end
      end

      always_comb begin
        begin_d  = begin_q;
        popped_d = pop ? popped_q + 1'b1 : popped_q;
        if (drop && complete) begin
          popped_d = due;
        end
        if (finish_pop) begin
          begin_d  = head_at;
          popped_d = '0;
        end
        if (clear_i) begin
          begin_d  = '0;
          popped_d = '0;
        end
      end

      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          begin_q  <= '0;
          popped_q <= '0;
        end else begin
          begin_q  <= begin_d;
          popped_q <= popped_d;
        end
      end
    end
  end

  // ---- output ---------------------------------------------------------------------------------------

  logic list_done, may;

  assign list_done = complete && gen_node[1].over;
  assign may       = complete || closed_i;
  assign drop      = drop_i && !list_done;
  assign move      = gen_node[1].valid && may && !drop && out_ready_i;

  assign finish_pop  = list_done && out_ready_i;
  assign out_valid_o = list_done || (gen_node[1].valid && may && !drop);
  assign out_end_o   = list_done;
  assign out_flag_o  = finish.flag;
  assign out_entry_o = gen_node[1].entry;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      length_q  <= '0;
      first_q   <= '0;
      only_q    <= 1'b0;
    end else begin
      length_q  <= length_d;
      first_q   <= first_d;
      only_q    <= only_d;
    end
  end

  assign drop_o  = drop_i && finish_empty;
  assign empty_o = finish_empty && length_q == '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) take |-> !length_q[CountBits-1])
  else $error("flk_sort_select: more entries than fit");
`endif

endmodule
