# SPDX-License-Identifier: Apache-2.0
"""`rtu2fc check`: each row can be a tick and a cross; whatever goes wrong outside is one line.

ModelLine stands in for the serial port: the models of card and drive answer at once. The virtual card answers
where the port itself, time or faults of the lines matter.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

from regs.dialects import DIALECTS as TABLE
from regs.dialects import STANDARD
from sim.card.run_card import ROOT, RunningCard
from sw.rtu2fc import check as program
from sw.rtu2fc import check_rows, cli
from sw.rtu2fc.card import ANSWER_S, Card
from sw.rtu2fc.check import Check
from sw.rtu2fc.check_rows import ROWS, Unexpected
from sw.rtu2fc.port import SLACK_S, Line, SerialPort
from sw.rtu2fc.problem import NoAnswer
from sw.rtu2fc.screen import Screen
from tb.agents.crc16 import crc_good, with_crc
from tb.model import fc_telegram as fc
from tb.model.card import DIALECTS, CardModel
from tb.model.vlt_drive import VltDrive

T35_S, CHARACTER_S = 0.004, 0.001
UNIT = 5
READ_40003 = with_crc(bytes([UNIT, 3, 0, 2, 0, 1]))
STOPS = bytes.fromhex("0F 0000 0020 04 3C04 0000")


def options(**given: object) -> argparse.Namespace:
    usual = {"row": "", "with_drive": False, "boot": False, "start": 0, "rules": False}
    return argparse.Namespace(**usual | given)


def checks(line: object, dialect: str = "card", unit: int = 5, **given: object) -> Check:
    return Check(Card(line, unit, dialect), options(**given), Screen())


class ModelLine:
    """As Line, with a card and its drive behind it. `lie` changes a reply's PDU."""

    def __init__(self, dialect: str, drive: VltDrive | None, unit: int = UNIT, lie=lambda pdu: pdu) -> None:
        self.card, self.drive, self.unit, self.lie = CardModel(name=dialect), drive, unit, lie
        self.character_s, self.t35_s = CHARACTER_S, T35_S
        self.echoes, self.stray, self.at = False, b"", 0.0
        self.name, self.baud, self.form, self.took_s = "port", 9600, "8N2", T35_S
        self.asked: list[bytes] = []
        self.waits_s: list[float] = []

    def exchange(self, frame: bytes, wait_s: float) -> tuple[bytes, float]:
        self.at += T35_S
        if not frame:
            return b"", 0.0
        self.asked.append(frame)
        self.waits_s.append(wait_s)
        if not crc_good(frame):
            self.card.counts["crc"] += 1
            return b"", 0.0
        if frame[0] not in (0, self.unit):
            self.card.counts["foreign"] += 1
            return b"", 0.0
        step = self.card.request(frame[1:-2], frame[0] == 0) if len(frame) <= 256 else None
        while step and step.telegram:
            reply = self.drive and self.drive.telegram(fc.build(step.telegram[1:], step.telegram[0]))
            step = self.card.drive_reply(fc.without_bcc(reply[2:])) if reply else self.card.drive_silent()
        if self.drive:
            self.drive.step(1_000_000)
        answer = self.lie(step.reply) if step and step.reply and frame[0] else None
        return (with_crc(bytes([self.unit]) + answer) if answer else b""), self.took_s


def rows_of(output: str) -> dict[str, str]:
    """Title and remark of each printed row to its mark."""
    return {text: mark for mark, text in re.findall(r"^  ([✓✗-]) (.*)$", output, re.MULTILINE)}


def refused(function, *arguments: object) -> bool:
    try:
        function(*arguments)
    except (Unexpected, NoAnswer):
        return True
    return False


def ask(line: ModelLine, **given: object) -> None:
    checks(line, **given).all_rows()


def with_drive(dialect: str) -> VltDrive:
    return VltDrive(TABLE[dialect].profiles[0])


# ---------------------------------------------------------------- against the models


@pytest.mark.parametrize("drive", [False, True])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_models_pass_every_row(dialect, drive, capsys):
    ask(ModelLine(dialect, with_drive(dialect) if drive else None), dialect=dialect, with_drive=drive)
    marks = list(rows_of(capsys.readouterr().out).values())
    needs = "no drive" if drive else "drive"
    asked = [row for row in ROWS if dialect in row.dialects and row.needs != needs]
    assert marks.count("✗") == 0
    assert marks.count("✓") == len(asked) + 5, "and the five rows that are no table"


