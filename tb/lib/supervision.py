# SPDX-License-Identifier: Apache-2.0
"""A card whose firmware a test stops, damages and restores, with a drive that follows a script."""

from __future__ import annotations

import struct
from collections import deque
from pathlib import Path

from regs.generated.mailbox import AREAS, FRAMES_BYTES
from rtl.sources import ROOT, configuration
from sw.tools.bin2hex import LANE_BITS, WORD_BITS, hex_line, with_parity
from sw.tools.seal import SUMS
from sw.tools.stack import symbols
from tb.agents import rtu
from tb.agents.fc_slave import Script
from tb.agents.uart import Frame
from tb.lib.card import MS
from tb.lib.fast_card import FastCard
from tb.lib.runner import firmware
from tb.model import fc_telegram

BITE_MS = 100  # WDG-1
STATUS, FREQUENCY = 0x0607, 0x0000
JUMP_TO_ITSELF = 0x0000006F
WHOLE_WORDS = 512  # a bank of the memory with more words than this is four byte lanes (rtl/firmware_ram.v)
BITE_STEP = 256  # clocks; a restarted program takes longer to reach main()


def firmware_words(config: str = "standard") -> list[int]:
    """The firmware image with its parity, without the empty memory after it."""
    words = [int(line, 16) for line in firmware(config).read_text().split()]
    while not words[-1]:
        words.pop()
    return words


def constant_word(config: str) -> int:
    """Index of the last word before the checksums: a constant, never executed."""
    return len(firmware_words(config)) - SUMS.size // struct.calcsize("<I") - 1


