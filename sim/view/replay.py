# SPDX-License-Identifier: Apache-2.0
"""Plays a recorded bus to the whole card; prints a row a frame: candidate, committed, or dropped and why.

    python -m sim.view.replay FILE --unit 1 --baud 9600 [OPTION ...]

docs/guide/recordings.md explains options and rows. The card has its own clock, its firmware, and a simulated
VLT 6000 on the drive line, and starts before the recording does. The reason of a drop is the counter that
went up before the next frame. Exit code 2: a wrong option, or a recording without a character.
Rules: FRAME-1 ... FRAME-8.
"""

from __future__ import annotations

import argparse
import bisect
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from regs.areas import STRIDE
from regs.dialects import DIALECTS as TABLE
from regs.dialects import folder_with
from regs.generated.mailbox import AREAS, FRAMES_BYTES
from rtl.command import Parser, run_main
from rtl.sources import ROOT, configuration, configurations
from sim.harness.library import BuildError, Target
from sim.harness.pins import BAUDS, DRIVE, FORMS, NETWORK, Pins
from sim.harness.simulated_card import NUMBER
from sw.rtu2fc.capture import CaptureError, Piece, characters, open_capture, pieces
from sw.rtu2fc.words import is_reply
from tb.agents.crc16 import crc_good
from tb.model.card import DIALECTS
from tb.model.vlt_drive import VltDrive
from tb.model.wire import FRAME_MIN, Burst, FarCharacter, LineFormat

CONFIG, DIALECT = "standard", "card"
FACTORY = "8N2"  # the format of the original from the factory
STROBES = ("candidate", "commit", "revoke")
YES_NO = ("yes", "no")
# Options of the firmware, and what they are without a word of the user.
OPTIONS = {"STRICT_T15": "yes", "BREAK_TOLERANT": "no"}
# Counter and its words. Revoked candidates have a strobe.
REASONS = {
    "COUNT_CRC": "dropped: CRC wrong",
    "COUNT_PARITY": "dropped: parity",
    "COUNT_FRAMING": "dropped: stop bit",
    "COUNT_T15": "dropped: continued before 3.5 characters",
    "COUNT_OVERRUN": "dropped: more than 256 bytes",
    "COUNT_FOREIGN": "for another unit",
}
LANE_BITS = 8
# Silence in characters before the recording; the card waits for 3.5 after its start.
LEAD_CHARACTERS = 4
# A frame's events are over three characters after the start of the next: its own come later than that.
LATE_CHARACTERS = 3
# Time in s after t3.5 for the last exchange.
REST_S = 0.1
DRIVE_DELAY_BITS = 24.0  # FC-8
WIDTH = 42
SAMPLES_A_BIT = 16  # with fewer an edge is off by more than the receiver's own step
LEFT_OUT = "left out: the recorded slave's reply"
UNHEARD = "not heard: the card was sending"
IGNORED = "ignored: no 3.5 characters before it"
SWAPPED, ASCII, LOW = "CRC bytes swapped", "Modbus ASCII", "low after a good frame"
ASCII_MIN = 9  # colon, address, function, check byte, two line ends
ASCII_BITS = 0x7F  # the eighth bit may be the parity of a character with seven


