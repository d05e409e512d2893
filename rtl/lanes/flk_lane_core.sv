// Core of the lanes: one list after another, from records to finished pixels (docs/reference/lanes.md). A list is of one 8x8 sub-tile, or, where the
// core is shared by Subtiles sub-tiles of a tile, of two that lie one below the other, or of all four.
//
// in  up to InWidth elements in a cycle, the older lower; all that are valid are taken together. An element is a record of 16 bytes and the
//     sub-tile that it is for, or the end of the list (eos), with any of its sub-tiles: a record that is for several is an element for each.
// out finished pixels, one per cycle, with sub-tile, mini-tile and pixel index, in any order; all pixels of a list before any of a later
//     one that the same lane has.
//
//     records ──► flk_splat_setup ──► flk_row_mask ──► dispatch ──► store of Slots splats ──► lanes ──► bank ──► flk_lane_result
//                                                        │                                 ▲
//                                                        └──► a queue for each lane ───────┘
//
// Dispatch drops a splat whose mask is empty, or holds only pixels that are known to be finished; another takes a slot of the store, one a
// cycle, and each lane with pixels in its mask takes their bits and the slot. A slot is free again when every lane has done with it. In a core
// that is shared a register slice stands before, visits and results take a cycle more, which keeps an FPGA's paths short.
// The end of a list goes through all queues in order.
// clear_i forgets everything: in the next cycle the core is as after reset. idle_o: no list and no pixel is inside.
// finished_o, of each sub-tile of the list that in_* takes: all its pixels are finished, so that its splats change no pixel any
// more. It comes from a register, rises some cycles late and is low in the cycle after a token was taken.
// in_ready_o hangs on registers alone; in a core that is shared and takes one element a cycle it is one.
module flk_lane_core
  import flk_pkg::*;
  import flk_lane_pkg::*;
