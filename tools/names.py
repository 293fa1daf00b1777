# SPDX-License-Identifier: Apache-2.0
"""Whether a test name fits any test, before anything is built, and which tools those tests need.

    python -m tools.names COMMAND TEST [--sim SIM] [--card CARD]     exit 2, with one line, when no test fits

It prints the layers of tools/setup.sh that the tests need beside `test`, from their mark `nightly`.

TEST is an expression of `pytest -k`, or the name of a test file. A plain word that occurs in no test file is
refused at once; all else is left to pytest, which collects the tests (about 10 s).
"""

from __future__ import annotations

import argparse
import difflib
import re
import sys

from rtl.command import run_main
from rtl.sources import ROOT
from tools.trace import chosen

FOLDERS = ("campaigns", "constraints", "formal", "regs", "sim", "sw", "tb", "tools")
NAME = re.compile(r"^(?:async )?def (test_\w+)", re.MULTILINE)


def texts() -> dict[str, str]:
    paths = [path for folder in FOLDERS for path in (ROOT / folder).rglob("test_*.py")]
    return {path.stem: path.read_text() for path in paths}


def unknown_words(expression: str, files: dict[str, str]) -> list[str]:
    """The words of the expression that stand in no test file and in no file name."""
    text = "\n".join([*(f"{stem}.py" for stem in files), *files.values()]).lower()
    words = [word for word in re.findall(r"[\w.-]+", expression) if word not in ("and", "or", "not")]
    return [word for word in words if word.lower() not in text]


def nearest(word: str, files: dict[str, str]) -> str:
    word = word.removesuffix(".py")
    names = {name.removeprefix("test_") for text in files.values() for name in NAME.findall(text)}
    names |= {stem.removeprefix("test_") for stem in files}
    found = difflib.get_close_matches(word.removeprefix("test_"), sorted(names), n=3, cutoff=0.6)
    return f"; near it: {', '.join(found)}" if found else ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command")
    parser.add_argument("test")
    parser.add_argument("--sim")
    parser.add_argument("--card")
    options = parser.parse_args()
    files = texts()
    where = f" on {options.sim}" if options.sim else ""
    for word in unknown_words(options.test, files):
        print(f"{options.command}: no test has '{word}' in its name{nearest(word, files)}", file=sys.stderr)
        return 2
    choice = [f"--{name}={value}" for name in ("sim", "card") if (value := getattr(options, name))]
    collector, code, _ = chosen("--all", *choice, "-k", options.test)
    if code:
        print(f"{options.command}: no test{where} fits '{options.test}'", file=sys.stderr)
        return 2
    print(*sorted(collector.layers))
    return 0


if __name__ == "__main__":
    run_main("names", main)
