# SPDX-License-Identifier: Apache-2.0
"""The matrix of masters without its masters: cases, judge, page, adapters' common part, relay, messages.

The recorded answers (answers.json) come from a run of all masters, `make masters`, which downloads them. No
test here needs one.
"""

from __future__ import annotations

import copy
import os
import pty
import sys
import time
import tty
from pathlib import Path

import pytest

from campaigns.masters import install, judge, page, run, session
from campaigns.masters.adapters.common import Adapter, ShownError
from campaigns.masters.cases import CUT, LONGER, PROFILES, SILENCE, Case, cases, pdu_of, reply_of
from campaigns.masters.masters import BY_ID, HERE, MASTERS, PORT, TCP_PORT, Master
from sim.card.example_run import Port
from tb.agents.crc16 import with_crc
from tb.model import fc_telegram as fc
from tb.model.card import DIALECTS, CardModel
from tb.model.vlt_drive import VltDrive
from tools import handbook

EVERY = [pytest.param(d, c, id=f"{d}-{c.id}") for d in DIALECTS for c in cases(d)]


@pytest.fixture
def recorded() -> dict:
    return copy.deepcopy(page.load())


# ---------------------------------------------------------------- cases


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
    """In their order, on one card and one drive."""
    models = Models(dialect)
    for case in cases(dialect):
        for around in filter(None, [case.before]):
            assert models.ask(pdu_of(around)) == pdu_of(around)[:5]
        pdu = pdu_of(case.request) + (b"\0" if case.trick == LONGER else b"")
        assert models.ask(pdu, cut=case.trick == CUT) == reply_of(case), case.title
        if case.after:
            assert models.ask(pdu_of(case.after)) == pdu_of(case.after)[:5]


def test_every_code_of_the_issue_and_silence_occur():
    found = {dialect: {case.expect for case in cases(dialect) if case.is_error} for dialect in DIALECTS}
    assert found == {
        "card": {0, 2, 64, 65, 66, 67, 255},
        "builtin": {0, 2, 64, 65, 66, 67, SILENCE},
        "hvac_basic": {1, 2, 3, 4, SILENCE},
    }


def test_every_case_leaves_the_card_as_it_was():
    """So that a master's cases do not depend on those of another order."""
    for dialect in DIALECTS:
        models = Models(dialect)
        before = dict(models.card.registers), models.card.coils[64]
        for case in cases(dialect):
            for request in filter(None, (case.before, case.request, case.after)):
                models.ask(pdu_of(request))
            assert (dict(models.card.registers), models.card.coils[64]) == before, case.title


# ---------------------------------------------------------------- judge, on recorded answers


def test_the_recorded_answers_are_right(recorded):
    assert judge.check(recorded) == []
    assert list(recorded["masters"]) == list(BY_ID)
    assert len(MASTERS) == 11, "other pages and the help name their number"


@pytest.mark.parametrize(("dialect", "case"), EVERY)
def test_a_wrong_answer_of_any_case_is_found(recorded, dialect, case):
    """Of the first master: another value, another text, another code; a value in the place of an error."""
    record = recorded["masters"]["pymodbus"]["dialects"][dialect][case.id]
    answer = record["answer"]
    if case.is_error:
        others = [
            {"values": [0]},
            {"done": True},
            {"shows": "", "code": 1 + (answer.get("code") or 0)},
            {"endless": True},
        ]
    elif "values" in answer:
        others = [
            {"values": [answer["values"][0] ^ 1, *answer["values"][1:]]},
            {"values": []},
            {"shows": "?"},
        ]
    else:
        others = [{"text": "VLT600"}, {"values": []}, {"crash": "KeyError: 64"}]
    for other in others:
        record["answer"] = other
        (line,) = judge.check(recorded)
        assert line.startswith(f"pymodbus, {dialect}, {case.title}: {other}"[:60]) or "exception" in line
    record["answer"] = answer
    assert judge.check(recorded) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda record: record.update(sent=""), "sent nothing instead of 01 03 04 0f"),
        (lambda record: record.update(sent=2 * (record["sent"] + " ")), "sent 01 03"),
        (lambda record: record.update(heard="01 83 40 41 30"), "heard 01 83 40 41 30 instead of 01 03 02"),
        (lambda record: record.update(heard=""), "heard nothing instead of"),
        (lambda record: record.update(around=[{"shows": "?"}]), "a write around it: {'shows': '?'}"),
    ],
)
def test_other_bytes_on_the_line_are_found(recorded, change, message):
    change(recorded["masters"]["mbpoll"]["dialects"]["card"]["read-word"])
    (line,) = judge.check(recorded)
    assert f"mbpoll, card, read a parameter of 16 bits: {message}" in line


