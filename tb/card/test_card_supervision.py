# SPDX-License-Identifier: Apache-2.0
"""The card when its firmware stops or its drive is silent: watchdog and time-outs.

Each test stops the firmware by overwriting its poll loop. It restores the program while the watchdog holds
the processor in reset, as after a passing disturbance.
"""

from __future__ import annotations

import pytest

from regs.generated.card_tables import DRIVE_BAUD
from tb.agents import rtu
from tb.agents.crc16 import crc_good
from tb.lib.card import MS, baud_switches, switch_word
from tb.lib.config import ROUNDS_MS, own_hz
from tb.lib.fast_card import Line
from tb.lib.seeds import seeded
from tb.lib.supervision import BITE_MS, WatchedCard, constant_word, control_pdu, process
from tb.model import fc_telegram

BAUD = 38_400
START, REFERENCE = 0x047C, 0x1999
WRITE = rtu.build(1, control_pdu(START, REFERENCE))
LOCAL, LOCAL_REPLY = rtu.read_registers(2, 1), bytes.fromhex("03 02 00 0F")
ALL_COILS, ALL_COILS_REPLY = rtu.read_coils(0, 128), bytes([1, 16]) + bytes(16)
BITES = 3
# The longest time of DE that is proved, and the limit of driver_limit up to 38400 bit/s.
LONGEST_BITS, LIMIT_BITS = 375, 482
# Number of random moments.
MOMENTS = {"standard": 20, "tiny": 6}


def booted(config: str, baud: int = BAUD, **settings) -> WatchedCard:
    return WatchedCard(config, baud=baud, **settings).boot()


def send(card: WatchedCard, adu: bytes) -> int:
    """Sends a request with a pause before it; returns the end."""
    return card.modbus.send(adu, 1.05 * rtu.t35_ps(card.modbus.fmt.baud))


def send_until(card: WatchedCard, adu: bytes, output: str) -> None:
    """Sends a request; runs until an output rises."""
    assert card.run_until(send(card, adu) + 40 * MS, output), f"{output} did not rise"


# ---------------------------------------------------------------- watchdog


@pytest.mark.rule("WDG-1", "LINE-8", "MAP-4")
def test_watchdog(config):
    """Stopped firmware restarts in time, with a cleared control image."""
    with booted(config) as card:
        card.write_control(START, REFERENCE)
        card.ask(rtu.read_coils(0, 32), bytes.fromhex("01 04 7C 04 99 19"))
        # If the bite made the card read the switches again, it would no longer answer.
        card.set(sw_baud=switch_word(baud_switches(1200, "8O1", "1111")), sw_addr=99)
        stopped = card.now_ps
        card.stop()
        bitten = card.bite()
        card.restore()
        print(f"bite {(bitten - stopped) / MS:.2f} ms after the stop")
        assert bitten - stopped <= BITE_MS * MS
        card.check_restarted(bitten)
        # The master has to start the motor again.
        card.write_control(START, REFERENCE)
        card.check_lines()


@pytest.mark.rule("WDG-1", "SAFE-1")
def test_a_telegram_on_the_line_at_the_bite_is_completed_and_its_answer_ignored(config):
    with booted(config) as card:
        telegram, reply = process(START, REFERENCE)
        card.script.expect(telegram, reply)
        send_until(card, WRITE, "drive_de")
        card.run(2.5)
        bitten = card.bite_now()
        assert card.drive.driven, "bitten while the telegram was being sent"
        frame = card.next_frame(card.drive, bitten + 20 * MS)
        assert frame.data == telegram and frame.start_ps < bitten < frame.end_ps
        card.check_restarted(bitten)
        card.script.check()
        card.check_lines()


@pytest.mark.rule("WDG-1", "SAFE-1")
def test_a_telegram_that_waits_for_the_line_at_the_bite_is_never_sent(config):
    with booted(config) as card:
        card.set(drive_line=0)
        card.run_until(send(card, WRITE) + 5 * MS)
        bitten = card.bite_now()
        card.set(drive_line=1)
        card.check_restarted(bitten)
        card.quiet(10, "the bite")
        assert not card.drive.de
        card.check_lines()


@pytest.mark.rule("WDG-1")
def test_a_reply_on_the_line_at_the_bite_is_completed(config):
    with booted(config) as card:
        send_until(card, rtu.build(1, ALL_COILS), "modbus_de")
        card.run(1)
        bitten = card.bite_now()
        frame = card.next_frame(card.modbus, bitten + 20 * MS)
        assert frame.start_ps < bitten < frame.end_ps
        assert frame.data == rtu.build(1, ALL_COILS_REPLY)
        card.check_restarted(bitten)
        card.check_lines()


