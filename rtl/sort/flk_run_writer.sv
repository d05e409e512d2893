// Sorted runs to lines of memory: a list's entries that a sorting unit does not hold (docs/reference/list_sorter.md).
//
// A run is entries, in order, then an element with in_end_i (no entry). Lines are those of a list
// (docs/reference/list_layout.md), with key and record of each entry exchanged: up to LineEntries of them, more while
// each is near the one before it. Lines have numbers from 0 on; those of a run begin RunLines after those of the run
// before it. start_i, while nothing is inside, begins with 0 again. When a run's last line has been taken its
// first and last key and the lines it took are offered as run_*; its end is taken with these.
// drop_i: a run that begins is swallowed with its end, and gives no line.
// idle_o: what was taken is in lines that were taken, or in the open one.
// Latency: a cycle. Throughput: an entry a cycle, two cycles for an end. Combinational: out_ready_i, run_ready_i and
// drop_i to in_ready_o. clear_i (synchronous) empties it.
module flk_run_writer #(
  parameter  int unsigned LineEntries  = 9,    // of a plain line
  parameter  int unsigned ShortEntries = 15,   // of a short one
  parameter  int unsigned EntryBits    = 52,
  parameter  int unsigned MaskBits     = 4,
  parameter  int unsigned RecordKept   = 9,    // low bits of the key in a short line
  parameter  int unsigned KeyKept      = 17,   // of the record: they are exchanged
  parameter  int unsigned NumberBits   = 14,   // of a line
  parameter  int unsigned RunBits      = 8,    // of a run's lines
  parameter  int unsigned RunLines     = 228,  // from run to run
  parameter  int unsigned Width        = 512,
  localparam int unsigned KeyBits      = EntryBits - MaskBits
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  input  logic                  start_i,
  input  logic                  drop_i,
  output logic                  idle_o,
  // Entries
  input  logic                  in_valid_i,
  output logic                  in_ready_o,
  input  logic                  in_end_i,
  input  logic [EntryBits-1:0]  in_entry_i,
  // Lines
  output logic                  out_valid_o,
  input  logic                  out_ready_i,
  output logic [NumberBits-1:0] out_number_o,
  output logic [Width-1:0]      out_data_o,
  // Runs
  output logic                  run_valid_o,
  input  logic                  run_ready_i,
  output logic [KeyBits-1:0]    run_first_o,
  output logic [KeyBits-1:0]    run_last_o,
  output logic [RunBits-1:0]    run_lines_o
);

  localparam int unsigned CountBits  = 4;
  localparam int unsigned Half       = KeyBits / 2;  // bits of a record, of a key
  localparam int unsigned Columns    = LineEntries - 1;
  localparam int unsigned Over       = ShortEntries - LineEntries;
  localparam int unsigned KeptBits   = MaskBits + RecordKept + KeyKept;
  localparam int unsigned GapBits    = EntryBits - KeptBits;
  localparam int unsigned RecordGap  = Half - RecordKept;
  localparam int unsigned RestBits   = KeptBits - GapBits;
  localparam int unsigned TailBits   = Over * RestBits - (Columns - Over) * GapBits;
  localparam int unsigned PlacesBits = Columns * EntryBits;
  localparam int unsigned LineBits   = EntryBits + PlacesBits + TailBits;

  if (LineEntries < 2 || ShortEntries >= 1 << CountBits ||
      LineBits + CountBits > Width) begin : gen_check
    $error("flk_run_writer: LineEntries and their number must fit a line");
  end

  typedef logic [EntryBits-1:0] entry_t;

  entry_t                        entry_in, entry_q, newest_q;  // with key and record exchanged
  logic [Columns-1:0][EntryBits-1:0] places_q, places_d;  // the others of a line
  logic [TailBits-1:0]           tail_q, tail_d;
  logic [CountBits-1:0]          count_q;
  logic                          tight_q;  // all of them are near each other
  logic [KeyBits-1:0]            first_q;
  logic [NumberBits-1:0]         number_q, run_number_q;
  logic [RunBits-1:0]            lines_q;
  logic                          begun_q, drop_q, drop, is_near, joins;
  logic                          valid_q, end_q, near_q, ready;
  logic                          entry, line, written;

  assign entry_in = {in_entry_i[MaskBits+:Half], in_entry_i[MaskBits+Half+:Half],
                     in_entry_i[MaskBits-1:0]};

  flk_entry_near #(
    .MaskBits  (MaskBits),
    .RecordBits(Half),
    .KeyBits   (Half),
    .RecordKept(RecordKept),
    .KeyKept   (KeyKept)
  ) i_near (
    .older_i(entry_q),
    .newer_i(entry_in),
    .near_o (is_near)
  );

  // An entry, and whether it is near the one before it, which takes a good part of a cycle.
  assign in_ready_o = !valid_q || ready;
  assign idle_o     = !valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= 1'b0;
    end else begin
      valid_q <= (in_valid_i || !in_ready_o) && !clear_i;
    end
  end

  always_ff @(posedge clk_i) begin
    if (in_valid_i && in_ready_o) begin
      entry_q <= entry_in;
      end_q   <= in_end_i;
      near_q  <= is_near;
    end
  end

  // A run is swallowed or not as a whole.
  assign drop    = begun_q ? drop_q : drop_i;
  assign joins   = count_q < CountBits'(LineEntries) ||
                   (tight_q && near_q && count_q != CountBits'(ShortEntries));
  assign line    = valid_q && !drop && (end_q ? count_q != '0 : !joins);
  assign written = line && out_ready_i;

  always_comb begin
    if (drop) begin
      ready = 1'b1;
    end else if (end_q) begin
      ready = count_q == '0 && run_ready_i;
    end else begin
      ready = joins || out_ready_i;
    end
  end

  assign entry        = valid_q && ready && !end_q && !drop;
  assign out_valid_o  = line;
  assign out_number_o = number_q;
  assign run_valid_o  = valid_q && end_q && !drop && count_q == '0;
  assign run_first_o  = first_q;
  assign run_last_o   = {newest_q[MaskBits+:Half], newest_q[MaskBits+Half+:Half]};
  assign run_lines_o  = lines_q;
  assign out_data_o   = Width'({count_q, tail_q, places_q, newest_q});

  // The newest entry goes to the place behind those that are there; from place Columns on to the gaps, which are emptied
  // before, and the tail: the low bits of what is kept to a whole gap, the rest behind the others'.
  logic [KeptBits-1:0]                 later;
  logic [Columns-1:0][GapBits-1:0]     gaps;
  logic [Over*RestBits-1:0]            rests;
  logic [ShortEntries-1:0]             to;  // entries of the line that the next one finds

  assign later = {newest_q[MaskBits+Half+:KeyKept], newest_q[0+:MaskBits+RecordKept]};

  for (genvar i = 0; i < ShortEntries; i++) begin : gen_to
    assign to[i] = count_q == CountBits'(i);
  end

  always_comb begin
    rests = '0;
    gaps  = '0;
    for (int unsigned k = 0; k < Over; k++) begin
      if (to[LineEntries+k]) begin
        gaps[k]                    = later[GapBits-1:0];
        rests[k*RestBits+:RestBits] = later[KeptBits-1:GapBits];
      end
    end
    {tail_d, gaps[Columns-1:Over]} = rests;
    tail_d = tail_d | tail_q;
    for (int unsigned i = 0; i < Columns; i++) begin
      places_d[i] = places_q[i];
      if (to[LineEntries]) begin
        places_d[i][MaskBits+RecordKept+:RecordGap]               = '0;
        places_d[i][MaskBits+Half+KeyKept+:GapBits-RecordGap]     = '0;
      end
      places_d[i][MaskBits+RecordKept+:RecordGap] =
          places_d[i][MaskBits+RecordKept+:RecordGap] | gaps[i][RecordGap-1:0];
      places_d[i][MaskBits+Half+KeyKept+:GapBits-RecordGap] =
          places_d[i][MaskBits+Half+KeyKept+:GapBits-RecordGap] | gaps[i][GapBits-1:RecordGap];
      if (to[i+1]) begin
        places_d[i] = newest_q;
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      count_q      <= '0;
      number_q     <= '0;
      run_number_q <= '0;
      lines_q      <= '0;
      begun_q      <= 1'b0;
      drop_q       <= 1'b0;
    end else begin
      if (valid_q && !begun_q) begin
        drop_q <= drop_i;
      end
      if (valid_q) begin
        begun_q <= !(end_q && ready);
      end
      if (written) begin
        count_q  <= CountBits'(entry);
        number_q <= number_q + 1'b1;
        lines_q  <= lines_q + 1'b1;
      end else if (entry) begin
        count_q <= count_q + 1'b1;
      end
      if (run_valid_o && run_ready_i) begin
        lines_q      <= '0;
        number_q     <= run_number_q + NumberBits'(RunLines);
        run_number_q <= run_number_q + NumberBits'(RunLines);
      end
      if (start_i || clear_i) begin
        number_q     <= '0;
        run_number_q <= '0;
        lines_q      <= '0;
        count_q      <= '0;
        begun_q      <= 1'b0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (entry) begin
      newest_q <= entry_q;
      tight_q  <= count_q == '0 || line || (tight_q && near_q);
    end
    if (entry && (line || count_q == '0)) begin
      places_q <= '0;
      tail_q   <= '0;
    end else if (entry) begin
      places_q <= places_d;
      tail_q   <= tail_d;
    end
    if (entry && count_q == '0) begin  // a line that ends within a run leaves an entry
      first_q <= {entry_q[MaskBits+:Half], entry_q[MaskBits+Half+:Half]};
    end
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_run_writer: line changed before its transfer");
`endif

endmodule
