# SPDX-License-Identifier: Apache-2.0
"""Generates what is derived from regs/*.rdl, regs/*.toml, configs.toml, rtl/rtl.f and VERSION.

    python -m regs.regs            writes the files
    python -m regs.regs --check    exits 1 and names every file that is not up to date

From the mailbox map: C header, linker symbols, Python constants, Markdown page.
From the card tables: Verilog table, Python tables, C++ tables (LINE-2, LINE-3, FRAME-1, FC-8).
From the words of the FC protocol: texts of the dissector, of `rtu2fc decode` and of the virtual card.
From the dialects: the rows of regs/dialects.py in other files.
From the configurations: one file of Verilog macros each, the defaults of the top's parameters (TOP-2).
From the list of Verilog files: the lists in the .core files for FuseSoC.
From the version of the release: a C header (MAP-10), the versions in the .core files and of the Python
packages.
"""

import math
import re
import sys
import tempfile
import textwrap
import tomllib
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from peakrdl_cheader.c_standards import CStandard
from peakrdl_cheader.exporter import CHeaderExporter
from systemrdl import RDLCompiler
from systemrdl.node import FieldNode, RegNode

from regs import dialects, fc
from regs.areas import STRIDE
from rtl.command import run_main, write_files
from rtl.sources import needed_files, rtl_files

ROOT = Path(__file__).resolve().parents[1]
RDL = "regs/mailbox.rdl"
CARD = "regs/card.toml"
CONFIGS = "configs.toml"
VERSION = "VERSION"
# Files of the Python packages, and their line of the version.
PACKAGES = {"tb/agents/pyproject.toml": r'^(version = )".*"$', "sw/rtu2fc/__init__.py": r'^(VERSION = )".*"$'}
PACKAGES["sw/conformance/__init__.py"] = PACKAGES["sw/rtu2fc/__init__.py"]
EXAMPLE = "docs/example/modbus_slave.core"
# Start value of silence_timer's count at each half character; the module gives the reason.
SILENCE_START = 18


banner = partial(fc.banner, that="that file")


# ---------------------------------------------------------------- mailbox map


class Map:
    """The elaborated map: the registers, and the areas of the frame memory."""

    def __init__(self) -> None:
        compiler = RDLCompiler()
        compiler.compile_file(str(ROOT / RDL))
        self.card = compiler.elaborate("card").top
        self.mailbox = self.card.get_child_by_name("MAILBOX")
        memory = self.card.get_child_by_name("FRAMES")
        self.frames_base = memory.absolute_address
        self.frames_bytes = memory.size
        self.registers: list[RegNode] = list(self.mailbox.registers())
        self.fields: list[FieldNode] = [field for reg in self.registers for field in reg.fields()]
        # Frames and counters, lane by lane.
        lanes = compiler.elaborate("frames").top.children()
        self.areas: list[RegNode] = [area for lane in lanes for area in lane.registers()]


def field_reset(field: FieldNode) -> int | None:
    """The reset value, or None if the field has none."""
    reset = field.get_property("reset")
    return reset if isinstance(reset, int) else None


def enum_members(field: FieldNode) -> list[tuple[str, int]]:
    """Name and value of each named value of a field; empty if it has none."""
    enum = field.get_property("encode")
    members = enum.members.values() if enum else []
    return [(member.name, member.value) for member in members]


def c_header(registers: Map) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mailbox.h"
        CHeaderExporter().export(
            registers.card,
            str(path),
            std=CStandard.gnu99,
            reuse_typedefs=False,
            explode_top=True,
            instantiate=True,
        )
        text = path.read_text()
    # Every member lies at a multiple of its size, so the struct needs no packing. In a packed struct the
    # compiler must assume alignment 1 and would write each word byte by byte.
    text = text.replace("struct __attribute__ ((__packed__))", "struct")
    # The frame memory is no struct, because its lanes are interleaved.
    lines = ["// Addresses in the frame memory; the bytes of a frame are FRAME_STRIDE apart."]
    lines += [f"#define FRAMES_address 0x{registers.frames_base:08x}u"]
    lines += [f"#define FRAMES_bytes {registers.frames_bytes}u", f"#define FRAME_STRIDE {STRIDE}u"]
    for area in registers.areas:
        address = registers.frames_base + area.raw_absolute_address
        lines.append(f"#define {area.inst_name}_address 0x{address:08x}u")
    lines += ["", "// Named values of fields."]
    for field in registers.fields:
        name = f"MAILBOX__{field.parent.inst_name}__{field.inst_name.upper()}"
        lines += [f"#define {name}__{value.upper()} {number}u" for value, number in enum_members(field)]
    # Nothing needs the widths, nor the resets to 0.
    text = re.sub(r"^#define \w+(?:_bw \d+|_reset 0x0)\n", "", text, flags=re.MULTILINE)
    head, tail = text.split("#include <stdint.h>\n", 1)
    text = f"{head}#include <stdint.h>\n\n" + "\n".join(lines) + "\n" + tail
    return banner("//", RDL) + text.rstrip() + "\n"


