// A tile's list in order, of any length up to Runs times what the sorting unit holds (docs/reference/list_sorter.md).
//
// Lists of up to Capacity = Cells << Stages entries go through flk_sorting_unit once. Of longer ones it makes runs, which
// flk_run_writer packs into lines from line base_i on; when all are in memory flk_run_merge reads them
// and the unit takes them again. in_*, out_*, finish_i and the counters: flk_sorting_unit.
// write_*: lines, with the address of each; written_i, while waits_o: what was taken is in memory and will be read
// as written (low in the cycle after a line was taken, until then). base_i stays while idle_o is low.
// again_o: an entry goes into a run, and will be sorted a second time.
// error_o, until start_i: the list has more runs than fit, of which the far ones of the reading are left out, or what
// was read of them is wrong; what there is leaves all the same. start_i while idle_o.
module flk_list_sorter
  import flk_axi_pkg::*;
#(
  parameter  int unsigned Cells       = 16,
  parameter  int unsigned Stages      = 7,
  parameter  int unsigned Ways        = 8,
  parameter  int unsigned Lists       = 8,
  parameter  int unsigned Runs        = 64,   // of a list
  parameter  int unsigned MergeLines  = 128,  // in the memory of flk_run_merge
  parameter  int unsigned LineEntries = 9,
  parameter  int unsigned ShortEntries = 15,
  parameter  int unsigned TailBits    = 4,
  parameter  int unsigned EntryBits   = 52,
  parameter  int unsigned MaskBits    = 4,
  parameter  int unsigned OutBits     = 28,
  parameter  int unsigned Id          = 0,
  localparam int unsigned AddressBits = AXI_BEAT_BITS,  // of a line
  localparam int unsigned Width       = AXI_DATA_BITS,
  localparam int unsigned LineBits    = LineEntries * EntryBits + TailBits,
  localparam int unsigned CountBits   = $clog2(ShortEntries + 1)
) (
  input  logic                                  clk_i,
  input  logic                                  rst_ni,
  // Frame
  input  logic                                  start_i,
  output logic                                  idle_o,
  output logic                                  error_o,
  input  logic [AddressBits-1:0]                base_i,
  output logic [31:0]                           entries_o,
  output logic [31:0]                           readings_o,
  output logic [31:0]                           dropped_o,
  output logic                                  again_o,
  // Lines
  input  logic                                  in_valid_i,
  output logic                                  in_ready_o,
  input  logic [LineBits-1:0]                   in_entries_i,
  input  logic [CountBits-1:0]                  in_count_i,
  input  logic                                  in_last_i,
  // Sorted entries
  output logic                                  out_valid_o,
  input  logic                                  out_ready_i,
  output logic                                  out_end_o,
  output logic [OutBits-1:0]                    out_entry_o,
  input  logic                                  finish_i,
  // Lines of runs to memory
  output logic                                  write_valid_o,
  input  logic                                  write_ready_i,
  output logic [AddressBits-1:0]                write_beat_o,
  output logic [Width-1:0]                      write_data_o,
  output logic                                  waits_o,
  input  logic                                  written_i,
  // AXI4
  output logic                                  ar_valid_o,
  input  logic                                  ar_ready_i,
  output axi_ax_t                               ar_o,
  input  logic                                  r_valid_i,
  output logic                                  r_ready_o,
  input  axi_r_t                                r_i
);

  localparam int unsigned KeyBits    = EntryBits - MaskBits;
  localparam int unsigned Capacity   = Cells << Stages;
  localparam int unsigned RunLines   = (Capacity + LineEntries - 1) / LineEntries;
  localparam int unsigned RunBits    = $clog2(RunLines + 1);
  localparam int unsigned NumberBits = $clog2(Runs * RunLines + 1);

  logic                                  unit_idle, merge_idle;
  logic                                  run_valid, run_ready, run_end, merging, stop;
  logic [EntryBits-1:0]                  run_entry, held_entry;
  logic                                  held_valid, held_ready, held_end, pack_idle;
  logic                                  again_valid, again_ready, limited, last, is_final;
  logic [LineBits-1:0]                   again_entries;
  logic [3:0]                            again_count;
  logic [KeyBits-1:0]                    limit;
  logic                                  pack_ready, begin_merge, merge_done, full, fault;
  logic                                  built_valid, built_ready;
  logic [KeyBits-1:0]                    built_first, built_last;
  logic [RunBits-1:0]                    built_lines;
  logic [NumberBits-1:0]                 number;
  logic                                  begun_q, error_q;

  flk_sorting_unit #(
    .Cells      (Cells),
    .Stages     (Stages),
    .Ways       (Ways),
    .Lists      (Lists),
    .LineEntries(LineEntries),
    .ShortEntries(ShortEntries),
    .TailBits   (TailBits),
    .EntryBits  (EntryBits),
    .MaskBits   (MaskBits),
    .OutBits    (OutBits)
  ) i_unit (
    .clk_i,
    .rst_ni,
    .clear_i        (1'b0),
    .start_i,
    .idle_o         (unit_idle),
    .entries_o,
    .readings_o,
    .dropped_o,
    .in_valid_i,
    .in_ready_o,
    .in_entries_i,
    .in_count_i,
    .in_last_i,
    .run_valid_o    (run_valid),
    .run_ready_i    (run_ready),
    .run_end_o      (run_end),
    .run_entry_o    (run_entry),
    .merging_o      (merging),
    .merge_stop_o   (stop),
    .merge_valid_i  (again_valid),
    .merge_ready_o  (again_ready),
    .merge_entries_i(again_entries),
    .merge_count_i  (CountBits'(again_count)),
    .merge_limited_i(limited),
    .merge_limit_i  (limit),
    .merge_last_i   (last),
    .merge_final_i  (is_final),
    .out_valid_o,
    .out_ready_i,
    .out_end_o,
    .out_entry_o,
    .finish_i
  );

  // Runs of the next list wait until the last one has left the memory.
  assign run_ready = held_ready && !begun_q;
  assign again_o   = run_valid && run_ready && !run_end;

  flk_skid_buffer #(
    .Width(EntryBits + 1)
  ) i_held (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (run_valid && !begun_q),
    .in_ready_o (held_ready),
    .in_data_i  ({run_end, run_entry}),
    .out_valid_o(held_valid),
    .out_ready_i(pack_ready),
    .out_data_o ({held_end, held_entry})
  );

  flk_run_writer #(
    .LineEntries(LineEntries),
    .ShortEntries(ShortEntries),
    .EntryBits  (EntryBits),
    .MaskBits   (MaskBits),
    .NumberBits (NumberBits),
    .RunBits    (RunBits),
    .RunLines   (RunLines),
    .Width      (Width)
  ) i_writer (
    .clk_i,
    .rst_ni,
    .clear_i     (1'b0),
    .start_i     (merge_done),
    .drop_i      (full),
    .idle_o      (pack_idle),
    .in_valid_i  (held_valid),
    .in_ready_o  (pack_ready),
    .in_end_i    (held_end),
    .in_entry_i  (held_entry),
    .out_valid_o (write_valid_o),
    .out_ready_i (write_ready_i),
    .out_number_o(number),
    .out_data_o  (write_data_o),
    .run_valid_o (built_valid),
    .run_ready_i (built_ready),
    .run_first_o (built_first),
    .run_last_o  (built_last),
    .run_lines_o (built_lines)
  );

  // Of the next line: base_i + number, without an adder on the way out. There are cycles enough between two lists.
  logic [AddressBits-1:0] beat_q, run_beat_q;

  always_ff @(posedge clk_i) begin
    if (write_valid_o && write_ready_i) begin
      beat_q <= beat_q + 1'b1;
    end else if (built_valid && built_ready) begin
      beat_q     <= run_beat_q + AddressBits'(RunLines);
      run_beat_q <= run_beat_q + AddressBits'(RunLines);
    end else if (number == '0) begin
      beat_q     <= base_i;
      run_beat_q <= base_i;
    end
  end

  assign write_beat_o = beat_q;
  assign waits_o      = merging && !begun_q && !held_valid && pack_idle;
  assign begin_merge  = waits_o && written_i;

  flk_run_merge #(
    .Runs        (Runs),
    .Lines       (MergeLines),
    .Capacity    (Capacity),
    .LineEntries (LineEntries),
    .ShortEntries(ShortEntries),
    .TailBits    (TailBits),
    .EntryBits   (EntryBits),
    .MaskBits    (MaskBits),
    .Id          (Id)
  ) i_merge (
    .clk_i,
    .rst_ni,
    .base_i,
    .idle_o       (merge_idle),
    .full_o       (full),
    .fault_o      (fault),
    .run_valid_i  (built_valid),
    .run_ready_o  (built_ready),
    .run_first_i  (built_first),
    .run_last_i   (built_last),
    .run_lines_i  (built_lines),
    .begin_i      (begin_merge),
    .stop_i       (stop),
    .done_o       (merge_done),
    .out_valid_o  (again_valid),
    .out_ready_i  (again_ready),
    .out_entries_o(again_entries),
    .out_count_o  (again_count),
    .out_limited_o(limited),
    .out_limit_o  (limit),
    .out_last_o   (last),
    .out_final_o  (is_final),
    .ar_valid_o,
    .ar_ready_i,
    .ar_o,
    .r_valid_i,
    .r_ready_o,
    .r_i
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      begun_q <= 1'b0;
      error_q <= 1'b0;
    end else begin
      begun_q <= begun_q ? merging || !merge_idle : begin_merge;
      error_q <= (error_q && !start_i) || fault || (full && !pack_idle);
    end
  end

  assign error_o = error_q;
  assign idle_o  = unit_idle && merge_idle && !begun_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      write_valid_o |-> write_beat_o == base_i + AddressBits'(number))
  else $error("flk_list_sorter: a line to another address than its number's");
`endif

endmodule
