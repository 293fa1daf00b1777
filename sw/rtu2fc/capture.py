# SPDX-License-Identifier: Apache-2.0
"""Reads the channels of a logic analyser's recording: a sigrok session (.sr) or a VCD file.

    capture = open_capture(Path("bus.sr"))
    capture.names                  # every channel
    capture.edges("RX", 2_000_000) # (time, level) of each change; first the level at time 0

An .sr file is a zip archive: `metadata` names channels and sample rate. The files logic-1-1, logic-1-2, ...
hold one sample after the other, `unitsize` bytes each. Times are counted in a clock that the caller names.
`characters` decodes the edges as a receiver does, each bit sampled in its middle. Errors: CaptureError, one
line. Rules: LINE-1, FRAME-1.
"""

from __future__ import annotations

import configparser
import functools
import itertools
import math
import re
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from .crc16 import crc_good
from .line import Format
from .problem import Problem

FRAME_MIN, FRAME_MAX = 4, 256
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ps": 1e-12, "fs": 1e-15}
HERTZ = {"Hz": 1, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9}
DATA_BITS = 8
DUMPS = ("$dumpvars", "$dumpall", "$dumpon", "$dumpoff", "$end")  # they only group levels of a VCD file
# Errors of a damaged archive, part or metadata. Python raises the last two for an unknown packing.
DAMAGED = (KeyError, ValueError, configparser.Error, zipfile.BadZipFile, zlib.error, EOFError, OSError)
DAMAGED += (NotImplementedError, RuntimeError)
ENOUGH_MOMENTS = 30  # times in a VCD file from which its sample rate follows
WHOLE_BITS = 2.5  # a VCD file with fewer steps a bit was drawn bit by bit: nothing samples a line so seldom


class CaptureError(Problem):
    """Error for the user, in one line."""


class Capture:
    """A recording, `path` in messages. A subclass has `changes(name)`: seconds and level of each change."""

    names: list[str]
    sample_hz: float | None = None
    least_samples = 0.0  # a bit

    def __init__(self, path: Path) -> None:
        self.path = path

    def samples_a_bit(self, baud: int) -> float | None:
        """None if a VCD file does not show its sample rate: few times, or whole bits of a simulation."""
        samples = self.sample_hz and self.sample_hz / baud
        return samples if samples and samples >= self.least_samples else None

    def edges(self, name: str, hz: float, *, invert: bool = False) -> list[tuple[int, int]]:
        """Each change of a channel, its time counted in a clock of `hz`; first the level at 0."""
        if name not in self.names:
            raise CaptureError(f"{self.path} has no channel {name}; there are: {', '.join(self.names)}")
        return [(round(time * hz), level ^ invert) for time, level in self.changes(name)]

    def only_channel(self) -> str:
        """The channel that changes, if there is one alone."""
        busy = [name for name in self.names if len(self.changes(name)) > 1]
        if not busy:
            raise CaptureError(f"{self.path}: no channel changes: nobody sends, or no probe is connected")
        if len(busy) > 1:
            raise CaptureError(f"{self.path}: name a channel; these change: {', '.join(busy)}")
        return busy[0]


