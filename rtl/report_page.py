# SPDX-License-Identifier: Apache-2.0
"""Writes the page of a command that measures."""

from __future__ import annotations

from pathlib import Path


def write_page(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
