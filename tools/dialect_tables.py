# SPDX-License-Identifier: Apache-2.0
"""The tables of regs/dialects.toml in the guides, for tools/handbook.py."""

from __future__ import annotations

import re

from campaigns.masters.page import table
from regs.dialects import DEFAULT, DIALECTS, IMAGES, OPTIONS, Dialect, Image
from sw.rtu2fc.tables import FAULT


def image(one: Dialect, name: str = "") -> str:
    row = IMAGES.get(name, Image("", [one.name]))
    folder = row.folder(one.name)
    return f"`build/{folder + '/' if folder else ''}firmware.hex`" if one.name in row.dialects else "-"


def documents() -> str:
    return table(
        ["dialect", "document", "drives", "image for the standard memory"],
        [
            [f"`{name}`" + " (default)" * (name == DEFAULT), one.document, one.drives, image(one)]
            for name, one in DIALECTS.items()
        ],
    )


def refresh() -> str:
    def shown(one: Dialect, on: bool) -> str:
        usual = ("STATUS_REFRESH" in one.options) == on
        return f"{image(one)} (default)" if usual else image(one, "refresh" if on else "norefresh")

    rows = [[f"`{name}`", shown(one, True), shown(one, False)] for name, one in DIALECTS.items()]
    return table(["dialect", "with it", "without it"], rows)


def options() -> str:
    """Every option, and its image of the default dialect."""
    rows = []
    for option in OPTIONS.values():
        of = [image(DIALECTS[DEFAULT], name) for name, row in IMAGES.items() if [*row.set] == [option.name]]
        usual = [f"`{one.name}`" for one in DIALECTS.values() if option.name in one.options]
        rows.append(
            [
                option.name,
                re.sub(r" \([A-Z]+-\d+(, [A-Z]+-\d+)*\)", "", option.about),
                ", ".join(usual) or "none",
                ", ".join(one for one in of if one != "-") or "none",
            ]
        )
    return table(["option", "meaning", "on by default in", "image of `card` with another value"], rows)


def difference(one: Dialect) -> dict[str, str]:
    traits, by_size = one.traits, one.traits["text_by_size"]
    silent, fault = traits["drive_silent"], traits["drive_fault"]
    return {
        "": f"`{one.name}`",
        "parameter numbers": f"1…{traits['pnu_max']}" + " (bit 11 of PKE)" * (traits["pnu_max"] > 2047),
        "index of an array": f"low byte of {40001 + traits['index_register']}",
        "40001": "absent" if by_size else "IND: index, and 04 / 05 for text",
        "40002, 40003": "time-outs",
        "text": "3…10 registers; 1…2 see below" if by_size else "1…10 registers after 40001 = 04xx or 05xx",
        "no answer from the drive": f"exception {silent}" if silent else "silence",
        "refused by the drive": f"always {fault}" if fault else "its fault number",
        "reads of coils 33-64": "ask the drive first"
        if "STATUS_REFRESH" in one.options
        else "the drive's last reply",
    }


def differences() -> str:
    columns = [difference(one) for one in DIALECTS.values()]
    heads, *rows = ([what, *(column[what] for column in columns)] for what in columns[0])
    return table(heads, rows)


# The handbook's meanings of exceptions, and the traits with their codes. Others are faults of the drive.
MEANINGS = {
    "unknown function code": "bad_function",
    "wrong length of the message": "bad_length",
    "wrong quantity": "bad_quantity",
    "no such coil or register": "bad_address",
    "value refused by the card": "bad_value",
    "no answer from the drive": "drive_silent",
}


def code(one: Dialect, meaning: str) -> str:
    if trait := MEANINGS.get(meaning):
        return str(one.traits[trait] or "silence")
    fault = next((n for n, text in FAULT.items() if meaning == f"drive: {text}"), 5)
    return str(one.traits["drive_fault"] or fault)


def with_codes(text: str) -> str:
    """A page with the codes of its table of exceptions made anew; the other columns are written by hand."""

    def fresh(found: re.Match) -> str:
        cells = found[0].strip("|").split(" | ")
        hand = cells[-3:]
        first, *others = (code(one, hand[0].strip()) for one in DIALECTS.values())
        return "| " + " | ".join([f"**{first}**", f"{int(first):02X}h", *others, *hand]) + "|"

    heads = " | ".join(f"`{name}`" for name in DIALECTS if name != DEFAULT)
    text = re.sub(r"(?<=^\| `card` \| hex \| ).*(?= \| meaning)", heads, text, flags=re.MULTILINE)
    return re.sub(r"^\| \*\*\d+\*\* \| [0-9A-F]{2}h \| .*\|$", fresh, text, flags=re.MULTILINE)


BLOCKS = {"dialects": documents, "options": options, "differences": differences, "status-images": refresh}
