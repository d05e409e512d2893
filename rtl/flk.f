// Synthesizable sources of FLICKER, packages first; paths are relative to this file
// (verilator -F, slang -F). One module or package per file.
common/flk_param_pkg.sv
common/flk_pkg.sv
common/flk_table_pkg.sv
common/flk_fp_add.sv
common/flk_fp_mul.sv
common/flk_fp_convert.sv
common/flk_fp_cmp.sv
common/flk_exp_neg.sv
common/flk_log_opacity.sv
common/flk_pipe_reg.sv
common/flk_skid_buffer.sv
common/flk_fifo.sv
common/flk_stream_arbiter.sv
ctu/flk_prtu.sv
ctu/flk_mmu.sv
ctu/flk_ctu_controller.sv
ctu/flk_ctu.sv
render/flk_vru.sv
render/flk_channel.sv
render/flk_fifo_monitor.sv
render/flk_rendering_core.sv
render/flk_perf_counters.sv
sort/flk_compare_exchange.sv
sort/flk_bitonic_sorter.sv
flk_render_stage.sv
