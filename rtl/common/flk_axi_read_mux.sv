// Read managers that share an AXI4 port: addresses in turn, answers by identifier.
//
// Manager k gets the identifier k, in the low bits, and is ready for its beats whenever they come (it asks only for what has a
// place), so no manager waits for another one's beats. An address that is offered stays until it is taken. Latency 0: addresses pass
// combinationally, ar_ready_i to ar_ready_o too, in turn while several ask; beats go to all managers past this unit, valid only for
// the one that is meant. r_ready_o is 1.
module flk_axi_read_mux
  import flk_axi_pkg::*;
#(
  parameter  int unsigned Managers = 4,
  localparam int unsigned OwnBits  = $clog2(Managers)
) (
  input  logic                   clk_i,
  input  logic                   rst_ni,
  // Managers
  input  logic    [Managers-1:0] ar_valid_i,
  output logic    [Managers-1:0] ar_ready_o,
  input  axi_ax_t [Managers-1:0] ar_i,  // identifiers do not matter
  output logic    [Managers-1:0] r_valid_o,
  input  logic    [Managers-1:0] r_ready_i,
  // Port
  output logic                   ar_valid_o,
  input  logic                   ar_ready_i,
  output axi_ax_t                ar_o,
  input  logic                   r_valid_i,
  output logic                   r_ready_o,
  input  logic [AXI_ID_BITS-1:0] r_id_i
);

  localparam int unsigned AskBits = $bits(axi_ax_t) - AXI_ID_BITS;

  logic [Managers-1:0][AskBits-1:0] ask;
  logic [OwnBits-1:0]               index;
  logic                             out_valid, out_ready;
  logic [AskBits-1:0]               out;

  for (genvar k = 0; k < Managers; k++) begin : gen_manager
    logic unused_id;
    assign unused_id    = ^ar_i[k].id;
    assign ask[k]       = ar_i[k][AskBits-1:0];
    assign r_valid_o[k] = r_valid_i && r_id_i == AXI_ID_BITS'(k);
`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni) r_valid_o[k] |-> r_ready_i[k])
    else $error("flk_axi_read_mux: a manager is not ready for what it asked for");
`endif
  end

  flk_stream_arbiter #(
    .Inputs(Managers),
    .Width (AskBits)
  ) i_arbiter (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (ar_valid_i),
    .in_ready_o (ar_ready_o),
    .in_data_i  (ask),
    .out_valid_o(out_valid),
    .out_ready_i(out_ready),
    .out_data_o (out),
    .out_index_o(index)
  );

  assign ar_valid_o = out_valid;
  assign out_ready  = ar_ready_i;
  assign ar_o       = {AXI_ID_BITS'(index), out};
  assign r_ready_o  = 1'b1;

  logic unused_ready;
  assign unused_ready = ^r_ready_i;  // 1 whenever it matters

endmodule
