// Result of a pixel in FP16: transmittance T = 2^-S and colours (docs/reference/lanes.md).
//
// S comes with one place more than the table's address, for rounding, ties upwards; S = 0 gives exactly 1, and T is always a normal number.
// Colours are rounded to the nearest, ties to even; the least, 2^-ACCUMULATOR, is a normal number.
// Combinational, or Registered: pixel_o is that of the inputs of the last cycle with take_i; the register is behind the table, which an FPGA has as
// a memory then, and behind the count of leading zeros.
module flk_lane_result
  import flk_pkg::*;
  import flk_lane_pkg::*;
#(
  parameter bit Registered = 1'b0
) (
  input  logic                   clk_i,
  input  logic                   take_i,
  input  logic [RESULT_BITS-1:0] s_i,
  input  logic [2:0][C_BITS-1:0] colour_i,  // red is 2
  output pixel_t                 pixel_o
);

  localparam logic [15:0] HALF = 16'h3800;  // 0.5
  localparam int unsigned WHOLE_BITS = RESULT_BITS - 1 - RESULT_FRACTION;
  localparam int unsigned BIAS = 15;

  if (C_BITS < 12 || ACCUMULATOR > BIAS - 1) begin : gen_check
    $error("flk_lane_result: colours must have 12 bits or more, and no subnormal number");
  end

  localparam int unsigned ZeroBits = $clog2(C_BITS + 1);

  typedef struct packed {
    logic [WHOLE_BITS-1:0]        whole;
    logic [$bits(RESULT[0])-1:0]  result;  // of the fraction
    logic [2:0][C_BITS-1:0]       colour;
    logic [2:0][ZeroBits-1:0]     zeros;   // that lead
  } found_t;

  found_t found, from;

  if (Registered) begin : gen_register
    found_t found_q;

    always_ff @(posedge clk_i) begin
      if (take_i) begin
        found_q <= found;
      end
    end

    assign from = found_q;
  end else begin : gen_register
    logic unused_clock;

    assign from         = found;
    assign unused_clock = ^{clk_i, take_i};
  end

  // ---- Transmittance ---------------------------------------------------------------------------------------

  logic [RESULT_FRACTION-1:0] fraction;
  logic unused_place;

  assign {found.whole, fraction, unused_place} = s_i + 1'b1;
  assign found.result = RESULT[fraction];
  assign pixel_o.transmittance = HALF + 16'(from.result) - {1'b0, 5'(from.whole), 10'b0};

  // ---- Colours -----------------------------------------------------------------------------------------------

  localparam int unsigned LOWER = C_BITS - 12;  // places below the one that rounds

  fp16_t [2:0] rounded;

  assign found.colour = colour_i;

  for (genvar c = 0; c < 3; c++) begin : gen_colour
    logic [C_BITS-2:0] normal;  // below the leading one
    logic [4:0] exponent;
    logic up;

    flk_lzc #(
      .Width(C_BITS)
    ) i_lzc (
      .value_i(colour_i[c]),
      .count_o(found.zeros[c])
    );

    assign normal     = (C_BITS - 1)'(from.colour[c] << from.zeros[c]);
    assign exponent   = 5'(C_BITS - 1 + BIAS - ACCUMULATOR) - 5'(from.zeros[c]);
    assign up         = normal[LOWER] && (normal[LOWER+1] || normal[LOWER-1:0] != '0);
    assign rounded[c] = from.colour[c] == '0 ? '0
                        : {1'b0, exponent, normal[C_BITS-2-:10]} + 16'(up);
  end

  assign pixel_o.red   = rounded[2];
  assign pixel_o.green = rounded[1];
  assign pixel_o.blue  = rounded[0];

endmodule
