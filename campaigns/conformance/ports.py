# SPDX-License-Identifier: Apache-2.0
"""The driver for a serial port or a pty: what bytes can show. Errors of a port are one line for the user."""

from __future__ import annotations

import errno
import os
import select
import termios
import time
from typing import Protocol

from campaigns.conformance.cases import BYTES, CHARACTER, Heard, Send

QUIET_S = 0.1  # silence that ends a reply: adapters and busy machines deliver a frame in pieces


class PortError(Exception):
    """Error for the user, in one line."""


class Port(Protocol):
    """Bytes out and in."""

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
    """A port that pyserial opens, a device or a pty. A pty takes no parity: ask for none there."""

    def __init__(self, name: str, baud: int = 9600, form: str = "8N1"):
        import serial

        self.name = name
        try:
            self._port = serial.Serial(
                name, baud, parity=form[1], stopbits=int(form[2]), timeout=0, exclusive=True
            )
        except (OSError, ValueError, termios.error) as error:
            raise PortError(self._reason(error, f"{baud} {form}")) from None

    def _reason(self, error: Exception, line: str) -> str:
        number = getattr(error, "errno", None) or (error.args[0] if error.args else None)
        if "exclusively lock" in str(error) or number == errno.EBUSY:
            return f"{self.name} is in use by another program"
        if number == errno.ENOENT:
            return f"there is no {self.name}"
        if number == errno.EACCES:
            return f"no permission for {self.name}: join the group that owns it, often dialout"
        if number == errno.EINVAL:
            return f"{self.name} refuses {line}; a pty takes no parity"
        return f"{self.name} is no serial port that can be opened"

    def __enter__(self) -> SerialPort:
        return self

    def __exit__(self, *_: object) -> None:
        self._port.close()

    def write(self, data: bytes) -> None:
        try:
            self._port.write(data)
            self._port.flush()
        except (OSError, termios.error):
            raise PortError(f"{self.name} has gone") from None

    def read(self, seconds: float) -> bytes:
        try:
            ready, _, _ = select.select([self._port.fileno()], [], [], max(0.0, seconds))
            return self._port.read(4096) if ready else b""
        except (OSError, termios.error):
            raise PortError(f"{self.name} has gone") from None


class ByteDriver:
    """Whole frames on a port.

    timeout_s: silence for so long after a request is no reply. quiet_s: silence that ends a reply.
    """

    sees = frozenset({BYTES})

    def __init__(self, port: Port, baud: int = 9600, timeout_s: float = 0.5, quiet_s: float = QUIET_S):
        self.port, self.baud, self.timeout_s, self.quiet_s = port, baud, timeout_s, quiet_s

    def exchange(self, send: Send) -> Heard:
        assert not send.needs_edges, "a port shows bytes only"
        while self.port.read(0.0):
            pass  # what came late belongs to no request
        self.port.write(send.data)
        line_s = len(send.data) * CHARACTER / self.baud
        return Heard(self._reply(self.timeout_s + line_s))

    def _reply(self, seconds: float) -> bytes:
        heard, until = b"", time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            more = self.port.read(left)
            if more:
                heard += more
                until = time.monotonic() + self.quiet_s
        return heard
