# SPDX-License-Identifier: Apache-2.0
"""rtu_rx in the network port: its rights, and flipped bits, which its proof does not have (SAFE-4)."""

from __future__ import annotations

import cocotb
import pytest

from tb.agents import rtu
from tb.agents.uart import Flaws
from tb.lib.bench import Strobes
from tb.lib.nightly import on_verilator
from tb.lib.runner import run
from tb.lib.seeds import cases, seeded
from tb.rtl.test_network_port import GOOD, OWN, WRAPPER, Port


def flip(register, bit: int = 0) -> None:
    register.value = int(register.value) ^ 1 << bit


@cocotb.test()
async def only_05_and_15_write_coils_and_06_and_16_a_parameter(dut):
    """Each flag holds until the next candidate (SAFE-1). `make test` tries those that differ by a bit."""
    rng = seeded("rest of the frame")
    near = {function ^ bit for function in (5, 6, 15, 16) for bit in (0, *(1 << n for n in range(8)))}
    port = await Port(dut, 115_200).start()
    for function in sorted({*near, *rng.sample(range(256), cases(0, 40))}):
        writes = (function in (5, 15), function in (6, 16))
        await port.frame(rtu.build(OWN, bytes([function]) + rng.randbytes(4)))
        await port.frame(rtu.build(OWN + 1, bytes([20 - function % 21]) + rng.randbytes(4)))
        await port.send(bytes([OWN, 3 if any(writes) else rng.choice((15, 16))]))
        assert (dut.frame_writes_coils.value, dut.frame_writes_parameter.value) == writes, function
        await port.silence()


@cocotb.test()
@cocotb.parametrize(seen=["start_seen", "byte_valid"])
async def the_start_or_the_end_of_a_character_revokes(dut, seen):
    """So no flipped bit in the UART during the character can commit the frame."""
    port = await Port(dut, 115_200).start()
    await port.send(GOOD)
    await port.line.source.idle(port.bits(2.5))
    getattr(dut.port_i.uart_i, seen).value = 1
    await port.bench.clocks()
    await port.silence(8)
    assert port.outcome() == (1, 0, 1)


@cocotb.test()
async def receiver_recovers_from_any_state(dut):
    """Including undefined states (SAFE-3)."""
    port = await Port(dut, 115_200).start()
    for state in range(16):
        dut.port_i.rtu_rx_i.state_i.code.value = state
        await port.silence()
        await port.frame(GOOD)
        port.clear()
        await port.frame(GOOD)
        assert port.outcome() == (1, 1, 0), f"state {state}"


@cocotb.test()
async def no_flip_of_the_state_accepts_a_revoked_frame_or_ends_it_early(dut):
    """Its CRC is good again after a 00. A good frame that follows within t3.5 is dropped (FRAME-3)."""
    port = await Port(dut, 115_200).start()
    for bit in range(4):
        for follows in (b"", GOOD):
            port.clear()
            await port.send(GOOD + b"\0", Flaws(gaps={len(GOOD): port.bits(2.5)}))
            flip(dut.port_i.rtu_rx_i.state_i.code, bit)
            if follows:
                await port.send(follows)
            await port.silence(8)
            assert port.outcome() == (1, 0, 1), f"bit {bit}, then {follows.hex(' ')}"


@cocotb.test()
async def a_flipped_bank_is_a_fault_and_ends_by_itself(dut):
    """The firmware would see an older frame; instead it restarts."""
    port = await Port(dut, 115_200).start()
    faults = Strobes(dut, "fault")
    bank = dut.port_i.rtu_rx_i.bank_i
    for half in (bank.held_i.half, bank.opposite_i.half):
        for _ in range(2):
            port.clear()
            faults.clear()
            await port.frame(GOOD)
            assert port.outcome() == (1, 1, 0) and not len(faults)
            flip(half)
            await port.bench.clocks(4)
            assert len(faults) == 1, f"{half._path}: one clock"
    await port.frame(GOOD)
    first = 32 * int(dut.frame_bank.value)
    assert bytes(port.written.memory[first + at] for at in range(len(GOOD))) == GOOD


@on_verilator
@pytest.mark.rule("SAFE-1", "SAFE-3", "SAFE-4")
def test_rtu_rx(sim):
    run("network_line", "tb.rtl.test_rtu_rx", sim=sim, extra_sources=[WRAPPER])
