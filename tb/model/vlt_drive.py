# SPDX-License-Identifier: Apache-2.0
"""The simulated drive for Python: a ctypes wrapper of sim/drive/vlt_drive.c.

The virtual card uses the same code, so every test sees the same drive. Values are raw, as transferred.
Times are simulated microseconds; time passes only in `step()`. No cocotb inside.

    drive = VltDrive()                  # a VLT 6000, powered up, stopped, status word 0607h
    drive = VltDrive("vlt2800")         # or another of PROFILES
    reply = drive.telegram(request)     # bytes, or None for silence
    drive.step(1_000_000)               # a second later
"""

from __future__ import annotations

import ctypes
import fcntl
import functools
import subprocess
from enum import IntEnum
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = Path("build/host/libvltdrive.so")
REPLY_MAX = 12 + 60
TEXT_MAX = 60
PROFILE_FOLDER = ROOT / "sim" / "drive"
PROFILES = tuple(sorted(table.stem for table in PROFILE_FOLDER.glob("*.csv")))


class Outcome(IntEnum):
    """Result of a telegram (drive_outcome_t)."""

    REPLIED = 0
    BROADCAST = 1
    NOT_MINE = 2
    DAMAGED = 3


class DriveError(ValueError):
    """The drive cannot do an access from outside the bus; `fault` is its fault number."""

    def __init__(self, pnu: int, fault: int):
        super().__init__(f"parameter {pnu}: fault {fault}")
        self.fault = fault


@functools.cache
def load_library() -> ctypes.CDLL:
    """Builds the library if it is missing or old, and loads it. Safe under parallel test workers."""
    directory = ROOT / LIBRARY.parent
    directory.mkdir(parents=True, exist_ok=True)
    with (directory / ".libvltdrive.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        made = subprocess.run(
            ["make", "--silent", "--no-print-directory", "-f", "sim/drive/drive.mk", str(LIBRARY)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
    if made.returncode != 0:
        raise RuntimeError(f"cannot build {LIBRARY}:\n{made.stdout}{made.stderr}")
    library = ctypes.CDLL(str(ROOT / LIBRARY))
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    u8, u16, u32 = ctypes.c_uint8, ctypes.c_uint16, ctypes.c_uint32
    i64, integer, text = ctypes.c_int64, ctypes.c_int, ctypes.c_char_p
    value = ctypes.POINTER(i64)
    for name, result, arguments in (
        ("drive_size", size, []),
        ("drive_profile", pointer, [text]),
        ("drive_init", None, [pointer, pointer]),
        ("drive_power_cycle", None, [pointer]),
        ("drive_telegram", integer, [pointer, text, size, pointer, ctypes.POINTER(size)]),
        ("drive_step", None, [pointer, u32]),
        ("drive_example_state", None, [pointer]),
        ("drive_force_process", None, [pointer, u16, u16]),
        ("drive_set", integer, [pointer, u16, u8, i64]),
        ("drive_set_text", integer, [pointer, u16, text]),
        ("drive_get", integer, [pointer, u16, u8, value]),
        ("drive_get_text", integer, [pointer, u16, pointer]),
        ("drive_trip", None, [pointer, u8]),
        ("drive_status_word", u16, [pointer]),
        ("drive_frequency_word", u16, [pointer]),
        ("drive_control_word", u16, [pointer]),
        ("drive_reference_word", u16, [pointer]),
        ("drive_frequency_mhz", ctypes.c_int32, [pointer]),
        ("drive_alarm", u8, [pointer]),
        ("drive_running", ctypes.c_bool, [pointer]),
    ):
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library


class VltDrive:
    """One simulated drive; `profile` is one of PROFILES, else ValueError.

    `example=True` starts it in the state of the examples in the profile's own document.
    """

    def __init__(self, profile: str = "vlt6000", example: bool = False):
        self._library = load_library()
        self._drive = ctypes.create_string_buffer(self._library.drive_size())
        self._profile = self._library.drive_profile(profile.encode())
        if not self._profile:
            raise ValueError(f"no drive profile '{profile}', only {', '.join(PROFILES)}")
        self.outcome: Outcome | None = None  # of the last telegram
        self.init()
        if example:
            self.example_state()

    def init(self) -> None:
        """Resets every parameter to its default; motor stopped, nothing forced."""
        self._library.drive_init(self._drive, self._profile)

    def power_cycle(self) -> None:
        """Mains off and on: RAM values come back from EEPROM."""
        self._library.drive_power_cycle(self._drive)

    def telegram(self, request: bytes) -> bytes | None:
        """Takes one whole telegram; returns the reply, or None for silence (`outcome` gives the reason)."""
        reply = ctypes.create_string_buffer(REPLY_MAX)
        length = ctypes.c_size_t()
        self.outcome = Outcome(
            self._library.drive_telegram(
                self._drive, bytes(request), len(request), reply, ctypes.byref(length)
            )
        )
        return reply.raw[: length.value] if self.outcome is Outcome.REPLIED else None

    def step(self, microseconds: int) -> None:
        """Advances simulated time."""
        while microseconds > 0:
            part = min(microseconds, 0xFFFFFFFF)
            self._library.drive_step(self._drive, part)
            microseconds -= part

    def example_state(self) -> None:
        """Sets the state of the examples in the profile's document (drive_example_state)."""
        self._library.drive_example_state(self._drive)

    def force_process(self, status: int, frequency: int) -> None:
        """Forces status and output frequency word; the motor then stands still."""
        self._library.drive_force_process(self._drive, status, frequency)

    def _done(self, pnu: int, fault: int) -> None:
        if fault != -1:
            raise DriveError(pnu, fault)

    def set(self, pnu: int, value: int, index: int = 0) -> None:
        """Sets a value in RAM and EEPROM, regardless of limits and rights; forces a readout."""
        self._done(pnu, self._library.drive_set(self._drive, pnu, index, value))

    def get(self, pnu: int, index: int = 0) -> int:
        value = ctypes.c_int64()
        self._done(pnu, self._library.drive_get(self._drive, pnu, index, ctypes.byref(value)))
        return value.value

    def set_text(self, pnu: int, text: str) -> None:
        """Sets a text of up to 60 characters, more than fit through the card."""
        self._done(pnu, self._library.drive_set_text(self._drive, pnu, text.encode("ascii")))

    def get_text(self, pnu: int) -> str:
        text = ctypes.create_string_buffer(TEXT_MAX + 1)
        self._done(pnu, self._library.drive_get_text(self._drive, pnu, text))
        return text.value.decode("latin-1")

    def trip(self, alarm: int) -> None:
        """Trips with alarm 1 to 99."""
        self._library.drive_trip(self._drive, alarm)

    @property
    def status_word(self) -> int:
        return self._library.drive_status_word(self._drive)

    @property
    def frequency_word(self) -> int:
        return self._library.drive_frequency_word(self._drive)

    @property
    def control_word(self) -> int:
        """The last valid control word, 0 before the first."""
        return self._library.drive_control_word(self._drive)

    @property
    def reference_word(self) -> int:
        return self._library.drive_reference_word(self._drive)

    @property
    def frequency_mhz(self) -> int:
        """Output frequency in mHz, negative in reverse."""
        return self._library.drive_frequency_mhz(self._drive)

    @property
    def alarm(self) -> int:
        return self._library.drive_alarm(self._drive)

    @property
    def running(self) -> bool:
        return self._library.drive_running(self._drive)
