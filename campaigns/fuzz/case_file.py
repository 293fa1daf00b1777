# SPDX-License-Identifier: Apache-2.0
"""Reads a case of the fuzzer (campaigns/fuzz/case.py) from a file; refuses an invalid file with one line."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection
from pathlib import Path

from sim.harness.pins import BAUDS, FORMS
from tb.model.card import DIALECTS
from tb.model.vlt_drive import PROFILES


class CaseError(Exception):
    """Error for the user, in one line."""


def _number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _hex(value: object) -> bool:
    return isinstance(value, str) and bool(re.fullmatch(r"([0-9a-fA-F]{2})+", value))


def _whole(least: int, most: int) -> Callable[[object], bool]:
    return lambda value: isinstance(value, int) and _number(value) and least <= value <= most


def _flag(value: object) -> bool:
    return isinstance(value, bool)


def _pairs(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(pair, list) and len(pair) == 2 and all(map(_number, pair)) for pair in value
    )


def _by_place(fits: Callable[[object], bool]) -> Callable[[object], bool]:
    """Check for values by character number, from 0 on."""
    return lambda value: (
        isinstance(value, dict) and all(key.isdecimal() and fits(of) for key, of in value.items())
    )


def _gap(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2 and value[0] in ("idle", "own") and _number(value[1])


def _one_of(names: Collection) -> Callable[[object], bool]:
    return lambda value: isinstance(value, (int, str)) and value in names


CHARACTERS = {
    "gaps": _by_place(_number),
    "flaws": _by_place(_one_of(("parity", "stop"))),
    "error": lambda value: _number(value) and abs(value) < 0.5,
    "glitches": _pairs,
}
ANSWER = CHARACTERS | {
    "gap": _number,
    "bytes": _hex,
    "silent": _flag,
    "stale": _flag,
    "raw": _flag,
    "fault": _whole(0, 0xFFFFFFFF),
    "pwe": _whole(0, 0xFFFFFFFF),
    "bcc": _whole(0, 255),
    "cut": _whole(0, 255),
    "edit": _pairs,
    "before": _hex,
    "after": _hex,
}
BABBLE = CHARACTERS | {"gap": _number, "bytes": _hex, "rude": _flag}
EVENT = CHARACTERS | {
    "what": lambda value: isinstance(value, str),
    "gap": _gap,
    "bytes": _hex,
    "pdu": _hex,
    "pulses": lambda value: isinstance(value, list) and bool(value) and all(map(_number, value)),
}
CASE = {
    "baud": _one_of(BAUDS),
    "form": _one_of(FORMS),
    "address": _whole(1, 247),
    "dialect": _one_of(DIALECTS),
    "profile": _one_of(PROFILES),
    "events": lambda value: isinstance(value, list),
}
CLOCK = {"clk_hz": _whole(2_000_000, 100_000_000)}


def _check(where: str, value: object, fits: dict, needs: tuple[str, ...] = ()) -> dict:
    if not isinstance(value, dict):
        raise CaseError(f"{where} is no object")
    for key in needs:
        if key not in value:
            raise CaseError(f"{where} has no '{key}'")
    for key, of in value.items():
        if key not in fits:
            raise CaseError(f"{where}: '{key}' is not known; there are {', '.join(fits)}")
        if not fits[key](of):
            raise CaseError(f"{where}: '{key}' cannot be {json.dumps(of)[:60]}")
    return value


def check(case: object) -> dict:
    """Returns the case; CaseError names the invalid part."""
    case = _check("the case", case, CASE | CLOCK, tuple(CASE))
    anything = {"drive": lambda value: isinstance(value, list), "babble": bool, "interrupt": bool}
    for number, event in enumerate(case["events"]):
        where = f"event {number}"
        _check(where, event, EVENT | anything, ("gap",))
        if sum(key in event for key in ("bytes", "pdu", "pulses")) != 1:
            raise CaseError(f"{where} has to have one of 'bytes', 'pdu', 'pulses'")
        if "babble" in event:
            _check(f"{where}, babble", event["babble"], BABBLE, ("gap", "bytes"))
        if "interrupt" in event:
            _check(f"{where}, interrupt", event["interrupt"], BABBLE, ("gap", "bytes"))
        for manner in event.get("drive", []):
            parts = manner.get("parts") if isinstance(manner, dict) and set(manner) == {"parts"} else [manner]
            if not isinstance(parts, list):
                raise CaseError(f"{where}, drive: 'parts' is no list")
            for part in parts:
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
