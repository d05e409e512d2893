// Record writer: records of all lanes, which come in any order, into beats of memory in order.
//
// Records go to a place: one of four quarters of a beat of a ring of 2^PLACE_BEAT_BITS beats, or with
// Quarters = 2 a half: its first quarter is the place, and both of them come or neither. The
// k-th element of the stream of beats says where ring beat k modulo 2^PLACE_BEAT_BITS lies in memory
// and which quarters come; a record may be there before it. When all of them are there, the beat
// leaves as a line: record r in out_data_o[r], its quarters marked in out_strobe_o; others hold anything.
// Who assigns places counts freed_o (a beat's place is free again, one a cycle) and keeps at most
// 2^PLACE_BEAT_BITS beats assigned that were not freed: a record is never refused for its place.
// Throughput: a record a cycle and quarter (half), lanes that want the same in turn; a line a cycle. A line
// stands at the output two cycles after its last record was taken, three after its beat.
// in_ready_o depends combinationally on in_valid_i and in_place_i; no other path.
module flk_record_writer
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Lanes      = LANES,        // 1 or more
  parameter  int unsigned RecordBits = 128,
  parameter  int unsigned Quarters   = 1,            // of a beat, that a record takes: 1 or 2
  localparam int unsigned Records    = 4 / Quarters  // of a beat
) (
  input  logic                             clk_i,
  input  logic                             rst_ni,
  output logic                             idle_o,
  // Records
  input  logic [Lanes-1:0]                 in_valid_i,
  output logic [Lanes-1:0]                 in_ready_o,
  input  place_t [Lanes-1:0]               in_place_i,
  input  logic [Lanes-1:0][RecordBits-1:0] in_record_i,
  // Beats
  input  logic                             beat_valid_i,
  output logic                             beat_ready_o,
  input  record_beat_t                     beat_data_i,
  output logic                             freed_o,
  // Lines
  output logic                             out_valid_o,
  input  logic                             out_ready_i,
  output logic [BEAT_BITS-1:0]             out_beat_o,
  output logic [Records-1:0][RecordBits-1:0] out_data_o,
  output logic [3:0]                       out_strobe_o
);

  localparam int unsigned Beats = 1 << PLACE_BEAT_BITS;
  localparam int unsigned ItemBits = PLACE_BEAT_BITS + RecordBits;

  if (Quarters != 1 && Quarters != 2) begin : gen_check
    $error("flk_record_writer: Quarters must be 1 or 2");
  end

  // ---- beats ---------------------------------------------------------------------------------------

  logic         known, take, beats_empty;
  record_beat_t beat;

  flk_sram_fifo #(
    .Width($bits(record_beat_t)),
    .Depth(Beats)
  ) i_beats (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (beat_valid_i),
    .in_ready_o (beat_ready_o),
    .in_data_i  (beat_data_i),
    .out_valid_o(known),
    .out_ready_i(take),
    .out_data_o (beat),
    .empty_o    (beats_empty)
  );

  // ---- records of a beat ---------------------------------------------------------------------------

  logic [PLACE_BEAT_BITS-1:0]                 head_q;
  logic [3:0]                                 here;  // of the first beat, by quarter
  logic [Records-1:0]                         none;  // no record
  logic [Lanes-1:0][ItemBits-1:0]             item;
  logic [3:0][Lanes-1:0]                      ready;  // by quarter
  logic [Records-1:0]                         written;
  logic [Records-1:0][PLACE_BEAT_BITS-1:0]    written_at;

  for (genvar k = 0; k < Lanes; k++) begin : gen_lane
    assign item[k]       = {in_place_i[k].beat, in_record_i[k]};
    assign in_ready_o[k] = ready[in_place_i[k].quarter][k];
  end

  for (genvar r = 0; r < Records; r++) begin : gen_record
    logic [Lanes-1:0]          wants;
    logic [RecordBits-1:0]     record;
    logic [Beats-1:0]          there_q;
    logic [Lanes-1:0]          taken;

    localparam int unsigned First = r * Quarters;  // its first quarter

    for (genvar k = 0; k < Lanes; k++) begin : gen_wants
      assign wants[k] = in_valid_i[k] && in_place_i[k].quarter >> (Quarters - 1) == 2'(r);
    end

    if (Lanes == 1) begin : gen_alone
      assign written[r]              = wants[0];
      assign {written_at[r], record} = item[0];
      assign taken                   = 1'b1;
    end else begin : gen_turns
      logic [$clog2(Lanes)-1:0] unused_lane;

      flk_stream_arbiter #(
        .Inputs(Lanes),
        .Width (ItemBits)
      ) i_arbiter (
        .clk_i,
        .rst_ni,
        .clear_i    (1'b0),
        .in_valid_i (wants),
        .in_ready_o (taken),
        .in_data_i  (item),
        .out_valid_o(written[r]),
        .out_ready_i(1'b1),
        .out_data_o ({written_at[r], record}),
        .out_index_o(unused_lane)
      );
    end

    flk_sram #(
      .Width(RecordBits),
      .Depth(Beats)
    ) i_records (
      .clk_i,
      .wr_en_i  (written[r]),
      .wr_addr_i(written_at[r]),
      .wr_data_i(record),
      .rd_en_i  (take && beat.quarters[First]),
      .rd_addr_i(head_q),
      .rd_data_o(out_data_o[r])
    );

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        there_q <= '0;
      end else begin
        if (take) begin
          there_q[head_q] <= 1'b0;
        end
        if (written[r]) begin
          there_q[written_at[r]] <= 1'b1;
        end
      end
    end

    assign ready[First+:Quarters] = {Quarters{taken}};
    assign here[First+:Quarters]  = {Quarters{there_q[head_q]}};
    assign none[r]                = there_q == '0;

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        written[r] |-> !there_q[written_at[r]])
    else $error("flk_record_writer: a record for a place that is taken");

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        known && !beat.quarters[First] |-> !here[First])
    else $error("flk_record_writer: a record for a quarter that was not to come");
