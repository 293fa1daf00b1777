# SPDX-License-Identifier: Apache-2.0
"""Makes the recordings of the debugging guide, and the command outputs in the guide.

    python -m tools.symptoms [NAME ...]

Each recording is a run of the whole card with its firmware (tb/lib/fast_card.py), the simulated drive and a
master that does one thing wrong. The pins are sampled bit by bit for the recorder of the virtual card, which
writes docs/recordings/NAME.jsonl and NAME.pcapng. Then the blocks of GUIDES that begin with a command are
filled with its output. The same sources give the same files. Times are in ps since power-up. Exit code 2 for
an unknown name.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from rtl.command import Parser, run_main
from rtl.sources import ROOT
from tb.agents import rtu
from tb.agents.edges import Trace
from tb.agents.uart import Character, Flaws, Format, waveform
from tb.lib.card import MS
from tb.lib.fast_card import SHOWN_SEED, FastCard
from tb.lib.recording import DRIVE, LED_LOOK_MS, MODBUS, Recorder
from tb.model.vlt_drive import VltDrive

RECORDINGS = ROOT / "docs/recordings"
GUIDE = ROOT / "docs/guide/debugging.md"
GUIDES = (GUIDE, ROOT / "docs/guide/recordings.md")
COMMAND = re.compile(
    r"^```\n\$ \.venv/bin/python"
    r" (-m (?:sw\.rtu2fc decode docs/recordings|sim\.view\.replay tb/captures)/.*)\n"
    r"(?:.*\n)*?```$",
    re.MULTILINE,
)

BOOTED_MS = 25.0
PAUSE_MS = 20.0  # silence of a correct master before a request
PS_PER_US = 1_000_000
# Register addresses on the wire; the reference numbers are one higher.
ENERGY = 10 * 514 - 1
MAX_REFERENCE = 10 * 205 - 1
RUN_TIME_OUT = 1
START_40 = rtu.build(1, bytes.fromhex("0F 00 00 00 20 04 7C 04 99 19"))
READ_STATUS = rtu.build(1, rtu.read_coils(32, 16))
READ_STATE = rtu.build(1, rtu.read_coils(32, 32))
READ_CONTROL = rtu.build(1, rtu.read_coils(0, 32))
READ_ENERGY = rtu.build(1, rtu.read_registers(ENERGY, 2))


class Bus(FastCard):
    """The card after its start, a drive in the card's time, and a master that may break the rules."""

    def __init__(self, example: bool = True, **options) -> None:
        self.vlt = VltDrive(example=example)
        self.drive_spoils: Callable[[bytes], bytes | None] = lambda reply: reply
        self._lived_us = 0
        self._said_ps = 0.0
        super().__init__(drive=self._drive, seed=SHOWN_SEED, **options)
        self.run(BOOTED_MS)

    def _drive(self, telegram: bytes) -> bytes | None:
        now_us = self.now_ps // PS_PER_US
        self.vlt.step(now_us - self._lived_us)
        self._lived_us = now_us
        reply = self.vlt.telegram(telegram)
        return reply and self.drive_spoils(reply)

    def say(
        self, data: bytes, pause_ms: float = PAUSE_MS, fmt: Format | None = None, flaws: Flaws | None = None
    ) -> float:
        """Sends on the network line, `pause_ms` after the last traffic there; returns the end."""
        edges, length = waveform(fmt or self.modbus.fmt, data, flaws or Flaws())
        quiet = max(self._said_ps, self.modbus.de[-1][0] if self.modbus.de else 0)
        start = max(self.now_ps, quiet + pause_ms * MS)
        for at, level in edges:
            self.plan(start + at, "modbus_line", level)
        self._said_ps = start + length
        return self._said_ps

    def ask(self, adu: bytes, pause_ms: float = PAUSE_MS, wait_ms: float = 60.0, **how) -> bool:
        """Sends a request; waits for the reply's last bit, or `wait_ms`. True: there was a reply."""
        limit = self.say(adu, pause_ms, **how) + wait_ms * MS
        before = len(self.modbus.de)
        while self.run_until(limit, "modbus_de"):
            if len(self.modbus.de) == before + 2:
                return True
        return False

    def characters(self, ms: float) -> float:
        """Number of network characters in `ms`."""
        return ms * rtu.CHARACTER_BITS * rtu.bit_ps(self.modbus.fmt.baud) / MS


# ---------------------------------------------------------------- from the pins to the files


def heard(edges: list[tuple[int, int]], fmt: Format) -> Iterator[Character]:
    """Characters on a pin, each bit sampled in its middle; a Trace drops those with a short start bit."""
    level_at, free = Trace(fmt, edges).level_at, 0.0
    for start, to in edges:
        if to or start < free:
            continue
        bits = [level_at(start + (i + 0.5) * fmt.bit_ps) for i in range(fmt.bits)]
        byte = sum(bits[1 + i] << i for i in range(8))
        parity_ok = not fmt.parity_bits or bits[9] == fmt.parity_bit(byte)
        end = round(start + fmt.character_ps)
        yield Character(byte, start, end, parity_ok, bool(bits[9 + fmt.parity_bits]))
        free = end - fmt.bit_ps / 2


