# SPDX-License-Identifier: Apache-2.0
"""Flips every bit of the core that the firmware uses while it serves a request, and while it has none.

    python -m campaigns.flips.core [--image FILE] [--jobs N] [--only NAME]   # make core-flips

The image of each card runs on an RV32I machine with the mailbox model (core_machine.c). Before each
instruction of a scenario one bit flips: of a register that the instruction reads, of the program counter, or
of the instruction while it is carried out. A flip between two instructions that read a register is the same
as one before the second of them. A scenario goes from the candidate until the drive's answer is served, or
the request is revoked. A command and a parameter's reading follow; their telegrams show the settings that
were left. All scenarios with the images of both cards write build/fuzz/core-flips.json. Exit 0: in each
scenario at most MOST of the flips altered a telegram (SAFE-4); 1: more did; 2: an invalid command line.
"""

from __future__ import annotations

import ctypes
import functools
import json
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.fuzz.run import FOLDER
from rtl.command import Parser, in_processes, run_main
from rtl.sources import ROOT, configurations
from tb.agents import rtu
from tb.lib.options import at_least
from tb.model import fc_telegram
from tb.model.firmware import build

H = bytes.fromhex
EARLIER = H("0F 0000 0020 04 7D04 1122")
FOLLOWING = H("05 000B FF00")
READ_514, READ_515 = H("03 1413 0002"), H("03 141D 0002")
WRITE_515 = H("06 141D 0ABC")
TEXT_WRITE = rtu.write_register(0, 0x0500)  # 40001: the index with which a write is of text
# Without a round of the loop for so long the firmware hangs. The longest round of a request takes 800.
LONGEST_ROUND = 4000
MEMORY = 8192  # bytes, for an image of no card

# As in core_machine.c.
ROUND, CANDIDATE, COMMIT, CHARACTER, TICK, TELEGRAM_ENDS, EXCHANGE_ROUND, DRIVE_SAYS, DRIVE_ENDS = range(9)
OF_REGISTER, OF_PC, OF_WORD, OF_STORE = 1, 2, 4, 8
ALL = OF_REGISTER | OF_PC | OF_WORD
PLAYED, REFUSED_BY_BCC, STOPPED = range(3)


class Step(ctypes.Structure):
    """struct step."""

    _fields_ = [(name, ctypes.c_uint8) for name in ("kind", "watched", "broadcast", "length")]
    _fields_ += [("pdu", ctypes.c_uint8 * 32)]


class FlipMade(ctypes.Structure):
    """struct flip."""

    _fields_ = [("instruction", ctypes.c_uint32), ("pc", ctypes.c_uint32)]
    _fields_ += [(name, ctypes.c_uint8) for name in ("kind", "which", "bit")]

    def __str__(self) -> str:
        what = {OF_PC: "the program counter", OF_WORD: "the instruction"}.get(self.kind, f"x{self.which}")
        return f"instruction {self.instruction} at {self.pc:#x}, {what}, bit {self.bit}"


class Found(ctypes.Structure):
    """struct found."""

    _fields_ = [
        ("ending", ctypes.c_uint32),
        ("sent", ctypes.c_uint32),
        ("length", ctypes.c_uint8 * 12),
        ("byte", ctypes.c_uint8 * 32 * 12),
        ("count", ctypes.c_uint32),
        ("example", FlipMade * 8),
    ]

    def telegrams(self) -> list[bytes]:
        return [bytes(self.byte[i][: self.length[i]]) for i in range(self.sent)]


class CoreError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Scenario:
    """One request, and what comes before it. Without a PDU there is none, and some ticks pass."""

    name: str
    pdu: bytes
    broadcast: bool = False
    before: bytes | None = None  # a local write
    busy: bool = False  # the request comes while the drive answers another one
    revoked: bool = False  # a character follows before the request's t3.5 is over
    local: bool = False  # the request needs no telegram


