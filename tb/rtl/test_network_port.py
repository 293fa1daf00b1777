# SPDX-License-Identifier: Apache-2.0
"""network_port: characters at every rate and format, silences measured from the pin, replies.

The clock equals the baud base, so that a rate of 115200 bit/s takes 16 clocks a bit.
"""

import itertools

import cocotb
import pytest
from cocotb.triggers import FallingEdge, RisingEdge

from regs.generated.card_tables import BASE_HZ, EXTENDED_RATES
from tb.agents import rtu
from tb.agents.crc16 import crc_good
from tb.agents.uart import Flaws, Format, now_ps
from tb.lib.bench import Bench, Strobes
from tb.lib.card import baud_switches, switch_word
from tb.lib.line_tap import RecordedLine
from tb.lib.memory_ports import ReadPort, WritePort
from tb.lib.nightly import first, on_verilator
from tb.lib.runner import ROOT, run
from tb.lib.seeds import seeded

WRAPPER = ROOT / "tb/rtl/network_line.v"
OWN = 7
SLOWEST_HZ = 2_000_000
FORMATS = ("8N1", "8N2", "8E1", "8O1")
COUNTERS = ("crc", "parity", "framing", "t15", "overrun")
SHORT = rtu.build(OWN, b"\x07")  # the shortest possible frame
GOOD = rtu.build(OWN, rtu.read_coils(0, 16))
FOREIGN = rtu.build(OWN + 1, rtu.read_coils(0, 16))
# FRAME-1 allows a quarter bit either way. At 115200 bit/s the input delay in clocks is most of it, and this
# bench's clock is slower than the slowest allowed.
ACCURACY = 0.25 * SLOWEST_HZ / BASE_HZ
START = 1  # a state of the UART


class Port:
    """The port with its line, its frame memory, and all its outputs."""

    def __init__(self, dut, baud: int = 19_200, form: str = "8E1", echo: bool = False):
        self.dut = dut
        self.bench = Bench(
            dut,
            int(dut.CLK_HZ.value) or BASE_HZ,
            sw_baud=switch_word(baud_switches(baud, form)) & 0x1F,
            own_address=OWN,
            loopback_open=0,
            reply_start=0,
            reply_length=0,
            read_damaged=0,
        )
        self.line = RecordedLine(dut.rx, dut.tx, dut.de, Format.named(baud, form), echo)
        self.written = WritePort(self.bench, "write_data")
        self.memory = ReadPort(self.bench)
        self.candidates = Strobes(dut, "candidate", "frame_length")
        self.commits = Strobes(dut, "commit")
        self.revokes = Strobes(dut, "revoke")
        self.counts = {name: Strobes(dut, f"count_{name}") for name in COUNTERS}

    async def start(self) -> "Port":
        await self.bench.start()
        await self.silence()
        return self

    async def silence(self, characters: float = 3.8) -> None:
        """Keeps the line idle for so many character times of FRAME-1."""
        await self.line.source.idle(self.bits(characters))

    def bits(self, characters: float) -> float:
        """Converts character times of FRAME-1 to bits at the present rate."""
        fmt = self.line.fmt
        return characters * rtu.t15_ps(fmt.baud, fmt.bits) / 1.5 / fmt.bit_ps

    async def send(self, data: bytes, flaws: Flaws | None = None) -> int:
        """Sends characters; returns the end of the last stop bit in ps."""
        return (await self.line.source.send(data, flaws)).end_ps

    async def frame(self, data: bytes, flaws: Flaws | None = None) -> int:
        """Sends a frame and the silence after it."""
        end = await self.send(data, flaws)
        await self.silence()
        return end

    async def reply(self, contents: bytes, length: int | None = None) -> bytes:
        self.memory.memory = contents
        self.dut.reply_length.value = len(contents) if length is None else length
        await self.bench.strobe(self.dut.reply_start)
        frame = await self.line.monitor.frame(1e12, gap_bits=3)
        assert frame.ok and frame.largest_gap_ps < 0.02 * self.line.fmt.bit_ps
        return frame.data

    def outcome(self) -> tuple[int, int, int]:
        """Number of candidates, commits and revokes."""
        return len(self.candidates), len(self.commits), len(self.revokes)

    def counted(self) -> dict[str, int]:
        return {name: len(strobes) for name, strobes in self.counts.items() if len(strobes)}

    def clear(self) -> None:
        for strobes in (self.candidates, self.commits, self.revokes, *self.counts.values()):
            strobes.clear()


