# SPDX-License-Identifier: Apache-2.0
"""What the user sees of an error: one line that names it, advice below, and the exit code."""

from __future__ import annotations

DONE, FAILED, MISUSE, NO_PORT, NO_ANSWER, REFUSED, DIALECT, STOPPED = 0, 1, 2, 3, 4, 5, 6, 130


class Problem(Exception):
    """`advice`: what to try next, a line each."""

    code = MISUSE

    def __init__(self, text: str, *advice: str) -> None:
        super().__init__(text)
        self.advice = advice


class PortError(Problem):
    code = NO_PORT


class NoAnswer(Problem):
    code = NO_ANSWER


class Refused(Problem):
    """An exception; `number` is its code."""

    code = REFUSED

    def __init__(self, text: str, number: int, *advice: str) -> None:
        super().__init__(text, *advice)
        self.number = number


class WrongDialect(Problem):
    code = DIALECT
