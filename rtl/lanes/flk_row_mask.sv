// Mask of the pixels of a sub-tile in which a splat can pass the lane's test (docs/reference/lanes.md, Masks): what
// flicker.golden.lanes.mask.row_mask says. Bit 16 m + i of mask_o is pixel i of mini-tile m.
//
// Sums of all rows, cut | rest below the bound, shifted for the table | root, ends, comparisons.
// Latency ROW_MASK_STAGES, throughput 1 per cycle. All registers load while en_i is high and are not
// reset; the user knows what is valid. No combinational path from input to output.
//
// Sums are cut downwards to MASK_FRACTION bits: t = s + 1 and y in each row, of u and v; and a_k, k = 0
// to 3, of (2 k + 1) s0, with the bit cut_k: something was lost there.
//
// Rest. With D = 2 MASK_FRACTION - LOG the bound of an opacity, less one, is (LIMIT - lo) 2^D + 2^(D-1) - 1
// (opacity code 0: lo = LIMIT + 1, negative, no pixel). It is below 2^15, so that a V of more than 8 bits
// leaves the row empty whatever its square. What is summed is the complement of the rest, V^2 + ~bound: the
// row has pixels where that is negative.
//
// Columns. With the radius r, pixel i is set where c_i <= r - s, and not c_i <= -r - 3 - s. The column
// terms mirror each other: c_(4+k) = a_k >= 0 and, floors being floors, c_(3-k) = -a_k - cut_k <= 0. So
// c_i <= end, with M = end, or -1 - end where it is negative, is
//   end >= 0:  true on the left (i = 3 - k),   a_k <= M on the right (i = 4 + k);
//   end < 0:   a_k + cut_k > M on the left,    false on the right:
// one comparison for both, of a_k with a carry where the end is negative. a_k + 1 <= 896, so an M of more
// than 10 bits is larger than all.
module flk_row_mask
  import flk_lane_pkg::*;
