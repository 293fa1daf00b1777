# SPDX-License-Identifier: Apache-2.0
"""Each of the four documents with the drive it was written for: pymodbus sends requests to the virtual card.

S0  option card manual, VLT 6000               dialect card         drive vlt6000
S1  the same manual as issued for the VLT 5000  dialect card         drive vlt5000
S2  Modbus built into VLT 2800, 6000, 8000      dialect builtin      drives vlt2800, vlt8000
S3  design guide of the VLT HVAC Basic Drive    its dialect and drive

The drive keeps the state of its document's examples (--drive example), unless a motor has to run. Requests
and replies are written as the documents print them, without CRC; telegrams without framing
(tb/model/fc_telegram.py). Errors and gaps of the documents are resolved by docs/guide/dialects.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from regs.dialects import STANDARD, STANDARD_DRIVE
from sim.card.masters import Pymodbus
from sim.card.run_card import RunningCard
from tb.agents.crc16 import with_crc
from tb.model import fc_telegram as fc
from tb.model.examples import EXAMPLES

SILENCE_S = 1.0  # wall time after which no reply is expected any more


@dataclass(frozen=True)
class Step:
    """One request, its reply (None: silence) and its telegrams."""

    what: str
    request: str
    reply: str | None
    telegrams: tuple[bytes, ...] = ()
    wrong: bool = False  # pymodbus has no method for such a frame


def steps_of(*names: str, wrong: bool = False) -> list[Step]:
    """Examples of tb/model/examples.json, each after the examples it depends on."""
    steps = []
    for name in names:
        example = EXAMPLES[name]
        for part in [*example.get("setup", []), example]:
            request, reply = (bytes.fromhex(part[key])[:-2].hex(" ") for key in ("request", "reply"))
            telegrams = tuple(bytes.fromhex(d["telegram"]) for d in part["drive"])
            steps.append(Step(part["what"], request, reply, telegrams, wrong))
    return steps


def talk(folder: Path, dialect: str, profile: str, steps: list[Step], drive: str = "example") -> None:
    """Sends every step's request and compares requests, replies and telegrams byte for byte."""
    options = ("--dialect", dialect, "--profile", profile, "--drive", drive, "--speed", "max")
    wait = {"wait": SILENCE_S} if any(step.reply is None for step in steps) else {}
    with RunningCard(folder, *options) as card:
        with Pymodbus(card.link, **wait) as master:
            for step in steps:
                request = bytes.fromhex(step.request)
                got = (
                    master.send(request[0], request[1:])
                    if step.wrong
                    else master.ask(with_crc(request)).received
                )
                assert master.sent == with_crc(request), step.what
                assert got == (with_crc(bytes.fromhex(step.reply)) if step.reply else b""), step.what
        assert card.stop() == 0
        seen = [f.data for f in card.frames() if (f.line, f.sender) == ("drive", "card")]
    assert seen == [telegram for step in steps for telegram in step.telegrams]


# Of a read that touches coils 33-64, in the dialects of the drives that have Modbus built in (MAP-1).
REFRESH = (fc.build_process(0, 0),)


def read(pnu: int, index: int = 0) -> bytes:
    return fc.build_parameter(fc.AK_READ, pnu, index)


# ---------------------------------------------------------------- S0: option card, VLT 6000
@pytest.mark.rule("DIALECT", "EXC", "MAP-1", "MAP-3", "MAP-5", "MAP-7", "MAP-8")
@pytest.mark.parametrize(
    "steps",
    [
        pytest.param(
            steps_of(
                "ex1-start-40",
                "appA-fc01",  # reads back what example 1 wrote
                "ex2-ramp-stop",
                "ex3-coast-stop",
                "ex4-write-104",
                "ex5-read-514",
                "ex6a-ind-0500",
                "ex6b-text-533",
            ),
            id="examples 1 to 6",
        ),
        pytest.param(steps_of("appA-fc05"), id="appendix A: 05", marks=pytest.mark.nightly),
        pytest.param(steps_of("appA-fc0f"), id="appendix A: 0F", marks=pytest.mark.nightly),
        pytest.param(
            steps_of("appA-fc06", "appA-fc10", "appA-fc03", "text-read-621"),
            id="appendix A: 06, 10, 03, and a text, filled with spaces",
        ),
        pytest.param(
            steps_of("bad-function", "bad-address", "bad-length", "bad-data-length", wrong=True),
            id="exception codes 64 to 67",
        ),
    ],
)
def test_option_card_on_a_vlt_6000(tmp_path, steps):
    talk(tmp_path, "card", "vlt6000", steps)


