# SPDX-License-Identifier: Apache-2.0
"""What must stay true of a function whose result may be another one. A solver proves it.

sw/test/same.py asks for a contract when a function is not the same. A contract gets the sections of both
sides, and the project's own sources in the same build. It raises NotProved.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace

import z3

from sw.test.compare import SAVED, Comparison
from sw.test.fields import EXPECTS, NEXT, REPLY_OUTCOME, Field, Originals, never_exceeds, users
from sw.test.symbolic import (
    RA,
    SHF_WRITE,
    SP,
    Limit,
    Machine,
    NotProved,
    Section,
    State,
    Stop,
    read_memory,
    variables,
    word,
)

Sections = dict[str, Section]
Contract = Callable[[Sections, Sections, Originals], None]
# Of transaction.h: the offsets in bytes of the next settings in struct translator, and of GUARD in struct
# settings; CONTROL is a word's number. With a wrong offset nothing is proved: guard_of() reads other words.
AT_NEXT, AT_GUARD, CONTROL = 28, 20, 3
BITS, WORD_BYTES = 32, 4
STACK_BYTES = 256  # more than the firmware has
CONTRACT_S = 600  # longest proof of a contract
FLIP_MS = 60_000  # for the solver, with a memory of many stores


MEMORY = z3.Array("memory", z3.BitVecSort(32), z3.BitVecSort(8))
# The objects and the stack are at places of their own, far from each other. No code here depends on a place.
TRANSLATOR, SETTINGS, TRANSACTION, DATA, STACK = (word(place << 28) for place in (1, 2, 3, 4, 7))
# Bytes of a telegram from ADR up to its PCD (FC-3): a process, a parameter, a text of 2 to 20 characters.
LENGTHS = sorted({1, 9, *range(7, 26, 2)})
# Of PWE: zeros before the data, and bytes of data (MAP-7, MAP-8).
SIZES = [(0, 4), (2, 2), (4, 0), *((0, size) for size in range(2, 21, 2))]


class Whole(Machine):
    """A machine that follows all calls. So it may do anything with the address of a constant."""

    def __init__(self, name: str, side: Sections, limit: Limit) -> None:
        constants = {
            key for key, section in side.items() if not section.is_code and not section.flags & SHF_WRITE
        }
        super().__init__(side[name], side, constants, limit)

    def no_secret(self, *terms: z3.ExprRef) -> None:
        self.no_part(*terms)


def returns(
    side: Sections, name: str, limit: Limit, *arguments: z3.BitVecRef, path: tuple[z3.BoolRef, ...] = ()
) -> list[State]:
    """The states in which a function returns, with its calls of functions in the same source, from MEMORY."""
    regs = [z3.BitVec(f"x{i}", 32) for i in range(32)]
    regs[SP] = STACK
    regs[10 : 10 + len(arguments)] = arguments
    name = name if name in side else f".text.{name}"
    return list(finished(side, name, limit, State(0, regs, MEMORY, path)))


def finished(side: Sections, name: str, limit: Limit, begin: State) -> Iterator[State]:
    for stop in stopped(side, name, limit, begin, []):
        if not stop.target.eq(begin.regs[RA]) or not stop.state.regs[SP].eq(begin.regs[SP]):
            raise NotProved(f"{name}: another return address or stack")
        yield stop.state


def stopped(side: Sections, name: str, limit: Limit, begin: State, cuts: list[int]) -> Iterator[Stop]:
    """The returns and the cuts that a function reaches first, with its calls."""
    todo = [begin]
    while todo:
        for stop in Whole(name, side, limit).run(todo.pop(), cuts):
            if stop.kind != "call":
                yield stop
                continue
            callee = str(stop.target).removeprefix("&")
            if callee not in side:
                raise NotProved(f"{name} calls {callee}")
            states = finished(side, callee, limit, called(stop, limit))
            todo += [replace(state, pc=stop.state.pc) for state in states]


def called(stop: Stop, limit: Limit) -> State:
    """The callee's first state."""
    state = stop.state.copy()
    state.pc, state.regs[RA] = 0, limit.fresh()
    return state


def load(memory: z3.ArrayRef, address: z3.BitVecRef) -> z3.BitVecRef:
    return z3.simplify(z3.Concat(*(read_memory(memory, address + word(i)) for i in (3, 2, 1, 0))))


