# SPDX-License-Identifier: Apache-2.0
"""Changes and verdicts of `make mutate`, and its report."""

from __future__ import annotations

import json
import re
from dataclasses import asdict

import pytest

from campaigns.mutate import run as mutate
from campaigns.mutate import same
from rtl.sources import ROOT, rtl_files
from tb.lib.rows import each_row


def test_changes_affect_only_code():
    text = """module m (
    input wire clk
);
  // a == b
`ifdef FORMAL
  initial if (a == b) c = 1'b0;
`endif
  reg [1:0] z = 2'd2;
  always @(posedge clk) if (x == y) z <= 2'd1;
endmodule
"""
    found = {text[start:end] + ">" + new for start, end, new in mutate.changes(text)}
    assert found == {
        "==>!=",
        "2'd1>2'd2",
        "2'd1>2'd0",
        "x == y>1'b0 && (x == y)",
        "x == y>1'b1 || (x == y)",
        "z <= 2'd1;>;",
        "2'd1>~(2'd1)",
    }


@each_row(
    ("before", "after"),
    [
        *[("x == y", "x != y"), ("x != y", "x == y"), ("x && y", "x || y"), ("x || y", "x && y")],
        *[("x & y", "x | y"), ("x | y", "x & y"), ("x ^ y", "x | y"), ("x + y", "x - y"), ("x - y", "x + y")],
        *[("x >= y", "x > y"), ("x > y", "x >= y"), ("!x", "x"), ("~x", "x")],
        *[("1'b0", "1'b1"), ("1'b1", "1'b0")],
        *[("x[2]", "x[1]"), ("x[2]", "x[3]"), ("4'd3", "4'd4"), ("4'd3", "4'd2"), ("8'hFF", "8'h0")],
        *[("x", "~(x)"), ("x", "0")],
    ],
)
def test_every_kind_of_change_is_made(before, after):
    text = f"module m;\n  assign z = {before};\nendmodule\n"
    made = {text[:start] + new + text[end:] for start, end, new in mutate.changes(text)}
    assert f"module m;\n  assign z = {after};\nendmodule\n" in made


def test_every_module_has_mutants():
    assert mutate.benches() == [path.stem for path in rtl_files()]
    assert not [module for module in mutate.benches() if "None" in mutate.bench_arguments(module)]


def test_check_without_end_counts_as_caught(tmp_path, monkeypatch):
    monkeypatch.setattr(mutate, "WORK", tmp_path)
    tree = mutate.Tree(0, "bcc")
    tree.longest_s = 0.5
    assert tree.run("bash", "-c", "sleep 60 & wait") == (False, "no end within 0 s, twice")


def test_only_an_exit_code_of_1_counts_as_caught(tmp_path, monkeypatch):
    """Exit code 5 of pytest: no test was found; -9: the machine had no memory left."""
    monkeypatch.setattr(mutate, "WORK", tmp_path)
    tree = mutate.Tree(0, "bcc")
    assert [tree.run("bash", "-c", f"exit {code}")[0] for code in (0, 1)] == [True, False]
    for command in ("echo nothing to run; exit 5", "kill -9 $$"):
        with pytest.raises(SystemExit, match="mutate: bcc-0: exit code"):
            tree.run("bash", "-c", command)


@pytest.mark.nightly
def test_verdicts_of_a_tree(tmp_path, monkeypatch):
    """A mutant that every text of a bench would catch, one without effect, and one that does not compile."""
    monkeypatch.setattr(mutate, "WORK", tmp_path)
    tree = mutate.Tree(0, "bcc")
    tree.baseline()
    found = mutate.mutants("bcc", tree.path)
    broken = next(mutant for mutant in found if (mutant.text, "^" in mutant.before) == ("|", True))
    assert tree.evaluate(broken).verdict == "caught"
    at = tree.original.index("  assign")
    assert tree.evaluate(mutate.Mutant("bcc", 1, "", "", at, at, " ")).verdict == "same"
    assert tree.evaluate(mutate.Mutant("bcc", 1, "", "", at, at, "((")).verdict == "invalid"


