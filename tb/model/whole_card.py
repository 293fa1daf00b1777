# SPDX-License-Identifier: Apache-2.0
"""The whole card as a black box with two lines: what it may send, when, and what it must send.

`LineJudge` gets everything sent on both lines and reports where the card broke a rule. `card.CardModel` gives
the content, `wire` the framing. This module adds the commit (FRAME-6) and the one reply (FRAME-7, FRAME-8).
It also adds the exchange with the drive, its repeat and its end (FC-8, FC-9), and which request is served.

While an exchange runs, a committed write of coils waits as the control image, which leaves before all else as
it is then. Committed parameter writes wait, too, and leave in the order of commit (FRAME-7). Where the rules
allow a choice, the judge accepts any allowed one and continues from it. A reading's telegram that a newer
request overtakes before its start may be sent or not. A drive's reply within a few ms of the end of its wait
may count or not. Unit of time: clocks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from tb.agents.crc16 import crc_good, with_crc
from tb.model import fc_telegram
from tb.model.card import DRIVE_TIMEOUT, READS, STATUS, CardModel, Question, Step, without_counts
from tb.model.wire import (
    GARBLED_BITS,
    PAUSE_BITS,
    UNSURE_BITS,
    Burst,
    DriveReceiver,
    FarCharacter,
    LineFormat,
    NetworkEvent,
    NetworkFrame,
    NetworkReceiver,
    Unclear,
    drive_line,
    heard_around,
)

# The card cannot have seen a character that began less than so many clocks before the card's own.
SYNC_CLOCKS = 4
# A receiver samples the last bit in the middle of the stop bit: half a bit before the end, and a margin.
STOP_BITS = 0.6
# Allowances in ms: for the firmware's clock (ticks of 1/1200 s), and for the last character of a reply that
# the firmware still waits for.
TICK_MS, LAST_CHARACTER_MS = 2.2, 4.5
# A reading's telegram that a newer request overtakes may leave or not, from this long after it was queued on.
OVERTAKEN_MS = 6.0
# FC-9: in 10 ms, the longest wait for the drive while a newer committed request has a telegram that waits.
GIVE_UP = 15
NEVER = float("inf")


@dataclass
class Request:
    """A committed request and its allowed replies."""

    pdu: bytes
    broadcast: bool
    end: float  # of its last stop bit
    question: Question | None
    telegram: bytes = b""
    answers: list[bytes] = field(default_factory=list)
    how: str = ""  # source of the reply, for the counters
    answer_from: float = NEVER
    answer_by: float = NEVER
    dropped: float | None = None  # time of a newer character on the line (FRAME-7)
    answered: bool = False
    overtaken: bool = False  # a reading, by a candidate, so its telegram may stay unsent
    waited: bool = False  # for the end of an exchange (FRAME-7)
    committed: float = NEVER
    replaced: Request | None = None  # the write whose place it took
    second_overtaken: bool = False  # a reading, by a candidate: only the newest gets its second telegram
    to_one: bool = False  # the image: one of the writes that it stands for was for this card alone

    @property
    def writes(self) -> bool:
        return self.pdu[0] not in READS

    @property
    def kind(self) -> str:
        """A newer one of the same kind takes its place."""
        if self.pdu[0] in (0x05, 0x0F):
            return "image"
        return "read" if not self.writes else "write to all" if self.broadcast else "write"

    @property
    def to_all(self) -> bool:
        return self.broadcast and not self.to_one


@dataclass
class Exchange:
    """A telegram on its way: `line` until it starts, then `wait` for the drive."""

    request: Request
    queued_from: float
    queued_by: float
    phase: str = "line"
    sends: int = 0
    end: float = 0.0
    waits: tuple[int, int] = (0, 0)  # smallest and largest register 40003 since the telegram
    wanted: float = NEVER  # when a newer request with a telegram was committed (FC-9)
    overtaken: bool = False
    settled: float = NEVER  # when the overtaking request was committed or revoked
    superseded: float = NEVER  # when a newer request was committed; no repeat after that (FC-9)
    given_up: bool = False  # perhaps, for a reading that still waited as the wait ended (FC-9)
    receiver: DriveReceiver | None = None
    held: float = 0.0  # clocks for which a telegram after it, dropped since, may wait for a busy line
    held_before: float = 0.0  # of the exchange before: this one gives up so much later, on a busy line alone


@dataclass
class Verdict:
    differences: list[str] = field(default_factory=list)
    counts: Counter = field(default_factory=Counter)
    unclear: str = ""  # reason why the check stopped early
    until: float = NEVER  # end of the checked time in clocks
    worst: dict[str, float] = field(default_factory=dict)  # clocks


class Difference(Exception):
    """The card broke a rule."""


@dataclass
class LineJudge:
    """`budget`: largest time in clocks from a frame or a drive's reply to the firmware's own reply."""

    card: CardModel
    line: LineFormat
    address: int
    budget: float
    strict_t15: bool = True

    def __post_init__(self) -> None:
        self.drive = drive_line(self.line.clk_hz)
        self.ms = self.line.clk_hz / 1000
        self.verdict = Verdict()
        self.newest: Request | None = None
        self.queue: list[Request] = []  # their telegrams wait for the end of the exchange, in this order
        self.exchange: Exchange | None = None
        self.candidate_at = 0.0
        self.pending = False  # the candidate is neither committed nor revoked
        self.status_changed = -NEVER
        self.status_before = [0] * len(STATUS)
        self.dropped: Request | None = None  # the last reading that lost its place
        self.dropped_at = -NEVER
        self.overtaking: list[float] = []  # times of all candidates and commits
        self.doubtful = False
        self.status_doubts: list[list[int]] = []  # status images if late replies of the drive do not count
        # The firmware starts with the candidate and may send from t3.5, so only its time beyond t3.5 shows.
        ahead = (self.line.t35_bits - self.line.half_bits) * self.line.bit
        self.late = max(0.0, self.budget - ahead) + 1.3 * self.line.bit

    # ------------------------------------------------------------ all events in order

    def evaluate(
        self,
        network: Sequence[FarCharacter],
        drive: Sequence[FarCharacter],
        replies: Sequence[Burst],
        telegrams: Sequence[Burst],
        until: float,
    ) -> Verdict:
        self.replies, self.telegrams, self.from_drive = replies, telegrams, drive
        # Start, earliest end and latest end of everything on the drive line.
        self.busy = [(h.start, h.end, h.end + h.slack) for h in drive]
        self.busy += [(float(b.rise), float(b.fall), float(b.fall)) for b in telegrams]
        items = [*self._network(network), *self._drive(drive)]
        items += [(burst.rise, 1, self._reply, burst) for burst in replies]
        items += [(burst.rise, 1, self._telegram, burst) for burst in telegrams]
        items.sort(key=lambda item: item[:2])
        try:
            for at, _, handle, item in items:
                if at > until:
                    break
                self.verdict.until = at
                self._advance(at)
                handle(item)
            self._advance(until)
            self.verdict.until = until
        except Unclear as unclear:
            self.verdict.unclear = str(unclear)
        except Difference as difference:
            self.verdict.differences.append(str(difference))
        return self.verdict

    def _network(self, heard: Iterable[FarCharacter]) -> list[tuple]:
        unsure = UNSURE_BITS * self.line.bit
        found: list[tuple] = []
        try:
            for event in NetworkReceiver(self.line, self.address, self.strict_t15).events(
                heard, self.replies
            ):
                early = unsure + event.slack if event.what in ("candidate", "commit") else 0.0
                if event.what in ("candidate", "commit"):
                    self.overtaking.append(event.at - early)
                found.append((event.at - early, 0, self._heard, event))
        except Unclear as unclear:
            found.append((unclear.at, 2, self._raise, unclear))
        return found

    def _drive(self, heard: Iterable[FarCharacter]) -> list[tuple]:
        around = heard_around(heard, self.telegrams, self.drive.bit)
        early = STOP_BITS * self.drive.bit
        return [(h.end - early, 0, self._from_drive, h) for _, h in around if isinstance(h, FarCharacter)]

    def _raise(self, unclear: Unclear) -> None:
        raise unclear

    def _count(self, what: str) -> None:
        self.verdict.counts[what] += 1

    def _measure(self, what: str, clocks: float) -> None:
        self.verdict.worst[what] = max(clocks, self.verdict.worst.get(what, -NEVER))

    def _fail(self, at: float, what: str) -> None:
        raise Difference(f"at {at:.0f} clocks ({at / self.ms:.3f} ms): {what}")

    # ------------------------------------------------------------ the network line

    def _heard(self, event: NetworkEvent) -> None:
        if event.what == "start":
            if self.newest and not self.newest.answered and self.newest.dropped is None:
                self.newest.dropped = event.at
                if not self.newest.broadcast and (self.newest.answers or self.newest.telegram):
                    self._count("reply dropped (FRAME-7)")
            return
        self._count(event.what)
        if event.what == "candidate":
            self.candidate_at, self.pending = event.at, True
            for request in self.queue:
                request.overtaken = not self._keeps_place(request)
                request.second_overtaken = True
            if self.exchange:
                self.exchange.request.second_overtaken = True
                if self._is_repeat_of_a_write(self.exchange):
                    self.exchange.queued_by = NEVER  # a commit of its kind makes the card order it anew
                if not self._keeps_place(self.exchange.request):
                    self.exchange.overtaken, self.exchange.settled = True, NEVER
                if self.exchange.phase == "wait" and event.at + self.budget < self._wait_from(self.exchange):
                    self.exchange.wanted = self._still_wanted(self.exchange)
        else:
            self.pending = False
            if self.exchange and self.exchange.overtaken:
                self.exchange.settled = event.at
            if self.exchange and self.exchange.queued_by == NEVER:
                self.exchange.queued_by = event.at + event.slack + self.late
        if event.what == "commit":
            if self._next_was_queued(event.at):
                self._after_wait(self.exchange, event.at)
            if self.exchange:
                self.exchange.superseded = min(
                    self.exchange.superseded, event.at + event.slack + UNSURE_BITS * self.line.bit
                )
            self._commit(event.frame, event.at)
            if self.exchange and self._repeat_is_held(self.exchange):
                self.exchange.overtaken, self.exchange.settled = True, event.at

    def _keeps_place(self, request: Request) -> bool:
        return request.writes

    def _newer(self, exchange: Exchange) -> list[Request]:
        return [one for one in self.queue if one.committed > exchange.request.committed]

    def _is_repeat_of_a_write(self, exchange: Exchange) -> bool:
        return exchange.phase == "line" and exchange.sends == 1 and self._keeps_place(exchange.request)

    def _was_abandoned(self, exchange: Exchange, burst: Burst) -> bool:
        """The line was busy for the whole wait, and this is the telegram of the next request.

        A write that has not left keeps its turn (FRAME-7).
        """
        next_one = self.queue and burst.data == self.queue[0].telegram != exchange.request.telegram
        may_go = exchange.sends == 1 or not self._keeps_place(exchange.request)
        over = may_go and exchange.phase == "line" and burst.rise >= self._abandoned_from(exchange)
        return bool(next_one and over)

    def _of_which_the_older_one_left(self, exchange: Exchange, data: bytes) -> Request | None:
        """The newer write, if the older one left all the same: the line became free just then."""
        if exchange.sends > 0:
            return None
        for newer in (exchange.request, *self.queue):
            older = newer.replaced
            just_then = exchange.queued_from - newer.committed < self.late
            if older is None or not just_then or data != older.telegram:
                continue
            if data == exchange.request.telegram:
                raise Unclear(exchange.queued_from, "a telegram that fits either of two requests")
            return newer
        return None

    def _left_as_it_was_dropped(self, exchange: Exchange, data: bytes, at: float) -> bool:
        """The drive line became free while the firmware still looked at the request that drops this reading.

        The reading had taken the line over from the request before it, which never left.
        """
        dropped = self.dropped
        return (
            dropped is not None
            and at <= self.dropped_at + self.late
            and exchange.phase == "line"
            and exchange.overtaken
            and data == dropped.telegram
            and data not in (exchange.request.telegram, *(request.telegram for request in self.queue))
        )

    def _next_was_queued(self, at: float) -> bool:
        """The wait ended before this commit, while the drive sent: the next telegram is queued already.

        The card need not have given up: it may have taken what the drive sends. The next telegram tells.
        """
        exchange = self.exchange
        if not (exchange and exchange.phase == "wait" and self.queue and at >= self._wait_from(exchange)):
            return False
        left = next((burst for burst in self.telegrams if burst.rise > at), None)
        in_time = left is not None and left.rise <= self._starts_by(at + self.budget)
        return in_time and left.data == self.queue[0].telegram != exchange.request.telegram

    def _keeps_its_repeat(self, exchange: Exchange) -> bool:
        """A write is repeated after a newer request, unless that waits with a telegram (FC-9, FRAME-7)."""
        request = exchange.request
        return self._keeps_place(request) and not request.to_all and not self._newer(exchange)

    def _was_repeated_just_then(self, exchange: Exchange, burst: Burst) -> bool:
        """The firmware repeated a write before it saw the commit of a newer telegram.

        Or the newer one was a reading, and a candidate had taken its turn.
        """
        request = exchange.request
        kept = self._keeps_place(request) and not request.to_all
        newer = self._newer(exchange)
        in_time = all(one.overtaken or burst.rise <= one.committed + self.budget for one in newer)
        return kept and in_time and burst.data == request.telegram

    def _repeat_is_held(self, exchange: Exchange) -> bool:
        """A repeat that waits for a free line is not sent after a newer request (FC-9)."""
        return exchange.phase == "line" and exchange.sends == 1 and not self._keeps_its_repeat(exchange)

    def _wait_behind(self, exchange: Exchange, request: Request, at: float) -> None:
        """A newer write takes the place of an older one of its kind; a reading waits for nothing newer."""
        kept = [older for older in self.queue if self._keeps_place(older)]
        same = [older for older in kept if older.kind == request.kind]
        self.queue = [older for older in kept if older not in same]
        request.replaced = same[0] if same else None
        request.waited = True
        if request.kind != "image":
            self.queue.append(request)
        else:
            self._join(request, same)
            self.queue.insert(0, request)
        if exchange.phase == "line" and exchange.sends == 0:
            if request.kind == "image":
                self._image_first(exchange, request, at)
            elif request.kind == exchange.request.kind != "read":
                request.replaced = exchange.request
                self._start(self.queue.pop(0), max(exchange.queued_from, at), at + self.late)
        if self.exchange is exchange:
            exchange.wanted = min(exchange.wanted, at)

    def _join(self, image: Request, older: list[Request]) -> None:
        """One telegram tells the drive all changes of the image. It goes to all only if each of them does."""
        image.to_one = not image.broadcast or any(one.to_one or not one.broadcast for one in older)
        if image.broadcast:  # if it goes to the drive's own address, that confirms it, and nobody is answered
            image.question = Question(image.pdu[0], 0, 0, "process") if image.to_one else None
        adr = fc_telegram.ADR if image.to_one else fc_telegram.ADR_BROADCAST
        image.telegram = fc_telegram.build(image.telegram[3:-1], adr=adr)

    def _image_first(self, exchange: Exchange, image: Request, at: float) -> None:
        """The telegram that waits for the line gives way to the image; it may have left just before that."""
        before = exchange.request
        self.queue.remove(image)
        if before.kind == "image":
            self._join(image, [before])
        elif before.writes:
            self.queue.insert(0, before)
        image.replaced = before
        self._start(image, max(exchange.queued_from, at), at + self.late)

    def _commit(self, frame: NetworkFrame, at: float) -> None:
        pdu = frame.data[1:-2]
        step = self.card.request(pdu, frame.broadcast)
        if self.exchange:
            low, high = self.exchange.waits
            now = self.card.registers[DRIVE_TIMEOUT]
            self.exchange.waits = min(low, now), max(high, now)
        request = Request(pdu, frame.broadcast, frame.end, self.card.question, committed=at)
        self.newest = request
        exchange = self.exchange
        if gone := [older for older in self.queue if not self._keeps_place(older)]:
            self.dropped, self.dropped_at = gone[-1], at
            self.queue = [older for older in self.queue if self._keeps_place(older)]
            if exchange.phase == "wait" and at >= self._wait_from(exchange):
                exchange.given_up = self.candidate_at + self.budget >= self._wait_from(exchange)
                # The wait ended before, and the dropped reading holds a busy line for as long again.
                exchange.held = self._ms(min(exchange.waits[1], GIVE_UP)) + TICK_MS * self.ms + self.budget
        if step.reply is not None:
            self._answer(request, "local reply", step.reply, at, at + self.late)
            if self.status_changed > self.candidate_at - self.budget:
                self._allow_status(request, self.status_before)
            for status in self.status_doubts:
                self._allow_status(request, status)
        if step.telegram is not None:
            request.telegram = self._built(step.telegram)
            if self.exchange is None:
                self._start(request, at, at + self.late)
            else:
                self._wait_behind(self.exchange, request, at)

    def _answer(self, request: Request, how: str, pdu: bytes, at: float, by: float) -> None:
        request.how = how
        request.answers = [with_crc(bytes([self.address]) + pdu)]
        request.answer_from, request.answer_by = at, by

    def _allow_status(self, request: Request, status: list[int]) -> None:
        """Allows an older status image in a read that races with a drive's reply (FC-6)."""
        if request.pdu[0] != 0x01 or not request.answers or request.answered:
            return
        now = self.card.coils[STATUS.start : STATUS.stop]
        self.card.coils[STATUS.start : STATUS.stop] = status
        reply = self.card.request(request.pdu).reply
        self.card.coils[STATUS.start : STATUS.stop] = now
        self.card.question = request.question
        if reply is not None:
            request.answers.append(with_crc(bytes([self.address]) + reply))

    def _reply(self, burst: Burst) -> None:
        request, data = self.newest, burst.data
        if request and request in self.queue and not request.answers:
            self._finish_exchange_before(burst.rise)
        exchange = self.exchange
        held_up = exchange and exchange.phase == "line" and request in self.queue
        waits = exchange and (exchange.request is request or held_up) and not request.answers
        if waits and burst.rise >= self._abandoned_from(exchange):
            self._check_line_was_busy(exchange, burst.rise)
            self._abandon(exchange, burst.rise)
        if request is None or request.broadcast or request.answered or not request.answers:
            self._fail(burst.rise, f"reply {data.hex(' ')} without a request")
        self._shape(burst, self.line, "reply")
        if request.dropped is not None and request.dropped < burst.rise - SYNC_CLOCKS:
            self._fail(burst.rise, f"reply {data.hex(' ')} after a newer character (FRAME-7)")
        counts_aside = [without_counts(answer[1:-2]) for answer in request.answers]
        if data not in request.answers and not (
            crc_good(data) and without_counts(data[1:-2]) in counts_aside
        ):
            wanted = " or ".join(answer.hex(" ") for answer in request.answers)
            self._fail(burst.rise, f"reply {data.hex(' ')}, expected {wanted}, to {request.pdu.hex(' ')}")
        earliest = request.end + (self.line.t35_bits - UNSURE_BITS) * self.line.bit
        if burst.start < max(earliest, request.answer_from - self.line.bit):
            self._fail(burst.start, f"reply {data.hex(' ')} too early (FRAME-8)")
        if burst.start > request.answer_by:
            late = burst.start - request.answer_by
            self._fail(burst.start, f"reply {data.hex(' ')} {late:.0f} clocks after its latest time (PERF)")
        if self.status_doubts and request.pdu[0] == 0x01 and len(set(request.answers)) > 1:
            doubts = request.answers[-len(self.status_doubts) :]
            if data != request.answers[0] and data in doubts:
                self.card.coils[STATUS.start : STATUS.stop] = self.status_doubts[doubts.index(data)]
            self.status_doubts = []
        request.answered = True
        self._measure(request.how, burst.start - request.answer_from)
        self._count(f"exception {data[2]}" if data[1] & 0x80 else f"function {data[1]:02X} answered")

    def _shape(self, burst: Burst, line: LineFormat, what: str) -> None:
        """Checks characters, gaps and driver (LINE-6, FC-8, FC-10)."""
        shown = burst.data.hex(" ")
        if not burst.characters or not all(c.good for c in burst.characters):
            self._fail(burst.rise, f"{what} {shown}: a damaged character")
        if burst.start - burst.rise > line.bit:
            self._fail(burst.rise, f"{what} {shown}: driver on too early")
        if not -0.2 * line.bit <= burst.fall - burst.characters[-1].end <= line.bit:
            self._fail(burst.fall, f"{what} {shown}: driver off at the wrong time")
        for before, after in zip(burst.characters, burst.characters[1:], strict=False):
            if after.start - before.end > 0.2 * line.bit:
                self._fail(after.start, f"{what} {shown}: a gap")

    # ------------------------------------------------------------ the drive line

    def _built(self, telegram: bytes) -> bytes:
        return fc_telegram.build(telegram[1:], adr=telegram[0])

    def _start(self, request: Request, at: float, by: float) -> None:
        wait = self.card.registers[DRIVE_TIMEOUT]
        self.exchange = Exchange(request, at, by, waits=(wait, wait), overtaken=request.overtaken)
        if request.overtaken:
            self.exchange.settled = at
        if self._newer(self.exchange):  # committed before this telegram could leave
            self.exchange.wanted = self.exchange.superseded = at

    def _ms(self, tens: int) -> float:
        return 10 * tens * self.ms

    def _wait_from(self, exchange: Exchange) -> float:
        alone = exchange.end + self._ms(exchange.waits[0])
        wanted = max(exchange.end + self._ms(GIVE_UP), exchange.wanted)
        return min(alone, wanted) - 0.2 * self.ms

    def _abandoned_from(self, exchange: Exchange) -> float:
        """The earliest time at which the master may get the reply that the drive is silent."""
        if exchange.phase == "line":
            return exchange.queued_from + self._line_wait(self._least(exchange))
        if exchange.sends == 2 or exchange.superseded < NEVER:
            return self._wait_from(exchange)
        # A drive still sending at the end of its wait can delay the repeat by as long again.
        return self._wait_from(exchange) + self._ms(self._least(exchange))

    def _line_wait(self, tens: int) -> float:
        """Least wait for a free line after the commit, in clocks.

        The firmware counts from the round that queued the telegram, and this began before the commit. No rule
        gives this wait: FC-9 counts from a telegram that was sent.
        """
        return max(0.0, self._ms(tens) - 0.2 * self.ms - self.budget)

    def _least(self, exchange: Exchange) -> int:
        return exchange.waits[0] if exchange.wanted == NEVER else min(exchange.waits[0], GIVE_UP)

    def _finish_exchange_before(self, at: float) -> None:
        """The newest request is being answered, so the exchange before it must be over."""
        exchange = self.exchange
        if exchange.phase == "wait" and at >= self._wait_from(exchange):
            self._after_wait(exchange, at)
        if self.queue and exchange.phase == "line" and exchange.overtaken:
            self._start(self.queue.pop(0), exchange.queued_from, at)

    def _check_line_was_busy(self, exchange: Exchange, at: float) -> None:
        """Checks an exchange abandoned before its telegram left: the line must have been busy until then."""
        if exchange.phase == "line" or exchange.sends == 1:
            start_by = self._starts_by(at - self._line_wait(self._least(exchange)))
            if start_by < at:
                wanted = exchange.request.telegram.hex(" ")
                self._fail(start_by, f"no telegram on a free line; expected {wanted}")

    def _wait_by(self, exchange: Exchange) -> float:
        slowest = (TICK_MS + LAST_CHARACTER_MS) * self.ms + self.budget
        alone = exchange.end + self._ms(exchange.waits[1])
        wanted = max(exchange.end + self._ms(GIVE_UP), self._still_wanted(exchange))
        return min(alone, wanted) + slowest

    def _still_wanted(self, exchange: Exchange) -> float:
        """When the first newer request that surely waits was committed: an overtaken reading may not wait."""
        return min((one.committed for one in self._newer(exchange) if not one.overtaken), default=NEVER)

    def _quiet_at(self, at: float) -> float:
        """When the drive line will have been silent for two characters, as seen at `at`."""
        last = max((end for start, _, end in self.busy if start <= at), default=0.0)
        return last + (PAUSE_BITS + 0.25) * self.drive.bit

    def _is_garbled_until(self, end: float) -> bool:
        """Whether characters up to `end` follow one whose start bit the card missed while it sent (FC-10)."""
        for heard in reversed(self.from_drive):
            if heard.start >= end:
                continue
            if end - heard.end > self.drive.bit:
                return False
            if any(burst.rise < heard.start < burst.fall < heard.end for burst in self.telegrams):
                return True
            end = heard.start
        return False

    def _starts_by(self, queued: float) -> float:
        """Latest start of a telegram queued at `queued`; each character on the line delays it."""
        while (quiet := self._quiet_at(queued)) > queued:
            queued = quiet
        return queued + self.budget + 1.3 * self.drive.bit

    def _line_until(self, exchange: Exchange) -> float:
        """Latest start of a telegram that waits for the line."""
        most, queued_by = self._ms(exchange.waits[1]), exchange.queued_by + exchange.held_before
        most = min(most, max(self._ms(GIVE_UP), self._still_wanted(exchange) - queued_by))
        return queued_by + most + TICK_MS * self.ms + self.budget

    def _telegram(self, burst: Burst) -> None:
        data, exchange = burst.data, self.exchange
        waits = exchange and exchange.phase == "line"
        # A write that was given up leaves all the same, and then nobody gets its reply.
        given_up = waits and exchange.sends == 0 and exchange.request is self.newest and self.newest.writes
        held_up = given_up or (waits and self.newest in self.queue)
        mute = "silent" not in self.card.dialect.codes
        if held_up and mute and burst.rise >= self._abandoned_from(exchange):
            raise Unclear(burst.rise, "a wait for the line whose end a silent dialect does not show")
        if exchange and self._left_as_it_was_dropped(exchange, data, burst.rise):
            self._start(self.dropped, exchange.queued_from, burst.rise)
            exchange = self.exchange
            exchange.superseded = min(exchange.superseded, self.dropped_at)
        if exchange and exchange.phase == "wait" and burst.rise >= self._wait_from(exchange):
            self._after_wait(exchange, burst.rise, self._was_repeated_just_then(exchange, burst))
            exchange = self.exchange
        held = exchange and exchange.phase == "line" and exchange.overtaken
        repeats = exchange and exchange.sends == 1 and data == exchange.request.telegram
        may_repeat = not repeats or self._keeps_its_repeat(exchange)
        if held and not may_repeat and burst.rise > exchange.superseded and not self.queue:
            self._fail(burst.rise, f"telegram {data.hex(' ')} repeated after a newer request (FC-9)")
        same = self.queue and exchange and data == exchange.request.telegram == self.queue[0].telegram
        if held and same:
            raise Unclear(burst.rise, "a telegram that fits either of two requests")
        if held and self.queue and data != exchange.request.telegram:
            # The older telegram was withdrawn for the newer request.
            self._start(self.queue.pop(0), exchange.queued_from, burst.rise)
            exchange = self.exchange
        if exchange and self._was_abandoned(exchange, burst):
            self._abandon(exchange, burst.rise)
            exchange = self.exchange
        line = exchange and exchange.phase == "line"
        if line and (newer := self._of_which_the_older_one_left(exchange, data)):
            older = newer.replaced
            self.queue = [exchange.request, *(one for one in self.queue if one is not older)]
            if older.kind == newer.kind == "image":
                self._join(newer, [])  # it stands for itself alone
            self._start(older, exchange.queued_from, exchange.queued_by)
            exchange = self.exchange
        if exchange is None or exchange.phase != "line":
            self._fail(burst.rise, f"telegram {data.hex(' ')} without a request (SAFE-1)")
        self._shape(burst, self.drive, "telegram")
        if data != exchange.request.telegram:
            wanted = exchange.request.telegram.hex(" ")
            self._fail(burst.rise, f"telegram {data.hex(' ')}, expected {wanted}")
        pause = (PAUSE_BITS - UNSURE_BITS) * self.drive.bit
        early = burst.rise - SYNC_CLOCKS
        before = max((end for start, end, _ in self.busy if start < early), default=0.0)
        if burst.rise < before + pause:
            if self._is_garbled_until(before):
                raise Unclear(
                    burst.rise, "a pause after a character of the drive across the end of a telegram"
                )
            self._fail(burst.rise, f"telegram {data.hex(' ')} after a pause too short (FC-8)")
        exchange.phase, exchange.end = "wait", float(burst.fall)
        exchange.sends += 1
        wait = self.card.registers[DRIVE_TIMEOUT]
        exchange.waits = (wait, wait)
        if exchange.sends == 1:
            self._measure("telegram", burst.start - max(exchange.queued_from, before + pause))
        self._count("telegram" if exchange.sends == 1 else "telegram repeated")
        if exchange.request.to_all:
            self._done(float(burst.fall))
        else:
            exchange.receiver = DriveReceiver(self.drive, data[2], last_end=float(burst.fall))

    def _from_drive(self, heard: FarCharacter) -> None:
        exchange = self.exchange
        if not exchange or exchange.phase != "wait" or not exchange.receiver:
            self._count("character of the drive unasked")
            return
        if heard.slack >= GARBLED_BITS * self.drive.bit:
            raise Unclear(heard.start, "a character of the drive across the end of a telegram")
        telegram = exchange.receiver.hears(heard)
        if telegram is None:
            return
        if heard.end >= self._wait_from(exchange) and not self._accepted(exchange, heard.end):
            self._count("reply of the drive too late")
            exchange.receiver.deaf_until = NEVER
            return
        status = self.card.coils[STATUS.start : STATUS.stop]
        doubtful, self.doubtful = self.doubtful, False
        self.card.question = exchange.request.question
        step = self.card.drive_reply(telegram)
        if step == Step():
            self._count("reply of the drive that does not fit")
            exchange.receiver.deaf_until = heard.end + self.budget
        else:
            self._count("reply of the drive")
            self.status_before, self.status_changed = status, heard.end
            self.status_doubts = [*self.status_doubts, status] if doubtful else []
            self._answered_by_drive(exchange, step, heard.end, doubtful)
        self.card.question = self.newest.question if self.newest else None

    def _accepted(self, exchange: Exchange, at: float) -> bool:
        """Whether the card took a reply near the end of the wait: both are allowed, its next action tells."""
        asker = exchange.request
        # A write that was given up on a busy line keeps its turn, but its master gets nothing more.
        awaited = not asker.answered and not asker.answers
        if asker is self.newest and asker.dropped is None and awaited:
            # Accepted: an immediate reply to the master, or a text telegram. Not accepted: a repeat, or the
            # reply that the drive is silent. That reply looks the same for fault 255, but comes later.
            again = [b.data for b in self.telegrams if at < b.rise < self._starts_by(at + self.budget)]
            waiting = [asker.telegram, *(request.telegram for request in self.queue)]
            if (
                again
                and again[0] not in waiting
                and self._parameter(again[0]) == self._parameter(asker.telegram)
            ):
                return True  # a text telegram follows, not that of a request that came later
            by = at + self.budget + 1.3 * self.line.bit
            replies = [burst for burst in self.replies if at - self.drive.bit < burst.rise < by]
            if not replies:
                return False
            silent = CardModel(name=self.card.name, question=asker.question).drive_silent().reply
            return replies[0].data[1:-2] != silent or replies[0].rise < self._abandoned_from(exchange)
        if exchange.sends == 1:
            by = self._starts_by(self._wait_by(exchange))
            if any(at < burst.rise < by and burst.data == asker.telegram for burst in self.telegrams):
                return False
            # The repeat may stay unsent: it was overtaken, or will be before it can leave, or this reply kept
            # the line busy. Then only a read of the status image shows whether the reply was accepted.
            self.doubtful = (
                exchange.overtaken
                or self._starts_by(at) > self._abandoned_from(exchange)
                or any(exchange.end < newer < self._starts_by(at) for newer in self.overtaking)
            )
            return True
        raise Unclear(at, "a reply of the drive at the end of its wait, which nothing later reveals")

    @staticmethod
    def _parameter(telegram: bytes) -> tuple[int, int]:
        """The number in its PKE, without AK."""
        return telegram[3] & 7, telegram[4]

    def _answered_by_drive(self, exchange: Exchange, step: Step, at: float, doubtful: bool) -> None:
        request = exchange.request
        if step.telegram is not None and self._gets_second(request):
            if doubtful:
                raise Unclear(at, "a late reply of the drive that leads to a second telegram if it counts")
            # The second telegram reads or writes the parameter as a text (MAP-8 of some dialects).
            request.question, request.telegram = self.card.question, self._built(step.telegram)
            if request.writes:
                self.queue.insert(bool(self.queue and self.queue[0].kind == "image"), request)
                self._done(at)
                return
            self._start(request, at, at + self.budget)
            self._overtake(exchange, at)
            return
        if request is self.newest and step.reply is not None and not request.broadcast:
            early = STOP_BITS * self.drive.bit
            self._answer(
                request, "drive's reply", step.reply, at - early, at + self.budget + 1.3 * self.line.bit
            )
        elif self.newest:
            self._allow_status(self.newest, self.card.coils[STATUS.start : STATUS.stop])
        if doubtful:
            # Otherwise the wait ended before the reply, and the exchange was abandoned later.
            held = replace(exchange, queued_by=self._wait_by(exchange))
            self._done(max(at, self._line_until(held)), self._wait_from(exchange))
        else:
            self._done(at)

    def _gets_second(self, request: Request) -> bool:
        """A write keeps its place for it, unless a newer one of its kind has that (FRAME-7)."""
        if request.writes:
            return all(newer.kind != request.kind for newer in self.queue)
        return request is self.newest

    def _overtake(self, before: Exchange, at: float) -> None:
        """A candidate during the first telegram also overtakes the second."""
        if before.request.second_overtaken:
            self.exchange.overtaken, self.exchange.settled = True, min(before.settled, at)

    def _done(self, at: float, since: float | None = None) -> None:
        """Frees the drive line for the next telegram: at `at`, or from `since` on if that is uncertain."""
        held = self.exchange.held
        self.exchange = None
        if self.queue:
            # While a candidate decides, what waits is not ordered.
            by = NEVER if self.pending and self.queue[0].writes else at + self.budget
            self._start(self.queue.pop(0), at if since is None else since, by)
            self.exchange.held_before = held

    # ------------------------------------------------------------ time

    def _advance(self, to: float) -> None:
        """Handles everything due before `to`."""
        while True:
            request, exchange = self.newest, self.exchange
            awaited = request and request.answers and not request.answered and request.dropped is None
            if awaited and request.answer_by < to:
                wanted = " or ".join(answer.hex(" ") for answer in request.answers)
                self._fail(request.answer_by, f"no reply; expected {wanted}")
            if exchange and exchange.phase == "line" and self._line_is_over(exchange, to):
                continue
            if exchange and exchange.phase == "wait" and self._wait_by(exchange) < to:
                self._after_wait(exchange, self._wait_by(exchange))
                continue
            return

    def _line_is_over(self, exchange: Exchange, to: float) -> bool:
        until = self._line_until(exchange)
        surely = exchange.queued_from + OVERTAKEN_MS / 2 * self.ms if exchange.overtaken else NEVER
        if not exchange.overtaken:
            surely = self._abandoned_from(exchange)
        elif exchange.sends == 0 or exchange.given_up:
            surely = -NEVER
        start_by = self._starts_by(exchange.queued_by)
        if start_by < min(to, surely):
            data = exchange.request.telegram
            self._fail(start_by, f"no telegram; expected {data.hex(' ')}")
        if until >= to:
            return False
        if exchange.overtaken:
            self._count("telegram overtaken")
            self._done(until, exchange.queued_from)
        else:
            self._abandon(exchange, until)
        return True

    def _after_wait(self, exchange: Exchange, at: float, repeated: bool = False) -> None:
        """The wait ended without a reply: repeat once, but not after a newer request, or abandon (FC-9)."""
        superseded = at > exchange.superseded and not self._keeps_its_repeat(exchange)
        if exchange.sends == 1 and (not superseded or repeated):
            exchange.overtaken |= superseded or exchange.given_up
            exchange.queued_from, exchange.queued_by = self._wait_from(exchange), at
            exchange.phase, exchange.receiver = "line", None
        else:
            self._abandon(exchange, at)

    def _abandon(self, exchange: Exchange, at: float) -> None:
        self._count("exchange given up")
        request, newest, since = exchange.request, self.newest, self._abandoned_from(exchange)
        if exchange.sends == 0 and self._keeps_place(request):
            self.queue.insert(0, request)  # until it has left (FRAME-7)
        # A line that was busy for the whole wait held up the newest request as well, if it was there before.
        waits = exchange.phase == "line" and request is not newest and newest in self.queue
        held_up = waits and not newest.answers and newest.committed < exchange.queued_by + TICK_MS * self.ms
        if held_up and exchange.queued_from < newest.committed + self.late + TICK_MS * self.ms:
            raise Unclear(at, "a wait for the line that begins as a request is committed")
        if request is newest or held_up:
            self._answer_silence(newest, since, at)
        if held_up and not self._keeps_place(newest):
            self.queue.remove(newest)
        self._done(at, since)

    def _answer_silence(self, request: Request, since: float, at: float) -> None:
        if request.broadcast:
            return
        self.card.question = request.question
        step = self.card.drive_silent()
        if step.reply is not None:
            self._answer(request, "given up", step.reply, since, at + self.budget + 1.3 * self.line.bit)
        else:
            request.answered = True  # some dialects are silent, also when its telegram leaves after all
