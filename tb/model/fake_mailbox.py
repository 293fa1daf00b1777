# SPDX-License-Identifier: Apache-2.0
"""The mailbox as the firmware sees it, played by a test: commit gate and both ports, one event at a time.

The rules and the state come from sw/port/host/mailbox_model.c, whose fields are attributes here.
This class keeps the replies and telegrams that left, and checks each order of a telegram. Times in ms.
Frames on the network side are address and PDU (no CRC), on the drive side ADR and data (no STX, LGE, BCC).
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable

from regs.generated.mailbox import AREAS, REGISTERS, VALUES
from tb.model.fc_telegram import without_bcc
from tb.model.firmware import connected, frame_memory

BY_OFFSET = {register.offset: name for name, register in REGISTERS.items()}
TICKS_IN_10_MS = 12
ACTIONS = VALUES["TELEGRAM", "action"]
EVENTS = ("restart", "commit", "character", "pause_over")
START = 1 << 6  # of the control word, in its lower byte


@functools.cache
def state_type() -> type[ctypes.Structure]:
    """struct mailbox: numbers with names, then bytes that only the model reads."""
    lib = connected()
    names = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(lib, "mailbox_fields"))).decode().split()
    rest = ctypes.c_uint32.in_dll(lib, "mailbox_size").value - ctypes.sizeof(ctypes.c_uint32) * len(names)
    fields = [*((name, ctypes.c_uint32) for name in names), ("_rest", ctypes.c_uint8 * rest)]
    return type("State", (ctypes.Structure,), {"_fields_": fields})


class FakeMailbox:
    def __init__(self, address: int = 1) -> None:
        object.__setattr__(self, "_state", state_type()())
        self._pointer = ctypes.byref(self._state)
        # Of a register: the function that serves an access in place of the model.
        self.reads: dict[str, Callable[[], int]] = {}
        self.writes: dict[str, Callable[..., None]] = {}
        self._play("init")
        self.address = address
        self._time = 0
        self.replies: list[bytes] = []  # that left
        self.telegrams: list[bytes] = []  # that left

    def __getattr__(self, name: str) -> object:
        """A number of the model, or one of its events without arguments."""
        return functools.partial(self._play, name) if name in EVENTS else getattr(self._state, name)

    def __setattr__(self, name: str, value: object) -> None:
        object.__setattr__(self._state if hasattr(self._state, name) else self, name, value)

    @property
    def time(self) -> int:
        return self._time

    @time.setter
    def time(self, ms: int) -> None:
        self._time, self.ticks = ms, ms * TICKS_IN_10_MS // 10

    def _play(self, event: str, *arguments: object) -> None:
        """Calls a function of the model, and collects what leaves."""
        state = self._state
        replies, telegrams = state.sent_replies, state.sent_telegrams
        getattr(connected(), "mailbox_" + event)(self._pointer, *arguments)
        assert not state.unknown, "a register that the model does not know"
        if state.sent_replies > replies:
            self.replies.append(self.memory("REPLY_FRAME", self.reply_length))
        if state.sent_telegrams > telegrams:
            # The loop-back test's pattern has a wrong BCC (LOOP-1).
            self.telegrams.append(self.contents[:-1] if self.loopback else without_bcc(self.contents))

    @property
    def contents(self) -> bytes:
        """The telegram in the frame memory, with its BCC."""
        return self.memory("TELEGRAM_FRAME", self.telegram_length)

    # ------------------------------------------------------------ memory

    def memory(self, area: str, length: int) -> bytes:
        memory = frame_memory()
        return bytes(memory[AREAS[area].at(i)] for i in range(length))

    def store(self, area: str, data: bytes) -> None:
        memory = frame_memory()
        for i, byte in enumerate(data):
            memory[AREAS[area].at(i)] = byte

    def counter(self, name: str) -> int:
        at = AREAS[name].offset
        return int.from_bytes(frame_memory()[at : at + AREAS[name].size], "little")

    # ------------------------------------------------------------ what the firmware does

    def read(self, offset: int) -> int:
        name = BY_OFFSET[offset]
        return self.reads[name]() if name in self.reads else self.read_register(name)

    def write(self, offset: int, value: int) -> None:
        name = BY_OFFSET[offset]
        if name in self.writes:
            self.writes[name](**REGISTERS[name].unpack(value))
            return
        if name == "TELEGRAM":
            self._check_order(**REGISTERS[name].unpack(value))
        self._play("on_write", offset, value)

    def read_register(self, name: str) -> int:
        """The model's register."""
        value = connected().mailbox_on_read(self._pointer, REGISTERS[name].offset)
        assert not self._state.unknown, f"the model has no {name} to read"
        return value

    def write_register(self, name: str, **fields: int) -> None:
        """Writes the model's register."""
        self._play("on_write", REGISTERS[name].offset, REGISTERS[name].pack(**fields))

    def _check_order(self, length: int, no_reply: int, action: int, ticket: int, stop: int) -> None:
        if action in (ACTIONS["keep"], ACTIONS["repeat"]):
            return
        assert not self.sending, "the telegram on the line was overwritten"
        telegram = self.memory("TELEGRAM_FRAME", length)
        if not self.loopback:
            without_bcc(telegram)
        assert not stop or (len(telegram) > 2 and not telegram[2] & START), "a stop that starts"

    def event(self, name: str) -> None:
        """Something that the hardware flags."""
        self.events |= REGISTERS["EVENTS"].pack(**{name: 1})

    # ------------------------------------------------------------ what happens on the network line

    def candidate(self, pdu: bytes, broadcast: bool = False) -> None:
        """A good frame, then half a character of silence."""
        self._play("candidate", 1, pdu, len(pdu), broadcast)

    # ------------------------------------------------------------ what happens on the drive line

    def telegram_ends(self) -> None:
        """The last stop bit of the telegram is out."""
        if self.sending:
            assert not connected().mailbox_is_touched(self._pointer), "touched while sent"
            self._play("telegram_ends")

    def drive_data(self, data: bytes) -> None:
        """All of the drive's telegram but its BCC."""
        self._play("drive_data", data, len(data), len(data) + 2)

    def bcc(self, good: bool = True) -> None:
        self._play("bcc", good)
