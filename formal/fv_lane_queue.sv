// flk_lane_queue: for an entry chosen freely when it is pushed, every pixel of it is visited exactly once, unless the lane reports it finished, before the
// entry leaves and after all earlier ones have left; an end is visited once, when the bank is free; nothing is visited that was not pushed.
//
// The lane is free but for its tokens: one at a time, from the visit to token_done_i, and the bank is taken meanwhile. Flags may come and go at any
// time. The assertions called l_* tie registers to the specification for induction.
module fv_lane_queue #(
  parameter  int unsigned Pixels = 4,
  parameter  int unsigned Slots  = 4,
  parameter  int unsigned Depth  = 2,
  localparam int unsigned PixelW = $clog2(Pixels),
  localparam int unsigned SlotW  = $clog2(Slots),
  localparam int unsigned CountBits = $clog2(Depth + 2)
) (
  input logic              clk_i,
  input logic              again_i,
  input logic              clear_i,
  input logic              pick_i,
  input logic              push_i,
  input logic [SlotW-1:0]  slot_i,
  input logic [Pixels-1:0] pixels_i,
  input logic [Pixels-1:0] finished_i,
  input logic              token_done_i,
  input logic              bank_free_i
);

  logic rst_n, ready, empty, valid, eos, last, starved, waits;
  logic [Pixels-1:0] alive;
  logic [PixelW-1:0] pixel;
  logic [SlotW-1:0] slot;
  logic token_q;  // of the lane: between its visit and token_done_i

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_lane_queue #(
    .Pixels(Pixels),
    .Slots (Slots),
    .Depth (Depth)
  ) dut (
    .clk_i,
    .rst_ni       (rst_n),
    .clear_i,
    .push_i,
    .ready_o      (ready),
    .push_slot_i  (slot_i),
    .push_subtile_i('0),
    .push_pixels_i(pixels_i),
    .alive_o      (alive),
    .empty_o      (empty),
    .finished_i,
    .token_i      (token_q),
    .token_done_i,
    .bank_free_i,
    .visit_valid_o(valid),
    .visit_eos_o  (eos),
    .visit_last_o (last),
    .visit_pixel_o(pixel),
    .visit_slot_o (slot),
    .starved_o    (starved),
    .waits_o      (waits)
  );

  // ---- Environment and specification -------------------------------------------------------------------------

  logic push, watching_q, at_head;
  logic [CountBits-1:0] inside_q, ahead_q, ends_q;  // entries; those before the chosen one; ends that have not come to the lane's state
  logic [SlotW-1:0] slot_q;
  logic [Pixels-1:0] pixels_q, visited_q, left, known;

  assign push    = push_i && ready;
  assign at_head = watching_q && ahead_q == '0;
  assign known   = token_q ? '0 : finished_i;
  assign left    = pixels_q & ~visited_q & ~known;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      token_q    <= 1'b0;
      watching_q <= 1'b0;
      inside_q   <= '0;
      ends_q     <= '0;
    end else if (clear_i) begin
      token_q    <= 1'b0;
      watching_q <= 1'b0;
      inside_q   <= '0;
      ends_q     <= '0;
    end else begin
      token_q    <= (token_q && !token_done_i) || (valid && eos);
      inside_q   <= inside_q + CountBits'(push) - CountBits'(last);
      ends_q     <= ends_q + CountBits'(push && pixels_i == '0) - CountBits'(token_done_i);
      watching_q <= watching_q ? !(last && at_head) : push && pick_i;
    end
  end

  always_ff @(posedge clk_i) begin
    if (!watching_q) begin
      ahead_q   <= inside_q - CountBits'(last);
      slot_q    <= slot_i;
      pixels_q  <= pixels_i;
      visited_q <= '0;
    end else begin
      ahead_q <= ahead_q - CountBits'(last && !at_head);
      if (at_head && valid && !eos) begin
        visited_q[pixel] <= 1'b1;
      end
    end
  end

  // ---- Registers of the unit ---------------------------------------------------------------------------------

  localparam int unsigned PlaceBits = CountBits + 1;

  function automatic logic [PlaceBits-1:0] place(logic [CountBits-1:0] distance);
    logic [PlaceBits-1:0] sum;
    sum = PlaceBits'(dut.i_fifo.read_q) + PlaceBits'(distance);
    return sum >= PlaceBits'(Depth) ? sum - PlaceBits'(Depth) : sum;
  endfunction

  logic [CountBits-1:0] queued;  // ends in the queue
  logic [SlotW+Pixels-1:0] entry;

  always_comb begin
    queued = '0;
    entry  = '0;
    for (int unsigned k = 0; k < Depth; k++) begin
      entry = dut.i_fifo.storage_q[place(CountBits'(k))];
      if (CountBits'(k) < inside_q && entry[Pixels-1:0] == '0) begin
        queued = queued + 1'b1;
      end
    end
  end

  // ---- Properties --------------------------------------------------------------------------------------------

  always_comb begin
    if (rst_n) begin
      assume (!token_done_i || token_q);
      assume (!bank_free_i || !token_q);

      a_ready: assert (ready == (inside_q < CountBits'(Depth)));
      a_pushed: assert (!(valid || last || waits) || inside_q != '0);
      a_starved: assert (starved == (inside_q == '0));
      a_moves: assert (inside_q == '0 || valid || last || waits);
      a_bank: assert (!(waits || (valid && eos)) || bank_free_i == (valid && eos));
      a_alive: assert (alive == (ends_q == '0 ? ~finished_i : '1));
      a_empty: assert (empty == (inside_q == '0 && ends_q == '0));
      if (at_head) begin
        if (valid || last) begin
          a_slot: assert (slot == slot_q);
        end
        if (pixels_q == '0) begin
          a_end: assert (valid == bank_free_i && eos == valid && last == valid && waits == !valid);
        end else begin
          // A pixel that is left, in every cycle in which there is one; the entry leaves with the last.
          a_visit: assert (!waits && valid == (left != '0) && (!valid || !eos));
          if (valid) begin
            a_pixel: assert (left[pixel]);
            a_last: assert (last == (left == Pixels'(1) << pixel));
          end else begin
            a_nothing: assert (last);
          end
        end
      end

      // Links for induction.
      l_fifo: assert (PlaceBits'(dut.i_fifo.read_q) < PlaceBits'(Depth) && PlaceBits'(dut.i_fifo.write_q) == place(inside_q)
                      && CountBits'(dut.i_fifo.usage_q) == inside_q);
      l_tokens: assert (CountBits'(dut.tokens_q) == ends_q && ends_q == queued + CountBits'(token_q));
      l_done: assert (inside_q != '0 || dut.done_q == '0);
      if (watching_q) begin
        l_ahead: assert (ahead_q < inside_q);
        l_kept: assert (dut.i_fifo.storage_q[place(ahead_q)] == {slot_q, pixels_q});
        l_visited: assert (visited_q == (at_head ? dut.done_q : '0));
      end

      c_all: cover (at_head && visited_q == Pixels'(7) && valid && last);
      c_finished: cover (at_head && visited_q == Pixels'(1) && pixels_q == '1 && !valid && last);
      c_next: cover (at_head && token_q && finished_i == '1 && valid);
      c_ends: cover (!ready && ends_q == CountBits'(Depth + 1));
    end
  end

endmodule
