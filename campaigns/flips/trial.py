# SPDX-License-Identifier: Apache-2.0
"""One flipped bit in the running card, under traffic, and its effect (SAFE-4).

The traffic is that of a plant: commands, readings, a frame for another unit, a revoked frame. The bit flips
at a random clock during it, or while the firmware starts. Afterwards the master goes on, is silent for longer
than the watchdog time, and sends a request once more.
"""

from __future__ import annotations

import random
from collections import defaultdict
from dataclasses import dataclass, field

from campaigns.fuzz.case import Pace, Played, Player, clk_hz, serv_pace
from campaigns.soak.run import wire
from regs.generated.mailbox import FRAMES_BYTES
from rtl.sources import configuration
from sim.harness import registers
from sim.harness.library import Target
from sim.harness.pins import SIGNALS
from sim.harness.registers import Register
from tb.agents import rtu
from tb.agents.crc16 import crc_good, with_crc
from tb.model import fc_telegram
from tb.model.card import READS, CardModel
from tb.model.whole_card import NEVER, LineJudge, Verdict
from tb.model.wire import LineFormat, drive_line, taken_by_a_drive

ADDRESS = 1
# Formats of the eight rates (LINE-2, LINE-3); the first rate is the default. At the slowest rate the firmware
# queues its telegram long before the commit, at the fastest it rarely does.
FORMS = {
    38400: "8E1",
    19200: "8N2",
    9600: "8O1",
    4800: "8N1",
    115200: "8E1",
    2400: "8O1",
    1200: "8N2",
    300: "8N1",
}
BAUDS = tuple(FORMS)
BYTES_PER_WORD = 4
# Words of register x0 in the register file. SERV's file has words of two bits.
CORE_X0_WORDS = {"standard": 1, "tiny": 16}
START = rtu.write_coils(0, [bool(0x047C >> i & 1) for i in range(16)])
COIL_WRITES = {0x05, 0x0F}
CLEAR_BITS = 0.5  # FRAME-1 permits a quarter of a bit either way
VALID = 0x0400  # bit 10 of the control word: the drive takes the process data (FC-5)
# The watchdog bites 80 ms after the last kick at the latest, and the firmware starts in 25 ms.
SILENCE_S = 0.12
SERV_CLK_HZ = 5_000_000  # of the small card here: its own clock costs seven times the time
SERV_BOOT_S = 0.2  # of that clock; it answers after 0.15 s at the latest
PACES = {"standard": Pace(), "tiny": serv_pace(SERV_CLK_HZ, SERV_BOOT_S)}
SHOW_STEP_S = 0.25  # of the LEDs' show at a start (LED-1)
TICK_S = 1 / 1200  # of the firmware's time
BITES = 3  # watchdog resets until the card halts (LED-5)
# A sender that a flip restarts may append a frame to the present one, but no more: two of the longest frames,
# 34 characters each, and a margin.
LONGEST_CHARACTERS = 2 * 35
COMMIT_AFTER = 0.9  # of t3.5 after a frame: from then on it may be committed
COMMIT_BY = 1.1  # of t3.5: from then on it is
TURN_BITS = 25  # drive bits before its start at which a waiting write has its turn: the pause, and a margin
# Trials with the same traffic, which the card plays once for all of them (campaigns/flips/group.py).
GROUP = 25
# Parts for flips, with their weights: by area nearly all flips would hit code that never runs again.
PARTS = {"card": 45, "core": 15, "core registers": 6, "frame memory": 8, "data": 20, "code": 6}

# Effects of a flip, worst first.
FORBIDDEN = (
    "unrequested telegram, bit 10 = 1",
    "altered telegram, bit 10 = 1",
    "unrequested telegram, bit 10 = 0",
    "altered telegram, bit 10 = 0",
    "driver stuck",
)
OUTCOMES = (
    *FORBIDDEN,
    "no telegram, but the drive line disturbed",
    "telegram again or late",
    "halted, both LEDs red",
    "reset by the watchdog",
    "exception to the master",
    "wrong reply",
    "silent for good",
    "silent",
    "timing",
    "no effect",
)


