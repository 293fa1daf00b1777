# SPDX-License-Identifier: Apache-2.0
"""Sessions from public reports and documents of drives, byte for byte, at the pins of the whole card.

Other cards get some of these wrong. Each session begins right after power-up. A row is a request and its
reply, both from the unit address on and without CRC; no reply is silence. Or the drive trips.
"""

from __future__ import annotations

import pytest

from regs.dialects import STANDARD, STANDARD_DRIVE
from tb.agents import rtu
from tb.agents.crc16 import with_crc
from tb.lib.card import MS
from tb.lib.config import OVERDUE_MS
from tb.lib.fast_card import FastCard
from tb.model.vlt_drive import VltDrive

SILENCE = ""
SILENT_MS = 60
TRIP = "the drive trips"

HVAC = (STANDARD, STANDARD_DRIVE)
# Name: rule, image, drive, rows.
SESSIONS: dict[str, tuple[str, str, str, list[tuple[str, str]]]] = {
    # MG.18.C2.02 p75, and a thread on an FC 360: in Auto coil 42 is 1. The simulated drive is in Auto, 0607h.
    "HVAC Basic: coil 42 is the first request": (
        *("MAP-1", *HVAC),
        [("01 01 00 29 00 01", "01 01 01 01")],
    ),
    "HVAC Basic: the status word is the first request": (
        *("MAP-1", *HVAC),
        [("01 01 00 20 00 10", "01 01 02 07 06")],
    ),
    "card with STATUS_REFRESH: the status word is the first request": (
        *("MAP-1", "refresh", "vlt6000"),
        [("01 01 00 20 00 10", "01 01 02 07 06")],
    ),
    "card: a read of coils asks no drive": (
        *("MAP-1", "", "vlt6000"),
        [("01 01 00 29 00 01", "01 01 01 00"), (TRIP, ""), ("01 01 00 20 00 10", "01 01 02 00 00")],
    ),
    # Coil 36 is the trip, coil 35 the coasting.
    "builtin: a master that only reads coils sees a trip": (
        *("MAP-1", "builtin", "vlt2800"),
        [("01 01 00 23 00 01", "01 01 01 00"), (TRIP, ""), ("01 01 00 23 00 01", "01 01 01 01")],
    ),
    "HVAC Basic: a master that only reads coils sees a trip": (
        *("MAP-1", *HVAC),
        [("01 01 00 23 00 01", "01 01 01 00"), (TRIP, ""), ("01 01 00 23 00 01", "01 01 01 01")],
    ),
    # A gateway that hears its own exceptions, or another slave's, sends them as requests.
    "card: an exception is no request": (
        *("EXC", "", "vlt6000"),
        [("01 83 02", SILENCE), ("01 FF 00 00 00 01", SILENCE), ("01 03 00 02 00 01", "01 03 02 00 0F")],
    ),
    "HVAC Basic: an exception is no request": (
        *("EXC", *HVAC),
        [("01 83 02", SILENCE), ("01 AB 01", SILENCE), ("01 01 00 00 00 08", "01 01 01 00")],
    ),
    "card: 2B is unknown": (
        *("EXC", "", "vlt6000"),
        [("01 2B 0E 01 00", "01 AB 43"), ("01 2B 0D 01 00", "01 AB 43")],
    ),
    # An S7-1200 reads three registers of a number; documents list 1 to 10 registers below the standard types.
    "HVAC Basic: three and ten registers of a number": (
        *("DIALECT", *HVAC),
        [
            ("01 03 0B D5 00 03", "01 03 06 00 00 C3 50 00 00"),
            ("01 03 0B D5 00 0A", "01 03 14 00 00 C3 50" + " 00" * 16),
        ],
    ),
    "builtin: three registers of a number": (
        *("DIALECT", "builtin", "vlt8000"),
        [("01 03 04 0F 00 03", "01 03 06 00 00 00 32 00 00")],
    ),
    # MG.10.S1.22, example 6: the index stands in 40009.
    "builtin: element 8 of 609": (
        *("DIALECT", "builtin", "vlt6000"),
        [("01 06 00 08 00 08", "01 06 00 08 00 08"), ("01 03 17 C9 00 01", "01 03 02 01 90")],
    ),
    # Masters that count the bytes of coils wrongly, or pad them with ones.
    "card: nine coils in one byte": (*("EXC", "", "vlt6000"), [("01 0F 00 00 00 09 01 7C", "01 8F 42")]),
    "card: coils without a byte count": (
        *("EXC", "", "vlt6000"),
        [("01 0F 00 00 00 20 7C 04 99 19", "01 8F 41")],
    ),
    "card: padding that is not zero": (
        *("MAP-3", "", "vlt6000"),
        [("01 0F 00 00 00 0C 02 7C F4", "01 0F 00 00 00 0C"), ("01 01 00 00 00 10", "01 01 02 7C 04")],
    ),
    # A CNC and a VLT 2800: status word, start with a reference, one register above the table.
    "builtin: the session of a CNC": (
        *("DIALECT", "builtin", "vlt2800"),
        [
            ("01 01 00 20 00 10", "01 01 02 07 06"),
            ("01 0F 00 00 00 20 04 7C 04 A0 0F", "01 0F 00 00 00 20"),
            ("01 03 14 3B 00 01", "01 03 02 00 00"),
        ],
    ),
    "card: control word and reference apart": (
        *("MAP-3", "", "vlt6000"),
        [
            ("01 0F 00 10 00 10 02 00 20", "01 0F 00 10 00 10"),
            ("01 0F 00 00 00 10 02 7C 04", "01 0F 00 00 00 10"),
            ("01 01 00 00 00 20", "01 01 04 7C 04 00 20"),
        ],
    ),
}
rows_of = [
    pytest.param(*session[1:], id=name, marks=pytest.mark.rule(session[0]))
    for name, session in SESSIONS.items()
]


@pytest.mark.parametrize(("image", "profile", "rows"), rows_of)
def test_session(image: str, profile: str, rows: list[tuple[str, str]]):
    drive = VltDrive(profile)
    with FastCard(dialect=image, drive=drive.telegram) as card:
        card.run(card.boot_ms)
        for request, reply in rows:
            if request == TRIP:
                drive.trip(4)
                continue
            heard = card.request(with_crc(bytes.fromhex(request)), 200 if reply else SILENT_MS)
            expected = with_crc(bytes.fromhex(reply)) if reply else None
            assert (heard and heard.data) == expected, f"{request}: {heard}"


@pytest.mark.rule("LINE-9", "FRAME-8")
@pytest.mark.parametrize(("image", "delay_ms"), [("", 0), ("delay5", 5), ("delay20", 20)])
def test_the_images_with_a_reply_delay_wait(image: str, delay_ms: int):
    """Of a local request and of one that asks the drive, whose exchange takes longer than either delay."""
    with FastCard(dialect=image, drive=VltDrive().telegram) as card:
        card.run(card.boot_ms)
        end = card.modbus.send(rtu.build(1, rtu.read_registers(2, 1)))
        local = card.next_frame(card.modbus, end + 100 * MS)
        assert local is not None
        late_ms = (local.start_ps - end - rtu.t35_ps(9600)) / MS - delay_ms
        assert -0.03 <= late_ms <= (OVERDUE_MS if delay_ms else 0.2), f"{late_ms:.2f} ms late"
        asked = card.request(rtu.build(1, rtu.read_registers(5139, 2)))
        assert asked is not None and asked.data[:3] == b"\x01\x03\x04"