@pytest.mark.nightly
@pytest.mark.rule("WDG-1")
def test_a_bite_at_any_moment_leaves_whole_frames_and_starts_none_of_before(config):
    """A request that ends after the bite is one as any other: the card that has started again answers it.

    One that has ended before is lost. Within a character of its end it may be either.
    """
    rng = seeded("moments of the bite")
    telegram = process(START, REFERENCE)[0]
    with booted(config) as card:
        card.drive_model = lambda telegram: process(0, 0)[1]
        for _ in range(MOMENTS[config]):
            # Random time from the first bit of the request until after the answer; 29 ms in all.
            ends = send(card, WRITE)
            card.run(rng.uniform(0, 33))
            sent, bitten = card.sent(), card.bite_now()
            assert card.sent() == sent
            if bitten < ends + card.modbus.fmt.character_ps:
                card.run(card.boot_ms + 60)
                told = [frame.data for frame in card.drive.frames()][sent[1] :]
                answers = card.sent()[0] - sent[0]
                lost = bitten > ends and not told and not answers
                assert lost or (told == [telegram] and answers == 1)
                bitten = card.bite_now()
            card.check_restarted(bitten)
        card.check_lines()


@pytest.mark.rule("LED-5", "WDG-1")
def test_the_third_bite_without_an_exchange_causes_the_fault(config):
    with booted(config) as card:
        for _ in range(BITES - 1):
            card.bite_now()
            card.boot()
            assert not card.fault
        card.until_fault(card.bite_now() + 1 * MS, "third bite")
        assert not card.modbus.de and not card.drive.de


@pytest.mark.nightly
@pytest.mark.rule("LED-5", "WDG-1")
@pytest.mark.parametrize("exchange", ["answer", "telegram"])
def test_bites_with_exchanges_between_them_never_cause_the_fault(config, exchange: str):
    """An answer to the master, or a good telegram from the drive, proves that the card works."""
    with booted(config) as card:
        for _ in range(BITES + 1):
            if exchange == "answer":
                card.check_alive()
            else:
                # A frame for another station follows the request, so its answer is dropped (FRAME-7).
                card.script.expect(*process(START, REFERENCE))
                send(card, WRITE)
                card.run_until(send(card, rtu.build(9, rtu.read_coils(0, 8))) + 60 * MS)
                card.script.check()
                assert not card.modbus.de
            card.bite_now()
            card.boot()
            assert not card.fault
        card.check_alive()
        card.check_lines()


@pytest.mark.nightly
@pytest.mark.rule("LED-5", "WDG-1")
def test_a_permanently_damaged_program_ends_in_the_fault_at_the_restart(config):
    with booted(config) as card:
        card.damage(constant_word(config), 0, 1)
        card.until_fault(card.bite_now() + card.boot_ms * MS, "restart")
        assert not card.modbus.de and not card.drive.de


# ---------------------------------------------------------------- damaged bytes, endless senders


def loses_one_answer(card: WatchedCard, pdu: bytes, reply: bytes, byte: int, bit: int) -> None:
    send_until(card, rtu.build(1, pdu), "reply_queued")
    card.flip_in_frame("REPLY_FRAME", byte, bit)
    frame = card.next_frame(card.modbus, card.now_ps + 40 * MS)
    assert len(frame.data) == len(reply), f"byte {byte} bit {bit}: the reply keeps its length"
    assert not crc_good(frame.data), f"byte {byte} bit {bit}: {frame.data.hex(' ')} has a good CRC"
    # Each byte shares its word with a byte of the request. Were it not mended, the next request would restart
    # the firmware again, before it writes the reply.
    card.flip_in_frame("REPLY_FRAME", byte, bit)
    card.boot()
    assert card.request(rtu.build(1, pdu)).data == reply


@pytest.mark.rule("SAFE-4")
def test_a_reply_byte_damaged_in_memory_leaves_with_a_wrong_crc(config):
    """Each byte of a short reply; of a long one the first and the last that fill the reply's memory."""
    rng = seeded("damaged reply bytes")
    with booted(config) as card:
        answer = rtu.build(1, LOCAL_REPLY)
        for byte in range(len(answer) - 2):
            loses_one_answer(card, LOCAL, answer, byte, rng.randrange(9))
        answer = rtu.build(1, ALL_COILS_REPLY)
        for byte in (0, 2, len(answer) - 3):
            loses_one_answer(card, ALL_COILS, answer, byte, rng.randrange(9))
        assert not card.drive.de


@pytest.mark.rule("SAFE-4")
def test_a_telegram_byte_damaged_in_memory_leaves_with_a_wrong_bcc(config):
    """The BCC was made with the telegram, so no damaged byte fits it."""
    rng = seeded("damaged telegram bytes")
    with booted(config) as card:
        telegram, reply = process(START, REFERENCE)
        for byte in range(telegram[1]):
            bit = rng.randrange(8)
            card.drive_model = lambda telegram: None
            send_until(card, WRITE, "drive_de")
            card.flip_in_frame("TELEGRAM_FRAME", byte, bit)
            sent = card.next_frame(card.drive, card.now_ps + 15 * MS).data
            assert len(sent) == len(telegram) and sent[: 2 + byte] == telegram[: 2 + byte]
            assert fc_telegram.bcc(sent[:-1]) != sent[-1], f"byte {byte} bit {bit}: {sent.hex(' ')}"
            card.flip_in_frame("TELEGRAM_FRAME", byte, bit)
            card.boot()
            card.drive_model = lambda telegram: reply
            assert card.request(WRITE).data == rtu.build(1, control_pdu(START, REFERENCE)[:5])


