# SPDX-License-Identifier: Apache-2.0
"""The data sheet: two pages as PDF and as HTML, from the measured pages and the sources.

    python -m tools.datasheet

Measured figures come from docs/evidence.json, with the card that they name. Ports and parameters come from
rtl/rtu2fc.v, configurations from configs.toml, boards from constraints/boards.toml. tools/datasheet.toml has
the makers' figures, and electrical notes with values of docs/guide/hardware.md. A missing figure is an error,
one line, exit 2. Chromium prints the PDF; its dates are fixed, so two runs give the same bytes.
"""

from __future__ import annotations

import html
import re
import subprocess
import tempfile
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaigns.bench import fingerprint
from campaigns.line_quality.limits import QUANTITIES
from constraints import image
from constraints.boards import CARD, PORT, boards
from regs.dialects import IMAGES
from regs.generated.card_tables import RATES
from rtl.command import VERSION, run_main
from rtl.report_page import evidence
from rtl.sources import ROOT, SourcesError, configurations, without_comments
from sim.harness.pins import BAUDS, FORMS
from tb.agents import rtu
from tb.model.card import DIAGNOSTICS, DIALECTS, FUNCTIONS
from tools import chromium
from tools import evidence as measured

OUT = ROOT / "build/datasheet"
TEMPLATE = ROOT / "tools/datasheet.html.in"
FACTS = ROOT / "tools/datasheet.toml"
HARDWARE = ROOT / "docs/guide/hardware.md"
SUITE = "conformance"  # page of the conformance suite
SUITE_CARDS = ("standard card", "tiny card")
PRINTED = {"bench", "line-quality", "synthesis", SUITE}  # the reports with its figures
PAGES = 2
SIZES = (1.0, 0.96, 0.92)
PARAMETER = re.compile(r"^\s*parameter\s+(?:\[[^\]]*\]\s*)?(\w+)\s*=\s*([^,\n]+)", re.MULTILINE)
CLOCK = re.compile(r"^// clk: CLK_HZ, (\d+ to \d+ MHz)\.", re.MULTILINE)
VALUE = re.compile(r"(?:[-\d.]+ to \+)?\d[\d.]*(?: (?:mA|V|MHz|ppm|kΩ|Ω|°C)\b| °C)")
# Chromium writes when it printed; both dates have the same length.
PDF_DATE = re.compile(rb"(/(?:Creation|Mod)Date \(D:)\d{14}\+00'00'")
FIXED_DATE = rb"\g<1>19700101000000+00'00'"

MEANING = {
    "CLK_HZ": "clock in Hz",
    "FIRMWARE_HEX": "firmware image",
    "SOFT_CORE": "0 PicoRV32, 1 SERV",
    "MEMORY_BYTES": "firmware memory",
    "LOCKSTEP": "1: PicoRV32 twice; 0 with SERV",
    "MASTER_LOSS_STOP": "1: may stop the drive",
    "EXTENDED_SWITCHES": "1: 38400, 115200, 8N1",
    "rst_n": "reset, active low",
    "sw_baud": "baud switches",
    "sw_addr": "address switches",
    "modbus_rx": "network: received data",
    "modbus_tx": "network: data to send",
    "modbus_de": "network: driver enable",
    "drive_rx": "drive: received data",
    "drive_tx": "drive: data to send",
    "drive_de": "drive: driver enable",
    "led_modbus_red": "network LED, red",
    "led_modbus_green": "network LED, green",
    "led_drive_red": "drive LED, red",
    "led_drive_green": "drive LED, green",
}
# Rows of the reports: begin of the first cell, and the words on the data sheet.
TARGETS = {
    "local request": "local reply, after t3.5",
    "telegram's first bit": "drive telegram, after t3.5",
    "reply's first bit": "reply, after the drive's last stop bit",
    "full transactions": "whole transaction, over the floor that its characters set",
    "no reply before t3.5": "no reply before t3.5",
    "a character between": "character between t1.5 and t3.5: nothing sent or changed",
    "cases: right bytes": "bytes and bits on both lines",
    "conformance rows": "conformance rows",
}
RULES = (
    "largest idle inside",
    "smallest idle after a foreign",
    "reply latency",
    "DE before",
    "baud tolerance",
)
RULES += ("parity error", "unsupported FC", "bad address", "noise byte", "0.3-bit glitch")
# Parts of the synthesis report, with the flow of the boards.
PARTS = ("**front end**", "**whole card**, `tiny`", "**whole card**, `standard`")