@pytest.mark.rule("DIALECT", "EXC")
def test_option_card_passes_on_what_the_drive_refuses(tmp_path):
    """Exception codes of the drive; code 17 needs a running motor."""
    start = Step(
        "start, no speed",
        "01 0F 00 00 00 20 04 7C 04 00 00",
        "01 0F 00 00 00 20",
        (fc.build_process(0x047C, 0),),
    )
    steps = [
        Step("0: no parameter 32", "01 03 01 3F 00 01", "01 83 00", (read(32),)),
        Step("1: 514 is read-only", "01 06 14 13 00 01", "01 86 01", (fc.build_parameter(2, 514, pwe=1),)),
        Step("2: 104 = 20 Hz", "01 06 04 0F 00 14", "01 86 02", (fc.build_parameter(2, 104, pwe=20),)),
        Step("index 11", "01 06 00 00 00 0B", "01 06 00 00 00 0B"),
        Step("3: 615 has 10 elements", "01 03 18 05 00 01", "01 83 03", (read(615, 11),)),
        Step("4: 104 is no array", "01 03 04 0F 00 01", "01 83 04", (read(104, 11),)),
        Step("index 0", "01 06 00 00 00 00", "01 06 00 00 00 00"),
        Step("5: 533 is a text", "01 03 14 D1 00 01", "01 83 05", (read(533),)),
        Step(
            "130: 501 at the panel only",
            "01 06 13 91 00 02",
            "01 86 82",
            (fc.build_parameter(2, 501, pwe=2),),
        ),
        start,
        *steps_of("refused-17"),
    ]
    talk(tmp_path, "card", "vlt6000", steps, drive="sim")


# ---------------------------------------------------------------- S1: option card, VLT 5000
@pytest.mark.rule("DIALECT", "MAP-7")
def test_option_card_on_a_vlt_5000(tmp_path):
    """Examples 4 and 5, the two in this issue of the manual."""
    talk(tmp_path, "card", "vlt5000", steps_of("ex4-write-104", "ex5-read-514"))


# ---------------------------------------------------------------- S2: built in, VLT 2800 and VLT 8000
@pytest.mark.rule("DIALECT", "MAP-1")
def test_built_in_modbus_of_a_vlt_2800(tmp_path):
    """Appendix: status word by 01, coil 1 by 05, ten coils by 0F, motor current 7.38 A by 10."""
    motor_current = fc.build_parameter(fc.AK_WRITE_DOUBLE, 105, pwe=738)
    *before, status = steps_of("appA-fc01-status")
    steps = [
        *before,
        replace(status, telegrams=REFRESH),
        *steps_of("appA-fc05"),
        Step("ten coils", "01 0F 00 00 00 0A 02 FF 03", "01 0F 00 00 00 0A", (fc.build_process(0x03FF, 0),)),
        Step("105 = 7.38 A", "01 10 04 19 00 02 04 00 00 02 E2", "01 10 04 19 00 02", (motor_current,)),
        Step("105", "01 03 04 19 00 02", "01 03 04 00 00 02 E2", (read(105),)),
        Step("status word", "01 01 00 20 00 10", "01 01 02 07 06", REFRESH),
        Step(
            "621, a text", "01 03 18 41 00 04", "01 03 08 " + b"VLT 2800".hex(" "), (fc.build_text_read(621),)
        ),
    ]
    talk(tmp_path, "builtin", "vlt2800", steps)


@pytest.mark.rule("DIALECT")
def test_built_in_modbus_of_a_vlt_8000(tmp_path):
    """514, a log element by register 40009, texts without a switch, the drive's own codes."""
    text = "31 32 33 34 35 36 37 38 39 30"
    steps = [
        *steps_of("ex5-read-514"),
        Step("index 8", "01 06 00 08 00 08", "01 06 00 08 00 08"),
        Step("609, element 8: 40.0 %", "01 03 17 C9 00 01", "01 03 02 01 90", (read(609, 8),)),
        Step("index 0", "01 06 00 08 00 00", "01 06 00 08 00 00"),
        Step(
            "533 by 5 registers",
            f"01 10 14 D1 00 05 0A {text}",
            "01 10 14 D1 00 05",
            (fc.build_text(533, bytes.fromhex(text)),),
        ),
        Step("533", "01 03 14 D1 00 05", f"01 03 0A {text}", (fc.build_text_read(533),)),
        Step(
            "533 by 2 registers: no number, so a text",
            "01 10 14 D1 00 02 04 41 42 43 44",
            "01 10 14 D1 00 02",
            (fc.build_parameter(fc.AK_WRITE_DOUBLE, 533, pwe=0x41424344), fc.build_text(533, b"ABCD")),
        ),
        Step("533, 1 register", "01 03 14 D1 00 01", "01 03 02 41 42", (read(533), fc.build_text_read(533))),
        Step("40001 is not there", "01 06 00 00 05 00", "01 86 40"),
        Step(
            "6: 602 can only be reset",
            "01 10 17 83 00 02 04 00 00 00 01",
            "01 90 06",
            (fc.build_parameter(fc.AK_WRITE_DOUBLE, 602, pwe=1),),
        ),
        Step("7: 640 is fixed", "01 06 18 FF 00 01", "01 86 07", (fc.build_parameter(2, 640, pwe=1),)),
        Step("11: no right to 4", "01 06 00 27 00 01", "01 86 0B", (fc.build_parameter(2, 4, pwe=1),)),
    ]
    talk(tmp_path, "builtin", "vlt8000", steps)


