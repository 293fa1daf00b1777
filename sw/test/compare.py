# SPDX-License-Identifier: Apache-2.0
"""Compares a function of the firmware on two sides: the original and a changed one. See sw/test/same.py."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import z3

from sw.test.host import ROOT
from sw.test.loops import nodes, parser
from sw.test.symbolic import RA, SP, Limit, Machine, NotProved, Section, State, Stop, is_known, signed, word

SOURCES = ("sw/src/*.[ch]", "sw/port/host/*.[ch]", "sw/include/*.h")
SAVED = (2, 3, 4, 8, 9, *range(18, 28))  # sp, gp, tp, s0-s11
ARGUMENTS = range(10, 18)
# An argument or result with one of these words takes one register, unless another says more.
ONE_REGISTER = {"uint8_t", "uint16_t", "uint32_t", "int", "bool", "unsigned", "char", "enum"}
MORE_REGISTERS = {"long", "struct", "union", "double", "float"}


# ---------------------------------------------------------------- signatures


def takes_one_register(text: str) -> bool:
    words = set(re.findall(r"\w+", text))
    return "*" in text or (bool(words & ONE_REGISTER) and not words & MORE_REGISTERS)


@cache
def signatures() -> dict[str, tuple[int, int]]:
    """Registers of the arguments and of the result of each function. The most, if a name has several."""
    found: dict[str, tuple[int, int]] = {}
    for path in sorted(path for pattern in SOURCES for path in ROOT.glob(pattern)):
        for node in nodes(parser.parse(path.read_bytes()).root_node):
            if node.type != "function_definition":
                continue
            outer = inner = node.child_by_field_name("declarator")
            while inner.type == "pointer_declarator":
                inner = inner.child_by_field_name("declarator")
            if inner.type != "function_declarator" or inner.has_error:
                continue
            name = inner.child_by_field_name("declarator").text.decode()
            given = [child.text.decode() for child in inner.child_by_field_name("parameters").named_children]
            given = [] if given == ["void"] else given
            plain = all(map(takes_one_register, given))
            kind = node.child_by_field_name("type").text.decode()
            short = outer is not inner or takes_one_register(kind)
            result = 1 if short else 0 if kind == "void" else 2
            numbers = len(given) if plain and len(given) <= 8 else 8, result
            found[name] = tuple(map(max, numbers, found.get(name, numbers)))
    return found


# ---------------------------------------------------------------- two sides


class Comparison:
    """A function on both sides, with its loops cut at their heads, or not cut."""

    def __init__(self, name: str, machines: tuple[Machine, Machine], cut: bool) -> None:
        self.name, self.machines, self.limit = name, machines, machines[0].limit
        self.cuts = tuple(machine.loop_heads() if cut else [] for machine in machines)
        if len(self.cuts[0]) != len(self.cuts[1]):
            raise NotProved("another number of loops")
        self.dropped: list[set[int]] = [set() for _ in self.cuts[0]]  # registers, at each cut
        # Registers that have the same known value whenever a side is at a cut; empty: not reached yet.
        self.fixed: list[list[dict[int, z3.BitVecRef]]] = [[] for _ in self.cuts[0]]
        self.again = False
        self.result = signatures().get(name, (8, 2))[1]

    def facts(self, memory: z3.ArrayRef) -> tuple[z3.BoolRef, ...]:
        """What is known of a memory at the begin and after a call."""
        return ()

    def first_facts(self, memory: z3.ArrayRef) -> tuple[z3.BoolRef, ...]:
        """What is known of the memory at the begin."""
        return self.facts(memory)

    def stops(self, side: int, begin: State) -> Iterator[Stop]:
        yield from self.machines[side].run(begin, self.cuts[side])

    def prove(self) -> None:
        """Raises NotProved."""
        while not self.round():
            pass

    def round(self) -> bool:
        """False if a register was dropped, or has no known value any more."""
        self.again = False
        reached: set[int] = set()
        waiting = [(0, 0, None)]
        while waiting:
            *starts, cut = waiting.pop()
            for number in self.explore(*starts, cut):
                if number not in reached:
                    reached.add(number)
                    waiting.append((self.cuts[0][number], self.cuts[1][number], number))
        return not self.again

    def explore(self, first: int, second: int, cut: int | None) -> Iterator[int]:
        """The cuts that are reached from equal states. At a cut, registers may have been dropped."""
        memory, regs = self.limit.fresh_memory(), [self.limit.fresh() for _ in range(32)]
        others, self.stack, self.entry = list(regs), regs[SP], list(regs)
        if cut is not None:
            for i in self.dropped[cut]:
                others[i] = self.limit.fresh()
            for side, values in zip((regs, others), self.fixed[cut], strict=True):
                for i, value in values.items():
                    side[i] = value
        path = self.first_facts(memory) if cut is None else ()
        todo = [(State(first, regs, memory, path), State(second, others, memory, path))]
        while todo:
            one, other = todo.pop()
            for left in self.stops(0, one):
                begin = replace(other, path=left.state.path)
                for right in self.stops(1, begin):
                    if left.kind != right.kind:
                        raise NotProved(f"a {left.kind} for a {right.kind}")
                    if left.kind == "cut":
                        yield self.compare_cut(left, right)
                    elif left.kind == "call":
                        todo.append(self.compare_call(left, right))
                    else:
                        self.compare_return(left, right)

    def equal(self, what: str, path: tuple[z3.BoolRef, ...], one: z3.ExprRef, other: z3.ExprRef) -> None:
        if not self.limit.holds(path, one == other):
            raise NotProved(f"{what} may differ")

    def compare_memory(self, left: Stop, right: Stop, dead_below: z3.BitVecRef | None = None) -> None:
        one, other, at = left.state.memory, right.state.memory, self.limit.fresh()
        if one.eq(other) or self.stores_alike(one, other, right.state.path):
            return
        # What the hardware sees keeps its order. The stack has its own in each code.
        orders = [
            [store for store in stores_of(memory)[1] if not self.unseen(store)] for memory in (one, other)
        ]
        if not self.pairs_alike(*orders, right.state.path):
            raise NotProved(f"stores before a {left.kind} may differ")
        claim = z3.Select(one, at) == z3.Select(other, at)
        if dead_below is not None:
            depth = dead_below - at
            claim = z3.Or(claim, z3.And(z3.UGE(depth, word(1)), z3.ULE(depth, word(self.frame()))))
        if not self.limit.holds(right.state.path, claim):
            raise NotProved(f"memory at a {left.kind} may differ")

    def stores_alike(self, one: z3.ArrayRef, other: z3.ArrayRef, path: tuple[z3.BoolRef, ...]) -> bool:
        """Whether the same bytes were stored at the same places in this order. It is the faster way."""
        before, stores = stores_of(one)
        begun, others = stores_of(other)
        if not before.eq(begun) or len(stores) != len(others):
            return False
        return self.pairs_alike(stores, others, path, True)

    def pairs_alike(
        self,
        stores: list[z3.ArrayRef],
        others: list[z3.ArrayRef],
        path: tuple[z3.BoolRef, ...],
        all_: bool = False,
    ) -> bool:
        """The same places and bytes in this order; all_: no other store came between."""
        if len(stores) != len(others):
            return False
        equal: list[tuple[z3.ExprRef, z3.ExprRef]] = []
        for left, right in zip(stores, others, strict=True):
            for i in (1, 2):
                value = z3.simplify(z3.substitute(right.arg(i), *equal)) if equal else right.arg(i)
                if not value.eq(left.arg(i)) and not self.limit.holds(path, left.arg(i) == value):
                    return False
            if all_:
                equal.append((right, left))
        return True

    def unseen(self, store: z3.ArrayRef) -> bool:
        """A store whose order does not count: on the stack."""
        return z3.is_bv_value(z3.simplify(store.arg(1) - self.stack))

    def frame(self) -> int:
        """Bytes of the deeper stack frame."""
        sizes = [0]
        for machine in self.machines:
            for code in machine.words:
                if code & 0xFFFFF == 0x10113:  # addi sp, sp, n
                    sizes.append(-signed(code >> 20, 12))
        return max(sizes)

    def compare_cut(self, left: Stop, right: Stop) -> int:
        if left.target != right.target:
            raise NotProved("another loop")
        fixed, dropped = self.fixed[left.target], self.dropped[left.target]
        if not fixed:
            fixed += [
                {i: value for i, value in enumerate(stop.state.regs) if i and is_known(value)}
                for stop in (left, right)
            ]
        for stop, machine, values in zip((left, right), self.machines, fixed, strict=True):
            for i in [i for i, value in values.items() if not value.eq(stop.state.regs[i])]:
                del values[i]
                self.again = True
            machine.no_secret(*(stop.state.regs[i] for i in range(1, 32) if i not in values))
        self.compare_memory(left, right)
        for i in set(range(1, 32)) - dropped:
            if not self.limit.holds(right.state.path, left.state.regs[i] == right.state.regs[i]):
                dropped.add(i)
                self.again = True
        return left.target

    def compare_call(self, left: Stop, right: Stop) -> tuple[State, State]:
        path = right.state.path
        if not left.target.eq(right.target):
            self.equal("the function called", path, left.target, right.target)
        name = str(left.target).removeprefix("&").removeprefix(".text.") if z3.is_const(left.target) else ""
        name = name if left.target.eq(right.target) else ""
        count = signatures().get(name, (8, 2))[0]
        for i in [SP, *ARGUMENTS[:count]]:
            self.equal(f"an argument of {name or 'a call'}", path, left.state.regs[i], right.state.regs[i])
        self.compare_memory(left, right)
        memory, result = self.limit.fresh_memory(), [self.limit.fresh() for _ in range(2)]
        sides = []
        for stop, machine in zip((left, right), self.machines, strict=True):
            passed = [stop.state.regs[i] for i in ARGUMENTS[:count]]
            machine.no_secret(stop.target, *passed)
            regs = [stop.state.regs[i] if i in SAVED else self.limit.fresh() for i in range(32)]
            regs[10:12] = result
            sides.append(State(stop.state.pc, regs, memory, (*path, *self.facts(memory))))
        return sides[0], sides[1]

    def compare_return(self, left: Stop, right: Stop) -> None:
        path, one, other = right.state.path, left.state.regs, right.state.regs
        for i in (RA, *SAVED, *ARGUMENTS[: self.result]):
            for machine, value in zip(self.machines, (one[i], other[i]), strict=True):
                machine.no_secret(value)
            self.equal(f"x{i} at the return", path, one[i], other[i])
        self.compare_memory(left, right, one[SP])


def stores_of(memory: z3.ArrayRef) -> tuple[z3.ArrayRef, list[z3.ArrayRef]]:
    """A memory before its stores, and after each of them."""
    found = []
    while z3.is_store(memory):
        found.append(memory)
        memory = memory.arg(0)
    return memory, found[::-1]


def prove_function(
    name: str, original: dict[str, Section], changed: dict[str, Section], hidden: set[str]
) -> None:
    """Raises NotProved."""
    reasons = []
    for cut in (True, False):
        limit = Limit(original.keys() | changed.keys())
        try:
            one, other = (Machine(side[f".text.{name}"], side, hidden, limit) for side in (original, changed))
            Comparison(name, (one, other), cut).prove()
            return
        except (NotProved, z3.Z3Exception) as error:
            reasons.append(str(error))
    raise NotProved(f"{name}: {', '.join(dict.fromkeys(reasons))}")
