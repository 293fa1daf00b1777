# SPDX-License-Identifier: Apache-2.0
"""The changes of the Verilog, and their verdicts."""

from __future__ import annotations

import sys

import pytest

from campaigns.kills import verilog as mutate
from campaigns.kills.run import LINT, noticed_wider
from rtl.sources import rtl_files
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
        with pytest.raises(SystemExit, match="bcc-0: exit code"):
            tree.run("bash", "-c", command)


@pytest.mark.nightly
def test_verdicts_of_a_tree(tmp_path, monkeypatch):
    """A mutant that every text of a bench would catch, one without effect, and one that does not compile."""
    monkeypatch.setattr(mutate, "WORK", tmp_path)
    tree = mutate.Tree(0, "baud_divider")
    tree.baseline()
    found = mutate.mutants("baud_divider", tree.path)
    broken = next(mutant for mutant in found if mutant.text == "||")
    assert tree.evaluate(broken).verdict == "caught"
    at = tree.original.index("  wire third")
    idle = mutate.Mutant("baud_divider", 1, "", "", at, at, " ")
    assert tree.evaluate(idle).verdict == "survived"
    monkeypatch.setattr(mutate, "excused", lambda: {("baud_divider", " -> ")})
    assert tree.evaluate(idle).verdict == "same"
    assert tree.evaluate(mutate.Mutant("baud_divider", 1, "", "", at, at, "((")).verdict == "invalid"


@pytest.mark.nightly
def test_the_checks_of_the_card_pass_in_a_copy(tmp_path, monkeypatch):
    """The tests need every image that they play. Verilator warns of a wire that nothing reads."""
    monkeypatch.setattr(mutate, "WORK", tmp_path)
    tree = mutate.Tree(0, mutate.TOP)
    lint = (sys.executable, "-m", "tools.lint", "--only", LINT)
    assert tree.failing("test", changed=False) == "" and tree.run(*lint)[0]
    at = tree.original.index("(frame_writes_parameter)", tree.original.index("mailbox #("))
    unread = mutate.Mutant(mutate.TOP, 1, "", "", at, at + len("(frame_writes_parameter)"), "(1'b1)")
    assert noticed_wider(tree, unread) == f"make lint, {LINT}"
    assert tree.file.read_text() == tree.original


def test_each_excuse_fits_a_mutant_of_the_present_module(monkeypatch, tmp_path, capsys):
    known = {
        (name, f"{mutant.before} -> {mutant.after}")
        for name in mutate.benches()
        for mutant in mutate.shuffled(name, 1)
    }
    assert mutate.excused() <= known and not capsys.readouterr().err
    old = tmp_path / "survivors.toml"
    (core,) = [path for path in rtl_files() if path.stem == "soft_core"]
    old.write_text(mutate.EXCUSES.read_text().replace(mutate.fingerprint(core), "0"))
    monkeypatch.setattr(mutate, "EXCUSES", old)
    assert "soft_core" not in {module for module, _ in mutate.excused()}
    assert "another soft_core.v" in capsys.readouterr().err
