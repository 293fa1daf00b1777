# SPDX-License-Identifier: Apache-2.0
"""The bugs of planted.toml: each one applies. `make kills` plants them."""

from __future__ import annotations

from campaigns.mutate.planted import planted
from rtl.sources import ROOT
from tb.lib.rows import each_row

PLANTS = planted()


@each_row("plant", PLANTS)
def test_every_plant_applies(plant):
    text = (ROOT / plant.file).read_text()
    plant.place(text)
    assert text.replace(plant.old, plant.new) != text
    assert plant.rules and plant.what
    file, _, test = plant.seen.partition("::")
    assert not test or f"def {plant.seen_by}(" in (ROOT / file).read_text(), plant.seen


def test_names_are_unique():
    assert len({plant.name for plant in PLANTS}) == len(PLANTS) >= 25
