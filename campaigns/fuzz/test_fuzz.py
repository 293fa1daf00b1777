# SPDX-License-Identifier: Apache-2.0
"""The fuzzer's part of every test run: random lines and drives, each difference to the models is a failure.

`make fuzz` is the long version. The tests also show that its silence means something: planted bugs are found,
reduced, and can be played again.
"""

from __future__ import annotations

import functools
import json
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest

from campaigns.fuzz import case_file
from campaigns.fuzz.case import Pace, Played, clk_hz
from campaigns.fuzz.plants import card_with, named
from campaigns.fuzz.recorded import recorded_frames
from campaigns.fuzz.run import CaseError, replay, smaller
from campaigns.fuzz.traffic import QUIET_PULSES_BITS, make
from campaigns.fuzz.trial import aftermath, run, story, until
from rtl.sources import ROOT
from sim.harness.library import Target
from tb.agents import rtu
from tb.agents.crc16 import crc_good, with_crc
from tb.lib.recorded_buses import BUSES
from tb.lib.rows import each_row
from tb.lib.seeds import seeded
from tb.model.card import DRIVE_TIMEOUT, CardModel, word
from tb.model.fc_telegram import build_parameter, build_process
from tb.model.whole_card import LineJudge
from tb.model.wire import Burst, CardCharacter, FarCharacter, LineFormat, drive_line

# Frames and rates: cheap rates, and all rates. `make test` runs the last two.
SHARDS = (*((1200, (38400, 19200)),) * 2, (200, ()), (60, ()), (150, (38400, 19200)))
EVERYWHERE = (
    *("FRAME-1", "FRAME-2", "FRAME-3", "FRAME-4", "FRAME-5", "FRAME-6", "FRAME-7", "FRAME-8"),
    *("FC-1", "FC-8", "FC-9", "FC-10", "EXC", "MAP-3", "LINE-5", "LINE-6", "SAFE-1", "SAFE-2", "SAFE-3"),
)


@pytest.mark.rule(*EVERYWHERE)
@pytest.mark.parametrize(
    "number", [*(pytest.param(number, marks=pytest.mark.nightly) for number in range(3)), 3, 4]
)
def test_random_lines_and_drives_show_no_difference(number):
    frames, bauds = SHARDS[number]
    found = until(seeded(f"fuzz {number}").randrange(1 << 31), frames, Target(), bauds)
    assert not found["differences"]
    assert found["judged"] >= frames
    # Most frames must have been judged, and have tested something. One case in which the judge stops early is
    # a fifth of the small run.
    assert found["judged"] > (0.85 if frames > 1000 else 0.5) * found["frames"]
    assert found["outcomes"]["commit"] > frames / 4
    assert found["outcomes"]["reply of the drive"] > frames / 12


# Cases in which the card was right and an earlier judge was wrong.
CASES = sorted((ROOT / "campaigns/fuzz/cases").glob("*.json"))
SMALL_CARDS_CASES = sorted((ROOT / "campaigns/fuzz/cases/tiny").glob("*.json"))


@pytest.mark.rule("FC-9", "FRAME-7")
@pytest.mark.parametrize("path", CASES, ids=[path.stem for path in CASES])
def test_judge_accepts_either_of_two_right_outcomes(path):
    verdict, _ = run(json.loads(path.read_text()), Target())
    assert not verdict.differences


@pytest.mark.nightly
@pytest.mark.rule("FRAME-7")
@pytest.mark.parametrize("path", SMALL_CARDS_CASES, ids=[path.stem for path in SMALL_CARDS_CASES])
def test_judge_accepts_either_of_two_right_outcomes_of_the_small_card(path):
    verdict, _ = run(json.loads(path.read_text()), Target(config="tiny"))
    assert not verdict.differences


def after_the_judge(case: dict) -> tuple[Played, Callable[[Played], list[str]]]:
    """Plays a case in which the judge stops; returns the traffic, and a check for changed traffic."""
    verdict, played = run(case, Target())
    line = LineFormat(case["baud"], case["form"], clk_hz(case["baud"]))
    check = functools.partial(aftermath, case, line=line, verdict=verdict, wait=15)
    assert verdict.unclear and not verdict.differences and not check(played)
    assert played.judged(verdict.until) < len(played.frames)
    return played, check


