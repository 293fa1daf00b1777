# SPDX-License-Identifier: Apache-2.0
"""The short commands of `rtu2fc`, against the virtual card, and what a clumsy user sees of each mistake."""

from __future__ import annotations

import ast
import contextlib
import io
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import time
import tty

import pytest

from regs.dialects import STANDARD, STANDARD_DRIVE
from sim.card.run_card import ROOT, RunningCard
from sim.drive.drive_bench import table
from sw.rtu2fc import card as card_module
from sw.rtu2fc import cli, commands, port, problem, scan
from sw.rtu2fc.card import parameter, parameters, raw_of
from sw.rtu2fc.dialects import DIALECTS, meaning
from sw.rtu2fc.problem import Problem
from sw.rtu2fc.setup import SHARED
from sw.rtu2fc.switches import BAUDS, FORMS
from sw.rtu2fc.tests.test_check import start
from tb.agents.crc16 import with_crc
from tb.lib.card import baud_switches
from tb.lib.nightly import first
from tb.model.vlt_drive import PROFILES

PACKAGE = ROOT / "sw/rtu2fc"
POSIX_ONLY = {"termios", "fcntl", "pty", "tty", "pwd", "grp", "resource", "select", "tomllib"}


class Card(RunningCard):
    def ask(self, command: str, *words: object, code: int = 0) -> dict:
        """The command's JSON object; the port follows the command's name."""
        found, output = self.told(command, *words, "--json")
        assert found == code, output
        return json.loads(output)

    def told(self, command: str, *words: object) -> tuple[int, str]:
        """Exit code and all output, in this process: a second interpreter takes longer than the card."""
        output = io.StringIO()
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            code = cli.main([command, str(self.link), *map(str, words)])
        return code, output.getvalue()

    def controls(self) -> list[str]:
        """Control words that the drive was told, in hexadecimal."""
        said = [frame.what for frame in self.frames() if (frame.line, frame.sender) == ("drive", "card")]
        words = [re.search(r"control ([0-9A-F]{4})h", what)[1] for what in said]
        return [word for word in words if word != "0000"]


def started(*words: object) -> subprocess.Popen:
    return start(*words, how=("-m", "sw.rtu2fc"))


@pytest.fixture
def card(tmp_path):
    """Ends with its test: a card that waits costs half a processor."""
    with Card(tmp_path, "--quiet") as running:
        yield running


# ---------------------------------------------------------------- the package itself


def test_the_package_needs_no_posix():
    """Its modules import nothing that Windows or Python 3.10 lacks, and nothing else of the project."""
    files = sorted({*PACKAGE.glob("*.py"), *(ROOT / path for path in SHARED if path.endswith(".py"))})
    files.remove(PACKAGE / "setup.py")
    assert len(files) > 25
    for path in files:
        tree = ast.parse(path.read_text(), str(path), feature_version=(3, 10))
        for node in ast.walk(tree):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            tops = {name.split(".")[0] for name in names}
            assert tops <= sys.stdlib_module_names | {"serial", "rich"}, path
            assert not tops & POSIX_ONLY, path
            called = ast.unparse(node) if isinstance(node, ast.Attribute) else ""
            assert called not in ("os.fork", "os.openpty", "os.killpg", "os.getuid"), path


# ---------------------------------------------------------------- the drive's state and the motor


def test_status_shows_the_drive_in_words(card):
    code, output = card.told("status")
    assert code == 0 and "unit 1, dialect card, words of vlt6000" in output
    assert re.search(r"status word 0[67]0[37]h \(Control ready, Drive ready, ", output)
    assert "529 Readout: Alarm word hex = 00000000h" in output
    assert "615[1] Fault log: Error code = 0" in output


