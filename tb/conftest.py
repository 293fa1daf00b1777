# SPDX-License-Identifier: Apache-2.0
"""What all benches share: the simulators a test runs on, and the seed of the run."""

from __future__ import annotations

import os
import random
import sys
from pathlib import Path

import pytest

from tb.lib.runner import ROOT, SIMULATORS, waves_written


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--sim", choices=SIMULATORS, help="run on this simulator only (default: on both)")


def pytest_configure(config: pytest.Config) -> None:
    # The simulators lie beside the interpreter; a plain `.venv/bin/pytest` must find them too.
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    # Set once, before xdist starts its workers, so that the whole run is repeated by one number.
    os.environ.setdefault("COCOTB_RANDOM_SEED", str(random.randrange(1 << 31)))


def pytest_report_header(config: pytest.Config) -> str:
    return f"random tests: repeat with COCOTB_RANDOM_SEED={os.environ['COCOTB_RANDOM_SEED']}"


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test with an argument `sim` runs on every simulator."""
    if "sim" in metafunc.fixturenames:
        chosen = metafunc.config.getoption("--sim")
        metafunc.parametrize("sim", [chosen] if chosen else SIMULATORS)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for files in waves_written:
        terminalreporter.write_line(
            "waves: gtkwave " + " ".join(str(file.relative_to(ROOT)) for file in files)
        )
