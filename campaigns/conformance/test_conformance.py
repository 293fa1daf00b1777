# SPDX-License-Identifier: Apache-2.0
"""The suite finds every planted fault by its own test, and finds none in the model slave without faults."""

from __future__ import annotations

import pytest

from campaigns.conformance.cases import CASES, Profile
from campaigns.conformance.engine import FAIL, NONE, PASS, grade
from campaigns.conformance.fixture import FAULTS, ModelLine
from tb.agents.uart import Format

PLAIN = Profile(unit=17)
LINES = [
    Profile(unit=17, fmt=Format.named(*line)) for line in ((9600, "8E1"), (19200, "8N2"), (115200, "8O1"))
]


@pytest.mark.parametrize("profile", [PLAIN, *LINES], ids=lambda profile: str(profile.fmt))
def test_the_slave_without_faults_passes_everything(profile):
    due = {PASS, NONE} if profile.fmt.parity == "N" else {PASS}
    found = grade(ModelLine(profile), profile)
    assert {verdict.outcome for verdict in found} == due, [v for v in found if v.outcome not in due]


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_found_by_its_own_test(fault):
    own = [case for case in CASES if case.number == FAULTS[fault]]
    found = grade(ModelLine(PLAIN, fault), PLAIN, own)
    assert [verdict.outcome for verdict in found] == [FAIL]


def test_every_test_finds_a_fault():
    assert {case.number for case in CASES} == set(FAULTS.values())
