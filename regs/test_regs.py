# SPDX-License-Identifier: Apache-2.0
"""Tests of the register map and the card tables: each has one source, and all derived files agree."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

import pytest

from regs import regs
from regs.generated import card_tables, mailbox
from tb.lib.runner import ROOT

COMPILER = "riscv64-unknown-elf-gcc"


@pytest.fixture(scope="module")
def register_map() -> regs.Map:
    return regs.Map()


@pytest.fixture(scope="module")
def c_values(tmp_path_factory, register_map) -> dict[str, int]:
    """Values of the header as the firmware's compiler sees them: register offsets, frame addresses."""
    folder = tmp_path_factory.mktemp("header")
    values = {reg.inst_name: f"offsetof(MAILBOX_t, {reg.inst_name})" for reg in register_map.registers}
    values |= {area.inst_name: f"{area.inst_name}_address" for area in register_map.areas}
    # Add one to each: a zero alone would make another assembler directive.
    lines = ["#include <stddef.h>", '#include "mailbox.h"', "const unsigned values[] = {"]
    lines += [f"  1 + {value}," for value in values.values()]
    source = folder / "values.c"
    source.write_text("\n".join([*lines, "};"]))
    command = [COMPILER, "-march=rv32i", "-mabi=ilp32", "-std=c99", "-Wall", "-Wextra", "-Werror"]
    command += ["-ffreestanding", "-I", str(ROOT / "regs/generated"), "-S", "-o", "-", str(source)]
    assembly = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    words = [
        int(word) - 1 & 0xFFFF_FFFF for word in re.findall(r"^\s+\.word\s+(-?\d+)", assembly, re.MULTILINE)
    ]
    return dict(zip(values, words, strict=True))


def verilog_value(literal: str) -> int:
    """12'd352 -> 352, 9'h00a -> 10, 16 -> 16."""
    _, quote, rest = literal.partition("'")
    return int(rest[1:], {"h": 16, "d": 10, "b": 2}[rest[0]]) if quote else int(literal)


def test_generated_files_are_up_to_date():
    for name, text in regs.generate().items():
        assert (ROOT / name).read_text() == text, f"{name} differs; run `make regs`"


