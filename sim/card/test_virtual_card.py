# SPDX-License-Identifier: Apache-2.0
"""The virtual card build/card as users see it: a process with serial lines, a log and files."""

from __future__ import annotations

import os
import re
import select
import shutil
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path
from resource import RLIMIT_FSIZE, setrlimit

import pytest

from regs.dialects import FLAGS, STANDARD
from rtl.sources import ROOT
from sim.card.demo import manual_examples, spaced
from sim.card.run_card import CARD, Frame, Port, RunningCard
from tb.agents.crc16 import with_crc
from tb.lib.nightly import first
from tb.lib.rows import each_row
from tb.model.card import DIALECTS, VERSION
from tb.model.examples import EXAMPLES
from tb.model.vlt_drive import PROFILES

MANUAL = list(manual_examples())
OPTIONS = [
    *("--modbus", "--drive", "--modbus-device", "--drive-device", "--sw-baud", "--sw-addr"),
    *("--dialect", "--profile", "--speed", "--wave", "--pcap", "--log", "--quiet", "--control", "--for"),
    *(image.flag for image in FLAGS),
]
READ_CONTROL = with_crc(bytes.fromhex("01 01 00 00 00 20"))
CHARACTER_S = 11 / 9600
T35_S = 3.5 * CHARACTER_S
BIT_S = 1 / 9600


def request_of(name: str) -> bytes:
    return bytes.fromhex(EXAMPLES[name]["request"])


def reply_of(name: str) -> bytes:
    return bytes.fromhex(EXAMPLES[name]["reply"])


def telegrams_of(*names: str) -> list[bytes]:
    return [bytes.fromhex(d["telegram"]) for name in names for d in EXAMPLES[name]["drive"]]


def drive_replies_of(*names: str) -> dict[bytes, bytes]:
    """Maps telegram to reply, for examples with a reply."""
    pairs = [(d["telegram"], d["reply"]) for name in names for d in EXAMPLES[name]["drive"]]
    return {bytes.fromhex(telegram): bytes.fromhex(reply) for telegram, reply in pairs if reply}


class RawPort(Port):
    def ask(self, request: bytes, reply_bytes: int) -> bytes:
        self.write(request)
        return self.read(reply_bytes)

    def example(self, name: str) -> None:
        """Sends an example's request and checks its reply byte for byte."""
        assert self.ask(request_of(name), len(reply_of(name))) == reply_of(name), name


def of(frames: list[Frame], line: str, sender: str) -> list[Frame]:
    return [f for f in frames if (f.line, f.sender) == (line, sender)]


def run_card(*options: object, seconds: float = 30) -> subprocess.CompletedProcess:
    """Runs build/card to its end, for command lines that end it."""
    command = [CARD, *map(str, options)]
    return subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)


# ---------------------------------------------------------------- command line
@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--bogus"], "--bogus"),
        (["--modbus"], "--modbus needs a value"),
        (["--sw-baud", "11111000x"], "--sw-baud takes 9 digits"),
        (["--dialect", "klingon"], f" or {list(DIALECTS)[-1]}, not 'klingon'"),
        (["--for", "soon"], "--for"),
        (["--drive", "example", "--drive-device", "b"], "exclude"),
        (["--dialect", STANDARD, "--master-loss-stop"], f"no image for the dialect {STANDARD}"),
        (["--status-refresh", "--no-status-refresh"], "exclude each other"),
        (["--modbus-device", "/dev/null"], "/dev/null is not a serial port"),
        (["--modbus", "/no/such/folder/link"], "/no/such/folder/link"),
        (["--wave", "/no/such/folder/wave"], "/no/such/folder/wave"),
        (["--log", "both", "--pcap", "./both"], "need different files, not twice './both'"),
    ],
)
def test_wrong_options_are_one_line_and_exit_2(options, says):
    run = run_card(*options)
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert says in run.stderr


