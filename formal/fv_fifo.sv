// flk_fifo: a stream of Depth elements (fv_stream); ready while there is room, valid while there
// is anything; fill level, full and empty.
//
// The assertions l_* link registers and chosen element, which induction needs.
module fv_fifo #(
  parameter int unsigned Width = 2,
  parameter int unsigned Depth = 16,
  parameter bit HeadRegister = 1'b0
) (
  input logic             clk_i,
  input logic             again_i,
  input logic             clear_i,
  input logic             pick_i,
  input logic             in_valid_i,
  input logic [Width-1:0] in_data_i,
  input logic             out_ready_i
);

  localparam int unsigned UsageBits = $clog2(Depth + 1);
  localparam int unsigned SlotBits = UsageBits + 1;  // sum of two slot numbers

  logic rst_n, in_ready, out_valid, full, empty, watching;
  logic [Width-1:0] out_data, watched;
  logic [UsageBits-1:0] usage, entries, ahead;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_fifo #(
    .Width       (Width),
    .Depth       (Depth),
    .HeadRegister(HeadRegister)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_data_i,
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o (out_data),
    .usage_o    (usage),
    .full_o     (full),
    .empty_o    (empty)
  );

  fv_stream #(
    .Width   (Width),
    .Capacity(Depth)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (in_valid_i && in_ready),
    .in_data_i,
    .out_valid_i(out_valid),
    .out_ready_i,
    .out_data_i (out_data),
    .inside_o   (entries),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  // Slot of the chosen element and of the next one to come.
  function automatic logic [SlotBits-1:0] slot(logic [UsageBits-1:0] distance);
    logic [SlotBits-1:0] sum;
    sum = SlotBits'(dut.read_q) + SlotBits'(distance);
    return sum >= SlotBits'(Depth) ? sum - SlotBits'(Depth) : sum;
  endfunction

  if (HeadRegister) begin : gen_head
    always_comb begin
      if (rst_n) begin
        l_next: assert (SlotBits'(dut.gen_head.next_q) == slot(UsageBits'(1)));
        l_head: assert (entries == '0 || dut.gen_head.head_q == dut.storage_q[dut.read_q]);
      end
    end
  end

  logic [SlotBits-1:0] watched_slot;
  logic                was_full_q;

  assign watched_slot = slot(ahead);

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      was_full_q <= 1'b0;
    end else if (clear_i) begin
      was_full_q <= 1'b0;
    end else begin
      was_full_q <= was_full_q || full;
    end
  end

  always_comb begin
    if (rst_n) begin
      a_ready: assert (in_ready == (entries < UsageBits'(Depth)));
      a_valid: assert (out_valid == (entries != '0));
      a_usage: assert (usage == entries);
      a_full: assert (full == (entries == UsageBits'(Depth)));
      a_empty: assert (empty == (entries == '0));
      l_read: assert (SlotBits'(dut.read_q) < SlotBits'(Depth));
      l_write: assert (SlotBits'(dut.write_q) == slot(entries));
      if (watching) begin
        l_kept: assert (dut.storage_q[watched_slot] == watched);
      end
      c_full: cover (full);
      // Long traces of a deep queue show nothing that those of a small one do not.
      if (Depth <= 8) begin
        c_drained: cover (empty && was_full_q);
      end
    end
  end

endmodule
