// First-in first-out queue of a stream, storage in a memory (flk_sram).
//
// Latency 2, throughput 1 per cycle; holds Depth elements and one that stands at the output, which
// is the memory's read register. in_ready_o and out_valid_o come from registers; out_ready_i
// reaches the memory's read enable. clear_i (synchronous) empties it: what it holds, and what it
// takes in that cycle, is gone in the next; empty_o from registers. Storage is not reset; Depth need not be a power of two.
module flk_sram_fifo #(
  parameter int unsigned Width = 8,
  parameter int unsigned Depth = 16
) (
  input  logic             clk_i,
  input  logic             rst_ni,
  input  logic             clear_i,
  // Upstream
  input  logic             in_valid_i,
  output logic             in_ready_o,
  input  logic [Width-1:0] in_data_i,
  // Downstream
  output logic             out_valid_o,
  input  logic             out_ready_i,
  output logic [Width-1:0] out_data_o,
  output logic             empty_o       // nothing inside
);

  if (Width < 1 || Depth < 2) begin : gen_check
    $error("flk_sram_fifo: Width must be at least 1, Depth at least 2");
  end

  // Pointers and number of words in the memory

  localparam int unsigned PtrBits = Depth > 1 ? $clog2(Depth) : 1;
  localparam int unsigned UsedBits = $clog2(Depth + 1);
  localparam logic [PtrBits-1:0] LAST = PtrBits'(Depth - 1);

  logic [PtrBits-1:0]  write_d, write_q;
  logic [PtrBits-1:0]  read_d, read_q;
  logic [UsedBits-1:0] used_d, used_q;
  logic                out_valid_d, out_valid_q;
  logic                push, fetch;

  assign empty_o    = used_q == '0 && !out_valid_q;
  assign in_ready_o = used_q != UsedBits'(Depth);
  assign push       = in_valid_i && in_ready_o;
  // A word that is written in this cycle is not counted yet: no word is read as it is written.
  assign fetch      = used_q != '0 && (!out_valid_q || out_ready_i);

  always_comb begin
    write_d     = write_q;
    read_d      = read_q;
    used_d      = used_q + UsedBits'(push) - UsedBits'(fetch);
    out_valid_d = fetch || (out_valid_q && !out_ready_i);
    if (push) begin
      write_d = write_q == LAST ? '0 : write_q + 1'b1;
    end
    if (fetch) begin
      read_d = read_q == LAST ? '0 : read_q + 1'b1;
    end
    if (clear_i) begin
      write_d     = '0;
      read_d      = '0;
      used_d      = '0;
      out_valid_d = 1'b0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q     <= '0;
      read_q      <= '0;
      used_q      <= '0;
      out_valid_q <= 1'b0;
    end else begin
      write_q     <= write_d;
      read_q      <= read_d;
      used_q      <= used_d;
      out_valid_q <= out_valid_d;
    end
  end

  // Storage

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

  assign out_valid_o = out_valid_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) used_q <= UsedBits'(Depth))
  else $error("flk_sram_fifo: more words than Depth");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_sram_fifo: output changed before its transfer");
`endif

endmodule
