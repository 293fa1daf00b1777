# SPDX-License-Identifier: Apache-2.0
"""Mixed traffic of pymodbus to the virtual card, checked by the models; `make soak` is the long version.

Traffic and checks: campaigns/soak/run.py. The drive is live: it ramps, refuses and logs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from campaigns.soak import run
from campaigns.soak.run import SoakJudge, Transaction, soak
from regs.dialects import DEFAULT, DIALECTS
from sim.card.run_card import Frame
from tb.agents.crc16 import with_crc
from tb.lib.rows import each_row
from tb.lib.seeds import seeded
from tb.model import fc_telegram as fc
from tb.model.card import CardModel
from tb.model.vlt_drive import VltDrive

EVERYWHERE = (
    *("EXC", "FC-3", "FC-4", "FC-5", "FC-6"),
    *("MAP-1", "MAP-2", "MAP-3", "MAP-5", "MAP-6", "MAP-7", "MAP-9"),
)


def each_pair() -> Iterator[Any]:
    """Each dialect with each drive that it fits; `make test` takes the first pair."""
    for name, dialect in DIALECTS.items():
        for profile in dialect.profiles:
            first = name == DEFAULT and profile == dialect.profiles[0]
            rules = ["DIALECT", *(EVERYWHERE if first else ()), *(("FC-7", "MAP-8") if first else ())]
            yield pytest.param(
                *(name, profile, 60 if first else 50),
                marks=[pytest.mark.rule(*rules), *([] if first else [pytest.mark.nightly])],
            )


@pytest.mark.parametrize(("dialect", "profile", "count"), list(each_pair()))
def test_mixed_traffic_agrees_with_the_models(tmp_path, dialect, profile, count):
    result = soak(tmp_path, seeded(f"{dialect} {profile}").randrange(1 << 31), count, dialect, profile)
    print(result)
    assert not result.mismatches, "\n".join(result.mismatches)
    assert result.replies.total() == count
    assert any(what.startswith("exception") for what in result.replies)


# ---------------------------------------------------------------- the judge
READ_104 = bytes.fromhex("03 04 0F 00 01")
REPLY_104 = with_crc(bytes.fromhex("01 03 02 00 32"))


def frame(line: str, sender: str, data: bytes) -> Frame:
    return Frame(0.1, 0.2, line, sender, data, True, "")


def exchange_of_104() -> dict[tuple[str, str], bytes]:
    telegram = fc.build_parameter(fc.AK_READ, 104)
    return {
        ("modbus", "master"): with_crc(b"\x01" + READ_104),
        ("drive", "card"): telegram,
        ("drive", "drive"): VltDrive().telegram(telegram),
        ("modbus", "card"): REPLY_104,
    }


def mismatches_of(seen: dict[tuple[str, str], bytes], received: bytes) -> list[str]:
    frames = [frame(*where, data) for where, data in seen.items()]
    judge = SoakJudge(CardModel(), VltDrive(), frames)
    judge.check_all([Transaction("read", 1, READ_104, received)])
    return judge.mismatches


@each_row("where", list(exchange_of_104()))
@each_row("how", ["changed", "missing", "twice"])
def test_judge_finds_a_wrong_frame(where, how):
    seen = exchange_of_104()
    if how == "twice":
        frames = [frame(*at, data) for at, data in [*seen.items(), (where, seen[where])]]
        judge = SoakJudge(CardModel(), VltDrive(), frames)
        judge.check_all([Transaction("read", 1, READ_104, REPLY_104)])
        assert any(f"{where[0]} line, {where[1]}: not expected" in text for text in judge.mismatches)
        return
    if how == "changed":
        seen[where] = seen[where][:-1] + bytes([seen[where][-1] ^ 1])
    else:
        del seen[where]
    assert any(f"{where[0]} line, {where[1]}: expected" in text for text in mismatches_of(seen, REPLY_104))


def test_the_page_counts_a_seed_once_and_keeps_a_mismatch():
    """A shorter block of the same seed, which has a mismatch at last."""

    def block(count: int, line: str, mismatches: int = 0) -> dict:
        about = {"line": [line], "transactions": count, "replies": {"exception 2": 12}, "simulated_s": 90.0}
        return about | {"mismatches": mismatches}

    rows = {
        "card/vlt6000/1/500": block(500, "19200 bit/s 8N1"),
        "card/vlt6000/2/500": block(500, "9600 bit/s 8E1"),
        "card/vlt6000/1/20": block(20, "19200 bit/s 8N1"),
    }
    ((cells, sums),) = run.runs_of("standard", rows)
    lines = "9600: 8E1; 19200: 8N1"
    assert cells[0] == "card" and cells[2:] == ["vlt6000", 2, lines, "1,000", 0, "4.60e-03", "3 min"]
    assert sums["replies"] == {"exception 2": 24}
    ((cells, _),) = run.runs_of("standard", rows | {"card/vlt6000/1/20": block(20, "19200 bit/s 8N1", 1)})
    assert cells[4:8] == [lines, "520", 1, "1.27e-02"]


def test_a_card_that_ends_is_a_mismatch(tmp_path, monkeypatch):
    """The block keeps what was done until then."""

    class Ends(run.Pymodbus):
        turns = 0

        def send(self, *asked):
            self.turns += 1
            if self.turns > 5:
                raise ConnectionError("no such port")
            return super().send(*asked)

    monkeypatch.setattr(run, "Pymodbus", Ends)
    found = soak(tmp_path, 3, 20, "card", "vlt6000")
    assert len(found.transactions) == 5
    assert found.wrong >= 1 and found.mismatches[-1] == "the card no longer speaks: no such port"
