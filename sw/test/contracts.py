# SPDX-License-Identifier: Apache-2.0
"""What must stay true of a function whose result may be another one. A solver proves it.

sw/test/same.py asks for a contract when a function is not the same. A contract gets the sections of both
sides, and a function for the sections of another source in the same build. It raises NotProved.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import z3

from sw.test.symbolic import (
    RA,
    SP,
    Limit,
    Machine,
    NotProved,
    Section,
    State,
    read_memory,
    variables,
    word,
)

Sections = dict[str, Section]
Contract = Callable[[Sections, Sections, Callable[[str], Sections]], None]
# Of transaction.h: the offsets in bytes of the next settings in struct translator, and of GUARD in struct
# settings; CONTROL is a word's number. With a wrong offset nothing is proved: guard_of() reads other words.
AT_NEXT, AT_GUARD, CONTROL = 28, 20, 3
BITS, WORD_BYTES = 32, 4
STACK_BYTES = 256  # more than the firmware has
CONTRACT_S = 600  # longest proof of a contract
FLIP_MS = 60_000  # for the solver, with the sums of 8 words


MEMORY = z3.Array("memory", z3.BitVecSort(32), z3.BitVecSort(8))
# The objects and the stack are at places of their own, far from each other. No code here depends on a place.
TRANSLATOR, SETTINGS, TRANSACTION, DATA, STACK = (word(place << 28) for place in (1, 2, 3, 4, 7))
# Bytes of a telegram from ADR up to its PCD (FC-3): a process, a parameter, a text of 2 to 20 characters.
LENGTHS = sorted({1, 9, *range(7, 26, 2)})
# Of PWE: zeros before the data, and bytes of data (MAP-7, MAP-8).
SIZES = [(0, 4), (2, 2), (4, 0), *((0, size) for size in range(2, 21, 2))]


def returns(side: Sections, name: str, limit: Limit, *arguments: z3.BitVecRef) -> list[State]:
    """The states in which a function returns, with its calls of functions in the same source, from MEMORY."""
    regs = [z3.BitVec(f"x{i}", 32) for i in range(32)]
    regs[SP] = STACK
    regs[10 : 10 + len(arguments)] = arguments
    return list(finished(side, f".text.{name}", limit, State(0, regs, MEMORY)))


def finished(side: Sections, name: str, limit: Limit, begin: State) -> Iterator[State]:
    todo = [begin]
    while todo:
        for stop in Machine(side[name], {}, set(), limit).run(todo.pop(), []):
            if stop.kind == "call":
                callee = stop.state.copy()
                callee.pc, callee.regs[RA] = 0, limit.fresh()
                called = str(stop.target).removeprefix("&")
                if called not in side:
                    raise NotProved(f"{name} calls {called}")
                todo += [replace(state, pc=stop.state.pc) for state in finished(side, called, limit, callee)]
            elif stop.target.eq(begin.regs[RA]) and stop.state.regs[SP].eq(begin.regs[SP]):
                yield stop.state
            else:
                raise NotProved(f"{name}: another return address or stack")


def load(memory: z3.ArrayRef, address: z3.BitVecRef) -> z3.BitVecRef:
    return z3.simplify(z3.Concat(*(read_memory(memory, address + word(i)) for i in (3, 2, 1, 0))))


def once(contract: Contract) -> Contract:
    """The same code, as many builds have it, is proved once."""
    proved: set[str] = set()

    @functools.wraps(contract)
    def prove(original: Sections, changed: Sections, source: Callable[[str], Sections]) -> None:
        sides = (original, changed, source("sw/src/telegram.c"), source("sw/src/guard.c"))
        code = repr([sorted(side.items()) for side in sides])
        if code not in proved:
            contract(original, changed, source)
            proved.add(code)

    return prove


@once
def guard_of(original: Sections, changed: Sections, source: Callable[[str], Sections]) -> None:
    """guard_of() is compared with itself alone. So its value may be another, if it still shows each flip.

    - It stores nothing and depends on two words alone: the guard word of the next settings, and the check
      word of the transaction. So equal states give equal guards.
    - A flipped bit of one of these words that changes the original's value changes this value.
    - So does a flipped bit of a control word, from which telegram_process() makes the telegram and its check
      word, and guard_set_coils() the guard word. This holds for any control words, settings, and broadcasts.
    """
    limit = Limit(set())
    guard, check, control = z3.BitVecs("guard check control", 32)
    telegrams = returns(source("sw/src/telegram.c"), "telegram_process", limit, TRANSACTION, control)
    checks = {
        at: [load(state.memory, TRANSACTION + word(at)) for state in telegrams] for at in range(0, 256, 4)
    }
    # The check word is the last that depends on the control word. guard_of() must read this one.
    at_check = max(
        at for at, values in checks.items() if all("control" in variables(value) for value in values)
    )
    (state,) = returns(original, "guard_set_coils", limit, SETTINGS, word(CONTROL), control)
    made = load(state.memory, SETTINGS + word(AT_GUARD))
    if "control" not in variables(made):
        raise NotProved("guard_set_coils: another place of the guard word")

    before = [
        (load(MEMORY, TRANSLATOR + word(AT_NEXT + AT_GUARD)), guard),
        (load(MEMORY, TRANSACTION + word(at_check)), check),
    ]
    sides = []
    for side in (original, changed):
        (state,) = returns(side, "guard_of", limit, TRANSLATOR, TRANSACTION)
        bytes_ = [
            (whole_byte, z3.Extract(8 * i + 7, 8 * i, value))
            for whole, value in before
            for i, whole_byte in enumerate(reversed(whole.children()))
        ]
        result = z3.simplify(z3.substitute(state.regs[10], *bytes_))
        if not state.memory.eq(MEMORY) or variables(result) != {"guard", "check"}:
            raise NotProved("guard_of: more than a function of two words")
        sides.append(result)

    for bit in range(BITS):
        for value in (guard, check):
            shows(limit, sides, [(value, value ^ word(1 << bit))], [(guard, guard), (check, check)])
        for value in checks[at_check]:
            shows(limit, sides, [(control, control ^ word(1 << bit))], [(guard, made), (check, value)])


Pairs = list[tuple[z3.ExprRef, z3.ExprRef]]


def shows(limit: Limit, sides: list[z3.ExprRef], changes: Pairs, values: Pairs = ()) -> None:
    """A flip that changes the value of the original, the first side, changes that of the other one."""
    one, other = (
        z3.substitute(z3.substitute(side, *values), *changes) != z3.substitute(side, *values)
        for side in sides
    )
    if not limit.holds((), z3.Implies(one, other)):
        raise NotProved("does not show a flipped bit that the original shows")


# ---------------------------------------------------------------- telegram.c


def reads(term: z3.ExprRef) -> set[int]:
    """The places of MEMORY that a term reads. All must be known."""
    seen, found, todo = set(), set(), [term]
    while todo:
        one = todo.pop()
        if one.get_id() in seen:
            continue
        seen.add(one.get_id())
        if z3.is_select(one):
            place = z3.simplify(one.arg(1))
            if not one.arg(0).eq(MEMORY) or not z3.is_bv_value(place):
                raise NotProved("a read at an unknown place")
            found.add(place.as_long())
        else:
            todo += one.children()
    return found


def stores(memory: z3.ArrayRef) -> set[int]:
    """The places that were stored to, without those on the stack. All must be known."""
    found = set()
    while z3.is_store(memory):
        place = z3.simplify(memory.arg(1))
        if not z3.is_bv_value(place):
            raise NotProved("a store at an unknown place")
        found.add(place.as_long())
        memory = memory.arg(0)
    return found - set(range(STACK.as_long() - STACK_BYTES, STACK.as_long()))


def check_word(source: Callable[[str], Sections]) -> set[int]:
    """The places of the transaction's word that guard_of() reads."""
    limit = Limit(set())
    (state,) = returns(source("sw/src/guard.c"), "guard_of", limit, TRANSLATOR, TRANSACTION)
    found = {place for place in reads(state.regs[10]) if place >= TRANSACTION.as_long()}
    if len(found) != 4:
        raise NotProved("guard_of: more than one word of the transaction")
    return found


