// Stand-in of flk_prtu for the proof of flk_ctu: any test at all, instead of the arithmetic.
//
// The unit tests the 16 leader pixels of a sub-tile (columns and rows 0, 3, 4, 7), and its answer is
// a function of splat and pixel. Here that function is a table which the splat carries as its
// shape0, bit {row, column}; shape0 being free, every function is covered. Ports, latency and the
// order of the leaders are those of flk_prtu.
module flk_prtu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form      = FORM_FACTORED,
  parameter int unsigned Precision = PRECISION_MIXED,
  localparam int unsigned QuadBits = (Precision == PRECISION_FP16) ? 16 : 8
) (
  input  logic                     clk_i,
  input  logic [              2:0] x_top_i,
  input  logic [              2:0] x_bot_i,
  input  logic [              2:0] y_top_i,
  input  logic [              2:0] y_bot_i,
  input  fp16_t                    mean_x_i,
  input  fp16_t                    mean_y_i,
  input  fp16_t                    shape0_i,
  input  fp16_t                    shape1_i,
  input  fp16_t                    shape2_i,
  input  logic [     QuadBits-1:0] threshold_i,
  output logic [              3:0] pass_o,
  output logic [3:0][QuadBits-1:0] weight_o
);

  // 0, 3, 4, 7 are numbered 0 to 3; another pixel is no leader and gets no answer.
  function automatic logic passes(fp16_t test, logic [2:0] x, logic [2:0] y);
    return x[1] == x[0] && y[1] == y[0] && test[{y[2], y[0], x[2], x[0]}];
  endfunction

  logic [PRTU_LATENCY-1:0][3:0] pass_q;

  always_ff @(posedge clk_i) begin
    pass_q <= {
      pass_q[PRTU_LATENCY-2:0],
      {
        passes(shape0_i, x_bot_i, y_bot_i),
        passes(shape0_i, x_top_i, y_bot_i),
        passes(shape0_i, x_bot_i, y_top_i),
        passes(shape0_i, x_top_i, y_top_i)
      }
    };
  end

  assign pass_o   = pass_q[PRTU_LATENCY-1];
  assign weight_o = '0;

endmodule
