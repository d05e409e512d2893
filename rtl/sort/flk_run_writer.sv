// Sorted runs to lines of memory: a list's entries that a sorting unit does not hold (docs/reference/list_sorter.md).
//
// A run is entries, in order, then an element with in_end_i (no entry). Nine of them and their number are a
// line; in a run's last line the last entry fills the places that are left. Lines have numbers from 0 on,
// across runs; start_i, while nothing is inside, begins with 0 again. When a run's last line has been taken
// its first and last key and the lines it took are offered as run_*; its end is taken with these.
// drop_i: a run that begins is swallowed with its end, and gives no line.
// Throughput: an entry a cycle, two cycles for an end. Combinational: in_entry_i to out_data_o, in_valid_i and in_end_i to
// out_valid_o, out_ready_i and run_ready_i to in_ready_o. clear_i (synchronous) empties it.
module flk_run_writer #(
  parameter  int unsigned LineEntries = 9,
  parameter  int unsigned EntryBits   = 52,
  parameter  int unsigned MaskBits    = 4,
  parameter  int unsigned NumberBits  = 14,  // of a line
  parameter  int unsigned RunBits     = 8,   // of a run's lines
  parameter  int unsigned Width       = 512,
  localparam int unsigned KeyBits     = EntryBits - MaskBits
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  input  logic                  start_i,
  input  logic                  drop_i,
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

  localparam int unsigned Held = LineEntries - 1;
  localparam int unsigned CountBits = 4;

  if (LineEntries < 2 || LineEntries >= 1 << CountBits ||
      LineEntries * EntryBits + CountBits > Width) begin : gen_check
    $error("flk_run_writer: LineEntries and their number must fit a line");
  end

  logic [Held-1:0][EntryBits-1:0] held_q;
  logic [CountBits-1:0]           count_q;
  logic [KeyBits-1:0]             first_q;
  logic [NumberBits-1:0]          number_q;
  logic [RunBits-1:0]             lines_q;
  logic                           begun_q, drop_q, drop;
  logic                           entry, line, last_place, written;

  // A run is swallowed or not as a whole.
  assign drop       = begun_q ? drop_q : drop_i;
  assign last_place = count_q == CountBits'(Held);
  assign line       = in_valid_i && !drop && (in_end_i ? count_q != '0 : last_place);
  assign written    = line && out_ready_i;

  always_comb begin
    if (drop) begin
      in_ready_o = 1'b1;
    end else if (in_end_i) begin
      in_ready_o = count_q == '0 && run_ready_i;
    end else begin
      in_ready_o = !last_place || out_ready_i;
    end
  end

  assign entry        = in_valid_i && in_ready_o && !in_end_i && !drop;
  assign out_valid_o  = line;
  assign out_number_o = number_q;
  assign run_valid_o  = in_valid_i && in_end_i && !drop && count_q == '0;
  assign run_first_o  = first_q;
  assign run_last_o   = held_q[Held-1][EntryBits-1:MaskBits];
  assign run_lines_o  = lines_q;

  always_comb begin
    out_data_o                                = '0;
    out_data_o[Held*EntryBits-1:0]            = held_q;
    out_data_o[Held*EntryBits+:EntryBits]     = in_end_i ? held_q[Held-1] : in_entry_i;
    out_data_o[LineEntries*EntryBits+:CountBits] = in_end_i ? count_q : CountBits'(LineEntries);
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      count_q  <= '0;
      number_q <= '0;
      lines_q  <= '0;
      begun_q  <= 1'b0;
      drop_q   <= 1'b0;
    end else begin
      if (in_valid_i && !begun_q) begin
        drop_q <= drop_i;
      end
      if (in_valid_i) begin
        begun_q <= !(in_end_i && in_ready_o);
      end
      if (written) begin
        count_q  <= '0;
        number_q <= number_q + 1'b1;
        lines_q  <= lines_q + 1'b1;
      end else if (entry) begin
        count_q <= count_q + 1'b1;
      end
      if (run_valid_o && run_ready_i) begin
        lines_q <= '0;
      end
      if (start_i || clear_i) begin
        number_q <= '0;
        lines_q  <= '0;
        count_q  <= '0;
        begun_q  <= 1'b0;
      end
    end
  end

  // An entry goes to its place and all behind it, so that what is left of a line holds its last one.
  always_ff @(posedge clk_i) begin
    for (int unsigned i = 0; i < Held; i++) begin
      if (entry && (i == Held - 1 || count_q <= CountBits'(i))) begin
        held_q[i] <= in_entry_i;
      end
    end
    if (entry && count_q == '0 && lines_q == '0) begin
      first_q <= in_entry_i[EntryBits-1:MaskBits];
    end
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_run_writer: line changed before its transfer");
`endif

endmodule
