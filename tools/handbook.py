# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of the owner's handbook, docs/guide/handbook, from the sources of the card's code.

    python -m tools.handbook            writes the tables into the pages
    python -m tools.handbook --check    exits 1 and names every outdated page

A table stands in a page between `<!-- generated: NAME -->` and `<!-- end -->`. Each name of TABLES stands
once. tools/handbook_sources.py reads the sources. Times in ms unless a name says otherwise. An error is one
line; exit code 2.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from campaigns.masters import page as masters
from rtl.command import run_main
from rtl.sources import ROOT
from sim.card.masters import words
from sim.drive.drive_table import RANGES
from sim.view.fc_tables import kinds, phrase, profiles
from tools.handbook_examples import example_list, worked_examples
from tools.handbook_sources import (
    FACTS,
    HandbookError,
    card,
    character_ms,
    coil_groups,
    constant,
    facts,
    filled,
    functions,
    local_registers,
    loopback_switches,
    minus,
    pause_ms,
    protocol,
    silence_ms,
    spaced,
    table,
    traits,
    word,
)

PROJECT = ROOT
GUIDES = PROJECT / "docs/guide"
BLOCK = re.compile(r"^<!-- generated: (\S+) -->\n(.*?)^<!-- end -->$", re.MULTILINE | re.DOTALL)
NOTE = "<!-- by `make regs`: change the source, not the page -->"
SILENT = "silence"
# Frames in characters: exception, longest text of a reply to 03, reply to a write; telegrams.
EXCEPTION, TEXT_REPLY, WRITE_REPLY = 5, 25, 8
PARAMETER_TELEGRAM, TEXT_TELEGRAM = 16, 32
ROUND_MS = 50  # time-outs of masters are rounded up to a multiple
REFERENCES = (0x0000, 0x1000, 0x1999, 0x2000, 0x4000, 0x7FFF, 0xE000, 0xC000)


def switches(pattern: str) -> list[str]:
    return ["ON" if bit == "1" else "OFF" for bit in pattern]


def run(numbers: range) -> str:
    return f"{numbers[0]}-{numbers[-1]}" if len(numbers) > 1 else str(numbers[0])


def percent(value: int) -> str:
    signed = value - 0x10000 if value & 0x8000 else value
    return minus(f"{signed / 0x4000:.2%}".replace("%", " %"))


def drives_with(kind: str) -> str:
    return ", ".join(facts()["drives"][profile.name] for profile in profiles() if kind in kinds(profile))


# ---------------------------------------------------------------- tables: switches, LEDs, drive


def switch_functions() -> str:
    rows = [[s["block"], s["numbers"], s["sets"], s["note"]] for s in facts()["switch"]]
    return table(["switch block", "switch", "sets", "note"], rows)


def rates() -> str:
    original = facts()["original"]["rates"]
    rows = []
    for bits, rate in sorted(card().rates.items(), key=lambda item: item[1]):
        also = "yes" if rate in original else "**no**"
        rows.append([rate, *switches(card().switch_text(bits, 3)), also])
    return table(["bit/s", "SW1", "SW2", "SW3", "on the original"], rows)


def formats() -> str:
    original = facts()["original"]["formats"]
    rows = []
    for bits, entry in sorted(card().formats.items(), reverse=True):
        pattern = card().switch_text(bits, 2)
        short = f"8{entry['parity'][0].upper()}{entry['stop_bits']}"
        also = "yes" if pattern in original else "**no**"
        rows.append([entry["parity"], entry["stop_bits"], short, *switches(pattern), also])
    return table(["parity", "stop bits", "short", "SW4", "SW5", "on the original"], rows)


def addresses() -> str:
    rows = []
    for address in sorted({*facts()["original"]["addresses"], 2, 3, 10, 100, 200}):
        pattern = f"{address:08b}"[::-1]
        sum_of = " + ".join(str(1 << i) for i, bit in enumerate(pattern) if bit == "1")
        rows.append([address, f"{address:02X}h", *switches(pattern), sum_of])
    heads = [f"SW{n} ({1 << n - 1})" for n in range(1, 9)]
    return table(["address", "hex", *heads, "sum"], rows)


