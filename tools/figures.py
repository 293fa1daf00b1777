# SPDX-License-Identifier: Apache-2.0
"""Which figures of docs/evidence.json are of another card, firmware or judge, and what renews them.

    python -m tools.figures            a line for each report; exit 1 when one is of another card

Each measuring command leaves the fingerprints of what it measured (campaigns/bench/fingerprint.py). This
check compares them with the sources of this tree. It runs before a release, not in `make test`.
"""

from __future__ import annotations

from collections.abc import Callable

from campaigns.bench import fingerprint
from campaigns.mutate import run as mutate
from constraints import synth
from formal import flips, prove
from rtl.command import run_main
from rtl.report_page import evidence
from rtl.sources import rtl_files


def mutants() -> dict[str, str]:
    benches = set(mutate.benches())
    return {path.stem: mutate.fingerprint(path) for path in rtl_files() if path.stem in benches}


# Reports whose subjects are modules or designs of their own.
SUBJECTS: dict[str, Callable[[], dict[str, str]]] = {
    "mutants": mutants,
    "proofs": lambda: {name: prove.fingerprint(name) for name in prove.known()},
    "proved-flips": lambda: {name: flips.fingerprint(name) for name in flips.known()},
    "synthesis": lambda: {"design": synth.measured_from()},
}


def changed(name: str, of: dict[str, str]) -> list[str]:
    """The subjects of a report that are not those of this tree."""
    return fingerprint.difference(of, SUBJECTS[name]() if name in SUBJECTS else fingerprint.now(*of))


def older() -> dict[str, str]:
    """Reports of another card, each with the command that renews it."""
    return {name: entry["command"] for name, entry in evidence().items() if changed(name, entry["of"])}


def main() -> int:
    wrong = 0
    for name, entry in evidence().items():
        other = changed(name, entry["of"])
        wrong += bool(other)
        print(f"{name}: " + (f"another {', '.join(other)}; {entry['command']}" if other else "of this card"))
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("figures", main)
