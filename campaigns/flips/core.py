# SPDX-License-Identifier: Apache-2.0
"""Flips every bit of every register that the core reads while the firmware turns a request into a telegram.

    python -m campaigns.flips.core [--image FILE] [--jobs N] [--only NAME]   # make core-flips

The image of each card runs on the RV32I machine of the tests. A bit of x1 to x31 is inverted just before each
instruction that reads the register, from the candidate until its telegram has left or the request is revoked.
A flip between two such instructions is the same as one before the second of them, so these are all flips of a
scenario. One more request follows; its telegram shows the control image that was left. All scenarios with the
images of both cards write build/fuzz/core-flips.json. Exit 0: no telegram was altered (SAFE-4); 1: at least
one was; 2: an invalid command line.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.fuzz.run import FOLDER
from rtl.command import Parser, in_processes, run_main
from rtl.sources import ROOT, configurations
from tb.agents import rtu
from tb.lib.options import at_least
from tb.model import fc_telegram
from tb.model.fake_mailbox import FakeMailbox
from tb.model.fc_telegram import TelegramError
from tb.model.rv32i import Hung, Machine

H = bytes.fromhex
EARLIER = H("0F 0000 0020 04 7D04 1122")
FOLLOWING = H("05 000B FF00")
READ_514 = H("03 1413 0002")
DRIVE_SAYS = H("0F03 2000")
TEXT_WRITE = rtu.write_register(0, 0x0500)  # 40001: the index with which a write is of text
# Without a round of the loop for so long the firmware hangs. The longest round of a request takes 800.
LONGEST_ROUND = 4000
STORE = 0x23  # opcode


class CoreError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Scenario:
    """One request, and what comes before it."""

    name: str
    pdu: bytes
    broadcast: bool = False
    before: bytes | None = None  # a local write
    busy: bool = False  # the request comes while the drive answers another one
    revoked: bool = False  # a character follows before the request's t3.5 is over


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
)
# Requests that any test can make.
REQUESTS = tuple(
    each.pdu for each in SCENARIOS if not (each.busy or each.broadcast or each.before or each.revoked)
)
VALID = 0x04  # bit 10, in the control word's upper byte
ALTERED = ("altered, bit 10 = 1", "altered, bit 10 = 0")
AGAIN, REFUSED, NOBODY = "again", "refused by its BCC", "with an address of no drive"
AS_ASKED, NONE = "as asked", "none"
RESULTS = (*ALTERED, AS_ASKED, AGAIN, REFUSED, NOBODY, NONE)
FILE = FOLDER / "core-flips.json"
KEYS = {"cards", "flips", "results"}  # keys of that file


def registers_read(word: int) -> set[int]:
    """The registers that an RV32I instruction reads; x0 is none."""
    opcode, rs1, rs2 = word & 0x7F, word >> 15 & 31, word >> 20 & 31
    if opcode in (0x63, STORE, 0x33):  # branch, store, arithmetic of two registers
        return {rs1, rs2} - {0}
    return {rs1} - {0} if opcode in (0x67, 0x03, 0x13) else set()  # jalr, load, arithmetic of one


def answer(telegram: bytes) -> bytes:
    """What a drive answers to a telegram, both from ADR to PCD: a value of the asked kind."""
    if len(telegram) == 5:
        return DRIVE_SAYS
    ak = {1: 2, 2: 1}.get(telegram[1] >> 4, 15)
    return bytes([ak << 4 | telegram[1] & 0x0F]) + telegram[2:-4] + DRIVE_SAYS


@dataclass
class Stage:
    """The machine with its mailbox."""

    image: bytes | None = None
    mailbox: FakeMailbox = field(default_factory=FakeMailbox)

    def __post_init__(self) -> None:
        self.machine = Machine(self.mailbox.read, self.mailbox.write, program=self.image)
        self.machine.longest_round = LONGEST_ROUND

    def poll(self) -> None:
        self.machine.poll()
        self.machine.poll()

    def commit(self) -> None:
        self.mailbox.commit()
        self.poll()

    def revoke(self) -> None:
        self.mailbox.character()
        self.poll()

    def request(self, pdu: bytes) -> None:
        self.mailbox.candidate(pdu)
        self.poll()
        self.commit()

    def exchange(self) -> None:
        """The telegram on the line ends, and the drive answers."""
        if not self.mailbox.sending:
            return
        telegram = self.mailbox.telegrams[-1]
        self.mailbox.telegram_ends()
        self.poll()
        if fc_telegram.is_broadcast(telegram[0]):
            self.mailbox.pause_over()
        else:
            self.mailbox.drive_data(answer(telegram))
            self.poll()
            self.mailbox.bcc()
        self.poll()


@dataclass
class Run:
    """The telegrams before the request and since, and why the firmware ended if it did."""

    earlier: list[bytes] = field(default_factory=list)
    sent: list[bytes] = field(default_factory=list)
    how: str = ""


def play(
    scenario: Scenario,
    image: bytes | None = None,
    before_each: Callable[[Machine], None] = lambda machine: None,
    lost: bool = False,
) -> Run:
    """Plays a scenario, if `lost` without its request. `before_each` is called before its instructions."""
    stage = Stage(image)
    stage.request(EARLIER)
    stage.exchange()
    if scenario.before:
        stage.request(scenario.before)
    if scenario.busy:
        stage.request(READ_514)
    telegrams, machine = stage.mailbox.telegrams, stage.machine
    run, begin, step = Run(list(telegrams)), len(telegrams), machine._step

    def watched() -> None:
        before_each(machine)
        step()

    try:
        if not lost:
            stage.mailbox.candidate(scenario.pdu, scenario.broadcast)
            machine._step = watched
            stage.poll()
            if scenario.revoked:
                stage.revoke()
            else:
                stage.commit()
            if scenario.busy:
                stage.exchange()
            machine._step = step
        stage.exchange()
        stage.request(FOLLOWING)
    except TelegramError:
        run.how = REFUSED
    except (Hung, AssertionError):
        run.how = NONE  # a trap or the watchdog
    run.sent = telegrams[begin:]
    return run


def verdict(run: Run, sound: Run, lost: Run) -> str:
    """The worst thing that the telegrams of a run show, beside those of the runs without a flip."""
    # The drive's own addresses in both formats, and broadcasts (FC-2).
    heard = [one for one in run.sent if one[0] in (0x81, 0x01) or fc_telegram.is_broadcast(one[0])]
    asked = sound.sent + lost.sent
    altered = [one for one in heard if one not in asked + run.earlier]
    if altered:
        return ALTERED[0] if any(len(one) > 4 and one[-4] & VALID for one in altered) else ALTERED[1]
    if run.how == REFUSED:
        return REFUSED
    if Counter(heard) - Counter(asked):
        return AGAIN
    if heard != run.sent:
        return NOBODY
    return AS_ASKED if sound.sent[0] in run.sent else NONE


@dataclass
class EveryFlip:
    """Forks the process for each flip. A child has one flip, and plays on; the parent counts the results."""

    scenario: Scenario
    part: int = 1  # one of so many instructions
    stores: bool = False  # stores only, and the lowest seven bits: the data go to another place nearby
    results: Counter = field(default_factory=Counter)
    found: list[str] = field(default_factory=list)
    instructions: int = 0
    report: int = 0  # of a child: its end of the pipe

    def __call__(self, machine: Machine) -> None:
        if self.report:
            return
        self.instructions += 1
        if self.instructions % self.part:
            return
        word = int.from_bytes(machine.memory[machine.pc : machine.pc + 4], "little")
        if self.stores and word & 0x7F != STORE:
            return
        for register in sorted(registers_read(word)):
            for bit in range(7 if self.stores else 32):
                if self._is_child(f"{machine.pc:#x} x{register} bit {bit}"):
                    machine.x[register] ^= 1 << bit
                    return

    def _is_child(self, where: str) -> bool:
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            os.close(reading)
            self.report = writing
            return True
        os.close(writing)
        with os.fdopen(reading) as pipe:
            result, _, sent = pipe.read().partition("\n")
        os.waitpid(child, 0)
        where = f"{self.scenario.name}: instruction {self.instructions} at {where}"
        if result not in RESULTS:
            raise CoreError(f"{where}: {result or 'no result'}")
        self.results[result] += 1
        if result in ALTERED:
            self.found.append(f"{where}: {result}: {sent}")
        return False

    def end(self, result: str, sent: Iterable[bytes] = ()) -> None:
        """The end of a child."""
        telegrams = ", ".join(telegram.hex(" ") for telegram in sent)
        os.write(self.report, f"{result}\n{telegrams}".encode())
        os._exit(0)


def every_flip(
    scenario: Scenario, image: bytes | None = None, part: int = 1, stores: bool = False
) -> EveryFlip:
    """All flips of a scenario; or those before one of `part` instructions, or those of stores."""
    sound, lost = play(scenario, image), play(scenario, image, lost=True)
    if len(sound.sent) != (1 if scenario.revoked else 2) or sound.how:
        raise CoreError(f"{scenario.name}: not served without a flip")
    flips = EveryFlip(scenario, part, stores)
    try:
        run = play(scenario, image, flips)
        result = verdict(run, sound, lost)
    except Exception as error:
        if not flips.report:
            raise
        flips.end(f"{type(error).__name__}: {error}")
    if flips.report:
        flips.end(result, run.sent)
    if result != AS_ASKED:
        raise CoreError(f"{scenario.name}: the run from which the flips start: {result}")
    return flips


def image_of(config: str) -> Path:
    """The image of one card, as `make firmware` leaves it."""
    return (ROOT / configurations()[config]["firmware_hex"]).with_suffix(".bin")


def _work(work: tuple[str, Path, Scenario]) -> tuple[str, str, EveryFlip, float]:
    of, path, scenario = work
    begin = time.monotonic()
    return of, scenario.name, every_flip(scenario, path.read_bytes()), time.monotonic() - begin


def keep(results: dict[str, dict[str, Counter]]) -> None:
    """Writes the result file: by card and scenario."""
    flips = sum(found.total() for rows in results.values() for found in rows.values())
    kept = {"cards": {config: fingerprint.shard(config) for config in results}, "flips": flips}
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
    print(f"core-flips: {len(works)} scenarios, each takes minutes", flush=True)
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
    return int(any(totals[result] for result in ALTERED))


if __name__ == "__main__":
    run_main("core-flips", main, CoreError)