@pytest.mark.parametrize("disk", first([("--log", 0), ("--log", 400), ("--wave", 0)]))
def test_full_disk_is_reported(tmp_path, disk):
    """At the first byte, or after the disk has taken a part."""
    option, room = disk
    file = Path("/dev/full") if room == 0 else tmp_path / "recording"
    command = [CARD, option, file, "--for", "2.5", "--speed", "max", "--quiet"]
    run = subprocess.run(
        list(map(str, command)),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        restore_signals=False,  # SIGXFSZ stays ignored
        preexec_fn=(lambda: setrlimit(RLIMIT_FSIZE, (room, room))) if room else None,
    )
    assert run.returncode == 2
    assert run.stderr.startswith(f"card: cannot write {file}: ") and run.stderr.count("\n") == 1


def test_help_names_every_option_and_drive():
    run = run_card("--help")
    assert run.returncode == 0
    for option in OPTIONS:
        assert f"{option} " in run.stdout
    for name in (*PROFILES, *DIALECTS):
        assert re.search(rf"\b{name}\b", run.stdout)
    assert re.fullmatch(
        rf"rtu2fc {re.escape(VERSION)}, virtual card of \d+ Hz\n", run_card("--version").stdout
    )


def test_a_busy_link_path_stays_as_it_is(tmp_path):
    """A file, and a link to nowhere. A line that fails leaves no link of the other one."""
    link, other = tmp_path / "link", tmp_path / "other"
    link.write_text("mine")
    other.symlink_to(tmp_path / "nowhere")
    for options in (("--modbus", link), ("--modbus", tmp_path / "modbus", "--drive", other)):
        run = run_card(*options)
        assert run.returncode == 2 and run.stderr.count("\n") == 1
        assert str(options[-1]) in run.stderr
    assert sorted(tmp_path.iterdir()) == [link, other] and link.read_text() == "mine"


IMAGE_OF = {
    ("card",): "",
    ("card", "--status-refresh"): "refresh/",
    ("card", "--no-status-refresh"): "",
    ("card", "--master-loss-stop"): "stop/",
    ("builtin",): "builtin/",
    ("builtin", "--status-refresh"): "builtin/",
    ("builtin", "--no-status-refresh"): "norefresh/builtin/",
    ("builtin", "--master-loss-stop"): "stop/builtin/",
    (STANDARD,): f"{STANDARD}/",
    (STANDARD, "--no-status-refresh"): f"norefresh/{STANDARD}/",
}


def test_options_choose_the_image_and_a_missing_one_is_reported_with_its_path(tmp_path):
    """The images lie beside the program: a program moved away from them finds none."""
    lonely = shutil.copy(CARD, tmp_path / "card")
    for options, folder in IMAGE_OF.items():
        command = [lonely, "--dialect", *options]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 2 and run.stderr.count("\n") == 1
        assert f"{tmp_path}/{folder}firmware.hex" in run.stderr


# ---------------------------------------------------------------- start and end
@pytest.mark.parametrize("how", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.nightly)])
def test_signal_ends_the_card_cleanly(tmp_path, how):
    drive_link = tmp_path / "drive"
    with RunningCard(tmp_path, "--drive", str(drive_link)) as card:
        assert card.ready_line == f"ready modbus={card.link} drive={drive_link}"
        assert os.readlink(card.link).startswith("/dev/pts/")
        assert card.stop(how) == 0
    assert not card.link.is_symlink() and not drive_link.is_symlink()


@pytest.mark.nightly
def test_for_ends_the_card_and_ready_names_the_pty():
    began = time.monotonic()
    run = run_card("--for", "1.0", "--quiet")
    assert run.returncode == 0
    assert re.fullmatch(r"ready modbus=/dev/pts/\d+ drive=sim\n", run.stdout)
    # The boot, kStartSeconds of sim/card/main.cpp, runs as fast as it can.
    assert time.monotonic() - began > 0.65


def test_a_card_takes_a_dead_card_s_link_and_removes_only_its_own(tmp_path):
    with RunningCard(tmp_path) as card:
        card.stop(signal.SIGKILL)
        assert card.link.is_symlink()
    with RunningCard(tmp_path) as card:
        with RawPort(card.link) as master:
            assert len(master.ask(READ_CONTROL, 9)) == 9
        card.link.unlink()
        card.link.write_text("someone else's")
        assert card.stop() == 0
    assert card.link.read_text() == "someone else's"


