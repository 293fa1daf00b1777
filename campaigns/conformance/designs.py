# SPDX-License-Identifier: Apache-2.0
"""The HDL slaves of designs.toml: fetches sources of other projects into build/, simulates them on Icarus.

This project holds no copy of those sources; a commit pins each. An error is one line for the user.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
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

    @property
    def commit(self) -> str | None:
        return self.entry.get("commit")

    def sources(self) -> list[Path]:
        """All files of the design. Files of other projects are fetched first."""
        if not self.commit:
            return [*needed_files(self.entry["needs"]), *(ROOT / name for name in self.entry["files"])]
        folder = fetched(self.name, self.entry["repo"], self.commit)
        ours = [HERE / "designs" / self.entry["wrapper"]] if "wrapper" in self.entry else []
        return [*(folder / name for name in self.entry["files"]), *ours]


def designs() -> dict[str, Design]:
    entries = tomllib.loads((HERE / "designs.toml").read_text())
    return {name: Design(name, entry) for name, entry in entries.items()}


def fetched(name: str, repo: str, commit: str) -> Path:
    """The folder with the sources at the commit. The commit's hash shows git that they are unchanged."""
    folder = BUILD / "sources" / f"{name}-{commit[:12]}"
    if (folder / ".git/done").exists():
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    for command in (
        ["git", "clone", "-q", "--no-checkout", repo, str(folder)],
        ["git", "-C", str(folder), "checkout", "-q", commit],
    ):
        # A repository that is not there must not ask for a password.
        quiet = os.environ | {"GIT_TERMINAL_PROMPT": "0"}
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=quiet)
        if done.returncode:
            reason = (done.stderr.strip().splitlines() or ["git failed"])[-1]
            raise DesignError(f"cannot fetch {repo} at {commit[:12]}: {reason}")
    (folder / ".git/done").touch()
    return folder


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
        raise DesignError(f"{design.title} was not graded; {named(folder)}/*.log say why")
    found = json.loads(verdicts.read_text())
    if isinstance(found, dict):
        raise NoAnswer(f"{design.title}: {found['error']}")
    return [Verdict(**one) for one in found]


def named(path: Path) -> str:
    return re.sub(r"^\./", "", str(path.relative_to(ROOT)))
