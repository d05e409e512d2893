// Leading-zero counter: places from the top bit of value_i down to its highest bit that is set; Width if none is.
//
// Combinational.
module flk_lzc #(
  parameter  int unsigned Width     = 16,
  localparam int unsigned CountBits = $clog2(Width + 1)  // 0 to Width
) (
  input  logic [    Width-1:0] value_i,
  output logic [CountBits-1:0] count_o
);

  if (Width < 1) begin : gen_check_width
    $error("flk_lzc: Width must be at least 1");
  end

  // The last bit that is set in the order of the loop is the highest one.
  always_comb begin
    count_o = CountBits'(Width);
    for (int unsigned i = 0; i < Width; i++) begin
      if (value_i[i]) begin
        count_o = CountBits'(Width - 1 - i);
      end
    end
  end

endmodule
