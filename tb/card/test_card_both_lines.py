# SPDX-License-Identifier: Apache-2.0
"""Characters of both lines at the same time: no byte of a telegram or of its reply is lost (FC-1, MAP-3).

Both lines share one memory, which takes one byte a clock. While a telegram and its reply are on the drive
line, another master's characters are on the network line. The rates divide, so that the characters of one
line keep their places against those of the other, to a tick of the network line. At 9600 bit/s the test tries
every place, at 115200 bit/s a part of them: there it also meets the clock before the drive line's tick.
"""

from __future__ import annotations

import pytest

from regs.generated.card_tables import DRIVE_BAUD, TICKS_PER_BIT
from tb.agents import rtu
from tb.agents.uart import Flaws, waveform
from tb.lib.card import MS
from tb.lib.fast_card import REPLY_DELAY_BITS, FastCard
from tb.lib.nightly import first
from tb.lib.supervision import control_pdu
from tb.model.fc_telegram import build_process

CHARACTER_BITS = 11
TELEGRAM_CHARACTERS = 8
# Each foreign character comes 1/16 bit later than the one before, so a telegram meets several places.
MET = 4
PLACES = CHARACTER_BITS * TICKS_PER_BIT
# The card keeps 32 bytes of a frame (FRAME-5). After 30 the master pauses for longer than t3.5.
FRAME_CHARACTERS, PAUSE_BITS = 30, 300
EXCHANGE_MS = 30
STATE = rtu.build(1, rtu.read_coils(32, 32))


def little_endian(*words: int) -> bytes:
    return b"".join(word.to_bytes(2, "little") for word in words)


def disturb(card: FastCard, start_ps: float) -> None:
    """Plans characters of another master on the network line, for the time of a telegram."""
    fmt = card.modbus.fmt
    numbers = range(TELEGRAM_CHARACTERS * fmt.baud // DRIVE_BAUD)
    gaps = dict.fromkeys(numbers, 1 / TICKS_PER_BIT)
    gaps |= dict.fromkeys(numbers[FRAME_CHARACTERS::FRAME_CHARACTERS], PAUSE_BITS)
    edges, _ = waveform(fmt, [0x55 + number for number in numbers], Flaws(gaps=gaps))
    for at, level in edges:
        card.plan(start_ps + at, "modbus_line", level)


@pytest.mark.rule("FC-1", "MAP-3")
@pytest.mark.parametrize("baud", first([9600, 115_200]))
def test_no_byte_is_lost_when_both_lines_have_characters(baud):
    place_ps = 1e12 / baud / TICKS_PER_BIT
    place, status, frequency = 0, 0, 0

    def drive(telegram: bytes) -> bytes:
        begin = card.now_ps + REPLY_DELAY_BITS * card.drive.fmt.bit_ps
        disturb(card, begin + place * place_ps)
        return build_process(status, frequency)

    with FastCard(baud=baud, drive=drive) as card:
        card.run(card.boot_ms)
        for place in range(0, PLACES, MET):
            # Each byte of the reply differs from that of the reply before, which a lost byte would leave.
            status, frequency = 0x0606 + 0x0101 * place, 0x1010 + 0x0101 * place
            control, reference = 0x0403 + place % 64, 0x2010 + 0x0101 * (place % 64)
            card.modbus.send(rtu.build(1, control_pdu(control, reference)), 1.1 * rtu.t35_ps(baud))
            assert card.run_until(card.now_ps + 2 * EXCHANGE_MS * MS, "drive_de")
            disturb(card, card.now_ps + place * place_ps)
            card.run(2 * EXCHANGE_MS)
            assert card.drive.frames()[-1].data == build_process(control, reference), f"place {place}"
            shown = card.request(STATE)
            assert shown, f"no reply, place {place}"
            state = rtu.build(1, b"\x01\x04" + little_endian(status, frequency))
            assert shown.data == state, f"place {place}"