def function_words(config: str, name: str) -> range:
    """The words of a function of the image."""
    of_card = symbols((ROOT / configuration(config)["firmware_hex"]).with_suffix(".elf"))
    begin = next(address for symbol, address in of_card.items() if symbol.split(".")[0] == name)
    return range(begin // 4, min(address for address in of_card.values() if address > begin) // 4)


def write_image(folder: Path, words: list[int]) -> str:
    """An image for FastCard's `dialect`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "firmware.hex").write_text("".join(map(hex_line, words)))
    return str(folder)


def process(control: int, reference: int) -> tuple[bytes, bytes]:
    """Telegram and reply of an exchange of process data."""
    return fc_telegram.build_process(control, reference), fc_telegram.build_process(STATUS, FREQUENCY)


def control_pdu(control: int, reference: int) -> bytes:
    """PDU that writes coils 1 to 32."""
    return rtu.write_coils(0, [bool((control | reference << 16) >> i & 1) for i in range(32)])


class WatchedCard(FastCard):
    """A card with a drive that follows a script, and a program that can be damaged."""

    def __init__(self, config: str, **settings):
        self.script = Script()
        self.late_bits: deque[float] = deque()  # from each of the next telegrams to the reply
        super().__init__(config=config, form="8N2", drive=self._follow, extra="flips", **settings)
        self.address = settings.get("address", 1)
        self._image = [int(line, 16) for line in firmware(config).read_text().split()]
        self._broken: dict[int, int] = {}
        self._loop = function_words(config, "main")
        self._card.watch(self.variables["supervisor_i.restarting"])

    def boot(self) -> WatchedCard:
        self.run(self.boot_ms)
        return self

    # ------------------------------------------------------------ both lines

    def _follow(self, telegram: bytes) -> bytes | None:
        usual = self.reply_bits
        if self.late_bits:
            self.reply_bits = self.late_bits.popleft()
        reply = self.script(telegram)
        if reply is not None:
            self.drive.send(reply, self.reply_bits * self.drive.fmt.bit_ps)
        self.reply_bits = usual

    def ask(self, pdu: bytes, expected: bytes | None = None, exchanges=(), timeout_ms: float = 400) -> Frame:
        """Sends a PDU; checks the exchanges (telegram, reply) that follow, and the reply (default: echo)."""
        for telegram, reply in exchanges:
            self.script.expect(telegram, reply)
        found = self.request(rtu.build(self.address, pdu), timeout_ms)
        self.script.check()
        wanted = rtu.build(self.address, pdu if expected is None else expected)
        assert found and found.data == wanted, f"{pdu.hex(' ')}: {found} instead of {wanted.hex(' ')}"
        return found

    def write_control(self, control: int, reference: int) -> Frame:
        pdu = control_pdu(control, reference)
        return self.ask(pdu, pdu[:5], [process(control, reference)])

    def check_alive(self) -> Frame:
        """The card answers a local request, with all images 0 as after a start (MAP-4)."""
        return self.ask(rtu.read_coils(0, 128), bytes([1, 16]) + bytes(16))

    def check_restarted(self, begin_ps: float) -> None:
        """The first request that ends with the time of BOOT-1 is answered, and nothing was sent before."""
        sent = self.sent()
        length = len(rtu.build(1, rtu.read_coils(0, 128))) * self.modbus.fmt.character_ps
        self.run_until(begin_ps + self.boot_ms * MS - length)
        assert self.sent() == sent, "nothing is sent unasked"
        self.check_alive()

    def sent(self) -> tuple[int, int]:
        """How often DE rose on each line."""
        return len(self.modbus.de[::2]), len(self.drive.de[::2])

    def quiet(self, ms: float, what: str) -> None:
        """Waits; the card sends nothing."""
        before = self.sent()
        self.run(ms)
        assert self.sent() == before, f"DE rose after {what}"

    def check_lines(self) -> None:
        """Everything sent is a whole frame, and a correct one."""
        for line, parse in ((self.modbus, rtu.parse), (self.drive, fc_telegram.parse)):
            line.check()
            for frame in line.frames():
                parse(frame.data)

    @property
    def fault(self) -> bool:
        """Red on both LEDs (LED-5): outside of flashes only a failed loop-back test shows this, too."""
        return self.led("modbus") == self.led("drive") == "red"

    def until_fault(self, limit_ps: float, what: str) -> None:
        """Both LEDs turn red, and stay so while a master starts the motor by address and by broadcast."""
        number = 0
        while not self.fault:
            assert self.now_ps < limit_ps, f"no fault, {what}"
            number += 1
            end = self.modbus.send(rtu.build(number % 2, control_pdu(0x047C, 0x1999)), 3 * MS)
            self.run_until(end)
        shown = {led: len(history) for led, history in self.shown.items()}
        sent = self.sent()
        for to in (1, 0, 1):
            self.run_until(self.modbus.send(rtu.build(to, control_pdu(0x047C, 0x1999)), 3 * MS) + 4 * MS)
        assert {led: len(history) for led, history in self.shown.items()} == shown, f"flashes, {what}"
        assert self.sent() == sent, f"a telegram or a reply after the fault, {what}"

    # ------------------------------------------------------------ the program

    def flip_word(self, word: int, bits: int) -> None:
        """Flips bits of a word of the memory, as it is stored (rtl/ram_bank.v)."""
        parts = [name for name in self.variables if name.endswith("g_part.bank_i.words")]
        size = len(self._image)
        lanes = (size & -size) > WHOLE_WORDS
        for bit in range(WORD_BITS):
            if bits >> bit & 1:
                number = bit // LANE_BITS if lanes else word * len(parts) // size
                self.flip(f"ram_i.g_bank[{number}].g_part.bank_i.words", word, bit)

    def flip_in_frame(self, area: str, byte: int, bit: int) -> None:
        """Flips a bit of a byte that waits in the frame memory to be sent; bit 8 is its parity."""
        self.flip_word(len(self._image) - FRAMES_BYTES // 4 + AREAS[area].slot + byte, 1 << bit)

    def damage(self, word: int, *bits: int) -> None:
        """Flips bits of a word until `restore()`. Parity finds one; two of a byte only the checksums find."""
        self._break(word, sum(1 << bit for bit in bits))

    def stop(self, instruction: int = JUMP_TO_ITSELF) -> None:
        """The loop of the program becomes this instruction."""
        for word in self._loop:
            self._break(word, self._image[word] ^ with_parity(instruction))

    def _break(self, word: int, bits: int) -> None:
        self.flip_word(word, bits)
        self._broken[word] = self._broken.get(word, 0) ^ bits

    def restore(self) -> None:
        for word, bits in self._broken.items():
            self.flip_word(word, bits)
        self._broken.clear()

    def bite(self, limit_ms: float = BITE_MS) -> int:
        """Runs until the watchdog bites; returns the time."""
        before, limit = self._card.watched(), self.now_ps + limit_ms * MS
        while self._card.watched() == before:
            assert self.now_ps < limit, "no bite"
            self.run_until(self.now_ps + BITE_STEP * self.period_ps)
        return self.now_ps

    def bite_now(self) -> int:
        """Makes the watchdog bite as if the program had not kicked it for long enough; returns the time."""
        before = self._card.watched()
        while self._card.watched() == before:
            # Each round of the program sets the count to 0, and it is 1 for some of the time.
            for bit in (0, 1):
                self.flip("supervisor_i.idle_beats", 0, bit)
            self.run_until(self.now_ps + BITE_STEP * self.period_ps)
        return self.now_ps
