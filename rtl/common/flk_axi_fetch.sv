// Reads of a consumer that has a buffer: of what is requested, as much is asked for as has a place.
//
// Requests for consecutive beats (address in beats) are cut at multiples of MaxBeats and go piece
// by piece to flk_axi_read, each when the buffer has room for all of it: Places less what is under
// way or waits there; freed_i for each beat that has left it. Requests with in_placed_i take no
// places: their beats have room elsewhere. A beat is there for one cycle and must be taken then, so
// that the port never waits and may be shared. Latency of an address 3, a piece a cycle.
// stop_i: what was not asked for yet is forgotten and nothing is taken; what is offered to in_* may
// be withdrawn; freed_i is not looked at. It must stay until idle_o, and then the buffer be empty.
// Combinational: ar_ready_i to in_ready_o, r_*_i to out_*_o.
module flk_axi_fetch #(
  parameter  int unsigned Places   = 64,
  parameter  int unsigned AddrBits = 40,
  parameter  int unsigned BeatBits = 16,
  parameter  int unsigned TagBits  = 1,
  parameter  int unsigned Width    = 512,
  parameter  int unsigned MaxBeats = 16,  // of a piece
  parameter  int unsigned Bursts   = 8,   // under way
  parameter  bit          Listed   = 1'b1, // requests have tags; else out_tag_o is 0 (flk_axi_read)
  parameter  int unsigned IdBits   = 4,
  parameter  int unsigned Id       = 0,
  localparam int unsigned Shift    = $clog2(Width / 8)
) (
  input  logic                      clk_i,
  input  logic                      rst_ni,
  input  logic                      stop_i,
  output logic                      idle_o,
  // Requests
  input  logic                      in_valid_i,
  output logic                      in_ready_o,
  input  logic [AddrBits-Shift-1:0] in_beat_i,
  input  logic [BeatBits-1:0]       in_beats_i,
  input  logic [TagBits-1:0]        in_tag_i,
  input  logic                      in_placed_i,
  // Beats
  input  logic                      freed_i,
  output logic                      out_valid_o,
  output logic [Width-1:0]          out_data_o,
  output logic [TagBits-1:0]        out_tag_o,
  output logic                      out_error_o,
  // AXI4
  output logic                      ar_valid_o,
  input  logic                      ar_ready_i,
  output logic [IdBits-1:0]         ar_id_o,
  output logic [AddrBits-1:0]       ar_addr_o,
  output logic [7:0]                ar_len_o,
  output logic [2:0]                ar_size_o,
  output logic [1:0]                ar_burst_o,
  input  logic                      r_valid_i,
  output logic                      r_ready_o,
  input  logic [IdBits-1:0]         r_id_i,
  input  logic [Width-1:0]          r_data_i,
  input  logic [1:0]                r_resp_i,
  input  logic                      r_last_i
);

  localparam int unsigned LineBits = AddrBits - Shift;
  localparam int unsigned AtBits = $clog2(MaxBeats);
  localparam int unsigned PieceBits = AtBits + 1;  // 1 to MaxBeats
  localparam int unsigned PlaceBits = $clog2(Places + 1);

  if (MaxBeats < 2 || MaxBeats != 1 << AtBits) begin : gen_check_max
    $error("flk_axi_fetch: MaxBeats must be a power of two, at least 2");
  end
  if (Places < MaxBeats) begin : gen_check_places
    $error("flk_axi_fetch: Places must be at least MaxBeats");
  end
  if (BeatBits < PieceBits) begin : gen_check_beats
    $error("flk_axi_fetch: BeatBits must hold MaxBeats");
  end

  // ---- pieces ---------------------------------------------------------------------------------------

  logic                left_valid_d, left_valid_q, placed_q;
  logic [LineBits-1:0] line_q, next_line;
  logic [BeatBits-1:0] left_q;
  logic [TagBits-1:0]  tag_q;
  logic [PieceBits-1:0] to_end, beats;
  logic                whole, room, offer, ready, taken, load, read_idle;
  logic [PlaceBits-1:0] places_d, places_q;

  // A piece ends at a multiple of MaxBeats or with its request.
  assign to_end    = PieceBits'(MaxBeats) - {1'b0, line_q[AtBits-1:0]};
  assign whole     = left_q <= BeatBits'(to_end);
  assign beats     = whole ? PieceBits'(left_q) : to_end;
  assign next_line = {line_q[LineBits-1:AtBits] + 1'b1, AtBits'(0)};

  assign room       = placed_q || 32'(places_q) >= 32'(beats);
  assign offer      = left_valid_q && room;
  assign taken      = offer && ready;
  assign in_ready_o = (!left_valid_q || (taken && whole)) && !stop_i;
  assign load       = in_valid_i && in_ready_o;
  assign idle_o     = !left_valid_q && read_idle;

  always_comb begin
    left_valid_d = load || (left_valid_q && !(taken && whole));
    places_d     = places_q + PlaceBits'(freed_i);
    if (taken && !placed_q) begin
      places_d = places_q + PlaceBits'(freed_i) - PlaceBits'(beats);
    end
    if (stop_i) begin
      left_valid_d = offer && !ready;  // a piece on offer stays until it is taken
      if (idle_o) begin
        places_d = PlaceBits'(Places);
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      left_valid_q <= 1'b0;
      places_q     <= PlaceBits'(Places);
    end else begin
      left_valid_q <= left_valid_d;
      places_q     <= places_d;
    end
  end

  always_ff @(posedge clk_i) begin
    if (load) begin
      line_q   <= in_beat_i;
      left_q   <= in_beats_i;
      tag_q    <= in_tag_i;
      placed_q <= in_placed_i;
    end else if (taken) begin
      line_q <= next_line;
      left_q <= left_q - BeatBits'(to_end);
    end
  end

  // ---- port -----------------------------------------------------------------------------------------

  logic               unused_last;
  logic [TagBits-1:0] unused_tag;

  flk_axi_read #(
    .AddrBits(AddrBits),
    .BeatBits(PieceBits),
    .TagBits (TagBits),
    .Width   (Width),
    .MaxBeats(MaxBeats),
    .Bursts  (Bursts),
    .Listed  (Listed),
    .IdBits  (IdBits),
    .Id      (Id)
  ) i_read (
    .clk_i,
    .rst_ni,
    .idle_o     (read_idle),
    .in_valid_i (offer),
    .in_ready_o (ready),
    .in_addr_i  ({line_q, Shift'(0)}),
    .in_beats_i (beats),
    .in_tag_i   (tag_q),
    .out_valid_o,
    .out_ready_i(1'b1),
    .out_data_o,
    .out_tag_o,
    .out_last_o (unused_last),
    .out_error_o,
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o,
    .ar_addr_o,
    .ar_len_o,
    .ar_size_o,
    .ar_burst_o,
    .ar_tag_o   (unused_tag),
    .r_valid_i,
    .r_ready_o,
    .r_id_i,
    .r_data_i,
    .r_resp_i,
    .r_last_i
  );

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) in_valid_i && in_ready_o |->
      in_beats_i != '0)
  else $error("flk_axi_fetch: request of no beats");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      freed_i && !stop_i |-> 32'(places_q) < Places)
  else $error("flk_axi_fetch: more places than the buffer has");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      stop_i && !idle_o |=> stop_i)
  else $error("flk_axi_fetch: reads go on before the old ones are through");
`endif

endmodule
