# SPDX-License-Identifier: Apache-2.0
"""What must stay true of a function whose result may be another one. A solver proves it.

sw/test/same.py asks for a contract when a function is not the same. A contract gets the sections of both
sides, and a function for the sections of another source in the same build. It raises NotProved.
"""

from __future__ import annotations

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
# Of transaction.h: the offsets in bytes of the next settings in struct translator, and of GUARD in struct
# settings; CONTROL is a word's number. With a wrong offset nothing is proved: guard_of() reads other words.
AT_NEXT, AT_GUARD, CONTROL = 28, 20, 3
BITS = 32


MEMORY = z3.Array("memory", z3.BitVecSort(32), z3.BitVecSort(8))
# The objects and the stack are at places of their own, far from each other. No code here depends on a place.
TRANSLATOR, SETTINGS, TRANSACTION, STACK = (word(place << 28) for place in (1, 2, 3, 7))


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

    def shows(
        changes: list[tuple[z3.ExprRef, z3.ExprRef]], values: list[tuple[z3.ExprRef, z3.ExprRef]]
    ) -> None:
        """A flip that changes the original's value changes the other one."""
        one, other = (
            z3.substitute(z3.substitute(side, *values), *changes) != z3.substitute(side, *values)
            for side in sides
        )
        if not limit.holds((), z3.Implies(one, other)):
            raise NotProved("guard_of: does not show a flipped bit that the original shows")

    for bit in range(BITS):
        for value in (guard, check):
            shows([(value, value ^ word(1 << bit))], [(guard, guard), (check, check)])
        for value in checks[at_check]:
            shows([(control, control ^ word(1 << bit))], [(guard, made), (check, value)])


CONTRACTS = {"guard_of": guard_of}
