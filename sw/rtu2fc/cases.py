# SPDX-License-Identifier: Apache-2.0
"""The numbered tests of a Modbus RTU slave, each with page, request, right and wrong behaviour.

Sources: SL is "MODBUS over Serial Line, Specification and Implementation Guide" V1.02, AP is "MODBUS
Application Protocol Specification" V1.1b3. A test is a generator: it yields each `Send` and gets a `Heard`
for it, so one test serves simulated pins and a serial port. It raises `Fault` for a wrong behaviour.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field

from . import rtu
from .edges import Limits, Trace, judge
from .line import Flaws, Format, Pulse

BYTES, EDGES, PARITY, PINS = "bytes", "edges", "parity", "DE"
LONGEST_FRAME = 256
FUNCTIONS = (1, 2, 3, 4, 5, 6, 15, 16)  # those that have tests
SEVERAL = 10  # registers or coils of a usual test; a slave may have fewer


@dataclass(frozen=True)
class Kind:
    """Registers or coils: the functions that read, write one and write several; the most in a frame."""

    name: str
    read: int
    one: int
    several: int
    most_read: int
    most_written: int


REGISTER, COIL = Kind("register", 3, 6, 16, 125, 123), Kind("coil", 1, 5, 15, 2000, 0x7B0)
WRITES = {5: rtu.write_coil, 6: rtu.write_register, 15: rtu.write_coils, 16: rtu.write_registers}


class Fault(Exception):
    """A wrong behaviour of the slave, in one line."""


class Missing(Exception):
    """The slave has nothing to try this test on; the text is the reason."""


@dataclass(frozen=True)
class Send:
    """One transmission of the master.

    flaws: faults of the line. pause_bits: idle time since the line's last activity; None: more than enough.
    wait: whether to wait for a reply. low_bits: the line is held low for so long, nothing else is sent.
    Without data nothing is sent: the driver listens for as long as it waits for a reply.
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
    input           first of `inputs` discrete inputs (02) and of as many input registers (04)
    no_register     an address without a register; no_coil, no_input: likewise. The tests of the end of the
                    map need the first such address.
    unknown         a function that the slave does not have
    own_codes       by test: the exception code of the slave's own document instead of the specification's
    """

    unit: int = 1
    fmt: Format = field(default_factory=lambda: Format(19200, "E", 1))
    functions: frozenset[int] = frozenset({1, 3, 5, 6, 15, 16})
    register: int = 0
    registers: int = 2
    values: tuple[int, int] = (0x1234, 0xA5C7)
    coil: int = 0
    coils: int = SEVERAL
    input: int = 0
    inputs: int = 2
    no_register: int = 0xFFF0
    no_coil: int = 0xFFF0
    no_input: int = 0xFFF0
    unknown: int = 0x2D
    own_codes: Mapping[str, int] = field(default_factory=dict)


# Why a slave refuses the request, and the tests of each reason: a slave may have a code of its own for it.
REASONS = {
    "function": ("AP-15",),
    "address": ("AP-5", "AP-6", "AP-14", "AP-25", "AP-26", "AP-27", "AP-32"),
    "length": ("AP-17", "AP-29", "AP-30"),
    "value": ("AP-11",),
    "quantity": ("AP-4", "AP-7", "AP-8", "AP-13", "AP-31"),
}


def own_codes(by_reason: Mapping[str, int]) -> dict[str, int]:
    """The exception code of each test, from that of each reason."""
    return {number: code for reason, code in by_reason.items() for number in REASONS[reason]}


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

    def any_of(self, *functions: int) -> list[int]:
        """Those of the functions that the slave has."""
        found = [function for function in functions if function in self.profile.functions]
        if not found:
            raise Missing(f"no function {' or '.join(map(str, functions))}")
        return found

    def first(self, kind: Kind) -> int:
        return getattr(self.profile, kind.name)

    def count(self, kind: Kind) -> int:
        return getattr(self.profile, f"{kind.name}s")

    def none(self, kind: Kind) -> int:
        """An address without one."""
        return getattr(self.profile, f"no_{kind.name}")

    def pair(self, kind: Kind) -> tuple:
        """Two values that differ."""
        return self.profile.values if kind is REGISTER else (True, False)

    def needs_count(self, kind: Kind, count: int) -> None:
        if self.count(kind) < count:
            raise Missing(f"needs {count} {kind.name}s to write, has {self.count(kind)}")

    @property
    def other(self) -> int:
        """Another unit, never broadcast."""
        return self.profile.unit % 247 + 1

    def write(self, value: int, place: int | None = None, function: int | None = None) -> bytes:
        """A write of one register or coil by the function; without one, of a register by any that it has."""
        function = function or self.any_of(6, 16)[0]
        if place is None:
            place = self.first(COIL if function in (COIL.one, COIL.several) else REGISTER)
        return WRITES[function](place, value if function in (REGISTER.one, COIL.one) else [value])

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
        if adu.function != self._function:
            codes = f"exception {' '.join(map(str, adu.pdu[1:]))}"
            raise Fault(f"{codes if adu.is_exception else f'function {adu.function}'} in the reply to {what}")
        return adu.pdu

    def _reply(self, heard: Heard, what: str) -> rtu.Adu:
        """Any whole reply of the slave."""
        try:
            adu = rtu.parse(heard.data)
        except ValueError:
            wrong = f"a reply with a wrong CRC: {heard.data.hex(' ')}"
            raise Fault(wrong if heard.data else f"no reply to {what}") from None
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

    def set(self, value: int, place: int | None = None, function: int | None = None) -> Dialogue:
        pdu = self.write(value, place, function)
        self.equal((yield from self.ask(pdu)), pdu[:5], "a write")

    def set_all(self, kind: Kind, values: Sequence[int], first: int | None = None) -> Dialogue:
        """Writes all at once, or one by one where the slave cannot."""
        first = self.first(kind) if first is None else first
        if kind.several in self.profile.functions:
            pdus = [WRITES[kind.several](first, list(values))]
        else:
            self.needs(kind.one)
            pdus = [self.write(value, first + n, kind.one) for n, value in enumerate(values)]
        for pdu in pdus:
            self.equal((yield from self.ask(pdu)), pdu[:5], f"a write of {kind.name}s")

    def hold(self, kind: Kind, values: Sequence[int], what: str, first: int | None = None) -> Dialogue:
        """Reads all of them in one request."""
        self.needs(kind.read)
        first = self.first(kind) if first is None else first
        due = bytes([kind.read]) + WRITES[kind.several](first, list(values))[5:]
        found = self.good((yield from self.ask(read(kind.read, first, len(values)))), "a read")
        if found == due:
            return
        if kind is REGISTER and len(found) == len(due) == 4:
            held = int.from_bytes(found[2:], "big")
            raise Fault(f"{what}: the register holds {held} instead of {values[0]}")
        raise Fault(f"{kind.read:02} {what}: {found.hex(' ')} instead of {due.hex(' ')}")

    def reads(self, function: int, first: int, count: int) -> Dialogue:
        """One and several: the length, and 0 in the bits that nobody asked for."""
        for n in {1, min(count, SEVERAL)}:
            found = self.good((yield from self.ask(read(function, first, n))))
            bits = function in (1, 2)
            size = (n + 7) // 8 if bits else 2 * n
            beyond = bits and int.from_bytes(found[2:], "little") >> n
            if found[:2] != bytes([function, size]) or len(found) != 2 + size or beyond:
                raise Fault(f"{function:02} of {n}: {found.hex(' ')}")

    def refused(self, pdu: bytes, code: int, what: str, silence: bool = False) -> Dialogue:
        """A request that must get an exception with this code. silence: no reply is right, too."""
        heard = yield from self.ask(pdu)
        if silence and not heard.data:
            return
        adu = self._reply(heard, what)
        if adu.function != pdu[0] | 0x80 or len(adu.pdu) != 2:
            raise Fault(f"{what}: {adu.pdu.hex(' ')} instead of {pdu[0] | 0x80:02x} {code:02x}")
        if adu.exception_code == code:
            return
        if adu.exception_code != self.own_code:
            raise Fault(f"{what}: exception {adu.exception_code} instead of {code}")
        self.own_codes.append(f"{adu.exception_code} instead of {code}")

    def serves(self, pdu: bytes) -> Dialogue:
        """Whether a request gets a normal reply and no exception."""
        adu = self._reply((yield from self.ask(pdu)), "a request")
        return not (adu.is_exception and len(adu.pdu) == 2)

    def without_effect(self, send: Send, what: str) -> Dialogue:
        """A write that must not be obeyed: no reply comes, and the register keeps its value."""
        yield from self.set(self.profile.values[0])
        self.silent((yield send), what)
        yield from self.hold(REGISTER, self.profile.values[:1], f"after {what}")

    def refused_without_effect(
        self, kind: Kind, pdu: bytes, code: int, what: str, silence: bool = False
    ) -> Dialogue:
        """A write that must get an exception with this code: nothing changes."""
        most = 2 if kind is REGISTER else SEVERAL
        kept = [pattern(n, self.pair(kind)) for n in range(min(most, self.count(kind)))]
        yield from self.set_all(kind, kept)
        yield from self.refused(pdu, code, what, silence)
        yield from self.hold(kind, kept, f"after {what}")

    def still_answers(self, what: str, **how: object) -> Dialogue:
        self.good((yield from self.ask(self.read, **how)), f"a good request after {what}")


Dialogue = Generator[Send, Heard, object]


def read(function: int, first: int, count: int) -> bytes:
    """A read of registers, coils or inputs."""
    return bytes([function]) + rtu.read_coils(first, count)[1:]


def wrong_lengths(pdu: bytes) -> tuple[tuple[str, bytes], ...]:
    return ("one byte too many", pdu + b"\0"), ("one byte too few", pdu[:-1])


def pattern(place: int, pair: tuple) -> object:
    """One of two values for a place. The choice repeats with no period, so a shift by any distance shows."""
    return pair[place.bit_count() & 1]


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


def case(number: str, page: str, needs: str = BYTES, kind: Kind | None = None) -> Callable:
    """Reads a dialogue's docstring: bars divide what is sent, what must come and what must not come.

    One dialogue may be a test of registers and another of coils: its docstring names the fields of `kind`.
    """

    def add(dialogue: Callable[..., Dialogue]) -> Callable:
        text = " ".join((dialogue.__doc__ or "- | - | -").split())
        words = text.format(**vars(kind)) if kind else text
        of_kind = functools.partial(dialogue, k=kind) if kind else dialogue
        CASES.append(Case(number, page, *words.split(" | "), needs, of_kind))
        return dialogue

    return add


# ---------------------------------------------------------------- serial line: addresses and CRC


@case("SL-1", "SL 8")
def own_address(s: Session) -> Dialogue:
    """a read | a reply with its own address and a right CRC | another address, more bytes"""
    found = s.good((yield from s.ask(s.read)))
    if len(found) != (4 if s.read[0] == 3 else 3):
        raise Fault(f"a reply of another length: {found.hex(' ')}")


@case("SL-2", "SL 8, 10")
def other_units(s: Session) -> Dialogue:
    """a read for other units, also 247, 248 and 255 | silence | a reply"""
    for unit in (s.other, 247, 248, 255):
        if unit != s.profile.unit:
            s.silent((yield Send(rtu.build(unit, s.read))), f"a request for unit {unit}")
    yield from s.still_answers("requests for others")


@case("SL-3", "SL 8")
def others_writes(s: Session) -> Dialogue:
    """a write for another unit | silence; the register keeps its value | a change"""
    send = Send(rtu.build(s.other, s.write(s.profile.values[1])))
    yield from s.without_effect(send, "a write for another unit")


@case("SL-26", "SL 8", kind=COIL)
@case("SL-4", "SL 8", kind=REGISTER)
def broadcast_writes(s: Session, k: Kind) -> Dialogue:
    """a broadcast write by {one:02}, by {several:02} | the {name} changes | no change"""
    s.needs(k.read)
    for old, new in [s.pair(k)] if k is REGISTER else ((False, True), (True, False)):
        for function in s.any_of(k.one, k.several):
            yield from s.set_all(k, [old])
            yield Send(rtu.build(0, s.write(new, function=function)))
            yield from s.hold(k, [new], f"after a broadcast of {function:02}")


@case("SL-5", "SL 10")
def broadcast_is_silent(s: Session) -> Dialogue:
    """a broadcast write, a broadcast read, broadcasts of an unknown function and to no register | silence | a
    reply, an exception"""
    p = s.profile
    for what, pdu in (
        ("write", s.write(p.values[0])),
        ("read", s.read),
        ("of an unknown function", bytes([p.unknown, 0, 0, 0, 1])),
        ("to no register", s.write(p.values[0], p.no_register)),
    ):
        s.silent((yield Send(rtu.build(0, pdu))), f"a broadcast {what}")
        yield from s.still_answers(f"a broadcast {what}")


@case("SL-6", "SL 10, 15")
def wrong_crc(s: Session) -> Dialogue:
    """a write with each kind of wrong CRC | silence; no change | a reply, a change"""
    good = s.request(s.write(s.profile.values[1]))
    for what, bad in (
        ("a CRC with one wrong bit", good[:-1] + bytes([good[-1] ^ 0x80])),
        ("a CRC with a wrong low byte", good[:-2] + bytes([good[-2] ^ 1, good[-1]])),
        ("a CRC of 0", good[:-2] + b"\0\0"),
        ("a CRC with swapped bytes", good[:-2] + good[:-3:-1]),
        ("a damaged address", good[:3] + bytes([good[3] ^ 4]) + good[4:]),
        ("a damaged value", good[:-3] + bytes([good[-3] ^ 4]) + good[-2:]),
    ):
        if bad != good:
            yield from s.without_effect(Send(bad), what)


@case("SL-7", "SL 13")
def partial(s: Session) -> Dialogue:
    """five bytes of a request, a pause, a good request | one reply, to the good one | a reply to the part,
    silence after it"""
    s.silent((yield Send(s.request(s.read)[:5])), "a part of a request")
    yield from s.still_answers("a part of a request")


@case("SL-8", "SL 13")
def too_long(s: Session) -> Dialogue:
    """300 bytes with a right CRC, a pause, a good request | an exception or silence, then a reply | a normal
    reply to the first, silence to the good one"""
    pdu = bytes([16]) + s.profile.register.to_bytes(2, "big") + b"\0\x91\x22" + bytes(291)
    heard = yield Send(s.request(pdu))
    s.not_served(heard, 16, f"a frame of {len(pdu) + 3} bytes")
    yield from s.still_answers("a frame of 300 bytes")


@case("SL-9", "SL 8, 14")
def foreign_traffic(s: Session) -> Dialogue:
    """request and reply of another unit, a good request | one reply, to the good one | a reply to the traffic
    of others"""
    other = s.other
    s.silent((yield Send(rtu.build(other, rtu.read_registers(0, 4)))), "another unit's request")
    s.silent((yield Send(rtu.build(other, bytes([3, 8, *range(8)])))), "another unit's reply")
    yield from s.still_answers("another unit's traffic")


@case("SL-10", "SL 14")
def noise(s: Session) -> Dialogue:
    """one noise byte, a pause, a good request | one reply, to the good one | a lost request"""
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


@case("SL-11", "SL 13", EDGES)
def legal_gaps(s: Session) -> Dialogue:
    """a good request with a gap of 1.3 characters after each byte | a reply | silence"""
    gap = t15_bits(s) * short(s) * 1.3 / 1.5
    frame = s.request(s.read)
    flaws = Flaws(gaps=dict.fromkeys(range(1, len(frame)), gap))
    s.good((yield Send(frame, flaws)), f"a request with gaps of {gap:.1f} bits")


@case("SL-12", "SL 13", EDGES)
def long_gap(s: Session) -> Dialogue:
    """a write with one gap of 2.2 characters | silence; no change | a reply, a change"""
    frame = s.request(s.write(s.profile.values[1]))
    gap = t15_bits(s) * 2.2 / 1.5
    for place in (1, 4, len(frame) - 1):
        send = Send(frame, Flaws(gaps={place: gap}))
        yield from s.without_effect(send, f"a gap of {gap:.1f} bits before byte {place + 1}")


@case("SL-13", "SL 13, 14", EDGES)
def shortest_pause(s: Session) -> Dialogue:
    """a frame for another unit, 3.5 characters and a bit, a good request | a reply | silence"""
    yield Send(rtu.build(s.other, s.read), wait=False)
    yield from s.still_answers("3.5 characters and a bit", pause_bits=t35_bits(s) + 1)


@case("SL-14", "SL 13, 14", EDGES)
def pause_too_short(s: Session) -> Dialogue:
    """a frame for another unit, 2.5 characters, a write | silence; no change | a reply, a change"""
    yield from s.set(s.profile.values[0])
    yield Send(rtu.build(s.other, s.read), wait=False)
    pause = t35_bits(s) * short(s) * 2.5 / 3.5
    heard = yield Send(s.request(s.write(s.profile.values[1])), pause_bits=pause)
    s.silent(heard, f"a write {pause:.1f} bits after another frame")
    yield from s.hold(REGISTER, s.profile.values[:1], "after a write after a pause that is too short")


@case("SL-15", "SL 14", EDGES)
def revoked(s: Session) -> Dialogue:
    """a good write, and one more byte after 2.5 characters | silence; no change | a reply, a change"""
    frame = s.request(s.write(s.profile.values[1]))
    gap = t35_bits(s) * short(s) * 2.5 / 3.5
    send = Send(frame + b"\x55", Flaws(gaps={len(frame): gap}))
    yield from s.without_effect(send, "a write with a byte after it")


@case("SL-16", "SL 13", EDGES)
def reply_after_t35(s: Session) -> Dialogue:
    """a read, a write | a pause of 3.5 characters before each reply | an earlier reply"""
    allowed = 0.25 + t35_bits(s) * (1 - short(s))
    limits = Limits(rate=None, edge_bits=None, early_bits=allowed)
    for pdu in (s.read, s.write(s.profile.values[0])):
        s.judged((yield from s.ask(pdu)), limits, early=True)


@case("SL-17", "SL 13", EDGES)
def reply_without_gaps(s: Session) -> Dialogue:
    """a read | a reply without a gap of more than 1.5 characters | a longer gap"""
    limits = Limits(rate=None, edge_bits=None)
    count = min(s.profile.registers, SEVERAL)
    pdu = rtu.read_registers(s.profile.register, count) if 3 in s.profile.functions else s.read
    heard = yield from s.ask(pdu)
    s.judged(heard, limits)


# ---------------------------------------------------------------- serial line: characters


@case("SL-18", "SL 19", PARITY)
def wrong_parity(s: Session) -> Dialogue:
    """a write with one wrong parity bit, in each place | silence; no change | a reply, a change"""
    frame = s.request(s.write(s.profile.values[1]))
    for place in (0, 1, 4, len(frame) - 1):
        send = Send(frame, Flaws(bad_parity=(place,)))
        yield from s.without_effect(send, f"wrong parity in byte {place + 1}")


@case("SL-19", "SL 12", EDGES)
def low_stop_bit(s: Session) -> Dialogue:
    """a write with one low stop bit | silence; no change | a reply, a change"""
    frame = s.request(s.write(s.profile.values[1]))
    for place in (2, len(frame) - 2):
        # One idle bit more, so that the next start bit is an edge.
        send = Send(frame, Flaws(bad_stop=(place,), gaps={place + 1: 1.0}))
        yield from s.without_effect(send, f"a low stop bit in byte {place + 1}")


@case("SL-20", "SL 12", EDGES)
def own_characters(s: Session) -> Dialogue:
    """a read | parity and stop bits as set, 11 bits a character | other characters"""
    heard = yield from s.ask(s.read)
    s.judged(heard, Limits(rate=None))
    frame, fmt = heard.trace.frame(), s.profile.fmt
    starts = [
        (b.start_ps - a.start_ps) / fmt.bit_ps
        for a, b in zip(frame.characters, frame.characters[1:], strict=False)
    ]
    if min(starts) < CHARACTER - 0.25:
        raise Fault(f"characters of {min(starts):.1f} bits")


@case("SL-21", "SL 20", EDGES)
def own_rate(s: Session) -> Dialogue:
    """a read | a reply within 1 % of the rate | a larger error"""
    s.judged((yield from s.ask(s.read)), Limits(edge_bits=None))


@case("SL-22", "SL 20", EDGES)
def senders_rate(s: Session) -> Dialogue:
    """requests 2 % too fast and 2 % too slow, without gaps | replies | silence"""
    for ppm in (20_000, -20_000):
        for value in s.profile.values:
            heard = yield from s.ask(s.write(value), flaws=Flaws(ppm=ppm))
            s.good(heard, f"a write at {ppm / 10_000:+.0f} %")


@case("SL-23", "SL 14", EDGES)
def a_break(s: Session) -> Dialogue:
    """a break of 30 bits, a pause, a good request | one reply, to the good one | silence"""
    s.silent((yield Send(low_bits=30)), "a break")
    yield from s.still_answers("a break")


@case("SL-24", "SL 22", PINS)
def driver(s: Session) -> Dialogue:
    """a read | DE during the reply, at most 3.5 characters longer | a driver on the line outside"""
    limit = t35_bits(s)
    limits = Limits(rate=None, edge_bits=None, de_lead_bits=limit, de_lag_bits=limit)
    heard = yield from s.ask(s.read)
    s.judged(heard, limits, direction=True)
    if len(heard.pulses) != 1:
        raise Fault(f"DE rises {len(heard.pulses)} times")
    s.silent((heard := (yield Send(rtu.build(s.other, s.read)))), "another unit's request")
    if heard.pulses:
        raise Fault("DE rises after another unit's request")


@case("SL-25", "SL 13, 14", EDGES)
def after_own_reply(s: Session) -> Dialogue:
    """a read 3.5 characters and a bit after its own reply | a reply | silence"""
    s.good((yield from s.ask(s.read)))
    yield from s.still_answers("its own reply", pause_bits=t35_bits(s) + 1)


# ---------------------------------------------------------------- application: reads


@case("AP-1", "AP 15")
def reads_registers(s: Session) -> Dialogue:
    """03 of one register and of several | a byte count of 2 N and N registers | another length"""
    s.needs(3)
    yield from s.reads(3, s.profile.register, s.profile.registers)


@case("AP-9", "AP 11, 12")
def reads_coils(s: Session) -> Dialogue:
    """01 of one coil and of ten | the byte count; the bits beyond are 0 | another length"""
    s.needs(1)
    yield from s.reads(1, s.profile.coil, s.profile.coils)


@case("AP-4", "AP 15, 16", kind=REGISTER)
@case("AP-13", "AP 12", kind=COIL)
def read_quantity(s: Session, k: Kind) -> Dialogue:
    """{read:02} of 0 {name}s and of more than {most_read} | exception 3 | another code, silence"""
    s.needs(k.read)
    for count in (0, k.most_read + 1):
        yield from s.refused(read(k.read, s.first(k), count), 3, f"{k.read:02} of {count} {k.name}s")


@case("AP-5", "AP 48", kind=REGISTER)
@case("AP-14", "AP 12, 48", kind=COIL)
def read_address(s: Session, k: Kind) -> Dialogue:
    """{read:02} of a {name} that is not there, {read:02} beyond 65535 | exception 2 | another code,
    silence"""
    s.needs(k.read)
    for first, count in ((s.none(k), 1), (0xFFFF, 2)):
        yield from s.refused(read(k.read, first, count), 2, f"{k.read:02} of {first:04X}h")


# ---------------------------------------------------------------- application: writes


@case("AP-2", "AP 19", kind=REGISTER)
@case("AP-10", "AP 17", kind=COIL)
def writes_one(s: Session, k: Kind) -> Dialogue:
    """{one:02} of two values, then {read:02} | an echo of the request; the {name} holds the value | another
    reply"""
    s.needs(k.read, k.one)
    for value in s.pair(k):
        pdu = s.write(value, function=k.one)
        s.equal((yield from s.ask(pdu)), pdu, f"{k.one:02}")
        yield from s.hold(k, [value], f"after {k.one:02}")


@case("AP-3", "AP 30")
def writes_registers(s: Session) -> Dialogue:
    """16 of several registers, then 03 | function, address, quantity; all values | another reply"""
    s.needs(3, 16)
    for turn in (s.profile.values, s.profile.values[::-1]):
        values = [pattern(n, turn) for n in range(min(s.profile.registers, SEVERAL))]
        yield from s.set_all(REGISTER, values)
        yield from s.hold(REGISTER, values, "after 16")


@case("AP-12", "AP 29")
def writes_coils(s: Session) -> Dialogue:
    """15 of several coils, then 01 | function, address, quantity; all coils | another reply"""
    s.needs(1, 15)
    count = min(s.profile.coils, 3)
    for bits in ([True, False, True][:count], [False] * count):
        yield from s.set_all(COIL, bits)
        yield from s.hold(COIL, bits, "after 15")


@case("AP-6", "AP 19, 48", kind=REGISTER)
@case("AP-32", "AP 17, 29, 48", kind=COIL)
def write_address(s: Session, k: Kind) -> Dialogue:
    """{one:02} and {several:02} to a {name} that is not there | exception 2 | another code, silence, an
    echo"""
    for function in s.any_of(k.one, k.several):
        pdu = s.write(s.pair(k)[0], s.none(k), function)
        yield from s.refused(pdu, 2, f"{function:02} to no {k.name}")


@case("AP-7", "AP 30")
def byte_count(s: Session) -> Dialogue:
    """16 with a byte count that is not 2 N | exception 3; no change | another code, a change"""
    s.needs(3, 16)
    head, word = bytes([16]) + s.profile.register.to_bytes(2, "big"), s.profile.values[1].to_bytes(2, "big")
    for count, words in ((1, 2), (2, 1)):
        pdu, what = head + bytes([0, count, 2 * words]) + word * words, f"with {2 * words} bytes"
        yield from s.refused_without_effect(REGISTER, pdu, 3, f"16 of {count} registers {what}")


@case("AP-8", "AP 30")
def write_quantity(s: Session) -> Dialogue:
    """16 of 0, 124 and 129 registers | exception 3 (124: or silence); no change | another code, a change"""
    s.needs(3, 16)
    head, word = bytes([16]) + s.profile.register.to_bytes(2, "big"), s.profile.values[1].to_bytes(2, "big")
    # A frame of 124 registers has 257 bytes, and a slave may drop it for that. Of 129 the byte count, 258, is
    # 2 in one byte.
    for count, data in ((0, b"\0"), (124, b"\xf8" + word * 124), (129, b"\2" + word)):
        pdu, what = head + bytes([0, count]) + data, f"16 of {count} registers"
        yield from s.refused_without_effect(REGISTER, pdu, 3, what, silence=count == 124)


@case("AP-31", "AP 29")
def write_coil_quantity(s: Session) -> Dialogue:
    """15 of 0 and 1969 coils, 15 with a byte too many and too few for its coils | exception 3; no change |
    another code, a change"""
    s.needs(1, 15)
    head = bytes([15]) + s.profile.coil.to_bytes(2, "big")
    for count, size in ((0, 0), (COIL.most_written + 1, 247), (1, 2), (9, 1)):
        pdu = head + count.to_bytes(2, "big") + bytes([size]) + bytes(size)
        yield from s.refused_without_effect(COIL, pdu, 3, f"15 of {count} coils with {size} bytes")


@case("AP-11", "AP 17, 19")
def coil_value(s: Session) -> Dialogue:
    """05 with the value 1234h | exception 3; the coil keeps its state | another code, a change"""
    s.needs(1, 5)
    pdu = s.write(True, function=5)
    s.equal((yield from s.ask(pdu)), pdu, "05")
    yield from s.refused(pdu[:3] + b"\x12\x34", 3, "05 with 1234h")
    yield from s.hold(COIL, [True], "after it")


# ---------------------------------------------------------------- application: functions


@case("AP-15", "AP 9, 48")
def unknown_function(s: Session) -> Dialogue:
    """a function that it does not have | exception 1 with the function + 80h | another code, silence"""
    unknown = s.profile.unknown
    yield from s.refused(bytes([unknown, 0, 0, 0, 1]), 1, f"function {unknown}")
    yield from s.still_answers("an unknown function")


@case("AP-16", "AP 4")
def reserved_functions(s: Session) -> Dialogue:
    """function 0 and function 131 | an exception or silence | a normal reply"""
    for function in (0, 131):
        heard = yield from s.ask(bytes([function]) + s.read[1:])
        s.not_served(heard, function, f"function {function}")
    yield from s.still_answers("reserved functions")


@case("AP-17", "AP 48")
def wrong_length(s: Session) -> Dialogue:
    """01 and 03 with one byte too many and too few | exception 3 or silence | a normal reply"""
    for function in s.any_of(1, 3):
        first = s.profile.register if function == 3 else s.profile.coil
        for what, wrong in wrong_lengths(read(function, first, 1)):
            yield from s.refused(wrong, 3, f"{function:02} with {what}", silence=True)
            yield from s.still_answers("a wrong length")


@case("AP-29", "AP 48", kind=REGISTER)
@case("AP-30", "AP 48", kind=COIL)
def wrong_length_of_writes(s: Session, k: Kind) -> Dialogue:
    """{one:02} and {several:02} with one byte too many and too few | exception 3 or silence; no change | a
    normal reply, a change"""
    s.needs(k.read)
    for function in s.any_of(k.one, k.several):
        for what, wrong in wrong_lengths(s.write(s.pair(k)[1], function=function)):
            yield from s.refused_without_effect(k, wrong, 3, f"{function:02} with {what}", silence=True)


# ---------------------------------------------------------------- application: the right place and value


@case("AP-18", "AP 15, 19, 30", kind=REGISTER)
@case("AP-20", "AP 12, 17, 29", kind=COIL)
def neighbours(s: Session, k: Kind) -> Dialogue:
    """{one:02} and {several:02} to two neighbours, {read:02} of each | each has its own value | the value of
    the other"""
    s.needs(k.read)
    s.needs_count(k, 2)
    for function in s.any_of(k.one, k.several):
        for n, value in enumerate(s.pair(k)):
            yield from s.set(value, s.first(k) + n, function)
        for n, value in enumerate(s.pair(k)):
            yield from s.hold(k, [value], f"after {function:02} of two neighbours", s.first(k) + n)


@case("AP-19", "AP 15, 19, 30")
def whole_values(s: Session) -> Dialogue:
    """06 and 16 of a value above 255, 03 | the whole value | one byte of it"""
    s.needs(3)
    large = [value for value in s.profile.values if value > 255]
    if not large:
        raise Missing("no value above 255 to write")
    for function in s.any_of(6, 16):
        for value in large:
            yield from s.set(value, function=function)
            yield from s.hold(REGISTER, [value], f"after {function:02}")


@case("AP-21", "AP 17, 29")
def other_coils(s: Session) -> Dialogue:
    """05 of one coil and 15 of two among others, 01 of all | the others keep their states | a change of the
    others"""
    s.needs(1)
    s.needs_count(COIL, 4)
    first = s.profile.coil
    for function in s.any_of(5, 15):
        for on in (True, False):
            bits = [not on] * min(s.profile.coils, SEVERAL)
            yield from s.set_all(COIL, bits)
            written = [on] if function == 5 else [on, on]
            pdu = rtu.write_coil(first + 1, on) if function == 5 else rtu.write_coils(first + 1, written)
            s.equal((yield from s.ask(pdu)), pdu[:5], f"{function:02}")
            bits[1 : 1 + len(written)] = written
            yield from s.hold(COIL, bits, f"after {function:02} among others")


@case("AP-22", "AP 12, 29")
def more_than_a_byte(s: Session) -> Dialogue:
    """15 and 01 of ten coils, 01 from the second on | all coils | lost coils"""
    s.needs(1, 15)
    s.needs_count(COIL, 9)
    for pair in ((True, False), (False, True)):
        bits = [pattern(n, pair) for n in range(min(s.profile.coils, SEVERAL))]
        yield from s.set_all(COIL, bits)
        yield from s.hold(COIL, bits, "after 15")
        yield from s.hold(COIL, bits[1:], "from the second on", s.profile.coil + 1)


@case("AP-23", "AP 15, 30", kind=REGISTER)
@case("AP-24", "AP 12, 29", kind=COIL)
def most(s: Session, k: Kind) -> Dialogue:
    """{several:02} of {most_written} {name}s, {read:02} of {most_read} | all values | an exception, other
    values"""
    s.needs(k.read, k.several)
    s.needs_count(k, k.most_read)
    values = [pattern(n, s.pair(k)) for n in range(k.most_read)]
    for at in (0, k.most_written):
        yield from s.set_all(k, values[at : at + k.most_written], s.first(k) + at)
    yield from s.hold(k, values, f"of {k.most_read} {k.name}s")


# ---------------------------------------------------------------- application: the end of the map


@case("AP-25", "AP 48", kind=REGISTER)
@case("AP-27", "AP 48", kind=COIL)
def read_across_the_end(s: Session, k: Kind) -> Dialogue:
    """{read:02} across the last {name} | exception 2 | a normal reply, another code"""
    s.needs(k.read)
    last = s.none(k) - 1
    if not (yield from s.serves(read(k.read, last, 1))):
        raise Missing(f"{last:04X}h, the address before --no-{k.name}, is no {k.name}")
    yield from s.refused(read(k.read, last, 2), 2, f"{k.read:02} across the last {k.name}")


@case("AP-26", "AP 48", kind=REGISTER)
@case("AP-28", "AP 48", kind=COIL)
def write_across_the_end(s: Session, k: Kind) -> Dialogue:
    """{several:02} across the last {name} | exception 2; no change | another code, a change"""
    s.needs(k.read, k.several)
    if s.none(k) != s.first(k) + s.count(k):
        raise Missing(f"--no-{k.name} does not follow the last {k.name} to write")
    last, what = s.none(k) - 1, f"{k.several:02} across the last {k.name}"
    other, kept = s.pair(k)
    yield from s.set_all(k, [kept], last)
    yield from s.refused(WRITES[k.several](last, [other] * 2), 2, what)
    yield from s.hold(k, [kept], f"after a refused {what}", last)


# ---------------------------------------------------------------- application: inputs


@case("AP-33", "AP 13, 16")
def reads_inputs(s: Session) -> Dialogue:
    """02 and 04 of one input and of several | the byte count; 02: other bits are 0 | another length"""
    for function in s.any_of(2, 4):
        yield from s.reads(function, s.profile.input, s.profile.inputs)


@case("AP-34", "AP 13, 16")
def input_quantity(s: Session) -> Dialogue:
    """02 of 0 and 2001 inputs, 04 of 0 and 126 | exception 3 | another code, silence"""
    for function in s.any_of(2, 4):
        for count in (0, (COIL if function == 2 else REGISTER).most_read + 1):
            pdu = read(function, s.profile.input, count)
            yield from s.refused(pdu, 3, f"{function:02} of {count} inputs")


@case("AP-35", "AP 13, 16, 48")
def input_address(s: Session) -> Dialogue:
    """02 and 04 of an input that is not there | exception 2 | another code, silence"""
    for function in s.any_of(2, 4):
        yield from s.refused(read(function, s.profile.no_input, 1), 2, f"{function:02} of no input")


CASES.sort(key=lambda one: (one.number[:2] == "AP", int(one.number[3:])))
