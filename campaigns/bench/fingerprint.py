# SPDX-License-Identifier: Apache-2.0
"""Identifies the subject of a measurement: short hashes of the card, its firmware image and the bench.

    python -m campaigns.bench.fingerprint [CONFIG]     prints the card's hash, for the build of the bench

Comments, docstrings and layout do not count: a rewording keeps results valid.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from regs.dialects import DEFAULT, DIALECTS
from rtl.command import run_main
from rtl.sources import ROOT, SourcesError, card_files, configurations, without_comments
from sw.test import host

# Of a campaign: the modules that decide a verdict, if not all that campaigns/NAME/run.py imports, and the
# files that they read.
JUDGES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "starts": (("tb.lib.starts",), ()),
    "flips": (("campaigns.flips.group",), ()),
    "conformance": (
        ("campaigns.conformance.run", "campaigns.conformance.pins_bench"),
        ("campaigns/conformance/designs.toml",),
    ),
    "masters": (
        ("campaigns.masters.run",),
        ("campaigns/masters/adapters/*.*", "campaigns/masters/example_programs/*.*"),
    ),
    "fuzz": (("campaigns.fuzz.trial", "campaigns.fuzz.impatient"), ("tb/captures/*.sr",)),
}
# The simulated card with its far ends, and the drive.
AROUND = ("sim/harness", "sim/card", "sim/drive")
# They change no verdict.
TEXTS = {"campaigns.engine", "campaigns.bench.fingerprint", "campaigns.bench.report", "rtl.command"}
TEXTS |= {"campaigns.fuzz.report", "campaigns.masters.page", "rtl.report_page", "tb.lib.bound"}
TEXTS |= {"tb.lib.options"}
DIGITS = 12


def _digest(parts: list[tuple[str, str]]) -> str:
    content = hashlib.sha256()
    for name, text in parts:
        content.update(f"{name}\0{text}\0".encode())
    return content.hexdigest()[:DIGITS]


def _code(path: Path) -> tuple[str, str]:
    """Name and code of a Verilog, C or C++ file."""
    return path.name, " ".join(without_comments(path).split())


def _python(path: Path) -> tuple[str, str]:
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node):
            del node.body[0]
    return path.name, ast.dump(tree)


def card(config: str = "standard") -> str:
    """Every Verilog file with the soft core, and the settings in configs.toml."""
    entry = json.dumps(configurations()[config], sort_keys=True)
    return _digest([(config, entry), *map(_code, card_files(config))])


def firmware(config: str = "standard", dialect: str = "card") -> str:
    image = ROOT / configurations()[config]["firmware_hex"]
    if dialect != "card":
        image = image.parent / dialect / image.name
    return _digest([(config, image.read_text() if image.exists() else "")])


def every_image(config: str = "standard") -> str:
    """The images of all dialects: a change of an option that is off makes the same ones."""
    dialects = DIALECTS if config == "standard" else [DEFAULT]
    return _digest([(dialect, firmware(config, dialect)) for dialect in dialects])


def imported(*modules: str) -> list[Path]:
    """These modules and all of ours that they import, but for those of TEXTS."""
    found: dict[str, Path] = {}
    left = list(modules)
    while left:
        name = left.pop()
        path = ROOT / Path(*name.split(".")).with_suffix(".py")
        if name in found or name in TEXTS or not path.is_file():
            continue
        found[name] = path
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                left += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                left += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return [found[name] for name in sorted(found)]


@functools.cache
def judge(campaign: str) -> str:
    """Of a campaign: its program and what decides a verdict, here and in the simulation."""
    own = ROOT / f"campaigns/{campaign}/run.py"
    if not own.exists():
        raise SourcesError(f"there is no campaign {campaign!r} whose judge could have a fingerprint")
    deciding, read = JUDGES.get(campaign, ((f"campaigns.{campaign}.run",), ()))
    around = [path for folder in AROUND for path in sorted((ROOT / folder).iterdir())]
    code = [_code(path) for path in around if path.suffix in (".c", ".cpp", ".h")]
    data = [path for path in around if path.suffix == ".csv"]
    data += [path for pattern in read for path in sorted(ROOT.glob(pattern))]
    contents = [(path.name, path.read_bytes().hex()) for path in data]
    return _digest([*map(_python, [own, *imported(*deciding)]), *code, *contents])


# What a report may have been measured on or by, by the name in docs/evidence.json.
SUBJECTS: dict[str, Callable[[], str]] = {
    "standard card": card,
    "tiny card": partial(card, "tiny"),
    "firmware": host.fingerprint,
    "bench": partial(judge, "bench"),  # of a report from before its judge was named as the others'
}


def now(*names: str) -> dict[str, str]:
    """The present fingerprints of these subjects, or of the judges of other campaigns (`NAME judge`)."""
    return {name: SUBJECTS[name]() if name in SUBJECTS else judge(name.split()[0]) for name in names}


def difference(one: dict[str, str], other: dict[str, str]) -> list[str]:
    """Names of the hashes that differ."""
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


if __name__ == "__main__":
    run_main("fingerprint", lambda: print(card(*sys.argv[1:2])))
