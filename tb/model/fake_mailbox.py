# SPDX-License-Identifier: Apache-2.0
"""The mailbox as the firmware sees it, played by a test: commit gate and both ports, one event at a time.

Rules as in rtl/gate/: what is queued for a request leaves after its commit, never after a revoke;
a committed telegram is licensed, and may be repeated once while no newer request is committed, its own has
no reply, it is no broadcast and its memory is not written; a request that has its reply, or has sent its
write of coils, licenses nothing more; during the loop-back test all may leave. A committed request that is
kept gives its licence to the place of its kind, for one telegram, and to its repeat (FRAME-7). Times in ms.
With a card that stops the drive (SAFE-7), a committed write of coils arms the stop, and it is due when
the time that the firmware gave has passed without a commit.
Frames on the network side are address and PDU (no CRC), on the drive side ADR and data (no STX, LGE, BCC).
"""

from __future__ import annotations

from regs.generated.mailbox import AREAS, REGISTERS, VALUES
from tb.model.fc_telegram import without_bcc
from tb.model.firmware import JUNK, frame_memory

BY_OFFSET = {register.offset: name for name, register in REGISTERS.items()}
CRC_BYTES = 2
TICKS_IN_10_MS = 12
ACTIONS = VALUES["TELEGRAM", "action"]
FIRST, REPEAT, WAITING, KEEP = (ACTIONS[name] for name in ("first", "repeat", "waiting", "keep"))
START = 1 << 6  # of the control word, in its lower byte
WATCHDOG_KEY = REGISTERS["WATCHDOG"].fields["key"].reset


