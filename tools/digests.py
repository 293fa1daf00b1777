# SPDX-License-Identifier: Apache-2.0
"""SHA-256 of firmware images, designs and the release's bitstreams, in tools/digests.txt; `make digests`.

    python -m tools.digests [--board NAME ...]             writes those of the images and of these boards
    python -m tools.digests --check [--board NAME ...]     builds them and compares; exit 1: one differs

Whoever builds the same sources can see that the bytes are the same. A change of the firmware changes digests
in the same commit. A design is a bitstream with a test pattern in place of the firmware, so only a change of
the hardware or of its tools changes it. Bitstreams have the names of the release's files, version and all, so
their lines stay those of the release while the firmware goes on. Another version of the compiler makes other
images: the file names the one that it is of. Exit 2: something could not be built.
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from constraints import flow, image, synth
from constraints.boards import Board, board, boards, extended
from regs.dialects import IMAGES
from rtl.command import VERSION, Parser, own_environment, run_main
from rtl.sources import ROOT, SourcesError

FILE = ROOT / "tools/digests.txt"
COMPILER = "# compiler: "
FIRMWARE, DESIGN, BITSTREAM = "firmware-", "design-", "rtu2fc-"  # how the names of each kind begin
# Folders of sw/firmware.mk with the images of an option, or of all at once.
OPTIONS = {name.rpartition("/")[2] for name in IMAGES}
HEAD = "# SHA-256, by `make digests`; what it says: tools/digests.py\n"


def both_kinds() -> list[Board]:
    """Every board, without and with EXTENDED_SWITCHES."""
    return [kind for entry in boards().values() for kind in (entry, extended(entry))]


class BuildError(Exception):
    """Error for the user, in one line."""


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def cross_compiler() -> str:
    return os.environ.get("FIRMWARE_CROSS", "riscv64-unknown-elf-") + "gcc"


def first_line(*command: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        raise BuildError(f"{command[0]} is missing; run `make setup`") from None
    return done.stdout.splitlines()[0].strip()


def compiler() -> str:
    return first_line(cross_compiler(), "--version")


@dataclass(frozen=True)
class Image:
    """A firmware image, named after its folder below build: dialect, then options."""

    path: Path

    @property
    def words(self) -> int:
        return len(self.path.read_text().split())

    @property
    def options(self) -> list[str]:
        return [part for part in self.path.parent.parts if part in OPTIONS]

    @property
    def name(self) -> str:
        memories = ("build", "tiny", "large")
        dialect = [part for part in self.path.parent.parts if part not in (*memories, *OPTIONS)] or ["card"]
        return "-".join([*dialect, *self.options]).replace("_", "-")

    @property
    def released(self) -> bool:
        """MASTER_LOSS_STOP alone does nothing in designs of a release, whose parameter is 0 (SAFE-7)."""
        return "stop" not in self.options

    @property
    def memory(self) -> str:
        return f"{4 * self.words // 1024} KiB"


def firmware(how: str = "-sB") -> list[Image]:
    """Builds every image with its default options, from its sources: the time of a file proves nothing."""
    command = ["make", how, "-f", "sw/firmware.mk", "FIRMWARE_DEFINES=", f"FIRMWARE_PYTHON={sys.executable}"]
    said = ""
    for target in ("firmware", "firmware-images"):
        done = subprocess.run(
            [*command, target], cwd=ROOT, env=own_environment(), capture_output=True, text=True, check=False
        )
        if done.returncode:
            reason = (done.stderr.strip() or "make failed").splitlines()[0]
            raise BuildError(f"firmware: {reason}")
        said = done.stdout
    return [Image(Path(name)) for name in said.split()]


def design(entry: Board) -> Path:
    """The board's placed and routed design; builds it unless it is up to date."""
    finished = flow.BUILD / entry.name / f"{entry.top}{flow.suffix(entry)}"
    if not (finished.exists() and flow.up_to_date(entry)):
        print(f"  {entry.name}: place and route", flush=True)
        if wrong := synth.too_big(entry.name, synth.build(entry)):
            raise BuildError("; ".join(wrong))
    return finished


