# SPDX-License-Identifier: Apache-2.0
"""drive_port at its pins: telegrams, replies, pauses and direction, with good and bad drives.

The clock is the slowest allowed, where a tick is coarsest. Times on the line are in bits of 9600 bit/s.
"""

from __future__ import annotations

from collections.abc import Callable

import cocotb
import pytest
from cocotb.triggers import FallingEdge, RisingEdge

from tb.agents.fc_slave import CHARACTER_BITS
from tb.agents.rs485 import DirectionMonitor
from tb.agents.uart import Flaws, Format, Frame, Sent, now_ps, with_gaps
from tb.lib.bench import Bench, Strobes
from tb.lib.line_tap import RecordedLine
from tb.lib.memory_ports import ReadPort, WritePort, at_once
from tb.lib.nightly import on_verilator
from tb.lib.runner import ROOT, run
from tb.lib.seeds import seeded
from tb.model.fc_telegram import ADR_BROADCAST, build, build_parameter, build_process, build_text

CLK_HZ = 2_000_000
LINE = Format.named(9600, "8E1")
PAUSE = 2 * CHARACTER_BITS
COMMAND = build_process(0x047C, 0x2000)
STATUS = build_process(0x0F07, 0x1FFF)
NUMBER = build_parameter(1, 518, 0, 0x0001_86A0, 0x0F07, 0x2000)
LGE_PLACE = 28
WRAPPER = ROOT / "tb/rtl/drive_line.v"


def contents(telegram: bytes) -> bytes:
    """Contents of the telegram frame as the firmware writes them: ADR, data and BCC."""
    return telegram[2:]


def kept(reply: bytes) -> dict[int, int]:
    """The drive frame after a reply of up to 24 data bytes."""
    return {LGE_PLACE: reply[1], **dict(enumerate(reply[3:-1]))}


class Port:
    """The port with its frame memory and a drive line that echoes."""

    def __init__(self, dut, delay: Callable[[], int] = at_once):
        self.dut = dut
        commands = ("telegram_start", "telegram_length", "telegram_no_reply", "listen_again", "listen_stop")
        self.bench = Bench(dut, CLK_HZ, telegram_control=1, telegram_stop=0, **dict.fromkeys(commands, 0))
        self.line = RecordedLine(dut.rx, dut.tx, dut.de, LINE, echo=True)
        self.telegram = ReadPort(self.bench, delay=delay)
        self.drive_frame = WritePort(self.bench, "write_data", delay)
        self.bad = Strobes(dut, "bad")
        self.candidates = DirectionMonitor(dut.candidate)
        self.goods = DirectionMonitor(dut.good)

    async def start(self, listening: bool = False) -> Port:
        """With `listening`: sends a telegram, so that the port waits for a reply."""
        await self.bench.start()
        if listening:
            await self.send(COMMAND)
        return self

    def on(self, name: str) -> bool:
        return bool(int(getattr(self.dut, name).value))

    async def quiet(self) -> int:
        """Waits for the end of the pause; returns its time."""
        if not self.on("quiet"):
            await RisingEdge(self.dut.quiet)
        at = now_ps()
        await self.bench.clocks()
        return at

    async def begin(self, telegram: bytes, no_reply: int = 0) -> None:
        """Starts a telegram after the pause."""
        await self.quiet()
        self.telegram.memory = contents(telegram)
        self.dut.telegram_length.value = len(contents(telegram))
        self.dut.telegram_no_reply.value = no_reply
        await self.bench.strobe(self.dut.telegram_start)

    async def send(self, telegram: bytes, no_reply: int = 0) -> Frame:
        """Sends a whole telegram; returns it as seen on the line."""
        heard = len(self.line.monitor.characters)
        await self.begin(telegram, no_reply)
        assert self.on("sending")
        await FallingEdge(self.dut.sending)
        await self.bench.clocks(2)
        return Frame(tuple(self.line.monitor.characters[heard:]))

    async def listen_again(self) -> None:
        await self.bench.strobe(self.dut.listen_again)

    async def drive_sends(
        self, reply: bytes, flaws: Flaws | None = None, delay: float = 1.0, fmt: Format | None = None
    ) -> Sent:
        """The drive sends characters; returns after its last stop bit."""
        await self.line.source.idle(delay)
        sent = await self.line.source.send(reply, flaws, fmt)
        # The port samples a fast sender's stop bit after the end of that bit.
        await self.line.source.idle(0.5)
        await self.bench.clocks()
        return sent

    async def accepts(self, reply: bytes, flaws: Flaws | None = None, fmt: Format | None = None) -> bool:
        """Whether the port accepts this reply after a silence; afterwards the port listens again."""
        bad = len(self.bad)
        self.drive_frame.written.clear()
        await self.drive_sends(reply, flaws, PAUSE + 1, fmt)
        good = self.on("good")
        await self.line.source.idle(PAUSE + 1)
        assert self.on("good") == good
        assert len(self.bad) == bad + (not good)
        if good:
            assert self.drive_frame.memory == kept(reply)
            await self.listen_again()
        assert self.on("listening") and not self.on("good")
        return good