@pytest.mark.rule("SAFE-1", "SAFE-3", "FC-9")
@pytest.mark.parametrize("name", ["4711/93", pytest.param("4711/125", marks=pytest.mark.nightly)])
def test_unrequested_commands_and_missing_answers_are_found_after_the_judge(name):
    """Cases with writes of coils, as in most random cases."""
    case = make(name)
    played, check = after_the_judge(case)
    assert "nothing to the good request 03" in check(replace(played, replies=played.replies[:-1]))[0]
    assert " and " in check(replace(played, replies=[*played.replies, played.replies[-1]]))[0]
    command, parameter = played.telegrams[-2:]  # the last two requests'
    drive = drive_line(clk_hz(case["baud"]))

    def with_more(data: bytes, at: float) -> Played:
        telegrams = sorted([*played.telegrams, burst(drive, data, at)], key=lambda burst: burst.rise)
        return replace(played, telegrams=telegrams)

    pause = 30 * drive.bit
    before = command.rise - pause - 8 * drive.character_bits * drive.bit
    start = build_process(0x047C, 0x4000)
    for data in (start, b"\0" + start, build_process(0x047C, 0x4000, 0x20), build_parameter(2, 514, 0, 1)):
        assert "SAFE-1" in check(with_more(data, before))[0], data.hex(" ")
    # The last command again, after its answer.
    assert "SAFE-1" in check(with_more(command.data, parameter.fall + pause))[0]


@pytest.mark.rule("FRAME-3")
@pytest.mark.parametrize("frames", [80, pytest.param(400, marks=pytest.mark.nightly)])
def test_lenient_card_follows_the_lenient_rule(frames: int):
    lenient = card_with(named("lenient-t15"))
    seed = seeded("lenient").randrange(1 << 31)
    assert not until(seed, frames, lenient, (38400,), strict_t15=False)["differences"]


# ---------------------------------------------------------------- planted bugs


@pytest.mark.parametrize(
    ("name", "frames"),
    [
        ("lenient-t15", 1500),
        pytest.param("newest-not-served", 2500, marks=pytest.mark.nightly),
        pytest.param("any-pnu", 2500, marks=pytest.mark.nightly),
        pytest.param("short-adr", 500, marks=pytest.mark.nightly),
    ],
)
def test_a_planted_bug_is_found(name, frames):
    found = until(1, frames, card_with(named(name)), (38400,), stop=True)
    print(f"{name}: {found['differences']}")
    assert found["differences"], f"{name} lived through {found['frames']} frames"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "case"),
    [
        ("repeat-although-a-reading-waits", "reading-behind-a-write-to-a-silent-drive"),
        ("wait-shortened-by-a-local-request", "reading-overtaken-in-a-long-wait"),
    ],
)
def test_a_planted_bug_is_found_in_a_kept_case(name, case):
    """Random sequences seldom meet these moments."""
    verdict, _ = run(case_file.read(ROOT / f"campaigns/fuzz/cases/{case}.json"), card_with(named(name)))
    assert verdict.differences


@pytest.mark.nightly
@pytest.mark.rule("SAFE-1", "FC-5")
def test_a_firmware_that_puts_a_command_into_every_parameter_commands_nothing():
    """From the function code on one pin to bit 10 on the other, on the wired card."""
    read = {"what": "legal", "gap": ["idle", 20.0], "bytes": with_crc(bytes.fromhex("01 03 1413 0002")).hex()}
    start = {"what": "legal", "gap": ["idle", 400.0], "bytes": START.hex()}
    case = {**make("1/1", (38400,)), "form": "8E1", "address": 1, "dialect": "card", "profile": "vlt6000"}
    _, played = run({**case, "events": [read, start]}, card_with(named("command-in-a-parameter")))
    words = [(len(burst.data), int.from_bytes(burst.data[-5:-3], "big")) for burst in played.telegrams]
    # The parameter's two attempts carry the planted word without bit 10; the drive refuses them.
    assert words[:2] == [(16, 0x007C)] * 2
    assert (8, 0x047C) in words
    assert not [word for length, word in words if length == 16 and word & 0x0400]