def late_bits(port: Port, strobes: Strobes, end_ps: int, limit_ps: float) -> float:
    """Checks that the strobe came once; returns its delay after the limit in bits."""
    assert len(strobes) == 1, f"{port.line.fmt}: {len(strobes)} strobes"
    return (strobes.times_ps[0] - end_ps - limit_ps) / port.line.fmt.bit_ps


@cocotb.test()
@cocotb.parametrize(baud=[rate.baud for rate in EXTENDED_RATES.values()])
async def both_silences_are_exact_from_the_pin_at_every_rate(dut, baud):
    """In every format at the fast rates; in one at the slow rates, to save simulation time."""
    port = await Port(dut, 115_200).start()
    for form in FORMATS if baud >= 9600 else ("8O1",) if baud > 300 else ("8N2",):
        await use(port, baud, form)
        end = await port.frame(SHORT)
        bits = port.line.fmt.bits
        half = late_bits(port, port.candidates, end, rtu.t15_ps(baud, bits) / 3)
        long = late_bits(port, port.commits, end, rtu.t35_ps(baud, bits))
        print(f"{port.line.fmt}: candidate {half:+.3f} bits, commit {long:+.3f} bits after their limits")
        assert abs(half) <= ACCURACY and abs(long) <= ACCURACY, port.line.fmt
        port.clear()


async def use(port: Port, baud: int, form: str) -> None:
    """Changes the switches and resets."""
    port.dut.sw_baud.value = switch_word(baud_switches(baud, form)) & 0x1F
    port.line.set_format(Format.named(baud, form))
    await port.bench.strobe(port.dut.rst)
    await port.silence()


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def frame_is_stored_and_its_reply_is_sent(dut, form):
    rng = seeded("frames")
    port = await Port(dut, 115_200, form).start()
    port.written.delay = port.memory.delay = lambda: rng.randint(0, 9)
    for length in (4, 8, 29, 32, 33):
        port.clear()
        frame = rtu.build(OWN, rng.randbytes(length - 3))
        await port.frame(frame)
        assert port.outcome() == (1, 1, 0) and port.candidates.values == [(length,)]
        bank = 32 * int(dut.frame_bank.value)
        stored = bytes(port.written.memory[bank + i] for i in range(min(length, 32)))
        assert stored == frame[:32]
        contents = rng.randbytes(rng.randint(2, 24))
        assert await port.reply(contents) == rtu.with_crc(contents)
        await port.silence()
    assert port.counted() == {}
    port.line.check_direction()


@cocotb.test()
async def frames_of_up_to_256_bytes_are_candidates(dut):
    rng = seeded("frames")
    port = await Port(dut, 115_200, "8N1").start()
    for length in (255, 256, 257):
        port.clear()
        await port.frame(rtu.build(OWN, rng.randbytes(length - 3)))
        if length <= 256:
            assert port.outcome() == (1, 1, 0) and port.counted() == {}
        else:
            assert port.outcome() == (0, 0, 0) and port.counted() == {"overrun": 1}
            port.clear()
            await port.frame(GOOD)
            assert port.outcome() == (1, 1, 0) and port.counted() == {}, "the next good frame"


# ---------------------------------------------------------------- silences between and inside frames


