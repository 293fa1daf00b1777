# SPDX-License-Identifier: Apache-2.0
"""The picture of the panel in the README is how the panel looks, and takes nothing from the network."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from tools import panel_picture


def test_the_picture_is_the_panel():
    text = panel_picture.picture()
    assert text == panel_picture.PICTURE.read_text(), "run `make pictures`"
    ElementTree.fromstring(text)
    for shown in ("running", "unit&#160;1:&#160;exception", "t&#160;trip"):
        assert shown in text
    assert not re.search(r"@font-face|url\((?!#)|href", text)