CHANGES = {
    # module: original, changed, proved the same
    "another formula": ("bcc", "value[0] ^ bit_data", "(value[0] != bit_data)", True),
    "another result": ("bcc", "value[0] ^ bit_data", "value[0] | bit_data", False),
    "another number of a state": ("rtu_tx", "S_DRAIN = 3'd5", "S_DRAIN = 3'd6", True),
    "a number that two states have": ("rtu_tx", "S_DRAIN = 3'd5", "S_DRAIN = 3'd4", False),
    "an input that nothing reads": ("drive_port", ".check_bit(1'b0)", ".check_bit(1'b1)", True),
    "an input that is read": ("drive_port", ".two_stop(TWO_STOP)", ".two_stop(1'b1)", False),
    "either of two damaged bytes": ("word_parity", "odd[i] <= 1'b1", "odd[3-i] <= 1'b1", True),
    "another value at power-up": ("driver_limit", "beats = 4'd0;", "beats = 4'd1;", False),
    "a memory that keeps something else": ("ram_lane", "words[place] <= ", "words[place] <= ~", False),
    "another rate at 2 MHz": ("baud_base", "64'd65536", "64'd65535", False),
    "another result on the small card": (
        "bus_arbiter",
        "(LAST[WORD_BITS-2] || !core_addr[WORD_BITS+1])",
        "1'b1",
        False,
    ),
    "another result with an option": ("rtu_rx", "|| held || state == S_WAIT", "|| held", False),
    "a fault that only a flipped bit makes": (
        "guarded_bit",
        "assign fault = held == opposite",
        "assign fault = 0",
        False,
    ),
    "both faults in place of either": (
        "licences",
        "image_fault || free_fault",
        "image_fault && free_fault",
        False,
    ),
    "an undefined bit": ("bcc", "value == 8'h00", "value[7] == 1'bx", False),
}


@pytest.mark.nightly
@pytest.mark.parametrize(("module", "old", "new", "proved"), CHANGES.values(), ids=CHANGES)
def test_a_solver_compares_a_module_with_the_original(request, module, old, new, proved):
    path = next(path for path in rtl_files() if path.stem == module)
    folder = ROOT / "build/mutate" / re.sub(r"\W", "_", request.node.name)
    changed = folder / "changed" / path.name
    changed.parent.mkdir(parents=True, exist_ok=True)
    assert old in path.read_text()
    changed.write_text(path.read_text().replace(old, new, 1))
    assert same.proved_same(changed, folder) == proved


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("module", "port", "proved"),
    [("supervisor", "beat", True), ("supervisor", "kick", False), ("commit_gate", "watch", False)],
)
def test_a_solver_compares_a_module_with_an_input_inverted(module, port, proved):
    """The supervisor counts changes of beat, and the level of kick. An instance in the gate has `watch`."""
    path = next(path for path in rtl_files() if path.stem == module)
    assert same.proved_same_inverted(path, port, ROOT / f"build/mutate/inverted_{port}") == proved


def test_a_survivor_fails(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(mutate, "WORK", tmp_path)
    path = next(path for path in rtl_files() if path.stem == "bcc")
    mutant = mutate.Mutant("bcc", 1, "a", "b", 0, 1, "b", "survived")
    document = {"module": "bcc", "of": mutate.fingerprint(path), "seed": 1, "possible": 7}
    for verdict, result in (("survived", 1), ("same", 0), ("caught", 0)):
        mutant.verdict, mutant.by = verdict, "test" if verdict == "caught" else ""
        other = mutate.Mutant("bcc", 2, "c", "d", 2, 3, "d", "caught", "test")
        rows = [asdict(mutant), asdict(other)]
        (tmp_path / "bcc.json").write_text(json.dumps(document | {"mutants": rows}))
        assert mutate.report(write=False) == result
        assert ("`a` → `b`: survived" in capsys.readouterr().out) == bool(result)
