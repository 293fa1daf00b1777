# SPDX-License-Identifier: Apache-2.0
"""The firmware's own C sources on the host, through ctypes. No simulator inside.

`Translator` is the translation core (PDU in, PDU or telegram out). `Gateway` is the poll loop with a mailbox
simulated by the test.
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

from regs.generated.mailbox import FRAMES_BYTES, REGISTERS, STRIDE
from tb.model.fc_telegram import without_bcc

ROOT = Path(__file__).resolve().parents[2]
NOT_A_REPLY, SILENT, REPLY, EXCHANGE = range(4)  # enum outcome
LONGEST = 30  # bytes of a reply PDU or a telegram
KEPT = 31  # bytes of a PDU that fit a request bank beside the address (FRAME-5)
JUNK = (
    0xA5  # value of every frame byte that the hardware did not write, and of every result before it is made
)

ReadHook = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_uint32)
WriteHook = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_uint32)


def build(file: str, *variables: str) -> Path:
    """Makes a file of sw/firmware.mk from the present sources; test processes take turns."""
    (ROOT / "build").mkdir(exist_ok=True)
    with open(ROOT / "build/firmware.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        subprocess.run(["make", "-s", "-f", "sw/firmware.mk", *variables, file], cwd=ROOT, check=True)
    return ROOT / file


@functools.cache
def library(option: str = "", dialect: str = "card") -> ctypes.CDLL:
    """The host library of a dialect, or of the card's dialect with `option` of sw/include/options.h set to 1.

    FIRMWARE_LIBRARIES=folder: use measured or mutated libraries from there instead of the present sources.
    """
    if made := os.environ.get("FIRMWARE_LIBRARIES"):
        file = Path(made) / (option or dialect) / "libtranslate.so"
    elif dialect != "card":
        assert not option
        file = build(f"build/host/{dialect}/libtranslate.so")
    else:
        folder = f"build/host/{option}" if option else "build/host"
        defines = f"FIRMWARE_DEFINES=-D{option}=1" if option else "FIRMWARE_DEFINES="
        file = build(f"{folder}/libtranslate.so", f"FIRMWARE_HOST_DIR={folder}", defines)
    lib = ctypes.CDLL(str(file))
    pointer, u32 = ctypes.c_void_p, ctypes.c_uint32
    for name, result, *arguments in [
        ("translate_init", None, pointer),
        ("translate_copy_settings", ctypes.c_bool, pointer),
        ("translate_request", ctypes.c_int, pointer, pointer, pointer, u32, ctypes.c_bool),
        ("host_commit", None, pointer),
        ("translate_drive_reply", ctypes.c_int, pointer, pointer, pointer, u32),
        ("translate_drive_commit", None, pointer),
        ("translate_drive_again", None, pointer),
        ("translate_drive_silent", ctypes.c_int, pointer),
        ("gateway_init", None, pointer),
        ("gateway_poll", ctypes.c_bool, pointer),
        ("gateway_is_idle", ctypes.c_bool, pointer),
        ("host_connect", None, ReadHook, WriteHook),
        ("host_size_of_translator", u32),
        ("host_size_of_images", u32),
        ("host_size_of_transaction", u32),
        ("host_size_of_gateway", u32),
        ("host_soil", None, pointer, ctypes.c_uint8),
        ("host_reply", pointer, pointer, ctypes.POINTER(u32)),
        ("host_telegram", pointer, pointer, ctypes.POINTER(u32)),
    ]:
        function = getattr(lib, name)
        function.restype, function.argtypes = result, arguments
    return lib


def frame(data: bytes, slots: int = 32) -> ctypes.Array:
    """Bytes as laid out in the frame memory: one in every four, junk between."""
    memory = (ctypes.c_uint8 * (STRIDE * slots))(*[JUNK] * (STRIDE * slots))
    memory[: STRIDE * len(data) : STRIDE] = list(data)
    return memory


def drive_frame(data: bytes) -> ctypes.Array:
    """Telegram data as stored by the receiver: from byte 24 on, only the last four remain (FC-7)."""
    kept = frame(data[:24], 28)
    for i in range(24, len(data)):
        kept[STRIDE * (24 + i % 4)] = data[i]
    return kept


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
        self.outcome = self.translator.lib.translate_drive_reply(
            self.translator.memory, self.memory, drive_frame(data), len(data) + 2 if lge is None else lge
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
        self.lib = library(option, dialect)
        size = self.lib.host_size_of_translator()
        self.memory = ctypes.create_string_buffer(size)
        self.lib.translate_init(self.memory)

    @property
    def sound(self) -> bool:
        return self.lib.translate_copy_settings(self.memory)

    def request(self, pdu: bytes, length: int | None = None, broadcast: bool = False) -> Transaction:
        """Prepares a request; `length` is the true length if it differs from that of `pdu`."""
        size = self.lib.host_size_of_transaction()
        memory = ctypes.create_string_buffer(bytes([JUNK] * size), size)
        length = len(pdu) if length is None else length
        if not self.sound:
            return Transaction(self, memory, SILENT)
        outcome = self.lib.translate_request(self.memory, memory, frame(pdu[:KEPT]), length, broadcast)
        return Transaction(self, memory, outcome)

    def do(self, pdu: bytes, broadcast: bool = False) -> Transaction:
        """Prepares a request and commits it."""
        return self.request(pdu, broadcast=broadcast).commit()

    def state(self) -> bytes:
        """The bytes of all images, to compare; not those that are prepared."""
        return self.memory.raw[: self.lib.host_size_of_images()]


class Connected:
    """The library of the last Gateway; it holds the frame memory and serves the mailbox (fake_mailbox.py)."""

    lib: ctypes.CDLL | None = None
    frames: ctypes.Array

    @classmethod
    def move_to(cls, lib: ctypes.CDLL) -> None:
        if lib is cls.lib:
            return
        frames = (ctypes.c_uint8 * FRAMES_BYTES).in_dll(lib, "host_frames")
        if cls.lib:
            frames[:] = cls.frames
        cls.lib, cls.frames = lib, frames


def connected() -> ctypes.CDLL:
    """The library connected last, or that of the card."""
    if not Connected.lib:
        Connected.move_to(library())
    return Connected.lib


def frame_memory() -> ctypes.Array:
    """The whole frame memory, readable and writable."""
    connected()
    return Connected.frames


class Gateway:
    """The poll loop; `read(offset)` and `write(offset, value)` simulate the registers."""

    def __init__(
        self,
        read: Callable[[int], int],
        write: Callable[[int, int], None],
        dialect: str = "card",
        option: str = "",
    ) -> None:
        self.lib = library(option, dialect)
        Connected.move_to(self.lib)

        def on_read(offset: int) -> int:
            # The length is read at the beginning of each translation.
            if offset == REGISTERS["LENGTH"].offset:
                self.lib.host_soil(self.memory, JUNK)
            return read(offset)

        self._hooks = ReadHook(on_read), WriteHook(write)  # must outlive the calls
        self.memory = ctypes.create_string_buffer(self.lib.host_size_of_gateway())
        self.lib.host_connect(*self._hooks)
        self.lib.gateway_init(self.memory)

    def poll(self) -> bool:
        """A round; whether it was idle, so that the main loop may check the image."""
        return self.lib.gateway_poll(self.memory)

    def is_idle(self) -> bool:
        return self.lib.gateway_is_idle(self.memory)