def test_a_request_that_nobody_answers_may_be_repeated(recorded):
    record = recorded["masters"]["mbpoll"]["dialects"]["builtin"]["silent"]
    sent = record["sent"]
    record["sent"] = f"{sent} {sent} {sent}"
    assert judge.check(recorded) == []
    for wrong in (f"{sent} {sent[:-3]}", "", sent[:-3], f"{sent}{sent}"):
        record["sent"] = wrong
        assert len(judge.check(recorded)) == 1, wrong


def test_what_did_not_run_is_named(recorded):
    del recorded["masters"]["umodbus"]
    del recorded["masters"]["tmodbus"]["dialects"]["builtin"]
    del recorded["masters"]["anymodbus"]["dialects"]["card"]["fault-0"]
    assert judge.check(recorded) == [
        *(f"umodbus, {dialect}: did not run" for dialect in DIALECTS),
        "tmodbus, builtin: did not run",
        "anymodbus, card, a parameter that does not exist: no answer",
    ]


@pytest.mark.parametrize(
    ("answer", "expect", "kind"),
    [
        ({"shows": "error code 64"}, 64, judge.NUMBER),
        ({"shows": "Modbus Exception 0x40 for function"}, 64, judge.NUMBER),
        ({"shows": "IllegalAddress", "code": 2}, 2, judge.NUMBER),
        ({"shows": "Unknown error 112345678"}, 1, judge.WORDS),
        ({"shows": "Invalid exception code"}, 64, judge.WORDS),
        ({"crash": "KeyError: 64"}, 64, judge.CRASH),
        ({"shows": "no answer"}, SILENCE, judge.TIME_OUT),
    ],
)
def test_how_an_exception_is_shown(answer, expect, kind):
    assert judge.how(Case("id", "title", "read-coils 128 1", expect), answer) == kind


# ---------------------------------------------------------------- page


def test_the_page_is_that_of_the_recorded_answers(recorded):
    assert page.PAGE.read_text() == page.page(recorded), "run `make masters`"


def test_the_table_shows_numbers_words_and_crashes(recorded):
    rows = [line.strip("| ").split(" | ") for line in page.matrix(recorded).splitlines()]
    found = {(row[0], row[2]): row[3:] for row in rows[2:]}
    columns = list(BY_ID)
    unknown = dict(zip(columns, found["read coil 129", "64"], strict=True))
    assert unknown["pymodbus"] == "**64**"
    assert unknown["libmodbus"] == unknown["mbpoll"] == "`Invalid exception code`"
    assert unknown["umodbus"] == "crash: `KeyError: 64`"
    assert set(found["read a parameter of 16 bits", page.RIGHT]) == {page.RIGHT}
    answers = [case for dialect in DIALECTS for case in cases(dialect)]
    assert len(found) == len({(case.id, str(case.expect) if case.is_error else "") for case in answers})


def test_the_times_of_the_card_are_the_shortest_of_any_master(recorded):
    asked = [master["dialects"]["card"] for master in recorded["masters"].values()]
    for case, took in (("read-word", 0.012), ("silent", 3.5)):
        for answers in asked:
            answers[case]["took"] = took + 1
        asked[-1][case]["took"] = took
    text = page.page(recorded)
    assert "A reading of a parameter takes 12 ms or more, code 255 3.5 s or more." in " ".join(text.split())


def test_every_master_has_its_page_with_its_example():
    pages = handbook.GUIDES / "handbook/masters"
    assert {page.stem for page in pages.iterdir()} == {master.id for master in MASTERS}
    for master in MASTERS:
        text = (pages / f"{master.id}.md").read_text()
        assert text.startswith(f"# {master.title}\n")
        assert f"<!-- generated: master-{master.id} -->" in text
        program = master.example_path.read_text()
        assert (TCP_PORT if master.by_tcp else PORT) in program
        assert "40003" in page.section(master) and "| 255 | " in page.section(master)


