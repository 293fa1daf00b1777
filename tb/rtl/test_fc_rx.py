# SPDX-License-Identifier: Apache-2.0
"""fc_rx byte by byte: which telegrams are a reply, where their data goes, how all others are handled.

tick16 is held high, so a clock is a tick of 1/16 bit. The bench drives the silence strobe.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cocotb
import pytest

from regs.generated.card_tables import CHARACTER_BITS, TICKS_PER_BIT
from tb.lib.bench import Bench, Strobes
from tb.lib.memory_ports import WritePort, at_once
from tb.lib.nightly import on_verilator
from tb.lib.runner import ROOT, run
from tb.lib.seeds import cases, seeded
from tb.model.fc_telegram import ADR, ADR_BROADCAST, build, build_parameter, build_process, build_text

CHARACTER = CHARACTER_BITS * TICKS_PER_BIT
INPUTS = """
    bit_valid bit_data byte_valid byte_data byte_parity_error byte_framing_error start_seen long_reached
    listen_start listen_stop
""".split()  # noqa: SIM905 (a table reads better than a list)
BITS = 9  # clocks for the bits of a byte, before its strobe
BRISK = 20  # ticks from byte to byte in tests that do not depend on time
STATUS = build_process(0x0F07, 0x2000)
NUMBER = build_parameter(1, 518, 0, 0x0001_86A0, 0x0F07, 0x2000)
LGE_PLACE = 28
TEXT_LENGTHS = (0, 1, 20, 21, 40, 243)


def text_reply(length: int) -> bytes:
    return build_text(533, bytes(0x20 + n % 95 for n in range(length)), 0x0400, 0x0F07, 0x2123)


def broken_bcc(telegram: bytes, mask: int = 1) -> bytes:
    return telegram[:-1] + bytes([telegram[-1] ^ mask])


def place(index: int) -> int:
    """Address of data byte `index` in the drive frame."""
    return index if index < 24 else 24 + index % 4


def accesses(telegram: bytes) -> list[tuple[int, int]]:
    """Writes of a telegram to the drive frame, in order."""
    return [(LGE_PLACE, telegram[1]), *((place(i), byte) for i, byte in enumerate(telegram[3:-1]))]


def image(telegram: bytes) -> dict[int, int]:
    """The drive frame after a telegram."""
    return dict(accesses(telegram))


class Receiver:
    """fc_rx, listening for ADR; `after` holds (candidate, good) after each byte of the last telegram."""

    def __init__(self, dut, delay: Callable[[], int] = at_once):
        self.dut = dut
        self.bench = Bench(dut, tick16=1, adr=ADR, **dict.fromkeys(INPUTS, 0))
        self.drive_frame = WritePort(self.bench, "byte_data", delay)
        self.bad = Strobes(dut, "bad")
        self.after: list[tuple[int, int]] = []

    async def start(self, listen: bool = True) -> Receiver:
        await self.bench.start()
        if listen:
            await self.listen()
        return self

    async def listen(self) -> None:
        await self.bench.strobe(self.dut.listen_start)

    async def stop(self) -> None:
        await self.bench.strobe(self.dut.listen_stop)

    async def silence(self) -> None:
        """A silence of more than two characters."""
        await self.bench.strobe(self.dut.long_reached)
        await self.bench.clocks(2)

    async def byte(
        self,
        value: int,
        ticks: int = BRISK,
        parity_error: int = 0,
        framing_error: int = 0,
        listen: bool = False,
    ) -> None:
        """Receives one byte; `ticks` is the distance to the next one. `listen` starts listening inside it."""
        await self.bench.line_bits(value)
        if listen:
            await self.listen()
        self.dut.byte_data.value = value
        self.dut.byte_parity_error.value, self.dut.byte_framing_error.value = parity_error, framing_error
        self.dut.byte_valid.value = 1
        await self.bench.clocks()
        self.dut.byte_valid.value = 0
        self.after.append((int(self.dut.candidate.value), int(self.dut.good.value)))
        if ticks > 1 + BITS:
            await self.bench.clocks(ticks - 1 - BITS)

    async def telegram(
        self,
        data: bytes,
        ticks: int | Sequence[int] = BRISK,
        parity_error: int | None = None,
        framing_error: int | None = None,
    ) -> bool:
        """Receives a whole telegram, with flaws at byte numbers; returns whether it was good."""
        self.after = []
        for n, value in enumerate(data):
            step = ticks if isinstance(ticks, int) else [*ticks, BRISK][n]
            await self.byte(value, step, int(n == parity_error), int(n == framing_error))
        return self.good

    @property
    def good(self) -> bool:
        return bool(int(self.dut.good.value))

    @property
    def listening(self) -> bool:
        return bool(int(self.dut.listening.value))

    async def must_recover(self, bad: int) -> None:
        """Checks that the bad telegram was counted once, and is forgotten after a silence, not before."""
        assert not self.good and not int(self.dut.candidate.value)
        assert len(self.bad) == bad
        assert not await self.telegram(STATUS), "accepted without a silence before it"
        await self.silence()
        assert await self.telegram(NUMBER)
        assert self.drive_frame.memory.items() >= image(NUMBER).items()
        assert len(self.bad) == bad, "counted more than once"
        await self.listen()


@cocotb.test()
async def process_and_parameter_replies_are_good_and_their_data_is_kept(dut):
    rx = await Receiver(dut).start()
    for telegram in (STATUS, NUMBER):
        rx.drive_frame.written.clear()
        await rx.listen()
        assert await rx.telegram(telegram)
        assert rx.drive_frame.written == accesses(telegram)
    assert not len(rx.bad)


@cocotb.test()
@cocotb.parametrize(length=TEXT_LENGTHS)
async def texts_of_any_length_are_received_in_full(dut, length):
    telegram = text_reply(length)
    rx = await Receiver(dut).start()
    assert await rx.telegram(telegram)
    data = telegram[3:-1]
    kept = rx.drive_frame.memory
    assert kept == image(telegram)
    assert bytes(kept[i] for i in range(min(len(data), 24))) == data[:24]
    last = range(len(data) - 4, len(data))
    assert bytes(kept[place(i)] for i in last) == b"\x0f\x07\x21\x23", "PCD1 and PCD2"
    assert kept[LGE_PLACE] == 10 + length


@cocotb.test()
async def candidate_rises_with_the_last_data_byte_and_good_with_the_bcc(dut):
    rx = await Receiver(dut).start()
    for telegram in (STATUS, NUMBER, text_reply(21)):
        await rx.listen()
        await rx.telegram(telegram)
        assert rx.after == [(0, 0)] * (len(telegram) - 2) + [(1, 0), (0, 1)]
        await rx.bench.clocks(3 * CHARACTER)
        assert rx.good


@cocotb.test()
async def bytes_that_are_not_stx_are_ignored_before_a_good_telegram(dut):
    rx = await Receiver(dut).start()
    for phantom in (0x00, 0x03, 0x82, 0xFF):
        await rx.byte(phantom)
        await rx.byte(0x00, framing_error=1)
        await rx.byte(0x02, parity_error=1)
        assert rx.listening and await rx.telegram(STATUS)
        await rx.listen()
    assert not len(rx.bad)


@cocotb.test()
async def a_length_below_6_is_bad(dut):
    rx = await Receiver(dut).start()
    for n, lge in enumerate(range(6), 1):
        body = bytes([0x02, lge, ADR, 0x0F, 0x07])
        assert not await rx.telegram(body)
        await rx.must_recover(bad=n)


@cocotb.test()
async def a_reply_from_another_address_is_bad(dut):
    rx = await Receiver(dut).start()
    for n, adr in enumerate((ADR_BROADCAST, ADR ^ 0x02, ADR & 0x7F, 0x00, 0xFF), 1):
        assert not await rx.telegram(build_process(0x0F07, 0, adr))
        await rx.must_recover(bad=n)
    dut.adr.value = 0x21  # the reply must carry the ADR that was sent
    assert await rx.telegram(build_process(0x0F07, 0, 0x21))


@cocotb.test()
@cocotb.parametrize(flaw=("parity_error", "framing_error"))
async def a_damaged_character_anywhere_after_stx_is_bad(dut, flaw):
    rx = await Receiver(dut).start()
    for n in range(1, len(NUMBER)):
        assert not await rx.telegram(NUMBER, **{flaw: n})
        await rx.must_recover(bad=n)


@cocotb.test()
async def every_wrong_bit_of_the_bcc_and_of_the_data_is_found(dut):
    rng = seeded("bits")
    rx = await Receiver(dut).start()
    wrong = [(len(NUMBER) - 1, bit) for bit in range(8)]
    wrong += [(n, rng.randrange(8)) for n in range(3, len(NUMBER) - 1)]
    for count, (n, bit) in enumerate(wrong, 1):
        damaged = NUMBER[:n] + bytes([NUMBER[n] ^ 1 << bit]) + NUMBER[n + 1 :]
        assert not await rx.telegram(damaged), f"byte {n}, bit {bit}"
        # The firmware may have prepared a reply; it must not be sent.
        assert rx.after[-2:] == [(1, 0), (0, 0)]
        await rx.must_recover(bad=count)


@cocotb.test()
async def a_silence_inside_a_telegram_ends_it_and_the_next_one_is_accepted_at_once(dut):
    rx = await Receiver(dut).start()
    for n in range(1, len(STATUS)):
        await rx.telegram(STATUS[:n])
        await rx.silence()
        assert len(rx.bad) == n and not int(dut.candidate.value)
        assert rx.listening
        assert await rx.telegram(NUMBER), f"after {n} bytes"
        await rx.listen()


@cocotb.test()
async def silences_before_and_after_a_telegram_have_no_effect(dut):
    rx = await Receiver(dut).start()
    for _ in range(3):
        await rx.silence()
    assert await rx.telegram(STATUS)
    await rx.silence()
    assert rx.good and not len(rx.bad)


def steps(telegram: bytes, total: int, where: str) -> list[int]:
    """Ticks from byte to byte, so that the telegram takes `total` from first start bit to last stop bit.

    The time beyond the nominal one goes into gaps of up to 2 characters: first, last or everywhere.
    """
    count = len(telegram) - 1
    spare = total - CHARACTER * len(telegram)
    if where == "everywhere":
        gaps = [spare // count + (n < spare % count) for n in range(count)]
    else:
        gaps = []
        for _ in range(count):
            gaps.append(min(spare, 2 * CHARACTER))
            spare -= gaps[-1]
    return [CHARACTER + gap for gap in (gaps[::-1] if where == "last" else gaps)]


@cocotb.test()
@cocotb.parametrize(where=("first", "last", "everywhere"))
async def a_telegram_may_take_one_and_a_half_times_its_nominal_time_and_no_tick_more(dut, where):
    rx = await Receiver(dut).start()
    for n, telegram in enumerate((STATUS, NUMBER, text_reply(20)), 1):
        limit = CHARACTER * len(telegram) * 3 // 2
        assert await rx.telegram(telegram, steps(telegram, limit, where))
        await rx.listen()
        assert not await rx.telegram(telegram, steps(telegram, limit + 1, where))
        assert len(rx.bad) == n
        await rx.listen()


@cocotb.test()
async def the_longest_telegram_is_good_without_gaps_or_just_in_time(dut):
    telegram = build(bytes(range(251)) + b"\x0f\x07")
    assert telegram[1] == 0xFF
    rx = await Receiver(dut).start()
    assert await rx.telegram(telegram, CHARACTER)
    await rx.listen()
    limit = CHARACTER * len(telegram) * 3 // 2
    assert await rx.telegram(telegram, steps(telegram, limit, "first"))
    await rx.listen()
    assert not await rx.telegram(telegram, steps(telegram, limit + 1, "last"))


@cocotb.test()
async def time_limit_expires_while_noise_keeps_the_line_busy(dut):
    """Noise without a character prevents a silence; the time limit must expire all the same."""
    rx = await Receiver(dut).start()
    for slots in (100, 1100):
        for value in STATUS[:-1]:
            await rx.byte(value)
        await rx.bench.clocks(slots * CHARACTER * 3 // 2)
        await rx.byte(STATUS[-1])
        assert not rx.good, f"{slots} characters late"
        await rx.listen()


@cocotb.test()
async def a_hunt_that_begins_inside_stx_still_checks_the_whole_telegram(dut):
    """The firmware may start listening while the next telegram's first byte is on the line."""
    rx = await Receiver(dut).start()
    assert await rx.telegram(NUMBER)
    await rx.byte(0x5A)
    await rx.byte(STATUS[0], listen=True)
    for value in STATUS[1:]:
        await rx.byte(value)
    assert rx.good and not len(rx.bad)


