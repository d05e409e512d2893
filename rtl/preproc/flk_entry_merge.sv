// Merge of the lanes' entries into the list writers, each in the order of the scene.
//
// Bank (column & 1) + 2 (row & 1) takes the entries of its tiles: u = column / 2, v = row / 2 and the
// 52 bits of an entry, {key, number, mask}. Output bank % Writers has them, with bank / Writers in out_bank_o; with four writers
// each bank has an output of its own, and below an output with all its banks is called a bank. Its entries leave in order of seq, those of one seq
// (which all come from one lane) as they came. progress_i[k]: no entry with a seq before it will be
// taken from lane k any more; modulo 2^SEQ_BITS, all seqs that are under way or offered, and all
// progress, within half of the range, what left in the last cycle with them. The earliest entry
// waiting for a bank leaves when each other lane has a later one waiting for this bank, or none and
// its progress is not before it. So that nothing stands still, a lane without work has a progress
// beyond all work that others have.
// end_i: all lanes have finished, their progress beyond all entries, and nothing more will be
// offered; each bank then gives one element with out_end_o, which carries no entry, after its last.
// start_i, for a cycle while idle_o, begins a frame; progress_i is that of the frame from the next
// cycle on.
// Latency 2 through an empty queue: one for its head, one for the output register. Throughput: an
// entry a cycle and lane, an entry a cycle and bank. in_ready_o depends combinationally on
// in_data_i, the queues and their heads on out_ready_i; no other path.
//
// A queue is its head, in registers, and behind it a memory (flk_sram_fifo), which an entry that
// finds the queue empty goes past. While the queue is empty its seq follows progress_i; while
// its next entry is on its way from the memory it stays that of the last one, which is not
// later. So the choice is one comparison of registers for each pair of lanes, and a gate.
module flk_entry_merge
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Lanes    = LANES,  // 1 or more
  parameter  int unsigned Writers  = 4,      // 1, 2 or 4
  parameter  int unsigned Depth    = 32,     // words of the memory of a lane's queue for a bank
  localparam int unsigned BankBits = Writers < 4 ? 2 - $clog2(Writers) : 1
) (
  input  logic                            clk_i,
  input  logic                            rst_ni,
  // Frame
  input  logic                            start_i,
  input  logic                            end_i,
  output logic                            idle_o,
  // Entries of the lanes
  input  logic   [Lanes-1:0]              in_valid_i,
  output logic   [Lanes-1:0]              in_ready_o,
  input  entry_t [Lanes-1:0]              in_data_i,
  input  logic [Lanes-1:0][SEQ_BITS-1:0]  progress_i,
  // Entries of the banks
  output logic [Writers-1:0]                    out_valid_o,
  input  logic [Writers-1:0]                    out_ready_i,
  output logic [Writers-1:0]                    out_end_o,
  output logic [Writers-1:0][BankBits-1:0]      out_bank_o,
  output logic [Writers-1:0][6:0]               out_u_o,
  output logic [Writers-1:0][6:0]               out_v_o,
  output logic [Writers-1:0][NUMBER_BITS+27:0]  out_entry_o
);

  typedef struct packed {
    logic [6:0]             u;
    logic [6:0]             v;
    logic [23:0]            key;
    logic [NUMBER_BITS-1:0] number;
    logic [3:0]             mask;
  } entry_item_t;

  // With the bank of an output that has several above it.
  localparam int unsigned EntryBits = $bits(entry_item_t);
  localparam int unsigned ItemBits = EntryBits + 2 - $clog2(Writers);
  localparam int unsigned OutBits = Writers > 1 ? $clog2(Writers) : 1;
  typedef logic [ItemBits-1:0] item_t;

  if (Writers != 1 && Writers != 2 && Writers != 4) begin : gen_check_writers
    $error("flk_entry_merge: Writers must be 1, 2 or 4");
  end
  if (Depth < 2) begin : gen_check
    $error("flk_entry_merge: Depth must be at least 2");
  end

  logic [Lanes-1:0][Writers-1:0] queue_ready;  // by lane and bank
  logic [Writers-1:0]            bank_idle;
  logic [Lanes-1:0][1:0]         parity;
  logic [Lanes-1:0][OutBits-1:0] to;           // output of the entry

  for (genvar k = 0; k < Lanes; k++) begin : gen_lane
    assign parity[k]     = {in_data_i[k].row[0], in_data_i[k].column[0]};
    assign to[k]         = OutBits'(32'(parity[k]) % Writers);
    assign in_ready_o[k] = queue_ready[k][to[k]];
  end

  for (genvar b = 0; b < Writers; b++) begin : gen_bank
    logic  [Lanes-1:0]               waits, stored, wins, pop;
    logic  [Lanes-1:0][SEQ_BITS-1:0] seq;  // not later than what the lane has for this bank
    item_t [Lanes-1:0]               item;
    logic                            room, nothing, out_valid_q, out_end_q, ended_q, finish;
    item_t                           chosen, out_q;
    entry_item_t                     out_entry;

    for (genvar k = 0; k < Lanes; k++) begin : gen_queue
      logic                push, past, free, head_valid_q, store_valid, store_empty;
      entry_item_t         entry_in;
      item_t               item_in, store, head_q;
      logic [SEQ_BITS-1:0] store_seq, seq_d, seq_q;

      assign entry_in = '{
        u: in_data_i[k].column[7:1], v: in_data_i[k].row[7:1], key: in_data_i[k].key,
        number: in_data_i[k].number, mask: in_data_i[k].mask
      };
      assign item_in = ItemBits'({2'(32'(parity[k]) / Writers), entry_in});
      assign push    = in_valid_i[k] && queue_ready[k][b] && to[k] == OutBits'(b);
      assign free    = !head_valid_q || pop[k];
      assign past    = push && store_empty && free;

      flk_sram_fifo #(
        .Width(SEQ_BITS + $bits(item_t)),
        .Depth(Depth)
      ) i_store (
        .clk_i,
        .rst_ni,
        .clear_i    (1'b0),
        .in_valid_i (push && !past),
        .in_ready_o (queue_ready[k][b]),
        .in_data_i  ({in_data_i[k].seq, item_in}),
        .out_valid_o(store_valid),
        .out_ready_i(free),
        .out_data_o ({store_seq, store}),
        .empty_o    (store_empty)
      );

      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          head_valid_q <= 1'b0;
        end else if (free) begin
          head_valid_q <= store_valid || past;
        end
      end

      always_comb begin
        seq_d = seq_q;
        if (free && store_valid) begin
          seq_d = store_seq;
        end else if (past) begin
          seq_d = in_data_i[k].seq;
        end else if (free && store_empty) begin
          seq_d = progress_i[k];
        end
      end

      always_ff @(posedge clk_i) begin
        seq_q <= seq_d;
        if ((free && store_valid) || past) begin
          head_q <= store_valid ? store : item_in;
        end
      end

      assign waits[k]  = head_valid_q;
      assign stored[k] = !store_empty;
      assign item[k]   = head_q;
      assign seq[k]    = seq_q;

`ifndef SYNTHESIS
      logic [SEQ_BITS-1:0] ahead;
      assign ahead = in_data_i[k].seq - progress_i[k];
      assert property (@(posedge clk_i) disable iff (!rst_ni) in_valid_i[k] |-> !ahead[SEQ_BITS-1])
      else $error("flk_entry_merge: an entry behind its lane's progress");
`endif
    end

    // Lane i before lane j: of an entry and progress that are equal, the entry.
    for (genvar k = 0; k < Lanes; k++) begin : gen_choice
      logic [Lanes-1:0] earlier;
      for (genvar j = 0; j < Lanes; j++) begin : gen_other
        if (j == k) begin : gen_self
          assign earlier[j] = 1'b1;
        end else if (j > k) begin : gen_compare
          logic [SEQ_BITS:0] distance;
          assign distance  = {seq[k], !waits[k]} - {seq[j], !waits[j]};
          assign earlier[j] = distance[SEQ_BITS];
        end else begin : gen_compared
          assign earlier[j] = !gen_choice[j].earlier[k];
        end
      end
      assign wins[k] = waits[k] && earlier == '1;
    end

    if (Lanes == 1) begin : gen_alone
      logic unused_seq;
      assign unused_seq = ^seq;
    end

    assign room = !out_valid_q || out_ready_i[b];
    assign pop  = wins & {Lanes{room}};

    always_comb begin
      chosen = '0;
      for (int unsigned k = 0; k < Lanes; k++) begin
        chosen |= wins[k] ? item[k] : '0;
      end
    end

    assign nothing = waits == '0 && stored == '0;
    assign finish  = end_i && !ended_q && nothing;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        out_valid_q <= 1'b0;
        out_end_q   <= 1'b0;
        ended_q     <= 1'b1;
      end else begin
        if (room) begin
          out_valid_q <= wins != '0 || finish;
          out_end_q   <= finish;
        end
        if (start_i) begin
          ended_q <= 1'b0;
        end else if (finish && room) begin
          ended_q <= 1'b1;
        end
      end
    end

    always_ff @(posedge clk_i) begin
      if (room) begin
        out_q <= chosen;
      end
    end

    assign bank_idle[b]   = nothing && !out_valid_q && ended_q;
    assign out_valid_o[b] = out_valid_q;
    assign out_end_o[b]   = out_end_q;
    assign out_entry      = out_q[EntryBits-1:0];
    assign out_bank_o[b]  = BankBits'(out_q >> EntryBits);
    assign out_u_o[b]     = out_entry.u;
    assign out_v_o[b]     = out_entry.v;
    assign out_entry_o[b] = {out_entry.key, out_entry.number, out_entry.mask};

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni) $onehot0(wins))
    else $error("flk_entry_merge: two lanes chosen");

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        out_valid_o[b] && !out_ready_i[b] |=>
        out_valid_o[b] && $stable({out_end_o[b], out_bank_o[b], out_u_o[b], out_v_o[b],
                                    out_entry_o[b]}))
    else $error("flk_entry_merge: output changed before its transfer");
`endif
  end

  assign idle_o = bank_idle == '1;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o && !end_i)
  else $error("flk_entry_merge: start while a frame is under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni) end_i |-> in_valid_i == '0)
  else $error("flk_entry_merge: an entry after the end");

  for (genvar k = 0; k < Lanes; k++) begin : gen_held
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        in_valid_i[k] && !in_ready_o[k] |=> in_valid_i[k] && $stable(in_data_i[k]))
    else $error("flk_entry_merge: input changed before its transfer");
  end
`endif

endmodule
