# SPDX-License-Identifier: Apache-2.0
"""The command from its wheel, in an empty environment: with the oldest and the newest Python that is here."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from sim.card.run_card import ROOT, RunningCard
from sw.rtu2fc import VERSION
from tools import wheels

pytestmark = pytest.mark.nightly
OLDEST = (3, 10)


def version_of(python: str) -> tuple[int, ...]:
    done = subprocess.run([python, "--version"], capture_output=True, text=True, check=False)
    found = re.match(r"Python (\d+)\.(\d+)", done.stdout)
    return tuple(map(int, found.groups())) if done.returncode == 0 and found else (0, 0)


def pythons() -> list[str]:
    """The oldest that is not older than OLDEST, and the newest."""
    names = [path for minor in range(10, 30) if (path := shutil.which(f"python3.{minor}"))]
    names += map(str, Path.home().glob(".pyenv/versions/*/bin/python"))
    by_version = {version_of(name): name for name in [*names, sys.executable]}
    good = sorted(version for version in by_version if version >= OLDEST)
    return [by_version[version] for version in dict.fromkeys((good[0], good[-1]))]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheels")
    return next(path for path in wheels.build(folder) if path.name.startswith("rtu2fc-"))


@pytest.mark.parametrize("which", [0, -1], ids=["oldest", "newest"])
def test_the_wheel_works_with_no_checkout_in_sight(wheel, tmp_path, which):
    python = pythons()[which]
    place, home = tmp_path / "place", tmp_path / "env"
    place.mkdir()
    clean = {name: os.environ[name] for name in ("PATH", "HOME", "TMPDIR") if name in os.environ}
    clean |= {"COLUMNS": "80", "LANG": "C.UTF-8"}

    def run(*words: object, code: int = 0) -> str:
        done = subprocess.run(
            list(map(str, words)), cwd=place, env=clean, capture_output=True, text=True, check=False
        )
        assert done.returncode == code, done.stdout + done.stderr
        return done.stdout + done.stderr

    run(python, "-m", "venv", home)
    run(home / "bin/pip", "install", "-q", "--disable-pip-version-check", wheel)
    command = home / "bin/rtu2fc"
    assert run(command, "--version") == f"rtu2fc {VERSION}\n"
    where = run(
        home / "bin/python", "-I", "-c", "import rtu2fc.cli, sys; print(*sys.modules['rtu2fc'].__path__)"
    )
    assert where.startswith(str(home)) and str(ROOT) not in where
    assert "514  Readout: Motor current" in run(command, "parameters", "514")
    assert "rtu2fc" in run(home / "bin/python", "-m", "rtu2fc", "--help")
    with RunningCard(tmp_path, "--quiet") as card:
        assert "status word 0" in run(command, "status", card.link)
        assert "✗" not in run(command, "check", card.link, "--drive", "yes", "--row", "coil")
        assert "no answer" in run(command, "read", card.link, 514, "--unit", 9, code=4)


def test_the_cases_need_nothing_else(wheel, tmp_path):
    """The example of their README, on a slave of one register that refuses all but a read of it."""
    (cases,) = wheel.parent.glob("modbus_rtu_conformance-*.whl")
    (text,) = re.findall(r"```python\n(.*?)```", (ROOT / "sw/conformance/README.md").read_text(), re.DOTALL)
    script = f"""import sys
sys.path.insert(0, {str(cases)!r})
from modbus_rtu_conformance import rtu
read = bytes.fromhex("03 0000 0001")
my_slave = lambda frame: {{
    rtu.build(17, read): rtu.build(17, bytes.fromhex("03 02 0000"))
}}.get(frame, rtu.build(17, bytes([frame[1] | 128, 1])) if frame[:1] == bytes([17]) else b"")
{text}
assert not [name for name in sys.modules if name.split(".")[0] in ("rtu2fc", "sw", "tb", "serial", "cocotb")]
"""
    done = subprocess.run(
        [pythons()[0], "-I", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    said = dict(re.findall(r"^(\S+) (pass|fail)", done.stdout, re.MULTILINE))
    assert [said[number] for number in ("SL-1", "AP-15", "AP-2")] == ["pass", "pass", "fail"]


def test_each_build_has_the_same_bytes(wheel, tmp_path, monkeypatch):
    """From another folder, with other modes of the user's files."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    before = os.umask(0o077)
    try:
        again = {path.name: path.read_bytes() for path in wheels.build(tmp_path / "again")}
    finally:
        os.umask(before)
    assert set(again) == {path.name for path in wheel.parent.glob("*.whl")} and len(again) == len(
        wheels.PACKAGES
    )
    for name, content in again.items():
        assert (wheel.parent / name).read_bytes() == content, name


def test_each_wheel_has_readme_licence_and_types(wheel):
    for path in wheel.parent.glob("*.whl"):
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            (metadata,) = (archive.read(name).decode() for name in names if name.endswith("METADATA"))
        assert any(name.endswith("licenses/LICENSE") for name in names), path
        assert any(name.endswith("py.typed") for name in names), path
        assert f"\nVersion: {VERSION}\n" in metadata and "\n# " in metadata, path
        assert not [name for name in names if "test" in name or "setup.py" in name], path
