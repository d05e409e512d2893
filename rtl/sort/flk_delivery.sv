// Delivery: sorted entries of the sorting units to records at Cores cores (docs/reference/delivery.md).
//
// Sub-tile s of a tile is of core s mod Cores, bit s of an entry's mask says whether it sees the record.
// Tile i of the walk comes from unit i mod Units. Tiles go one after the other, two entries a cycle (pairs of
// flk_entry_buffer, never beyond the end of a list). An entry's record is looked up in the cache
// (flk_record_cache) and put into the queues of the cores of its mask; the end of a list goes to all of them.
// From its queue it goes to the core as an element for each of the core's sub-tiles in the mask, the lowest first.
// All is one stream in one order: what cannot go on holds up only what is behind it, so lookups run
// ahead of the queues, as far as the cache has places, and the memory's latency is not waited for.
// The head of the stream waits while any core's queue is nearly full.
// in_*: of each unit, the oldest entry and the one behind it; in_ready_o takes all that is valid.
// out_*: to each core, up to InWidth elements of one list, the older lower; out_ready_i takes all that are valid, and a second may join
// the one that waits. The end of a list is the last of those that are given together. out_subtile_o: for which, nothing at an end.
// finished_i of a sub-tile, a level, is about the tile whose elements its core is taking, until that has taken its
// end; in the cycle after that it is about the next tile. Records of such a sub-tile that are not in its
// core's queue yet do not come; an entry that no sub-tile wants is not looked up. When all sub-tiles of a core are finished, its queue
// drops their records, up to eight a cycle (flk_record_queue): an element that was offered and not taken may be withdrawn then. When all four are finished
// with the tile that is taken from a unit, finish_o of that unit rises, until its end is taken.
// border_i: sub-tiles of the tile in turn that touch the one after it (0) and the one behind that (1): an entry there is probably in
// that one's list too, and its line stays in the cache until then (flk_record_cache). taken_o: its end is taken, the next tile is in turn.
// start_i (while idle_o) and clear_i (at any time) forget all, cached lines too; no entries may come,
// and out_ready_i must be low, until idle_o. error_o: the memory answered with an error; until then.
// waits_o: a cycle ago an entry could be taken and the unit in turn had none (bit 0); it had one that could not be taken (1); the head
// of the cache's queue waited for room in the cores' queues (2), or for its line (3).
// Latency 7 for a record in the cache. in_ready_o depends on no input of the same cycle; out_valid_o
// and out_* come from registers through a multiplexer.
module flk_delivery #(
  parameter  int unsigned Units      = 4,    // sorting units: 1, 2 or 4
  parameter  int unsigned RecordBits = 128,
  parameter  int unsigned NumberBits = 24,
  parameter  int unsigned InWidth    = 1,    // elements that a core takes in a cycle, 1 or 2
  parameter  int unsigned Queue      = 128,  // records, of each core
  parameter  int unsigned Banks      = 4,    // of the cache
  parameter  int unsigned Sets       = 64,
  parameter  int unsigned Ways       = 4,
  parameter  int unsigned Depth      = 512,
  parameter  int unsigned Places     = 256,
  parameter  int unsigned AddrBits   = 40,
  parameter  int unsigned IdBits     = 4,
  parameter  int unsigned Id         = 0,
  parameter  int unsigned Cores      = 4,    // 1, 2 or 4
  localparam int unsigned Subtiles   = 4,    // of a tile
  localparam int unsigned Width      = 256,
  localparam int unsigned Shift      = $clog2(Width / 8)
) (
  input  logic                              clk_i,
  input  logic                              rst_ni,
  // Frame
  input  logic                              start_i,
  input  logic                              clear_i,
  output logic                              idle_o,
  output logic                              error_o,
  output logic [31:0]                       lines_o,        // read from memory since start_i
  output logic [3:0]                        waits_o,
  input  logic [AddrBits-Shift-1:0]         record_base_i,  // in 32 bytes
  // Sorting units
  input  logic [Units-1:0][1:0]                          in_valid_i,
  output logic [Units-1:0]                               in_ready_o,
  input  logic [Units-1:0][1:0]                          in_end_i,
  input  logic [Units-1:0][1:0][NumberBits+Subtiles-1:0] in_entry_i,
  output logic [Units-1:0]                               finish_o,
  // Walk
  input  logic [1:0][Subtiles-1:0]                       border_i,
  output logic                                           taken_o,
  // Cores
  output logic [Cores-1:0][InWidth-1:0]                 out_valid_o,
  input  logic [Cores-1:0]                              out_ready_i,
  output logic [Cores-1:0][InWidth-1:0]                 out_end_o,
  output logic [Cores-1:0][InWidth-1:0][RecordBits-1:0] out_record_o,
  output logic [Cores-1:0][InWidth-1:0][1:0]            out_subtile_o,
  input  logic [Subtiles-1:0]                           finished_i,
  // AXI4
  output logic                              ar_valid_o,
  input  logic                              ar_ready_i,
  output logic [IdBits-1:0]                 ar_id_o,
  output logic [AddrBits-1:0]               ar_addr_o,
  output logic [7:0]                        ar_len_o,
  output logic [2:0]                        ar_size_o,
  output logic [1:0]                        ar_burst_o,
  input  logic                              r_valid_i,
  output logic                              r_ready_o,
  input  logic [IdBits-1:0]                 r_id_i,
  input  logic [Width-1:0]                  r_data_i,
  input  logic [1:0]                        r_resp_i,
  input  logic                              r_last_i
);

  localparam int unsigned FillBits = $clog2(Queue + 1);
  localparam int unsigned EndBits = $clog2(Depth + Queue + 16);
  localparam int unsigned UnitBits = Units > 1 ? $clog2(Units) : 1;
  localparam int unsigned Margin = 6;  // records under way when a queue is seen to be nearly full

  if (Queue < 8 || Queue % 8 != 0) begin : gen_check_queue
    $error("flk_delivery: Queue must be a multiple of 8, at least 8");
  end
  if (Units != 1 && Units != 2 && Units != 4) begin : gen_check_units
    $error("flk_delivery: Units must be 1, 2 or 4");
  end
  if (InWidth != 1 && InWidth != 2) begin : gen_check_width
    $error("flk_delivery: InWidth must be 1 or 2");
  end
  if (Cores != 1 && Cores != 2 && Cores != 4) begin : gen_check_cores
    $error("flk_delivery: Cores must be 1, 2 or 4");
  end

  localparam int unsigned Share = Subtiles / Cores;  // sub-tiles of a core

  typedef struct packed {
    logic                last;  // end of a list
    logic [Subtiles-1:0] mask;
  } what_t;

  logic stop;

  assign stop = start_i || clear_i;

  // ---- entries ----------------------------------------------------------------------------------------

  logic [UnitBits-1:0]         unit_q;              // that is taken from
  logic [1:0]                  e_valid_q, leaves, nothing, look, look_ready;
  what_t [1:0]                 e_q, what;
  logic [1:0][NumberBits-1:0]  e_record_q;
  logic [5:0]                  tile_q, e_tile_q;    // of the walk, modulo 64
  logic [1:0][5:0]             e_until_q;           // tile until which a line is kept
  logic [1:0][Subtiles-1:0]    kept;
  logic                        e_move, e_ready, e_take, e_end_taken;

  // Of a core: ends between the unit and it, and in its queue alone. Of a sub-tile: its core is finished with it in the tile that it takes, or
  // took in the cycle before, where an end that it took then still counts; and in the one that is taken from a unit.
  logic [Cores-1:0][EndBits-1:0]  opened_q;
  logic [Cores-1:0][FillBits-1:0] ends_q, used_q;
  logic [Cores-1:0]               unopened, unended;
  logic [Subtiles-1:0]            finished_q, over;
  logic [Cores-1:0][1:0]          pop;
  logic [Cores-1:0][3:0]          left_q;            // counted a cycle later: ready comes late
  logic [Cores-1:0]               pop_end_q;
  logic                           ready_q;           // the cache is
  logic [1:0]                     head_waits;

  for (genvar s = 0; s < Subtiles; s++) begin : gen_over
    assign over[s] = finished_q[s] && unopened[s%Cores];
  end

  assign e_move      = (e_valid_q & ~leaves) == '0;
  assign e_ready     = ready_q && e_move;
  assign e_take      = in_valid_i[unit_q][0] && e_ready;
  assign e_end_taken = e_take && (in_valid_i[unit_q] & in_end_i[unit_q]) != '0;

  for (genvar k = 0; k < 2; k++) begin : gen_entry
    // The entries in the registers are before all ends taken after them: those in opened_q are of earlier tiles, or their own.
    assign kept[k]    = e_q[k].last ? '1 : e_q[k].mask & ~over;
    assign nothing[k] = kept[k] == '0;
    assign look[k]    = e_valid_q[k] && !nothing[k] && !stop;
    assign leaves[k]  = nothing[k] || look_ready[k];
    assign what[k]    = '{last: e_q[k].last, mask: kept[k]};

    logic [1:0] meets;

    for (genvar n = 0; n < 2; n++) begin : gen_meets
      assign meets[n] = (in_entry_i[unit_q][k][Subtiles-1:0] & border_i[n]) != '0;
    end

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        e_valid_q[k] <= 1'b0;
      end else if (stop) begin
        e_valid_q[k] <= 1'b0;
      end else begin
        e_valid_q[k] <= e_take ? in_valid_i[unit_q][k] : e_valid_q[k] && !leaves[k];
      end
    end

    always_ff @(posedge clk_i) begin
      if (e_take) begin
        e_q[k].last   <= in_end_i[unit_q][k];
        e_q[k].mask   <= in_entry_i[unit_q][k][Subtiles-1:0];
        e_record_q[k] <= in_entry_i[unit_q][k][NumberBits+Subtiles-1:Subtiles];
        e_until_q[k]  <= tile_q + (meets[1] ? 6'd2 : meets[0] ? 6'd1 : '1);
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      unit_q <= '0;
      tile_q <= '0;
    end else if (stop) begin
      unit_q <= '0;
      tile_q <= '0;
    end else begin
      unit_q <= (unit_q + UnitBits'(e_end_taken)) & UnitBits'(Units - 1);
      tile_q <= tile_q + 6'(e_end_taken);
    end
  end

  always_ff @(posedge clk_i) begin
    if (e_take) begin
      e_tile_q <= tile_q;
    end
  end

  assign taken_o = e_end_taken;

  logic offered_q, taken_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      offered_q <= 1'b0;
      taken_q   <= 1'b0;
    end else begin
      offered_q <= in_valid_i[unit_q][0] && !stop;
      taken_q   <= e_ready && !stop;
    end
  end

  assign waits_o = {head_waits, offered_q && !taken_q, !offered_q && taken_q};

  // All sub-tiles are finished with the tile that a unit gives.
  logic [Units-1:0] finish_q;

  for (genvar u = 0; u < Units; u++) begin : gen_unit
    assign in_ready_o[u] = e_ready && unit_q == UnitBits'(u);
    assign finish_o[u]   = finish_q[u];

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        finish_q[u] <= 1'b0;
      end else begin
        finish_q[u] <= !stop && (&over) && unit_q == UnitBits'(u) && !e_end_taken;
      end
    end
  end

  // ---- records ----------------------------------------------------------------------------------------

  logic                        cache_idle, room_q;
  logic [1:0]                  found_valid;
  logic [1:0][RecordBits-1:0]  found_record;
  what_t [1:0]                 found;

  flk_record_cache #(
    .RecordBits(RecordBits),
    .NumberBits(NumberBits),
    .TagBits   ($bits(what_t)),
    .Banks     (Banks),
    .Sets      (Sets),
    .Ways      (Ways),
    .Depth     (Depth),
    .Places    (Places),
    .AddrBits  (AddrBits),
    .IdBits    (IdBits),
    .Id        (Id)
  ) i_cache (
    .clk_i,
    .rst_ni,
    .start_i,
    .clear_i,
    .idle_o      (cache_idle),
    .error_o,
    .lines_o,
    .waits_o     (head_waits),
    .record_base_i,
    .in_valid_i  (look),
    .in_ready_o  (look_ready),
    .in_skip_i   ({e_q[1].last, e_q[0].last}),
    .in_record_i (e_record_q),
    .in_tag_i    (what),
    .in_tile_i   (e_tile_q),
    .in_until_i  (e_until_q),
    .out_ready_i (room_q),
    .out_valid_o (found_valid),
    .out_record_o(found_record),
    .out_tag_o   (found),
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o,
    .ar_addr_o,
    .ar_len_o,
    .ar_size_o,
    .ar_burst_o,
    .r_valid_i,
    .r_ready_o,
    .r_id_i,
    .r_data_i,
    .r_resp_i,
    .r_last_i
  );

  // Entries are taken from when the cache is ready for the first time until the next start.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      ready_q <= 1'b0;
    end else begin
      ready_q <= !stop && (ready_q || cache_idle);
    end
  end

  // ---- queues -----------------------------------------------------------------------------------------

  logic [Cores-1:0] full, queue_empty;

  // What has left the head of the cache's queue in this cycle and the one before is not counted yet.
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      room_q <= 1'b0;
    end else begin
      room_q <= full == '0;
    end
  end

  // Mask, where a core has several sub-tiles; record.
  localparam int unsigned ElementBits = RecordBits + ((Share > 1) ? Share : 0);

  for (genvar s = 0; s < Cores; s++) begin : gen_core
    logic [1:0]                  push, ended, queue_valid, is_end;
    logic [1:0][Share-1:0]       wanted;  // sub-tiles that want what was found
    logic [1:0][ElementBits-1:0] element;
    logic [Share-1:0]            finished;
    logic                        drop;  // the core wants no record of the list that it takes
    logic [3:0]                  left;

    assign unopened[s] = opened_q[s] == '0;
    assign unended[s]  = ends_q[s] == '0;
    assign full[s]     = 32'(used_q[s]) > Queue - Margin;
    assign ended       = found_valid & {found[1].last, found[0].last};

    // What is behind an end is not of the tile that the core takes.
    for (genvar m = 0; m < Share; m++) begin : gen_wanted
      assign finished[m]  = finished_q[Cores*m+s];
      assign wanted[0][m] = found[0].mask[Cores*m+s] &&
                            (found[0].last || !(finished_q[Cores*m+s] && unended[s]));
      assign wanted[1][m] = found[1].mask[Cores*m+s] &&
                            (found[1].last || !(finished_q[Cores*m+s] && unended[s] && !ended[0]));
    end

    assign push = found_valid & {wanted[1] != '0, wanted[0] != '0};
    // What the core says is of the tile that it was given from a cycle ago.
    assign drop = (&finished) && !pop_end_q[s];

    if (Share == 1) begin : gen_whole
      logic [1:0] given;

      assign given  = queue_valid & {InWidth == 2 && !is_end[0], 1'b1};
      assign pop[s] = given & {2{out_ready_i[s]}};

      for (genvar w = 0; w < InWidth; w++) begin : gen_way
        assign out_valid_o[s][w] = given[w];
        assign out_end_o[s][w] = is_end[w];
        assign out_record_o[s][w] = element[w];
        assign out_subtile_o[s][w] = 2'(s);
      end

      if (InWidth == 1) begin : gen_one
        logic unused_second;

        assign unused_second = ^element[1];
      end
    end else begin : gen_split
      // An element for each sub-tile: the lowest of the oldest record's and its next one, or the lowest of the next record's. A mask has bits.
      logic [Share-1:0]      given_q, given_d;  // the oldest record was given for them
      // Of the two oldest: all, without the lowest, it alone.
      logic [1:0][Share-1:0] todo, rest, first;
      logic [Share-1:0]      beyond;  // of the oldest, without the two lowest
      logic [1:0]            goes;
      // What is given beside the lowest: of the same record, or of the next.
      logic                  same, next;

      for (genvar w = 0; w < 2; w++) begin : gen_element
        assign todo[w]   = element[w][ElementBits-1-:Share] & ~(w == 0 ? given_q : '0);
        assign rest[w]   = todo[w] & (todo[w] - 1'b1);
        assign first[w]  = todo[w] & ~rest[w];
      end

      assign beyond = rest[0] & (rest[0] - 1'b1);
      assign same   = InWidth == 2 && !is_end[0] && rest[0] != '0;
      assign next   = InWidth == 2 && !is_end[0] && rest[0] == '0 && queue_valid[1];
      assign pop[s] = goes & {2{out_ready_i[s]}};

      always_comb begin
        goes[0] = queue_valid[0] && (is_end[0] || (same ? beyond : rest[0]) == '0);
        goes[1] = goes[0] && next && (is_end[1] || rest[1] == '0);
        given_d = given_q | first[0];
        if (same) begin
          given_d |= rest[0] & ~beyond;
        end
        if (goes[0]) begin
          given_d = (next && !goes[1]) ? first[1] : '0;
        end
      end

      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          given_q <= '0;
        end else if (stop) begin
          given_q <= '0;
        end else if (queue_valid[0] && out_ready_i[s]) begin
          given_q <= given_d;
        end
      end

      function automatic logic [1:0] number(logic [Share-1:0] one);
        number = '0;
        for (int unsigned m = 0; m < Share; m++) begin
          number |= one[m] ? 2'(Cores * m + s) : '0;
        end
      endfunction

      assign out_valid_o[s][0]   = queue_valid[0];
      assign out_end_o[s][0]     = is_end[0];
      assign out_record_o[s][0]  = element[0][RecordBits-1:0];
      assign out_subtile_o[s][0] = number(first[0]);

      if (InWidth == 2) begin : gen_second
        assign out_valid_o[s][1]   = queue_valid[0] && (same || next);
        assign out_end_o[s][1]     = !same && is_end[1];
        assign out_record_o[s][1]  = element[!same][RecordBits-1:0];
        assign out_subtile_o[s][1] = number(same ? rest[0] & ~beyond : first[1]);
      end
    end

    flk_record_queue #(
      .Width(ElementBits),
      .Depth(Queue)
    ) i_queue (
      .clk_i,
      .rst_ni,
      .clear_i    (stop),
      .in_valid_i (push),
      .in_last_i  ({found[1].last, found[0].last}),
      .in_data_i  ({ElementBits'({wanted[1], found_record[1]}),
                    ElementBits'({wanted[0], found_record[0]})}),
      .drop_i     (drop),
      .out_valid_o(queue_valid),
      .out_ready_i(pop[s]),
      .out_last_o (is_end),
      .out_data_o (element),
      .left_o     (left),
      .empty_o    (queue_empty[s])
    );

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        used_q[s]    <= '0;
        opened_q[s]  <= '0;
        ends_q[s]    <= '0;
        left_q[s]    <= '0;
        pop_end_q[s] <= 1'b0;
      end else if (stop) begin
        used_q[s]    <= '0;
        opened_q[s]  <= '0;
        ends_q[s]    <= '0;
        left_q[s]    <= '0;
        pop_end_q[s] <= 1'b0;
      end else begin
        left_q[s]    <= left;
        pop_end_q[s] <= (pop[s] & is_end) != '0;
        used_q[s]    <= used_q[s] + FillBits'(push[0]) + FillBits'(push[1]) - FillBits'(left_q[s]);
        opened_q[s]  <= opened_q[s] + EndBits'(e_end_taken) - EndBits'(pop_end_q[s]);
        ends_q[s]    <= ends_q[s] + FillBits'(ended[0]) + FillBits'(ended[1])
                         - FillBits'(pop_end_q[s]);
      end
    end

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        push != '0 && !stop |-> 32'(used_q[s]) + $countones(push) <= Queue)
    else $error("flk_delivery: a record without a place");

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        queue_empty[s] && left_q[s] == '0 |-> used_q[s] == '0)
    else $error("flk_delivery: places of an empty queue are taken");

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        32'(ends_q[s]) <= 32'(opened_q[s]) && ends_q[s] <= used_q[s])
    else $error("flk_delivery: ends or places");

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        out_valid_o[s][0] && !out_ready_i[s] && !stop |=> drop ||
        out_valid_o[s][0] && $stable({out_end_o[s][0], out_record_o[s][0], out_subtile_o[s][0]}))
    else $error("flk_delivery: output changed before its transfer");
`endif
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      finished_q <= '0;
    end else begin
      finished_q <= stop ? '0 : finished_i;
    end
  end

  assign idle_o = cache_idle && e_valid_q == '0 && (&queue_empty);

endmodule
