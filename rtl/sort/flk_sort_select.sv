// Last step of sorting: a list's sorted runs of Run entries into one, Ways at a time.
//
// A list is up to Ways Run entries, in runs of Run, the last one perhaps shorter, then an element with
// in_end_i (no entry; in_flag_i goes with it and leaves as out_flag_o). The smallest head of all runs leaves, by the
// upper KeyBits (unsigned), through a tree of comparisons with registers between its levels. Nothing of a list
// leaves before closed_i (its end is on the way) or its end. in_flag_i with an entry: the list has no other
// run. Behind the list that leaves up to Lists - 1 whole lists, two at least, and the one that arrives wait.
//
// All entries lie in one memory of Ways Run places, in blocks of Block. A list takes a block for each Block entries, as
// they come; a block whose entries have been read is free for the next list, so that a list comes in as
// the one before it leaves. Blocks are numbered in the order in which lists take them; a memory says where each
// one lies (blocks between the oldest that has not been read and the newest: at most twice as many as there are).
// One entry a cycle is read for all runs; in front of the tree each run has three registers. A run
// that has been read goes on to the next list's.
//
// Throughput: an entry a cycle, a list of n entries in n + 4 cycles. Latency: an entry is at
// the root $clog2(Ways) + 5 cycles after it was taken, if it is the first of its block. Handshakes:
// in_ready_o comes from registers; out_valid_o from registers, drop_i and closed_i; out_ready_i reaches
// the registers below the root. clear_i (synchronous) empties it.
// drop_i: what there is of the list that leaves is left out, a block a cycle, its end leaves; drop_o: what
// arrives at the input belongs to this list too, and is not kept. empty_o: no entry and no end inside.
module flk_sort_select #(
  parameter  int unsigned Run         = 256,  // entries
  parameter  int unsigned Ways        = 8,
  parameter  int unsigned Block       = 32,   // entries, at most Run
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
  if (Block < 2 || (Block & (Block - 1)) != 0 || Block > Run) begin : gen_check_block
    $error("flk_sort_select: Block must be a power of two, 2 to Run");
  end
  if (Lists < 2) begin : gen_check_lists
    $error("flk_sort_select: Lists must be at least 2");
  end

  localparam int unsigned RunBits   = $clog2(Run);
  localparam int unsigned WayBits   = $clog2(Ways);
  localparam int unsigned AtBits    = RunBits + WayBits;  // of a list's entry
  localparam int unsigned OffBits   = $clog2(Block);
  localparam int unsigned BlockBits = AtBits - OffBits;
  localparam int unsigned Blocks    = 1 << BlockBits;
  localparam int unsigned RingBits  = BlockBits + 1;
  localparam int unsigned Held      = 3;  // of a run, in front of the tree

  typedef logic [EntryBits-1:0] entry_t;
  typedef logic [BlockBits-1:0] block_t;  // where it lies
  // Of a block in the order of taking, with a bit that says how often it has gone round.
  typedef logic [RingBits:0] number_t;
  typedef logic [AtBits:0] length_t;
  typedef logic [RunBits:0] run_t;        // 0 to Run
  typedef logic [1:0] held_t;             // 0 to Held

  typedef struct packed {
    logic    flag;
    number_t first;   // block
    length_t length;
  } list_t;

  logic drop;

  // ---- input --------------------------------------------------------------------------------------

  list_t   coming;                // the list that arrives, so far
  length_t length_q;
  number_t first_q, next_q;       // its first block, the next one to be taken
  number_t oldest;                // block that may still be read
  block_t  block_q;               // its last one
  logic    only_q;                // it has no other run
  logic    take, take_end, store, begins, begin_block;
  block_t  to;

  logic [BlockBits:0] unused_q;   // blocks that were never taken, from here on
  logic               free_valid, free_ready, block_valid, ring_full;
  block_t             free_block, block;

  logic  front_valid_q;
  list_t front_q;                 // the list that leaves, when its end is here
  logic  behind_valid_q;
  list_t behind_q;                // the next one, likewise
  logic  queue_ready, finish_pop;

  assign coming = '{flag: in_flag_i, first: first_q, length: length_q};

  // A list that fills the memory needs no block more: its end follows.
  assign begins      = length_q[OffBits-1:0] == '0 && !length_q[AtBits];
  assign block_valid = (!unused_q[BlockBits] || free_valid) && !ring_full;
  assign block       = unused_q[BlockBits] ? free_block : block_t'(unused_q);
  assign in_ready_o  = queue_ready && (!begins || block_valid);
  assign take        = in_valid_i && in_ready_o && !in_end_i;
  assign take_end    = in_valid_i && in_ready_o && in_end_i;
  assign store       = take && !drop_o;
  assign begin_block = store && begins;
  assign free_ready  = begin_block && unused_q[BlockBits];
  assign to          = begins ? block : block_q;
  assign oldest      = front_valid_q ? front_q.first : first_q;
  assign ring_full   = next_q == {~oldest[RingBits], oldest[RingBits-1:0]};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      length_q <= '0;
      first_q  <= '0;
      next_q   <= '0;
      only_q   <= 1'b0;
      unused_q <= '0;
    end else if (clear_i) begin
      length_q <= '0;
      first_q  <= '0;
      next_q   <= '0;
      only_q   <= 1'b0;
      unused_q <= '0;
    end else begin
      if (store) begin
        length_q <= length_q + 1'b1;
        only_q   <= in_flag_i;
      end
      if (begin_block) begin
        next_q <= next_q + 1'b1;
      end
      if (begin_block && !unused_q[BlockBits]) begin
        unused_q <= unused_q + 1'b1;
      end
      if (take_end) begin
        length_q <= '0;
        first_q  <= next_q;
        only_q   <= 1'b0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (begin_block) begin
      block_q <= block;
    end
  end

  // ---- whole lists ----------------------------------------------------------------------------------

  localparam int unsigned Queued = Lists > 3 ? Lists - 2 : 1;

  logic [$clog2(Queued+1)-1:0] unused_usage;
  logic                        unused_full, unused_empty;
  logic                        to_front, to_behind, queue_valid, queue_push, queue_pop;
  list_t                       queued;

  // A place that the place before it does not fill takes the list that has just come.
  assign to_front   = !front_valid_q || (finish_pop && !behind_valid_q);
  assign to_behind  = !to_front && (!behind_valid_q || finish_pop);
  assign queue_push = take_end && !to_front && !(to_behind && !queue_valid);
  assign queue_pop  = to_behind && queue_valid;

  flk_fifo #(
    .Width($bits(list_t)),
    .Depth(Queued)
  ) i_queue (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (queue_push),
    .in_ready_o (queue_ready),
    .in_data_i  (coming),
    .out_valid_o(queue_valid),
    .out_ready_i(queue_pop),
    .out_data_o (queued),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (unused_empty)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      front_valid_q  <= 1'b0;
      behind_valid_q <= 1'b0;
    end else if (clear_i) begin
      front_valid_q  <= 1'b0;
      behind_valid_q <= 1'b0;
    end else begin
      if (to_front) begin
        front_valid_q <= take_end;
      end
      if (to_behind) begin
        behind_valid_q <= queue_valid || take_end;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (finish_pop && behind_valid_q) begin
      front_q <= behind_q;
    end else if (to_front) begin
      front_q <= coming;
    end
    if (to_behind) begin
      behind_q <= queue_valid ? queued : coming;
    end
  end

  // ---- runs -----------------------------------------------------------------------------------------

  // Of the list that leaves, or with ahead of the one behind it: entries read, the block that they are in and the next
  // one; entries under way and in front of the tree, and those of them that are of the list behind.
  logic   [Ways-1:0] ahead_q;
  run_t   [Ways-1:0] at_q;
  logic   [Ways-1:0] block_valid_q, later_valid_q, asked_q;
  block_t [Ways-1:0] run_block_q, run_later_q;
  held_t  [Ways-1:0] held_q, held_ahead_q, here_q;

  number_t           leaving_first, following_first;
  length_t           leaving_length, following_length;
  logic   [Ways-1:0] unread, known, last, fetches, skips, looks, fetch, skip, look, ends, over, pop;
  run_t   [Ways-1:0] look_at;
  logic              any_fetch, any_look;

  assign leaving_first    = oldest;
  assign leaving_length   = front_valid_q ? front_q.length : length_q;
  assign following_first  = behind_valid_q ? behind_q.first : first_q;
  assign following_length = behind_valid_q ? behind_q.length : length_q;

  always_comb begin
    for (int unsigned w = 0; w < Ways; w++) begin
      length_t length;
      length   = ahead_q[w] ? following_length : leaving_length;
      known[w] = ahead_q[w] ? behind_valid_q : front_valid_q;
      // Entries of the run that have come and not been read; blocks of it that have no place here.
      unread[w]  = !at_q[w][RunBits] && {1'b0, WayBits'(w), at_q[w][RunBits-1:0]} < length;
      look_at[w] = at_q[w];
      if (block_valid_q[w]) begin
        look_at[w] = (at_q[w] | run_t'(Block - 1)) + 1'b1;
      end
      looks[w]   = !later_valid_q[w] && !asked_q[w] && !look_at[w][RunBits] &&
                   {1'b0, WayBits'(w), look_at[w][RunBits-1:0]} < length;
      fetches[w] = block_valid_q[w] && unread[w] && held_q[w] != held_t'(Held) &&
                   !(drop && !ahead_q[w]);
      last[w]    = at_q[w][OffBits-1:0] == '1;
      skips[w]   = block_valid_q[w] && known[w] && (!unread[w] || (drop && !ahead_q[w]));
    end
  end

  function automatic logic [Ways-1:0] first(logic [Ways-1:0] some);
    for (int unsigned w = 0; w < Ways; w++) begin
      first[w] = some[w] && (some & ((Ways'(1) << w) - 1'b1)) == '0;
    end
  endfunction

  assign any_fetch = fetches != '0;
  assign any_look  = looks != '0;
  assign fetch     = first(fetches);
  assign skip      = any_fetch ? '0 : first(skips);
  assign look      = first(looks);
  assign ends      = skip | (fetch & last);

  block_t                     from;
  logic [OffBits-1:0]         from_at;
  number_t                    look_number;
  block_t                     looked;
  logic                       read_valid_q;
  logic [Ways-1:0]            read_q;  // whose entry comes
  entry_t                     read;

  always_comb begin
    from        = '0;
    from_at     = '0;
    look_number = '0;
    for (int unsigned w = 0; w < Ways; w++) begin
      if (fetch[w] || skip[w]) begin
        from    |= run_block_q[w];
        from_at |= at_q[w][OffBits-1:0];
      end
      if (look[w]) begin
        look_number |= (ahead_q[w] ? following_first : leaving_first) +
                       number_t'(32'({WayBits'(w), look_at[w][RunBits-1:0]}) >> OffBits);
      end
    end
  end

  flk_sram #(
    .Width(EntryBits),
    .Depth(Run * Ways)
  ) i_entries (
    .clk_i,
    .wr_en_i  (store),
    .wr_addr_i({to, length_q[OffBits-1:0]}),
    .wr_data_i(in_entry_i),
    .rd_en_i  (any_fetch),
    .rd_addr_i({from, from_at}),
    .rd_data_o(read)
  );

  flk_sram #(
    .Width(BlockBits),
    .Depth(2 * Blocks)
  ) i_places (
    .clk_i,
    .wr_en_i  (begin_block),
    .wr_addr_i(next_q[RingBits-1:0]),
    .wr_data_i(block),
    .rd_en_i  (any_look),
    .rd_addr_i(look_number[RingBits-1:0]),
    .rd_data_o(looked)
  );

  logic   unused_free_ready, unused_free_empty, freed_q;
  block_t freed_block_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      freed_q <= 1'b0;
    end else begin
      freed_q <= ends != '0 && !clear_i;
    end
  end

  always_ff @(posedge clk_i) begin
    freed_block_q <= from;
  end

  flk_sram_fifo #(
    .Width(BlockBits),
    .Depth(Blocks)
  ) i_free (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (freed_q),
    .in_ready_o (unused_free_ready),
    .in_data_i  (freed_block_q),
    .out_valid_o(free_valid),
    .out_ready_i(free_ready),
    .out_data_o (free_block),
    .empty_o    (unused_free_empty)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      read_valid_q <= 1'b0;
    end else begin
      read_valid_q <= any_fetch && !clear_i;
    end
  end

  always_ff @(posedge clk_i) begin
    read_q <= fetch;
  end

  for (genvar w = 0; w < Ways; w++) begin : gen_run
    run_t   at_d;
    logic   block_valid_d, later_valid_d;
    block_t block_d, later_d;
    held_t  held_d, held_ahead_d, here_d;
    logic   moves;  // to the list behind: all of this one is read

    assign moves   = !ahead_q[w] && front_valid_q && !unread[w] && !block_valid_q[w];
    assign over[w] = held_q[w] == held_ahead_q[w] &&
                     (front_valid_q ? ahead_q[w] : at_q[w][RunBits] || (only_q && w != 0));

    always_comb begin
      at_d = at_q[w];
      if (fetch[w]) begin
        at_d = at_q[w] + 1'b1;
      end
      if (skip[w]) begin
        at_d = look_at[w];
      end
      if (moves) begin
        at_d = '0;
      end

      block_valid_d = block_valid_q[w];
      later_valid_d = later_valid_q[w];
      block_d       = run_block_q[w];
      later_d       = run_later_q[w];
      if (ends[w]) begin
        block_valid_d = later_valid_q[w];
        block_d       = run_later_q[w];
        later_valid_d = 1'b0;
      end
      if (asked_q[w]) begin
        if (block_valid_d) begin
          later_valid_d = 1'b1;
          later_d       = looked;
        end else begin
          block_valid_d = 1'b1;
          block_d       = looked;
        end
      end

      held_d       = held_q[w] + held_t'(fetch[w]) - held_t'(pop[w]);
      here_d       = here_q[w] + held_t'(read_valid_q && read_q[w]) - held_t'(pop[w]);
      held_ahead_d = finish_pop ? '0 : held_ahead_q[w] + held_t'(fetch[w] && ahead_q[w]);
    end

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        ahead_q[w]       <= 1'b0;
        at_q[w]          <= '0;
        block_valid_q[w] <= 1'b0;
        later_valid_q[w] <= 1'b0;
        asked_q[w]       <= 1'b0;
        held_q[w]        <= '0;
        held_ahead_q[w]  <= '0;
        here_q[w]        <= '0;
      end else if (clear_i) begin
        ahead_q[w]       <= 1'b0;
        at_q[w]          <= '0;
        block_valid_q[w] <= 1'b0;
        later_valid_q[w] <= 1'b0;
        asked_q[w]       <= 1'b0;
        held_q[w]        <= '0;
        held_ahead_q[w]  <= '0;
        here_q[w]        <= '0;
      end else begin
        ahead_q[w]       <= (ahead_q[w] || moves) && !finish_pop;
        at_q[w]          <= at_d;
        block_valid_q[w] <= block_valid_d;
        later_valid_q[w] <= later_valid_d;
        asked_q[w]       <= look[w];
        held_q[w]        <= held_d;
        held_ahead_q[w]  <= held_ahead_d;
        here_q[w]        <= here_d;
      end
    end

    always_ff @(posedge clk_i) begin
      run_block_q[w] <= block_d;
      run_later_q[w] <= later_d;
    end
  end

  // ---- tree -----------------------------------------------------------------------------------------

  // Node 1 is the root, those below node n are 2 n and 2 n + 1, Ways and on are the runs.
  logic move;

  for (genvar n = 1; n < 2 * Ways; n++) begin : gen_node
    logic   valid, take_it;
    logic   done;  // nothing of the list that leaves is left here, or comes
    entry_t entry;

    if (n == 1) begin : gen_taken
      assign take_it = move;
    end else begin : gen_below
      assign take_it = gen_node[n/2].gen_choice.take_below[n%2];
    end

    if (n < Ways) begin : gen_choice
      logic   [1:0] valid_below, done_below, take_below;
      entry_t [1:0] entry_below;
      logic         less, prefer_b, can, load;  // can: there is an entry to choose

      assign valid_below = {gen_node[2*n+1].valid, gen_node[2*n].valid};
      assign done_below  = {gen_node[2*n+1].done, gen_node[2*n].done};
      assign entry_below = {gen_node[2*n+1].entry, gen_node[2*n].entry};

      assign less       = entry_below[1][EntryBits-1:PayloadBits] <
                          entry_below[0][EntryBits-1:PayloadBits];
      assign prefer_b   = done_below[0] || (less && !done_below[1]);
      assign can        = (valid_below | done_below) == '1 && done_below != '1;
      assign take_below = {load && prefer_b, load && !prefer_b};

      if (n == 1) begin : gen_root
        assign load  = take_it;
        assign valid = can;
        assign done  = done_below == '1;
        assign entry = entry_below[prefer_b];
      end else begin : gen_inner
        logic ready;

        assign load = can && ready && !drop;
        assign done = !valid && done_below == '1;

        // Below the root a buffer that cuts the way of out_ready_i.
        if (n < 4) begin : gen_cut
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
            .out_ready_i(take_it),
            .out_data_o (entry)
          );
        end else begin : gen_register
          flk_pipe_reg #(
            .Width(EntryBits)
          ) i_node (
            .clk_i,
            .rst_ni,
            .clear_i    (clear_i || drop),
            .in_valid_i (can),
            .in_ready_o (ready),
            .in_data_i  (entry_below[prefer_b]),
            .out_valid_o(valid),
            .out_ready_i(take_it),
            .out_data_o (entry)
          );
        end
      end
    end else begin : gen_side
      localparam int unsigned W = n - Ways;

      entry_t [Held-1:0] waits_q;
      held_t             to_at;  // the entry that comes

      // What is left out goes from here one by one.
      assign pop[W] = drop ? here_q[W] != '0 && held_q[W] != held_ahead_q[W] : take_it;
      assign to_at  = here_q[W] - held_t'(pop[W]);
      assign valid  = here_q[W] != '0;
      assign done   = over[W];
      assign entry  = waits_q[0];

      always_ff @(posedge clk_i) begin
        for (int unsigned i = 0; i < Held; i++) begin
          if (read_valid_q && read_q[W] && to_at == held_t'(i)) begin
            waits_q[i] <= read;
          end else if (pop[W] && i + 1 < Held) begin
            waits_q[i] <= waits_q[(i+1)%Held];
          end
        end
      end
    end
  end

  // ---- output ---------------------------------------------------------------------------------------

  logic list_done, may;

  assign list_done = front_valid_q && gen_node[1].done;
  assign may       = front_valid_q || closed_i;
  assign drop      = drop_i && !list_done;
  assign move      = gen_node[1].valid && may && !drop && out_ready_i;

  assign finish_pop  = list_done && out_ready_i;
  assign out_valid_o = list_done || (gen_node[1].valid && may && !drop);
  assign out_end_o   = list_done;
  assign out_flag_o  = front_q.flag;
  assign out_entry_o = gen_node[1].entry;

  assign drop_o  = drop_i && !front_valid_q;
  assign empty_o = !front_valid_q && length_q == '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) store |-> !length_q[AtBits])
  else $error("flk_sort_select: more entries than fit");
  assert property (@(posedge clk_i) disable iff (!rst_ni) freed_q |-> unused_free_ready)
  else $error("flk_sort_select: more blocks free than there are");
  for (genvar w = 0; w < Ways; w++) begin : gen_checks
    assert property (@(posedge clk_i) disable iff (!rst_ni) pop[w] |-> here_q[w] != '0)
    else $error("flk_sort_select: an entry taken that is not there");
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        finish_pop |-> ahead_q[w] && held_q[w] == held_ahead_q[w])
    else $error("flk_sort_select: a list ends before all of it is read");
  end
`endif

endmodule
