// First-in first-out queue of a stream, storage in flip-flops.
//
// Latency 1 (no fall-through), throughput 1 per cycle for Depth >= 2, every second cycle for
// Depth 1. in_ready_o and out_valid_o come from registers: a full queue takes nothing, even in the
// cycle in which an element leaves. out_data_o is read combinationally from the storage by a
// registered pointer, or with HeadRegister comes from a register that holds the oldest element.
// clear_i (synchronous) empties it: what it holds, and what it takes in that cycle, is gone in the next.
// Storage is not reset; Depth need not be a power of two.
module flk_fifo #(
  parameter  int unsigned Width     = 8,
  parameter  int unsigned Depth     = 16,
  parameter  bit          HeadRegister = 1'b0,
  localparam int unsigned UsageBits = $clog2(Depth + 1)  // 0 to Depth
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 clear_i,
  // Upstream
  input  logic                 in_valid_i,
  output logic                 in_ready_o,
  input  logic [Width-1:0]     in_data_i,
  // Downstream
  output logic                 out_valid_o,
  input  logic                 out_ready_i,
  output logic [Width-1:0]     out_data_o,
  // Fill level, registered
  output logic [UsageBits-1:0] usage_o,
  output logic                 full_o,
  output logic                 empty_o
);

  if (Width < 1) begin : gen_check_width
    $error("flk_fifo: Width must be at least 1");
  end
  if (Depth < 1 || Depth > 256) begin : gen_check_depth
    $error("flk_fifo: Depth must be 1 to 256 (storage is flip-flops)");
  end

  // Pointers and fill level

  localparam int unsigned PtrBits = Depth > 1 ? $clog2(Depth) : 1;  // 0 to Depth - 1
  localparam logic [PtrBits-1:0] LAST = PtrBits'(Depth - 1);

  logic [PtrBits-1:0]   write_d, write_q;
  logic [PtrBits-1:0]   read_d, read_q;
  logic [UsageBits-1:0] usage_d, usage_q;
  logic                 push, pop;

  assign push = in_valid_i && in_ready_o;
  assign pop  = out_valid_o && out_ready_i;

  always_comb begin
    write_d = write_q;
    read_d  = read_q;
    usage_d = usage_q;
    if (push) begin
      write_d = write_q == LAST ? '0 : write_q + 1'b1;
    end
    if (pop) begin
      read_d = read_q == LAST ? '0 : read_q + 1'b1;
    end
    if (push && !pop) begin
      usage_d = usage_q + 1'b1;
    end
    if (pop && !push) begin
      usage_d = usage_q - 1'b1;
    end
    if (clear_i) begin
      write_d = '0;
      read_d  = '0;
      usage_d = '0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q <= '0;
      read_q  <= '0;
      usage_q <= '0;
    end else begin
      write_q <= write_d;
      read_q  <= read_d;
      usage_q <= usage_d;
    end
  end

  // Storage

  logic [Width-1:0] storage_q[Depth];

  always_ff @(posedge clk_i) begin
    if (push) begin
      storage_q[write_q] <= in_data_i;
    end
  end

  // Outputs

  assign full_o      = usage_q == UsageBits'(Depth);
  assign empty_o     = usage_q == '0;
  assign usage_o     = usage_q;
  assign in_ready_o  = !full_o;
  assign out_valid_o = !empty_o;

  if (HeadRegister) begin : gen_head
    logic [PtrBits-1:0] next_q;  // behind the oldest
    logic [Width-1:0]   head_q;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        next_q <= PtrBits'(Depth > 1);
      end else if (clear_i) begin
        next_q <= PtrBits'(Depth > 1);
      end else if (pop) begin
        next_q <= next_q == LAST ? '0 : next_q + 1'b1;
      end
    end

    always_ff @(posedge clk_i) begin
      if (pop || empty_o) begin
        head_q <= usage_q <= UsageBits'(1) ? in_data_i : storage_q[next_q];
      end
    end

    assign out_data_o = head_q;
  end else begin : gen_head
    assign out_data_o = storage_q[read_q];
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) usage_q <= UsageBits'(Depth))
  else $error("flk_fifo: fill level above Depth");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_fifo: output changed before its transfer");
`endif

endmodule
