# SPDX-License-Identifier: Apache-2.0
"""One case of the fuzzer, played: a card after power-up, and the actions of its two far ends.

A case is plain data, kept as JSON and replayed exactly. Its events happen on the network line, one after the
other; each event sets the drive's behaviour from then on.

    {"baud": 19200, "form": "8E1", "address": 1, "dialect": "card", "profile": "vlt6000", "events": [
      {"what": "...", "gap": ["idle", 5.0], "bytes": "01010000...", "gaps": {"3": 12.5},
       "flaws": {"2": "parity"}, "error": 0.01, "glitches": [[4.2, 0.2]], "pulses": [2.0, 1.5],
       "drive": [{"gap": 23, "edit": [[2, 255]], ...}], "babble": {"gap": 10, "bytes": "55", "gaps": {}}}]}

`stale`: the drive sends the answer to the telegram before.

`clk_hz`: clock of the card, if it is not the one for the rate. `gap`: start of the event. ["idle", n]: n bits
after t3.5, when the card has no more to send; ["own", n]: n bits after the last character from outside,
regardless of the card. `pulses`: instead of bytes, low and high for so many bits. After the last event come
requests that a card must always answer (SAFE-3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from rtl.sources import configuration
from sim.harness.library import Target
from sim.harness.pins import DRIVE, NETWORK, Pins
from tb.agents import rtu
from tb.agents.crc16 import crc_good
from tb.model import fc_telegram
from tb.model.card import DIALECTS, DRIVE_TIMEOUT, word
from tb.model.vlt_drive import VltDrive
from tb.model.wire import GARBLED_BITS, Burst, FarCharacter, LineFormat

# Clock for a rate, in Hz: at least 64 times the rate (LINE-5) and 2 MHz (TOP-1); no more, because each clock
# costs simulation time.
CLK_HZ = {115200: 7_372_800, 38400: 2_457_600}
SLOW_CLK_HZ = 2_000_000
# Limit for the firmware from the candidate, or from the drive's reply, to its answer; measured were up to
# 8500, on an earlier card.
BUDGET_CLOCKS = 10000
# Pause of a far end after t3.5 or the drive's reply, before it assumes that the card has finished. It is
# enough for nearly all answers; later answers meet the next frame.
SETTLE_CLOCKS = 3000
SERV_TIMES = 10  # clocks of the small card's core for one of the standard card's
# A driver that is on for longer stays on for ever; the longest frame is 34 characters (SAFE-2).
STUCK_BITS = 400
BOOT_S = 0.05  # of a clock six times slower than BOOT-1's
# Shortest pause before a drive answers (FC-8), a bit longer than the card must accept.
DRIVE_DELAY_BITS = 24.0
SHORTEST_TELEGRAM_BITS = 80
LONG_WAIT = 100  # of register 40003, in 10 ms
PARAMETER = 514  # a drive without it returns a fault number, which is an answer too


@dataclass(frozen=True)
class Pace:
    """How fast the firmware of a configuration is: see the constants."""

    slow_clk_hz: int = SLOW_CLK_HZ
    settle_clocks: int = SETTLE_CLOCKS
    budget_clocks: int = BUDGET_CLOCKS
    boot_s: float = BOOT_S


def serv_pace(clk_hz: int, boot_s: float) -> Pace:
    """Of a card with the small core, at one clock for all rates."""
    return Pace(clk_hz, SERV_TIMES * SETTLE_CLOCKS, SERV_TIMES * BUDGET_CLOCKS, boot_s)


def own_pace(config: str) -> Pace:
    """Own clock of the small card: at a slower one its firmware is too slow for frames in a row (PERF-1)."""
    settings = configuration(config)
    serv = settings["soft_core"] == "serv"
    return serv_pace(settings["clk_hz"], settings["boot_ms"] / 1000) if serv else Pace()


def clk_hz(baud: int, pace: Pace | None = None) -> int:
    return max(CLK_HZ.get(baud, 0), (pace or Pace()).slow_clk_hz)


def probes(dialect: str) -> list[dict]:
    """Good requests: all coils, the card's own registers, a command and a parameter of the drive."""
    index = DIALECTS[dialect].index_register
    pdus = [
        rtu.write_register(index, 0),
        rtu.read_coils(0, 65),
        rtu.read_registers(1, 2),
        rtu.write_coils(0, [bool(0x047C >> i & 1) for i in range(16)]),
        rtu.read_registers(10 * PARAMETER - 1, 2),
    ]
    return [{"what": "probe", "gap": ["idle", 30.0], "pdu": pdu.hex()} for pdu in pdus]


