# SPDX-License-Identifier: Apache-2.0
"""The agents as an installed package: wheel, imports, tests and example, without the rest of this project."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from rtl.sources import ROOT, needed_files
from tb.lib.seeds import seeded

AGENTS = ROOT / "tb/agents"
MODULES = sorted(path.stem for path in AGENTS.glob("*.py"))
# Isolated: Python ignores the present folder and its variables, and finds installed packages alone.
ALONE = [sys.executable, "-I", "-c"]


def wheel(folder: Path) -> Path:
    """Builds the wheel from a copy, because a build leaves files in its folder."""
    source = folder / "source"
    shutil.copytree(AGENTS, source, ignore=shutil.ignore_patterns("build", "*.egg-info"))
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation"]
    done = subprocess.run([*command, "-w", folder, source], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The folder into which the package is installed."""
    folder = tmp_path_factory.mktemp("agents")
    built, installed = wheel(folder), folder / "site"
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", installed, built]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    with zipfile.ZipFile(built) as archive:
        (folder / "names").write_text("\n".join(archive.namelist()))
    return installed


def alone(site: Path, script: str, folder: Path) -> subprocess.CompletedProcess:
    return subprocess.run(
        [*ALONE, f"import sys; sys.path.insert(0, {str(site)!r})\n{script}"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_wheel_holds_every_module_and_no_test(site):
    names = (site.parent / "names").read_text().splitlines()
    code = sorted(name for name in names if name.endswith(".py"))
    assert code == [f"cocotbext/rtu/{stem}.py" for stem in MODULES]


def test_the_source_package_holds_tests_and_example(tmp_path):
    source = tmp_path / "source"
    shutil.copytree(AGENTS, source, ignore=shutil.ignore_patterns("build", "*.egg-info", "__pycache__"))
    script = "from setuptools import build_meta\nbuild_meta.build_sdist('made')\n"
    done = subprocess.run([*ALONE, script], cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    with tarfile.open(next((source / "made").glob("*.tar.gz"))) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    due = [path for folder in ("tests", "example") for path in (AGENTS / folder).iterdir() if path.is_file()]
    assert len(due) > 5 and {str(path.relative_to(AGENTS)) for path in due} <= names


def test_every_module_is_imported_from_the_installed_package_alone(site, tmp_path):
    script = "import importlib\n"
    script += f"for name in {MODULES!r}:\n"
    script += (
        "    module = importlib.import_module('cocotbext.rtu' + ('' if name == '__init__' else '.' + name))\n"
    )
    script += "    print(module.__file__)\n"
    script += (
        "assert not [name for name in sys.modules if name.split('.')[0] in ('tb', 'sim', 'rtl', 'regs')]\n"
    )
    done = alone(site, script, tmp_path)
    assert done.returncode == 0, done.stderr
    assert all(line.startswith(str(site)) for line in done.stdout.splitlines())
    assert len(done.stdout.splitlines()) == len(MODULES)


def test_frames_and_crc_need_no_cocotb(site, tmp_path):
    script = "sys.modules['cocotb'] = None\n"
    script += "from cocotbext.rtu import rtu\nprint(rtu.build(1, rtu.read_registers(0, 1)).hex())\n"
    done = alone(site, script, tmp_path)
    assert (done.returncode, done.stdout) == (0, "010300000001840a\n"), done.stderr


def test_the_version_is_that_of_the_release():
    stated = re.search(r'^version = "(.*)"$', (AGENTS / "pyproject.toml").read_text(), re.MULTILINE)
    assert stated[1] == (ROOT / "VERSION").read_text().strip()


@pytest.mark.slow
def test_the_tests_of_the_package_run_with_the_installed_package_alone(site, tmp_path):
    shutil.copytree(AGENTS / "tests", tmp_path / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(AGENTS / "pyproject.toml", tmp_path)
    script = "import pytest\ncode = pytest.main(['-q', '-p', 'no:cacheprovider'])\n"
    script += "import cocotbext.rtu\nprint(cocotbext.rtu.__file__)\nsys.exit(code)\n"
    done = alone(site, script, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1].startswith(str(site)) and " passed in " in done.stdout


def example(
    site: Path, folder: Path, *damage: tuple[str, str], baud: int = 19200, more: tuple[str, ...] = ()
) -> subprocess.CompletedProcess:
    """The example on the slave of docs/example; `damage` replaces text of that slave, `baud` is its rate."""
    text = (ROOT / "docs/example/holding_registers.v").read_text()
    for old, new in damage:
        assert old in text
        text = text.replace(old, new)
    slave = folder / "holding_registers.v"
    slave.write_text(text)
    options = ["--top", "holding_registers", "--clk-hz", "500000", "--baud", "19200", "--build", "build"]
    options += ["--parameter", "CLK_HZ=500000", "--parameter", f"BAUD={baud}", *more]
    return runner(site, folder, *options, *map(str, needed_files("network_port")), str(slave))


def runner(site: Path, folder: Path, *options: str) -> subprocess.CompletedProcess:
    """The example's command line with the installed package."""
    program = str(AGENTS / "example/run.py")
    script = f"import runpy\nsys.argv = [{program!r}, *{options!r}]\n"
    return alone(site, script + f"runpy.run_path({program!r}, run_name='__main__')\n", folder)


@pytest.mark.slow
def test_the_example_runs_with_the_installed_package_alone(site, tmp_path):
    done = example(site, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "edges good" in done.stdout and "TESTS=2 PASS=2" in done.stdout


@pytest.mark.slow
def test_a_fault_of_the_edges_fails_a_strict_run_alone(site, tmp_path):
    """The slave's rate is 2 % off: it reads and writes all the same."""
    for more, code in (((), 0), (("--strict",), 1)):
        done = example(site, tmp_path, baud=19600, more=more)
        assert done.returncode == code and "rate off by -2." in done.stdout, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--form", "9E1"], "--form: invalid choice: '9E1'"),
        (["--pins", "clk,rst"], "--pins: five names with commas, not 'clk,rst'"),
        (["--parameter", "CLK_HZ"], "--parameter: NAME=NUMBER, not 'CLK_HZ'"),
        (["--baud", "0"], "--baud: 1 to 10000000, not '0'"),
        (["--unit", "248"], "--unit: 1 to 247, not '248'"),
        (["nowhere.v"], "there is no nowhere.v"),
    ],
)
def test_a_wrong_option_of_the_example_is_one_line(words, reason, site, tmp_path):
    (tmp_path / "top.v").write_text("module top; endmodule\n")
    right = ["--top", "top", "--clk-hz", "500000", "--baud", "19200", str(tmp_path / "top.v")]
    done = runner(site, tmp_path, *right, *words)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert reason in done.stderr and not (tmp_path / "build").exists()


def test_a_design_that_does_not_build_is_one_line(site, tmp_path):
    (tmp_path / "top.v").write_text("module top; nonsense\n")
    done = runner(site, tmp_path, "--top", "top", "--clk-hz", "500000", "--baud", "19200", "top.v")
    assert done.returncode == 2 and "syntax error" in done.stdout + done.stderr
    assert done.stderr.splitlines()[-1] == "run.py: the simulator failed; its messages are above"


@pytest.mark.slow
def test_the_example_fails_for_a_slave_that_loses_a_bit(site, tmp_path):
    lost = seeded("bit").choice((1, 4))  # the bits that are 1 in the example's value
    done = example(
        site,
        tmp_path,
        (
            "registers[16*n+:16] <= data[16*n+:16]",
            f"registers[16*n+:16] <= data[16*n+:16] & ~16'd{1 << lost}",
        ),
    )
    assert done.returncode == 1 and "PASS=1" in done.stdout, done.stdout + done.stderr
