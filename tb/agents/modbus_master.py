# SPDX-License-Identifier: Apache-2.0
"""A Modbus RTU master on a simulated line: sends an ADU, waits for the reply, measures the turnaround."""

from __future__ import annotations

from dataclasses import dataclass

from . import rtu
from .crc16 import with_crc
from .rs485 import Rs485Line
from .uart import Flaws, Frame, Sent, sleep_until


@dataclass(frozen=True)
class Transaction:
    """A request as sent, and the reply; None if none came in time."""

    sent: Sent
    reply: Frame | None
    bit_ps: float

    @property
    def data(self) -> bytes | None:
        return None if self.reply is None else self.reply.data

    @property
    def gap_bits(self) -> float:
        """Bits from the request's last stop bit to the reply's first start bit."""
        assert self.reply is not None
        return (self.reply.start_ps - self.sent.end_ps) / self.bit_ps


class ModbusMaster:
    """Sends on `line`, with a pause of t3.5 before each request."""

    def __init__(self, line: Rs485Line):
        self.line = line
        self.pause_ps = 1.05 * rtu.t35_ps(line.fmt.baud)
        self._free_ps = 0.0

    async def request(self, adu: bytes, timeout_ps: float, flaws: Flaws | None = None) -> Transaction:
        """Sends an ADU with its CRC, and waits `timeout_ps` for the start of a reply."""
        sent = await self.send(adu, flaws)
        reply = await self.line.monitor.frame(timeout_ps)
        if reply is not None:
            self._free_ps = reply.end_ps + self.pause_ps
        return Transaction(sent, reply, self.line.fmt.bit_ps)

    async def send(self, adu: bytes, flaws: Flaws | None = None) -> Sent:
        """Sends an ADU without waiting for a reply."""
        await sleep_until(self._free_ps)
        self.line.monitor.forget()
        sent = await self.line.source.send(adu, flaws)
        self._free_ps = sent.end_ps + self.pause_ps
        return sent

    async def ask(self, address: int, pdu: bytes, timeout_ps: float) -> bytes | None:
        """Sends a PDU and returns the PDU of the reply; checks its address and CRC."""
        reply = (await self.request(with_crc(bytes([address]) + pdu), timeout_ps)).reply
        if reply is None:
            return None
        assert reply.ok, f"reply with bad characters: {reply}"
        adu = rtu.parse(reply.data)
        assert adu.address == address, f"reply from {adu.address}"
        return adu.pdu
