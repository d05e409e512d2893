// flk_sort_merge: what goes into one of its two memories leaves once, unchanged and in order,
// for lists of any lengths and any stalls; nothing leaves that is not inside, and one entry at a time.
// Without drop_i.
//
// The assertions l_* link registers and chosen element, which induction needs.
module fv_sort_merge #(
  parameter  int unsigned Side = 0,
  parameter  int unsigned Run  = 2,
  localparam int unsigned Bits = 3,  // two of the key
  localparam int unsigned CountBits = $clog2(Run + 1),
  localparam int unsigned PlaceBits = $clog2(Run) + 1
) (
  input logic            clk_i,
  input logic            again_i,
  input logic            clear_i,
  input logic            pick_i,
  input logic            in_valid_i,
  input logic            in_end_i,
  input logic            in_flag_i,
  input logic [Bits-1:0] in_entry_i,
  input logic            out_ready_i
);

  logic rst_n, in_ready, out_valid, out_end, watching, push;
  logic [Bits-1:0] out_entry, watched;
  logic [CountBits-1:0] entries, ahead;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_sort_merge #(
    .Run        (Run),
    .KeyBits    (Bits - 1),
    .PayloadBits(1),
    .Lists      (2)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_end_i,
    .in_flag_i,
    .in_entry_i,
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_end_o  (out_end),
    .out_flag_o (),
    .out_entry_o(out_entry),
    .drop_i     (1'b0),
    .drop_o     (),
    .empty_o    ()
  );

  assign push = in_valid_i && in_ready && !in_end_i && dut.side_q == 1'(Side);

  // An entry is offered from this side or the other.
  logic offered, leaves;
  assign offered = out_valid && !out_end && dut.prefer_b == 1'(Side);
  assign leaves  = dut.pop[Side];

  // One entry, whichever pick_i chooses when it is taken, is followed: `ahead` must leave before it.
  logic [CountBits-1:0] entries_q, ahead_q;
  logic                 watching_q;
  logic [Bits-1:0]      watched_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      entries_q  <= '0;
      watching_q <= 1'b0;
    end else if (clear_i) begin
      entries_q  <= '0;
      watching_q <= 1'b0;
    end else begin
      entries_q <= entries_q + CountBits'(push) - CountBits'(leaves);
      if (!watching_q && push && pick_i) begin
        watching_q <= 1'b1;
        ahead_q    <= entries_q - CountBits'(leaves);
        watched_q  <= in_entry_i;
      end else if (leaves) begin
        watching_q <= watching_q && ahead_q != '0;
        ahead_q    <= ahead_q - 1'b1;
      end
    end
  end

  assign entries  = entries_q;
  assign ahead    = ahead_q;
  assign watching = watching_q;
  assign watched  = watched_q;

  // Where the chosen entry is: at the head, in the memory's read register, or in the memory.
  logic [PlaceBits-1:0] head_at, fetch_at, write_at, place;
  logic                 head_valid, read_valid;

  assign head_at    = dut.gen_side[Side].i_side.head_at_q;
  assign fetch_at   = dut.gen_side[Side].i_side.fetch_at_q;
  assign write_at   = dut.gen_side[Side].i_side.write_at_q;
  assign head_valid = dut.gen_side[Side].i_side.head_valid_q;
  assign read_valid = dut.gen_side[Side].i_side.read_valid_q;
  assign place      = head_at + PlaceBits'(ahead);

  logic [Bits-1:0] word;
  always_comb begin
    word = dut.gen_side[Side].i_side.i_memory.storage_q[place[PlaceBits-2:0]];
    if (head_valid && ahead == '0) begin
      word = dut.gen_side[Side].i_side.head_q;
    end else if (read_valid && ahead == CountBits'(head_valid)) begin
      word = dut.gen_side[Side].i_side.read;
    end
  end

  always_comb begin
    if (rst_n) begin
      // An entry that is offered is one of those inside, and is taken from one side.
      a_one: assert (dut.pop != 2'b11);
      a_taken: assert (leaves == (offered && out_ready_i));
      a_inside: assert (!leaves || entries != '0);

      if (leaves && watching && ahead == '0) begin
        a_entry: assert (out_entry == watched);
      end

      l_inside: assert (PlaceBits'(entries) == PlaceBits'(write_at - head_at));
      l_most: assert (entries <= CountBits'(Run));
      l_fetch: assert (PlaceBits'(fetch_at - head_at) == PlaceBits'(head_valid) + PlaceBits'(read_valid));
      l_behind: assert (PlaceBits'(write_at - fetch_at) <= PlaceBits'(Run) &&
                        CountBits'(head_valid) + CountBits'(read_valid) <= entries);
      if (watching) begin
        l_ahead: assert (ahead < entries);
        l_word: assert (word == watched);
      end
      c_full: cover (entries == CountBits'(Run) && watching);
      c_end: cover (out_valid && out_end && entries != '0);
    end
  end

endmodule
