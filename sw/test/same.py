# SPDX-License-Identifier: Apache-2.0
"""Proves with a solver that a changed source of the firmware behaves like the original, for all inputs.

The changed file is compiled twice for the card's CPU (RV32I), in each build of BUILDS: with its functions
apart, then with static ones inlined. One way that succeeds is enough. A function with other instructions, or
one that reads another constant, is executed symbolically on both sides from the same registers and memory,
which are free. Both sides must stop at the same events in the same order:

- a call: of the same function, with equal arguments. It returns the same free value and memory on both sides.
  The callee is compared by itself.
- the return: with equal value, saved registers and address.
- a loop head, if cut. Registers are assumed to be equal there, and to keep a known value. One that a round
  leaves different is dropped, and the proof begins again without it. Without cuts the loops run to their end.

At each event the memory must be equal, after the same stores in the same order. The order does not count on
the stack, nor its content after the return.

A constant that differs has an address that nobody else may know. A function that stores or passes its
address, or that reads it at an unknown place, is not proved. Nothing is proved that is not understood:
another instruction, an unknown jump, too many paths, a solver without an answer. A function that is not
proved to be the same may still be the same.

The proof takes four things for granted. The compiler is right. Memory, also a volatile one, changes by stores
and in calls alone. A callee keeps the registers of its caller (RISC-V ABI). Nobody reads the stack below its
end. Neither time nor the number of reads is compared. Undefined behaviour of C is that of the machine, as
FLAGS have it.

Of a function with a contract (sw/test/contracts.py) the solver may prove this instead of the same behaviour.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import z3

from sw.test.compare import prove_function
from sw.test.contracts import CONTRACTS, OF_CONSTANTS
from sw.test.fields import Originals
from sw.test.host import BUILDS
from sw.test.symbolic import SHF_WRITE, NotProved, Section, compiled

WAYS = (("-fno-inline",), ("-finline-functions",))


def prove_contract(
    name: str,
    original: dict[str, Section],
    changed: dict[str, Section],
    source: Originals,
) -> None:
    """Raises NotProved."""
    if name not in CONTRACTS:
        raise NotProved("no contract")
    try:
        CONTRACTS[name](original, changed, source)
    except (KeyError, ValueError, z3.Z3Exception) as error:
        raise NotProved(f"contract of {name}: {error!r}") from None


def prove_object(
    original: dict[str, Section],
    changed: dict[str, Section],
    source: Originals | None = None,
) -> list[str]:
    """The names of the functions that the solver had to compare. Raises NotProved.

    source: the project's own sources, for contracts; None: without contracts.
    """
    for name in original.keys() ^ changed.keys():
        section = (original | changed)[name]
        if section.shared or section.flags & SHF_WRITE:
            raise NotProved(f"only one side has {name}")
    both = original.keys() & changed.keys()
    other = {name for name in both if not original[name].like(changed[name])}
    hidden = {name for name in other if not original[name].is_code}
    hidden |= {name for name in original.keys() ^ changed.keys() if not (original | changed)[name].is_code}
    for name in hidden:
        for section in (side[name] for side in (original, changed) if name in side):
            if section.shared or section.flags & SHF_WRITE:
                raise NotProved(f"{name} is another, and no private constant")
    for side in (original, changed):
        for section in side.values():
            if not section.is_code and section.refers_to(hidden):
                raise NotProved(f"{section.name} has the address of a constant that differs")
    functions = [name for name in both if original[name].is_code]
    compared = [name for name in functions if name in other or original[name].refers_to(hidden)]
    for name in sorted(compared):
        short = name.removeprefix(".text.")
        try:
            prove_function(short, original, changed, hidden)
        except NotProved as error:
            if source is None or compared != [name] or (hidden and short not in OF_CONSTANTS):
                raise
            try:
                prove_contract(short, original, changed, source)
            except NotProved as other_error:
                raise NotProved(f"{error}; {other_error}") from None
    return [name.removeprefix(".text.") for name in compared]


def why_not_same(changed: Path, files: list[str], folder: Path) -> str:
    """Empty if the sources `files` below the tree `changed` behave in every build as those here.

    Else one line: the first reason of each way. Object files go to `folder`.
    """
    for file, build in itertools.product(files, BUILDS):
        reasons = []
        for way in WAYS:
            try:
                source = Originals(build, way, folder)
                prove_object(source(file), compiled(changed, file, build, way, folder / "changed.o"), source)
                break
            except NotProved as error:
                reasons.append(str(error))
        else:
            return f"{file} {build}: {'; '.join(dict.fromkeys(reasons))}"
    return ""


def proved_same(changed: Path, files: list[str], folder: Path) -> bool:
    return not why_not_same(changed, files, folder)
