# SPDX-License-Identifier: Apache-2.0
"""Finds the package of these tests: the installed one, or in its sources the folder above."""

from __future__ import annotations

import atexit
import importlib.util
import shutil
import sys
import tempfile
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent


def is_installed() -> bool:
    try:
        return importlib.util.find_spec("cocotbext.rtu") is not None
    except ModuleNotFoundError:
        return False


if not is_installed():
    folder = Path(tempfile.mkdtemp(prefix="cocotbext-rtu-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "cocotbext").mkdir()
    (folder / "cocotbext/rtu").symlink_to(HERE.parent)
    sys.path.insert(0, str(folder))
sys.path.insert(0, str(HERE))  # a simulation gets this path, and finds wire_bench there


@pytest.fixture
def sim() -> str:
    """The simulator. Another plugin may choose it by parametrising the test."""
    return "icarus"
