# SPDX-License-Identifier: Apache-2.0
"""Helpers for the tests of power-up, LEDs, watchdog and loop-back.

`Leds` follows both LEDs of a simulated card. `Firmware` stops, damages and restores the running program.
`WatchedCard` has both and checks every frame sent. Times are in ps, as in the simulators.
Rules: LED-1 ... LED-5, WDG-1.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from itertools import pairwise

import cocotb
from cocotb.triggers import (
    Event,
    FallingEdge,
    ReadOnly,
    RisingEdge,
    SimTimeoutError,
    Timer,
    ValueChange,
    with_timeout,
)

from sw.tools.bin2hex import LANE_BITS, WORD_BITS, with_parity
from sw.tools.seal import SUMS
from tb.agents import rtu
from tb.agents.fc_slave import Script
from tb.agents.rs485 import Rs485Line
from tb.agents.uart import Frame, now_ps
from tb.lib.card import MS, CardBench, firmware_polls
from tb.lib.config import CLK_HZ, CONFIG, TRAPS, boot_clocks
from tb.lib.runner import firmware
from tb.model import fc_telegram

COLOURS = {(0, 0): "off", (1, 0): "red", (0, 1): "green", (1, 1): "orange"}
LEDS = ("modbus", "drive")
BITE_PS = 100 * MS  # WDG-1
# Longer than any start at any clock; a card that takes longer is dead.
ROUND_LIMIT_PS = 400 * MS
FETCH_LIMIT_CLOCKS = 1000
STATUS, FREQUENCY = 0x0607, 0x0000
JUMP_TO_ITSELF = 0x0000006F
ILLEGAL = 0x00000000
IDLE_BEATS = 3  # supervisor_i.idle_beats at which the watchdog bites
WHOLE_WORDS = 512  # a bank of the memory with more words than this is four byte lanes (rtl/firmware_ram.v)


def colour(red: int, green: int) -> str:
    """Colour of a two-colour LED."""
    return COLOURS[red, green]


@dataclass(frozen=True)
class Shown:
    """A LED colour and its start."""

    since_ps: int
    colour: str


def steps_ms(history: list[Shown]) -> list[tuple[str, float]]:
    """Each colour with its duration in ms, without the last one, which still lasts."""
    return [(now.colour, (then.since_ps - now.since_ps) / MS) for now, then in pairwise(history)]


async def within(limit_ps: float, trigger, what: str) -> None:
    """Waits for `trigger`; fails after `limit_ps`."""
    try:
        await with_timeout(trigger, max(1, round(limit_ps)), "ps")
    except SimTimeoutError:
        raise AssertionError(f"{what}: did not happen within {limit_ps / MS:.1f} ms") from None


class Leds:
    """History of both LEDs."""

    def __init__(self, dut):
        self.shown: dict[str, list[Shown]] = {led: [] for led in LEDS}
        self._changed = Event()
        self._pins = {led: (getattr(dut, f"led_{led}_red"), getattr(dut, f"led_{led}_green")) for led in LEDS}
        for led, pins in self._pins.items():
            for pin in pins:
                cocotb.start_soon(self._watch(led, pin))

    async def _watch(self, led: str, pin) -> None:
        while True:
            await ValueChange(pin)
            await ReadOnly()
            self._note(led)

    def _note(self, led: str) -> None:
        now = colour(*(1 if str(pin.value) == "1" else 0 for pin in self._pins[led]))
        history = self.shown[led]
        if not history or history[-1].colour != now:
            history.append(Shown(now_ps(), now))
            self._changed.set()

    def show(self, led: str) -> str:
        """The present colour of a LED."""
        return self.shown[led][-1].colour if self.shown[led] else "off"

    @property
    def fault(self) -> bool:
        """Solid red on both LEDs (LED-5): only a failed loop-back test shows this."""
        return all(self.show(led) == "red" for led in LEDS)

    def forget(self) -> None:
        """Clears the history up to the present colour."""
        for history in self.shown.values():
            del history[:-1]

    async def until(self, condition, limit_ps: float, what: str) -> None:
        """Waits for a change after which `condition` holds."""
        end = now_ps() + limit_ps
        while not condition():
            self._changed.clear()
            await within(end - now_ps(), self._changed.wait(), what)
        await Timer(1, unit="ps")  # leave the read-only phase, so that the caller may drive signals


def firmware_words(config: str = CONFIG) -> list[int]:
    """The firmware image with its parity, without the empty memory after it."""
    words = [int(line, 16) for line in firmware(config).read_text().split()]
    while not words[-1]:
        words.pop()
    return words


def constant_word(config: str = CONFIG) -> int:
    """Index of the last word before the checksums: a constant, never executed."""
    return len(firmware_words(config)) - SUMS.size // struct.calcsize("<I") - 1


class MemoryWord:
    """A word of the card's memory, whole in a bank or in four byte lanes (rtl/ram_bank.v)."""

    def __init__(self, parts: list):
        self._parts = parts

    @property
    def value(self) -> int:
        if len(self._parts) == 1:
            return self._parts[0].value.to_unsigned()
        # The other bits of a lane's word mean nothing, and can be X.
        lanes = [
            part.value[LANE_BITS * n + LANE_BITS - 1 : LANE_BITS * n] for n, part in enumerate(self._parts)
        ]
        return sum(lane.to_unsigned() << LANE_BITS * n for n, lane in enumerate(lanes))

    @value.setter
    def value(self, value: int) -> None:
        for part in self._parts:
            part.value = value


