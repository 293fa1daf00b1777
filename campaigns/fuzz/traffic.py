# SPDX-License-Identifier: Apache-2.0
"""Generates the fuzzer's cases: valid and invalid requests, times near the limits, damage, noise, bad drives.

Gaps stay clear of t1.5, t3.5 and the drive line's two characters by the tolerance of FRAME-1 and the sender's
error; everything else is random. A case depends only on its seed.
"""

from __future__ import annotations

import random

from campaigns.fuzz.case import DRIVE_DELAY_BITS, clk_hz, own_pace
from campaigns.fuzz.recorded import recorded_frames
from campaigns.soak.run import Traffic, wire
from regs.dialects import DIALECTS
from regs.generated.card_tables import CHARACTER_BITS
from sim.harness.pins import BAUDS, FORMS
from tb.agents.crc16 import with_crc
from tb.model.card import DRIVE_TIMEOUT
from tb.model.fc_telegram import STX, build
from tb.model.wire import PAUSE_BITS, UNSURE_BITS, LineFormat

# Weight of each rate, and number of events in its cases: at 300 bit/s a frame is a million clocks.
RATES = {
    115200: (8, 40),
    38400: (44, 45),
    19200: (38, 40),
    9600: (7, 20),
    4800: (1.5, 10),
    2400: (0.9, 6),
    1200: (0.4, 4),
    300: (0.12, 2),
}
WAITS = (3, 3, 3, 4, 4, 2)  # register 40003, in 10 ms: short, because a silent drive costs simulation time
# Of register 40003: beyond the 150 ms after which a waiting telegram ends an exchange (FC-9).
LONGER_WAIT = 20
FOREIGN = (2, 7, 99, 246, 247)
# 32-bit values of a parameter that just fit one register, or just do not (MAP-7).
LIMITS = (0xFFFF, 0x10000, 0xFFFF7FFF, 0xFFFF8000, 0xFFFFFFFF, 0x8000, 0x7FFFFFFF)
# Bits beyond the uncertain margin: near the limit, or anywhere.
NEAR_BITS = 3.0
# Pulses in a silence: their length in bits together. Each stops the count of silence for its own length. The
# judge allows 1.3 bits after t3.5 (PERF-1).
QUIET_PULSES_BITS = 0.3
APART_BITS = 1.2  # least distance of two pulses
RECORDED_FRAMES = (2, 8)  # least and most of one recording in a row
RECORDED_SILENCE_BITS = 200.0  # longer silences of a recording are cut to this


class FuzzTraffic(Traffic):
    """The PDUs of campaigns/soak/run.py, with waits for the drive that cost little simulated time."""

    def _wait(self) -> int:
        return self.rng.choice((*WAITS, 0))


