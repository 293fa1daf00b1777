# SPDX-License-Identifier: Apache-2.0
"""The deepest stack of the firmware, from its call graph.

    python -m sw.tools.stack [ELF]     prints bytes and path; default: build/firmware.elf; exit 2 on an error

`make bench` reports the figure, sw/firmware.mk reserves the memory. The linked code is read: the frame of a
function is the largest n of its `add sp,sp,-n`; its callees are the targets of jumps out of the function. A
call through a pointer may reach every function whose address is a constant. Recursion and frames of variable
size are errors; the firmware's rules forbid both.
"""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ELF = ROOT / "build/firmware.elf"
PREFIX = "riscv64-unknown-elf-"

HEAD = re.compile(r"^([0-9a-f]+) <([^>]+)>:$")
CODE = re.compile(r"^\s*([0-9a-f]+):\s+[0-9a-f]+\s+(\S+)(?:\s+(.*))?$")
TARGET = re.compile(r"\b([0-9a-f]+) <([^>+]+)>$")
FRAME = re.compile(r"^sp,sp,(-?\d+)$")  # entry and exit of a function
ENTRY = "_start"  # sets sp, has no frame
CALLS = {"jal", "call"}
JUMPS = CALLS | {"j", "tail"}
INDIRECT = {"jalr", "jr"}


def reserved() -> int:
    """Bytes that the linker keeps for the stack in every image."""
    makefile = (ROOT / "sw/firmware.mk").read_text()
    return int(re.search(r"^FIRMWARE_STACK := (\d+)$", makefile, re.MULTILINE)[1])


class StackError(Exception):
    """The error message, one line."""


@dataclass
class Function:
    frame: int = 0  # bytes
    callees: set[str] = field(default_factory=set)
    by_pointer: bool = False


def _tool(name: str, *arguments: str | Path) -> str:
    return subprocess.run(
        [PREFIX + name, *map(str, arguments)], capture_output=True, text=True, check=True
    ).stdout


@cache
def symbols(elf: Path = ELF) -> dict[str, int]:
    """Address of every symbol."""
    return {line.split()[2]: int(line.split()[0], 16) for line in _tool("nm", elf).splitlines()}


def sizes(elf: Path = ELF) -> tuple[int, int]:
    """Bytes of code and constants, and of variables."""
    text, data, bss = map(int, _tool("size", elf).splitlines()[1].split()[:3])
    return text, data + bss


def functions(elf: Path = ELF) -> dict[str, Function]:
    found: dict[str, Function] = {}
    current = ""
    for line in _tool("objdump", "-d", elf).splitlines():
        if head := HEAD.match(line):
            current = head[2]
            found[current] = Function()
        elif current and (code := CODE.match(line)):
            mnemonic, operands = code[2], (code[3] or "").strip()
            function = found[current]
            if step := FRAME.match(operands):
                function.frame = max(function.frame, -int(step[1]))
            elif operands.startswith("sp,") and current != ENTRY:
                raise StackError(f"{current}: a frame of variable size ({mnemonic} {operands})")
            # A jump to the start of the same function is a loop; a call of it is recursion.
            target = TARGET.search(operands) if mnemonic in JUMPS else None
            if target and (target[2] != current or mnemonic in CALLS):
                function.callees.add(target[2])
            function.by_pointer |= mnemonic in INDIRECT and operands != "ra"
    # The linker's constants, such as STACK_SIZE, also name an address inside a function.
    for function in found.values():
        function.callees &= found.keys()
    return found


def pointed_at(elf: Path, names: set[str]) -> set[str]:
    """Functions whose address is a word of the constants or an initial value of a variable."""
    # A constant 0 is no pointer to the entry, which is at address 0.
    at = {address: name for name, address in symbols(elf).items() if name in names - {ENTRY}}
    words, counts = set(), False
    for line in _tool("objdump", "-s", elf).splitlines():
        if section := re.match(r"^Contents of section (\S+):", line):
            counts = section[1].startswith((".rodata", ".data", ".sdata"))
        elif counts and (dump := re.match(r"^ [0-9a-f]+ ((?:[0-9a-f]{8} ?)+) ", line)):
            words |= {int.from_bytes(bytes.fromhex(word), "little") for word in dump[1].split()}
    return {at[word] for word in words & at.keys()}


def deepest(elf: Path = ELF) -> tuple[int, list[str]]:
    """Bytes, and the path of calls that needs them."""
    graph = functions(elf)
    anywhere = pointed_at(elf, set(graph))
    for name, function in graph.items():
        if function.by_pointer:
            if not anywhere:
                raise StackError(f"{name} calls through a pointer, but no function has its address taken")
            function.callees |= anywhere
    known: dict[str, tuple[int, list[str]]] = {}

    def depth(name: str, above: tuple[str, ...]) -> tuple[int, list[str]]:
        if name in above:
            raise StackError(f"recursion: {' -> '.join([*above, name])}")
        if name not in known:
            below = [depth(callee, (*above, name)) for callee in sorted(graph[name].callees)]
            size, path = max(below, default=(0, []))
            known[name] = (graph[name].frame + size, [name, *path])
        return known[name]

    return depth(ENTRY, ())


def main() -> int:
    elf = Path(sys.argv[1]) if len(sys.argv) > 1 else ELF
    try:
        size, path = deepest(elf)
    except (StackError, subprocess.CalledProcessError, FileNotFoundError) as error:
        print(f"stack: {error}", file=sys.stderr)
        return 2
    graph = functions(elf)
    print(f"{size} bytes: " + " > ".join(f"{name} {graph[name].frame}" for name in path))
    return 0


if __name__ == "__main__":
    sys.exit(main())