@pytest.mark.parametrize("dialect", first(list(DIALECTS)))
def test_the_motor_starts_follows_and_stops(tmp_path, dialect):
    """Each command sends the word that it shows, and the drive does it."""
    with Card(tmp_path, "--quiet", "--dialect", dialect) as card:
        started = card.ask("start", 40, "--yes")
        assert (started["sent_control_word"], started["sent_reference"]) == (0x047C, 0x1999)
        assert started["status_word"] & 0x0800 and started["output_frequency_percent"] > 0
        assert card.ask("reference", 20, "--yes")["sent_reference"] == 0x0CCC
        for command in ("stop", "coast", "reset"):
            ended = card.ask(command)
            assert not ended["status_word"] & 0x0800 and ended["output_frequency_percent"] == 0
        card.stop()
        assert card.controls() == ["047C", "047C", "043C", "0434", "043C", "04BC", "043C"]


def test_a_stop_ends_in_stopped_or_says_that_the_motor_turns(tmp_path, monkeypatch):
    with Card(tmp_path, "--quiet") as card:
        card.ask("start", 40, "--yes")
        monkeypatch.setattr(commands, "STOP_S", 0.0)
        code, output = card.told("stop")
        assert code == 1 and "THE MOTOR STILL TURNS after 0 s. Use the drive's own stop." in output
        assert f"To stop it: rtu2fc stop {card.link}" in output
        monkeypatch.undo()
        code, output = card.told("stop")
        assert code == 0 and output.endswith("output frequency 0.0 %\nstopped\n")


def test_no_motor_starts_without_a_yes(tmp_path):
    with Card(tmp_path, "--quiet") as card:
        code, output = card.told("reference", 20)
        assert code == 2 and "the control word in the card is 0000h" in output
        code, output = card.told("start", 40)
        assert code == 2 and "the motor of unit 1 will turn at 40 %; nobody can be asked" in output
        card.ask("start", 0, "--yes")
        assert card.told("reference", 10)[0] == 2, "the start bit is set: the motor would follow"
        code, output = card.told("check", "--drive", "yes", "--start", 10)
        assert code == 2 and "the motor of unit 1 will turn at 10 %; nobody can be asked" in output
        code, output = card.told("grade")
        assert code == 2 and "a motor behind it may start; nobody can be asked" in output
        card.stop()
        assert card.controls() == ["047C"]


def test_a_drive_that_tripped_is_said_and_reset(tmp_path, monkeypatch):
    monkeypatch.setattr(commands, "TURN_S", 0.5)
    with Card(tmp_path, "--quiet", "--control") as card:
        assert card.command("trip 13") == "ok"
        code, output = card.told("start", 40, "--yes")
        assert code == 1 and "The motor does not run" in output and "trip" in output
        stop = f"THE MOTOR MAY TURN. To stop it: rtu2fc stop {card.link} "
        assert card.ask("start", 40, "--yes", code=1)["motor"].startswith(stop)
        assert "615[1] Fault log: Error code = 13" in card.told("status")[1]
        card.ask("stop")
        assert not card.ask("reset")["status_word"] & 8


def test_ctrl_c_tells_of_a_motor_that_was_started(tmp_path):
    """The drive has tripped, so that the command waits for it to run."""
    with Card(tmp_path, "--quiet", "--control") as card:
        card.command("trip")
        command = started("start", card.link, 40, "--yes")
        while "047C" not in card.controls():
            assert command.poll() is None
            time.sleep(0.05)
        time.sleep(0.3)
        command.send_signal(signal.SIGINT)
        _, errors = command.communicate(timeout=30)
    stop = f"rtu2fc stop {card.link} --unit 1 --baud 9600 --format 8N2"
    assert command.returncode == 130
    assert errors == f"rtu2fc start: stopped by Ctrl-C\nTHE MOTOR MAY TURN. To stop it: {stop}\n"


