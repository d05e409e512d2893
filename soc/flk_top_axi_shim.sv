// Stands in the SoC for flk_top_axi where the chip's simulator is another library, one that is built already: the same pins, a cycle of the
// chip for each of the SoC's. The harness (harness.cpp) passes the pins on to flk_chip_pins of model/flicker/sim/frame_harness.cpp.
// All of the chip's outputs come from registers, so that what it gets and gives at an edge is all there is to a cycle.
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

  import "DPI-C" function void flk_shim_cycle(input bit [31:0] in_reset, input bit [831:0] in_pins, output bit [927:0] out_pins);

  bit [831:0] in_pins;
  bit [927:0] out_pins;

  // Words of 32 bits, as flk_chip_pins has them: 0 control, 1 addresses, 2 data of the registers, 3 answers of the memory, 4 to 19 its data.
  always_comb begin
    in_pins = '0;
    in_pins[0+:9] = {s_axil_awvalid, s_axil_wvalid, s_axil_bready, s_axil_arvalid, s_axil_rready, m_axi_awready, m_axi_wready,
                     m_axi_arready, test_en};
    in_pins[9+:4] = s_axil_wstrb;
    in_pins[32+:20] = {s_axil_araddr, s_axil_awaddr};
    in_pins[64+:32] = s_axil_wdata;
    in_pins[96+:21] = {m_axi_rlast, m_axi_rvalid, m_axi_rresp, m_axi_rid[6:0], m_axi_bvalid, m_axi_bresp, m_axi_bid[6:0]};
    in_pins[128+:PortBits] = m_axi_rdata;
  end

  always @(posedge aclk) begin
    bit [927:0] next;
    flk_shim_cycle(32'(!aresetn), in_pins, next);
    out_pins <= next;
  end

  // 0 control, 1 data of the registers, 2 to 4 write address, 5 to 7 read address, 8, 9 strobes, 10 to 25 data.
  assign {irq, s_axil_awready, s_axil_wready, s_axil_bvalid, s_axil_bresp, s_axil_arready, s_axil_rvalid, s_axil_rresp, m_axi_bready,
          m_axi_rready, m_axi_wvalid, m_axi_wlast} = out_pins[13:0];
  assign s_axil_rdata = out_pins[32+:32];
  assign m_axi_awaddr = out_pins[64+:40];
  assign {m_axi_awid, m_axi_awlen, m_axi_awsize, m_axi_awburst, m_axi_awqos, m_axi_awvalid} = {IdWidth'(out_pins[146+:7]), out_pins[128+:18]};
  assign m_axi_araddr = out_pins[160+:40];
  assign {m_axi_arid, m_axi_arlen, m_axi_arsize, m_axi_arburst, m_axi_arqos, m_axi_arvalid} = {IdWidth'(out_pins[242+:7]), out_pins[224+:18]};
  assign m_axi_wstrb = out_pins[256+:PortBits/8];
  assign m_axi_wdata = out_pins[320+:PortBits];

  assign m_axi_awlock   = 1'b0;
  assign m_axi_awcache  = 4'(Cache);
  assign m_axi_awprot   = 3'(Prot);
  assign m_axi_awregion = '0;
  assign m_axi_awuser   = '0;
  assign m_axi_wuser    = '0;
  assign m_axi_arlock   = 1'b0;
  assign m_axi_arcache  = 4'(Cache);
  assign m_axi_arprot   = 3'(Prot);
  assign m_axi_arregion = '0;
  assign m_axi_aruser   = '0;

endmodule
