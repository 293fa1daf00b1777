# SPDX-License-Identifier: Apache-2.0
"""The card stops the drive once when no good frame comes for the time of 40002 (SAFE-7), at the pins.

The option is a parameter of the card and an image of the firmware: both are needed.
"""

from __future__ import annotations

import random

import pytest

from tb.agents import rtu
from tb.lib.card import MS
from tb.lib.config import ROUND_MS
from tb.lib.fast_card import FastCard
from tb.lib.nightly import first
from tb.lib.seeds import cases, seeded
from tb.model.fc_telegram import build
from tb.model.lines import image_of, words_of
from tb.model.told import not_told

pytestmark = pytest.mark.rule("SAFE-7")
OPTION = (("MASTER_LOSS_STOP", 1),)
START, REFERENCE = 0x047C, 0x1999
STATUS = bytes.fromhex("0F03 2000")
TICK_MS = 1000 / 1200
# 40002, in 10 ms.
TENS = 8
# The gate rounds up to a tick, so does the firmware, and it acts in its next round.
LATE_MS = 3 * TICK_MS + ROUND_MS
# For the drive's answer, the default of 40003 and less what is unsure.
WAIT_MS = 140
# From the commit of a write to the end of its reply.
REPLIED_MS = 35


def telegram(control: int, reference: int = REFERENCE, adr: int = 0x81) -> bytes:
    return build(control.to_bytes(2, "big") + reference.to_bytes(2, "big"), adr)


def starts(sent: bytes) -> bool:
    """Whether it is a process telegram with the start bit."""
    words = words_of(sent)
    return bool(words) and bool(words[1] & 0x40)


STOP = telegram(0x043C)