@cocotb.test()
@cocotb.parametrize(baud=(19_200, 38_400))
async def strict_character_after_a_good_frame_revokes_it_before_t35(dut, baud):
    port = await Port(dut, baud).start()
    t15, t35 = port.bits(1.5), port.bits(3.5)
    for gap, outcome, what in (
        (port.bits(0.4), (0, 0, 0), "0.4 characters: one frame, too long to be good"),
        (port.bits(0.6), (1, 0, 0), "0.6: the same, after a candidate"),
        (t15 - 0.3, (1, 0, 0), "just below 1.5"),
        (t15 + 0.3, (1, 0, 1), "just above 1.5"),
        (port.bits(1.6), (1, 0, 1), "1.6: revoked, and the second frame is dropped"),
        (port.bits(3.4), (1, 0, 1), "3.4: the same"),
        (t35 - 0.3, (1, 0, 1), "just below 3.5"),
        (t35 + 0.3, (2, 2, 0), "just above 3.5: two frames"),
        (port.bits(3.6), (2, 2, 0), "3.6: two frames"),
    ):
        port.clear()
        await port.frame(GOOD + GOOD, Flaws(gaps={len(GOOD): gap}))
        assert port.outcome() == outcome, f"{what}: {port.outcome()}"
        port.clear()
        await port.frame(GOOD)
        assert port.outcome() == (1, 1, 0), f"the next frame after {what}"


@cocotb.test()
async def strict_characters_after_a_revoke_are_dropped_until_t35(dut):
    port = await Port(dut).start()
    parts = [GOOD, b"\x55", GOOD, GOOD]
    starts = itertools.accumulate(len(part) for part in parts[:-1])
    await port.frame(b"".join(parts), Flaws(gaps=dict.fromkeys(starts, port.bits(1.7))))
    assert port.outcome() == (1, 0, 1)


@cocotb.test()
async def strict_no_flip_of_the_long_limit_causes_an_early_commit(dut):
    """Flipped between t1.5 and t3.5; a commit is valid on a silent line only (commit_gate, SAFE-4)."""
    port = await Port(dut, 115_200).start()
    commits = Strobes(dut, "commit", "silent")
    timer = dut.port_i.silence_i
    for name in ("long_over", "long_silent"):
        await port.send(GOOD)
        await port.line.source.idle(port.bits(2.2))
        for strobes in (port.candidates, commits):
            strobes.clear()
        getattr(timer, name).value = 1
        await port.line.source.idle(port.bits(1.2))
        await port.send(b"\x55")
        assert (1,) not in commits.values, name
        await port.silence()
        await port.frame(GOOD)
        assert commits.values[-1:] == [(1,)] and len(port.candidates) == 1, "the next frame is accepted"


@cocotb.test()
async def strict_a_flipped_bit_in_the_uart_hides_no_start_bit(dut):
    """The revoking character is FFh of the fastest sender; flips at each tick up to the vote (SAFE-4)."""
    port = await Port(dut, 115_200).start()
    uart = dut.port_i.uart_i
    for register, mask in ((uart.driving, 1), (uart.phase, 8)):
        for tick in range(8):
            await port.send(GOOD)
            await port.line.source.idle(port.bits(2.5))
            port.clear()
            sent = cocotb.start_soon(port.send(b"\xff", Flaws(ppm=40_000)))
            while uart.state.value != START or uart.phase.value.to_unsigned() != tick:
                await port.bench.clocks()
            register.value = int(register.value) ^ mask
            await sent
            await port.silence()
            assert port.outcome() == (0, 0, 1), f"{register._name}, tick {tick}"
            await port.silence()


@cocotb.test()
async def strict_no_flip_of_the_long_limit_ends_a_revoked_frame_early(dut):
    """Another good frame that follows within t3.5 is dropped (FRAME-3, SAFE-4)."""
    port = await Port(dut, 115_200).start()
    timer = dut.port_i.silence_i
    for name in ("long_over", "long_silent"):
        await port.frame(GOOD + b"\0", Flaws(gaps={len(GOOD): port.bits(2.5)}))
        await port.send(GOOD + b"\0", Flaws(gaps={len(GOOD): port.bits(2.5)}))
        port.clear()
        await port.line.source.idle(port.bits(1))
        getattr(timer, name).value = 1
        await port.line.source.idle(port.bits(1))
        await port.frame(GOOD)
        assert port.outcome() == (0, 0, 0), name
        await port.silence()


