# SPDX-License-Identifier: Apache-2.0
"""The ways to a slave: serial port, pty, pins of the card, pins of a design; and the messages for a user."""

from __future__ import annotations

import json
import os
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import pytest

from campaigns.conformance import run, serial
from campaigns.conformance.card import PROFILE, CardDriver
from campaigns.conformance.cases import CASES, Profile, Send
from campaigns.conformance.designs import Design, DesignError, designs, fetched
from campaigns.conformance.designs import grade as grade_design
from campaigns.conformance.engine import FAIL, HIDDEN, NONE, OWN_CODE, PASS, NoAnswer, Verdict, grade
from campaigns.conformance.fixture import PROFILE as PLAIN
from campaigns.conformance.fixture import Slave
from campaigns.conformance.ports import ByteDriver, PortError, PtyPort, SerialPort
from rtl.sources import ROOT
from tb.agents import rtu

BY_NUMBER = {case.number: case for case in CASES}
SHORT_S = 0.05  # the slave of these tests answers at once
TIMES = ["--timeout", str(SHORT_S), "--gap", "0.02"]


class PtySlave:
    """The fixture's slave on a pty, in a thread. Bytes that arrive together are a frame."""

    def __init__(self, fault: str | None = None):
        self.slave, self.port = Slave(PLAIN, fault), PtyPort()
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> PtySlave:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()
        self.port.__exit__()

    def _serve(self) -> None:
        while not self._ends.is_set():
            frame = self.port.read(0.02)
            while frame and (more := self.port.read(0.005)):
                frame += more
            if 4 <= len(frame) <= 256 and (reply := self.slave.reply(frame)):
                self.port.write(reply)


def outcomes(found: list[Verdict]) -> dict[str, str]:
    return {verdict.number: verdict.outcome for verdict in found}


def command(port: PtySlave, *words: str) -> list[str]:
    return ["--port", port.port.name, "--unit", "17", "--format", "8N1", *TIMES, *words]


def test_the_command_passes_the_slave_without_faults(capsys):
    with PtySlave() as slave:
        assert serial.main(command(slave, "--functions", "3,6")) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[0].split() == ["pass", "SL-1"]
    assert shown[-1].startswith("0 failed; 14 tests need the pins")


@pytest.mark.slow
def test_the_command_names_what_a_port_shows_of_a_fault(capsys):
    with PtySlave("06 does not write") as slave:
        assert serial.main(command(slave, "--functions", "3,6")) == 1
    shown = capsys.readouterr().out
    assert "fail       AP-2   after 06: the register holds 42439 instead of 4660" in shown
    assert "n.a.       AP-3   no function 16" in shown


@pytest.mark.parametrize(
    ("code", "outcome"), [(2, "own code"), pytest.param(66, "fail", marks=pytest.mark.slow)]
)
def test_the_command_accepts_the_own_code_that_it_was_given(code, outcome, capsys):
    with PtySlave("sends exception 2 for a wrong quantity") as slave:
        result = serial.main(command(slave, "--functions", "3,6", "--own-codes", f"quantity={code}"))
    shown = capsys.readouterr().out
    assert f"{outcome:10} AP-4  " in shown
    assert ("own code; " in shown) == (result == 0) == (code == 2)


def test_a_unit_that_does_not_answer_is_one_line():
    with PtyPort() as port, pytest.raises(NoAnswer, match=r"^unit 9 does not answer at 19200 8E1$"):
        grade(ByteDriver(port, 19200, SHORT_S), Profile(unit=9))


