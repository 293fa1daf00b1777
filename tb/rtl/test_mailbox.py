# SPDX-License-Identifier: Apache-2.0
"""mailbox: orders of the firmware leave at both ports. Its proof has the wires between registers and gate."""

from __future__ import annotations

import cocotb
import pytest

from regs.areas import Register
from regs.generated.mailbox import REGISTERS, VALUES
from tb.lib.bench import Bench, Strobes, inputs
from tb.lib.runner import run

NOTHING = b"\x5a\x5a\x5a\x5a"  # what no access carries


class Mailbox:
    """Both lines silent and both ports idle, until a test sets them otherwise."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys(inputs("mailbox"), 0) | {"core_rst": 1})
        self.replies = Strobes(dut, "reply_start", "reply_length")
        self.telegrams = Strobes(dut, "telegram_start", "telegram_length", "telegram_control")

    async def start(self) -> Mailbox:
        await self.bench.start()
        self.dut.core_rst.value = 0
        for name in ("modbus_silent", "modbus_quiet", "drive_quiet"):
            getattr(self.dut, name).value = 1
        await self.bench.clocks()
        return self

    async def access(self, register: Register, value: int | None = None) -> int:
        """One access as bus_arbiter makes it, bytes in their lanes; returns what was read."""
        dut = self.dut
        lane = register.offset % 4
        dut.regs_valid.value, dut.regs_write.value = 1, int(value is not None)
        dut.regs_word.value = register.offset // 4
        # The lanes that are not written carry something else, and all of them do after the access.
        data = bytearray(NOTHING)
        data[lane : lane + register.size] = (value or 0).to_bytes(register.size, "little")
        dut.regs_wdata.value = int.from_bytes(data, "little")
        await self.bench.clocks()
        read = dut.regs_rdata.value.to_unsigned()
        dut.regs_valid.value = 0
        dut.regs_wdata.value = int.from_bytes(NOTHING, "little")
        await self.bench.clocks()
        return read >> 8 * lane & ((1 << 8 * register.size) - 1)

    async def read(self, name: str) -> dict[str, int]:
        return REGISTERS[name].unpack(await self.access(REGISTERS[name]))

    async def write(self, name: str, **fields: int) -> None:
        await self.access(REGISTERS[name], REGISTERS[name].pack(**fields))

    def lit(self) -> dict[str, int]:
        return {name: int(getattr(self.dut, f"lit_{name}").value) for name in REGISTERS["LED"].fields}

    async def pulse(self, *names: str) -> None:
        for name in names:
            getattr(self.dut, name).value = 1
        await self.bench.clocks()
        for name in names:
            getattr(self.dut, name).value = 0

    async def settle(self) -> tuple[int, int]:
        """How many replies and telegrams have started so far."""
        await self.bench.clocks(5)
        return len(self.replies), len(self.telegrams)


@cocotb.test()
async def what_was_prepared_for_a_candidate_leaves_at_its_commit(dut):
    mailbox = await Mailbox(dut).start()
    await mailbox.pulse("candidate")
    request = await mailbox.read("REQUEST")
    assert request["candidate"] and not request["committed"]
    ticket = request["ticket"]
    await mailbox.write("REPLY", length=17, ticket=ticket)
    await mailbox.write("TELEGRAM", length=13, early=1, ticket=ticket)
    assert int(mailbox.dut.reply_queued.value) and (await mailbox.read("EXCHANGE"))["queued"]
    assert await mailbox.settle() == (0, 0)
    await mailbox.pulse("commit")
    assert await mailbox.settle() == (1, 1)
    assert mailbox.replies.values == [(17,)] and mailbox.telegrams.values == [(13, 0)]
    exchange = await mailbox.read("EXCHANGE")
    assert exchange["started"] and not exchange["queued"]
    assert not int(mailbox.dut.reply_queued.value)
    request = await mailbox.read("REQUEST")
    assert request["committed"] and not request["candidate"] and request["ticket"] == ticket
    for action in ("image", "write"):
        order = {"action": VALUES["TELEGRAM", "action"][action], "no_reply": 1}
        await mailbox.write("TELEGRAM", length=13, ticket=ticket, **order)
        assert await mailbox.settle() == (1, 1), f"no licence for {action}"


@cocotb.test()
async def listening_and_lamps_are_switched_by_the_firmware(dut):
    mailbox = await Mailbox(dut).start()
    switches = Strobes(dut, "listen_again"), Strobes(dut, "listen_stop")
    for on, seen in ((1, [True, False]), (0, [True, True])):
        await mailbox.write("LISTEN", on=on)
        assert list(map(bool, switches)) == seen
    for lit in REGISTERS["LED"].fields:
        await mailbox.write("LED", **{lit: 1})
        assert [name for name, level in mailbox.lit().items() if level] == [lit]
    await mailbox.pulse("core_rst")
    assert not any(mailbox.lit().values())


@pytest.mark.rule("FRAME-6")
def test_mailbox(sim):
    run("mailbox", "tb.rtl.test_mailbox", sim=sim)
