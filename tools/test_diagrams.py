# SPDX-License-Identifier: Apache-2.0
"""The timing diagrams: each text in its place, and a moved edge changes the picture."""

from __future__ import annotations

import json
import re

import pytest

from rtl.sources import ROOT
from sim.view.wave_file import WaveFile
from tb.lib.fast_card import FastCard
from tools import chromium, diagrams
from tools.diagrams import BIT, DRAWINGS, svg

pytestmark = pytest.mark.nightly("pages")


@pytest.fixture(scope="module")
def pictures() -> dict[str, str]:
    return {name: svg(draw()) for name, draw in DRAWINGS.items()}


@pytest.mark.parametrize("drawing", [diagrams.commit])
def test_the_same_run_gives_the_same_picture_with_any_seed(monkeypatch, drawing):
    monkeypatch.setenv("COCOTB_RANDOM_SEED", "1")
    before = svg(drawing())
    monkeypatch.setenv("COCOTB_RANDOM_SEED", "2")
    assert svg(drawing()) == before


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


@pytest.mark.parametrize(
    ("name", "found", "instead", "wrong"),
    [
        (
            "start-motor",
            ' textLength="[0-9.]+"| style="font-size:[0-9.]+px"',
            "",
            "'01 0F 00 00 00 20 04 7C 04 99 19 37 43' leaves its block",
        ),
        ("start-motor", ' textLength="[0-9.]+"|font-size:12px;', "", r"'turnaround [0-9.]+ ms' is struck by"),
        ("commit", 'x="[0-9.]+"([^>]*>The reply is ready)', r'x="700"\1', "leaves the picture"),
        ("commit", 'text-anchor="end"', "", "lies on"),
        ("commit", 'x="-10"', 'x="-60"', "'reply queued' lies on a bracket"),
    ],
)
def test_misplaced_text_is_found(pictures, name, found, instead, wrong, tmp_path):
    picture, times = re.subn(found, instead, pictures[name])
    assert times
    assert any(re.search(wrong, one) for one in misplaced({name: picture}, tmp_path, ("DejaVu Sans",)))


def test_pages_show_every_diagram():
    pages = "".join((ROOT / f"docs/guide/{page}.md").read_text() for page in ("timing", "integration"))
    shown = re.findall(r"\(\.\./\.\./build/diagrams/([\w-]+)\.svg\)", pages)
    assert shown == list(DRAWINGS)


@pytest.mark.rule("FRAME-6")
@pytest.mark.parametrize("figure", ["candidate after the request", "commit after the request"])
def test_late_strobe_changes_picture_and_figure(figure, monkeypatch):
    """The figures come from the recording: a late strobe is late in the picture."""
    right = diagrams.commit()
    recorded = FastCard.recorded_so_far

    def late(card):
        return {
            pin: [(at + 2 * BIT * (pin == figure.split()[0]), level) for at, level in edges]
            for pin, edges in recorded(card).items()
        }

    monkeypatch.setattr(FastCard, "recorded_so_far", late)
    wrong = diagrams.commit()
    assert svg(right) != svg(wrong)
    changed = float(wrong.figures[figure].split()[0]) - float(right.figures[figure].split()[0])
    assert changed == pytest.approx(2, abs=0.02)


@pytest.mark.parametrize(
    ("name", "signal", "figure"),
    [
        ("network-port", "network_i.candidate", "candidate after the request"),
        ("network-port", "network_i.reply_start", "first bit after reply_start"),
        ("drive-port", "drive_i.good", "good before the end of the reply"),
    ],
)
def test_late_signal_of_a_port_changes_picture_and_figure(name, signal, figure, monkeypatch):
    right = DRAWINGS[name]()
    found = WaveFile.changes

    def late(file, wanted):
        moved = 2 * BIT * 1e-12 if wanted == signal else 0
        # The times of the file are two a clock, in ns.
        return ((when + moved * 4e-3, value) for when, value in found(file, wanted))

    monkeypatch.setattr(WaveFile, "changes", late)
    wrong = DRAWINGS[name]()
    assert svg(right) != svg(wrong)
    moved = float(wrong.figures[figure].split()[0]) - float(right.figures[figure].split()[0])
    assert abs(moved) == pytest.approx(2, abs=0.1)
