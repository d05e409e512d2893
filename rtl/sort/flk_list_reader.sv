// List reader: the lines of tiles' lists from DRAM, list by list in the order of the tiles
// (docs/reference/list_layout.md, docs/reference/list_reader.md).
//
// Tiles come as columns and rows of the picture. Of each the lines of its list are given: the newest
// chunk first, lines of a chunk in ascending order, entries as they lie there; the last line is
// marked. An empty list is one element with count 0.
// Pointers of Ahead tiles are fetched before there is a place for their lists. Contexts lists are
// under way at once; a chunk is asked for when the line with its link has arrived and a slot of the
// line memory is free for it, so that the port never waits. Earlier lists come first, and the last two
// slots are for the list that is being given: it never waits for the others.
// Faults: an error of the memory; a pointer with 0 or more than ChunkLines lines used, or with a chunk
// beyond chunks_i; a line with 0 entries; a plain one (up to LineEntries entries) with bits behind its
// last place; a header with other bits than it may have; a link that does not go to a lower chunk, as
// a writer's always do (so a chain ends). The list then ends with the last line before the fault, as an
// empty one where there is none, and error_o rises and stays until start_i.
// start_i while idle_o. Bases, columns_i and chunks_i stay until idle_o after the last tile; idle_o is
// high whenever nothing is inside. clear_i forgets all lists; what is under way is read and dropped,
// then idle_o rises; tiles are not taken until then.
// Latency, L the memory's: 11 + L cycles from a tile to an empty list, 17 + 2 L to the first line of
// another; 12 + L from a line with a link to the first line of its chunk.
// Throughput: a line a cycle, a tile every second one, a list every third one. Combinational:
// out_ready_i to the line memory's read port, ar_ready_i to the requests, r_valid_i and r_i to its write port.
module flk_list_reader
  import flk_axi_pkg::*;
