// Smoke test of flk_top_axi: FuseSoC's target sim (docs/guide/integration.md), for any simulator with timing and assertions.
//
// Reset; who the chip is; a register that is not there; a frame with an empty descriptor, which is refused: posted with its tag and its error, an interrupt
// until it is cleared, and not one access of memory. Ends with "flk_top_tb: passed", or with $fatal and what is wrong.
module flk_top_tb #(
  parameter int unsigned Stage       = 1,
  parameter int unsigned Lanes       = 32,
  parameter int unsigned IdWidth     = 8,
  parameter int unsigned ResetStages = 2
);

  // Byte addresses and bits of docs/reference/registers.md.
  localparam logic [9:0] ID = 10'h000;
  localparam logic [9:0] CAPABILITY = 10'h008;
  localparam logic [9:0] CONTROL = 10'h00C;
  localparam logic [9:0] STATUS = 10'h010;
  localparam logic [9:0] INTERRUPT = 10'h014;
  localparam logic [9:0] INTERRUPT_ENABLE = 10'h018;
  localparam logic [9:0] RESULT = 10'h020;
  localparam logic [9:0] FRAMES = 10'h024;
  localparam logic [9:0] FRAME = 10'h100;
  localparam logic [9:0] NOTHING = 10'h0FC;
  localparam logic [31:0] ID_VALUE = 32'h464C4B52;
  localparam logic [31:0] FRAME_DONE = 32'h2;
  localparam logic [15:0] DESCRIPTOR_ERROR = 16'h80;
  localparam logic [15:0] TAG = 16'hF1C4;
  localparam int unsigned Limit = 1000;  // cycles that anything may take

  logic        clk = 1'b0;
  logic        rst_n = 1'b1;
  logic        irq;
  logic [9:0]  awaddr, araddr;
  logic [31:0] wdata, rdata;
  logic [1:0]  bresp, rresp;
  logic        awvalid = 1'b0, wvalid = 1'b0, arvalid = 1'b0, bready = 1'b0, rready = 1'b0;
  logic        awready, wready, arready, bvalid, rvalid;
  logic        mem_awvalid, mem_wvalid, mem_arvalid;

  always #5 clk = ~clk;

  flk_top_axi #(
    .Stage      (Stage),
    .Lanes      (Lanes),
    .IdWidth    (IdWidth),
    .ResetStages(ResetStages)
  ) i_chip (
    .aclk          (clk),
    .aresetn       (rst_n),
    .test_en       (1'b0),
    .irq           (irq),
    .s_axil_awaddr (awaddr),
    .s_axil_awprot (3'd0),
    .s_axil_awvalid(awvalid),
    .s_axil_awready(awready),
    .s_axil_wdata  (wdata),
    .s_axil_wstrb  (4'hF),
    .s_axil_wvalid (wvalid),
    .s_axil_wready (wready),
    .s_axil_bresp  (bresp),
    .s_axil_bvalid (bvalid),
    .s_axil_bready (bready),
    .s_axil_araddr (araddr),
    .s_axil_arprot (3'd0),
    .s_axil_arvalid(arvalid),
    .s_axil_arready(arready),
    .s_axil_rdata  (rdata),
    .s_axil_rresp  (rresp),
    .s_axil_rvalid (rvalid),
    .s_axil_rready (rready),
    .m_axi_awid    (),
    .m_axi_awaddr  (),
    .m_axi_awlen   (),
    .m_axi_awsize  (),
    .m_axi_awburst (),
    .m_axi_awlock  (),
    .m_axi_awcache (),
    .m_axi_awprot  (),
    .m_axi_awqos   (),
    .m_axi_awregion(),
    .m_axi_awuser  (),
    .m_axi_awvalid (mem_awvalid),
    .m_axi_awready (1'b0),
    .m_axi_wdata   (),
    .m_axi_wstrb   (),
    .m_axi_wlast   (),
    .m_axi_wuser   (),
    .m_axi_wvalid  (mem_wvalid),
    .m_axi_wready  (1'b0),
    .m_axi_bid     ('0),
    .m_axi_bresp   (2'd0),
    .m_axi_buser   (1'b0),
    .m_axi_bvalid  (1'b0),
    .m_axi_bready  (),
    .m_axi_arid    (),
    .m_axi_araddr  (),
    .m_axi_arlen   (),
    .m_axi_arsize  (),
    .m_axi_arburst (),
    .m_axi_arlock  (),
    .m_axi_arcache (),
    .m_axi_arprot  (),
    .m_axi_arqos   (),
    .m_axi_arregion(),
    .m_axi_aruser  (),
    .m_axi_arvalid (mem_arvalid),
    .m_axi_arready (1'b0),
    .m_axi_rid     ('0),
    .m_axi_rdata   ('0),
    .m_axi_rresp   (2'd0),
    .m_axi_rlast   (1'b0),
    .m_axi_ruser   (1'b0),
    .m_axi_rvalid  (1'b0),
    .m_axi_rready  ()
  );

  // An access: pins change, and are looked at, at falling edges, so that no simulator has a race.
  task automatic write(input logic [9:0] address, input logic [31:0] value);
    int unsigned cycles = 0;
    logic        took_address, took_data, done;
    logic [1:0]  answer;
    awaddr  = address;
    wdata   = value;
    awvalid = 1'b1;
    wvalid  = 1'b1;
    bready  = 1'b1;
    do begin
      took_address = awready;
      took_data    = wready;
      done         = bvalid;
      answer       = bresp;
      @(negedge clk);
      if (took_address) awvalid = 1'b0;
      if (took_data) wvalid = 1'b0;
      cycles++;
      if (cycles > Limit) $fatal(1, "flk_top_tb: write of %h: no answer", address);
    end while (!done);
    bready = 1'b0;
    if (answer != 2'd0) $fatal(1, "flk_top_tb: write of %h: answer %0d", address, answer);
  endtask

  task automatic read(input logic [9:0] address, output logic [31:0] value,
                      input logic [1:0] wanted = 2'd0);
    int unsigned cycles = 0;
    logic        took_address, done;
    logic [1:0]  answer;
    araddr  = address;
    arvalid = 1'b1;
    rready  = 1'b1;
    do begin
      took_address = arready;
      done         = rvalid;
      answer       = rresp;
      value        = rdata;
      @(negedge clk);
      if (took_address) arvalid = 1'b0;
      cycles++;
      if (cycles > Limit) $fatal(1, "flk_top_tb: read of %h: no answer", address);
    end while (!done);
    rready = 1'b0;
    if (answer != wanted) $fatal(1, "flk_top_tb: read of %h: answer %0d", address, answer);
  endtask

  task automatic expect_read(input logic [9:0] address, input logic [31:0] wanted);
    logic [31:0] value;
    read(address, value);
    if (value != wanted) $fatal(1, "flk_top_tb: %h is %h, not %h", address, value, wanted);
  endtask

  always @(posedge clk) begin
    if (rst_n && (mem_awvalid || mem_wvalid || mem_arvalid)) begin
      $fatal(1, "flk_top_tb: memory is asked for something");
    end
  end

  initial begin
    logic [31:0] value;
    int unsigned cycles;
    #1 rst_n = 1'b0;  // an edge: before the first one of the clock
    repeat (4) @(negedge clk);
    rst_n = 1'b1;
    expect_read(ID, ID_VALUE);  // offered before the chip is out of reset
    read(CAPABILITY, value);
    if (value[3:0] != 4'(Stage)) $fatal(1, "flk_top_tb: stage %0d", value[3:0]);
    if (value[23:20] != 4'd6) $fatal(1, "flk_top_tb: beats of 2^%0d bytes", value[23:20]);
    if (value[27:24] != 4'($clog2(Lanes))) $fatal(1, "flk_top_tb: 2^%0d lanes", value[27:24]);
    read(NOTHING, value, 2'd2);
    cycles = 0;
    do begin
      read(STATUS, value);
      cycles++;
      if (cycles > Limit) $fatal(1, "flk_top_tb: never ready");
    end while (!value[0]);
    expect_read(INTERRUPT, 32'd0);
    write(INTERRUPT_ENABLE, FRAME_DONE);
    write(FRAME, 32'(TAG));
    if (irq) $fatal(1, "flk_top_tb: an interrupt before a frame");
    write(CONTROL, 32'd1);
    cycles = 0;
    while (!irq) begin
      @(negedge clk);
      cycles++;
      if (cycles > Limit) $fatal(1, "flk_top_tb: no interrupt");
    end
    expect_read(RESULT, {DESCRIPTOR_ERROR, TAG});
    expect_read(FRAMES, {16'd1, 16'd1});
    write(INTERRUPT, FRAME_DONE);
    repeat (4) @(negedge clk);
    if (irq) $fatal(1, "flk_top_tb: the interrupt stays");
    $display("flk_top_tb: passed");
    $finish;
  end

endmodule
