# SPDX-License-Identifier: Apache-2.0
"""Reduces a failing case: fewer events (ddmin), then simpler ones."""

from __future__ import annotations

import copy
from collections.abc import Callable

Fails = Callable[[dict], bool]


def shrink(case: dict, fails: Fails, tries: int = 400) -> dict:
    """The smallest failing case found; calls `fails` at most `tries` times."""
    left = [tries]

    def still(events: list[dict]) -> bool:
        if left[0] <= 0:
            return False
        left[0] -= 1
        return fails({**case, "events": events})

    events = _ddmin(case["events"], still)
    events = _plainer(events, still)
    return {**case, "events": events}


def _ddmin(events: list[dict], still: Callable[[list[dict]], bool]) -> list[dict]:
    parts = 2
    while len(events) > 1:
        size = -(-len(events) // parts)
        for at in range(0, len(events), size):
            rest = events[:at] + events[at + size :]
            if still(rest):
                events, parts = rest, max(parts - 1, 2)
                break
        else:
            if parts >= len(events):
                break
            parts = min(2 * parts, len(events))
    return events if len(events) != 1 or not still([]) else []


def _plainer(events: list[dict], still: Callable[[list[dict]], bool]) -> list[dict]:
    """Removes optional parts of events, one at a time."""
    for number in range(len(events)):
        for key in ("babble", "interrupt", "drive", "glitches", "error", "gaps", "flaws"):
            if key in events[number]:
                tried = copy.deepcopy(events)
                del tried[number][key]
                if still(tried):
                    events = tried
        if events[number]["gap"][0] == "idle" and events[number]["gap"][1] != 10.0:
            tried = copy.deepcopy(events)
            tried[number]["gap"] = ["idle", 10.0]
            if still(tried):
                events = tried
    return events
