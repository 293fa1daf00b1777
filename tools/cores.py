# SPDX-License-Identifier: Apache-2.0
"""Compares the .core files with rtl/rtl.f, configs.toml and VERSION.

    python -m tools.cores

A core file for FuseSoC lists files of rtl/rtl.f. Each file is in one core only, because a design may take
both ports. Prints one line for each mistake; exit 1 if there is one. docs/guide/integration.md describes the
cores.
"""

from pathlib import Path

import yaml

from rtl.command import run_main
from rtl.sources import ROOT, configurations, macros_file, needed_files, rtl_files

# The card, and the cores that it takes.
CARD = "rtu2fc"
LINE = "line"
PORTS = ("network_port", "drive_port")
EXAMPLE = ROOT / "docs/example/holding_registers.core"
# Time and formats on the card: a port needs them, but does not instantiate them.
BESIDE = {"rtl/baud_base.v", "rtl/baud_divider.v", "regs/generated/card_tables.v"}


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def core_files(folder: Path = ROOT) -> list[Path]:
    return [*sorted(folder.glob("*.core")), folder / EXAMPLE.relative_to(ROOT)]


def read(path: Path) -> dict:
    """A core file. Its first line, CAPI=2:, is no YAML."""
    return yaml.safe_load(path.read_text().split("\n", 1)[1])


def check(folder: Path = ROOT) -> list[str]:
    """Mistakes in the core files of `folder`."""
    cores = {path.stem: read(path) for path in core_files(folder)}
    version = (ROOT / "VERSION").read_text().strip()
    wrong = []
    for stem, core in cores.items():
        if core["name"] != f":{CARD}:{stem}:{version}":
            wrong.append(f"{stem}.core: the name is {core['name']}, not :{CARD}:{stem}:{version}")
        for depend in (one for fileset in core["filesets"].values() for one in fileset.get("depend", ())):
            if f":{CARD}:" in depend and depend not in {f"=:{CARD}:{other}:{version}" for other in cores}:
                wrong.append(f"{stem}.core: {depend} is no core of version {version}")

    files = {stem: core["filesets"]["rtl"]["files"] for stem, core in cores.items()}
    known = [name(path) for path in rtl_files()]
    listed = [file for stem in (LINE, *PORTS, CARD) for file in files[stem]]
    wrong += [f"{file} is in no core" for file in known if file not in listed]
    wrong += [f"{file} is in a core, but not in rtl/rtl.f" for file in listed if file not in known]
    wrong += [f"{file} is in two cores" for file in sorted(set(listed)) if listed.count(file) > 1]
    for port in PORTS:
        needed, there = {name(path) for path in needed_files(port)}, {*files[LINE], *files[port]}
        wrong += [f"{port}.core: {file} is missing" for file in sorted(needed - there)]
        wrong += [f"{port}.core: {file} is of no use" for file in sorted(there - needed - BESIDE)]
    for config, entry in configurations().items():
        fileset = cores[CARD]["filesets"].get(config, {"files": [], "depend": [""]})
        if (
            fileset["files"] != [name(macros_file(config))]
            or f":{entry['soft_core']}:" not in fileset["depend"][0]
        ):
            wrong.append(f"{CARD}.core: the fileset {config} is not that of configs.toml")
    return wrong


def main() -> int:
    wrong = check()
    print("\n".join(wrong), end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("cores", main)
