// Address channel of a manager behind flk_axi_split: its bursts are the beats of the requests that
// were taken, in order, and no others; none is longer than MaxBeats, across 4 KB or shorter than
// these demand; all stay until their transfer.
//
// Keeps what is still to be asked for of the two requests that may be inside: of the older (first)
// and of the younger (second) one. Tells the proof's top of the first request's tag and whether the
// burst that is offered is its last. The assertions l_* link the splitter's registers, which
// induction needs.
module fv_axi_bursts #(
  parameter  int unsigned AddrBits = 16,
  parameter  int unsigned BeatBits = 8,
  parameter  int unsigned TagBits  = 2,
  parameter  int unsigned Bytes    = 64,
  parameter  int unsigned MaxBeats = 16,
  localparam int unsigned LineBits = AddrBits - $clog2(Bytes)
) (
  input  logic                clk_i,
  input  logic                rst_ni,
  // Requests
  input  logic                push_i,
  input  logic [AddrBits-1:0] in_addr_i,
  input  logic [BeatBits-1:0] in_beats_i,
  input  logic [TagBits-1:0]  in_tag_i,
  // Bursts
  input  logic                valid_i,
  input  logic                ready_i,
  input  logic [AddrBits-1:0] addr_i,
  input  logic [7:0]          len_i,
  input  logic [2:0]          size_i,
  input  logic [1:0]          burst_i,
  // Registers of flk_axi_split
  input  logic                out_valid_i,
  input  logic                out_last_i,
  input  logic [TagBits-1:0]  out_tag_i,
  input  logic                left_valid_i,
  input  logic [LineBits-1:0] left_line_i,
  input  logic [BeatBits-1:0] left_i,
  input  logic [TagBits-1:0]  left_tag_i,
  // What is to be asked for
  output logic [1:0]          inside_o,  // requests
  output logic                fresh_o,   // one was taken in the cycle before
  output logic                last_o,    // this burst is the first one's last
  output logic [TagBits-1:0]  tag_o      // of the first one
);

  localparam int unsigned BeatShift = $clog2(Bytes);
  localparam int unsigned PageBeats = 4096 / Bytes;

  typedef struct packed {
    logic [LineBits-1:0] line;
    logic [BeatBits-1:0] left;
    logic [TagBits-1:0]  tag;
  } request_t;

  logic [1:0]          inside_d, inside_q;
  request_t            first_d, first_q, second_d, second_q, asked, rest;
  logic [LineBits-1:0] line;
  logic [8:0]          beats;
  logic                fresh_q, waited_q;
  logic [AddrBits-1:0] waited_addr_q;
  logic [7:0]          waited_len_q;

  assign asked    = '{line: in_addr_i[AddrBits-1:BeatShift], left: in_beats_i, tag: in_tag_i};
  assign line     = addr_i[AddrBits-1:BeatShift];
  assign beats    = 9'(len_i) + 9'd1;
  assign inside_o = inside_q;
  assign fresh_o  = fresh_q;
  assign last_o   = 32'(beats) == 32'(first_q.left);
  assign tag_o    = first_q.tag;

  always_comb begin
    inside_d = inside_q;
    first_d  = first_q;
    second_d = second_q;
    if (valid_i && ready_i) begin
      first_d.line = first_q.line + LineBits'(beats);
      first_d.left = first_q.left - BeatBits'(beats);
      if (last_o) begin
        first_d  = second_q;
        inside_d = inside_q - 2'd1;
      end
    end
    if (push_i) begin
      if (inside_d == 2'd0) first_d = asked;
      else second_d = asked;
      inside_d = inside_d + 2'd1;
    end
  end

  // What the splitter still has to split: of the second request, or what its output leaves of the first.
  always_comb begin
    rest = first_q;
    if (out_valid_i && out_last_i) begin
      rest = second_q;
    end else if (out_valid_i) begin
      rest.line = first_q.line + LineBits'(beats);
      rest.left = first_q.left - BeatBits'(beats);
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      inside_q <= '0;
      fresh_q  <= 1'b0;
      waited_q <= 1'b0;
    end else begin
      inside_q <= inside_d;
      fresh_q  <= push_i;
      waited_q <= valid_i && !ready_i;
    end
  end

  always_ff @(posedge clk_i) begin
    first_q       <= first_d;
    second_q      <= second_d;
    waited_addr_q <= addr_i;
    waited_len_q  <= len_i;
  end

  always_comb begin
    m_request: assume (!push_i || (in_beats_i != '0 && in_addr_i[BeatShift-1:0] == '0));
    if (rst_ni) begin
      a_two: assert (inside_q != 2'd3);
      if (valid_i) begin
        a_inside: assert (inside_q != 2'd0);
        a_address: assert (line == first_q.line && addr_i[BeatShift-1:0] == '0);
        a_length: assert (32'(beats) <= 32'(first_q.left) && 32'(beats) <= MaxBeats);
        a_page: assert (32'(line) % PageBeats + 32'(beats) <= PageBeats);
        a_full: assert (last_o || 32'(beats) == MaxBeats ||
                        (32'(line) + 32'(beats)) % PageBeats == 0);
        a_fields: assert (32'(size_i) == BeatShift && burst_i == 2'b01);
      end
      if (waited_q) begin
        a_stable: assert (valid_i && addr_i == waited_addr_q && len_i == waited_len_q);
      end
      l_count: assert (inside_q ==
                       2'(left_valid_i && (!out_valid_i || out_last_i)) + 2'(out_valid_i));
      l_left: assert (left_valid_i || !out_valid_i || out_last_i);
      l_first: assert (inside_q == 2'd0 || first_q.left != '0);
      l_second: assert (inside_q != 2'd2 || second_q.left != '0);
      l_fresh: assert (out_valid_i || fresh_q || !left_valid_i);
      if (out_valid_i) begin
        l_out: assert (line == first_q.line && 32'(beats) <= 32'(first_q.left) &&
                       32'(beats) <= MaxBeats && out_last_i == last_o && out_tag_i == first_q.tag &&
                       32'(line) % PageBeats + 32'(beats) <= PageBeats);
        l_full: assert (last_o || 32'(beats) == MaxBeats ||
                        (32'(line) + 32'(beats)) % PageBeats == 0);
      end
      if (left_valid_i) begin
        l_rest: assert (left_line_i == rest.line && left_i == rest.left &&
                        left_tag_i == rest.tag);
      end
      if (MaxBeats > 1) begin
        c_cut: cover (valid_i && ready_i && !last_o && 32'(beats) < MaxBeats);
      end
      c_end: cover (valid_i && ready_i && last_o && inside_q == 2'd2);
    end
  end

endmodule