class DatasheetError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Table:
    name: str  # of its report
    header: list[str]
    rows: list[list[str]]

    def row(self, begin: str) -> list[str]:
        found = [row for row in self.rows if row[0].startswith(begin)]
        if len(found) != 1:
            raise DatasheetError(f"{self.name}: {len(found)} rows begin with {begin!r}, one is needed")
        return found[0]

    def column(self, begin: str) -> int:
        found = [n for n, name in enumerate(self.header) if name.startswith(begin)]
        if not found:
            raise DatasheetError(f"{self.name}: no column begins with {begin!r}")
        return found[0]


def figures(report: str, kind: str, name: str) -> Any:
    try:
        return evidence()[report][kind][name]
    except KeyError as error:
        raise DatasheetError(
            f"docs/evidence.json has no {error} of {report}; run `make evidence ONLY={report}`"
        ) from None


def of(report: str, subject: str) -> str:
    """The fingerprint of what a report was measured on."""
    return figures(report, "of", subject)


def table(report: str, heading: str) -> Table:
    """A table of a report; an empty heading: the one below its title."""
    header, *rows = figures(report, "tables", heading)
    return Table(report, header, rows)


# ---------------------------------------------------------------- HTML


def marked(text: str) -> str:
    """Bold and code of Markdown as HTML."""
    text = re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))
    return re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", text)


def as_html(header: list[str], rows: Iterable[Iterable[str]], own: int | None = None) -> str:
    """An HTML table; `own` is the column of this card."""

    def line(row: Iterable[str], kind: str) -> str:
        marks = {own: ' class="own"'} if kind == "td" else {}
        cells = [f"<{kind}{marks.get(n, '')}>{marked(cell)}</{kind}>" for n, cell in enumerate(row)]
        return f"<tr>{''.join(cells)}</tr>"

    head = [line(header, "th")] if any(header) else []
    return f"<table>{''.join([*head, *(line(row, 'td') for row in rows)])}</table>"


def meaning(name: str) -> str:
    if name == "clk":
        if not (found := CLOCK.search(CARD.read_text())):
            raise DatasheetError("the header of rtl/rtu2fc.v does not give the range of the clock")
        return f"clock, {found[1]}"
    if name not in MEANING:
        raise DatasheetError(f"tools/datasheet.py has no words for {name} of rtl/rtu2fc.v")
    return MEANING[name]


def parameters() -> str:
    text = without_comments(CARD).split(") (", 1)[0]
    rows = []
    for name, value in PARAMETER.findall(text):
        value = "configuration" if value.startswith("`CONFIG") else re.sub(r"^\d+'b", "", value.strip())
        rows.append([f"`{name}`", value.strip('"'), meaning(name)])
    return as_html(["name", "default", "meaning"], rows)


def ports() -> str:
    text = without_comments(CARD).split(");", 1)[0]
    rows = [
        [f"`{name}{f'[{high}:{low}]' if high else ''}`", way.removesuffix("put"), meaning(name)]
        for way, high, low, name in PORT.findall(text)
    ]
    return as_html(["port", "way", "meaning"], rows)


def configuration_rows() -> str:
    names = configurations()
    rows = [
        ["soft core", *(entry["soft_core"] for entry in names.values())],
        ["clock", *(f"{entry['clk_hz'] / 1e6:g} MHz" for entry in names.values())],
        ["firmware memory", *(f"{entry['memory_bytes'] // 1024} KiB" for entry in names.values())],
        ["first answer after reset", *(f"{entry['boot_ms']} ms" for entry in names.values())],
    ]
    return as_html(["", *(f"`{name}`" for name in names)], rows)


def target_rows() -> str:
    found = table("bench", "The targets")
    rows = []
    for begin, words in TARGETS.items():
        _, target, worst, verdict, of = found.row(begin)
        rows.append([words, target, worst, verdict, of])
    return as_html(["promise", "target", "worst measured", "verdict", "of"], rows)


