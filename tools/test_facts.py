# SPDX-License-Identifier: Apache-2.0
"""tools/facts.py notices a figure that drifts from its source, and a figure that nobody tied."""

from __future__ import annotations

import pytest

from tools import facts

PAGE = "docs/" + "page.md"  # in two parts: there is no such page
REPORT = """| frames | 15,000 |
[tiny]
clk_hz = 33_000_000
t35_ms = 4.0104
baud = 9600
fast = 19_200
long = 3.5
"""
TEXT = """# Page

None of 15,000 random
flips did harm. The card runs at 33 MHz, and replies after 0.63 bit (once).

```
300 tests in a listing
```
<!-- generated: table -->
| 300 tests in a table |
<!-- end -->
The table has 300 µs. At 9600 bit/s a bit is 104 µs, and t3.5 is 3.5 characters or 4.01 ms.
Nothing is a figure in [a link](a.md#12-tests) or in 8N1. There bit 6 starts it, and function 10 writes.
"""
TIED = [
    {"says": "None of {} random flips", "from": "report", "find": r"^\| frames \| ([\d,]+) \|"},
    {"says": "at {} MHz", "from": "report", "find": r"clk_hz = ([\d_]+)", "scale": 1e-6},
    {"says": "0.63 bit (once)", "why": "measured once"},
    {"says": r"table has \d+ µs", "tested": "test"},
    {"says": "a bit is {:.0f} µs", "from": "report", "find": r"^baud = (\d+)", "over": 1e6},
    {"says": "or {:.2f} ms", "from": "report", "find": r"^t35_ms = ([\d.]+)"},
]
CONSTANTS = [
    {"says": "{} bit/s", "from": "report", "find": r"^(?:baud|fast) = ([\d_]+)"},
    {"says": "{} characters", "from": "report", "find": r"^long = ([\d.]+)"},
]


def found(text: str = TEXT, entries: list[dict] = TIED, constants: list[dict] = CONSTANTS) -> list[str]:
    return facts.mistakes({PAGE: text}, [*constants, *({"page": PAGE} | entry for entry in entries)])


@pytest.fixture(autouse=True)
def report(monkeypatch):
    monkeypatch.setattr(facts, "source", lambda name: {"report": REPORT, "test": PAGE}[name])


def test_figures_that_equal_their_source_pass():
    assert found() == []


@pytest.mark.parametrize(
    ("was", "now"),
    [
        *[("15,000 random", "13,000 random"), ("33 MHz", "25 MHz"), ("0.63 bit", "0.64 bit")],
        *[("104 µs", "105 µs"), ("4.01 ms", "4.02 ms")],
    ],
)
def test_a_figure_that_drifts_is_named_twice(was, now):
    """Once for the sentence that is gone, once for the figure that is in no sentence."""
    drifted = found(TEXT.replace(was, now))
    assert len(drifted) == 2 and all(line.startswith(f"{PAGE}: ") for line in drifted)
    assert "does not say" in drifted[0] and now.split()[0] in drifted[1]


@pytest.mark.parametrize(("was", "now"), [("9600 bit/s", "4800 bit/s"), ("3.5 characters", "1.5 characters")])
def test_a_constant_that_drifts_is_named(was, now):
    assert any(f"{now!r} is in no sentence" in line for line in found(TEXT.replace(was, now)))
    assert found(f"{TEXT}At {was} and {was}.") == []


@pytest.mark.parametrize("left_out", range(len(TIED)))
def test_a_figure_that_is_not_tied_is_named(left_out):
    (line,) = found(entries=TIED[:left_out] + TIED[left_out + 1 :])
    assert "is in no sentence of docs/facts.toml" in line


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ({"says": "{} flips", "from": "report", "find": "(nothing)"}, "report has no '(nothing)'"),
        (
            {"says": "{} of {}", "from": "report", "find": "frames . ([0-9,]+)"},
            "2 {} in the sentence, 1 groups",
        ),
        (
            {"says": "{} to {}", "from": "report", "find": "(1)(5)", "scale": [1]},
            "2 groups in `find`, 1 in `scale`",
        ),
        ({"says": "{} MHz", "why": "a setting"}, "a sentence with `why` has no {}"),
        ({"says": "Page", "tested": "report"}, f"report does not name {PAGE}"),
    ],
)
def test_an_entry_without_its_source_is_named(entry, reason):
    (line,) = found(entries=[*TIED, entry])
    assert line.startswith("docs/facts.toml: ") and reason in line


