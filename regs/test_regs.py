# SPDX-License-Identifier: Apache-2.0
"""Tests of the register map and the card tables: each has one source, and all derived files agree."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from regs import regs
from regs.generated import card_tables, mailbox
from tb.lib.runner import ROOT

# The drive line's rate is also one of the network line.
(DRIVE_RATE,) = {rate for rate in card_tables.RATES.values() if rate.baud == card_tables.DRIVE_BAUD}


def localparams(path: Path) -> dict[str, int]:
    """Name to value of each localparam that is a plain number, such as 12'd352 or 1_843_200."""
    number = r"(?:\d+'([hdb]))?([\da-fA-F_]+)"
    found = re.findall(rf"localparam (?:\[[^]]+\] )?(\w+) = {number};", path.read_text())
    return {name: int(digits, {"h": 16, "b": 2}.get(base, 10)) for name, base, digits in found}


def test_an_outdated_generated_file_is_named(monkeypatch, capsys):
    monkeypatch.setattr(regs, "generate", lambda: {"VERSION": "9.9.9\n"})
    monkeypatch.setattr("sys.argv", ["regs", "--check"])
    assert regs.main() == 1
    assert capsys.readouterr().err.startswith("VERSION differs from its source; run `make regs`\n")


def test_no_two_frames_share_bytes():
    taken = [
        area.at(i) + n
        for area in mailbox.AREAS.values()
        for i in range(area.length)
        for n in range(area.size)
    ]
    assert len(taken) == len(set(taken))
    assert max(taken) < mailbox.FRAMES_BYTES


def test_frames_lie_where_the_hardware_expects_them():
    """Banks differ in one bit; a port's two banks share a lane, and so do the frames of both senders."""
    areas = mailbox.AREAS
    first, second = areas["REQUEST_FRAME_0"], areas["REQUEST_FRAME_1"]
    assert (first.slot, second.slot, first.lane) == (0, 32, second.lane)
    sent = {areas["REPLY_FRAME"].lane, areas["TELEGRAM_FRAME"].lane}
    assert sent == {0} and first.lane == 1 and areas["DRIVE_FRAME"].lane == areas["DRIVE_LGE"].lane == 2
    assert all(areas[f"{name}_FRAME"].slot % 32 == 0 for name in ("REPLY", "TELEGRAM", "DRIVE"))


def test_counters_are_in_the_order_of_the_events():
    """The firmware indexes both in one loop."""
    counters = [area.offset for name, area in mailbox.AREAS.items() if name.startswith("COUNT_")]
    assert counters == list(range(counters[0], counters[0] + 4 * len(counters), 4))
    events = sorted(mailbox.REGISTERS["EVENTS"].fields.items(), key=lambda item: item[1].bit)
    assert [about.bit for _, about in events] == list(range(8))
    for name, about in events:
        assert mailbox.AREAS[f"COUNT_{name.upper()}"].offset == counters[about.bit]


def test_the_map_ends_with_the_address_space():
    """One instruction reaches both, and address bit 10 distinguishes them."""
    assert mailbox.BASE == 0xFFFF_F800
    assert mailbox.FRAMES + mailbox.FRAMES_BYTES == 1 << 32
    assert all(register.offset < 32 for register in mailbox.REGISTERS.values())


@pytest.mark.rule("FRAME-1")
def test_silences_within_a_quarter_bit():
    """1.5 and 3.5 characters up to 19200 bit/s, 750 and 1750 microseconds above; never too short."""
    for (baud, bits), silences in card_tables.SILENCES.items():
        bit = 1 / baud
        t15, t35 = (750e-6, 1750e-6) if baud > 19200 else (1.5 * bits * bit, 3.5 * bits * bit)
        for ticks, wanted in ((silences.t15_ticks, t15), (silences.t35_ticks, t35)):
            assert 0 <= ticks * bit / 16 - wanted <= bit / 4 + 1e-12
            assert ticks < 1 << 12


