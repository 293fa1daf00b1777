# SPDX-License-Identifier: Apache-2.0
# needs: firmware | setup-synth setup-firmware
"""Which test or proof notices each mutant and planted bug (45 min for SAMPLE=60); `make kills`.

    python -m campaigns.kills.run [--sample N|all] [--seed N] [--jobs N] [--only TEXT] [--page yes]

A sample of the mutants of the Verilog and of the firmware's core and poll loop is drawn over all modules and
files, at least one of each where the sample lasts; --sample all --only rtu_rx.v takes those of one. With them
come the bugs of tb/planted.toml that a test or the fuzzer must see, and every fault of
campaigns/conformance/fixture.py. Only what `make test` or .ci/run runs counts. The first that fails is named:
a test or proof of the changed module or file, or else Verilator's warnings, or a test of the whole card. A
mutant with a reason why it behaves like the original is no finding.

build/kills/matrix.json and matrix.tsv have a row for each. A run that was stopped goes on from there, unless
a source has changed. Exit 1: nothing notices one of them.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

from campaigns.bench.fingerprint import now as fingerprint_of
from campaigns.conformance.fixture import FAULTS, PROFILE, ModelLine
from campaigns.engine import page as render
from campaigns.kills import verilog as mutate
from rtl.command import Parser, run_main, threads
from rtl.report_page import publish
from rtl.sources import ROOT
from sw.rtu2fc.cases import CASES
from sw.rtu2fc.engine import FAIL, grade
from sw.test import mutate as firmware
from tb.lib import bound
from tb.lib.options import at_least
from tb.lib.planted import Bug, PlantError, bugs

FOLDER = ROOT / "build/kills"
MATRIX = FOLDER / "matrix.json"
TEMPLATE = ROOT / "campaigns/kills/kills.md.in"
# The first so many mutants of a module and of a file, in the order of this seed, are `all`.
SEED_OF_MUTATE, COUNT_OF_MUTATE, COUNT_OF_FIRMWARE = 1, 40, 60
# A mutant that its own bench does not notice goes to these.
OF_CARD = ("tb/card", *mutate.OF_CARD)
LINT = "verilator -Wall"
WIDER = (OF_CARD, ("campaigns/fuzz/test_fuzz.py",), ("tb/rtl", *mutate.OF_MODULE), (*OF_CARD, *mutate.IN_CI))
# Of one row, for the time that is left.
SECONDS = {"Verilog mutant": 60, "firmware mutant": 15, "planted bug": 30, "fuzzer's bug": 30, "fault": 0.3}
DECIDED = ("noticed", "unnoticed")
SHOWN = (*DECIDED, "same")
Change = tuple[str, str, object, str]  # kind, name, mutant, the test that must see it


@dataclass
class Row:
    kind: str
    name: str
    verdict: str  # of SHOWN; invalid: no mutant, for it does not compile or makes the same code
    by: str = ""  # the test or proof


class Matrix:
    """The rows, kept after each one."""

    def __init__(self, sample: str, seed: int | None, only: str) -> None:
        of = fingerprint()
        kept = json.loads(MATRIX.read_text()) if MATRIX.exists() else {}
        goes_on = (kept.get("of"), kept.get("sample")) == (of, sample) and seed in (None, kept["seed"])
        if not goes_on or (seed is None and kept["complete"]):
            kept = {"rows": []}
        self.seed = kept.get("seed", seed if seed is not None else random.SystemRandom().randrange(10**6))
        self.head = {"of": of, "sample": sample, "seed": self.seed}
        self.rows = {row["name"]: Row(**row) for row in kept["rows"]}
        self.only, self.lock, self.begun = only, threading.Lock(), time.monotonic()
        self.wanted: Counter[str] = Counter()  # rows of each kind in this run
        self.done: Counter[str] = Counter()

    def add(self, row: Row) -> None:
        with self.lock:
            self.rows[row.name] = row
            self.write(complete=False)
            if row.verdict in DECIDED:
                self.done[row.kind] += 1
                print(f"{self.left()} {row.name}: {row.by or row.verdict}", flush=True)

    def decided(self, changes: list[Change]) -> int:
        return sum(name in self.rows and self.rows[name].verdict in DECIDED for _, name, _, _ in changes)

    def lacks(self, kind: str, name: str) -> bool:
        return name not in self.rows and self.only in f"{kind} {name}"

    def left(self) -> str:
        """Rows, and the time that is left as those that are done let expect."""
        expected, spent = (sum(SECONDS[kind] * of[kind] for kind in of) for of in (self.wanted, self.done))
        minutes = (time.monotonic() - self.begun) / 60 * max(0, expected - spent) / spent
        return f"{self.done.total()}/{self.wanted.total()}, {minutes:.0f} min left:"

    def write(self, complete: bool) -> None:
        FOLDER.mkdir(parents=True, exist_ok=True)
        rows = sorted(map(asdict, self.rows.values()), key=lambda row: (row["kind"], row["name"]))
        text = json.dumps(self.head | {"complete": complete, "rows": rows}, indent=1)
        partly = MATRIX.with_suffix(".part")
        partly.write_text(text + "\n")
        partly.replace(MATRIX)
        shown = [row.values() for row in rows if row["verdict"] in SHOWN]
        lines = ("\t".join(" ".join(cell.split()) for cell in row) for row in shown)
        MATRIX.with_suffix(".tsv").write_text("kind\tname\tverdict\tnoticed by\n" + "\n".join(lines) + "\n")


def fingerprint() -> str:
    """Hash of every file that a check may read."""
    content = hashlib.sha256()
    for name in mutate.COPIED:
        place = ROOT / name
        for path in sorted(place.rglob("*")) if place.is_dir() else [place]:
            if path.is_file() and "__pycache__" not in path.parts:
                content.update(f"{path}\0".encode() + path.read_bytes())
    return content.hexdigest()[:12]


def quotas(groups: dict[str, int], sample: int, seed: int) -> Counter[str]:
    """How many to take of each group: one of each while the sample lasts, the others by the groups' sizes."""
    draw = random.Random(seed)
    names = draw.sample(sorted(groups), len(groups))
    others = [name for name in names for _ in range(groups[name] - 1)]
    return Counter(names[:sample] + draw.sample(others, min(len(others), max(0, sample - len(names)))))


