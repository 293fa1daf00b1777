# SPDX-License-Identifier: Apache-2.0
"""Runs the example's bench on a Modbus RTU slave in Verilog, on Icarus; needs the installed package.

    python run.py --top holding_registers --clk-hz 500000 --baud 19200 --form 8E1 \\
        --parameter CLK_HZ=500000 --parameter BAUD=19200 holding_registers.v ...

--pins names clock, reset, rx, tx and DE of the top; `!` before the reset: active low. The bench writes 18 to
--register and prints the faults of the edges; with --strict it fails for them, too. Exit 1 when the slave
fails, 2 for a wrong option or a design that does not build.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from cocotb_tools.runner import get_results, get_runner

try:
    import cocotbext.rtu  # noqa: F401
except ModuleNotFoundError:
    print("run.py: cocotbext-rtu is missing: pip install the folder above this one", file=sys.stderr)
    sys.exit(2)

HERE = Path(__file__).resolve().parent


class Parser(argparse.ArgumentParser):
    """One line for a wrong option, and exit code 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}\n")


def number(low: int, high: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{low} to {high}, not {text!r}")
        return int(text)

    return parse


def pair(text: str) -> tuple[str, int]:
    name, _, value = text.partition("=")
    try:
        return name, int(value, 0)
    except ValueError:
        raise argparse.ArgumentTypeError(f"NAME=NUMBER, not {text!r}") from None


def pins(text: str) -> list[str]:
    if len(names := text.split(",")) != 5:
        raise argparse.ArgumentTypeError(f"five names with commas, not {text!r}")
    return names


def options() -> argparse.Namespace:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--top", required=True)
    parser.add_argument("--build", type=Path, default=Path("build"), help="folder for results (build)")
    parser.add_argument("--pins", type=pins, default="clk,rst,rx,tx,de")
    parser.add_argument("--clk-hz", type=number(1, 10**9), required=True)
    parser.add_argument("--baud", type=number(1, 10**7), required=True)
    parser.add_argument("--form", choices=("8N1", "8N2", "8E1", "8E2", "8O1", "8O2"), default="8E1")
    parser.add_argument("--unit", type=number(1, 247), default=1)
    parser.add_argument("--register", type=number(0, 65535), default=1)
    parser.add_argument("--parameter", type=pair, action="append", default=[])
    parser.add_argument("--input", type=pair, action="append", default=[], help="an input that never changes")
    parser.add_argument("--strict", action="store_true", help="a fault of the edges fails the bench, too")
    given = parser.parse_args()
    if missing := [path for path in given.files if not path.is_file()]:
        parser.error(f"there is no {missing[0]}")
    return given


def main() -> int:
    given = options()
    slave = {
        "pins": given.pins,
        "inputs": dict(given.input),
        **{name: getattr(given, name) for name in ("clk_hz", "baud", "form", "unit", "register", "strict")},
    }
    sys.path.insert(0, str(HERE))  # the runner hands the path on to the simulation
    runner = get_runner("icarus")
    try:
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
    except RuntimeError:
        print("run.py: the simulator failed; its messages are above", file=sys.stderr)
        return 2
    ran, failed = get_results(results)
    return 1 if failed or not ran else 0


if __name__ == "__main__":
    sys.exit(main())
