# SPDX-License-Identifier: Apache-2.0
"""Tests of the firmware's tools, with a short run of each: fuzzing, loops, stack, static analysis."""

from __future__ import annotations

import fcntl
import functools
import json
import os
import random
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

from sw.test import analysis as firmware_analysis
from sw.test import coverage as firmware_coverage
from sw.test import fuzz as firmware_fuzz
from sw.test import loops as firmware_loops
from sw.test import mutate as firmware_mutate
from sw.test.host import DIALECTS, ROOT
from sw.tools.stack import deepest, reserved
from tb.model.firmware import build

pytestmark = pytest.mark.nightly("firmware")

FUZZERS = [(dialect, target) for dialect in DIALECTS for target in firmware_fuzz.TARGETS]
RUNS = {"translate": 60_000, "gateway": 8_000}


@functools.cache
def fuzzers() -> Path:
    """The fuzzers of the current sources. A lock lets one test process build at a time."""
    folder = ROOT / "build/fuzz-firmware"
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = firmware_fuzz.build(folder)
    assert done.returncode == 0, done.stderr
    return folder


# ---------------------------------------------------------------- fuzzing


@pytest.mark.rule("SAFE-1", "SAFE-3", "SAFE-4", "FRAME-6", "FRAME-7", "MAP-9", "FC-5", "FC-9")
@pytest.mark.parametrize(("dialect", "target"), FUZZERS)
def test_no_input_breaks_the_firmware(dialect: str, target: str, tmp_path: Path):
    """sw/test/fuzz_*.c lists the checks."""
    seed = int(os.environ.get("COCOTB_RANDOM_SEED") or random.randrange(1, 1 << 31))
    print(f"repeat with COCOTB_RANDOM_SEED={seed}")
    result = firmware_fuzz.fuzz(fuzzers(), dialect, target, RUNS[target], seed, work=tmp_path)
    assert not result.finding, f"{result.says}; input: {result.finding}"
    assert result.runs >= RUNS[target]


BUGS = {
    "bit 10 in a telegram that is about a parameter": (
        "telegram.c",
        "    return end(txn, to, 0, 0);",
        "    return end(txn, to, 0x0400, 0);",
        "translate",
    ),
    "a run of coils that ends one too far": (
        "coils.c",
        "quantity <= CONTROL_COILS ||",
        "quantity <= 33 ||",
        "translate",
    ),
    "a text longer than the reply": ("registers.c", "LIMIT_TEXT = 10", "LIMIT_TEXT = 11", "translate"),
    "a byte beyond the drive's frame": ("translate.c", "at < 24 ?", "at < 48 ?", "translate"),
    "settings that change without a commit": (
        "gateway.c",
        "state_of(request) == GUARD_KEY && g->committed_ticket != g->ticket)\n        commit(g, again);",
        "state_of(request) != 0u && g->committed_ticket != g->ticket)\n        commit(g, GUARD_KEY);",
        "gateway",
    ),
    "a held telegram that is not taken back": (
        "gateway.c",
        "timed_out(g) || (is_replaced(g) && g->now - g->wait_start > PAUSE)",
        "is_replaced(g) && timed_out(g) && g->now == 0",
        "gateway",
    ),
    "a licence that outlives its exchange": (
        "gateway.c",
        "        mailbox_put(&mailbox_frame(TELEGRAM_FRAME)[i].byte, ADR_OF_NO_DRIVE + STEP * i);",
        "        continue;",
        "gateway",
    ),
    "a BCC that is not the telegram's": ("telegram.c", "bcc ^= *from;", "bcc |= *from;", "translate"),
    "a request built on a flipped bit": (
        "translate.c",
        "    return sum == 0;",
        "    return sum == 0 || true;",
        "translate",
    ),
    "a reply to an older request": (
        "gateway.c",
        "    if (txn != g->newest)\n        return;\n",
        "",
        "gateway",
    ),
}


@pytest.mark.parametrize("bug", BUGS)
def test_the_fuzzers_find_a_planted_bug(bug: str, tmp_path: Path):
    file, right, wrong, target = BUGS[bug]
    shutil.copytree(ROOT / "sw", tmp_path / "sw")
    path = tmp_path / "sw/src" / file
    assert path.read_text().count(right) == 1
    path.write_text(path.read_text().replace(right, wrong))
    done = firmware_fuzz.build(tmp_path, f"FUZZ_TREE={tmp_path}", fuzzers=[("card", target)])
    assert done.returncode == 0, done.stderr
    result = firmware_fuzz.fuzz(tmp_path, "card", target, 10 * RUNS[target], 1)
    print(f"{bug}: {result.says} after {result.runs} runs")
    assert result.finding


