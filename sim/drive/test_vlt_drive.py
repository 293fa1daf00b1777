# SPDX-License-Identifier: Apache-2.0
"""The simulated drive and the telegram model, which other tests rely on.

These tests show no rule of the card and carry no rule id: they check the measuring instrument. Telegrams in
hex are worked out by hand from the protocol. The Python model builds the others and is checked against the
hand-made ones.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim.drive.drive_bench import (
    COAST,
    DC_BRAKE,
    FREEZE,
    FULL_SPEED,
    JOG,
    QUICK_STOP,
    RAMP_2,
    RAMP_STOP,
    RELAY_1,
    RELAY_2,
    RESET,
    REVERSE,
    SECOND,
    START,
    ask,
    brought_to,
    control,
    hertz,
    read_text,
    table,
    write_text,
)
from tb.lib.seeds import seeded
from tb.model import fc_telegram as fc
from tb.model.vlt_drive import DriveError, Outcome, VltDrive

ROOT = Path(__file__).resolve().parents[2]
TABLE_TOOL = ROOT / "sim/drive/drive_table.py"

MAGNETISING = 300
ROWS = table("vlt6000")


# ---- telegrams on the wire ---------------------------------------------------------------------

HAND_MADE = [
    ("02 06 81 04 7C 19 99 7D", "02 06 81 0F 03 20 00 A9"),
    ("02 06 01 04 7C 19 99 FD", "02 06 01 0F 03 20 00 29"),
    ("02 06 81 04 3C 00 00 BD", "02 06 81 0F 03 20 00 A9"),
    ("02 06 81 2C 20 00 00 89", "02 06 81 0F 03 20 00 A9"),
    (
        "02 0E 01 12 02 00 00 00 00 00 00 00 00 00 00 1D",
        "02 0E 01 22 02 00 00 00 00 01 2C 0F 03 20 00 2C",
    ),
    (
        "02 0E 81 12 02 00 00 00 00 00 00 00 00 00 00 9D",
        "02 0E 81 22 02 00 00 00 00 01 2C 0F 03 20 00 AC",
    ),
    (
        "02 0E 01 20 68 00 00 00 00 00 3C 00 00 00 00 79",
        "02 0E 01 10 68 00 00 00 00 00 3C 0F 03 20 00 65",
    ),
    (
        "02 0E 01 E0 68 00 00 00 00 00 3C 00 00 00 00 B9",
        "02 0E 01 10 68 00 00 00 00 00 3C 0F 03 20 00 65",
    ),
    (
        "02 0E 81 F2 6D 04 00 00 00 00 00 00 00 00 00 16",
        "02 10 81 F2 6D 04 00 56 4C 54 36 30 30 0F 03 20 00 5C",
    ),
    (
        "02 14 01 F2 15 05 00 31 32 33 34 35 36 37 38 39 30 00 00 00 00 F4",
        "02 14 01 F2 15 05 00 31 32 33 34 35 36 37 38 39 30 0F 03 20 00 D8",
    ),
]


@pytest.mark.parametrize(("request_hex", "reply_hex"), HAND_MADE)
def test_examples_of_the_manual_byte_for_byte(request_hex: str, reply_hex: str):
    assert VltDrive(example=True).telegram(bytes.fromhex(request_hex)) == bytes.fromhex(reply_hex)


def test_refusal_byte_for_byte():
    """Write 104 while the motor must not be disturbed: AK 7, PWE low 17."""
    drive = VltDrive(example=True)
    drive.refuse(104, 17)
    request = bytes.fromhex("02 0E 01 20 68 00 00 00 00 00 3C 00 00 00 00 79")
    assert drive.telegram(request) == bytes.fromhex("02 0E 01 70 68 00 00 00 00 00 11 0F 03 20 00 28")
    drive.refuse(104, None)
    assert drive.telegram(request)[3] == 0x10


def test_the_python_model_builds_the_hand_made_telegrams():
    assert fc.build_process(0x047C, 0x1999, adr=0x20) == bytes.fromhex("02 06 20 04 7C 19 99 DC")
    assert fc.build_process(0x047C, 0x1999, adr=0x80) == bytes.fromhex("02 06 80 04 7C 19 99 7C")
    assert fc.build_parameter(1, 514) == bytes.fromhex(HAND_MADE[5][0])
    assert fc.build_parameter(14, 104, pwe=60, adr=1) == bytes.fromhex(HAND_MADE[7][0])
    assert fc.build_text_read(621) == bytes.fromhex(HAND_MADE[8][0])
    assert fc.build_text(533, b"1234567890", adr=1) == bytes.fromhex(HAND_MADE[9][0])
    assert fc.build_parameter(2, 514, pwe=300, pcd1=0x0F03, pcd2=0x2000) == bytes.fromhex(HAND_MADE[5][1])
    assert fc.build_process(0x047C, -8192) == fc.build_process(0x047C, 0xE000)


def test_the_python_model_parses_the_hand_made_telegrams():
    assert fc.parse(bytes.fromhex(HAND_MADE[0][0])) == fc.Telegram(0x81, 0x047C, 0x1999)
    text = fc.parse(bytes.fromhex(HAND_MADE[8][1]), reply=True)
    assert (text.kind, text.pnu, text.ind, text.text) == ("text", 621, 0x0400, b"VLT600")
    assert fc.parse(bytes.fromhex(HAND_MADE[8][0])).kind == "parameter"
    refused = fc.parse(bytes.fromhex("02 0E 01 70 68 00 00 00 00 00 11 0F 03 20 00 28"), reply=True)
    assert refused.fault == 17


@pytest.mark.parametrize(
    ("telegram", "complaint"),
    [
        ("02 06 81", "shortest"),
        ("03 06 81 04 7C 19 99 7C", "starts with 03"),
        ("02 07 81 04 7C 19 99 7C", "LGE 07"),
        ("02 06 81 04 7C 19 99 7E", "BCC 7E instead of 7D"),
        ("02 08 81 04 7C 19 99 00 00 73", "fits no kind of telegram"),
        ("02 0D 81 12 02 00 00 00 00 00 00 00 00 00 9E", "with AK 1"),
    ],
)
def test_the_python_model_names_the_error_of_a_telegram(telegram: str, complaint: str):
    with pytest.raises(fc.TelegramError, match=complaint):
        fc.parse(bytes.fromhex(telegram))


@pytest.mark.parametrize(
    ("telegram", "reply", "words"),
    [
        (HAND_MADE[0][0], False, "start, reference 40.0 %"),
        (HAND_MADE[0][1], True, "running, on reference, output frequency 50.0 %"),
        ("02 06 80 04 7C 19 99 7C", False, "broadcast; start, reference 40.0 %"),
        (HAND_MADE[3][0], False, "coast stop, relay 1, reference 0.0 %"),
        (HAND_MADE[5][0], False, "read parameter 514"),
        (HAND_MADE[5][1], True, "parameter 514 is 300; running, on reference, output frequency 50.0 %"),
        (HAND_MADE[7][0], False, "write parameter 104 = 60 (EEPROM)"),
        (HAND_MADE[8][0], False, "read text parameter 621"),
        (HAND_MADE[9][0], False, 'write text parameter 533 = "1234567890"'),
        ("02 06 81 00 01 00 00 84", False, "no process command"),
        ("02 06 81 04 7C 19 99 00", False, "bad telegram: BCC 00 instead of 7D"),
    ],
)
def test_telegram_is_described(telegram: str, reply: bool, words: str):
    assert fc.describe(bytes.fromhex(telegram), reply) == words


@pytest.mark.parametrize("adr", [0x01, 0x81])
def test_the_reply_echoes_the_address_byte_of_either_format(adr: int):
    reply = VltDrive().telegram(fc.build_process(0, 0, adr))
    assert reply[2] == adr


@pytest.mark.parametrize("adr", [0x00, 0x02, 0x1F, 0x40, 0x41, 0x60, 0x7F, 0x82, 0xC1, 0xFF])
def test_a_telegram_for_another_drive_is_not_answered_and_does_nothing(adr: int):
    drive = VltDrive()
    assert drive.telegram(fc.build_process(START, FULL_SPEED, adr)) is None
    assert drive.outcome is Outcome.NOT_MINE
    assert drive.control_word == 0


def test_the_address_is_a_parameter_of_the_drive():
    drive = VltDrive()
    drive.set(501, 40)
    assert drive.telegram(fc.build_process(0, 0, 0x80 | 40)) is not None
    assert drive.telegram(fc.build_process(0, 0, 0x81)) is None
    assert drive.telegram(fc.build_process(START, 0, 40)) is None, (
        "40 = 28h is a broadcast in the short format"
    )
    assert drive.outcome is Outcome.BROADCAST


@pytest.mark.parametrize("adr", [0x80, *range(0x20, 0x40)])
def test_a_broadcast_is_executed_and_never_answered(adr: int):
    drive = VltDrive()
    assert drive.telegram(fc.build_process(START, 0x1999, adr)) is None
    assert drive.outcome is Outcome.BROADCAST
    assert (drive.control_word, drive.reference_word) == (START, 0x1999)
    assert drive.telegram(fc.build_parameter(2, 209, pwe=150, adr=adr)) is None
    assert drive.get(209) == 150
    assert drive.telegram(fc.build_text(533, b"ALL", adr=adr)) is None
    assert drive.get_text(533) == "ALL"
    assert drive.telegram(fc.build_parameter(1, 514, adr=adr)) is None


def spoilt_telegrams() -> Iterator[tuple[str, bytes]]:
    """The start command, damaged in every way that a receiver has to notice."""
    good = fc.build_process(START, FULL_SPEED)
    yield "nothing at all", b""
    yield "STX alone", good[:1]
    for n in range(1, len(good)):
        yield f"cut after {n} bytes", good[:n]
    yield "a byte too many", good + b"\x00"
    yield "wrong STX", b"\x03" + good[1:-1] + bytes([good[-1] ^ 1])
    yield "LGE one too great", bytes([2, 7]) + good[2:-1] + bytes([good[-1] ^ 1])
    yield "LGE one too small", bytes([2, 5]) + good[2:-1] + bytes([good[-1] ^ 3])
    for bit in range(8):
        yield f"BCC bit {bit}", good[:-1] + bytes([good[-1] ^ 1 << bit])
    data = fc.words(START, FULL_SPEED)
    yield "five data bytes", fc.build(data + b"\x00")
    yield "seven data bytes", fc.build(b"\x00\x00\x00" + data)
    yield "eight data bytes, no text", fc.build(fc.words(0x1202, 0) + data)
    yield "eleven data bytes", fc.build(fc.words(0x1202, 0, 0) + b"\x00" + data)
    yield "sixteen data bytes, no text", fc.build(fc.words(0x1202, 0, 0, 0, 0, 0) + data)
    yield "text read with characters", fc.build(fc.words(0xF215, 0x0400) + b"123456" + data)


@pytest.mark.parametrize(
    ("what", "telegram"), list(spoilt_telegrams()), ids=lambda x: x if isinstance(x, str) else ""
)
def test_damaged_telegram_is_ignored(what: str, telegram: bytes):
    drive = VltDrive()
    assert drive.telegram(telegram) is None, what
    assert drive.outcome is Outcome.DAMAGED
    assert (drive.control_word, drive.status_word) == (0, 0x0607)


# ---- parameters --------------------------------------------------------------------------------


def test_the_table_has_all_the_parameters():
    assert len(ROWS) == 209


def test_the_logs_606_to_617_are_the_arrays():
    arrays = {int(row["pnu"]): int(row["array"]) for row in ROWS if row["array"] != "0"}
    assert arrays == {**dict.fromkeys(range(606, 615), 20), **dict.fromkeys(range(615, 618), 10)}


def test_each_element_of_a_log_is_read_by_its_own_index():
    drive = VltDrive()
    for pnu in range(606, 618):
        length = 20 if pnu < 615 else 10
        indices = [*range(1, length + 1)]
        for index in indices:
            drive.set(pnu, index, index)
        assert [ask(drive, fc.AK_READ, pnu, ind=i).pwe for i in indices] == indices


def test_the_texts_are_533_534_and_the_nameplate_621_to_631():
    texts = {int(row["pnu"]): row["access"] for row in ROWS if row["type"] == "text"}
    assert texts == {533: "rw", 534: "rw", **dict.fromkeys(range(621, 632), "ro")}


def ramping_down() -> VltDrive:
    drive = brought_to(25)
    control(drive, RAMP_STOP)
    drive.step(SECOND)
    return drive


def braking() -> VltDrive:
    drive = brought_to(25)
    drive.set(115, 20)
    control(drive, DC_BRAKE)
    drive.step(SECOND)
    return drive


@pytest.mark.parametrize("state", [ramping_down, braking])
def test_stopping_motor_counts_as_running(state):
    """Fault 17 until the motor stands, then the same write is accepted."""
    drive = state()
    assert ask(drive, fc.AK_WRITE_WORD, 104, 60).fault == 17
    drive.step(10 * SECOND)
    assert ask(drive, fc.AK_WRITE_WORD, 104, 60).fault is None


@pytest.mark.parametrize(
    ("why", "ak", "pnu", "ind", "pwe", "fault"),
    [
        ("no such number", fc.AK_READ, 999, 0, 0, 0),
        ("number 0", fc.AK_READ, 0, 0, 0, 0),
        ("the greatest number", fc.AK_READ, 2047, 0, 0, 0),
        ("write to no such number", fc.AK_WRITE_WORD, 18, 0, 0, 0),
        ("a readout", fc.AK_WRITE_DOUBLE, 514, 0, 1, 1),
        ("a readout, in EEPROM too", fc.AK_EEPROM_DOUBLE, 514, 0, 1, 1),
        ("a readout as a word: rights come first", fc.AK_WRITE_WORD, 514, 0, 1, 1),
        ("1001 Hz", fc.AK_WRITE_WORD, 104, 0, 1001, 2),
        ("23 Hz", fc.AK_EEPROM_WORD, 104, 0, 23, 2),
        ("-100.01 %", fc.AK_WRITE_WORD, 211, 0, -10001 & 0xFFFF, 2),
        ("256 in a byte", fc.AK_WRITE_WORD, 16, 0, 256, 2),
        ("log entry 0", fc.AK_READ, 615, 0, 0, 3),
        ("log entry 11 of 10", fc.AK_READ, 615, 11, 0, 3),
        ("log entry 21 of 20", fc.AK_READ, 606, 21, 0, 3),
        ("index of what is no array", fc.AK_READ, 104, 1, 0, 4),
        ("index of a text", fc.AK_TEXT, 621, 0x0401, 0, 4),
        ("word into a double word", fc.AK_WRITE_WORD, 105, 0, 738, 5),
        ("word into a double word, in EEPROM", fc.AK_EEPROM_WORD, 206, 0, 5, 5),
        ("double word into a word", fc.AK_WRITE_DOUBLE, 104, 0, 60, 5),
        ("double word into a byte, in EEPROM", fc.AK_EEPROM_DOUBLE, 1, 0, 1, 5),
        ("text read as a number", fc.AK_READ, 533, 0, 0, 5),
        ("number read as a text", fc.AK_TEXT, 104, 0x0400, 0, 5),
        ("number written as a text", fc.AK_TEXT, 104, 0x0500, 0, 5),
        ("text neither read nor written", fc.AK_TEXT, 533, 0x0000, 0, 3),
        ("the bus's own address", fc.AK_WRITE_WORD, 501, 0, 2, 130),
        *((f"AK {ak}, which is none", ak, 104, 0, 60, 130) for ak in range(4, 13)),
    ],
)
def test_each_refusal_has_its_number(why: str, ak: int, pnu: int, ind: int, pwe: int, fault: int):
    drive = VltDrive()
    reply = ask(drive, ak, pnu, pwe, ind)
    assert (reply.ak, reply.pnu, reply.ind) == (fc.REPLY_REFUSED, pnu, ind), why
    assert reply.pwe == fault, "PWE high is 0, PWE low the number"
    assert (reply.pcd1, reply.pcd2) == (drive.status_word, drive.frequency_word)
    assert drive.eeprom_writes == 0


def test_factory_setup_allows_only_the_setup_choice():
    drive = VltDrive()
    assert ask(drive, fc.AK_WRITE_WORD, 2, 0).fault is None
    assert ask(drive, fc.AK_WRITE_WORD, 104, 60).fault == 131
    assert write_text(drive, 533, b"NO").fault == 131
    assert ask(drive, fc.AK_READ, 104).pwe == 50
    assert ask(drive, fc.AK_WRITE_WORD, 2, 1).fault is None
    assert ask(drive, fc.AK_WRITE_WORD, 104, 60).fault is None


def test_ak_0_is_answered_without_a_value():
    reply = ask(VltDrive(), fc.AK_NONE, 104, 1234, 5)
    assert (reply.ak, reply.pnu, reply.ind, reply.pwe) == (0, 0, 0, 0)


@pytest.mark.parametrize(
    ("ak", "pnu", "value", "kept"),
    [
        (fc.AK_WRITE_WORD, 104, 60, False),
        (fc.AK_WRITE_DOUBLE, 105, 738, False),
        (fc.AK_EEPROM_WORD, 104, 60, True),
        (fc.AK_EEPROM_DOUBLE, 105, 738, True),
        (fc.AK_EEPROM_WORD, 214, -2500, True),
    ],
)
def test_only_eeprom_values_survive_a_power_cycle(ak: int, pnu: int, value: int, kept: bool):
    drive = VltDrive()
    before = drive.get(pnu)
    assert ask(drive, ak, pnu, value).fault is None
    assert drive.get(pnu) == value
    drive.power_cycle()
    assert drive.get(pnu) == drive.get_eeprom(pnu) == (value if kept else before)
    assert drive.eeprom_writes == kept


def test_bit_11_of_pke_is_ignored():
    reply = VltDrive().telegram(fc.build_parameter(fc.AK_READ, 0x800 | 104))
    assert reply[3:5] == bytes.fromhex("10 68")


def test_word_write_uses_only_pwe_low():
    drive = VltDrive()
    assert ask(drive, fc.AK_WRITE_WORD, 104, 0xABCD003C).fault is None
    assert drive.get(104) == 60


def test_a_telegram_can_write_and_start_at_once():
    """The parameter part is executed first: the motor still stands when 104 is written."""
    drive = VltDrive()
    request = fc.build_parameter(fc.AK_WRITE_WORD, 104, pwe=60, pcd1=START, pcd2=FULL_SPEED)
    reply = fc.parse(drive.telegram(request), reply=True)
    assert (reply.fault, reply.pcd1) == (None, 0x0E03)


def test_direct_access_can_set_every_parameter():
    drive = VltDrive()
    drive.set(514, 1234)
    drive.set(609, 400, index=8)
    assert ask(drive, fc.AK_READ, 514).pwe == 1234
    assert ask(drive, fc.AK_READ, 609, ind=8).pwe == 0x0190
    for bad in (
        lambda: drive.set(999, 1),
        lambda: drive.set(609, 1),
        lambda: drive.get(621),
        lambda: drive.get_text(1),
    ):
        with pytest.raises(DriveError):
            bad()


# ---- texts -------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 4, 10, 19, 20])
def test_a_display_text_of_up_to_20_characters_comes_back_unpadded(n: int):
    drive = VltDrive()
    text = b"ABCDEFGHIJKLMNOPQRST"[:n]
    request = fc.build_text(534, text)
    reply = drive.telegram(request)
    assert request[1] == reply[1] == 10 + n
    assert fc.parse(reply, reply=True).text == text
    assert read_text(drive, 534) == text
    drive.power_cycle()
    assert drive.get_text(534) == text.decode()


def test_a_display_text_of_21_characters_is_refused():
    drive = VltDrive()
    assert write_text(drive, 533, b"X" * 21).fault == 2
    assert read_text(drive, 533) == b""


def test_a_text_longer_than_20_characters_is_sent_whole():
    """The card cuts the text, not the drive (FC-7)."""
    drive = VltDrive()
    drive.set_text(621, "N" * 60)
    assert read_text(drive, 621) == b"N" * 60
    with pytest.raises(DriveError):
        drive.set_text(621, "N" * 61)


# ---- control word, status word, motor ----------------------------------------------------------


def test_a_drive_just_powered_up_stands_by_without_current():
    drive = VltDrive()
    assert control(drive, 0) == (0x0607, 0)
    assert ask(drive, fc.AK_READ, 514).pwe == 0


def test_the_preheater_warms_a_motor_that_stands():
    drive = VltDrive()
    assert ask(drive, fc.AK_WRITE_WORD, 112, 1).fault is None
    assert ask(drive, fc.AK_READ, 514).pwe == 300, "3.00 A: 50 % of 6.00 A"


def test_start_at_40_percent_ramps_up_to_20_hz():
    """Ramp-up time 10 s from 0 to 50 Hz, so 5 Hz a second."""
    drive = VltDrive()
    assert control(drive, 0x047C, 0x1999) == (0x0E03, 0), "running, not yet on reference"
    drive.step(2 * SECOND)
    assert control(drive, 0) == (0x0E03, 0x0CCD), "10 Hz after 2 s"
    assert drive.get(512) == 100
    drive.step(2 * SECOND)
    assert control(drive, 0) == (0x0F03, 0x1999), "on reference after 4 s"
    drive.step(60 * SECOND)
    assert control(drive, 0) == (0x0F03, 0x1999), "and it stays there"
    assert (drive.get(512), drive.get(510), drive.get(509)) == (200, 19998, 400)


@pytest.mark.parametrize("part", [1, 7, 999, 1000, 1001, 333_333])
def test_time_steps_may_have_any_length(part: int):
    drive = VltDrive()
    control(drive, START, FULL_SPEED)
    for _ in range(SECOND // part):
        drive.step(part)
    drive.step(SECOND % part)
    assert drive.frequency_mhz == 5000


def test_ramp_times_come_from_their_parameters():
    drive = VltDrive()
    ask(drive, fc.AK_WRITE_DOUBLE, 206, 5)
    ask(drive, fc.AK_WRITE_DOUBLE, 207, 20)
    control(drive, START, FULL_SPEED)
    drive.step(4_999_000)
    assert not control(drive, 0)[0] & 0x0100
    drive.step(1000)
    assert control(drive, 0) == (0x0F03, 0x4000)
    control(drive, RAMP_STOP)
    drive.step(19_999_000)
    assert control(drive, 0)[0] == 0x0E03, "still turning"
    drive.step(1000)
    assert control(drive, 0) == (0x0607, 0)


def test_current_follows_the_load():
    """A fan: magnetising current at rest, rated current (6.00 A) at rated speed, square in between."""
    drive = VltDrive()
    control(drive, START, FULL_SPEED)
    assert drive.get(514) == MAGNETISING
    drive.step(5 * SECOND)
    assert drive.get(514) == 300 + 300 // 4
    drive.step(5 * SECOND)
    assert (drive.get(514), drive.get(515), drive.get(517)) == (600, 220, 4000)


def test_a_control_word_without_bit_10_is_ignored_with_its_reference():
    drive = brought_to(25)
    for word in (0x0000, COAST & ~0x0400, 0xFBFF):
        assert control(drive, word, 0x1000) == (0x0F03, 0x2000)
    assert (drive.control_word, drive.reference_word) == (START, 0x2000)


@pytest.mark.parametrize(
    ("first", "second", "obeyed"),
    [
        (COAST, QUICK_STOP, "coast"),
        (COAST, DC_BRAKE, "coast"),
        (COAST, RAMP_STOP, "coast"),
        (QUICK_STOP, DC_BRAKE, "ramp"),
        (QUICK_STOP, RAMP_STOP, "ramp"),
        (DC_BRAKE, RAMP_STOP, "brake"),
        (COAST, JOG & ~0x0400, "coast"),
    ],
)
def test_stronger_of_two_stops_is_obeyed(first: int, second: int, obeyed: str):
    """Coast before quick stop before DC brake before ramp stop; their bits are active low."""
    drive = brought_to(50)
    drive.set(115, 20)  # brake for 2.0 s
    control(drive, first & second | 0x0400)
    ramping = obeyed == "ramp"
    assert hertz(drive) == (50 if ramping else 0), "only a ramp leaves the output on"
    drive.step(SECOND)
    assert hertz(drive) == (45 if ramping else 0)
    assert drive.running == (obeyed != "coast"), "coasting counts as stopped, braking does not"


def test_a_ramp_stop_wins_over_freeze():
    drive = brought_to(50)
    control(drive, RAMP_STOP & FREEZE, FULL_SPEED)
    drive.step(10 * SECOND)
    assert hertz(drive) == 0


def test_bit_9_has_no_function():
    """A VLT 6000 has one ramp."""
    drive = VltDrive()
    control(drive, START | RAMP_2, FULL_SPEED)
    drive.step(SECOND)
    assert hertz(drive) == 5


@pytest.mark.parametrize("stop", [COAST, QUICK_STOP, DC_BRAKE])
@pytest.mark.parametrize("also", [0, 0x0100], ids=["", "jog"])
def test_a_stop_wins_over_start_jog_and_freeze(stop: int, also: int):
    drive = brought_to(50)
    control(drive, (stop | also) & ~0x0020, FULL_SPEED)
    drive.step(10 * SECOND)
    assert hertz(drive) == 0


def test_a_quick_stop_ramps_down_even_while_start_is_held():
    drive = brought_to(50)
    control(drive, QUICK_STOP, FULL_SPEED)
    drive.step(4 * SECOND)
    assert hertz(drive) == 30
    assert control(drive, 0)[0] == 0x0E03, "turning, not on reference"


def test_the_dc_brake_holds_current_for_its_time():
    drive = brought_to(50)
    ask(drive, fc.AK_WRITE_WORD, 114, 80)
    ask(drive, fc.AK_WRITE_WORD, 115, 15)
    assert control(drive, DC_BRAKE, FULL_SPEED) == (0x0607, 0)
    drive.step(1_499_000)
    assert (drive.get(514), drive.running) == (480, True)
    drive.step(1000)
    assert (drive.get(514), drive.running) == (0, False)


def test_jog_overrides_the_reference():
    drive = VltDrive()
    ask(drive, fc.AK_WRITE_WORD, 209, 125)
    control(drive, JOG & ~0x0040, FULL_SPEED)
    drive.step(10 * SECOND)
    assert drive.frequency_mhz == 12500
    control(drive, RAMP_STOP)
    drive.step(10 * SECOND)
    assert control(drive, 0) == (0x0607, 0)


def test_freeze_keeps_the_frequency_until_it_is_released():
    drive = VltDrive()
    control(drive, START, FULL_SPEED)
    drive.step(3 * SECOND)
    control(drive, FREEZE, 0x1000)
    drive.step(10 * SECOND)
    assert hertz(drive) == 15
    assert control(drive, 0)[0] == 0x0E03
    control(drive, START, FULL_SPEED)
    drive.step(7 * SECOND)
    assert control(drive, 0) == (0x0F03, 0x4000)


@pytest.mark.parametrize(("selector", "reverses"), [(0, False), (1, True), (2, False), (3, True)])
def test_bit_15_reverses_only_if_506_allows_the_bus(selector: int, reverses: bool):
    """Default of 506 is 0, digital input; 2 needs the (unwired) input as well."""
    drive = VltDrive()
    ask(drive, fc.AK_WRITE_WORD, 506, selector)
    control(drive, START | REVERSE, 0x2000)
    drive.step(10 * SECOND)
    assert hertz(drive) == (-25 if reverses else 25)
    assert control(drive, 0)[1] == (0xE000 if reverses else 0x2000)


def test_a_negative_reference_turns_the_motor_backwards_through_standstill():
    drive = brought_to(25)
    control(drive, START, 0xE000)
    drive.step(5 * SECOND)
    assert hertz(drive) == 0, "down on ramp-down time first"
    drive.step(5 * SECOND)
    assert (hertz(drive), control(drive, 0)) == (-25, (0x0F03, 0xE000))


@pytest.mark.parametrize("choice", range(4))
def test_bits_0_and_1_choose_the_preset_reference(choice: int):
    drive = VltDrive()
    for pnu, percent in zip(range(211, 215), (1000, 2000, -3000, 4000), strict=True):
        ask(drive, fc.AK_WRITE_WORD, pnu, percent)
    control(drive, START | choice, 0x1000)  # 25 % from the bus
    drive.step(20 * SECOND)
    assert hertz(drive) == (17.5, 22.5, -2.5, 32.5)[choice], "sum of both"


@pytest.mark.parametrize(
    ("kind", "preset", "reference", "expected_hz"),
    [(0, 5000, 0x2000, 50), (0, 6000, 0x2000, 50), (1, 5000, 0x2000, 37.5), (2, 5000, 0x2000, 25)],
    ids=["sum", "sum, limited to 100 %", "relative", "external"],
)
def test_reference_type_joins_bus_and_preset(kind: int, preset: int, reference: int, expected_hz: float):
    drive = VltDrive()
    ask(drive, fc.AK_WRITE_WORD, 202, 1000)
    ask(drive, fc.AK_WRITE_WORD, 210, kind)
    ask(drive, fc.AK_WRITE_WORD, 211, preset)
    control(drive, START, reference)
    drive.step(20 * SECOND)
    assert hertz(drive) == expected_hz


def test_reference_spans_204_to_205_and_output_frequency_201_to_202():
    drive = VltDrive()
    for pnu, value in ((204, 10_000), (205, 40_000)):
        assert ask(drive, fc.AK_WRITE_DOUBLE, pnu, value).fault is None
    for pnu, value in ((201, 200), (202, 300)):
        assert ask(drive, fc.AK_WRITE_WORD, pnu, value).fault is None
    status, word = control(drive, START, 0x2000)
    assert (status & 0x0400, word) == (0, 0), "0 Hz is below 201"
    drive.step(20 * SECOND)
    assert hertz(drive) == 25
    assert control(drive, START, 0) == (0x0E03, 0x2000), "25 Hz is half way from 20 to 30 Hz"
    drive.step(20 * SECOND)
    assert (hertz(drive), control(drive, START, 0x7FFF)[1]) == (20, 0), "not below 201"
    drive.step(20 * SECOND)
    assert (hertz(drive), control(drive, 0)[1]) == (30, 0x4000), "not above 202"


def test_the_bus_cannot_start_what_505_reserves_for_the_digital_input():
    drive = VltDrive()
    ask(drive, fc.AK_WRITE_WORD, 505, 0)
    assert control(drive, START, FULL_SPEED) == (0x0607, 0)


def test_relays_follow_bits_11_and_12_if_selected():
    drive = VltDrive()
    control(drive, RAMP_STOP | RELAY_1 | RELAY_2)
    assert (drive.relay(1), drive.relay(2)) == (False, False), "as delivered: alarm and running"
    ask(drive, fc.AK_WRITE_WORD, 323, 26)
    ask(drive, fc.AK_WRITE_WORD, 326, 26)
    assert (drive.relay(1), drive.relay(2)) == (True, True)
    control(drive, RAMP_STOP | RELAY_2)
    assert (drive.relay(1), drive.relay(2)) == (False, True)


def test_relays_show_alarm_and_running_as_delivered():
    drive = VltDrive()
    control(drive, START)
    assert (drive.relay(1), drive.relay(2)) == (False, True)
    drive.trip(4)
    assert (drive.relay(1), drive.relay(2)) == (True, False)


def test_trip_stops_the_output_and_only_an_edge_resets_it():
    drive = brought_to(50)
    control(drive, START | RESET, FULL_SPEED)  # bit 7 stands before the trip: no edge later
    drive.trip(14)
    assert control(drive, 0) == (0x0608, 0)
    assert (drive.alarm, drive.get(514), drive.get(529)) == (14, 0, 1 << 13)
    assert control(drive, START | RESET, FULL_SPEED)[0] == 0x0608, "no edge"
    assert control(drive, RESET)[0] == 0x0608, "not valid: bit 10 is 0"
    assert control(drive, RAMP_STOP)[0] == 0x0608
    assert control(drive, RAMP_STOP | RESET)[0] == 0x0607
    assert drive.alarm == 0


def test_only_a_power_cycle_resets_a_trip_lock():
    drive = VltDrive()
    drive.trip_lock(12)
    control(drive, RAMP_STOP)
    assert control(drive, RAMP_STOP | RESET)[0] == 0x0608, "bit 6 is not used by a VLT 6000"
    drive.power_cycle()
    assert (control(drive, 0)[0], drive.alarm) == (0x0607, 0)
    drive.trip(12)
    assert control(drive, RAMP_STOP | RESET)[0] == 0x0607, "an ordinary trip again"


def test_a_drive_that_has_tripped_already_is_not_locked_by_the_next_alarm():
    drive = VltDrive()
    drive.trip(4)
    drive.trip_lock(12)
    assert drive.alarm == 4
    assert control(drive, RAMP_STOP | RESET)[0] == 0x0607


def test_fault_log_has_the_newest_trip_first_and_survives_a_power_cycle():
    drive = VltDrive()
    for alarm in (7, 8, 9):
        drive.trip(alarm)
        drive.trip(99)  # already tripped
        control(drive, RAMP_STOP)
        control(drive, RAMP_STOP | RESET)
    drive.power_cycle()
    assert [ask(drive, fc.AK_READ, 615, ind=i).pwe for i in (1, 2, 3, 4)] == [9, 8, 7, 0]
    assert ask(drive, fc.AK_READ, 616, ind=1).pwe == 567, "hours run at the trip"


def test_eleven_trips_leave_the_last_ten_in_the_log():
    drive = VltDrive()
    for alarm in range(1, 12):
        drive.trip(alarm)
        drive.power_cycle()
    assert [drive.get(615, i) for i in range(1, 11)] == list(range(11, 1, -1))


def test_a_warning_and_the_current_limit_show_in_the_status_word():
    drive = brought_to(50)
    drive.warn(0x00000100)
    assert control(drive, 0)[0] == 0x0F83
    assert ask(drive, fc.AK_READ, 531).pwe == 0x100
    drive.warn(0)
    ask(drive, fc.AK_WRITE_WORD, 215, 59)  # 5.9 A, the motor takes 6.00 A
    assert control(drive, 0)[0] == 0x4F03


@pytest.mark.parametrize(
    ("function", "after_hz", "alarm"),
    [(0, 25, 0), (1, 25, 0), (2, 0, 0), (3, 10, 0), (4, 50, 0), (5, 0, 17)],
    ids=["off", "freeze", "stop", "jog", "max", "stop and trip"],
)
def test_bus_timeout_acts_as_556_selects(function: int, after_hz: float, alarm: int):
    drive = brought_to(25)
    ask(drive, fc.AK_WRITE_WORD, 323, 26)
    ask(drive, fc.AK_WRITE_WORD, 555, 2)
    ask(drive, fc.AK_WRITE_WORD, 556, function)
    control(drive, START | RELAY_1, 0x2000)
    for _ in range(20):
        drive.step(SECOND)
        control(drive, 0)  # telegrams without a valid control word do not count
    assert (hertz(drive), drive.alarm) == (after_hz, alarm)
    assert drive.relay(1) == (function == 0)


def test_control_words_in_time_prevent_the_bus_timeout():
    drive = brought_to(25)
    ask(drive, fc.AK_WRITE_WORD, 555, 2)
    ask(drive, fc.AK_WRITE_WORD, 556, 2)
    for _ in range(10):
        control(drive, START, 0x2000)
        drive.step(2 * SECOND)
    assert hertz(drive) == 25


def test_forced_drive_reports_the_forced_words_and_stands_still():
    drive = VltDrive()
    drive.force_process(0x1234, 0x5678)
    assert control(drive, START, FULL_SPEED) == (0x1234, 0x5678)
    drive.step(SECOND)
    assert (drive.frequency_mhz, drive.control_word) == (0, START)
    assert ask(drive, fc.AK_WRITE_WORD, 104, 60).fault is None
    drive.release_process()
    drive.step(SECOND)
    assert drive.frequency_mhz == 6000, "from here on it lives: 6 Hz after a second of 60 Hz in 10 s"


def test_two_drives_are_independent():
    one, two = VltDrive(), VltDrive()
    two.set(501, 2)
    for request in (fc.build_process(START, FULL_SPEED, 0x81), fc.build_parameter(2, 209, pwe=77, adr=0x81)):
        assert [drive.telegram(request) is None for drive in (one, two)] == [False, True]
    assert (one.control_word, two.control_word) == (START, 0)
    assert (one.get(209), two.get(209)) == (77, 100)


# ---- random telegrams --------------------------------------------------------------------------


def test_random_bytes_do_not_upset_the_drive():
    """Random bytes, random data in a good frame, one damaged byte: silence or a well-formed reply."""
    rng = seeded("bytes")
    drive = VltDrive()
    for _ in range(20_000):
        if rng.random() < 0.2:
            request = rng.randbytes(rng.randrange(300))
        else:
            data = bytearray(rng.randbytes(rng.choice([4, 4, 12, 12, 12, rng.randrange(250)])))
            if len(data) > 4 and rng.random() < 0.5:
                data[:4] = fc.words(
                    fc.pke(rng.randrange(16), int(rng.choice(ROWS)["pnu"])), rng.randrange(0x600)
                )
            request = fc.build(bytes(data), rng.choice([0x81, 0x01, 0x80, rng.randrange(256)]))
        spoil = rng.random() < 0.2 and len(request) > 0
        if spoil:
            at = rng.randrange(len(request))
            request = request[:at] + bytes([request[at] ^ 1 << rng.randrange(8)]) + request[at + 1 :]
        before = (drive.control_word, drive.reference_word)
        reply = drive.telegram(request)
        if reply is not None:
            assert fc.parse(request).adr == fc.parse(reply, reply=True).adr == request[2]
        elif drive.outcome is not Outcome.BROADCAST:
            assert (drive.control_word, drive.reference_word) == before
        if rng.random() < 0.02:
            drive.trip(rng.randrange(100))
        drive.step(rng.randrange(5000))
        assert abs(drive.frequency_mhz) <= 120_000, "the most that 202 allows"


# ---- the table tool ----------------------------------------------------------------------------

COLUMN_LINE = "pnu,name,type,conversion,min,max,default,array,access,while_running,unit,role,source"
GOOD_ROW = "104,Motor frequency,uint16,0,24,1000,50,0,rw,0,Hz,motor_frequency,memory"


def make_table(tmp_path: Path, text: str) -> tuple[int, str, Path]:
    """Exit code and messages of the table tool for a profile of this text."""
    source, header = tmp_path / "toy.csv", tmp_path / "out" / "toy_table.h"
    source.write_text(text)
    done = subprocess.run(
        [sys.executable, TABLE_TOOL, source, header], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stderr, header


def test_a_good_table_becomes_a_c_header(tmp_path: Path):
    code, messages, header = make_table(tmp_path, f"#: pnu_bits = 12\n{COLUMN_LINE}\n{GOOD_ROW}\n")
    assert (code, messages) == (0, "")
    assert '{"toy", 4095, 1, 130, false, ' in header.read_text()


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("104,x,uint16,0,24,1000,50,0,rw,0,Hz", "11 columns instead of 13"),
        ("104,x,uint24,0,24,1000,50,0,rw,0,Hz,,memory", "type 'uint24' is not one of"),
        ("2048,x,uint16,0,24,1000,50,0,rw,0,Hz,,memory", "pnu 2048 is outside 1 to 2047"),
        ("ten,x,uint16,0,24,1000,50,0,rw,0,Hz,,memory", "pnu 'ten' is not a whole number"),
        ("104,,uint16,0,24,1000,50,0,rw,0,Hz,,memory", "name is empty"),
        ("104,x,uint16,5,24,1000,50,0,rw,0,Hz,,memory", "conversion 5 is not one of"),
        ("104,x,uint8,0,24,1000,50,0,rw,0,Hz,,memory", "max 1000 is outside 24 to 255"),
        ("104,x,uint16,0,24,20,50,0,rw,0,Hz,,memory", "max 20 is outside 24 to 65535"),
        ("104,x,uint16,0,24,1000,23,0,rw,0,Hz,,memory", "default 23 is outside 24 to 1000"),
        ("104,x,uint16,0,24,1000,50.5,0,rw,0,Hz,,memory", "default '50.5' is not a whole number"),
        ("104,x,uint16,0,24,1000,50,0,wo,0,Hz,,memory", "access 'wo' is not one of rw, ro, local"),
        ("104,x,uint16,0,24,1000,50,0,rw,Y,Hz,,memory", "while_running 'Y' is not one of 0, 1"),
        ("104,x,uint16,0,24,1000,50,0,rw,0,Hz,speed,memory", "role 'speed' is not one of"),
        ("104,x,uint16,0,24,1000,50,9,rw,0,Hz,jog_frequency,memory", "an array cannot have role"),
        ("104,x,text,0,0,4,HELLO,0,ro,1,,,memory", "default has 5 characters"),
        ("104,x,text,0,0,61,,0,ro,1,,,memory", "max 61 is outside 0 to 60"),
        ("100,x,uint16,0,24,1000,50,0,rw,0,Hz,,memory", "pnu 100 does not follow 103"),
        ("104,x,uint16,0,24,1000,50,0,rw,0,Hz,ramp_up,memory", "role ramp_up is given twice"),
        ("#: pnu_bits = 16", "pnu_bits 16 is outside 11 to 12"),
        ("104,x,uint16,0,24,1000,50,0,rw,0,Hz,,rumour", "source 'rumour' is not one of document, partly, "),
        ("104,x,int16,-2,0,100,0,0,rw,1,%,presets,memory", "role presets needs 4 parameters in a row"),
        ("104,x,int16,-2,0,100,0,3,rw,1,%,presets,memory", "role presets needs 4 parameters in a row"),
        ("#: colour = 3", "setting must be one of"),
        ("#: colour 104 = 3", "setting must be one of"),
        ("#: index_first = two", "index_first 'two' is not a whole number"),
        ("#: index_first = 2", "index_first 2 is outside 0 to 1"),
        ("#: example 104 = 3", "example 104 is no number of this table"),
        ("#: example 103[1] = 3", "example 103 has no index 1"),
        ("#: example 103 = 11", "example 103 is outside 1 to 10"),
    ],
)
def test_a_malformed_row_is_told_with_its_line(tmp_path: Path, row: str, message: str):
    first = "103,First,uint16,0,1,10,5,0,rw,0,s,ramp_up,memory"
    code, messages, header = make_table(tmp_path, f"# toy\n{COLUMN_LINE}\n{first}\n{row}\n")
    assert code == 1
    assert messages.startswith(f"{tmp_path / 'toy.csv'}:4: ")
    assert message in messages
    assert not header.exists()


def test_all_malformed_rows_are_told_at_once(tmp_path: Path):
    code, messages, _ = make_table(tmp_path, f"{COLUMN_LINE}\n1,x\n{GOOD_ROW}\n2,y\n")
    assert code == 1
    assert [line.split(":")[1] for line in messages.splitlines()] == ["2", "4"]


def test_a_table_too_large_for_the_drive_is_refused(tmp_path: Path):
    rows = "\n".join(f"{pnu},x,uint8,0,0,1,0,255,ro,1,,,memory" for pnu in range(1, 6))
    code, messages, _ = make_table(tmp_path, f"{COLUMN_LINE}\n{rows}\n")
    assert code == 1
    assert "1275 values, vlt_drive.h has room for 1024" in messages
