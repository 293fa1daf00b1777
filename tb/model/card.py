# SPDX-License-Identifier: Apache-2.0
"""Reference model of the card's function: a request's PDU in, a reply's PDU or an FC telegram out.

Written from the rules, independent of the firmware, so that each can check the other. Lines, times and CRC
are outside of it: a request given to it has been committed, a telegram given to it had a good BCC.
Telegrams here are ADR and data, without STX, LGE and BCC. Registers and coils are numbered on-wire.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Dialect:
    """The differences between the manuals, typed from them: regs/dialects.toml must say the same."""

    codes: dict[str, int]  # exception code for each error; "drive" if not the fault number itself
    index_register: int = 8
    pnu_max: int = 2047
    text_by_size: bool = True
    refreshes: bool = True  # a read of the status asks the drive first
    diagnoses: bool = False

    def code(self, why: str | int) -> int:
        if isinstance(why, str):
            return self.codes[why]
        return self.codes.get("drive", why)


CARD = {"function": 67, "length": 65, "quantity": 66, "address": 64}  # 23-6130-00 p23
DIALECTS = {
    "card": Dialect(CARD | {"value": 2, "silent": 255}, 0, text_by_size=False, refreshes=False),
    "builtin": Dialect(CARD | {"value": 66}),  # MG.10.S2.02 p28, p31
    # MG.18.C2.02 p75
    "hvac_basic": Dialect(
        {"function": 1, "address": 2, "length": 3, "quantity": 3, "value": 3, "drive": 4},
        pnu_max=4095,
        diagnoses=True,
    ),
}
CONTROL, STATUS, EEPROM, COILS = range(0, 32), range(32, 64), 64, 128
NETWORK_TIMEOUT, DRIVE_TIMEOUT = 1, 2
FUNCTIONS = {0x01, 0x03, 0x05, 0x06, 0x0F, 0x10}
READS = {0x01, 0x03}
COUNTED = {0x0F, 0x10}
TYPE_MISMATCH = 5  # fault of the drive

# MAP-10. Functions 08, 0B, 11 and 2B/0E; sub-functions of 08.
DIAGNOSTIC, EVENT_COUNTER, SERVER_ID, IDENTIFICATION = 0x08, 0x0B, 0x11, 0x2B
DIAGNOSTICS = {DIAGNOSTIC, EVENT_COUNTER, SERVER_ID, IDENTIFICATION}
ECHO, RESTART, REGISTER, CLEAR, MESSAGES, ERRORS, EXCEPTIONS, REQUESTS = 0, 1, 2, 10, 11, 12, 13, 14
COUNTED_BY_SUB = {REGISTER, MESSAGES, ERRORS, EXCEPTIONS, REQUESTS}
# Faults of both lines and their bits in the diagnostic register. Sub-function 12 adds up the first six.
FAULTS = {
    **{"crc": 0, "parity": 1, "framing": 2, "t15": 3, "overrun": 4, "revoked": 5},
    **{"drive_silent": 6, "repeat": 6, "drive_bad": 7},
}
VERSION = (Path(__file__).resolve().parents[2] / "VERSION").read_text().strip()
OBJECTS = (b"rtu2fc", b"card", VERSION.encode())


def without_counts(pdu: bytes) -> bytes:
    """A reply's PDU with its counts set to 0: they depend on all of the line's traffic before."""
    if len(pdu) == 5 and (
        pdu[0] == EVENT_COUNTER or (pdu[0] == DIAGNOSTIC and word(pdu, 1) in COUNTED_BY_SUB)
    ):
        return pdu[:3] + bytes(2)
    return pdu


class Refused(Exception):
    """The request gets an exception. `why` is a key of Dialect.codes, or a fault number of the drive."""

    def __init__(self, why: str | int) -> None:
        self.why = why


@dataclass
class Step:
    """The card's next action: it replies, sends a telegram to the drive, or (both None) neither."""

    reply: bytes | None = None
    telegram: bytes | None = None


@dataclass
class Question:
    """The open request to the drive, and the master's request that caused it."""

    function: int
    start: int
    operand: int
    kind: str  # process, number, text
    pnu: int = 0
    other: str = ""  # the kind to try next if the drive reports a wrong data type, number or text
    again: bytes | None = None  # and its telegram


