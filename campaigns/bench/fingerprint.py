# SPDX-License-Identifier: Apache-2.0
"""Identifies the subject of a measurement: short hashes of the card, its firmware image and the bench.

    python -m campaigns.bench.fingerprint [CONFIG]     prints the card's hash, for the build of the bench

Comments, docstrings and layout do not count: a rewording keeps results valid.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from rtl.command import run_main
from rtl.sources import ROOT, SourcesError, card_files, configurations, without_comments
from sw.test import host

BENCH = ("wave", "card", "judge", "traffic", "cases", "conformance", "work")
MODEL_FILES = [ROOT / f"tb/model/{name}.py" for name in ("card", "fc_telegram", "vlt_drive")]
AGENTS = [ROOT / f"tb/agents/{name}.py" for name in ("crc16", "rtu")]
HARNESS = [ROOT / "sim/harness" / name for name in ("card_library.cpp", "card_model.h", "line_player.h")]
HARNESS_PYTHON = [
    ROOT / "sim/harness" / name for name in ("pins.py", "power_up.py", "registers.py", "simulated_card.py")
]
NO_JUDGES = ("plants", "shrink", "fake_mailbox", "firmware", "test_core", "test_flips", "test_fuzz")
STARTS = ("starts", "supervision")
DIGITS = 12
TEXTS = ("page", "report")  # of the fuzzer; they change no verdict


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


def _lines() -> list[tuple[str, str]]:
    """The card between two far ends, and the models: what fuzzer and flips share."""
    python = sorted(path for path in (ROOT / "tb/model").glob("*.py") if path.stem not in NO_JUDGES)
    python += [ROOT / "campaigns/fuzz/case.py", *AGENTS, *HARNESS_PYTHON]
    drive = sorted(path for path in (ROOT / "sim/drive").iterdir() if path.suffix in (".c", ".h"))
    return [*map(_python, python), *map(_code, [*HARNESS, *drive])]


def _campaign(name: str) -> list[tuple[str, str]]:
    others = (*NO_JUDGES, *TEXTS, "case")
    return [
        _python(path) for path in sorted((ROOT / "campaigns" / name).glob("*.py")) if path.stem not in others
    ]


def judge(campaign: str) -> str:
    """Of a campaign without a function here: its programs, and what they may share."""
    programs = sorted((ROOT / "campaigns" / campaign).glob("*.py"))
    if not programs:
        raise SourcesError(f"there is no campaign {campaign!r} whose judge could have a fingerprint")
    return _digest([*_lines(), *(_python(path) for path in programs if path.stem[:5] != "test_")])


def fuzz_judge() -> str:
    """Actions of the fuzzer on the card, and its verdicts."""
    traffic = [
        ROOT / "campaigns/soak/run.py",
        ROOT / "sw/rtu2fc/capture.py",
        ROOT / "tb/lib/recorded_buses.py",
    ]
    captures = [(path.name, path.read_bytes().hex()) for path in sorted((ROOT / "tb/captures").glob("*.sr"))]
    return _digest([*_lines(), *_campaign("fuzz"), *map(_python, traffic), *captures])


def flips_judge() -> str:
    """Actions of the flips on the card, and their verdicts."""
    return _digest([*_lines(), *_campaign("flips")])


def soak() -> str:
    """Traffic and judge of the soak, with the virtual card around the Verilog."""
    python = [ROOT / "campaigns/soak/run.py", *MODEL_FILES, *AGENTS]
    around = [path for folder in ("sim/card", "sim/drive") for path in sorted((ROOT / folder).iterdir())]
    code = [*HARNESS, *(path for path in around if path.suffix in (".c", ".cpp", ".h"))]
    return _digest([*map(_python, python), *map(_code, code)])


def starts() -> str:
    """What is done at a start, and its verdict."""
    return _digest([_python(path) for path in (*(ROOT / f"tb/lib/{name}.py" for name in STARTS), *AGENTS)])


def fuzz(config: str = "standard") -> str:
    """Card, firmware and judge, as stated in results of the fuzzer; only equal ones are added up."""
    return f"{card(config)} {firmware(config)} {fuzz_judge()}"


def flips(config: str = "standard") -> str:
    """As fuzz(), for results of the flips."""
    return f"{card(config)} {firmware(config)} {flips_judge()}"


def bench() -> str:
    """Code that determines measurements and verdicts, without the layout of the report."""
    python = [ROOT / f"campaigns/bench/{name}.py" for name in BENCH]
    python += [*MODEL_FILES, *AGENTS]
    drive = sorted(path for path in (ROOT / "sim/drive").iterdir() if path.suffix in (".c", ".h", ".csv"))
    code = [*HARNESS, *(path for path in drive if path.suffix != ".csv")]
    tables = [(path.name, path.read_text()) for path in drive if path.suffix == ".csv"]
    return _digest([*map(_python, python), *map(_code, code), *tables])


def tree() -> dict[str, str]:
    """Hashes of everything that `make bench` measures in this tree."""
    found = {"card": card(), "firmware": firmware(), "bench": bench()}
    with contextlib.suppress(SourcesError):
        found |= {"tiny card": card("tiny"), "tiny firmware": firmware("tiny")}
    return found


# What a report may have been measured on or by, by the name in docs/evidence.json.
SUBJECTS: dict[str, Callable[[], str]] = {
    "standard card": card,
    "tiny card": partial(card, "tiny"),
    "firmware": host.fingerprint,
    "bench": bench,
    "fuzz judge": fuzz_judge,
    "flips judge": flips_judge,
    "soak judge": soak,
    "starts judge": starts,
}


def now(*names: str) -> dict[str, str]:
    """The present fingerprints of these subjects, or of the judges of other campaigns (`NAME judge`)."""
    return {name: SUBJECTS[name]() if name in SUBJECTS else judge(name.split()[0]) for name in names}


def difference(one: dict[str, str], other: dict[str, str]) -> list[str]:
    """Names of the hashes that differ."""
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


if __name__ == "__main__":
    run_main("fingerprint", lambda: print(card(*sys.argv[1:2])))
