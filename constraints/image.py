# SPDX-License-Identifier: Apache-2.0
"""Puts a firmware image into a board's finished design, in seconds, and packs the bitstream.

    python -m constraints.image BOARD FIRMWARE.hex [--output FILE]

The design was placed and routed with random words in the firmware memory (constraints/synth.py). These words
locate the memory's bits: icebram does so on iCE40, this program on MachXO2/3 and ECP5, in nextpnr's text
configuration. No other bits change, so the bitstream equals that of a full build with that firmware. A
MachXO2 gets a .jed for its own flash beside the bitstream. Exit 2, with one line, for an image that the card
would refuse, wrong check sums, or a design from other Verilog, pins or tools.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

from constraints import jedec
from constraints.boards import Board, board
from rtl.sources import ROOT, SourcesError
from sw.tools.bin2hex import WORD_BITS, hex_line, with_parity, without_parity
from sw.tools.seal import adds_up

BUILD = ROOT / "build/synth"
SUFFIX = {"ice40": ".asc", "machxo2": ".config", "ecp5": ".config"}
PACKED = {"ice40": ".bin", "machxo2": ".bit", "ecp5": ".bit"}
# The MachXO2's flash takes compressed streams only. Its .bit is the same stream, so that a trial in the
# configuration memory tries what the flash will hold.
PACK = {
    "ice40": ("yowasp-icepack",),
    "machxo2": ("yowasp-xo2pack", "--compress"),
    "ecp5": ("yowasp-ecppack",),
}
WORD = re.compile(rf"[0-9a-fA-F]{{{WORD_BITS // 4}}}")
# A memory in nextpnr's text configuration: rows of 9-bit words.
MEMORY = re.compile(r"^(\.bram_init \d+\n)((?:[0-9a-f]{3}[ \n])+)", re.MULTILINE)
RAW_BITS = 9
# Data bits at an address, for each width of a block RAM. Up to 4, several addresses share 8 of the 9 bits.
WIDTHS = (1, 2, 4, 9, 18, 36)


class ImageError(Exception):
    """Error for the user, in one line."""


def suffix(entry: Board) -> str:
    """File suffix of the routed design."""
    return SUFFIX[entry.family]


def result_suffix(entry: Board) -> str:
    """File suffix of the bitstream."""
    return PACKED[entry.family] if entry.packs else suffix(entry)


def results(entry: Board, output: Path) -> list[Path]:
    """The bitstream, and beside it what goes into the part's own flash if it has one."""
    return [output, output.with_suffix(".jed")] if jedec.flash_of(entry) else [output]


def pattern_file(entry: Board) -> Path:
    return BUILD / entry.name / "pattern.hex"


def made_from_file(entry: Board) -> Path:
    """File that identifies the sources of the finished design; removed together with it."""
    return BUILD / entry.name / f"{entry.top}.made_from"


def up_to_date(entry: Board) -> bool:
    """Whether the finished design is made from the present sources: firmware in old hardware is dangerous."""
    # A local import, because synth.py imports this module.
    from constraints.synth import made_from

    said = made_from_file(entry)
    return said.exists() and said.read_text().strip() == made_from(entry)


def read_words(path: Path, entry: Board) -> list[int]:
    """Reads a $readmemh image: one word with parity per line, as many as the board's memory has."""
    try:
        lines = path.read_text().split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise ImageError(f"{path}: {error.strerror if isinstance(error, OSError) else 'no text'}") from None
    if lines[-1] == "":
        lines.pop()
    for number, text in enumerate(lines, 1):
        if not WORD.fullmatch(text):
            raise ImageError(f"{path}:{number}: {text[:20]!r} is no {WORD_BITS}-bit word in hex")
    if len(lines) != entry.memory_words:
        wanted = f"the memory of {entry.name} has {entry.memory_words}"
        raise ImageError(f"{path}: {len(lines)} words, but {wanted}")
    return [int(text, 16) for text in lines]


# ---------------------------------------------------------------- MachXO2/3 and ECP5


def lanes(raw: list[int], width: int) -> list[str]:
    """Content of a block RAM by data bit: character A of lane B is bit B at address A."""
    if width < RAW_BITS:
        return [
            "".join("01"[word >> at + lane & 1] for word in raw for at in range(0, RAW_BITS - 1, width))
            for lane in range(width)
        ]
    step = width // RAW_BITS
    return [
        "".join("01"[word >> bit & 1] for word in raw[at::step])
        for at in range(step)
        for bit in range(RAW_BITS)
    ]


def raw_words(content: list[str], width: int) -> list[int]:
    """The inverse of `lanes`."""
    if width < RAW_BITS:
        each = (RAW_BITS - 1) // width
        flat = ["".join(bits) for bits in zip(*content, strict=True)]
        return [
            sum(int(flat[at + n][::-1], 2) << n * width for n in range(each))
            for at in range(0, len(flat), each)
        ]
    return [
        int("".join(bits[at : at + RAW_BITS])[::-1], 2)
        for bits in zip(*content, strict=True)
        for at in range(0, width, RAW_BITS)
    ]


def column(words: list[int], first: int, bit: int, depth: int) -> str:
    """One bit of `depth` words of the memory; a block RAM holds zeros after the memory's end."""
    return "".join("01"[word >> bit & 1] for word in words[first : first + depth]).ljust(depth, "0")


