# SPDX-License-Identifier: Apache-2.0
"""The bugs of planted.toml: each one applies, and the guide lists it. `make kills` plants them."""

from __future__ import annotations

import pytest

from campaigns.mutate.planted import planted
from rtl.sources import ROOT

PLANTS = planted()
GUIDE = ROOT / "docs/guide/testing.md"


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_every_plant_applies(plant):
    text = (ROOT / plant.file).read_text()
    plant.place(text)
    assert text.replace(plant.old, plant.new) != text
    assert plant.rules and plant.what
    file, _, test = plant.seen.partition("::")
    assert not test or f"def {plant.seen_by}(" in (ROOT / file).read_text(), plant.seen


def test_names_are_unique():
    assert len({plant.name for plant in PLANTS}) == len(PLANTS) >= 25


def test_the_guide_lists_every_plant():
    text = GUIDE.read_text()
    for plant in PLANTS:
        row = next((line for line in text.splitlines() if line.startswith(f"| {plant.name} |")), "")
        assert f"`{plant.file}`" in row and plant.what in row, plant.name
        assert row.endswith(f" | `{plant.seen_by}` |"), plant.name
        before = f"`{plant.before}`" if plant.before else "nothing"
        assert f" | {before} | " in row, plant.name
    unseen = sum(not plant.before for plant in PLANTS)
    assert f"Of {len(PLANTS)} bugs {unseen} were seen by no test." in " ".join(text.split())
