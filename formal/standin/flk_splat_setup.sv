// Stand-in of flk_splat_setup: a record's low bits become the splat, so that every splat there is can come.
module flk_splat_setup
  import flk_lane_pkg::*;
(
  input  logic              clk_i,
  input  logic              en_i,
  input  logic [127:0]      record_i,
  input  flk_pkg::subtile_t subtile_i,
  output lane_splat_t       splat_o
);

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      splat_o    <= '0;
      splat_o.w  <= record_i[31:0];
      splat_o.z  <= record_i[63:32];
      splat_o.s0 <= record_i[65:64];
      splat_o.red <= record_i[65:64];
    end
  end

endmodule
