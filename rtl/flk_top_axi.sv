// The chip with the pins of AMBA: flk_top between an AXI4-Lite subordinate (s_axil_*) and an AXI4 manager (m_axi_*), all side
// signals included, as tools infer interfaces from (docs/reference/chip_ports.md).
//
// No logic but the reset: latency and combinational paths are those of flk_top. One clock for both interfaces. Identifiers have the chip's
// bits in the low ones of IdWidth, zeros above; answers must bring them back so. Constant: LOCK 0 (no exclusive access), CACHE and PROT
// (parameters), REGION 0, USER 0; QOS says how urgent an access is. PROT of the registers and USER of answers are not looked at.
// ResetStages: 0: aresetn goes to the chip as it is, its release in time with aclk. 2 and more: as many flip-flops of
// flk_reset_sync, and nothing of s_axil_* is taken before the chip is out of reset.
// test_en (scan test, 0 in use): clock gates are open, all resets are aresetn.
module flk_top_axi
  import flk_param_pkg::*;
#(
  parameter int unsigned Stage          = STAGE_CHANNELS,  // up to PortBits: as of flk_top
  parameter int unsigned Form           = FORM_FACTORED,
  parameter int unsigned Precision      = PRECISION_FIXED,
  parameter int unsigned FifoDepth      = FIFO_DEPTH,
  parameter int unsigned CtuFifoDepth   = CTU_FIFO_DEPTH,
  parameter int unsigned VrusPerChannel = VRUS_PER_CHANNEL,
  parameter int unsigned MaskGenerator  = MASK_GENERATOR_CTU,
  parameter int unsigned Cores          = CORES,
  parameter int unsigned Lanes          = 32,
  parameter int unsigned Slots          = flk_lane_pkg::LANE_SLOTS,
  parameter int unsigned Depth          = flk_lane_pkg::LANE_QUEUE_DEPTH,
  parameter int unsigned InWidth        = 1,
  parameter int unsigned SortUnits      = 4,
  parameter int unsigned SortStages     = 7,
  parameter int unsigned SortWays       = 8,
  parameter int unsigned MergeLines     = 128,
  parameter int unsigned Chunks         = 8,
  parameter int unsigned Entries        = 704,
  parameter int unsigned Queue          = 128,
  parameter int unsigned Pairs          = 4,
  parameter int unsigned RecordLines    = 1024,
  parameter int unsigned PreprocLanes   = 4,
  parameter int unsigned PreprocInterval = 2,
  parameter int unsigned ListWriters    = 4,
  parameter bit          ColourStore    = 1'b1,
  parameter int unsigned Waiting        = 128,
  parameter int unsigned Gather         = 216,
  parameter int unsigned Pointers       = 2048,
  parameter int unsigned Lists          = 16384,
  parameter int unsigned Patience       = 16,
  parameter int unsigned PortBits       = 512,  // of the memory port: 128, 256, 512
  parameter int unsigned IdWidth        = 7,  // of m_axi_*id: 7 or more
  parameter int unsigned UserWidth      = 1,  // of m_axi_*user: 1 or more
  parameter int unsigned Cache          = 3,  // of m_axi_*cache: normal, not cacheable, bufferable
  parameter int unsigned Prot           = 0,  // of m_axi_*prot: unprivileged, secure, data
  parameter int unsigned ResetStages    = 2   // 0: aresetn is released in time with aclk
) (
  input  logic                 aclk,
  input  logic                 aresetn,
  input  logic                 test_en,
  output logic                 irq,
  // Registers: AXI4-Lite
  input  logic [9:0]           s_axil_awaddr,
  input  logic [2:0]           s_axil_awprot,
  input  logic                 s_axil_awvalid,
  output logic                 s_axil_awready,
  input  logic [31:0]          s_axil_wdata,
  input  logic [3:0]           s_axil_wstrb,
  input  logic                 s_axil_wvalid,
  output logic                 s_axil_wready,
  output logic [1:0]           s_axil_bresp,
  output logic                 s_axil_bvalid,
  input  logic                 s_axil_bready,
  input  logic [9:0]           s_axil_araddr,
  input  logic [2:0]           s_axil_arprot,
  input  logic                 s_axil_arvalid,
  output logic                 s_axil_arready,
  output logic [31:0]          s_axil_rdata,
  output logic [1:0]           s_axil_rresp,
  output logic                 s_axil_rvalid,
  input  logic                 s_axil_rready,
  // Memory: AXI4
  output logic [IdWidth-1:0]   m_axi_awid,
  output logic [39:0]          m_axi_awaddr,
  output logic [7:0]           m_axi_awlen,
  output logic [2:0]           m_axi_awsize,
  output logic [1:0]           m_axi_awburst,
  output logic                 m_axi_awlock,
  output logic [3:0]           m_axi_awcache,
  output logic [2:0]           m_axi_awprot,
  output logic [3:0]           m_axi_awqos,
  output logic [3:0]           m_axi_awregion,
  output logic [UserWidth-1:0] m_axi_awuser,
  output logic                 m_axi_awvalid,
  input  logic                 m_axi_awready,
  output logic [PortBits-1:0]  m_axi_wdata,
  output logic [PortBits/8-1:0] m_axi_wstrb,
  output logic                 m_axi_wlast,
  output logic [UserWidth-1:0] m_axi_wuser,
  output logic                 m_axi_wvalid,
  input  logic                 m_axi_wready,
  input  logic [IdWidth-1:0]   m_axi_bid,
  input  logic [1:0]           m_axi_bresp,
  input  logic [UserWidth-1:0] m_axi_buser,
  input  logic                 m_axi_bvalid,
  output logic                 m_axi_bready,
  output logic [IdWidth-1:0]   m_axi_arid,
  output logic [39:0]          m_axi_araddr,
  output logic [7:0]           m_axi_arlen,
  output logic [2:0]           m_axi_arsize,
  output logic [1:0]           m_axi_arburst,
  output logic                 m_axi_arlock,
  output logic [3:0]           m_axi_arcache,
  output logic [2:0]           m_axi_arprot,
  output logic [3:0]           m_axi_arqos,
  output logic [3:0]           m_axi_arregion,
  output logic [UserWidth-1:0] m_axi_aruser,
  output logic                 m_axi_arvalid,
  input  logic                 m_axi_arready,
  input  logic [IdWidth-1:0]   m_axi_rid,
  input  logic [PortBits-1:0]  m_axi_rdata,
  input  logic [1:0]           m_axi_rresp,
  input  logic                 m_axi_rlast,
  input  logic [UserWidth-1:0] m_axi_ruser,
  input  logic                 m_axi_rvalid,
  output logic                 m_axi_rready
);

  localparam int unsigned IdBits = 7;  // of flk_top

  if (IdWidth < IdBits) begin : gen_check_id
    $error("flk_top_axi: IdWidth must be at least 7, the bits of the chip's identifiers");
  end
  if (UserWidth < 1) begin : gen_check_user
    $error("flk_top_axi: UserWidth must be at least 1");
  end
  if (Cache > 15 || Prot > 7) begin : gen_check_constants
    $error("flk_top_axi: Cache must be 0 to 15, Prot 0 to 7");
  end
  if (ResetStages == 1) begin : gen_check_stages
    $error("flk_top_axi: ResetStages must be 0 or at least 2");
  end

  // ---- reset ------------------------------------------------------------------------------------------

  logic rst_n;
  logic up;  // the chip is out of reset

  if (ResetStages < 2) begin : gen_no_sync
    assign rst_n = aresetn;
    assign up    = 1'b1;
  end else begin : gen_sync
    logic up_q;

    flk_reset_sync #(
      .Stages(ResetStages)
    ) i_reset (
      .clk_i    (aclk),
      .rst_ni   (aresetn),
      .test_en_i(test_en),
      .rst_no   (rst_n)
    );

    always_ff @(posedge aclk or negedge rst_n) begin
      if (!rst_n) begin
        up_q <= 1'b0;
      end else begin
        up_q <= 1'b1;
      end
    end

    assign up = up_q;
  end

  // ---- side signals -----------------------------------------------------------------------------------

  logic              aw_ready, w_ready, ar_ready;
  logic [IdBits-1:0] aw_id, ar_id;
  logic              unused_answers;

  assign s_axil_awready = aw_ready && up;
  assign s_axil_wready  = w_ready && up;
  assign s_axil_arready = ar_ready && up;

  assign m_axi_awid     = IdWidth'(aw_id);
  assign m_axi_arid     = IdWidth'(ar_id);
  assign m_axi_awlock   = 1'b0;
  assign m_axi_arlock   = 1'b0;
  assign m_axi_awcache  = 4'(Cache);
  assign m_axi_arcache  = 4'(Cache);
  assign m_axi_awprot   = 3'(Prot);
  assign m_axi_arprot   = 3'(Prot);
  assign m_axi_awregion = '0;
  assign m_axi_arregion = '0;
  assign m_axi_awuser   = '0;
  assign m_axi_aruser   = '0;
  assign m_axi_wuser    = '0;
  assign unused_answers = ^{m_axi_bid, m_axi_rid, m_axi_buser, m_axi_ruser};

  // ---- chip -------------------------------------------------------------------------------------------

  flk_top #(
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
    .RecordLines   (RecordLines),
    .PreprocLanes  (PreprocLanes),
    .PreprocInterval(PreprocInterval),
    .ListWriters   (ListWriters),
    .ColourStore   (ColourStore),
    .Waiting       (Waiting),
    .Gather        (Gather),
    .Pointers      (Pointers),
    .Lists         (Lists),
    .Patience      (Patience),
    .PortBits      (PortBits)
  ) i_top (
    .clk_i         (aclk),
    .rst_ni        (rst_n),
    .test_en_i     (test_en),
    .irq_o         (irq),
    .reg_aw_valid_i(s_axil_awvalid && up),
    .reg_aw_ready_o(aw_ready),
    .reg_aw_addr_i (s_axil_awaddr),
    .reg_aw_prot_i (s_axil_awprot),
    .reg_w_valid_i (s_axil_wvalid && up),
    .reg_w_ready_o (w_ready),
    .reg_w_data_i  (s_axil_wdata),
    .reg_w_strb_i  (s_axil_wstrb),
    .reg_b_valid_o (s_axil_bvalid),
    .reg_b_ready_i (s_axil_bready),
    .reg_b_resp_o  (s_axil_bresp),
    .reg_ar_valid_i(s_axil_arvalid && up),
    .reg_ar_ready_o(ar_ready),
    .reg_ar_addr_i (s_axil_araddr),
    .reg_ar_prot_i (s_axil_arprot),
    .reg_r_valid_o (s_axil_rvalid),
    .reg_r_ready_i (s_axil_rready),
    .reg_r_data_o  (s_axil_rdata),
    .reg_r_resp_o  (s_axil_rresp),
    .ar_valid_o    (m_axi_arvalid),
    .ar_ready_i    (m_axi_arready),
    .ar_id_o       (ar_id),
    .ar_addr_o     (m_axi_araddr),
    .ar_len_o      (m_axi_arlen),
    .ar_size_o     (m_axi_arsize),
    .ar_burst_o    (m_axi_arburst),
    .ar_qos_o      (m_axi_arqos),
    .r_valid_i     (m_axi_rvalid),
    .r_ready_o     (m_axi_rready),
    .r_id_i        (IdBits'(m_axi_rid)),
    .r_data_i      (m_axi_rdata),
    .r_resp_i      (m_axi_rresp),
    .r_last_i      (m_axi_rlast),
    .aw_valid_o    (m_axi_awvalid),
    .aw_ready_i    (m_axi_awready),
    .aw_id_o       (aw_id),
    .aw_addr_o     (m_axi_awaddr),
    .aw_len_o      (m_axi_awlen),
    .aw_size_o     (m_axi_awsize),
    .aw_burst_o    (m_axi_awburst),
    .aw_qos_o      (m_axi_awqos),
    .w_valid_o     (m_axi_wvalid),
    .w_ready_i     (m_axi_wready),
    .w_data_o      (m_axi_wdata),
    .w_strb_o      (m_axi_wstrb),
    .w_last_o      (m_axi_wlast),
    .b_valid_i     (m_axi_bvalid),
    .b_ready_o     (m_axi_bready),
    .b_id_i        (IdBits'(m_axi_bid)),
    .b_resp_i      (m_axi_bresp)
  );

`ifndef SYNTHESIS
  if (IdWidth > IdBits) begin : gen_check_answers
    assert property (@(posedge aclk) disable iff (!rst_n)
        m_axi_rvalid |-> m_axi_rid[IdWidth-1:IdBits] == '0)
    else $error("flk_top_axi: a read beat with an identifier that the chip does not use");
    assert property (@(posedge aclk) disable iff (!rst_n)
        m_axi_bvalid |-> m_axi_bid[IdWidth-1:IdBits] == '0)
    else $error("flk_top_axi: an answer with an identifier that the chip does not use");
  end
`endif

endmodule
