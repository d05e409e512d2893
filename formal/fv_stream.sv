// Properties of a unit that hands on a stream unchanged: no loss, no duplication, order, stability.
//
// Counts the elements inside and follows one of them, whichever pick_i (a free input of the proof)
// chooses when it enters: `ahead` elements must leave before it, and then it, as it was. Since the
// choice is free this holds for every element.
// clear_i empties the unit, what enters in that cycle included.
// valid_o and data must hold until the transfer. The unit is judged by its transfers alone; the
// outputs tell the proof's top what to expect of valid and ready, and of the unit's registers.
module fv_stream #(
  parameter  int unsigned Width     = 8,
  parameter  int unsigned Capacity  = 16,  // elements inside, at most
  localparam int unsigned CountBits = $clog2(Capacity + 1)
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 clear_i,
  input  logic                 pick_i,
  // Input side of the unit
  input  logic                 push_i,  // an element enters
  input  logic [Width-1:0]     in_data_i,
  // Output side
  input  logic                 out_valid_i,
  input  logic                 out_ready_i,
  input  logic [Width-1:0]     out_data_i,
  // What the unit must hold
  output logic [CountBits-1:0] inside_o,
  output logic                 watching_o,  // the chosen element is inside
  output logic [CountBits-1:0] ahead_o,     // elements in front of it
  output logic [Width-1:0]     watched_o
);

  logic [CountBits-1:0] inside_d, inside_q, ahead_d, ahead_q;
  logic                 watching_d, watching_q, waited_q, pop, first;
  logic [Width-1:0]     watched_q, shown_q;

  assign pop      = out_valid_i && out_ready_i;
  assign first    = ahead_q == '0;
  assign inside_d = inside_q + CountBits'(push_i) - CountBits'(pop);

  always_comb begin
    watching_d = watching_q && !(pop && first);
    ahead_d    = ahead_q - CountBits'(pop);
    if (!watching_q && push_i && pick_i) begin
      watching_d = 1'b1;
      ahead_d    = inside_q - CountBits'(pop);
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      inside_q   <= '0;
      watching_q <= 1'b0;
      waited_q   <= 1'b0;
    end else if (clear_i) begin
      inside_q   <= '0;
      watching_q <= 1'b0;
      waited_q   <= 1'b0;
    end else begin
      inside_q   <= inside_d;
      watching_q <= watching_d;
      waited_q   <= out_valid_i && !out_ready_i;
    end
  end

  always_ff @(posedge clk_i) begin
    ahead_q <= ahead_d;
    shown_q <= out_data_i;
    if (!watching_q) begin
      watched_q <= in_data_i;
    end
  end

  assign inside_o   = inside_q;
  assign watching_o = watching_q;
  assign ahead_o    = ahead_q;
  assign watched_o  = watched_q;

  always_comb begin
    if (rst_ni) begin
      a_capacity: assert (inside_q <= CountBits'(Capacity));
      a_place: assert (!push_i || pop || inside_q < CountBits'(Capacity));
      a_invented: assert (!out_valid_i || inside_q != '0);
      a_ahead: assert (!watching_q || ahead_q < inside_q);
      if (watching_q && first && out_valid_i) begin
        a_data: assert (out_data_i == watched_q);
      end
      if (waited_q) begin
        a_stable: assert (out_valid_i && out_data_i == shown_q);
      end
      c_leaves: cover (watching_q && first && pop);
      if (Capacity > 1) begin
        c_waits: cover (watching_q && !first && waited_q);
      end
    end
  end

endmodule
