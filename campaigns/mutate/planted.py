# SPDX-License-Identifier: Apache-2.0
"""The bugs of campaigns/mutate/planted.toml. `make kills` plants each and runs the test that must see it."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

from campaigns.mutate.run import IN_CI, Copy
from rtl.sources import ROOT

TABLE = ROOT / "campaigns/mutate/planted.toml"


class PlantedError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Planted:
    """An entry of planted.toml."""

    name: str
    rules: tuple[str, ...]
    what: str
    file: str
    old: str
    new: str
    before: str
    seen: str
    then: str = ""

    @property
    def in_firmware(self) -> bool:
        return self.file.startswith("sw/")

    @property
    def seen_by(self) -> str:
        """The test's name, or that of its file."""
        return Path(self.seen.split("::")[-1].split("[")[0]).stem

    def place(self, text: str) -> int:
        if text.count(self.old) != 1:
            raise PlantedError(f"{self.name}: {text.count(self.old)} places in {self.file} instead of one")
        return text.index(self.old)

    def failing_test(self) -> str:
        """Plants the bug in a copy of the project; the test that sees it there, and passes without it."""
        copy = Copy(self.name)
        try:
            icarus = ["--sim=icarus"] if "[" not in self.seen and self.seen.startswith("tb/") else []
            command = [*IN_CI, *icarus, self.seen]
            if failed := copy.failing_test(*command):
                raise PlantedError(f"{self.name}: {failed} fails without the bug")
            file = copy.root / self.file
            text = file.read_text()
            self.place(text)
            file.write_text(text.replace(self.old, self.new))
            if self.then:
                made = copy.run(sys.executable, "-m", self.then)
                if not made[0]:
                    raise PlantedError(f"{self.name}: {self.then}: {made[1].splitlines()[-1]}")
            return copy.failing_test(*command)
        finally:
            copy.remove()


def planted(table: Path = TABLE) -> list[Planted]:
    rows = tomllib.loads(table.read_text())["plant"]
    return [Planted(**row | {"rules": tuple(row["rules"])}) for row in rows]
