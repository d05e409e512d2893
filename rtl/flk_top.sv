// The chip: from a packed scene in memory to a frame buffer in memory (docs/reference/chip.md).
//
// A host writes a frame's descriptor through AXI4-Lite (docs/reference/registers.md) and starts it; flk_preprocessing makes records and tile
// lists of the scene, flk_rendering makes the picture of them. Both halves work at the same time, on frames that follow
// each other (flk_frame_control). One AXI4 port for all memory, of PortBits: with 512 records are read as narrow beats of 256 bits, with
// less all beats are whole (flk_axi_downsizer); who waits for whom is stated in flk_axi_arbiter and flk_top_pkg.
//
// control.abort: nothing more is asked of the memory, what has been asked for comes, then both halves are reset and all frames
// are forgotten. No answer of the memory for timeout.cycles: status.dead, nothing works until control.reset.
// control.reset: the same at once; the memory's side of the port must be in reset from before the write until
// status.aborting is 0.
// The clock of a half stands still while it is idle and no frame is in its place (flk_clock_gate).
// test_en_i (scan test, 0 in use): both clocks run, both halves are reset by rst_ni alone.
// irq_o: a waiting interrupt that is enabled. Outputs depend on registers alone; w_ready_i and b_* reach
// the writers combinationally.
module flk_top
  import flk_axi_pkg::*;
  import flk_counter_pkg::*;
  import flk_param_pkg::*;
  import flk_preproc_pkg::*;
  import flk_rendering_pkg::*;
  import flk_top_pkg::*;
