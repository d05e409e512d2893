// Stand-in of flk_lane without arithmetic: it takes every visit, asks for the colours and gives the slot back a cycle later, no pixel ever finishes, and the
// end of a list takes the bank until one pixel has left.
module flk_lane
  import flk_pkg::*;
  import flk_lane_pkg::*;
#(
  parameter  int unsigned Lanes    = 8,
  parameter  int unsigned Lane     = 0,
  parameter  int unsigned Slots    = 20,
  parameter  int unsigned Subtiles = 1,
  localparam int unsigned Pixels   = Subtiles * 64 / Lanes,
  localparam int unsigned PixelW   = $clog2(Pixels),
  localparam int unsigned SlotW    = $clog2(Slots)
) (
  input  logic                        clk_i,
  input  logic                        rst_ni,
  input  logic                        clear_i,
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
  output logic                        out_valid_o,
  input  logic                        out_ready_i,
  output lane_pixel_t                 out_data_o,
  output logic                        out_start_o,
  output logic                        out_last_o,
  output lane_events_t                events_o
);

  logic token_q, full_q, release_q;
  logic [SlotW-1:0] slot_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      token_q   <= 1'b0;
      full_q    <= 1'b0;
      release_q <= 1'b0;
    end else if (clear_i) begin
      token_q   <= 1'b0;
      full_q    <= 1'b0;
      release_q <= 1'b0;
    end else begin
      token_q   <= visit_valid_i && visit_eos_i;
      full_q    <= token_q || (full_q && !out_ready_i);
      release_q <= visit_last_i;
    end
  end

  always_ff @(posedge clk_i) begin
    slot_q <= visit_slot_i;
  end

  assign colour_slot_o = slot_q;
  assign release_o     = release_q;
  assign token_o       = token_q;
  assign token_done_o  = token_q;
  assign bank_free_o   = !token_q && !full_q;
  assign finished_o    = '0;
  assign out_valid_o   = full_q;
  assign out_data_o    = '0;
  assign out_start_o   = token_q;
  assign out_last_o    = 1'b1;
  assign events_o      = '0;

endmodule
