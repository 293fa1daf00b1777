# SPDX-License-Identifier: Apache-2.0
"""Common style of the pictures that matplotlib draws into build/pictures."""

from __future__ import annotations

import io
import re

import matplotlib
from matplotlib.figure import Figure

from rtl.sources import ROOT

PICTURES = ROOT / "build/pictures"
IN_README = ROOT / "docs/pictures"  # what README.md shows is part of the repository
# A white picture glares on a dark page. `svg:root` leaves the page alone into which a picture is copied.
DARK = "@media(prefers-color-scheme:dark){svg:root{filter:invert(.9) hue-rotate(180deg)}}"
STYLE = {
    "svg.hashsalt": "rtu2fc",  # fixed, so that equal numbers give equal files
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def use_style() -> None:
    """Applies the style; call before the first figure is made."""
    matplotlib.use("svg")
    matplotlib.rcParams.update(STYLE)


def save(name: str, figure: Figure, description: str | None = None) -> None:
    """Saves as build/pictures/NAME.svg; `description` goes into the file's metadata."""
    folder = IN_README if (IN_README / f"{name}.svg").exists() else PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    about = {"Date": None} | ({"Description": description} if description else {})
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata=about, bbox_inches="tight")
    (folder / f"{name}.svg").write_text(for_dark_pages(drawn.getvalue()))


def for_dark_pages(picture: str) -> str:
    """With the style for them; a path is one line."""
    picture = re.sub(r' d="[^"]*"', lambda found: found[0].replace(" \n", " ").replace("\n", ""), picture)
    return re.sub(r"<style[^>]*>", lambda found: found[0] + DARK, picture, count=1)
