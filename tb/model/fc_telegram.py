# SPDX-License-Identifier: Apache-2.0
"""FC telegrams in pure Python: build, parse, describe (FC-1 to FC-4, FC-7).

Written from the protocol's description, independent of the C drive, so that each checks the other. A telegram
is `STX LGE ADR data BCC`; LGE counts ADR, data and BCC; BCC is the XOR of all bytes before it; words are sent
high byte first. Three kinds by their data: process (PCD1 PCD2), parameter (PKE IND PWE PCD1 PCD2) and
text (PKE IND characters PCD1 PCD2). PCD1/PCD2 are control word and reference in a request, status word
and output frequency in a reply. No cocotb inside.
"""

from __future__ import annotations

from dataclasses import dataclass

STX = 0x02
ADR = 0x81
ADR_BROADCAST = 0x80
FULL_SCALE = 0x4000
TEXT_MAX = 20

AK_NONE = 0
AK_READ = 1
AK_WRITE_WORD = 2
AK_WRITE_DOUBLE = 3
AK_EEPROM_DOUBLE = 13
AK_EEPROM_WORD = 14
AK_TEXT = 15
REPLY_WORD = 1
REPLY_DOUBLE = 2
REPLY_REFUSED = 7
IND_TEXT_READ = 0x0400
IND_TEXT_WRITE = 0x0500

FAULTS = {
    0: "no such parameter",
    1: "no write access",
    2: "value outside its limits",
    3: "no such index",
    4: "not an array",
    5: "wrong data type",
    17: "not possible in this mode",
    130: "no bus access",
    131: "factory setup is active",
}


class TelegramError(ValueError):
    """Not a telegram; the text says which check failed."""


@dataclass(frozen=True)
class Telegram:
    """The fields of a good telegram. Fields that its kind does not have are None."""

    adr: int
    pcd1: int
    pcd2: int
    ak: int | None = None
    pnu: int | None = None
    ind: int | None = None
    pwe: int | None = None
    text: bytes | None = None

    @property
    def kind(self) -> str:
        """'process', 'parameter' or 'text'."""
        if self.ak is None:
            return "process"
        return "parameter" if self.text is None else "text"

    @property
    def fault(self) -> int | None:
        """Fault number of a reply with AK 7; None for any other. Only for replies."""
        return self.pwe & 0xFFFF if self.kind == "parameter" and self.ak == REPLY_REFUSED else None

    @property
    def broadcast(self) -> bool:
        return is_broadcast(self.adr)


def bcc(data: bytes) -> int:
    """Block check character: XOR of all bytes, start value 0."""
    value = 0
    for byte in data:
        value ^= byte
    return value


def words(*values: int) -> bytes:
    """16-bit words, high byte first; negative ones as two's complement."""
    return b"".join((value & 0xFFFF).to_bytes(2, "big") for value in values)


def is_broadcast(adr: int) -> bool:
    """Broadcast in either address format: bit 5 alone (1-31), address 0 (1-126)."""
    return adr == ADR_BROADCAST or 0x20 <= adr <= 0x3F


def build(data: bytes, adr: int = ADR) -> bytes:
    """A whole telegram around `data`."""
    body = bytes([STX, len(data) + 2, adr]) + data
    return body + bytes([bcc(body)])


def without_bcc(contents: bytes) -> bytes:
    """ADR and data from ADR, data and BCC, as the firmware passes them; TelegramError if the BCC is wrong."""
    if bcc(bytes([STX, len(contents)]) + contents) != 0:
        raise TelegramError(f"wrong BCC after {contents[:-1].hex(' ')}: {contents[-1:].hex()}")
    return contents[:-1]


def pke(ak: int, pnu: int) -> int:
    return ak << 12 | pnu


def build_process(pcd1: int, pcd2: int, adr: int = ADR) -> bytes:
    """Control word and reference, or status word and output frequency."""
    return build(words(pcd1, pcd2), adr)


def build_parameter(
    ak: int, pnu: int, ind: int = 0, pwe: int = 0, pcd1: int = 0, pcd2: int = 0, adr: int = ADR
) -> bytes:
    """Parameter telegram; `pwe` is the whole double word, negative as two's complement."""
    return build(words(pke(ak, pnu), ind, pwe >> 16, pwe, pcd1, pcd2), adr)


def build_text(
    pnu: int, text: bytes, ind: int = IND_TEXT_WRITE, pcd1: int = 0, pcd2: int = 0, adr: int = ADR
) -> bytes:
    """Text telegram with characters: a write request or a reply. build_text_read makes a read request."""
    return build(words(pke(AK_TEXT, pnu), ind) + text + words(pcd1, pcd2), adr)


def build_text_read(pnu: int, index: int = 0, adr: int = ADR) -> bytes:
    """Text read request: a parameter telegram with PWE 0 (FC-7)."""
    return build_parameter(AK_TEXT, pnu, IND_TEXT_READ | index, adr=adr)


