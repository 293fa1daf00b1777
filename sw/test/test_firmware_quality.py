# SPDX-License-Identifier: Apache-2.0
"""Tests of the firmware's tools, with a short run of each: fuzzing, loops, stack, static analysis."""

from __future__ import annotations

import fcntl
import functools
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sw.test import analysis as firmware_analysis
from sw.test import fuzz as firmware_fuzz
from sw.test import mutate as firmware_mutate
from sw.test.host import DIALECTS, ROOT
from sw.tools.stack import deepest, reserved
from tb.lib.planted import Bug, bugs
from tb.model.firmware import build

pytestmark = pytest.mark.nightly("firmware")

RUNS = 12_000  # of one dialect


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


@pytest.mark.rule("SAFE-1", "SAFE-3", "SAFE-8", "FRAME-6", "FRAME-7", "MAP-9", "FC-5", "FC-9")
@pytest.mark.parametrize("dialect", DIALECTS)
def test_no_input_breaks_the_firmware(dialect: str, tmp_path: Path):
    """sw/test/fuzz_gateway.c lists the checks."""
    seed = int(os.environ.get("COCOTB_RANDOM_SEED") or random.randrange(1, 1 << 31))
    print(f"repeat with COCOTB_RANDOM_SEED={seed}")
    result = firmware_fuzz.fuzz(fuzzers(), dialect, RUNS, seed, work=tmp_path)
    assert not result.finding, f"{result.says}; input: {result.finding}"
    assert result.runs >= RUNS


@pytest.mark.parametrize("bug", bugs("libfuzzer"), ids=lambda bug: bug.name)
def test_the_fuzzer_finds_a_planted_bug(bug: Bug, tmp_path: Path):
    shutil.copytree(ROOT / "sw", tmp_path / "sw")
    (tmp_path / bug.file).write_text(bug.planted())
    done = firmware_fuzz.build(tmp_path, f"FUZZ_TREE={tmp_path}", dialects=["card"])
    assert done.returncode == 0, done.stderr
    result = firmware_fuzz.fuzz(tmp_path, "card", 10 * RUNS, 1)
    print(f"{bug.name}: {result.says} after {result.runs} runs")
    assert result.finding


def test_a_loop_without_a_bound_is_reported(tmp_path: Path):
    shutil.copytree(ROOT / "sw/src", tmp_path / "sw/src")
    assert firmware_analysis.unbounded(tmp_path) == []
    path = tmp_path / "sw/src/leds.c"
    loop = "while (now--)\n            step++;\n        if (++step == STEPS)"
    path.write_text(path.read_text().replace("if (++step == STEPS)", loop))
    (said,) = firmware_analysis.unbounded(tmp_path)
    assert said.startswith("sw/src/leds.c:") and said.endswith(": no bound for `while (now--)`")


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


def test_an_excuse_ends_with_a_change_of_its_function(tmp_path, monkeypatch):
    """Another function of the file may change."""
    assert firmware_mutate.outdated() == []
    shutil.copytree(ROOT / "sw/src", tmp_path / "sw/src")
    monkeypatch.setattr(firmware_mutate, "ROOT", tmp_path)
    path = tmp_path / "sw/src/exchange.c"
    text = path.read_text()
    path.write_text(text.replace("orders_repeat(g);", "(orders_repeat)(g);"))
    assert firmware_mutate.outdated() == []
    path.write_text(text.replace("translate_drive_again(g->", "(translate_drive_again)(g->"))
    (said,) = firmware_mutate.outdated()
    assert said.startswith("survivors.toml: exchange.c: `TRAITS.text_by_size && ")
