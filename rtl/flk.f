// Synthesizable sources of FLICKER, packages first; paths are relative to this file
// (verilator -F, slang -F). One module or package per file.
common/flk_param_pkg.sv
common/flk_pkg.sv
common/flk_pipe_reg.sv
common/flk_skid_buffer.sv
common/flk_fifo.sv
common/flk_stream_arbiter.sv
sort/flk_compare_exchange.sv
sort/flk_bitonic_sorter.sv
