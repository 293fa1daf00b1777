# SPDX-License-Identifier: Apache-2.0
"""Mutants of the Verilog, and the tests and proofs of their module, for `make kills`.

A mutant is one change of the source: an operator, a constant, a condition that is always true or false, a
removed assignment or connection. A change that does not compile is not a mutant. A mutant is caught if a
proof of the module no longer holds, or if tb/*/test_MODULE.py or a bench of MORE_BENCHES fails, or if one of
them takes far longer than on the unchanged module. Tests run on Icarus, or on Verilator if a test runs only
there. A mutant that is not caught is the same if survivors.toml says why it behaves like the original, and
survives otherwise.
"""

import hashlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

from formal import prove
from regs.dialects import DIALECTS, IMAGES
from rtl.sources import ROOT, bench_file, needed_files, rtl_files

WORK = ROOT / "build/kills"
EXCUSES = ROOT / "campaigns/kills/survivors.toml"
TOP = "rtu2fc"
LONGEST_S = 900  # for the unchanged module; a mutant has TIMES_LONGER of the measured time
TIMES_LONGER = 5
LEAST_S = 180  # the unchanged module may be built already, and need not be proved again
# Every test that `make test` or CI runs.
IN_CI = ("--all",)
PYTEST = (sys.executable, "-m", "pytest", "-q", "-x", "--no-header", "-p", "no:cacheprovider")
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+::.+?)(?: - .*)?$", re.M)
# The bench of the whole card is slow on Icarus. Of the others `make test` leaves out a part there.
OF_CARD, OF_MODULE = ["--sim=verilator"], ["--sim=icarus", *IN_CI]
# Modules that the bench of another one plays.
BENCH_IN = dict.fromkeys(("ram_bank", "ram_lane", "word_parity"), "firmware_ram")
BENCH_IN |= {"crc16_modbus": "rtu_rx", "sparse_state": "rtu_rx"}
BENCH_IN |= {"rtu_tx": "network_port", "rs485_dir": "network_port", "mailbox_regs": "mailbox"}
BENCH_IN |= {"bus_arbiter": "mailbox", "fc_rx": "drive_port", "fc_tx": "drive_port"}
BENCH_IN |= {"silence_timer": "drive_port", "supervisor": "card_supervision"}
BENCH_IN |= {"bcc": "drive_port", "driver_limit": "card_driver_time"}
GATE = (
    "guarded_bit",
    "guarded_half",
    "licences",
    "master_loss",
    "reply_slot",
    "request_state",
    "telegram_slot",
)
BENCH_IN |= dict.fromkeys(GATE, "commit_gate")
# The whole card is tested by subject.
MORE_BENCHES = {
    TOP: [
        f"card_{subject}"
        for subject in ("supervision", "power_up", "loopback", "both_lines", "recovers", "driver_time")
    ]
}
COPIED = (
    "campaigns",
    "constraints",
    "rtl",
    "tb",
    "tools",
    "formal",
    "regs",
    "sim",
    "sw",
    "docs/example",
    "docs/guide",
    "docs/reference",
    "VERSION",
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
INSTANCE = r"^  (\w+)(?: #\([^;]*?\n  \))? \w+ \(\n(.*?)\n  \);"  # module, connections


@dataclass
class Mutant:
    module: str
    line: int
    before: str  # the line, or its changed part
    after: str
    start: int  # position of the change in the file
    end: int
    text: str  # replacement
    verdict: str = ""  # caught, same, survived; invalid: does not compile
    by: str = ""  # proof, test
    node: str = ""  # the test of pytest, or the proof


def code_only(text: str) -> str:
    """Replaces comments, proofs and start values by blanks."""
    blank = lambda found: re.sub(r"[^\n]", " ", found[0])  # noqa: E731
    text = re.sub(r"//[^\n]*", blank, text)
    text = re.sub(r"`ifdef FORMAL.*?`endif", blank, text, flags=re.DOTALL)
    # Power-up values: reset sets the important ones.
    text = re.sub(r"(?<=^  reg) [^;]*= [^;]*;", blank, text, flags=re.M)
    text = re.sub(r"\binitial begin.*?\n  end\b", blank, text, flags=re.DOTALL)
    text = re.sub(r"\binitial [^;]*;", blank, text)
    start = text.index("module ")
    return re.sub(r"[^\n]", " ", text[:start]) + text[start:]


def closing(text: str, opening: int) -> int:
    depth = 0
    for at in range(opening, len(text)):
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        if depth == 0:
            return at
    raise ValueError("unbalanced")


def ports_of(module: str) -> dict[str, str]:
    """Maps the ports of a module of the project to their directions."""
    path = next((path for path in rtl_files() if path.stem == module), None)
    if path is None:
        return {}
    ports = re.findall(r"\b(input|output)\s+(?:wire|reg)\s+(?:\[[^\]]*\]\s*)?(\w+)", path.read_text())
    return {name: direction for direction, name in ports}


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
        value = code.index("<= ", found.start()) + 3
        yield value, found.end() - 1, f"~({text[value : found.end() - 1]})"
    for found in re.finditer(r"^  assign [^=]+ = ([^;]+);", code, re.M):
        yield found.start(1), found.end(1), f"~({text[found.start(1) : found.end(1)]})"
        yield found.start(1), found.end(1), "0"
    for found in re.finditer(r"(?<=\w\[)(\d+)(?=\])", code):
        yield found.start(), found.end(), str(int(found[1]) + 1)
        if int(found[1]):
            yield found.start(), found.end(), str(int(found[1]) - 1)
    for instance in re.finditer(INSTANCE, code, re.M | re.DOTALL):
        ports = ports_of(instance[1])
        for found in re.finditer(r"\.(\w+)\s*\(", code[instance.start(2) : instance.end(2)]):
            opening = instance.start(2) + found.end() - 1
            end = closing(code, opening)
            if ports.get(found[1]) == "output":
                yield opening + 1, end, ""
            elif found[1] in ports and found[1] != "clk":
                yield opening + 1, end, "1'b0"
                yield opening + 1, end, "1'b1"
                yield opening + 1, end, f"~({text[opening + 1 : end]})"


def mutants(module: str, path: Path) -> list[Mutant]:
    text = path.read_text()
    found = []
    for start, end, new in dict.fromkeys(changes(text)):
        if text[start:end] == new:
            continue
        line = text.count("\n", 0, start) + 1
        begin = text.rfind("\n", 0, start) + 1
        stop = text.find("\n", end)
        before = " ".join(text[begin:stop].split())
        after = " ".join((text[begin:start] + new + text[end:stop]).split())
        found.append(Mutant(module, line, before, after, start, end, new))
    return found


def shuffled(module: str, seed: int) -> list[Mutant]:
    """All mutants of a module, in the order in which a run with this seed tries them."""
    found = mutants(module, next(path for path in rtl_files() if path.stem == module))
    random.Random(f"{seed} {module}").shuffle(found)
    return found


def excused() -> set[tuple[str, str]]:
    """Module and change of each mutant that has a reason, which ends with a change of the module."""
    rows = tomllib.loads(EXCUSES.read_text())["mutant"]
    now = {path.stem: fingerprint(path) for path in rtl_files()}
    if old := [row["module"] for row in rows if now[row["module"]] != row["of"]]:
        print(f"kills: {EXCUSES.name}: another {old[0]}.v: try its mutants again", file=sys.stderr)
    return {(row["module"], change) for row in rows if row["module"] not in old for change in row["changes"]}


def copy_project(root: Path) -> None:
    """Copies the sources, the pages that tests compare, and the images; shares the tools."""
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, root / name, ignore=shutil.ignore_patterns("__pycache__"))
        elif source.exists():
            shutil.copy(source, root / name)
    (root / ".venv").symlink_to(ROOT / ".venv")
    folders = {image.folder(dialect) for image in IMAGES.values() for dialect in image.dialects}
    for folder in {"", "tiny", *DIALECTS, *folders}:
        for made in (ROOT / "build" / folder).glob("firmware.[he]*"):  # .hex, .elf
            copy = root / made.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(made, copy)


