// Colour keeper: this frame's colours into the colour store (docs/reference/colour_store.md).
//
// Clusters come in order (cluster_*), their turns too: which lanes have a survivor, which have a stored colour, whether the turn is
// the cluster's last. So do the records of the survivors, in beats of four of which a cluster begins a new one. Of a cluster
// whose colours are stored, a row of 12 leaves where a survivor has no stored colour and every stored one is a survivor's; behind the rows
// the head, with the bits of what is there now. Entries of a row without a survivor are zero.
// drop_i, until the next start_i: turns and records that wait are forgotten, and none come; a line that is offered leaves.
// start_i forgets what an earlier frame has left. idle_o: no turn waits and no line is to leave.
// Throughput: a turn a cycle, and a cycle for a line. Combinational: line_ready_i to the state alone.
module flk_colour_keeper
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Lanes    = LANES,  // 1, 2 or 4
  parameter  int unsigned Turns    = 128,    // that wait for records
  parameter  int unsigned Clusters = 16,     // of these turns
  localparam int unsigned Width    = 512
) (
  input  logic                     clk_i,
  input  logic                     rst_ni,
  input  logic                     start_i,
  input  logic                     drop_i,
  output logic                     idle_o,
  input  logic [31:0]              generation_i,
  input  cluster_t [2:0]           position_i,
  // Clusters
  input  logic                     cluster_valid_i,
  output logic                     cluster_ready_o,
  input  store_slot_t              cluster_slot_i,
  input  logic                     cluster_storing_i,
  // Turns
  input  logic                     turn_valid_i,
  output logic                     turn_ready_o,
  input  logic [Lanes-1:0]         turn_alive_i,
  input  logic [Lanes-1:0]         turn_there_i,  // stored already
  input  logic                     turn_last_i,
  // Records
  input  logic                     record_valid_i,
  output logic                     record_ready_o,
  input  store_entry_t [3:0]       record_i,
  // Lines
  output logic                     line_valid_o,
  input  logic                     line_ready_i,
  output logic [BEAT_BITS-1:0]     line_beat_o,
  output logic [Width-1:0]         line_o
);

  localparam int unsigned Rows = STORE_ROWS;
  localparam int unsigned CountBits = 3;  // 0 to 4

  typedef struct packed {
    store_slot_t slot;
    logic        storing;
  } about_t;

  typedef struct packed {
    logic             last;
    logic [Lanes-1:0] there;
    logic [Lanes-1:0] alive;
  } turn_t;

  // ---- what waits -----------------------------------------------------------------------------------

  about_t             about;
  turn_t              turn, waiting;
  store_entry_t [3:0] next;
  logic               about_valid, about_take, about_empty;
  logic               turn_valid, turn_take, turns_empty, next_valid, next_take, records_empty;
  logic               waiting_valid, waiting_take;

  flk_sram_fifo #(
    .Width($bits(about_t)),
    .Depth(Clusters)
  ) i_clusters (
    .clk_i,
    .rst_ni,
    .clear_i    (start_i),
    .in_valid_i (cluster_valid_i),
    .in_ready_o (cluster_ready_o),
    .in_data_i  ({cluster_slot_i, cluster_storing_i}),
    .out_valid_o(about_valid),
    .out_ready_i(about_take),
    .out_data_o (about),
    .empty_o    (about_empty)
  );

  flk_sram_fifo #(
    .Width($bits(turn_t)),
    .Depth(Turns)
  ) i_turns (
    .clk_i,
    .rst_ni,
    .clear_i    (start_i || drop_i),
    .in_valid_i (turn_valid_i),
    .in_ready_o (turn_ready_o),
    .in_data_i  ({turn_last_i, turn_there_i, turn_alive_i}),
    .out_valid_o(waiting_valid),
    .out_ready_i(waiting_take),
    .out_data_o (waiting),
    .empty_o    (turns_empty)
  );

  // The turn in work, with the number of its records.
  logic                 turn_valid_q;
  turn_t                turn_q;
  logic [CountBits-1:0] waiting_count, count_q;

  always_comb begin
    waiting_count = '0;
    for (int unsigned k = 0; k < Lanes; k++) begin
      waiting_count = waiting_count + CountBits'(waiting.alive[k]);
    end
  end

  assign waiting_take = !turn_valid_q || turn_take;
  assign turn_valid   = turn_valid_q;
  assign turn         = turn_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      turn_valid_q <= 1'b0;
    end else if (start_i || drop_i) begin
      turn_valid_q <= 1'b0;
    end else if (waiting_take) begin
      turn_valid_q <= waiting_valid;
    end
  end

  always_ff @(posedge clk_i) begin
    if (waiting_take) begin
      turn_q  <= waiting;
      count_q <= waiting_count;
    end
  end

  flk_sram_fifo #(
    .Width(4 * $bits(store_entry_t)),
    .Depth(8)
  ) i_records (
    .clk_i,
    .rst_ni,
    .clear_i    (start_i || drop_i),
    .in_valid_i (record_valid_i),
    .in_ready_o (record_ready_o),
    .in_data_i  (record_i),
    .out_valid_o(next_valid),
    .out_ready_i(next_take),
    .out_data_o (next),
    .empty_o    (records_empty)
  );

  // ---- records of a turn ----------------------------------------------------------------------------

  // The open beat, how many of its records are gone, and the beat behind it in the queue.
  store_entry_t [3:0]               open_q;
  logic                             open_valid_q, take, both, refill, drop;
  logic [1:0]                       gone_q;
  logic [Lanes-1:0][CountBits-1:0]  ahead;
  logic [3:0]                       behind;  // gone with this turn's
  store_entry_t [Lanes-1:0]         found;

  always_comb begin
    ahead = '0;
    for (int unsigned k = 1; k < Lanes; k++) begin
      ahead[k] = ahead[k-1] + CountBits'(turn.alive[k-1]);
    end
  end

  assign behind = 4'(gone_q) + 4'(count_q);

  for (genvar k = 0; k < Lanes; k++) begin : gen_found
    logic [2:0] at;
    assign at       = 3'(gone_q) + ahead[k];
    assign found[k] = at[2] ? next[at[1:0]] : open_q[at[1:0]];
  end

  // ---- a row ----------------------------------------------------------------------------------------

  typedef enum logic [1:0] {FILL, ROW, HEAD} state_e;

  state_e                       state_d, state_q;
  store_entry_t [STORE_ROW-1:0] entry_q;
  logic [STORE_ROW-1:0]         alive_q, there_q;
  logic [3:0]                   place_q;
  logic [4:0]                   row_q;
  logic                         row_end, last_q, wanted, written_q, row_done;
  store_slot_t                  slot_q;
  logic                         storing_q;
  logic                         new_q, lost_q;  // in the row: a new colour; a colour that goes
  logic [Rows-1:0][STORE_ROW-1:0] bits_q;

  assign turn_take = state_q == FILL && turn_valid && about_valid &&
                     (count_q == '0 || (open_valid_q && (behind <= 4'd4 || next_valid)));
  assign row_end   = turn.last || place_q == 4'(STORE_ROW - Lanes);
  // It leaves: a survivor's colour is new, and no stored one would be lost.
  assign wanted    = storing_q && new_q && !lost_q;
  assign row_done  = state_q == ROW && (!wanted || line_ready_i);

  assign line_valid_o = (state_q == ROW && wanted) || (state_q == HEAD && written_q);
  assign about_take   = state_q == HEAD && (!written_q || line_ready_i);

  always_comb begin
    state_d = state_q;
    unique case (state_q)
      FILL: begin
        if (turn_take && row_end) begin
          state_d = ROW;
        end
      end
      ROW: begin
        if (row_done) begin
          state_d = last_q ? HEAD : FILL;
        end
      end
      default: begin  // HEAD
        if (about_take) begin
          state_d = FILL;
        end
      end
    endcase
  end

  // A turn's beat goes when all of it is gone, or with the cluster; the one behind it too, where the turn has begun it and the cluster ends.
  assign take   = turn_take && (behind >= 4'd4 || (turn.last && behind != '0));
  assign both   = turn_take && turn.last && behind > 4'd4;
  assign drop   = take && (both || !next_valid);
  assign refill = next_valid && !both && (!open_valid_q || take);
  assign next_take = refill || both;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q      <= FILL;
      open_valid_q <= 1'b0;
      gone_q       <= '0;
      place_q      <= '0;
      row_q        <= '0;
      alive_q      <= '0;
      there_q      <= '0;
      new_q        <= 1'b0;
      lost_q       <= 1'b0;
      written_q    <= 1'b0;
    end else if (start_i) begin
      state_q      <= FILL;
      open_valid_q <= 1'b0;
      gone_q       <= '0;
      place_q      <= '0;
      row_q        <= '0;
      alive_q      <= '0;
      there_q      <= '0;
      new_q        <= 1'b0;
      lost_q       <= 1'b0;
      written_q    <= 1'b0;
    end else begin
      state_q      <= state_d;
      open_valid_q <= refill || (open_valid_q && !drop);
      if (turn_take) begin
        gone_q  <= turn.last ? '0 : behind[1:0];
        place_q <= row_end ? '0 : place_q + 4'(Lanes);
        new_q   <= new_q || (turn.alive & ~turn.there) != '0;
        lost_q  <= lost_q || (turn.there & ~turn.alive) != '0;
        for (int unsigned p = 0; p < STORE_ROW; p++) begin
          if (4'(p - p % Lanes) == place_q) begin
            alive_q[p] <= turn.alive[p%Lanes];
            there_q[p] <= turn.there[p%Lanes];
          end
        end
      end
      if (row_done) begin
        alive_q   <= '0;
        there_q   <= '0;
        new_q     <= 1'b0;
        lost_q    <= 1'b0;
        row_q     <= last_q ? '0 : row_q + 1'b1;
        written_q <= written_q || wanted;
      end
      if (about_take) begin
        written_q <= 1'b0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (refill) begin
      open_q <= next;
    end
    if (turn_take) begin
      last_q    <= turn.last;
      slot_q    <= about.slot;
      storing_q <= about.storing;
      for (int unsigned p = 0; p < STORE_ROW; p++) begin
        if (4'(p - p % Lanes) == place_q) begin
          entry_q[p] <= found[p%Lanes];
        end
      end
    end
    if (row_done) begin
      for (int unsigned r = 0; r < Rows; r++) begin
        if (row_q == 5'(r)) begin
          bits_q[r] <= wanted ? alive_q : there_q;
        end else if (row_q == '0) begin
          bits_q[r] <= '0;
        end
      end
    end
  end

  // ---- lines ----------------------------------------------------------------------------------------

  store_head_t      head;
  logic [Width-1:0] row_line;

  assign head = '{there: 256'({bits_q}), generation: generation_i, position: position_i};

  always_comb begin
    row_line = '0;
    for (int unsigned p = 0; p < STORE_ROW; p++) begin
      row_line[40*p+:38] = alive_q[p] ? entry_q[p] : '0;
    end
  end

  assign line_beat_o = {slot_q, state_q == HEAD ? 5'd0 : row_q + 1'b1};
  assign line_o      = state_q == HEAD ? {head.there, 128'b0, head.generation, head.position}
                                       : row_line;
  assign idle_o      = turns_empty && !turn_valid_q && state_q == FILL;

  logic unused;
  assign unused = ^{about_empty, records_empty, bits_q[Rows-1][STORE_ROW-1:4]};

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni || start_i)
      turn_take |-> (open_valid_q || count_q == '0))
  else $error("flk_colour_keeper: records that are not there");

  assert property (@(posedge clk_i) disable iff (!rst_ni || start_i)
      line_valid_o && !line_ready_i |=> line_valid_o && $stable({line_beat_o, line_o}))
  else $error("flk_colour_keeper: a line that changes before it leaves");
`endif

endmodule
