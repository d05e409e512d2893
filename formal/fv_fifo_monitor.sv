// flk_fifo_monitor with four feature FIFOs: every element the CTU hands over is in the FIFO of each
// channel of its mask exactly once, in order, unless that channel is finished; tokens are in all
// four. For any pattern in which the channels take elements and report that they are finished.
//
// One channel (which_i, constant) stands for all four. A finished channel takes no splat
// whatever its mask says; the dispatch must not wait for its FIFO.
module fv_fifo_monitor
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Depth = 3
) (
  input logic                clk_i,
  input logic                again_i,
  input logic                clear_i,
  input logic                pick_i,
  input logic [         1:0] which_i,
  input logic                in_valid_i,
  input logic                in_eos_i,
  input logic [CHANNELS-1:0] in_mask_i,
  input logic                in_data_i,
  input logic [CHANNELS-1:0] finished_i,
  input logic [CHANNELS-1:0] take_i  // channels that take their head
);

  localparam int unsigned CountBits = $clog2(Depth + 1);

  logic rst_n, in_ready, stall, transfer, wanted, watching, filtered;
  logic [CHANNELS-1:0] write, ready, full, head_valid, may_wait;
  logic [CHANNELS-1:0][1:0] head;
  logic [CHANNELS-1:0][CountBits-1:0] usage;
  logic [CountBits-1:0] entries, ahead;
  logic [1:0] which_q, watched;
  dispatch_events_t events;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_fifo_monitor dut (
    .in_valid_i,
    .in_ready_o(in_ready),
    .in_eos_i,
    .in_mask_i,
    .stall_o   (stall),
    .write_o   (write),
    .ready_i   (ready),
    .finished_i,
    .events_o  (events)
  );

  for (genvar c = 0; c < CHANNELS; c++) begin : gen_fifo
    logic unused_empty;
    flk_fifo #(
      .Width(2),
      .Depth(Depth)
    ) i_fifo (
      .clk_i,
      .rst_ni     (rst_n),
      .clear_i,
      .in_valid_i (write[c]),
      .in_ready_o (ready[c]),
      .in_data_i  ({in_eos_i, in_data_i}),
      .out_valid_o(head_valid[c]),
      .out_ready_i(take_i[c]),
      .out_data_o (head[c]),
      .usage_o    (usage[c]),
      .full_o     (full[c]),
      .empty_o    (unused_empty)
    );
  end

  // ---- Environment: tokens carry the full mask, as the CTU sends them --------------------------

  always_ff @(posedge clk_i) begin
    which_q <= which_q;
  end

  always_comb begin
    assume (which_i == which_q);
    assume (!in_eos_i || in_mask_i == '1);
  end

  // ---- Specification: what channel which_q must receive --------------------------------------------

  assign transfer = in_valid_i && in_ready && rst_n;
  assign wanted   = in_eos_i || (in_mask_i[which_q] && !finished_i[which_q]);
  assign filtered = !in_eos_i && in_mask_i[which_q] && finished_i[which_q];
  assign may_wait = in_eos_i ? full : full & in_mask_i & ~finished_i;

  fv_stream #(
    .Width   (2),
    .Capacity(Depth)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (transfer && wanted),
    .in_data_i  ({in_eos_i, in_data_i}),
    .out_valid_i(head_valid[which_q]),
    .out_ready_i(take_i[which_q]),
    .out_data_i (head[which_q]),
    .inside_o   (entries),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  function automatic logic [2:0] ones(logic [CHANNELS-1:0] bits);
    return 3'(bits[0]) + 3'(bits[1]) + 3'(bits[2]) + 3'(bits[3]);
  endfunction

  // Storage of the four FIFOs side by side.
  logic [CHANNELS-1:0][Depth-1:0][1:0] storage;
  logic [CHANNELS-1:0][CountBits:0] read, next;

  for (genvar c = 0; c < CHANNELS; c++) begin : gen_link
    for (genvar k = 0; k < Depth; k++) begin : gen_slot
      assign storage[c][k] = gen_fifo[c].i_fifo.storage_q[k];
    end
    assign read[c] = (CountBits + 1)'(gen_fifo[c].i_fifo.read_q);
    assign next[c] = (CountBits + 1)'(gen_fifo[c].i_fifo.write_q);
  end

  function automatic logic [CountBits:0] slot(logic [CountBits:0] from,
                                              logic [CountBits-1:0] distance);
    logic [CountBits:0] sum;
    sum = from + (CountBits + 1)'(distance);
    return sum >= (CountBits + 1)'(Depth) ? sum - (CountBits + 1)'(Depth) : sum;
  endfunction

  always_comb begin
    if (rst_n) begin
      // All or nothing: what is written is what was taken over.
      a_write: assert (write[which_q] == (transfer && wanted));
      a_room: assert (!write[which_q] || !full[which_q]);
      // No deadlock: waits only for a FIFO that the element needs.
      a_ready: assert (in_ready == (may_wait == '0));
      a_stall: assert (stall == (full != '0));
      a_valid: assert (head_valid[which_q] == (entries != '0));
      // Counters.
      a_delivered: assert (events.delivered == (in_eos_i ? '0 : ones(write)));
      a_filtered: assert (events.filtered
                          == (transfer && !in_eos_i ? ones(in_mask_i & finished_i) : '0));

      // Links for induction.
      l_usage: assert (usage[which_q] == entries);
      l_pointers: assert (read[which_q] < (CountBits + 1)'(Depth)
                          && next[which_q] == slot(read[which_q], entries));
      if (watching) begin
        l_kept: assert (storage[which_q][slot(read[which_q], ahead)] == watched);
      end

      c_full: cover (full == '1);
      c_wait: cover (in_valid_i && !in_ready && in_mask_i != '1 && !full[which_q]);
      c_past_full: cover (transfer && full[which_q] && in_mask_i != '0 && !filtered);
      c_filtered: cover (transfer && filtered && full[which_q] && write != '0);
      c_token: cover (transfer && in_eos_i && finished_i == '1);
    end
  end

endmodule
