# SPDX-License-Identifier: Apache-2.0
"""Every static check of the project, one line each; exit 1 when one fails.

    python -m tools.lint            checks
    python -m tools.lint --format   lays Verilog and Python files out the way the checks want them

The warnings of C and C++ have no line here: they are errors in the builds.
"""

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from constraints.boards import boards
from rtl.command import run_main
from rtl.sources import ROOT, SourcesError, card_files, configurations, needed_files, rtl_files
from tools import trace
from tools.prose import SOURCES, project_files

TOP = "rtu2fc"
EXAMPLE = sorted((ROOT / "docs/example").glob("*.v"))
# From the top down: a module may import what stands below it or in its own line.
LAYERS = (
    ("tools",),
    ("campaigns",),
    ("sw.test", "formal"),
    ("tb.gates",),
    ("tb.lib",),
    ("sim.card", "sim.view", "constraints"),
    ("sim.harness", "sim.drive"),
    ("tb.model",),
    ("sw.tools", "regs"),
    ("rtl",),
    # Packages of their own: they import nothing of ours.
    ("sw.rtu2fc", "sw.conformance"),
    ("tb.agents",),
)
GENERATORS = ("regs.regs", "constraints.boards", "tools.handbook")
UNFINISHED = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b")
SKIPPED = re.compile(r"\b(skipif|xfail|mark\.skip|pytest\.skip|cocotb\.skip)\b|\bskip=True")
SOMEWHERE = re.compile(r"(?<![\w.-])/(home|root|tmp|work)/\w")
OUR_OWN = Path(__file__).name


def source_files() -> list[Path]:
    """Every text file of our own that carries code."""
    others = ("Makefile", ".ci/run")
    return [ROOT / name for name in project_files() if name in others or Path(name).suffix in SOURCES]


def hand_written_verilog() -> list[Path]:
    """Also the boards' wrappers, which are made in the same style."""
    others = [path for folder in ("docs", "sim", "tb") for path in sorted((ROOT / folder).rglob("*.v"))]
    others += [entry.wrapper for entry in boards().values()]
    return [path for path in rtl_files() if "generated" not in path.parts] + others


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def tool(*command: str | Path) -> list[str]:
    """Runs a tool; its output, line by line, if it failed or warned."""
    done = subprocess.run(list(map(str, command)), cwd=ROOT, capture_output=True, text=True, check=False)
    output = (done.stdout + done.stderr).splitlines()
    return output or [f"exit code {done.returncode}"] if done.returncode else []


# ---------------------------------------------------------------- checks: each returns what is wrong


def verilator() -> list[str]:
    """Every whole card and the example, all warnings on; the waivers are in tools/verilator.vlt."""
    command = ["verilator", "--lint-only", "-Wall", "--no-timing", "--quiet", "--top-module", TOP]
    wrong = []
    for config in configurations():
        files = [ROOT / "tools/verilator.vlt", *card_files(config)]
        wrong += [f"{config}: {line}" for line in tool(*command, *files)]
    files = [ROOT / "tools/verilator.vlt", *needed_files("network_port"), *EXAMPLE]
    return wrong + tool(*command[:-1], "slave_top", *files)


def icarus() -> list[str]:
    """Every whole card as Verilog-2005, all warnings on; those about the soft cores are not ours."""
    wrong = []
    for config in configurations():
        command = ["iverilog", "-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s", TOP]
        command += card_files(config)
        done = subprocess.run(list(map(str, command)), cwd=ROOT, capture_output=True, text=True, check=False)
        lines = [line for line in done.stderr.splitlines() if "/pythondata_cpu_" not in line]
        wrong += [f"{config}: {line}" for line in lines]
        if done.returncode and not lines:
            wrong.append(f"{config}: iverilog ended with {done.returncode}")
    return wrong


def verible(kind: str, *options: str) -> list[str]:
    return tool(f"verible-verilog-{kind}", *options, *hand_written_verilog())


def net_types() -> list[str]:
    """Every Verilog module stands between `default_nettype none and wire."""
    wrong = []
    for path in rtl_files() + hand_written_verilog():
        code = [line for line in path.read_text().splitlines() if line.strip() and not line.startswith("//")]
        if not code or code[0] != "`default_nettype none" or code[-1] != "`default_nettype wire":
            wrong.append(f"{name(path)}: first line `default_nettype none, last line `default_nettype wire")
    return wrong


def licences() -> list[str]:
    """Every file has a licence and a copyright, by its own lines or by REUSE.toml."""
    # The detector of encodings that needs no library of the system.
    os.environ["REUSE_ENCODING_MODULE"] = "charset_normalizer"
    return tool(sys.executable, "-m", "reuse", "lint", "--lines")


