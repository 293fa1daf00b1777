# SPDX-License-Identifier: Apache-2.0
"""The fuzzer's part of every test run: random lines and drives, each difference to the models is a failure.

`make fuzz` is the long version. The tests also show that its silence means something: planted bugs are found,
reduced, and can be played again.
"""

from __future__ import annotations

import functools
import json
import re
import subprocess
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from campaigns.bench import fingerprint
from campaigns.flips.run import FORBIDDEN
from campaigns.flips.trial import PARTS
from campaigns.fuzz import case_file
from campaigns.fuzz import page as fuzz_page
from campaigns.fuzz import report as fuzz_report
from campaigns.fuzz import run as fuzz
from campaigns.fuzz.aftermath import asked, possible_frames
from campaigns.fuzz.case import Pace, Played, Player, clk_hz, own_pace
from campaigns.fuzz.plants import PLANTS, named
from campaigns.fuzz.recorded import recorded_frames
from campaigns.fuzz.run import CaseError, replay, shard, story
from campaigns.fuzz.traffic import QUIET_PULSES_BITS, make
from campaigns.fuzz.trial import aftermath, run
from rtl.sources import ROOT, card_files, configurations
from sim.harness.library import Target
from sw.test.host import INCLUDES
from tb.agents import rtu
from tb.agents.crc16 import crc_good, with_crc
from tb.lib.recorded_buses import BUSES
from tb.lib.seeds import seeded
from tb.model.card import DRIVE_TIMEOUT, CardModel, word
from tb.model.fc_telegram import ADR_BROADCAST, build_parameter, build_process
from tb.model.whole_card import LineJudge
from tb.model.wire import Burst, CardCharacter, FarCharacter, LineFormat, drive_line

# Frames and rates of each shard: cheap rates, and shards with all rates. `make test` runs the last two.
SHARDS = (*((1200, (38400, 19200)),) * 4, (200, ()), (60, ()), (150, (38400, 19200)))
EVERYWHERE = (
    *("FRAME-1", "FRAME-2", "FRAME-3", "FRAME-4", "FRAME-5", "FRAME-6", "FRAME-7", "FRAME-8"),
    *("FC-1", "FC-8", "FC-9", "FC-10", "EXC", "MAP-3", "LINE-5", "LINE-6", "SAFE-1", "SAFE-2", "SAFE-3"),
)


@pytest.mark.rule(*EVERYWHERE)
@pytest.mark.parametrize(
    "number", [*(pytest.param(number, marks=pytest.mark.slow) for number in range(5)), 5, 6]
)
def test_random_lines_and_drives_show_no_difference(number, tmp_path):
    frames, bauds = SHARDS[number]
    result = shard(seeded(f"fuzz {number}").randrange(1 << 31), frames, bauds=bauds, folder=tmp_path)
    print(result)
    assert not result.differences
    assert result.judged >= frames
    # Most frames must have been judged, and have tested something. One case in which the judge stops early is
    # a fifth of the small shard.
    assert result.judged > (0.85 if frames > 1000 else 0.5) * result.frames
    assert result.outcomes["commit"] > frames / 4 and result.outcomes["reply of the drive"] > frames / 12


# Cases in which the card was right and an earlier judge was wrong.
CASES = sorted((ROOT / "campaigns/fuzz/cases").glob("*.json"))
SMALL_CARDS_CASES = sorted((ROOT / "campaigns/fuzz/cases/tiny").glob("*.json"))


@pytest.mark.rule("FC-9", "FRAME-7")
@pytest.mark.parametrize("path", CASES, ids=[path.stem for path in CASES])
def test_judge_accepts_either_of_two_right_outcomes(path):
    verdict, _ = run(json.loads(path.read_text()), Target())
    assert not verdict.differences


@pytest.mark.slow
@pytest.mark.rule("FRAME-7")
@pytest.mark.parametrize("path", SMALL_CARDS_CASES, ids=[path.stem for path in SMALL_CARDS_CASES])
def test_judge_knows_that_the_small_card_has_one_place(path):
    verdict, _ = run(json.loads(path.read_text()), Target(config="tiny"))
    assert not verdict.differences


