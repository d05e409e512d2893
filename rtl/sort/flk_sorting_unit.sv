// Sorting unit: the lines of a tile's list in, its entries in order out (docs/reference/sorting_unit.md).
//
// Entries are {key 24, record 24, mask 4}; order is that of the upper 48 bits, unsigned, which are
// distinct within a list. Lines are those of docs/reference/list_layout.md without their header and hold
// in_count_i entries, in any order; 0 only in the one line of an empty list. Out come {record, mask}, then an element with out_end_o that carries no entry.
// A list of more than Capacity entries (docs/reference/list_sorter.md) leaves as runs, run_*: each Capacity entries of it in order, whole,
// then an element with run_end_o. merging_o says that all of them have left; from then on its lines
// come a second time as merge_*, key and record of each entry exchanged, in batches of at most
// Capacity entries: the entries of a batch are those
// above the limit of the one before and, of lines with merge_limited_i, not above merge_limit_i.
// After the batch with merge_final_i the list ends. Of the next list no line is taken before that.
// finish_i, from any cycle until the end of the list at the output is taken: what there is of this
// list is left out, its end follows. Of a list that leaves as runs these leave first; merge_stop_o then
// says that nothing of it is wanted: a line with merge_last_i and merge_final_i has to end it.
// start_i, while idle_o, sets the counters to 0. entries_o: delivered. readings_o: lists read.
// dropped_o: entries taken of finished lists, but not delivered; both entries_o and
// dropped_o while idle_o. clear_i (synchronous) empties the unit.
//
// Structure: a line's entries one by one, in a batch dropped at or below the bound and above
// the limit; runs of Cells by insertion (flk_sort_runs); Stages steps that merge them two by two
// (flk_sort_merge), each while its runs arrive, so that an entry a cycle goes through all of them,
// whatever the lengths of the lists. The last step (flk_sort_select) merges Ways runs and takes the place of
// $clog2(Ways) steps; it holds Capacity = Cells << Stages entries.
// Throughput: a list of n <= Capacity entries in n + 4 cycles, back to back. Latency: docs/reference/sorting_unit.md.
// Combinational paths: none from an input to a handshake output; outputs of out_* and run_* are registers.
module flk_sorting_unit #(
  parameter  int unsigned Cells       = 16,
  parameter  int unsigned Stages      = 7,
  parameter  int unsigned Ways        = 8,  // runs that the last step merges
  parameter  int unsigned Block       = 32,  // of its memory, at most a run
  parameter  int unsigned Lists       = 8,  // whole lists waiting in a step, at most
  parameter  int unsigned LineEntries = 9,  // of a plain line
  parameter  int unsigned ShortEntries = 15, // of a short one
  parameter  int unsigned TailBits    = 4,  // of a short one, behind what a plain one has
  parameter  int unsigned EntryBits   = 52,
  parameter  int unsigned MaskBits    = 4,
  parameter  int unsigned OutBits     = 28,
  localparam int unsigned KeyBits     = EntryBits - MaskBits,
  localparam int unsigned LineBits    = LineEntries * EntryBits + TailBits,
  localparam int unsigned CountBits   = $clog2(ShortEntries + 1)
) (
  input  logic                                  clk_i,
  input  logic                                  rst_ni,
  input  logic                                  clear_i,
  // Frame
  input  logic                                  start_i,
  output logic                                  idle_o,
  output logic [31:0]                           entries_o,
  output logic [31:0]                           readings_o,
  output logic [31:0]                           dropped_o,
  // Lines
  input  logic                                  in_valid_i,
  output logic                                  in_ready_o,
  input  logic [LineBits-1:0]                   in_entries_i,
  input  logic [CountBits-1:0]                  in_count_i,
  input  logic                                  in_last_i,
  // Runs of a list that does not fit
  output logic                                  run_valid_o,
  input  logic                                  run_ready_i,
  output logic                                  run_end_o,
  output logic [EntryBits-1:0]                  run_entry_o,
  output logic                                  merging_o,
  output logic                                  merge_stop_o,
  // Its lines again
  input  logic                                  merge_valid_i,
  output logic                                  merge_ready_o,
  input  logic [LineBits-1:0]                   merge_entries_i,
  input  logic [CountBits-1:0]                  merge_count_i,
  input  logic                                  merge_limited_i,
  input  logic [KeyBits-1:0]                    merge_limit_i,
  input  logic                                  merge_last_i,
  input  logic                                  merge_final_i,
  // Sorted entries
  output logic                                  out_valid_o,
  input  logic                                  out_ready_i,
  output logic                                  out_end_o,
  output logic [OutBits-1:0]                    out_entry_o,
  input  logic                                  finish_i
);

  localparam int unsigned Capacity = Cells << Stages;
  localparam int unsigned Steps    = Stages - $clog2(Ways) + 1;  // of merging, with the last one
  localparam int unsigned GatherBits = $clog2(Capacity + 1);
  localparam int unsigned EndsBits = $clog2((Lists + 1) * Steps + 3);

  if (Stages < 1 || Cells < 2 || (Cells & (Cells - 1)) != 0) begin : gen_check
    $error("flk_sorting_unit: Cells must be a power of two, at least 2, Stages at least 1");
  end

  if (Ways < 2 || (Ways & (Ways - 1)) != 0 || Ways > 1 << Stages) begin : gen_check_ways
    $error("flk_sorting_unit: Ways must be a power of two, 2 to 1 << Stages");
  end

  typedef logic [EntryBits-1:0] entry_t;
  typedef logic [KeyBits-1:0] key_t;

  // Of the list at the gate: it fits so far; it leaves as runs; all of it is in runs, which leave; its lines come again.
  typedef enum logic [1:0] {LIST, RUNS, LEAVE, MERGE} mode_e;

  mode_e mode_q;

  // ---- a line -------------------------------------------------------------------------------------

  logic                         line_valid_d, line_valid_q;
  logic                         line_last_q, line_limited_q, line_final_q;
  logic [LineBits-1:0]          line_q;
  logic                         line_short_q, line_run_q, line_newest_q;  // its newest is next
  logic [CountBits-1:0]         line_left_d, line_left_q;  // entries, then the end of a last line
  logic [CountBits-1:0]         take_count;
  logic                         line_take, list_take, line_free, line_entry, line_one, line_end;
  logic                         line_done, line_drop, fits, hold_q, again;
  logic                         x_valid_d, x_valid_q, x_end_q, x_limited_q, x_final_q, x_go, x_free;
  entry_t                       x_d, x_q;

  assign take_count    = again ? merge_count_i : in_count_i;
  assign again         = mode_q == MERGE;
  assign line_entry    = line_valid_q && line_left_q != '0;
  assign line_end      = line_valid_q && line_left_q == '0;
  assign x_free        = !x_valid_q || x_go;
  assign line_done     = line_entry ? !line_last_q && (line_drop || (x_free && line_one)) : x_free;
  assign line_one      = line_left_q == CountBits'(1);
  assign line_free     = !line_valid_q || line_done;
  assign in_ready_o    = line_free && !hold_q;
  assign merge_ready_o = line_free && again;
  assign list_take     = in_valid_i && in_ready_o;
  assign line_take     = list_take || (merge_valid_i && merge_ready_o);

  always_comb begin
    line_valid_d = line_take || (line_valid_q && !line_done);
    line_left_d  = line_left_q;
    if (line_take) begin
      line_left_d = take_count;
    end else if (line_drop) begin
      line_left_d = '0;
    end else if (line_entry && x_free) begin
      line_left_d = line_left_q - 1'b1;
    end
    x_valid_d = x_free ? (line_entry && !line_drop) || line_end : 1'b1;
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      line_valid_q <= 1'b0;
      x_valid_q    <= 1'b0;
    end else begin
      line_valid_q <= line_valid_d && !clear_i;
      x_valid_q    <= x_valid_d && !clear_i;
    end
  end

  always_ff @(posedge clk_i) begin
    line_left_q <= line_left_d;
    if (line_take) begin
      line_short_q   <= 32'(take_count) > LineEntries;
      line_run_q     <= again;
      line_newest_q  <= 1'b1;
      line_q         <= again ? merge_entries_i : in_entries_i;
      line_last_q    <= again ? merge_last_i : in_last_i;
      line_limited_q <= again && merge_limited_i;
      line_final_q   <= merge_final_i;
    end
    if (x_free && line_valid_q) begin
      x_end_q     <= line_end;
      x_limited_q <= line_limited_q;
      x_final_q   <= line_final_q;
    end
    if (x_free && line_entry) begin
      x_q <= x_d;
      if (!line_take) begin
        line_newest_q <= 1'b0;
      end
    end
  end

  // Key and record in each other's places.
  function automatic entry_t exchanged(input entry_t entry);
    return {entry[MaskBits+:KeyBits/2], entry[EntryBits-1:MaskBits+KeyBits/2], entry[MaskBits-1:0]};
  endfunction

  entry_t line_entry_word;

  assign x_d = line_run_q ? exchanged(line_entry_word) : line_entry_word;

  // The entry given before it is in x, or was there last.
  flk_line_entry #(
    .MaskBits    (MaskBits),
    .RecordBits  (KeyBits / 2),
    .KeyBits     (KeyBits - KeyBits / 2),
    .LineEntries (LineEntries),
    .ShortEntries(ShortEntries)
  ) i_entry (
    .line_i (line_q),
    .short_i(line_short_q),
    .at_i   (line_newest_q ? '0 : line_left_q),
    .newer_i(line_run_q ? exchanged(x_q) : x_q),
    .entry_o(line_entry_word)
  );

  logic              first_ready, first_drop;  // of the first step
  logic              final_valid, final_end, final_flag, out_free, out_drop;  // of the last one
  entry_t            final_entry;
  logic [Steps-1:0]  empty;
  logic              closed;  // the end of the list in the last step is on its way
  logic              ends_less;

  // ---- the gate -----------------------------------------------------------------------------------

  logic                  bounded_q, pass, full, drop_here, whole, goes_on;
  key_t                  bound_q, limit_q;
  logic [GatherBits-1:0] gathered_q;
  logic                  runs_valid, runs_ready, runs_end, runs_empty;
  logic                  x_ends;     // the end of a list or batch goes on
  logic                  gate_ends;  // this, or the end of a run

  // A line with a limit comes behind one without, whose entries have gone on by the time they are compared.
  assign pass       = (!bounded_q || x_q[EntryBits-1:MaskBits] > bound_q) &&
                      (!x_limited_q || x_q[EntryBits-1:MaskBits] <= limit_q);
  assign full       = gathered_q[GatherBits-1];
  // An entry more than fits: the run ends before it.
  assign whole      = x_valid_q && !x_end_q && pass && full && !drop_here;
  assign runs_valid = x_valid_q && (x_end_q || (pass && !drop_here));
  assign x_go       = x_valid_q && (x_end_q ? runs_ready
                                            : drop_here || !pass || (!full && runs_ready));
  assign x_ends     = x_end_q && x_go;
  assign gate_ends  = x_ends || (whole && runs_ready);
  assign goes_on    = again && !x_final_q;
  // What is behind an end in x is of the next list.
  assign line_drop  = drop_here && line_entry && !(x_valid_q && x_end_q);
  // The list ends, and what is on its way fits.
  assign fits       = mode_q == LIST && 32'(gathered_q) + ShortEntries + 3 < Capacity;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      bounded_q  <= 1'b0;
      gathered_q <= '0;
      hold_q     <= 1'b0;
    end else if (clear_i) begin
      bounded_q  <= 1'b0;
      gathered_q <= '0;
      hold_q     <= 1'b0;
    end else begin
      if (x_ends) begin
        bounded_q <= goes_on;
      end
      if (gate_ends) begin
        gathered_q <= '0;
      end else if (x_go && runs_valid) begin
        gathered_q <= gathered_q + 1'b1;
      end
      if (list_take && in_last_i && !fits) begin
        hold_q <= 1'b1;
      end else if (x_ends && (mode_q == LIST || (again && x_final_q))) begin
        hold_q <= 1'b0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (line_take && again && merge_limited_i) begin
      limit_q <= merge_limit_i;
    end
    if (x_ends && goes_on) begin
      bound_q <= limit_q;
    end
  end

  // ---- runs and their merging -----------------------------------------------------------------------


  logic   runs_out_valid, runs_out_end, runs_out_flag;
  entry_t runs_out_entry;

  flk_sort_runs #(
    .Cells      (Cells),
    .KeyBits    (KeyBits),
    .PayloadBits(MaskBits)
  ) i_runs (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (runs_valid),
    .in_ready_o (runs_ready),
    .in_end_i   (x_end_q || full),
    .in_flag_i  (goes_on),
    .in_entry_i (x_q),
    .out_valid_o(runs_out_valid),
    .out_ready_i(first_ready),
    .out_end_o  (runs_out_end),
    .out_flag_o (runs_out_flag),
    .out_entry_o(runs_out_entry),
    .end_o      (runs_end),
    .empty_o    (runs_empty)
  );

  for (genvar i = 0; i < Steps; i++) begin : gen_step
    localparam int unsigned Run  = Cells << i;
    localparam bit          Last = i == Steps - 1;

    logic   in_valid, in_ready, in_end, in_flag, valid, ready, is_end, flag, drop_in, drop_out;
    entry_t in_entry, entry;

    if (i == 0) begin : gen_first
      assign {in_valid, in_end, in_flag} = {runs_out_valid, runs_out_end, runs_out_flag};
      assign in_entry    = runs_out_entry;
      assign first_ready = in_ready;
      assign first_drop  = drop_out;
    end else begin : gen_later
      assign in_valid = gen_step[i-1].valid;
      assign in_end   = gen_step[i-1].is_end;
      assign in_flag  = gen_step[i-1].flag;
      assign in_entry = gen_step[i-1].entry;
    end

    if (Last) begin : gen_last
      assign ready       = out_free;
      assign drop_in     = out_drop;
      assign final_valid = valid;
      assign final_end   = is_end;
      assign final_flag  = flag;
      assign final_entry = entry;
      assign ends_less   = in_valid && in_ready && in_end;

      flk_sort_select #(
        .Run        (Run),
        .Ways       (Ways),
        .Block      (Block < Run ? Block : Run),
        .KeyBits    (KeyBits),
        .PayloadBits(MaskBits),
        .Lists      (Lists)
      ) i_select (
        .clk_i,
        .rst_ni,
        .clear_i,
        .in_valid_i (in_valid),
        .in_ready_o (in_ready),
        .in_end_i   (in_end),
        .in_flag_i  (in_flag),
        .in_entry_i (in_entry),
        .out_valid_o(valid),
        .out_ready_i(ready),
        .out_end_o  (is_end),
        .out_flag_o (flag),
        .out_entry_o(entry),
        .drop_i     (drop_in),
        .drop_o     (drop_out),
        .empty_o    (empty[i]),
        .closed_i   (closed)
      );
    end else begin : gen_earlier
      assign ready   = gen_step[i+1].in_ready;
      assign drop_in = gen_step[i+1].drop_out;

      // A memory of Run entries costs two cycles now and then, when the first of the next run find it
      // full: not to be felt in long runs, and short ones have room for two.
      flk_sort_merge #(
        .Run        (Run),
        .Depth      (Run <= 32 ? 2 * Run : Run),
        .KeyBits    (KeyBits),
        .PayloadBits(MaskBits),
        .Lists      (Lists)
      ) i_merge (
        .clk_i,
        .rst_ni,
        .clear_i,
        .in_valid_i (in_valid),
        .in_ready_o (in_ready),
        .in_end_i   (in_end),
        .in_flag_i  (in_flag),
        .in_entry_i (in_entry),
        .out_valid_o(valid),
        .out_ready_i(ready),
        .out_end_o  (is_end),
        .out_flag_o (flag),
        .out_entry_o(entry),
        .drop_i     (drop_in),
        .drop_o     (drop_out),
        .empty_o    (empty[i])
      );
    end
  end

  assign drop_here = first_drop && !runs_end;

  // Ends between the gate and the last step.
  logic [EndsBits-1:0] ends_q;

  assign closed    = ends_q != '0;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      ends_q <= '0;
    end else if (clear_i) begin
      ends_q <= '0;
    end else if (gate_ends != ends_less) begin
      ends_q <= gate_ends ? ends_q + 1'b1 : ends_q - 1'b1;
    end
  end

  // ---- output -------------------------------------------------------------------------------------

  logic   out_valid_q, out_end_q, finish_q, end_sent, end_left;
  logic   out_runs_q;  // what is at the output is of a run
  entry_t out_q;

  // Ends that are inside, and those of them that belong to lists before the one that leaves as runs.
  logic [EndsBits-1:0] inside_q, before_d, before_q;
  mode_e               mode_d;

  // An end that is followed by another batch of the list is none.
  assign out_free  = !out_valid_q || (out_runs_q ? run_ready_i : out_ready_i);
  assign end_sent  = out_valid_q && out_end_q && out_ready_i && !out_runs_q;
  assign end_left  = (out_valid_q && out_end_q && out_free) ||
                     (out_free && final_valid && final_end && final_flag);
  assign out_drop  = finish_q && !(out_valid_q && out_end_q) && !out_runs_q;

  always_comb begin
    before_d = before_q - EndsBits'(end_left && before_q != '0);
    if (mode_q == LIST) begin
      before_d = inside_q - EndsBits'(end_left);
    end
  end

  always_comb begin
    mode_d = mode_q;
    unique case (mode_q)
      LIST: begin
        if (whole && runs_ready) begin
          mode_d = RUNS;
        end
      end
      RUNS: begin
        if (x_ends) begin
          mode_d = LEAVE;
        end
      end
      LEAVE: begin
        if (inside_q == '0) begin
          mode_d = MERGE;
        end
      end
      default: begin
        if (x_ends && x_final_q) begin
          mode_d = LIST;
        end
      end
    endcase
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      mode_q      <= LIST;
      inside_q    <= '0;
      before_q    <= '0;
      out_runs_q  <= 1'b0;
      out_valid_q <= 1'b0;
      out_end_q   <= 1'b0;
      finish_q    <= 1'b0;
    end else begin
      inside_q   <= inside_q + EndsBits'(gate_ends) - EndsBits'(end_left);
      mode_q     <= mode_d;
      before_q   <= before_d;
      out_runs_q <= (mode_d == RUNS || mode_d == LEAVE) && before_d == '0;
      if (out_free) begin
        out_valid_q <= final_valid && !(final_end && final_flag);
        out_end_q   <= final_end;
      end
      finish_q <= (finish_q || finish_i) && !end_sent;
      if (clear_i) begin
        mode_q      <= LIST;
        inside_q    <= '0;
        before_q    <= '0;
        out_runs_q  <= 1'b0;
        out_valid_q <= 1'b0;
        finish_q    <= 1'b0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (out_free && final_valid) begin
      out_q <= final_entry;
    end
  end

  assign out_valid_o  = out_valid_q && !out_runs_q;
  assign out_end_o    = out_end_q;
  assign out_entry_o  = out_q[OutBits-1:0];
  assign run_valid_o  = out_valid_q && out_runs_q;
  assign run_end_o    = out_end_q;
  assign run_entry_o  = out_q;
  assign merging_o    = again;
  assign merge_stop_o = again && finish_q;

  // ---- counters -------------------------------------------------------------------------------------

  // Taken: what a reading has at its end, and what a finished list is not asked for in its first reading.
  logic [15:0] more_taken, more_taken_q;
  logic [16:0] taken_low_d;
  logic [15:0] taken_low_q, taken_high_q, less_low_q, less_high_q;
  logic        carry_q, borrow_q;
  logic [31:0] delivered;

  always_comb begin
    more_taken = '0;
    if (gate_ends && !again) begin
      more_taken = 16'(gathered_q);
    end else if (drop_here && !again) begin
      more_taken = 16'(line_drop ? line_left_q : '0) + 16'(x_valid_q && !x_end_q);
    end
  end

  assign taken_low_d = {1'b0, taken_low_q} + 17'(more_taken_q);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      more_taken_q <= '0;
      taken_low_q  <= '0;
      carry_q      <= 1'b0;
      taken_high_q <= '0;
      less_low_q   <= '0;
      borrow_q     <= 1'b0;
      less_high_q  <= '0;
    end else begin
      more_taken_q            <= more_taken;
      taken_low_q             <= taken_low_d[15:0];
      carry_q                 <= taken_low_d[16];
      taken_high_q            <= taken_high_q + 16'(carry_q);
      {borrow_q, less_low_q}  <= {1'b0, taken_low_q} - {1'b0, delivered[15:0]};
      less_high_q             <= taken_high_q - delivered[31:16] - 16'(borrow_q);
      if (start_i || clear_i) begin
        more_taken_q <= '0;
        taken_low_q  <= '0;
        carry_q      <= 1'b0;
        taken_high_q <= '0;
      end
    end
  end

  flk_event_counter i_entries (
    .clk_i,
    .rst_ni,
    .clear_i(start_i || clear_i),
    .count_i(out_valid_o && out_ready_i && !out_end_q),
    .value_o(delivered)
  );

  flk_event_counter i_readings (
    .clk_i,
    .rst_ni,
    .clear_i(start_i || clear_i),
    .count_i(list_take && in_last_i),
    .value_o(readings_o)
  );

  assign entries_o = delivered;
  assign dropped_o = {less_high_q, less_low_q};

  // The counters are a few cycles behind.
  logic [5:0] quiet_q;
  logic       quiet, reading_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      reading_q <= 1'b0;
      quiet_q   <= '1;
    end else begin
      if (clear_i) begin
        reading_q <= 1'b0;
      end else if (line_take) begin
        reading_q <= 1'b1;
      end else if (x_ends && !line_valid_q && !goes_on) begin
        reading_q <= 1'b0;
      end
      quiet_q <= {quiet_q[4:0], quiet};
    end
  end

  assign quiet  = !line_valid_q && !x_valid_q && !reading_q && mode_q == LIST && runs_empty &&
                  (&empty) && !out_valid_q && !closed;
  assign idle_o = (&quiet_q) && quiet;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) again && whole |-> 1'b0)
  else $error("flk_sorting_unit: a batch of more entries than fit");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      in_valid_i |-> 32'(in_count_i) <= ShortEntries && (in_count_i != '0 || in_last_i))
  else $error("flk_sorting_unit: a line without entries");

  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o)
  else $error("flk_sorting_unit: start while not idle");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=>
      out_valid_o && $stable({out_end_o, out_entry_o}))
  else $error("flk_sorting_unit: output changed before its transfer");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      run_valid_o && !run_ready_i && !clear_i |=>
      run_valid_o && $stable({run_end_o, run_entry_o}))
  else $error("flk_sorting_unit: a run changed before its transfer");
`endif

endmodule
