# SPDX-License-Identifier: Apache-2.0
"""A line of the virtual card, written by `rtu2fc check --record`, gives the same result without a port."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sw.rtu2fc import cli

RECORDED = Path(__file__).parent / "recorded/check.jsonl"
CHECK = ["--drive", "yes", "--start", "40", "--yes"]


def replayed(file: Path, capsys: pytest.CaptureFixture) -> tuple[int, dict]:
    code = cli.main(["check", "nowhere", *CHECK, "--replay", str(file), "--json"])
    return code, json.loads(capsys.readouterr().out)


@pytest.fixture(autouse=True)
def _no_signals(monkeypatch):
    monkeypatch.setattr(cli.signal, "signal", lambda *_: None)


def test_a_recorded_line_passes_again(capsys):
    code, found = replayed(RECORDED, capsys)
    assert (code, found["failed"]) == (0, 0)
    assert sum(bool(row["passed"]) for row in found["rows"]) == 34


def test_another_answer_in_the_record_is_a_fault(capsys, tmp_path):
    """One wrong bit in the CRC of an answer."""
    lines = RECORDED.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if i > 20 and '"heard": "01' in line)
    entry = json.loads(lines[at])
    heard = bytes.fromhex(entry["heard"])
    lines[at] = json.dumps(entry | {"heard": (heard[:-1] + bytes([heard[-1] ^ 1])).hex()})
    (tmp_path / "other.jsonl").write_text("\n".join(lines))
    code, found = replayed(tmp_path / "other.jsonl", capsys)
    assert code != 0 and (found.get("failed") or "error" in found)


def test_a_record_that_ends_early_is_one_line(capsys, tmp_path):
    (tmp_path / "short.jsonl").write_text("\n".join(RECORDED.read_text().splitlines()[:9]))
    code, found = replayed(tmp_path / "short.jsonl", capsys)
    assert code == 2 and "the record ends here" in found["error"]["text"]
