# SPDX-License-Identifier: Apache-2.0
"""A pty with a slave's program on its other end."""

from __future__ import annotations

import os
import select
import tty


class PtyPort:
    """The controlling end, as a port of sw/rtu2fc/port.py; `name` is the port for the slave's program."""

    def __init__(self) -> None:
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)  # nothing is echoed or changed
        self.name = os.ttyname(self._theirs)

    def __enter__(self) -> PtyPort:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        os.close(self._ours)
        os.close(self._theirs)

    def write(self, data: bytes) -> None:
        os.write(self._ours, data)

    def read(self, seconds: float) -> bytes:
        ready, _, _ = select.select([self._ours], [], [], max(0.0, seconds))
        return os.read(self._ours, 4096) if ready else b""
