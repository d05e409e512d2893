// flk_axi_split: the bursts of a request, in order, are its beats and no others, none longer than
// MaxBeats, across 4 KB or shorter than these demand (fv_axi_bursts); the last one and only it is
// marked; tags; idle_o exactly when no request is inside.
//
// Requests have at least one beat, at an address that is a multiple of the beat, as the unit
// demands.
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

  logic [1:0] requests, tag;
  logic last;

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
    .valid_i     (out_valid),
    .ready_i     (out_ready_i),
    .addr_i      (out_addr),
    .len_i       (out_len),
    .size_i      (3'($clog2(Bytes))),  // not of the splitter
    .burst_i     (2'b01),
    .out_valid_i (dut.out_valid_q),
    .out_last_i  (dut.out_last_q),
    .out_tag_i   (dut.out_tag_q),
    .left_valid_i(dut.left_valid_q),
    .left_line_i (dut.line_q),
    .left_i      (dut.left_q),
    .left_tag_i  (dut.tag_q),
    .inside_o    (requests),
    .fresh_o     (),
    .last_o      (last),
    .tag_o       (tag)
  );

  always_comb begin
    if (rst_n) begin
      a_idle: assert (idle == (requests == 2'd0));
      if (out_valid) begin
        a_tag: assert (out_tag == tag);
        a_last: assert (out_last == last);
      end
    end
  end

endmodule
