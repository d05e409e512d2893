// Counters of events that have Sources each (lanes, cores), any number of them at a time, modulo 2^32.
//
// values_o has all events up to four cycles ago: events_i are registered, their sum goes to a flk_event_counter each, so that what
// counts may come late in its cycle. clear_i (synchronous) sets all to 0 and drops what is on its way, with that cycle's events.
module flk_event_counters #(
  parameter  int unsigned Counters  = 2,
  parameter  int unsigned Sources   = 4,
  localparam int unsigned CountBits = $clog2(Sources + 1)
) (
  input  logic                             clk_i,
  input  logic                             rst_ni,
  input  logic                             clear_i,
  input  logic [Counters-1:0][Sources-1:0] events_i,
  output logic [Counters-1:0][31:0]        values_o
);

  logic [Counters-1:0][Sources-1:0] events_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      events_q <= '0;
    end else begin
      events_q <= clear_i ? '0 : events_i;
    end
  end

  for (genvar e = 0; e < Counters; e++) begin : gen_counter
    logic [CountBits-1:0] many;

    always_comb begin
      many = '0;
      for (int unsigned k = 0; k < Sources; k++) begin
        many = many + CountBits'(events_q[e][k]);
      end
    end

    flk_event_counter #(
      .CountBits(CountBits)
    ) i_counter (
      .clk_i,
      .rst_ni,
      .clear_i,
      .count_i(many),
      .value_o(values_o[e])
    );
  end

endmodule