@cocotb.test()
async def strict_good_frame_after_a_cut_off_frame_is_a_candidate_after_t15(dut):
    port = await Port(dut).start()
    for gap, outcome, counted in (
        (1.4, (0, 0, 0), {"crc": 1}),
        (1.6, (1, 1, 0), {"t15": 1}),
        (3.4, (1, 1, 0), {"t15": 1}),
        (3.6, (1, 1, 0), {"crc": 1}),
    ):
        port.clear()
        await port.frame(GOOD[:5] + GOOD, Flaws(gaps={5: port.bits(gap)}))
        assert port.outcome() == outcome and port.counted() == counted, f"{gap} characters"


@cocotb.test()
async def strict_gaps_above_t15_inside_a_frame_reject_it(dut):
    port = await Port(dut).start()
    await port.frame(GOOD, Flaws(gaps=dict.fromkeys(range(1, len(GOOD)), port.bits(1.4))))
    assert port.outcome() == (1, 1, 0)
    for place in (1, 4, len(GOOD) - 1):
        port.clear()
        await port.frame(GOOD, Flaws(gaps={place: port.bits(1.6)}))
        assert port.outcome() == (0, 0, 0), f"1.6 characters before byte {place}"


@cocotb.test()
async def lenient_characters_after_a_good_frame_extend_it(dut):
    port = await Port(dut).start()
    whole = rtu.with_crc(GOOD + b"\x11\x22")
    for gap, outcome in ((0.4, (1, 1, 0)), (1.4, (2, 1, 0)), (1.6, (2, 1, 1)), (3.4, (2, 1, 1))):
        port.clear()
        await port.frame(whole, Flaws(gaps={len(GOOD): port.bits(gap)}))
        assert port.outcome() == outcome, f"{gap} characters: {port.outcome()}"
        assert port.candidates.values[-1] == (len(whole),)
    port.clear()
    await port.frame(GOOD + GOOD, Flaws(gaps={len(GOOD): port.bits(3.6)}))
    assert port.outcome() == (2, 2, 0)


@cocotb.test()
async def lenient_gaps_below_t35_inside_a_frame_are_accepted(dut):
    port = await Port(dut).start()
    for gap in (1.4, 1.6, 3.4):
        port.clear()
        await port.frame(GOOD, Flaws(gaps=dict.fromkeys(range(1, len(GOOD)), port.bits(gap))))
        assert port.outcome()[:2] == (1, 1), f"{gap} characters"
    port.clear()
    await port.frame(GOOD, Flaws(gaps={4: port.bits(3.6)}))
    assert port.outcome() == (0, 0, 0)


