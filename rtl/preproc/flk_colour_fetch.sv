// Colour fetch: colours of survivors from memory to the lanes (docs/memory_image.md, docs/front_end.md).
//
// Survivors of a group of four come in the order of the scene; of their colours those beats are read
// that hold any, each once. All lanes see one beat at a time; a lane keeps the two that its Gaussians
// need next and takes them apart (colour_part_t), in order; the beat goes on when no lane needs it.
// oldest_o: no part of a cluster before it will be given any more (a running number, modulo); while
// nothing is under way it follows exit_i, the cluster whose groups are coming now.
// A frame: start_i while idle_o; registers stay until idle_o after the last survivors. An error of
// the memory: error_o rises and stays until the next start; parts come, but mean nothing.
// Throughput: a beat a cycle, a part a cycle and lane, a group every cycle. Latency is the memory's
// and 8. Combinational: ar_ready_i to the requests, r_*_i to the buffer's write port.
module flk_colour_fetch
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned BufferBeats = 64,
  parameter  int unsigned Items       = 128, // Gaussians of a lane that wait for colours
  parameter  int unsigned MaxBeats    = 16,
  parameter  int unsigned Bursts      = 64,  // under way
  parameter  int unsigned IdBits      = 4,
  parameter  int unsigned Id          = 0,
  localparam int unsigned Width       = 512,
  localparam int unsigned AddrBits    = BEAT_BITS + 6
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
  output logic         [LANES-1:0] out_valid_o,
  input  logic         [LANES-1:0] out_ready_i,
  output colour_part_t [LANES-1:0] out_data_o,
  // AXI4
  output logic                     ar_valid_o,
  input  logic                     ar_ready_i,
  output logic [IdBits-1:0]        ar_id_o,
  output logic [AddrBits-1:0]      ar_addr_o,
  output logic [7:0]               ar_len_o,
  output logic [2:0]               ar_size_o,
  output logic [1:0]               ar_burst_o,
  input  logic                     r_valid_i,
  output logic                     r_ready_o,
  input  logic [IdBits-1:0]        r_id_i,
  input  logic [Width-1:0]         r_data_i,
  input  logic [1:0]               r_resp_i,
  input  logic                     r_last_i
);

  localparam int unsigned BYTE_BITS = 15;  // of an offset in a cluster's colours: 256 x 100 bytes
  localparam int unsigned AT_BITS = BYTE_BITS - 6;
  localparam int unsigned BeatBits = 5;

  typedef struct packed {
    cluster_index_t     cluster;
    logic [AT_BITS-1:0] at;  // beat of the cluster's colours
  } mark_t;

  function automatic logic [6:0] stride(input logic chunked, input logic [1:0] degree);
    unique case (degree)
      2'd0: return chunked ? 7'd4 : 7'd8;
      2'd1: return chunked ? 7'd16 : 7'd28;
      2'd2: return chunked ? 7'd28 : 7'd56;
      default: return chunked ? 7'd52 : 7'd100;
    endcase
  endfunction

  // ---- groups: where their colours lie --------------------------------------------------------------

  logic                              a_valid_q, a_move;
  cluster_index_t                    a_cluster_q;
  logic [31:0]                       a_colour_q;
  logic [1:0]                        a_degree_q;
  logic [LANES-1:0]                  a_alive_q;
  logic [LANES-1:0][BYTE_BITS-1:0]   a_start_q;
  logic [6:0]                        in_stride, a_stride_q;

  assign in_stride  = stride(chunked_i, in_data_i.degree);
  assign in_ready_o = !a_valid_q || a_move;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      a_valid_q <= 1'b0;
    end else if (in_ready_o) begin
      a_valid_q <= in_valid_i && in_data_i.alive != '0;
    end
  end

  always_ff @(posedge clk_i) begin
    if (in_valid_i && in_ready_o) begin
      a_cluster_q <= in_data_i.cluster;
      a_colour_q  <= in_data_i.colour;
      a_degree_q  <= in_data_i.degree;
      a_alive_q   <= in_data_i.alive;
      a_stride_q  <= in_stride;
      for (int unsigned k = 0; k < LANES; k++) begin
        a_start_q[k] <= BYTE_BITS'({in_data_i.group, 2'(k)}) * BYTE_BITS'(in_stride);
      end
    end
  end

  // First byte of the first and last byte of the last survivor, the beats that are still to be read.

  logic [AT_BITS-1:0]   lowest;
  logic [BYTE_BITS-1:0] highest;
  logic [AT_BITS-1:0]   first, last;
  logic                 known_q;  // beats up to reached_q of the cluster have been asked for
  cluster_index_t       asked_q;
  logic [AT_BITS-1:0]   reached_q;
  logic                 same, nothing, request, request_ready, lanes_ready;
  logic [LANES-1:0]     lane_ready;

  always_comb begin
    lowest  = a_start_q[0][BYTE_BITS-1:6];
    highest = a_start_q[0];
    for (int unsigned k = LANES; k > 0; k--) begin
      if (a_alive_q[k-1]) begin
        lowest = a_start_q[k-1][BYTE_BITS-1:6];
      end
    end
    for (int unsigned k = 0; k < LANES; k++) begin
      if (a_alive_q[k]) begin
        highest = a_start_q[k];
      end
    end
    highest = highest + BYTE_BITS'(a_stride_q) - 1'b1;
  end

  assign same        = known_q && asked_q == a_cluster_q;
  assign last        = highest[BYTE_BITS-1:6];
  assign first       = same && reached_q >= lowest ? reached_q + 1'b1 : lowest;
  assign nothing     = same && reached_q >= last;
  assign lanes_ready = &(lane_ready | ~a_alive_q);
  assign request     = a_valid_q && lanes_ready && !nothing;
  assign a_move      = a_valid_q && lanes_ready && (nothing || request_ready);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      known_q <= 1'b0;
    end else if (start_i) begin
      known_q <= 1'b0;
    end else if (a_move) begin
      known_q <= 1'b1;
    end
  end

  always_ff @(posedge clk_i) begin
    if (a_move) begin
      asked_q <= a_cluster_q;
      if (!nothing) begin
        reached_q <= last;
      end
    end
  end

  // ---- beats ----------------------------------------------------------------------------------------

  logic             fetch_idle, fetch_valid, fetch_error, beat_valid, beat_ready, beat_move, empty;
  logic [Width-1:0] fetch_data, beat_data;
  mark_t            fetch_tag, fetch_mark, tag_q, mark_q, beat_mark;
  logic             following_q, unused_ready;

  flk_axi_fetch #(
    .Places  (BufferBeats),
    .AddrBits(AddrBits),
    .BeatBits(BeatBits),
    .TagBits ($bits(mark_t)),
    .Width   (Width),
    .MaxBeats(MaxBeats),
    .Bursts  (Bursts),
    .IdBits  (IdBits),
    .Id      (Id)
  ) i_fetch (
    .clk_i,
    .rst_ni,
    .stop_i     (1'b0),
    .idle_o     (fetch_idle),
    .in_valid_i (request),
    .in_ready_o (request_ready),
    .in_beat_i  (colours_i + BEAT_BITS'(a_colour_q) + BEAT_BITS'(first)),
    .in_beats_i (BeatBits'(last - first) + 1'b1),
    .in_tag_i   ({a_cluster_q, first}),
    .in_placed_i(1'b0),
    .freed_i    (beat_move),
    .out_valid_o(fetch_valid),
    .out_data_o (fetch_data),
    .out_tag_o  (fetch_tag),
    .out_error_o(fetch_error),
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

  // The tag is that of a request's first beat; the others count on.
  assign fetch_mark = following_q && fetch_tag == tag_q
                    ? mark_t'({mark_q.cluster, mark_q.at + 1'b1}) : fetch_tag;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      following_q <= 1'b0;
    end else if (start_i) begin
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

  // ---- the beat that all lanes see --------------------------------------------------------------------

  // It goes on when the next one is there and no lane needs it (any more). The next one is asked for
  // only after all Gaussians that begin in this one have been told to their lanes.
  logic             seen_valid_d, seen_valid_q, advance, stale;
  mark_t            seen_q;
  logic [Width-1:0] seen_data_q;
  logic [LANES-1:0] lane_empty, lane_served;  // no Gaussian waits; the beat is taken or not needed

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
    logic [1:0]           degree;
    logic [BYTE_BITS-1:0] start;
  } item_t;

  logic           [LANES-1:0] lane_busy;
  cluster_index_t [LANES-1:0] lane_cluster;  // of the oldest that is not given yet

  for (genvar k = 0; k < LANES; k++) begin : gen_lanes
    logic  item_valid, item_ready, item_empty;
    item_t item;

    flk_sram_fifo #(
      .Width($bits(item_t)),
      .Depth(Items)
    ) i_items (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (a_move && a_alive_q[k]),
      .in_ready_o (lane_ready[k]),
      .in_data_i  ({a_cluster_q, a_degree_q, a_start_q[k]}),
      .out_valid_o(item_valid),
      .out_ready_i(item_ready),
      .out_data_o (item),
      .empty_o    (item_empty)
    );

    // The part that is wanted next

    logic                 want_d, want_q;
    cluster_index_t       cluster_d, cluster_q;
    logic [1:0]           degree_d, degree_q, part_d, part_q;
    logic [BYTE_BITS-1:0] from_d, from_q;  // first byte of the part
    logic [BYTE_BITS-1:0] end_d, end_q;    // last byte of the Gaussian
    logic                 more, fire, straddles, final_part;
    logic [BYTE_BITS-1:0] reach;
    logic [AT_BITS-1:0]   last_beat;

    assign final_part = degree_q == 2'd3 ? part_q == 2'd3 : degree_q != 2'd2 || part_q == 2'd1;
    assign more       = want_q && !final_part;
    assign item_ready = !want_q || (fire && final_part);

    always_comb begin
      want_d    = want_q;
      cluster_d = cluster_q;
      degree_d  = degree_q;
      part_d    = part_q;
      from_d    = from_q;
      end_d     = end_q;
      if (fire && more) begin
        part_d = part_q + 1'b1;
        from_d = from_q + (chunked_i ? BYTE_BITS'(12) : BYTE_BITS'(24));
      end else if (item_ready) begin
        want_d    = item_valid;
        cluster_d = item.cluster;
        degree_d  = item.degree;
        part_d    = '0;
        from_d    = item.start;
        end_d     = item.start + BYTE_BITS'(stride(chunked_i, item.degree)) - 1'b1;
      end
    end

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        want_q <= 1'b0;
      end else begin
        want_q <= want_d;
      end
    end

    always_ff @(posedge clk_i) begin
      cluster_q <= cluster_d;
      degree_q  <= degree_d;
      part_q    <= part_d;
      from_q    <= from_d;
      end_q     <= end_d;
    end

    // Two beats of the lane's own: the one in which the part begins, and the next that is needed.

    logic                  l0_valid_d, l0_valid_q, l1_valid_d, l1_valid_q;
    mark_t                 l0_q, l1_q, wanted;
    logic [31:0][31:0]     window_q;  // words of both
    logic                  needed, passed, shift, take, has, drop;
    logic [AT_BITS-1:0]    item_last;

    // It reaches 16 bytes of a chunk's Gaussian, 32 of FP16's, or to the Gaussian's end.
    assign reach     = from_q + (chunked_i ? BYTE_BITS'(15) : BYTE_BITS'(31));
    assign last_beat = reach < end_q ? reach[BYTE_BITS-1:6] : end_q[BYTE_BITS-1:6];
    assign straddles = last_beat != from_q[BYTE_BITS-1:6];
    assign fire      = want_q && l0_valid_q && l0_q == {cluster_q, from_q[BYTE_BITS-1:6]} &&
                       (!straddles || l1_valid_q) && (!out_valid_o[k] || out_ready_i[k]);


    function automatic logic later(input cluster_index_t a, input cluster_index_t b);
      return a != b && CLUSTER_BITS'(a - b) <= CLUSTER_BITS'(COLOUR_CLUSTERS);
    endfunction

    // Whether the beat that all see is needed by the Gaussian in work or the next, or by none that is known.
    assign item_last = AT_BITS'((item.start + BYTE_BITS'(stride(chunked_i, item.degree)) - 1'b1)
                                >> 6);

    always_comb begin
      needed = 1'b0;
      passed = 1'b0;
      if (!want_q) begin
        passed = item_empty;
      end else if (later(cluster_q, seen_q.cluster) ||
                   (cluster_q == seen_q.cluster && seen_q.at < from_q[BYTE_BITS-1:6])) begin
        passed = 1'b1;
      end else if (cluster_q == seen_q.cluster && seen_q.at <= end_q[BYTE_BITS-1:6]) begin
        needed = 1'b1;
      end else if (!item_valid) begin
        passed = item_empty;
      end else if (later(item.cluster, seen_q.cluster) ||
                   (item.cluster == seen_q.cluster && seen_q.at < item.start[BYTE_BITS-1:6])) begin
        passed = 1'b1;
      end else begin
        needed = item.cluster == seen_q.cluster && seen_q.at <= item_last;
      end
    end

    assign has            = (l0_valid_q && l0_q == seen_q) || (l1_valid_q && l1_q == seen_q);
    assign take           = seen_valid_q && needed && !has && (!l0_valid_q || !l1_valid_q || shift);
    assign lane_served[k] = passed || (needed && (has || take));
    assign lane_empty[k]  = item_empty && !want_q;
    // Beats of a cluster that is over for a lane without work must not be taken for a later one's.
    assign drop           = lane_empty[k] && seen_valid_q && l0_q.cluster != seen_q.cluster;
    assign wanted         = {cluster_d, from_d[BYTE_BITS-1:6]};
    assign shift          = want_d && l0_valid_q && l0_q != wanted;

    always_comb begin
      l0_valid_d = l0_valid_q;
      l1_valid_d = l1_valid_q;
      if (shift) begin
        l0_valid_d = l1_valid_q || take;
        l1_valid_d = l1_valid_q && take;
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
      if (shift ? l1_valid_q || take : !l0_valid_q && take) begin
        l0_q           <= shift && l1_valid_q ? l1_q : seen_q;
        window_q[15:0] <= shift && l1_valid_q ? window_q[31:16] : seen_data_q;
      end
      if (take) begin
        l1_q            <= seen_q;
        window_q[31:16] <= seen_data_q;
      end
    end

    assign lane_busy[k]    = want_q || out_valid_o[k];
    assign lane_cluster[k] = out_valid_o[k] ? out_data_o[k].cluster : cluster_q;

    // The bytes from there on

    logic [255:0]        words;
    colour_part_t        part;

    always_comb begin
      for (int unsigned i = 0; i < 8; i++) begin
        words[32*i+:32] = window_q[5'(from_q[5:2])+5'(i)];
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
        part.opacity = 16'(words[7:0]);
        part.dc[0]   = 16'(words[31:24]);
        part.dc[1]   = 16'(words[23:16]);
        part.dc[2]   = 16'(words[15:8]);
      end else begin
        part.opacity = words[15:0];
        part.dc[0]   = words[31:16];
        part.dc[1]   = words[47:32];
        part.dc[2]   = words[63:48];
      end
      for (int unsigned i = 0; i < 4; i++) begin
        for (int unsigned c = 0; c < 3; c++) begin
          part.raw[i][c] = chunked_i ? 16'(words[8*(4+3*i+c)+:8]) : words[16*(4+3*i+c)+:16];
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
        fire && straddles |-> l1_q == {cluster_q, last_beat})
    else $error("flk_colour_fetch: a part that ends in another beat than the next one kept");
`endif
  end

  // ---- state ----------------------------------------------------------------------------------------

  cluster_index_t oldest_d, oldest_q, least;
  logic           error_q;
  logic [31:0]    beats_q;

  // Of the clusters that lanes are working on, the oldest.
  always_comb begin
    least = seen_q.cluster;
    for (int unsigned k = 0; k < LANES; k++) begin
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
      beats_q  <= '0;
    end else if (start_i) begin
      oldest_q <= '0;
      error_q  <= 1'b0;
      beats_q  <= '0;
    end else begin
      oldest_q <= oldest_d;
      error_q  <= error_q || (fetch_valid && fetch_error);
      beats_q  <= beats_q + 32'(fetch_valid);
    end
  end

  assign oldest_o = oldest_q;
  assign error_o  = error_q;
  assign beats_o  = beats_q;
  assign idle_o   = !a_valid_q && (&lane_empty) && fetch_idle && empty && out_valid_o == '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o && !in_valid_i)
  else $error("flk_colour_fetch: start while a frame is under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni) fetch_valid |-> unused_ready)
  else $error("flk_colour_fetch: a beat without a place");
`endif

endmodule