@once
def end(original: Sections, changed: Sections, source: Callable[[str], Sections]) -> None:
    """end() makes a check word that guard_of() alone reads, to compare it with that of another pass.

    So it may be another word, if it still shows what the original's word shows:

    - a flipped bit of a byte of the telegram or of the process data;
    - two bytes of neighbouring words that change places, which leave the BCC as it is.

    All else must be the same. This holds for every length of a telegram (FC-3) and all bytes.
    """
    check = check_word(source)
    pcd1, pcd2 = z3.BitVecs("pcd1 pcd2", 32)
    begun = returns(source("sw/src/telegram.c"), "begin", Limit(set()), TRANSACTION)
    (first,) = {int(str(z3.simplify(state.regs[10] - word(1)))) for state in begun}
    over = time.monotonic() + CONTRACT_S
    for length in LENGTHS:
        limit = Limit(set())
        at = word(first + length)
        one, other = (
            single(returns(side, "end", limit, TRANSACTION, at, pcd1, pcd2)) for side in (original, changed)
        )
        same_but(check, one, other, limit)
        telegram = {place: z3.BitVec(f"byte{place - first}", 8) for place in range(first, first + length)}
        named = [(z3.Select(MEMORY, word(place)), byte) for place, byte in telegram.items()]
        sides = [
            z3.simplify(z3.substitute(load(state.memory, word(min(check))), *named)) for state in (one, other)
        ]
        if any(reads(side) for side in sides):
            raise NotProved("end: the check word depends on more than the telegram")
        flips = [(byte, byte ^ (1 << bit)) for byte in telegram.values() for bit in range(8)]
        flips += [(pcd, pcd ^ word(1 << bit)) for pcd in (pcd1, pcd2) for bit in range(16)]
        changes = [[flip] for flip in flips]
        bytes_ = list(telegram.values())
        for here, there in zip(bytes_, bytes_[WORD_BYTES:], strict=False):
            changes.append([(here, there), (there, here)])
        for change in changes:
            if time.monotonic() > over:
                raise NotProved(f"end: no proof within {CONTRACT_S} s")
            shows(Limit(set(), FLIP_MS), sides, change)