def record(card: FastCard, base: Path) -> None:
    """Writes everything on the pins until now as log and capture."""
    events: list[tuple[int, Callable[[], None]]] = []
    with Recorder(base) as recorder:
        for line, port in ((MODBUS, card.modbus), (DRIVE, card.drive)):
            recorder.use(line, port.fmt)
            for from_card, pin in ((False, "rx"), (True, "tx")):
                for c in heard(card.recorded[f"{port.name}_{pin}"], port.fmt):
                    events.append((c.end_ps, partial(recorder.character, line, from_card, c)))
        for led, name in ((MODBUS, "modbus"), (DRIVE, "drive")):
            since = [one.since_ps for one in card.shown[name]]
            samples = {*since, *range(0, card.now_ps, LED_LOOK_MS * MS)}
            for at in samples:
                shows = card.shown[name][bisect_right(since, at) - 1].colour
                red, green = shows in ("red", "orange"), shows in ("green", "orange")
                events.append((at, partial(recorder.led, led, red, green, at)))
        for _, report in sorted(events, key=lambda event: event[0]):
            report()


# ---------------------------------------------------------------- the symptoms


SYMPTOMS: dict[str, Callable[[], Bus]] = {}


def symptom(**options: object) -> Callable:
    """What happens on a card with these options; its name is that of the function."""

    def add(happens: Callable[[Bus], None]) -> Callable[[Bus], None]:
        def run() -> Bus:
            card = Bus(**options)
            happens(card)
            return card

        SYMPTOMS[happens.__name__.replace("_", "-")] = run
        return happens

    return add


@symptom()
def no_answer(card: Bus) -> None:
    """Another unit's request, a wrong rate, a wrong parity, a request to all; then a correct request."""
    card.ask(rtu.build(2, READ_ENERGY[1:-2]))
    card.ask(READ_ENERGY, fmt=Format.named(19200, "8E1"))
    card.ask(READ_ENERGY, fmt=Format.named(9600, "8N1"))
    card.ask(rtu.build(0, READ_ENERGY[1:-2]))
    card.ask(READ_ENERGY)


@symptom()
def crc_errors(card: Bus) -> None:
    """CRC bytes in the wrong order, two flipped bits, one flipped bit; then a correct request."""
    card.ask(READ_ENERGY[:-2] + READ_ENERGY[:-3:-1])
    turned = bytearray(READ_ENERGY)
    turned[3] ^= 0x24
    card.ask(bytes(turned))
    third_byte_bit_4 = 2 * card.modbus.fmt.bits + 1 + 4
    card.ask(READ_ENERGY, flaws=Flaws(glitches=[(third_byte_bit_4, 1.0)]))
    card.ask(READ_ENERGY)


@symptom()
def answers_sometimes(card: Bus) -> None:
    """Polls that are too early, after another unit's traffic, or followed by a stray character."""
    card.ask(READ_CONTROL)
    card.ask(READ_CONTROL, pause_ms=card.characters(2.0))
    card.ask(READ_CONTROL)
    card.say(rtu.build(2, bytes.fromhex("03 00 00 00 01")))
    card.say(rtu.build(2, bytes.fromhex("03 02 00 2A")), pause_ms=5.0)
    card.ask(READ_CONTROL, pause_ms=card.characters(2.0))
    card.say(READ_CONTROL)
    card.ask(b"\x00", pause_ms=card.characters(2.0))
    card.ask(READ_CONTROL)


@symptom()
def exception_255(card: Bus) -> None:
    """A silent drive, a drive with damaged replies, and a drive that answers."""
    card.run_until(2300 * MS)  # after the LEDs' power-up sequence
    card.drive_spoils = lambda reply: None
    card.ask(READ_ENERGY, wait_ms=500)
    card.drive_spoils = lambda reply: reply[:-1] + bytes([reply[-1] ^ 0x10])
    card.ask(READ_ENERGY, wait_ms=500)
    card.drive_spoils = lambda reply: reply
    card.ask(READ_ENERGY)
    card.run(1200)


@symptom(example=False)
def no_start(card: Bus) -> None:
    """Start by coil 7 alone, which leaves bit 10 at 0; then by the whole control word."""
    card.ask(rtu.build(1, rtu.write_coil(6, True)))
    card.ask(READ_STATUS)
    card.ask(START_40)
    card.run(1500)
    card.ask(START_40)
    card.ask(READ_STATUS)


@symptom(example=False)
def off_by_one(card: Bus) -> None:
    """A reference number on the wire instead of the address: a register, then coils."""
    card.ask(rtu.build(1, rtu.read_registers(ENERGY + 1, 2)))
    card.ask(READ_ENERGY)
    for first in ("0001", "0000"):
        card.ask(rtu.build(1, bytes.fromhex(f"0F {first} 0010 02 7C04")))


