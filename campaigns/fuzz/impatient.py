# SPDX-License-Identifier: Apache-2.0
"""Masters that do not wait: was the drive told what the image shows (SAFE-8); `make impatient`.

    python -m campaigns.fuzz.impatient [--config tiny] [--seed N] [--count SEQUENCES] [--jams yes]

A sequence is 4 to 12 requests with time-outs of 5 to 400 ms, often a start, a slow reading, a stop and a
write of a parameter. The drive answers after 3 to 120 ms, too late, never, or again to the telegram before;
with --jams something keeps its line busy at times. Then both lines come to rest, and the master reads coils
1-32. tb/model/told.py and whole_card.py judge. Of the first differences the smallest case found is kept:
`make fuzz REPLAY=FILE` plays it. Exit 0: no difference; 1: differences; 2: an invalid command line or a
missing tool. Other options: campaigns/engine.py.
"""

from __future__ import annotations

import json
import random
from argparse import Namespace

from campaigns.engine import Campaign, EngineError, Row, total
from campaigns.fuzz.case import CLK_HZ, DRIVE_DELAY_BITS, Player
from campaigns.fuzz.shrink import shrink
from campaigns.fuzz.trial import followed, told
from campaigns.soak.run import Traffic, wire
from regs.dialects import DEFAULT, DIALECTS
from regs.generated.card_tables import DRIVE_BAUD
from rtl.command import Parser, run_main
from rtl.sources import ROOT, SourcesError, configuration
from sim.harness.library import BuildError, Target
from sim.harness.pins import BAUDS, FORMS
from tb.agents import rtu
from tb.agents.crc16 import with_crc
from tb.model.card import DRIVE_TIMEOUT, EEPROM
from tb.model.told import Verdict
from tb.model.wire import LineFormat

FOLDER = ROOT / "build/fuzz"
RATES = {
    "standard": {9600: 47, 19200: 47, 115200: 4, 1200: 1},
    "tiny": {9600: 80, 19200: 16, 115200: 2, 1200: 1},  # a slower line needs a slower clock, see SLOWER
}
FORMATS = ("8N1", "8E1")
OWN_CLOCK = 20  # one sequence in so many runs at the card's own clock, which takes longer to simulate
# The other ones run at a part of that clock at which the firmware is still ready before the next request.
SLOWER = {"standard": {1200: 6, 9600: 6, 19200: 6, 115200: 6}, "tiny": {1200: 4, 9600: 4, 19200: 2}}
REVOKED = 0.05  # of the requests
FAULTS = (0, 1, 2, 3, 4, 5, 17, 130)  # the last two say that the drive does not take it now
JAMS = 0.04  # of the requests, if asked for: then something keeps the drive line busy for up to 600 ms
START, STOP = 0x047C, 0x043C
LONG_WAIT = 25  # of register 40003: above, a silent drive costs much simulated time
SHRINK_TRIES = 40
READ_IMAGE = rtu.read_coils(0, 32)


