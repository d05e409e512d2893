// First step of sorting: a stream's entries in sorted runs of Cells, by insertion.
//
// A list is entries in any order, then an element with in_end_i (no entry; in_flag_i goes with it).
// Out come its runs one after the other, each sorted by the upper KeyBits (unsigned, smallest first),
// all of Cells entries but the last one of the list, and the end with its flag. Of an entry
// out_flag_o says that the list is known to have no other run.
// One line of cells holds whole runs, in front, and behind them the one that is gathered: a new entry
// goes to its place in this one, what is behind it makes room. A run of Cells entries is whole when all
// cells hold it, a shorter one when its list's end comes; so an entry leaves for each one taken.
// Latency: a run may leave from the cycle on after its last entry or the list's end came. Throughput:
// an entry a cycle. in_ready_o depends combinationally on out_ready_i and in_end_i; outputs come from
// registers. clear_i (synchronous) empties it.
module flk_sort_runs #(
  parameter  int unsigned Cells       = 16,
  parameter  int unsigned KeyBits     = 48,
  parameter  int unsigned PayloadBits = 4,
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
  // Fill
  output logic                 end_o,    // an end is inside
  output logic                 empty_o
);

  if (Cells < 2) begin : gen_check
    $error("flk_sort_runs: Cells must be at least 2");
  end

  // Cells in use; those of whole runs, in front; whose list ends behind them, with what flag; whose list
  // has no other run.
  logic [Cells-1:0] used_d, used_q, used_left;
  logic [Cells-1:0] whole_d, whole_q, whole_left;
  logic [Cells-1:0] ends_d, ends_q, ends_left, flags_d, flags_q, flags_left;
  logic [Cells-1:0] only_d, only_q, only_left;
  logic             end_d, end_q, flag_d, flag_q, end_left, flag_left;  // an end at the output
  logic             first_d, first_q;  // the run that is gathered is its list's first one
  logic             pop, push, take_end, full_run;
  logic [Cells-1:0] top;  // the last cell in use

  assign pop        = whole_q[0] && !end_q && out_ready_i;
  assign used_left  = pop ? used_q >> 1 : used_q;
  assign whole_left = pop ? whole_q >> 1 : whole_q;
  assign ends_left  = pop ? ends_q >> 1 : ends_q;
  assign flags_left = pop ? flags_q >> 1 : flags_q;
  assign only_left  = pop ? only_q >> 1 : only_q;
  assign end_left   = pop ? ends_q[0] : end_q && !out_ready_i;
  assign flag_left  = pop ? flags_q[0] : flag_q;
  assign top        = used_left & ~(used_left >> 1);

  // An end stands behind the last entry, or at the output; where there is one already it waits.
  assign in_ready_o = !in_end_i ? !used_left[Cells-1]
                    : used_left[0] ? (top & ends_left) == '0 : !end_left;
  assign push       = in_valid_i && in_ready_o && !in_end_i;
  assign take_end   = in_valid_i && in_ready_o && in_end_i;
  assign full_run   = used_d[Cells-1] && !whole_left[0];

  always_comb begin
    used_d  = push ? {used_left[Cells-2:0], 1'b1} : used_left;
    whole_d = full_run || take_end ? used_d : whole_left;
    ends_d  = take_end ? ends_left | top : ends_left;
    flags_d = take_end ? (flags_left & ~top) | (in_flag_i ? top : '0) : flags_left;
    only_d  = take_end ? only_left | (first_q ? used_left & ~whole_left : '0) : only_left;
    end_d   = end_left || (take_end && !used_left[0]);
    flag_d  = take_end && !used_left[0] ? in_flag_i : flag_left;
    first_d = take_end || (first_q && !full_run);
    if (clear_i) begin
      used_d  = '0;
      whole_d = '0;
      ends_d  = '0;
      only_d  = '0;
      end_d   = 1'b0;
      first_d = 1'b1;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      used_q  <= '0;
      whole_q <= '0;
      ends_q  <= '0;
      flags_q <= '0;
      only_q  <= '0;
      end_q   <= 1'b0;
      flag_q  <= 1'b0;
      first_q <= 1'b1;
    end else begin
      used_q  <= used_d;
      whole_q <= whole_d;
      ends_q  <= ends_d;
      flags_q <= flags_d;
      only_q  <= only_d;
      end_q   <= end_d;
      flag_q  <= flag_d;
      first_q <= first_d;
    end
  end

  // Cells

  logic [Cells:0]                  behind;  // the new entry's place is before this cell
  logic [Cells-1:0][EntryBits-1:0] cell_q;

  assign behind[Cells] = 1'b1;

  for (genvar i = 0; i < Cells; i++) begin : gen_cell
    localparam int unsigned Above = i == Cells - 1 ? i : i + 1;
    localparam int unsigned Below = i == 0 ? i : i - 1;
    logic down, up, move;

    assign behind[i] = !used_q[i] ||
                       (!whole_q[i] && in_entry_i[EntryBits-1:PayloadBits] <
                                         cell_q[i][EntryBits-1:PayloadBits]);
    // Towards the output, away from it; else the new entry.
    assign down = pop && !(push && behind[i+1]);
    assign up   = !pop && i != 0 && behind[Below];
    assign move = pop ? !push || !behind[i] : push && behind[i];

    always_ff @(posedge clk_i) begin
      if (move) begin
        cell_q[i] <= down ? cell_q[Above] : up ? cell_q[Below] : in_entry_i;
      end
    end
  end

  assign out_valid_o = whole_q[0] || end_q;
  assign out_end_o   = end_q;
  assign out_flag_o  = end_q ? flag_q : only_q[0];
  assign out_entry_o = cell_q[0];
  assign end_o       = end_q || ends_q != '0;
  assign empty_o     = !used_q[0] && !end_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=>
      out_valid_o && $stable({out_end_o, out_flag_o}) && (out_end_o || $stable(out_entry_o)))
  else $error("flk_sort_runs: output changed before its transfer");
`endif

endmodule
