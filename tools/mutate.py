# SPDX-License-Identifier: Apache-2.0
"""Breaks a Verilog module in one place at a time and looks whether its proofs or its tests see it.

    tools/mutate.py MODULE ... [--count N] [--seed N] [--jobs N] [--shard K/N]
    tools/mutate.py --all [...]          every module of rtl/ that has a bench
    tools/mutate.py --report             one table of everything in build/mutate/

A mutant is one change of the source: an operator, a constant, a condition that always or never holds, an
assignment or a connection that is gone. What does not compile is no mutant. It is caught when
formal/MODULE.sby no longer holds or tb/test_MODULE.py fails (on Icarus, or Verilator where a test runs only
there). Each module leaves build/mutate/MODULE.json. Survivors are listed; formal/survivors.toml says of each
why nothing can see it, or what would be lost. Exit 1: fewer than 95 % caught, or a survivor without a word.
"""

import argparse
import concurrent.futures
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path

from sources import ROOT, SourcesError, needed_files, rtl_files

WORK = ROOT / "build/mutate"
SURVIVORS = ROOT / "formal/survivors.toml"
ENOUGH = 0.95
LONGEST_S = 400
# The bench of a module that only wires is slow; these run a part of it.
BENCH_ARGS = {"rtu2fc": ["--sim=verilator"]}
COPIED = (
    "rtl",
    "tb",
    "tools",
    "formal",
    "regs",
    "sim",
    "sw",
    "configs.toml",
    "pyproject.toml",
    "requirements.txt",
)

OPERATORS = (
    (r"==", "!="),
    (r"!=", "=="),
    (r"&&", "||"),
    (r"\|\|", "&&"),
    (r"(?<= )&(?= )", "|"),
    (r"(?<= )\|(?= )", "&"),
    (r"(?<= )\^(?= )", "|"),
    (r"(?<= )\+(?= )", "-"),
    (r"(?<= )-(?= )", "+"),
    (r"(?<= )>=(?= )", ">"),
    (r"(?<= )>(?= )", ">="),
    (r"(?<= )<(?= )", "<="),
    (r"!(?=[\w(])", ""),
    (r"~(?=[\w(])", ""),
    (r"\b1'b0\b", "1'b1"),
    (r"\b1'b1\b", "1'b0"),
)


@dataclass
class Mutant:
    module: str
    line: int
    before: str  # the line, or the part of it that was changed
    after: str
    start: int  # of the change in the file
    end: int
    text: str  # what stands there instead
    verdict: str = ""
    by: str = ""
    seconds: float = 0.0


def code_only(text: str) -> str:
    """The text with blanks for what is not to be mutated: comments, simulation, proofs, start values."""
    blank = lambda found: re.sub(r"[^\n]", " ", found[0])  # noqa: E731
    text = re.sub(r"//[^\n]*", blank, text)
    text = re.sub(r"`if(?:n?def) (?:SYNTHESIS|FORMAL).*?`endif", blank, text, flags=re.DOTALL)
    # Power-up values: reset sets those that matter.
    text = re.sub(r"\binitial begin.*?\n  end\b", blank, text, flags=re.DOTALL)
    text = re.sub(r"\binitial [^;]*;", blank, text)
    text = re.sub(r"(?<=\w)\s*=\s*[^;=]*;(?=\s*(?:\n|$))", lambda f: f[0], text)
    start = text.index("module ")
    return re.sub(r"[^\n]", " ", text[:start]) + text[start:]


def closing(text: str, opening: int) -> int:
    depth = 0
    for at in range(opening, len(text)):
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        if depth == 0:
            return at
    raise ValueError("unbalanced")


def inputs_of(module: str) -> set[str]:
    path = ROOT / f"rtl/{module}.v"
    path = path if path.exists() else ROOT / f"rtl/generated/{module}.v"
    return (
        set(re.findall(r"\binput\s+wire\s+(?:\[[^\]]*\]\s*)?(\w+)", path.read_text()))
        if path.exists()
        else set()
    )


