// Delivery: sorted entries of four sorting units to records at four cores (docs/delivery.md).
//
// Tile i of the walk comes from unit i mod 4 and goes through channel i mod 2: two tiles are delivered
// at a time. A channel takes an entry a cycle, looks its record up in the cache (flk_record_cache), and
// puts the record into the queue that it has at each core of the entry's mask; the end of a list goes
// to all four. A core takes from the two channels' queues in turn, tile by tile, so that cores may be
// a tile apart.
// Places in the queues are kept before a record is looked up: what is under way never waits, so that
// neither channel waits for the other's cores.
// finished_i of a core, a level, is about the tile whose elements it is taking, until it has taken its
// end; in the cycle after that it is about the next tile. Records of such a tile that are not in its
// queue yet do not come; an entry that no core wants is not looked up. When all four cores are finished
// with the tile that a channel takes from a unit, finish_o of that unit rises, until its end is taken.
// start_i (while idle_o) and clear_i (at any time) forget all, cached lines too; no entries may come,
// and out_ready_i must be low, until idle_o. error_o: the memory answered with an error; until then.
// Latency 9 for a record in the cache. in_ready_o depends on no input of the same cycle; out_valid_o
// and out_* come from registers through a multiplexer.
module flk_delivery #(
  parameter  int unsigned RecordBits = 128,
  parameter  int unsigned NumberBits = 24,
  parameter  int unsigned Queue      = 64,   // records, of each core and channel
  parameter  int unsigned Banks      = 4,    // of the cache
  parameter  int unsigned Sets       = 64,
  parameter  int unsigned Ways       = 4,
  parameter  int unsigned Depth      = 256,
  parameter  int unsigned Places     = 128,
  parameter  int unsigned AddrBits   = 40,
  parameter  int unsigned IdBits     = 4,
  parameter  int unsigned Id         = 0,
  localparam int unsigned Cores      = 4,
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
  input  logic [AddrBits-Shift-1:0]         record_base_i,  // in 32 bytes
  // Sorting units
  input  logic [3:0]                        in_valid_i,
  output logic [3:0]                        in_ready_o,
  input  logic [3:0]                        in_end_i,
  input  logic [3:0][NumberBits+Cores-1:0]  in_entry_i,
  output logic [3:0]                        finish_o,
  // Cores
  output logic [Cores-1:0]                  out_valid_o,
  input  logic [Cores-1:0]                  out_ready_i,
  output logic [Cores-1:0]                  out_end_o,
  output logic [Cores-1:0][RecordBits-1:0]  out_record_o,
  input  logic [Cores-1:0]                  finished_i,
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
  localparam int unsigned EndBits = $clog2(Queue + 2);

  if (Queue < 4) begin : gen_check_queue
    $error("flk_delivery: Queue must be at least 4");
  end

  typedef struct packed {
    logic             last;  // end of a list
    logic [Cores-1:0] mask;
  } what_t;

  logic stop;

  assign stop = start_i || clear_i;

  // ---- entries ----------------------------------------------------------------------------------------

  logic [1:0]                  unit_q;              // channel c takes from unit c + 2 unit_q
  logic [1:0]                  e_valid_q, e_move, e_ready, e_take, e_end_taken;
  what_t [1:0]                 e_q, what;
  logic [1:0][NumberBits-1:0]  e_record_q;
  logic [1:0][1:0]             e_unit;
  logic [1:0]                  nothing, room, look, look_ready;
  logic [1:0][Cores-1:0]       kept, fits, dropped;

  // Of a channel's queue at a core: free places that nobody has been promised; ends between the unit and the core, and
  // in the queue alone. The core is finished with the tile that it takes from the channel.
  logic [1:0][Cores-1:0][FillBits-1:0] places_q;
  logic [1:0][Cores-1:0][EndBits-1:0]  opened_q, ends_q;
  logic [1:0][Cores-1:0]               gone_q, unopened, unended;
  logic [1:0][Cores-1:0]               push, pop, pop_end;
  logic [Cores-1:0]                    turn_q;      // the channel that a core takes from
  logic                                ready_q;     // the cache is

  for (genvar c = 0; c < 2; c++) begin : gen_channel
    assign e_unit[c]      = {unit_q[c], 1'(c)};
    assign e_ready[c]     = ready_q && (!e_valid_q[c] || e_move[c]);
    assign e_take[c]      = in_valid_i[e_unit[c]] && e_ready[c];
    assign e_end_taken[c] = e_take[c] && in_end_i[e_unit[c]];

    // The element in the register is before all ends taken after it: those in opened_q are of earlier tiles, or its own.
    assign kept[c]    = e_q[c].last ? '1 : e_q[c].mask & ~(gone_q[c] & unopened[c]);
    assign nothing[c] = kept[c] == '0;
    assign room[c]    = (kept[c] & ~fits[c]) == '0;
    assign look[c]    = e_valid_q[c] && !nothing[c] && room[c] && !stop;
    assign e_move[c]  = e_valid_q[c] && (nothing[c] || (room[c] && look_ready[c]));
    assign what[c]    = '{last: e_q[c].last, mask: kept[c]};

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        unit_q[c]    <= 1'b0;
        e_valid_q[c] <= 1'b0;
      end else if (stop) begin
        unit_q[c]    <= 1'b0;
        e_valid_q[c] <= 1'b0;
      end else begin
        unit_q[c]    <= unit_q[c] ^ e_end_taken[c];
        e_valid_q[c] <= e_take[c] || (e_valid_q[c] && !e_move[c]);
      end
    end

    always_ff @(posedge clk_i) begin
      if (e_take[c]) begin
        e_q[c].last   <= in_end_i[e_unit[c]];
        e_q[c].mask   <= in_entry_i[e_unit[c]][Cores-1:0];
        e_record_q[c] <= in_entry_i[e_unit[c]][NumberBits+Cores-1:Cores];
      end
    end
  end

  // All cores are finished with the tile that a unit gives.
  logic [3:0] finish_q;

  for (genvar u = 0; u < 4; u++) begin : gen_unit
    assign in_ready_o[u] = e_ready[u%2] && unit_q[u%2] == 1'(u / 2);
    assign finish_o[u]   = finish_q[u];

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        finish_q[u] <= 1'b0;
      end else begin
        finish_q[u] <= !stop && (&(gone_q[u%2] & unopened[u%2])) && unit_q[u%2] == 1'(u / 2) &&
                       !e_end_taken[u%2];
      end
    end
  end

  // ---- records ----------------------------------------------------------------------------------------

  logic                        cache_idle;
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
    .record_base_i,
    .in_valid_i  (look),
    .in_ready_o  (look_ready),
    .in_skip_i   ({e_q[1].last, e_q[0].last}),
    .in_record_i (e_record_q),
    .in_tag_i    (what),
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

  logic [1:0][Cores-1:0]                   queue_valid, queue_end, queue_empty, unused_ready;
  logic [1:0][Cores-1:0][RecordBits-1:0]   queue_record;

  for (genvar c = 0; c < 2; c++) begin : gen_queues
    for (genvar s = 0; s < Cores; s++) begin : gen_core
      logic asked, end_in;

      assign unopened[c][s] = opened_q[c][s] == '0;
      assign unended[c][s]  = ends_q[c][s] == '0;
      assign fits[c][s]     = places_q[c][s] != '0;
      assign asked          = look[c] && look_ready[c] && kept[c][s];
      assign dropped[c][s]  = found_valid[c] && !found[c].last && found[c].mask[s] &&
                              gone_q[c][s] && unended[c][s];
      assign push[c][s]     = found_valid[c] && found[c].mask[s] && !dropped[c][s];
      assign end_in         = push[c][s] && found[c].last;
      assign pop[c][s]      = out_valid_o[s] && out_ready_i[s] && turn_q[s] == 1'(c);
      assign pop_end[c][s]  = pop[c][s] && queue_end[c][s];

      flk_sram_fifo #(
        .Width(RecordBits + 1),
        .Depth(Queue)
      ) i_queue (
        .clk_i,
        .rst_ni,
        .clear_i    (stop),
        .in_valid_i (push[c][s]),
        .in_ready_o (unused_ready[c][s]),  // a place has been kept
        .in_data_i  ({found[c].last, found_record[c]}),
        .out_valid_o(queue_valid[c][s]),
        .out_ready_i(out_ready_i[s] && turn_q[s] == 1'(c)),
        .out_data_o ({queue_end[c][s], queue_record[c][s]}),
        .empty_o    (queue_empty[c][s])
      );

      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          places_q[c][s] <= FillBits'(Queue);
          opened_q[c][s] <= '0;
          ends_q[c][s]   <= '0;
          gone_q[c][s]   <= 1'b0;
        end else if (stop) begin
          places_q[c][s] <= FillBits'(Queue);
          opened_q[c][s] <= '0;
          ends_q[c][s]   <= '0;
          gone_q[c][s]   <= 1'b0;
        end else begin
          places_q[c][s] <= places_q[c][s] - FillBits'(asked) + FillBits'(pop[c][s])
                            + FillBits'(dropped[c][s]);
          opened_q[c][s] <= opened_q[c][s] + EndBits'(e_end_taken[c]) - EndBits'(pop_end[c][s]);
          ends_q[c][s]   <= ends_q[c][s] + EndBits'(end_in) - EndBits'(pop_end[c][s]);
          gone_q[c][s]   <= finished_i[s] && turn_q[s] == 1'(c) && !pop_end[c][s];
        end
      end

`ifndef SYNTHESIS
      assert property (@(posedge clk_i) disable iff (!rst_ni)
          push[c][s] && !stop |-> unused_ready[c][s])
      else $error("flk_delivery: a record without a place");

      assert property (@(posedge clk_i) disable iff (!rst_ni)
          ends_q[c][s] <= opened_q[c][s] && 32'(places_q[c][s]) <= Queue)
      else $error("flk_delivery: ends or places");
`endif
    end
  end

  // ---- cores ------------------------------------------------------------------------------------------

  for (genvar s = 0; s < Cores; s++) begin : gen_out
    assign out_valid_o[s]  = queue_valid[turn_q[s]][s];
    assign out_end_o[s]    = queue_end[turn_q[s]][s];
    assign out_record_o[s] = queue_record[turn_q[s]][s];

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        turn_q[s] <= 1'b0;
      end else if (stop) begin
        turn_q[s] <= 1'b0;
      end else if (out_valid_o[s] && out_ready_i[s] && out_end_o[s]) begin
        turn_q[s] <= !turn_q[s];
      end
    end
  end

  assign idle_o = cache_idle && e_valid_q == '0 && (&queue_empty);

`ifndef SYNTHESIS
  for (genvar s = 0; s < Cores; s++) begin : gen_check
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        out_valid_o[s] && !out_ready_i[s] && !stop |=>
        out_valid_o[s] && $stable({out_end_o[s], out_record_o[s]}))
    else $error("flk_delivery: output changed before its transfer");
  end
`endif

endmodule
