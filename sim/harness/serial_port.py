# SPDX-License-Identifier: Apache-2.0
"""Serial ports and ptys of this computer, opened for one program. An error is one line for the user."""

from __future__ import annotations

import contextlib
import errno
import termios
from collections.abc import Iterator

import serial


class PortError(Exception):
    """Error for the user, in one line."""


def opened(name: str, baud: int, form: str) -> serial.Serial:
    """The open port, for example `opened("/dev/ttyUSB0", 9600, "8N2")`. Its reads return at once."""
    try:
        return serial.Serial(name, baud, parity=form[1], stopbits=int(form[2]), timeout=0, exclusive=True)
    except (OSError, ValueError, termios.error) as error:
        raise PortError(_reason(error, name, baud, form)) from None


@contextlib.contextmanager
def in_use(name: str) -> Iterator[None]:
    """For reads and writes: an adapter can be pulled out."""
    try:
        yield
    except (OSError, termios.error):
        raise PortError(f"{name} went away") from None


def _reason(error: Exception, name: str, baud: int, form: str) -> str:
    number = getattr(error, "errno", None) or (error.args[0] if error.args else None)
    if "exclusively lock" in str(error) or number == errno.EBUSY:
        return f"{name} is in use by another program"
    if number == errno.ENOENT:
        return f"there is no {name}"
    if number == errno.EACCES:
        return f"no permission for {name}: join the group that owns it, often dialout"
    if number == errno.EINVAL:
        return f"{name} refuses {baud} {form}{'; a pty takes no parity' if form[1] != 'N' else ''}"
    return f"{name} is no serial port that can be opened"
