# SPDX-License-Identifier: Apache-2.0
"""The bugs of planted.toml: each one applies, and the test that must see it fails.

The bugs in the firmware run on the host, the others each in a copy of the project. `make test-all` runs both.
"""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from campaigns.mutate import planted
from rtl.sources import ROOT

PLANTS = planted.planted()
# These take a minute each. CI plants the others.
LONG = ("loop-back-deaf-on-the-drive-line", "pause-10-percent-short", "watchdog-at-half-speed")
OTHERS = [
    pytest.param(plant.name, marks=[pytest.mark.twin] * (plant.name in LONG))
    for plant in PLANTS
    if not plant.in_firmware
]
GUIDE = ROOT / "docs/guide/testing.md"


def failed_by(*arguments: str) -> dict[str, str]:
    """The test that fails with each of the bugs."""
    command = [sys.executable, "-m", "campaigns.mutate.planted", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    return {row["plant"]: row["failed"] for row in rows}


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_every_plant_applies(plant):
    text = (ROOT / plant.file).read_text()
    plant.place(text)
    assert text.replace(plant.old, plant.new) != text
    assert plant.rules and plant.what


def test_names_are_unique():
    assert len({plant.name for plant in PLANTS}) == len(PLANTS) >= 25


@pytest.mark.slow
def test_every_planted_bug_in_the_firmware_is_seen(tmp_path):
    found = failed_by("--firmware", "--work", str(tmp_path))
    assert found.keys() == {plant.name for plant in PLANTS if plant.in_firmware}
    assert [name for name, failed in found.items() if not failed] == []


@pytest.mark.slow
def test_a_bug_that_its_test_does_not_see_is_named(tmp_path):
    table = tmp_path / "table.toml"
    text = planted.TABLE.read_text()
    table.write_text(text.replace("FORM_COUNTED, 31, coils_write}", "FORM_COUNTED, 0x20, coils_write}"))
    found = failed_by("31-coils", "nine-text-registers", f"--table={table}", "--work", str(tmp_path))
    assert found["31-coils"] == "" and found["nine-text-registers"]


@pytest.mark.slow
@pytest.mark.needs("synth")
@pytest.mark.parametrize("name", OTHERS)
def test_every_other_planted_bug_is_seen(name, tmp_path):
    assert failed_by(name, "--work", str(tmp_path))[name]


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
