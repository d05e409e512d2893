// Walk over the tiles of a picture: row by row from the top, from the left, each row of tiles an even number of them.
//
// start_i: the next tile is the first one. next_i: go on to the tile behind; after the last one done_o is high and tile_*_o mean
// nothing. columns_i (in pairs of tiles) and rows_i stay from start_i on; both are at least 1. No combinational path.
module flk_tile_walk #(
  parameter int unsigned CoordBits = 8
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 start_i,
  input  logic                 next_i,
  input  logic [CoordBits-1:0] pairs_i,  // of tiles in a row
  input  logic [CoordBits:0]   rows_i,
  output logic                 done_o,
  output logic [CoordBits-1:0] tile_x_o,
  output logic [CoordBits-1:0] tile_y_o
);

  logic                 done_q, last_column;
  logic [CoordBits-1:0] x_q, y_q;

  assign last_column = x_q[0] && CoordBits'(x_q[CoordBits-1:1]) + 1'b1 == pairs_i;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      done_q <= 1'b1;
      x_q    <= '0;
      y_q    <= '0;
    end else if (start_i) begin
      done_q <= 1'b0;
      x_q    <= '0;
      y_q    <= '0;
    end else if (next_i) begin
      x_q <= last_column ? '0 : x_q + 1'b1;
      if (last_column) begin
        y_q    <= y_q + 1'b1;
        done_q <= (CoordBits + 1)'(y_q) + 1'b1 == rows_i;
      end
    end
  end

  assign done_o   = done_q;
  assign tile_x_o = x_q;
  assign tile_y_o = y_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) next_i |-> !done_q)
  else $error("flk_tile_walk: a step behind the last tile");
`endif

endmodule