def parse(telegram: bytes, reply: bool = False) -> Telegram:
    """Parses a telegram; `reply` means that the drive sent it. TelegramError if it is no telegram.

    With AK 15 only the direction distinguishes text from number: a read request is a parameter telegram; a
    """
    if len(telegram) < 8:
        raise TelegramError(f"{len(telegram)} bytes, the shortest telegram has 8")
    if telegram[0] != STX:
        raise TelegramError(f"starts with {telegram[0]:02X}, not 02")
    if telegram[1] != len(telegram) - 2:
        raise TelegramError(f"LGE {telegram[1]:02X} for {len(telegram)} bytes")
    if bcc(telegram) != 0:
        raise TelegramError(f"BCC {telegram[-1]:02X} instead of {bcc(telegram[:-1]):02X}")
    adr, data = telegram[2], telegram[3:-1]
    pcd1, pcd2 = (int.from_bytes(data[at : at + 2], "big") for at in (len(data) - 4, len(data) - 2))
    if len(data) == 4:
        return Telegram(adr, pcd1, pcd2)
    if len(data) < 8:
        raise TelegramError(f"LGE {telegram[1]:02X} fits no kind of telegram")
    ak, pnu = data[0] >> 4, int.from_bytes(data[:2], "big") & 0x0FFF
    ind = int.from_bytes(data[2:4], "big")
    if ak == AK_TEXT and (reply or ind >> 8 == IND_TEXT_WRITE >> 8):
        return Telegram(adr, pcd1, pcd2, ak, pnu, ind, text=data[4:-4])
    if len(data) != 12:
        raise TelegramError(f"LGE {telegram[1]:02X} with AK {ak}")
    return Telegram(adr, pcd1, pcd2, ak, pnu, ind, pwe=int.from_bytes(data[4:8], "big"))


def describe_control(word: int, reference: int) -> str:
    """Control word in words, by the precedence of the stops (coast, quick, DC brake, ramp)."""
    if not word & 0x0400:
        return "no process command"
    if not word & 0x0008:
        what = "coast stop"
    elif not word & 0x0010:
        what = "quick stop"
    elif not word & 0x0004:
        what = "DC brake"
    elif word & 0x0100:
        what = "jog"
    elif not word & 0x0040:
        what = "ramp stop"
    elif not word & 0x0020:
        what = "freeze"
    else:
        what = "start"
    extras = [
        name
        for bit, name in ((0x0080, "reset"), (0x0800, "relay 1"), (0x1000, "relay 2"), (0x8000, "reverse"))
        if word & bit
    ]
    return f"{', '.join([what, *extras])}, reference {describe_percent(reference)}"


def describe_status(word: int, frequency: int) -> str:
    """Status word in words, the state of the motor first."""
    what = ["tripped" if word & 0x0008 else "running" if word & 0x0800 else "stopped"]
    if word & 0x0100:
        what.append("on reference")
    if word & 0x0080:
        what.append("warning")
    if not word & 0x0200:
        what.append("not under bus control")
    return f"{', '.join(what)}, output frequency {describe_percent(frequency)}"


def describe_percent(word: int) -> str:
    """A word scaled 4000h = 100 %."""
    signed = word - 0x10000 if word & 0x8000 else word
    return f"{signed * 100 / FULL_SCALE:.1f} %"


def describe_parameter(telegram: Telegram, reply: bool) -> str:
    """The parameter or text part of a telegram in words."""
    index = telegram.ind & 0xFF
    name = f"parameter {telegram.pnu}" + (f" index {index}" if index else "")
    if telegram.kind == "text":
        quoted = '"' + telegram.text.decode("ascii", "backslashreplace") + '"'
        return f"{name} is {quoted}" if reply else f"write text {name} = {quoted}"
    if reply:
        if telegram.fault is not None:
            return f"{name} refused: {telegram.fault} ({FAULTS.get(telegram.fault, 'unknown fault')})"
        if telegram.ak == AK_NONE:
            return "no parameter"
        if telegram.ak in (REPLY_WORD, REPLY_DOUBLE):
            return f"{name} is {telegram.pwe}"
        return f"{name}, unknown reply AK {telegram.ak}"
    if telegram.ak == AK_NONE:
        return "no parameter"
    if telegram.ak == AK_READ:
        return f"read {name}"
    if telegram.ak == AK_TEXT:
        return f"read text {name}"
    low = telegram.pwe & 0xFFFF
    return {
        AK_WRITE_WORD: f"write {name} = {low} (RAM)",
        AK_WRITE_DOUBLE: f"write {name} = {telegram.pwe} (RAM, double word)",
        AK_EEPROM_WORD: f"write {name} = {low} (EEPROM)",
        AK_EEPROM_DOUBLE: f"write {name} = {telegram.pwe} (EEPROM, double word)",
    }.get(telegram.ak, f"{name}, unknown AK {telegram.ak}")


def describe(telegram: bytes, reply: bool = False) -> str:
    """A telegram in one line of words; for a bad one, the error."""
    try:
        parts = parse(telegram, reply)
    except TelegramError as error:
        return f"bad telegram: {error}"
    process = describe_status(parts.pcd1, parts.pcd2) if reply else describe_control(parts.pcd1, parts.pcd2)
    texts = ["broadcast"] if parts.broadcast else []
    if parts.kind != "process":
        texts.append(describe_parameter(parts, reply))
    if reply or parts.kind == "process" or parts.pcd1 & 0x0400:
        texts.append(process)
    return "; ".join(texts)
