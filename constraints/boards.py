# SPDX-License-Identifier: Apache-2.0
"""The boards: rows of constraints/boards.toml, pin files, and the checks between them.

python -m constraints.boards            writes the pin table, docs/reference/pins.md, and build/boards
python -m constraints.boards --check    exit 1 if the tables differ, or a board is half-made
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import re
import sys
import textwrap
import tomllib
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from pathlib import Path

from constraints import wrapper
from rtl.command import run_main
from rtl.sources import ROOT, SourcesError, configuration, configurations, without_comments

TABLE = ROOT / "constraints/boards.toml"
# Where the pins of our boards are typed from their documents, a second time.
WITNESS = ROOT / "constraints/test_boards.py"
BUILD = ROOT / "build/boards"
# End of a board's name: the same board with EXTENDED_SWITCHES = 1 (LINE-2, LINE-3).
EXTENDED = "-extended"
NAME = re.compile(r"[A-Za-z]\w*(-\w+)*")
CARD = ROOT / "rtl/rtu2fc.v"
# The parameters of the card in its own file, and their defaults.
CARD_PARAMETER = re.compile(r"^ *parameter (?:\[[^]]*\] )?(\w+) = ([^,\s]+)", re.MULTILINE)
# Those that follow from other keys of the row.
FOLLOWING = ("CLK_HZ", "FIRMWARE_HEX", "SOFT_CORE", "MEMORY_BYTES")
FLASH = {"idcode", "pages", "user_pages"}
# What docs/guide/hardware.md says of a board.
SHOWN = ("title", "use", "switches", "leds", "transceivers", "load")
PIN_FILES = {"ice40": "pcf", "machxo2": "lpf", "ecp5": "lpf", "gowin": "cst"}
DOCS = ROOT / "docs/reference/pins.md"

PORT = re.compile(r"\b(input|output|inout)\s+wire\s*(?:\[(\d+):(\d+)\])?\s*(\w+)")
LPF_PIN = re.compile(
    r'^\s*LOCATE\s+COMP\s+"([^"]+)"\s+SITE\s+"([^"]+)"\s*;[ \t]*(?:#\s*(.*))?$', re.MULTILINE
)
LPF_BUFFER = re.compile(r'^\s*IOBUF\s+PORT\s+"([^"]+)"([^;]*);', re.MULTILINE)
LPF_CLOCK = re.compile(r'^\s*FREQUENCY\s+PORT\s+"clk"\s+([\d.]+)\s+MHZ', re.MULTILINE)
PCF_PIN = re.compile(
    r"^set_io(?:\s+-nowarn)?((?:\s+-\S+\s+\S+)*)\s+([^-\s]\S*)\s+(\w+)[ \t]*(?:#\s*(.*))?$", re.MULTILINE
)
PCF_CLOCK = re.compile(r"^set_frequency\s+clk\s+([\d.]+)\s*$", re.MULTILINE)
CST_PIN = re.compile(r'^IO_LOC\s+"([^"]+)"\s+(\w+)\s*;[ \t]*(?://\s*(.*))?$', re.MULTILINE)
CST_BUFFER = re.compile(r'^IO_PORT\s+"([^"]+)"([^;]*);', re.MULTILINE)
CLOCKS = {".lpf": LPF_CLOCK, ".pcf": PCF_CLOCK}
LINES = {".lpf": (LPF_PIN, LPF_BUFFER), ".cst": (CST_PIN, CST_BUFFER)}
# The settings of a .cst by their names in an .lpf.
CST_NAMES = {"PULL_MODE": "PULLMODE", "SLEW_RATE": "SLEWRATE"}

# The other end of each port; {n} is the number of its bit.
WIRED = {
    "clk": "oscillator",
    "rst_n": "reset, by a low pin",
    "sw_baud": "baud switch {n}, closes to {rail}",
    "button": "user button as baud switch 9, closes to {rail}",
    "sw_addr": "address switch {n}, closes to {rail}",
}
ENDS = {"rx": "receiver output (R)", "tx": "driver input (D)", "de": "driver enable (DE)"}
for _line, _name in wrapper.LINES.items():
    WIRED |= {f"{_line}_{wire}": f"{_name} transceiver, {end}" for wire, end in ENDS.items()}
    WIRED |= {
        f"led_{_line}_{colour}": f"{_name} LED, {colour}, lit by a {{level}} pin"
        for colour in ("red", "green")
    }
# Banks are at 3.3 V, but for those that boards.toml names. iCE40 has one standard and one strength.
STANDARD, STANDARD_1V8 = "LVCMOS33", "LVCMOS18"
STRENGTHS = {"machxo2": ("4", "8", "12", "16", "24"), "ecp5": ("4", "8", "12", "16")}
# Those that a GW1N has at 1.8 V, too.
STRENGTHS["gowin"] = ("4", "8", "12")
OPEN = ("NONE", "KEEPER")
# Pins of the part's configuration, in the database's words. A card that holds such a pin low, or drives it,
# may fail to configure itself or to be programmed again.
CONFIGURATION_PINS = {
    "machxo2": """TCK TMS TDI TDO JTAGENB PROGRAMN INITN DONE SN CSSPIN MCLK/CCLK SO/SPISO SI/SISPI
        SCL/PCLKT0_0 SDA/PCLKC0_0""",
    "gowin": """TCK TMS TDI TDO JTAGSEL_N/LPLL_T_IN RECONFIG_N READY DONE MODE0 MODE1 SCLK DOUT/WE_N
        DIN/CLKHOLD_N SSPI_CS_N/D0 SO/D1 SI/D2 FASTRD_N/D3 MCLK/D4 MCS_N/D5 MO/D6 MI/D7""",
}
CONFIGURATION = {family: names.split() for family, names in CONFIGURATION_PINS.items()}
# A clock pin is one from which the router reaches the clock networks. From GCLKT_4 and GCLKT_5, on the lower
# side of a GW1N-9, nextpnr 0.11.1 does not: it routes the clock as a signal, with hold errors.
CLOCK_PIN = {"machxo2": re.compile(r"\bPCLKT\d_\d$"), "gowin": re.compile(r"\bGCLKT_[0-367]$")}
# Package names of Project Trellis, without the number of pins.
PACKAGES = {"TG": "TQFP", "BG": "CABGA", "MG": "CSBGA", "FG": "FPBGA", "FTG": "FTBGA", "SG": "QFN"}
PACKAGES["QN"] = "QFN"


@dataclass(frozen=True)
class Pin:
    """A line of a pin file: position and buffer settings of a port bit, and the remark."""

    port: str
    site: str
    attributes: dict[str, str]
    remark: str


@dataclass(frozen=True)
class Board:
    """A row of boards.toml; `name` is its key, with EXTENDED after it for the board of that kind.

    `row_file` is the file of the row. The pin file is beside it.
    """

    name: str
    row_file: Path
    config: str
    part: str
    family: str
    device: tuple[str, ...]
    clk_hz: int
    cells: int = 0
    brams: int = 0
    seeds: tuple[int, ...] = (1, 2, 3, 4)
    memory_bytes: int = 0
    firmware_hex: str = ""
    banks_1v8: tuple[int, ...] = ()
    parameters: dict[str, int] = field(default_factory=dict, hash=False)
    held: dict[str, int] = field(default_factory=dict, hash=False)
    flash: dict[str, int] = field(default_factory=dict, hash=False)
    title: str = ""
    use: str = ""
    switches: str = ""
    leds: str = ""
    transceivers: str = ""
    load: tuple[list[str], ...] = field(default=(), hash=False)

    @property
    def plain_name(self) -> str:
        return self.name.removesuffix(EXTENDED)

    @property
    def extended_switches(self) -> int:
        return int(self.name.endswith(EXTENDED) or self.parameters.get("EXTENDED_SWITCHES", 0))

    @property
    def top(self) -> str:
        return self.plain_name.replace("-", "_")

    @property
    def wrapper(self) -> Path:
        """The Verilog of the board's top, made anew if it is of another row or pin file."""
        path, text = BUILD / f"{self.top}.v", self._verilog()
        if not path.exists() or path.read_text() != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            fresh = path.with_suffix(f".{os.getpid()}")
            fresh.write_text(text)
            fresh.replace(path)
        return path

    def _verilog(self) -> str:
        chosen = configuration(self.config)
        own = {"CLK_HZ": f"{self.clk_hz:_}", "FIRMWARE_HEX": '"firmware.hex"', "EXTENDED_SWITCHES": "0"}
        own |= {name: str(value) for name, value in self.parameters.items()}
        settings = dict(CARD_PARAMETER.findall(without_comments(CARD)))
        settings |= {
            "SOFT_CORE": str(chosen["soft_core_id"]),
            "LOCKSTEP": str(int(chosen["soft_core"] == "picorv32")),
            "MEMORY_BYTES": str(4 * self.memory_words),
            **{name: name for name in own},
        }
        about = [
            f"{self.title or self.plain_name}: configuration {self.config}, clk {self.clk_hz / 1e6:g} MHz.",
            f"Made from {shown(self.row_file)} and {shown(self.pin_file)}: change those.",
            "",
        ]
        for key in ("switches", "leds", "transceivers"):
            if said := getattr(self, key):
                about += textwrap.wrap(f"{key}: {said}", 90)
        placed = {pin.port.split("[")[0] for pin in self.pins()}
        return wrapper.verilog(self.top, about, own, settings, placed, self.held)

    @property
    def pin_file(self) -> Path:
        return self.row_file.with_name(f"{self.plain_name}.{PIN_FILES[self.family]}")

    @property
    def memory_words(self) -> int:
        return (self.memory_bytes or configuration(self.config)["memory_bytes"]) // 4

    @property
    def firmware(self) -> Path:
        """The default image."""
        return ROOT / (self.firmware_hex or configuration(self.config)["firmware_hex"])

    @property
    def gowin_die(self) -> str:
        """Name of a Gowin part's database, which stands among the options for nextpnr."""
        return next(word.removeprefix("family=") for word in self.device if word.startswith("family="))

    def pins(self) -> list[Pin]:
        """Pins of the pin file, with the attribute names of an .lpf."""
        try:
            text = self.pin_file.read_text()
        except FileNotFoundError:
            raise SourcesError(f"{self.name}: there is no pin file {shown(self.pin_file)}") from None
        if self.pin_file.suffix != ".pcf":
            pin_line, buffer_line = LINES[self.pin_file.suffix]
            for name, lpf_name in CST_NAMES.items():
                text = text.replace(f" {name}=", f" {lpf_name}=")
            buffers = {
                port: dict(item.split("=", 1) for item in words.split() if "=" in item)
                for port, words in buffer_line.findall(text)
            }
            rows = pin_line.findall(text)
            return [Pin(port, site, buffers.get(port, {}), said) for port, site, said in rows]
        found = []
        for options, port, site, said in PCF_PIN.findall(text):
            attributes = dict(zip(options.split()[::2], options.split()[1::2], strict=True))
            pull = {"yes": "UP", "no": "NONE"}.get(attributes.pop("-pullup", "no"), "?")
            found.append(Pin(port, site, attributes | {"PULLMODE": pull}, said))
        return found


