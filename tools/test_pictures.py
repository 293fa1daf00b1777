# SPDX-License-Identifier: Apache-2.0
"""The pictures of docs/pictures and the page of switch positions show what the tables say.

They are edited as they are. The terminals and wires in them are typed from the manual, as in test_manual.py.
"""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

import pytest

from constraints.boards import Board, boards
from regs.generated.card_tables import EXTENDED_FORMATS, EXTENDED_RATES, FORMATS, RATES, Format
from rtl.sources import ROOT
from sim.card.test_panel import play, until
from tools import chromium

PICTURES = ROOT / "docs/pictures"
PAGE = ROOT / "docs/switches.html"
PAGES = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
# 9600 bit/s, no parity, address 1, termination.
USUAL_RATE, USUAL_ADDRESS = "111110000", "100000001"


def parts(picture: str, kind: str) -> list[ElementTree.Element]:
    return list(ElementTree.parse(PICTURES / f"{picture}.svg").iter(f"{{http://www.w3.org/2000/svg}}{kind}"))


def words(picture: str) -> list[str]:
    return ["".join(text.itertext()) for text in parts(picture, "text")]


def levers(picture: str) -> list[str]:
    """The positions of each block of switches, first switch first; 1 = ON, the upper half of its slot."""
    blocks, middle = [""], 0.0
    for part in parts(picture, "rect"):
        y, kind = float(part.get("y")), part.get("class")
        if kind == "part":
            blocks.append("")
        elif kind == "slot":
            middle = y + float(part.get("height")) / 2
        elif kind == "lever":
            blocks[-1] += "01"[y < middle]
    return [block for block in blocks if block]


def test_every_picture_is_in_a_page():
    shown = set(re.findall(r"pictures/([\w-]+)\.svg\)", "".join(page.read_text() for page in PAGES)))
    assert {path.stem for path in PICTURES.glob("*.svg")} <= shown


def test_the_levers_are_where_the_tables_have_them():
    rates = sorted(RATES.items(), key=lambda row: (row[1].baud, row[0]))
    shown = levers("switches")
    assert shown == [*(on for on, _ in rates), *FORMATS, USUAL_RATE, USUAL_ADDRESS]
    said = words("switches")
    assert [word.removesuffix(" (usual)") for word in said[7:15]] == [str(rate.baud) for _, rate in rates]
    forms = [f"{form.parity} ({short(form)})" for form in FORMATS.values()]
    assert [word for word in said if word.endswith(")")][1:] == forms
    assert levers("card") == [USUAL_RATE, USUAL_ADDRESS]


def short(form: Format) -> str:
    return f"8{form.parity[0].upper()}{form.stop_bits}"


def place(entry: Board, port: str) -> tuple[str, str]:
    """Connector and pin of a port, which the remark of the pin file names."""
    found = next(pin for pin in entry.pins() if re.fullmatch(rf"{re.escape(port)}(_n)?", pin.port))
    connector, _, number = found.remark.partition(", pin ")
    return connector, number or found.site


@pytest.mark.parametrize("name", ["icebreaker", "tang-nano-9k"])
def test_the_wires_of_a_board_go_to_the_pins_of_its_pin_file(name):
    entry, said = boards()[name], words(name)
    ends = [said[at - 1] for at, word in enumerate(said) if word in ("RXD", "TXD", "DE")]
    wires = [f"{line}_{wire}" for line in ("modbus", "drive") for wire in ("rx", "tx", "de")]
    assert ends == [" ".join(place(entry, wire)) for wire in wires]
    placed = {pin.port for pin in entry.pins()}
    on = []
    for kind, usual in (("baud", USUAL_RATE), ("addr", USUAL_ADDRESS)):
        wired = [port for n in range(1, 10) if (port := f"sw_{kind}_n[{n}]") in placed]
        heading = {"baud": "Baud", "addr": "Address"}[kind]
        at = said.index(f"{heading}: to GND. Below: pins of {place(entry, wired[0])[0]}") + 1
        numbers = [str(n + 1) for n in range(len(wired))]
        assert said[at : at + 2 * len(wired)] == [*numbers, *(place(entry, port)[1] for port in wired)]
        on.append(usual[: len(wired)])
    assert levers(name) == on
    for title, line in (("network", "modbus"), ("drive", "drive")):
        leds = {colour: place(entry, f"led_{line}_{colour}") for colour in ("red", "green")}
        where = [
            f"{colour} {one if one.startswith(('LED', 'on the')) else f'{one} {number}'}"
            for colour, (one, number) in leds.items()
        ]
        assert f"{title}: {', '.join(where)}" in said


