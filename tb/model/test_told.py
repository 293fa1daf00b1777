# SPDX-License-Identifier: Apache-2.0
"""The judges of SAFE-8 and FRAME-7 (told.py, kept.py) see each way in which a write can be lost."""

from __future__ import annotations

import pytest

from tb.agents import rtu
from tb.lib.rows import each_row
from tb.model.fc_telegram import AK_WRITE_WORD, build_parameter, build_process
from tb.model.told import Verdict, judge, not_told
from tb.model.wire import Burst, CardCharacter, FarCharacter, LineFormat, drive_line

LINE = LineFormat(9600, "8E1", 960_000)
MS = LINE.clk_hz / 1000
START, STOP, NONE = bytes.fromhex("047c2000"), bytes.fromhex("043c2000"), bytes(4)
STATUS = build_process(0x0607, 0)


def process(words: bytes, adr: int = 0x81) -> bytes:
    return build_process(int.from_bytes(words[:2], "big"), int.from_bytes(words[2:], "big"), adr)


def write(value: int, adr: int = 0x81) -> bytes:
    return build_parameter(AK_WRITE_WORD, 104, pwe=value, adr=adr)


def coils(words: bytes, unit: int = 1) -> bytes:
    value = int.from_bytes(words[:2], "big") | int.from_bytes(words[2:], "big") << 16
    return rtu.build(unit, rtu.write_coils(0, [bool(value >> i & 1) for i in range(32)]))


def set_104(value: int, unit: int = 1) -> bytes:
    return rtu.build(unit, rtu.write_register(1039, value))


@pytest.mark.rule("SAFE-8")
@each_row(
    ("sent", "image", "holds"),
    [
        ([], NONE, True),
        ([], START, False),
        ([(process(START), True)], START, True),
        ([(process(START), True)], STOP, False),
        ([(process(START), False)], STOP, True),  # and the master got 255
        ([(process(START), None)], STOP, True),
        ([(process(START, 0x80), False)], STOP, False),  # nobody answers a broadcast
        ([(process(START), True), (write(60), True)], START, True),
        ([(process(START), True), (process(NONE), True)], START, True),  # STATUS_REFRESH
        ([(process(START), True), (process(NONE), True)], NONE, True),
        ([(process(START), True)], NONE, False),
        ([(process(STOP), True), (process(START), True)], STOP, False),
    ],
)
def test_rule_for_telegrams_and_their_replies(sent, image, holds):
    assert (not_told(sent, image) == "") == holds


def burst(line: LineFormat, at_ms: float, data: bytes) -> Burst:
    step = line.character_bits * line.bit
    starts = [round(at_ms * MS + number * step) for number in range(len(data))]
    characters = [CardCharacter(at, at + step, byte, True) for at, byte in zip(starts, data, strict=True)]
    return Burst(starts[0], round(characters[-1].end), characters)


def far(line: LineFormat, at_ms: float, data: bytes) -> list[FarCharacter]:
    return [FarCharacter(float(c.start), c.end, c.byte) for c in burst(line, at_ms, data).characters]


def verdict(network, drive=(), replies=(), telegrams=()) -> Verdict:
    """All by the time of their start in ms."""
    wire = drive_line(LINE.clk_hz)
    return judge(
        [c for at, data in network for c in far(LINE, at, data)],
        [c for at, data in drive for c in far(wire, at, data)],
        [burst(LINE, at, data) for at, data in replies],
        [burst(wire, at, data) for at, data in telegrams],
        2000 * MS,
        line=LINE,
        address=1,
        dialect="card",
        budget=1.0 * MS,
    )


# A frame of 13 bytes takes 15 ms, one of 8 bytes 9 ms, and 4 ms until the commit. The drive is silent: 150 ms
# after a telegram of 9 ms leaves what was committed since.
ASKED = [(50, coils(START)), (80, coils(STOP)), (120, set_104(60))]
OLDER = [(50, coils(START)), (80, set_104(60)), (120, coils(STOP))]
FIRST, FREE = (69.5, process(START)), 232.0