@cocotb.test()
async def time_is_counted_in_ticks_only(dut):
    rng = seeded("clocks without a tick")
    rx = await Receiver(dut).start()
    limit = CHARACTER * len(STATUS) * 3 // 2
    for late in (0, 1):
        for value, ticks in zip(STATUS, [*steps(STATUS, limit + late, "everywhere"), 1], strict=True):
            await rx.byte(value, ticks)
            dut.tick16.value = 0
            await rx.bench.clocks(rng.randint(1, 3 * CHARACTER))
            dut.tick16.value = 1
        assert rx.good == (not late)
        await rx.listen()


@cocotb.test()
async def telegrams_before_listen_start_and_after_listen_stop_are_ignored(dut):
    rx = await Receiver(dut).start(listen=False)
    assert not rx.listening and not await rx.telegram(STATUS)
    await rx.listen()
    assert rx.listening
    await rx.stop()
    assert not rx.listening and not await rx.telegram(STATUS) and not await rx.telegram(broken_bcc(STATUS))
    assert not len(rx.bad) and not rx.drive_frame.written


@cocotb.test()
async def listen_stop_abandons_a_telegram_half_way(dut):
    rx = await Receiver(dut).start()
    for n in range(1, len(STATUS)):
        await rx.telegram(STATUS[:n])
        await rx.stop()
        assert not rx.listening and not int(dut.candidate.value)
        await rx.telegram(STATUS[n:])
        assert not rx.good
        await rx.listen()
        assert not rx.good and await rx.telegram(STATUS)
        await rx.listen()
    assert not len(rx.bad)