def test_the_rows_of_the_page_are_those_of_the_program(capsys):
    """docs/guide/bring-up.md, step 3; with --rules each row has its rule, too."""
    page = (ROOT / "docs/guide/bring-up.md").read_text().partition("### 3.")[2].partition("### 4.")[0]

    def titles(output: str) -> list[str]:
        return [text.split(": ")[0] for text in rows_of(output)]

    ask(ModelLine("card", None, unit=1), unit=1)
    assert titles(capsys.readouterr().out) == titles(page)
    ask(ModelLine("card", None), rules=True)
    assert all(re.match(r"[A-Z]+(-\d+)? +\S", title) for title in titles(capsys.readouterr().out))


@pytest.mark.parametrize("dialect", DIALECTS)
def test_no_row_commands_a_motor(dialect, capsys):
    """No request writes coils 1-32 with anything but 0, and the drive never sees bit 10 (SAFE-1)."""
    drive = with_drive(dialect)
    line = ModelLine(dialect, drive)
    drive_telegram, telegrams = drive.telegram, []
    drive.telegram = lambda telegram: telegrams.append(telegram) or drive_telegram(telegram)
    ask(line, dialect=dialect, with_drive=True)
    assert telegrams
    assert {telegram[-5:-1] for telegram in telegrams} == {bytes(4)}, "control word and reference"
    writes = [
        frame
        for frame in line.asked
        if frame[1] in (0x05, 0x0F) and crc_good(frame) and frame[2:4] < b"\0\x20"
    ]
    assert writes == [with_crc(bytes([UNIT]) + bytes.fromhex("0F 0000 0020 04 00000000"))]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_row_is_a_cross_for_a_card_that_does_otherwise(dialect):
    """Each ask of each row in turn: the card answers it wrongly, or at all where silence is promised."""
    for row, wrong in [(r, i) for r in ROWS if dialect in r.dialects for i in range(len(r.asks))]:
        line = ModelLine(dialect, with_drive(dialect) if row.needs == "drive" else None)
        exchange, count = line.exchange, iter(range(1000))

        def lying(frame, wait_s, exchange=exchange, count=count, wrong=wrong):
            heard, took = exchange(frame, wait_s)
            if next(count) != wrong:
                return heard, took
            other = heard[:1] + bytes([heard[1] ^ 0x10]) + heard[2:-2] if heard else b"\x05\x81\x40"
            return with_crc(other), took

        line.exchange = lying
        test = checks(line, dialect)
        assert refused(test.table_row, row), f"{row.title}, request {wrong + 1}"


WRONG = {
    check_rows.has_128_coils: (
        "01 0F" + 15 * " 00",  # 120 coils
        "01 10" + 8 * " 00" + " 02" + 7 * " 00",  # coil 66
        "01 10" + 15 * " 00" + " 80",  # coil 128
    ),
    check_rows.has_language: ("03 03 00 00 00", "03 02 00", "03 00"),
    check_rows.has_text: ("03 04 00 01 41 42", "03 02 20 20", "03 02 C4 41"),
    check_rows.has_status: ("01 04 00 00 00 00", "01 04 07 06"),
    check_rows.has_server_id: (
        "11 0B" + b"rtu2fc 0.2".hex() + "00",  # not running
        "11 0B" + b"other! 0.2".hex() + "FF",
        "11 0C" + b"rtu2fc 0.2".hex() + "FF",
    ),
    check_rows.has_identification: (
        "2B 0E 01 81 00 00 03 00 01 41 01 01 42 02 01 43",
        "2B 0E 01 81 00 00 03 00 06" + b"rtu2fc".hex() + "01 01 42",
        "2B 0E 01 01 00 00 03 00 06" + b"rtu2fc".hex() + "01 01 42 02 01 43",
    ),
    check_rows.has_drive_timeout: ("03 02 00 00", "03 04 00 0F 00 0F"),
}


def test_a_check_refuses_wrong_content():
    """Each check, but for `echo`, which the program makes of a card's reply itself."""
    used = {getattr(ask.reply, "func", ask.reply) for row in ROWS for ask in row.asks if callable(ask.reply)}
    assert used - {check_rows.echo} == set(WRONG)
    for check, replies in WRONG.items():
        for reply in replies:
            assert refused(check, bytes.fromhex(reply)), f"{check.__name__}: {reply}"


