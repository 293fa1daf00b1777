# SPDX-License-Identifier: Apache-2.0
"""The campaign of starts: a failed start is reported, and a run that was stopped goes on."""

from __future__ import annotations

import sys

import pytest

from campaigns.starts import page
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


def test_a_failed_start_is_reported_and_a_run_goes_on_where_it_was(started, monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["run", "--count", "3"])
    assert campaign.main() == 0
    monkeypatch.setattr(sys, "argv", ["run", "--count", "4"])
    assert campaign.main() == 1 and "seed 3: does not answer" in capsys.readouterr().out
    assert sorted(started) == sorted((kind, seed) for kind in campaign.starts.KINDS for seed in range(4))


def test_the_page_has_a_failed_start_and_its_bound(started, monkeypatch) -> None:
    campaign.run("reset", "standard", range(2, 5))
    assert page.row("standard", "reset") == "| standard | reset | 3 | 2 to 4 | 1 | 9.42e-01 |"
    with pytest.raises(
        page.PageError, match="no reset of the tiny card as it is now; run `make starts CONFIG=tiny`"
    ):
        page.row("tiny", "reset")