def test_an_outdated_generated_file_is_found(tmp_path):
    """The check can fail: a copy with one digit changed is rejected by name."""
    for folder in ("regs", "docs", "rtl"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("configs.toml", "VERSION"):
        shutil.copy(ROOT / file, tmp_path / file)
    target = tmp_path / "rtl/fc_rx.v"
    target.write_text(target.read_text().replace("12'd352", "12'd353"))
    check = [sys.executable, "-m", "regs.regs", "--check"]
    done = subprocess.run(check, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "rtl/fc_rx.v differs" in done.stderr


def test_every_register_is_the_same_in_all_languages(register_map, c_values):
    """Name and offset of every register in C, Verilog, Python and Markdown."""
    macros = regs.macros()
    page = (ROOT / "docs/reference/registers.md").read_text()
    for reg in register_map.registers:
        name, offset = reg.inst_name, reg.address_offset
        assert c_values[name] == offset
        assert f"{name} " in page
        assert verilog_value(macros[f"MBX_{name}_WORD"]) == offset // 4
        assert (mailbox.REGISTERS[name].offset, mailbox.REGISTERS[name].size) == (offset, reg.size)


def test_every_frame_and_counter_is_the_same_in_all_languages(register_map, c_values):
    macros = regs.macros()
    page = (ROOT / "docs/reference/registers.md").read_text()
    for area in register_map.areas:
        name, offset = area.inst_name, area.raw_absolute_address
        assert c_values[name] == register_map.frames_base + offset
        assert f"| 0x{c_values[name]:08X} | {regs.area_length(area) * area.size} | {name} |" in page
        slot, lane = (verilog_value(macros[f"MBX_{name}_{part}"]) for part in ("SLOT", "LANE"))
        assert 4 * slot + lane == mailbox.AREAS[name].offset == offset
        assert mailbox.AREAS[name].length == regs.area_length(area)


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


def test_every_field_is_the_same_in_all_languages(register_map):
    """Bits, reset value and access of every field in C, Verilog and Python; name in Markdown."""
    macros = regs.macros()
    header = dict(re.findall(r"^#define (\w+) (\w+)$", (ROOT / "regs/generated/mailbox.h").read_text(), re.M))
    page = (ROOT / "docs/reference/registers.md").read_text()
    fields = [(reg, field) for reg in register_map.registers for field in reg.fields()]
    assert len(fields) > 25
    for reg, field in fields:
        verilog = f"MBX_{reg.inst_name}_{field.inst_name.upper()}"
        c = f"MAILBOX__{reg.inst_name}__{field.inst_name.upper()}"
        bits = f"{field.high}:{field.low}" if field.width > 1 else str(field.low)
        mask = ((1 << field.width) - 1) << field.low
        python = mailbox.REGISTERS[reg.inst_name].fields[field.inst_name]
        assert macros[f"{verilog}_BITS"] == bits
        assert int(header[f"{c}_bm"], 16) == mask
        assert python.put((1 << field.width) - 1) == mask
        assert python.access == regs.field_access(field)
        assert re.search(rf"\|\s*{bits}\s*\|\s*{field.inst_name}\s*\|", page)
        reset = regs.field_reset(field)
        assert python.reset == reset
        if reset is not None:
            assert verilog_value(macros[f"{verilog}_RESET"]) == reset
            assert int(header[f"{c}_reset"], 16) == reset


def test_named_values_are_the_same_in_all_languages(register_map):
    macros = regs.macros()
    header = dict(re.findall(r"^#define (\w+) (\w+)$", (ROOT / "regs/generated/mailbox.h").read_text(), re.M))
    page = (ROOT / "docs/reference/registers.md").read_text()
    fields = [(reg, field) for reg in register_map.registers for field in reg.fields()]
    members = {(reg.inst_name, field.inst_name): regs.enum_members(field) for reg, field in fields}
    named = {key: found for key, found in members.items() if found}
    values = {key: {name: value for name, value, _ in found} for key, found in named.items()}
    assert values == mailbox.VALUES
    assert list(mailbox.VALUES["TELEGRAM", "action"]) == ["first", "repeat", "waiting", "keep"]
    for (reg, field), members in named.items():
        for name, value, about in members:
            assert verilog_value(macros[f"MBX_{reg}_{field.upper()}_IS_{name.upper()}"]) == value
            assert int(header[f"MAILBOX__{reg}__{field.upper()}__{name.upper()}"].rstrip("u")) == value
            assert f"| {value} | `{name}` | {about} |" in page


def test_no_two_fields_share_bits(register_map):
    for reg in register_map.registers:
        taken = [bit for field in reg.fields() for bit in range(field.low, field.high + 1)]
        assert len(taken) == len(set(taken))
        assert max(taken) < 8 * reg.size


def test_the_map_ends_with_the_address_space():
    """One instruction reaches both, and address bit 10 distinguishes them."""
    assert mailbox.BASE == 0xFFFF_F800
    assert mailbox.FRAMES + mailbox.FRAMES_BYTES == 1 << 32
    assert all(register.offset < 32 for register in mailbox.REGISTERS.values())


@pytest.mark.rule("LINE-2", "LINE-4")
def test_rates_of_the_manual_and_exact_division():
    """The rates of LINE-2 by switch pattern; each divides the base exactly (LINE-4)."""
    rates = {pattern: rate.baud for pattern, rate in card_tables.RATES.items()}
    manual = {"000": 300, "001": 1200, "010": 2400, "011": 4800, "111": 9600, "101": 19200}
    assert rates == manual | {"100": 38400, "110": 115200}
    for rate in card_tables.RATES.values():
        assert rate.ratio * rate.baud * card_tables.TICKS_PER_BIT == card_tables.BASE_HZ
        assert rate.ratio in (1, 3 * (rate.mask + 1))
        assert rate.mask < 1 << 7


@pytest.mark.rule("LINE-3")
def test_formats_of_the_manual():
    formats = {pattern: (entry.parity, entry.stop_bits) for pattern, entry in card_tables.FORMATS.items()}
    assert formats == {"11": ("none", 2), "01": ("odd", 1), "00": ("even", 1), "10": ("none", 1)}


@pytest.mark.rule("FRAME-1")
def test_silences_within_a_quarter_bit():
    """11-bit characters up to 19200 bit/s, 750 and 1750 microseconds above; never too short."""
    for rate in card_tables.RATES.values():
        bit = 1 / rate.baud
        t15, t35 = (750e-6, 1750e-6) if rate.baud > 19200 else (16.5 * bit, 38.5 * bit)
        for ticks, wanted in ((rate.t15_ticks, t15), (rate.t35_ticks, t35)):
            assert 0 <= ticks * bit / 16 - wanted <= bit / 4 + 1e-12
            assert ticks < 1 << 12


@pytest.mark.rule("FRAME-1")
def test_three_and_seven_half_characters_are_the_silences():
    """Within 2 ticks of 1/16 bit, half of the tolerance of the rule."""
    for rate in card_tables.RATES.values():
        for halves, limit_us, bits in ((3, 750, 16.5), (7, 1750, 38.5)):
            exact = limit_us * rate.baud * 16 / 1e6 if rate.baud > 19200 else 16 * bits
            ticks = halves * rate.half_ticks - rate.half_uneven * (halves // 2)
            assert abs(ticks - exact) <= 2, f"{rate.baud} bit/s"


@pytest.mark.rule("FC-1", "FC-8")
def test_drive_line_constants():
    macros = regs.card_macros(regs.CardTables())
    values = {name: verilog_value(text) for name, text in macros.items() if not name.endswith("_BITS")}
    assert values["CARD_BASE_HZ"] == 16 * 9600 * 3 * (values["CARD_DRIVE_MASK"] + 1)
    assert values["CARD_DRIVE_PAUSE_TICKS"] == 22 * 16
    assert (values["CARD_DRIVE_PARITY_ENABLE"], values["CARD_DRIVE_PARITY_ODD"]) == (1, 0)
    assert values["CARD_DRIVE_TWO_STOP"] == 0


@pytest.mark.parametrize("vector", ["LINE", "REQUEST", "TELEGRAM", "EXCHANGE"])
def test_the_fields_of_a_vector_fill_it_and_no_two_share_bits(vector):
    macros = regs.card_macros(regs.CardTables())
    whole = f"CARD_{vector}_BITS"
    bits = []
    for name, text in macros.items():
        if name.startswith(f"CARD_{vector}_") and name != whole:
            high, _, low = text.partition(":")
            bits += range(int(low or high), int(high) + 1)
    assert macros[whole] == f"{len(bits) - 1}:0" and bits == list(range(len(bits)))


def test_cpp_tables_agree():
    text = (ROOT / "regs/generated/card_tables.h").read_text()
    rates = re.findall(r"^ +\{(\d+), (\d+), (\d+)\},", text, re.MULTILINE)
    wanted = [card_tables.RATES[f"{bits:03b}"[::-1]] for bits in range(8)]
    assert rates == [(str(rate.baud), str(rate.t15_ticks), str(rate.t35_ticks)) for rate in wanted]
    constants = {name: int(value) for name, value in re.findall(r"constexpr int (\w+) = (\d+);", text)}
    assert constants == {
        "kTicksPerBit": card_tables.TICKS_PER_BIT,
        "kCharacterBits": card_tables.CHARACTER_BITS,
        "kDriveBaud": card_tables.DRIVE_BAUD,
        "kDrivePauseTicks": card_tables.DRIVE_PAUSE_TICKS,
    }
    formats = re.findall(r"^ +\{'([NOE])', (\d)\},", text, re.MULTILINE)
    wanted = [card_tables.FORMATS[f"{bits:02b}"[::-1]] for bits in range(4)]
    assert formats == [(entry.parity[0].upper(), str(entry.stop_bits)) for entry in wanted]