# ---------------------------------------------------------------- time
def test_a_foreign_drive_has_wall_time_to_answer_at_full_speed(tmp_path):
    """40 ms of thinking are 40 ms for the card too, not 150 ms; the card sends no repeat."""
    link = tmp_path / "drive"
    with RunningCard(tmp_path, "--speed", "max", "--drive", str(link)) as card:
        with RawPort(link) as drive, RawPort(card.link) as master:
            master.write(request_of("ex5-read-514"))
            (telegram,) = telegrams_of("ex5-read-514")
            assert drive.read(len(telegram)) == telegram
            time.sleep(0.04)
            drive.write(drive_replies_of("ex5-read-514")[telegram])
            assert master.read(9) == reply_of("ex5-read-514")
        assert card.stop() == 0
        assert len(of(card.frames(), "drive", "card")) == 1


# ---------------------------------------------------------------- the simulated drive
@each_row(("profile", "reply"), [("vlt6000", "01 83 00"), ("vlt8000", "01 03 02 00 64")])
def test_the_profile_chooses_the_drive(tmp_path, profile: str, reply: str):
    """Parameter 640, which the VLT 6000 has not."""
    expected = with_crc(bytes.fromhex(reply))
    with RunningCard(tmp_path, "--profile", profile, "--speed", "max") as card, RawPort(card.link) as master:
        assert master.ask(with_crc(bytes.fromhex("01 03 18 FF 00 01")), len(expected)) == expected


# ---------------------------------------------------------------- the switches
@pytest.mark.rule("LINE-7")
def test_the_address_switches_choose_the_unit(tmp_path):
    read_of_unit_5 = with_crc(bytes.fromhex("05 01 00 00 00 10"))
    with RunningCard(tmp_path, "--sw-addr", "10100000") as card, RawPort(card.link) as master:
        master.write(READ_CONTROL)
        assert master.read(1, 0.3) == b""
        assert master.ask(read_of_unit_5, 7) == with_crc(bytes.fromhex("05 01 02 00 00"))


@pytest.mark.nightly
@pytest.mark.rule("LINE-7", "LED-5")
def test_invalid_address_warns_and_the_card_stays_silent(tmp_path):
    with RunningCard(tmp_path, "--sw-addr", "00000000", "--for", "1.5") as card:
        with RawPort(card.link) as master:
            assert any("warning" in line and "silent" in line for line in card.output)
            master.write(READ_CONTROL)
            assert master.read(1, 0.3) == b""
        assert card.wait() == 0
        shown = [(e["led"], e["shows"]) for e in card.entries() if e.get("led") and e["shows"] != "off"]
    assert sorted(shown) == [("drive", "red"), ("modbus", "red")], "solid red, and nothing else"


# ---------------------------------------------------------------- the lines
@pytest.mark.rule("FRAME-8", "LINE-2", "LINE-3")
@pytest.mark.parametrize("line", first(["101010000 19200 11", "110100000 9600 11", "000010000 300 11"], 2))
def test_bytes_written_together_have_no_gaps(tmp_path, line):
    check_times(tmp_path, line, CARD)


@pytest.mark.nightly
@pytest.mark.rule("FRAME-1", "LINE-2", "LINE-3")
def test_a_card_with_extended_switches_is_a_build_of_its_own(tmp_path):
    folder = ROOT / "build/extended"
    folder.mkdir(exist_ok=True)
    shutil.copyfile(ROOT / "build/firmware.hex", folder / "firmware.hex")
    command = [
        "make",
        "-s",
        "-o",
        "setup-demo",
        "card",
        "EXTENDED_SWITCHES=1",
        f"CARD_FOLDER={folder.relative_to(ROOT)}",
    ]
    subprocess.run(command, cwd=ROOT, check=True)
    for line in ("100100000 38400 10", "101100000 19200 10", "101110000 19200 11"):
        check_times(tmp_path, line, folder / "card")


