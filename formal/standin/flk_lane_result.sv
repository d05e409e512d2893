// Stand-in of flk_lane_result: a pixel's value is left out.
module flk_lane_result
  import flk_pkg::*;
  import flk_lane_pkg::*;
#(
  parameter bit Registered = 1'b0
) (
  input  logic                   clk_i,
  input  logic                   take_i,
  input  logic [RESULT_BITS-1:0] s_i,
  input  logic [2:0][C_BITS-1:0] colour_i,
  output pixel_t                 pixel_o
);

  assign pixel_o = '0;

endmodule
