# SPDX-License-Identifier: Apache-2.0
"""The card after power-up: boot time, LEDs, switches, and faults that must keep it from starting.

At a slow clock, unless a test is about the clock. No timer is shortened.
"""

from __future__ import annotations

import random
from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import Timer

from rtl.sources import configuration
from sw.tools.bin2hex import LANE_BITS, WORD_BITS
from tb.agents import rtu
from tb.agents.fc_slave import Script
from tb.lib.bench import Bench
from tb.lib.card import MS, baud_switches, switch_word
from tb.lib.config import CLK_HZ, SLOW_HZ, boot_clocks, own_hz
from tb.lib.fast_card import LEDS, RESET_CLOCKS, FastCard, Shown, steps_ms
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.lib.starts import check_start
from tb.lib.supervision import (
    BITE_MS,
    WatchedCard,
    constant_word,
    control_pdu,
    firmware_words,
    function_words,
    process,
    write_image,
)

BAUD = 38_400
STEP_MS = 250
SHOW = ("red", "green", "orange", "off")
ACCURACY = 0.01
ALL_SWITCHES = {"sw_baud": 0x1FF, "sw_addr": 0xFF}
# The card reads the switches 1/1200 s after a reset (rtl/card_time.v), later than this.
SETTLED_MS = 0.7
READ_DRIVE_TIMEOUT = rtu.read_registers(2, 1)
DRIVE_TIMEOUT = bytes.fromhex("03 02 00 0F")
IMAGES = 12  # with flipped bits


def near(ms: float, expected: float) -> bool:
    return abs(ms - expected) <= ACCURACY * expected


# ---------------------------------------------------------------- boot


@pytest.mark.rule("BOOT-1")
def test_boot(config):
    """At the card's own clock, the first request that ends with the boot time is answered."""
    assert configuration(config)["boot_ms"] == {"standard": 20, "tiny": 60}[config]
    with FastCard(config=config, baud=BAUD, clk_hz=own_hz(config)) as card:
        card.run_until(RESET_CLOCKS * card.period_ps)
        check_start(card, card.now_ps)
        card.modbus.check()


# ---------------------------------------------------------------- drivers without a clock


@cocotb.test()
async def reset_switches_both_drivers_off_without_a_clock(dut):
    """The flip-flops of DE may hold anything when there was no clock yet (SAFE-6)."""
    bench = await Bench(dut, CLK_HZ, sw_baud=0, sw_addr=1, modbus_rx=1, drive_rx=1).start(reset_clocks=10)
    await bench.clocks(10)
    for drivers in ((1, 0), (0, 1), (1, 1)):
        bench.clock.stop()
        dut.modbus_limit_i.de.value, dut.drive_limit_i.de.value = drivers
        await Timer(1, unit="ns")
        assert (int(dut.modbus_de.value), int(dut.drive_de.value)) == drivers
        # The clock stands still.
        dut.rst_n.value = 0
        for _ in range(3):
            await Timer(1, unit="ns")
            assert not int(dut.modbus_de.value) and not int(dut.drive_de.value)
        bench.clock.start()
        await bench.clocks(4)
        dut.rst_n.value = 1
        for _ in range(20):
            await bench.clocks()
            assert not int(dut.modbus_de.value) and not int(dut.drive_de.value)


@pytest.mark.rule("SAFE-6")
@pytest.mark.parametrize("card", ["standard", pytest.param("tiny", marks=pytest.mark.nightly)])
def test_drivers_in_reset(card: str):
    """On Icarus, which compiles the card in two seconds."""
    parameters = {"CLK_HZ": SLOW_HZ[card]}
    run("rtu2fc", "tb.card.test_card_power_up", sim="icarus", config=card, parameters=parameters)


@pytest.mark.rule("SAFE-6")
def test_drivers_in_reset_while_they_send(config):
    with FastCard(config=config, baud=BAUD) as card:
        card.run(card.boot_ms)
        for adu, line in (
            (rtu.build(1, READ_DRIVE_TIMEOUT), card.modbus),
            (rtu.build(1, control_pdu(0x047C, 0x1999)), card.drive),
        ):
            assert card.run_until(card.modbus.send(adu, 5 * MS) + 40 * MS, f"{line.name}_de")
            card.run(0.5)
            begin = card.now_ps
            assert line.driven
            card.reset()
            assert not line.driven and line.de[-1][0] <= begin + card.period_ps
            card.run(card.boot_ms)


