# The chip beside the processor of a Zynq UltraScale+, as a Vivado project: block design, top, constraints, bitstream. Vivado 2022.1 or later.
#
#     python soc/xilinx/package_ip.py --chip tiny --out build/ip/flicker
#     vivado -mode batch -source soc/xilinx/design.tcl -tclargs kv260 build/ip/flicker
#
# Not run: no vendor tool is part of this repository. The processor's memory is the chip's: port S_AXI_HP0 behind a SmartConnect, which brings the widths
# together; registers are at 0xA000_0000 behind M_AXI_HPM0, the interrupt is the first of pl_ps_irq0 (121 of the GIC).

# Board: part, board's name for presets, MHz of the chip.
set boards {
  kv260  {xck26-sfvc784-2LV-c  xilinx.com:kv260_som:part0:1.4  150}
  zcu104 {xczu7ev-ffvc1156-2-e xilinx.com:zcu104:part0:1.1     150}
  zcu102 {xczu9eg-ffvb1156-2-e xilinx.com:zcu102:part0:3.4     150}
}

if {[llength $argv] != 2 || ![dict exists $boards [lindex $argv 0]]} {
  puts stderr "design.tcl: two arguments: a board ([join [dict keys $boards] {, }]) and the folder of the IP"
  exit 2
}
lassign $argv board ip
lassign [dict get $boards $board] part preset mhz
if {![file exists $ip/component.xml]} {
  puts stderr "design.tcl: $ip/component.xml: no such file: soc/xilinx/package_ip.py makes it"
  exit 2
}
set here [file dirname [file normalize [info script]]]
set folder [file normalize build/vivado/$board]

create_project -force flicker $folder -part $part
set_property board_part $preset [current_project]
set_property ip_repo_paths [file normalize $ip] [current_project]
update_ip_catalog

# ---- block design -------------------------------------------------------------------------------------

create_bd_design system
set ps [create_bd_cell -type ip -vlnv xilinx.com:ip:zynq_ultra_ps_e ps]
apply_bd_automation -rule xilinx.com:bd_rule:zynq_ultra_ps_e -config {apply_board_preset 1} $ps
set_property -dict [list \
  CONFIG.PSU__USE__M_AXI_GP0 1 CONFIG.PSU__USE__M_AXI_GP1 0 CONFIG.PSU__USE__M_AXI_GP2 0 \
  CONFIG.PSU__USE__S_AXI_GP2 1 CONFIG.PSU__SAXIGP2__DATA_WIDTH 128 \
  CONFIG.PSU__USE__IRQ0 1 CONFIG.PSU__FPGA_PL0_ENABLE 1 CONFIG.PSU__CRL_APB__PL0_REF_CTRL__FREQMHZ $mhz \
] $ps
set chip [create_bd_cell -type ip -vlnv flicker:ip:flk_top_axi chip]
set reset [create_bd_cell -type ip -vlnv xilinx.com:ip:proc_sys_reset reset]
set low [create_bd_cell -type ip -vlnv xilinx.com:ip:xlconstant low]
set_property CONFIG.CONST_VAL 0 $low
foreach name {registers memory} {
  set_property CONFIG.NUM_SI 1 [create_bd_cell -type ip -vlnv xilinx.com:ip:smartconnect $name]
}

connect_bd_net [get_bd_pins ps/pl_clk0] [get_bd_pins chip/aclk] [get_bd_pins reset/slowest_sync_clk] \
  [get_bd_pins registers/aclk] [get_bd_pins memory/aclk] [get_bd_pins ps/maxihpm0_fpd_aclk] [get_bd_pins ps/saxihp0_fpd_aclk]
connect_bd_net [get_bd_pins ps/pl_resetn0] [get_bd_pins reset/ext_reset_in]
connect_bd_net [get_bd_pins reset/peripheral_aresetn] [get_bd_pins chip/aresetn] [get_bd_pins registers/aresetn] [get_bd_pins memory/aresetn]
connect_bd_net [get_bd_pins low/dout] [get_bd_pins chip/test_en]
connect_bd_intf_net [get_bd_intf_pins ps/M_AXI_HPM0_FPD] [get_bd_intf_pins registers/S00_AXI]
connect_bd_intf_net [get_bd_intf_pins registers/M00_AXI] [get_bd_intf_pins chip/s_axil]
connect_bd_intf_net [get_bd_intf_pins chip/m_axi] [get_bd_intf_pins memory/S00_AXI]
connect_bd_intf_net [get_bd_intf_pins memory/M00_AXI] [get_bd_intf_pins ps/S_AXI_HP0_FPD]
connect_bd_net [get_bd_pins chip/irq] [get_bd_pins ps/pl_ps_irq0]

assign_bd_address -offset 0xA0000000 -range 4K -target_address_space [get_bd_addr_spaces ps/Data] [get_bd_addr_segs chip/s_axil/*]
assign_bd_address -target_address_space [get_bd_addr_spaces chip/m_axi] [get_bd_addr_segs ps/SAXIGP2/HP0_DDR_*]
validate_bd_design
save_bd_design

# ---- top, constraints, bitstream ----------------------------------------------------------------------

add_files -norecurse [make_wrapper -files [get_files system.bd] -top]
set_property top system_wrapper [current_fileset]
add_files -fileset constrs_1 -norecurse $here/chip.xdc
launch_runs impl_1 -to_step write_bitstream -jobs 4
wait_on_run impl_1
open_run impl_1
report_utilization -hierarchical -file $folder/utilisation.txt
report_timing_summary -file $folder/timing.txt
write_hw_platform -fixed -include_bit -force $folder/flicker.xsa
puts "design.tcl: $folder/flicker.xsa"
