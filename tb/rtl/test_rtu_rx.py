# SPDX-License-Identifier: Apache-2.0
"""rtu_rx: checks frames by silence, CRC and address; gives candidate, commit, revoke and counts errors.

The bench gives bytes and silences as strobes, one event every few clocks. test_network_port.py has
real characters, gaps and errors, and STRICT_T15 = 0. The CRC unit is the real one.
"""

from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.agents import rtu
from tb.agents.crc16 import crc_good, with_crc
from tb.lib.bench import Bench, Strobes
from tb.lib.nightly import on_verilator
from tb.lib.runner import run
from tb.lib.seeds import cases, seeded

HERE = Path(__file__).parent
OWN = 0x11
COUNTERS = ("crc", "parity", "framing", "t15", "overrun")


class Receiver:
    """rtu_rx and its CRC unit; a list stands in for the frame memory."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(
            dut,
            bit_valid=0,
            bit_data=0,
            start_seen=0,
            byte_valid=0,
            byte_data=0,
            byte_parity_error=0,
            byte_framing_error=0,
            half_reached=0,
            short_reached=0,
            long_reached=0,
            write_ready=1,
            deaf=0,
            own_address=OWN,
        )
        self.candidates = Strobes(dut, "candidate", "frame_length", "frame_broadcast")
        self.commits = Strobes(dut, "commit")
        self.revokes = Strobes(dut, "revoke")
        self.counts = {name: Strobes(dut, f"count_{name}") for name in COUNTERS}
        self.memory = [0xEE] * 64

    async def start(self) -> "Receiver":
        await self.bench.start()
        await self.silence()
        self.clear()
        return self

    def clear(self) -> None:
        for strobes in (self.candidates, self.commits, self.revokes, *self.counts.values()):
            strobes.clear()

    async def byte(self, value: int, parity: int = 0, framing: int = 0, wait_clocks: int = 0) -> None:
        """Receives one byte; the frame memory accepts it `wait_clocks` later."""
        dut = self.dut
        dut.byte_data.value = value
        dut.byte_parity_error.value, dut.byte_framing_error.value = parity, framing
        dut.write_ready.value = wait_clocks == 0
        await self.bench.line_bits(value)
        await self.bench.strobe(dut.byte_valid)
        for _ in range(wait_clocks):
            await self.bench.clocks()
        dut.write_ready.value = 1
        if dut.write_valid.value == 1:
            self.memory[dut.write_addr.value.to_unsigned()] = value
        await self.bench.clocks(2)

    async def bytes(self, data: bytes) -> None:
        for value in data:
            await self.byte(value)

    async def half(self) -> None:
        """Strobe: half a character of silence."""
        await self.bench.strobe(self.dut.half_reached)
        await self.bench.clocks(2)

    async def short(self) -> None:
        """Strobes up to 1.5 characters of silence."""
        await self.half()
        await self.bench.strobe(self.dut.short_reached)
        await self.bench.clocks(2)

    async def long(self) -> None:
        """Strobe: 3.5 characters of silence."""
        await self.bench.strobe(self.dut.long_reached)
        await self.bench.clocks(2)

    async def silence(self) -> None:
        await self.short()
        await self.long()

    async def frame(self, data: bytes) -> None:
        await self.bytes(data)
        await self.silence()

    def stored(self, length: int) -> bytes:
        """Contents of the newest candidate's bank."""
        base = 32 * int(self.dut.frame_bank.value)
        return bytes(self.memory[base : base + length])

    def counted(self) -> dict[str, int]:
        return {name: len(strobes) for name, strobes in self.counts.items() if len(strobes)}

    def outcome(self) -> tuple[int, int, int]:
        return len(self.candidates), len(self.commits), len(self.revokes)

    def writes(self) -> tuple[int, int]:
        """What the newest candidate writes: coils, a parameter."""
        return int(self.dut.frame_writes_coils.value), int(self.dut.frame_writes_parameter.value)


def flip(register, bit: int) -> None:
    register.value = int(register.value) ^ 1 << bit


GOOD = rtu.build(OWN, rtu.read_coils(0, 16))
OTHER = rtu.build(OWN, rtu.write_register(2, 7))


@cocotb.test()
async def good_frame_is_candidate_after_half_a_character_and_commits_at_t35(dut):
    rx = await Receiver(dut).start()
    await rx.bytes(GOOD)
    assert rx.outcome() == (0, 0, 0)
    await rx.half()
    assert rx.outcome() == (1, 0, 0)
    await rx.short()
    assert rx.outcome() == (1, 0, 0)
    assert rx.candidates.values == [(len(GOOD), 0)]
    assert rx.stored(len(GOOD)) == GOOD
    await rx.long()
    assert rx.outcome() == (1, 1, 0)
    assert rx.counted() == {}


