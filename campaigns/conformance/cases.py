# SPDX-License-Identifier: Apache-2.0
"""The numbered tests of a Modbus RTU slave, each with page, request, right and wrong behaviour.

Sources: SL is "MODBUS over Serial Line, Specification and Implementation Guide" V1.02, AP is "MODBUS
Application Protocol Specification" V1.1b3. A test is a generator: it yields each `Send` and gets a `Heard`
for it, so one test serves simulated pins and a serial port. It raises `Fault` for a wrong behaviour.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field

from tb.agents import rtu
from tb.agents.crc16 import with_crc
from tb.agents.edges import Limits, Trace, judge
from tb.agents.rs485 import Pulse
from tb.agents.uart import Flaws, Format

BYTES, EDGES, PARITY, PINS = "bytes", "edges", "parity", "DE"
LONGEST_FRAME = 256


class Fault(Exception):
    """A wrong behaviour of the slave, in one line."""


class Missing(Exception):
    """The slave has no function that this test needs."""


@dataclass(frozen=True)
class Send:
    """One transmission of the master.

    flaws: faults of the line. pause_bits: idle time since the line's last activity; None: more than enough.
    wait: whether to wait for a reply. low_bits: the line is held low for so long, nothing else is sent.
    """

    data: bytes = b""
    flaws: Flaws | None = None
    pause_bits: float | None = None
    wait: bool = True
    low_bits: float = 0.0

    @property
    def needs_edges(self) -> bool:
        return self.flaws is not None or self.pause_bits is not None or bool(self.low_bits)


@dataclass(frozen=True)
class Heard:
    """The slave's bytes until the next silence; no bytes: no reply. The other fields exist on pins only."""

    data: bytes = b""
    trace: Trace | None = None
    pulses: list[Pulse] | None = None
    request_end_ps: float = 0.0


@dataclass(frozen=True)
class Profile:
    """Address and line of the slave under test, and the addresses that the tests may use.

    functions       functions that the slave has by its own document
    register        first of `registers` holding registers that keep any of `values`
    coil            first of `coils` coils that can be written
    no_register     an address without a register; no_coil: an address without a coil
    unknown         a function that the slave does not have
    own_codes       by test: the exception code of the slave's own document instead of the specification's
    """

    unit: int = 1
    fmt: Format = field(default_factory=lambda: Format(19200, "E", 1))
    functions: frozenset[int] = frozenset({1, 3, 5, 6, 15, 16})
    register: int = 0
    registers: int = 2
    values: tuple[int, int] = (0x0012, 0x0015)
    coil: int = 0
    coils: int = 8
    no_register: int = 0xFFF0
    no_coil: int = 0xFFF0
    unknown: int = 0x2D
    own_codes: Mapping[str, int] = field(default_factory=dict)