`endif
  end

  // ---- lines ---------------------------------------------------------------------------------------

  logic                 freed_q, out_valid_q;
  logic [BEAT_BITS-1:0] out_beat_q;
  logic [3:0]           out_strobe_q;

  assign take = known && (beat.quarters & ~here) == '0 && (!out_valid_q || out_ready_i);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      head_q      <= '0;
      freed_q     <= 1'b0;
      out_valid_q <= 1'b0;
    end else begin
      head_q      <= head_q + PLACE_BEAT_BITS'(take);
      freed_q     <= take;
      out_valid_q <= take || (out_valid_q && !out_ready_i);
    end
  end

  always_ff @(posedge clk_i) begin
    if (take) begin
      out_beat_q   <= beat.beat;
      out_strobe_q <= beat.quarters;
    end
  end

  assign freed_o      = freed_q;
  assign out_valid_o  = out_valid_q;
  assign out_beat_o   = out_beat_q;
  assign out_strobe_o = out_strobe_q;
  assign idle_o       = beats_empty && none == '1 && !out_valid_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      beat_valid_i |-> beat_data_i.quarters != '0)
  else $error("flk_record_writer: a beat without records");

  if (Quarters == 2) begin : gen_halves
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        beat_valid_i |-> beat_data_i.quarters[1] == beat_data_i.quarters[0] &&
                         beat_data_i.quarters[3] == beat_data_i.quarters[2])
    else $error("flk_record_writer: half a record");
  end

  for (genvar k = 0; k < Lanes; k++) begin : gen_held
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        in_valid_i[k] && !in_ready_o[k] |=>
        in_valid_i[k] && $stable(in_place_i[k]) && $stable(in_record_i[k]))
    else $error("flk_record_writer: input changed before its transfer");
  end

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i |=>
      out_valid_o && $stable(out_beat_o) && $stable(out_data_o) && $stable(out_strobe_o))
  else $error("flk_record_writer: output changed before its transfer");
`endif

endmodule