@symptom(baud=19200, example=False)
def usb_adapter(card: Bus) -> None:
    """Requests in two pieces: with a short silence, with a long silence, and at a higher rate."""
    for gap_ms in (0.5, 1.0, 16.0):
        bits = gap_ms * MS / card.modbus.fmt.bit_ps
        card.ask(START_40, flaws=Flaws(gaps={8: bits}))
    card.ask(START_40)


@symptom()
def rtu_over_tcp(card: Bus) -> None:
    """A gateway that cuts a frame, then one that sends the next request right after the reply."""
    card.ask(START_40, flaws=Flaws(gaps={8: 8 * MS / card.modbus.fmt.bit_ps}))
    card.ask(READ_CONTROL)
    card.ask(READ_CONTROL, pause_ms=1.0)
    card.ask(READ_CONTROL)


@symptom()
def fast_reply(card: Bus) -> None:
    """Correct requests and replies: a master with a slow driver misses what is on the line."""
    card.ask(READ_CONTROL)
    card.ask(READ_CONTROL)


@symptom(dialect="delay20")
def delayed_reply(card: Bus) -> None:
    """The same with the option that delays each reply."""
    fast_reply(card)


@symptom()
def own_echo(card: Bus) -> None:
    """A write to a unit that is not there, whose echo looks like its reply; then the right unit."""
    card.ask(rtu.build(2, rtu.write_register(RUN_TIME_OUT, 500)))
    card.ask(rtu.build(1, rtu.write_register(RUN_TIME_OUT, 500)))


@symptom(example=False)
def old_values(card: Bus) -> None:
    """A master that reads only coils after a start, and then a parameter."""
    card.ask(START_40)
    card.run(1500)
    card.ask(READ_STATE)
    card.run(1500)
    card.ask(READ_STATE)
    card.ask(READ_ENERGY)
    card.ask(READ_STATE)


@symptom(example=False)
def word_order(card: Bus) -> None:
    """A value of 32 bits, written with its words exchanged, and then in order."""
    card.ask(rtu.build(1, rtu.read_registers(MAX_REFERENCE, 2)))
    for words in ([40_000, 0], [0, 40_000]):
        card.ask(rtu.build(1, rtu.write_registers(MAX_REFERENCE, words)))


@symptom()
def merged_reads(card: Bus) -> None:
    """One request for two parameters, one for all registers between, then a request for each parameter."""
    card.ask(rtu.build(1, rtu.read_registers(ENERGY, 12)))
    card.ask(rtu.build(1, rtu.read_registers(ENERGY, 4)))
    card.ask(READ_ENERGY)
    card.ask(rtu.build(1, rtu.read_registers(ENERGY + 10, 2)))


@symptom()
def led_states(card: Bus) -> None:
    """Power-up, a master, a drive, the drive lost, the drive back, the master lost."""
    card.ask(rtu.build(1, rtu.write_register(RUN_TIME_OUT, 100)))  # network LED: 1 s
    card.run_until(3300 * MS)
    card.ask(READ_CONTROL)
    card.run_until(4800 * MS)
    card.ask(READ_ENERGY)
    card.run_until(6500 * MS)
    card.drive_spoils = lambda reply: None
    card.ask(READ_ENERGY, wait_ms=500)
    card.run_until(8300 * MS)


@symptom(address=0)
def led_fault(card: Bus) -> None:
    """All address switches off: address 0 is invalid."""
    card.ask(READ_CONTROL)
    card.run(1500)


@symptom()
def no_bias(card: Bus) -> None:
    """The line falls to 0 as soon as the master lets go of it, twice; then it stays at 1."""
    for _ in range(2):
        end = card.say(READ_CONTROL)
        card.plan(end, "modbus_line", 0)
        card.plan(end + 40 * MS, "modbus_line", 1)
        card.run_until(end + 60 * MS)
    card.ask(READ_CONTROL)


def make(name: str, folder: Path = RECORDINGS) -> Path:
    """Runs a symptom and records it; returns the log."""
    folder.mkdir(parents=True, exist_ok=True)
    with SYMPTOMS[name]() as card:
        record(card, folder / name)
    return folder / f"{name}.jsonl"


def with_outputs(guide: str) -> str:
    """The guide with the present output of its commands."""

    def printed(match: re.Match[str]) -> str:
        words = shlex.split(match[1])
        done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=True)
        return f"```\n$ .venv/bin/python {match[1]}\n{done.stdout}```"

    return COMMAND.sub(printed, guide)


def main() -> int:
    parser = Parser(prog="symptoms", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(SYMPTOMS)} (default: all)")
    args = parser.parse_args()
    if unknown := [name for name in args.names if name not in SYMPTOMS]:
        parser.error(f"no symptom '{unknown[0]}'; there are {', '.join(SYMPTOMS)}")
    for name in args.names or SYMPTOMS:
        print(make(name).relative_to(ROOT))
    for guide in GUIDES:
        guide.write_text(with_outputs(guide.read_text()))
    return 0


if __name__ == "__main__":
    run_main("symptoms", main)
