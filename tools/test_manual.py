# SPDX-License-Identifier: Apache-2.0
"""What an owner does with tools and wires, against lines typed from the original's manual (23-6130-00).

The expected values are typed here on purpose: a test that reads them from our own tables would follow a
mistake in these. Each stands with its page in the manual.
"""

from __future__ import annotations

import re

import pytest

from rtl.sources import ROOT
from tb.lib.rows import each_row
from tools.handbook import rows

GUIDES = ROOT / "docs/guide"
# How often a page at least says to wait, before each thing that leads a hand into a drive.
WAITS = {
    "docs/guide/handbook.md": 1,
    "docs/guide/handbook/safety.md": 2,
    "docs/guide/handbook/installing.md": 2,
    "docs/guide/handbook/switches-and-leds.md": 4,
    "docs/guide/build.md": 2,
    "docs/guide/bring-up.md": 2,
    "docs/guide/hardware.md": 1,
    "docs/guide/debugging.md": 5,
    "docs/switches.html": 1,
    "sw/rtu2fc/card.py": 1,
    "sw/rtu2fc/switches.py": 1,
}
PROGRAMS = sorted((ROOT / "campaigns/masters/example_programs").iterdir())
INSTALLING = (GUIDES / "handbook/installing.md").read_text()
STEPS = dict(
    re.findall(r"^\d+\. \*\*([^*]+?)\.?\*\*(.*?)(?=^\d+\. |^!)", INSTALLING, re.MULTILINE | re.DOTALL)
)


def one_line(text: str) -> str:
    return re.sub(r"\s+", " ", text.replace("**", ""))


@pytest.mark.parametrize("name", WAITS)
def test_the_wait_is_14_minutes(name):
    """P2: 'wait 14 minutes after power has been removed before touching any internal component'."""
    found = re.findall(r"(\d+) minutes?\b", one_line((ROOT / name).read_text()))
    assert set(found) == {"14"} and len(found) >= WAITS[name]


def test_the_order_of_the_steps():
    """P9-12, and before them the machine and the network; the cover is closed before the power is on."""
    assert [one_line(title) for title in STEPS] == [
        "Machine and network",
        "Power",
        "Open the drive",
        "Free the cassette",
        "Take the cassette out",
        "Take out the old card",
        "Fasten the new card",
        "Wire the 6-pin connector",
        "Reassemble",
        "Network plug",
        "Close",
        "Power on",
    ]
    said = {title: one_line(text) for title, text in STEPS.items()}
    assert (
        "stop every drive of the network. Unplug the network cable at the master"
        in said["Machine and network"]
    )
    assert re.match(
        " Disconnect the drive from the line, and lock its switch.*. Wait 14 minutes", said["Power"]
    )
    assert "Wire the stop that needs neither bus nor card" in said["Wire the 6-pin connector"]
    assert "leave one of the baud switches 6-9 OFF" in said["Take out the old card"]
    assert "Only then connect the network, to a master that [sends no start]" in said["Power on"]


def test_the_order_of_the_handbook():
    """Each of these before the next one; the network is connected only when the drive is closed and on."""
    page = one_line((GUIDES / "handbook.md").read_text())
    at = [
        page.index(text)
        for text in (
            "Make the machine safe, so that an unexpected start can harm nobody",
            "Unplug the network at the master. Switch the drive off, wait 14 minutes, and take its cassette",
            "Take the old card out, and write down both its switch blocks",
            "close the drive. The network stays unplugged at the master",
            "Switch on. After 2 seconds both LEDs flash red",
            "Never open a live drive",
            "Connect the network, and read register 40003",
            "The motor turns now: keep the stop of step 1 within reach. For the first run take",
        )
    ]
    assert at == sorted(at)
    build = one_line((GUIDES / "build.md").read_text())
    assert "Ask it, without a drive. No drive is connected." in build
    assert build.index("Take out the old card with its wires") < build.index("Wire A of the drive module")
    assert "Unplug every USB cable to a computer" in build


def sentences(text: str) -> list[str]:
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.split(r"(?<=[.:|]) ", one_line(prose))


WORK = re.compile(r"\b(open|unplug|pull|measure|touch|disconnect|remove|loosen|wire)\b", re.IGNORECASE)
WITHIN = re.compile(r"\b(terminals?|cassette|inside|ribbon|connector|drive)\b", re.IGNORECASE)
ALIVE = re.compile(r"\b(running|live|turns|powered|while the motor|switched on)\b", re.IGNORECASE)
OWNERS = ["README.md", "docs/guide/handbook.md", "docs/reference/rtu2fc.md"]
OWNERS += [f"docs/guide/{name}.md" for name in ("build", "bring-up", "debugging")]
OWNERS += [str(path.relative_to(ROOT)) for path in sorted((GUIDES / "handbook").glob("*.md"))]