@cocotb.test()
async def telegrams_are_sent_byte_for_byte_without_gaps_inside_de(dut):
    rng = seeded("telegrams")
    port = await Port(dut, delay=lambda: rng.randint(0, 9)).start()
    for length in (4, 12, 28):
        telegram = build(rng.randbytes(length))
        frame = await port.send(telegram)
        assert frame.ok and frame.data == telegram
        assert frame.largest_gap_ps <= 0.01 * LINE.bit_ps
        timing = port.line.monitor.measure(frame)
        assert abs(timing.error(LINE)) < 1e-3
        assert timing.worst_edge_ps < 0.02 * LINE.bit_ps
    port.line.check_direction()
    for pulse in port.line.direction.pulses:
        first = min(c.start_ps for c in port.line.monitor.characters if c.start_ps > pulse.rise_ps)
        assert first - pulse.rise_ps > 0.15 * LINE.bit_ps, "DE must rise before the start bit"


@cocotb.test()
@cocotb.parametrize(control=[0, 1])
async def control_bit_10_is_sent_only_when_commands_are_allowed(dut, control):
    """Holds for any contents of the frame memory (SAFE-1)."""
    port = await Port(dut).start()
    dut.telegram_control.value = control
    for telegram in (COMMAND, build(bytes.fromhex("1202 0000 0000 0000 FFFF FFFF"))):
        wanted = bytearray(telegram)
        wanted[-5] &= 0xFF if control else 0xFB
        assert (await port.send(telegram)).data == wanted


@cocotb.test()
async def the_start_bit_is_never_sent_in_the_stop(dut):
    """Holds for any contents of the frame memory (SAFE-7)."""
    port = await Port(dut).start()
    dut.telegram_stop.value = 1
    wanted = bytearray(COMMAND)
    wanted[-4] &= 0xBF
    assert wanted != COMMAND
    assert (await port.send(COMMAND)).data == wanted


@cocotb.test()
async def each_telegram_follows_two_characters_of_silence(dut):
    port = await Port(dut).start()
    ends = []
    ends.append((await port.send(COMMAND)).end_ps)
    begun = [(await port.send(NUMBER)).start_ps]  # after its own telegram
    ends.append((await port.drive_sends(STATUS)).end_ps)
    begun.append((await port.send(COMMAND)).start_ps)  # after a reply
    ends.append((await port.drive_sends(b"\x55", delay=PAUSE + 5)).end_ps)
    begun.append((await port.send(COMMAND)).start_ps)  # after a stray character
    for end, start in zip(ends, begun, strict=True):
        pause = (start - end) / LINE.bit_ps
        # The driver's lead takes a quarter bit; the silence is accurate to a quarter bit.
        assert PAUSE <= pause <= PAUSE + 0.75, f"{pause:.2f} bits"


@cocotb.test()
async def quiet_follows_two_characters_of_silence(dut):
    port = await Port(dut).start()
    bit = LINE.bit_ps

    async def after(end_ps: float, late: float = 0.5) -> None:
        pause = (await port.quiet() - end_ps) / bit
        assert PAUSE <= pause <= PAUSE + late, f"{pause:.2f} bits"

    await port.quiet()
    await after((await port.drive_sends(STATUS)).end_ps)
    await after((await port.drive_sends(b"\x00\xff")).end_ps)
    # A long low level is neither a character nor a silence.
    broken = await port.line.source.send_break(3 * PAUSE, idle_after=0)
    assert not port.on("quiet")
    await after(broken.end_ps, late=1.0)


@cocotb.test()
async def quiet_ends_with_a_start_edge_and_while_the_port_itself_sends(dut):
    port = await Port(dut).start()
    await port.quiet()
    port.line.source.hold(0)
    await port.bench.clocks(4)
    assert not port.on("quiet")
    port.line.source.hold(1)
    await port.quiet()
    await port.begin(COMMAND)
    while port.on("sending"):
        await port.bench.clocks(20)
        assert not port.on("quiet") or not port.on("de")
    await port.bench.clocks(2)
    assert not port.on("quiet")


@cocotb.test()
async def replies_of_every_kind_are_good_after_any_delay(dut):
    rng = seeded("replies")
    port = await Port(dut, delay=lambda: rng.randint(0, 9)).start()
    text = build_text(533, b"twenty characters ok", 0x0400, 0x0F07, 0x2000)
    for reply, delay in ((STATUS, 1.0), (NUMBER, PAUSE), (STATUS, 20 * CHARACTER_BITS), (text, 3.0)):
        await port.send(COMMAND)
        assert port.on("listening")
        await port.drive_sends(reply, delay=delay)
        assert port.on("good") and port.drive_frame.memory.items() >= kept(reply).items()
    assert not len(port.bad)


