# SPDX-License-Identifier: Apache-2.0
"""The images with every option at once, which need 16 KiB, on a card with that memory, at the pins.

The boards with a GW1N-9 have it (constraints/boards.toml). Each option shows itself once in each dialect.
"""

from __future__ import annotations

import pytest

from constraints.boards import board
from regs.dialects import DIALECTS, IMAGES
from tb.agents import rtu
from tb.lib.fast_card import FastCard
from tb.model.fc_telegram import build_process

PARAMETERS = (("MEMORY_BYTES", board("card-gw1n-9").memory_bytes), ("MASTER_LOSS_STOP", 1))
REFERENCE = 0x1999
STATUS, FREQUENCY = 0x0F03, 0x2000
ANSWER = build_process(STATUS, FREQUENCY)
NO_CONTROL, START, STOP = (
    build_process(word, ref) for word, ref in ((0, 0), (0x047C, REFERENCE), (0x043C, REFERENCE))
)
LOSS_TENS = 20


class Drive:
    """Keeps the telegrams, and answers each."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []

    def __call__(self, telegram: bytes) -> bytes:
        self.heard.append(telegram)
        return ANSWER


@pytest.mark.nightly
@pytest.mark.rule("MAP-10", "SAFE-7", "TOP-2")
@pytest.mark.parametrize(
    "dialect",
    DIALECTS,
)
def test_all_options_work_together(dialect):
    drive = Drive()
    with FastCard(drive=drive, dialect=IMAGES["large/all"].folder(dialect), parameters=PARAMETERS) as card:
        card.run(card.boot_ms)

        def ask(pdu: bytes) -> bytes:
            done = card.request(rtu.build(1, pdu))
            assert done, f"no reply to {pdu.hex(' ')}"
            return done.data[1:-2]

        assert ask(rtu.read_registers(2, 1)) == bytes.fromhex("03 02 000F")
        assert ask(rtu.write_register(1, LOSS_TENS))[0] == 0x06
        # DIAGNOSTICS: clear the counts, then read the number of good frames. Random contents at power-up may
        # have counted before: the flags of events are initialised by the bitstream, not by the reset.
        assert ask(bytes.fromhex("08 000A 0000")) == bytes.fromhex("08 000A 0000")
        assert ask(bytes.fromhex("08 000B 0000")) == bytes.fromhex("08 000B 0001")
        assert not drive.heard

        write = bytes.fromhex("0F 0000 0020 04 7C04") + REFERENCE.to_bytes(2, "little")
        assert ask(write) == write[:5] and drive.heard == [START]
        # STATUS_REFRESH: a read of the status asks the drive, without a command.
        status = STATUS.to_bytes(2, "little")
        assert ask(bytes.fromhex("01 0020 0010")) == bytes.fromhex("01 02") + status
        assert drive.heard == [START, NO_CONTROL]
        # MASTER_LOSS_STOP
        card.run(10 * LOSS_TENS - 50)
        assert len(drive.heard) == 2
        card.run(100)
        assert drive.heard[2:] == [STOP]
