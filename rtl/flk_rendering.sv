// Rendering: from tile lists and records in memory to a frame buffer in memory (docs/reference/rendering.md).
//
// What flk_preprocessing leaves is read back list by list: list readers and sorting units (SortUnits of each) take the tiles of the walk in turn,
// delivery fetches records and gives them to the cores of the rendering stage that Stage chooses (flk_stage), and the frame writer
// puts finished pixels together. The walk goes in pairs of tiles (flk_tile_walk); a tile that the picture lacks has an empty list.
// A frame: start_i while idle_o, with registers_i, which stays until done_o, high for a cycle when all has been written and answered.
// error_o, until the next start: bit 0 lists could not be read, break their layout or are longer than is sorted, bit 1 records could not be read, bit 2 a write
// failed; the frame goes on to its end, with what there is.
// Lists that a sorting unit does not hold are written back as runs, behind the lists: unit u has its region of the runs of the longest one at
// lists_beat + 32 chunks + u times its lines (flk_list_sorter, docs/reference/list_sorter.md).
// Three AXI4 ports of 512 bits (flk_axi_pkg): lists (read, identifiers 0 to SortUnits - 1, of runs SortUnits to 2 SortUnits - 1), records (read, narrow
// bursts of one beat of 32 bytes), frame buffer and runs (write).
// stop_i (a level, until a reset): no further pair of tiles is written; stopped_o: those that were begun are in memory, and the unit may be reset once
// nothing is under way at its ports. left_o: pairs of tiles that are not written, the last ones of the walk.
// A sub-tile whose pixels are all finished leaves its list: delivery drops its records, and when all four of a tile say so the
// sorting unit drops the list (not in the automatic mode, flk_render_stage).
// No combinational path but those of flk_axi_read_mux and flk_line_writer.
module flk_rendering
  import flk_axi_pkg::*;
  import flk_pkg::*;
  import flk_counter_pkg::*;
  import flk_param_pkg::*;
  import flk_rendering_pkg::*;
