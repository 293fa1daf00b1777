# SPDX-License-Identifier: Apache-2.0
"""Every picture is in a page; the page of switch positions."""

from __future__ import annotations

import re

import pytest

from regs.generated.card_tables import EXTENDED_RATES, FORMATS, RATES
from rtl.sources import ROOT
from tools import chromium, pictures

pytestmark = pytest.mark.nightly("pages")
PAGES = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]


def test_every_picture_is_in_a_page():
    shown = set(re.findall(r"pictures/([\w-]+)\.svg\)", "".join(page.read_text() for page in PAGES)))
    there = {path.stem for path in pictures.PICTURES.glob("*.svg")}
    assert set(pictures.DRAWINGS) < there <= shown


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


@pytest.mark.rule("LINE-2", "LINE-3", "LINE-7")
def test_the_page_of_switch_positions(tmp_path):
    """Every rate and format that one chooses shows switches of the rules, and clicks are read back."""
    seen = chromium.evaluate(pictures.PAGE.read_text(), CLICKED, tmp_path, width=390).found
    for kind, rates in (("false", RATES), ("true", EXTENDED_RATES)):
        for rate in {rate.baud for rate in rates.values()}:
            assert rates[seen[f"{kind} {rate} bit/s"]].baud == rate
    for form in ("none, 8N2", "odd, 8O1", "even, 8E1"):
        assert FORMATS[seen[f"false {form}"]].parity == form.split(",")[0]
    assert seen["address"] == "101010101" and ", address 85, termination ON" in seen["says"]
    assert ", address 84," in seen["clicked"]
    assert "loop-back test" in seen["test"]
    assert seen["wide"] <= 500  # Chromium's narrowest window; a phone's page is no wider than its column