@once
def telegram_parameter(original: Sections, changed: Sections, source: Callable[[str], Sections]) -> None:
    """The same telegram, check word and return, for each size of a number and of a text (MAP-7, MAP-8)."""
    ak, ind = z3.BitVecs("ak ind", 32)
    for zeros, size in SIZES:
        limit = Limit(set())
        arguments = (TRANSACTION, ak, word(zeros), ind, word(size), DATA)
        sides = [returns(side, "telegram_parameter", limit, *arguments) for side in (original, changed)]
        for one in sides[0]:
            for other in sides[1]:
                if limit.possible(one.path, z3.And(*other.path)):
                    same_but(set(), one, replace(other, path=one.path + other.path), limit)


def single(states: list[State]) -> State:
    if len(states) != 1:
        raise NotProved("more than one path")
    return states[0]


def same_but(places: set[int], one: State, other: State, limit: Limit) -> None:
    """The result and all stores are the same, but for the bytes at `places`."""
    for place in (stores(one.memory) | stores(other.memory)) - places:
        left, right = (read_memory(state.memory, word(place)) for state in (one, other))
        if not limit.holds(other.path, left == right):
            raise NotProved("another byte is stored")
    if not limit.holds(other.path, one.regs[10] == other.regs[10]):
        raise NotProved("another result")


CONTRACTS = {"guard_of": guard_of, "end": end, "telegram_parameter": telegram_parameter}
