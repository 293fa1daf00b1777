# SPDX-License-Identifier: Apache-2.0
"""The debugging guide: its recordings equal runs of the card, show what it says, and cover each symptom."""

from __future__ import annotations

import itertools
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from rtl.sources import ROOT
from sim.view import frames, tshark
from sim.view.wireshark import SCRIPT, environment
from tb.agents import rtu
from tb.lib.card import MS
from tools import symptoms
from tools.symptoms import COMMAND, GUIDE, RECORDINGS, SYMPTOMS, with_outputs

pytestmark = pytest.mark.nightly("views")

# Tolerance for changes of the firmware.
SAME_S = 0.002
SECTIONS = {
    "No answer": ["no-answer"],
    "CRC errors": ["crc-errors"],
    "Answers sometimes": ["answers-sometimes"],
    "Exception 255": ["exception-255"],
    "Drive does not start though written": ["no-start"],
    "Off by one register": ["off-by-one"],
    "USB adapter and t1.5": ["usb-adapter"],
    "LED states": ["led-states", "led-fault"],
}
CONTROL_BIT_10 = 0x0400


def without_bit_10(entry: dict) -> bool:
    is_telegram = (entry["line"], entry["from"]) == ("drive", "card")
    return is_telegram and not int.from_bytes(bytes.fromhex(entry["bytes"])[3:5], "big") & CONTROL_BIT_10


# Frames that the filter of a section must find in its recording, according to the log.
FOUND = {
    "No answer": lambda entry: not entry["ok"],
    "CRC errors": lambda entry: entry["what"] == "CRC wrong",
    "Answers sometimes": lambda entry: entry["what"].startswith("revoked"),
    "Exception 255": lambda entry: "exception 255" in entry["what"],
    "Drive does not start though written": without_bit_10,
    "Off by one register": lambda entry: "exception 64" in entry["what"],
    "USB adapter and t1.5": lambda entry: entry["what"].startswith("gap"),
}


def entries(name: str, folder: Path = RECORDINGS) -> list[dict]:
    return [json.loads(line) for line in (folder / f"{name}.jsonl").read_text().splitlines()]


def frames_of(name: str, line: str = "", sender: str = "") -> list[dict]:
    found = [entry for entry in entries(name) if "line" in entry]
    return [e for e in found if (not line or e["line"] == line) and (not sender or e["from"] == sender)]


def leds_of(name: str, led: str) -> list[tuple[float, str]]:
    return [(entry["t"], entry["shows"]) for entry in entries(name) if entry.get("led") == led]


def said(name: str, line: str, sender: str) -> list[str]:
    return [entry["what"] for entry in frames_of(name, line, sender)]


