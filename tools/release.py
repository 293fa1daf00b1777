# SPDX-License-Identifier: Apache-2.0
"""Builds everything that a release has, into build/dist: the same bytes in each run.

    python -m tools.release [--tag v1.2.3] [--draft] [--board NAME ...]   default: every board

1. Change VERSION and run `make regs`, before the measurements: images with function 11 contain the number.
2. `make evidence` renews each report of an older card, in two hours.
3. `make digests BOARD=all` in a fresh clone; a release with other bytes is refused.
4. In CHANGELOG.md give the version's section its date. Nothing stays below [Unreleased].
5. Commit; `make lint` and `make nightly` must pass on that commit.
6. `make release`. Read the site of build/dist with its data sheet and reports.
7. Only then `git tag -a v1.2.3 -m "rtu2fc 1.2.3"`, and push it: .github/workflows/release.yml repeats 5 and 6
   elsewhere. Publish the files if its SHA256SUMS is yours. Equal bytes need equal tools, which the list of
   contents names.

Bitstreams of every board, of both kinds, with every firmware image that fits it, the images, the Python
packages, site of the documentation, the sources, the licences, a list of contents and SHA256SUMS. Finished
designs are taken as they are (build/synth); a missing or older one is placed and routed first.

A release is refused, one line a reason: its figures are of another card, a test has not passed on its commit,
files are not committed, CHANGELOG.md has no section of its version, FIRMWARE_DEFINES is set, or `--tag` is
not its tag. A draft is never refused: each of its files is named -draft. `--board` makes a draft only.
Exit 1: refused; 2: something could not be built, or has other bytes than tools/digests.txt says.
"""

from __future__ import annotations

import gzip
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from campaigns.bench import fingerprint
from constraints import flow, image
from constraints.boards import Board, board
from rtl.command import VERSION, Parser, run_main
from rtl.sources import ROOT, SourcesError, commit, configuration, configurations, core_files
from tools import digests, evidence, trace, wheels
from tools.digests import BITSTREAM, FIRMWARE, Image, bitstreams, both_kinds, digest, firmware
from tools.site import build as site

DIST = ROOT / "build/dist"
SUMS = "SHA256SUMS"
CHANGELOG = ROOT / "CHANGELOG.md"
# The date of every file in the archive, the first that zip knows.
ZIP_DATE = (1980, 1, 1, 0, 0, 0)
ZIP_MODE = 0o100644 << 16
LICENCES = ("COPYING", "LICENSE")  # names of the file in the packages of the soft cores
HOW_TO_CHOOSE = """\
No file here has been on silicon or next to a motor. First read: docs, Handbook, Safety.
Check the files: sha256sum -c SHA256SUMS (Windows: certutil -hashfile FILE SHA256).
A bitstream is named rtu2fc-VERSION-BOARD-FIRMWARE. Pages of the documentation (docs) say more.
BOARD     the board; with -extended its switches also have 38400 and 115200 bit/s and 8N1
FIRMWARE  card, unless you want another dialect or option: docs, Data sheet, Images of a release
How to write it to the board: docs, A card from parts; for other boards Hardware, Flashing.
No bitstream stops the drive by itself when the master is lost: that needs a design of your own.
"""


class ReleaseError(Exception):
    """Error for the user, in one line."""


ERRORS = (
    ReleaseError,
    digests.BuildError,
    SourcesError,
    flow.SynthError,
    image.ImageError,
)
ERRORS += (wheels.WheelError, ImportError, OSError)


# ---------------------------------------------------------------- whether it may be released


def changelog_wrong(text: str, version: str) -> Iterator[str]:
    if not re.search(rf"^## \[{re.escape(version)}\] - \d{{4}}-\d\d-\d\d$", text, re.MULTILINE):
        yield f"CHANGELOG.md has no section `## [{version}] - YYYY-MM-DD`"
    if re.search(r"^## \[Unreleased\]$\s+(?!## )\S", text, re.MULTILINE):
        yield f"CHANGELOG.md has entries below [Unreleased]; move them to {version}"


def tests_wrong(results: dict[str, trace.Result], collected: set[str], now: str) -> Iterator[str]:
    good = {test for test, result in results.items() if result.outcome == "passed" and result.commit == now}
    if missing := len(collected - good):
        yield f"{missing} of {len(collected)} tests have not passed on commit {now}; run `make nightly`"


