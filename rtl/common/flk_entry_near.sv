// Whether an entry of a list can be told from the one that came behind it by the low bits of its record and
// key (docs/reference/list_layout.md): the record is less than 1 << RecordKept lower, the key less than
// 1 << KeyKept - 1 higher, or so much lower at most. Combinational.
module flk_entry_near #(
  parameter  int unsigned MaskBits   = 4,   // an entry: mask, record, key
  parameter  int unsigned RecordBits = 24,
  parameter  int unsigned KeyBits    = 24,
  parameter  int unsigned RecordKept = 9,
  parameter  int unsigned KeyKept    = 17,
  localparam int unsigned EntryBits  = MaskBits + RecordBits + KeyBits
) (
  input  logic [EntryBits-1:0] older_i,
  input  logic [EntryBits-1:0] newer_i,
  output logic                 near_o
);

  // The upper bits of the larger one are those of the smaller one, or one more where the lower ones fall.
  localparam int unsigned RecordUp = RecordBits - RecordKept;
  localparam int unsigned KeyUp    = KeyBits - KeyKept + 1;

  logic                  unused_mask;
  logic [RecordUp-1:0]   older_record, newer_record;
  logic [RecordKept:0]   older_record_low, newer_record_low;  // with a zero: there may be none
  logic [KeyUp-1:0]      older_key, newer_key;
  logic [KeyKept-1:0]    older_key_low, newer_key_low;
  logic                  record_one_more, newer_one_more, older_one_more, record_near, key_near;

  assign unused_mask      = ^{older_i[MaskBits-1:0], newer_i[MaskBits-1:0]};
  assign older_record     = older_i[MaskBits+RecordKept+:RecordUp];
  assign newer_record     = newer_i[MaskBits+RecordKept+:RecordUp];
  assign older_record_low = (RecordKept + 1)'({older_i[MaskBits+:RecordBits], 1'b0});
  assign newer_record_low = (RecordKept + 1)'({newer_i[MaskBits+:RecordBits], 1'b0});
  assign older_key        = older_i[EntryBits-1-:KeyUp];
  assign newer_key        = newer_i[EntryBits-1-:KeyUp];
  assign older_key_low    = KeyKept'({older_i[MaskBits+RecordBits+:KeyBits], 1'b0});
  assign newer_key_low    = KeyKept'({newer_i[MaskBits+RecordBits+:KeyBits], 1'b0});

  // a = b + 1 without a carry: a + ~b is zero. Not so where a is 0.
  assign record_one_more = newer_record != '0 &&
                           (newer_record ^ ~older_record) ==
                           RecordUp'({newer_record | ~older_record, 1'b0});
  assign newer_one_more  = newer_key != '0 &&
                           (newer_key ^ ~older_key) == KeyUp'({newer_key | ~older_key, 1'b0});
  assign older_one_more  = older_key != '0 &&
                           (older_key ^ ~newer_key) == KeyUp'({older_key | ~newer_key, 1'b0});

  assign record_near = newer_record_low < older_record_low ? record_one_more
                                                           : newer_record == older_record;
  assign key_near    = newer_key == older_key ||
                       (older_key_low < newer_key_low ? older_one_more : newer_one_more);
  assign near_o      = record_near && key_near;

endmodule
