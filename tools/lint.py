# SPDX-License-Identifier: Apache-2.0
"""Every static check of the project, one line each; exit 1 when one fails.

    python -m tools.lint            checks
    python -m tools.lint --format   lays Verilog and Python files out the way the checks want them

The warnings of C and C++ have no line here: they are errors in the builds.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from constraints.boards import boards
from regs import dialects
from regs.generated import mailbox
from rtl.command import run_main
from rtl.sources import (
    FILE_LIST,
    ROOT,
    SourcesError,
    card_files,
    configurations,
    macros_file,
    needed_files,
    rtl_files,
)
from tb.model.card import DIALECTS
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
GENERATORS = ("regs.regs", "constraints.boards", "tools.handbook", "tools.pictures")
UNFINISHED = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b")
SKIPPED = re.compile(r"\b(skipif|xfail|mark\.skip|pytest\.skip|cocotb\.skip)\b|\bskip=True")
SOMEWHERE = re.compile(r"(?<![\w.-])/(home|root|tmp|work)/\w")
# The description of a command of campaigns/; the Makefile looks for the same line.
DESCRIBED = re.compile(r'^""".*; `make ([a-z-]+)`\.(?:"""|$)', re.MULTILINE)
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


def file_list() -> list[str]:
    """rtl/rtl.f names every Verilog file of rtl/, once; but for the configurations' macros."""
    listed = rtl_files()
    macros = [macros_file(config) for config in configurations()]
    folders = (ROOT / "rtl", ROOT / "regs/generated")
    there = sorted(path for folder in folders for path in folder.rglob("*.v") if path not in macros)
    wrong = [f"{name(path)} is not in {name(FILE_LIST)}" for path in there if path not in listed]
    wrong += [f"{name(path)} is in {name(FILE_LIST)} but not there" for path in listed if path not in there]
    return wrong + [f"{name(path)} is listed twice" for path in set(listed) if listed.count(path) > 1]


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


def verible_lint() -> list[str]:
    return tool("verible-verilog-lint", "--rules_config=tools/verible.rules", *hand_written_verilog())


def verible_format() -> list[str]:
    return tool("verible-verilog-format", "--inplace", "--verify", *hand_written_verilog())


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


def half_campaigns(folder: Path = ROOT / "campaigns") -> list[str]:
    """Campaigns without a program, its description, or a test."""
    wrong = []
    for campaign in sorted({path.parent for path in folder.glob("*/*") if path.parent.name != "__pycache__"}):
        program, shown = campaign / "run.py", f"campaigns/{campaign.name}"
        if not program.exists():
            wrong.append(f"{shown}: no run.py")
        elif not DESCRIBED.search(program.read_text()):
            wrong.append(
                f'{shown}/run.py: the first line of its description does not end with "; `make NAME`."'
            )
        # campaigns/test_engine.py runs a case of each campaign that has none of its own.
        counts = program.exists() and "CAMPAIGN = " in program.read_text()
        if not counts and not any("def test_" in path.read_text() for path in campaign.glob("test_*.py")):
            wrong.append(f"{shown}: no test_*.py with a test")
    targets = re.findall(r"^([a-z][\w-]*)(?=[ a-z-]*:[^=])", (ROOT / "Makefile").read_text(), re.MULTILINE)
    programs = [
        (match[1], path.relative_to(folder.parent))
        for path in sorted(folder.glob("*/*.py"))
        if (match := DESCRIBED.search(path.read_text()))
    ]
    seen = dict.fromkeys(targets, "the Makefile")
    for command, path in programs:
        if command in seen:
            wrong.append(f"{path}: `make {command}` is a command of {seen[command]} already")
        seen[command] = str(path)
    return wrong


def rows_and_citations(rules: dict[str, str]) -> list[str]:
    """Rows that are no rule, and rules without a row in the card's sources and in the guides."""
    where = name(trace.REQUIREMENTS)
    rows = [
        line for line in trace.REQUIREMENTS.read_text().splitlines() if re.match(r"\| (?!id )[\w-]+ \|", line)
    ]
    wrong = [f"{where}: an id has capital letters: {row[:40]}" for row in rows if not trace.ROW.match(row)]
    wrong += [
        f"rule {rule}: it is shown by {by!r}, not by test or open"
        for rule, by in rules.items()
        if by not in ("test", "open")
    ]
    chapters = "|".join(sorted({rule.rpartition("-")[0] for rule in rules if "-" in rule}))
    sources = (("rtl", "*.v"), ("sw/src", "*.[ch]"), ("sw/include", "*.h"), ("docs/guide", "*.md"))
    for path in sorted(path for folder, names in sources for path in (ROOT / folder).rglob(names)):
        cited = {*re.findall(rf"\b(?:{chapters})-\d+\b", path.read_text())}
        wrong += [f"{name(path)}: there is no rule {rule}" for rule in sorted(cited - rules.keys())]
    return wrong


def half_rules(rules: dict[str, str], tests: dict[str, str]) -> list[str]:
    """Rules that no test file names, and marks without a rule; `make trace` knows computed marks, too."""
    named = set(re.findall(r"(?<=[\"' ])[A-Z0-9-]+(?=[\"',])", "".join(tests.values())))
    wrong = [
        f"rule {rule}: no test is marked with it"
        for rule, by in rules.items()
        if by == "test" and rule not in named
    ]
    for file, text in tests.items():
        marked = re.findall(r'"([^"]+)"', "".join(re.findall(r"mark\.rule\(([^()]*)\)", text)))
        wrong += [f"{file}: there is no rule {rule}" for rule in marked if rule not in rules]
    return wrong


def half_registers() -> list[str]:
    """Fields of the map without their port in the module that decodes it, or without its wire."""
    fields = {f"{register}.{field}": about.port for register, row in mailbox.REGISTERS.items()
              for field, about in row.fields.items() if about.port}  # fmt: skip
    forms = {"rtl/mailbox_regs.v": r"put +(?:wire|reg) .*\b{0},?$", "rtl/mailbox.v": r"\.{0}\({0}\)"}
    return [
        f"{file}: no port {port} of {field} (regs/mailbox.rdl)"
        for file, form in forms.items()
        for field, port in fields.items()
        if not re.search(form.format(port), (ROOT / file).read_text(), re.MULTILINE)
    ]


def half_dialects() -> list[str]:
    """Dialects of the table or the oracle alone, drives without a table, images of no dialect."""
    wrong = []
    for d in sorted(dialects.DIALECTS.keys() | DIALECTS.keys()):
        parts = {dialects.TABLE: dialects.DIALECTS, "tb/model/card.py": DIALECTS}
        wrong += [f"dialect {d}: no row in {part}" for part, rows in parts.items() if d not in rows]
    for d in dialects.DIALECTS.values():
        wrong += [
            f"dialect {d.name}: no sim/drive/{p}.csv"
            for p in d.profiles
            if not (ROOT / f"sim/drive/{p}.csv").exists()
        ]
    for image in dialects.IMAGES.values():
        wrong += [f"image {image.name}: no dialect {d}" for d in image.dialects if d not in dialects.DIALECTS]
    return wrong


def half_made() -> list[str]:
    """Campaigns, rules, registers, dialects, options without a part of theirs; boards: constraints.boards."""
    rules = trace.read_rules()
    tests = {name(path): path.read_text() for path in source_files() if path.name.startswith("test_")}
    wrong = half_campaigns() + rows_and_citations(rules) + half_rules(rules, tests)
    source = "".join(path.read_text() for path in (ROOT / "sw").glob("[is]*/*.[ch]"))
    source = re.sub(r"by make regs: options.*?end of options|/\*.*?\*/", "", source, flags=re.DOTALL)
    used = set(re.findall(r"\w+", source))
    wrong += [f"option {o}: no C file uses it" for o in dialects.OPTIONS if o not in used]
    tested = re.sub("#.*", "", "".join(tests.values()))
    wrong += [f"option {o}: no test builds with it" for o in dialects.OPTIONS if o not in tested]
    return wrong + half_registers() + half_dialects()


def registers() -> list[str]:
    wrong = []
    for generator in GENERATORS:
        said = tool(sys.executable, "-m", generator, "--check")
        # The last line of a traceback says what a half-made row lacks.
        wrong += said[-1:] if said[:1] == ["Traceback (most recent call last):"] else said
    return wrong


def imports() -> list[str]:
    """Imports go down the list LAYERS only, tests apart; no module imports itself by way of others."""
    import grimp  # of the set-up layer `lint`; tests of `make test` import this module

    graph = grimp.build_graph(
        *sorted({name.split(".")[0] for layer in LAYERS for name in layer}), cache_dir=None
    )
    wrong = circle({module: graph.find_modules_directly_imported_by(module) for module in graph.modules})
    for module in set(graph.modules):
        if module.rpartition(".")[2].startswith("test_"):
            graph.remove_module(module)
    layers = [grimp.Layer(*layer, independent=False) for layer in LAYERS]
    return wrong + [
        f"{found.importer} must not import {found.imported}: {' -> '.join(next(iter(found.routes)).middle)}"
        for found in graph.find_illegal_dependencies_for_layers(layers)
    ]


def circle(imported: dict[str, set[str]]) -> list[str]:
    """The first circle of imports, in one line."""
    try:
        TopologicalSorter(imported).prepare()
    except CycleError as error:
        return [f"imports in a circle: {' <- '.join(error.args[1])}"]
    return []


def ruff_check() -> list[str]:
    return tool("ruff", "check", "--quiet", "--output-format", "concise", ".")


def ruff_format() -> list[str]:
    lines = tool("ruff", "format", "--check", ".")
    return [line.strip() for line in lines if "-->" in line] or lines


def prose() -> list[str]:
    return tool(sys.executable, "-m", "tools.prose")


def firmware() -> list[str]:
    return tool(sys.executable, "-m", "sw.test.analysis")


CHECKS: list[tuple[str, Callable[[], list[str]]]] = [
    ("rtl/rtl.f complete", file_list),
    ("nothing half made", half_made),
    ("generated files current", registers),
    ("verilator -Wall", verilator),
    ("iverilog -g2005 -Wall", icarus),
    ("verible lint", verible_lint),
    ("verible format", verible_format),
    ("net types", net_types),
    ("licence of every file (REUSE)", licences),
    ("nothing unfinished, skipped, absolute or linked", finished),
    ("imports go one way", imports),
    ("spelling and links", prose),
    ("ruff check", ruff_check),
    ("ruff format", ruff_format),
    ("firmware: gcc -fanalyzer, cppcheck, clang-tidy, loops", firmware),
]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--format", action="store_true", help="format the files instead of checking them")
    if parser.parse_args().format:
        problems = tool("verible-verilog-format", "--inplace", *hand_written_verilog())
        problems += tool("ruff", "check", "--quiet", "--select", "I", "--fix", ".")
        problems += tool("ruff", "format", "--quiet", ".")
        print("\n".join(problems), end="\n" if problems else "")
        return 1 if problems else 0

    for command in ("verilator", "iverilog", "verible-verilog-lint", "ruff", "cppcheck"):
        if shutil.which(command) is None:
            print(f"{command} is missing; run `make setup`", file=sys.stderr)
            return 2
    failed = 0
    for title, check in CHECKS:
        try:
            wrong = check()
        except SourcesError as error:
            wrong = [str(error)]
        failed += bool(wrong)
        print(f"{'FAIL' if wrong else 'ok':5} {title}")
        for line in wrong:
            print(f"      {line}")
    print(f"{len(CHECKS) - failed} checks passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    run_main("lint", main)
