# SPDX-License-Identifier: Apache-2.0
"""The worked examples of the owner's handbook (tools/handbook.py).

The requests are here. The models of card and drive (tb/model) give telegrams and replies, so a drive does
what it was asked. Each frame stands with its bytes and its meaning, and with the call or command by which
pymodbus and mbpoll make the request. tools/test_handbook.py plays the examples on the card with its firmware,
and reads the calls of pymodbus.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from campaigns.masters.page import table
from sim.card.masters import as_pymodbus_call, words
from tb.agents import rtu
from tb.model import fc_telegram
from tb.model.card import COUNTED, READS, CardModel
from tb.model.vlt_drive import VltDrive
from tools.prose import slug

FUNCTIONS = {
    0x01: "read coils",
    0x03: "read holding registers",
    0x05: "write one coil",
    0x06: "write one register",
    0x0F: "write several coils",
    0x10: "write several registers",
}
COIL_FUNCTIONS = (0x01, 0x05, 0x0F)
MBPOLL = "mbpoll -m rtu -a {unit} -b 9600 -P none -s 2"
PORT = "/dev/ttyUSB0"
UNIT = 1
STATE_COIL = 32  # of coil 33, on the wire
MINUS = "\N{MINUS SIGN}"


class HandbookError(Exception):
    """A source or a page that does not fit; the message is one line."""


@dataclass(frozen=True)
class Step:
    """A request (PDU), `wait` seconds after the step before it; `silent`: the drive does not answer."""

    what: str
    pdu: bytes
    wait: float = 0
    silent: bool = False
    to_all: bool = False


@dataclass(frozen=True)
class Example:
    title: str
    source: str
    steps: tuple[Step, ...]
    note: str = ""
    before: Callable[[VltDrive], None] = lambda drive: None
    after: str = ""


def command(word: int, reference: int | None = None) -> bytes:
    """0F to coils 1-16, or 1-32 with a reference."""
    data = word.to_bytes(2, "little") + (b"" if reference is None else reference.to_bytes(2, "little"))
    return bytes([0x0F, 0, 0, 0, 8 * len(data), len(data)]) + data


def registers(first: int, text: str) -> bytes:
    return bytes([0x10]) + first.to_bytes(2) + bytes([0, len(text) // 2, len(text)]) + text.encode()


START = Step("start at 40 %", command(0x047C, 0x1999))
CURRENT = rtu.read_registers(5139, 2)
LATER = Step("ten seconds later: read the motor current", CURRENT, wait=10)
STATE = Step("read status word and output frequency", rtu.read_coils(STATE_COIL, 32))
INDEX = 0  # register 40001 on the wire
RUNS_ON = "**The motor still runs.** Stop it as in [ramp stop](#ramp-stop)."
BY_COMMAND = "In one command, which says whether the drive obeyed: `rtu2fc {} {}`."


def runs(drive: VltDrive) -> None:
    """The motor runs at 40 %, started ten seconds ago."""
    drive.telegram(fc_telegram.build_process(0x047C, 0x1999))
    drive.step(10_000_000)


EXAMPLES = (
    Example(
        "Start at 40 %",
        "manual p19",
        (START, LATER, STATE),
        "the motor runs at its reference",
        after=f"{RUNS_ON} {BY_COMMAND.format('start', f'{PORT} 40')}",
    ),
    Example(
        "Ramp stop",
        "manual p20",
        (Step("ramp stop", command(0x043C, 0)), LATER, STATE),
        "the motor has stopped, and the drive is ready",
        runs,
        BY_COMMAND.format("stop", PORT),
    ),
    Example(
        "Coast stop",
        "manual p20",
        (Step("coast stop", command(0x2C20, 0)), LATER, STATE),
        "the drive has let go of the motor",
        runs,
        "The drive says *stopped* at once. The shaft may still turn: look at it. "
        "This word of the manual also sets relay 1 and the setup; 0434h coasts without them.",
    ),
    Example(
        "Reset of a trip",
        "MG.61.B5.02 p163",
        (
            Step("stop: bit 6 (start) = 0, bit 7 (reset) = 0", command(0x043C)),
            STATE,
            Step("the cause is gone: set bit 7 (reset) to 1", command(0x04BC)),
            Step("set bit 7 (reset) to 0 again", command(0x043C)),
            STATE,
        ),
        "the drive had tripped; it is ready again, and the motor stands",
        lambda drive: drive.trip(13),
    ),
    Example(
        "Read the motor current, parameter 514",
        "manual p21",
        (Step("read the motor current", CURRENT),),
        f"the motor runs; conversion index {MINUS}2: 347 is 3.47 A",
        runs,
    ),
    Example(
        "Write the motor frequency, parameter 104",
        "manual p21",
        (Step("60 Hz", rtu.write_register(1039, 60)), Step("read it back", rtu.read_registers(1039, 1))),
        "the motor stands; **write only the number on the motor's nameplate**",
    ),
    Example(
        "Write a display text, parameter 533",
        "manual p22",
        (
            Step("IND = 0500h: texts are written", rtu.write_register(INDEX, 0x0500)),
            Step("the text", registers(5329, "1234567890")),
            Step("IND = 0400h: texts are read", rtu.write_register(INDEX, 0x0400)),
            Step("read it back", rtu.read_registers(5329, 5)),
            Step("IND = 0: numbers again", rtu.write_register(INDEX, 0)),
        ),
    ),
    Example(
        "Set both time-outs of the card",
        "manual p18",
        (
            Step("40002 = 500 (5 s), 40003 = 20 (200 ms)", bytes.fromhex("10 00 01 00 02 04 01 F4 00 14")),
            Step("read the card's own registers", rtu.read_registers(0, 3)),
        ),
        "without the drive",
    ),
    Example(
        "Keep parameters over a power-off: coil 65",
        "manual p18",
        (
            Step("set coil 65", rtu.write_coil(64, True)),
            Step("the large line of the display, to RAM and EEPROM", rtu.write_register(69, 2)),
            Step("clear coil 65", rtu.write_coil(64, False)),
        ),
        "a value that is wrong for the motor would be wrong for good",
    ),
    Example(
        "Stop all drives by a broadcast",
        "manual p14",
        (Step("ramp stop to all units", command(0x043C, 0), to_all=True), LATER, STATE),
        "no reply to the broadcast, so each drive is read",
        runs,
        "Read the others in the same way. Send each drive that still runs a stop of its own.",
    ),
    Example(
        "A write that the drive refuses",
        "manual p23",
        (Step("write parameter 104", rtu.write_register(1039, 60)),),
        "some parameters need a stopped motor",
        runs,
        RUNS_ON,
    ),
    Example(
        "A register where no parameter starts",
        "manual p23",
        (Step("read register 5141", rtu.read_registers(5140, 2)),),
    ),
    Example(
        "A drive that does not answer",
        "manual p23",
        (Step("read parameter 514", CURRENT, silent=True),),
        "the telegram is repeated once",
    ),
)


@dataclass(frozen=True)
class Played:
    """What was on the lines at a step: request, telegrams with the drive's replies, reply."""

    step: Step
    request: bytes
    drive: tuple[tuple[bytes, bytes | None], ...]
    reply: bytes | None