def linker_script(registers: Map) -> str:
    return f"{banner('/*', RDL, ' */')}FRAMES_BYTES = {registers.frames_bytes};\n"


def python_constants(registers: Map) -> str:
    lines = [
        banner("#", RDL).rstrip(),
        '"""The mailbox map: registers from BASE on, frames and counters from FRAMES on, in bytes."""',
        "",
        "from regs.areas import Area, Field, Register",
        "",
        f"BASE = 0x{registers.mailbox.absolute_address:08X}",
        f"FRAMES = 0x{registers.frames_base:08X}",
        f"FRAMES_BYTES = {registers.frames_bytes}",
        "",
        "REGISTERS = {",
    ]
    for reg in registers.registers:
        lines += [f'    "{reg.inst_name}": Register(', f"        0x{reg.address_offset:02X},"]
        lines += [f"        {reg.size},", "        {"]
        for field in reg.fields():
            reset, port = field_reset(field), field.get_property("port", default=None)
            values = f"{field.low}, {field.width}, {'None' if reset is None else f'0x{reset:X}'}"
            values += f', "{port}"' if port else ""
            values += ", pulse=True" if field.get_property("singlepulse") else ""
            lines.append(f'            "{field.inst_name}": Field({values}),')
        lines += ["        },", "    ),"]
    lines += ["}", "", "# Named values of the field of a register.", "VALUES = {"]
    for field in registers.fields:
        if members := enum_members(field):
            values = ", ".join(f'"{name}": {value}' for name, value in members)
            lines.append(f'    ("{field.parent.inst_name}", "{field.inst_name}"): {{{values}}},')
    lines += ["}", "", "AREAS = {"]
    for area in registers.areas:
        at, size = area.raw_absolute_address, area.get_property("regwidth") // 8
        length = area.array_dimensions[0] if area.is_array else 1
        lines.append(f'    "{area.inst_name}": Area(0x{at:02X}, {length}, {size}),')
    lines.append("}")
    return "\n".join(lines) + "\n"


def verilog_fields(registers: Map) -> tuple[list[str], list[str]]:
    """Lines for the proofs. The first list has what is read, the second the written fields and their values.

    A byte of the second word without a register repeats that of the first. The events have flags: g_events.
    """
    shown, happens = ["g_events << 32"], []
    written: dict[str, dict[str, str]] = {"pulses": {}, "kept": {}, "fields": {}}
    offsets = {reg.address_offset for reg in registers.registers}
    for field in registers.fields:
        reg = field.parent
        at, port = reg.address_offset, field.get_property("port", default=None)
        bits = f"wdata[{field.high}:{field.low}]"
        if field.get_property("onwrite"):
            happens.append(f"{port} << {field.low}")
        elif reg.size == 1:
            again = at < STRIDE and at + STRIDE not in offsets
            shown += [f"{port} << {8 * place + field.low}" for place in (at, at + STRIDE)[: 1 + again]]
        elif field.get_property("singlepulse"):
            written["pulses"][port] = f"word == 3'd{at // STRIDE} && {bits}"
        elif port:
            written["fields" if field_reset(field) is None else "kept"][port] = bits
    read = [f"wire [63:0] g_shown = {' | '.join(shown)};", f"wire [7:0] g_happens = {' | '.join(happens)};"]
    order = [
        f"wire [31:0] g_{name}{end} = {{{', '.join(values)}}};"
        for name, ports in written.items()
        for end, values in (("", ports.keys()), ("_data", ports.values()))
    ]
    return wrapped(read), wrapped(order)


def wrapped(lines: list[str]) -> list[str]:
    return [part for line in lines for part in textwrap.wrap(line, 118, subsequent_indent="    ")]


