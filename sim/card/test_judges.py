# SPDX-License-Identifier: Apache-2.0
"""Independent tools must agree with the card's log.

tshark and sigrok-cli decode recordings, sigrok from the bits of the waveform. pymodbus and mbpoll, which
libmodbus speaks for, are masters of the virtual card.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from sim.card.example_run import EXAMPLES, ExampleRun, Recorded
from sim.card.masters import Pymodbus
from sim.card.run_card import ROOT, Frame, RunningCard
from sim.view import tshark
from sim.view.wireshark import SCRIPT, environment
from tb.agents import rtu
from tb.agents.crc16 import with_crc

pytestmark = pytest.mark.nightly("views")

BIT_S = 1 / 9600
DAMAGED = bytes.fromhex("01 01 00 00 00 10 3D C7")
PLAYED = ("ex1-start-40", "ex4-write-104", "ex5-read-514", "ex6b-text-533", "refused-17", "bad-address")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Recorded:
    """Recording with reads, writes, a text, two kinds of exception and a frame with a wrong CRC."""
    folder = tmp_path_factory.mktemp("judged")
    with ExampleRun(folder, wave=True) as run:
        played = tuple(run.play(name) for name in PLAYED)
        before = len(run.card.frames())
        run.master.write(DAMAGED)
        run.card.wait_for_frames(before, "modbus", "master")
        run.play("appA-fc01")
    return Recorded(played, tuple(run.card.frames()), run.pcap, run.card.log, run.wave)


@pytest.fixture(scope="module")
def network(recorded) -> list[Frame]:
    frames = [frame for frame in recorded.frames if frame.line == "modbus"]
    assert [frame.data for frame in frames if not frame.ok] == [DAMAGED]
    return frames


# ---------------------------------------------------------------- tshark
@pytest.mark.rule("FRAME-4")
@pytest.mark.parametrize("how", ["as shipped", "built-in dissector alone"])
def test_tshark_agrees_with_the_log(recorded, network, tmp_path, how):
    """With the shipped profile, and with the link type as the only setting."""
    if how == "as shipped":
        options, env = [*SCRIPT], environment(tmp_path)
    else:
        link_type = 'uat:user_dlts:"User 0 (DLT=147)","mbrtu","0","","0",""'
        options, env = ["-o", link_type, "-o", "mbrtu.crc_verification:TRUE"], None
    names = ("frame.time_epoch", "mbrtu.unit_id", "mbrtu.crc16.status", "modbus.func_code")
    seen = tshark.fields(
        recorded.pcap, *names, "modbus.exception_code", options=options, only="mbrtu", env=env
    )
    assert len(seen) == len(network)
    for got, frame in zip(seen, network, strict=True):
        assert float(got["frame.time_epoch"]) == pytest.approx(frame.start, abs=1e-9)
        assert int(got["mbrtu.unit_id"]) == frame.data[0]
        assert (got["mbrtu.crc16.status"] == "1") == frame.ok
        if frame.ok:
            code = frame.data[1]
            assert int(got["modbus.func_code"]) == code & 0x7F
            assert got["modbus.exception_code"] == (str(frame.data[2]) if code & rtu.EXCEPTION_BIT else "")


# ---------------------------------------------------------------- sigrok, from the bits of the waveform
@dataclass(frozen=True)
class Annotation:
    start_s: float
    end_s: float
    text: str


@pytest.fixture(scope="module")
def lines_vcd(recorded, tmp_path_factory) -> Path:
    vcd = tmp_path_factory.mktemp("vcd") / "lines.vcd"
    command = [sys.executable, "-m", "sim.view.lines_vcd", recorded.wave, vcd]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return vcd


def sigrok(vcd: Path, decoders: str, shown: str) -> list[Annotation]:
    """Annotations in order of time. One sample is a microsecond (sim/view/lines_vcd.py)."""
    command = ["sigrok-cli", "-I", "vcd", "-i", vcd, "-P", decoders, "-A", shown]
    done = subprocess.run(
        [*map(str, command), "--protocol-decoder-samplenum"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    rows = re.findall(r"^(\d+)-(\d+) [\w-]+: (.*)$", done.stdout, re.MULTILINE)
    assert rows, done.stdout
    return sorted(
        (Annotation(int(a) / 1e6, int(b) / 1e6, text) for a, b, text in rows), key=lambda x: x.start_s
    )


def within(annotations: list[Annotation], frame: Frame) -> list[Annotation]:
    return [a for a in annotations if frame.start - BIT_S <= a.start_s <= frame.end + BIT_S]


@pytest.mark.rule("LINE-1", "FC-1")
@pytest.mark.parametrize(("line", "parity"), [("modbus", "none"), ("drive", "even")])
def test_sigrok_uart_agrees_with_the_log(recorded, lines_vcd, line, parity):
    """Both directions on one wire: no parity error, no missing stop bit, no byte between the frames."""
    uart = f"uart:rx={line}:baudrate=9600:parity={parity}"
    heard = sigrok(lines_vcd, uart, "uart=rx-data")
    frames = [frame for frame in recorded.frames if frame.line == line]
    assert [bytes.fromhex("".join(a.text for a in within(heard, frame))) for frame in frames] == [
        frame.data for frame in frames
    ]
    assert len(heard) == sum(len(frame.data) for frame in frames)
    everything = sigrok(lines_vcd, uart, "uart")
    assert not [a for a in everything if "rror" in a.text or "reak" in a.text]


FUNCTIONS = {
    0x01: "Function 1: Read Coils",
    0x03: "Function 3: Read Holding Registers",
    0x05: "Function 5: Write Single Coil",
    0x06: "Function 6: Write Single Register",
    0x0F: "Function 15: Write Multiple Coils",
    0x10: "Function 16: Write Multiple Registers",
}


@pytest.mark.rule("FRAME-4")
def test_sigrok_modbus_agrees_with_the_log(network, lines_vcd):
    uart = "uart:rx=card_modbus:tx=master:baudrate=9600:parity=none"
    annotations = sigrok(lines_vcd, f"{uart},modbus:scchannel=RX:cschannel=TX", "modbus")
    for frame in network:
        texts = [a.text for a in within(annotations, frame)]
        code = frame.data[1]
        assert texts[0] == f"Slave ID: {frame.data[0]}"
        assert ("CRC correct" in texts) == frame.ok, (frame, texts)
        if not frame.ok:
            assert any(text.startswith("CRC should be") for text in texts)
        elif code & rtu.EXCEPTION_BIT:
            assert texts[1] == f"Error for f{FUNCTIONS[code & 0x7F][1:]}"
            assert any(text.startswith(f"Error {frame.data[2]}:") for text in texts)
        else:
            assert texts[1] == FUNCTIONS[code]
            assert not any("rror" in text or "too long" in text for text in texts), (frame, texts)


@pytest.fixture
def shell(recorded, tmp_path) -> Callable[[str], str]:
    """Runs a documented command in a plain shell without the tools of .venv; returns its output."""
    shutil.copy(recorded.wave, tmp_path / "card.fst")
    for name in (".venv", "regs", "rtl", "sim", "sw"):
        (tmp_path / name).symlink_to(ROOT / name)

    def run(command: str) -> str:
        done = subprocess.run(
            ["sh", "-c", command],
            cwd=tmp_path,
            env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def documented(section: str) -> list[str]:
    """Lines of the first code block in a section of docs/guide/recordings.md."""
    text = (ROOT / "docs/guide/recordings.md").read_text().split(f"## {section}\n")[1]
    return re.search(r"```\n(.*?)```", text, re.DOTALL)[1].splitlines()


def test_the_documented_commands_decode_both_lines(shell):
    to_vcd, on_network, on_drive = documented("sigrok")
    assert shell(to_vcd) == ""
    network, drive = shell(on_network), shell(on_drive)
    assert "Function 15: Write Multiple Coils" in network
    assert "Error for function 6: Write Single Register" in network
    read_514 = EXAMPLES["ex5-read-514"]["drive"][0]["telegram"]
    assert read_514 in " ".join(re.findall(r": ([0-9A-F]{2})$", drive, re.MULTILINE))


def test_the_documented_command_writes_the_views(shell, tmp_path):
    command, *viewers = documented("Waveforms")
    printed = shell(command)
    written = [re.findall(r"card\.(?:gtkw|sucl)", viewer)[0] for viewer in viewers]
    assert written == ["card.gtkw", "card.sucl"]
    assert all((tmp_path / name).stat().st_size > 1000 and name in printed for name in written)


def test_waveform_without_lines_is_refused_in_one_line(tmp_path):
    wave = tmp_path / "small.vcd"
    wave.write_text(
        "$timescale 1 ns $end\n$scope module x $end\n$var wire 1 ! clk $end\n$upscope $end\n"
        "$enddefinitions $end\n#0\n0!\n#5\n1!\n"
    )
    command = [sys.executable, "-m", "sim.view.lines_vcd", wave, tmp_path / "out.vcd"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "this is no waveform of a whole card" in done.stderr


def test_a_waveform_that_cannot_be_read_is_one_line(recorded, tmp_path):
    """The writer of a running card fills in the header at its end."""
    wave, words = tmp_path / "card.fst", "the waveform is unfinished: its program still runs or was killed"
    wave.write_bytes(bytes(329) + recorded.wave.read_bytes()[329:])
    for name, *more in (("lines_vcd", tmp_path / "lines.vcd"), ("waves",)):
        command = [sys.executable, "-m", f"sim.view.{name}", wave, *more]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (2, "", f"{name}: {words}\n")


# ---------------------------------------------------------------- independent masters
@dataclass(frozen=True)
class Operation:
    """One operation of a master: `values` for a write, `count` for a read; addresses as on the wire."""

    function: int
    address: int
    count: int = 0
    values: tuple[int, ...] = ()

    @property
    def reads(self) -> bool:
        return self.function in (rtu.READ_COILS, rtu.READ_REGISTERS)

    @property
    def of_coils(self) -> bool:
        return self.function in (rtu.READ_COILS, rtu.WRITE_COIL, rtu.WRITE_COILS)


def coils(*words: int) -> tuple[int, ...]:
    return tuple(word >> bit & 1 for word in words for bit in range(16))


START = coils(0x047C, 0x1999)
OPERATIONS = {
    "start by coils": Operation(0x0F, 0, values=START),
    "control image": Operation(0x01, 0, count=32),
    "status and frequency": Operation(0x01, 32, count=32),
    "one coil": Operation(0x05, 64, values=(1,)),
    "motor current": Operation(0x03, 5139, count=2),
    "motor frequency": Operation(0x06, 1039, values=(60,)),
    "time-outs": Operation(0x10, 1, values=(500, 20)),
    "time-outs back": Operation(0x03, 1, count=2),
    "exception 2": Operation(0x06, 2, values=(0,)),
    "exception 1 of the drive": Operation(0x10, 5139, values=(0, 5)),
    "exception 64": Operation(0x01, 128, count=1),
    "exception 66": Operation(0x03, 5139, count=11),
}
SPOKEN = {1: "Illegal function", 2: "Illegal data address", 3: "Illegal data value"}


def outcome_of(frame: Frame, asked: Operation) -> str:
    """Outcome according to the reply in the log."""
    code, body = frame.data[1], frame.data[2:-2]
    if code & rtu.EXCEPTION_BIT:
        return f"exception {body[0]}"
    if not asked.reads:
        return "done"
    if asked.of_coils:
        values = [body[1 + i // 8] >> i % 8 & 1 for i in range(asked.count)]
    else:
        values = [int.from_bytes(body[at : at + 2], "big") for at in range(1, len(body), 2)]
    return "values " + " ".join(map(str, values))


def by_pymodbus(link: Path, asked: Operation) -> str:
    from pymodbus.client import ModbusSerialClient

    client = ModbusSerialClient(str(link), baudrate=9600, parity="N", stopbits=2, timeout=5, retries=0)
    assert client.connect()
    try:
        match asked.function:
            case 0x01:
                answer = client.read_coils(asked.address, count=asked.count, device_id=1)
            case 0x03:
                answer = client.read_holding_registers(asked.address, count=asked.count, device_id=1)
            case 0x05:
                answer = client.write_coil(asked.address, bool(asked.values[0]), device_id=1)
            case 0x06:
                answer = client.write_register(asked.address, asked.values[0], device_id=1)
            case 0x0F:
                answer = client.write_coils(asked.address, [bool(v) for v in asked.values], device_id=1)
            case _:
                answer = client.write_registers(asked.address, list(asked.values), device_id=1)
    finally:
        client.close()
    if answer.isError():
        return f"exception {answer.exception_code}"
    if not asked.reads:
        return "done"
    values = [int(bit) for bit in answer.bits[: asked.count]] if asked.of_coils else answer.registers
    return "values " + " ".join(map(str, values))


def by_mbpoll(link: Path, asked: Operation) -> str:
    """mbpoll (through libmodbus) reports codes outside the standard only as invalid."""
    what = ["-t", "0" if asked.of_coils else "4", "-r", asked.address + 1, "-1"]
    what += ["-c", asked.count] if asked.reads else []
    # mbpoll uses 05 and 06 for a single value; -W selects 0F and 10.
    command = ["mbpoll", "-m", "rtu", "-a", 1, "-b", 9600, "-P", "none", "-s", 2, *what, link, *asked.values]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=30, check=False)
    said = done.stdout + done.stderr
    for code, words in SPOKEN.items():
        if words in said:
            return f"exception {code}"
    if "Invalid exception code" in said:
        return "exception ?"
    assert done.returncode == 0, said
    values = re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)
    return "values " + " ".join(values) if asked.reads else "done"


MASTERS: dict[str, Callable[[Path, Operation], str]] = {
    "pymodbus": by_pymodbus,
    "mbpoll": by_mbpoll,
}
EXPECTED = {
    "start by coils": "done",
    "control image": "values " + " ".join(map(str, START)),
    "status and frequency": "values " + " ".join(map(str, coils(0x0F03, 0x2000))),
    "one coil": "done",
    "motor current": "values 0 300",
    "motor frequency": "done",
    "time-outs": "done",
    "time-outs back": "values 500 20",
    "exception 2": "exception 2",
    "exception 1 of the drive": "exception 1",
    "exception 64": "exception 64",
    "exception 66": "exception 66",
}


@pytest.mark.rule("MAP-1", "MAP-2", "MAP-3", "MAP-5", "MAP-7", "EXC")
@pytest.mark.parametrize("master", MASTERS)
def test_masters_agree_with_the_log(tmp_path, master):
    """Every operation in this order: the master's answer, the log and the expected answer are equal."""
    with RunningCard(tmp_path, "--drive", "example", "--speed", "max", "--quiet") as card:
        for name, asked in OPERATIONS.items():
            before = len(card.frames())
            said = MASTERS[master](card.link, asked)
            frames = card.wait_for_frames(before, "modbus", "card")
            request, reply = (
                next(f for f in frames if f.line == "modbus" and f.sender == who)
                for who in ("master", "card")
            )
            assert request.data[1] == asked.function, name
            logged = outcome_of(reply, asked)
            assert logged == EXPECTED[name], name
            hidden = master != "pymodbus" and logged in ("exception 64", "exception 66")
            assert said == ("exception ?" if hidden else logged), name


@pytest.mark.rule("EXC")
def test_pymodbus_receives_the_exact_bytes(tmp_path):
    with RunningCard(tmp_path, "--drive", "example", "--speed", "max", "--quiet") as card:
        with Pymodbus(card.link) as master:
            for pdu, answer in (("07", "87 43"), ("01 00 80 00 01", "81 40")):
                got = master.send(1, bytes.fromhex(pdu))
                assert got == with_crc(bytes.fromhex("01" + answer))
        assert card.stop() == 0
        replies = [f for f in card.frames() if f.sender == "card" and f.line == "modbus"]
    assert [f.what.split(":")[1].strip() for f in replies] == ["exception 67", "exception 64"]