def kept() -> tuple[str, dict[str, str]]:
    """The compiler of the images, and the digests by name."""
    text = FILE.read_text() if FILE.exists() else ""
    compiler = re.search(rf"^{COMPILER}(.*)$", text, re.MULTILINE)
    lines = [line.split("  ") for line in text.splitlines() if line and not line.startswith("#")]
    if len({name for _, name in lines}) < len(lines):
        raise BuildError(f"{FILE.name} has a name twice")
    return compiler[1] if compiler else "", {name: value for value, name in lines}


def write(digests: dict[str, str]) -> None:
    lines = [f"{value}  {name}\n" for name, value in sorted(digests.items())]
    licence = Path(__file__).read_text().splitlines()[0]
    FILE.write_text(f"{licence}\n{HEAD}{COMPILER}{compiler()}\n{''.join(lines)}")


def of_images(images: list[Image]) -> dict[str, str]:
    return {
        f"{FIRMWARE}{one.memory.replace(' KiB', 'k')}-{one.name}.hex": digest(ROOT / one.path)
        for one in images
    }


def of_designs(entries: list[Board]) -> dict[str, str]:
    found = {}
    for entry in entries:
        packed = flow.BUILD / entry.name / f"pattern{image.result_suffix(entry)}"
        image.pack(entry, design(entry), packed)
        found |= {f"{DESIGN}{entry.name}{path.suffix}": digest(path) for path in image.results(entry, packed)}
    return found


def fitting(entry: Board, images: list[Image]) -> list[Image]:
    """Images of a release for the board's memory."""
    return [one for one in images if one.words == entry.memory_words and one.released]


def bitstreams(entry: Board, images: list[Image]) -> Iterator[tuple[Image, Path]]:
    """The board's design with each image that fits it; a file lasts until the next is asked for."""
    design(entry)
    for one in fitting(entry, images):
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / f"image{image.result_suffix(entry)}"
            image.make(entry, ROOT / one.path, output)
            yield from ((one, path) for path in image.results(entry, output))


def of_bitstreams(entries: list[Board], images: list[Image]) -> dict[str, str]:
    begin = f"{BITSTREAM}{VERSION.read_text().strip()}"
    return {
        f"{begin}-{entry.name}-{one.name}{path.suffix}": digest(path)
        for entry in entries
        for one, path in bitstreams(entry, images)
    }


def different(found: dict[str, str], whole: tuple[str, ...]) -> list[str]:
    """A line for each digest that is not that of the file, and for each that nothing makes any more.

    whole: the kinds, such as FIRMWARE, of which `found` has every one.
    """
    of_file, known = kept()
    wrong = [
        f"{name}: {'another digest than in' if name in known else 'not in'} {FILE.name}"
        for name, value in found.items()
        if known.get(name) != value
    ]
    gone = [name for name in known if name.startswith(whole) and name not in found]
    wrong += [f"{name}: in {FILE.name}, but not made any more" for name in gone]
    if wrong and of_file != compiler():
        wrong.append(f"{FILE.name} is of {of_file or 'an unknown compiler'}, and here is {compiler()}")
    return wrong


def main() -> int:
    parser = Parser(prog="digests", description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    parser.add_argument("--board", action="append", default=[], help="its files too; all: every board's")
    given = parser.parse_args()
    every = given.board == ["all"]
    whole = (FIRMWARE, DESIGN, BITSTREAM) if every else (FIRMWARE,)
    chosen = both_kinds() if every else [board(name) for name in given.board]
    images = firmware()
    found = of_images(images) | of_designs(chosen)
    if every or given.check:  # written all at once, for a release; then they stay its own
        found |= of_bitstreams(chosen, images)
    _, known = kept()
    if not given.check:
        write({name: value for name, value in known.items() if not name.startswith(whole)} | found)
        print(f"digests: {len(found)} written to {FILE.relative_to(ROOT)}")
        return 0
    wrong = different(found, whole)
    for line in wrong:
        print(f"digests: {line}", file=sys.stderr)
    same = sum(known.get(name) == value for name, value in found.items())
    again = "; if they ought to differ, run `make digests`" if wrong else ""
    print(f"digests: {same} of {len(found)} are those of {FILE.relative_to(ROOT)}{again}")
    return int(bool(wrong))


if __name__ == "__main__":
    run_main("digests", main, BuildError, flow.SynthError, image.ImageError, SourcesError)
