# SPDX-License-Identifier: Apache-2.0
"""Who uses a field of a struct, and which values it may hold: facts for sw/test/contracts.py.

Each source is compiled twice, the second time with the field at another place of its struct. The loads and
stores with another offset are those of the field. Any other difference refuses the proof: somebody takes the
field's address. C code that reaches the field without its name is undefined, or copies a whole struct, whose
field keeps its bound.

A field starts as 0, as its struct does. If every store keeps it below a bound, it never exceeds the bound.
"""

from __future__ import annotations

import re
import shutil
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import z3

from sw.test.compare import SAVED
from sw.test.host import ROOT, sources
from sw.test.symbolic import Limit, Machine, NotProved, Section, State, compiled, signed

Sections = dict[str, Section]
LOAD, STORE = 0x03, 0x23
OFFSET = {LOAD: 0xFFF00000, STORE: 0xFE000F80}  # bits of an instruction


@dataclass(frozen=True)
class Field:
    struct: str
    name: str
    header: str
    before: str  # the member behind padding, which takes the moved field


NEXT = Field("struct gateway", "next", "gateway.h", "struct leds leds;")
REPLY_OUTCOME = Field("struct gateway", "reply_outcome", "gateway.h", "struct leds leds;")
EXPECTS = Field("struct transaction", "expects", "transaction.h", "OUT_FRAMES")

_kept: dict[tuple[object, ...], Sections] = {}
_trees: dict[Path, Field] = {}


@dataclass(frozen=True)
class Originals:
    """The sections of the project's own sources in one build, compiled in one way."""

    build: str
    way: tuple[str, ...]
    folder: Path  # for object files and trees

    def __call__(self, file: str) -> Sections:
        return self._compiled(ROOT, file)

    def moved(self, file: str, field: Field) -> Sections:
        """As the file is with the field at another place."""
        tree = self.folder / f"moved-{field.name}"
        if _trees.get(tree) != field or not tree.exists():
            shutil.rmtree(tree, ignore_errors=True)
            shutil.copytree(ROOT / "sw", tree / "sw", ignore=shutil.ignore_patterns("corpus"))
            shutil.copytree(ROOT / "regs/generated", tree / "regs/generated")
            header = tree / "sw/include" / field.header
            header.write_text(moved(header.read_text(), field))
            _trees[tree] = field
        return self._compiled(tree, file)

    def _compiled(self, tree: Path, file: str) -> Sections:
        place = (tree, file, self.build, self.way)
        if place not in _kept:
            _kept[place] = compiled(tree, file, self.build, self.way, self.folder / "original.o")
        return _kept[place]

    def value(self, expression: str, *headers: str) -> int:
        """A constant of C."""
        text = "".join(f'#include "{header}"\n' for header in ("stddef.h", "stdint.h", *headers))
        path = self.folder / "value.c"
        self.folder.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}const uint32_t value = (uint32_t)({expression});\n")
        section = compiled(ROOT, str(path.absolute()), self.build, self.way, self.folder / "value.o")
        return struct.unpack("<I", section[".rodata.value"].content)[0]

    def offset(self, field: Field) -> int:
        return self.value(f"offsetof({field.struct}, {field.name})", field.header)


def moved(text: str, field: Field) -> str:
    """The header with the field before another member, and another byte in its place."""
    begin = text.index(f"{field.struct} {{")
    end = text.index("\n};", begin)
    line = re.compile(rf"^ *uint8_t {field.name};", re.MULTILINE)
    body, count = line.subn("    uint8_t vacant;", text[begin:end])
    if count != 1 or body.count(field.before) != 1:
        raise NotProved(f"no field {field.name} of a byte")
    body = body.replace(field.before, f"uint8_t {field.name};\n    {field.before}")
    return text[:begin] + body + text[end:]


# ---------------------------------------------------------------- who uses a field


def offset_of(code: int) -> int:
    high = code >> 20 if code & 0x7F == LOAD else code >> 25 << 5 | code >> 7 & 31
    return signed(high, 12)


def uses(one: Section, other: Section) -> set[int]:
    """Places of the instructions that load or store the field, which lies elsewhere in the other section."""
    if len(one.content) != len(other.content) or one.relocs != other.relocs:
        raise NotProved(f"{one.name}: more than the field's place is another")
    found, distances = set(), set()
    for at in range(0, len(one.content), 4):
        here, there = (int.from_bytes(section.content[at : at + 4], "little") for section in (one, other))
        if here == there:
            continue
        if (here ^ there) & ~OFFSET.get(here & 0x7F, 0):
            raise NotProved(f"{one.name}: another use of the field than a load or store")
        found.add(at)
        distances.add(offset_of(there) - offset_of(here))
    if len(distances) > 1:
        raise NotProved(f"{one.name}: more than one field moves")
    return found


