# SPDX-License-Identifier: Apache-2.0
"""The HDL slaves of designs.toml, simulated on Icarus. An error is one line for the user."""

from __future__ import annotations

import json
import tomllib
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from rtl.sources import ROOT, needed_files
from sw.rtu2fc.engine import NoAnswer, Verdict

HERE = Path(__file__).parent
BUILD = ROOT / "build/conformance"


class DesignError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Design:
    """An entry of designs.toml."""

    name: str
    entry: dict

    @property
    def title(self) -> str:
        return self.entry["title"]

    def sources(self) -> list[Path]:
        needs = needed_files(self.entry["needs"]) if "needs" in self.entry else []
        return [*needs, *(ROOT / name for name in self.entry["files"])]


def designs() -> dict[str, Design]:
    entries = tomllib.loads((HERE / "designs.toml").read_text())
    return {name: Design(name, entry) for name, entry in entries.items()}


def grade(design: Design, only: list[str] | None = None) -> list[Verdict]:
    """The verdicts of a design, or those of the tests in `only`. Logs go to build/conformance."""
    from cocotb_tools.runner import get_runner

    folder = BUILD / design.name
    folder.mkdir(parents=True, exist_ok=True)
    verdicts, log = folder / "verdicts.json", folder / "log"
    verdicts.unlink(missing_ok=True)
    runner, entry = get_runner("icarus"), design.entry
    with open(log, "w") as messages, redirect_stdout(messages), redirect_stderr(messages):
        try:
            runner.build(
                sources=design.sources(),
                hdl_toplevel=entry["top"],
                parameters=entry.get("parameters", {}),
                build_dir=folder,
                timescale=("1ns", "1ps"),
                always=True,
                log_file=folder / "build.log",
            )
            runner.test(
                hdl_toplevel=entry["top"],
                hdl_toplevel_lang="verilog",
                test_module="campaigns.conformance.pins_bench",
                build_dir=folder,
                test_dir=folder,
                log_file=folder / "run.log",
                extra_env={
                    "DESIGN": json.dumps(entry | ({"only": only} if only else {})),
                    "VERDICTS": str(verdicts),
                },
            )
        except (RuntimeError, SystemExit):
            pass  # the verdicts are checked below
    if not verdicts.exists():
        raise DesignError(f"{design.title} was not graded; {folder.relative_to(ROOT)}/*.log say why")
    found = json.loads(verdicts.read_text())
    if isinstance(found, dict):
        raise NoAnswer(f"{design.title}: {found['error']}")
    return [Verdict(**one) for one in found]
