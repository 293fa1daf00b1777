# SPDX-License-Identifier: Apache-2.0
"""The debugging guide: its recordings equal runs of the card, its outputs those of the commands."""

from __future__ import annotations

import json
import re
from itertools import zip_longest
from pathlib import Path

import pytest

from sim.view import tshark
from sim.view.wireshark import SCRIPT, environment
from tools import symptoms
from tools.symptoms import COMMAND, GUIDE, GUIDES, RECORDINGS, SYMPTOMS, with_outputs

pytestmark = pytest.mark.nightly("views")

# Tolerance for changes of the firmware.
SAME_S = 0.002
CONTROL_BIT_10 = 0x0400


def without_bit_10(entry: dict) -> bool:
    is_telegram = (entry["line"], entry["from"]) == ("drive", "card")
    return is_telegram and not int.from_bytes(bytes.fromhex(entry["bytes"])[3:5], "big") & CONTROL_BIT_10


# Section, its recordings, and the frames that its filter must find in the first, according to the log.
SECTIONS = {
    "No answer": (["no-answer"], lambda entry: not entry["ok"]),
    "CRC errors": (["crc-errors"], lambda entry: entry["what"] == "CRC wrong"),
    "Answers sometimes": (["answers-sometimes"], lambda entry: entry["what"].startswith("revoked")),
    "Exception 255": (["exception-255"], lambda entry: "exception 255" in entry["what"]),
    "Drive does not start though written": (["no-start"], without_bit_10),
    "Off by one register": (["off-by-one"], lambda entry: "exception 64" in entry["what"]),
    "USB adapter and t1.5": (["usb-adapter"], lambda entry: entry["what"].startswith("gap")),
    "RTU over TCP": (["rtu-over-tcp"], lambda entry: entry["what"] == "CRC wrong"),
    "Reply too fast": (["fast-reply", "delayed-reply"], lambda entry: entry["from"] == "card"),
    "Own echo": (["own-echo"], lambda entry: entry["what"].startswith("unit 2")),
    "Old values": (["old-values"], lambda entry: "coils 33-64" in entry["what"]),
    "Word order": (["word-order"], lambda entry: "refused, fault 2" in entry["what"]),
    "Merged reads": (["merged-reads"], lambda entry: "exception 66" in entry["what"]),
    "LED states": (["led-states", "led-fault"], None),
    "A bus without bias": (["no-bias"], lambda entry: entry["what"].startswith("stop bit")),
}


def entries(name: str, folder: Path = RECORDINGS) -> list[dict]:
    return [json.loads(line) for line in (folder / f"{name}.jsonl").read_text().splitlines()]


def frames_of(name: str) -> list[dict]:
    return [entry for entry in entries(name) if "line" in entry]


def sections() -> dict[str, str]:
    parts = re.split(r"^## (.*)$", GUIDE.read_text(), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def words(entry: dict) -> dict:
    return {key: value for key, value in entry.items() if key not in ("t", "end")}


def difference(before: list[dict], now: list[dict]) -> str | None:
    """First entry that differs in content or time. LEDs and lines are compared separately."""

    def stream(entry: dict) -> str:
        return entry.get("line") or f"{entry['led']} LED"

    # A sort keeps the order within each stream.
    for old, new in zip_longest(sorted(before, key=stream), sorted(now, key=stream)):
        if not (old and new) or words(old) != words(new) or abs(old["t"] - new["t"]) > SAME_S:
            return f"{old} is now {new}"
    return None


# ---------------------------------------------------------------- the recordings are runs of the card


@pytest.mark.parametrize("name", SYMPTOMS)
def test_recording_equals_its_run(name, tmp_path):
    symptoms.make(name, tmp_path)
    wrong = difference(entries(name), entries(name, tmp_path))
    assert wrong is None, f"docs/recordings/{name}.jsonl: {wrong}; run `make symptoms`"


# ---------------------------------------------------------------- the guide


def test_every_symptom_has_a_section_that_names_its_recording():
    guide = sections()
    assert [title for title in guide if title in SECTIONS] == list(SECTIONS)
    assert [name for names, _ in SECTIONS.values() for name in names] == list(SYMPTOMS)
    for title, (names, _) in SECTIONS.items():
        shown = re.findall(
            r"^\$ \.venv/bin/python -m sw\.rtu2fc decode docs/recordings/([\w-]+)\.jsonl",
            guide[title],
            re.MULTILINE,
        )
        assert shown == names, title
        assert re.search(r"^(1\. |\| \w.* \| \w.* \|)", guide[title], re.MULTILINE), f"{title}: no causes"


def test_outputs_in_the_guide_equal_the_commands():
    commands = 0
    for page in GUIDES:
        guide = page.read_text()
        commands += len(COMMAND.findall(guide))
        assert with_outputs(guide) == guide, f"{page.name} shows old outputs; run `make symptoms`"
    replays = 1  # of a recorded bus
    assert commands == len(SYMPTOMS) + replays


def test_filters_of_the_guide_find_exactly_the_fault():
    for title, (names, wrong) in SECTIONS.items():
        if wrong is None:  # no frame shows what the LEDs say
            continue
        (row,) = re.findall(r"^Filter: (.*)$", sections()[title], re.MULTILINE)
        only = re.findall(r"`([^`]+)`", row)[0]
        capture = RECORDINGS / f"{names[0]}.pcapng"
        found = tshark.fields(capture, "frame.number", only=only, options=["-2", *SCRIPT], env=environment())
        due = [str(number) for number, entry in enumerate(frames_of(names[0]), 1) if wrong(entry)]
        assert [packet["frame.number"] for packet in found] == due != [], title
