// flk_cluster_cull behind the ports that fetch_harness.cpp drives.
module cluster_cull_bench
  import flk_preproc_pkg::*;
#(
  parameter int unsigned BufferBeats = 16
) (
  input  logic            clk_i,
  input  logic            rst_ni,
  input  logic            start_i,
  output logic            idle_o,
  output logic            done_o,
  input  logic [959:0]    registers_i,
  output logic [191:0]    status_o,
  input  logic            in_valid_i,
  output logic            in_ready_o,
  input  logic [95:0]     in_data_i,
  output logic            out_valid_o,
  input  logic            out_ready_i,
  output logic [287:0]    out_data_o,
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
  logic [31:0] clusters, gaussians;
  kept_t cluster;
  boxed_t box;

  assign in_ready_o = 1'b0;
  assign unused = ^{in_valid_i, in_data_i, registers_i[959:954]};

  // Word by word: error and damaged, culled clusters and Gaussians.
  assign status_o = 192'({gaussians, clusters, 30'b0, damaged, error});
  assign out_data_o = 288'({box, 9'b0, out_end, cluster});

  flk_cluster_cull #(
    .BufferBeats(BufferBeats)
  ) i_dut (
    .clk_i,
    .rst_ni,
    .start_i,
    .idle_o,
    .setup_i           (registers_i[895:0]),
    .table_i           (registers_i[896+:BEAT_BITS]),
    .clusters_i        (registers_i[896+BEAT_BITS+:24]),
    .done_o,
    .error_o           (error),
    .damaged_o         (damaged),
    .culled_clusters_o (clusters),
    .culled_gaussians_o(gaussians),
    .out_valid_o,
    .out_ready_i,
    .out_end_o         (out_end),
    .out_cluster_o     (cluster),
    .out_box_o         (box),
    .ar_valid_o        (mem_ar_valid_o),
    .ar_ready_i        (mem_ar_ready_i),
    .ar_o              ({mem_ar_id_o, mem_ar_addr_o, mem_ar_len_o, mem_ar_size_o, mem_ar_burst_o}),
    .r_valid_i         (mem_r_valid_i),
    .r_ready_o         (mem_r_ready_o),
    .r_i               ({mem_r_id_i, mem_r_last_i, mem_r_resp_i, mem_r_data_i})
  );

endmodule
