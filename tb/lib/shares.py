# SPDX-License-Identifier: Apache-2.0
"""A test with many equal cases, in shares: `make test` runs the first share, `make test-all` all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pytest


@dataclass(frozen=True)
class Share:
    """Every `count`-th case, from number `number` on."""

    number: int
    count: int

    def of(self, cases: Sequence) -> Sequence:
        return cases[self.number :: self.count]

    def __str__(self) -> str:
        return f"{self.number + 1} of {self.count}"


def shares(count: int) -> pytest.MarkDecorator:
    """Gives a test an argument `share`."""
    every = [Share(number, count) for number in range(count)]
    rest = [pytest.param(share, id=str(share), marks=pytest.mark.slow) for share in every[1:]]
    return pytest.mark.parametrize("share", [pytest.param(every[0], id=str(every[0])), *rest])


def first(cases: Sequence, count: int = 1) -> list:
    """The cases of a parametrised test, of which `make test` runs the first ones."""
    return [*cases[:count], *(pytest.param(case, marks=pytest.mark.slow) for case in cases[count:])]
