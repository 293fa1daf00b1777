# SPDX-License-Identifier: Apache-2.0
"""The recorded lines of tests/recorded give the same result again, without a port: first the virtual card's.

Each was written by its command with --record. A line of a real card joins the list as it is.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sw.rtu2fc import cli

RECORDED = Path(__file__).parent / "recorded"
MAP = ["--register", "1", "--no-register", "3", "--coil", "16", "--coils", "16", "--no-coil", "128"]
CODES = ["--own-codes", "function=67,address=64,length=65,quantity=66,value=2", "--timeout", "1"]
COMMANDS = {"check": ["--drive", "yes", "--start", "40"], "grade": [*MAP, *CODES]}
PASSED = {"check": 34, "grade": 40}


def replayed(name: str, file: Path, capsys: pytest.CaptureFixture) -> tuple[int, dict]:
    code = cli.main([name, "nowhere", *COMMANDS[name], "--replay", str(file), "--json"])
    return code, json.loads(capsys.readouterr().out)


@pytest.fixture(autouse=True)
def _no_signals(monkeypatch):
    monkeypatch.setattr(cli.signal, "signal", lambda *_: None)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_recorded_line_passes_again(name, capsys):
    code, found = replayed(name, RECORDED / f"{name}.jsonl", capsys)
    assert (code, found["failed"]) == (0, 0)
    rows = found.get("rows") or found["tests"]
    good = [row for row in rows if row.get("passed") or row.get("outcome") in ("pass", "own code")]
    assert len(good) == PASSED[name]


@pytest.mark.parametrize("name", COMMANDS)
def test_another_answer_in_the_record_is_a_fault(name, capsys, tmp_path):
    """One wrong bit in the CRC of an answer."""
    lines = (RECORDED / f"{name}.jsonl").read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if i > 20 and '"heard": "01' in line)
    entry = json.loads(lines[at])
    heard = bytes.fromhex(entry["heard"])
    lines[at] = json.dumps(entry | {"heard": (heard[:-1] + bytes([heard[-1] ^ 1])).hex()})
    (tmp_path / "other.jsonl").write_text("\n".join(lines))
    code, found = replayed(name, tmp_path / "other.jsonl", capsys)
    assert code != 0 and (found.get("failed") or "error" in found)


def test_a_record_that_ends_early_is_one_line(capsys, tmp_path):
    (tmp_path / "short.jsonl").write_text("\n".join((RECORDED / "check.jsonl").read_text().splitlines()[:9]))
    code, found = replayed("check", tmp_path / "short.jsonl", capsys)
    assert code == 2 and "the record ends here" in found["error"]["text"]
