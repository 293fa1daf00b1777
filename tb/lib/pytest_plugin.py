# SPDX-License-Identifier: Apache-2.0
"""What all benches share: simulators and configurations that a test runs on, and the seed of the run."""

from __future__ import annotations

import json
import os
import random
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest

from rtl.sources import commit, configurations
from tb.lib.runner import ROOT, SIMULATORS, recordings


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--sim", choices=SIMULATORS, help="run on this simulator only (default: on both)")
    parser.addoption("--slow", action="store_true", help="run the tests marked `patient`, and only those")
    parser.addoption(
        "--card", choices=list(configurations()), help="run the tests of the whole card only, all as this one"
    )


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--card") and config.getoption("--slow"):
        raise pytest.UsageError("--card runs the slow ones, too: no --slow with it")
    # The simulators lie beside the interpreter; a plain `.venv/bin/pytest` must find them too.
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    # Set once, before xdist starts its workers, so that the whole run is repeated by one number.
    os.environ.setdefault("COCOTB_RANDOM_SEED", str(random.randrange(1 << 31)))


def pytest_report_header(config: pytest.Config) -> str:
    return f"random tests: repeat with COCOTB_RANDOM_SEED={os.environ['COCOTB_RANDOM_SEED']}"


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test with an argument `sim` runs on every simulator, one with `config` as cards: tb/lib/config.py."""
    sim, card = (metafunc.config.getoption(option) for option in ("--sim", "--card"))
    sims = [sim] if sim else SIMULATORS
    cards = [card] if card else configurations()
    marks = {mark.name for mark in metafunc.definition.iter_markers()}

    def wanted(config: str, sim: str = "verilator") -> bool:
        if card or config == "standard" or "everywhere" in marks:
            return True
        return sim == "verilator" and "long" not in marks

    if {"sim", "config"} <= set(metafunc.fixturenames):
        pairs = [(sim, config) for sim in sims for config in cards if wanted(config, sim)]
        metafunc.parametrize(("sim", "config"), pairs)
    elif "sim" in metafunc.fixturenames:
        metafunc.parametrize("sim", sims)
    elif "config" in metafunc.fixturenames:
        metafunc.parametrize("config", [config for config in cards if wanted(config)])


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    def wanted(item: pytest.Item) -> bool:
        if config.getoption("--card"):
            return "config" in getattr(item, "fixturenames", ())
        return config.getoption("--slow") == patient(item)

    others = [item for item in items if not wanted(item)]
    if others:
        items[:] = [item for item in items if wanted(item)]
        config.hook.pytest_deselected(items=others)


def patient(item: pytest.Item) -> bool:
    """A minute for little that others do not show: on Icarus, or at all where no simulator is chosen."""
    if item.get_closest_marker("patient") is None:
        return False
    return not hasattr(item, "callspec") or item.callspec.params.get("sim") != "verilator"


# Last result of every test, for `make trace` and `make report`: outcome, commit and time. Runs add to it: a
# part run alone takes nothing away.
RESULTS = ROOT / "build/results.json"
results: dict[str, str] = {}


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.failed:
        results[report.nodeid] = "failed"
    elif report.when == "call":
        results.setdefault(report.nodeid, report.outcome)


def pytest_sessionfinish(session: pytest.Session) -> None:
    # Workers report to the one process that started them.
    if results and not hasattr(session.config, "workerinput"):
        known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
        where = {"commit": commit(), "at": f"{datetime.now(UTC):%Y-%m-%d %H:%M}"}
        now = {test: {"outcome": outcome, **where} for test, outcome in results.items()}
        RESULTS.parent.mkdir(exist_ok=True)
        RESULTS.write_text(json.dumps(known | now, indent=0, sort_keys=True))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    def shown(*files: Path) -> str:
        return " ".join(str(file.relative_to(ROOT)) for file in files)

    for recording in recordings:
        terminalreporter.write_line(f"waves: gtkwave {shown(recording.wave, recording.view)}")
        commands = f"surfer --command-file {recording.view.stem}.sucl {recording.wave.name}"
        terminalreporter.write_line(f"       cd {shown(recording.wave.parent)} && {commands}")
        if recording.others:
            terminalreporter.write_line(f"lines: {shown(*recording.others)}")
