// Delay line: Depth registers with a common enable; Depth 0 is a wire. Not reset.
module flk_delay #(
  parameter int unsigned Width = 1,
  parameter int unsigned Depth = 1
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [Width-1:0] d_i,
  output logic [Width-1:0] q_o
);

  if (Depth == 0) begin : gen_wire
    logic unused_clock;
    assign unused_clock = ^{clk_i, en_i};
    assign q_o = d_i;
  end else begin : gen_registers
    localparam int unsigned Bits = Depth * Width;
    logic [Bits-1:0] line_q;  // the youngest lowest
    always_ff @(posedge clk_i) begin
      if (en_i) begin
        line_q <= Bits'({line_q, d_i});
      end
    end
    assign q_o = line_q[Bits-1-:Width];
  end

endmodule
