# SPDX-License-Identifier: Apache-2.0
"""What the image shows is what the drive was told (SAFE-8), at the pins, for impatient masters.

Each sequence once ended with an image that the drive had not been told, in two of them with a motor that ran
on while coils 1-16 read as stopped. campaigns/fuzz/impatient.py makes such sequences at random.
"""

from __future__ import annotations

import pytest

from tb.agents import rtu
from tb.agents.crc16 import with_crc
from tb.lib.card import MS
from tb.lib.config import own_hz
from tb.lib.fast_card import FastCard
from tb.model.lines import image_of
from tb.model.told import not_told
from tb.model.vlt_drive import VltDrive

START, STOP = "01 0F 0000 0020 04 7C04 9919", "01 0F 0000 0020 04 3C04 0000"
READ, WRITE_104 = "01 03 1413 0002", "01 06 040F 003C"
READ_IMAGE = rtu.build(1, rtu.read_coils(0, 32))
DRIVE_MS = 80  # until the drive answers
REST_MS = 500  # for all exchanges that wait
# Each request, and how many ms after its end the next one follows.
SEQUENCES = {
    "a stop behind a reading": [(START, 45), (READ, 45), (STOP, 45), (WRITE_104, 0)],
    "a new reference": [
        ("01 10 040F 0002 04 00000007", 36),
        ("01 0F 0000 0020 04 1704 5F0D", 22),
        ("01 06 040F 0042", 39),
        (READ, 33),
    ],
    "a single coil": [
        ("01 0F 0000 0020 04 6B17 0000", 100),
        (READ, 17),
        ("00 06 040F 0007", 16),
        ("01 06 040F 00FB", 25),
        ("01 05 0006 0000", 16),
        ("01 10 040F 0002 04 00000007", 24),
        ("01 10 040F 0002 04 00000007", 39),
    ],
}


@pytest.mark.rule("SAFE-8", "FRAME-7")
@pytest.mark.parametrize("name", SEQUENCES)
def test_the_drive_was_told_what_the_image_shows(config: str, name: str):
    # The small card's firmware needs half its own clock to be ready for the next request at this rate.
    clock = own_hz(config) // 2 if config == "tiny" else None
    with FastCard(baud=19_200, config=config, drive=VltDrive().telegram, clk_hz=clock) as card:
        card.reply_bits = DRIVE_MS * MS / card.drive.fmt.bit_ps
        card.run(card.boot_ms)
        wait_ms = 3.0
        for request, after_ms in SEQUENCES[name]:
            card.modbus.send(with_crc(bytes.fromhex(request)), wait_ms * MS)
            wait_ms = after_ms
        card.run(sum(after for _, after in SEQUENCES[name]) + REST_MS)
        sent = [(frame.data, True) for frame in card.drive.frames()]  # the drive answers each in time
        reply = card.request(READ_IMAGE)
        assert reply, "no answer to the reading of coils 1-32"
        assert not_told(sent, image_of(reply.data)) == ""