@pytest.mark.slow
@pytest.mark.rule("FRAME-7")
def test_a_dropped_reading_leaves_at_once_or_not_at_all():
    """The reading of the kept case leaves 0.4 ms after the newer write; here, much later."""
    (path,) = (path for path in SMALL_CARDS_CASES if path.stem == "reading-leaves-as-a-newer-write-commits")
    case = json.loads(path.read_text())
    player = Player(case, Target(config="tiny"))
    played = player.play()
    reading, later = played.telegrams[0], 6 * player.line.clk_hz // 1000
    until = reading.rise + later + 1

    def differences(telegram: Burst) -> list[str]:
        judge = LineJudge(CardModel(), player.line, case["address"], player.pace.budget_clocks, places=1)
        return judge.evaluate(played.network, played.drive, played.replies, [telegram], until).differences

    assert not differences(reading)
    (said,) = differences(shifted(reading, later))
    assert "telegram 02 0e 81 10 7d" in said and "expected 02 0e 81 22 04" in said


def shifted(burst: Burst, clocks: int) -> Burst:
    characters = [replace(one, start=one.start + clocks, end=one.end + clocks) for one in burst.characters]
    return replace(burst, rise=burst.rise + clocks, fall=burst.fall + clocks, characters=characters)


def after_the_judge(case: dict) -> tuple[Played, Callable[[Played], list[str]]]:
    """Plays a case in which the judge stops; returns the traffic, and a check for changed traffic."""
    verdict, played = run(case, Target())
    line = LineFormat(case["baud"], case["form"], clk_hz(case["baud"]))
    check = functools.partial(aftermath, case, line=line, verdict=verdict, wait=15)
    assert verdict.unclear and not verdict.differences and not check(played)
    assert played.judged(verdict.until) < len(played.frames)
    return played, check


@pytest.mark.rule("SAFE-3")
def test_last_answers_are_checked_after_the_judge():
    played, check = after_the_judge(make("4711/93"))
    mute = replace(played, replies=played.replies[:-1])
    assert "nothing to the good request 03" in check(mute)[0]
    twice = replace(played, replies=[*played.replies, played.replies[-1]])
    assert " and " in check(twice)[0]


@pytest.mark.rule("SAFE-1", "FC-9")
@pytest.mark.parametrize("name", ["4711/93", "4711/119", "4711/142"])
def test_unrequested_commands_are_found_after_the_judge(name):
    """Cases with writes of coils, as in most random cases."""
    case = make(name)
    played, check = after_the_judge(case)
    command, parameter = played.telegrams[-2:]  # the last two requests'
    drive = drive_line(clk_hz(case["baud"]))

    def sent(data: bytes, at: float) -> Burst:
        character = drive.character_bits * drive.bit
        ends = [at + (i + 1) * character for i in range(len(data))]
        characters = [
            CardCharacter(round(e - character), e, b, True) for e, b in zip(ends, data, strict=True)
        ]
        return Burst(round(at), round(ends[-1]), characters)

    def with_more(data: bytes, at: float) -> Played:
        telegrams = sorted([*played.telegrams, sent(data, at)], key=lambda burst: burst.rise)
        return replace(played, telegrams=telegrams)

    pause = 30 * drive.bit
    before = command.rise - pause - 8 * drive.character_bits * drive.bit
    start = build_process(0x047C, 0x4000)
    for data in (start, b"\0" + start, build_process(0x047C, 0x4000, 0x20), build_parameter(2, 514, 0, 1)):
        assert "SAFE-1" in check(with_more(data, before))[0], data.hex(" ")
    # The last command again, after its answer.
    assert "SAFE-1" in check(with_more(command.data, parameter.fall + pause))[0]


def test_possible_states_are_limited():
    """Commands of single coils, none confirmed: each may have changed the control image or not."""
    line = LineFormat(38400, "8E1", clk_hz(38400))
    character = line.character_bits * line.bit
    data = [rtu.build(1, bytes([5, 0, coil, 0xFF, 0])) for coil in range(12)]
    heard = [
        FarCharacter(at := (30 * n + k) * character, at + character, byte)
        for n, frame in enumerate(data)
        for k, byte in enumerate(frame)
    ]
    frames = possible_frames(heard, line, 1)
    assert [frame.data for frame in frames] == data
    assert not asked(frames, [], "card") and asked(frames[:6], [], "card")
    assert len(frames[5].telegrams) == 32


@pytest.mark.rule("FRAME-3")
@pytest.mark.parametrize("frames", [80, pytest.param(400, marks=pytest.mark.slow)])
def test_lenient_card_follows_the_lenient_rule(frames: int, tmp_path):
    lenient = named("lenient-t15").target()
    seed = seeded("lenient").randrange(1 << 31)
    result = shard(seed, frames, bauds=(38400,), target=lenient, folder=tmp_path, strict_t15=False)
    assert not result.differences


# ---------------------------------------------------------------- planted bugs


