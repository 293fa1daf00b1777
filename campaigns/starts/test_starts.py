# SPDX-License-Identifier: Apache-2.0
"""The campaign of starts: a failed start is reported, and a run that was stopped goes on."""

from __future__ import annotations

import sys

import pytest

from campaigns.starts import run as campaign


@pytest.fixture
def started(tmp_path, monkeypatch) -> list[tuple[str, int]]:
    """The starts that were made; the one of seed 3 fails."""
    made: list[tuple[str, int]] = []

    def start(kind: str, config: str, seed: int) -> str:
        made.append((kind, seed))
        return "does not answer" if seed == 3 else ""

    monkeypatch.setattr(campaign, "FOLDER", tmp_path)
    monkeypatch.setattr(campaign.starts, "start", start)
    return made


@pytest.mark.parametrize(("count", "code"), [("3", 0), ("4", 1)])
def test_a_failed_start_is_reported(started, monkeypatch, capsys, count, code) -> None:
    monkeypatch.setattr(sys, "argv", ["run", "--count", count])
    assert campaign.main() == code
    assert len(started) == len(campaign.starts.KINDS) * int(count)
    assert ("seed 3: does not answer" in capsys.readouterr().out) == bool(code)


def test_a_run_goes_on_where_it_was(started) -> None:
    campaign.run("reset", "standard", range(4))
    assert campaign.run("reset", "standard", range(6))[3] == "does not answer"
    assert started == [("reset", seed) for seed in range(6)]
