// flk_geometry_fetch behind the ports that fetch_harness.cpp drives.
module geometry_fetch_bench
  import flk_preproc_pkg::*;
#(
  parameter int unsigned BufferBeats = 96,
  parameter int unsigned Clusters    = 8
) (
  input  logic            clk_i,
  input  logic            rst_ni,
  input  logic            start_i,
  output logic            idle_o,
  output logic            done_o,
  input  logic [191:0]    registers_i,
  output logic [191:0]    status_o,
  input  logic            in_valid_i,
  output logic            in_ready_o,
  input  logic [95:0]     in_data_i,
  output logic            out_valid_o,
  input  logic            out_ready_i,
  output logic [1439:0]   out_data_o,
  output logic            mem_ar_valid_o,
  input  logic            mem_ar_ready_i,
  output logic [3:0]      mem_ar_id_o,
  output logic [39:0]     mem_ar_addr_o,
  output logic [7:0]      mem_ar_len_o,
  output logic [2:0]      mem_ar_size_o,
  output logic [1:0]      mem_ar_burst_o,
  input  logic            mem_r_valid_i,
  output logic            mem_r_ready_o,
  input  logic [3:0]      mem_r_id_i,
  input  logic [511:0]    mem_r_data_i,
  input  logic [1:0]      mem_r_resp_i,
  input  logic            mem_r_last_i
);

  logic error, damaged, out_end, unused;
  logic [31:0] header_beats, geometry_beats;
  group_t group;
  logic [23:0] cluster, cluster_q;

  assign unused = ^{in_data_i[95:55], registers_i[191:165]};
  assign status_o = 192'({geometry_beats, header_beats, 30'b0, damaged, error});
  assign out_data_o = 1440'({cluster_q, out_end, group});

  // The cluster that the unit is at when it gives a group.
  always_ff @(posedge clk_i) begin
    if (!out_valid_o || out_ready_i) begin
      cluster_q <= cluster;
    end
  end

  if ($bits(group_t) != 1347) begin : gen_check
    $error("geometry_fetch_bench: group_t is not as test_geometry_fetch.py reads it");
  end

  flk_geometry_fetch #(
    .BufferBeats(BufferBeats),
    .Clusters   (Clusters)
  ) i_dut (
    .clk_i,
    .rst_ni,
    .start_i,
    .idle_o,
    .chunked_i       (registers_i[164]),
    .position_i      (registers_i[95:0]),
    .headers_i       (registers_i[96+:BEAT_BITS]),
    .geometry_i      (registers_i[130+:BEAT_BITS]),
    .done_o,
    .error_o         (error),
    .damaged_o       (damaged),
    .header_beats_o  (header_beats),
    .geometry_beats_o(geometry_beats),
    .cluster_o       (cluster),
    .in_valid_i,
    .in_ready_o,
    .in_end_i        (in_data_i[54]),
    .in_cluster_i    (in_data_i[53:0]),
    .out_valid_o,
    .out_ready_i,
    .out_end_o       (out_end),
    .out_group_o     (group),
    .ar_valid_o      (mem_ar_valid_o),
    .ar_ready_i      (mem_ar_ready_i),
    .ar_o            ({mem_ar_id_o, mem_ar_addr_o, mem_ar_len_o, mem_ar_size_o, mem_ar_burst_o}),
    .r_valid_i       (mem_r_valid_i),
    .r_ready_o       (mem_r_ready_o),
    .r_i             ({mem_r_id_i, mem_r_last_i, mem_r_resp_i, mem_r_data_i})
  );

endmodule
