# SPDX-License-Identifier: Apache-2.0
"""The project's commands: their output, and one-line error messages."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from constraints.boards import boards
from rtl.sources import configurations, macros_file
from tb.lib.runner import ROOT
from tb.lib.seeds import seeded
from tools.lint import circle
from tools.names import texts, unknown_words

TOP = "rtu2fc"
TIMEOUT_S = 300  # for one command
# System commands that the set-up needs, besides those it checks for.
BASE_COMMANDS = [
    "awk",
    "bash",
    "cat",
    "cut",
    "dirname",
    "env",
    "flock",
    "grep",
    "id",
    "ln",
    "make",
    "mkdir",
    "python3",
    "rm",
    "sed",
    "sha256sum",
    "tail",
]


def command(*words: str, cwd: Path = ROOT, env: dict[str, str] | None = None):
    """Runs a command outside make: a surrounding make would pass on its flags and variables."""
    handed_down = re.compile(r"MAKE|MFLAGS|(CONFIG|SIM|TEST|JOBS|V|WAVES)$")
    clean = {name: value for name, value in os.environ.items() if not handed_down.match(name)}
    done = subprocess.Popen(
        words,
        cwd=cwd,
        env=clean | (env or {}),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        stdout, stderr = done.communicate(timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        # The whole process group: make's children would go on without it.
        os.killpg(done.pid, signal.SIGKILL)
        raise
    return subprocess.CompletedProcess(words, done.returncode, stdout, stderr)


@pytest.fixture
def sources(config) -> list[str]:
    done = command("make", "-s", "sources", *([] if config == "standard" else [f"CONFIG={config}"]))
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def one_line(text: str) -> str:
    """The message without the line in which make names the target."""
    lines = [line for line in text.splitlines() if not line.startswith("make:")]
    assert len(lines) == 1, text
    return lines[0]


def listed(*words: str) -> list[str]:
    done = command("make", *words)
    assert done.returncode == 0
    return re.findall(r"^  make ([a-z-]+) +\S", done.stdout, re.MULTILINE)


def test_a_rate_has_one_name_in_every_command():
    done = command("make", "flips", "RATE=9600")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "there is no RATE=: say BAUD=9600" in done.stderr
    assert command("make", "help", env={"RATE": "9600"}).returncode == 0, "a variable of others"


@pytest.mark.parametrize("jobs", ["x", "0", "2 3"])
def test_jobs_is_a_number(jobs):
    """Without this check `make -j` prints its whole help."""
    done = command("make", "help", f"JOBS={jobs}")
    assert done.returncode == 2
    assert f"JOBS={jobs}: a whole number of 1 or more" in done.stderr and done.stderr.count("\n") == 1


def test_help_all_lists_every_target():
    text = (ROOT / "Makefile").read_text()
    phony = " ".join(re.findall(r"^\.PHONY: ([a-z -]*)$", text, re.MULTILINE)).split()
    targets = re.findall(r"^([a-z-]+):(?!=)", text, re.MULTILINE)
    assert sorted(["help", *listed("help-all")]) == sorted(phony) == sorted(targets)


def test_make_alone_lists_at_most_fifteen_commands():
    daily = listed()
    assert len(daily) <= 15
    assert {"demo", "run", "test", "test-all", "lint", "synth"} <= set(daily) <= set(listed("help-all"))


def test_every_daily_command_says_how_long_it_takes():
    shown = command("make").stdout
    lines = [line for line in shown.splitlines() if re.match(r"  make \w", line)]
    assert len(lines) == len(listed())
    for line in lines:
        assert re.search(r"\((at once|\d[\d.]* (s|min)\b)", line), line


def test_at_most_ten_folders_stand_beside_each_other():
    """Not counted: hidden ones, LICENSES of REUSE, and `build`, which is generated."""
    there = {path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(".")}
    assert {"rtl", "tb", "sw", "constraints"} <= there
    assert len(there - {"LICENSES", "build"}) <= 10


def test_the_readme_names_every_board():
    (named,) = re.findall(
        r"^The boards for `BOARD=name` are (.*?)\.$", (ROOT / "README.md").read_text(), re.M | re.S
    )
    assert sorted(re.findall(r"`([\w-]+)`", named)) == sorted(boards())


def test_unknown_target():
    done = command("make", "nosuch")
    assert done.returncode == 2
    assert "No rule to make target 'nosuch'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_waves_needs_a_name():
    done = command("make", "waves")
    assert done.returncode == 2
    assert one_line(done.stderr) == "say which test: make waves TEST=name"


@pytest.mark.slow
def test_waves_of_a_test_without_a_simulator():
    done = command("make", "waves", "TEST=test_panel_picture")
    assert done.returncode == 2
    assert (
        one_line(done.stderr)
        == "waves: 'test_panel_picture' fits no test that simulates the card or a module"
    )


def test_selftest_needs_a_port():
    done = command("make", "selftest", "PORT=")
    assert done.returncode == 2
    assert one_line(done.stderr) == "say which port: make selftest PORT=/dev/ttyUSB0"


@pytest.mark.slow
def test_replay_needs_a_file_a_unit_and_a_rate():
    done = command("make", "replay", "FILE=bus.sr", "UNIT=1")
    assert done.returncode == 2
    assert one_line(done.stderr) == "say which: make replay FILE=bus.sr UNIT=1 BAUD=9600"
    done = command("make", "replay", "FILE=bus.sr", "UNIT=1", env={"BAUD": "9600"})
    assert one_line(done.stderr) == "say which: make replay FILE=bus.sr UNIT=1 BAUD=9600", (
        "a variable of others"
    )
    options = command("make", "-n", "replay", "FILE=bus.sr", "UNIT=1", "BAUD=9600", "INVERT=yes").stdout
    assert '"bus.sr"' in options and '--unit "1"' in options and '--invert "yes"' in options
    assert "--replies" not in options and "--config" not in options and "--strict-t15" not in options


REPLAYED = ("REPLIES=no", "FOR=1", "FORMAT=8E1", "CHANNEL=RX", "CONFIG=tiny", "DIALECT=builtin")
REPLAYED += ("STRICT_T15=no", "BREAK_TOLERANT=yes")


def test_replay_passes_its_variables_on():
    said = command("make", "-n", "replay", "FILE=bus.sr", "UNIT=1", "BAUD=9600", *REPLAYED).stdout
    for name, value in (variable.split("=") for variable in REPLAYED):
        assert f'--{name.lower().replace("_", "-")} "{value}"' in said


def test_selftest_starts_a_motor_by_the_command_line_only():
    """A variable of the environment may have any name."""
    options = ("make", "-n", "selftest", "PORT=here", "DRIVE=yes")
    assert "--start" not in command(*options, env={"START": "10"}).stdout
    assert '--start "10"' in command(*options, "START=10").stdout


@pytest.mark.rule("TOP-2")
@pytest.mark.parametrize("target", ["sources", "card"])
def test_unknown_configuration(target):
    done = command("make", "-s", target, "CONFIG=nosuch")
    assert (done.returncode, done.stdout) == (2, "")
    assert one_line(done.stderr) == "no configuration 'nosuch' in configs.toml; there are: standard, tiny"


@pytest.mark.rule("TOP-1", "TOP-2")
def test_sources_are_the_whole_card(sources, config):
    """One existing file per line: all of rtl/, the configuration's macros, its soft core's package."""
    assert all(Path(line).is_file() for line in sources)
    others = {macros_file(name) for name in configurations() if name != config}
    assert {line for line in sources if line.startswith(f"{ROOT}/rtl/")} == {
        str(path) for path in (ROOT / "rtl").rglob("*.v") if path not in others
    }
    core = [line for line in sources if "pythondata_cpu_" in line]
    assert all(f"/pythondata_cpu_{configurations()[config]['soft_core']}/" in line for line in core)
    assert len(core) == {"standard": 1, "tiny": 16}[config]


@pytest.mark.rule("TOP-2")
def test_file_list_sets_the_parameters_of_the_configuration(sources, config, tmp_path):
    """Parameters of the elaborated top, with none given on the command line."""
    done = command("iverilog", "-g2005", "-s", TOP, "-o", "card", *sources, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    code = (tmp_path / "card").read_text()
    top = code[code.index(f'"{TOP}"') :].split("S_0x", 1)[0]
    found = dict(re.findall(r'\.param/l "(\w+)".*?(?:C4|\+C4)<(\w+)>', top))
    entry = configurations()[config]
    wanted = {
        "CLK_HZ": entry["clk_hz"],
        "SOFT_CORE": entry["soft_core_id"],
        "MEMORY_BYTES": entry["memory_bytes"],
        "PLACES": entry["waiting_places"],
    }
    assert {name: int(found[name], 2) for name in wanted} == wanted


@pytest.mark.rule("TOP-1", "TOP-2")
@pytest.mark.parametrize(
    "elaborate",
    [
        pytest.param(["iverilog", "-g2005", "-t", "null", "-s", TOP], id="icarus-2005"),
        pytest.param(["iverilog", "-g2012", "-t", "null", "-s", TOP], id="icarus-2012"),
        pytest.param(["verilator", "--lint-only", "--top-module", TOP], id="verilator"),
    ],
)
def test_sources_elaborate_with_nothing_else(sources, elaborate, tmp_path):
    """No include folder, no option, any working folder; no warning."""
    done = command(*elaborate, *sources, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "arning" not in done.stderr


@pytest.mark.parametrize("order", ["sorted", "reversed", "shuffled"])
def test_sources_elaborate_in_any_order(sources, order, config, tmp_path):
    """But for the macros of a configuration other than `standard`, which come first."""
    macros = [line for line in sources if f"config_{config}" in line] if config != "standard" else []
    others = [line for line in sources if line not in macros]
    if order == "shuffled":
        seeded("order").shuffle(others)
    else:
        others.sort(reverse=order == "reversed")
    # A file without `timescale takes that of the file before it, and Icarus says so.
    icarus = ["iverilog", "-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s", TOP]
    verilator = ["verilator", "--lint-only", "-Wno-TIMESCALEMOD", "--top-module", TOP]
    for elaborate in (icarus, verilator):
        done = command(*elaborate, *macros, *others, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "not found" not in done.stderr and "redefin" not in done.stderr, done.stderr


@pytest.fixture
def poor_machine(tmp_path) -> Path:
    """A folder for PATH with system commands and compilers, but without iverilog and apt-get."""
    text = (ROOT / "tools/setup.sh").read_text()
    needs = re.findall(r'^  "(?:demo|test) +command +(\S+)', text, re.MULTILINE)
    for name in {*BASE_COMMANDS, "perl", *needs} - {"iverilog"}:
        (tmp_path / name).symlink_to(
            shutil.which(name, path="/usr/local/bin:/usr/bin:/bin:" + os.environ["PATH"])
        )
    return tmp_path


def test_missing_tool_is_named(poor_machine):
    done = command("make", "trace", env={"PATH": str(poor_machine)})
    assert done.returncode == 2
    assert one_line(done.stderr) == (
        "setup: missing: iverilog; there is no apt-get here, install them by hand"
    )


def test_missing_tool_without_root(poor_machine):
    """With apt-get but neither root nor sudo, the message gives the command to type."""
    for name, script in {"apt-get": "exit 1", "id": "echo 1000"}.items():
        (poor_machine / name).unlink(missing_ok=True)
        (poor_machine / name).write_text(f"#!/bin/sh\n{script}\n")
        (poor_machine / name).chmod(0o755)
    done = command("tools/setup.sh", "test", env={"PATH": str(poor_machine)})
    assert done.returncode == 2
    assert one_line(done.stderr) == "setup: missing: iverilog; as root: apt-get install iverilog"


def test_missing_system_commands_of_the_setup_are_named(poor_machine):
    for name in ("flock", "sha256sum"):
        (poor_machine / name).unlink()
    done = command("tools/setup.sh", "test", env={"PATH": str(poor_machine)})
    assert done.returncode == 2
    assert one_line(done.stderr) == "setup: missing: flock sha256sum; install them by hand"


def program(folder: Path, name: str, script: str) -> None:
    (folder / name).unlink(missing_ok=True)
    (folder / name).write_text(f"#!/bin/sh\n{script}\n")
    (folder / name).chmod(0o755)


def packages(machine: Path, *layers: str) -> list[str]:
    done = command("tools/setup.sh", "--packages", *layers, env={"PATH": str(machine)})
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_packages_have_the_number_of_the_interpreter_in_use(poor_machine):
    """Debian 13's python3 is 3.13; no other package has a number of a release."""
    real = (poor_machine / "python3").resolve()
    fake = f'[ "$1" = -c ] && exec {real} -c "import sys; sys.version_info = (3, 13, 5); $2"'
    program(poor_machine, "python3", fake)
    found = packages(poor_machine, "all")
    assert {"libpython3.13", "clang", "clang-tidy", "libclang-rt-dev"} <= set(found)
    assert not [name for name in found if re.search(r"\d\.\d|-\d", name) and name != "libpython3.13"]


