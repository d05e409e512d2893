# Constraints of the chip inside a design (soc/xilinx/design.tcl). Its clock is constrained where it is made; it has no pins of its own.
#
# aresetn may fall at any time: flk_reset_sync times its release, so its way to these flip-flops is no path. They stand together.
set_false_path -to [get_pins -hierarchical -filter {NAME =~ *i_reset/released_q_reg[*]/CLR}]
set_property ASYNC_REG TRUE [get_cells -hierarchical -filter {NAME =~ *i_reset/released_q_reg[*]}]