# ---------------------------------------------------------------- S3: VLT HVAC Basic Drive
TYPE_CODE = b"FC-101P2K2T4E20H4XXC"  # first 20 characters of parameter 15-44


@pytest.mark.rule("DIALECT")
def test_basic_drive_status_word_and_coil_65(tmp_path):
    """Status word 0607; coil 65 decides between RAM and EEPROM."""
    steps = [
        Step("16-03, status word", "01 03 3E 9D 00 01", "01 03 02 06 07", (read(1603),)),
        *steps_of("fc05-coil65"),
        Step("coils 33-48", "01 01 00 20 00 10", "01 01 02 07 06", REFRESH),
        Step(
            "1-23 = 60 Hz", "01 06 04 CD 00 3C", "01 06 04 CD 00 3C", (fc.build_parameter(14, 123, pwe=60),)
        ),
        Step("coil 65 off", "01 05 00 40 00 00", "01 05 00 40 00 00"),
        Step("1-23 = 50 Hz", "01 06 04 CD 00 32", "01 06 04 CD 00 32", (fc.build_parameter(2, 123, pwe=50),)),
    ]
    talk(tmp_path, STANDARD, STANDARD_DRIVE, steps)


@pytest.mark.rule("DIALECT")
def test_basic_drive_reads_of_1_to_10_registers(tmp_path):
    """One register of a word, two of a double word, up to 10 of a text; a number above 2047."""
    as_text = fc.build_text_read(1544)
    steps = [
        Step("16-30 = 565 V", "01 03 3F AB 00 01", "01 03 02 02 35", (read(1630),)),
        Step("15-00 = 1234", "01 03 3A 97 00 02", "01 03 04 00 00 04 D2", (read(1500),)),
        Step("22-40 = 10 s", "01 03 57 7F 00 01", "01 03 02 00 0A", (read(2240),)),
        *(
            Step(
                f"15-44, {n} registers",
                f"01 03 3C 4F 00 {n:02X}",
                f"01 03 {2 * n:02X} {TYPE_CODE[: 2 * n].hex(' ')}",
                (read(1544), as_text) if n <= 2 else (as_text,),
            )
            for n in (1, 2, 3, 10)
        ),
        Step(
            "15-40, filled with spaces",
            "01 03 3C 27 00 0A",
            f"01 03 14 {b'FC-101'.ljust(20).hex(' ')}",
            (fc.build_text_read(1540),),
        ),
    ]
    talk(tmp_path, STANDARD, STANDARD_DRIVE, steps)


@pytest.mark.rule("DIALECT")
def test_basic_drive_exceptions_of_the_standard(tmp_path):
    steps = [
        Step("1: function 07", "01 07", "01 87 01", wrong=True),
        Step("2: coil 129", "01 01 00 80 00 01", "01 81 02"),
        Step("3: 11 registers", "01 03 3C 4F 00 0B", "01 83 03"),
        Step("4: no parameter 19-99", "01 03 4E 15 00 01", "01 83 04", (read(1999),)),
        Step("4: 16-30 is read-only", "01 06 3F AB 00 01", "01 86 04", (fc.build_parameter(2, 1630, pwe=1),)),
    ]
    talk(tmp_path, STANDARD, STANDARD_DRIVE, steps)


# ---------------------------------------------------------------- no drive
@pytest.mark.parametrize(
    ("dialect", "reply"),
    [
        pytest.param("card", "01 83 FF", marks=pytest.mark.rule("DIALECT", "FC-9")),
        pytest.param("builtin", None, marks=[pytest.mark.rule("DIALECT"), pytest.mark.nightly]),
        pytest.param(STANDARD, None, marks=pytest.mark.rule("DIALECT")),
    ],
)
def test_a_drive_that_does_not_answer(tmp_path, dialect, reply):
    """Exception 255 or silence, after one repeat; the card's own coils answer as before."""
    steps = [
        Step("104", "01 03 04 0F 00 01", reply, (read(104), read(104))),
        Step("coil 65", "01 01 00 40 00 01", "01 01 01 00"),
    ]
    talk(tmp_path, dialect, "vlt6000", steps, drive=str(tmp_path / "drive"))