def test_what_the_handbook_says_of_masters_was_measured(recorded):
    """Waits, repeats and crashes that the sections of the page name."""
    found = recorded["masters"]
    limit = recorded["timeout_s"]

    def answers(master: str, dialect: str = "card") -> dict:
        return {
            case.expect: found[master]["dialects"][dialect][case.id]
            for case in cases(dialect)
            if case.is_error
        }

    def silent(master: str) -> dict:
        return found[master]["defaults"]["builtin silent"][0]

    assert all(record["took"] >= limit for record in answers("minimalmodbus").values())
    assert all(record["took"] >= 2 * limit for record in answers("modbus_tk").values())
    crashes = {code for code, record in answers("umodbus").items() if "crash" in record["answer"]}
    assert crashes == {0, 64, 65, 66, 67, 255}
    assert answers("umodbus", "builtin")[SILENCE]["answer"] == {"crash": "ValueError"}
    assert [master for master in found if silent(master)["answer"] == session.ENDLESS] == [
        "umodbus",
        "modbus-serial",
    ]
    repeats = {master: len(silent(master)["sent"].split()) // 8 for master in found}
    assert {master: times for master, times in repeats.items() if times > 1} == {
        "pymodbus": 4,
        "anymodbus": 2,
        "socat": 4,
    }
    for master in ("mbpoll", "libmodbus"):
        said = {code: record["answer"]["shows"].split(": ")[-1] for code, record in answers(master).items()}
        unknown = {64, 65, 66, 67, 255}
        assert {said[code] for code in unknown} == {"Invalid exception code"}
        assert said[0] == "Unknown error 112345678" and said[2] == "Illegal data address"


@pytest.mark.parametrize("content", ["", "[]", "{}"])
def test_no_result_is_one_line(tmp_path, content):
    path = tmp_path / "answers.json"
    path.write_text(content)
    with pytest.raises(page.PageError, match=r"^answers.json is no result of `make masters`$"):
        page.load(path)


# ---------------------------------------------------------------- the command


@pytest.fixture
def replayed(recorded, monkeypatch, tmp_path) -> dict:
    """The command with the recorded answers in the place of the masters."""

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
    monkeypatch.setattr(page, "PAGE", HERE.parents[1] / "build/test-masters.md")
    page.PAGE.parent.mkdir(exist_ok=True)
    page.PAGE.unlink(missing_ok=True)
    return recorded


def test_a_whole_run_writes_answers_and_page(replayed, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["masters"])
    assert run.main() == 0
    assert page.load(page.ANSWERS)["masters"] == replayed["masters"]
    assert "**64**" in page.PAGE.read_text()
    assert "594 requests of 11 masters, 0 deviations" in capsys.readouterr().out


def test_a_wrong_answer_fails_the_command_and_nothing_is_written(replayed, monkeypatch, capsys):
    replayed["masters"]["mbpoll"]["dialects"]["card"]["read-word"]["answer"] = {"values": [51]}
    monkeypatch.setattr(sys, "argv", ["masters"])
    assert run.main() == 1
    assert "WRONG mbpoll, card, read a parameter of 16 bits: {'values': [51]}" in capsys.readouterr().out
    assert not page.ANSWERS.exists() and not page.PAGE.exists()


def test_a_part_writes_nothing(replayed, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["masters", "--master", "mbpoll", "--dialect", "card"])
    assert run.main() == 0
    assert "18 requests of 1 master, 0 deviations" in capsys.readouterr().out
    assert not page.ANSWERS.exists() and not page.PAGE.exists()


def test_an_unknown_master_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["masters", "--master", "modpoll"])
    with pytest.raises(SystemExit) as stopped:
        run.main()
    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert "'modpoll'" in error and error.count("\n") == 1


# ---------------------------------------------------------------- installation


def test_a_missing_program_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(install.InstallError) as error:
        install.install()
    assert str(error.value) == "gcc, mbpoll, socat, node, npm: not installed; run `tools/setup.sh masters`"


@pytest.mark.parametrize("python", ["/nowhere/python", "false", "true"])
def test_no_python_that_is_new_enough_is_one_line(monkeypatch, python):
    monkeypatch.setenv("MASTERS_PYTHON", python)
    with pytest.raises(install.InstallError, match=r"^no Python 3.13 or newer .*MASTERS_PYTHON=path$"):
        install.find_python()


def test_a_failed_download_is_one_line(tmp_path):
    with pytest.raises(install.InstallError, match=r"^sh failed: no route$"):
        install.run("sh", "-c", "echo trying; echo no route >&2; exit 3", folder=tmp_path)