def shown(path: Path) -> str:
    """A file of ours by its path from the root, another by its name."""
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else path.name


def from_row(name: str, row_file: Path, row: dict) -> Board:
    """A board by its row; an error names the first thing that is wrong in it."""

    def check(wrong: object, said: str) -> None:
        if wrong:
            raise SourcesError(f"{shown(row_file)}: {name}: {said}")

    keys = {one.name: one for one in fields(Board)[2:]}
    wrong = not NAME.fullmatch(name) or name.endswith(EXTENDED)
    check(wrong, f"a board's name has letters, digits, - and _, and not {EXTENDED} at its end")
    for key, value in row.items():
        check(key not in keys, f"unknown key {key}; there are {', '.join(keys)}")
        kind, _, inner = keys[key].type.partition("[")
        good = isinstance(value, {"str": str, "int": int, "tuple": list, "dict": dict}[kind])
        if good and inner:
            item = list if "list" in inner else int if "int" in inner else str
            good = all(isinstance(one, item) for one in (value.values() if kind == "dict" else value))
        check(not good, f"{key} = {value!r} is no {keys[key].type}")
    for key, one in keys.items():
        needed = one.default is MISSING and one.default_factory is MISSING
        check(needed and key not in row, f"the key {key} is missing")
    family, config, flash = row["family"], row["config"], row.get("flash", {})
    check(family not in PIN_FILES, f"unknown family {family}; there are {', '.join(PIN_FILES)}")
    check(config not in configurations(), f"unknown config {config}; there are {', '.join(configurations())}")
    die = any(word.startswith("family=") for word in row["device"])
    check(family == "gowin" and not die, "device has no family=DIE after --vopt")
    free = [name for name, _ in CARD_PARAMETER.findall(without_comments(CARD)) if name not in FOLLOWING]
    for parameter in row.get("parameters", {}):
        check(parameter not in free, f"unknown parameter {parameter}; there are {', '.join(free)}")
    check(flash and flash.keys() != FLASH, f"flash has {', '.join(sorted(FLASH))}")
    return Board(
        name,
        row_file,
        **{key: tuple(value) if isinstance(value, list) else value for key, value in row.items()},
    )


