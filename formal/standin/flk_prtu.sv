// Stand-in of flk_prtu for the proof of flk_ctu: any test at all, instead of the arithmetic.
//
// The unit tests the 16 leader pixels of a sub-tile (columns and rows 0, 3, 4, 7), and its answer is a function of splat and pixel. Here
// that function is a table which the splat carries as its shape, bit {row, column}, inverted if its threshold is odd; shape and threshold
// being free, every function is covered, and numbers of another splat would be noticed. Ports, latency, the cycles in which shape and
// threshold are taken and the order of the leaders are those of flk_prtu.
module flk_prtu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form      = FORM_FACTORED,
  parameter int unsigned Precision = PRECISION_MIXED,
  parameter int unsigned Cols      = 2,
  parameter int unsigned Rows      = 2,
  localparam int unsigned Leaders  = Cols * Rows,
  localparam int unsigned QuadBits = (Precision == PRECISION_FP16) ? 16 : 8
) (
  input  logic                             clk_i,
  input  logic                             en_i,
  input  logic [   Cols-1:0][         2:0] x_i,
  input  logic [   Rows-1:0][         2:0] y_i,
  input  fp16_t                            mean_x_i,
  input  fp16_t                            mean_y_i,
  input  logic [        2:0][QuadBits-1:0] shape_i,
  input  logic [QuadBits-1:0]              threshold_i,
  output logic [Leaders-1:0]               pass_o
);

  localparam int unsigned Latency = 32'(PRTU_LATENCY[Form][Precision]);
  localparam int unsigned Delay = 32'(PRTU_SHAPE_DELAY[Precision]);
  localparam int unsigned Rest = Latency - 1 - Delay;  // from the shape to the threshold

  // 0, 3, 4, 7 are numbered 0 to 3; another pixel is no leader and gets no answer.
  function automatic logic passes(logic [15:0] test, logic [2:0] x, logic [2:0] y);
    return x[1] == x[0] && y[1] == y[0] && test[{y[2], y[0], x[2], x[0]}];
  endfunction

  logic [15:0] test;
  logic [Delay-1:0][Cols-1:0][2:0] x_q;
  logic [Delay-1:0][Rows-1:0][2:0] y_q;
  logic [Rest-1:0][Leaders-1:0] pass_q;
  logic [Leaders-1:0] pass;

  assign test = {shape_i[1][7:0], shape_i[0][7:0]};

  always_comb begin
    for (int i = 0; i < Leaders; i++) begin
      pass[i] = passes(test, x_q[Delay-1][i%Cols], y_q[Delay-1][i/Cols]);
    end
  end

  always_ff @(posedge clk_i) begin
    if (en_i) begin
      x_q    <= {x_q[Delay-2:0], x_i};
      y_q    <= {y_q[Delay-2:0], y_i};
      pass_q <= {pass_q[Rest-2:0], pass};
      pass_o <= pass_q[Rest-1] ^ {Leaders{threshold_i[0]}};
    end
  end


endmodule
