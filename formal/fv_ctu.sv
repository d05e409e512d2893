// flk_ctu: every accepted splat leaves exactly once, in order, with the mask of its sampling mode,
// or is taken out because that mask is empty; tokens keep their place. For every mode, any answers
// of the test (standin/flk_prtu.sv), any stall and any back-pressure.
//
// The mask is specified pixel by pixel: mini-tile m may contribute if one of its leaders passes,
// dense: its four corners, sparse: top left and bottom right. In automatic mode the controller's
// running sums are free (cut by the proof's script); the fall flag is read from it.
// fv_stream judges the elements as they leave the internal FIFOs, mask beside element; a_shown
// says that exactly those with a mask are shown at the output. For induction the assertions called
// l_* count masks, those stored and those still in the test pipeline, by the position of
// their element.
module fv_ctu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Depth = 12
) (
  input logic        clk_i,
  input logic        again_i,
  input logic        pick_i,
  input logic [ 2:0] mode_i,
  input logic        stall_i,
  input logic        in_valid_i,
  input logic        eos_i,
  input logic        spiky_i,
  input logic [15:0] test_i,  // what the test says of each leader
  input logic        mark_i,  // one bit of payload
  input logic        out_ready_i
);

  localparam int unsigned CountBits = $clog2(Depth + 1);
  localparam int unsigned SlotBits = CountBits + 1;  // sum of two slot numbers
  localparam int unsigned Last = PRTU_LATENCY - 1;
  localparam int unsigned DataBits = 4 + 1 + 1 + 16;

  logic rst_n, in_ready, out_valid, accept;
  logic [2:0] mode_q;
  splat_elem_t elem, elem_q;
  feature_elem_t out_elem;
  logic [3:0] out_mask;
  ctu_events_t events;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  always_comb begin
    elem                      = '0;
    elem.eos                  = eos_i;
    elem.splat.spiky          = spiky_i;
    elem.splat.feature.shape0 = test_i;
    elem.splat.feature.mean_x = {15'd0, mark_i};
  end

  flk_ctu #(
    .CtuFifoDepth(Depth)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .mode_i     (mode_q),
    .stall_i,
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_elem_i  (elem),
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_elem_o (out_elem),
    .out_mask_o (out_mask),
    .events_o   (events)
  );

  assign accept = in_valid_i && in_ready;

  // ---- Environment: mode constant, input keeps the stream contract -----------------------------

  logic in_waited_q;

  always_ff @(posedge clk_i) begin
    mode_q      <= mode_q;
    elem_q      <= elem;
    in_waited_q <= rst_n && in_valid_i && !in_ready;
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

  always_comb begin
    dense = mode_q == CAT_DENSE;
    if (mode_q == CAT_SMOOTH || (mode_q == CAT_AUTO && !dut.i_controller.fall_q)) begin
      dense = !spiky_i;
    end
    if (mode_q == CAT_SPIKY) begin
      dense = spiky_i;
    end
    mask = mask_of(test_i, dense);
    if (eos_i || mode_q == CAT_OFF) begin
      mask = 4'b1111;
    end
  end

  logic [DataBits-1:0] in_data, out_data, watched;
  logic [CountBits-1:0] entries, ahead;
  logic watching;

  assign in_data  = {mask, eos_i, mark_i, test_i};
  assign out_data = {out_mask, out_elem.eos, out_elem.feature.mean_x[0], out_elem.feature.shape0};

  fv_stream #(
    .Width   (DataBits),
    .Capacity(Depth)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .pick_i,
    .push_i     (accept),
    .in_data_i  (in_data),
    .out_valid_i(dut.mask_valid),
    .out_ready_i(dut.pop),
    .out_data_i (out_data),
    .inside_o   (entries),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  // ---- Masks in the order of their elements: stored, then in the pipeline, oldest stage first ----

  function automatic logic [SlotBits-1:0] slot(logic [CountBits-1:0] distance);
    logic [SlotBits-1:0] sum;
    sum = SlotBits'(dut.i_elem_fifo.read_q) + SlotBits'(distance);
    return sum >= SlotBits'(Depth) ? sum - SlotBits'(Depth) : sum;
  endfunction

  // The MMU has seen the first batch of a dense splat only.
  logic half_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      half_q <= 1'b0;
    end else if (dut.tag_valid_q[Last]) begin
      half_q <= dut.tag_q[Last].dense && !dut.tag_q[Last].batch;
    end
  end

  // Elements whose mask is stored or in the pipeline: none may be counted twice, so no wrap.
  localparam int unsigned KnownBits = CountBits + 3;
  logic [KnownBits-1:0] known;
  logic [CountBits-1:0] elems, masks;
  logic [3:0] view;  // mask of the chosen element, when it is known
  logic [1:0] first;  // what the MMU keeps once the pipeline is empty
  logic half;  // a dense splat lacks its second batch
  logic [PRTU_LATENCY-1:0] token;
  logic [2:0] oldest;  // stage of the oldest result
  logic order;

  assign elems = dut.i_elem_fifo.usage_q;
  assign masks = dut.i_mask_fifo.usage_q;

  always_comb begin
    view   = dut.i_mask_fifo.storage_q[slot(ahead)];
    known  = KnownBits'(masks);
    half   = half_q;
    order  = 1'b1;
    oldest = '0;
    first  = dut.i_mmu.first_q;
    token  = '0;
    for (int s = Last; s >= 0; s--) begin
      if (dut.tag_valid_q[s]) begin
        token[s] = dut.tag_q[s].eos;
        // The batches of a dense splat follow each other; a token is a single one.
        order = order && (dut.tag_q[s].dense && dut.tag_q[s].batch) == half
                      && (!dut.tag_q[s].eos || (dut.tag_q[s].all && !dut.tag_q[s].dense));
        if (dut.tag_q[s].dense && !dut.tag_q[s].batch) begin
          half  = 1'b1;
          first = {|dut.i_prtu_b.pass_q[s], |dut.i_prtu_a.pass_q[s]};
        end else begin
          half = 1'b0;
          if (known == KnownBits'(ahead)) begin
            view = dut.i_prtu_a.pass_q[s] | dut.i_prtu_b.pass_q[s];
            if (dut.tag_q[s].dense) begin
              view = {|dut.i_prtu_b.pass_q[s], |dut.i_prtu_a.pass_q[s], first};
            end
            if (dut.tag_q[s].all) begin
              view = 4'b1111;
            end
          end
          if (known == KnownBits'(masks)) begin
            oldest = 3'(s);
          end
          known = known + 1'b1;
        end
      end
    end
  end

  logic [2:0] wait_q;

  // Cycles for which elements have been there, but no mask.
  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      wait_q <= '0;
    end else begin
      wait_q <= (elems == '0 || masks != '0) ? '0 : wait_q + 1'b1;
    end
  end

  // ---- Properties -------------------------------------------------------------------------------------

  always_comb begin
    if (rst_n) begin
      // Nothing is overwritten: whatever comes has its place.
      a_space: assert (!accept || elems < CountBits'(Depth));
      a_mask_space: assert (!dut.result_valid || masks < CountBits'(Depth));
      a_together: assert (masks <= elems && (!dut.pop || masks != '0));
      // No deadlock: taken when nothing stands against it, and out again within the latency.
      a_taken: assert (!in_valid_i || stall_i || elems == CountBits'(Depth) || events.busy
                       || (eos_i && token != '0));
      a_accepted: assert (!events.busy || in_ready || (dense && !dut.i_controller.batch_q));
      a_stall: assert (!stall_i || !events.busy);
      a_latency: assert (elems == '0 || masks != '0 || wait_q < 3'(PRTU_LATENCY));
      a_leaves: assert (masks == '0 || !out_ready_i || dut.pop);
      // Shown at the output if it has a mask, else taken out at once.
      a_shown: assert (out_valid == (dut.mask_valid && out_mask != '0));
      a_rejected: assert (!dut.mask_valid || dut.pop == (out_ready_i || out_mask == '0));
      // One token in the test at a time.
      a_token: assert ((token & (token - 1'b1)) == '0 && (!events.token || token == '0));
      // Counters.
      a_events: assert (events.splat == (accept && !eos_i) && events.token == (accept && eos_i)
                        && events.stalled == (in_valid_i && !events.busy)
                        && events.idle == !in_valid_i);

      // Links for induction.
      l_pointers: assert (dut.i_elem_fifo.read_q == dut.i_mask_fifo.read_q
                        && SlotBits'(dut.i_elem_fifo.read_q) < SlotBits'(Depth)
                        && elems <= CountBits'(Depth)
                        && SlotBits'(dut.i_elem_fifo.write_q) == slot(elems)
                        && SlotBits'(dut.i_mask_fifo.write_q) == slot(masks));
      l_known: assert (known == KnownBits'(elems));
      l_order: assert (order);
      l_batch: assert (half == dut.i_controller.batch_q);
      l_token: assert (dut.i_controller.eos_pending_q == (token != '0));
      l_oldest: assert (elems == '0 || masks != '0 || wait_q <= oldest);
      l_count: assert (elems == entries);
      if (watching) begin
        l_mask: assert (view == watched[DataBits-1-:4]);
        l_elem: assert ({
              dut.i_elem_fifo.storage_q[slot(ahead)][FEATURE_ELEM_BITS-1],
              dut.i_elem_fifo.storage_q[slot(ahead)][0],
              dut.i_elem_fifo.storage_q[slot(ahead)][47:32]
            } == watched[DataBits-5:0]);
      end
      if (half) begin
        l_half: assert (in_valid_i && dense && !eos_i && in_waited_q
                             && first == mask_of(test_i, 1'b1)[1:0]);
      end

      c_full: cover (elems == CountBits'(Depth) && out_valid);
      c_rejected: cover (dut.pop && !out_valid && masks > CountBits'(1));
      c_dense: cover (out_valid && out_ready_i && out_mask == 4'b1010
                      && mode_q == CAT_SPIKY && !out_elem.eos);
      c_sparse: cover (out_valid && out_ready_i && out_mask == 4'b0110 && mode_q == CAT_SPARSE);
      c_fallen: cover (out_valid && out_ready_i && mode_q == CAT_AUTO && dut.i_controller.fall_q);
      c_stalled: cover (half && stall_i);
      c_second_token: cover (out_valid && out_elem.eos && in_valid_i && eos_i && token != '0);
    end
  end

endmodule
