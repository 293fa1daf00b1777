# SPDX-License-Identifier: Apache-2.0
"""Prints every Verilog file of a whole card, soft core included, one path a line.

    python -m rtl.sources [CONFIG]     default: standard; exit 2 for a configuration that is not there

The project's own files come from rtl/rtl.f, the core's from configs.toml, and one file of macros carries
what the configuration sets. The core's files come first, because their `timescale holds for all that
follow. The macros come second, the others in any order.
"""

import importlib.util
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

from rtl.command import run_main

ROOT = Path(__file__).resolve().parents[1]
FILE_LIST = ROOT / "rtl/rtl.f"
CORE_WRAPPER = "soft_core"


class SourcesError(Exception):
    """One line that tells the user what is wrong."""


def commit() -> str:
    """The commit of the files as they are now; empty where there is no git."""
    command = ["git", "describe", "--always", "--dirty"]
    try:
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:
        return ""


def bench_file(module: str) -> Path | None:
    """The cocotb bench of a module of rtl/, as a path from the root; None where it has none."""
    found = sorted(ROOT.glob(f"tb/*/test_{module}.py"))
    return found[0].relative_to(ROOT) if found else None


def configurations() -> dict[str, dict]:
    return tomllib.loads((ROOT / "configs.toml").read_text())


def rtl_files() -> list[Path]:
    """The project's own Verilog files, in any order."""
    return [ROOT / line for line in FILE_LIST.read_text().split()]


def without_comments(path: Path) -> str:
    return re.sub(r"//.*?$|/\*.*?\*/", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)


def configuration(config: str) -> dict:
    known = configurations()
    if config not in known:
        raise SourcesError(f"no configuration {config!r} in configs.toml; there are: {', '.join(known)}")
    return known[config]


def macros_file(config: str) -> Path:
    """What the configuration sets, as macros for the parameters of the top; not in rtl/rtl.f."""
    return ROOT / f"regs/generated/config_{config}.v"


def core_files(config: str = "standard") -> list[Path]:
    """The soft core's Verilog files, which lie inside a Python package, and the configuration's macros."""
    entry = configuration(config)
    spec = importlib.util.find_spec(entry["core_package"])
    if spec is None or spec.origin is None:
        raise SourcesError(f"Python package {entry['core_package']} is missing; run `make setup`")
    package = Path(spec.origin).parent
    return [*(package / name for name in entry["core_sources"]), macros_file(config)]


def card_files(config: str = "standard") -> list[Path]:
    """Every Verilog file of the card; the core first, as its `timescale holds for all that follow."""
    return core_files(config) + rtl_files()


@cache
def needed_files(top: str, config: str = "standard") -> tuple[Path, ...]:
    """The files of `top` and of all modules below it; a module lies in the file of its name."""
    own = rtl_files()
    modules = {path.stem: path for path in own}
    if top not in modules:
        raise SourcesError(f"no module {top} in {FILE_LIST.relative_to(ROOT)}")
    found, queue = set(), [top]
    while queue:
        name = queue.pop()
        if name in found:
            continue
        found.add(name)
        queue += modules.keys() & set(re.findall(r"\w+", without_comments(modules[name])))
    files = [path for path in own if path.stem in found]
    return tuple((core_files(config) if CORE_WRAPPER in found else []) + files)


def main() -> int:
    config = sys.argv[1] if len(sys.argv) > 1 else "standard"
    try:
        print("\n".join(str(path) for path in card_files(config)), flush=True)
    except SourcesError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    run_main("sources", main)
