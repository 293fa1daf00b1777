# SPDX-License-Identifier: Apache-2.0
# The standard card in Lattice Diamond, up to a routed design without pins: build/vendor/diamond. Untried.
#
#   diamondc constraints/vendor/diamond.tcl [PART]
set argv0 diamond.tcl
source [file join [file dirname [info script]] card.tcl]
set part [part LCMXO2-4000HC-4TG144I]
cd $folder
prj_project new -name $top -impl impl -dev $part -synthesis lse
foreach file $files { prj_src add $file }
prj_src add [file join $root constraints vendor card.sdc]
prj_impl option top $top
prj_impl option HDL_PARAM "CLK_HZ=$clk_hz;FIRMWARE_HEX=\"$image\""
prj_project save
prj_run PAR -impl impl
prj_project close
