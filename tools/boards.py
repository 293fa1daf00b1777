# SPDX-License-Identifier: Apache-2.0
"""The boards: constraints/boards.toml, each board's wrapper and pin file, and what must hold between them."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

from tools.sources import ROOT, SourcesError, configurations, without_comments

FOLDER = ROOT / "constraints"
TABLE = FOLDER / "boards.toml"
CARD = ROOT / "rtl/rtu2fc.v"
CARD_INSTANCE = "card_i"
PIN_FILES = {"ice40": "pcf", "machxo2": "lpf", "ecp5": "lpf"}

PORT = re.compile(r"\b(input|output|inout)\s+wire\s*(?:\[(\d+):(\d+)\])?\s*(\w+)")
LPF_PIN = re.compile(r'^\s*LOCATE\s+COMP\s+"([^"]+)"\s+SITE\s+"([^"]+)"', re.MULTILINE)
LPF_PULL_UP = re.compile(r'^\s*IOBUF\s+PORT\s+"([^"]+)".*\bPULLMODE=UP\b', re.MULTILINE)
LPF_BUFFER = re.compile(r'^\s*IOBUF\s+PORT\s+"([^"]+)"', re.MULTILINE)
LPF_CLOCK = re.compile(r'^\s*FREQUENCY\s+PORT\s+"clk"\s+([\d.]+)\s+MHZ', re.MULTILINE)
PCF_PIN = re.compile(r"^set_io\s+(?:-pullup\s+\w+\s+)?(\S+)\s+(\w+)\s*$", re.MULTILINE)
PCF_PULL_UP = re.compile(r"^set_io\s+-pullup\s+yes\s+(\S+)", re.MULTILINE)
PCF_CLOCK = re.compile(r"^set_frequency\s+clk\s+([\d.]+)\s*$", re.MULTILINE)


@dataclass(frozen=True)
class Board:
    """A row of boards.toml; `name` is its key."""

    name: str
    title: str
    config: str
    part: str
    family: str
    device: tuple[str, ...]
    clk_hz: int
    cells: int
    brams: int
    seeds: tuple[int, ...]
    packs: bool = True

    @property
    def top(self) -> str:
        return self.name.replace("-", "_")

    @property
    def wrapper(self) -> Path:
        return FOLDER / self.name / f"{self.top}.v"

    @property
    def pin_file(self) -> Path:
        return FOLDER / self.name / f"{self.top}.{PIN_FILES[self.family]}"

    @property
    def memory_words(self) -> int:
        return configurations()[self.config]["memory_bytes"] // 4

    def pins(self) -> list[tuple[str, str]]:
        """(port bit, pin), as the pin file has them."""
        pattern = LPF_PIN if self.pin_file.suffix == ".lpf" else PCF_PIN
        return pattern.findall(self.pin_file.read_text())


def boards() -> dict[str, Board]:
    rows = tomllib.loads(TABLE.read_text())
    return {
        name: Board(
            name, **{key: tuple(value) if isinstance(value, list) else value for key, value in row.items()}
        )
        for name, row in rows.items()
    }


def board(name: str) -> Board:
    known = boards()
    if name not in known:
        raise SourcesError(f"no board {name!r} in {TABLE.relative_to(ROOT)}; there are: {', '.join(known)}")
    return known[name]


def ports(path: Path) -> dict[str, str]:
    """Direction of each port bit of the one module in a file."""
    header = without_comments(path).split(");", 1)[0]
    found = {}
    for direction, high, low, name in PORT.findall(header):
        bits = [f"{name}[{bit}]" for bit in range(int(low), int(high) + 1)] if high else [name]
        found |= dict.fromkeys(bits, direction)
    return found


def _twice(items: list[str]) -> list[str]:
    return sorted({item for item in items if items.count(item) > 1})


def problems(entry: Board) -> list[str]:
    """What does not fit together in one board's files; empty when all is well."""
    text = entry.pin_file.read_text()
    lpf = entry.pin_file.suffix == ".lpf"
    wanted = ports(entry.wrapper)
    pins = entry.pins()
    placed = [port for port, _ in pins]
    wrong = [f"port {port} has no pin" for port in wanted if port not in placed]
    wrong += [f"there is no port {port}" for port in sorted(set(placed) - set(wanted))]
    wrong += [f"port {port} has two pins" for port in _twice(placed)]
    wrong += [f"pin {pin} is used twice" for pin in _twice([pin for _, pin in pins])]

    pulled = (LPF_PULL_UP if lpf else PCF_PULL_UP).findall(text)
    inputs = [port for port, direction in wanted.items() if direction == "input" and port != "clk"]
    wrong += [f"input {port} has no pull-up" for port in inputs if port not in pulled]
    wrong += [f"{port} is pulled up but no input" for port in pulled if port not in inputs]
    if lpf:
        wrong += [f"port {port} has no IOBUF line" for port in wanted if port not in LPF_BUFFER.findall(text)]

    clocks = [round(float(mhz) * 1e6) for mhz in (LPF_CLOCK if lpf else PCF_CLOCK).findall(text)]
    default = re.search(r"\bCLK_HZ = ([\d_]+)", entry.wrapper.read_text())
    if clocks != [entry.clk_hz]:
        wrong.append(f"the pin file asks for a clock of {clocks} Hz, boards.toml for {entry.clk_hz}")
    if default is None or int(default[1]) != entry.clk_hz:
        wrong.append(f"the wrapper's CLK_HZ is not the {entry.clk_hz} of boards.toml")
    if entry.clk_hz < configurations()[entry.config]["clk_hz"]:
        wrong.append(f"{entry.clk_hz} Hz are too slow for the configuration {entry.config}")

    code = without_comments(entry.wrapper)
    body = re.search(rf"\brtu2fc\s*#.*?\)\s*{CARD_INSTANCE}\s*\((.*?)\);", code, re.DOTALL)
    joined = re.findall(r"\.(\w+)\(([^)]*)\)", body[1]) if body else []
    card_ports = {port.split("[")[0] for port in ports(CARD)}
    wrong += [
        f"the card's port {port} is not connected"
        for port in sorted(card_ports - {p for p, w in joined if w})
    ]
    return [f"{entry.name}: {line}" for line in wrong]
