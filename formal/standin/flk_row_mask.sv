// Stand-in of flk_row_mask: the mask is what the splat carries.
module flk_row_mask
  import flk_lane_pkg::*;
(
  input  logic        clk_i,
  input  logic        en_i,
  input  lane_splat_t splat_i,
  output logic [63:0] mask_o
);

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      mask_o <= {splat_i.z, splat_i.w};
    end
  end

endmodule