class SigrokFile(Capture):
    """A sigrok session."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        try:
            with zipfile.ZipFile(path) as archive:
                self._read_metadata(archive)
        except DAMAGED:
            raise CaptureError(f"{path}: no sigrok recording with logic channels") from None

    def _read_metadata(self, archive: zipfile.ZipFile) -> None:
        metadata = configparser.ConfigParser(delimiters=("=",), interpolation=None, strict=False)
        metadata.read_string(archive.read("metadata").decode())
        device = metadata["device 1"]
        rate = re.fullmatch(r"([\d.]+)\s*([kMG]?Hz)?", device["samplerate"])
        if rate is None:
            raise ValueError
        self.sample_hz = float(rate[1]) * HERTZ[rate[2] or "Hz"]
        self._unit = int(device["unitsize"])
        if self.sample_hz <= 0 or self._unit <= 0:
            raise ValueError
        self._bits = {
            name: int(key.removeprefix("probe")) - 1
            for key, name in device.items()
            if re.fullmatch(r"probe\d+", key)
        }
        base = device["capturefile"]
        parts = [name for name in archive.namelist() if re.fullmatch(rf"{re.escape(base)}(-\d+)?", name)]
        # The tenth part follows the ninth.
        self._parts = sorted(parts, key=lambda name: (len(name), name))
        if not parts or any(bit >= 8 * self._unit for bit in self._bits.values()):
            raise ValueError

        self.names = list(self._bits)

    def changes(self, name: str) -> list[tuple[float, int]]:
        byte, bit = divmod(self._bits[name], 8)
        levels = bytes(value >> bit & 1 for value in range(256))
        found: list[tuple[float, int]] = []
        first, level = 0, -1
        try:
            with zipfile.ZipFile(self.path) as archive:
                for part in self._parts:
                    samples = archive.read(part)[byte :: self._unit].translate(levels)
                    at = 0
                    if level < 0 and samples:
                        level = samples[0]
                        found.append((0.0, level))
                    while (at := samples.find(1 - level, at)) >= 0:
                        level = samples[at]
                        found.append(((first + at) / self.sample_hz, level))
                    first += len(samples)
        except DAMAGED:
            raise CaptureError(f"{self.path}: the recording is damaged") from None
        return found


class VcdFile(Capture):
    """The one-bit signals of a VCD file. A level that is neither 0 nor 1 keeps the one before."""

    least_samples = WHOLE_BITS

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._codes: dict[str, str] = {}  # by name
        self._changes: dict[str, list[tuple[float, int]]] = {}  # by code
        try:
            words = (found[0] for found in re.finditer(r"\S+", path.read_text(encoding="utf-8")))
            self._read_levels(words, self._read_header(words))
        except (*DAMAGED, IndexError, StopIteration):
            raise CaptureError(f"{path}: no readable VCD file") from None
        self.names = list(self._codes)

    def _read_header(self, words: Iterator[str]) -> float:
        """Names the signals; returns the unit of time in s. Of two with one name the second has its scope."""
        scopes, unit_s = [], 0.0
        for keyword in words:
            if not keyword.startswith("$"):
                raise ValueError
            body = list(itertools.takewhile(lambda word: word != "$end", words))
            if keyword == "$enddefinitions":
                break
            if keyword == "$timescale":
                scale = re.fullmatch(r"(\d+)([munpf]?s)", "".join(body))
                unit_s = int(scale[1]) * UNITS[scale[2]] if scale else 0.0
            elif keyword == "$scope":
                scopes.append(body[-1])
            elif keyword == "$upscope":
                scopes.pop()
            elif keyword == "$var":
                _, width, code, name = body[:4]
                self._changes.setdefault(code, [])
                if width == "1":
                    name = name + "".join(body[4:])
                    self._codes[".".join([*scopes, name]) if name in self._codes else name] = code
        if not unit_s:
            raise ValueError
        return unit_s

    def _read_levels(self, words: Iterator[str], unit_s: float) -> None:
        now, moments = 0, set()
        for word in words:
            if word[0] == "#":
                later = int(word[1:])
                if later < now:
                    raise ValueError
                now = later
                moments.add(now)
            elif word[0] in "bBrR":
                next(words)
            elif word == "$comment":
                list(itertools.takewhile(lambda other: other != "$end", words))
            elif word[0] in "01xXzZ":
                changes = self._changes[word[1:]]
                if word[0] in "01" and (not changes or changes[-1][1] != int(word[0])):
                    changes.append((now * unit_s, int(word[0])))
            elif word not in DUMPS:
                raise ValueError
        # Such a file does not name its sample rate, but all its times are whole samples.
        if len(moments) >= ENOUGH_MOMENTS:
            first = min(moments)
            self.sample_hz = 1 / (math.gcd(*(moment - first for moment in moments)) * unit_s)

    def changes(self, name: str) -> list[tuple[float, int]]:
        return self._changes[self._codes[name]]


def open_capture(path: Path) -> Capture:
    try:
        with path.open("rb") as file:
            start = file.read(4096)
    except OSError as error:
        raise CaptureError(f"{path}: {error.strerror}") from None
    if zipfile.is_zipfile(path) or start[:2] == b"PK":
        return SigrokFile(path)
    if start.lstrip()[:1] == b"$":
        return VcdFile(path)
    raise CaptureError(f"{path} is no recording: neither a sigrok session (.sr) nor a VCD file")


# ---------------------------------------------------------------- characters and frames


@dataclass(frozen=True)
class LineFormat:
    """Rate and format of one line. `bit`: length of a bit in clocks. Silences are in bits (FRAME-1)."""

    baud: int
    form: str
    clk_hz: int

    @functools.cached_property
    def bit(self) -> float:
        return self.clk_hz / self.baud

    @functools.cached_property
    def fmt(self) -> Format:
        return Format.named(self.baud, self.form)

    @functools.cached_property
    def parity(self) -> int:
        """Bits of it in a character."""
        return self.fmt.parity_bits

    @functools.cached_property
    def character_bits(self) -> int:
        """Length in bits of a sent character, start and stop bits included."""
        return self.fmt.bits

    @functools.cached_property
    def t15_bits(self) -> float:
        return 750e-6 * self.baud if self.baud > 19200 else 1.5 * self.character_bits

    @functools.cached_property
    def half_bits(self) -> float:
        """Half a character of silence, as silence_timer counts it."""
        return self.t15_bits / 3

    @functools.cached_property
    def t35_bits(self) -> float:
        return 1750e-6 * self.baud if self.baud > 19200 else 3.5 * self.character_bits

    def levels(self, byte: int, flaw: str = "") -> list[int]:
        """Levels of a character, one for each bit. Flaws: `parity`, `stop` (the first stop bit is 0)."""
        bits = self.fmt.levels(byte)
        if flaw == "stop":
            bits[9 + self.parity] = 0
        elif flaw and self.parity:
            bits[9] ^= 1
        return bits


@dataclass(frozen=True)
class FarCharacter:
    """A character sent to the card. `slack`: uncertainty, in clocks, of its end as seen by the card."""

    start: float
    end: float
    byte: int
    good: bool = True  # parity and stop bit
    slack: float = 0.0


@dataclass(frozen=True)
class Heard(FarCharacter):
    """A character of a recording. `fault`: parity or stop bit."""

    fault: str = ""


def characters(edges: Sequence[tuple[int, int]], line: LineFormat) -> list[Heard]:
    """The characters in the edges of a line, in the unit of `line`. The first stop bit is enough (LINE-1)."""
    found: list[Heard] = []
    i, count, level = 0, len(edges), 1
    free = 0.0
    while i < count:
        start, now = edges[i]
        i += 1
        fell, level = level == 1 and now == 0 and start >= free, now
        if not fell:
            continue
        values = []
        for number in range(1 + DATA_BITS + line.parity + 1):
            middle = start + (number + 0.5) * line.bit
            while i < count and edges[i][0] <= middle:
                level = edges[i][1]
                i += 1
            values.append(level)
            if values[0]:
                break  # a glitch: the next edge may begin a character
        if values[0]:
            continue
        byte = sum(bit << k for k, bit in enumerate(values[1:9]))
        fault = "stop bit" if not values[-1] else ""
        if line.parity and values[9] != line.fmt.parity_bit(byte):
            fault = fault or "parity"
        end = start + line.character_bits * line.bit
        slack = 0.0
        if not values[-1]:
            # A low stop bit lasts until the line is high again.
            end, slack = max(end, edges[i][0] if i < count else end), 1.5 * line.bit
        free = start + (len(values) - 0.5) * line.bit
        found.append(Heard(start, end, byte, not fault, slack, fault))
    return found


@dataclass(frozen=True)
class Piece:
    """Characters without a silence of 1.5 characters between them: a frame, or a part of a broken one."""

    heard: tuple[Heard, ...]

    @property
    def start(self) -> float:
        return self.heard[0].start

    @property
    def end(self) -> float:
        return self.heard[-1].end

    @property
    def data(self) -> bytes:
        return bytes(character.byte for character in self.heard)

    @property
    def fault(self) -> str:
        """Why this is no good frame; empty for a good one (FRAME-4)."""
        for number, character in enumerate(self.heard, 1):
            if character.fault:
                return f"{character.fault} of byte {number}"
        if not FRAME_MIN <= len(self.heard) <= FRAME_MAX:
            return "too short" if len(self.heard) < FRAME_MIN else "too long"
        return "" if crc_good(self.data) else "CRC"

    @property
    def begins_good(self) -> bool:
        """Whether its first characters are a good frame, whatever follows."""
        fine = list(itertools.takewhile(lambda character: not character.fault, self.heard))
        data = bytes(character.byte for character in fine)
        return any(crc_good(data[:end]) for end in range(FRAME_MIN, min(len(data), FRAME_MAX) + 1))


def pieces(heard: Iterable[Heard], line: LineFormat) -> list[Piece]:
    found: list[list[Heard]] = []
    for character in heard:
        if found and character.start - found[-1][-1].end < line.t15_bits * line.bit:
            found[-1].append(character)
        else:
            found.append([character])
    return [Piece(tuple(part)) for part in found]
