# SPDX-License-Identifier: Apache-2.0
"""The matrix of masters without its masters: cases, judge, page, adapters' common part, relay, messages."""

from __future__ import annotations

import copy
import os
import pty
import sys
import tty
from pathlib import Path

import pytest

from campaigns.masters import install, judge, page, run, session
from campaigns.masters.adapters.common import Adapter, ShownError
from campaigns.masters.cases import CUT, LONGER, PROFILES, SILENCE, Case, cases, pdu_of, reply_of
from campaigns.masters.masters import BY_ID, MASTERS, Master
from sim.card.example_run import Port
from tb.agents.crc16 import with_crc
from tb.lib.rows import each_row
from tb.model import fc_telegram as fc
from tb.model.card import DIALECTS, CardModel
from tb.model.vlt_drive import VltDrive

EVERY = [(dialect, case) for dialect in DIALECTS for case in cases(dialect)]


class Models:
    """Card and drive of a dialect, both as models; a reply's PDU or None."""

    def __init__(self, dialect: str) -> None:
        self.card, self.drive = CardModel(name=dialect), VltDrive(PROFILES[dialect])

    def ask(self, pdu: bytes, cut: bool = False) -> bytes | None:
        step = self.card.request(pdu)
        while step.telegram is not None:
            if cut:
                step = self.card.drive_silent()
                break
            self.drive.step(20_000)
            reply = self.drive.telegram(fc.build(step.telegram[1:], adr=step.telegram[0]))
            step = self.card.drive_reply(reply[2:-1])
        return step.reply


@pytest.mark.rule("EXC")
@pytest.mark.parametrize("dialect", DIALECTS)
def test_expected_answers_are_those_of_the_models(dialect):
    """In their order, on one card and one drive, which each case leaves as they were."""
    models = Models(dialect)
    before = dict(models.card.registers), models.card.coils[64]
    for case in cases(dialect):
        if case.before:
            assert models.ask(pdu_of(case.before)) == pdu_of(case.before)[:5]
        pdu = pdu_of(case.request) + (b"\0" if case.trick == LONGER else b"")
        assert models.ask(pdu, cut=case.trick == CUT) == reply_of(case), case.title
        if case.after:
            assert models.ask(pdu_of(case.after)) == pdu_of(case.after)[:5]
        assert (dict(models.card.registers), models.card.coils[64]) == before, case.title


def right(case: Case) -> dict:
    """What a master records that shows each exception by its number."""
    reply = reply_of(case)
    answer = {"shows": "an error"} | ({} if case.expect == SILENCE else {"code": case.expect})
    return {
        "answer": answer if case.is_error else case.expect,
        "sent": judge.frame(pdu_of(case.request)),
        "heard": judge.frame(reply) if reply else "",
        "took": 0.1,
    }


def records_of(dialect: str) -> dict[str, dict]:
    return {case.id: right(case) for case in cases(dialect)}


@each_row(("dialect", "case"), EVERY)
def test_a_wrong_answer_of_any_case_is_found(dialect, case):
    """Another value, another text, another code; a value in the place of an error; other bytes; no record."""
    assert not list(judge.faults(case, right(case)))
    answer = case.expect
    if case.is_error:
        others = [{"values": [0]}, {"done": True}, {"endless": True}]
        others += [{"shows": "", "code": answer + 1}] if answer != SILENCE else []
    elif "values" in answer:
        others = [{"values": [answer["values"][0] ^ 1, *answer["values"][1:]]}, {"values": []}, {"shows": ""}]
    else:
        others = [{"text": "VLT600"}, {"values": []}, {"crash": "KeyError: 64"}]
    changes = [{"answer": other} for other in others]
    changes += [{"sent": ""}, {"sent": right(case)["sent"][:-3]}, {"heard": "01 83"}, {"around": [{}]}]
    for change in changes:
        assert len(list(judge.faults(case, right(case) | change))) == 1, change
    records = records_of(dialect)
    del records[case.id]
    assert judge.deviations(MASTERS[0], dialect, records) == [f"pymodbus, {dialect}, {case.title}: no answer"]


def test_only_a_request_that_nobody_answers_may_be_repeated():
    for case in cases("builtin"):
        twice = right(case) | {"sent": " ".join(2 * [right(case)["sent"]])}
        assert bool(list(judge.faults(case, twice))) == (case.expect != SILENCE), case.title


@pytest.mark.parametrize(
    ("answer", "expect", "kind"),
    [
        ({"shows": "Modbus Exception 0x40 for function"}, 64, judge.NUMBER),
        ({"shows": "IllegalAddress", "code": 2}, 2, judge.NUMBER),
        ({"shows": "Unknown error 112345678"}, 1, judge.WORDS),
        ({"crash": "KeyError: 64"}, 64, judge.CRASH),
        ({"shows": "no answer"}, SILENCE, judge.TIME_OUT),
    ],
)
def test_how_an_exception_is_shown(answer, expect, kind):
    assert judge.how(Case("id", "title", "read-coils 128 1", expect), answer) == kind


def test_the_table_shows_numbers_words_and_crashes():
    rows = [line.strip("| ").split(" | ") for line in page.matrix(page.load()).splitlines()]
    found = {(row[0], row[2]): dict(zip(BY_ID, row[3:], strict=True)) for row in rows[2:]}
    unknown = found["read coil 129", "64"]
    assert (unknown["pymodbus"], unknown["libmodbus"]) == ("**64**", "`Invalid exception code`")
    assert unknown["umodbus"] == "crash: `KeyError: 64`"
    assert set(found["read a parameter of 16 bits", page.RIGHT].values()) == {page.RIGHT}