@pytest.mark.nightly
def test_difference_gives_a_small_replayable_case_and_a_waveform(tmp_path):
    target = card_with(named("no-repeat"))
    (found,) = until(1, 1500, target, (38400,), stop=True)["differences"]
    smaller(found["case"], "standard", functools.partial(run, target=target), tmp_path)
    (kept,) = tmp_path.glob("*.json")
    case = json.loads(kept.read_text())
    assert len(case["events"]) <= 3
    again, played = run(case, target)
    assert again.differences
    assert story(case, played, again, Pace())[-1] == f"DIFFERENCE {again.differences[-1]}"
    assert kept.with_suffix(".fst").stat().st_size > 10_000
    own, _ = run(case, Target())
    assert not own.differences


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"baud": 19201}, "'baud' cannot be 19201"),
        ({"seed": 1}, "the case: 'seed' is not known"),
        (
            {"events": [{"gap": ["idle", 1.0], "pulses": [1], "bytes": "01"}]},
            "one of 'bytes', 'pdu', 'pulses'",
        ),
        ({"events": [{"gap": ["at", 1], "bytes": "01"}]}, "event 0: 'gap' cannot be"),
        ({"events": [{"gap": ["idle", 1], "bytes": "01", "drive": [{"gpa": 3}]}]}, "event 0, drive: 'gpa'"),
    ],
)
def test_invalid_case_is_refused(tmp_path, change, complaint):
    path = tmp_path / "case.json"
    path.write_text(json.dumps(make("9/1") | change))
    with pytest.raises(CaseError, match=re.escape(complaint)):
        replay(path, None, Target())
    path.write_text("{")
    with pytest.raises(CaseError, match="no case of the fuzzer"):
        replay(path, None, Target())


def test_kept_cases_are_valid_files():
    for path in (*CASES, *SMALL_CARDS_CASES):
        assert case_file.read(path)


@pytest.mark.nightly
def test_a_case_is_reproducible():
    assert make("7/3") == make("7/3")
    assert make("7/3") != make("7/4")
    first, second = (run(make("7/3", (115200,)), Target()) for _ in range(2))
    assert (first[0].counts, first[1].end) == (second[0].counts, second[1].end)


# ---------------------------------------------------------------- generated traffic


HARM = (
    *("flaw parity", "flaw stop", "wrong CRC", "fast sender", "slow sender", "glitches", "noise", "break"),
    *("short gap", "middle gap", "long gap", "soon", "later", "babble", "rude babble", "interrupted"),
    *("drive silent", "drive bcc", "drive edit", "drive raw", "drive fault", "drive pwe", "drive flaws"),
    *("drive gaps", "drive cut", "drive before", "drive after", "drive bytes"),
    *("pulse in a silence", "pulse at the commit", "recorded", "recorded and damaged"),
    *("waiting broadcast", "waiting write", "waiting write of the card's own", "waiting reading"),
    "negative value beyond one register",
)
RECORDED = {frame.data.hex() for frames in recorded_frames() for frame in frames}


def waiting(event: dict, address: int) -> str:
    """What a request that waits for the drive is (FRAME-7)."""
    data = bytes.fromhex(event["bytes"])
    if data[1] in (1, 3):
        return "waiting reading"
    if data[0] != address:
        return "waiting broadcast"
    own = data[1] in (6, 16) and int.from_bytes(data[2:4], "big") < 10
    return "waiting write of the card's own" if own else "waiting write"


