# SPDX-License-Identifier: Apache-2.0
# Timing of the standard card, for the scripts of this folder. Untried. 1.5 times 12 MHz, as `make synth` asks for.
create_clock -name clk -period 55.5 [get_ports clk]
# Switches and serial lines are not synchronous to clk; each goes to two flip-flops first (LINE-5).
set_false_path -from [get_ports {rst_n sw_baud* sw_addr* modbus_rx drive_rx}]
set_false_path -to [get_ports {modbus_tx modbus_de drive_tx drive_de led_*}]
