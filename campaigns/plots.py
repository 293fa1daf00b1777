# SPDX-License-Identifier: Apache-2.0
"""The one style of the pictures that matplotlib draws into docs/pictures."""

from __future__ import annotations

import matplotlib
from matplotlib.figure import Figure

from rtl.sources import ROOT

PICTURES = ROOT / "docs/pictures"
STYLE = {
    "svg.hashsalt": "rtu2fc",  # the same numbers make the same file
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def use_style() -> None:
    """Before the first figure is made."""
    matplotlib.use("svg")
    matplotlib.rcParams.update(STYLE)


def save(name: str, figure: Figure, description: str | None = None) -> None:
    """As docs/pictures/NAME.svg; `description` stands in the file's metadata."""
    PICTURES.mkdir(exist_ok=True)
    about = {"Date": None} | ({"Description": description} if description else {})
    figure.savefig(PICTURES / f"{name}.svg", metadata=about, bbox_inches="tight")
