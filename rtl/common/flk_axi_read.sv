// AXI4 manager that reads: requests for consecutive beats in, their beats in order out.
//
// Requests are split into bursts of at most MaxBeats beats that do not cross 4 KB
// (flk_axi_split); up to Bursts of them are under way, all under the identifier Id, so that their
// beats come in order. Each beat has the tag of its request, a mark on the request's last beat,
// and an error when the memory's answer was one. Latency of the addresses 2; beats pass
// combinationally: r_valid_i and r_data_i to the output, out_ready_i to r_ready_o. Nothing is
// stored of them: where the port is shared, the consumer has room for what it asked for. ar_tag_o: tag
// of the address that is offered, for a user that wants less than a whole beat of it. idle_o:
// no request inside, no beat to come. No clear: what was asked for comes. Requests of one burst
// without tags (Listed 0) are counted instead of listed, so that Bursts may be large.
module flk_axi_read #(
  parameter  int unsigned AddrBits = 40,
  parameter  int unsigned BeatBits = 16,
  parameter  int unsigned TagBits  = 1,
  parameter  int unsigned Width    = 512,
  parameter  int unsigned MaxBeats = 16,
  parameter  int unsigned Bursts   = 8,   // under way
  parameter  bit          Listed   = 1'b1, // requests have tags or several bursts; 0: no tags
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
  output logic                out_valid_o,
  input  logic                out_ready_i,
  output logic [Width-1:0]    out_data_o,
  output logic [TagBits-1:0]  out_tag_o,
  output logic                out_last_o,
  output logic                out_error_o,
  // AXI4
  output logic                ar_valid_o,
  input  logic                ar_ready_i,
  output logic [IdBits-1:0]   ar_id_o,
  output logic [AddrBits-1:0] ar_addr_o,
  output logic [7:0]          ar_len_o,
  output logic [2:0]          ar_size_o,
  output logic [1:0]          ar_burst_o,
  output logic [TagBits-1:0]  ar_tag_o,
  input  logic                r_valid_i,
  output logic                r_ready_o,
  input  logic [IdBits-1:0]   r_id_i,
  input  logic [Width-1:0]    r_data_i,
  input  logic [1:0]          r_resp_i,
  input  logic                r_last_i
);

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
    .out_addr_o (ar_addr_o),
    .out_len_o  (ar_len_o),
    .out_last_o (split_last),
    .out_tag_o  (split_tag)
  );

  // What is under way: only addresses enter, so that there is room until the one offered is taken.

  logic room, known, known_last, pop, empty;
  logic [TagBits-1:0] known_tag;

  if (Listed) begin : gen_listed
    logic unused_full;
    logic [$clog2(Bursts+1)-1:0] unused_usage;

    flk_fifo #(
      .Width(TagBits + 1),
      .Depth(Bursts)
    ) i_under_way (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (ar_valid_o && ar_ready_i),
      .in_ready_o (room),
      .in_data_i  ({split_last, split_tag}),
      .out_valid_o(known),
      .out_ready_i(pop),
      .out_data_o ({known_last, known_tag}),
      .usage_o    (unused_usage),
      .full_o     (unused_full),
      .empty_o    (empty)
    );
  end else begin : gen_counted
    localparam int unsigned CountBits = $clog2(Bursts + 1);

    logic push, full_q, some_q;
    logic [CountBits-1:0] count_d, count_q;

    assign push       = ar_valid_o && ar_ready_i;
    assign count_d    = count_q + CountBits'(push) - CountBits'(pop);
    assign room       = !full_q;
    assign known      = some_q;
    assign empty      = !some_q;
    assign known_last = 1'b1;
    assign known_tag  = '0;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        count_q <= '0;
        full_q  <= 1'b0;
        some_q  <= 1'b0;
      end else begin
        count_q <= count_d;
        full_q  <= count_d == CountBits'(Bursts);
        some_q  <= count_d != '0;
      end
    end

    logic unused_split;
    assign unused_split = ^{split_last, split_tag};

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        split_valid |-> split_last && split_tag == '0)
    else $error("flk_axi_read: what is counted has a tag or several bursts");
`endif
  end

  assign ar_valid_o  = split_valid && room;
  assign split_ready = ar_ready_i && room;
  assign ar_id_o     = IdBits'(Id);
  assign ar_size_o   = 3'($clog2(Bytes));
  assign ar_burst_o  = 2'b01;  // INCR
  assign ar_tag_o    = split_tag;

  assign out_valid_o = r_valid_i && known;
  assign r_ready_o   = out_ready_i && known;
  assign out_data_o  = r_data_i;
  assign out_tag_o   = known_tag;
  assign out_last_o  = r_last_i && known_last;
  assign out_error_o = r_resp_i[1];
  assign pop         = out_valid_o && out_ready_i && r_last_i;
  assign idle_o      = split_idle && empty;

  logic unused_r;
  assign unused_r = ^{r_id_i, r_resp_i[0]};

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      ar_valid_o && !ar_ready_i |=> ar_valid_o && $stable({ar_addr_o, ar_len_o}))
  else $error("flk_axi_read: address changed before its transfer");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      r_valid_i |-> known && r_id_i == IdBits'(Id))
  else $error("flk_axi_read: beat that nobody asked for");
`endif

endmodule