# ---------------------------------------------------------------- BREAK_TOLERANT = 1


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def tolerant_a_low_after_a_good_frame_is_silence(dut, form):
    """The line stays low until the card drives. The commit comes a character after t3.5 at the latest."""
    port = await Port(dut, 115_200, form).start()
    port.memory.memory = b"\x07\x83\x40"
    dut.reply_length.value = 3
    for after in (1 / 16, 0.3, port.bits(0.6), port.bits(1.6), port.bits(3.3), port.bits(3.7)):
        port.clear()
        end = await port.send(GOOD)
        await port.line.source.idle(after)
        port.line.source.hold(0)
        await port.silence(8)
        assert port.outcome() == (1, 1, 0) and port.counted() == {}, f"{form}, low after {after} bits"
        assert -ACCURACY <= late_bits(port, port.commits, end, rtu.t35_ps(115_200)) <= 12.5
        assert dut.quiet.value == 1 and dut.silent.value == 1, "a reply may start on the low line"
        await port.bench.strobe(dut.reply_start)
        reply = await port.line.monitor.frame(1e12, gap_bits=3)
        assert reply.ok and reply.data == rtu.with_crc(b"\x07\x83\x40")
        await port.silence(8)  # low after the reply, too
        port.line.source.hold(1)
        await port.silence(1)
    port.line.check_direction()


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def tolerant_nothing_commits_or_starts_while_a_low_may_be_a_character(dut, form):
    """The low begins just before t3.5; the line is not silent until a whole character was low."""
    port = await Port(dut, 115_200, form).start()
    end = await port.send(GOOD)
    await port.line.source.idle(port.bits(3.5) - 1)
    port.line.source.hold(0)
    await port.line.source.idle(9)
    assert port.outcome() == (1, 0, 0) and dut.silent.value == 0 and dut.quiet.value == 0
    port.line.source.hold(1)  # it was a character
    await port.silence()
    assert port.outcome() == (1, 0, 1), f"{form}: {end}"


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def tolerant_a_character_revokes_as_before(dut, form):
    """00 with a good stop bit, 80 without one, and a break inside a frame."""
    port = await Port(dut, 115_200, form).start()
    for byte, bad in ((0, ()), (0x80, (0,)), (0xFF, ())):
        for after in (1.6, 3.4):
            port.clear()
            await port.send(GOOD)
            await port.line.source.idle(port.bits(after))
            await port.frame(bytes([byte]), Flaws(bad_stop=bad))
            assert port.outcome() == (1, 0, 1), f"{form}: {byte:02X}h after {after} characters"
    port.clear()
    await port.send(GOOD[:5])
    await port.line.source.send_break(14)
    await port.frame(GOOD[5:])
    assert port.outcome() == (0, 0, 0) and port.counted() == {"framing": 1}, "a break inside a frame"
    port.clear()
    await port.frame(GOOD)
    assert port.outcome() == (1, 1, 0)


@cocotb.test()
async def tolerant_a_request_after_a_break_has_its_own_crc(dut):
    """Its first start bit is held back. 00 comes as a whole before that is decided."""
    port = await Port(dut).start()
    for address in (OWN, 0):
        await port.frame(GOOD)
        await port.line.source.send_break(20, 30)
        port.clear()
        await port.frame(rtu.build(address, rtu.write_register(2, 7)))
        assert port.outcome() == (1, 1, 0) and dut.frame_broadcast.value == (address == 0)


@cocotb.test()
async def tolerant_the_first_low_after_rubbish_is_silence(dut):
    """The rubbish is a bad frame, and later a low that the receiver takes for the first character of one."""
    port = await Port(dut).start()
    await port.frame(GOOD[:-1])
    await port.line.source.send_break(20, 10)
    port.line.source.hold(0)
    await port.silence(8)
    assert dut.quiet.value == 1
    port.line.source.hold(1)
    await port.line.source.idle(5)
    port.clear()
    await port.frame(GOOD)
    assert port.outcome() == (1, 1, 0)


# ---------------------------------------------------------------- bad characters, noise


@cocotb.test()
async def character_errors_reject_the_frame_and_are_counted_by_kind(dut):
    port = await Port(dut).start()
    for place in (0, 3, len(GOOD) - 1):
        for name, flaws in (
            ("parity", Flaws(bad_parity=(place,))),
            ("framing", Flaws(bad_stop=(place,), gaps={place + 1: 1.0})),
        ):
            port.clear()
            await port.frame(GOOD, flaws)
            assert port.outcome() == (0, 0, 0) and port.counted() == {name: 1}, f"{name} in byte {place}"
    port.clear()
    await port.line.source.send_break(30)
    await port.silence()
    assert port.outcome() == (0, 0, 0) and port.counted() == {"framing": 1}, "break"
    port.clear()
    await port.frame(GOOD)
    assert port.outcome() == (1, 1, 0)


@cocotb.test()
async def glitches_in_the_silence_neither_revoke_nor_start_a_frame(dut):
    port = await Port(dut).start()
    end = await port.send(GOOD)
    await port.silence(2)
    await port.line.source.low_pulse(0.24 * port.line.fmt.bit_ps)
    await port.silence(2)
    assert port.outcome() == (1, 1, 0)
    # The silence lengthens at most by the glitch.
    late = late_bits(port, port.commits, end, rtu.t35_ps(19_200))
    assert -ACCURACY <= late <= ACCURACY + 0.24