# ---------------------------------------------------------------- switches


@pytest.mark.rule("LINE-2", "LINE-3", "LINE-7", "LINE-8")
def test_switches_moved_after_power_up_have_no_effect_until_the_next_reset(config):
    address, form = 0b0101_0101, "8E1"
    settings = {"sw_baud": switch_word(baud_switches(BAUD, form)), "sw_addr": address}
    with FastCard(config=config, baud=BAUD, form=form, address=address) as card:
        card.run(card.boot_ms)
        # First each group alone, then all seventeen switches at once; the last setting is valid too.
        for moved in ({"sw_baud": 0b111}, {"sw_baud": 0b11000}, {"sw_addr": 0xFF}, ALL_SWITCHES):
            card.set(**{name: settings[name] ^ bits for name, bits in moved.items()})
            assert card.request(rtu.build(address, READ_DRIVE_TIMEOUT)).data == rtu.build(
                address, DRIVE_TIMEOUT
            )
            card.set(**settings)
        other = {name: settings[name] ^ bits for name, bits in ALL_SWITCHES.items()}
        card.set(**other)
        ask = rtu.build(other["sw_addr"], READ_DRIVE_TIMEOUT)
        assert card.request(ask, 5) is None, "not yet the address that the switches show now"
        # The next reset reads the switches as they are then.
        card.set(sw_baud=switch_word(baud_switches(BAUD, form, "1111")))
        card.reset()
        card.run(card.boot_ms)
        assert card.request(ask).data == rtu.build(other["sw_addr"], DRIVE_TIMEOUT)
        card.modbus.check()


@pytest.mark.rule("LINE-7", "LED-5")
def test_an_invalid_address_turns_both_leds_red_and_keeps_both_lines_silent(config):
    with WatchedCard(config, baud=BAUD, address=0) as card:
        for address in (0, 248, 255):
            card.set(sw_addr=address)
            card.reset()
            card.run(1)
            assert card.fault
            shown = {led: len(history) for led, history in card.shown.items()}
            # This wait and the requests together take longer than a start.
            for to in dict.fromkeys((address, 0, 1)):
                card.run(0.3 * card.boot_ms)
                card.modbus.send(rtu.build(to, control_pdu(0x047C, 0x1999)))
                card.quiet(13, f"a request to {to}, switches {address}")
            assert {led: len(history) for led, history in card.shown.items()} == shown, "solid"
        assert not card.modbus.de and not card.drive.de
        assert all(level for line in (card.modbus, card.drive) for _, level in line.tx)
        card.set(sw_addr=247)
        card.reset()
        card.boot()
        assert not card.fault
        card.address = 247
        card.ask(READ_DRIVE_TIMEOUT, DRIVE_TIMEOUT)
        card.check_lines()


@pytest.mark.rule("LINE-8")
def test_switches_that_settle_late_are_read_right_after_any_reset():
    """The pull-ups charge the lines of the switches meanwhile. The time since the last reset varies.

    Until then the switches show an address that would be a fault.
    """
    later = seeded("times between resets")
    with FastCard(baud=BAUD, form="8N2", address=1) as card:
        card.run(card.boot_ms)
        for _ in range(8):
            card.run(later.uniform(0, 10))
            released = card.reset()
            card.set(sw_addr=0)
            card.plan(released + SETTLED_MS * MS, "sw_addr", 1)
            card.run(card.boot_ms)
            assert card.request(rtu.build(1, READ_DRIVE_TIMEOUT)), "not the address of the settled switches"


# ---------------------------------------------------------------- damaged image


def two_bits_of_a_byte(rng: random.Random) -> tuple[int, int]:
    """Two bits of one byte, whose flips parity does not detect."""
    byte = LANE_BITS * rng.randrange(4)
    first, second = rng.sample(range(8), 2)
    return byte + first, byte + second


def check_fault(config: str, folder: Path, word: int, bits: tuple[int, ...], limit_ms: float) -> None:
    """A card with this image ends in the fault, and never sends."""
    words = firmware_words(config)
    words[word] ^= sum(1 << bit for bit in bits)
    with WatchedCard(config, baud=BAUD, dialect=write_image(folder, words)) as card:
        card.until_fault(limit_ms * MS, f"word {word} bits {bits}")
        assert not card.modbus.de and not card.drive.de
        assert all(level for line in (card.modbus, card.drive) for _, level in line.tx)


