# SPDX-License-Identifier: Apache-2.0
"""Plays the documents' examples (tb/model/examples.json) to the virtual card and records them.

A scripted drive answers each example's telegrams and no others. Before each example, requests restore the
card's state after power-up; these requests are in the recording too.
"""

from __future__ import annotations

import os
import select
import termios
import threading
import time
import tty
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from sim.card.run_card import CardError, Frame, RunningCard
from tb.agents.crc16 import with_crc
from tb.model.examples import EXAMPLES

STATUS = bytes.fromhex("02 06 81 0F 03 20 00 A9")
NO_COMMAND = bytes.fromhex("02 06 81 00 00 00 00 85")
# Coils 1-32 off, coil 65 off, registers 40001-40003 at their defaults.
AS_AT_POWER_UP = [
    with_crc(bytes.fromhex(pdu))
    for pdu in (
        "01 0F 00 00 00 20 04 00 00 00 00",
        "01 05 00 40 00 00",
        "01 10 00 00 00 03 06 0000 03E8 000F",
    )
]
REPLY_S = 10.0  # wall time for a reply on a busy machine
BETWEEN_S = 0.02  # wall time for the telegram of a broadcast


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


class ScriptedDrive:
    """Answers complete telegrams from a table and ignores all others."""

    def __init__(self, link: Path, replies: dict[bytes, bytes] | None = None) -> None:
        self.replies = replies or {}
        self.telegrams: list[bytes] = []
        self.heard = b""  # of a telegram that is not complete
        self._port = Port(link)
        self._stopping = False
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while not self._stopping:
            self.heard += self._port.read(1, 0.05)
            if len(self.heard) > 1 and len(self.heard) == self.heard[1] + 2:
                telegram, self.heard = self.heard, b""
                self.telegrams.append(telegram)
                if reply := self.replies.get(telegram):
                    self._port.write(reply)

    def stop(self) -> None:
        self._stopping = True
        self._thread.join()
        self._port.close()


@dataclass(frozen=True)
class Played:
    """An example with the numbers (from 1) and kinds of its frames in the recording."""

    id: str
    example: dict
    first_packet: int
    frames: tuple[Frame, ...]


@dataclass(frozen=True)
class Recorded:
    played: tuple[Played, ...]
    frames: tuple[Frame, ...]
    pcap: Path
    log: Path
    wave: Path | None


class ExampleRun:
    """A virtual card, its master and its drive."""

    def __init__(self, folder: Path, wave: bool = False, options: tuple[str, ...] = ()) -> None:
        self.pcap, self.wave = folder / "card.pcapng", folder / "card.fst" if wave else None
        link = folder / "drive"
        files = ["--pcap", str(self.pcap), *(["--wave", str(self.wave)] if wave else [])]
        self.card = RunningCard(folder, "--drive", str(link), "--speed", "max", "--quiet", *files, *options)
        self.master, self.drive = Port(self.card.link), ScriptedDrive(link)

    def __enter__(self) -> ExampleRun:
        return self

    def __exit__(self, *_: object) -> None:
        self.drive.stop()
        self.master.close()
        self.card.stop()

    def ask(self, part: dict) -> None:
        """Sends one request of an example and checks the reply."""
        self.drive.replies = {
            bytes.fromhex(d["telegram"]): bytes.fromhex(d["reply"]) for d in part["drive"] if d["reply"]
        } | ({} if part["drive"] else {NO_COMMAND: STATUS})
        before = len(self.card.frames())
        self.master.write(bytes.fromhex(part["request"]))
        if part["reply"] is None:
            self.card.wait_for_frames(before, "drive", "card")
            time.sleep(BETWEEN_S)
            return
        expected = bytes.fromhex(part["reply"])
        got = self.master.read(len(expected), REPLY_S)
        if got != expected:
            raise CardError(f"{part['request']}: {got.hex(' ')} instead of {part['reply']}")
        self.card.wait_for_frames(before, "modbus", "card")

    def as_at_power_up(self) -> None:
        for request in AS_AT_POWER_UP:
            # The reply to a write begins like its request.
            reply = request if request[1] == 0x05 else with_crc(request[:6])
            self.ask({"request": request.hex(), "reply": reply.hex(), "drive": []})

    def beginnings(self, example: dict) -> None:
        if "after" in example:
            before = EXAMPLES[example["after"]]
            self.beginnings(before)
            self.ask(before)
        for part in example.get("setup", ()):
            self.ask(part)

    def play(self, name: str) -> Played:
        example = EXAMPLES[name]
        self.as_at_power_up()
        self.beginnings(example)
        before = len(self.card.frames())
        self.ask(example)
        return Played(name, example, before + 1, tuple(self.card.frames()[before:]))


def record(folder: Path, names: tuple[str, ...] = tuple(EXAMPLES), wave: bool = False) -> Recorded:
    """Plays the examples; the recorded files are in `folder`."""
    with ExampleRun(folder, wave) as run:
        played = tuple(run.play(name) for name in names)
    return Recorded(played, tuple(run.card.frames()), run.pcap, run.card.log, run.wave)