# ---------------------------------------------------------------- card tables


class CardTables:
    """card.toml, checked, and the values derived from it."""

    def __init__(self) -> None:
        data = tomllib.loads((ROOT / CARD).read_text())
        self.line = data["line"]
        self.drive = data["drive"]
        self.rates, self.formats = self.positions(data)
        if sorted(self.rates) != list(range(8)) or sorted(self.formats) != list(range(4)):
            sys.exit(f"{CARD}: every switch pattern must be listed once")
        # With EXTENDED_SWITCHES = 1.
        rates, formats = self.positions(data["extended"])
        self.extended_rates, self.extended_formats = self.rates | rates, self.formats | formats

    def positions(self, table: dict) -> tuple[dict[int, int], dict[int, dict]]:
        """Rates by switches 1 to 3, and formats by switches 4 and 5."""
        rates = {self.switch_bits(text, 3): rate for text, rate in table["baud"].items()}
        return rates, {self.switch_bits(text, 2): self.whole(row) for text, row in table["format"].items()}

    def whole(self, entry: dict) -> dict:
        """A format with the bits of its character time."""
        return {"character_bits": self.line["character_bits"], **entry}

    @staticmethod
    def switch_bits(text: str, width: int) -> int:
        """'110' (first switch first) -> the number whose bit 0 is the first switch."""
        if len(text) != width or set(text) - set("01"):
            sys.exit(f"{CARD}: bad switch pattern {text!r}")
        return int(text[::-1], 2)

    def switch_text(self, bits: int, width: int) -> str:
        return f"{bits:0{width}b}"[::-1]

    def ratio(self, rate: int) -> int:
        """Base ticks per oversampling tick; exact at every rate (LINE-4)."""
        ratio, rest = divmod(self.line["base_hz"], self.line["ticks_per_bit"] * rate)
        if rest:
            sys.exit(f"{CARD}: {rate} bit/s does not divide the base of {self.line['base_hz']} Hz")
        return ratio

    def mask(self, rate: int) -> int:
        """Count mask of baud_divider for a ratio of 3 times a power of 2: that power minus 1; else 0."""
        ratio = self.ratio(rate)
        halvings, rest = divmod(ratio, 3)
        if ratio != 1 and (rest or halvings.bit_count() != 1 or halvings > 128):
            sys.exit(f"{CARD}: {rate} bit/s is neither the base nor 3 x a power of 2 up to 128 slower")
        return max(halvings - 1, 0)

    def exact_silence_ticks(self, rate: int, name: str, character_bits: int) -> float:
        """t15 or t35 in oversampling ticks (FRAME-1)."""
        if rate > self.line["fast_above_baud"]:
            return self.line[f"fast_{name}_us"] * rate * self.line["ticks_per_bit"] / 1e6
        return self.line[f"{name}_characters"] * character_bits * self.line["ticks_per_bit"]

    def silence_ticks(self, rate: int, name: str, character_bits: int) -> int:
        """t15 or t35, rounded up to a whole tick."""
        return math.ceil(self.exact_silence_ticks(rate, name, character_bits))

    def half_ticks(self, rate: int, character_bits: int) -> tuple[int, bool]:
        """Half a character of FRAME-1 in oversampling ticks: a third of t1.5, a seventh of t3.5.

        Rounded up. True: the exact value is no whole number, and every second half is a tick shorter.
        """
        exact = self.exact_silence_ticks(rate, "t15", character_bits) / 3
        if not math.isclose(exact, self.exact_silence_ticks(rate, "t35", character_bits) / 7):
            sys.exit(f"{CARD}: t1.5 and t3.5 are not 3 and 7 halves of the same length at {rate} bit/s")
        return math.ceil(exact), not exact.is_integer()

    @property
    def drive_pause_ticks(self) -> int:
        return self.drive["pause_characters"] * self.line["character_bits"] * self.line["ticks_per_bit"]


def verilog_case(select: str, width: int, rows: dict[int, dict[str, str]]) -> list[str]:
    """An always block with a case of all patterns of `width` switch bits; a row has the values."""
    lines = ["  always @* begin", f"    case ({select})"]
    for bits, row in sorted(rows.items()):
        label = "default" if bits == max(rows) else f"{width}'b{bits:0{width}b}"
        lines.append(f"      {label}: begin")
        lines += [f"        {name} = {value};" for name, value in row.items()]
        lines.append("      end")
    return [*lines, "    endcase", "  end"]


