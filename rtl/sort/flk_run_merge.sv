// Sorted runs in memory, their lines in the order of their last entries: what a sorting unit takes a second time
// (docs/reference/list_sorter.md).
//
// Runs come as first and last key and number of lines, number after number, when these are on their way to memory;
// run r lies from line RunLines r of base_i on, key and record of its entries exchanged. A run joins the first
// chain that it lies behind or before, else it begins one. begin_i, when no more come and all are in memory: lines are given, in batches. The line with
// the least last key of all chains is next; when a batch might not hold another line and one of each chain left,
// the next line of each chain is given with out_limited_o: entries above out_limit_o, the last key of the
// line given last, are not of this batch, and the line comes again. out_last_o: a batch's last line,
// with out_final_o the list's. stop_i, until done_o: nothing more is wanted; the batch ends with a line of
// count 0, which is the list's last. done_o, for a cycle: all is given and what was asked for has come; runs of
// another list may come. full_o: no run more fits.
// Lines of the line memory are shared out in equal parts to the chains and read ahead, up to Beats at a time.
// fault_o, for a cycle: the memory answered with an error, or what it gave is no line; what it gave counts as
// one entry. The read port never waits.
// A line every nine cycles with up to 16 chains, every eleven with 64, while its chain's next one has come.
module flk_run_merge
  import flk_axi_pkg::*;
