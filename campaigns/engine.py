# SPDX-License-Identifier: Apache-2.0
"""The engine of the campaigns that count cases: processes or other machines, one store, pages.

    python -m campaigns.engine merge FILE...     adds results of other machines to build/campaigns.sqlite

A campaign is a folder with a page, NAME.md.in, and run.py, which has CAMPAIGN, an object of a class below
Campaign. A case is a text that says all about it, so it has the same result anywhere. The result is a row, a
dictionary that JSON can hold. The store keeps it by campaign, fingerprint (card, firmware, judge),
configuration and case. So a run that was stopped goes on, and merged stores are a union.
"""

from __future__ import annotations

import functools
import importlib
import json
import operator
import random
import re
import sqlite3
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from campaigns.bench import fingerprint
from rtl.command import Parser, in_processes, run_main
from rtl.report_page import publish, tables
from rtl.sources import ROOT, card_files, configurations
from sw.test import host
from tb.lib import bound
from tb.lib.options import at_least

STORE = ROOT / "build/campaigns.sqlite"
EVERY_S = 20  # between two lines of progress
FOLLOWED = 3  # cases that went wrong, which are looked at closer
TABLE = """CREATE TABLE IF NOT EXISTS results (campaign TEXT, fingerprint TEXT, config TEXT, "case" TEXT,
    row TEXT, PRIMARY KEY (campaign, fingerprint, config, "case")) WITHOUT ROWID"""
ALL = 'SELECT campaign, fingerprint, config, "case", row FROM results'
Row = dict[str, Any]
Task = Callable[[str], tuple[str, str, Row]]


class EngineError(Exception):
    """Error for the user, in one line."""


class Store:
    """The results, in one file. Several processes may write to it at once."""

    def __init__(self, path: Path = STORE) -> None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self.base = sqlite3.connect(path, timeout=60)
            self.base.execute("PRAGMA synchronous = OFF")
            self.base.execute(TABLE)
            self.base.execute(f"{ALL} LIMIT 1").fetchall()
        except (sqlite3.Error, OSError) as error:
            raise EngineError(f"{path} is no store of results: {error}") from error

    def keep(self, campaign: str, of: str, config: str, case: str, row: Row) -> None:
        with self.base:
            values = (campaign, of, config, case, json.dumps(row))
            self.base.execute("INSERT OR IGNORE INTO results VALUES (?, ?, ?, ?, ?)", values)

    def rows(self, campaign: str, of: str, config: str) -> dict[str, Row]:
        found = self.base.execute(
            'SELECT "case", row FROM results WHERE campaign = ? AND fingerprint = ? AND config = ?',
            (campaign, of, config),
        )
        return {case: json.loads(row) for case, row in sorted(found, key=lambda each: natural(each[0]))}

    def merge(self, path: Path) -> int:
        """Adds the results of another store; returns how many were not here yet."""
        before = self.base.total_changes
        try:
            other = sqlite3.connect(f"file:{path}?mode=ro", uri=True).execute(ALL)
            with self.base:
                self.base.executemany("INSERT OR IGNORE INTO results VALUES (?, ?, ?, ?, ?)", other)
        except sqlite3.Error as error:
            raise EngineError(f"{path} is no store of results: {error}") from error
        return self.base.total_changes - before


def natural(case: str) -> list[tuple[int, str]]:
    """Sorts the numbers in the text of a case as numbers."""
    return [(int(word), "") if word.isdigit() else (-1, word) for word in re.split(r"[/,]", case)]


def total(rows: Iterable[Row], join: Callable[[Any, Any], Any] = operator.add) -> Row:
    """The rows as one: numbers added, lists joined, tables by their entries; below `worst` the greatest."""
    merged: Row = {}
    for row in rows:
        for key, value in row.items():
            if key not in merged:
                merged[key] = value
            elif isinstance(value, dict):
                merged[key] = total((merged[key], value), max if key == "worst" else join)
            else:
                merged[key] = join(merged[key], value)
    return merged


def changes(config: str) -> list[int]:
    """When each file of the card, and each image, was written last."""
    images = (ROOT / configurations()[config]["firmware_hex"]).parent
    files = [*card_files(config), *images.glob("*.hex"), *images.glob("*/firmware.hex")]
    return [path.stat().st_mtime_ns for path in files]


@functools.cache
def _campaign(module: str) -> Campaign:
    return importlib.import_module(module).CAMPAIGN


@functools.cache
def _of(module: str, config: str) -> str:
    return _campaign(module).of(config)


def work(case: str, module: str, config: str) -> tuple[str, str, Row]:
    """In a worker: the case, the fingerprint of the card that it has, and the row."""
    return case, _of(module, config), _campaign(module).run(config, case)


