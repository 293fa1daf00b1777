# SPDX-License-Identifier: Apache-2.0
"""Each planted fault fails its own test. The model slave without faults passes every test."""

from __future__ import annotations

from dataclasses import replace

import pytest

from campaigns.conformance.fixture import FAULTS, MANNERS, ModelLine
from campaigns.conformance.fixture import PROFILE as PLAIN
from sw.rtu2fc.cases import BYTES, CASES, Heard, Profile, Send
from sw.rtu2fc.engine import FAIL, HIDDEN, NONE, OWN_CODE, PASS, grade
from tb.agents.crc16 import with_crc
from tb.agents.uart import Format
from tb.lib.rows import each_row

LINES = [replace(PLAIN, fmt=Format.named(*line)) for line in ((9600, "8E1"), (19200, "8N2"), (115200, "8O1"))]


@pytest.mark.parametrize("profile", [PLAIN, *LINES], ids=lambda profile: str(profile.fmt))
def test_the_slave_without_faults_passes_everything(profile):
    due = {PASS, NONE} if profile.fmt.parity == "N" else {PASS}
    found = grade(ModelLine(profile), profile)
    assert {verdict.outcome for verdict in found} == due, [v for v in found if v.outcome not in due]


@pytest.mark.parametrize("manner", MANNERS)
def test_a_good_slave_may_have_other_manners(manner):
    assert {verdict.outcome for verdict in grade(ModelLine(PLAIN, manner), PLAIN)} == {PASS}


def test_characters_of_ten_bits_fail_their_own_test():
    """8N1 has ten bits a character; the specification has two stop bits without parity."""
    profile = replace(PLAIN, fmt=Format.named(19200, "8N1"))
    found = grade(ModelLine(profile), profile)
    assert [verdict.number for verdict in found if verdict.outcome == FAIL] == ["SL-20"]


def test_a_slave_with_less_has_nothing_to_try_some_tests_on():
    profile = replace(
        PLAIN, functions=frozenset({3, 6}), registers=1, values=(18, 21), no_register=0xFFF0, coils=1
    )
    found = grade(ModelLine(profile), profile)
    assert {verdict.outcome for verdict in found} == {PASS, NONE}
    texts = {verdict.number: verdict.text for verdict in found if verdict.outcome == NONE}
    assert texts["AP-18"] == "needs 2 registers to write, has 1"
    assert texts["AP-19"] == "no value above 255 to write"
    assert texts["AP-25"] == "FFEFh, the address before --no-register, is no register"
    assert texts["SL-26"] == "no function 1" and texts["AP-33"] == "no function 2 or 4"


@each_row("fault", FAULTS)
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


@each_row(
    "data",
    [b"\x55", b"\0" * 5, with_crc(b"\x11\x83"), with_crc(b"\x11\x03"), with_crc(b"\x11\x90\3\0"), bytes(300)],
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