def replace(text: str, old: list[int], new: list[int]) -> str:
    """Replaces the memory content `old` by `new` in nextpnr's configuration."""
    covered: list[tuple[int, int]] = []

    def patch(match: re.Match[str]) -> str:
        raw = [int(word, 16) for word in match[2].split()]
        for width in WIDTHS:
            content = lanes(raw, width)
            depth = len(content[0])
            known = places(depth)
            if not any(lane in known for lane in content):
                continue
            for number, lane in enumerate(content):
                if lane in known:
                    first, bit = known[lane]
                    content[number] = column(new, first, bit, depth)
                    covered.extend((word, bit) for word in range(first, min(first + depth, len(old))))
            words = [f"{word:03x}" for word in raw_words(content, width)]
            return match[1] + "".join(" ".join(words[at : at + 8]) + "\n" for at in range(0, len(words), 8))
        return match[0]

    @cache
    def places(depth: int) -> dict[str, tuple[int, int]]:
        return {
            column(old, first, bit, depth): (first, bit)
            for first in range(0, len(old), depth)
            for bit in range(WORD_BITS)
        }

    patched = MEMORY.sub(patch, text)
    if sorted(covered) != [(word, bit) for word in range(len(old)) for bit in range(WORD_BITS)]:
        raise ImageError("the firmware memory was not found in the design")
    return patched


# ---------------------------------------------------------------- all families


def tool(*command: str | Path) -> None:
    """Runs a tool; its sandbox sees this folder by relative names."""
    words = [str(word.relative_to(ROOT)) if isinstance(word, Path) else word for word in command]
    words[0] = str(Path(sys.executable).parent / words[0])
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise ImageError(f"{command[0]}: {said[-1] if said else f'ended with {done.returncode}'}")


def icebram(design: Path, old: Path, new: Path, patched: Path) -> None:
    """Runs icebram, which reads the design from standard input and writes it to standard output."""
    command = [str(Path(sys.executable).parent / "yowasp-icebram")]
    command += [str(path.relative_to(ROOT)) for path in (old, new)]
    with design.open() as source, patched.open("w") as target:
        done = subprocess.run(
            command, cwd=ROOT, stdin=source, stdout=target, stderr=subprocess.PIPE, text=True, check=False
        )
    if done.returncode:
        raise ImageError(f"yowasp-icebram: {done.stderr.strip().splitlines()[-1]}")


def pack(entry: Board, design: Path, packed: Path) -> None:
    """Turns a routed design into a bitstream, and into a JEDEC file for a part with its own flash."""
    tool(*PACK[entry.family], design, packed)
    if jedec.flash_of(entry):
        try:
            content = jedec.jedec(packed.read_bytes(), entry)
        except jedec.JedecError as error:
            raise ImageError(f"{packed.relative_to(ROOT)}: {error}") from None
        packed.with_suffix(".jed").write_bytes(content)


def make(entry: Board, firmware: Path, output: Path) -> Path:
    """Makes the bitstream of a board with an image; all of `results` are written only on success."""
    if output in results(entry, output)[1:]:
        raise ImageError(f"{output}: name the bitstream; the .jed is written beside it")
    folder = BUILD / entry.name
    design = folder / f"{entry.top}{suffix(entry)}"
    new = read_words(firmware, entry)
    for number, word in enumerate(new, 1):
        if word != with_parity(without_parity(word)):
            raise ImageError(f"{firmware}:{number}: {word:09x} has not the parity that the card asks for")
    if not adds_up([without_parity(word) for word in new]):
        raise ImageError(f"{firmware}: the check sums at its end do not add up (sw/tools/seal.py)")
    if not design.exists():
        raise ImageError(f"{entry.name} has no finished design yet; run `make synth BOARD={entry.name}`")
    if not up_to_date(entry):
        shown = design.relative_to(ROOT)
        raise ImageError(f"{shown} was made from other sources; run `make synth BOARD={entry.name}`")
    pattern = pattern_file(entry)
    patched = folder / f"image{suffix(entry)}"
    if entry.family == "ice40":
        # In the design's folder, which the tool can see.
        beside = folder / "image.hex"
        beside.write_text("".join(map(hex_line, new)))
        icebram(design, pattern, beside, patched)
    else:
        patched.write_text(replace(design.read_text(), read_words(pattern, entry), new))
    packed = folder / f"image{result_suffix(entry)}"
    if entry.packs:
        pack(entry, patched, packed)
    output.parent.mkdir(parents=True, exist_ok=True)
    for made, wanted in zip(results(entry, packed), results(entry, output), strict=True):
        shutil.copyfile(made, wanted)
    return output


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("board", metavar="BOARD")
    parser.add_argument("firmware", type=Path, metavar="FIRMWARE.hex")
    parser.add_argument("--output", type=Path, help="default: in build/image, named after the board")
    args = parser.parse_args()
    begin = time.monotonic()
    try:
        entry = board(args.board)
        output = args.output or ROOT / f"build/image/{entry.top}{result_suffix(entry)}"
        make(entry, args.firmware, output)
    except (ImageError, SourcesError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    shown = [path.relative_to(ROOT) if path.is_relative_to(ROOT) else path for path in results(entry, output)]
    made = " and ".join(map(str, shown))
    print(f"{made}: {entry.name} with {args.firmware}, {time.monotonic() - begin:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
