// AXI4 managers that share one memory port: arbiters of reads and writes, a drain, a watch.
//
// Readers and writers are apart, manager 0 of each first (flk_priority_arbiter: the lowest waiting
// manager goes, none is passed over more than Patience times before it is urgent). The quality of
// service that the port shows is that order: 15 for manager 0, one less for each further. An identifier at the port is the
// manager's index above its own identifier, so that the memory may answer managers in any order and
// each identifier's answers stay in order. Writes: data pass in the order of the addresses.
// Managers take every beat and every answer in the cycle in which it comes (they ask for what has a
// place), so none waits behind another one's; all bursts are INCR.
//
// hold_i (a level, until the managers are reset): no address and no data are taken from managers;
// what has been asked for comes, and data that are missing are replaced by beats without strobes.
// drained_o: nothing is under way. Managers may then be reset; hold_i may fall after that.
// clear_i forgets what is under way, for a memory that is reset as well.
// stuck_o: a burst was under way (taken from its manager, not answered) and no channel moved for timeout_i
// cycles (0: never); stays until clear_i.
//
// Latency of addresses 1 and of read beats 1; write data 1, answers 0. Combinational: hold_i and valid of all managers
// to their ar_ready_o, aw_ready_o; hold_i and w_ready_i to w_ready_o; b_* through. All else depends on registers alone.
module flk_axi_arbiter #(
  parameter  int unsigned Readers   = 6,
  parameter  int unsigned Writers   = 3,
  parameter  int unsigned AddrBits  = 40,
  parameter  int unsigned Width     = 512,
  parameter  int unsigned IdBits    = 4,     // of a manager
  parameter  int unsigned Patience  = 16,
  parameter  int unsigned Orders    = 16,    // write bursts whose data have not passed
  localparam int unsigned Bytes     = Width / 8,
  localparam int unsigned ReadBits  = Readers > 1 ? $clog2(Readers) : 1,
  localparam int unsigned WriteBits = Writers > 1 ? $clog2(Writers) : 1,
  localparam int unsigned IndexBits = ReadBits > WriteBits ? ReadBits : WriteBits,
  localparam int unsigned PortBits  = IdBits + IndexBits
) (
  input  logic                              clk_i,
  input  logic                              rst_ni,
  // Drain and watch
  input  logic                              hold_i,
  output logic                              drained_o,
  input  logic                              clear_i,
  input  logic [31:0]                       timeout_i,
  output logic                              stuck_o,
  // Readers
  input  logic [Readers-1:0]                ar_valid_i,
  output logic [Readers-1:0]                ar_ready_o,
  input  logic [Readers-1:0][IdBits-1:0]    ar_id_i,
  input  logic [Readers-1:0][AddrBits-1:0]  ar_addr_i,
  input  logic [Readers-1:0][7:0]           ar_len_i,
  input  logic [Readers-1:0][2:0]           ar_size_i,
  output logic [Readers-1:0]                r_valid_o,
  output logic [IdBits-1:0]                 r_id_o,
  output logic [Width-1:0]                  r_data_o,
  output logic [1:0]                        r_resp_o,
  output logic                              r_last_o,
  // Writers
  input  logic [Writers-1:0]                aw_valid_i,
  output logic [Writers-1:0]                aw_ready_o,
  input  logic [Writers-1:0][IdBits-1:0]    aw_id_i,
  input  logic [Writers-1:0][AddrBits-1:0]  aw_addr_i,
  input  logic [Writers-1:0][7:0]           aw_len_i,
  input  logic [Writers-1:0][2:0]           aw_size_i,
  input  logic [Writers-1:0]                w_valid_i,
  output logic [Writers-1:0]                w_ready_o,
  input  logic [Writers-1:0][Width-1:0]     w_data_i,
  input  logic [Writers-1:0][Bytes-1:0]     w_strb_i,
  output logic [Writers-1:0]                b_valid_o,
  output logic [IdBits-1:0]                 b_id_o,
  output logic [1:0]                        b_resp_o,
  // Port
  output logic                              ar_valid_o,
  input  logic                              ar_ready_i,
  output logic [PortBits-1:0]               ar_id_o,
  output logic [AddrBits-1:0]               ar_addr_o,
  output logic [7:0]                        ar_len_o,
  output logic [2:0]                        ar_size_o,
  output logic [1:0]                        ar_burst_o,
  output logic [3:0]                        ar_qos_o,
  input  logic                              r_valid_i,
  output logic                              r_ready_o,
  input  logic [PortBits-1:0]               r_id_i,
  input  logic [Width-1:0]                  r_data_i,
  input  logic [1:0]                        r_resp_i,
  input  logic                              r_last_i,
  output logic                              aw_valid_o,
  input  logic                              aw_ready_i,
  output logic [PortBits-1:0]               aw_id_o,
  output logic [AddrBits-1:0]               aw_addr_o,
  output logic [7:0]                        aw_len_o,
  output logic [2:0]                        aw_size_o,
  output logic [1:0]                        aw_burst_o,
  output logic [3:0]                        aw_qos_o,
  output logic                              w_valid_o,
  input  logic                              w_ready_i,
  output logic [Width-1:0]                  w_data_o,
  output logic [Bytes-1:0]                  w_strb_o,
  output logic                              w_last_o,
  input  logic                              b_valid_i,
  output logic                              b_ready_o,
  input  logic [PortBits-1:0]               b_id_i,
  input  logic [1:0]                        b_resp_i
);

  localparam int unsigned AskBits = IdBits + AddrBits + 11;
  localparam int unsigned CountBits = 12;  // of what is under way

  if (Readers > 16 || Writers > 16) begin : gen_check
    $error("flk_axi_arbiter: at most 16 readers and writers");
  end

  // ---- addresses ------------------------------------------------------------------------------------

  logic [Readers-1:0][AskBits-1:0] read_ask;
  logic [Writers-1:0][AskBits-1:0] write_ask;
  logic [AskBits-1:0]              read_chosen, write_chosen, read_out, write_out;
  logic [ReadBits-1:0]             reader, read_index;
  logic [WriteBits-1:0]            writer, write_index;
  logic                            read_valid, read_ready, read_take, read_room;
  logic                            write_valid, write_ready, write_take, write_room;
  logic                            order_room, order_valid, order_pop;
  logic [WriteBits-1:0]            order_writer;
  logic [7:0]                      order_len;
  logic [CountBits-1:0]            reads_q, writes_q;  // bursts under way

  for (genvar k = 0; k < Readers; k++) begin : gen_reader
    assign read_ask[k] = {ar_id_i[k], ar_addr_i[k], ar_len_i[k], ar_size_i[k]};
  end
  for (genvar k = 0; k < Writers; k++) begin : gen_writer
    assign write_ask[k] = {aw_id_i[k], aw_addr_i[k], aw_len_i[k], aw_size_i[k]};
  end

  flk_priority_arbiter #(
    .Inputs  (Readers),
    .Width   (AskBits),
    .Patience(Patience)
  ) i_read_arbiter (
    .clk_i,
    .rst_ni,
    .in_valid_i (ar_valid_i),
    .in_ready_o (ar_ready_o),
    .in_data_i  (read_ask),
    .out_valid_o(read_valid),
    .out_ready_i(read_ready && !hold_i && !(&reads_q)),
    .out_data_o (read_chosen),
    .out_index_o(reader)
  );

  flk_priority_arbiter #(
    .Inputs  (Writers),
    .Width   (AskBits),
    .Patience(Patience)
  ) i_write_arbiter (
    .clk_i,
    .rst_ni,
    .in_valid_i (aw_valid_i),
    .in_ready_o (aw_ready_o),
    .in_data_i  (write_ask),
    .out_valid_o(write_valid),
    .out_ready_i(write_ready && order_room && !hold_i && !(&writes_q)),
    .out_data_o (write_chosen),
    .out_index_o(writer)
  );

  assign read_room  = !hold_i && !(&reads_q);
  assign write_room = !hold_i && !(&writes_q) && order_room;
  assign read_take  = read_valid && read_ready && read_room;
  assign write_take = write_valid && write_ready && write_room;

  flk_skid_buffer #(
    .Width(ReadBits + AskBits)
  ) i_read_address (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (read_valid && read_room),
    .in_ready_o (read_ready),
    .in_data_i  ({reader, read_chosen}),
    .out_valid_o(ar_valid_o),
    .out_ready_i(ar_ready_i),
    .out_data_o ({read_index, read_out})
  );

  flk_skid_buffer #(
    .Width(WriteBits + AskBits)
  ) i_write_address (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (write_valid && write_room),
    .in_ready_o (write_ready),
    .in_data_i  ({writer, write_chosen}),
    .out_valid_o(aw_valid_o),
    .out_ready_i(aw_ready_i),
    .out_data_o ({write_index, write_out})
  );

  assign ar_id_o[PortBits-1:IdBits] = IndexBits'(read_index);
  assign aw_id_o[PortBits-1:IdBits] = IndexBits'(write_index);
  assign {ar_id_o[IdBits-1:0], ar_addr_o, ar_len_o, ar_size_o} = read_out;
  assign {aw_id_o[IdBits-1:0], aw_addr_o, aw_len_o, aw_size_o} = write_out;
  assign ar_burst_o = 2'b01;
  assign aw_burst_o = 2'b01;
  assign ar_qos_o   = 4'd15 - 4'(read_index);
  assign aw_qos_o   = 4'd15 - 4'(write_index);

  // ---- read beats -----------------------------------------------------------------------------------

  logic                beat_valid_q, beat_last_q;
  logic [PortBits-1:0] beat_id_q;
  logic [Width-1:0]    beat_data_q;
  logic [1:0]          beat_resp_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      beat_valid_q <= 1'b0;
    end else begin
      beat_valid_q <= r_valid_i && !clear_i;
    end
  end

  always_ff @(posedge clk_i) begin
    if (r_valid_i) begin
      beat_id_q   <= r_id_i;
      beat_data_q <= r_data_i;
      beat_resp_q <= r_resp_i;
      beat_last_q <= r_last_i;
    end
  end

  for (genvar k = 0; k < Readers; k++) begin : gen_beat
    assign r_valid_o[k] = beat_valid_q && beat_id_q[PortBits-1:IdBits] == IndexBits'(k);
  end

  assign r_ready_o = 1'b1;
  assign r_id_o    = beat_id_q[IdBits-1:0];
  assign r_data_o  = beat_data_q;
  assign r_resp_o  = beat_resp_q;
  assign r_last_o  = beat_last_q;

  // ---- write data -----------------------------------------------------------------------------------

  logic       data_valid, data_ready, data_move, data_last, unused_full, unused_empty;
  logic [$clog2(Orders+1)-1:0] unused_usage;
  logic [7:0] beats_q;  // of the burst at the head of the order that have passed

  flk_fifo #(
    .Width(WriteBits + 8),
    .Depth(Orders)
  ) i_order (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (write_take),
    .in_ready_o (order_room),
    .in_data_i  ({writer, write_chosen[10:3]}),
    .out_valid_o(order_valid),
    .out_ready_i(order_pop),
    .out_data_o ({order_writer, order_len}),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (unused_empty)
  );

  assign data_valid = order_valid && (hold_i || w_valid_i[order_writer]);
  assign data_move  = data_valid && data_ready;
  assign data_last  = beats_q == order_len;
  assign order_pop  = data_move && data_last;

  always_comb begin
    w_ready_o               = '0;
    w_ready_o[order_writer] = order_valid && data_ready && !hold_i;
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      beats_q <= '0;
    end else if (clear_i || order_pop) begin
      beats_q <= '0;
    end else if (data_move) begin
      beats_q <= beats_q + 1'b1;
    end
  end

  flk_pipe_reg #(
    .Width(1 + Bytes + Width)
  ) i_data (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (data_valid),
    .in_ready_o (data_ready),
    .in_data_i  ({data_last, hold_i ? Bytes'(0) : w_strb_i[order_writer], w_data_i[order_writer]}),
    .out_valid_o(w_valid_o),
    .out_ready_i(w_ready_i),
    .out_data_o ({w_last_o, w_strb_o, w_data_o})
  );

  // ---- answers --------------------------------------------------------------------------------------

  for (genvar k = 0; k < Writers; k++) begin : gen_answer
    assign b_valid_o[k] = b_valid_i && b_id_i[PortBits-1:IdBits] == IndexBits'(k);
  end

  assign b_ready_o = 1'b1;
  assign b_id_o    = b_id_i[IdBits-1:0];
  assign b_resp_o  = b_resp_i;

  // ---- what is under way, and whether it moves --------------------------------------------------------

  logic        busy, moves, stuck_q;
  logic [31:0] still_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      reads_q  <= '0;
      writes_q <= '0;
    end else if (clear_i) begin
      reads_q  <= '0;
      writes_q <= '0;
    end else begin
      reads_q  <= reads_q + CountBits'(read_take) - CountBits'(r_valid_i && r_last_i);
      writes_q <= writes_q + CountBits'(write_take) - CountBits'(b_valid_i);
    end
  end

  assign busy  = reads_q != '0 || writes_q != '0;
  assign moves = (ar_valid_o && ar_ready_i) || r_valid_i || (aw_valid_o && aw_ready_i) ||
                 (w_valid_o && w_ready_i) || b_valid_i;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      still_q <= '0;
      stuck_q <= 1'b0;
    end else if (clear_i) begin
      still_q <= '0;
      stuck_q <= 1'b0;
    end else begin
      still_q <= (moves || !busy) ? '0 : still_q + 1'b1;
      stuck_q <= stuck_q || (timeout_i != '0 && busy && still_q >= timeout_i);
    end
  end

  assign stuck_o   = stuck_q;
  assign drained_o = !busy && !beat_valid_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni || clear_i)
      r_valid_i |-> reads_q != '0 && 32'(r_id_i[PortBits-1:IdBits]) < Readers)
  else $error("flk_axi_arbiter: a read beat that nobody asked for");
  assert property (@(posedge clk_i) disable iff (!rst_ni || clear_i)
      b_valid_i |-> writes_q != '0 && 32'(b_id_i[PortBits-1:IdBits]) < Writers)
  else $error("flk_axi_arbiter: an answer that nobody waits for");
`endif

endmodule