@cocotb.test()
async def a_pulse_at_the_commit_leaves_the_line_silent(dut):
    """A pulse of any width below a quarter bit, at every tick around t3.5 (LINE-5)."""
    port = await Port(dut, 115_200).start()
    commits = Strobes(dut, "commit", "silent", "quiet")
    low = 0
    for tick, width in itertools.product(range(-8, 6), (1 / 16, 3.9 / 16)):
        port.clear()
        commits.clear()
        await port.send(GOOD)
        await port.line.source.idle(port.bits(3.5) + tick / 16)
        await port.line.source.low_pulse(width * port.line.fmt.bit_ps)
        await port.silence()
        assert port.outcome() == (1, 1, 0) and commits.values[0][0] == 1, f"tick {tick}, {width} bits"
        low += commits.values[0] == (1, 0)
    assert low >= 2, "the pin was never low at a commit"


@cocotb.test()
async def line_low_at_power_up_is_no_frame(dut):
    port = Port(dut)
    port.line.source.hold(0)
    await port.bench.start()
    await port.silence(4)
    assert len(Strobes(dut, "start_seen")) == 0
    port.line.source.hold(1)
    await port.silence(4)
    assert port.outcome() == (0, 0, 0)
    await port.frame(GOOD)
    assert port.outcome() == (1, 1, 0)


@cocotb.test()
async def a_reset_makes_a_low_line_idle(dut):
    """Serial lines reset to 1: nothing of a low before the reset counts after it."""
    port = await Port(dut).start()
    port.line.source.hold(0)
    await port.silence(1)
    assert dut.port_i.line.value == 0
    await port.bench.strobe(dut.rst)
    assert dut.port_i.synced.value == 1 and dut.port_i.line.value == 1


@cocotb.test()
async def foreign_frames_are_ignored_and_broadcasts_are_accepted(dut):
    port = await Port(dut).start()
    await port.frame(FOREIGN)
    assert port.outcome() == (0, 0, 0) and port.counted() == {}
    await port.frame(rtu.build(0, rtu.write_register(2, 7)))
    assert port.outcome() == (1, 1, 0) and dut.frame_broadcast.value == 1


# ---------------------------------------------------------------- replies


@cocotb.test()
@cocotb.parametrize(baud=(9600, 19_200, 38_400, 115_200))
async def first_bit_of_a_reply_is_never_early_for_any_sender(dut, baud):
    """The reply starts in the first clock of a committed, quiet line; senders are up to 4 % off (FRAME-8)."""
    port = await Port(dut, 115_200).start()
    for form in FORMATS:
        await use(port, baud, form)
        dut.reply_length.value = 3
        port.memory.memory = b"\x07\x83\x40"
        for ppm in (-40_000, 0, 40_000):
            end = await port.send(SHORT, Flaws(ppm=ppm))
            await port.line.source.idle(port.bits(3.2))
            while dut.quiet.value != 1:
                await port.bench.clocks()
            await port.bench.strobe(dut.reply_start)
            reply = await port.line.monitor.frame(1e12, gap_bits=3)
            fmt = port.line.fmt
            early = (end + rtu.t35_ps(baud, fmt.bits) - reply.start_ps) / fmt.bit_ps
            print(f"{port.line.fmt}, sender {ppm / 10_000:+.0f} %: first bit {-early:+.3f} bits after t3.5")
            assert early <= 0, f"{port.line.fmt}, {ppm} ppm"
            await port.silence(4)
    port.line.check_direction()


@cocotb.test()
async def echo_of_the_own_reply_is_no_request(dut):
    """The reply's echo would be a good request to this card."""
    port = await Port(dut, echo=True).start()
    await port.frame(GOOD)
    port.clear()
    assert await port.reply(GOOD[:-2]) == GOOD
    await port.silence(4)
    assert port.outcome() == (0, 0, 0) and port.counted() == {}
    await port.frame(GOOD)
    assert port.outcome() == (1, 1, 0)
    port.line.check_direction()


