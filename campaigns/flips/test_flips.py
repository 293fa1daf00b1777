# SPDX-License-Identifier: Apache-2.0
"""Single flipped bits in the running card (SAFE-4): flips reach their bits, and their effects are detected.

`make flips` is the long version, with a table of the effects of thousands of flips.
"""

from __future__ import annotations

import random
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace

import pytest

from campaigns.flips import run as flips
from campaigns.flips.group import outcomes
from campaigns.flips.trial import (
    BAUDS,
    FORBIDDEN,
    FORMS,
    GROUP,
    PACES,
    PARTS,
    Flip,
    Places,
    case_of,
    classify,
    telegrams,
    too_early,
    trial,
)
from campaigns.fuzz.case import Played, clk_hz
from campaigns.fuzz.test_fuzz import burst
from campaigns.fuzz.test_fuzz import heard as heard_on
from rtl.sources import ROOT, configuration
from sim.harness.library import Target
from tb.agents import rtu
from tb.agents.crc16 import with_crc
from tb.lib.bound import at_most, words
from tb.lib.rows import each_row
from tb.model.fc_telegram import build_process
from tb.model.whole_card import NEVER, Verdict
from tb.model.wire import FarCharacter, LineFormat, drive_line

RTL = ROOT / "rtl"
BAUD = BAUDS[0]
LINE = LineFormat(BAUD, FORMS[BAUD], clk_hz(BAUD))
START = bytes.fromhex("010f 0000 0010 02 7c04")  # only coils 1 to 16
READING = rtu.read_registers(5139, 1)
COMMAND = rtu.build(1, rtu.write_coils(0, [bool(0x047C >> i & 1) for i in range(16)]))
CONFIRMED = rtu.build(1, bytes.fromhex("0F 00 00 00 10"))
TELEGRAM = build_process(0x047C, 0)
ALTERED = build_process(0x047C, 0x2000)
# At a clock that no trial reaches.
NO_FLIP = Flip(10**9, "network_i.uart_i.driving", 0, 0, "card")
PROBES = 2  # requests at the end of a trial
DISTURBED = "no telegram, but the drive line disturbed"
# Of the flips that a test lists, the parts that are made: `make test` makes every eleventh.
PARTLY = pytest.mark.parametrize("each", [11, pytest.param(1, marks=pytest.mark.nightly)])


@pytest.fixture(scope="module")
def places() -> Places:
    return Places()


@pytest.mark.nightly
def test_every_register_of_the_verilog_can_be_flipped():
    """Compares with the text of the modules, not with the output of Yosys. The card has every option."""
    places = Places(Target(parameters=(("LOCKSTEP", 1), ("MASTER_LOSS_STOP", 1))))
    can = {(register.module, register.name) for register in places.registers}
    there = {(path.stem, name) for path in RTL.rglob("*.v") for name in clocked(path)}
    assert len(there) > 70
    assert {module for module, _ in there - can} == {"ram_bank"}, "the small card's memory"


def clocked(path: Path) -> set[str]:
    """Registers assigned at a clock edge."""
    text = re.sub(r"//.*", "", path.read_text())
    blocks = re.findall(
        r"always @\(posedge.*?(?=\n  (?:always|assign|wire|reg|\w+ #?\()|\nendmodule)", text, re.DOTALL
    )
    assignment = r"(?:[;):]|\bbegin|\belse)\s*(\w+)\s*(?:\[[^;=]*?\]\s*)*<="
    return {name for block in blocks for name in re.findall(assignment, block)}


@pytest.mark.nightly
@pytest.mark.rule("SAFE-4")
def test_flips_in_copies_have_the_outcomes_of_flips_alone(places):
    """Of two groups, whose traffic differs."""
    numbers = [f"77/{n}" for n in (*range(12), *range(GROUP, GROUP + 12))]
    alone = [trial(number, places)[0] for number in numbers]
    assert [*outcomes(numbers[:12], places), *outcomes(numbers[12:], places)] == alone
    assert len({outcome.what for outcome in alone}) > 1
    traffics = [case_of(number, places)["events"] for number in numbers]
    assert traffics[0] == traffics[11] != traffics[12] == traffics[23]