def test_a_constant_that_no_page_says_is_named():
    (line,) = found(constants=[*CONSTANTS, {"says": "{} bits", "from": "report", "find": "(15)"}])
    assert line.startswith("no page: does not say '15 bits'")


UNITS = (
    "bit/s, kbit/s, bit, bits, data bits, stop bits, drive bits, bytes, KiB, character, characters, "
    "ms, µs, us, s, seconds, minutes, hours, %"
)


@pytest.mark.parametrize("unit", UNITS.split(", "))
def test_a_unit_is_watched(unit):
    for figure in ("7", "1.7", "7 to 8", "7…8", "7 and 8", "6 of 8"):
        (line,) = found(f"{TEXT}It has {figure} {unit}.")
        assert f"{figure} {unit}' is in no sentence" in line


def test_one_in_so_many_is_watched():
    for what in ("one", "one bit"):
        (line,) = found(f"{TEXT}Of the flips {what} in 2,000 did harm.")
        assert "'2,000' is in no sentence" in line


def test_a_count_in_letters_is_named():
    """It would have no source. Bits and bytes in letters are no results."""
    assert found(f"{TEXT}The word has four bytes.") == []
    for count in ("Seven cases", "twenty-five flips", "ten other clocks"):
        (line,) = found(f"{TEXT}{count}.")
        assert f"{count!r} is a count in letters" in line


def test_a_figure_beside_a_tied_one_needs_its_own_source():
    entries = [*TIED, {"says": "after {} clocks of 8 bits", "from": "report", "find": r"(\d)\.5"}]
    (line,) = found(f"{TEXT}It ends after 3 clocks of 8 bits.", entries)
    assert "'8 bits' is in no sentence" in line


def test_the_figures_of_a_source_may_be_in_another_order():
    entry = {"says": "{1} of {0} bits", "from": "report", "find": r"(\d)\.(5)"}
    assert found(f"{TEXT}It has 5 of 3 bits.", [*TIED, entry]) == []


def test_the_matches_of_a_source_must_agree_or_are_added_up(monkeypatch):
    """One table for each card: the first alone would be the wrong figure."""
    monkeypatch.setattr(facts, "source", lambda _: f"{REPORT}\n| silent | 1,100 |\n| silent | 50 |\n")
    entry = {"says": "{} flips fell silent", "from": "report", "find": r"^\| silent \| ([\d,]+) \|"}
    left = [fact for fact in TIED if "tested" not in fact]
    text = f"{TEXT}In all 1,150 flips fell silent."
    assert any("2 matches" in line for line in found(text, [*left, entry]))
    assert not any("silent" in line for line in found(text, [*left, entry | {"sum": True}]))


def test_the_bits_of_a_word_are_watched():
    (line,) = found(f"{TEXT}It has a 24-bit step.")
    assert "'24-bit' is in no sentence" in line


@pytest.mark.parametrize(
    ("was", "now"),
    [("15,000", "13,000"), ("33_000", "34_368"), ("4.0104", "4.0204"), ("baud = 9600", "baud = 4800")],
)
def test_a_source_that_drifts_is_named(was, now, monkeypatch):
    drifted = {"report": REPORT.replace(was, now), "test": PAGE}
    monkeypatch.setattr(facts, "source", lambda name: drifted[name])
    assert any("does not say" in line for line in found())


@pytest.mark.parametrize(
    ("find", "wrong"), [("long = 3.5", []), ("long = 2.5", ["report has no 'long = 2.5'"])]
)
def test_a_figure_by_arithmetic_follows_its_premise(find, wrong):
    entry = {"says": "7 bits", "why": "twice 3.5", "from": "report", "find": find}
    lines = found(f"{TEXT}It has 7 bits.", [*TIED, entry])
    assert len(lines) == len(wrong) and all(said in line for said, line in zip(wrong, lines, strict=True))


def test_an_entry_of_no_page_is_named():
    gone = {"page": "docs/" + "gone.md", "says": "x", "why": "y"}
    assert facts.mistakes({PAGE: "Nothing."}, [gone]) == [f"docs/facts.toml: no page {gone['page']}"]


def test_every_page_that_people_write_is_read():
    names = {path.name for path in facts.pages()}
    assert {"README.md", "hardening.md", "performance.md", "testing.md", "time-outs.md"} <= names
