# SPDX-License-Identifier: Apache-2.0
"""pytest plugin of all benches: choice of simulators and configurations, the seed, results, waveforms."""

from __future__ import annotations

import json
import os
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest

from rtl.sources import commit, configurations
from tb.lib.runner import ROOT, SIMULATORS, recordings

# `make test` repeats its random tests by this seed. SEED= gives another; the long run of CI draws one.
FIXED_SEED = 1104483726


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--sim", choices=SIMULATORS, help="run on this simulator only")
    parser.addoption(
        "--card", choices=list(configurations()), help="run the whole card's tests only, as this card"
    )
    parser.addoption("--all", action="store_true", help="run every test, not only the choice of `make test`")
    parser.addoption(
        "--rest", action="store_true", help="with --all, the rest of CI: without `make test` and twins"
    )
    parser.addoption(
        "--figures", action="store_true", help="run the checks of measured pages, and only those"
    )


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


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test with an argument `sim` runs on both simulators, a test with `config` as both cards."""
    sim, card = (metafunc.config.getoption(option) for option in ("--sim", "--card"))
    sims = [sim] if sim else SIMULATORS
    cards = [card] if card else configurations()
    names = set(metafunc.fixturenames)
    if {"sim", "config"} <= names:
        metafunc.parametrize(("sim", "config"), [(sim, config) for sim in sims for config in cards])
    elif "sim" in names:
        metafunc.parametrize("sim", sims)
    elif "config" in names:
        metafunc.parametrize("config", cards)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    others = [item for item in items if not wanted(item, config)]
    if others:
        items[:] = [item for item in items if wanted(item, config)]
        config.hook.pytest_deselected(items=others)


def wanted(item: pytest.Item, config: pytest.Config) -> bool:
    cards = item.get_closest_marker("cards")
    if cards and place(item)[1] not in cards.args:
        return False
    if config.getoption("--figures") or item.get_closest_marker("figures"):
        return config.getoption("--figures") and item.get_closest_marker("figures") is not None
    if config.getoption("--card"):
        return "config" in getattr(item, "fixturenames", ())
    if config.getoption("--all"):
        known = in_make_test(item) or item.get_closest_marker("twin")
        return not costly(item, config) and not (config.getoption("--rest") and known)
    return in_make_test(item)


def place(item: pytest.Item) -> tuple[str | None, str | None]:
    """Simulator and card of a test; None where the test has no choice."""
    parameters = item.callspec.params if hasattr(item, "callspec") else {}
    return parameters.get("sim"), parameters.get("config")


def costly(item: pytest.Item, config: pytest.Config) -> bool:
    """Tests of the whole card that take minutes on Icarus: all but the manual's examples (marked `examples`).

    `SIM=icarus` asks for those of the standard card, `CARD=tiny` for those of the small one: SERV takes ten
    times the clocks.
    """
    sim, card = place(item)
    if sim != "icarus" or card is None or item.get_closest_marker("all_cards"):
        return False
    return card == "tiny" or not (item.get_closest_marker("examples") or config.getoption("--sim"))


def in_make_test(item: pytest.Item) -> bool:
    """Large modules on both simulators, small ones on Icarus, the whole card on Verilator.

    Verilator compiles for long and runs fast. It runs every small module as a part of the card. Tests marked
    `all_cards` run as both cards on both simulators. Tests marked `slow` are left to CI: each rule has a test
    that takes less time. Tests marked `needs` wait for tools that `make test` does not install.
    """
    sim, config = place(item)
    # A case has a mark of its own beside that of its test.
    if any(not slow.args or sim in slow.args for slow in item.iter_markers("slow")):
        return False
    if item.get_closest_marker("all_cards"):
        return True
    if item.get_closest_marker("needs") or config == "tiny":
        return False
    # SIM=verilator asks for all of them.
    if sim == "verilator" and item.path.name in SMALL and not item.config.getoption("--sim"):
        return False
    return not (sim == "icarus" and config)


# Benches that take less time on Icarus than Verilator takes to compile the module.
SMALL = {
    f"test_{module}.py"
    for module in (
        *(
            "agents",
            "baud_base",
            "baud_divider",
            "bcc",
            "break_filter",
            "bus_arbiter",
            "card_tables",
            "card_time",
            "crc16_modbus",
        ),
        *("firmware_ram", "glitch_filter", "guarded_bit", "loopback_end", "mailbox_regs", "parity_guard"),
        *("reset_sync", "reply_slot", "request_fate", "rs485_dir", "rtu_tx", "silence_timer", "supervisor"),
        *("start_watch", "switch_sampler", "sync_2ff", "telegram_slot", "holding_registers"),
    )
}


# Last result of every test with commit and time, for `make trace` and `make report`. Each run updates its
# own tests and keeps the rest.
RESULTS = ROOT / "build/results.json"
results: dict[str, str] = {}


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.failed:
        results[report.nodeid] = "failed"
    elif report.when == "call":
        results.setdefault(report.nodeid, report.outcome)


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
        commands = f"surfer --command-file {recording.view.stem}.sucl {recording.wave.name}"
        terminalreporter.write_line(f"       cd {shown(recording.wave.parent)} && {commands}")
        if recording.others:
            terminalreporter.write_line(f"lines: {shown(*recording.others)}")