def loopback() -> str:
    return table([f"SW{n}" for n in range(1, 10)], [switches(loopback_switches())])


def leds() -> str:
    rows = [
        [filled(led["text"]), led["drive"], led["network"], filled(led["do"]), led["rule"]]
        for led in facts()["led"]
    ]
    return table(["shows", "drive LED", "network LED", "do", "rule"], rows)


def drive_parameters() -> str:
    rows = [[p["pnu"], p["name"], filled(p["value"])] for p in facts()["drive_parameter"]]
    return table(["parameter", "name", "value"], rows)


# ---------------------------------------------------------------- tables: functions, coils, words


def function_list() -> str:
    words_of = facts()["function"]
    limits = {name: constant(f"LIMIT_{name}", "sw/src/registers.c") for name in ("NUMBER", "TEXT")}
    of_registers = (
        f"{limits['NUMBER']} of a number, {limits['TEXT']} of a text, {len(local_registers())} of 40001-40003"
    )
    rows = []
    for code, form, coils in functions():
        most = 1 if form == "single" else coils or of_registers
        broadcast = "ignored" if form == "read" else "carried out"
        if code == 1:
            asks = "no"
        else:
            asks = "coils 1-32: yes, 65: no" if coils else "parameters: yes, 40001-40003: no"
        rows.append([f"{code:02X} ({code})", words_of[str(code)], most, broadcast, asks])
    head = ["function, hex (decimal)", "name", "most items", "as a broadcast", "exchange with the drive"]
    return table(head, rows)


def coils() -> str:
    rows = []
    for group in facts()["coil_group"]:
        wire = coil_groups()[group["part"]]
        numbers = range(wire[0] + 1, wire[-1] + 2)
        rows.append([run(numbers), run(wire), group["name"], group["access"], group["note"]])
    return table(["coils", "address on the wire", "content", "access", "note"], rows)


def word_bits(name: str) -> str:
    first = coil_groups()[name][0]
    remarks = facts()[name]
    rows = []
    for key, bit in protocol()[name].items():
        only = drives_with(bit["only"]) if "only" in bit else "all"
        coil, mask = first + bit["bit"] + 1, word(1 << bit["bit"])
        rows.append([bit["bit"], coil, mask, bit["name"], bit["zero"], bit["one"], only, remarks[key]])
    return table(["bit", "coil", "value", "name", "0", "1", "drives", "note"], rows)


def control_words() -> str:
    rows = []
    for entry in facts()["word"]:
        value = entry["value"]
        says = [
            phrase(bit, bit["one"] if value >> bit["bit"] & 1 else bit["zero"])
            for bit in protocol()["control"].values()
            if bit.get("only") != "two_ramps"
        ]
        data = spaced(value.to_bytes(2, "little"))
        meaning = ", ".join(filter(None, says)) if value else ""
        rows.append([word(value), f"`{data}`", entry["use"], meaning, entry["source"]])
    return table(["control word", "bytes of coils 1-16", "use", "its bits", "source"], rows)


def references() -> str:
    rows = [[word(v), f"`{spaced(v.to_bytes(2, 'little'))}`", percent(v)] for v in REFERENCES]
    return table(["reference", "bytes of coils 17-32", "speed"], rows)


# ---------------------------------------------------------------- tables: registers, parameters


def local_table() -> str:
    rows = []
    for address, (name, default) in enumerate(local_registers()):
        entry = facts()["local"][name]
        rows.append([40001 + address, address, entry["name"], filled(entry["unit"]), default, entry["note"]])
    first, last = len(local_registers()), 8
    refused = f"refused with exception {traits()['card']['bad_address']}"
    rows.append([f"{40001 + first}-{40001 + last}", f"{first}-{last}", "reserved", "", "", refused])
    return table(["register", "address on the wire", "name", "unit", "at power-up", "note"], rows)