@pytest.mark.parametrize(
    ("there", "taken"),
    [
        ({"clang-14": 14}, "clang-14"),
        ({"clang-15": 15, "clang-19": 19}, "clang-19"),
        ({"clang": 19, "clang-20": 20}, "clang"),
        ({"clang": 13, "clang-15": 15}, "clang-15"),
        ({"clang": 11, "clang-13": 13}, None),
        ({}, None),
    ],
)
def test_clang_of_any_release_from_14_on(poor_machine, there, taken):
    for name, version in there.items():
        program(poor_machine, name, f"echo Debian clang version {version}.0.6")
    done = command("tools/setup.sh", "--command", "clang", env={"PATH": str(poor_machine)})
    if taken:
        assert (done.returncode, done.stdout) == (0, f"{taken}\n")
    else:
        assert (done.returncode, done.stdout) == (2, "")
        assert one_line(done.stderr) == "setup: no clang of version 14 or newer; run: make setup"
    # The fuzzers' library must be of the same version.
    number = (taken or "").removeprefix("clang")
    assert f"libclang-rt{number}-dev" in packages(poor_machine, "firmware")


def test_commands_in_files_for_others_exist():
    """Workflow, templates, container files and hooks call commands and files that are there."""
    files = [ROOT / "Containerfile", ROOT / ".pre-commit-config.yaml", *ROOT.glob(".devcontainer/*")]
    files += [path for path in (ROOT / ".github").rglob("*") if path.is_file()]
    assert len(files) >= 7
    text = "\n".join(path.read_text() for path in files)
    called = set(re.findall(r"(?<!git )\bmake ([a-z-]+)", text))
    assert {"lint", "format", "replay"} <= called <= set(listed("help-all"))
    named = set(re.findall(r"(?<![\w/])(?:tools|docs|\.ci)/[\w./-]*\w", text))
    assert {".ci/run", "tools/setup.sh"} <= named
    assert [name for name in named if not (ROOT / name).is_file()] == []