#(
  parameter int unsigned Lanes    = 8,   // 4, 8, 16 or 32
  parameter int unsigned InWidth  = 2,   // 1 or 2
  parameter int unsigned Slots    = 20,
  parameter int unsigned Depth    = 16,  // of a lane's queue
  parameter int unsigned Subtiles = 1    // of a tile: 1, 2 or 4
) (
  input  logic                        clk_i,
  input  logic                        rst_ni,
  input  logic                        clear_i,
  output logic                        idle_o,
  // records
  input  logic         [InWidth-1:0]  in_valid_i,
  output logic                        in_ready_o,
  input  record_elem_t [InWidth-1:0]  in_elem_i,
  output logic         [Subtiles-1:0] finished_o,
  // finished pixels
  output logic                        out_valid_o,
  input  logic                        out_ready_i,
  output core_pixel_t                 out_data_o,
  // counters
  output lane_core_events_t           events_o
);

  if (Lanes != 4 && Lanes != 8 && Lanes != 16 && Lanes != 32) begin : gen_check_lanes
    $error("flk_lane_core: Lanes must be 4, 8, 16 or 32");
  end
  if (Subtiles != 1 && Subtiles != 2 && Subtiles != 4) begin : gen_check_subtiles
    $error("flk_lane_core: Subtiles must be 1, 2 or 4");
  end
  if (InWidth != 1 && InWidth != 2) begin : gen_check_width
    $error("flk_lane_core: InWidth must be 1 or 2");
  end
  if (Slots < 2 || Slots > 64 || Depth < 2 || Depth > 64) begin : gen_check_store
    $error("flk_lane_core: Slots and Depth must be 2 to 64");
  end

  localparam int unsigned STAGES = SETUP_STAGES + ROW_MASK_STAGES;
  localparam int unsigned Pixels = 64 / Lanes;  // of a sub-tile, that a lane has
  localparam int unsigned PixelW = $clog2(Subtiles * Pixels);
  localparam int unsigned SubtileW = (Subtiles > 1) ? $clog2(Subtiles) : 1;
  localparam int unsigned SlotW = $clog2(Slots);
  localparam bit MEMORY = Subtiles > 1;  // as of a lane's pixels (flk_lane)

  // ---- Setup and masks: index s holds what came s moves ago ----------------------------------------------------

  logic move;  // everything up to dispatch moves on
  logic [STAGES:1][InWidth-1:0] valid_q, eos_q;
  logic [InWidth-1:0][63:0] mask;
  lane_shape_t [InWidth-1:0] shape;
  lane_colour_t [InWidth-1:0] colour;
  logic [InWidth-1:0] in_eos;
  logic [InWidth-1:0][SubtileW-1:0] member;  // which of the core's sub-tiles

  assign in_ready_o = move;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= '0;
    end else if (clear_i) begin
      valid_q <= '0;
    end else if (move) begin
      valid_q <= {valid_q[STAGES-1:1], in_valid_i};
    end
  end

  always_ff @(posedge clk_i) begin
    if (move) begin
      eos_q <= {eos_q[STAGES-1:1], in_eos};
    end
  end

  for (genvar w = 0; w < InWidth; w++) begin : gen_way
    lane_splat_t splat, splat_q;
    subtile_t subtile_q;

    assign in_eos[w] = in_elem_i[w].eos;

    flk_splat_setup i_setup (
      .clk_i,
      .en_i     (move),
      .record_i (in_elem_i[w].record),
      .subtile_i(in_elem_i[w].subtile),
      .splat_o  (splat)
    );

    flk_row_mask i_mask (
      .clk_i,
      .en_i   (move),
      .splat_i(splat),
      .mask_o (mask[w])
    );

    flk_delay #(
      .Width($bits(lane_splat_t)),
      .Depth(ROW_MASK_STAGES)
    ) i_splat (
      .clk_i,
      .en_i(move),
      .d_i (splat),
      .q_o (splat_q)
    );

    flk_delay #(
      .Width($bits(subtile_t)),
      .Depth(STAGES)
    ) i_subtile (
      .clk_i,
      .en_i(move),
      .d_i (in_elem_i[w].subtile),
      .q_o (subtile_q)
    );

    always_comb begin
      shape[w].w  = splat_q.w[$bits(shape[w].w)-1:0];
      shape[w].z  = splat_q.z[$bits(shape[w].z)-1:0];
      shape[w].s0 = splat_q.s0;
      shape[w].s1 = splat_q.s1;
      shape[w].s2 = splat_q.s2;
      shape[w].lo = splat_q.lo;
      if (eos_q[STAGES][w]) begin
        shape[w][$bits(subtile_t)-1:0] = subtile_q;
      end
      colour[w] = {splat_q.red, splat_q.green, splat_q.blue};
      member[w] = '0;
      if (Subtiles == 2) begin
        member[w] = SubtileW'(subtile_q.row[0]);
      end else if (Subtiles == 4) begin
        member[w] = SubtileW'({subtile_q.row[0], subtile_q.col[0]});
      end
    end

    // More of w and z than a lane takes matters to masks alone.
    logic unused_high;
    assign unused_high = ^{splat_q.w, splat_q.z};
  end

  // ---- Choice: the oldest splat that is wanted -------------------------------------------------------------------

  typedef struct packed {
    logic                         token;
    logic [SubtileW-1:0]          member;
    logic [Lanes-1:0]             need;  // lanes that get an entry
    logic [Lanes-1:0][Pixels-1:0] bits;
    lane_shape_t                  shape;
    lane_colour_t                 colour;
  } visit_t;

  logic [Subtiles-1:0][63:0] alive, worth;  // pixel 16 m + i: not known to be finished
  logic [InWidth-1:0][63:0] live;
  logic [InWidth-1:0] wanted, sent, sent_q, left;  // sent: with the one of this cycle
  logic [Lanes-1:0] need, queue_ready;
  logic [SlotW-1:0] slot;
  logic slot_free, room, dispatch, choice, tokens_ahead;
  logic choice_valid, choice_ready, given_valid, given_ready;
  logic [63:0] chosen;
  visit_t choice_visit, given;

  always_comb begin
    live = '0;
    for (int unsigned w = 0; w < InWidth; w++) begin
      for (int unsigned s = 0; s < Subtiles; s++) begin
        live[w] |= mask[w] & worth[s] & {64{member[w] == SubtileW'(s)}};
      end
    end
    if (InWidth == 2 && valid_q[STAGES][0] && eos_q[STAGES][0] && !sent_q[0]) begin
      live[InWidth-1] = mask[InWidth-1];  // of the next list
    end
    for (int unsigned w = 0; w < InWidth; w++) begin
      wanted[w] = valid_q[STAGES][w] && !sent_q[w] && (eos_q[STAGES][w] || live[w] != '0);
    end
    choice = InWidth == 2 && !wanted[0];
    chosen = live[choice];
    choice_valid        = wanted != '0;
    choice_visit.token  = eos_q[STAGES][choice];
    choice_visit.member = member[choice];
    choice_visit.shape  = shape[choice];
    choice_visit.colour = colour[choice];
    for (int unsigned l = 0; l < Lanes; l++) begin
      for (int unsigned p = 0; p < Pixels; p++) begin
        choice_visit.bits[l][p] = !eos_q[STAGES][choice] && chosen[lane_pixel(Lanes, l, p)];
      end
      choice_visit.need[l] = choice_visit.token || choice_visit.bits[l] != '0;
    end
  end

  if (MEMORY) begin : gen_slice
    flk_skid_buffer #(
      .Width($bits(visit_t)),
      .Early(1'b1)
    ) i_slice (
      .clk_i,
      .rst_ni,
      .clear_i,
      .in_valid_i (choice_valid),
      .in_ready_o (choice_ready),
      .in_data_i  (choice_visit),
      .out_valid_o(given_valid),
      .out_ready_i(given_ready),
      .out_data_o (given)
    );

    // Tokens inside: lanes do not know of them, so their flags are of an older list.
    logic [1:0] ahead_q;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        ahead_q <= '0;
      end else if (clear_i) begin
        ahead_q <= '0;
      end else begin
        ahead_q <= ahead_q + 2'(choice_valid && choice_ready && choice_visit.token)
                           - 2'(dispatch && given.token);
      end
    end

    assign tokens_ahead = ahead_q != '0;
  end else begin : gen_slice
    assign given_valid  = choice_valid;
    assign given        = choice_visit;
    assign choice_ready = given_ready;
    assign tokens_ahead = 1'b0;
  end

  assign worth = tokens_ahead ? '1 : alive;

  // ---- Dispatch --------------------------------------------------------------------------------------------------

  assign need = given.need;

  function automatic logic [SlotW-1:0] lowest(logic [Slots-1:0] free);
    lowest = '0;
    for (int unsigned i = Slots; i > 0; i--) begin
      if (free[i-1]) begin
        lowest = SlotW'(i - 1);
      end
    end
  endfunction

  assign room      = (queue_ready | ~need) == '1;
  assign given_ready = slot_free && room;
  assign dispatch    = given_valid && given_ready;

  always_comb begin
    left = wanted;
    sent = sent_q;
    if (choice_valid && choice_ready) begin
      left[choice] = 1'b0;
      sent[choice] = 1'b1;
    end
    move = (MEMORY && InWidth == 1) ? choice_ready : left == '0;
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      sent_q <= '0;
    end else begin
      sent_q <= (move || clear_i) ? '0 : sent;
    end
  end

  // ---- Store -------------------------------------------------------------------------------------------------------

  logic [Slots-1:0][Lanes-1:0] rest, pending_d, pending_q;
  logic [Slots-1:0] take;
  logic [Lanes-1:0] release_valid;
  logic [Lanes-1:0][SlotW-1:0] release_slot;

  always_comb begin
    rest = pending_q;
    for (int unsigned i = 0; i < Slots; i++) begin
      for (int unsigned l = 0; l < Lanes; l++) begin
        if (release_valid[l] && release_slot[l] == SlotW'(i)) begin
          rest[i][l] = 1'b0;
        end
      end
      take[i]      = dispatch && slot == SlotW'(i);
      pending_d[i] = take[i] ? need : rest[i];
    end
    if (clear_i) begin
      pending_d = '0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      pending_q <= '0;
    end else begin
      pending_q <= pending_d;
    end
  end

  // A free slot: found among those that are, or, in a shared core, a cycle before, so that nothing waits for the search.
  if (MEMORY) begin : gen_slot
    logic [SlotW-1:0] slot_q;
    logic             free_q;
    logic [Slots-1:0] free, other;  // in the next cycle, while nothing is given; and if it is

    always_comb begin
      for (int unsigned i = 0; i < Slots; i++) begin
        free[i]  = rest[i] == '0;
        other[i] = free[i] && slot_q != SlotW'(i);
      end
    end

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        slot_q <= '0;
        free_q <= 1'b1;
      end else if (clear_i) begin
        slot_q <= '0;
        free_q <= 1'b1;
      end else begin
        slot_q <= dispatch ? lowest(other) : lowest(free);
        free_q <= dispatch ? other != '0 : free != '0;
      end
    end

    assign slot      = slot_q;
    assign slot_free = free_q;
  end else begin : gen_slot
    logic [Slots-1:0] busy;

    always_comb begin
      for (int unsigned i = 0; i < Slots; i++) begin
        busy[i] = pending_q[i] != '0;
      end
    end

    assign slot      = lowest(~busy);
    assign slot_free = !(&busy);
  end

  // What each lane reads.
  logic [Lanes-1:0][SlotW-1:0] visit_slot;
  lane_shape_t [Lanes-1:0] visit_shape;
  lane_colour_t [Lanes-1:0] visit_colour;

  if (MEMORY) begin : gen_shape
    (* ram_style = "distributed" *)
    logic [$bits(lane_shape_t)-1:0] storage_q[Slots];

    // A free slot holds nothing, so what is given may lie there before its dispatch: the write hangs on the slots alone.
    always_ff @(posedge clk_i) begin
      if (slot_free) begin
        storage_q[slot] <= given.shape;
      end
    end

    for (genvar l = 0; l < Lanes; l++) begin : gen_read
      assign visit_shape[l] = storage_q[visit_slot[l]];
    end
  end else begin : gen_shape
    lane_shape_t [Slots-1:0] shape_q;

    always_ff @(posedge clk_i) begin
      for (int unsigned i = 0; i < Slots; i++) begin
        if (dispatch && slot == SlotW'(i)) begin
          shape_q[i] <= given.shape;
        end
      end
    end

    // One bit for each slot selects: smaller than a multiplexer by the slot's number.
    always_comb begin
      visit_shape = '0;
      for (int unsigned l = 0; l < Lanes; l++) begin
        for (int unsigned i = 0; i < Slots; i++) begin
          visit_shape[l] |= shape_q[i] & {$bits(lane_shape_t){visit_slot[l] == SlotW'(i)}};
        end
      end
    end
  end

  if (MEMORY) begin : gen_colour
    (* ram_style = "distributed" *)
    logic [$bits(lane_colour_t)-1:0] storage_q[Slots];

    always_ff @(posedge clk_i) begin
      if (slot_free) begin
        storage_q[slot] <= given.colour;
      end
    end

    for (genvar l = 0; l < Lanes; l++) begin : gen_read
      assign visit_colour[l] = storage_q[release_slot[l]];
    end
  end else begin : gen_colour
    lane_colour_t [Slots-1:0] colour_q;

    always_ff @(posedge clk_i) begin
      for (int unsigned i = 0; i < Slots; i++) begin
        if (dispatch && slot == SlotW'(i)) begin
          colour_q[i] <= given.colour;
        end
      end
    end

    always_comb begin
      visit_colour = '0;
      for (int unsigned l = 0; l < Lanes; l++) begin
        for (int unsigned i = 0; i < Slots; i++) begin
          visit_colour[l] |= colour_q[i] & {$bits(lane_colour_t){release_slot[l] == SlotW'(i)}};
        end
      end
    end
  end

  // ---- Lanes -------------------------------------------------------------------------------------------------------

  logic [Lanes-1:0] lane_idle, starved, waits;
  logic [Subtiles-1:0][Lanes-1:0] lane_finished;
  logic [Lanes-1:0] pixel_valid, pixel_ready, pixel_start, pixel_last;
  lane_pixel_t [Lanes-1:0] pixel;
  lane_events_t [Lanes-1:0] lane_events;
  logic [Lanes-1:0][Subtiles-1:0][Pixels-1:0] lane_alive;

  for (genvar l = 0; l < Lanes; l++) begin : gen_lane
    logic visit_valid, visit_eos, visit_last, bank_free, token_inside, token_done, queue_empty;
    logic [PixelW-1:0] visit_pixel;
    logic [Subtiles-1:0][Pixels-1:0] finished;

    flk_lane_queue #(
      .Pixels  (Pixels),
      .Slots   (Slots),
      .Depth   (Depth),
      .Subtiles(Subtiles)
    ) i_queue (
      .clk_i,
      .rst_ni,
      .clear_i,
      .push_i        (dispatch && need[l]),
      .ready_o       (queue_ready[l]),
      .push_slot_i   (slot),
      .push_subtile_i(given.member),
      .push_pixels_i (given.bits[l]),
      .alive_o       (lane_alive[l]),
      .empty_o       (queue_empty),
      .finished_i    (finished),
      .token_i       (token_inside),
      .token_done_i  (token_done),
      .bank_free_i   (bank_free),
      .visit_valid_o (visit_valid),
      .visit_eos_o   (visit_eos),
      .visit_last_o  (visit_last),
      .visit_pixel_o (visit_pixel),
      .visit_slot_o  (visit_slot[l]),
      .starved_o     (starved[l]),
      .waits_o       (waits[l])
    );

    flk_lane #(
      .Lanes   (Lanes),
      .Lane    (l),
      .Slots   (Slots),
      .Subtiles(Subtiles)
    ) i_lane (
      .clk_i,
      .rst_ni,
      .clear_i,
      .visit_valid_i(visit_valid),
      .visit_eos_i  (visit_eos),
      .visit_last_i (visit_last),
      .visit_pixel_i(visit_pixel),
      .visit_slot_i (visit_slot[l]),
      .visit_shape_i(visit_shape[l]),
      .colour_slot_o(release_slot[l]),
      .colour_i     (visit_colour[l]),
      .release_o    (release_valid[l]),
      .bank_free_o  (bank_free),
      .token_o      (token_inside),
      .token_done_o (token_done),
      .finished_o   (finished),
      .out_valid_o  (pixel_valid[l]),
      .out_ready_i  (pixel_ready[l]),
      .out_data_o   (pixel[l]),
      .out_start_o  (pixel_start[l]),
      .out_last_o   (pixel_last[l]),
      .events_o     (lane_events[l])
    );

    assign lane_idle[l]     = queue_empty && bank_free;

    for (genvar s = 0; s < Subtiles; s++) begin : gen_subtile
      assign lane_finished[s][l] = lane_alive[l][s] == '0;

      for (genvar p = 0; p < Pixels; p++) begin : gen_pixel
        assign alive[s][lane_pixel(Lanes, l, p)] = lane_alive[l][s][p];
      end
    end
  end

  // ---- Finished pixels ---------------------------------------------------------------------------------------------

  logic leaving_valid, leaving_ready, taken_valid, taken_ready;
  lane_pixel_t leaving_pixel, taken;
  logic found_valid, found_ready;
  core_pixel_t converted;

  // Where the pixel is.
  typedef struct packed {
    subtile_t   subtile;
    logic [1:0] minitile;
    logic [3:0] index;
  } place_t;

  place_t place, found;

  flk_lane_arbiter #(
    .Lanes(Lanes)
  ) i_arbiter (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (pixel_valid),
    .in_ready_o (pixel_ready),
    .in_data_i  (pixel),
    .in_start_i (pixel_start),
    .in_last_i  (pixel_last),
    .out_valid_o(leaving_valid),
    .out_ready_i(leaving_ready),
    .out_data_o (leaving_pixel)
  );

  flk_pipe_reg #(
    .Width($bits(lane_pixel_t))
  ) i_taken (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (leaving_valid),
    .in_ready_o (leaving_ready),
    .in_data_i  (leaving_pixel),
    .out_valid_o(taken_valid),
    .out_ready_i(taken_ready),
    .out_data_o (taken)
  );

  assign place.subtile  = taken.subtile;
  assign place.minitile = {taken.row[2], taken.column[2]};
  assign place.index    = {taken.row[1:0], taken.column[1:0]};

  flk_lane_result #(
    .Registered(Subtiles > 1)
  ) i_result (
    .clk_i,
    .take_i  (taken_valid && taken_ready),
    .s_i     (taken.s),
    .colour_i(taken.colour),
    .pixel_o (converted.pixel)
  );

  if (Subtiles > 1) begin : gen_found
    flk_pipe_reg #(
      .Width($bits(place_t))
    ) i_found (
      .clk_i,
      .rst_ni,
      .clear_i,
      .in_valid_i (taken_valid),
      .in_ready_o (taken_ready),
      .in_data_i  (place),
      .out_valid_o(found_valid),
      .out_ready_i(found_ready),
      .out_data_o (found)
    );
  end else begin : gen_found
    assign found_valid = taken_valid;
    assign taken_ready = found_ready;
    assign found       = place;
  end

  assign converted.subtile  = found.subtile;
  assign converted.minitile = found.minitile;
  assign converted.index    = found.index;

  flk_pipe_reg #(
    .Width(CORE_PIXEL_BITS)
  ) i_out (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (found_valid),
    .in_ready_o (found_ready),
    .in_data_i  (converted),
    .out_valid_o,
    .out_ready_i,
    .out_data_o
  );

  // ---- The whole core ----------------------------------------------------------------------------------------------

  logic [Subtiles-1:0] finished_q;
  logic token_in;

  assign token_in   = move && (in_valid_i & in_eos) != '0;
  assign finished_o = finished_q;
  assign idle_o     = valid_q == '0 && !given_valid && (&lane_idle) && !taken_valid &&
                  !found_valid && !out_valid_o;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      finished_q <= '0;
    end else begin
      for (int unsigned s = 0; s < Subtiles; s++) begin
        finished_q[s] <= (&lane_finished[s]) && (valid_q & eos_q) == '0 && !tokens_ahead &&
                         !token_in && !clear_i;
      end
    end
  end

  // ---- Counters ------------------------------------------------------------------------------------------------------

  logic [Lanes-1:0] entry_q;  // lanes that took an entry of a splat, counted a cycle late

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      entry_q <= '0;
    end else begin
      entry_q <= (dispatch && !given.token) ? need : '0;
    end
  end

  always_comb begin
    events_o         = '0;
    events_o.busy    = in_valid_i != '0 && move;
    events_o.stalled = in_valid_i != '0 && !move;
    events_o.idle    = in_valid_i == '0;
    for (int unsigned w = 0; w < InWidth; w++) begin
      events_o.tokens += 2'(in_valid_i[w] && move && in_eos[w]);
      events_o.splats += 2'(in_valid_i[w] && move && !in_eos[w]);
      if (move && valid_q[STAGES][w] && !eos_q[STAGES][w] && !sent[w]) begin
        events_o.rejected += 2'(mask[w] == '0);
        events_o.dropped  += 2'(mask[w] != '0);
      end
    end
    events_o.dispatched = dispatch;
    events_o.no_slot    = given_valid && !slot_free;
    events_o.no_room    = given_valid && slot_free && !room;
    for (int unsigned l = 0; l < Lanes; l++) begin
      events_o.entries  += 6'(entry_q[l]);
      events_o.visits   += 6'(lane_events[l].visited);
      events_o.skipped  += 6'(lane_events[l].skipped);
      events_o.blended  += 6'(lane_events[l].blended);
      events_o.finished += 6'(lane_events[l].finished);
      events_o.starved  += 6'(starved[l]);
      events_o.waits    += 6'(waits[l]);
    end
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      in_valid_i != '0 && !in_ready_o && !clear_i |=>
      clear_i || (in_valid_i == $past(in_valid_i) && $stable(in_elem_i)))
  else $error("flk_lane_core: element changed before its transfer");

  assert property (@(posedge clk_i) disable iff (!rst_ni) !in_valid_i[InWidth-1] || in_valid_i[0])
  else $error("flk_lane_core: a younger element without the older one");

  assert property (@(posedge clk_i) disable iff (!rst_ni) dispatch |-> pending_q[slot] == '0)
  else $error("flk_lane_core: a slot was given twice");
`endif

endmodule
