// Reset synchroniser: rst_no falls with rst_ni at once and rises Stages rising edges of clk_i after it.
//
// Its flip-flops want to stand together and to be left out of scan chains that shift a reset into the design;
// test_en_i (scan test) puts rst_ni through. rst_ni to rst_no is combinational then, and in a fall.
module flk_reset_sync #(
  parameter int unsigned Stages = 2
) (
  input  logic clk_i,
  input  logic rst_ni,
  input  logic test_en_i,
  output logic rst_no
);

  if (Stages < 2) begin : gen_check
    $error("flk_reset_sync: Stages must be at least 2");
  end

  logic [Stages-1:0] released_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      released_q <= '0;
    end else begin
      released_q <= {released_q[Stages-2:0], 1'b1};
    end
  end

  assign rst_no = test_en_i ? rst_ni : released_q[Stages-1];

endmodule
