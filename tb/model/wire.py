# SPDX-License-Identifier: Apache-2.0
"""The two lines seen from outside: frames and telegrams in the characters on them.

`NetworkReceiver` finds frames by silence (FRAME-1 ... FRAME-5), `DriveReceiver` telegrams by their form
(FC-8). Both are written from the rules. Where a rule leaves room (a silence within a quarter bit of its
limit) they raise Unclear. Unit of time: clocks, as floats.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from regs.generated.card_tables import DRIVE_BAUD, DRIVE_PAUSE_TICKS, TICKS_PER_BIT
from sw.rtu2fc.capture import FRAME_MAX, FRAME_MIN, FarCharacter, LineFormat
from tb.agents.crc16 import crc_good
from tb.model.fc_telegram import ADR, STX, TelegramError, bcc, is_broadcast, parse

LGE_MIN = 6  # ADR, PCD1, PCD2, BCC
# Silences this near to a limit in bits are unclear: a quarter bit (FRAME-1), plus the sampling of the pin in
# clocks.
UNSURE_BITS = 0.35
PAUSE_BITS = DRIVE_PAUSE_TICKS / TICKS_PER_BIT
# Longest rest in bits of a character that the card began to receive in its middle.
GARBLED_BITS = 12.0


class Unclear(Exception):
    """From the time `at` on, the rules allow more than one outcome."""

    def __init__(self, at: float, why: str) -> None:
        super().__init__(why)
        self.at = at


def drive_line(clk_hz: int) -> LineFormat:
    return LineFormat(DRIVE_BAUD, "8E1", clk_hz)


@dataclass(frozen=True)
class CardCharacter:
    """A character sent by the card."""

    start: int
    end: float
    byte: int
    good: bool


@dataclass
class Burst:
    """The characters that the card sent from driver on to driver off."""

    rise: int
    fall: int
    characters: list[CardCharacter]

    @property
    def data(self) -> bytes:
        return bytes(c.byte for c in self.characters)

    @property
    def start(self) -> int:
        return self.characters[0].start if self.characters else self.rise


def is_taken(adr: int) -> bool:
    """Whether a drive with the address of FC-2 accepts this ADR, in either format."""
    return adr in (ADR, ADR & 0x1F) or is_broadcast(adr)


def embedded(data: bytes) -> list[tuple[int, bytes]]:
    """Offset and bytes of every telegram for the drive in a byte stream.

    No receiver finds more telegrams: this search resynchronises at every byte and ignores gaps and parity.
    """
    found, at = [], 0
    while at < len(data):
        telegram = data[at : at + data[at + 1] + 2] if data[at] == STX and at + 1 < len(data) else b""
        try:
            good = is_taken(parse(telegram).adr)
        except TelegramError:
            good = False
        if good:
            found.append((at, telegram))
        at += len(telegram) if good else 1
    return found


def taken_by_a_drive(
    bursts: Iterable[Burst], line: LineFormat
) -> tuple[list[tuple[float, bytes]], list[bytes]]:
    """The telegrams that a drive could have accepted, with their times, and all other bytes of the card.

    A drive cannot see the card's driver. It reads bursts without a pause between them as one stream.
    """
    streams: list[list[Burst]] = []
    for burst in bursts:
        if streams and burst.rise - streams[-1][-1].fall < (PAUSE_BITS - 1) * line.bit:
            streams[-1].append(burst)
        else:
            streams.append([burst])
    telegrams, rest = [], []
    for stream in streams:
        characters = [character for burst in stream for character in burst.characters]
        data = bytes(character.byte for character in characters)
        good = embedded(data)
        for at, telegram in good:
            telegrams.append((float(characters[at].start if at else stream[0].rise), telegram))
        if not characters or sum(len(telegram) for _, telegram in good) < len(data):
            rest.append(data)
    return telegrams, rest


@dataclass
class NetworkFrame:
    """A good frame for this card. `end`: earliest end of its last stop bit."""

    data: bytes
    end: float
    broadcast: bool


@dataclass(frozen=True)
class NetworkEvent:
    """`start`: of a character; `candidate`, `revoke`, `commit`: of a good frame for this card (FRAME-6).

    A candidate comes after half a character of silence. A character before t1.5 continues its frame, without
    `revoke`.
    """

    at: float
    what: str
    frame: NetworkFrame | None = None
    slack: float = 0.0


def heard_around(
    far: Iterable[FarCharacter], own: Iterable[Burst], bit: float
) -> Iterator[tuple[float, object]]:
    """Traffic of one line in order: characters that the card receives (LINE-6, FC-10), ends of its bursts.

    The driver of the card may go off in the middle of a character. Such a character becomes a bad one with a
    long slack. So does a character close after it, because without a pause the receiver cannot find the right
    start bits.
    """
    garbled = GARBLED_BITS * bit
    garbled_until = -garbled
    items: list[tuple[float, object]] = [(burst.fall, burst) for burst in own]
    spans = [(burst.rise, burst.fall) for burst in own]
    for heard in far:
        deaf = next((fall for rise, fall in spans if rise < heard.end and heard.start < fall), None)
        if deaf is not None and heard.end <= deaf:
            continue
        if deaf is not None or heard.start < garbled_until + garbled:
            heard = FarCharacter(max(heard.start, deaf or 0.0), heard.end, 0, False, garbled)
        if heard.slack >= garbled:
            garbled_until = heard.end
        items.append((heard.start, heard))
    return iter(sorted(items, key=lambda item: item[0]))


@dataclass
class NetworkReceiver:
    """Finds frames in the characters on the network line."""

    line: LineFormat
    address: int
    strict_t15: bool = True
    state: str = "wait"  # wait, idle, frame, early, hold, suspect
    silent_from: float = 0.0
    slack: float = 0.0
    characters: list[FarCharacter] = field(default_factory=list)

    def events(self, far: Iterable[FarCharacter], own: Iterable[Burst]) -> Iterator[NetworkEvent]:
        """All events in order. Raises Unclear where the rules allow more than one."""
        for at, item in heard_around(far, own, self.line.bit):
            yield from self._silence(at)
            if isinstance(item, Burst):
                self.state, self.slack = "wait", 0.0
                self.silent_from = max(self.silent_from, item.fall)
            else:
                yield NetworkEvent(item.start, "start")
                yield from self._character(item)
                self.silent_from, self.slack = item.end, item.slack
        yield from self._silence(float("inf"))

    def _reached(self, until: float, bits: float) -> bool:
        """Whether the silence that ends at `until` reached a limit."""
        limit = self.silent_from + bits * self.line.bit
        unsure = UNSURE_BITS * self.line.bit + self.slack
        if limit - unsure < until < limit + unsure:
            raise Unclear(
                self.silent_from, f"a silence of {(until - self.silent_from) / self.line.bit:.2f} bits"
            )
        return until > limit

    def _silence(self, until: float) -> Iterator[NetworkEvent]:
        half, t15, t35 = self.line.half_bits, self.line.t15_bits, self.line.t35_bits
        if self.state == "frame" and self._good() and self._reached(until, half):
            yield from self._event("candidate", self.silent_from + half * self.line.bit)
            self.state = "early"
        if self.state in ("frame", "early") and self._reached(until, t15):
            if self.state == "early":
                self.state = "hold"
            elif self.strict_t15:
                self.state = "suspect"
        if self.state != "idle" and self._reached(until, t35):
            if self.state == "hold":
                yield from self._event("commit", self.silent_from + t35 * self.line.bit)
            self.state = "idle"

    def _character(self, heard: FarCharacter) -> Iterator[NetworkEvent]:
        if self.state == "hold":
            yield from self._event("revoke", heard.end)
            self.state = "wait" if self.strict_t15 else "frame"
        elif self.state in ("idle", "suspect"):
            self.characters.clear()
            self.state = "frame"
        elif self.state == "early":
            self.state = "frame"
        if self.state == "frame":
            self.characters.append(heard)

    def _good(self) -> bool:
        fits = FRAME_MIN <= len(self.characters) <= FRAME_MAX
        return fits and all(c.good for c in self.characters) and crc_good(self._data())

    def _data(self) -> bytes:
        return bytes(c.byte for c in self.characters)

    def _event(self, what: str, at: float) -> Iterator[NetworkEvent]:
        data = self._data()
        if data[0] in (0, self.address):
            frame = NetworkFrame(data, self.characters[-1].end - self.slack, data[0] == 0)
            yield NetworkEvent(at, what, frame, self.slack)


@dataclass
class DriveReceiver:
    """Finds the drive's telegrams after a telegram of the card (FC-8)."""

    line: LineFormat
    adr: int
    state: str = "hunt"  # hunt, in, bad
    last_end: float = 0.0
    slack: float = 0.0
    deaf_until: float = 0.0  # the firmware is busy after a telegram that does not fit
    characters: list[FarCharacter] = field(default_factory=list)

    def hears(self, heard: FarCharacter) -> bytes | None:
        """Processes one more character; returns ADR and data of a complete, good telegram, else None."""
        if heard.start < self.deaf_until:
            raise Unclear(heard.start, "a character while the firmware checks a telegram")
        gap, bit = heard.start - self.last_end, self.line.bit
        if self.state != "hunt":
            unsure = UNSURE_BITS * bit + self.slack
            # The limit lies a quarter bit after the two characters.
            if abs(gap - (PAUSE_BITS + 0.25) * bit) < unsure:
                raise Unclear(heard.start, f"a gap of {gap / bit:.2f} bits on the drive line")
            if gap > PAUSE_BITS * bit:
                self.state = "hunt"
        self.last_end, self.slack = heard.end, heard.slack
        if self.state == "hunt" and heard.good and heard.byte == STX:
            self.state = "in"
            self.characters.clear()
        if self.state == "in":
            return self._more(heard)
        return None

    def _more(self, heard: FarCharacter) -> bytes | None:
        self.characters.append(heard)
        data = bytes(c.byte for c in self.characters)
        count = len(data)
        if not heard.good or (count == 2 and data[1] < LGE_MIN) or (count == 3 and data[2] != self.adr):
            self.state = "bad"
        elif count > 2 and count == data[1] + 2:
            self.state = "bad"
            if bcc(data) == 0 and self._in_time(count):
                self.state = "hunt"
                return data[2:-1]
        return None

    def _in_time(self, count: int) -> bool:
        took = self.characters[-1].end - self.characters[0].start
        limit = 1.5 * self.line.character_bits * count * self.line.bit
        if abs(took - limit) < 1.5 * self.line.bit:
            raise Unclear(self.characters[-1].end, "a telegram at 1.5 times its nominal time")
        return took < limit
