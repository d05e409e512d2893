// A record and a sub-tile to the numbers that masks and lanes share (docs/reference/lanes.md): what
// flicker.golden.lanes.setup.splat_setup says, for every pattern of bits.
//
// in  16 bytes as they lie in memory (docs/reference/front_end.md), and the sub-tile whose list they are in.
// out lane_splat_t: u and v in the middle of the sub-tile, saturated, their half slopes, unit 2^-PLACE;
//     -log2 of the opacity, colours.
// Mean to middle | two parts of each product, half slopes | whole, shifted | sum, saturate; opacity.
// Latency SETUP_STAGES, throughput 1 per cycle. All registers load while en_i is high and are not reset;
// the user knows what is valid. No combinational path from input to output.
//
// Distance. A mean is 20 bits times 4^e, and the middle of a sub-tile a multiple of 2^6 / 128 pixel. So
// their difference is one of 4^even, even = min(e, 3), and is kept without these zeros: 29 bits instead
// of 35, at most 2^27 + 2^16 in magnitude, so that a product with 10 bits is below 2^37.
// Shift. A shape number of exponent code exp is its 10 bits times 2^(exp - SHAPE_BIAS - SHAPE_MANTISSA),
// and the product is to have one bit below the unit, which rounds it (nearest, ties upwards):
// product 4^even 2^(exp - 31), that is (product << 6) >> (31 - exp + 2 (3 - even)). Exponent code 0 is 0.
// Half slopes: (10 bits << 6) >> (31 - exp), one bit below the unit too.
// Saturation. A product is only cut when it has been added: large ones may cancel. v is one product, of
// which the shift drops all that is above the result, as soon as it cannot come down any more.
module flk_splat_setup
  import flk_lane_pkg::*;
