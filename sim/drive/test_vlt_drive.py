# SPDX-License-Identifier: Apache-2.0
"""The simulated drive and the telegram model, which other tests rely on.

These tests show no rule of the card and carry no rule id: they check the measuring instrument. Telegrams in
hex are worked out by hand from the protocol. The Python model builds the others and is checked against the
hand-made ones.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from sim.drive.drive_bench import (
    COAST,
    DC_BRAKE,
    FREEZE,
    FULL_SPEED,
    RAMP_STOP,
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

MAGNETISING = 300
ROWS = table("vlt6000")


# ---- telegrams on the wire ---------------------------------------------------------------------

HAND_MADE = [
    ("02 06 81 04 7C 19 99 7D", "02 06 81 0F 03 20 00 A9"),
    ("02 06 01 04 7C 19 99 FD", "02 06 01 0F 03 20 00 29"),
    ("02 06 81 04 3C 00 00 BD", "02 06 81 0F 03 20 00 A9"),
    ("02 06 81 2C 20 00 00 89", "02 06 81 0F 03 20 00 A9"),
    ("02 0E 01 12 02 00 00 00 00 00 00 00 00 00 00 1D", "02 0E 01 22 02 00 00 00 00 01 2C 0F 03 20 00 2C"),
    ("02 0E 81 12 02 00 00 00 00 00 00 00 00 00 00 9D", "02 0E 81 22 02 00 00 00 00 01 2C 0F 03 20 00 AC"),
    ("02 0E 01 20 68 00 00 00 00 00 3C 00 00 00 00 79", "02 0E 01 10 68 00 00 00 00 00 3C 0F 03 20 00 65"),
    ("02 0E 01 E0 68 00 00 00 00 00 3C 00 00 00 00 B9", "02 0E 01 10 68 00 00 00 00 00 3C 0F 03 20 00 65"),
    (
        "02 0E 81 F2 6D 04 00 00 00 00 00 00 00 00 00 16",
        "02 10 81 F2 6D 04 00 56 4C 54 36 30 30 0F 03 20 00 5C",
    ),
    (
        "02 14 01 F2 15 05 00 31 32 33 34 35 36 37 38 39 30 00 00 00 00 F4",
        "02 14 01 F2 15 05 00 31 32 33 34 35 36 37 38 39 30 0F 03 20 00 D8",
    ),
]


def test_examples_of_the_manual_byte_for_byte():
    for request_hex, reply_hex in HAND_MADE:
        reply = VltDrive(example=True).telegram(bytes.fromhex(request_hex))
        assert reply == bytes.fromhex(reply_hex), request_hex


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


def test_the_python_model_names_the_error_of_a_telegram():
    for telegram, complaint in (
        ("02 06 81", "shortest"),
        ("03 06 81 04 7C 19 99 7C", "starts with 03"),
        ("02 07 81 04 7C 19 99 7C", "LGE 07"),
        ("02 06 81 04 7C 19 99 7E", "BCC 7E instead of 7D"),
        ("02 08 81 04 7C 19 99 00 00 73", "fits no kind of telegram"),
        ("02 0D 81 12 02 00 00 00 00 00 00 00 00 00 9E", "with AK 1"),
    ):
        with pytest.raises(fc.TelegramError, match=complaint):
            fc.parse(bytes.fromhex(telegram))


def test_a_telegram_for_another_drive_is_not_answered_and_does_nothing():
    drive = VltDrive()
    for adr in (0x00, 0x02, 0x1F, 0x40, 0x41, 0x60, 0x7F, 0x82, 0xC1, 0xFF):
        assert drive.telegram(fc.build_process(START, FULL_SPEED, adr)) is None, adr
        assert (drive.outcome, drive.control_word) == (Outcome.NOT_MINE, 0), adr
    assert [drive.telegram(fc.build_process(0, 0, adr))[2] for adr in (0x01, 0x81)] == [0x01, 0x81]


def test_the_address_is_a_parameter_of_the_drive():
    drive = VltDrive()
    drive.set(501, 40)
    assert drive.telegram(fc.build_process(0, 0, 0x80 | 40)) is not None
    assert drive.telegram(fc.build_process(0, 0, 0x81)) is None
    assert drive.telegram(fc.build_process(START, 0, 40)) is None, (
        "40 = 28h is a broadcast in the short format"
    )
    assert drive.outcome is Outcome.BROADCAST


def test_a_broadcast_is_executed_and_never_answered():
    for adr in (0x80, *range(0x20, 0x40)):
        drive = VltDrive()
        assert drive.telegram(fc.build_process(START, 0x1999, adr)) is None, adr
        assert drive.outcome is Outcome.BROADCAST
        assert (drive.control_word, drive.reference_word) == (START, 0x1999)
        assert drive.telegram(fc.build_parameter(2, 209, pwe=150, adr=adr)) is None
        assert drive.telegram(fc.build_text(533, b"ALL", adr=adr)) is None
        assert (drive.get(209), drive.get_text(533)) == (150, "ALL"), adr
        assert drive.telegram(fc.build_parameter(1, 514, adr=adr)) is None


def spoilt_telegrams() -> Iterator[tuple[str, bytes]]:
    """The start command, damaged in every way that a receiver has to notice."""
    good = fc.build_process(START, FULL_SPEED)
    for n in range(len(good)):
        yield f"cut after {n} bytes", good[:n]
    yield "a byte too many", good + b"\x00"
    yield "wrong STX", b"\x03" + good[1:-1] + bytes([good[-1] ^ 1])
    yield "LGE one too great", bytes([2, 7]) + good[2:-1] + bytes([good[-1] ^ 1])
    yield "LGE one too small", bytes([2, 5]) + good[2:-1] + bytes([good[-1] ^ 3])
    yield "wrong BCC", good[:-1] + bytes([good[-1] ^ 1])
    data = fc.words(START, FULL_SPEED)
    yield "five data bytes", fc.build(data + b"\x00")
    yield "eight data bytes, no text", fc.build(fc.words(0x1202, 0) + data)
    yield "eleven data bytes", fc.build(fc.words(0x1202, 0, 0) + b"\x00" + data)
    yield "sixteen data bytes, no text", fc.build(fc.words(0x1202, 0, 0, 0, 0, 0) + data)
    yield "text read with characters", fc.build(fc.words(0xF215, 0x0400) + b"123456" + data)


def test_a_damaged_telegram_is_ignored():
    drive = VltDrive()
    for what, telegram in spoilt_telegrams():
        assert drive.telegram(telegram) is None, what
        assert (drive.outcome, drive.control_word, drive.status_word) == (Outcome.DAMAGED, 0, 0x0607), what


# ---- parameters --------------------------------------------------------------------------------


def test_stopping_motor_counts_as_running():
    """Fault 17 until the motor stands, then the same write is accepted."""
    for stop in (RAMP_STOP, DC_BRAKE):
        drive = brought_to(25)
        drive.set(115, 20)  # the DC brake holds for 2 s
        control(drive, stop)
        drive.step(SECOND)
        assert ask(drive, fc.AK_WRITE_WORD, 104, 60).fault == 17
        drive.step(10 * SECOND)
        assert ask(drive, fc.AK_WRITE_WORD, 104, 60).fault is None


def test_each_refusal_has_its_number():
    """Those that follow from a row of the table alone are in test_drive_profiles.py."""
    for why, ak, pnu, ind, pwe, fault in (
        ("no such number", fc.AK_READ, 999, 0, 0, 0),
        ("write to no such number", fc.AK_WRITE_WORD, 18, 0, 0, 0),
        ("a readout, in EEPROM too", fc.AK_EEPROM_DOUBLE, 514, 0, 1, 1),
        ("a readout as a word: rights come first", fc.AK_WRITE_WORD, 514, 0, 1, 1),
        ("23 Hz", fc.AK_EEPROM_WORD, 104, 0, 23, 2),
        ("index of a text", fc.AK_TEXT, 621, 0x0401, 0, 4),
        ("word into a double word, in EEPROM", fc.AK_EEPROM_WORD, 206, 0, 5, 5),
        ("double word into a byte, in EEPROM", fc.AK_EEPROM_DOUBLE, 1, 0, 1, 5),
        ("text read as a number", fc.AK_READ, 533, 0, 0, 5),
        ("number read as a text", fc.AK_TEXT, 104, 0x0400, 0, 5),
        ("number written as a text", fc.AK_TEXT, 104, 0x0500, 0, 5),
        ("text neither read nor written", fc.AK_TEXT, 533, 0x0000, 0, 3),
        *((f"AK {ak}, which is none", ak, 104, 0, 60, 130) for ak in range(4, 13)),
    ):
        drive = VltDrive()
        reply = ask(drive, ak, pnu, pwe, ind)
        assert (reply.ak, reply.pnu, reply.ind) == (fc.REPLY_REFUSED, pnu, ind), why
        assert reply.pwe == fault, f"{why}: PWE high is 0, PWE low the number"
        assert (reply.pcd1, reply.pcd2) == (drive.status_word, drive.frequency_word), why


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


def test_only_eeprom_values_survive_a_power_cycle():
    for ak, pnu, value, kept in (
        (fc.AK_WRITE_WORD, 104, 60, False),
        (fc.AK_WRITE_DOUBLE, 105, 738, False),
        (fc.AK_EEPROM_WORD, 104, 60, True),
        (fc.AK_EEPROM_DOUBLE, 105, 738, True),
        (fc.AK_EEPROM_WORD, 214, -2500, True),
    ):
        drive = VltDrive()
        before = drive.get(pnu)
        assert ask(drive, ak, pnu, value).fault is None
        assert drive.get(pnu) == value
        drive.power_cycle()
        assert drive.get(pnu) == (value if kept else before), (ak, pnu)


def test_a_telegram_can_write_and_start_at_once():
    """The parameter part is executed first: the motor still stands when 104 is written."""
    drive = VltDrive()
    request = fc.build_parameter(fc.AK_WRITE_WORD, 104, pwe=60, pcd1=START, pcd2=FULL_SPEED)
    reply = fc.parse(drive.telegram(request), reply=True)
    assert (reply.fault, reply.pcd1) == (None, 0x0E03)


# ---- texts -------------------------------------------------------------------------------------


def test_a_display_text_of_up_to_20_characters_comes_back_unpadded():
    for n in (0, 1, 4, 10, 19, 20):
        drive, text = VltDrive(), b"ABCDEFGHIJKLMNOPQRST"[:n]
        request = fc.build_text(534, text)
        reply = drive.telegram(request)
        assert request[1] == reply[1] == 10 + n
        assert fc.parse(reply, reply=True).text == read_text(drive, 534) == text
        drive.power_cycle()
        assert drive.get_text(534) == text.decode()
    assert write_text(drive, 533, b"X" * 21).fault == 2


def test_a_text_longer_than_20_characters_is_sent_whole():
    """The card cuts the text, not the drive (FC-7)."""
    drive = VltDrive()
    drive.set_text(621, "N" * 60)
    assert read_text(drive, 621) == b"N" * 60
    with pytest.raises(DriveError):
        drive.set_text(621, "N" * 61)


# ---- control word, status word, motor ----------------------------------------------------------


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


def test_time_steps_may_have_any_length():
    for part in (7, 999, 1000, 1001, 333_333):
        drive = VltDrive()
        control(drive, START, FULL_SPEED)
        for _ in range(SECOND // part):
            drive.step(part)
        drive.step(SECOND % part)
        assert drive.frequency_mhz == 5000, part


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


def test_the_dc_brake_holds_current_for_its_time():
    drive = brought_to(50)
    ask(drive, fc.AK_WRITE_WORD, 114, 80)
    ask(drive, fc.AK_WRITE_WORD, 115, 15)
    assert control(drive, DC_BRAKE, FULL_SPEED) == (0x0607, 0)
    drive.step(1_499_000)
    assert (drive.get(514), drive.running) == (480, True)
    drive.step(1000)
    assert (drive.get(514), drive.running) == (0, False)


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


def test_a_negative_reference_turns_the_motor_backwards_through_standstill():
    drive = brought_to(25)
    control(drive, START, 0xE000)
    drive.step(5 * SECOND)
    assert hertz(drive) == 0, "down on ramp-down time first"
    drive.step(5 * SECOND)
    assert (hertz(drive), control(drive, 0)) == (-25, (0x0F03, 0xE000))


MOTIONS = (
    # Bit 15 reverses only if 506 allows the bus: its default 0 and 2 need the digital input, not wired.
    *(({506: selector}, START | REVERSE, 0x2000, hz) for selector, hz in enumerate((25, -25, 25, -25))),
    # 505 reserves the start for the digital input.
    ({505: 0}, START, FULL_SPEED, 0),
    # The references of bus and preset are added, to 100 % at most.
    *(({202: 1000, 211: preset}, START, 0x2000, 50) for preset in (5000, 6000)),
)


def test_parameters_decide_what_a_control_word_does():
    for settings, word, reference, hz in MOTIONS:
        drive = VltDrive()
        for pnu, value in settings.items():
            assert ask(drive, fc.AK_WRITE_WORD, pnu, value).fault is None
        control(drive, word, reference)
        drive.step(20 * SECOND)
        assert hertz(drive) == hz, settings


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


def test_the_current_limit_shows_in_the_status_word():
    drive = brought_to(50)
    ask(drive, fc.AK_WRITE_WORD, 215, 59)  # 5.9 A, the motor takes 6.00 A
    assert control(drive, 0)[0] == 0x4F03


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


# ---- random telegrams --------------------------------------------------------------------------


def test_random_bytes_do_not_upset_the_drive():
    """Random bytes, random data in a good frame, one damaged byte: silence or a well-formed reply."""
    rng = seeded("bytes")
    drive = VltDrive()
    for _ in range(8000):
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