def either(extended: dict[str, str], old: dict[str, str]) -> dict[str, str]:
    """The values of a row, by EXTENDED_SWITCHES where they differ."""
    return {
        name: value if value == old[name] else f"EXTENDED_SWITCHES ? {value} : {old[name]}"
        for name, value in extended.items()
    }


def verilog_rate(card: CardTables, rate: int) -> dict[str, str]:
    half, uneven = card.half_ticks(rate, card.line["character_bits"])
    fast = rate > card.line["fast_above_baud"]
    return {
        "baud_undivided": f"1'b{int(card.ratio(rate) == 1)}",
        "baud_mask": f"7'd{card.mask(rate)}",
        "half_end": f"9'd{SILENCE_START + half - 1}" if fast else "character_half",
        "half_uneven": f"1'b{int(uneven)}",
    }


def verilog_format(card: CardTables, entry: dict) -> dict[str, str]:
    half, _ = card.half_ticks(card.line["fast_above_baud"], entry["character_bits"])
    return {
        "parity_enable": f"1'b{int(entry['parity'] != 'none')}",
        "parity_odd": f"1'b{int(entry['parity'] == 'odd')}",
        "two_stop": f"1'b{int(entry['stop_bits'] == 2)}",
        "character_half": f"9'd{SILENCE_START + half - 1}",
    }


def card_verilog(card: CardTables) -> str:
    rates = {
        bits: either(verilog_rate(card, rate), verilog_rate(card, card.rates[bits]))
        for bits, rate in card.extended_rates.items()
    }
    formats = {
        bits: either(verilog_format(card, entry), verilog_format(card, card.formats[bits]))
        for bits, entry in card.extended_formats.items()
    }
    lines = [
        banner("//", CARD).rstrip(),
        "//",
        "// Settings of the network line by the baud and parity switches. Combinational; 1 = ON.",
        "// EXTENDED_SWITCHES = 0: the positions of the old card. 1: also 38400 and 115200 bit/s and 8N1.",
        "// Index = switch. Rate by baud_divider (LINE-2), format (LINE-1, LINE-3). half_end: end value of",
        "// silence_timer's count of half a character (FRAME-1); half_uneven: every second half is one tick",
        "// shorter. character_half: half_end of the rates whose silences are characters.",
        "",
        "`default_nettype none",
        "",
        "module card_tables #(",
        "    parameter [0:0] EXTENDED_SWITCHES = 1'b0",
        ") (",
        "    input  wire [ 5:1] sw_baud,",
        "    output reg         baud_undivided,",
        "    output reg  [ 6:0] baud_mask,",
        "    output reg         parity_enable,",
        "    output reg         parity_odd,",
        "    output reg         two_stop,",
        "    output reg  [ 8:0] half_end,",
        "    output reg         half_uneven",
        ");",
        "",
        "  reg [8:0] character_half;",
        "",
        *verilog_case("sw_baud[3:1]", 3, rates),
        "",
        *verilog_case("sw_baud[5:4]", 2, formats),
        "",
        "endmodule",
        "",
        "`default_nettype wire",
    ]
    return "\n".join(lines) + "\n"


