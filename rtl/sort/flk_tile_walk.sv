// Walk over the tiles of a picture, near each other in time what is near in the picture (docs/reference/rendering.md; golden/walk.py).
//
// Bands of eight rows, from the left and from the right in turn; in a band columns of pairs of tiles (an even column and the one right
// of it), the first one downward, then upward and downward in turn; in a column pairs with the left or the right tile first in turn,
// beginning with the one that the band comes from.
// start_i: the next tile is the first one. next_i: go on to the tile behind; after the last one done_o is high and tile_*_o mean
// nothing. border_o: sub-tiles of the tile (bit k: column k % 2, row k / 2) that touch the next tile (0) and the one behind it (1), where
// these are in the same column of pairs. pairs_i and rows_i stay from start_i on; both are at least 1. No combinational path.
module flk_tile_walk #(
  parameter  int unsigned CoordBits = 8,
  localparam int unsigned BandBits  = 3
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 start_i,
  input  logic                 next_i,
  input  logic [CoordBits-1:0] pairs_i,  // of tiles in a row
  input  logic [CoordBits:0]   rows_i,
  output logic                 done_o,
  output logic [CoordBits-1:0] tile_x_o,
  output logic [CoordBits-1:0] tile_y_o,
  output logic                 second_o,  // of its pair
  output logic [1:0][3:0]      border_o
);

  if (CoordBits <= BandBits) begin : gen_check
    $error("flk_tile_walk: CoordBits must be larger than %0d", BandBits);
  end

  // The band comes from the right; its column goes upward; the pair's second tile is due.
  logic                 done_q, right_q, up_q, second_q;
  logic                 half_q;  // tile of the pair
  logic [CoordBits-1:0] y_q;
  logic [CoordBits-2:0] pair_q;
  logic                 bottom, last_row, last_pair, last_band;
  logic [CoordBits:0]   end_row;

  // Of the band, which ends with the picture at the latest.
  assign bottom    = (&y_q[BandBits-1:0]) || (CoordBits + 1)'(y_q) + 1'b1 == rows_i;
  assign last_row  = up_q ? y_q[BandBits-1:0] == '0 : bottom;
  assign last_pair = right_q ? pair_q == '0 : CoordBits'(pair_q) + 1'b1 == pairs_i;
  assign end_row   = rows_i - 1'b1;
  assign last_band = {1'b0, y_q[CoordBits-1:BandBits], {BandBits{1'b1}}} >= end_row;

  logic last;  // tile of the picture

  assign last = second_q && last_row && last_pair && last_band;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      done_q <= 1'b1;
    end else if (start_i || (next_i && last)) begin
      done_q <= !start_i;
    end
  end

  always_ff @(posedge clk_i) begin
    if (start_i) begin
      right_q  <= 1'b0;
      up_q     <= 1'b0;
      second_q <= 1'b0;
      half_q   <= 1'b0;
      pair_q   <= '0;
      y_q      <= '0;
    end else if (next_i) begin
      second_q <= !second_q;
      if (!second_q) begin
        half_q <= !half_q;
      end else if (!last_row) begin
        // The next pair begins with the tile that this one ended with.
        y_q <= up_q ? y_q - 1'b1 : y_q + 1'b1;
      end else if (!last_pair) begin
        up_q   <= !up_q;
        half_q <= right_q;
        pair_q <= right_q ? pair_q - 1'b1 : pair_q + 1'b1;
      end else begin
        // The first row of the next band.
        right_q <= !right_q;
        up_q    <= 1'b0;
        half_q  <= !right_q;
        y_q     <= {y_q[CoordBits-1:BandBits] + 1'b1, BandBits'(0)};
      end
    end
  end

  assign done_o   = done_q;
  assign tile_x_o = {pair_q, half_q};
  assign tile_y_o = y_q;
  assign second_o = second_q;

  // The first tile of a pair has the second beside it, the second one the first of the next pair above or below.
  logic [3:0] side, row;

  assign side        = half_q ? 4'b0101 : 4'b1010;
  assign row         = up_q ? 4'b0011 : 4'b1100;
  assign border_o[0] = !second_q ? side : last_row ? '0 : row;
  assign border_o[1] = last_row ? '0 : side & row;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) next_i |-> !done_q)
  else $error("flk_tile_walk: a step behind the last tile");
`endif

endmodule
