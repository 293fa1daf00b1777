# SPDX-License-Identifier: Apache-2.0
"""The proofs of formal/ hold on the Verilog as it is, and fail on a module that is broken."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tools import formal
from tools.sources import ROOT

MODULES = sorted(path.stem for path in (ROOT / "formal").glob("*.sby"))
RULES = {
    "bcc": ["FC-1"],
    "bus_arbiter": ["FRAME-5"],
    "commit_gate": ["FRAME-6", "FRAME-7", "FC-9", "MAP-9", "SAFE-1", "SAFE-4"],
    "crc16_modbus": ["FRAME-4"],
    "drive_port": ["SAFE-1", "SAFE-2", "FC-8", "FC-10"],
    "fc_rx": ["FC-1", "FC-2", "FC-7", "FC-8"],
    "fc_tx": ["FC-1"],
    "mailbox": ["SAFE-1", "SAFE-4", "FRAME-5", "FRAME-6", "FRAME-7", "FC-8"],
    "mailbox_regs": ["FRAME-4", "FC-8"],
    "network_port": ["SAFE-2", "FRAME-1", "FRAME-8", "LINE-6"],
    "rs485_dir": ["LINE-6", "FC-10"],
    "rtu_rx": ["FRAME-2", "FRAME-3", "FRAME-4", "FRAME-5", "FRAME-6"],
    "rtu_tx": ["FRAME-4", "SAFE-2"],
    "silence_timer": ["FRAME-1", "FC-8"],
    "supervisor": ["WDG-1", "LED-5", "LOOP-1"],
    "uart": ["LINE-1", "LINE-3", "LINE-5", "FRAME-4", "FC-1"],
}


def run(*arguments: str, **options) -> subprocess.CompletedProcess:
    command = [sys.executable, "tools/formal.py", "--jobs", "1", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, **options)


@pytest.mark.parametrize("module", [pytest.param(m, marks=pytest.mark.rule(*RULES[m])) for m in MODULES])
def test_promises_hold(module: str) -> None:
    done = run(module)
    assert done.returncode == 0, done.stdout


def test_a_broken_module_fails(monkeypatch, tmp_path) -> None:
    """A licence that a write to the telegram does not end (SAFE-1)."""
    broken = tmp_path / "rtl/commit_gate.v"
    broken.parent.mkdir()
    text = (ROOT / "rtl/commit_gate.v").read_text()
    licence = "    if (telegram_touched || closing) begin\n"
    assert licence in text
    broken.write_text(text.replace(licence, "    if (1'b0) begin\n"))
    # In the tree's own build folder, for the tools see nothing outside of it.
    monkeypatch.setattr(formal, "WORK", formal.WORK / "broken")
    monkeypatch.setattr(formal, "source", lambda module: broken)
    formal.join("commit_gate")
    sby = (ROOT / "formal/commit_gate.sby").read_text()
    script = ROOT / formal.WORK / "commit_gate.sby"
    script.write_text(sby.replace("build/formal/joined", "build/formal/broken/joined"))
    task = formal.tasks_of(ROOT / "formal/commit_gate.sby")[0]
    formal.run(task, script)
    assert not task.passed
    assert any(name in task.said for name in ("a_licensed", "i_licensed", "i_queued"))


@pytest.mark.parametrize("sound", [True, False])
def test_one_failure_fails_the_run_and_leaves_the_page_alone(monkeypatch, tmp_path, sound) -> None:
    def run_of(task: formal.Task) -> formal.Task:
        task.passed = sound or (task.module, task.name) != ("uart", "cover_receive")
        return task

    page = tmp_path / "proofs.md"
    page.write_text("as it was")
    monkeypatch.setattr(formal, "DOCUMENT", page)
    monkeypatch.setattr(formal, "run", run_of)
    monkeypatch.setattr(formal, "join", lambda module: None)
    assert formal.main(["--write"]) == (0 if sound else 1)
    assert ("`uart` | cover_receive" in page.read_text()) == sound


def test_a_proof_that_only_looks_some_steps_far_is_refused(tmp_path, monkeypatch) -> None:
    sby = tmp_path / "bcc.sby"
    sby.write_text((ROOT / "formal/bcc.sby").read_text().replace("prove: mode prove", "prove: mode bmc"))
    monkeypatch.setattr(formal, "ROOT", tmp_path)
    with pytest.raises(SystemExit, match="not in mode prove"):
        formal.tasks_of(sby)


def test_an_unknown_module_is_refused() -> None:
    done = run("commit_gates")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "commit_gate," in done.stderr


@pytest.mark.parametrize(
    ("before", "after"), [("| `bcc` | prove | 3 |", "| `bcc` | prove | 4 |"), ("(FC-1)", "(FC-2)")]
)
def test_a_page_of_other_promises_is_found(monkeypatch, tmp_path, before, after) -> None:
    """Another depth, another word; not another time."""
    tasks = [task for module in MODULES for task in formal.tasks_of(ROOT / f"formal/{module}.sby")]
    assert not formal.drifted(tasks)
    page = formal.DOCUMENT.read_text()
    monkeypatch.setattr(formal, "DOCUMENT", tmp_path / "proofs.md")
    formal.DOCUMENT.write_text(page.replace(" 2 s |", " 97 s |"))
    assert not formal.drifted(tasks)
    assert before in page
    formal.DOCUMENT.write_text(page.replace(before, after))
    assert formal.drifted(tasks)
