# SPDX-License-Identifier: Apache-2.0
"""Some impatient masters in every test run (SAFE-8); `make impatient` is the long version."""

from __future__ import annotations

import itertools
import json

import pytest

from campaigns.fuzz import case_file
from campaigns.fuzz.impatient import OWN_CLOCK, make, play
from tb.lib.seeds import cases, seeded

# A sequence of the small card takes as long as 8 of the other's.
SEQUENCES = {"standard": cases(8, 60), "tiny": 6}


@pytest.mark.rule("SAFE-8", "FRAME-7", "FC-9", "MAP-3")
def test_drive_is_told_what_the_image_shows(config: str):
    seed, found = seeded("impatient masters").randrange(1 << 31), {}
    asked = 0
    numbers = (number for number in itertools.count() if number % OWN_CLOCK != OWN_CLOCK - 1)
    for number in itertools.islice(numbers, SEQUENCES[config]):
        outcome = play(make(seed, number, config), config)
        asked += outcome.asked
        if outcome.differences:
            found[number] = outcome.differences
    assert not found, f"CONFIG={config} SEED={seed}"
    assert asked > 0.9 * SEQUENCES[config]


def test_sequences_are_cases_of_the_fuzzer(tmp_path):
    path = tmp_path / "case.json"
    for number in range(50):
        case = make(1, number, "standard")
        path.write_text(json.dumps(case))
        assert case_file.read(path) == case
        assert 4 <= len(case["events"]) - 1 <= 24
    assert case == make(1, number, "standard")