@each_row("name", OWNERS)
def test_no_sentence_asks_for_work_in_a_live_drive(name):
    asked = [
        said
        for said in sentences((ROOT / name).read_text())
        if WORK.search(said) and WITHIN.search(said) and ALIVE.search(said) and "never" not in said.lower()
    ]
    assert not asked


@pytest.mark.parametrize(
    ("step", "torque"),
    [
        ("Fasten the new card", "T-10, 8 in-lbs (0.90 N·m)"),  # p10
        ("Wire the 6-pin connector", "4.5 in-lbs (0.51 N·m)"),  # p11
        ("Reassemble", "two captive screws in turn, 8 in-lbs (0.90 N·m)"),  # p12
        ("Close", "7 in-lbs (0.79 N·m)"),  # p12
    ],
)
def test_torques(step, torque):
    said = one_line(STEPS[step])
    assert torque in said and said.count("in-lbs") == 1


def test_terminals():
    """P11 and p12."""
    drive = [
        (row["6-pin connector (drive)"], row["VLT terminal"])
        for row in rows("installing", "6-pin connector (drive)")
    ]
    assert drive == [("1", "12 or 13"), ("2", "69"), ("3", "39 and 61"), ("4", "68"), ("5, 6", "")]
    network = [row["signal"] for row in rows("installing", "3-pin connector (network)")]
    assert network == ["RTxD+", "common", "RTxD\N{MINUS SIGN}"]
    build = one_line((GUIDES / "build.md").read_text())
    assert (
        "Wire A of the drive module to terminal 68, B to 69, and the module's bus-side ground to 39 and 61"
        in build
    )
    assert "Terminals 12 and 13 stay free" in build


def test_wires_of_the_loop_back_test():
    """P13."""
    found = [tuple(row.values()) for row in rows("switches-and-leds", "6-pin connector", "Join these pins")]
    assert found == [("2", "3"), ("3", "2"), ("4", "1")]


def test_control_words():
    """P19 and p20 print three words. A reset is bit 7 (p17); bit 6, the start, must be 0 meanwhile."""
    used = {row["control word"]: row["use"] for row in rows("coils-and-words", "control word")}
    assert [used[word] for word in ("047Ch", "043Ch", "2C20h")] == ["start", "ramp stop", "coast stop"]
    for word, use in used.items():
        value = int(word[:4], 16)
        starts = use in ("start", "jog", "start in reverse")
        assert bool(value & 0x0040) == starts, f"{word}: bit 6 is the start"
        assert rows("coils-and-words", "control word")[list(used).index(word)]["bytes of coils 1-16"] == (
            f"`{value & 0xFF:02X} {value >> 8:02X}`"
        )
    page = one_line((GUIDES / "handbook/coils-and-words.md").read_text())
    assert "first remove its cause. Write 043Ch, then 04BCh, then 043Ch." in page
    assert "Write coil 7 = 0 first" in one_line((GUIDES / "handbook/safety.md").read_text())


ONE_SECOND = re.compile(
    r"timeout *= *1\b|timeout\(1\)|-o 1 |response_timeout\(\w+, 1, 0\)|setTimeout\(1000\)"
)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.name)
def test_an_example_program_stops_and_waits(program):
    """P20: ramp stop is 043Ch. Coil 44 is read after a parameter. The time-out is that of the table."""
    text = program.read_text()
    stop = "0 0 1 1 1 1 0 0 0 0 1 0 0 0 0 0" if program.suffix == ".sh" else "0x043c"
    ends = rf"(?s){stop}.*\b(5139|5140)\b.*\b(43|44)\b.*\bstopped\b"
    assert re.search(ends, text.lower()) and "0x047c" not in text.lower()
    assert ONE_SECOND.search(text)


@pytest.mark.parametrize("page", ["build", "hardware"])
def test_boards_of_the_flash_commands(page):
    """The names that `openFPGALoader --list-boards` prints, for the files of the boards."""
    named = dict(re.findall(r"openFPGALoader -b (\S+) .*?\.(\w+)", (GUIDES / f"{page}.md").read_text()))
    known = {"tangnano9k": "fs", "ice40_generic": "bin", "ulx3s": "bit"}
    assert named and named == {name: known.get(name, suffix) for name, suffix in named.items()}