@cocotb.test()
async def good_holds_until_the_next_listen_start(dut):
    rx = await Receiver(dut).start()
    assert await rx.telegram(STATUS)
    kept = list(rx.drive_frame.written)
    assert await rx.telegram(NUMBER), "the first one is still good"
    await rx.telegram(broken_bcc(NUMBER))
    assert rx.good and rx.drive_frame.written == kept
    await rx.listen()
    assert not rx.good and rx.listening
    assert await rx.telegram(NUMBER)
    assert rx.drive_frame.memory == image(NUMBER)
    await rx.stop()
    assert not rx.good and not len(rx.bad)


@cocotb.test()
async def listen_start_ends_the_wait_for_a_silence(dut):
    rx = await Receiver(dut).start()
    await rx.telegram(broken_bcc(STATUS))
    await rx.listen()
    assert await rx.telegram(STATUS)


@cocotb.test()
async def reset_stops_listening_and_storing(dut):
    rx = await Receiver(dut, delay=lambda: 4 * BRISK).start()
    await rx.telegram(STATUS[:4])
    assert int(dut.write_valid.value)
    await rx.bench.strobe(dut.rst)
    assert not rx.listening and not int(dut.write_valid.value)
    assert not await rx.telegram(STATUS)


@cocotb.test()
async def a_slow_memory_gets_every_byte_once(dut):
    rng = seeded("delays")
    rx = await Receiver(dut, delay=lambda: rng.randint(0, BRISK - 4)).start()
    for length in (0, 20, 21, 60):
        rx.drive_frame.written.clear()
        telegram = text_reply(length)
        assert await rx.telegram(telegram)
        assert rx.drive_frame.written == accesses(telegram)
        await rx.listen()