SCENARIOS = (
    Scenario("0F, coils 1-32", H("0F 0000 0020 04 7C04 9919")),
    Scenario("05, coil 11", H("05 000A FF00")),
    Scenario("0F, coils 1-16", H("0F 0000 0010 02 3C04")),
    Scenario("0F, coils 1-32, broadcast", H("0F 0000 0020 04 7C04 0040"), broadcast=True),
    Scenario("06, a parameter", rtu.write_register(2049, 0x1234)),
    Scenario("10, a parameter", rtu.write_registers(2049, [0x1234])),
    Scenario("10, six letters", rtu.write_registers(2049, [0x5055, 0x4D50, 0x2031]), before=TEXT_WRITE),
    Scenario("03, a parameter", READ_514),
    Scenario("0F, coils 1-32, drive busy", H("0F 0000 0020 04 7C04 9919"), busy=True),
    Scenario("06, a parameter, drive busy", rtu.write_register(2049, 0x1234), busy=True),
    Scenario("0F, coils 1-32, revoked", H("0F 0000 0020 04 7C04 9919"), revoked=True),
    Scenario("05, coil 11, revoked", H("05 000A FF00"), revoked=True),
    Scenario("06, register 40001", rtu.write_register(0, 0x0002), local=True),
    Scenario("10, registers 40001-40003", rtu.write_registers(0, [0x0002, 500, 20]), local=True),
    Scenario("05, coil 65", H("05 0040 FF00"), local=True),
    Scenario("01, coils 1-32", H("01 0000 0020"), local=True),
    Scenario("03, registers 40001-40002", H("03 0000 0002"), local=True),
    Scenario("2B", H("2B 0E 01 00"), local=True),
    Scenario("no request", b"", local=True),
)
# Requests that any test can make, and that ask the drive.
REQUESTS = tuple(
    each.pdu
    for each in SCENARIOS
    if not (each.busy or each.broadcast or each.before or each.revoked or each.local)
)
VALID = 0x04  # bit 10, in the control word's upper byte
ALTERED = ("altered, bit 10 = 1", "altered, bit 10 = 0")
# Of the flips of a scenario: those that no mechanism of docs/hardening.md finds.
MOST = 5e-4
AGAIN, REFUSED, NOBODY = "again", "refused by its BCC", "with an address of no drive"
AS_ASKED, NONE = "as asked", "none"
RESULTS = (*ALTERED, AS_ASKED, AGAIN, REFUSED, NOBODY, NONE)
FILE = FOLDER / "core-flips.json"
KEYS = {"cards", "flips", "results"}  # keys of that file

TWO_ROUNDS = [(ROUND,), (ROUND,)]
EXCHANGE = [
    (TELEGRAM_ENDS,),
    *[(EXCHANGE_ROUND,)] * 2,
    (DRIVE_SAYS,),
    *[(EXCHANGE_ROUND,)] * 2,
    (DRIVE_ENDS,),
    *[(EXCHANGE_ROUND,)] * 2,
]


def request(pdu: bytes, broadcast: bool = False, end: int = COMMIT) -> list[tuple]:
    return [(CANDIDATE, pdu, broadcast), *TWO_ROUNDS, (end,), *TWO_ROUNDS]


def before(scenario: Scenario) -> list[tuple]:
    """Steps before the request. The first round is the start's."""
    steps = [(ROUND,), *request(EARLIER), *EXCHANGE]
    if scenario.before:
        steps += request(scenario.before)
    return steps + (request(READ_514) if scenario.busy else [])


def watched(scenario: Scenario) -> list[tuple]:
    """The request, or some ticks, and what follows of it."""
    if not scenario.pdu:
        return [(ROUND,), *[(TICK,), (ROUND,)] * 3]
    steps = request(scenario.pdu, scenario.broadcast, CHARACTER if scenario.revoked else COMMIT)
    return [*steps, *EXCHANGE, *(EXCHANGE if scenario.busy else [])]


def after() -> list[tuple]:
    """Telegrams that show the settings: the control image, IND, and IND and coil 65."""
    steps = list(EXCHANGE)
    for pdu in (FOLLOWING, READ_515, WRITE_515):
        steps += [*request(pdu), *EXCHANGE]
    return steps


