# SPDX-License-Identifier: Apache-2.0
# needs: card | setup-masters
"""Eleven Modbus masters, downloaded, ask the virtual card (MASTER=, DIALECT=: a part); `make masters`.

    python -m campaigns.masters.run                    writes answers.json and build/reports/masters.md
    python -m campaigns.masters.run --master mbpoll    a part (also --dialect); prints it, writes nothing
    python -m campaigns.masters.run --page             writes the page from answers.json alone

The first run downloads the masters into build/masters (campaigns/masters/install.py). Each master asks the
same requests (cases.py) through its adapter; judge.py compares bytes and answers with the rules. A whole run
also tries each master with its own time-out, with parity on a pty, and its example. Exit 0: all answers are
right; 1: at least one is wrong, and nothing is written; 2: something is missing.
"""

from __future__ import annotations

import argparse
import platform
import re
import subprocess

from campaigns.bench import fingerprint
from campaigns.masters import examples, judge, page, session
from campaigns.masters.cases import cases
from campaigns.masters.install import InstallError, install
from campaigns.masters.masters import BY_ID, Master
from rtl import report_page
from rtl.command import Parser, run_main
from sim.card.run_card import CardError
from sw.test import host
from tb.model.card import DIALECTS


def socat_version() -> str:
    shown = subprocess.run(["socat", "-V"], capture_output=True, text=True, check=True).stdout
    return re.search(r"socat version (\S+)", shown)[1]


def ask(master: Master, dialects: list[str], whole: bool) -> dict:
    """All records of one master, with a line of progress for each part."""
    found: dict = {"dialects": {}}
    for dialect in dialects:
        print(f"masters: {master.title}, {dialect}", flush=True)
        asked = session.asked(master, dialect)
        found["version"] = asked["version"]
        found["dialects"][dialect] = asked["answers"]
    if whole:
        print(f"masters: {master.title}, own time-out, parity, example", flush=True)
        found["defaults"] = session.by_default(master)
        found["parity"] = session.with_parity(master)
        found["example"] = examples.run(master)
    return found


def show(master: Master, dialect: str, records: dict) -> None:
    for case in cases(dialect):
        print(f"  {master.title}, {dialect}, {case.title}: {records[case.id]['answer']}")


def kept(records: dict) -> dict:
    """Answers and times: the bytes were judged."""
    return {case: {key: record[key] for key in ("answer", "took")} for case, record in records.items()}


def write(results: dict) -> None:
    for found in results["masters"].values():
        found["dialects"] = {dialect: kept(records) for dialect, records in found["dialects"].items()}
    page.ANSWERS.write_text(page.layout(results, 4) + "\n")
    write_page(results)


def write_page(results: dict) -> None:
    of = {"standard card": results["card"], "firmware": results["sources"]}
    said = f"{len(results['masters'])} masters, each answer as the rules have it."
    report_page.publish("masters", page.page(results), "make masters", of, said)
    print("`make regs` writes the handbook's tables")


def main() -> int:
    parser = Parser(
        prog="masters",
        description=__doc__.splitlines()[0],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--master", choices=BY_ID, action="append", help="this one only; may be repeated")
    parser.add_argument("--dialect", choices=DIALECTS, action="append", help="this one only; may be repeated")
    parser.add_argument("--page", action="store_true", help="write the page from the recorded answers")
    options = parser.parse_args()
    if options.page:
        write_page(page.load())
        return 0
    install()
    whole = not (options.master or options.dialect)
    dialects = options.dialect or list(DIALECTS)
    chosen = [BY_ID[master] for master in options.master or BY_ID]
    results: dict = {
        "card": fingerprint.card(),
        "sources": host.fingerprint(),  # of the images of all dialects
        "system": f"{platform.system()} {platform.release().split('-')[0]}",
        "timeout_s": session.TIMEOUT_S,
        "socat": socat_version(),
        "masters": {},
    }
    wrong = []
    for master in chosen:
        found = results["masters"][master.id] = ask(master, dialects, whole)
        for dialect in dialects:
            if not whole:
                show(master, dialect, found["dialects"][dialect])
            wrong += judge.deviations(master, dialect, found["dialects"][dialect])
    for line in wrong:
        print(f"WRONG {line}")
    asked = sum(len(cases(dialect)) for dialect in dialects) * len(chosen)
    masters = f"{len(chosen)} master{'s' if len(chosen) != 1 else ''}"
    print(f"{asked} requests of {masters}, {len(wrong)} deviations")
    if whole and not wrong:
        write(results)
    return int(bool(wrong))


if __name__ == "__main__":
    run_main("masters", main, InstallError, session.MastersError, CardError, page.PageError)
