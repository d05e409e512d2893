// Geometry fetch: headers and geometry of kept clusters from memory (docs/reference/memory_image.md), as
// groups of four Gaussians with what the lanes take of the header (docs/reference/front_end.md).
//
// A frame: start_i while idle_o; then kept clusters and an element with in_end_i, which carries
// none; the groups come in order, then an element with out_end_o. done_o is high for a cycle when
// that has been taken. chunked_i, position_i (of the camera), headers_i and geometry_i (beats where
// the arrays begin) stay from start_i to done_o; the counts of beats until the next start.
// An error of the memory: error_o rises and stays until the next start, no group is added, what is
// under way is read and dropped, clusters are taken and dropped up to the one with in_end_i, an
// end element follows. A float of a header with exponent code 255, which no packed scene has: the
// same, with damaged_o. Words of Gaussians that do not exist mean nothing. Floats of a header with
// exponent code 0 count as 0.
// cluster_o: of the table, whose groups leave next; 0 while there is none.
//
// For each cluster its header and those beats of its geometry that hold Gaussians are read. Headers
// and geometry wait in memories of their own, Clusters headers and BufferBeats beats of geometry;
// requests are held back to free places, so that the port never waits. The next cluster's header is
// ready behind flk_cluster_header, stopped with it at its output, when the present one's last group
// leaves. Throughput: four groups in four cycles (chunked_i) or five, while BufferBeats beats hide
// the latency; a cluster takes at least five cycles. Combinational: out_ready_i to the read enable
// of the buffer, r_valid_i and r_i to its write port, ar_ready_i to the requests.
module flk_geometry_fetch
  import flk_axi_pkg::*;
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned BufferBeats = 96,
  parameter  int unsigned Clusters    = 8,   // under way
  parameter  int unsigned MaxBeats    = 8,   // of a burst
  parameter  int unsigned Bursts      = 32,  // under way
  parameter  int unsigned Id          = 0,
  localparam int unsigned Width       = AXI_DATA_BITS
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  // Frame
  input  logic                 start_i,
  output logic                 idle_o,
  input  logic                 chunked_i,
  input  cluster_t [2:0]       position_i,
  input  logic [BEAT_BITS-1:0] headers_i,
  input  logic [BEAT_BITS-1:0] geometry_i,
  output logic                 done_o,
  output logic                 error_o,
  output logic                 damaged_o,
  output logic [31:0]          header_beats_o,
  output logic [31:0]          geometry_beats_o,
  output logic [23:0]          cluster_o,
  // Kept clusters
  input  logic                 in_valid_i,
  output logic                 in_ready_o,
  input  logic                 in_end_i,
  input  kept_t                in_cluster_i,
  // Groups
  output logic                 out_valid_o,
  input  logic                 out_ready_i,
  output logic                 out_end_o,
  output group_t               out_group_o,
  // AXI4
  output logic                 ar_valid_o,
  input  logic                 ar_ready_i,
  output axi_ax_t              ar_o,
  input  logic                 r_valid_i,
  output logic                 r_ready_o,
  input  axi_r_t               r_i
);

  localparam cluster_t ONE = 32'h3F80_0000;

  // ---- frame ----------------------------------------------------------------------------------------

  typedef enum logic [1:0] {IDLE, RUN, FAILED, LEAVE} state_e;

  state_e state_d, state_q;
  logic   start, fails, unread, end_taken_q, end_moves, fetch_idle, out_free;
  logic   out_valid_q, out_end_q, done_q, error_q, damaged_q, not_finite_q;

  assign start = state_q == IDLE && start_i;

  always_comb begin
    state_d = state_q;
    unique case (state_q)
      IDLE: begin
        if (start_i) begin
          state_d = RUN;
        end
      end
      RUN: begin
        if (fails) begin
          state_d = FAILED;
        end else if (end_moves) begin
          state_d = LEAVE;
        end
      end
      FAILED: begin
        if (end_moves) begin
          state_d = LEAVE;
        end
      end
      LEAVE: begin
        if (out_ready_i) begin
          state_d = IDLE;
        end
      end
      default: state_d = IDLE;
    endcase
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q   <= IDLE;
      error_q   <= 1'b0;
      damaged_q <= 1'b0;
      done_q    <= 1'b0;
    end else begin
      state_q   <= state_d;
      error_q   <= !start && (error_q || unread);
      damaged_q <= !start && (damaged_q || not_finite_q);
      done_q    <= state_q == LEAVE && out_ready_i;
    end
  end

  // ---- requests -------------------------------------------------------------------------------------

  // Of a cluster first its header, then its geometry; before that two cycles for the addresses, their
  // lower halves and their upper ones. The next cluster is taken while geometry is being asked for.
  localparam int unsigned LowBits = BEAT_BITS / 2;
  localparam int unsigned HighBits = BEAT_BITS - LowBits;

  logic                 queue_room, request_q, second_q, request_ready, take, hold;
  logic [1:0]           sum_q;
  logic [23:0]          index_q;
  logic [22:0]          offset_q;  // beats
  logic [6:0]           beats_d, beats_q, request_beats_q;
  logic [3:0]           unused_part;  // 16ths of a beat
  logic [22:0]          first_more;
  logic [10:0]          last_more;
  logic [BEAT_BITS-1:0] header_at, header_beat_q, geometry_at, geometry_beat_q;
  logic                 header_carry_q, geometry_carry_q;

  assign in_ready_o = (state_q == RUN || state_q == FAILED) && !end_taken_q &&
                      (state_q == FAILED ||
                       (queue_room && sum_q == '0 && (!request_q || second_q)));
  assign take = in_valid_i && in_ready_o;
  assign hold = request_q && !request_ready;

  // A Gaussian is 3 or 5 words of a beat's 16, and 16 slots are as many beats.
  assign first_more = chunked_i ? 23'(in_cluster_i.first) << 1 : 23'(in_cluster_i.first) << 2;
  assign last_more  = chunked_i ? 11'(in_cluster_i.last) << 1 : 11'(in_cluster_i.last) << 2;
  assign {beats_d, unused_part} = 11'(in_cluster_i.last) + last_more +
                                  (chunked_i ? 11'd18 : 11'd20);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      end_taken_q <= 1'b0;
      sum_q       <= '0;
      request_q   <= 1'b0;
      second_q    <= 1'b0;
    end else begin
      end_taken_q <= !start && (end_taken_q || (take && in_end_i));
      sum_q       <= {sum_q[0] && !hold, (take && !in_end_i) || (sum_q[0] && hold)};
      if (state_q == FAILED) begin
        sum_q     <= '0;
        request_q <= 1'b0;
        second_q  <= 1'b0;
      end else if (sum_q[1]) begin
        request_q <= 1'b1;
      end else if (request_q && request_ready) begin
        request_q <= !second_q;
        second_q  <= !second_q;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (take) begin
      index_q  <= in_cluster_i.index;
      offset_q <= 23'(in_cluster_i.first) + first_more;
      beats_q  <= beats_d;
    end
  end

  assign header_at   = chunked_i ? BEAT_BITS'(index_q) << 1 : BEAT_BITS'(index_q);
  assign geometry_at = BEAT_BITS'(offset_q);

  always_ff @(posedge clk_i) begin
    if (sum_q[0] && !hold) begin
      {header_carry_q, header_beat_q[LowBits-1:0]} <=
          {1'b0, headers_i[LowBits-1:0]} + {1'b0, header_at[LowBits-1:0]};
      {geometry_carry_q, geometry_beat_q[LowBits-1:0]} <=
          {1'b0, geometry_i[LowBits-1:0]} + {1'b0, geometry_at[LowBits-1:0]};
    end
    if (sum_q[1]) begin
      request_beats_q                      <= beats_q;
      header_beat_q[BEAT_BITS-1:LowBits]   <= headers_i[BEAT_BITS-1:LowBits] +
          header_at[BEAT_BITS-1:LowBits] + HighBits'(header_carry_q);
      geometry_beat_q[BEAT_BITS-1:LowBits] <= geometry_i[BEAT_BITS-1:LowBits] +
          geometry_at[BEAT_BITS-1:LowBits] + HighBits'(geometry_carry_q);
    end
  end

  logic             beat_valid, beat_is_header, beat_error;
  logic [Width-1:0] beat_data;
  logic             line_valid, line_pop, freed_q;

  flk_axi_fetch #(
    .Places  (BufferBeats),
    .AddrBits(AXI_ADDR_BITS),
    .BeatBits(7),
    .Width   (Width),
    .MaxBeats(MaxBeats),
    .Bursts  (Bursts),
    .IdBits  (AXI_ID_BITS),
    .Id      (Id)
  ) i_fetch (
    .clk_i,
    .rst_ni,
    .stop_i     (state_q == FAILED),
    .idle_o     (fetch_idle),
    .in_valid_i (request_q),
    .in_ready_o (request_ready),
    .in_beat_i  (second_q ? geometry_beat_q : header_beat_q),
    .in_beats_i (second_q ? request_beats_q : chunked_i ? 7'd2 : 7'd1),
    .in_tag_i   (!second_q),
    .in_placed_i(!second_q),  // as many headers as clusters under way
    .freed_i    (freed_q),
    .out_valid_o(beat_valid),
    .out_data_o (beat_data),
    .out_tag_o  (beat_is_header),
    .out_error_o(beat_error),
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o    (ar_o.id),
    .ar_addr_o  (ar_o.addr),
    .ar_len_o   (ar_o.len),
    .ar_size_o  (ar_o.size),
    .ar_burst_o (ar_o.burst),
    .r_valid_i,
    .r_ready_o,
    .r_id_i     (r_i.id),
    .r_data_i   (r_i.data),
    .r_resp_i   (r_i.resp),
    .r_last_i   (r_i.last)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      freed_q <= 1'b0;
    end else begin
      freed_q <= line_valid && line_pop && state_q != FAILED;
    end
  end

  logic header_beat_comes, geometry_beat_comes;

  assign unread              = beat_valid && beat_error;
  assign fails               = unread || not_finite_q;
  assign header_beat_comes   = beat_valid && beat_is_header;
  assign geometry_beat_comes = beat_valid && !beat_is_header;

  // ---- clusters under way ---------------------------------------------------------------------------

  logic  queue_valid, queue_end, queue_pop, unused_full, unused_empty;
  logic [$clog2(Clusters+1)-1:0] unused_usage;
  kept_t cluster;

  flk_fifo #(
    .Width(1 + $bits(kept_t)),
    .Depth(Clusters)
  ) i_clusters (
    .clk_i,
    .rst_ni,
    .clear_i    (state_q == FAILED),
    .in_valid_i (take),
    .in_ready_o (queue_room),
    .in_data_i  ({in_end_i, in_cluster_i}),
    .out_valid_o(queue_valid),
    .out_ready_i(queue_pop),
    .out_data_o ({queue_end, cluster}),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (unused_empty)
  );

  // ---- headers --------------------------------------------------------------------------------------

  // What the first beat says, and the second; in FP16 there is but one, and of it the origin.
  typedef struct packed {
    logic [31:0]    colour;
    logic [8:0]     sh_zero;
    cluster_t [2:0] origin;
    cluster_t [2:0] step;
    cluster_t [2:0] scale_low;
    cluster_t [2:0] scale_step;
  } shape_header_t;

  typedef struct packed {
    cluster_t [2:0]      dc_low;
    cluster_t [2:0]      dc_step;
    cluster_t [2:0][2:0] sh_step;
  } colour_header_t;

  function automatic cluster_t number(logic [31:0] float);
    return float[30:23] == '0 ? '0 : float;
  endfunction

  logic [15:0][31:0] word;
  logic              later_q;  // the next beat is a header's second
  shape_header_t     shape_in, shape;
  colour_header_t    colour_in, colour;
  logic              shape_valid, colour_valid, unused_shape_room, unused_colour_room;
  logic              header_take;

  assign word = beat_data;

  // Words that are floats: of the first beat all but the fourth of each four, of FP16 the first three;
  // of the second beat all but the fourth.
  logic [15:0] not_finite;

  always_comb begin
    for (int unsigned k = 0; k < 16; k++) begin
      not_finite[k] = &word[k][30:23] && (later_q ? k != 3 : k % 4 != 3 && (k < 3 || chunked_i));
    end
  end

  // Seen while the header goes into its registers: no group of the cluster has left.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      not_finite_q <= 1'b0;
    end else begin
      not_finite_q <= header_beat_comes && !beat_error && state_q == RUN && not_finite != '0;
    end
  end

  always_comb begin
    shape_in.colour  = word[3];
    shape_in.sh_zero = chunked_i ? word[7][8:0] : '0;
    for (int unsigned k = 0; k < 3; k++) begin
      shape_in.origin[k]     = number(word[k]);
      shape_in.step[k]       = chunked_i ? number(word[4+k]) : ONE;
      shape_in.scale_low[k]  = chunked_i ? number(word[8+k]) : '0;
      shape_in.scale_step[k] = chunked_i ? number(word[12+k]) : '0;
      colour_in.dc_low[k]    = chunked_i ? number(word[k]) : '0;
      colour_in.dc_step[k]   = chunked_i ? number(word[4+k]) : '0;
      for (int unsigned d = 0; d < 3; d++) begin
        colour_in.sh_step[d][k] = chunked_i ? number(word[7+3*d+k]) : ONE;
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      later_q <= 1'b0;
    end else if (start) begin
      later_q <= 1'b0;
    end else if (header_beat_comes) begin
      later_q <= chunked_i && !later_q;
    end
  end

  logic [2:0] unused_fifo_empty;

  flk_sram_fifo #(
    .Width($bits(shape_header_t)),
    .Depth(Clusters)
  ) i_shape_headers (
    .clk_i,
    .rst_ni,
    .clear_i    (state_q == FAILED),
    .in_valid_i (header_beat_comes && !later_q),
    .in_ready_o (unused_shape_room),
    .in_data_i  (shape_in),
    .out_valid_o(shape_valid),
    .out_ready_i(header_take),
    .out_data_o (shape),
    .empty_o    (unused_fifo_empty[0])
  );

  flk_sram_fifo #(
    .Width($bits(colour_header_t)),
    .Depth(Clusters)
  ) i_colour_headers (
    .clk_i,
    .rst_ni,
    .clear_i    (state_q == FAILED),
    .in_valid_i (header_beat_comes && (later_q || !chunked_i)),
    .in_ready_o (unused_colour_room),
    .in_data_i  (colour_in),
    .out_valid_o(colour_valid),
    .out_ready_i(header_take),
    .out_data_o (colour),
    .empty_o    (unused_fifo_empty[1])
  );

  // Steps of colours are narrowed before they meet a register: they stand in one behind the memory.
  logic                steps_valid_q;
  cluster_t [2:0]      dc_step_q;
  cluster_t [2:0][2:0] sh_step_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      steps_valid_q <= 1'b0;
    end else begin
      steps_valid_q <= colour_valid && !header_take && state_q != FAILED;
    end
  end

  always_ff @(posedge clk_i) begin
    if (colour_valid && !steps_valid_q) begin
      dc_step_q <= colour.dc_step;
      sh_step_q <= colour.sh_step;
    end
  end

  // Headers go through while they can; one at the output stops all until it is used.

  localparam int unsigned Interval = 4;  // of flk_cluster_header
  localparam int unsigned Inside = (CLUSTER_HEADER_LATENCY + Interval - 1) / Interval;
  localparam logic [1:0] OUT_PHASE = 2'(CLUSTER_HEADER_LATENCY % Interval);

  logic              move, at_output, header_ready, header_use, used_q;
  logic [1:0]        phase_q;
  logic [Inside-1:0] inside_q;  // there is a header, the youngest lowest
  header_t           header;

  assign at_output    = phase_q == OUT_PHASE && inside_q[Inside-1];
  assign header_ready = at_output && !used_q;
  assign move         = !header_ready && (phase_q != '0 || inside_q != '0 ||
                                          (shape_valid && steps_valid_q));
  assign header_take  = move && phase_q == '0 && shape_valid && steps_valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      phase_q  <= '0;
      inside_q <= '0;
      used_q   <= 1'b0;
    end else begin
      if (move) begin
        phase_q <= phase_q + 1'b1;
      end
      if (state_q == FAILED) begin
        inside_q <= '0;
      end else if (move && phase_q == '0) begin
        inside_q <= {inside_q[Inside-2:0], header_take};
      end
      used_q <= header_use || (used_q && !move && state_q != FAILED);
    end
  end

  flk_delay #(
    .Width(41),
    .Depth(Inside)
  ) i_colour_place (
    .clk_i,
    .en_i(move && phase_q == '0),
    .d_i ({shape.colour, shape.sh_zero}),
    .q_o ({header.colour, header.sh_zero})
  );

  flk_cluster_header i_header (
    .clk_i,
    .en_i          (move),
    .phase_i       (phase_q),
    .origin_0_i    (shape.origin[0]),
    .origin_1_i    (shape.origin[1]),
    .origin_2_i    (shape.origin[2]),
    .step_0_i      (shape.step[0]),
    .step_1_i      (shape.step[1]),
    .step_2_i      (shape.step[2]),
    .position_0_i  (position_i[0]),
    .position_1_i  (position_i[1]),
    .position_2_i  (position_i[2]),
    .scale_low_0_i (shape.scale_low[0]),
    .scale_low_1_i (shape.scale_low[1]),
    .scale_low_2_i (shape.scale_low[2]),
    .scale_step_0_i(shape.scale_step[0]),
    .scale_step_1_i(shape.scale_step[1]),
    .scale_step_2_i(shape.scale_step[2]),
    .dc_low_0_i    (colour.dc_low[0]),
    .dc_low_1_i    (colour.dc_low[1]),
    .dc_low_2_i    (colour.dc_low[2]),
    .dc_step_0_i   (dc_step_q[0]),
    .dc_step_1_i   (dc_step_q[1]),
    .dc_step_2_i   (dc_step_q[2]),
    .sh_step_00_i  (sh_step_q[0][0]),
    .sh_step_01_i  (sh_step_q[0][1]),
    .sh_step_02_i  (sh_step_q[0][2]),
    .sh_step_10_i  (sh_step_q[1][0]),
    .sh_step_11_i  (sh_step_q[1][1]),
    .sh_step_12_i  (sh_step_q[1][2]),
    .sh_step_20_i  (sh_step_q[2][0]),
    .sh_step_21_i  (sh_step_q[2][1]),
    .sh_step_22_i  (sh_step_q[2][2]),
    .low_0_o       (header.low[0]),
    .step_0_o      (header.step[0]),
    .scale_low_0_o (header.scale_low[0]),
    .scale_step_0_o(header.scale_step[0]),
    .dc_low_0_o    (header.dc_low[0]),
    .dc_step_0_o   (header.dc_step[0]),
    .sh_step_00_o  (header.sh_step[0][0]),
    .sh_step_10_o  (header.sh_step[1][0]),
    .sh_step_20_o  (header.sh_step[2][0]),
    .low_1_o       (header.low[1]),
    .step_1_o      (header.step[1]),
    .scale_low_1_o (header.scale_low[1]),
    .scale_step_1_o(header.scale_step[1]),
    .dc_low_1_o    (header.dc_low[1]),
    .dc_step_1_o   (header.dc_step[1]),
    .sh_step_01_o  (header.sh_step[0][1]),
    .sh_step_11_o  (header.sh_step[1][1]),
    .sh_step_21_o  (header.sh_step[2][1]),
    .low_2_o       (header.low[2]),
    .step_2_o      (header.step[2]),
    .scale_low_2_o (header.scale_low[2]),
    .scale_step_2_o(header.scale_step[2]),
    .dc_low_2_o    (header.dc_low[2]),
    .dc_step_2_o   (header.dc_step[2]),
    .sh_step_02_o  (header.sh_step[0][2]),
    .sh_step_12_o  (header.sh_step[1][2]),
    .sh_step_22_o  (header.sh_step[2][2])
  );

  // ---- geometry: beats of 64 bytes to groups of 48 or 80 ---------------------------------------------

  // In quarters of a beat. The window is the last beat from the buffer, of which at_q quarters
  // are used up, and above it the next one.
  localparam int unsigned Quarter = Width / 4;

  logic                      unused_line_room, groups, last, from_hold, beyond, early, emit;
  logic [Width-1:0]          line, hold_q;
  logic [2:0]                at_d, at_q, need;
  logic [3:0]                reach;
  logic [5:0]                group_q;
  logic [1:0]                over;  // Gaussians of the group but one
  logic [19:0][31:0]         group_words;
  logic [3:0][4:0][31:0]     words;

  flk_sram_fifo #(
    .Width(Width),
    .Depth(BufferBeats)
  ) i_geometry (
    .clk_i,
    .rst_ni,
    .clear_i    (state_q == FAILED),
    .in_valid_i (geometry_beat_comes),
    .in_ready_o (unused_line_room),
    .in_data_i  (beat_data),
    .out_valid_o(line_valid),
    .out_ready_i(line_pop),
    .out_data_o (line),
    .empty_o    (unused_fifo_empty[2])
  );

  assign groups    = state_q == RUN && queue_valid && !queue_end;
  assign cluster_o = groups ? cluster.index : '0;
  assign last      = group_q == cluster.last[7:2];
  assign over      = last ? cluster.last[1:0] : 2'd3;

  always_comb begin
    need = 3'(over) + 3'd2;  // 20 bytes each
    if (chunked_i && over != 2'd3) begin
      need = 3'(over) + 3'd1;  // 12 bytes each
    end else if (chunked_i) begin
      need = 3'd3;
    end
  end

  assign reach     = 4'(at_q) + 4'(need);
  assign from_hold = reach <= 4'd4;
  assign beyond    = reach > 4'd8;
  assign early     = groups && beyond && line_valid;  // a beat is moved, no group yet
  assign emit      = groups && !beyond && (from_hold || line_valid) && out_free &&
                     (group_q != '0 || header_ready);
  assign line_pop  = early || (emit && !from_hold);
  assign at_d      = emit && last ? 3'd4 : early ? 3'd0 : from_hold ? 3'(reach) : 3'(reach - 4'd4);
  assign header_use = emit && group_q == '0;
  assign end_moves  = out_free && ((state_q == RUN && queue_valid && queue_end) ||
                                   (state_q == FAILED && end_taken_q && fetch_idle));
  assign queue_pop  = (emit && last) || end_moves;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      at_q    <= 3'd4;
      group_q <= '0;
    end else if (start) begin
      at_q    <= 3'd4;
      group_q <= '0;
    end else begin
      if (emit || early) begin
        at_q <= at_d;
      end
      if (emit) begin
        group_q <= last ? '0 : group_q + 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (line_pop) begin
      hold_q <= line;
    end
  end

  assign group_words = (20 * 32)'({line, hold_q} >> (Quarter * 32'(at_q)));

  always_comb begin
    for (int unsigned k = 0; k < LANES; k++) begin
      for (int unsigned j = 0; j < 5; j++) begin
        words[k][j] = group_words[5*k+j];
      end
      if (chunked_i) begin
        words[k] = '0;
        for (int unsigned j = 0; j < 3; j++) begin
          words[k][j] = group_words[3*k+j];
        end
      end
    end
  end

  // ---- output ---------------------------------------------------------------------------------------

  group_t group_d, out_group_q;

  assign out_free = !out_valid_q || out_ready_i;

  always_comb begin
    group_d       = out_group_q;
    group_d.first = group_q == '0;
    group_d.last  = last;
    group_d.group = group_q;
    group_d.used  = 4'hF >> (2'd3 - over);
    group_d.word  = words;
    if (header_use) begin
      group_d.cluster = cluster;
      group_d.header  = header;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      out_valid_q <= 1'b0;
      out_end_q   <= 1'b0;
    end else if (out_free) begin
      out_valid_q <= emit || end_moves;
      out_end_q   <= end_moves;
    end
  end

  always_ff @(posedge clk_i) begin
    if (emit) begin
      out_group_q <= group_d;
    end
  end

  // ---- counts ---------------------------------------------------------------------------------------

  flk_event_counter i_header_beats (
    .clk_i,
    .rst_ni,
    .clear_i(start),
    .count_i(header_beat_comes),
    .value_o(header_beats_o)
  );

  flk_event_counter i_geometry_beats (
    .clk_i,
    .rst_ni,
    .clear_i(start),
    .count_i(geometry_beat_comes),
    .value_o(geometry_beats_o)
  );

  assign idle_o           = state_q == IDLE;
  assign done_o           = done_q;
  assign error_o          = error_q;
  assign damaged_o        = damaged_q;
  assign out_valid_o      = out_valid_q;
  assign out_end_o        = out_end_q;
  assign out_group_o      = out_group_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> state_q == IDLE)
  else $error("flk_geometry_fetch: start while a frame is under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      state_q != IDLE |-> $stable({chunked_i, position_i, headers_i, geometry_i}))
  else $error("flk_geometry_fetch: registers changed in a frame");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      (header_beat_comes |-> unused_shape_room && unused_colour_room) and
      (geometry_beat_comes |-> unused_line_room))
  else $error("flk_geometry_fetch: a beat without a place");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      state_q == LEAVE |-> fetch_idle && !line_valid && !shape_valid && inside_q == '0)
  else $error("flk_geometry_fetch: something is left after the last group");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i |=> out_valid_o && $stable({out_end_o, out_group_o}))
  else $error("flk_geometry_fetch: output changed before its transfer");
`endif

endmodule
