# SPDX-License-Identifier: Apache-2.0
"""pytest plugin of all benches: choice of simulators and configurations, the seed, results, waveforms."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import pytest

from rtl import report_page
from rtl.sources import commit, configurations
from tb.lib.nightly import both, first
from tb.lib.runner import ROOT, SIMULATORS, recordings
from tb.lib.seeds import FIXED_SEED


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--sim", choices=SIMULATORS, help="run on this simulator only")
    parser.addoption(
        "--card", choices=list(configurations()), help="run the whole card's tests only, as this card"
    )
    parser.addoption("--all", action="store_true", help="run every test, those marked `nightly`, too")


def pytest_configure(config: pytest.Config) -> None:
    # The simulators lie beside the interpreter; a plain `.venv/bin/pytest` must find them too.
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    # For the Python inside each simulation, which imports all of cocotb.
    os.environ.setdefault("PYTHONPYCACHEPREFIX", str(ROOT / "build/pycache"))
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    # Set before xdist starts its workers, so that one number repeats the whole run.
    os.environ.setdefault("COCOTB_RANDOM_SEED", str(FIXED_SEED))
    # After Ctrl-C each worker of xdist would print this warning in six lines.
    os.environ.setdefault("PYTHONWARNINGS", "ignore:A plugin raised an exception during an old-style")


def pytest_report_header(config: pytest.Config) -> str:
    return f"random tests: repeat with SEED={os.environ['COCOTB_RANDOM_SEED']}"


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A folder in the place of build/reports and docs/evidence.json, for a command that writes a report."""
    monkeypatch.setattr(report_page, "REPORTS", tmp_path)
    monkeypatch.setattr(report_page, "EVIDENCE", tmp_path / "evidence.json")
    return tmp_path


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Chooses simulators for an argument `sim` and cards for `config`, unless the test chooses itself.

    A module runs on Icarus, and at night on Verilator, which compiles for long. The whole card runs on
    Verilator, for it takes minutes on Icarus: as the standard card, and at night as the small one.
    """
    sim, card = (metafunc.config.getoption(option) for option in ("--sim", "--card"))
    chosen = {
        name for mark in metafunc.definition.iter_markers("parametrize") for name in words(mark.args[0])
    }
    asked = set(metafunc.fixturenames) - chosen
    whole = "config" in metafunc.fixturenames
    if "sim" in asked and whole and sim == "icarus":
        metafunc.parametrize("sim", [pytest.param(sim, marks=pytest.mark.nightly)])
    elif "sim" in asked:
        metafunc.parametrize("sim", [sim] if sim else ["verilator"] if whole else both(*SIMULATORS))
    if "config" in asked:
        cards = list(configurations())
        metafunc.parametrize("config", [card] if card else cards[:1] if sim == "icarus" else first(cards))


def words(names: str | Sequence[str]) -> Sequence[str]:
    return re.findall(r"\w+", names) if isinstance(names, str) else names


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """A file of the night is not even imported: a tenth of a second to one for its tools."""
    if config.getoption("--all") or config.getoption("--card") or collection_path.suffix != ".py":
        return None  # as pytest decides
    return "\npytestmark = pytest.mark.nightly" in collection_path.read_text() or None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    others = [item for item in items if not wanted(item, config)]
    if others:
        items[:] = [item for item in items if wanted(item, config)]
        config.hook.pytest_deselected(items=others)


def wanted(item: pytest.Item, config: pytest.Config) -> bool:
    parameters = item.callspec.params if hasattr(item, "callspec") else {}
    sim, card = parameters.get("sim"), parameters.get("config")
    if sim and config.getoption("--sim") not in (None, sim):
        return False
    if config.getoption("--card"):
        return card == config.getoption("--card")
    if not config.getoption("--all"):
        return item.get_closest_marker("nightly") is None
    # Further cases run on one simulator and one card: what differs there shows in the first case.
    marks = item.callspec.marks if hasattr(item, "callspec") else []
    return [mark.name for mark in marks].count("nightly") < 2


# Last result of every test with commit and time, for `make trace`. Each run updates its
# own tests and keeps the rest.
RESULTS = ROOT / "build/results.json"
results: dict[str, str] = {}


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.failed:
        results[report.nodeid] = "failed"
    elif report.when == "call":
        results.setdefault(report.nodeid, report.outcome)


def pytest_report_teststatus(report: pytest.TestReport, config: pytest.Config) -> None:
    """Names a failed test at once, for the end of a run may be minutes away."""
    if report.failed and (terminal := config.pluginmanager.get_plugin("terminalreporter")):
        terminal.write_line(f"\nFAILED {report.nodeid}", red=True)


def pytest_sessionfinish(session: pytest.Session) -> None:
    # xdist workers report to the main process, which alone writes the file.
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
        if recording.others:
            terminalreporter.write_line(f"lines: {shown(*recording.others)}")
