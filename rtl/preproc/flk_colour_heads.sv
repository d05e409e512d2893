// Heads of the colour store: which clusters' stored colours last (docs/reference/colour_store.md).
//
// Of each cluster that passed the cull, in order, the head is requested and, when it comes, tested: its colours last where it has the
// frame's generation, a bit at least, and flk_colours_last says so. Out come the clusters in order: where they lie in
// the store, the bits of what is stored (none where colours do not last), and whether this frame's colours are stored. A head with
// bits, of any generation, whose colours do not last leaves without bits (clear_*) before its cluster does.
// Ahead clusters at most are inside; what was requested always has room, so that heads never stand in front of rows for long.
// flush_i: no one takes clusters any more, all go. Registers of a frame stay until idle_o.
// Throughput: a cluster every COLOURS_LAST_LATENCY + 5 cycles. No combinational path from ready to ready.
module flk_colour_heads
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter int unsigned Ahead = 8
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 flush_i,
  output logic                 idle_o,
  input  store_slot_t          first_i,       // of the store's first cluster
  input  logic [31:0]          generation_i,
  input  cluster_t             limit_i,
  input  cluster_t [2:0]       position_i,
  // Clusters
  input  logic                 in_valid_i,
  output logic                 in_ready_o,
  input  boxed_t               in_data_i,
  // Requests for heads, in order
  output logic                 request_valid_o,
  input  logic                 request_ready_i,
  output store_slot_t          request_slot_o,
  // Heads
  input  logic                 head_valid_i,
  output logic                 head_ready_o,
  input  store_head_t          head_i,
  // Heads without bits
  output logic                 clear_valid_o,
  input  logic                 clear_ready_i,
  output store_slot_t          clear_slot_o,
  output store_head_t          clear_o,
  // Clusters, with what is stored
  output logic                 out_valid_o,
  input  logic                 out_ready_i,
  output stored_t              out_data_o
);

  localparam int unsigned COUNT_BITS = $clog2(Ahead + 1);
  localparam int unsigned SlotBits = $bits(store_slot_t);
  localparam int unsigned LowBits = SlotBits / 2;
  localparam int unsigned HighBits = SlotBits - LowBits;
  localparam int unsigned Interval = 16;  // of flk_colours_last
  localparam int unsigned STEP_BITS = $clog2(COLOURS_LAST_LATENCY + 1);

  typedef struct packed {
    store_slot_t    slot;
    cluster_t [2:0] low;
    cluster_t [2:0] high;
    logic [5:0]     slope;
  } placed_t;

  // ---- clusters -------------------------------------------------------------------------------------

  logic [COUNT_BITS-1:0] inside_q;
  logic                  in_move, out_move, box_valid_q, box_move, request_valid_q;
  boxed_t                box_q;
  store_slot_t           request_q, slot;
  logic [LowBits:0]      low_q;  // of the slot, which is added up in two halves
  placed_t               placed;
  logic                  placed_room, placed_valid, placed_take, placed_empty;

  assign in_ready_o = inside_q < COUNT_BITS'(Ahead) && !box_valid_q;
  assign in_move    = in_valid_i && in_ready_o;
  assign box_move   = box_valid_q && (!request_valid_q || request_ready_i);
  assign slot       = {first_i[SlotBits-1:LowBits] + HighBits'(box_q.index[23:LowBits]) +
                       HighBits'(low_q[LowBits]), low_q[LowBits-1:0]};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      inside_q        <= '0;
      box_valid_q     <= 1'b0;
      request_valid_q <= 1'b0;
    end else begin
      inside_q        <= inside_q + COUNT_BITS'(in_move) - COUNT_BITS'(out_move);
      box_valid_q     <= in_move || (box_valid_q && !box_move);
      request_valid_q <= box_move || (request_valid_q && !request_ready_i);
    end
  end

  always_ff @(posedge clk_i) begin
    if (in_move) begin
      box_q <= in_data_i;
      low_q <= {1'b0, first_i[LowBits-1:0]} + {1'b0, in_data_i.index[LowBits-1:0]};
    end
    if (box_move) begin
      request_q <= slot;
    end
  end

  assign request_valid_o = request_valid_q;
  assign request_slot_o  = request_q;

  flk_sram_fifo #(
    .Width($bits(placed_t)),
    .Depth(Ahead)
  ) i_placed (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (box_move),
    .in_ready_o (placed_room),
    .in_data_i  ({slot, box_q.low, box_q.high, box_q.slope}),
    .out_valid_o(placed_valid),
    .out_ready_i(placed_take),
    .out_data_o (placed),
    .empty_o    (placed_empty)
  );

  // ---- a head ---------------------------------------------------------------------------------------

  typedef enum logic [2:0] {WAIT, TEST, DECIDE, CLEAR, GIVE} state_e;

  function automatic cluster_t number(logic [31:0] float);
    return float[30:23] == '0 ? '0 : float;
  endfunction

  state_e               state_d, state_q;
  logic [3:0]           phase_q;     // of the test: 0 with the cluster that has been loaded
  logic [STEP_BITS-1:0] step_q;      // cycles that it has been in it
  logic                 ours_q;      // of the frame's generation
  logic [3:0]           some_q;      // bits, by quarter
  logic                 last, last_q, same_q, lasting, load;
  cluster_t [2:0]       then_q;
  logic [3:0][63:0]     bits_q;

  assign load = state_q == WAIT && head_valid_i && placed_valid;

  always_comb begin
    state_d = state_q;
    unique case (state_q)
      WAIT: begin
        if (load) begin
          state_d = TEST;
        end
      end
      TEST: begin
        if (step_q == STEP_BITS'(COLOURS_LAST_LATENCY)) begin
          state_d = DECIDE;
        end
      end
      DECIDE: state_d = some_q != '0 && !lasting ? CLEAR : GIVE;
      CLEAR: begin
        if (clear_ready_i) begin
          state_d = GIVE;
        end
      end
      default: state_d = WAIT;  // GIVE: there is room
    endcase
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= WAIT;
      phase_q <= '0;
      step_q  <= '0;
    end else begin
      state_q <= state_d;
      phase_q <= load || phase_q == 4'(Interval - 1) ? '0 : phase_q + 1'b1;
      step_q  <= load ? '0 : step_q + 1'b1;
    end
  end

  always_ff @(posedge clk_i) begin
    if (load) begin
      ours_q <= head_i.generation == generation_i;
      bits_q <= head_i.there;
      for (int unsigned k = 0; k < 3; k++) begin
        then_q[k] <= number(head_i.position[k]);
      end
    end
    for (int unsigned k = 0; k < 4; k++) begin
      some_q[k] <= bits_q[k] != '0;
    end
    last_q <= last;
    same_q <= then_q == position_i;
  end

  flk_colours_last i_test (
    .clk_i,
    .en_i        (1'b1),
    .phase_i     (phase_q),
    .low_0_i     (placed.low[0]),
    .low_1_i     (placed.low[1]),
    .low_2_i     (placed.low[2]),
    .high_0_i    (placed.high[0]),
    .high_1_i    (placed.high[1]),
    .high_2_i    (placed.high[2]),
    .then_0_i    (then_q[0]),
    .then_1_i    (then_q[1]),
    .then_2_i    (then_q[2]),
    .slope_i     (placed.slope),
    .position_0_i(position_i[0]),
    .position_1_i(position_i[1]),
    .position_2_i(position_i[2]),
    .limit_i     (limit_i),
    .last_o      (last)
  );

  assign head_ready_o  = load;
  assign placed_take   = state_q == GIVE;
  assign lasting       = ours_q && some_q != '0 && last_q;
  assign clear_valid_o = state_q == CLEAR;
  assign clear_slot_o  = placed.slot;
  assign clear_o       = '{there: '0, generation: generation_i, position: position_i};

  // ---- what is stored -------------------------------------------------------------------------------

  // The test's last cycle is DECIDE's one before: what it says stands until GIVE.
  logic lasting_q, storing_q, out_empty, out_room;

  always_ff @(posedge clk_i) begin
    if (state_q == DECIDE) begin
      lasting_q <= lasting;
      storing_q <= !lasting || same_q;
    end
  end

  stored_t given;
  logic    out_take;

  assign given    = '{slot: placed.slot, storing: storing_q, there: lasting_q ? bits_q : '0};
  assign out_take = out_ready_i || flush_i;
  assign out_move = out_valid_o && out_take;

  flk_sram_fifo #(
    .Width($bits(stored_t)),
    .Depth(Ahead)
  ) i_out (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (state_q == GIVE),
    .in_ready_o (out_room),
    .in_data_i  (given),
    .out_valid_o,
    .out_ready_i(out_take),
    .out_data_o,
    .empty_o    (out_empty)
  );

  assign idle_o = inside_q == '0;

  logic unused;
  assign unused = ^{placed_empty, placed_room, out_empty, out_room};

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) box_move |-> placed_room)
  else $error("flk_colour_heads: a cluster without a place");

  assert property (@(posedge clk_i) disable iff (!rst_ni) state_q == GIVE |-> out_room)
  else $error("flk_colour_heads: a tested cluster without a place");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      inside_q != '0 |-> $stable({first_i, generation_i, limit_i, position_i}))
  else $error("flk_colour_heads: registers changed in a frame");
`endif

endmodule
