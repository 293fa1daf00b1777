# SPDX-License-Identifier: Apache-2.0
"""The choice of `make test` shows every rule that tests show."""

from __future__ import annotations

import json
import re

import pytest

from tools import trace


@pytest.fixture(scope="module")
def collected(request) -> trace.Collector:
    """The tests of this run if it is that of `make test`; else they are collected once more."""
    config = request.config
    part = any(config.getoption(option) for option in ("keyword", "--all", "--sim", "--card"))
    if part or config.args != config.getini("testpaths"):
        return trace.collect(nightly=False)
    found = trace.Collector()
    found.pytest_collection_modifyitems(request.session.items)
    return found


def test_make_test_shows_every_rule(collected):
    """Each rule has a test among those that `make test` runs, not only among those of `make nightly`."""
    missing = [
        rule for rule, by in trace.read_rules().items() if by == "test" and rule not in collected.tests
    ]
    assert missing == []


@pytest.mark.parametrize("left_out", ["nothing", "a rule's tests"])
def test_complete_asks_for_a_passed_test_of_each_rule(left_out, collected, tmp_path, monkeypatch, capsys):
    missing = set(collected.tests["FRAME-4"]) if left_out != "nothing" else set()
    results = tmp_path / "results.json"
    old = {"outcome": "passed", "commit": "0123456", "at": "2026-01-02 03:04"}
    results.write_text(json.dumps(dict.fromkeys(collected.all - missing, old)))
    monkeypatch.setattr(trace, "RESULTS", results)
    monkeypatch.setattr(trace, "RUNS", tmp_path)
    monkeypatch.setattr(trace, "collect", lambda: collected)
    monkeypatch.setattr(trace, "cocotb_tests", lambda path: set())
    monkeypatch.setattr("sys.argv", ["trace", "--complete"])
    assert trace.main() == bool(missing)
    said = capsys.readouterr()
    assert ("FRAME-4: no test of it has passed" in said.err) == bool(missing)
    assert re.search(r"\d results are of another commit than \S*, the oldest of 2026-01-02 03:04", said.out)
