// State of a VRU's pixels: transmittance T, colour C and finished flag of each, read and written for one operation per cycle.
//
// | cycle | what |
// |---|---|
// | 0 | op_* come |
// | 1 | t_o: T of the operation's pixel, to the blend pipe |
// | 3 = BLEND | contributes_i, ends_i, t_next_i come from it; T or the finished flag is written; blend_*, finished_o and finish_o belong to it |
// | 5 = COLOUR | c_o: C of the operation's pixel |
// | 7 = LAST | c_next_i comes; C is written if T was |
//
// A pair that contributes to an unfinished pixel replaces its T, unless T would end: then the pixel is finished and stays as it is.
// A pixel may return after RETURN operations; sooner it would find its old state (an assertion watches that), unless it is finished.
// A token (op_eos_i) gives T as it passes BLEND (t_all_o) and C as it passes LAST (c_all_o) and sets all pixels to 1, black, unfinished.
// The next sub-tile's operations may follow at once: what they read before the token has come to the end of the loop counts as cleared.
// clear_i: all operations and tokens inside are dropped and all pixels set, at the next edge; the operation that comes with it is dropped too.
// contributes_i and ends_i pass to finish_o; nothing else is combinational.
module flk_pixel_state
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter  int unsigned Pixels = PIXELS_PER_VRU,
  localparam int unsigned IndexW = $clog2(Pixels),
  localparam int unsigned BLEND  = 1 + FP16_MUL_STAGES
) (
  input  logic                         clk_i,
  input  logic                         rst_ni,
  input  logic                         clear_i,
  // operations
  input  logic                         op_valid_i,
  input  logic                         op_eos_i,
  input  logic [IndexW-1:0]            op_pixel_i,
  output logic [BLEND:2]               first_o,  // one on pixel 0 gets to that cycle at this edge
  // blend pipe
  output logic [14:0]                  t_o,
  input  logic                         contributes_i,
  input  logic                         ends_i,
  input  logic [14:0]                  t_next_i,
  output logic [2:0][14:0]             c_o,
  input  logic [2:0][14:0]             c_next_i,
  // state at BLEND
  output logic                         blend_valid_o,
  output logic [IndexW-1:0]            blend_pixel_o,
  output logic                         blend_eos_o,
  output logic [Pixels-1:0]            finished_o,  // before the operation at BLEND
  output logic                         finish_o,    // the operation at BLEND finishes its pixel
  // all pixels, for the drain
  output logic [Pixels-1:0][14:0]      t_all_o,     // at BLEND
  output logic                         last_eos_o,  // a token is at LAST
  output logic [Pixels-1:0][2:0][14:0] c_all_o      // at LAST
);

  localparam int unsigned COLOUR = BLEND + FP16_MUL_STAGES;
  localparam int unsigned LAST = COLOUR + FP16_SUM_STAGES;
  // From the read of T, and from that of C in the cycle before COLOUR, to the cycle after its write.
  localparam int unsigned RETURN = BLEND + 1;
  localparam int unsigned C_RETURN = LAST - (COLOUR - 1) + 1;

  if (Pixels < RETURN || Pixels < C_RETURN) begin : gen_check_loops
    $error("flk_pixel_state: pixels in order return before their state is written");
  end

  // ---- Control pipeline: index s holds what came s cycles ago ------------------------------------------------

  logic [BLEND:1] valid_q;
  logic [LAST:1] eos_q;
  logic [LAST:1][IndexW-1:0] pixel_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= '0;
      eos_q   <= '0;
    end else if (clear_i) begin
      valid_q <= '0;
      eos_q   <= '0;
    end else begin
      valid_q <= {valid_q[BLEND-1:1], op_valid_i && !op_eos_i};
      eos_q   <= {eos_q[LAST-1:1], op_valid_i && op_eos_i};
    end
  end

  always_ff @(posedge clk_i) begin
    pixel_q <= {pixel_q[LAST-1:1], op_pixel_i};
  end

  for (genvar s = 2; s <= BLEND; s++) begin : gen_first
    assign first_o[s] = valid_q[s-1] && (pixel_q[s-1] == '0);
  end
  assign blend_valid_o = valid_q[BLEND];
  assign blend_pixel_o = pixel_q[BLEND];
  assign blend_eos_o   = eos_q[BLEND];
  assign last_eos_o    = eos_q[LAST];

  // ---- Transmittance and finished flags: read in cycle 0, written at BLEND -------------------------------------

  logic [Pixels-1:0][14:0] t_q;
  logic [Pixels-1:0] finished_q;
  logic [14:0] t_now_q;
  logic live, blend;

  always_ff @(posedge clk_i) begin
    // A token between here and BLEND will have cleared it.
    t_now_q <= (|eos_q[BLEND:1]) ? FP16_ONE[14:0] : t_q[op_pixel_i];
  end

  assign live     = valid_q[BLEND] && contributes_i && !finished_q[blend_pixel_o];
  assign blend    = live && !ends_i;
  assign finish_o = live && ends_i;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      t_q        <= {Pixels{FP16_ONE[14:0]}};
      finished_q <= '0;
    end else if (clear_i || eos_q[BLEND]) begin
      t_q        <= {Pixels{FP16_ONE[14:0]}};
      finished_q <= '0;
    end else begin
      if (blend) begin
        t_q[blend_pixel_o] <= t_next_i;
      end
      if (finish_o) begin
        finished_q[blend_pixel_o] <= 1'b1;
      end
    end
  end

  assign t_o        = t_now_q;
  assign t_all_o    = t_q;
  assign finished_o = finished_q;

  // ---- Colour: read for COLOUR, written at LAST ----------------------------------------------------------------

  logic [Pixels-1:0][2:0][14:0] c_q;
  logic [2:0][14:0] c_now_q;
  logic [LAST:BLEND+1] blend_q;

  always_ff @(posedge clk_i) begin
    c_now_q <= (|eos_q[LAST:COLOUR]) ? '0 : c_q[pixel_q[COLOUR-1]];
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      c_q     <= '0;
      blend_q <= '0;
    end else if (clear_i) begin
      c_q     <= '0;
      blend_q <= '0;
    end else begin
      blend_q <= {blend_q[LAST-1:BLEND+1], blend};
      if (eos_q[LAST]) begin
        c_q <= '0;
      end else if (blend_q[LAST]) begin
        c_q[pixel_q[LAST]] <= c_next_i;
      end
    end
  end

  assign c_o     = c_now_q;
  assign c_all_o = c_q;

`ifndef SYNTHESIS
  // No younger operation of the sub-tile has read the T that is written now.
  logic [BLEND-1:0] stale;
  for (genvar s = 0; s < BLEND; s++) begin : gen_stale
    if (s == 0) begin : gen_now
      assign stale[s] = op_valid_i && !op_eos_i && (op_pixel_i == blend_pixel_o)
                     && !(|eos_q[BLEND-1:1]);
    end else begin : gen_before
      assign stale[s] = valid_q[s] && (pixel_q[s] == blend_pixel_o)
                     && !(|(eos_q[BLEND-1:1] >> s));
    end
  end
  assert property (@(posedge clk_i) disable iff (!rst_ni) blend |-> stale == '0)
  else $error("flk_pixel_state: a pixel has returned before its state is written");
`endif

endmodule
