# SPDX-License-Identifier: Apache-2.0
"""The draw of `make kills` and its end when nothing notices a bug. Nightly it plants every bug."""

from __future__ import annotations

import subprocess
import sys

import pytest

from campaigns.kills import run as kills
from rtl.sources import ROOT


@pytest.mark.parametrize(("sample", "groups"), [(2, 2), (3, 3), (30, 3), (99, 3)])
def test_each_group_is_in_the_sample_as_far_as_it_goes(sample, groups):
    found = kills.quotas({"small": 1, "middle": 9, "large": 90}, sample, seed=7)
    assert found.total() == sample and len(found) == groups
    assert sample < 30 or (found["small"] == 1 and found["large"] > found["middle"])


def test_a_change_has_one_name_and_one_place():
    groups = [*kills.groups_of_mutants("60", 1), *kills.groups_of_plants()]
    changes = [change for _, changes in groups for change in changes]
    assert len({(kind, name) for kind, name, _, _ in changes}) == len(changes) > 1700
    assert sum(wanted for wanted, _ in kills.groups_of_mutants("60", 1)) == 60


def test_what_nothing_notices_is_named_and_a_second_run_keeps_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(kills, "FOLDER", tmp_path)
    monkeypatch.setattr(kills, "MATRIX", tmp_path / "matrix.json")
    row = kills.Row("Verilog mutant", "m.v:1 a -> b", "unnoticed")
    monkeypatch.setattr(kills, "tasks", lambda matrix, _: [] if matrix.rows else [lambda: matrix.add(row)])
    for arguments in (["--seed=5"], ["--seed=5"], ["--seed=5", "--sample=7"]):
        assert kills.main(arguments) == 1
        assert "kills: nothing notices Verilog mutant m.v:1 a -> b\n" in capsys.readouterr().err
    row.verdict, row.by = "noticed", "tb/rtl/test_m.py::test_m[icarus]"
    assert kills.main(["--seed=6"]) == 0
    assert row.by in (tmp_path / "matrix.tsv").read_text()
    with pytest.raises(SystemExit):
        kills.main(["--seed=6", "--only=nosuch"])
    assert "no mutant, bug or fault has 'nosuch' in its kind and name" in capsys.readouterr().err
    pages: list[str] = []
    monkeypatch.setattr(kills, "publish", lambda name, text, *rest, **more: pages.append(text))
    assert kills.main(["--seed=6", "--page=yes"]) == 0
    assert "| Verilog mutant | 1 | 1 | 9.90e-01 | 0 |" in pages[0]
    assert "| `tb/rtl/test_m.py` | 1 |" in pages[0]


@pytest.mark.nightly("synth")
def test_every_planted_bug_is_noticed():
    command = [sys.executable, "-m", "campaigns.kills.run", "--sample=0", "--seed=1", "--jobs=1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr
