# SPDX-License-Identifier: Apache-2.0
"""The card after power-up: boot time, LEDs, switches, and faults that must keep it from starting.

Both simulators run the real firmware. Icarus reaches about 25000 clocks a second, so it sees only the first
step of the power-up show. Tests of several seconds run on the Verilated card without cocotb (`FastCard`), at
a slow clock. No timer is shortened.
"""

from __future__ import annotations

import random

import cocotb
import pytest
from cocotb.triggers import RisingEdge, Timer

from rtl.sources import ROOT, configuration
from sw.tools.bin2hex import LANE_BITS, WORD_BITS, hex_line
from sw.tools.stack import symbols
from tb.agents import rtu
from tb.agents.fc_slave import Script
from tb.agents.uart import Format, now_ps, sleep_until
from tb.lib.bench import Bench
from tb.lib.card import MS, baud_switches, switch_word
from tb.lib.config import CLK_HZ, CONFIG, ROUNDS_MS, SLOW_HZ, own_hz
from tb.lib.fast_card import FastCard
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.lib.supervision import (
    BITE_PS,
    Shown,
    WatchedCard,
    constant_word,
    control_pdu,
    firmware_words,
    process,
    steps_ms,
    within,
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


def near(ms: float, expected: float) -> bool:
    return abs(ms - expected) <= ACCURACY * expected


def assert_never_sent(card: WatchedCard) -> None:
    """Checks that DE never rose and tx never fell."""
    for line in (card.modbus, card.drive):
        assert not line.direction.pulses
        assert all(level for _, level in line.monitor.edges)


# ---------------------------------------------------------------- boot


@cocotb.test()
async def first_request_that_ends_after_the_boot_time_is_answered(dut):
    card = WatchedCard(dut, baud=115_200)
    await card.switch_on()
    adu = rtu.build(1, READ_DRIVE_TIMEOUT)
    length = len(adu) * card.modbus.fmt.character_ps
    limit = card.released_ps + card.boot_limit_ps
    await card.firmware.round()
    booted = now_ps() - card.released_ps
    dut._log.info("first round of the poll loop %.2f ms after the reset", booted / MS)
    await sleep_until(limit - length)
    done = await card.master.request(adu, 10 * MS)
    assert done.sent.end_ps <= limit + card.bench.period_ps
    assert done.data == rtu.build(1, DRIVE_TIMEOUT)
    assert not card.drive.direction.pulses
    card.check_lines()


# ---------------------------------------------------------------- drivers without a clock


async def off_without_a_clock(dut) -> None:
    """Stops the clock, then asserts rst_n: both drivers are off at once and stay off."""
    dut.rst_n.value = 0
    for _ in range(3):
        await Timer(1, unit="ns")
        assert not int(dut.modbus_de.value) and not int(dut.drive_de.value)


@cocotb.test()
async def reset_switches_both_drivers_off_without_a_clock(dut):
    """The registers behind DE may hold anything when there was no clock yet (SAFE-6)."""
    bench = await Bench(dut, CLK_HZ, sw_baud=0, sw_addr=1, modbus_rx=1, drive_rx=1).start(reset_clocks=10)
    await bench.clocks(10)
    for drivers in ((1, 0), (0, 1), (1, 1)):
        bench.clock.stop()
        dut.network_i.dir_i.de.value, dut.drive_i.dir_i.de.value = drivers
        await Timer(1, unit="ns")
        assert (int(dut.modbus_de.value), int(dut.drive_de.value)) == drivers
        await off_without_a_clock(dut)
        bench.clock.start()
        await bench.clocks(4)
        dut.rst_n.value = 1
        for _ in range(20):
            await bench.clocks()
            assert not int(dut.modbus_de.value) and not int(dut.drive_de.value)


@cocotb.test()
async def reset_in_the_middle_of_a_frame_switches_its_driver_off_without_a_clock(dut):
    card = await WatchedCard(dut, baud=BAUD).boot()
    for adu, driver in (
        (rtu.build(1, READ_DRIVE_TIMEOUT), dut.modbus_de),
        (rtu.build(1, control_pdu(0x047C, 0x1999)), dut.drive_de),
    ):
        await card.master.send(adu)
        await within(40 * MS, RisingEdge(driver), "DE")
        await Timer(0.5 * MS, unit="ps")
        assert int(driver.value)
        card.bench.clock.stop()
        await off_without_a_clock(dut)
        card.bench.clock.start()
        await card.bench.clocks(10)
        dut.rst_n.value = 1
        await card.firmware.round()


# ---------------------------------------------------------------- switches


@cocotb.test()
async def processor_stays_in_reset_until_the_switches_are_read(dut):
    """The processor stays in reset until address and rate have been read."""
    card = WatchedCard(dut, baud=BAUD)
    await card.switch_on()
    clocks = 0
    while not int(dut.sw_ready.value):
        assert int(dut.rst.value) and (clocks == 0 or int(dut.core_rst.value))
        clocks += 1
        await card.bench.clocks()
    assert clocks > 100
    await card.firmware.round()
    await card.check_alive()


@cocotb.test()
async def switches_moved_after_power_up_have_no_effect_until_the_next_reset(dut):
    address, baud, form = 0b0101_0101, BAUD, "8E1"
    card = await WatchedCard(dut, baud=baud, form=form, address=address).boot()
    settings = {"sw_baud": switch_word(baud_switches(baud, form)), "sw_addr": address}
    # First each group alone, then all seventeen switches at once; the last setting is valid too.
    for moved in ({"sw_baud": 0b111}, {"sw_baud": 0b11000}, {"sw_addr": 0xFF}, ALL_SWITCHES):
        for name, bits in moved.items():
            getattr(dut, name).value = settings[name] ^ bits
        await card.ask(READ_DRIVE_TIMEOUT, DRIVE_TIMEOUT)
        for name, value in settings.items():
            getattr(dut, name).value = value
    other = {name: settings[name] ^ bits for name, bits in ALL_SWITCHES.items()}
    for name, value in other.items():
        getattr(dut, name).value = value
    await card.master.send(rtu.build(other["sw_addr"], READ_DRIVE_TIMEOUT))
    await card.quiet(4, "a request to the address that the switches show now")
    # The next reset reads the switches as they are then.
    dut.rst_n.value = 0
    dut.sw_baud.value = switch_word(baud_switches(BAUD, "8N2", "1111"))
    await card.bench.clocks(8)
    dut.rst_n.value = 1
    await card.firmware.round()
    card.modbus.set_format(Format.named(BAUD, "8N2"))
    done = await card.master.request(rtu.build(other["sw_addr"], READ_DRIVE_TIMEOUT), 10 * MS)
    assert done.data == rtu.build(other["sw_addr"], DRIVE_TIMEOUT)
    card.check_lines()


@cocotb.test()
async def invalid_address_turns_both_leds_red_and_keeps_both_lines_silent(dut):
    card = WatchedCard(dut, baud=BAUD, address=0)
    await card.switch_on()
    for address in (0, 248, 255):
        dut.sw_addr.value = address
        dut.rst_n.value = 0
        await card.bench.clocks(8)
        dut.rst_n.value = 1
        await Timer(1 * MS, unit="ps")
        assert card.leds.fault
        card.leds.forget()
        # This wait and the requests together take longer than a start.
        await Timer(round(0.06 * card.boot_limit_ps), unit="ps")
        for to in dict.fromkeys((address, 0, 1)):
            await card.master.send(rtu.build(to, control_pdu(0x047C, 0x1999)))
            await card.quiet(3, f"a request to {to}, switches {address}")
        assert all(len(history) == 1 for history in card.leds.shown.values()), "solid, not flashing"
    assert_never_sent(card)
    dut.sw_addr.value = 247
    dut.rst_n.value = 0
    await card.bench.clocks(8)
    dut.rst_n.value = 1
    await card.firmware.round()
    assert not card.leds.fault
    card.address = 247
    await card.ask(READ_DRIVE_TIMEOUT, DRIVE_TIMEOUT)
    card.check_lines()


# ---------------------------------------------------------------- damaged image


async def faults_silently(card: WatchedCard, limit_ps: float, what: str) -> None:
    """Both LEDs turn solid red in time; requests to start the motor have no effect before or after."""
    asking = cocotb.start_soon(request_continuously(card))
    await card.leds.until(lambda: card.leds.fault, limit_ps, f"fault, {what}")
    card.leds.forget()
    await Timer(20 * MS, unit="ps")
    asking.cancel()
    card.modbus.source.hold(1)
    assert all(len(history) == 1 for history in card.leds.shown.values()), "solid, not flashing"
    assert_never_sent(card)


def two_bits_of_a_byte(rng: random.Random) -> tuple[int, int]:
    """Two bits of one byte, whose flips parity does not detect."""
    byte = LANE_BITS * rng.randrange(4)
    first, second = rng.sample(range(8), 2)
    return byte + first, byte + second


async def request_continuously(card: WatchedCard) -> None:
    """A master that starts the motor every few milliseconds, by address and by broadcast."""
    while True:
        for to in (1, 0):
            await card.master.send(rtu.build(to, control_pdu(0x047C, 0x1999)))
            await Timer(3 * MS, unit="ps")


@cocotb.test()
async def image_damaged_in_the_file_ends_in_the_fault(dut):
    """Wrong checksums halt the card; after a flipped bit the watchdog bites, three times."""
    card = WatchedCard(dut, baud=BAUD)
    await card.switch_on()
    await faults_silently(card, 3 * card.boot_limit_ps, "start-up check")


def checking_words() -> range:
    """The words of the image that check the image."""
    of_card = symbols((ROOT / configuration(CONFIG)["firmware_hex"]).with_suffix(".elf"))
    begin = next(address for name, address in of_card.items() if name.split(".")[0] == "check")
    return range(begin // 4, min(address for address in of_card.values() if address > begin) // 4)


@cocotb.test()
async def any_flipped_bits_of_the_image_end_in_the_fault_and_never_in_a_telegram(dut):
    """Parity finds one flip. Of two, the checksums find them, or the program traps or hangs three times.

    Two in the code that checks may stop the check, and the card works on (docs/hardening.md).
    """
    rng = seeded("flipped bits of the image")
    card = WatchedCard(dut, baud=BAUD)
    await card.switch_on()
    for _ in range(12):
        word = rng.randrange(len(firmware_words()))
        bits = rng.choice((two_bits_of_a_byte(rng), (rng.randrange(WORD_BITS),)))
        if word in checking_words():
            bits = bits[:1]
        dut.rst_n.value = 0
        await card.bench.clocks(8)
        card.firmware.restore()
        card.firmware.damage(word, *bits)
        await card.bench.clocks(8)
        dut.rst_n.value = 1
        await Timer(1 * MS, unit="ps")
        await faults_silently(card, 3 * (BITE_PS + card.boot_limit_ps), f"word {word} bits {bits}")


@cocotb.test()
@cocotb.parametrize(bits=[1, 2])
async def image_damaged_while_running_ends_in_the_fault_within_a_second(dut, bits):
    """Reading for the checksums detects one flipped bit by parity; two of a byte make a checksum wrong."""
    rng = seeded("damaged bits")
    card = await WatchedCard(dut, baud=BAUD).boot()
    await card.check_alive()
    card.firmware.damage(constant_word(), *two_bits_of_a_byte(rng)[:bits])
    damaged_at = now_ps()
    sent = len(card.modbus.monitor.characters)
    await card.leds.until(lambda: card.leds.fault, 1000 * MS, "fault")
    dut._log.info("found %.1f ms after the damage", (now_ps() - damaged_at) / MS)
    card.leds.forget()
    await card.master.send(rtu.build(1, control_pdu(0x047C, 0x1999)))
    await card.quiet(4, "a request after the fault")
    assert len(card.modbus.monitor.characters) == sent and not card.drive.monitor.characters
    assert all(len(history) == 1 for history in card.leds.shown.values()), "solid, not flashing"
    card.firmware.restore_damaged()


# ---------------------------------------------------------------- LEDs, the first step


@cocotb.test()
async def drive_led_is_red_for_a_quarter_second_while_requests_are_served(dut):
    card = await WatchedCard(dut, baud=BAUD).boot()
    await card.leds.until(lambda: card.leds.show("drive") == "red", 2 * MS, "drive LED red")
    card.leds.forget()
    await card.check_alive()
    await card.write_control(0x047C, 0x1999)
    await card.leds.until(lambda: card.leds.show("drive") == "green", 260 * MS, "drive LED green")
    ((shown, ms),) = steps_ms(card.leds.shown["drive"])
    dut._log.info("first step %.2f ms", ms)
    assert shown == "red" and near(ms, STEP_MS)
    assert card.leds.show("modbus") == "off"
    card.check_lines()


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


@pytest.mark.nightly
@pytest.mark.rule("LED-2", "LED-3", "LED-4")
def test_both_leds_flash_once_a_second_after_the_power_up_show(config):
    with FastCard(config=config) as card:
        card.run(7000)
        for led in ("drive", "modbus"):
            steps = steps_ms([s for s in card.shown[led] if s.since_ps > 2005 * MS])
            assert len(steps) == 9
            # Both are red before the first frame and the first exchange.
            assert [colour for colour, _ in steps] == ["red", "off"] * 4 + ["red"]
            assert all(near(ms, 500) for _, ms in steps), steps
        assert not card.modbus.de and not card.drive.de


def set_register(card: FastCard, register: int, value: int) -> None:
    pdu = rtu.write_register(register, value)
    assert card.request(rtu.build(1, pdu)).data == rtu.build(1, pdu)


def to_next_flash(card: FastCard, led: str = "modbus") -> None:
    """Runs until just after a LED was lit; it stays lit for half a second."""
    card.run_until(max(card.now_ps, 2005 * MS))
    if card.led(led) != "off":
        card.run_until_led(led, "off", 600)
    card.run_until(card.now_ps + 1000 * MS, f"led_{led}_red", f"led_{led}_green")
    assert card.led(led) in ("red", "green")


@pytest.mark.rule("LED-3", "MAP-5")
def test_network_led_is_green_for_register_40002_after_each_good_frame_for_the_card(config):
    with FastCard(config=config, baud=BAUD, form="8N2") as card:
        to_next_flash(card)
        assert card.led("modbus") == "red", "before the first frame"
        set_register(card, 1, 30)
        card.run(10)
        assert card.led("modbus") == "green"
        end = card.modbus.frames()[-1].start_ps - rtu.t35_ps(BAUD)
        # Neither of these is a good frame for this card.
        for adu in (rtu.build(2, READ_DRIVE_TIMEOUT), rtu.build(1, READ_DRIVE_TIMEOUT)[:-1] + b"\0"):
            card.run(100)
            assert card.request(adu, 5) is None
        turned = card.run_until_led("modbus", "red", 300)
        print(f"red {(turned - end) / MS:.2f} ms after the last stop bit")
        assert 0.99 * 300 <= (turned - end) / MS <= 1.01 * 300 + ROUNDS_MS[config]
        # Any frame for the card keeps it green, also a rejected request or a broadcast.
        to_next_flash(card)
        for adu in (rtu.build(1, b"\x2b"), rtu.build(0, rtu.write_register(0, 0)), rtu.build(1, b"\x2b")):
            card.request(adu, 5)
            card.run(140)
            assert card.led("modbus") == "green"


@pytest.mark.nightly
@pytest.mark.rule("LED-3", "MAP-5")
def test_network_time_out_is_ten_seconds_by_default_and_never_with_40002_at_0(config):
    with FastCard(config=config, baud=BAUD, form="8N2") as card:
        to_next_flash(card)
        card.run(200)
        end = card.modbus.send(rtu.build(1, READ_DRIVE_TIMEOUT))
        card.run(9900)
        assert card.led("modbus") == "green"
        turned = card.run_until_led("modbus", "red", 300)
        print(f"red {(turned - end) / MS:.2f} ms after the last stop bit")
        assert near((turned - end) / MS, 10_000)
        set_register(card, 1, 0)
        card.run(11_000)
        colours = {s.colour for s in card.shown["modbus"] if s.since_ps > turned + 1000 * MS}
        assert colours == {"green", "off"}


@pytest.mark.rule("LED-4")
def test_drive_led_shows_how_the_last_exchange_ended(config):
    script = Script()
    with FastCard(config=config, baud=BAUD, form="8N2", drive=script) as card:
        to_next_flash(card, "drive")
        assert card.led("drive") == "red", "before the first exchange"
        set_register(card, 2, 3)
        assert card.led("drive") == "red", "no exchange"
        pdu = control_pdu(0x047C, 0x1999)
        telegram, reply = process(0x047C, 0x1999)
        for shows, replies in (("green", [reply]), ("red", [None, None]), ("green", [None, reply])):
            to_next_flash(card, "drive")
            for one in replies:
                script.expect(telegram, one)
            answer = card.request(rtu.build(1, pdu)).data
            card.run(2)
            script.check()
            assert card.led("drive") == shows
            assert answer == rtu.build(1, rtu.exception(0x0F, 255) if shows == "red" else pdu[:5])
        # A refusal by the drive is a reply, so the exchange succeeded.
        to_next_flash(card, "drive")
        assert card.led("drive") == "green"


# ---------------------------------------------------------------- pytest


def run_card(sim: str, config: str, testcase: str | list[str], **parameters: object) -> None:
    run(
        "rtu2fc",
        "tb.card.test_card_power_up",
        sim=sim,
        config=config,
        parameters={"CLK_HZ": SLOW_HZ[config], **parameters},
        testcase=testcase,
    )


@pytest.mark.rule("BOOT-1")
def test_boot(sim, config):
    """At the card's own clock."""
    assert configuration(config)["boot_ms"] == {"standard": 20, "tiny": 60}[config]
    what = "first_request_that_ends_after_the_boot_time_is_answered"
    run_card(sim, config, what, CLK_HZ=own_hz(config))


@pytest.mark.rule("SAFE-6")
def test_drivers_in_reset(sim, config):
    run_card(sim, config, "reset_switches_both_drivers_off_without_a_clock")


@pytest.mark.rule("SAFE-6")
def test_drivers_in_reset_while_they_send(sim, config):
    what = "reset_in_the_middle_of_a_frame_switches_its_driver_off_without_a_clock"
    run_card(sim, config, what)


@pytest.mark.rule("LINE-2", "LINE-3", "LINE-7", "LINE-8", "LED-5")
def test_switches(sim, config):
    what = [
        "processor_stays_in_reset_until_the_switches_are_read",
        "switches_moved_after_power_up_have_no_effect_until_the_next_reset",
        "invalid_address_turns_both_leds_red_and_keeps_both_lines_silent",
    ]
    run_card(sim, config, what)


@pytest.mark.rule("LINE-8")
def test_switches_that_settle_late_are_read_right_after_any_reset():
    """The pull-ups charge the lines of the switches meanwhile. The time since the last reset varies."""
    later = seeded("times between resets")
    with FastCard(baud=BAUD, form="8N2", address=1) as card:
        card.run(card.boot_ms)
        for _ in range(8):
            card.run(later.uniform(0, 10))
            released = card.reset()
            card.set(sw_addr=2)
            card.plan(released + SETTLED_MS * MS, "sw_addr", 1)
            card.run(card.boot_ms)
            assert card.request(rtu.build(1, READ_DRIVE_TIMEOUT)), "not the address of the settled switches"


@pytest.mark.parametrize("bits", [1, 2])
@pytest.mark.rule("LED-5", "SAFE-4")
def test_image_damaged_in_the_file(sim, config, bits):
    words = firmware_words(config)
    for bit in two_bits_of_a_byte(seeded("damaged bits of the file"))[:bits]:
        words[constant_word(config)] ^= 1 << bit
    file = ROOT / f"build/tests/damaged-{bits}-{sim}-{config}.hex"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(map(hex_line, words)))
    run_card(sim, config, "image_damaged_in_the_file_ends_in_the_fault", FIRMWARE_HEX=str(file))


@pytest.mark.nightly
@pytest.mark.rule("LED-5", "SAFE-4")
def test_image_damaged_while_running(config):
    """The second holds at the card's own clock: on a slower one SERV has time for no word in most rounds.

    PicoRV32 keeps it at the bench's clock too. On Verilator only, for the length.
    """
    clk_hz = own_hz(config) if config == "tiny" else SLOW_HZ[config]
    what = "image_damaged_while_running_ends_in_the_fault_within_a_second"
    run_card("verilator", config, what, CLK_HZ=clk_hz)


@pytest.mark.rule("LED-5", "SAFE-4")
def test_image_damaged_anywhere(config):
    """On Verilator only: some of these programs hang for three bites, which takes minutes on Icarus."""
    what = "any_flipped_bits_of_the_image_end_in_the_fault_and_never_in_a_telegram"
    run_card("verilator", config, what)


@pytest.mark.rule("LED-1")
def test_first_step_of_the_show(sim, config):
    run_card(sim, config, "drive_led_is_red_for_a_quarter_second_while_requests_are_served")
