# SPDX-License-Identifier: Apache-2.0
"""The project's commands: their output, and one-line error messages."""

from __future__ import annotations

import functools
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rtl.sources import configurations, macros_file
from tb.lib.runner import ROOT

TOP = "rtu2fc"
# System commands that the set-up needs, besides those it checks for.
BASE_COMMANDS = "awk bash cat cut dirname env flock grep id ln make mkdir python3 rm sed sha256sum tail"


def command(*words: str, cwd: Path = ROOT, env: dict[str, str] | None = None):
    """Runs a command outside make: a surrounding make would pass on its flags and variables."""
    handed_down = re.compile(r"MAKE|MFLAGS|(CONFIG|SIM|TEST|JOBS|V|WAVES)$")
    clean = {name: value for name, value in os.environ.items() if not handed_down.match(name)}
    return subprocess.run(
        words,
        cwd=cwd,
        env=clean | (env or {}),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )


@functools.cache
def sources_of(config: str) -> tuple[str, ...]:
    done = command("make", "-s", "sources", *([] if config == "standard" else [f"CONFIG={config}"]))
    assert done.returncode == 0, done.stderr
    return tuple(done.stdout.splitlines())


@pytest.fixture
def sources(config) -> tuple[str, ...]:
    return sources_of(config)


def one_line(text: str) -> str:
    """The message without the line in which make names the target."""
    lines = [line for line in text.splitlines() if not line.startswith("make:")]
    assert len(lines) == 1, text
    return lines[0]


def listed(*words: str) -> list[str]:
    done = command("make", *words)
    assert done.returncode == 0
    return re.findall(r"^  make ([a-z-]+) +\S", done.stdout, re.MULTILINE)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("help", "JOBS=2 3"), "JOBS=2 3: a whole number of 1 or more"),
        (("flips", "RATE=9600"), "there is no RATE=: say BAUD=9600"),
        (("nosuch",), "No rule to make target 'nosuch'"),
        (("waves",), "say which test: make waves TEST=name"),
    ],
)
def test_a_wrong_command_is_one_line(words, said):
    done = command("make", *words)
    assert done.returncode == 2 and done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if not line.endswith("Error 2")]
    assert len(lines) == 1 and said in lines[0]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("waves", "TEST=test_evidence"),
            "waves: 'test_evidence' fits no test that simulates the card or a module",
        ),
        (("replay", "FILE=bus.sr", "UNIT=1"), "say which: make replay FILE=bus.sr UNIT=1 BAUD=9600"),
        (("synth", "BOARD=nosuch"), "no board 'nosuch' in constraints/boards.toml; there are: "),
    ],
    # Without the words of the commands: `make waves TEST=test_release` would choose this very test.
    ids=["waves", "replay", "synth"],
)
def test_a_command_without_what_it_needs_is_one_line(words, said):
    done = command("make", *words)
    assert done.returncode == 2
    assert one_line(done.stderr).startswith(said)


def test_help_all_lists_every_target():
    targets = re.findall(r"^([a-z-]+):(?!=)", (ROOT / "Makefile").read_text(), re.MULTILINE)
    every, daily = listed("help-all"), listed()
    assert {*targets, "fuzz", "line-quality", "soak"} <= {"help", *every}
    assert {"demo", "run", "test", "lint", "synth"} <= set(daily) <= set(every) and len(daily) <= 15


def test_a_variable_of_the_environment_starts_no_motor():
    """It may have any name; only the command line's START counts."""
    options = ("make", "-n", "selftest", "PORT=here", "DRIVE=yes")
    assert "--start" not in command(*options, env={"START": "10"}).stdout
    assert '--start "10"' in command(*options, "START=10").stdout


def test_a_variable_is_an_option_of_a_campaign():
    planned = ("make", "-n", "-ocard", "-odrive", "-ofirmware")  # else it works out how to build every image
    done = command(*planned, "soak", "COUNT=5", "JOBS=4")
    assert done.stdout.splitlines()[-1].endswith('campaigns.soak.run --count "5" --jobs "4" ')
    assert '--jobs "4"' in command(*planned, "kills", "JOBS=4").stdout


@pytest.mark.rule("TOP-2")
def test_unknown_configuration():
    done = command("make", "-s", "sources", "CONFIG=nosuch")
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