def test_a_stop_is_sent_before_anything_is_printed(tmp_path):
    """A full disk, a reader that has gone and a closed output keep no stop from the line."""
    with Card(tmp_path, "--quiet", "--control") as card:
        words = [sys.executable, "-m", "sw.rtu2fc"]
        for command, output, code in (
            ("stop", ">/dev/full", 2),
            ("coast", ">/dev/full", 2),
            ("reset", ">/dev/full --json", 2),
            ("stop", ">&-", 0),
            ("stop", "| true", 1),
        ):
            card.ask("start", 2, "--yes")
            line = f"{' '.join(words)} {command} {card.link} {output}"
            done = subprocess.run(
                ["bash", "-o", "pipefail", "-c", line], cwd=ROOT, capture_output=True, text=True, timeout=60
            )
            assert done.returncode == code, (line, done)
            assert "Traceback" not in done.stderr and "ignored" not in done.stderr
            wanted, until = {"coast": "0434"}.get(command, "043C"), time.monotonic() + 10
            while card.controls()[-1] != wanted:  # the card writes its log in blocks
                assert time.monotonic() < until, line
                time.sleep(0.05)
            if output == ">/dev/full":
                assert done.stderr.startswith(f"rtu2fc {command}: the output: No space left on device\n")
                assert f"THE MOTOR MAY TURN. To stop it: rtu2fc stop {card.link}" in done.stderr


def test_a_reader_that_stops_still_gets_the_stop_command(tmp_path):
    with Card(tmp_path, "--quiet") as card:
        for words in (("start", card.link, 40, "--yes"), ("start", card.link, 40, "--yes", "--json")):
            command = started(*words)
            if "--json" not in words:
                assert command.stdout.readline().startswith("telegram: control word 047Ch")
            command.stdout.close()
            code, errors = command.wait(30), command.stderr.read()
            command.stderr.close()
            assert code == 1 and errors.startswith("THE MOTOR MAY TURN. To stop it: rtu2fc stop ")
            assert errors.count("\n") == 1


@pytest.mark.parametrize("dialect", first(["card", "builtin", "hvac_basic"]))
def test_a_stop_that_does_not_reach_the_drive_says_so(tmp_path, dialect, monkeypatch):
    monkeypatch.setattr(card_module, "ANSWER_S", 0.5)
    with Card(tmp_path, "--quiet", "--control", "--dialect", dialect) as card:
        card.ask("start", 2, "--yes")
        assert card.command("cut drive on") == "ok"
        code, output = card.told("start", 40, "--yes", "--json")
        assert code == 4 and json.loads(output.splitlines()[-1])["motor"].startswith("THE MOTOR MAY TURN. ")
        for command in ("stop", "coast", "reset"):
            code, output = card.told(command)
            assert code == 4, output
            assert output.startswith(f"rtu2fc {command}: the card answers, but its drive does not\n")
            assert "Swap A and B" not in output
            assert output.endswith(
                f"THE MOTOR MAY TURN. To stop it: rtu2fc stop {card.link} --unit 1 --baud 9600 --format 8N2\n"
            )
        card.command("cut drive off")
        card.command("cut modbus on")
        code, output = card.told("stop")
        assert code == 4 and output.startswith("rtu2fc stop: no answer\n")
        assert "THE MOTOR MAY TURN" in output, "it was asked to stop, and nobody heard it"
        monkeypatch.undo()
        card.command("cut modbus off")
        card.ask("stop")


@pytest.mark.parametrize("typed", ["y\n", "", "yes\n"])
def test_only_yes_starts_a_motor(tmp_path, typed, monkeypatch):
    """An empty text is Ctrl-D."""
    terminal = io.StringIO(typed)
    terminal.isatty = lambda: True
    monkeypatch.setattr(sys, "stdin", terminal)
    with Card(tmp_path, "--quiet") as card:
        code, output = card.told("start", 10)
        card.stop()
        assert (code, card.controls()) == ((0, ["047C"]) if typed == "yes\n" else (2, []))
        assert "nothing was sent" in output or typed == "yes\n"


