// Properties of a unit that hands on a stream unchanged: no loss, no duplication, order, stability.
//
// Counts the elements inside and follows one of them, whichever pick_i (a free input of the proof)
// chooses when it enters: `ahead` elements must leave before it, and then it, as it was. Since the
// choice is free this holds for every element.
// Up to In elements enter and up to Out leave in a cycle, the lower index first: any of those that enter may be missing, those at
// the outputs are the oldest, and none leaves before the one below it.
// clear_i empties the unit, what enters in that cycle included.
// The oldest element that is shown and does not leave stays, at output 0. The unit is judged by its transfers alone; the
// outputs tell the proof's top what to expect of valid and ready, and of the unit's registers.
module fv_stream #(
  parameter  int unsigned Width     = 8,
  parameter  int unsigned Capacity  = 16,  // elements inside, at most
  parameter  int unsigned In        = 1,
  parameter  int unsigned Out       = 1,
  localparam int unsigned CountBits = $clog2(Capacity + 1)
) (
  input  logic                      clk_i,
  input  logic                      rst_ni,
  input  logic                      clear_i,
  input  logic [In-1:0]             pick_i,
  // Input side of the unit
  input  logic [In-1:0]             push_i,  // elements enter
  input  logic [In-1:0][Width-1:0]  in_data_i,
  // Output side
  input  logic [Out-1:0]            out_valid_i,
  input  logic [Out-1:0]            out_ready_i,
  input  logic [Out-1:0][Width-1:0] out_data_i,
  // What the unit must hold
  output logic [CountBits-1:0]      inside_o,
  output logic                      watching_o,  // the chosen element is inside
  output logic [CountBits-1:0]      ahead_o,     // elements in front of it
  output logic [Width-1:0]          watched_o
);

  localparam int unsigned SumBits = $clog2(Capacity + In + 1);

  logic [CountBits-1:0] inside_q, ahead_d, ahead_q;
  logic [SumBits-1:0]   inside_d, place, shown, pops;
  logic [Out-1:0]       pop;
  logic                 watching_d, watching_q, waits, waited_q, leaves;
  logic [Width-1:0]     watched_d, watched_q, waiting, shown_q;

  assign pop    = out_valid_i & out_ready_i;
  assign leaves = SumBits'(ahead_q) < pops;

  always_comb begin
    shown   = '0;
    pops    = '0;
    waits   = 1'b0;
    waiting = out_data_i[0];
    for (int unsigned k = 0; k < Out; k++) begin
      shown = shown + SumBits'(out_valid_i[k]);
      pops  = pops + SumBits'(pop[k]);
      if (!waits && out_valid_i[k] && !out_ready_i[k]) begin
        waits   = 1'b1;
        waiting = out_data_i[k];
      end
    end
  end

  always_comb begin
    place      = SumBits'(inside_q) - pops;
    watching_d = watching_q && !leaves;
    ahead_d    = ahead_q - CountBits'(pops);
    watched_d  = watched_q;
    for (int unsigned k = 0; k < In; k++) begin
      if (!watching_q && !watching_d && push_i[k] && pick_i[k]) begin
        watching_d = 1'b1;
        ahead_d    = CountBits'(place);
        watched_d  = in_data_i[k];
      end
      place = place + SumBits'(push_i[k]);
    end
    inside_d = place;
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
      inside_q   <= CountBits'(inside_d);
      watching_q <= watching_d;
      waited_q   <= waits;
    end
  end

  always_ff @(posedge clk_i) begin
    ahead_q   <= ahead_d;
    watched_q <= watched_d;
    shown_q   <= waiting;
  end

  assign inside_o   = inside_q;
  assign watching_o = watching_q;
  assign ahead_o    = ahead_q;
  assign watched_o  = watched_q;

  for (genvar k = 0; k < Out; k++) begin : gen_out
    always_comb begin
      if (rst_ni) begin
        if (watching_q && SumBits'(ahead_q) == SumBits'(k) && out_valid_i[k]) begin
          a_data: assert (out_data_i[k] == watched_q);
        end
        if (k > 0) begin
          a_pair: assert (!out_valid_i[k] || out_valid_i[k-1]);
          a_turn: assert (!pop[k] || pop[k-1]);
        end
      end
    end
  end

  always_comb begin
    if (rst_ni) begin
      a_capacity: assert (inside_q <= CountBits'(Capacity));
      a_place: assert (inside_d <= SumBits'(Capacity));
      a_invented: assert (shown <= SumBits'(inside_q));
      a_ahead: assert (!watching_q || ahead_q < inside_q);
      if (waited_q) begin
        a_stable: assert (out_valid_i[0] && out_data_i[0] == shown_q);
      end
      c_leaves: cover (watching_q && leaves);
      if (Capacity > Out) begin
        c_waits: cover (watching_q && SumBits'(ahead_q) >= SumBits'(Out) && waited_q);
      end
    end
  end

endmodule
