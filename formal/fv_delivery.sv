// flk_delivery, one channel and one core that finishes no tile early: every entry with the core's bit, and every end,
// reaches the core once, unchanged, in order (fv_stream), whatever the other cores finish and whenever; the others
// do not. The core takes the channels' tiles in turn. The cache keeps each channel's order and is arbitrary otherwise
// (standin). The assertions l_* say what is where, for induction.
module fv_delivery #(
  parameter int unsigned Channel = 0,
  parameter int unsigned Core    = 0
) (
  input logic            clk_i,
  input logic            again_i,
  input logic            pick_i,
  input logic            clear_i,
  input logic [3:0]      in_valid_i,
  input logic [3:0]      in_end_i,
  input logic [3:0][5:0] in_entry_i,
  input logic [3:0]      out_ready_i,
  input logic [3:0]      finished_i
);

  localparam int unsigned Queue = 4;
  localparam int unsigned Held = Queue + 4;  // in the queue and its register, the cache, the channel's register

  logic            rst_n;
  logic [3:0]      in_ready, finish, out_valid, out_end, finished;
  logic [3:0][1:0] out_record;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  assign finished = finished_i & ~(4'd1 << Core);

  flk_delivery #(
    .RecordBits(2),
    .NumberBits(2),
    .Queue     (Queue)
  ) dut (
    .clk_i,
    .rst_ni       (rst_n),
    .start_i      (1'b0),
    .clear_i,
    .idle_o       (),
    .error_o      (),
    .lines_o      (),
    .record_base_i('0),
    .in_valid_i,
    .in_ready_o   (in_ready),
    .in_end_i,
    .in_entry_i,
    .finish_o     (finish),
    .out_valid_o  (out_valid),
    .out_ready_i,
    .out_end_o    (out_end),
    .out_record_o (out_record),
    .finished_i   (finished),
    .ar_valid_o   (),
    .ar_ready_i   (1'b0),
    .ar_id_o      (),
    .ar_addr_o    (),
    .ar_len_o     (),
    .ar_size_o    (),
    .ar_burst_o   (),
    .r_valid_i    (1'b0),
    .r_ready_o    (),
    .r_id_i       ('0),
    .r_data_i     ('0),
    .r_resp_i     ('0),
    .r_last_i     (1'b0)
  );

  // What the unit in turn gives, and whether the core is to have it.

  logic       unit_q, turn_q, take, wanted;
  logic [1:0] unit_now;
  logic [5:0] entry;

  assign unit_now = {unit_q, 1'(Channel)};
  assign take     = in_valid_i[unit_now] && in_ready[unit_now];
  assign entry    = in_entry_i[unit_now];
  assign wanted   = in_end_i[unit_now] || entry[Core];

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      unit_q <= 1'b0;
      turn_q <= 1'b0;
    end else if (clear_i) begin
      unit_q <= 1'b0;
      turn_q <= 1'b0;
    end else begin
      unit_q <= unit_q ^ (take && in_end_i[unit_now]);
      turn_q <= turn_q ^ (out_valid[Core] && out_ready_i[Core] && out_end[Core]);
    end
  end

  logic [3:0] count, ahead;
  logic       watching;
  logic [2:0] watched;

  fv_stream #(
    .Width   (3),
    .Capacity(Held)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (take && wanted),
    .in_data_i  ({in_end_i[unit_now], entry[5:4]}),
    .out_valid_i(out_valid[Core] && turn_q == 1'(Channel)),
    .out_ready_i(out_ready_i[Core]),
    .out_data_i ({out_end[Core], out_record[Core]}),
    .inside_o   (count),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  // What is inside, the oldest first.

  logic [Held-1:0]      present;
  logic [Held-1:0][2:0] item;
  logic [2:0]           used;
  logic [1:0]           cached;
  logic [3:0]           at, in_cache, in_queue, ends, opened;
  logic                 found;  // the element that is watched, in its place
  logic [1:0]           masks;

  assign used   = dut.gen_queues[Channel].gen_core[Core].i_queue.used_q;
  assign cached = dut.i_cache.used_q[Channel];

  assign present[0] = dut.gen_queues[Channel].gen_core[Core].i_queue.out_valid_q;
  assign item[0]    = dut.gen_queues[Channel].gen_core[Core].i_queue.out_q;

  for (genvar d = 0; d < Queue; d++) begin : gen_words
    assign present[1+d] = 3'(d) < used;
    assign item[1+d]    = dut.gen_queues[Channel].gen_core[Core].i_queue.words_q[d];
  end

  for (genvar d = 0; d < 2; d++) begin : gen_cached
    logic [6:0] word;  // record, end, mask
    assign word               = dut.i_cache.words_q[Channel][d];
    assign present[1+Queue+d] = 2'(d) < cached && word[Core];
    assign item[1+Queue+d]    = {word[4], word[6:5]};
    assign masks[d]           = 2'(d) >= cached || !word[4] || word[3:0] == '1;
  end

  assign present[Held-1] = dut.e_valid_q[Channel] &&
                           (dut.e_q[Channel].last || dut.e_q[Channel].mask[Core]);
  assign item[Held-1]    = {dut.e_q[Channel].last, dut.e_record_q[Channel]};

  always_comb begin
    at       = '0;
    in_cache = '0;
    in_queue = '0;
    ends     = '0;
    opened   = '0;
    found    = 1'b1;
    for (int unsigned d = 0; d < Held; d++) begin
      if (present[d]) begin
        found  = found && (at != ahead || item[d] == watched);
        at     = at + 1'b1;
        opened = opened + 4'(item[d][2]);
        if (d <= Queue) begin
          in_queue = in_queue + 1'b1;
          ends     = ends + 4'(item[d][2]);
        end else if (d < Held - 1) begin
          in_cache = in_cache + 1'b1;
        end
      end
    end
  end

  always_comb begin
    if (rst_n) begin
      l_inside: assert (count == at);
      l_used: assert (used <= 3'(Queue) && cached <= 2'd2);
      l_places: assert (4'(dut.places_q[Channel][Core]) + in_cache + in_queue == 4'(Queue));
      l_ends: assert (4'(dut.ends_q[Channel][Core]) == ends);
      l_opened: assert (4'(dut.opened_q[Channel][Core]) == opened);
      l_gone: assert (!dut.gone_q[Channel][Core]);
      l_unit: assert (dut.unit_q[Channel] == unit_q && dut.turn_q[Core] == turn_q);
      l_watched: assert (!watching || found);
      l_mask: assert (masks == '1);
      a_finish: assert (finish[{1'b0, 1'(Channel)}] == 1'b0 && finish[{1'b1, 1'(Channel)}] == 1'b0);
      c_end: cover (out_valid[Core] && out_ready_i[Core] && out_end[Core] && turn_q);
    end
  end

endmodule
