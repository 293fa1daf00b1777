# SPDX-License-Identifier: Apache-2.0
"""Starts build/card for scripts and tests, and reads its log while it runs.

Times in the log are simulated seconds (s) since the release of the card's reset.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import select
import signal
import subprocess
import termios
import threading
import time
import tty
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Self

ROOT = Path(__file__).resolve().parents[2]
CARD = ROOT / os.environ.get("VIRTUAL_CARD", "build/card")
START_S = 30.0  # wall time for build/card to become ready, on a busy machine
ANSWERS = ("ok", "error: ", "{", "trip ")  # beginnings of --control answers, unlike all other output
FRAME_S = 10.0  # wall time to wait for a frame


class CardError(Exception):
    """Error for the user, in one line."""


class Frame(NamedTuple):
    """A frame of the log; `start` and `end` in simulated seconds."""

    start: float
    end: float
    line: str
    sender: str
    data: bytes
    ok: bool
    what: str

    @classmethod
    def of(cls, e: dict) -> Frame:
        return cls(e["t"], e["end"], e["line"], e["from"], bytes.fromhex(e["bytes"]), e["ok"], e["what"])


class Port:
    """One side of a serial line, byte for byte; times in wall seconds."""

    def __init__(self, path: Path | str) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.fd, termios.TCSANOW)  # keeps pending bytes, as many programs do

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        os.close(self.fd)

    def write(self, data: bytes) -> None:
        os.write(self.fd, data)

    def read(self, count: int, seconds: float = 5.0) -> bytes:
        """Returns `count` bytes, or fewer after `seconds`."""
        data, end = b"", time.monotonic() + seconds
        while len(data) < count and select.select([self.fd], [], [], max(0.0, end - time.monotonic()))[0]:
            part = os.read(self.fd, count - len(data))
            if not part:  # the other end is closed
                break
            data += part
        return data


def option(options: Sequence[str], name: str) -> str | None:
    """Value of an option of build/card; the last one counts."""
    found = None
    for at, text in enumerate(options):
        if text.startswith(f"{name}="):
            found = text.partition("=")[2]
        elif text == name and at + 1 < len(options):
            found = options[at + 1]
    return found


class RunningCard:
    """A virtual card as a process and context manager. `options` go to its command line unchanged.

    Its link and its log are in `folder`, unless an option names others. program: build/card, unless another
    is given, such as that of the small card. apart: Ctrl-C does not reach it.
    """

    def __init__(self, folder: Path, *options: str, program: Path = CARD, apart: bool = False) -> None:
        if not program.exists():
            raise CardError(f"{program.relative_to(ROOT)} is missing: run `make card`")
        self.link = Path(option(options, "--modbus") or folder / "modbus")
        self.log = Path(option(options, "--log") or folder / "card.jsonl")
        files = [] if option(options, "--modbus-device") else ["--modbus", self.link]
        self.output: list[str] = []
        self._entries: list[dict] = []
        self._read_bytes = 0
        self.process = subprocess.Popen(
            [program, *options, *files, "--log", self.log],
            stdin=subprocess.PIPE if "--control" in options else None,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=apart,
        )
        self._answers: queue.Queue[str] = queue.Queue()
        self._is_ready = threading.Event()
        self._reader = threading.Thread(target=self._read_output, daemon=True)
        self._reader.start()
        if not self._is_ready.wait(START_S) or self.ready_line is None:
            self.stop()
            raise CardError(f"build/card does not get ready: {' '.join(self.output) or 'it prints nothing'}")

    @property
    def ready_line(self) -> str | None:
        return next((line for line in self.output if line.startswith("ready ")), None)

    def _read_output(self) -> None:
        for line in self.process.stdout:
            if line.startswith(ANSWERS):
                self._answers.put(line.rstrip("\n"))
                continue
            self.output.append(line.rstrip("\n"))
            if line.startswith("ready "):
                self._is_ready.set()
        self._is_ready.set()
        self._answers.put("")

    def command(self, text: str) -> str:
        """One-line answer of the card to a command; needs the option --control."""
        self.process.stdin.write(f"{text}\n")
        self.process.stdin.flush()
        with contextlib.suppress(queue.Empty):
            if answer := self._answers.get(timeout=FRAME_S):
                return answer
        raise CardError(f"no answer to '{text}'")

    def state(self) -> dict:
        return json.loads(self.command("state"))

    def __enter__(self) -> RunningCard:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self, how: signal.Signals = signal.SIGINT) -> int:
        """Ends the card and returns its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(how)
        return self.wait()

    def wait(self, seconds: float = START_S) -> int:
        """Waits for a card that ends by itself; returns its exit code."""
        try:
            code = self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise CardError("build/card does not end") from None
        self._reader.join(seconds)
        return code

    def new_entries(self) -> list[dict]:
        """Complete lines of the log since the last call."""
        with self.log.open("rb") as log:
            log.seek(self._read_bytes)
            whole = b"".join(log.read().rpartition(b"\n")[:2])
        self._read_bytes += len(whole)
        return list(map(json.loads, whole.splitlines()))

    def entries(self) -> list[dict]:
        """Complete lines of the log so far. Each is read once: tests ask again every few ms."""
        self._entries += self.new_entries()
        return list(self._entries)

    def frames(self) -> list[Frame]:
        return [Frame.of(entry) for entry in self.entries() if "line" in entry]

    def wait_for_frames(self, after: int, line: str, sender: str, seconds: float = FRAME_S) -> list[Frame]:
        """Frames from number `after` on, as soon as one is from `sender` on `line`, or after `seconds`."""
        end = time.monotonic() + seconds
        while True:
            frames = self.frames()[after:]
            if any(f.line == line and f.sender == sender for f in frames) or time.monotonic() > end:
                return frames
            time.sleep(0.005)