@pytest.mark.rule("FC-9")
@pytest.mark.parametrize(("dialect", "reply"), [("card", 255), ("builtin", None)])
def test_a_long_time_out_of_the_drive_is_waited_for(dialect, reply):
    """The request and its repeat, each as long as 40003 says."""
    line = ModelLine(dialect, None)
    line.card.registers[2] = 100
    test = checks(line, dialect)
    test.answers()
    test.ask(check_rows.Ask(check_rows.parameter(1, 1), reply))
    assert line.waits_s[-1] > 2 * 100 * 0.01 + SLACK_S


NEIGHBOURS = {4, 7, 1, 13, 21, 37, 69, 133}  # of unit 5, one switch each


@pytest.mark.rule("LINE-7")
@pytest.mark.parametrize(
    ("before", "asked"), [([1000, 15], NEIGHBOURS), (None, NEIGHBOURS | {2, 8, 16, 32, 64, 128, 0b10100000})]
)
def test_each_switch_of_the_address_is_tried(before, asked):
    """If the unit is silent, also each switch alone and the reverse order."""
    test = checks(line := ModelLine("card", None))
    test.before = before
    assert test.other_units() == ", ".join(map(str, sorted(asked)))
    assert [frame[0] for frame in line.asked] == sorted(asked)


def crosses(output: str) -> list[str]:
    return [text for text, mark in rows_of(output).items() if mark == "✗"]


@pytest.mark.parametrize("unit", [1, 64, 160])
def test_a_wrong_unit_address_is_found(unit, capsys):
    """Switch 3 is stuck, one switch alone is on, the switches are in the reverse order."""
    ask(ModelLine("card", None, unit=unit))
    output = capsys.readouterr().out
    assert crosses(output) == ["unit 5 answers: no answer", f"{program.OTHERS}: unit {unit} answers"]
    assert len(rows_of(output)) == 2, "the other rows are not asked"
    assert output.endswith(f"  read: {program.NO_ANSWER_PAGE}\n")


@pytest.mark.parametrize("asked", DIALECTS)
@pytest.mark.parametrize("spoken", DIALECTS)
def test_a_card_of_another_dialect_is_one_line(spoken, asked, capsys):
    ask(ModelLine(spoken, None), dialect=asked)
    seen = {n: (one.traits["bad_function"], one.traits["index_register"]) for n, one in TABLE.items()}
    first = next(name for name in seen if seen[name] == seen[spoken])
    expected = [f"the card speaks this dialect: the card speaks {first}, not {asked}"]
    assert crosses(capsys.readouterr().out) == ([] if seen[spoken] == seen[asked] else expected)


def test_a_drive_that_is_not_announced_is_a_cross(capsys):
    ask(ModelLine("card", with_drive("card")))
    (cross,) = crosses(capsys.readouterr().out)
    assert cross.endswith(
        "instead of exception 255 (no answer from the drive); if a drive is connected, ask with --drive yes"
    )


@pytest.mark.parametrize(
    ("took_s", "says"),
    [(T35_S - 1.5 * CHARACTER_S, "too early"), (T35_S + 0.06, "too late"), (T35_S + 0.02, "")],
)
def test_answers_before_t35_and_late_ones_are_a_cross(took_s, says, capsys):
    line = ModelLine("card", None)
    line.took_s = took_s
    ask(line)
    found = crosses(capsys.readouterr().out)
    assert len(found) == bool(says)
    assert all(says in text for text in found)


def test_lost_answers_and_stray_bytes_are_a_cross(capsys):
    line = ModelLine("card", None)
    exchange, turn = line.exchange, iter(range(10_000))

    def lossy(frame: bytes, wait_s: float) -> tuple[bytes, float]:
        if frame == READ_40003 and wait_s < ANSWER_S and next(turn) % 25 == 10:
            return b"", 0
        return exchange(frame, wait_s)

    line.exchange = lossy
    line.stray = b"\0\xff"
    ask(line)
    assert crosses(capsys.readouterr().out) == [
        "answers come after t3.5 and not late: 2 of 50 answers are missing or damaged",
        "no byte between the frames: 2 bytes: 00 ff",
    ]