class Session:
    """One test on one slave. `own_codes` collects the exception codes of the slave's own document."""

    def __init__(self, profile: Profile, number: str = ""):
        self.profile = profile
        self.own_code = profile.own_codes.get(number)
        self.own_codes: list[str] = []
        self._function = 0  # of the last request

    def needs(self, *functions: int) -> None:
        missing = [function for function in functions if function not in self.profile.functions]
        if missing:
            raise Missing(f"no function {missing[0]}")

    @property
    def other(self) -> int:
        """Another unit, never broadcast."""
        return self.profile.unit % 247 + 1

    @property
    def writes(self) -> int:
        """The function that writes a register."""
        found = [function for function in (6, 16) if function in self.profile.functions]
        if not found:
            raise Missing("no function 6 or 16")
        return found[0]

    def write(self, value: int, register: int | None = None) -> bytes:
        register = self.profile.register if register is None else register
        if self.writes == 6:
            return rtu.write_register(register, value)
        return rtu.write_registers(register, [value])

    @property
    def read(self) -> bytes:
        """A good request that changes nothing."""
        p = self.profile
        if 3 in p.functions:
            return rtu.read_registers(p.register, 1)
        if 1 in p.functions:
            return rtu.read_coils(p.coil, 1)
        raise Missing("no function 1 or 3")

    def request(self, pdu: bytes) -> bytes:
        """A frame for the slave. `good` expects the function of the newest one in the reply."""
        self._function = pdu[0]
        return rtu.build(self.profile.unit, pdu)

    # ------------------------------------------------------------ verdicts

    def good(self, heard: Heard, what: str = "a good request") -> bytes:
        """The PDU of a normal reply."""
        adu = self._reply(heard, what)
        if adu.is_exception:
            raise Fault(f"exception {adu.pdu[1:].hex(' ') if len(adu.pdu) != 2 else adu.pdu[1]} to {what}")
        if adu.function != self._function:
            raise Fault(f"function {adu.function} in the reply to {what}")
        return adu.pdu

    def _reply(self, heard: Heard, what: str) -> rtu.Adu:
        """Any whole reply of the slave."""
        if not heard.data:
            raise Fault(f"no reply to {what}")
        try:
            adu = rtu.parse(heard.data)
        except ValueError:
            raise Fault(f"a reply with a wrong CRC: {heard.data.hex(' ')}") from None
        if adu.address != self.profile.unit:
            raise Fault(f"address {adu.address} in the reply")
        return adu

    def equal(self, heard: Heard, due: bytes, what: str) -> None:
        found = self.good(heard, what)
        if found != due:
            raise Fault(f"{what}: {found.hex(' ')} instead of {due.hex(' ')}")

    def silent(self, heard: Heard, what: str) -> None:
        if heard.data:
            raise Fault(f"{what} is answered: {heard.data.hex(' ')}")

    def exception(self, heard: Heard, function: int, code: int, what: str) -> None:
        adu = self._reply(heard, what)
        if adu.function != function | 0x80 or len(adu.pdu) != 2:
            raise Fault(f"{what}: {adu.pdu.hex(' ')} instead of {function | 0x80:02x} {code:02x}")
        if adu.exception_code == code:
            return
        if adu.exception_code != self.own_code:
            raise Fault(f"{what}: exception {adu.exception_code} instead of {code}")
        self.own_codes.append(f"{adu.exception_code} instead of {code}")

    def not_served(self, heard: Heard, function: int, what: str) -> None:
        """Silence, or an exception with any code."""
        if not heard.data:
            return
        adu = self._reply(heard, what)
        if adu.function != function | 0x80 or len(adu.pdu) != 2:
            raise Fault(f"{what} is answered: {adu.pdu.hex(' ')}")

    def judged(self, heard: Heard, limits: Limits, *, early: bool = False, direction: bool = False) -> None:
        """Judges the edges of a good reply by `limits`."""
        self.good(heard)
        faults = judge(
            heard.trace,
            heard.trace.frame(),
            request_end_ps=heard.request_end_ps if early else None,
            pulses=heard.pulses if direction else None,
            limits=limits,
        )
        if faults:
            raise Fault("; ".join(faults))

    # ------------------------------------------------------------ small dialogues

    def ask(self, pdu: bytes, **how: object) -> Dialogue:
        return (yield Send(self.request(pdu), **how))

    def value(self, register: int | None = None) -> Dialogue:
        """The value of a register."""
        self.needs(3)
        register = self.profile.register if register is None else register
        found = self.good((yield from self.ask(rtu.read_registers(register, 1))), "a read")
        if len(found) != 4 or found[0] != 3:  # the byte count is AP-1
            raise Fault(f"a read of one register: {found.hex(' ')}")
        return int.from_bytes(found[2:], "big")

    def set(self, value: int) -> Dialogue:
        request = self.write(value)
        self.equal((yield from self.ask(request)), request[:5], "a write")

    def holds(self, value: int, what: str) -> Dialogue:
        found = yield from self.value()
        if found != value:
            raise Fault(f"{what}: the register holds {found} instead of {value}")

    def without_effect(self, send: Send, what: str, code: int | None = None) -> Dialogue:
        """A write that must not be obeyed: the register keeps its value.

        code: of the exception that must come; None: no reply may come.
        """
        yield from self.set(self.profile.values[0])
        heard = yield send
        if code is None:
            self.silent(heard, what)
        else:
            self.exception(heard, send.data[1], code, what)
        yield from self.holds(self.profile.values[0], what)

    def still_answers(self, what: str, **how: object) -> Dialogue:
        self.good((yield from self.ask(self.read, **how)), f"a good request after {what}")


Dialogue = Generator[Send, Heard, object]


