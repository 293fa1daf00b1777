# SPDX-License-Identifier: Apache-2.0
"""The firmware's own C sources on the host, through ctypes. No simulator inside.

`Translator` is the translation core (PDU in, PDU or telegram out). `Gateway` is the poll loop with the model
of the mailbox, `Machine` the same as the card's image on an RV32I machine.
"""

from __future__ import annotations

import ctypes
import fcntl
import functools
import os
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from regs.dialects import OPTIONS
from tb.model.fake_mailbox import FakeMailbox, ReadHook, WriteHook
from tb.model.fc_telegram import without_bcc

ROOT = Path(__file__).resolve().parents[2]
NOT_A_REPLY, SILENT, REPLY, EXCHANGE = range(4)  # enum outcome
LONGEST = 30  # bytes of a reply PDU or a telegram
KEPT = 31  # bytes of a PDU that fit a request bank beside the address (FRAME-5)
JUNK = (
    0xA5  # value of every frame byte that the hardware did not write, and of every result before it is made
)
MEMORY, LARGEST = 8192, 16384  # bytes of the standard card, of the largest


def build(file: str, *variables: str) -> Path:
    """Makes a file of sw/firmware.mk from the present sources; test processes take turns."""
    (ROOT / "build").mkdir(exist_ok=True)
    with open(ROOT / "build/firmware.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        subprocess.run(["make", "-s", "-f", "sw/firmware.mk", *variables, file], cwd=ROOT, check=True)
    return ROOT / file


@functools.cache
def library(option: str = "", dialect: str = "card") -> ctypes.CDLL:
    """The host library of a dialect, or of the card's dialect with `option` of sw/include/options.h.

    FIRMWARE_LIBRARIES=folder: use measured or mutated libraries from there instead of the present sources.
    """
    if made := os.environ.get("FIRMWARE_LIBRARIES"):
        file = Path(made) / (option or dialect) / "libtranslate.so"
    elif dialect != "card":
        assert not option
        file = build(f"build/host/{dialect}/libtranslate.so")
    else:
        folder = f"build/host/{option}" if option else "build/host"
        defines = "FIRMWARE_DEFINES=" + (f"-D{option}={OPTIONS[option].tried}" if option else "")
        file = build(f"{folder}/libtranslate.so", f"FIRMWARE_HOST_DIR={folder}", defines)
    lib = ctypes.CDLL(str(file))
    pointer, u32 = ctypes.c_void_p, ctypes.c_uint32
    for name, result, *arguments in [
        ("translate_init", None, pointer),
        ("host_request", ctypes.c_int, pointer, pointer, ctypes.c_char_p, u32, u32, ctypes.c_bool),
        ("host_commit", None, pointer),
        ("host_drive_reply", ctypes.c_int, pointer, pointer, ctypes.c_char_p, u32, u32),
        ("translate_drive_commit", None, pointer),
        ("translate_drive_again", None, pointer),
        ("translate_drive_silent", ctypes.c_int, pointer),
        ("gateway_init", None, pointer),
        ("gateway_poll", ctypes.c_bool, pointer),
        ("gateway_is_idle", ctypes.c_bool, pointer),
        ("host_connect", None, pointer, pointer),
        ("host_watch", None, u32, u32, ReadHook, WriteHook),
        ("host_run", ctypes.c_bool, pointer, pointer, u32, u32, u32),
        ("machine_load", None, pointer, ctypes.c_char_p, u32, u32),
        ("machine_step", ctypes.c_bool, pointer),
        ("mailbox_on_read", u32, pointer, u32),
        ("mailbox_on_write", None, pointer, u32, u32),
        ("host_size_of_translator", u32),
        ("host_size_of_images", u32),
        ("host_size_of_transaction", u32),
        ("host_size_of_gateway", u32),
        ("host_reply", pointer, pointer, ctypes.POINTER(u32)),
        ("host_telegram", pointer, pointer, ctypes.POINTER(u32)),
    ]:
        function = getattr(lib, name)
        function.restype, function.argtypes = result, arguments
    return lib


@dataclass
class Transaction:
    """One request in progress: its outcome, and the calls that may follow."""

    translator: Translator
    memory: ctypes.Array = field(repr=False)
    outcome: int

    def _bytes(self, getter: Callable) -> bytes:
        length = ctypes.c_uint32()
        start = getter(self.memory, ctypes.byref(length))
        assert length.value <= LONGEST, "a length that was never written"
        return ctypes.string_at(start, length.value)

    @property
    def reply(self) -> bytes:
        """The reply PDU."""
        return self._bytes(self.translator.lib.host_reply)

    @property
    def telegram(self) -> bytes:
        """ADR and data of the telegram; fails on a wrong BCC."""
        return without_bcc(self._bytes(self.translator.lib.host_telegram))

    def commit(self) -> Transaction:
        self.translator.lib.host_commit(self.translator.memory)
        return self

    def drive_reply(self, data: bytes, lge: int | None = None) -> int:
        """Passes on the drive's telegram data, without ADR and BCC."""
        self.outcome = self.translator.lib.host_drive_reply(
            self.translator.memory, self.memory, data, len(data), len(data) + 2 if lge is None else lge
        )
        return self.outcome

    def drive_commit(self) -> Transaction:
        self.translator.lib.translate_drive_commit(self.translator.memory)
        return self

    def drive_again(self) -> Transaction:
        """Prepares the second telegram, after drive_reply returned EXCHANGE."""
        self.translator.lib.translate_drive_again(self.memory)
        return self

    def drive_silent(self) -> bytes:
        """Ends the exchange; returns the reply PDU, empty if the outcome is SILENT."""
        self.outcome = self.translator.lib.translate_drive_silent(self.memory)
        return b"" if self.outcome == SILENT else self.reply


class Translator:
    """The translation core with the card's images."""

    def __init__(self, option: str = "", dialect: str = "card") -> None:
        self.option, self.dialect = option, dialect
        self.lib = library(option, dialect)
        self.lib.host_connect(None, None)
        size = self.lib.host_size_of_translator()
        self.memory = ctypes.create_string_buffer(size)
        self.size = self.lib.host_size_of_transaction()
        self.lib.translate_init(self.memory)

    def fresh(self) -> Translator:
        return Translator(self.option, self.dialect)

    def request(self, pdu: bytes, length: int | None = None, broadcast: bool = False) -> Transaction:
        """Prepares a request; `length` is the true length if it differs from that of `pdu`."""
        memory = ctypes.create_string_buffer(self.size)
        length = len(pdu) if length is None else length
        kept = min(len(pdu), KEPT)
        outcome = self.lib.host_request(self.memory, memory, pdu, kept, length, broadcast)
        return Transaction(self, memory, outcome)

    def do(self, pdu: bytes, broadcast: bool = False) -> Transaction:
        """Prepares a request and commits it."""
        return self.request(pdu, broadcast=broadcast).commit()

    def state(self) -> bytes:
        """The bytes of all images, to compare; not those that are prepared."""
        return self.memory.raw[: self.lib.host_size_of_images()]


class Hung(Exception):
    """The firmware stopped polling; the card's watchdog would bite."""


class Cpu(ctypes.Structure):
    """struct machine of sw/port/host/machine.h."""

    _fields_ = [("x", ctypes.c_uint32 * 32)]
    _fields_ += [
        (name, ctypes.c_uint32)
        for name in ("pc", "word_flip", "instructions", "lowest_sp", "memory_size", "reads_time")
    ]
    _fields_ += [("memory", ctypes.c_uint8 * LARGEST)]


class Firmware:
    """The firmware with a mailbox (fake_mailbox.py), compiled for the host or as an image of the card."""

    gateway = cpu = None  # references to the C structs; one of them is set

    def __init__(self, mailbox: FakeMailbox) -> None:
        self.mailbox, self.lib = mailbox, mailbox.lib

    def run(self, ms: int, rounds: int) -> None:
        """So many rounds after each of the next `ms`, or at once if there are none."""
        mailbox = self.mailbox
        mailbox.watch()
        going_on = self.lib.host_run(self.gateway, self.cpu, mailbox.time, ms, rounds)
        mailbox.passed(ms)
        mailbox.check()
        if not going_on:
            raise Hung(f"no reading of TIME at {self.state.pc:#x}")


class Gateway(Firmware):
    """The poll loop on the host."""

    def __init__(self, mailbox: FakeMailbox) -> None:
        super().__init__(mailbox)
        self.memory = ctypes.create_string_buffer(self.lib.host_size_of_gateway())
        self.gateway = ctypes.byref(self.memory)
        self.lib.host_connect(mailbox.pointer, self.gateway)
        mailbox.watch()
        self.lib.gateway_init(self.memory)

    def poll(self) -> bool:
        """A round; whether it was idle, so that the main loop may check the image."""
        self.mailbox.watch()
        idle = self.lib.gateway_poll(self.memory)
        self.mailbox.check()
        return idle

    def is_idle(self) -> bool:
        return self.lib.gateway_is_idle(self.memory)


class Machine(Firmware):
    """An image on an RV32I machine; a round begins with the reading of TIME."""

    def __init__(self, mailbox: FakeMailbox, program: bytes, memory: int = MEMORY) -> None:
        super().__init__(mailbox)
        self.state = Cpu()
        self.cpu = ctypes.byref(self.state)
        self.memory = self.state.memory
        self.lib.host_connect(mailbox.pointer, None)
        self.lib.machine_load(self.cpu, program, len(program), memory)
        # Up to the first reading of TIME, which belongs to the start, and the rest of the first round.
        self.run(0, 2)

    def poll(self) -> None:
        self.run(0, 1)

    def step(self) -> None:
        """One instruction."""
        self.mailbox.watch()
        assert self.lib.machine_step(self.cpu), f"no such instruction or access at {self.state.pc - 4:#x}"


@functools.cache
def image(dialect: str = "card") -> bytes:
    """The firmware image, as loaded into the card."""
    folder = "build" if dialect == "card" else f"build/{dialect}"
    return build(f"{folder}/firmware.bin").read_bytes()


@dataclass(frozen=True)
class Build:
    """A build of the firmware: of the sources for the host, or the image of the card."""

    dialect: str = "card"
    option: str = ""
    on_card: bool = False

    def mailbox(self, address: int = 1) -> FakeMailbox:
        return FakeMailbox(address, library(self.option, self.dialect))

    def start(self, mailbox: FakeMailbox) -> Gateway | Machine:
        return Machine(mailbox, image(self.dialect)) if self.on_card else Gateway(mailbox)