@pytest.mark.parametrize(
    ("imported", "said"),
    [
        ({"a": {"b", "c"}, "b": {"c"}, "c": set()}, []),
        ({"a": {"b"}, "b": {"c"}, "c": {"b"}}, ["imports in a circle: b <- c <- b"]),
    ],
)
def test_a_circle_of_imports_is_named(imported, said):
    assert circle(imported) == said


def test_second_setup_does_nothing():
    assert command("make", "setup-test").returncode == 0
    done = command("make", "setup-test")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_fusesoc_finds_no_core_in_folders_that_a_command_makes():
    """With the core of PicoRV32 it prints an error of its own in each run."""
    marks = [ROOT / folder / "FUSESOC_IGNORE" for folder in (".venv", "build")]
    for mark in marks:
        mark.unlink(missing_ok=True)
    assert command("make", "setup-test").returncode == 0
    assert all(mark.is_file() for mark in marks)


def test_an_unknown_layer_is_named():
    done = command("tools/setup.sh", "nosuch")
    assert done.returncode == 2
    assert one_line(done.stderr).startswith("setup: no layer 'nosuch'; there are: ")


WAITING = "test_card_" + "waiting"  # in two parts, so that no test file has the name with .py


@pytest.mark.slow
def test_the_name_of_a_test_file_fits():
    """With its folder or without, with .py or without: pytest collects the tests of that file alone."""
    chosen = set()
    for name in (WAITING, f"{WAITING}.py", f"tb/card/{WAITING}.py"):
        shown = command("make", "-n", "test", f"TEST={name}").stdout
        (asked,) = re.findall(r"tools\.names test '(.*?)'", shown)
        assert re.findall(r"pytest .* -k '(.*?)'", shown) == [asked]
        assert unknown_words(asked, texts()) == []
        chosen.add(asked)
    assert chosen == {WAITING, f"{WAITING}.py"}
    for name in chosen:
        collect = (
            "-m",
            "pytest",
            "--collect-only",
            "-q",
            "--all",
            f"tb/card/{WAITING}.py",
            "tb/card/test_card_starts.py",
        )
        done = command(sys.executable, *collect, "-k", name)
        found = {line.split("::")[0] for line in done.stdout.splitlines() if "::" in line}
        assert found == {f"tb/card/{WAITING}.py"}