def test_the_card_is_left_as_it_was_found(capsys):
    line = ModelLine("card", None)
    line.card.registers[1], line.card.registers[2] = 500, 40
    test = checks(line)
    test.all_rows()
    assert line.card.registers[1] != 500
    test.write_back()
    assert line.card.registers == {0: 0, 1: 500, 2: 40}
    assert not any(line.card.coils)


# ---------------------------------------------------------------- the motor


def test_the_motor_turns_and_stops_only_when_asked(capsys, monkeypatch):
    monkeypatch.setattr(program, "TURN_S", 0.1)
    line = ModelLine("card", with_drive("card"))
    ask(line, with_drive=True, start=40)
    output = capsys.readouterr().out
    assert crosses(output) == []
    assert re.search(
        r"✓ the motor turns: status word 0[EF]03h"
        r" \(Control ready, Drive ready,.* running\), output frequency \d",
        output,
    )
    assert line.drive.frequency_word == 0 and not line.drive.running
    pdus = [frame[1:-2] for frame in line.asked]
    start_40 = bytes.fromhex("0F 0000 0020 04 7C04 9919")
    assert STOPS in pdus[pdus.index(start_40) :]


def test_a_motor_that_does_not_turn_gets_its_stop(capsys, monkeypatch):
    monkeypatch.setattr(program, "TURN_S", 0.1)
    drive = with_drive("card")
    drive.trip(13)
    line = ModelLine("card", drive)
    ask(line, with_drive=True, start=10)
    (cross,) = crosses(capsys.readouterr().out)
    assert re.match(r"the motor turns: status word [0-9A-F]{4}h \(.*\btrip\b.*\), output frequency", cross)
    assert STOPS in [frame[1:-2] for frame in line.asked[-4:]]


def test_a_stop_that_nobody_answers_is_said(monkeypatch):
    line = ModelLine("card", None)
    test = checks(line, with_drive=True, start=10)
    assert test.stop_motor() == "THE MOTOR'S STOP WAS NOT ANSWERED: use the drive's own stop"
    assert [frame[1:-2] for frame in line.asked] == [STOPS] * 3


# ---------------------------------------------------------------- the port


class Adapter(threading.Thread):
    """A pty with a model of the card on it, and with an adapter's echo if asked for."""

    def __init__(self, echo: bool = False, line: ModelLine | None = None) -> None:
        super().__init__(daemon=True)
        self.ours, port = os.openpty()
        self.name = os.ttyname(port)
        self.held = port  # the other end stays open, so that a read does not fail
        self.echo = echo
        self.line = line or ModelLine("card", None, unit=1)
        self.start()

    def run(self) -> None:
        heard = b""
        while True:
            try:
                heard += os.read(self.ours, 400)
            except OSError:
                return
            if len(heard) < 4 or not (crc_good(heard) or len(heard) in (8, 300)):
                continue
            frame, heard = heard, b""
            time.sleep(0.02)
            answer = self.line.exchange(frame, 0)[0]
            os.write(self.ours, (frame if self.echo else b"") + answer)

    def close(self) -> None:
        os.close(self.held)
        os.close(self.ours)


def start(*arguments: object, how: tuple[str, ...] = ("-m", "sw.rtu2fc", "check")) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, *how, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


def run(*arguments: object) -> tuple[int, str, str]:
    process = start(*arguments)
    output, errors = process.communicate(timeout=60)
    return process.returncode, output, errors


class FakePort:
    """A port on which the answer to each request arrives in these pieces; with the times of all calls."""

    name = "port"

    def __init__(self, *pieces: bytes) -> None:
        self.pieces, self.left = pieces, []
        self.sent: list[float] = []
        self.heard: list[float] = []

    def write(self, data: bytes) -> None:
        self.sent.append(time.monotonic())
        self.left = list(self.pieces)

    def read(self, seconds: float) -> bytes:
        self.heard.append(time.monotonic())
        return self.left.pop(0) if self.left and seconds else b""

    def close(self) -> None: ...


@pytest.mark.parametrize("answer", ["01 01 04 07 0E BA 09", "01 81 DE", "01 11 03 41 42 FF"])
def test_an_answer_ends_by_its_length_too(answer):
    """One frame in 256 has a CRC that ends in 00. Without its last byte it is a good frame as well."""
    frame = with_crc(bytes.fromhex(answer))
    for cut in range(1, len(frame)):
        line = Line(FakePort(frame[:cut], frame[cut:]), 9600, "8N2")
        assert line.exchange(READ_40003, 0.5)[0] == frame, cut
    assert answer != "01 01 04 07 0E BA 09" or crc_good(frame[:-1])


