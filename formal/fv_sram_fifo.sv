// flk_sram_fifo: a stream of Depth + 1 elements (fv_stream); ready while the memory has room, valid when a word has been
// read, which happens as soon as there is one and the output is free; the memory is not read where it is written.
//
// Words and output are counted beside it: what flk_sram_fifo's stand-in in other proofs does, too. The assertions l_*
// link registers and chosen element, which induction needs.
module fv_sram_fifo #(
  parameter int unsigned Width = 2,
  parameter int unsigned Depth = 4
) (
  input logic             clk_i,
  input logic             again_i,
  input logic             clear_i,
  input logic             pick_i,
  input logic             in_valid_i,
  input logic [Width-1:0] in_data_i,
  input logic             out_ready_i
);

  localparam int unsigned UsedBits = $clog2(Depth + 2);
  localparam int unsigned SlotBits = UsedBits + 1;

  logic rst_n, in_ready, out_valid, empty, watching, push, fetch, valid_q;
  logic [Width-1:0] out_data, watched;
  logic [UsedBits-1:0] entries, ahead, used_q;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_sram_fifo #(
    .Width(Width),
    .Depth(Depth)
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
    .empty_o    (empty)
  );

  fv_stream #(
    .Width   (Width),
    .Capacity(Depth + 1)
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

  assign push  = in_valid_i && used_q != UsedBits'(Depth);
  assign fetch = used_q != '0 && (!valid_q || out_ready_i);

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      used_q  <= '0;
      valid_q <= 1'b0;
    end else if (clear_i) begin
      used_q  <= '0;
      valid_q <= 1'b0;
    end else begin
      used_q  <= used_q + UsedBits'(push) - UsedBits'(fetch);
      valid_q <= fetch || (valid_q && !out_ready_i);
    end
  end

  // Place of a word so many behind the oldest in the memory.
  function automatic logic [SlotBits-1:0] slot(logic [UsedBits-1:0] distance);
    logic [SlotBits-1:0] sum;
    sum = SlotBits'(dut.read_q) + SlotBits'(distance);
    return sum >= SlotBits'(Depth) ? sum - SlotBits'(Depth) : sum;
  endfunction

  always_comb begin
    if (rst_n) begin
      a_ready: assert (in_ready == (used_q != UsedBits'(Depth)));
      a_valid: assert (out_valid == valid_q);
      a_empty: assert (empty == (entries == '0));
      a_apart: assert (!(dut.push && dut.fetch) || dut.write_q != dut.read_q);
      l_entries: assert (entries == used_q + UsedBits'(valid_q) && used_q <= UsedBits'(Depth));
      l_read: assert (SlotBits'(dut.read_q) < SlotBits'(Depth));
      l_write: assert (SlotBits'(dut.write_q) == slot(used_q));
      l_round: assert ((dut.write_round_q != dut.read_round_q) ==
                       (SlotBits'(dut.read_q) + SlotBits'(used_q) >= SlotBits'(Depth)));
      if (watching && !(valid_q && ahead == '0)) begin
        l_kept: assert (dut.i_storage.storage_q[slot(ahead - UsedBits'(valid_q))] == watched);
      end
      c_full: cover (entries == UsedBits'(Depth + 1));
    end
  end

endmodule
