// A flk_fifo inside a unit holds the entries of a list that a proof keeps, the oldest first. All of it
// links registers, which induction needs.
module fv_fifo_list #(
  parameter  int unsigned Width     = 1,
  parameter  int unsigned Depth     = 2,
  localparam int unsigned UsageBits = $clog2(Depth + 1),
  localparam int unsigned PtrBits   = Depth > 1 ? $clog2(Depth) : 1,
  localparam int unsigned SlotBits  = UsageBits + 1  // sum of two slot numbers
) (
  input logic                        rst_ni,
  input logic [UsageBits-1:0]        count_i,
  input logic [Depth-1:0][Width-1:0] list_i,
  // Registers of flk_fifo
  input logic [UsageBits-1:0]        usage_i,
  input logic [PtrBits-1:0]          read_i,
  input logic [PtrBits-1:0]          write_i,
  input logic [Depth-1:0][Width-1:0] storage_i
);

  function automatic logic [SlotBits-1:0] slot(logic [UsageBits-1:0] distance);
    logic [SlotBits-1:0] sum;
    sum = SlotBits'(read_i) + SlotBits'(distance);
    return sum >= SlotBits'(Depth) ? sum - SlotBits'(Depth) : sum;
  endfunction

  always_comb begin
    if (rst_ni) begin
      l_usage: assert (usage_i == count_i && count_i <= UsageBits'(Depth));
      l_pointers: assert (SlotBits'(read_i) < SlotBits'(Depth) &&
                          SlotBits'(write_i) == slot(count_i));
    end
  end

  for (genvar k = 0; k < Depth; k++) begin : gen_entry
    always_comb begin
      if (rst_ni && UsageBits'(k) < count_i) begin
        l_entry: assert (storage_i[PtrBits'(slot(UsageBits'(k)))] == list_i[k]);
      end
    end
  end

endmodule