def sections() -> dict[str, str]:
    parts = re.split(r"^## (.*)$", GUIDE.read_text(), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def words(entry: dict) -> dict:
    return {key: value for key, value in entry.items() if key not in ("t", "end")}


def difference(before: list[dict], now: list[dict]) -> str | None:
    """First entry that differs in content or time. LEDs and lines are compared separately."""

    def streams(of: list[dict]) -> dict[str, list[dict]]:
        entries: dict[str, list[dict]] = {}
        for entry in of:
            entries.setdefault(entry.get("line") or f"{entry['led']} LED", []).append(entry)
        return entries

    was, is_now = streams(before), streams(now)
    for name in sorted({*was, *is_now}):
        a, b = was.get(name, []), is_now.get(name, [])
        for old, new in zip(a, b, strict=False):
            if words(old) != words(new) or abs(old["t"] - new["t"]) > SAME_S:
                return f"{name}: {old} is now {new}"
        if len(a) != len(b):
            return f"{name}: {len(a)} entries, now {len(b)}"
    return None


# ---------------------------------------------------------------- the recordings are runs of the card


@pytest.mark.parametrize("name", SYMPTOMS)
def test_recording_equals_its_run(name, tmp_path):
    symptoms.make(name, tmp_path)
    wrong = difference(entries(name), entries(name, tmp_path))
    assert wrong is None, f"docs/recordings/{name}.jsonl: {wrong}; run `make symptoms`"


@pytest.mark.parametrize("name", SYMPTOMS)
def test_log_and_capture_are_of_one_run(name):
    packets = tshark.fields(
        RECORDINGS / f"{name}.pcapng", "frame.time_epoch", "frame.interface_name", "frame.comment"
    )
    recorded = frames_of(name)
    assert len(packets) == len(recorded)
    for packet, entry in zip(packets, recorded, strict=True):
        assert float(packet["frame.time_epoch"]) == pytest.approx(entry["t"], abs=1e-9)
        assert packet["frame.interface_name"] == entry["line"]
        assert packet["frame.comment"] == ("" if entry["ok"] else "bad frame: ") + entry["what"]


def test_folder_holds_these_recordings_and_they_are_small():
    files = sorted(RECORDINGS.iterdir())
    assert [file.name for file in files] == sorted(
        f"{name}{kind}" for name in SYMPTOMS for kind in (".jsonl", ".pcapng")
    )
    assert sum(file.stat().st_size for file in files) < 100_000


def test_the_same_run_gives_the_same_files_with_any_seed(monkeypatch, tmp_path):
    for folder, seed in (("one", "1"), ("two", "2")):
        monkeypatch.setenv("COCOTB_RANDOM_SEED", seed)
        symptoms.make("crc-errors", tmp_path / folder)
    for kind in (".jsonl", ".pcapng"):
        one, two = ((tmp_path / folder / f"crc-errors{kind}").read_bytes() for folder in ("one", "two"))
        assert one == two


def test_difference_is_described():
    recorded = entries("no-start")
    late = [entry | {"t": entry["t"] + 2 * SAME_S} if "led" in entry else entry for entry in recorded]
    other = [entry | {"bytes": "00"} if entry.get("from") == "drive" else entry for entry in recorded]
    assert difference(recorded, recorded) is None
    assert all(difference(recorded, wrong) for wrong in (late, other, recorded[:-1]))


# ---------------------------------------------------------------- the guide


def test_every_symptom_has_a_section_that_names_its_recording():
    guide = sections()
    assert [title for title in guide if title in SECTIONS] == list(SECTIONS)
    assert [name for names in SECTIONS.values() for name in names] == list(SYMPTOMS)
    for title, names in SECTIONS.items():
        shown = re.findall(
            r"^\$ \.venv/bin/python -m sim\.view\.frames docs/recordings/([\w-]+)\.jsonl",
            guide[title],
            re.MULTILINE,
        )
        assert shown == names, title
        assert re.search(r"^(1\. |\| \w.* \| \w.* \|)", guide[title], re.MULTILINE), f"{title}: no causes"


def test_outputs_in_the_guide_equal_the_commands():
    guide = GUIDE.read_text()
    replays = 1  # of a recorded bus
    assert len(COMMAND.findall(guide)) == len(SYMPTOMS) + replays == guide.count("\n$ ")
    assert with_outputs(guide) == guide, "docs/guide/debugging.md shows old outputs; run `make symptoms`"


def test_filters_of_the_guide_find_exactly_the_fault():
    assert list(FOUND) == [title for title in SECTIONS if title != "LED states"]
    for title, wrong in FOUND.items():
        (row,) = re.findall(r"^Filter: (.*)$", sections()[title], re.MULTILINE)
        only = re.findall(r"`([^`]+)`", row)[0]
        (name,) = SECTIONS[title]
        capture = RECORDINGS / f"{name}.pcapng"
        found = tshark.fields(capture, "frame.number", only=only, options=["-2", *SCRIPT], env=environment())
        due = [str(number) for number, entry in enumerate(frames_of(name), 1) if wrong(entry)]
        assert [packet["frame.number"] for packet in found] == due != [], title


def test_links_of_the_guide_exist():
    guide = GUIDE.read_text()
    for file, anchor in re.findall(r"\]\(([\w.]*)#?([\w-]*)\)", guide):
        text = (GUIDE.parent / file).read_text() if file else guide
        titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
        anchors = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}
        assert not anchor or anchor in anchors, f"{file}#{anchor}"


# ---------------------------------------------------------------- contents of the recordings


