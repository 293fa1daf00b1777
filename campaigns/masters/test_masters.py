# SPDX-License-Identifier: Apache-2.0
"""The matrix of masters without its masters: cases, judge, page, adapters' common part, relay, messages."""

from __future__ import annotations

import sys

import pytest

from campaigns.masters import examples, judge
from campaigns.masters.cases import CUT, LONGER, PROFILES, SILENCE, Case, cases, pdu_of, reply_of
from campaigns.masters.masters import BY_ID, MASTERS
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


@pytest.mark.parametrize("master", ["pymodbus", "mbpoll"])
def test_an_example_program_ends_in_a_stopped_drive(master, monkeypatch):
    """Of two masters that the tests have. `make masters` runs the program of each."""
    monkeypatch.setattr(examples, "PYTHON", sys.executable)
    assert examples.run(BY_ID[master], patient=True).endswith("\nstopped\n")