def word(data: bytes, at: int = 0) -> int:
    """A 16-bit word, high byte first."""
    return int.from_bytes(data[at : at + 2], "big")


def bits_to_word(bits: list[int]) -> int:
    return sum(bit << i for i, bit in enumerate(bits))


def word_to_bits(value: int) -> list[int]:
    return [value >> i & 1 for i in range(16)]


@dataclass
class CardModel:
    """The card's images (MAP-4, MAP-5), and the drive request without a reply yet."""

    adr: int = 0x81
    adr_broadcast: int = 0x80
    status_refresh: bool | None = None  # MAP-1; None: as the dialect has it
    name: str = "card"  # key of DIALECTS
    coils: list[int] = field(default_factory=lambda: [0] * COILS)
    registers: dict[int, int] = field(init=False)  # the card's own
    question: Question | None = None
    diagnostics: bool | None = None  # MAP-10; None: as the dialect has it
    # What was counted: faults, "foreign", "requests", "exceptions", "completed", "restarts".
    counts: Counter = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.dialect = DIALECTS[self.name]
        if self.diagnostics is None:
            self.diagnostics = self.dialect.diagnoses
        if self.status_refresh is None:
            self.status_refresh = self.dialect.refreshes
        self.registers = {self.dialect.index_register: 0, NETWORK_TIMEOUT: 1000, DRIVE_TIMEOUT: 15}

    # ------------------------------------------------------------ requests

    def request(self, pdu: bytes, broadcast: bool = False) -> Step:
        """Serves a committed request."""
        self.question = None
        ignored = READS | DIAGNOSTICS if self.diagnostics else READS
        if pdu[0] >= 0x80 or (broadcast and pdu[0] in ignored):  # 80h and above: an exception's echo (EXC 1)
            self.counts["requests"] += 1
            return Step()
        try:
            diagnosed = self.diagnostics and pdu[0] in DIAGNOSTICS
            step = Step(reply=self._diagnose(pdu)) if diagnosed else self._serve(pdu, broadcast)
        except Refused as refusal:
            step = Step(reply=bytes([pdu[0] | 0x80, self.dialect.code(refusal.why)]))
        self.counts["requests"] += 1
        if step.reply or broadcast:
            self._done(pdu[0], step.reply)
        if (
            step.reply
            and pdu[0] == DIAGNOSTIC
            and step.reply[0] == DIAGNOSTIC
            and word(pdu, 1) in (RESTART, CLEAR)
        ):
            self.counts.clear()
        if broadcast:
            self.question = None
            step.reply = None
        return step

    def _done(self, function: int, reply: bytes | None) -> None:
        """A request is over, by its reply or as a broadcast."""
        if reply and reply[0] & 0x80:
            self.counts["exceptions"] += 1
        elif function != EVENT_COUNTER:
            self.counts["completed"] += 1

    def _diagnose(self, pdu: bytes) -> bytes:
        """MAP-10, from the Modbus application protocol, 6.8, 6.9, 6.13, 6.21."""
        if pdu[0] == DIAGNOSTIC:
            return self._diagnostic(pdu)
        if pdu[0] == IDENTIFICATION and pdu[1:2] != b"\x0e":
            raise Refused("function")  # another MEI type is another function (MAP-10)
        if len(pdu) != (4 if pdu[0] == IDENTIFICATION else 1):
            raise Refused("length")
        if pdu[0] == EVENT_COUNTER:
            return pdu + bytes(2) + (self.counts["completed"] & 0xFFFF).to_bytes(2, "big")
        if pdu[0] == SERVER_ID:
            text = b"rtu2fc " + VERSION.encode() + b"\xff"
            return pdu + bytes([len(text)]) + text
        _, _, code, first = pdu
        if not 1 <= code <= 4:
            raise Refused("value")
        if code == 4 and first >= len(OBJECTS):
            raise Refused("address")
        first = first if first < len(OBJECTS) else 0
        wanted = range(first, first + 1 if code == 4 else len(OBJECTS))
        listed = b"".join(bytes([i, len(OBJECTS[i])]) + OBJECTS[i] for i in wanted)
        return bytes([0x2B, 0x0E, code, 0x81, 0, 0, len(wanted)]) + listed

    def _diagnostic(self, pdu: bytes) -> bytes:
        if len(pdu) < 5:
            raise Refused("length")
        sub, data = word(pdu, 1), word(pdu, 3)
        if sub == ECHO:
            if len(pdu) > 30 or len(pdu) % 2 == 0:
                raise Refused("length")
            return pdu
        if sub not in COUNTED_BY_SUB | {RESTART, CLEAR}:
            raise Refused("function")
        if len(pdu) != 5:
            raise Refused("length")
        if data != 0 and (sub, data) != (RESTART, 0xFF00):
            raise Refused("value")
        if sub not in COUNTED_BY_SUB:
            return pdu
        requests = self.counts["requests"] + 1  # this one included
        value = {
            REGISTER: sum({1 << bit for name, bit in FAULTS.items() if self.counts[name]})
            + (self.counts["restarts"] << 8),
            MESSAGES: requests + self.counts["foreign"],
            ERRORS: sum(self.counts[name] for name, bit in FAULTS.items() if bit < 6),
            EXCEPTIONS: self.counts["exceptions"],
            REQUESTS: requests,
        }[sub]
        return pdu[:3] + (value & 0xFFFF).to_bytes(2, "big")

    def _serve(self, pdu: bytes, broadcast: bool) -> Step:
        function = pdu[0]
        if function not in FUNCTIONS:
            raise Refused("function")
        if function in COUNTED:
            if len(pdu) < 6 or len(pdu) != 6 + pdu[5]:
                raise Refused("length")
        elif len(pdu) != 5:
            raise Refused("length")
        start, operand = word(pdu, 1), word(pdu, 3)
        adr = bytes([self.adr_broadcast if broadcast else self.adr])
        if function in (0x05, 0x06):
            count = 1
        else:
            count = operand
            if not 1 <= count <= self._limit(function, start):
                raise Refused("quantity")
        if function in COUNTED and pdu[5] != (-(-count // 8) if function == 0x0F else 2 * count):
            raise Refused("quantity")
        self.question = Question(function, start, operand, "process")
        if function in (0x01, 0x05, 0x0F):
            return self._coils(function, start, count, operand, pdu[6:], adr)
        data = pdu[3:] if function == 0x06 else pdu[6:]
        return self._registers(function, start, count, data, adr)

    def _limit(self, function: int, start: int) -> int:
        if function == 0x01:
            return 128
        if function == 0x0F:
            return 32
        if start <= DRIVE_TIMEOUT or start in self.registers:
            return 3
        return 10 if self.dialect.text_by_size or self._by_text(function, 0) else 2

    def _by_text(self, function: int, count: int) -> bool:
        if self.dialect.text_by_size:
            return count > 2
        return self.registers[0] >> 8 == {0x03: 4, 0x10: 5}.get(function, -1)

    def _coils(self, function: int, start: int, count: int, operand: int, data: bytes, adr: bytes) -> Step:
        run = range(start, start + count)
        if function == 0x01:
            if run.stop > COILS:
                raise Refused("address")
            if self.status_refresh and set(run) & set(STATUS):
                return Step(telegram=adr + bytes(4))
            return Step(reply=self._pack_coils(run))
        if not (run.stop <= CONTROL.stop or list(run) == [EEPROM]):
            raise Refused("address")
        if function == 0x05:
            if operand not in (0x0000, 0xFF00):
                raise Refused("value")
            values = [int(operand == 0xFF00)]
        else:
            values = [data[i // 8] >> i % 8 & 1 for i in range(count)]
        self.coils[run.start : run.stop] = values
        if start == EEPROM:
            return Step(reply=self._echo())
        ctw, ref = bits_to_word(self.coils[0:16]), bits_to_word(self.coils[16:32])
        return Step(telegram=adr + ctw.to_bytes(2, "big") + ref.to_bytes(2, "big"))

    def _pack_coils(self, run: range) -> bytes:
        count = -(-len(run) // 8)
        packed = sum(self.coils[coil] << i for i, coil in enumerate(run)).to_bytes(count, "little")
        return bytes([0x01, count]) + packed

    def _registers(self, function: int, start: int, count: int, data: bytes, adr: bytes) -> Step:
        if start in self.registers:
            run = range(start, start + count)
            if not set(run) <= set(self.registers):
                raise Refused("address")
            if function == 0x03:
                values = [self.registers[register] for register in run]
                return Step(reply=bytes([3, 2 * count]) + b"".join(v.to_bytes(2, "big") for v in values))
            values = [word(data, 2 * i) for i in range(count)]
            new = dict(zip(run, values, strict=True))
            if new.get(DRIVE_TIMEOUT) == 0:
                raise Refused("value")
            self.registers.update(new)
            return Step(reply=self._echo())
        pnu, rest = divmod(start + 1, 10)
        if rest or not 1 <= pnu <= self.dialect.pnu_max:
            raise Refused("address")
        self.question.pnu = pnu
        index = self.registers[self.dialect.index_register] & 0xFF

        def telegram(ak: int, ind: int, value: bytes) -> bytes:
            pke = (ak << 12 | pnu).to_bytes(2, "big")
            return adr + pke + ind.to_bytes(2, "big") + value + bytes(4)

        reads = function == 0x03
        by_text = telegram(15, (0x400 if reads else 0x500) | index, bytes(4) if reads else data)
        by_number = telegram(1, index, bytes(4))
        if self._by_text(function, count):
            self.question.kind = "text"
            if self.dialect.text_by_size and reads:
                self.question.other, self.question.again = "number", by_number
            return Step(telegram=by_text)
        self.question.kind = "number"
        if self.dialect.text_by_size and function != 0x06:
            self.question.other, self.question.again = "text", by_text
        if reads:
            return Step(telegram=by_number)
        stored = self.coils[EEPROM]
        ak = {(1, 0): 2, (2, 0): 3, (1, 1): 14, (2, 1): 13}[count, stored]
        return Step(telegram=telegram(ak, index, data.rjust(4, b"\0")))

    def _echo(self) -> bytes:
        q = self.question
        return bytes([q.function]) + q.start.to_bytes(2, "big") + q.operand.to_bytes(2, "big")

    # ------------------------------------------------------------ the drive

    def drive_reply(self, telegram: bytes) -> Step:
        """Takes the drive's telegram, ADR and data; Step() if it is no reply to the open request (FC-8)."""
        q, data = self.question, telegram[1:]
        if q is None or telegram[0] != self.adr or not self._fits(q, data):
            return Step()
        self.coils[32:48] = word_to_bits(word(data, len(data) - 4))
        self.coils[48:64] = word_to_bits(word(data, len(data) - 2))
        try:
            reply = self._answer(q, data)
        except Refused as refusal:
            if refusal.why == TYPE_MISMATCH and q.again and data[0] >> 4 == 7:
                q.kind, telegram, q.again = q.other, q.again, None
                return Step(telegram=telegram)
            reply = bytes([q.function | 0x80, self.dialect.code(refusal.why)])
        self.question = None
        self._done(q.function, reply)
        return Step(reply=reply)

    def drive_silent(self) -> Step:
        """The drive gave no good reply, not even to the repeat (FC-9)."""
        q, self.question = self.question, None
        if "silent" not in self.dialect.codes:
            return Step()
        self.counts["exceptions"] += 1
        return Step(reply=bytes([q.function | 0x80, self.dialect.code("silent")]))

    @staticmethod
    def _fits(q: Question, data: bytes) -> bool:
        if q.kind == "process":
            return len(data) == 4
        if len(data) < 8 or word(data) & 0xFFF != q.pnu:
            return False
        ak = data[0] >> 4
        if q.kind == "text" and ak == 15:
            return True
        return len(data) == 12 and (ak == 7 or (q.kind == "number" and ak in (1, 2)))

    def _answer(self, q: Question, data: bytes) -> bytes:
        if q.kind == "process":
            if q.function == 0x01:
                return self._pack_coils(range(q.start, q.start + q.operand))
            return self._echo_of(q)
        if data[0] >> 4 == 7:
            raise Refused(data[7])
        if q.function != 0x03:
            return self._echo_of(q)
        size = 2 * q.operand
        if q.kind == "text":
            return bytes([3, size]) + data[4:-4][:size].ljust(size, b" ")
        value = data[4:8]
        if size == 2:
            unsigned, signed = int.from_bytes(value, "big"), int.from_bytes(value, "big", signed=True)
            if not (unsigned <= 0xFFFF or -0x8000 <= signed <= 0x7FFF):
                raise Refused(TYPE_MISMATCH)
            value = value[2:]
        return bytes([3, size]) + value.ljust(size, b"\0")  # more registers were asked for as a text (MAP-8)

    def _echo_of(self, q: Question) -> bytes:
        self.question = q
        return self._echo()