#(
  parameter  int unsigned Stage          = STAGE_CHANNELS,  // the next ones are its parameters
  parameter  int unsigned Form           = FORM_FACTORED,
  parameter  int unsigned Precision      = PRECISION_FIXED,
  parameter  int unsigned FifoDepth      = FIFO_DEPTH,
  parameter  int unsigned CtuFifoDepth   = CTU_FIFO_DEPTH,
  parameter  int unsigned VrusPerChannel = VRUS_PER_CHANNEL,
  parameter  int unsigned MaskGenerator  = MASK_GENERATOR_CTU,
  parameter  int unsigned Cores          = CORES,  // 1, 2 or 4; of channels 4
  parameter  int unsigned Lanes          = 32,     // of all cores
  parameter  int unsigned Slots          = flk_lane_pkg::LANE_SLOTS,
  parameter  int unsigned Depth          = flk_lane_pkg::LANE_QUEUE_DEPTH,
  parameter  int unsigned InWidth        = 1,    // records a cycle of each core: 1, with lanes 2
  parameter  int unsigned SortUnits      = 4,    // 1, 2 or 4, each with a list reader and a buffer
  parameter  int unsigned SortStages     = 7,    // a sorting unit takes 16 << this
  parameter  int unsigned SortWays       = 8,    // runs that its last step merges
  parameter  int unsigned MergeLines     = 128,  // for lists that do not fit; half as many runs
  parameter  int unsigned Chunks         = 8,   // in a list reader's memory
  parameter  int unsigned Entries        = 704,  // of each sorting unit, that wait for delivery
  parameter  int unsigned Queue          = 128,  // records of each core
  parameter  int unsigned Gather         = 64,   // lines that are written together
  parameter  int unsigned Pairs          = 4,    // of tiles that the frame writer holds
  parameter  int unsigned RecordLines    = 1024  // cached, of 32 bytes; a power of two
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 start_i,
  output logic                 idle_o,
  input  rendering_registers_t registers_i,
  output logic                 done_o,
  output logic [2:0]           error_o,
  input  logic                 stop_i,
  output logic                 stopped_o,
  output logic [15:0]          left_o,
  output rendering_counters_t  counters_o,
  // The stage's counters of the last frame (flk_render_stage)
  input  logic [COUNTER_ADDR_BITS-1:0] counter_addr_i,
  output logic [COUNTER_BITS-1:0]      counter_data_o,
  // AXI4: readers RENDERING_READ_*
  output logic    [RENDERING_READERS-1:0] ar_valid_o,
  input  logic    [RENDERING_READERS-1:0] ar_ready_i,
  output axi_ax_t [RENDERING_READERS-1:0] ar_o,
  input  logic    [RENDERING_READERS-1:0] r_valid_i,
  output logic    [RENDERING_READERS-1:0] r_ready_o,
  input  axi_r_t  [RENDERING_READERS-1:0] r_i,
  // Frame buffer and runs
  output logic                            aw_valid_o,
  input  logic                            aw_ready_i,
  output axi_ax_t                         aw_o,
  output logic                            w_valid_o,
  input  logic                            w_ready_i,
  output axi_w_t                          w_o,
  input  logic                            b_valid_i,
  output logic                            b_ready_o,
  input  axi_b_t                          b_i
);

  localparam int unsigned RecordBeat = AXI_DATA_BITS / 2;  // of a narrow read
  localparam int unsigned RecordBits = (Form == FORM_FACTORED) ? 128 : 256;
  localparam int unsigned BeatBits = RENDERING_BEAT_BITS;
  localparam int unsigned Readers  = 2 * SortUnits;  // of lists, of runs
  localparam int unsigned TurnBits = SortUnits > 1 ? $clog2(SortUnits) : 1;

  if (SortUnits != 1 && SortUnits != 2 && SortUnits != 4) begin : gen_check_units
    $error("flk_rendering: SortUnits must be 1, 2 or 4");
  end

  // ---- frame ----------------------------------------------------------------------------------------

  typedef enum logic [1:0] {IDLE, START, RUN} state_e;

  state_e     state_q;
  logic       start, forgot_q, pixels_done, lines_idle, quiet, done_q;
  logic [SortUnits-1:0] reader_idle, sorter_idle, buffer_empty, list_error, run_error, again;
  logic       delivery_idle, stage_idle, record_error, write_failed, write_error_q;

  assign start  = state_q == START && forgot_q;
  assign idle_o = state_q == IDLE;
  assign quiet  = pixels_done && lines_idle && (&reader_idle) && (&sorter_idle) &&
                  (&buffer_empty) && delivery_idle && stage_idle;

  // Delivery forgets its cache first; all others start when it has.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q       <= IDLE;
      forgot_q      <= 1'b0;
      done_q        <= 1'b0;
      write_error_q <= 1'b0;
    end else begin
      forgot_q <= state_q == START && delivery_idle;
      done_q   <= 1'b0;
      unique case (state_q)
        IDLE: begin
          if (start_i) begin
            state_q       <= START;
            write_error_q <= 1'b0;
          end
        end
        START: begin
          if (start) begin
            state_q <= RUN;
          end
        end
        default: begin
          if (quiet) begin
            state_q <= IDLE;
            done_q  <= 1'b1;
          end
        end
      endcase
      if (write_failed) begin
        write_error_q <= 1'b1;
      end
    end
  end

  assign done_o  = done_q;
  assign error_o = {write_error_q, record_error, |(list_error | run_error)};

  // ---- lists ----------------------------------------------------------------------------------------

  logic                        walk_done, walk_next, unused_second;
  logic [1:0][3:0]             unused_border;
  logic [TILE_COORD_BITS-1:0]  walk_x, walk_y;
  logic [TurnBits-1:0]         turn_q;
  logic [SortUnits-1:0]        tile_ready, tile_valid;
  logic [Readers-1:0]                 ask_valid, ask_ready, beat_valid, beat_ready;  // lists, runs
  logic [SortUnits-1:0]               list_valid, list_ready;  // lines
  axi_ax_t [Readers-1:0]              ask;
  logic [SortUnits-1:0]               sorted_valid, sorted_ready, sorted_end, finish;
  logic [SortUnits-1:0][27:0]         sorted_entry;
  logic [SortUnits-1:0]               finish_unit, entry_ready;
  logic [SortUnits-1:0][1:0]          entry_valid, entry_end;
  logic [SortUnits-1:0][1:0][27:0]    entry;
  logic [SortUnits-1:0][31:0]         entries, readings, dropped;

  // Runs: lines to memory, and whether those of a unit are there.
  localparam int unsigned Runs     = MergeLines / 2;
  localparam int unsigned RunLines = ((16 << SortStages) + 8) / 9;

  if (Runs * RunLines > 64 * 228) begin : gen_check_runs
    $error("flk_rendering: SortStages, MergeLines: drivers hold 64 runs of 228 lines a unit");
  end

  // Record cache
  localparam int unsigned RecordBanks = 4;
  localparam int unsigned RecordWays  = 4;

  if (RecordLines < 2 * RecordBanks * RecordWays || RecordLines > 65536 ||
      RecordLines != 1 << $clog2(RecordLines)) begin : gen_check_record_lines
    $error("flk_rendering: RecordLines must be a power of two, 32 to 65536");
  end

  logic [SortUnits-1:0]               run_valid, run_ready, run_waits, run_open_q;
  logic [SortUnits-1:0][BeatBits-1:0] run_beat, run_base_q;
  logic [SortUnits-1:0][511:0]        run_data;

  flk_tile_walk #(
    .CoordBits(TILE_COORD_BITS)
  ) i_walk (
    .clk_i,
    .rst_ni,
    .start_i (start),
    .next_i  (walk_next),
    .pairs_i (registers_i.pairs),
    .rows_i  (registers_i.rows),
    .done_o  (walk_done),
    .tile_x_o(walk_x),
    .tile_y_o(walk_y),
    .second_o(unused_second),
    .border_o(unused_border)
  );

  assign walk_next = !walk_done && tile_ready[turn_q];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      turn_q <= '0;
    end else begin
      turn_q <= start ? '0 : (turn_q + TurnBits'(walk_next)) & TurnBits'(SortUnits - 1);
    end
  end

  for (genvar u = 0; u < SortUnits; u++) begin : gen_unit
    logic              line_last;
    logic [471:0]      line_entries;
    logic [3:0]        line_count;

    assign tile_valid[u] = !walk_done && turn_q == TurnBits'(u);

    flk_list_reader #(
      .Slots(Chunks),
      .Id   (u)
    ) i_reader (
      .clk_i,
      .rst_ni,
      .start_i       (start),
      .clear_i       (1'b0),
      .idle_o        (reader_idle[u]),
      .error_o       (list_error[u]),
      .list_base_i   (registers_i.lists_beat),
      .pointer_base_i(registers_i.pointers_beat),
      .columns_i     (registers_i.pairs),
      .chunks_i      (registers_i.chunks),
      .tile_valid_i  (tile_valid[u]),
      .tile_ready_o  (tile_ready[u]),
      .tile_x_i      (walk_x),
      .tile_y_i      (walk_y),
      .out_valid_o   (list_valid[u]),
      .out_ready_i   (list_ready[u]),
      .out_entries_o (line_entries),
      .out_count_o   (line_count),
      .out_last_o    (line_last),
      .ar_valid_o    (ask_valid[u]),
      .ar_ready_i    (ask_ready[u]),
      .ar_o          (ask[u]),
      .r_valid_i     (beat_valid[u]),
      .r_ready_o     (beat_ready[u]),
      .r_i           (r_i[RENDERING_READ_LISTS])
    );

    always_ff @(posedge clk_i) begin
      run_base_q[u] <= registers_i.lists_beat + BeatBits'({registers_i.chunks, 5'b0})
                       + BeatBits'(u * Runs * RunLines);
    end

    flk_list_sorter #(
      .Stages    (SortStages),
      .Ways      (SortWays),
      .Runs      (Runs),
      .MergeLines(MergeLines),
      .Id        (SortUnits + u)
    ) i_sorter (
      .clk_i,
      .rst_ni,
      .start_i      (start),
      .idle_o       (sorter_idle[u]),
      .error_o      (run_error[u]),
      .base_i       (run_base_q[u]),
      .entries_o    (entries[u]),
      .readings_o   (readings[u]),
      .dropped_o    (dropped[u]),
      .again_o      (again[u]),
      .in_valid_i   (list_valid[u]),
      .in_ready_o   (list_ready[u]),
      .in_entries_i (line_entries),
      .in_count_i   (line_count),
      .in_last_i    (line_last),
      .out_valid_o  (sorted_valid[u]),
      .out_ready_i  (sorted_ready[u]),
      .out_end_o    (sorted_end[u]),
      .out_entry_o  (sorted_entry[u]),
      .finish_i     (finish_unit[u]),
      .write_valid_o(run_valid[u]),
      .write_ready_i(run_ready[u]),
      .write_beat_o (run_beat[u]),
      .write_data_o (run_data[u]),
      .waits_o      (run_waits[u]),
      .written_i    (!run_open_q[u]),
      .ar_valid_o   (ask_valid[SortUnits+u]),
      .ar_ready_i   (ask_ready[SortUnits+u]),
      .ar_o         (ask[SortUnits+u]),
      .r_valid_i    (beat_valid[SortUnits+u]),
      .r_ready_o    (beat_ready[SortUnits+u]),
      .r_i          (r_i[RENDERING_READ_LISTS])
    );

    flk_entry_buffer #(
      .Depth(Entries)
    ) i_buffer (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (sorted_valid[u]),
      .in_ready_o (sorted_ready[u]),
      .in_end_i   (sorted_end[u]),
      .in_entry_i (sorted_entry[u]),
      .finish_o   (finish_unit[u]),
      .out_valid_o(entry_valid[u]),
      .out_ready_i(entry_ready[u]),
      .out_end_o  (entry_end[u]),
      .out_entry_o(entry[u]),
      .finish_i   (finish[u]),
      .empty_o    (buffer_empty[u])
    );
  end

  flk_axi_read_mux #(
    .Managers(Readers)
  ) i_lists (
    .clk_i,
    .rst_ni,
    .ar_valid_i(ask_valid),
    .ar_ready_o(ask_ready),
    .ar_i      (ask),
    .r_valid_o (beat_valid),
    .r_ready_i (beat_ready),
    .ar_valid_o(ar_valid_o[RENDERING_READ_LISTS]),
    .ar_ready_i(ar_ready_i[RENDERING_READ_LISTS]),
    .ar_o      (ar_o[RENDERING_READ_LISTS]),
    .r_valid_i (r_valid_i[RENDERING_READ_LISTS]),
    .r_ready_o (r_ready_o[RENDERING_READ_LISTS]),
    .r_id_i    (r_i[RENDERING_READ_LISTS].id)
  );

  // ---- records --------------------------------------------------------------------------------------

  logic [CORES-1:0]                              finished;  // of each sub-tile
  logic [Cores-1:0]                              record_ready;
  logic [Cores-1:0][InWidth-1:0]                 record_valid, record_end;
  logic [Cores-1:0][InWidth-1:0][RecordBits-1:0] record;
  logic [Cores-1:0][InWidth-1:0][1:0]            record_subtile;
  logic [RecordBeat-1:0]                         record_data;
  logic [31:0]                                   cache_lines;
  logic [3:0]                                    delivery_waits;
  logic [1:0][3:0]                               border;  // of the tile in turn
  logic                                          taken, unused_taken_done, unused_taken_second;
  logic [TILE_COORD_BITS-1:0]                    unused_taken_x, unused_taken_y;

  flk_tile_walk #(
    .CoordBits(TILE_COORD_BITS)
  ) i_taken (
    .clk_i,
    .rst_ni,
    .start_i (start),
    .next_i  (taken),
    .pairs_i (registers_i.pairs),
    .rows_i  (registers_i.rows),
    .done_o  (unused_taken_done),
    .tile_x_o(unused_taken_x),
    .tile_y_o(unused_taken_y),
    .second_o(unused_taken_second),
    .border_o(border)
  );

  flk_axi_half #(
    .Width   (RecordBeat),
    .AddrBits(AXI_ADDR_BITS)
  ) i_half (
    .clk_i,
    .rst_ni,
    .ar_move_i(ar_valid_o[RENDERING_READ_RECORDS] && ar_ready_i[RENDERING_READ_RECORDS]),
    .ar_addr_i(ar_o[RENDERING_READ_RECORDS].addr),
    .r_valid_i(r_valid_i[RENDERING_READ_RECORDS]),
    .r_data_i (r_i[RENDERING_READ_RECORDS].data),
    .r_data_o (record_data)
  );

  flk_delivery #(
    .Units     (SortUnits),
    .RecordBits(RecordBits),
    .InWidth   (InWidth),
    .Queue     (Queue),
    .Sets      (RecordLines / (RecordBanks * RecordWays)),
    .Banks     (RecordBanks),
    .Ways      (RecordWays),
    .AddrBits  (AXI_ADDR_BITS),
    .IdBits    (AXI_ID_BITS),
    .Cores     (Cores)
  ) i_delivery (
    .clk_i,
    .rst_ni,
    .start_i      (state_q == IDLE && start_i),
    .clear_i      (1'b0),
    .idle_o       (delivery_idle),
    .error_o      (record_error),
    .lines_o      (cache_lines),
    .waits_o      (delivery_waits),
    .record_base_i({registers_i.records_beat, 1'b0}),
    .in_valid_i   (entry_valid),
    .in_ready_o   (entry_ready),
    .in_end_i     (entry_end),
    .in_entry_i   (entry),
    .finish_o     (finish),
    .border_i     (border),
    .taken_o      (taken),
    .out_valid_o  (record_valid),
    .out_ready_i  (record_ready),
    .out_end_o    (record_end),
    .out_record_o (record),
    .out_subtile_o(record_subtile),
    .finished_i   (finished),
    .ar_valid_o   (ar_valid_o[RENDERING_READ_RECORDS]),
    .ar_ready_i   (ar_ready_i[RENDERING_READ_RECORDS]),
    .ar_id_o      (ar_o[RENDERING_READ_RECORDS].id),
    .ar_addr_o    (ar_o[RENDERING_READ_RECORDS].addr),
    .ar_len_o     (ar_o[RENDERING_READ_RECORDS].len),
    .ar_size_o    (ar_o[RENDERING_READ_RECORDS].size),
    .ar_burst_o   (ar_o[RENDERING_READ_RECORDS].burst),
    .r_valid_i    (r_valid_i[RENDERING_READ_RECORDS]),
    .r_ready_o    (r_ready_o[RENDERING_READ_RECORDS]),
    .r_id_i       (r_i[RENDERING_READ_RECORDS].id),
    .r_data_i     (record_data),
    .r_resp_i     (r_i[RENDERING_READ_RECORDS].resp),
    .r_last_i     (r_i[RENDERING_READ_RECORDS].last)
  );

  // ---- pixels ---------------------------------------------------------------------------------------

  // Elements of a core; a number of the sub-tile in its tile only where the core has several.
  localparam int unsigned Share       = CORES / Cores;
  localparam int unsigned NumberBits  = (Share == 1) ? 0 : 2 * InWidth;
  localparam int unsigned ElementBits = InWidth * (2 + RecordBits);

  logic        [CORES-1:0]                              own_finished;
  logic        [Cores-1:0]                              own_ready, pixel_valid;
  logic        [Cores-1:0][InWidth-1:0]                 own_valid, own_end;
  logic        [Cores-1:0][InWidth-1:0][RecordBits-1:0] own_record;
  subtile_t    [Cores-1:0][InWidth-1:0]                 subtile;
  logic                                                 pair_freed;
  // Of a core: it has a record; there is a place for what it gives.
  logic        [Cores-1:0]                              has, open;
  core_pixel_t [Cores-1:0]                              pixel;

  for (genvar k = 0; k < Cores; k++) begin : gen_core
    logic                       unused_done, next, second;
    logic [1:0][3:0]            unused_here;
    logic [InWidth-1:0]         own, ends;
    logic [InWidth-1:0][1:0]    number;
    logic [NumberBits+ElementBits-1:0] held;
    logic [TILE_COORD_BITS-1:0] x, y;
    logic [$clog2(Pairs+1)-1:0] begun_q;  // pairs of tiles given whole and not freed

    // The frame writer has a place for what the core is given.
    assign open[k]      = 32'(begun_q) < Pairs;
    assign own_valid[k] = own & {InWidth{has[k] && open[k]}};
    assign ends         = own & own_end[k];
    assign next         = has[k] && open[k] && own_ready[k] && ends != '0;

    // The stage speaks of the elements that it takes, delivery of the one after them.
    for (genvar m = 0; m < Share; m++) begin : gen_subtile
      assign finished[Cores*m+k] = own_finished[Cores*m+k] && !(has[k] && ends != '0);
    end

    flk_pipe_reg #(
      .Width(NumberBits + ElementBits)
    ) i_record (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (record_valid[k][0]),
      .in_ready_o (record_ready[k]),
      .in_data_i  ((NumberBits + ElementBits)'({
          record_subtile[k], record_valid[k], record_end[k], record[k]})),
      .out_valid_o(has[k]),
      .out_ready_i(open[k] && own_ready[k]),
      .out_data_o (held)
    );

    assign {own, own_end[k], own_record[k]} = held[ElementBits-1:0];
    assign number = (Share == 1) ? {InWidth{2'(k)}} : (2 * InWidth)'(held >> ElementBits);

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        begun_q <= '0;
      end else begin
        begun_q <= begun_q + ($clog2(Pairs + 1))'(next && second)
                   - ($clog2(Pairs + 1))'(pair_freed);
      end
    end

    flk_tile_walk #(
    .CoordBits(TILE_COORD_BITS)
    ) i_walk (
      .clk_i,
      .rst_ni,
      .start_i (start),
      .next_i  (next),
      .pairs_i (registers_i.pairs),
      .rows_i  (registers_i.rows),
      .done_o  (unused_done),
      .tile_x_o(x),
      .tile_y_o(y),
      .second_o(second),
      .border_o(unused_here)
    );

    for (genvar w = 0; w < InWidth; w++) begin : gen_way
      assign subtile[k][w].col = SUBTILE_COORD_BITS'({x, number[w][0]});
      assign subtile[k][w].row = SUBTILE_COORD_BITS'({y, number[w][1]});
    end
  end

  flk_stage #(
    .Stage         (Stage),
    .Form          (Form),
    .Precision     (Precision),
    .FifoDepth     (FifoDepth),
    .CtuFifoDepth  (CtuFifoDepth),
    .VrusPerChannel(VrusPerChannel),
    .MaskGenerator (MaskGenerator),
    .Cores         (Cores),
    .Lanes         (Lanes),
    .InWidth       (InWidth),
    .Slots         (Slots),
    .Depth         (Depth)
  ) i_stage (
    .clk_i,
    .rst_ni,
    .clear_i         (start),  // the automatic mode begins anew
    .idle_o          (stage_idle),
    .mode_i          (registers_i.mode),
    .in_valid_i      (own_valid),
    .in_ready_o      (own_ready),
    .in_end_i        (own_end),
    .in_record_i     (own_record),
    .in_subtile_i    (subtile),
    .finished_o      (own_finished),
    .out_valid_o     (pixel_valid),
    .out_ready_i     ('1),
    .out_data_o      (pixel),
    .clear_counters_i(start),
    .hold_counters_i (state_q == IDLE),
    .counter_addr_i,
    .counter_data_o
  );

  // ---- frame buffer ---------------------------------------------------------------------------------

  logic                line_valid, line_ready, writer_idle, unused_empty, unused_done;
  logic                stop_q, stopped_q, pairs_stopped;
  logic [BeatBits-1:0] line_beat;
  logic [3:0]          line_strobe;
  logic [511:0]        line_data;

  // Lines of runs go with them.
  localparam int unsigned WriteBits = BeatBits + 4 + 512;
  localparam int unsigned SeqBits   = 12;  // more lines than are ever under way

  localparam int unsigned Stores    = SortUnits + 1;

  logic [Stores-1:0]                write_valid, write_ready;
  logic [Stores-1:0][WriteBits-1:0] write;
  logic                      store_valid, store_ready, answered;
  logic [WriteBits-1:0]      store;
  logic [$clog2(Stores)-1:0] unused_from;
  logic [SeqBits-1:0]        stored_q, answered_q;
  logic [SortUnits-1:0][SeqBits-1:0] mark_q;  // number of a unit's last line

  assign write_valid = {run_valid, line_valid};
  assign write[0]    = {line_beat, line_strobe, line_data};
  assign {run_ready, line_ready} = write_ready;

  for (genvar u = 0; u < SortUnits; u++) begin : gen_stores
    assign write[1+u] = {run_beat[u], 4'hf, run_data[u]};
  end

  flk_stream_arbiter #(
    .Inputs(Stores),
    .Width (WriteBits)
  ) i_store (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (write_valid),
    .in_ready_o (write_ready),
    .in_data_i  (write),
    .out_valid_o(store_valid),
    .out_ready_i(store_ready),
    .out_data_o (store),
    .out_index_o(unused_from)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      stored_q   <= '0;
      answered_q <= '0;
      run_open_q <= '0;
    end else begin
      stored_q   <= stored_q + SeqBits'(store_valid && store_ready);
      answered_q <= answered_q + SeqBits'(answered);
      for (int unsigned u = 0; u < SortUnits; u++) begin
        if (run_valid[u] && run_ready[u]) begin
          run_open_q[u] <= 1'b1;
        end else if (answered && answered_q == mark_q[u]) begin
          run_open_q[u] <= 1'b0;
        end
      end
    end
  end

  always_ff @(posedge clk_i) begin
    for (int unsigned u = 0; u < SortUnits; u++) begin
      if (run_valid[u] && run_ready[u]) begin
        mark_q[u] <= stored_q;
      end
    end
  end

  flk_frame_writer #(
    .Pairs     (Pairs),
    .BeatBits  (BeatBits),
    .StrideBits(STRIDE_BITS),
    .Lanes     (STAGE_LANE_ORDER[Stage] == '0 ? 0 : Lanes),
    .Cores     (Cores)
  ) i_frame (
    .clk_i,
    .rst_ni,
    .clear_i     (1'b0),
    .start_i     (start),
    .idle_o      (writer_idle),
    .rgba_i      (registers_i.rgba),
    .background_i(registers_i.background),
    .base_i      (registers_i.frame_beat),
    .stride_i    (registers_i.stride),
    .pairs_i     (registers_i.all_pairs),
    .done_o      (unused_done),
    .freed_o     (pair_freed),
    .stop_i      (stop_q),
    .stopped_o   (pairs_stopped),
    .left_o,
    .in_valid_i  (pixel_valid),
    .in_data_i   (pixel),
    .out_valid_o (line_valid),
    .out_ready_i (line_ready),
    .out_beat_o  (line_beat),
    .out_strobe_o(line_strobe),
    .out_data_o  (line_data)
  );

  assign pixels_done = writer_idle;

  // Lines of runs that come on the way are written, too. Before the frame writer begins it knows no pairs.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      stop_q    <= 1'b0;
      stopped_q <= 1'b0;
    end else begin
      stop_q    <= stop_i;
      stopped_q <= stop_q && (stopped_q || (state_q == RUN && pairs_stopped && lines_idle &&
                                            !store_valid));
    end
  end

  assign stopped_o = stopped_q;

  flk_line_writer #(
    .Gather  (Gather),
    .Bursts  (Gather),
    .BeatBits(BeatBits),
    .IdBits  (AXI_ID_BITS)
  ) i_lines (
    .clk_i,
    .rst_ni,
    .empty_o    (unused_empty),
    .idle_o     (lines_idle),
    .flush_i    (writer_idle || stop_q || run_waits != '0),
    .answered_o (answered),
    .failed_o   (write_failed),
    .in_valid_i (store_valid),
    .in_ready_o (store_ready),
    .in_beat_i  (store[512+4+:BeatBits]),
    .in_strobe_i(store[512+:4]),
    .in_data_i  (store[511:0]),
    .aw_valid_o,
    .aw_ready_i,
    .aw_id_o    (aw_o.id),
    .aw_addr_o  (aw_o.addr),
    .aw_len_o   (aw_o.len),
    .aw_size_o  (aw_o.size),
    .aw_burst_o (aw_o.burst),
    .w_valid_o,
    .w_ready_i,
    .w_data_o   (w_o.data),
    .w_strb_o   (w_o.strb),
    .w_last_o   (w_o.last),
    .b_valid_i,
    .b_ready_o,
    .b_id_i     (b_i.id),
    .b_resp_i   (b_i.resp)
  );

  // ---- counters -------------------------------------------------------------------------------------

  logic [31:0]                       cycles_q;
  logic [RENDERING_EVENTS-1:0][3:0]  events;   // by sorting unit or core
  logic [RENDERING_EVENTS-1:0][31:0] totals;
  logic [Cores-1:0]                  first_valid, record_waits, pair_waits;

  for (genvar k = 0; k < Cores; k++) begin : gen_first
    assign first_valid[k] = record_valid[k][0];
  end

  assign record_waits = first_valid & ~record_ready;
  assign pair_waits   = has & ~open;

  logic running_q;  // a cycle ago, as what delivery tells

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      running_q <= 1'b0;
    end else begin
      running_q <= state_q == RUN && !pixels_done;
    end
  end

  assign events[RENDERING_EVENT_LIST_WAITS]    = 4'({list_valid & ~list_ready});
  assign events[RENDERING_EVENT_SORTED_WAITS]  = 4'({sorted_valid & ~sorted_ready});
  assign events[RENDERING_EVENT_ENTRY_MISSING] = 4'(delivery_waits[0] && running_q);
  assign events[RENDERING_EVENT_ENTRY_WAITS]   = 4'(delivery_waits[1]);
  assign events[RENDERING_EVENT_QUEUE_WAITS]   = 4'(delivery_waits[2]);
  assign events[RENDERING_EVENT_CACHE_WAITS]   = 4'(delivery_waits[3]);
  assign events[RENDERING_EVENT_RECORD_WAITS]  = 4'(record_waits);
  assign events[RENDERING_EVENT_PAIR_WAITS]    = 4'(pair_waits);
  assign events[RENDERING_EVENT_FRAME_WAITS]   = 4'(line_valid && !line_ready);
  assign events[RENDERING_EVENT_SORTED_AGAIN]  = 4'(again);

  flk_event_counters #(
    .Counters(RENDERING_EVENTS),
    .Sources (4)
  ) i_events (
    .clk_i,
    .rst_ni,
    .clear_i (start),
    .events_i(events),
    .values_o(totals)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      cycles_q <= '0;
    end else if (idle_o) begin
      cycles_q <= start_i ? '0 : cycles_q;
    end else begin
      cycles_q <= cycles_q + 1'b1;
    end
  end

  always_comb begin
    counters_o          = rendering_events(totals);
    counters_o.cycles   = cycles_q;
    counters_o.entries  = 128'(entries);
    counters_o.readings = 128'(readings);
    counters_o.dropped  = 128'(dropped);
    counters_o.lines    = cache_lines;
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o)
  else $error("flk_rendering: start while a frame is under way");
`endif

endmodule