@dataclass
class Played:
    """All traffic on the two lines."""

    network: list[FarCharacter]
    drive: list[FarCharacter]
    replies: list[Burst]
    telegrams: list[Burst]
    end: int
    frames: list[float]  # start of each frame on the network line

    def judged(self, until: float) -> int:
        """Number of frames whose time, up to the next frame, was over by `until`."""
        return sum(over <= until for over in [*self.frames[1:], self.end])


class Player:
    """Plays a case's events onto the lines of a card."""

    def __init__(
        self, case: dict, target: Target, wave: Path | None = None, extra: str = "", pace: Pace | None = None
    ) -> None:
        self.case = case
        self.pace = pace or own_pace(target.config)
        clock = case.get("clk_hz", clk_hz(case["baud"], self.pace))
        # A start takes the same number of clocks at any clock.
        self.booting_hz = self.pace.slow_clk_hz if "clk_hz" in case else clock
        library = target.library(clock, "waves" if wave else extra)
        self.line = LineFormat(case["baud"], case["form"], clock)
        self.pins = Pins(library, target.image_folder(case["dialect"]), self.line, case["address"], wave)
        self.drive_line = self.pins.lines[DRIVE]
        self.model = VltDrive(case["profile"])
        self.network: list[FarCharacter] = []
        self.drive: list[FarCharacter] = []
        self.network_start = self.network_end = self.drive_end = 0.0
        self.stepped_us = 0
        self.manners: list[dict] = []
        self.reply_before: bytes | None = None
        self.interrupt: dict | None = None
        self.rude = False  # sends on while the card is sending
        self.wait = 15  # register 40003
        self.frames: list[float] = []
        self.settle_by = 0.0
        self.drive_awaited = False

    # ------------------------------------------------------------ the whole case

    def play(self, probed: bool = True) -> Played:
        try:
            self._run(self.pace.boot_s * self.booting_hz)
            for event in [*self.case["events"], *(probes(self.case["dialect"]) if probed else ())]:
                self._event(event)
            # Run once more if a telegram has just begun: half a telegram would count as damaged.
            for _ in range(2):
                self._settle()
                self._run(self.pins.now + self.line.bit * self.line.t35_bits)
                if not (self.pins.sending(NETWORK) or self.pins.sending(DRIVE)):
                    break
            return self.played()
        finally:
            self.pins.close()

    def played(self) -> Played:
        return Played(
            self.network,
            self.drive,
            self.pins.sent(NETWORK),
            self.pins.sent(DRIVE),
            self.pins.now,
            self.frames,
        )

    def _event(self, event: dict) -> None:
        how, bits = event["gap"]
        if how == "idle":
            self._settle()
            silent = max(self.network_end, self._last_fall())
            if self.network_end > self._last_fall() > self.network_start:
                bits += GARBLED_BITS + 1  # the card received a part of its end
            start = max(self.pins.now + 2, silent + (self.line.t35_bits + bits) * self.line.bit)
        else:
            start = max(self.pins.now + 2, self.network_end + bits * self.line.bit)
        self._run(start - 1)
        start = self._clear_of_t35(start)
        self._run(start - 1)
        self.network_start = start
        self.manners = list(event.get("drive", []))
        self.interrupt = event.get("interrupt")
        if "pulses" in event:
            self._pulses(event["pulses"], start)
        else:
            self._send(event, start)
        if "babble" in event:
            babble = event["babble"]
            self.rude = babble.get("rude", False)
            at = max(self.pins.now + 2, start + babble["gap"] * self.drive_line.bit)
            self._drive_sends(bytes.fromhex(babble["bytes"]), at, babble)

    def _clear_of_t35(self, start: float) -> float:
        """Delays a start that would fall close to t3.5 after the card's own reply."""
        fall = self._last_fall()
        garbled = self.network_end > fall > self.network_start
        silent, margin = (self.network_end, GARBLED_BITS + 1) if garbled else (fall, 1.0)
        near = garbled or fall > self.network_end
        if near and abs((start - silent) / self.line.bit - self.line.t35_bits) < margin:
            return silent + (self.line.t35_bits + margin) * self.line.bit
        return start

    # ------------------------------------------------------------ the network line

    def _pulses(self, pulses: list[float], start: float) -> None:
        """Noise that begins with a certain start bit."""
        edges, at, level = [], start, 0
        for bits in pulses:
            edges.append((at, level))
            at, level = at + bits * self.line.bit, 1 - level
        edges.append((at, 1))
        self.pins.play(NETWORK, edges)
        self.network.append(FarCharacter(start, at, 0, False, GARBLED_BITS * self.line.bit))
        self.network_end = at

    def _send(self, event: dict, start: float) -> None:
        data = bytes.fromhex(event["bytes"]) if "bytes" in event else None
        if data is None:
            data = rtu.build(self.case["address"], bytes.fromhex(event["pdu"]))
        self.network_end = self._characters(NETWORK, self.line, data, start, event, self.network)
        self.frames.append(start)
        if data[0] in (0, self.case["address"]) and crc_good(data):
            self._notice_wait(data)

    def _characters(
        self, where: int, line: LineFormat, data: bytes, start: float, how: dict, heard: list[FarCharacter]
    ) -> float:
        """Puts characters onto a line; returns the end of the last one."""
        bit = line.bit / (1 + how.get("error", 0.0))
        gaps, flaws = how.get("gaps", {}), how.get("flaws", {})
        edges: list[tuple[float, int]] = []
        at, glitches = start, how.get("glitches", [])
        stretched = sum(width for _, width in glitches) * line.bit
        for number, byte in enumerate(data):
            at += gaps.get(str(number), 0.0) * line.bit
            flaw = flaws.get(str(number), "")
            levels = line.levels(byte, flaw)
            edges += [(at + i * bit, level) for i, level in enumerate(levels)]
            end = at + len(levels) * bit
            edges.append((end, 1))
            slack = (
                abs(len(levels) * (bit - line.bit)) + stretched + (1.5 * line.bit if flaw == "stop" else 0)
            )
            good = not flaw or (flaw == "parity" and not line.parity)
            heard.append(FarCharacter(at, end, byte, good, slack))
            at = end
            if flaw == "stop":
                # The receiver waits for a high line before it accepts a start bit.
                at = max(at, end + 2 * line.bit)
        self.pins.play(where, self._with_glitches(edges, start, line, glitches))
        return heard[-1].end if data else start

    def _with_glitches(
        self, edges: list[tuple[float, int]], start: float, line: LineFormat, glitches: list[list[float]]
    ) -> list[tuple[float, int]]:
        """Inverts the line for less than a quarter bit at some places (LINE-5)."""
        for offset, width in glitches:
            begin, end = start + offset * line.bit, start + (offset + width) * line.bit
            before = [level for at, level in edges if at <= begin]
            level = before[-1] if before else 1
            within = [level for at, level in edges if begin < at <= end]
            edges = [(at, value) for at, value in edges if not begin <= at <= end]
            edges += [(begin, 1 - level), (end, within[-1] if within else level)]
            edges.sort(key=lambda edge: edge[0])  # stable: of two simultaneous edges the last one counts
        return edges

    def _notice_wait(self, data: bytes) -> None:
        """Follows writes of register 40003, only to know how long to wait for the card."""
        pdu = data[1:-2]
        if len(pdu) == 5 and pdu[0] == 0x06 and word(pdu, 1) == DRIVE_TIMEOUT:
            self.wait = word(pdu, 3)
        elif len(pdu) > 6 and pdu[0] == 0x10 and word(pdu, 1) <= DRIVE_TIMEOUT:
            at = 6 + 2 * (DRIVE_TIMEOUT - word(pdu, 1))
            if len(pdu) >= at + 2:
                self.wait = word(pdu, at)

    def _last_fall(self) -> float:
        return self.pins.bursts[NETWORK][-1].fall if self.pins.bursts[NETWORK] else 0.0

    # ------------------------------------------------------------ time

    def _run(self, until: float, to_the_end: bool = True) -> list[tuple[int, int]]:
        """Runs to a time or to the next edge of a driver, and lets the drive answer."""
        switched: list[tuple[int, int]] = []
        while self.pins.now < round(until) and (to_the_end or not switched):
            switched = self.pins.run(until)
            for line, level in switched:
                if line == DRIVE and level:
                    self._interrupted()
                elif line == DRIVE:
                    self._telegram(self.pins.bursts[DRIVE][-1])
        return switched

    def _settle(self) -> None:
        """Runs until the card has no more to send."""
        budget = self.pace.settle_clocks + 3 * self.line.bit
        longer_bit = max(self.line.bit, self.drive_line.bit)
        while True:
            heard = max(self.network_end, self._last_fall()) + self.line.t35_bits * self.line.bit
            answered = self.drive_end + 25 * self.drive_line.bit + self.pace.settle_clocks
            by = max(self.settle_by, heard + budget, answered)
            sending = self.pins.sending(NETWORK) or self.pins.sending(DRIVE)
            if self.pins.now >= round(by + (STUCK_BITS * longer_bit if sending else 0)):
                return
            # Beyond that time, only for the end of a frame that the card is sending.
            by = by if self.pins.now < round(by) else self.pins.now + self.line.clk_hz / 100
            switched = self._run(by, to_the_end=False)
            if (NETWORK, 0) in switched and not self.drive_awaited:
                return

    # ------------------------------------------------------------ the drive

    def _interrupted(self) -> None:
        """At the start of a telegram a babbling drive stops, or begins. The card hears neither (FC-10)."""
        now, bit = self.pins.now, self.drive_line.bit
        if self.drive_end > now and not self.rude:
            self.pins.hush(DRIVE)
            self.drive = [h if h.end <= now else replace(h, end=now) for h in self.drive if h.start < now]
            self.drive_end = now
        how, self.interrupt = self.interrupt, None
        if how:
            data = bytes.fromhex(how["bytes"])
            at = max(now + 2, self.drive_end) + how["gap"] * bit
            if at + 11 * len(data) * bit < now + SHORTEST_TELEGRAM_BITS * bit:
                self._drive_sends(data, at, {})

    def _telegram(self, burst: Burst) -> None:
        now_us = int(burst.fall / self.line.clk_hz * 1e6)
        self.model.step(now_us - self.stepped_us)
        self.stepped_us = now_us
        reply = self.model.telegram(burst.data)
        self.settle_by = burst.fall + self.pace.settle_clocks + 25 * self.drive_line.bit
        self.drive_awaited = False
        if len(burst.data) > 2 and fc_telegram.is_broadcast(burst.data[2]):
            return
        manner = self.manners.pop(0) if self.manners else {}
        waited = burst.fall + (10 * min(self.wait, LONG_WAIT) + 8) * self.line.clk_hz / 1000
        self.settle_by = max(self.settle_by, waited + self.pace.settle_clocks)
        self.drive_awaited = True
        end = self._answer(burst, reply, manner)
        self.reply_before = reply
        if not manner and reply is not None:
            self.settle_by = end + self.pace.settle_clocks + 3 * self.line.bit
            self.drive_awaited = False

    def _answer(self, burst: Burst, reply: bytes | None, manner: dict) -> float:
        at = burst.fall + 0.0
        parts = manner.get("parts", [manner])
        for part in parts:
            data = bytes.fromhex(part["bytes"]) if "bytes" in part else reply
            data = self.reply_before if part.get("stale") else data
            if part.get("silent") or data is None:
                continue
            data = spoilt(data, part)
            at = max(at + part.get("gap", DRIVE_DELAY_BITS) * self.drive_line.bit, self.drive_end + 1)
            at = self._drive_sends(data, at, part)
        return at

    def _drive_sends(self, data: bytes, at: float, how: dict) -> float:
        at = max(at, self.drive_end + 1, self.pins.now + 1)
        self.drive_end = self._characters(DRIVE, self.drive_line, data, at, how, self.drive)
        return self.drive_end


def spoilt(reply: bytes, how: dict) -> bytes:
    """A telegram with the errors of a faulty drive."""
    data = bytearray(reply)
    if ("fault" in how or "pwe" in how) and len(data) > 8:
        value = how.get("fault", how.get("pwe", 0))
        data[3] = (0x70 if "fault" in how else 0x20) | data[3] & 0x0F
        data = data[:7] + value.to_bytes(4, "big") + data[-5:]
        data[1] = len(data) - 2
    for at, mask in how.get("edit", []):
        data[at % len(data)] ^= mask
    if data != reply and not how.get("raw"):
        data[-1] = fc_telegram.bcc(data[:-1])
    if "bcc" in how:
        data[-1] ^= how["bcc"]
    if "cut" in how:
        data = data[: how["cut"] % len(data)]
    return bytes.fromhex(how.get("before", "")) + bytes(data) + bytes.fromhex(how.get("after", ""))