class FakeMailbox:
    def __init__(self, address: int = 1, places: int = 2) -> None:
        self.address = address
        # Waiting writes by kind, broadcast or not: whether they write coils; None: nothing waits.
        self.waiting: dict[bool, bool | None] = dict.fromkeys([True, False][:places])
        self.kept = False  # waits for its commit
        self.time = 0
        self.led = 0
        self.armed = False
        self.limit = self.since = 0  # ticks; ms of the last commit
        self.kicks = 0
        self.halted = False
        self.loopback = False
        self.silent = True  # nobody sends, on either line
        # network side
        self.ticket = 0
        self.is_candidate = self.is_committed = self.is_broadcast = False
        self.bank = 0
        self.length = 0
        self.answerable = self.spent = False
        self.reply_queued = self.wait_drive = False
        self.replies: list[bytes] = []  # that left
        # drive side
        self.telegram_queued = self.licensed = self.started = self.sending = False
        self.no_reply = self.begun = self.newest = self.repeatable = False
        self.writes_coils = self.control = False
        self.quiet = True  # the pause before a telegram is over (FC-8)
        self.telegram = b""
        self.contents = b""  # with its BCC, as it lies in the frame memory
        self.telegrams: list[bytes] = []  # that left
        self.listening = self.drive_candidate = self.drive_good = False
        self.events = 0
        memory = frame_memory()
        memory[:] = bytes(len(memory))

    def restart(self) -> None:
        """The watchdog resets the soft core and the gate; a telegram on the line goes on (WDG-1)."""
        self._end_licence()
        self.started = self.reply_queued = self.kept = self.armed = False
        self.is_candidate = self.is_committed = self.answerable = False
        self.waiting = dict.fromkeys(self.waiting)

    # ------------------------------------------------------------ memory

    def memory(self, area: str, length: int) -> bytes:
        memory = frame_memory()
        return bytes(memory[AREAS[area].at(i)] for i in range(length))

    def _store(self, area: str, data: bytes) -> None:
        memory = frame_memory()
        for i, byte in enumerate(data):
            memory[AREAS[area].at(i)] = byte

    def counter(self, name: str) -> int:
        at = AREAS[name].offset
        return int.from_bytes(frame_memory()[at : at + AREAS[name].size], "little")

    # ------------------------------------------------------------ what the firmware does

    def read(self, offset: int) -> int:
        return getattr(self, "_read_" + BY_OFFSET[offset].lower())()

    def write(self, offset: int, value: int) -> None:
        name = BY_OFFSET[offset]
        getattr(self, "_write_" + name.lower())(**REGISTERS[name].unpack(value))
        self._release()

    def _read_time(self) -> int:
        return self.time * TICKS_IN_10_MS // 10 & 0xFF

    def _read_events(self) -> int:
        return self.events

    def _write_events(self, **flags: int) -> None:
        self.events &= ~REGISTERS["EVENTS"].pack(**flags)

    def _read_request(self) -> int:
        return REGISTERS["REQUEST"].pack(
            ticket=self.ticket,
            candidate=self.is_candidate,
            committed=self.is_committed,
            broadcast=self.is_broadcast,
            bank=self.bank,
        )

    def _read_length(self) -> int:
        return self.length & 0xFF

    def _take_back_what_was_touched(self) -> None:
        """A write to the telegram's memory ends its licence; here it shows by what it left behind."""
        if self.contents != self.memory("TELEGRAM_FRAME", len(self.contents)):
            self._end_licence()

    def _end_licence(self) -> None:
        self.telegram_queued = self.licensed = False

    def _read_exchange(self) -> int:
        self._take_back_what_was_touched()
        return REGISTERS["EXCHANGE"].pack(
            queued=self.telegram_queued,
            sending=self.sending,
            started=self.started,
            candidate=self.drive_candidate,
            good=self.drive_good,
            loopback=self.loopback,
            silent=self.silent and not self.sending,
            stop_due=self.stop_due,
        )

    @property
    def stop_due(self) -> bool:
        passed = (self.time - self.since) * TICKS_IN_10_MS // 10
        return self.armed and self.limit != 0 and passed > self.limit

    def _write_led(self, modbus_red: int, modbus_green: int, drive_red: int, drive_green: int) -> None:
        self.led = modbus_red | modbus_green << 1 | drive_red << 2 | drive_green << 3

    def _write_watchdog(self, key: int) -> None:
        assert key == WATCHDOG_KEY
        self.kicks += 1

    def _write_supervisor(
        self, halt: int, loopback: int, watch: int = 0, running: int = 0, ticket: int = 0, period: int = 0
    ) -> None:
        self.halted |= bool(halt)
        if watch and ticket == self.ticket and self.is_committed:
            self.limit, self.since = period, self.time
            if self.writes_coils:
                self.armed = bool(running)
        if self.loopback and loopback:
            self.loopback = self.reply_queued = False
            self._end_licence()

    def _write_reply(self, length: int, after_drive: int, ticket: int) -> None:
        alive = self.is_candidate or (self.is_committed and self.answerable)
        mine = ticket == self.ticket and alive and not self.is_broadcast
        self.reply_queued = (mine or self.loopback) and length > 0
        self.wait_drive = bool(after_drive)
        self.reply = self.memory("REPLY_FRAME", length)
        self.spent |= ticket == self.ticket and self.is_broadcast

    def _write_telegram(self, length: int, no_reply: int, action: int, ticket: int, stop: int = 0) -> None:
        mine = ticket == self.ticket
        if action == KEEP:
            self.kept = mine and self.is_candidate
            if mine and self.is_committed and not self.spent:
                self._keep()
            return
        self.started = False
        self._take_back_what_was_touched()
        if action == REPEAT:
            self.telegram_queued = self.licensed and self.begun and self.repeatable
            return
        assert not self.sending, "the telegram on the line was overwritten"
        if action == WAITING and stop:
            licensed = queued = control = self.stop_due
            self.armed &= not licensed
            self.newest, self.repeatable = mine, True
            assert not self.memory("TELEGRAM_FRAME", length)[2] & START, "a stop that starts"
        elif action == WAITING:
            control = self.waiting.get(bool(no_reply))
            licensed = queued = control is not None
            if licensed:
                self.waiting[bool(no_reply)] = None
            self.newest, self.repeatable = mine, not no_reply
        else:
            control = self.writes_coils
            licensed = (mine and self.is_committed and not self.spent) or self.loopback
            queued = licensed or (mine and self.is_candidate)
            self.newest, self.repeatable = True, not self.is_broadcast
        self.telegram_queued, self.licensed, self.begun = queued, licensed, False
        self.control = bool(control) and licensed and not self.loopback
        self.no_reply = bool(no_reply)
        self.contents = self.memory("TELEGRAM_FRAME", length)
        # The loop-back test's pattern has a wrong BCC (LOOP-1).
        self.telegram = self.contents[:-1] if self.loopback else without_bcc(self.contents)

    def _keep(self) -> None:
        if self.is_broadcast in self.waiting:
            self.waiting[self.is_broadcast] = self.writes_coils
            self.spent |= self.writes_coils

    def _write_listen(self, on: int) -> None:
        self.listening = bool(on)
        self.drive_candidate = self.drive_good = False

    def event(self, name: str) -> None:
        """Something that the hardware flags."""
        self.events |= REGISTERS["EVENTS"].pack(**{name: 1})

    # ------------------------------------------------------------ what happens on the network line

    def candidate(self, pdu: bytes, broadcast: bool = False) -> None:
        """A good frame, and t1.5 of silence behind it."""
        self.bank ^= 1
        adu = bytes([0 if broadcast else self.address]) + pdu + bytes([JUNK] * CRC_BYTES)
        self._store(f"REQUEST_FRAME_{self.bank}", adu[:32])
        self._store("REPLY_FRAME", bytes([JUNK] * AREAS["REPLY_FRAME"].length))
        self.length = len(adu)
        self.ticket = (self.ticket + 1) & 15
        self.is_candidate, self.is_committed, self.is_broadcast = True, False, broadcast
        self.writes_coils = pdu[:1] in (b"\x05", b"\x0f")
        self.answerable = self.reply_queued = self.kept = False
        self._drop_unlicensed()

    def commit(self) -> None:
        """t3.5 of silence."""
        self.is_candidate, self.is_committed, self.answerable, self.spent = False, True, True, False
        self.since = self.time
        if self.licensed:
            self.newest = self.repeatable = False
            if self.begun:
                self._end_licence()
        elif self.telegram_queued:
            self.licensed, self.control = True, self.writes_coils
        if self.kept:
            self._keep()
        self.kept = False
        self._release()

    def character(self) -> None:
        """A character: revokes a candidate, makes a committed request too late to answer."""
        self.answerable = self.reply_queued = False
        if self.is_candidate:
            self.is_candidate = self.kept = False
            self._drop_unlicensed()

    def _drop_unlicensed(self) -> None:
        if not self.licensed:
            self.telegram_queued = False

    def _release(self) -> None:
        answerable = self.answerable or self.loopback
        if self.reply_queued and answerable and (not self.wait_drive or self.drive_good):
            self.reply_queued = self.answerable = False
            self.spent = True
            if self.newest and not self.loopback:
                self._end_licence()
            self.replies.append(self.reply)
        self._take_back_what_was_touched()
        if self.telegram_queued and self.licensed and self.quiet:
            self.telegram_queued, self.started, self.sending = False, True, True
            self.licensed = self.repeatable and not self.begun
            self.spent |= self.newest and self.control
            self.begun = True
            self.listening = self.drive_candidate = self.drive_good = False
            self.telegrams.append(self.telegram)

    # ------------------------------------------------------------ what happens on the drive line

    def pause_over(self) -> None:
        self.quiet = True
        self._release()

    def telegram_ends(self) -> None:
        """The last stop bit of the telegram is out."""
        if self.sending:
            assert self.contents == self.memory("TELEGRAM_FRAME", len(self.contents)), "touched while sent"
            self.sending, self.listening = False, not self.no_reply

    def drive_data(self, data: bytes, lge: int | None = None) -> None:
        """All of the drive's telegram but its BCC."""
        if self.listening and not self.drive_good:
            kept = bytearray(data[:24].ljust(AREAS["DRIVE_FRAME"].length, bytes([JUNK])))
            for i in range(24, len(data)):
                kept[24 + i % 4] = data[i]
            self._store("DRIVE_FRAME", kept)
            self._store("DRIVE_LGE", bytes([len(data) + 2 if lge is None else lge]))
            self.drive_candidate = True

    def bcc(self, good: bool = True) -> None:
        if self.drive_candidate:
            self.drive_candidate, self.drive_good = False, good
            if not good and self.wait_drive:
                self.reply_queued = False
            self._release()
