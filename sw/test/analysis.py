# SPDX-License-Identifier: Apache-2.0
"""Static analysis of the firmware in every dialect; part of `make lint`.

    python -m sw.test.analysis   prints the findings, a line each; exit 1 if there are any

Runs gcc -fanalyzer, cppcheck and clang-tidy, and looks for loops without a stated bound.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path

from rtl.command import run_main, threads
from sw.test.host import BUILDS, DIALECTS, INCLUDES, ROOT

CPPCHECK, CROSS = "cppcheck", "riscv64-unknown-elf-gcc"
CARD = ["-Os", "-march=rv32i", "-mabi=ilp32", "-ffreestanding", "-Isw/port/card"]
WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
SHARED = ("sw/include", "sw/src", "regs/generated")


def run(tree: Path, command: Iterable[str | Path]) -> list[str]:
    """The findings of a tool, a line each."""
    done = subprocess.run(list(map(str, command)), cwd=tree, capture_output=True, text=True, check=False)
    lines = [line for line in (done.stdout + done.stderr).splitlines() if ": " in line]
    return lines or [f"{command[0]}: exit code {done.returncode}"] if done.returncode else []


def all_of(tree: Path, commands: Iterable[list[str | Path]]) -> list[str]:
    with threads(os.cpu_count() or 1) as pool:
        said = pool.map(lambda command: run(tree, command), commands)
        return list(dict.fromkeys(line for lines in said for line in lines))


def card_sources(tree: Path) -> list[str]:
    return sorted(str(path.relative_to(tree)) for path in (tree / "sw/src").glob("*.c"))


def test_sources(tree: Path) -> list[str]:
    found = [*(tree / "sw/port/host").glob("*.c"), *(tree / "sw/test").glob("*.c")]
    return sorted(str(path.relative_to(tree)) for path in found)


def gcc_analyzer(tree: Path = ROOT) -> list[str]:
    """Each file in each dialect, with the compiler and the options of the card."""
    includes = [f"-I{folder}" for folder in SHARED]
    return all_of(
        tree,
        [
            [CROSS, *WARNINGS, "-fanalyzer", *CARD, *includes, *BUILDS[name], "-c", source, "-o", os.devnull]
            for name in DIALECTS
            for source in card_sources(tree)
        ],
    )


def cppcheck(tree: Path = ROOT) -> list[str]:
    options = ["--quiet", "--std=c99", "--enable=warning,style,performance,portability", "--inconclusive"]
    options += ["--error-exitcode=1", "--inline-suppr", *INCLUDES, "-Isw/test"]
    files = card_sources(tree) + test_sources(tree)
    return all_of(tree, [[CPPCHECK, *options, *BUILDS[name], *files] for name in DIALECTS])


def clang_tidy(tree: Path = ROOT) -> list[str]:
    """With the checks of sw/.clang-tidy."""
    # Debian names it by number; tools/setup.sh knows which one is there.
    found = subprocess.run(
        [ROOT / "tools/setup.sh", "--command", "clang-tidy"], capture_output=True, text=True, check=False
    )
    if found.returncode:
        return found.stderr.splitlines()
    tidy = found.stdout.strip()
    options = ["--", "-std=c99", *INCLUDES, "-Isw/test"]
    files = card_sources(tree) + test_sources(tree)
    return all_of(
        tree, [[tidy, "--quiet", source, *options, *BUILDS[name]] for name in DIALECTS for source in files]
    )


LOOP = re.compile(r"^(?!.*} while)\s*(?:.*\)|else)?\s*\b(for|while|do)\b[ ({]")
BOUND = re.compile(r"/\* (at most \d+ turns|endless): .*\*/")


def unbounded(tree: Path = ROOT) -> list[str]:
    """Loops of the card without a comment that states their bound, on their line or on the one above."""
    found = []
    for path in [*(tree / source for source in card_sources(tree)), *(tree / "sw/port/card").glob("*.[ch]")]:
        lines = ["", *path.read_text().splitlines()]
        for number, (above, line) in enumerate(pairwise(lines), 1):
            stated = BOUND.search(line) or (above.strip().startswith("/*") and BOUND.search(above))
            if LOOP.match(re.sub(r"/\*.*", "", line)) and not stated:
                found.append(f"{path.relative_to(tree)}:{number}: no bound for `{line.strip()}`")
    return found


CHECKS: list[tuple[str, Callable[..., list[str]]]] = [
    ("gcc -fanalyzer", gcc_analyzer),
    ("cppcheck", cppcheck),
    ("clang-tidy", clang_tidy),
    ("loops bounded", unbounded),
]


def main() -> int:
    wrong = [f"{title}: {line}" for title, check in CHECKS for line in check()]
    print("\n".join(wrong) or "clean")
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("analysis", main)
