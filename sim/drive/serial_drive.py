# SPDX-License-Identifier: Apache-2.0
"""The simulated drive on a serial port: it takes the place of a drive in the first test of a card.

    python -m sim.drive.serial_drive PORT [--profile vlt6000]

Prints each telegram and its reply in words until Ctrl-C. The adapter must switch its own driver. A damaged
telegram gets no reply, and 20 ms of silence end an incomplete one.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import serial

from rtl.command import Parser, run_main
from tb.model import fc_telegram
from tb.model.vlt_drive import PROFILES, VltDrive

BAUD = 9600
SILENCE_S = 0.02
STX = 0x02


def telegrams(port: serial.Serial) -> Iterator[bytes]:
    """Whole telegrams by their length byte, as they come."""
    held = b""
    while True:
        new = port.read(1)
        held = held + new if new else b""
        if held and held[0] != STX:
            held = b""
        if len(held) >= 2 and len(held) == held[1] + 2:
            yield held
            held = b""


def serve(port: serial.Serial, drive: VltDrive) -> None:
    since = time.monotonic()
    for telegram in telegrams(port):
        now = time.monotonic()
        drive.step(int((now - since) * 1e6))
        since = now
        print(f"card   {telegram.hex(' ').upper()}  {fc_telegram.describe(telegram)}", flush=True)
        if reply := drive.telegram(telegram):
            port.write(reply)
            print(f"drive  {reply.hex(' ').upper()}  {fc_telegram.describe(reply, reply=True)}", flush=True)


def main() -> int:
    parser = Parser(prog="serial-drive", description=__doc__.splitlines()[0])
    parser.add_argument("port")
    parser.add_argument("--profile", choices=PROFILES, default="vlt6000")
    parser.add_argument("--parity", choices=("even", "none"), default="even", help="none: for a pty")
    args = parser.parse_args()
    with serial.Serial(args.port, BAUD, parity=args.parity[0].upper(), timeout=SILENCE_S) as port:
        print(f"a {args.profile} at {args.port}, 9600 8E1; Ctrl-C ends it", flush=True)
        serve(port, VltDrive(args.profile))
    return 0


if __name__ == "__main__":
    run_main("serial-drive", main, serial.SerialException)
