# SPDX-License-Identifier: Apache-2.0
# The standard card in Vivado, up to a routed design without pins: reports in build/vendor/vivado. Untried.
#
#   vivado -mode batch -source constraints/vendor/vivado.tcl -tclargs [PART]
set argv0 vivado.tcl
source [file join [file dirname [info script]] card.tcl]
set part [part xc7a35tcpg236-1]
read_verilog $files
read_xdc [file join $root constraints vendor card.sdc]
synth_design -top $top -part $part -generic "CLK_HZ=$clk_hz" -generic "FIRMWARE_HEX=\"$image\""
opt_design
place_design
route_design
report_utilization -file [file join $folder utilization.txt]
report_timing_summary -file [file join $folder timing.txt]
write_checkpoint -force [file join $folder $top.dcp]
