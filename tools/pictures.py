# SPDX-License-Identifier: Apache-2.0
"""Draws the pictures of the owner's pages, and the page that shows switch positions.

    python -m tools.pictures            writes docs/pictures/*.svg and the tables in docs/switches.html
    python -m tools.pictures --check    exits 1 and names every outdated picture

Rates and formats come from regs/card.toml, wires, pins and LED states from the tables of the handbook, and
the pins of a board from its pin file. So a picture cannot differ from the text beside it. The others follow
no table and are edited as they are: blocks, cassette, modules, network.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import partial
from itertools import groupby
from pathlib import Path

from constraints.boards import Board, boards
from regs.generated.card_tables import EXTENDED_FORMATS, EXTENDED_RATES, FORMATS, RATES, Format
from rtl.command import run_main, write_files
from rtl.sources import ROOT
from tools.handbook import rows
from tools.svg import Picture, PictureError

PICTURES = ROOT / "docs/pictures"
PAGE = ROOT / "docs/switches.html"
# What the original generally has: 9600 bit/s, no parity, address 1, termination.
USUAL_RATE, USUAL_ADDRESS = "111110000", "100000001"
PITCH = 30
MINUS = "\N{MINUS SIGN}"


def short(form: Format) -> str:
    return f"8{form.parity[0].upper()}{form.stop_bits}"


def block(picture: Picture, x: float, y: float, on: str, numbers: bool = True) -> None:
    """DIP switches, '1' = ON: the lever is at the upper end."""
    picture.box(x, y, PITCH * len(on), 44, "part")
    for place, position in enumerate(on):
        left = x + PITCH * place + 8
        picture.box(left, y + 5, 14, 34, "slot", 2)
        picture.box(left + 2, y + (7 if position == "1" else 23), 10, 14, "lever", 1)
        if numbers:
            picture.text(left + 7, y + 56, str(place + 1), "s", "middle")


def under(picture: Picture, x: float, y: float, first: int, last: int, text: str) -> None:
    """A bracket below some switches of a block, with its meaning."""
    left, right = x + PITCH * (first - 1) + 5, x + PITCH * last - 5
    picture.line("thin", (left, y), (left, y + 5), (right, y + 5), (right, y))
    picture.text((left + right) / 2, y + 16, text, "s", "middle")


def drive_pins() -> list[tuple[str, str, str]]:
    """Pin, signal and terminals of the 6-pin connector; the two spare pins each by itself."""
    found = []
    for row in rows("installing", "6-pin connector (drive)"):
        for pin in row["6-pin connector (drive)"].split(", "):
            found.append((pin, row["signal"], row["VLT terminal"]))
    return found


def network_pins() -> list[tuple[str, str]]:
    return [
        (row["3-pin connector (network)"], row["signal"])
        for row in rows("installing", "3-pin connector (network)")
    ]


def pin(picture: Picture, x: float, y: float, number: str) -> None:
    """A connector's pin with its number; pin 1 is filled."""
    picture.box(x - 11, y - 11, 22, 22, "first" if number == "1" else "pin", 2)
    picture.text(x, y, number, "b inv" if number == "1" else "b", "middle")


# ---------------------------------------------------------------- the card and its wires


def card() -> Picture:
    picture = Picture("The card: two LEDs, two blocks of nine switches, two connectors with pin 1", 468)
    x, right = 30, 30 + 9 * PITCH
    picture.box(14, 14, 320, 364)
    for at, name in ((44, "drive LED"), (190, "network LED")):
        picture.dot(at, 40, 9, "green")
        picture.text(at + 16, 40, name)
    picture.text(x, 72, "BAUD", "b")
    picture.text(right, 72, "up is ON", "s m", "end")
    block(picture, x, 84, USUAL_RATE)
    under(picture, x, 150, 1, 3, "rate")
    under(picture, x, 150, 4, 5, "parity")
    under(picture, x, 150, 6, 9, "not all ON")
    picture.text(x, 198, "ADDRESS", "b")
    picture.text(right, 198, "TERMINATION", "b", "end")
    block(picture, x, 210, USUAL_ADDRESS)
    for place in range(8):
        picture.text(x + PITCH * place + 15, 282, str(1 << place), "s m", "middle")
    picture.text(x, 304, "Address: add the numbers below ON. 9: 120 Ω", "s m")
    picture.text(44, 330, "6-pin connector: drive", "b")
    picture.box(44, 344, 6 * 42, 34, "part")
    for place, (number, signal, _) in enumerate(drive_pins()):
        at, level = 65 + 42 * place, 400 + 20 * (place % 2)
        pin(picture, at, 361, number)
        picture.line("thin", (at, 378), (at, level - 9))
        picture.text(at, level, signal.split(",")[0], "s", "middle")
    picture.box(318, 196, 32, 3 * 34, "part")
    picture.lines(342, 164, "3-pin\nnetwork", "b s")
    for place, (number, signal) in enumerate(network_pins()):
        pin(picture, 334, 213 + 34 * place, number)
        picture.text(358, 213 + 34 * place, signal, "s")
    picture.text(14, 450, "Filled square: pin 1. An old card may look different.", "s m")
    return picture


