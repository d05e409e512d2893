// Ff number times 2^shift_i, saturating; a result below 2^-126 is 0 (docs/reference/ff.md). Combinational.
module flk_ff_ldexp #(
  parameter  int unsigned ManBits   = 19,
  parameter  int unsigned ShiftBits = 10,  // with the sign
  localparam int unsigned Width     = 9 + ManBits
) (
  input  logic        [    Width-1:0] x_i,
  input  logic signed [ShiftBits-1:0] shift_i,
  output logic        [    Width-1:0] y_o
);

  if (ShiftBits < 2 || ShiftBits > 12) begin : gen_check
    $error("flk_ff_ldexp: ShiftBits must be 2 to 12");
  end

  localparam int unsigned ExpBits = (ShiftBits > 9 ? ShiftBits : 9) + 1;  // signed

  logic sign;
  logic [7:0] exp;
  logic [ManBits-1:0] man;
  logic signed [ExpBits-1:0] moved;

  assign {sign, exp, man} = x_i;
  assign moved = ExpBits'($signed({1'b0, exp})) + ExpBits'(shift_i);

  always_comb begin
    if (exp == '0 || moved <= 0) begin
      y_o = '0;
    end else if (moved > 254) begin
      y_o = {sign, 8'd254, {ManBits{1'b1}}};
    end else begin
      y_o = {sign, moved[7:0], man};
    end
  end

endmodule