def users(source: Originals, field: Field) -> Iterator[tuple[str, Section, set[int], set[int]]]:
    """The functions of all sources that use the field: file, code, places of the loads, and of the stores."""
    for file in (*sources(), "sw/src/main.c"):
        before, after = source(file), source.moved(file, field)
        if before.keys() != after.keys():
            raise NotProved(f"{file}: more than the field's place is another")
        for name, section in before.items():
            if not section.is_code:
                if not section.like(after[name]):
                    raise NotProved(f"{file}: {name} has the field")
                continue
            places = uses(section, after[name])
            stores = {at for at in places if section.content[at] & 0x7F == STORE}
            if places:
                yield file, section, places - stores, stores


# ---------------------------------------------------------------- what a field may hold


class Watched(Machine):
    """Each of the stores at some places must be of a byte up to a bound."""

    def __init__(self, code: Section, limit: Limit, places: set[int] = frozenset(), most: int = 0) -> None:
        super().__init__(code, {}, set(), limit)
        self.places, self.most = places, most

    def store(self, state: State, funct: int, address: z3.BitVecRef, value: z3.BitVecRef) -> None:
        if state.pc - 4 in self.places:
            claim = z3.ULE(z3.Extract(7, 0, value), self.most)
            if funct or not self.limit.holds(state.path, claim):
                raise NotProved(f"{self.code.name}: a field may exceed {self.most}")
        super().store(state, funct, address, value)

    def no_secret(self, *terms: z3.ExprRef) -> None:
        """Nothing is compared here."""

    def ends(self, result: Callable[[z3.BitVecRef, z3.BitVecRef], tuple[z3.BoolRef, ...]]) -> Iterator[State]:
        """The states in which the function may return, from any state.

        result: what holds of the result of the function at an address.
        """
        heads = self.loop_heads()
        for start in (0, *heads):
            regs = [self.limit.fresh() for _ in range(32)]
            todo = [State(start, regs, self.limit.fresh_memory())]
            while todo:
                for stop in self.run(todo.pop(), heads):
                    if stop.kind == "call":
                        after = [stop.state.regs[i] if i in SAVED else self.limit.fresh() for i in range(32)]
                        path = (*stop.state.path, *result(stop.target, after[10]))
                        todo.append(State(stop.state.pc, after, self.limit.fresh_memory(), path))
                    elif stop.kind == "return":
                        yield stop.state


class Bounds:
    """Which functions of a build return no more than a bound."""

    def __init__(self, source: Originals, most: int) -> None:
        self.source, self.most = source, most
        self.known: dict[str, bool] = {}
        self.sections = {}
        for file in sources():
            for section in source(file).values():
                if section.is_code and section.shared:
                    self.sections[section.name] = (section, file)

    def of_call(self, file: str) -> Callable[[z3.BitVecRef, z3.BitVecRef], tuple[z3.BoolRef, ...]]:
        def result(target: z3.BitVecRef, value: z3.BitVecRef) -> tuple[z3.BoolRef, ...]:
            name = ".text." + str(target).removeprefix("&").removeprefix(".text.")
            return (z3.ULE(value, self.most),) if z3.is_const(target) and self.holds(name, file) else ()

        return result

    def holds(self, name: str, file: str) -> bool:
        here = self.source(file)
        section, file = (here[name], file) if name in here else self.sections.get(name, (None, ""))
        place = f"{file} {name}"
        if place not in self.known:
            self.known[place] = False  # within a call of itself
            if section:
                try:
                    limit = Limit(set())
                    self.known[place] = all(
                        limit.holds(state.path, z3.ULE(state.regs[10], self.most))
                        for state in Watched(section, limit).ends(self.of_call(file))
                    )
                except NotProved:
                    pass
        return self.known[place]


def never_exceeds(source: Originals, field: Field, most: int) -> None:
    """Raises NotProved, unless every store of the field is of at most `most`."""
    bounds = Bounds(source, most)
    for file, section, _, stores in users(source, field):
        if stores:
            for _ in Watched(section, Limit(set()), stores, most).ends(bounds.of_call(file)):
                pass
