# SPDX-License-Identifier: Apache-2.0
"""`rtu2fc decode`: a recording of both lines in words, one row a frame.

    .jsonl       log of the virtual card, a bench or `make replay`: its own words
    .pcapng      capture of these
    .sr, .vcd    channels of a logic analyser; rate, format and idle level are found unless they are named

Columns: time in s of the first start bit, silence in ms on its line before it, line, sender, description.
"""

from __future__ import annotations

import argparse
import itertools
import json
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from . import fc
from .capture import Capture, LineFormat, Piece, characters, open_capture, pieces
from .problem import DONE, FAILED, Problem
from .screen import Screen
from .switches import BAUDS
from .words import Words

TICKS_HZ = 10_000_000  # clock in which the edges of a recording are counted
TRIED_EDGES = 20_000  # of a channel, to find its rate and format
DRIVE_LINE = LineFormat(9600, "8E1", TICKS_HZ)
PCAPNG, INTERFACE, PACKET = bytes.fromhex("0A 0D 0D 0A"), 1, 6
COMMENT, NAME, FLAGS = 1, 2, 2  # options of pcapng
OUTBOUND = 2
SENDERS = {"request": "card", "reply": "drive"}


@dataclass(frozen=True)
class Row:
    """`end` is not in a capture. `bad`: no good frame. `kind`: frame, led, warning or field."""

    start: float
    end: float | None
    line: str
    sender: str
    said: str
    bad: bool = False
    data: bytes = b""
    kind: str = "frame"


# ---------------------------------------------------------------- files of frames


def log_rows(path: Path) -> Iterator[Row]:
    for text in path.read_text(encoding="utf-8").splitlines():
        entry = json.loads(text)
        if "led" in entry:
            yield Row(entry["t"], entry["t"], entry["led"], "LED", entry["shows"], kind="led")
        else:
            data = bytes.fromhex(entry["bytes"])
            where = entry["t"], entry["end"], entry["line"], entry["from"]
            yield Row(*where, entry["what"], not entry["ok"], data)


def pcapng_rows(path: Path, drive: str, dialect: str) -> Iterator[Row]:
    """The capture has words in its comments; another program's has none, and then they are ours."""
    data, at, names = path.read_bytes(), 0, []
    words, far = Words(drive, dialect), {"modbus": "master", "drive": "drive"}
    if data[:4] != PCAPNG:
        raise ValueError
    while at + 12 <= len(data):
        kind, length = struct.unpack_from("<II", data, at)
        if length < 12 or length % 4:
            raise ValueError
        body = data[at + 8 : at + length - 4]
        at += length
        if kind == INTERFACE:
            names.append(options(body[8:]).get(NAME, b"modbus").decode())
        elif kind == PACKET:
            number, high, low, size = struct.unpack_from("<IIII", body)
            frame, more = body[20 : 20 + size], options(body[20 + size + -size % 4 :])
            line, start = names[number], (high << 32 | low) / 1e6
            flags = int.from_bytes(more.get(FLAGS, b""), "little") & 3
            said = more.get(COMMENT, b"").decode()
            if not said and line == "modbus":
                said = words.said(frame)[1]
            sender = "card" if flags == OUTBOUND else far.get(line, "")
            bad = said.startswith("bad frame: ")
            yield Row(start, None, line, sender, said.removeprefix("bad frame: "), bad, frame)


def options(data: bytes) -> dict[int, bytes]:
    found, at = {}, 0
    while at + 4 <= len(data):
        code, length = struct.unpack_from("<HH", data, at)
        if code == 0:
            break
        found.setdefault(code, data[at + 4 : at + 4 + length])
        at += 4 + length + -length % 4
    return found


# ---------------------------------------------------------------- channels


def modbus_pieces(name: str, edges: Sequence[tuple[int, int]], line: LineFormat) -> list[tuple[str, Piece]]:
    return [(name, piece) for piece in pieces(characters(edges, line), line)]


def modbus_rows(found: list[tuple[str, Piece]], words: Words) -> Iterator[Row]:
    """Of all channels together: a reply may be on another wire than its request."""
    for name, piece in sorted(found, key=lambda one: one[1].start):
        reply, said = (None, piece.fault) if piece.fault else words.said(piece.data)
        sender = "" if reply is None else "slave" if reply else "master"
        start, end = piece.start / TICKS_HZ, piece.end / TICKS_HZ
        yield Row(start, end, name, sender, said, bool(piece.fault), piece.data)


def drive_rows(channel: str, drive: str, edges: Sequence[tuple[int, int]]) -> list[Row]:
    """The telegrams on a channel that carries both directions."""
    line, rows = fc.Telegrams(drive), []
    for heard in characters(edges, DRIVE_LINE):
        line.character(heard)
    line.end()
    for name, start, end, text in line.found:
        kind = "frame" if name in fc.TELEGRAMS else "field" if name in fc.FIELDS else "warning"
        said = text.removeprefix("Request: ").removeprefix("Reply: ").removeprefix("Bad: ")
        where = start / TICKS_HZ, end / TICKS_HZ, channel, SENDERS.get(name, "")
        rows.append(Row(*where, said, name == "bad", kind=kind))
    return rows


def good(rows: Sequence[Row]) -> int:
    return sum(row.kind == "frame" and not row.bad for row in rows)


