// flk_axi_downsizer, for managers and a memory that keep to what they are bound to.
//
// Addresses: in their cycle, unchanged but for length and size, which name the same bytes in whole beats of the port; so a burst that does not
// cross 4 KB does not.
// Read beats: of an identifier, whichever id_i chooses: every beat that its parts make whole leaves in the next cycle, once, with the
// parts in their places (of a narrow one in all places), the worst of their responses and the mark of the last; and no other beat leaves
// under it. Parts of other identifiers may come between.
// Write data: every beat leaves as its parts in order, the first in its cycle, each once, with its strobes; the mark of the last
// is on the last part of the last beat alone; the beat is taken with its last part.
// Responses of writes pass.
//
// Managers: payload of write data stays until it is taken; bursts of whole beats, of at most 256 beats of the port, or single narrow ones.
// The memory: a burst ends behind a power of two of parts.
// Proved by induction. The assertions l_* link registers to what is followed.
module fv_axi_downsizer #(
  parameter  int unsigned Width     = 64,
  parameter  int unsigned PortBits  = 32,
  localparam int unsigned AddrBits  = 13,
  localparam int unsigned IdBits    = 3,
  localparam int unsigned OwnBits   = 2,
  localparam int unsigned UsedBits  = 1,
  localparam int unsigned Parts     = Width / PortBits,
  localparam int unsigned PartBits  = $clog2(Parts),
  localparam int unsigned Bytes     = Width / 8,
  localparam int unsigned PortBytes = PortBits / 8,
  localparam int unsigned SlotBits  = IdBits - OwnBits + UsedBits,
  localparam int unsigned AskBits   = IdBits + 6
) (
  input logic                clk_i,
  input logic                again_i,
  input logic                clear_i,
  input logic [SlotBits-1:0] id_i,  // a constant: the identifier that is followed, without the bits that are not in use
  input logic                ar_valid_i,
  input logic [AskBits-1:0]  ar_ask_i,
  input logic [AddrBits-1:0] ar_addr_i,
  input logic [7:0]          ar_len_i,
  input logic [2:0]          ar_size_i,
  input logic                ar_ready_i,
  input logic                r_valid_i,
  input logic [SlotBits-1:0] r_slot_i,
  input logic [PortBits-1:0] r_data_i,
  input logic [1:0]          r_resp_i,
  input logic                r_last_i,
  input logic                aw_valid_i,
  input logic [AskBits-1:0]  aw_ask_i,
  input logic [AddrBits-1:0] aw_addr_i,
  input logic [7:0]          aw_len_i,
  input logic                aw_ready_i,
  input logic                w_valid_i,
  input logic [Width-1:0]    w_data_i,
  input logic [Bytes-1:0]    w_strb_i,
  input logic                w_last_i,
  input logic                w_ready_i,
  input logic                b_valid_i,
  input logic                b_ready_i,
  input logic [IdBits-1:0]   b_id_i,
  input logic [1:0]          b_resp_i
);

  localparam logic [2:0] FULL = 3'($clog2(Bytes));
  localparam logic [2:0] SIZE = 3'($clog2(PortBytes));

  logic                 rst_n, ar_ready, aw_ready, r_valid, r_last, w_ready, b_valid, port_b_ready, r_ready;
  logic                 port_ar_valid, port_aw_valid, port_w_valid, port_w_last;
  logic [IdBits-1:0]    r_id, b_id, r_id_in;
  logic [Width-1:0]     r_data;
  logic [1:0]           r_resp, b_resp;
  logic [AskBits-1:0]   port_ar_ask, port_aw_ask;
  logic [AddrBits-1:0]  port_ar_addr, port_aw_addr;
  logic [7:0]           port_ar_len, port_aw_len;
  logic [2:0]           port_ar_size, port_aw_size;
  logic [PortBits-1:0]  port_w_data;
  logic [PortBytes-1:0] port_w_strb;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  // Bits that are not in use are 0.
  assign r_id_in = {r_slot_i[SlotBits-1:UsedBits], (OwnBits - UsedBits)'(0), r_slot_i[UsedBits-1:0]};

  flk_axi_downsizer #(
    .AddrBits(AddrBits),
    .Width   (Width),
    .PortBits(PortBits),
    .IdBits  (IdBits),
    .OwnBits (OwnBits),
    .UsedBits(UsedBits)
  ) dut (
    .clk_i,
    .rst_ni       (rst_n),
    .clear_i,
    .in_ar_valid_i(ar_valid_i),
    .in_ar_ready_o(ar_ready),
    .in_ar_id_i   (ar_ask_i[AskBits-1:6]),
    .in_ar_addr_i (ar_addr_i),
    .in_ar_len_i  (ar_len_i),
    .in_ar_size_i (ar_size_i),
    .in_ar_burst_i(ar_ask_i[5:4]),
    .in_ar_qos_i  (ar_ask_i[3:0]),
    .in_r_valid_o (r_valid),
    .in_r_id_o    (r_id),
    .in_r_data_o  (r_data),
    .in_r_resp_o  (r_resp),
    .in_r_last_o  (r_last),
    .in_aw_valid_i(aw_valid_i),
    .in_aw_ready_o(aw_ready),
    .in_aw_id_i   (aw_ask_i[AskBits-1:6]),
    .in_aw_addr_i (aw_addr_i),
    .in_aw_len_i  (aw_len_i),
    .in_aw_size_i (FULL),
    .in_aw_burst_i(aw_ask_i[5:4]),
    .in_aw_qos_i  (aw_ask_i[3:0]),
    .in_w_valid_i (w_valid_i),
    .in_w_ready_o (w_ready),
    .in_w_data_i  (w_data_i),
    .in_w_strb_i  (w_strb_i),
    .in_w_last_i  (w_last_i),
    .in_b_valid_o (b_valid),
    .in_b_ready_i (b_ready_i),
    .in_b_id_o    (b_id),
    .in_b_resp_o  (b_resp),
    .ar_valid_o   (port_ar_valid),
    .ar_ready_i,
    .ar_id_o      (port_ar_ask[AskBits-1:6]),
    .ar_addr_o    (port_ar_addr),
    .ar_len_o     (port_ar_len),
    .ar_size_o    (port_ar_size),
    .ar_burst_o   (port_ar_ask[5:4]),
    .ar_qos_o     (port_ar_ask[3:0]),
    .r_valid_i,
    .r_ready_o    (r_ready),
    .r_id_i       (r_id_in),
    .r_data_i,
    .r_resp_i,
    .r_last_i,
    .aw_valid_o   (port_aw_valid),
    .aw_ready_i,
    .aw_id_o      (port_aw_ask[AskBits-1:6]),
    .aw_addr_o    (port_aw_addr),
    .aw_len_o     (port_aw_len),
    .aw_size_o    (port_aw_size),
    .aw_burst_o   (port_aw_ask[5:4]),
    .aw_qos_o     (port_aw_ask[3:0]),
    .w_valid_o    (port_w_valid),
    .w_ready_i,
    .w_data_o     (port_w_data),
    .w_strb_o     (port_w_strb),
    .w_last_o     (port_w_last),
    .b_valid_i,
    .b_ready_o    (port_b_ready),
    .b_id_i,
    .b_resp_i
  );

  // ---- the parts of the identifier that is followed ---------------------------------------------------

  logic [SlotBits-1:0]                id_q;
  logic [PartBits:0]                  count_q, next;  // parts at hand; with the one that comes
  logic [Parts-1:0][PortBits+1:0]     data_d, data_q, due_data_q;  // with their responses
  logic [1:0]                         worst;
  logic                               begun_q, come, whole, due_q, due_last_q;
  logic [PartBits:0]                  due_parts_q;

  assign come  = r_valid_i && r_slot_i == id_i;
  assign next  = count_q + 1'b1;
  assign whole = come && (r_last_i || 32'(next) == Parts);

  always_comb begin
    data_d = data_q;
    data_d[count_q[PartBits-1:0]] = {r_resp_i, r_data_i};
    worst = '0;
    for (int unsigned k = 0; k < Parts; k++) begin
      if (32'(due_parts_q) > k && due_data_q[k][PortBits+:2] > worst) begin
        worst = due_data_q[k][PortBits+:2];
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      count_q <= '0;
      due_q   <= 1'b0;
      begun_q <= 1'b0;
    end else begin
      begun_q <= 1'b1;
      due_q   <= whole && !clear_i;
      if (clear_i || whole) begin
        count_q <= '0;
      end else if (come) begin
        count_q <= next;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    id_q <= id_i;
    if (come) begin
      data_q <= data_d;
    end
    due_data_q  <= data_d;
    due_last_q  <= r_last_i;
    due_parts_q <= next;
  end

  // ---- write data -------------------------------------------------------------------------------------

  logic [PartBits-1:0] turn_q;
  logic                w_waits_q, w_last_q;
  logic [Width-1:0]    w_data_q;
  logic [Bytes-1:0]    w_strb_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      turn_q    <= '0;
      w_waits_q <= 1'b0;
    end else begin
      w_waits_q <= w_valid_i && !w_ready && !clear_i;
      if (clear_i) begin
        turn_q <= '0;
      end else if (port_w_valid && w_ready_i) begin
        turn_q <= 32'(turn_q) == Parts - 1 ? '0 : turn_q + 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    w_data_q <= w_data_i;
    w_strb_q <= w_strb_i;
    w_last_q <= w_last_i;
  end

  // ---- claims -----------------------------------------------------------------------------------------

  logic [31:0] ar_bytes, aw_bytes;

  assign ar_bytes = (32'(ar_len_i) + 1) << ar_size_i;
  assign aw_bytes = (32'(aw_len_i) + 1) << FULL;

  always_comb begin
    m_id: assume (!begun_q || id_i == id_q);
    m_read: assume (!ar_valid_i || (ar_size_i >= SIZE && ar_size_i <= FULL &&
                                    (ar_size_i == FULL || ar_len_i == '0) && ar_bytes <= 256 * PortBytes));
    m_write: assume (!aw_valid_i || aw_bytes <= 256 * PortBytes);
    m_stay: assume (!w_waits_q || (w_valid_i && w_data_i == w_data_q && w_strb_i == w_strb_q &&
                                   w_last_i == w_last_q));
    m_parts: assume (!whole || (next & (next - 1'b1)) == '0);

    if (rst_n) begin
      // Addresses.
      a_read: assert (port_ar_valid == ar_valid_i && ar_ready == ar_ready_i);
      if (ar_valid_i) begin
        a_read_as_it_is: assert (port_ar_ask == ar_ask_i && port_ar_addr == ar_addr_i);
        a_read_bytes: assert (port_ar_size == SIZE && (32'(port_ar_len) + 1) << SIZE == ar_bytes);
      end
      a_write: assert (port_aw_valid == aw_valid_i && aw_ready == aw_ready_i);
      if (aw_valid_i) begin
        a_write_as_it_is: assert (port_aw_ask == aw_ask_i && port_aw_addr == aw_addr_i);
        a_write_bytes: assert (port_aw_size == SIZE && (32'(port_aw_len) + 1) << SIZE == aw_bytes);
      end

      // Read beats.
      a_taken: assert (r_ready);
      a_beat: assert ((r_valid && {r_id[IdBits-1:OwnBits], r_id[UsedBits-1:0]} == id_i) == due_q);
      if (due_q) begin
        a_id: assert (r_id[OwnBits-1:UsedBits] == '0);
        a_last: assert (r_last == due_last_q);
        a_resp: assert (r_resp == worst);
      end

      // Write data.
      a_data_valid: assert (port_w_valid == w_valid_i);
      a_data_taken: assert (w_ready == (w_ready_i && 32'(turn_q) == Parts - 1));
      if (w_valid_i) begin
        a_part: assert (port_w_data == w_data_i[32'(turn_q)*PortBits+:PortBits]);
        a_strobes: assert (port_w_strb == w_strb_i[32'(turn_q)*PortBytes+:PortBytes]);
        a_mark: assert (port_w_last == (w_last_i && 32'(turn_q) == Parts - 1));
      end

      // Responses.
      a_response: assert (b_valid == b_valid_i && port_b_ready == b_ready_i && b_id == b_id_i && b_resp == b_resp_i);

      // Links.
      l_part: assert (32'(count_q) < Parts && PartBits'(dut.gen_parts.part_q[id_i]) == count_q[PartBits-1:0]);
      l_turn: assert (dut.gen_parts.turn_q == turn_q);
      l_parts: assert (!due_q || ((due_parts_q & (due_parts_q - 1'b1)) == '0 && due_parts_q != '0 &&
                                  32'(due_parts_q) <= Parts));

      c_whole: cover (due_q && 32'(due_parts_q) == Parts && worst == 2'd2 && r_valid_i && r_slot_i != id_i);
      c_narrow: cover (due_q && 32'(due_parts_q) < Parts && due_last_q);
      c_between: cover (r_valid && !due_q && count_q != '0);
      c_write: cover (w_valid_i && w_last_i && port_w_last && w_ready_i);
    end
  end

  for (genvar k = 0; k < Parts; k++) begin : gen_data
    always_comb begin
      if (rst_n && due_q) begin
        a_data: assert (r_data[k*PortBits+:PortBits] ==
                        due_data_q[PartBits'(k)&PartBits'(due_parts_q-1'b1)][PortBits-1:0]);
      end
    end
  end

  for (genvar k = 0; k < Parts - 1; k++) begin : gen_link
    always_comb begin
      if (rst_n) begin
        l_kept: assert (32'(count_q) <= k ||
                        dut.gen_parts.gen_kept[k].i_kept.storage_q[id_i] == data_q[k]);
      end
    end
  end

endmodule
