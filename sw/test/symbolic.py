# SPDX-License-Identifier: Apache-2.0
"""Symbolic execution of a function of the firmware, as the card's compiler makes it (RV32I).

Registers and memory hold terms of z3. A branch that may go both ways splits the path. Everything that is not
understood raises NotProved: another instruction, relocation or jump, too many paths, no answer in time.

Sources: RISC-V unprivileged ISA 20191213 (RV32I 2.1), RISC-V ELF psABI 1.0.
"""

from __future__ import annotations

import itertools
import struct
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import z3

from sw.test.host import BUILDS, INCLUDES

COMPILER = "riscv64-unknown-elf-gcc"
FLAGS = (
    *("-std=c99", "-w", "-O1", "-g0", "-march=rv32i", "-mabi=ilp32", "-mno-relax", "-mcmodel=medlow"),
    *("-msmall-data-limit=0", "-ffreestanding", "-ffunction-sections", "-fdata-sections"),
    *("-fno-asynchronous-unwind-tables", "-fno-jump-tables", "-fno-optimize-sibling-calls"),
    *("-fwrapv", "-fno-strict-aliasing", "-fno-aggressive-loop-optimizations"),
    "-fno-delete-null-pointer-checks",
    # A function must keep to the ABI, whatever the compiler knows about its callers and callees.
    *("-fno-ipa-ra", "-fno-ipa-sra", "-fno-ipa-cp", "-fno-ipa-modref", "-fno-ipa-pure-const"),
    *("-fno-ipa-reference", "-fno-ipa-icf", "-fno-ipa-vrp", "-fno-ipa-bit-cp", "-fno-partial-inlining"),
)
SOLVER_MS = 10_000
LONGEST_S = 60  # a function
MOST_ROUNDS = 10  # of a loop that is not cut
MOST_STEPS = 20_000  # instructions of a function, over all paths

WORD = z3.BitVecSort(32)
RA, SP = 1, 2
# Of relocations.
R_32, R_BRANCH, R_JAL, R_CALL, R_CALL_PLT, R_HI20, R_LO12_I, R_LO12_S = 1, 16, 17, 18, 19, 26, 27, 28
SHF_WRITE, SHF_ALLOC, SHT_RELA, SHT_NOBITS, SHT_SYMTAB = 1, 2, 4, 8, 2


class NotProved(Exception):
    """The proof fails. The text names the difference, or what the execution does not understand."""


# ---------------------------------------------------------------- the object file


@dataclass(frozen=True)
class Reloc:
    kind: int
    name: str  # of a section here, or of a symbol elsewhere
    addend: int


@dataclass
class Section:
    name: str
    flags: int
    content: bytes  # of a variable without content: its size
    relocs: dict[int, tuple[Reloc, ...]] = field(default_factory=dict)
    shared: bool = False  # a global symbol names it

    @property
    def is_code(self) -> bool:
        return self.name.startswith(".text.")

    def refers_to(self, names: set[str]) -> bool:
        return any(reloc.name in names for relocs in self.relocs.values() for reloc in relocs)

    def like(self, other: Section) -> bool:
        same = (self.flags, self.content, self.relocs) == (other.flags, other.content, other.relocs)
        return same and self.shared == other.shared


