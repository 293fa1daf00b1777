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


BARE = (
    *("2030", "6,104", "0.25", "9/16", "¼", "15th", "1.1e-4", "5 of them", "14 to 15", "600 s", "3-pin"),
    *("four of them", "Seven", "twenty-five", "a hundred", "a dozen", "two modules", "Three old functions"),
)


@pytest.mark.parametrize("figure", BARE)
def test_a_number_without_a_unit_is_watched(figure):
    lines = found(f"{TEXT}It is {figure}, | {figure} | and **{figure}**.")
    assert len(lines) in (3, 6) and all("is in no sentence" in line for line in lines)


NAMES = (
    *("coils 1-32", "Bit 10", "functions 3, 4 and 16", "function 0F", "registers 40001 to 40003", "switch 9"),
    *(
        "VLT 2800, 6000 HVAC, 8000 AQUA",
        "STRICT_T15 = 5",
        "SAFE-4",
        "EIA-485",
        "CRC-16",
        "8E1",
        "t3.5",
        "p19",
    ),
    *("version 1.20.3", "2026-11-22", "99h", "047Ch", "a 00 byte", "as 0 or 1", "`99 of 98`", "``9 ` 9``"),
    *(
        "[a link](9.md#99)",
        '<a id="9"></a>',
        "https://a.org/99",
        "two flip-flops",
        "four-byte",
        "seeds 7101, 7103",
    ),
)


@pytest.mark.parametrize("name", NAMES)
def test_a_number_that_names_a_thing_or_a_value_is_no_figure(name):
    assert found(f"{TEXT}It is {name}.") == []


def test_the_number_of_an_item_or_a_step_is_no_figure():
    assert found(f"{TEXT}\n3. The item.\n| 17 | the step |\n") == []
    (line,) = found(f"{TEXT}\n| 170 | flips that were lost |\n")
    assert "'170' is in no sentence" in line


LOOSE = ("12 V", "pin 20 or 21", "| 37 | GND |", "four of them", "the 16th")


@pytest.mark.parametrize("number", LOOSE)
def test_a_page_that_names_many_numbers_is_loose(number):
    said = facts.mistakes({PAGE: f"It is {number}."}, [], ["docs/p*.md"])
    assert said == [] and facts.mistakes({PAGE: "It is 20 or 12 V."}, [], ["docs/guide/*"]) != []


WATCHED = (
    "9/16 bit",
    "¼ bit",
    "7 modules",
    "3 more beats",
    "four rows",
    "two drives",
    "5 ms",
    "6 of 8 frames",
)


@pytest.mark.parametrize("figure", WATCHED)
def test_a_loose_page_has_units_fractions_and_counts(figure):
    (line,) = facts.mistakes({PAGE: f"It is {figure}."}, [], [PAGE])
    assert f"{figure.removesuffix(' bit') if '/' in figure or '¼' in figure else figure}' is in no" in line


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ({"says": "{:letters} cases", "find": r"^long = ([\d.]+)", "scale": 2}, "seven cases"),
        ({"says": "{:Letters} cases", "find": r"^long = ([\d.]+)", "scale": 2}, "Seven cases"),
        ({"says": "{:letters} cases", "find": r"^long = ([\d.]+)", "scale": 20}, "70 cases"),
        ({"says": "{:letters} keys", "find": r"^\w+ = ", "count": True}, "five keys"),
        (
            {"says": "{} or {:letters}", "find": r"^\w+ = ", "count": True, "reckon": ["a * 2", "a - 1"]},
            "10 or four",
        ),
        (
            {"says": "{} of {}", "find": r"^baud = (\d+)\nfast = ([\d_]+)", "reckon": ["b - a", "b"]},
            "9600 of 19200",
        ),
    ],
)
def test_a_count_and_a_reckoned_figure(entry, text):
    entries = [*TIED, entry | {"from": "report"}]
    assert found(f"{TEXT}It has {text}.", entries) == []
    for other in ("99 cases", "six keys", "11 or four", "10 or five", "9601 of 19200", "eight cases"):
        assert any("does not say" in line for line in found(f"{TEXT}It has {other}.", entries))


def test_each_match_of_a_source_is_said():
    entry = {"says": "rate {}", "from": "report", "find": r"^(?:baud|fast) = ([\d_]+)", "each": True}
    entries, both = [*TIED, entry], f"{TEXT}Rate: rate 9600, rate 19200."
    assert found(both, entries) == []
    (line,) = found(f"{TEXT}Rate: rate 9600.", entries)
    assert "does not say 'rate 19200'" in line
    assert len(found(both.replace("rate 9600", "rate 9601"), entries)) == 2


def test_the_expressions_are_as_many_as_the_figures():
    entry = {"says": "{} of {}", "from": "report", "find": r"^baud = (\d+)", "reckon": ["a"]}
    (line,) = found(entries=[*TIED, entry])
    assert "2 {} in the sentence, 1 expressions in `reckon`" in line


@pytest.mark.parametrize(("state", "lines"), [("not yet released", 1), ("2026-12-01", 0)])
def test_the_list_of_changes_is_read_up_to_its_release(state, lines, tmp_path):
    path = tmp_path / "CHANGELOG.md"
    path.write_text(
        f"# Changelog\n\n## [0.2.0] - {state}\n\nIt has 7 tests.\n\n## History\n\nIt had 8 tests.\n"
    )
    assert len(facts.mistakes({PAGE: facts.written(path)}, [])) == lines


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
    assert {facts.ROOT / "sim/card/README.md", facts.ROOT / "CHANGELOG.md"} <= set(facts.pages())