class Drive:
    """Keeps the telegrams; answers unless it is silent."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []
        self.silent = False

    def __call__(self, sent: bytes) -> bytes | None:
        self.heard.append(sent)
        return None if self.silent or sent[2] != 0x81 else build(STATUS)


class Master:
    """A master, its card and the drive, after power-up, with 40002 set."""

    def __init__(self, tens: int = TENS, option: bool = True, image: str = "stop", extra: str = ""):
        self.drive = Drive()
        self.card = FastCard(
            drive=self.drive, dialect=image, parameters=OPTION if option else (), extra=extra
        )
        self.card.run(self.card.boot_ms)
        self.pause_ps = 1.1 * rtu.t35_ps(self.card.modbus.fmt.baud)
        self.set_wait(tens)

    def __enter__(self) -> Master:
        return self

    def __exit__(self, *_: object) -> None:
        self.card.close()

    def send(self, adu: bytes) -> float:
        """Sends a frame; returns the time of its commit in ps, which is passed then."""
        end = self.card.modbus.send(adu, self.pause_ps)
        commit = end + rtu.t35_ps(self.card.modbus.fmt.baud)
        self.card.run_until(commit + 0.2 * MS)
        return commit

    def ask(self, pdu: bytes, timeout_ms: float = 400) -> bytes:
        reply = self.card.request(rtu.build(1, pdu), timeout_ms)
        assert reply, pdu.hex(" ")
        return reply.data[1:-2]

    def set_wait(self, tens: int) -> None:
        """Writes register 40002."""
        self.ask(b"\x06\x00\x01" + tens.to_bytes(2, "big"))

    def write(self, control: int, unit: int = 1) -> float:
        """Writes coils 1-32; returns the time of the commit."""
        both = control | REFERENCE << 16
        pdu = rtu.write_coils(0, [bool(both >> i & 1) for i in range(32)])
        return self.send(rtu.build(unit, pdu))

    def heard(self) -> list[bytes]:
        """What the drive heard since the last call."""
        heard, self.drive.heard = self.drive.heard, []
        return heard

    def image(self) -> int:
        """Coils 1-16."""
        return int.from_bytes(self.ask(bytes.fromhex("01 0000 0010"))[2:], "little")

    def started(self, **how: int) -> float:
        commit = self.write(START, **how)
        self.card.run(REPLIED_MS)
        assert self.heard() == [telegram(START, adr=0x81 if how.get("unit", 1) else 0x80)]
        return commit

    def stop_ms(self, commit_ps: float) -> float:
        """Runs until the card sends on the drive line; returns the time since a commit."""
        assert self.card.run_until(self.card.now_ps + 200 * MS, "drive_de"), "no stop"
        return (self.card.now_ps - commit_ps) / MS


@pytest.mark.parametrize("unit", [1, 0])
def test_one_stop_leaves_after_the_time_and_the_image_shows_it(unit: int):
    with Master() as master:
        commit = master.started(unit=unit)
        passed = master.stop_ms(commit)
        assert 10 * TENS <= passed <= 10 * TENS + LATE_MS
        master.card.run(400)
        assert master.heard() == [STOP], "once"
        assert master.image() == 0x043C
        master.card.run(200)
        assert master.heard() == [], "nor after the next silence"
        commit = master.started()
        assert 10 * TENS <= master.stop_ms(commit) <= 10 * TENS + LATE_MS
        master.card.run(300)
        assert master.heard() == [STOP], "again after the next start"


@pytest.mark.parametrize("passed_ms", first([500, 12_000]))
def test_without_a_time_there_is_no_stop(passed_ms: float):
    """In the longer case longer than the default time."""
    with Master(tens=0) as master:
        master.started()
        master.card.run(passed_ms)
        assert master.heard() == []
        master.ask(b"\x06\x00\x01" + TENS.to_bytes(2, "big"))
        master.card.run(10 * TENS + 20)
        assert master.heard() == [STOP], "a time that is set later counts for the drive that runs"


READING = bytes.fromhex("03 0000 0001")


@pytest.mark.parametrize(("unit", "keeps"), [(1, True), (0, True), (7, False)])
def test_good_frames_for_this_card_or_all_keep_the_drive_running(unit: int, keeps: bool):
    with Master() as master:
        master.started()
        for _ in range(12):
            commit = master.send(rtu.build(unit, READING))
            master.card.run(5 * TENS)
        assert master.heard() == ([] if keeps else [STOP])
        if keeps:
            assert 10 * TENS <= master.stop_ms(commit) <= 10 * TENS + LATE_MS


@pytest.mark.parametrize(("option", "image"), [(False, "stop"), (True, ""), (False, "")])
def test_the_card_or_the_firmware_alone_sends_none(option: bool, image: str):
    with Master(option=option, image=image) as master:
        master.started()
        master.card.run(400)
        assert master.heard() == []
        assert master.image() == START


class UnluckyDrive:
    """Is silent for some telegrams and late for some. `told`: each, and whether it had a reply in time."""

    def __init__(self, rng: random.Random) -> None:
        self.rng, self.told = rng, []
        self.delay_ms, self.card = 3.0, None

    def __call__(self, sent: bytes) -> bytes | None:
        heard = sent[2] == 0x81 and self.rng.random() > 0.15
        delay_ms = self.delay_ms * self.rng.choice((1, 1, 3))
        self.told.append((sent, heard if delay_ms < WAIT_MS else None))
        self.card.reply_bits = delay_ms * MS / self.card.drive.fmt.bit_ps
        return build(STATUS) if heard else None


class DyingMaster(Master):
    """Sends a few requests in any order, waits 5 to 60 ms for each reply, and is silent then."""

    def __init__(self, rng: random.Random) -> None:
        self.rng, self.tens = rng, rng.randint(1, 15)
        super().__init__(self.tens)
        self.drive = self.card.drive_model = UnluckyDrive(rng)
        self.drive.card = self.card
        self.drive.delay_ms = 3 * 30 ** rng.random()
        self.commits: list[float] = []

    def some_request(self) -> bytes:
        control = self.rng.choice((START, START, START, 0x043C, self.rng.randrange(0x10000)))
        coils = [bool(control >> i & 1) for i in range(16)]
        pdu = self.rng.choice(
            (
                rtu.write_coils(0, coils),
                rtu.write_coils(0, coils),
                rtu.write_coil(6, self.rng.random() < 0.8),
                rtu.write_coil(64, self.rng.random() < 0.5),
                bytes.fromhex("06 040F 003C"),
                bytes.fromhex("03 1413 0002"),
                READING,
            )
        )
        return rtu.build(0 if self.rng.random() < 0.2 and pdu[0] != 3 else 1, pdu)

    def live(self) -> None:
        for _ in range(self.rng.randint(1, 6)):
            self.commits.append(self.send(self.some_request()))
            if self.rng.random() < 0.15:
                self.card.drive.send(b"\x55" * self.rng.randint(1, 300), self.rng.uniform(0, 20) * MS)
            self.card.run(self.rng.uniform(5, 60))

    def told_after(self, when_ps: float) -> list[bytes]:
        """The process telegrams that left after a time."""
        frames = self.card.drive.frames()
        return [frame.data for frame in frames if frame.start_ps > when_ps and words_of(frame.data)]


@pytest.mark.rule("SAFE-7", "SAFE-8")
def test_whenever_the_master_dies_the_drive_is_told_to_stop():
    """Whatever it asked before, however the drive answered, and with noise on the drive's line."""
    rng, stops = seeded("masters that die"), 0
    for _ in range(cases(4, 16)):
        with DyingMaster(rng) as master:
            for _ in range(3):
                master.live()
                due = master.commits[-1] + 10 * master.tens * MS
                master.card.run(10 * master.tens + 900)
                assert not any(map(starts, master.told_after(due + LATE_MS * MS))), "a start left too late"
                assert not any(map(starts, master.told_after(0)[-1:])), "the drive was not told to stop"
                stops += len(master.told_after(due)) > 0
                asked = len(master.drive.told)
                reply = master.card.request(rtu.build(1, rtu.read_coils(0, 32)))
                assert not_told(master.drive.told, image_of(reply.data)) == ""
                assert len(master.drive.told) == asked
                master.commits.append(master.card.now_ps)
    assert stops, "no master died with a motor that ran"


OF_STOP = tuple(
    f"mailbox_i.gate_i.{pair}"
    for pair in ("g_loss.loss_i.armed_i", "g_loss.loss_i.over_i", "licences_i.g_stop.free_i")
)


GATE = "mailbox_i.gate_i."
PAIRS = (
    *(f"{GATE}{pair}" for pair in ("request_i.committed_i", "telegram_i.licence_i")),
    *(f"{GATE}licences_i.{pair}" for pair in ("image_i", "one_i", "g_second.second_i", "all_i")),
    "network_i.rtu_rx_i.bank_i",
    *(pytest.param(pair, marks=pytest.mark.nightly) for pair in OF_STOP),
)


@pytest.mark.rule("SAFE-4", "WDG-1")
@pytest.mark.parametrize("pair", PAIRS)
def test_a_flipped_half_of_any_guarded_bit_restarts_the_firmware(pair: str):
    """Register 40002 then has its default again."""
    option = pair in OF_STOP
    with Master(option=option, image="stop" if option else "", extra="flips") as master:
        for half in ("held_i", "opposite_i"):
            master.set_wait(TENS)
            master.card.flip(f"{pair}.{half}.half", 0, 0)
            master.card.run(master.card.boot_ms)
            assert master.ask(bytes.fromhex("03 0001 0001"))[2:] == (1000).to_bytes(2, "big"), half
