# SPDX-License-Identifier: Apache-2.0
"""A test over the rows of a table names every row that fails."""

from __future__ import annotations

import pytest

from tb.lib.rows import each_row


class Counter:
    count = 0
    fresh = classmethod(lambda cls: cls())


@each_row("more", [1, 2])
@each_row(("start", "end"), [(0, 1), (1, 2), (1, 3)])
def check(counter: Counter, start: int, end: int, more: int) -> None:
    counter.count += start + more
    assert counter.count == end


def test_every_bad_row_is_named_and_no_other() -> None:
    with pytest.raises(AssertionError, match="2 of 2 rows fail") as found:
        check(counter=Counter())
    first, second = str(found.value).split("more = 2: 2 of 3 rows fail\n")
    assert "\nstart = 1, end = 3: " in first and first.count("start") == 1
    assert "start = 0, end = 1: " in second and "\nstart = 1, end = 2: " in second
    assert second.count("start") == 2


@each_row("value", [1, 2])
def test_pytest_gives_the_rest(value: int, tmp_path) -> None:
    assert value and tmp_path.exists()
