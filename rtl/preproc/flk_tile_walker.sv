// Tile walker of a lane: a splat's entries in the lists of its tiles (flicker.golden.front.reach).
//
// Entries come tile row by tile row, columns ascending, splats in their order. A splat that is
// empty, or whose bands hold nothing, has none. done_valid_o is high for a cycle when a splat is
// finished: in the cycle after its last entry was taken, or when it turned out to have no more.
// A splat stays at the input until its last band is on its way: in_ready_o depends combinationally
// on in_data_i, and no register holds it. box_i keeps still while idle_o is low.
// Throughput: a band every Interval cycles in (an empty splat counts as one), an entry a cycle out; a tile
// column between two bands' intervals and a tile row without entries cost a cycle each. At most Splats + 1
// begin in Latency + 3 cycles. Latency, from a tile row's last band to its first entry, Latency + 3. Outputs
// come from registers; in_ready_o does not depend on out_ready_i.
//
// What the band pipeline does not need lies in a memory until the splat's first tile row comes out;
// the pipeline stands while a tile row waits that has no place in the queue behind it.
module flk_tile_walker
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter int unsigned Interval = 1,   // of flk_splat_band
  parameter int unsigned Splats   = 32,  // that wait for their first tile row
  parameter int unsigned Rows     = 4    // of tiles that wait behind the pipeline
) (
  input  logic    clk_i,
  input  logic    rst_ni,
  input  logic    box_i,
  output logic    idle_o,
  // Splats
  input  logic    in_valid_i,
  output logic    in_ready_o,
  input  listed_t in_data_i,
  // Entries
  output logic    out_valid_o,
  input  logic    out_ready_i,
  output entry_t  out_data_o,
  output logic    done_valid_o
);

  localparam int unsigned Latency = splat_band_latency(Interval);

  // ---- bands into the pipeline ----------------------------------------------------------------------

  typedef struct packed {
    logic band;  // what the pipeline gives counts
    logic odd;   // it is a tile row's lower one
    logic last;  // of its splat
  } mark_t;

  typedef struct packed {
    logic [SEQ_BITS-1:0]    seq;
    logic [NUMBER_BITS-1:0] number;
    logic [23:0]            key;
    logic [7:0]             row;  // first tile row
  } splat_t;

  logic       en, phase_q, may_send, send, last_band;
  logic       sending_q;  // of the splat at the input some bands are on their way
  logic [8:0] band, band_q;
  logic       store_ready, splat_valid, splat_pop, store_empty;
  splat_t     splat_in, splat;

  assign band       = sending_q ? band_q : in_data_i.y0[11:3];
  assign last_band  = in_data_i.empty || band == in_data_i.y1[11:3];
  assign may_send   = en && !phase_q && (sending_q || store_ready);
  assign send       = in_valid_i && may_send;
  assign in_ready_o = may_send && last_band;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      sending_q <= 1'b0;
      phase_q   <= 1'b0;
    end else begin
      if (send) begin
        sending_q <= !last_band;
      end
      if (en) begin
        phase_q <= Interval == 2 && !phase_q;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (send) begin
      band_q <= band + 1'b1;
    end
  end

  assign splat_in = '{
    seq: in_data_i.seq, number: in_data_i.number, key: in_data_i.key, row: in_data_i.y0[11:4]
  };

  flk_sram_fifo #(
    .Width($bits(splat_t)),
    .Depth(Splats)
  ) i_splats (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (send && !sending_q),
    .in_ready_o (store_ready),
    .in_data_i  (splat_in),
    .out_valid_o(splat_valid),
    .out_ready_i(splat_pop),
    .out_data_o (splat),
    .empty_o    (store_empty)
  );

  // ---- the pipeline -------------------------------------------------------------------------------

  typedef struct packed {
    logic       empty;
    logic [8:0] first;  // column of sub-tiles
    logic [8:0] last;
  } interval_t;

  mark_t [Latency-1:0] mark_q;
  mark_t                          mark_in, mark;
  interval_t                      interval;

  assign mark_in = '{
    band: send && !in_data_i.empty, odd: band[0] && !in_data_i.empty, last: send && last_band
  };
  assign mark    = mark_q[Latency-1];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      mark_q <= '0;
    end else if (en) begin
      mark_q <= {mark_q[Latency-2:0], mark_in};
    end
  end

  flk_splat_band #(
    .Interval(Interval)
  ) i_band (
    .clk_i,
    .rst_ni,
    .en_i   (en),
    .phase_i(phase_q),
    .band_i (band),
    .box_i,
    .x_i    (in_data_i.x),
    .y_i    (in_data_i.y),
    .right_i(in_data_i.right),
    .x0_i   (in_data_i.x0),
    .x1_i   (in_data_i.x1),
    .y0_i   (in_data_i.y0),
    .y1_i   (in_data_i.y1),
    .l2_i   (in_data_i.l2),
    .i0_i   (in_data_i.i0),
    .kappa_i(in_data_i.kappa),
    .limit_i(in_data_i.limit),
    .empty_o(interval.empty),
    .first_o(interval.first),
    .last_o (interval.last)
  );

  // ---- two bands are a tile row -------------------------------------------------------------------

  typedef struct packed {
    logic      last;  // of its splat
    interval_t upper;
    interval_t lower;
  } row_t;

  localparam interval_t NONE = '{empty: 1'b1, default: '0};

  logic      upper_there_q;
  interval_t upper_q;
  logic      row_in_valid, row_in_ready, row_valid, row_pop;
  row_t      row_in, row;

  assign row_in_valid = mark.last || (mark.band && mark.odd);
  assign en           = !row_in_valid || row_in_ready;

  always_comb begin
    row_in = '{last: mark.last, upper: NONE, lower: NONE};
    if (mark.band && mark.odd) begin
      row_in.lower = interval;
      if (upper_there_q) begin
        row_in.upper = upper_q;
      end
    end else if (mark.band) begin
      row_in.upper = interval;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      upper_there_q <= 1'b0;
    end else if (en && (mark.band || mark.last)) begin
      upper_there_q <= !row_in_valid;
    end
  end

  always_ff @(posedge clk_i) begin
    if (en && mark.band) begin
      upper_q <= interval;
    end
  end

  logic unused_full, unused_empty;
  logic [$clog2(Rows+1)-1:0] unused_usage;

  flk_fifo #(
    .Width($bits(row_t)),
    .Depth(Rows)
  ) i_rows (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (row_in_valid),
    .in_ready_o (row_in_ready),
    .in_data_i  (row_in),
    .out_valid_o(row_valid),
    .out_ready_i(row_pop),
    .out_data_o (row),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (unused_empty)
  );

  // ---- columns of a tile row -----------------------------------------------------------------------

  logic       walk_q;         // a tile row is in work
  logic       first_q;        // it is the first of its splat
  row_t       row_q;
  logic [7:0] column_q, high_q;
  logic [7:0] tile_row, tile_row_q;
  logic [7:0] low, high;      // of the tile row that waits
  logic [3:0] mask;
  logic       last_column, last_tile, room, put, step;
  logic       out_valid_q, end_q, done_q;
  entry_t     out_q;

  always_comb begin
    low  = row.upper.first[8:1] < row.lower.first[8:1] ? row.upper.first[8:1]
                                                       : row.lower.first[8:1];
    high = row.upper.last[8:1] > row.lower.last[8:1] ? row.upper.last[8:1] : row.lower.last[8:1];
    if (row.upper.empty) begin
      low  = row.lower.first[8:1];
      high = row.lower.last[8:1];
    end else if (row.lower.empty) begin
      low  = row.upper.first[8:1];
      high = row.upper.last[8:1];
    end
  end

  function automatic logic inside_of(interval_t i, logic [8:0] column);
    return !i.empty && i.first <= column && column <= i.last;
  endfunction

  assign mask = {
    inside_of(row_q.lower, {column_q, 1'b1}), inside_of(row_q.lower, {column_q, 1'b0}),
    inside_of(row_q.upper, {column_q, 1'b1}), inside_of(row_q.upper, {column_q, 1'b0})
  };

  assign last_column = column_q == high_q || (row_q.upper.empty && row_q.lower.empty);
  assign last_tile   = last_column && row_q.last;
  assign room        = !out_valid_q || out_ready_i;
  assign put         = mask != '0 || last_tile;
  assign step        = walk_q && (!put || room);
  assign row_pop     = !walk_q || (step && last_column);
  assign splat_pop   = step && last_tile;
  assign tile_row    = first_q ? splat.row : tile_row_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      walk_q  <= 1'b0;
      first_q <= 1'b1;
    end else begin
      if (row_pop) begin
        walk_q <= row_valid;
      end
      if (step && last_column) begin
        first_q <= row_q.last;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (row_pop) begin
      row_q    <= row;
      column_q <= low;
      high_q   <= high;
    end else if (step) begin
      column_q <= column_q + 1'b1;
    end
    if (step && last_column) begin
      tile_row_q <= tile_row + 1'b1;
    end
  end

  // ---- output --------------------------------------------------------------------------------------

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      out_valid_q <= 1'b0;
      end_q       <= 1'b0;
      done_q      <= 1'b0;
    end else begin
      done_q <= end_q && room;
      if (room) begin
        out_valid_q <= step && mask != '0;
        end_q       <= step && last_tile;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (room && step) begin
      out_q <= '{
        seq: splat.seq, row: tile_row, column: column_q, key: splat.key, number: splat.number,
        mask: mask
      };
    end
  end

  assign out_valid_o  = out_valid_q;
  assign out_data_o   = out_q;
  assign done_valid_o = done_q;
  assign idle_o       = store_empty && !out_valid_q && !end_q && !done_q;

  logic unused_splat_valid;  // see the assertion
  assign unused_splat_valid = splat_valid;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      in_valid_i && !in_data_i.empty |-> in_data_i.x0 <= in_data_i.x1 &&
                                         in_data_i.y0 <= in_data_i.y1)
  else $error("flk_tile_walker: a splat without pixels that is not empty");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      in_valid_i && !in_ready_o |=> in_valid_i && $stable(in_data_i))
  else $error("flk_tile_walker: input changed before its transfer");

  assert property (@(posedge clk_i) disable iff (!rst_ni) !idle_o |=> idle_o || $stable(box_i))
  else $error("flk_tile_walker: kind of lists changed within a frame");

  // Written Latency cycles before its first tile row is in work, at least.
  assert property (@(posedge clk_i) disable iff (!rst_ni) walk_q |-> splat_valid)
  else $error("flk_tile_walker: a tile row without its splat");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_tile_walker: output changed before its transfer");
`endif

endmodule
