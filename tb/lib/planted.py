# SPDX-License-Identifier: Apache-2.0
"""The bugs of tb/planted.toml."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from rtl.sources import ROOT

TABLE = ROOT / "tb/planted.toml"
BY_FUZZER = {"fuzz": ""}  # where a row names nobody


class PlantError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Bug:
    """A row of the table. `rules`: those that it breaks. `seen`: who must find it."""

    name: str
    rules: list[str]
    what: str
    file: str
    old: str
    new: str
    seen: dict[str, str]
    then: str = ""

    @property
    def in_firmware(self) -> bool:
        return self.file.startswith("sw/")

    def place(self, root: Path = ROOT) -> tuple[int, int]:
        """Start and end of the place in its file, in characters."""
        text = (root / self.file).read_text()
        if text.count(self.old) != 1:
            raise PlantError(f"{self.name}: {text.count(self.old)} places in {self.file} instead of one")
        return text.index(self.old), text.index(self.old) + len(self.old)

    def planted(self, root: Path = ROOT) -> str:
        """The text of its file with the bug."""
        self.place(root)
        return (root / self.file).read_text().replace(self.old, self.new)


def _bug(
    name: str, breaks: str, file: str, change: list[str], then: str = "", seen: dict[str, str] = BY_FUZZER
) -> Bug:
    """A row of the table, whose `breaks` is the rules and the mistake."""
    rules, _, what = breaks.partition(": ")
    return Bug(name, rules.split(", "), what, file, *change, seen, then)


def bugs(seen_by: str = "") -> list[Bug]:
    """Those that a test, a proof or a fuzzer must see; all without a name."""
    found = [_bug(name, **row) for name, row in tomllib.loads(TABLE.read_text()).items()]
    return [bug for bug in found if not seen_by or seen_by in bug.seen]