def test_the_panel_says_what_its_picture_shows():
    """A screenshot: `App.export_screenshot` of Textual. The LEDs are lit at this time."""
    _, _, said = play([entry for entry in until(7.2) if entry.get("state", 0) <= 6.4])
    shown = " ".join(words("panel")).replace("\N{NO-BREAK SPACE}", " ").split()
    for part in ("title", "card", "drive", "lines"):
        assert set(said[part].split()) <= set(shown), part
    assert not re.search(r"@font-face|url\((?!#)|href", (PICTURES / "panel.svg").read_text())


# ---------------------------------------------------------------- the page of switch positions


def test_the_page_has_the_tables_of_the_card():
    found = json.loads(re.search("^const tables = (.*);$", PAGE.read_text(), re.MULTILINE)[1])
    for kind, rates, formats in (
        ("usual", RATES, FORMATS),
        ("extended", EXTENDED_RATES, EXTENDED_FORMATS),
    ):
        assert found[kind]["rates"] == {on: rate.baud for on, rate in rates.items()}
        shown = {on: f"{form.parity}, {short(form)}" for on, form in formats.items()}
        assert found[kind]["formats"] == shown


CLICKED = """
const at = id => document.getElementById(id), seen = {};
const on = id => [...at(id).children].map(b => b.getAttribute("aria-pressed") == "true" ? "1" : "0").join("");
const pick = (id, text) => {
  for (const o of at(id).options) o.selected = o.text == text;
  at(id).onchange(); };
for (const extended of [false, true]) {
  at("extended").checked = extended; at("extended").onchange();
  for (const name of [...at("rate").options].map(o => o.text)) {
    pick("rate", name); seen[`${extended} ${name}`] = on("baud").slice(0, 3); }
  for (const name of [...at("format").options].map(o => o.text)) {
    pick("format", name); seen[`${extended} ${name}`] = on("baud").slice(3, 5); }
}
at("extended").checked = false; at("extended").onchange();
at("address").value = 85; at("address").oninput();
seen.address = on("unit"); seen.says = at("says").value;
at("unit").children[0].click();
seen.clicked = at("says").value;
for (let i = 0; i < 9; i++) if (on("baud")[i] != "111001111"[i]) at("baud").children[i].click();
seen.test = at("warning").textContent;
seen.wide = document.documentElement.scrollWidth;
return seen;
"""


@pytest.mark.nightly("pages")
@pytest.mark.rule("LINE-2", "LINE-3", "LINE-7")
def test_the_page_of_switch_positions(tmp_path):
    """Every rate and format that one chooses shows switches of the rules, and clicks are read back."""
    seen = chromium.evaluate(PAGE.read_text(), CLICKED, tmp_path, width=390).found
    for kind, rates in (("false", RATES), ("true", EXTENDED_RATES)):
        for rate in {rate.baud for rate in rates.values()}:
            assert rates[seen[f"{kind} {rate} bit/s"]].baud == rate
    for form in ("none, 8N2", "odd, 8O1", "even, 8E1"):
        assert FORMATS[seen[f"false {form}"]].parity == form.split(",")[0]
    assert seen["address"] == "101010101" and ", address 85, termination ON" in seen["says"]
    assert ", address 84," in seen["clicked"]
    assert "loop-back test" in seen["test"]
    assert seen["wide"] <= 500  # Chromium's narrowest window; a phone's page is no wider than its column
