# SPDX-License-Identifier: Apache-2.0
"""Flips of the core: they are all of a scenario, and a planted flaw is found."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from campaigns.flips import core
from campaigns.flips.core import (
    AGAIN,
    ALTERED,
    AS_ASKED,
    NOBODY,
    NONE,
    OF_PC,
    OF_REGISTER,
    OF_STORE,
    OF_WORD,
    REFUSED,
    SCENARIOS,
    CoreError,
    Flips,
    Run,
)
from rtl.sources import ROOT, configurations
from tb.lib.nightly import first

H = bytes.fromhex
BY_NAME = {each.name: each for each in SCENARIOS}
COMMAND, PARAMETER = H("81 047C 1999"), H("81 20CD 0000 00001234 0000 0000")
NEXT, OTHER_NEXT = H("81 0C7C 1999"), H("81 0C7D 2211")
IMAGES = tuple(configurations())
KINDS = {"register": OF_REGISTER, "program counter": OF_PC, "instruction": OF_WORD}
every = pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda each: each.name)


def content_of(image: str) -> bytes:
    return core.image_of(image).read_bytes()


def flips_of(image: str, scenario: core.Scenario, kinds: int = core.ALL) -> Flips:
    return core.every_flip(scenario, content_of(image), core.memory_of(image), kinds)


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize(
    ("image", "name"),
    [
        ("tiny", "05, coil 11, revoked"),
        ("tiny", "01, coils 1-32"),
        *(
            pytest.param(image, each.name, marks=pytest.mark.nightly)
            for image in IMAGES
            for each in SCENARIOS
        ),
    ],
)
def test_few_flips_alter_a_telegram(image: str, name: str):
    """`make core-flips` has the number of each scenario."""
    flips = flips_of(image, BY_NAME[name])
    assert core.altered(flips.results) <= core.MOST * flips.results.total(), flips.found
    assert flips.results.total() > 50 * flips.instructions
    assert flips.results[AS_ASKED] > flips.results.total() / 6 and flips.results[NONE] > 0, flips.results


# ---------------------------------------------------------------- the flips


@pytest.mark.nightly
def test_flips_are_of_each_bit():
    """Eleven bits of the program counter and 32 of the instruction; seven of a store's registers."""
    scenario = BY_NAME["no request"]
    by_kind = {name: flips_of("standard", scenario, kinds) for name, kinds in KINDS.items()}
    assert by_kind["program counter"].results.total() == 11 * by_kind["program counter"].instructions
    assert by_kind["instruction"].results.total() == 32 * by_kind["instruction"].instructions
    together = sum((flips.results for flips in by_kind.values()), Counter())
    assert flips_of("standard", scenario).results == together
    stores = flips_of("standard", scenario, OF_STORE).results.total()
    assert stores % 7 == 0 and 0 < stores < 2 * 7 * by_kind["register"].instructions


def test_a_scenario_that_is_not_served_is_an_error():
    with pytest.raises(CoreError, match="no request: not served without a flip"):
        core.every_flip(BY_NAME["no request"], bytes(1000))


def test_more_steps_than_the_machine_has_are_an_error():
    with pytest.raises(CoreError, match="more results or steps"):
        core._play([(core.ROUND,)] * 129)


# ---------------------------------------------------------------- planted flaws