def sections(path: Path) -> dict[str, Section]:
    """The sections of an object file that are loaded, without empty ones."""
    data = path.read_bytes()
    if data[:6] != b"\x7fELF\x01\x01":
        raise NotProved(f"{path.name}: no ELF of 32 bits, little-endian")
    at, size, count, names_at = *struct.unpack_from("<I", data, 32), *struct.unpack_from("<HHH", data, 46)
    heads = [struct.unpack_from("<10I", data, at + i * size) for i in range(count)]

    def text(table: int, offset: int) -> str:
        begin = heads[table][4] + offset
        return data[begin : data.index(b"\0", begin)].decode()

    names = [text(names_at, head[0]) for head in heads]
    found = {}
    for name, head in zip(names, heads, strict=True):
        if head[2] & SHF_ALLOC and head[5]:
            content = f"{head[5]} bytes".encode() if head[1] == SHT_NOBITS else data[head[4] :][: head[5]]
            if name in found or name == ".text":
                raise NotProved(f"a section {name} of more than one")
            found[name] = Section(name, head[2], content)
    table = next(head for head in heads if head[1] == SHT_SYMTAB)
    symbols = []  # (section or symbol, offset)
    for place in range(table[4], table[4] + table[5], 16):
        name, value, _, info, _, index = struct.unpack_from("<IIIBBH", data, place)
        if 0 < index < count:
            symbols.append((names[index], value))
            if info >> 4 and names[index] in found:
                found[names[index]].shared = True
                if found[names[index]].is_code and names[index] != f".text.{text(table[6], name)}":
                    raise NotProved(f"a second name of {names[index]}")
        else:
            symbols.append((text(table[6], name), 0))
    for head in heads:
        if head[1] == SHT_RELA and (section := found.get(names[head[7]])):
            for place in range(head[4], head[4] + head[5], 12):
                offset, info, addend = struct.unpack_from("<IIi", data, place)
                name, value = symbols[info >> 8]
                row = Reloc(info & 0xFF, name, value + addend)
                if row.kind in (R_BRANCH, R_JAL) and name == section.name and section.is_code:
                    section.content = jump_set(section.content, offset, row)
                    continue
                section.relocs[offset] = (*section.relocs.get(offset, ()), row)
    return found


def jump_set(content: bytes, at: int, reloc: Reloc) -> bytes:
    """The code with the offset of a jump or branch within it."""
    code, to = int.from_bytes(content[at : at + 4], "little"), reloc.addend - at
    if reloc.kind == R_BRANCH:
        bits = (to >> 12 & 1) << 31 | (to >> 5 & 63) << 25 | (to >> 1 & 15) << 8 | (to >> 11 & 1) << 7
        code, found = code & 0x01FFF07F | bits, branch_offset
    else:
        bits = (to >> 20 & 1) << 31 | (to >> 1 & 1023) << 21 | (to >> 11 & 1) << 20 | (to >> 12 & 255) << 12
        code, found = code & 0xFFF | bits, jump_offset
    if found(code) != to:
        raise NotProved(f"{at:x}: a jump too far")
    return content[:at] + code.to_bytes(4, "little") + content[at + 4 :]


def compiled(tree: Path, file: str, build: str, way: tuple[str, ...], target: Path) -> dict[str, Section]:
    """The sections of a source, in one build. A source that does not compile is not proved."""
    target.parent.mkdir(parents=True, exist_ok=True)
    command = [COMPILER, *FLAGS, *way, *INCLUDES, *BUILDS[build], "-c", file, "-o", str(target)]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotProved(f"{file}: {done.stderr.strip().splitlines()[-1]}")
    return sections(target)


# ---------------------------------------------------------------- the machine


@dataclass
class State:
    pc: int
    regs: list[z3.BitVecRef]
    memory: z3.ArrayRef
    path: tuple[z3.BoolRef, ...] = ()  # conditions of the branches taken
    rounds: tuple[int, ...] = ()  # targets of the backward branches taken

    def get(self, number: int) -> z3.BitVecRef:
        return self.regs[number] if number else z3.BitVecVal(0, 32)

    def put(self, number: int, value: z3.BitVecRef) -> None:
        if number:
            self.regs[number] = z3.simplify(value)

    def copy(self) -> State:
        return replace(self, regs=list(self.regs))


@dataclass(frozen=True)
class Stop:
    kind: str  # call, return, cut
    state: State  # with the pc after a call, or of the cut
    target: z3.BitVecRef | int = 0


def word(value: int) -> z3.BitVecRef:
    return z3.BitVecVal(value & 0xFFFFFFFF, 32)


def address_of(name: str) -> z3.BitVecRef:
    return z3.BitVec(f"&{name}", 32)


def low_part(name: str) -> z3.BitVecRef:
    """The lower 12 bits of an address; lui brings the address without it. Must cancel."""
    return z3.BitVec(f"%lo {name}", 32)


def variables(term: z3.ExprRef) -> set[str]:
    seen, found, todo = set(), set(), [term]
    while todo:
        one = todo.pop()
        if one.get_id() not in seen:
            seen.add(one.get_id())
            if z3.is_const(one) and one.decl().kind() == z3.Z3_OP_UNINTERPRETED:
                found.add(one.decl().name())
            todo += one.children()
    return found