def test_traffic_has_every_kind_of_fault():
    """Each flaw, pulses, glitches, drifting senders, each length of a gap, each fault of the drive."""
    cases = [make(f"9/{number}") for number in range(400)]
    met: Counter = Counter()
    for case in cases:
        assert case_file.check(json.loads(json.dumps(case))) == case
        line = LineFormat(case["baud"], case["form"], clk_hz(case["baud"]))
        for event in case["events"]:
            drives = [part for manner in event.get("drive", []) for part in manner.get("parts", [manner])]
            met.update(f"flaw {flaw}" for flaw in event.get("flaws", {}).values())
            met.update(f"drive {key}" for manner in drives for key in manner)
            met.update(
                "short gap" if gap < line.t15_bits else "middle gap" if gap < line.t35_bits else "long gap"
                for gap in event.get("gaps", {}).values()
            )
            if event["gap"][0] == "own":
                met["soon" if event["gap"][1] < line.t35_bits else "later"] += 1
            met["break"] += any(bits > 10 for bits in event.get("pulses", []))
            met["noise"] += len(event.get("pulses", [])) > 2
            met["glitches"] += len(event.get("glitches", []))
            if event["what"] == "quiet_glitches":
                after = [
                    at - line.character_bits * len(event["bytes"]) / 2 - line.t35_bits
                    for at, _ in event.get("glitches", [])
                ]
                # Below a quarter bit each (LINE-5), and short together: each stops the count of the silence.
                places, widths = zip(*event.get("glitches", []) or [(0, 0.1)], strict=True)
                assert sum(widths) < QUIET_PULSES_BITS + 0.01 and all(0 < width < 0.25 for width in widths)
                assert all(later - before > 1 for before, later in pairwise(places))
                met["pulse in a silence"] += len(after)
                met["pulse at the commit"] += any(abs(bits) < 1 for bits in after)
            if event["what"] == "large_value" and word(bytes.fromhex(event["bytes"]), 4) == 1:
                met["negative value beyond one register"] += drives[0]["pwe"] == 0xFFFF7FFF
            if event["what"] == "recorded":
                whole = event["bytes"] in RECORDED and "glitches" not in event
                met["recorded" if whole else "recorded and damaged"] += 1
            if event["what"] == "waiting" and event["gap"][0] == "own":
                met[waiting(event, case["address"])] += 1
            met["fast sender"] += event.get("error", 0) > 0.02
            met["slow sender"] += event.get("error", 0) < -0.02
            met["babble"] += len(event.get("babble", {}).get("bytes", "")) > 2
            met["rude babble"] += event.get("babble", {}).get("rude", False)
            met["interrupted"] += "interrupt" in event
            met["wrong CRC"] += "bytes" in event and not crc_good(bytes.fromhex(event["bytes"]))
    assert not {kind: met[kind] for kind in HARM if met[kind] < 20}


def test_recorded_frames_are_those_of_the_recordings():
    """The good ones have the recordings' numbers (tb/captures/README.md), and a silence before them."""
    for bus, frames in zip(BUSES, recorded_frames(), strict=True):
        good = [
            frame
            for frame in frames
            if crc_good(frame.data) and not frame.flaws and frame.data[0] == bus.unit
        ]
        assert len(good) == bus.good
        assert all(frame.silence > 0.99 for frame in good)


# ---------------------------------------------------------------- the judge

LINE = LineFormat(19200, "8E1", 2_000_000)
READ = rtu.build(1, rtu.read_coils(0, 16))
ANSWER = rtu.build(1, bytes.fromhex("01 02 00 00"))
START = rtu.build(1, rtu.write_coils(0, [bool(0x047C >> i & 1) for i in range(16)]))
STARTED = rtu.build(1, bytes.fromhex("0F 00 00 00 10"))
T35 = LINE.t35_bits * LINE.bit


def heard(line: LineFormat, data: bytes, at: float) -> list[FarCharacter]:
    character = line.character_bits * line.bit
    return [FarCharacter(at + i * character, at + (i + 1) * character, byte) for i, byte in enumerate(data)]


def burst(line: LineFormat, data: bytes, at: float) -> Burst:
    sent = [CardCharacter(round(c.start), c.end, c.byte, True) for c in heard(line, data, at + line.bit / 4)]
    return Burst(round(at), round(sent[-1].end), sent)


def verdict_on(network, replies=(), telegrams=(), drive=(), until=2e6, wait=15):
    card = CardModel()
    card.registers[DRIVE_TIMEOUT] = wait
    judge = LineJudge(card, LINE, 1, budget=8000)
    return judge.evaluate(network, list(drive), list(replies), list(telegrams), until)


@each_row(
    ("late_bits", "answer", "complaint"),
    [
        (0.0, ANSWER[:-1] + b"\x00", "expected"),
        (-2.0, ANSWER, "without a request"),
        (90.0, ANSWER, "no reply"),
        (None, b"", "no reply"),
    ],
)
def test_judge_detects_a_wrong_reply(late_bits, answer, complaint):
    asked = heard(LINE, READ, 1e5)
    replies = [burst(LINE, answer, asked[-1].end + T35 + late_bits * LINE.bit)] if answer else []
    assert complaint in verdict_on(asked, replies).differences[0]