@pytest.mark.rule("FRAME-1")
def test_three_and_seven_half_characters_are_the_silences():
    """Within 2 ticks of 1/16 bit, half of the tolerance of the rule."""
    for (baud, bits), silences in card_tables.SILENCES.items():
        for halves, limit_us in ((3, 750), (7, 1750)):
            exact = limit_us * baud * 16 / 1e6 if baud > 19200 else 16 * bits * halves / 2
            ticks = halves * silences.half_ticks - silences.half_uneven * (halves // 2)
            assert abs(ticks - exact) <= 2, f"{baud} bit/s"


@pytest.mark.parametrize(
    ("file", "constants"),
    {
        "rtl/baud_base.v": {"BASE_HZ": card_tables.BASE_HZ},
        "rtl/baud_divider.v": {"DRIVE_MASK": DRIVE_RATE.mask},
        "rtl/rtu2fc.v": {"DRIVE_MASK": DRIVE_RATE.mask},
        "rtl/fc_rx.v": {"PAUSE_TICKS": card_tables.DRIVE_PAUSE_TICKS},
        "rtl/silence_timer.v": {"SILENCE_START": card_tables.SILENCE_START},
        "rtl/drive_port.v": {
            "PAUSE_TICKS": card_tables.DRIVE_PAUSE_TICKS,
            "SILENCE_START": card_tables.SILENCE_START,
            "PARITY_ENABLE": card_tables.DRIVE_FORMAT.parity != "none",
            "PARITY_ODD": card_tables.DRIVE_FORMAT.parity == "odd",
            "TWO_STOP": card_tables.DRIVE_FORMAT.stop_bits == 2,
        },
    }.items(),
)
def test_constants_in_verilog_are_those_of_the_table(file, constants):
    assert localparams(ROOT / file).items() >= constants.items()


def test_the_decoder_of_the_registers_has_the_numbers_of_the_map():
    """Words, lowest bits of fields, named values, the key; the width of a field where it is used."""
    wanted = {name: register.offset // 4 for name, register in mailbox.REGISTERS.items()}
    widths = {}
    for name, register in mailbox.REGISTERS.items():
        for field, place in register.fields.items():
            wanted[f"{name}_{field.upper()}"] = place.bit
            widths[f"{name}_{field.upper()}"] = str(place.width)
    values = mailbox.VALUES["TELEGRAM", "action"].items()
    wanted |= {f"ACTION_{name.upper()}": value for name, value in values}
    wanted["KEY"] = mailbox.REGISTERS["WATCHDOG"].fields["key"].reset
    path = ROOT / "rtl/mailbox_regs.v"
    found = {name: value for name, value in localparams(path).items() if not name.startswith("K_")}
    assert found == {name: wanted[name] for name in found}
    written = {name for name, register in mailbox.REGISTERS.items() if register.size == 4}
    assert found.keys() >= written
    used = re.findall(r"\bwdata\[(\w+)(?:\+:(\d+))?\]", path.read_text())
    assert {name for name, _ in used} == found.keys() & widths.keys()
    assert all(widths[name] == (width or "1") for name, width in used)
    tickets = [mailbox.REGISTERS[name].fields["ticket"] for name in ("REPLY", "TELEGRAM", "SUPERVISOR")]
    assert len(set(tickets)) == 1


def test_the_arbiter_has_the_frames_of_the_map():
    found = localparams(ROOT / "rtl/bus_arbiter.v")
    assert found == {name: mailbox.AREAS[f"{name}_FRAME"].slot for name in ("TELEGRAM", "REPLY", "DRIVE")}


def test_defaults_of_the_top_are_the_standard_configuration():
    """Where the macros of another configuration were not read before."""
    top, standard = (ROOT / name for name in ("rtl/rtu2fc.v", "regs/generated/config_standard.v"))
    defaults, wanted = (re.findall(r"^`define .*", path.read_text(), re.M) for path in (top, standard))
    assert defaults == wanted