def changes(text: str):
    """All single changes as (start, end, new text)."""
    code = code_only(text)
    for pattern, new in OPERATORS:
        for found in re.finditer(pattern, code):
            yield found.start(), found.end(), new
    for found in re.finditer(r"\b(\d+)'([dh])([0-9A-Fa-f]+)\b", code):
        width, base = int(found[1]), {"d": 10, "h": 16}[found[2]]
        value = int(found[3], base)
        for other in {(value + 1) % 2**width, (value - 1) % 2**width} - {value}:
            shown = f"{other:X}" if base == 16 else str(other)
            yield found.start(), found.end(), f"{width}'{found[2]}{shown}"
    for found in re.finditer(r"\bif \(", code):
        end = closing(code, found.end() - 1)
        condition = text[found.end() : end]
        yield found.end(), end, f"1'b0 && ({condition})"
        yield found.end(), end, f"1'b1 || ({condition})"
    for found in re.finditer(
        r"(?:^|(?<=begin)|(?<=: )|(?<=\) )|(?<=else ))[ \t]*[\w{][\w\[\]:, {}+-]*<= [^;]+;", code, re.M
    ):
        yield found.start(), found.end(), ";"
    for instance in re.finditer(
        r"^  (\w+)(?: #\([^;]*?\n  \))? \w+ \(\n(.*?)\n  \);", code, re.M | re.DOTALL
    ):
        inputs = inputs_of(instance[1])
        for found in re.finditer(r"\.(\w+)\s*\(", code[instance.start(2) : instance.end(2)]):
            if found[1] in inputs and found[1] != "clk":
                opening = instance.start(2) + found.end() - 1
                end = closing(code, opening)
                yield opening + 1, end, "1'b0"
                yield opening + 1, end, f"~({text[opening + 1 : end]})"


def mutants(module: str, path: Path) -> list[Mutant]:
    text = path.read_text()
    found = []
    for start, end, new in dict.fromkeys(changes(text)):
        line = text.count("\n", 0, start) + 1
        begin = text.rfind("\n", 0, start) + 1
        stop = text.find("\n", end)
        before = " ".join(text[begin:stop].split())
        after = " ".join((text[begin:start] + new + text[end:stop]).split())
        found.append(Mutant(module, line, before, after, start, end, new))
    return found


class Tree:
    """A copy of the project in which one module is broken."""

    def __init__(self, number: int, module: str) -> None:
        self.root = WORK / f"tree-{module}-{number}"
        shutil.rmtree(self.root, ignore_errors=True)
        self.root.mkdir(parents=True)
        for name in COPIED:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, self.root / name, ignore=shutil.ignore_patterns("__pycache__"))
            elif source.exists():
                shutil.copy(source, self.root / name)
        for image in ("firmware.hex", "tiny/firmware.hex"):
            made = ROOT / "build" / image
            if made.exists():
                (self.root / "build" / image).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(made, self.root / "build" / image)
        self.module = module
        self.path = next(path for path in rtl_files() if path.stem == module)
        self.original = self.path.read_text()
        self.file = self.root / self.path.relative_to(ROOT)
        self.env = os.environ | {"CCACHE_DIR": str(ROOT / "build/ccache"), "COCOTB_RANDOM_SEED": "1"}

    def run(self, *command: str) -> tuple[bool, str]:
        """Whether the command ended well within its time, and what it printed."""
        try:
            done = subprocess.run(
                command,
                cwd=self.root,
                env=self.env,
                capture_output=True,
                text=True,
                check=False,
                timeout=LONGEST_S,
                stdin=subprocess.DEVNULL,
            )
        except subprocess.TimeoutExpired:
            return False, f"no end within {LONGEST_S} s"
        return done.returncode == 0, done.stdout + done.stderr

    def compiles(self) -> bool:
        files = [
            str(self.root / path.relative_to(ROOT))
            for path in needed_files(self.module)
            if ROOT in path.parents
        ]
        if self.module in ("rtu2fc", "soft_core"):
            files = [
                str(path) for path in needed_files(self.module) if ROOT / "rtl" not in path.parents
            ] + files
        files = list(dict.fromkeys(files))
        return self.run("iverilog", "-g2005", "-t", "null", "-s", self.module, *files)[0]

    def proved(self) -> tuple[bool, str]:
        return self.run(sys.executable, "tools/formal.py", self.module, "--task", "prove", "--jobs", "1")

    def tested(self) -> tuple[bool, str]:
        arguments = BENCH_ARGS.get(self.module, ["--sim=icarus"])
        return self.run(
            *(sys.executable, "-m", "pytest", "-q", "-x", "--no-header", "-p", "no:cacheprovider"),
            *(f"tb/test_{self.module}.py", *arguments),
        )

    def judge(self, mutant: Mutant) -> Mutant:
        began = time.monotonic()
        text = self.original
        self.file.write_text(text[: mutant.start] + mutant.text + text[mutant.end :])
        try:
            if not self.compiles():
                mutant.verdict = "invalid"
            elif (ROOT / f"formal/{self.module}.sby").exists() and not self.proved()[0]:
                mutant.verdict, mutant.by = "caught", "proof"
            elif not self.tested()[0]:
                mutant.verdict, mutant.by = "caught", "test"
            else:
                mutant.verdict = "survived"
        finally:
            self.file.write_text(self.original)
        mutant.seconds = time.monotonic() - began
        return mutant

    def remove(self) -> None:
        shutil.rmtree(self.root, ignore_errors=True)


