# SPDX-License-Identifier: Apache-2.0
"""Serial ports on any system, frames on them, and a record of all bytes with their times.

Times are in seconds. They are of the computer's clock, so that an adapter's delay is in them.
"""

from __future__ import annotations

import contextlib
import errno
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import serial
from serial.tools import list_ports

from . import VERSION
from .crc16 import crc_good
from .problem import PortError, Problem
from .rtu import PS_PER_S, t35_ps

SLACK_S = 0.15  # adapter and computer; silence is so much longer than the latest reply
POLL_S = 0.01
LONGEST_FRAME = 256
HEXADECIMAL = ("sent", "early", "heard")  # in a record
Talk = tuple[float, bytes, bytes, float]  # time, bytes before and after the frame, seconds to the last one


@contextlib.contextmanager
def written(file: object) -> Iterator[None]:
    """What the system says of a full disk does not name the file."""
    try:
        yield
    except OSError as error:
        raise Problem(f"{file}: {error.strerror}") from None


def known_ports() -> list[tuple[str, str]]:
    """Name and description of each serial port of this computer."""
    found = list_ports.comports()
    return sorted((port.device, (port.description or "").removeprefix("n/a")) for port in found)


class SerialPort:
    """A serial port, a pty (which takes no parity), or a URL of pyserial such as socket://host:port."""

    def __init__(self, name: str, baud: int = 9600, form: str = "8N2") -> None:
        self.name = name
        try:
            self._port = serial.serial_for_url(
                name, baud, parity=form[1], stopbits=int(form[2]), timeout=POLL_S, exclusive=True
            )
        except Exception as error:  # pyserial lets errors of the system through, some of them no OSError
            raise _refused(error, name, baud, form) from None

    def close(self) -> None:
        self._port.close()

    def write(self, data: bytes) -> None:
        with self._in_use():
            self._port.write(data)
            self._port.flush()

    def read(self, seconds: float) -> bytes:
        """The bytes that are there, as soon as there is one."""
        until = time.monotonic() + seconds
        with self._in_use():
            while True:
                if heard := self._port.read(max(1, self._port.in_waiting)) if seconds else self._waiting():
                    return heard
                if time.monotonic() >= until:
                    return b""

    def _waiting(self) -> bytes:
        return self._port.read(self._port.in_waiting) if self._port.in_waiting else b""

    @contextlib.contextmanager
    def _in_use(self) -> Iterator[None]:
        """An adapter can be pulled out."""
        try:
            yield
        except Exception:
            raise PortError(f"{self.name} went away") from None


def _refused(error: Exception, name: str, baud: int, form: str) -> PortError:
    number = getattr(error, "errno", None) or (error.args[0] if error.args else None)
    text, windows = str(error), sys.platform == "win32"
    if "exclusively lock" in text or number == errno.EBUSY or (windows and "PermissionError" in text):
        return PortError(f"{name} is in use by another program", "Close the program that has it open.")
    if number == errno.ENOENT or "FileNotFoundError" in text:
        there = ", ".join(device for device, _ in known_ports()) or "none; is the adapter plugged in?"
        return PortError(f"there is no {name}", f"Ports of this computer: {there}")
    if number == errno.EACCES:
        return PortError(f"no permission for {name}: join the group that owns it, often dialout")
    if name.startswith("socket://") and ":" not in name.removeprefix("socket://"):
        return PortError(f"{name} lacks the number of its port, as in {name}:7000")
    if "://" in name:
        return PortError(f"{name} cannot be opened: {text.rpartition(': ')[2]}")
    if number == errno.EINVAL:
        return PortError(f"{name} refuses {baud} {form}{'; a pty takes no parity' if form[1] != 'N' else ''}")
    return PortError(f"{name} is no serial port that can be opened")


# ---------------------------------------------------------------- frames


def complete(answer: bytes) -> bool:
    """Whether it is a good frame of the length that its function says; of others only a silence is the end.

    The CRC alone is not enough: a frame whose CRC ends in 00 is good without its last byte, too.
    """
    if len(answer) < 5 or not crc_good(answer):
        return False
    code = answer[1]
    if code & 0x80:
        return len(answer) == 5
    if code in (1, 2, 3, 4, 0x11):
        return len(answer) == 5 + answer[2]
    return code in (5, 6, 8, 0x0B, 15, 16) and len(answer) == 8