@cocotb.test()
@cocotb.parametrize(characters=(1.0, 1.9, 2.0, 2.1, 2.2, 3.0))
async def gaps_of_up_to_two_characters_are_allowed_in_a_reply(dut, characters):
    rng = seeded("places")
    port = await Port(dut).start(listening=True)
    for place in (rng.randrange(1, len(STATUS) - 1), len(STATUS) - 1):
        flaws = Flaws(gaps={place: characters * CHARACTER_BITS})
        assert await port.accepts(STATUS, flaws) == (characters <= 2), f"before byte {place}"


@cocotb.test()
@cocotb.parametrize(longer=(-2, 2))
async def a_reply_may_take_1_5_times_its_nominal_time(dut, longer):
    """By equal gaps, two bits shorter and longer than the limit (FC-8)."""
    port = await Port(dut).start(listening=True)
    for reply in (STATUS, NUMBER):
        gap = (0.5 * CHARACTER_BITS * len(reply) + longer) / (len(reply) - 1)
        assert await port.accepts(reply, with_gaps(len(reply), gap)) == (longer < 0), f"gaps of {gap:.1f}"


@cocotb.test()
@cocotb.parametrize(place=(1, 5, len(NUMBER) - 1))
async def a_damaged_reply_is_bad_once_and_the_next_one_is_good(dut, place):
    """LGE, a data byte or the BCC: its content, its parity or its stop bit (FC-8)."""
    port = await Port(dut).start(listening=True)
    other = NUMBER[:place] + bytes([NUMBER[place] ^ 0x10]) + NUMBER[place + 1 :]
    for reply, flaws in (
        (other, Flaws()),
        (NUMBER, Flaws(bad_parity=(place,))),
        (NUMBER, Flaws(bad_stop=(place,), gaps={place + 1: 1.0})),
    ):
        assert not await port.accepts(reply, flaws)
        assert await port.accepts(STATUS)


@cocotb.test()
async def the_echo_of_a_telegram_is_ignored(dut):
    port = await Port(dut).start()
    for telegram in (COMMAND, NUMBER):
        await port.send(telegram)
        assert port.on("listening")
        await port.line.source.idle(PAUSE + 2)
        assert not port.on("good") and not len(port.bad) and not port.drive_frame.written
    await port.drive_sends(STATUS)
    assert port.on("good")


@cocotb.test()
async def characters_received_while_sending_are_ignored(dut):
    port = await Port(dut).start()
    await port.drive_sends(STATUS, delay=PAUSE + 5)
    assert not port.on("listening") and not port.on("good")  # no telegram was sent yet
    port.line.echo = False
    await port.begin(build(bytes(28)))
    await port.drive_sends(STATUS, delay=4 * CHARACTER_BITS)
    await port.drive_sends(b"\x02\x06\x00", delay=2 * CHARACTER_BITS)
    assert port.on("de")
    await FallingEdge(dut.sending)
    await port.line.source.idle(PAUSE + 2)
    assert port.on("listening") and not port.on("good")
    assert not len(port.bad) and not port.drive_frame.written
    await port.drive_sends(STATUS)
    assert port.on("good")


@cocotb.test()
async def a_character_begun_while_sending_is_ignored(dut):
    port = await Port(dut).start()
    port.line.echo = False
    await port.begin(COMMAND)
    await RisingEdge(dut.de)
    # DE is high for a quarter bit and the telegram; it falls in the middle of the reply's STX.
    await port.drive_sends(STATUS, delay=0.25 + CHARACTER_BITS * len(COMMAND) - 5)
    assert not port.on("sending") and not port.on("good")
    await port.line.source.idle(PAUSE + 1)
    await port.drive_sends(STATUS)
    assert port.on("good")


@cocotb.test()
async def replies_to_a_broadcast_are_ignored(dut):
    port = await Port(dut).start()
    frame = await port.send(build_process(0x047C, 0x2000, ADR_BROADCAST), no_reply=1)
    assert frame.data == build_process(0x047C, 0x2000, ADR_BROADCAST)
    await port.drive_sends(build_process(0x0F07, 0, ADR_BROADCAST))
    await port.drive_sends(STATUS, Flaws(bad_parity=(4,)), delay=PAUSE + 5)
    assert not port.on("listening") and not port.on("good")
    assert not len(port.bad) and not port.drive_frame.written
    await port.send(COMMAND)
    assert port.on("listening")