def attack(module: str, count: int, seed: int, jobs: int, shard: tuple[int, int]) -> None:
    """Judges `count` valid mutants of a module and writes its result file."""
    path = next(path for path in rtl_files() if path.stem == module)
    candidates = mutants(module, path)
    random.Random(f"{seed} {module}").shuffle(candidates)
    candidates = candidates[shard[0] :: shard[1]]
    trees = [Tree(number, module) for number in range(jobs)]
    sound = trees[0].tested()
    if not sound[0]:
        raise SystemExit(f"mutate: tb/test_{module}.py fails on the unchanged module:\n{sound[1][-800:]}")
    results: list[Mutant] = []
    wanted = -(-count // shard[1])
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        free = list(trees)

        def work(mutant: Mutant) -> Mutant:
            tree = free.pop()
            try:
                return tree.judge(mutant)
            finally:
                free.append(tree)

        while candidates and sum(mutant.verdict != "invalid" for mutant in results) < wanted:
            missing = wanted - sum(mutant.verdict != "invalid" for mutant in results)
            batch, candidates = candidates[:missing], candidates[missing:]
            for mutant in pool.map(work, batch):
                results.append(mutant)
                if mutant.verdict == "survived":
                    print(
                        f"{module}:{mutant.line}: survived: {mutant.before}  ->  {mutant.after}", flush=True
                    )
    for tree in trees:
        tree.remove()
    suffix = "" if shard[1] == 1 else f".{shard[0]}of{shard[1]}"
    valid = [asdict(mutant) for mutant in results if mutant.verdict != "invalid"]
    WORK.mkdir(parents=True, exist_ok=True)
    document = {"module": module, "seed": seed, "possible": len(candidates) + len(results), "mutants": valid}
    (WORK / f"{module}{suffix}.json").write_text(json.dumps(document, indent=1))
    caught = sum(mutant["verdict"] == "caught" for mutant in valid)
    print(f"{module}: {caught} of {len(valid)} caught, {sum(m['seconds'] for m in valid):.0f} s", flush=True)


def explained(mutant: dict) -> str | None:
    """What formal/survivors.toml says of it; the line is known by its text, not its number."""
    known = tomllib.loads(SURVIVORS.read_text()) if SURVIVORS.exists() else {}
    for entry in known.get(mutant["module"], []):
        if entry["before"] == mutant["before"] and entry["after"] == mutant["after"]:
            return entry["why"]
    return None


def report() -> int:
    files = sorted(WORK.glob("*.json"))
    if not files:
        print("mutate: nothing in build/mutate; run `make mutate`", file=sys.stderr)
        return 2
    by_module: dict[str, list[dict]] = {}
    for file in files:
        document = json.loads(file.read_text())
        by_module.setdefault(document["module"], []).extend(document["mutants"])
    print("| module | mutants | by proof | by test | survived | caught |\n|---|---:|---:|---:|---:|---:|")
    wrong = 0
    for module, group in by_module.items():
        by = [sum(m["by"] == kind for m in group) for kind in ("proof", "test")]
        share = sum(by) / len(group)
        wrong += share < ENOUGH
        left = len(group) - sum(by)
        print(f"| `{module}` | {len(group)} | {by[0]} | {by[1]} | {left} | {100 * share:.0f} % |")
    total = [mutant for group in by_module.values() for mutant in group]
    caught = sum(mutant["verdict"] == "caught" for mutant in total)
    print(f"\n{caught} of {len(total)} mutants caught, {100 * caught / len(total):.1f} %")
    for mutant in total:
        if mutant["verdict"] == "survived":
            why = explained(mutant)
            wrong += why is None
            print(
                f"- {mutant['module']}: `{mutant['before']}` -> `{mutant['after']}`: {why or 'NOT EXPLAINED'}"
            )
    return 1 if wrong else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", metavar="MODULE")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--report", action="store_true")
    parser.add_argument("--count", type=int, default=40, help="mutants a module (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--shard", default="0/1", metavar="K/N", help="of the mutants of each module")
    options = parser.parse_args()
    if options.report:
        return report()
    benches = [path.stem for path in rtl_files() if (ROOT / f"tb/test_{path.stem}.py").exists()]
    modules = benches if options.all else options.modules
    if not modules:
        parser.error("say which module, or --all")
    for module in modules:
        if module not in benches:
            print(
                f"mutate: no module {module} with a bench; there are: {', '.join(benches)}", file=sys.stderr
            )
            return 2
    shard = re.fullmatch(r"(\d+)/(\d+)", options.shard)
    if shard is None or not int(shard[1]) < int(shard[2]):
        parser.error(f"--shard {options.shard}: K/N with K from 0 to N - 1")
    try:
        for module in modules:
            attack(module, options.count, options.seed, options.jobs, (int(shard[1]), int(shard[2])))
    except SourcesError as error:
        print(error, file=sys.stderr)
        return 2
    return report()


if __name__ == "__main__":
    sys.exit(main())
