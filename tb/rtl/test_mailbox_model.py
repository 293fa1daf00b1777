# SPDX-License-Identifier: Apache-2.0
"""The model of the mailbox, used by firmware tests and fuzzer, decides as commit_gate, event by event."""

from __future__ import annotations

from collections import Counter

import cocotb
import pytest

from regs.generated.mailbox import REGISTERS, VALUES
from tb.lib.bench import Strobes
from tb.lib.nightly import on_verilator
from tb.lib.runner import run
from tb.lib.seeds import cases, seeded
from tb.model.firmware import Build
from tb.rtl.test_commit_gate import ALL, IMAGE, NEWEST, ONE, Gate

EVENTS = 600
ACTIONS = VALUES["TELEGRAM", "action"]
TELEGRAM = bytes.fromhex("81 0000 0000 85")  # with its BCC
ORDERS = {NEWEST: "first", IMAGE: "image", ONE: "write", ALL: "write"}
# Function code, writes_coils, writes_parameter.
REQUESTS = [(3, 0, 0), (5, 1, 0), (5, 1, 0), (6, 0, 1)]


class Both:
    """A gate and a model with the same history."""

    def __init__(self, gate: Gate, rng) -> None:
        self.gate, self.rng, self.mailbox = gate, rng, Build().mailbox()
        self.mailbox.store("TELEGRAM_FRAME", TELEGRAM)
        self.started = Strobes(gate.dut, "telegram_start", "telegram_control", "telegram_stop")
        self.telegrams = Counter()  # by kind, and whether it is a repeat

    def a_ticket(self) -> int:
        return self.mailbox.ticket ^ self.rng.choice([0, 0, 0, 0, 1, 8])

    async def candidate(self) -> None:
        broadcast = self.rng.random() < 0.3
        function, coils, parameter = self.rng.choice(REQUESTS)
        self.mailbox.candidate(bytes([function]), broadcast)
        await self.gate.candidate(
            {"broadcast": int(broadcast), "writes_coils": coils, "writes_parameter": parameter}
        )

    async def commit(self) -> None:
        self.mailbox.commit()
        await self.gate.pulse("commit")

    async def character(self) -> None:
        self.mailbox.character()
        await self.gate.character()

    async def order_reply(self) -> None:
        order = {"length": self.rng.choice([0, 3, 3]), "after_drive": self.rng.getrandbits(1)}
        ticket = self.a_ticket()
        self.mailbox.write_register("REPLY", ticket=ticket, **order)
        await self.gate.reply(order["after_drive"], int(not order["length"]), ticket)

    async def order_telegram(self) -> None:
        mailbox = self.mailbox
        if mailbox.sending:  # mailbox_regs holds these back
            return
        if mailbox.licensed and mailbox.left and self.rng.random() < 0.7:
            mailbox.write_register("TELEGRAM", action=ACTIONS["repeat"], ticket=self.a_ticket())
            await self.gate.repeat()
            return
        kind = self.rng.choice(list(ORDERS))
        stop = kind == IMAGE and not mailbox.loopback and self.rng.random() < 0.7
        fields = {"early": self.rng.getrandbits(1), "stop": int(stop)}
        ticket = self.a_ticket()
        mailbox.write_register(
            "TELEGRAM",
            length=len(TELEGRAM),
            no_reply=int(kind == ALL),
            action=ACTIONS[ORDERS[kind]],
            ticket=ticket,
            **fields,
        )
        await self.gate.order(kind, **fields, ticket=ticket)

    async def touch(self) -> None:
        if self.mailbox.sending:  # bus_arbiter holds the write back
            return
        self.mailbox.store("TELEGRAM_FRAME", bytes(1))
        self.mailbox.read_register("EXCHANGE")
        self.mailbox.store("TELEGRAM_FRAME", TELEGRAM)
        await self.gate.pulse("telegram_touched")

    async def watch(self) -> None:
        order = {"running": self.rng.random() < 0.9, "period": self.rng.choice([0, 1, 1, 1, 2])}
        ticket = self.a_ticket()
        self.mailbox.write_register("SUPERVISOR", watch=1, ticket=ticket, **order)
        await self.gate.pulse("watch", order_ticket=ticket, **order)

    async def tick(self) -> None:
        self.mailbox.ticks += 1
        await self.gate.pulse(beat=self.mailbox.ticks & 1)

    async def telegram_ends(self) -> None:
        self.mailbox.telegram_ends()

    async def line(self) -> None:
        """The pause before a telegram is over, or somebody sends."""
        if self.rng.random() < 0.8:
            self.mailbox.pause_over()
        else:
            self.mailbox.quiet = False

    async def drive(self) -> None:
        self.mailbox.drive_data(bytes(4))
        if self.mailbox.drive_candidate:
            good = self.rng.random() < 0.6
            self.mailbox.bcc(good)
            await self.gate.pulse(*["drive_bad"][good:], drive_good=good)

    async def listen(self) -> None:
        self.mailbox.write_register("LISTEN", on=self.rng.getrandbits(1))

    async def rarely(self) -> None:
        if self.rng.random() < 0.3:
            self.mailbox.restart()
            await self.gate.pulse("rst")
        elif self.rng.random() < 0.3 and self.mailbox.loopback:
            self.mailbox.write_register("SUPERVISOR", loopback=1)
            await self.gate.pulse("loopback_close", loopback_open=0)

    async def step(self) -> str:
        """One event; returns its name."""
        often = [self.commit, self.order_telegram, self.order_telegram, self.telegram_ends, self.tick]
        seldom = [self.candidate, self.candidate, self.watch, self.watch, self.drive, self.order_reply]
        seldom += [self.line]
        rare = [self.character, self.touch, self.listen, self.rarely]
        event = self.rng.choice(6 * often + 3 * seldom + rare)
        mailbox, dut = self.mailbox, self.gate.dut
        sent_before = mailbox.sending
        telegrams = mailbox.sent_telegrams
        await event()
        if mailbox.sent_telegrams > telegrams:
            self.telegrams[mailbox.kind, mailbox.without_start, mailbox.again] += 1
        # The drive line reacts one clock after a telegram starts: it is no longer quiet, and the drive's last
        # reply is forgotten.
        dut.drive_quiet.value = int(mailbox.quiet and not (sent_before and mailbox.sending))
        dut.loopback_open.value = mailbox.loopback
        await self.gate.bench.clocks(3)
        dut.drive_quiet.value = int(mailbox.quiet and not mailbox.sending)
        dut.drive_good.value = mailbox.drive_good
        return event.__name__

    def compare(self) -> tuple[dict[str, int], dict[str, int]]:
        mailbox, dut = self.mailbox, self.gate.dut
        exchange = REGISTERS["EXCHANGE"].unpack(mailbox.read_register("EXCHANGE"))
        last = self.started.values[-1] if self.started.values else None
        same = {"ticket", "is_candidate", "is_committed", "reply_queued", "telegram_queued"}
        of_model = {name: getattr(mailbox, name) for name in same} | {
            "telegram_started": mailbox.started,
            "stop_due": exchange["stop_due"],
            "replies": len(mailbox.replies),
            "telegrams": len(mailbox.telegrams),
        }
        of_gate = {name: int(getattr(dut, name).value) for name in [*same, "telegram_started", "stop_due"]}
        of_gate |= {"replies": len(self.gate.replies), "telegrams": len(self.started)}
        if mailbox.started:
            of_model["last"], of_gate["last"] = (int(mailbox.kind == IMAGE), mailbox.without_start), last
        return of_model, of_gate


