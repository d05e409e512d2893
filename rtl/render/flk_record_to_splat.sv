// A record and a sub-tile to the splat that the rendering stage takes (docs/reference/record_to_splat.md).
//
// in  a record as it lies in memory (docs/reference/front_end.md), 16 bytes or with Form conic 32, and the sub-tile
//     whose list it is in; or with in_eos_i the end of that list, and no record.
// out splat_elem_t: FP16, the mean relative to the sub-tile, nearest and at most +-65504; or the end of
//     the list with the sub-tile in its low bits.
// Latency 3, throughput 1 per cycle. in_ready_o depends combinationally on out_ready_i; out_valid_o and
// out_elem_o come from registers. clear_i (synchronous) empties it.
// Source: FP16 records of means relative to the sub-tile are the paper's; the 16 bytes are the project's.
module flk_record_to_splat
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter  int unsigned Form       = FORM_FACTORED,
  localparam int unsigned RecordBits = (Form == FORM_FACTORED) ? 128 : 256
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  // Upstream
  input  logic                  in_valid_i,
  output logic                  in_ready_o,
  input  logic                  in_eos_i,
  input  logic [RecordBits-1:0] in_record_i,
  input  subtile_t              in_subtile_i,
  // Downstream
  output logic                  out_valid_o,
  input  logic                  out_ready_i,
  output splat_elem_t           out_elem_o
);

  if (Form != FORM_FACTORED && Form != FORM_CONIC) begin : gen_check_form
    $error("flk_record_to_splat: Form must be FORM_CONIC or FORM_FACTORED");
  end

  localparam int unsigned MEAN_FRACTION = 7;  // a mean's step is 1/128 pixel
  localparam int unsigned STEP_BITS = $clog2(SUBTILE) + MEAN_FRACTION;  // of a sub-tile
  localparam int unsigned AbsoluteBits = (Form == FORM_FACTORED) ? 34 : 32;
  localparam int unsigned RelativeBits = AbsoluteBits + 1;
  // A magnitude of more bits is at least 2^17 pixels, far beyond FP16.
  localparam int unsigned MAG_BITS = 24;
  // What is not the mean.
  localparam int unsigned RestBits = (Form == FORM_FACTORED) ? 82 : 113;

  // ---- Stage 1: means relative to the sub-tile --------------------------------------------------------

  logic signed [1:0][AbsoluteBits-1:0] absolute;  // x, y
  logic [1:0][SUBTILE_COORD_BITS-1:0] place;
  logic [RestBits-1:0] rest;

  typedef struct packed {
    logic                     eos;
    logic [RestBits-1:0]      rest;      // of an end of list: the sub-tile, lowest
    logic [1:0]               sign;
    logic [1:0]               beyond;    // of more than MAG_BITS
    logic [1:0][MAG_BITS-1:0] relative;  // low bits
  } relative_t;

  if (Form == FORM_FACTORED) begin : gen_factored_in
    // 20 bits in two's complement below 3 bits e: times 4^e.
    localparam int unsigned FIELD_BITS = 20;
    logic [1:0][2:0] scale;
    logic [1:0][FIELD_BITS-1:0] number;
    for (genvar k = 0; k < 2; k++) begin : gen_axis
      assign {scale[k], number[k]} = in_record_i[23*k+:23];
      assign absolute[k] = AbsoluteBits'(signed'(number[k])) << {scale[k], 1'b0};
    end
    assign rest = in_record_i[127:46];
  end else begin : gen_conic_in
    logic unused_record;
    assign absolute = in_record_i[63:0];
    assign rest = in_record_i[176:64];
    assign unused_record = ^in_record_i[RecordBits-1:177];
  end

  assign place = {in_subtile_i.row, in_subtile_i.col};

  relative_t relative_d, relative_q;

  always_comb begin
    relative_d.eos = in_eos_i;
    relative_d.rest = in_eos_i ? RestBits'(in_subtile_i) : rest;
    for (int k = 0; k < 2; k++) begin
      automatic logic [RelativeBits-1:0] relative =
          RelativeBits'(signed'(absolute[k])) - RelativeBits'({place[k], {STEP_BITS{1'b0}}});
      automatic logic [RelativeBits-1:MAG_BITS] above = relative[RelativeBits-1:MAG_BITS];
      relative_d.sign[k]     = relative[RelativeBits-1];
      relative_d.beyond[k]   = above != '0 && above != '1;
      relative_d.relative[k] = relative[MAG_BITS-1:0];
    end
  end

  logic relative_valid, relative_ready;

  flk_pipe_reg #(
    .Width($bits(relative_t))
  ) i_relative (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i,
    .in_ready_o,
    .in_data_i  (relative_d),
    .out_valid_o(relative_valid),
    .out_ready_i(relative_ready),
    .out_data_o (relative_q)
  );

  // ---- Stage 2: sign and magnitude ------------------------------------------------------------------

  typedef struct packed {
    logic                     eos;
    logic [RestBits-1:0]      rest;
    logic [1:0]               sign;
    logic [1:0][MAG_BITS-1:0] magnitude;
  } magnitude_t;

  magnitude_t magnitude_d, magnitude_q;

  always_comb begin
    magnitude_d.eos = relative_q.eos;
    magnitude_d.rest = relative_q.rest;
    magnitude_d.sign = relative_q.sign;
    for (int k = 0; k < 2; k++) begin
      automatic logic negative = relative_q.sign[k];
      automatic logic [MAG_BITS:0] magnitude =
          {1'b0, relative_q.relative[k] ^ {MAG_BITS{negative}}} + (MAG_BITS + 1)'(negative);
      automatic logic beyond = relative_q.beyond[k] || magnitude[MAG_BITS];
      magnitude_d.magnitude[k] = magnitude[MAG_BITS-1:0] | {MAG_BITS{beyond}};
    end
  end

  logic magnitude_valid, magnitude_ready;

  flk_pipe_reg #(
    .Width($bits(magnitude_t))
  ) i_magnitude (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (relative_valid),
    .in_ready_o (relative_ready),
    .in_data_i  (magnitude_d),
    .out_valid_o(magnitude_valid),
    .out_ready_i(magnitude_ready),
    .out_data_o (magnitude_q)
  );

  // ---- Stage 3: FP16 -------------------------------------------------------------------------------

  fp16_t [1:0] mean;

  for (genvar k = 0; k < 2; k++) begin : gen_mean
    flk_fixed_to_fp #(
      .MagBits (MAG_BITS),
      .FracBits(MEAN_FRACTION),
      .ExpBits (5),
      .ManBits (10),
      .Fn      (1'b0)
    ) i_mean (
      .sign_i(magnitude_q.sign[k]),
      .mag_i (magnitude_q.magnitude[k]),
      .dst_o (mean[k])
    );
  end

  splat_t splat;

  if (Form == FORM_FACTORED) begin : gen_factored_out
    typedef struct packed {
      logic            spiky;
      logic [2:0][9:0] colour;  // blue highest
      logic [7:0]      opacity;
      logic [13:0]     shape2;
      logic            negative1;
      logic [13:0]     shape1;
      logic [13:0]     shape0;
    } fields_t;

    fields_t fields;
    fp16_t [2:0] shape;
    fp16_t [2:0] colour;
    fp16_t opacity;

    assign fields = magnitude_q.rest;

    flk_shape_to_fp16 i_shape0 (
      .negative_i(1'b0),
      .code_i    (fields.shape0),
      .shape_o   (shape[0])
    );
    flk_shape_to_fp16 i_shape1 (
      .negative_i(fields.negative1),
      .code_i    (fields.shape1),
      .shape_o   (shape[1])
    );
    flk_shape_to_fp16 i_shape2 (
      .negative_i(1'b0),
      .code_i    (fields.shape2),
      .shape_o   (shape[2])
    );

    // code / 512 fits: below the code three zeros, which the format's ten bits of mantissa leave.
    for (genvar k = 0; k < 3; k++) begin : gen_colour
      flk_fixed_to_fp #(
        .MagBits (13),
        .FracBits(12),
        .ExpBits (5),
        .ManBits (10),
        .Fn      (1'b0)
      ) i_colour (
        .sign_i(1'b0),
        .mag_i ({fields.colour[k], 3'b000}),
        .dst_o (colour[k])
      );
    end

    flk_opacity_to_fp16 i_opacity (
      .code_i   (fields.opacity),
      .opacity_o(opacity)
    );

    assign splat.spiky           = fields.spiky;
    assign splat.feature.red     = colour[0];
    assign splat.feature.green   = colour[1];
    assign splat.feature.blue    = colour[2];
    assign splat.feature.opacity = opacity;
    assign splat.feature.shape2  = shape[2];
    assign splat.feature.shape1  = shape[1];
    assign splat.feature.shape0  = shape[0];
    assign splat.feature.mean_y  = mean[1];
    assign splat.feature.mean_x  = mean[0];
  end else begin : gen_conic_out
    // FP16 already; blue lies highest in the record, red in the splat.
    assign splat.spiky = magnitude_q.rest[112];
    assign {splat.feature.blue, splat.feature.green, splat.feature.red, splat.feature.opacity,
            splat.feature.shape2, splat.feature.shape1,
            splat.feature.shape0} = magnitude_q.rest[111:0];
    assign splat.feature.mean_y = mean[1];
    assign splat.feature.mean_x = mean[0];
  end

  splat_elem_t elem;

  assign elem.eos   = magnitude_q.eos;
  assign elem.splat = magnitude_q.eos
                    ? $bits(splat_t)'(magnitude_q.rest[$bits(subtile_t)-1:0]) : splat;

  flk_pipe_reg #(
    .Width(SPLAT_ELEM_BITS)
  ) i_elem (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (magnitude_valid),
    .in_ready_o (magnitude_ready),
    .in_data_i  (elem),
    .out_valid_o,
    .out_ready_i,
    .out_data_o (out_elem_o)
  );

endmodule