def read(path: Path) -> dict:
    try:
        return tomllib.loads(path.read_text())
    except OSError as error:
        raise SourcesError(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SourcesError(f"{path}: {error}") from None


def boards() -> dict[str, Board]:
    return {name: from_row(name, TABLE, row) for name, row in read(TABLE).items()}


def extended(entry: Board) -> Board:
    return replace(entry, name=f"{entry.name}{EXTENDED}")


def board(name: str) -> Board:
    """A board by its name or by the .toml file of its row, of either kind."""
    plain = name.removesuffix(EXTENDED)
    if plain.endswith(".toml"):
        path = Path(plain).resolve()
        rows = read(path)
        if [type(row) for row in rows.values()] != [dict]:
            raise SourcesError(f"{path}: {len(rows)} keys at the top, but one table is a board")
        (row,) = rows.values()
        entry = from_row(path.stem, path, row)
    elif plain in (known := boards()):
        entry = known[plain]
    else:
        there = f"there are: {', '.join(known)}, each with {EXTENDED} after it, too"
        raise SourcesError(f"no board {name!r} in {TABLE.relative_to(ROOT)}; {there}, or FOLDER/NAME.toml")
    return extended(entry) if plain != name else entry


def ports(path: Path) -> dict[str, str]:
    """Direction of each port bit of the only module in a file."""
    header = without_comments(path).split(");", 1)[0]
    found = {}
    for direction, high, low, name in PORT.findall(header):
        bits = [f"{name}[{bit}]" for bit in range(int(low), int(high) + 1)] if high else [name]
        found |= dict.fromkeys(bits, direction)
    return found


def whole_ports(ways: dict[str, str]) -> dict[str, str]:
    """Direction of each port, with all its bits."""
    return {port.split("[")[0]: way for port, way in ways.items()}


def vector(port: str, ways: dict[str, str]) -> str:
    """A port with its range, for a declaration."""
    numbers = [int(name[len(port) + 1 : -1]) for name in ways if name.startswith(f"{port}[")]
    return f"[{max(numbers)}:{min(numbers)}] {port}" if numbers else port


def _twice(items: list[str]) -> list[str]:
    return sorted({item for item in items if items.count(item) > 1})


def wrongly_set(pin: Pin, direction: str, family: str, standard: str = STANDARD) -> list[str]:
    """Errors in a pin's buffer settings; a port without such a line is reported elsewhere."""
    has = dict(pin.attributes)
    if not has:
        return []
    wrong = []
    # A switch that closes to the supply may be pulled down, which an iCE40 cannot do.
    to_supply = pin.port.startswith(("sw_baud[", "sw_addr["))
    pulled = direction == "input" and pin.port != "clk" and not to_supply
    pull = has.pop("PULLMODE", "not set")
    if pulled and pull != "UP":
        wrong.append(f"has no pull-up (PULLMODE {pull})")
    if not pulled and pull not in (*OPEN, *["DOWN"] * to_supply):
        wrong.append(f"is pulled (PULLMODE {pull})")
    if family in STRENGTHS:
        if (found := has.pop("IO_TYPE", "not set")) != standard:
            wrong.append(f"is not {standard} (IO_TYPE {found})")
        if direction == "output":
            if (drive := has.pop("DRIVE", "not set")) not in STRENGTHS[family]:
                wrong.append(f"has no strength of its part (DRIVE {drive})")
            # No signal on the card is faster than 115200 bit/s.
            if (slew := has.pop("SLEWRATE", "not set")) != "SLOW":
                wrong.append(f"has not the slow edges (SLEWRATE {slew})")
    return wrong + [f"has {name}, which it cannot use" for name in has]


def package_folder(name: str) -> Path:
    """Where a Python package of the tools is."""
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        raise SourcesError(f"Python package {name} is missing; run `make setup`")
    return Path(spec.origin).parent


@cache
def gowin_pads(die: str, part: str) -> dict[str, tuple[int, str]]:
    """Bank and special functions of each pin of a Gowin part, from the database of its packer."""
    folder = package_folder("apycula")
    # A local import: it is missing until `make setup` has installed this layer.
    from apycula.chipdb import load_chipdb

    database = load_chipdb(str(folder / f"{die}.msgpack.xz"))
    package, variant, _ = database.packages[part]
    return {
        site: (database.pin_bank[pad], "/".join(names))
        for site, (pad, names) in database.pinout[variant][package].items()
    }


def standard(entry: Board, site: str) -> str:
    """The I/O standard of the pin's bank."""
    if not entry.banks_1v8:
        return STANDARD
    bank, _ = gowin_pads(entry.gowin_die, entry.part).get(site, (None, ""))
    return STANDARD_1V8 if bank in entry.banks_1v8 else STANDARD


def without_outputs(entry: Board) -> list[int]:
    """Banks of a Gowin part with inputs alone: its packer takes the voltage of a bank from the outputs."""
    if entry.family != "gowin":
        return []
    ways, pads = ports(entry.wrapper), gowin_pads(entry.gowin_die, entry.part)
    banks: dict[int, set[str]] = {}
    for pin in entry.pins():
        if pin.site in pads and pin.port in ways:
            banks.setdefault(pads[pin.site][0], set()).add(ways[pin.port])
    return sorted(bank for bank, there in banks.items() if "output" not in there)


def functions(entry: Board) -> dict[str, str]:
    """Special functions of MachXO2 and Gowin pins; empty for the other families."""
    try:
        if entry.family == "gowin":
            pads = gowin_pads(entry.gowin_die, entry.part)
            return {site: names for site, (_, names) in pads.items() if names}
        return machxo2_functions(entry.part) if entry.family == "machxo2" else {}
    except (KeyError, AttributeError, OSError):
        raise SourcesError(f"{entry.name}: the tools' database has no part {entry.part}") from None


def machxo2_functions(part: str) -> dict[str, str]:
    device, kind, count = re.fullmatch(r"(LCMXO\w+-\d+)\w*-\d([A-Z]+)(\d+)[A-Z]", part).groups()
    folder = package_folder("yowasp_nextpnr_machxo2") / "share/trellis/database/MachXO2" / device
    database = json.loads((folder / "iodb.json").read_text())

    def place(cell: dict) -> tuple[int, int, str]:
        return cell["row"], cell["col"], cell["pio"]

    known = {place(cell): cell["function"] for cell in database["pio_metadata"] if "function" in cell}
    sites = database["packages"][PACKAGES[kind] + count]
    return {site: known[place(cell)] for site, cell in sites.items() if place(cell) in known}


def misplaced(entry: Board, pins: list[Pin]) -> list[str]:
    """Clocks on pins without a clock network, and ports on programming pins."""
    known = functions(entry)
    wrong = [
        f"clk is on {pin.site}, which is no clock pin"
        for pin in pins
        if known and pin.port == "clk" and not CLOCK_PIN[entry.family].search(known.get(pin.site, ""))
    ]
    return wrong + [
        f"{pin.port} is on {pin.site}, which is {known[pin.site]} of the part's configuration"
        for pin in pins
        if known.get(pin.site) in CONFIGURATION.get(entry.family, ())
    ]


def wired(entry: Board, port: str) -> str:
    """The other end of a port."""
    name, _, number = port.partition("[")
    low = name.endswith("_n")
    rail, level = ("ground", "low") if low else ("3.3 V", "high")
    if name in entry.held:
        return f"held {('low', 'high')[entry.held[name]]}"
    said = WIRED.get(name) or WIRED[name.removesuffix("_n")]
    return said.format(n=number.rstrip("]"), rail=rail, level=level)


def problems(entry: Board) -> list[str]:
    """Contradictions between a board's row and its pin file."""
    pins = entry.pins()
    text = entry.pin_file.read_text()
    suffix = entry.pin_file.suffix
    wanted = ports(entry.wrapper)
    placed = [pin.port for pin in pins]
    wrong = [f"port {port} has no pin" for port in wanted if port not in placed]
    wrong += [f"there is no port {port}" for port in sorted(set(placed) - set(wanted))]
    wrong += [f"port {port} has two pins" for port in _twice(placed)]
    wrong += [f"pin {site} is used twice" for site in _twice([pin.site for pin in pins])]
    wrong += misplaced(entry, pins)
    if suffix in LINES:
        buffers = [port for port, _ in LINES[suffix][1].findall(text)]
        wrong += [f"port {port} has no buffer line" for port in wanted if port not in buffers]
        wrong += [f"port {port} has two buffer lines" for port in _twice(buffers)]
        wrong += [f"buffer line of {port}, which is no port" for port in sorted(set(buffers) - set(wanted))]
    for pin in pins:
        if pin.port in wanted:
            wrong += [
                f"{wanted[pin.port]} {pin.port} {line}"
                for line in wrongly_set(pin, wanted[pin.port], entry.family, standard(entry, pin.site))
            ]
    wrong += [
        f"bank {bank} has inputs alone, so gowin_pack takes it for 1.2 V" for bank in without_outputs(entry)
    ]

    # A .cst cannot name the clock's frequency; constraints/synth.py gives that of the row to nextpnr.
    clocks = [round(float(mhz) * 1e6) for mhz in CLOCKS[suffix].findall(text)] if suffix in CLOCKS else None
    if clocks not in (None, [entry.clk_hz]):
        wrong.append(f"the pin file asks for a clock of {clocks} Hz, the row for {entry.clk_hz}")
    if entry.clk_hz < configuration(entry.config)["clk_hz"]:
        wrong.append(f"{entry.clk_hz} Hz are too slow for the configuration {entry.config}")
    return [f"{entry.name}: {line}" for line in wrong]


def unfinished(entry: Board) -> list[str]:
    """What a board of ours lacks, although it can be built."""
    keys = ", ".join(key for key in SHOWN if not getattr(entry, key))
    missing = [f"docs/guide/hardware.md needs {keys} in its row"] if keys else []
    if not re.search(rf'^    "{entry.name}": \(', WITNESS.read_text(), re.MULTILINE):
        missing.append(f"FACTS of {shown(WITNESS)} has no row of it, typed from its document")
    if entry.family == "machxo2" and not entry.flash:
        missing.append("the key flash is missing, so it gets no .jed")
    return [f"{entry.name}: {line}" for line in missing]


# ---------------------------------------------------------------- docs/reference/pins.md


def strength(entry: Board, pin: Pin) -> str:
    """Of an output."""
    if entry.family not in STRENGTHS:
        return "fixed"
    return f"{pin.attributes.get('DRIVE')} mA, {pin.attributes.get('SLEWRATE', '').lower()}"


def pin_table() -> str:
    """A row for each port, a column for each board."""
    columns = list(boards().values())
    rows = {
        "part": [entry.part for entry in columns],
        "pin file": [f"`{shown(entry.pin_file)}`" for entry in columns],
        "outputs": [],
    }
    for number, entry in enumerate(columns):
        ways = ports(entry.wrapper)
        strengths = [strength(entry, pin) for pin in entry.pins() if ways[pin.port] == "output"]
        usual = max(strengths, key=strengths.count)
        rows["outputs"].append(usual)
        for pin in entry.pins():
            cell = pin.site + (f" ({pin.remark})" if pin.remark else "")
            if pin.attributes.get("IO_TYPE") == STANDARD_1V8:
                cell += ", 1.8 V"
            if ways[pin.port] == "output" and (own := strength(entry, pin)) != usual:
                cell += f", {own}"
            row = rows.setdefault(f"`{pin.port}`: {wired(entry, pin.port)}", [""] * len(columns))
            row[number] = cell
    heads = ["port", *(f"`{entry.name}`" for entry in columns)]
    lines = [heads, ["---"] * len(heads), *([name, *row] for name, row in rows.items())]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def pin_page() -> str:
    return f"""<!-- site: 740 Reference -->
# Pins

Written by `make pins` from the pin files in `constraints/`. Each input has a pull-up inside the part, but
`clk` and a switch to the supply. Pins are LVCMOS33, those with *1.8 V* LVCMOS18. *Outputs* are strength and
slope, fixed on iCE40. An empty cell: not connected on that board. The circuit around the pins is in
[hardware.md](../guide/hardware.md).

{pin_table()}
"""


def uses() -> str:
    lines = ["| board | for | switches | LEDs | transceivers |", "|---|---|---|---|---|"]
    for name, entry in boards().items():
        lines.append(f"| `{name}` | {entry.use} | {entry.switches} | {entry.leds} | {entry.transceivers} |")
    return "\n".join(lines)


def commands() -> str:
    lines = ["| board | command | stays after power-off |", "|---|---|---|"]
    for name, entry in boards().items():
        for when, (command, stays) in zip(("first", "then"), entry.load, strict=False):
            order = f", {when}" if len(entry.load) > 1 else ""
            lines.append(f"| `{name}`{order} | {command} | {stays} |")
    return "\n".join(lines)


# Tables of docs/guide/hardware.md, which tools/handbook.py writes.
BLOCKS = {"boards": uses, "load-commands": commands}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    args = parser.parse_args()
    wrong = [line for entry in boards().values() for line in problems(entry)]
    if args.check:
        wrong += [line for entry in boards().values() for line in unfinished(entry)]
        pin_files = [path for kind in set(PIN_FILES.values()) for path in TABLE.parent.glob(f"*.{kind}")]
        wrong += [
            f"{shown(path)} has no row in boards.toml" for path in pin_files if path.stem not in boards()
        ]
    if not wrong and not args.check:
        DOCS.write_text(pin_page())
        print(f"wrote {DOCS.relative_to(ROOT)}: {len(boards())} boards")
    elif not wrong and (not DOCS.exists() or DOCS.read_text() != pin_page()):
        wrong = [f"{DOCS.relative_to(ROOT)} is not what the pin files say; run `make pins`"]
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("pins", main, SourcesError)