def once(*files: str) -> Callable[[Contract], Contract]:
    """The same code, as many builds have it, is proved once. files: the other sources that count."""

    def decorate(contract: Contract) -> Contract:
        proved: set[str] = set()

        @functools.wraps(contract)
        def prove(original: Sections, changed: Sections, source: Originals) -> None:
            sides = (original, changed, *(source(f"sw/src/{file}") for file in files))
            code = repr([sorted(side.items()) for side in sides])
            if code not in proved:
                contract(original, changed, source)
                proved.add(code)

        return prove

    return decorate


@once("telegram.c", "guard.c")
def guard_of(original: Sections, changed: Sections, source: Originals) -> None:
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


@once("telegram.c")
def end(original: Sections, changed: Sections, source: Originals) -> None:
    """The same telegram, check word and return, for each length of a telegram (FC-3) and all bytes."""
    begun = returns(source("sw/src/telegram.c"), "begin", Limit(set()), TRANSACTION)
    (first,) = {int(str(z3.simplify(state.regs[10] - word(1)))) for state in begun}
    pcd1, pcd2 = z3.BitVecs("pcd1 pcd2", 32)
    for length in LENGTHS:
        limit = Limit(set())
        arguments = (TRANSACTION, word(first + length), pcd1, pcd2)
        one, other = (single(returns(side, "end", limit, *arguments)) for side in (original, changed))
        same_but(set(), one, other, limit)


@once("telegram.c", "guard.c")
def telegram_parameter(original: Sections, changed: Sections, source: Originals) -> None:
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
        if any(name.startswith("&") for term in (left, right) for name in variables(term)):
            raise NotProved("an address is stored")
        if not limit.holds(other.path, left == right):
            raise NotProved("another byte is stored")
    if not limit.holds(other.path, one.regs[10] == other.regs[10]):
        raise NotProved("another result")


# ---------------------------------------------------------------- gateway.c


def not_on_stack(place: z3.BitVecRef, top: z3.BitVecRef) -> z3.BoolRef:
    """An object of the caller does not lie where the function puts its frame."""
    return z3.UGE(place - top + word(STACK_BYTES), word(STACK_BYTES))


class UnderFact(Comparison):
    """A comparison that knows the most that a field of the first argument's struct holds.

    Functions of the same source that have no loops are followed at their calls.
    """

    def __init__(
        self, name: str, sides: tuple[Sections, Sections], at: int, most: int, followed: set[str]
    ) -> None:
        limit = Limit(sides[0].keys() | sides[1].keys(), FLIP_MS, CONTRACT_S)
        machines = tuple(Machine(side[f".text.{name}"], side, set(), limit) for side in sides)
        super().__init__(name, machines, False)
        self.sides, self.at, self.most, self.followed = sides, at, most, followed

    def facts(self, memory: z3.ArrayRef) -> tuple[z3.BoolRef, ...]:
        place = z3.simplify(self.entry[10] + word(self.at))
        return not_on_stack(place, self.stack), z3.ULE(z3.Select(memory, place), self.most)

    def unseen(self, store: z3.ArrayRef) -> bool:
        """The field is no register of the hardware, so a store of what it holds already has no effect."""
        place = z3.simplify(store.arg(1) - self.entry[10])
        return super().unseen(store) or place.eq(word(self.at))

    def stops(self, side: int, begin: State) -> Iterator[Stop]:
        for stop in super().stops(side, begin):
            name = str(stop.target).removeprefix("&").removeprefix(".text.")
            if stop.kind != "call" or name not in self.followed:
                yield stop
                continue
            for state in finished(self.sides[side], f".text.{name}", self.limit, called(stop, self.limit)):
                yield from self.stops(side, replace(state, pc=stop.state.pc))


def under_fact(
    name: str, field: Field, largest: str, header: str, followed: set[str] = frozenset()
) -> Contract:
    """The same behaviour wherever the field holds no more than `largest`, and the proof that it never does.

    The proof is of the original: each store, in each function of all sources, stores no more. The changed
    function behaves as the original as long as this holds. So it holds with the changed one, too.
    """

    def prove(original: Sections, changed: Sections, source: Originals) -> None:
        most = source.value(largest, header)
        never_exceeds(source, field, most)
        UnderFact(name, (original, changed), source.offset(field), most, followed).prove()

    return prove