def test_grade_says_that_it_may_leave_a_motor_on(tmp_path):
    """After Ctrl-C too, with the tests so far. A slave that is silent was sent no write."""
    report = tmp_path / "report.json"
    says = "A motor behind unit 1 may turn. To stop it: rtu2fc stop "
    with Card(tmp_path, "--quiet") as card:
        command = started("grade", card.link, "--yes", "--json", "--report", report)
        while not any("write" in frame.what for frame in card.frames() if frame.line == "modbus"):
            assert command.poll() is None
            time.sleep(0.05)
        time.sleep(0.5)
        command.send_signal(signal.SIGINT)
        output, errors = command.communicate(timeout=30)
        assert command.returncode == 130 and errors.startswith(says), errors
        found = json.loads(output)
        assert found["error"]["text"] == "stopped by Ctrl-C" and found["motor"].startswith(says)
        assert json.loads(report.read_text())["tests"] == found["tests"] != []
        code, output = card.told("grade", "--yes", "--unit", 3, "--timeout", 0.1, "--report", report)
        assert code == 4 and "may turn" not in output
        assert json.loads(report.read_text())["tests"] == found["tests"], "the old file stays"


# ---------------------------------------------------------------- parameters


def test_a_parameter_is_found_by_number_and_name():
    assert parameter("vlt6000", "514").name == "Readout: Motor current"
    assert parameter("vlt6000", "readout: motor current").number == 514
    assert parameter("vlt6000", "615[2]").index == 2
    assert parameter("vlt6000", "2000").type == ""
    with pytest.raises(Problem, match="parameters of vlt6000 have 'motor' in their name") as many:
        parameter("vlt6000", "motor")
    assert "  104 Motor frequency fM,N" in many.value.advice and many.value.advice[-1] == "  and 1 more"
    for wrong in ("0", "2048", "514[x]", "514[256]", "no such name"):
        with pytest.raises(Problem):
            parameter("vlt6000", wrong)


def test_the_table_of_a_drive_is_that_of_the_simulated_one():
    for drive in PROFILES:
        rows = [
            (row["pnu"], row["name"], row["type"], row["conversion"], row["unit"]) for row in table(drive)
        ]
        found = [(p.number, p.name, p.type, p.conversion, p.unit) for p in parameters(drive).values()]
        assert [tuple(map(str, row)) for row in found] == rows


@pytest.mark.parametrize(
    ("pnu", "text", "raw"),
    [("104", "60", 60), ("105", "3.25", 325), ("105", "3,25", 325), ("225", "-1.5", -1500)],
)
def test_a_value_is_scaled_by_its_conversion_index(pnu, text, raw):
    assert raw_of(parameter("vlt6000", pnu), text) == raw


@pytest.mark.parametrize("text", ["60.5", "70000", "x", "1e999999999", "snan", "nan", "inf"])
def test_a_value_that_cannot_be_sent_is_refused(text):
    with pytest.raises(Problem):
        raw_of(parameter("vlt6000", "104"), text)


@pytest.mark.parametrize("dialect", first(list(DIALECTS)))
def test_parameters_are_read_and_written(tmp_path, dialect):
    """Number, array and text; the index register is what it was before."""
    number, text, array = {STANDARD: ("302", "37", "1530[1]")}.get(dialect, ("225", "533", "615[2]"))
    with Card(tmp_path, "--quiet", "--dialect", dialect) as card:
        found = card.ask("write", number, "1.5")
        assert (found["raw"], found["after"]) == (1500, "1.500 Hz")
        assert card.ask("write", text, "PUMP 3")["after"] == "'PUMP 3'"
        first_, second, third = card.ask("read", number, text, array)["parameters"]
        assert (first_["value"], second["value"], third["raw"]) == ("1.500 Hz", "'PUMP 3'", 0)
        if dialect != STANDARD:
            assert card.ask("write", "211", "-1.5")["after"] == "-1.50 %", "int16"
            assert card.ask("read", "211")["parameters"][0]["raw"] == -150
            assert card.ask("write", "225", "-2")["after"] == "-2.000 Hz", "int32"
        card.stop()  # its log is complete then
        register = f"{40001 + DIALECTS[dialect].index_register}"
        said = [
            f.what for f in card.frames() if f.line == "modbus" and f"write register {register}" in f.what
        ]
        assert said and said[-1].endswith("= 0000h"), "as it was before"


