# SPDX-License-Identifier: Apache-2.0
"""Records lines and LEDs of a bench in the format of the virtual card's --log and --pcap.

The recorder is the virtual card's own (sim/view), so the texts, marks on bad frames and files are the same.
Times are simulated time, those of the waveform.

`RECORD=base` in the environment (`make waves` sets it) makes every Rs485Line and card of a bench write
base.jsonl and base.pcapng; otherwise nothing is recorded. RECORD_DIALECT: the dialect of the texts.
RECORD_STRICT=0: silences up to t3.5 may be inside a frame (STRICT_T15 = 0).
"""

from __future__ import annotations

import atexit
import ctypes
import fcntl
import functools
import os
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from regs.generated.card_tables import DRIVE_PAUSE_TICKS, TICKS_PER_BIT
from tb.agents import rtu

if TYPE_CHECKING:
    from tb.agents.uart import Character, Format

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = Path("build/host/librecord.so")
MODBUS, DRIVE = 0, 1
PS_PER_NS = 1000
PS_PER_MS = 1_000_000_000
LED_LOOK_MS = 5  # period of LED samples


class RecordingError(Exception):
    """Recording failed; the message is one line."""


@functools.cache
def load_library() -> ctypes.CDLL:
    """Builds the library if it is missing or old, and loads it. Safe under parallel test workers."""
    directory = ROOT / LIBRARY.parent
    directory.mkdir(parents=True, exist_ok=True)
    with (directory / ".librecord.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        made = subprocess.run(
            ["make", "--silent", "--no-print-directory", "-f", "sim/view/record.mk", str(LIBRARY)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
    if made.returncode != 0:
        raise RecordingError(f"cannot build {LIBRARY}:\n{made.stdout}{made.stderr}")
    library = ctypes.CDLL(str(ROOT / LIBRARY))
    pointer, text, time, number = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_longlong, ctypes.c_int
    for name, result, arguments in (
        ("record_open", pointer, [text, text, text, text, ctypes.c_uint]),
        ("record_silences", None, [pointer, number, time, time, time]),
        ("record_byte", None, [pointer, number, number, number, number, number, time, time]),
        ("record_end_frame", None, [pointer, number]),
        ("record_led", None, [pointer, number, number, number, time]),
        ("record_write", None, [pointer, time]),
        ("record_network_line", None, [pointer, text]),
        ("record_close", number, [pointer, text, ctypes.c_uint]),
    ):
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library


class Recorder:
    """Writes BASE.jsonl and BASE.pcapng, without a simulator. Times in ps; use `with`, or call close()."""

    def __init__(self, base: Path, dialect: str = "card") -> None:
        self._library = load_library()
        self.log, self.pcap = Path(f"{base}.jsonl"), Path(f"{base}.pcapng")
        why = ctypes.create_string_buffer(200)
        self._recorder = self._library.record_open(
            str(self.log).encode(), str(self.pcap).encode(), dialect.encode(), why, len(why)
        )
        if not self._recorder:
            raise RecordingError(why.value.decode())

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self._recorder:
            why = ctypes.create_string_buffer(200)
            good = self._library.record_close(self._recorder, why, len(why))
            self._recorder = None
            if not good:
                raise RecordingError(why.value.decode())

    def use(self, line: int, fmt: Format, strict: bool = True) -> float:
        """Sets the silences of a line for this format; returns the silence that ends a frame, in ps."""
        if line == MODBUS:
            self._library.record_network_line(self._recorder, str(fmt).encode())
            inside, between = rtu.t15_ps(fmt.baud), rtu.t35_ps(fmt.baud)
        else:
            inside = between = DRIVE_PAUSE_TICKS / TICKS_PER_BIT * rtu.bit_ps(fmt.baud)
        character = between / (2 if line == DRIVE else 3.5)
        times = (inside if strict else between, between, character)
        self._library.record_silences(self._recorder, line, *(round(t / PS_PER_NS) for t in times))
        return between

    def character(self, line: int, from_card: bool, heard: Character) -> None:
        self._library.record_byte(
            self._recorder,
            line,
            from_card,
            heard.byte,
            not heard.parity_ok,
            not heard.stop_ok,
            heard.start_ps // PS_PER_NS,
            heard.end_ps // PS_PER_NS,
        )

    def end_frame(self, line: int) -> None:
        self._library.record_end_frame(self._recorder, line)

    def led(self, led: int, red: bool, green: bool, now_ps: int) -> None:
        self._library.record_led(self._recorder, led, red, green, now_ps // PS_PER_NS)

    def write(self, now_ps: int) -> None:
        """Writes all entries that no older one can follow any more; close() writes the rest."""
        self._library.record_write(self._recorder, now_ps // PS_PER_NS)


@functools.cache
def wanted() -> Recorder | None:
    """The recorder of this simulation, or None without RECORD."""
    base = os.environ.get("RECORD")
    if not base:
        return None
    recorder = Recorder(Path(base), os.environ.get("RECORD_DIALECT", "card"))
    atexit.register(recorder.close)
    return recorder