def finished() -> list[str]:
    """No TODO marks, no skipped tests, no absolute paths, no symbolic links: a clone on Windows has none."""
    wrong = [f"{name(path)} is a symbolic link" for path in source_files() if path.is_symlink()]
    for path in (path for path in source_files() if path.name != OUR_OWN):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            skipped = path.suffix == ".py" and SKIPPED.search(line)
            if skipped or UNFINISHED.search(line) or SOMEWHERE.search(line):
                wrong.append(f"{name(path)}:{number}: {line.strip()}")
    return wrong


def cited_rules() -> list[str]:
    """Rules without a row that the card's sources and the guides cite."""
    rules = trace.read_rules()
    chapters = "|".join(sorted({rule.rpartition("-")[0] for rule in rules if "-" in rule}))
    sources = (("rtl", "*.v"), ("sw/src", "*.[ch]"), ("sw/include", "*.h"), ("docs/guide", "*.md"))
    wrong = []
    for path in sorted(path for folder, names in sources for path in (ROOT / folder).rglob(names)):
        cited = {*re.findall(rf"\b(?:{chapters})-\d+\b", path.read_text())}
        wrong += [f"{name(path)}: there is no rule {rule}" for rule in sorted(cited - rules.keys())]
    return wrong


def registers() -> list[str]:
    wrong = []
    for generator in GENERATORS:
        said = tool(sys.executable, "-m", generator, "--check")
        # The last line of a traceback says what a half-made row lacks.
        wrong += said[-1:] if said[:1] == ["Traceback (most recent call last):"] else said
    return wrong


def imports() -> list[str]:
    """Imports go down the list LAYERS only, tests apart."""
    import grimp  # of the set-up layer `lint`; tests of `make test` import this module

    graph = grimp.build_graph(
        *sorted({name.split(".")[0] for layer in LAYERS for name in layer}), cache_dir=None
    )
    for module in set(graph.modules):
        if module.rpartition(".")[2].startswith("test_"):
            graph.remove_module(module)
    layers = [grimp.Layer(*layer, independent=False) for layer in LAYERS]
    return [
        f"{found.importer} must not import {found.imported}: {' -> '.join(next(iter(found.routes)).middle)}"
        for found in graph.find_illegal_dependencies_for_layers(layers)
    ]


def ruff_format() -> list[str]:
    lines = tool("ruff", "format", "--check", ".")
    return [line.strip() for line in lines if "-->" in line] or lines


CHECKS: list[tuple[str, Callable[[], list[str]]]] = [
    ("no rule cited that is none", cited_rules),
    ("generated files current", registers),
    ("verilator -Wall", verilator),
    ("iverilog -g2005 -Wall", icarus),
    ("verible lint", lambda: verible("lint", "--rules_config=tools/verible.rules")),
    ("verible format", lambda: verible("format", "--inplace", "--verify")),
    ("net types", net_types),
    ("licence of every file (REUSE)", licences),
    ("nothing unfinished, skipped, absolute or linked", finished),
    ("imports go one way", imports),
    ("spelling and links", lambda: tool(sys.executable, "-m", "tools.prose")),
    ("ruff check", lambda: tool("ruff", "check", "--quiet", "--output-format", "concise", ".")),
    ("ruff format", ruff_format),
    (
        "firmware: gcc -fanalyzer, cppcheck, clang-tidy, loops",
        lambda: tool(sys.executable, "-m", "sw.test.analysis"),
    ),
]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--format", action="store_true", help="format the files instead of checking them")
    parser.add_argument("--only", default="", metavar="TEXT", help="checks with this text in their title")
    given = parser.parse_args()
    if given.format:
        problems = verible("format", "--inplace")
        problems += tool("ruff", "check", "--quiet", "--select", "I", "--fix", ".")
        problems += tool("ruff", "format", "--quiet", ".")
        print("\n".join(problems), end="\n" if problems else "")
        return 1 if problems else 0

    failed, chosen = 0, [row for row in CHECKS if given.only in row[0]]
    if not chosen:
        parser.error(f"no check has '{given.only}' in its title")
    for title, check in chosen:
        try:
            wrong = check()
        except SourcesError as error:
            wrong = [str(error)]
        failed += bool(wrong)
        print(f"{'FAIL' if wrong else 'ok':5} {title}")
        for line in wrong:
            print(f"      {line}")
    print(f"{len(chosen) - failed} checks passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    run_main("lint", main)
