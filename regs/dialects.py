# SPDX-License-Identifier: Apache-2.0
"""Dialects, options and images of the firmware: regs/dialects.toml, and its rows in other files.

Rows stand in a file between a line with `by make regs: NAME` and the next line with `end of NAME`.
"""

from __future__ import annotations

import re
import textwrap
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TABLE = "regs/dialects.toml"
# Errors of a request, and the trait with the code of each. No trait: the drive's own number, or no answer.
CODES = {
    **{"function": "bad_function", "length": "bad_length", "quantity": "bad_quantity"},
    **{"address": "bad_address", "value": "bad_value", "drive": "drive_fault", "silent": "drive_silent"},
}


@dataclass(frozen=True)
class Dialect:
    name: str
    about: str
    document: str
    page: str
    drives: str
    profiles: list[str]
    options: list[str]
    traits: dict[str, int | bool]

    @property
    def macro(self) -> str:
        return f"DIALECT_{self.name.upper()}"


@dataclass(frozen=True)
class Option:
    name: str
    about: str
    most: int = 1
    unit: str = ""
    tried: int = 1


@dataclass(frozen=True)
class Image:
    """Images of one set of options, below build/NAME; an empty name is that of the default options."""

    name: str
    dialects: list[str]
    set: dict[str, int] = field(default_factory=dict)
    flag: str = ""
    help: str = ""

    def folder(self, dialect: str) -> str:
        """Of the image of a dialect, below build."""
        return "/".join(part for part in (self.name, "" if dialect == DEFAULT else dialect) if part)


_TABLE = tomllib.loads((ROOT / TABLE).read_text(encoding="utf-8"))
DIALECTS = {name: Dialect(name, **row) for name, row in _TABLE["dialect"].items()}
OPTIONS = {name: Option(name, **row) for name, row in _TABLE["option"].items()}
DEFAULT = next(iter(DIALECTS))
IMAGES = {name: Image(name, **row) for name, row in _TABLE["image"].items()}
FLAGS = [image for image in IMAGES.values() if image.flag]


def folder_with(**values: int) -> str:
    """Below build, of the images that differ from the default by these options alone."""
    return next(image.name for image in IMAGES.values() if image.set == values)


def having(**traits: int | bool) -> tuple[str, ...]:
    """The dialects with these traits."""
    return tuple(name for name, one in DIALECTS.items() if traits.items() <= one.traits.items())


STANDARD, *_ = having(bad_function=1)  # the first dialect with the exception codes of the Modbus standard
STANDARD_DRIVE = DIALECTS[STANDARD].profiles[0]


def c_options() -> list[str]:
    lines = [f"#define {one.macro} {number}" for number, one in enumerate(DIALECTS.values())]
    first, *_, last = (one.macro for one in DIALECTS.values())
    lines += ["", "#ifndef DIALECT", f"#define DIALECT {first}", "#endif"]
    lines += [f"#if DIALECT < {first} || DIALECT > {last}", '#error "DIALECT: unknown dialect"', "#endif"]
    for option in OPTIONS.values():
        text = f"{'1: ' if option.most == 1 else ''}{option.about}"
        lines += ["", *comment(text), f"#ifndef {option.name}"]
        lines += [f"#define {option.name} {default(option.name)}", "#endif"]
        if option.most > 1:
            lines += [f"#if {option.name} < 0 || {option.name} > {option.most}"]
            lines += [f'#error "{option.name}: 0 to {option.most} {option.unit}"', "#endif"]
    return lines


def comment(text: str) -> list[str]:
    if len(text) < 112:
        return [f"/* {text}. */"]
    return ["/*", *textwrap.wrap(f"{text}.", 118, initial_indent=" * ", subsequent_indent=" * "), " */"]


def default(option: str) -> str:
    """0, or a condition on the dialect."""
    on = [one.macro for one in DIALECTS.values() if option in one.options]
    off = [one.macro for one in DIALECTS.values() if option not in one.options]
    if not on or not off:
        return str(int(not off))
    if len(off) == 1:
        return f"(DIALECT != {off[0]})"
    return f"({' || '.join(f'DIALECT == {macro}' for macro in on)})"


