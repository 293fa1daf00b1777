# SPDX-License-Identifier: Apache-2.0
# The standard card in Quartus Prime, up to a fitted design without pins: build/vendor/quartus. Untried.
#
#   quartus_sh -t constraints/vendor/quartus.tcl [PART]
set argv0 quartus.tcl
source [file join [file dirname [info script]] card.tcl]
set part [part 5CEBA4F23C7]
cd $folder
load_package flow
project_new $top -overwrite
set_global_assignment -name FAMILY "Cyclone V"
set_global_assignment -name DEVICE $part
set_global_assignment -name TOP_LEVEL_ENTITY $top
set_global_assignment -name VERILOG_INPUT_VERSION VERILOG_2001
foreach file $files { set_global_assignment -name VERILOG_FILE $file }
set_global_assignment -name SDC_FILE [file join $root constraints vendor card.sdc]
set_parameter -name CLK_HZ $clk_hz
set_parameter -name FIRMWARE_HEX $image
execute_flow -compile
project_close
