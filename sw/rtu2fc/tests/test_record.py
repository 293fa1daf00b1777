# SPDX-License-Identifier: Apache-2.0
"""Lines of the virtual card, kept by --record of check and grade, give the same result without a port."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sw.rtu2fc import cli
from sw.rtu2fc.cases import REASONS

RECORDED = Path(__file__).parent / "recorded/check.jsonl"
GRADED = RECORDED.with_name("grade.jsonl")  # `rtu2fc grade` with its usual options
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


def test_a_recorded_grade_has_its_verdicts_again(capsys):
    """The dialect `card` has exception codes of its own: each case of an exception fails, and no other."""
    code = cli.main(["grade", "nowhere", "--replay", str(GRADED), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert (code, found["failed"]) == (1, 14)
    outcomes = [test["outcome"] for test in found["tests"]]
    assert (outcomes.count("pass"), outcomes.count("n.a.")) == (23, 10)
    failed = {test["number"] for test in found["tests"] if test["outcome"] == "fail"}
    assert failed == {number for numbers in REASONS.values() for number in numbers} - {
        *("AP-25", "AP-26", "AP-27")  # not applicable here
    }


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