def sends_for_ever(card: WatchedCard, adu: bytes, line: Line, sender: str, bit: int, begin: int) -> None:
    """A sender whose index flips back again and again loses its line in time, and the line is free later.

    The index counts the bytes. From the middle of byte `begin` on, a bit falls each time that it has risen.
    """
    send_until(card, adu, f"{line.name}_de")
    rose = card.now_ps
    assert card.run_until(rose + 2 * MS, f"{line.name}_tx")
    card.run_until(card.now_ps + (begin + 0.5) * line.fmt.character_ps)
    limit = rose + 2 * LONGEST_BITS * line.fmt.bit_ps
    flipped = 0
    while card.now_ps < limit + 20 * MS:
        card.flip(f"{sender}.index", 0, bit)
        flipped += 1
        card.run_until(card.now_ps + (1 << bit) * line.fmt.character_ps)
    fell = line.de[-1][0]
    assert not line.driven and line.tx[-1][0] > fell + 20 * MS, "the sender goes on, the driver stays off"
    assert LONGEST_BITS <= (fell - rose) / line.fmt.bit_ps <= LIMIT_BITS
    card.run(60)
    assert line.tx[-1][0] < card.now_ps - 20 * MS, "the sender ends"


@pytest.mark.rule("SAFE-2", "SAFE-4")
def test_a_sender_that_never_ends_loses_its_driver_and_the_card_goes_on(config):
    with booted(config, baud=9600) as card:
        sends_for_ever(card, rtu.build(1, ALL_COILS), card.modbus, "network_i.rtu_tx_i", 3, 8)
        read = rtu.build(1, rtu.read_registers(5139, 2))
        sends_for_ever(card, read, card.drive, "drive_i.fc_tx_i", 2, 6)
        card.run(400)
        assert card.request(rtu.build(1, LOCAL)).data == rtu.build(1, LOCAL_REPLY)


# ---------------------------------------------------------------- drive time-out


@pytest.mark.rule("FC-9", "MAP-5")
@pytest.mark.parametrize("wait", [3, None])
def test_a_silent_drive_gets_one_repeat_and_is_reported_after_the_wait(config, wait: int | None):
    with booted(config) as card:
        if wait is not None:
            card.ask(rtu.write_register(2, wait))
        wait_ms = 10 * (15 if wait is None else wait)
        exchange = (process(START, REFERENCE)[0], None)
        done = card.ask(control_pdu(START, REFERENCE), rtu.exception(0x0F, 255), [exchange] * 2)
        first, second = card.drive.frames()
        for what, end, start in (
            ("repeat", first.end_ps, second.start_ps),
            ("exception", second.end_ps, done.start_ps),
        ):
            waited = (start - end) / MS
            assert wait_ms <= waited <= wait_ms + overdue_ms(config), f"{what} after {waited:.2f} ms"
        card.quiet(5, "exception 255")
        card.check_lines()


def overdue_ms(config: str) -> float:
    """A time-out of the firmware ends one to two ticks (1/1200 s) and a round late, never early."""
    return 2 + ROUNDS_MS[config]


def reply_ends_after(ms: float) -> float:
    """Pause in bits before a process reply whose last stop bit comes `ms` after that of the telegram."""
    return ms * 1e-3 * DRIVE_BAUD - 8 * 11


@pytest.mark.rule("FC-9")
def test_a_reply_that_ends_within_the_wait_is_accepted_and_a_later_one_is_not(config):
    with booted(config) as card:
        card.ask(rtu.write_register(2, 2))
        card.late_bits.append(reply_ends_after(19.7))
        card.write_control(START, REFERENCE)
        card.late_bits.append(reply_ends_after(20 + overdue_ms(config) + 1))
        pdu, exchange = control_pdu(START, 0), process(START, 0)
        answer = card.ask(pdu, pdu[:5], [exchange, exchange])
        assert answer.start_ps > card.drive.frames()[-1].end_ps, "after the repeat"
        card.check_lines()


@pytest.mark.rule("MAP-9", "FC-8")
def test_a_request_after_a_broadcast_waits_only_for_the_pause(config):
    """The tiny card runs at its own clock: at a slow one the broadcast is ready after the next request."""
    with booted(config, clk_hz=own_hz(config) if config == "tiny" else None) as card:
        card.script.expect(fc_telegram.build_process(START, REFERENCE, fc_telegram.ADR_BROADCAST), None)
        send(card, rtu.build(0, control_pdu(START, REFERENCE)))
        # The next request arrives before the broadcast telegram has been sent.
        card.ask(control_pdu(START, 0), control_pdu(START, 0)[:5], [process(START, 0)])
        first, second = card.drive.frames()
        pause = (second.start_ps - first.end_ps) / card.drive.fmt.bit_ps
        assert 22 - 0.25 <= pause <= 24, f"{pause:.2f} bits"
        card.check_lines()
