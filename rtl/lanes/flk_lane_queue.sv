// Queue of a lane: which pixels of which splats it has yet to visit, in the order of the list.
//
// in  push_i: a slot of the core's store and the lane's pixels in the splat's mask, at least one, and which of the core's Subtiles sub-tiles it is
//     for; no pixel: the end of the list, of all of them.
// out a visit in every cycle while there is something to do (flk_lane): the lowest pixel of the oldest entry. Pixels that have finished are left
//     out as far as it is known; an entry of which nothing is left takes a cycle without a visit. The end of a list waits for the lane's bank.
// alive_o: pixels that are worth an entry: those of the list that is pushed now that are not known to be finished.
// Pixel numbers, finished_i and alive_o: sub-tile, then the lane's Pixels of it.
// Latency 1. All outputs depend on registers and on finished_i, token_i and bank_free_i alone, which come from the lane's registers.
// clear_i forgets everything.
module flk_lane_queue #(
  parameter  int unsigned Pixels   = 8,   // of each sub-tile
  parameter  int unsigned Slots    = 20,
  parameter  int unsigned Depth    = 16,
  parameter  int unsigned Subtiles = 1,   // of the core: 1, 2 or 4
  localparam int unsigned PixelW   = $clog2(Subtiles * Pixels),
  localparam int unsigned SlotW    = $clog2(Slots),
  localparam int unsigned SubtileW = (Subtiles > 1) ? $clog2(Subtiles) : 1
) (
  input  logic                            clk_i,
  input  logic                            rst_ni,
  input  logic                            clear_i,
  // entries
  input  logic                            push_i,
  output logic                            ready_o,
  input  logic [SlotW-1:0]                push_slot_i,
  input  logic [SubtileW-1:0]             push_subtile_i,  // 0 where there is one
  input  logic [Pixels-1:0]               push_pixels_i,
  output logic [Subtiles-1:0][Pixels-1:0] alive_o,
  output logic                            empty_o,         // no entry, no token on its way
  // the lane
  input  logic [Subtiles-1:0][Pixels-1:0] finished_i,
  input  logic                            token_i,         // one is on its way to the state
  input  logic                            token_done_i,    // it has come there
  input  logic                            bank_free_i,
  output logic                            visit_valid_o,
  output logic                            visit_eos_o,
  output logic                            visit_last_o,
  output logic [PixelW-1:0]               visit_pixel_o,
  output logic [SlotW-1:0]                visit_slot_o,
  // counters
  output logic                            starved_o,       // no entry
  output logic                            waits_o          // a token waits for the bank
);

  if (Pixels < 2 || Slots < 2 || Depth < 2) begin : gen_check
    $error("flk_lane_queue: Pixels, Slots and Depth must be at least 2");
  end
  if (Subtiles != 1 && Subtiles != 2 && Subtiles != 4) begin : gen_check_subtiles
    $error("flk_lane_queue: Subtiles must be 1, 2 or 4");
  end

  // Up to Depth in the queue, and one that has left it: the bank lets no second.
  localparam int unsigned TokenW = $clog2(Depth + 2);
  localparam int unsigned LocalW = $clog2(Pixels);
  localparam int unsigned EntryW = SlotW + Pixels + $clog2(Subtiles);

  logic head_valid, pop, push, unused_full, fifo_empty;
  logic [$clog2(Depth + 1)-1:0] unused_usage;
  logic [EntryW-1:0] head;
  logic [Pixels-1:0] head_pixels, head_finished;
  logic [SubtileW-1:0] head_subtile;

  assign push = push_i && ready_o;

  // In a shared core the slot addresses memories, so the oldest entry lies in a register.
  flk_fifo #(
    .Width       (EntryW),
    .Depth       (Depth),
    .HeadRegister(Subtiles > 1)
  ) i_fifo (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (push_i),
    .in_ready_o (ready_o),
    .in_data_i  (EntryW'({push_subtile_i, push_slot_i, push_pixels_i})),
    .out_valid_o(head_valid),
    .out_ready_i(pop),
    .out_data_o (head),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (fifo_empty)
  );

  assign {visit_slot_o, head_pixels} = head[SlotW+Pixels-1:0];
  assign head_subtile = SubtileW'(head >> (SlotW + Pixels));

  // ---- Issue -----------------------------------------------------------------------------------------------

  logic [Pixels-1:0] done_d, done_q;  // of the oldest entry, visited
  logic [Pixels-1:0] todo, rest;
  logic [LocalW-1:0] lowest;
  logic head_eos;

  always_comb begin
    head_finished = '0;
    for (int unsigned s = 0; s < Subtiles; s++) begin
      head_finished |= finished_i[s] & {Pixels{head_subtile == SubtileW'(s)}};
    end
  end

  assign head_eos = head_pixels == '0;
  // The flags belong to the entry's list only when no token is on its way to them.
  assign todo = head_pixels & ~done_q & ~(token_i ? '0 : head_finished);

  assign rest[0] = 1'b0;
  for (genvar p = 1; p < Pixels; p++) begin : gen_rest
    assign rest[p] = todo[p] && todo[p-1:0] != '0;
  end

  assign visit_eos_o   = head_valid && head_eos && bank_free_i;
  assign visit_valid_o = visit_eos_o || (head_valid && todo != '0);
  assign pop           = visit_eos_o || (head_valid && !head_eos && rest == '0);
  assign visit_last_o  = pop;
  assign starved_o     = !head_valid;
  assign waits_o       = head_valid && head_eos && !bank_free_i;

  always_comb begin
    lowest = '0;
    for (int unsigned p = Pixels; p > 0; p--) begin
      if (todo[p-1]) begin
        lowest = LocalW'(p - 1);
      end
    end
    visit_pixel_o = PixelW'({head_subtile, lowest});
    done_d = (head_valid && !pop) ? (done_q | (todo & ~rest)) : done_q;
    if (pop || clear_i) begin
      done_d = '0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      done_q <= '0;
    end else begin
      done_q <= done_d;
    end
  end

  // ---- Tokens that have not come to the lane's state -----------------------------------------------------------

  logic [TokenW-1:0] tokens_d, tokens_q;

  assign tokens_d = clear_i ? '0
                  : tokens_q + TokenW'(push && push_pixels_i == '0) - TokenW'(token_done_i);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      tokens_q <= '0;
    end else begin
      tokens_q <= tokens_d;
    end
  end

  assign alive_o = tokens_q == '0 ? ~finished_i : '1;
  assign empty_o = fifo_empty && tokens_q == '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      !clear_i |-> tokens_q != '0 || !token_done_i)
  else $error("flk_lane_queue: number of tokens");
`endif

endmodule
