// Queue of a core's records and of the ends of their lists (docs/reference/delivery.md): first-in first-out, up to two words a cycle
// in and out, eight a cycle where records are dropped; storage in two memories (flk_sram) in turn.
//
// Words at both inputs are in the order 0, 1; either may come alone. in_last_i: the word is an end. There must be room: at most Depth
// words are inside, and who pushes counts them.
// The two oldest words are at the outputs: out_valid_o[1] implies out_valid_o[0], and out_ready_i[1] is heard with out_ready_i[0]
// alone. Of what stays, the oldest word is at output 0 in the next cycle.
// drop_i, a level: records that no end is before leave unseen, and out_valid_o[1] is low; ends stay until they are taken. Two leave a
// cycle, one where the oldest is in the second memory. Eight that follow in one group, all of them inside and none an end, leave with
// the two before them or after those; the next word is then at the output a cycle later.
// left_o: words that leave in this cycle, 0 to 2, 8 or 10.
// Latency 2. out_* and empty_o come from registers through a multiplexer, out_valid_o also from drop_i; out_ready_i and drop_i reach the
// memories' read enables. clear_i (synchronous) empties it: what it holds, and what it takes in that cycle, is gone in the next.
module flk_record_queue #(
  parameter int unsigned Width = 128,
  parameter int unsigned Depth = 128
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  // Upstream
  input  logic [1:0]            in_valid_i,
  input  logic [1:0]            in_last_i,
  input  logic [1:0][Width-1:0] in_data_i,
  // Downstream
  input  logic                  drop_i,
  output logic [1:0]            out_valid_o,
  input  logic [1:0]            out_ready_i,
  output logic [1:0]            out_last_o,
  output logic [1:0][Width-1:0] out_data_o,
  output logic [3:0]            left_o,
  output logic                  empty_o       // nothing inside
);

  localparam int unsigned Half   = Depth / 2;
  localparam int unsigned Groups = Half / 4;  // of four words in each memory
  localparam int unsigned AddrBits = $clog2(Half);
  localparam int unsigned GroupBits = Groups > 1 ? $clog2(Groups) : 1;
  localparam logic [AddrBits-1:0] LAST = AddrBits'(Half - 1);
  localparam logic [AddrBits-1:0] LAST_GROUP = AddrBits'(Half - 4);

  if (Depth < 8 || Depth % 8 != 0) begin : gen_check
    $error("flk_record_queue: Depth must be a multiple of 8, at least 8");
  end

  typedef logic [GroupBits-1:0] group_t;

  // Of each memory: where the next word goes and the oldest one that is not at its output lies, each with a bit that says how often it
  // has gone round; a word is at its output; a word of a group is an end.
  logic [1:0][AddrBits-1:0] write_at_q, read_at_d, read_at_q;
  logic [1:0]               write_round_q, read_round_d, read_round_q;
  logic [1:0]               shown_q, nothing, fetch, write_last, last;
  logic [1:0][Groups-1:0]   ends_q;
  logic [1:0][Width-1:0]    data;
  // The memory of the next word that comes, and of the oldest.
  logic                     write_q, read_q;
  logic [1:0]               push, pop, valid, leaves, gone;
  logic                     dropping, all_inside, skip;
  group_t                   read_group;

  // ---- in -------------------------------------------------------------------------------------------

  for (genvar k = 0; k < 2; k++) begin : gen_memory
    logic   first;  // of the words that come
    group_t write_group;

    assign first          = in_valid_i[0] && write_q == 1'(k);
    assign push[k]        = first || (in_valid_i[1] && (write_q ^ in_valid_i[0]) == 1'(k));
    assign write_last[k]  = first ? in_last_i[0] : in_last_i[1];
    assign write_group    = group_t'(write_at_q[k] >> 2);
    assign nothing[k]     = write_at_q[k] == read_at_q[k] && write_round_q[k] == read_round_q[k];

    flk_sram #(
      .Width(Width + 1),
      .Depth(Half)
    ) i_storage (
      .clk_i,
      .wr_en_i  (push[k]),
      .wr_addr_i(write_at_q[k]),
      .wr_data_i({write_last[k], first ? in_data_i[0] : in_data_i[1]}),
      .rd_en_i  (fetch[k]),
      .rd_addr_i(read_at_q[k]),
      .rd_data_o({last[k], data[k]})
    );

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        write_at_q[k]    <= '0;
        write_round_q[k] <= 1'b0;
      end else if (clear_i) begin
        write_at_q[k]    <= '0;
        write_round_q[k] <= 1'b0;
      end else if (push[k]) begin
        write_at_q[k]    <= write_at_q[k] == LAST ? '0 : write_at_q[k] + 1'b1;
        write_round_q[k] <= write_round_q[k] ^ (write_at_q[k] == LAST);
      end
    end

    // The first word of a group that is written over forgets the ends before.
    always_ff @(posedge clk_i) begin
      if (push[k]) begin
        ends_q[k][write_group] <= write_last[k] ||
                                  (ends_q[k][write_group] && write_at_q[k][1:0] != '0);
      end
    end
  end

  // ---- out ------------------------------------------------------------------------------------------

  assign valid       = {&shown_q, shown_q[read_q]};
  assign out_last_o  = {last[!read_q], last[read_q]};
  assign out_data_o  = {data[!read_q], data[read_q]};
  assign dropping    = drop_i && valid[0] && !out_last_o[0];
  assign out_valid_o = {valid[1] && !drop_i, valid[0] && !dropping};

  // With the second word beside it the oldest is in the first memory again: groups begin there.
  assign pop         = dropping ? {valid[1] && !out_last_o[1] && !read_q, 1'b1}
                                : out_valid_o & {&out_ready_i, out_ready_i[0]};
  assign leaves      = read_q ? {pop[0], pop[1]} : pop;
  assign gone        = ~shown_q | leaves;
  assign left_o      = {skip, 1'b0, pop[1], pop[0] && !pop[1]};
  assign empty_o     = (&nothing) && shown_q == '0;

  // The group that comes next is skipped: it begins where both memories stand, all of it is inside, none of it is an end.
  assign read_group  = group_t'(read_at_q[1] >> 2);
  assign all_inside  = read_round_q[1] != write_round_q[1] ||
                       write_at_q[1] >> 2 != read_at_q[1] >> 2;
  assign skip        = drop_i && !read_q && (shown_q == '0 || (dropping && pop[1])) &&
                       read_at_q[0][1:0] == '0 && all_inside &&
                       !ends_q[0][read_group] && !ends_q[1][read_group];

  for (genvar k = 0; k < 2; k++) begin : gen_read
    assign fetch[k] = !nothing[k] && gone[k] && !skip;

    always_comb begin
      read_at_d[k]    = read_at_q[k];
      read_round_d[k] = read_round_q[k];
      if (skip) begin
        read_at_d[k]    = read_at_q[k] == LAST_GROUP ? '0 : read_at_q[k] + AddrBits'(4);
        read_round_d[k] = read_round_q[k] ^ (read_at_q[k] == LAST_GROUP);
      end else if (fetch[k]) begin
        read_at_d[k]    = read_at_q[k] == LAST ? '0 : read_at_q[k] + 1'b1;
        read_round_d[k] = read_round_q[k] ^ (read_at_q[k] == LAST);
      end
    end

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        read_at_q[k]    <= '0;
        read_round_q[k] <= 1'b0;
        shown_q[k]      <= 1'b0;
      end else if (clear_i) begin
        read_at_q[k]    <= '0;
        read_round_q[k] <= 1'b0;
        shown_q[k]      <= 1'b0;
      end else begin
        read_at_q[k]    <= read_at_d[k];
        read_round_q[k] <= read_round_d[k];
        shown_q[k]      <= fetch[k] || !gone[k];
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q <= 1'b0;
      read_q  <= 1'b0;
    end else if (clear_i) begin
      write_q <= 1'b0;
      read_q  <= 1'b0;
    end else begin
      write_q <= write_q ^ (^in_valid_i);
      read_q  <= read_q ^ (^pop);
    end
  end

`ifndef SYNTHESIS
  for (genvar k = 0; k < 2; k++) begin : gen_assert
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        write_round_q[k] == read_round_q[k] ? write_at_q[k] >= read_at_q[k]
                                            : write_at_q[k] <= read_at_q[k])
    else $error("flk_record_queue: more words than Depth");
  end

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      skip |-> read_at_q[0] == read_at_q[1] && read_round_q[0] == read_round_q[1])
  else $error("flk_record_queue: the memories do not stand at one group");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o[0] && !out_ready_i[0] && !clear_i |=>
      dropping || out_valid_o[0] && $stable(out_data_o[0]))
  else $error("flk_record_queue: output changed before its transfer");
`endif

endmodule