def page(matrix: Matrix) -> tuple[str, str]:
    """The report, and its statement."""
    rows = list(matrix.rows.values())
    lines, said = [], []
    for kind in SECONDS:
        found = Counter(row.verdict for row in rows if row.kind == kind)
        decided = found["noticed"] + found["unnoticed"]
        lines.append(
            (kind, decided, found["noticed"], bound.words(found["unnoticed"], decided), found["same"])
        )
        said.append(f"{found['noticed']} of {decided} {kind}s")
    by = Counter(row.by.split("::")[0].split(",")[0] for row in rows if row.verdict == "noticed")
    made = {
        "sample": matrix.head["sample"],
        "seed": matrix.seed,
        "sure": bound.SURE,
        "kinds": lines,
        "by": by.most_common(),
        "missed": [row.name for row in rows if row.verdict == "unnoticed"],
    }
    return render(TEMPLATE.read_text(), made), f"Noticed: {', '.join(said)}."


# ---------------------------------------------------------------- the changes


def name_of(mutant: mutate.Mutant | firmware.Mutant) -> str:
    if isinstance(mutant, mutate.Mutant):
        return f"{mutant.module}.v:{mutant.line} {mutant.before} -> {mutant.after} (at {mutant.start})"
    return f"{mutant.file}:{mutant.line} {mutant.change} (at {mutant.start})"


def as_mutant(bug: Bug) -> mutate.Mutant | firmware.Mutant:
    """The bug as a mutant of the firmware or of a module."""
    old, new, (start, end) = bug.old, bug.new, bug.place()
    if bug.in_firmware:
        return firmware.Mutant(os.path.relpath(bug.file, "sw/src"), 0, "", start, end, old, new)
    return mutate.Mutant(Path(bug.file).stem, 0, old, new, start, end, new)


def groups_of_mutants(sample: str, seed: int) -> list[tuple[int, list[Change]]]:
    """The mutants of each module and file, shuffled, and how many of them to try."""
    found: dict[str, list] = {}
    for module in mutate.benches():
        found[f"Verilog mutant {module}"] = mutate.shuffled(module, SEED_OF_MUTATE)[:COUNT_OF_MUTATE]
    for mutant in firmware.chosen_mutants(COUNT_OF_FIRMWARE):
        found.setdefault(f"firmware mutant {mutant.file}", []).append(mutant)
    sizes = {name: len(mutants) for name, mutants in found.items()}
    count = sum(sizes.values()) if sample == "all" else int(sample)
    wanted = quotas(sizes, count, seed)
    groups = []
    for name, mutants in found.items():
        random.Random(f"{seed} {name}").shuffle(mutants)
        kind = " ".join(name.split()[:2])
        changes = [(kind, name_of(mutant), mutant, "") for mutant in mutants]
        groups.append((wanted[name], changes))
    return groups