class Line:
    """Frames out, and the answer or silence back. `record`: all bytes and their times go into this file.

    `port`: a SerialPort, or anything with its name and its write, read and close.
    `at`: time of the line at the end of the last exchange, from its start on.
    """

    def __init__(self, port: SerialPort, baud: int, form: str, record: Path | None = None) -> None:
        self.port, self.name, self.baud, self.form = port, port.name, baud, form
        bits = 9 + (form[1] != "N") + int(form[2])
        self.character_s = bits / baud
        self.t35_s = t35_ps(baud) / PS_PER_S
        self.echoes = False  # the adapter hears itself
        self.stray = b""  # bytes outside of an exchange
        self.at = 0.0
        self._began, self._quiet_at = time.monotonic(), 0.0
        self._record = None
        if record is not None:
            self._record = record.open("w", encoding="ascii")
            self._note({"rtu2fc": VERSION, "port": self.name, "baud": baud, "format": form})

    def close(self) -> None:
        self.port.close()
        if self._record:
            self._keep(self._record.close)

    def exchange(
        self, frame: bytes, wait_s: float, quiet_s: float | None = None, whole: bool = True
    ) -> tuple[bytes, float]:
        """The bytes within `wait_s` after the frame, with all that follow without a pause, and their time.

        The time is from the call to the last byte, less the characters on the line. `whole`: a good frame
        ends the answer at once; else only a silence of `quiet_s` does. Without a frame it only listens.
        """
        sent_at, early, heard, took_s = self._talk(frame, wait_s, quiet_s or SLACK_S, whole)
        self._note({"t": round(sent_at, 6), "sent": frame.hex(), "early": early.hex(), "heard": heard.hex(),
                    "took": round(took_s, 6)})  # fmt: skip
        self.at = sent_at + took_s
        if not frame:
            return early + heard, took_s
        self.stray += early
        own = len(frame) if self.echoes else 0
        # An echo that is not the frame stays in the answer: two senders, or a loose wire.
        answer = heard[own:] if heard[:own] == frame[:own] else heard
        return answer, took_s - (len(frame) + len(answer)) * self.character_s

    def _talk(self, frame: bytes, wait_s: float, quiet_s: float, whole: bool) -> Talk:
        time.sleep(max(0.0, self._quiet_at - time.monotonic()))
        early = b""
        while more := self.port.read(0.0):
            early = self._within(early + more)
        own = len(frame) if self.echoes else 0
        began = last = time.monotonic()
        if frame:
            self.port.write(frame)
        end, heard = began + len(frame) * self.character_s + wait_s, b""
        while (left := end - time.monotonic()) > 0:
            if not (more := self.port.read(left)):
                continue
            heard, last = self._within(heard + more), time.monotonic()
            if whole and complete(heard[own:]):
                break
            if len(heard) > own:
                end = last + quiet_s + 4 * self.character_s
        self._quiet_at = time.monotonic() + self.t35_s + 2 * self.character_s
        return began - self._began, early, heard, last - began

    def _within(self, heard: bytes) -> bytes:
        """The bytes, unless they are too many: a line that is never silent would never end a test."""
        if len(heard) > 3 * LONGEST_FRAME:
            raise PortError(f"{self.name} is never silent", "Check the rate, and the bias of the line.")
        return heard

    def _note(self, entry: dict) -> None:
        if self._record:
            self._keep(lambda: self._record.write(json.dumps(entry) + "\n"))

    def _keep(self, write: Callable[[], object]) -> None:
        """A full disk is said once. The line works on without its record: a stop may have to be sent."""
        try:
            with written(self._record.name):
                write()
        except Problem:
            record, self._record = self._record, None
            with contextlib.suppress(OSError):
                record.close()
            raise


class Replay(Line):
    """A recorded line: the same requests get the recorded answers, at once."""

    def __init__(self, file: Path) -> None:
        self._file = file
        try:
            head, *self._left = map(json.loads, file.read_text(encoding="ascii").splitlines())
            self.name, baud, form = head["port"], head["baud"], head["format"]
            self._left = [
                (one["t"], *(bytes.fromhex(one[key]) for key in HEXADECIMAL), one["took"])
                for one in self._left
            ]
        except (ValueError, KeyError, TypeError, AttributeError):
            raise Problem(f"{file} is no record of rtu2fc (--record)") from None
        super().__init__(self, baud, form)

    def close(self) -> None: ...

    def _talk(self, frame: bytes, wait_s: float, quiet_s: float, whole: bool) -> Talk:
        at, sent, *heard = self._left.pop(0) if self._left else (0.0, None)
        if sent != frame:
            now = frame.hex(" ") or "nothing"
            then = "the record ends here" if sent is None else f"the record has {sent.hex(' ') or 'nothing'}"
            raise Problem(f"{self._file}: {then}, but this run sends {now}; give the options of the record")
        return (at, *heard)
