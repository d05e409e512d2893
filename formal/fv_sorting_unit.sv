// flk_sorting_unit, small: every list that fits comes out sorted, each entry exactly once, then its end.
//
// The lists are one list, chosen freely (constant), of up to Entries entries with different keys, given
// again and again with free pauses, in lines of two. An entry at the output must be the one of which as many are
// smaller as have left before it.
module fv_sorting_unit #(
  parameter  int unsigned Entries = 4,
  parameter  int unsigned Steps   = 2,  // 4 << Steps / 2 entries fit
  parameter  int unsigned Ways    = 2,
  localparam int unsigned Most    = Entries,
  localparam int unsigned Bits    = 4,  // three of the key
  localparam int unsigned CountBits = 4
) (
  input logic                      clk_i,
  input logic                      again_i,
  input logic [Most-1:0][Bits-1:0] list_i,
  input logic [CountBits-1:0]      length_i,
  input logic                      in_valid_i,
  input logic                      out_ready_i
);

  logic rst_n, in_ready, out_valid, out_end, offered_q, in_last;
  logic [Most-1:0][Bits-1:0] list_q;
  logic [CountBits-1:0] length_q, at_q, left, out_q, smaller;
  logic [1:0][Bits-1:0] line;
  logic [1:0] count;
  logic [Bits-1:0] out_entry;
  logic found, different, run_valid;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_sorting_unit #(
    .Cells      (2),
    .Stages     (Steps),
    .Ways       (Ways),
    .Lists      (2),
    .LineEntries(2),
    .ShortEntries(2),
    .TailBits   (0),
    .EntryBits  (Bits),
    .MaskBits   (1),
    .OutBits    (Bits)
  ) dut (
    .clk_i,
    .rst_ni         (rst_n),
    .clear_i        (1'b0),
    .start_i        (1'b0),
    .idle_o         (),
    .entries_o      (),
    .readings_o     (),
    .dropped_o      (),
    .in_valid_i,
    .in_ready_o     (in_ready),
    .in_entries_i   (line),
    .in_count_i     (count),
    .in_last_i      (in_last),
    .run_valid_o    (run_valid),
    .run_ready_i    (1'b0),
    .run_end_o      (),
    .run_entry_o    (),
    .merging_o      (),
    .merge_stop_o   (),
    .merge_valid_i  (1'b0),
    .merge_ready_o  (),
    .merge_entries_i('0),
    .merge_count_i  ('0),
    .merge_limited_i(1'b0),
    .merge_limit_i  ('0),
    .merge_last_i   (1'b0),
    .merge_final_i  (1'b0),
    .out_valid_o    (out_valid),
    .out_ready_i,
    .out_end_o      (out_end),
    .out_entry_o    (out_entry),
    .finish_i       (1'b0)
  );

  assign left    = length_q - at_q;
  assign count   = left > CountBits'(2) ? 2'd2 : 2'(left);
  assign in_last = left <= CountBits'(2);

  always_comb begin
    line = '0;
    for (int unsigned i = 0; i < 2; i++) begin
      for (int unsigned n = 0; n < Most; n++) begin
        if (CountBits'(n) == at_q + CountBits'(i)) begin
          line[i] = list_q[n];
        end
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      offered_q <= 1'b0;
      at_q      <= '0;
      out_q     <= '0;
    end else begin
      offered_q <= in_valid_i && !in_ready;
      if (in_valid_i && in_ready) begin
        at_q <= in_last ? '0 : at_q + CountBits'(2);
      end
      if (out_valid && out_ready_i) begin
        out_q   <= out_end ? '0 : out_q + 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    list_q   <= list_q;
    length_q <= length_q;
  end

  always_comb begin
    different = 1'b1;
    for (int unsigned i = 0; i < Most; i++) begin
      for (int unsigned j = 0; j < i; j++) begin
        if (list_q[i][Bits-1:1] == list_q[j][Bits-1:1]) begin
          different = 1'b0;
        end
      end
    end
  end

  always_comb begin
    smaller = '0;
    found   = 1'b0;
    for (int unsigned n = 0; n < Most; n++) begin
      if (CountBits'(n) < length_q) begin
        smaller = smaller + CountBits'(list_q[n][Bits-1:1] < out_entry[Bits-1:1]);
        found   = found || list_q[n] == out_entry;
      end
    end
  end

  always_comb begin
    assume (list_i == list_q && length_i == length_q && length_q <= CountBits'(Most) && different);
    if (rst_n) begin
      assume (!offered_q || in_valid_i);
      a_fits: assert (!run_valid);
      if (out_valid && !out_end) begin
        a_entry: assert (found && smaller == out_q && out_q < length_q);
      end
      if (out_valid && out_end) begin
        a_end: assert (out_q == length_q);
      end
      c_list: cover (out_valid && out_end && length_q == CountBits'(Most));
    end
  end

endmodule
