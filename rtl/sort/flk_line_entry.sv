// An entry of a line of a list (docs/reference/list_layout.md): the newest first, then the one before it, and so on.
//
// at_i: 0 the newest, which lies in the first place; then the line's count - 1 down to 1. In a short line
// (short_i: more than LineEntries entries) a place holds the low bits of an entry, the others are those of
// the entry given before it, newer_i. Combinational.
module flk_line_entry #(
  parameter  int unsigned MaskBits     = 4,   // an entry: mask, record, key
  parameter  int unsigned RecordBits   = 24,
  parameter  int unsigned KeyBits      = 24,
  parameter  int unsigned RecordKept   = 9,   // low bits of both in a short line
  parameter  int unsigned KeyKept      = 17,
  parameter  int unsigned LineEntries  = 9,   // of a plain line
  parameter  int unsigned ShortEntries = 15,  // LineEntries: there are no short lines
  localparam int unsigned EntryBits    = MaskBits + RecordBits + KeyBits,
  localparam int unsigned Columns      = LineEntries - 1,
  localparam int unsigned Over         = ShortEntries - LineEntries,
  localparam int unsigned KeptBits     = MaskBits + RecordKept + KeyKept,
  localparam int unsigned GapBits      = EntryBits - KeptBits,
  localparam int unsigned RestBits     = KeptBits - GapBits,
  localparam int unsigned TailBits     = Over == 0 ? 0
                                                   : Over * RestBits - (Columns - Over) * GapBits,
  localparam int unsigned LineBits     = LineEntries * EntryBits + TailBits,
  localparam int unsigned AtBits       = $clog2(ShortEntries + 1)
) (
  input  logic [LineBits-1:0]  line_i,
  input  logic                 short_i,
  input  logic [AtBits-1:0]    at_i,
  input  logic [EntryBits-1:0] newer_i,
  output logic [EntryBits-1:0] entry_o
);

  logic [EntryBits-1:0] plain;

  // A loop's variable is no index of a line: a tool would make multipliers of it.
  always_comb begin
    plain = '0;
    for (int unsigned i = 0; i < LineEntries; i++) begin
      plain |= at_i == AtBits'(i) ? line_i[i*EntryBits+:EntryBits] : '0;
    end
  end

  if (Over == 0) begin : gen_plain
    logic unused;
    assign unused  = &{short_i, newer_i};
    assign entry_o = plain;
  end else begin : gen_short
    localparam int unsigned RecordGap = RecordBits - RecordKept;

    logic [Columns-1:0][GapBits-1:0] gaps;
    logic [KeptBits-1:0]             later;

    for (genvar i = 0; i < Columns; i++) begin : gen_gaps
      localparam int unsigned At = (i + 1) * EntryBits;
      assign gaps[i] = {line_i[At+MaskBits+RecordBits+KeyKept+:GapBits-RecordGap],
                        line_i[At+MaskBits+RecordKept+:RecordGap]};
    end

    logic [Over*RestBits-1:0] rests;

    if (Columns > Over) begin : gen_rests
      assign rests = {line_i[LineBits-1-:TailBits], gaps[Columns-1:Over]};
    end else begin : gen_tail
      assign rests = line_i[LineBits-1-:TailBits];
    end

    always_comb begin
      later = '0;
      for (int unsigned k = 0; k < Over; k++) begin
        later |= at_i == AtBits'(LineEntries + k) ? {rests[k*RestBits+:RestBits], gaps[k]} : '0;
      end
    end

    logic [MaskBits-1:0]   mask;
    logic [RecordKept-1:0] record_low;
    logic [KeyKept-1:0]    key_low, key_turn;
    logic [RecordBits-1:0] record;
    logic [KeyBits-1:0]    key;
    logic                  whole, unused_mask;

    assign unused_mask = ^newer_i[MaskBits-1:0];
    assign whole = !short_i || at_i == '0;
    assign {key_low, record_low, mask} =
        at_i >= AtBits'(LineEntries) ? later
                                     : {plain[MaskBits+RecordBits+:KeyKept],
                                        plain[0+:MaskBits+RecordKept]};

    // The record is not above the newer one, the key at most half of what is kept from it.
    logic [RecordBits-1:0] newer_record;
    logic [KeyBits-1:0]    newer_key;
    logic                  borrow;

    assign newer_record = newer_i[MaskBits+:RecordBits];
    assign newer_key    = newer_i[MaskBits+RecordBits+:KeyBits];
    assign borrow       = record_low > newer_record[RecordKept-1:0];
    assign record       = {newer_record[RecordBits-1:RecordKept] -
                           (RecordBits - RecordKept)'(borrow), record_low};
    assign key_turn     = key_low - newer_key[KeyKept-1:0];
    assign key          = newer_key + {{(KeyBits - KeyKept) {key_turn[KeyKept-1]}}, key_turn};
    assign entry_o      = whole ? plain : {key, record, mask};
  end

endmodule
