# SPDX-License-Identifier: Apache-2.0
"""A MachXO2 for openFPGALoader without hardware: JTAG port, flash and feature row behind a virtual cable.

The cable is Xilinx's XVC over TCP, for one connection. Commands and register lengths are those that
openFPGALoader 0.10 uses, from its src/lattice.cpp. This is no model of silicon: it knows only what the
program sends and reads back. A write that the flash would refuse sets the part's fail flag.
"""

from __future__ import annotations

import socket
import threading

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
# States in which the part stays until TMS changes, and the level that keeps it there.
RESTING = {RESET: 1, IDLE: 0, "pause-dr": 0, "pause-ir": 0}

IDCODE, BYPASS, STATUS, BUSY = 0xE0, 0xFF, 0x3C, 0xF0
ENABLE, DISABLE, ERASE, FIRST_PAGE, REFRESH, PROGRAM_DONE = 0xC6, 0x26, 0x0E, 0x46, 0x79, 0x5E
WRITE_PAGE, READ_PAGE, PRELOAD = 0x70, 0x73, 0x1C
WRITE_FEATURE_ROW, READ_FEATURE_ROW, WRITE_FEABITS, READ_FEABITS = 0xE4, 0xE7, 0xF8, 0xFB
LENGTH = {IDCODE: 32, BYPASS: 1, STATUS: 32, BUSY: 8, ENABLE: 8, ERASE: 8, WRITE_PAGE: 128, READ_PAGE: 128}
LENGTH |= {PRELOAD: 208, WRITE_FEATURE_ROW: 64, READ_FEATURE_ROW: 64}
LENGTH |= {WRITE_FEABITS: 16, READ_FEABITS: 16}
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
        sent = at = 0
        while at < count:
            bits, level = count - at, tms >> at & 1
            # Clocks with the same TMS.
            changes = (tms ^ -level) >> at & (1 << bits) - 1
            run = (changes & -changes).bit_length() - 1 if changes else bits
            if self.state in (SHIFT_DR, SHIFT_IR):
                run = 1 if level else run
                sent |= self.shift(tdi >> at & (1 << run) - 1, run) << at
                if level:
                    self.go(1)
            elif RESTING.get(self.state) == level:
                pass
            else:
                run = 1
                self.go(level)
            at += run
        return sent

    def shift(self, tdi: int, count: int) -> int:
        wide = self.shifted | tdi << self.length
        self.shifted = wide >> count
        return wide & (1 << count) - 1

    def go(self, level: int) -> None:
        self.state = NEXT[self.state][level]
        if self.state == RESET:
            self.command = IDCODE
        elif self.state == "capture-ir":
            self.shifted, self.length = 1, 8
        elif self.state == "update-ir":
            self.command = self.shifted
            self.obey()
        elif self.state == "capture-dr":
            self.shifted, self.length = self.read(), LENGTH.get(self.command, 1)
        elif self.state == "update-dr":
            self.write(self.shifted)

    def obey(self) -> None:
        """Commands without data."""
        if self.command == FIRST_PAGE:
            self.page = 0
        elif self.command == DISABLE:
            self.mode = None
        elif self.command == PROGRAM_DONE:
            self.done = self.done or self.mode == FLASH_MODE

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


class Cable:
    """Serves a part to one client; the attribute `port` is the TCP port on this machine."""

    BUFFER = 2048

    def __init__(self, part: Part) -> None:
        self.part = part
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.thread = threading.Thread(target=self.serve, daemon=True)

    def __enter__(self) -> Cable:
        self.thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        # Wakes a server to which nobody connected.
        with socket.create_connection(("127.0.0.1", self.port)):
            self.socket.close()
        self.thread.join()

    def serve(self) -> None:
        client, _ = self.socket.accept()
        with client:
            while word := self.take(client, len("shift:")):
                if word == b"getinf":
                    self.take(client, len("o:"))
                    client.sendall(b"xvcServer_v1.0:%d\n" % self.BUFFER)
                elif word == b"settck":
                    client.sendall(self.take(client, len(":") + 4)[1:])
                else:
                    count = int.from_bytes(self.take(client, 4), "little")
                    size = (count + 7) // 8
                    tms, tdi = (int.from_bytes(self.take(client, size), "little") for _ in range(2))
                    client.sendall(self.part.clock(tms, tdi, count).to_bytes(size, "little"))

    @staticmethod
    def take(client: socket.socket, count: int) -> bytes:
        """Exactly `count` bytes, or none after the end."""
        found = b""
        while len(found) < count:
            # openFPGALoader sends a command in two parts. The second waits until the first is acknowledged.
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
            if not (more := client.recv(count - len(found))):
                return b""
            found += more
        return found