DECODE = "    outcome = decode(t, txn, pdu, pdu_length);\n"


@pytest.mark.parametrize("made", [False, True])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_only_the_kind_of_a_telegram_that_was_made_is_read(dialect: str, made: bool, tmp_path: Path):
    """The contract of translate_request() rests on this: a wrong kind changes nothing without a telegram."""
    shutil.copytree(ROOT / "sw", tmp_path / "sw")
    path = tmp_path / "sw/src/translate.c"
    text = path.read_text()
    assert text.count(DECODE) == 1
    after = f"    if (outcome {'==' if made else '!='} OUTCOME_EXCHANGE)\n        txn->expects = 0xAA;\n"
    path.write_text(text.replace(DECODE, f"    txn->expects = 0x55;\n{DECODE}{after}"))
    done = firmware_fuzz.build(tmp_path, f"FUZZ_TREE={tmp_path}", fuzzers=[(dialect, "gateway")])
    assert done.returncode == 0, done.stderr
    result = firmware_fuzz.fuzz(tmp_path, dialect, "gateway", RUNS["gateway"], 1)
    assert bool(result.finding) == made, f"{result.says}; input: {result.finding}"
    assert made or result.runs >= RUNS["gateway"]


def test_the_block_of_the_fuzzers_has_a_bound_beside_its_zero():
    assert firmware_fuzz.summary(1000, 0)[0] == "1000 runs, 0 findings"
    assert "at most 4.60e-03 of all would find something, at 99 %." in firmware_fuzz.summary(1000, 0)[1]


@pytest.mark.parametrize("target", firmware_fuzz.TARGETS)
def test_the_corpus_is_small(target: str):
    inputs = list((firmware_fuzz.CORPUS / target).iterdir())
    assert 10 < len(inputs) < 100
    assert sum(path.stat().st_size for path in inputs) < 50_000


# ---------------------------------------------------------------- loops and stack


def test_every_loop_has_its_bound_and_every_bound_its_loop():
    assert firmware_loops.differences() == []


def test_a_loop_without_a_bound_is_reported(tmp_path: Path):
    shutil.copytree(ROOT / "sw/src", tmp_path / "sw/src")
    path = tmp_path / "sw/src/leds.c"
    path.write_text(
        path.read_text().replace(
            "if (++step == STEPS)", "while (now--)\n            step++;\n        if (++step == STEPS)"
        )
    )
    assert firmware_loops.differences(tmp_path) == ["leds.c: leds_show: no bound for `while (now--)`"]


@pytest.mark.rule("SAFE-3")
def test_the_corpus_drives_every_loop_as_far_as_its_bound_and_no_further():
    seen = firmware_fuzz.loops_seen(fuzzers())
    for where, (rounds, most) in seen.items():
        print(f"{rounds:6} of {most:<6} {where}")
    # main.c is no part of a fuzzer.
    assert [where for where, (rounds, most) in seen.items() if rounds != most and "main.c" not in where] == []


@pytest.mark.rule("PERF-4")
def test_the_deepest_stack_of_every_image_fits_the_reserved_memory():
    make = ["make", "-s", "-f", "sw/firmware.mk", f"FIRMWARE_PYTHON={sys.executable}", "firmware-images"]
    done = subprocess.run(make, cwd=ROOT, check=True, capture_output=True, text=True)
    images = done.stdout.split()
    assert len(images) > len(DIALECTS)
    for image in images:
        size, path = deepest(build(image.replace(".hex", ".elf")))
        print(f"{image}: {size} bytes: {' > '.join(path)}")
        assert 0 < size <= reserved(), image


# ---------------------------------------------------------------- coverage


@pytest.fixture
def coverage(monkeypatch, written):
    """`make coverage-firmware` with so many branches taken of ten."""
    monkeypatch.setattr(firmware_coverage, "measure", lambda: None)

    def main(file: str, taken: int, *options: str) -> int:
        def counted(folder, uncalled):
            numbers = {"coils.c": (10, 10), "leds.c": (10, 10)} | {file: (taken, 10)}
            return numbers, dict.fromkeys(numbers, (5, 5)), {file: [7] if taken < 10 else []}

        monkeypatch.setattr(firmware_coverage, "counted", counted)
        return firmware_coverage.main(list(options))

    return main


