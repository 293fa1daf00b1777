# SPDX-License-Identifier: Apache-2.0
"""Builds a module for a simulator and runs the cocotb tests of a Python module on it.

Every build lies in the cache of rtl/cache.py, under a hash of everything it was made from: sources,
parameters, options, tools. No stale build is reused, and all checkouts on a machine share it.
Environment: WAVES=1 writes build/waves/<test>.fst with the line traffic as .pcapng and .jsonl, and prints
the file names. RTL_COVERAGE=folder counts coverage of rtl/ on Verilator and leaves one file per simulation
there (campaigns/coverage/run.py).
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from rtl import cache
from rtl.sources import ROOT, configuration, needed_files, rtl_files
from sim.harness.power_up import copies_without_values
from sim.harness.wave_rows import ROW_FILES, copies_with_rows
from tb.lib.config import CLOCK_VARIABLE, CONFIG_VARIABLE
from tb.lib.seeds import seeded
from tb.model.card import DIALECTS

SIMULATORS = ("icarus", "verilator")
WAIVERS = ROOT / "tools/verilator.vlt"
# A simulator clears reset_sync and driver_limit by an edge of rst_n only, and a bench begins with rst_n at 0.
# The monitors follow tx from the first moment on, with DE or without.
KEEP_VALUES = ("reset_sync", "driver_limit", "uart")
POWER_UP = ROOT / "sim/harness/power_up.py"
PUBLIC = ROOT / "tb/lib/public.vlt"
PUBLIC_PORTS = ROOT / "tb/gates/ports.vlt"
COVERAGE_OFF = ROOT / "tb/lib/coverage.vlt"
WAVES_FOLDER = ROOT / "build/waves"
TIMESCALE = ("1ns", "1ps")

IMAGE = "firmware.hex"  # name of the firmware image for the card while a test runs
LINES = "lines"  # base name of capture and log while a test runs


@dataclass(frozen=True)
class Recording:
    """Waveform of a test, the GTKWave view of its top, and capture and log if the top has lines."""

    wave: Path
    view: Path
    others: tuple[Path, ...]


recordings: list[Recording] = []  # of this session

# `make lint` checks warnings; a build here ignores them.
BUILD_ARGS = {
    "icarus": [],
    # A split model uses precompiled headers, which the packaged Verilator cannot make.
    "verilator": [
        "-Wno-fatal",
        "--no-timing",
        "-CFLAGS",
        "-O1",
        "--x-initial",
        "unique",
        "--output-split",
        "0",
    ],
}
# FST, because Verilator's default, VCD, is large and slow.
WAVES_ARGS = {
    "icarus": [],
    "verilator": ["--trace-fst"],
}
COVERAGE_ARGS = ["--coverage-line", "--coverage-toggle"]
TOOLS = {"icarus": ("iverilog", "vvp"), "verilator": ("verilator", "g++", "make")}


def run(
    top: str,
    test_module: str,
    *,
    sim: str,
    config: str = "standard",
    parameters: Mapping[str, object] | None = None,
    sources: Sequence[Path] | None = None,
    extra_sources: Sequence[Path] = (),
    testcase: str | Sequence[str] | None = None,
    extra_env: Mapping[str, str] | None = None,
) -> None:
    """Runs the cocotb tests of `test_module` on module `top`; fails like any pytest test.

    By default the sources are `top` and all modules below it, with the soft core and firmware of `config`.
    A bench with a Verilog wrapper passes it as `extra_sources`, with `top` in it; `sources` replaces the
    search. String parameters are quoted here. `testcase` names the cocotb tests to run, parametrised ones by
    their function; default: all.
    """
    # Not at the top: each simulation imports this file, too.
    from cocotb_tools.runner import as_sv_literal, get_runner

    for tool in TOOLS[sim]:
        if shutil.which(tool) is None:
            pytest.fail(f"{tool} is missing; run `make setup`", pytrace=False)
    waves = os.environ.get("WAVES", "0") not in ("", "0")
    parameters = dict(parameters or {})
    clock = {CLOCK_VARIABLE: str(parameters["CLK_HZ"])} if top == "rtu2fc" and "CLK_HZ" in parameters else {}
    whole_card, netlist = top == "rtu2fc" and sim == "verilator", sources is not None
    inside = (PUBLIC_PORTS if netlist else PUBLIC) if whole_card else None
    if sources is None:
        sources = bench_files(extra_sources, config) if extra_sources else needed_files(top, config)
    sources = [*sources, *extra_sources]
    if top == "rtu2fc":
        parameters.setdefault("FIRMWARE_HEX", str(firmware(config)))
    if top == "rtu2fc" and not netlist:
        # One core: nothing fails in these benches. Many run at 38400 or 115200 bit/s or with 8N1.
        parameters = {"LOCKSTEP": 0, "EXTENDED_SWITCHES": 1, **parameters}
    # The image is no part of a build: each simulation reads it by this name in its own folder.
    image = {"FIRMWARE_HEX": IMAGE} if "FIRMWARE_HEX" in parameters else {}
    literals = {name: as_sv_literal(value) for name, value in (parameters | image).items()}
    test_name = _test_name()
    run_folder = ROOT / "build/tests" / test_name
    shutil.rmtree(run_folder, ignore_errors=True)
    run_folder.mkdir(parents=True)

    # Coverage is counted by file, so it takes the files as they are. A netlist has the contents of its block
    # RAMs in `initial` statements.
    random_contents = whole_card and not netlist and not os.environ.get("RTL_COVERAGE")
    plusargs = _random_contents() if random_contents else []
    if waves and sim == "icarus":
        plusargs.append(f"+dumpfile_path={run_folder / 'icarus.fst'}")

    runner = get_runner(sim)
    build_folder = _build(runner, top, sim, sources, literals, waves, random_contents, inside)
    results = run_folder / "results.xml"
    dump = run_folder / ("dump.fst" if sim == "verilator" else "icarus.fst")
    if image:
        (run_folder / IMAGE).symlink_to(parameters["FIRMWARE_HEX"])
    try:
        runner.test(
            hdl_toplevel=top,
            hdl_toplevel_lang="verilog",
            test_module=test_module,
            test_filter=_filter(testcase),
            build_dir=build_folder,
            test_dir=run_folder,
            results_xml=str(results),
            plusargs=plusargs,
            timescale=TIMESCALE,
            waves=waves,
            extra_env={
                "PYTHONWARNINGS": "error::DeprecationWarning",
                "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",  # cocotb asks pytest for its assertions alone
                # A build of another checkout names the libraries of that one, which may be gone.
                "LD_LIBRARY_PATH": _library_path(),
                CONFIG_VARIABLE: config,
                **clock,
                **(_recording(run_folder, parameters) if waves else {}),
                **(extra_env or {}),
            },
        )
    except SystemExit:
        pass  # the results file is checked below
    finally:
        if waves and dump.exists():
            _keep_recording(run_folder, dump, test_name, top, parameters)
        _keep_coverage(run_folder / "coverage.dat", test_name)
    _check_results(results)


def _library_path() -> str:
    from cocotb_tools import config as cocotb_files

    folders = [str(cocotb_files.libs_dir), os.environ.get("LD_LIBRARY_PATH", "")]
    return os.pathsep.join(filter(None, folders))


def _filter(testcase: str | Sequence[str] | None) -> str | None:
    if testcase is None:
        return None
    names = [testcase] if isinstance(testcase, str) else testcase
    # A parameter may have a point, too.
    return rf"^[\w.]+\.({'|'.join(names)})(/|$)"


def bench_files(wrappers: Sequence[Path], config: str = "standard") -> list[Path]:
    """The files of rtl/ that the wrappers of a bench need."""
    words = set(re.findall(r"\w+", "".join(Path(path).read_text() for path in wrappers)))
    tops = [path.stem for path in rtl_files() if path.stem in words]
    files = [path for top in tops for path in needed_files(top, config)]
    return list(dict.fromkeys(files))


def firmware(config: str = "standard") -> Path:
    """The firmware image of the configuration, as .hex."""
    path = ROOT / configuration(config)["firmware_hex"]
    if not path.exists():
        pytest.fail(f"{path.relative_to(ROOT)} is missing; run `make firmware`", pytrace=False)
    return path


def _test_name() -> str:
    """The running pytest test as a file name: module.test[parameters]."""
    node = os.environ["PYTEST_CURRENT_TEST"].rsplit(" (", 1)[0]
    return re.sub(r"[^\w.=-]+", "-", Path(node.split("::")[0]).stem + "." + node.split("::")[-1]).strip("-")


def _random_contents() -> list[str]:
    """Arguments of a Verilator simulation whose registers hold anything at power-up (SAFE-5)."""
    seed = seeded("register contents at power-up").randrange(1, 1 << 31)
    return ["+verilator+rand+reset+2", f"+verilator+seed+{seed}"]


def _without_values(path: Path, folder: Path) -> Path:
    return (
        path
        if path.suffix == ".vlt" or path.stem in KEEP_VALUES
        else copies_without_values([path], folder)[0]
    )


def _build(
    runner,
    top: str,
    sim: str,
    sources: Sequence[Path],
    parameters: Mapping[str, str],
    waves: bool,
    random_contents: bool,
    inside: Path | None,
) -> Path:
    """Compiles, unless the same content was compiled before; returns the build folder.

    `random_contents`: the registers get no value at power-up. `inside`: names what the bench
    may write; default: all.
    """
    args = BUILD_ARGS[sim] + (WAVES_ARGS[sim] if waves else [])
    inputs = list(sources) + ([WAIVERS] if sim == "verilator" else [])
    if inside:
        inputs.append(inside)
        args.append("--no-public-flat-rw")
    place = ""
    if sim == "verilator" and os.environ.get("RTL_COVERAGE"):
        args += COVERAGE_ARGS
        inputs.append(COVERAGE_OFF)
        place = ROOT  # the counts name the files by their paths
    name = cache.key(
        *(top, sorted(parameters.items()), args, waves, random_contents, TIMESCALE, place),
        files=[*inputs, POWER_UP, *ROW_FILES],
        packages=["cocotb", "verilator"] if sim == "verilator" else ["cocotb"],
        tool="g++ --version" if sim == "verilator" else "iverilog -V",
    )
    made = top if sim == "verilator" else "sim.vvp"

    def make(folder: Path) -> list[Path]:
        cache.use_ccache()
        files = inputs
        if random_contents:
            files = [_without_values(Path(path), folder / "sources") for path in inputs]
        if waves:
            files = copies_with_rows(files, folder / "sources")
        try:
            runner.build(
                hdl_toplevel=top,
                sources=files,
                parameters=parameters,
                build_args=args,
                build_dir=folder,
                timescale=TIMESCALE,
                waves=waves,
            )
        except RuntimeError:
            pytest.fail(f"{sim} could not build {top}; its messages are above", pytrace=False)
        return [folder / made]

    folder = cache.made(sim, f"{top}-{name}", make)
    # runner.test() reads these attributes, which runner.build() would have set.
    runner.build_dir, runner.parameters, runner.waves = folder, dict(parameters), waves
    runner.sources = inputs
    return folder


def _recording(run_folder: Path, parameters: Mapping[str, object]) -> dict[str, str]:
    """Environment for tb/lib/recording.py: where to write, dialect of the texts, silences."""
    image_folder = Path(str(parameters.get("FIRMWARE_HEX", ""))).parent.name
    return {
        "RECORD": str(run_folder / LINES),
        "RECORD_DIALECT": image_folder if image_folder in DIALECTS else "card",
        "RECORD_STRICT": str(int("gaps" not in image_folder)),
    }


def _keep_recording(
    run_folder: Path, dump: Path, test_name: str, top: str, parameters: Mapping[str, object]
) -> None:
    """Keeps waveform, capture and log under the test's name; a module without lines has a waveform only."""
    from sim.view.waves import save_file

    WAVES_FOLDER.mkdir(parents=True, exist_ok=True)
    kept = WAVES_FOLDER / f"{test_name}.fst"
    shutil.move(dump, kept)
    recorded = [path for path in run_folder.glob(f"{LINES}.*") if path.stat().st_size]
    others = [shutil.move(path, WAVES_FOLDER / f"{test_name}{path.suffix}") for path in sorted(recorded)]
    elf = Path(str(parameters.get("FIRMWARE_HEX", "firmware"))).with_suffix(".elf")
    recordings.append(Recording(kept, save_file(kept, top, elf), tuple(others)))


def _keep_coverage(counts: Path, test_name: str) -> None:
    if (folder := os.environ.get("RTL_COVERAGE")) and counts.exists():
        Path(folder).mkdir(parents=True, exist_ok=True)
        # A test may run more than one simulation.
        with tempfile.NamedTemporaryFile(
            dir=folder, prefix=f"{test_name}.", suffix=".dat", delete=False
        ) as kept:
            shutil.copyfile(counts, kept.name)


def _check_results(results: Path) -> None:
    """Fails the pytest test if a cocotb test failed or none ran."""
    if not results.exists():
        pytest.fail("the simulator ended without results; its messages are above", pytrace=False)
    cases = list(ElementTree.parse(results).iter("testcase"))
    ran = [case for case in cases if case.find("skipped") is None]
    failed = [case for case in ran if case.find("failure") is not None or case.find("error") is not None]
    if not ran:
        pytest.fail("no cocotb test ran", pytrace=False)
    if failed:
        names = ", ".join(case.get("name", "?") for case in failed)
        pytest.fail(f"{len(failed)} of {len(ran)} cocotb tests failed: {names}", pytrace=False)