@pytest.mark.rule("TOP-1", "TOP-2")
def test_sources_elaborate_in_any_order_with_nothing_else(sources, config, tmp_path):
    """But for the macros of a configuration other than `standard`, which come first. In any folder."""
    macros = [line for line in sources if f"config_{config}" in line] if config != "standard" else []
    others = sorted((line for line in sources if line not in macros), reverse=True)
    # A file without `timescale takes that of the file before it, and Icarus says so.
    for elaborate in (
        ["iverilog", "-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s", TOP],
        ["verilator", "--lint-only", "-Wno-TIMESCALEMOD", "--top-module", TOP],
    ):
        done = command(*elaborate, *macros, *others, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "not found" not in done.stderr and "redefin" not in done.stderr, done.stderr


@pytest.fixture
def poor_machine(tmp_path) -> Path:
    """A folder for PATH with system commands and compilers, but without iverilog and apt-get."""
    text = (ROOT / "tools/setup.sh").read_text()
    needs = re.findall(r'^  "(?:demo|test) +command +(\S+)', text, re.MULTILINE)
    for name in {*BASE_COMMANDS.split(), "perl", *needs} - {"iverilog"}:
        (tmp_path / name).symlink_to(
            shutil.which(name, path="/usr/local/bin:/usr/bin:/bin:" + os.environ["PATH"])
        )
    return tmp_path


def program(folder: Path, name: str, script: str) -> None:
    (folder / name).unlink(missing_ok=True)
    (folder / name).write_text(f"#!/bin/sh\n{script}\n")
    (folder / name).chmod(0o755)


def test_missing_tool_without_root(poor_machine):
    """With apt-get but neither root nor sudo, the message gives the command to type."""
    for name, script in {"apt-get": "exit 1", "id": "echo 1000"}.items():
        program(poor_machine, name, script)
    done = command("tools/setup.sh", "test", env={"PATH": str(poor_machine)})
    assert done.returncode == 2
    assert one_line(done.stderr) == "setup: missing: iverilog; as root: apt-get install iverilog"


def test_packages_have_the_number_of_the_interpreter_in_use(poor_machine):
    """Debian 13's python3 is 3.13; no other package has a number of a release."""
    real = (poor_machine / "python3").resolve()
    fake = f'[ "$1" = -c ] && exec {real} -c "import sys; sys.version_info = (3, 13, 5); $2"'
    program(poor_machine, "python3", fake)
    done = command("tools/setup.sh", "--packages", "all", env={"PATH": str(poor_machine)})
    assert done.returncode == 0, done.stderr
    found = done.stdout.split()
    assert {"libpython3.13", "clang", "clang-tidy", "libclang-rt-dev"} <= set(found)
    assert not [name for name in found if re.search(r"\d\.\d|-\d", name) and name != "libpython3.13"]


def test_clang_of_any_release_from_14_on(poor_machine):
    for there, taken in (
        ({"clang-14": 14}, "clang-14"),
        ({"clang-15": 15, "clang-19": 19}, "clang-19"),
        ({"clang": 19, "clang-20": 20}, "clang"),
        ({"clang": 11, "clang-13": 13}, None),
    ):
        for name, version in there.items():
            program(poor_machine, name, f"echo Debian clang version {version}.0.6")
        done = command("tools/setup.sh", "--command", "clang", env={"PATH": str(poor_machine)})
        assert (done.returncode, done.stdout) == ((0, f"{taken}\n") if taken else (2, "")), there
        for name in there:
            (poor_machine / name).unlink()
        if not taken:
            assert one_line(done.stderr) == "setup: no clang of version 14 or newer; run: make setup"


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


@pytest.mark.nightly
def test_a_second_setup_does_nothing():
    assert command("make", "setup-test").returncode == 0
    done = command("make", "setup-test")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.nightly
@pytest.mark.parametrize("target", ["test", "waves"])
def test_a_name_that_fits_no_test_is_one_line(target):
    typo = "test_" + "comit_gate"  # in two parts, so that no test file has it
    done = command("make", target, f"TEST={typo}")
    assert done.returncode == 2 and done.stdout == ""
    assert one_line(done.stderr).startswith(f"{target}: no test has '{typo}' in its name; near it: ")
