# SPDX-License-Identifier: Apache-2.0
"""The rows of a table as one test."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence

import pytest

FAILURES = (Exception, pytest.fail.Exception)


def each_row(names: str | Sequence[str], rows: Iterable) -> Callable[[Callable], Callable]:
    """As `pytest.mark.parametrize`, but one test for rows that take no time. It names every row that fails.

    A fixture with a method `fresh` is made anew for each row.
    """
    alone = isinstance(names, str)
    rows = [{names: row} if alone else dict(zip(names, row, strict=True)) for row in rows]

    def over(test: Callable) -> Callable:
        @functools.wraps(test)
        def every_row(**given: object) -> None:
            __tracebackhide__ = True
            failed: dict[str, BaseException] = {}
            for row in rows:
                anew = {name: value.fresh() for name, value in given.items() if hasattr(value, "fresh")}
                try:
                    test(**given | anew | row)
                except FAILURES as error:
                    failed[", ".join(f"{name} = {value!r}" for name, value in row.items())] = error
            if failed:
                told = [f"\n{row}: {error or type(error).__name__}" for row, error in failed.items()]
                first = next(iter(failed.values()))
                raise AssertionError(f"{len(failed)} of {len(rows)} rows fail{''.join(told)}") from first

        signature = inspect.signature(test)
        others = [one for name, one in signature.parameters.items() if not rows or name not in rows[0]]
        every_row.__signature__ = signature.replace(parameters=others)
        return every_row

    return over
