# SPDX-License-Identifier: Apache-2.0
"""Each planted fault fails its own test. The model slave without faults passes every test."""

from __future__ import annotations

import pytest

from campaigns.conformance.cases import BYTES, CASES, Heard, Profile, Send
from campaigns.conformance.engine import FAIL, HIDDEN, NONE, OWN_CODE, PASS, grade
from campaigns.conformance.fixture import FAULTS, ModelLine
from tb.agents.crc16 import with_crc
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


class Says:
    """A driver that hears the same bytes after every request."""

    sees = frozenset({BYTES})

    def __init__(self, data: bytes):
        self.data = data

    def exchange(self, send: Send) -> Heard:
        return Heard(self.data)


@pytest.mark.parametrize(
    "data",
    [b"\x55", b"\0" * 5, with_crc(b"\x11\x83"), with_crc(b"\x11\x03"), with_crc(b"\x11\x90\3\0"), bytes(300)],
    ids=lambda data: data[:6].hex(),
)
def test_a_malformed_reply_passes_no_test(data):
    assert {verdict.outcome for verdict in grade(Says(data), PLAIN)} == {FAIL, HIDDEN}


@pytest.mark.parametrize(("code", "outcome"), [(3, PASS), (66, OWN_CODE), (65, FAIL), (2, FAIL)])
def test_an_own_code_is_accepted_in_its_own_test_alone(code, outcome):
    """A slave whose document has 66 for a wrong quantity, and 65 for another reason."""
    profile = Profile(unit=17, own_codes={"AP-4": 66, "AP-17": 65})
    own = [case for case in CASES if case.number == "AP-4"]
    found = grade(Says(with_crc(bytes([17, 0x83, code]))), profile, own)
    assert [verdict.outcome for verdict in found] == [outcome]
