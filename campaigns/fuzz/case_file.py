# SPDX-License-Identifier: Apache-2.0
"""Reads a case of the fuzzer (campaigns/fuzz/case.py) from a file; refuses an invalid file with one line."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path

from sim.harness.pins import BAUDS, FORMS
from tb.model.card import DIALECTS
from tb.model.vlt_drive import PROFILES


class CaseError(Exception):
    """Error for the user, in one line."""


CHARACTERS = {"gaps", "flaws", "error", "glitches"}
ANSWER = CHARACTERS | {"gap", "bytes", "silent", "stale", "raw", "fault", "pwe", "bcc", "cut", "edit"}
ANSWER |= {"before", "after"}
BABBLE = CHARACTERS | {"gap", "bytes", "rude"}
EVENT = CHARACTERS | {"what", "gap", "bytes", "pdu", "pulses", "drive", "babble", "interrupt"}
CASE: dict[str, Collection] = {
    "baud": BAUDS,
    "form": FORMS,
    "address": range(1, 248),
    "dialect": DIALECTS,
    "profile": PROFILES,
}


def _check(where: str, value: object, known: Collection[str], needs: Collection[str] = ()) -> dict:
    if not isinstance(value, dict):
        raise CaseError(f"{where} is no object")
    for key in needs:
        if key not in value:
            raise CaseError(f"{where} has no '{key}'")
    for key in value:
        if key not in known:
            raise CaseError(f"{where}: '{key}' is not known; there are {', '.join(sorted(known))}")
    return value


def check(case: object) -> dict:
    """Returns the case; CaseError names the invalid part."""
    needs = {*CASE, "events"}
    case = _check("the case", case, needs | {"clk_hz"}, needs)
    for key, values in CASE.items():
        if case[key] not in values:
            raise CaseError(f"the case: '{key}' cannot be {case[key]}")
    for number, event in enumerate(case["events"]):
        where = f"event {number}"
        _check(where, event, EVENT, ("gap",))
        if sum(key in event for key in ("bytes", "pdu", "pulses")) != 1:
            raise CaseError(f"{where} has to have one of 'bytes', 'pdu', 'pulses'")
        for key in ("babble", "interrupt"):
            if key in event:
                _check(f"{where}, {key}", event[key], BABBLE, ("gap", "bytes"))
        for manner in event.get("drive", []):
            for part in manner.get("parts", [manner]):
                _check(f"{where}, drive", part, ANSWER)
    return case


def text(case: dict) -> str:
    """The case as JSON, a line for each event."""
    head = json.dumps({key: value for key, value in case.items() if key != "events"})
    events = ",\n".join(f"  {json.dumps(event)}" for event in case["events"])
    return f'{head[:-1]}, "events": [\n{events}\n]}}\n'


def read(path: Path) -> dict:
    try:
        case = json.loads(path.read_text())
    except OSError as error:
        raise CaseError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise CaseError(f"{path} is no case of the fuzzer: {error}") from error
    try:
        return check(case)
    except CaseError as error:
        raise CaseError(f"{path} is no case of the fuzzer: {error}") from None
