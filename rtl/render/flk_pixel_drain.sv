// Output buffer of a VRU: takes the state of all pixels when a sub-tile ends and gives it as a stream of pixels, 0 to Pixels - 1.
//
// token_i reserves the buffer when the token sets out, T comes with take_t_i, C later with take_c_i: in the next cycle the stream begins.
// The buffer is free again, ready_o, after the last pixel's transfer; tokens come only while it is.
// Throughput one pixel per cycle. ready_o, out_valid_o and out_index_o come from registers, out_pixel_o through a multiplexer from
// registers; no combinational path.
// clear_i empties and frees the buffer at the next edge.
module flk_pixel_drain
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter  int unsigned Pixels = PIXELS_PER_VRU,
  localparam int unsigned IndexW = $clog2(Pixels)
) (
  input  logic                         clk_i,
  input  logic                         rst_ni,
  input  logic                         clear_i,
  // state of the pixels
  input  logic                         token_i,
  output logic                         ready_o,
  input  logic                         take_t_i,
  input  logic [Pixels-1:0][14:0]      t_i,
  input  logic                         take_c_i,
  input  logic [Pixels-1:0][2:0][14:0] c_i,
  // finished pixels
  output logic                         out_valid_o,
  input  logic                         out_ready_i,
  output logic [IndexW-1:0]            out_index_o,
  output pixel_t                       out_pixel_o
);

  // ---- Control -----------------------------------------------------------------------------------------------

  logic busy_q, full_q, last;
  logic [IndexW-1:0] out_index_q;

  assign last = out_valid_o && out_ready_i && (out_index_q == IndexW'(Pixels - 1));

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      busy_q      <= 1'b0;
      full_q      <= 1'b0;
      out_index_q <= '0;
    end else if (clear_i) begin
      busy_q      <= 1'b0;
      full_q      <= 1'b0;
      out_index_q <= '0;
    end else begin
      if (token_i) begin
        busy_q <= 1'b1;
      end else if (last) begin
        busy_q <= 1'b0;
      end
      if (take_c_i) begin
        full_q <= 1'b1;
      end else if (last) begin
        full_q <= 1'b0;
      end
      if (out_valid_o && out_ready_i) begin
        out_index_q <= out_index_q + IndexW'(1);
      end
    end
  end

  // ---- Buffer ------------------------------------------------------------------------------------------------

  logic [Pixels-1:0][14:0] out_t_q;
  logic [Pixels-1:0][2:0][14:0] out_c_q;

  always_ff @(posedge clk_i) begin
    if (take_t_i) begin
      out_t_q <= t_i;
    end
    if (take_c_i) begin
      out_c_q <= c_i;
    end
  end

  // ---- Stream ------------------------------------------------------------------------------------------------

  assign ready_o     = !busy_q;
  assign out_valid_o = full_q;
  assign out_index_o = out_index_q;

  // Neither T nor colours are negative.
  always_comb begin
    out_pixel_o.transmittance = {1'b0, out_t_q[out_index_q]};
    out_pixel_o.red           = {1'b0, out_c_q[out_index_q][0]};
    out_pixel_o.green         = {1'b0, out_c_q[out_index_q][1]};
    out_pixel_o.blue          = {1'b0, out_c_q[out_index_q][2]};
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) token_i |-> ready_o)
  else $error("flk_pixel_drain: token while the output buffer is in use");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i
      |=> out_valid_o && $stable(out_index_o) && $stable(out_pixel_o))
  else $error("flk_pixel_drain: output changed before its transfer");
`endif

endmodule