@dataclass(frozen=True)
class Case:
    """A numbered test. needs: bytes (any port shows it), edges, parity (edges and a parity bit), DE."""

    number: str
    page: str
    sent: str
    must: str
    must_not: str
    needs: str
    dialogue: Callable[[Session], Dialogue]


CASES: list[Case] = []


def case(number: str, page: str, sent: str, must: str, must_not: str, needs: str = BYTES) -> Callable:
    def add(dialogue: Callable[[Session], Dialogue]) -> Callable:
        CASES.append(Case(number, page, sent, must, must_not, needs, dialogue))
        return dialogue

    return add


# ---------------------------------------------------------------- serial line: addresses and CRC


@case("SL-1", "SL 8", "a read", "a reply with its own address and a right CRC", "another address, more bytes")
def own_address(s: Session) -> Dialogue:
    found = s.good((yield from s.ask(s.read)))
    if len(found) != (4 if s.read[0] == 3 else 3):
        raise Fault(f"a reply of another length: {found.hex(' ')}")


@case("SL-2", "SL 8, 10", "a read for other units, also 247, 248 and 255", "silence", "a reply")
def other_units(s: Session) -> Dialogue:
    for unit in (s.other, 247, 248, 255):
        if unit != s.profile.unit:
            s.silent((yield Send(rtu.build(unit, s.read))), f"a request for unit {unit}")
    yield from s.still_answers("requests for others")


@case("SL-3", "SL 8", "a write for another unit", "silence; the register keeps its value", "a change")
def others_writes(s: Session) -> Dialogue:
    send = Send(rtu.build(s.other, s.write(s.profile.values[1])))
    yield from s.without_effect(send, "a write for another unit")


@case("SL-4", "SL 8", "a broadcast write", "the register changes", "no change")
def broadcast_writes(s: Session) -> Dialogue:
    yield from s.set(s.profile.values[0])
    yield Send(rtu.build(0, s.write(s.profile.values[1])))
    yield from s.holds(s.profile.values[1], "a broadcast write")


@case("SL-5", "SL 10", "a broadcast write, a broadcast read", "silence", "a reply")
def broadcast_is_silent(s: Session) -> Dialogue:
    s.silent((yield Send(rtu.build(0, s.write(s.profile.values[0])))), "a broadcast write")
    s.silent((yield Send(rtu.build(0, s.read))), "a broadcast read")
    yield from s.still_answers("broadcasts")


@case("SL-6", "SL 10, 15", "a write with each kind of wrong CRC", "silence; no change", "a reply, a change")
def wrong_crc(s: Session) -> Dialogue:
    good = s.request(s.write(s.profile.values[1]))
    swapped = good[:-2] + good[:-3:-1]
    for what, bad in (
        ("a CRC with one wrong bit", good[:-1] + bytes([good[-1] ^ 0x80])),
        ("a CRC with a wrong low byte", good[:-2] + bytes([good[-2] ^ 1, good[-1]])),
        ("a CRC of 0", good[:-2] + b"\0\0"),
        ("a CRC with swapped bytes", swapped),
        ("a damaged byte", good[:3] + bytes([good[3] ^ 4]) + good[4:]),
    ):
        if bad != good:
            yield from s.without_effect(Send(bad), what)


@case("SL-7", "SL 13", "five bytes of a request, a pause, a good request", "one reply, to the good one",
      "a reply to the part, silence after it")  # fmt: skip
def partial(s: Session) -> Dialogue:
    s.silent((yield Send(s.request(s.read)[:5])), "a part of a request")
    yield from s.still_answers("a part of a request")


@case(
    "SL-8",
    "SL 13",
    "300 bytes with a right CRC, a pause, a good request",
    "an exception or silence, then a reply",
    "a normal reply to the first, silence to the good one",
)
def too_long(s: Session) -> Dialogue:
    pdu = bytes([16]) + s.profile.register.to_bytes(2, "big") + b"\0\x91\x22" + bytes(291)
    heard = yield Send(s.request(pdu))
    s.not_served(heard, 16, f"a frame of {len(pdu) + 3} bytes")
    yield from s.still_answers("a frame of 300 bytes")


