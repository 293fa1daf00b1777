# SPDX-License-Identifier: Apache-2.0
"""The whole card on a cocotb bench: switches set, both lines connected, firmware booted."""

from __future__ import annotations

from collections.abc import Callable

from cocotb.triggers import ReadOnly, RisingEdge, Timer, with_timeout

from regs.generated.card_tables import DRIVE_BAUD, EXTENDED_FORMATS, EXTENDED_RATES
from regs.generated.mailbox import REGISTERS
from tb.agents.fc_slave import FcSlave
from tb.agents.modbus_master import ModbusMaster
from tb.agents.uart import Format
from tb.lib.bench import Bench
from tb.lib.config import boot_clocks
from tb.lib.line_tap import RecordedLine, tap_leds

PARITY_LETTER = {"none": "N", "even": "E", "odd": "O"}
MS = 1_000_000_000


def line_formats() -> dict[str, str]:
    """Format name, for example 8E1, to the positions of switches 4 and 5."""
    return {f"8{PARITY_LETTER[f.parity]}{f.stop_bits}": key for key, f in EXTENDED_FORMATS.items()}


def baud_switches(baud: int, form: str, rest: str = "0000") -> str:
    """Positions of switches 1 to 9 of a card with EXTENDED_SWITCHES = 1, first switch first, 1 = ON."""
    rate = next(key for key, entry in EXTENDED_RATES.items() if entry.baud == baud)
    return rate + line_formats()[form] + rest


def switch_word(positions: str) -> int:
    """Pin value of switch positions: switch 1 is the lowest bit."""
    return int(positions[::-1], 2)


async def firmware_polls(dut) -> None:
    """Waits until the firmware reads REQUEST; it does not while it checks its image at the start."""
    mailbox = dut.mailbox_i
    while True:
        await RisingEdge(mailbox.regs_valid)
        await ReadOnly()
        if not mailbox.regs_write.value and mailbox.regs_word.value == REGISTERS["REQUEST"].offset // 4:
            return


class CardBench:
    """The card with a master on the network line and a drive on the drive line."""

    def __init__(
        self,
        dut,
        clk_hz: int,
        model: Callable[[bytes], bytes | None] | None = None,
        baud: int = 19200,
        form: str = "8N2",
        address: int = 1,
    ):
        self.dut = dut
        self.clk_hz = clk_hz
        self.bench = Bench(
            dut,
            clk_hz,
            sw_baud=switch_word(baud_switches(baud, form)),
            sw_addr=address,
        )
        self.modbus = RecordedLine(dut.modbus_rx, dut.modbus_tx, dut.modbus_de, Format.named(baud, form))
        self.drive = RecordedLine(dut.drive_rx, dut.drive_tx, dut.drive_de, Format.named(DRIVE_BAUD, "8E1"))
        tap_leds(dut)
        self.master = ModbusMaster(self.modbus)
        self.slave = FcSlave(self.drive, model or (lambda telegram: None))

    async def boot(self) -> CardBench:
        """Powers up and waits until the firmware polls for requests."""
        await self.bench.start(reset_clocks=8)
        await self._firmware_ready()
        return self

    async def _firmware_ready(self) -> None:
        """Waits for the firmware to start, at most as long as BOOT-1 allows at this clock."""
        limit_ps = round(boot_clocks() * self.bench.period_ps)
        if hasattr(self.dut, "mailbox_i"):
            await with_timeout(firmware_polls(self.dut), limit_ps, "ps")
        else:
            # A netlist has no readable internals; the first round of the poll loop lights an LED (LED-1).
            await with_timeout(RisingEdge(self.dut.led_drive_red), limit_ps, "ps")
        # After this wait both lines have been silent for long enough at any rate that the benches use.
        await Timer(4 * MS, unit="ps")

    def told(self) -> list[tuple[bytes, bool]]:
        """Each telegram, and whether the drive replied: for told.not_told (SAFE-8)."""
        return [(heard.telegram, heard.reply is not None) for heard in self.slave.heard]

    def check_lines(self) -> None:
        """Checks DE on both lines, as after any scenario."""
        self.modbus.check_direction()
        self.drive.check_direction()