@cocotb.test()
async def random_good_and_bad_telegrams_are_distinguished(dut):
    rng = seeded("telegrams")
    rx = await Receiver(dut, delay=lambda: rng.randint(0, 5)).start()
    bad = 0
    for n in range(cases(40, 120)):
        telegram = build(rng.randbytes(rng.choice((4, 12, rng.randint(4, 60)))))
        at, good = rng.randrange(2, len(telegram)), rng.random() < 0.6
        if good:
            assert await rx.telegram(telegram), f"telegram {n}: {telegram.hex()}"
            assert rx.drive_frame.memory.items() >= image(telegram).items()
        else:
            telegram = telegram[:at] + bytes([telegram[at] ^ rng.randint(1, 255)]) + telegram[at + 1 :]
            assert not await rx.telegram(telegram), f"telegram {n}: {telegram.hex()}"
            bad += 1
        await rx.silence()
        assert len(rx.bad) == bad
        if good or rng.random() < 0.5:
            await rx.listen()


@on_verilator
@pytest.mark.rule("FC-1", "FC-2", "FC-7", "FC-8", "SAFE-3")
def test_fc_rx(sim):
    run("fc_rx_bcc", "tb.rtl.test_fc_rx", sim=sim, extra_sources=[ROOT / "tb/rtl/fc_rx_bcc.v"])
