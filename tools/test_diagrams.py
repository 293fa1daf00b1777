# SPDX-License-Identifier: Apache-2.0
"""The timing diagrams: each text in its place, and a moved edge changes the picture."""

from __future__ import annotations

import json
import re

import pytest

from rtl.sources import ROOT
from tools import chromium
from tools.diagrams import DRAWINGS, svg

pytestmark = pytest.mark.nightly("pages")


@pytest.fixture(scope="module")
def pictures() -> dict[str, str]:
    return {name: svg(draw()) for name, draw in DRAWINGS.items()}


# Checks every picture in every font: no text leaves the picture or its block, lies on another text or on a
# group's bracket, or is wider than the white ground over an arrow's line.
SCRIPT = """
const wrong = [];
const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
for (const [name, text] of Object.entries(PICTURES)) for (const font of FONTS) {
  const host = document.createElement("div");
  document.body.append(host);
  const shadow = host.attachShadow({mode: "open"});
  shadow.innerHTML = text + (font && `<style>text{font-family:${font} !important}</style>`);
  const say = (what, text) => wrong.push(`${name}, ${font || "as it is"}: '${text.trim()}' ${what}`);
  const box = (element) => element.getBoundingClientRect();
  const picture = box(shadow.querySelector("svg"));
  const words = [...shadow.querySelectorAll("text")].filter((element) => element.textContent.trim());
  const seen = words.map(box);
  const lines = [...shadow.querySelectorAll("path[id^=group_]")].map(box);
  words.forEach((element, i) => {
    const said = element.textContent, at = seen[i];
    if (!(at.width > 2 && at.left > picture.left + 2 && at.right < picture.right - 2
          && at.top > picture.top && at.bottom < picture.bottom)) say("leaves the picture", said);
    if (lines.some((line) => meet(at, line))) say("lies on a bracket", said);
    for (let j = 0; j < i; j++)
      if (meet(at, seen[j])) say(`lies on '${words[j].textContent.trim()}'`, said);
    const white = element.previousElementSibling;
    if (white && white.tagName == "rect" && box(white).width < at.width + 4)
      say("is struck by its arrow", said);
    const fills = [...element.parentNode.querySelectorAll("use[href^='#vvv'], use[*|href^='#vvv']")];
    if (!/^wavelane_draw/.test(element.parentNode.id)) return;
    const inside = fills.map(box).filter((f) => f.right > at.left + 0.5 && f.left < at.right - 0.5);
    const room = inside.reduce((sum, f) => sum + f.width, 0);
    const left = Math.min(...inside.map((f) => f.left)), right = Math.max(...inside.map((f) => f.right));
    if (!(left <= at.left + 0.5 && at.right - 0.5 <= right && Math.abs(room - (right - left)) < 1))
      say("leaves its block", said);
  });
  host.remove();
}
return wrong;
"""
FONTS = ("", "DejaVu Sans", "monospace", "serif", "Nimbus Sans")


def misplaced(pictures: dict[str, str], folder, fonts=FONTS) -> list[str]:
    page = f"<!doctype html><meta charset=utf-8><body><script>const PICTURES = {json.dumps(pictures)}, "
    page += f"FONTS = {json.dumps(fonts)};</script>"
    return chromium.evaluate(page, SCRIPT, folder, width=1600).found


def test_every_text_is_in_its_place_in_every_font(pictures, tmp_path):
    assert misplaced(pictures, tmp_path) == []


def test_pages_show_every_diagram():
    pages = "".join((ROOT / f"docs/guide/{page}.md").read_text() for page in ("timing", "integration"))
    shown = re.findall(r"\(\.\./\.\./build/diagrams/([\w-]+)\.svg\)", pages)
    assert shown == list(DRAWINGS)
