// Stand-in of flk_log_opacity_pipe for the proof of flk_ctu: hands on the lowest bit, with the unit's latency.
module flk_log_opacity_pipe #(
  parameter  bit          Base2    = 1'b1,
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,
  parameter  bit          Saturate = 1'b0,
  parameter  int unsigned Stages   = 2,
  localparam int unsigned Width    = 1 + ExpBits + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [     15:0] opacity_i,
  output logic [Width-1:0] log_o
);

  logic [Stages-1:0] odd_q;

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      odd_q <= {odd_q[Stages-2:0], opacity_i[0]};
    end
  end

  assign log_o = Width'(odd_q[Stages-1]);

endmodule