# File, what it says, what it is to say, scenario, kind of the flips that find it.
PLANTED = {
    "a commit without the key": (
        "gateway.c",
        "g->newest->check + state_of(request));",
        "g->newest->check + GUARD_KEY + (request & 0u));",
        "0F, coils 1-32, revoked",
        "program counter",
    ),
    "a guard word that is not kept": (
        "gateway.c",
        "g->newest->check + state_of(request));",
        "g->translator.next.word[GUARD] + state_of(request));",
        "01, coils 1-32",
        "program counter",
    ),
    "passes that are not compared": (
        "gateway.c",
        "difference ^= guard_of(&g->translator, g->newest);",
        "difference = guard_of(&g->translator, g->newest) & 0u;",
        "0F, coils 1-32",
        "register",
    ),
    "a telegram's place that is not filled": (
        "gateway.c",
        "ADR_OF_NO_DRIVE + STEP * i);",
        "ADR_OF_NO_DRIVE * (i == 0));",
        "06, a parameter",
        "instruction",
    ),
}


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize("flaw", first(list(PLANTED), 2))
def test_a_planted_flaw_is_found(flaw: str, tmp_path: Path):
    file, right, wrong, name, kind = PLANTED[flaw]
    for folder in ("sw", "regs/generated"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    shutil.copy(ROOT / "configs.toml", tmp_path)
    (tmp_path / "constraints").mkdir()
    shutil.copy(ROOT / "constraints/boards.toml", tmp_path / "constraints")
    path = tmp_path / "sw/src" / file
    assert path.read_text().count(right) == 1
    path.write_text(path.read_text().replace(right, wrong))
    subprocess.run(
        ["make", "-s", "-f", "sw/firmware.mk", f"FIRMWARE_PYTHON={sys.executable}", "build/firmware.bin"],
        cwd=tmp_path,
        check=True,
    )
    image = (tmp_path / "build/firmware.bin").read_bytes()
    assert image != content_of("standard")
    flips = core.every_flip(BY_NAME[name], image, kinds=KINDS[kind])
    without = core.every_flip(BY_NAME[name], content_of("standard"), kinds=KINDS[kind])
    assert core.altered(flips.results) > core.altered(without.results) and flips.found, flips.results
    print(f"{flaw}: {flips.found[0]}")


# ---------------------------------------------------------------- verdicts


@every
def test_each_scenario_is_served_without_a_flip(scenario: core.Scenario):
    """Its telegram, if not revoked or local, and those of the next requests; without it these alone."""
    core.load(content_of("standard"), core.MEMORY)
    sound, lost = core.play(scenario), core.play(scenario, lost=True)
    own = not scenario.revoked and not scenario.local
    assert len(sound.sent) == 3 + own and len(lost.sent) == 3 and not sound.how
    assert core.verdict(sound, sound, lost) == AS_ASKED
    assert core.verdict(lost, sound, lost) == (NONE if own else AS_ASKED)


@pytest.mark.parametrize(
    ("sent", "how", "result"),
    [
        ([COMMAND, NEXT], "", AS_ASKED),
        ([NEXT], "", NONE),
        ([OTHER_NEXT], "", NONE),  # as if the request had not come
        ([], NONE, NONE),
        ([COMMAND], NONE, AS_ASKED),
        ([], REFUSED, REFUSED),
        ([COMMAND, COMMAND, NEXT], "", AGAIN),
        ([PARAMETER, COMMAND, NEXT], "", AGAIN),  # the telegram before the request
        ([COMMAND, H("81 0C7C 1998")], "", ALTERED[0]),  # the control image that it left
        ([COMMAND, OTHER_NEXT], "", ALTERED[0]),  # its telegram left, but not its settings
        ([NEXT, COMMAND], "", ALTERED[0]),
        ([H("81 007C 1999"), NEXT], "", ALTERED[1]),
        ([H("81 007C 1999")], REFUSED, ALTERED[1]),
        ([H("80 047C 1999"), NEXT], "", ALTERED[0]),
        ([H("00 047C 1999"), NEXT], "", NOBODY),
    ],
)
def test_verdicts(sent, how, result):
    sound, lost = Run([PARAMETER], [COMMAND, NEXT]), Run([PARAMETER], [OTHER_NEXT])
    assert core.verdict(Run([PARAMETER], sent, how), sound, lost) == result


# ---------------------------------------------------------------- the command


def test_an_altered_telegram_makes_the_command_fail(monkeypatch, capsys):
    """One scenario, no result file."""
    found = Flips(1, Counter({ALTERED[1]: 1, AS_ASKED: 2}), ["05, coil 11: the flip"])
    monkeypatch.setattr(core, "every_flip", lambda *given: found)
    monkeypatch.setattr(core, "FILE", core.FOLDER / "none.json")
    monkeypatch.setattr(sys, "argv", ["core-flips", "--only", "05, coil 11"])
    assert core.main() == 1
    said = capsys.readouterr().out.splitlines()
    for config in IMAGES:
        at = next(i for i, line in enumerate(said) if line.startswith(f"{config}: 05, coil 11: 3 flips"))
        assert said[at + 1] == "05, coil 11: the flip"
    assert "      2  altered, bit 10 = 0" in said
    assert not core.FILE.exists()


def test_results_of_all_scenarios_are_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(core.every_flip, "__defaults__", (core.MEMORY, core.ALL, 300))
    monkeypatch.setattr(core, "FILE", tmp_path / "fuzz/core-flips.json")
    monkeypatch.setattr(sys, "argv", ["core-flips"])
    assert core.main() in (0, 1)  # of so few flips one is above the bound
    kept = json.loads(core.FILE.read_text())
    assert kept.keys() == core.KEYS and list(kept["results"]) == list(kept["cards"]) == list(IMAGES)
    assert all(list(rows) == list(BY_NAME) for rows in kept["results"].values())
    found = [row for rows in kept["results"].values() for row in rows.values()]
    assert sum(sum(row.values()) for row in found) == kept["flips"] > 1000


def test_an_image_that_is_not_there_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["core-flips", "--image", "build/none.bin"])
    assert core.main() == 2
    assert capsys.readouterr().err == "core-flips: no image build/none.bin\n"
