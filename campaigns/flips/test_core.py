# SPDX-License-Identifier: Apache-2.0
"""Flips of the core's registers: the flips are all of a scenario, the judge sees what SAFE-4 forbids."""

from __future__ import annotations

import json
import sys

import pytest

from campaigns.flips import core
from campaigns.flips.core import AGAIN, ALTERED, AS_ASKED, NOBODY, NONE, REFUSED, SCENARIOS, CoreError, Run
from regs.generated.mailbox import AREAS
from rtl.sources import configurations
from tb.model.firmware import frame_memory
from tb.model.rv32i import Machine

H = bytes.fromhex
BY_NAME = {each.name: each for each in SCENARIOS}
COMMAND, PARAMETER = H("81 047C 1999"), H("81 20CD 0000 00001234 0000 0000")
NEXT, OTHER_NEXT = H("81 0C7C 1999"), H("81 0C7D 2211")


IMAGES = {config: core.image_of(config).read_bytes() for config in configurations()}


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize(
    ("image", "name", "part"),
    [
        ("standard", "0F, coils 1-32", 61),
        ("tiny", "06, a parameter, drive busy", 97),
        ("tiny", "05, coil 11, revoked", 97),
        *(
            pytest.param(image, each.name, 11, marks=pytest.mark.slow)
            for image in IMAGES
            for each in SCENARIOS
        ),
    ],
)
def test_no_flip_of_a_register_alters_a_telegram(image: str, name: str, part: int):
    """Before one instruction of `part`; `make core-flips` has them all."""
    flips = core.every_flip(BY_NAME[name], IMAGES[image], part)
    assert not flips.found, flips.found
    assert flips.results.total() >= 32 * (flips.instructions // part) // 2
    assert flips.results[AS_ASKED] > flips.results.total() / 6 and flips.results[NONE] > 0, flips.results


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize(("image", "name"), [("standard", "05, coil 11"), ("tiny", "06, a parameter")])
def test_no_store_at_another_place_alters_a_telegram(image: str, name: str):
    """Such as a BCC, a length or a check word beside its place, or a pointer to another transaction."""
    flips = core.every_flip(BY_NAME[name], IMAGES[image], stores=True)
    assert not flips.found, flips.found
    assert flips.results.total() > 1000


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda each: each.name)
def test_each_scenario_is_served_without_a_flip(scenario):
    """Its telegram, if not revoked, and that of the next request; without it the next request's alone."""
    sound, lost = core.play(scenario), core.play(scenario, lost=True)
    assert len(sound.sent) == 2 - scenario.revoked and len(lost.sent) == 1 and not sound.how
    assert core.verdict(sound, sound, lost) == AS_ASKED
    assert core.verdict(lost, sound, lost) == (AS_ASKED if scenario.revoked else NONE)


def changed_in_memory(offset: int, mask: int):
    """Inverts bits of a telegram that waits in the frame memory, BCC included: what no flip may lead to."""
    place = AREAS["TELEGRAM_FRAME"]
    done = []

    def change(machine: Machine) -> None:
        memory = frame_memory()
        if not done and memory[place.at(0)] == COMMAND[0] and memory[place.at(4)] == COMMAND[4]:
            for at in (offset, len(COMMAND)):
                memory[place.at(at)] ^= mask
            done.append(True)

    return change


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize(
    ("offset", "mask", "result"), [(3, 1, ALTERED[0]), (1, 4, ALTERED[1]), (0, 2, NOBODY)]
)
def test_a_changed_telegram_is_altered(offset, mask, result):
    scenario = BY_NAME["0F, coils 1-32"]
    sound, lost = core.play(scenario), core.play(scenario, lost=True)
    run = core.play(scenario, before_each=changed_in_memory(offset, mask))
    assert core.verdict(run, sound, lost) == result, run


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
        ([H("81 007C 1999"), NEXT], "", ALTERED[1]),
        ([H("81 007C 1999")], REFUSED, ALTERED[1]),
        ([H("80 047C 1999"), NEXT], "", ALTERED[0]),
        ([H("00 047C 1999"), NEXT], "", NOBODY),
    ],
)
def test_verdicts(sent, how, result):
    sound, lost = Run([PARAMETER], [COMMAND, NEXT]), Run([PARAMETER], [OTHER_NEXT])
    assert core.verdict(Run([PARAMETER], sent, how), sound, lost) == result


@pytest.mark.parametrize(
    ("word", "registers"),
    [
        (0x00F58223, {11, 15}),  # sb a5,4(a1)
        (0xFFC72783, {14}),  # lw a5,-4(a4)
        (0x00D787B3, {15, 13}),  # add a5,a5,a3
        (0xFEC766E3, {14, 12}),  # bltu a4,a2
        (0x00300513, set()),  # li a0,3
        (0x00008067, {1}),  # ret
        (0xF29FF06F, set()),  # j
        (0x123452B7, set()),  # lui
    ],
)
def test_registers_that_an_instruction_reads(word, registers):
    assert core.registers_read(word) == registers


def test_a_child_that_fails_is_an_error(monkeypatch):
    def fail(*runs):
        raise KeyError("x")

    monkeypatch.setattr(core, "verdict", fail)
    with pytest.raises(CoreError, match=r"instruction 300 at 0x\w+ x\d+ bit 0: KeyError"):
        core.every_flip(BY_NAME["05, coil 11"], part=300)


def test_an_altered_telegram_makes_the_command_fail(monkeypatch, capsys):
    """Each flip reports an altered telegram; one scenario, one instruction of 300, no result file."""
    end = core.EveryFlip.end
    monkeypatch.setattr(core.EveryFlip, "end", lambda self, result, sent=(): end(self, ALTERED[1], sent))
    monkeypatch.setattr(core.every_flip, "__defaults__", (None, 300, False))
    monkeypatch.setattr(core, "FILE", core.FOLDER / "none.json")
    monkeypatch.setattr(sys, "argv", ["core-flips", "--only", "05, coil 11"])
    assert core.main() == 1
    said = capsys.readouterr().out.splitlines()
    for config in IMAGES:
        at = next(i for i, line in enumerate(said) if line.startswith(f"{config}: 05, coil 11: "))
        assert said[at + 1].startswith("05, coil 11: instruction ")
    assert not core.FILE.exists()


def test_results_of_all_scenarios_are_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(core.every_flip, "__defaults__", (None, 300, False))
    monkeypatch.setattr(core, "FILE", tmp_path / "fuzz/core-flips.json")
    monkeypatch.setattr(sys, "argv", ["core-flips"])
    assert core.main() == 0
    kept = json.loads(core.FILE.read_text())
    assert kept.keys() == core.KEYS and list(kept["results"]) == list(kept["cards"]) == list(IMAGES)
    assert all(list(rows) == list(BY_NAME) for rows in kept["results"].values())
    found = [row for rows in kept["results"].values() for row in rows.values()]
    assert sum(sum(row.values()) for row in found) == kept["flips"] > 1000


def test_an_image_that_is_not_there_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["core-flips", "--image", "build/none.bin"])
    assert core.main() == 2
    assert capsys.readouterr().err == "core-flips: no image build/none.bin\n"