def resources() -> tuple[str, str]:
    """The table, and the sentence below it."""
    found = table("synthesis", "")
    by_name = {row[0].strip("`"): row for row in found.rows}
    wanted = ("configuration", "LUT4", "FF", "cells", "block RAMs", "Fmax, MHz", "clock, MHz")
    columns = [found.column(name) for name in wanted]
    rows = []
    for name, entry in boards().items():
        row = by_name.get(name)
        missing = [f"`{entry.config}`", "not measured yet", *["-"] * (len(wanted) - 2)]
        values = [row[n] for n in columns] if row else missing
        rows.append([f"`{name}`", entry.part, *values])
    parts = table("synthesis", "Share of each part")
    counts = (parts.column("MachXO2 ours"), parts.column("iCE40 ours"))
    words = "; ".join(
        f"{name.replace('*', '').replace('`', '')} {' / '.join(parts.row(name)[n] for n in counts)}"
        for name in PARTS
    )
    note = f"Design {of('synthesis', 'design')}. Cells on MachXO2 / iCE40: {words}."
    return as_html(["board", "part", *wanted], rows), html.escape(note)


def conformance() -> str:
    found = table("bench", "Conformance")
    kept = [0, found.column("**rtu2fc 8E1**"), found.column("as the specification")]
    return as_html(
        ["", "rtu2fc 8E1", "specification"], ([found.row(begin)[n] for n in kept] for begin in RULES), own=1
    )


def suite() -> str:
    """One sentence with the suite's results of both cards."""
    found = table(SUITE, "")
    counts = [(name, found.column(name)) for name in ("passed", "own code", "failed")]
    cards = [
        f"{html.escape(row[0])} {', '.join(f'{row[n]} {name}' for name, n in counts)}"
        for row in found.rows
        if row[0] in SUITE_CARDS and row[found.column("by")] == "pins"
    ]
    if len(cards) != len(SUITE_CARDS):
        raise DatasheetError(f"{SUITE}: no result of both cards on the pins; run `make conformance`")
    return f"The conformance suite, on the pins: {'; '.join(cards)}."


COMMERCIAL = {
    "end": "a request ends after",
    "reply": "reply after a request",
    "tolerance": "rate error taken",
}


def commercial(facts: dict) -> str:
    """This card's row from the reports, the others by their documents."""
    conform, line = table("bench", "Conformance"), table("line-quality", "")
    own = conform.column("**rtu2fc 8E1**")
    worst = table("bench", "The targets").row("local request")[2]
    rows = [
        [
            "**rtu2fc**",
            "measured",
            f"{conform.row('smallest idle after a foreign')[own]} bits",
            f"3.5 characters + {worst} bit at most",
            line.row("sender slow")[1],
        ]
    ]
    for entry in facts["commercial"]:
        rows.append(
            [entry["name"], entry["document"], *(entry.get(key, "not published") for key in COMMERCIAL)]
        )
        rows[-1].append("not published")
    rows[0].append(table("bench", "The targets").row("conformance rows")[4])
    return as_html(["product", "source", *COMMERCIAL.values(), "conformance test"], rows)


def electrical(facts: dict) -> str:
    """The notes of datasheet.toml. Their values are those of the hardware guide."""
    guide = HARDWARE.read_text().replace("\N{MINUS SIGN}", "-")
    for note in facts["electrical"]:
        for value in VALUE.findall(note["text"]):
            if not re.search(rf"(?<![\d.]){re.escape(value)}(?!\w)", guide):
                raise DatasheetError(
                    f"docs/guide/hardware.md does not have {value}, the data sheet's {note['subject']}"
                )
    return as_html([""], [[f"**{note['subject']}**", note["text"]] for note in facts["electrical"]])


def hexadecimal(functions: Iterable[int]) -> str:
    return ", ".join(f"{function:02X}" for function in sorted(functions))


def images() -> str:
    """Of each board: the file's suffix, the firmware that fits, the order code of the part."""
    rows = []
    for name, entry in boards().items():
        firmware = "card"
        if entry.config == "standard":
            # MASTER_LOSS_STOP alone does nothing in these designs (SAFE-7).
            more = [
                f"{dialect}-{one.name.rpartition('/')[2]}"
                for one in IMAGES.values()
                for dialect in one.dialects
                if one.name.startswith("large/") == bool(entry.memory_bytes) and one.name != "stop"
            ]
            firmware = ", ".join([*DIALECTS, *more]).replace("_", "-")
        suffix = image.result_suffix(entry)
        rows.append(
            [f"`{name}`", entry.part, f"{suffix}, .jed" if entry.family == "machxo2" else suffix, firmware]
        )
    return as_html(["BOARD", "for the part", "SUFFIX", "FIRMWARE"], rows)