@functools.cache
def library() -> ctypes.CDLL:
    lib = ctypes.CDLL(str(build("build/host/libcore.so")))
    u32 = ctypes.c_uint32
    lib.core_load.argtypes = [ctypes.c_char_p, u32, u32, u32]
    lib.core_play.argtypes = [ctypes.POINTER(Step), u32, u32, u32]
    lib.core_play.restype = lib.core_instructions.restype = u32
    lib.core_found.argtypes, lib.core_found.restype = [u32], ctypes.POINTER(Found)
    assert u32.in_dll(lib, "core_found_size").value == ctypes.sizeof(Found)
    return lib


def load(image: bytes, memory: int) -> None:
    """The image into the machine, whose last bytes of memory are the frame memory's."""
    library().core_load(image, len(image), memory, LONGEST_ROUND)


@dataclass
class Run:
    """The telegrams before the request and since, and why the firmware ended if it did."""

    earlier: list[bytes] = field(default_factory=list)
    sent: list[bytes] = field(default_factory=list)
    how: str = ""


def _run(found: Found, earlier: list[bytes]) -> Run:
    how = {PLAYED: "", REFUSED_BY_BCC: REFUSED, STOPPED: NONE}[found.ending]
    return Run(earlier, found.telegrams()[len(earlier) :], how)


def _play(
    steps: list[tuple], watch: range = range(0), kinds: int = 0, part: int = 1
) -> tuple[Found, list[Found]]:
    """The run without a flip, and all results with one."""
    made = (Step * len(steps))()
    for i, (step, (kind, *frame)) in enumerate(zip(made, steps, strict=True)):
        step.kind, step.watched = kind, i in watch
        if frame:
            pdu, step.broadcast = frame
            step.length = len(pdu)
            step.pdu[: len(pdu)] = list(pdu)
    lib = library()
    count = lib.core_play(made, len(made), kinds, part)
    if not count:
        raise CoreError("more results or steps than the machine has")
    sound, *flipped = [Found.from_buffer_copy(lib.core_found(i).contents) for i in range(count)]
    return sound, flipped


def play(scenario: Scenario, lost: bool = False) -> Run:
    """Plays a scenario on the machine as it was loaded, if `lost` without its request."""
    first = before(scenario)
    earlier = _play(first)[0].telegrams()
    between = (EXCHANGE if scenario.busy else []) if lost else watched(scenario)
    return _run(_play([*first, *between, *after()])[0], earlier)


def without_repeats(telegrams: list[bytes]) -> list[bytes]:
    """Each telegram once that leaves twice in a row, as after a repeat (FC-9)."""
    return [one for one, before in zip(telegrams, [b"", *telegrams], strict=False) if one != before]


def is_part(some: list[bytes], of: list[bytes]) -> bool:
    """Whether telegrams were left out at most: a request that is not served gets silence."""
    left = iter(of)
    return all(one in left for one in some)


def verdict(run: Run, sound: Run, lost: Run) -> str:
    """The worst thing that the telegrams of a run show, beside those of the runs without a flip.

    Allowed are telegrams of the run with the request, or of the run without it, in their order. So a request
    whose telegram leaves, but not its settings, is altered. A repeat is named, also of the telegram before.
    """
    # The drive's own addresses in both formats, and broadcasts (FC-2).
    heard = [one for one in run.sent if one[0] in (0x81, 0x01) or fc_telegram.is_broadcast(one[0])]
    before = run.earlier[-1:]
    exact = any(is_part(heard, each.sent) for each in (sound, lost))
    once = without_repeats([*before, *heard])
    if not exact and not any(is_part(once, [*before, *each.sent]) for each in (sound, lost)):
        others = [one for one in heard if one not in sound.sent + lost.sent + run.earlier] or heard
        return ALTERED[0] if any(len(one) > 4 and one[-4] & VALID for one in others) else ALTERED[1]
    if run.how == REFUSED:
        return REFUSED
    if not exact:
        return AGAIN
    if heard != run.sent:
        return NOBODY
    return AS_ASKED if sound.sent[0] in run.sent else NONE