@cocotb.test()
async def the_model_decides_as_the_gate(dut):
    rng = seeded("model and gate")
    left = Counter()
    gate = await Gate(dut).start()
    for history in range(cases(6, 30)):
        await gate.pulse("rst", broadcast=0, writes_coils=0, writes_parameter=0, drive_good=0, drive_quiet=1)
        gate.replies.clear()
        both = Both(gate, rng)
        both.mailbox.ticket = int(dut.ticket.value)
        both.mailbox.ticks = int(dut.beat.value)
        both.mailbox.loopback = dut.loopback_open.value = history % 8 == 0
        events = []
        for _ in range(EVENTS):
            events.append(await both.step())
            of_model, of_gate = both.compare()
            differ = [name for name in of_model if of_model[name] != of_gate[name]]
            assert of_model == of_gate, f"{', '.join(differ)} after {', '.join(events[-12:])}"
        left.update({"replies": len(both.mailbox.replies)} | both.telegrams)
    cocotb.log.info("left: %s", dict(left))
    assert len(left) >= 8, "replies; each kind, the stop, and repeats; that of a stop is rare"


@on_verilator
@pytest.mark.rule("FRAME-6", "FRAME-7", "FC-9", "MAP-9", "LOOP-1", "SAFE-7")
def test_the_model_decides_as_the_gate(sim):
    both = {"MASTER_LOSS_STOP": 1, "SECOND_TELEGRAM": 1}
    run("commit_gate", "tb.rtl.test_mailbox_model", sim=sim, parameters=both)