@dataclass
class Fate:
    """What the card made of a piece: clocks of its strobes, counters that went up."""

    piece: Piece
    is_reply: bool = False  # it fits the request before it
    left_out: bool = False
    strobes: dict[str, list[int]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    unheard: bool = False  # the card was sending
    unanswered: bool = False  # the next frame began before a reply could (FRAME-7)

    def __str__(self) -> str:
        if self.left_out:
            return LEFT_OUT
        words = [word for word in STROBES if self.strobes.get(word)]
        said = ", ".join({"commit": "committed", "revoke": "revoked"}.get(word, word) for word in words)
        if said:
            said += "; not answered in time" if self.unanswered else ""
            return said + ("; a slave's reply by its form" if self.is_reply else "")
        said = ", ".join(REASONS[name] for name in REASONS if self.counts[name])
        if said:
            return said
        return UNHEARD if self.unheard else IGNORED


def suspicion(piece: Piece) -> str:
    """The mistake that explains a damaged frame, or nothing."""
    data = piece.data
    if len(data) >= FRAME_MIN and not crc_good(data) and crc_good(data[:-2] + data[:-3:-1]):
        return SWAPPED
    text = bytes(byte & ASCII_BITS for byte in data)
    digits = text[1:].rstrip(b"\r\n")
    if len(text) >= ASCII_MIN and text[:1] == b":" and not digits.strip(b"0123456789ABCDEFabcdef"):
        return ASCII
    for number, character in enumerate(piece.heard):
        if character.fault:
            is_low = character.fault == "stop bit" and character.byte == 0
            return LOW if is_low and number >= FRAME_MIN and crc_good(data[:number]) else ""
    return ""


class Replay:
    """A recording and a card that was just switched on. Unit of time: clocks since the card's start.

    `edges`: time in clocks since the start of the recording, and level; first the level at 0. `images`:
    folder of firmware images, other than the configuration's. The small card (`config` tiny) has the image of
    the dialect `card`.
    """

    def __init__(
        self,
        edges: Sequence[tuple[int, int]],
        line: LineFormat,
        unit: int,
        *,
        replies: bool = True,
        images: Path | None = None,
        config: str = CONFIG,
        dialect: str = DIALECT,
    ) -> None:
        self.line, self.unit = line, unit
        target = Target(images=images, config=config)
        config = configuration(config)
        self.character = line.character_bits * line.bit
        self.origin = round(config["boot_ms"] * config["clk_hz"] / 1000 + LEAD_CHARACTERS * self.character)
        edges = [(at + self.origin, level) for at, level in edges]
        self.fates = self._fates(pieces(characters(edges, line), line), replies)
        edges = self._kept(edges)
        self.network = [heard for fate in self.fates if not fate.left_out for heard in fate.piece.heard]
        self.drive_sent: list[FarCharacter] = []
        self.pins = Pins(target.library(line.clk_hz), target.image_folder(dialect), line, unit, more=STROBES)
        self.pins.play(NETWORK, edges)
        self.model, self._stepped_us = VltDrive(TABLE[dialect].profiles[0]), 0
        self._first_counter = config["memory_bytes"] // STRIDE - FRAMES_BYTES // STRIDE
        self._taken: dict[str, int] = dict.fromkeys(STROBES, 0)

    def close(self) -> None:
        self.pins.close()

    def __enter__(self) -> Replay:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ------------------------------------------------------------ the recording

    def _fates(self, found: Sequence[Piece], replies: bool) -> list[Fate]:
        fates, request = [], b""
        for piece in found:
            good = not piece.fault
            reply = good and bool(request) and is_reply(request, piece.data)
            request = piece.data if good and not reply else b""
            own = reply and piece.data[0] == self.unit
            fates.append(Fate(piece, reply, own and not replies))
        return fates

    def _kept(self, edges: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """The edges without those of the pieces that are left out."""
        times = [at for at, _ in edges]
        ends = [fate.piece.start for fate in self.fates[1:]] + [float("inf")]
        for fate, end in reversed(list(zip(self.fates, ends, strict=False))):
            if fate.left_out:
                first, last = (bisect.bisect_left(times, at) for at in (fate.piece.start, end))
                del edges[first:last]
        return edges

    # ------------------------------------------------------------ the card

    @property
    def replies(self) -> list[Burst]:
        return self.pins.sent(NETWORK)

    @property
    def telegrams(self) -> list[Burst]:
        return self.pins.sent(DRIVE)

    def strobes(self, name: str) -> list[int]:
        """Clocks at which the card has raised a strobe."""
        return [at for at, level in self.pins.edges[NUMBER[name]] if level]

    def counters(self) -> Counter[str]:
        """The firmware's counters (regs/mailbox.rdl)."""
        found: Counter[str] = Counter()
        for name in REASONS:
            word = self.pins.memory_word(self._first_counter + AREAS[name].slot)
            found[name] = word >> LANE_BITS * AREAS[name].lane & 0xFFFF
        return found

    def play(self) -> list[Fate]:
        """Plays the recording to its end; returns what the card made of each piece."""
        self._run(self.origin)
        before = self.counters()
        played = [fate for fate in self.fates if not fate.left_out]
        starts = [fate.piece.start for fate in played[1:]] + [float("inf")]
        for fate, start in zip(played, starts, strict=False):
            last = fate.piece.end + self.line.t35_bits * self.line.bit + REST_S * self.line.clk_hz
            self._run(min(start + LATE_CHARACTERS * self.character, last))
            now = self.counters()
            fate.counts = Counter({name: now[name] - before[name] & 0xFFFF for name in REASONS})
            before = now
            for name in STROBES:
                strobes = self.strobes(name)
                fate.strobes[name] = strobes[self._taken[name] :]
                self._taken[name] = len(strobes)
        while self.pins.sending(NETWORK) or self.pins.sending(DRIVE):
            self._run(self.pins.now + LEAD_CHARACTERS * self.character)
        for fate, start in zip(played, starts, strict=False):
            self._compare(fate, start)
        return self.fates

    def _compare(self, fate: Fate, next_start: float) -> None:
        """Compares a piece with all that the card has sent on the network line."""
        first, last = fate.piece.start, fate.piece.end
        fate.unheard = any(burst.rise < last and first < burst.fall for burst in self.replies)
        asked = fate.strobes["commit"] and fate.piece.data[0] == self.unit
        fate.unanswered = bool(asked) and not any(last < burst.rise < next_start for burst in self.replies)

    def _run(self, until: float) -> None:
        while self.pins.now < round(until):
            for line, level in self.pins.run(until):
                if line == DRIVE and not level:
                    self._answer(self.pins.bursts[DRIVE][-1])

    def _answer(self, burst: Burst) -> None:
        now_us = int(burst.fall / self.line.clk_hz * 1e6)
        self.model.step(now_us - self._stepped_us)
        self._stepped_us = now_us
        line = self.pins.lines[DRIVE]
        at, edges = burst.fall + DRIVE_DELAY_BITS * line.bit, []
        for byte in self.model.telegram(burst.data) or b"":
            levels = line.levels(byte)
            edges += [(at + i * line.bit, level) for i, level in enumerate(levels)]
            end = at + len(levels) * line.bit
            self.drive_sent.append(FarCharacter(at, end, byte))
            at = end
        self.pins.play(DRIVE, edges)


# ---------------------------------------------------------------- text


def table(replay: Replay) -> Iterator[str]:
    """The rows, all at the end of the run."""
    fates = replay.play()
    rows = [(fate.piece.start, "bus", str(fate), fate.piece) for fate in fates]
    rows += [(float(burst.start), "reply", "", burst) for burst in replay.replies]
    rows += [(float(burst.start), "telegram", "", burst) for burst in replay.telegrams]
    yield f"{'time s':>9}  {'silence':>7}  {'row':<8}  {'fate':<{WIDTH}}  bytes"
    silent_from = None
    for start, row, said, source in sorted(rows, key=lambda row: row[0]):
        silence = ""
        if row != "telegram" and said != LEFT_OUT:
            if silent_from is not None:
                silence = f"{(start - silent_from) / replay.character:.2f}"
            silent_from = max(silent_from or 0.0, source.end if row == "bus" else source.fall)
        if isinstance(source, Piece):
            said += remark(source)
        time = (start - replay.origin) / replay.line.clk_hz
        yield f"{time:9.4f}  {silence:>7}  {row:<8}  {said:<{WIDTH}}  {source.data.hex(' ').upper()}"
    yield from summary(replay)


def remark(piece: Piece) -> str:
    """In brackets: the fault in the recording, and a mistake of the sender that explains it."""
    fault = piece.fault
    said = [fault if fault != "CRC" else "", suspicion(piece) if fault else ""]
    return f" ({'; '.join(filter(None, said))})" if any(said) else ""


def summary(replay: Replay) -> Iterator[str]:
    totals: Counter[str] = Counter()
    for fate in replay.fates:
        totals += fate.counts
    good = sum(not fate.piece.fault for fate in replay.fates)
    candidates, commits, revokes = (len(replay.strobes(name)) for name in STROBES)
    dropped = sum(totals[name] for name in REASONS if name != "COUNT_FOREIGN")
    foreign = totals["COUNT_FOREIGN"]
    yield f"{len(replay.fates)} frames or parts, {good} good; {foreign} for other units, {dropped} dropped"
    yield f"unit {replay.unit}: {candidates} candidates, {commits} committed, {revokes} revoked"
    yield f"sent: {len(replay.replies)} replies, {len(replay.telegrams)} telegrams"


MEANINGS = {
    SWAPPED: "the low byte goes first",
    ASCII: "the card serves Modbus RTU alone",
    LOW: "the bus has no bias",
}
NOT_HERE = "no frame is good at this rate, format and level; rtu2fc decode finds those of a recording"


def suspicions(edges: Sequence[tuple[int, int]], line: LineFormat) -> list[str]:
    """Why the card serves nothing in a recording, from the recording alone."""
    found = pieces(characters(edges, line), line)
    mistakes = Counter(suspicion(piece) for piece in found if piece.fault)
    said = [
        f"{text} in {mistakes[text]} of {len(found)} frames: {meaning}"
        for text, meaning in MEANINGS.items()
        if mistakes[text]
    ]
    return said if said or any(piece.begins_good for piece in found) else [NOT_HERE]


def check_line(edges: Sequence[tuple[int, int]], line: LineFormat) -> list[str]:
    """The suspicions. A recording without a character is refused."""
    if len(edges) < 2:
        level = edges[0][1] if edges else 1
        why = (
            "nobody sends, or the channel is another"
            if level
            else "try INVERT=yes, or the channel is another"
        )
        raise CaptureError(f"the line is constantly {level}: {why}")
    if not characters(edges, line):
        raise CaptureError(f"no character at {line.baud} {line.form}; {NOT_HERE}")
    return suspicions(edges, line)


def first_seconds(edges: list[tuple[int, int]], clocks: float) -> list[tuple[int, int]]:
    """The beginning of a recording; the line is idle after it."""
    kept = [edge for edge in edges if edge[0] < clocks]
    return kept if len(kept) in (1, len(edges)) else [*kept, (round(clocks), 1)]


def arguments(words: Sequence[str] | None) -> argparse.Namespace:
    parser = Parser(prog="replay", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="a sigrok session (.sr) or a VCD file")
    add("--unit", type=int, required=True, metavar="1...247", help="address of the card")
    add("--baud", type=int, required=True, choices=sorted(BAUDS), help="bit/s")
    add("--channel", help="name of the channel; without it the only one that changes")
    add("--format", default=FACTORY, choices=sorted(FORMS), help="default: 8N2, as from the factory")
    add("--invert", default="no", choices=YES_NO, help="the channel is low in silence")
    add("--replies", default="yes", choices=YES_NO, help="no: without those of the recorded slave")
    add("--for", type=float, default=float("inf"), dest="seconds", help="only so many s of the recording")
    add("--config", default=CONFIG, choices=sorted(configurations()), help="default: standard")
    add("--dialect", default=DIALECT, choices=sorted(DIALECTS), help="default: card")
    for option, usual in OPTIONS.items():
        name = f"--{option.lower().replace('_', '-')}"
        add(name, default=usual, choices=YES_NO, help=f"{option} of the firmware")
    options = parser.parse_args(words)
    if options.config == "tiny" and options.dialect != DIALECT:
        parser.error(f"the configuration tiny speaks the dialect {DIALECT} alone")
    if options.config == "tiny" and unusual(options):
        parser.error(f"no image of the configuration tiny has another {', '.join(unusual(options))}")
    if not 1 <= options.unit <= 247:
        parser.error(f"unit {options.unit} is no address of a card: 1 to 247")
    if not options.seconds > 0:
        parser.error("--for wants a number of seconds above 0")
    return options


def unusual(options: argparse.Namespace) -> dict[str, int]:
    """Options of the firmware that are not as usual, with their values."""
    chosen = {option: vars(options)[option.lower()] for option in OPTIONS}
    return {option: int(word == "yes") for option, word in chosen.items() if word != OPTIONS[option]}


def main(words: Sequence[str] | None = None) -> int:
    options = arguments(words)
    line = LineFormat(options.baud, options.format, configuration(options.config)["clk_hz"])
    others = unusual(options)
    try:
        capture = open_capture(options.file)
        samples = capture.samples_a_bit(options.baud)
        if samples is not None and samples < SAMPLES_A_BIT:
            few = f"{samples:.1f} samples a bit are few: record {SAMPLES_A_BIT} or more"
            print(f"replay: warning: {options.file}: {few}", file=sys.stderr)
        channel = options.channel or capture.only_channel()
        edges = capture.edges(channel, line.clk_hz, invert=options.invert == "yes")
        edges = first_seconds(edges, options.seconds * line.clk_hz)
        try:
            suspected = check_line(edges, line)
        except CaptureError as error:
            raise CaptureError(f"{options.file}, channel {channel}: {error}") from None
        for text in suspected:
            print(f"suspicion: {text}", flush=True)
        with Replay(
            edges,
            line,
            options.unit,
            replies=options.replies == "yes",
            images=ROOT / "build" / folder_with(**others) if others else None,
            config=options.config,
            dialect=options.dialect,
        ) as replay:
            for text in table(replay):
                print(text, flush=True)
    except (CaptureError, BuildError) as error:
        print(f"replay: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    run_main("replay", main)