@pytest.mark.parametrize(
    ("name", "frames"),
    [
        ("lenient-t15", 1500),
        pytest.param("newest-not-served", 2500, marks=pytest.mark.slow),
        pytest.param("any-pnu", 2500, marks=pytest.mark.slow),
        pytest.param("short-adr", 500, marks=pytest.mark.slow),
    ],
)
def test_a_planted_bug_is_found(name, frames, tmp_path):
    result = shard(
        1, frames, bauds=(38400,), target=named(name).target(), folder=tmp_path, small=False, stop_at=1
    )
    print(f"{name}: {result.differences}")
    assert result.differences, f"{name} lived through {result.frames} frames"


@pytest.mark.slow
@pytest.mark.rule("SAFE-1", "FC-5")
def test_a_firmware_that_puts_a_command_into_every_parameter_commands_nothing():
    """From the function code on one pin to bit 10 on the other, on the wired card."""
    read = {"what": "legal", "gap": ["idle", 20.0], "bytes": with_crc(bytes.fromhex("01 03 1413 0002")).hex()}
    start = {"what": "legal", "gap": ["idle", 400.0], "bytes": START.hex()}
    case = {**make("1/1", (38400,)), "form": "8E1", "address": 1, "dialect": "card", "profile": "vlt6000"}
    _, played = run({**case, "events": [read, start]}, named("command-in-a-parameter").target())
    words = [(len(burst.data), int.from_bytes(burst.data[-5:-3], "big")) for burst in played.telegrams]
    # The parameter's two attempts carry the planted word without bit 10; the drive refuses them.
    assert words[:2] == [(16, 0x007C)] * 2
    assert (8, 0x047C) in words
    assert not [word for length, word in words if length == 16 and word & 0x0400]


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_every_plant_applies_and_fits(plant, tmp_path):
    if not plant.old:
        return
    changed = tmp_path / Path(plant.file).name
    changed.write_text(plant._changed())
    if plant.file.startswith("rtl/"):
        sources = [changed if path == ROOT / plant.file else path for path in card_files()]
        check = ["iverilog", "-g2005", "-t", "null", "-s", "rtu2fc", *sources]
    else:
        # A header is first searched in its own folder.
        source = changed if changed.suffix == ".c" else ROOT / "sw/src/gateway.c"
        check = ["gcc", "-std=c99", "-fsyntax-only", f"-I{tmp_path}", *INCLUDES, source]
    done = subprocess.run(check, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_difference_gives_a_small_replayable_case_and_a_waveform(tmp_path):
    target = named("no-repeat").target()
    result = shard(1, 1500, bauds=(38400,), target=target, folder=tmp_path, stop_at=1)
    (found,) = result.differences
    assert found["events"] <= 3
    kept = tmp_path / found["file"]
    case = json.loads(kept.read_text())
    again, played = run(case, target)
    assert again.differences == found["what"]
    assert story(case, played, again, Pace())[-1] == f"DIFFERENCE {found['what'][0]}"
    assert kept.with_suffix(".fst").stat().st_size > 10_000
    own, _ = run(case, Target())
    assert not own.differences


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{", "no case of the fuzzer"),
        ("[]", "the case is no object"),
        ('{"seed": 1}', "the case has no 'baud'"),
        ("baud: 19201", "'baud' cannot be 19201"),
        ("form: 8X1", "'form' cannot be"),
        ("address: 300", "'address' cannot be 300"),
        ("dialect: none", "'dialect' cannot be"),
        ("profile: vlt", "'profile' cannot be"),
        ("events: 3", "'events' cannot be 3"),
        ("event: gap None", "event 0 has no 'gap'"),
        ('event: gap ["at", 1]', "event 0: 'gap' cannot be"),
        ("event: bytes 012", "'bytes' cannot be"),
        ('event: bytes ""', "'bytes' cannot be"),
        ("event: byts 01", "'byts' is not known"),
        ('event: flaws {"0": "pairity"}', "'flaws' cannot be"),
        ("event: pulses [1]", "one of 'bytes', 'pdu', 'pulses'"),
        ('event: drive [{"gpa": 3}]', "event 0, drive: 'gpa' is not known"),
        ("event: babble {}", "event 0: 'babble' cannot be"),
    ],
)
def test_invalid_case_is_refused(tmp_path, text, complaint):
    """A good case with one change, or an invalid file."""
    case = {"baud": 19200, "form": "8E1", "address": 1, "dialect": "card", "profile": "vlt6000"}
    case["events"] = [{"what": "legal", "gap": ["idle", 10.0], "bytes": "0101000000087dcc"}]
    assert case_file.check(case) == case
    if match := re.fullmatch(r"(?:(event): )?(\w+):? (.+)", text):
        try:
            value = json.loads(match[3])
        except ValueError:
            value = match[3]
        place = case["events"][0] if match[1] else case
        place[match[2]] = value
        if value == "None":
            del place[match[2]]
        text = json.dumps(case)
    path = tmp_path / "case.json"
    path.write_text(text)
    with pytest.raises(CaseError, match=re.escape(complaint)):
        replay(path, None)