@pytest.mark.nightly
def test_an_adapter_that_echoes_is_understood():
    """Else each write of one coil would seem answered by its own echo."""
    adapter = Adapter(echo=True)
    code, output, _ = run(adapter.name, "--row", "coil 65")
    assert "the adapter hears its own bytes" in output
    assert code == 0 and crosses(output) == [] and len(rows_of(output)) > 4
    adapter.line.unit = 99  # the card is gone, the echo stays
    code, output, _ = run(adapter.name, "--row", "coil 65")
    assert code == 1 and "unit 1 answers: no answer" in crosses(output)
    adapter.close()


def test_a_recorded_check_has_its_result_again(tmp_path, capsys, monkeypatch):
    """Without a port; another answer in the record is a cross, and a record that ends early is one line."""
    monkeypatch.setattr(cli.signal, "signal", lambda *_: None)
    record, adapter = tmp_path / "line.jsonl", Adapter()

    def checked(option: str, row: str = "06 writes") -> tuple[int, str]:
        code = cli.main(["check", adapter.name, "--row", row, option, str(record)])
        said = capsys.readouterr()
        return code, said.out + said.err

    passed = checked("--record")
    adapter.close()
    assert passed[0] == 0 and "✓ 06 writes 40002, 03 reads it\n" in passed[1]
    assert checked("--replay") == passed
    code, said = checked("--replay", row="10 writes")
    assert code == 2 and "the record has 01 06 " in said
    lines = record.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if '"heard": "01030204d2' in line)
    record.write_text("\n".join([*lines[:at], lines[at].replace("04d2", "04d3"), *lines[at + 1 :]]))
    code, said = checked("--replay")
    assert code == 1 and "✗ 06 writes 40002, 03 reads it: request 2 of 2: damaged answer" in said
    record.write_text("\n".join(lines[:at]))
    code, said = checked("--replay")
    assert code == 2 and "the record ends here" in said


def test_a_request_comes_after_a_silence_of_t35():
    """Of the bytes on a slow line, so that the computer's own delays do not hide a missing silence."""
    port = FakePort(with_crc(bytes.fromhex("01 03 02 000F")))
    line = Line(port, 300, "8N2")
    line.exchange(READ_40003, 1.0)
    ended = port.heard[-1]
    line.exchange(READ_40003, 1.0)
    assert port.sent[1] - ended >= 3.5 * 11 / 300


def test_bytes_between_the_frames_are_kept():
    ours, port = os.openpty()
    line = Line(SerialPort(os.ttyname(port)), 9600, "8N2")
    os.write(ours, b"\0")
    time.sleep(0.1)  # a pty takes a moment
    assert line.exchange(READ_40003, 0.01)[0] == b""
    os.write(ours, b"\xff")
    assert (line.stray, line.exchange(b"", 0.2)[0]) == (b"\0", b"\xff")
    line.close()
    os.close(port)
    os.close(ours)


# ---------------------------------------------------------------- against the virtual card


@pytest.mark.nightly
@pytest.mark.parametrize(("dialect", "drive"), [("card", "yes"), ("builtin", "no"), (STANDARD, "yes")])
def test_the_virtual_card_passes(tmp_path, dialect, drive):
    """But for lateness: the virtual card falls behind on a busy machine."""
    line = ("--drive", str(tmp_path / "drive")) if drive == "no" else ()
    with RunningCard(tmp_path, "--dialect", dialect, "--quiet", *line) as card:
        code, output, errors = run(
            card.link, *(("--dialect", dialect) if dialect == "card" else ()), "--drive", drive
        )
        assert errors == ""
        assert [text for text in crosses(output) if "too late" not in text] == []
        assert code == (1 if crosses(output) else 0)
        assert re.search(r"^\d\d passed, ", output, re.MULTILINE)
        commands = [f.what for f in card.frames() if (f.line, f.sender) == ("drive", "card")]
    assert commands and all("control 0000h, reference 0000h" in what for what in commands)