def check_times(tmp_path: Path, line: str, program: Path) -> None:
    """Switches, the rate in bit/s, and bits of a character, in a line."""
    switches, baud, bits = line.split()[0], *map(int, line.split()[1:])
    with (
        RunningCard(tmp_path, "--sw-baud", switches, "--speed", "max", program=program) as card,
        RawPort(card.link) as master,
    ):
        master.ask(READ_CONTROL, 9)
        frames = card.wait_for_frames(0, "modbus", "card")
    (request,), (reply,) = of(frames, "modbus", "master"), of(frames, "modbus", "card")
    for frame in (request, reply):
        assert frame.ok
        assert frame.end - frame.start == pytest.approx(len(frame.data) * bits / baud, abs=0.5 / baud)
    t35 = 1750e-6 if baud > 19200 else 3.5 * bits / baud
    assert t35 - 0.25 / baud <= reply.start - request.end <= t35 + 1.5 / baud


def test_pieces_of_one_frame_close_gaps_and_a_new_frame_waits(tmp_path):
    """Three writes of one frame arrive as one frame; the next frame keeps its distance from the reply."""
    with RunningCard(tmp_path) as card, RawPort(card.link) as master:
        for piece in (READ_CONTROL[:1], READ_CONTROL[1:4], READ_CONTROL[4:]):
            master.write(piece)
        assert len(master.read(9)) == 9
        master.write(READ_CONTROL)
        assert len(master.read(9)) == 9
        frames = card.wait_for_frames(3, "modbus", "card") and card.frames()
    first, reply, second, _ = frames
    assert first.end - first.start == pytest.approx(8 * CHARACTER_S, abs=BIT_S)
    assert second.start - reply.end > T35_S


@pytest.mark.parametrize("leaves", first(["with the reply unread", "before the reply"]))
def test_later_master_gets_no_stale_bytes(tmp_path, leaves):
    with RunningCard(tmp_path) as card:
        with RawPort(card.link) as master:
            master.write(READ_CONTROL)
            if leaves == "with the reply unread":
                assert select.select([master.fd], [], [], 5)[0]
                time.sleep(0.1)
        assert of(card.wait_for_frames(0, "modbus", "card"), "modbus", "card")
        time.sleep(0.1)  # the card has seen that the port was closed
        with RawPort(card.link) as master:
            assert master.read(1, 0.1) == b""
            assert len(master.ask(READ_CONTROL, 9)) == 9


@pytest.mark.rule("LINE-1")
def test_serial_port_is_set_up_and_restored(tmp_path):
    """A pty stands in for the serial port."""
    ours, port = os.openpty()
    name = os.ttyname(port)
    before = termios.tcgetattr(port)
    log = tmp_path / "log"
    command = [CARD, "--modbus-device", name, "--sw-baud", "101010000", "--log", log, "--quiet"]
    card = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert card.stdout.readline() == f"ready modbus={name} drive=sim\n"
    assert termios.tcgetattr(port)[4:6] == [termios.B19200, termios.B19200]
    with os.fdopen(ours, "r+b", buffering=0) as master:
        for piece in (READ_CONTROL[:3], READ_CONTROL[3:]):  # a USB adapter splits a frame
            master.write(piece)
            time.sleep(0.005)
        reply = b""
        while len(reply) < 9 and select.select([master], [], [], 5)[0]:
            reply += master.read(9)
        assert reply == with_crc(bytes.fromhex("01 01 04 00 00 00 00"))
        busy = run_card("--modbus-device", name)
        assert busy.returncode == 2
        assert "in use" in busy.stderr
        card.send_signal(signal.SIGINT)
        assert card.wait(30) == 0
        assert termios.tcgetattr(port)[:6] == before[:6]
    os.close(port)


