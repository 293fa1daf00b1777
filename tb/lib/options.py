# SPDX-License-Identifier: Apache-2.0
"""Argument types for command line options; argparse rejects a bad value with exit 2."""

from __future__ import annotations

import argparse
from collections.abc import Callable


def at_least(least: int) -> Callable[[str], int]:
    """Argument type: a whole number of `least` or more."""

    def whole(text: str) -> int:
        if not text.removeprefix("-").isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"'{text}' is no whole number of {least} or more")
        return int(text)

    return whole