#(
  parameter  int unsigned Contexts    = 4,   // lists under way
  parameter  int unsigned Slots       = 32,  // chunks in the line memory
  parameter  int unsigned Ahead       = 4,   // pointers beyond those
  parameter  int unsigned CoordBits   = 8,   // of a tile's column and row
  parameter  int unsigned ChunkLines  = 8,
  parameter  int unsigned ChunkBits   = 24,
  parameter  int unsigned EntryBits   = 52,
  parameter  int unsigned LineEntries = 9,   // of a plain line; more: a short one
  parameter  int unsigned TailBits    = 4,   // of a short line, behind what a plain one has
  parameter  int unsigned PointerBits = 32,
  parameter  int unsigned Bursts      = 16,  // under way
  parameter  int unsigned Id          = 0,
  localparam int unsigned AddressBits = AXI_BEAT_BITS,  // of a line
  localparam int unsigned Width       = AXI_DATA_BITS,
  localparam int unsigned Shift       = $clog2(Width / 8),
  localparam int unsigned EntriesBits = LineEntries * EntryBits + TailBits
) (
  input  logic                                  clk_i,
  input  logic                                  rst_ni,
  // Frame
  input  logic                                  start_i,
  input  logic                                  clear_i,
  output logic                                  idle_o,
  output logic                                  error_o,
  input  logic [AddressBits-1:0]                list_base_i,     // in lines
  input  logic [AddressBits-1:0]                pointer_base_i,
  input  logic [CoordBits-1:0]                  columns_i,       // tiles of a writer in a row
  input  logic [ChunkBits:0]                    chunks_i,        // of a writer
  // Tiles
  input  logic                                  tile_valid_i,
  output logic                                  tile_ready_o,
  input  logic [CoordBits-1:0]                  tile_x_i,
  input  logic [CoordBits-1:0]                  tile_y_i,
  // Lines
  output logic                                  out_valid_o,
  input  logic                                  out_ready_i,
  output logic [EntriesBits-1:0]                out_entries_o,
  output logic [3:0]                            out_count_o,
  output logic                                  out_last_o,
  // AXI4
  output logic                                  ar_valid_o,
  input  logic                                  ar_ready_i,
  output axi_ax_t                               ar_o,
  input  logic                                  r_valid_i,
  output logic                                  r_ready_o,
  input  axi_r_t                                r_i
);

  localparam int unsigned CtxBits = $clog2(Contexts);
  localparam int unsigned SlotBits = $clog2(Slots);
  localparam int unsigned HeldBits = $clog2(Slots + 1);
  localparam int unsigned AtBits = $clog2(ChunkLines);
  localparam int unsigned CountBits = $clog2(Slots * ChunkLines + 1);
  localparam int unsigned PendingBits = $clog2(2 * ChunkLines + 1);
  localparam int unsigned LinesBits = $clog2(ChunkLines + 1);   // 0 to ChunkLines
  localparam int unsigned AheadBits = $clog2(Ahead + 1);
  localparam int unsigned PerLine = Width / PointerBits;
  localparam int unsigned WordBits = $clog2(PerLine);
  localparam int unsigned ListBits = 2 * (CoordBits - 1);
  localparam int unsigned OffsetBits = ChunkBits + 2 + $clog2(ChunkLines);
  localparam int unsigned LowBits = OffsetBits / 2 + 4;  // of an address, less than an offset's
  localparam int unsigned HighBits = AddressBits - LowBits;
  localparam int unsigned HeaderCount = 4;
  localparam int unsigned RestBits = Width - EntriesBits - HeaderCount - ChunkBits - 1;
  localparam int unsigned ChunkTag = SlotBits + CtxBits;
  localparam int unsigned WhichBits = WordBits + 2 > ChunkTag ? WordBits + 2 : ChunkTag;

  if (Contexts < 2 || Contexts != 1 << CtxBits) begin : gen_check_contexts
    $error("flk_list_reader: Contexts must be a power of two, at least 2");
  end
  if (Slots < 4) begin : gen_check_slots
    $error("flk_list_reader: Slots must be at least 4");
  end
  if (ChunkLines < 2 || ChunkLines != 1 << $clog2(ChunkLines)) begin : gen_check_chunk
    $error("flk_list_reader: ChunkLines must be a power of two, at least 2");
  end
  if (LineEntries > 14 || TailBits < 1 || EntriesBits + HeaderCount + ChunkBits + 1 >= Width ||
      PerLine != 1 << WordBits || ChunkBits + LinesBits >= PointerBits) begin : gen_check_line
    $error("flk_list_reader: entries, count and link must fit a line, a chunk's use a pointer");
  end

  typedef struct packed {
    logic                 pointer;
    logic [WhichBits-1:0] which;    // writer and word of the line, or slot and context
  } tag_t;

  // ---- clear ----------------------------------------------------------------------------------------

  logic drain_q, read_idle, stop;

  assign stop = clear_i || drain_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      drain_q <= 1'b0;
    end else begin
      drain_q <= clear_i || (drain_q && !read_idle);
    end
  end

  // ---- tiles: where their pointers lie ----------------------------------------------------------------

  logic                 s_valid_q, t_valid_q, t_move, t_asked;
  logic [CoordBits-1:0] s_x_q, s_y_q;
  logic [ListBits-1:0]  t_list_q;
  logic [1:0]           t_writer_q;

  assign tile_ready_o = !s_valid_q && !drain_q;
  assign t_move       = s_valid_q && !t_valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      s_valid_q <= 1'b0;
      t_valid_q <= 1'b0;
    end else if (stop) begin
      s_valid_q <= 1'b0;
      t_valid_q <= 1'b0;
    end else begin
      s_valid_q <= s_valid_q ? !t_move : tile_valid_i;
      t_valid_q <= t_valid_q ? !t_asked : s_valid_q;
    end
  end

  always_ff @(posedge clk_i) begin
    if (tile_valid_i && tile_ready_o) begin
      s_x_q <= tile_x_i;
      s_y_q <= tile_y_i;
    end
    if (t_move) begin
      t_list_q   <= ListBits'(s_y_q[CoordBits-1:1]) * ListBits'(columns_i)
                    + ListBits'(s_x_q[CoordBits-1:1]);
      t_writer_q <= {s_y_q[0], s_x_q[0]};
    end
  end

  // ---- lists under way --------------------------------------------------------------------------------

  // Of each: its pointer, the chunk asked for last or to be asked for, how many of its lines are on their way, how many
  // are in the memory and free of faults, and whether more of these will come; its slots, as a chain.
  logic [Contexts-1:0]                valid_q, want_q, ended_q;
  logic [Contexts-1:0][1:0]           writer_q;
  logic [Contexts-1:0][ChunkBits-1:0] chunk_q;
  logic [Contexts-1:0][LinesBits-1:0] used_q, lines_q;
  logic [Contexts-1:0][PendingBits-1:0] pending_q;
  logic [Contexts-1:0][CountBits-1:0] good_q;
  logic [Contexts-1:0]                begun_q;            // a chunk has been asked for
  logic [Contexts-1:0][SlotBits-1:0]  first_slot_q, last_slot_q;
  logic [Contexts-1:0][HeldBits-1:0]  held_q;             // slots
  logic [CtxBits-1:0]                 head_q, free_q;  // whose lines are given; the next to be used

  // ---- slots ------------------------------------------------------------------------------------------

  logic [Slots-1:0]               busy_q;
  logic [Slots-1:0][CtxBits-1:0]  owner_q;
  logic [Slots-1:0][SlotBits-1:0] following_q;  // the list's slot after this one
  logic [SlotBits-1:0]            spare;        // a free one
  logic [HeldBits-1:0]            free_slots_q;
  logic                           take_slot, leave_slot;
  logic [SlotBits-1:0]            read_slot;

  always_comb begin
    spare = '0;
    for (int unsigned s = Slots; s > 0; s--) begin
      if (!busy_q[s-1]) begin
        spare = SlotBits'(s - 1);
      end
    end
  end

  // ---- requests ---------------------------------------------------------------------------------------

  logic [Contexts-1:0]    asks, asked;
  logic [CtxBits-1:0]     pick;
  logic                   pick_pointer, choose, load;
  logic [AheadBits-1:0]   ahead_q;  // pointers asked for and not in a context
  logic                   c_valid_q, c_move, d_valid_q, read_ready;
  tag_t                   c_tag_q, d_tag_q;
  logic [AddressBits-1:0] c_base_q;
  logic [LowBits:0]       d_low_q;   // of the address, with what it carries
  logic [HighBits-1:0]    d_high_q;  // without that
  logic [OffsetBits-1:0]  c_offset_q;
  logic [LinesBits-1:0]   c_lines_q, d_lines_q;

  for (genvar k = 0; k < Contexts; k++) begin : gen_asks
    assign asks[k] = valid_q[k] && want_q[k] &&
                     free_slots_q > (head_q == CtxBits'(k) ? HeldBits'(0) : HeldBits'(2));
  end

  // A pointer, else the list that comes first.
  assign pick_pointer = t_valid_q && ahead_q != AheadBits'(Ahead);

  always_comb begin
    pick = head_q;
    for (int unsigned i = Contexts; i > 0; i--) begin
      if (asks[head_q + CtxBits'(i - 1)]) begin
        pick = head_q + CtxBits'(i - 1);
      end
    end
  end

  assign choose  = !c_valid_q && !stop && (pick_pointer || asks != '0);
  assign t_asked = choose && pick_pointer;
  assign c_move  = c_valid_q && !d_valid_q;
  assign take_slot = choose && !pick_pointer;

  for (genvar k = 0; k < Contexts; k++) begin : gen_asked
    assign asked[k] = take_slot && pick == CtxBits'(k);
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      c_valid_q <= 1'b0;
      d_valid_q <= 1'b0;
      ahead_q   <= '0;
    end else if (stop) begin
      c_valid_q <= 1'b0;
      d_valid_q <= 1'b0;
      ahead_q   <= '0;
    end else begin
      c_valid_q <= c_valid_q ? !c_move : choose;
      d_valid_q <= d_valid_q ? !read_ready : c_valid_q;
      if (t_asked && !load) begin
        ahead_q <= ahead_q + 1'b1;
      end else if (load && !t_asked) begin
        ahead_q <= ahead_q - 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (choose) begin
      c_tag_q.pointer <= pick_pointer;
      c_tag_q.which   <= pick_pointer ? WhichBits'({t_writer_q, t_list_q[WordBits-1:0]})
                         : WhichBits'({spare, pick});
      c_base_q        <= pick_pointer ? pointer_base_i : list_base_i;
      c_offset_q      <= pick_pointer ? OffsetBits'({t_list_q >> WordBits, t_writer_q})
                         : {chunk_q[pick], writer_q[pick], $clog2(ChunkLines)'(0)};
      c_lines_q       <= pick_pointer ? LinesBits'(1) : lines_q[pick];
    end
    if (c_move) begin
      d_tag_q   <= c_tag_q;
      d_low_q   <= {1'b0, c_base_q[LowBits-1:0]} + (LowBits + 1)'(c_offset_q[LowBits-1:0]);
      d_high_q  <= c_base_q[AddressBits-1:LowBits] + HighBits'(c_offset_q[OffsetBits-1:LowBits]);
      d_lines_q <= c_lines_q;
    end
  end

  logic                     beat_valid, beat_last, beat_error, write;
  logic [Width-1:0]         beat_data;
  tag_t                     beat_tag, ask_tag;
  logic [AXI_ADDR_BITS-1:0] ask_addr;
  logic [2:0]               ask_size;
  logic                     unused_addr;

  // Of a pointer's line only the half that has it.
  assign ar_o.addr = {ask_addr[AXI_ADDR_BITS-1:Shift],
                      ask_tag.pointer && ask_tag.which[WordBits-1], (Shift-1)'(0)};
  assign ar_o.size = ask_size - 3'(ask_tag.pointer);
  assign unused_addr = ^ask_addr[Shift-1:0];

  flk_axi_read #(
    .AddrBits(AXI_ADDR_BITS),
    .BeatBits(LinesBits),
    .TagBits ($bits(tag_t)),
    .Width   (Width),
    .MaxBeats(ChunkLines),
    .Bursts  (Bursts),
    .IdBits  (AXI_ID_BITS),
    .Id      (Id)
  ) i_read (
    .clk_i,
    .rst_ni,
    .idle_o     (read_idle),
    .in_valid_i (d_valid_q),
    .in_ready_o (read_ready),
    .in_addr_i  ({d_high_q + HighBits'(d_low_q[LowBits]), d_low_q[LowBits-1:0], Shift'(0)}),
    .in_beats_i (d_lines_q),
    .in_tag_i   (d_tag_q),
    .out_valid_o(beat_valid),
    .out_ready_i(1'b1),
    .out_data_o (beat_data),
    .out_tag_o  (beat_tag),
    .out_last_o (beat_last),
    .out_error_o(beat_error),
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o    (ar_o.id),
    .ar_addr_o  (ask_addr),
    .ar_len_o   (ar_o.len),
    .ar_size_o  (ask_size),
    .ar_burst_o (ar_o.burst),
    .ar_tag_o   (ask_tag),
    .r_valid_i,
    .r_ready_o,
    .r_id_i     (r_i.id),
    .r_data_i   (r_i.data),
    .r_resp_i   (r_i.resp),
    .r_last_i   (r_i.last)
  );

  // ---- what has come: header or pointer -----------------------------------------------------------------

  typedef struct packed {
    logic [RestBits-1:0]    rest;
    logic                   linked;
    logic [ChunkBits-1:0]   link;
    logic [HeaderCount-1:0] count;
    logic [TailBits-1:0]    tail;
  } header_t;

  logic [AtBits-1:0]      at_q;  // of the next beat in its request
  logic                   h_valid_q, h_first_q, h_last_q, h_error_q;
  tag_t                   h_tag_q;
  header_t                h_q;
  logic [PointerBits-1:0] p_q;

  assign write = beat_valid && !beat_tag.pointer;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      at_q      <= '0;
      h_valid_q <= 1'b0;
    end else begin
      if (beat_valid) begin
        at_q <= beat_last ? '0 : at_q + 1'b1;
      end
      h_valid_q <= beat_valid && !stop;
    end
  end

  always_ff @(posedge clk_i) begin
    if (beat_valid) begin
      h_first_q <= at_q == '0;
      h_last_q  <= beat_last;
      h_error_q <= beat_error;
      h_tag_q   <= beat_tag;
      h_q       <= header_t'(beat_data[Width-1:EntriesBits-TailBits]);
      p_q       <= beat_data[32'(beat_tag.which[WordBits-1:0])*PointerBits+:PointerBits];
    end
  end

  // Pointers

  typedef struct packed {
    logic [1:0]           writer;
    logic [ChunkBits-1:0] chunk;
    logic [LinesBits-1:0] used;    // 0: nothing to be read
  } pointer_t;

  logic                           p_push, p_wrong, p_valid, unused_ready, unused_full, p_empty;
  logic [PointerBits-ChunkBits-1:0] p_used;
  pointer_t                       p_in, p_out;
  logic [AheadBits-1:0]           unused_usage;

  assign p_push      = h_valid_q && h_tag_q.pointer;
  assign p_used      = p_q[PointerBits-1:ChunkBits];
  assign p_wrong     = h_error_q || (p_q != '0 && (p_used == '0 || 32'(p_used) > ChunkLines ||
                                                   {1'b0, p_q[ChunkBits-1:0]} >= chunks_i));
  assign p_in.writer = h_tag_q.which[WordBits+:2];
  assign p_in.chunk  = p_q[ChunkBits-1:0];
  assign p_in.used   = p_wrong ? '0 : LinesBits'(p_used);

  flk_fifo #(
    .Width($bits(pointer_t)),
    .Depth(Ahead)
  ) i_pointers (
    .clk_i,
    .rst_ni,
    .clear_i    (stop),
    .in_valid_i (p_push),
    .in_ready_o (unused_ready),  // only what has a place is asked for
    .in_data_i  (p_in),
    .out_valid_o(p_valid),
    .out_ready_i(load),
    .out_data_o (p_out),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (p_empty)
  );

  assign load = p_valid && !valid_q[free_q] && !stop;

  // Lines

  logic               line, dropped, chained_q, h_linked, wrong, good;
  logic [CtxBits-1:0] h_ctx;

  assign line     = h_valid_q && !h_tag_q.pointer;
  assign h_ctx    = h_tag_q.which[CtxBits-1:0];
  assign h_linked = h_first_q ? h_q.linked : chained_q;
  assign dropped  = ended_q[h_ctx];
  assign wrong    = h_error_q || h_q.count == '0
                    || (h_q.count <= HeaderCount'(LineEntries) && h_q.tail != '0)
                    || h_q.rest != '0 || (h_first_q ? h_q.linked && h_q.link >= chunk_q[h_ctx]
                                                    : h_q.linked || h_q.link != '0);
  assign good     = line && !dropped && !wrong;

  always_ff @(posedge clk_i) begin
    if (line) begin
      chained_q <= h_linked;
    end
  end

  // ---- what is given ------------------------------------------------------------------------------------

  // A line is read from the memory when another one follows for certain, or none; so the last one before a fault is marked.
  logic give, give_last, read, move, given_q, over_q, done;
  logic out_valid_q, out_last_q, out_none_q;
  logic [EntriesBits+HeaderCount-1:0] out_line;

  assign move      = !out_valid_q || out_ready_i;
  assign give      = valid_q[head_q] && !given_q &&
                     (ended_q[head_q] || good_q[head_q] > CountBits'(1));
  assign give_last = good_q[head_q] <= CountBits'(1);
  assign read      = give && move && good_q[head_q] != '0;

  // Where the next line lies: of a list that begins, in its first slot.
  // A list begins; in its first chunk; the last line of its chunk.
  logic                read_new_q, read_first_q, read_end;
  logic [SlotBits-1:0] read_slot_q;
  logic [AtBits-1:0]   read_at_q;

  assign read_slot  = read_new_q ? first_slot_q[head_q] : read_slot_q;
  assign read_end   = read_at_q == AtBits'(read_first_q ? used_q[head_q] - 1'b1
                                           : LinesBits'(ChunkLines - 1));
  assign leave_slot = read && read_end;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      read_new_q   <= 1'b1;
      read_first_q <= 1'b1;
      read_at_q    <= '0;
    end else if (stop || done) begin
      read_new_q   <= 1'b1;
      read_first_q <= 1'b1;
      read_at_q    <= '0;
    end else if (read) begin
      read_new_q   <= 1'b0;
      read_first_q <= read_first_q && !read_end;
      read_at_q    <= read_end ? '0 : read_at_q + 1'b1;
    end
  end

  always_ff @(posedge clk_i) begin
    if (read) begin
      read_slot_q <= read_end ? following_q[read_slot] : read_slot;
    end
  end

  // Slots are free when their last line has been read, and all of a list's when it is over.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      busy_q       <= '0;
      free_slots_q <= HeldBits'(Slots);
    end else if (stop) begin
      busy_q       <= '0;
      free_slots_q <= HeldBits'(Slots);
    end else begin
      for (int unsigned s = 0; s < Slots; s++) begin
        if (take_slot && spare == SlotBits'(s)) begin
          busy_q[s] <= 1'b1;
        end else if ((leave_slot && read_slot == SlotBits'(s)) ||
                     (done && owner_q[s] == head_q)) begin
          busy_q[s] <= 1'b0;
        end
      end
      free_slots_q <= free_slots_q + (done ? held_q[head_q] : HeldBits'(leave_slot))
                      - HeldBits'(take_slot);
    end
  end

  always_ff @(posedge clk_i) begin
    if (take_slot) begin
      owner_q[spare] <= pick;
    end
    if (take_slot && begun_q[pick]) begin
      following_q[last_slot_q[pick]] <= spare;
    end
  end

  flk_sram #(
    .Width(EntriesBits + HeaderCount),
    .Depth(Slots * ChunkLines)
  ) i_lines (
    .clk_i,
    .wr_en_i  (write),
    .wr_addr_i({beat_tag.which[CtxBits+:SlotBits], at_q}),
    .wr_data_i({beat_data[EntriesBits+:HeaderCount], beat_data[EntriesBits-1:0]}),
    .rd_en_i  (read),
    .rd_addr_i({read_slot, read_at_q}),
    .rd_data_o(out_line)
  );

  // All that was asked for must have come before a context is used again.
  assign done = over_q && pending_q[head_q] == '0;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      out_valid_q <= 1'b0;
      given_q     <= 1'b0;
      over_q      <= 1'b0;
    end else if (stop) begin
      out_valid_q <= 1'b0;
      given_q     <= 1'b0;
      over_q      <= 1'b0;
    end else begin
      out_valid_q <= give || (out_valid_q && !out_ready_i);
      given_q     <= (given_q && !done) || (give && move && give_last);
      over_q      <= (over_q && !done) || (out_valid_q && out_ready_i && out_last_q);
    end
  end

  always_ff @(posedge clk_i) begin
    if (give && move) begin
      out_last_q <= give_last;
      out_none_q <= !read;
    end
  end

  assign out_valid_o   = out_valid_q;
  assign out_last_o    = out_last_q;
  assign out_entries_o = out_line[EntriesBits-1:0];
  assign out_count_o   = out_none_q ? '0 : out_line[EntriesBits+:HeaderCount];

  // ---- the contexts -------------------------------------------------------------------------------------

  for (genvar k = 0; k < Contexts; k++) begin : gen_context
    logic here, mine, comes, leaves, ends, follows;

    assign here    = load && free_q == CtxBits'(k);                    // a list enters
    assign mine    = head_q == CtxBits'(k);
    assign comes   = line && h_ctx == CtxBits'(k);
    assign leaves  = read && mine;
    assign ends    = comes && !dropped && (wrong || (h_last_q && !h_linked));
    assign follows = comes && good && h_first_q && h_q.linked;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        valid_q[k]    <= 1'b0;
        want_q[k]     <= 1'b0;
        ended_q[k]    <= 1'b0;
        pending_q[k]  <= '0;
        good_q[k]     <= '0;
        held_q[k]     <= '0;
        begun_q[k]    <= 1'b0;
      end else if (stop) begin
        valid_q[k]    <= 1'b0;
        want_q[k]     <= 1'b0;
        ended_q[k]    <= 1'b0;
        pending_q[k]  <= '0;
        good_q[k]     <= '0;
        held_q[k]     <= '0;
        begun_q[k]    <= 1'b0;
      end else begin
        if (here) begin
          valid_q[k] <= 1'b1;
        end else if (done && mine) begin
          valid_q[k] <= 1'b0;
        end
        if (here) begin
          want_q[k]  <= p_out.used != '0;
          ended_q[k] <= p_out.used == '0;
        end else begin
          want_q[k]  <= (want_q[k] && !asked[k] && !ends) || follows;
          ended_q[k] <= ended_q[k] || ends;
        end
        pending_q[k] <= pending_q[k] + (asked[k] ? PendingBits'(lines_q[k]) : '0)
                        - PendingBits'(comes);
        begun_q[k]   <= !here && (begun_q[k] || asked[k]);
        if (done && mine) begin
          held_q[k] <= '0;
        end else begin
          held_q[k] <= held_q[k] + HeldBits'(asked[k]) - HeldBits'(leave_slot && mine);
        end
        if (comes && good && !leaves) begin
          good_q[k] <= good_q[k] + 1'b1;
        end else if (leaves && !(comes && good)) begin
          good_q[k] <= good_q[k] - 1'b1;
        end
      end
    end

    always_ff @(posedge clk_i) begin
      if (here) begin
        writer_q[k] <= p_out.writer;
        used_q[k]   <= p_out.used;
      end
      if (here) begin
        chunk_q[k] <= p_out.chunk;
        lines_q[k] <= p_out.used;
      end else if (follows) begin
        chunk_q[k] <= h_q.link;
        lines_q[k] <= LinesBits'(ChunkLines);
      end
      if (asked[k]) begin
        last_slot_q[k] <= spare;
      end
      if (asked[k] && !begun_q[k]) begin
        first_slot_q[k] <= spare;
      end
    end

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        asked[k] |-> 32'(pending_q[k]) <= ChunkLines && 32'(free_slots_q) != 0)
    else $error("flk_list_reader: a chunk without a slot");

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        comes && !stop |-> valid_q[k] && pending_q[k] != '0)
    else $error("flk_list_reader: a line that nobody asked for");

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        here && !stop |-> pending_q[k] == '0 && good_q[k] == '0)
    else $error("flk_list_reader: a list begins before the last one's lines are through");
`endif
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      head_q <= '0;
      free_q <= '0;
    end else if (stop) begin
      head_q <= '0;
      free_q <= '0;
    end else begin
      head_q <= head_q + CtxBits'(done);
      free_q <= free_q + CtxBits'(load);
    end
  end

  // ---- frame ----------------------------------------------------------------------------------------------

  logic error_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      error_q <= 1'b0;
    end else if (start_i) begin
      error_q <= 1'b0;
    end else if (!stop && ((p_push && p_wrong) || (line && !dropped && wrong))) begin
      error_q <= 1'b1;
    end
  end

  assign error_o = error_q;
  assign idle_o  = !drain_q && !s_valid_q && !t_valid_q && !c_valid_q && !d_valid_q && read_idle &&
                   !h_valid_q && p_empty && valid_q == '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      free_slots_q == HeldBits'($countones(~busy_q)))
  else $error("flk_list_reader: number of free slots");

  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o)
  else $error("flk_list_reader: start while lists are under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni) r_valid_i |-> r_ready_o)
  else $error("flk_list_reader: the port waits");

  assert property (@(posedge clk_i) disable iff (!rst_ni) p_push |-> unused_ready)
  else $error("flk_list_reader: a pointer without a place");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=>
      out_valid_o && $stable({out_entries_o, out_count_o, out_last_o}))
  else $error("flk_list_reader: output changed before its transfer");
`endif

endmodule
