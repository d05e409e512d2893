// Cluster cull: reads the cluster table (docs/reference/memory_image.md) and hands the clusters on that can
// hold a visible Gaussian, in the order of the table (docs/reference/front_end.md).
//
// A frame: start_i while idle_o; setup_i, table_i (beat of the table) and clusters_i stay until
// done_o, which is high for a cycle when the last element has been taken. The last element has
// out_end_o and no cluster; there is one in every frame. The counts of what was culled are valid
// from done_o to the next start. An error of the memory: error_o rises and stays until the next
// start, what is under way is read and dropped, no kept cluster is added, the end element follows;
// the counts mean nothing. A box or sigma with exponent code 255, which no packed scene has: the
// same, with damaged_o. Floats of the table with exponent code 0 count as 0.
//
// Throughput: a cluster every 16 cycles; the first one leaves about the memory's latency and 60
// cycles after start_i. Beats wait in a buffer of BufferBeats, requests in its free places: the
// port never waits. Back-pressure of the clusters stops the test. No combinational paths but
// r_valid_i and r_i to the buffer and ar_ready_i to the requests.
module flk_cluster_cull
  import flk_axi_pkg::*;
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned BufferBeats = 16,  // less MaxBeats, times 32: cycles of latency it hides
  parameter  int unsigned MaxBeats    = 4,   // of a burst
  parameter  int unsigned Bursts      = 4,   // under way
  parameter  int unsigned Id          = 0,
  localparam int unsigned Width       = AXI_DATA_BITS
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  // Frame
  input  logic                 start_i,
  output logic                 idle_o,
  input  cull_setup_t          setup_i,
  input  logic [BEAT_BITS-1:0] table_i,
  input  logic [23:0]          clusters_i,
  output logic                 done_o,
  output logic                 error_o,
  output logic                 damaged_o,
  output logic [31:0]          culled_clusters_o,
  output logic [31:0]          culled_gaussians_o,
  // Kept clusters
  output logic                 out_valid_o,
  input  logic                 out_ready_i,
  output logic                 out_end_o,
  output kept_t                out_cluster_o,
  output boxed_t               out_box_o,
  // AXI4
  output logic                 ar_valid_o,
  input  logic                 ar_ready_i,
  output axi_ax_t              ar_o,
  input  logic                 r_valid_i,
  output logic                 r_ready_o,
  input  axi_r_t               r_i
);

  localparam int unsigned Interval = 16;  // of flk_cluster_test
  localparam int unsigned PhaseBits = $clog2(Interval);
  localparam int unsigned Inside = (CLUSTER_TEST_LATENCY + Interval - 1) / Interval;
  localparam logic [PhaseBits-1:0] OUT_PHASE = PhaseBits'(CLUSTER_TEST_LATENCY % Interval);

  // ---- frame ----------------------------------------------------------------------------------------

  typedef enum logic [2:0] {IDLE, TEST, FAILED, LAST, LEAVE} state_e;

  state_e      state_d, state_q;
  logic        start, fails, tested_all, out_room, out_empty, fetch_idle;
  logic [23:0] tested_q;  // clusters that have been tested

  assign start      = state_q == IDLE && start_i;
  assign tested_all = tested_q == clusters_i;

  always_comb begin
    state_d = state_q;
    unique case (state_q)
      IDLE: begin
        if (start_i) begin
          state_d = TEST;
        end
      end
      TEST: begin
        if (tested_all) begin
          state_d = LAST;
        end
      end
      FAILED: begin
        if (fetch_idle) begin
          state_d = LAST;
        end
      end
      LAST: begin
        if (out_room) begin
          state_d = LEAVE;
        end
      end
      LEAVE: begin
        if (out_empty) begin
          state_d = IDLE;
        end
      end
      default: state_d = IDLE;
    endcase
    if (fails) begin
      state_d = FAILED;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
    end else begin
      state_q <= state_d;
    end
  end

  // ---- table ----------------------------------------------------------------------------------------

  logic             asks_q;  // the table is to be requested
  logic             request_ready;
  logic             beat_valid, beat_error, unused_tag;
  logic [Width-1:0] beat_data;
  logic             line_valid, line_pop, unused_room;
  logic [1:0][Width/2-1:0] line;  // two entries

  flk_axi_fetch #(
    .Places  (BufferBeats),
    .AddrBits(AXI_ADDR_BITS),
    .BeatBits(24),
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
    .in_valid_i (asks_q),
    .in_ready_o (request_ready),
    .in_beat_i  (table_i),
    .in_beats_i (24'(clusters_i[23:1]) + 24'(clusters_i[0])),
    .in_tag_i   (1'b0),
    .in_placed_i(1'b0),
    .freed_i    (line_valid && line_pop),
    .out_valid_o(beat_valid),
    .out_data_o (beat_data),
    .out_tag_o  (unused_tag),
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

  logic not_finite_q;  // the entry that was loaded has a float that is not

  assign fails = (beat_valid && beat_error) || not_finite_q;

  logic [0:0] unused_fifo_empty;

  flk_sram_fifo #(
    .Width(Width),
    .Depth(BufferBeats)
  ) i_buffer (
    .clk_i,
    .rst_ni,
    .clear_i    (state_q == FAILED),
    .in_valid_i (beat_valid),
    .in_ready_o (unused_room),
    .in_data_i  (beat_data),
    .out_valid_o(line_valid),
    .out_ready_i(line_pop),
    .out_data_o (line),
    .empty_o    (unused_fifo_empty[0])
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      asks_q <= 1'b0;
    end else if (start) begin
      asks_q <= clusters_i != '0;
    end else if (state_q == FAILED || request_ready) begin
      asks_q <= 1'b0;
    end
  end

  // ---- an entry -------------------------------------------------------------------------------------

  // As it lies in the table.
  typedef struct packed {
    logic [31:0]      first;
    logic [5:0]       slope;
    logic [1:0]       degree;
    logic [7:0]       last;
    logic [15:0]      sigma;  // upper half of a float32
    logic [2:0][31:0] high;
    logic [2:0][31:0] low;
  } entry_t;

  typedef struct packed {
    logic [19:0] first;
    logic [7:0]  last;
    logic [1:0]  degree;
  } about_t;

  function automatic cluster_t number(logic [31:0] float);
    return float[30:23] == '0 ? '0 : float;
  endfunction

  entry_t         entry;
  logic [6:0]     not_finite;  // box, sigma
  logic           entry_valid_d, entry_valid_q, half_q, load, take;
  logic [23:0]    loads_q;  // entries still to be loaded
  cluster_t [2:0] low_q, high_q;
  cluster_t       sigma_q;
  logic [5:0]     slope_q;
  about_t         about_q;

  assign entry         = line[half_q];
  assign load          = state_q == TEST && line_valid && loads_q != '0 && (!entry_valid_q || take);
  assign line_pop      = load && (half_q || loads_q == 24'd1);
  assign entry_valid_d = load || (entry_valid_q && !take);

  always_comb begin
    for (int unsigned k = 0; k < 3; k++) begin
      not_finite[k]   = &entry.low[k][30:23];
      not_finite[3+k] = &entry.high[k][30:23];
    end
    not_finite[6] = &entry.sigma[14:7];
  end

  // Seen while the entry goes into the test, which takes longer.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      not_finite_q <= 1'b0;
    end else begin
      not_finite_q <= load && not_finite != '0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      entry_valid_q <= 1'b0;
      half_q        <= 1'b0;
      loads_q       <= '0;
    end else if (start || state_q == FAILED) begin
      entry_valid_q <= 1'b0;
      half_q        <= 1'b0;
      loads_q       <= clusters_i;
    end else begin
      entry_valid_q <= entry_valid_d;
      if (load) begin
        half_q  <= !half_q;
        loads_q <= loads_q - 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (load) begin
      for (int unsigned k = 0; k < 3; k++) begin
        low_q[k]  <= number(entry.low[k]);
        high_q[k] <= number(entry.high[k]);
      end
      sigma_q <= number({entry.sigma, 16'b0});
      slope_q <= entry.slope;
      about_q <= '{first: entry.first[19:0], last: entry.last, degree: entry.degree};
    end
  end

  logic unused_entry;
  assign unused_entry = ^entry.first[31:20];

  // ---- test -----------------------------------------------------------------------------------------

  logic              move, at_output, kept;
  logic [PhaseBits-1:0] phase_q;
  logic [Inside-1:0] inside_q;  // there is a cluster, the youngest lowest
  about_t            about;

  assign take      = entry_valid_q && move && phase_q == '0;
  assign at_output = move && phase_q == OUT_PHASE && inside_q[Inside-1];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      phase_q  <= '0;
      inside_q <= '0;
    end else begin
      if (move) begin
        phase_q <= phase_q + 1'b1;
      end
      if (state_q == FAILED) begin
        inside_q <= '0;
      end else if (move && phase_q == '0) begin
        inside_q <= {inside_q[Inside-2:0], take};
      end
    end
  end

  flk_delay #(
    .Width($bits(about_t)),
    .Depth(Inside)
  ) i_about (
    .clk_i,
    .en_i(move && phase_q == '0),
    .d_i (about_q),
    .q_o (about)
  );

  // For the colour store
  cluster_t [2:0] low, high;
  logic [5:0]     slope;

  flk_delay_ram #(
    .Width(6 + $bits(low) + $bits(high)),
    .Depth(Inside)
  ) i_box (
    .clk_i,
    .rst_ni,
    .en_i(move && phase_q == '0),
    .d_i ({slope_q, low_q, high_q}),
    .q_o ({slope, low, high})
  );

  flk_cluster_test i_test (
    .clk_i,
    .en_i        (move),
    .phase_i     (phase_q),
    .low_0_i     (low_q[0]),
    .low_1_i     (low_q[1]),
    .low_2_i     (low_q[2]),
    .high_0_i    (high_q[0]),
    .high_1_i    (high_q[1]),
    .high_2_i    (high_q[2]),
    .sigma_i     (sigma_q),
    .position_0_i(setup_i.position[0]),
    .position_1_i(setup_i.position[1]),
    .position_2_i(setup_i.position[2]),
    .normal_00_i (setup_i.normal[0][0]),
    .normal_01_i (setup_i.normal[0][1]),
    .normal_02_i (setup_i.normal[0][2]),
    .normal_10_i (setup_i.normal[1][0]),
    .normal_11_i (setup_i.normal[1][1]),
    .normal_12_i (setup_i.normal[1][2]),
    .normal_20_i (setup_i.normal[2][0]),
    .normal_21_i (setup_i.normal[2][1]),
    .normal_22_i (setup_i.normal[2][2]),
    .normal_30_i (setup_i.normal[3][0]),
    .normal_31_i (setup_i.normal[3][1]),
    .normal_32_i (setup_i.normal[3][2]),
    .normal_40_i (setup_i.normal[4][0]),
    .normal_41_i (setup_i.normal[4][1]),
    .normal_42_i (setup_i.normal[4][2]),
    .offset_0_i  (setup_i.offset[0]),
    .offset_1_i  (setup_i.offset[1]),
    .offset_2_i  (setup_i.offset[2]),
    .offset_3_i  (setup_i.offset[3]),
    .offset_4_i  (setup_i.offset[4]),
    .reach_0_i   (setup_i.reach[0]),
    .reach_1_i   (setup_i.reach[1]),
    .reach_2_i   (setup_i.reach[2]),
    .reach_3_i   (setup_i.reach[3]),
    .reach_4_i   (setup_i.reach[4]),
    .keep_o      (kept)
  );

  always_ff @(posedge clk_i) begin
    if (start) begin
      tested_q <= '0;
    end else if (state_q == TEST && at_output) begin
      tested_q <= tested_q + 1'b1;
    end
  end

  // ---- counts and errors ----------------------------------------------------------------------------

  logic        error_q, damaged_q, done_q;
  logic [31:0] clusters_q, gaussians_q;

  always_ff @(posedge clk_i) begin
    if (start) begin
      clusters_q  <= '0;
      gaussians_q <= '0;
    end else if (state_q == TEST && at_output && !kept) begin
      clusters_q  <= clusters_q + 1'b1;
      gaussians_q <= gaussians_q + 32'(about.last) + 1'b1;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      error_q   <= 1'b0;
      damaged_q <= 1'b0;
      done_q    <= 1'b0;
    end else begin
      error_q   <= !start && (error_q || (beat_valid && beat_error));
      damaged_q <= !start && (damaged_q || not_finite_q);
      done_q    <= state_q == LEAVE && out_empty;
    end
  end

  // ---- kept clusters --------------------------------------------------------------------------------

  logic       unused_full;
  logic [1:0] unused_usage;
  kept_t      cluster;
  boxed_t     box;

  assign move    = out_room;
  assign cluster = '{index: tested_q, first: about.first, last: about.last, degree: about.degree};
  assign box     = '{index: tested_q, low: low, high: high, slope: slope};

  flk_fifo #(
    .Width(1 + $bits(kept_t) + $bits(boxed_t)),
    .Depth(2)
  ) i_out (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i ((state_q == TEST && at_output && kept) || state_q == LAST),
    .in_ready_o (out_room),
    .in_data_i  ({state_q == LAST, cluster, box}),
    .out_valid_o,
    .out_ready_i,
    .out_data_o ({out_end_o, out_cluster_o, out_box_o}),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (out_empty)
  );

  assign idle_o             = state_q == IDLE;
  assign done_o             = done_q;
  assign error_o            = error_q;
  assign damaged_o          = damaged_q;
  assign culled_clusters_o  = clusters_q;
  assign culled_gaussians_o = gaussians_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> state_q == IDLE)
  else $error("flk_cluster_cull: start while a frame is under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      state_q != IDLE |-> $stable({setup_i, table_i, clusters_i}))
  else $error("flk_cluster_cull: registers changed in a frame");

  assert property (@(posedge clk_i) disable iff (!rst_ni) beat_valid |-> unused_room)
  else $error("flk_cluster_cull: a beat without a place");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      state_q == LAST |-> fetch_idle && !line_valid)
  else $error("flk_cluster_cull: reads go on after the last cluster");
`endif

endmodule
