# SPDX-License-Identifier: Apache-2.0
"""The timing diagrams are drawn, and pages show each."""

from __future__ import annotations

import re

import pytest

from rtl.sources import ROOT
from tools.diagrams import DRAWINGS, svg


@pytest.mark.nightly
def test_pages_show_every_diagram():
    pages = "".join((ROOT / f"docs/guide/{page}.md").read_text() for page in ("timing", "integration"))
    shown = re.findall(r"\(\.\./\.\./build/diagrams/([\w-]+)\.svg\)", pages)
    assert shown == list(DRAWINGS)
    assert all("</svg>" in svg(draw()) for draw in DRAWINGS.values())