def wiring() -> Picture:
    """Six pins to the drive's terminals, three to the network cable."""
    picture = Picture("Wires from the 6-pin connector to the drive's terminals, and the 3-pin connector", 452)
    pins = drive_pins()
    ends = {"1": ["12"], "2": ["69"], "3": ["39", "61"], "4": ["68"]}
    picture.text(16, 24, "6-pin connector", "b")
    picture.text(404, 24, "terminals of the drive", "b", "end")
    picture.box(110, 40, 34, 6 * 40, "part")
    terminals = ["12", "13", "39", "61", "68", "69"]
    wired = {pin: text.replace("or", "and").split(" and ") for pin, _, text in pins if text}
    if wired != {**ends, "1": ["12", "13"]}:
        raise PictureError(f"wiring: the table has other terminals than the picture: {wired}")
    picture.box(340, 40, 44, 6 * 40, "part")
    place = {terminal: 60 + 40 * number for number, terminal in enumerate(terminals)}
    for number, (name, signal, _) in enumerate(pins):
        y = 60 + 40 * number
        picture.lines(104, y if "," not in signal else y - 8, signal.replace(", ", "\n"), "s", "end")
        bend = {"1": 250, "2": 190, "3": 280, "4": 220}.get(name)
        for to in ends.get(name, ()):
            picture.line(f"wire w{name}", (138, y), (bend, y), (bend, place[to]), (346, place[to]))
        pin(picture, 127, y, name)
    for terminal, y in place.items():
        picture.box(346, y - 11, 32, 22, "pin", 2)
        picture.text(362, y, terminal, "b", "middle")
    picture.line("wire w1 dash", (250, 60), (250, 100), (346, 100))
    picture.text(258, 88, "or 13", "s")
    picture.text(16, 304, "The drive must have been off for 14 minutes.", "b")
    picture.text(16, 338, "3-pin connector", "b")
    picture.text(404, 338, "network cable", "b", "end")
    picture.box(110, 350, 34, 3 * 30, "part")
    for number, (name, signal) in enumerate(network_pins()):
        y = 365 + 30 * number
        kind = ("w4", "w3", "w2")[number]
        picture.line(f"wire {kind}", (138, y), (290, y))
        picture.text(104, y, signal, "s", "end")
        pin(picture, 127, y, name)
        picture.text(298, y, ("+ wire", "common", f"{MINUS} wire")[number], "s")
    return picture


def loopback() -> Picture:
    picture = Picture("Wires of the loop-back test, on the bench, with the card out of the drive", 352)
    joined = {
        row["6-pin connector"]: row["3-pin connector"] for row in rows("switches-and-leds", "6-pin connector")
    }
    picture.text(16, 24, "6-pin connector", "b")
    picture.text(404, 24, "3-pin connector", "b", "end")
    picture.box(120, 40, 34, 6 * 40, "part")
    picture.box(320, 60, 34, 3 * 40, "part")
    bends = {"2": 250, "3": 215, "4": 285}
    for name, to in joined.items():
        y, end = 20 + 40 * int(name), 40 + 40 * int(to)
        picture.line(f"wire w{name}", (148, y), (bends[name], y), (bends[name], end), (326, end))
    for number in range(1, 7):
        pin(picture, 137, 20 + 40 * number, str(number))
    for number in range(1, 4):
        pin(picture, 337, 40 + 40 * number, str(number))
    picture.line("wire w1", (64, 60), (126, 60))
    picture.line("wire w3", (64, 140), (126, 140))
    picture.box(14, 44, 50, 112)
    picture.text(39, 60, "+", "b", "middle")
    picture.text(39, 140, MINUS, "b", "middle")
    picture.lines(39, 92, "24 V\nbench", "s", "middle")
    picture.text(16, 308, "Never inside a drive.", "b")
    picture.text(16, 330, "Nothing else is connected: 3-2 joins both commons.", "s")
    return picture


# ---------------------------------------------------------------- switches


