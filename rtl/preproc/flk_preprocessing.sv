// Preprocessing: from a packed scene in memory to records and tile lists (docs/reference/front_end.md).
//
// PreprocLanes cores behind three AXI4 read ports (cluster table, geometry, colours), one write port and one
// of both kinds, for list pointers of pictures with more lists than Pointers a writer. A frame: start_i while idle_o, with the frame's registers, which stay until done_o; done_o is high
// for a cycle when all has been written and answered, error_o and the counters then stay until the
// next start. Everything that is written is the same for every timing. Form: records of 16 bytes in
// factored form, or of 32 in conic form.
// error_o: bits of FRONT_ERROR_*. An error of the memory, or a float of the cluster table or a header
// that is not finite, ends the frame early where it was met; a cluster beyond the records' region
// writes nothing; a list writer without a chunk writes no more.
// A group of four Gaussians takes the lanes as many turns as it needs, PreprocInterval cycles each. ListWriters share the four banks of lists:
// writer w has bank w and every ListWriters-th one behind it. What is written is the same bytes for any number of both; colours are read
// for the survivors of a turn. entries, lines and evicted of the counters are by writer, taken by bank.
// Nothing is written outside the regions of records, lists and pointers. pointer_lines of the
// registers is at most Lists / 16.
module flk_preprocessing
  import flk_axi_pkg::*;
  import flk_counter_pkg::*;
  import flk_param_pkg::*;
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Form         = FORM_FACTORED,
  parameter  int unsigned PreprocLanes = 4,     // 1, 2 or 4
  parameter  int unsigned PreprocInterval = 2,  // cycles a Gaussian of a lane: 2 or 4
  parameter  int unsigned ListWriters  = 4,     // 1, 2 or 4
  parameter  bit          ColourStore  = 1'b1,  // colours can be kept; not with FORM_CONIC
  parameter  int unsigned Pointers     = 2048,  // of a bank of lists, held on the chip
  parameter  int unsigned Lists        = 16384, // of a bank, at most
  parameter  int unsigned Gather       = 216,   // lines that are written together
  parameter  int unsigned Waiting      = 128    // survivors of a lane that wait for colours
) (
  input  logic               clk_i,
  input  logic               rst_ni,
  input  logic               start_i,
  output logic               idle_o,
  output logic               done_o,
  output logic [23:0]        cluster_o,  // of the table, that its lanes take next; 0: none
  input  front_registers_t   registers_i,
  output logic [FRONT_ERRORS-1:0] error_o,
  output front_counters_t    counters_o,
  // AXI4: readers FRONT_READ_*, writers FRONT_WRITE_*
  output logic    [FRONT_READERS-1:0] ar_valid_o,
  input  logic    [FRONT_READERS-1:0] ar_ready_i,
  output axi_ax_t [FRONT_READERS-1:0] ar_o,
  input  logic    [FRONT_READERS-1:0] r_valid_i,
  output logic    [FRONT_READERS-1:0] r_ready_o,
  input  axi_r_t  [FRONT_READERS-1:0] r_i,
  output logic    [FRONT_WRITERS-1:0] aw_valid_o,
  input  logic    [FRONT_WRITERS-1:0] aw_ready_i,
  output axi_ax_t [FRONT_WRITERS-1:0] aw_o,
  output logic    [FRONT_WRITERS-1:0] w_valid_o,
  input  logic    [FRONT_WRITERS-1:0] w_ready_i,
  output axi_w_t  [FRONT_WRITERS-1:0] w_o,
  input  logic    [FRONT_WRITERS-1:0] b_valid_i,
  output logic    [FRONT_WRITERS-1:0] b_ready_o,
  input  axi_b_t  [FRONT_WRITERS-1:0] b_i
);

  localparam int unsigned Width = AXI_DATA_BITS;
  localparam int unsigned ProjectionLatency =
      (Form == FORM_FACTORED) ? projection_latency(PreprocInterval)
                              : projection_conic_latency(PreprocInterval);
  localparam int unsigned DecodeLatency = geometry_decode_latency(PreprocInterval);
  localparam int unsigned Latency = DecodeLatency + ProjectionLatency;
  localparam int unsigned PhaseBits = $clog2(PreprocInterval);
  localparam int unsigned HeaderBits = $clog2(COLOUR_CLUSTERS);
  localparam int unsigned RING = 1 << PLACE_BEAT_BITS;
  localparam int unsigned ListAddrBits = BEAT_BITS;
  // A record: what is not always zero, how many quarters of a beat it takes, how many there are in a beat.
  localparam int unsigned RecordBits =
      (Form == FORM_FACTORED) ? FACTORED_RECORD_BITS : CONIC_RECORD_BITS;
  localparam int unsigned Quarters = (Form == FORM_FACTORED) ? 1 : 2;
  localparam int unsigned Records = 4 / Quarters;
  localparam int unsigned InBeatBits = $clog2(Records);
  localparam bit Keeps = ColourStore && Form == FORM_FACTORED;
  localparam int unsigned KeptBits = RecordBits + (Keeps ? 8 : 0);  // with the image's opacity

  localparam int unsigned Most = (PreprocLanes + Records - 1) / Records + 2;  // see record_room
  localparam int unsigned Turns = LANES / PreprocLanes;  // of a group, at most
  localparam int unsigned TurnShift = $clog2(Turns);
  localparam int unsigned TurnBits = Turns > 1 ? TurnShift : 1;
  localparam int unsigned GroupBits = 6 + TurnShift;
  localparam int unsigned Banks = 4 / ListWriters;       // of a list writer
  localparam int unsigned BankBits = Banks > 1 ? $clog2(Banks) : 1;

  if (PreprocLanes != 1 && PreprocLanes != 2 && PreprocLanes != 4) begin : gen_check_lanes
    $error("flk_preprocessing: PreprocLanes must be 1, 2 or 4");
  end
  if (ListWriters != 1 && ListWriters != 2 && ListWriters != 4) begin : gen_check_writers
    $error("flk_preprocessing: ListWriters must be 1, 2 or 4");
  end
  if (PreprocInterval != 2 && PreprocInterval != 4) begin : gen_check_interval
    $error("flk_preprocessing: PreprocInterval must be 2 or 4");
  end
  if (DecodeLatency % PreprocInterval != 0 ||
      ProjectionLatency % PreprocInterval != 0) begin : gen_check
    $error("flk_preprocessing: latencies of the front must be multiples of its interval");
  end

  // ---- frame ----------------------------------------------------------------------------------------

  typedef enum logic [1:0] {IDLE, FRONT, BACK, LISTS} state_e;

  state_e state_d, state_q;
  logic   start, cull_idle, geometry_idle, front_idle, back_idle;
  logic   merge_idle, records_idle, write_idle, store_idle;
  logic   colour_idle, ended_q, lists_end, arbiter_empty;
  logic [PreprocLanes-1:0] lane_idle, queued_empty;
  logic [ListWriters-1:0]  list_idle, list_failed;

  assign start  = state_q == IDLE && start_i;
  assign idle_o = state_q == IDLE && (&list_idle);

  always_comb begin
    state_d = state_q;
    unique case (state_q)
      IDLE: begin
        if (start_i) begin
          state_d = FRONT;
        end
      end
      FRONT: begin  // groups come
        if (ended_q && front_idle) begin
          state_d = BACK;
        end
      end
      BACK: begin  // survivors finish
        if (back_idle) begin
          state_d = LISTS;
        end
      end
      default: begin  // lists are closed, all is written
        if (merge_idle && (&list_idle) && (&queued_empty) && records_idle && store_idle &&
            arbiter_empty && write_idle) begin
          state_d = IDLE;
        end
      end
    endcase
  end

  logic done_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
      done_q  <= 1'b0;
    end else begin
      state_q <= state_d;
      done_q  <= state_q == LISTS && state_d == IDLE;
    end
  end

  assign done_o    = done_q;
  assign back_idle = (&lane_idle) && colour_idle;
  assign lists_end = state_q == LISTS;

  // ---- clusters and geometry ------------------------------------------------------------------------

  logic              kept_valid, kept_ready, kept_end;
  kept_t             kept;
  logic              group_valid, group_ready, group_end;
  group_t            group;
  boxed_t            kept_box;
  logic              cull_ready, cull_valid, store_kept;
  logic              cull_error, geometry_error, colour_error, cull_damaged, geometry_damaged;
  logic [31:0]       culled_clusters, culled_gaussians, header_beats, geometry_beats, colour_beats;
  logic              unused_cull_done, unused_geometry_done;

  flk_cluster_cull i_cull (
    .clk_i,
    .rst_ni,
    .start_i           (start),
    .idle_o            (cull_idle),
    .setup_i           (registers_i.cull),
    .table_i           (registers_i.table_beat),
    .clusters_i        (registers_i.clusters),
    .done_o            (unused_cull_done),
    .error_o           (cull_error),
    .damaged_o         (cull_damaged),
    .culled_clusters_o (culled_clusters),
    .culled_gaussians_o(culled_gaussians),
    .out_valid_o       (cull_valid),
    .out_ready_i       (cull_ready),
    .out_end_o         (kept_end),
    .out_cluster_o     (kept),
    .out_box_o         (kept_box),
    .ar_valid_o        (ar_valid_o[FRONT_READ_TABLE]),
    .ar_ready_i        (ar_ready_i[FRONT_READ_TABLE]),
    .ar_o              (ar_o[FRONT_READ_TABLE]),
    .r_valid_i         (r_valid_i[FRONT_READ_TABLE]),
    .r_ready_o         (r_ready_o[FRONT_READ_TABLE]),
    .r_i               (r_i[FRONT_READ_TABLE])
  );

  // The geometry and the colour store take a cluster together.
  assign kept_valid = cull_valid && (store_kept || kept_end);
  assign cull_ready = kept_ready && (store_kept || kept_end);

  flk_geometry_fetch i_geometry (
    .clk_i,
    .rst_ni,
    .start_i         (start),
    .idle_o          (geometry_idle),
    .chunked_i       (registers_i.lane.chunked),
    .position_i      (registers_i.cull.position),
    .headers_i       (registers_i.headers_beat),
    .geometry_i      (registers_i.geometry_beat),
    .done_o          (unused_geometry_done),
    .error_o         (geometry_error),
    .damaged_o       (geometry_damaged),
    .header_beats_o  (header_beats),
    .geometry_beats_o(geometry_beats),
    .cluster_o,
    .in_valid_i      (kept_valid),
    .in_ready_o      (kept_ready),
    .in_end_i        (kept_end),
    .in_cluster_i    (kept),
    .out_valid_o     (group_valid),
    .out_ready_i     (group_ready),
    .out_end_o       (group_end),
    .out_group_o     (group),
    .ar_valid_o      (ar_valid_o[FRONT_READ_GEOMETRY]),
    .ar_ready_i      (ar_ready_i[FRONT_READ_GEOMETRY]),
    .ar_o            (ar_o[FRONT_READ_GEOMETRY]),
    .r_valid_i       (r_valid_i[FRONT_READ_GEOMETRY]),
    .r_ready_o       (r_ready_o[FRONT_READ_GEOMETRY]),
    .r_i             (r_i[FRONT_READ_GEOMETRY])
  );

  // ---- a group enters the lanes ---------------------------------------------------------------------

  typedef struct packed {
    logic [31:0] colour;
    logic [19:0] first;
    logic [6:0]  stride;
    colour_step_t step;
    logic [1:0]  degree;
  } place_of_cluster_t;

  typedef struct packed {
    logic           last;
    logic [GroupBits-1:0]    group;  // and turn
    logic [PreprocLanes-1:0] used;
    cluster_index_t cluster;
  } side_t;

  logic [PhaseBits-1:0]   front_phase_q;
  logic                   front_en, enter, room, beyond, beyond_q, take_end, opens;
  cluster_index_t         cluster_q, cluster, oldest, exit, exit_q;
  place_of_cluster_t [COLOUR_CLUSTERS-1:0] clusters_q;
  colour_step_t           entering_step;
  side_t                  side_in, side;
  logic [Latency-1:0]     front_valid_q;
  logic                   exit_valid, go;

  // The Gaussians of a group that enter now: as many neighbours as there are lanes.
  logic [TurnBits-1:0]                turn_q;
  logic                               turn_first, turn_last;
  logic [PreprocLanes-1:0]            turn_used;
  logic [PreprocLanes-1:0][4:0][31:0] turn_word;
  logic                               turn_there;  // turn_word is of this turn

  if (Turns == 1) begin : gen_whole
    assign turn_q     = '0;
    assign turn_first = group.first;
    assign turn_last  = 1'b1;
    assign turn_used  = group.used;
    assign turn_word  = group.word;
    assign turn_there = 1'b1;
  end else begin : gen_in_turns
    assign turn_first = group.first && turn_q == '0;
    assign turn_last  = group.used >> (PreprocLanes * (32'(turn_q) + 1)) == '0;
    assign turn_used  = PreprocLanes'(group.used >> (PreprocLanes * 32'(turn_q)));

    // Chosen in the cycle before: a turn enters every other one at most.
    logic [PreprocLanes-1:0][4:0][31:0] word_q;
    logic                               there_q;

    assign turn_word  = word_q;
    assign turn_there = there_q;

    always_ff @(posedge clk_i) begin
      for (int unsigned k = 0; k < PreprocLanes; k++) begin
        word_q[k] <= group.word[2'(PreprocLanes*32'(turn_q)+k)];
      end
    end

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        turn_q  <= '0;
        there_q <= 1'b0;
      end else begin
        there_q <= group_valid && !enter && !take_end;
        if (enter) begin
          turn_q <= turn_last ? '0 : turn_q + 1'b1;
        end
      end
    end
  end

  assign cluster     = turn_first ? cluster_q + 1'b1 : cluster_q;
  assign room        = !turn_first ||
                       CLUSTER_BITS'(cluster - oldest) < CLUSTER_BITS'(COLOUR_CLUSTERS);
  assign opens       = front_en && front_phase_q == '0 && (group_end || (room && turn_there));
  assign group_ready = opens && (group_end || turn_last);
  assign enter       = group_valid && opens && !group_end;
  assign take_end    = group_valid && opens && group_end;
  // Records of a cluster beyond their region: none of its Gaussians is used.
  assign beyond      = 25'({group.cluster.first, 4'b0}) + 25'(group.cluster.last) >=
                       25'({registers_i.record_beats, {InBeatBits{1'b0}}});

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      front_phase_q <= '0;
      front_valid_q <= '0;
      cluster_q     <= '1;
      ended_q       <= 1'b0;
      beyond_q      <= 1'b0;
    end else begin
      if (front_en) begin
        front_phase_q <= front_phase_q + 1'b1;
        front_valid_q <= {front_valid_q[Latency-2:0], enter};
      end
      if (start) begin
        cluster_q <= '1;
        ended_q   <= 1'b0;
        beyond_q  <= 1'b0;
      end else begin
        if (enter) begin
          cluster_q <= cluster;
          beyond_q  <= beyond_q || beyond;
        end
        if (take_end) begin
          ended_q <= 1'b1;
        end
      end
    end
  end

  assign entering_step = colour_step(registers_i.lane.chunked, group.header.sh_zero);

  always_ff @(posedge clk_i) begin
    if (enter && turn_first) begin
      clusters_q[cluster[HeaderBits-1:0]] <= {group.header.colour, group.cluster.first,
                                              colour_stride(entering_step, group.cluster.degree),
                                              entering_step, group.cluster.degree};
    end
  end

  assign side_in.last    = group.last && turn_last;
  assign side_in.group   = (GroupBits'(group.group) << TurnShift) | GroupBits'(turn_q);
  assign side_in.used    = beyond ? '0 : turn_used;
  assign side_in.cluster = cluster;

  flk_delay #(
    .Width($bits(side_t)),
    .Depth(Latency / PreprocInterval)
  ) i_side (
    .clk_i,
    .en_i(front_en && front_phase_q == '0),
    .d_i (side_in),
    .q_o (side)
  );

  position_t [2:0] low, step;

  flk_delay #(
    .Width(2 * $bits(low)),
    .Depth(DecodeLatency / PreprocInterval)
  ) i_low (
    .clk_i,
    .en_i(front_en && front_phase_q == '0),
    .d_i ({group.header.low, group.header.step}),
    .q_o ({low, step})
  );

  colour_header_t colour_header;

  assign colour_header = '{sh_zero: group.header.sh_zero, dc_low: group.header.dc_low,
                           dc_step: group.header.dc_step, sh_step: group.header.sh_step};

  // ---- survivors: numbers and places ----------------------------------------------------------------

  logic [PreprocLanes-1:0]           lane_near, lane_outside, lane_ready, alive;
  logic [PreprocLanes-1:0][1:0]      ahead;   // survivors of the group in lanes before this one
  logic [2:0]                        count;
  logic [SEQ_BITS-1:0]               issued_q;
  logic [8:0]                        rank_q;  // survivors of the cluster so far
  logic [PLACE_BEAT_BITS-1:0]        ring_q;  // beat that is open
  logic [PLACE_BEAT_BITS:0]          taken_q; // beats told to the writer and not freed
  logic                              freed, partial, colour_room, record_room, store_room;
  logic [PreprocLanes-1:0]           there;   // colours that are stored
  logic [3:0]                        fill;   // records of the open beat and of those behind it
  logic [Quarters-1:0]               full;   // beats
  logic                              beat_valid, beat_ready, telling;
  logic                              told_full_q, more_q, second_q, left_q, told_partial_q;
  logic                              gone_q, last_q, cut;
  logic [2:0]                        count_q;
  record_beat_t                      told;
  place_of_cluster_t                 of;
  logic [PreprocLanes-1:0][NUMBER_BITS-1:0] number;
  place_t [PreprocLanes-1:0]         place;
  logic [PreprocLanes-1:0][SEQ_BITS-1:0]    seq;
  survivors_t                        survivors;
  logic [1:0]                        turn_at;

  assign exit_valid = front_valid_q[Latency-1];
  assign alive      = side.used & ~lane_near & ~lane_outside;
  assign of         = clusters_q[side.cluster[HeaderBits-1:0]];
  assign exit       = exit_valid ? side.cluster : exit_q;

  always_comb begin
    count = '0;
    for (int unsigned k = 0; k < PreprocLanes; k++) begin
      ahead[k] = 2'(count);
      count     = count + 3'(alive[k]);
    end
  end

  assign fill    = 4'(rank_q[InBeatBits-1:0]) + 4'(count);
  assign full    = Quarters'(fill >> InBeatBits);
  assign partial = side.last && fill[InBeatBits-1:0] != '0;

  // What a lane's survivor gets is known for each number of survivors before it; that number comes late, so a bit for each selects.
  logic [PreprocLanes-1:0][NUMBER_BITS-1:0] numbers;
  place_t [PreprocLanes-1:0]                places;
  logic [PreprocLanes-1:0][SEQ_BITS-1:0]    seqs;

  // first + rank / 16, and one more.
  logic [NUMBER_BITS-5:0] high_number, more_number;
  logic                   unused_carry;

  assign high_number                 = of.first + (NUMBER_BITS - 4)'(rank_q[8:4]);
  assign {more_number, unused_carry} = {of.first, 1'b1} + {(NUMBER_BITS - 4)'(rank_q[8:4]), 1'b1};

  for (genvar k = 0; k < PreprocLanes; k++) begin : gen_numbers
    logic [2:0] at;
    logic [4:0] low_number;
    assign at                = 3'(rank_q[InBeatBits-1:0]) + 3'(k);
    assign low_number        = 5'(rank_q[3:0]) + 5'(k);
    assign numbers[k]        = {low_number[4] ? more_number : high_number, low_number[3:0]};
    assign places[k].beat    = ring_q + PLACE_BEAT_BITS'(at >> InBeatBits);
    assign places[k].quarter = 2'(at[InBeatBits-1:0]) << (Quarters - 1);
    assign seqs[k]           = issued_q + SEQ_BITS'(k);
  end

  always_comb begin
    number = '0;
    place  = '0;
    seq    = '0;
    for (int unsigned k = 0; k < PreprocLanes; k++) begin
      for (int unsigned n = 0; n <= k; n++) begin
        number[k] |= numbers[n] & {NUMBER_BITS{ahead[k] == 2'(n)}};
        place[k]  |= places[n] & {$bits(place_t){ahead[k] == 2'(n)}};
        seq[k]    |= seqs[n] & {SEQ_BITS{ahead[k] == 2'(n)}};
      end
    end
  end

  // So many beats may be needed at most: those of a record a lane, the open one, and one that is told in this cycle.
  // Behind two full beats a third one may still have to be told.
  assign record_room  = taken_q <= (PLACE_BEAT_BITS + 1)'(RING - Most) &&
                        (Quarters == 1 || !left_q);
  assign go           = exit_valid && (&lane_ready) && record_room && store_room && colour_room;
  assign front_en     = !exit_valid || go;
  assign front_idle   = front_valid_q == '0 && !telling && !gone_q && rank_q == '0;
  // Groups end within a cluster where its geometry could not be read: the beat that it leaves open is told.
  assign cut          = ended_q && front_valid_q == '0 && !telling && !gone_q && rank_q != '0;

  assign turn_at           = 2'(PreprocLanes * (32'(side.group) % Turns));
  assign survivors.cluster = side.cluster;
  assign survivors.colour  = of.colour;
  assign survivors.stride  = of.stride;
  assign survivors.step    = of.step;
  assign survivors.degree  = of.degree;
  assign survivors.group   = 6'(side.group >> TurnShift);
  assign survivors.at      = turn_at;
  assign survivors.alive   = 4'({alive & ~there}) << turn_at;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      issued_q <= '0;
      rank_q   <= '0;
      ring_q   <= '0;
      taken_q  <= '0;
      exit_q   <= '0;
      gone_q   <= 1'b0;
    end else begin
      taken_q <= taken_q + (PLACE_BEAT_BITS + 1)'(told_full_q || told_partial_q) -
                 (PLACE_BEAT_BITS + 1)'(freed);
      gone_q  <= go || cut;
      if (start) begin
        exit_q <= '0;
      end else if (go) begin
        exit_q <= side.cluster;
      end
      // The next group comes two cycles after this one.
      if (gone_q) begin
        issued_q <= issued_q + SEQ_BITS'(count_q);
        rank_q   <= last_q ? '0 : rank_q + 9'(count_q);
        ring_q   <= ring_q + PLACE_BEAT_BITS'(told_full_q) + PLACE_BEAT_BITS'(more_q) +
                    PLACE_BEAT_BITS'(left_q);
      end
    end
  end

  // A full beat is told in the cycle after its group, a second one, or the one that a cluster leaves open, in the next, which is
  // before the next group; the open one behind two full ones a cycle later. Where they lie is added up on the way to the writer,
  // the lower half of the address first.
  localparam int unsigned LowBits = BEAT_BITS / 2;
  localparam int unsigned HighBits = BEAT_BITS - LowBits;
  localparam int unsigned OffsetBits = NUMBER_BITS - InBeatBits;

  logic [Quarters-1:0]           after_q;  // full beats that have been told of the group
  logic [InBeatBits-1:0]         fill_q;
  logic [19:0]                   first_q;
  logic [8-InBeatBits:0]         row_q;
  logic [2:0]                    tell_q;  // stages with a beat
  logic [2:0][3:0]               quarters_q;
  logic [OffsetBits-1:0]         offset_q;  // of a beat among those of records
  logic [LowBits:0]              low_q;
  logic [OffsetBits-1-LowBits:0] offset_high_q;
  logic [BEAT_BITS-1:0]          told_beat_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      told_full_q    <= 1'b0;
      more_q         <= 1'b0;
      second_q       <= 1'b0;
      left_q         <= 1'b0;
      told_partial_q <= 1'b0;
      tell_q         <= '0;
    end else begin
      told_full_q    <= (go && full != '0) || more_q;
      more_q         <= Quarters == 2 && go && full[Quarters-1];
      second_q       <= more_q;
      left_q         <= (go && partial) || (cut && rank_q[InBeatBits-1:0] != '0) ||
                        (left_q && more_q);
      told_partial_q <= left_q && !more_q;
      tell_q         <= {tell_q[1:0], told_full_q || told_partial_q};
    end
  end

  always_ff @(posedge clk_i) begin
    if (go || cut) begin
      fill_q  <= go ? fill[InBeatBits-1:0] : rank_q[InBeatBits-1:0];
      row_q   <= rank_q[8:InBeatBits];
      count_q <= go ? count : '0;
      last_q  <= cut || side.last;
    end
    if (go) begin
      first_q <= of.first;
    end
    after_q       <= Quarters'(told_full_q) + Quarters'(second_q);
    offset_q      <= {first_q, {4 - InBeatBits{1'b0}}} + OffsetBits'(row_q) +
                     OffsetBits'((told_partial_q || second_q) ? after_q : '0);
    low_q         <= {1'b0, registers_i.records_beat[LowBits-1:0]} + {1'b0, offset_q[LowBits-1:0]};
    offset_high_q <= offset_q[OffsetBits-1:LowBits];
    told_beat_q   <= {registers_i.records_beat[BEAT_BITS-1:LowBits] + HighBits'(offset_high_q) +
                      HighBits'(low_q[LowBits]), low_q[LowBits-1:0]};
    quarters_q    <= {quarters_q[1:0], told_partial_q
                      ? (4'd1 << (2'(fill_q) << (Quarters - 1))) - 4'd1 : 4'hf};
  end

  assign telling       = told_full_q || left_q || told_partial_q || tell_q != '0;
  assign beat_valid    = tell_q[2];
  assign told.beat     = told_beat_q;
  assign told.quarters = quarters_q[2];

  // ---- colours --------------------------------------------------------------------------------------

  logic         [PreprocLanes-1:0] made_valid, made_ready, part_valid, part_ready;
  colour_part_t [PreprocLanes-1:0] made, part;

  // Both read at one port: computed colours' data, and stored ones.
  logic    [1:0] shared_ar_valid, shared_ar_ready, shared_r_valid, shared_r_ready;
  axi_ax_t [1:0] shared_ar;

  flk_colour_fetch #(
    .Lanes      (PreprocLanes),
    .BufferBeats(112)
  ) i_colours (
    .clk_i,
    .rst_ni,
    .start_i    (start),
    .idle_o     (colour_idle),
    .chunked_i  (registers_i.lane.chunked),
    .colours_i  (registers_i.colours_beat),
    .error_o    (colour_error),
    .beats_o    (colour_beats),
    .in_valid_i (exit_valid && (&lane_ready) && record_room && store_room),
    .in_ready_o (colour_room),
    .in_data_i  (survivors),
    .exit_i     (exit),
    .oldest_o   (oldest),
    .out_valid_o(made_valid),
    .out_ready_i(made_ready),
    .out_data_o (made),
    .ar_valid_o (shared_ar_valid[0]),
    .ar_ready_i (shared_ar_ready[0]),
    .ar_o       (shared_ar[0]),
    .r_valid_i  (shared_r_valid[0]),
    .r_ready_o  (shared_r_ready[0]),
    .r_i        (r_i[FRONT_READ_COLOURS])
  );

  // ---- colours that are stored ----------------------------------------------------------------------

  logic                 store_error, keep_valid, keep_ready, keep_room;
  logic                 keep_record;
  store_entry_t [3:0]   kept_record;
  logic [PreprocLanes-1:0][7:0] record_opacity;
  logic [31:0]          store_beats;
  logic [BEAT_BITS-1:0] keep_beat;
  logic [Width-1:0]     keep_data;

  if (Keeps) begin : gen_store
    flk_colour_store #(
      .Lanes  (PreprocLanes),
      .Waiting(Waiting),
      .Id     (1)
    ) i_store (
      .clk_i,
      .rst_ni,
      .start_i       (start),
      .flush_i       (state_q != FRONT),
      .failing_i     (cull_error || cull_damaged || geometry_error || geometry_damaged ||
                      colour_error),
      .idle_o        (store_idle),
      .setup_i       (registers_i.store),
      .position_i    (registers_i.cull.position),
      .error_o       (store_error),
      .beats_o       (store_beats),
      .kept_valid_i  (cull_valid && !kept_end && kept_ready),
      .kept_ready_o  (store_kept),
      .kept_i        (kept_box),
      .ready_o       (store_room),
      .there_o       (there),
      .go_i          (go),
      .alive_i       (alive),
      .group_i       (6'(side.group >> TurnShift)),
      .at_i          (turn_at),
      .last_i        (side.last),
      .in_valid_i    (made_valid),
      .in_ready_o    (made_ready),
      .in_data_i     (made),
      .out_valid_o   (part_valid),
      .out_ready_i   (part_ready),
      .out_data_o    (part),
      .record_valid_i(keep_record),
      .record_ready_o(keep_room),
      .record_i      (kept_record),
      .line_valid_o  (keep_valid),
      .line_ready_i  (keep_ready),
      .line_beat_o   (keep_beat),
      .line_o        (keep_data),
      .ar_valid_o    (shared_ar_valid[1]),
      .ar_ready_i    (shared_ar_ready[1]),
      .ar_o          (shared_ar[1]),
      .r_valid_i     (shared_r_valid[1]),
      .r_ready_o     (shared_r_ready[1]),
      .r_i           (r_i[FRONT_READ_COLOURS])
    );

    flk_axi_read_mux #(
      .Managers(2)
    ) i_shared (
      .clk_i,
      .rst_ni,
      .ar_valid_i(shared_ar_valid),
      .ar_ready_o(shared_ar_ready),
      .ar_i      (shared_ar),
      .r_valid_o (shared_r_valid),
      .r_ready_i (shared_r_ready),
      .ar_valid_o(ar_valid_o[FRONT_READ_COLOURS]),
      .ar_ready_i(ar_ready_i[FRONT_READ_COLOURS]),
      .ar_o      (ar_o[FRONT_READ_COLOURS]),
      .r_valid_i (r_valid_i[FRONT_READ_COLOURS]),
      .r_ready_o (r_ready_o[FRONT_READ_COLOURS]),
      .r_id_i    (r_i[FRONT_READ_COLOURS].id)
    );
  end else begin : gen_no_store
    assign store_idle         = 1'b1;
    assign store_error        = 1'b0;
    assign store_beats        = '0;
    assign store_kept         = 1'b1;
    assign store_room         = 1'b1;
    assign there              = '0;
    assign part_valid         = made_valid;
    assign made_ready         = part_ready;
    assign part               = made;
    assign keep_room          = 1'b1;
    assign keep_valid         = 1'b0;
    assign keep_beat          = '0;
    assign keep_data          = '0;

    // One manager alone, whose identifier is 0.
    assign ar_valid_o[FRONT_READ_COLOURS] = shared_ar_valid[0];
    assign ar_o[FRONT_READ_COLOURS]       = shared_ar[0];
    assign r_ready_o[FRONT_READ_COLOURS]  = shared_r_ready[0];
    assign shared_ar_valid[1] = 1'b0;
    assign shared_ar[1]       = '0;
    assign shared_r_ready[1]  = 1'b0;
    assign shared_ar_ready    = {1'b0, ar_ready_i[FRONT_READ_COLOURS]};
    assign shared_r_valid     = {1'b0, r_valid_i[FRONT_READ_COLOURS]};

    logic unused_store;
    assign unused_store = ^{registers_i.store, kept_box, keep_record, kept_record, keep_ready,
                            record_opacity, shared_ar_valid[1], shared_ar_ready[1], shared_ar[1],
                            shared_r_valid[1], shared_r_ready[1]};
  end

  // ---- lanes ----------------------------------------------------------------------------------------

  logic   [PreprocLanes-1:0]               record_valid, record_ready, entry_valid, entry_ready;
  place_t [PreprocLanes-1:0]               record_place;
  logic   [PreprocLanes-1:0][RecordBits-1:0] record;
  entry_t [PreprocLanes-1:0]               entry;
  logic   [PreprocLanes-1:0][SEQ_BITS-1:0] progress;
  logic   [PreprocLanes-1:0]               saturated, clipped, faint, unlisted;

  for (genvar k = 0; k < PreprocLanes; k++) begin : gen_lanes
    flk_preprocessing_core #(
      .Form    (Form),
      .Interval(PreprocInterval),
      .Waiting (Waiting)
    ) i_core (
      .clk_i,
      .rst_ni,
      .setup_i       (registers_i.lane),
      .idle_o        (lane_idle[k]),
      .front_en_i    (front_en),
      .front_phase_i (front_phase_q),
      .words_i       (turn_word[k]),
      .scale_low_i   (group.header.scale_low),
      .scale_step_i  (group.header.scale_step),
      .low_i         (low),
      .step_i        (step),
      .near_o        (lane_near[k]),
      .outside_o     (lane_outside[k]),
      .push_i        (go && alive[k]),
      .ready_o       (lane_ready[k]),
      .seq_i         (seq[k]),
      .number_i      (number[k]),
      .place_i       (place[k]),
      .header_valid_i(enter && turn_first),
      .header_index_i(cluster[HeaderBits-1:0]),
      .header_i      (colour_header),
      .part_valid_i  (part_valid[k]),
      .part_ready_o  (part_ready[k]),
      .part_i        (part[k]),
      .record_valid_o(record_valid[k]),
      .record_ready_i(record_ready[k]),
      .record_place_o(record_place[k]),
      .record_opacity_o(record_opacity[k]),
      .record_o      (record[k]),
      .entry_valid_o (entry_valid[k]),
      .entry_ready_i (entry_ready[k]),
      .entry_o       (entry[k]),
      .issued_i      (issued_q),
      .progress_o    (progress[k]),
      .saturated_o   (saturated[k]),
      .clipped_o     (clipped[k]),
      .faint_o       (faint[k]),
      .unlisted_o    (unlisted[k])
    );
  end

  // ---- records --------------------------------------------------------------------------------------

  logic                 line_valid, line_ready;
  logic [BEAT_BITS-1:0] line_beat;
  logic [Width-1:0]     line_data;
  logic [3:0]           line_strobe;
  logic [Records-1:0][KeptBits-1:0] line_record;

  // Lanes that want the same quarter take turns; two records of each wait, so that no lane's colours stand for
  // another's record, nor for the time of that choice.
  logic   [PreprocLanes-1:0] queued_valid, queued_ready;
  place_t [PreprocLanes-1:0] queued_place;
  logic   [PreprocLanes-1:0][KeptBits-1:0] queued_record;

  for (genvar k = 0; k < PreprocLanes; k++) begin : gen_records
    logic       unused_full;
    logic [1:0] unused_usage;

    flk_fifo #(
      .Width($bits(place_t) + KeptBits),
      .Depth(2)
    ) i_queue (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (record_valid[k]),
      .in_ready_o (record_ready[k]),
      .in_data_i  ({record_place[k], KeptBits'({record_opacity[k], record[k]})}),
      .out_valid_o(queued_valid[k]),
      .out_ready_i(queued_ready[k]),
      .out_data_o ({queued_place[k], queued_record[k]}),
      .usage_o    (unused_usage),
      .full_o     (unused_full),
      .empty_o    (queued_empty[k])
    );
  end

  flk_record_writer #(
    .Lanes     (PreprocLanes),
    .RecordBits(KeptBits),
    .Quarters  (Quarters)
  ) i_records (
    .clk_i,
    .rst_ni,
    .idle_o      (records_idle),
    .in_valid_i  (queued_valid),
    .in_ready_o  (queued_ready),
    .in_place_i  (queued_place),
    .in_record_i (queued_record),
    .beat_valid_i(beat_valid),
    .beat_ready_o(beat_ready),
    .beat_data_i (told),
    .freed_o     (freed),
    .out_valid_o (line_valid),
    .out_ready_i (line_ready),
    .out_beat_o  (line_beat),
    .out_data_o  (line_record),
    .out_strobe_o(line_strobe)
  );

  for (genvar r = 0; r < Records; r++) begin : gen_line
    assign line_data[r*(Width/Records)+:Width/Records] =
        (Width / Records)'(line_record[r][RecordBits-1:0]);
  end

  // Colours of records that leave go to the store too.
  if (Keeps) begin : gen_kept
    for (genvar r = 0; r < 4; r++) begin : gen_record
      assign kept_record[r] = {line_record[r][RecordBits+:8], line_record[r][97+:30]};
    end
  end else begin : gen_none
    assign kept_record = '0;
  end

  // ---- lists ----------------------------------------------------------------------------------------

  logic [ListWriters-1:0]                   merged_valid, merged_ready, merged_end;
  logic [ListWriters-1:0][BankBits-1:0]     merged_bank;
  logic [ListWriters-1:0][6:0]              merged_u, merged_v;
  logic [ListWriters-1:0][NUMBER_BITS+27:0] merged;

  flk_entry_merge #(
    .Lanes  (PreprocLanes),
    .Writers(ListWriters),
    .Depth  (32)
  ) i_merge (
    .clk_i,
    .rst_ni,
    .start_i    (start),
    .end_i      (lists_end),
    .idle_o     (merge_idle),
    .in_valid_i (entry_valid),
    .in_ready_o (entry_ready),
    .in_data_i  (entry),
    .progress_i (progress),
    .out_valid_o(merged_valid),
    .out_ready_i(merged_ready),
    .out_end_o  (merged_end),
    .out_bank_o (merged_bank),
    .out_u_o    (merged_u),
    .out_v_o    (merged_v),
    .out_entry_o(merged)
  );

  typedef struct packed {
    logic [BEAT_BITS-1:0] beat;
    logic [3:0]           strobe;
    logic [Width-1:0]     data;
  } line_t;

  // Of records the last but one, of the colour store the last one.
  logic  [ListWriters+1:0]      out_valid, out_ready;
  line_t [ListWriters+1:0]      out;
  logic [ListWriters-1:0][31:0] list_entries, list_lines, list_evicted;
  logic [3:0][24:0]             list_taken;            // by bank
  logic [ListWriters-1:0]       unused_done;
  localparam int unsigned   LinesBits = $clog2(Lists / 16 + 1);
  localparam int unsigned   NumberBits = LinesBits - 1 + $clog2(Banks);  // of a line of pointers
  localparam int unsigned   MoveBits = 28;  // of a pointer

  // Lines of pointers that move
  logic [ListWriters-1:0]    move_valid, move_ready, move_put, move_get;
  logic [ListWriters-1:0]    move_read, move_write, move_done;
  logic [ListWriters-1:0][NumberBits-1:0] move_put_line, move_get_line;
  logic [3:0]                move_index;
  logic [ListWriters-1:0][MoveBits-1:0]  move_from;
  logic [MoveBits-1:0]       move_to;
  logic                      pointer_read_error, pointer_write_error;

  for (genvar b = 0; b < ListWriters; b++) begin : gen_lists
    logic [ListAddrBits-1:0] address;
    logic [Width-1:0]        data;
    logic [Banks-1:0][24:0]  taken;

    for (genvar k = 0; k < Banks; k++) begin : gen_taken
      assign list_taken[b+ListWriters*k] = taken[k];
    end

    flk_list_writer #(
      .Banks   (Banks),
      .Pointers(Pointers),
      .Lists   (Lists)
    ) i_list (
      .clk_i,
      .rst_ni,
      .start_i        (start),
      .idle_o         (list_idle[b]),
      .writer_i       (2'(b)),
      .columns_i      (registers_i.list_columns),
      .pointer_lines_i(LinesBits'(registers_i.pointer_lines)),
      .chunks_i       (registers_i.chunks),
      .list_base_i    (registers_i.lists_beat),
      .pointer_base_i (registers_i.pointers_beat),
      .done_o         (unused_done[b]),
      .failed_o       (list_failed[b]),
      .entries_o      (list_entries[b]),
      .lines_o        (list_lines[b]),
      .evicted_o      (list_evicted[b]),
      .taken_o        (taken),
      .in_valid_i     (merged_valid[b]),
      .in_ready_o     (merged_ready[b]),
      .in_end_i       (merged_end[b]),
      .in_bank_i      (merged_bank[b]),
      .in_u_i         (merged_u[b]),
      .in_v_i         (merged_v[b]),
      .in_entry_i     (merged[b]),
      .out_valid_o    (out_valid[b]),
      .out_ready_i    (out_ready[b]),
      .out_address_o  (address),
      .out_data_o     (data),
      .move_valid_o   (move_valid[b]),
      .move_ready_i   (move_ready[b]),
      .move_put_o     (move_put[b]),
      .move_put_line_o(move_put_line[b]),
      .move_get_o     (move_get[b]),
      .move_get_line_o(move_get_line[b]),
      .move_index_i   (move_index),
      .move_read_i    (move_read[b]),
      .move_pointer_o (move_from[b]),
      .move_write_i   (move_write[b]),
      .move_pointer_i (move_to),
      .move_done_i    (move_done[b])
    );
    assign out[b] = {address, 4'hf, data};
  end

  logic [31:0] pointer_lines_spilled, pointer_lines_fetched;

  flk_pointer_port #(
    .Writers   (ListWriters),
    .NumberBits(NumberBits),
    .MoveBits  (MoveBits)
  ) i_pointers (
    .clk_i,
    .rst_ni,
    .start_i      (start),
    .base_i       (registers_i.pointers_beat),
    .read_error_o (pointer_read_error),
    .write_error_o(pointer_write_error),
    .put_o        (pointer_lines_spilled),
    .got_o        (pointer_lines_fetched),
    .in_valid_i   (move_valid),
    .in_ready_o   (move_ready),
    .in_put_i     (move_put),
    .in_put_line_i(move_put_line),
    .in_get_i     (move_get),
    .in_get_line_i(move_get_line),
    .index_o      (move_index),
    .read_o       (move_read),
    .in_pointer_i (move_from),
    .write_o      (move_write),
    .pointer_o    (move_to),
    .done_o       (move_done),
    .ar_valid_o   (ar_valid_o[FRONT_READ_POINTERS]),
    .ar_ready_i   (ar_ready_i[FRONT_READ_POINTERS]),
    .ar_o         (ar_o[FRONT_READ_POINTERS]),
    .r_valid_i    (r_valid_i[FRONT_READ_POINTERS]),
    .r_ready_o    (r_ready_o[FRONT_READ_POINTERS]),
    .r_i          (r_i[FRONT_READ_POINTERS]),
    .aw_valid_o   (aw_valid_o[FRONT_WRITE_POINTERS]),
    .aw_ready_i   (aw_ready_i[FRONT_WRITE_POINTERS]),
    .aw_o         (aw_o[FRONT_WRITE_POINTERS]),
    .w_valid_o    (w_valid_o[FRONT_WRITE_POINTERS]),
    .w_ready_i    (w_ready_i[FRONT_WRITE_POINTERS]),
    .w_o          (w_o[FRONT_WRITE_POINTERS]),
    .b_valid_i    (b_valid_i[FRONT_WRITE_POINTERS]),
    .b_ready_o    (b_ready_o[FRONT_WRITE_POINTERS]),
    .b_i          (b_i[FRONT_WRITE_POINTERS])
  );

  assign out_valid[ListWriters]   = line_valid && keep_room;
  assign line_ready               = out_ready[ListWriters] && keep_room;
  assign keep_record              = line_valid && out_ready[ListWriters];
  assign out[ListWriters]         = {line_beat, line_strobe, line_data};
  assign out_valid[ListWriters+1] = keep_valid;
  assign keep_ready               = out_ready[ListWriters+1];
  assign out[ListWriters+1]       = {keep_beat, 4'hf, keep_data};

  // ---- writes ---------------------------------------------------------------------------------------

  logic       chosen_valid, chosen_ready, lines_empty, write_failed;
  line_t      chosen;
  logic [$clog2(ListWriters+2)-1:0] unused_index;

  flk_stream_arbiter #(
    .Inputs(ListWriters + 2),
    .Width ($bits(line_t))
  ) i_arbiter (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (out_valid),
    .in_ready_o (out_ready),
    .in_data_i  (out),
    .out_valid_o(chosen_valid),
    .out_ready_i(chosen_ready),
    .out_data_o (chosen),
    .out_index_o(unused_index)
  );

  logic unused_answered;

  assign arbiter_empty = !chosen_valid && lines_empty;

  flk_line_writer #(
    .Gather  (Gather),
    .Bursts  (256),
    .BeatBits(BEAT_BITS),
    .IdBits  (AXI_ID_BITS)
  ) i_write (
    .clk_i,
    .rst_ni,
    .empty_o    (lines_empty),
    .idle_o     (write_idle),
    .flush_i    (lists_end),
    .answered_o (unused_answered),
    .failed_o   (write_failed),
    .in_valid_i (chosen_valid),
    .in_ready_o (chosen_ready),
    .in_beat_i  (chosen.beat),
    .in_strobe_i(chosen.strobe),
    .in_data_i  (chosen.data),
    .aw_valid_o (aw_valid_o[FRONT_WRITE_LINES]),
    .aw_ready_i (aw_ready_i[FRONT_WRITE_LINES]),
    .aw_id_o    (aw_o[FRONT_WRITE_LINES].id),
    .aw_addr_o  (aw_o[FRONT_WRITE_LINES].addr),
    .aw_len_o   (aw_o[FRONT_WRITE_LINES].len),
    .aw_size_o  (aw_o[FRONT_WRITE_LINES].size),
    .aw_burst_o (aw_o[FRONT_WRITE_LINES].burst),
    .w_valid_o  (w_valid_o[FRONT_WRITE_LINES]),
    .w_ready_i  (w_ready_i[FRONT_WRITE_LINES]),
    .w_data_o   (w_o[FRONT_WRITE_LINES].data),
    .w_strb_o   (w_o[FRONT_WRITE_LINES].strb),
    .w_last_o   (w_o[FRONT_WRITE_LINES].last),
    .b_valid_i  (b_valid_i[FRONT_WRITE_LINES]),
    .b_ready_o  (b_ready_o[FRONT_WRITE_LINES]),
    .b_id_i     (b_i[FRONT_WRITE_LINES].id),
    .b_resp_i   (b_i[FRONT_WRITE_LINES].resp)
  );

  // ---- errors and counters --------------------------------------------------------------------------

  logic                               write_error_q;
  logic [31:0]                        cycles_q;
  logic [FRONT_EVENTS-1:0][LANES-1:0] events;  // by lane or list writer
  logic [FRONT_EVENTS-1:0][31:0]      totals;

  // What happens is counted a few cycles later; after a frame's last event comes the end of its lists, of its last wait that of its
  // writes.
  assign events[FRONT_EVENT_TOO_NEAR]      = LANES'({side.used & lane_near & {PreprocLanes{go}}});
  assign events[FRONT_EVENT_OUTSIDE]       =
      LANES'({side.used & ~lane_near & lane_outside & {PreprocLanes{go}}});
  assign events[FRONT_EVENT_SURVIVORS]     = LANES'({alive & {PreprocLanes{go}}});
  assign events[FRONT_EVENT_SATURATED]     = LANES'(saturated);
  assign events[FRONT_EVENT_CLIPPED]       = LANES'(clipped);
  assign events[FRONT_EVENT_FAINT]         = LANES'(faint);
  assign events[FRONT_EVENT_UNLISTED]      = LANES'(unlisted);
  assign events[FRONT_EVENT_RECORD_BEATS]  = LANES'(line_valid && line_ready);
  assign events[FRONT_EVENT_STORE_LINES]   = LANES'(keep_valid && keep_ready);

  // Waits: where a projected group has several reasons, the first one. What comes late in its cycle is looked at in the next.
  logic             front_q, group_valid_q, exit_valid_q, places_q, colours_q;
  logic [1:0]       kept_q, line_q;  // ready above valid
  logic [PreprocLanes-1:0] lanes_q;
  logic [PreprocLanes-1:0] part_q, part_ready_q, record_q, record_ready_q, entry_q, entry_ready_q;
  logic [ListWriters-1:0]  merged_q, merged_ready_q, out_q, out_ready_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      front_q      <= 1'b0;
      exit_valid_q <= 1'b0;
      kept_q       <= '0;
      line_q       <= '0;
      part_q       <= '0;
      record_q     <= '0;
      entry_q      <= '0;
      merged_q     <= '0;
      out_q        <= '0;
    end else begin
      front_q      <= state_q == FRONT && !ended_q && front_phase_q == '0;
      exit_valid_q <= exit_valid;
      kept_q       <= {kept_ready, kept_valid};
      line_q       <= {line_ready, line_valid};
      part_q       <= part_valid;
      record_q     <= record_valid;
      entry_q      <= entry_valid;
      merged_q     <= merged_valid;
      out_q        <= out_valid[ListWriters-1:0];
    end
  end

  always_ff @(posedge clk_i) begin
    group_valid_q  <= group_valid;
    lanes_q        <= lane_ready;
    places_q       <= record_room;
    colours_q      <= colour_room && store_room;
    part_ready_q   <= part_ready;
    record_ready_q <= record_ready;
    entry_ready_q  <= entry_ready;
    merged_ready_q <= merged_ready;
    out_ready_q    <= out_ready[ListWriters-1:0];
  end

  logic went;  // nothing waited at the end of the projection

  assign went = !exit_valid_q || ((&lanes_q) && places_q && colours_q);
  assign events[FRONT_EVENT_CLUSTER_WAITS] = LANES'(kept_q == 2'b01);
  assign events[FRONT_EVENT_GROUP_MISSING] = LANES'(front_q && went && !group_valid_q);
  assign events[FRONT_EVENT_LANE_WAITS]    = LANES'(exit_valid_q && !(&lanes_q));
  assign events[FRONT_EVENT_PLACE_WAITS]   = LANES'(exit_valid_q && (&lanes_q) && !places_q);
  assign events[FRONT_EVENT_REQUEST_WAITS] =
      LANES'(exit_valid_q && (&lanes_q) && places_q && !colours_q);
  assign events[FRONT_EVENT_COLOUR_WAITS]  = LANES'({part_q & ~part_ready_q});
  assign events[FRONT_EVENT_RECORD_WAITS]  = LANES'({record_q & ~record_ready_q});
  assign events[FRONT_EVENT_ENTRY_WAITS]   = LANES'({entry_q & ~entry_ready_q});
  assign events[FRONT_EVENT_MERGED_WAITS]  = LANES'({merged_q & ~merged_ready_q});
  assign events[FRONT_EVENT_LINE_WAITS]    = LANES'({out_q & ~out_ready_q});
  assign events[FRONT_EVENT_BEAT_WAITS]    = LANES'(line_q == 2'b01);

  flk_event_counters #(
    .Counters(FRONT_EVENTS),
    .Sources (LANES)
  ) i_counters (
    .clk_i,
    .rst_ni,
    .clear_i (start),
    .events_i(events),
    .values_o(totals)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_error_q <= 1'b0;
      cycles_q      <= '0;
    end else if (start) begin
      write_error_q <= 1'b0;
      cycles_q      <= '0;
    end else if (state_q != IDLE) begin
      write_error_q <= write_error_q || write_failed;
      cycles_q[7:0] <= cycles_q[7:0] + 1'b1;
      if (&cycles_q[7:0]) begin
        cycles_q[31:8] <= cycles_q[31:8] + 1'b1;
      end
    end
  end

  always_comb begin
    counters_o                  = front_events(totals);
    counters_o.cycles           = cycles_q;
    counters_o.culled_clusters  = culled_clusters;
    counters_o.culled_gaussians = culled_gaussians;
    counters_o.header_beats     = header_beats;
    counters_o.geometry_beats   = geometry_beats;
    counters_o.colour_beats     = colour_beats;
    counters_o.store_beats      = store_beats;
    counters_o.entries          = 128'(list_entries);
    counters_o.lines            = 128'(list_lines);
    counters_o.evicted          = 128'(list_evicted);
    counters_o.taken            = list_taken;
    counters_o.spilled          = pointer_lines_spilled;
    counters_o.fetched          = pointer_lines_fetched;
  end

  assign error_o = {geometry_damaged, cull_damaged, |list_failed, beyond_q,
                    write_error_q || pointer_write_error,
                    cull_error || geometry_error || colour_error || store_error ||
                    pointer_read_error};

  logic unused;
  assign unused = ^{cull_idle, geometry_idle, group.cluster.index, beat_ready,
                    unused_cull_done, unused_geometry_done, unused_done, unused_index,
                    fill[3]};

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o)
  else $error("flk_preprocessing: start while a frame is under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni) beat_valid |-> beat_ready)
  else $error("flk_preprocessing: a beat of records without a place");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      gone_q |-> !go && !told_partial_q)
  else $error("flk_preprocessing: a group in the cycle after another");
`endif

endmodule
