// Delay line in a memory: q_o is d_i Depth enabled cycles ago, as flk_delay gives it. The place in the memory is reset, the words are not.
//
// A ring of Depth words in flk_sram, whose read register is the last stage; for lines that are too
// long for flip-flops.
module flk_delay_ram #(
  parameter int unsigned Width = 8,
  parameter int unsigned Depth = 8
) (
  input  logic             clk_i,
  input  logic             rst_ni,
  input  logic             en_i,
  input  logic [Width-1:0] d_i,
  output logic [Width-1:0] q_o
);

  if (Width < 1 || Depth < 2) begin : gen_check
    $error("flk_delay_ram: Width must be at least 1, Depth at least 2");
  end

  localparam int unsigned AddrBits = $clog2(Depth);
  localparam logic [AddrBits-1:0] LAST = AddrBits'(Depth - 1);

  logic [AddrBits-1:0] at_q, next;

  assign next = at_q == LAST ? '0 : at_q + 1'b1;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      at_q <= '0;
    end else if (en_i) begin
      at_q <= next;
    end
  end

  flk_sram #(
    .Width(Width),
    .Depth(Depth)
  ) i_ring (
    .clk_i,
    .wr_en_i  (en_i),
    .wr_addr_i(at_q),
    .wr_data_i(d_i),
    .rd_en_i  (en_i),
    .rd_addr_i(next),
    .rd_data_o(q_o)
  );

endmodule