def test_a_branch_of_the_core_that_no_test_takes_fails(coverage, capsys):
    assert coverage("coils.c", 9) == 1
    assert "hole  all: coils.c: line 7" in capsys.readouterr().out


def test_a_good_run_writes_its_table(coverage, written):
    assert coverage("leds.c", 10, "--check") == 0
    assert not (written / "firmware-branches.md").exists()
    assert coverage("leds.c", 10, "--write") == 0
    assert (written / "firmware-branches.md").read_text().count("10 of 10") == 2 * (len(DIALECTS) + 1)


# ---------------------------------------------------------------- static analysis

MISTAKES = {
    "gcc_analyzer": "int *p = 0; return *p;",
    "cppcheck": "int a[2] = {1, 2}; return a[2];",
    "clang_tidy": "int a = 1; if (a = 2) return 3; return a;",
}


@pytest.mark.parametrize("analyser", MISTAKES)
def test_a_planted_mistake_is_reported(analyser: str, tmp_path: Path):
    shutil.copytree(ROOT / "sw", tmp_path / "sw", ignore=shutil.ignore_patterns("src", "test"))
    (tmp_path / "sw/src").mkdir()
    code = f"int planted(void);\nint planted(void)\n{{\n    {MISTAKES[analyser]}\n}}\n"
    (tmp_path / "sw/src/planted.c").write_text(code)
    assert any("planted.c:4" in line for line in getattr(firmware_analysis, analyser)(tmp_path))


# ---------------------------------------------------------------- mutation


def test_every_file_of_the_core_has_enough_mutants():
    mutants = firmware_mutate.all_mutants()
    for name in firmware_mutate.FILES:
        assert sum(mutant.file == name for mutant in mutants) >= firmware_mutate.LEAST_PER_FILE


@pytest.mark.nightly
def test_a_changed_header_is_compiled_into_every_source_that_includes_it(tmp_path):
    """diagnostics.c alone reads the code for an invalid request."""
    mutants = firmware_mutate.all_mutants()
    mutant = next(each for each in mutants if (each.file, each.change) == ("dialect.h", "1 -> 2"))
    builds = firmware_mutate.MutantBuild(tmp_path)
    builds.change(mutant)
    assert "sw/src/diagnostics.c" in builds.touched()
    assert not builds.same_code(), mutant


@pytest.mark.parametrize(("fate", "code"), [("test some", 0), (firmware_mutate.SAME, 0), ("survives", 1)])
def test_a_mutant_that_is_neither_caught_nor_proved_the_same_fails(
    fate: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    one_with(fate, tmp_path, monkeypatch)
    assert firmware_mutate.report(60, write=False) == code
    says = capsys.readouterr().out
    assert ("survives: " in says) == bool(code)
    assert f"{int(fate == firmware_mutate.SAME)} {firmware_mutate.SAME}, 0 do not compile\n" in says


def one_with(fate: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> firmware_mutate.Mutant:
    """Results in `folder`: the first mutant has this fate, the rest is caught."""
    mutants = firmware_mutate.chosen_mutants(60)
    rows = [asdict(mutant) | {"fate": "test some"} for mutant in mutants]
    rows[0]["fate"] = fate
    (folder / "shard-1-of-1.json").write_text(json.dumps({"seconds": 1, "mutants": rows}))
    monkeypatch.setattr(firmware_mutate, "FOLDER", folder)
    return mutants[0]


@pytest.mark.parametrize(("fate", "code"), [("test added", 0), ("survives", 1)])
def test_survivors_are_tried_again_alone(
    fate: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    survivor = one_with("survives", tmp_path, monkeypatch)

    def evaluated(mutants: list[firmware_mutate.Mutant], *_: object) -> list[dict]:
        assert mutants == [survivor]
        return [asdict(survivor) | {"fate": fate}]

    monkeypatch.setattr(firmware_mutate, "proved_of", lambda mutants: [])
    monkeypatch.setattr(firmware_mutate, "evaluated", evaluated)
    monkeypatch.setattr("sys.argv", ["mutate", "--survivors"])
    assert firmware_mutate.main() == code
    assert ("survives: " in capsys.readouterr().out) == bool(code)
