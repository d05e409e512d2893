// Colour fetch: colours of survivors from memory to the lanes (docs/reference/memory_image.md, docs/reference/front_end.md).
//
// Survivors of a group of four, or of Lanes neighbours of one, come in the order of the scene, Gaussian n for lane n modulo
// Lanes; of their colours the beats from the first one's to the last one's are read, each once. All lanes see one beat at a time; a lane keeps the two that its Gaussians
// need next and takes them apart (colour_part_t), in order, SH codes of 3 to 6 or 8 bits; the beat goes on when no lane needs it.
// oldest_o: no part of a cluster before it will be given any more (a running number, modulo); while
// nothing is under way it follows exit_i, the cluster whose groups are coming now.
// A frame: start_i while idle_o; registers stay until idle_o after the last survivors. An error of
// the memory: error_o rises and stays until the next start; parts come, but mean nothing.
// Throughput: a beat a cycle, a part a cycle and lane, a group every two cycles. Latency is the
// memory's and 10. Combinational: ar_ready_i to the requests, r_valid_i and r_i to the buffer's write port.
module flk_colour_fetch
  import flk_axi_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Lanes       = LANES, // 1, 2 or 4
  parameter  int unsigned BufferBeats = 64,
  parameter  int unsigned Items       = 128, // Gaussians of a lane that wait for colours
  parameter  int unsigned MaxBeats    = 16,
  parameter  int unsigned Bursts      = 64,  // under way
  parameter  int unsigned Id          = 0,
  localparam int unsigned Width       = AXI_DATA_BITS
) (
  input  logic                     clk_i,
  input  logic                     rst_ni,
  // Frame
  input  logic                     start_i,
  output logic                     idle_o,
  input  logic                     chunked_i,
  input  logic [BEAT_BITS-1:0]     colours_i,  // beat where the array begins
  output logic                     error_o,
  output logic [31:0]              beats_o,    // read
  // Survivors
  input  logic                     in_valid_i,
  output logic                     in_ready_o,
  input  survivors_t               in_data_i,
  input  cluster_index_t           exit_i,
  output cluster_index_t           oldest_o,
  // Colours
  output logic         [Lanes-1:0] out_valid_o,
  input  logic         [Lanes-1:0] out_ready_i,
  output colour_part_t [Lanes-1:0] out_data_o,
  // AXI4
  output logic                     ar_valid_o,
  input  logic                     ar_ready_i,
  output axi_ax_t                  ar_o,
  input  logic                     r_valid_i,
  output logic                     r_ready_o,
  input  axi_r_t                   r_i
);

  localparam int unsigned BYTE_BITS = 15;  // of an offset in a cluster's colours: 256 x 100 bytes
  localparam int unsigned AT_BITS = BYTE_BITS - 6;
  localparam int unsigned BeatBits = 5;
  localparam int unsigned LowBits = BEAT_BITS / 2;  // an address is added up in two halves
  localparam int unsigned HighBits = BEAT_BITS - LowBits;

  typedef struct packed {
    cluster_index_t     cluster;
    logic [AT_BITS-1:0] at;  // beat of the cluster's colours
  } mark_t;

  // ---- groups: where their colours lie --------------------------------------------------------------

  logic                              a_valid_q, a_move;
  cluster_index_t                    a_cluster_q;
  logic [31:0]                       a_colour_q;
  colour_step_t                      a_step_q;
  logic [1:0]                        a_degree_q;
  logic [Lanes-1:0]                  a_alive_q;
  logic [Lanes-1:0][BYTE_BITS-1:0]   a_start_q;
  logic [6:0]                        a_stride_q;
  logic [Lanes-1:0]                  in_alive;
  logic                              b_valid_q, b_move;
  cluster_index_t                    b_cluster_q;
  logic [LowBits:0]                  b_low_q;    // of the beat where the cluster's colours begin
  logic [HighBits-1:0]               b_high_q;
  logic [AT_BITS-1:0]                b_first_q;  // beats that hold colours of survivors
  logic [AT_BITS-1:0]                b_last_q;

  assign in_ready_o = !a_valid_q;

  assign in_alive   = Lanes'(in_data_i.alive >> in_data_i.at);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      a_valid_q <= 1'b0;
    end else begin
      a_valid_q <= a_valid_q ? !a_move : in_valid_i && in_data_i.alive != '0;
    end
  end

  always_ff @(posedge clk_i) begin
    if (in_ready_o) begin  // in_valid_i comes late
      a_cluster_q <= in_data_i.cluster;
      a_colour_q  <= in_data_i.colour;
      a_step_q    <= in_data_i.step;
      a_degree_q  <= in_data_i.degree;
      a_alive_q   <= in_alive;
      a_stride_q  <= in_data_i.stride;
      for (int unsigned k = 0; k < Lanes; k++) begin
        a_start_q[k] <= BYTE_BITS'({in_data_i.group, in_data_i.at | 2'(k)})
                      * BYTE_BITS'(in_data_i.stride);
      end
    end
  end

  // First byte of the first and last byte of the last survivor. Their lanes are told before the beats are asked for.

  logic [AT_BITS-1:0]   lowest;
  logic [BYTE_BITS-1:0] highest;
  logic [Lanes-1:0]     lane_ready;

  always_comb begin
    lowest  = a_start_q[0][BYTE_BITS-1:6];
    highest = a_start_q[0];
    for (int unsigned k = Lanes; k > 0; k--) begin
      if (a_alive_q[k-1]) begin
        lowest = a_start_q[k-1][BYTE_BITS-1:6];
      end
    end
    for (int unsigned k = 0; k < Lanes; k++) begin
      if (a_alive_q[k]) begin
        highest = a_start_q[k];
      end
    end
    highest = highest + BYTE_BITS'(a_stride_q) - 1'b1;
  end

  assign a_move = a_valid_q && (&(lane_ready | ~a_alive_q)) && !b_valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      b_valid_q <= 1'b0;
    end else begin
      b_valid_q <= a_move || (b_valid_q && !b_move);
    end
  end

  always_ff @(posedge clk_i) begin
    if (a_move) begin
      b_cluster_q <= a_cluster_q;
      b_low_q     <= {1'b0, colours_i[LowBits-1:0]} + {1'b0, a_colour_q[LowBits-1:0]};
      b_high_q    <= colours_i[BEAT_BITS-1:LowBits] + HighBits'(a_colour_q[31:LowBits]);
      b_first_q   <= lowest;
      b_last_q    <= highest[BYTE_BITS-1:6];
    end
  end

  // The beats that are still to be read.

  logic                 known_q;  // beats up to reached_q of the cluster have been asked for
  logic                 over;
  cluster_index_t       asked_q;
  logic [AT_BITS-1:0]   reached_q, first;
  logic                 same, nothing, request_ready;
  logic                 c_valid_q;
  cluster_index_t       c_cluster_q;
  logic [LowBits-1:0]   c_low_q;
  logic [HighBits-1:0]  c_high_q, c_next_q;  // of the address, without and with a carry from below
  logic [LowBits:0]     c_low;
  logic [BEAT_BITS-1:0] c_beat;
  logic [AT_BITS-1:0]   c_first_q;
  logic [BeatBits-1:0]  c_beats_q;

  assign same    = known_q && asked_q == b_cluster_q;
  assign first   = same && reached_q >= b_first_q ? reached_q + 1'b1 : b_first_q;
  assign nothing = same && reached_q >= b_last_q;
  assign c_low   = {1'b0, c_low_q} + (LowBits + 1)'(c_first_q);
  assign c_beat  = {c_low[LowBits] ? c_next_q : c_high_q, c_low[LowBits-1:0]};
  assign b_move  = b_valid_q && (nothing || !c_valid_q);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      known_q   <= 1'b0;
      asked_q   <= '0;  // what is over goes by it before the first request, too
      c_valid_q <= 1'b0;
    end else begin
      known_q   <= !start_i && ((known_q && !over) || b_move);
      c_valid_q <= c_valid_q ? !request_ready : b_move && !nothing;
      if (b_move) begin
        asked_q <= b_cluster_q;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (b_move && !nothing) begin
      reached_q   <= b_last_q;
      c_cluster_q <= b_cluster_q;
      c_low_q     <= b_low_q[LowBits-1:0];
      c_high_q    <= b_high_q + HighBits'(b_low_q[LowBits]);
      c_next_q    <= b_high_q + HighBits'(b_low_q[LowBits]) + 1'b1;
      c_first_q   <= first;
      c_beats_q   <= BeatBits'(b_last_q - first) + 1'b1;
    end
  end

  // ---- beats ----------------------------------------------------------------------------------------

  logic             fetch_idle, fetch_valid, fetch_error, beat_valid, beat_ready, beat_move, empty;
  logic [Width-1:0] fetch_data, beat_data;
  mark_t            fetch_tag, fetch_mark, tag_q, mark_q, beat_mark;
  logic             following_q, freed_q, unused_ready;

  flk_axi_fetch #(
    .Places  (BufferBeats),
    .AddrBits(AXI_ADDR_BITS),
    .BeatBits(BeatBits),
    .TagBits ($bits(mark_t)),
    .Width   (Width),
    .MaxBeats(MaxBeats),
    .Bursts  (Bursts),
    .IdBits  (AXI_ID_BITS),
    .Id      (Id)
  ) i_fetch (
    .clk_i,
    .rst_ni,
    .stop_i     (1'b0),
    .idle_o     (fetch_idle),
    .in_valid_i (c_valid_q),
    .in_ready_o (request_ready),
    .in_beat_i  (c_beat),
    .in_beats_i (c_beats_q),
    .in_tag_i   ({c_cluster_q, c_first_q}),
    .in_placed_i(1'b0),
    .freed_i    (freed_q),
    .out_valid_o(fetch_valid),
    .out_data_o (fetch_data),
    .out_tag_o  (fetch_tag),
    .out_error_o(fetch_error),
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

  // The tag is that of a request's first beat; the others count on.
  assign fetch_mark = following_q && fetch_tag == tag_q
                    ? mark_t'({mark_q.cluster, mark_q.at + 1'b1}) : fetch_tag;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      following_q <= 1'b0;
    end else if (start_i || over) begin
      following_q <= 1'b0;
    end else if (fetch_valid) begin
      following_q <= 1'b1;
    end
  end

  always_ff @(posedge clk_i) begin
    if (fetch_valid) begin
      tag_q  <= fetch_tag;
      mark_q <= fetch_mark;
    end
  end

  flk_sram_fifo #(
    .Width(Width + $bits(mark_t)),
    .Depth(BufferBeats)
  ) i_buffer (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (fetch_valid),
    .in_ready_o (unused_ready),
    .in_data_i  ({fetch_mark, fetch_data}),
    .out_valid_o(beat_valid),
    .out_ready_i(beat_ready),
    .out_data_o ({beat_mark, beat_data}),
    .empty_o    (empty)
  );

  assign beat_move = beat_valid && beat_ready;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      freed_q <= 1'b0;
    end else begin
      freed_q <= beat_move;
    end
  end

  // ---- the beat that all lanes see --------------------------------------------------------------------

  // It goes on when the next one is there and no lane needs it (any more). The next one is asked for
  // only after all Gaussians that begin in this one have been told to their lanes.
  logic             seen_valid_d, seen_valid_q, advance, stale;
  mark_t            seen_q;
  logic [Width-1:0] seen_data_q;
  logic [Lanes-1:0] lane_empty, lane_served;  // no Gaussian waits; the beat is taken or not needed

  // Nothing is under way and groups of a later cluster come: what is known of beats is forgotten.
  // The next cluster with survivors may be any number of clusters further and bear the same number.
  assign over       = (&lane_empty) && !a_valid_q && !b_valid_q && asked_q != exit_i;

  // A cluster's last beat goes when all has been taken of it and another cluster's groups come.
  assign stale      = seen_valid_q && seen_q.cluster != exit_i && (&lane_empty) && !a_valid_q;
  assign advance    = seen_valid_q && beat_valid && (&lane_served);
  assign beat_ready = !stale && (!seen_valid_q || advance);

  always_comb begin
    seen_valid_d = seen_valid_q || beat_valid;
    if (start_i || stale) begin
      seen_valid_d = 1'b0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      seen_valid_q <= 1'b0;
    end else begin
      seen_valid_q <= seen_valid_d;
    end
  end

  always_ff @(posedge clk_i) begin
    if (beat_move) begin
      seen_q      <= beat_mark;
      seen_data_q <= beat_data;
    end
  end

  // ---- lanes ----------------------------------------------------------------------------------------

  typedef struct packed {
    cluster_index_t       cluster;
    colour_step_t         step;
    logic [1:0]           degree;
    logic [BYTE_BITS-1:0] start;
  } item_t;

  logic           [Lanes-1:0] lane_busy;
  cluster_index_t [Lanes-1:0] lane_cluster;  // of the oldest that is not given yet

  for (genvar k = 0; k < Lanes; k++) begin : gen_lanes
    logic                 item_valid, item_empty;
    item_t                item;
    logic                 next_take, next_free, next_valid_q, none;
    item_t                next_q;
    logic [AT_BITS-1:0]   next_last_q;  // beat of its last byte

    flk_sram_fifo #(
      .Width($bits(item_t)),
      .Depth(Items)
    ) i_items (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (a_move && a_alive_q[k]),
      .in_ready_o (lane_ready[k]),
      .in_data_i  ({a_cluster_q, a_step_q, a_degree_q, a_start_q[k]}),
      .out_valid_o(item_valid),
      .out_ready_i(next_free),
      .out_data_o (item),
      .empty_o    (item_empty)
    );

    assign next_free = !next_valid_q || next_take;
    assign none      = item_empty && !next_valid_q;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        next_valid_q <= 1'b0;
      end else if (next_free) begin
        next_valid_q <= item_valid;
      end
    end

    always_ff @(posedge clk_i) begin
      if (next_free && item_valid) begin
        next_q      <= item;
        next_last_q <= AT_BITS'((item.start + BYTE_BITS'(colour_stride(item.step, item.degree))
                                 - 1'b1) >> 6);
      end
    end

    // The part that is wanted now

    // It begins as far in front of its coefficients as the Gaussian in front of the first ones: with 4 bytes, 8 in FP16, of which the first part's alone
    // mean anything. Places of parts count half bytes.
    logic                 want_d, want_q;
    cluster_index_t       cluster_q;
    logic [1:0]           degree_q, part_q;
    logic [BYTE_BITS:0]   from_q, further_q;  // this one, the next
    colour_step_t         step_q;
    logic [AT_BITS-1:0]   at, last_q;  // beats of the part's first byte, of the Gaussian's last
    logic                 more, fire, straddles, final_part;

    assign final_part = degree_q == 2'd3 ? part_q == 2'd3 : degree_q != 2'd2 || part_q == 2'd1;
    assign more       = fire && !final_part;
    assign next_take  = !want_q || (fire && final_part);
    assign want_d     = next_take ? next_valid_q : want_q;
    assign at         = from_q[BYTE_BITS:7];

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        want_q <= 1'b0;
      end else begin
        want_q <= want_d;
      end
    end

    always_ff @(posedge clk_i) begin
      if (next_take) begin
        cluster_q <= next_q.cluster;
        degree_q  <= next_q.degree;
        part_q    <= '0;
        from_q    <= {next_q.start, 1'b0};
        further_q <= {next_q.start, 1'b0} + (BYTE_BITS + 1)'(next_q.step);
        step_q    <= next_q.step;
        last_q    <= next_last_q;
      end else if (more) begin
        part_q    <= part_q + 1'b1;
        from_q    <= further_q;
        further_q <= further_q + (BYTE_BITS + 1)'(step_q);
      end
    end

    // Two beats of the lane's own: the one in which the part begins, and the next that is needed.

    logic                  l0_valid_d, l0_valid_q, l1_valid_d, l1_valid_q;
    mark_t                 l0_q, l1_q;
    logic [31:0][31:0]     window_q;  // words of both
    logic                  here, needed, passed, shift, second, take, has, drop;

    // It lies in 4 words of a chunk's Gaussian, 8 of FP16's, or ends with the Gaussian.
    assign straddles = (chunked_i ? from_q[6:5] == '1 && from_q[4:3] != '0
                                  : from_q[6] && from_q[5:3] != '0) && at != last_q;
    assign here      = l0_q == {cluster_q, at};
    assign fire      = want_q && l0_valid_q && here && (!straddles || l1_valid_q) &&
                       (!out_valid_o[k] || out_ready_i[k]);

    function automatic logic later(input cluster_index_t a, input cluster_index_t b);
      return a != b && CLUSTER_BITS'(a - b) <= CLUSTER_BITS'(COLOUR_CLUSTERS);
    endfunction

    // Whether the beat that all see is needed by the Gaussian in work or the next, or by none that is known.
    always_comb begin
      needed = 1'b0;
      passed = 1'b0;
      if (!want_q) begin
        passed = none;
      end else if (later(cluster_q, seen_q.cluster) ||
                   (cluster_q == seen_q.cluster && seen_q.at < at)) begin
        passed = 1'b1;
      end else if (cluster_q == seen_q.cluster && seen_q.at <= last_q) begin
        needed = 1'b1;
      end else if (!next_valid_q) begin
        passed = none;
      end else if (later(next_q.cluster, seen_q.cluster) ||
                   (next_q.cluster == seen_q.cluster &&
                    seen_q.at < next_q.start[BYTE_BITS-1:6])) begin
        passed = 1'b1;
      end else begin
        needed = next_q.cluster == seen_q.cluster && seen_q.at <= next_last_q;
      end
    end

    assign has            = (l0_valid_q && l0_q == seen_q) || (l1_valid_q && l1_q == seen_q);
    assign take           = seen_valid_q && needed && !has && (!l0_valid_q || !l1_valid_q || shift);
    assign lane_served[k] = passed || (needed && (has || take));
    assign lane_empty[k]  = none && !want_q;
    // Beats of a cluster that is over for a lane without work must not be taken for a later one's.
    assign drop           = over ||
                            (lane_empty[k] && seen_valid_q && l0_q.cluster != seen_q.cluster);

    // The first of the two is not the beat in which the part that is wanted in the next cycle begins; the second is.
    mark_t then_at, beyond;  // of the next Gaussian, of the next part
    logic  other, idle_other, fire_other;

    assign then_at     = {next_q.cluster, next_q.start[BYTE_BITS-1:6]};
    assign beyond     = {cluster_q, further_q[BYTE_BITS:7]};
    assign other      = next_valid_q && l0_q != then_at;
    assign idle_other = want_q ? !here : other;
    assign fire_other = final_part ? other : l0_q != beyond;
    assign shift      = l0_valid_q && (fire ? fire_other : idle_other);
    assign second     = l1_valid_q && l1_q == (more ? beyond : next_take ? then_at
                                               : {cluster_q, at});

    always_comb begin
      l0_valid_d = l0_valid_q;
      l1_valid_d = l1_valid_q;
      if (shift) begin
        l0_valid_d = second || take;
        l1_valid_d = second && take;
      end else if (!l0_valid_q) begin
        l0_valid_d = take;
      end else begin
        l1_valid_d = l1_valid_q || take;
      end
      if (start_i || drop) begin
        l0_valid_d = 1'b0;
        l1_valid_d = 1'b0;
      end
    end

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        l0_valid_q <= 1'b0;
        l1_valid_q <= 1'b0;
      end else begin
        l0_valid_q <= l0_valid_d;
        l1_valid_q <= l1_valid_d;
      end
    end

    always_ff @(posedge clk_i) begin
      if (shift ? second || take : !l0_valid_q && take) begin
        l0_q           <= shift && second ? l1_q : seen_q;
        window_q[15:0] <= shift && second ? window_q[31:16] : seen_data_q;
      end
      if (take) begin
        l1_q            <= seen_q;
        window_q[31:16] <= seen_data_q;
      end
    end

    assign lane_busy[k]    = want_q || out_valid_o[k];
    assign lane_cluster[k] = out_valid_o[k] ? out_data_o[k].cluster : cluster_q;

    // The bits from there on; a chunk's SH codes

    logic [255:0]          words;
    logic [127:0]          chunk;
    logic [3:0][2:0][7:0]  codes;
    colour_part_t          part;

    always_comb begin
      for (int unsigned i = 0; i < 8; i++) begin
        words[32*i+:32] = window_q[5'(from_q[6:3])+5'(i)];
      end
    end

    assign chunk = words[127:0] >> {from_q[2:0], 2'b00};

    always_comb begin
      for (int unsigned i = 0; i < 12; i++) begin
        unique case (step_q)
          6'd9: codes[i/3][i%3] = 8'(chunk[32+3*i+:3]);
          6'd12: codes[i/3][i%3] = 8'(chunk[32+4*i+:4]);
          6'd15: codes[i/3][i%3] = 8'(chunk[32+5*i+:5]);
          6'd18: codes[i/3][i%3] = 8'(chunk[32+6*i+:6]);
          default: codes[i/3][i%3] = chunk[32+8*i+:8];
        endcase
      end
    end

    always_comb begin
      part         = '0;
      part.cluster = cluster_q;
      part.first   = part_q == '0;
      part.last    = final_part;
      part.part    = part_q;
      unique case (degree_q)
        2'd0: part.used = 4'b0000;
        2'd1: part.used = 4'b0111;
        2'd2: part.used = 4'b1111;
        default: part.used = part_q == 2'd3 ? 4'b0111 : 4'b1111;
      endcase
      if (chunked_i) begin
        part.opacity = 16'(chunk[7:0]);
        part.dc[0]   = 16'(chunk[31:24]);
        part.dc[1]   = 16'(chunk[23:16]);
        part.dc[2]   = 16'(chunk[15:8]);
      end else begin
        part.opacity = words[15:0];
        part.dc[0]   = words[31:16];
        part.dc[1]   = words[47:32];
        part.dc[2]   = words[63:48];
      end
      for (int unsigned i = 0; i < 4; i++) begin
        for (int unsigned c = 0; c < 3; c++) begin
          part.raw[i][c] = chunked_i ? 16'(codes[i][c]) : words[16*(4+3*i+c)+:16];
        end
      end
    end

    logic         out_valid_q;
    colour_part_t out_q;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        out_valid_q <= 1'b0;
      end else begin
        out_valid_q <= fire || (out_valid_q && !out_ready_i[k]);
      end
    end

    always_ff @(posedge clk_i) begin
      if (fire) begin
        out_q <= part;
      end
    end

    assign out_valid_o[k] = out_valid_q;
    assign out_data_o[k]  = out_q;

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        fire && straddles |-> l1_q == {cluster_q, AT_BITS'(at + 1'b1)})
    else $error("flk_colour_fetch: a part that ends in another beat than the next one kept");
`endif
  end

  // ---- state ----------------------------------------------------------------------------------------

  cluster_index_t oldest_d, oldest_q, least;
  logic           error_q;

  // Of the clusters that lanes are working on, the oldest.
  always_comb begin
    least = seen_q.cluster;
    for (int unsigned k = 0; k < Lanes; k++) begin
      if (lane_busy[k] &&
          CLUSTER_BITS'(least - lane_cluster[k]) < CLUSTER_BITS'(COLOUR_CLUSTERS)) begin
        least = lane_cluster[k];
      end
    end
  end

  always_comb begin
    oldest_d = oldest_q;
    if ((&lane_empty) && lane_busy == '0 && !a_valid_q) begin
      oldest_d = exit_i;
    end else if (seen_valid_q) begin
      oldest_d = least;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      oldest_q <= '0;
      error_q  <= 1'b0;
    end else if (start_i) begin
      oldest_q <= '0;
      error_q  <= 1'b0;
    end else begin
      oldest_q <= oldest_d;
      error_q  <= error_q || (fetch_valid && fetch_error);
    end
  end

  flk_event_counter i_beats (
    .clk_i,
    .rst_ni,
    .clear_i(start_i),
    .count_i(fetch_valid),
    .value_o(beats_o)
  );

  assign oldest_o = oldest_q;
  assign error_o  = error_q;
  assign idle_o   = !a_valid_q && !b_valid_q && !c_valid_q && (&lane_empty) && fetch_idle &&
                    empty && out_valid_o == '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      in_valid_i |-> 4'({in_alive}) << in_data_i.at == in_data_i.alive)
  else $error("flk_colour_fetch: survivors that are no neighbours");

  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o && !in_valid_i)
  else $error("flk_colour_fetch: start while a frame is under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni) fetch_valid |-> unused_ready)
  else $error("flk_colour_fetch: a beat without a place");
`endif

endmodule
