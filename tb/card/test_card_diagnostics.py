# SPDX-License-Identifier: Apache-2.0
"""The counters of MAP-10 against the traffic on the network line, at the pins of the card.

A model counts every frame that the traffic sends. The card must report the same counts. Frames follow
each other as closely as the standard allows. The image is that of the HVAC Basic Drive,
which has diagnostics by default.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable

import pytest

from regs.dialects import STANDARD
from tb.agents import rtu
from tb.agents.uart import Flaws
from tb.lib.card import MS
from tb.lib.config import own_hz
from tb.lib.fast_card import FastCard
from tb.lib.nightly import first
from tb.lib.seeds import seeded
from tb.lib.supervision import WatchedCard
from tb.model.card import CLEAR, EXCEPTIONS, MESSAGES, REGISTER, REQUESTS, CardModel

pytestmark = pytest.mark.parametrize("config", ["standard"])
OWN = 1
FRAMES = 60
REPLY_MS = 60
READ = rtu.read_registers(1, 2)
REFUSED = bytes.fromhex("07")
DIAGNOSES = [bytes([8, 0, sub, 0, 0]) for sub in (REGISTER, MESSAGES, 12, EXCEPTIONS, REQUESTS)] + [b"\x0b"]


class Traffic:
    """Sends frames on the network line, and counts each of them in the model."""

    def __init__(self, card: FastCard, rng: random.Random):
        self.card, self.rng = card, rng
        self.model = CardModel(name=STANDARD)
        self.fmt = card.modbus.fmt
        # A little more than t3.5 from the end of one frame to the start of the next.
        self.pause_ps = 1.05 * rtu.t35_ps(self.fmt.baud)
        self.sent: Counter[str] = Counter()

    def play(self, kind: Callable[[], None]) -> None:
        self.sent[kind.__name__] += 1
        kind()

    def ask(self, pdu: bytes) -> None:
        reply = self.card.request(rtu.build(OWN, pdu), REPLY_MS)
        expected = rtu.build(OWN, self.model.request(pdu).reply)
        assert reply and reply.data == expected, (
            f"{pdu.hex(' ')}: {reply and reply.data.hex(' ')} {dict(self.sent)}"
        )

    def send(self, data: bytes, flaws: Flaws | None = None) -> None:
        self.card.modbus.send(data, self.pause_ps, flaws)

    def other_unit(self) -> bytes:
        return rtu.build(self.rng.randrange(2, 248), self.rng.randbytes(self.rng.randrange(1, 12)))

    def some_frame(self) -> bytes:
        return self.other_unit() if self.rng.random() < 0.5 else rtu.build(OWN, READ)

    # ------------------------------------------------------------ kinds of frames

    def served(self) -> None:
        self.ask(READ)

    def refused(self) -> None:
        self.ask(REFUSED)

    def foreign(self) -> None:
        self.send(self.other_unit())
        self.model.counts["foreign"] += 1

    def to_all(self) -> None:
        pdu = bytes.fromhex("06 0001") + self.rng.randbytes(2)
        self.send(rtu.build(0, pdu))
        self.model.request(pdu, broadcast=True)

    def wrong_crc(self) -> None:
        data = bytearray(self.some_frame())
        data[-1] ^= 1 << self.rng.randrange(8)
        self.send(bytes(data))
        self.model.counts["crc"] += 1

    def too_short(self) -> None:
        self.send(self.rng.randbytes(1))
        self.model.counts["crc"] += 1

    def damaged(self) -> None:
        data = self.some_frame()
        if self.fmt.parity_bits and self.rng.random() < 0.5:
            self.send(data, Flaws(bad_parity=[self.rng.randrange(len(data))]))
            self.model.counts["parity"] += 1
        else:
            # The low stop bit of the last character; in the middle it would shift the characters after it.
            self.send(data, Flaws(bad_stop=[len(data) - 1]))
            self.model.counts["framing"] += 1

    def too_long(self) -> None:
        self.send(rtu.build(OWN, bytes(254)))
        self.model.counts["overrun"] += 1

    def cut(self) -> None:
        """A gap of 1.5 x t1.5 inside: the first part is thrown away, the rest is a bad frame."""
        data = rtu.build(9, READ)
        gap = 1.5 * rtu.t15_ps(self.fmt.baud) / self.fmt.bit_ps
        self.send(data, Flaws(gaps={3: gap}))
        self.model.counts.update(t15=1, crc=1)

    def continued(self) -> None:
        """A good frame, and one more character before t3.5."""
        own = self.rng.random() < 0.5
        data = rtu.build(OWN if own else 7, READ) + b"\x00"
        gap = 1.5 * rtu.t15_ps(self.fmt.baud) / self.fmt.bit_ps
        self.send(data, Flaws(gaps={len(data) - 1: gap}))
        self.model.counts["revoked" if own else "t15"] += 1


def play(card: FastCard, rng: random.Random, frames: int) -> Traffic:
    card.run(card.boot_ms)
    traffic = Traffic(card, rng)
    # The counters may hold anything from before.
    traffic.ask(bytes([8, 0, CLEAR, 0, 0]))
    kinds = [
        *(
            traffic.served,
            traffic.refused,
            traffic.foreign,
            traffic.to_all,
            traffic.wrong_crc,
            traffic.too_short,
        ),
        *(traffic.damaged, traffic.cut, traffic.continued),
    ]
    for number in range(frames):
        traffic.play(traffic.too_long if number % 50 == 25 else rng.choice(kinds))
        if number % 20 == 19:
            for pdu in DIAGNOSES:
                traffic.ask(pdu)
    return traffic


@pytest.mark.rule("MAP-10", "FRAME-4")
@pytest.mark.parametrize("line", first([(19200, "8E1"), (115200, "8N1")]), ids=str)
def test_the_counters_are_those_of_the_line(config: str, line: tuple[int, str]):
    """At the card's own clock, which the higher rate needs, and at a slow one."""
    baud, form = line
    clk_hz = own_hz(config) if baud > 19200 else None
    rng = seeded(f"diagnostics at {baud} bit/s")
    with FastCard(baud=baud, form=form, config=config, clk_hz=clk_hz, dialect=STANDARD) as card:
        traffic = play(card, rng, FRAMES)
        print(dict(traffic.sent), dict(traffic.model.counts))
        assert len(traffic.sent) == 10, "every kind"


@pytest.mark.rule("MAP-10", "WDG-1")
def test_a_master_reads_how_often_the_watchdog_bit(config: str):
    """A clear of the counters leaves this number alone."""
    with WatchedCard(config, dialect=STANDARD).boot() as card:
        for restarts in range(3):
            reply = card.request(rtu.build(OWN, bytes([8, 0, REGISTER, 0, 0])), REPLY_MS)
            assert reply.data[4] == restarts
            card.request(rtu.build(OWN, bytes([8, 0, CLEAR, 0, 0])), REPLY_MS)
            card.run_until(card.bite_now() + card.boot_ms * MS)
