// Reads of a manager on a port of twice its width: which half of each beat is the manager's.
//
// For AXI4 managers that read single beats of Width bits under one identifier, on a port of 2 Width bits
// (AxSIZE says that they are narrow). The addresses' bits that say which half wait in order, at most Bursts.
// Combinational: all, but that the half comes from a register.
module flk_axi_half #(
  parameter int unsigned Width    = 256,
  parameter int unsigned AddrBits = 40,
  parameter int unsigned Bursts   = 256
) (
  input  logic                clk_i,
  input  logic                rst_ni,
  // Addresses that the port takes
  input  logic                ar_move_i,
  input  logic [AddrBits-1:0] ar_addr_i,
  // Beats
  input  logic                r_valid_i,
  input  logic [2*Width-1:0]  r_data_i,
  output logic [Width-1:0]    r_data_o
);

  localparam int unsigned HalfBit = $clog2(Width / 8);

  logic room, valid, upper, unused_full, unused_empty;
  logic [$clog2(Bursts+1)-1:0] unused_usage;

  flk_fifo #(
    .Width(1),
    .Depth(Bursts)
  ) i_halves (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (ar_move_i),
    .in_ready_o (room),
    .in_data_i  (ar_addr_i[HalfBit]),
    .out_valid_o(valid),
    .out_ready_i(r_valid_i),
    .out_data_o (upper),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (unused_empty)
  );

  assign r_data_o = upper ? r_data_i[2*Width-1:Width] : r_data_i[Width-1:0];

  logic unused_bits;
  assign unused_bits = ^{room, valid, ar_addr_i};

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) ar_move_i |-> room)
  else $error("flk_axi_half: more reads under way than Bursts");
  assert property (@(posedge clk_i) disable iff (!rst_ni) r_valid_i |-> valid)
  else $error("flk_axi_half: a beat that nobody asked for");
`endif

endmodule
