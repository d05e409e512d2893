// AXI4 of Width bits onto a port of PortBits, a power of two less: every burst becomes one burst of whole beats of the port.
//
// Bursts keep their address, identifier, quality of service and order; a beat becomes up to Width / PortBits of the port, so a burst that
// does not cross 4 KB stays one burst (of at most 256 beats from 16 bytes on). Read data are gathered by identifier: the memory may
// interleave bursts of different identifiers beat by beat. A gathered beat has the worst response of its parts. Narrow
// reads are single beats of a power of two of bytes, PortBits / 8 at least: their bytes come in every place of the beat, theirs too.
// Writes have whole beats; strobes and data go with their bytes. Responses of writes pass: there is one for each burst.
// An identifier of a read is {manager, own}: of the OwnBits of own the lower UsedBits are in use, the others 0. So many beats are gathered
// at once as there are such identifiers, in a memory of one port for each part but the last.
// clear_i forgets what is under way, for a memory that is reset as well.
// Latency: read data 1; addresses, write data and responses 0. One beat of the port a cycle. Read beats are taken always, and must be.
// Combinational: addresses, write data and responses through, with their ready. PortBits = Width: wires.
module flk_axi_downsizer #(
  parameter  int unsigned AddrBits  = 40,
  parameter  int unsigned Width     = 512,
  parameter  int unsigned PortBits  = 128,
  parameter  int unsigned IdBits    = 7,
  parameter  int unsigned OwnBits   = 4,
  parameter  int unsigned UsedBits  = 3,
  localparam int unsigned Bytes     = Width / 8,
  localparam int unsigned PortBytes = PortBits / 8
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 clear_i,
  // Managers
  input  logic                 in_ar_valid_i,
  output logic                 in_ar_ready_o,
  input  logic [IdBits-1:0]    in_ar_id_i,
  input  logic [AddrBits-1:0]  in_ar_addr_i,
  input  logic [7:0]           in_ar_len_i,
  input  logic [2:0]           in_ar_size_i,
  input  logic [1:0]           in_ar_burst_i,
  input  logic [3:0]           in_ar_qos_i,
  output logic                 in_r_valid_o,
  output logic [IdBits-1:0]    in_r_id_o,
  output logic [Width-1:0]     in_r_data_o,
  output logic [1:0]           in_r_resp_o,
  output logic                 in_r_last_o,
  input  logic                 in_aw_valid_i,
  output logic                 in_aw_ready_o,
  input  logic [IdBits-1:0]    in_aw_id_i,
  input  logic [AddrBits-1:0]  in_aw_addr_i,
  input  logic [7:0]           in_aw_len_i,
  input  logic [2:0]           in_aw_size_i,
  input  logic [1:0]           in_aw_burst_i,
  input  logic [3:0]           in_aw_qos_i,
  input  logic                 in_w_valid_i,
  output logic                 in_w_ready_o,
  input  logic [Width-1:0]     in_w_data_i,
  input  logic [Bytes-1:0]     in_w_strb_i,
  input  logic                 in_w_last_i,
  output logic                 in_b_valid_o,
  input  logic                 in_b_ready_i,
  output logic [IdBits-1:0]    in_b_id_o,
  output logic [1:0]           in_b_resp_o,
  // Port
  output logic                 ar_valid_o,
  input  logic                 ar_ready_i,
  output logic [IdBits-1:0]    ar_id_o,
  output logic [AddrBits-1:0]  ar_addr_o,
  output logic [7:0]           ar_len_o,
  output logic [2:0]           ar_size_o,
  output logic [1:0]           ar_burst_o,
  output logic [3:0]           ar_qos_o,
  input  logic                 r_valid_i,
  output logic                 r_ready_o,
  input  logic [IdBits-1:0]    r_id_i,
  input  logic [PortBits-1:0]  r_data_i,
  input  logic [1:0]           r_resp_i,
  input  logic                 r_last_i,
  output logic                 aw_valid_o,
  input  logic                 aw_ready_i,
  output logic [IdBits-1:0]    aw_id_o,
  output logic [AddrBits-1:0]  aw_addr_o,
  output logic [7:0]           aw_len_o,
  output logic [2:0]           aw_size_o,
  output logic [1:0]           aw_burst_o,
  output logic [3:0]           aw_qos_o,
  output logic                 w_valid_o,
  input  logic                 w_ready_i,
  output logic [PortBits-1:0]  w_data_o,
  output logic [PortBytes-1:0] w_strb_o,
  output logic                 w_last_o,
  input  logic                 b_valid_i,
  output logic                 b_ready_o,
  input  logic [IdBits-1:0]    b_id_i,
  input  logic [1:0]           b_resp_i
);

  localparam int unsigned Parts    = Width / PortBits;
  localparam int unsigned PartBits = Parts > 1 ? $clog2(Parts) : 1;
  localparam logic [2:0]  SIZE     = 3'($clog2(PortBytes));

  if (PortBits < 32 || PortBits > Width || Width % PortBits != 0 || Parts != 1 << $clog2(Parts))
  begin : gen_check_port
    $error("flk_axi_downsizer: PortBits must be 32 to Width, a power of two less than it");
  end
  if (UsedBits < 1 || UsedBits > OwnBits || OwnBits >= IdBits) begin : gen_check_id
    $error("flk_axi_downsizer: UsedBits must be 1 to OwnBits, OwnBits less than IdBits");
  end

  assign ar_valid_o    = in_ar_valid_i;
  assign in_ar_ready_o = ar_ready_i;
  assign ar_id_o       = in_ar_id_i;
  assign ar_addr_o     = in_ar_addr_i;
  assign ar_burst_o    = in_ar_burst_i;
  assign ar_qos_o      = in_ar_qos_i;
  assign aw_valid_o    = in_aw_valid_i;
  assign in_aw_ready_o = aw_ready_i;
  assign aw_id_o       = in_aw_id_i;
  assign aw_addr_o     = in_aw_addr_i;
  assign aw_burst_o    = in_aw_burst_i;
  assign aw_qos_o      = in_aw_qos_i;
  assign w_valid_o     = in_w_valid_i;
  assign in_b_valid_o  = b_valid_i;
  assign b_ready_o     = in_b_ready_i;
  assign in_b_id_o     = b_id_i;
  assign in_b_resp_o   = b_resp_i;
  assign r_ready_o     = 1'b1;

  if (Parts == 1) begin : gen_through
    logic unused_clock;

    assign unused_clock = ^{clk_i, rst_ni, clear_i};
    assign ar_len_o     = in_ar_len_i;
    assign ar_size_o    = in_ar_size_i;
    assign aw_len_o     = in_aw_len_i;
    assign aw_size_o    = in_aw_size_i;
    assign in_r_valid_o = r_valid_i;
    assign in_r_id_o    = r_id_i;
    assign in_r_data_o  = r_data_i;
    assign in_r_resp_o  = r_resp_i;
    assign in_r_last_o  = r_last_i;
    assign w_data_o     = in_w_data_i;
    assign w_strb_o     = in_w_strb_i;
    assign w_last_o     = in_w_last_i;
    assign in_w_ready_o = w_ready_i;
  end else begin : gen_parts

    // ---- addresses ----------------------------------------------------------------------------------

    // Beats less one, of beats that are 2^shift of the port's.
    function automatic logic [7:0] length(logic [7:0] len, logic [2:0] shift);
      return 8'(len << shift) | 8'((8'd1 << shift) - 8'd1);
    endfunction

    assign ar_len_o  = length(in_ar_len_i, in_ar_size_i - SIZE);
    assign ar_size_o = SIZE;
    assign aw_len_o  = length(in_aw_len_i, in_aw_size_i - SIZE);
    assign aw_size_o = SIZE;

    // ---- read data ----------------------------------------------------------------------------------

    localparam int unsigned SlotBits = IdBits - OwnBits + UsedBits;
    localparam int unsigned Slots    = 2 ** SlotBits;
    localparam int unsigned WordBits = PortBits + 2;  // with the response

    logic [Slots-1:0][PartBits-1:0] part_q;  // of a beat that is gathered: its next one
    logic [SlotBits-1:0]            slot;
    logic [PartBits-1:0]            part;
    logic                           whole;

    assign slot  = {r_id_i[IdBits-1:OwnBits], r_id_i[UsedBits-1:0]};
    assign part  = part_q[slot];
    assign whole = r_last_i || (&part);

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        part_q <= '0;
      end else if (clear_i) begin
        part_q <= '0;
      end else if (r_valid_i) begin
        part_q[slot] <= whole ? '0 : part + 1'b1;
      end
    end

    logic                [IdBits-1:0]   id_q;
    logic                [PartBits-1:0] at_q;
    logic                               valid_q, last_q;
    logic                [WordBits-1:0] word_q;
    logic [Parts-1:0]    [WordBits-1:0] words;
    logic [Parts-2:0]    [WordBits-1:0] kept;
    logic [Parts-1:0]    [1:0]          worst;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        valid_q <= 1'b0;
      end else begin
        valid_q <= r_valid_i && whole && !clear_i;
      end
    end

    always_ff @(posedge clk_i) begin
      if (r_valid_i) begin
        id_q   <= r_id_i;
        at_q   <= part;
        last_q <= r_last_i;
        word_q <= {r_resp_i, r_data_i};
      end
    end

    for (genvar k = 0; k < Parts - 1; k++) begin : gen_kept
      // Written or read: a beat that is whole has its last part at hand.
      flk_sram_single #(
        .Width(WordBits),
        .Depth(Slots)
      ) i_kept (
        .clk_i,
        .en_i     (r_valid_i && (whole || part == PartBits'(k))),
        .write_i  (!whole),
        .addr_i   (slot),
        .wr_data_i({r_resp_i, r_data_i}),
        .rd_data_o(kept[k])
      );

      assign words[k] = at_q == PartBits'(k) ? word_q : kept[k];
    end
    assign words[Parts-1] = word_q;

    // The parts of a narrow beat in every place.
    for (genvar k = 0; k < Parts; k++) begin : gen_out
      assign in_r_data_o[k*PortBits+:PortBits] = words[PartBits'(k)&at_q][PortBits-1:0];
      assign worst[k] = words[PartBits'(k)&at_q][PortBits+:2];
    end

    always_comb begin
      in_r_resp_o = '0;
      for (int unsigned k = 0; k < Parts; k++) begin
        in_r_resp_o = worst[k] > in_r_resp_o ? worst[k] : in_r_resp_o;
      end
    end

    assign in_r_valid_o = valid_q;
    assign in_r_id_o    = id_q;
    assign in_r_last_o  = last_q;

    // ---- write data ---------------------------------------------------------------------------------

    logic [PartBits-1:0] turn_q;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        turn_q <= '0;
      end else if (clear_i) begin
        turn_q <= '0;
      end else if (w_valid_o && w_ready_i) begin
        turn_q <= turn_q + 1'b1;
      end
    end

    assign w_data_o     = in_w_data_i[32'(turn_q)*PortBits+:PortBits];
    assign w_strb_o     = in_w_strb_i[32'(turn_q)*PortBytes+:PortBytes];
    assign w_last_o     = in_w_last_i && (&turn_q);
    assign in_w_ready_o = w_ready_i && (&turn_q);

`ifndef SYNTHESIS
    localparam logic [2:0] FULL = 3'($clog2(Bytes));

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        in_ar_valid_i |-> in_ar_size_i >= SIZE && (in_ar_size_i == FULL || in_ar_len_i == '0))
    else $error("flk_axi_downsizer: a narrow read of several beats, or narrower than the port");
    assert property (@(posedge clk_i) disable iff (!rst_ni) in_aw_valid_i |-> in_aw_size_i == FULL)
    else $error("flk_axi_downsizer: a narrow write");
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        (in_ar_valid_i |-> (32'(in_ar_len_i) + 1) << (in_ar_size_i - SIZE) <= 256))
    else $error("flk_axi_downsizer: a read of more than 256 beats of the port");
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        (in_aw_valid_i |-> (32'(in_aw_len_i) + 1) << (in_aw_size_i - SIZE) <= 256))
    else $error("flk_axi_downsizer: a write of more than 256 beats of the port");
    assert property (@(posedge clk_i) disable iff (!rst_ni || clear_i)
        r_valid_i |-> r_id_i[OwnBits-1:0] >> UsedBits == '0)
    else $error("flk_axi_downsizer: an identifier that is not in use");
    assert property (@(posedge clk_i) disable iff (!rst_ni || clear_i)
        r_valid_i && whole |-> (part & (part + 1'b1)) == '0)
    else $error("flk_axi_downsizer: a read of no power of two of parts");
`endif
  end

endmodule