def test_an_eeprom_write_leaves_coil_65_as_it_was(card):
    card.ask("write", 104, 55, "--store")
    said = [frame.what for frame in card.frames()]
    asked = [
        frame.data[3] >> 4 for frame in card.frames() if frame.sender == "card" and len(frame.data) == 16
    ]
    assert 14 in asked, "AK: word into RAM and EEPROM"
    assert [what for what in said if "write coil 65" in what][-1].endswith("= off")


def test_each_exception_of_the_handbook_has_words():
    assert meaning(67, "card") == "unknown function"
    assert meaning(2, "card") == "value refused by the card"
    assert meaning(2, "card", of_drive=True) == "the drive: value exceeds limits"
    assert meaning(2, STANDARD, of_drive=True) == "no such coil or register, or it cannot be written"
    assert meaning(255, "card") == "no answer from the drive"
    assert meaning(99, "card") == "no code of this dialect"


# ---------------------------------------------------------------- what goes wrong


def test_a_refusal_and_a_silence_are_in_words_with_what_is_next(card):
    for words, code, *says in (
        (("write", 514, 1), 5, "rtu2fc write: exception 1: the drive: no write access\n"),
        (("read", 1999, 104), 5, "exception 0: the drive: parameter does not exist\n", "\n104 Motor"),
        (("status", "--dialect", "builtin"), 6, "rtu2fc status: the card speaks card, not builtin\n"),
        (
            *(("status", "--unit", 3), 4, "rtu2fc status: no answer\n  Tried: unit 3 at 9600 8N2 on "),
            *(f" on {card.link}, 1.5 s.\n", f"\n  Rate, format or unit not known: rtu2fc scan {card.link}\n"),
            f"\n  Read: {card_module.NO_ANSWER_PAGE}\n",
        ),
    ):
        found, output = card.told(*words)
        assert found == code and all(text in output for text in says), output


