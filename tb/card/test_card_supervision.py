# SPDX-License-Identifier: Apache-2.0
"""The card when its firmware stops or its drive is silent: watchdog and time-outs.

Each test stops the firmware by overwriting one instruction of its poll loop. It restores the instruction
while the watchdog holds the processor in reset, as after a passing disturbance. On Verilator this runs at the
standard card's 12 MHz. On Icarus, at about 25000 clocks a second, it runs at 2 MHz: a start, which checks the
image, takes as many clocks and six times as long; the watchdog's milliseconds stay the same. SERV also runs
at a slow clock.
"""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from regs.generated.card_tables import DRIVE_BAUD
from regs.generated.mailbox import AREAS, FRAMES_BYTES
from tb.agents import rtu
from tb.agents.crc16 import crc_good
from tb.agents.fc_slave import HeardTelegram, Manner
from tb.agents.uart import now_ps
from tb.lib.card import MS, baud_switches, switch_word
from tb.lib.config import CONFIG, OVERDUE_MS, SLOW_HZ, own_hz
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.lib.supervision import (
    BITE_PS,
    WatchedCard,
    control_pdu,
    memory_words,
    process,
    steps_ms,
    within,
)
from tb.model import fc_telegram

BAUD = 38_400
START, REFERENCE = 0x047C, 0x1999
BITES = 3
# The longest time of DE that is proved, and the limit of driver_limit up to 38400 bit/s.
LONGEST_BITS, LIMIT_BITS = 375, 482
EXCHANGE_LIMIT_MS = 60
# Number of random moments. Each needs a start, which takes SERV long.
MOMENTS = {"standard": 20, "tiny": 6}[CONFIG]


async def booted(dut, **settings) -> WatchedCard:
    card = WatchedCard(dut, baud=BAUD, **settings)
    card.firmware.restore()  # an earlier test may have left damage
    await card.boot()
    await card.firmware.find_loop()
    return card


async def restarted(card: WatchedCard, bitten_at: int) -> None:
    """Waits until the firmware runs again, within the time of BOOT-1."""
    await card.firmware.round()
    assert now_ps() - bitten_at < card.boot_limit_ps


async def exchange_number(card: WatchedCard, number: int) -> HeardTelegram:
    """Waits for telegram number `number` and the drive's reply to it."""
    for _ in range(EXCHANGE_LIMIT_MS):
        await Timer(1 * MS, unit="ps")
        if len(card.slave.heard) >= number:
            break
    return card.slave.heard[number - 1]


# ---------------------------------------------------------------- watchdog


@cocotb.test()
async def stopped_firmware_restarts_in_time_with_a_cleared_control_image(dut):
    card = await booted(dut)
    await card.write_control(START, REFERENCE)
    await card.ask(rtu.read_coils(0, 32), bytes.fromhex("01 04 7C 04 99 19"))
    # If the bite made the card read the switches again, it would no longer answer.
    dut.sw_baud.value = switch_word(baud_switches(1200, "8O1", "1111"))
    dut.sw_addr.value = 99
    sent = len(card.modbus.direction.pulses), len(card.drive.direction.pulses)
    card.firmware.stop()
    stopped_at = now_ps()
    at = await card.firmware.bite()
    card.firmware.restore_damaged()
    dut._log.info("bite %.2f ms after the stop", (at - stopped_at) / MS)
    assert at - stopped_at <= BITE_PS
    await restarted(card, at)
    dut._log.info("firmware runs again %.2f ms after the bite", (now_ps() - at) / MS)
    await card.check_alive()
    assert card.master.line.monitor.characters[-1].end_ps - at < card.boot_limit_ps, "answered in time"
    now = len(card.modbus.direction.pulses), len(card.drive.direction.pulses)
    assert now == (sent[0] + 1, sent[1]), "only this answer was sent"
    # The master has to start the motor again.
    await card.write_control(START, REFERENCE)
    card.check_lines()