def test_judge_detects_a_reply_into_traffic():
    asked = heard(LINE, START, 1e5)
    commit = asked[-1].end + T35
    drive = drive_line(LINE.clk_hz)
    telegram = burst(drive, build_process(0x047C, 0), commit)
    answered = heard(drive, build_process(0x0F03, 0), telegram.fall + 24 * drive.bit)
    reply = burst(LINE, STARTED, answered[-1].end)
    assert not verdict_on(asked, [reply], [telegram], answered).differences
    newer = heard(LINE, b"\x55", answered[0].start)
    assert not verdict_on(asked + newer, [], [telegram], answered).differences
    assert "FRAME-7" in verdict_on(asked + newer, [reply], [telegram], answered).differences[0]


def test_judge_detects_an_unrequested_telegram():
    asked = heard(LINE, START, 1e5)
    drive = drive_line(LINE.clk_hz)
    revoked = asked + heard(LINE, b"\x01", asked[-1].end + 25 * LINE.bit)
    telegram = burst(drive, build_process(0x047C, 0), asked[-1].end + T35)
    assert "SAFE-1" in verdict_on(revoked, [], [telegram]).differences[0]
    assert "no telegram" in verdict_on(asked).differences[0]


DRIVE = drive_line(LINE.clk_hz)


def sent_so(whole: Burst, **changed) -> Burst:
    """The burst with moved `rise`, `fall` or `characters`."""
    moved = {key: getattr(whole, key) + by for key, by in changed.items() if key != "characters"}
    return replace(whole, **(changed | moved))


def damaged(whole: Burst) -> list[CardCharacter]:
    return [replace(c, good=i != 2) for i, c in enumerate(whole.characters)]


def with_a_gap(whole: Burst, late: float) -> Burst:
    characters = [
        replace(c, start=c.start + late, end=c.end + late) if i > 2 else c
        for i, c in enumerate(whole.characters)
    ]
    return sent_so(whole, characters=characters, fall=late)


@each_row(
    ("whose", "change", "complaint"),
    [
        ("reply", lambda b, line: sent_so(b, characters=damaged(b)), "a damaged character"),
        ("reply", lambda b, line: with_a_gap(b, 0.5 * line.bit), "a gap"),
        ("reply", lambda b, line: sent_so(b, rise=-2 * line.bit), "driver on too early"),
        ("reply", lambda b, line: sent_so(b, fall=2 * line.bit), "driver off at the wrong time"),
        ("reply", lambda b, line: sent_so(b, fall=-line.bit), "driver off at the wrong time"),
        ("reply", lambda b, line: sent_so(b, characters=[]), "a damaged character"),
        ("telegram", lambda b, line: sent_so(b, characters=damaged(b)), "a damaged character"),
        ("telegram", lambda b, line: with_a_gap(b, 0.5 * line.bit), "a gap"),
        ("telegram", lambda b, line: sent_so(b, rise=-2 * line.bit), "driver on too early"),
        ("telegram", lambda b, line: sent_so(b, fall=2 * line.bit), "driver off at the wrong time"),
        ("telegram", lambda b, line: burst(line, build_process(0x047D, 0), b.rise), "expected 02 06 81 04"),
    ],
)
def test_judge_checks_the_shape_of_frames_and_telegrams(whose, change, complaint):
    asked = heard(LINE, START, 1e5)
    telegram = burst(DRIVE, build_process(0x047C, 0), asked[-1].end + T35 + 1000)
    answered = heard(DRIVE, build_process(0x0F03, 0), telegram.fall + 24 * DRIVE.bit)
    reply = burst(LINE, STARTED, answered[-1].end + 1000)
    assert not verdict_on(asked, [reply], [telegram], answered).differences
    sent = {"reply": (reply, LINE), "telegram": (telegram, DRIVE)}
    changed = {kind: one for kind, (one, _) in sent.items()} | {whose: change(*sent[whose])}
    (difference,) = verdict_on(asked, [changed["reply"]], [changed["telegram"]], answered).differences
    assert complaint in difference and difference.split(": ")[1].startswith(whose)


def test_judge_detects_a_short_pause():
    asked = heard(LINE, START, 1e5)
    commit = asked[-1].end + T35
    for bits, short in ((22.5, False), (20.0, True)):
        noise = heard(DRIVE, b"\x55", commit - (11 + bits - 1) * DRIVE.bit)
        telegram = burst(DRIVE, build_process(0x047C, 0), noise[-1].end + bits * DRIVE.bit)
        differences = verdict_on(asked, [], [telegram], noise, until=telegram.fall).differences
        assert bool(differences) == short and all("pause too short" in what for what in differences)