def test_a_busy_port_is_one_line(card):
    with contextlib.closing(port.SerialPort(str(card.link))):
        code, output = card.told("status")
    assert code == 3 and output.startswith(f"rtu2fc status: {card.link} is in use by another program\n")


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["status", "no/such/port"], 3, "there is no no/such/port\n  Ports of this computer: "),
        (["status", "/dev/null"], 3, "rtu2fc status: /dev/null is no serial port that can be opened"),
        (["check", "p", "--unit", "248"], 2, "the unit is 1 to 247, not '248'"),
        (["status", "socket://127.0.0.1"], 3, "socket://127.0.0.1 lacks the number of its port"),
        (["frobnicate"], 2, "invalid choice: 'frobnicate'"),
        (["status", "socket://127.0.0.1:1"], 3, "127.0.0.1:1 cannot be opened: [Errno "),
        (["check", "p", "--row", "no such row"], 2, "no row has 'no such row' in its title"),
        (["start", "no/such/port", "-40,5"], 3, "there is no no/such/port\n"),
        (["status", "p", "--replay", "VERSION"], 2, "rtu2fc status: VERSION is no record of rtu2fc"),
        (["parameters", "--drive-type", "x"], 2, f"the drive is auto, {STANDARD_DRIVE}, vlt2800"),
        (["simulate", "--program", "none"], 2, "the virtual card's program is not here: none"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(words, code, says, capsys, monkeypatch):
    monkeypatch.setattr(cli.signal, "signal", lambda *_: None)
    try:
        found = cli.main(words)
    except SystemExit as ended:
        found = ended.code
    output, errors = capsys.readouterr()
    assert (found, output) == (code, "") and says in errors
    assert "Traceback" not in errors and errors.count("\n") <= 2


# ---------------------------------------------------------------- switches, record and replay, watch, scan


@pytest.mark.rule("LINE-2", "LINE-3", "LINE-7")
def test_the_switches_are_those_of_the_card(capsys):
    for baud, form in itertools.product(BAUDS, FORMS):
        assert cli.main(["switches", str(baud), form, "23", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["baud_switches"] == baud_switches(baud, form, rest="")
        assert found["address_switches"] == "11101000"
    assert cli.main(["switches", "19200", "8E1", "17"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "       ON  | #  .  #  .  .  .  .  .  . |" in lines and all(len(line) <= 80 for line in lines)


def test_watch_writes_a_table_a_log_and_a_plot(card, tmp_path):
    files = {"--csv": tmp_path / "w.csv", "--plot": tmp_path / "w.svg"}
    options = [word for pair in files.items() for word in pair]
    code, output = card.told("watch", 514, 533, "--every", 0.2, "--for", 0.7, *options)
    assert code == 0, output
    rows = files["--csv"].read_text().splitlines()
    assert rows[0] == "seconds,514 Readout: Motor current A,533 Display text 1" and len(rows) >= 3
    assert re.search(r"^ +0\.\d s  514 = 0\.00 A  533 = '", output, re.MULTILINE)
    assert files["--plot"].read_text().count("<polyline") == 2


def test_scan_finds_rate_and_unit(tmp_path, monkeypatch):
    """A pty has no rate: the first setting is answered."""
    monkeypatch.setattr(scan, "LISTEN_S", 0.1)
    monkeypatch.setattr(scan, "ANSWER_S", 1.0)  # the virtual card falls behind on a busy machine
    with Card(tmp_path, "--quiet", "--sw-addr", "11100000") as card:
        found = card.ask("scan", "--units", "6-7")
        assert found["found"] == [{"baud": 9600, "format": "8N2", "unit": 7, "heard": False}]
        card.stop()
        asked = {frame.data[1] for frame in card.frames() if frame.sender == "master"}
    assert asked == {3}, "it only reads"


def test_frames_are_found_among_other_bytes():
    good = bytes.fromhex("01 03 14 13 00 02 30 3E")
    assert scan.frames_in(b"\0" + good + b"\xff" + good) == [good, good]
    assert scan.frames_in(bytes(20)) == []
    assert scan.units_of("1-3,17") == [1, 2, 3, 17]
    for wrong in ("0", "3-1", "248", "x"):
        with pytest.raises(Problem):
            scan.units_of(wrong)


def test_scan_only_listens_while_another_master_asks(tmp_path):
    ours, port_ = os.openpty()
    tty.setraw(port_)
    name = os.ttyname(port_)
    command = started("scan", name, "--json")
    while command.poll() is None:
        os.write(ours, with_crc(bytes.fromhex("09 03 14 13 00 02")))
        time.sleep(0.05)
    assert json.loads(command.stdout.read())["found"][0] == {"baud": 9600, "unit": 9, "heard": True}
    os.set_blocking(ours, False)
    with pytest.raises(BlockingIOError):
        os.read(ours, 1)
    for fd in (ours, port_):
        os.close(fd)


def test_the_virtual_card_is_started():
    command = started("simulate", "--program", ROOT / "build/card", "--", "--version")
    assert "rtu2fc" in command.communicate(timeout=30)[0]


# ---------------------------------------------------------------- the page


def test_the_page_names_every_command_and_exit_code():
    text = (ROOT / "docs/reference/rtu2fc.md").read_text()
    known = set(cli.build()._subparsers._group_actions[0].choices)
    assert set(re.findall(r"^\| `rtu2fc (\w+)", text, re.MULTILINE)) == known
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", text, re.MULTILINE)}
    assert codes == {value for name, value in vars(problem).items() if name.isupper()}


def test_every_page_that_a_message_names_is_there():
    text = "\n".join(path.read_text() for path in PACKAGE.glob("*.py"))
    named = set(re.findall(r"(docs/[\w/-]+\.md)(?:, ([A-Z][\w ]+))?", text))
    assert len(named) > 4
    for page, title in named:
        assert not title or f"\n## {title}\n" in (ROOT / page).read_text(), (page, title)


def test_the_example_of_the_readme_reads_a_parameter(card, capsys):
    text = (PACKAGE / "README.md").read_text()
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(example.replace("from rtu2fc.", "from sw.rtu2fc.").replace("COM3", str(card.link)), {})
    assert capsys.readouterr().out == "0\n", "the motor stands"
    known = set(cli.build()._subparsers._group_actions[0].choices)
    assert set(re.findall(r"^rtu2fc (\w+)", text, re.MULTILINE)) <= known