@case("SL-9", "SL 8, 14", "request and reply of another unit, a good request", "one reply, to the good one",
      "a reply to the traffic of others")  # fmt: skip
def foreign_traffic(s: Session) -> Dialogue:
    other = s.other
    s.silent((yield Send(rtu.build(other, rtu.read_registers(0, 4)))), "another unit's request")
    s.silent((yield Send(rtu.build(other, bytes([3, 8, *range(8)])))), "another unit's reply")
    yield from s.still_answers("another unit's traffic")


@case(
    "SL-10",
    "SL 14",
    "one noise byte, a pause, a good request",
    "one reply, to the good one",
    "a lost request",
)
def noise(s: Session) -> Dialogue:
    s.silent((yield Send(b"\x55")), "a noise byte")
    yield from s.still_answers("a noise byte")


# ---------------------------------------------------------------- serial line: silences

CHARACTER = 11


def t35_bits(s: Session) -> float:
    return rtu.t35_ps(s.profile.fmt.baud) / s.profile.fmt.bit_ps


def t15_bits(s: Session) -> float:
    return rtu.t15_ps(s.profile.fmt.baud) / s.profile.fmt.bit_ps


def short(s: Session) -> float:
    """Ratio of a real character to one of 11 bits. Format 8N1 has 10 bits, and a slave may count those."""
    fmt = s.profile.fmt
    return fmt.bits / CHARACTER if fmt.baud <= 19200 else 1.0


@case(
    "SL-11",
    "SL 13",
    "a good request with a gap of 1.3 characters after each byte",
    "a reply",
    "silence",
    EDGES,
)
def legal_gaps(s: Session) -> Dialogue:
    gap = t15_bits(s) * short(s) * 1.3 / 1.5
    frame = s.request(s.read)
    flaws = Flaws(gaps=dict.fromkeys(range(1, len(frame)), gap))
    s.good((yield Send(frame, flaws)), f"a request with gaps of {gap:.1f} bits")


@case(
    "SL-12",
    "SL 13",
    "a write with one gap of 2.2 characters",
    "silence; no change",
    "a reply, a change",
    EDGES,
)
def long_gap(s: Session) -> Dialogue:
    frame = s.request(s.write(s.profile.values[1]))
    gap = t15_bits(s) * 2.2 / 1.5
    for place in (1, 4, len(frame) - 1):
        send = Send(frame, Flaws(gaps={place: gap}))
        yield from s.without_effect(send, f"a gap of {gap:.1f} bits before byte {place + 1}")


@case("SL-13", "SL 13, 14", "a frame for another unit, 3.5 characters and a bit, a good request", "a reply",
      "silence", EDGES)  # fmt: skip
def shortest_pause(s: Session) -> Dialogue:
    yield Send(rtu.build(s.other, s.read), wait=False)
    yield from s.still_answers("3.5 characters and a bit", pause_bits=t35_bits(s) + 1)


@case("SL-14", "SL 13, 14", "a frame for another unit, 2.5 characters, a write", "silence; no change",
      "a reply, a change", EDGES)  # fmt: skip
def pause_too_short(s: Session) -> Dialogue:
    yield from s.set(s.profile.values[0])
    yield Send(rtu.build(s.other, s.read), wait=False)
    pause = t35_bits(s) * short(s) * 2.5 / 3.5
    heard = yield Send(s.request(s.write(s.profile.values[1])), pause_bits=pause)
    s.silent(heard, f"a write {pause:.1f} bits after another frame")
    yield from s.holds(s.profile.values[0], "a write after a pause that is too short")


@case("SL-15", "SL 14", "a good write, and one more byte after 2.5 characters", "silence; no change",
      "a reply, a change", EDGES)  # fmt: skip
def revoked(s: Session) -> Dialogue:
    frame = s.request(s.write(s.profile.values[1]))
    gap = t35_bits(s) * short(s) * 2.5 / 3.5
    send = Send(frame + b"\x55", Flaws(gaps={len(frame): gap}))
    yield from s.without_effect(send, "a write with a byte after it")


@case("SL-16", "SL 13", "a read, a write", "a pause of 3.5 characters before each reply", "an earlier reply",
      EDGES)  # fmt: skip
