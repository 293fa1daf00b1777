# SPDX-License-Identifier: Apache-2.0
"""bus_decode: memory from 0, the mailbox in the last 2 KiB, and never both."""

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.generated.mailbox import BASE
from tb.lib.runner import run
from tb.lib.seeds import seeded


@cocotb.test()
async def an_access_reaches_one_side_and_gets_its_answer(dut):
    rng = seeded("accesses")
    for _ in range(500):
        offset = rng.randrange(512)
        to_mailbox, valid, strobes = rng.randint(0, 1), rng.randint(0, 1), rng.randrange(16)
        dut.core_addr.value = BASE + 4 * offset if to_mailbox else rng.randrange(0, 8192, 4)
        dut.core_valid.value, dut.core_wstrb.value = valid, strobes
        ram, mailbox = rng.getrandbits(32), rng.getrandbits(16)
        dut.ram_rdata.value, dut.mailbox_rdata.value = ram, mailbox
        ready = {"ram": rng.randint(0, 1), "mailbox": rng.randint(0, 1)}
        dut.ram_ready.value, dut.mailbox_ready.value = ready["ram"], ready["mailbox"]
        await Timer(10, unit="ns")
        assert int(dut.mailbox_valid.value) == (valid and to_mailbox)
        assert int(dut.ram_valid.value) == (valid and not to_mailbox)
        assert int(dut.core_ready.value) == ready["mailbox" if to_mailbox else "ram"]
        assert int(dut.core_rdata.value) == (mailbox if to_mailbox else ram)
        if to_mailbox:
            assert int(dut.mailbox_word.value) == offset
            assert int(dut.mailbox_write.value) == (strobes != 0)


@pytest.mark.rule("TOP-2")
def test_bus_decode(sim):
    run("bus_decode", "tb.test_bus_decode", sim=sim)
