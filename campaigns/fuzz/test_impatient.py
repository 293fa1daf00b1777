# SPDX-License-Identifier: Apache-2.0
"""Some impatient masters in every test run (SAFE-8); `make impatient` is the long version.

At night each set of firmware options meets some, too. They never lose their master: 40002 is 0 (SAFE-7).
"""

from __future__ import annotations

import itertools
import json

import pytest

from campaigns.fuzz import case_file
from campaigns.fuzz.case import Player
from campaigns.fuzz.impatient import OWN_CLOCK, make, play
from campaigns.fuzz.trial import told
from regs.dialects import IMAGES
from rtl.sources import ROOT
from sim.harness.library import Target
from tb.agents.crc16 import with_crc
from tb.lib.seeds import cases, seeded
from tb.model.card import NETWORK_TIMEOUT

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


@pytest.mark.nightly
@pytest.mark.rule("SAFE-8", "LINE-9", "FRAME-3")
@pytest.mark.parametrize("name", [name for name in IMAGES if "/" not in name])
def test_it_is_with_each_set_of_options(name: str):
    image = IMAGES[name]
    stops = image.set.get("MASTER_LOSS_STOP", 0)
    parameters = (("MASTER_LOSS_STOP", 1),) if stops else ()
    target = Target(images=ROOT / "build" / name, parameters=parameters)
    seed, asked = seeded(f"impatient masters {name}").randrange(1 << 31), 0
    made = (make(seed, number, "standard") for number in itertools.count() if number % OWN_CLOCK)
    for case in itertools.islice((case for case in made if case["dialect"] in image.dialects), 20):
        if stops:
            never = with_crc(b"\x01\x06" + NETWORK_TIMEOUT.to_bytes(2) + bytes(2)).hex()
            case["events"].insert(0, {"what": "impatient", "gap": ["idle", 30.0], "bytes": never})
        # A character long after the reading of the image: until then a delayed reply may leave (LINE-9).
        case["events"].append({"what": "impatient", "gap": ["idle", 0.05 * case["baud"]], "bytes": "55"})
        player = Player(case, target)
        strict = bool(image.set.get("STRICT_T15", 1))
        outcome = told(case, player, player.play(probed=False), strict_t15=strict)
        assert not outcome.differences, f"SEED={seed}: {case}"
        asked += outcome.asked
    assert asked > 16


def test_sequences_are_cases_of_the_fuzzer(tmp_path):
    path = tmp_path / "case.json"
    for number in range(50):
        case = make(1, number, "standard")
        path.write_text(json.dumps(case))
        assert case_file.read(path) == case
        assert 4 <= len(case["events"]) - 1 <= 24
    assert case == make(1, number, "standard")