def reply_after_t35(s: Session) -> Dialogue:
    allowed = 0.25 + t35_bits(s) * (1 - short(s))
    limits = Limits(rate=None, edge_bits=None, early_bits=allowed)
    for pdu in (s.read, s.write(s.profile.values[0])):
        s.judged((yield from s.ask(pdu)), limits, early=True)


@case("SL-17", "SL 13", "a read", "a reply without a gap of more than 1.5 characters", "a longer gap", EDGES)
def reply_without_gaps(s: Session) -> Dialogue:
    limits = Limits(rate=None, edge_bits=None)
    count = s.profile.registers if 3 in s.profile.functions else 1
    pdu = rtu.read_registers(s.profile.register, count) if 3 in s.profile.functions else s.read
    heard = yield from s.ask(pdu)
    s.judged(heard, limits)


# ---------------------------------------------------------------- serial line: characters


@case("SL-18", "SL 19", "a write with one wrong parity bit, in each place", "silence; no change",
      "a reply, a change", PARITY)  # fmt: skip
def wrong_parity(s: Session) -> Dialogue:
    frame = s.request(s.write(s.profile.values[1]))
    for place in (0, 1, 4, len(frame) - 1):
        send = Send(frame, Flaws(bad_parity=(place,)))
        yield from s.without_effect(send, f"wrong parity in byte {place + 1}")


@case("SL-19", "SL 12", "a write with one low stop bit", "silence; no change", "a reply, a change", EDGES)
def low_stop_bit(s: Session) -> Dialogue:
    frame = s.request(s.write(s.profile.values[1]))
    for place in (2, len(frame) - 2):
        # One idle bit more, so that the next start bit is an edge.
        send = Send(frame, Flaws(bad_stop=(place,), gaps={place + 1: 1.0}))
        yield from s.without_effect(send, f"a low stop bit in byte {place + 1}")


@case(
    "SL-20", "SL 12", "a read", "parity and stop bits as set, 11 bits a character", "other characters", EDGES
)
def own_characters(s: Session) -> Dialogue:
    heard = yield from s.ask(s.read)
    s.judged(heard, Limits(rate=None))
    frame, fmt = heard.trace.frame(), s.profile.fmt
    starts = [
        (b.start_ps - a.start_ps) / fmt.bit_ps
        for a, b in zip(frame.characters, frame.characters[1:], strict=False)
    ]
    if min(starts) < CHARACTER - 0.25:
        raise Fault(f"characters of {min(starts):.1f} bits")


@case("SL-21", "SL 20", "a read", "a reply within 1 % of the rate", "a larger error", EDGES)
def own_rate(s: Session) -> Dialogue:
    s.judged((yield from s.ask(s.read)), Limits(edge_bits=None))


@case("SL-22", "SL 20", "requests 2 % too fast and 2 % too slow, without gaps", "replies", "silence", EDGES)
def senders_rate(s: Session) -> Dialogue:
    for ppm in (20_000, -20_000):
        for value in s.profile.values:
            heard = yield from s.ask(s.write(value), flaws=Flaws(ppm=ppm))
            s.good(heard, f"a write at {ppm / 10_000:+.0f} %")


@case(
    "SL-23",
    "SL 14",
    "a break of 30 bits, a pause, a good request",
    "one reply, to the good one",
    "silence",
    EDGES,
)
def a_break(s: Session) -> Dialogue:
    s.silent((yield Send(low_bits=30)), "a break")
    yield from s.still_answers("a break")


@case("SL-24", "SL 22", "a read", "DE during the reply, at most 3.5 characters longer",
      "a driver on the line outside", PINS)  # fmt: skip
def driver(s: Session) -> Dialogue:
    limit = t35_bits(s)
    limits = Limits(rate=None, edge_bits=None, de_lead_bits=limit, de_lag_bits=limit)
    heard = yield from s.ask(s.read)
    s.judged(heard, limits, direction=True)
    if len(heard.pulses) != 1:
        raise Fault(f"DE rises {len(heard.pulses)} times")
    s.silent((heard := (yield Send(rtu.build(s.other, s.read)))), "another unit's request")
    if heard.pulses:
        raise Fault("DE rises after another unit's request")