@pytest.mark.rule("SAFE-4", "LED-5")
def test_a_flip_in_the_code_halts_the_card(places):
    memory, words, _ = places.by_part["code"][0]
    at = int(0.07 * clk_hz(BAUD))
    outcome, *_ = trial("test", places, Flip(at, memory.path, words[len(words) // 4], memory.bits[3], "code"))
    assert outcome.what == "halted, both LEDs red", outcome


@pytest.mark.rule("SAFE-4", "WDG-1")
def test_a_flip_that_stops_the_core_brings_the_watchdog(places):
    trap = next(register for register in places.registers if register.name == "trap")
    at = int(0.11 * clk_hz(BAUD))
    outcome, case, played, _ = trial("test", places, Flip(at, trap.path, 0, 0, "core"))
    assert outcome.what == "reset by the watchdog" and outcome.recovered, outcome
    assert len(played.frames) == len(case["events"]) + 2 * PROBES, "asked again after the restart"


RESETS = ("switches_i.ready", "reset_i.released", "supervisor_i.restarting", "supervisor_i.stopped")


@pytest.mark.rule("SAFE-4", "WDG-1")
@pytest.mark.parametrize("tick", [1, pytest.param(0, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(
    "near", [RESETS, pytest.param(("supervisor_i.", "reset_i.", RESETS[0]), marks=pytest.mark.nightly)]
)
def test_a_flip_that_resets_the_card_for_a_clock_is_a_reset(places, tick, near):
    """The first reference is lost with it. In every second tick the switches are ready again at once.

    At night all registers next to the reset are flipped.
    """
    events = commands((1, 0x1111))
    _, _, played, _ = trial("test", places, NO_FLIP, events)
    at = round(played.replies[0].fall + 1000 + tick * LINE.clk_hz / 1200)
    aimed = [register for register in places.registers if register.path.startswith(near)]
    assert len(aimed) >= len(near)
    for path, bit in [(register.path, bit) for register in aimed for bit in register.bits]:
        outcome, _, played, _ = trial("test", places, Flip(at, path, 0, bit, "card"), events)
        assert outcome.what not in FORBIDDEN, outcome
        if path in RESETS:
            assert outcome.what == "reset by the watchdog" and outcome.recovered, outcome
            assert played.telegrams[-1].data == TELEGRAM


@pytest.mark.rule("SAFE-4", "WDG-1")
@pytest.mark.parametrize("core", ["core_i", pytest.param("g_lockstep.second_i", marks=pytest.mark.nightly)])
@PARTLY
def test_no_flip_of_a_core_makes_a_telegram(places, core, each: int):
    """Each bit of one core that is no register of the program: the other core asks for something else."""
    events = commands((1, 0x1111))
    _, _, played, _ = trial("test", places, NO_FLIP, events)
    end = played.network[12].end
    path = f"core_i.g_picorv32.{core}."
    in_core = [register for register in places.registers if register.path.startswith(path)]
    aimed = [register for register in in_core if not register.memory]
    bits = [(register.path, bit) for register in aimed for bit in register.bits]
    assert len(bits) > 400
    for path, bit in bits[:: 5 * each]:
        outcome, *_ = trial("test", places, Flip(round(end + 500), path, 0, bit, "core"), events)
        assert outcome.what in ("reset by the watchdog", "no effect"), outcome
        assert outcome.recovered, outcome


@pytest.mark.rule("SAFE-4", "LED-5")
@pytest.mark.nightly
def test_a_flip_in_the_small_card_has_an_effect():
    """Half of a guarded bit restarts the firmware, whatever it does just then."""
    places = Places(Target(config="tiny"))
    bank = next(
        register for register in places.registers if register.path.endswith("rtu_rx_i.bank_i.held_i.half")
    )
    at = int((PACES["tiny"].boot_s + 0.06) * places.line.clk_hz)
    outcome, *_ = trial("test", places, Flip(at, bank.path, 0, bank.bits[0], "card"))
    assert outcome.what == "reset by the watchdog" and outcome.recovered, outcome
    unharmed, *_ = trial("test", places, Flip(10**9, bank.path, 0, bank.bits[0], "card"))
    assert unharmed.what == "no effect", unharmed


@pytest.mark.rule("SAFE-2", "SAFE-4")
@PARTLY
def test_no_flip_of_a_sender_keeps_its_driver_on(places, each: int):
    """Flips each state bit of both senders and UARTs in the first character and in the last."""
    flips = []
    _, _, played, _ = trial("test", places, NO_FLIP)
    sent = {"network_i.rtu_tx_i": played.replies[0], "drive_i.fc_tx_i": played.telegrams[0]}
    for sender, whole in sent.items():
        uart = sender.split(".")[0] + ".uart_i"
        character = 11 * (LINE.bit if "network" in sender else drive_line(LINE.clk_hz).bit)
        for path in (f"{sender}.state", f"{uart}.state", f"{uart}.driving"):
            register = next(register for register in places.registers if register.path == path)
            for bit in register.bits:
                for at in (whole.rise + 0.6 * character, whole.fall - 0.4 * character):
                    flips.append(Flip(round(at), path, 0, bit, "card"))
    for flip in flips[::each]:
        outcome, *_ = trial("test", places, flip)
        assert outcome.what != "driver stuck", outcome
        assert outcome.recovered, outcome


def commands(*asked: tuple[int, int]) -> list[dict]:
    """Control word 047Ch for each of these units, with its reference."""
    block = [rtu.build(unit, bytes.fromhex(f"0f0000002004 7c04 {at:04x}")) for unit, at in asked]
    return [{"what": "command", "gap": ["idle", 20.0], "bytes": data.hex()} for data in block]


@pytest.mark.rule("SAFE-4", "SAFE-1")
@PARTLY
def test_no_flip_of_the_receiver_changes_a_command(places, each: int):
    """Other units' commands stay ignored; a command for the card is not mixed with an older one."""
    events = commands((1, 0x1111), (1, 0x2222), (9, 0x3333), (1, 0x4444))
    _, _, played, _ = trial("test", places, NO_FLIP, events)
    assert len(played.telegrams) == 4, "the last one is that of the probe"
    starts = [h.start for n, h in enumerate(played.network) if n % 13 == 0]
    character = LINE.character_bits * LINE.bit
    flips = []
    for path in (
        "uart_i.shift",
        "rtu_rx_i.unit",
        "rtu_rx_i.begun_bank",
        "rtu_rx_i.bank_i.held_i.half",
    ):
        register = next(register for register in places.registers if register.path == f"network_i.{path}")
        moments = [moment * character for moment in (3.2, 9.3, 13.0 + 2.5 * 11 / LINE.character_bits)]
        if path == "uart_i.shift":
            moments = [0.5 * character, 0.8 * character]
        elif "bank" in path:
            # The frame is a candidate, and the firmware is about to read it.
            moments.append(13 * character + LINE.t15_bits * LINE.bit + 200)
        for bit in register.bits:
            for start in starts[2:4]:
                for moment in moments:
                    flips.append(Flip(round(start + moment), register.path, 0, bit, "card"))
    for flip in flips[::each]:
        outcome, *_ = trial("test", places, flip, events)
        assert "telegram, bit 10" not in outcome.what and outcome.recovered, outcome


@pytest.mark.rule("SAFE-4", "SAFE-1", "FC-9")
@PARTLY
@pytest.mark.parametrize(
    "moment",
    [
        "between candidate and commit",
        "while the drive answers",
        pytest.param("after a broadcast", marks=pytest.mark.nightly),
        pytest.param("near a telegram's end", marks=pytest.mark.nightly),
        pytest.param("near a broadcast's end", marks=pytest.mark.nightly),
    ],
)
def test_no_flip_of_the_gate_or_the_sender_makes_a_command(places, moment, each: int):
    """Flips each of their bits."""
    events = commands((1, 0x1111), (0, 0x2222), (1, 0x3333))
    events[1:1] = [{**events[0], "bytes": events[0]["bytes"] + "55", "gaps": {"13": too_early(LINE)}}]
    _, _, played, _ = trial("test", places, NO_FLIP, events)
    assert len(played.telegrams) == 4, "the last one is that of the probe"
    first, to_all, _, _ = played.telegrams
    revoked = played.network[13 + 12].end
    t15 = LINE.t15_bits * LINE.bit
    at = {
        "between candidate and commit": revoked + t15 + 300,
        "near a telegram's end": first.fall - 300,
        "while the drive answers": first.fall + 30000,
        "near a broadcast's end": to_all.fall - 300,
        "after a broadcast": to_all.fall + 20000,
    }[moment]
    paths = ("mailbox_i.gate_i.", "mailbox_i.regs_i.telegram_no_reply", "drive_i.fc_tx_i.state")
    aimed = [register for register in places.registers if register.path.startswith(paths)]
    assert len(aimed) > 12
    for path, bit in [(register.path, bit) for register in aimed for bit in register.bits][::each]:
        outcome, *_ = trial("test", places, Flip(round(at), path, 0, bit, "card"), events)
        assert outcome.what not in FORBIDDEN, outcome


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize("half", ["held_i", pytest.param("opposite_i", marks=pytest.mark.nightly)])
@PARTLY
def test_a_flip_at_the_commit_of_a_stop_brings_no_older_command_back(places, half, each: int):
    """A start, a stop, then the reference alone: that telegram must not carry the start again.

    After a restart the control word is 0. The probes at the end of a trial start the motor and do not count.
    """
    stop = rtu.build(1, bytes.fromhex("0f 0000 0010 02 3c04"))
    reference = rtu.build(1, bytes.fromhex("0f 0010 0010 02 2222"))
    events = [
        *commands((1, 0x1111)),
        *({"what": "", "gap": ["idle", 20.0], "bytes": data.hex()} for data in (stop, reference)),
    ]
    path = f"mailbox_i.gate_i.request_i.committed_i.{half}.half"
    _, _, played, _ = trial("test", places, Flip(10**9, path, 0, 0, "card"), events)
    end = played.network[13 + 10].end
    assert played.telegrams[1].rise > end and len(played.telegrams) == 4, "the last one is that of the probe"
    for after in range(20, 400, 20)[::each]:
        at = round(end + LINE.t35_bits * LINE.bit + after)
        _, _, played, _ = trial("test", places, Flip(at, path, 0, 0, "card"), events)
        probes = played.network[13 + 11 + 11].start
        later = [burst.data for burst in played.telegrams if end < burst.rise < probes]
        what = f"{after} clocks after t3.5"
        assert later and all(data[3:5] in (b"\x04\x3c", b"\0\0") for data in later), what


# Modules that receive a frame and react to its end. A flip of the silence timer may end it too early.
ENDS = ("mailbox_i.gate_i.", "network_i.rtu_rx_i.", "network_i.uart_i.")


@pytest.mark.rule("SAFE-4", "SAFE-1", "FRAME-6")
@pytest.mark.parametrize(
    ("baud", "revoked_at", "by", "each"),
    [
        pytest.param(19200, 0.9, 0x00, 3, marks=pytest.mark.nightly),
        (38400, 0.9, 0x00, 101),
        pytest.param(9600, 0.5, 0xFF, 5, marks=pytest.mark.nightly),
        pytest.param(38400, 0.9, 0x55, 5, marks=pytest.mark.nightly),
    ],
)
def test_no_flip_commits_a_revoked_frame(baud, revoked_at, by, each):
    """Flips between t1.5 and the revoking character, in it, and after it; with and without a queued telegram.

    After a 00 the frame's CRC is still good. `each`: of that many flips, one is made. With 9, each bit is
    flipped at one moment at most; with 3, at two.
    """
    places = Places(baud=baud)
    line = places.line
    (command,) = commands((1, 0x2222))
    gap = too_early(line, revoked_at)
    revoked = {**command, "bytes": command["bytes"] + f"{by:02x}", "gaps": {"13": gap}}
    # Settings from it would go out with this command: a start at the present reference.
    events = [revoked, {**command, "bytes": with_crc(START).hex()}]
    _, _, played, _ = trial("test", places, NO_FLIP, events)
    assert [burst.data for burst in played.telegrams] == [TELEGRAM] * 2, "one is that of the probe"
    t15, end, more = line.t15_bits * line.bit, played.network[12].end, played.network[13]
    moments = [end + t15 + part * (gap * line.bit - t15) for part in (0.3, 0.95)]
    inside, behind = [more.start + bits * line.bit for bits in (0.5, 1.5, 9.6)], [more.end + 1000]
    aimed = [register for register in places.registers if register.path.startswith(ENDS)]
    bits = [(register.path, bit) for register in aimed for bit in register.bits]
    times = moments + inside + behind
    turns = [
        (path, bit, at)
        for number, (path, bit) in enumerate(bits)
        for turn, at in enumerate(times)
        if (number + turn) % each == 0
    ]
    for path, bit, at in turns:
        outcome, *_ = trial("test", places, Flip(round(at), path, 0, bit, "card"), events)
        assert outcome.what not in FORBIDDEN and outcome.recovered, outcome


# ---------------------------------------------------------------- verdicts


def heard(data: bytes, at: float) -> list[FarCharacter]:
    return heard_on(LINE, data, at)


def verdict_of(
    asked: bytes,
    sent: list[tuple[bytes, float]],
    replies: list[tuple[bytes, float]],
    newer: Iterable = (),
    reset_ms: float = NEVER,
) -> str:
    """Verdict on telegrams and replies after a request, each at its time in ms. The card may restart."""
    ms = LINE.clk_hz / 1000
    drive = drive_line(LINE.clk_hz)
    played = Played(
        [*heard(asked, 40 * ms), *newer],
        [],
        [burst(LINE, data, at * ms) for data, at in replies],
        [burst(drive, data, at * ms) for data, at in sent],
        int(300 * ms),
        1,
    )
    return telegrams(Flip(int(60 * ms), "somewhere", 0, 0, "card"), played, LINE, reset_ms * ms)[0]


@each_row(
    ("asked", "sent", "replies", "expected"),
    [
        (COMMAND, [(TELEGRAM, 50)], [(CONFIRMED, 75)], ""),
        (COMMAND, [(TELEGRAM, 50), (TELEGRAM, 90)], [], "telegram again or late"),
        (COMMAND, [(TELEGRAM, 50), (TELEGRAM, 90)], [(CONFIRMED, 75)], FORBIDDEN[0]),
        (COMMAND, [(TELEGRAM, 50), (TELEGRAM, 90), (TELEGRAM, 130)], [], FORBIDDEN[0]),
        # A reply that a flip made; the telegram was requested all the same.
        (COMMAND, [(TELEGRAM, 50)], [(CONFIRMED[:-1] + b"\xff", 46)], ""),
        (COMMAND, [(TELEGRAM, 50)], [(CONFIRMED, 46)], FORBIDDEN[1]),
        (COMMAND, [(TELEGRAM, 20)], [], FORBIDDEN[0]),
        (COMMAND, [(TELEGRAM, 44.2)], [], FORBIDDEN[0]),  # complete, but not committed
        (COMMAND, [(build_process(0x047D, 0), 50)], [], FORBIDDEN[1]),
        (COMMAND, [(build_process(0x007C, 0), 50)], [], "altered telegram, bit 10 = 0"),
        (COMMAND, [(TELEGRAM[:-1] + b"\x00", 50)], [], DISTURBED),
        (COMMAND, [(ALTERED, 50)], [], FORBIDDEN[1]),
        # Telegrams that a drive might still accept: its other addresses, or extra bytes before or after.
        (COMMAND, [(build_process(0x047C, 0x2000, 0x01), 50)], [], FORBIDDEN[1]),
        (COMMAND, [(build_process(0x047C, 0x2000, 0x20), 50)], [], FORBIDDEN[1]),
        (COMMAND, [(build_process(0x047C, 0x2000, 0x3F), 50)], [], FORBIDDEN[1]),
        (COMMAND, [(build_process(0x047C, 0x2000, 0x82), 50)], [], DISTURBED),
        (COMMAND, [(ALTERED + b"\x00", 50)], [], FORBIDDEN[1]),
        (COMMAND, [(b"\x00" + ALTERED, 50)], [], FORBIDDEN[1]),
        (COMMAND, [(b"\x02" + ALTERED, 50)], [], FORBIDDEN[1]),
        (COMMAND, [(b"\x02\x20" + ALTERED, 50)], [], FORBIDDEN[1]),
        (COMMAND, [(TELEGRAM + ALTERED, 50)], [], FORBIDDEN[0]),
        (COMMAND, [(TELEGRAM + TELEGRAM + TELEGRAM, 50)], [], FORBIDDEN[0]),
        (COMMAND, [(TELEGRAM + b"\x00", 50)], [], DISTURBED),
        # The driver is off for a moment that no drive notices.
        (COMMAND, [(ALTERED[:4], 50), (ALTERED[4:], 50 + 5 * 11 / 9.6)], [], FORBIDDEN[1]),
        (COMMAND, [(ALTERED[:4], 50), (ALTERED[4:], 50 + 7 * 11 / 9.6)], [], DISTURBED),
        (COMMAND, [(build_process(0x047C, 0, 0x01), 90)], [(CONFIRMED, 75)], FORBIDDEN[1]),
        (rtu.build(1, rtu.read_coils(0, 8)), [(build_process(0x047C, 0, 0x01), 50)], [], FORBIDDEN[0]),
        (COMMAND[:-1] + b"\x00", [(TELEGRAM, 50)], [], FORBIDDEN[0]),
        (rtu.build(9, COMMAND[1:-2]), [(TELEGRAM, 50)], [], FORBIDDEN[0]),  # another unit's
        (
            rtu.build(1, rtu.read_coils(0, 8)),
            [(build_process(0, 0), 50)],
            [],
            "unrequested telegram, bit 10 = 0",
        ),
    ],
)
def test_verdict_on_telegrams(asked, sent, replies, expected):
    assert verdict_of(asked, sent, replies) == expected


@each_row(
    ("newer", "expected"),
    [
        ([READING], FORBIDDEN[1]),  # it waits for the drive
        ([READING, rtu.read_coils(0, 8)], "telegram again or late"),  # the reading waits no more
        ([rtu.write_register(5, 1), rtu.read_coils(0, 8)], "telegram again or late"),  # a refused write
        ([rtu.write_register(5139, 1), rtu.read_coils(0, 8)], FORBIDDEN[0]),  # the write waits still
    ],
)
def test_a_repeat_waits_for_no_newer_telegram(newer, expected):
    """Of a command whose reply was lost (FC-9, FRAME-7)."""
    ms = LINE.clk_hz / 1000
    later = [each for n, pdu in enumerate(newer) for each in heard(rtu.build(1, pdu), (80 + 20 * n) * ms)]
    assert verdict_of(COMMAND, [(TELEGRAM, 50), (TELEGRAM, 200)], [], later) == expected


@pytest.mark.rule("SAFE-4", "WDG-1")
@each_row("confirmed", [True, False])
@each_row("reset_ms", [NEVER, 80.0])
def test_only_a_restart_forgets_a_confirmed_command(confirmed, reset_ms):
    """Later the reference alone is written: the telegram has the command again."""
    newer = heard(rtu.build(1, bytes.fromhex("0f 0010 0010 02 2222")), 90 * LINE.clk_hz / 1000)

    def verdict(word: int) -> str:
        sent = [(TELEGRAM, 50), (build_process(word, 0x2222), 120)]
        return verdict_of(COMMAND, sent, [(CONFIRMED, 75)] * confirmed, newer, reset_ms)

    may_forget = not confirmed or reset_ms < NEVER
    assert verdict(0x047C) == ""
    assert verdict(0) == ("" if may_forget else "altered telegram, bit 10 = 0")
    assert verdict(0x043C) == FORBIDDEN[1]


@pytest.mark.rule("SAFE-2")
@each_row(("data", "expected"), [(TELEGRAM, "driver stuck"), (ALTERED, FORBIDDEN[1])])
def test_driver_that_stays_on_is_reported_with_its_telegram(data, expected):
    ms = LINE.clk_hz / 1000
    on = burst(drive_line(LINE.clk_hz), data, 50 * ms)
    on.fall = int(140 * ms)
    played = Played(heard(COMMAND, 40 * ms), [], [], [on], on.fall, [])
    assert class_of(played) == expected


@each_row(
    ("path", "until_ms", "stuck"),
    [("uart_i.state", 400, True), ("switches_i.baud", 400, False), ("switches_i.baud", 3000, True)],
)
def test_a_reply_at_another_rate_is_no_stuck_driver(path, until_ms, stuck):
    """At 300 bit/s eight characters take 0.3 s, but the longest frames no more than 2.6 s."""
    ms = LINE.clk_hz / 1000
    reply = burst(LINE, CONFIRMED, 50 * ms)
    reply.fall = int(until_ms * ms)
    played = Played(heard(COMMAND, 40 * ms), [], [reply], [], reply.fall, [])
    assert (class_of(played, path) == FORBIDDEN[-1]) == stuck


def class_of(played: Played, path: str = "somewhere") -> str:
    player = SimpleNamespace(line=LINE, resets=0, reset_from=NEVER)
    return classify(Flip(0, path, 0, 0, "card"), played, Verdict(), player, set()).what


@each_row("what", [FORBIDDEN[0], FORBIDDEN[-1], DISTURBED])
def test_an_unrequested_command_is_wrong(what):
    notable = [{"trial": "1/0", "flip": "x", "what": what, "why": "y"}]
    assert bool(flips.CAMPAIGN.wrong({"notable": notable})) == (what in FORBIDDEN)


def test_each_bit_of_the_memory_is_there_once_and_every_part_can_be_chosen(places):
    there = sum(places.bits(part) for part in ("frame memory", "data", "code"))
    assert there == configuration("standard")["memory_bytes"] // 4 * 36
    assert places.bits("core registers") == 2 * 31 * 32
    hit = Counter(
        (word, bit)
        for part in ("frame memory", "data", "code")
        for memory, words, _ in places.by_part[part]
        for word in words
        for bit in memory.bits
    )
    assert set(hit.values()) == {1} and len(hit) == there
    found = Counter(places.choose(random.Random(seed), 0).part for seed in range(1000))
    for part, weight in PARTS.items():
        assert abs(found[part] / 1000 - weight / sum(PARTS.values())) < 0.05, part


@each_row(("seen", "tries", "bound"), [(0, 46_049, 1.0e-4), (1, 100, 0.0645), (5, 5, 1.0)])
def test_bound_of_what_was_seen_so_often(seen, tries, bound):
    assert at_most(seen, tries) == pytest.approx(bound, rel=5e-3)
    assert at_most(seen, tries) <= float(words(seen, tries)) <= 1.01 * at_most(seen, tries)