def groups_of_plants() -> list[tuple[int, list[Change]]]:
    """Every planted bug that is a change of the firmware or of a module, alone."""
    found: list[Change] = [("fuzzer's bug", bug.name, as_mutant(bug), "") for bug in bugs("fuzz")]
    in_firmware = [bug for bug in bugs("test") if bug.in_firmware]
    found += [("planted bug", bug.name, as_mutant(bug), bug.seen["test"]) for bug in in_firmware]
    return [(1, [change]) for change in found]


# ---------------------------------------------------------------- the tasks


def run_module(matrix: Matrix, module: str, groups: list[tuple[int, list[Change]]]) -> None:
    """Tries changes of a module with its bench and proof, then with the tests of the whole card."""
    tree = mutate.Tree("kills", module)
    try:
        tree.baseline()
        for wanted, changes in groups:
            for kind, name, mutant, _ in changes:
                if wanted == 0:
                    break
                if name not in matrix.rows:
                    tree.evaluate(mutant)
                    verdict, node = mutant.verdict, mutant.node
                    if verdict in ("caught", "survived"):
                        node = node or noticed_wider(tree, mutant)
                        verdict = "noticed" if node else "unnoticed"
                    matrix.add(Row(kind, name, verdict, node))
                wanted -= matrix.rows[name].verdict in DECIDED
    finally:
        tree.remove()


def noticed_wider(tree: mutate.Tree, mutant: mutate.Mutant) -> str:
    """`make lint`, or the test of another bench or of the whole card that fails with the mutant alone."""
    usual_s, tree.longest_s = tree.longest_s, mutate.LONGEST_S
    text = tree.original
    changed = text[: mutant.start] + mutant.text + text[mutant.end :]
    tree.file.write_text(changed)
    passed, _ = tree.run(sys.executable, "-m", "tools.lint", "--only", LINT)
    if not passed:
        tree.file.write_text(text)
        return f"make lint, {LINT}"
    for arguments in WIDER:
        tree.file.write_text(changed)
        failed = tree.failing_test(*arguments)
        tree.file.write_text(text)
        if failed and not tree.failing_test(*(arguments if " " in failed else (failed, *mutate.IN_CI))):
            break
        failed = ""
    tree.longest_s = usual_s
    return failed


def run_planted(matrix: Matrix, bug: Bug) -> None:
    failed = failing_test(bug)
    matrix.add(Row("planted bug", bug.name, "noticed" if failed else "unnoticed", failed))


def failing_test(bug: Bug) -> str:
    """Plants the bug in a copy of the project; the test that sees it there, and passes without it."""
    copy, seen = mutate.Copy(bug.name), bug.seen["test"]
    try:
        icarus = ["--sim=icarus"] if "[" not in seen and seen.startswith("tb/") else []
        command = [*mutate.IN_CI, *icarus, seen]
        if failed := copy.failing_test(*command):
            raise PlantError(f"{bug.name}: {failed} fails without the bug")
        (copy.root / bug.file).write_text(bug.planted(copy.root))
        if bug.then:
            made = copy.run(sys.executable, "-m", bug.then)
            if not made[0]:
                raise PlantError(f"{bug.name}: {bug.then}: {made[1].splitlines()[-1]}")
        return copy.failing_test(*command)
    finally:
        copy.remove()


def run_firmware(matrix: Matrix, groups: list[tuple[int, list[Change]]]) -> None:
    kinds = {name: kind for _, changes in groups for kind, name, _, _ in changes}
    sent = []
    for wanted, changes in groups:
        new = [(name, asdict(mutant), seen) for _, name, mutant, seen in changes if name not in matrix.rows]
        sent.append({"wanted": wanted - matrix.decided(changes), "changes": new})
    command = [sys.executable, "-m", "campaigns.kills.firmware", str(FOLDER / "firmware")]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as child:
        child.stdin.write(json.dumps(sent))
        child.stdin.close()
        other = ""
        for line in child.stdout:
            if line.startswith('{"name"'):
                row = json.loads(line)
                matrix.add(Row(kinds[row["name"]], **row))
            else:
                other = line.strip() or other
    if child.returncode:
        raise SystemExit(f"the firmware's tests did not end: {other}")