@case(
    "SL-25",
    "SL 13, 14",
    "a read 3.5 characters and a bit after its own reply",
    "a reply",
    "silence",
    EDGES,
)
def after_own_reply(s: Session) -> Dialogue:
    s.good((yield from s.ask(s.read)))
    yield from s.still_answers("its own reply", pause_bits=t35_bits(s) + 1)


# ---------------------------------------------------------------- application: registers


@case(
    "AP-1",
    "AP 15",
    "03 of one register and of several",
    "a byte count of 2 N and N registers",
    "another length",
)
def reads_registers(s: Session) -> Dialogue:
    s.needs(3)
    for count in {1, s.profile.registers}:
        found = s.good((yield from s.ask(rtu.read_registers(s.profile.register, count))))
        if found[:2] != bytes([3, 2 * count]) or len(found) != 2 + 2 * count:
            raise Fault(f"03 of {count} registers: {found.hex(' ')}")


@case("AP-2", "AP 19", "06, then 03", "an echo of the request; the register holds the value", "another reply")
def writes_a_register(s: Session) -> Dialogue:
    s.needs(3, 6)
    for value in s.profile.values:
        pdu = rtu.write_register(s.profile.register, value)
        s.equal((yield from s.ask(pdu)), pdu, "06")
        yield from s.holds(value, "after 06")


@case(
    "AP-3",
    "AP 30",
    "16 of several registers, then 03",
    "function, address, quantity; all values",
    "another reply",
)
def writes_registers(s: Session) -> Dialogue:
    s.needs(3, 16)
    first, count = s.profile.register, s.profile.registers
    for turn in (0, 1):
        values = [s.profile.values[(turn + n) % 2] for n in range(count)]
        pdu = rtu.write_registers(first, values)
        s.equal((yield from s.ask(pdu)), pdu[:5], "16")
        words = b"".join(value.to_bytes(2, "big") for value in values)
        found = yield from s.ask(rtu.read_registers(first, count))
        s.equal(found, bytes([3, 2 * count]) + words, "03 after 16")


@case("AP-4", "AP 15, 16", "03 of 0 and of 126 registers", "exception 3", "another code, silence")
def read_quantity(s: Session) -> Dialogue:
    s.needs(3)
    for count in (0, 126):
        heard = yield from s.ask(rtu.read_registers(s.profile.register, count))
        s.exception(heard, 3, 3, f"03 of {count} registers")


@case(
    "AP-5",
    "AP 48",
    "03 of a register that is not there, 03 beyond 65535",
    "exception 2",
    "another code, silence",
)
def read_address(s: Session) -> Dialogue:
    s.needs(3)
    for first, count in ((s.profile.no_register, 1), (0xFFFF, 2)):
        s.exception((yield from s.ask(rtu.read_registers(first, count))), 3, 2, f"03 of {first:04X}h")


@case("AP-6", "AP 19, 48", "06 to a register that is not there", "exception 2", "another code, silence")
def write_address(s: Session) -> Dialogue:
    s.needs(6)
    pdu = rtu.write_register(s.profile.no_register, s.profile.values[0])
    s.exception((yield from s.ask(pdu)), 6, 2, "06 to no register")


@case(
    "AP-7",
    "AP 30",
    "16 with a byte count that is not 2 N",
    "exception 3; no change",
    "another code, a change",
)
def byte_count(s: Session) -> Dialogue:
    s.needs(3, 16)
    p = s.profile
    words = p.values[1].to_bytes(2, "big") * 2
    pdu = bytes([16]) + p.register.to_bytes(2, "big") + b"\0\1\4" + words
    yield from s.without_effect(Send(s.request(pdu)), "16 of one register with 4 bytes", code=3)


@case("AP-8", "AP 30", "16 of 0 registers", "exception 3", "another code, silence")
def write_quantity(s: Session) -> Dialogue:
    s.needs(16)
    pdu = bytes([16]) + s.profile.register.to_bytes(2, "big") + b"\0\0\0"
    s.exception((yield from s.ask(pdu)), 16, 3, "16 of 0 registers")


# ---------------------------------------------------------------- application: coils


