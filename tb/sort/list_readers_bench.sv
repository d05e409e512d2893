// Four list readers, each with a port of its own.
module list_readers_bench #(
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
  output logic         p``n``_ar_valid_o, \
  input  logic         p``n``_ar_ready_i, \
  output logic [3:0]   p``n``_ar_id_o, \
  output logic [39:0]  p``n``_ar_addr_o, \
  output logic [7:0]   p``n``_ar_len_o, \
  output logic [2:0]   p``n``_ar_size_o, \
  output logic [1:0]   p``n``_ar_burst_o, \
  input  logic         p``n``_r_valid_i, \
  output logic         p``n``_r_ready_o, \
  input  logic [3:0]   p``n``_r_id_i, \
  input  logic [511:0] p``n``_r_data_i, \
  input  logic [1:0]   p``n``_r_resp_i, \
  input  logic         p``n``_r_last_i
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
    .ar_valid_o(p``n``_ar_valid_o), .ar_ready_i(p``n``_ar_ready_i), .ar_id_o(p``n``_ar_id_o), \
    .ar_addr_o(p``n``_ar_addr_o), .ar_len_o(p``n``_ar_len_o), .ar_size_o(p``n``_ar_size_o), \
    .ar_burst_o(p``n``_ar_burst_o), .r_valid_i(p``n``_r_valid_i), .r_ready_o(p``n``_r_ready_o), \
    .r_id_i(p``n``_r_id_i), .r_data_i(p``n``_r_data_i), .r_resp_i(p``n``_r_resp_i), \
    .r_last_i(p``n``_r_last_i));

  `READER(0)
  `READER(1)
  `READER(2)
  `READER(3)

endmodule
