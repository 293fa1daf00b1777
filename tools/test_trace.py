# SPDX-License-Identifier: Apache-2.0
"""The choice of `make test` shows every rule that tests show."""

from __future__ import annotations

import json

import pytest

from tb.lib import pytest_plugin
from tools import trace


def test_make_test_shows_every_rule(monkeypatch):
    """Each rule has a test among those that `make test` runs, not only among those of `make test-all`."""
    monkeypatch.setattr(pytest_plugin, "costly", lambda item, config: not pytest_plugin.in_make_test(item))
    chosen = trace.collect().tests
    missing = [rule for rule, by in trace.read_rules().items() if by == "test" and rule not in chosen]
    assert missing == []


@pytest.mark.slow
def test_the_rest_and_make_test_are_all_tests(monkeypatch):
    """The run of CI calls `make test` and `make test-all REST=1`, which leaves out twins.

    CI runs another case of each twin.
    """
    every, rest, twins = (trace.collect(*options).all for options in ((), ("--rest",), ("-m", "twin")))
    monkeypatch.setattr(pytest_plugin, "costly", lambda item, config: not pytest_plugin.in_make_test(item))
    chosen = trace.collect().all
    assert rest and rest == every - chosen - twins and chosen < every
    assert twins < every - chosen
    assert {test.partition("[")[0] for test in twins} <= {test.partition("[")[0] for test in rest | chosen}


@pytest.fixture(scope="module")
def collected() -> trace.Collector:
    return trace.collect()


@pytest.mark.parametrize(("left_out", "code"), [("nothing", 0), ("twins", 0), ("a test", 1)])
def test_complete_asks_for_all_that_ci_runs(left_out, code, collected, tmp_path, monkeypatch, capsys):
    """`--complete`, the last step of CI, fails on a test that was not run; CI does not run twins."""
    missing = {"nothing": set(), "twins": collected.twins, "a test": {min(collected.all - collected.twins)}}[
        left_out
    ]
    results = tmp_path / "results.json"
    results.write_text(json.dumps(dict.fromkeys(sorted(collected.all - missing), "passed")))
    monkeypatch.setattr(trace, "RESULTS", results)
    monkeypatch.setattr(trace, "RUNS", tmp_path)
    monkeypatch.setattr(trace, "collect", lambda: collected)
    monkeypatch.setattr(trace, "cocotb_tests", lambda path: set())
    monkeypatch.setattr("sys.argv", ["trace", "--complete"])
    assert trace.main() == code
    said = capsys.readouterr()
    assert ("have not been run" in said.err) == (code == 1)
    assert (f"{len(collected.twins)} of them twins" in said.out) == (left_out == "twins")