def test_generated_cases_are_valid_files():
    for number in range(300):
        case = make(f"9/{number}")
        assert case_file.check(json.loads(json.dumps(case))) == case
    for path in (*CASES, *SMALL_CARDS_CASES):
        assert case_file.read(path)


@pytest.mark.parametrize("what", ["judged", "flips"])
def test_longer_result_of_the_same_seed_is_kept(tmp_path, what):
    path = tmp_path / "7.json"
    fuzz.refuse_to_lose_a_longer_result(path, 100, "this", what)
    path.write_text(json.dumps({"card": "this", what: 500}))
    fuzz.refuse_to_lose_a_longer_result(path, 500, "this", what)
    with pytest.raises(fuzz.FuzzError, match="has 500 of this seed"):
        fuzz.refuse_to_lose_a_longer_result(path, 499, "this", what)
    path.write_text(json.dumps({"card": "another", what: 500}))
    fuzz.refuse_to_lose_a_longer_result(path, 499, "this", what)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--replay", "x.json", "--seed", "4"], "--replay plays one case"),
        (["--replay", "x.json", "--count", "4"], "--replay plays one case"),
        (["--replay", "x.json", "--wave", "nowhere/x.fst"], "no file can be written there"),
        (["--replay", "x.json", "--wave", "."], "no file can be written there"),
        (["--wave", "x.fst"], "--wave is of a case"),
    ],
)
def test_contradicting_options_are_refused(monkeypatch, capsys, words, said):
    monkeypatch.setattr("sys.argv", ["fuzz", *words])
    with pytest.raises(SystemExit) as stopped:
        fuzz.main()
    assert stopped.value.code == 2 and said in capsys.readouterr().err


@pytest.mark.slow
def test_shard_is_reproducible():
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


def test_pulses_in_a_silence_are_short_and_apart():
    """Below a quarter bit each (LINE-5), and short together, because each stops the count of the silence."""
    for number in range(400):
        for event in make(f"9/{number}")["events"]:
            if event["what"] == "quiet_glitches" and "glitches" in event:
                places, widths = zip(*event["glitches"], strict=True) if event["glitches"] else ((), ())
                assert sum(widths) < QUIET_PULSES_BITS + 0.01 and all(0 < width < 0.25 for width in widths)
                assert all(later - before > 1 for before, later in pairwise(places))


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


def test_the_small_card_is_fuzzed_at_its_own_clock_and_with_its_one_image():
    cases = [make(f"9/{number}", config="tiny") for number in range(100)]
    assert {case["dialect"] for case in cases} == {"card"}
    assert own_pace("tiny").slow_clk_hz == configurations()["tiny"]["clk_hz"]


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


def test_judge_accepts_a_correct_exchange():
    asked = heard(LINE, READ, 1e5)
    verdict = verdict_on(asked, [burst(LINE, ANSWER, asked[-1].end + T35)])
    assert not verdict.differences and verdict.counts["function 01 answered"] == 1


@pytest.mark.parametrize(
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


@pytest.mark.parametrize(
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


def test_judge_detects_late_and_early_replies_of_the_drive():
    asked = heard(LINE, START, 1e5)
    telegram = burst(DRIVE, build_process(0x047C, 0), asked[-1].end + T35)
    answered = heard(DRIVE, build_process(0x0F03, 0), telegram.fall + 24 * DRIVE.bit)
    for late, complaint in ((30000.0, "no reply"), (-3 * LINE.bit, "without a request")):
        reply = burst(LINE, STARTED, answered[-1].end + late)
        assert complaint in verdict_on(asked, [reply], [telegram], answered).differences[0]


@pytest.mark.rule("FC-9")
def test_judge_requires_one_repeat_of_the_newest_request_only():
    asked = heard(LINE, START, 1e5)
    telegram = burst(DRIVE, build_process(0x047C, 0), asked[-1].end + T35)
    again = burst(DRIVE, telegram.data, telegram.fall + 150 * LINE.clk_hz / 1000 + 1000)
    wait = 170 * LINE.clk_hz / 1000
    assert not verdict_on(asked, [], [telegram, again], until=again.fall).differences
    assert "no telegram" in verdict_on(asked, [], [telegram], until=again.fall + wait).differences[0]
    third = burst(DRIVE, telegram.data, again.fall + 150 * LINE.clk_hz / 1000 + 1000)
    differences = verdict_on(asked, [], [telegram, again, third], until=third.fall).differences[0]
    assert "without a request (SAFE-1)" in differences
    newer = heard(LINE, READ, telegram.fall + 1000)
    answer = burst(LINE, rtu.build(1, bytes.fromhex("01 02 7C 04")), newer[-1].end + T35)
    differences = verdict_on(asked + newer, [answer], [telegram, again], until=again.fall).differences[0]
    assert "without a request (SAFE-1)" in differences
    assert not verdict_on(asked + newer, [answer], [telegram], until=again.fall + wait).differences
    to_all = heard(LINE, rtu.build(0, START[1:-2]), 1e5)
    telegram = burst(DRIVE, build_process(0x047C, 0, ADR_BROADCAST), to_all[-1].end + T35)
    again = burst(DRIVE, telegram.data, telegram.fall + 24 * DRIVE.bit)
    assert not verdict_on(to_all, [], [telegram], until=again.fall).differences
    assert "without a request (SAFE-1)" in verdict_on(to_all, [], [telegram, again]).differences[0]


@pytest.mark.rule("FC-9")
def test_judge_excuses_a_missing_repeat_only_while_the_drive_sends():
    asked = heard(LINE, START, 1e5)
    drive = drive_line(LINE.clk_hz)
    telegram = burst(drive, build_process(0x047C, 0), asked[-1].end + T35)
    wait = 10 * LINE.clk_hz / 1000
    silent = rtu.build(1, bytes.fromhex("8F FF"))
    talk = heard(drive, b"\x55" * 30, telegram.fall + 24 * drive.bit)
    reply = burst(LINE, silent, telegram.fall + 2.1 * wait)
    assert reply.start < talk[-1].end
    assert not verdict_on(asked, [reply], [telegram], talk, until=reply.fall, wait=1).differences
    early = burst(LINE, silent, telegram.fall + 1.5 * wait)
    assert "without a request" in verdict_on(asked, [early], [telegram], talk, wait=1).differences[0]
    assert "on a free line" in verdict_on(asked, [reply], [telegram], talk[:6], wait=1).differences[0]
    assert "on a free line" in verdict_on(asked, [reply], [telegram], wait=1).differences[0]


def test_judge_follows_either_outcome_of_an_open_rule():
    asked = heard(LINE, READ[:4], 1e5)
    torn = asked + heard(LINE, READ[4:], asked[-1].end + LINE.t15_bits * LINE.bit)
    assert verdict_on(torn).unclear and not verdict_on(torn).differences


# ---------------------------------------------------------------- the report


@pytest.mark.figures
def test_page_describes_this_card():
    """The judge may have become stricter since."""
    said = " ".join((ROOT / "docs/reports/fuzz.md").read_text().split())
    for config in configurations():
        card = f"{config} card `{fingerprint.card(config)}`, firmware `{fingerprint.firmware(config)}`"
        message = "run `make fuzz`, fuzz-plants, flips of both cards, core-flips and fuzz-page"
        assert said.count(card) == 2, message  # frames, flips


def result(
    seed: int, frames: int, differences: list[dict], card: str = "one", config: str = "standard"
) -> dict:
    return {
        "seed": seed,
        "config": config,
        "card": card,
        "frames": frames,
        "judged": frames - 1,
        "cases": 2,
        "events": {"legal": frames},
        "outcomes": {"commit": 1},
        "rates": {"9600 8E1": frames},
        "unclear": {},
        "worst": {"reply": float(seed)},
        "differences": differences,
        "wall_s": 1.0,
        "simulated_s": 2.0,
    }


def test_shards_are_merged(tmp_path, capsys, monkeypatch):
    found = [{"case": "22/1", "what": ["no reply"]}]
    for name, content in (
        ("fuzz-standard-1", result(1, 10, [])),
        ("fuzz-standard-22", result(22, 30, found)),
        ("fuzz-tiny-1", result(1, 7, [], "other", "tiny")),
        ("case-standard-22-1", {}),
    ):
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    monkeypatch.setattr("sys.argv", ["fuzz_report", str(tmp_path)])
    assert fuzz_report.main() == 1
    shown = capsys.readouterr().out
    for total in (
        "standard card one: 2 shards, 40 network frames in 4 cases, 38 of them judged to their end: 1 diff",
        "tiny card other: 1 shards, 7 network frames in 2 cases, 6 of them judged to their end: 0 diff",
    ):
        assert total in shown
    assert "no reply" in shown
    merged = fuzz_report.merge([result(1, 10, []), result(1, 10, []), result(2, 5, [])])
    assert merged["frames"] == 15 and merged["worst"] == {"reply": 2.0}
    assert merged["events"] == Counter(legal=15)
    with pytest.raises(fuzz_report.ReportError, match="different cards"):
        fuzz_report.merge([result(1, 10, []), result(2, 5, [], card="another")])


@pytest.mark.slow
def test_shard_keeps_its_intermediate_result(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "FOLDER", tmp_path)
    monkeypatch.setattr(fuzz, "KEPT_EACH_S", 0)
    frames = []

    def so_far(found: fuzz.Result) -> None:
        fuzz.keep(found)
        frames.append(fuzz_report.load(tmp_path / "fuzz-standard-8.json")["frames"])

    done = shard(8, 150, bauds=(115200,), folder=tmp_path, so_far=so_far)
    assert len(frames) > 1 and frames == sorted(frames) and frames[-1] == done.frames


@pytest.mark.slow
def test_shard_stopped_while_shrinking_keeps_the_difference(tmp_path, monkeypatch):
    def stopped(case: dict, fails: Callable[[dict], bool]) -> dict:
        raise KeyboardInterrupt

    monkeypatch.setattr(fuzz, "FOLDER", tmp_path)
    monkeypatch.setattr(fuzz, "shrink", stopped)
    target = named("no-repeat").target()
    with pytest.raises(KeyboardInterrupt):
        shard(1, 1500, bauds=(38400,), target=target, folder=tmp_path, so_far=fuzz.keep)
    (found,) = fuzz_report.load(tmp_path / "fuzz-standard-1.json")["differences"]
    case = json.loads((tmp_path / f"case-standard-{found['case'].replace('/', '-')}.json").read_text())
    assert run(case, target)[0].differences == found["what"]


def test_report_names_an_invalid_result(tmp_path):
    (tmp_path / "1.json").write_text("{}")
    with pytest.raises(fuzz_report.ReportError, match="no result of a fuzz shard"):
        fuzz_report.load(tmp_path / "1.json")
    (tmp_path / "1.json").unlink()
    with pytest.raises(fuzz_report.ReportError, match="make fuzz"):
        fuzz_report.find([str(tmp_path)])


CARDS = {"standard": "one two three", "tiny": "four five three"}
FLIPPED = {"standard": "one two six", "tiny": "four five six"}  # by another judge


def renewed(record: dict, folder: Path) -> dict:
    return fuzz_page.renewed(record, folder, CARDS, FLIPPED)


def keep_frames(folder: Path, seed: int, frames: int, config: str = "standard", **more) -> None:
    found = result(seed, frames, more.get("differences", []), more.get("card", CARDS[config]), config)
    (folder / f"fuzz-{config}-{seed}.json").write_text(json.dumps(found))


def results_of_all_campaigns(folder: Path) -> None:
    """Result files of fuzz, plants, core-flips and flips."""
    keep_frames(folder, 7, 7000)
    keep_frames(folder, 8, 8000)
    keep_frames(folder, 7, 900, "tiny")
    frames = {plant.name: 33 for plant in PLANTS} | {"cut-value": 12345, "wrong-order": None}
    plants = {"seed": 5, "count": 20000, "card": CARDS["standard"], "frames": frames}
    (folder / "plants.json").write_text(json.dumps(plants))
    core = {
        "cards": FLIPPED,
        "flips": 4000,
        "results": {
            "standard": {"05": {"as asked": 990, "altered, bit 10 = 1": 7}},
            "tiny": {"06": {"as asked": 2999, "none": 1, "altered, bit 10 = 0": 3}},
        },
    }
    (folder / "core-flips.json").write_text(json.dumps(core))
    for config, its_card in FLIPPED.items():
        shard = {
            "seed": 9,
            "config": config,
            "card": its_card,
            "baud": 9600,
            "bits": dict.fromkeys(PARTS, 8),
            "flips": 4,
            "cpu_s": 120.0,
        }
        shard |= {"counts": {"card: no effect": 4}, "notable": []}
        (folder / f"flips-{config}-9-9600.json").write_text(json.dumps(shard))


def test_the_page_names_the_firmware_s_sources_if_they_make_its_images(monkeypatch):
    monkeypatch.setattr(
        fuzz_page.fingerprint, "firmware", lambda config: {"standard": "two", "tiny": "five"}[config]
    )
    monkeypatch.setattr(fuzz_page.fingerprint.host, "fingerprint", lambda: "six")
    named = fuzz_page.fingerprint.firmware_sources
    assert named({"standard": "two", "tiny": "five"}) == "firmware sources `six`"
    assert named({"standard": "two", "tiny": "two"}) == "other firmware sources"


def test_page_states_the_results_of_all_campaigns(tmp_path):
    results_of_all_campaigns(tmp_path)
    text = " ".join(fuzz_page.page(renewed({}, tmp_path)).split())
    for said in (
        "The images are of other firmware sources.",
        "20,000 frames each, with judge `three`.",
        "Judge of both campaigns below: `six`.",
        "15,897 frames of both cards judged to their end, each with the judge of its row: no difference, "
        "at most 2.90e-04 of the frames",
        "| standard card `one`, firmware `two` | `three` | 7, 8 | 15,000 | 4 | 0 | 14,998 | 0 | 3.08e-04 |",
        "| tiny card `four`, firmware `five` | `three` | 7 | 900 | 2 | 0 | 899 | 0 | 5.11e-03 |",
        "| legal | 15,000 | 900 |",
        "| cut-value | MAP-7: a value below -32768 is cut, not refused | 12,345 |",
        "| wrong-order | EXC: address before quantity | not found |",
        "`make core-flips`: 4,000 flips",
        "| scenario on the standard card | altered, bit 10 = 1 | altered, bit 10 = 0 | as asked |",
        "10 of them altered a telegram: 7 with bit 10 = 1, 3 with bit 10 = 0.",
        "| 06 | 0 | 3 | 2,999 | 0 | 0 | 0 | 1 |",
        "8 flips of both cards: 0 unrequested or altered telegrams and stuck drivers, at most 4.38e-01",
        "standard card `one`, firmware `two`: 4 flips in 1 shards, 4 at 9600 bit/s 8O1, in 2 minutes",
        "tiny card `four`, firmware `five`: 4 flips",
        "| no effect | 4 |",
        "| first five rows together, at most, at 99 % | 6.84e-01 |",
    ):
        assert said in text
    assert all(f"| {plant.name} | {plant.rules[0]}" in text for plant in PLANTS)
    assert fuzz_page.UNJUDGED in text


def test_page_with_a_difference_does_not_say_that_there_is_none(tmp_path):
    results_of_all_campaigns(tmp_path)
    keep_frames(tmp_path, 22, 30, differences=[{"case": "22/1", "what": ["no reply"]}])
    text = fuzz_page.page(renewed({}, tmp_path))
    assert "its row: differences: 1, at most 4.17e-04 of the frames at 99 %" in text
    assert "no difference" not in text and fuzz_page.UNJUDGED not in text


@pytest.mark.parametrize(
    ("file", "content", "complaint"),
    [
        ("plants.json", None, "run `make fuzz-plants` first"),
        (
            "plants.json",
            {"seed": 1, "count": 2, "card": "one two three", "frames": {}},
            "no result of lenient-t15",
        ),
        ("core-flips.json", {"flips": 2, "cards": {}, "results": {}}, "different cards"),
        ("core-flips.json", {"flips": 2, "cards": {"tiny": "x"}, "results": {}}, "another tiny card, x"),
        ("core-flips.json", {"seed": 1}, "no result of `make core-flips`"),
        ("flips-tiny-9-9600.json", None, "run `make flips CONFIG=tiny` first"),
        ("fuzz-tiny-7.json", None, "run `make fuzz CONFIG=tiny` first"),
    ],
)
def test_page_needs_all_results_of_one_card(tmp_path, file, content, complaint):
    results_of_all_campaigns(tmp_path)
    (tmp_path / file).unlink()
    if content is not None:
        (tmp_path / file).write_text(json.dumps(content))
    with pytest.raises(fuzz_page.PageError, match=complaint):
        fuzz_page.page(renewed({}, tmp_path))


def test_page_keeps_the_results_of_campaigns_that_were_not_run_again(tmp_path):
    results_of_all_campaigns(tmp_path)
    record = renewed({}, tmp_path)
    for path in tmp_path.iterdir():
        path.unlink()
    assert renewed(record, tmp_path) == record


def test_page_adds_new_shards_to_those_of_the_same_card(tmp_path):
    results_of_all_campaigns(tmp_path)
    record = renewed({}, tmp_path)
    assert renewed(record, tmp_path) == record, "no shard counts twice"
    keep_frames(tmp_path, 9, 90_000)
    shard = json.loads((tmp_path / "flips-tiny-9-9600.json").read_text())
    notable = {"what": "wrong reply", "flip": "time_i.count[3]", "why": "reply 11 01 00 00"}
    shard |= {"seed": 10, "baud": 4800, "notable": [notable], "bits": dict.fromkeys(PARTS, 9)}
    (tmp_path / "flips-tiny-10-4800.json").write_text(json.dumps(shard))
    text = fuzz_page.page(renewed(record, tmp_path))
    for said in (
        "| 7, 8, 9 | 105,000 | 6 |",
        "firmware `five`: 8 flips in 2 shards, 4 at 4800 bit/s 8N1, 4 at 9600 bit/s 8O1, in 4 minutes",
        "| no effect | 8 |",
        "| 8 or 9 |",
        "| wrong reply | with a wrong CRC, or cut short | 1 | `time_i.count` 1 |",
    ):
        assert said in text


def test_page_takes_what_a_shard_found_after_an_earlier_page(tmp_path):
    results_of_all_campaigns(tmp_path)
    record = renewed({}, tmp_path)
    keep_frames(tmp_path, 8, 50_000, differences=[{"case": "8/1", "what": ["unrequested"]}])
    path = tmp_path / "flips-standard-9-9600.json"
    notable = {"what": FORBIDDEN[0], "flip": "time_i.count[3]", "why": "telegram"}
    more = {
        "flips": 500,
        "counts": {f"card: {FORBIDDEN[0]}": 1, "card: no effect": 499},
        "notable": [notable],
    }
    path.write_text(json.dumps(json.loads(path.read_text()) | more))
    newer = renewed(record, tmp_path)
    text = fuzz_page.page(newer)
    assert "| 7, 8 | 57,000 |" in text and "differences: 1," in text
    assert "504 flips of both cards: 1 unrequested" in text
    keep_frames(tmp_path, 8, 30)
    assert renewed(newer, tmp_path) == newer, "begun anew, the shard has counted less so far"


def test_page_takes_no_result_of_another_card(tmp_path):
    results_of_all_campaigns(tmp_path)
    record = renewed({}, tmp_path)
    other = {"card": "six two three"}
    for name in ("fuzz-standard-7.json", "plants.json", "flips-standard-9-9600.json"):
        was = (tmp_path / name).read_text()
        (tmp_path / name).write_text(json.dumps(json.loads(was) | other))
        with pytest.raises(fuzz_page.PageError, match="another standard card, six two three"):
            renewed(record, tmp_path)
        (tmp_path / name).write_text(was)


def test_page_begins_anew_with_another_card(tmp_path):
    results_of_all_campaigns(tmp_path)
    record = renewed({}, tmp_path)
    for path in tmp_path.iterdir():
        path.unlink()
    keep_frames(tmp_path, 7, 30, card="six two three")
    newer = fuzz_page.renewed(record, tmp_path, CARDS | {"standard": "six two three"}, FLIPPED)
    assert fuzz_page.total(newer["frames of standard"])["frames"] == 30
    assert newer["frames of tiny"] == record["frames of tiny"]
    with pytest.raises(fuzz_page.PageError, match="different cards"):
        fuzz_page.page(newer)


def test_page_does_not_lose_a_longer_result_of_the_same_card(tmp_path):
    results_of_all_campaigns(tmp_path)
    record = renewed({}, tmp_path)
    for name, what in (("plants.json", {"count": 1}), ("core-flips.json", {"flips": 1})):
        (tmp_path / name).write_text(json.dumps(json.loads((tmp_path / name).read_text()) | what))
    assert renewed(record, tmp_path) == record


def test_record_has_a_line_for_each_shard(tmp_path):
    results_of_all_campaigns(tmp_path)
    record = renewed({}, tmp_path)
    text = fuzz_page.text_of(record)
    assert json.loads(text) == record
    assert sum(line.startswith("  ") for line in text.splitlines()) == 5


@pytest.mark.figures
def test_page_is_made_of_the_record():
    assert fuzz_page.PAGE.read_text() == fuzz_page.page(json.loads(fuzz_page.RECORD.read_text()))


def test_template_has_the_headings_that_other_pages_link_to():
    headings = [
        re.findall(r"^#{1,3} .*", path.read_text(), re.M) for path in (fuzz_page.TEMPLATE, fuzz_page.PAGE)
    ]
    assert headings[0] == headings[1]
