# SPDX-License-Identifier: Apache-2.0
"""Frame memory for a module under test: a write port and a read port, each request held until ready.

Both ports react to the module's valid only, so an idle module costs no simulation time. `delay` gives the
wait in clocks, drawn for each access. A valid that falls before ready makes no access. Read data is valid
only in the clock after ready.
"""

from __future__ import annotations

from collections.abc import Callable

import cocotb
from cocotb.triggers import ReadOnly, RisingEdge

from tb.lib.bench import Bench


def at_once() -> int:
    return 0


class WritePort:
    """Serves <prefix>write_valid/_ready/_addr with the data signal `data`.

    `written` lists every access in order; `memory` maps addresses to their last value.
    """

    def __init__(self, bench: Bench, data: str, delay: Callable[[], int] = at_once, prefix: str = ""):
        dut = bench.dut
        self.written: list[tuple[int, int]] = []
        self._bench, self.delay = bench, delay
        self._valid, self._ready = getattr(dut, f"{prefix}write_valid"), getattr(dut, f"{prefix}write_ready")
        self._addr, self._data = getattr(dut, f"{prefix}write_addr"), getattr(dut, data)
        self._ready.value = 0
        cocotb.start_soon(self._serve())

    @property
    def memory(self) -> dict[int, int]:
        return dict(self.written)

    async def _serve(self) -> None:
        while True:
            await RisingEdge(self._valid)
            await ReadOnly()  # valid may fall again in the same time step
            while str(self._valid.value) == "1":
                await self._access()

    async def _access(self) -> None:
        await self._bench.clocks(1 + self.delay())
        if str(self._valid.value) != "1":
            return
        self._ready.value = 1
        access = self._addr.value.to_unsigned(), self._data.value.to_unsigned()
        await self._bench.clocks()
        self._ready.value = 0
        self.written.append(access)


class ReadPort:
    """Serves <prefix>read_valid/_ready/_addr/_data from `memory`; `reads` lists every address in order."""

    def __init__(
        self, bench: Bench, memory: bytes = b"", delay: Callable[[], int] = at_once, prefix: str = ""
    ):
        dut = bench.dut
        self.memory = memory
        self.reads: list[int] = []
        self._bench, self.delay = bench, delay
        self._valid, self._ready = getattr(dut, f"{prefix}read_valid"), getattr(dut, f"{prefix}read_ready")
        self._addr, self._data = getattr(dut, f"{prefix}read_addr"), getattr(dut, f"{prefix}read_data")
        self._ready.value = self._data.value = 0
        cocotb.start_soon(self._serve())

    async def _serve(self) -> None:
        while True:
            await RisingEdge(self._valid)
            await ReadOnly()  # valid may fall again in the same time step
            while str(self._valid.value) == "1":
                await self._access()

    async def _access(self) -> None:
        await self._bench.clocks(1 + self.delay())
        if str(self._valid.value) != "1":
            return
        self._ready.value = 1
        addr = self._addr.value.to_unsigned()
        self.reads.append(addr)
        await self._bench.clocks()
        self._ready.value = 0
        byte = self.memory[addr] if addr < len(self.memory) else 0xEE
        self._data.value = byte
        await self._bench.clocks()
        self._data.value = byte ^ 0xFF  # the data of another access from here on
