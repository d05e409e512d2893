// Input of a rendering stage that takes splats: records of four cores to splats, and what the stage says back to who gives records
// (docs/reference/record_to_splat.md).
//
// in_*: records as they lie in memory, or the end of a list, with the sub-tile whose list it is. finished_i is about the sub-tile of the
// element that the stage takes; finished_o about the sub-tile of in_*: the same when no end lies between.
// Latency 3, throughput 1 per cycle and core. in_ready_o depends combinationally on out_ready_i, finished_o on finished_i; the rest comes
// from registers. clear_i (synchronous) empties it.
module flk_splat_input
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter  int unsigned Form       = FORM_FACTORED,
  localparam int unsigned RecordBits = (Form == FORM_FACTORED) ? 128 : 256
) (
  input  logic                               clk_i,
  input  logic                               rst_ni,
  input  logic                               clear_i,
  // Upstream
  input  logic        [CORES-1:0]                 in_valid_i,
  output logic        [CORES-1:0]                 in_ready_o,
  input  logic        [CORES-1:0]                 in_end_i,
  input  logic        [CORES-1:0][RecordBits-1:0] in_record_i,
  input  subtile_t    [CORES-1:0]                 in_subtile_i,
  output logic        [CORES-1:0]                 finished_o,
  // Downstream
  output logic        [CORES-1:0]                 out_valid_o,
  input  logic        [CORES-1:0]                 out_ready_i,
  output splat_elem_t [CORES-1:0]                 out_elem_o,
  input  logic        [CORES-1:0]                 finished_i
);

  for (genvar k = 0; k < CORES; k++) begin : gen_core
    logic       end_in, end_out;
    logic [2:0] ends_q;  // inside

    assign end_in        = in_valid_i[k] && in_ready_o[k] && in_end_i[k];
    assign end_out       = out_valid_o[k] && out_ready_i[k] && out_elem_o[k].eos;
    assign finished_o[k] = finished_i[k] && ends_q == '0;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        ends_q <= '0;
      end else if (clear_i) begin
        ends_q <= '0;
      end else begin
        ends_q <= ends_q + 3'(end_in) - 3'(end_out);
      end
    end

    flk_record_to_splat #(
      .Form(Form)
    ) i_splat (
      .clk_i,
      .rst_ni,
      .clear_i,
      .in_valid_i  (in_valid_i[k]),
      .in_ready_o  (in_ready_o[k]),
      .in_eos_i    (in_end_i[k]),
      .in_record_i (in_record_i[k]),
      .in_subtile_i(in_subtile_i[k]),
      .out_valid_o (out_valid_o[k]),
      .out_ready_i (out_ready_i[k]),
      .out_elem_o  (out_elem_o[k])
    );

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        clear_i || ((ends_q != '0 || !end_out) && !(&ends_q)))
    else $error("flk_splat_input: number of ends");
`endif
  end

endmodule
