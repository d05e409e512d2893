// Four list readers, each with a port of its own.
module list_readers_bench
  import flk_axi_pkg::*;
#(
  parameter int unsigned Contexts = 4,
  parameter int unsigned Slots    = 32
) (
  input  logic        clk_i,
  input  logic        rst_ni,
  input  logic        start_i,
  output logic        idle_o,
  output logic        error_o,
  input  logic [33:0] list_base_i,
  input  logic [33:0] pointer_base_i,
  input  logic [7:0]  columns_i,
  input  logic [24:0] chunks_i,
  input  logic [3:0]  tile_valid_i,
  output logic [3:0]  tile_ready_o,
  input  logic [31:0] tile_x_i,
  input  logic [31:0] tile_y_i,
  output logic [3:0]  out_valid_o,
  output logic [3:0]  out_last_o,
`define PORT(n) \
  output logic    p``n``_ar_valid_o, \
  input  logic    p``n``_ar_ready_i, \
  output axi_ax_t p``n``_ar_o, \
  input  logic    p``n``_r_valid_i, \
  output logic    p``n``_r_ready_o, \
  input  axi_r_t  p``n``_r_i
  `PORT(0),
  `PORT(1),
  `PORT(2),
  `PORT(3)
);

  logic [3:0] idle, error;

  assign error_o = |error;

`define READER(n) \
  logic [3:0] count_``n; \
  logic [471:0] entries_``n; \
  flk_list_reader #(.Contexts(Contexts), .Slots(Slots)) i_reader_``n ( \
    .clk_i, .rst_ni, .start_i, .clear_i(1'b0), .idle_o(idle[n]), .error_o(error[n]), \
    .list_base_i, .pointer_base_i, .columns_i, .chunks_i, \
    .tile_valid_i(tile_valid_i[n]), .tile_ready_o(tile_ready_o[n]), \
    .tile_x_i(tile_x_i[8*n+:8]), .tile_y_i(tile_y_i[8*n+:8]), \
    .out_valid_o(out_valid_o[n]), .out_ready_i(1'b1), .out_entries_o(entries_``n), \
    .out_count_o(count_``n), .out_last_o(out_last_o[n]), \
    .ar_valid_o(p``n``_ar_valid_o), .ar_ready_i(p``n``_ar_ready_i), .ar_o(p``n``_ar_o), \
    .r_valid_i(p``n``_r_valid_i), .r_ready_o(p``n``_r_ready_o), .r_i(p``n``_r_i));

  `READER(0)
  `READER(1)
  `READER(2)
  `READER(3)

endmodule
