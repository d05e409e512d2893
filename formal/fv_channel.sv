// flk_channel with its two VRUs, their arithmetic being free (standin/): tokens in order, 16 pixels
// for each, every splat either issued whole or dropped when all pixels are finished, and the rule
// of finished_o: what is written while it is high is dropped.
//
// Two streams are judged (fv_stream): tokens from the input to their last pixel, and all elements
// through the FIFO. The assertions called l_* tie them to the registers for induction.
module fv_channel
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Depth = 3,
  parameter int unsigned Easy  = 0
) (
  input logic       clk_i,
  input logic       again_i,
  input logic       clear_i,
  input logic       pick_token_i,
  input logic       pick_elem_i,
  input logic       in_valid_i,
  input logic       in_eos_i,
  input logic [1:0] in_data_i,
  input logic       out_ready_i
);

  localparam int unsigned CountBits = $clog2(Depth + 2);
  localparam int unsigned SlotBits = CountBits + 1;

  logic rst_n, in_ready, finished, out_valid, accept, idle;
  feature_elem_t elem;
  channel_pixel_t out_data;
  channel_events_t unused_events;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  // Two bits of payload: in a token the lowest bits of the sub-tile's row and column.
  localparam int unsigned RowBit = SUBTILE_COORD_BITS;

  always_comb begin
    elem                 = '0;
    elem.eos             = in_eos_i;
    elem.feature[RowBit] = in_data_i[1];
    elem.feature[0]      = in_data_i[0];
  end

  flk_channel #(
    .FifoDepth(Depth)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_elem_i  (elem),
    .finished_o (finished),
    .idle_o     (idle),
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o (out_data),
    .events_o   (unused_events)
  );

  assign accept = in_valid_i && in_ready && rst_n;

  // ---- What the pixels say ---------------------------------------------------------------------

  // Pixels that each VRU has given for the oldest token, and all of them.
  logic [1:0][3:0] given_q;
  logic [3:0] pixels_q;
  logic out_vru, last, waited_q;
  logic [3:0] index_q;
  logic [1:0] subtile, subtile_q;

  assign out_vru = out_data.index[3];
  assign last    = pixels_q == 4'd15;
  assign subtile = {out_data.subtile.row[0], out_data.subtile.col[0]};

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      given_q  <= '0;
      pixels_q <= '0;
      waited_q <= 1'b0;
    end else if (clear_i) begin
      given_q  <= '0;
      pixels_q <= '0;
      waited_q <= 1'b0;
    end else begin
      waited_q <= out_valid && !out_ready_i;
      if (out_valid && out_ready_i) begin
        pixels_q         <= pixels_q + 1'b1;
        given_q[out_vru] <= given_q[out_vru] + 1'b1;
        if (last) begin
          given_q <= '0;
        end
      end
    end
  end

  always_ff @(posedge clk_i) begin
    index_q   <= out_data.index;
    subtile_q <= subtile;
  end

  // ---- Streams -------------------------------------------------------------------------------------

  logic token_watching, elem_watching;
  logic [CountBits-1:0] tokens, token_ahead, elems, elem_ahead;
  logic [1:0] token_data;
  logic [2:0] elem_data;

  fv_stream #(
    .Width   (2),
    .Capacity(Depth + 1)
  ) i_tokens (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i     (pick_token_i),
    .push_i     (accept && in_eos_i),
    .in_data_i,
    .out_valid_i(out_valid && last),
    .out_ready_i,
    .out_data_i (subtile),
    .inside_o   (tokens),
    .watching_o (token_watching),
    .ahead_o    (token_ahead),
    .watched_o  (token_data)
  );

  fv_stream #(
    .Width   (3),
    .Capacity(Depth + 1)
  ) i_elems (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i     (pick_elem_i),
    .push_i     (accept),
    .in_data_i  ({in_eos_i, in_data_i}),
    .out_valid_i(dut.head_valid),
    .out_ready_i(dut.pop),
    .out_data_i ({dut.head.eos, dut.head.feature[RowBit], dut.head.feature[0]}),
    .inside_o   (elems),
    .watching_o (elem_watching),
    .ahead_o    (elem_ahead),
    .watched_o  (elem_data)
  );

  // The chosen element was written while finished_o was high.
  logic late_q;
  // Next pixel of the splat at the head.
  logic [2:0] next_q;

  always_ff @(posedge clk_i) begin
    if (!elem_watching) begin
      late_q <= finished && !in_eos_i;
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      next_q <= '0;
    end else if (clear_i) begin
      next_q <= '0;
    end else begin
      next_q <= dut.pop ? '0 : next_q + 3'(dut.issue);
    end
  end

  logic was_finished_q, was_token_q;

  always_ff @(posedge clk_i) begin
    was_finished_q <= rst_n && finished && !clear_i;
    was_token_q    <= accept && in_eos_i;
  end

  // Easy traces, for covers (1) and mutants (2, 3), which a long pipeline makes slow: splats finish their pixels at once, there is no second
  // reset; with 2 and 3 the only token is the second element, too, the output does not wait, and elements come always, or with 3 from the
  // third on when all pixels are finished. What is found so is a trace of the unit.
  logic [1:0] accepted_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      accepted_q <= '0;
    end else if (clear_i) begin
      accepted_q <= '0;
    end else if (accept && accepted_q != '1) begin
      accepted_q <= accepted_q + 1'b1;
    end
  end

  always_comb begin
    if (Easy != 0) begin
      assume (!again_i && !clear_i);
      assume (dut.finish[0] == (dut.blend_valid[0] && !dut.finished[0][dut.blend_pixel[0]]));
      assume (dut.finish[1] == (dut.blend_valid[1] && !dut.finished[1][dut.blend_pixel[1]]));
    end
    if (Easy >= 2) begin
      assume (in_valid_i == (Easy == 2 || accepted_q < 2'd2 || dut.finished == '1));
      assume (in_eos_i == (accepted_q == 2'd1) && in_data_i == '0);
      assume (out_ready_i && !pick_token_i);
    end
  end

  // ---- Registers of the unit: tokens in the FIFO, in the VRUs, at their outputs ---------------------

  function automatic logic [SlotBits-1:0] slot(logic [CountBits-1:0] distance);
    logic [SlotBits-1:0] sum;
    sum = SlotBits'(dut.i_fifo.read_q) + SlotBits'(distance);
    return sum >= SlotBits'(Depth) ? sum - SlotBits'(Depth) : sum;
  endfunction

  logic [63:0] eos, other_eos;  // tokens in the VRUs, youngest stage first
  logic [1:0] busy, full;
  logic [1:0][2:0] index;
  logic outstanding;  // a token has left the FIFO, its pixels have not all left
  logic before_blend;
  logic [CountBits-1:0] queued;  // tokens in the FIFO
  logic early_token;  // one of them at or before the chosen element
  logic [1:0] view;  // data of the chosen token

  assign eos          = 64'({dut.gen_vru[0].i_vru.i_state.eos_q, dut.gen_vru[0].i_vru.eos_q});
  assign other_eos    = 64'({dut.gen_vru[1].i_vru.i_state.eos_q, dut.gen_vru[1].i_vru.eos_q});
  assign busy         = {dut.gen_vru[1].i_vru.i_drain.busy_q, dut.gen_vru[0].i_vru.i_drain.busy_q};
  assign full         = {dut.gen_vru[1].i_vru.i_drain.full_q, dut.gen_vru[0].i_vru.i_drain.full_q};
  assign index        = {dut.gen_vru[1].i_vru.i_drain.out_index_q,
                         dut.gen_vru[0].i_vru.i_drain.out_index_q};
  assign outstanding  = busy != '0;
  assign before_blend = (eos & ((64'd1 << dut.gen_vru[0].i_vru.BLEND) - 64'd1)) != '0;

  feature_elem_t entry;

  always_comb begin
    queued      = '0;
    early_token = 1'b0;
    view        = {dut.subtile_q.row[0], dut.subtile_q.col[0]};
    entry       = '0;
    for (int p = 0; p < Depth; p++) begin
      entry = dut.i_fifo.storage_q[slot(CountBits'(p))];
      if (CountBits'(p) < elems && entry.eos) begin
        if (token_ahead == queued + CountBits'(outstanding)) begin
          view = {entry.feature[RowBit], entry.feature[0]};
        end
        queued      = queued + 1'b1;
        early_token = early_token || CountBits'(p) <= elem_ahead;
      end
    end
  end

  // A VRU's buffer is in use from the token to its last pixel; pixels given so far.
  logic [1:0] vru_ok;

  always_comb begin
    for (int v = 0; v < 2; v++) begin
      vru_ok[v] = busy[v] == (eos != '0 || full[v]) && (full[v] || index[v] == '0)
               && given_q[v] == (busy[v] ? 4'(index[v]) : outstanding ? 4'd8 : 4'd0);
    end
  end

  feature_elem_t kept;

  assign kept = dut.i_fifo.storage_q[slot(elem_ahead)];

  // ---- Properties ------------------------------------------------------------------------------------

  always_comb begin
    if (rst_n) begin
      // Pixels: those of one token together, each VRU's in order, none twice.
      if (out_valid) begin
        a_pixel: assert (given_q[out_vru] < 4'd8
                         && out_data.index[2:0] == given_q[out_vru][2:0]);
        a_owed: assert (tokens != '0);
        if (token_watching && token_ahead == '0) begin
          a_subtile: assert (subtile == token_data);
        end
      end
      if (waited_q) begin
        a_stable: assert (out_valid && out_data.index == index_q && subtile == subtile_q);
      end
      a_complete: assert (5'(given_q[0]) + 5'(given_q[1]) == 5'(pixels_q));
      // Splats: pixels 0 to 7 in turn, or dropped because the mini-tile of this sub-tile is done.
      a_issue: assert (!dut.issue || (dut.pixel_q == next_q && !dut.head.eos));
      a_pop: assert (!dut.pop || dut.drop || dut.issue_eos || (dut.issue && next_q == 3'd7));
      a_drop: assert (!dut.drop || (!before_blend && !dut.head.eos && dut.finished == '1));
      a_token: assert (!dut.issue_eos || (dut.head.eos && busy == '0));
      // No deadlock: the head moves, unless the pixels of the token before are not out yet; those
      // are in the pipeline, which always moves, or at the output.
      a_moves: assert (!dut.head_valid || dut.issue || dut.pop || (dut.head.eos && outstanding));
      a_offered: assert (!outstanding || eos != '0 || out_valid);
      a_idle: assert (idle == (elems == '0 && tokens == '0));
      a_ready: assert (in_ready == (elems < CountBits'(Depth)));
      // finished_o: stays until a token comes; what is written meanwhile is dropped.
      a_finished: assert (!was_finished_q || was_token_q || finished);
      if (elem_watching && late_q && elem_ahead == '0) begin
        a_late: assert (dut.drop);
      end

      // Links for induction.
      l_fifo: assert (SlotBits'(dut.i_fifo.read_q) < SlotBits'(Depth)
                           && SlotBits'(dut.i_fifo.write_q) == slot(elems)
                           && CountBits'(dut.i_fifo.usage_q) == elems);
      l_step: assert (eos == other_eos);
      l_one: assert ((eos & (eos - 1'b1)) == '0 && (eos == '0 || full == '0));
      l_blend: assert (dut.eos_in_vru_q == before_blend);
      l_tokens: assert (CountBits'(dut.tokens_q) == queued + CountBits'(before_blend));
      l_owed: assert (tokens == queued + CountBits'(outstanding));
      l_next: assert (dut.pixel_q == next_q && (dut.head_valid || next_q == '0)
                           && (next_q == '0 || !dut.head.eos));
      l_vrus: assert (vru_ok == '1);
      l_pick: assert (!waited_q || dut.gen_several.i_arbiter.first_q == index_q[3]);
      if (token_watching) begin
        l_view: assert (view == token_data);
      end
      if (elem_watching) begin
        l_kept: assert ({kept.eos, kept.feature[RowBit], kept.feature[0]} == elem_data);
        if (late_q) begin
          l_late: assert (!early_token && !before_blend && dut.finished == '1);
        end
      end

      c_full: cover (!in_ready);
      c_next: cover (dut.issue && outstanding && before_blend);
      c_late: cover (dut.drop && elem_watching && late_q && elem_ahead == '0);
      c_complete: cover (out_valid && out_ready_i && last && subtile == 2'b10);
    end
  end

endmodule
