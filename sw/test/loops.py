# SPDX-License-Identifier: Apache-2.0
"""The loops of the firmware and their bounds (sw/test/loops.toml).

    python -m sw.test.loops --check          exit 1 for a loop of sw/src without a bound, or the reverse
    python -m sw.test.loops --instrument DIR writes copies of sw/src that abort beyond a bound
    --tree DIR                               the tree to read (default: this one)

The copies call sw/test/loops.c; lines keep their numbers.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import tree_sitter_c
from tree_sitter import Language, Node, Parser

from rtl.command import run_main

ROOT = Path(__file__).resolve().parents[2]
SOURCES = Path("sw/src")
BOUNDS = ROOT / "sw/test/loops.toml"
LOOPS = {"for_statement", "while_statement", "do_statement"}
parser = Parser(Language(tree_sitter_c.language()))


@dataclass(frozen=True)
class Loop:
    file: str
    function: str
    head: str


def nodes(node: Node) -> Iterator[Node]:
    yield node
    for child in node.children:
        yield from nodes(child)


def function_of(node: Node) -> str:
    while node.type != "function_definition":
        node = node.parent
    return next(
        n for n in nodes(node.child_by_field_name("declarator")) if n.type == "identifier"
    ).text.decode()


def loops_of(path: Path) -> list[tuple[Loop, Node]]:
    found = []
    for node in nodes(parser.parse(path.read_bytes()).root_node):
        if node.type in LOOPS:
            body = node.child_by_field_name("body")
            head = path.read_bytes()[node.start_byte : body.start_byte].decode()
            if node.type == "do_statement":
                head += f" while {node.child_by_field_name('condition').text.decode()}"
            found.append((Loop(path.name, function_of(node), " ".join(head.split())), node))
    return found


def bounds() -> dict[Loop, tuple[int, str]]:
    rows = tomllib.loads(BOUNDS.read_text())["loop"]
    return {Loop(row["file"], row["function"], row["head"]): (row["most"], row["why"]) for row in rows}


def differences(tree: Path = ROOT) -> list[str]:
    """Loops without a bound, and bounds without a loop."""
    there = [loop for path in sorted((tree / SOURCES).glob("*.c")) for loop, _ in loops_of(path)]
    stated = bounds()
    wrong = [
        f"{loop.file}: {loop.function}: no bound for `{loop.head}`" for loop in there if loop not in stated
    ]
    wrong += [
        f"{loop.file}: {loop.function}: twice `{loop.head}`" for loop in set(there) if there.count(loop) > 1
    ]
    return wrong + [
        f"loops.toml: {loop.file}: {loop.function} has no `{loop.head}`"
        for loop in stated
        if loop not in there
    ]


def instrumented(path: Path, numbers: dict[Loop, int]) -> str:
    """The source with a counter for each loop, incremented at the start of its body."""
    text = path.read_bytes()
    inserts: list[tuple[int, str]] = []
    for loop, node in loops_of(path):
        body, number = node.child_by_field_name("body"), numbers[loop]
        step = f"loop_step({number}, ++loop_{number});"
        before = node.prev_sibling
        # A #pragma stays directly before its loop, on a line of its own.
        begin = before.start_byte - 1 if before and before.type == "preproc_call" else node.start_byte
        inserts.append((begin, f"{{ unsigned long loop_{number} = 0; "))
        if body.type == "compound_statement":
            inserts.append((body.start_byte + 1, f" {step}"))
            inserts.append((node.end_byte, " }"))
        else:
            inserts.append((body.start_byte, f"{{ {step} "))
            inserts.append((node.end_byte, " } }"))
    for at, insert in sorted(inserts, reverse=True):
        text = text[:at] + insert.encode() + text[at:]
    return f'#include "loops.h"\n#line 1 "{SOURCES / path.name}"\n{text.decode()}'


def instrument(folder: Path, tree: Path = ROOT) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    stated = bounds()
    numbers = {loop: number for number, loop in enumerate(stated)}
    for path in (tree / SOURCES).glob("*.c"):
        (folder / path.name).write_text(instrumented(path, numbers))
    rows = "".join(
        f'    {{"{loop.file}: {loop.function}: {loop.head}", {most}, 0}},\n'
        for loop, (most, _) in stated.items()
    )
    (folder / "loop_table.h").write_text(f"static struct loop loops[] = {{\n{rows}}};\n")


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    mode = options.add_mutually_exclusive_group(required=True)
    mode.add_argument("--check", action="store_true", help="compare the list with the sources")
    mode.add_argument("--instrument", type=Path, metavar="DIR", help="write copies that count rounds")
    options.add_argument("--tree", type=Path, default=ROOT, metavar="DIR", help="where sw/src lies")
    given = options.parse_args()
    wrong = differences(given.tree)
    for line in wrong:
        print(line, file=sys.stderr)
    if wrong:
        return 1
    if given.check:
        print(f"{len(bounds())} loops, each with its bound")
    else:
        instrument(given.instrument, given.tree)
    return 0


if __name__ == "__main__":
    run_main("loops", main)