FRAME = 5 << 28  # a place for the frame memory


class Copying(Machine):
    """Keeps the bytes that are read, and the bytes that are stored in this order."""

    def __init__(self, code: Section, limit: Limit) -> None:
        super().__init__(code, {}, set(), limit)
        self.read: list[int] = []
        self.stored: list[tuple[int, z3.BitVecRef]] = []

    def load(self, state: State, funct: int, address: z3.BitVecRef) -> z3.BitVecRef:
        self.read += [self.place(address) + i for i in range(1 << (funct & 3))]
        return super().load(state, funct, address)

    def store(self, state: State, funct: int, address: z3.BitVecRef, value: z3.BitVecRef) -> None:
        if funct:
            raise NotProved("a store of more than a byte")
        self.stored.append((self.place(address), z3.simplify(z3.Extract(7, 0, value))))

    def place(self, address: z3.BitVecRef) -> int:
        place = z3.simplify(z3.substitute(address, (z3.BitVec("&host_frames", 32), word(FRAME))))
        if not z3.is_bv_value(place):
            raise NotProved("an unknown place")
        return place.as_long()


def copy_telegram(original: Sections, changed: Sections, source: Originals) -> None:
    """copy_telegram() puts a telegram into the frame memory. It may copy other bytes after the BCC.

    The hardware sends as many bytes as the telegram has. For each length up to the longest (FC-3):

    - The telegram's bytes are stored in their places, each once, from the last to the first.
    - All other stores are of the telegram's array, too, each byte in its place. They come before these.
    - Nothing is read but the array and the length.

    The code of the loop is that of the original: the steps of four bytes count (docs/hardening.md).
    """
    name, most = ".text.copy_telegram", source.value("TELEGRAM_MAX", "transaction.h")
    frame = FRAME + source.value("TELEGRAM_FRAME_address - FRAMES_address", "mailbox_port.h")
    size, stride = (
        source.value("4 * TELEGRAM_WORDS", "transaction.h"),
        source.value("FRAME_STRIDE", "mailbox.h"),
    )
    telegram, at_length = (
        TRANSACTION.as_long() + source.value(f"offsetof(struct transaction, {member})", "transaction.h")
        for member in ("out.telegram", "telegram_length")
    )
    loops = []
    for side in (original, changed):
        (head,) = Machine(side[name], {}, set(), Limit(set())).loop_heads()
        if any(at >= head for at in side[name].relocs):
            raise NotProved("copy_telegram: an address in the loop")
        loops.append((head, side[name].content[head:]))
    if loops[0] != loops[1]:
        raise NotProved("copy_telegram: another loop")
    for length in range(1, most + 1):
        limit = Limit(set())
        machine = Copying(changed[name], limit)
        regs = [z3.BitVec(f"x{i}", 32) for i in range(32)]
        regs[10] = TRANSACTION
        memory = z3.Store(MEMORY, word(at_length), z3.BitVecVal(length, 8))
        stops = list(machine.run(State(0, list(regs), memory), []))
        if [stop.kind for stop in stops] != ["return"]:
            raise NotProved("copy_telegram: more than a path, or a call")
        kept = stops[0].state.regs
        if not all(kept[i].eq(regs[i]) for i in (RA, *SAVED)):
            raise NotProved("copy_telegram: another return")
        slots = [(place - frame) // stride for place, _ in machine.stored]
        if slots != list(range(len(slots)))[::-1] or not length <= len(slots) <= size:
            raise NotProved("copy_telegram: a byte is left out, comes twice or in another order")
        for slot, (place, value) in zip(slots, machine.stored, strict=True):
            right = z3.simplify(z3.Select(memory, word(telegram + slot)))
            if place != frame + stride * slot or not limit.holds((), value == right):
                raise NotProved("copy_telegram: another byte")
        if not set(machine.read) <= {at_length, *range(telegram, telegram + size)}:
            raise NotProved("copy_telegram: reads something else")


# ---------------------------------------------------------------- translate.c

CORE_SOURCES = ("coils.c", "registers.c", "telegram.c", "reply.c", "guard.c")
# They read the kind of a telegram: of the reply to a telegram that was sent, and after registers_limit().
READERS = {"translate_drive_reply", "answer_parameter", "may_be_text", "registers_read", "write_run"}


def linked(files: dict[str, Sections]) -> Sections:
    """The functions and constants of several sources, each named after its source."""
    shared = {
        section.name.removeprefix(".text."): f"{file} {section.name}"
        for file, sections in files.items()
        for section in sections.values()
        if section.is_code and section.shared
    }
    found = {}
    for file, sections in files.items():
        for name, section in sections.items():
            relocs = {
                at: tuple(
                    replace(
                        row,
                        name=f"{file} {row.name}" if row.name in sections else shared.get(row.name, row.name),
                    )
                    for row in rows
                )
                for at, rows in section.relocs.items()
            }
            found[f"{file} {name}"] = replace(section, relocs=relocs)
    return found


class OfOthers(Comparison):
    """Requests of all functions but 05."""

    def first_facts(self, memory: z3.ArrayRef) -> tuple[z3.BoolRef, ...]:
        pdu = self.entry[12]
        return not_on_stack(pdu, self.stack), z3.Select(memory, pdu) != self.code


def translate_request(original: Sections, changed: Sections, source: Originals) -> None:
    """A request of function 05 that makes no telegram leaves any kind of telegram in its transaction.

    `expects` is the kind of the telegram sent (codes.h), so without one it has no meaning. In the original it
    is that of an older request. Nobody else reads it (READERS). All else must be the same:

    - for 05, the outcome and all memory, with the code of all functions that it calls;
    - for each other function code, the behaviour in every respect.
    """
    apart = Originals(source.build, ("-fno-inline",), source.folder)
    readers = {section.name.removeprefix(".text.") for _, section, loads, _ in users(apart, EXPECTS) if loads}
    if not readers <= READERS:
        raise NotProved(f"expects is read by {', '.join(sorted(readers - READERS))}")
    same_request(original, changed, source)


@once(*CORE_SOURCES)
def same_request(original: Sections, changed: Sections, source: Originals) -> None:
    code = source.value("WRITE_COIL", "codes.h")
    hidden = {
        name
        for name in original.keys() | changed.keys()
        if name not in original or name not in changed or not original[name].like(changed[name])
        if not (original | changed)[name].is_code
    }
    limit, name = Limit(original.keys() | changed.keys(), longest_s=CONTRACT_S), ".text.translate_request"
    machines = tuple(Machine(side[name], side, hidden, limit) for side in (original, changed))
    others = OfOthers("translate_request", machines, False)
    others.code = code
    others.prove()

    core = {file: source(f"sw/src/{file}") for file in CORE_SOURCES}
    sides = [linked({"translate.c": side, **core}) for side in (original, changed)]
    limit = Limit(sides[0].keys() | sides[1].keys(), longest_s=CONTRACT_S)
    arguments = (TRANSLATOR, TRANSACTION, DATA, *z3.BitVecs("pdu_length broadcast", 32))
    path = (z3.Select(MEMORY, DATA) == code,)
    ends = [returns(side, f"translate.c {name}", limit, *arguments, path=path) for side in sides]
    kind, telegram = (
        TRANSACTION.as_long() + source.offset(EXPECTS),
        source.value("OUTCOME_EXCHANGE", "transaction.h"),
    )
    for one in ends[0]:
        for other in ends[1]:
            if not limit.possible(one.path, z3.And(*other.path)):
                continue
            both = replace(other, path=one.path + other.path)
            same_but({kind}, one, both, limit)
            kinds = [read_memory(state.memory, word(kind)) for state in (one, other)]
            if not limit.holds(both.path, z3.Or(one.regs[10] != telegram, kinds[0] == kinds[1])):
                raise NotProved("translate_request: another kind of telegram")


CONTRACTS = {
    "guard_of": guard_of,
    "end": end,
    "telegram_parameter": telegram_parameter,
    "start_next": under_fact("start_next", NEXT, "PLACES - 1", "options.h", {"other", "first_waiting"}),
    "copy_telegram": copy_telegram,
    "translate_request": translate_request,
    "finish_exchange": under_fact("finish_exchange", REPLY_OUTCOME, "OUTCOME_REPLY", "transaction.h"),
}
OF_CONSTANTS = {"translate_request"}  # contracts that follow a constant that differs
