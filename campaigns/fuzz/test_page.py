# SPDX-License-Identifier: Apache-2.0
"""The report of the fuzzer and the flips, from the result files of all campaigns."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from campaigns.flips.trial import PARTS
from campaigns.fuzz import page
from campaigns.fuzz.plants import PLANTS

CARDS = {"standard": "one two three", "tiny": "four five three"}
FLIPPED = {"standard": "one two six", "tiny": "four five six"}  # by another judge


def keep_frames(folder: Path, seed: int, frames: int, config: str = "standard", **more) -> None:
    found = {"seed": seed, "config": config, "card": CARDS[config], "frames": frames, "judged": frames - 1}
    found |= {"cases": 2, "events": {"legal": frames}, "outcomes": {}, "rates": {}, "unclear": {}}
    found |= {"worst": {}, "differences": [], "wall_s": 1.0, "simulated_s": 2.0} | more
    (folder / f"fuzz-{config}-{seed}.json").write_text(json.dumps(found))


@pytest.fixture
def folder(tmp_path) -> Path:
    """Result files of fuzz, plants and flips."""
    keep_frames(tmp_path, 7, 7000)
    keep_frames(tmp_path, 8, 8000)
    keep_frames(tmp_path, 7, 900, "tiny")
    frames = {plant.name: 33 for plant in PLANTS} | {"cut-value": 12345, "wrong-order": None}
    plants = {"seed": 5, "count": 20000, "card": CARDS["standard"], "frames": frames}
    (tmp_path / "plants.json").write_text(json.dumps(plants))
    for config, card in FLIPPED.items():
        shard = {"seed": 9, "config": config, "card": card, "baud": 9600, "flips": 4, "cpu_s": 120.0}
        shard |= {"bits": dict.fromkeys(PARTS, 8), "counts": {"card: no effect": 4}, "notable": []}
        (tmp_path / f"flips-{config}-9-9600.json").write_text(json.dumps(shard))
    return tmp_path


def text_of(folder: Path) -> str:
    return " ".join(page.page(page.collected(folder, CARDS, FLIPPED)).split())


def test_the_report_states_the_results_of_all_campaigns(folder):
    text = text_of(folder)
    for said in (
        "20,000 frames each, with judge `three`.",
        "Judge of the flips: `six`.",
        "15,897 frames of both cards judged to their end, each with the judge of its row: no difference, "
        "at most 2.90e-04 of the frames",
        "| standard card `one`, firmware `two` | `three` | 7, 8 | 15,000 | 4 | 0 | 14,998 | 0 | 3.08e-04 |",
        "| legal | 15,000 | 900 |",
        "| cut-value | MAP-7: a value below -32768 is cut, not refused | 12,345 |",
        "| wrong-order | EXC: address before quantity | not found |",
        "8 flips of both cards: 0 unrequested or altered telegrams and stuck drivers, at most 4.38e-01",
        "tiny card `four`, firmware `five`: 4 flips",
    ):
        assert said in text
    keep_frames(folder, 22, 30, differences=[{"case": "22/1", "what": ["no reply"]}])
    text = text_of(folder)
    assert "its row: differences: 1, at most" in text and "no difference" not in text


@pytest.mark.parametrize(
    ("file", "content", "complaint"),
    [
        ("plants.json", None, "run `make fuzz-plants` first"),
        ("plants.json", {"frames": {}, "seed": 1, "count": 2, "card": "none"}, "another standard card, none"),
        ("plants.json", {"seed": 1}, "no result of `make fuzz-plants`"),
        ("flips-tiny-9-9600.json", None, "run `make flips CONFIG=tiny` first"),
        ("fuzz-tiny-7.json", None, "run `make fuzz CONFIG=tiny` first"),
    ],
)
def test_the_report_needs_all_results_of_the_present_cards(folder, file, content, complaint):
    (folder / file).unlink()
    if content is not None:
        (folder / file).write_text(json.dumps(content))
    with pytest.raises(page.PageError, match=complaint):
        text_of(folder)