def test_a_port_that_is_busy_or_not_there_is_one_line():
    with pytest.raises(PortError, match=r"^there is no /dev/no-such-port$"):
        SerialPort("/dev/no-such-port")
    with pytest.raises(PortError, match="no serial port"):
        SerialPort(os.devnull)
    with (
        PtyPort() as port,
        SerialPort(port.name),
        pytest.raises(PortError, match=r"in use by another program$"),
    ):
        SerialPort(port.name)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--unit", "0"], "0 is not from 1 to 247"),
        (["--values", "5"], "--values takes two values that differ"),
        (["--unknown", "6"], "--unknown 6 is one of --functions"),
        (["--functions", "5,6"], "neither 1 nor 3"),
        (
            ["--functions", "3,8,43", "--unknown", "9"],
            "--functions: no tests of 8, 43; there are tests of 1, 2, 3",
        ),
        (["--no-input", "1"], "--no-input 1 is one of those to read"),
        (["--timeout", "0"], "--timeout and --gap must be more than 0"),
        (["--gap", "nan"], "--timeout and --gap must be more than 0"),
        (["--timeout", "inf"], "at most 60 s"),
        (["--register", "x"], "'x' is no number"),
        (["--functions", ""], "'' is no number"),
        (["--own-codes", "parity=3"], "no reason 'parity'; there are function, address"),
        (["--own-codes", "function"], "'' is no number"),
        (["--own-codes", "function=0"], "0 is not from 1 to 255"),
        (["--register", "65535"], "--register 65535 and --registers 2 go beyond address 65535"),
        (["--coil", "65530", "--no-coil", "1"], "--coil 65530 and --coils 10 go beyond address 65535"),
        (["--no-register", "1"], "--no-register 1 is one of those to write"),
    ],
)
def test_a_wrong_option_is_one_line(words, reason, capsys):
    with pytest.raises(SystemExit) as end:
        serial.main(["--port", "nowhere", *words])
    shown = capsys.readouterr().err
    assert end.value.code == 2 and reason in shown and shown.count("\n") == 1


def test_an_adapter_that_echoes_is_one_line():
    class Echo:
        name = "port"

        def __init__(self) -> None:
            self.heard = b""

        def write(self, data: bytes) -> None:
            self.heard += data

        def read(self, seconds: float) -> bytes:
            heard, self.heard = self.heard, b""
            return heard

    with pytest.raises(
        NoAnswer, match=r"^the port hears its own requests; switch the echo of the adapter off$"
    ):
        grade(ByteDriver(Echo(), 19200, SHORT_S, 0.01), Profile())


@pytest.mark.parametrize("begins", ["before the request", "after it"])
def test_a_line_that_is_never_silent_is_one_line(begins):
    class Noise:
        name = "port"
        noisy = begins == "before the request"

        def write(self, data: bytes) -> None:
            self.noisy = True

        def read(self, seconds: float) -> bytes:
            return bytes(8) if self.noisy else b""

    with pytest.raises(PortError, match=r"^port is never silent; check its rate and the bias of the line$"):
        ByteDriver(Noise(), 19200, SHORT_S).exchange(Send(b"\x01\x03"))


def test_a_late_reply_belongs_to_no_request():
    with PtyPort() as port:
        driver = ByteDriver(port, 19200, SHORT_S)
        os.write(port._theirs, b"late")
        time.sleep(0.01)
        assert driver.exchange(Send(b"\x01\x03")).data == b""
        os.write(port._theirs, b"late")
        time.sleep(0.01)
        assert driver.exchange(Send()).data == b"late", "it only listens"


class LatePort:
    """A slave that answers a request after `delay_s(request)`; None: never."""

    name = "port"

    def __init__(self, delay_s: Callable[[bytes], float | None]):
        self.slave, self.delay_s = Slave(PLAIN), delay_s
        self.due: list[tuple[float, bytes]] = []

    def write(self, data: bytes) -> None:
        if (delay := self.delay_s(data)) is not None:
            reply = self.slave.reply(data) or rtu.build(17, rtu.read_registers(0, 1))
            self.due.append((time.monotonic() + delay, reply))

    def read(self, seconds: float) -> bytes:
        until = time.monotonic() + seconds
        while True:
            now = time.monotonic()
            heard = b"".join(data for at, data in self.due if at <= now)
            self.due = [(at, data) for at, data in self.due if at > now]
            if heard or now >= until:
                return heard
            time.sleep(0.002)