@pytest.mark.rule("FRAME-4", "FRAME-5", "MAP-9")
def test_no_answer_and_why():
    asked = frames_of("no-answer", "modbus", "master")
    assert [entry["ok"] for entry in asked] == [True, False, False, True, True]
    assert asked[0]["what"].startswith("unit 2: ") and asked[3]["what"].startswith("to all: ")
    assert "in byte 1" in asked[1]["what"] and "in byte 1" in asked[2]["what"]
    (reply,) = frames_of("no-answer", "modbus", "card")
    assert reply["t"] > asked[-1]["end"]


@pytest.mark.rule("FRAME-4")
def test_crc_errors_by_order_by_two_bits_and_by_one():
    asked = frames_of("crc-errors", "modbus", "master")
    assert [entry["what"] for entry in asked[:3]] == ["CRC wrong", "CRC wrong", "parity wrong in byte 3"]
    sent, right = (bytes.fromhex(entry["bytes"]) for entry in (asked[0], asked[3]))
    assert sent[:-2] == right[:-2] and sent[-2:] == right[:-3:-1] != right[-2:]
    assert len(frames_of("crc-errors", "modbus", "card")) == 1


@pytest.mark.rule("FRAME-1", "FRAME-3")
def test_answers_sometimes_and_the_pause_that_is_missing():
    bus = frames_of("answers-sometimes", "modbus")
    pauses = [now["t"] - before["end"] for before, now in itertools.pairwise(bus)]
    early = next(
        i for i, entry in enumerate(bus) if entry["from"] == "master" and i and bus[i - 1]["from"] == "card"
    )
    two_characters = 2 * rtu.character_ps(9600) / (1000 * MS)
    assert pauses[early - 1] == pytest.approx(two_characters, abs=1e-5) and bus[early]["ok"]
    assert bus[early + 1]["from"] == "master"
    revoked = [entry for entry in bus if entry["what"].startswith("revoked: good after")]
    assert [bytes.fromhex(entry["bytes"])[0] for entry in revoked] == [2, 1]
    assert all("but 2.00 characters later" in entry["what"] for entry in revoked)
    assert said("answers-sometimes", "modbus", "card") == ["unit 1: coils 1-32 = 0000h 0000h"] * 3


@pytest.mark.rule("FC-9", "LED-4")
def test_exception_255_after_two_telegrams_each():
    replies = frames_of("exception-255", "modbus", "card")
    assert [bytes.fromhex(entry["bytes"])[1:3] for entry in replies[:2]] == [b"\x83\xff"] * 2
    assert replies[2]["what"].endswith("= 300 (3.00 A)")
    assert len(frames_of("exception-255", "drive", "card")) == 2 + 2 + 1
    answers = frames_of("exception-255", "drive", "drive")
    assert [entry["what"] for entry in answers[:2]] == ["BCC wrong"] * 2 and answers[2]["ok"]
    asked = frames_of("exception-255", "modbus", "master")[0]
    assert replies[0]["t"] - asked["end"] == pytest.approx(0.35, abs=0.05)
    drive = leds_of("exception-255", "drive")
    assert [shows for _, shows in drive[-2:]] == ["red-flash", "green-flash"]
    assert drive[-1][0] > replies[2]["t"]
    packets = tshark.fields(
        RECORDINGS / "exception-255.pcapng",
        "modbus.exception_code",
        options=["-2", *SCRIPT],
        env=environment(),
    )
    assert [packet["modbus.exception_code"] for packet in packets].count("255") == 2


@pytest.mark.rule("FC-5", "MAP-3")
def test_the_drive_does_not_start_without_bit_10():
    telegrams = [bytes.fromhex(entry["bytes"]) for entry in frames_of("no-start", "drive", "card")]
    answers = [bytes.fromhex(entry["bytes"]) for entry in frames_of("no-start", "drive", "drive")]
    controls = [int.from_bytes(telegram[3:5], "big") for telegram in telegrams]
    assert [bool(control & CONTROL_BIT_10) for control in controls] == [False, True, True]
    assert controls[0] == 0x0040
    frequencies = [int.from_bytes(answer[5:7], "big") for answer in answers]
    assert frequencies[:2] == [0, 0] and frequencies[2] > 0x0400
    assert said("no-start", "modbus", "card")[0].endswith("write done")
    packets = tshark.fields(
        RECORDINGS / "no-start.pcapng",
        "vltfc.ctw.valid",
        only='frame.interface_name == "drive" && vltfc.ctw.valid',
        options=["-2", *SCRIPT],
        env=environment(),
    )
    assert [packet["vltfc.ctw.valid"] for packet in packets] == ["0", "1", "1"]


