// flk_axi_arbiter, for managers that do anything and a memory that answers only what it was asked.
//
// Addresses: those that managers give leave at the port in the order in which they were taken, each once, unchanged,
// with the manager's index above its identifier. One is taken whenever a manager has one and there is a place, and no
// manager waits for more than Patience + managers - 1 transfers of others.
// Answers: every read beat goes to the manager in its identifier and to no other, a cycle later, unchanged; every
// answer to a write in its cycle. So they come in the port's order.
// Write data: the bursts' data leave in the order of their addresses. Of one burst, whichever pick_i chooses, and one
// beat of it, index_i: the beat that leaves is the one that its writer handed over for it, unchanged, the last one and
// only it is marked, and no writer hands over a beat that is not of a burst whose address was taken. With hold_i beats
// that the writer has not handed over have no strobes.
// Hold: nothing is taken from managers, missing data leave without them; drained_o exactly when nothing is under way.
//
// The memory: read beats for a manager that there is, while a burst that left the port has not ended; answers to writes
// not before address and last beat of as many bursts have left. hold_i stays until drained_o or clear_i.
// Proved by induction. The assertions l_* link registers to what is followed. No data path is distinguished
// beyond a byte; stuck_o is not looked at.
module fv_axi_arbiter #(
  parameter  int unsigned Readers   = 3,
  parameter  int unsigned Writers   = 2,
  parameter  int unsigned Patience  = 2,
  parameter  int unsigned Orders    = 2,
  localparam int unsigned IdBits    = 1,
  localparam int unsigned AddrBits  = 1,
  localparam int unsigned Width     = 8,
  localparam int unsigned ReadBits  = Readers > 1 ? $clog2(Readers) : 1,
  localparam int unsigned WriteBits = Writers > 1 ? $clog2(Writers) : 1,
  localparam int unsigned IndexBits = ReadBits > WriteBits ? ReadBits : WriteBits,
  localparam int unsigned PortBits  = IdBits + IndexBits,
  localparam int unsigned AskBits   = IdBits + AddrBits + 11,
  localparam int unsigned SlotBits  = $clog2(Orders + 2)
) (
  input logic                             clk_i,
  input logic                             again_i,
  input logic                             clear_i,
  input logic                             hold_i,
  input logic                             pick_i,     // this address, or burst, is followed
  input logic [7:0]                       index_i,    // the beat of it
  input logic [ReadBits-1:0]              reader_i,   // constants: whose turns are counted, whose data are followed
  input logic [WriteBits-1:0]             writer_i,
  input logic [Readers-1:0]               ar_valid_i,
  input logic [Readers-1:0][AskBits-1:0]  ar_ask_i,
  input logic [Writers-1:0]               aw_valid_i,
  input logic [Writers-1:0][AskBits-1:0]  aw_ask_i,
  input logic [Writers-1:0]               w_valid_i,
  input logic [Writers-1:0][Width-1:0]    w_data_i,
  input logic [Writers-1:0]               w_strb_i,
  input logic                             ar_ready_i,
  input logic                             r_valid_i,
  input logic [PortBits-1:0]              r_id_i,
  input logic [Width-1:0]                 r_data_i,
  input logic [1:0]                       r_resp_i,
  input logic                             r_last_i,
  input logic                             aw_ready_i,
  input logic                             w_ready_i,
  input logic                             b_valid_i,
  input logic [PortBits-1:0]              b_id_i,
  input logic [1:0]                       b_resp_i
);

  localparam int unsigned CountBits = 12;  // of what is under way

  logic                             rst_n, drained, stuck;
  logic [Readers-1:0]               ar_ready, ar_taken, r_valid;
  logic [Readers-1:0][IdBits-1:0]   ar_id;
  logic [Readers-1:0][AddrBits-1:0] ar_addr;
  logic [Readers-1:0][7:0]          ar_len;
  logic [Readers-1:0][2:0]          ar_size;
  logic [Writers-1:0]               aw_ready, aw_taken, w_ready, w_taken, b_valid;
  logic [Writers-1:0][IdBits-1:0]   aw_id;
  logic [Writers-1:0][AddrBits-1:0] aw_addr;
  logic [Writers-1:0][7:0]          aw_len;
  logic [Writers-1:0][2:0]          aw_size;
  logic [IdBits-1:0]                r_id, b_id;
  logic [Width-1:0]                 r_data, w_data;
  logic [1:0]                       r_resp, b_resp, port_ar_burst, port_aw_burst;
  logic                             r_last, r_ready, b_ready;
  logic                             port_ar_valid, port_aw_valid, port_w_valid, port_w_strb, port_w_last;
  logic [PortBits-1:0]              port_ar_id, port_aw_id;
  logic [AddrBits-1:0]              port_ar_addr, port_aw_addr;
  logic [7:0]                       port_ar_len, port_aw_len;
  logic [2:0]                       port_ar_size, port_aw_size;
  logic [3:0]                       port_ar_qos, port_aw_qos;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  for (genvar k = 0; k < Readers; k++) begin : gen_reader
    assign {ar_id[k], ar_addr[k], ar_len[k], ar_size[k]} = ar_ask_i[k];
  end
  for (genvar k = 0; k < Writers; k++) begin : gen_writer
    assign {aw_id[k], aw_addr[k], aw_len[k], aw_size[k]} = aw_ask_i[k];
  end

  flk_axi_arbiter #(
    .Readers (Readers),
    .Writers (Writers),
    .AddrBits(AddrBits),
    .Width   (Width),
    .IdBits  (IdBits),
    .Patience(Patience),
    .Orders  (Orders)
  ) dut (
    .clk_i,
    .rst_ni    (rst_n),
    .hold_i,
    .drained_o (drained),
    .clear_i,
    .timeout_i (32'd0),
    .stuck_o   (stuck),
    .ar_valid_i,
    .ar_ready_o(ar_ready),
    .ar_id_i   (ar_id),
    .ar_addr_i (ar_addr),
    .ar_len_i  (ar_len),
    .ar_size_i (ar_size),
    .r_valid_o (r_valid),
    .r_id_o    (r_id),
    .r_data_o  (r_data),
    .r_resp_o  (r_resp),
    .r_last_o  (r_last),
    .aw_valid_i,
    .aw_ready_o(aw_ready),
    .aw_id_i   (aw_id),
    .aw_addr_i (aw_addr),
    .aw_len_i  (aw_len),
    .aw_size_i (aw_size),
    .w_valid_i,
    .w_ready_o (w_ready),
    .w_data_i,
    .w_strb_i,
    .b_valid_o (b_valid),
    .b_id_o    (b_id),
    .b_resp_o  (b_resp),
    .ar_valid_o(port_ar_valid),
    .ar_ready_i,
    .ar_id_o   (port_ar_id),
    .ar_addr_o (port_ar_addr),
    .ar_len_o  (port_ar_len),
    .ar_size_o (port_ar_size),
    .ar_burst_o(port_ar_burst),
    .ar_qos_o  (port_ar_qos),
    .r_valid_i,
    .r_ready_o (r_ready),
    .r_id_i,
    .r_data_i,
    .r_resp_i,
    .r_last_i,
    .aw_valid_o(port_aw_valid),
    .aw_ready_i,
    .aw_id_o   (port_aw_id),
    .aw_addr_o (port_aw_addr),
    .aw_len_o  (port_aw_len),
    .aw_size_o (port_aw_size),
    .aw_burst_o(port_aw_burst),
    .aw_qos_o  (port_aw_qos),
    .w_valid_o (port_w_valid),
    .w_ready_i,
    .w_data_o  (w_data),
    .w_strb_o  (port_w_strb),
    .w_last_o  (port_w_last),
    .b_valid_i,
    .b_ready_o (b_ready),
    .b_id_i,
    .b_resp_i
  );

  assign ar_taken = ar_valid_i & ar_ready;
  assign aw_taken = aw_valid_i & aw_ready;
  assign w_taken  = w_valid_i & w_ready;

  // ---- addresses ------------------------------------------------------------------------------------

  logic [IndexBits-1:0]         ar_who, aw_who;    // whose address is taken
  logic [1:0]                   ar_inside, ar_ahead, aw_inside, aw_ahead;
  logic                         ar_watching, aw_watching;
  logic [IndexBits+AskBits-1:0] ar_watched, aw_watched;
  logic [ReadBits-1:0]          reader_q;
  logic [WriteBits-1:0]         writer_q;

  always_comb begin
    ar_who = '0;
    aw_who = '0;
    for (int unsigned k = 0; k < Readers; k++) begin
      ar_who |= ar_taken[k] ? IndexBits'(k) : '0;
    end
    for (int unsigned k = 0; k < Writers; k++) begin
      aw_who |= aw_taken[k] ? IndexBits'(k) : '0;
    end
  end

  fv_stream #(
    .Width   (IndexBits + AskBits),
    .Capacity(2)
  ) i_reads (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (ar_taken != '0),
    .in_data_i  ({ar_who, ar_ask_i[ReadBits'(ar_who)]}),
    .out_valid_i(port_ar_valid),
    .out_ready_i(ar_ready_i),
    .out_data_i ({port_ar_id, port_ar_addr, port_ar_len, port_ar_size}),
    .inside_o   (ar_inside),
    .watching_o (ar_watching),
    .ahead_o    (ar_ahead),
    .watched_o  (ar_watched)
  );

  fv_stream #(
    .Width   (IndexBits + AskBits),
    .Capacity(2)
  ) i_writes (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (aw_taken != '0),
    .in_data_i  ({aw_who, aw_ask_i[WriteBits'(aw_who)]}),
    .out_valid_i(port_aw_valid),
    .out_ready_i(aw_ready_i),
    .out_data_i ({port_aw_id, port_aw_addr, port_aw_len, port_aw_size}),
    .inside_o   (aw_inside),
    .watching_o (aw_watching),
    .ahead_o    (aw_ahead),
    .watched_o  (aw_watched)
  );

  fv_turns #(
    .Inputs  (Readers),
    .Patience(Patience)
  ) i_read_turns (
    .clk_i,
    .rst_ni  (rst_n),
    .pick_i  (reader_q),
    .valid_i (ar_valid_i),
    .taken_i (ar_taken),
    .passed_i(dut.i_read_arbiter.passed_q)
  );

  fv_turns #(
    .Inputs  (Writers),
    .Patience(Patience)
  ) i_write_turns (
    .clk_i,
    .rst_ni  (rst_n),
    .pick_i  (writer_q),
    .valid_i (aw_valid_i),
    .taken_i (aw_taken),
    .passed_i(dut.i_write_arbiter.passed_q)
  );

  // ---- what is under way ----------------------------------------------------------------------------

  logic [CountBits-1:0] asked_q;     // read bursts that left the port and have not ended
  logic [CountBits-1:0] unanswered_q;  // write bursts whose address left, not answered
  logic [CountBits-1:0] written_q;   // whose last beat left, not answered
  logic [SlotBits-1:0]  pending_q;   // whose address was taken and whose last beat has not left
  logic [CountBits:0]   reads, writes;  // under way
  logic                 port_last, held_q, quiet_q, busy_q;

  assign port_last = port_w_valid && w_ready_i && port_w_last;
  assign reads     = (CountBits + 1)'(asked_q) + (CountBits + 1)'(ar_inside);
  assign writes    = (CountBits + 1)'(unanswered_q) + (CountBits + 1)'(aw_inside);

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      asked_q      <= '0;
      unanswered_q <= '0;
      written_q    <= '0;
      pending_q    <= '0;
      held_q       <= 1'b0;
      quiet_q      <= 1'b1;
      busy_q       <= 1'b0;
    end else begin
      held_q  <= hold_i;
      quiet_q <= drained || clear_i;
      busy_q  <= hold_i && !clear_i;
      if (clear_i) begin
        asked_q      <= '0;
        unanswered_q <= '0;
        written_q    <= '0;
        pending_q    <= '0;
      end else begin
        asked_q      <= asked_q + CountBits'(port_ar_valid && ar_ready_i) - CountBits'(r_valid_i && r_last_i);
        unanswered_q <= unanswered_q + CountBits'(port_aw_valid && aw_ready_i) - CountBits'(b_valid_i);
        written_q    <= written_q + CountBits'(port_last) - CountBits'(b_valid_i);
        pending_q    <= pending_q + SlotBits'(aw_taken != '0) - SlotBits'(port_last);
      end
    end
  end

  // ---- write data: one burst and one beat of it -----------------------------------------------------

  localparam int unsigned OwedBits = 8 + SlotBits + 1;

  logic                watching_q, got_q;
  logic [7:0]          len_q, index_q;  // of the burst; its beat that is followed
  logic [SlotBits-1:0] before_q;        // bursts whose data leave before
  logic [OwedBits-1:0] owed_q;          // beats of writer_q for the addresses that were taken
  logic [OwedBits-1:0] to_go_q;         // beats that it hands over before the one that is followed
  logic [OwedBits-1:0] owed;            // behind this cycle
  logic [Width:0]      beat_q;          // with its strobe
  logic [7:0]          left_q;          // beats that have left of the burst that leaves
  logic                follow, own;     // own: the beat at the port is of the burst that is followed

  assign owed   = owed_q - OwedBits'(w_taken[writer_q]);
  assign follow = pick_i && !watching_q && aw_taken[writer_q];
  assign own    = watching_q && before_q == '0 && port_w_valid;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      watching_q <= 1'b0;
      owed_q     <= '0;
      left_q     <= '0;
    end else if (clear_i || (hold_i && drained)) begin
      watching_q <= 1'b0;
      owed_q     <= '0;
      left_q     <= '0;
    end else begin
      owed_q <= owed + (aw_taken[writer_q] ? OwedBits'(aw_len[writer_q]) + 1'b1 : '0);
      if (port_w_valid && w_ready_i) begin
        left_q <= port_w_last ? 8'd0 : left_q + 8'd1;
      end
      if (follow) begin
        watching_q <= 1'b1;
      end else if (port_last && before_q == '0) begin
        watching_q <= 1'b0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    reader_q <= reader_q;
    writer_q <= writer_q;
    if (follow) begin
      len_q    <= aw_len[writer_q];
      index_q  <= index_i;
      before_q <= pending_q - SlotBits'(port_last);
      to_go_q  <= owed + OwedBits'(index_i);
      got_q    <= 1'b0;
    end else begin
      before_q <= before_q - SlotBits'(port_last);
      if (watching_q && !got_q && w_taken[writer_q]) begin
        to_go_q <= to_go_q - 1'b1;
        if (to_go_q == '0) begin
          got_q  <= 1'b1;
          beat_q <= {w_strb_i[writer_q], w_data_i[writer_q]};
        end
      end
    end
  end

  // ---- read beats: a cycle later --------------------------------------------------------------------

  logic                beat_valid_q, beat_last_q;
  logic [PortBits-1:0] beat_id_q;
  logic [Width-1:0]    beat_data_q;
  logic [1:0]          beat_resp_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      beat_valid_q <= 1'b0;
    end else begin
      beat_valid_q <= r_valid_i && !clear_i;
    end
  end

  always_ff @(posedge clk_i) begin
    beat_id_q   <= r_id_i;
    beat_data_q <= r_data_i;
    beat_resp_q <= r_resp_i;
    beat_last_q <= r_last_i;
  end

  // ---- links: the orders inside ---------------------------------------------------------------------

  localparam logic [SlotBits:0] ORDERS = (SlotBits + 1)'(Orders);

  logic [SlotBits-1:0]              usage, place;  // place: of the burst that is followed, if it is there
  logic                             in_order;
  logic [SlotBits:0]                end_at;
  logic [Orders-1:0][WriteBits-1:0] order_writer;  // from the oldest one
  logic [Orders-1:0][7:0]           order_len;
  logic [OwedBits-1:0]              sum, sum_before, passed;

  assign usage    = SlotBits'(dut.i_order.usage_q);
  assign place    = before_q - SlotBits'(port_w_valid && port_w_last);
  assign in_order = !(before_q == '0 && port_w_valid && port_w_last);
  assign end_at   = (SlotBits + 1)'(dut.i_order.read_q) + (SlotBits + 1)'(usage);
  assign passed   = usage != '0 && order_writer[0] == writer_q ? OwedBits'(dut.beats_q) : '0;

  for (genvar k = 0; k < Orders; k++) begin : gen_order
    localparam int unsigned PtrBits = Orders > 1 ? $clog2(Orders) : 1;
    logic [PtrBits:0] at;
    assign at = (PtrBits + 1)'(dut.i_order.read_q) + (PtrBits + 1)'(k);
    assign {order_writer[k], order_len[k]} =
        dut.i_order.storage_q[PtrBits'(at >= (PtrBits + 1)'(Orders) ? at - (PtrBits + 1)'(Orders) : at)];
    always_comb begin
      if (rst_n) begin
        l_writer: assert (SlotBits'(k) >= usage || 32'(order_writer[k]) < Writers);
      end
    end
  end

  always_comb begin
    sum        = '0;
    sum_before = '0;
    for (int unsigned k = 0; k < Orders; k++) begin
      if (SlotBits'(k) < usage && order_writer[k] == writer_q) begin
        sum += OwedBits'(order_len[k]) + 1'b1;
        if (SlotBits'(k) < place) begin
          sum_before += OwedBits'(order_len[k]) + 1'b1;
        end
      end
    end
  end

  // ---- claims ---------------------------------------------------------------------------------------

  always_comb begin
    m_reader: assume (32'(reader_q) < Readers && reader_i == reader_q);
    m_writer: assume (32'(writer_q) < Writers && writer_i == writer_q);
    m_index: assume (!follow || index_i <= aw_len[writer_q]);
    m_hold: assume (!(held_q && !hold_i) || quiet_q);
    m_beat: assume (!r_valid_i || (asked_q != '0 && 32'(r_id_i[PortBits-1:IdBits]) < Readers));
    m_answer: assume (!b_valid_i ||
                      (unanswered_q != '0 && written_q != '0 && 32'(b_id_i[PortBits-1:IdBits]) < Writers));

    if (rst_n) begin
      // Addresses.
      a_one: assert ((ar_taken & (ar_taken - 1'b1)) == '0 && (aw_taken & (aw_taken - 1'b1)) == '0);
      a_reads: assert ((ar_taken != '0) ==
                       (ar_valid_i != '0 && !hold_i && ar_inside != 2'd2 && !(&reads[CountBits-1:0])));
      a_writes: assert ((aw_taken != '0) ==
                        (aw_valid_i != '0 && !hold_i && aw_inside != 2'd2 && !(&writes[CountBits-1:0]) &&
                         32'(pending_q) - 32'(port_w_valid && port_w_last) < Orders));
      a_shown: assert (port_ar_valid == (ar_inside != '0) && port_aw_valid == (aw_inside != '0));
      a_fields: assert (port_ar_burst == 2'b01 && port_aw_burst == 2'b01 &&
                        port_ar_qos == 4'd15 - 4'(port_ar_id >> IdBits) &&
                        port_aw_qos == 4'd15 - 4'(port_aw_id >> IdBits));

      // Answers.
      a_ready: assert (r_ready && b_ready);
      a_beat: assert (r_valid == (Readers'(beat_valid_q) << (beat_id_q >> IdBits)));
      if (beat_valid_q) begin
        a_beat_is: assert (r_id == beat_id_q[IdBits-1:0] && r_data == beat_data_q && r_resp == beat_resp_q &&
                           r_last == beat_last_q);
      end
      a_answer: assert (b_valid == (Writers'(b_valid_i) << (b_id_i >> IdBits)));
      a_answer_is: assert (b_id == b_id_i[IdBits-1:0] && b_resp == b_resp_i);

      // Write data.
      a_one_beat: assert ((w_taken & (w_taken - 1'b1)) == '0);
      a_asked_for: assert (!w_taken[writer_q] || owed_q != '0);
      a_due: assert (!port_w_valid || pending_q != '0);
      if (own) begin
        a_last: assert (left_q <= len_q && port_w_last == (left_q == len_q));
        if (left_q == index_q) begin
          a_data: assert (got_q ? {port_w_strb, w_data} == beat_q : held_q && !port_w_strb);
        end
      end

      // Hold.
      if (hold_i) begin
        a_hold: assert (ar_taken == '0 && aw_taken == '0 && w_taken == '0);
      end
      if (busy_q) begin
        a_filled: assert (pending_q == '0 || port_w_valid);
      end
      a_drained: assert (drained == (reads == '0 && writes == '0 && r_valid == '0));
      if (drained) begin
        a_empty: assert (!port_ar_valid && !port_aw_valid && !port_w_valid && pending_q == '0);
      end

      // Links.
      l_reads: assert (reads == (CountBits + 1)'(dut.reads_q));
      l_writes: assert (writes == (CountBits + 1)'(dut.writes_q));
      l_taken: assert ((CountBits + 1)'(written_q) + (CountBits + 1)'(pending_q) == writes);
      l_room: assert (dut.i_read_address.in_ready_o == (ar_inside != 2'd2) &&
                      dut.i_write_address.in_ready_o == (aw_inside != 2'd2));
      if (ar_watching) begin
        l_read: assert (ar_watched[AskBits-1:0] ==
                        (ar_ahead == '0 ? dut.i_read_address.out_data_q[AskBits-1:0]
                                        : dut.i_read_address.skid_data_q[AskBits-1:0]) &&
                        ar_watched[AskBits+:IndexBits] == IndexBits'(
                        (ar_ahead == '0 ? dut.i_read_address.out_data_q
                                        : dut.i_read_address.skid_data_q) >> AskBits));
      end
      if (aw_watching) begin
        l_write: assert (aw_watched[AskBits-1:0] ==
                         (aw_ahead == '0 ? dut.i_write_address.out_data_q[AskBits-1:0]
                                         : dut.i_write_address.skid_data_q[AskBits-1:0]) &&
                         aw_watched[AskBits+:IndexBits] == IndexBits'(
                         (aw_ahead == '0 ? dut.i_write_address.out_data_q
                                         : dut.i_write_address.skid_data_q) >> AskBits));
      end
      l_order: assert (32'(dut.i_order.read_q) < Orders && 32'(usage) <= Orders &&
                       (SlotBits + 1)'(dut.i_order.write_q) == (end_at >= ORDERS ? end_at - ORDERS : end_at));
      l_pending: assert (pending_q == usage + SlotBits'(port_w_valid && port_w_last) && 32'(pending_q) <= Orders + 1);
      l_beats: assert (usage == '0 ? dut.beats_q == '0 : dut.beats_q <= order_len[0]);
      l_left: assert (port_w_valid && port_w_last ? dut.beats_q == '0 : dut.beats_q == left_q + 8'(port_w_valid));
      l_held: assert (!(held_q && quiet_q) || (drained && !watching_q && owed_q == '0));
      if (!held_q) begin
        l_owed: assert (owed_q == sum - passed);
      end
      if (watching_q) begin
        l_before: assert (before_q < pending_q && index_q <= len_q);
        if (in_order) begin
          l_there: assert (order_writer[place] == writer_q && order_len[place] == len_q);
        end else begin
          l_last: assert (left_q == len_q);
        end
        if (got_q) begin
          l_got: assert (!in_order || (place == '0 && dut.beats_q > index_q));
        end else if (!held_q) begin
          l_to_go: assert (in_order && to_go_q == sum_before + OwedBits'(index_q) - passed);
          l_behind: assert (place != '0 || dut.beats_q <= index_q);
        end
      end
      l_beat: assert (beat_valid_q == dut.beat_valid_q);
      if (beat_valid_q) begin
        l_beat_is: assert ({beat_id_q, beat_data_q, beat_resp_q, beat_last_q} ==
                           {dut.beat_id_q, dut.beat_data_q, dut.beat_resp_q, dut.beat_last_q} &&
                           32'(beat_id_q >> IdBits) < Readers);
      end

      c_second: cover (own && got_q && index_q == 8'd1 && left_q == 8'd1 && port_w_last && w_ready_i && !held_q &&
                       writes[1:0] == 2'd3);
      c_filled: cover (drained && hold_i && held_q && quiet_q);
      c_part: cover (own && left_q == index_q && index_q == 8'd2 && !got_q && pending_q == SlotBits'(2));
      c_beat: cover (beat_valid_q && beat_last_q && reads[1:0] == 2'd2);
    end
  end

endmodule