#(
  parameter  int unsigned Runs        = 64,   // most runs of a list, a power of two
  parameter  int unsigned Lines       = 128,  // of the line memory, a power of two, at least 2 Runs
  parameter  int unsigned Capacity    = 2048,  // entries of a run, and of the largest batch
  parameter  int unsigned Beats       = 8,    // of a request
  parameter  int unsigned LineEntries = 9,    // of a plain line
  parameter  int unsigned ShortEntries = 15,
  parameter  int unsigned TailBits    = 4,    // of a short line, behind what a plain one has
  parameter  int unsigned EntryBits   = 52,
  parameter  int unsigned MaskBits    = 4,
  parameter  int unsigned Bursts      = 16,   // under way
  parameter  int unsigned Id          = 0,
  localparam int unsigned AddressBits = AXI_BEAT_BITS,  // of a line
  localparam int unsigned Width       = AXI_DATA_BITS,
  localparam int unsigned KeyBits     = EntryBits - MaskBits,
  localparam int unsigned LineBits    = LineEntries * EntryBits + TailBits,
  localparam int unsigned RunLines    = (Capacity + LineEntries - 1) / LineEntries,
  localparam int unsigned RunBits     = $clog2(RunLines + 1),
  localparam int unsigned Shift       = $clog2(Width / 8)
) (
  input  logic                                  clk_i,
  input  logic                                  rst_ni,
  input  logic [AddressBits-1:0]                base_i,
  output logic                                  idle_o,
  output logic                                  full_o,
  output logic                                  fault_o,
  // Runs
  input  logic                                  run_valid_i,
  output logic                                  run_ready_o,
  input  logic [KeyBits-1:0]                    run_first_i,
  input  logic [KeyBits-1:0]                    run_last_i,
  input  logic [RunBits-1:0]                    run_lines_i,
  // Merging
  input  logic                                  begin_i,
  input  logic                                  stop_i,
  output logic                                  done_o,
  output logic                                  out_valid_o,
  input  logic                                  out_ready_i,
  output logic [LineBits-1:0]                   out_entries_o,
  output logic [3:0]                            out_count_o,
  output logic                                  out_limited_o,
  output logic [KeyBits-1:0]                    out_limit_o,
  output logic                                  out_last_o,
  output logic                                  out_final_o,
  // AXI4
  output logic                                  ar_valid_o,
  input  logic                                  ar_ready_i,
  output axi_ax_t                               ar_o,
  input  logic                                  r_valid_i,
  output logic                                  r_ready_o,
  input  axi_r_t                                r_i
);

  localparam int unsigned RB = $clog2(Runs);       // number of a run, of a chain
  localparam int unsigned SB = $clog2(Lines);      // a place in the line memory
  localparam int unsigned LB = $clog2(RB + 1);     // levels of the tree
  localparam int unsigned NB = $clog2(Beats + 1);
  localparam int unsigned OB = $clog2(Runs * RunLines);  // a line from base_i on
  localparam int unsigned FB = $clog2(Capacity + 2);
  localparam int unsigned Half     = KeyBits / 2;         // bits of a record, of a key
  localparam int unsigned RestBits = LineBits - KeyBits;  // without the last key

  if (Runs < 2 || Runs != 1 << RB || Lines != 1 << SB || Lines < 2 * Runs) begin : gen_check
    $error("flk_run_merge: Runs and Lines must be powers of two, Lines at least twice Runs");
  end
  if (LineBits + 4 > Width || ShortEntries != 15) begin : gen_check_line
    $error("flk_run_merge: LineEntries and their number must fit a line");
  end
  if (Capacity < ShortEntries * (Runs + 1)) begin : gen_check_capacity
    $error("flk_run_merge: Capacity must hold a line of each run and one more");
  end

  typedef logic [KeyBits-1:0] key_t;
  typedef logic [RB-1:0] number_t;
  typedef logic [SB:0] place_t;  // of a chain's lines, modulo twice the line memory

  typedef struct packed {
    key_t               first;
    key_t               last;
    number_t            head;        // its first run
    logic [RunBits-1:0] head_lines;
    number_t            tail;        // its last one
  } chain_t;

  // The run behind a run.
  typedef struct packed {
    number_t            run;
    logic [RunBits-1:0] lines;
  } next_t;

  typedef struct packed {
    number_t            run;    // of the line to be asked for next
    logic [RunBits-1:0] line;
    logic [RunBits-1:0] left;   // of the run, with it
    logic               over;   // there is none
    place_t             asked;  // lines asked for
    place_t             used;   // lines used up
    logic [SB-1:0]      behind; // the place one further, so that it is known early
  } state_t;

  typedef enum logic [1:0] {NONE = 2'd0, KEY = 2'd1, END = 2'd2} kind_e;

  // Of a chain: the last key of its next line, smaller than all keys before the tree is whole, larger when there is none.
  typedef struct packed {
    kind_e   kind;
    key_t    key;
    number_t chain;
  } leaf_t;

  typedef struct packed {
    number_t            chain;
    logic [SB-1:0]      place;
  } tag_t;

  typedef enum logic [4:0] {
    BUILD,   // runs come
    SCAN,    // chains are looked at
    FOUND,   // one is read again, or there is none
    JOIN,    // it has the run
    CLEAR,   // nodes of the tree
    FILL,    // first lines of all chains, as many as have places
    LEAF,    // the chain's key comes into the tree
    CHOOSE,  // the next line is that of the winner
    GIVE,    // it is read
    UPDATE,  // of its chain
    WAIT,    // for the chain's next line
    LOAD,    // its key
    REPLAY,  // up the tree
    PEEK,    // the next line of a chain
    PEEKED,
    STOP,
    DRAIN
  } state_e;

  state_e              state_d, state_q;
  logic [RB:0]         runs_q, chains_q;  // numbers of them
  logic [RB:0]         live_q;            // chains with lines left
  logic [RB:0]         at_q;              // chain or node that is looked at
  logic [LB-1:0]       levels, levels_q;
  logic [RB:0]         leaves;            // 1 << levels
  leaf_t               winner_d, winner_q;  // whose line is next, or who goes up the tree

  // ---- chains ---------------------------------------------------------------------------------------

  logic    chain_read, chain_write, next_write, next_read;
  number_t chain_at, chain_to, next_at, next_to;
  next_t   next_run, next_data;
  chain_t  chain, chain_new;
  logic    seen_q;      // chain has been read
  number_t seen_at_q;   // its number
  logic    behind, ahead, taken;
  logic    found_q;     // the chain before it fits
  number_t found_at_q;
  logic    joins_q, behind_q;  // the run joins chain at_q, behind its last run

  flk_sram #(
    .Width($bits(chain_t)),
    .Depth(Runs)
  ) i_chains (
    .clk_i,
    .wr_en_i  (chain_write),
    .wr_addr_i(chain_to),
    .wr_data_i(chain_new),
    .rd_en_i  (chain_read),
    .rd_addr_i(chain_at),
    .rd_data_o(chain)
  );

  flk_sram #(
    .Width($bits(next_t)),
    .Depth(Runs)
  ) i_next (
    .clk_i,
    .wr_en_i  (next_write),
    .wr_addr_i(next_to),
    .wr_data_i(next_data),
    .rd_en_i  (next_read),
    .rd_addr_i(next_at),
    .rd_data_o(next_run)
  );

  assign behind = chain.last < run_first_i;
  assign ahead  = run_last_i < chain.first;
  assign taken  = state_q == JOIN;

  assign run_ready_o = taken;
  assign full_o      = runs_q[RB];

  always_comb begin
    chain_to  = number_t'(at_q);
    chain_new = chain;
    next_to   = chain.tail;
    next_data = '{run: number_t'(runs_q), lines: run_lines_i};
    if (!joins_q) begin
      chain_new = '{first: run_first_i, last: run_last_i, head: number_t'(runs_q),
                    head_lines: run_lines_i, tail: number_t'(runs_q)};
    end else if (behind_q) begin
      chain_new.last = run_last_i;
      chain_new.tail = number_t'(runs_q);
    end else begin
      chain_new.first      = run_first_i;
      chain_new.head       = number_t'(runs_q);
      chain_new.head_lines = run_lines_i;
      next_to              = number_t'(runs_q);
      next_data            = '{run: chain.head, lines: chain.head_lines};
    end
  end

  assign chain_write = taken;
  assign next_write  = taken && joins_q;

  always_comb begin
    levels = '0;
    for (int unsigned i = 0; i < RB; i++) begin
      if (32'(chains_q) > 1 << i) begin
        levels = LB'(i + 1);
      end
    end
  end

  assign leaves = (RB + 1)'(1) << levels_q;

  // ---- places ---------------------------------------------------------------------------------------

  place_t           slots_q, free, free_q;  // of a chain
  logic [SB-1:0]    slot_mask_q;
  logic [Lines-1:0] valid_q;

  // Chains side by side, lines of a chain in turn.
  function automatic logic [SB-1:0] place_of(number_t c, logic [SB-1:0] line,
                                             logic [LB-1:0] shift, logic [SB-1:0] mask);
    return SB'({c, SB'(0)} >> shift) | (line & mask);
  endfunction

  // ---- a chain's state ------------------------------------------------------------------------------

  logic               state_read, state_write;
  number_t            state_at;
  state_t             read_state, now, known_q, new_state;
  logic               first_q;   // FILL: chains have no state yet
  logic               filled_q;  // FILL: a chain in this round has places left
  logic [1:0]         step_q;    // FILL: of the chain
  logic [NB-1:0]      beats;
  logic [RunBits-1:0] left_q;
  logic               wants, ends, more;
  logic               give;      // the winner's line is read

  // What is known of the chain after UPDATE or FILL's step 2.
  logic               commit_q, commit_go, commit_ends_q;
  state_t             commit_state_q;
  number_t            commit_chain_q;
  next_t              commit_next_q;
  logic               commit_tail_q;
  logic [NB-1:0]      commit_beats_q;
  logic               ask_valid_q, ask_ready;
  logic [OB-1:0]      ask_line_q;
  logic [NB-1:0]      ask_beats_q;
  tag_t               ask_tag_q;

  flk_sram #(
    .Width($bits(state_t)),
    .Depth(Runs)
  ) i_states (
    .clk_i,
    .wr_en_i  (state_write),
    .wr_addr_i(commit_chain_q),
    .wr_data_i(new_state),
    .rd_en_i  (state_read),
    .rd_addr_i(state_at),
    .rd_data_o(read_state)
  );

  always_comb begin
    now = read_state;
    if (state_q == FILL && first_q) begin
      now = '{run: chain.head, line: '0, left: chain.head_lines, over: 1'b0, asked: '0, used: '0,
              behind: SB'(1)};
    end
    if (state_q == GIVE) begin
      now.used   = read_state.used + 1'b1;
      now.behind = read_state.behind + 1'b1;
    end
  end

  assign free = slots_q - (now.asked - now.used);

  // A step of its own, so that what follows begins with registers.
  always_ff @(posedge clk_i) begin
    if (give || (state_q == FILL && step_q == 2'd1)) begin
      known_q <= now;
      free_q  <= free;
      left_q  <= now.left;
    end
  end

  always_comb begin
    beats = NB'(Beats);
    if (32'(free_q) < 32'(beats)) begin
      beats = NB'(free_q);
    end
    if (32'(left_q) < 32'(beats)) begin
      beats = NB'(left_q);
    end
  end

  // A few lines at a time while others wait.
  assign wants = !known_q.over && free_q != '0 &&
                 (state_q == FILL || 32'(free_q) >= 4 || 32'(free_q) >= 32'(slots_q >> 2));
  assign ends  = 32'(left_q) == 32'(beats);
  assign more  = wants && 32'(free_q) != 32'(beats) && !(ends && known_q.run == chain.tail);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      commit_q    <= 1'b0;
      ask_valid_q <= 1'b0;
    end else begin
      if (state_q == UPDATE || (state_q == FILL && step_q == 2'd2 && !commit_q)) begin
        commit_q <= 1'b1;
      end else if (commit_go) begin
        commit_q <= 1'b0;
      end
      if (commit_go && commit_beats_q != '0) begin
        ask_valid_q <= 1'b1;
      end else if (ask_ready) begin
        ask_valid_q <= 1'b0;
      end
    end
  end

  assign commit_go   = commit_q && (commit_beats_q == '0 || !ask_valid_q || ask_ready);
  assign state_write = commit_go;

  always_comb begin
    new_state       = commit_state_q;
    new_state.asked = commit_state_q.asked + place_t'(commit_beats_q);
    new_state.line  = commit_state_q.line + RunBits'(commit_beats_q);
    new_state.left  = commit_state_q.left - RunBits'(commit_beats_q);
    if (commit_beats_q != '0 && commit_ends_q) begin
      new_state.line = '0;
      new_state.left = commit_next_q.lines;
      new_state.run  = commit_next_q.run;
      new_state.over = commit_tail_q;
    end
  end

  always_ff @(posedge clk_i) begin
    if (state_q == UPDATE || state_q == FILL) begin
      if (!commit_q) begin
        commit_state_q <= known_q;
        commit_chain_q <= state_q == FILL ? number_t'(at_q) : winner_q.chain;
        commit_next_q  <= next_run;
        commit_tail_q  <= known_q.run == chain.tail;
        commit_beats_q <= wants ? beats : '0;
        commit_ends_q  <= ends;
      end
    end
    if (commit_go && commit_beats_q != '0) begin
      ask_line_q  <= OB'(commit_state_q.run) * OB'(RunLines) + OB'(commit_state_q.line);
      ask_beats_q <= commit_beats_q;
      ask_tag_q   <= '{chain: commit_chain_q, place: commit_state_q.asked[SB-1:0]};
    end
  end

  // ---- requests and what comes ------------------------------------------------------------------------

  logic             read_idle, beat_valid, beat_last, beat_error, wrong;
  logic [Width-1:0] beat_data;
  tag_t             beat_tag;
  logic [NB-1:0]    beat_q;  // of its request
  logic [SB-1:0]    beat_place;
  logic             unused_tag;
  tag_t             ar_tag;

  assign unused_tag = ^{ar_tag, beat_data[Width-1:LineBits+4]};

  flk_axi_read #(
    .AddrBits(AXI_ADDR_BITS),
    .BeatBits(NB),
    .TagBits ($bits(tag_t)),
    .Width   (Width),
    .MaxBeats(Beats),
    .Bursts  (Bursts),
    .IdBits  (AXI_ID_BITS),
    .Id      (Id)
  ) i_read (
    .clk_i,
    .rst_ni,
    .idle_o     (read_idle),
    .in_valid_i (ask_valid_q),
    .in_ready_o (ask_ready),
    .in_addr_i  ({base_i + AddressBits'(ask_line_q), Shift'(0)}),
    .in_beats_i (ask_beats_q),
    .in_tag_i   (ask_tag_q),
    .out_valid_o(beat_valid),
    .out_ready_i(1'b1),
    .out_data_o (beat_data),
    .out_tag_o  (beat_tag),
    .out_last_o (beat_last),
    .out_error_o(beat_error),
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o    (ar_o.id),
    .ar_addr_o  (ar_o.addr),
    .ar_len_o   (ar_o.len),
    .ar_size_o  (ar_o.size),
    .ar_burst_o (ar_o.burst),
    .ar_tag_o   (ar_tag),
    .r_valid_i,
    .r_ready_o,
    .r_id_i     (r_i.id),
    .r_data_i   (r_i.data),
    .r_resp_i   (r_i.resp),
    .r_last_i   (r_i.last)
  );

  assign beat_place = place_of(beat_tag.chain, beat_tag.place + SB'(beat_q), levels_q, slot_mask_q);
  assign wrong      = beat_error || beat_data[LineBits+:4] == '0 ||
                      (32'(beat_data[LineBits+:4]) <= LineEntries &&
                       beat_data[LineBits-1-:TailBits] != '0);

  logic fault_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      beat_q  <= '0;
      fault_q <= 1'b0;
    end else begin
      if (beat_valid) begin
        beat_q <= beat_last ? '0 : beat_q + 1'b1;
      end
      fault_q <= beat_valid && wrong;
    end
  end

  assign fault_o = fault_q;

  logic                     line_read, key_read;
  logic [SB-1:0]            line_at, key_at;
  key_t                     key;
  logic [3:0]               line_count;
  logic [RestBits-1:0]      line_rest;

  // All of a line but its last key.
  flk_sram #(
    .Width(4 + RestBits),
    .Depth(Lines)
  ) i_lines (
    .clk_i,
    .wr_en_i  (beat_valid),
    .wr_addr_i(beat_place),
    .wr_data_i({wrong ? 4'd1 : beat_data[LineBits+:4], beat_data[LineBits-1:EntryBits],
                beat_data[MaskBits-1:0]}),
    .rd_en_i  (line_read),
    .rd_addr_i(line_at),
    .rd_data_o({line_count, line_rest})
  );

  flk_sram #(
    .Width(KeyBits),
    .Depth(Lines)
  ) i_keys (
    .clk_i,
    .wr_en_i  (beat_valid),
    .wr_addr_i(beat_place),
    .wr_data_i({beat_data[MaskBits+:Half], beat_data[MaskBits+Half+:Half]}),
    .rd_en_i  (key_read),
    .rd_addr_i(key_at),
    .rd_data_o(key)
  );

  // ---- tree -----------------------------------------------------------------------------------------

  leaf_t      node, held_q, node_new;
  logic       node_read, node_write, swap, seen_node_q, held_valid_q;
  number_t    node_at, node_to, node_leaf, node_first;
  number_t    node_q, node_seen_q, held_at_q;  // to be read next, read, being compared

  flk_sram #(
    .Width($bits(leaf_t)),
    .Depth(Runs)
  ) i_nodes (
    .clk_i,
    .wr_en_i  (node_write),
    .wr_addr_i(node_to),
    .wr_data_i(node_new),
    .rd_en_i  (node_read),
    .rd_addr_i(node_at),
    .rd_data_o(node)
  );

  assign node_leaf  = state_q == LEAF ? number_t'(at_q) : winner_q.chain;
  assign node_first = number_t'((leaves | {1'b0, node_leaf}) >> 1);
  assign swap       = held_valid_q && {held_q.kind, held_q.key} < {winner_q.kind, winner_q.key};
  assign node_write = state_q == CLEAR || (state_q == REPLAY && swap);
  assign node_to    = state_q == CLEAR ? number_t'(at_q) : held_at_q;

  always_comb begin
    node_new = winner_q;
    if (state_q == CLEAR) begin
      node_new.kind = NONE;
    end
  end

  // ---- what is given --------------------------------------------------------------------------------

  logic          out_valid_q, out_limited_q, out_last_q, out_final_q, out_none_q, out_free;
  logic          exhausted, live, peek, peeked, next_valid, key_known_q, exhausted_q;
  logic [FB-1:0] fed_q, room;   // entries
  logic [FB:0]   need_q;        // of a line more, and one of each chain
  logic [RB:0]   peeked_q;
  key_t          limit_q;
  logic [SB-1:0] next_place_q;
  logic          building_q;  // the tree
  key_t          out_key;
  logic          looked_q, live_look_q;  // PEEKED: whether the chain has a line is known

  assign out_free  = !out_valid_q || out_ready_i;
  assign exhausted = read_state.over && read_state.asked == read_state.used + 1'b1;
  assign live      = !(read_state.over && read_state.asked == read_state.used);
  assign give      = state_q == GIVE && out_free;
  assign peeked    = state_q == PEEKED && looked_q && (!live_look_q || out_free);
  assign peek      = peeked && live_look_q;

  always_comb begin
    if (32'(chains_q) <= 4) begin
      room = FB'(Capacity >> 2);
    end else if (32'(chains_q) <= 8) begin
      room = FB'(Capacity >> 1);
    end else begin
      room = FB'(Capacity);
    end
  end

  assign line_at   = place_of(state_q == GIVE ? winner_q.chain : number_t'(at_q),
                              read_state.used[SB-1:0], levels_q, slot_mask_q);
  assign line_read = give || peek;

  // The chain's next line; of one that is looked at the line that is given, too.
  logic [SB-1:0] next_place;
  assign next_place = state_q == GIVE
                      ? place_of(winner_q.chain, read_state.behind, levels_q, slot_mask_q)
                      : next_place_q;
  assign next_valid = valid_q[next_place];
  assign key_at     = next_place;
  assign key_read   = peek || ((give || state_q == WAIT) && next_valid);

  // ---- steps ----------------------------------------------------------------------------------------

  logic fill_next, fill_last, climb, climbed;

  assign climbed   = state_q == REPLAY && node_q == '0 && !seen_node_q;
  assign climb     = (state_q == UPDATE && (key_known_q || exhausted_q)) || state_q == LOAD ||
                     (state_q == LEAF && at_q >= chains_q);
  assign fill_next = state_q == FILL && step_q == 2'd2 && !commit_q;
  assign fill_last = fill_next && at_q + 1'b1 == chains_q;

  always_comb begin
    state_d = state_q;
    unique case (state_q)
      BUILD: begin
        if (run_valid_i) begin
          state_d = SCAN;
        end else if (begin_i && runs_q != '0) begin
          state_d = CLEAR;
        end
      end
      SCAN: begin
        if (found_q || (at_q == chains_q && !seen_q)) begin
          state_d = FOUND;
        end
      end
      FOUND: begin
        state_d = JOIN;
      end
      JOIN: begin
        state_d = BUILD;
      end
      CLEAR: begin
        if (at_q + 1'b1 >= leaves) begin
          state_d = FILL;
        end
      end
      FILL: begin
        if (fill_last && !(more || filled_q)) begin
          state_d = LEAF;
        end
      end
      LEAF: begin
        state_d = at_q >= chains_q ? REPLAY : WAIT;
      end
      CHOOSE: begin
        if (stop_i) begin
          state_d = STOP;
        end else if (!commit_q) begin
          state_d = GIVE;
        end
      end
      GIVE: begin
        if (out_free) begin
          state_d = UPDATE;
        end
      end
      UPDATE: begin
        state_d = key_known_q || exhausted_q ? REPLAY : WAIT;
      end
      WAIT: begin
        if (next_valid) begin
          state_d = LOAD;
        end
      end
      LOAD: begin
        state_d = REPLAY;
      end
      REPLAY: begin
        if (climbed) begin
          if (building_q) begin
            state_d = at_q + 1'b1 == leaves ? CHOOSE : LEAF;
          end else if (live_q == '0) begin
            state_d = DRAIN;
          end else begin
            state_d = (FB + 1)'(fed_q) + need_q > (FB + 1)'(room) ? PEEK : CHOOSE;
          end
        end
      end
      PEEK: begin
        if (stop_i) begin
          state_d = STOP;
        end else if (!commit_q) begin
          state_d = PEEKED;
        end
      end
      PEEKED: begin
        if (peeked) begin
          state_d = live_look_q && peeked_q + 1'b1 == live_q ? CHOOSE : PEEK;
        end
      end
      STOP: begin
        if (out_free) begin
          state_d = DRAIN;
        end
      end
      default: begin  // DRAIN
        if (done_o) begin
          state_d = BUILD;
        end
      end
    endcase
  end

  assign done_o = state_q == DRAIN && !out_valid_q && !commit_q && !ask_valid_q && read_idle;
  assign idle_o = state_q == BUILD && runs_q == '0;

  // Reads of chains and states: in SCAN one after the other, in FILL and for the winner one.
  always_comb begin
    chain_read = 1'b0;
    chain_at   = number_t'(at_q);
    state_read = 1'b0;
    state_at   = number_t'(at_q);
    next_read  = 1'b0;
    next_at    = first_q && state_q == FILL ? chain.head : read_state.run;
    unique case (state_q)
      SCAN, FOUND: begin
        chain_read = 1'b1;
      end
      FILL: begin
        chain_read = step_q == 2'd0;
        state_read = step_q == 2'd0 && !commit_q;
        next_read  = step_q == 2'd1;
      end
      CHOOSE: begin
        chain_read = 1'b1;
        chain_at   = winner_q.chain;
        state_read = !commit_q;
        state_at   = winner_q.chain;
      end
      GIVE: begin
        next_read = 1'b1;
      end
      PEEK: begin
        state_read = !commit_q;
      end
      default: begin
      end
    endcase
  end

  // Winner and tree.
  always_comb begin
    winner_d  = winner_q;
    node_read = 1'b0;
    node_at   = node_q;
    if (climb) begin
      winner_d.kind = exhausted_q || state_q == LEAF ? END : KEY;
      winner_d.key  = key;
      node_read     = 1'b1;
      node_at       = node_first;
      if (state_q == LEAF) begin
        winner_d.chain = number_t'(at_q);
        winner_d.key   = '1;
      end
    end else if (state_q == LEAF) begin
      winner_d.chain = number_t'(at_q);
    end else if (state_q == REPLAY) begin
      node_read = node_q != '0;
      if (swap) begin
        winner_d = held_q;
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q     <= BUILD;
      runs_q      <= '0;
      chains_q    <= '0;
      seen_q      <= 1'b0;
      found_q     <= 1'b0;
      valid_q     <= '0;
      out_valid_q <= 1'b0;
      seen_node_q <= 1'b0;
      held_valid_q <= 1'b0;
    end else begin
      state_q <= state_d;
      seen_q  <= state_q == SCAN && at_q < chains_q;
      found_q <= state_q == SCAN && !found_q && seen_q && (behind || ahead);
      if (taken) begin
        runs_q   <= runs_q + 1'b1;
        chains_q <= chains_q + (RB + 1)'(!joins_q);
      end
      for (int unsigned i = 0; i < Lines; i++) begin
        if (beat_valid && beat_place == SB'(i)) begin
          valid_q[i] <= 1'b1;
        end else if (give && line_at == SB'(i)) begin
          valid_q[i] <= 1'b0;
        end
      end
      seen_node_q  <= node_read && node_at != '0;
      held_valid_q <= seen_node_q;
      if (give || peek || (state_q == STOP && out_free)) begin
        out_valid_q <= 1'b1;
      end else if (out_ready_i) begin
        out_valid_q <= 1'b0;
      end
      if (done_o) begin
        runs_q   <= '0;
        chains_q <= '0;
        valid_q  <= '0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    winner_q    <= winner_d;
    looked_q    <= state_q == PEEKED && !peeked;
    live_look_q <= live;
    node_seen_q <= node_at;
    held_at_q   <= node_seen_q;
    held_q      <= node;
    if (climb) begin
      node_q <= node_first >> 1;
    end else if (state_q == REPLAY) begin
      node_q <= node_q >> 1;
    end
    unique case (state_q)
      BUILD: begin
        at_q     <= '0;
        levels_q <= levels;
      end
      SCAN: begin
        if (found_q) begin
          at_q <= (RB + 1)'(found_at_q);
        end else if (at_q != chains_q) begin
          at_q <= at_q + 1'b1;
        end
        seen_at_q  <= number_t'(at_q);
        found_at_q <= seen_at_q;
        joins_q    <= found_q;
        if (!found_q) begin
          behind_q <= behind;
        end
      end
      CLEAR: begin
        at_q        <= at_q + 1'b1;
        slots_q     <= place_t'(Lines) >> levels_q;
        slot_mask_q <= '1 >> levels_q;
        live_q      <= chains_q;
        fed_q       <= '0;
        first_q     <= 1'b1;
        filled_q    <= 1'b0;
        step_q      <= '0;
        building_q  <= 1'b1;
        if (at_q + 1'b1 >= leaves) begin
          at_q <= '0;
        end
      end
      FILL: begin
        if (step_q != 2'd2 || !commit_q) begin
          step_q <= step_q == 2'd2 ? '0 : step_q == 2'd0 && commit_q ? step_q : step_q + 1'b1;
        end
        if (fill_next) begin
          at_q     <= fill_last ? '0 : at_q + 1'b1;
          filled_q <= !fill_last && (filled_q || more);
          first_q  <= first_q && !fill_last;
        end
      end
      LEAF: begin
        next_place_q <= place_of(number_t'(at_q), '0, levels_q, slot_mask_q);
        exhausted_q  <= 1'b0;
      end
      GIVE: begin
        next_place_q <= next_place;
      end
      PEEKED: begin
        next_place_q <= line_at;
        if (peeked) begin
          at_q <= at_q + 1'b1;
        end
      end
      REPLAY: begin
        if (climbed) begin
          at_q <= building_q ? at_q + 1'b1 : '0;
          if (at_q + 1'b1 == leaves) begin
            building_q <= 1'b0;
          end
        end
      end
      default: begin
      end
    endcase
    if (give) begin
      limit_q     <= winner_q.key;
      key_known_q <= next_valid;
      exhausted_q <= exhausted;
      live_q      <= live_q - (RB + 1)'(exhausted);
      peeked_q    <= '0;
    end
    // ShortEntries of them, and one.
    need_q <= ((FB + 1)'(live_q) << 4) + (FB + 1)'(ShortEntries) - (FB + 1)'(live_q);
    if (state_q == UPDATE) begin
      fed_q <= fed_q + FB'(line_count);
    end
    if (peek) begin
      peeked_q <= peeked_q + 1'b1;
      fed_q    <= '0;
    end
    if (give || peek || state_q == STOP) begin
      if (out_free) begin
        out_none_q    <= state_q == STOP;
        out_limited_q <= peek;
        out_final_q   <= state_q == STOP || (give && exhausted && 32'(live_q) == 1);
        out_last_q    <= state_q == STOP || (give ? exhausted && 32'(live_q) == 1
                                                  : peeked_q + 1'b1 == live_q);
      end
    end
  end

  assign out_valid_o   = out_valid_q;
  // The last key of a line given is the limit, that of one with a limit has just been read.
  assign out_key       = out_limited_q ? key : limit_q;
  assign out_entries_o = {line_rest[RestBits-1:MaskBits], out_key[Half-1:0],
                          out_key[KeyBits-1:Half], line_rest[MaskBits-1:0]};
  assign out_count_o   = out_none_q ? '0 : line_count;
  assign out_limited_o = out_limited_q;
  assign out_limit_o   = limit_q;
  assign out_last_o    = out_last_q;
  assign out_final_o   = out_final_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) begin_i |-> !run_valid_i)
  else $error("flk_run_merge: a run after the last one");
  assert property (@(posedge clk_i) disable iff (!rst_ni) run_valid_i |-> !full_o)
  else $error("flk_run_merge: more runs than fit");
  assert property (@(posedge clk_i) disable iff (!rst_ni) r_valid_i |-> r_ready_o)
  else $error("flk_run_merge: the port waits");
  assert property (@(posedge clk_i) disable iff (!rst_ni) beat_valid |-> !valid_q[beat_place])
  else $error("flk_run_merge: a line where one is");
  assert property (@(posedge clk_i) disable iff (!rst_ni) line_read |-> valid_q[line_at])
  else $error("flk_run_merge: a line that has not come");
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i |=>
      out_valid_o && $stable({out_entries_o, out_count_o, out_limited_o, out_limit_o}) &&
      $stable({out_last_o, out_final_o}))
  else $error("flk_run_merge: output changed before its transfer");
`endif

endmodule
