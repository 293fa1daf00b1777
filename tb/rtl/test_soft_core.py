# SPDX-License-Identifier: Apache-2.0
"""soft_core with its memory: runs a small program in machine code; the bench simulates the mailbox.

The program sets a stack pointer, tries bytes, half-words and words of the memory, and copies between mailbox
words. Then it waits for a command to execute an instruction that RV32I does not have. PicoRV32 must trap
there. SERV continues, and a reset, as by the watchdog, must recover it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import RisingEdge

from regs.generated.mailbox import BASE
from rtl.sources import configuration
from sw.tools.bin2hex import hex_line, with_parity
from tb.lib.bench import Bench
from tb.lib.nightly import both
from tb.lib.runner import ROOT, SIMULATORS, run
from tb.lib.seeds import cases, seeded

MEMORY = 1024
WRAPPER = ROOT / "tb/rtl/core_and_memory.v"
# Mailbox words of the program, its commands, and the address of its data.
STACK, BYTES, WORD, SOURCE, TARGET, COMMAND, ALIVE = 0, 1, 5, 8, 9, 16, 17
ILLEGAL, MISALIGNED, MULTIPLY, BREAKPOINT = 1, 2, 3, 4
DATA = 512
X0, MAILBOX, SP, A, B = 0, 1, 2, 3, 4
# SERV needs a third of these clocks for the whole program.
UNTIL_CLOCKS = 40_000


def i_type(opcode: int, funct3: int, rd: int, rs1: int, value: int) -> int:
    return (value & 0xFFF) << 20 | rs1 << 15 | funct3 << 12 | rd << 7 | opcode


def s_type(funct3: int, rs2: int, rs1: int, offset: int) -> int:
    high, low = offset >> 5 & 0x7F, offset & 0x1F
    return high << 25 | rs2 << 20 | rs1 << 15 | funct3 << 12 | low << 7 | 0x23


def b_type(funct3: int, rs1: int, rs2: int, offset: int) -> int:
    high = (offset >> 12 & 1) << 6 | offset >> 5 & 0x3F
    low = (offset >> 1 & 0xF) << 1 | offset >> 11 & 1
    return high << 25 | rs2 << 20 | rs1 << 15 | funct3 << 12 | low << 7 | 0x63


def addi(rd: int, rs1: int, value: int) -> int:
    return i_type(0x13, 0, rd, rs1, value)


def lui(rd: int, upper: int) -> int:
    return upper << 12 | rd << 7 | 0x37


def load(kind: str, rd: int, rs1: int, offset: int) -> int:
    return i_type(0x03, ("lb", "lh", "lw", "", "lbu", "lhu").index(kind), rd, rs1, offset)


def store(kind: str, rs2: int, rs1: int, offset: int) -> int:
    return s_type(("sb", "sh", "sw").index(kind), rs2, rs1, offset)


def mailbox_read(rd: int, word: int) -> int:
    return load("lw", rd, MAILBOX, 4 * word)


def mailbox_write(rs2: int, word: int) -> int:
    return store("sw", rs2, MAILBOX, 4 * word)


FAULTS = {
    ILLEGAL: 0xFFFF_FFFF,
    MISALIGNED: load("lw", A, X0, DATA + 2),
    MULTIPLY: 1 << 25 | B << 20 | B << 15 | A << 7 | 0x33,  # mul a, b, b: not in RV32I
    BREAKPOINT: 0x0010_0073,
}


def program() -> list[int]:
    words = [
        addi(SP, X0, MEMORY),
        addi(MAILBOX, X0, BASE - (1 << 32)),
        mailbox_write(SP, STACK),
        # Four bytes of 89ABCDEFh, one at a time, with and without sign.
        lui(A, 0x89ABD),
        addi(A, A, 0xDEF - 0x1000),
        store("sw", A, X0, DATA),
        load("lbu", B, X0, DATA + 1),
        mailbox_write(B, BYTES),
        load("lb", B, X0, DATA + 3),
        mailbox_write(B, BYTES + 1),
        load("lhu", B, X0, DATA + 2),
        mailbox_write(B, BYTES + 2),
        # Change one byte and one half-word; the others must stay.
        store("sb", MAILBOX, X0, DATA + 1),
        store("sh", SP, X0, DATA + 2),
        load("lw", B, X0, DATA),
        mailbox_write(B, WORD),
        # Copy one mailbox word to another, plus one.
        mailbox_read(A, SOURCE),
        addi(A, A, 1),
        mailbox_write(A, TARGET),
    ]
    loop = 4 * len(words)
    words += [
        mailbox_write(A, ALIVE),
        mailbox_read(A, COMMAND),
        b_type(0, A, X0, loop - (4 * len(words) + 8)),
    ]
    for command, instruction in FAULTS.items():
        words += [addi(B, X0, command), b_type(1, A, B, 8), instruction]
    here = 4 * len(words)
    words.append(b_type(0, X0, X0, loop - here))
    return words


class Core:
    """The running core; `written` lists its mailbox writes as (word, all 32 bits)."""

    def __init__(self, dut, delay: Callable[[], int] = lambda: 0):
        self.dut = dut
        self.bench = Bench(dut, mailbox_ready=0, mailbox_rdata=0)
        self.words = {SOURCE: 0x1233, COMMAND: 0}
        self.written: list[tuple[int, int]] = []
        self.silent = False
        self._delay = delay

    async def start(self, release: bool = True) -> Core:
        await self.bench.start(release=False)
        cocotb.start_soon(self._mailbox())
        if release:
            await self.release()
        return self

    async def release(self) -> None:
        self.dut.rst.value = 0
        await self.bench.clocks()

    async def _mailbox(self) -> None:
        """Acts as the mailbox: ready is one clock wide, one or more clocks after valid."""
        dut = self.dut
        while True:
            if str(dut.mailbox_valid.value) != "1":
                await RisingEdge(dut.mailbox_valid)
            await self.bench.clocks(1 + self._delay())
            if self.silent:
                continue
            word = dut.mailbox_word.value.to_unsigned()
            if int(dut.mailbox_write.value):
                self.written.append((word, dut.mailbox_wdata.value.to_unsigned()))
            dut.mailbox_rdata.value = self.words.get(word, 0)
            await self.bench.clocks()
            dut.mailbox_ready.value = 1
            await self.bench.clocks()
            dut.mailbox_ready.value = 0

    async def until(self, done: Callable[[], bool], what: str) -> None:
        for _ in range(UNTIL_CLOCKS):
            if done():
                return
            await self.bench.clocks()
        raise AssertionError(f"never: {what}")

    async def alive(self, times: int = 3) -> None:
        """Waits until the program has run its loop `times` times."""
        target = sum(word == ALIVE for word, _ in self.written) + times
        await self.until(lambda: sum(word == ALIVE for word, _ in self.written) >= target, "the loop")

    def writes_before_loop(self) -> list[tuple[int, int]]:
        """Writes before the loop, since the last start of the program."""
        starts = [n for n, (word, _) in enumerate(self.written) if word == STACK]
        return [entry for entry in self.written[starts[-1] :] if entry[0] != ALIVE]

    async def trapped(self, command: int) -> None:
        self.words[COMMAND] = command
        await self.until(lambda: bool(int(self.dut.trap.value)), "the trap")
        self.words[COMMAND] = 0


EXPECTED = [
    (STACK, MEMORY),
    (BYTES, 0xCD),
    (BYTES + 1, 0xFFFF_FF89),
    (BYTES + 2, 0x89AB),
    (WORD, MEMORY << 16 | (BASE & 0xFF) << 8 | 0xEF),
    (TARGET, 0x1234),
]


@cocotb.test()
async def core_starts_at_address_0_after_the_reset(dut):
    core = await Core(dut).start(release=False)
    for _ in range(20):
        await core.bench.clocks()
        assert not int(dut.core_valid.value) and not int(dut.trap.value)
    await core.release()
    await core.until(lambda: bool(int(dut.core_valid.value)), "an access")
    assert dut.core_addr.value.to_unsigned() == 0


@cocotb.test()
async def bytes_half_words_and_words_of_the_memory_and_the_mailbox_are_right(dut):
    core = await Core(dut).start()
    await core.alive()
    assert core.writes_before_loop() == EXPECTED
    assert not int(dut.trap.value)


@cocotb.test()
async def a_slow_mailbox_does_not_change_the_results(dut):
    rng = seeded("delays")
    core = await Core(dut, delay=lambda: rng.randint(0, 12)).start()
    await core.alive(times=20)
    assert core.writes_before_loop() == EXPECTED


@cocotb.test()
@cocotb.parametrize(command=(ILLEGAL, MISALIGNED, MULTIPLY, BREAKPOINT))
async def unsupported_instructions_trap_until_a_reset(dut, command):
    core = await Core(dut).start()
    await core.alive()
    await core.trapped(command)
    before = len(core.written)
    for _ in range(300):
        await core.bench.clocks()
        assert int(dut.trap.value) and not int(dut.core_valid.value)
    assert len(core.written) == before
    await core.bench.strobe(dut.rst)
    assert not int(dut.trap.value)
    await core.alive()
    assert core.writes_before_loop() == EXPECTED


@cocotb.test()
@cocotb.parametrize(command=(ILLEGAL, MISALIGNED, MULTIPLY, BREAKPOINT))
async def a_reset_recovers_from_unsupported_instructions(dut, command):
    core = await Core(dut).start()
    await core.alive()
    core.words[COMMAND] = command
    for _ in range(5000):
        await core.bench.clocks()
        assert not int(dut.trap.value)
    core.words[COMMAND] = 0
    dut.rst.value = 1
    await core.bench.clocks(4)
    core.written.clear()
    await core.release()
    await core.alive()
    assert core.writes_before_loop() == EXPECTED


@cocotb.test()
async def a_reset_at_any_moment_restarts_the_program(dut):
    rng = seeded("moments")
    core = await Core(dut).start()
    for _ in range(cases(4, 20)):
        await core.bench.clocks(rng.randint(1, 2000))
        # A mailbox answer in progress ends within two clocks.
        dut.rst.value = 1
        await core.bench.clocks(4)
        core.written.clear()
        await core.release()
        await core.alive(times=1)
        assert core.writes_before_loop() == EXPECTED


@cocotb.test()
async def a_reset_ends_an_access_without_an_answer(dut):
    core = await Core(dut).start()
    await core.alive()
    core.silent = True
    await core.bench.clocks(500)
    assert int(dut.mailbox_valid.value), "it waits"
    dut.rst.value = 1
    await core.bench.clocks(4)
    assert not int(dut.core_valid.value)
    core.silent = False
    await core.release()
    await core.alive()
    assert core.writes_before_loop() == EXPECTED


COMMON = [
    "core_starts_at_address_0_after_the_reset",
    "bytes_half_words_and_words_of_the_memory_and_the_mailbox_are_right",
    "a_slow_mailbox_does_not_change_the_results",
    "a_reset_at_any_moment_restarts_the_program",
    "a_reset_ends_an_access_without_an_answer",
]
OWN = {
    "picorv32": "unsupported_instructions_trap_until_a_reset",
    "serv": "a_reset_recovers_from_unsupported_instructions",
}


def image_file(sim: str, config: str) -> Path:
    """Writes the image to a constant path per configuration and simulator, so that builds are reused."""
    path = ROOT / f"build/tests/soft_core.{config}.{sim}.hex"
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_suffix(f".{os.getpid()}")
    words = program() + [0] * (MEMORY // 4 - len(program()))
    fresh.write_text("".join(hex_line(with_parity(word)) for word in words))
    fresh.replace(path)
    return path


@pytest.mark.parametrize("sim", both(*SIMULATORS))
@pytest.mark.rule("TOP-2", "WDG-1")
def test_soft_core(sim, config):
    core = configuration(config)
    run(
        "core_and_memory",
        "tb.rtl.test_soft_core",
        sim=sim,
        config=config,
        extra_sources=[WRAPPER],
        parameters={
            "SOFT_CORE": core["soft_core_id"],
            "BYTES": MEMORY,
            "FIRMWARE_HEX": str(image_file(sim, config)),
        },
        testcase=[*COMMON, OWN[core["soft_core"]]],
    )