def test_a_part_is_made_once_and_again_after_a_change(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(install, "FOLDER", tmp_path)
    target, made = tmp_path / "thing", []

    def make() -> None:
        made.append(target.write_text("x"))

    for content in ("1", "1", "2"):
        install.part("thing", content, target, "making the thing", make)
    assert len(made) == 2
    assert capsys.readouterr().out == 2 * "masters: making the thing\n"

    def fails() -> None:
        raise install.InstallError("no network")

    with pytest.raises(install.InstallError):
        install.part("thing", "3", target, "making the thing", fails)
    install.part("thing", "2", target, "making the thing", make)
    assert len(made) == 3, "a part that failed is not taken for whole"


# ---------------------------------------------------------------- adapters, relay


class Fake(Adapter):
    """A master that records its requests and answers them, or raises an error."""

    errors = (TimeoutError,)

    def __init__(self, error: Exception | None = None) -> None:
        self.error, self.asked = error, []

    def read_registers(self, address: int, count: int) -> list[int]:
        self.asked.append((address, count))
        if self.error:
            raise self.error
        return [0x564C] * count

    def write_registers(self, address: int, values: list[int]) -> None:
        self.asked.append((address, values))


def test_an_adapter_answers_requests():
    fake = Fake()
    assert fake.ask("read-registers 5139 2\n") == {"values": [0x564C, 0x564C]}
    assert fake.ask("read-text 6209 1") == {"text": "VL"}
    assert fake.ask("write-registers 1 500 20") == {"done": True}
    assert fake.ask("write-text 5329 31323334") == {"done": True}
    assert fake.asked == [(5139, 2), (6209, 1), (1, [500, 20]), (5329, [0x3132, 0x3334])]


def test_an_adapter_tells_the_masters_own_errors_from_others():
    fake = Fake()
    assert fake.failed(TimeoutError("no\nanswer")) == {"shows": "TimeoutError: no answer"}
    assert fake.failed(KeyError(64)) == {"crash": "KeyError: 64"}
    assert fake.failed(ValueError()) == {"crash": "ValueError"}
    assert fake.failed(ShownError("response", 0)) == {"shows": "response", "code": 0}
    assert fake.failed(ShownError("connect() returns False")) == {"shows": "connect() returns False"}


class Script(Master):
    """An adapter of a few lines."""

    def command(self) -> list[str]:
        return [sys.executable, "-c", self.adapter]


@pytest.mark.parametrize(
    ("program", "opened"),
    [
        ("raise KeyError(64)", {"crash": "KeyError: 64"}),
        ("import os; os._exit(3)", {"crash": "exit code 3"}),
        ('print(\'{"ready": "1.0"}\')', {"ready": "1.0"}),
    ],
)
def test_an_adapter_that_ends_is_a_crash(program, opened):
    asker = session.Asker(Script("id", "title", program, ""), "port", 1, "N")
    assert asker.opened == opened
    if "ready" in opened:
        assert asker.ask("read-coils 0 1") == {"crash": "exit code 0"}
    asker.close()


def test_a_master_that_never_answers_is_endless(monkeypatch):
    program = 'print(\'{"ready": "1.0"}\', flush=True); input(); input()'
    asker = session.Asker(Script("id", "title", program, ""), "port", 1, "N")
    assert asker.ask("read-coils 0 1", seconds=0.2) == session.ENDLESS
    asker.close()
    assert asker.process.returncode is not None


def test_the_relay_passes_on_and_lengthens():
    """A byte more, with a CRC that fits: the card must find the length wrong, not the CRC."""
    inside, outside = pty.openpty()
    tty.setraw(outside)
    relay = session.Relay(Path(os.ttyname(outside)))
    master, card = Port(Path(relay.path)), inside
    try:
        request = with_crc(bytes.fromhex("01 01 00 00 00 10"))
        master.write(request)
        assert os.read(card, 100) == request
        os.write(card, b"reply")
        assert master.read(5, 2) == b"reply"
        assert (relay.sent, relay.heard) == (request, b"reply")
        relay.lengthen = True
        master.write(request)
        assert os.read(card, 100) == with_crc(bytes.fromhex("01 01 00 00 00 10 00"))
        os.write(card, b"stale")
        for _ in range(200):
            if relay.heard == b"replystale":
                break
            time.sleep(0.01)
        relay.forget()
        assert (relay.sent, relay.heard) == (b"", b"")
        assert master.read(1, 0.1) == b""
    finally:
        relay.stop()
        master.close()
        os.close(inside)
        os.close(outside)