(
  input  logic        clk_i,
  input  logic        en_i,
  input  lane_splat_t splat_i,
  output logic [63:0] mask_o
);

  localparam int unsigned STAGES = 3;  // registers below
  localparam int unsigned SIZE = flk_param_pkg::SUBTILE;
  localparam int unsigned HALF = SIZE / 2;
  localparam int unsigned CUT = PLACE - MASK_FRACTION;  // bits
  localparam int unsigned SUM_BITS = MIDDLE_BITS + 1;  // |w| + 7 s1 and roundings: below 2^20
  localparam int unsigned ROW_BITS = SUM_BITS - CUT;
  localparam int unsigned V_BITS = 8;
  localparam int unsigned A_BITS = SLOPE_BITS + 3 - CUT;
  localparam int unsigned DROP = 2 * MASK_FRACTION - LOG;
  localparam int unsigned BOUND_BITS = LA_BITS + 1 + DROP;  // signed
  localparam int unsigned REST_BITS = BOUND_BITS - 1;  // not negative
  localparam int unsigned RADIUS_BITS = V_BITS;

  if (ROW_MASK_STAGES != STAGES) begin : gen_check_stages
    $error("flk_row_mask: ROW_MASK_STAGES must be the number of registers here");
  end
  if (SIZE != 8 || DROP < 1 || A_BITS != 10 || REST_BITS != 15 || V_BITS + 2 > A_BITS
      || 2 * ROOT_PLACES + ROOT_BITS < REST_BITS) begin : gen_check_formats
    $error("flk_row_mask: made for the formats of docs/reference/lanes.md");
  end

  // ---- Stage 1: sums -----------------------------------------------------------------------------------

  // Odd multiples 1, 3, 5, 7 of the half slopes.
  logic [HALF-1:0][SLOPE_BITS+2:0] column, v_step;
  logic [SUM_BITS-1:0] s1;
  logic [HALF-1:0][SUM_BITS-1:0] u_step;  // signed
  logic [SUM_BITS-1:0] u_middle, v_middle;
  logic [SIZE-1:0][ROW_BITS-1:0] t, t_q;  // s + 1, signed
  logic [SIZE-1:0][V_BITS-1:0] v, v_q;
  logic [SIZE-1:0] far, far_q;  // V has more bits
  logic [HALF-1:0][A_BITS-1:0] a, a_q;
  logic [HALF-1:0] cut, cut_q;
  logic [LA_BITS-1:0] lo_q;
  logic unused_splat;

  assign unused_splat = ^{splat_i.red, splat_i.green, splat_i.blue};

  for (genvar k = 0; k < HALF; k++) begin : gen_multiple
    localparam int unsigned Odd = 2 * k + 1;
    assign column[k] = (SLOPE_BITS + 3)'(splat_i.s0) * (SLOPE_BITS + 3)'(Odd);
    assign v_step[k] = (SLOPE_BITS + 3)'(splat_i.s2) * (SLOPE_BITS + 3)'(Odd);
    assign {a[k], cut[k]} = {column[k][CUT+:A_BITS], |column[k][CUT-1:0]};
  end
  assign s1        = SUM_BITS'(splat_i.s1);
  assign u_step[0] = s1;
  assign u_step[1] = s1 + (s1 << 1);
  assign u_step[2] = s1 + (s1 << 2);
  assign u_step[3] = (s1 << 3) - s1;

  // Half a unit of u and v, so that they are rounded, and one of s.
  assign u_middle = SUM_BITS'(splat_i.w) + SUM_BITS'((1 << CUT) + (1 << (PLACE - UV - 1)));
  assign v_middle = SUM_BITS'(splat_i.z) + SUM_BITS'(1 << (PLACE - UV - 1));

  for (genvar j = 0; j < SIZE; j++) begin : gen_sums
    localparam int unsigned K = (j < HALF) ? HALF - 1 - j : j - HALF;
    logic [ROW_BITS-1:0] y, magnitude;
    logic [CUT-1:0] unused_u, unused_v;

    assign {t[j], unused_u} = (j < HALF) ? u_middle - u_step[K] : u_middle + u_step[K];
    assign {y, unused_v} = (j < HALF) ? v_middle - SUM_BITS'(v_step[K])
                         : v_middle + SUM_BITS'(v_step[K]);
    assign magnitude = y ^ {ROW_BITS{y[ROW_BITS-1]}};
    assign {far[j], v[j]} = {|magnitude[ROW_BITS-1:V_BITS], magnitude[V_BITS-1:0]};
  end

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      t_q   <= t;
      v_q   <= v;
      far_q <= far;
      a_q   <= a;
      cut_q <= cut;
      lo_q  <= splat_i.lo;
    end
  end

  // ---- Stage 2: rest, shifted --------------------------------------------------------------------------

  logic [LA_BITS:0] least;  // signed
  logic [BOUND_BITS:0] bound_off;  // complement of the bound less one
  logic [SIZE-1:0][ROW_BITS-1:0] t_late_q;
  logic [SIZE-1:0][ROOT_BITS-1:0] address, address_q;
  logic [SIZE-1:0][ROOT_PLACES:0] places, places_q;  // one of them
  logic [SIZE-1:0] empty, empty_q;
  logic [HALF-1:0][A_BITS-1:0] a_late_q;
  logic [HALF-1:0] cut_late_q;

  assign least     = (LA_BITS + 1)'(LIMIT) - (LA_BITS + 1)'(lo_q);
  assign bound_off = ~{least[LA_BITS], least, 1'b0, {(DROP - 1) {1'b1}}};

  for (genvar j = 0; j < SIZE; j++) begin : gen_rest
    logic [BOUND_BITS:0] square, off;
    logic [REST_BITS-1:0] rest;

    // A product of different bits occurs twice in a square.
    always_comb begin
      square = '0;
      for (int unsigned n = 0; n < V_BITS; n++) begin
        square = square + ((BOUND_BITS + 1)'(
          {v_q[j] >> (n + 1), 2'b01} & {(V_BITS + 2) {v_q[j][n]}}) << (2 * n));
      end
    end
    assign off      = square + bound_off;
    assign empty[j] = far_q[j] || !off[BOUND_BITS];
    assign rest     = ~off[REST_BITS-1:0];

    // An even number of places, until the address holds it.
    always_comb begin
      places[j]  = (ROOT_PLACES + 1)'(1);
      address[j] = rest[ROOT_BITS-1:0];
      for (int unsigned p = 1; p <= ROOT_PLACES; p++) begin
        if ((rest >> (2 * p + ROOT_BITS - 2)) != '0) begin
          places[j]  = (ROOT_PLACES + 1)'(1) << p;
          address[j] = ROOT_BITS'(rest >> (2 * p));
        end
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      t_late_q   <= t_q;
      address_q  <= address;
      places_q   <= places;
      empty_q    <= empty;
      a_late_q   <= a_q;
      cut_late_q <= cut_q;
    end
  end

  // ---- Stage 3: root, ends, comparisons ----------------------------------------------------------------

  logic [63:0] mask, mask_q;

  for (genvar j = 0; j < SIZE; j++) begin : gen_row
    logic [8:0] root;
    logic [RADIUS_BITS-1:0] radius;
    logic [1:0][ROW_BITS-1:0] last;  // low, high
    logic [1:0][SIZE-1:0] upto;  // columns up to the end

    assign root = ROOT[address_q[j]];
    always_comb begin
      radius = '0;
      for (int unsigned p = 0; p <= ROOT_PLACES; p++) begin
        radius = radius | (RADIUS_BITS'(root >> (ROOT_PLACES - p)) & {RADIUS_BITS{places_q[j][p]}});
      end
    end
    // The low end is the complement of r + 2 + s.
    assign last[0] = ~(ROW_BITS'(radius) + t_late_q[j] + ROW_BITS'(1));
    assign last[1] = ROW_BITS'(radius) - t_late_q[j] + ROW_BITS'(1);

    for (genvar e = 0; e < 2; e++) begin : gen_end
      logic negative, beyond;
      logic [ROW_BITS-2:0] magnitude;
      assign negative  = last[e][ROW_BITS-1];
      assign magnitude = last[e][ROW_BITS-2:0] ^ {(ROW_BITS - 1) {negative}};
      assign beyond    = |magnitude[ROW_BITS-2:A_BITS];
      for (genvar k = 0; k < HALF; k++) begin : gen_column
        logic [A_BITS:0] difference;
        logic more;
        // a + carry > M is a carry out of a + ~M + carry.
        assign difference = {1'b0, a_late_q[k]} + {1'b0, ~magnitude[A_BITS-1:0]}
                          + (A_BITS + 1)'(cut_late_q[k] && negative);
        assign more = difference[A_BITS] && !beyond;
        assign upto[e][HALF+k]   = !negative && !more;
        assign upto[e][HALF-1-k] = !negative || more;
      end
    end

    for (genvar i = 0; i < SIZE; i++) begin : gen_pixel
      localparam int unsigned Bit = j / HALF * 32 + i / HALF * 16 + j % HALF * 4 + i % HALF;
      assign mask[Bit] = upto[1][i] && !upto[0][i] && !empty_q[j];
    end
  end

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      mask_q <= mask;
    end
  end

  assign mask_o = mask_q;

endmodule
