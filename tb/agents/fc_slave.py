# SPDX-License-Identifier: Apache-2.0
"""A drive on a simulated line: receives telegrams, answers through a model, injects faults on request.

The model is any function from a telegram to a reply or None: `VltDrive().telegram`, or a `Script` of pairs.
`Manner` sets delay, gaps and fault of one reply. Times are in ps, gaps in bits. Rules: FC-1, FC-8.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cocotb

from .rs485 import Rs485Line
from .uart import Flaws, Frame, Sent, sleep_until, with_gaps

STX = 0x02
CHARACTER_BITS = 11


@dataclass(frozen=True)
class Manner:
    """Timing and fault of one reply.

    delay_bits      from the telegram's last stop bit to the reply's first start bit; at least 2 characters
    gap_bits        idle time between the reply's characters
    """

    delay_bits: float = 2.1 * CHARACTER_BITS
    gap_bits: float = 0.0
    fault: str | None = None


def _with_bcc(reply: bytes, at: int, value: int) -> bytes:
    """With another byte, and a BCC that fits."""
    bcc = reply[-1] ^ reply[at] ^ value
    return reply[:at] + bytes([value]) + reply[at + 1 : -1] + bytes([bcc])


# What is sent instead of a good reply.
FAULTS: dict[str, Callable[[bytes], tuple[bytes, Flaws]]] = {
    "silence": lambda reply: (b"", Flaws()),
    "bad BCC": lambda reply: (reply[:-1] + bytes([reply[-1] ^ 0x10]), Flaws()),
    "bad STX": lambda reply: (_with_bcc(reply, 0, 0x03), Flaws()),
    "wrong ADR": lambda reply: (_with_bcc(reply, 2, reply[2] ^ 0x03), Flaws()),
    "wrong LGE": lambda reply: (_with_bcc(reply, 1, reply[1] + 1), Flaws()),
    "parity error": lambda reply: (reply, Flaws(bad_parity=(len(reply) // 2,))),
    "framing error": lambda reply: (reply, Flaws(bad_stop=(len(reply) // 2,))),
    # A phantom character, as after a line turnaround; the reply itself is correct.
    "garbage before": lambda reply: (b"\x00" + reply, Flaws()),
    "cut short": lambda reply: (reply[:-3], Flaws()),
    # Every gap is legal; the whole takes longer than 1.5 times its nominal time.
    "slow": lambda reply: (reply, with_gaps(len(reply), 0.65 * CHARACTER_BITS)),
    "long gap": lambda reply: (reply, Flaws(gaps={len(reply) // 2: 2.5 * CHARACTER_BITS})),
}


@dataclass(frozen=True)
class HeardTelegram:
    """One telegram of the card, and the time of the reply (None: no reply)."""

    frame: Frame
    reply: bytes | None
    reply_sent: Sent | None

    @property
    def telegram(self) -> bytes:
        return self.frame.data


class Script:
    """Expected telegrams in order, each with its reply or None; any other telegram is an error."""

    def __init__(self, pairs: Iterable[tuple[bytes, bytes | None]] = ()):
        self.left = deque(pairs)
        self.errors: list[str] = []

    def expect(self, telegram: bytes, reply: bytes | None) -> None:
        self.left.append((telegram, reply))

    def __call__(self, telegram: bytes) -> bytes | None:
        if not self.left:
            self.errors.append(f"unexpected telegram {telegram.hex(' ')}")
            return None
        expected, reply = self.left.popleft()
        if telegram != expected:
            self.errors.append(f"telegram {telegram.hex(' ')} instead of {expected.hex(' ')}")
        return reply

    def check(self) -> None:
        """Checks that exactly the expected telegrams were sent."""
        assert not self.errors, "; ".join(self.errors)
        assert not self.left, f"never sent: {self.left[0][0].hex(' ')}"


class FcSlave:
    """Answers on `line`; `heard` records every telegram."""

    def __init__(self, line: Rs485Line, model: Callable[[bytes], bytes | None], manner: Manner | None = None):
        self.line = line
        self.model = model
        self.manner = manner or Manner()
        self.heard: list[HeardTelegram] = []
        self._next: deque[Manner] = deque()
        self._task = cocotb.start_soon(self._serve())

    def next(self, *manners: Manner) -> None:
        """Sets one manner for each of the next telegrams; after them `manner` applies again."""
        self._next.extend(manners)

    async def _serve(self) -> None:
        while True:
            frame = await self._telegram()
            await self._answer(frame)

    async def _telegram(self) -> Frame:
        """Receives LGE + 2 characters; a gap of 2 characters ends the telegram early."""
        monitor = self.line.monitor
        limit = (2 * CHARACTER_BITS + monitor.fmt.bits) * monitor.fmt.bit_ps
        characters = [await monitor.character()]
        while len(characters) < 2 or len(characters) < characters[1].byte + 2:
            got = await monitor.character(limit)
            if got is None:
                break
            characters.append(got)
        return Frame(tuple(characters))

    async def _answer(self, frame: Frame) -> None:
        manner = self._next.popleft() if self._next else self.manner
        reply = self.model(frame.data) if frame.ok else None
        sent = None
        if reply is not None:
            data, flaws = (reply, Flaws())
            if manner.fault:
                data, flaws = FAULTS[manner.fault](reply)
            if manner.gap_bits:
                flaws = with_gaps(len(data), manner.gap_bits)
            if data:
                await sleep_until(frame.end_ps + manner.delay_bits * self.line.fmt.bit_ps)
                sent = await self.line.source.send(data, flaws)
            reply = data or None
        self.heard.append(HeardTelegram(frame, reply, sent))