@cocotb.test()
async def telegram_on_the_wire_at_the_bite_is_completed_and_its_answer_ignored(dut):
    card = await booted(dut)
    telegram, reply = process(START, REFERENCE)
    card.script.expect(telegram, reply)
    adu = rtu.build(1, control_pdu(START, REFERENCE))
    await card.master.send(adu)
    await within(20 * MS, RisingEdge(dut.drive_de), "telegram")
    await Timer(round(2.5 * MS), unit="ps")
    at = await card.firmware.bite_now()
    assert str(dut.drive_de.value) == "1", "bitten while the telegram was being sent"
    heard = await exchange_number(card, 1)
    assert heard.telegram == telegram and heard.reply_sent is not None
    assert heard.frame.start_ps < at < heard.frame.end_ps
    await card.firmware.round()
    assert not card.modbus.direction.pulses, "the request is forgotten"
    await card.check_alive()
    card.script.check()
    card.check_lines()


@cocotb.test()
async def reply_on_the_wire_at_the_bite_is_completed(dut):
    card = await booted(dut)
    adu = rtu.build(1, rtu.read_coils(0, 128))
    await card.master.send(adu)
    await within(20 * MS, RisingEdge(dut.modbus_de), "reply")
    await Timer(1 * MS, unit="ps")
    at = await card.firmware.bite_now()
    frame = await card.modbus.monitor.frame(20 * MS)
    assert frame.start_ps < at < frame.end_ps
    assert frame.data == rtu.build(1, bytes([1, 16]) + bytes(16))
    await Timer(round(rtu.t35_ps(BAUD)), unit="ps")
    await restarted(card, at)
    await card.check_alive()
    card.check_lines()


@cocotb.test()
async def telegram_that_waits_for_the_line_at_the_bite_is_never_sent(dut):
    card = await booted(dut)
    card.drive.source.hold(0)
    await card.master.send(rtu.build(1, control_pdu(START, REFERENCE)))
    await Timer(5 * MS, unit="ps")
    at = await card.firmware.bite_now()
    card.drive.source.hold(1)
    await restarted(card, at)
    await card.quiet(10, "the bite")
    await card.check_alive()
    assert not card.drive.direction.pulses
    card.check_lines()


@cocotb.test()
async def bite_at_any_moment_leaves_whole_frames_and_starts_none(dut):
    rng = seeded("moments of the bite")
    card = await booted(dut)
    card.slave.model = lambda telegram: process(0, 0)[1]
    adu = rtu.build(1, control_pdu(START, REFERENCE))
    for _ in range(MOMENTS):
        # Random time from the first bit of the request until after the answer; 29 ms in all.
        sending = cocotb.start_soon(card.master.send(adu))
        await Timer(rng.randrange(33 * MS), unit="ps")
        at = await card.firmware.bite_now()
        await sending
        await restarted(card, at)
        await Timer(5 * MS, unit="ps")
        for line in (card.modbus, card.drive):
            assert not [pulse for pulse in line.direction.pulses if pulse.rise_ps > at]
        await card.check_alive()
    card.check_lines()


@cocotb.test()
async def third_bite_without_an_exchange_causes_the_fault(dut):
    card = await booted(dut)
    for left in range(BITES - 1, -1, -1):
        at = await card.firmware.bite_now()
        if left:
            await restarted(card, at)
            assert not card.leds.fault
    await card.leds.until(lambda: card.leds.fault, 1 * MS, "fault")
    card.leds.forget()
    await Timer(round(0.2 * card.boot_limit_ps), unit="ps")
    await card.master.send(rtu.build(1, control_pdu(START, REFERENCE)))
    await card.quiet(4, "a request after the fault")
    assert not steps_ms(card.leds.shown["modbus"]) and not steps_ms(card.leds.shown["drive"])
    assert not card.modbus.direction.pulses and not card.drive.direction.pulses


@cocotb.test()
@cocotb.parametrize(exchange=["answer", "telegram"])
async def bites_with_exchanges_between_them_never_cause_the_fault(dut, exchange):
    """An answer to the master, or a good telegram from the drive, proves that the card works."""
    card = await booted(dut)
    for bites in range(BITES + 1):
        if exchange == "answer":
            await card.check_alive()
        else:
            # A frame for another station follows the request, so its answer is dropped (FRAME-7).
            card.script.expect(*process(START, REFERENCE))
            await card.master.send(rtu.build(1, control_pdu(START, REFERENCE)))
            await card.master.send(rtu.build(9, rtu.read_coils(0, 8)))
            await exchange_number(card, bites + 1)
            assert not card.modbus.direction.pulses
        await restarted(card, await card.firmware.bite_now())
        assert not card.leds.fault
    await card.check_alive()
    card.check_lines()


