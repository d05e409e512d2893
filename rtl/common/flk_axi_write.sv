// AXI4 manager that writes: requests for consecutive beats, their beats with strobes, answers.
//
// Requests are split into bursts of at most MaxBeats beats that do not cross 4 KB
// (flk_axi_split); up to Bursts of them are under way, all under the identifier Id, so that their
// answers come in order. Beats of all requests come in one stream, in the order of the requests;
// where a burst ends is counted here. Addresses and data do not wait for each other. done_valid_o
// is high for a cycle when the last burst of a request is answered, done_error_o then says
// whether any of its bursts failed, done_tag_o is its tag. Latency of the addresses 2; beats pass
// combinationally: data_valid_i to w_valid_o, w_ready_i to data_ready_o, at the earliest in the
// cycle after their address is first offered; done 1 after b_valid_i. idle_o: no request inside,
// no answer to come. No clear: what has begun is written. Requests of one beat without tags
// (BeatBits 1, MaxBeats 1, Tagged 0) are counted instead of listed, so that Bursts may be large.
module flk_axi_write #(
  parameter  int unsigned AddrBits = 40,
  parameter  int unsigned BeatBits = 16,
  parameter  int unsigned TagBits  = 1,
  parameter  int unsigned Width    = 512,
  parameter  int unsigned MaxBeats = 16,
  parameter  int unsigned Bursts   = 8,   // under way
  parameter  bit          Tagged   = 1'b1, // requests have tags; else done_tag_o is 0
  parameter  int unsigned IdBits   = 4,
  parameter  int unsigned Id       = 0,
  localparam int unsigned Bytes    = Width / 8
) (
  input  logic                clk_i,
  input  logic                rst_ni,
  output logic                idle_o,
  // Requests
  input  logic                in_valid_i,
  output logic                in_ready_o,
  input  logic [AddrBits-1:0] in_addr_i,
  input  logic [BeatBits-1:0] in_beats_i,
  input  logic [TagBits-1:0]  in_tag_i,
  // Beats
  input  logic                data_valid_i,
  output logic                data_ready_o,
  input  logic [Width-1:0]    data_data_i,
  input  logic [Bytes-1:0]    data_strb_i,
  // Requests that are written
  output logic                done_valid_o,
  output logic                done_error_o,
  output logic [TagBits-1:0]  done_tag_o,
  // AXI4
  output logic                aw_valid_o,
  input  logic                aw_ready_i,
  output logic [IdBits-1:0]   aw_id_o,
  output logic [AddrBits-1:0] aw_addr_o,
  output logic [7:0]          aw_len_o,
  output logic [2:0]          aw_size_o,
  output logic [1:0]          aw_burst_o,
  output logic                w_valid_o,
  input  logic                w_ready_i,
  output logic [Width-1:0]    w_data_o,
  output logic [Bytes-1:0]    w_strb_o,
  output logic                w_last_o,
  input  logic                b_valid_i,
  output logic                b_ready_o,
  input  logic [IdBits-1:0]   b_id_i,
  input  logic [1:0]          b_resp_i
);

  if (!Tagged && (BeatBits != 1 || MaxBeats != 1)) begin : gen_check
    $error("flk_axi_write: Tagged 0 wants BeatBits 1 and MaxBeats 1");
  end

  logic split_idle, split_valid, split_ready, split_last;
  logic [TagBits-1:0] split_tag;

  flk_axi_split #(
    .AddrBits(AddrBits),
    .BeatBits(BeatBits),
    .TagBits (TagBits),
    .Bytes   (Bytes),
    .MaxBeats(MaxBeats)
  ) i_split (
    .clk_i,
    .rst_ni,
    .idle_o     (split_idle),
    .in_valid_i,
    .in_ready_o,
    .in_addr_i,
    .in_beats_i,
    .in_tag_i,
    .out_valid_o(split_valid),
    .out_ready_i(split_ready),
    .out_addr_o (aw_addr_o),
    .out_len_o  (aw_len_o),
    .out_last_o (split_last),
    .out_tag_o  (split_tag)
  );

  // A burst goes to the memory (address), to the counter of beats and to the list of answers to
  // come; to the latter two in its first cycle, and no later than its address.

  logic told_d, told_q;  // the burst that is offered has gone to both lists
  logic begin_burst, lengths_room, answers_room, tell;

  assign tell        = split_valid && !told_q && lengths_room && answers_room;
  assign begin_burst = tell || told_q;
  assign aw_valid_o  = split_valid && begin_burst;
  assign split_ready = aw_ready_i && begin_burst;
  assign told_d      = aw_valid_o && !aw_ready_i;
  assign aw_id_o     = IdBits'(Id);
  assign aw_size_o   = 3'($clog2(Bytes));
  assign aw_burst_o  = 2'b01;  // INCR

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      told_q <= 1'b0;
    end else begin
      told_q <= told_d;
    end
  end

  // Beats

  logic       length_valid, w_move;
  logic [7:0] length, beat_d, beat_q;
  logic       answer_valid, answer_last, answer_move, empty;
  logic [TagBits-1:0] answer_tag;

  if (!Tagged) begin : gen_counted
    logic [$clog2(Bursts+1)-1:0] beats_q, answers_q;

    assign lengths_room = 1'b1;  // no more beats than answers to come
    assign answers_room = answers_q != ($clog2(Bursts + 1))'(Bursts);
    assign length_valid = beats_q != '0;
    assign length       = '0;
    assign answer_valid = answers_q != '0;
    assign answer_last  = 1'b1;
    assign answer_tag   = '0;
    assign empty        = !answer_valid;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        beats_q   <= '0;
        answers_q <= '0;
      end else begin
        beats_q   <= beats_q + ($clog2(Bursts + 1))'(tell) - ($clog2(Bursts + 1))'(w_move);
        answers_q <= answers_q + ($clog2(Bursts + 1))'(tell)
                   - ($clog2(Bursts + 1))'(answer_move);
      end
    end

    logic unused_listed;
    assign unused_listed = ^{split_last, split_tag, aw_len_o};
  end else begin : gen_listed
    logic [$clog2(Bursts+1)-1:0] unused_usage, unused_answers;
    logic unused_full, unused_empty, unused_answers_full;

    flk_fifo #(
      .Width(8),
      .Depth(Bursts)
    ) i_lengths (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (tell),
      .in_ready_o (lengths_room),
      .in_data_i  (aw_len_o),
      .out_valid_o(length_valid),
      .out_ready_i(w_move && w_last_o),
      .out_data_o (length),
      .usage_o    (unused_usage),
      .full_o     (unused_full),
      .empty_o    (unused_empty)
    );

    flk_fifo #(
      .Width(TagBits + 1),
      .Depth(Bursts)
    ) i_answers (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (tell),
      .in_ready_o (answers_room),
      .in_data_i  ({split_last, split_tag}),
      .out_valid_o(answer_valid),
      .out_ready_i(b_valid_i),
      .out_data_o ({answer_last, answer_tag}),
      .usage_o    (unused_answers),
      .full_o     (unused_answers_full),
      .empty_o    (empty)
    );
  end

  assign w_valid_o    = data_valid_i && length_valid;
  assign data_ready_o = w_ready_i && length_valid;
  assign w_data_o     = data_data_i;
  assign w_strb_o     = data_strb_i;
  assign w_last_o     = beat_q == length;
  assign w_move       = w_valid_o && w_ready_i;

  always_comb begin
    beat_d = beat_q;
    if (w_move) begin
      beat_d = w_last_o ? '0 : beat_q + 1'b1;
    end
  end

  // Answers

  logic failed_d, failed_q;  // an earlier burst of the request
  logic done_valid_d, done_valid_q, done_error_q;
  logic [TagBits-1:0] done_tag_q;

  assign b_ready_o    = answer_valid;
  assign answer_move  = b_valid_i && answer_valid;
  assign done_valid_d = answer_move && answer_last;

  always_comb begin
    failed_d = failed_q;
    if (answer_move) begin
      failed_d = !answer_last && (failed_q || b_resp_i[1]);
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      beat_q       <= '0;
      failed_q     <= 1'b0;
      done_valid_q <= 1'b0;
    end else begin
      beat_q       <= beat_d;
      failed_q     <= failed_d;
      done_valid_q <= done_valid_d;
    end
  end

  always_ff @(posedge clk_i) begin
    if (done_valid_d) begin
      done_error_q <= failed_q || b_resp_i[1];
      done_tag_q   <= answer_tag;
    end
  end

  assign done_valid_o = done_valid_q;
  assign done_error_o = done_error_q;
  assign done_tag_o   = done_tag_q;
  assign idle_o       = split_idle && empty;

  logic unused_b;
  assign unused_b = ^{b_id_i, b_resp_i[0]};

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      aw_valid_o && !aw_ready_i |=> aw_valid_o && $stable({aw_addr_o, aw_len_o}))
  else $error("flk_axi_write: address changed before its transfer");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      w_valid_o && !w_ready_i |=> w_valid_o && $stable({w_data_o, w_strb_o, w_last_o}))
  else $error("flk_axi_write: data changed before their transfer");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      b_valid_i |-> answer_valid && b_id_i == IdBits'(Id))
  else $error("flk_axi_write: answer that nobody waits for");
`endif

endmodule
