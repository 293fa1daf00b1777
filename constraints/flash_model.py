# SPDX-License-Identifier: Apache-2.0
"""A MachXO2 for openFPGALoader without hardware: JTAG port, flash and feature row behind a virtual cable.

The cable is Xilinx's XVC over TCP, for one connection. Commands and register lengths are those that
openFPGALoader 0.10 uses, from its src/lattice.cpp. This is no model of silicon: it knows only what the
program sends and reads back. A write that the flash would refuse sets the part's fail flag.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

# Next state of the JTAG port for TMS 0 and 1.
RESET, IDLE, SHIFT_DR, SHIFT_IR = "reset", "idle", "shift-dr", "shift-ir"
NEXT = {RESET: (IDLE, RESET), IDLE: (IDLE, "select-dr"), "select-dr": ("capture-dr", "select-ir")}
NEXT["select-ir"] = ("capture-ir", RESET)
for kind in ("dr", "ir"):
    NEXT[f"capture-{kind}"] = NEXT[f"shift-{kind}"] = (f"shift-{kind}", f"exit1-{kind}")
    NEXT[f"exit1-{kind}"] = (f"pause-{kind}", f"update-{kind}")
    NEXT[f"pause-{kind}"] = (f"pause-{kind}", f"exit2-{kind}")
    NEXT[f"exit2-{kind}"] = (f"shift-{kind}", f"update-{kind}")
    NEXT[f"update-{kind}"] = (IDLE, "select-dr")

IDCODE, BYPASS, STATUS, BUSY = 0xE0, 0xFF, 0x3C, 0xF0
ENABLE, DISABLE, ERASE, FIRST_PAGE, REFRESH, PROGRAM_DONE = 0xC6, 0x26, 0x0E, 0x46, 0x79, 0x5E
WRITE_PAGE, READ_PAGE, PRELOAD = 0x70, 0x73, 0x1C
WRITE_FEATURE_ROW, READ_FEATURE_ROW, WRITE_FEABITS, READ_FEABITS = 0xE4, 0xE7, 0xF8, 0xFB
LENGTH = {IDCODE: 32, BYPASS: 1, STATUS: 32, BUSY: 8, ENABLE: 8, ERASE: 8, WRITE_PAGE: 128, READ_PAGE: 128}
LENGTH |= {PRELOAD: 208, WRITE_FEATURE_ROW: 64, READ_FEATURE_ROW: 64, WRITE_FEABITS: 16, READ_FEABITS: 16}
DONE_FLAG, ENABLED_FLAG, FAIL_FLAG = 1 << 8, 1 << 9, 1 << 13
FLASH_MODE = 0x08
ERASES_FEATURES, ERASES_PAGES = 1 << 1, 1 << 2


class Part:
    """The part. Registers and pages are numbers; JTAG shifts their bit 0 first."""

    def __init__(self, idcode: int, pages: int) -> None:
        self.idcode = idcode
        self.flash = [0] * pages
        self.feature_row = self.feabits = 0
        self.done = self.failed = False
        self.mode: int | None = None
        self.page = 0
        self.state = RESET
        self.command = IDCODE
        self.shifted = self.length = 0

    def rows(self) -> list[bytes]:
        """The pages as bytes of the bitstream: its first bit is the highest of the first byte."""
        return [int(f"{page:0128b}"[::-1], 2).to_bytes(16, "big") for page in self.flash]

    def clock(self, tms: int, tdi: int, count: int) -> int:
        """`count` clocks, the first in bit 0; returns what TDO sends."""
        sent = 0
        for at in range(count):
            if self.state in (SHIFT_DR, SHIFT_IR):
                sent |= (self.shifted & 1) << at
                self.shifted = (self.shifted | (tdi >> at & 1) << self.length) >> 1
            self.go(tms >> at & 1)
        return sent

    def go(self, level: int) -> None:
        before, self.state = self.state, NEXT[self.state][level]
        if self.state == before:
            return
        if self.state == RESET:
            self.command = IDCODE
        elif self.state == "capture-ir":
            self.shifted, self.length = 1, 8
        elif self.state == "update-ir":
            self.command = self.shifted
            # Commands without data.
            if self.command == FIRST_PAGE:
                self.page = 0
            elif self.command == DISABLE:
                self.mode = None
            elif self.command == PROGRAM_DONE:
                self.done = self.done or self.mode == FLASH_MODE
        elif self.state == "capture-dr":
            self.shifted, self.length = self.read(), LENGTH.get(self.command, 1)
        elif self.state == "update-dr":
            self.write(self.shifted)

    def read(self) -> int:
        if self.command == READ_PAGE:
            self.page += 1
            return self.flash[self.page - 1]
        status = DONE_FLAG * self.done | ENABLED_FLAG * (self.mode is not None) | FAIL_FLAG * self.failed
        known = {IDCODE: self.idcode, STATUS: status}
        known |= {READ_FEATURE_ROW: self.feature_row, READ_FEABITS: self.feabits}
        return known.get(self.command, 0)

    def write(self, value: int) -> None:
        if self.command == ENABLE:
            self.mode = value
        elif self.command == ERASE and self.mode == FLASH_MODE:
            if value & ERASES_PAGES:
                self.flash, self.done = [0] * len(self.flash), False
            if value & ERASES_FEATURES:
                self.feature_row = self.feabits = 0
        elif self.command in (WRITE_PAGE, WRITE_FEATURE_ROW, WRITE_FEABITS):
            # Writing sets bits, and only erasing clears them.
            if self.mode != FLASH_MODE or (self.command == WRITE_PAGE and self.page == len(self.flash)):
                self.failed = True
            elif self.command == WRITE_PAGE:
                self.flash[self.page] |= value
                self.page += 1
            elif self.command == WRITE_FEATURE_ROW:
                self.feature_row |= value
            else:
                self.feabits |= value


@contextmanager
def cable(part: Part) -> Iterator[int]:
    """Serves a part to one client; gives the TCP port on this machine."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve, args=(part, server))
        thread.start()
        yield server.getsockname()[1]
        # Wakes a server to which nobody connected.
        socket.create_connection(server.getsockname()).close()
        thread.join()


def serve(part: Part, server: socket.socket) -> None:
    client, _ = server.accept()
    with client:
        while word := take(client, len("shift:")):
            if word == b"getinf":
                take(client, len("o:"))
                client.sendall(b"xvcServer_v1.0:2048\n")
            elif word == b"settck":
                client.sendall(take(client, len(":") + 4)[1:])
            else:
                count = int.from_bytes(take(client, 4), "little")
                size = (count + 7) // 8
                tms, tdi = (int.from_bytes(take(client, size), "little") for _ in range(2))
                client.sendall(part.clock(tms, tdi, count).to_bytes(size, "little"))


def take(client: socket.socket, count: int) -> bytes:
    """Exactly `count` bytes, or none after the end."""
    # openFPGALoader sends a command in two parts. The second waits until the first is acknowledged.
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
    return client.recv(count, socket.MSG_WAITALL)
