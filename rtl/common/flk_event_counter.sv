// Counts events: up to 2^CountBits - 1 in a cycle, modulo 2^32.
//
// value_o has all events up to three cycles ago: count_i is registered, and the upper bits follow the
// lower ones by a cycle, so that neither what counts nor the width makes a long path. clear_i
// (synchronous) sets it to 0 and drops what is on its way, with that cycle's events.
module flk_event_counter #(
  parameter int unsigned CountBits = 1
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 clear_i,
  input  logic [CountBits-1:0] count_i,
  output logic [31:0]          value_o
);

  localparam int unsigned LowBits = 8;

  if (CountBits < 1 || CountBits > LowBits) begin : gen_check
    $error("flk_event_counter: CountBits must be 1 to 8");
  end

  logic [CountBits-1:0]  count_q;
  logic [LowBits:0]      low_d;
  logic [LowBits-1:0]    low_q;
  logic                  carry_q;
  logic [31-LowBits:0]   high_q;

  assign low_d = {1'b0, low_q} + (LowBits + 1)'(count_q);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      count_q <= '0;
      low_q   <= '0;
      carry_q <= 1'b0;
      high_q  <= '0;
    end else if (clear_i) begin
      count_q <= '0;
      low_q   <= '0;
      carry_q <= 1'b0;
      high_q  <= '0;
    end else begin
      count_q <= count_i;
      low_q   <= low_d[LowBits-1:0];
      carry_q <= low_d[LowBits];
      if (carry_q) begin
        high_q <= high_q + 1'b1;
      end
    end
  end

  assign value_o = {high_q, low_q};

endmodule
