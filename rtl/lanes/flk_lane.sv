// Lane: visits one pixel in every cycle, in the log domain (docs/reference/lanes.md). It has some pixels of each of its core's Subtiles sub-tiles;
// number of a pixel: sub-tile, then pixel of that sub-tile.
//
// in  a visit (visit_valid_i): pixel and shape of a splat, only pixels of its mask (flk_row_mask); or with visit_eos_i the end of the list,
//     when bank_free_o is high, with the sub-tile in the shape's low bits. The splat's colours are asked for behind STATE: colour_slot_o is
//     the visit's slot, colour_i its colours. visit_last_i, with a visit or without one: the lane needs the slot no more after that;
//     release_o says so in the cycle behind STATE, about colour_slot_o.
// out all Pixels of the list after its end, one per cycle, in order: sub-tile and place in it, S as far as the result needs it, and colours.
//
// | cycle | what |
// |---|---|
// | 0 | visit_* come |
// | 1 | u and v |
// | 2 | u² + v² - log2 o = La |
// | 3 | La is shifted to its line of h |
// | 4 | h(La) |
// | 5 = STATE | S of the pixel is read and written: blended, finished or skipped; La + S |
// | 6 | mantissa of 2^-(La + S) |
// | 7 | its products with the colours |
// | 8 = COLOUR | are shifted; colours of the pixel are read and written |
//
// In a lane of several sub-tiles h comes in cycle 5 and all behind it is a cycle later: a memory of an FPGA, which has the lines, needs cycle 4.
//
// The loops of S and of the colours are one cycle long, so the same pixel may be visited in every cycle. A token moves S at STATE and the
// colours at COLOUR into the bank that leaves, and sets all pixels to S = 0, black, unfinished; visits of the next list may follow at once.
// Pixels of one sub-tile, few, are flip-flops, which a token copies and sets. Those of more are two memories each of S and of colours, with a
// write port and a read port without latency, whose address is a register: in turn one has the pixels that are visited, one those that
// leave. A visit's are read a cycle before STATE and COLOUR, or are what is written then; S is written a cycle after STATE, so that no memory
// waits for what STATE decides. What a word held before counts as 0 until it is written: seen_q.
// Which pixels are a lane's: flk_lane_pkg, lane_column and lane_row.
// out_start_o: out_valid_o is high in the next cycle, unless clear_i is. out_last_o: the pixel at the output is the list's last.
// clear_i: visits, tokens, releases and the bank are dropped and all pixels set. token_o: a token is on its way to STATE, finished_o does not belong
// to what is visited now; token_done_o: it is there. events_o is a cycle later than STATE, and what it says stands whatever
// clear_i does. All outputs come from registers, out_data_o by a multiplexer.
// Source: docs/reference/lanes.md; the rules of 3D Gaussian Splatting's rasterizer in logarithms.
module flk_lane
  import flk_pkg::*;
  import flk_lane_pkg::*;