class Maker:
    """One sequence, as a case of the fuzzer (campaigns/fuzz/case.py)."""

    def __init__(self, seed: str, config: str, own_clock: bool, jams: bool) -> None:
        self.rng = rng = random.Random(seed)
        rates = {baud: weight for baud, weight in RATES[config].items() if baud in BAUDS}
        (self.baud,) = rng.choices(list(rates), rates.values())
        forms = [form for form in FORMATS if form in FORMS] if rng.random() < 0.95 else list(FORMS)
        self.form = rng.choice(forms)
        weights = [3, *[1] * (len(DIALECTS) - 1)]
        self.dialect = rng.choices(list(DIALECTS), weights)[0] if config == "standard" else DEFAULT
        self.profile = rng.choice(DIALECTS[self.dialect].profiles)
        self.traffic = Traffic(rng, self.dialect, self.profile)
        self.clk_hz = configuration(config)["clk_hz"]
        if not own_clock:
            self.clk_hz = max(CLK_HZ.get(self.baud, 0), self.clk_hz // SLOWER[config].get(self.baud, 1))
        self.wait = 15  # register 40003
        self.jams = jams
        # A master and a drive keep their pace, more or less.
        self.timeout_ms = 5 * 80 ** (rng.random() ** 2)
        self.drive_ms = 3 * 40 ** rng.random()

    def case(self) -> dict:
        rng = self.rng
        asked = [self._wait(rng.choice((rng.randint(1, 100), 5, 10, 13, 20)))] if rng.random() < 0.3 else []
        while len(asked) < 12 and (len(asked) < 4 or rng.random() < 0.8):
            asked += self._stop_behind_a_reading() if rng.random() < 0.25 else self._one()
        events = [event for unit, pdu in asked[:12] for event in self._events(unit, pdu)]
        events[0]["gap"] = ["idle", 30.0]
        line = LineFormat(self.baud, self.form, self.clk_hz)
        rest = {"what": "image", "gap": ["idle", round(20 + 0.01 * line.baud)], "pdu": READ_IMAGE.hex()}
        return {
            "baud": self.baud,
            "form": self.form,
            "address": 1,
            "dialect": self.dialect,
            "profile": self.profile,
            "clk_hz": self.clk_hz,
            "events": [*events, rest],
        }

    def _event(self, unit: int, pdu: bytes) -> dict:
        rng, line = self.rng, LineFormat(self.baud, self.form, self.clk_hz)
        timeout_ms = min(400, max(5, self.timeout_ms * rng.choice((1, 1, 1, rng.uniform(0.5, 2)))))
        bits = max(timeout_ms * self.baud / 1000, line.t35_bits + 1.5)
        data = with_crc(bytes([unit]) + pdu)
        manners = [self._manner() for _ in range(3)]
        event = {"what": "impatient", "gap": ["own", round(bits, 2)], "bytes": data.hex(), "drive": manners}
        if self.jams and rng.random() < JAMS:
            jam_ms = rng.choice((rng.uniform(5, 100), rng.uniform(100, 600)))
            count = round(jam_ms * DRIVE_BAUD / 11000)
            event["babble"] = {"gap": round(rng.uniform(1, 400), 1), "bytes": "55" * count, "rude": True}
        return event

    def _events(self, unit: int, pdu: bytes) -> list[dict]:
        """The request, and sometimes a character behind it that revokes it (FRAME-3)."""
        event = self._event(unit, pdu)
        if self.rng.random() >= REVOKED:
            return [event]
        line = LineFormat(self.baud, self.form, self.clk_hz)
        bits = self.rng.uniform(line.t15_bits + 1.5, line.t35_bits - 1.5)
        return [event, {"what": "impatient", "gap": ["own", round(bits, 2)], "bytes": "55"}]

    def _manner(self) -> dict:
        rng = self.rng
        how = rng.random()
        if how < (0.1 if self.wait <= LONG_WAIT else 0.02):
            return {"silent": True}
        if how < 0.13:
            return {"parts": [{"stale": True, "gap": DRIVE_DELAY_BITS}, {"gap": DRIVE_DELAY_BITS}]}
        late_ms = 10 * self.wait + rng.uniform(-10, 40)
        delay_ms = late_ms if how < 0.18 else self.drive_ms * rng.choice((1, 1, rng.uniform(0.5, 1.5)))
        gap = {"gap": round(max(DRIVE_DELAY_BITS, min(delay_ms, 1500) * DRIVE_BAUD / 1000), 2)}
        if how < 0.22:
            return gap | {"bcc": 1 << rng.randrange(8)}
        return gap | {"fault": rng.choice(FAULTS)} if how < 0.27 else gap

    # ------------------------------------------------------------ requests: unit and PDU

    def _command(self, control: int) -> tuple[int, bytes]:
        bits = control | self.rng.choice((0, 0x2000, self.rng.randrange(0x10000))) << 16
        count = self.rng.choice((16, 32))
        unit = 0 if self.rng.random() < 0.2 else 1
        return unit, rtu.write_coils(0, [bool(bits >> i & 1) for i in range(count)])

    def _write(self) -> tuple[int, bytes]:
        unit = 0 if self.rng.random() < 0.2 else 1
        return unit, self.traffic.write_number()[0][1]

    def _wait(self, tens: int) -> tuple[int, bytes]:
        self.wait = tens
        return 1, b"\x06" + wire(DRIVE_TIMEOUT, tens)

    def _stop_behind_a_reading(self) -> list[tuple[int, bytes]]:
        (reading,) = self.traffic.read_number()
        return [self._command(START), reading, self._command(STOP), self._write()]

    def _one(self) -> list[tuple[int, bytes]]:
        rng, traffic = self.rng, self.traffic
        kinds = {
            self._write: 6,
            lambda: self._command(rng.choice((START, STOP, 0, rng.randrange(0x10000)))): 5,
            lambda: (0 if rng.random() < 0.2 else 1, traffic.write_coils()[0][1]): 4,
            lambda: traffic.read_number()[0]: 4,
            lambda: traffic.read_coils()[0]: 1,
            lambda: (1, rtu.write_coil(EEPROM, rng.random() < 0.5)): 1,
            lambda: (1, b"\x03" + wire(0, 3)): 1,
            lambda: self._wait(rng.choice((rng.randint(1, 100), 3, 13, 15, 20))): 1,
        }
        if rng.random() < 0.1:
            return traffic.text()
        (kind,) = rng.choices(list(kinds), kinds.values())
        return [kind()]


def play(case: dict, config: str) -> Verdict:
    player = Player(case, Target(config=config))
    played = player.play(probed=False)
    verdict = told(case, player, played)
    verdict.differences += followed(case, player, played).differences
    return verdict


def make(seed: int, number: int, config: str, jams: bool = False) -> dict:
    return Maker(f"impatient/{seed}/{number}", config, number % OWN_CLOCK == OWN_CLOCK - 1, jams).case()


class Impatient(Campaign):
    every_dialect = True
    name, module = "impatient", "campaigns.fuzz.impatient"
    unit = "readings of the image"
    count = 100

    def options(self, parser: Parser) -> None:
        parser.add_argument("--jams", choices=["yes"], help="something keeps the drive line busy at times")

    def cases(self, given: Namespace) -> list[str]:
        return [f"{case}/jams" if given.jams else case for case in super().cases(given)]

    def run(self, config: str, case: str) -> Row:
        outcome = play(case_of(case, config), config)
        return {
            "wrong": "; ".join(outcome.differences),
            "asked": outcome.asked,
            "restless": outcome.restless,
        }

    def follow(self, config: str, case: str) -> str:
        smaller = shrink(
            case_of(case, config), lambda tried: bool(play(tried, config).differences), SHRINK_TRIES
        )
        path = FOLDER / f"case-impatient-{config}-{case.replace('/', '-')}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(smaller, indent=1) + "\n")
        setting = "" if config == "standard" else f"CONFIG={config} "
        return f"make fuzz {setting}REPLAY={path.relative_to(ROOT)}"

    def tries(self, rows: dict[str, Row]) -> int:
        """Readings of the image that were judged: sequences that came to rest."""
        return sum(row["asked"] for row in rows.values())

    def said(self, rows: dict[str, Row]) -> str:
        sums = total(rows.values())
        return f"{len(rows)} sequences, {sums['restless']} not at rest; {super().said(rows)}"


def case_of(name: str, config: str) -> dict:
    seed, number, *jams = name.split("/")
    return make(int(seed), int(number), config, bool(jams))


CAMPAIGN = Impatient()

if __name__ == "__main__":
    run_main("impatient", CAMPAIGN.main, BuildError, EngineError, SourcesError)
