// The chip with the structs of PULP's axi: req and resp of an AXI4 manager for memory and of an AXI4-Lite subordinate for registers.
//
// The types are the caller's, as the macros AXI_TYPEDEF_ALL and AXI_LITE_TYPEDEF_ALL of that package make them: data of PortBits,
// addresses of 40 bits or more, identifiers of 7 or more for memory; 32 bits of data for registers. No logic but wires: latency and
// combinational paths are those of flk_top. Answers bring identifiers back as they came. ATOP 0: no atomics. LOCK, REGION, USER 0.
module flk_top_pulp
  import flk_param_pkg::*;
#(
  parameter int unsigned Stage          = STAGE_CHANNELS,
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
  parameter type         axi_req_t      = logic,  // memory: what the chip drives
  parameter type         axi_resp_t     = logic,
  parameter type         axi_lite_req_t = logic,  // registers: what the host drives
  parameter type         axi_lite_resp_t = logic
) (
  input  logic           clk_i,
  input  logic           rst_ni,     // its end in time with clk_i
  input  logic           test_i,     // scan test, 0 in use
  output logic           irq_o,
  input  axi_lite_req_t  slv_req_i,
  output axi_lite_resp_t slv_resp_o,
  output axi_req_t       mst_req_o,
  input  axi_resp_t      mst_resp_i
);

  logic [6:0]  aw_id, ar_id;
  logic [39:0] aw_addr, ar_addr;
  logic [7:0]  aw_len, ar_len;
  logic [2:0]  aw_size, ar_size;
  logic [1:0]  aw_burst, ar_burst;
  logic [3:0]  aw_qos, ar_qos;
  logic        aw_valid, ar_valid, w_valid, w_last, b_ready, r_ready;
  logic [PortBits-1:0]   w_data;
  logic [PortBits/8-1:0] w_strb;

  always_comb begin
    mst_req_o          = '0;
    mst_req_o.aw.id    = aw_id;
    mst_req_o.aw.addr  = aw_addr;
    mst_req_o.aw.len   = aw_len;
    mst_req_o.aw.size  = aw_size;
    mst_req_o.aw.burst = aw_burst;
    mst_req_o.aw.cache = 4'd3;
    mst_req_o.aw.qos   = aw_qos;
    mst_req_o.aw_valid = aw_valid;
    mst_req_o.w.data   = w_data;
    mst_req_o.w.strb   = w_strb;
    mst_req_o.w.last   = w_last;
    mst_req_o.w_valid  = w_valid;
    mst_req_o.b_ready  = b_ready;
    mst_req_o.ar.id    = ar_id;
    mst_req_o.ar.addr  = ar_addr;
    mst_req_o.ar.len   = ar_len;
    mst_req_o.ar.size  = ar_size;
    mst_req_o.ar.burst = ar_burst;
    mst_req_o.ar.cache = 4'd3;
    mst_req_o.ar.qos   = ar_qos;
    mst_req_o.ar_valid = ar_valid;
    mst_req_o.r_ready  = r_ready;
  end

  flk_top #(
    .Stage          (Stage),
    .Form           (Form),
    .Precision      (Precision),
    .FifoDepth      (FifoDepth),
    .CtuFifoDepth   (CtuFifoDepth),
    .VrusPerChannel (VrusPerChannel),
    .MaskGenerator  (MaskGenerator),
    .Cores          (Cores),
    .Lanes          (Lanes),
    .Slots          (Slots),
    .Depth          (Depth),
    .InWidth        (InWidth),
    .SortUnits      (SortUnits),
    .SortStages     (SortStages),
    .SortWays       (SortWays),
    .MergeLines     (MergeLines),
    .Chunks         (Chunks),
    .Entries        (Entries),
    .Queue          (Queue),
    .Pairs          (Pairs),
    .RecordLines    (RecordLines),
    .PreprocLanes   (PreprocLanes),
    .PreprocInterval(PreprocInterval),
    .ListWriters    (ListWriters),
    .ColourStore    (ColourStore),
    .Waiting        (Waiting),
    .Gather         (Gather),
    .Pointers       (Pointers),
    .Lists          (Lists),
    .Patience       (Patience),
    .PortBits       (PortBits)
  ) i_top (
    .clk_i         (clk_i),
    .rst_ni        (rst_ni),
    .test_en_i     (test_i),
    .irq_o         (irq_o),
    .reg_aw_valid_i(slv_req_i.aw_valid),
    .reg_aw_ready_o(slv_resp_o.aw_ready),
    .reg_aw_addr_i (slv_req_i.aw.addr[9:0]),
    .reg_aw_prot_i (slv_req_i.aw.prot),
    .reg_w_valid_i (slv_req_i.w_valid),
    .reg_w_ready_o (slv_resp_o.w_ready),
    .reg_w_data_i  (slv_req_i.w.data),
    .reg_w_strb_i  (slv_req_i.w.strb),
    .reg_b_valid_o (slv_resp_o.b_valid),
    .reg_b_ready_i (slv_req_i.b_ready),
    .reg_b_resp_o  (slv_resp_o.b.resp),
    .reg_ar_valid_i(slv_req_i.ar_valid),
    .reg_ar_ready_o(slv_resp_o.ar_ready),
    .reg_ar_addr_i (slv_req_i.ar.addr[9:0]),
    .reg_ar_prot_i (slv_req_i.ar.prot),
    .reg_r_valid_o (slv_resp_o.r_valid),
    .reg_r_ready_i (slv_req_i.r_ready),
    .reg_r_data_o  (slv_resp_o.r.data),
    .reg_r_resp_o  (slv_resp_o.r.resp),
    .ar_valid_o    (ar_valid),
    .ar_ready_i    (mst_resp_i.ar_ready),
    .ar_id_o       (ar_id),
    .ar_addr_o     (ar_addr),
    .ar_len_o      (ar_len),
    .ar_size_o     (ar_size),
    .ar_burst_o    (ar_burst),
    .ar_qos_o      (ar_qos),
    .r_valid_i     (mst_resp_i.r_valid),
    .r_ready_o     (r_ready),
    .r_id_i        (mst_resp_i.r.id[6:0]),
    .r_data_i      (mst_resp_i.r.data),
    .r_resp_i      (mst_resp_i.r.resp),
    .r_last_i      (mst_resp_i.r.last),
    .aw_valid_o    (aw_valid),
    .aw_ready_i    (mst_resp_i.aw_ready),
    .aw_id_o       (aw_id),
    .aw_addr_o     (aw_addr),
    .aw_len_o      (aw_len),
    .aw_size_o     (aw_size),
    .aw_burst_o    (aw_burst),
    .aw_qos_o      (aw_qos),
    .w_valid_o     (w_valid),
    .w_ready_i     (mst_resp_i.w_ready),
    .w_data_o      (w_data),
    .w_strb_o      (w_strb),
    .w_last_o      (w_last),
    .b_valid_i     (mst_resp_i.b_valid),
    .b_ready_o     (b_ready),
    .b_id_i        (mst_resp_i.b.id[6:0]),
    .b_resp_i      (mst_resp_i.b.resp)
  );

endmodule
