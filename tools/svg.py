# SPDX-License-Identifier: Apache-2.0
"""A small drawing of boxes, wires and words as SVG, for a phone, in light and in dark.

The words are measured in wide fonts. A word that leaves the
picture or lies on another one is an error, so no picture with such a word is written.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from html import escape
from pathlib import Path

import matplotlib
from fontTools.ttLib import TTFont

FONTS = Path(matplotlib.get_data_path()) / "fonts/ttf"
# Dark ink on a light ground, and what is otherwise on a dark page.
STYLE = """
text{font-family:"DejaVu Sans",Arial,Helvetica,sans-serif;font-size:13px;fill:#1f2328}
.b{font-weight:bold}.s{font-size:12px}.m{fill:#57606a}.w,.inv{fill:#fff}
.ground{fill:#fff;stroke:#d0d7de}.box{fill:#f6f8fa;stroke:#57606a;stroke-width:1.5}
.part{fill:#dbeafe;stroke:#57606a;stroke-width:1.5}.slot{fill:#fff;stroke:#57606a}.lever{fill:#0550ae}
.pin{fill:#fff;stroke:#1f2328;stroke-width:1.5}.first{fill:#1f2328}
.wire{fill:none;stroke-width:3}.thin{fill:none;stroke:#57606a;stroke-width:1.5}.dash{stroke-dasharray:5 4}
.red{fill:#cf222e}.green{fill:#1a7f37}.orange{fill:#bc4c00}.off{fill:#fff;stroke:#57606a}
.w1{stroke:#cf222e}.w2{stroke:#0550ae}.w3{stroke:#57606a}.w4{stroke:#bc4c00}.w5{stroke:#1a7f37}
"""
DARK = """
text{fill:#e6edf3}.m{fill:#9da7b3}.w{fill:#fff}.inv{fill:#0d1117}
.ground{fill:#0d1117;stroke:#30363d}.box{fill:#161b22;stroke:#9da7b3}.part{fill:#10243e;stroke:#9da7b3}
.slot{fill:#0d1117;stroke:#9da7b3}.lever{fill:#79c0ff}.pin{fill:#0d1117;stroke:#e6edf3}.first{fill:#e6edf3}
.thin{stroke:#9da7b3}.off{fill:#0d1117;stroke:#9da7b3}
.w1{stroke:#ff7b72}.w2{stroke:#79c0ff}.w3{stroke:#9da7b3}.w4{stroke:#ffa657}.w5{stroke:#56d364}
"""
RULE = re.compile(r"([^{}]+)\{[^{}]*\}")
WIDTH = 420
LINE = 200  # characters of the file: some parts a line
SIZES = {"s": 12.0, "": 13.0}
Box = tuple[float, float, float, float]


class PictureError(Exception):
    """A word without room; the message is one line."""


@cache
def font(bold: bool) -> tuple[dict, dict, int]:
    face = TTFont(FONTS / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"))
    return face.getBestCmap(), face["hmtx"].metrics, face["head"].unitsPerEm


def width_of(text: str, kind: str = "") -> float:
    """In pixels, in the wider of DejaVu Sans and a typewriter's font, which some readers set."""
    names, widths, units = font("b" in kind.split())
    size = SIZES["s" if "s" in kind.split() else ""]
    return max(sum(widths[names[ord(letter)]][0] for letter in text) / units, 0.602 * len(text)) * size


def in_lines(parts: Iterable[str]) -> str:
    """The parts, some a line."""
    lines = [""]
    for part in parts:
        if lines[-1] and len(lines[-1]) + len(part) > LINE:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def meet(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


class Picture:
    """`title` says to a reader who sees no picture what it shows."""

    def __init__(self, title: str, height: int) -> None:
        self.title, self.height = title, height
        self.parts: list[str] = []
        self.words: list[tuple[str, Box]] = []

    def add(self, name: str, kind: str, **attributes: object) -> None:
        given = " ".join(f'{key}="{value}"' for key, value in attributes.items())
        self.parts.append(f'<{name} class="{kind}" {given}/>')

    def box(self, x: float, y: float, w: float, h: float, kind: str = "box", round_: int = 4) -> None:
        self.add("rect", kind, x=x, y=y, width=w, height=h, rx=round_)

    def dot(self, x: float, y: float, r: float, kind: str) -> None:
        self.add("circle", kind, cx=x, cy=y, r=r)

    def line(self, kind: str, *points: tuple[float, float]) -> None:
        self.add("polyline", kind, points=" ".join(f"{x},{y}" for x, y in points))

    def arrow(self, kind: str, *points: tuple[float, float]) -> None:
        """A line with a head at its end; the last stretch is level or upright."""
        (ax, ay), (x, y) = points[-2:]
        self.line(kind, *points)
        dx, dy = (x > ax) - (x < ax), (y > ay) - (y < ay)
        left = (x - 8 * dx + 5 * dy, y - 8 * dy + 5 * dx)
        right = (x - 8 * dx - 5 * dy, y - 8 * dy - 5 * dx)
        self.line(kind.replace("dash", ""), left, (x, y), right)

    def text(self, x: float, y: float, text: str, kind: str = "", anchor: str = "start") -> None:
        """`y` is the middle of the line."""
        wide, tall = width_of(text, kind), SIZES["s" if "s" in kind.split() else ""]
        left = x - {"start": 0, "middle": wide / 2, "end": wide}[anchor]
        place = (left, y - tall * 0.55, left + wide, y + tall * 0.55)
        if not (place[0] >= 4 and place[2] <= WIDTH - 4 and place[1] >= 2 and place[3] <= self.height - 2):
            raise PictureError(f"{self.title}: '{text}' leaves the picture")
        for other, there in self.words:
            if meet(place, there):
                raise PictureError(f"{self.title}: '{text}' lies on '{other}'")
        self.words.append((text, place))
        self.parts.append(
            f'<text class="{kind}" x="{x}" y="{y + tall * 0.36:.1f}" text-anchor="{anchor}">'
            f"{escape(text)}</text>"
        )

    def lines(self, x: float, y: float, text: str, kind: str = "", anchor: str = "start") -> None:
        """Lines of text, parted by line ends; `y` is the middle of the first."""
        for number, each in enumerate(text.split("\n")):
            self.text(x, y + 17 * number, each, kind, anchor)

    def rules(self, style: str) -> str:
        """The rules of a style that something in this picture has."""
        has = {"text", ".ground"}
        for kinds in re.findall('class="([^"]*)"', "".join(self.parts)):
            has |= {f".{kind}" for kind in kinds.split()}
        found = RULE.finditer(style.replace("\n", ""))
        return in_lines(rule[0] for rule in found if has & set(rule[1].split(",")))

    def svg(self) -> str:
        head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{self.height}" '
        head += f'viewBox="0 0 {WIDTH} {self.height}" role="img">'
        ground = (
            f'<rect class="ground" x="0.5" y="0.5" width="{WIDTH - 1}" height="{self.height - 1}" rx="8"/>'
        )
        title = f"<title>{escape(self.title)}</title>"
        dark = f"@media(prefers-color-scheme:dark){{\n{self.rules(DARK)}}}"
        style = f"<style>\n{self.rules(STYLE)}\n{dark}</style>"
        return "\n".join([head, title, style, ground, in_lines(self.parts), "</svg>", ""])