def c_rows() -> list[str]:
    lines = ["static const struct traits dialects[] = {"]
    for one in DIALECTS.values():
        lines.append(f"    [{one.macro}] = {{")
        lines += [f"        .{name} = {str(value).lower()}," for name, value in one.traits.items()]
        lines.append("    },")
    return [*lines, "};"]


def folders(one: Dialect) -> list[str]:
    """The image with the default options, then that of each of FLAGS: C strings, nullptr if there is none."""
    found = [Image("", []).folder(one.name)]
    for image in FLAGS:
        ((option, value),) = image.set.items()
        as_is = value == (option in one.options)
        found.append(image.folder(one.name) if one.name in image.dialects else found[0] if as_is else None)
    return ["nullptr" if path is None else f'"/{path}"' if path else '""' for path in found]


def cpp_rows() -> list[str]:
    lines = ["inline const std::vector<Flag> kFlags = {"]
    lines += [f'    {{"{image.flag}", "{image.help}"}},' for image in FLAGS]
    lines += ["};", "", "inline const std::vector<Dialect> kDialects = {"]
    for one in DIALECTS.values():
        standard = str(bool(one.traits["drive_fault"])).lower()
        lines.append(f'    {{"{one.name}", "{one.about}", "{one.profiles[0]}", {standard},')
        lines.append(f"     {{{', '.join(folders(one))}}}}},")
    return [*lines, "};"]


def python_rows() -> list[str]:
    """The exception codes by their reason, and the traits that a master sees."""
    lines = ["DIALECTS = {"]
    for one in DIALECTS.values():
        codes = {why: one.traits[trait] for why, trait in CODES.items() if one.traits[trait]}
        shown = str(codes).replace("'", '"')
        lines += [
            f'    "{one.name}": Dialect(',
            f"        {shown},",
            f"        index_register={one.traits['index_register']},",
            f"        text_by_size={one.traits['text_by_size']},",
            f'        drive="{one.profiles[0]}",',
            f"        options={tuple(one.options)},".replace("'", '"'),
            "    ),",
        ]
    return [*lines, "}"]


def make_rows() -> list[str]:
    """Folders of the images, and what each is built with."""
    lines = [
        f"FIRMWARE_DIALECTS := {' '.join(name for name in DIALECTS if name != DEFAULT)}",
        "FIRMWARE_FOLDERS := build $(FIRMWARE_DIALECTS:%=build/%)",
        "FIRMWARE_LARGE := build/large $(FIRMWARE_DIALECTS:%=build/large/%)",
    ]
    for image in IMAGES.values():
        folders = " ".join(f"build/{image.folder(name)}" for name in image.dialects)
        lines.append(f"FIRMWARE_{'LARGE' if image.name.startswith('large/') else 'FOLDERS'} += {folders}")
        values = " ".join(f"-D{option}={value}" for option, value in image.set.items())
        lines.append(f"build/{image.name}/%: FIRMWARE_BY_NAME := {values}")
    return lines


ROWS = {
    "sw/include/options.h": ("options", c_options),
    "sw/src/dialect.h": ("dialects", c_rows),
    "sim/card/dialect.h": ("dialects", cpp_rows),
    "sw/rtu2fc/dialects.py": ("dialects", python_rows),
    "sw/firmware.mk": ("images", make_rows),
}


def with_rows(path: str, name: str, rows: list[str], source: str = TABLE) -> str:
    """A file with its rows made anew."""
    place = rf"(^.*by make regs: {name}\b.*\n)(?:.*\n)*?(?=.*end of {name}\b)"
    text, count = re.subn(
        place,
        lambda found: found[1] + "".join(f"{line}\n" for line in rows),
        (ROOT / path).read_text(encoding="utf-8"),
        flags=re.MULTILINE,
    )
    if count != 1:
        raise ValueError(f"{path} has no place for the rows of {source}")
    return text


def generate() -> dict[str, str]:
    return {path: with_rows(path, name, rows()) for path, (name, rows) in ROWS.items()}
