# SPDX-License-Identifier: Apache-2.0
"""Runs the example's bench on a Modbus RTU slave in Verilog, on Icarus; needs the installed package.

    python run.py --top holding_registers --clk-hz 500000 --baud 19200 --form 8E1 \\
        --parameter CLK_HZ=500000 --parameter BAUD=19200 holding_registers.v ...

--pins are clock, reset, rx, tx and DE of the top; `!` before the reset: active low. --register is one that
takes the value 18 and gives it back.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from cocotb_tools.runner import get_results, get_runner

HERE = Path(__file__).resolve().parent


def pair(text: str) -> tuple[str, int]:
    name, value = text.split("=")
    return name, int(value, 0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--top", required=True)
    parser.add_argument("--build", type=Path, default=Path("build"), help="folder for results (build)")
    parser.add_argument("--pins", default="clk,rst,rx,tx,de")
    parser.add_argument("--clk-hz", type=int, required=True)
    parser.add_argument("--baud", type=int, required=True)
    parser.add_argument("--form", default="8E1")
    parser.add_argument("--unit", type=int, default=1)
    parser.add_argument("--register", type=int, default=1)
    parser.add_argument("--parameter", type=pair, action="append", default=[])
    parser.add_argument("--input", type=pair, action="append", default=[], help="an input that never changes")
    given = parser.parse_args()
    slave = {
        "pins": given.pins.split(","),
        "inputs": dict(given.input),
        **{name: getattr(given, name) for name in ("clk_hz", "baud", "form", "unit", "register")},
    }
    sys.path.insert(0, str(HERE))  # the runner hands the path on to the simulation
    runner = get_runner("icarus")
    runner.build(
        sources=[path.resolve() for path in given.files],
        hdl_toplevel=given.top,
        parameters=dict(given.parameter),
        build_dir=given.build,
        timescale=("1ns", "1ps"),
        always=True,
    )
    results = runner.test(
        hdl_toplevel=given.top,
        hdl_toplevel_lang="verilog",
        test_module="slave_bench",
        build_dir=given.build,
        test_dir=given.build,
        extra_env={"SLAVE": json.dumps(slave)},
    )
    ran, failed = get_results(results)
    return 1 if failed or not ran else 0


if __name__ == "__main__":
    sys.exit(main())