def switches() -> Picture:
    picture = Picture("Switch positions of every rate and of every parity, lever up is ON", 454)
    picture.text(16, 22, "Rate: switches 1-3", "b")
    picture.text(220, 22, "Parity: switches 4-5", "b")
    for first, last, left in ((1, 3, 31), (4, 5, 235)):
        for number in range(first, last + 1):
            picture.text(left + PITCH * (number - first), 43, str(number), "s", "middle")
    for place, (on, rate) in enumerate(sorted(RATES.items(), key=lambda row: (row[1].baud, row[0]))):
        block(picture, 16, 54 + 44 * place, on, numbers=False)
        picture.text(116, 76 + 44 * place, f"{rate.baud}" + (" (usual)" if USUAL_RATE.startswith(on) else ""))
    for place, (on, form) in enumerate(FORMATS.items()):
        block(picture, 220, 54 + 44 * place, on, numbers=False)
        stops = "1 stop bit" if form.stop_bits == 1 else "2 stop bits"
        picture.lines(290, 67 + 44 * place, f"{form.parity} ({short(form)})\n{stops}", "s")
    picture.text(220, 256, "9600 8N2, address 1", "b")
    picture.text(220, 278, "Baud switches", "s")
    small(picture, 220, 288, USUAL_RATE)
    picture.text(220, 358, "Address switches, 9 ON", "s")
    small(picture, 220, 368, USUAL_ADDRESS)
    picture.text(16, 432, "A lever that is up is ON.", "b")
    return picture


def small(picture: Picture, x: float, y: float, on: str) -> None:
    picture.box(x, y, 20 * 9, 34, "part")
    for place, position in enumerate(on):
        picture.box(x + 20 * place + 5, y + 4, 10, 26, "slot", 2)
        picture.box(x + 20 * place + 6, y + (5 if position == "1" else 17), 8, 12, "lever", 1)
        picture.text(x + 20 * place + 10, y + 44, str(place + 1), "s", "middle")


def page() -> str:
    """The page on which one clicks switches, its line of tables made anew: it needs no network."""
    tables = {
        kind: {
            "rates": {on: rate.baud for on, rate in rates.items()},
            "formats": {on: f"{form.parity}, {short(form)}" for on, form in formats.items()},
        }
        for kind, rates, formats in (
            ("usual", RATES, FORMATS),
            ("extended", EXTENDED_RATES, EXTENDED_FORMATS),
        )
    }
    line = f"const tables = {json.dumps(tables)};"
    return re.sub("^const tables = .*$", line, PAGE.read_text(), flags=re.MULTILINE)


# ---------------------------------------------------------------- LEDs

# Each LED state of the handbook's table in words, and its colours in quarters of a second. 12 s are drawn
# shorter, with their length in words; then the LED flashes as without the test.
POWER_UP = "red, green, orange, off, 250 ms each, once"
GREEN, RED = ["green", "green", "off", "off"], ["red", "red", "off", "off"]
AFTER_TEST = ["off"] * 2 + RED + RED[:2]
STATES = {
    "green, flashing, 1 Hz": ("Green, flashing: works", GREEN * 4),
    "red, flashing, 1 Hz": ("Red, flashing: no request, or no reply of the drive", RED * 4),
    "red, steady, both LEDs": ("Both red, steady: fault, the card is halted", ["red"] * 16),
    "orange, steady, both LEDs, 12 s": (
        "Both orange, 12 s: loop-back test passed",
        ["orange"] * 8 + AFTER_TEST,
    ),
    "red, steady, both LEDs, 12 s, then flashing": (
        "Both red, 12 s: loop-back test failed",
        ["red"] * 8 + AFTER_TEST,
    ),
}


def leds() -> Picture:
    picture = Picture("What the LEDs show in the four seconds after power-up, and in each state", 488)
    known = [row["shows"] for row in rows("switches-and-leds", "shows")]
    if missing := [state for state in (POWER_UP, *STATES) if state not in known]:
        raise PictureError(f"leds: the handbook's table has no state '{missing[0]}'")
    show = [colour.strip() for colour in POWER_UP.split(",")[:4]]
    picture.text(16, 22, "After power-up", "b")
    lane(picture, 54, "drive", show + ["off"] * 4 + RED * 2)
    lane(picture, 88, "network", ["off"] * 4 + show + RED * 2)
    for second in range(5):
        picture.text(82 + 80 * second, 114, f"{second} s", "s m", "middle")
    for place, (state, (says, colours)) in enumerate(STATES.items()):
        y = 148 + 68 * place
        picture.text(16, y, says, "b")
        until = "12 s" if "12 s" in state else "without end"
        lane(picture, y + 28, "", colours, until)
    return picture


def lane(picture: Picture, y: float, name: str, colours: list[str], until: str = "") -> None:
    if name:
        picture.text(16, y, name, "s")
    start = 0
    for colour, same in groupby(colours):
        length, x = len(list(same)), 82 + 20 * start
        picture.box(x, y - 11, 20 * length, 22, colour, 0)
        if colour != "off":
            said = colour[0].upper() if length < 4 else f"{colour}, {until}"
            picture.text(x + 10 * length, y, said, "s w", "middle")
        start += length