@cocotb.test()
async def a_character_before_t15_continues_the_frame_of_a_candidate(dut):
    """The first characters are a good frame by chance (FRAME-2): no event, and the whole is served."""
    rx = await Receiver(dut).start()
    whole = rtu.with_crc(GOOD + b"\x42\x43")
    for end, outcome in ((whole, (2, 1, 0)), (whole[:-1] + b"\x00", (1, 0, 0))):
        rx.clear()
        await rx.bytes(GOOD)
        await rx.half()
        assert rx.outcome() == (1, 0, 0) and rx.stored(len(GOOD)) == GOOD
        await rx.bytes(end[len(GOOD) :])
        await rx.silence()
        assert rx.outcome() == outcome
        if outcome[1]:
            assert rx.candidates.values[1] == (len(whole), 0) and rx.stored(len(whole)) == whole
            assert rx.counted() == {}
    await rx.frame(OTHER)
    assert rx.stored(len(OTHER)) == OTHER


@cocotb.test()
async def a_last_byte_of_00_makes_one_candidate(dut):
    """The bytes before it have a good CRC, too. Without a pause they are no candidate."""
    rx = await Receiver(dut).start()
    frame = next(
        frame
        for value in range(1 << 16)
        if (frame := rtu.build(OWN, rtu.write_register(2, value)))[-1] == 0 and crc_good(frame[:-1])
    )
    await rx.frame(frame)
    assert rx.outcome() == (1, 1, 0) and rx.candidates.values == [(len(frame), 0)]


@cocotb.test()
async def bytes_before_the_first_silence_after_reset_are_no_frame(dut):
    rx = Receiver(dut)
    await rx.bench.start()
    await rx.frame(GOOD)
    assert rx.outcome() == (0, 0, 0)
    await rx.frame(GOOD)
    assert rx.outcome() == (1, 1, 0)


@cocotb.test()
async def only_05_and_15_write_coils_and_06_and_16_a_parameter(dut):
    """Each flag comes with the candidate and holds until the next one, with any traffic between (SAFE-1).

    `make test` tries these functions and those that differ by a bit.
    """
    rng = seeded("rest of the frame")
    near = {function ^ bit for function in (5, 6, 15, 16) for bit in (0, *(1 << n for n in range(8)))}
    functions = (sorted(near), range(256))[cases(0, 1)]
    rx = await Receiver(dut).start()
    for address in (OWN, 0):
        for function in functions:
            await rx.frame(with_crc(bytes([address, function]) + rng.randbytes(4)))
            writes = (function in (5, 15), function in (6, 16))
            assert rx.writes() == writes, f"function {function}"
            await rx.frame(with_crc(bytes([OWN ^ 1, 20 - function % 21]) + rng.randbytes(4)))
            await rx.bytes(bytes([OWN, 3 if any(writes) else rng.choice((15, 16))]))
            assert rx.writes() == writes, f"function {function}, later"
            await rx.silence()
    assert rx.outcome() == (2 * len(functions), 2 * len(functions), 0)


@cocotb.test()
async def frames_of_every_length_show_their_length_and_first_32_bytes(dut):
    rng = seeded("frames")
    rx = await Receiver(dut).start()
    for length in (4, 5, 8, 29, 31, 32, 33, 64, 255, 256):
        rx.clear()
        frame = rtu.build(OWN, rng.randbytes(length - 3))
        await rx.frame(frame)
        assert rx.candidates.values == [(length % 256, 0)], f"{length} bytes"
        assert rx.outcome() == (1, 1, 0)
        assert rx.stored(min(length, 32)) == frame[:32], f"{length} bytes"
    for length in (257, 300):  # too long (FRAME-5), whatever its CRC says
        rx.clear()
        await rx.frame(rtu.build(OWN, rng.randbytes(length - 3)))
        assert rx.outcome() == (0, 0, 0), f"{length} bytes"


@cocotb.test()
async def frame_shorter_than_4_bytes_is_ignored(dut):
    rx = await Receiver(dut).start()
    await rx.frame(bytes([OWN]))
    await rx.frame(rtu.with_crc(b"\x11")[:3])
    assert rx.outcome() == (0, 0, 0)


@cocotb.test()
async def deaf_port_ignores_bytes_and_then_waits_for_silence(dut):
    rx = await Receiver(dut).start()
    dut.deaf.value = 1
    await rx.frame(GOOD)
    await rx.bytes(GOOD[:3])
    dut.deaf.value = 0
    await rx.bytes(GOOD)
    await rx.silence()
    assert rx.outcome() == (0, 0, 0)
    await rx.frame(GOOD)
    assert rx.outcome() == (1, 1, 0)


@cocotb.test()
async def newest_candidate_is_never_overwritten_by_the_next_frame(dut):
    rx = await Receiver(dut).start()
    await rx.frame(GOOD)
    await rx.bytes(OTHER)
    assert rx.stored(len(GOOD)) == GOOD
    await rx.short()
    assert rx.stored(len(OTHER)) == OTHER
    await rx.long()
    await rx.bytes(bytes(32))
    assert rx.stored(len(OTHER)) == OTHER


