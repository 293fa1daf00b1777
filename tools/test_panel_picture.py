# SPDX-License-Identifier: Apache-2.0
"""The picture of the panel in the README is how the panel looks, and takes nothing from the network."""

from __future__ import annotations

import re

from tools import panel_picture


def test_the_picture_is_the_panel():
    text = panel_picture.picture()
    assert text == panel_picture.PICTURE.read_text(), "run `make pictures`"
    # A viewer that drops leading blanks still shows each word at its column, and no line is cut.
    assert not re.search(r"<text[^>]*-r\d[^>]*>[^<]*(?:&#160;|\s)", text) and "…" not in text
    assert not re.search(r"@font-face|url\((?!#)|href", text)