@pytest.mark.rule("MAP-3", "MAP-6")
def test_off_by_one_is_exception_64_or_a_control_word_moved_by_a_bit():
    asked = [bytes.fromhex(entry["bytes"]) for entry in frames_of("off-by-one", "modbus", "master")]
    assert [int.from_bytes(request[2:4], "big") for request in asked] == [5140, 5139, 1, 0]
    replies = said("off-by-one", "modbus", "card")
    assert "exception 64" in replies[0] and replies[1].endswith("= 300 (3.00 A)")
    controls = [bytes.fromhex(e["bytes"])[3:5].hex() for e in frames_of("off-by-one", "drive", "card")[1:]]
    assert controls == ["08f8", "047c"]


@pytest.mark.rule("FRAME-2")
def test_a_hole_of_half_a_millisecond_is_allowed_one_of_a_millisecond_is_not():
    bus = frames_of("usb-adapter", "modbus")
    assert [entry["from"] for entry in bus] == ["master", "card", *["master"] * 5, "card"]
    cut, rest, begin, end = bus[2:6]
    assert cut["what"] == "gap: not complete after 8 bytes, then 1.75 characters of silence"
    assert rest["t"] - cut["end"] == pytest.approx(0.001, abs=2e-6)
    assert end["t"] - begin["end"] == pytest.approx(0.016, abs=2e-6)
    assert len(frames_of("usb-adapter", "drive", "card")) == 2


@pytest.mark.rule("LED-1", "LED-2", "LED-3", "LED-4")
def test_leds_follow_master_and_drive():
    shown = {led: [shows for _, shows in leds_of("led-states", led)] for led in ("modbus", "drive")}
    show = ["off", "red", "green", "orange", "off"]
    assert shown["drive"] == [*show, "red-flash", "green-flash", "red-flash"]
    assert shown["modbus"] == [*show, *["red-flash", "green-flash"] * 3, "red-flash"]
    on, off = (leds_of("led-states", "modbus")[i][0] for i in (6, 7))
    assert off - on == pytest.approx(1.0, abs=0.02)


@pytest.mark.rule("LED-5", "LINE-7")
def test_an_invalid_address_is_both_leds_red_and_silence():
    assert [leds_of("led-fault", led)[1:] for led in ("modbus", "drive")] == [
        [(pytest.approx(0.001, abs=0.001), "red")]
    ] * 2
    assert [entry["from"] for entry in frames_of("led-fault")] == ["master"]


# ---------------------------------------------------------------- the commands


def test_table_of_a_log():
    recorded = entries("crc-errors")
    rows = list(frames.table(recorded))
    assert len(rows) == 1 + len(recorded)
    assert len(list(frames.table(recorded, frames_only=True))) == 1 + len(frames_of("crc-errors"))
    bad = list(frames.table(recorded, bad_only=True))
    assert len(bad) == 1 + 3 and all(" BAD " in row for row in bad[1:])
    assert bad[2].split()[1] == "60.00"  # silence since the previous frame, even if that is not shown
    assert len(list(frames.table(recorded, frames_only=True, with_bytes=True))) == 1 + 2 * len(
        frames_of("crc-errors")
    )


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["-m", "tools.symptoms", "no-anser"], "'no-anser'"),
        (["-m", "sim.view.frames", "docs/recordings/nothing.jsonl"], "No such file"),
        (["-m", "sim.view.frames", "docs/recordings/no-start.pcapng"], "no log"),
        (["-m", "sim.view.frames", "tb/model/examples.json"], "no log"),
    ],
)
def test_wrong_name_gives_one_line_and_exit_2(words, says):
    run = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert run.stdout == "" and run.stderr.count("\n") == 1 and says in run.stderr
