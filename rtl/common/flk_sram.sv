// Memory with one write and one read port: the place of a macro.
//
// Latency 1: rd_data_o is the word of the cycle with rd_en_i, and stays until the next such cycle. What a read and a write of
// the same address give in the same cycle is not defined: rd_data_o is then a value that no one may use (in simulation: all
// bits of the word inverted; in synthesis: told by attributes, so that an FPGA's tool adds no logic to a block of memory). Contents are
// not reset. Behaviour in flip-flops; a technology replaces the module by its macro.
module flk_sram #(
  parameter  int unsigned Width    = 8,
  parameter  int unsigned Depth    = 16,
  localparam int unsigned AddrBits = Depth > 1 ? $clog2(Depth) : 1
) (
  input  logic                clk_i,
  input  logic                wr_en_i,
  input  logic [AddrBits-1:0] wr_addr_i,
  input  logic [Width-1:0]    wr_data_i,
  input  logic                rd_en_i,
  input  logic [AddrBits-1:0] rd_addr_i,
  output logic [Width-1:0]    rd_data_o
);

  if (Width < 1 || Depth < 1) begin : gen_check
    $error("flk_sram: Width and Depth must be at least 1");
  end

  // No check for a read and a write of the same address: Yosys, Quartus, Vivado.
  (* no_rw_check, ramstyle = "no_rw_check", rw_addr_collision = "no" *)
  logic [Width-1:0] storage_q[Depth];
  logic [Width-1:0] rd_data_q;

  always_ff @(posedge clk_i) begin
    if (wr_en_i) begin
      storage_q[wr_addr_i] <= wr_data_i;
    end
  end

  always_ff @(posedge clk_i) begin
    if (rd_en_i) begin
      rd_data_q <= storage_q[rd_addr_i];
`ifndef SYNTHESIS
      if (wr_en_i && wr_addr_i == rd_addr_i) begin
        rd_data_q <= ~storage_q[rd_addr_i];
      end
`endif
    end
  end

  assign rd_data_o = rd_data_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) wr_en_i |-> 32'(wr_addr_i) < Depth)
  else $error("flk_sram: write beyond Depth");
  assert property (@(posedge clk_i) rd_en_i |-> 32'(rd_addr_i) < Depth)
  else $error("flk_sram: read beyond Depth");
`endif

endmodule
