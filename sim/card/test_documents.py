# SPDX-License-Identifier: Apache-2.0
"""Each document with a drive that it was written for: pymodbus sends requests to the virtual card.

S0  option card manual, VLT 6000               `make demo` (test_virtual_card.py)
S1  the same manual as issued for the VLT 5000  dialect card         drive vlt5000
S2  Modbus built into VLT 2800, 6000, 8000      dialect builtin      drive vlt8000
S3  design guide of the VLT HVAC Basic Drive    its dialect and drive

The drive keeps the state of its document's examples (--drive example). Requests and replies are written as
the documents print them, without CRC; telegrams without framing (tb/model/fc_telegram.py). Errors and gaps
of the documents are resolved by docs/guide/dialects.md. test_firmware_dialects.py tries each rule there, and
test_drive_profiles.py each drive; here both meet on the card.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from regs.dialects import STANDARD, STANDARD_DRIVE
from sim.card.masters import Pymodbus
from sim.card.run_card import Frame, RunningCard
from tb.agents.crc16 import with_crc
from tb.model import fc_telegram as fc
from tb.model.examples import EXAMPLES


@dataclass(frozen=True)
class Step:
    """One request, its reply and its telegrams."""

    what: str
    request: str
    reply: str
    telegrams: tuple[bytes, ...] = ()


def steps_of(*names: str) -> list[Step]:
    """Examples of tb/model/examples.json."""
    steps = []
    for example in map(EXAMPLES.get, names):
        request, reply = (bytes.fromhex(example[key])[:-2].hex(" ") for key in ("request", "reply"))
        telegrams = tuple(bytes.fromhex(d["telegram"]) for d in example["drive"])
        steps.append(Step(example["what"], request, reply, telegrams))
    return steps


def talk(folder: Path, dialect: str, profile: str, steps: list[Step]) -> list[Frame]:
    """Sends every request and compares requests, replies and telegrams byte for byte; returns the log."""
    options = ("--dialect", dialect, "--profile", profile, "--drive", "example", "--speed", "max")
    with RunningCard(folder, *options) as card:
        with Pymodbus(card.link) as master:
            for step in steps:
                request = with_crc(bytes.fromhex(step.request))
                got = master.ask(request).received
                assert master.sent == request, step.what
                assert got == with_crc(bytes.fromhex(step.reply)), step.what
        assert card.stop() == 0
        frames = card.frames()
    seen = [f.data for f in frames if (f.line, f.sender) == ("drive", "card")]
    assert seen == [telegram for step in steps for telegram in step.telegrams]
    return frames


# Of a read that touches coils 33-64, in the dialects of the drives that have Modbus built in (MAP-1).
REFRESH = (fc.build_process(0, 0),)


def read(pnu: int, index: int = 0) -> bytes:
    return fc.build_parameter(fc.AK_READ, pnu, index)


@pytest.mark.rule("DIALECT", "EXC", "MAP-7")
def test_option_card_on_a_vlt_5000(tmp_path):
    """Examples 4 and 5, the two in this issue of the manual; the log has this drive's names."""
    frames = talk(tmp_path, "card", "vlt5000", steps_of("ex4-write-104", "ex5-read-514"))
    assert frames[-1].what == "unit 1: parameter 514 (Motor current (option card's manual)) = 300 (3.00 A)"


NUMBER = fc.build_parameter(fc.AK_WRITE_DOUBLE, 533, pwe=0x41424344)
TEXT = fc.build_text(533, b"ABCD")


@pytest.mark.rule("DIALECT", "MAP-1")
def test_built_in_modbus_of_a_vlt_8000(tmp_path):
    """Status word, 514, a log element by register 40009, a text without a switch, the drive's own codes."""
    steps = [
        Step("status word", "01 01 00 20 00 10", "01 01 02 03 0F", REFRESH),
        *steps_of("ex5-read-514"),
        Step("index 8", "01 06 00 08 00 08", "01 06 00 08 00 08"),
        Step("609, element 8: 40.0 %", "01 03 17 C9 00 01", "01 03 02 01 90", (read(609, 8),)),
        Step("index 0", "01 06 00 08 00 00", "01 06 00 08 00 00"),
        Step("no number, so a text", "01 10 14 D1 00 02 04 41 42 43 44", "01 10 14 D1 00 02", (NUMBER, TEXT)),
        Step("533, 1 register", "01 03 14 D1 00 01", "01 03 02 41 42", (read(533), fc.build_text_read(533))),
        Step("40001 is not there", "01 06 00 00 05 00", "01 86 40"),
        Step("7: 640 is fixed", "01 06 18 FF 00 01", "01 86 07", (fc.build_parameter(2, 640, pwe=1),)),
    ]
    talk(tmp_path, "builtin", "vlt8000", steps)


@pytest.mark.rule("DIALECT", "EXC", "MAP-1")
def test_design_guide_of_the_basic_drive(tmp_path):
    """Status word, coil 65, a number above 2047, a text, exceptions of the standard."""
    steps = [
        Step("16-03, status word", "01 03 3E 9D 00 01", "01 03 02 06 07", (read(1603),)),
        *steps_of("fc05-coil65"),
        Step("coils 33-48", "01 01 00 20 00 10", "01 01 02 07 06", REFRESH),
        Step("22-40 = 10 s", "01 03 57 7F 00 01", "01 03 02 00 0A", (read(2240),)),
        Step("15-44", "01 03 3C 4F 00 03", "01 03 06 46 43 2D 31 30 31", (fc.build_text_read(1544),)),
        Step("2: coil 129", "01 01 00 80 00 01", "01 81 02"),
        Step("3: 11 registers", "01 03 3C 4F 00 0B", "01 83 03"),
        Step("4: no parameter 19-99", "01 03 4E 15 00 01", "01 83 04", (read(1999),)),
    ]
    talk(tmp_path, STANDARD, STANDARD_DRIVE, steps)
