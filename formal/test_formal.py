# SPDX-License-Identifier: Apache-2.0
"""Tests of the proofs: they hold on the Verilog as it is, and fail on a broken module."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from formal import pins as formal_pins
from formal import prove as formal
from rtl.sources import ROOT, bench_file
from tb.lib.nightly import first
from tb.lib.planted import bugs

RULES = {
    "bcc": ["FC-1"],
    "break_filter": ["FRAME-3", "FRAME-6"],
    "bus_arbiter": ["FRAME-5", "SAFE-5"],
    "commit_gate": ["FRAME-6", "FRAME-7", "FC-9", "MAP-9", "SAFE-1", "SAFE-7", "SAFE-8"],
    "crc16_modbus": ["FRAME-4"],
    "drive_port": ["SAFE-1", "SAFE-2", "SAFE-7", "FC-8", "FC-10"],
    "driver_limit": ["SAFE-2", "SAFE-6"],
    "fc_rx": ["FC-1", "FC-2", "FC-7", "FC-8"],
    "fc_tx": ["FC-1", "SAFE-7"],
    "guarded_bit": ["SAFE-4"],
    "master_loss": ["SAFE-7", "SAFE-4"],
    "mailbox": ["SAFE-1", "SAFE-7", "FRAME-5", "FRAME-6", "FRAME-7", "FC-8"],
    "mailbox_regs": ["FRAME-4", "FC-8"],
    "network_port": ["SAFE-2", "SAFE-3", "FRAME-1", "FRAME-6", "FRAME-8", "LINE-5", "LINE-6"],
    "rs485_dir": ["LINE-6", "FC-10"],
    "rtu_rx": ["FRAME-2", "FRAME-3", "FRAME-4", "FRAME-5", "FRAME-6", "SAFE-3"],
    "rtu_tx": ["FRAME-4", "SAFE-2", "SAFE-4"],
    "silence_timer": ["FRAME-1", "FC-8"],
    "soft_core": ["SAFE-4"],
    "supervisor": ["WDG-1", "LED-5", "LOOP-1"],
    "uart": ["LINE-1", "LINE-3", "LINE-5", "FRAME-4", "FC-1"],
}
# `make test` proves what decides that something leaves, and each module without a bench of its own, which its
# proof tests. `make formal`, CI and `make nightly` prove all.
DECIDING = ("commit_gate", "soft_core")
TASKS = [task for module in formal.known() for task in formal.tasks_of(module)]


def name_of(task: formal.Task) -> str:
    return f"{task.module}-{task.name}"


def marks(module: str) -> list[pytest.MarkDecorator]:
    by_day = module in DECIDING or not bench_file(module)
    return [pytest.mark.rule(*RULES[module]), *([] if by_day else [pytest.mark.nightly])]


@pytest.mark.parametrize(
    "task", [pytest.param(task, marks=marks(task.module)) for task in TASKS if task.proves], ids=name_of
)
def test_promises_hold(task: formal.Task) -> None:
    """In CI each promise is proved anew."""
    formal.join(task.module)
    prove = formal.run if os.environ.get("CI") else formal.run_once
    assert prove(task).passed, task.errors


@pytest.mark.nightly
@pytest.mark.parametrize("task", [task for task in TASKS if not task.proves], ids=name_of)
def test_every_cover_is_reached(task: formal.Task) -> None:
    formal.join(task.module)
    assert formal.run_once(task).passed, task.errors


@pytest.mark.parametrize("bug", first(bugs("proof")), ids=lambda bug: bug.name)
def test_a_broken_gate_breaks_a_promise(bug, monkeypatch) -> None:
    """From reset on, so without the help of what induction needs to know."""
    module = Path(bug.file).stem
    # In the tree's own build folder, for the tools see nothing outside of it.
    monkeypatch.setattr(formal, "WORK", formal.WORK / f"broken-{os.getpid()}")
    broken = ROOT / formal.WORK / f"{module}.v"
    broken.parent.mkdir(parents=True, exist_ok=True)
    broken.write_text(bug.planted())
    if module == "commit_gate":
        monkeypatch.setattr(formal, "source", lambda module: broken)
    formal.join("commit_gate")
    script = formal.script("commit_gate", "prove_stop")
    for part, becomes in (
        (bug.file, f"{formal.WORK}/{module}.v"),
        ("mode prove\ndepth 3", "mode bmc\ndepth 12"),
        ("prep -top commit_gate", "prep -top commit_gate\nchformal -remove c:i_*"),
    ):
        script = script.replace(part, becomes)
    (task,) = (task for task in formal.tasks_of("commit_gate") if task.name == "prove_stop")
    formal.run(task, script)
    assert not task.passed and f"commit_gate.{bug.seen['proof']} " in task.errors


def pins_of(module: str, name: str, more: str, monkeypatch) -> str:
    """Errors found in a proof's assumptions after `more` was added to its properties."""
    # A folder for each worker: pytest runs these tests in parallel.
    monkeypatch.setattr(formal, "WORK", formal.WORK / f"stuck-{os.getpid()}")
    formal.join(module)
    joined = ROOT / formal.WORK / f"joined/{module}.v"
    joined.write_text(joined.read_text().replace("\nendmodule\n", f"\n{more}\nendmodule\n"))
    tasks = {task.name: task for task in formal.tasks_of(module)}
    return formal.check_pins(tasks[name])


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("module", "proof", "more", "errors"),
    [
        ("silence_timer", "prove_drive", "always @* assume (!busy);", "never allow busy = 1"),
        *(
            ("network_port", "prove", more, errors)
            for more, errors in (
                ("", ""),
                ("always @* assume (!tick16);", "the assumptions never allow tick16 = 1"),
                (
                    "always @* assume (two_stop == parity_enable);",
                    "never allow parity_enable = 1\n",
                ),
                ("always @* assume (rx && !rx);", "never allow commit = 0\n"),
                (
                    "always @(posedge clk) if (g_past) assume (!rx_valid && !sending);",
                    "never allow de = 1",
                ),
            )
        ),
    ],
)
def test_an_assumption_that_is_too_strong_is_found(module, proof, more, errors, monkeypatch) -> None:
    """Without the check the proof would hold. Without an assumption more there is nothing to find."""
    found = pins_of(module, proof, more, monkeypatch)
    assert errors in found and bool(errors) == bool(found)


def test_every_pin_is_checked() -> None:
    for path in sorted((ROOT / "rtl").rglob("*.v")):
        text = path.read_text()
        header = text[text.index("\nmodule ") : text.index(");\n", text.index("\nmodule "))]
        ports = re.findall(r"^\s*(?:input|output)\b", header, re.M)
        clocked = bool(re.search(r"\binput\s+wire\s+clk\b", header))
        assert len(formal_pins.values(text)) >= 2 * (len(ports) - clocked), path.name


@pytest.mark.nightly
@pytest.mark.parametrize("sound", [True, False])
def test_one_failure_fails_the_run_and_keeps_the_page(monkeypatch, written, sound) -> None:
    def run_of(task: formal.Task) -> formal.Task:
        task.passed = sound or (task.module, task.name) != ("uart", "cover_receive")
        return task

    page = written / "proofs.md"
    page.write_text("as it was")
    monkeypatch.setattr(formal, "run", run_of)
    monkeypatch.setattr(formal, "join", lambda module: None)
    assert formal.main(["--write"]) == (0 if sound else 1)
    assert ("`uart` | cover_receive" in page.read_text()) == sound