(
  input  logic              clk_i,
  input  logic              en_i,
  input  logic [127:0]      record_i,
  input  flk_pkg::subtile_t subtile_i,
  output lane_splat_t       splat_o
);

  localparam int unsigned STAGES = 4;  // registers below
  localparam int unsigned EXP_BITS = 5;  // of a shape number
  localparam int unsigned SIG_BITS = SHAPE_MANTISSA + 1;  // with the leading one
  localparam int unsigned EVEN_MAX = 3;  // pairs of zeros below the middle of a sub-tile
  localparam int unsigned DISTANCE_BITS = MEAN_BITS + 1 - 2 * EVEN_MAX;
  localparam int unsigned LOW_BITS = 15;  // of a distance, for the lower of two products
  localparam int unsigned HIGH_BITS = DISTANCE_BITS - 1 - LOW_BITS;  // below the sign
  localparam int unsigned PRODUCT_BITS = DISTANCE_BITS - 1 + SIG_BITS;
  localparam int unsigned WIDE_BITS = PRODUCT_BITS + 2 * EVEN_MAX;
  localparam int unsigned SHIFT_BITS = EXP_BITS + 1;
  localparam int unsigned FULL_BITS = SIG_BITS + 6;  // a half slope before its shift

  if (SETUP_STAGES != STAGES) begin : gen_check_stages
    $error("flk_splat_setup: SETUP_STAGES must be the number of registers here");
  end
  // The middle ends in half a pixel, 2^6 of 2^MEAN_FRACTION; shifts from 31 - exp on.
  if (MEAN_FRACTION != 2 * EVEN_MAX + 1 || flk_param_pkg::SUBTILE != 8
      || SHAPE_BIAS + SHAPE_MANTISSA + MEAN_FRACTION != PLACE + 2 ** EXP_BITS
      || FULL_BITS != SLOPE_BITS + 1) begin : gen_check_formats
    $error("flk_splat_setup: made for the formats of docs/reference/lanes.md");
  end

  // Fields that go along until they are needed.
  typedef struct packed {
    logic [2:0][COLOUR_BITS-1:0] colour;  // blue highest
    logic [7:0]                  opacity;
  } rest_t;

  // ---- Stage 1: mean to middle -------------------------------------------------------------------------

  logic [1:0][flk_param_pkg::SUBTILE_COORD_BITS-1:0] coord;  // x, y
  logic [1:0][1:0] even, even_q;
  logic [1:0][DISTANCE_BITS-1:0] distance, distance_q;
  logic [2:0][EXP_BITS-1:0] exp, exp_q;
  logic [2:0][SIG_BITS-1:0] sig, sig_q;  // with the leading one; 0 for exponent code 0
  logic negative1_q;
  rest_t rest_q;
  logic unused_spiky;

  assign coord = {subtile_i.row, subtile_i.col};
  assign unused_spiky = record_i[127];

  for (genvar k = 0; k < 2; k++) begin : gen_mean
    logic [2:0] scale, beyond;
    logic signed [MEAN_FIELD_BITS-1:0] number;
    logic [DISTANCE_BITS-1:0] middle, mean;

    assign {scale, number} = record_i[23*k+:23];
    assign even[k] = scale[2] ? 2'(EVEN_MAX) : scale[1:0];
    assign beyond  = scale - 3'(even[k]);
    // The middle is 8 coord + 3.5 pixels: 7 in units of half a pixel behind the coordinate.
    assign middle  = DISTANCE_BITS'({coord[k], 4'd7}) << {2'(EVEN_MAX) - even[k], 1'b0};
    assign mean    = DISTANCE_BITS'(number) << {beyond, 1'b0};
    assign distance[k] = middle - mean;
  end

  for (genvar k = 0; k < 3; k++) begin : gen_shape
    localparam int unsigned At = (k == 2) ? 75 : 46 + 14 * k;
    assign exp[k] = record_i[At+SHAPE_MANTISSA+:EXP_BITS];
    assign sig[k] = {1'b1, record_i[At+:SHAPE_MANTISSA]} & {SIG_BITS{exp[k] != '0}};
  end

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      even_q      <= even;
      distance_q  <= distance;
      exp_q       <= exp;
      sig_q       <= sig;
      negative1_q <= record_i[74];
      rest_q      <= record_i[126:89];
    end
  end

  // ---- Stage 2: products, in two parts, and half slopes ------------------------------------------------

  logic [2:0][LOW_BITS+SIG_BITS-1:0] low, low_q;
  logic [2:0][HIGH_BITS+SIG_BITS-1:0] high, high_q;  // signed
  logic [2:0][SHIFT_BITS-1:0] shift, shift_q;
  logic [2:0][SLOPE_BITS:0] slope, slope_q;  // signed
  rest_t rest_product_q;

  for (genvar k = 0; k < 3; k++) begin : gen_product
    localparam int unsigned Axis = (k == 0) ? 0 : 1;
    logic negative, sign;
    logic [LOW_BITS-1:0] low_factor;
    logic [HIGH_BITS-1:0] high_factor;
    logic [SIG_BITS-1:0] off;
    logic signed [FULL_BITS:0] full, shifted;

    assign negative = (k == 1) && negative1_q;
    // A negative shape number takes the distance's complement, whose missing unit makes one more row;
    // what the sign takes off the upper part is added as inverted bits and a constant.
    assign {sign, high_factor, low_factor} = distance_q[Axis] ^ {DISTANCE_BITS{negative}};
    assign off     = ~(sig_q[k] & {SIG_BITS{sign}});
    assign low[k]  = (LOW_BITS + SIG_BITS)'(low_factor) * (LOW_BITS + SIG_BITS)'(sig_q[k])
                   + (LOW_BITS + SIG_BITS)'(sig_q[k] & {SIG_BITS{negative}});
    assign high[k] = (HIGH_BITS + SIG_BITS)'(high_factor) * (HIGH_BITS + SIG_BITS)'(sig_q[k])
                   + {off, HIGH_BITS'(0)} + ((HIGH_BITS + SIG_BITS)'(1) << HIGH_BITS);
    assign shift[k] = {1'b0, ~exp_q[k]} + SHIFT_BITS'({~even_q[Axis], 1'b0});

    assign full     = {negative ? -(SIG_BITS + 1)'(sig_q[k]) : (SIG_BITS + 1)'(sig_q[k]), 6'd0};
    assign shifted  = full >>> ~exp_q[k];
    assign slope[k] = shifted[FULL_BITS:1] + (SLOPE_BITS + 1)'(shifted[0]);
  end

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      low_q          <= low;
      high_q         <= high;
      shift_q        <= shift;
      slope_q        <= slope;
      rest_product_q <= rest_q;
    end
  end

  // ---- Stage 3: to unit 2^-PLACE, one more bit below it ------------------------------------------------

  logic [2:0][WIDE_BITS-1:0] product;
  logic signed [1:0][WIDE_BITS-1:0] wide, wide_q;
  logic [MIDDLE_BITS:0] deep, deep_q;
  logic over, over_q, sign_q;
  logic [2:0][SLOPE_BITS:0] slope_wide_q;
  rest_t rest_wide_q;

  for (genvar k = 0; k < 3; k++) begin : gen_whole
    assign product[k] = {
      high_q[k] + (HIGH_BITS + SIG_BITS)'(low_q[k][LOW_BITS+:SIG_BITS]),
      low_q[k][LOW_BITS-1:0], {(2 * EVEN_MAX) {1'b0}}
    };
  end
  for (genvar k = 0; k < 2; k++) begin : gen_wide
    assign wide[k] = $signed(product[k]) >>> shift_q[k];
  end

  // v is one product. Of what lies above all that can still come down to the bits of the result it
  // matters only whether it is more than the sign: then v saturates.
  logic sign;
  logic [WIDE_BITS-1:0] value;
  logic any, all;
  assign sign = product[2][WIDE_BITS-1];
  always_comb begin
    value = product[2];
    any   = 1'b0;
    all   = 1'b1;
    for (int unsigned n = SHIFT_BITS; n > 0; n--) begin
      if (shift_q[2][n-1]) begin
        value = $signed(value) >>> (1 << (n - 1));
      end
      for (int unsigned i = MIDDLE_BITS + (1 << (n - 1)); i < WIDE_BITS; i++) begin
        any      = any | value[i];
        all      = all & value[i];
        value[i] = sign;
      end
    end
    deep = value[MIDDLE_BITS:0];
    any  = any | value[MIDDLE_BITS];
    all  = all & value[MIDDLE_BITS];
  end
  assign over = sign ? !all : any;

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      wide_q       <= wide;
      deep_q       <= deep;
      over_q       <= over;
      sign_q       <= sign;
      slope_wide_q <= slope_q;
      rest_wide_q  <= rest_product_q;
    end
  end

  // ---- Stage 4: sum, saturate --------------------------------------------------------------------------

  localparam int unsigned TOP_BITS = WIDE_BITS - MIDDLE_BITS;

  logic [WIDE_BITS-1:0] first, second, left, carried;
  logic [MIDDLE_BITS-1:0] sum;
  logic [TOP_BITS-1:0] top;
  logic carry, zeros, ones, fits, sum_sign, unused_sum;
  logic [MIDDLE_BITS-1:0] rounded;
  logic rounded_over;
  lane_splat_t splat, splat_q;

  // Four numbers: two of them bits, of which one takes the place that half adders leave free, the other
  // is the carry.
  assign first   = {wide_q[0][WIDE_BITS-1], wide_q[0][WIDE_BITS-1:1]};
  assign second  = {wide_q[1][WIDE_BITS-1], wide_q[1][WIDE_BITS-1:1]};
  assign left    = first ^ second;
  assign carried = {first[WIDE_BITS-2:0] & second[WIDE_BITS-2:0], wide_q[0][0]};
  assign {carry, sum, unused_sum} = {1'b0, left[MIDDLE_BITS-1:0], 1'b1}
                                  + {1'b0, carried[MIDDLE_BITS-1:0], wide_q[1][0]};
  // What lies above must become nothing but copies of the sum's sign by the carry.
  assign top    = left[WIDE_BITS-1:MIDDLE_BITS] + carried[WIDE_BITS-1:MIDDLE_BITS];
  assign zeros  = top[TOP_BITS-1:1] == '0;
  assign ones   = top[TOP_BITS-1:1] == '1;
  assign fits = (sum[MIDDLE_BITS-1] != carry) ? ones && top[0]
                : carry ? ones && !top[0] : zeros && !top[0];
  assign sum_sign = top[TOP_BITS-1] && !(ones && top[0] && carry);

  assign rounded      = deep_q[MIDDLE_BITS:1] + MIDDLE_BITS'(deep_q[0]);
  assign rounded_over = over_q || (!sign_q && rounded[MIDDLE_BITS-1]);

  assign splat.w = fits ? sum : {sum_sign, {(MIDDLE_BITS - 1) {~sum_sign}}};
  assign splat.z = rounded_over ? {sign_q, {(MIDDLE_BITS - 1) {~sign_q}}} : rounded;
  assign splat.s0 = slope_wide_q[0][SLOPE_BITS-1:0];
  assign splat.s1 = slope_wide_q[1];
  assign splat.s2 = slope_wide_q[2][SLOPE_BITS-1:0];
  assign splat.lo = OPACITY_LOG[rest_wide_q.opacity];
  assign {splat.blue, splat.green, splat.red} = rest_wide_q.colour;

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      splat_q <= splat;
    end
  end

  assign splat_o = splat_q;

endmodule