def play(example: Example) -> list[Played]:
    """The example on the models, from the power-up of both."""
    card, drive = CardModel(), VltDrive()
    example.before(drive)
    played = []
    for step in example.steps:
        drive.step(round(1e6 * step.wait))
        asked = card.request(step.pdu, broadcast=step.to_all)
        heard: list[tuple[bytes, bytes | None]] = []
        while asked.telegram is not None:
            telegram = fc_telegram.build(asked.telegram[1:], adr=asked.telegram[0])
            answer = None if step.silent else drive.telegram(telegram)
            heard += [(telegram, answer)] * (2 if step.silent else 1)
            if step.to_all:
                break
            asked = card.drive_silent() if answer is None else card.drive_reply(answer[2:-1])
        request = rtu.build(0 if step.to_all else UNIT, step.pdu)
        reply = None if asked.reply is None else rtu.build(UNIT, asked.reply)
        played.append(Played(step, request, tuple(heard), reply))
    return played


def word(value: int) -> str:
    return f"{value:04X}h"


def spaced(data: bytes) -> str:
    return data.hex(" ").upper()


def items(count: int, name: str) -> str:
    return f"{count} {name}{'' if count == 1 else 's'}"


def request_words(adu: bytes) -> str:
    """A request, field by field."""
    function = adu[1]
    begin = f"{'all units' if adu[0] == 0 else f'unit {adu[0]}'}; {function:02X} {FUNCTIONS[function]}"
    crc = f"CRC {spaced(adu[-2:])}"
    thing = "coil" if function in COIL_FUNCTIONS else "register"
    start, operand = words(adu[2:6])
    at = f"{thing} {start + 1} ({spaced(adu[2:4])})"
    if function in READS:
        return f"{begin}; from {at}; {items(operand, thing)}; {crc}"
    if function in COUNTED:
        return f"{begin}; from {at}; {items(operand, thing)}; {adu[6]} bytes: {spaced(adu[7:-2])}; {crc}"
    on_off = {0xFF00: "on", 0: "off"} if thing == "coil" else {}
    return f"{begin}; {at} = {on_off.get(operand, word(operand))}; {crc}"


def reply_words(adu: bytes) -> str:
    crc = f"CRC {spaced(adu[-2:])}"
    if adu[1] & 0x80:
        return (
            f"unit {adu[0]}; function {adu[1] & 0x7F:02X} refused; exception {adu[2]} ({adu[2]:02X}h); {crc}"
        )
    if adu[1] in (1, 3):
        return f"unit {adu[0]}; {adu[1]:02X}; {adu[2]} bytes: {spaced(adu[3:-2])}; {crc}"
    return f"unit {adu[0]}; {adu[1]:02X} done; {spaced(adu[2:-2])}; {crc}"