def start_until(text: str, *arguments: object, **how: tuple[str, ...]) -> subprocess.Popen:
    """The program, as soon as it has printed a line with `text`."""
    process, printed = start(*arguments, **how), [""]
    while text not in printed[-1]:
        printed.append(process.stdout.readline())
        assert printed[-1], "".join(printed) + process.stderr.read()
    return process


@pytest.mark.rule("BOOT-1")
@pytest.mark.parametrize("coil", [None, 127])
def test_a_coil_that_is_1_after_the_power_up_is_a_cross(coil):
    """The card is off and on after the second question for its values."""
    line = ModelLine("card", None)
    exchange, turn = line.exchange, iter(range(1000))

    def off_and_on(frame: bytes, wait_s: float) -> tuple[bytes, float]:
        if next(turn) == 2:
            line.card = CardModel()
            if coil is not None:
                line.card.coils[coil] = 1
        return exchange(frame, wait_s)

    line.exchange = off_and_on
    test = checks(line, boot=True)
    if coil is None:
        assert test.boot().startswith("40002 = 1000, 40003 = 15, all coils 0; silent for")
        assert next(turn) == 4, "a write, two questions for the values, one for the coils"
    else:
        with pytest.raises(Unexpected, match="instead of 01 10" + " 00" * 16):
            test.boot()


@pytest.mark.nightly
def test_a_port_that_goes_away_is_one_line(tmp_path):
    with RunningCard(tmp_path, "--quiet") as card:
        test = start_until("this dialect", card.link)
        card.stop(signal.SIGKILL)
        _, errors = test.communicate(timeout=30)
        assert (test.returncode, errors.count("\n")) == (3, 1)
        assert errors.startswith(
            f"rtu2fc check: {card.link} went away, not written back: 40002 and 40003, the index, coil 65: "
        )


def test_ctrl_c_is_one_line_and_writes_back():
    adapter = Adapter()
    test = start_until("unknown function", adapter.name)
    assert adapter.line.card.registers[1] != 1000
    test.send_signal(signal.SIGINT)
    _, errors = test.communicate(timeout=30)
    assert test.returncode == 130
    assert re.fullmatch(r"rtu2fc check: stopped by Ctrl-C: \d+ passed, 0 failed, 0 not asked\n", errors)
    assert adapter.line.card.registers[1] == 1000
    adapter.close()


@pytest.mark.parametrize("how", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly)])
def test_ctrl_c_stops_the_motor(tmp_path, how):
    with RunningCard(tmp_path, "--quiet") as card:
        test = start(card.link, "--drive", "yes", "--start", "40", "--yes", "--row", "motor turns")
        while not any("control 047Ch" in frame.what for frame in card.frames()):
            assert test.poll() is None
            time.sleep(0.05)
        test.send_signal(how)
        _, errors = test.communicate(timeout=30)
        by = "Ctrl-C" if how == signal.SIGINT else "a signal"
        assert f"stopped by {by}, the motor's stop was sent and answered" in errors
        card.stop()  # its log is complete then
        commands = [f.what for f in card.frames() if (f.line, f.sender) == ("drive", "card")]
        assert any("control 043Ch, reference 0000h" in what for what in commands[-1:])


def test_ctrl_c_after_a_cross_does_not_hold_up_the_motors_stop():
    """The drive never stops: its output frequency stays."""

    def lie(pdu: bytes) -> bytes:
        return pdu[:4] + b"\0\x10" if pdu[:2] == bytes([1, 4]) else pdu

    adapter = Adapter(line=ModelLine("card", with_drive("card"), unit=1, lie=lie))
    program = """import sys
from sw.rtu2fc import check, cli
check.TURN_S = check.STOP_S = 0.2
sys.exit(cli.main(["check", *sys.argv[1:]]))"""
    words = (adapter.name, "--drive", "yes", "--start", "10", "--yes", "--row", "motor")
    test = start_until("the motor stops by its ramp", *words, how=("-c", program))
    time.sleep(0.01)  # the stop and its answers take 40 ms and more
    test.send_signal(signal.SIGINT)
    output, errors = test.communicate(timeout=30)
    assert (test.returncode, errors) == (1, "")
    assert output.startswith("the motor's stop was sent and answered: 3 passed, 1 failed")
    pdus = [frame[1:-2] for frame in adapter.line.asked]
    assert pdus[-5] == STOPS, "before its status, and the three that write back"
    adapter.close()
