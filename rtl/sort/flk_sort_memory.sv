// A memory of a merging step: sorted entries in the order in which they came, the next one in a register.
//
// Places are counted with a bit that says how often the memory has gone round. write_i puts data_i behind
// the others; the user sees that full_o is low, or that the entry at the head leaves in this cycle.
// head_o, with head_valid_o, is the entry of place head_at_o; pop_i takes it. Latency: an entry is at the
// head three cycles after it was written. Throughput: an entry a cycle, in and out.
// jump_i: the head goes to place jump_at_i, before pop_i, and nothing counts as read. Combinational: pop_i to the memory's read port. clear_i
// (synchronous) empties it.
module flk_sort_memory #(
  parameter  int unsigned Width     = 52,
  parameter  int unsigned Depth     = 16,  // entries, a power of two
  localparam int unsigned PlaceBits = $clog2(Depth) + 1
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 clear_i,
  // In
  input  logic                 write_i,
  input  logic [Width-1:0]     data_i,
  output logic                 full_o,
  output logic [PlaceBits-1:0] write_at_o,
  // Out
  output logic                 head_valid_o,
  output logic [Width-1:0]     head_o,
  output logic [PlaceBits-1:0] head_at_o,
  input  logic                 pop_i,
  // Places
  input  logic                 jump_i,
  input  logic [PlaceBits-1:0] jump_at_i
);

  localparam int unsigned SlotBits = PlaceBits - 1;

  typedef logic [PlaceBits-1:0] place_t;

  place_t           head_at_d, head_at_q, fetch_at_d, fetch_at_q, write_at_d, write_at_q;
  logic             head_valid_d, head_valid_q, read_valid_d, read_valid_q;
  logic             load, fetch;
  logic [Width-1:0] head_q, read;  // behind the head the memory's register

  flk_sram #(
    .Width(Width),
    .Depth(Depth)
  ) i_memory (
    .clk_i,
    .wr_en_i  (write_i),
    .wr_addr_i(write_at_q[SlotBits-1:0]),
    .wr_data_i(data_i),
    .rd_en_i  (fetch),
    .rd_addr_i(fetch_at_q[SlotBits-1:0]),
    .rd_data_o(read)
  );

  // A word that is written in this cycle is not there yet.
  assign load  = read_valid_q && (!head_valid_q || pop_i);
  assign fetch = write_at_q != fetch_at_q && (!read_valid_q || load);

  always_ff @(posedge clk_i) begin
    if (load) begin
      head_q <= read;
    end
  end

  always_comb begin
    head_at_d    = pop_i ? head_at_q + 1'b1 : head_at_q;
    fetch_at_d   = fetch ? fetch_at_q + 1'b1 : fetch_at_q;
    read_valid_d = fetch || (read_valid_q && !load);
    head_valid_d = load || (head_valid_q && !pop_i);
    write_at_d   = write_i ? write_at_q + 1'b1 : write_at_q;
    if (jump_i) begin
      head_at_d    = jump_at_i;
      fetch_at_d   = jump_at_i;
      read_valid_d = 1'b0;
      head_valid_d = 1'b0;
    end
    if (clear_i) begin
      head_at_d    = '0;
      fetch_at_d   = '0;
      read_valid_d = 1'b0;
      head_valid_d = 1'b0;
      write_at_d   = '0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      head_at_q    <= '0;
      fetch_at_q   <= '0;
      read_valid_q <= 1'b0;
      head_valid_q <= 1'b0;
      write_at_q   <= '0;
    end else begin
      head_at_q    <= head_at_d;
      fetch_at_q   <= fetch_at_d;
      read_valid_q <= read_valid_d;
      head_valid_q <= head_valid_d;
      write_at_q   <= write_at_d;
    end
  end

  assign full_o       = write_at_q == {~head_at_q[SlotBits], head_at_q[SlotBits-1:0]};
  assign write_at_o   = write_at_q;
  assign head_valid_o = head_valid_q;
  assign head_o       = head_q;
  assign head_at_o    = head_at_q;

`ifndef SYNTHESIS
  place_t held;
  assign held = write_at_q - head_at_q;
  assert property (@(posedge clk_i) disable iff (!rst_ni) 32'(held) <= Depth)
  else $error("flk_sort_memory: more entries than Depth");
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      fetch && write_i |-> write_at_q[SlotBits-1:0] != fetch_at_q[SlotBits-1:0])
  else $error("flk_sort_memory: read where it is written");
  assert property (@(posedge clk_i) disable iff (!rst_ni) pop_i |-> head_valid_q)
  else $error("flk_sort_memory: an entry taken that is not there");
`endif

endmodule
