# SPDX-License-Identifier: Apache-2.0
"""The mailbox as the firmware sees it, played by a test: commit gate and both ports, one event at a time.

Rules and state are those of sw/port/host/mailbox_model.c, whose fields are attributes here. Times in ms.
Frames on the network side are address and PDU (no CRC), on the drive side ADR and data (no STX, LGE, BCC).
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable

from regs.generated.mailbox import AREAS, FRAMES_BYTES, REGISTERS
from tb.model.fc_telegram import without_bcc

BY_OFFSET = {register.offset: name for name, register in REGISTERS.items()}
TICKS_IN_10_MS = 12
EVENTS = ("restart", "commit", "character", "pause_over", "telegram_ends")
BROKEN = ("ordered while one was on the line", "wrong BCC", "a stop that starts", "touched while sent")
SENT_KEPT = 1024

ReadHook = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_uint32)
WriteHook = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_uint32)


class Sent(ctypes.Structure):
    """struct host_sent."""

    _fields_ = [(name, ctypes.c_uint8) for name in ("telegram", "loopback", "length")]
    _fields_ += [("byte", ctypes.c_uint8 * 32)]


@functools.cache
def state_type(lib: ctypes.CDLL) -> type[ctypes.Structure]:
    """struct mailbox: numbers with names, then bytes that only the model reads."""
    names = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(lib, "mailbox_fields"))).decode().split()
    rest = ctypes.c_uint32.in_dll(lib, "mailbox_size").value - ctypes.sizeof(ctypes.c_uint32) * len(names)
    fields = [*((name, ctypes.c_uint32) for name in names), ("_rest", ctypes.c_uint8 * rest)]
    return type("State", (ctypes.Structure,), {"_fields_": fields})


class FakeMailbox:
    """`reads` and `writes` name functions that serve a register in place of the model."""

    def __init__(self, address: int, lib: ctypes.CDLL) -> None:
        object.__setattr__(self, "_state", state_type(lib)())
        self.lib, self.pointer = lib, ctypes.byref(self._state)
        self.frames = (ctypes.c_uint8 * FRAMES_BYTES).in_dll(lib, "host_frames")
        self.reads: dict[str, Callable[[], int]] = {}
        self.writes: dict[str, Callable[..., None]] = {}
        self._hooks = ReadHook(self._read), WriteHook(self._write)
        self._failed: list[BaseException] = []
        self._left = (Sent * SENT_KEPT).in_dll(lib, "host_sent")
        self._count = ctypes.c_uint32.in_dll(lib, "host_sent_count")
        self._seen = self._count.value
        self._sent: dict[bool, list[bytes]] = {False: [], True: []}
        lib.mailbox_init(self.pointer)
        self.address = address
        self._time = 0

    def __getattr__(self, name: str) -> object:
        """A number of the model, or one of its events without arguments."""
        if name in EVENTS:
            return functools.partial(getattr(self.lib, "mailbox_" + name), self.pointer)
        return getattr(self._state, name)

    def __setattr__(self, name: str, value: object) -> None:
        object.__setattr__(self._state if hasattr(self._state, name) else self, name, value)

    @property
    def time(self) -> int:
        return self._time

    @time.setter
    def time(self, ms: int) -> None:
        self._time, self.ticks = ms, ms * TICKS_IN_10_MS // 10

    def passed(self, ms: int) -> None:
        """Ticks have followed the time already."""
        self._time += ms

    # ------------------------------------------------------------ what left

    def _all(self, telegrams: bool) -> list[bytes]:
        assert self._count.value - self._seen <= SENT_KEPT
        while self._seen != self._count.value:
            sent = self._left[self._seen % SENT_KEPT]
            frame = bytes(sent.byte[: sent.length])
            if sent.telegram:
                # The loop-back test's pattern has a wrong BCC (LOOP-1).
                frame = frame if sent.loopback else without_bcc(frame)
            self._sent[bool(sent.telegram)].append(frame)
            self._seen += 1
        return self._sent[telegrams]

    @property
    def replies(self) -> list[bytes]:
        return self._all(False)

    @property
    def telegrams(self) -> list[bytes]:
        return self._all(True)

    # ------------------------------------------------------------ registers and memory

    def watch(self) -> None:
        """Before the firmware runs: registers in `reads` and `writes` are served here."""
        masks = [sum(1 << REGISTERS[name].offset for name in names) for names in (self.reads, self.writes)]
        self.lib.host_watch(*masks, *self._hooks)

    def check(self) -> None:
        """After the firmware ran: it did nothing that no correct firmware does."""
        if self._failed:
            raise self._failed.pop()
        state = self._state
        assert not state.unknown, "a register that the model does not know"
        assert not state.broken, [what for i, what in enumerate(BROKEN) if state.broken >> i & 1]

    def _kept(self, access: Callable, *arguments: object) -> int:
        """ctypes ignores what a function of the test raises; check() raises it."""
        try:
            return access(*arguments)
        except BaseException as error:
            self._failed.append(error)
            return 0

    def _read(self, offset: int) -> int:
        name = BY_OFFSET[offset]
        return self._kept(self.reads.get(name, functools.partial(self.read_register, name)))

    def _write(self, offset: int, value: int) -> None:
        name = BY_OFFSET[offset]
        serve = self.writes.get(name, functools.partial(self.write_register, name))
        self._kept(functools.partial(serve, **REGISTERS[name].unpack(value)))

    def read_register(self, name: str) -> int:
        """The model's register."""
        return self.lib.mailbox_on_read(self.pointer, REGISTERS[name].offset)

    def write_register(self, name: str, **fields: int) -> None:
        """Writes the model's register."""
        register = REGISTERS[name]
        self.lib.mailbox_on_write(self.pointer, register.offset, register.pack(**fields))

    def memory(self, area: str, length: int) -> bytes:
        return bytes(self.frames[AREAS[area].at(i)] for i in range(length))

    def store(self, area: str, data: bytes) -> None:
        for i, byte in enumerate(data):
            self.frames[AREAS[area].at(i)] = byte

    def counter(self, name: str) -> int:
        at = AREAS[name].offset
        return int.from_bytes(self.frames[at : at + AREAS[name].size], "little")

    # ------------------------------------------------------------ what happens on the lines

    def event(self, name: str) -> None:
        """Something that the hardware flags."""
        self.events |= REGISTERS["EVENTS"].pack(**{name: 1})

    def candidate(self, pdu: bytes, broadcast: bool = False) -> None:
        """A good frame, then half a character of silence."""
        self.lib.mailbox_candidate(self.pointer, 1, pdu, len(pdu), broadcast)

    def drive_data(self, data: bytes) -> None:
        """All of the drive's telegram but its BCC."""
        self.lib.mailbox_drive_data(self.pointer, data, len(data), len(data) + 2)

    def bcc(self, good: bool = True) -> None:
        self.lib.mailbox_bcc(self.pointer, good)
