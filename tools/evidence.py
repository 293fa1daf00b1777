# SPDX-License-Identifier: Apache-2.0
"""Renews every measured page that is of another card; `make evidence` (CHECK=1: only names them).

    python -m tools.evidence [--only REPORT]      runs the commands of REPORTS below
    python -m tools.evidence --check              exit 1 when a page is of another card

docs/evidence.json has the figures that other pages show, with the fingerprints of what was measured
(campaigns/bench/fingerprint.py). A report of this card, firmware and judge is not measured again, so a run
that was stopped goes on. Seeds follow from the fingerprint of the card: another card meets other cases. Exit
1: a command failed, or a campaign found something; the other commands are run all the same.
"""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable

from campaigns.bench import fingerprint
from constraints import synth
from formal import flips, prove
from rtl.command import Parser, own_environment, run_main
from rtl.report_page import evidence, forget
from rtl.sources import ROOT
from sw.test import fuzz

# The targets of `make` that renew each report, the long ones first: 2 hours on two cores, as planned.
REPORTS = {
    "bench": ("bench SEED={seed}", "bench CONFIG=tiny SEED={seed}", "bench PAGE=yes"),
    "synthesis": ("synth",),
    "kills": ("kills SAMPLE=40 SEED={seed} PAGE=yes",),
    "proved-flips": ("formal-flips",),
    "proofs": ("formal",),
    "fuzz": (
        "fuzz COUNT=350 SEED={seed}",
        "fuzz CONFIG=tiny COUNT=20 SEED={seed}",
        "impatient COUNT=350 SEED={seed}",
        "impatient CONFIG=tiny COUNT=75 SEED={seed}",
        "flips COUNT=1500 SEED={seed}",
        "flips CONFIG=tiny COUNT=300 SEED={seed}",
        "fuzz PAGE=yes",
    ),
    "soak": ("soak COUNT=1500 SEED={seed}", "soak CONFIG=tiny COUNT=200 SEED={seed}", "soak PAGE=yes"),
    "starts": ("starts COUNT=150 SEED={seed}", "starts CONFIG=tiny COUNT=30 SEED={seed}", "starts PAGE=yes"),
    "line-quality": ("line-quality SEED={seed}", "line-quality PAGE=yes"),
    "conformance": ("conformance", "conformance PAGE=yes"),
    "masters": ("masters", "masters PAGE=yes"),
    "coverage": ("coverage-rtl",),
    "firmware-branches": ("coverage-firmware",),
    "firmware-fuzzing": (f"fuzz-firmware RUNS={fuzz.LONG}",),
}
# Reports whose subjects are modules or designs of their own.
SUBJECTS: dict[str, Callable[[], dict[str, str]]] = {
    "proofs": lambda: {name: prove.fingerprint(name) for name in prove.known()},
    "proved-flips": lambda: {name: flips.fingerprint(name) for name in flips.known()},
    "synthesis": lambda: {"design": synth.measured_from()},
}


def changed(name: str, of: dict[str, str]) -> list[str]:
    """The subjects of a report that are not those of this tree."""
    return fingerprint.difference(of, SUBJECTS[name]() if name in SUBJECTS else fingerprint.now(*of))


def older() -> dict[str, str]:
    """Reports that are missing or of another card, each with what is another."""
    kept = evidence()
    found = {name: changed(name, kept[name]["of"]) for name in REPORTS if name in kept}
    differ = {name: f"another {', '.join(other)}" for name, other in found.items() if other}
    return {
        name: differ.get(name, "not measured yet") for name in REPORTS if name in differ or name not in kept
    }


def check(only: str | None = None) -> int:
    wrong, asked = older(), [only] if only else list(REPORTS)
    for name in asked:
        other = wrong.get(name)
        print(f"{name}: " + (f"{other}; make evidence ONLY={name}" if other else "of this card"))
    return int(any(name in wrong for name in asked))


def renew(name: str) -> list[str]:
    """Runs the commands of one report; those that failed. A page also shows what a campaign found."""
    seed, failed = int(fingerprint.card()[:6], 16), []
    for command in REPORTS[name]:
        target = command.format(seed=seed)
        print(f"evidence: {name}: make {target}", flush=True)
        made = ["make", "--no-print-directory", *target.split()]
        done = subprocess.run(made, cwd=ROOT, env=own_environment(), check=False)
        if done.returncode < 0 or done.returncode == 130:
            raise KeyboardInterrupt
        if done.returncode:
            failed.append(f"{name}: make {target}: exit code {done.returncode}")
    return failed


def main() -> int:
    parser = Parser(prog="evidence", description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="only name the reports of another card")
    parser.add_argument("--only", choices=REPORTS, metavar="REPORT")
    given = parser.parse_args()
    if given.check:
        return check(given.only)
    forget(REPORTS)
    wanted = [name for name in older() if given.only in (None, name)]
    began, failed = time.monotonic(), []
    for number, name in enumerate(wanted, 1):
        failed += renew(name)
        minutes = (time.monotonic() - began) / 60
        print(f"evidence: report {number} of {len(wanted)}, {name}, after {minutes:.1f} min", flush=True)
    left = older()
    told = {text.partition(":")[0] for text in failed}
    failed += [f"{name}: no command renewed it" for name in wanted if name in left and name not in told]
    print(f"evidence: {sum(name not in left for name in wanted)} of {len(wanted)} reports renewed")
    for trouble in failed:
        print(f"evidence: failed: {trouble}")
    return int(bool(failed))


if __name__ == "__main__":
    run_main("evidence", main)