@pytest.mark.rule("LED-5", "SAFE-4")
@pytest.mark.parametrize("bits", [1, 2])
def test_image_damaged_in_the_file(config, bits: int, tmp_path: Path):
    """Wrong checksums halt the card; after a flipped bit the watchdog bites, three times."""
    flipped = two_bits_of_a_byte(seeded("damaged bits of the file"))[:bits]
    check_fault(config, tmp_path, constant_word(config), flipped, 3 * boot_ms(config))


def boot_ms(config: str) -> float:
    """Time of BOOT-1 at the slow clock."""
    return boot_clocks(config) * 1000 / SLOW_HZ[config]


@pytest.mark.rule("LED-5", "SAFE-4")
def test_image_damaged_anywhere(config, tmp_path: Path):
    """Parity finds one flip. Of two, the checksums find them, or the program traps or hangs three times.

    Two in the code that checks may stop the check, and the card works on (docs/hardening.md).
    """
    rng = seeded("flipped bits of the image")
    for _ in range(IMAGES):
        word = rng.randrange(len(firmware_words(config)))
        bits = rng.choice((two_bits_of_a_byte(rng), (rng.randrange(WORD_BITS),)))
        if word in function_words(config, "check"):
            bits = bits[:1]
        check_fault(config, tmp_path, word, bits, 3 * (BITE_MS + boot_ms(config)))


@pytest.mark.nightly
@pytest.mark.rule("LED-5", "SAFE-4")
@pytest.mark.parametrize("bits", [1, 2])
def test_image_damaged_while_running(config, bits: int):
    """Reading for the checksums detects one flipped bit by parity; two of a byte make a checksum wrong.

    The second holds at the card's own clock: on a slower one SERV has time for no word in most rounds.
    PicoRV32 keeps it at the slow clock, too.
    """
    rng = seeded("damaged bits")
    with WatchedCard(config, baud=BAUD, clk_hz=own_hz(config) if config == "tiny" else None) as card:
        card.boot()
        card.check_alive()
        card.damage(constant_word(config), *two_bits_of_a_byte(rng)[:bits])
        limit = card.now_ps + 1000 * MS
        while not card.fault:
            assert card.run_until(limit, *LEDS), "no fault"
        card.until_fault(limit, "damaged while running")
        assert card.sent() == (1, 0)


# ---------------------------------------------------------------- LEDs, all of it


def after_power_up(history: list[Shown]) -> list[Shown]:
    """The history without the clocks before the switches are read."""
    return [shown for shown in history if shown.since_ps > 1 * MS]


@pytest.mark.rule("LED-1")
def test_power_up_show_lights_one_led_after_the_other_and_delays_nothing(config):
    script = Script()
    with FastCard(config=config, baud=BAUD, form="8N2", drive=script) as card:
        card.run(card.boot_ms)
        while card.now_ps < 2000 * MS:
            # About ten local requests and exchanges with the drive per second.
            assert card.request(rtu.build(1, READ_DRIVE_TIMEOUT)).data == rtu.build(1, DRIVE_TIMEOUT)
            script.expect(*process(0x047C, 0x1999))
            pdu = control_pdu(0x047C, 0x1999)
            assert card.request(rtu.build(1, pdu)).data == rtu.build(1, pdu[:5])
            card.run(100)
        card.run(200)
        script.check()
        drive, modbus = (after_power_up(card.shown[led]) for led in ("drive", "modbus"))
        print("drive", steps_ms(drive), "network", steps_ms(modbus))
        assert [s.colour for s in drive][:4] == list(SHOW)
        assert [s.colour for s in modbus][:4] == list(SHOW)
        for colour, ms in [*steps_ms(drive)[:3], *steps_ms(modbus)[:4]]:
            # A round of the poll loop that prepares a telegram may fall before or after the change.
            late = {"standard": 0, "tiny": 5}[config]
            assert abs(ms - STEP_MS) <= ACCURACY * STEP_MS + late, f"{colour} for {ms:.2f} ms"
        # The network LED follows the drive LED's dark quarter second.
        assert near((modbus[0].since_ps - drive[3].since_ps) / MS, STEP_MS)
        assert near((modbus[3].since_ps - drive[0].since_ps) / MS, 7 * STEP_MS)