# A pty carries no parity bit and eight data bits only, whatever it is asked for.
SHOW_SETTINGS = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
int tcsetattr(int fd, int when, const struct termios *asked) {
  FILE *file = fopen(getenv("SETTINGS"), "a");
  fprintf(file, "%u\\n", asked->c_cflag);
  fclose(file);
  return ((int (*)(int, int, const struct termios *))dlsym(RTLD_NEXT, "tcsetattr"))(fd, when, asked);
}
"""
PARITIES = {"N": 0, "E": termios.PARENB, "O": termios.PARENB | termios.PARODD}
FORMAT_BITS = termios.CSIZE | termios.PARENB | termios.PARODD | termios.CSTOPB


@pytest.fixture(scope="module")
def show_settings(tmp_path_factory) -> Path:
    """A library that notes what a program asks of a serial port."""
    folder = tmp_path_factory.mktemp("settings")
    (folder / "show.c").write_text(SHOW_SETTINGS)
    command = ["gcc", "-shared", "-fPIC", "-o", folder / "show.so", folder / "show.c"]
    subprocess.run(command, check=True)
    return folder / "show.so"


@pytest.mark.rule("LINE-1", "LINE-3")
@pytest.mark.parametrize(
    ("switches", "form"),
    [("111100000", "8N2"), ("111110000", "8N2"), ("111000000", "8E1"), ("111010000", "8O1")],
)
def test_serial_port_is_asked_for_the_format_of_the_switches(tmp_path, show_settings, switches, form):
    ours, port = os.openpty()
    seen = tmp_path / "seen"
    done = subprocess.run(
        [CARD, "--modbus-device", os.ttyname(port), "--sw-baud", switches, "--for", "0.1", "--quiet"],
        env=os.environ | {"LD_PRELOAD": str(show_settings), "SETTINGS": str(seen)},
        stdout=subprocess.DEVNULL,
        check=False,
    )
    os.close(ours)
    os.close(port)
    assert done.returncode == 0
    asked = int(seen.read_text().split()[0])
    stop = termios.CSTOPB if form[2] == "2" else 0
    assert asked & FORMAT_BITS == termios.CS8 | PARITIES[form[1]] | stop


# ---------------------------------------------------------------- log, pcap, wave
def test_log_is_complete_and_described(tmp_path):
    with RunningCard(tmp_path, "--drive", "example") as card, RawPort(card.link) as master:
        assert card.ready_line.endswith(" drive=example")
        master.example("ex5-read-514")
        assert card.stop() == 0
        entries = [e for e in card.entries() if "line" in e]
    assert [(e["line"], e["from"]) for e in entries] == [
        ("modbus", "master"),
        ("drive", "card"),
        ("drive", "drive"),
        ("modbus", "card"),
    ]
    assert [bytes.fromhex(e["bytes"]) for e in entries] == [
        request_of("ex5-read-514"),
        *telegrams_of("ex5-read-514"),
        *drive_replies_of("ex5-read-514").values(),
        reply_of("ex5-read-514"),
    ]
    assert all(e["ok"] is True for e in entries)
    assert all("parameter 514" in e["what"] for e in entries)
    assert "read" in entries[0]["what"]
    assert "300 (3.00 A)" in entries[3]["what"]
    times = [t for e in entries for t in (e["t"], e["end"])]
    assert times == sorted(times)
    assert all(re.search(r'"t":\d+\.\d{6},', line) for line in card.log.read_text().splitlines())


# ---------------------------------------------------------------- make demo
def test_the_demo_passes_and_counts():
    run = subprocess.run(
        [sys.executable, "-m", "sim.card.demo"], capture_output=True, text=True, timeout=120, check=False
    )
    ends = re.findall(r"^  drive then +(.*)$", run.stdout, re.MULTILINE)
    stopped = "stopped, output frequency 0.0 %"
    assert ends == ["running, on reference, output frequency 40.0 %", stopped, stopped]
    assert run.stdout.splitlines()[-1] == "9 passed, 0 failed", run.stdout + run.stderr
    assert run.returncode == 0
    for name in MANUAL:
        assert spaced(request_of(name)) in run.stdout
        assert spaced(reply_of(name)) in run.stdout
    assert max(map(len, run.stdout.splitlines())) <= 100
