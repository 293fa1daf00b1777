# SPDX-License-Identifier: Apache-2.0
"""The proof of one flipped bit sees a flip that does harm, and none where there is none."""

from __future__ import annotations

import dataclasses
import os

import pytest

from formal import flips
from formal import prove as formal
from rtl.sources import ROOT

ABOUT = {"task": "prove", "promises": ["a_licence", "a_command"], "clocks": 3}


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
    assert {"request_i.ticket[0]", "request_i.ticket[3]"} <= names and len(names) == 31
    assert not any(name.startswith("g_") and "." not in name for name in names)


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize(
    ("name", "broken"),
    [(None, ""), ("licences_i.image_i.held_i.half", ""), ("licences_i.kind[0]", "a_command")],
)
def test_a_guarded_bit_may_flip_and_a_lone_one_may_not(gate, name, broken):
    found = flips.check(gate, "commit_gate", ABOUT, name and bit(gate, name))
    assert found == broken


def test_a_promise_that_never_held_is_an_error(gate, monkeypatch):
    """`a_stays`, turned round, has no run at all: nothing would be proved."""
    entry = gate["modules"]["commit_gate"]["cells"]
    impossible = {"A": ["0"], "EN": ["1"]}
    monkeypatch.setitem(entry["a_stays"], "connections", impossible)
    with pytest.raises(flips.FlipError, match="no flip: "):
        flips.check(gate, "commit_gate", ABOUT, None)


def test_what_never_happens_is_an_error(monkeypatch, capsys):
    """A promise about something that the solver cannot reach in its clocks would hold for any flip."""
    about = flips.known() | {"fc_tx": ABOUT | {"promises": ["a_control"], "happens": ["c_never"]}}
    monkeypatch.setattr(flips, "known", lambda: about)
    monkeypatch.setattr(flips, "netlist", lambda *_: {})
    monkeypatch.setattr(flips, "check", lambda *_: "")
    with pytest.raises(flips.FlipError, match="fc_tx: c_never never happens"):
        flips.prove("fc_tx", 1)


def test_a_register_without_a_path_to_the_promise_is_not_proved(gate):
    """The gate's `stop`, and `free` before it, end in the telegram's bits, which a_licence leaves open."""
    leading = flips.leading_to(gate, "commit_gate", ["a_licence", "a_command"])
    apart = {one.name for one in flips.bits(gate, "commit_gate") if (one.cell, one.at) not in leading}
    free = {"licences_i.free_i.held_i.half", "licences_i.free_i.opposite_i.half"}
    assert apart == {"telegram_i.stop", "request_i.ticket_is_odd"} | free


def test_a_promise_that_no_flip_breaks_is_an_error(monkeypatch, capsys):
    """It may say nothing: a_stop, if no flip of the sender breaks it."""
    monkeypatch.setattr(flips, "netlist", lambda *_: {})
    monkeypatch.setattr(flips, "bits", lambda *_: [flips.Bit("state[0]", "cell", 0)])
    monkeypatch.setattr(flips, "leading_to", lambda *_: {("cell", 0)})
    without_flip = {"c_commands": "c_commands", "c_not_stopped": "c_not_stopped"}
    monkeypatch.setattr(
        flips,
        "check",
        lambda _design, _module, _about, bit, happens=(): (
            "a_control" if bit else without_flip.get("".join(happens), "")
        ),
    )
    with pytest.raises(flips.FlipError, match="fc_tx: no flip breaks a_stop, which may say nothing"):
        flips.prove("fc_tx", 1)


def test_a_telegram_happens_in_the_clocks_of_the_proof(gate):
    assert flips.check(gate, "commit_gate", ABOUT, None, ("c_command",)) == "c_command"


def test_the_fingerprint_follows_verilog_and_promises(monkeypatch, tmp_path):
    before = flips.fingerprint("fc_tx")
    text = (ROOT / "rtl/fc_tx.v").read_text()
    for changed, same in ((text + "// a comment\n", True), (text.replace("wire", "reg", 1), False)):
        (tmp_path / "fc_tx.v").write_text(changed)
        monkeypatch.setattr(flips, "source", lambda module: tmp_path / f"{module}.v")
        assert (flips.fingerprint("fc_tx") == before) == same


def of_the_gate(*broken: str) -> list[flips.Found]:
    """Results in which the listed bits of the gate, and these bits, are not proved; two others are."""
    listed = flips.known()["commit_gate"]["unproved"]
    bad = (*listed, *broken)
    names = [*listed, "request_i.fine[0]", "request_i.fine[1]"]
    return [
        flips.Found("commit_gate", flips.Bit(name, "cell", 0), "a_licence" if name in bad else "")
        for name in names
    ]


def test_a_bit_that_is_no_longer_proved_is_an_error():
    assert flips.surprises(of_the_gate()) == []
    lost = flips.surprises(of_the_gate("request_i.fine[1]"))
    assert lost == ["commit_gate: request_i.fine[1] is not proved and not in `unproved`"]


def test_a_listed_bit_that_is_proved_or_gone_is_an_error():
    first, second, *others = of_the_gate()
    found = flips.surprises([dataclasses.replace(first, broken=""), *others])
    assert found == [
        f"commit_gate: {first.bit.name} is proved, but in `unproved`",
        f"commit_gate: it has no flip-flop {second.bit.name}",
    ]


def test_the_state_before_a_flip_is_as_deep_as_each_proof():
    for module, about in flips.known().items():
        assert formal.known()[module][about["task"]]["depth"] <= flips.GOOD_CLOCKS, module
