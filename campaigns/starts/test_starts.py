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


def test_the_page_has_a_row_for_each_card_and_kind(monkeypatch, tmp_path) -> None:
    """A failed start is on it, and the bound beside each count."""
    monkeypatch.setattr(page.run, "FOLDER", tmp_path)
    monkeypatch.setattr(page.fingerprint, "firmware", lambda config: "0123abcd0123")
    for config in ("standard", "tiny"):
        for kind in page.starts.KINDS:
            page.run.file_of(kind, config).write_text(
                "5\n6 does not answer\n7\n" if kind == "reset" else "0\n1\n"
            )
    text = page.page()
    assert "| standard | power-up | 2 | 0 to 1 | 0 | 9.00e-01 |" in text
    assert "| tiny | reset | 3 | 5 to 7 | 1 | 9.42e-01 |" in text
    page.run.file_of("reset", "tiny").unlink()
    with pytest.raises(
        page.PageError, match="no reset of the tiny card as it is now; run `make starts CONFIG=tiny`"
    ):
        page.page()