def test_a_slave_that_always_answers_late_is_one_line():
    port = LatePort(lambda request: 1.5 * SHORT_S)
    with pytest.raises(NoAnswer, match=r"^unit 17 answers after the longest wait; it needs a longer one$"):
        grade(ByteDriver(port, 19200, SHORT_S, 0.01), PLAIN)


def test_a_late_reply_fails_its_own_test_and_not_the_next_one():
    """Broadcasts are answered so late that the good request after them already has its reply."""
    wait_s = 4 * SHORT_S
    port = LatePort(lambda request: 1.5 * wait_s if request[0] == 0 else 0.0)
    profile, chosen = replace(PLAIN, functions=frozenset({3, 6})), ("SL-4", "SL-1", "AP-2")
    found = grade(ByteDriver(port, 19200, wait_s, 0.01), profile, [BY_NUMBER[number] for number in chosen])
    assert [verdict.outcome for verdict in found] == [FAIL, PASS, PASS]
    assert found[0].text.startswith("a reply after the longest wait: 11 03 00")


def test_a_silent_slave_on_a_port_names_the_likely_reasons():
    with PtyPort() as port, pytest.raises(NoAnswer, match=r"another program may have the port open$"):
        serial.main(["--port", port.name, "--format", "8N1", *TIMES])


@pytest.mark.rule("FRAME-4", "EXC")
def test_the_card_on_its_pins_fails_nothing_that_is_quick():
    """One test of each kind: bytes, edges, parity, DE, and an own exception code."""
    chosen = [BY_NUMBER[number] for number in ("SL-1", "SL-12", "SL-18", "SL-24", "AP-5", "AP-11")]
    with CardDriver("standard") as driver:
        found = grade(driver, PROFILE, chosen)
    assert [verdict.outcome for verdict in found] == [PASS] * 4 + [OWN_CODE] * 2, found


@pytest.mark.slow
def test_the_card_on_its_pins_fails_nothing(config):
    with CardDriver(config) as driver:
        found = grade(driver, PROFILE)
    assert {verdict.outcome for verdict in found} == {PASS, OWN_CODE, NONE}
    assert {verdict.number for verdict in found if verdict.outcome == OWN_CODE} == set(PROFILE.own_codes)
    # Nothing to try them on: its map is smaller than a longest request, or it has no function 2 and 4.
    none = {verdict.number for verdict in found if verdict.outcome == NONE}
    assert none == {"AP-23", "AP-24", "AP-28", "AP-33", "AP-34", "AP-35"}


def test_a_design_is_graded_on_its_pins():
    design = designs()["holding_registers"]
    slow = {"clk_hz": 500_000, "parameters": design.entry["parameters"] | {"CLK_HZ": 500_000}}
    found = outcomes(grade_design(Design("slow_example", design.entry | slow), ["SL-1", "AP-9"]))
    assert found == {"SL-1": PASS, "AP-9": NONE}


@pytest.mark.slow
def test_a_fault_of_a_design_is_found_on_its_pins(tmp_path):
    """The example with an unconnected DE."""
    design = designs()["holding_registers"]
    broken = tmp_path / "holding_registers.v"
    text = (ROOT / "docs/example/holding_registers.v").read_text()
    assert ".de(de)" in text
    broken.write_text(text.replace(".de(de)", ".de()"))
    entry = design.entry | {"files": [str(broken)]}
    found = outcomes(grade_design(Design("broken_example", entry), ["SL-1", "SL-24"]))
    assert found == {"SL-1": PASS, "SL-24": FAIL}


def test_sources_that_cannot_be_fetched_are_one_line(tmp_path):
    with pytest.raises(DesignError, match=r"^cannot fetch .*/none at 0123456789ab: .+$") as error:
        fetched("nobody", f"{tmp_path}/none", "0123456789ab" * 3 + "0123")
    assert "\n" not in str(error.value)


def test_a_design_that_does_not_build_is_one_line():
    entry = designs()["holding_registers"].entry | {"top": "no_such_top"}
    with pytest.raises(DesignError, match=r"was not graded; build/conformance/no_such_top/\*\.log say why$"):
        grade_design(Design("no_such_top", entry))