class Copy:
    """A copy of the project, in which checks run."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.root = WORK / f"tree-{name}"
        copy_project(self.root)
        self.longest_s: float = LONGEST_S
        self.child: subprocess.Popen | None = None
        self.env = os.environ | {"COCOTB_RANDOM_SEED": "1"}

    def run(self, *command: str) -> tuple[bool, str]:
        """Runs a command; returns whether it succeeded in time, and its output.

        A command that does not end in time gets a second try: the machine may have been busy. Any other exit
        code than 0 and 1 is no verdict.
        """
        done = self.try_once(*command)
        done = done or self.try_once(*command)
        if done is None:
            return False, f"no end within {self.longest_s:.0f} s, twice"
        code, output = done
        if code not in (0, 1):
            raise SystemExit(f"{self.name}: exit code {code} of {' '.join(command)}:\n{output[-800:]}")
        return code == 0, output

    def try_once(self, *command: str) -> tuple[int, str] | None:
        """Exit code and output; None: no end within longest_s."""
        child = self.child = subprocess.Popen(
            command,
            cwd=self.root,
            env=self.env,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            output, _ = child.communicate(timeout=self.longest_s)
        except subprocess.TimeoutExpired:
            self.stop()
            child.communicate()
            return None
        return child.returncode, output

    def stop(self) -> None:
        """Kills the running command with its children."""
        if self.child and self.child.poll() is None:
            os.killpg(self.child.pid, signal.SIGKILL)

    def failing_test(self, *arguments: str) -> str:
        """The first test that fails; the files where none ends in time; "" if all pass."""
        passed, output = self.run(*PYTEST, *arguments)
        found = FAILED.search(output)
        return "" if passed else found[1] if found else " ".join(arguments)

    def remove(self) -> None:
        shutil.rmtree(self.root, ignore_errors=True)


class Tree(Copy):
    """A copy of the project in which one module is changed."""

    def __init__(self, number: int | str, module: str) -> None:
        super().__init__(f"{module}-{number}")
        self.checks: list[str] = []
        self.module = module
        self.path = next(path for path in rtl_files() if path.stem == module)
        self.original = self.path.read_text()
        self.file = self.root / self.path.relative_to(ROOT)

    def compiles(self) -> bool:
        files = [
            str(self.root / path.relative_to(ROOT))
            for path in needed_files(self.module)
            if ROOT in path.parents
        ]
        done = self.try_once("iverilog", "-g2005", "-t", "null", "-s", self.module, *files)
        return done is not None and done[0] == 0

    def failing(self, check: str, changed: bool = True) -> str:
        """The test or proof that fails. A changed file that Yosys cannot read is no failed proof."""
        if check == "test":
            return self.failing_test(*bench_arguments(self.module))
        proof = ("-m", "formal.prove", self.module, "--task", "prove", "--jobs", "1")
        passed, output = self.run(sys.executable, *proof)
        return "" if passed or (changed and "ERROR" in output) else f"make formal MODULE={self.module}"

    def baseline(self) -> None:
        """Runs all checks on the unchanged module, which must pass; sorts them by time."""
        if not self.compiles():
            raise SystemExit(f"{self.module} does not compile unchanged")
        checks = ["test", *["proof"] * (self.module in prove.known())]
        times = {}
        for name in checks:
            began = time.monotonic()
            if failed := self.failing(name, changed=False):
                raise SystemExit(f"{self.module}: {failed} fails on the unchanged module")
            times[name] = time.monotonic() - began
        self.checks = sorted(times, key=times.get)
        self.longest_s = max(LEAST_S, TIMES_LONGER * max(times.values()))
        print(
            f"{self.module}: " + ", ".join(f"{name} {times[name]:.0f} s" for name in self.checks), flush=True
        )

    def evaluate(self, mutant: Mutant) -> Mutant:
        text = self.original
        self.file.write_text(text[: mutant.start] + mutant.text + text[mutant.end :])
        try:
            if not self.compiles():
                mutant.verdict = "invalid"
            else:
                mutant.verdict = "survived"
                for name in self.checks:
                    if node := self.failing(name):
                        mutant.verdict, mutant.by, mutant.node = "caught", name, node
                        break
                change = f"{mutant.before} -> {mutant.after}"
                if mutant.verdict == "survived" and (self.module, change) in excused():
                    mutant.verdict = "same"
        finally:
            self.file.write_text(self.original)
        return mutant


def fingerprint(path: Path) -> str:
    """Hash of a module's code and its promises, without comments, and without those of formal/flips.py."""
    words = code_only(path.read_text())
    if path.stem in prove.known():
        promises = prove.not_flipped((prove.FOLDER / f"{path.stem}_props.vh").read_text())
        words += re.sub(r"//.*", "", promises) + str(prove.known()[path.stem])
    words = " ".join(words.split())
    return hashlib.sha256(words.encode()).hexdigest()[:12]


def bench_arguments(module: str) -> list[str]:
    """Files of a module's tests and options, for pytest."""
    names = (BENCH_IN.get(module, module), *MORE_BENCHES.get(module, ()))
    files = [str(bench_file(name)) for name in names]
    return [*files, *(OF_CARD if files[0].startswith("tb/card/") else OF_MODULE)]


def benches() -> list[str]:
    return [path.stem for path in rtl_files() if bench_file(BENCH_IN.get(path.stem, path.stem))]
