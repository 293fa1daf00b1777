# SPDX-License-Identifier: Apache-2.0
"""Commands to the running virtual card (--control) and their effects on lines, drive and card."""

from __future__ import annotations

import pytest

from sim.card.run_card import Frame, RunningCard
from sim.card.test_virtual_card import READ_CONTROL, RawPort, of, request_of
from tb.agents.crc16 import with_crc

READ_514 = request_of("ex5-read-514")
REPLY_514_BYTES = 9
CONTROL_BYTES = 9
SILENCE_S = 0.4  # wall time
TRIPPED = 0x0008
LINE_8N2 = "111110000"


@pytest.fixture
def card(tmp_path):
    with RunningCard(tmp_path, "--quiet", "--control") as running:
        yield running


@pytest.fixture
def master(card):
    with RawPort(card.link) as port:
        yield port


def all_frames(card: RunningCard) -> list[Frame]:
    """Frames of a card that has ended: during the power-up LEDs the log may lag by a second."""
    assert card.stop() == 0
    return card.frames()


def answered(master: RawPort, request: bytes = READ_CONTROL, count: int = CONTROL_BYTES) -> bool:
    master.write(request)
    return len(master.read(count, SILENCE_S)) == count


WRONG = {
    "": "no command",
    "tripp": "unknown command 'tripp'",
    "trip 13 14": "takes no '14'",
    "trip soon": "not 'soon'",
    "cut both on": "modbus or drive, not 'both'",
    "noise modbus nan": "from 0 to 1000",
    "baud modbus -21": "from -20 to 20",
    "switches 11111 10000000": "9 digits",
}


def test_wrong_command_is_one_line_and_changes_nothing(card):
    before = card.state()
    for command, says in WRONG.items():
        answer = card.command(command)
        assert answer.startswith("error: ") and says in answer
    after = card.state()
    assert {**after, "state": 0, "modbus": 0, "drive": 0} == {**before, "state": 0, "modbus": 0, "drive": 0}
    for line in ("modbus", "drive"):
        assert {**after[line], "led": ""} == {**before[line], "led": ""}
    for name in ("trip", "cut", "noise", "baud", "switches", "power-cycle", "state"):
        assert name in card.command("help")


def test_trip_sets_the_status_word_until_a_power_cycle_and_the_end_of_the_input_ends_the_card(card):
    assert not card.state()["motor"]["status"] & TRIPPED
    assert card.command("trip 7") == "ok"
    motor = card.state()["motor"]
    assert motor["status"] & TRIPPED and motor["alarm"] == 7
    assert card.command("power-cycle") == "ok"
    assert card.state()["motor"]["alarm"] == 0
    card.process.stdin.close()
    assert card.wait() == 0


def test_a_foreign_drive_cannot_be_tripped(tmp_path):
    with RunningCard(tmp_path, "--quiet", "--control", "--drive", str(tmp_path / "drive")) as card:
        assert card.command("trip").startswith("error: only the simulated drive")
        assert card.state()["motor"] is None


@pytest.mark.rule("FC-9")
def test_cut_drive_line_is_silent_and_recovers(card, master):
    assert answered(master, READ_514, REPLY_514_BYTES)
    assert card.command("cut drive on") == "ok"
    master.write(READ_514)
    assert master.read(5, 2.0)[1] == READ_514[1] | 0x80
    assert card.command("cut drive off") == "ok"
    assert answered(master, READ_514, REPLY_514_BYTES)
    frames = all_frames(card)
    once_repeated = 2
    assert len(of(frames, "drive", "card")) == 1 + once_repeated + 1
    assert len(of(frames, "drive", "drive")) == 2


def test_cut_network_line_passes_nothing(card, master):
    assert card.command("cut modbus on") == "ok"
    assert not answered(master)
    assert card.command("cut modbus off") == "ok"
    assert answered(master)
    assert len(of(all_frames(card), "modbus", "master")) == 1


@pytest.mark.rule("FRAME-4")
def test_noise_spoils_frames_and_the_card_ignores_them(card, master):
    assert card.command("noise modbus 1000") == "ok"
    assert not answered(master)
    assert card.command("noise modbus 0") == "ok"
    assert answered(master)
    heard, then = of(all_frames(card), "modbus", "master")
    assert not heard.ok and heard.data != READ_CONTROL and len(heard.data) == len(READ_CONTROL)
    assert then.ok and then.data == READ_CONTROL


@pytest.mark.rule("LINE-5")
@pytest.mark.parametrize(("percent", "heard"), [(3, True), (-9, False)])
def test_rate_error_of_the_master(card, master, percent, heard):
    assert card.command(f"baud modbus {percent}") == "ok"
    assert answered(master) == heard
    (frame,) = of(all_frames(card), "modbus", "master")
    lasts = len(READ_CONTROL) * 11 / 9600 / (1 + percent / 100)
    assert frame.end - frame.start == pytest.approx(lasts, rel=0.001)


@pytest.mark.rule("LINE-7")
def test_switches_are_read_at_power_up(card, master):
    address_2 = "01000000"
    assert card.command(f"switches 101110000 {address_2}") == "ok"
    state = card.state()
    assert (state["read"], state["line"]) == ([LINE_8N2, "10000000"], "9600 8N2")
    assert answered(master)
    assert card.command("power-cycle") == "ok"
    state = card.state()
    assert (state["read"], state["line"]) == (["101110000", address_2], "19200 8N2")
    assert not answered(master)
    assert answered(master, with_crc(b"\x02" + READ_CONTROL[1:-2]))
    asked = of(all_frames(card), "modbus", "master")[-1]
    assert asked.end - asked.start == pytest.approx(len(READ_CONTROL) * 11 / 19200, rel=0.001)