def older() -> str:
    """A notice if a report is of an older card."""
    found = [name for name in measured.older() if name in PRINTED]
    if not found:
        return ""
    commands = ", ".join(f"<code>make evidence ONLY={name}</code>" for name in found)
    return (
        f'<p class="notice older"><b>Figures of an older card:</b> {", ".join(found)}. They are printed as '
        f"measured, with the card that they name. To renew them: {commands}.</p>"
    )


def page() -> str:
    """The data sheet as one HTML file without links to others."""
    facts = tomllib.loads(FACTS.read_text())
    resource_table, design = resources()
    turnaround, line = table("bench", "Turnaround, rate by rate"), table("line-quality", "")
    rates = sorted({rate.baud for rate in RATES.values()})
    measured = "`, firmware `".join(of("bench", subject) for subject in ("standard card", "firmware"))
    content = {
        "version": VERSION.read_text().strip(),
        "card": fingerprint.card(),
        "tiny": fingerprint.card("tiny"),
        "rates": ", ".join(map(str, rates)),
        "formats": ", ".join(form for form in sorted(FORMS) if form != "8N1"),
        "more_rates": " and ".join(map(str, sorted(set(BAUDS) - set(rates)))),
        "functions": hexadecimal(FUNCTIONS),
        "more_functions": hexadecimal(DIAGNOSTICS).replace("2B", "2B/0E"),
        "dialects": ", ".join(f"<code>{name}</code>" for name in DIALECTS),
        "fast_times": " and ".join(f"{time(max(BAUDS)) / 1e6:g}" for time in (rtu.t15_ps, rtu.t35_ps)),
        "older": older(),
        "configurations": configuration_rows(),
        "parameters": parameters(),
        "line_rates": f"{min(BAUDS)} to {max(BAUDS)}",
        "ports": ports(),
        "electrical": electrical(facts),
        "targets": target_rows(),
        "turnaround": as_html(turnaround.header, turnaround.rows),
        "bench": marked(f"`{measured}`"),
        "line": as_html(["limit", "least found", "promise"], [[row[0], row[1], row[3]] for row in line.rows]),
        "line_steps": f"{QUANTITIES['glitch'].resolution:g}",
        "line_card": marked(f"`{of('line-quality', 'standard card')}`"),
        "resources": resource_table,
        "design": design,
        "conformance": conformance(),
        "suite": suite(),
        "commercial": commercial(facts),
        "images": images(),
    }
    return re.sub(r"\{(\w+)\}", lambda found: content[found[1]], TEMPLATE.read_text())


def pdf(text: str, folder: Path) -> bytes:
    """The page as Chromium prints it, without the time of printing; smaller if it needs more sheets."""
    sheets = 0
    for size in SIZES:
        smaller = f"<style>@media print {{ body {{ zoom: {size}; }} }}</style></head>"
        try:
            printed = chromium.print_pdf(text.replace("</head>", smaller, 1), folder)
        except (chromium.Missing, subprocess.SubprocessError) as error:
            raise DatasheetError(str(error).splitlines()[0]) from None
        printed, dates = PDF_DATE.subn(FIXED_DATE, printed)
        if dates != 2:
            raise DatasheetError(f"the PDF has {dates} dates, 2 are right")
        sheets = len(re.findall(rb"/Type /Page\b", printed))
        if sheets == PAGES:
            return printed
    raise DatasheetError(f"the PDF has {sheets} pages, {PAGES} are right")


def main() -> int:
    text = page()
    with tempfile.TemporaryDirectory() as work:
        printed = pdf(text, Path(work))
    OUT.mkdir(parents=True, exist_ok=True)
    for name, content in (("rtu2fc-datasheet.html", text.encode()), ("rtu2fc-datasheet.pdf", printed)):
        (OUT / name).write_bytes(content)
        print(f"wrote {(OUT / name).relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    run_main("datasheet", main, DatasheetError, SourcesError, OSError)
