# SPDX-License-Identifier: Apache-2.0
"""The picture of the panel in the README is how the panel looks, and takes nothing from the network."""

from __future__ import annotations

import re
import shutil
import subprocess
from xml.etree import ElementTree

from matplotlib.image import imread

from tools import panel_picture


def test_the_picture_is_the_panel():
    text = panel_picture.picture()
    assert text == panel_picture.PICTURE.read_text(), "run `make pictures`"
    ElementTree.fromstring(text)
    words = re.sub(r"</text>\s*<text[^>]*>", " ", text)
    for shown in ("running", "unit 1: exception", "t trip"):
        assert shown in words
    # A viewer that drops leading blanks still shows each word at its column, and no line is cut.
    assert not re.search(r"<text[^>]*-r\d[^>]*>[^<]*(?:&#160;|\s)", text)
    assert "…" not in text
    assert not re.search(r"@font-face|url\((?!#)|href", text)


def test_librsvg_keeps_the_blanks(tmp_path):
    """The numbers of the switches stand below their levers: nothing is left of them.

    librsvg is no tool of the project: without it the words' own places, above, have to do.
    """
    if not shutil.which("rsvg-convert"):
        return
    png = tmp_path / "panel.png"
    subprocess.run(["rsvg-convert", "-w", "994", panel_picture.PICTURE, "-o", png], check=True)
    below_rate = imread(png)[198:212, :, :3].max(axis=(0, 2))
    assert (below_rate[12:75] < 0.2).all() and (below_rate[80:100] > 0.4).any()