def card_python(card: CardTables) -> str:
    lines = [
        banner("#", CARD).rstrip(),
        '"""Rates, formats, silences by switches, first switch first, 1 = ON (LINE-2, LINE-3, FRAME-1).',
        "",
        "RATES, FORMATS: positions of the old card. EXTENDED_...: of a card with EXTENDED_SWITCHES = 1.",
        '"""',
        "",
        "from dataclasses import dataclass",
        "",
        "",
        "@dataclass(frozen=True)",
        "class Rate:",
        '    """baud in bit/s; ratio in base ticks per tick; mask of baud_divider, 0 for ratio 1."""',
        "",
        "    baud: int",
        "    ratio: int",
        "    mask: int",
        "",
        "",
        "@dataclass(frozen=True)",
        "class Format:",
        '    """character_bits: length of a character time."""',
        "",
        "    parity: str",
        "    stop_bits: int",
        "    character_bits: int",
        "",
        "",
        "@dataclass(frozen=True)",
        "class Silences:",
        '    """In ticks of 1/16 bit; half: half a character of FRAME-1.',
        "",
        "    half_uneven: the second, fourth ... half is a tick shorter.",
        '    """',
        "",
        "    t15_ticks: int",
        "    t35_ticks: int",
        "    half_ticks: int",
        "    half_uneven: bool",
        "",
        "",
        f"BASE_HZ = {card.line['base_hz']}",
        f"TICKS_PER_BIT = {card.line['ticks_per_bit']}",
        f"CHARACTER_BITS = {card.line['character_bits']}",
        f"DRIVE_BAUD = {card.drive['baud']}",
        f"DRIVE_FORMAT = {python_format(card.whole(card.drive))}",
        f"DRIVE_PAUSE_TICKS = {card.drive_pause_ticks}",
        f"SILENCE_START = {SILENCE_START}",
    ]
    for name, rates in (("RATES", card.rates), ("EXTENDED_RATES", card.extended_rates)):
        lines += ["", "# switches 1, 2, 3", f"{name} = {{"]
        for bits, rate in sorted(rates.items(), key=lambda item: item[1]):
            row = rate, card.ratio(rate), card.mask(rate)
            lines.append(f'    "{card.switch_text(bits, 3)}": Rate({", ".join(map(str, row))}),')
        lines.append("}")
    for name, formats in (("FORMATS", card.formats), ("EXTENDED_FORMATS", card.extended_formats)):
        lines += ["", "# switches 4, 5", f"{name} = {{"]
        for bits, entry in sorted(formats.items()):
            lines.append(f'    "{card.switch_text(bits, 2)}": {python_format(entry)},')
        lines.append("}")
    lines += ["", "# bit/s, bits of a character time", "SILENCES = {"]
    for rate in sorted(set(card.extended_rates.values())):
        for bits in sorted({entry["character_bits"] for entry in card.extended_formats.values()}):
            t15, t35 = (card.silence_ticks(rate, name, bits) for name in ("t15", "t35"))
            row = t15, t35, *card.half_ticks(rate, bits)
            lines.append(f"    ({rate}, {bits}): Silences({', '.join(map(str, row))}),")
    lines.append("}")
    return "\n".join(lines) + "\n"


def python_format(entry: dict) -> str:
    return f'Format("{entry["parity"]}", {entry["stop_bits"]}, {entry["character_bits"]})'


def card_cpp(card: CardTables) -> str:
    letters = {"none": "N", "odd": "O", "even": "E"}
    lines = [
        banner("//", CARD).rstrip(),
        "//",
        "// Rate, format and silences of the network line by switches 1 to 5, first switch = bit 0 (LINE-2,",
        "// LINE-3, FRAME-1), and of the drive line (FC-1, FC-8).",
        "",
        "#ifndef CARD_TABLES_H",
        "#define CARD_TABLES_H",
        "",
        "namespace card_tables {",
        "",
        "struct Format {",
        "  char parity;         // 'N', 'O' or 'E'",
        "  int stop_bits;       // stop bits that are sent",
        "  int character_bits;  // bits of a character time",
        "};",
        "",
        "struct Line {",
        "  int baud;  // bit/s",
        "  Format format;",
        "  int t15_ticks;  // silences in ticks of 1/kTicksPerBit bit",
        "  int t35_ticks;",
        "};",
        "",
        f"constexpr int kTicksPerBit = {card.line['ticks_per_bit']};",
        f"constexpr int kDriveBaud = {card.drive['baud']};  // bit/s",
        f"constexpr int kDrivePauseTicks = {card.drive_pause_ticks};",
        f"constexpr Format kDriveFormat = {cpp_format(card.whole(card.drive), letters)};",
    ]
    for about, name, rates, formats in (
        ("positions of the old card", "kLine", card.rates, card.formats),
        ("EXTENDED_SWITCHES = 1", "kExtendedLine", card.extended_rates, card.extended_formats),
    ):
        lines += ["", f"// index: switches 1 to 5; {about}", f"constexpr Line {name}[32] = {{"]
        for bits in range(32):
            rate, entry = rates[bits & 7], formats[bits >> 3]
            t15, t35 = (card.silence_ticks(rate, text, entry["character_bits"]) for text in ("t15", "t35"))
            lines.append(f"    {{{rate}, {cpp_format(entry, letters)}, {t15}, {t35}}},")
        lines.append("};")
    lines += ["", "}  // namespace card_tables", "", "#endif"]
    return "\n".join(lines) + "\n"


