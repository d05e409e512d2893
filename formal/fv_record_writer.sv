// flk_record_writer: the lines are the beats, once each and in order (fv_stream on address and quarters);
// a record, whichever pick_i chooses when it is taken, is in its quarter of its beat's line (with
// Quarters = 2 in its half) and that line marks it. Each quarter takes a record in every cycle in which one
// is offered to it; no memory is read and written at one address. The assertions l_* link registers and
// places, for induction.
//
// What is assumed is the unit's contract: places are assigned in order of the ring, at most all of its
// beats at a time that were not freed; a beat's records are fixed when it is assigned (wants_i), and its
// item comes after that, in order; each of its records is offered by one lane, once.
module fv_record_writer
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Quarters   = 1,
  localparam int unsigned RecordBits = 2,
  localparam int unsigned Records    = 4 / Quarters,
  localparam int unsigned Beats      = 1 << PLACE_BEAT_BITS
) (
  input logic                             clk_i,
  input logic                             again_i,
  input logic                             pick_i,
  input logic                             pick_beat_i,
  input logic [1:0]                       lane_i,
  input logic                             assign_i,
  input logic [Records-1:0]               wants_i,
  input logic [LANES-1:0]                 in_valid_i,
  input place_t [LANES-1:0]               in_place_i,
  input logic [LANES-1:0][RecordBits-1:0] in_record_i,
  input logic                             beat_valid_i,
  input logic [BEAT_BITS-1:0]             beat_i,
  input logic                             out_ready_i
);

  localparam int unsigned CountBits = PLACE_BEAT_BITS + 2;

  logic                       rst_n, idle, beat_ready, freed, out_valid, line;
  logic [LANES-1:0]           in_ready, taken;
  logic [3:0]                 out_strobe;
  logic [Records-1:0][RecordBits-1:0] out_data;
  logic [BEAT_BITS-1:0]       out_beat;
  record_beat_t               beat;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  // A place's record among those of its beat, and quarters of records.

  function automatic logic [1:0] record_of(place_t place);
    return place.quarter >> (Quarters - 1);
  endfunction

  function automatic logic [3:0] quarters_of(logic [Records-1:0] records);
    for (int unsigned q = 0; q < 4; q++) begin
      quarters_of[q] = records[q/Quarters];
    end
  endfunction

  flk_record_writer #(
    .RecordBits(RecordBits),
    .Quarters  (Quarters)
  ) dut (
    .clk_i,
    .rst_ni      (rst_n),
    .idle_o      (idle),
    .in_valid_i,
    .in_ready_o  (in_ready),
    .in_place_i,
    .in_record_i,
    .beat_valid_i,
    .beat_ready_o(beat_ready),
    .beat_data_i (beat),
    .freed_o     (freed),
    .out_valid_o (out_valid),
    .out_ready_i,
    .out_beat_o  (out_beat),
    .out_data_o  (out_data),
    .out_strobe_o(out_strobe)
  );

  assign taken = in_valid_i & in_ready;
  assign line  = out_valid && out_ready_i;

  // Who assigns: beats from oldest_q on are assigned; items have come for those before item_q.

  logic [PLACE_BEAT_BITS-1:0]   oldest_q, item_q, next;
  logic [CountBits-1:0]         assigned_q, known_q;  // not freed; of these with item
  logic [Beats-1:0][Records-1:0] wants_q, to_come_q;  // records; of these not taken

  assign next = oldest_q + PLACE_BEAT_BITS'(assigned_q);
  assign item_q = oldest_q + PLACE_BEAT_BITS'(known_q);
  assign beat = '{beat: beat_i, quarters: quarters_of(wants_q[item_q])};

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      oldest_q   <= '0;
      assigned_q <= '0;
      known_q    <= '0;
      to_come_q  <= '0;
    end else begin
      oldest_q   <= oldest_q + PLACE_BEAT_BITS'(freed);
      assigned_q <= assigned_q + CountBits'(assign_i) - CountBits'(freed);
      known_q    <= known_q + CountBits'(beat_valid_i) - CountBits'(freed);
      for (int unsigned k = 0; k < LANES; k++) begin
        if (taken[k]) begin
          to_come_q[in_place_i[k].beat][record_of(in_place_i[k])] <= 1'b0;
        end
      end
      if (assign_i) begin
        to_come_q[next] <= wants_i;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (assign_i) begin
      wants_q[next] <= wants_i;
    end
  end

  logic [LANES-1:0]                 offered_q;
  place_t [LANES-1:0]               place_q;
  logic [LANES-1:0][RecordBits-1:0] record_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      offered_q <= '0;
    end else begin
      offered_q <= in_valid_i & ~in_ready;
    end
  end

  always_ff @(posedge clk_i) begin
    place_q  <= in_place_i;
    record_q <= in_record_i;
  end

  always_comb begin
    if (rst_n) begin
      assume (!assign_i || assigned_q < CountBits'(Beats) && wants_i != '0);
      assume (!beat_valid_i || known_q < assigned_q);
      for (int unsigned k = 0; k < LANES; k++) begin
        assume (!in_valid_i[k] || to_come_q[in_place_i[k].beat][record_of(in_place_i[k])]);
        assume (!in_valid_i[k] || in_place_i[k].quarter == record_of(in_place_i[k]) << (Quarters - 1));
        assume (!offered_q[k] ||
                in_valid_i[k] && in_place_i[k] == place_q[k] && in_record_i[k] == record_q[k]);
        for (int unsigned j = 0; j < k; j++) begin
          assume (!in_valid_i[k] || !in_valid_i[j] || in_place_i[k] != in_place_i[j]);
        end
      end
    end
  end

  // Beats.

  logic [CountBits-1:0] entries, beat_ahead;
  logic                 watching;
  logic [BEAT_BITS+3:0] watched;

  fv_stream #(
    .Width   (BEAT_BITS + 4),
    .Capacity(Beats + 2)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i    (1'b0),
    .pick_i     (pick_beat_i),
    .push_i     (beat_valid_i),
    .in_data_i  (beat),
    .out_valid_i(out_valid),
    .out_ready_i,
    .out_data_i ({out_beat, out_strobe}),
    .inside_o   (entries),
    .watching_o (watching),
    .ahead_o    (beat_ahead),
    .watched_o  (watched)
  );

  // The chosen record: lines that leave before its own.

  logic                  follow_q;
  logic [1:0]            lane_q, which_q;
  logic [CountBits-1:0]  ahead_q, ahead;
  logic [PLACE_BEAT_BITS-1:0] head;  // first beat that is not read
  logic [RecordBits-1:0] value_q;

  assign head  = oldest_q + PLACE_BEAT_BITS'(freed);
  assign ahead = CountBits'(PLACE_BEAT_BITS'(in_place_i[lane_q].beat - head)) +
                 CountBits'(out_valid) - CountBits'(line);

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      follow_q <= 1'b0;
    end else if (follow_q) begin
      follow_q <= !(line && ahead_q == '0);
    end else begin
      follow_q <= pick_i && taken[lane_q];
    end
  end

  always_ff @(posedge clk_i) begin
    lane_q <= lane_q;
    if (follow_q) begin
      ahead_q <= ahead_q - CountBits'(line);
    end else begin
      ahead_q   <= ahead;
      which_q   <= record_of(in_place_i[lane_q]);
      value_q   <= in_record_i[lane_q];
    end
  end

  always_comb begin
    assume (lane_q < 2'(LANES) && lane_i == lane_q);
  end

  // What is held where.

  logic [CountBits-1:0]                       items, waiting;  // with the output register; without
  logic [Beats:0][BEAT_BITS+3:0]              item;            // oldest first
  logic [Records-1:0][Beats-1:0]              there;
  logic [Records-1:0][Beats-1:0][RecordBits-1:0] stored;
  logic                                       fetched;
  logic [PLACE_BEAT_BITS:0]                   used;
  logic [PLACE_BEAT_BITS-1:0]                 follow_at;

  assign fetched   = dut.i_beats.out_valid_q;
  assign used      = (PLACE_BEAT_BITS + 1)'(dut.i_beats.used_q);
  assign waiting   = CountBits'(used) + CountBits'(fetched);
  assign items     = waiting + CountBits'(out_valid);
  assign follow_at = head + PLACE_BEAT_BITS'(ahead_q) - PLACE_BEAT_BITS'(out_valid);

  for (genvar i = 0; i <= Beats; i++) begin : gen_item
    assign item[i] = fetched && i == 0 ? dut.i_beats.out_q
                   : dut.i_beats.words_q[PLACE_BEAT_BITS'(i) - PLACE_BEAT_BITS'(fetched)];
  end
  for (genvar r = 0; r < Records; r++) begin : gen_stored
    assign there[r] = dut.gen_record[r].there_q;
    for (genvar b = 0; b < Beats; b++) begin : gen_beat
      assign stored[r][b] = dut.gen_record[r].i_records.storage_q[b];
    end
  end

  always_comb begin
    if (rst_n) begin
      // The specification.
      a_room: assert (beat_ready);
      if (follow_q && ahead_q == '0 && out_valid) begin
        a_record: assert (out_strobe == (out_strobe | quarters_of(Records'(1) << which_q)) &&
                          out_data[which_q] == value_q);
      end
      if (idle) begin
        a_idle: assert (!follow_q && entries == '0);
      end
      a_freed: assert (!freed || known_q != '0);
      // Links.
      l_counts: assert (known_q <= assigned_q && assigned_q <= CountBits'(Beats));
      l_head: assert (dut.head_q == head);
      l_waiting: assert (waiting == known_q - CountBits'(freed));
      l_items: assert (entries == items);
      l_usage: assert (CountBits'(used) <= CountBits'(Beats));
      if (watching) begin
        if (out_valid && beat_ahead == '0) begin
          l_shown: assert ({out_beat, out_strobe} == watched);
        end else begin
          l_kept: assert (item[beat_ahead - CountBits'(out_valid)] == watched);
        end
      end
      if (follow_q) begin
        l_which: assert (32'(which_q) < Records);
      end
      if (follow_q && !(ahead_q == '0 && out_valid)) begin
        l_ahead: assert (ahead_q - CountBits'(out_valid) < assigned_q - CountBits'(freed));
        l_there: assert (there[which_q][follow_at] && wants_q[follow_at][which_q]);
        l_value: assert (stored[which_q][follow_at] == value_q);
      end

      c_ring: cover (follow_q && ahead_q == CountBits'(Beats) && line);
      c_idle: cover (idle && oldest_q == '1);
    end
  end

  for (genvar b = 0; b < Beats; b++) begin : gen_place
    logic [PLACE_BEAT_BITS-1:0] distance;
    logic                       live;
    logic [Records-1:0]         here;
    assign distance = PLACE_BEAT_BITS'(b) - head;
    assign live     = CountBits'(distance) < assigned_q - CountBits'(freed);
    for (genvar r = 0; r < Records; r++) begin : gen_here
      assign here[r] = there[r][b];
    end
    always_comb begin
      if (rst_n) begin
        if (live) begin
          l_wants: assert (wants_q[b] != '0 && (to_come_q[b] & ~wants_q[b]) == '0);
          l_records: assert (here == (wants_q[b] & ~to_come_q[b]));
        end else begin
          l_none: assert (to_come_q[b] == '0 && here == '0);
        end
        if (CountBits'(distance) < waiting) begin
          l_quarters: assert (item[distance][3:0] == quarters_of(wants_q[b]));
        end
      end
    end
  end

  for (genvar r = 0; r < Records; r++) begin : gen_takes
    logic [LANES-1:0] wants;
    for (genvar k = 0; k < LANES; k++) begin : gen_lane
      assign wants[k] = in_valid_i[k] && record_of(in_place_i[k]) == 2'(r);
    end
    always_comb begin
      if (rst_n) begin
        a_takes: assert (wants == '0 || (wants & in_ready) != '0);
        a_one: assert (((wants & in_ready) & ((wants & in_ready) - 1'b1)) == '0);
        a_apart: assert (!(dut.take && dut.beat.quarters[r*Quarters] && dut.written[r]) ||
                         dut.written_at[r] != dut.head_q);
        l_first: assert (2'(dut.gen_record[r].gen_turns.i_arbiter.first_q) < 2'(LANES));
      end
    end
  end

endmodule