def pymodbus_call(adu: bytes) -> str:
    """The call of pymodbus that makes this request. Coils as the bits of a number, the first the lowest."""
    method, arguments, options = as_pymodbus_call(adu)
    shown = [str(argument) for argument in arguments]
    if method == "write_coils":
        number = sum(bit << i for i, bit in enumerate(arguments[1]))
        shown[1] = f"[bool({number:#X} >> i & 1) for i in range({len(arguments[1])})]".replace("0X", "0x")
    shown += [f"{name}={value}" for name, value in {**options, "device_id": adu[0]}.items()]
    return f"client.{method}({', '.join(shown)})"


def values(adu: bytes, reply: bytes) -> list[int]:
    """The registers or coils in a reply."""
    if adu[1] == 3:
        return words(reply[3:-2])
    return [reply[3 + i // 8] >> i % 8 & 1 for i in range(words(adu[4:6])[0])]


def pymodbus_shows(adu: bytes, reply: bytes) -> str:
    if reply[1] & 0x80:
        return f"exception {reply[2]}"
    if adu[1] == 3:
        return f"registers {values(adu, reply)}"
    if adu[1] == 1:
        return "coils " + "".join(map(str, values(adu, reply)))
    return "accepted"


def mbpoll_call(adu: bytes) -> list[str]:
    """The command line of mbpoll that makes this request; its references count from 1."""
    method, arguments, options = as_pymodbus_call(adu)
    kind = "0" if "coil" in method else "4"
    line = [*MBPOLL.format(unit=adu[0]).split(), "-t", kind, "-r", str(arguments[0] + 1), "-1"]
    if method.startswith("read"):
        return [*line, "-c", str(options["count"]), PORT]
    written = arguments[1] if isinstance(arguments[1], list) else [arguments[1]]
    return [*line, PORT, *(str(int(value)) for value in written)]


def mbpoll_shows(adu: bytes, reply: bytes) -> str:
    first, count = words(adu[2:6])
    if reply[1] & 0x80:
        return "Invalid exception code"
    if adu[1] in (1, 3):
        return ", ".join(f"[{first + 1 + i}]: {value}" for i, value in enumerate(values(adu, reply)))
    return f"Written {count if adu[1] in (15, 16) else 1} references."


def telegram_words(telegram: bytes) -> str:
    """A telegram to the drive; a process telegram with its two words."""
    parts = fc_telegram.parse(telegram)
    meaning = fc_telegram.describe(telegram)
    if parts.kind != "process":
        return meaning
    return f"control word {word(parts.pcd1)}, reference {word(parts.pcd2)}: {meaning}"


def exchange_lines(one: Played) -> list[str]:
    """One request with all frames that follow, as a block of text."""
    rows = [("request", f"{spaced(one.request)}   {request_words(one.request)}")]
    for telegram, answer in one.drive:
        rows.append(("telegram", f"{spaced(telegram)}   {telegram_words(telegram)}"))
        if answer is not None:
            rows.append(("drive", f"{spaced(answer)}   {fc_telegram.describe(answer, reply=True)}"))
        elif not one.step.to_all:
            rows.append(("drive", "no reply"))
    if one.reply is None:
        rows.append(("reply", "none"))
    else:
        meaning = reply_words(one.reply)
        if one.step.pdu == STATE.pdu:
            status, frequency = (int.from_bytes(one.reply[at : at + 2], "little") for at in (3, 5))
            meaning += f"; {fc_telegram.describe_status(status, frequency)}"
        mbpoll = " ".join(mbpoll_call(one.request))
        rows += [
            ("reply", f"{spaced(one.reply)}   {meaning}"),
            ("pymodbus", f"{pymodbus_call(one.request)} → {pymodbus_shows(one.request, one.reply)}"),
            ("mbpoll", f"{mbpoll} → {mbpoll_shows(one.request, one.reply)}"),
        ]
    return [f"{label:<9} {text}" for label, text in rows]


def example_list() -> str:
    rows = [[f"[{one.title}](#{slug(one.title)})", one.note, one.source] for one in EXAMPLES]
    return table(["example", "note", "document"], rows)


def worked_examples() -> str:
    parts = []
    for example in EXAMPLES:
        steps = [
            "\n".join([f"{number}. {one.step.what[0].upper()}{one.step.what[1:]}:", *exchange_lines(one)])
            for number, one in enumerate(play(example), 1)
        ]
        lines = [f"### {example.title}", "", "```", "\n\n".join(steps), "```"]
        lines += ["", example.after] if example.after else []
        parts.append("\n".join(lines))
    return "\n\n".join(parts)
