// flk_axi_write, for requests, beats, pauses and answers of any kind.
//
// Addresses: the bursts of the requests, in order, each once (fv_axi_bursts), one offered whenever
// something is to be asked for and fewer than Bursts are begun and not answered, never more,
// whatever the data do.
// Data: a beat leaves in the cycle in which it is taken, so that none is lost, doubled or out of
// order, unchanged, with its strobes; one does whenever there are one, a burst that was offered in
// an earlier cycle and a ready memory, whether or not the address was taken, and never one that no
// burst offered has room for. The last beat of each burst and only it is marked.
// Answers: in the cycle after the answer to a request's last burst, and in no other, done_valid_o,
// with its tag, and an error if any of its bursts failed. idle_o exactly when no request is inside
// and no answer is to come.
//
// The memory: answers bursts in their order, none before its address and its last beat were taken.
// Bursts that have begun are kept here from the oldest one on, the first written_q of them with all
// of their data at the memory. The assertions l_* link registers to them, which induction needs.
// Tagged 0: all bursts are equal, so that their numbers are enough.
module fv_axi_write #(
  parameter  int unsigned AddrBits  = 14,
  parameter  int unsigned BeatBits  = 6,
  parameter  int unsigned Width     = 512,
  parameter  int unsigned MaxBeats  = 4,
  parameter  int unsigned Bursts    = 2,
  parameter  bit          Tagged    = 1'b1,
  parameter  int unsigned Id        = 1,
  localparam int unsigned Bytes     = Width / 8,
  localparam int unsigned BegunBits = $clog2(Bursts + 1)
) (
  input logic                clk_i,
  input logic                again_i,
  input logic                in_valid_i,
  input logic [AddrBits-1:0] in_addr_i,
  input logic [BeatBits-1:0] in_beats_i,
  input logic [1:0]          in_tag_i,
  input logic                data_valid_i,
  input logic [Width-1:0]    data_data_i,
  input logic [Bytes-1:0]    data_strb_i,
  input logic                aw_ready_i,
  input logic                w_ready_i,
  input logic                b_valid_i,
  input logic [1:0]          b_id_i,
  input logic [1:0]          b_resp_i
);

  typedef struct packed {
    logic [7:0] len;
    logic       last;  // of its request
    logic [1:0] tag;
  } burst_t;

  logic rst_n, idle, in_ready, data_ready, done_valid, done_error;
  logic aw_valid, w_valid, w_last, b_ready;
  logic [1:0]          done_tag, aw_id, aw_burst;
  logic [AddrBits-1:0] aw_addr;
  logic [7:0]          aw_len;
  logic [2:0]          aw_size;
  logic [Width-1:0]    w_data;
  logic [Bytes-1:0]    w_strb;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_axi_write #(
    .AddrBits(AddrBits),
    .BeatBits(BeatBits),
    .TagBits (2),
    .Width   (Width),
    .MaxBeats(MaxBeats),
    .Bursts  (Bursts),
    .Tagged  (Tagged),
    .IdBits  (2),
    .Id      (Id)
  ) dut (
    .clk_i,
    .rst_ni      (rst_n),
    .idle_o      (idle),
    .in_valid_i,
    .in_ready_o  (in_ready),
    .in_addr_i,
    .in_beats_i,
    .in_tag_i,
    .data_valid_i,
    .data_ready_o(data_ready),
    .data_data_i,
    .data_strb_i,
    .done_valid_o(done_valid),
    .done_error_o(done_error),
    .done_tag_o  (done_tag),
    .aw_valid_o  (aw_valid),
    .aw_ready_i,
    .aw_id_o     (aw_id),
    .aw_addr_o   (aw_addr),
    .aw_len_o    (aw_len),
    .aw_size_o   (aw_size),
    .aw_burst_o  (aw_burst),
    .w_valid_o   (w_valid),
    .w_ready_i,
    .w_data_o    (w_data),
    .w_strb_o    (w_strb),
    .w_last_o    (w_last),
    .b_valid_i,
    .b_ready_o   (b_ready),
    .b_id_i,
    .b_resp_i
  );

  logic [1:0] requests, tag;
  logic       fresh, last;

  fv_axi_bursts #(
    .AddrBits(AddrBits),
    .BeatBits(BeatBits),
    .Bytes   (Bytes),
    .MaxBeats(MaxBeats)
  ) i_bursts (
    .clk_i,
    .rst_ni      (rst_n),
    .push_i      (in_valid_i && in_ready),
    .in_addr_i,
    .in_beats_i,
    .in_tag_i,
    .valid_i     (aw_valid),
    .ready_i     (aw_ready_i),
    .addr_i      (aw_addr),
    .len_i       (aw_len),
    .size_i      (aw_size),
    .burst_i     (aw_burst),
    .out_valid_i (dut.i_split.out_valid_q),
    .out_last_i  (dut.i_split.out_last_q),
    .out_tag_i   (dut.i_split.out_tag_q),
    .left_valid_i(dut.i_split.left_valid_q),
    .left_line_i (dut.i_split.line_q),
    .left_i      (dut.i_split.left_q),
    .left_tag_i  (dut.i_split.tag_q),
    .inside_o    (requests),
    .fresh_o     (fresh),
    .last_o      (last),
    .tag_o       (tag)
  );

  // ---- bursts that have begun -----------------------------------------------------------------------

  localparam int unsigned Kept = Tagged ? Bursts : 1;
  localparam burst_t ONLY = '{len: 8'd0, last: 1'b1, tag: 2'd0};

  burst_t [Kept-1:0]    begun_d, begun_q;  // the oldest first
  burst_t               writes, answers;   // whose data leave, who is answered
  logic [BegunBits-1:0] count_q, left;     // left: behind what is answered in this cycle
  logic [BegunBits-1:0] written_q;
  logic [7:0]           beat_q;            // beats that left of the burst whose data leave
  logic                 offered_q;         // the youngest one's address waits
  logic                 failed_q;          // an earlier burst of the request that is answered
  logic                 due_q, due_error_q;
  logic [1:0]           due_tag_q;
  logic                 begins, move, answer;

  assign begins  = aw_valid && !offered_q;
  assign move    = w_valid && w_ready_i;
  assign answer  = b_valid_i && b_ready;
  assign left    = count_q - BegunBits'(answer);

  if (Tagged) begin : gen_kept
    assign answers = begun_q[0];
    assign writes  = begun_q[written_q];
  end else begin : gen_equal
    assign answers = ONLY;
    assign writes  = ONLY;
  end

  always_comb begin
    begun_d = answer ? begun_q >> $bits(burst_t) : begun_q;
    for (int unsigned k = 0; k < Kept; k++) begin
      if (begins && left == BegunBits'(k)) begin
        begun_d[k] = '{len: aw_len, last: last, tag: tag};
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      count_q   <= '0;
      written_q <= '0;
      beat_q    <= '0;
      offered_q <= 1'b0;
      failed_q  <= 1'b0;
      due_q     <= 1'b0;
    end else begin
      count_q   <= left + BegunBits'(begins);
      written_q <= written_q + BegunBits'(move && w_last) - BegunBits'(answer);
      offered_q <= aw_valid && !aw_ready_i;
      due_q     <= answer && answers.last;
      if (move) begin
        beat_q <= w_last ? 8'd0 : beat_q + 8'd1;
      end
      if (answer) begin
        failed_q <= (failed_q || b_resp_i[1]) && !answers.last;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    begun_q     <= begun_d;
    due_error_q <= failed_q || b_resp_i[1];
    due_tag_q   <= answers.tag;
  end

  logic w_waited_q, w_last_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) w_waited_q <= 1'b0;
    else w_waited_q <= w_valid && !w_ready_i;
  end
  always_ff @(posedge clk_i) begin
    w_last_q <= w_last;
  end

  // ---- claims ---------------------------------------------------------------------------------------

  always_comb begin
    m_answer: assume (!b_valid_i || (written_q != '0 && count_q > BegunBits'(offered_q)));

    if (rst_n) begin
      // Addresses.
      a_asks: assert (aw_valid || requests == 2'd0 || fresh || count_q == BegunBits'(Bursts));
      a_bursts: assert (!begins || count_q < BegunBits'(Bursts));
      a_id: assert (!aw_valid || 32'(aw_id) == Id);
      a_ready: assert (in_ready ||
                       (requests != 2'd0 && !(requests == 2'd1 && aw_valid && last)));

      // Data.
      a_written: assert (written_q <= count_q);
      a_beat: assert (w_valid == (data_valid_i && written_q != count_q));
      a_taken: assert (data_ready == (w_ready_i && written_q != count_q));
      if (w_valid) begin
        a_data: assert (w_data == data_data_i && w_strb == data_strb_i);
        a_last: assert (w_last == (beat_q == writes.len));
      end
      if (w_waited_q) begin
        a_still: assert (w_valid == data_valid_i && w_last == w_last_q);
      end

      // Answers.
      a_answer: assert (!b_valid_i || b_ready);
      a_done: assert (done_valid == due_q);
      if (done_valid) begin
        a_done_is: assert (done_error == due_error_q && done_tag == due_tag_q);
      end
      a_idle: assert (idle == (requests == 2'd0 && count_q == '0));

      // Links.
      l_count: assert (count_q <= BegunBits'(Bursts));
      l_offered: assert (dut.told_q == offered_q);
      l_beat: assert (dut.beat_q == beat_q &&
                      (written_q == count_q ? beat_q == '0 : beat_q <= writes.len));
      l_failed: assert (dut.failed_q == failed_q);
      if (offered_q) begin
        l_waits: assert (dut.i_split.out_valid_q && count_q != '0);
      end

      c_full: cover (count_q == BegunBits'(Bursts) && requests == 2'd2 && !aw_valid);
      c_first: cover (move && w_last && offered_q && written_q == count_q - 1'b1);
      c_failed: cover (done_valid && done_error && done_tag == (Tagged ? 2'd2 : 2'd0));
      c_behind: cover (aw_valid && aw_ready_i && count_q == BegunBits'(2) && written_q == '0);
      c_part: cover (!Tagged || (due_q && due_error_q && writes.last && written_q != count_q &&
                                 beat_q == 8'd1));
    end
  end

  if (Tagged) begin : gen_lists
    logic [BegunBits-1:0]   lengths;
    logic [Bursts-1:0][2:0] answer_list, answer_storage;
    logic [Bursts-1:0][7:0] length_list, length_storage;

    assign lengths = count_q - written_q;

    for (genvar k = 0; k < Bursts; k++) begin : gen_entry
      assign answer_list[k]    = {begun_q[k].last, begun_q[k].tag};
      assign answer_storage[k] = dut.gen_listed.i_answers.storage_q[k];
      assign length_list[k]    = begun_q[written_q + BegunBits'(k)].len;
      assign length_storage[k] = dut.gen_listed.i_lengths.storage_q[k];
    end

    fv_fifo_list #(
      .Width(3),
      .Depth(Bursts)
    ) i_answers (
      .rst_ni   (rst_n),
      .count_i  (count_q),
      .list_i   (answer_list),
      .usage_i  (dut.gen_listed.i_answers.usage_q),
      .read_i   (dut.gen_listed.i_answers.read_q),
      .write_i  (dut.gen_listed.i_answers.write_q),
      .storage_i(answer_storage)
    );

    fv_fifo_list #(
      .Width(8),
      .Depth(Bursts)
    ) i_lengths (
      .rst_ni   (rst_n),
      .count_i  (lengths),
      .list_i   (length_list),
      .usage_i  (dut.gen_listed.i_lengths.usage_q),
      .read_i   (dut.gen_listed.i_lengths.read_q),
      .write_i  (dut.gen_listed.i_lengths.write_q),
      .storage_i(length_storage)
    );

    always_comb begin
      if (rst_n && due_q) begin
        l_due: assert (dut.done_error_q == due_error_q && dut.done_tag_q == due_tag_q);
      end
    end
  end else begin : gen_counts
    always_comb begin
      if (rst_n) begin
        l_usage: assert (dut.gen_counted.answers_q == count_q &&
                         dut.gen_counted.beats_q == count_q - written_q);
      end
    end
  end

endmodule