#(
  parameter  int unsigned Lanes    = 8,  // of the core: 4, 8, 16 or 32
  parameter  int unsigned Lane     = 0,
  parameter  int unsigned Slots    = 20,
  parameter  int unsigned Subtiles = 1,  // of the core: 1, 2 or 4
  localparam int unsigned Pixels   = Subtiles * 64 / Lanes,
  localparam int unsigned PixelW   = $clog2(Pixels),
  localparam int unsigned SlotW    = $clog2(Slots)
) (
  input  logic                        clk_i,
  input  logic                        rst_ni,
  input  logic                        clear_i,
  // visits
  input  logic                        visit_valid_i,
  input  logic                        visit_eos_i,
  input  logic                        visit_last_i,
  input  logic           [PixelW-1:0] visit_pixel_i,
  input  logic            [SlotW-1:0] visit_slot_i,
  input  lane_shape_t                 visit_shape_i,
  output logic            [SlotW-1:0] colour_slot_o,
  input  lane_colour_t                colour_i,
  output logic                        release_o,
  output logic                        bank_free_o,
  output logic                        token_o,
  output logic                        token_done_o,
  output logic           [Pixels-1:0] finished_o,
  // finished pixels
  output logic                        out_valid_o,
  input  logic                        out_ready_i,
  output lane_pixel_t                 out_data_o,
  output logic                        out_start_o,
  output logic                        out_last_o,
  // counters
  output lane_events_t                events_o
);

  if (Lanes != 4 && Lanes != 8 && Lanes != 16 && Lanes != 32) begin : gen_check_lanes
    $error("flk_lane: Lanes must be 4, 8, 16 or 32");
  end
  if (Subtiles != 1 && Subtiles != 2 && Subtiles != 4) begin : gen_check_subtiles
    $error("flk_lane: Subtiles must be 1, 2 or 4");
  end
  if (Lane >= Lanes) begin : gen_check_lane
    $error("flk_lane: Lane must be below Lanes");
  end

  localparam int unsigned Own = 64 / Lanes;  // pixels of a sub-tile
  localparam int unsigned OwnW = $clog2(Own);
  localparam bit MEMORY = Subtiles > 1;  // of the pixels' state
  localparam int unsigned STATE = MEMORY ? 6 : 5;
  localparam int unsigned FETCH = STATE + 1;  // of the splat's colours
  localparam int unsigned COLOUR = STATE + 3;
  localparam int unsigned GUARD = PLACE - UV;
  localparam int unsigned WIDE = UV_BITS + GUARD;  // sums of u and v before they are rounded
  localparam int unsigned MAG_BITS = UV_BITS - 1;

  // ---- Control: index s holds what came s cycles ago ---------------------------------------------------------

  logic [STATE:1] valid_q;
  logic [COLOUR:1] eos_q;
  logic [FETCH:1] last_q;
  logic [COLOUR:STATE+1] blend_q;
  logic [COLOUR-1:1][PixelW-1:0] pixel_q;
  logic [FETCH:1][SlotW-1:0] slot_q;
  logic [Pixels-1:0] select_s_q;  // the pixel at STATE, one bit each
  logic [PixelW-1:0] place_d, place_q;  // the pixel that leaves

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= '0;
      eos_q   <= '0;
      last_q  <= '0;
    end else if (clear_i) begin
      valid_q <= '0;
      eos_q   <= '0;
      last_q  <= '0;
    end else begin
      last_q  <= {last_q[FETCH-1:1], visit_last_i};
      valid_q <= {valid_q[STATE-1:1], visit_valid_i && !visit_eos_i};
      eos_q   <= {eos_q[COLOUR-1:1], visit_valid_i && visit_eos_i};
    end
  end

  always_ff @(posedge clk_i) begin
    pixel_q    <= {pixel_q[COLOUR-2:1], visit_pixel_i};
    slot_q     <= {slot_q[FETCH-1:1], visit_slot_i};
    select_s_q <= Pixels'(1) << pixel_q[STATE-1];
  end

  assign token_o       = |eos_q[STATE:1];
  assign token_done_o  = eos_q[STATE];
  assign colour_slot_o = slot_q[FETCH];
  assign release_o     = last_q[FETCH];

  // ---- Cycle 1: u and v ----------------------------------------------------------------------------------------

  // The splat at the pixel's place: column and row, each an odd multiple -7 to 7 of a half slope. Such a multiple is +-4 +-2 +-1, the signs being
  // the bits of the column: 2 i - 7 = sum of 2^k (2 i_k - 1). A negative term is the inverted slope shifted, 2^k too small; all that is
  // missing is 7 - i, which is added with the half unit of rounding.
  lane_shape_t shape_q;
  logic [2:0] column, row, column_q, row_q;
  logic [WIDE-1:0] u_wide, v_wide;
  logic unused_wide;

  always_comb begin
    column = '0;
    row    = '0;
    for (int unsigned p = 0; p < Own; p++) begin
      if (visit_pixel_i[OwnW-1:0] == OwnW'(p)) begin
        column = lane_column(Lanes, Lane, p);
        row    = lane_row(Lanes, Lane, p);
      end
    end
  end

  // Between visits what is read from memories stands still.
  always_ff @(posedge clk_i) begin
    if (MEMORY || visit_valid_i) begin
      shape_q  <= visit_shape_i;
      column_q <= column;
      row_q    <= row;
    end
  end

  function automatic logic [WIDE-1:0] term(logic [WIDE-1:0] slope, logic positive,
                                           int unsigned k);
    return (slope ^ {WIDE{!positive}}) << k;
  endfunction

  localparam int unsigned HALF = 1 << (GUARD - 1);
  logic [4:0] off_u, off_v;
  logic [WIDE-1:0] s0, s1, s2;

  assign off_u = 5'(HALF + 14) - 5'(column_q) - 5'(row_q);
  assign off_v = 5'(HALF + 7) - 5'(row_q);
  assign s0 = WIDE'(shape_q.s0);
  assign s1 = WIDE'(signed'(shape_q.s1));
  assign s2 = WIDE'(shape_q.s2);

  assign u_wide = shape_q.w + WIDE'(off_u)
      + term(s0, column_q[0], 0) + term(s0, column_q[1], 1) + term(s0, column_q[2], 2)
      + term(s1, row_q[0], 0) + term(s1, row_q[1], 1) + term(s1, row_q[2], 2);
  assign v_wide = shape_q.z + WIDE'(off_v)
      + term(s2, row_q[0], 0) + term(s2, row_q[1], 1) + term(s2, row_q[2], 2);
  assign unused_wide = ^{u_wide[GUARD-1:0], v_wide[GUARD-1:0]};

  // ---- Cycle 2: La ---------------------------------------------------------------------------------------------

  localparam int unsigned DROP = 2 * UV - LOG;
  localparam int unsigned SQUARE_BITS = 2 * MAG_BITS;
  localparam int unsigned LA_WIDE = SQUARE_BITS + 2;

  logic [UV_BITS-1:0] u_q, v_q;
  logic [LA_BITS-1:0] lo_q;
  logic [LA_WIDE-1:0] la_wide;
  logic [LA_WIDE-DROP-1:0] la;
  logic unused_la;

  always_ff @(posedge clk_i) begin
    if (valid_q[1]) begin
      u_q  <= u_wide[WIDE-1:GUARD];
      v_q  <= v_wide[WIDE-1:GUARD];
      lo_q <= shape_q.lo;
    end
  end

  // Row i of a square: the products of digit i with itself and, twice, with the higher ones. Of a negative number the inverted digits m are
  // squared, which is 2 m + 1 too little: the last row.
  typedef logic [MAG_BITS:0][LA_WIDE-1:0] rows_t;

  function automatic rows_t square_rows(logic [UV_BITS-1:0] value);
    rows_t rows;
    logic negative;
    logic [MAG_BITS-1:0] m;
    negative = value[UV_BITS-1];
    m        = value[MAG_BITS-1:0] ^ {MAG_BITS{negative}};
    for (int unsigned i = 0; i < MAG_BITS; i++) begin
      rows[i] = m[i] ? (LA_WIDE'(m >> (i + 1)) << (2 * i + 2)) | (LA_WIDE'(1) << (2 * i)) : '0;
    end
    rows[MAG_BITS] = negative ? LA_WIDE'({m, 1'b1}) : '0;
    return rows;
  endfunction

  rows_t u_rows, v_rows;

  assign u_rows = square_rows(u_q);
  assign v_rows = square_rows(v_q);

  always_comb begin
    la_wide = LA_WIDE'({lo_q, DROP'(1 << (DROP - 1))});
    for (int unsigned i = 0; i <= MAG_BITS; i++) begin
      la_wide = la_wide + u_rows[i] + v_rows[i];
    end
  end

  assign la        = la_wide[LA_WIDE-1:DROP];
  assign unused_la = ^la_wide[DROP-1:0];

  // ---- Cycle 3: line of h --------------------------------------------------------------------------------------

  localparam int unsigned REST_BITS = LOG + 2 - PIECE_BITS;

  logic above_q;  // La has more bits
  logic [LA_BITS-1:0] la_q;
  logic [LA_BITS-2:0] normal;  // below the leading one
  logic [$clog2(LA_BITS+1)-1:0] zeros;
  logic [PIECE_BITS-1:0] piece;

  always_ff @(posedge clk_i) begin
    if (MEMORY || valid_q[2]) begin  // no enable behind the sum: what is summed stands still
      la_q    <= la[LA_BITS-1:0];
      above_q <= la[LA_WIDE-DROP-1:LA_BITS] != '0;
    end
  end

  flk_lzc #(
    .Width(LA_BITS)
  ) i_lzc (
    .value_i(la_q),
    .count_o(zeros)
  );

  assign normal = (LA_BITS - 1)'(la_q << zeros);
  assign piece  = normal[REST_BITS+:PIECE_BITS];

  // ---- Cycle 4, 5 where MEMORY: h ----------------------------------------------------------------------------------

  localparam int unsigned VALUE_BITS = $bits(H_VALUE[0][0]);
  localparam int unsigned FALL_BITS = $bits(H_FALL[0][0]);
  localparam int unsigned LINE_BITS = VALUE_BITS + REST_BITS;
  localparam int unsigned LINES = $size(H_VALUE) << PIECE_BITS;

  // A line's value where its piece ends, with the half unit of rounding, and its fall over the piece, by one number: so synthesisers see a
  // table, an FPGA's a memory whose read register value_q and fall_q are. h is that end + fall * what is left of the piece, added up in
  // rows: as begin - fall * what is behind it, a product, it is 3 FO4 longer in lanes of several sub-tiles.
  typedef logic [LINES-1:0][VALUE_BITS+FALL_BITS-1:0] lines_t;

  function automatic lines_t lines();
    for (int unsigned i = 0; i < LINES; i++) begin
      lines[i] = {H_VALUE[i>>PIECE_BITS][i%(1<<PIECE_BITS)] + VALUE_BITS'(1 << (LINE_GUARD - 1))
                      - VALUE_BITS'(H_FALL[i>>PIECE_BITS][i%(1<<PIECE_BITS)]),
                  H_FALL[i>>PIECE_BITS][i%(1<<PIECE_BITS)]};
    end
  endfunction

  localparam lines_t TABLE = lines();

  typedef struct packed {
    logic [REST_BITS-1:0] left;   // of the piece, less one
    logic [LA_BITS-1:0]   la;
    logic                 skip;
    logic                 clamp;  // what is skipped has no use for it
  } beside_t;

  logic [VALUE_BITS-1:0] value_q, value;  // value, fall, beside: of the visit before STATE
  logic [FALL_BITS-1:0] fall_q, fall;
  beside_t beside_q, beside;
  logic [LINE_BITS-1:0] line;
  logic unused_line;

  always_ff @(posedge clk_i) begin
    if (valid_q[3]) begin
      {value_q, fall_q} <= TABLE[{zeros, piece}];
      beside_q.left  <= ~normal[REST_BITS-1:0];
      beside_q.la    <= la_q;
      beside_q.skip  <= above_q || la_q > LA_BITS'(LIMIT);
      beside_q.clamp <= la_q <= LA_BITS'(CLAMP);
    end
  end

  if (MEMORY) begin : gen_beside
    logic [VALUE_BITS-1:0] value_5_q;
    logic [FALL_BITS-1:0] fall_5_q;
    beside_t beside_5_q;

    always_ff @(posedge clk_i) begin
      value_5_q  <= value_q;
      fall_5_q   <= fall_q;
      beside_5_q <= beside_q;
    end

    assign value  = value_5_q;
    assign fall   = fall_5_q;
    assign beside = beside_5_q;
  end else begin : gen_beside
    assign value  = value_q;
    assign fall   = fall_q;
    assign beside = beside_q;
  end

  always_comb begin
    line = {value, {REST_BITS{1'b0}}} + LINE_BITS'(fall);
    for (int unsigned i = 0; i < REST_BITS; i++) begin
      line = line + (beside.left[i] ? LINE_BITS'(fall) << i : '0);
    end
  end

  assign unused_line = ^line;

  // ---- STATE: transmittance ----------------------------------------------------------------------------------------

  localparam int unsigned X_BITS = LA_BITS + SUM - LOG;
  localparam int unsigned TOTAL_BITS = EXPONENT_BITS + SUM;

  logic [H_BITS-1:0] h_q;
  logic [X_BITS-1:0] x_q;
  logic skip_q;
  logic [Pixels-1:0] finished_q;
  logic [S_BITS-1:0] s_now;
  logic [RESULT_BITS-1:0] s_out;
  logic [S_BITS:0] s_next;
  logic [TOTAL_BITS-1:0] total;
  logic was_done, live, ends, blend, finish;
  logic unused_total;

  always_ff @(posedge clk_i) begin
    if (MEMORY || valid_q[STATE-1]) begin  // as in cycle 3
      h_q    <= line[REST_BITS+LINE_GUARD+:H_BITS];  // the constant, too, is a line
      x_q    <= beside.clamp ? X_BITS'(X_MAX) : {beside.la, {(SUM - LOG) {1'b0}}};
      skip_q <= beside.skip;
    end
  end

  assign was_done = |(finished_q & select_s_q);

  assign s_next = (S_BITS + 1)'(s_now) + (S_BITS + 1)'(h_q);
  assign total  = TOTAL_BITS'(s_now) + TOTAL_BITS'(x_q);

  if (MEMORY) begin : gen_ends
    // Beside the sum, not behind it: its carry, or that of it and the constant.
    localparam logic [S_BITS-1:0] REST = S_BITS'((1 << S_BITS) - 1 - S_MAX);
    logic [S_BITS-1:0] a, b, odd, two;
    logic [S_BITS:0] beyond;
    logic unused_beyond;

    assign a      = s_now;
    assign b      = S_BITS'(h_q);
    assign odd    = a ^ b ^ REST;
    assign two    = (a & b) | ((a | b) & REST);
    assign beyond = {1'b0, odd} + {two, 1'b0};
    assign ends   = s_next[S_BITS] || beyond[S_BITS];
    assign unused_beyond = ^beyond[S_BITS-1:0];
  end else begin : gen_ends
    assign ends = s_next > (S_BITS + 1)'(S_MAX);
  end

  assign live   = valid_q[STATE] && !skip_q && !was_done;
  assign blend  = live && !ends;
  assign finish = live && ends;
  assign unused_total = ^total[SUM-MANTISSA-1:0];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      finished_q <= '0;
    end else if (clear_i || eos_q[STATE]) begin
      finished_q <= '0;
    end else begin
      finished_q <= finished_q | (finish ? select_s_q : '0);
    end
  end

  logic was_seen, seen_out;  // the pixel at STATE, the pixel that leaves

  if (MEMORY) begin : gen_s
    logic bank_d, bank_q;  // that is visited
    logic [Pixels-1:0] select_late_q, seen_q, seen_d, seen_out_q;
    logic [1:0][PixelW-1:0] read_q;  // that each bank reads
    logic leaves_q;  // the pixel that leaves was seen
    logic [1:0][S_BITS-1:0] word;
    logic [S_BITS-1:0] s_q, written_q, stored;
    logic late_q;   // the pixel before STATE is that behind it, written now: take, if it blends
    logic twice_q;  // the pixel at STATE is the one behind it: own, if that blends
    logic seen, seen_s_q, take, own;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        bank_q <= 1'b0;
        seen_q <= '0;
      end else begin
        bank_q <= bank_d;
        seen_q <= (clear_i || eos_q[STATE]) ? '0 : seen_d;
      end
    end

    assign bank_d = bank_q ^ eos_q[STATE];
    assign seen_d = seen_q | (blend_q[STATE+1] ? select_late_q : '0);

    always_ff @(posedge clk_i) begin
      select_late_q <= select_s_q;
      if (eos_q[STATE]) begin
        seen_out_q <= seen_d;
      end
      leaves_q <= seen_out_q[place_d];
    end

    for (genvar b = 0; b < 2; b++) begin : gen_bank
      logic [S_BITS-1:0] storage_q[Pixels];

      always_ff @(posedge clk_i) begin
        if (blend_q[STATE+1] && bank_q == 1'(b)) begin
          storage_q[pixel_q[STATE+1]] <= written_q;
        end
      end

      always_ff @(posedge clk_i) begin
        read_q[b] <= (bank_d ^ eos_q[STATE-1]) == 1'(b) ? pixel_q[STATE-2] : place_d;
      end

      assign word[b] = storage_q[read_q[b]];
    end

    assign take   = late_q && blend_q[STATE+1];
    assign seen   = (seen_q[pixel_q[STATE-1]] || take) && !eos_q[STATE];
    assign stored = take ? written_q : word[bank_d];

    // No enable and no choice of many bits waits for blend.
    always_ff @(posedge clk_i) begin
      twice_q   <= pixel_q[STATE-1] == pixel_q[STATE];
      late_q    <= pixel_q[STATE-2] == pixel_q[STATE];
      seen_s_q  <= seen;
      s_q       <= stored & {S_BITS{seen}};
      written_q <= s_next[S_BITS-1:0];
    end

    assign own      = twice_q && blend_q[STATE+1];
    assign was_seen = seen_s_q || own;
    assign seen_out = leaves_q;
    assign s_now    = own ? written_q : s_q;
    assign s_out    = word[!bank_q][S_BITS-1-:RESULT_BITS] & {RESULT_BITS{seen_out}};
  end else begin : gen_s
    logic [Pixels-1:0][S_BITS-1:0] s_q;
    logic [Pixels-1:0][RESULT_BITS-1:0] s_out_q;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        s_q <= '0;
      end else if (clear_i || eos_q[STATE]) begin
        s_q <= '0;
      end else begin
        for (int unsigned p = 0; p < Pixels; p++) begin
          if (blend && select_s_q[p]) begin
            s_q[p] <= s_next[S_BITS-1:0];
          end
        end
      end
    end

    always_ff @(posedge clk_i) begin
      if (eos_q[STATE]) begin
        for (int unsigned p = 0; p < Pixels; p++) begin
          s_out_q[p] <= s_q[p][S_BITS-1-:RESULT_BITS];
        end
      end
    end

    always_comb begin
      s_now = '0;
      s_out = '0;
      for (int unsigned p = 0; p < Pixels; p++) begin
        s_now |= s_q[p] & {S_BITS{select_s_q[p]}};
        s_out |= s_out_q[p] & {RESULT_BITS{place_q == PixelW'(p)}};
      end
    end

    assign {was_seen, seen_out} = '0;
  end

  assign finished_o = finished_q;

  // Counted a cycle late, so that sums over lanes make no long path.
  lane_events_t events_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      events_q <= '0;
    end else begin
      events_q.visited  <= valid_q[STATE];
      events_q.skipped  <= valid_q[STATE] && skip_q;
      events_q.blended  <= blend;
      events_q.finished <= finish;
    end
  end

  assign events_o = events_q;

  // ---- STATE + 1 and STATE + 2: weight and its products with the colours -----------------------------------------------

  localparam int unsigned PRODUCT_BITS = MANTISSA + COLOUR_BITS;
  // Places from the product to the accumulator, but for the exponent and the place that rounds.
  localparam int unsigned SHIFT = MANTISSA + COLOUR_FRACTION - ACCUMULATOR - 1;
  localparam int unsigned PART_BITS = PRODUCT_BITS - SHIFT;
  localparam int unsigned FAR = (PART_BITS + 3) / 4;  // more than 4 FAR - 1 places leave nothing

  logic [MANTISSA-1:0] address_q, mantissa_q;
  logic [COLOUR-1:STATE+1][EXPONENT_BITS-1:0] exponent_q;
  logic [3:0] near_q;     // one bit: places below a multiple of four
  logic [FAR-1:0] far_q;  // one bit or none: that multiple
  lane_colour_t colour_q;
  logic [2:0][PRODUCT_BITS-1:0] product_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      blend_q <= '0;
    end else if (clear_i) begin
      blend_q <= '0;
    end else begin
      blend_q <= {blend_q[COLOUR-1:STATE+1], blend};
    end
  end

  always_ff @(posedge clk_i) begin
    exponent_q <= {exponent_q[STATE+1], total[TOTAL_BITS-1:SUM]};
    for (int unsigned k = 0; k < 4; k++) begin
      near_q[k] <= exponent_q[STATE+2][1:0] == 2'(k);
    end
    for (int unsigned k = 0; k < FAR; k++) begin
      far_q[k] <= exponent_q[STATE+2][EXPONENT_BITS-1:2] == (EXPONENT_BITS - 2)'(k);
    end
    address_q  <= total[SUM-1-:MANTISSA];
    mantissa_q <= {1'b1, EXP2[address_q]};
    colour_q   <= colour_i;
    for (int unsigned c = 0; c < 3; c++) begin
      product_q[c] <= PRODUCT_BITS'(mantissa_q) * PRODUCT_BITS'(colour_q[c]);
    end
  end

  // ---- COLOUR: colours ---------------------------------------------------------------------------------------------------

  logic [2:0][C_BITS-1:0] c_now, c_next, c_out;
  logic [2:0] unused_place;

  always_comb begin
    for (int unsigned c = 0; c < 3; c++) begin
      automatic logic [PART_BITS-1:0] near, part;  // with the place that rounds
      near = '0;
      part = '0;
      for (int unsigned k = 0; k < 4; k++) begin
        near |= PART_BITS'(product_q[c] >> (SHIFT + k)) & {PART_BITS{near_q[k]}};
      end
      for (int unsigned k = 0; k < FAR; k++) begin
        part |= (near >> (4 * k)) & {PART_BITS{far_q[k]}};
      end
      {c_next[c], unused_place[c]} = {c_now[c], 1'b1} + (C_BITS + 1)'(part);
    end
  end

  if (MEMORY) begin : gen_c
    logic bank_d, bank_q;
    logic [COLOUR-1:STATE+1] was_seen_q;
    logic [1:0][PixelW-1:0] read_q;
    logic [1:0][3*C_BITS-1:0] word;
    logic [3*C_BITS-1:0] c_q;
    logic [PixelW-1:0] at_q;  // the pixel at COLOUR
    logic again_q;            // the pixel before COLOUR is that one

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        bank_q <= 1'b0;
      end else begin
        bank_q <= bank_d;
      end
    end

    assign bank_d = bank_q ^ eos_q[COLOUR];

    always_ff @(posedge clk_i) begin
      was_seen_q <= {was_seen_q[COLOUR-2:STATE+1], was_seen};
      at_q       <= pixel_q[COLOUR-1];
      again_q    <= pixel_q[COLOUR-2] == pixel_q[COLOUR-1];
      c_q        <= again_q && blend_q[COLOUR] ? c_next
                    : word[bank_d] & {(3 * C_BITS) {was_seen_q[COLOUR-1]}};
    end

    for (genvar b = 0; b < 2; b++) begin : gen_bank
      logic [3*C_BITS-1:0] storage_q[Pixels];

      always_ff @(posedge clk_i) begin
        if (blend_q[COLOUR] && bank_q == 1'(b)) begin
          storage_q[at_q] <= c_next;
        end
      end

      always_ff @(posedge clk_i) begin
        read_q[b] <= (bank_d ^ eos_q[COLOUR-1]) == 1'(b) ? pixel_q[COLOUR-2] : place_d;
      end

      assign word[b] = storage_q[read_q[b]];
    end

    assign c_now = c_q;
    assign c_out = word[!bank_q] & {(3 * C_BITS) {seen_out}};
  end else begin : gen_c
    logic [Pixels-1:0] select_q;
    logic [Pixels-1:0][2:0][C_BITS-1:0] c_q, c_out_q;
    logic unused_seen;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        c_q <= '0;
      end else if (clear_i || eos_q[COLOUR]) begin
        c_q <= '0;
      end else begin
        for (int unsigned p = 0; p < Pixels; p++) begin
          if (blend_q[COLOUR] && select_q[p]) begin
            c_q[p] <= c_next;
          end
        end
      end
    end

    always_ff @(posedge clk_i) begin
      select_q <= Pixels'(1) << pixel_q[COLOUR-1];
      if (eos_q[COLOUR]) begin
        c_out_q <= c_q;
      end
    end

    always_comb begin
      c_now = '0;
      c_out = '0;
      for (int unsigned p = 0; p < Pixels; p++) begin
        c_now |= c_q[p] & {(3 * C_BITS) {select_q[p]}};
        c_out |= c_out_q[p] & {(3 * C_BITS) {place_q == PixelW'(p)}};
      end
    end

    assign unused_seen = was_seen ^ seen_out;
  end

  // ---- Bank that leaves --------------------------------------------------------------------------------------------

  logic bank_q, full_q;  // taken, and ready to leave
  subtile_t subtile_q;
  logic last;

  assign last = out_valid_o && out_ready_i && out_last_o;

  always_comb begin
    place_d = place_q;
    if (clear_i) begin
      place_d = '0;
    end else if (out_valid_o && out_ready_i) begin
      place_d = place_q + 1'b1;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      bank_q  <= 1'b0;
      full_q  <= 1'b0;
      place_q <= '0;
    end else begin
      place_q <= place_d;
      if (visit_valid_i && visit_eos_i) begin
        bank_q <= 1'b1;
      end else if (last) begin
        bank_q <= 1'b0;
      end
      if (eos_q[COLOUR]) begin
        full_q <= 1'b1;
      end else if (last) begin
        full_q <= 1'b0;
      end
      if (clear_i) begin
        bank_q <= 1'b0;
        full_q <= 1'b0;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (visit_valid_i && visit_eos_i) begin
      subtile_q <= visit_shape_i[$bits(subtile_t)-1:0];
    end
  end

  assign bank_free_o = !bank_q;
  assign out_valid_o = full_q;
  assign out_start_o = eos_q[COLOUR];
  assign out_last_o  = place_q == '1;

  always_comb begin
    out_data_o.column  = lane_column(Lanes, Lane, 32'(place_q[OwnW-1:0]));
    out_data_o.row     = lane_row(Lanes, Lane, 32'(place_q[OwnW-1:0]));
    out_data_o.s       = s_out;
    out_data_o.colour  = c_out;
    out_data_o.subtile = subtile_q;
    // The list's sub-tiles lie one below the other, or fill a tile.
    if (Subtiles == 2) begin
      out_data_o.subtile.row[0] = place_q[PixelW-1];
    end else if (Subtiles == 4) begin
      {out_data_o.subtile.row[0], out_data_o.subtile.col[0]} = 2'(place_q >> OwnW);
    end
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      visit_valid_i && visit_eos_i && !clear_i |-> bank_free_o)
  else $error("flk_lane: end of a list while its bank is taken");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_lane: pixel changed before its transfer");

  // What flk_row_mask lets through is nearer than 3: nothing is lost above UV_BITS.
  logic outside;
  assign outside = u_q[UV_BITS-1-:3] inside {3'b011, 3'b100}
                || v_q[UV_BITS-1-:3] inside {3'b011, 3'b100};
  assert property (@(posedge clk_i) disable iff (!rst_ni) valid_q[2] |-> !outside)
  else $error("flk_lane: a pixel outside of the splat's mask");

  // Weights of a pixel add up to little more than 1, colours are below 2.
  logic overflow;
  always_comb begin
    overflow = 1'b0;
    for (int unsigned c = 0; c < 3; c++) begin
      overflow |= c_next[c] < c_now[c];
    end
  end
  assert property (@(posedge clk_i) disable iff (!rst_ni) blend_q[COLOUR] |-> !overflow)
  else $error("flk_lane: a colour has overflowed");
`endif

endmodule
