# SPDX-License-Identifier: Apache-2.0
"""Pulses below a quarter bit after a request cost no request, no reply and no broadcast (LINE-5).

One pulse in each request, at every moment from the last stop bit to the reply. The moments of the commit are
tried clock by clock. Widths: one clock, and the widest below a quarter bit.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import pytest

from regs.generated.card_tables import TICKS_PER_BIT
from tb.agents import rtu
from tb.agents.fc_slave import Script
from tb.lib.card import MS
from tb.lib.fast_card import FastCard

REQUEST = rtu.build(1, rtu.read_registers(2, 1))
REPLY = rtu.build(1, bytes.fromhex("03 02 00 0F"))
STOP = rtu.build(0, rtu.write_coils(0, [bool(0x043C >> i & 1) for i in range(16)]))
CLK_HZ = 2_000_000  # the lowest clock
# A pulse stops the count of silence for the ticks that it covers. Each request begins anywhere in a tick.
LATE_TICKS = 2
STEP = 40  # ticks


class Pulses:
    """A card and the moments of pulses, in ps after the end of a request's last stop bit."""

    def __init__(self, card: FastCard):
        self.card = card
        self.bit_ps = card.modbus.fmt.bit_ps
        self.tick_ps = self.bit_ps / TICKS_PER_BIT
        self.commit_ps = rtu.t35_ps(card.modbus.fmt.baud)
        quarter = int((self.bit_ps / 4 - 1) // card.period_ps)
        self.widths_ps = sorted({card.period_ps, quarter * card.period_ps})

    def around_the_commit(self) -> Iterator[float]:
        """Every clock from two ticks before the commit to one after it."""
        moment = self.commit_ps - 2 * self.tick_ps
        while moment < self.commit_ps + self.tick_ps:
            yield moment
            moment += self.card.period_ps

    def after_the_request(self, until_ps: float) -> Iterator[float]:
        """Every `STEP` ticks from the beginning of the last stop bit on."""
        moment = -self.bit_ps
        while moment < until_ps:
            yield moment
            moment += STEP * self.tick_ps

    def send(self, request: bytes, pulse: tuple[float, float] | None) -> int:
        """Sends a request with a pulse (moment, width) after it; returns the end of its last stop bit."""
        end = self.card.modbus.send(request, 1.1 * rtu.t35_ps(self.card.modbus.fmt.baud))
        if pulse:
            moment, width = pulse
            self.card.plan(end + moment, "flip_to_modbus", 1)
            self.card.plan(end + moment + width, "flip_to_modbus", 0)
        return end

    def reply_ps(self, pulse: tuple[float, float] | None) -> int:
        """Time from the request to DE."""
        end = self.send(REQUEST, pulse)
        before = len(self.card.modbus.frames())
        assert self.card.run_until(end + self.commit_ps + 20 * MS, "modbus_de"), f"no reply, pulse {pulse}"
        rose = self.card.now_ps
        assert self.card.run_until(rose + 400 * self.bit_ps, "modbus_de")
        frames = self.card.modbus.frames()
        assert len(frames) == before + 1 and frames[-1].data == REPLY
        return rose - end


@pytest.mark.rule("LINE-5", "FRAME-6")
@pytest.mark.parametrize(
    ("form", "baud"), [pytest.param("8E1", 19_200, marks=pytest.mark.nightly), ("8N2", 9600)]
)
def test_a_pulse_after_a_request_costs_no_reply(form: str, baud: int):
    """On a request that the card answers itself."""
    with FastCard(baud=baud, form=form, clk_hz=CLK_HZ) as card:
        card.run(card.boot_ms)
        pulses = Pulses(card)
        plain = [pulses.reply_ps(None) for _ in range(8)]
        moments = [*pulses.around_the_commit(), *pulses.after_the_request(max(plain))]
        for pulse in itertools.product(moments, pulses.widths_ps):
            late = pulses.reply_ps(pulse) - max(plain)
            assert late <= pulse[1] + LATE_TICKS * pulses.tick_ps, f"{late} ps late, pulse {pulse}"
        assert len(moments) * len(pulses.widths_ps) > 60


@pytest.mark.rule("LINE-5", "FRAME-6")
def test_a_pulse_at_the_commit_costs_no_broadcast():
    """The drive must get it."""
    drive = Script()
    with FastCard(baud=19_200, form="8E1", clk_hz=CLK_HZ, drive=drive) as card:
        card.run(card.boot_ms)
        pulses = Pulses(card)
        for pulse in itertools.product(pulses.around_the_commit(), pulses.widths_ps):
            before = len(card.drive.frames())
            end = pulses.send(STOP, pulse)
            card.run_until(end + pulses.commit_ps + 30 * MS)
            sent = [frame.data for frame in card.drive.frames()[before:]]
            assert len(sent) == 1, f"{len(sent)} telegrams, pulse {pulse}"
            assert sent[0][:3] == bytes.fromhex("02 06 80") and sent[0][3:5] == b"\x04\x3c"
