// flk_axi_fetch, for requests, stops, pauses and answers of any kind.
//
// Addresses: the bursts are the beats of the requests, in order, each once, and no others; none is
// across a multiple of MaxBeats (hence none longer, nor across 4 KB), or shorter than that demands.
// One is offered at the latest two cycles after a request is there, its next piece has places and
// fewer than Bursts are under way, never more.
// Places: what was asked for and has not come, with what has come and was not freed, is never more
// than Places; requests with in_placed_i do not count.
// Beats: every beat that the memory gives leaves in its cycle, unchanged, with its request's tag,
// with an error exactly where the memory answered with one. The port never waits.
// Stop: no request is taken; at most three bursts leave behind it, those that had places; idle_o
// comes at the latest two cycles after nothing is under way or offered, and then nothing is asked
// for. Otherwise idle_o is high exactly when no request is inside and no beat is to come.
//
// The memory: beats of the bursts that it has taken, in their order, the last of each marked, at
// any time. The buffer: frees beats that came; it is empty when a stop ends. Requests inside and
// bursts under way are kept here from the oldest one on. The assertions l_* link registers to them,
// which induction needs.
module fv_axi_fetch #(
  parameter  int unsigned Places    = 5,
  parameter  int unsigned AddrBits  = 14,
  parameter  int unsigned BeatBits  = 4,
  parameter  int unsigned Width     = 512,
  parameter  int unsigned MaxBeats  = 4,
  parameter  int unsigned Bursts    = 2,
  parameter  int unsigned Id        = 1,
  localparam int unsigned Shift     = $clog2(Width / 8),
  localparam int unsigned LineBits  = AddrBits - Shift,
  localparam int unsigned UnderBits = $clog2(Bursts + 1)
) (
  input logic                clk_i,
  input logic                again_i,
  input logic                stop_i,
  input logic                in_valid_i,
  input logic [LineBits-1:0] in_beat_i,
  input logic [BeatBits-1:0] in_beats_i,
  input logic [1:0]          in_tag_i,
  input logic                in_placed_i,
  input logic                freed_i,
  input logic                ar_ready_i,
  input logic                r_valid_i,
  input logic [1:0]          r_id_i,
  input logic [Width-1:0]    r_data_i,
  input logic [1:0]          r_resp_i,
  input logic                r_last_i
);

  localparam int unsigned SumBits = $clog2(Places + 1) + 2;

  typedef struct packed {
    logic [LineBits-1:0] line;
    logic [BeatBits-1:0] left;  // 0: no request
    logic [1:0]          tag;
    logic                placed;
  } request_t;

  typedef struct packed {
    logic [7:0] len;
    logic [1:0] tag;
    logic       placed;
  } burst_t;

  logic rst_n, idle, in_ready, out_valid, out_error, ar_valid, r_ready;
  logic [Width-1:0]    out_data;
  logic [1:0]          out_tag, ar_id, ar_burst;
  logic [AddrBits-1:0] ar_addr;
  logic [7:0]          ar_len;
  logic [2:0]          ar_size;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_axi_fetch #(
    .Places  (Places),
    .AddrBits(AddrBits),
    .BeatBits(BeatBits),
    .TagBits (2),
    .Width   (Width),
    .MaxBeats(MaxBeats),
    .Bursts  (Bursts),
    .IdBits  (2),
    .Id      (Id)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .stop_i,
    .idle_o     (idle),
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_beat_i,
    .in_beats_i,
    .in_tag_i,
    .in_placed_i,
    .freed_i,
    .out_valid_o(out_valid),
    .out_data_o (out_data),
    .out_tag_o  (out_tag),
    .out_error_o(out_error),
    .ar_valid_o (ar_valid),
    .ar_ready_i,
    .ar_id_o    (ar_id),
    .ar_addr_o  (ar_addr),
    .ar_len_o   (ar_len),
    .ar_size_o  (ar_size),
    .ar_burst_o (ar_burst),
    .r_valid_i,
    .r_ready_o  (r_ready),
    .r_id_i,
    .r_data_i,
    .r_resp_i,
    .r_last_i
  );

  logic push, ask, come, finish, ends;

  assign push   = in_valid_i && in_ready;
  assign ask    = ar_valid && ar_ready_i;
  assign come   = r_valid_i && r_ready;
  assign finish = come && r_last_i;
  assign ends   = stop_i && idle;  // of a stop

  // ---- requests -------------------------------------------------------------------------------------

  request_t [2:0]      asked_d, asked_q;  // what is still to be asked for, the oldest first
  logic [LineBits-1:0] line;
  logic [8:0]          beats, piece;      // of the burst that is offered, of the next piece
  logic                last;              // this burst is its request's last
  logic                stopping_q, waited_q;
  logic [AddrBits-1:0] waited_addr_q;
  logic [7:0]          waited_len_q;

  assign line  = ar_addr[AddrBits-1:Shift];
  assign beats = 9'(ar_len) + 9'd1;
  assign last  = 32'(beats) == 32'(asked_q[0].left);

  always_comb begin
    piece = 9'(MaxBeats) - 9'(32'(asked_q[0].line) % MaxBeats);
    if (32'(asked_q[0].left) < 32'(piece)) begin
      piece = 9'(asked_q[0].left);
    end
  end

  // What is left when some beats of the oldest request are asked for.
  function automatic request_t [2:0] behind(request_t [2:0] requests, logic [BeatBits-1:0] asks);
    request_t [2:0] then;
    then = requests;
    then[0].line += LineBits'(asks);
    then[0].left -= asks;
    return then[0].left == '0 ? then >> $bits(request_t) : then;
  endfunction

  always_comb begin
    asked_d = ask ? behind(asked_q, BeatBits'(beats)) : asked_q;
    if (push) begin
      for (int k = 2; k >= 0; k--) begin
        if (asked_d[k].left == '0 && (k == 0 || asked_d[k == 0 ? 0 : k - 1].left != '0)) begin
          asked_d[k] = '{line: in_beat_i, left: in_beats_i, tag: in_tag_i, placed: in_placed_i};
          break;
        end
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      asked_q    <= '0;
      stopping_q <= 1'b0;
      waited_q   <= 1'b0;
    end else begin
      asked_q    <= ends ? '0 : asked_d;
      stopping_q <= stop_i && !idle;
      waited_q   <= ar_valid && !ar_ready_i;
    end
  end

  always_ff @(posedge clk_i) begin
    waited_addr_q <= ar_addr;
    waited_len_q  <= ar_len;
  end

  // ---- bursts under way, places ---------------------------------------------------------------------

  burst_t [Bursts-1:0]  under_d, under_q;  // the oldest first
  logic [UnderBits-1:0] count_q, left;     // left: behind what ends in this cycle
  logic [7:0]           beat_q;            // beats that came of the oldest
  logic [SumBits-1:0]   due_q, stored_q;   // beats with a place: to come, in the buffer
  logic                 places;            // the next piece has them

  assign left   = count_q - UnderBits'(finish);
  assign places = asked_q[0].placed || 32'(due_q) + 32'(stored_q) + 32'(piece) <= Places;

  always_comb begin
    under_d = finish ? under_q >> $bits(burst_t) : under_q;
    for (int unsigned k = 0; k < Bursts; k++) begin
      if (ask && left == UnderBits'(k)) begin
        under_d[k] = '{len: ar_len, tag: asked_q[0].tag, placed: asked_q[0].placed};
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      count_q  <= '0;
      beat_q   <= '0;
      due_q    <= '0;
      stored_q <= '0;
    end else begin
      count_q  <= left + UnderBits'(ask);
      due_q    <= due_q + (ask && !asked_q[0].placed ? SumBits'(beats) : '0) -
                  SumBits'(come && !under_q[0].placed);
      stored_q <= ends ? '0 : stored_q + SumBits'(come && !under_q[0].placed) -
                              SumBits'(freed_i && stored_q != '0);
      if (come) begin
        beat_q <= r_last_i ? 8'd0 : beat_q + 8'd1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    under_q <= under_d;
  end

  // ---- waiting --------------------------------------------------------------------------------------

  logic       could, quiet;
  logic [1:0] could_q, quiet_q, late_q;  // cycles in a row; bursts that left in the stop

  assign could = asked_q[0].left != '0 && places && count_q != UnderBits'(Bursts) && !ar_valid &&
                 !stop_i;
  assign quiet = stop_i && !idle && count_q == '0 && !ar_valid;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      could_q <= '0;
      quiet_q <= '0;
      late_q  <= '0;
    end else begin
      could_q <= could ? could_q + 2'd1 : 2'd0;
      quiet_q <= quiet ? quiet_q + 2'd1 : 2'd0;
      late_q  <= stop_i && !idle ? late_q + 2'(ask) : 2'd0;
    end
  end

  // ---- links: what is where -------------------------------------------------------------------------

  logic                out_is, left_is;    // in the splitter
  logic [BeatBits-1:0] left_beats;
  request_t [2:0]      behind_out, behind_left;
  logic [SumBits-1:0]  split;              // beats with a place that are in the splitter
  logic [SumBits-1:0]  sum;                // and under way

  assign out_is      = dut.i_read.i_split.out_valid_q;
  assign left_is     = dut.i_read.i_split.left_valid_q;
  assign left_beats  = BeatBits'(dut.i_read.i_split.left_q);
  assign behind_out  = out_is ? behind(asked_q, BeatBits'(beats)) : asked_q;
  assign behind_left = left_is ? behind(behind_out, left_beats) : behind_out;
  assign split       = (out_is && !asked_q[0].placed ? SumBits'(beats) : '0) +
                       (left_is && !behind_out[0].placed ? SumBits'(left_beats) : '0);

  always_comb begin
    sum = '0;
    for (int unsigned k = 0; k < Bursts; k++) begin
      if (UnderBits'(k) < count_q && !under_q[k].placed) begin
        sum += SumBits'(under_q[k].len) + 1'b1 - (k == 0 ? SumBits'(beat_q) : '0);
      end
    end
  end

  // ---- claims ---------------------------------------------------------------------------------------

  always_comb begin
    m_request: assume (!in_valid_i || in_beats_i != '0);
    m_stop: assume (!stopping_q || stop_i);
    m_freed: assume (!freed_i || stop_i || stored_q != '0);
    m_beat: assume (!r_valid_i || (count_q != '0 && r_last_i == (beat_q == under_q[0].len)));

    if (rst_n) begin
      // Addresses.
      if (ar_valid) begin
        a_asked: assert (asked_q[0].left != '0);
        a_address: assert (line == asked_q[0].line && ar_addr[Shift-1:0] == '0);
        a_length: assert (32'(beats) <= 32'(asked_q[0].left) &&
                          32'(line) % MaxBeats + 32'(beats) <= MaxBeats);
        a_full: assert (last || (32'(line) + 32'(beats)) % MaxBeats == 0);
        a_fields: assert (32'(ar_id) == Id && 32'(ar_size) == Shift && ar_burst == 2'b01);
        a_bursts: assert (count_q < UnderBits'(Bursts));
      end
      if (waited_q) begin
        a_stable: assert (ar_valid && ar_addr == waited_addr_q && ar_len == waited_len_q);
      end
      a_asks: assert (!could || could_q < 2'd2);
      a_ready: assert (stop_i ? !in_ready : in_ready || asked_q[0].left != '0);

      // Places.
      a_places: assert (32'(due_q) + 32'(stored_q) <= Places);

      // Beats.
      a_beat: assert (out_valid == r_valid_i);
      a_taken: assert (!r_valid_i || r_ready);
      if (out_valid) begin
        a_data: assert (out_data == r_data_i && out_error == r_resp_i[1] &&
                        out_tag == under_q[0].tag);
      end

      // Stop.
      if (stopping_q) begin
        a_idle_stop: assert (!idle || (count_q == '0 && !ar_valid));
      end else begin
        a_idle: assert (idle == (count_q == '0 && asked_q[0].left == '0));
      end
      a_quiet: assert (!quiet || quiet_q < 2'd2);
      a_late: assert (late_q != 2'd3 || !ar_valid);

      // Links: requests.
      l_gaps: assert ((asked_q[1].left == '0 || asked_q[0].left != '0) &&
                      (asked_q[2].left == '0 || asked_q[1].left != '0));
      if (out_is) begin
        l_out: assert (asked_q[0].left != '0 && line == asked_q[0].line &&
                       32'(beats) <= 32'(asked_q[0].left) &&
                       dut.i_read.i_split.out_tag_q == asked_q[0].tag &&
                       32'(line) % MaxBeats + 32'(beats) <= MaxBeats &&
                       (last || (32'(line) + 32'(beats)) % MaxBeats == 0));
      end
      if (left_is) begin
        l_left: assert (left_beats != '0 && dut.i_read.i_split.line_q == behind_out[0].line &&
                        left_beats <= behind_out[0].left &&
                        dut.i_read.i_split.tag_q == behind_out[0].tag &&
                        32'(behind_out[0].line) % MaxBeats + 32'(left_beats) <= MaxBeats &&
                        (left_beats == behind_out[0].left ||
                         (32'(behind_out[0].line) + 32'(left_beats)) % MaxBeats == 0));
      end
      if (dut.left_valid_q) begin
        l_rest: assert (behind_left[0].left != '0 && behind_left[1].left == '0 &&
                        behind_left[0] == {dut.line_q, dut.left_q, dut.tag_q, dut.placed_q});
      end else if (!stopping_q) begin
        l_no_rest: assert (behind_left[0].left == '0);
      end

      // Links: places.
      l_due: assert (due_q == sum);
      if (stopping_q) begin
        l_offered: assert (32'(split) + 32'(due_q) + 32'(stored_q) +
                           (dut.left_valid_q && !dut.placed_q ? 32'(dut.beats) : 32'd0) <= Places);
        l_late: assert (32'(late_q) + 32'(out_is) + 32'(left_is) + 32'(dut.left_valid_q) <= 3);
      end else begin
        l_places: assert (32'(split) + 32'(due_q) + 32'(stored_q) + 32'(dut.places_q) ==
                          Places);
        l_no_late: assert (late_q == '0);
      end

      // Links: waiting.
      l_could: assert (could_q == '0 || out_is || (left_is && could_q == 2'd1));
      l_quiet: assert (quiet_q == '0 || out_is || (left_is && quiet_q == 2'd1) || idle);

      // Links: bursts.
      l_beat: assert (count_q == '0 ? beat_q == '0 : beat_q <= under_q[0].len);

      c_piece: cover (ask && !last && 32'(beats) < MaxBeats && count_q != '0);
      c_three: cover (asked_q[2].left != '0);
      c_waits: cover (asked_q[0].left != '0 && !places && count_q == '0 && freed_i);
      c_late: cover (late_q == 2'd3);
      c_dropped: cover (ends && stopping_q && asked_q[0].left != '0);
      c_placed: cover (32'(stored_q) == Places && come && under_q[0].placed);
    end
  end

  logic [Bursts-1:0][1:0] list, storage;

  for (genvar k = 0; k < Bursts; k++) begin : gen_entry
    assign list[k]    = under_q[k].tag;
    assign storage[k] = 2'(dut.i_read.gen_listed.i_under_way.storage_q[k]);
    always_comb begin
      if (rst_n && UnderBits'(k) < count_q) begin
        l_length: assert (under_q[k].len < 8'(MaxBeats));
      end
    end
  end

  fv_fifo_list #(
    .Width(2),
    .Depth(Bursts)
  ) i_list (
    .rst_ni   (rst_n),
    .count_i  (count_q),
    .list_i   (list),
    .usage_i  (dut.i_read.gen_listed.i_under_way.usage_q),
    .read_i   (dut.i_read.gen_listed.i_under_way.read_q),
    .write_i  (dut.i_read.gen_listed.i_under_way.write_q),
    .storage_i(storage)
  );

endmodule