class Maker:
    """Generates one case."""

    def __init__(self, seed: str, bauds: tuple[int, ...] = (), config: str = "standard") -> None:
        self.rng = rng = random.Random(seed)
        rates = {baud: RATES[baud] for baud in bauds or BAUDS}
        (self.baud,) = rng.choices(list(rates), [weight / events for weight, events in rates.values()])
        self.form = rng.choice(list(FORMS))
        self.line = LineFormat(self.baud, self.form, clk_hz(self.baud, own_pace(config)))
        self.address = rng.choice((1, 1, 247, rng.randint(1, 247)))
        self.dialect = rng.choices(list(DIALECTS), [8, 2, *[1] * (len(DIALECTS) - 2)])[0]
        if config != "standard":
            self.dialect = "card"  # the small card has no image of another dialect
        self.profile = rng.choice(DIALECTS[self.dialect].profiles)
        self.traffic = FuzzTraffic(rng, self.dialect, self.profile)
        self.kinds = {
            self.legal: 40,
            self.near_legal: 12,
            self.illegal: 7,
            self.slow_frame: 7,
            self.torn: 5,
            self.revoked: 6,
            self.damaged: 7,
            self.foreign: 6,
            self.collision: 8,
            self.noise: 4,
            self.glitches: 4,
            self.quiet_glitches: 6,
            self.recorded: 3,
            self.drifting: 5,
            self.bad_drive: 8,
            self.large_value: 4,
            self.waiting: 4,
            self.babble: 5,
        }

    def case(self) -> dict:
        events: list[dict] = [self._frame("setup", wire_write(DRIVE_TIMEOUT, self.rng.choice(WAITS)))]
        count = max(2, round(RATES[self.baud][1] * self.rng.uniform(0.6, 1.4)))
        while len(events) < count:
            (kind,) = self.rng.choices(list(self.kinds), self.kinds.values())
            made = kind()
            for event in made if isinstance(made, list) else [made]:
                event.setdefault("what", kind.__name__)
                events.append(event)
        return {
            "baud": self.baud,
            "form": self.form,
            "address": self.address,
            "dialect": self.dialect,
            "profile": self.profile,
            "events": events,
        }

    # ------------------------------------------------------------ pieces

    def _pdu(self) -> bytes:
        return self._pdus()[0]

    def _pdus(self) -> list[bytes]:
        return [request.pdu for request in self.traffic.requests(1)] or [b"\x01\0\0\0\x01"]

    def _unit(self) -> int:
        return self.address if self.rng.random() < 0.93 else 0

    def _frame(self, what: str, pdu: bytes, unit: int | None = None, **more: object) -> dict:
        unit = self._unit() if unit is None else unit
        return {"what": what, "gap": self._idle(), "bytes": with_crc(bytes([unit]) + pdu).hex(), **more}

    def _idle(self) -> list:
        """Start when the card has finished: just beyond t3.5, or later."""
        late = self.rng.random() < 0.2
        return ["idle", round(self.rng.uniform(1, 60) if late else self.rng.uniform(0.6, NEAR_BITS), 2)]

    def _margin(self, error: float = 0.0) -> float:
        return UNSURE_BITS + 0.1 + CHARACTER_BITS * abs(error)

    def _within(self, low: float, high: float) -> float:
        """Bits between two limits, often just inside one of them."""
        choice = self.rng.random()
        if choice < 0.3:
            return round(self.rng.uniform(low, min(high, low + NEAR_BITS)), 3)
        if choice < 0.6:
            return round(self.rng.uniform(max(low, high - NEAR_BITS), high), 3)
        return round(self.rng.uniform(low, high), 3)

    def _short_gap(self, error: float = 0.0) -> float:
        return self._within(0, self.line.t15_bits - self._margin(error))

    def _middle_gap(self, error: float = 0.0, extra: float = 0.0) -> float:
        """Between t1.5 and t3.5."""
        margin = self._margin(error)
        return self._within(self.line.t15_bits + margin + extra, self.line.t35_bits - margin - extra)

    def _long_gap(self, error: float = 0.0, extra: float = 0.0) -> float:
        return round(self.line.t35_bits + self._margin(error) + extra + self.rng.expovariate(1 / 12), 3)

    def _bits_after_commit(self) -> float:
        """Up to a few drive telegrams later, evenly over orders of magnitude."""
        most = 0.06 * self.baud
        return self.line.t35_bits + 1.0 + most ** self.rng.random()

    # ------------------------------------------------------------ the network line

    def legal(self) -> list[dict]:
        events = []
        for request in self.traffic.requests(1):
            events.append(self._frame("legal", request.pdu, {7: self.rng.choice(FOREIGN)}.get(request.unit)))
        return events

    def near_legal(self) -> dict:
        """One or two errors, with a correct CRC."""
        pdu = bytearray(self._pdu())
        for _ in range(self.rng.choice((1, 1, 2))):
            how = self.rng.randrange(6)
            if how == 0:
                pdu[self.rng.randrange(len(pdu))] ^= 1 << self.rng.randrange(8)
            elif how == 1:
                pdu = pdu[: self.rng.randint(1, len(pdu))]
            elif how == 2:
                pdu += self.rng.randbytes(self.rng.randint(1, 3))
            elif how == 3 and self.rng.random() < 0.3:
                length = self.rng.choice((28, 29, 30, 31, 32, 100, 252, 253, 254, 255, 300))
                pdu += self.rng.randbytes(max(0, length - len(pdu)))
            elif how == 4 and len(pdu) >= 5:
                pdu[3:5] = wire(self.rng.choice((0, 1, 2, 3, 10, 11, 32, 33, 128, 129, 0xFFFF)))
            elif how == 5 and len(pdu) >= 3:
                pdu[1:3] = wire(
                    self.rng.choice((2, 3, 8, 9, 31, 32, 64, 65, 128, 20469, 20479, 40949, 0xFFFF))
                )
        return self._frame("near_legal", bytes(pdu))

    def illegal(self) -> dict:
        """Random bytes, or a good frame with a wrong CRC."""
        if self.rng.random() < 0.5:
            return self._frame("illegal", self.rng.randbytes(self.rng.randint(1, 40)))
        data = bytearray(with_crc(bytes([self.address]) + self._pdu()))
        if self.rng.random() < 0.5:
            data[-1 - self.rng.randrange(2)] ^= 1 << self.rng.randrange(8)
        elif self.rng.random() < 0.5:
            data[-2:] = data[:-3:-1]
        else:
            data = bytearray(self.rng.randbytes(self.rng.choice((1, 2, 3, 4, 8, 31, 32, 33, 256, 257, 258))))
        return {"gap": self._idle(), "bytes": bytes(data).hex()}

    def slow_frame(self) -> dict:
        """Gaps inside, all below t1.5."""
        event = self._frame("slow_frame", self._pdu())
        count = len(event["bytes"]) // 2
        places = self.rng.sample(range(1, count), self.rng.randint(1, min(4, count - 1)))
        event["gaps"] = {str(place): self._short_gap() for place in places}
        return event

    def torn(self) -> list[dict]:
        """Split by a silence between t1.5 and t3.5, or by t3.5; sometimes a good frame follows at once."""
        event = self._frame("torn", self._pdu())
        count = len(event["bytes"]) // 2
        long = self.rng.random() < 0.3
        gap = self._long_gap() if long else self._middle_gap()
        if self.rng.random() < 0.5:
            event["gaps"] = {str(self.rng.randrange(1, count)): gap}
            return [event]
        # The card forgets a dropped part: the next byte is an address (FRAME-2).
        event["bytes"] = event["bytes"][: 2 * self.rng.randrange(1, count)]
        follower = self._frame("torn", self._pdu())
        follower["gap"] = ["own", self._long_gap() if self.rng.random() < 0.3 else self._middle_gap()]
        return [event, follower]

    def revoked(self) -> list[dict]:
        """Characters follow a good frame too early (FRAME-3)."""
        event = self._frame("revoked", self._pdu())
        follower = self._frame("revoked", self._pdu())
        how = self.rng.random()
        if how < 0.4:
            follower["bytes"] = self.rng.randbytes(self.rng.randint(1, 3)).hex()
        elif how < 0.7:
            # Characters after a revoked frame are dropped, including a good frame after a byte.
            follower["bytes"] = self.rng.randbytes(1).hex() + follower["bytes"]
        follower["gap"] = ["own", self._short_gap() if self.rng.random() < 0.2 else self._middle_gap()]
        return [event, follower]

    def damaged(self) -> dict:
        """Parity, stop bit or a data bit."""
        event = self._frame("damaged", self._pdu())
        data = bytearray.fromhex(event["bytes"])
        place = self.rng.randrange(len(data))
        flaw = self.rng.choice(("parity", "stop", "bit", "bits"))
        if flaw == "bit":
            data[place] ^= 1 << self.rng.randrange(8)
            event["flaws"] = {str(place): "parity"}
        elif flaw == "bits":
            # Two bits in one character: parity does not detect them.
            one, other = self.rng.sample(range(8), 2)
            data[place] ^= 1 << one | 1 << other
        else:
            event["flaws"] = {str(place): flaw}
        event["bytes"] = bytes(data).hex()
        return event

    def foreign(self) -> dict:
        """Frames for another unit, or from another unit: good frames all the same."""
        return self._frame("foreign", self._pdu(), self.rng.choice(FOREIGN))

    def collision(self) -> list[dict]:
        """A newer frame, or a few characters, before or during the card's answer (FRAME-7)."""
        event = self._frame("collision", self._pdu())
        if self.rng.random() < 0.3:
            event["drive"] = [self._manner() for _ in range(2)]
        events = [event]
        for _ in range(self.rng.choice((1, 1, 2, 3))):
            follower = self._frame("collision", self._pdu())
            if self.rng.random() < 0.4:
                follower["bytes"] = self.rng.randbytes(self.rng.randint(1, 4)).hex()
            if self.rng.random() < 0.3:
                follower = self.foreign() | {"what": "collision"}
            follower["gap"] = ["own", round(self._bits_after_commit(), 2)]
            if self.rng.random() < 0.3:
                follower["drive"] = [self._manner()]
            events.append(follower)
        return events

    def noise(self) -> list[dict]:
        """Pulses that are no characters, then silence."""
        pulses = [self.rng.uniform(1.2, 3)]
        kind = self.rng.random()
        if kind < 0.3:
            pulses = [self.rng.uniform(10, 60)]  # break
        elif kind < 0.9:
            pulses += [self.rng.uniform(0.05, 4) for _ in range(2 * self.rng.randrange(1, 12))]
        burst = {"what": "noise", "pulses": [round(bits, 3) for bits in pulses]}
        burst["gap"] = (
            self._idle() if self.rng.random() < 0.5 else ["own", round(self._bits_after_commit(), 2)]
        )
        after = self._frame("noise", self._pdu())
        after["gap"] = ["own", self._long_gap(extra=13.0)]
        return [burst, after]

    def glitches(self) -> dict:
        """Pulses below a quarter bit, at least a bit apart, anywhere in the frame."""
        event = self._frame("glitches", self._pdu())
        bits = len(event["bytes"]) // 2 * self.line.character_bits
        offset, found = self.rng.uniform(0.1, 20), []
        while offset < bits - 1 and len(found) < 12:
            found.append([round(offset, 3), round(self.rng.uniform(0.05, 0.2), 3)])
            offset += self.rng.uniform(1.2, 40)
        event["glitches"] = found
        return event

    def quiet_glitches(self) -> list[dict]:
        """Pulses below a quarter bit in the silence after a frame, often at the commit."""
        event = self._frame("quiet_glitches", self._pdu())
        frame_bits = len(event["bytes"]) // 2 * self.line.character_bits
        follower = self._frame("quiet_glitches", self._pdu())
        t35 = self.line.t35_bits
        how = self.rng.random()
        if how < 0.2:
            silent = self._middle_gap(extra=QUIET_PULSES_BITS)
            follower["gap"] = ["own", silent]
        elif how < 0.4:
            silent = self._long_gap(extra=QUIET_PULSES_BITS)
            follower["gap"] = ["own", silent]
        else:
            # Up to the exchange with the drive and its reply.
            silent = t35 + 2.0 + (0.04 * self.baud) ** self.rng.random()
            follower["gap"] = ["idle", round(max(1.0, silent - t35) + self.rng.uniform(1, 20), 2)]
        at = t35 + self.rng.uniform(-1, 1) if self.rng.random() < 0.5 else self.rng.uniform(0.1, silent)
        found, left = [], QUIET_PULSES_BITS
        while left > 0.02 and len(found) < 3:
            width = min(left, self.rng.choice((0.02, self.rng.uniform(0.02, 0.24))))
            if 0 < at < silent - APART_BITS and all(abs(frame_bits + at - o) > APART_BITS for o, _ in found):
                found.append([round(frame_bits + at, 3), round(width, 3)])
            left -= width
            at = self.rng.uniform(0.1, silent)
        event["glitches"] = sorted(found)
        return [event, follower]

    def recorded(self) -> list[dict]:
        """Frames of a recorded bus with their own gaps and silences; one of them may be damaged."""
        frames = self.rng.choice(recorded_frames())
        count = self.rng.randint(*RECORDED_FRAMES)
        first = self.rng.randrange(max(1, len(frames) - count))
        events = []
        for frame in frames[first : first + count]:
            silence = min(frame.silence * self.line.t35_bits, RECORDED_SILENCE_BITS)
            clear = self._margin() + 0.1
            if abs(silence - self.line.t35_bits) < clear:
                silence = self.line.t35_bits + clear
            event = {"what": "recorded", "gap": ["own", round(silence, 2)], "bytes": frame.data.hex()}
            event |= {
                key: dict(value) for key, value in (("gaps", frame.gaps), ("flaws", frame.flaws)) if value
            }
            events.append(event)
        events[0]["gap"] = self._idle()
        damaged = self.rng.choice(events)
        how, data = self.rng.random(), bytearray.fromhex(damaged["bytes"])
        place = self.rng.randrange(len(data))
        if how < 0.2:
            data[place] ^= 1 << self.rng.randrange(8)
            damaged["bytes"] = bytes(data).hex()
        elif how < 0.4:
            damaged["glitches"] = [[round(self.rng.uniform(0.1, 8 * len(data)), 3), 0.2]]
        elif how < 0.5:
            damaged["flaws"] = {str(place): self.rng.choice(("parity", "stop"))}
        return events

    def drifting(self) -> dict:
        """A sender up to 3 % off, with gaps inside."""
        error = round(self.rng.uniform(-0.03, 0.03), 4)
        event = self._frame("drifting", self._pdu(), error=error)
        count = len(event["bytes"]) // 2
        if self.rng.random() < 0.5:
            event["gaps"] = {str(self.rng.randrange(1, count)): self._short_gap(error)}
        return event

    # ------------------------------------------------------------ the drive

    def bad_drive(self) -> dict:
        """A request for the drive, and a slow, silent, wrong or broken drive."""
        event = self._frame("bad_drive", self._to_the_drive(), self.address)
        event["drive"] = [self._manner() for _ in range(self.rng.choice((1, 1, 2)))]
        if self.rng.random() < 0.15:
            event["interrupt"] = {"gap": 5.0, "bytes": self.rng.randbytes(self.rng.randint(1, 4)).hex()}
        return event

    def large_value(self) -> dict:
        """A read of a parameter whose value is at the limits of one register."""
        event = self._frame("large_value", self.traffic.read_number()[0][1], self.address)
        return event | {"drive": [{"gap": DRIVE_DELAY_BITS, "pwe": self.rng.choice(LIMITS)}]}

    def waiting(self) -> list[dict]:
        """Requests to all and to the card while the drive is silent or slow (FRAME-7, FC-9)."""
        rng, address = self.rng, self.address
        slow = {"gap": round(rng.uniform(100, 350), 2)}
        first = self._frame("waiting", self._to_the_drive(), address)
        first["drive"] = [
            rng.choice(({"silent": True}, {"silent": True}, slow)) for _ in range(rng.choice((1, 2)))
        ]
        events = [first]
        for _ in range(rng.choice((1, 2, 2, 3, 4))):
            (pdu, unit) = rng.choice(
                (
                    (self.traffic.command()[0][1], 0),
                    (self.traffic.write_number()[0][1], 0),
                    (self.traffic.command()[0][1], address),
                    (self.traffic.write_number()[0][1], address),
                    (self.traffic.read_number()[0][1], address),
                    (self.traffic.local()[0][1], address),
                )
            )
            follower = self._frame("waiting", pdu, unit)
            follower["gap"] = ["own", self._long_gap()]
            if rng.random() < 0.2:
                follower["drive"] = [{"silent": True}]
            events.append(follower)
        if rng.random() < 0.15:
            longer, shorter = (
                self._frame("waiting", wire_write(DRIVE_TIMEOUT, wait), address)
                for wait in (LONGER_WAIT, rng.choice(WAITS))
            )
            return [longer, *events, shorter]
        return events

    def _to_the_drive(self) -> bytes:
        of_one = (self.traffic.read_number, self.traffic.write_number, self.traffic.command)
        return self.rng.choice(of_one)()[0][1]

    def babble(self) -> dict:
        """Unrequested characters on the drive line, from before the commit on."""
        event = self._frame("babble", self._pdu(), self.address)
        data = self.rng.randbytes(self.rng.randint(1, 25))
        if self.rng.random() < 0.2:
            data = build(self.rng.randbytes(self.rng.choice((4, 12))))
        gaps = {
            str(i): self._within(0, PAUSE_BITS - 1) for i in range(1, len(data)) if self.rng.random() < 0.2
        }
        if len(data) > 5 and self.rng.random() < 0.4:
            # One gap is long enough for the card to begin.
            gaps[str(self.rng.randrange(1, len(data)))] = self._within(PAUSE_BITS + 1, PAUSE_BITS + 20)
        event["babble"] = {
            "gap": round(self.rng.uniform(0, 1.3 * len(event["bytes"]) / 2 * 11 * 9600 / self.baud), 2),
            "bytes": data.hex(),
            "gaps": gaps,
            "rude": self.rng.random() < 0.1,
        }
        return event

    def _manner(self) -> dict:
        """Behaviour of the drive for one telegram."""
        rng = self.rng
        bit = 1 << rng.randrange(8)
        first = {"gap": round(rng.choice((23.0, 24.0, rng.uniform(22.5, 60), rng.uniform(22.5, 400))), 2)}
        manner = rng.choice(
            (
                {},
                {"gap": round(rng.uniform(1, 900), 2)},  # slow, or too late
                {"silent": True},
                {"silent": True},
                {"bcc": bit},
                {"edit": [[2, bit]]},  # ADR
                {"edit": [[1, bit]]},  # LGE
                {"edit": [[0, bit]]},  # STX
                {"edit": [[4, bit]]},  # PNU, or a status
                {"edit": [[3, rng.choice((0x10, 0x20, 0x30, 0x60, 0x70, 0xE0, 0xF0, 0x08))]]},  # AK
                {"edit": [[rng.randrange(3, 12), rng.randrange(1, 256)]]},
                {"edit": [[rng.randrange(0, 14), bit]], "raw": True},
                {"fault": rng.choice((0, 1, 2, 3, 4, 5, 17, 130, 131, 6, 7, 11, 18, 99, 255))},
                {"pwe": rng.choice(LIMITS)},
                {"flaws": {str(rng.randrange(0, 8)): rng.choice(("parity", "stop"))}},
                {"gaps": {str(rng.randrange(1, 8)): self._within(0, PAUSE_BITS - 0.5)}},
                {"gaps": {str(rng.randrange(1, 8)): self._within(PAUSE_BITS + 0.7, PAUSE_BITS + 30)}},
                {"gaps": {str(i): 7.0 for i in range(1, 16)}},  # short gaps, but too slow in all
                {"gaps": {str(i): 3.5 for i in range(1, 16)}},
                {"cut": rng.randrange(1, 8)},
                {"before": rng.choice(("00", "ff", "02", "0206", "7f55")), "gap": 23.0},
                {"after": rng.randbytes(rng.randint(1, 3)).hex()},
                {"bytes": build(rng.randbytes(rng.choice((4, 12, 5, 20, 38)))).hex()},
                {"parts": [first | {"bcc": bit}, {"gap": round(rng.uniform(23, 120), 2)}]},
                {"parts": [first | {"edit": [[4, bit]]}, {"gap": round(rng.uniform(60, 160), 2)}]},
                {
                    "parts": [
                        first | {"bytes": rng.randbytes(rng.randint(1, 6)).hex()},
                        {"gap": rng.uniform(0, 60)},
                    ]
                },
                {"parts": [first | {"bytes": f"{STX:02x}"}, {"gap": rng.uniform(23, 90)}]},
            )
        )
        return manner if "parts" in manner else first | manner


def wire_write(register: int, value: int) -> bytes:
    return b"\x06" + wire(register, value)


def make(seed: str, bauds: tuple[int, ...] = (), config: str = "standard") -> dict:
    return Maker(seed, bauds, config).case()