@cocotb.test()
async def the_loopback_tests_pattern_has_a_wrong_crc(dut):
    port = await Port(dut).start()
    dut.loopback_open.value = 1
    pattern = await port.reply(GOOD[:-2])
    assert pattern[:-2] == GOOD[:-2] and len(pattern) == len(GOOD)
    assert all(byte != right for byte, right in zip(pattern[-2:], GOOD[-2:], strict=True))
    dut.loopback_open.value = 0
    await port.silence(4)
    assert await port.reply(GOOD[:-2]) == GOOD


@cocotb.test()
async def port_is_quiet_only_after_t35_of_silence(dut):
    port = await Port(dut).start()
    assert dut.quiet.value == 1
    sending = cocotb.start_soon(port.send(GOOD))
    await port.line.source.idle(1)
    quiet_clocks = Strobes(dut, "quiet")
    end = await sending
    assert len(quiet_clocks) == 0, "quiet between two bytes"
    while dut.quiet.value == 0:
        await port.bench.clocks()
    late = (now_ps() - end - rtu.t35_ps(19_200)) / port.line.fmt.bit_ps
    assert abs(late) <= ACCURACY
    await port.reply(b"\x07\x83\x40")
    assert dut.quiet.value == 0, "its own reply is traffic too"
    await port.silence(4)
    assert dut.quiet.value == 1
    begin = now_ps()
    sending = cocotb.start_soon(port.send(b"\x55"))
    while dut.quiet.value == 1:
        await port.bench.clocks()
    assert (now_ps() - begin) < ACCURACY * port.line.fmt.bit_ps, "over with the first start edge"
    await sending


@cocotb.test()
async def reply_of_any_length_leaves_without_a_gap(dut):
    rng = seeded("replies")
    port = await Port(dut, 115_200).start()
    for length in (2, 3, 5, 8, 24, 31):
        contents = rng.randbytes(32)
        port.memory.reads.clear()
        assert await port.reply(contents, length) == rtu.with_crc(contents[:length])
        assert port.memory.reads == list(range(length)), "each byte is read once"
        await port.silence()
    port.line.check_direction()


@cocotb.test()
async def reply_with_a_byte_damaged_at_any_time_has_a_wrong_crc_and_no_other_has(dut):
    """The bytes leave as they were read, whenever the memory finds one damaged (SAFE-4)."""
    rng = seeded("damage")
    port = await Port(dut, 115_200).start()
    contents = rng.randbytes(4)
    character = 16 * port.line.fmt.bits
    await port.bench.strobe(dut.read_damaged)  # of an earlier access
    assert await port.reply(contents) == rtu.with_crc(contents)
    # The first byte, each later one, and the first bits of the CRC.
    for clocks in (2, *(n * character + rng.randrange(character) for n in range(4)), 4 * character + 20):
        await port.silence()
        replying = cocotb.start_soon(port.reply(contents))
        await RisingEdge(dut.sending)
        await port.bench.clocks(clocks)
        await port.bench.strobe(dut.read_damaged)
        sent = await replying
        assert sent[:4] == contents and len(sent) == 6
        assert not crc_good(sent), f"damage {clocks} clocks after the start: {sent.hex(' ')}"
        await port.silence()
        assert await port.reply(contents) == rtu.with_crc(contents)


@cocotb.test()
async def reply_is_over_with_its_last_stop_bit(dut):
    port = await Port(dut, 115_200).start()
    replying = cocotb.start_soon(port.reply(b"\x01\x03\x02\x12\x34"))
    await FallingEdge(dut.sending)
    late = (now_ps() - port.line.monitor.characters[-1].end_ps) / port.line.fmt.bit_ps
    assert 0 <= late < 0.2, f"{late:.2f} bits"
    await replying


