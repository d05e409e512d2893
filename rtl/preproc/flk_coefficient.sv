// Coefficient of a spherical harmonic in two's complement: of a chunk the whole number 2 code - zero_i; of FP16 its fixed point of 11 fraction bits,
// to the nearest, ties away from 0, saturated; 0 where it does not exist (flicker.golden.front.colour). Combinational.
module flk_coefficient (
  input  logic               chunked_i,
  input  logic               used_i,
  input  logic        [15:0] raw_i,
  input  logic        [ 8:0] zero_i,
  output logic signed [13:0] y_o
);

  logic sign;
  logic [4:0] exp;
  logic [10:0] sig;
  logic [3:0] shift;
  logic [13:0] field;  // the magnitude, and the bit below it
  logic [13:0] base, off;
  logic add;

  assign {sign, exp} = raw_i[15:10];
  // What is subnormal is less than half a unit.
  assign sig   = {1'b1, raw_i[9:0]} & {11{exp != '0}};
  assign shift = -exp[3:0];  // right, from 2 to 4
  assign field = {sig, 3'b0} >> shift;

  always_comb begin
    if (chunked_i) begin
      base = {5'b0, raw_i[7:0], 1'b0};
      off  = ~{5'b0, zero_i};
      add  = 1'b1;
    end else begin
      base = {1'b0, field[13:1]};
      add  = field[0] ^ sign;
      if (exp > 5'd16) begin
        base = 14'h1fff;
        add  = sign;
      end
      base = base ^ {14{sign}};
      off  = '0;
    end
  end

  assign y_o = $signed(used_i ? base + off + 14'(add) : '0);

endmodule
