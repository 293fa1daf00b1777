# SPDX-License-Identifier: Apache-2.0
# needs: card drive | setup-test
"""Long mixed traffic: pymodbus asks the virtual card, the models check both lines (COUNT=); `make soak`.

    python -m campaigns.soak.run                     the three dialects, 2,000 + 500 + 500 transactions
    python -m campaigns.soak.run --config tiny       the small card, which has the dialect `card`
    python -m campaigns.soak.run --seed 1 --count 300 --dialect builtin --profile vlt2800

Reference for the card is tb/model/card.py; reference for the drive is tb/model/vlt_drive.py, which gets the
telegrams and times of the card's log. A run is cut into blocks. The seed of a block selects the rate and the
format of the network line, too. Exit 0: no mismatch, 1: mismatches, 2: no card. Other options:
campaigns/engine.py.
"""

from __future__ import annotations

import math
import random
import tempfile
import time
from argparse import Namespace
from collections import Counter, deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from campaigns.bench import fingerprint
from campaigns.engine import Campaign, EngineError, Row, Store, total
from regs.dialects import DEFAULT
from regs.dialects import DIALECTS as TABLE
from regs.generated.card_tables import FORMATS, RATES
from rtl.command import Parser, run_main
from rtl.sources import ROOT, configurations
from sim.card.masters import Pymodbus
from sim.card.run_card import CardError, Frame, RunningCard
from sim.drive.drive_bench import NUMBERS, first_index, table
from sim.drive.drive_bench import Row as Parameter
from tb.agents.crc16 import with_crc
from tb.lib import bound
from tb.model import fc_telegram as fc
from tb.model.card import DIALECTS, DRIVE_TIMEOUT, NETWORK_TIMEOUT, CardModel, Step
from tb.model.lines import image_of
from tb.model.told import not_told
from tb.model.vlt_drive import PROFILES, VltDrive

BLOCK = 500  # transactions at one rate and in one format
COUNT = 3000
# Dialect, drive, share of the transactions.
RUNS = [
    (name, one.profiles[0 if name == DEFAULT else -1], 4 if name == DEFAULT else 1)
    for name, one in TABLE.items()
]
UNIT, OTHER_UNIT, BROADCAST = 1, 7, 0
# Switches 1-3 of rates that suit the clock of the virtual card and are not too slow.
SWIFT = [bits for bits, rate in RATES.items() if rate.baud >= 9600]
PROGRAMS = {"standard": ROOT / "build/card", "tiny": ROOT / "build/tiny/card"}
UNANSWERED_S = 0.15  # simulated, after a request without a reply, as after a broadcast
PDU_MAX = 253
COMMANDS = (0x047C, 0x047C, 0x043C, 0x0474, 0x046C, 0x0478, 0x045C, 0x057C, 0x04FC, 0x847C, 0x067C, 0x1C7C)
UNKNOWN_FUNCTIONS = (0x02, 0x04, 0x07, 0x08, 0x0B, 0x11, 0x16, 0x17, 0x2B, 0x41)
MISMATCHES_MAX = 10


def wire(*words: int) -> bytes:
    """16-bit words, high byte first."""
    return b"".join((word & 0xFFFF).to_bytes(2, "big") for word in words)


@dataclass(frozen=True)
class Transaction:
    kind: str
    unit: int
    pdu: bytes
    received: bytes = b""


READ_IMAGE = Transaction("read_image", UNIT, b"\x01" + wire(0, 32))  # the last one of a block