# ---------------------------------------------------------------- the command


@pytest.fixture
def replayed(monkeypatch, tmp_path) -> dict:
    """The command with recorded answers in the place of the masters, and its files in their own folder."""
    recorded = copy.deepcopy(page.load())
    for found in recorded["masters"].values():
        found["dialects"] = {dialect: records_of(dialect) for dialect in DIALECTS}

    def asked(master: Master, dialect: str) -> dict:
        found = recorded["masters"][master.id]
        return {"version": found["version"], "answers": found["dialects"][dialect]}

    monkeypatch.setattr(run, "install", lambda: None)
    monkeypatch.setattr(run, "socat_version", lambda: recorded["socat"])
    monkeypatch.setattr(session, "asked", asked)
    for name, key in (("by_default", "defaults"), ("with_parity", "parity")):
        monkeypatch.setattr(session, name, lambda master, key=key: recorded["masters"][master.id][key])
    monkeypatch.setattr(run.examples, "run", lambda master: recorded["masters"][master.id]["example"])
    monkeypatch.setattr(page, "ANSWERS", tmp_path / "answers.json")
    monkeypatch.setattr(run, "write_page", lambda results: (tmp_path / "page").write_text(page.page(results)))
    return recorded


@pytest.mark.parametrize(
    ("words", "wrong", "said"),
    [
        ([], False, f"{11 * len(EVERY)} requests of 11 masters, 0 deviations"),
        ([], True, "WRONG mbpoll, card, read a parameter of 16 bits: {'values': [51]}"),
        (["--master", "mbpoll", "--dialect", "card"], False, "18 requests of 1 master, 0 deviations"),
    ],
)
def test_only_a_whole_run_without_a_deviation_writes(replayed, monkeypatch, capsys, words, wrong, said):
    if wrong:
        replayed["masters"]["mbpoll"]["dialects"]["card"]["read-word"]["answer"] = {"values": [51]}
    monkeypatch.setattr(sys, "argv", ["masters", *words])
    assert run.main() == int(wrong)
    assert said in capsys.readouterr().out
    assert page.ANSWERS.exists() == (not words and not wrong)
    if page.ANSWERS.exists():
        kept = page.load(page.ANSWERS)["masters"]["mbpoll"]["dialects"]["card"]["read-word"]
        assert kept == {"answer": {"values": [50]}, "took": 0.1}, "not the bytes"


def test_a_missing_program_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(install.InstallError) as error:
        install.install()
    assert str(error.value) == "gcc, mbpoll, socat, node, npm: not installed; run `tools/setup.sh masters`"


# ---------------------------------------------------------------- adapters, relay


def test_an_adapter_answers_requests_and_tells_its_own_errors_from_others():
    asked = []
    calls = {
        "read-registers": lambda at, count: [0x564C] * count,
        "write-register": lambda at, value: asked.append((at, value)),
        "write-registers": lambda at, values: asked.append((at, values)),
    }
    adapter = Adapter("1.0", (TimeoutError,), lambda *_: calls)
    assert adapter.ask(calls, "read-registers 5139 2\n") == {"values": [0x564C, 0x564C]}
    assert adapter.ask(calls, "read-text 6209 1") == {"text": "VL"}
    for line in ("write-register 1 5", "write-registers 1 500 20", "write-text 5329 31323334"):
        assert adapter.ask(calls, line) == {"done": True}
    assert asked == [(1, 5), (1, [500, 20]), (5329, [0x3132, 0x3334])]
    assert adapter.failed(TimeoutError("no\nanswer")) == {"shows": "TimeoutError: no answer"}
    assert adapter.failed(KeyError(64)) == {"crash": "KeyError: 64"}
    assert adapter.failed(ShownError("response", 0)) == {"shows": "response", "code": 0}


class Script(Master):
    """An adapter of a few lines."""

    def command(self) -> list[str]:
        return [sys.executable, "-c", self.adapter]


@pytest.mark.parametrize(
    ("program", "opened", "answer"),
    [
        ("raise KeyError(64)", {"crash": "KeyError: 64"}, None),
        ('print(\'{"ready": "1.0"}\')', {"ready": "1.0"}, {"crash": "exit code 0"}),
        ('print(\'{"ready": "1"}\', flush=True); input(); input()', {"ready": "1"}, session.ENDLESS),
    ],
)
def test_an_adapter_that_ends_is_a_crash_and_one_that_waits_is_endless(program, opened, answer):
    asker = session.Asker(Script("id", "title", program, ""), "port", 1, "N")
    assert asker.opened == opened
    assert answer is None or asker.ask("read-coils 0 1", seconds=0.3) == answer
    asker.close()


def test_the_relay_passes_on_and_lengthens():
    """A byte more, with a CRC that fits: the card must find the length wrong, not the CRC."""
    card, outside = pty.openpty()
    tty.setraw(outside)
    relay = session.Relay(Path(os.ttyname(outside)))
    master = Port(Path(relay.path))
    try:
        request = with_crc(bytes.fromhex("01 01 00 00 00 10"))
        master.write(request)
        assert os.read(card, 100) == request
        os.write(card, b"reply")
        assert master.read(5, 2) == b"reply"
        assert (relay.sent, relay.heard) == (request, b"reply")
        relay.forget()
        relay.lengthen = True
        master.write(request)
        assert os.read(card, 100) == with_crc(bytes.fromhex("01 01 00 00 00 10 00"))
        assert (relay.sent, relay.heard) == (request, b"")
    finally:
        relay.stop()
        master.close()
        os.close(card)
        os.close(outside)