@pytest.fixture
def kept(monkeypatch, tmp_path):
    """Two slaves without a simulation, one of them ours, with results and page in a folder of their own."""
    verdicts = [Verdict(case.number, PASS) for case in CASES]
    subjects = {
        "one": run.Subject("one", "one", "pty", lambda: [Verdict("SL-1", FAIL, "no reply"), *verdicts[1:]]),
        "ours": run.Subject("ours", "ours", "pins", lambda: verdicts, ours=True),
    }
    monkeypatch.setattr(run, "subjects", lambda: subjects)
    monkeypatch.setattr(run, "named", lambda path: path.name)
    for name in ("KEPT", "PAGE"):
        monkeypatch.setattr(run, name, tmp_path / name)
    return tmp_path


def test_one_slave_alone_leaves_the_page_as_it_was(kept, capsys):
    (kept / "PAGE").write_text("nine slaves\n")
    assert run.main(["--only", "one"]) == 1, "it fails a test"
    shown = capsys.readouterr().out
    assert "  fail       SL-1   no reply\n" in shown
    assert "PAGE is as it was: it needs a result of ours, too\n" in shown
    assert (kept / "PAGE").read_text() == "nine slaves\n"
    assert run.main(["--only", "ours"]) == 0 and "| ours | pins |" in (kept / "PAGE").read_text()


def test_the_name_of_a_slave_is_checked_without_grading(kept):
    assert run.main(["--check", "ours"]) == 0 and not (kept / "KEPT").exists()
    with pytest.raises(run.ConformanceError, match=r"^there is no slave 'other'; there are one, ours$"):
        run.main(["--check", "other"])


def test_make_checks_the_name_of_a_slave_before_it_builds():
    done = subprocess.run(
        ["make", "-n", "conformance", "SLAVE=x"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    check, build = (
        done.stdout.index(text) for text in ("conformance.run --check 'x'", "firmware card drive")
    )
    assert check < build


def test_results_of_another_list_of_tests_are_not_taken(kept):
    old = [{"number": "SL-1", "outcome": PASS, "text": ""}]
    (kept / "KEPT").write_text(json.dumps({"one": {"stated": "", "verdicts": old}}))
    with pytest.raises(run.ConformanceError, match=r"^no slave was graded yet"):
        run.main(["--report"])


@pytest.mark.parametrize("damage", ["", "[]", '{"one": 1}', '{"one": {"verdicts": [1]}}'])
def test_damaged_results_are_one_line(kept, damage):
    (kept / "KEPT").write_text(damage)
    with pytest.raises(run.ConformanceError, match=r"^KEPT is damaged; delete it and grade"):
        run.main(["--report"])


def test_the_page_lists_every_slave_with_a_result(tmp_path, monkeypatch):
    verdicts = [{"number": case.number, "outcome": PASS, "text": ""} for case in CASES]
    verdicts[0] = {"number": CASES[0].number, "outcome": FAIL, "text": "no reply to a good request"}
    verdicts[1] = {"number": CASES[1].number, "outcome": HIDDEN, "text": ""}
    for one in verdicts[2:4]:
        one |= {"outcome": NONE, "text": "no function 5"}
    monkeypatch.setattr(run, "PAGE", tmp_path / "page.md")
    run.write({"modbus_tk": {"stated": "modbus_tk 0", "verdicts": verdicts}})
    page = (tmp_path / "page.md").read_text()
    assert f"| modbus_tk | pty | modbus_tk 0 | {len(CASES) - 4} | 0 | 1 | 2 | 1 |" in page
    assert "- SL-1: no reply to a good request" in page and "- SL-3, SL-4: no function 5\n" in page
    assert "| SL-1 | **✗** |\n| SL-2 |  |\n| SL-3 | n.a. |" in page
    assert run.failures_of_ours({"modbus_tk": {"stated": "", "verdicts": verdicts}}) == []
    assert run.failures_of_ours({"tiny": {"stated": "", "verdicts": verdicts}}) == [
        "tiny card, pins: SL-1 no reply to a good request"
    ]
