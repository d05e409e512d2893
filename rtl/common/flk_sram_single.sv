// Memory with one port, which writes or reads: the place of a macro.
//
// In a cycle with en_i the word at addr_i is written (write_i) or read; rd_data_o, latency 1, stays until the next read. Contents
// are not reset. Behaviour in flip-flops; a technology replaces the module by its macro. What is read while something else is
// written takes flk_sram.
module flk_sram_single #(
  parameter  int unsigned Width    = 8,
  parameter  int unsigned Depth    = 16,
  localparam int unsigned AddrBits = Depth > 1 ? $clog2(Depth) : 1
) (
  input  logic                clk_i,
  input  logic                en_i,
  input  logic                write_i,
  input  logic [AddrBits-1:0] addr_i,
  input  logic [Width-1:0]    wr_data_i,
  output logic [Width-1:0]    rd_data_o
);

  if (Width < 1 || Depth < 1) begin : gen_check
    $error("flk_sram_single: Width and Depth must be at least 1");
  end

  logic [Width-1:0] storage_q[Depth];
  logic [Width-1:0] rd_data_q;

  always_ff @(posedge clk_i) begin
    if (en_i && write_i) begin
      storage_q[addr_i] <= wr_data_i;
    end
  end

  always_ff @(posedge clk_i) begin
    if (en_i && !write_i) begin
      rd_data_q <= storage_q[addr_i];
    end
  end

  assign rd_data_o = rd_data_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) en_i |-> 32'(addr_i) < Depth)
  else $error("flk_sram_single: address beyond Depth");
`endif

endmodule
