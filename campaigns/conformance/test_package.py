# SPDX-License-Identifier: Apache-2.0
"""The agents as an installed package: wheel, imports, tests and example, without the rest of this project."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from rtl.sources import ROOT, needed_files
from tb.lib.seeds import seeded
from tools import wheels

AGENTS = ROOT / "tb/agents"
MODULES = sorted(path.stem for path in AGENTS.glob("*.py"))
EXAMPLE = str(AGENTS / "example/run.py")
OPTIONS = ["--top", "holding_registers", "--clk-hz", "500000", "--baud", "19200", "--build", "build"]
LINE = "registers[bits+:16] <= regs_wdata"


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The folder into which the package is installed from its wheel."""
    folder = tmp_path_factory.mktemp("agents")
    (wheel,) = (path for path in wheels.build(folder) if path.name.startswith("cocotbext_rtu-"))
    installed = folder / "site"
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--target"]
    done = subprocess.run([*command, installed, wheel], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return installed


def alone(site: Path, script: str, folder: Path) -> subprocess.CompletedProcess:
    """Isolated: Python ignores the present folder and its variables, and finds installed packages alone."""
    script = f"import sys; sys.path.insert(0, {str(site)!r})\n{script}"
    command = [sys.executable, "-I", "-c", script]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.nightly
def test_the_wheel_holds_every_module_and_each_is_imported_alone(site, tmp_path):
    with zipfile.ZipFile(next(site.parent.glob("cocotbext_rtu-*.whl"))) as archive:
        code = sorted(name for name in archive.namelist() if name.endswith(".py"))
    assert code == [f"cocotbext/rtu/{stem}.py" for stem in MODULES]
    script = f"""import importlib
sys.modules['cocotb'] = None  # frames and CRC need no cocotb
from cocotbext.rtu import rtu
print(rtu.build(1, rtu.read_registers(0, 1)).hex())
del sys.modules['cocotb']
for name in {MODULES!r}:
    module = importlib.import_module('cocotbext.rtu' + ('' if name == '__init__' else '.' + name))
    assert module.__file__.startswith({str(site)!r})
assert not [name for name in sys.modules if name.split('.')[0] in ('tb', 'sim', 'rtl', 'regs')]
"""
    done = alone(site, script, tmp_path)
    assert (done.returncode, done.stdout) == (0, "010300000001840a\n"), done.stderr


def test_the_version_is_that_of_the_release():
    stated = re.search(r'^version = "(.*)"$', (AGENTS / "pyproject.toml").read_text(), re.MULTILINE)
    assert stated[1] == (ROOT / "VERSION").read_text().strip()


@pytest.mark.nightly
def test_the_tests_of_the_package_run_with_the_installed_package_alone(site, tmp_path):
    shutil.copytree(AGENTS / "tests", tmp_path / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(AGENTS / "pyproject.toml", tmp_path)
    script = "import pytest\ncode = pytest.main(['-q', '-p', 'no:cacheprovider'])\n"
    script += "import cocotbext.rtu\nprint(cocotbext.rtu.__file__)\nsys.exit(code)\n"
    done = alone(site, script, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1].startswith(str(site)) and " passed in " in done.stdout


def example(site: Path, folder: Path, *options: str) -> subprocess.CompletedProcess:
    """The example's command line with the installed package."""
    script = f"import runpy\nsys.argv = [{EXAMPLE!r}, *{options!r}]\n"
    return alone(site, script + f"runpy.run_path({EXAMPLE!r}, run_name='__main__')\n", folder)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("fault", "options", "code", "said"),
    [
        ("", (), 0, "edges good"),
        ("rate", (), 0, "rate off by -2."),
        ("rate", ("--strict",), 1, "rate off by -2."),
        ("bit", (), 1, "PASS=1"),
    ],
)
def test_the_example_passes_a_good_slave_and_names_a_fault(fault, options, code, said, site, tmp_path):
    """A slave whose rate is 2 % off reads and writes all the same; a lost bit is an error."""
    text = (ROOT / "docs/example/holding_registers.v").read_text()
    lost = 1 << seeded("bit").choice((1, 4))  # the bits that are 1 in the example's value
    assert text.count(LINE) == 1
    slave = tmp_path / "holding_registers.v"
    slave.write_text(text.replace(LINE, f"{LINE} & ~16'd{lost}") if fault == "bit" else text)
    baud = 19600 if fault == "rate" else 19200
    parameters = ["--parameter", "CLK_HZ=500000", "--parameter", f"BAUD={baud}"]
    files = [*map(str, needed_files("network_port")), str(ROOT / "docs/example/modbus_slave.v"), str(slave)]
    done = example(site, tmp_path, *OPTIONS, *parameters, *options, *files)
    assert done.returncode == code and said in done.stdout, done.stdout + done.stderr


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("words", "reason"),
    [(["--form", "9E1"], "--form: invalid choice: '9E1'"), (["nowhere.v"], "there is no nowhere.v")],
)
def test_a_wrong_option_of_the_example_is_one_line(words, reason, site, tmp_path):
    (tmp_path / "top.v").write_text("module top; endmodule\n")
    done = example(site, tmp_path, *OPTIONS, str(tmp_path / "top.v"), *words)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert reason in done.stderr and not (tmp_path / "build").exists()
