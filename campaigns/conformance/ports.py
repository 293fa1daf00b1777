# SPDX-License-Identifier: Apache-2.0
"""The driver for a serial port or a pty, which shows bytes only. A port's error is one line for the user."""

from __future__ import annotations

import os
import select
import termios
import time
from typing import Protocol

from campaigns.conformance.cases import BYTES, CHARACTER, LONGEST_FRAME, Heard, Send
from sim.harness.serial_port import PortError, in_use, opened

QUIET_S = 0.1  # silence that ends a reply: adapters and busy machines deliver a frame in pieces


class Port(Protocol):
    """Bytes out and in."""

    name: str

    def write(self, data: bytes) -> None: ...

    def read(self, seconds: float) -> bytes: ...


class PtyPort:
    """The controlling end of a pty; `name` is the port for the slave's program."""

    def __init__(self) -> None:
        self._ours, self._theirs = os.openpty()
        settings = termios.tcgetattr(self._theirs)
        settings[0] = settings[1] = settings[3] = 0  # raw: nothing is echoed or changed
        settings[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        termios.tcsetattr(self._theirs, termios.TCSANOW, settings)
        self.name = os.ttyname(self._theirs)

    def __enter__(self) -> PtyPort:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._ours)
        os.close(self._theirs)

    def write(self, data: bytes) -> None:
        os.write(self._ours, data)

    def read(self, seconds: float) -> bytes:
        ready, _, _ = select.select([self._ours], [], [], max(0.0, seconds))
        return os.read(self._ours, 4096) if ready else b""


class SerialPort:
    """A serial device or a pty. A pty takes no parity: ask for none there."""

    def __init__(self, name: str, baud: int = 9600, form: str = "8N1"):
        self.name = name
        self._port = opened(name, baud, form)

    def __enter__(self) -> SerialPort:
        return self

    def __exit__(self, *_: object) -> None:
        self._port.close()

    def write(self, data: bytes) -> None:
        with in_use(self.name):
            self._port.write(data)
            self._port.flush()

    def read(self, seconds: float) -> bytes:
        with in_use(self.name):
            ready, _, _ = select.select([self._port.fileno()], [], [], max(0.0, seconds))
            return self._port.read(4096) if ready else b""


class ByteDriver:
    """Whole frames on a port.

    timeout_s: longest wait for a reply. quiet_s: silence that ends a reply.
    """

    sees = frozenset({BYTES})

    def __init__(self, port: Port, baud: int = 9600, timeout_s: float = 0.5, quiet_s: float = QUIET_S):
        self.port, self.baud, self.timeout_s, self.quiet_s = port, baud, timeout_s, quiet_s

    def exchange(self, send: Send) -> Heard:
        assert not send.needs_edges, "a port shows bytes only"
        early = b""  # these bytes belong to no request
        while more := self.port.read(0.0):
            early = self._within(early + more)
        if not send.data:
            return Heard(self._reply(self.timeout_s, early))
        self.port.write(send.data)
        line_s = len(send.data) * CHARACTER / self.baud
        return Heard(self._reply(self.timeout_s + line_s))

    def _reply(self, seconds: float, heard: bytes = b"") -> bytes:
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            more = self.port.read(left)
            if more:
                heard = self._within(heard + more)
                until = time.monotonic() + self.quiet_s
        return heard

    def _within(self, heard: bytes) -> bytes:
        """The bytes, unless they are too many: a line that is never silent would never end a test."""
        if len(heard) > 2 * LONGEST_FRAME:
            raise PortError(f"{self.port.name} is never silent; check its rate and the bias of the line")
        return heard
