# SPDX-License-Identifier: Apache-2.0
"""Parts of a test that run at night only: further cases, the second simulator of a long bench."""

from __future__ import annotations

from collections.abc import Sequence

import pytest


def first(cases: Sequence, count: int = 1) -> list:
    """The cases of a parametrised test, of which `make test` runs the first ones."""
    return [*cases[:count], *(pytest.param(case, marks=pytest.mark.nightly) for case in cases[count:])]


def both(simulator: str, other: str) -> list:
    """A bench on one simulator, and at night on the other. CI leaves out the tests named `at-night`."""
    return [simulator, pytest.param(other, marks=pytest.mark.nightly, id=f"{other}-at-night")]


# Icarus takes too long for these benches; the others run on it, and at night on Verilator.
on_verilator = pytest.mark.parametrize("sim", both("verilator", "icarus"))