def is_known(term: z3.ExprRef) -> bool:
    """A number, or an address of a symbol."""
    return all(name.startswith(("&", "%lo")) for name in variables(term))


def signed(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) & 1 else value


class Machine:
    """One function of one side."""

    def __init__(self, code: Section, constants: dict[str, Section], hidden: set[str], limit: Limit) -> None:
        self.code, self.constants, self.limit = code, constants, limit
        self.hidden = {f"&{name}" for name in hidden}
        if len(code.content) % 4:
            raise NotProved("an instruction of 16 bits")
        self.words = [word for (word,) in struct.iter_unpack("<I", code.content)]

    def targets(self, pc: int) -> list[int]:
        """The next instructions within the function."""
        word = self.words[pc // 4]
        opcode, rd = word & 0x7F, word >> 7 & 31
        if opcode == 0x63:
            return [pc + 4, pc + branch_offset(word)]
        if opcode == 0x6F and not rd and not self.relocs(pc):
            return [pc + jump_offset(word)]
        return [] if opcode == 0x67 and not rd else [pc + 4]

    def relocs(self, pc: int) -> tuple[Reloc, ...]:
        return self.code.relocs.get(pc, ())

    def loop_heads(self) -> list[int]:
        """Targets of the edges that close a loop."""
        heads, done, open_ = set(), set(), {0: iter(self.targets(0))}
        while open_:
            pc = next(reversed(open_))
            following = next(open_[pc], None)
            if following is None:
                del open_[pc]
                done.add(pc)
            elif following in open_:
                heads.add(following)
            elif following not in done:
                if not 0 <= following < 4 * len(self.words) or following % 4:
                    raise NotProved("a jump out of the function")
                open_[following] = iter(self.targets(following))
        return sorted(heads)

    def run(self, begin: State, cuts: list[int]) -> Iterator[Stop]:
        """All stops that this state can reach first."""
        todo, first = [begin.copy()], True
        while todo:
            state = todo.pop()
            while True:
                if not first and state.pc in cuts:
                    yield Stop("cut", state, cuts.index(state.pc))
                    break
                first = False
                self.limit.step()
                if not 0 <= state.pc < 4 * len(self.words):
                    raise NotProved("the end of the function")
                stop = self.step(state, todo)
                if stop is not None:
                    if stop.kind:
                        yield stop
                    break

    def step(self, state: State, todo: list[State]) -> Stop | None:
        """One instruction. A stop without a kind is a path that cannot be."""
        code, pc, relocs = self.words[state.pc // 4], state.pc, self.relocs(state.pc)
        opcode, rd, rs1, rs2 = code & 0x7F, code >> 7 & 31, code >> 15 & 31, code >> 20 & 31
        funct, high = code >> 12 & 7, code >> 25
        one, other = state.get(rs1), state.get(rs2)
        immediate = word(signed(code >> 20, 12))
        kinds = [reloc.kind for reloc in relocs]
        known = {0x37: R_HI20, 0x13: R_LO12_I, 0x03: R_LO12_I, 0x23: R_LO12_S}.get(opcode)
        if opcode == 0x17 and kinds in ([R_CALL], [R_CALL_PLT]):
            following = self.words[pc // 4 + 1]
            if relocs[0].addend or following & 0x7F != 0x67 or following >> 7 & 31 != RA:
                raise NotProved(f"{pc:x}: a call that is not understood")
            state.pc += 8
            return Stop("call", state, address_of(relocs[0].name))
        if opcode == 0x6F and kinds == [R_JAL] and rd == RA and not relocs[0].addend:
            state.pc += 4
            return Stop("call", state, address_of(relocs[0].name))
        if kinds and kinds != [known]:
            raise NotProved(f"{pc:x}: relocation {kinds}")
        low = low_part(relocs[0].name) + word(relocs[0].addend) if relocs else None
        state.pc += 4
        if opcode == 0x37:
            upper = (
                address_of(relocs[0].name) - low_part(relocs[0].name) if relocs else word(code & 0xFFFFF000)
            )
            state.put(rd, upper)
        elif opcode == 0x13:
            state.put(rd, computed(funct, one, low if relocs else immediate, high, True, pc))
        elif opcode == 0x33:
            state.put(rd, computed(funct, one, other, high, False, pc))
        elif opcode == 0x03:
            state.put(rd, self.load(state, funct, one + (low if relocs else immediate)))
        elif opcode == 0x23:
            immediate = word(signed(high << 5 | rd, 12))
            self.store(state, funct, one + (low if relocs else immediate), other)
        elif opcode == 0x63:
            return self.branch(state, funct, one, other, pc + branch_offset(code), todo)
        elif opcode == 0x6F and rd == 0:
            self.jump(state, pc + jump_offset(code))
        elif opcode == 0x67 and rd == RA and funct == 0:
            return Stop("call", state, z3.simplify(one + immediate))
        elif opcode == 0x67 and rd == 0 and rs1 == RA and code >> 20 == 0 and funct == 0:
            return Stop("return", state, one)
        else:
            raise NotProved(f"{pc:x}: instruction {code:08x}")
        return None

    def branch(
        self, state: State, funct: int, one: z3.BitVecRef, other: z3.BitVecRef, to: int, todo: list[State]
    ) -> Stop | None:
        conditions = {0: one == other, 4: one < other, 6: z3.ULT(one, other)}
        if funct & 6 not in conditions and funct not in conditions:
            raise NotProved(f"{state.pc:x}: branch {funct}")
        condition = conditions[funct & 6]
        condition = z3.simplify(z3.Not(condition) if funct & 1 else condition)
        ways = []
        for pc, taken in ((to, condition), (state.pc, z3.simplify(z3.Not(condition)))):
            if self.limit.possible(state.path, taken):
                ways.append(self.jump(replace(state.copy(), path=(*state.path, taken)), pc))
        todo += ways[1:]
        if not ways:
            return Stop("", state)
        state.pc, state.path, state.rounds = ways[0].pc, ways[0].path, ways[0].rounds
        return None

    def jump(self, state: State, to: int) -> State:
        if to < state.pc:
            if state.rounds.count(to) == MOST_ROUNDS:
                raise NotProved(f"a loop of more than {MOST_ROUNDS} rounds")
            state.rounds += (to,)
        state.pc = to
        return state

    def constant(self, address: z3.BitVecRef, size: int) -> z3.BitVecRef | None:
        """What a constant of a hidden address holds there; None: the address is another."""
        names = self.hidden & variables(address)
        if not names:
            return None
        (name, *more) = names
        offset = z3.simplify(address - z3.BitVec(name, 32))
        if more or not z3.is_bv_value(offset):
            raise NotProved(f"a read at an unknown place of {name}")
        section, at = self.constants[name[1:]], offset.as_long()
        if at + size > len(section.content):
            raise NotProved(f"a read beyond {name}")
        relocs = [section.relocs.get(place, ()) for place in range(at - 3, at + size)]
        if any(relocs):
            reloc = section.relocs.get(at, ())
            if size != 4 or len(reloc) != 1 or reloc[0].kind != R_32 or sum(map(len, relocs)) != 1:
                raise NotProved(f"a read of a part of an address in {name}")
            return address_of(reloc[0].name) + word(reloc[0].addend)
        return z3.BitVecVal(int.from_bytes(section.content[at : at + size], "little"), 8 * size)

    def load(self, state: State, funct: int, address: z3.BitVecRef) -> z3.BitVecRef:
        if funct not in (0, 1, 2, 4, 5):
            raise NotProved(f"load {funct}")
        address, size = z3.simplify(address), 1 << (funct & 3)
        value = self.constant(address, size)
        if value is None:
            self.no_part(address)
            parts = [read_memory(state.memory, address + word(i)) for i in range(size)]
            value = z3.Concat(*reversed(parts)) if size > 1 else parts[0]
        if size == 4:
            return value
        return (z3.ZeroExt if funct & 4 else z3.SignExt)(32 - 8 * size, value)

    def store(self, state: State, funct: int, address: z3.BitVecRef, value: z3.BitVecRef) -> None:
        if funct > 2:
            raise NotProved(f"store {funct}")
        address = z3.simplify(address)
        self.no_secret(address)
        self.no_secret(value)
        for i in range(1 << funct):
            place = z3.simplify(address + word(i))
            state.memory = z3.Store(state.memory, place, z3.simplify(z3.Extract(8 * i + 7, 8 * i, value)))

    def no_part(self, *terms: z3.ExprRef) -> None:
        if any(name.startswith("%lo") for term in terms for name in variables(term)):
            raise NotProved("a part of an address")

    def no_secret(self, *terms: z3.ExprRef) -> None:
        """Neither the address of a constant that differs, nor a part of any address."""
        self.no_part(*terms)
        if any(self.hidden & variables(term) for term in terms):
            raise NotProved("the address of a constant that differs leaves the function")


def read_memory(memory: z3.ArrayRef, address: z3.BitVecRef) -> z3.BitVecRef:
    """A byte. Stores at a known distance are looked up here, the others by the solver."""
    address = z3.simplify(address)
    while z3.is_store(memory):
        distance = z3.simplify(memory.arg(1) - address)
        if not z3.is_bv_value(distance):
            break
        if distance.as_long() == 0:
            return memory.arg(2)
        memory = memory.arg(0)
    return z3.Select(memory, address)


def computed(
    funct: int, one: z3.BitVecRef, other: z3.BitVecRef, high: int, immediate: bool, pc: int
) -> z3.BitVecRef:
    """Result of OP and OP-IMM; high: the 7 upper bits of the instruction."""
    shift = funct in (1, 5)
    if (shift or not immediate) and high not in (
        (0, 0x20) if funct == 5 or (funct, immediate) == (0, False) else (0,)
    ):
        raise NotProved(f"{pc:x}: operation {funct} {high}")
    if shift:
        other = other & word(31)
    results = {
        0: lambda: one - other if high == 0x20 and not immediate else one + other,
        1: lambda: one << other,
        2: lambda: z3.If(one < other, word(1), word(0)),
        3: lambda: z3.If(z3.ULT(one, other), word(1), word(0)),
        4: lambda: one ^ other,
        5: lambda: one >> other if high == 0x20 else z3.LShR(one, other),
        6: lambda: one | other,
        7: lambda: one & other,
    }
    return results[funct]()


def branch_offset(code: int) -> int:
    bits = (code >> 31) << 12 | (code >> 7 & 1) << 11 | (code >> 25 & 63) << 5 | (code >> 8 & 15) << 1
    return signed(bits, 13)


def jump_offset(code: int) -> int:
    bits = (code >> 31) << 20 | (code >> 12 & 255) << 12 | (code >> 20 & 1) << 11 | (code >> 21 & 1023) << 1
    return signed(bits, 21)


# ---------------------------------------------------------------- time and solver


class Limit:
    """The time and the steps of one proof, and its solver."""

    def __init__(self, addresses: set[str], solver_ms: int = SOLVER_MS, longest_s: float = LONGEST_S) -> None:
        self.steps, self.solver_ms = 0, solver_ms
        self.longest_s, self.end = longest_s, time.monotonic() + longest_s
        self.numbers = itertools.count()
        # No object is at the address 0, and none reaches over the end of the memory.
        self.facts = [
            z3.And(z3.UGE(address_of(name), word(4)), z3.ULE(address_of(name), word(0xFFFF0000)))
            for name in sorted(addresses)
        ]

    def step(self) -> None:
        self.steps += 1
        if self.steps > MOST_STEPS:
            raise NotProved("too many paths")

    def answer(self, *terms: z3.BoolRef) -> z3.CheckSatResult:
        if time.monotonic() > self.end:
            raise NotProved(f"no end within {self.longest_s} s")
        solver = z3.Solver()
        solver.set(timeout=self.solver_ms)
        solver.add(*self.facts, *terms)
        return solver.check()

    def possible(self, path: tuple[z3.BoolRef, ...], condition: z3.BoolRef) -> bool:
        """Without an answer it is taken as possible."""
        if z3.is_true(condition) or z3.is_false(condition):
            return z3.is_true(condition)
        return self.answer(*path, condition) != z3.unsat

    def holds(self, path: tuple[z3.BoolRef, ...], claim: z3.BoolRef) -> bool:
        claim = z3.simplify(claim)
        return z3.is_true(claim) or self.answer(*path, z3.Not(claim)) == z3.unsat

    def fresh(self) -> z3.BitVecRef:
        return z3.BitVec(f"v{next(self.numbers)}", 32)

    def fresh_memory(self) -> z3.ArrayRef:
        return z3.Array(f"m{next(self.numbers)}", WORD, z3.BitVecSort(8))