@dataclass
class Flips:
    """The results of a scenario's flips, and the telegrams of those that altered one."""

    instructions: int
    results: Counter = field(default_factory=Counter)
    found: list[str] = field(default_factory=list)


def every_flip(
    scenario: Scenario, image: bytes, memory: int = MEMORY, kinds: int = ALL, part: int = 1
) -> Flips:
    """All flips of these kinds in a scenario, or those before one of `part` instructions."""
    load(image, memory)
    sound, lost = play(scenario), play(scenario, lost=True)
    if len(sound.sent) != 3 + (not scenario.local and not scenario.revoked) or sound.how:
        raise CoreError(f"{scenario.name}: not served without a flip")
    first = before(scenario)
    middle = watched(scenario)
    watch = range(len(first), len(first) + len(middle))
    _, found = _play([*first, *middle, *after()], watch, kinds, part)
    flips = Flips(library().core_instructions())
    for each in found:
        run = _run(each, sound.earlier)
        result = verdict(run, sound, lost)
        flips.results[result] += each.count
        if result in ALTERED:
            sent = ", ".join(telegram.hex(" ") for telegram in run.sent)
            flips.found += [
                f"{scenario.name}: {example}: {result}: {sent}"
                for example in each.example[: min(each.count, len(each.example))]
            ]
    return flips


def altered(results: Counter) -> int:
    return sum(results[result] for result in ALTERED)


def image_of(config: str) -> Path:
    """The image of one card, as `make firmware` leaves it."""
    return (ROOT / configurations()[config]["firmware_hex"]).with_suffix(".bin")


def memory_of(config: str) -> int:
    return configurations()[config]["memory_bytes"] if config in configurations() else MEMORY


def _work(work: tuple[str, Path, Scenario]) -> tuple[str, str, Flips, float]:
    of, path, scenario = work
    begin = time.monotonic()
    flips = every_flip(scenario, path.read_bytes(), memory_of(of))
    return of, scenario.name, flips, time.monotonic() - begin


def keep(results: dict[str, dict[str, Counter]]) -> None:
    """Writes the result file: by card and scenario."""
    flips = sum(found.total() for rows in results.values() for found in rows.values())
    kept = {"cards": {config: fingerprint.flips(config) for config in results}, "flips": flips}
    FILE.parent.mkdir(parents=True, exist_ok=True)
    FILE.write_text(json.dumps(kept | {"results": results}, indent=1) + "\n")


def main() -> int:
    parser = Parser(prog="core-flips", description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=at_least(1), default=2, help="processes (default: %(default)s)")
    parser.add_argument("--only", choices=[each.name for each in SCENARIOS], help="one scenario")
    parser.add_argument("--image", type=Path, help="another firmware.bin (default: those of both cards)")
    options = parser.parse_args()
    images = {config: image_of(config) for config in configurations()}
    if options.image:
        images = {str(options.image): options.image}
    unread = [str(path) for path in images.values() if not path.is_file()]
    if unread:
        print(f"core-flips: no image {unread[0]}", file=sys.stderr)
        return 2
    chosen = [each for each in SCENARIOS if options.only in (None, each.name)]
    works = [(of, path, each) for of, path in images.items() for each in chosen]
    print(f"core-flips: {len(works)} scenarios, each takes seconds", flush=True)
    results: dict[str, dict[str, Counter]] = {of: {} for of in images}
    for of, name, flips, seconds in in_processes(options.jobs, _work, works):
        results[of][name] = flips.results
        title = f"{of}: {name}: {flips.results.total()} flips in {seconds:.0f} s"
        print("\n".join([title, *flips.found]), flush=True)
    totals = sum((found for rows in results.values() for found in rows.values()), Counter())
    for result in RESULTS:
        print(f"{totals[result]:7}  {result}")
    if not (options.image or options.only):
        keep({of: {each.name: rows[each.name] for each in chosen} for of, rows in results.items()})
    every = [found for rows in results.values() for found in rows.values()]
    return int(any(altered(found) > MOST * found.total() for found in every))


if __name__ == "__main__":
    run_main("core-flips", main, CoreError)
