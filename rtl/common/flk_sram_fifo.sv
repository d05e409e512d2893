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

  // Where the next word goes and the oldest one lies, each with a bit that says how often it has gone round: what
  // moves a pointer is then only its enable, and no sum of both.

  localparam int unsigned PtrBits = Depth > 1 ? $clog2(Depth) : 1;
  localparam logic [PtrBits-1:0] LAST = PtrBits'(Depth - 1);

  logic [PtrBits-1:0] write_d, write_q;
  logic [PtrBits-1:0] read_d, read_q;
  logic               write_round_d, write_round_q;
  logic               read_round_d, read_round_q;
  logic               same, nothing;  // no word in the memory
  logic               out_valid_d, out_valid_q;
  logic               push, fetch;

  assign same       = write_q == read_q;
  assign nothing    = same && write_round_q == read_round_q;
  assign empty_o    = nothing && !out_valid_q;
  assign in_ready_o = !same || write_round_q == read_round_q;
  assign push       = in_valid_i && in_ready_o;
  // A word that is written in this cycle is not there yet: no word is read as it is written.
  assign fetch      = !nothing && (!out_valid_q || out_ready_i);

  always_comb begin
    write_d       = write_q;
    write_round_d = write_round_q;
    read_d        = read_q;
    read_round_d  = read_round_q;
    out_valid_d   = fetch || (out_valid_q && !out_ready_i);
    if (push) begin
      write_d       = write_q == LAST ? '0 : write_q + 1'b1;
      write_round_d = write_round_q ^ (write_q == LAST);
    end
    if (fetch) begin
      read_d       = read_q == LAST ? '0 : read_q + 1'b1;
      read_round_d = read_round_q ^ (read_q == LAST);
    end
    if (clear_i) begin
      write_d       = '0;
      write_round_d = 1'b0;
      read_d        = '0;
      read_round_d  = 1'b0;
      out_valid_d   = 1'b0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q       <= '0;
      write_round_q <= 1'b0;
      read_q        <= '0;
      read_round_q  <= 1'b0;
      out_valid_q   <= 1'b0;
    end else begin
      write_q       <= write_d;
      write_round_q <= write_round_d;
      read_q        <= read_d;
      read_round_q  <= read_round_d;
      out_valid_q   <= out_valid_d;
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
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      write_round_q == read_round_q ? write_q >= read_q : write_q <= read_q)
  else $error("flk_sram_fifo: more words than Depth");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_sram_fifo: output changed before its transfer");
`endif

endmodule
