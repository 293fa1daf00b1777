# SPDX-License-Identifier: Apache-2.0
"""The worked examples of the owner's handbook, from tb/model/examples.json (tools/handbook.py).

Each frame with its bytes and its meaning, and the call or command by which pymodbus and mbpoll make the
request. tools/test_handbook.py runs both masters.
"""

from __future__ import annotations

from sim.card.masters import as_pymodbus_call, words
from tb.agents.crc16 import crc_good
from tb.model import fc_telegram
from tb.model.card import COUNTED, READS
from tb.model.examples import EXAMPLES
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


class HandbookError(Exception):
    """A source or a page that does not fit; the message is one line."""


def table(head: list[str], rows: list[list[object]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(map(str, row)) + " |" for row in rows)])


def word(value: int) -> str:
    return f"{value:04X}h"


def spaced(data: bytes) -> str:
    return data.hex(" ").upper()


def items(count: int, name: str) -> str:
    return f"{count} {name}{'' if count == 1 else 's'}"


def request_words(adu: bytes) -> str:
    """A request, field by field."""
    function = adu[1]
    begin = f"{'all units' if adu[0] == 0 else f'unit {adu[0]}'}; {function:02X}"
    begin += f" {FUNCTIONS.get(function, 'unknown function')}"
    crc = f"CRC {spaced(adu[-2:])}"
    if function not in FUNCTIONS or len(adu) < 8 or (function not in COUNTED and len(adu) != 8):
        return f"{begin}; {spaced(adu[2:-2]) or 'no data'}; {crc}"
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


def is_plain(adu: bytes) -> bool:
    """A request that every master can make: to one unit, with a length, quantity and function that fit."""
    if adu[0] == 0 or adu[1] not in FUNCTIONS:
        return False
    if adu[1] not in COUNTED:
        return len(adu) == 8
    quantity = words(adu[4:6])[0]
    return adu[6] == len(adu) - 9 == (-(-quantity // 8) if adu[1] in COIL_FUNCTIONS else 2 * quantity)


def pymodbus_call(adu: bytes) -> str:
    """The call of pymodbus that makes this request. Coils as the bits of a number, the first the lowest."""
    method, arguments, options = as_pymodbus_call(adu)
    shown = [str(argument) for argument in arguments]
    if method == "write_coils":
        number = sum(bit << i for i, bit in enumerate(arguments[1]))
        shown[1] = f"[bool({number:#X} >> i & 1) for i in range({len(arguments[1])})]".replace("0X", "0x")
    shown += [f"{name}={value}" for name, value in {**options, "device_id": adu[0]}.items()]
    return f"client.{method}({', '.join(shown)})"


def pymodbus_shows(adu: bytes, reply: bytes) -> str:
    if reply[1] & 0x80:
        return f"exception {reply[2]}"
    if adu[1] == 3:
        return f"registers {words(reply[3:-2])}"
    if adu[1] == 1:
        count = words(adu[4:6])[0]
        return "coils " + "".join(str(reply[3 + i // 8] >> i % 8 & 1) for i in range(count))
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
    if adu[1] == 3:
        return ", ".join(f"[{first + 1 + i}]: {value}" for i, value in enumerate(words(reply[3:-2])))
    if adu[1] == 1:
        bits = [reply[3 + i // 8] >> i % 8 & 1 for i in range(count)]
        return ", ".join(f"[{first + 1 + i}]: {bit}" for i, bit in enumerate(bits))
    return f"Written {count if adu[1] in (15, 16) else 1} references."


def telegram_words(telegram: bytes) -> str:
    """A telegram to the drive; a process telegram with its two words."""
    parts = fc_telegram.parse(telegram)
    meaning = fc_telegram.describe(telegram)
    if parts.kind != "process":
        return meaning
    return f"control word {word(parts.pcd1)}, reference {word(parts.pcd2)}: {meaning}"


def exchange_lines(step: dict) -> list[str]:
    """One request with all frames that follow, as a block of text."""
    rows: list[tuple[str, str]] = []

    def frame(label: str, data: bytes, meaning: str) -> None:
        rows.extend([(label, spaced(data)), ("", meaning)])

    request = bytes.fromhex(step["request"])
    frame("request", request, request_words(request))
    for exchange in step["drive"]:
        telegram = bytes.fromhex(exchange["telegram"])
        frame("telegram", telegram, telegram_words(telegram))
        if exchange["reply"] is None:
            rows.append(("drive", "no reply"))
        else:
            answer = bytes.fromhex(exchange["reply"])
            frame("drive", answer, fc_telegram.describe(answer, reply=True))
    if step["reply"] is None:
        rows.append(("reply", "none"))
    else:
        reply = bytes.fromhex(step["reply"])
        if not crc_good(request) or not crc_good(reply):
            raise HandbookError(f"tb/model/examples.json: wrong CRC in '{step['what']}'")
        frame("reply", reply, reply_words(reply))
        if is_plain(request):
            rows += [("pymodbus", pymodbus_call(request)), ("", f"→ {pymodbus_shows(request, reply)}")]
            rows += [("mbpoll", " ".join(mbpoll_call(request))), ("", f"→ {mbpoll_shows(request, reply)}")]
    return [f"{label:<9} {text}".rstrip() for label, text in rows]


def title(example: dict) -> str:
    what = example["what"]
    return what[0].upper() + what[1:]


def example_list() -> str:
    rows = []
    for example in EXAMPLES.values():
        link = f"[{title(example)}](#{slug(title(example))})"
        rows.append([link, f"{int(example['request'][3:5], 16):02X}", example["source"]])
    return table(["example", "function", "document"], rows)


def worked_examples() -> str:
    parts = []
    for example in EXAMPLES.values():
        lines = [f"### {title(example)}", "", f"`{example['id']}`, {example['source']}."]
        if "after" in example:
            before = title(EXAMPLES[example["after"]])
            lines[-1] += f" After [{before}](#{slug(before)})."
        if "note" in example:
            lines[-1] += f" Note: {example['note']}."
        steps = [*example.get("setup", []), example]
        for number, step in enumerate(steps, 1):
            if len(steps) > 1:
                lines += ["", f"{number}. {title(step)}:"]
            lines += ["", "```", *exchange_lines(step), "```"]
        parts.append("\n".join(lines))
    return "\n\n".join(parts)
