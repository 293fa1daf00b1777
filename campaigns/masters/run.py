# SPDX-License-Identifier: Apache-2.0
# needs: card | setup-masters
"""Eleven Modbus masters, downloaded, ask the virtual card (MASTER=, DIALECT=: a part); `make masters`.

    python -m campaigns.masters.run [--master mbpoll] [--dialect card]

The first run downloads the masters into build/masters (install.py). A case is one master in one dialect: it
asks the requests of cases.py through its adapter, and judge.py compares bytes and answers with the rules. One
more case of each master has its own time-out, parity on a pty, and its example. Exit 1: an answer is wrong;
2: something is missing. Other options: campaigns/engine.py.
"""

from __future__ import annotations

import platform
import re
import subprocess
from argparse import Namespace
from typing import Any

from campaigns.engine import Campaign, EngineError, Row, Store
from campaigns.masters import examples, judge, page, session
from campaigns.masters.cases import cases
from campaigns.masters.install import InstallError, install
from campaigns.masters.masters import BY_ID
from rtl.command import Parser, run_main
from sim.card.run_card import CardError
from tb.model.card import DIALECTS

BY_ITSELF = "by-itself"


def socat_version() -> str:
    shown = subprocess.run(["socat", "-V"], capture_output=True, text=True, check=True).stdout
    return re.search(r"socat version (\S+)", shown)[1]


class Masters(Campaign):
    name, module = "masters", "campaigns.masters.run"
    command = "make masters"
    count = 0
    configs = ("standard",)
    every_dialect = True
    drawn = False
    jobs = 1  # masters and card keep to wall time
    keep = (page.TIME_OUTS,)

    def options(self, parser: Parser) -> None:
        parser.add_argument("--master", choices=BY_ID, help="this one only")
        parser.add_argument("--dialect", choices=DIALECTS, help="this one only")

    def instead(self, given: Namespace) -> None:
        install()

    def cases(self, given: Namespace) -> list[str]:
        parts = [given.dialect] if given.dialect else [*DIALECTS, BY_ITSELF]
        return [
            f"{master}/{part}" for master in ([given.master] if given.master else BY_ID) for part in parts
        ]

    def run(self, config: str, case: str) -> Row:
        name, part = case.split("/")
        master = BY_ID[name]
        if part != BY_ITSELF:
            asked = session.asked(master, part)
            return asked | {"wrong": "; ".join(judge.deviations(master, part, asked["answers"]))}
        return {
            "defaults": session.by_default(master),
            "parity": session.with_parity(master),
            "example": examples.run(master),
            "system": f"{platform.system()} {platform.release().split('-')[0]}",
            "socat": socat_version(),
        }

    def said(self, rows: dict[str, Row]) -> str:
        """The sums; of one master every answer, too."""
        shown, asked = [], 0
        for name, row in rows.items():
            asked += len(row.get("answers", ()))
            master, part = name.split("/")
            for case in cases(part) if part != BY_ITSELF else ():
                shown.append(
                    f"  {BY_ID[master].title}, {part}, {case.title}: {row['answers'][case.id]['answer']}"
                )
        wrong = sum(bool(self.wrong(row)) for row in rows.values())
        lines = shown if len({name.split("/")[0] for name in rows}) == 1 else []
        return "\n".join([f"{asked} requests, {wrong} cases with a deviation", *lines])

    def context(self, store: Store) -> dict[str, Any]:
        (card,) = self.found(store)
        if missing := [
            case for case in self.cases(Namespace(master=None, dialect=None)) if case not in card.rows
        ]:
            raise EngineError(f"no result of {', '.join(missing)}; run `make masters` first")
        masters = {}
        for master in BY_ID:
            of = {dialect: card.rows[f"{master}/{dialect}"] for dialect in DIALECTS}
            answers = {dialect: row["answers"] for dialect, row in of.items()}
            own = card.rows[f"{master}/{BY_ITSELF}"]
            masters[master] = own | {"version": of["card"]["version"], "dialects": answers}
        return {"measured_on": card.name, "timeout": f"{session.TIMEOUT_S:g}", **page.parts(masters)}

    def about(self, store: Store) -> str:
        (card,) = self.found(store)
        right = (
            "each answer as the rules have it" if not card.wrong else f"{card.wrong} cases with a deviation"
        )
        return f"{len(BY_ID)} masters, {right}."


CAMPAIGN = Masters()

if __name__ == "__main__":
    run_main("masters", CAMPAIGN.main, CardError, EngineError, InstallError, session.MastersError)
