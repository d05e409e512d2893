// Mean of a record: 20 bits m in two's complement below 3 bits e, m 4^e for the smallest e that holds
// it, rounded to nearest, ties upwards (docs/reference/front_end.md). Combinational.
module flk_mean_field #(
  parameter int unsigned Bits = 31  // of a mean in 1/128 pixel, with the sign; at most 33
) (
  input  logic signed [Bits-1:0] x_i,
  output logic        [22:0]     field_o
);

  localparam int unsigned FIELD_BITS = 20;
  localparam int unsigned LAST = (Bits - FIELD_BITS + 1) / 2;  // largest e that may be needed

  if (Bits <= FIELD_BITS || LAST > 7) begin : gen_check
    $error("flk_mean_field: Bits must be 21 to 33");
  end

  always_comb begin
    field_o = '0;
    for (int unsigned k = 0; k <= LAST; k++) begin
      automatic int unsigned e = LAST - k;
      automatic logic signed [Bits:0] half = (Bits + 1)'((e == 0) ? 0 : 1 << (2 * e - 1));
      automatic logic signed [Bits:0] m = ((Bits + 1)'(x_i) + half) >>> (2 * e);
      if (e == LAST || m[Bits:FIELD_BITS-1] == '0 || &m[Bits:FIELD_BITS-1]) begin
        field_o = {3'(e), m[FIELD_BITS-1:0]};
      end
    end
  end

endmodule
