// flk_delivery, one sub-tile that is finished with no tile early: every entry with its bit, and every end, reaches its core for it once,
// unchanged, in order (fv_stream), whatever the other sub-tiles are finished with and whenever; the others do not. Of two elements that are given
// together the older is no end. The cache keeps the order and is arbitrary otherwise, the queues are stand-ins. The assertions l_* say what is where, for induction.
module fv_delivery #(
  parameter  int unsigned Core    = 0,  // sub-tile; of four cores the core
  parameter  int unsigned InWidth = 1,
  parameter  int unsigned Cores   = 4,
  localparam int unsigned Own     = Core % Cores  // core that has it
) (
  input logic                 clk_i,
  input logic                 again_i,
  input logic [1:0]           pick_i,
  input logic                 clear_i,
  input logic [3:0][1:0]      some_valid_i,
  input logic [3:0][1:0]      in_end_i,
  input logic [3:0][1:0][4:0] in_entry_i,
  input logic [Cores-1:0]     out_ready_i,
  input logic [3:0]           finished_i
);

  localparam int unsigned Queue = 8;
  localparam int unsigned Queued = Queue;
  localparam int unsigned Cached = 3;
  localparam int unsigned Held = Queued + Cached + 2;  // queue, cache, entries taken

  logic            rst_n;
  localparam int unsigned Share = 4 / Cores;
  localparam int unsigned WordBits = 2 + ((Share > 1) ? Share : 0);

  logic [3:0]      in_ready, finish, finished;
  logic [3:0][1:0] in_valid;

  logic [Cores-1:0][InWidth-1:0]      out_valid, out_end;
  logic [Cores-1:0][InWidth-1:0]      out_record;  // of one bit: its number
  logic [Cores-1:0][InWidth-1:0][1:0] out_subtile;
  logic [InWidth-1:0]                 out_given;  // to the core, for the sub-tile
  logic [InWidth-1:0][1:0]            out_element;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  assign finished = finished_i & ~(4'd1 << Core);

  // A second entry only beside a first one that is no end.
  for (genvar u = 0; u < 4; u++) begin : gen_in
    assign in_valid[u] = {&some_valid_i[u] && !in_end_i[u][0], some_valid_i[u][0]};
  end

  flk_delivery #(
    .RecordBits(1),
    .NumberBits(1),
    .InWidth   (InWidth),
    .Queue     (Queue),
    .Cores     (Cores)
  ) dut (
    .clk_i,
    .rst_ni       (rst_n),
    .start_i      (1'b0),
    .clear_i,
    .idle_o       (),
    .error_o      (),
    .lines_o      (),
    .waits_o      (),
    .record_base_i('0),
    .in_valid_i   (in_valid),
    .in_ready_o   (in_ready),
    .in_end_i,
    .in_entry_i,
    .finish_o     (finish),
    .border_i     ('0),
    .taken_o      (),
    .out_valid_o  (out_valid),
    .out_ready_i,
    .out_end_o    (out_end),
    .out_record_o (out_record),
    .out_subtile_o(out_subtile),
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

  logic [1:0]      unit_q, taken, is_end, wanted;
  logic [1:0][4:0] entry;

  assign taken  = in_ready[unit_q] ? in_valid[unit_q] : '0;
  assign entry  = in_entry_i[unit_q];
  assign is_end = in_end_i[unit_q];
  assign wanted = taken & (is_end | {entry[1][Core], entry[0][Core]});

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      unit_q <= '0;
    end else if (clear_i) begin
      unit_q <= '0;
    end else begin
      unit_q <= unit_q + 2'((taken & is_end) != '0);
    end
  end

  logic [3:0] count, ahead;
  logic       watching;
  logic [1:0] watched;

  fv_stream #(
    .Width   (2),
    .Capacity(Held),
    .In      (2),
    .Out     (InWidth)
  ) i_stream (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .pick_i,
    .push_i     (wanted),
    .in_data_i  ({is_end[1], entry[1][4], is_end[0], entry[0][4]}),
    .out_valid_i(out_given),
    .out_ready_i({InWidth{out_ready_i[Own]}}),
    .out_data_i (out_element),
    .inside_o   (count),
    .watching_o (watching),
    .ahead_o    (ahead),
    .watched_o  (watched)
  );

  // What is for the sub-tile, the older lower.
  always_comb begin
    out_given   = '0;
    out_element = '0;
    for (int unsigned w = InWidth; w > 0; w--) begin
      if (out_valid[Own][w-1] && (out_end[Own][w-1] || out_subtile[Own][w-1] == 2'(Core))) begin
        out_given      = InWidth'({out_given, 1'b1});
        out_element    = (2 * InWidth)'({out_element, 2'b0});
        out_element[0] = {out_end[Own][w-1], out_record[Own][w-1]};
      end
    end
  end

  logic [4:0] queued;  // in the core's queue
  logic [1:0] push;
  logic [4:0] popped;  // in the cycle before

  assign queued = 5'(dut.gen_core[Own].i_queue.used_q);
  assign push   = dut.gen_core[Own].push;
  assign popped = 5'(dut.left_q[Own]);

  // All that is inside, the oldest first, and which of it is the core's.

  logic [Held-1:0]      present;
  logic [Held-1:0][1:0] item;
  logic [2:0]           cached;
  logic [4:0]           at, ends, opened;
  logic                 found;  // the element that is watched, in its place
  logic [Cached-1:0]    right;
  logic [Queued-1:0]    whole;  // what a word of the queue says of its sub-tiles is so
  logic                 none;   // nothing was given of a word that is not there

  assign cached = dut.i_cache.used_q;

  for (genvar d = 0; d < Queued; d++) begin : gen_queued
    logic [WordBits-1:0] word;  // end, sub-tiles that want it where a core has several, record

    assign word    = dut.gen_core[Own].i_queue.words_q[d];
    assign item[d] = {word[WordBits-1], word[0]};

    if (Share == 1) begin : gen_one
      assign present[d] = 5'(d) < queued;
      assign whole[d]   = 1'b1;
    end else begin : gen_several
      logic [Share-1:0] wanted, given;

      assign wanted     = word[WordBits-2-:Share];
      assign given      = (d == 0) ? dut.gen_core[Own].gen_split.given_q : '0;
      assign present[d] = 5'(d) < queued && wanted[Core/Cores] && !given[Core/Cores];
      assign whole[d]   = 5'(d) >= queued || ((wanted & ~given) != '0 && (given & ~wanted) == '0 &&
                                              (!word[WordBits-1] || ((&wanted) && given == '0)));
    end
  end

  if (Share == 1) begin : gen_never
    assign none = 1'b1;
  end else begin : gen_given
    assign none = queued != '0 || dut.gen_core[Own].gen_split.given_q == '0;
  end

  for (genvar d = 0; d < Cached; d++) begin : gen_cached
    logic [5:0] element;  // record, end, mask
    assign element           = dut.i_cache.words_q[d];
    assign present[Queued+d] = 3'(d) < cached && element[Core];
    assign item[Queued+d]    = {element[4], element[5]};
    assign right[d]          = 3'(d) >= cached || !element[4] || element[3:0] == '1;  // an end goes to all cores
  end

  for (genvar k = 0; k < 2; k++) begin : gen_taken
    assign present[Held-2+k] = dut.e_valid_q[k] && (dut.e_q[k].last || dut.e_q[k].mask[Core]);
    assign item[Held-2+k]    = {dut.e_q[k].last, dut.e_record_q[k]};
  end

  always_comb begin
    at     = '0;
    ends   = '0;
    opened = '0;
    found  = 1'b0;
    for (int unsigned d = 0; d < Held; d++) begin
      if (present[d]) begin
        found  = found || (at == 5'(ahead) && item[d] == watched);
        at     = at + 1'b1;
        opened = opened + 5'(item[d][1]);
        if (d < Queued) begin
          ends = ends + 5'(item[d][1]);
        end
      end
    end
  end

  always_comb begin
    if (rst_n) begin
      a_room: assert (queued + 5'(push[0]) + 5'(push[1]) <= 5'(Queue));
      l_inside: assert (5'(count) == at);
      l_cached: assert (cached <= 3'(Cached));
      l_used: assert (5'(dut.used_q[Own]) == queued + popped && 5'(dut.used_q[Own]) <= 5'(Queue));
      l_room: assert (!dut.room_q || 5'(dut.used_q[Own]) <= 5'(Queue - 4));
      l_next: assert (!dut.i_cache.ready_q || 5'(dut.used_q[Own]) <= 5'(Queue - 2));
      l_pop: assert (!dut.pop_end_q[Own] || dut.left_q[Own] != '0);
      l_pops: assert (dut.left_q[Own] <= 4'(InWidth));
      l_whole: assert (whole == '1 && none);
      a_together: assert (!out_valid[Own][InWidth-1] || InWidth == 1 || !out_end[Own][0]);
      l_ends: assert (5'(dut.ends_q[Own]) == ends + 5'(dut.pop_end_q[Own]));
      l_opened: assert (5'(dut.opened_q[Own]) == opened + 5'(dut.pop_end_q[Own]));
      l_finished: assert (!dut.finished_q[Core]);
      l_unit: assert (dut.unit_q == unit_q);
      l_pair: assert (!(dut.e_valid_q[1] && dut.e_valid_q[0] && dut.e_q[0].last));
      l_watched: assert (!watching || found);
      l_right: assert (right == '1);
      a_finish: assert (finish == '0);
      c_end: cover (out_ready_i[Own] && (out_valid[Own] & out_end[Own]) != '0 && unit_q == 2'd3);
      c_all: cover (out_ready_i[Own] && (&out_valid[Own]) && unit_q == 2'd3);
      c_full: cover (!dut.room_q && dut.i_cache.ready_q);
    end
  end

endmodule