@pytest.mark.parametrize("target", ["test", "test-all", "waves"])
def test_a_name_that_fits_no_test_is_one_line_within_seconds(target):
    began = time.monotonic()
    typo = "test_" + "comit_gate"  # in two parts, so that no test file has it
    done = command("make", target, f"TEST={typo}")
    assert done.returncode == 2 and done.stdout == ""
    assert one_line(done.stderr).startswith(f"{target}: no test has '{typo}' in its name; near it: ")
    assert time.monotonic() - began < 15


def test_figures_of_the_guide_equal_the_report_of_make_bench():
    def last_cells(file: str, rows: tuple[str, ...], column: int, table: int = 0) -> list[str]:
        lines = (ROOT / file).read_text().splitlines()
        return [
            [line for line in lines if line.startswith(f"| {row}")][table].split("|")[column].strip()
            for row in rows
        ]

    guide = (
        "a local reply",
        "the drive's telegram",
        "the reply, after the drive",
        "transactions with the drive",
    )
    results = (
        "local request",
        "telegram's first bit",
        "reply's first bit after the drive",
        "full transactions",
    )
    page = "docs/guide/performance.md"
    for card in (0, 1):
        assert last_cells(page, guide, 3 + card) == last_cells("docs/reports/results.md", results, 3, card)


def test_sizes_and_durations_of_the_readme_are_those_of_the_guide_and_the_makefile():
    guide = (ROOT / "docs/guide/setup.md").read_text()
    rows = re.findall(r"^\| (\w+) \|.*?\| (\d+) MB \| (\d+) MB \| (\d+) MB \|$", guide, re.MULTILINE)
    layers = {name: tuple(map(int, sizes)) for name, *sizes in rows}
    downloads, disk = 0, 0
    for name in ("demo", "test"):
        found = re.search(
            rf"^\| `make {name}` \|.*\| (\d+) MB \| (\d+) MB \| (.+) \|$",
            (ROOT / "README.md").read_text(),
            re.MULTILINE,
        )
        download, packages, python = layers[name]
        downloads, disk = downloads + download, disk + packages + python
        assert (int(found[1]), int(found[2])) == (downloads, disk)
        lasts = re.search(rf"^{name}:.*?\(([\d.]+ \w+)", (ROOT / "Makefile").read_text(), re.MULTILINE)[1]
        assert lasts in found[3]