def cpp_format(entry: dict, letters: dict[str, str]) -> str:
    return f"{{'{letters[entry['parity']]}', {entry['stop_bits']}, {entry['character_bits']}}}"


# ---------------------------------------------------------------- configurations


def config_macros(name: str, entry: dict) -> str:
    lines = [
        banner("//", CONFIGS).rstrip(),
        "//",
        f"// Configuration {name}: defaults of the top's parameters. Clock in Hz, memory in bytes.",
        "",
        f"`define CONFIG_CLK_HZ {entry['clk_hz']}",
        f"`define CONFIG_SOFT_CORE 2'd{entry['soft_core_id']}  // {entry['soft_core']}",
        f"`define CONFIG_MEMORY_BYTES {entry['memory_bytes']}",
    ]
    return "\n".join(lines) + "\n"


def release_version() -> str:
    return (ROOT / VERSION).read_text().strip()


def version_header() -> str:
    define = f'#define CARD_VERSION "{release_version()}"'
    return f"{banner('/*', VERSION, ' */')}\n#ifndef VERSION_H\n#define VERSION_H\n\n{define}\n\n#endif\n"


# ---------------------------------------------------------------- other people's build tools


def core_lists() -> dict[str, set[str]]:
    """The Verilog files of each core. A file is in one core only, because a design may take both ports."""

    def names(paths: Iterable[Path]) -> set[str]:
        return {str(path.relative_to(ROOT)) for path in paths}

    network, drive = names(needed_files("network_port")), names(needed_files("drive_port"))
    # A port needs the times and formats of the card, but does not instantiate them.
    line = network & drive | {"rtl/baud_base.v", "rtl/baud_divider.v"}
    network |= {"regs/generated/card_tables.v"}
    card = names(rtl_files()) - network - drive - line
    return {"line": line, "network_port": network - line, "drive_port": drive - line, "rtu2fc": card}


def with_version_and_list(path: Path, files: set[str] | None) -> str:
    """A .core file with the version of all our cores in it, and with these files in its fileset `rtl`."""
    text = re.sub(r"(:rtu2fc:\w+:)[\d.]+", rf"\g<1>{release_version()}", path.read_text())
    if files is None:
        return text
    listed = "".join(f"      - {name}\n" for name in sorted(files))
    fileset = r"(^  rtl:\n(?:    .*\n)*?    files:\n)(?:      - .*\n)*"
    return re.sub(fileset, rf"\g<1>{listed}", text, count=1, flags=re.MULTILINE)


def with_version(name: str, pattern: str) -> str:
    """A file of a Python package with the version of the release."""
    text = (ROOT / name).read_text()
    return re.sub(pattern, rf'\g<1>"{release_version()}"', text, flags=re.MULTILINE)


def generate() -> dict[str, str]:
    """Path (from the repository's root) -> text of every generated file."""
    registers = Map()
    card = CardTables()
    configs = tomllib.loads((ROOT / CONFIGS).read_text())
    files = {
        "regs/generated/mailbox.h": c_header(registers),
        "regs/generated/frames.ld": linker_script(registers),
        "regs/generated/mailbox.py": python_constants(registers),
        "regs/generated/card_tables.v": card_verilog(card),
        "regs/generated/card_tables.py": card_python(card),
        "regs/generated/card_tables.h": card_cpp(card),
        "regs/generated/version.h": version_header(),
    }
    files |= {
        f"regs/generated/config_{name}.v": config_macros(name, entry) for name, entry in configs.items()
    }
    files |= {name: with_version(name, pattern) for name, pattern in PACKAGES.items()}
    files |= dialects.generate() | fc.generate()
    read, written = verilog_fields(registers)
    for name, rows in (("mailbox", read), ("mailbox_regs", read + written)):
        path = f"formal/{name}_props.vh"
        files[path] = dialects.with_rows(path, "fields", rows, RDL)
    lists = core_lists()
    for path in (*sorted(ROOT.glob("*.core")), ROOT / EXAMPLE):
        files[str(path.relative_to(ROOT))] = with_version_and_list(path, lists.get(path.stem))
    return files


def main() -> int:
    files = {ROOT / name: text for name, text in generate().items()}
    return write_files("regs", __doc__, files, "make regs")


if __name__ == "__main__":
    run_main("regs", main)
