# SPDX-License-Identifier: Apache-2.0
# What the scripts of this folder share: files, top, clock and image of the standard card, from `make sources`.
#
# Untried with any vendor's tool. Run `make firmware` first. A script ends with an error when a file is missing.
set root [file normalize [file join [file dirname [info script]] .. ..]]
set top rtu2fc
set clk_hz 12000000
set image [file join $root build firmware.hex]
if {![file exists $image]} { error "$image is missing; run make firmware" }
set files [split [string trim [exec make -s -C $root sources]] "\n"]
set folder [file join $root build vendor [file rootname [file tail $argv0]]]
file mkdir $folder
# The first word of the command line, else `default`.
proc part {default} {
  global argv
  return [expr {[llength $argv] ? [lindex $argv 0] : $default}]
}
