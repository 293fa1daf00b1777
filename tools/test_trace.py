# SPDX-License-Identifier: Apache-2.0
"""The choice of `make test` shows every rule that tests show."""

from __future__ import annotations

from tb.lib import pytest_plugin
from tools import trace


def test_make_test_shows_every_rule(monkeypatch):
    """Each rule has a test among those that `make test` runs, not only among those of `make test-all`."""
    monkeypatch.setattr(pytest_plugin, "costly", lambda item, config: not pytest_plugin.in_make_test(item))
    chosen = trace.collect().tests
    missing = [rule for rule, by in trace.read_rules().items() if by == "test" and rule not in chosen]
    assert missing == []


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
