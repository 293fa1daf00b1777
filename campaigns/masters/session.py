# SPDX-License-Identifier: Apache-2.0
"""One master with a virtual card of its own: a relay between both, and the master's adapter as a process.

The relay passes every byte on and keeps it. It is a pty for the master. Times are wall time in s.
"""

from __future__ import annotations

import contextlib
import json
import os
import pty
import queue
import select
import socket
import subprocess
import tempfile
import termios
import threading
import time
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from campaigns.masters.cases import CUT, LONGER, PROFILES, Case, cases
from campaigns.masters.masters import SOCAT, Master
from rtl.sources import ROOT
from sim.card.run_card import Port, RunningCard
from tb.agents.crc16 import with_crc

TIMEOUT_S = 1.0  # the masters' time-out; exception 255 takes 0.35 s on a machine that keeps up
ENDLESS_S = 30.0  # a master that still waits then counts as endless
OPEN_S = 30.0
PIECE_S = 0.02  # silence that ends a frame
TRIES = 5  # readings with a master's own time-out: some time-outs are about as long as a reading
SETTLE_S = 0.6  # an answer that comes after its master gave up must not meet the next request
DEFAULT = "default"
ENDLESS = {"endless": True}


class MastersError(Exception):
    """Error for the user, in one line."""


class Relay:
    """A pty whose other end is the card's."""

    def __init__(self, card: Path) -> None:
        self.inside, self.outside = pty.openpty()
        tty.setraw(self.outside)
        self.path = os.ttyname(self.outside)
        self.card = Port(card)
        self.lengthen = False
        self.sent = self.heard = b""
        self._stopping = False
        self._thread = threading.Thread(target=self._pass_on, daemon=True)
        self._thread.start()

    def _pass_on(self) -> None:
        while not self._stopping:
            ready, _, _ = select.select([self.inside, self.card.fd], [], [], 0.05)
            if self.inside in ready:
                data = os.read(self.inside, 512)
                while self.lengthen and select.select([self.inside], [], [], PIECE_S)[0]:
                    data += os.read(self.inside, 512)
                self.sent += data
                self.card.write(with_crc(data[:-2] + b"\0") if self.lengthen else data)
            if self.card.fd in ready:
                data = os.read(self.card.fd, 512)
                self.heard += data
                os.write(self.inside, data)

    def forget(self) -> None:
        """Drops the bytes so far, also those that no master has read."""
        termios.tcflush(self.outside, termios.TCIFLUSH)
        self.sent = self.heard = b""

    def stop(self) -> None:
        self._stopping = True
        self._thread.join()
        self.card.close()
        os.close(self.inside)
        os.close(self.outside)


