# SPDX-License-Identifier: Apache-2.0
"""The sources of the owner's handbook as Python values, and the forms of its tables (tools/handbook.py).

Facts come from the code where the code has them: regs/card.toml, regs/fc.toml, configs.toml, sw/, rtl/,
tb/model. regs/handbook.toml has the others. Times are in ms. Registers and coils are numbered on-wire.
"""

from __future__ import annotations

import json
import re
import tomllib
from functools import cache

from regs.regs import CardTables
from rtl.sources import ROOT
from tb.model import card as model

FACTS = "regs/handbook.toml"
DIALECTS = ("card", "builtin", "hvac_basic")
MINUS = "\N{MINUS SIGN}"


class HandbookError(Exception):
    """A source or a page that does not fit; the message is one line."""


def source(name: str) -> str:
    return (ROOT / name).read_text()


def found(pattern: str, name: str) -> re.Match:
    """The only match of a pattern in a source."""
    matches = list(re.finditer(pattern, source(name), re.DOTALL))
    if len(matches) != 1:
        raise HandbookError(f"{name}: {len(matches)} times '{pattern}' instead of once")
    return matches[0]


def constant(name: str, file: str) -> int:
    """A number of a C file: `NAME = 12`, `NAME = 0x0C`, `NAME = TICKS(12)`, `NAME = OTHER + TICKS(12)`."""
    return int(found(rf"\b{name} = (?:\w+ \+ )?(?:TICKS\()?(0x[0-9A-Fa-f]+|\d+)", file)[1], 0)


@cache
def facts() -> dict:
    return tomllib.loads(source(FACTS))


@cache
def protocol() -> dict:
    return tomllib.loads(source("regs/fc.toml"))


@cache
def card() -> CardTables:
    return CardTables()


@cache
def examples() -> dict[str, dict]:
    return {example["id"]: example for example in json.loads(source("tb/model/examples.json"))}


@cache
def traits() -> dict[str, dict[str, int]]:
    """The rows of sw/src/dialect.h: dialect, field, number."""
    rows = re.findall(r"\[DIALECT_(\w+)\] = \{(.*?)\}", source("sw/src/dialect.h"), re.DOTALL)
    fields = {name.lower(): re.findall(r"\.(\w+) = (\w+)", body) for name, body in rows}
    if tuple(fields) != DIALECTS:
        raise HandbookError(f"sw/src/dialect.h has {', '.join(fields)} instead of {', '.join(DIALECTS)}")
    return {
        name: {field: int(value) for field, value in row if value.isdigit()} for name, row in fields.items()
    }


@cache
def local_registers() -> list[tuple[str, int]]:
    """Name and default of the card's own registers, from address 0 on, in the order of enum setting."""
    body = found(r"enum setting \{(.*?)\};", "sw/include/transaction.h")[1]
    names = re.findall(r"^\s+(LOCAL_\w+)", body.split("LOCAL_REGISTERS")[0], re.MULTILINE)
    defaults = dict.fromkeys(names, 0)
    for name in names[1:]:
        defaults[name] = constant(name.replace("LOCAL", "DEFAULT"), "sw/include/transaction.h")
    return list(defaults.items())


@cache
def functions() -> list[tuple[int, str, int]]:
    """Code, form (read, single, counted) and largest quantity of coils of each function; 0: registers."""
    codes = dict(
        re.findall(
            r"^\s+(\w+) = (0x\w+),", found(r"enum function_code \{(.*?)\};", "sw/src/codes.h")[1], re.M
        )
    )
    rows = re.findall(r"\{(\w+), FORM_(\w+), (\d+), \w+\}", source("sw/src/translate.c"))
    if sorted(codes) != sorted(name for name, _, _ in rows):
        raise HandbookError("sw/src/translate.c and sw/src/codes.h have different functions")
    return sorted((int(codes[name], 16), form.lower(), int(limit)) for name, form, limit in rows)


@cache
def coil_groups() -> dict[str, range]:
    """The coils of each part of the map, on-wire."""
    control, status = model.CONTROL, model.STATUS
    return {
        "control": control[:16],
        "reference": control[16:],
        "status": status[:16],
        "frequency": status[16:],
        "eeprom": range(model.EEPROM, model.EEPROM + 1),
        "reserved": range(model.EEPROM + 1, model.COILS),
    }


def loopback_switches() -> str:
    """Baud switches of the loop-back test, first switch first, 1 = ON."""
    return found(r"LOOPBACK_SWITCHES = 9'b([01_]+)", "rtl/supervisor.v")[1].replace("_", "")[::-1]


def address_max() -> int:
    """The largest unit address: the next one has the five upper switches ON."""
    return (int(found(r"addr\[8:4\] != 5'b([01]+)", "rtl/switch_sampler.v")[1], 2) << 3) - 1


def character_ms(rate: int) -> float:
    return card().line["character_bits"] * 1000 / rate


def silence_ms(rate: int, name: str) -> float:
    return card().silence_ticks(rate, name) * 1000 / (card().line["ticks_per_bit"] * rate)


def pause_ms() -> float:
    return card().drive["pause_characters"] * character_ms(card().drive["baud"])


@cache
def values() -> dict[str, object]:
    """The values that the words of regs/handbook.toml may name."""
    defaults = dict(local_registers())
    configs = tomllib.loads(source("configs.toml"))
    return {
        "address_max": address_max(),
        "bad_value": traits()["card"]["bad_value"],
        "boot_ms": configs["standard"]["boot_ms"],
        "boot_tiny_ms": configs["tiny"]["boot_ms"],
        "coils": model.COILS,
        "drive_address": int(found(r"#else\n#define ADR_DRIVE (0x\w+)u", "sw/include/options.h")[1], 16)
        & 0x7F,
        "drive_baud": card().drive["baud"],
        "drive_timeout": defaults["LOCAL_DRIVE_TIMEOUT"],
        "drive_timeout_ms": defaults["LOCAL_DRIVE_TIMEOUT"] * 10,
        "led_step": constant("STEP", "sw/src/leds.c"),
        "loopback_listen": constant("LISTEN", "sw/src/loopback.c") // 1000,
        "loopback_result": constant("RESULT", "sw/src/loopback.c") // 1000,
        "network_timeout": defaults["LOCAL_NETWORK_TIMEOUT"],
        "network_timeout_s": defaults["LOCAL_NETWORK_TIMEOUT"] // 100,
        "pause_ms": f"{pause_ms():.2f}",
    }


def filled(text: str) -> str:
    try:
        return text.format_map(values())
    except KeyError as error:
        raise HandbookError(f"{FACTS}: no value {error} for '{text}'") from None


# ---------------------------------------------------------------- forms


def table(head: list[str], rows: list[list[object]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(re.sub(r"\|  (?=\|)", "| ", line) for line in lines)


def word(value: int) -> str:
    return f"{value:04X}h"


def spaced(data: bytes) -> str:
    return data.hex(" ").upper()


def minus(number: object) -> str:
    return str(number).replace("-", MINUS)
