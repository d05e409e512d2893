// Volume rendering unit (VRU): blends splats into its pixels, one pixel-Gaussian pair per cycle, FP16.
//
// Operations come in program order: `op_valid_i` with a splat and a pixel, or with `op_eos_i` (end of sub-tile). There is no
// back-pressure on operations, except that a token may only come while `eos_ready_o` is high.
// A splat's pixels come in order, 0 to Pixels - 1, with op_feature_i held from the first to the last. So a pixel returns after Pixels
// operations at the soonest, and the read-modify-write loops of transmittance and colour take 4 cycles each (flk_pixel_state); a splat may
// be broken off only when all pixels of the mini-tile are finished.
//
// | cycles, conic | factored | what | where |
// |---|---|---|---|
// | 1 | 1 | pixel and mean | here |
// | 3 | 3 | dx, dy | here |
// | 10 | 9 | E | flk_weight |
// | 8 | 7 | alpha = min(o g, 0.99), g = e^-E or 2^-E; alpha >= 1/255? 1 - alpha | flk_blend_pipe; the pixel's T is read: OMA |
// | 2 | 2 | T (1 - alpha), w = T alpha | |
// | 0 | 0 | BLEND: T (1 - alpha) >= 1e-4? | T is written |
// | 2 | 2 | w colour | the pixel's C is read |
// | 2 | 2 | C + w colour | |
// | 0 | 0 | LAST | C is written |
//
// A token copies T (at BLEND) and C (at LAST) into the output buffer (flk_pixel_drain) and clears the pixel state: the next sub-tile's
// operations may follow at once; what they read before the token has cleared it counts as cleared. The buffer then leaves as a stream of
// pixels; the next token may come when it is empty.
// Colours are not negative: their sign bits are ignored.
//
// `clear_i` aborts, in one cycle: every operation and token inside is dropped, and the one that comes with it; pixels begin as after reset;
// the output buffer is empty and free. The next operation, a splat's first pixel or a token, may come in the cycle after. A pixel that is
// transferred in the cycle of `clear_i` itself still counts; nothing of what was inside appears later. Registers of the datapath keep what
// they hold, which no later operation reads.
module flk_vru
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter  int unsigned Form   = FORM_FACTORED,
  parameter  int unsigned Pixels = PIXELS_PER_VRU,  // 4, 8 or 16
  localparam int unsigned IndexW = $clog2(Pixels),
  // Which block of Pixels / 4 rows of the 8: 3 bits of row, less those that the pixel's index has.
  localparam int unsigned RowW   = 3 - (IndexW - 2)
) (
  input  logic              clk_i,
  input  logic              rst_ni,
  input  logic              clear_i,
  // Place in the sub-tile, constant: pixel i lies in column 4 col_i + i % 4, row (Pixels / 4) row_i + i / 4.
  input  logic              col_i,
  input  logic [RowW-1:0]   row_i,
  // operations
  input  logic              op_valid_i,
  input  logic              op_eos_i,
  input  logic [IndexW-1:0] op_pixel_i,
  input  feature_t          op_feature_i,
  output logic              eos_ready_o,
  // state of the sub-tile at BLEND
  output logic              blend_valid_o,  // an operation is at BLEND
  output logic [IndexW-1:0] blend_pixel_o,
  output logic              blend_eos_o,    // a token is at BLEND
  output logic [Pixels-1:0] finished_o,     // before the operation at BLEND
  output logic              finish_o,       // the operation at BLEND finishes its pixel
  // finished pixels
  output logic              out_valid_o,
  input  logic              out_ready_i,
  output logic [IndexW-1:0] out_index_o,
  output pixel_t            out_pixel_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_vru: Form must be FORM_CONIC or FORM_FACTORED");
  end
  if (Pixels != 4 && Pixels != 8 && Pixels != 16) begin : gen_check_pixels
    $error("flk_vru: Pixels must be 4, 8 or 16");
  end

  // Cycles after the operation at which a value is in its register.
  localparam int unsigned DIFF = 1 + FP16_ADD_STAGES;
  localparam int unsigned WEIGHT = DIFF + 32'(WEIGHT_LATENCY[Form][1]);
  localparam int unsigned POWER = WEIGHT + 32'(EXP_STAGES[Form]);
  localparam int unsigned ALPHA = POWER + FP16_MUL_STAGES + 1;
  localparam int unsigned OMA = ALPHA + FP16_ADD_STAGES;
  localparam int unsigned BLEND = OMA + FP16_MUL_STAGES;

  // ---- Control pipeline up to the read of T: index s holds what came s cycles ago ------------------------

  localparam int unsigned READ = OMA - 1;

  logic [READ:1] valid_q, eos_q;
  logic [READ:1][IndexW-1:0] pixel_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= '0;
      eos_q   <= '0;
    end else if (clear_i) begin
      valid_q <= '0;
      eos_q   <= '0;
    end else begin
      valid_q <= {valid_q[READ-1:1], op_valid_i && !op_eos_i};
      eos_q   <= {eos_q[READ-1:1], op_valid_i && op_eos_i};
    end
  end

  always_ff @(posedge clk_i) begin
    pixel_q <= {pixel_q[READ-1:1], op_pixel_i};
  end

  // ---- A splat's numbers, each held for all pixels where it is needed -----------------------------------

  // Loaded when the splat's first pixel comes to the cycle in which it is used. Numbers needed long after the operation go through
  // holders on the way, Pixels cycles apart: the next splat follows at that distance at the soonest.
  localparam int unsigned SHAPE_AT = DIFF + 32'(WEIGHT_SHAPE_DELAY[Form][1]);
  localparam int unsigned OPACITY_AT = POWER;
  localparam int unsigned COLOUR_AT = BLEND;
  localparam int unsigned SHAPE_HOLDERS = (SHAPE_AT - 1) / Pixels;
  localparam int unsigned OPACITY_HOLDERS = (OPACITY_AT - 1) / Pixels;
  localparam int unsigned COLOUR_HOLDERS = (COLOUR_AT - 1) / Pixels;

  logic [BLEND:2] first;  // the first pixel gets to cycle s at this edge
  logic [BLEND:READ+2] first_late;  // the same of the operations that flk_pixel_state has
  for (genvar s = 2; s <= BLEND; s++) begin : gen_first
    if (s <= READ + 1) begin : gen_here
      assign first[s] = valid_q[s-1] && (pixel_q[s-1] == '0);
    end else begin : gen_state
      assign first[s] = first_late[s];
    end
  end

  fp16_t mean_x_q, mean_y_q;
  logic [2:0][15:0] shape_q;
  fp16_t opacity_q;
  logic [2:0][14:0] colour_q;  // 0 red, 1 green, 2 blue
  // What comes to each holder, the last entry being what is loaded where it is used.
  logic [SHAPE_HOLDERS:0][2:0][15:0] shape;
  fp16_t [OPACITY_HOLDERS:0] opacity;
  logic [COLOUR_HOLDERS:0][2:0][14:0] colour;

  assign shape[0]   = {op_feature_i.shape2, op_feature_i.shape1, op_feature_i.shape0};
  assign opacity[0] = op_feature_i.opacity;
  assign colour[0]  = {op_feature_i.blue[14:0], op_feature_i.green[14:0], op_feature_i.red[14:0]};

  for (genvar k = 1; k <= SHAPE_HOLDERS; k++) begin : gen_shape
    logic [2:0][15:0] held_q;
    always_ff @(posedge clk_i) begin
      if (first[k*Pixels]) begin
        held_q <= shape[k-1];
      end
    end
    assign shape[k] = held_q;
  end
  for (genvar k = 1; k <= OPACITY_HOLDERS; k++) begin : gen_opacity
    fp16_t held_q;
    always_ff @(posedge clk_i) begin
      if (first[k*Pixels]) begin
        held_q <= opacity[k-1];
      end
    end
    assign opacity[k] = held_q;
  end
  for (genvar k = 1; k <= COLOUR_HOLDERS; k++) begin : gen_colour_held
    logic [2:0][14:0] held_q;
    always_ff @(posedge clk_i) begin
      if (first[k*Pixels]) begin
        held_q <= colour[k-1];
      end
    end
    assign colour[k] = held_q;
  end

  always_ff @(posedge clk_i) begin
    if (op_pixel_i == '0) begin
      mean_x_q <= op_feature_i.mean_x;
      mean_y_q <= op_feature_i.mean_y;
    end
    if (first[SHAPE_AT]) begin
      shape_q <= shape[SHAPE_HOLDERS];
    end
    if (first[OPACITY_AT]) begin
      opacity_q <= opacity[OPACITY_HOLDERS];
    end
    if (first[COLOUR_AT]) begin
      colour_q <= colour[COLOUR_HOLDERS];
    end
  end

  // ---- Differences ---------------------------------------------------------------------------------------

  logic [2:0] place_x, place_y;  // in the sub-tile
  fp16_t dx_q, dy_q;

  assign {place_y, place_x[1:0]} = {row_i, pixel_q[1]};
  assign place_x[2] = col_i;

  flk_fp_add_pipe #(.Stages(FP16_ADD_STAGES)) i_dx (
    .clk_i,
    .en_i (1'b1),
    .a_i  (PIXEL_FP16[place_x]),
    .b_i  ({~mean_x_q[15], mean_x_q[14:0]}),
    .sum_o(dx_q)
  );
  flk_fp_add_pipe #(.Stages(FP16_ADD_STAGES)) i_dy (
    .clk_i,
    .en_i (1'b1),
    .a_i  (PIXEL_FP16[place_y]),
    .b_i  ({~mean_y_q[15], mean_y_q[14:0]}),
    .sum_o(dy_q)
  );

  // ---- Weight, blending, state, output ---------------------------------------------------------------------

  fp16_t weight_q;
  logic [14:0] t_now_q, t_next_q;
  logic [2:0][14:0] c_now_q, c_next_q;
  logic contributes_q, ends, last_eos;
  logic [Pixels-1:0][14:0] t_all;
  logic [Pixels-1:0][2:0][14:0] c_all;

  flk_weight #(
    .Form(Form)
  ) i_weight (
    .clk_i,
    .en_i    (1'b1),
    .dx_i    (dx_q),
    .dy_i    (dy_q),
    .shape_i (shape_q),
    .weight_o(weight_q)
  );

  flk_blend_pipe #(
    .Form(Form)
  ) i_blend (
    .clk_i,
    .weight_i     (weight_q),
    .opacity_i    (opacity_q),
    .t_i          (t_now_q),
    .contributes_o(contributes_q),
    .ends_o       (ends),
    .t_next_o     (t_next_q),
    .colour_i     (colour_q),
    .c_i          (c_now_q),
    .c_next_o     (c_next_q)
  );

  flk_pixel_state #(
    .Pixels(Pixels)
  ) i_state (
    .clk_i,
    .rst_ni,
    .clear_i,
    .op_valid_i   (valid_q[READ] || eos_q[READ]),
    .op_eos_i     (eos_q[READ]),
    .op_pixel_i   (pixel_q[READ]),
    .first_o      (first_late),
    .t_o          (t_now_q),
    .contributes_i(contributes_q),
    .ends_i       (ends),
    .t_next_i     (t_next_q),
    .c_o          (c_now_q),
    .c_next_i     (c_next_q),
    .blend_valid_o,
    .blend_pixel_o,
    .blend_eos_o,
    .finished_o,
    .finish_o,
    .t_all_o      (t_all),
    .last_eos_o   (last_eos),
    .c_all_o      (c_all)
  );

  flk_pixel_drain #(
    .Pixels(Pixels)
  ) i_drain (
    .clk_i,
    .rst_ni,
    .clear_i,
    .token_i    (op_valid_i && op_eos_i),
    .ready_o    (eos_ready_o),
    .take_t_i   (blend_eos_o),
    .t_i        (t_all),
    .take_c_i   (last_eos),
    .c_i        (c_all),
    .out_valid_o,
    .out_ready_i,
    .out_index_o,
    .out_pixel_o
  );

`ifndef SYNTHESIS
  // Pixels in order: so a pixel returns only when its state has been written.
  logic [IndexW-1:0] next_pixel_q;
  always_ff @(posedge clk_i) begin
    if (op_valid_i) begin
      next_pixel_q <= op_eos_i ? '0 : op_pixel_i + IndexW'(1);
    end
  end
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      op_valid_i && !op_eos_i && (op_pixel_i != '0) |-> op_pixel_i == next_pixel_q)
  else $error("flk_vru: pixel out of order");
`endif

endmodule