@dataclass(frozen=True)
class Flip:
    at: int
    path: str
    word: int
    bit: int
    part: str

    def __str__(self) -> str:
        return f"{self.path}[{self.word}] bit {self.bit} at {self.at}"


@dataclass
class Outcome:
    flip: Flip
    what: str
    why: str = ""
    recovered: bool = True


def flipped_card(config: str = "standard") -> Target:
    """The card as the boards have it: other simulations run one core of the standard card."""
    return Target(config=config, parameters=(("LOCKSTEP", 1),) if config == "standard" else ())


@dataclass
class Places:
    """All bits that can flip, by part. `code` and `data` divide the firmware's memory."""

    target: Target = field(default_factory=flipped_card)
    baud: int = BAUDS[0]

    def __post_init__(self) -> None:
        config = self.target.config
        self.line = LineFormat(self.baud, FORMS[self.baud], clk_hz(self.baud, PACES[config]))
        self.registers = registers.registers(self.target.files(), self.line.clk_hz, self.target.parameters)
        program = (self.target.image_folder("card") / "firmware.bin").read_bytes()
        image = len(program) // BYTES_PER_WORD
        words = configuration(config)["memory_bytes"] // BYTES_PER_WORD
        frames = FRAMES_BYTES // BYTES_PER_WORD
        self.by_part: dict[str, list[tuple[Register, range, int]]] = {part: [] for part in PARTS}
        for register in self.registers:
            core = register.path.startswith("core_i.")
            if not register.memory:
                self._put("core" if core else "card", register, range(1))
            elif core:
                # Register x0 is never read.
                self._add("core registers", register, range(CORE_X0_WORDS[config], register.words.stop))
            else:
                self._add("code", register, range(image))
                self._add("data", register, range(image, words - frames))
                self._add("frame memory", register, range(words - frames, words))

    def _put(self, part: str, register: Register, words: range) -> None:
        self.by_part[part].append((register, words, len(words) * len(register.bits)))

    def _add(self, part: str, memory: Register, words: range) -> None:
        reached = range(max(words.start, memory.words.start), min(words.stop, memory.words.stop))
        if reached:
            self._put(part, memory, reached)

    def bits(self, part: str) -> int:
        return sum(count for _, _, count in self.by_part[part])

    def choose(self, rng: random.Random, at: int) -> Flip:
        parts = [part for part in PARTS if self.by_part[part]]
        (part,) = rng.choices(parts, [PARTS[part] for part in parts])
        places = self.by_part[part]
        register, words, _ = rng.choices(places, [count for _, _, count in places])[0]
        return Flip(at, register.path, rng.choice(words), rng.choice(register.bits), part)


def too_early(line: LineFormat, when: float = 0.5) -> float:
    """Bits after a frame at which another character revokes it: from t1.5 (0) to t3.5 (1), clear of both."""
    return line.t15_bits + CLEAR_BITS + when * (line.t35_bits - line.t15_bits - 2 * CLEAR_BITS)


