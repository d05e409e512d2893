// Record cache: records from DRAM by their numbers, in order, two a cycle (docs/reference/delivery.md).
//
// Tags are looked up first, data come later: a lookup decides at once whether its line has to be read
// and which line goes; then it waits in a queue, in the order of the lookups, input 0 before input 1, and
// the two oldest leave together if they can. Lines
// come in the order in which they were asked for, and each is written over the line that goes when the
// lookup that asked for it is at the head of the queue. All lookups before it have then been served, so
// a line that is still needed is never lost, and a lookup that finds its tag finds its data.
// Elements with in_skip_i look nothing up and keep their place in the order. What comes out must be
// taken, output 0 before output 1; none comes in the cycle after one with out_ready_i low.
// Memory of Banks x Sets x Ways lines of 32 bytes. A line is wanted until a tile, as its last lookup says (in_until_i, a number modulo
// 64; in_tile_i is that of the present tile, of both lookups): so long it is not replaced while its set has another. The way that is replaced
// is the first one, from the one behind the last one replaced, that is empty or wanted no more; that first one where all are wanted. A line is
// wanted where in_until_i - in_tile_i is 0 to 2.
// start_i (while idle_o) and clear_i (at any time) forget all; idle_o rises when what was asked for has
// come and the tags are cleared (Sets cycles). error_o: the memory answered with an error; until then.
// Throughput: two elements a cycle, one where both are of the same bank (at the data: if both read, or both write, or
// are of one place); a line a cycle from memory. Latency 4 without a miss in the queue. in_ready_o[1] depends on in_*; it is
// never high without in_ready_o[0].
// waits_o, of the head of the queue a cycle ago: bit 0, out_ready_i was low; bit 1, its line had not come.
// Combinational too: ar_ready_i to the requests, r_*_i to the buffer's write port, out_ready_i to the head of the queue.
module flk_record_cache #(
  parameter  int unsigned RecordBits  = 128,
  parameter  int unsigned NumberBits  = 24,
  parameter  int unsigned TagBits     = 5,    // of the user, given back
  parameter  int unsigned Banks       = 4,
  parameter  int unsigned Sets        = 64,   // of a bank
  parameter  int unsigned Ways        = 4,
  parameter  int unsigned Depth       = 512,  // elements that wait
  parameter  int unsigned Places      = 256,  // lines on their way
  parameter  int unsigned AddrBits    = 40,
  parameter  int unsigned IdBits      = 4,
  parameter  int unsigned Id          = 0,
  localparam int unsigned UntilBits   = 6,
  localparam int unsigned Width       = 256,
  localparam int unsigned Shift       = $clog2(Width / 8)
) (
  input  logic                            clk_i,
  input  logic                            rst_ni,
  // Frame
  input  logic                            start_i,
  input  logic                            clear_i,
  output logic                            idle_o,
  output logic                            error_o,
  output logic [31:0]                     lines_o,        // read since start_i
  output logic [1:0]                      waits_o,
  input  logic [AddrBits-Shift-1:0]       record_base_i,  // in lines
  // Lookups
  input  logic [1:0]                      in_valid_i,
  output logic [1:0]                      in_ready_o,
  input  logic [1:0]                      in_skip_i,
  input  logic [1:0][NumberBits-1:0]      in_record_i,
  input  logic [1:0][TagBits-1:0]         in_tag_i,
  input  logic [UntilBits-1:0]            in_tile_i,
  input  logic [1:0][UntilBits-1:0]       in_until_i,
  // Records
  input  logic                            out_ready_i,
  output logic [1:0]                      out_valid_o,
  output logic [1:0][RecordBits-1:0]      out_record_o,
  output logic [1:0][TagBits-1:0]         out_tag_o,
  // AXI4
  output logic                            ar_valid_o,
  input  logic                            ar_ready_i,
  output logic [IdBits-1:0]               ar_id_o,
  output logic [AddrBits-1:0]             ar_addr_o,
  output logic [7:0]                      ar_len_o,
  output logic [2:0]                      ar_size_o,
  output logic [1:0]                      ar_burst_o,
  input  logic                            r_valid_i,
  output logic                            r_ready_o,
  input  logic [IdBits-1:0]               r_id_i,
  input  logic [Width-1:0]                r_data_i,
  input  logic [1:0]                      r_resp_i,
  input  logic                            r_last_i
);

  localparam int unsigned PerLine = Width / RecordBits;
  localparam int unsigned PartBits = $clog2(PerLine);
  localparam int unsigned LineBits = NumberBits - PartBits;
  localparam int unsigned BankBits = $clog2(Banks);
  localparam int unsigned SetBits = $clog2(Sets);
  localparam int unsigned WayBits = $clog2(Ways);
  localparam int unsigned KeyBits = LineBits - BankBits - SetBits;
  localparam int unsigned PlaceBits = SetBits + WayBits;
  localparam int unsigned LowBits = LineBits / 2 + 4;  // of an address, less than a line number's
  localparam int unsigned OwedBits = $clog2(Places + 3);
  localparam int unsigned HighBits = AddrBits - Shift - LowBits;

  if (RecordBits * PerLine != Width || PerLine > 2) begin : gen_check_record
    $error("flk_record_cache: RecordBits must be 128 or 256");
  end
  if (Depth < 4 || Depth % 2 != 0 || Places < 4 || Places % 2 != 0) begin : gen_check_depth
    $error("flk_record_cache: Depth and Places must be even, at least 4");
  end
  if (Banks < 2 || Banks != 1 << BankBits || Sets < 2 || Sets != 1 << SetBits ||
      Ways < 2 || Ways != 1 << WayBits) begin : gen_check_size
    $error("flk_record_cache: Banks, Sets and Ways must be powers of two, at least 2");
  end

  typedef struct packed {
    logic                 valid;
    logic [UntilBits-1:0] keep;  // until which it is wanted
    logic [KeyBits-1:0]   key;
  } way_t;

  typedef struct packed {
    logic [WayBits-1:0] turn;
    way_t [Ways-1:0]    way;
  } row_t;

  typedef struct packed {
    logic                 skip;
    logic                 miss;
    logic                 part;  // of the line
    logic [BankBits-1:0]  bank;
    logic [PlaceBits-1:0] place;
    logic [TagBits-1:0]   tag;
  } element_t;

  typedef struct packed {
    logic                valid;
    logic [LineBits-1:0] line;
  } miss_t;

  // ---- frame ----------------------------------------------------------------------------------------

  typedef enum logic [1:0] {DRAIN, CLEAR, READY} state_e;

  state_e              state_q;
  logic [SetBits-1:0]  step_q;
  logic                stop, fetch_idle, clearing;

  assign stop     = start_i || clear_i || state_q == DRAIN;
  assign clearing = state_q == CLEAR;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= DRAIN;
      step_q  <= '0;
    end else if (start_i || clear_i) begin
      state_q <= DRAIN;
      step_q  <= '0;
    end else begin
      unique case (state_q)
        DRAIN: if (fetch_idle) state_q <= CLEAR;
        CLEAR: begin
          step_q <= step_q + 1'b1;
          if (step_q == SetBits'(Sets - 1)) begin
            state_q <= READY;
          end
        end
        default: state_q <= READY;
      endcase
    end
  end

  // ---- A: two lookups, of different banks -------------------------------------------------------------

  logic                         advance, conflict;
  logic [1:0]                   take;
  logic [1:0][LineBits-1:0]     in_line;
  logic [1:0][BankBits-1:0]     in_bank;
  logic [1:0][SetBits-1:0]      in_set;
  logic [1:0]                   in_part;

  logic [1:0]                   b_valid_q, b_skip_q, b_part_q;
  logic [1:0][LineBits-1:0]     b_line_q;
  logic [1:0][TagBits-1:0]      b_tag_q;
  logic [1:0][UntilBits-1:0]    b_until_q;
  logic [2:0][UntilBits-1:0]    b_tiles_q;  // the present one, the next, the one behind
  logic [1:0][BankBits-1:0]     b_bank;
  logic [1:0][SetBits-1:0]      b_set;

  for (genvar c = 0; c < 2; c++) begin : gen_input
    assign in_line[c] = in_record_i[c][NumberBits-1:PartBits];
    assign in_part[c] = PerLine > 1 && in_record_i[c][0];
    assign in_bank[c] = in_line[c][BankBits-1:0];
    assign in_set[c]  = in_line[c][BankBits+:SetBits];
    assign b_bank[c]  = b_line_q[c][BankBits-1:0];
    assign b_set[c]   = b_line_q[c][BankBits+:SetBits];
    assign in_ready_o[c] = advance && state_q == READY && !(conflict && c == 1);
    assign take[c]    = in_valid_i[c] && in_ready_o[c];
  end

  assign conflict = &in_valid_i && in_skip_i == '0 && in_bank[0] == in_bank[1];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      b_valid_q <= '0;
    end else if (stop) begin
      b_valid_q <= '0;
    end else if (advance) begin
      b_valid_q <= take;
    end
  end

  always_ff @(posedge clk_i) begin
    for (int unsigned c = 0; c < 2; c++) begin
      if (take[c]) begin
        b_skip_q[c] <= in_skip_i[c];
        b_part_q[c] <= in_part[c];
        b_line_q[c] <= in_line[c];
        b_tag_q[c]   <= in_tag_i[c];
        b_until_q[c] <= in_until_i[c];
      end
    end
    if (take != '0) begin
      b_tiles_q <= {in_tile_i + UntilBits'(2), in_tile_i + UntilBits'(1), in_tile_i};
    end
  end

  // ---- B: tags --------------------------------------------------------------------------------------

  row_t [Banks-1:0]         row_read;
  row_t [1:0]               row, row_d, kept_q;
  logic [1:0]               is_kept_q, miss, changed;  // changed: the row
  logic [1:0][Ways-1:0]     hits;
  logic [1:0][WayBits-1:0]  way;
  element_t [1:0]           pushed, head;
  miss_t [1:0]              missed, next;

  // Rows that a lookup has changed are written in the cycle after it.
  logic [1:0]               store_valid_q;
  logic [1:0][BankBits-1:0] store_bank_q;
  logic [1:0][SetBits-1:0]  store_set_q;
  row_t [1:0]               store_row_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      store_valid_q <= '0;
    end else begin
      store_valid_q <= (advance && !stop) ? changed : '0;
    end
  end

  always_ff @(posedge clk_i) begin
    for (int unsigned c = 0; c < 2; c++) begin
      if (advance) begin
        store_bank_q[c] <= b_bank[c];
        store_set_q[c]  <= b_set[c];
        store_row_q[c]  <= row_d[c];
      end
    end
  end

  for (genvar b = 0; b < Banks; b++) begin : gen_bank
    logic [1:0] reads, writes;

    for (genvar c = 0; c < 2; c++) begin : gen_port
      assign reads[c]  = take[c] && !in_skip_i[c] && in_bank[c] == BankBits'(b);
      assign writes[c] = store_valid_q[c] && store_bank_q[c] == BankBits'(b);
    end

    flk_sram #(
      .Width($bits(row_t)),
      .Depth(Sets)
    ) i_rows (
      .clk_i,
      .wr_en_i  (clearing || writes != '0),
      .wr_addr_i(clearing ? step_q : writes[1] ? store_set_q[1] : store_set_q[0]),
      .wr_data_i(clearing ? '0 : writes[1] ? store_row_q[1] : store_row_q[0]),
      .rd_en_i  (reads != '0),
      .rd_addr_i(reads[1] ? in_set[1] : in_set[0]),
      .rd_data_o(row_read[b])
    );
  end

  for (genvar c = 0; c < 2; c++) begin : gen_lookup
    assign row[c] = is_kept_q[c] ? kept_q[c] : row_read[b_bank[c]];

    for (genvar w = 0; w < Ways; w++) begin : gen_way
      assign hits[c][w] = row[c].way[w].valid &&
                          row[c].way[w].key == b_line_q[c][LineBits-1:BankBits+SetBits];
    end

    assign miss[c] = b_valid_q[c] && !b_skip_q[c] && hits[c] == '0;

    // The first way that may go from the one in turn on; else the first of all that may; else the one in turn. One-hot.
    logic [Ways-1:0]    keeps, behind, late, early, turn, victim;
    logic [WayBits-1:0] found, leaves;

    for (genvar w = 0; w < Ways; w++) begin : gen_keeps
      logic [2:0] same;  // wanted until this tile, the next, the one behind

      for (genvar t = 0; t < 3; t++) begin : gen_same
        assign same[t] = row[c].way[w].keep == b_tiles_q[t];
      end

      assign keeps[w]  = row[c].way[w].valid && same != '0;
      assign turn[w]   = WayBits'(w) == row[c].turn;
    end

    assign behind = {Ways{1'b1}} << row[c].turn;

    always_comb begin
      late   = ~keeps & behind;
      early  = ~keeps;
      late  &= ~(late - 1'b1);
      early &= ~(early - 1'b1);
      victim = late != '0 ? late : early != '0 ? early : turn;
      found  = '0;
      leaves = '0;
      for (int unsigned w = 0; w < Ways; w++) begin
        found  |= hits[c][w] ? WayBits'(w) : '0;
        leaves |= victim[w] ? WayBits'(w) : '0;
      end
      way[c] = hits[c] != '0 ? found : leaves;
    end

    always_comb begin
      row_d[c]   = row[c];
      changed[c] = miss[c];
      if (miss[c]) begin
        row_d[c].turn = '0;
        for (int unsigned w = 0; w < Ways; w++) begin
          row_d[c].turn |= victim[w] ? WayBits'(w + 1) : '0;
        end
      end
      for (int unsigned w = 0; w < Ways; w++) begin
        if (miss[c] && victim[w]) begin
          row_d[c].way[w] = {1'b1, b_until_q[c], b_line_q[c][LineBits-1:BankBits+SetBits]};
        end
        if (b_valid_q[c] && !b_skip_q[c] && hits[c][w] &&
            row[c].way[w].keep != b_until_q[c]) begin
          row_d[c].way[w].keep = b_until_q[c];
          changed[c]           = 1'b1;
        end
      end
    end

    // A row that a lookup has in hand, changed or not, or that is not in the memory yet as it is read.
    logic [1:0] fresh, stored;

    for (genvar o = 0; o < 2; o++) begin : gen_changed
      assign fresh[o]  = b_valid_q[o] && !b_skip_q[o] &&
                         {b_set[o], b_bank[o]} == {in_set[c], in_bank[c]};
      assign stored[o] = store_valid_q[o] &&
                         {store_set_q[o], store_bank_q[o]} == {in_set[c], in_bank[c]};
    end

    always_ff @(posedge clk_i) begin
      if (take[c]) begin
        is_kept_q[c] <= fresh != '0 || stored != '0;
        kept_q[c]    <= fresh[0] ? row_d[0] : fresh[1] ? row_d[1]
                        : store_row_q[stored[1]];
      end
    end

    assign pushed[c] = '{
      skip: b_skip_q[c], miss: miss[c], part: b_part_q[c], bank: b_bank[c],
      place: {b_set[c], way[c]}, tag: b_tag_q[c]
    };
    assign missed[c] = '{valid: miss[c], line: b_line_q[c]};
  end

  // What has been looked up waits.
  logic [1:0] wait_push, wait_valid, go;
  logic       wait_ready, unused_one;  // for two elements; for one
  logic       wait_empty, miss_ready, miss_valid, miss_pop, miss_empty;

  assign advance   = wait_ready && miss_ready;
  assign wait_push = advance ? b_valid_q : '0;

  flk_pair_fifo #(
    .Width($bits(element_t)),
    .Depth(Depth)
  ) i_waiting (
    .clk_i,
    .rst_ni,
    .clear_i    (stop),
    .in_valid_i (wait_push),
    .in_ready_o ({wait_ready, unused_one}),
    .in_data_i  (pushed),
    .out_valid_o(wait_valid),
    .out_ready_i(go),
    .out_data_o (head),
    .empty_o    (wait_empty)
  );

  // ---- lines from memory ------------------------------------------------------------------------------

  logic                      unused_full, sent_q, sum_valid_q, sum_move, fetch_valid_q, fetch_ready;
  logic [2:0]                unused_usage;
  logic [LineBits-1:0]       sum_line_q;
  logic [LowBits:0]          fetch_low_q;
  logic [HighBits-1:0]       fetch_high_q;  // without the carry from below
  logic                      beat_valid, beat_error, unused_tag, freed;
  logic [1:0]                unused_ready, line_valid, line_pop;  // of the two oldest
  logic                      line_empty;
  logic [1:0]                popped_q;
  logic [OwedBits-1:0]       owed_q;
  logic [Width-1:0]          beat_data;
  logic [1:0][Width-1:0]     line_data;
  logic                      sum_load;

  flk_fifo #(
    .Width($bits(missed)),
    .Depth(4)
  ) i_misses (
    .clk_i,
    .rst_ni,
    .clear_i    (stop),
    .in_valid_i (miss != '0 && wait_ready),
    .in_ready_o (miss_ready),
    .in_data_i  (missed),
    .out_valid_o(miss_valid),
    .out_ready_i(miss_pop),
    .out_data_o (next),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (miss_empty)
  );

  // The first input's line, then the second's; its address, added up in two halves.
  assign sum_move = sum_valid_q && (!fetch_valid_q || fetch_ready);
  assign sum_load = miss_valid && (!sum_valid_q || sum_move);
  assign miss_pop = sum_load && (sent_q || !(next[0].valid && next[1].valid));

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      sum_valid_q   <= 1'b0;
      fetch_valid_q <= 1'b0;
      sent_q        <= 1'b0;
    end else if (stop) begin
      sum_valid_q   <= 1'b0;
      fetch_valid_q <= 1'b0;
      sent_q        <= 1'b0;
    end else begin
      sum_valid_q   <= sum_load || (sum_valid_q && !sum_move);
      fetch_valid_q <= sum_move || (fetch_valid_q && !fetch_ready);
      if (sum_load) begin
        sent_q <= !miss_pop;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (sum_load) begin
      sum_line_q <= next[0].valid && !sent_q ? next[0].line : next[1].line;
    end
    if (sum_move) begin
      fetch_low_q  <= {1'b0, record_base_i[LowBits-1:0]} + (LowBits + 1)'(sum_line_q[LowBits-1:0]);
      fetch_high_q <= record_base_i[AddrBits-Shift-1:LowBits]
                      + HighBits'(sum_line_q[LineBits-1:LowBits]);
    end
  end

  flk_axi_fetch #(
    .Places  (Places),
    .AddrBits(AddrBits),
    .BeatBits(2),
    .TagBits (1),
    .Width   (Width),
    .MaxBeats(2),
    .Bursts  (Places),
    .Listed  (1'b0),
    .IdBits  (IdBits),
    .Id      (Id)
  ) i_fetch (
    .clk_i,
    .rst_ni,
    .stop_i     (stop),
    .idle_o     (fetch_idle),
    .in_valid_i (fetch_valid_q),
    .in_ready_o (fetch_ready),
    .in_beat_i  ({fetch_high_q + HighBits'(fetch_low_q[LowBits]), fetch_low_q[LowBits-1:0]}),
    .in_beats_i (2'd1),
    .in_tag_i   (1'b0),
    .in_placed_i(1'b0),
    .freed_i    (freed),
    .out_valid_o(beat_valid),
    .out_data_o (beat_data),
    .out_tag_o  (unused_tag),
    .out_error_o(beat_error),
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o,
    .ar_addr_o,
    .ar_len_o,
    .ar_size_o,
    .ar_burst_o,
    .r_valid_i,
    .r_ready_o,
    .r_id_i,
    .r_data_i,
    .r_resp_i,
    .r_last_i
  );

  flk_pair_fifo #(
    .Width(Width),
    .Depth(Places)
  ) i_lines (
    .clk_i,
    .rst_ni,
    .clear_i    (stop),
    .in_valid_i ({1'b0, beat_valid}),
    .in_ready_o (unused_ready),  // only what has a place is asked for
    .in_data_i  ({Width'(0), beat_data}),
    .out_valid_o(line_valid),
    .out_ready_i(line_pop),
    .out_data_o (line_data),
    .empty_o    (line_empty)
  );

  // Places that are free again are told one a cycle.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      popped_q <= '0;
      owed_q   <= '0;
    end else if (stop) begin
      popped_q <= '0;
      owed_q   <= '0;
    end else begin
      popped_q <= line_pop;
      owed_q   <= owed_q + OwedBits'(popped_q[0]) + OwedBits'(popped_q[1]) - OwedBits'(freed);
    end
  end

  assign freed = owed_q != '0;

  // ---- C: the head of the queue ------------------------------------------------------------------------

  // The second goes with the first: not if both read one bank, or both write one, or if they are of one place.
  logic go_first, go_second, apart;

  assign apart     = head[0].skip || head[1].skip || head[0].bank != head[1].bank ||
                     (head[0].miss != head[1].miss && head[0].place != head[1].place);
  assign go_first  = wait_valid[0] && out_ready_i && (!head[0].miss || line_valid[0]);
  assign go_second = go_first && wait_valid[1] && apart &&
                     (!head[1].miss || (head[0].miss ? line_valid[1] : line_valid[0]));
  assign go        = {go_second, go_first};
  assign line_pop  = {go_second && head[1].miss && head[0].miss,
                      go_first && (head[0].miss || (go_second && head[1].miss))};

  // ---- D: data ----------------------------------------------------------------------------------------

  logic [1:0]                d_valid_q, d_part_q, d_miss_q;
  logic [1:0][BankBits-1:0]  d_bank_q;
  logic [1:0][TagBits-1:0]   d_tag_q;
  logic [1:0][Width-1:0]     d_line_q, came;  // from memory
  logic [Banks-1:0][Width-1:0] data;

  assign came = {head[0].miss ? line_data[1] : line_data[0], line_data[0]};

  for (genvar b = 0; b < Banks; b++) begin : gen_data
    // What the two do here, if they go: the second only where the first does not.
    logic [1:0] writes, reads;

    for (genvar c = 0; c < 2; c++) begin : gen_here
      assign writes[c] = !head[c].skip && head[c].bank == BankBits'(b) && head[c].miss;
      assign reads[c]  = !head[c].skip && head[c].bank == BankBits'(b) && !head[c].miss;
    end

    flk_sram #(
      .Width(Width),
      .Depth(Sets * Ways)
    ) i_data (
      .clk_i,
      .wr_en_i  ((go & writes) != '0),
      .wr_addr_i(writes[0] ? head[0].place : head[1].place),
      .wr_data_i(writes[0] ? came[0] : came[1]),
      .rd_en_i  ((go & reads) != '0),
      .rd_addr_i(reads[0] ? head[0].place : head[1].place),
      .rd_data_o(data[b])
    );
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      d_valid_q <= '0;
    end else begin
      d_valid_q <= stop ? '0 : go;
    end
  end

  always_ff @(posedge clk_i) begin
    for (int unsigned c = 0; c < 2; c++) begin
      if (go[c]) begin
        d_part_q[c] <= head[c].part;
        d_miss_q[c] <= head[c].miss;
        d_bank_q[c] <= head[c].bank;
        d_tag_q[c]  <= head[c].tag;
      end
      if (go[c] && head[c].miss) begin
        d_line_q[c] <= came[c];
      end
    end
  end

  for (genvar c = 0; c < 2; c++) begin : gen_out
    logic [Width-1:0] whole;

    assign whole           = d_miss_q[c] ? d_line_q[c] : data[d_bank_q[c]];
    assign out_valid_o[c]  = d_valid_q[c];
    assign out_tag_o[c]    = d_tag_q[c];
    assign out_record_o[c] = PerLine > 1 && d_part_q[c] ? whole[Width-1-:RecordBits]
                             : whole[RecordBits-1:0];
  end

  // ---- what is told -----------------------------------------------------------------------------------

  logic error_q, waiting_q, taken_q;  // of the head: it was there; it was allowed to leave

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      waiting_q <= 1'b0;
      taken_q   <= 1'b0;
    end else begin
      waiting_q <= wait_valid[0] && !stop;
      taken_q   <= out_ready_i;
    end
  end

  assign waits_o = {waiting_q && taken_q && !d_valid_q[0], waiting_q && !taken_q};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      error_q <= 1'b0;
    end else if (stop) begin
      error_q <= 1'b0;
    end else if (beat_valid && beat_error) begin
      error_q <= 1'b1;
    end
  end

  flk_event_counter i_count (
    .clk_i,
    .rst_ni,
    .clear_i(stop),
    .count_i(fetch_valid_q && fetch_ready),
    .value_o(lines_o)
  );

  assign error_o = error_q;
  assign idle_o  = state_q == READY && b_valid_q == '0 && wait_empty && miss_empty &&
                   !sum_valid_q && !fetch_valid_q &&
                   fetch_idle && line_empty && popped_q == '0 && owed_q == '0 &&
                   d_valid_q == '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o || state_q != READY)
  else $error("flk_record_cache: start while lookups are under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      beat_valid && !stop |-> unused_ready[0])
  else $error("flk_record_cache: a line without a place");

  for (genvar c = 0; c < 2; c++) begin : gen_check
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        b_valid_q[c] && !b_skip_q[c] |-> $onehot0(hits[c]))
    else $error("flk_record_cache: a line in two ways");
  end
`endif

endmodule
