// Splits requests for consecutive beats into bursts that AXI4 allows.
//
// A request is an address, a multiple of the beat, and a number of beats, at least one; it
// becomes one or more bursts in order, each at most MaxBeats beats and none across a multiple of
// 4096 bytes. out_len_o is AXI's: beats less one; out_last_o marks the last burst of a request,
// out_tag_o is the request's tag. Latency 2, one burst per cycle, also across requests.
// Combinational: out_ready_i to in_ready_o. No clear: a burst that is offered must be taken.
// idle_o, from registers: nothing inside.
module flk_axi_split #(
  parameter int unsigned AddrBits = 40,
  parameter int unsigned BeatBits = 16,
  parameter int unsigned TagBits  = 1,
  parameter int unsigned Bytes    = 64,  // of a beat
  parameter int unsigned MaxBeats = 16
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
  // Bursts
  output logic                out_valid_o,
  input  logic                out_ready_i,
  output logic [AddrBits-1:0] out_addr_o,
  output logic [7:0]          out_len_o,
  output logic                out_last_o,
  output logic [TagBits-1:0]  out_tag_o
);

  localparam int unsigned BeatShift  = $clog2(Bytes);
  localparam int unsigned LineBits   = AddrBits - BeatShift;
  localparam int unsigned PageBeats  = 4096 / Bytes;
  localparam int unsigned PageBits   = $clog2(PageBeats);
  localparam int unsigned BurstBits  = PageBits + 1;  // 0 to PageBeats
  localparam int unsigned LongestRaw = MaxBeats < PageBeats ? MaxBeats : PageBeats;
  // Wide enough for a request's beats and a burst's.
  localparam int unsigned CountBits = BeatBits > BurstBits ? BeatBits : BurstBits;
  localparam logic [BurstBits-1:0] LONGEST = BurstBits'(LongestRaw);

  if (Bytes < 4 || Bytes > 128 || Bytes != 1 << $clog2(Bytes)) begin : gen_check_bytes
    $error("flk_axi_split: Bytes must be 4, 8, ... 128");
  end
  if (MaxBeats < 1 || MaxBeats > 256) begin : gen_check_max
    $error("flk_axi_split: MaxBeats must be 1 to 256");
  end
  if (AddrBits < 13) begin : gen_check_addr
    $error("flk_axi_split: AddrBits must be at least 13");
  end

  // What is left of a request

  logic                 left_valid_d, left_valid_q;
  logic [LineBits-1:0]  line_d, line_q;
  logic [BeatBits-1:0]  left_d, left_q;
  logic [TagBits-1:0]   tag_q;
  logic [BurstBits-1:0] to_page, limit;
  logic [7:0]           len;
  logic                 last, move, load;

  logic [LineBits-PageBits-1:0] next_page;
  logic [PageBits-1:0]          next_beat;

  assign to_page = BurstBits'(PageBeats) - {1'b0, line_q[PageBits-1:0]};
  assign limit   = to_page < LONGEST ? to_page : LONGEST;
  assign last    = CountBits'(left_q) <= CountBits'(limit);
  assign len     = (last ? 8'(left_q) : 8'(limit)) - 8'd1;

  // Bursts that are offered

  logic                 out_valid_d, out_valid_q, out_last_q;
  logic [LineBits-1:0]  out_line_q;
  logic [7:0]           out_len_q;
  logic [TagBits-1:0]   out_tag_q;

  assign move       = left_valid_q && (!out_valid_q || out_ready_i);
  assign in_ready_o = !left_valid_q || (move && last);
  assign load       = in_valid_i && in_ready_o;

  // After a request's last burst nothing looks at line and count.
  assign left_valid_d = load || (left_valid_q && !(move && last));
  // A burst ends at a page's end or before it.
  assign next_page    = line_q[LineBits-1:PageBits] + (LineBits - PageBits)'(to_page <= LONGEST);
  assign next_beat    = line_q[PageBits-1:0] + PageBits'(limit);
  // Requests of one beat are one burst each.
  assign line_d       = load || BeatBits == 1 ? in_addr_i[AddrBits-1:BeatShift]
                                              : {next_page, next_beat};
  assign left_d       = load ? in_beats_i : left_q - BeatBits'(limit);
  assign out_valid_d  = move || (out_valid_q && !out_ready_i);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      left_valid_q <= 1'b0;
      out_valid_q  <= 1'b0;
    end else begin
      left_valid_q <= left_valid_d;
      out_valid_q  <= out_valid_d;
    end
  end

  always_ff @(posedge clk_i) begin
    if (load || move) begin
      line_q <= line_d;
      left_q <= left_d;
    end
    if (load) begin
      tag_q <= in_tag_i;
    end
    if (move) begin
      out_line_q  <= line_q;
      out_len_q   <= len;
      out_last_q  <= last;
      out_tag_q   <= tag_q;
    end
  end

  assign idle_o      = !left_valid_q && !out_valid_q;
  assign out_valid_o = out_valid_q;
  assign out_addr_o  = {out_line_q, BeatShift'(0)};
  assign out_len_o   = out_len_q;
  assign out_last_o  = out_last_q;
  assign out_tag_o   = out_tag_q;

  logic [BeatShift-1:0] unused_offset;
  assign unused_offset = in_addr_i[BeatShift-1:0];

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      in_valid_i |-> in_beats_i != '0 && in_addr_i[BeatShift-1:0] == '0)
  else $error("flk_axi_split: request of no beats, or address that is no multiple of a beat");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o |-> 32'(out_len_o) < MaxBeats
                      && 32'(out_line_q[PageBits-1:0]) + 32'(out_len_o) < PageBeats)
  else $error("flk_axi_split: burst too long or across 4 KB");

  assert property (@(posedge clk_i) disable iff (!rst_ni) out_valid_o && !out_ready_i |=>
      out_valid_o && $stable({out_addr_o, out_len_o, out_last_o, out_tag_o}))
  else $error("flk_axi_split: output changed before its transfer");
`endif

endmodule
