# SPDX-License-Identifier: Apache-2.0
"""The frame memory as a module under test sees it: one side writes, one reads, each held until ready.

Both act on the module's own valid only, so a quiet module costs nothing. `delay` gives the clocks that an
access has to wait, anew for each. A valid that falls before ready has asked for nothing. Read data is there
one clock after ready, and only then.
"""

from __future__ import annotations

from collections.abc import Callable

import cocotb
from cocotb.triggers import ReadOnly, RisingEdge

from tb.lib.bench import Bench


def at_once() -> int:
    return 0


class WritePort:
    """Takes <prefix>write_valid/_ready/_addr with the data signal `data`.

    `written` is every access in its order, `memory` what stands there in the end.
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
            await ReadOnly()  # it may fall again in the same moment
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
    """Answers <prefix>read_valid/_ready/_addr/_data from `memory`; `reads` is every address in its order."""

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
            await ReadOnly()  # it may fall again in the same moment
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
        self._data.value = byte ^ 0xFF  # somebody else's by now