@cocotb.test()
async def a_new_telegram_ends_listening_for_the_older_reply(dut):
    port = await Port(dut).start(listening=True)
    await port.drive_sends(STATUS)
    assert port.on("good")
    await port.begin(COMMAND)
    assert not port.on("good") and not port.on("listening")
    await FallingEdge(dut.sending)
    await port.bench.clocks(2)
    assert port.on("listening") and not port.on("good")


@cocotb.test()
async def glitches_shorter_than_a_quarter_bit_are_ignored(dut):
    rng = seeded("glitches")
    port = await Port(dut).start(listening=True)
    for reply in (STATUS, NUMBER, STATUS):
        places = [CHARACTER_BITS * n + rng.uniform(0.3, CHARACTER_BITS - 0.6) for n in range(-1, len(reply))]
        glitches = tuple((place, rng.uniform(0.02, 0.24)) for place in places)
        assert await port.accepts(reply, Flaws(glitches=glitches))


@cocotb.test()
@cocotb.parametrize(percent=(-4, 4))
async def a_drive_with_a_clock_error_of_4_percent_is_received(dut, percent):
    rng = seeded("replies")
    port = await Port(dut).start(listening=True)
    for _ in range(3):
        assert await port.accepts(build(rng.randbytes(rng.choice((4, 12)))), Flaws(ppm=percent * 1e4))


@cocotb.test()
async def the_firmware_can_listen_again_or_stop(dut):
    port = await Port(dut).start(listening=True)
    await port.drive_sends(NUMBER)
    assert port.on("good")
    await port.listen_again()
    assert port.on("listening") and not port.on("good")
    await port.drive_sends(STATUS)
    assert port.on("good") and port.drive_frame.memory.items() >= kept(STATUS).items()
    await port.bench.strobe(dut.listen_stop)
    assert not port.on("listening") and not port.on("good")
    await port.drive_sends(STATUS)
    assert not port.on("good") and not len(port.bad)


@cocotb.test()
async def noise_between_exchanges_never_stops_the_port(dut):
    rng = seeded("noise")
    port = await Port(dut).start()
    for _ in range(3):
        await port.send(COMMAND)
        for _ in range(rng.randint(3, 8)):
            await port.line.source.low_pulse(rng.uniform(0.02, 15) * LINE.bit_ps)
            await port.line.source.idle(rng.uniform(0.1, 15))
        await port.line.source.idle(PAUSE + 1)
        await port.send(COMMAND)
        await port.drive_sends(STATUS)
        assert port.on("good")
    port.line.check_direction()


@cocotb.test()
async def a_reset_turns_the_driver_off_at_any_moment(dut):
    rng = seeded("moments")
    port = await Port(dut).start()
    for _ in range(3):
        await port.begin(NUMBER)
        await port.line.source.idle(rng.uniform(0.1, 6 * CHARACTER_BITS))
        await port.bench.strobe(dut.rst)
        assert not port.on("de") and port.on("tx") and not port.on("sending")
        assert not port.on("quiet")
    frame = await port.send(COMMAND)
    assert frame.data[-len(COMMAND) :] == COMMAND
    await port.drive_sends(STATUS)
    assert port.on("good")


@cocotb.test()
async def a_reset_makes_a_low_line_idle(dut):
    """Serial lines reset to 1: nothing of a low before the reset counts after it."""
    port = await Port(dut).start()
    port.line.source.hold(0)
    await port.line.source.idle(4)
    assert dut.port_i.line.value == 0
    await port.bench.strobe(dut.rst)
    assert dut.port_i.synced.value == 1 and dut.port_i.line.value == 1


# Scenarios of many exchanges, each of tens of thousands of clocks.
MANY_REPLIES = (
    "gaps_of_up_to_two_characters_are_allowed_in_a_reply",
    "a_drive_with_a_clock_error_of_4_percent_is_received",
    "noise_between_exchanges_never_stops_the_port",
    "replies_of_every_kind_are_good_after_any_delay",
    "glitches_shorter_than_a_quarter_bit_are_ignored",
)


@on_verilator
@pytest.mark.rule(
    "LINE-4", "LINE-5", "FC-1", "FC-2", "FC-7", "FC-8", "FC-9", "FC-10", "SAFE-1", "SAFE-2", "SAFE-3"
)
def test_drive_port(sim):
    run_port(sim, rf"(?!{'|'.join(MANY_REPLIES)})\w+")


@pytest.mark.nightly
@pytest.mark.rule("LINE-5", "FC-8")
def test_many_replies():
    run_port("verilator", *MANY_REPLIES)


def run_port(sim: str, *testcase: str) -> None:
    run(
        "drive_line",
        "tb.rtl.test_drive_port",
        sim=sim,
        extra_sources=[WRAPPER],
        parameters={"CLK_HZ": CLK_HZ},
        testcase=testcase,
    )
