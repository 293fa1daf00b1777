# SPDX-License-Identifier: Apache-2.0
"""Our card as a graded slave: its pins in the simulation of sim/harness, with a drive that answers."""

from __future__ import annotations

from sw.rtu2fc.cases import BYTES, EDGES, PARITY, PINS, REASONS, Heard, Profile, Send, own_codes
from tb.agents import rtu
from tb.agents.edges import Trace
from tb.agents.rs485 import Pulse
from tb.agents.uart import Flaws, Format, waveform
from tb.lib.card import MS
from tb.lib.fast_card import FastCard
from tb.model.card import DIALECTS
from tb.model.vlt_drive import VltDrive

SEED = 1  # of the registers at power-up
# The option card's manual has exception codes of its own (rule EXC).
OWN_CODES = own_codes({reason: DIALECTS["card"].codes[reason] for reason in REASONS})
# Registers 40002 and 40003 are the time-outs: they keep every written value and need no drive. Coils 17-32
# are the reference. The map ends after register 40003 (MAP-6) and after coil 128.
PROFILE = Profile(
    unit=17,
    fmt=Format.named(19200, "8E1"),
    register=1,
    registers=2,
    coil=16,
    coils=16,
    no_register=3,
    no_coil=128,
    own_codes=OWN_CODES,
)
COIL_WRITES = (5, 15)
LOCAL_MS, DRIVE_MS = 40, 400  # until a reply must have begun


class CardDriver:
    """The whole card on its network pins. Close it, or use it with `with`."""

    sees = frozenset({BYTES, EDGES, PARITY, PINS})

    def __init__(self, config: str, profile: Profile = PROFILE):
        form = f"8{profile.fmt.parity}{profile.fmt.stop_bits}"
        self.fmt = profile.fmt
        self.card = FastCard(
            baud=profile.fmt.baud,
            form=form,
            address=profile.unit,
            drive=VltDrive().telegram,
            config=config,
            seed=SEED,
        )
        self.card.run(self.card.boot_ms + 10)
        self._free_ps = float(self.card.now_ps)
        self._mark()

    def __enter__(self) -> CardDriver:
        return self

    def __exit__(self, *_: object) -> None:
        self.card.close()

    def _mark(self) -> None:
        """All later edges of the card belong to the next transmission."""
        self._heard = {pin: len(self.card.recorded[pin]) for pin in ("modbus_tx", "modbus_de")}

    def _new(self, pin: str) -> list[tuple[int, int]]:
        return self.card.recorded[pin][self._heard[pin] :]

    def exchange(self, send: Send) -> Heard:
        bit, t35 = self.fmt.bit_ps, rtu.t35_ps(self.fmt.baud)
        pause = 2 * t35 if send.pause_bits is None else send.pause_bits * bit
        start = max(float(self.card.now_ps), self._free_ps + pause)
        if send.low_bits:
            edges, length = [(0.0, 0), (send.low_bits * bit, 1)], send.low_bits * bit
        else:
            edges, length = waveform(self.fmt, send.data, send.flaws or Flaws())
        for at, level in edges:
            self.card.plan(start + at, "modbus_line", level)
        self._free_ps = end = start + length
        if not send.wait:
            return Heard()
        drive = len(send.data) > 1 and send.data[1] in COIL_WRITES
        self.card.run_until(end + (DRIVE_MS if drive else LOCAL_MS) * MS, "modbus_de")
        if self._new("modbus_de")[-1:] and self._new("modbus_de")[-1][1] == 1:
            self.card.run_until(self.card.now_ps + 1000 * MS, "modbus_de")
        self.card.run_until(self.card.now_ps + t35)
        trace, de = Trace(self.fmt, self._new("modbus_tx")), self._new("modbus_de")
        falls = [*(at for at, _ in de[1::2]), None]  # DE may still be high
        pulses = [Pulse(up, down) for (up, _), down in zip(de[::2], falls, strict=False)]
        frame = trace.frame()
        self._free_ps = max([end, *(pulse.fall_ps or 0 for pulse in pulses)])
        self._mark()
        return Heard(frame.data if frame else b"", trace, pulses, end)
