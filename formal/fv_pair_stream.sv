// fv_stream for a unit that takes or gives two elements in a cycle, 0 before 1: no loss, no duplication, order, stability.
//
// Where one side has a single element a cycle, its second one is tied off. An element at output 1 is right behind that at output 0,
// and leaves with it. clear_i empties the unit, what enters in that cycle included.
module fv_pair_stream #(
  parameter  int unsigned Width     = 8,
  parameter  int unsigned Capacity  = 16,  // elements inside, at most
  localparam int unsigned CountBits = $clog2(Capacity + 3)
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  input  logic [1:0]            pick_i,
  // Input side of the unit
  input  logic [1:0]            push_i,  // elements enter, either alone, too
  input  logic [1:0][Width-1:0] in_data_i,
  // Output side
  input  logic [1:0]            out_valid_i,
  input  logic                  out_ready_i,
  input  logic [1:0][Width-1:0] out_data_i,
  // What the unit must hold
  output logic [CountBits-1:0]  inside_o,
  output logic                  watching_o,  // the chosen element is inside
  output logic [CountBits-1:0]  ahead_o,     // elements in front of it
  output logic [Width-1:0]      watched_o
);

  logic [CountBits-1:0] inside_d, inside_q, ahead_d, ahead_q, pops;
  logic                 watching_d, watching_q, waited_q, leaves;
  logic [Width-1:0]     watched_d, watched_q, shown_q;

  assign pops     = out_ready_i ? CountBits'(out_valid_i[0]) + CountBits'(out_valid_i[1]) : '0;
  assign leaves   = ahead_q < pops;
  assign inside_d = inside_q + CountBits'(push_i[0]) + CountBits'(push_i[1]) - pops;

  always_comb begin
    watching_d = watching_q && !leaves;
    ahead_d    = ahead_q - pops;
    watched_d  = watched_q;
    if (!watching_q && push_i[0] && pick_i[0]) begin
      watching_d = 1'b1;
      ahead_d    = inside_q - pops;
      watched_d  = in_data_i[0];
    end else if (!watching_q && push_i[1] && pick_i[1]) begin
      watching_d = 1'b1;
      ahead_d    = inside_q + CountBits'(push_i[0]) - pops;
      watched_d  = in_data_i[1];
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
      waited_q   <= out_valid_i[0] && !out_ready_i;
    end
  end

  always_ff @(posedge clk_i) begin
    ahead_q   <= ahead_d;
    watched_q <= watched_d;
    shown_q   <= out_data_i[0];
  end

  assign inside_o   = inside_q;
  assign watching_o = watching_q;
  assign ahead_o    = ahead_q;
  assign watched_o  = watched_q;

  always_comb begin
    if (rst_ni) begin
      a_capacity: assert (inside_q <= CountBits'(Capacity));
      a_place: assert (inside_d <= CountBits'(Capacity));
      a_invented: assert (CountBits'(out_valid_i[0]) + CountBits'(out_valid_i[1]) <= inside_q);
      a_pair: assert (out_valid_i != 2'b10);
      a_ahead: assert (!watching_q || ahead_q < inside_q);
      if (watching_q && ahead_q == '0 && out_valid_i[0]) begin
        a_data: assert (out_data_i[0] == watched_q);
      end
      if (watching_q && ahead_q == CountBits'(1) && out_valid_i[1]) begin
        a_second: assert (out_data_i[1] == watched_q);
      end
      if (waited_q) begin
        a_stable: assert (out_valid_i[0] && out_data_i[0] == shown_q);
      end
      c_leaves: cover (watching_q && leaves);
      c_waits: cover (watching_q && ahead_q > CountBits'(1) && waited_q);
    end
  end

endmodule