@cocotb.test()
async def reply_whose_length_shrinks_ends_after_the_whole_memory(dut):
    """The count has already passed the new length: 32 bytes and their CRC are sent, and no more (SAFE-2)."""
    port = await Port(dut, 115_200).start()
    contents = seeded("shrinks").randbytes(32)
    replying = cocotb.start_soon(port.reply(contents, 20))
    while len(port.memory.reads) < 12:
        await port.bench.clocks()
    dut.reply_length.value = 5
    assert await replying == rtu.with_crc(contents)
    port.line.check_direction()


@cocotb.test()
async def reply_ends_with_a_reset(dut):
    port = await Port(dut, 115_200).start()
    dut.reply_length.value = 10
    await port.bench.strobe(dut.reply_start)
    await port.bench.clocks(600)
    assert dut.de.value == 1
    await port.bench.strobe(dut.rst)
    await port.bench.clocks()
    assert dut.de.value == 0 and dut.tx.value == 1 and dut.sending.value == 0


@cocotb.test()
async def bytes_received_while_sending_are_ignored(dut):
    port = await Port(dut).start()
    replying = cocotb.start_soon(port.reply(bytes(20)))
    await port.bench.clocks(200)
    await port.send(GOOD)
    await replying
    await port.silence(4)
    assert port.outcome() == (0, 0, 0) and port.counted() == {}


# Scenarios of many frames, or of one frame a register.
LONG = [
    "strict_character_after_a_good_frame_revokes_it_before_t35",
    "strict_a_flipped_bit_in_the_uart_hides_no_start_bit",
    "a_pulse_at_the_commit_leaves_the_line_silent",
]


OTHER_RUNS = ("lenient_", "tolerant_", "both_", "first_")


def run_port(sim: str, *testcase: str, **parameters: int) -> None:
    run(
        "network_line",
        "tb.rtl.test_network_port",
        sim=sim,
        extra_sources=[WRAPPER],
        parameters=parameters,
        testcase=testcase,
    )


@on_verilator
@pytest.mark.rule(
    *("LINE-1", "LINE-2", "LINE-3", "LINE-6", "FRAME-1", "FRAME-2", "FRAME-3", "FRAME-4", "FRAME-5"),
    *("FRAME-6", "FRAME-8", "LINE-5", "SAFE-2", "SAFE-4", "LOOP-1"),
)
def test_network_port(sim):
    run_port(sim, rf"(?!{'|'.join((*LONG, *OTHER_RUNS))})\w+")


@pytest.mark.nightly
@pytest.mark.rule("FRAME-2", "FRAME-3", "FRAME-6", "LINE-5", "SAFE-4")
def test_network_port_at_length():
    run_port("verilator", *LONG)


@pytest.mark.rule("LINE-2", "FRAME-1")
@pytest.mark.parametrize("rates", first(["(9600|19200|38400|115200)", ".*"]), ids=["fast", "all"])
def test_silences_at_every_rate(rates):
    """A character at 300 bit/s takes 70,000 clocks."""
    run_port("verilator", f"both_silences_are_exact_from_the_pin_at_every_rate/baud={rates}")


@pytest.mark.rule("FRAME-8", "LINE-5")
@pytest.mark.parametrize("rates", first(["(19200|115200)", ".*"]), ids=["two", "all"])
def test_reply_to_a_slow_sender(rates):
    run_port("verilator", f"first_bit_of_a_reply_is_never_early_for_any_sender/baud={rates}")


@on_verilator
@pytest.mark.rule("FRAME-3")
def test_network_port_lenient(sim):
    run_port(sim, r"lenient_\w+", STRICT_T15=0)


@pytest.mark.rule("FRAME-3", "FRAME-6", "FRAME-8", "SAFE-2", "SAFE-3")
@pytest.mark.parametrize("cases", first(["tolerant_the.*", "(tolerant|a_pulse_at_the_commit_leaves)_.*"]))
def test_network_port_on_a_bus_without_bias(cases: str):
    run_port("verilator", cases, BREAK_TOLERANT=1)


@pytest.mark.nightly
@pytest.mark.rule("LINE-5")
def test_a_pulse_at_the_commit_without_t15():
    run_port("verilator", "a_pulse_at_the_commit_leaves_the_line_silent", STRICT_T15=0)