#(
  parameter  int unsigned Stage          = STAGE_CHANNELS,  // the next ones are its parameters
  parameter  int unsigned Form           = FORM_FACTORED,   // of records too: 16 bytes, conic 32
  parameter  int unsigned Precision      = PRECISION_FIXED,
  parameter  int unsigned FifoDepth      = FIFO_DEPTH,
  parameter  int unsigned CtuFifoDepth   = CTU_FIFO_DEPTH,
  parameter  int unsigned VrusPerChannel = VRUS_PER_CHANNEL,
  parameter  int unsigned MaskGenerator  = MASK_GENERATOR_CTU,
  parameter  int unsigned Cores          = CORES,  // of lanes: 1, 2 or 4
  parameter  int unsigned Lanes          = 32,     // of all cores
  parameter  int unsigned Slots          = flk_lane_pkg::LANE_SLOTS,
  parameter  int unsigned Depth          = flk_lane_pkg::LANE_QUEUE_DEPTH,
  parameter  int unsigned InWidth        = 1,     // records a cycle of each core: 1, with lanes 2
  parameter  int unsigned SortUnits      = 4,     // 1, 2 or 4: sorting units and list readers
  parameter  int unsigned SortStages     = 7,     // sizes of memories: flk_rendering
  parameter  int unsigned SortWays       = 8,
  parameter  int unsigned MergeLines     = 128,
  parameter  int unsigned Chunks         = 8,
  parameter  int unsigned Entries        = 704,
  parameter  int unsigned Queue          = 128,
  parameter  int unsigned Pairs          = 4,
  parameter  int unsigned RecordLines    = 1024,
  parameter  int unsigned PreprocLanes   = 4,     // 1, 2 or 4
  parameter  int unsigned PreprocInterval = 2,    // cycles a Gaussian of a lane: 2 or 4
  parameter  int unsigned ListWriters    = 4,     // 1, 2 or 4, for four banks of lists
  parameter  bit          ColourStore    = 1'b1,  // colours can be kept; not with FORM_CONIC
  parameter  int unsigned Waiting        = 128,   // and flk_preprocessing
  parameter  int unsigned Gather         = 216,   // of flk_preprocessing
  parameter  int unsigned Pointers       = 2048,  // of a list writer on the chip: up to 1920x1088
  parameter  int unsigned Lists          = 16384, // of a list writer at most: up to 4096x4096
  parameter  int unsigned Patience       = 16,    // of the memory port's arbiters
  parameter  int unsigned PortBits       = 512,   // of the memory port: 128, 256, 512
  localparam int unsigned PortIdBits     = AXI_ID_BITS + 3,
  localparam int unsigned AddrBits       = AXI_ADDR_BITS,
  localparam int unsigned RegisterBits   = flk_registers_pkg::FLK_REGISTERS_MIN_ADDR_WIDTH
) (
  input  logic                    clk_i,
  input  logic                    rst_ni,
  input  logic                    test_en_i,  // scan test: clock gates open, resets are rst_ni
  output logic                    irq_o,
  // Registers: AXI4-Lite
  input  logic                    reg_aw_valid_i,
  output logic                    reg_aw_ready_o,
  input  logic [RegisterBits-1:0] reg_aw_addr_i,
  input  logic [2:0]              reg_aw_prot_i,
  input  logic                    reg_w_valid_i,
  output logic                    reg_w_ready_o,
  input  logic [31:0]             reg_w_data_i,
  input  logic [3:0]              reg_w_strb_i,
  output logic                    reg_b_valid_o,
  input  logic                    reg_b_ready_i,
  output logic [1:0]              reg_b_resp_o,
  input  logic                    reg_ar_valid_i,
  output logic                    reg_ar_ready_o,
  input  logic [RegisterBits-1:0] reg_ar_addr_i,
  input  logic [2:0]              reg_ar_prot_i,
  output logic                    reg_r_valid_o,
  input  logic                    reg_r_ready_i,
  output logic [31:0]             reg_r_data_o,
  output logic [1:0]              reg_r_resp_o,
  // Memory: AXI4
  output logic                    ar_valid_o,
  input  logic                    ar_ready_i,
  output logic [PortIdBits-1:0]   ar_id_o,
  output logic [AddrBits-1:0]     ar_addr_o,
  output logic [7:0]              ar_len_o,
  output logic [2:0]              ar_size_o,
  output logic [1:0]              ar_burst_o,
  output logic [3:0]              ar_qos_o,
  input  logic                    r_valid_i,
  output logic                    r_ready_o,
  input  logic [PortIdBits-1:0]   r_id_i,
  input  logic [PortBits-1:0]     r_data_i,
  input  logic [1:0]              r_resp_i,
  input  logic                    r_last_i,
  output logic                    aw_valid_o,
  input  logic                    aw_ready_i,
  output logic [PortIdBits-1:0]   aw_id_o,
  output logic [AddrBits-1:0]     aw_addr_o,
  output logic [7:0]              aw_len_o,
  output logic [2:0]              aw_size_o,
  output logic [1:0]              aw_burst_o,
  output logic [3:0]              aw_qos_o,
  output logic                    w_valid_o,
  input  logic                    w_ready_i,
  output logic [PortBits-1:0]     w_data_o,
  output logic [PortBits/8-1:0]   w_strb_o,
  output logic                    w_last_o,
  input  logic                    b_valid_i,
  output logic                    b_ready_o,
  input  logic [PortIdBits-1:0]   b_id_i,
  input  logic [1:0]              b_resp_i
);

  localparam int unsigned Width = AXI_DATA_BITS;  // of a line, which units read and write
  localparam bit Keeps = ColourStore && Form == FORM_FACTORED;

  if (PortBits != 128 && PortBits != 256 && PortBits != Width) begin : gen_check_port
    $error("flk_top: PortBits must be 128, 256 or 512");
  end

  // ---- registers --------------------------------------------------------------------------------------

  flk_registers_pkg::flk_registers__in_t  to_host;
  flk_registers_pkg::flk_registers__out_t from_host;
  descriptor_t                            descriptor;

  flk_registers i_registers (
    .clk_i,
    .rst_ni,
    .s_axil_awready(reg_aw_ready_o),
    .s_axil_awvalid(reg_aw_valid_i),
    .s_axil_awaddr (reg_aw_addr_i),
    .s_axil_awprot (reg_aw_prot_i),
    .s_axil_wready (reg_w_ready_o),
    .s_axil_wvalid (reg_w_valid_i),
    .s_axil_wdata  (reg_w_data_i),
    .s_axil_wstrb  (reg_w_strb_i),
    .s_axil_bready (reg_b_ready_i),
    .s_axil_bvalid (reg_b_valid_o),
    .s_axil_bresp  (reg_b_resp_o),
    .s_axil_arready(reg_ar_ready_o),
    .s_axil_arvalid(reg_ar_valid_i),
    .s_axil_araddr (reg_ar_addr_i),
    .s_axil_arprot (reg_ar_prot_i),
    .s_axil_rready (reg_r_ready_i),
    .s_axil_rvalid (reg_r_valid_o),
    .s_axil_rdata  (reg_r_data_o),
    .s_axil_rresp  (reg_r_resp_o),
    .hwif_in       (to_host),
    .hwif_out      (from_host)
  );

  flk_descriptor i_descriptor (
    .registers_i (from_host),
    .descriptor_o(descriptor)
  );

  assign irq_o = from_host.interrupt.intr;

  // ---- abort, time-out, reset -----------------------------------------------------------------------

  localparam int unsigned ResetCycles = 8;

  typedef enum logic [1:0] {RUN, DRAIN, DEAD, RESET} state_e;

  state_e                           state_q;
  logic [$clog2(ResetCycles+1)-1:0] reset_q;
  logic                             units_rst_nq, aborted_q, abort_q, dead_q;
  logic                             front_rst_nq, front_rst_n, rendering_rst_nq, rendering_rst_n;
  logic                             drained, stuck, forget, hold;
  logic                             front_reset, rendering_reset;  // of a half that is stopped

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q      <= RESET;
      reset_q      <= '0;
      units_rst_nq     <= 1'b0;
      front_rst_nq     <= 1'b0;
      rendering_rst_nq <= 1'b0;
      aborted_q    <= 1'b0;
      abort_q      <= 1'b0;
      dead_q       <= 1'b0;
    end else begin
      aborted_q    <= 1'b0;
      dead_q       <= state_q == DEAD;
      units_rst_nq     <= state_q != RESET;
      front_rst_nq     <= state_q != RESET && !front_reset;
      rendering_rst_nq <= state_q != RESET && !rendering_reset;
      reset_q      <= state_q == RESET ? reset_q + 1'b1 : '0;
      if (from_host.control.reset.value) begin
        state_q <= RESET;
        reset_q <= '0;
        abort_q <= 1'b0;
      end else begin
        unique case (state_q)
          RUN: begin
            if (stuck) begin
              state_q <= DEAD;
            end else if (from_host.control.abort.value) begin
              state_q <= DRAIN;
              abort_q <= 1'b1;
            end
          end
          DRAIN: begin
            if (stuck) begin
              state_q <= DEAD;
            end else if (drained) begin
              state_q <= RESET;
            end
          end
          DEAD: ;
          default: begin  // RESET: an abort that comes here has nothing to forget, but is told
            abort_q <= abort_q || from_host.control.abort.value;
            if (32'(reset_q) == ResetCycles - 1) begin
              state_q   <= RUN;
              aborted_q <= abort_q || from_host.control.abort.value;
              abort_q   <= 1'b0;
            end
          end
        endcase
      end
    end
  end

  assign front_rst_n     = rst_ni && (test_en_i || front_rst_nq);
  assign rendering_rst_n = rst_ni && (test_en_i || rendering_rst_nq);

  assign hold   = state_q != RUN;
  assign forget = state_q == RESET;

  // ---- frames -----------------------------------------------------------------------------------------

  logic                 start, locked, refused, front_done, post, bank, acknowledged;
  logic [15:0]          tag, pairs, started, finished;
  frame_error_t         frame_error, failure;
  logic                 front_busy, rendering_busy;
  logic                 front_start, front_idle, front_end, front_stop, front_stopped;
  logic [FRONT_ERRORS-1:0] front_error;
  front_registers_t     front;
  logic                 rendering_start, rendering_idle, rendering_end;
  logic                 rendering_stop, pairs_stopped, rendering_drained;
  logic [15:0]          rendering_left;
  logic [2:0]           rendering_error;
  rendering_registers_t rendering;
  logic                 copy_front, copy_front_bank, copy_front_none, copy_front_done;
  logic                 copy_rendering, copy_rendering_bank, copy_rendering_none;
  logic                 copy_rendering_done, timed_out_q;
  logic [3:0][31:0]     stamps;
  logic [31:0]          now_q;

  // frame_done is set in the cycle behind post, in which no acknowledgement counts.
  always_comb begin
    failure      = frame_error;
    failure.late = 1'b0;
  end

  assign start        = from_host.control.start.value && state_q == RUN;
  assign acknowledged = !from_host.interrupt.frame_done.value;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      timed_out_q <= 1'b0;
      now_q       <= '0;
    end else begin
      timed_out_q <= frame_error.timed_out;
      now_q       <= now_q + 1'b1;
    end
  end

  flk_frame_control #(
    .Lists      (Lists),
    .ColourStore(Keeps)
  ) i_control (
    .clk_i,
    .rst_ni,
    .clear_i              (hold),
    .aborted_i            (state_q == DRAIN),
    .timed_out_i          (state_q == DEAD),
    .reset_i              (from_host.control.reset.value),
    .now_i                (now_q),
    .start_i              (start),
    .descriptor_i         (descriptor),
    .locked_o             (locked),
    .refused_o            (refused),
    .front_done_o         (front_done),
    .post_o               (post),
    .tag_o                (tag),
    .error_o              (frame_error),
    .pairs_o              (pairs),
    .bank_o               (bank),
    .acknowledged_i       (acknowledged),
    .started_o            (started),
    .finished_o           (finished),
    .front_busy_o         (front_busy),
    .rendering_busy_o     (rendering_busy),
    .front_start_o        (front_start),
    .front_idle_i         (front_idle),
    .front_done_i         (front_end),
    .front_error_i        (front_error),
    .front_o              (front),
    .front_stop_o         (front_stop),
    .front_stopped_i      (front_stopped),
    .front_reset_o        (front_reset),
    .rendering_start_o    (rendering_start),
    .rendering_idle_i     (rendering_idle),
    .rendering_done_i     (rendering_end),
    .rendering_error_i    (rendering_error),
    .rendering_o          (rendering),
    .rendering_stop_o     (rendering_stop),
    .rendering_stopped_i  (pairs_stopped && rendering_drained),
    .rendering_reset_o    (rendering_reset),
    .rendering_left_i     (rendering_left),
    .copy_front_o         (copy_front),
    .copy_front_bank_o    (copy_front_bank),
    .copy_front_none_o    (copy_front_none),
    .copy_front_done_i    (copy_front_done),
    .copy_rendering_o     (copy_rendering),
    .copy_rendering_bank_o(copy_rendering_bank),
    .copy_rendering_none_o(copy_rendering_none),
    .stamps_o             (stamps),
    .copy_rendering_done_i(copy_rendering_done)
  );

  // ---- memory port --------------------------------------------------------------------------------------

  // Of the halves, the rendering half's first. A beat of reads and an answer go to all of them.
  logic    [READERS-1:0] ar_valid, ar_ready, port_ar_valid, port_ar_ready;
  logic    [READERS-1:0] r_valid, r_ready, read_ends;
  axi_ax_t [READERS-1:0] ar;
  axi_r_t                r;
  logic    [WRITERS-1:0] aw_valid, aw_ready, port_aw_valid, port_aw_ready;
  logic    [WRITERS-1:0] w_valid, w_ready, b_valid, b_ready;
  axi_ax_t [WRITERS-1:0] aw;
  axi_w_t  [WRITERS-1:0] w;
  axi_b_t                b;
  // Field by field, for the arbiter.
  logic [READERS-1:0][AXI_ID_BITS-1:0] ar_id;
  logic [READERS-1:0][AddrBits-1:0]    ar_addr;
  logic [READERS-1:0][7:0]             ar_len;
  logic [READERS-1:0][2:0]             ar_size;
  logic [WRITERS-1:0][AXI_ID_BITS-1:0] aw_id;
  logic [WRITERS-1:0][AddrBits-1:0]    aw_addr;
  logic [WRITERS-1:0][7:0]             aw_len;
  logic [WRITERS-1:0][2:0]             aw_size;
  logic [WRITERS-1:0][Width-1:0]       w_data;
  logic [WRITERS-1:0][Width/8-1:0]     w_strb;
  logic                                line_ar_valid, line_ar_ready, line_aw_valid, line_aw_ready;
  logic                                line_r_valid, line_r_last, unused_line_r_ready;  // always 1
  logic                                line_w_valid, line_w_ready, line_w_last;
  logic                                line_b_valid, line_b_ready;
  logic [PortIdBits-1:0]               line_ar_id, line_r_id, line_aw_id, line_b_id;
  logic [AddrBits-1:0]                 line_ar_addr, line_aw_addr;
  logic [7:0]                          line_ar_len, line_aw_len;
  logic [2:0]                          line_ar_size, line_aw_size;
  logic [1:0]                          line_ar_burst, line_aw_burst, line_r_resp, line_b_resp;
  logic [3:0]                          line_ar_qos, line_aw_qos;
  logic [Width-1:0]                    line_r_data, line_w_data;
  logic [Width/8-1:0]                  line_w_strb;

  for (genvar k = 0; k < READERS; k++) begin : gen_reader
    logic [1:0] unused_burst;  // INCR
    assign {ar_id[k], ar_addr[k], ar_len[k], ar_size[k], unused_burst} = ar[k];
  end
  for (genvar k = 0; k < WRITERS; k++) begin : gen_writer
    logic [1:0] unused_burst;
    logic       unused_last;  // of w: the arbiter counts beats
    assign {aw_id[k], aw_addr[k], aw_len[k], aw_size[k], unused_burst} = aw[k];
    assign {unused_last, w_strb[k], w_data[k]} = w[k];
  end

  flk_axi_arbiter #(
    .Readers (READERS),
    .Writers (WRITERS),
    .AddrBits(AddrBits),
    .Width   (Width),
    .IdBits  (AXI_ID_BITS),
    .Patience(Patience)
  ) i_port (
    .clk_i,
    .rst_ni,
    .hold_i    (hold),
    .drained_o (drained),
    .clear_i   (forget),
    .timeout_i (from_host.timeout.cycles.value),
    .stuck_o   (stuck),
    .ar_valid_i(port_ar_valid),
    .ar_ready_o(port_ar_ready),
    .ar_id_i   (ar_id),
    .ar_addr_i (ar_addr),
    .ar_len_i  (ar_len),
    .ar_size_i (ar_size),
    .r_valid_o (r_valid),
    .r_id_o    (r.id),
    .r_data_o  (r.data),
    .r_resp_o  (r.resp),
    .r_last_o  (r.last),
    .aw_valid_i(port_aw_valid),
    .aw_ready_o(port_aw_ready),
    .aw_id_i   (aw_id),
    .aw_addr_i (aw_addr),
    .aw_len_i  (aw_len),
    .aw_size_i (aw_size),
    .w_valid_i (w_valid),
    .w_ready_o (w_ready),
    .w_data_i  (w_data),
    .w_strb_i  (w_strb),
    .b_valid_o (b_valid),
    .b_id_o    (b.id),
    .b_resp_o  (b.resp),
    .ar_valid_o(line_ar_valid),
    .ar_ready_i(line_ar_ready),
    .ar_id_o   (line_ar_id),
    .ar_addr_o (line_ar_addr),
    .ar_len_o  (line_ar_len),
    .ar_size_o (line_ar_size),
    .ar_burst_o(line_ar_burst),
    .ar_qos_o  (line_ar_qos),
    .r_valid_i (line_r_valid),
    .r_ready_o (unused_line_r_ready),
    .r_id_i    (line_r_id),
    .r_data_i  (line_r_data),
    .r_resp_i  (line_r_resp),
    .r_last_i  (line_r_last),
    .aw_valid_o(line_aw_valid),
    .aw_ready_i(line_aw_ready),
    .aw_id_o   (line_aw_id),
    .aw_addr_o (line_aw_addr),
    .aw_len_o  (line_aw_len),
    .aw_size_o (line_aw_size),
    .aw_burst_o(line_aw_burst),
    .aw_qos_o  (line_aw_qos),
    .w_valid_o (line_w_valid),
    .w_ready_i (line_w_ready),
    .w_data_o  (line_w_data),
    .w_strb_o  (line_w_strb),
    .w_last_o  (line_w_last),
    .b_valid_i (line_b_valid),
    .b_ready_o (line_b_ready),
    .b_id_i    (line_b_id),
    .b_resp_i  (line_b_resp)
  );

  flk_axi_downsizer #(
    .AddrBits(AddrBits),
    .Width   (Width),
    .PortBits(PortBits),
    .IdBits  (PortIdBits),
    .OwnBits (AXI_ID_BITS),
    .UsedBits(READ_ID_BITS)
  ) i_downsizer (
    .clk_i,
    .rst_ni,
    .clear_i      (forget),
    .in_ar_valid_i(line_ar_valid),
    .in_ar_ready_o(line_ar_ready),
    .in_ar_id_i   (line_ar_id),
    .in_ar_addr_i (line_ar_addr),
    .in_ar_len_i  (line_ar_len),
    .in_ar_size_i (line_ar_size),
    .in_ar_burst_i(line_ar_burst),
    .in_ar_qos_i  (line_ar_qos),
    .in_r_valid_o (line_r_valid),
    .in_r_id_o    (line_r_id),
    .in_r_data_o  (line_r_data),
    .in_r_resp_o  (line_r_resp),
    .in_r_last_o  (line_r_last),
    .in_aw_valid_i(line_aw_valid),
    .in_aw_ready_o(line_aw_ready),
    .in_aw_id_i   (line_aw_id),
    .in_aw_addr_i (line_aw_addr),
    .in_aw_len_i  (line_aw_len),
    .in_aw_size_i (line_aw_size),
    .in_aw_burst_i(line_aw_burst),
    .in_aw_qos_i  (line_aw_qos),
    .in_w_valid_i (line_w_valid),
    .in_w_ready_o (line_w_ready),
    .in_w_data_i  (line_w_data),
    .in_w_strb_i  (line_w_strb),
    .in_w_last_i  (line_w_last),
    .in_b_valid_o (line_b_valid),
    .in_b_ready_i (line_b_ready),
    .in_b_id_o    (line_b_id),
    .in_b_resp_o  (line_b_resp),
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o,
    .ar_addr_o,
    .ar_len_o,
    .ar_size_o,
    .ar_burst_o,
    .ar_qos_o,
    .r_valid_i,
    .r_ready_o,
    .r_id_i,
    .r_data_i,
    .r_resp_i,
    .r_last_i,
    .aw_valid_o,
    .aw_ready_i,
    .aw_id_o,
    .aw_addr_o,
    .aw_len_o,
    .aw_size_o,
    .aw_burst_o,
    .aw_qos_o,
    .w_valid_o,
    .w_ready_i,
    .w_data_o,
    .w_strb_o,
    .w_last_o,
    .b_valid_i,
    .b_ready_o,
    .b_id_i,
    .b_resp_i
  );

  logic [23:0] front_cluster;  // of the table, that the front end is at
  logic        few;            // of its bursts

  flk_front_throttle i_throttle (
    .clk_i,
    .rst_ni,
    .clear_i   (forget || rendering_reset),
    .start_i   (rendering_start),
    .done_i    (rendering_end),
    .pairs_i   (rendering.all_pairs),
    .left_i    (rendering_left),
    .clusters_i(front.clusters),
    .cluster_i (front_cluster),
    .few_o     (few)
  );

  // A half that is stopped asks for nothing more. The rendering half goes on writing until the pairs of tiles that it has begun are there.
  flk_axi_hold #(
    .Readers(READERS - RENDERING_READERS),
    .Writers(WRITERS - RENDERING_WRITERS)
  ) i_front_hold (
    .clk_i,
    .rst_ni,
    .clear_i      (forget),
    .hold_reads_i (front_stop),
    .hold_writes_i(front_stop),
    .drained_o    (front_stopped),
    .few_i        (few),
    .ar_valid_i   (ar_valid[READERS-1:RENDERING_READERS]),
    .ar_ready_o   (ar_ready[READERS-1:RENDERING_READERS]),
    .aw_valid_i   (aw_valid[WRITERS-1:RENDERING_WRITERS]),
    .aw_ready_o   (aw_ready[WRITERS-1:RENDERING_WRITERS]),
    .ar_valid_o   (port_ar_valid[READERS-1:RENDERING_READERS]),
    .ar_ready_i   (port_ar_ready[READERS-1:RENDERING_READERS]),
    .aw_valid_o   (port_aw_valid[WRITERS-1:RENDERING_WRITERS]),
    .aw_ready_i   (port_aw_ready[WRITERS-1:RENDERING_WRITERS]),
    .r_last_i     (read_ends[READERS-1:RENDERING_READERS]),
    .b_valid_i    (b_valid[WRITERS-1:RENDERING_WRITERS])
  );

  flk_axi_hold #(
    .Readers(RENDERING_READERS),
    .Writers(RENDERING_WRITERS)
  ) i_rendering_hold (
    .clk_i,
    .rst_ni,
    .clear_i      (forget),
    .hold_reads_i (rendering_stop),
    .hold_writes_i(rendering_stop && pairs_stopped),
    .drained_o    (rendering_drained),
    .few_i        (1'b0),
    .ar_valid_i   (ar_valid[RENDERING_READERS-1:0]),
    .ar_ready_o   (ar_ready[RENDERING_READERS-1:0]),
    .aw_valid_i   (aw_valid[RENDERING_WRITERS-1:0]),
    .aw_ready_o   (aw_ready[RENDERING_WRITERS-1:0]),
    .ar_valid_o   (port_ar_valid[RENDERING_READERS-1:0]),
    .ar_ready_i   (port_ar_ready[RENDERING_READERS-1:0]),
    .aw_valid_o   (port_aw_valid[RENDERING_WRITERS-1:0]),
    .aw_ready_i   (port_aw_ready[RENDERING_WRITERS-1:0]),
    .r_last_i     (read_ends[RENDERING_READERS-1:0]),
    .b_valid_i    (b_valid[RENDERING_WRITERS-1:0])
  );

  assign read_ends = r_valid & {READERS{r.last}};

  // ---- halves -------------------------------------------------------------------------------------------

  logic front_clk, rendering_clk;

  flk_clock_gate i_front_clock (
    .clk_i,
    .en_i     (front_busy || !front_idle || !units_rst_nq),
    .test_en_i,
    .clk_o    (front_clk)
  );

  flk_clock_gate i_rendering_clock (
    .clk_i,
    .en_i     (rendering_busy || !rendering_idle || !units_rst_nq),
    .test_en_i,
    .clk_o    (rendering_clk)
  );

  front_counters_t     front_counters;
  rendering_counters_t rendering_counters;
  logic [COUNTER_ADDR_BITS-1:0] stage_addr;
  logic [COUNTER_BITS-1:0]      stage_data;

  flk_preprocessing #(
    .Form           (Form),
    .PreprocLanes   (PreprocLanes),
    .PreprocInterval(PreprocInterval),
    .ListWriters    (ListWriters),
    .ColourStore    (ColourStore),
    .Pointers       (Pointers),
    .Lists          (Lists),
    .Gather         (Gather),
    .Waiting        (Waiting)
  ) i_front (
    .clk_i      (front_clk),
    .rst_ni     (front_rst_n),
    .start_i    (front_start),
    .idle_o     (front_idle),
    .done_o     (front_end),
    .cluster_o  (front_cluster),
    .registers_i(front),
    .error_o    (front_error),
    .counters_o (front_counters),
    .ar_valid_o (ar_valid[READERS-1:RENDERING_READERS]),
    .ar_ready_i (ar_ready[READERS-1:RENDERING_READERS]),
    .ar_o       (ar[READERS-1:RENDERING_READERS]),
    .r_valid_i  (r_valid[READERS-1:RENDERING_READERS]),
    .r_ready_o  (r_ready[READERS-1:RENDERING_READERS]),
    .r_i        ({FRONT_READERS{r}}),
    .aw_valid_o (aw_valid[WRITERS-1:RENDERING_WRITERS]),
    .aw_ready_i (aw_ready[WRITERS-1:RENDERING_WRITERS]),
    .aw_o       (aw[WRITERS-1:RENDERING_WRITERS]),
    .w_valid_o  (w_valid[WRITERS-1:RENDERING_WRITERS]),
    .w_ready_i  (w_ready[WRITERS-1:RENDERING_WRITERS]),
    .w_o        (w[WRITERS-1:RENDERING_WRITERS]),
    .b_valid_i  (b_valid[WRITERS-1:RENDERING_WRITERS]),
    .b_ready_o  (b_ready[WRITERS-1:RENDERING_WRITERS]),
    .b_i        ({FRONT_WRITERS{b}})
  );

  flk_rendering #(
    .Stage         (Stage),
    .Form          (Form),
    .Precision     (Precision),
    .FifoDepth     (FifoDepth),
    .CtuFifoDepth  (CtuFifoDepth),
    .VrusPerChannel(VrusPerChannel),
    .MaskGenerator (MaskGenerator),
    .Cores         (Cores),
    .Lanes         (Lanes),
    .Slots         (Slots),
    .Depth         (Depth),
    .InWidth       (InWidth),
    .SortUnits     (SortUnits),
    .SortStages    (SortStages),
    .SortWays      (SortWays),
    .MergeLines    (MergeLines),
    .Chunks        (Chunks),
    .Entries       (Entries),
    .Queue         (Queue),
    .Pairs         (Pairs),
    .RecordLines   (RecordLines)
  ) i_rendering (
    .clk_i         (rendering_clk),
    .rst_ni        (rendering_rst_n),
    .start_i       (rendering_start),
    .idle_o        (rendering_idle),
    .registers_i   (rendering),
    .done_o        (rendering_end),
    .error_o       (rendering_error),
    .stop_i        (rendering_stop),
    .stopped_o     (pairs_stopped),
    .left_o        (rendering_left),
    .counters_o    (rendering_counters),
    .counter_addr_i(stage_addr),
    .counter_data_o(stage_data),
    .ar_valid_o    (ar_valid[RENDERING_READERS-1:0]),
    .ar_ready_i    (ar_ready[RENDERING_READERS-1:0]),
    .ar_o          (ar[RENDERING_READERS-1:0]),
    .r_valid_i     (r_valid[RENDERING_READERS-1:0]),
    .r_ready_o     (r_ready[RENDERING_READERS-1:0]),
    .r_i           ({RENDERING_READERS{r}}),
    .aw_valid_o    (aw_valid[0]),
    .aw_ready_i    (aw_ready[0]),
    .aw_o          (aw[0]),
    .w_valid_o     (w_valid[0]),
    .w_ready_i     (w_ready[0]),
    .w_o           (w[0]),
    .b_valid_i     (b_valid[0]),
    .b_ready_o     (b_ready[0]),
    .b_i           (b)
  );

  // ---- counters -------------------------------------------------------------------------------------------

  logic [FRONT_WORDS-1:0][31:0]     front_words;
  logic [RENDERING_WORDS-1:0][31:0] rendering_words;
  logic [LIVE_WORDS-1:0][31:0]      live_q;
  logic [LIVE_WORDS-1:1]            event_q;
  logic                             unused_ready;
  logic [9:0]                       counter_index;
  logic [31:0]                      kept_value, live_value_q;
  logic                             live_q_chosen, kept_chosen, posted_q;

  assign front_words     = front_counter_words(front_counters);
  assign rendering_words = rendering_counter_words(rendering_counters, stamps);

  flk_frame_counters i_counters (
    .clk_i,
    .rst_ni,
    .clear_i          (hold),
    .front_valid_i    (copy_front),
    .front_bank_i     (copy_front_bank),
    .front_none_i     (copy_front_none),
    .front_words_i    (front_words),
    .front_done_o     (copy_front_done),
    .rendering_valid_i(copy_rendering),
    .rendering_bank_i (copy_rendering_bank),
    .rendering_none_i (copy_rendering_none),
    .rendering_words_i(rendering_words),
    .counter_addr_o   (stage_addr),
    .counter_data_i   (stage_data),
    .rendering_done_o (copy_rendering_done),
    .bank_i           (bank),
    .addr_i           (counter_index[7:0]),
    .value_o          (kept_value)
  );

  // Those that run on: cycles; beats by reader and writer; cycles in which an address waits; in which data wait.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      live_q  <= '0;
      event_q <= '0;
    end else begin
      event_q   <= {line_w_valid && !line_w_ready, aw_valid & ~aw_ready, ar_valid & ~ar_ready,
                    w_valid & w_ready, r_valid};
      live_q[0] <= live_q[0] + 1'b1;
      for (int unsigned k = 1; k < LIVE_WORDS; k++) begin
        live_q[k] <= live_q[k] + 32'(event_q[k]);
      end
    end
  end

  assign unused_ready  = ^{r_ready, b_ready};  // 1 whenever it matters
  assign counter_index = from_host.counter_select.index.value;
  assign live_q_chosen = 32'(counter_index) >= COUNTER_LIVE &&
                         32'(counter_index) < COUNTER_LIVE + LIVE_WORDS;

  // Words of frames exist once one has been posted; the others that nothing writes are none.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      posted_q <= 1'b0;
    end else begin
      posted_q <= !from_host.control.reset.value && (posted_q || post);
    end
  end

  assign kept_chosen = posted_q && (
      32'(counter_index) < COUNTER_RENDERING + RENDERING_WORDS ||
      (32'(counter_index) >= COUNTER_FRONT_WAITS &&
       32'(counter_index) < COUNTER_FRONT_WAITS + FRONT_WAITS) ||
      (32'(counter_index) >= COUNTER_STAGE &&
       32'(counter_index) < COUNTER_STAGE + 2 ** COUNTER_ADDR_BITS));

  always_ff @(posedge clk_i) begin
    live_value_q <= live_q[counter_index[$clog2(LIVE_WORDS)-1:0]];
  end

  // ---- to the host ------------------------------------------------------------------------------------------

  assign to_host.descriptor_locked           = locked;
  assign to_host.capability.stage.next       = 4'(Stage);
  assign to_host.capability.form.next        = 2'(Form);
  assign to_host.capability.precision.next   = 2'(Precision);
  assign to_host.capability.vrus.next        = 4'(VrusPerChannel);
  assign to_host.capability.mask_generator.next =
      4'(MaskGenerator);
  assign to_host.capability.log2_lanes.next  = 4'($clog2(Lanes));
  assign to_host.capability.log2_lists.next  = 4'($clog2(Lists));
  assign to_host.capability.log2_beat.next   = 4'($clog2(PortBits / 8));
  assign to_host.capability.colour_store.next = Keeps;
  assign to_host.capability_units.log2.next  =
      {4'($clog2(SortUnits)), 4'($clog2(ListWriters)), 4'($clog2(PreprocLanes)), 4'($clog2(Cores))};
  assign to_host.capability_units.log2_interval.next = 4'($clog2(PreprocInterval));
  assign to_host.status.ready.next           = !locked && state_q == RUN;
  assign to_host.status.front_busy.next      = front_busy;
  assign to_host.status.render_busy.next     = rendering_busy;
  assign to_host.status.aborting.next        = state_q == DRAIN || state_q == RESET;
  assign to_host.status.dead.next            = state_q == DEAD;
  assign to_host.interrupt.front_done.next   = front_done;
  assign to_host.interrupt.frame_done.next   = post;
  assign to_host.interrupt.frame_done.hwclr  = from_host.control.reset.value;
  // A late frame is no surprise. A time-out is told at once; and when result shows it, which may be later, when a frame has been released.
  assign to_host.interrupt.error.next        = (post && failure != '0) ||
                                               (state_q == DEAD && !dead_q) ||
                                               (frame_error.timed_out && !timed_out_q);
  assign to_host.interrupt.aborted.next      = aborted_q;
  assign to_host.interrupt.refused.next      = refused || (from_host.control.start.value && !start);
  assign to_host.result.tag.next             = tag;
  assign to_host.progress.pairs.next         = pairs;
  assign to_host.result.error.next           = 16'(frame_error);
  assign to_host.frames.started.next         = started;
  assign to_host.frames.finished.next        = finished;
  assign to_host.counter_value.value.next    = live_q_chosen ? live_value_q
                                               : kept_chosen ? kept_value : '0;

`ifndef SYNTHESIS
  for (genvar k = 0; k < READERS; k++) begin : gen_check_reader
    assert property (@(posedge clk_i) disable iff (!units_rst_nq) r_valid[k] |-> r_ready[k])
    else $error("flk_top: a reader does not take what it asked for");
  end
  for (genvar k = 0; k < WRITERS; k++) begin : gen_check_writer
    assert property (@(posedge clk_i) disable iff (!units_rst_nq) b_valid[k] |-> b_ready[k])
    else $error("flk_top: a writer does not take its answer");
  end
`endif

endmodule