def parameter_addresses() -> str:
    rows = []
    for p in facts()["parameter"]:
        register = 10 * p["pnu"]
        rows.append(
            [p["pnu"], p["name"], register, 40000 + register, register - 1, word(register - 1), p["source"]]
        )
    head = ["parameter", "name", "register", "4x reference", "address on the wire", "hex", "source"]
    return table(head, rows)


def parameter_groups() -> str:
    rows = []
    for group in facts()["group"]:
        first, last = group["first"], group["last"]
        rows.append(
            [
                f"{first['pnu']:03}-{last['pnu']:03}",
                f"{first['name']} … {last['name']}",
                f"{10 * first['pnu']}-{10 * last['pnu']}",
                f"{10 * first['pnu'] - 1}-{10 * last['pnu'] - 1}",
            ]
        )
    return table(["parameters", "first … last", "registers", "addresses on the wire"], rows)


def data_types() -> str:
    header = "sim/drive/vlt_drive.h"
    rows = []
    for name, (low, high) in RANGES.items():
        number = constant(f"DRIVE_{name.upper()}", header)
        registers = 2 if high - low > 0xFFFF else 1
        rows.append(
            (number, name, f"{minus(low)} … {high}", registers, "03, 06" if registers == 1 else "03, 10")
        )
    text = constant("LIMIT_TEXT", "sw/src/registers.c")
    number = constant("DRIVE_TEXT", header)
    rows.append(
        (number, "text", f"at most {2 * text} characters", f"1-{text}", "03, 10, after [IND](texts.md)")
    )
    return table(["type", "name", "range", "registers", "functions"], [list(row) for row in sorted(rows)])


def registers_of(kind: str, number: int) -> list[int]:
    size = 2 if RANGES[kind][1] - RANGES[kind][0] > 0xFFFF else 1
    return words((number & (1 << 16 * size) - 1).to_bytes(2 * size, "big"))


def one_register(kind: str, number: int) -> str:
    """A read of one register, by MAP-7."""
    parts = registers_of(kind, number)
    high, low = ([0] * 2 + parts)[-2:]
    fits = high == 0 or (high == 0xFFFF and low >= 0x8000)
    return word(low) if fits else f"exception {constant('FAULT_TYPE', 'sw/src/codes.h')}"


def register_values() -> str:
    rows = []
    for entry in facts()["value"]:
        kind, number = entry["type"], entry["number"]
        shown = " ".join(word(part) for part in registers_of(kind, number))
        rows.append([minus(number), kind, shown, one_register(kind, number), entry["note"]])
    return table(["number", "type", "its registers", "a read of one register gives", "note"], rows)


def conversion() -> str:
    entry = facts()["conversion"]
    read, wanted = entry["read"], entry["wanted"]
    rows = []
    for index in entry["indexes"]:
        if index == 74:
            rows.append([74, entry["factor_74"], "see below", "see below"])
            continue
        factor = f"{10.0**index:.{max(1, -index)}f}"
        means = f"{read * 10.0**index:.{max(0, -index)}f}"
        rows.append([minus(index), factor, means, f"{wanted / 10.0**index:.0f}"])
    return table(["index", "factor", f"{read} that was read means", f"to set {wanted} write"], rows)


def storage() -> str:
    pnu = 104
    rows = []
    for registers, size in ((1, "WORD"), (2, "DOUBLE")):
        row: list[object] = [registers]
        for kind in ("WRITE", "STORE"):
            ak = constant(f"AK_{kind}_{size}", "sw/src/codes.h")
            row.append(f"AK {ak}, {word(ak << 12 | pnu)}")
        rows.append(row)
    return table(
        ["registers", f"coil 65 = 0: RAM (PKE of {pnu})", f"coil 65 = 1: RAM and EEPROM (PKE of {pnu})"], rows
    )


