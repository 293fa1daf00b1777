# SPDX-License-Identifier: Apache-2.0
"""Puts a firmware image into a board's finished design, in seconds, and packs the bitstream.

    python -m constraints.image BOARD FIRMWARE.hex [--output FILE]

The design was placed and routed with random words in the firmware memory (constraints/synth.py). These words
locate the memory's bits: in nextpnr's text configuration, and on Gowin in the routed design, which is then
packed. No other bits change, so the bitstream equals that of a full build with that firmware. A MachXO2 gets
a .jed for its own flash beside the bitstream.
Exit 2, with one line, for an image that the card would refuse, wrong check sums, or a design from other
Verilog, pins or tools.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

from constraints import flow, jedec
from constraints.boards import Board, board
from rtl.command import Parser, run_main
from rtl.sources import ROOT, SourcesError
from sw.tools.bin2hex import WORD_BITS, with_parity, without_parity
from sw.tools.seal import adds_up

PACKED = {"ice40": ".bin", "machxo2": ".bit", "ecp5": ".bit", "gowin": ".fs"}
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
# The same on iCE40: 16 lines of 16 rows, the last row of a line first. A row holds one to eight addresses.
ICE40_MEMORY = re.compile(r"^(\.ram_data \d+ \d+\n)((?:[0-9a-f]{64}\n){16})", re.MULTILINE)
ICE40_STEPS = (1, 2, 4, 8)
# Parameters of a Gowin block RAM with nine-bit bytes: 64 rows of 32 bytes.
GOWIN_INIT, GOWIN_INIT_BITS = "INIT_RAM_", 288
# Data bits at an address, for each width of a block RAM. Up to 4, several addresses share 8 of the 9 bits.
WIDTHS = (1, 2, 4, 9, 18, 36)


class ImageError(Exception):
    """Error for the user, in one line."""


def result_suffix(entry: Board) -> str:
    """File suffix of the bitstream."""
    return PACKED[entry.family]


def results(entry: Board, output: Path) -> list[Path]:
    """The bitstream, and beside it what goes into the part's own flash if it has one."""
    return [output, output.with_suffix(".jed")] if entry.flash else [output]


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


# ---------------------------------------------------------------- MachXO2 and ECP5


def kept(width: int) -> int:
    """Bits of a 9-bit word that a block RAM of this width uses."""
    return RAW_BITS if width >= RAW_BITS else RAW_BITS - 1


def lanes(raw: list[int], width: int) -> list[str]:
    """Content of a block RAM by data bit: character A of lane B is bit B at address A."""
    flat = "".join(f"{word:0{RAW_BITS}b}"[::-1][: kept(width)] for word in raw)
    return [flat[lane::width] for lane in range(width)]


def raw_words(content: list[str], width: int) -> list[int]:
    """The inverse of `lanes`."""
    flat = "".join("".join(bits) for bits in zip(*content, strict=True))
    return [int(flat[at : at + kept(width)][::-1], 2) for at in range(0, len(flat), kept(width))]


class Replacement:
    """Replaces the memory content `old` by `new` in block RAMs, one after the other.

    A column is one bit of every word, or of every second, fourth, eighth one by `steps`. After the memory's
    end it has zeros.
    """

    def __init__(self, old: list[int], new: list[int], steps: tuple[int, ...] = (1,)):
        self.old, self.new, self.steps = old, new, steps
        self.missing = {(word, bit) for word in range(len(old)) for bit in range(WORD_BITS)}
        self.places = cache(self._places)

    @staticmethod
    def column(words: list[int], place: tuple[int, int, int], depth: int) -> str:
        at, step, bit = place
        taken = words[at : at + step * depth : step]
        return "".join("01"[word >> bit & 1] for word in taken).ljust(depth, "0")

    def _places(self, depth: int) -> dict[str, tuple[int, int, int]]:
        """First word, step and bit of each column of the memory."""
        places = [
            (at, step, bit)
            for step in self.steps
            for first in range(0, len(self.old), step * depth)
            for at in range(first, first + step)
            for bit in range(WORD_BITS)
        ]
        return {self.column(self.old, place, depth): place for place in places}

    def new_column(self, bits: str) -> str:
        """The new content of a column; other bits stay as they are."""
        if (place := self.places(len(bits)).get(bits)) is None:
            return bits
        at, step, bit = place
        self.missing.difference_update((word, bit) for word in range(at, at + step * len(bits), step))
        return self.column(self.new, place, len(bits))

    def patch(self, raw: list[int]) -> list[int] | None:
        """The new content of a block RAM of 9-bit words, None if it does not change."""
        for width in WIDTHS:
            content = lanes(raw, width)
            if (changed := [self.new_column(bits) for bits in content]) != content:
                return raw_words(changed, width)
        return None

    def check(self) -> None:
        if self.missing:
            raise ImageError("the firmware memory was not found in the design")


def replace(text: str, old: list[int], new: list[int]) -> str:
    """Replaces the memory content `old` by `new` in nextpnr's configuration."""
    replacement = Replacement(old, new)

    def patch(match: re.Match[str]) -> str:
        patched = replacement.patch([int(word, 16) for word in match[2].split()])
        if patched is None:
            return match[0]
        words = [f"{word:03x}" for word in patched]
        return match[1] + "".join(" ".join(words[at : at + 8]) + "\n" for at in range(0, len(words), 8))

    text = MEMORY.sub(patch, text)
    replacement.check()
    return text


