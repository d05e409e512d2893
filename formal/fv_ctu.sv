// flk_ctu: every accepted element whose mask is not empty leaves exactly once, in order, with the mask of its sampling mode; the others
// are taken out and counted; tokens keep their place. For every mode, any answers of the test (standin/flk_prtu.sv), any stall and any
// back-pressure.
//
// The mask is specified pixel by pixel: mini-tile m may contribute if one of its leaders passes, dense: its four corners, sparse: top left
// and bottom right. In automatic mode the controller's running sums are free (cut by the proof's script); the fall flag is read from it.
// For induction the assertions l_* count what the output FIFO and the pipeline hold, oldest first, and compute its masks.
module fv_ctu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Depth     = 0,  // of the output FIFO
  parameter int unsigned Precision = PRECISION_MIXED
) (
  input logic        clk_i,
  input logic        again_i,
  input logic        clear_i,
  input logic        pick_i,
  input logic [ 2:0] mode_i,
  input logic        stall_i,
  input logic        in_valid_i,
  input logic        eos_i,
  input logic        spiky_i,
  input logic [15:0] table_i,  // what the test says of each leader,
  input logic        odd_i,    // inverted
  input logic        mark_i,   // one bit of payload
  input logic        out_ready_i
);

  localparam int unsigned Latency = 32'(PRTU_LATENCY[FORM_FACTORED][Precision]);
  localparam int unsigned Delay = 32'(PRTU_SHAPE_DELAY[Precision]);
  localparam int unsigned Last = Latency - 1;
  localparam int unsigned Capacity = Depth == 0 ? Latency : Depth;
  localparam int unsigned CountBits = $clog2(Capacity + 1);
  localparam int unsigned SlotBits = CountBits + 1;  // sum of two slot numbers
  localparam int unsigned DataBits = 4 + 1 + 1 + 1 + 16;

  logic rst_n, in_ready, out_valid, accept, room, idle;
  logic [2:0] mode_q;
  splat_elem_t elem, elem_q;
  feature_elem_t out_elem;
  logic [3:0] out_mask;
  generator_events_t events;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  always_comb begin
    elem                       = '0;
    elem.eos                   = eos_i;
    elem.splat.spiky           = spiky_i;
    elem.splat.feature.shape0  = {8'd0, table_i[7:0]};
    elem.splat.feature.shape1  = {8'd0, table_i[15:8]};
    elem.splat.feature.opacity = {15'd0, odd_i};
    elem.splat.feature.mean_x  = {15'd0, mark_i};
  end

  flk_ctu #(
    .Precision   (Precision),
    .CtuFifoDepth(Depth)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .mode_i     (mode_q),
    .stall_i,
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_elem_i  (elem),
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o ({out_mask, out_elem}),
    .idle_o     (idle),
    .events_o   (events)
  );

  assign accept = in_valid_i && in_ready && rst_n;

  // ---- Environment: mode constant, input keeps the stream contract -----------------------------

  logic in_waited_q;

  always_ff @(posedge clk_i) begin
    mode_q      <= mode_q;
    elem_q      <= elem;
    in_waited_q <= rst_n && in_valid_i && !in_ready && !clear_i;
  end

  always_comb begin
    assume (mode_i == mode_q && mode_q <= CAT_AUTO);
    if (rst_n && in_waited_q) begin
      assume (in_valid_i && elem == elem_q);
    end
  end

  // ---- Specification of the mask -----------------------------------------------------------------

  function automatic logic [3:0] mask_of(logic [15:0] test, logic dense);
    logic [3:0] mask;
    for (int m = 0; m < 4; m++) begin
      // The bits of a leader's number: lower row, lower corner, right column, right corner.
      logic [1:0] row, col;
      row     = 2'(m / 2);
      col     = 2'(m % 2);
      mask[m] = test[{row[0], 1'b0, col[0], 1'b0}] || test[{row[0], 1'b1, col[0], 1'b1}];
      if (dense) begin
        mask[m] = mask[m] || test[{row[0], 1'b0, col[0], 1'b1}]
                          || test[{row[0], 1'b1, col[0], 1'b0}];
      end
    end
    return mask;
  endfunction

  logic dense;
  logic [3:0] mask;
  logic [15:0] test;

  assign test = table_i ^ {16{odd_i}};

  always_comb begin
    dense = mode_q == CAT_DENSE;
    if (mode_q == CAT_SMOOTH || (mode_q == CAT_AUTO && !dut.i_controller.fall_q)) begin
      dense = !spiky_i;
    end
    if (mode_q == CAT_SPIKY) begin
      dense = spiky_i;
    end
    mask = mask_of(test, dense);
    if (eos_i || mode_q == CAT_OFF) begin
      mask = 4'b1111;
    end
  end

  // ---- What must leave ---------------------------------------------------------------------------

  logic [DataBits-1:0] in_data, out_data, watched;
  logic [CountBits-1:0] entries, ahead;
  logic watching;

  function automatic logic [DataBits-1:0] data_of(logic [3:0] bits, feature_elem_t e);
    return {bits, e.eos, e.feature.mean_x[0], e.feature.opacity[0], e.feature.shape1[7:0],
            e.feature.shape0[7:0]};
  endfunction

  assign in_data  = {mask, eos_i, mark_i, odd_i, table_i};
  assign out_data = data_of(out_mask, out_elem);

  fv_stream #(
    .Width   (DataBits),
    .Capacity(Capacity)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (accept && mask != '0),
    .in_data_i  (in_data),
    .out_valid_i(out_valid),
    .out_ready_i,
    .out_data_i (out_data),
    .inside_o   (entries),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  // Accepted with an empty mask, not yet counted as rejected.
  logic [3:0] empty_q;
  logic [Last:0] token;  // stages of the test that hold one
  // A token was in the test in the last cycle.
  logic token_q;
  // Cycles without anything at the output although something must come.
  logic [4:0] wait_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      token_q <= 1'b0;
      empty_q <= '0;
      wait_q  <= '0;
    end else if (clear_i) begin
      token_q <= 1'b0;
      empty_q <= '0;
      wait_q  <= '0;
    end else begin
      token_q <= token != '0;
      empty_q <= empty_q + 4'(accept && mask == '0) - 4'(events.rejected);
      wait_q  <= (entries == '0 || out_valid) ? '0 : wait_q + 1'b1;
    end
  end

  // ---- What the unit holds: output FIFO, then pipeline, oldest stage first -----------------------

  logic [CountBits-1:0] stored;
  logic [DataBits-1:0] stored_view;  // of the chosen element, if it is in the FIFO
  logic taken_ok;
  logic [4:0] finals;  // elements in the pipeline, counted with their last batch

  if (Depth == 0) begin : gen_none
    assign stored      = '0;
    assign stored_view = '0;
    assign taken_ok    = 1'b1;
    assign room        = !out_valid || out_ready_i;
  end else begin : gen_stored
    logic [SlotBits-1:0] sum, slot, last;
    logic [4+FEATURE_ELEM_BITS-1:0] word;
    assign stored      = dut.gen_fifo.i_fifo.usage_q;
    assign sum         = SlotBits'(dut.gen_fifo.i_fifo.read_q) + SlotBits'(ahead);
    assign slot        = sum >= SlotBits'(Depth) ? sum - SlotBits'(Depth) : sum;
    assign last        = SlotBits'(dut.gen_fifo.i_fifo.read_q) + SlotBits'(stored);
    assign word        = dut.gen_fifo.i_fifo.storage_q[slot];
    assign stored_view = data_of(word[FEATURE_ELEM_BITS+:4],
                                 feature_elem_t'(word[FEATURE_ELEM_BITS-1:0]));
    assign taken_ok    = SlotBits'(dut.gen_fifo.i_fifo.read_q) < SlotBits'(Depth)
                      && SlotBits'(dut.gen_fifo.i_fifo.write_q)
                         == (last >= SlotBits'(Depth) ? last - SlotBits'(Depth) : last)
                      && 6'(dut.gen_fifo.taken_q) == 6'(stored) + 6'(finals)
                      && dut.gen_fifo.taken_q <= CountBits'(Depth);
    assign room        = 6'(stored) + 6'(finals) < 6'(Depth);
  end

  // The leaders of a batch: {columns, rows} of a rectangle, right before left, bottom before top.
  function automatic logic [11:0] leaders(logic is_dense, logic batch, logic b);
    logic [2:0] left, top;
    if (!is_dense) begin
      return b ? {3'd7, 3'd3, 3'd7, 3'd3} : {3'd4, 3'd0, 3'd4, 3'd0};
    end
    left = b ? 3'd4 : 3'd0;
    top  = batch ? 3'd4 : 3'd0;
    return {left + 3'd3, left, top + 3'd3, top};
  endfunction

  function automatic logic [3:0] answers(logic [15:0] tab, logic [11:0] where);
    logic [3:0] pass;
    for (int i = 0; i < 4; i++) begin
      logic [2:0] x, y;
      x       = (i % 2) != 0 ? where[11:9] : where[8:6];
      y       = (i / 2) != 0 ? where[5:3] : where[2:0];
      pass[i] = tab[{y[2], y[0], x[2], x[0]}];
    end
    return pass;
  endfunction

  // The MMU has seen the first batch of a dense splat only.
  logic half_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      half_q <= 1'b0;
    end else if (clear_i) begin
      half_q <= 1'b0;
    end else if (dut.tag_valid_q[Last] && dut.advance) begin
      half_q <= dut.tag_q[Last].dense && !dut.tag_q[Last].batch;
    end
  end

  logic [Last:0] valid, final_batch, rect_ok;
  logic [Last:0][15:0] tests;  // of the element in each stage
  logic [Last:0][3:0] masks;

  for (genvar s = 0; s < Latency; s++) begin : gen_stage
    logic [15:0] tab;
    logic [11:0] a, b;
    logic odd;
    assign tab            = {dut.feature_q[s].shape1[7:0], dut.feature_q[s].shape0[7:0]};
    assign odd            = dut.feature_q[s].opacity[0];
    assign tests[s]       = tab ^ {16{odd}};
    assign valid[s]       = dut.tag_valid_q[s];
    assign token[s]       = valid[s] && dut.tag_q[s].eos;
    assign final_batch[s] = valid[s] && (!dut.tag_q[s].dense || dut.tag_q[s].batch);
    assign masks[s]       = dut.tag_q[s].all ? 4'b1111 : mask_of(tests[s], dut.tag_q[s].dense);
    assign a              = leaders(dut.tag_q[s].dense, dut.tag_q[s].batch, 1'b0);
    assign b              = leaders(dut.tag_q[s].dense, dut.tag_q[s].batch, 1'b1);
    // What the rest of the test holds in this stage is of the same element.
    if (s < Delay) begin : gen_coordinates
      assign rect_ok[s] = {dut.i_prtu_a.x_q[s], dut.i_prtu_a.y_q[s]} == a
                       && {dut.i_prtu_b.x_q[s], dut.i_prtu_b.y_q[s]} == b
                       && (s != Delay - 1
                           || {dut.shape_q[1][7:0], dut.shape_q[0][7:0]} == tab);
    end else if (s < Last) begin : gen_answers
      logic threshold_ok;
      if (s > Last - 1 - LOG_STAGES) begin : gen_threshold
        assign threshold_ok = dut.i_log.odd_q[s-Last+LOG_STAGES] == odd;
      end else begin : gen_early
        assign threshold_ok = 1'b1;
      end
      assign rect_ok[s] = dut.i_prtu_a.pass_q[s-Delay] == answers(tab, a)
                       && dut.i_prtu_b.pass_q[s-Delay] == answers(tab, b) && threshold_ok;
    end else begin : gen_result
      assign rect_ok[s] = dut.i_prtu_a.pass_o == answers(tests[s], a)
                       && dut.i_prtu_b.pass_o == answers(tests[s], b);
    end
  end

  logic [5:0] shown;  // elements to be shown, up to the stage
  logic [3:0] empty;
  logic [DataBits-1:0] view;
  logic half, order;
  logic [1:0] first;  // mini-tiles 0 and 1 of the dense splat in progress
  logic [4:0] oldest;  // steps to the output of the oldest one

  always_comb begin
    shown  = 6'(stored);
    empty  = '0;
    finals = '0;
    view   = stored_view;
    half   = half_q;
    first  = dut.i_mmu.first_q;
    order  = 1'b1;
    oldest = '0;
    for (int s = Last; s >= 0; s--) begin
      if (valid[s]) begin
        // The batches of a dense splat follow each other; a token is a single one.
        order = order && (dut.tag_q[s].dense && dut.tag_q[s].batch) == half
                      && (!dut.tag_q[s].eos || (dut.tag_q[s].all && !dut.tag_q[s].dense))
                      && (!half || (first == mask_of(tests[s], 1'b1)[1:0] && !dut.tag_q[s].all));
        half = !final_batch[s];
        if (half) begin
          first = mask_of(tests[s], 1'b1)[1:0];
        end else begin
          finals = finals + 1'b1;
          if (masks[s] == '0) begin
            empty = empty + 1'b1;
          end else begin
            if (shown == '0) begin
              oldest = 5'(Last - s);
            end
            if (shown == 6'(ahead)) begin
              view = data_of(masks[s], '{eos: dut.tag_q[s].eos, feature: dut.feature_q[s]});
            end
            shown = shown + 1'b1;
          end
        end
      end
    end
  end

  // ---- Properties -------------------------------------------------------------------------------------

  // Steps from acceptance to the output.
  localparam int unsigned Steps = Depth == 0 ? Latency : Latency + 1;

  always_comb begin
    if (rst_n) begin
      // No deadlock: taken when nothing stands against it, and out again within the latency.
      a_taken: assert (!in_valid_i || stall_i || !room || events.busy 
                       || (eos_i && (token != '0 || token_q)));
      a_accepted: assert (!events.busy || in_ready || (dense && !dut.i_controller.batch_q));
      a_stall: assert (!stall_i || !events.busy);
      a_latency: assert (wait_q < 5'(Steps));
      // Only what has a mask is shown; the chosen element stands for all.
      a_shown: assert (!out_valid || !watching || ahead != '0 || out_mask != '0);
      // Each element with an empty mask is rejected once.
      a_rejected: assert (!events.rejected || empty_q != '0);
      a_counted: assert (empty_q <= 4'(Latency));
      // Idle when nothing is inside.
      a_idle: assert (!idle || (entries == '0 && empty_q == '0 && token == '0));
      // One token in the test at a time.
      a_token: assert ((token & (token - 1'b1)) == '0 && (!events.token || token == '0));
      // Counters.
      a_events: assert (events.splat == (accept && !eos_i) && events.token == (accept && eos_i)
                        && events.stalled == (in_valid_i && !events.busy)
                        && events.idle == !in_valid_i);

      l_order: assert (order);
      l_rect: assert ((valid & ~rect_ok) == '0);
      l_count: assert (shown == 6'(entries));
      l_empty: assert (empty == empty_q);
      l_batch: assert (half == dut.i_controller.batch_q);
      l_token: assert (dut.i_controller.eos_pending_q
                       == (token != '0 || dut.i_controller.update_q));
      l_update: assert (!dut.i_controller.update_q || (token_q && token == '0));
      l_wait: assert (wait_q == '0 || stored != '0 || wait_q + oldest < 5'(Latency));
      l_taken: assert (taken_ok);
      if (watching) begin
        l_view: assert (view == watched && watched[DataBits-1-:4] != '0);
      end
      if (half) begin
        l_half: assert (in_valid_i && dense && !eos_i && in_waited_q
                        && first == mask_of(test, 1'b1)[1:0]);
      end

      c_full: cover (!room && in_valid_i && valid[Last]);
      c_rejected: cover (events.rejected && entries > CountBits'(1));
      c_dense: cover (out_valid && out_ready_i && out_mask == 4'b1010
                      && mode_q == CAT_SPIKY && !out_elem.eos);
      c_sparse: cover (out_valid && out_ready_i && out_mask == 4'b0110 && mode_q == CAT_SPARSE);
      c_fallen: cover (out_valid && out_ready_i && mode_q == CAT_AUTO && dut.i_controller.fall_q);
      c_stalled: cover (half && stall_i);
      c_second_token: cover (out_valid && out_elem.eos && in_valid_i && eos_i && token != '0);
    end
  end

endmodule
