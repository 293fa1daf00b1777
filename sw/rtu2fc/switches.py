# SPDX-License-Identifier: Apache-2.0
"""Positions of the card's switches for a rate, a format and a unit (LINE-2, LINE-3, LINE-7)."""

from __future__ import annotations

from .card_tables import EXTENDED_FORMATS, EXTENDED_RATES

LETTERS = {"none": "N", "even": "E", "odd": "O"}
# Rate and format to the positions of baud switches 1-3 and 4-5, 1 = ON.
BAUDS = {rate.baud: switches for switches, rate in EXTENDED_RATES.items()}
FORMS = {f"8{LETTERS[form.parity]}{form.stop_bits}": switches for switches, form in EXTENDED_FORMATS.items()}
EXTENDED = (38400, 115200, "8N1")


def address(unit: int) -> str:
    """Address switches 1-8."""
    return f"{unit:08b}"[::-1]


def picture(title: str, positions: str, fixed: str = "") -> list[str]:
    """A block of switches from the front; `fixed` are those whose position does not matter."""
    whole = positions + fixed
    cells = ["".join(f" {'#' if on == up else '.'} " for on in whole) for up in ("1", "0")]
    return [
        title,
        f"       ON  |{cells[0]}|",
        f"       OFF |{cells[1]}|",
        "            " + "".join(f" {number} " for number in range(1, len(whole) + 1)),
    ]


def lines(baud: int, form: str, unit: int) -> list[str]:
    said = [
        *picture(
            "Baud switches: 1-3 rate, 4-5 format, leave one of 6-9 OFF", BAUDS[baud] + FORMS[form], "0000"
        ),
        "",
        *picture(
            "Address switches: 1-8 unit, 9 termination (ON at both ends of the bus)", address(unit), "0"
        ),
        "",
        "# is the position of the switch. The card reads them at power-up only.",
        "Inside a drive: switch it off and wait 14 minutes before you touch them.",
    ]
    if baud in EXTENDED or form in EXTENDED:
        said.append(f"{baud} {form} needs a card with EXTENDED_SWITCHES = 1.")
    return said