class Channels:
    """Finds out which channels carry which line."""

    def __init__(self, capture: Capture, args: argparse.Namespace, drive: str, dialect: str) -> None:
        self.capture, self.args, self.drive, self.dialect = capture, args, drive, dialect
        self.notes: dict[str, str] = {}
        self.network: dict[str, list[tuple[str, Piece]]] = {}
        self.telegrams: dict[str, list[Row]] = {}
        self.read: dict[str, list[tuple[int, int]]] = {}
        self.levels = (True,) if args.invert else (False, True)  # when idle: low or not
        # The usual ones first: the first of equally good ones is taken.
        self.bauds = [args.baud] if args.baud else [9600, *(baud for baud in BAUDS if baud != 9600)]
        self.forms = [args.format] if args.format else ["8N2", "8E1", "8O1", "8N1"]

    def edges(self, name: str, invert: bool) -> list[tuple[int, int]]:
        if name not in self.read:
            self.read[name] = self.capture.edges(name, TICKS_HZ)
        return [(at, level ^ invert) for at, level in self.read[name]]

    def modbus(self, name: str) -> int:
        """Whether it is a network line: the number of its good frames at the best setting."""
        best, chosen = 0, None
        for invert, baud, form in itertools.product(self.levels, self.bauds, self.forms):
            line = LineFormat(baud, form, TICKS_HZ)
            found = modbus_pieces(name, self.edges(name, invert)[:TRIED_EDGES], line)
            if (count := sum(not piece.fault for _, piece in found)) > best:
                best, chosen = count, (invert, line)
        if chosen:
            invert, line = chosen
            self.network[name] = modbus_pieces(name, self.edges(name, invert), line)
            self.notes[name] = f"Modbus RTU at {line.baud} {line.form}{', low when idle' * invert}"
        return best

    def drive_line(self, name: str) -> int:
        """Whether it is a drive line: the number of its good telegrams."""
        best = 0
        for invert in self.levels:
            rows = drive_rows(name, self.drive, self.edges(name, invert))
            if (count := good(rows)) > best:
                best, self.telegrams[name] = count, rows
                self.notes[name] = f"FC protocol at 9600 8E1{', low when idle' * invert}"
        return best

    def rows(self) -> list[Row]:
        named = [(name, self.modbus) for name in self.args.modbus]
        named += [(name, self.drive_line) for name in self.args.drive_line]
        for name, finds in named:
            if not finds(name):
                raise Problem(f"{self.args.file}: no good frame on {name}", *self.advice())
        for name in () if named else self.capture.names:
            if len(self.edges(name, False)) > 1 and not self.drive_line(name):
                self.modbus(name)
        if not self.network and not self.telegrams:
            raise Problem(f"{self.args.file}: no good frame on any channel", *self.advice())
        network = [one for found in self.network.values() for one in found]
        found = [*modbus_rows(network, Words(self.drive, self.dialect))]
        found += itertools.chain.from_iterable(self.telegrams.values())
        return sorted(found, key=lambda row: row.start)

    def advice(self) -> list[str]:
        return [
            f"Channels: {', '.join(self.capture.names)}",
            "Noise, another protocol, or fewer than 8 samples a bit.",
        ]


# ---------------------------------------------------------------- table


def table(rows: Sequence[Row], args: argparse.Namespace) -> Iterator[str]:
    yield f"{'time s':>9}  {'silence':>9}  {'line':<6}  {'from':<6}  says"
    ends: dict[str, float | None] = {}
    for row in rows:
        silence = ""
        if row.kind == "frame":
            if ends.get(row.line) is not None:
                silence = f"{1000 * (row.start - ends[row.line]):.2f} ms"
            ends[row.line] = row.end
        if (args.frames and row.kind != "frame") or (row.kind == "field" and not args.fields):
            continue
        if args.bad and not row.bad:
            continue
        said = f"BAD {row.said}" if row.bad else f"! {row.said}" if row.kind == "warning" else row.said
        yield f"{row.start:9.4f}  {silence:>9}  {row.line:<6}  {row.sender:<6}  {said}"
        if args.bytes and row.kind == "frame" and row.data:
            yield f"{'':37}{row.data.hex(' ').upper()}"


def rows_of(args: argparse.Namespace, screen: Screen) -> list[Row]:
    dialect = "card" if args.dialect == "auto" else args.dialect
    drive = "vlt6000" if args.drive == "auto" else args.drive
    try:
        if args.file.suffix == ".jsonl":
            return list(log_rows(args.file))
        if args.file.suffix == ".pcapng":
            return list(pcapng_rows(args.file, drive, dialect))
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, struct.error):
        what = "log" if args.file.suffix == ".jsonl" else "capture"
        raise Problem(f"{args.file} is no {what} of both lines") from None
    channels = Channels(open_capture(args.file), args, drive, dialect)
    rows = channels.rows()
    for name, note in channels.notes.items():
        screen.say(f"{name}: {note}", "dim")
    return rows


def decode(args: argparse.Namespace, screen: Screen) -> int:
    rows = rows_of(args, screen)
    for line in table(rows, args):
        screen.say(line, indent=39)
    screen.result["frames"] = [
        {"t": round(row.start, 6), "line": row.line, "from": row.sender, "bytes": row.data.hex(" "),
         "ok": not row.bad, "what": row.said} for row in rows if row.kind == "frame"]  # fmt: skip
    frames = [row for row in rows if row.kind == "frame"]
    return DONE if good(frames) or not frames else FAILED


def add_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help=".sr, .vcd, .pcapng, or the log .jsonl")
    add("--modbus", action="append", default=[], metavar="CHANNEL", help="with the network line")
    add("--drive-line", action="append", default=[], metavar="CHANNEL", help="with the drive line")
    add("--invert", action="store_true", help="the channels are low when idle")
    add("--frames", action="store_true", help="no LEDs and no warnings")
    add("--bad", action="store_true", help="damaged frames only")
    add("--bytes", action="store_true", help="the bytes of each frame, too")
    add("--fields", action="store_true", help="the fields of each telegram, too")