@contextlib.contextmanager
def tcp_of(device: str) -> Iterator[str]:
    """socat between a TCP port of this machine and the device; gives `host:port`."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        number = free.getsockname()[1]
    ends = [end.format(tcp=number, device=device) for end in SOCAT]
    process = subprocess.Popen(["socat", *ends], stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + OPEN_S
        while True:
            # The test of the port must not be a connection: socat would open the device for it.
            listening = subprocess.run(["cat", "/proc/net/tcp"], capture_output=True, text=True, check=True)
            if f":{number:04X} 00000000:0000 0A" in listening.stdout:
                break
            if process.poll() is not None or time.monotonic() > end:
                raise MastersError("socat does not listen")
            time.sleep(0.05)
        yield f"127.0.0.1:{number}"
    finally:
        process.terminate()
        process.wait()


class Asker:
    """The adapter as a process. `opened` is its first line."""

    def __init__(self, master: Master, port: str, timeout: float | str, parity: str) -> None:
        self.process = subprocess.Popen(
            [*master.command(), port, str(timeout), parity],
            cwd=ROOT,
            env=master.environ(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self.errors: list[str] = []
        self._reader_of_errors = threading.Thread(target=self._read_errors, daemon=True)
        self._reader_of_errors.start()
        self.opened = self._answer(OPEN_S)

    def _read(self) -> None:
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put("")

    def _read_errors(self) -> None:
        self.errors += self.process.stderr

    def _answer(self, seconds: float) -> dict:
        try:
            line = self._lines.get(timeout=seconds)
        except queue.Empty:
            return ENDLESS
        if not line:
            self.process.wait()
            self._reader_of_errors.join(1)
            return {"crash": " ".join(self.errors[-1:]).strip() or f"exit code {self.process.returncode}"}
        return json.loads(line)

    def ask(self, request: str, seconds: float = ENDLESS_S) -> dict:
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.write(f"{request}\n")
            self.process.stdin.flush()
        return self._answer(seconds)

    def close(self) -> None:
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.close()
        try:
            self.process.wait(2)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


@dataclass
class Place:
    """A running card with its relay."""

    card: RunningCard
    relay: Relay

    @contextlib.contextmanager
    def asker(self, master: Master, timeout: float | str = TIMEOUT_S, parity: str = "N") -> Iterator[Asker]:
        self.relay.forget()
        with contextlib.ExitStack() as stack:
            port = stack.enter_context(tcp_of(self.relay.path)) if master.by_tcp else self.relay.path
            asker = Asker(master, port, timeout, parity)
            stack.callback(asker.close)
            yield asker

    def ask(self, asker: Asker, case: Case, settle: float = 0.0) -> dict:
        """The answer, with the bytes of both directions, and the seconds that it took."""
        if case.trick == CUT:
            self.card.command("cut drive on")
        self.relay.lengthen = case.trick == LONGER
        self.relay.forget()
        began = time.monotonic()
        answer = asker.ask(case.request)
        took = time.monotonic() - began
        time.sleep(settle)
        sent, heard = self.relay.sent.hex(" "), self.relay.heard.hex(" ")
        self.relay.lengthen = False
        if case.trick == CUT:
            self.card.command("cut drive off")
        return {"answer": answer, "sent": sent, "heard": heard, "took": round(took, 3 if took < 0.1 else 1)}


@contextlib.contextmanager
def place(dialect: str) -> Iterator[Place]:
    """A card whose drive has just been switched on."""
    options = ("--dialect", dialect, "--profile", PROFILES[dialect], "--quiet", "--control")
    with tempfile.TemporaryDirectory() as folder, RunningCard(Path(folder), *options) as card:
        relay = Relay(card.link)
        try:
            yield Place(card, relay)
        finally:
            relay.stop()


def asked(master: Master, dialect: str) -> dict:
    """Every case of a dialect, with the recommended settings."""
    with place(dialect) as there, there.asker(master) as asker:
        if "ready" not in asker.opened:
            raise MastersError(f"{master.title} does not open the port: {asker.opened}")
        answers = {}
        for case in cases(dialect):
            around = [asker.ask(case.before)] if case.before else []
            answers[case.id] = there.ask(asker, case)
            around += [asker.ask(case.after)] if case.after else []
            wrong = [other for other in around if other != {"done": True}]
            answers[case.id] |= {"around": wrong} if wrong else {}
        return {"version": asker.opened["ready"], "answers": answers}


def by_default(master: Master) -> dict:
    """With the master's own time-out and repeats: readings, exception 255, and silence."""
    found = {}
    for dialect, case_id, tries in (
        ("card", "read-word", TRIES),
        ("card", "silent", 1),
        ("builtin", "silent", 1),
    ):
        (case,) = (case for case in cases(dialect) if case.id == case_id)
        with place(dialect) as there, there.asker(master, DEFAULT) as asker:
            found[f"{dialect} {case_id}"] = [there.ask(asker, case, SETTLE_S) for _ in range(tries)]
    return found


def with_parity(master: Master) -> dict:
    """Even parity on a pty, which carries none: the answer to the opening, or to the first request."""
    with place("card") as there, there.asker(master, parity="E") as asker:
        if "ready" not in asker.opened:
            return asker.opened
        return asker.ask("read-registers 2 1")