@cocotb.test()
async def permanently_damaged_program_ends_in_the_fault_at_the_restart(dut):
    card = await booted(dut)
    card.firmware.stop()
    at = await card.firmware.bite()
    await card.leds.until(lambda: card.leds.fault, card.boot_limit_ps, "fault")
    assert now_ps() - at < card.boot_limit_ps
    await card.master.send(rtu.build(1, control_pdu(START, REFERENCE)))
    await card.quiet(4, "a request after the fault")
    assert not card.modbus.direction.pulses and not card.drive.direction.pulses


@cocotb.test()
async def trap_triggers_the_watchdog_at_once(dut):
    card = await booted(dut)
    stopped_at = now_ps()
    at = await card.firmware.bite_now()
    dut._log.info("bite %.3f ms after the illegal instruction", (at - stopped_at) / MS)
    assert at - stopped_at < 1 * MS
    await restarted(card, at)
    await card.check_alive()
    card.check_lines()


# ---------------------------------------------------------------- drive time-out


def flip_in_frame(dut, area: str, byte: int, bit: int) -> None:
    """Flips a bit of a byte that waits in the frame memory to be sent; bit 8 is its parity."""
    words = memory_words(dut)
    word = words[len(words) - FRAMES_BYTES // 4 + AREAS[area].slot + byte]
    word.value ^= 1 << bit


async def loses_one_answer(card: WatchedCard, pdu: bytes, reply: bytes, byte: int, bit: int) -> None:
    dut = card.dut
    await card.firmware.round()
    await card.master.send(rtu.build(1, pdu))
    if not int(dut.mailbox_i.reply_queued.value):
        await within(20 * MS, RisingEdge(dut.mailbox_i.reply_queued), "reply")
    flip_in_frame(dut, "REPLY_FRAME", byte, bit)
    frame = await card.modbus.monitor.frame(40 * MS)
    assert len(frame.data) == len(reply), f"byte {byte} bit {bit}: the reply keeps its length"
    assert not crc_good(frame.data), f"byte {byte} bit {bit}: {frame.data.hex(' ')} has a good CRC"
    # Each byte shares its word with a byte of the request. Were it not mended, the next request would restart
    # the firmware again, before it writes the reply.
    flip_in_frame(dut, "REPLY_FRAME", byte, bit)
    await Timer(round(rtu.t35_ps(BAUD)), unit="ps")
    await card.firmware.round()
    done = await card.master.request(rtu.build(1, pdu), 20 * MS)
    assert done.data == reply


@cocotb.test()
async def reply_byte_damaged_in_memory_leaves_with_a_wrong_crc(dut):
    """Each byte of a short reply; of a long one the first and the last that fill the reply's memory."""
    rng = seeded("damaged reply bytes")
    card = await booted(dut)
    short = rtu.read_registers(2, 1)
    answer = rtu.build(1, bytes.fromhex("03 02 00 0F"))
    for byte in range(len(answer) - 2):
        await loses_one_answer(card, short, answer, byte, rng.randrange(9))
    coils = rtu.read_coils(0, 128)
    answer = rtu.build(1, bytes([1, 16]) + bytes(16))
    for byte in (0, 2, len(answer) - 3):
        await loses_one_answer(card, coils, answer, byte, rng.randrange(9))
    assert not card.drive.direction.pulses
    card.modbus.check_direction()


@cocotb.test()
async def telegram_byte_damaged_in_memory_leaves_with_a_wrong_bcc(dut):
    """The BCC was made with the telegram, so no damaged byte fits it."""
    rng = seeded("damaged telegram bytes")
    card = await booted(dut)
    telegram, reply = process(START, REFERENCE)
    pdu = control_pdu(START, REFERENCE)
    for byte in range(telegram[1]):
        bit = rng.randrange(8)
        await card.firmware.round()
        before = len(card.drive.monitor.characters)
        await card.master.send(rtu.build(1, pdu))
        await within(40 * MS, RisingEdge(dut.telegram_start), "telegram")
        flip_in_frame(dut, "TELEGRAM_FRAME", byte, bit)
        await Timer(15 * MS, unit="ps")
        sent = bytes(character.byte for character in card.drive.monitor.characters[before:])
        assert len(sent) == len(telegram) and sent[: 2 + byte] == telegram[: 2 + byte]
        flip_in_frame(dut, "TELEGRAM_FRAME", byte, bit)
        assert fc_telegram.bcc(sent[:-1]) != sent[-1], (
            f"byte {byte} bit {bit}: {sent.hex(' ')} has a good BCC"
        )
        await card.firmware.round()
        card.script.expect(telegram, reply)
        done = await card.master.request(rtu.build(1, pdu), 60 * MS)
        assert done.data == rtu.build(1, pdu[:5])


async def cut_and_alive_again(card: WatchedCard, adu: bytes, sender, driver, baud: int) -> None:
    """A sender that always begins anew, as one whose index flips again and again, loses the line in time."""
    await card.firmware.round()
    await card.master.send(adu)
    await within(40 * MS, RisingEdge(driver), "DE")
    rose = now_ps()
    stuck = cocotb.start_soon(begin_anew(sender))
    await within(2 * LONGEST_BITS * 1e12 / baud, FallingEdge(driver), "the driver to be switched off")
    bits = (now_ps() - rose) * baud / 1e12
    assert LONGEST_BITS <= bits <= LIMIT_BITS, f"DE was high for {bits:.0f} bits"
    # The sender goes on, the driver stays off.
    await Timer(20 * MS, unit="ps")
    assert int(sender.sending.value) and not int(driver.value)
    stuck.cancel()
    # The end of the frame and 3.5 characters.
    await Timer(30 * MS, unit="ps")
    assert not int(sender.sending.value)


async def begin_anew(sender) -> None:
    while True:
        sender.index.value = 1
        await Timer(1 * MS, unit="ps")


@cocotb.test()
async def sender_that_never_ends_loses_its_driver_and_the_card_goes_on(dut):
    card = await WatchedCard(dut, baud=9600).boot()
    local = rtu.read_registers(2, 1)
    await cut_and_alive_again(card, rtu.build(1, local), dut.network_i.rtu_tx_i, dut.modbus_de, 9600)
    command = rtu.build(1, control_pdu(START, REFERENCE))
    await cut_and_alive_again(card, command, dut.drive_i.fc_tx_i, dut.drive_de, DRIVE_BAUD)
    await card.firmware.round()
    await Timer(400 * MS, unit="ps")
    done = await card.master.request(rtu.build(1, local), 60 * MS)
    assert done.data == rtu.build(1, bytes.fromhex("03 02 00 0F"))


async def set_drive_timeout(card: WatchedCard, tens_of_ms: int) -> None:
    pdu = rtu.write_register(2, tens_of_ms)
    await card.ask(pdu, pdu)


@cocotb.test()
@cocotb.parametrize(wait=[3, None])
async def silent_drive_gets_one_repeat_and_is_reported_after_the_wait(dut, wait):
    card = await WatchedCard(dut, baud=BAUD).boot()
    if wait is not None:
        await set_drive_timeout(card, wait)
    wait_ms = 10 * (15 if wait is None else wait)
    telegram, _ = process(START, REFERENCE)
    pdu = control_pdu(START, REFERENCE)
    done = await card.ask(pdu, rtu.exception(0x0F, 255), [(telegram, None)] * 2)
    first, second = (heard.frame for heard in card.slave.heard)
    for what, end, start in (
        ("repeat", first.end_ps, second.start_ps),
        ("exception", second.end_ps, done.reply.start_ps),
    ):
        waited = (start - end) / MS
        dut._log.info("%s after %.2f ms", what, waited)
        assert wait_ms <= waited <= wait_ms + OVERDUE_MS, f"{what} after {waited:.2f} ms"
    await card.quiet(5, "exception 255")
    card.check_lines()


def reply_ends_after(ms: float) -> Manner:
    """A process reply whose last stop bit comes `ms` after that of the telegram."""
    bits = ms * 1e-3 * 9600 - 8 * 11
    return Manner(delay_bits=bits)


@cocotb.test()
async def reply_that_ends_within_the_wait_is_accepted_and_a_later_one_is_not(dut):
    card = await WatchedCard(dut, baud=BAUD).boot()
    await set_drive_timeout(card, 2)
    card.slave.next(reply_ends_after(19.7))
    await card.write_control(START, REFERENCE)
    card.slave.next(reply_ends_after(20 + OVERDUE_MS + 1))
    pdu = control_pdu(START, 0)
    exchange = process(START, 0)
    await card.ask(pdu, pdu[:5], [exchange, exchange])
    _, late, _ = card.slave.heard
    answer = card.modbus.monitor.frames()[-1]
    assert answer.start_ps > late.reply_sent.end_ps
    card.check_lines()


@cocotb.test()
async def request_after_a_broadcast_waits_only_for_the_pause(dut):
    card = await WatchedCard(dut, baud=BAUD).boot()
    broadcast = fc_telegram.build_process(START, REFERENCE, fc_telegram.ADR_BROADCAST)
    card.script.expect(broadcast, None)
    await card.master.send(rtu.build(0, control_pdu(START, REFERENCE)))
    # The next request arrives before the broadcast telegram has been sent.
    await card.ask(control_pdu(START, 0), control_pdu(START, 0)[:5], [process(START, 0)])
    first, second = (heard.frame for heard in card.slave.heard)
    pause = (second.start_ps - first.end_ps) / card.drive.fmt.bit_ps
    assert 22 - 0.25 <= pause <= 24, f"{pause:.2f} bits"
    card.check_lines()


# ---------------------------------------------------------------- pytest


def run_card(sim: str, config: str, *testcase: str, slow: bool = True) -> None:
    clk_hz = SLOW_HZ[config] if slow else own_hz(config)
    run(
        "rtu2fc",
        "tb.card.test_card_supervision",
        sim=sim,
        config=config,
        parameters={"CLK_HZ": clk_hz},
        testcase=testcase,
    )


def slowly(sim: str, config: str) -> bool:
    return sim == "icarus" or config != "standard"


@pytest.mark.rule("WDG-1", "LINE-8", "MAP-4")
def test_watchdog(sim, config):
    what = "stopped_firmware_restarts_in_time_with_a_cleared_control_image"
    run_card(sim, config, what, slow=slowly(sim, config))


@pytest.mark.rule("WDG-1", "SAFE-1")
def test_lines_at_the_bite(sim, config):
    run_card(
        sim,
        config,
        "telegram_on_the_wire_at_the_bite_is_completed_and_its_answer_ignored",
        "telegram_that_waits_for_the_line_at_the_bite_is_never_sent",
        slow=slowly(sim, config),
    )


@pytest.mark.rule("SAFE-2", "SAFE-4")
def test_endless_sender(sim, config):
    run_card(sim, config, "sender_that_never_ends_loses_its_driver_and_the_card_goes_on")


@pytest.mark.rule("SAFE-4")
def test_bytes_damaged_in_memory(sim, config):
    run_card(
        sim,
        config,
        "reply_byte_damaged_in_memory_leaves_with_a_wrong_crc",
        "telegram_byte_damaged_in_memory_leaves_with_a_wrong_bcc",
    )


@pytest.mark.rule("LED-5", "WDG-1")
def test_fault_by_the_watchdog(sim, config):
    run_card(sim, config, "third_bite_without_an_exchange_causes_the_fault", slow=slowly(sim, config))


@pytest.mark.nightly
@pytest.mark.rule("LED-5", "WDG-1")
def test_repeated_bites(config):
    """On Verilator only: dozens of starts, which take minutes on Icarus."""
    run_card(
        "verilator",
        config,
        "reply_on_the_wire_at_the_bite_is_completed",
        "bite_at_any_moment_leaves_whole_frames_and_starts_none",
        "bites_with_exchanges_between_them_never_cause_the_fault",
        "permanently_damaged_program_ends_in_the_fault_at_the_restart",
    )


@pytest.mark.rule("WDG-1")
def test_trap():
    """On the standard card and Verilator only: SERV has no trap."""
    run_card("verilator", "standard", "trap_triggers_the_watchdog_at_once")


@pytest.mark.rule("FC-9")
def test_late_replies(sim, config):
    run_card(sim, config, "reply_that_ends_within_the_wait_is_accepted_and_a_later_one_is_not")


@pytest.mark.rule("FC-9", "MAP-5")
def test_silent_drive(config):
    """On Verilator only, with the default wait of 150 ms too; Icarus has a repeat in `test_late_replies`."""
    run_card("verilator", config, "silent_drive_gets_one_repeat_and_is_reported_after_the_wait")


@pytest.mark.rule("MAP-9", "FC-8")
def test_broadcast_and_next_request(config):
    """The tiny card runs at its own clock: at a slow one the broadcast is ready after the next request."""
    run_card(
        "verilator", config, "request_after_a_broadcast_waits_only_for_the_pause", slow=config == "standard"
    )