def figures_wrong() -> Iterator[str]:
    if older := evidence.older():
        yield f"figures are of an older card, and `make evidence` renews them: {', '.join(older)}"


def git(*words: str) -> str:
    return subprocess.run(
        ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()


def refusals(version: str, tag: str) -> list[str]:
    """Why this tree is no release, one line a reason; the slow reason only if there is no quick one."""
    now = commit()
    found = [f"the tag is {tag}, but VERSION says v{version}"] if tag not in ("", f"v{version}") else []
    found += [*figures_wrong(), *changelog_wrong(CHANGELOG.read_text(), version)]
    if not now:
        found.append("the commit is not known: this folder is no git repository")
    if git("status", "--porcelain"):  # a file that git does not know would be in the site or a package
        found.append("some files are not committed")
    if os.environ.get("FIRMWARE_DEFINES"):
        found.append("FIRMWARE_DEFINES is set; the images of a release have their own options")
    if not found:
        found += tests_wrong(trace.read_results(), trace.collect().all, now)
    return found


# ---------------------------------------------------------------- what is in it


@dataclass
class Dist:
    """The files of a release, in the order in which they are built."""

    folder: Path
    version: str
    draft: bool
    described: dict[str, str] = field(default_factory=dict)

    def name(self, what: str, suffix: str) -> str:
        return f"rtu2fc-{self.version}-{what}{'-draft' * self.draft}{suffix}"

    def add(self, what: str, suffix: str, content: bytes, description: str) -> str:
        return self.put(self.name(what, suffix), content, description)

    def put(self, name: str, content: bytes, description: str) -> str:
        (self.folder / name).write_bytes(content)
        self.described[name] = description
        print(f"  {name}", flush=True)
        return name

    def write_contents(self) -> None:
        lines = [
            f"rtu2fc {self.version}{', a draft: no release' * self.draft}",
            # Unlike commit(), the same in each clone, with a tag or without.
            f"commit {git('rev-parse', 'HEAD') or 'unknown'}{'-dirty' * bool(git('status', '--porcelain'))}",
            f"card {fingerprint.card()}, tiny card {fingerprint.card('tiny')}",
            f"compiler {digests.compiler()}",
            *(f"tool {tool}" for tool in flow.tool_versions()),
            "",
            HOW_TO_CHOOSE,
            *(f"{name}  {text}" for name, text in self.described.items()),
        ]
        self.add("contents", ".txt", "\n".join([*lines, ""]).encode(), "this list")

    def write_sums(self) -> None:
        sums = {path.name: digest(path) for path in sorted(self.folder.iterdir())}
        text = "".join(f"{value}  {name}\n" for name, value in sums.items())
        (self.folder / sums_name(self.draft)).write_text(text)


def sums_name(draft: bool) -> str:
    return f"{SUMS}{'-draft' * draft}"


def add_firmware(dist: Dist, images: list[Image]) -> None:
    for one in filter(lambda one: one.released, images):
        memory = one.memory.replace(" KiB", "k")
        text = f"firmware {one.name} for a memory of {one.memory} (`make image`)"
        dist.add(f"firmware-{memory}-{one.name}", ".hex", one.path.read_bytes(), text)


def kind(entry: Board, path: Path) -> str:
    if path.suffix == ".jed":
        return "image for the part's own flash"
    return (
        "bitstream for the configuration memory" if entry.family == "machxo2" else "bitstream and flash image"
    )


def add_bitstreams(dist: Dist, entry: Board, images: list[Image]) -> dict[str, str]:
    """Adds them, and returns their digests."""
    pair = configuration(entry.config)["soft_core"] == "picorv32"
    about = f"{entry.name} ({entry.part}), LOCKSTEP {entry.parameters.get('LOCKSTEP', int(pair))}"
    made = {}
    for one, path in bitstreams(entry, images):
        text = f"{kind(entry, path)} of {about}, firmware {one.name}"
        name = dist.add(f"{entry.name}-{one.name}", path.suffix, path.read_bytes(), text)
        made[name] = digest(dist.folder / name)
    return made


def archive(folder: Path, top: str) -> bytes:
    """A zip file of a folder: sorted names, one date, no owner."""
    with tempfile.TemporaryFile() as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
            for path in sorted(path for path in folder.rglob("*") if path.is_file()):
                entry = zipfile.ZipInfo(f"{top}/{path.relative_to(folder)}", ZIP_DATE)
                entry.external_attr = ZIP_MODE
                entry.create_system = 3  # Unix, whatever system packs
                entry.compress_type = zipfile.ZIP_DEFLATED
                packed.writestr(entry, path.read_bytes())
        file.seek(0)
        return file.read()


def add_documents(dist: Dist) -> None:
    with tempfile.TemporaryDirectory() as folder:
        if wrong := site.build(Path(folder) / "site"):
            raise ReleaseError(f"docs: {wrong[0]}")
        packed = archive(Path(folder) / "site", dist.name("docs", ""))
        dist.add("docs", ".zip", packed, "the documentation as a site: open index.html")


def add_wheels(dist: Dist) -> None:
    """A wheel's name has a fixed form: a draft is its build tag there."""
    with tempfile.TemporaryDirectory() as folder:
        for path in wheels.build(Path(folder)):
            package, version, *tags = path.stem.split("-")
            name = "-".join([package, version, *["0draft"] * dist.draft, *tags])
            dist.put(f"{name}.whl", path.read_bytes(), f"Python package {package} (`pip install`)")


def add_sources(dist: Dist) -> None:
    """What git has of the commit; the pages send their reader to a clone, and this is as good."""
    top = dist.name("source", "")
    settings = ("-c", "tar.umask=0022", "-c", "core.autocrlf=false")  # those of its user change the bytes
    command = ["git", *settings, "archive", "--format=tar", f"--prefix={top}/", "HEAD"]
    packed = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    if packed.returncode:
        raise ReleaseError("the sources cannot be packed: this folder is no git repository")
    dist.add("source", ".tar.gz", gzip.compress(packed.stdout, mtime=0), "the sources of all of it")


def licences() -> str:
    """The project's licence, and those of the soft cores, which are part of the bitstreams."""
    found = {"rtu2fc": ROOT / "LICENSE"}
    for name, entry in configurations().items():
        folders = core_files(name)[0].parents
        files = (folder / licence for folder in folders for licence in LICENCES)
        found[f"{entry['soft_core']}, in bitstreams of {name}"] = next(filter(Path.exists, files))
    return "\n".join(f"{what}\n{'=' * len(what)}\n\n{path.read_text()}" for what, path in found.items())


def check_digests(found: dict[str, str], *whole: str) -> None:
    if wrong := digests.different(found, whole):
        raise ReleaseError("\nrelease: ".join(wrong))


def build(draft: bool, chosen: list[Board], version: str) -> None:
    """Builds everything. The former files of DIST stay until all is built."""
    DIST.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=DIST.parent, prefix="dist-") as folder:
        dist = Dist(Path(folder) / DIST.name, version, draft)
        dist.folder.mkdir()
        add_documents(dist)
        add_wheels(dist)
        dist.add("licences", ".txt", licences().encode(), "licences of the project and of the soft cores")
        add_sources(dist)
        images = firmware()
        if not draft:
            check_digests(digests.of_images(images), FIRMWARE)
        add_firmware(dist, images)
        made = {}
        for entry in chosen:
            made |= add_bitstreams(dist, entry, images)
        if not draft:
            check_digests(made, BITSTREAM)
        dist.write_contents()
        dist.write_sums()
        shutil.rmtree(DIST, ignore_errors=True)
        dist.folder.rename(DIST)
        count = len(dist.described) + 1
    print(f"{DIST.relative_to(ROOT)}: {count} files; {sums_name(draft)} has the SHA-256 of each")


def main() -> int:
    parser = Parser(prog="release", description=__doc__.splitlines()[0])
    parser.add_argument("--tag", default="", help="the tag of the release, v and the version")
    parser.add_argument("--draft", action="store_true", help="a development build, never refused")
    parser.add_argument("--board", action="append", default=[], help="this board alone, in a draft")
    args = parser.parse_args()
    if args.board and not args.draft:
        parser.error("a release has every board; DRAFT=1 builds some of them")
    version = VERSION.read_text().strip()
    chosen = [board(name) for name in args.board] or both_kinds()
    if not args.draft and (wrong := refusals(version, args.tag)):
        for reason in wrong:
            print(f"release: refused: {reason}", file=sys.stderr)
        print("release: DRAFT=1 builds it all the same and names each file -draft", file=sys.stderr)
        return 1
    build(args.draft, chosen, version)
    return 0


if __name__ == "__main__":
    run_main("release", main, *ERRORS)