@case(
    "AP-9", "AP 11, 12", "01 of 1, 3 and all coils", "the byte count; the bits beyond are 0", "another length"
)
def reads_coils(s: Session) -> Dialogue:
    s.needs(1)
    for count in {1, min(3, s.profile.coils), s.profile.coils}:
        found, size = s.good((yield from s.ask(rtu.read_coils(s.profile.coil, count)))), (count + 7) // 8
        if found[:2] != bytes([1, size]) or len(found) != 2 + size:
            raise Fault(f"01 of {count} coils: {found.hex(' ')}")
        if int.from_bytes(found[2:], "little") >> count:
            raise Fault(f"01 of {count} coils: bits beyond are 1: {found.hex(' ')}")


@case("AP-10", "AP 17", "05 ON and OFF, then 01", "echoes; the coil follows", "another reply")
def writes_a_coil(s: Session) -> Dialogue:
    s.needs(1, 5)
    for on in (True, False):
        pdu = rtu.write_coil(s.profile.coil, on)
        s.equal((yield from s.ask(pdu)), pdu, "05")
        s.equal((yield from s.ask(rtu.read_coils(s.profile.coil, 1))), bytes([1, 1, on]), "01 after 05")


@case(
    "AP-11",
    "AP 17, 19",
    "05 with the value 1234h",
    "exception 3; the coil keeps its state",
    "another code, a change",
)
def coil_value(s: Session) -> Dialogue:
    s.needs(1, 5)
    pdu = rtu.write_coil(s.profile.coil, True)
    s.equal((yield from s.ask(pdu)), pdu, "05")
    s.exception((yield from s.ask(pdu[:3] + b"\x12\x34")), 5, 3, "05 with 1234h")
    s.equal((yield from s.ask(rtu.read_coils(s.profile.coil, 1))), bytes([1, 1, 1]), "01 after it")


@case(
    "AP-12",
    "AP 29",
    "15 of several coils, then 01",
    "function, address, quantity; all coils",
    "another reply",
)
def writes_coils(s: Session) -> Dialogue:
    s.needs(1, 15)
    count = min(s.profile.coils, 3)
    for bits in ([True, False, True][:count], [False] * count):
        pdu = rtu.write_coils(s.profile.coil, bits)
        s.equal((yield from s.ask(pdu)), pdu[:5], "15")
        due = sum(bit << n for n, bit in enumerate(bits))
        s.equal((yield from s.ask(rtu.read_coils(s.profile.coil, count))), bytes([1, 1, due]), "01 after 15")


@case("AP-13", "AP 12", "01 of 0 and of 2001 coils", "exception 3", "another code, silence")
def coil_quantity(s: Session) -> Dialogue:
    s.needs(1)
    for count in (0, 2001):
        s.exception((yield from s.ask(rtu.read_coils(s.profile.coil, count))), 1, 3, f"01 of {count} coils")


@case("AP-14", "AP 12, 48", "01 of a coil that is not there", "exception 2", "another code, silence")
def coil_address(s: Session) -> Dialogue:
    s.needs(1)
    s.exception((yield from s.ask(rtu.read_coils(s.profile.no_coil, 1))), 1, 2, "01 of no coil")


# ---------------------------------------------------------------- application: functions


@case(
    "AP-15",
    "AP 9, 48",
    "a function that it does not have",
    "exception 1 with the function + 80h",
    "another code, silence",
)
def unknown_function(s: Session) -> Dialogue:
    unknown = s.profile.unknown
    s.exception((yield from s.ask(bytes([unknown, 0, 0, 0, 1]))), unknown, 1, f"function {unknown}")
    yield from s.still_answers("an unknown function")


@case("AP-16", "AP 4", "function 0 and function 131", "an exception or silence", "a normal reply")
def reserved_functions(s: Session) -> Dialogue:
    for function in (0, 131):
        heard = yield from s.ask(bytes([function]) + s.read[1:])
        s.not_served(heard, function, f"function {function}")
    yield from s.still_answers("reserved functions")


@case("AP-17", "AP 48", "03 with one byte too many and too few", "exception 3 or silence", "a normal reply")
def wrong_length(s: Session) -> Dialogue:
    s.needs(3)
    for what, pdu in (("too many", s.read + b"\0"), ("too few", s.read[:-1])):
        heard = yield Send(with_crc(bytes([s.profile.unit]) + pdu))
        if heard.data:
            s.exception(heard, 3, 3, f"03 with one byte {what}")
    yield from s.still_answers("a wrong length")