def memory_words(dut) -> list[MemoryWord]:
    """The words of the card's memory; each of its parts has an array of all words (rtl/ram_bank.v)."""
    arrays = [dut.ram_i.g_bank[n].g_part.bank_i.words for n in range(len(dut.ram_i.g_bank))]
    size = len(arrays[0])
    lanes = WORD_BITS // LANE_BITS if (size & -size) > WHOLE_WORDS else 1
    banks = [arrays[at : at + lanes] for at in range(0, len(arrays), lanes)]
    return [MemoryWord([array[word] for array in banks[word * len(banks) // size]]) for word in range(size)]


class Firmware:
    """The program in the card's memory: its place in the poll loop, and ways to damage it."""

    def __init__(self, dut):
        self._dut = dut
        self._memory = memory_words(dut)
        self._image = firmware_words()
        self._broken: set[int] = set()
        self.loop = -1  # index of a word of the poll loop that every round executes

    async def round(self) -> None:
        """Waits for the end of the next round of the poll loop, which kicks the watchdog.

        The firmware also kicks the watchdog while it checks the image; those kicks come before the first
        poll for requests.
        """
        await within(ROUND_LIMIT_PS, firmware_polls(self._dut), "a poll for requests")
        await self._strobe(self._dut.supervisor_i.kick, ROUND_LIMIT_PS, "a round of the poll loop")

    async def _strobe(self, signal, limit_ps: float, what: str) -> int:
        """Waits for a clock in which `signal` is stable high, not a spike; returns the start of the pulse."""
        end = now_ps() + limit_ps
        while True:
            await within(end - now_ps(), RisingEdge(signal), what)
            began = now_ps()
            await FallingEdge(self._dut.clk)
            if str(signal.value) == "1":
                return began

    async def find_loop(self) -> None:
        """Finds the first instruction fetched after the kick; it must be the same in two rounds."""
        found = set()
        for _ in range(2):
            await self.round()
            found.add(await self._next_fetch())
        assert len(found) == 1, f"the loop continues in different places: {found}"
        self.loop = found.pop()

    async def _next_fetch(self) -> int:
        dut = self._dut
        for _ in range(FETCH_LIMIT_CLOCKS):
            await FallingEdge(dut.clk)
            if str(dut.core_valid.value) == "1" and dut.core_wstrb.value.to_unsigned() == 0:
                word = dut.core_addr.value.to_unsigned() // 4
                if word < len(self._image):
                    return word
        raise AssertionError("the processor fetches nothing")

    def stop(self, instruction: int = JUMP_TO_ITSELF) -> None:
        """Stops the processor in the poll loop; with ILLEGAL it traps there."""
        self._put(self.loop, with_parity(instruction))

    def damage(self, word: int, *bits: int) -> None:
        """Flips bits of a word. The parity check finds one; two of the same byte only the checksums find."""
        self._put(word, self._image[word] ^ sum(1 << bit for bit in bits))

    def _put(self, word: int, value: int) -> None:
        self._memory[word].value = value
        self._broken.add(word)

    def restore_damaged(self) -> None:
        """Restores the overwritten words."""
        for word in self._broken:
            self._memory[word].value = self._image[word]
        self._broken.clear()

    def restore(self) -> None:
        """Restores the whole image, since a damaged program may have written anywhere."""
        self._broken.update(range(len(self._image)))
        self.restore_damaged()

    async def bite_now(self) -> int:
        """Makes the watchdog bite at once, then restores the firmware; returns the time of the bite."""
        self.stop(ILLEGAL)
        if not TRAPS:
            # As if the firmware had been idle for this long.
            self._dut.supervisor_i.idle_beats.value = IDLE_BEATS
        at = await self.bite()
        self.restore_damaged()
        return at

    async def bite(self, limit_ps: float = BITE_PS) -> int:
        """Waits for the watchdog; returns the time of the bite."""
        return await self._strobe(self._dut.core_rst, limit_ps, "bite")


def process(control: int, reference: int) -> tuple[bytes, bytes]:
    """Telegram and reply of an exchange of process data."""
    return fc_telegram.build_process(control, reference), fc_telegram.build_process(STATUS, FREQUENCY)


def control_pdu(control: int, reference: int) -> bytes:
    """PDU that writes coils 1 to 32."""
    return rtu.write_coils(0, [bool((control | reference << 16) >> i & 1) for i in range(32)])


class WatchedCard(CardBench):
    """A card with LEDs and firmware under observation, and a drive that follows a script."""

    def __init__(self, dut, **settings):
        self.script = Script()
        super().__init__(dut, CLK_HZ, self.script, **settings)
        self.address = settings.get("address", 1)
        self.leds = Leds(dut)
        self.firmware = Firmware(dut)
        self.released_ps = 0

    @property
    def boot_limit_ps(self) -> float:
        """Time limit of BOOT-1 at this clock."""
        return boot_clocks() * self.bench.period_ps

    async def boot(self) -> WatchedCard:
        """Powers up and waits for the first round of the poll loop."""
        await self.switch_on()
        await self.firmware.round()
        return self

    async def switch_on(self) -> None:
        """Powers up, until the release of the reset."""
        await self.bench.start(reset_clocks=8)
        self.released_ps = now_ps()

    async def ask(self, pdu: bytes, expected: bytes | None = None, exchanges=(), timeout_ms: float = 400):
        """Sends a PDU; checks the exchanges (telegram, reply) that follow, and the reply (default: echo)."""
        for telegram, reply in exchanges:
            self.script.expect(telegram, reply)
        done = await self.master.request(rtu.build(self.address, pdu), timeout_ms * MS)
        self.script.check()
        wanted = rtu.build(self.address, pdu if expected is None else expected)
        assert done.data == wanted, f"{pdu.hex(' ')}: {done.reply} instead of {wanted.hex(' ')}"
        return done

    async def write_control(self, control: int, reference: int):
        pdu = control_pdu(control, reference)
        return await self.ask(pdu, pdu[:5], [process(control, reference)])

    async def check_alive(self) -> None:
        """Checks that the card answers a local request, with all images 0 as after a start (MAP-4)."""
        await self.ask(rtu.read_coils(0, 128), bytes([1, 16]) + bytes(16))

    def check_lines(self) -> None:
        """Checks that every DE pulse carries one whole, correct frame, and tx has no edge outside of them."""
        super().check_lines()
        for frame in frames_by_direction(self.modbus):
            assert frame.ok, f"reply with bad characters: {frame}"
            rtu.parse(frame.data)
        for frame in frames_by_direction(self.drive):
            assert frame.ok, f"telegram with bad characters: {frame}"
            fc_telegram.parse(frame.data)


def frames_by_direction(line: Rs485Line) -> list[Frame]:
    """Everything sent, one frame per DE pulse."""
    characters = line.monitor.characters
    spans = [(pulse.rise_ps, pulse.fall_ps or now_ps()) for pulse in line.direction.pulses]
    return [Frame(tuple(c for c in characters if rise <= c.start_ps < fall)) for rise, fall in spans]
