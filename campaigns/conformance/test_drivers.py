# SPDX-License-Identifier: Apache-2.0
"""The ways to a slave: serial port, pty, pins of the card, pins of a design; and the messages for a user."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import pytest

from campaigns.conformance.card import PROFILE, CardDriver
from campaigns.conformance.designs import Design, designs
from campaigns.conformance.designs import grade as grade_design
from campaigns.conformance.fixture import PROFILE as PLAIN
from campaigns.conformance.fixture import Slave
from campaigns.conformance.ports import PtyPort
from rtl.sources import ROOT
from sw.rtu2fc import cli
from sw.rtu2fc.cases import CASES
from sw.rtu2fc.engine import FAIL, NONE, OWN_CODE, PASS, NoAnswer, grade
from sw.rtu2fc.grade import ByteDriver
from sw.rtu2fc.port import Line
from sw.rtu2fc.problem import PortError
from tb.agents import rtu

BY_NUMBER = {case.number: case for case in CASES}
SHORT_S = 0.05  # the slave of these tests answers at once


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


CODE_2 = "sends exception 2 for a wrong quantity"
NIGHTLY = pytest.mark.nightly


WRONG_06 = "✗ fail     AP-2   after 06: the register holds 42439"


@pytest.mark.parametrize(
    ("fault", "words", "code", "said", "wait_s"),
    [
        (None, [], 0, "0 failed; 14 tests need the pins", SHORT_S),
        pytest.param(CODE_2, ["--own-codes", "quantity=2"], 0, "✓ own code AP-4  ", 0.5, marks=NIGHTLY),
        pytest.param("06 does not write", [], 1, WRONG_06, 0.5, marks=NIGHTLY),
    ],
)
def test_the_command_names_what_a_port_shows(fault, words, code, said, wait_s, capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(cli.signal, "signal", lambda *_: None)
    record, line = str(tmp_path / "line.jsonl"), "--unit 17 --baud 19200 --format 8N1 --functions 3,6 --yes"
    with PtySlave(fault) as slave:
        place = ["grade", slave.port.name, *line.split(), *words, "--timeout", str(wait_s), "--gap", "0.02"]
        result = cli.main([*place, "--record", record, "--report", str(tmp_path / "report.json")])
    assert cli.main([*place, "--replay", record, "--report", str(tmp_path / "report.html")]) == code
    shown = capsys.readouterr().out
    assert result == code and said in shown
    assert shown.startswith("  ✓ pass     SL-1\n") and "  - n.a.     AP-3   no function 16" in shown
    tests = json.loads((tmp_path / "report.json").read_text())["tests"]
    assert [one["number"] for one in tests] == list(BY_NUMBER) and tests[0]["must"] == CASES[0].must
    page = (tmp_path / "report.html").read_text()
    assert page.count("<tr class=") == len(CASES) and ("<tr class=fail>" in page) == bool(code)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--unit", "0"], "the unit is 1 to 247, not '0'"),
        (["--values", "5"], "--values takes two values that differ"),
        (["--functions", "5,6"], "neither 1 nor 3"),
        (["--gap", "nan"], "seconds are above 0, not 'nan'"),
        (["--report", "x.pdf"], "--report x.pdf: its name ends in .html or .json"),
        (["--own-codes", "parity=3"], "no reason 'parity'; there are function, address"),
        (["--coil", "65530", "--no-coil", "1"], "--coil 65530 and --coils 10 go beyond address 65535"),
        (["--no-register", "1"], "--no-register 1 is one of those to write"),
    ],
)
def test_a_wrong_option_is_one_line(words, reason, capsys, monkeypatch):
    monkeypatch.setattr(cli.signal, "signal", lambda *_: None)
    try:
        code = cli.main(["grade", "nowhere", "--yes", *words])
    except SystemExit as end:
        code = end.code
    shown = capsys.readouterr().err
    assert code == 2 and reason in shown and shown.count("\n") == 1


class LatePort:
    """A slave that answers a request after `delay_s(request)`; None: never."""

    name = "port"

    def __init__(self, delay_s: Callable[[bytes], float | None], echo: bool = False):
        self.slave, self.delay_s, self.echo = Slave(PLAIN), delay_s, echo
        self.due: list[tuple[float, bytes]] = []

    def write(self, data: bytes) -> None:
        if (delay := self.delay_s(data)) is not None:
            reply = self.slave.reply(data) or rtu.build(17, rtu.read_registers(0, 1))
            self.due.append((time.monotonic() + delay, data if self.echo else reply))

    def read(self, seconds: float) -> bytes:
        until = time.monotonic() + seconds
        while True:
            now = time.monotonic()
            heard = b"".join(data for at, data in self.due if at <= now)
            self.due = [(at, data) for at, data in self.due if at > now]
            if heard or now >= until:
                return heard
            time.sleep(0.002)


class Noise:
    name = "port"

    def write(self, data: bytes) -> None: ...

    def read(self, seconds: float) -> bytes:
        return bytes(8)


@pytest.mark.parametrize(
    ("port", "said"),
    [
        (LatePort(lambda request: None), "unit 17 does not answer at 19200 8E1"),
        (
            LatePort(lambda request: 1.5 * SHORT_S),
            "unit 17 answers after the longest wait; it needs a longer one",
        ),
        (
            LatePort(lambda request: 0, echo=True),
            "the port hears its own requests; switch the echo of the adapter off",
        ),
        (Noise(), "port is never silent"),
    ],
)
def test_a_line_without_a_slave_that_can_be_graded_is_one_line(port, said):
    with pytest.raises((NoAnswer, PortError)) as error:
        grade(ByteDriver(Line(port, 19200, "8E1"), SHORT_S, 0.01), PLAIN)
    assert str(error.value) == said


def test_a_late_reply_fails_its_own_test_and_not_the_next_one():
    """Broadcasts are answered so late that the good request after them already has its reply."""
    wait_s = 4 * SHORT_S
    port = LatePort(lambda request: 1.5 * wait_s if request[0] == 0 else 0.0)
    profile, chosen = replace(PLAIN, functions=frozenset({3, 6})), ("SL-4", "SL-1", "AP-2")
    found = grade(
        ByteDriver(Line(port, 19200, "8E1"), wait_s, 0.01), profile, [BY_NUMBER[number] for number in chosen]
    )
    assert [verdict.outcome for verdict in found] == [FAIL, PASS, PASS]
    assert found[0].text.startswith("a reply after the longest wait: 11 03 00")


@pytest.mark.rule("FRAME-4", "EXC")
def test_the_card_on_its_pins_fails_nothing_that_is_quick():
    """One test of each kind: bytes, edges, parity, DE, and an own exception code."""
    chosen = [BY_NUMBER[number] for number in ("SL-1", "SL-12", "SL-18", "SL-24", "AP-5", "AP-11")]
    with CardDriver("standard") as driver:
        found = grade(driver, PROFILE, chosen)
    assert [verdict.outcome for verdict in found] == [PASS] * 4 + [OWN_CODE] * 2, found


@pytest.mark.nightly
def test_the_card_on_its_pins_fails_nothing(config):
    with CardDriver(config) as driver:
        found = grade(driver, PROFILE)
    assert {verdict.outcome for verdict in found} == {PASS, OWN_CODE, NONE}
    assert {verdict.number for verdict in found if verdict.outcome == OWN_CODE} == set(PROFILE.own_codes)
    # Nothing to try them on: its map is smaller than a longest request, or it has no function 2 and 4.
    none = {verdict.number for verdict in found if verdict.outcome == NONE}
    assert none == {"AP-23", "AP-24", "AP-28", "AP-33", "AP-34", "AP-35"}


def slow_example(name: str, **changed: object) -> Design:
    """The example with half its clock."""
    entry = designs()["holding_registers"].entry
    slow = {"clk_hz": 500_000, "parameters": entry["parameters"] | {"CLK_HZ": 500_000}}
    return Design(name, entry | slow | changed)


@pytest.mark.nightly
def test_the_slave_on_its_pins_fails_nothing():
    found = grade_design(slow_example("slow_example"))
    assert {verdict.outcome for verdict in found} == {PASS, NONE}
    graded = {verdict.number for verdict in found if verdict.outcome == PASS}
    assert {"SL-1", "SL-24", "AP-5"} <= graded and len(graded) > 40


@pytest.mark.nightly
def test_a_slave_with_an_unconnected_de_fails(tmp_path):
    text = (ROOT / "docs/example/holding_registers.v").read_text()
    assert ".de(de)" in text
    broken = tmp_path / "holding_registers.v"
    broken.write_text(text.replace(".de(de)", ".de()"))
    files = ["docs/example/modbus_slave.v", str(broken)]
    found = grade_design(slow_example("broken_example", files=files), ["SL-1", "SL-24", "AP-9"])
    assert {verdict.number: verdict.outcome for verdict in found} == {
        "SL-1": PASS,
        "SL-24": FAIL,
        "AP-9": NONE,
    }
