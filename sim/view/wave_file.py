# SPDX-License-Identifier: Apache-2.0
"""Reads names and values from a waveform (FST or VCD), for tools and tests.

Names are relative to the top module, with dots, for every simulator: Icarus puts the ports of the top inside
it, Verilator beside it in TOP or, with cocotb, in $rootio. Times in seconds. Error: RuntimeError, one line.
"""

from __future__ import annotations

import contextlib
import functools
import os
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pywellen import Waveform

from sw.rtu2fc.capture import UNITS

ROOT = Path(__file__).resolve().parents[2]


@contextlib.contextmanager
def reading(path: Path) -> Iterator[None]:
    """Makes a RuntimeError of each failure of the library. A panic of Rust is no Exception, and it prints."""
    kept = os.dup(2)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    except BaseException as error:
        # The header of an FST file is written last.
        if path.is_file() and path.read_bytes()[:25] == bytes(25):
            raise RuntimeError("the waveform is unfinished: its program still runs or was killed") from None
        if type(error).__name__ == "PanicException":
            raise RuntimeError("the waveform is damaged") from None
        if isinstance(error, RuntimeError):
            raise RuntimeError(" ".join(str(error).split())) from None
        raise
    finally:
        os.dup2(kept, 2)
        os.close(kept)


@functools.cache
def low_bits() -> dict[str, int]:
    """Lowest bit of each vector that does not end at bit 0: the reader library hides it."""
    declared = re.compile(r"\[\s*\d+\s*:\s*([1-9]\d*)\s*\]\s*(\w+)")
    sources = [path for folder in ("rtl", "regs", "sim", "tb") for path in (ROOT / folder).rglob("*.v")]
    return {name: int(low) for path in sources for low, name in declared.findall(path.read_text())}


@dataclass(frozen=True)
class Signal:
    """One variable of a waveform; `path` is its full name, `name` is relative to the top."""

    path: str
    name: str
    width: int

    @property
    def leaf(self) -> str:
        return self.name.rsplit(".", 1)[-1]

    @property
    def bits(self) -> str:
        """Suffix of the name for GTKWave."""
        if self.width == 1:
            return ""
        low = low_bits().get(self.leaf, 0)
        return f"[{self.width - 1 + low}:{low}]"


class WaveFile:
    """A waveform, read on first use."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with reading(path):
            self._wave = Waveform(str(path))
        scale = re.fullmatch(r"(\d+)\s*(\w+)", str(self._wave.timescale))
        self._unit_s = int(scale[1]) * UNITS[scale[2]]

    @functools.cached_property
    def span(self) -> float:
        """Duration in time units of the file, from the first block of an FST file."""
        header = self._path.read_bytes()[:25]  # block type, length, start and end time
        if header[:1] != b"\0" or len(header) < 25:
            return 0.0
        start, end = struct.unpack(">QQ", header[9:25])
        return float(end - start)

    @functools.cached_property
    def _variables(self) -> dict[str, object]:
        found: dict[str, object] = {}
        for variable in self._wave.all_vars():
            found.setdefault(variable.full_name, variable)
        return found

    @functools.cached_property
    def signals(self) -> dict[str, Signal]:
        """Signals by name relative to the top, in the file's order, without parameters."""
        found: dict[str, Signal] = {}
        for path, variable in self._variables.items():
            if "Parameter" in str(variable.var_type) or not variable.bitwidth:
                continue
            above, _, name = path.partition(".")
            if above == "TOP" and "." in name:
                name = name.partition(".")[2]
            found.setdefault(name, Signal(path, name, variable.bitwidth))
        return found

    def changes(self, name: str) -> Iterator[tuple[float, str]]:
        """Time and value of each change, including the first; binary digits, most significant bit first."""
        variable = self._variables[self.signals[name].path]
        with reading(self._path):
            values = variable.tv
        for when, value in values:
            yield when * self._unit_s, str(value)

    def pulses(self, name: str) -> list[tuple[float, float]]:
        """Rise and fall of each pulse of a one-bit signal, without an unfinished last pulse."""
        found, rise = [], None
        for when, value in self.changes(name):
            if value == "1" and rise is None:
                rise = when
            elif value != "1" and rise is not None:
                found.append((rise, when))
                rise = None
        return found