@cocotb.test()
async def strict_character_after_a_good_frame_revokes_it_and_all_up_to_t35_is_dropped(dut):
    rx = await Receiver(dut).start()
    await rx.bytes(GOOD)
    await rx.short()
    await rx.byte(OWN)
    assert rx.outcome() == (1, 0, 1)
    await rx.bytes(OTHER[1:])
    await rx.short()
    await rx.bytes(OTHER)
    await rx.silence()
    assert rx.outcome() == (1, 0, 1), "no frame before the silence of 3.5 characters"
    await rx.frame(OTHER)
    assert rx.outcome() == (2, 1, 1) and rx.stored(len(OTHER)) == OTHER


@cocotb.test()
@cocotb.parametrize(seen=["start_seen", "byte_valid"])
async def strict_the_start_or_the_end_of_a_character_revokes(dut, seen):
    """A flipped bit in the UART during the character therefore cannot commit the frame (SAFE-4)."""
    rx = await Receiver(dut).start()
    await rx.bytes(GOOD)
    await rx.short()
    await rx.bench.strobe(getattr(dut, seen))
    await rx.bench.clocks(2)
    assert rx.outcome() == (1, 0, 1)
    await rx.silence()
    assert rx.outcome() == (1, 0, 1), "nothing is committed"


@cocotb.test()
async def receiver_recovers_from_any_state(dut):
    """Including undefined states (SAFE-3, SAFE-4)."""
    rx = await Receiver(dut).start()
    for state in range(16):
        dut.rx_i.state_i.code.value = state
        await Timer(1, unit="ps")
        await rx.silence()
        await rx.bytes(GOOD)
        await rx.silence()
        rx.clear()
        await rx.bytes(GOOD)
        await rx.silence()
        assert rx.outcome() == (1, 1, 0), f"state {state}"


@cocotb.test()
async def strict_no_flip_of_the_state_accepts_a_revoked_frame(dut):
    """The CRC residue stays good after a 00 byte (SAFE-4)."""
    rx = await Receiver(dut).start()
    for bit in range(len(dut.rx_i.state)):
        rx.clear()
        await rx.bytes(GOOD)
        await rx.short()
        await rx.byte(0)
        assert rx.outcome() == (1, 0, 1)
        flip(dut.rx_i.state_i.code, bit)
        await rx.silence()
        await rx.silence()
        assert rx.outcome() == (1, 0, 1), f"bit {bit}"


@cocotb.test()
async def strict_no_flip_of_the_state_ends_a_revoked_frame_early(dut):
    """Another good frame that follows within t3.5 is dropped (FRAME-3, SAFE-4)."""
    rx = await Receiver(dut).start()
    for bit in range(len(dut.rx_i.state)):
        await rx.bytes(GOOD)
        await rx.short()
        await rx.byte(0)
        rx.clear()
        flip(dut.rx_i.state_i.code, bit)
        await rx.bytes(OTHER)
        await rx.silence()
        assert rx.outcome() == (0, 0, 0), f"bit {bit}"


@cocotb.test()
async def a_flipped_bank_is_a_fault_and_ends_by_itself(dut):
    """The firmware would see an older frame; instead it restarts (SAFE-4)."""
    rx = await Receiver(dut).start()
    faults = Strobes(dut, "fault")
    for half in ("held_i", "opposite_i"):
        for _ in range(2):
            rx.clear()
            faults.clear()
            await rx.frame(GOOD)
            assert rx.outcome() == (1, 1, 0) and not len(faults)
            flip(getattr(dut.rx_i.bank_i, half).half, 0)
            await rx.bench.clocks(4)
            assert len(faults) == 1, f"{half}: one clock"
    await rx.frame(GOOD)
    assert rx.stored(len(GOOD)) == GOOD


@cocotb.test()
async def strict_foreign_frame_with_bytes_after_it_is_dropped(dut):
    """A frame that continues after t1.5 is bad at any address, even if the rest looks good."""
    rx = await Receiver(dut).start()
    await rx.bytes(rtu.build(OWN ^ 1, rtu.read_coils(0, 16)))
    await rx.short()
    await rx.bytes(GOOD)
    await rx.silence()
    assert rx.outcome()[:2] == (0, 0)
    await rx.frame(GOOD)
    assert rx.outcome()[:2] == (1, 1)


@on_verilator
@pytest.mark.rule("FRAME-1", "FRAME-2", "FRAME-3", "FRAME-4", "FRAME-5", "FRAME-6", "SAFE-1")
def test_rtu_rx(sim):
    run("rtu_rx_crc", "tb.rtl.test_rtu_rx", sim=sim, extra_sources=[HERE / "rtu_rx_crc.v"])
