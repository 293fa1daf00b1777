# SPDX-License-Identifier: Apache-2.0
"""A cocotb bench that grades any HDL top with the pins rx, tx and perhaps de.

campaigns/conformance/designs.py starts it. DESIGN (JSON) in the environment describes the top, VERDICTS names
the file for the verdicts.
"""

from __future__ import annotations

import json
import os
from collections.abc import Generator
from dataclasses import asdict
from pathlib import Path

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import First, Timer, ValueChange

from sw.rtu2fc.cases import BYTES, CASES, EDGES, LONGEST_FRAME, PARITY, PINS, Heard, Profile, Send
from sw.rtu2fc.engine import NoAnswer, presence, steps
from tb.agents import rtu
from tb.agents.edges import Trace
from tb.agents.rs485 import Rs485Line
from tb.agents.uart import Format, now_ps, sleep_until

RESET_CLOCKS = 20
US = 1_000_000


class PinsDriver:
    """One top: clock, reset, constant inputs, and its line. A top without de shows no DE."""

    def __init__(self, dut, design: dict):
        self.dut, self.design = dut, design
        pins = design["pins"]
        self.fmt = Format.named(design["baud"], design["form"])
        de = getattr(dut, pins["de"]) if pins.get("de") else getattr(dut, pins["rx"])
        self.sees = frozenset({BYTES, EDGES, PARITY, *([PINS] if pins.get("de") else [])})
        self.line = Rs485Line(getattr(dut, pins["rx"]), getattr(dut, pins["tx"]), de, self.fmt)
        self._free_ps = 0.0
        self._heard = (0, 0)

    async def start(self) -> None:
        design, dut = self.design, self.dut
        for name, value in design.get("inputs", {}).items():
            getattr(dut, name).value = value
        self._period = 2 * round(5e11 / design["clk_hz"])
        Clock(getattr(dut, design["pins"]["clk"]), self._period, unit="ps").start()
        await self.reset()

    async def reset(self) -> None:
        """Resets the slave, so that a test does not depend on those before it."""
        reset = getattr(self.dut, self.design["pins"]["rst"])
        active = 0 if self.design.get("reset_low") else 1
        reset.value = active
        await Timer(RESET_CLOCKS * self._period, unit="ps")
        reset.value = 1 - active
        await self.line.source.idle(100)
        self._free_ps = now_ps()
        # During reset an output may change from unknown to idle. That edge is no reply.
        self._heard = len(self.line.monitor.edges), len(self.line.direction.pulses)

    async def exchange(self, send: Send) -> Heard:
        bit, t35 = self.fmt.bit_ps, rtu.t35_ps(self.fmt.baud)
        line = self.line
        # Some slaves are deaf for a while after their reply. SL-25 alone tests that.
        usual = self.design.get("pause_bits", 2 * t35 / bit)
        await sleep_until(self._free_ps + (usual if send.pause_bits is None else send.pause_bits) * bit)
        if send.low_bits:
            sent = await line.source.send_break(send.low_bits, idle_after=0)
        else:
            sent = await line.source.send(send.data, send.flaws)
        self._free_ps = sent.end_ps
        if not send.wait:
            return Heard()
        await self._silence(sent.end_ps + self.design["reply_us"] * US, t35)
        edges, pulses = line.monitor.edges[self._heard[0] :], line.direction.pulses[self._heard[1] :]
        self._heard = len(line.monitor.edges), len(line.direction.pulses)
        trace = Trace(self.fmt, edges)
        frame = trace.frame()
        self._free_ps = max([sent.end_ps, frame.end_ps if frame else 0, *(p.fall_ps or 0 for p in pulses)])
        return Heard(frame.data if frame else b"", trace, pulses if PINS in self.sees else None, sent.end_ps)

    async def _silence(self, latest_ps: float, t35: float) -> None:
        """Waits for a reply and the silence after it. Its first edge must come until `latest_ps`.

        A slave that never falls silent ends the wait, too.
        """
        known = self._heard[0]
        tx = self.line.monitor.pin
        longest_ps = latest_ps + 2 * LONGEST_FRAME * self.fmt.character_ps
        while (left := min(self._quiet_at(known, latest_ps, t35), longest_ps) - now_ps()) > 0:
            await First(ValueChange(tx), Timer(round(left), unit="ps"))
        if (
            PINS in self.sees
            and self.line.direction.pulses
            and self.line.direction.pulses[-1].fall_ps is None
        ):
            await Timer(round(4 * t35), unit="ps")

    def _quiet_at(self, known: int, latest_ps: float, t35: float) -> float:
        edges = self.line.monitor.edges[known:]
        return edges[-1][0] + self.fmt.character_ps + t35 if edges else latest_ps


async def pump(dialogue: Generator[Send, Heard, object], driver: PinsDriver) -> object:
    heard = None
    while True:
        try:
            send = dialogue.send(heard)
        except StopIteration as end:
            return end.value
        heard = await driver.exchange(send)


@cocotb.test()
async def grade(dut):
    design = json.loads(os.environ["DESIGN"])
    known = dict(design.get("profile", {}))
    known["functions"] = frozenset(known.get("functions", Profile().functions))
    profile = Profile(fmt=Format.named(design["baud"], design["form"]), **known)
    driver = PinsDriver(dut, design)
    await driver.start()
    found: list[dict] | dict = []
    only = design.get("only")
    try:
        await pump(presence(profile), driver)
        for case in CASES:
            if only is None or case.number in only:
                await driver.reset()
                found.append(asdict(await pump(steps(case, profile, driver.sees), driver)))
    except NoAnswer as silence:
        found = {"error": str(silence)}
    Path(os.environ["VERDICTS"]).write_text(json.dumps(found))