def run_faults(matrix: Matrix, faults: Iterable[str]) -> None:
    for fault in faults:
        own = [case for case in CASES if case.number == FAULTS[fault]]
        (verdict,) = grade(ModelLine(PROFILE, fault), PROFILE, own)
        noticed = verdict.outcome == FAIL
        by = f"campaigns/conformance/test_conformance.py, case {verdict.number}" if noticed else ""
        matrix.add(Row("fault", fault, "noticed" if noticed else "unnoticed", by))


def tasks(matrix: Matrix, sample: str) -> list[Callable[[], None]]:
    """What is not in the matrix yet."""
    modules: dict[str, list] = {}
    in_firmware: list = []
    for wanted, changes in [*groups_of_plants(), *groups_of_mutants(sample, matrix.seed)]:
        changes = [change for change in changes if matrix.only in f"{change[0]} {change[1]}"]
        left = min(wanted, len(changes)) - matrix.decided(changes)
        if left > 0:
            kind, _, mutant, _ = changes[0]
            matrix.wanted[kind] += left
            of_module = isinstance(mutant, mutate.Mutant)
            (modules.setdefault(mutant.module, []) if of_module else in_firmware).append((wanted, changes))
    others = [bug for bug in bugs("test") if not bug.in_firmware and matrix.lacks("planted bug", bug.name)]
    faults = [fault for fault in FAULTS if matrix.lacks("fault", fault)]
    matrix.wanted["planted bug"] += len(others)
    matrix.wanted["fault"] += len(faults)
    found: list[Callable[[], None]] = []
    if in_firmware:
        found.append(lambda: run_firmware(matrix, in_firmware))
    # The bench of the whole card takes longest.
    for module in sorted(modules, key=lambda module: (module != mutate.TOP, module)):
        found.append(lambda module=module: run_module(matrix, module, modules[module]))
    found += [lambda bug=bug: run_planted(matrix, bug) for bug in others]
    found.append(lambda: run_faults(matrix, faults))
    return found


def sample_size(text: str) -> str:
    """Argument type: a number, or all."""
    if text != "all" and not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is neither a number nor all")
    return text


def main(arguments: list[str] | None = None) -> int:
    parser = Parser(prog="kills", description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=sample_size, default="60", help="mutants (default: 60), or all")
    parser.add_argument("--seed", type=at_least(0))
    parser.add_argument("--jobs", type=at_least(1), default=2)
    parser.add_argument("--only", default="", metavar="TEXT", help="rows with this text in kind and name")
    parser.add_argument("--page", choices=["yes"], help="write build/reports/kills.md if all are noticed")
    given = parser.parse_args(arguments)
    matrix = Matrix(given.sample, given.seed, given.only)
    print(f"kills: sample {given.sample}, repeat with SEED={matrix.seed}", flush=True)
    broken = []
    work = tasks(matrix, given.sample)
    known = any(given.only in f"{row.kind} {row.name}" for row in matrix.rows.values())
    if given.only and not known and not matrix.wanted.total():
        parser.error(f"no mutant, bug or fault has '{given.only}' in its kind and name")
    with threads(given.jobs) as pool:
        for done in as_completed([pool.submit(task) for task in work]):
            try:
                done.result()
            except (SystemExit, PlantError) as error:
                said = str(error).splitlines()
                broken.append(" ".join(dict.fromkeys((said[0], said[-1]))))
                print(f"kills: {broken[-1]}", file=sys.stderr, flush=True)
    matrix.write(complete=not broken and not given.only)
    verdicts = Counter((row.kind, row.verdict) for row in matrix.rows.values())
    for kind in SECONDS:
        counts = ", ".join(f"{verdicts[kind, verdict]} {verdict}" for verdict in SHOWN)
        print(f"{kind}: {counts}")
    missed = [row for row in matrix.rows.values() if row.verdict == "unnoticed"]
    for row in missed:
        print(f"kills: nothing notices {row.kind} {row.name}", file=sys.stderr)
    print(f"written: {os.path.relpath(MATRIX, ROOT)} and matrix.tsv")
    if given.page and not broken and not given.only and not missed:
        text, said = page(matrix)
        of = fingerprint_of("standard card", "tiny card", "firmware")
        publish("kills", text, f"make kills SAMPLE={given.sample} PAGE=yes", of, said, keep=[""])
    return 2 if broken else 1 if missed else 0


if __name__ == "__main__":
    run_main("kills", main, PlantError)
