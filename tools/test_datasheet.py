# SPDX-License-Identifier: Apache-2.0
"""docs/reference/datasheet.md: ports, parameters and configurations of the card, images of a release."""

from __future__ import annotations

import re

import pytest

from constraints.boards import CARD, CARD_PARAMETER, PORT, boards
from constraints.image import result_suffix
from rtl.sources import ROOT, configurations, without_comments
from tools import digests

PAGE = (ROOT / "docs/reference/datasheet.md").read_text()


def rows(head: str) -> list[list[str]]:
    """The cells of the table that begins with this head."""
    (table,) = re.findall(rf"^\| {head}.*\n\|-.*\n((?:\|.*\n)+)", PAGE, re.MULTILINE)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]


def test_ports_and_parameters_are_those_of_the_card():
    code = without_comments(CARD)
    bits = {name: f"{name}[{high}:{low}]" if high else name for _, high, low, name in PORT.findall(code)}
    ways = {bits[name]: way.removesuffix("put") for way, _, _, name in PORT.findall(code)}
    shown = {name: way for ports, way, _ in rows("port") for name in re.findall("`(.+?)`", ports)}
    assert shown == ways and len(ways) == 14
    defaults = dict(re.findall(r"^ *parameter (\w+) = (.+?),? *$", code, re.MULTILINE))
    for name, value, meaning in rows("parameter"):
        said = defaults.pop(name.strip("`")).strip('"')
        assert value.strip("`") == ("configuration" if said.startswith("`CONFIG") else said) and meaning
    assert not defaults and len(CARD_PARAMETER.findall(code)) == len(rows("parameter"))


def test_configurations_are_those_of_the_table():
    shown = {name.strip("`"): (core.split(",")[0].lower(), *cells) for name, core, *cells in rows("config")}
    assert shown == {
        name: (
            entry["soft_core"],
            f"{entry['clk_hz'] / 1e6:g} MHz",
            f"{entry['memory_bytes'] // 1024} KiB",
            f"{entry['boot_ms']} ms",
        )
        for name, entry in configurations().items()
    }


@pytest.mark.nightly
def test_the_images_are_those_of_a_release():
    """No image with MASTER_LOSS_STOP alone, which does nothing in these designs."""
    made = digests.firmware("-s")  # other tests read the images meanwhile
    listed = {board: row for row in rows("BOARD") for board in re.findall("`(.+?)`", row[0])}
    assert listed.keys() == boards().keys()
    dialects = ("card", "builtin", "hvac-basic")
    for name, entry in boards().items():
        _, suffix, lockstep, firmware = listed[name]
        cores = int(configurations()[entry.config]["soft_core"] == "picorv32")
        assert lockstep == str(entry.parameters.get("LOCKSTEP", cores))
        firmware = listed["icebreaker"][3] if firmware.startswith("as for") else firmware
        named = re.findall("`(.+?)`", firmware)
        ends = ["", *(end for end in named if end.startswith("-"))]
        wanted = {one + end for one in (dialects if len(named) > 1 else ("card",)) for end in ends}
        wanted |= {one for one in named if "-" in one[1:] and not one.startswith("-")}
        assert {image.name for image in digests.fitting(entry, made)} == wanted
        assert suffix == f"`{result_suffix(entry)}`"