# ---------------------------------------------------------------- boards


def connection(entry: Board, port: str) -> tuple[str, str]:
    """Connector and pin of a port on a development board: the remark of the pin file names them."""
    found = next(one for one in entry.pins() if one.port == port)
    connector, _, number = found.remark.partition(", pin ")
    return connector, number or found.site


def build(name: str) -> Picture:
    """The wires of a development board to two transceiver modules and to switches, from its pin file."""
    entry = boards()[name]
    picture = Picture(
        f"Wires of the {entry.title.split(',')[0]}: two EIA-485 modules, two switch blocks", 760
    )
    picture.text(16, 22, entry.title.split(",")[0], "b")
    picture.text(404, 22, "isolated modules", "b", "end")
    for y, line, title, right in (
        (40, "modbus", "network", ("A  +", f"B  {MINUS}", "com")),
        (188, "drive", "drive", ("A  68", "B  69", "39, 61")),
    ):
        picture.box(16, y, 104, 132, "part")
        picture.box(190, y, 130, 132)
        picture.text(255, y + 14, title, "b", "middle")
        for number, (port, module) in enumerate((("rx", "RXD"), ("tx", "TXD"), ("de", "DE"))):
            level = y + 36 + 25 * number
            picture.line(f"wire w{(2, 5, 4)[number]}", (120, level), (196, level))
            picture.text(112, level, " ".join(connection(entry, f"{line}_{port}")), "s", "end")
            picture.text(204, level, module, "s")
        picture.text(112, y + 111, "GND", "s", "end")
        picture.line("wire w3", (120, y + 111), (196, y + 111))
        picture.text(204, y + 111, "GND, RE", "s")
        for number, word in enumerate(right):
            level = y + 36 + 34 * number
            picture.line(f"wire w{(4, 2, 3)[number]}", (314, level), (346, level))
            picture.text(352, level, word, "s")
        picture.line("thin dash", (284, y + 26), (284, y + 126))
    picture.text(16, 338, "DE: 4.7 kΩ to GND each. RXD is the module's output.", "s")
    for y, text, ports in (
        (362, "Baud", [f"sw_baud_n[{n}]" for n in range(1, 10)]),
        (472, "Address", [f"sw_addr_n[{n}]" for n in range(1, 9)]),
    ):
        there = {one.port for one in entry.pins()}
        wired = [port for port in ports if port in there]
        picture.text(16, y, f"{text}: to GND. Below: pins of {connection(entry, wired[0])[0]}", "s")
        on = USUAL_RATE if text == "Baud" else USUAL_ADDRESS
        block(picture, 16, y + 12, on[: len(wired)])
        for number, port in enumerate(wired):
            picture.text(31 + PITCH * number, y + 86, connection(entry, port)[1], "s b", "middle")
    picture.text(16, 584, "LEDs", "b")
    for number, port in enumerate(("led_modbus", "led_drive")):
        words = []
        for colour in ("red", "green"):
            there = next(one.port for one in entry.pins() if one.port.startswith(f"{port}_{colour}"))
            connector, pin_ = connection(entry, there)
            where = connector if connector.startswith(("LED", "on the")) else f"{connector} {pin_}"
            words.append(f"{colour} {where}")
        title = ("network", "drive")[number]
        picture.text(16, 604 + 18 * number, f"{title}: {', '.join(words)}", "s")
    picture.text(16, 654, "Power", "b")
    picture.arrow("wire w1", (108, 683), (250, 683))
    picture.arrow("wire w1", (108, 731), (140, 731))
    picture.arrow("wire w1", (236, 731), (268, 731))
    for x, y, wide, high, text, kind in (
        (16, 668, 92, 78, "5 V supply,\nisolated", "box"),
        (250, 668, 154, 30, "USB socket, board", "part"),
        (140, 716, 96, 30, "3.3 V, 1 A", "box"),
        (268, 716, 136, 30, "VCC, both modules", "box"),
    ):
        picture.box(x, y, wide, high, kind)
        first = y + high / 2 - 8.5 * text.count("\n")
        picture.lines(x + wide / 2, first, text, "s", "middle")
    return picture


DRAWINGS: dict[str, Callable[[], Picture]] = {
    "card": card,
    "wiring": wiring,
    "loopback": loopback,
    "switches": switches,
    "leds": leds,
    "tang-nano-9k": partial(build, "tang-nano-9k"),
    "icebreaker": partial(build, "icebreaker"),
}


def files() -> dict[Path, str]:
    return {PAGE: page()} | {PICTURES / f"{name}.svg": draw().svg() for name, draw in DRAWINGS.items()}


def main() -> int:
    return write_files("pictures", __doc__, files(), "make pictures")


if __name__ == "__main__":
    run_main("pictures", main, PictureError)