@pytest.mark.rule("FRAME-7", "SAFE-8")
@each_row(
    ("asked", "telegrams", "says"),
    [
        (ASKED, [(FREE, process(STOP)), (394, write(60))], ""),
        (ASKED, [(FREE, write(60)), (394, process(STOP))], "before 02 06 81 04 3c"),
        (ASKED, [(FREE, process(START)), (394, process(STOP))], "before 02 06 81 04 3c"),
        (ASKED, [(FREE, process(STOP))], "is not on the free line"),
        (ASKED, [(394, process(STOP)), (556, write(60))], "is not on the free line"),
        (ASKED, [], "is not on the free line"),
        (ASKED, [(FREE, process(STOP)), (394, write(60)), (570, write(60)), (740, write(60))], "no write"),
        ([*ASKED, (150, set_104(61))], [(FREE, process(STOP)), (394, write(61))], ""),
        ([*ASKED, (150, set_104(61))], [(FREE, process(STOP)), (394, write(60))], "no write"),
        (
            [*ASKED, (150, set_104(61, 0))],
            [(FREE, process(STOP)), (394, write(60)), (570, write(61, 0x80))],
            "",
        ),
        (
            [*ASKED, (150, set_104(61, 0))],
            [(FREE, process(STOP)), (394, write(61, 0x80))],
            "before 02 0e 81 20 68",
        ),
        ([*ASKED, (150, coils(START, 0))], [(FREE, process(START)), (394, write(60))], ""),
        # A write older than the command takes nothing of its repeat, a newer one does (FC-9).
        # The telegram may be that of a newer command with the same words.
        (
            [*ASKED, (375, coils(STOP))],
            [(at, process(STOP)) for at in (FREE, 394, 556)] + [(718, write(60))],
            "",
        ),
        (OLDER, [(FREE, process(STOP)), (394, process(STOP)), (556, write(60))], ""),
        (ASKED, [(FREE, process(STOP)), (394, process(STOP)), (556, write(60))], "before 02 0e 81 20 68"),
        (
            [*ASKED, (150, coils(START, 0))],
            [(FREE, process(START, 0x80)), (394, write(60))],
            "before 02 06 81",
        ),
    ],
)
def test_order_of_writes_behind_a_silent_drive(asked, telegrams, says):
    found = verdict(asked, telegrams=[FIRST, *telegrams]).differences
    assert says in "".join(found) if says else not found


IMAGE, ECHO = rtu.build(1, rtu.read_coils(0, 32)), rtu.build(1, coils(START)[1:6])


@pytest.mark.rule("SAFE-8")
@each_row(("shown", "says"), [("7c040020", ""), ("3c040020", "was told 047c 2000")])
def test_image_is_compared_when_both_lines_are_at_rest(shown, says):
    """The drive answers the start; the answer to a reading of coils 1-32 shows `shown`."""
    replies = [(92, ECHO), (213.5, rtu.build(1, bytes.fromhex("0104" + shown)))]
    found = verdict([(50, coils(START)), (200, IMAGE)], [(81.5, STATUS)], replies, [FIRST])
    assert found.asked == 1
    assert says in "".join(found.differences) if says else not found.differences


@pytest.mark.rule("SAFE-8")
def test_image_is_not_compared_before_the_drive_has_answered():
    replies = [(113.5, rtu.build(1, bytes.fromhex("01043c040020")))]
    found = verdict([(50, coils(START)), (100, IMAGE)], [(130, STATUS)], replies, [FIRST])
    assert (found.asked, found.restless, found.differences) == (0, 1, [])


@pytest.mark.rule("MAP-3")
def test_confirmation_of_a_command_that_the_drive_did_not_confirm():
    found = verdict([(50, coils(START))], replies=[(92, ECHO)], telegrams=[FIRST, (234, process(START))])
    assert "did not confirm" in found.differences[0]