class Traffic:
    """Valid and invalid requests of masters, for one dialect and one drive."""

    def __init__(self, rng: random.Random, dialect: str, profile: str) -> None:
        self.rng = rng
        self.profile = profile
        self.dialect = DIALECTS[dialect]
        self.rows = table(profile)
        self.texts = [row for row in self.rows if row["type"] == "text"]
        self.arrays = [row for row in self.rows if row["array"] != "0"]
        self.numbers = [row for row in self.rows if row["type"] != "text"]
        self.setup = next(row for row in self.rows if row["role"] == "active_setup")
        self.kinds = {
            self.read_number: 20,
            self.write_number: 20,
            self.command: 12,
            self.write_coils: 6,
            self.read_coils: 8,
            self.local: 8,
            self.text: 14,
            self.array: 6,
            self.to_all: 4,
            self.wrong: 10,
            self.to_another: 2,
        }

    def requests(self, count: int) -> list[Transaction]:
        made: list[Transaction] = []
        while len(made) < count:
            (kind,) = self.rng.choices(list(self.kinds), self.kinds.values())
            made += [Transaction(kind.__name__, unit, pdu) for unit, pdu in kind()]
        return made[:count]

    # Each of the following methods makes one request, or some that belong together: unit address and PDU.

    def read_number(self) -> list[tuple[int, bytes]]:
        row = self.rng.choice(self.rows if self.rng.random() < 0.1 else self.numbers)
        pnu = int(row["pnu"]) if self.rng.random() < 0.95 else self.rng.randrange(4200)
        off = 0 if self.rng.random() < 0.95 else self.rng.randrange(10)
        count = 1 + NUMBERS.get(row["type"], False) if self.rng.random() < 0.8 else self.rng.choice((1, 2))
        return [(UNIT, b"\x03" + wire(10 * pnu - 1 + off, count))]

    def write_number(self) -> list[tuple[int, bytes]]:
        row = self.setup if self.rng.random() < 0.05 else self.rng.choice(self.numbers)
        return [(UNIT, self._write(row))]

    def _write(self, row: Parameter) -> bytes:
        low, high = int(row["min"]), int(row["max"])
        fitting = self.rng.randint(low, high)
        value = self.rng.choice((fitting, fitting, low, high, high + 1))
        start = 10 * int(row["pnu"]) - 1
        double = NUMBERS[row["type"]] != (self.rng.random() < 0.1)
        if double:
            return b"\x10" + wire(start, 2) + b"\x04" + wire(value >> 16, value)
        if self.rng.random() < 0.2:
            return b"\x10" + wire(start, 1) + b"\x02" + wire(value)
        return b"\x06" + wire(start, value)

    def command(self) -> list[tuple[int, bytes]]:
        reference = self.rng.choice((0, 0x1999, 0x2000, 0x4000, 0xE000, self.rng.randrange(0x10000)))
        word = self.rng.choice(COMMANDS)
        block = word.to_bytes(2, "little") + reference.to_bytes(2, "little")
        return [(UNIT, b"\x0f" + wire(0, 32) + b"\x04" + block), (UNIT, b"\x01" + wire(32, 32))]

    def write_coils(self) -> list[tuple[int, bytes]]:
        start = self.rng.choice((self.rng.randrange(32), self.rng.randrange(32), 64, self.rng.randrange(140)))
        if self.rng.random() < 0.6:
            value = self.rng.choice((0x0000, 0xFF00, 0x0000, 0xFF00, self.rng.randrange(0x10000)))
            return [(UNIT, b"\x05" + wire(start, value))]
        count = 1 if start == 64 else self.rng.randint(1, 32)
        size = -(-count // 8)
        return [(UNIT, b"\x0f" + wire(start, count) + bytes([size]) + self.rng.randbytes(size))]

    def read_coils(self) -> list[tuple[int, bytes]]:
        start = self.rng.choice((0, 16, 32, 48, 64, self.rng.randrange(140)))
        return [(UNIT, b"\x01" + wire(start, self.rng.choice((1, 16, 32, self.rng.randint(1, 140)))))]

    def _wait(self) -> int:
        """For register 40003: long enough for the simulated drive, or refused."""
        return self.rng.choice((15, 15, 30, self.rng.randint(15, 100), 0))

    def local(self) -> list[tuple[int, bytes]]:
        """The card's own registers."""
        wait = self._wait()
        index = wire(self.dialect.index_register)
        return [
            self.rng.choice(
                (
                    (UNIT, b"\x03" + wire(self.rng.randrange(10), self.rng.randint(1, 4))),
                    (UNIT, b"\x06" + wire(NETWORK_TIMEOUT, self.rng.randrange(0x10000))),
                    (UNIT, b"\x06" + wire(DRIVE_TIMEOUT, wait)),
                    (UNIT, b"\x10" + wire(1, 2) + b"\x04" + wire(self.rng.randrange(0x10000), wait)),
                    (UNIT, b"\x06" + index + wire(self.rng.choice((0, 0, 1, 0x0400, 0x0500, 0x0A07)))),
                    (UNIT, b"\x06" + wire(self.rng.randrange(3, 9), 1)),
                )
            )
        ]

    def _index(self, value: int) -> tuple[int, bytes]:
        return UNIT, b"\x06" + wire(self.dialect.index_register, value)

    def text(self) -> list[tuple[int, bytes]]:
        """Reads or writes a text, in the `card` dialect between two writes of IND (MAP-8)."""
        row = self.rng.choice(self.texts if self.rng.random() < 0.9 else self.rows)
        start = 10 * int(row["pnu"]) - 1
        count = self.rng.randint(1, 11)
        if self.rng.random() < 0.5:
            ind, pdu = 0x0400, b"\x03" + wire(start, count)
        else:
            characters = bytes(self.rng.choices(range(0x20, 0x7F), k=2 * count))
            ind, pdu = 0x0500, b"\x10" + wire(start, count) + bytes([2 * count]) + characters
        if self.dialect.text_by_size:
            return [(UNIT, pdu)]
        forgets = self.rng.random() < 0.1
        return [self._index(ind), (UNIT, pdu)] + ([] if forgets else [self._index(0)])

    def array(self) -> list[tuple[int, bytes]]:
        row = self.rng.choice(self.arrays)
        index = first_index(self.profile, row) + self.rng.randint(-1, int(row["array"]))
        count = 1 + NUMBERS[row["type"]]
        read = (UNIT, b"\x03" + wire(10 * int(row["pnu"]) - 1, count))
        return [self._index(max(index, 0)), read, self._index(0)]

    def to_all(self) -> list[tuple[int, bytes]]:
        of_one = self.rng.choice((self.command, self.write_number, self.read_number, self.write_coils))()
        return [(BROADCAST, of_one[0][1])]

    def to_another(self) -> list[tuple[int, bytes]]:
        return [(OTHER_UNIT, self.command()[0][1])]

    def wrong(self) -> list[tuple[int, bytes]]:
        """Unknown functions, wrong lengths, quantities and byte counts."""
        good = self.rng.choice((self.read_number, self.write_number, self.command, self.read_coils))()[0][1]
        pdu = self.rng.choice(
            (
                bytes([self.rng.choice(UNKNOWN_FUNCTIONS)]) + self.rng.randbytes(self.rng.randrange(8)),
                good + self.rng.randbytes(self.rng.randint(1, 4)),
                good + self.rng.randbytes(self.rng.randint(20, PDU_MAX - len(good))),
                good[: self.rng.randint(2, len(good) - 1)],
                good[:3] + wire(self.rng.choice((0, 3, 11, 33, 129, 0xFFFF))) + good[5:],
            )
        )
        return [(UNIT, pdu)]


@dataclass
class SoakJudge:
    """Compares both lines and the master's replies with the models."""

    card: CardModel
    drive: VltDrive
    frames: list[Frame]
    mismatches: list[str] = field(default_factory=list)
    wrong: int = 0  # transactions with a mismatch, and frames that none of them expected
    replies: Counter = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.seen = {
            where: deque(f for f in self.frames if (f.line, f.sender) == where)
            for where in (("modbus", "master"), ("modbus", "card"), ("drive", "card"), ("drive", "drive"))
        }
        self.drive_us = 0

    def expect(self, line: str, sender: str, wanted: bytes) -> Frame | None:
        """Takes the next frame of this sender; records a mismatch if it is not the wanted one."""
        queue = self.seen[line, sender]
        frame = queue.popleft() if queue else None
        if frame is None or frame.data != wanted:
            got = f"{frame.data.hex(' ')} at {frame.start:.6f} s" if frame else "nothing"
            self.mismatches.append(f"{line} line, {sender}: expected {wanted.hex(' ')}, got {got}")
        return frame

    def transaction(self, asked: Transaction) -> None:
        self.expect("modbus", "master", with_crc(bytes([asked.unit]) + asked.pdu))
        step = Step()
        if asked.unit in (UNIT, BROADCAST):
            step = self.card.request(asked.pdu, broadcast=asked.unit == BROADCAST)
        while step.telegram is not None:
            step = self.exchange(step.telegram)
        wanted = with_crc(bytes([UNIT]) + step.reply) if step.reply else b""
        if wanted:
            self.expect("modbus", "card", wanted)
        if asked.received != wanted:
            self.mismatches.append(f"master: expected {wanted.hex(' ')}, got {asked.received.hex(' ')}")
        self.replies[self.sort(step.reply)] += 1

    @staticmethod
    def sort(reply: bytes | None) -> str:
        if not reply:
            return "no reply"
        return f"exception {reply[1]}" if reply[0] & 0x80 else f"function {reply[0]:02X}"

    def exchange(self, telegram: bytes) -> Step:
        """A telegram to the drive and, except for a broadcast, its reply."""
        wanted = fc.build(telegram[1:], adr=telegram[0])
        frame = self.expect("drive", "card", wanted)
        if frame is None:
            return Step()
        now_us = round(frame.end * 1e6)
        self.drive.step(now_us - self.drive_us)
        self.drive_us = now_us
        reply = self.drive.telegram(wanted)
        if reply is None:
            return Step()
        self.expect("drive", "drive", reply)
        return self.card.drive_reply(reply[2:-1])

    def told(self, image: bytes) -> str:
        """SAFE-8 from the log, with the answer to a last reading of coils 1-32."""
        drive = [frame for frame in self.frames if frame.line == "drive"]
        after = [*(frame.sender == "drive" for frame in drive[1:]), False]
        return not_told(
            [(f.data, good) for f, good in zip(drive, after, strict=True) if f.sender == "card"], image
        )

    def check_all(self, transactions: list[Transaction]) -> None:
        for number, asked in enumerate(transactions):
            before = len(self.mismatches)
            self.transaction(asked)
            if len(self.mismatches) > before:
                what = f"transaction {number}, {asked.kind}, unit {asked.unit}: {asked.pdu.hex(' ')}"
                self.mismatches.insert(before, what)
                self.wrong += 1
            if len(self.mismatches) > MISMATCHES_MAX:
                return
        for (line, sender), left in self.seen.items():
            self.mismatches += [f"{line} line, {sender}: not expected: {f.data.hex(' ')}" for f in left]
            self.wrong += len(left)
        if transactions and transactions[-1].kind == READ_IMAGE.kind and transactions[-1].received:
            wrong = self.told(image_of(transactions[-1].received))
            self.mismatches += [wrong] if wrong else []
            self.wrong += bool(wrong)


@dataclass(frozen=True)
class Result:
    transactions: list[Transaction]
    mismatches: list[str]
    wrong: int  # transactions with a mismatch
    replies: Counter  # number of replies by function or exception code
    wall_s: float
    simulated_s: float
    line: str  # rate and format

    def __str__(self) -> str:
        return (
            f"{len(self.transactions)} transactions: {self.wrong} with a mismatch, "
            f"{len(self.transactions) / self.wall_s:.1f} transactions/s, "
            f"{self.simulated_s:.1f} s simulated in {self.wall_s:.1f} s"
        )


def soak(folder: Path, seed: int, count: int, dialect: str, profile: str, config: str = "standard") -> Result:
    """One block; `seed` also selects rate and format of the network line.

    A card that ends or no longer speaks is a mismatch of the block, which keeps its transactions until then.
    """
    rng = random.Random(f"soak/{dialect}/{profile}/{seed}")
    rate_switches, format_switches = rng.choice(SWIFT), rng.choice(list(FORMATS))
    rate, line_format = RATES[rate_switches], FORMATS[format_switches]
    switches = f"{rate_switches}{format_switches}0000"
    line = f"{rate.baud} bit/s 8{line_format.parity[0].upper()}{line_format.stop_bits}"
    options = ("--dialect", dialect, "--profile", profile, "--sw-baud", switches, "--speed", "max", "--quiet")
    options += ("--control",)
    done, ended = [], ""
    with RunningCard(folder, *options, program=PROGRAMS[config]) as card:
        began = time.monotonic()
        try:
            with Pymodbus(card.link) as master:
                for asked in [*Traffic(rng, dialect, profile).requests(count - 1), READ_IMAGE]:
                    answered = asked.unit == UNIT
                    before = 0 if answered else len(card.frames())
                    received = master.send(asked.unit, asked.pdu, answered)
                    if not answered:
                        turn_around(card, before)
                    done.append(Transaction(asked.kind, asked.unit, asked.pdu, received))
            if card.stop() != 0:
                ended = "the card does not end with code 0"
        except (CardError, ConnectionError) as error:
            ended = f"the card no longer speaks: {error}"
        wall = time.monotonic() - began
        entries, frames = card.entries(), card.frames()
    judge = SoakJudge(CardModel(name=dialect), VltDrive(profile), frames)
    judge.check_all(done)
    if ended:
        judge.mismatches.append(ended)
        judge.wrong += 1
    simulated_s = entries[-1]["t"] if entries else 0.0
    return Result(done, judge.mismatches, judge.wrong, judge.replies, wall, simulated_s, line)


def turn_around(card: RunningCard, before: int) -> None:
    """Waits in the card's time, for a busy machine may stop its process for any time."""
    heard = card.wait_for_frames(before, "modbus", "master")
    if not heard:
        raise CardError("a request has not reached the card")
    while card.state()["state"] < heard[-1].end + UNANSWERED_S:
        time.sleep(0.001)


class Soak(Campaign):
    every_dialect = True
    name, module = "soak", "campaigns.soak.run"
    command = "make soak of both cards"
    unit = "transactions"
    count = COUNT
    keep = tuple(f"The {config} card" for config in configurations())

    def options(self, parser: Parser) -> None:
        parser.add_argument("--dialect", choices=DIALECTS, help="this one only")
        parser.add_argument("--profile", choices=PROFILES, help="drive, instead of the dialect's own")

    def cases(self, given: Namespace) -> list[str]:
        """Blocks; `count` are the transactions in all."""
        # Only the standard card has images of the other dialects (docs/guide/dialects.md).
        chosen = given.dialect if given.config == "standard" else DEFAULT
        if given.dialect not in (None, chosen):
            raise EngineError(f"the card {given.config} has no dialect {given.dialect}")
        runs = [each for each in RUNS if chosen in (None, each[0])]
        shares = sum(share for *_, share in runs)
        return [
            f"{dialect}/{given.profile or profile}/{seed}/{count}"
            for dialect, profile, share in runs
            for seed, count in blocks(given.seed, math.ceil(given.count * share / shares)).items()
        ]

    def run(self, config: str, case: str) -> Row:
        dialect, profile, seed, count = case.split("/")
        with tempfile.TemporaryDirectory() as folder:
            result = soak(Path(folder), int(seed), int(count), dialect, profile, config)
        return {
            "wrong": "; ".join(result.mismatches),
            "line": [result.line],
            "transactions": len(result.transactions),
            "mismatches": result.wrong,
            "replies": result.replies,
            "simulated_s": result.simulated_s,
        }

    def said(self, rows: dict[str, Row]) -> str:
        sums = total(rows.values())
        return f"{sums['transactions']:,} transactions, {sums['mismatches']} with a mismatch"

    def context(self, store: Store) -> dict[str, Any]:
        cards = self.found(store)
        for card in cards:
            card.runs = runs_of(card.config, card.rows)
        return {"cards": cards, "block": BLOCK}


def blocks(seed: int, count: int) -> dict[int, int]:
    """Seed of each block, and its transactions."""
    return {seed + at // BLOCK: min(BLOCK, count - at) for at in range(0, count, BLOCK)}


def runs_of(config: str, rows: dict[str, Row]) -> list[tuple[list, Row]]:
    """For each dialect and drive: the cells of its row in the table, and the sums of its blocks."""
    runs: dict[str, dict[str, Row]] = {}
    for case, row in rows.items():
        # Of two blocks with the same seed the longer contains the other one. What was found once stays.
        run, seed, _ = case.rsplit("/", 2)
        of = runs.setdefault(run, {})
        of[seed] = max(row, of.get(seed, row), key=lambda one: (one["mismatches"] > 0, one["transactions"]))
    found = []
    for run, of in runs.items():
        dialect, profile = run.split("/")
        sums = total(of.values())
        seen, count = sums["mismatches"], sums["transactions"]
        cells = [
            dialect,
            f"`{fingerprint.firmware(config, dialect)}`",
            profile,
            len(of),
            in_short(sums["line"]),
        ]
        cells += [f"{count:,}", seen, bound.words(seen, count), f"{sums['simulated_s'] / 60:.0f} min"]
        found.append((cells, sums))
    return found


def in_short(lines: list[str]) -> str:
    """Rates with their formats: 9600 bit/s 8E1 and 9600 bit/s 8N1 as `9600: 8E1 8N1`."""
    rates: dict[int, list[str]] = {}
    for line in sorted(set(lines)):
        rate, _, line_format = line.split()
        rates.setdefault(int(rate), []).append(line_format)
    return "; ".join(f"{rate}: {' '.join(rates[rate])}" for rate in sorted(rates))


CAMPAIGN = Soak()

if __name__ == "__main__":
    run_main("soak", CAMPAIGN.main, CardError, ConnectionError, EngineError)