def elsewhere(address: str, task: Task, cases: list[str]) -> Iterator[tuple[str, str, Row]]:
    """As rtl.command.in_processes, by the workers of a Dask scheduler."""
    try:
        from distributed import Client
    except ImportError as error:
        raise EngineError("the package distributed is missing; run: tools/setup.sh machines") from error
    try:
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as error:
        raise EngineError(f"no scheduler answers at {address}") from error
    with client, client.get_executor(pure=False) as pool:
        for done in as_completed([pool.submit(task, case) for case in cases]):
            yield done.result()


class Campaign:
    """Cases that are counted. A campaign overrides what differs, `run` at least."""

    name: str  # of the folder, the command and the report
    module: str  # that has CAMPAIGN; a worker imports it
    command: str  # by which the page was made
    unit = "cases"  # what COUNT counts
    count = 1000  # by default; 0: the cases are always the same
    configs = tuple(configurations())
    every_dialect = False  # whether cases run other images than that of `card`
    drawn = True  # whether cases follow from a seed
    jobs = 2  # processes by default
    # Headings of the page whose tables go into docs/evidence.json; none: that of its first table.
    keep: tuple[str, ...] = ()

    def options(self, parser: Parser) -> None:
        """Options of its own."""

    def cases(self, given: Namespace) -> list[str]:
        return [f"{given.seed}/{number}" for number in range(given.count)]

    def run(self, config: str, case: str) -> Row:
        raise NotImplementedError

    def wrong(self, row: Row) -> str:
        """What is wrong with the card, in one line; empty if nothing is."""
        return row.get("wrong", "")

    def follow(self, config: str, case: str) -> str:
        """Looks closer at one of the first cases that went wrong; a line for the user, or nothing."""
        return ""

    def judge(self) -> str:
        return fingerprint.judge(self.module.split(".")[1])

    def of(self, config: str) -> str:
        """Card, images and judge."""
        image = (fingerprint.every_image if self.every_dialect else fingerprint.firmware)(config)
        return " ".join([fingerprint.card(config), image, self.judge()])

    def tries(self, rows: dict[str, Row]) -> int:
        """How often the card could have gone wrong, for the bound."""
        return len(rows)

    def said(self, rows: dict[str, Row]) -> str:
        wrong, tries = sum(bool(self.wrong(row)) for row in rows.values()), self.tries(rows)
        at_most = f"at most {bound.words(wrong, tries)} of all at {bound.SURE}"
        return f"{tries:,} {self.unit}, {wrong} with a difference, {at_most}"

    # ------------------------------------------------------------ the command

    def parse(self) -> Namespace:
        about = sys.modules[type(self).__module__].__doc__
        parser = Parser(prog=self.name, description=about.splitlines()[0])
        parser.add_argument("--config", choices=self.configs, default="standard")
        if self.count:
            parser.add_argument("--count", type=at_least(1), help=f"{self.unit}; default {self.count}")
        if self.drawn:
            parser.add_argument("--seed", type=at_least(0), help="default: drawn")
        parser.add_argument("--jobs", type=at_least(1), default=self.jobs)
        parser.add_argument("--on", metavar="ADDRESS", help="of a Dask scheduler: its workers run the cases")
        parser.add_argument("--part", type=part, metavar="I/N", help="each N-th case, from the I-th on")
        parser.add_argument("--store", type=Path, default=STORE, help="file with the results")
        if self.template().exists():
            about = "write build/reports from the results, run nothing"
            parser.add_argument("--page", choices=["yes"], help=about)
        self.options(parser)
        given = parser.parse_args()
        if self.drawn and given.seed is None:
            given.seed = random.SystemRandom().randrange(1 << 31)
        if self.count:
            given.count = given.count or self.count
        return given

    def instead(self, given: Namespace) -> int | None:
        """Does what an option of its own asks for in place of a run; None: nothing."""
        return None

    def main(self) -> int:
        given = self.parse()
        if getattr(given, "page", None):
            self.publish(Store(given.store))
            return 0
        code = self.instead(given)
        return self.measure(given) if code is None else code

    def measure(self, given: Namespace) -> int:
        """Runs the cases whose results are not in the store; 1 if the card went wrong in any.

        A row with `missing` says what its case lacked: it is not kept, the others are run, and the code is 2.
        """
        first, step = given.part or (1, 1)
        cases = self.cases(given)[first - 1 :: step]
        if not cases:
            print(f"{self.name}: part {first} of {step} has no case")
            return 0
        store, of, config = Store(given.store), self.of(given.config), given.config
        known = store.rows(self.name, of, config)
        left = [case for case in cases if case not in known]
        kept = f", {len(cases) - len(left)} of them from an earlier run" if len(left) < len(cases) else ""
        seed = f", seed {given.seed}" if self.drawn else ""
        print(f"{self.name}: {config} card{seed}, {len(cases)} cases{kept}", flush=True)
        followed = missing = 0
        sources = changes(config)
        for case, row in self._outcomes(given, left, of):
            if changes(config) != sources:
                raise EngineError("the card or an image has changed during the run: run the command again")
            if "missing" in row:
                missing += 1
                print(f"{self.name}: {case}: {row['missing']}", file=sys.stderr, flush=True)
                continue
            store.keep(self.name, of, config, case, row)
            known[case] = row
            if text := self.wrong(row):
                print(f"{self.name}: {case}: {text}", flush=True)
                followed += 1
                if followed <= FOLLOWED and (closer := self.follow(config, case)):
                    print(f"{self.name}:   {closer}", flush=True)
        rows = {case: known[case] for case in cases if case in known}
        print(f"{self.name}: {config} card: {self.said(rows)}")
        for case, text in ((case, self.wrong(row)) for case, row in rows.items()):
            if text:
                print(f"  {case}: {text}")
        return 2 if missing else int(any(map(self.wrong, rows.values())))

    def _outcomes(self, given: Namespace, cases: list[str], of: str) -> Iterator[tuple[str, Row]]:
        task = functools.partial(work, module=self.module, config=given.config)
        run = elsewhere(given.on, task, cases) if given.on else in_processes(given.jobs, task, cases)
        began = said = time.monotonic()
        try:
            for done, (case, its, row) in enumerate(run if cases else (), 1):
                if its != of:
                    raise EngineError(f"a worker has another card, firmware or judge: {its} instead of {of}")
                yield case, row
                now = time.monotonic()
                if now - said > EVERY_S:
                    said, rate = now, done / (now - began)
                    left = (len(cases) - done) / rate / 60
                    print(
                        f"{self.name}: {done} of {len(cases)}, {rate:.1f} a second, {left:.0f} min left",
                        flush=True,
                    )
        except BrokenProcessPool as error:
            raise EngineError(
                "a worker process ended. Finished cases are kept: run the command again"
            ) from error

    # ------------------------------------------------------------ the page

    def found(self, store: Store) -> list[Namespace]:
        """What the store has of each card as it is now."""
        cards = []
        for config in self.configs:
            rows = store.rows(self.name, self.of(config), config)
            if not rows:
                command = f"make {self.name} CONFIG={config}"
                raise EngineError(f"no result of the {config} card as it is now; run `{command}` first")
            wrong, tries = sum(bool(self.wrong(row)) for row in rows.values()), self.tries(rows)
            card, image = fingerprint.card(config), fingerprint.firmware(config)
            cards.append(
                Namespace(
                    config=config,
                    name=f"{config} card `{card}`, firmware `{image}`",
                    rows=rows,
                    total=total(rows.values()),
                    wrong=wrong,
                    tries=tries,
                    at_most=bound.words(wrong, tries),
                )
            )
        return cards

    def whole_run(self, card: Namespace, **options: object) -> tuple[str, dict[str, Row]]:
        """A seed, and the rows of all its cases. What was missed once stays."""
        runs = {}
        for seed in {case.split("/")[0] for case in card.rows}:
            asked = self.cases(Namespace(seed=int(seed), config=card.config, **options))
            if card.rows.keys() >= set(asked):
                runs[seed] = {case: card.rows[case] for case in asked}
        if not runs:
            command = f"make {self.name} CONFIG={card.config}"
            raise EngineError(f"no whole run of the {card.config} card as it is now; run `{command}`")
        return max(runs.items(), key=lambda run: sum(bool(self.wrong(row)) for row in run[1].values()))

    def context(self, store: Store) -> dict[str, Any]:
        """What the template of the page takes beside `sources`, `judge` and `sure`."""
        return {"cards": self.found(store)}

    def about(self, store: Store) -> str:
        """One statement for docs/evidence.json."""
        return ""

    def template(self) -> Path:
        return ROOT / Path(*self.module.split(".")[:-1], f"{self.name}.md.in")

    def subjects(self) -> list[str]:
        cards = [f"{config} card" for config in self.configs]
        return [*cards, "firmware", f"{self.module.split('.')[1]} judge"]

    def publish(self, store: Store) -> None:
        made = {
            "sources": host.fingerprint(),
            "judge": self.judge(),
            "sure": bound.SURE,
            "bound": bound.words,
        }
        text = page(self.template().read_text(), made | self.context(store))
        found = tables(text)
        keep = self.keep or list(found)[:1]
        if missing := [heading for heading in keep if heading not in found]:
            raise EngineError(f"the page has no table below {', '.join(map(repr, missing))}")
        publish(self.name, text, self.command, fingerprint.now(*self.subjects()), self.about(store), keep)


def page(template: str, values: dict[str, Any]) -> str:
    around = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    around.filters["thousands"] = lambda number: f"{number:,}"
    return around.from_string(template).render(values)


def part(text: str) -> tuple[int, int]:
    """I/N, 1 to N."""
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise ValueError
    return int(found[1]), int(found[2])


def main() -> int:
    parser = Parser(prog="results", description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["merge"])
    parser.add_argument("files", nargs="+", type=Path)
    given = parser.parse_args()
    store = Store()
    for path in given.files:
        print(f"results: {store.merge(path)} new results from {path}")
    return 0


if __name__ == "__main__":
    run_main("results", main, EngineError)
