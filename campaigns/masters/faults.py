# SPDX-License-Identifier: Apache-2.0
"""What a slave may do to `rtu2fc`, and others on the bus to the card: scenarios of pymodbus and ESPHome.

The faults are those of pymodbus' simulator: error, delay, junk, empty and split replies. pymodbus 3.16 keeps
them in its web page and sends none, so test_faults.py does it by the hooks of pymodbus' server. ESPHome's
component tests the same, and puts traffic of others beside a slave. The rows are in the handbook's table.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """`says`: begins the only line of the command, whose advice is indented. `code`: its exit code."""

    name: str
    title: str
    says: str
    code: int


VALUE = "the value"
DRIVE_SILENT = "the card answers, but its drive does not"  # other registers are answered
FAULTS = (
    Fault("delay", "answers 0.3 s late", VALUE, 0),
    Fault("split", "sends its reply in two parts, 40 ms apart", VALUE, 0),
    Fault("slow", "answers each request 0.5 s after the longest wait", VALUE, 0),
    Fault("late", "answers after the longest wait of the request and its repeat", DRIVE_SILENT, 4),
    Fault("empty", "does not answer for a parameter", DRIVE_SILENT, 4),
    Fault("junk", "answers by ten other bytes", "damaged answer", 4),
    Fault("bit", "answers with one wrong bit", "damaged answer", 4),
    Fault("cut", "sends the first five bytes of its reply", "damaged answer", 4),
    Fault("apart", "sends its reply in two parts, 2 s apart", "damaged answer", 4),
    Fault("unit", "answers as another unit", "unit 2 answers", 4),
    Fault("other", "answers another request", "is no reply of 2 registers", 4),
    Fault("error", "answers by an exception", "exception 4: refused by the drive", 5),
    Fault("endless", "never stops sending", "is never silent", 3),
    Fault("close", "closes the connection", "went away", 3),
)


@dataclass(frozen=True)
class Traffic:
    """Frames of others and of this card's master, each in the log before the next one is sent.

    `sent`: hexadecimal without CRC; `+`: a part of a frame as it is. `answers`: replies of this card.
    """

    title: str
    sent: tuple[str, ...]
    answers: int


READ, FOREIGN, FOREIGN_REPLY = "01 03 0002 0001", "02 03 0007 0001", "02 03 02 00F0"
TRAFFIC = (
    Traffic("another slave's request and reply, then its own request", (FOREIGN, FOREIGN_REPLY, READ), 1),
    Traffic("another slave's request without a reply, then its own request", (FOREIGN, READ), 1),
    Traffic("a request with 40 ms of silence in it", ("+ 01 03 00 02", "+ 00 01 25 CA"), 0),
    Traffic(
        "another slave's reply and its own request with no silence between", (f"{FOREIGN_REPLY} & {READ}",), 0
    ),
    Traffic("function 23, which the card does not have", ("01 17 0001 0001 0001 0002 02 1234",), 1),
)


def table() -> str:
    """The handbook's table."""
    rows = [(f"the slave {one.title}", f"`rtu2fc`: {one.says}, exit code {one.code}") for one in FAULTS]
    rows += [(f"the master sends {one.title}", ("no reply", "one reply")[one.answers]) for one in TRAFFIC]
    return "\n".join(["| on the bus | then |", "|---|---|", *(f"| {what} | {then} |" for what, then in rows)])
