// First-in first-out queue of a stream, storage in a memory (flk_sram).
//
// Latency 2, throughput 1 per cycle. Holds Depth elements in the memory and one at the output, which
// is the memory's read register. in_ready_o, out_valid_o and out_data_o come from registers. A full
// memory takes nothing, even in the cycle in which an element leaves. Depth need not be a power of
// two. Contents are not reset.
module flk_sram_fifo #(
  parameter  int unsigned Width     = 8,
  parameter  int unsigned Depth     = 32,
  localparam int unsigned UsageBits = $clog2(Depth + 1)
) (
  input  logic             clk_i,
  input  logic             rst_ni,
  // Upstream
  input  logic             in_valid_i,
  output logic             in_ready_o,
  input  logic [Width-1:0] in_data_i,
  // Downstream
  output logic             out_valid_o,
  input  logic             out_ready_i,
  output logic [Width-1:0] out_data_o,
  // Nothing inside
  output logic             empty_o
);

  if (Width < 1 || Depth < 2) begin : gen_check
    $error("flk_sram_fifo: Width must be at least 1, Depth at least 2");
  end

  localparam int unsigned AddrBits = Depth > 1 ? $clog2(Depth) : 1;
  localparam logic [AddrBits-1:0] LAST = AddrBits'(Depth - 1);

  logic [AddrBits-1:0]  write_q, read_q;
  logic [UsageBits-1:0] usage_q;  // in the memory
  logic                 out_valid_q;
  logic                 push, fetch;

  assign push  = in_valid_i && in_ready_o;
  assign fetch = usage_q != '0 && (!out_valid_q || out_ready_i);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q     <= '0;
      read_q      <= '0;
      usage_q     <= '0;
      out_valid_q <= 1'b0;
    end else begin
      if (push) begin
        write_q <= write_q == LAST ? '0 : write_q + 1'b1;
      end
      if (fetch) begin
        read_q <= read_q == LAST ? '0 : read_q + 1'b1;
      end
      usage_q     <= usage_q + UsageBits'(push) - UsageBits'(fetch);
      out_valid_q <= fetch || (out_valid_q && !out_ready_i);
    end
  end

  flk_sram #(
    .Width(Width),
    .Depth(Depth)
  ) i_storage (
    .clk_i,
    .wr_en_i  (push),
    .wr_addr_i(write_q),
    .wr_data_i(in_data_i),
    .rd_en_i  (fetch),
    .rd_addr_i(read_q),
    .rd_data_o(out_data_o)
  );

  assign in_ready_o  = usage_q != UsageBits'(Depth);
  assign out_valid_o = out_valid_q;
  assign empty_o     = usage_q == '0 && !out_valid_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) usage_q <= UsageBits'(Depth))
  else $error("flk_sram_fifo: fill level above Depth");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_sram_fifo: output changed before its transfer");
`endif

endmodule
