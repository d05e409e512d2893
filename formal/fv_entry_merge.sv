// flk_entry_merge, one bank: every entry of a lane leaves once, unchanged, in the lane's order (fv_stream);
// the bank's entries leave in order of seq; the earliest one goes whenever no lane without an entry is
// behind it; the end comes once a frame, after all entries.
//
// Numbers of splats are kept with more bits than seq has (AbsBits), in the record's number, with a bit of
// the entry's own; owner_i (constant) says by seq which lane has a splat. What is assumed is the unit's
// contract: each lane's numbers and progress do not fall, none is before its lane's progress, and all
// that wait, are offered, stand as progress or left in the last cycle lie within half of seq's range (from
// base_i on). The assertions l_* link registers and numbers, for induction.
module fv_entry_merge
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Depth     = 2,
  parameter  int unsigned Bank      = 0,
  parameter  bit          Stream    = 1,  // a lane's entries, and
  parameter  bit          Order     = 1,  // all lanes' order and the end: each proved without the other
  localparam int unsigned AbsBits   = NUMBER_BITS - 1,
  localparam int unsigned Places    = Depth + 2,  // of a queue: head, read register, memory
  localparam int unsigned CountBits = $clog2(Places + 2)
) (
  input logic                          clk_i,
  input logic                          again_i,
  input logic                          pick_i,
  input logic [1:0]                    lane_i,
  input logic [2**SEQ_BITS-1:0][1:0]   owner_i,
  input logic                          start_i,
  input logic                          end_i,
  input logic [LANES-1:0]              in_valid_i,
  input logic [LANES-1:0][1:0]         in_bank_i,
  input logic [LANES-1:0][AbsBits-1:0] in_abs_i,
  input logic [LANES-1:0]              in_value_i,
  input logic [LANES-1:0][AbsBits-1:0] progress_i,
  input logic [AbsBits-1:0]            base_i,
  input logic [3:0]                    out_ready_i
);

  localparam logic [AbsBits-1:0] HALF = AbsBits'(1 << (SEQ_BITS - 1));

  logic                            rst_n, idle, ending_q, ended_q, running_q;
  logic [1:0]                      lane_q;
  logic [2**SEQ_BITS-1:0][1:0]     owner_q;
  logic [LANES-1:0]                in_ready, push, offered_q;
  entry_t [LANES-1:0]              in_data;
  logic [LANES-1:0][SEQ_BITS-1:0]  progress;
  logic [3:0]                      out_valid, out_end;
  logic [3:0][NUMBER_BITS+27:0]    out_entry;
  logic [NUMBER_BITS-1:0]          out_number;
  logic [LANES-1:0][AbsBits-1:0]   progress_q, in_abs_q, in_last_q, front_q;
  logic [LANES-1:0][1:0]           in_bank_q;
  logic [LANES-1:0]                in_value_q;
  logic [AbsBits-1:0]              left_q;  // number of the last entry that went to the output
  logic                            out_fire, waiting;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_entry_merge #(
    .Depth(Depth)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .start_i    (start_i && idle),
    .end_i,
    .idle_o     (idle),
    .in_valid_i,
    .in_ready_o (in_ready),
    .in_data_i  (in_data),
    .progress_i (progress),
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_end_o  (out_end),
    .out_bank_o (),
    .out_u_o    (),
    .out_v_o    (),
    .out_entry_o(out_entry)
  );

  for (genvar k = 0; k < LANES; k++) begin : gen_in
    assign in_data[k] = '{
      seq: in_abs_i[k][SEQ_BITS-1:0], row: {7'd0, in_bank_i[k][1]},
      column: {7'd0, in_bank_i[k][0]}, key: '0, number: {in_value_i[k], in_abs_i[k]}, mask: '0
    };
    assign progress[k] = progress_i[k][SEQ_BITS-1:0];
    assign push[k]     = in_valid_i[k] && in_ready[k] && in_bank_i[k] == 2'(Bank);
  end

  assign out_number = out_entry[Bank][4+:NUMBER_BITS];
  assign out_fire   = out_valid[Bank] && !out_end[Bank];

  function automatic logic [1:0] lane_of(logic [AbsBits-1:0] number);
    return owner_q[number[SEQ_BITS-1:0]];
  endfunction

  // One lane's entries.

  logic [CountBits-1:0] entries, ahead;
  logic       watching;
  logic [NUMBER_BITS-1:0] watched;

  if (Stream) begin : gen_stream
    fv_stream #(
      .Width   (NUMBER_BITS),
      .Capacity(Places + 1)
    ) i_stream (
      .clk_i,
      .rst_ni     (rst_n),
      .clear_i    (1'b0),
      .pick_i,
      .push_i     (push[lane_q]),
      .in_data_i  ({in_value_i[lane_q], in_abs_i[lane_q]}),
      .out_valid_i(out_fire && lane_of(out_number[AbsBits-1:0]) == lane_q),
      .out_ready_i(out_ready_i[Bank]),
      .out_data_i (out_number),
      .inside_o   (entries),
      .watching_o (watching),
      .ahead_o    (ahead),
      .watched_o  (watched)
    );
  end else begin : gen_none
    assign {entries, watching, ahead, watched} = '0;
  end

  // What waits in the bank's queues, oldest first.

  localparam int unsigned UsedBits = $clog2(Depth + 1);
  localparam int unsigned ItemBits = 42 + NUMBER_BITS;

  logic [LANES-1:0][2:0]                          usage;
  logic [LANES-1:0]                               head, fetched, holds, pop;
  logic [LANES-1:0][UsedBits-1:0]                 used;  // words of the memory
  logic [LANES-1:0][Places-1:0][NUMBER_BITS-1:0]  queued;
  logic [LANES-1:0][Places-1:0][SEQ_BITS-1:0]     seq;
  logic [LANES-1:0][SEQ_BITS-1:0]                 head_seq;
  logic [LANES-1:0]                               free, past, empty;

  for (genvar k = 0; k < LANES; k++) begin : gen_see
    assign used[k]     = dut.gen_bank[Bank].gen_queue[k].i_store.used_q;
    assign head[k]     = dut.gen_bank[Bank].gen_queue[k].head_valid_q;
    assign fetched[k]  = dut.gen_bank[Bank].gen_queue[k].i_store.out_valid_q;
    assign usage[k]    = 3'(head[k]) + 3'(fetched[k]) + 3'(used[k]);
    assign holds[k]   = usage[k] != '0;
    assign head_seq[k] = dut.gen_bank[Bank].gen_queue[k].seq_q;
    assign pop[k]      = dut.gen_bank[Bank].pop[k];
    assign free[k]     = dut.gen_bank[Bank].gen_queue[k].free;
    assign past[k]     = dut.gen_bank[Bank].gen_queue[k].past;
    assign empty[k]    = used[k] == '0 && !fetched[k];
    for (genvar d = 0; d < Places; d++) begin : gen_place
      logic [2:0]                   at;    // behind the head
      logic [SEQ_BITS+ItemBits-1:0] data;
      assign at   = 3'(d) - 3'(head[k]);
      assign data = head[k] && d == 0
          ? {head_seq[k], dut.gen_bank[Bank].gen_queue[k].head_q}
          : fetched[k] && at == '0 ? dut.gen_bank[Bank].gen_queue[k].i_store.out_q
          : dut.gen_bank[Bank].gen_queue[k].i_store.words_q[1'(at - 3'(fetched[k]))];
      assign queued[k][d] = data[4+:NUMBER_BITS];
      assign seq[k][d]    = data[ItemBits+:SEQ_BITS];
    end
  end

  // What stands at the front of each lane: its entry, or what the queue holds in its place.
  function automatic logic [AbsBits-1:0] front(logic [1:0] k);
    return head[k] ? queued[k][0][AbsBits-1:0] : front_q[k];
  endfunction

  logic [LANES-1:0] late_q;  // the next entry was not at the head in the last cycle
  logic             first_q;  // start_i in the last cycle: the queues have not seen the new frame's progress

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      offered_q  <= '0;
      progress_q <= '0;
      in_last_q  <= '0;
      left_q     <= '0;
      ending_q   <= 1'b0;
      ended_q    <= 1'b0;
      running_q  <= 1'b0;
      first_q    <= 1'b1;
      late_q     <= '0;
    end else begin
      offered_q  <= in_valid_i & ~in_ready;
      progress_q <= progress_i;
      first_q    <= start_i && idle;
      ending_q   <= end_i;
      late_q     <= holds & ~head;
      for (int unsigned k = 0; k < LANES; k++) begin
        if (in_valid_i[k]) begin
          in_last_q[k] <= in_abs_i[k];
        end
        if (pop[k]) begin
          left_q <= queued[k][0][AbsBits-1:0];
        end
      end
      if (out_valid[Bank] && out_ready_i[Bank] && out_end[Bank]) begin
        ended_q <= 1'b1;
      end
      if (start_i && idle) begin
        running_q  <= 1'b1;
        ended_q    <= 1'b0;
        ending_q   <= 1'b0;
        progress_q <= '0;
        in_last_q  <= '0;
        left_q     <= '0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    lane_q     <= lane_q;
    owner_q    <= owner_q;
    in_abs_q   <= in_abs_i;
    in_bank_q  <= in_bank_i;
    in_value_q <= in_value_i;
    for (int unsigned k = 0; k < LANES; k++) begin
      if (free[k] && fetched[k]) begin
        front_q[k] <= queued[k][3'(head[k])][AbsBits-1:0];
      end else if (past[k]) begin
        front_q[k] <= in_abs_i[k];
      end else if (free[k] && empty[k]) begin
        front_q[k] <= progress_i[k];
      end
    end
  end

  function automatic logic live(logic [AbsBits-1:0] number);
    return AbsBits'(number - base_i) < HALF && number >= base_i;
  endfunction

  // The contract.
  always_comb begin
    assume (lane_q < 2'(LANES) && lane_i == lane_q && owner_i == owner_q);
    if (rst_n) begin
      assume (!ending_q || end_i);
      assume (running_q || in_valid_i == '0 && !end_i);
      assume (!(end_i || start_i && idle) || in_valid_i == '0);
      assume (!start_i || !end_i);
      for (int unsigned k = 0; k < LANES; k++) begin
        assume (progress_i[k] >= progress_q[k]);
        assume (live(progress_i[k]) || start_i && idle);
        assume (first_q || live(front(2'(k))) || start_i && idle);
        for (int unsigned d = 0; d < Places; d++) begin
          assume (3'(d) >= usage[k] || live(queued[k][d][AbsBits-1:0]));
        end
        if (in_valid_i[k]) begin
          assume (live(in_abs_i[k]) && in_abs_i[k] >= progress_i[k] && in_abs_i[k] >= in_last_q[k]);
          assume (lane_of(in_abs_i[k]) == 2'(k));
        end
        if (offered_q[k]) begin
          assume (in_valid_i[k] && in_abs_i[k] == in_abs_q[k] && in_bank_i[k] == in_bank_q[k] &&
                  in_value_i[k] == in_value_q[k]);
        end
      end
    end
  end

  // The earliest that waits, and whether a lane without an entry is behind it.

  logic [AbsBits-1:0] earliest;
  logic               held;

  always_comb begin
    waiting  = holds != '0;
    earliest = '1;
    held     = 1'b0;
    for (int unsigned k = 0; k < LANES; k++) begin
      if (head[k] && queued[k][0][AbsBits-1:0] < earliest) begin
        earliest = queued[k][0][AbsBits-1:0];
      end
    end
    for (int unsigned k = 0; k < LANES; k++) begin
      if (!head[k] && front_q[k] < earliest) begin
        held = 1'b1;
      end
    end
  end

  always_comb begin
    if (rst_n && Order) begin
      // The specification.
      a_goes: assert (!(head != '0 && !held && (!out_valid[Bank] || out_ready_i[Bank])) || pop != '0);
      a_late: assert ((holds & ~head & late_q) == '0);
      a_one: assert ((pop & (pop - 1'b1)) == '0);
      if (out_valid[Bank] && out_end[Bank]) begin
        a_end: assert (end_i && !ended_q && !waiting);
      end
      if (idle && running_q && !first_q) begin
        a_ended: assert (ended_q);
      end

      // Links.
      l_running: assert (running_q || !waiting && !out_valid[Bank] && dut.gen_bank[Bank].ended_q && !ending_q);
      l_ended: assert (!running_q || dut.gen_bank[Bank].ended_q == (ended_q || out_valid[Bank] && out_end[Bank]));
      l_over: assert (!(ended_q || out_valid[Bank] && out_end[Bank]) || ending_q);
      l_ending: assert (!ending_q || offered_q == '0);
      l_quiet: assert (!(running_q && ended_q) || !waiting && !out_valid[Bank]);
      if (first_q) begin
        l_first: assert (!waiting && left_q == '0);
      end
      if (out_fire) begin
        l_left: assert (out_number[AbsBits-1:0] == left_q);
      end

      c_around: cover (left_q >= AbsBits'(9) && holds != '0);
      c_end: cover (ended_q && left_q != '0);
    end
  end

  logic shown;  // the output holds an entry of the lane

  assign shown = out_fire && lane_of(out_number[AbsBits-1:0]) == lane_q;

  always_comb begin
    if (rst_n && Stream) begin
      l_inside: assert (entries == CountBits'(usage[lane_q]) + CountBits'(shown));
      if (watching) begin
        if (ahead != '0 || !shown) begin
          l_kept: assert (queued[lane_q][ahead - CountBits'(shown)] == watched);
        end else begin
          l_shown: assert (out_number == watched);
        end
      end
      c_behind: cover (watching && ahead >= CountBits'(3));
    end
  end

  for (genvar k = 0; k < LANES; k++) begin : gen_check
    always_comb begin
      if (rst_n) begin
        l_usage: assert (used[k] <= UsedBits'(Depth));
        l_late: assert (!holds[k] || head[k] || fetched[k]);
      end
      if (rst_n && Order) begin
        if (pop[k]) begin
          a_order: assert (queued[k][0][AbsBits-1:0] >= left_q);
          a_earliest: assert (queued[k][0][AbsBits-1:0] == earliest && !held);
        end
        if (!head[k] && holds[k]) begin
          l_held: assert (front_q[k] <= queued[k][0][AbsBits-1:0]);
        end
        if (head[k]) begin
          l_front_head: assert (front_q[k] == queued[k][0][AbsBits-1:0]);
        end
        if (holds[k]) begin
          l_front_held: assert (head_seq[k] == front_q[k][SEQ_BITS-1:0]);
        end
        if (usage[k] == '0 && !first_q) begin
          l_front: assert (front_q[k] >= left_q || in_last_q[k] >= left_q);
          l_progress: assert (front_q[k] <= progress_q[k]);
          l_front_seq: assert (head_seq[k] == front_q[k][SEQ_BITS-1:0]);
        end
      end
    end
    for (genvar d = 0; d < Places; d++) begin : gen_queued
      always_comb begin
        if (rst_n && Stream && 3'(d) < usage[k]) begin
          l_lane: assert (lane_of(queued[k][d][AbsBits-1:0]) == 2'(k));
        end
        if (rst_n && Order && 3'(d) < usage[k]) begin
          l_seq: assert (seq[k][d] == queued[k][d][SEQ_BITS-1:0]);
          l_after: assert (queued[k][d][AbsBits-1:0] >= left_q);
          l_last: assert (queued[k][d][AbsBits-1:0] <= in_last_q[k]);
          if (d > 0) begin
            l_sorted: assert (queued[k][d][AbsBits-1:0] >= queued[k][d-1][AbsBits-1:0]);
          end
        end
      end
    end
  end

endmodule
