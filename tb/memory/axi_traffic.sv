// AXI4 manager for the test of memory ports: writes Bursts bursts, reads them back when all
// writes are answered, compares.
//
// Burst n begins at `base_i + n * Stride` and has (n mod MaxBeats) + 1 beats; word w of beat k is
// {n, k, w}. Identifiers count with the bursts. The upper half of every beat of an odd burst is
// left out by its strobes and must read as it was, `fill_i` in every byte.
module axi_traffic #(
  parameter  int unsigned Width    = 512,
  parameter  int unsigned IdBits   = 2,
  parameter  int unsigned Bursts   = 64,
  parameter  int unsigned MaxBeats = 8,
  localparam int unsigned Bytes    = Width / 8,
  localparam int unsigned Stride   = MaxBeats * Bytes
) (
  input  logic              clk_i,
  input  logic              rst_ni,
  input  logic [39:0]       base_i,
  input  logic [7:0]        fill_i,
  output logic              done_o,
  output logic [31:0]       bad_beats_o,
  output logic [31:0]       bad_answers_o,

  output logic              mem_aw_valid_o,
  input  logic              mem_aw_ready_i,
  output logic [IdBits-1:0] mem_aw_id_o,
  output logic [39:0]       mem_aw_addr_o,
  output logic [7:0]        mem_aw_len_o,
  output logic [2:0]        mem_aw_size_o,
  output logic [1:0]        mem_aw_burst_o,
  output logic              mem_w_valid_o,
  input  logic              mem_w_ready_i,
  output logic [Width-1:0]  mem_w_data_o,
  output logic [Bytes-1:0]  mem_w_strb_o,
  output logic              mem_w_last_o,
  input  logic              mem_b_valid_i,
  output logic              mem_b_ready_o,
  input  logic [IdBits-1:0] mem_b_id_i,
  input  logic [1:0]        mem_b_resp_i,
  output logic              mem_ar_valid_o,
  input  logic              mem_ar_ready_i,
  output logic [IdBits-1:0] mem_ar_id_o,
  output logic [39:0]       mem_ar_addr_o,
  output logic [7:0]        mem_ar_len_o,
  output logic [2:0]        mem_ar_size_o,
  output logic [1:0]        mem_ar_burst_o,
  input  logic              mem_r_valid_i,
  output logic              mem_r_ready_o,
  input  logic [IdBits-1:0] mem_r_id_i,
  input  logic [Width-1:0]  mem_r_data_i,
  input  logic [1:0]        mem_r_resp_i,
  input  logic              mem_r_last_i
);

  localparam int unsigned Ids = 1 << IdBits;

  logic [15:0] aw_q, w_q, b_q, ar_q, r_q;  // bursts through on each channel
  logic        run_q;  // out of reset
  logic [7:0]  w_beat_q;
  logic [15:0] r_burst_q[Ids];  // by id: the burst that is read, and its beat
  logic [7:0]  r_beat_q[Ids];

  function automatic logic [7:0] len(logic [15:0] n);
    return 8'(n % 16'(MaxBeats));
  endfunction
  function automatic logic [39:0] address(logic [15:0] n);
    return base_i + 40'(n) * 40'(Stride);
  endfunction
  function automatic logic [Width-1:0] pattern(logic [15:0] n, logic [7:0] beat);
    for (int unsigned w = 0; w < Width / 32; w++) pattern[32*w+:32] = {n, beat, 8'(w)};
  endfunction
  function automatic logic [Bytes-1:0] strobes(logic [15:0] n);
    return {{Bytes / 2{!n[0]}}, {Bytes / 2{1'b1}}};
  endfunction
  function automatic logic [Width-1:0] expected(logic [15:0] n, logic [7:0] beat);
    expected = pattern(n, beat);
    if (n[0]) expected[Width-1:Width/2] = {Bytes / 2{fill_i}};
  endfunction

  assign mem_aw_valid_o = run_q && aw_q < 16'(Bursts);
  assign mem_aw_id_o    = IdBits'(aw_q);
  assign mem_aw_addr_o  = address(aw_q);
  assign mem_aw_len_o   = len(aw_q);
  assign mem_aw_size_o  = 3'($clog2(Bytes));
  assign mem_aw_burst_o = 2'b01;
  assign mem_w_valid_o  = run_q && w_q < 16'(Bursts);
  assign mem_w_data_o   = pattern(w_q, w_beat_q);
  assign mem_w_strb_o   = strobes(w_q);
  assign mem_w_last_o   = w_beat_q == len(w_q);
  assign mem_b_ready_o  = 1'b1;
  assign mem_ar_valid_o = b_q == 16'(Bursts) && ar_q < 16'(Bursts);
  assign mem_ar_id_o    = IdBits'(ar_q);
  assign mem_ar_addr_o  = address(ar_q);
  assign mem_ar_len_o   = len(ar_q);
  assign mem_ar_size_o  = 3'($clog2(Bytes));
  assign mem_ar_burst_o = 2'b01;
  assign mem_r_ready_o  = 1'b1;
  assign done_o         = r_q == 16'(Bursts);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {aw_q, w_q, b_q, ar_q, r_q} <= '0;
      run_q         <= 1'b0;
      w_beat_q      <= '0;
      bad_beats_o   <= '0;
      bad_answers_o <= '0;
      for (int unsigned k = 0; k < Ids; k++) begin
        r_burst_q[k] <= 16'(k);
        r_beat_q[k]  <= '0;
      end
    end else begin
      run_q <= 1'b1;
      if (mem_aw_valid_o && mem_aw_ready_i) aw_q <= aw_q + 1'b1;
      if (mem_w_valid_o && mem_w_ready_i) begin
        w_beat_q <= mem_w_last_o ? '0 : w_beat_q + 1'b1;
        if (mem_w_last_o) w_q <= w_q + 1'b1;
      end
      if (mem_b_valid_i) begin
        b_q <= b_q + 1'b1;
        if (mem_b_resp_i != '0) bad_answers_o <= bad_answers_o + 1'b1;
      end
      if (mem_ar_valid_o && mem_ar_ready_i) ar_q <= ar_q + 1'b1;
      if (mem_r_valid_i) begin
        r_beat_q[mem_r_id_i] <= mem_r_last_i ? '0 : r_beat_q[mem_r_id_i] + 1'b1;
        if (mem_r_last_i) begin
          r_burst_q[mem_r_id_i] <= r_burst_q[mem_r_id_i] + 16'(Ids);
          r_q                   <= r_q + 1'b1;
        end
        if (mem_r_resp_i != '0) bad_answers_o <= bad_answers_o + 1'b1;
        else if (mem_r_data_i != expected(r_burst_q[mem_r_id_i], r_beat_q[mem_r_id_i]) ||
                 mem_r_last_i != (r_beat_q[mem_r_id_i] == len(r_burst_q[mem_r_id_i]))) begin
          bad_beats_o <= bad_beats_o + 1'b1;
        end
      end
    end
  end

endmodule