# ---------------------------------------------------------------- iCE40


def replace_ice40(text: str, old: list[int], new: list[int]) -> str:
    """As `replace`; a block RAM that holds bits of two banks may occur twice, once for each."""
    replacement = Replacement(old, new, ICE40_STEPS)

    def patch(match: re.Match[str]) -> str:
        rows = [int(line[at - 4 : at or None], 16) for line in match[2].split() for at in range(0, -64, -4)]
        columns = ["".join(bits) for bits in zip(*(f"{row:016b}" for row in rows), strict=True)]
        changed = map(replacement.new_column, columns)
        rows = [f"{int(''.join(bits), 2):04x}" for bits in zip(*changed, strict=True)]
        return match[1] + "".join("".join(rows[at : at + 16][::-1]) + "\n" for at in range(0, len(rows), 16))

    text = ICE40_MEMORY.sub(patch, text)
    replacement.check()
    return text


# ---------------------------------------------------------------- Gowin


def memory_bits(parameters: dict[str, str]) -> str:
    """Content of a Gowin block RAM with nine-bit bytes, its first bit first; empty for any other cell."""
    names = sorted(name for name in parameters if name.startswith(GOWIN_INIT))
    return "".join(parameters[name][::-1] for name in names if len(parameters[name]) == GOWIN_INIT_BITS)


def replace_routed(text: str, old: list[int], new: list[int]) -> str:
    """Replaces the memory content `old` by `new` in the routed design, JSON, from which gowin_pack starts."""
    replacement = Replacement(old, new)
    design = json.loads(text)
    for module in design["modules"].values():
        for cell in module["cells"].values():
            bits = memory_bits(cell["parameters"]).replace("x", "0")
            raw = [int(bits[at : at + RAW_BITS][::-1], 2) for at in range(0, len(bits), RAW_BITS)]
            if not raw or (patched := replacement.patch(raw)) is None:
                continue
            bits = "".join(f"{word:0{RAW_BITS}b}"[::-1] for word in patched)
            for number, at in enumerate(range(0, len(bits), GOWIN_INIT_BITS)):
                cell["parameters"][f"{GOWIN_INIT}{number:02X}"] = bits[at : at + GOWIN_INIT_BITS][::-1]
    replacement.check()
    return json.dumps(design, separators=(",", ":"))


# ---------------------------------------------------------------- all families

REPLACE = {"ice40": replace_ice40, "gowin": replace_routed}


def tool(*command: str | Path) -> None:
    """Runs a tool; its sandbox sees this folder by relative names."""
    words = [str(word.relative_to(ROOT)) if isinstance(word, Path) else word for word in command]
    words[0] = str(Path(sys.executable).parent / words[0])
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise ImageError(f"{command[0]}: {said[-1] if said else f'ended with {done.returncode}'}")


def pack(entry: Board, design: Path, packed: Path) -> None:
    """Turns a routed design into a bitstream, and into a JEDEC file for a part with its own flash."""
    if entry.family == "gowin":
        tool("gowin_pack", "-d", entry.gowin_die, "-o", packed, design)
    else:
        tool(*PACK[entry.family], design, packed)
    if entry.flash:
        try:
            content = jedec.jedec(packed.read_bytes(), entry)
        except jedec.JedecError as error:
            raise ImageError(f"{packed.relative_to(ROOT)}: {error}") from None
        packed.with_suffix(".jed").write_bytes(content)


def make(entry: Board, firmware: Path, output: Path) -> Path:
    """Makes the bitstream of a board with an image; all of `results` are written only on success."""
    if output in results(entry, output)[1:]:
        raise ImageError(f"{output}: name the bitstream; the .jed is written beside it")
    folder = flow.BUILD / entry.name
    design = folder / f"{entry.top}{flow.suffix(entry)}"
    new = read_words(firmware, entry)
    for number, word in enumerate(new, 1):
        if word != with_parity(without_parity(word)):
            raise ImageError(f"{firmware}:{number}: {word:09x} has not the parity that the card asks for")
    if not adds_up([without_parity(word) for word in new]):
        raise ImageError(f"{firmware}: the check sums at its end do not add up (sw/tools/seal.py)")
    if not design.exists():
        raise ImageError(f"{entry.name} has no finished design yet; run `make synth BOARD={entry.name}`")
    if not flow.up_to_date(entry):
        shown = design.relative_to(ROOT)
        raise ImageError(f"{shown} was made from other sources; run `make synth BOARD={entry.name}`")
    pattern = flow.pattern_file(entry)
    patched = folder / f"image{flow.suffix(entry)}"
    patch = REPLACE.get(entry.family, replace)
    patched.write_text(patch(design.read_text(), read_words(pattern, entry), new))
    packed = folder / f"image{result_suffix(entry)}"
    pack(entry, patched, packed)
    output.parent.mkdir(parents=True, exist_ok=True)
    for made, wanted in zip(results(entry, packed), results(entry, output), strict=True):
        shutil.copyfile(made, wanted)
    return output


def main() -> int:
    parser = Parser(prog="image", description=__doc__.splitlines()[0])
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
    run_main("image", main)
