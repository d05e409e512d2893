// flk_axi_read, for requests, pauses and answers of any kind.
//
// Addresses: the bursts of the requests, in order, each once (fv_axi_bursts), one offered whenever
// something is to be asked for and fewer than Bursts are under way, never more.
// Beats: every beat that the memory gives leaves in its cycle, and is taken from the memory exactly
// when it leaves, so that none is lost, doubled or out of order; unchanged, with the tag of the
// request for whose burst it came, marked if it is that request's last one and only then, with an
// error exactly where the memory answered with one.
// idle_o exactly when no request is inside and no beat is to come.
//
// The memory: beats of the bursts that it has taken, in their order, the last of each marked, at
// any time. Bursts under way are kept here from the oldest one on. The assertions l_* link
// registers to them, which induction needs.
module fv_axi_read #(
  parameter  int unsigned AddrBits  = 14,
  parameter  int unsigned BeatBits  = 6,
  parameter  int unsigned Width     = 512,
  parameter  int unsigned MaxBeats  = 4,
  parameter  int unsigned Bursts    = 2,
  parameter  bit          Listed    = 1'b1,
  parameter  int unsigned Id        = 1,
  localparam int unsigned UnderBits = $clog2(Bursts + 1)
) (
  input logic                clk_i,
  input logic                again_i,
  input logic                in_valid_i,
  input logic [AddrBits-1:0] in_addr_i,
  input logic [BeatBits-1:0] in_beats_i,
  input logic [1:0]          in_tag_i,
  input logic                out_ready_i,
  input logic                ar_ready_i,
  input logic                r_valid_i,
  input logic [1:0]          r_id_i,
  input logic [Width-1:0]    r_data_i,
  input logic [1:0]          r_resp_i,
  input logic                r_last_i
);

  typedef struct packed {
    logic [7:0] len;
    logic       last;  // of its request
    logic [1:0] tag;
  } burst_t;

  logic rst_n, idle, in_ready, out_valid, out_last, out_error, ar_valid, r_ready;
  logic [Width-1:0]    out_data;
  logic [1:0]          out_tag, ar_id, ar_burst, ar_tag;
  logic [AddrBits-1:0] ar_addr;
  logic [7:0]          ar_len;
  logic [2:0]          ar_size;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_axi_read #(
    .AddrBits(AddrBits),
    .BeatBits(BeatBits),
    .TagBits (2),
    .Width   (Width),
    .MaxBeats(MaxBeats),
    .Bursts  (Bursts),
    .Listed  (Listed),
    .IdBits  (2),
    .Id      (Id)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .idle_o     (idle),
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_addr_i,
    .in_beats_i,
    .in_tag_i,
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o (out_data),
    .out_tag_o  (out_tag),
    .out_last_o (out_last),
    .out_error_o(out_error),
    .ar_valid_o (ar_valid),
    .ar_ready_i,
    .ar_id_o    (ar_id),
    .ar_addr_o  (ar_addr),
    .ar_len_o   (ar_len),
    .ar_size_o  (ar_size),
    .ar_burst_o (ar_burst),
    .ar_tag_o   (ar_tag),
    .r_valid_i,
    .r_ready_o  (r_ready),
    .r_id_i,
    .r_data_i,
    .r_resp_i,
    .r_last_i
  );

  logic [1:0] requests, tag;
  logic       fresh, last;

  fv_axi_bursts #(
    .AddrBits(AddrBits),
    .BeatBits(BeatBits),
    .Bytes   (Width / 8),
    .MaxBeats(MaxBeats)
  ) i_bursts (
    .clk_i,
    .rst_ni      (rst_n),
    .push_i      (in_valid_i && in_ready),
    .in_addr_i,
    .in_beats_i,
    .in_tag_i,
    .valid_i     (ar_valid),
    .ready_i     (ar_ready_i),
    .addr_i      (ar_addr),
    .len_i       (ar_len),
    .size_i      (ar_size),
    .burst_i     (ar_burst),
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

  // ---- bursts under way -----------------------------------------------------------------------------

  burst_t [Bursts-1:0]  under_d, under_q;  // the oldest first
  logic [UnderBits-1:0] count_q, left;     // left: behind what ends in this cycle
  logic [7:0]           beat_q;            // beats that came of the oldest
  logic                 ask, come, finish;

  assign ask    = ar_valid && ar_ready_i;
  assign come   = r_valid_i && r_ready;
  assign finish = come && r_last_i;
  assign left   = count_q - UnderBits'(finish);

  always_comb begin
    under_d = finish ? under_q >> $bits(burst_t) : under_q;
    for (int unsigned k = 0; k < Bursts; k++) begin
      if (ask && left == UnderBits'(k)) begin
        under_d[k] = '{len: ar_len, last: last, tag: tag};
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      count_q <= '0;
      beat_q  <= '0;
    end else begin
      count_q <= left + UnderBits'(ask);
      if (come) begin
        beat_q <= r_last_i ? 8'd0 : beat_q + 8'd1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    under_q <= under_d;
  end

  // ---- claims ---------------------------------------------------------------------------------------

  always_comb begin
    m_tag: assume (Listed || in_tag_i == '0);
    m_beat: assume (!r_valid_i || (count_q != '0 && r_last_i == (beat_q == under_q[0].len)));

    if (rst_n) begin
      // Addresses.
      a_asks: assert (ar_valid || requests == 2'd0 || fresh || count_q == UnderBits'(Bursts));
      a_bursts: assert (!ar_valid || count_q < UnderBits'(Bursts));
      a_id: assert (!ar_valid || (32'(ar_id) == Id && ar_tag == tag));
      a_ready: assert (in_ready ||
                       (requests != 2'd0 && !(requests == 2'd1 && ar_valid && last)));

      // Beats.
      a_beat: assert (out_valid == r_valid_i);
      a_taken: assert (!r_valid_i || r_ready == out_ready_i);
      if (out_valid) begin
        a_data: assert (out_data == r_data_i);
        a_error: assert (out_error == r_resp_i[1]);
        a_tag: assert (out_tag == under_q[0].tag);
        a_last: assert (out_last == (under_q[0].last && beat_q == under_q[0].len));
      end
      a_idle: assert (idle == (requests == 2'd0 && count_q == '0));

      // Links.
      l_beat: assert (count_q == '0 ? beat_q == '0 : beat_q <= under_q[0].len);

      c_full: cover (count_q == UnderBits'(Bursts) && requests == 2'd2 && !ar_valid);
      c_tag: cover (come && out_last && count_q > UnderBits'(1) &&
                    under_q[Bursts > 1].tag != out_tag);
      c_last: cover (come && out_last && beat_q == 8'd1 && out_error);
    end
  end

  if (Listed) begin : gen_listed
    logic [Bursts-1:0][2:0] list, storage;

    for (genvar k = 0; k < Bursts; k++) begin : gen_entry
      assign list[k]    = {under_q[k].last, under_q[k].tag};
      assign storage[k] = dut.gen_listed.i_under_way.storage_q[k];
    end

    fv_fifo_list #(
      .Width(3),
      .Depth(Bursts)
    ) i_list (
      .rst_ni   (rst_n),
      .count_i  (count_q),
      .list_i   (list),
      .usage_i  (dut.gen_listed.i_under_way.usage_q),
      .read_i   (dut.gen_listed.i_under_way.read_q),
      .write_i  (dut.gen_listed.i_under_way.write_q),
      .storage_i(storage)
    );
  end else begin : gen_counted
    logic whole;  // all bursts under way are the only ones of their requests, without tags

    always_comb begin
      whole = 1'b1;
      for (int unsigned k = 0; k < Bursts; k++) begin
        whole &= UnderBits'(k) >= count_q || (under_q[k].last && under_q[k].tag == '0);
      end
      if (rst_n) begin
        l_count: assert (dut.gen_counted.count_q == count_q &&
                         dut.gen_counted.full_q == (count_q == UnderBits'(Bursts)) &&
                         dut.gen_counted.some_q == (count_q != '0) &&
                         count_q <= UnderBits'(Bursts));
        l_split: assert ((!dut.i_split.out_valid_q || dut.i_split.out_tag_q == '0) &&
                         (!dut.i_split.left_valid_q || dut.i_split.tag_q == '0));
        l_whole: assert (whole);
      end
    end
  end

endmodule