def traffic(rng: random.Random, line: LineFormat) -> list[dict]:
    """Commands with and without bit 10 and other traffic of a plant; the last command starts the motor."""

    def frame(what: str, pdu: bytes, unit: int = ADDRESS) -> dict:
        gap = ["idle", round(rng.uniform(1, 20), 1)]
        return {"what": what, "gap": gap, "bytes": with_crc(bytes([unit]) + pdu).hex()}

    def command(word: int, unit: int = ADDRESS, spoilt: bool = False) -> dict:
        block = word.to_bytes(2, "little") + rng.randrange(0x4000).to_bytes(2, "little")
        event = frame("command", b"\x0f" + wire(0, 32) + b"\x04" + block, unit)
        if spoilt:
            event["bytes"] = event["bytes"][:-1] + f"{int(event['bytes'][-1], 16) ^ 1:x}"
        return event

    def reference() -> dict:
        return frame("reference", b"\x0f" + wire(16, 16) + b"\x02" + rng.randbytes(2))

    def revoked() -> dict:
        event = command(0x047C)
        event["bytes"] += "55"
        event["gaps"] = {str(len(event["bytes"]) // 2 - 1): too_early(line, rng.random())}
        return event

    kinds = (
        lambda: command(0x047C),
        lambda: command(rng.choice((0x0438, 0x043C, 0x003C, 0x007C))),
        lambda: command(0x047C, 0),
        reference,
        lambda: frame("status", rtu.read_coils(32, 32)),
        lambda: frame("image", rtu.read_coils(0, 32)),
        lambda: frame("read", rtu.read_registers(5139, 2)),
        lambda: frame("read", rtu.read_registers(2049, 1)),
        lambda: frame("write", rtu.write_register(2049, rng.randrange(0x4000))),
        lambda: frame("local", rtu.read_registers(0, 3)),
        lambda: frame("local", rtu.write_register(1, rng.randrange(0x10000))),
        lambda: frame("unknown", b"\x2b\x0e"),
        lambda: frame("another's", rtu.read_coils(0, 8), 9),
        lambda: command(0x047C, 9),
        lambda: command(0x047C, spoilt=True),
        revoked,
    )
    first = command(rng.choice((0x047C, 0x007C)))
    return [first, *(rng.choice(kinds)() for _ in range(4))]


class FlipPlayer(Player):
    """Plays a case and flips one bit on the way."""

    def __init__(self, case: dict, target: Target, flip: Flip | None) -> None:
        super().__init__(case, target, extra="flips", pace=PACES[target.config])
        self.flip = flip
        names = {name: number for number, (name, _, _) in enumerate(self.pins.variables())}
        self.pins.watch(names[f"TOP.{registers.TOP}.core_rst"])
        self.variable = names[f"TOP.{registers.TOP}.{flip.path}"] if flip else 0
        self.resets = 0  # clocks of them since the flip
        self.resets_before: int | None = None  # clocks of them before the flip, as at power-up
        self.reset_from = NEVER  # clock from which the card may have restarted

    def _run(self, until: float, to_the_end: bool = True) -> list[tuple[int, int]]:
        since, before = self.pins.now, self.pins.watched()
        switched = self._run_with_flips(until, to_the_end)
        if self.pins.watched() > before:
            self.reset_from = min(self.reset_from, since)
        return switched

    def _run_with_flips(self, until: float, to_the_end: bool) -> list[tuple[int, int]]:
        flip = self.flip
        if flip is None or flip.at >= until:
            return super()._run(until, to_the_end)
        switched = super()._run(max(flip.at, self.pins.now + 1), to_the_end)
        if self.pins.now >= flip.at:
            self.flip = None
            self._make(flip, self.variable)
        if switched and not to_the_end:
            return switched
        return super()._run(until, to_the_end) if self.pins.now < until else switched

    def _make(self, flip: Flip, variable: int) -> None:
        self.resets_before = self.pins.watched()
        self.pins.flip(variable, flip.word, flip.bit)

    def play_all(self) -> None:
        self._run(int(self.pace.boot_s * self.line.clk_hz))
        self.finish()

    def outcome(self, flip: Flip) -> tuple[Outcome, Played, Verdict]:
        lit, played = self.pins.lit(), self.played()
        judge = LineJudge(CardModel(), self.line, ADDRESS, self.pace.budget_clocks)
        verdict = judge.evaluate(played.network, played.drive, played.replies, played.telegrams, played.end)
        outcome = classify(flip, played, verdict, self, lit)
        if outcome.what in FORBIDDEN and (began := self._began_again()) < NEVER:
            self.resets, self.reset_from = max(self.resets, 1), min(self.reset_from, max(began, flip.at))
            outcome = classify(flip, played, verdict, self, lit)
        return outcome, played, verdict

    def _began_again(self) -> float:
        """The clock at which the program began again, by the LEDs' show; NEVER: it did not (LED-1).

        A flip can begin it again without a reset that is counted: by a jump to its start, or by a reset of
        one clock. Runs on until the show of such a start has turned the drive LED from red to green.
        """
        shown = [at for at, lit in self.pins.edges[SIGNALS.index("led_drive_red")] if lit]
        if not shown:
            return NEVER
        boot, step, tick = shown[0], SHOW_STEP_S * self.line.clk_hz, TICK_S * self.line.clk_hz
        self._run(self.pins.now + boot + 2 * step)
        began = [at - step - boot for at in turns_green(self.pins.edges)]
        return next((at - tick for at in began if at > 2 * tick), NEVER)

    def finish(self) -> None:
        started, self.reset_from = self.pins.watched(), NEVER
        for event in self.case["events"]:
            self._event(event)
        self._settle()
        self._run(self.pins.now + SILENCE_S * self.line.clk_hz)
        probes = [
            {"gap": ["idle", 30.0], "pdu": rtu.read_coils(0, 32).hex()},
            {
                "gap": ["idle", 30.0],
                "pdu": rtu.write_coils(0, [bool(0x047C >> i & 1) for i in range(16)]).hex(),
            },
        ]
        self._ask(probes)
        self.resets = self.pins.watched() - (started if self.resets_before is None else self.resets_before)
        if self.resets:
            # A damaged program is detected at each start; the card halts after the third.
            self._run(self.pins.now + BITES * self.pace.boot_s * self.line.clk_hz)
            self._ask(probes)

    def _ask(self, probes: list[dict]) -> None:
        for event in probes:
            self._event(event)
        self._settle()


def case_of(number: str, places: Places, events: list[dict] | None = None) -> dict:
    """The traffic of a trial SEED/NUMBER, which all trials of its group share."""
    seed, _, count = number.rpartition("/")
    group = f"{seed}/{int(count) // GROUP}" if seed else number
    return {
        "baud": places.baud,
        "form": places.line.form,
        "address": ADDRESS,
        "dialect": "card",
        "profile": "vlt6000",
        "events": events or traffic(random.Random(f"flips/traffic/{group}"), places.line),
    }


def flip_of(number: str, places: Places) -> Flip:
    rng = random.Random(f"flips/{number}")
    boot_clocks = int(PACES[places.target.config].boot_s * places.line.clk_hz)
    traffic_s = 0.2 * max(1, 9600 / places.baud)
    at = rng.randrange(boot_clocks // 4, boot_clocks + int(traffic_s * places.line.clk_hz))
    return places.choose(rng, at)


def trial(
    number: str, places: Places, flip: Flip | None = None, events: list[dict] | None = None
) -> tuple[Outcome, dict, Played, Verdict]:
    """One flip; the number determines traffic and flip, unless they are given."""
    case = case_of(number, places, events)
    flip = flip or flip_of(number, places)
    player = FlipPlayer(case, places.target, flip)
    try:
        player.play_all()
        outcome, played, verdict = player.outcome(flip)
    finally:
        player.pins.close()
    return outcome, case, played, verdict


# ---------------------------------------------------------------- verdict


def classify(flip: Flip, played: Played, verdict: Verdict, player: FlipPlayer, lit: set[str]) -> Outcome:
    clk = player.line.clk_hz
    answered = bool(played.replies) and played.replies[-1].rise > played.network[-1].end
    what, why = telegrams(flip, played, player.line, player.reset_from)
    # A flip of the switches' copy is another rate until the next reset; a reply takes the time of that rate.
    slow = flip.path.startswith("switches_i.baud")
    network = LineFormat(min(BAUDS), FORMS[min(BAUDS)], clk) if slow else player.line
    lines = ((played.replies, network), (played.telegrams, drive_line(clk)))
    stuck = [b for bursts, line in lines for b in bursts if b.fall - b.rise > longest(line)]
    if stuck and what not in FORBIDDEN:
        what, why = "driver stuck", f"for {(stuck[0].fall - stuck[0].rise) / clk:.3f} s"
    if what:
        return Outcome(flip, what, why, answered)
    if lit == {"led_modbus_red", "led_drive_red"} and not answered:
        return Outcome(flip, "halted, both LEDs red", "", False)
    if player.resets:
        return Outcome(flip, "reset by the watchdog", f"{player.resets} clocks", answered)
    if not verdict.differences:
        return Outcome(flip, "no effect", verdict.unclear, answered)
    why = verdict.differences[0]
    if ": telegram " in why:  # telegrams() found this telegram to be requested
        return Outcome(flip, "telegram again or late", why, answered)
    if not answered:
        return Outcome(flip, "silent for good", why, False)
    if "no reply" in why or "no telegram" in why:
        return Outcome(flip, "silent", why)
    if "PERF" in why or "FRAME-8" in why:
        return Outcome(flip, "timing", why)
    return Outcome(flip, reply_effect(played), why)


def turns_green(edges: dict[int, list[tuple[int, int]]]) -> list[int]:
    """Clocks at which the drive LED turns from red to green with the network LED dark, as in the show."""
    red, green, *network = (
        edges[SIGNALS.index(f"led_{led}")]
        for led in ("drive_red", "drive_green", "modbus_red", "modbus_green")
    )
    falls = {at for at, lit in red if not lit}
    return [at for at, lit in green if lit and at in falls and not any(level_at(led, at) for led in network)]


def level_at(edges: list[tuple[int, int]], at: int) -> int:
    return next((level for clock, level in reversed(edges) if clock <= at), 0)


def longest(line: LineFormat) -> float:
    """Longest time in clocks for which a driver may be on, with a flipped bit."""
    return LONGEST_CHARACTERS * line.character_bits * line.bit


def reply_effect(played: Played) -> str:
    """Effect that the master notices: an exception that is new to this traffic."""
    for burst in played.replies:
        data = burst.data
        if len(data) == 5 and crc_good(data) and data[1] & 0x80 and data[1] != 0xAB:
            return "exception to the master"
    return "wrong reply"


def telegrams(flip: Flip, played: Played, line: LineFormat, reset_from: float = NEVER) -> tuple[str, str]:
    """Compares telegrams that a drive would accept with the requests. `reset_from`: see expected()."""
    frames = asked(played, line)
    causes = expected(frames, played, reset_from)
    found: dict[str, str] = {}
    sent: dict[int, list[float]] = defaultdict(list)  # times of the telegrams of each request
    # Until a newer request is committed, the older one's telegram may still leave.
    t35 = line.t35_bits * line.bit
    commit = COMMIT_AFTER * t35
    taken, rest = taken_by_a_drive(played.telegrams, drive_line(line.clk_hz))
    for data in rest:
        found.setdefault("no telegram, but the drive line disturbed", data.hex(" "))
    for at, data in taken:
        # A write that had its turn by then leaves after the pause, although a newer one came since.
        turn = at - commit - TURN_BITS * drive_line(line.clk_hz).bit
        newest = [_newest(frames, at - share * t35) for share in (COMMIT_AFTER, COMMIT_BY)]
        found_for = [
            _requested_by(played, frames, causes[: number + 1], sent, at, data, turn) for number in newest
        ]
        cause = found_for[0] if found_for[0] is not None else found_for[1]
        if cause is not None:
            sent[cause].append(at)
            if len(sent[cause]) == 2:  # the drive of this traffic always answers
                found.setdefault("telegram again or late", f"{data.hex(' ')} once more")
            continue
        number = newest[0]
        wanted = causes[: number + 1]
        early = "flip before the request" if number >= 0 and flip.at < frames[number][0] else "flip during it"
        instead = " or ".join(w.hex(" ") for w in wanted[-1]) if number >= 0 else ""
        why = f"{data.hex(' ')} instead of {instead or 'none'}; {early}"
        kind = "altered" if instead and not sent[number] else "unrequested"
        valid = bool(fc_telegram.parse(data).pcd1 & VALID)
        found.setdefault(f"{kind} telegram, bit 10 = {int(valid)}", why)
    what = min(found, key=OUTCOMES.index, default="")
    return what, found.get(what, "")


def _newest(frames: list[tuple[float, float, bytes]], by: float) -> int:
    """Number of the last frame that was over by then; -1: none."""
    return max((number for number, (_, end, _) in enumerate(frames) if end < by), default=-1)


def _requested_by(
    played: Played,
    frames: list,
    wanted: list[set[bytes]],
    sent: dict[int, list],
    at: float,
    data: bytes,
    turn: float,
) -> int | None:
    """Number of the request that this telegram may belong to: the newest, or a write that waited.

    A telegram leaves once, and is repeated once: not after the reply, and none to all drives (FC-9). A write
    may have waited for an exchange (FRAME-7): the newest of its kind, or one of those after `turn`. It is
    repeated while no newer request waits with a telegram; a reading that is not the newest waits no more.
    """
    passed: set[str] = set()  # kinds of the newer writes
    waiting = False  # a newer request
    for number in range(len(wanted) - 1, -1, -1):
        _, end, adu = frames[number]
        newest = number == len(wanted) - 1
        to_all = data[2] == fc_telegram.ADR_BROADCAST
        kind = "image" if adu[1] in COIL_WRITES else "write to all" if adu[0] == 0 else "write"
        write = adu[1] not in READS and bool(wanted[number])  # not one that the card refuses
        if (newest or (write and kind not in passed)) and data in wanted[number]:
            newer_start = frames[number + 1][0] if number + 1 < len(frames) else at
            reply_sent = any(
                end < reply.rise < min(at, newer_start) and _answers(reply.data, adu)
                for reply in played.replies
            )
            left = sent[number]
            repeat = len(left) == 1 and not to_all and not waiting
            if not reply_sent and (not left or repeat):
                return number
        if write and end < turn:
            passed.add(kind)
        waiting = waiting or (bool(wanted[number]) and (newest or write))
    return None


def _answers(reply: bytes, adu: bytes) -> bool:
    """Whether a master takes it for the reply: a flip may send another one, or a damaged one."""
    return reply[:1] == adu[:1] and reply[1:2] in (adu[1:2], bytes([adu[1] | 0x80])) and crc_good(reply)


def asked(played: Played, line: LineFormat) -> list[tuple[float, float, bytes]]:
    """The committed frames for the card: start, end, ADU."""
    found: list[tuple[float, float, bytes]] = []
    characters: list = []
    apart = (line.t15_bits + CLEAR_BITS / 2) * line.bit
    over = (line.t35_bits - CLEAR_BITS / 2) * line.bit
    for heard in [*played.network, None]:
        if characters and (heard is None or heard.start - characters[-1].end > apart):
            data = bytes(c.byte for c in characters)
            spoilt = heard is not None and heard.start - characters[-1].end < over
            if crc_good(data) and data[0] in (0, ADDRESS) and not spoilt:
                found.append((characters[0].start, characters[-1].end, data))
            characters = []
        if heard is not None:
            characters.append(heard)
    return found


def expected(frames: list[tuple[float, float, bytes]], played: Played, reset_from: float) -> list[set[bytes]]:
    """Telegrams that each request may cause.

    An unconfirmed request may have changed the control image or not. From the clock `reset_from` on the card
    may have restarted, with an image of zeros (WDG-1). The image of a write to all goes to the card's own
    drive if it also stands for an older write to the card alone (FRAME-7).
    """
    images, causes = [[0] * 32], []
    to_one = False
    for n, (_, end, data) in enumerate(frames):
        until = frames[n + 1][0] if n + 1 < len(frames) else float("inf")
        replies = [reply.data for reply in played.replies if end < reply.rise < until]
        # A flip may send its own reply, also to a broadcast.
        confirmed = data[0] == ADDRESS and any(r[:2] == data[:2] and crc_good(r) for r in replies[:1])
        changed, found = [], set()
        if end > reset_from:
            images = [*images, [0] * 32]
        for image in images:
            card = CardModel()
            card.coils[:32] = image
            step = card.request(data[1:-2], data[0] == 0)
            changed.append(card.coils[:32])
            if step.telegram is not None:
                adrs = {step.telegram[0], *([fc_telegram.ADR] if to_one and data[1] in COIL_WRITES else [])}
                found |= {fc_telegram.build(step.telegram[1:], adr=adr) for adr in adrs}
        if found and data[1] in COIL_WRITES:
            to_one = not confirmed and (to_one or data[0] == ADDRESS)
        images = changed if confirmed else [*images, *changed]
        images = [list(image) for image in {tuple(image) for image in images}]
        causes.append(found)
    return causes
