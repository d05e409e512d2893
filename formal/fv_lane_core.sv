// flk_lane_core, one lane and one pixel of it: every splat whose mask has the pixel, and every end of a list, is visited by the lane exactly once, in the order
// in which they were taken, with its own shape and colours, whatever the other lanes have to do; nothing else is visited; when the core says that it is idle
// nothing is inside. So masks are not lost, slots are not given twice and colours are there when the lane asks for them.
//
// Setup, masks and lanes are stand-ins without arithmetic, in small types; no pixel finishes (fv_lane_queue has that). Masks have two pixels of two lanes.
module fv_lane_core #(
  parameter  int unsigned InWidth = 2,
  parameter  int unsigned Slots   = 2,
  parameter  int unsigned Depth   = 2,
  localparam int unsigned Lanes   = 8,
  localparam int unsigned Watched = 6,  // lane
  localparam int unsigned Other   = 3,
  localparam int unsigned First   = 5,  // pixel; the other one of a lane is visited before it
  localparam int unsigned Second  = 2
) (
  input logic                                      clk_i,
  input logic                                      clear_i,
  input logic                                      pick_i,
  input logic                                      which_i,
  input logic               [InWidth-1:0]          in_valid_i,
  input flk_lane_pkg::record_elem_t [InWidth-1:0]  in_elem_i,
  input logic                                      out_ready_i
);

  import flk_lane_pkg::*;

  localparam int unsigned PIXEL = lane_pixel(Lanes, Watched, First);

  logic rst_n, idle, ready, finished, out_valid;
  flk_pkg::core_pixel_t out_data;
  lane_core_events_t events;

  fv_reset i_reset (.clk_i, .again_i(1'b0), .rst_no(rst_n));

  flk_lane_core #(
    .Lanes  (Lanes),
    .InWidth(InWidth),
    .Slots  (Slots),
    .Depth  (Depth)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .idle_o     (idle),
    .in_valid_i,
    .in_ready_o (ready),
    .in_elem_i,
    .finished_o (finished),
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o (out_data),
    .events_o   (events)
  );

  // ---- What is taken and what is visited, numbered --------------------------------------------------------------

  logic [InWidth-1:0] wanted;
  logic [3:0] taken_q, visited_q, number_q;  // visited_q: of the lane and pixel, and ends
  logic watching_q, eos_q, visit, colour_due_q;
  logic [1:0] key_q;

  for (genvar w = 0; w < InWidth; w++) begin : gen_way
    assign wanted[w] = in_valid_i[w] && ready && (in_elem_i[w].eos || in_elem_i[w].record[PIXEL]);
  end

  assign visit = dut.gen_lane[Watched].visit_valid
              && (dut.gen_lane[Watched].visit_eos || dut.gen_lane[Watched].visit_pixel == 3'(First));

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      taken_q      <= '0;
      visited_q    <= '0;
      watching_q   <= 1'b0;
      colour_due_q <= 1'b0;
    end else if (clear_i) begin
      taken_q      <= '0;
      visited_q    <= '0;
      watching_q   <= 1'b0;
      colour_due_q <= 1'b0;
    end else begin
      taken_q      <= taken_q + 4'(wanted[0]) + 4'(wanted[InWidth-1] && InWidth == 2);
      visited_q    <= visited_q + 4'(visit);
      watching_q   <= watching_q ? !(visit && visited_q == number_q) : pick_i && wanted[which_i && InWidth == 2];
      colour_due_q <= watching_q && visit && visited_q == number_q && !eos_q;
    end
  end

  always_ff @(posedge clk_i) begin
    if (!watching_q) begin
      number_q <= taken_q + 4'(which_i && InWidth == 2 && wanted[0]);
      eos_q    <= in_elem_i[which_i && InWidth == 2].eos;
      key_q    <= in_elem_i[which_i && InWidth == 2].eos ? in_elem_i[which_i && InWidth == 2].subtile.col[1:0]
                                                         : in_elem_i[which_i && InWidth == 2].record[65:64];
    end
  end

  // ---- Properties ---------------------------------------------------------------------------------------------------

  logic [1:0] seen;

  assign seen = eos_q ? dut.visit_shape[Watched][1:0] : dut.visit_shape[Watched].s0;

  logic [63:0] some;

  always_comb begin
    some = '0;
    some[lane_pixel(Lanes, Watched, First)]  = 1'b1;
    some[lane_pixel(Lanes, Watched, Second)] = 1'b1;
    some[lane_pixel(Lanes, Other, First)]    = 1'b1;
    some[lane_pixel(Lanes, Other, Second)]   = 1'b1;
  end

  always_comb begin
    if (rst_n) begin
      assume (!in_valid_i[InWidth-1] || in_valid_i[0]);
      for (int unsigned w = 0; w < InWidth; w++) begin
        // What is left constant only passes through.
        assume ((in_elem_i[w].record[63:0] & ~some) == '0 && in_elem_i[w].record[127:66] == '0);
        assume (in_elem_i[w].subtile.row == '0 && in_elem_i[w].subtile.col[flk_param_pkg::SUBTILE_COORD_BITS-1:2] == '0);
      end

      a_visited: assert (!visit || visited_q != taken_q);
      a_idle: assert (!idle || visited_q == taken_q);
      if (watching_q) begin
        a_waits: assert (!idle);
        if (visit && visited_q == number_q) begin
          a_kind: assert (dut.gen_lane[Watched].visit_eos == eos_q);
          a_key: assert (seen == key_q);
        end
      end
      if (colour_due_q) begin
        a_colour: assert (dut.visit_colour[Watched][2] == key_q);
      end

      c_third: cover (watching_q && visit && visited_q == number_q && number_q == 4'd3);
      c_end: cover (watching_q && visit && eos_q && number_q == 4'd2 && visited_q == number_q);
      c_full: cover (dut.wanted != '0 && !dut.slot_free);
      c_room: cover (dut.wanted != '0 && dut.slot_free && !dut.room);
    end
  end

endmodule
