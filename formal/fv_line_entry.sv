// flk_entry_near and flk_line_entry: two entries are near by what docs/reference/list_layout.md says of their numbers,
// and then the older one comes back from what a short line keeps of it, wherever it lies; in a plain line and in the
// first place it comes back whatever it is. What else is in the line does not matter.
module fv_line_entry #(
  parameter  int unsigned LineEntries  = 9,
  parameter  int unsigned ShortEntries = 15,
  localparam int unsigned Columns      = LineEntries - 1,
  localparam int unsigned Over         = ShortEntries - LineEntries,
  localparam int unsigned TailBits     = Over * 8 - (Columns - Over) * 22,
  localparam int unsigned LineBits     = LineEntries * 52 + TailBits
) (
  input logic [LineBits-1:0] line_i,
  input logic                short_i,
  input logic [3:0]          at_i,
  input logic [51:0]         older_i,
  input logic [51:0]         newer_i
);

  logic                is_near, due;
  logic [LineBits-1:0] line;
  logic [51:0]         entry;
  logic [24:0]         record, key;
  logic [29:0]         kept;

  flk_entry_near i_near (.older_i, .newer_i, .near_o(is_near));

  flk_line_entry #(
    .LineEntries (LineEntries),
    .ShortEntries(ShortEntries)
  ) dut (
    .line_i (line),
    .short_i,
    .at_i,
    .newer_i,
    .entry_o(entry)
  );

  assign record = {1'b0, newer_i[27:4]} - {1'b0, older_i[27:4]};
  assign key    = {1'b0, older_i[51:28]} - {1'b0, newer_i[51:28]};
  assign due    = record <= 25'd511 && (key <= 25'd65535 || key >= 25'h1ff0000);
  assign kept   = {older_i[44:28], older_i[12:0]};

  // Bits of the gaps, in their order: of entry k, 22 of them.
  function automatic int unsigned gap_at(input int unsigned bit_);
    int unsigned k, b;
    k = bit_ / 22;
    b = bit_ % 22;
    if (k >= Columns) begin
      return LineEntries * 52 + bit_ - Columns * 22;
    end
    return (k + 1) * 52 + (b < 15 ? 13 + b : 30 + b);
  endfunction

  always_comb begin
    line = line_i;
    for (int unsigned i = 0; i < LineEntries; i++) begin
      if (at_i == 4'(i)) begin
        if (!short_i || i == 0) begin
          line[52*i+:52] = older_i;
        end else begin
          line[52*i+:13]    = kept[12:0];
          line[52*i+28+:17] = kept[29:13];
        end
      end
    end
    for (int unsigned k = 0; k < Over; k++) begin
      if (at_i == 4'(LineEntries + k)) begin
        for (int unsigned b = 0; b < 30; b++) begin
          line[gap_at(b < 22 ? 22 * k + b : 22 * Over + 8 * k + b - 22)] = kept[b];
        end
      end
    end
  end

  always_comb begin
    assume (at_i < 4'(short_i ? ShortEntries : LineEntries));
    a_near: assert (is_near == due);
    if (!short_i || at_i == 4'd0) begin
      a_plain: assert (entry == older_i);
    end else if (is_near) begin
      a_short: assert (entry == older_i);
    end
    c_last: cover (short_i && at_i == 4'(ShortEntries - 1) && is_near && record == 25'd511 && key == 25'h1ff0000);
    c_carry: cover (short_i && is_near && record[8:0] == 9'd300 && key == 25'd65535);
  end

endmodule