def index_word() -> str:
    codes = "sw/src/codes.h"
    rows = [
        ["00xxh", "numbers are read and written", "element xx of an array; 00 for a single value"],
        [
            f"{constant('IND_TEXT_READ', codes) >> 8:02X}xxh",
            "03 reads texts; 06 and 10 write numbers",
            "likewise",
        ],
        [
            f"{constant('IND_TEXT_WRITE', codes) >> 8:02X}xxh",
            "10 writes texts; 06 writes numbers; 03 reads numbers",
            "likewise",
        ],
    ]
    return table(["40001", "effect", "low byte xx"], rows)


# ---------------------------------------------------------------- tables: exceptions, time-outs


@dataclass(frozen=True)
class Reason:
    """Why a request gets an exception; `codes` by dialect, 0 is a code, None is silence."""

    codes: dict[str, int | None]
    name: str
    cause: str
    cure: str


def reasons() -> list[Reason]:
    """Every reason of every dialect, by the code of the default dialect."""
    rows = []
    for key, entry in facts()["exception"].items():
        if key == "one_register":
            fault = constant("FAULT_TYPE", "sw/src/codes.h")
            codes = {name: row["drive_fault"] or fault for name, row in traits().items()}
        else:
            silent = key == "drive_silent"
            codes = {name: row[key] or (None if silent else 0) for name, row in traits().items()}
        rows.append(Reason(codes, entry["name"], filled(entry["cause"]), entry["cure"]))
    if facts()["fault"].keys() != protocol()["fault"].keys():
        raise HandbookError(f"{FACTS} and regs/fc.toml have different faults")
    for number, name in protocol()["fault"].items():
        entry = facts()["fault"][number]
        codes = {dialect: row["drive_fault"] or int(number) for dialect, row in traits().items()}
        rows.append(Reason(codes, f"drive: {name}", entry["cause"], entry["cure"]))
    return sorted(rows, key=lambda reason: reason.codes["card"])


def exceptions() -> str:
    rows = []
    for reason in reasons():
        code = reason.codes["card"]
        others = [SILENT if c is None else c for c in (reason.codes["builtin"], reason.codes["hvac_basic"])]
        rows.append([f"**{code}**", f"{code:02X}h", *others, reason.name, reason.cause, reason.cure])
    return table(["`card`", "hex", "`builtin`", "`hvac_basic`", "meaning", "cause", "cure"], rows)


def defaults() -> str:
    rows = [[entry["name"], filled(entry["value"]), entry["change"]] for entry in facts()["default"]]
    return table(["value", "at power-up", "changed by"], rows)


def times() -> str:
    rows = [[t["name"], filled(t["value"]), t["meaning"], t["rule"]] for t in facts()["time"]]
    return table(["time", "value", "meaning", "rule"], rows)


def shortest_timeout(rate: int) -> tuple[float, float, float]:
    """The longest time from the end of a request to the end of its reply, with the default of 40003.

    For exception 255, a text that is read and a text that is written, each with the repeat.
    """
    drive = character_ms(card().drive["baud"])
    wait = 2 * dict(local_registers())["LOCAL_DRIVE_TIMEOUT"] * 10 + silence_ms(rate, "t35") + pause_ms()
    number = wait + 2 * PARAMETER_TELEGRAM * drive
    written = wait + 2 * TEXT_TELEGRAM * drive
    character = character_ms(rate)
    return number + EXCEPTION * character, number + TEXT_REPLY * character, written + WRITE_REPLY * character


def exception_steps() -> str:
    """The first of shortest_timeout() at the drive's rate, part by part."""
    rate = card().drive["baud"]
    character = character_ms(rate)
    wait = 10 * dict(local_registers())["LOCAL_DRIVE_TIMEOUT"]
    telegram = PARAMETER_TELEGRAM * character
    steps = [
        ("t3.5", silence_ms(rate, "t35")),
        (f"telegram, {PARAMETER_TELEGRAM} characters", telegram),
        ("wait for the drive, 40003 at its default", wait),
        ("pause of 2 characters, and the telegram again", pause_ms() + telegram),
        ("second wait", wait),
        (f"exception 255, {EXCEPTION} characters", EXCEPTION * character),
    ]
    rows = [[name, f"{ms:.0f} ms"] for name, ms in steps]
    return table(["part", "time"], [*rows, ["together", f"{sum(ms for _, ms in steps):.0f} ms"]])


