# SPDX-License-Identifier: Apache-2.0
"""The proof of one flipped bit sees a flip that does harm, and none where there is none."""

from __future__ import annotations

import os

import pytest

from formal import flips
from formal import prove as formal

pytestmark = pytest.mark.nightly
ABOUT = {"task": "prove", "promises": ["a_licence", "a_command"], "clocks": 3}
GUARDED = ["licences_i.image_i.held_i.half", "licences_i.one_i.opposite_i.half"]


@pytest.fixture(scope="module", autouse=True)
def own_folders():
    """Folders of this process: pytest runs tests in parallel."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flips, "WORK", flips.WORK / f"test-{os.getpid()}")
        patch.setattr(formal, "WORK", flips.WORK)
        yield


@pytest.fixture(scope="module")
def gate() -> dict:
    return flips.netlist("commit_gate", "prove")


def bit(gate: dict, name: str) -> flips.Bit:
    (found,) = [one for one in flips.bits(gate, "commit_gate") if one.name == name]
    return found


def test_only_the_gate_s_own_registers_flip(gate):
    names = {one.name for one in flips.bits(gate, "commit_gate")}
    assert {
        "request_i.state[2]",
        "telegram_i.licence_i.held_i.half",
        "licences_i.all_i.opposite_i.half",
    } <= names
    assert {"request_i.ticket[0]", "request_i.ticket[3]"} <= names
    assert not any(name.startswith("g_") and "." not in name for name in names)


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize(
    ("names", "broken"),
    [
        ((), ""),
        (GUARDED, ""),
        (["licences_i.kind[0]"], "a_command"),
        ([*GUARDED, "licences_i.kind[0]"], "a_command"),
    ],
)
def test_a_guarded_bit_may_flip_and_a_lone_one_may_not(gate, names, broken):
    found = flips.check(gate, "commit_gate", ABOUT, [bit(gate, name) for name in names])
    assert found == broken


def test_a_promise_that_never_held_is_an_error(gate, monkeypatch):
    """`a_stays`, turned round, has no run at all: nothing would be proved."""
    entry = gate["modules"]["commit_gate"]["cells"]
    impossible = {"A": ["0"], "EN": ["1"]}
    monkeypatch.setitem(entry["a_stays"], "connections", impossible)
    with pytest.raises(flips.FlipError, match="0_bits: "):
        flips.check(gate, "commit_gate", ABOUT)


def test_a_register_without_a_path_to_the_promise_is_not_proved(gate):
    """The gate's `stop` ends in the telegram's bits, which a_licence leaves open."""
    leading = flips.leading_to(gate, "commit_gate", ["a_licence", "a_command"])
    apart = {one.name for one in flips.bits(gate, "commit_gate") if (one.cell, one.at) not in leading}
    assert apart == {"telegram_i.stop", "telegram_i.is_stop", "request_i.ticket_is_odd"}


def test_the_state_before_a_flip_is_as_deep_as_each_proof():
    for module, about in flips.known().items():
        assert formal.known()[module][about["task"]]["depth"] <= flips.GOOD_CLOCKS, module
