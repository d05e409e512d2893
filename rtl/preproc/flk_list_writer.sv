// List writer: entries of the tiles of one parity, or of several, into lists in DRAM (docs/reference/list_writer.md).
//
// Tiles of one parity of row and column are a bank: their lists have chunks and lines of pointers of their own. A writer of
// Banks banks writes of each what a writer of its own would: sets of the combiner, pointers and chunks taken are by bank. Its
// banks are writer_i and every (4 / Banks)th one behind it; in_bank_i says which of them. Pointers, Lists, columns_i,
// pointer_lines_i and chunks_i are of a bank; failed_o rises with the first bank that needs a chunk more than chunks_i, and of
// that bank alone nothing more is written.
//
// A frame: start_i with the configuration while idle_o; entries; an element with in_end_i, which
// carries no entry; then the lines still open are written, then the pointers; done_o for one cycle,
// with failed_o and the counters, which stay until the next start. When a chunk more is needed than
// chunks_i, failed_o rises and nothing more is written in the frame.
// Throughput: an entry a cycle. A line is at the output six cycles after the entry that causes it.
// At the end a cycle for each line of the combiner and each pointer of pointer_lines_i. After reset,
// Banks x max(Pointers, sets) cycles until idle_o. One request a line, whole: address in lines, and data.
// in_ready_o depends combinationally on out_ready_i, the pointer's write on move_write_i; no other path.
//
// A frame of more lists than Pointers ("large"): the pointers are a store of lines, line n in place n
// modulo Pointers / a line's pointers. Each line of entries that goes waits two cycles in stage D for
// the tag of its place. If another line of pointers is there, it is moved to its place in the
// pointer table, and the wanted one comes from there if it was there before; else it is zeros.
// Who moves (flk_pointer_port) gets a request with the numbers of both lines, reads (move_read_i,
// the pointer a cycle later) and writes pointers of the place, and says move_done_i; all stands for
// so long. At the end lines that are in the table and not held are left out, two cycles each and
// two more than a cycle a pointer for the others, and idle_o comes Banks x max(Pointers, sets) cycles after
// done_o. After failed_o nothing is moved; lines that were moved before stay in the table.
//
// A line has up to LineEntries entries whatever they are, up to ShortEntries where each is near the
// one before it (docs/reference/list_layout.md): then of all but the newest only KeptBits are kept,
// and entries from LineEntries on lie in the gaps of the others. The newest entry of each open line lies
// beside its set's row; the next one pushes it into the columns: LineEntries - 1 words of EntryBits, each
// of a part that is kept and of a gap, which is written a second time by a later entry.
//
// Pipeline, moving as a whole when the output register is free: A entry taken, number of its list;
// R row of the set and its newest entries are read; B hits, and near or not, of all ways; C hit, free
// way or the way in turn, row written, pointer read; D pointer updated, line read if it has to go; E the
// entry before written to its line, line and address put together; F output register. What stage E
// writes while D reads the same line, or C while R or B have the same row, is taken from registers, not
// from the memory; pointers need none, since two lines of a list never follow each other in
// neighbouring stages: a line that has just begun behind one that went is not the next to go.
module flk_list_writer #(
  parameter  int unsigned Banks       = 1,     // 1, 2 or 4
  parameter  int unsigned SetBitsU    = 3,     // bits of the tile's column that choose a set
  parameter  int unsigned SetBitsV    = 3,     // of its row
  parameter  int unsigned Ways        = 4,
  parameter  int unsigned Pointers    = 2048,  // held, a multiple of a line's pointers
  parameter  int unsigned Lists       = 16384, // at most, a multiple of Pointers
  parameter  int unsigned CoordBits   = 7,     // of u and v
  parameter  int unsigned ChunkLines  = 8,
  parameter  int unsigned ChunkBits   = 24,
  parameter  int unsigned MaskBits    = 4,     // an entry: mask, record, key
  parameter  int unsigned RecordBits  = 24,
  parameter  int unsigned KeyBits     = 24,
  parameter  int unsigned RecordKept  = 9,     // low bits of both in a short line
  parameter  int unsigned KeyKept     = 17,
  parameter  int unsigned LineEntries = 9,
  parameter  int unsigned ShortEntries = 15,
  parameter  int unsigned LineBits    = 512,
  parameter  int unsigned PointerBits = 32,
  parameter  int unsigned AddressBits = 34,
  localparam int unsigned EntryBits   = MaskBits + RecordBits + KeyBits,
  localparam int unsigned BankBits    = Banks > 1 ? $clog2(Banks) : 1,
  localparam int unsigned LinesBits   = $clog2(Lists * PointerBits / LineBits + 1),
  localparam int unsigned IndexBits   = $clog2(LineBits / PointerBits), // of a pointer in its line
  localparam int unsigned MoveBits    = $clog2(ChunkLines + 1) + ChunkBits,
  localparam int unsigned AllBits     = $clog2(Banks * Lists * PointerBits / LineBits + 1),
  localparam int unsigned NumberBits  = AllBits > 1 ? AllBits - 1 : 1  // of a line of pointers
) (
  input  logic                   clk_i,
  input  logic                   rst_ni,
  // Frame
  input  logic                   start_i,
  output logic                   idle_o,
  input  logic [1:0]             writer_i,         // first bank: parity of tiles, row and column
  input  logic [CoordBits:0]     columns_i,        // tiles of a bank in a row
  input  logic [LinesBits-1:0]   pointer_lines_i,  // lines of pointers of a bank
  input  logic [ChunkBits:0]     chunks_i,         // a bank may take
  input  logic [AddressBits-1:0] list_base_i,      // in lines
  input  logic [AddressBits-1:0] pointer_base_i,
  output logic                   done_o,
  output logic                   failed_o,
  output logic [31:0]            entries_o,
  output logic [31:0]            lines_o,
  output logic [31:0]            evicted_o,
  output logic [Banks-1:0][ChunkBits:0] taken_o,
  // Entries
  input  logic                   in_valid_i,
  output logic                   in_ready_o,
  input  logic                   in_end_i,
  input  logic [BankBits-1:0]    in_bank_i,
  input  logic [CoordBits-1:0]   in_u_i,
  input  logic [CoordBits-1:0]   in_v_i,
  input  logic [EntryBits-1:0]   in_entry_i,
  // Lines to memory
  output logic                   out_valid_o,
  input  logic                   out_ready_i,
  output logic [AddressBits-1:0] out_address_o,
  output logic [LineBits-1:0]    out_data_o,
  // Lines of pointers to and from their table
  output logic                   move_valid_o,
  input  logic                   move_ready_i,
  output logic                   move_put_o,       // a line goes: its number
  output logic [NumberBits-1:0]  move_put_line_o,
  output logic                   move_get_o,       // the wanted line comes; else it is zeros
  output logic [NumberBits-1:0]  move_get_line_o,
  input  logic [IndexBits-1:0]   move_index_i,
  input  logic                   move_read_i,
  output logic [MoveBits-1:0]    move_pointer_o,
  input  logic                   move_write_i,
  input  logic [MoveBits-1:0]    move_pointer_i,
  input  logic                   move_done_i
);

  localparam int unsigned BankShift = $clog2(Banks);
  localparam int unsigned Held = Banks * Pointers;
  localparam int unsigned All = Banks * Lists;
  localparam int unsigned ListBits = $clog2(All);
  localparam int unsigned TileBits = SetBitsU + SetBitsV;  // of a tile, in its set's number
  localparam int unsigned TileSetBits = TileBits > 0 ? TileBits : 1;
  localparam int unsigned Sets = Banks << TileBits;
  localparam int unsigned SetBits = TileBits + BankShift > 0 ? TileBits + BankShift : 1;
  localparam int unsigned WayBits = $clog2(Ways);
  localparam int unsigned PlaceBits = SetBits + WayBits;
  localparam int unsigned CountBits = $clog2(ShortEntries + 1);
  localparam int unsigned UsedBits = $clog2(ChunkLines + 1);
  localparam int unsigned PerLine = LineBits / PointerBits;
  localparam int unsigned PerLineBits = IndexBits;
  localparam int unsigned HeldBits = Held > 1 ? $clog2(Held) : 1;
  localparam int unsigned Places = Pointers / PerLine;  // of lines of pointers, of a bank
  localparam int unsigned AllPlaces = Banks * Places;
  localparam int unsigned PlacesBits = AllPlaces > 1 ? $clog2(AllPlaces) : 1;
  localparam int unsigned Sharing = Lists / Pointers;   // lines that share a place
  localparam int unsigned TagBits = Sharing > 1 ? $clog2(Sharing) : 1;
  // Of a short line: entries beyond LineEntries, each in a whole gap and a rest, the rests in the
  // gaps that are left and in the tail.
  localparam int unsigned Columns = LineEntries - 1;
  localparam int unsigned Over = ShortEntries - LineEntries;
  localparam int unsigned KeptBits = MaskBits + RecordKept + KeyKept;
  localparam int unsigned GapBits = EntryBits - KeptBits;
  localparam int unsigned RestBits = KeptBits - GapBits;
  localparam int unsigned TailBits = Over * RestBits - (Columns - Over) * GapBits;
  localparam int unsigned HeaderAt = LineEntries * EntryBits + TailBits;
  localparam int unsigned HeaderCount = 4;
  // Lists of a set have these bits in common.
  localparam int unsigned Common = SetBitsU < SetBitsV ? SetBitsU : SetBitsV;
  localparam int unsigned Clear = Held > Sets ? Held : Sets;
  localparam int unsigned Most = Clear > All ? Clear : All;
  localparam int unsigned Steps = Most > Sets * Ways ? Most : Sets * Ways;
  localparam int unsigned StepBits = $clog2(Steps + 1);

  if (Banks != 1 && Banks != 2 && Banks != 4) begin : gen_check_banks
    $error("flk_list_writer: Banks must be 1, 2 or 4");
  end
  if (Ways < 2 || Ways != 1 << WayBits) begin : gen_check_ways
    $error("flk_list_writer: Ways must be a power of two, at least 2");
  end
  if (PerLine < 2 || PerLine != 1 << PerLineBits || Pointers % PerLine != 0) begin : gen_check_table
    $error("flk_list_writer: Pointers must be a multiple of a line's pointers (2, 4, 8, ...)");
  end
  if (Lists < Pointers || Sharing != 1 << $clog2(Sharing) || Lists != Pointers * Sharing ||
      (Sharing > 1 && Pointers != 1 << $clog2(Pointers))) begin : gen_check_lists
    $error("flk_list_writer: Lists must be Pointers, or both powers of two");
  end
  if (ChunkLines < 2 || (ChunkLines & (ChunkLines - 1)) != 0) begin : gen_check_chunk
    $error("flk_list_writer: ChunkLines must be a power of two, at least 2");
  end
  if (LineEntries < 3 || ShortEntries > 15 || HeaderAt + HeaderCount + ChunkBits + 1 > LineBits ||
      ChunkBits + UsedBits > PointerBits) begin : gen_check_line
    $error("flk_list_writer: entries, count and link must fit a line, a chunk's use a pointer");
  end
  if (ShortEntries <= LineEntries || Over > Columns || RestBits < 1 ||
      (Over < Columns && RestBits > GapBits) ||
      RecordKept > RecordBits || KeyKept > KeyBits || KeyKept < 1 ||
      Over * RestBits <= (Columns - Over) * GapBits) begin : gen_check_short
    $error("flk_list_writer: entries of a short line must fill the gaps and some bits more");
  end

  // ---- frame --------------------------------------------------------------------------------------

  typedef enum logic [2:0] {CLEAR, IDLE, ENTRIES, OPEN_LINES, DRAIN, POINTERS, LAST} state_e;

  state_e                 state_d, state_q;
  logic [StepBits-1:0]    step_d, step_q;
  logic                   advance, take, take_end, flushing, walking, busy;
  logic                   start, last_line;

  logic [1:0]             writer_q;
  logic [CoordBits:0]     columns_q;
  logic [AllBits-1:0]     pointer_lines_q;  // of all banks
  logic [ChunkBits:0]     chunks_q;
  logic [AddressBits-1:0] base_q, pointer_base_q;  // base_q: of lists, then of pointers
  logic                   large_q;

  // A line of pointers, of an event in stage D or of the walk at the end: its place is read, its tag
  // compared; then it is moved, and the pointer is read again, or it is walked.
  typedef enum logic [2:0] {LOOK, COMPARE, ASK, MOVE, AGAIN, WALK} look_e;

  look_e look_q;
  logic  hold_q;   // an event in stage D waits for its pointer
  logic  blank_q;  // the line of the walk was never wanted
  logic  skip;     // or it is in the table

  assign start    = state_q == IDLE && start_i;
  assign take     = in_valid_i && in_ready_o && !in_end_i;
  assign take_end = in_valid_i && in_ready_o && in_end_i;
  assign flushing = state_q == OPEN_LINES;
  assign walking  = state_q == POINTERS && (!large_q || look_q == WALK);
  assign last_line = AllBits'(step_q >> PerLineBits) == pointer_lines_q - 1'b1;

  always_comb begin
    state_d = state_q;
    step_d  = step_q;
    unique case (state_q)
      CLEAR: begin
        step_d = step_q + 1'b1;
        if (step_q == StepBits'(Clear - 1)) begin
          state_d = IDLE;
        end
      end
      IDLE: begin
        if (start_i) begin
          state_d = ENTRIES;
        end
      end
      ENTRIES: begin
        step_d = '0;
        if (take_end) begin
          state_d = OPEN_LINES;
        end
      end
      OPEN_LINES: begin
        if (advance) begin
          step_d = step_q + 1'b1;
          if (step_q == StepBits'(Sets * Ways - 1)) begin
            state_d = DRAIN;
          end
        end
      end
      DRAIN: begin
        step_d = '0;
        if (!busy) begin
          state_d = pointer_lines_q == '0 ? LAST : POINTERS;
        end
      end
      POINTERS: begin
        if (advance && walking) begin
          step_d = step_q + 1'b1;
          if (last_line && (&step_q[PerLineBits-1:0])) begin
            state_d = LAST;
          end
        end else if (skip) begin
          step_d = step_q + StepBits'(PerLine);
          if (last_line) begin
            state_d = LAST;
          end
        end
      end
      LAST: begin
        step_d = '0;
        if (!busy) begin
          state_d = large_q ? CLEAR : IDLE;
        end
      end
      default: state_d = CLEAR;
    endcase
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= CLEAR;
      step_q  <= '0;
    end else begin
      state_q <= state_d;
      step_q  <= step_d;
    end
  end

  always_ff @(posedge clk_i) begin
    if (start) begin
      writer_q        <= writer_i;
      columns_q       <= columns_i;
      pointer_lines_q <= AllBits'(pointer_lines_i) << BankShift;
      chunks_q        <= chunks_i;
      pointer_base_q  <= pointer_base_i;
      large_q         <= 32'(pointer_lines_i) > Places;
    end
    if (start) begin
      base_q <= list_base_i;
    end else if (walking) begin
      base_q <= pointer_base_q;
    end
  end

  // ---- A: an entry, or a line to be closed ----------------------------------------------------------

  logic                 a_valid_d, a_valid_q, a_flush_q;
  logic [WayBits-1:0]   a_way_q;
  logic [TileSetBits-1:0] tile_set;
  logic [SetBits-1:0]   a_set_d, a_set_q;
  logic [ListBits-1:0]  a_list_q, a_list;  // in its bank; of all
  logic [EntryBits-1:0] a_entry_q;

  assign in_ready_o = advance && state_q == ENTRIES;
  assign a_valid_d  = take || flushing;

  if (TileBits == 0) begin : gen_one_set
    assign tile_set = '0;
  end else if (SetBitsV == 0) begin : gen_row_sets
    assign tile_set = in_u_i[SetBitsU-1:0];
  end else if (SetBitsU == 0) begin : gen_column_sets
    assign tile_set = in_v_i[SetBitsV-1:0];
  end else begin : gen_sets
    assign tile_set = {in_v_i[SetBitsV-1:0], in_u_i[SetBitsU-1:0]};
  end

  // A bank has sets of its own. In the numbers of all lists it stands above the bits that number a line's pointers, so that lines of
  // pointers are those of all banks in turn, as in the table.
  if (Banks == 1) begin : gen_bank
    logic unused_bank;
    assign unused_bank = ^in_bank_i;
    assign a_set_d     = tile_set;
    assign a_list      = a_list_q;
  end else begin : gen_banks
    localparam int unsigned Above = PerLineBits + BankShift;
    logic [BankBits-1:0] a_bank;

    assign a_set_d = SetBits'({in_bank_i, tile_set} >> (TileSetBits - TileBits));
    assign a_bank  = BankBits'(a_set_q >> TileBits);
    assign a_list  = ((a_list_q >> PerLineBits) << Above) |
                     ListBits'({a_bank, a_list_q[PerLineBits-1:0]});
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      a_valid_q <= 1'b0;
    end else if (advance) begin
      a_valid_q <= a_valid_d;
    end
  end

  always_ff @(posedge clk_i) begin
    if (advance && a_valid_d) begin
      a_flush_q <= flushing;
      a_way_q   <= WayBits'(step_q);
      a_set_q   <= flushing ? SetBits'(step_q >> WayBits) : a_set_d;
      a_list_q  <= ListBits'(in_v_i) * ListBits'(columns_q) + ListBits'(in_u_i);
      a_entry_q <= in_entry_i;
    end
  end

  // ---- R: row of the set ----------------------------------------------------------------------------

  typedef logic [EntryBits-1:0] entry_t;

  typedef struct packed {
    logic                 tight;  // all entries are near each other
    logic [CountBits-1:0] count;  // 0: free
    logic [ListBits-1:0]  list;
  } way_t;

  typedef struct packed {
    logic [WayBits-1:0] turn;
    way_t [Ways-1:0]    way;
  } row_t;

  logic                 r_valid_q, r_flush_q;
  logic [WayBits-1:0]   r_way_q;
  logic [SetBits-1:0]   r_set_q;
  logic [ListBits-1:0]  r_list_q;
  entry_t               r_entry_q;
  row_t                 row_read, r_row, r_row_q, row, row_d;
  entry_t [Ways-1:0]    newest_read, r_newest;
  logic                 r_kept_q;    // r_row_q is what the set held when it was read
  logic [Ways-1:0]      r_pushed_q;  // this way's newest entry is then r_pushed_entry_q
  entry_t               r_pushed_entry_q;
  logic                 row_write;
  logic [Ways-1:0]      c_one;       // stage C: the way that is meant
  logic                 c_same;      // the entry in stage R has the set of the one in C

  logic                 b_valid_q, b_flush_q;
  logic [WayBits-1:0]   b_way_q;
  logic [SetBits-1:0]   b_set_q;
  logic [ListBits-1:0]  b_list_q;
  logic [EntryBits-1:0] b_entry_q;
  row_t                 b_row_q;
  entry_t [Ways-1:0]    b_newest_q;
  logic [Ways-1:0]      b_lists_q;  // the way's list is the entry's
  logic [Ways-1:0]      b_near_q;   // its newest entry is near it

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      r_valid_q <= 1'b0;
      b_valid_q <= 1'b0;
    end else if (advance) begin
      r_valid_q <= a_valid_q;
      b_valid_q <= r_valid_q;
    end
  end

  always_ff @(posedge clk_i) begin
    if (advance && a_valid_q) begin
      r_flush_q        <= a_flush_q;
      r_way_q          <= a_way_q;
      r_set_q          <= a_set_q;
      r_list_q         <= a_list;
      r_entry_q        <= a_entry_q;
      r_row_q          <= row_d;
      r_kept_q         <= row_write && b_set_q == a_set_q;
      r_pushed_q       <= row_write && b_set_q == a_set_q && !b_flush_q ? c_one : '0;
      r_pushed_entry_q <= b_entry_q;
    end
  end

  flk_sram #(
    .Width($bits(row_t)),
    .Depth(Sets)
  ) i_rows (
    .clk_i,
    .wr_en_i  (row_write || (state_q == CLEAR && step_q < StepBits'(Sets))),
    .wr_addr_i(state_q == CLEAR ? SetBits'(step_q) : b_set_q),
    .wr_data_i(state_q == CLEAR ? '0 : row_d),
    .rd_en_i  (advance && a_valid_q),
    .rd_addr_i(a_set_q),
    .rd_data_o(row_read)
  );

  for (genvar w = 0; w < Ways; w++) begin : gen_newest
    flk_sram #(
      .Width(EntryBits),
      .Depth(Sets)
    ) i_newest (
      .clk_i,
      .wr_en_i  (row_write && !b_flush_q && c_one[w]),
      .wr_addr_i(b_set_q),
      .wr_data_i(b_entry_q),
      .rd_en_i  (advance && a_valid_q),
      .rd_addr_i(a_set_q),
      .rd_data_o(newest_read[w])
    );
  end

  // ---- B: what is known of all ways -----------------------------------------------------------------

  logic [Ways-1:0] r_lists, r_near;
  logic            r_list_same, r_near_same;  // of the entry in stage C

  assign r_row       = r_kept_q ? r_row_q : row_read;
  assign r_list_same = b_list_q[ListBits-1:Common] == r_list_q[ListBits-1:Common];
  assign c_same      = b_valid_q && b_set_q == r_set_q;

  flk_entry_near #(
    .MaskBits  (MaskBits),
    .RecordBits(RecordBits),
    .KeyBits   (KeyBits),
    .RecordKept(RecordKept),
    .KeyKept   (KeyKept)
  ) i_near_same (
    .older_i(b_entry_q),
    .newer_i(r_entry_q),
    .near_o (r_near_same)
  );

  for (genvar w = 0; w < Ways; w++) begin : gen_ways
    assign r_newest[w] = r_pushed_q[w] ? r_pushed_entry_q : newest_read[w];
    assign r_lists[w]  = r_row.way[w].list[ListBits-1:Common] == r_list_q[ListBits-1:Common];

    flk_entry_near #(
      .MaskBits  (MaskBits),
      .RecordBits(RecordBits),
      .KeyBits   (KeyBits),
      .RecordKept(RecordKept),
      .KeyKept   (KeyKept)
    ) i_near (
      .older_i(r_newest[w]),
      .newer_i(r_entry_q),
      .near_o (r_near[w])
    );

    always_ff @(posedge clk_i) begin
      if (advance && r_valid_q) begin
        if (c_same && !b_flush_q && c_one[w]) begin
          b_newest_q[w] <= b_entry_q;
          b_lists_q[w]  <= r_list_same;
          b_near_q[w]   <= r_near_same;
        end else begin
          b_newest_q[w] <= r_newest[w];
          b_lists_q[w]  <= r_lists[w];
          b_near_q[w]   <= r_near[w];
        end
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (advance && r_valid_q) begin
      b_flush_q <= r_flush_q;
      b_way_q   <= r_way_q;
      b_set_q   <= r_set_q;
      b_list_q  <= r_list_q;
      b_entry_q <= r_entry_q;
      b_row_q   <= c_same ? row_d : r_row;
    end
  end

  // ---- C: the way -----------------------------------------------------------------------------------

  // What becomes of each way is known before which one is meant: the row is a loop of one cycle.
  // A line goes for another list (evict), because the entry is not near (part), or with it (full).
  logic [Ways-1:0]      c_hits, c_frees, c_parts, c_fulls;
  logic [WayBits-1:0]   c_way;
  logic                 c_hit, c_evict, c_part, c_full, c_event;
  logic [CountBits-1:0] c_count;   // of the way
  entry_t               c_newest;  // the way's

  assign row = b_row_q;

  for (genvar w = 0; w < Ways; w++) begin : gen_meant
    localparam logic [Ways-1:0] LOWER = Ways'((1 << w) - 1);
    logic close;
    assign close      = row.way[w].tight && b_near_q[w];
    assign c_hits[w]  = row.way[w].count != '0 && b_lists_q[w];
    assign c_frees[w] = row.way[w].count == '0;
    assign c_parts[w] = c_hits[w] && row.way[w].count >= CountBits'(LineEntries) && !close;
    assign c_fulls[w] = c_hits[w] &&
                        (close ? row.way[w].count == CountBits'(ShortEntries - 1)
                               : row.way[w].count == CountBits'(LineEntries - 1));
    assign c_one[w]   = b_flush_q ? b_way_q == WayBits'(w)
                      : c_hits[w] || (!c_hit && (c_frees == '0 ? row.turn == WayBits'(w)
                                                 : c_frees[w] && (c_frees & LOWER) == '0));
  end

  always_comb begin
    c_way    = '0;
    c_count  = '0;
    c_newest = '0;
    for (int unsigned w = 0; w < Ways; w++) begin
      c_way    |= c_one[w] ? WayBits'(w) : '0;
      c_count  |= c_one[w] ? row.way[w].count : '0;
      c_newest |= c_one[w] ? b_newest_q[w] : '0;
    end
  end

  assign c_hit     = c_hits != '0;
  assign c_evict   = !b_flush_q && !c_hit && c_frees == '0;
  assign c_part    = !b_flush_q && c_parts != '0;
  assign c_full    = !b_flush_q && c_fulls != '0;
  assign c_event   = c_evict || c_part || c_full || (b_flush_q && c_count != '0);
  assign row_write = advance && b_valid_q;

  always_comb begin
    row_d = row;
    for (int unsigned w = 0; w < Ways; w++) begin
      if (c_one[w]) begin
        row_d.way[w] = '{tight: 1'b1, count: CountBits'(1), list: b_list_q};
        if (b_flush_q || c_fulls[w]) begin
          row_d.way[w].count = '0;
        end else if (c_hits[w] && !c_parts[w]) begin
          row_d.way[w].count = row.way[w].count + 1'b1;
          row_d.way[w].tight = row.way[w].tight && b_near_q[w];
        end
      end
    end
    if (b_flush_q) begin
      row_d.turn = '0;
    end else if (c_evict || (c_parts & (Ways'(1) << row.turn)) != '0) begin
      row_d.turn = row.turn + 1'b1;
    end
  end

  // ---- D: pointer; the line is read -----------------------------------------------------------------

  typedef struct packed {
    logic [UsedBits-1:0]  used;  // 0: the list is empty
    logic [ChunkBits-1:0] chunk;
  } pointer_t;

  // d_push_q: the line's newest entry goes to column d_column_q. A line that goes ends with d_word_q
  // if it is full, else with d_newest_q.
  logic                 d_push_q, d_event_q, d_full_q;
  logic [PlaceBits-1:0] d_place_q;
  logic [CountBits-1:0] d_column_q, d_count_q;  // d_count_q: entries of the line that goes
  logic [ListBits-1:0]  c_list, d_list_q;       // its list
  entry_t               d_word_q, d_newest_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      d_push_q  <= 1'b0;
      d_event_q <= 1'b0;
    end else if (advance) begin
      d_push_q  <= b_valid_q && !b_flush_q && c_hit && !c_part;
      d_event_q <= b_valid_q && c_event;
    end
  end

  always_ff @(posedge clk_i) begin
    if (advance && b_valid_q) begin
      d_full_q   <= c_full;
      d_place_q  <= PlaceBits'({b_set_q, c_way});
      d_column_q <= c_count - 1'b1;
      d_count_q  <= c_count + CountBits'(c_full);
      d_list_q   <= c_list;
      d_word_q   <= b_entry_q;
      d_newest_q <= c_newest;
    end
  end

  // Pointers are read for every entry, by the list of the line that may have to go, and in turn at the end, when each is
  // cleared behind its reading.
  pointer_t            pointer, pointer_d;
  logic                walk_q, walk_last_q, walk_blank_q, walk_clear;
  logic [ListBits-1:0] walk_list_q;
  logic                pointer_write, begins, enough, sends;
  logic [ChunkBits:0]  taken, taken_d, taken_more;  // of the bank in stage D
  logic                failed_d;
  logic [Banks-1:0]    failed_q;
  logic [Banks-1:0][ChunkBits:0] taken_q;
  logic [Banks-1:0]    spent_q;  // no chunk is left: taken_q is chunks_q

  logic [BankBits-1:0] d_bank, walk_bank;
  logic [1:0]          d_writer;  // the bank's number among all

  if (Banks == 1) begin : gen_bank_of_event
    assign d_bank    = '0;
    assign walk_bank = '0;
    assign d_writer  = writer_q;
  end else begin : gen_banks_of_event
    assign d_bank    = d_list_q[PerLineBits+:BankBits];
    assign walk_bank = walk_list_q[PerLineBits+:BankBits];
    assign d_writer  = writer_q | (2'(d_bank) << (2 - BankShift));
  end

  // The way that may have to go is known before it is known whether it goes.
  assign c_list = b_flush_q || c_evict ? row.way[b_flush_q ? b_way_q : row.turn].list : b_list_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      walk_q      <= 1'b0;
      walk_last_q <= 1'b0;
    end else if (advance) begin
      walk_q      <= walking;
      walk_last_q <= walking && (&step_q[PerLineBits-1:0]);
    end
  end

  always_ff @(posedge clk_i) begin
    if (advance && walking) begin
      walk_list_q  <= ListBits'(step_q);
      walk_blank_q <= blank_q;
    end
  end

  // ---- D: the place of the pointer's line -----------------------------------------------------------

  typedef struct packed {
    logic [Sharing-1:0] stored;  // lines that are or were in the table
    logic               held;
    logic [TagBits-1:0] tag;     // which one is held
  } place_t;

  place_t                place_read, place_d;
  logic [ListBits-1:0]   look_list;
  logic [TagBits-1:0]    look_tag;
  logic [PlacesBits-1:0] look_place;
  logic [HeldBits-1:0]   moved_at;
  logic                  here, placing;

  assign look_list  = hold_q ? d_list_q : ListBits'(step_q);
  assign look_tag   = TagBits'(look_list >> $clog2(Held));
  assign look_place = AllPlaces > 1 ? PlacesBits'(look_list >> PerLineBits) : '0;
  assign here       = place_read.held && place_read.tag == look_tag;
  assign placing    = hold_q && look_q == COMPARE && !here && !failed_q[d_bank];
  assign skip       = state_q == POINTERS && look_q == COMPARE && !here &&
                      place_read.stored[look_tag];

  always_comb begin
    place_d = '{stored: place_read.stored, held: 1'b1, tag: look_tag};
    if (place_read.held) begin
      place_d.stored[place_read.tag] = 1'b1;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      hold_q  <= 1'b0;
      look_q  <= LOOK;
      blank_q <= 1'b0;
    end else if (hold_q) begin
      unique case (look_q)
        LOOK: look_q <= COMPARE;
        COMPARE: begin
          if (placing && (place_read.held || place_read.stored[look_tag])) begin
            look_q <= ASK;
          end else begin
            look_q <= LOOK;
            hold_q <= 1'b0;
          end
        end
        ASK: begin
          if (move_ready_i) begin
            look_q <= MOVE;
          end
        end
        MOVE: begin
          if (move_done_i) begin
            look_q <= AGAIN;
          end
        end
        default: begin  // AGAIN
          look_q <= LOOK;
          hold_q <= 1'b0;
        end
      endcase
    end else if (state_q == POINTERS && large_q) begin
      unique case (look_q)
        LOOK: look_q <= COMPARE;
        COMPARE: begin
          look_q  <= skip ? LOOK : WALK;
          blank_q <= !here;
        end
        default: begin  // WALK
          if (advance && (&step_q[PerLineBits-1:0])) begin
            look_q <= LOOK;
          end
        end
      endcase
    end else begin
      hold_q  <= advance && b_valid_q && c_event && large_q;
      look_q  <= LOOK;
      blank_q <= 1'b0;
    end
  end

  logic place_read_en, place_write;

  assign place_read_en = look_q == LOOK && (hold_q || (state_q == POINTERS && large_q));
  assign place_write   = (state_q == CLEAR && step_q < StepBits'(AllPlaces)) || placing;

  flk_sram_single #(
    .Width($bits(place_t)),
    .Depth(AllPlaces)
  ) i_places (
    .clk_i,
    .en_i     (place_read_en || place_write),
    .write_i  (place_write),
    .addr_i   (state_q == CLEAR ? PlacesBits'(step_q) : look_place),
    .wr_data_i(state_q == CLEAR ? '0 : place_d),
    .rd_data_o(place_read)
  );

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) !(place_read_en && place_write))
  else $error("flk_list_writer: a place is read and written at once");
`endif

  // The place as it was stays at the memory's output until the line has moved.
  function automatic logic [NumberBits-1:0] line_of(input logic [TagBits-1:0] tag);
    return (NumberBits'(tag) << $clog2(AllPlaces)) | NumberBits'(look_place);
  endfunction

  assign move_valid_o    = hold_q && look_q == ASK;
  assign move_put_o      = place_read.held;
  assign move_put_line_o = line_of(place_read.tag);
  assign move_get_o      = place_read.stored[look_tag];
  assign move_get_line_o = line_of(look_tag);
  assign move_pointer_o  = pointer;
  assign moved_at        = HeldBits'({look_place, move_index_i});

  // ---- D: pointers ----------------------------------------------------------------------------------

  logic [HeldBits-1:0] read_at;  // of all reads but those by c_list

  assign read_at = hold_q ? (look_q == AGAIN ? HeldBits'(d_list_q) : moved_at) : HeldBits'(step_q);

  flk_sram #(
    .Width($bits(pointer_t)),
    .Depth(Held)
  ) i_pointers (
    .clk_i,
    .wr_en_i  ((state_q == CLEAR && step_q < StepBits'(Held)) || pointer_write || walk_clear ||
               move_write_i),
    .wr_addr_i(state_q == CLEAR ? HeldBits'(step_q) : move_write_i ? moved_at :
               walk_clear ? HeldBits'(walk_list_q) : HeldBits'(d_list_q)),
    .wr_data_i(move_write_i ? pointer_t'(move_pointer_i) :
               state_q == CLEAR || walk_clear ? '0 : pointer_d),
    .rd_en_i  (hold_q ? move_read_i || look_q == AGAIN : advance && (b_valid_q || walking)),
    .rd_addr_i(hold_q || state_q == POINTERS ? read_at : HeldBits'(c_list)),
    .rd_data_o(pointer)
  );

  // After a large frame all is cleared.
  assign walk_clear    = advance && walk_q && !large_q;
  assign begins        = pointer.used == '0 || pointer.used == UsedBits'(ChunkLines);
  assign taken         = taken_q[d_bank];
  assign enough        = !begins || !spent_q[d_bank];
  assign sends         = d_event_q && enough && !failed_q[d_bank];
  assign pointer_write = advance && sends;
  assign failed_d      = failed_q[d_bank] || (d_event_q && !enough);
  assign taken_more    = taken + 1'b1;
  assign taken_d       = sends && begins ? taken_more : taken;

  always_comb begin
    pointer_d.chunk = begins ? ChunkBits'(taken) : pointer.chunk;
    pointer_d.used  = begins ? UsedBits'(1) : pointer.used + 1'b1;
  end

  // ---- E: line, and where it goes -------------------------------------------------------------------

  logic                 e_push_q, e_event_q, e_sends_q, e_full_q;
  logic [PlaceBits-1:0] e_place_q;
  logic [CountBits-1:0] e_column_q, e_count_q;
  entry_t               e_word_q, e_newest_q;
  // What stage E wrote when D read.
  logic                 was_push_q;
  logic [CountBits-1:0] was_column_q;
  entry_t               was_newest_q;
  // The pointer as it was, and whether the line begins a chunk.
  pointer_t                              e_pointer_q;
  logic                                  e_begins_q;
  logic                                  e_walk_q, e_walk_last_q;
  logic [AddressBits-1:0]                e_at_d, e_at_q;  // from the first line of its kind

  assign e_at_d = walk_q ? (AddressBits'(walk_list_q >> PerLineBits) << (2 - BankShift)) |
                           AddressBits'(writer_q)
                : AddressBits'({pointer_d.chunk, d_writer,
                                $clog2(ChunkLines)'(begins ? '0 : pointer.used)});

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      e_push_q      <= 1'b0;
      e_event_q     <= 1'b0;
      e_sends_q     <= 1'b0;
      e_walk_q      <= 1'b0;
      e_walk_last_q <= 1'b0;
    end else if (advance) begin
      e_push_q      <= d_push_q;
      e_event_q     <= d_event_q;
      e_sends_q     <= sends;
      e_walk_q      <= walk_q;
      e_walk_last_q <= walk_last_q && !failed_q[walk_bank];
    end
  end

  always_ff @(posedge clk_i) begin
    if (advance) begin
      e_full_q     <= d_full_q;
      e_place_q    <= d_place_q;
      e_column_q   <= d_column_q;
      e_count_q    <= d_count_q;
      e_word_q     <= d_word_q;
      e_newest_q   <= d_newest_q;
      was_push_q   <= e_push_q && e_place_q == d_place_q;
      was_column_q <= e_column_q;
      was_newest_q <= e_newest_q;
    end
    if (advance && (d_event_q || walk_q)) begin
      e_pointer_q <= walk_q && walk_blank_q ? '0 : pointer;
      e_begins_q  <= begins;
      e_at_q      <= e_at_d;
    end
  end

  // A word by what is kept in a short line, and its gap.
  typedef struct packed {
    logic [GapBits-1:0]  gap;   // upper bits of key and record
    logic [KeptBits-1:0] kept;  // lower bits of both, mask
  } parts_t;

  function automatic parts_t parted(input entry_t entry);
    parts_t parts;
    parts.kept = {entry[MaskBits+RecordBits+:KeyKept], entry[0+:MaskBits+RecordKept]};
    parts.gap  = GapBits'({entry[EntryBits-1:MaskBits+RecordBits] >> KeyKept,
                           (RecordBits - RecordKept)'(entry[MaskBits+:RecordBits] >> RecordKept)});
    return parts;
  endfunction

  // Columns 0 to Columns - 1 take words, later ones what is kept of a word: low bits in the gap of column Over less, the
  // rest in the gaps from Over on, and in the tail. Memories are pieces that are written together.
  localparam int unsigned RestArea = (Columns - Over) * GapBits;

  parts_t                                e_parts, was_parts;
  logic   [ShortEntries-2:0]             e_to, was_to;  // the column that is written, that was
  logic   [ShortEntries-2:0]             e_has;         // columns of the line that goes
  logic                                  e_short;       // it is a short one
  logic   [Columns-1:0][KeptBits-1:0]    kept_read, kept;
  logic   [Columns*GapBits+TailBits-1:0] gaps, used;

  // Where a gap's bit lies in a word.
  function automatic int unsigned gap_place(input int unsigned b);
    return b < RecordBits - RecordKept ? MaskBits + RecordKept + b
                                       : MaskBits + RecordBits + KeyKept + b
                                         - (RecordBits - RecordKept);
  endfunction

  assign e_short   = e_count_q > CountBits'(LineEntries);
  assign e_parts   = parted(e_newest_q);
  assign was_parts = parted(was_newest_q);

  for (genvar i = 0; i < ShortEntries - 1; i++) begin : gen_to
    assign e_to[i]   = e_push_q && e_column_q == CountBits'(i);
    assign was_to[i] = was_push_q && was_column_q == CountBits'(i);
    assign e_has[i]  = e_count_q > CountBits'(i + 1);
  end

  for (genvar i = 0; i < Columns; i++) begin : gen_columns
    flk_sram #(
      .Width(KeptBits),
      .Depth(Sets * Ways)
    ) i_kept (
      .clk_i,
      .wr_en_i  (advance && e_to[i]),
      .wr_addr_i(e_place_q),
      .wr_data_i(e_parts.kept),
      .rd_en_i  (advance && d_event_q),
      .rd_addr_i(d_place_q),
      .rd_data_o(kept_read[i])
    );

    // The entry that was pushed last is not in the memory yet: the line is full with it.
    assign kept[i] = e_to[i] ? e_parts.kept : was_to[i] ? was_parts.kept : kept_read[i];
  end

  // Whole gaps, and each later column's rest, which the end of a gap cuts at most once.
  for (genvar k = 0; k < Over; k++) begin : gen_over
    logic [GapBits-1:0] data, was;

    assign data = e_to[k] ? e_parts.gap : e_parts.kept[GapBits-1:0];
    assign was  = was_to[k] ? was_parts.gap : was_parts.kept[GapBits-1:0];

    logic [GapBits-1:0] gap_read;

    flk_sram #(
      .Width(GapBits),
      .Depth(Sets * Ways)
    ) i_gap (
      .clk_i,
      .wr_en_i  (advance && (e_to[k] || e_to[Columns+k])),
      .wr_addr_i(e_place_q),
      .wr_data_i(data),
      .rd_en_i  (advance && d_event_q),
      .rd_addr_i(d_place_q),
      .rd_data_o(gap_read)
    );

    assign gaps[k*GapBits+:GapBits] = e_to[k] || e_to[Columns+k] ? data
                                    : was_to[k] || was_to[Columns+k] ? was : gap_read;
    assign used[k*GapBits+:GapBits] = {GapBits{e_short ? e_has[Columns+k] : e_has[k]}};

    for (genvar h = 0; h < 2; h++) begin : gen_rest
      localparam int unsigned Begin = k * RestBits;
      localparam int unsigned End   = Begin + RestBits;
      localparam int unsigned Next  = (Begin / GapBits + 1) * GapBits;
      localparam int unsigned Cut   = Begin < RestArea && Next < End ? Next : End;
      localparam int unsigned Low   = h == 0 ? Begin : Cut;
      localparam int unsigned Bits  = (h == 0 ? Cut : End) - Low;
      localparam int unsigned At    = Over * GapBits + Low;

      if (Bits > 0) begin : gen_piece
        logic [Bits-1:0] rest, was_rest, piece_read;
        logic            to, was_there;

        if (Low < RestArea) begin : gen_word
          localparam int unsigned Word = Over + Low / GapBits;
          assign to        = e_to[Word] || e_to[Columns+k];
          assign was_there = was_to[Word] || was_to[Columns+k];
          assign rest      = e_to[Word] ? e_parts.gap[Low%GapBits+:Bits]
                                        : e_parts.kept[GapBits+Low-Begin+:Bits];
          assign was_rest  = was_to[Word] ? was_parts.gap[Low%GapBits+:Bits]
                                          : was_parts.kept[GapBits+Low-Begin+:Bits];
          assign used[At+:Bits] = {Bits{e_short ? e_has[Columns+k] : e_has[Word]}};
        end else begin : gen_tail
          assign to        = e_to[Columns+k];
          assign was_there = was_to[Columns+k];
          assign rest      = e_parts.kept[GapBits+Low-Begin+:Bits];
          assign was_rest  = was_parts.kept[GapBits+Low-Begin+:Bits];
          assign used[At+:Bits] = {Bits{e_short && e_has[Columns+k]}};
        end

        flk_sram #(
          .Width(Bits),
          .Depth(Sets * Ways)
        ) i_rest (
          .clk_i,
          .wr_en_i  (advance && to),
          .wr_addr_i(e_place_q),
          .wr_data_i(rest),
          .rd_en_i  (advance && d_event_q),
          .rd_addr_i(d_place_q),
          .rd_data_o(piece_read)
        );

        assign gaps[At+:Bits] = to ? rest : was_there ? was_rest : piece_read;
      end
    end
  end

  logic [LineBits-1:0] line;

  always_comb begin
    line                = '0;
    line[0+:EntryBits]  = e_full_q ? e_word_q : e_newest_q;
    for (int unsigned i = 0; i < Columns; i++) begin
      if (e_has[i]) begin
        line[(i+1)*EntryBits+:MaskBits+RecordKept]       = kept[i][0+:MaskBits+RecordKept];
        line[(i+1)*EntryBits+MaskBits+RecordBits+:KeyKept] = kept[i][MaskBits+RecordKept+:KeyKept];
      end
      for (int unsigned b = 0; b < GapBits; b++) begin
        line[(i+1)*EntryBits+gap_place(b)] = gaps[i*GapBits+b] && used[i*GapBits+b];
      end
    end
    line[LineEntries*EntryBits+:TailBits] = gaps[Columns*GapBits+:TailBits] &
                                            used[Columns*GapBits+:TailBits];
    line[HeaderAt+:HeaderCount] = HeaderCount'(e_count_q);
    if (e_begins_q && e_pointer_q.used != '0) begin
      line[HeaderAt+HeaderCount+:ChunkBits+1] = {1'b1, e_pointer_q.chunk};
    end
  end

  // ---- F: output register ---------------------------------------------------------------------------

  logic                   out_valid_q;
  logic [AddressBits-1:0] address_q;
  logic [LineBits-1:0]    data_q;

  // base_q + e_at_q in three parts, each with and without a carry.
  localparam int unsigned PartBits = (AddressBits + 2) / 3;
  logic [2:0][PartBits-1:0] base, at, sum;
  logic [PartBits:0]        plain, more;
  logic                     carry;

  assign base = (3 * PartBits)'(base_q);
  assign at   = (3 * PartBits)'(e_at_q);

  always_comb begin
    carry = 1'b0;
    plain = '0;
    more  = '0;
    for (int unsigned k = 0; k < 3; k++) begin
      plain  = {1'b0, base[k]} + {1'b0, at[k]};
      more   = (PartBits + 1)'(({1'b0, base[k], 1'b1} + {1'b0, at[k], 1'b1}) >> 1);
      sum[k] = carry ? more[PartBits-1:0] : plain[PartBits-1:0];
      carry  = carry ? more[PartBits] : plain[PartBits];
    end
  end

  logic unused_sum;
  assign unused_sum = ^(sum >> AddressBits);

  assign advance = (!out_valid_q || out_ready_i) && !hold_q;
  assign busy    = a_valid_q || r_valid_q || b_valid_q || d_push_q || d_event_q || e_push_q ||
                   e_event_q || walk_q || e_walk_q || out_valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      out_valid_q <= 1'b0;
    end else if (advance) begin
      out_valid_q <= e_sends_q || e_walk_last_q;
    end else if (out_ready_i) begin
      out_valid_q <= 1'b0;
    end
  end

  always_ff @(posedge clk_i) begin
    if (advance && (e_event_q || e_walk_q)) begin
      data_q    <= e_walk_q ? {PointerBits'(e_pointer_q), data_q[LineBits-1:PointerBits]} : line;
      address_q <= AddressBits'(sum);
    end
  end

  assign out_valid_o   = out_valid_q;
  assign out_address_o = address_q;
  assign out_data_o    = data_q;

  // ---- counters -------------------------------------------------------------------------------------

  logic done_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      done_q   <= 1'b0;
      failed_q <= '0;
      taken_q  <= '0;
      spent_q  <= '0;
    end else begin
      done_q <= state_q == LAST && !busy;
      if (start) begin
        failed_q <= '0;
        taken_q  <= '0;
        spent_q  <= {Banks{chunks_i == '0}};
      end else if (advance) begin
        failed_q[d_bank] <= failed_d;
        taken_q[d_bank]  <= taken_d;
        if (sends && begins) begin
          spent_q[d_bank] <= taken_more == chunks_q;
        end
      end
    end
  end

  flk_event_counter i_entries (
    .clk_i,
    .rst_ni,
    .clear_i(start),
    .count_i(take),
    .value_o(entries_o)
  );

  // The last line leaves stage D at least four cycles before done_o.
  flk_event_counter i_lines (
    .clk_i,
    .rst_ni,
    .clear_i(start),
    .count_i(advance && sends),
    .value_o(lines_o)
  );

  flk_event_counter i_evicted (
    .clk_i,
    .rst_ni,
    .clear_i(start),
    .count_i(advance && b_valid_q && c_evict),
    .value_o(evicted_o)
  );

  assign idle_o    = state_q == IDLE;
  assign done_o    = done_q;
  assign failed_o  = failed_q != '0;
  assign taken_o   = taken_q;

`ifndef SYNTHESIS
  for (genvar k = 0; k < Banks; k++) begin : gen_spent
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        state_q != IDLE |-> spent_q[k] == (taken_q[k] == chunks_q))
    else $error("flk_list_writer: chunks that are left");
  end

  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> state_q == IDLE)
  else $error("flk_list_writer: start while a frame is under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      start |-> 32'(pointer_lines_i) <= Lists / PerLine)
  else $error("flk_list_writer: more pointers than Lists");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      take |-> (CoordBits + 1)'(in_u_i) < columns_q)
  else $error("flk_list_writer: column of a tile outside the picture");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      a_valid_q && !a_flush_q |-> 32'(a_list) < 32'(pointer_lines_q) * PerLine)
  else $error("flk_list_writer: row of a tile outside the picture");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i |=>
      out_valid_o && $stable(out_address_o) && $stable(out_data_o))
  else $error("flk_list_writer: output changed before its transfer");

  // A list has one open line, so after a line of it another entry comes before the next line.
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      d_event_q && b_valid_q && c_event |-> c_list != d_list_q)
  else $error("flk_list_writer: two lines of a list in neighbouring stages");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      move_read_i || move_write_i || move_done_i |-> hold_q && look_q == MOVE)
  else $error("flk_list_writer: pointers are moved that it did not ask for");

  assert property (@(posedge clk_i) disable iff (!rst_ni) hold_q |-> d_event_q && large_q)
  else $error("flk_list_writer: the pipeline stands without an event");

  assert property (@(posedge clk_i) disable iff (!rst_ni) e_event_q |-> e_count_q != '0)
  else $error("flk_list_writer: a line without entries");
`endif

endmodule
