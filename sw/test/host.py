# SPDX-License-Identifier: Apache-2.0
"""The firmware's source files, and builds of them for the host.

A build is a row of BUILDS: a dialect, or the card dialect with an option of sw/include/options.h. The tests
load folders of builds (FIRMWARE_LIBRARIES, tb/model/firmware.py).
"""

from __future__ import annotations

import hashlib
import subprocess
from functools import cache
from pathlib import Path

from regs.dialects import DIALECTS, OPTIONS
from rtl.report_page import publish
from rtl.sources import without_comments

ROOT = Path(__file__).resolve().parents[2]
# Name and preprocessor symbols of each build.
BUILDS = {name: [f"-DDIALECT={dialect.macro}"] for name, dialect in DIALECTS.items()} | {
    name: ["-DDIALECT=DIALECT_CARD", f"-D{name}={option.tried}"] for name, option in OPTIONS.items()
}
# The translation core: the files that decide the content of telegrams and replies.
CORE = ("translate.c", "coils.c", "registers.c", "telegram.c", "codes.h", "dialect.h")
INCLUDES = ["-Isw/include", "-Isw/src", "-Iregs/generated", "-Isw/port/host"]
HOST = tuple(f"sw/port/host/{name}.c" for name in ("host", "mailbox_model", "machine"))
# The tests that need no simulator. Random tests do not count for the coverage.
TESTS = [f"tb/firmware/test_firmware_{part}.py" for part in ("translate", "dialects", "gateway", "image")]
RANDOM = "random or any_sequence"


@cache
def sources() -> tuple[str, ...]:
    """The C files common to card and host."""
    make = ["make", "-s", "-f", "sw/firmware.mk", "firmware-sources"]
    return tuple(subprocess.run(make, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split())


def compile_library(build: str, folder: Path, *flags: str, tree: Path = ROOT) -> subprocess.CompletedProcess:
    """Builds FOLDER/BUILD/libtranslate.so from the sources below `tree`, which may be a changed copy."""
    target = folder / build / "libtranslate.so"
    target.parent.mkdir(parents=True, exist_ok=True)
    command = ["gcc", "-std=c99", *INCLUDES, *BUILDS[build], *flags, "-fPIC", "-shared", "-o", str(target)]
    command += [*sources(), *HOST]
    return subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)


def fingerprint() -> str:
    """A short hash of the firmware's C files. Comments and layout do not count."""
    content = hashlib.sha256()
    for folder in ("sw/src", "sw/include"):
        for path in sorted(path for path in (ROOT / folder).iterdir() if path.suffix in (".c", ".h")):
            content.update(f"{path.name}\0{' '.join(without_comments(path).split())}\0".encode())
    return content.hexdigest()[:12]


def put_figures(title: str, command: str, text: str) -> None:
    """The report of a command on the firmware: what it printed."""
    name = f"firmware-{title.split()[0].lower()}"
    page = f"# Firmware: {title}\n\n`{command}`, firmware sources `{fingerprint()}`:\n\n```\n{text}\n```\n"
    publish(name, page, command, {"firmware": fingerprint()}, text)
