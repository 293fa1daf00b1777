# SPDX-License-Identifier: Apache-2.0
"""The texts of the FC protocol for dissector, decoder and virtual card, from regs/fc.toml."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WORDS = "regs/fc.toml"
# Texts of a bit that mean nothing without its name, and those that only deny.
BARE = ("1", "yes", "on", "ready", "possible", "warning", "at the limit", "in range")
DENIALS = ("0", "off", "out of range")


def banner(comment: str, source: str = WORDS, end: str = "", that: str = "that") -> str:
    """The first two lines of a generated file."""
    return (
        f"{comment} SPDX-License-Identifier: Apache-2.0{end}\n"
        f"{comment} Generated from {source} by `make regs`; edit {that}, not this one.{end}\n"
    )


def quoted(text: str) -> str:
    """String literal for Lua and C."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def phrase(bit: dict, text: str) -> str:
    """What a bit says in a list of bits: nothing when it denies, its name when the text is bare."""
    if text in DENIALS or text.split()[0] in ("no", "not"):
        return ""
    if text not in BARE:
        return text
    return f"bit {bit['bit']}" if bit["name"] in ("Not in use", "No function") else bit["name"]


def lua(words: dict) -> str:
    lines = [banner("--").rstrip(), "", "local t = {}", ""]
    for name in ("request", "reply", "fault"):
        lines.append(f"t.{name} = {{")
        lines += [f"  [{number}] = {quoted(text)}," for number, text in words[name].items()]
        lines += ["}", ""]
    for name in ("control", "status"):
        lines.append(f"t.{name} = {{")
        for key, bit in words[name].items():
            only = f", only = {quoted(bit['only'])}" if "only" in bit else ""
            lines.append(
                f"  {{ id = {quoted(key)}, bit = {bit['bit']}, name = {quoted(bit['name'])}, "
                f"zero = {quoted(bit['zero'])}, one = {quoted(bit['one'])}{only} }},"
            )
        lines += ["}", ""]
    drives = ", ".join(quoted(path.stem) for path in sorted((ROOT / "sim/drive").glob("*.csv")))
    lines += [f"t.drive_names = {{ {drives} }}", "", "return t"]
    return "\n".join(lines) + "\n"


def python(words: dict) -> str:
    lines = [banner("#").rstrip(), ""]
    for name in ("request", "reply", "fault"):
        lines.append(f"{name.upper()} = {{")
        lines += [f"    {number}: {quoted(text)}," for number, text in words[name].items()]
        lines += ["}", ""]
    lines.append('# Bit, the kind of drive that has it, the phrases for 0 and 1; "" says nothing.')
    for name in ("control", "status"):
        lines.append(f"{name.upper()} = (")
        for bit in words[name].values():
            only = quoted(bit["only"]) if "only" in bit else "None"
            phrases = ", ".join(quoted(phrase(bit, bit[value])) for value in ("zero", "one"))
            lines.append(f"    ({bit['bit']}, {only}, {phrases}),")
        lines += [")", ""]
    return "\n".join(lines).rstrip() + "\n"


def cpp(words: dict) -> str:
    lines = [
        banner("//").rstrip(),
        "",
        "#ifndef FC_WORDS_H",
        "#define FC_WORDS_H",
        "",
        "namespace fc_words {",
        "",
        "struct Fault {",
        "  unsigned number;  // PWE low of a reply with AK 7",
        "  const char* name;",
        "};",
        "",
        "constexpr Fault kFaults[] = {",
        *(f"    {{{number}, {quoted(text)}}}," for number, text in words["fault"].items()),
        "};",
        "",
        "}  // namespace fc_words",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def generate() -> dict[str, str]:
    """Maps the path of each generated file, relative to the repository, to its text."""
    words = tomllib.loads((ROOT / WORDS).read_text())
    return {
        "regs/generated/fc_tables.lua": lua(words),
        "regs/generated/fc_words.h": cpp(words),
        "sw/rtu2fc/tables.py": python(words),
    }
