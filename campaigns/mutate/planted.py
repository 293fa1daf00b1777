# SPDX-License-Identifier: Apache-2.0
"""Plants the bugs of campaigns/mutate/planted.toml one by one and names the test that fails first.

    python -m campaigns.mutate.planted [NAME ...]     the tests that must see them; exit 1 if one does not
    ... --first       for bugs in the firmware: the first of all host tests that fails
    ... --firmware    the bugs in the firmware only

A bug in the firmware is compiled for the host, and its tests run in a child process. Every other bug is
planted in a copy of the project, in which its test passed before. Results are printed, one JSON object a
line.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

from campaigns.mutate.run import WORK, copy_project
from rtl.command import run_main
from rtl.sources import ROOT
from sw.test import mutate as firmware_mutate
from sw.test.host import TESTS
from tb.model.rv32i import Machine

TABLE = ROOT / "campaigns/mutate/planted.toml"
FIRMWARE = "sw/src/"


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
        return self.file.startswith(FIRMWARE)

    @property
    def seen_by(self) -> str:
        """The test's name, or that of its file."""
        return Path(self.seen.split("::")[-1].split("[")[0]).stem

    def place(self, text: str) -> int:
        if text.count(self.old) != 1:
            raise PlantedError(f"{self.name}: {text.count(self.old)} places in {self.file} instead of one")
        return text.index(self.old)

    def mutant(self) -> firmware_mutate.Mutant:
        source = (ROOT / self.file).read_bytes()
        self.place(source.decode())
        start = source.index(self.old.encode())
        name = self.file.removeprefix(FIRMWARE)
        return firmware_mutate.Mutant(name, 0, "", start, start + len(self.old.encode()), self.old, self.new)


def planted(table: Path = TABLE) -> list[Planted]:
    rows = tomllib.loads(table.read_text())["plant"]
    return [Planted(**row | {"rules": tuple(row["rules"])}) for row in rows]


# ---------------------------------------------------------------- the firmware, on the host


def is_of(item: pytest.Item, seen: str) -> bool:
    """The test, or one of its parameters, that an entry names."""
    return item.nodeid == seen or item.nodeid.startswith((f"{seen}[", f"{seen}::"))


def on_the_card(item: pytest.Item) -> bool:
    """The test runs the card's image, which has no bug."""
    values = item.callspec.params.values() if hasattr(item, "callspec") else ()
    return any(Machine in (value if isinstance(value, tuple) else (value,)) for value in values)


class FirmwareRun(firmware_mutate.MutationRun):
    """A plugin of pytest: collects the host tests, then runs them in a child process for each bug."""

    def __init__(self, plants: list[Planted], folder: Path, first: bool) -> None:
        super().__init__(firmware_mutate.MutantBuild(folder), [], [], replay=False)
        self.plants, self.first = plants, first

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        self.all_items = sorted(
            (item for item in items if not on_the_card(item)),
            key=lambda item: any(word in item.name for word in firmware_mutate.SLOW),
        )

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        os.environ["FIRMWARE_LIBRARIES"] = str(self.builds.folder)
        chosen = {plant.name: self.items_for(plant) for plant in self.plants}
        self.builds.link_libraries()
        needed = [item for item in self.all_items if any(item in items for items in chosen.values())]
        if failed := self.tests_fail(needed):
            raise SystemExit(f"without a bug: {failed}")
        for plant in self.plants:
            self.builds.change(plant.mutant())
            if not self.builds.make("card"):
                raise SystemExit(f"{plant.name} does not compile")
            self.builds.link_libraries()
            show(plant, self.tests_fail(chosen[plant.name]).removeprefix("test "))
        return True

    def items_for(self, plant: Planted) -> list[pytest.Item]:
        if self.first:
            return self.all_items
        items = [item for item in self.all_items if is_of(item, plant.seen)]
        if not items:
            raise SystemExit(f"{plant.name}: there is no test {plant.seen}")
        return items


def show(plant: Planted, failed: str) -> None:
    print(json.dumps({"plant": plant.name, "failed": failed}), flush=True)


def run_firmware(plants: list[Planted], folder: Path, first: bool) -> None:
    options = ["-q", "--capture=no", "--no-header", "-p", "no:cacheprovider", "-p", "no:xdist"]
    run = FirmwareRun(plants, folder, first)
    files = TESTS if first else sorted({plant.seen.split("::")[0] for plant in plants})
    pytest.main([*options, "-p", "no:faulthandler", *(str(ROOT / file) for file in files)], plugins=[run])
    shutil.rmtree(folder, ignore_errors=True)


# ---------------------------------------------------------------- the rest, in a copy of the project


def run_copy(plant: Planted, folder: Path) -> str:
    """Plants the bug in a copy; returns the test if it fails, and raises if it fails without the bug."""
    copy_project(folder)
    command = [sys.executable, "-m", "pytest", "-q", "-x", "--no-header", "-p", "no:cacheprovider", "--all"]
    if "[" not in plant.seen and plant.seen.startswith("tb/"):
        command.append("--sim=icarus")

    def passes() -> bool:
        done = subprocess.run([*command, plant.seen], cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1):
            raise PlantedError(
                f"{plant.name}: {plant.seen} did not run:\n{done.stdout[-2000:]}{done.stderr[-500:]}"
            )
        return done.returncode == 0

    if not passes():
        raise PlantedError(f"{plant.name}: {plant.seen} fails without the bug")
    file = folder / plant.file
    text = file.read_text()
    plant.place(text)
    file.write_text(text.replace(plant.old, plant.new))
    if plant.then:
        subprocess.run([sys.executable, "-m", plant.then], cwd=folder, check=True, capture_output=True)
    failed = "" if passes() else plant.seen
    shutil.rmtree(folder)
    return failed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--first", action="store_true", help="all host tests, for bugs in the firmware")
    parser.add_argument("--firmware", action="store_true", help="bugs in the firmware only")
    parser.add_argument("--table", type=Path, default=TABLE, help="another list of bugs")
    parser.add_argument("--work", type=Path, default=WORK / "planted", help="folder for the copies")
    given = parser.parse_args()
    known = {plant.name: plant for plant in planted(given.table)}
    if unknown := [name for name in given.names if name not in known]:
        parser.error(f"no plant {', '.join(unknown)}; there are: {', '.join(known)}")
    plants = [known[name] for name in given.names] or list(known.values())
    firmware = [plant for plant in plants if plant.in_firmware]
    others = [] if given.firmware or given.first else [plant for plant in plants if not plant.in_firmware]
    try:
        if firmware:
            run_firmware(firmware, given.work / "firmware", given.first)
        for plant in others:
            show(plant, run_copy(plant, given.work / plant.name))
    except PlantedError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    run_main("planted", main)
