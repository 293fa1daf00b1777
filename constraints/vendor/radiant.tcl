# SPDX-License-Identifier: Apache-2.0
# The standard card in Lattice Radiant, up to a routed design without pins: build/vendor/radiant. Untried.
#
#   radiantc constraints/vendor/radiant.tcl [PART]
set argv0 radiant.tcl
source [file join [file dirname [info script]] card.tcl]
set part [part LIFCL-40-7BG400I]
cd $folder
prj_create -name $top -impl impl -dev $part -synthesis lse
foreach file $files { prj_add_source $file }
prj_add_source [file join $root constraints vendor card.sdc]
prj_set_impl_opt -impl impl top $top
prj_set_impl_opt -impl impl HDL_PARAM "CLK_HZ=$clk_hz;FIRMWARE_HEX=\"$image\""
prj_save
prj_run PAR -impl impl
prj_close