def line_times() -> str:
    rows = []
    for rate in sorted(card().rates.values()):
        silences = [f"{silence_ms(rate, name):.2f}" for name in ("t15", "t35")]
        longest = shortest_timeout(rate)
        rounded = math.ceil(max(longest) / ROUND_MS) * ROUND_MS
        rows.append(
            [rate, f"{character_ms(rate):.2f}", *silences, *(f"{t:.0f}" for t in longest), f"**{rounded}**"]
        )
    head = [
        "bit/s",
        "character",
        "t1.5",
        "t3.5",
        "exception 255",
        "text read",
        "text written",
        "shortest time-out",
    ]
    return table(head, rows)


# ---------------------------------------------------------------- pages

TABLES: dict[str, Callable[[], str]] = {
    "switches": switch_functions,
    "rates": rates,
    "formats": formats,
    "addresses": addresses,
    "loop-back-switches": loopback,
    "leds": leds,
    "drive-parameters": drive_parameters,
    "functions": function_list,
    "coils": coils,
    "control-word": lambda: word_bits("control"),
    "status-word": lambda: word_bits("status"),
    "control-words": control_words,
    "references": references,
    "local-registers": local_table,
    "parameter-addresses": parameter_addresses,
    "parameter-groups": parameter_groups,
    "data-types": data_types,
    "register-values": register_values,
    "conversion": conversion,
    "storage": storage,
    "index-word": index_word,
    "exceptions": exceptions,
    "defaults": defaults,
    "times": times,
    "line-times": line_times,
    "exception-steps": exception_steps,
    "example-list": example_list,
    "examples": worked_examples,
    **masters.tables(),
}


def with_tables(text: str) -> str:
    """A page with its tables made anew; HandbookError for an unknown name."""

    def fresh(block: re.Match) -> str:
        name = block[1]
        if name not in TABLES:
            raise HandbookError(f"no table '{name}'")
        return f"<!-- generated: {name} -->\n{NOTE}\n\n{TABLES[name]()}\n\n<!-- end -->"

    return BLOCK.sub(fresh, text)


def pages() -> list[Path]:
    """The pages with tables. Each table stands once."""
    found_in: dict[str, Path] = {}
    chosen = []
    for path in sorted(GUIDES.rglob("*.md")):
        text = path.read_text()
        names = [block[1] for block in BLOCK.finditer(text)]
        if text.count("<!-- generated: ") != len(names):
            raise HandbookError(f"{path.relative_to(PROJECT)}: a generated table without its end")
        for name in names:
            if name in found_in:
                raise HandbookError(f"table '{name}' stands twice: {found_in[name].name}, {path.name}")
            found_in[name] = path
        if names:
            chosen.append(path)
    if missing := TABLES.keys() - found_in.keys():
        raise HandbookError(f"no page has the table '{min(missing)}'")
    return chosen


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare only, exit 1 on a difference")
    check = parser.parse_args().check
    drifted = 0
    try:
        for path in pages():
            name = path.relative_to(PROJECT)
            old = path.read_text()
            try:
                new = with_tables(old)
            except HandbookError as error:
                raise HandbookError(f"{name}: {error}") from None
            if old == new:
                continue
            if check:
                drifted += 1
                print(f"{name} differs from its sources; run `make regs`", file=sys.stderr)
            else:
                path.write_text(new)
                print(f"wrote {name}")
    except HandbookError as error:
        print(f"handbook: {error}", file=sys.stderr)
        return 2
    except KeyError as error:
        print(f"handbook: {FACTS} has no entry {error}", file=sys.stderr)
        return 2
    return 1 if drifted else 0


if __name__ == "__main__":
    run_main("handbook", main)
