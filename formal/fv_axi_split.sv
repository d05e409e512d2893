// flk_axi_split: the bursts of a request, in order, are its beats and no others; none is longer
// than MaxBeats or crosses 4 KB; the last one and only it is marked.
//
// Requests have at least one beat, at an address that is a multiple of the beat, as the unit
// demands. The two requests that may be inside are kept here: what is still to come of the older
// (first) and of the younger (second) one. The assertions l_* link them to the registers, which
// induction needs.
module fv_axi_split #(
  parameter int unsigned AddrBits = 16,
  parameter int unsigned BeatBits = 8,
  parameter int unsigned Bytes    = 64,
  parameter int unsigned MaxBeats = 16
) (
  input logic                clk_i,
  input logic                again_i,
  input logic                in_valid_i,
  input logic [AddrBits-1:0] in_addr_i,
  input logic [BeatBits-1:0] in_beats_i,
  input logic [1:0]          in_tag_i,
  input logic                out_ready_i
);

  localparam int unsigned BeatShift = $clog2(Bytes);
  localparam int unsigned LineBits  = AddrBits - BeatShift;
  localparam int unsigned PageBeats = 4096 / Bytes;

  typedef struct packed {
    logic [LineBits-1:0] line;
    logic [BeatBits-1:0] left;
    logic [1:0]          tag;
  } request_t;

  logic rst_n, idle, in_ready, out_valid, out_last;
  logic [AddrBits-1:0] out_addr;
  logic [7:0] out_len;
  logic [1:0] out_tag;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_axi_split #(
    .AddrBits(AddrBits),
    .BeatBits(BeatBits),
    .TagBits (2),
    .Bytes   (Bytes),
    .MaxBeats(MaxBeats)
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
    .out_addr_o (out_addr),
    .out_len_o  (out_len),
    .out_last_o (out_last),
    .out_tag_o  (out_tag)
  );

  logic [1:0] inside_d, inside_q;  // requests
  request_t first_d, first_q, second_d, second_q, asked;
  logic [LineBits-1:0] out_line;
  logic [8:0] beats;
  logic push, give;

  assign asked    = '{line: in_addr_i[AddrBits-1:BeatShift], left: in_beats_i, tag: in_tag_i};
  assign out_line = out_addr[AddrBits-1:BeatShift];
  assign beats    = 9'(out_len) + 9'd1;
  assign push     = in_valid_i && in_ready;
  assign give     = out_valid && out_ready_i;

  always_comb begin
    inside_d = inside_q;
    first_d  = first_q;
    second_d = second_q;
    if (give) begin
      first_d.line = first_q.line + LineBits'(beats);
      first_d.left = first_q.left - BeatBits'(beats);
      if (out_last) begin
        first_d  = second_q;
        inside_d = inside_q - 2'd1;
      end
    end
    if (push) begin
      if (inside_d == 2'd0) first_d = asked;
      else second_d = asked;
      inside_d = inside_d + 2'd1;
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      inside_q <= '0;
    end else begin
      inside_q <= inside_d;
    end
  end
  always_ff @(posedge clk_i) begin
    first_q  <= first_d;
    second_q <= second_d;
  end

  // What the unit still has to split: of the second request, or what its output leaves of the
  // first.
  request_t rest;
  always_comb begin
    rest = first_q;
    if (out_valid && out_last) begin
      rest = second_q;
    end else if (out_valid) begin
      rest.line = first_q.line + LineBits'(beats);
      rest.left = first_q.left - BeatBits'(beats);
    end
  end

  logic waited_q, waited_last_q;
  logic [AddrBits-1:0] waited_addr_q;
  logic [7:0] waited_len_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) waited_q <= 1'b0;
    else waited_q <= out_valid && !out_ready_i;
  end
  always_ff @(posedge clk_i) begin
    waited_addr_q <= out_addr;
    waited_len_q  <= out_len;
    waited_last_q <= out_last;
  end

  always_comb begin
    m_request: assume (!in_valid_i || (in_beats_i != '0 && in_addr_i[BeatShift-1:0] == '0));
    if (rst_n) begin
      a_idle: assert (idle == (inside_q == 2'd0));
      if (out_valid) begin
        a_inside: assert (inside_q != 2'd0);
        a_address: assert (out_line == first_q.line && out_addr[BeatShift-1:0] == '0);
        a_tag: assert (out_tag == first_q.tag);
        a_length: assert (32'(beats) <= 32'(first_q.left) && 32'(beats) <= MaxBeats);
        a_page: assert (32'(out_line) % PageBeats + 32'(beats) <= PageBeats);
        a_last: assert (out_last == (32'(beats) == 32'(first_q.left)));
        // No shorter than it must be.
        a_full: assert (out_last || 32'(beats) == MaxBeats
                        || (32'(out_line) + 32'(beats)) % PageBeats == 0);
      end
      if (waited_q) begin
        a_stable: assert (out_valid && out_addr == waited_addr_q && out_len == waited_len_q
                          && out_last == waited_last_q);
      end
      l_first: assert (inside_q == 2'd0 || first_q.left != '0);
      l_second: assert (inside_q != 2'd2 || second_q.left != '0);
      l_count: assert (inside_q
                       == 2'(dut.left_valid_q && (!out_valid || out_last)) + 2'(out_valid));
      l_left: assert (dut.left_valid_q || !out_valid || out_last);
      if (dut.left_valid_q) begin
        l_rest: assert (dut.line_q == rest.line && dut.left_q == rest.left
                        && dut.tag_q == rest.tag);
      end
      c_cut: cover (give && !out_last && 32'(beats) < MaxBeats);
      c_end: cover (give && out_last && 32'(beats) < MaxBeats && inside_q == 2'd2);
    end
  end

endmodule
