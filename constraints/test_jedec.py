# SPDX-License-Identifier: Apache-2.0
"""JEDEC files for the MachXO2's flash: form, refusals, content decoded again, openFPGALoader writing them."""

from __future__ import annotations

import os
import random
import re
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from constraints import flow, image, jedec, synth
from constraints.boards import Board, boards
from constraints.flash_model import Cable, Part
from constraints.image_bench import sealed_image
from tb.lib.runner import ROOT

BOARD = boards()["card-xo2-1200"]
IDCODE = 0x012BA043
PAGES, USER_PAGES = 2175, 512
HEADER = b"\xff\x00Part: x\x00\xff"
PREAMBLE = bytes.fromhex("ff ff bd b3 ff ff")
SETUP = "3b 000000 e2 000000 {idcode:08x} 22 000000 40000000 46 000000 02 000000 0102030405060708"
END = bytes.fromhex("5e 000000 ffffffff")
COMPRESSED, PLAIN = b"\xb8", b"\x82"


def bitstream(idcode: int = IDCODE, command: bytes = COMPRESSED, size: int = 0, end: bytes = END) -> bytes:
    """A .bit file with random data for a configuration; `size` is that of the stream."""
    setup = PREAMBLE + bytes.fromhex(SETUP.format(idcode=idcode)) + command
    body = random.Random(size).randbytes(max(0, size - len(setup) - len(end)))
    return HEADER + setup + body + end


@dataclass(frozen=True)
class File:
    """What a .jed file says; `areas` are the notes and fuses by their first number."""

    text: str
    areas: dict[int, tuple[str, str]]

    @classmethod
    def read(cls, content: bytes) -> File:
        text = content.decode("ascii")
        fields = re.findall(r"NOTE ([^*]*)\*\nL(\d+)\n([01\n]*)\*\n", text)
        return cls(text, {int(at): (note, fuses.replace("\n", "")) for note, at, fuses in fields})

    def field(self, letters: str) -> str:
        (found,) = re.findall(rf"^{letters}([^*]*)\*$", self.text, re.MULTILINE)
        return found

    def fuses(self) -> str:
        return "".join(fuses for _, (_, fuses) in sorted(self.areas.items()))

    def stream(self) -> bytes:
        """The first area as bytes."""
        fuses = self.areas[0][1]
        return bytes(int(fuses[at : at + 8], 2) for at in range(0, len(fuses), 8))


# ---------------------------------------------------------------- form


@pytest.fixture(scope="module")
def made() -> File:
    return File.read(jedec.jedec(bitstream(size=999), BOARD))


def test_the_first_area_is_the_stream_filled_up_to_whole_pages(made):
    assert made.stream() == bitstream(size=999)[len(HEADER) :].ljust(1008, b"\xff")
    # As vendor files begin.
    assert made.fuses().startswith("11111111111111111011110110110011" + "1" * 16 + "00111011")


def test_every_fuse_is_there_once(made):
    at = 0
    for start, (_, fuses) in sorted(made.areas.items()):
        assert start == at
        at += len(fuses)
    assert at == int(made.field("QF")) == (PAGES + USER_PAGES) * 128 == 343936
    lines = re.findall(r"^[01]{17,}$", made.text, re.MULTILINE)
    assert {len(line) for line in lines} == {128}


def test_the_rest_is_empty_and_openfpgaloader_leaves_it_out(made):
    """Its parser knows this note. An area with another note would take the place of the first one."""
    first, (note, fuses) = sorted(made.areas.items())[1:][0]
    assert (first, note, set(fuses), len(made.areas)) == (1008 * 8, "END CONFIG DATA", {"0"}, 2)


def test_the_checksums_are_those_of_the_standard(made):
    fuses = made.fuses()
    total = sum(1 << number % 8 for number, fuse in enumerate(fuses) if fuse == "1")
    assert int(made.field("C"), 16) == total % 65536
    inside, _, after = made.text.partition("\x03")
    assert inside.startswith("\x02") and after == f"{sum(map(ord, inside + chr(3))) % 65536:04X}\n"


def test_feature_row_and_feabits_are_the_chosen_ones(made):
    row, feabits = made.field("E").split("\n")
    assert row == "0" * 64
    assert feabits == "0000010001100000"
    on = {number for number, bit in enumerate(feabits) if bit == "1"}
    assert on == {5, 9, 10}, "off: PROGRAMN, slave SPI, I2C"
    assert 8 not in on, "JTAG stays on"


def test_a_full_flash_is_still_accepted():
    full = File.read(jedec.jedec(bitstream(size=PAGES * 16), BOARD))
    assert len(full.areas[0][1]) == PAGES * 128 and len(full.fuses()) == int(full.field("QF"))


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            bitstream(command=PLAIN, size=900),
            "the bitstream is not compressed, and the flash takes compressed ones only",
        ),
        (
            bitstream(size=PAGES * 16 + 1),
            "the bitstream takes 2176 pages, but the flash of LCMXO2-1200HC-4TG144I has 2175",
        ),
        (
            bitstream(idcode=0x012B5043, size=900),
            "the bitstream is for part 0x012b5043, but LCMXO2-1200HC-4TG144I is 0x012ba043",
        ),
        (
            HEADER + PREAMBLE + COMPRESSED + END,
            "the bitstream is for no part, but LCMXO2-1200HC-4TG144I is 0x012ba043",
        ),
        (bitstream(size=900, end=b""), "the bitstream is incomplete: its last command is not DONE"),
        (bitstream(command=b"\x5e", size=900), "byte 42 is command 5e, not the configuration"),
        (b"", "no bitstream: there is no preamble in it"),
    ],
)
def test_a_stream_that_the_flash_cannot_take_is_refused(content, message):
    with pytest.raises(jedec.JedecError) as refusal:
        jedec.jedec(content, BOARD)
    assert str(refusal.value) == message


def test_every_machxo2_and_no_other_board_gets_a_jed():
    flashes = {name: entry.flash for name, entry in boards().items() if entry.flash}
    assert flashes == {"card-xo2-1200": {"idcode": IDCODE, "pages": PAGES, "user_pages": USER_PAGES}}


# ---------------------------------------------------------------- a design, packed and decoded again


def brams(config: str) -> dict[int, list[int]]:
    """Block RAMs of a text configuration as 512 words of 18 bits; the low half comes first."""
    found = {}
    for number, content in re.findall(r"^\.bram_init (\d+)\n((?:[0-9a-f]{3}\s+)+)", config, re.MULTILINE):
        raw = [int(word, 16) for word in content.split()]
        found[int(number)] = [low | high << 9 for low, high in zip(raw[::2], raw[1::2], strict=True)]
    return found


def memory(config: str, design: str, pattern: list[int]) -> list[int]:
    """The firmware memory of `config`. Random words in `design` show which bit of it is where."""

    def column(words: list[int], bit: int) -> tuple[int, ...]:
        return tuple(word >> bit & 1 for word in words)

    banks = range(0, len(pattern), 512)
    known = {column(pattern[first : first + 512], bit): (first, bit) for first in banks for bit in range(36)}
    words, content, bits = [0] * len(pattern), brams(config), 0
    for number, planted in brams(design).items():
        for lane in range(18):
            if place := known.get(column(planted, lane)):
                bits += 1
                for at, bit in enumerate(column(content[number], lane), place[0]):
                    words[at] |= bit << place[1]
    assert bits == 36 * len(banks)
    return words


def check_decoded(entry: Board, packed: Path, firmware: Path) -> str:
    """Turns the .jed beside a bitstream back into a text configuration, and compares that with the design."""
    folder = packed.parent
    content = File.read(packed.with_suffix(".jed").read_bytes())
    again, config, plain = (folder / f"decoded{suffix}" for suffix in (".bit", ".config", ".plain"))
    again.write_bytes(HEADER + content.stream())
    image.tool("yowasp-xo2unpack", again, config)
    # Uncompressed on both sides, so that the files show every bit of the configuration.
    image.tool("yowasp-xo2pack", config, plain)
    wanted = folder / "wanted.plain"
    image.tool("yowasp-xo2pack", folder / f"image{flow.suffix(entry)}", wanted)
    streams = [path.read_bytes().partition(PREAMBLE)[2] for path in (plain, wanted)]
    assert streams[0] == streams[1] and len(streams[0]) > 45_000
    # The block RAMs word by word, against the firmware.
    decoded = config.read_text()
    design = (folder / f"{entry.top}{flow.suffix(entry)}").read_text()
    words = memory(decoded, design, image.read_words(flow.pattern_file(entry), entry))
    assert words == image.read_words(firmware, entry)
    return decoded


def random_design(entry: Board, folder: Path, name: str, seed: int) -> dict:
    """Stands in for place and route: random bits in every logic tile, the pattern in six block RAMs."""
    rng = random.Random(1)
    text = ".device LCMXO2-1200\n\n.variant LCMXO2-1200HC\n\n"
    for row in (row for row in range(2, 11) if row != 6):
        for column in range(2, 22):
            bits = sorted({(rng.randrange(8), rng.randrange(40)) for _ in range(24)})
            lines = "".join(f"unknown: F{frame}B{bit}\n" for frame, bit in bits)
            text += f".tile R{row}C{column}:PLC\n{lines}\n"
    pattern = image.read_words(flow.pattern_file(entry), entry)
    halves = [
        [word >> shift & 0x3FFFF for word in pattern[at : at + 512]]
        for at in range(0, len(pattern), 512)
        for shift in (0, 18)
    ]
    for number, half in enumerate([*halves, [rng.getrandbits(18) for _ in range(512)]], 3):
        raw = [f"{part:03x}" for word in half for part in (word & 0x1FF, word >> 9)]
        rows = "\n".join(" ".join(raw[at : at + 8]) for at in range(0, len(raw), 8))
        text += f".bram_init {number}\n{rows}\n\n"
    (folder / f"{name}.config").write_text(text)
    used = {"used": 1, "available": 1}
    return {"fmax": {"clk": {"achieved": 90.0}}, "utilization": {"TRELLIS_COMB": used, "DP8KC": used}}


@pytest.fixture(scope="module")
def packed():
    """The bitstream of a random design with a random image; the .jed is beside it."""
    folder = ROOT / "build/tests" / f"jedec-{os.environ.get('PYTEST_XDIST_WORKER', '0')}"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flow, "BUILD", folder)
        patch.setattr(flow, "synthesise", lambda *what: {"LUT4": 1})
        patch.setattr(flow, "place_and_route", random_design)
        synth.build(BOARD)
        firmware = folder / BOARD.name / "random.hex"
        firmware.write_text(sealed_image(BOARD, 7))
        yield image.make(BOARD, firmware, folder / BOARD.name / "random.bit")


@pytest.mark.nightly("synth")
def test_the_decoded_jed_is_what_was_packed(packed):
    check_decoded(BOARD, packed, packed.with_suffix(".hex"))


@pytest.mark.nightly("synth")
def test_a_design_too_large_for_the_flash_leaves_nothing(packed):
    small = replace(BOARD, flash=BOARD.flash | {"pages": 100, "user_pages": 0})
    output = packed.parent / "large.bit"
    with pytest.raises(
        image.ImageError, match=r"^build/\S+/image.bit: the bitstream takes \d+ pages, but the"
    ):
        image.make(small, packed.with_suffix(".hex"), output)
    assert not output.exists() and not output.with_suffix(".jed").exists()


# ---------------------------------------------------------------- openFPGALoader


def openfpgaloader(part: Part, *words: str | Path) -> subprocess.CompletedProcess:
    with Cable(part) as cable:
        command = ["openFPGALoader", "-c", "xvc-client", "--ip", "127.0.0.1", "--port", str(cable.port)]
        return subprocess.run(
            [*command, *map(str, words)], capture_output=True, text=True, check=False, timeout=120
        )


@pytest.fixture
def part() -> Part:
    return Part(IDCODE, PAGES)


def holds(part: Part, jed: Path) -> bool:
    """Whether the flash holds the file's stream and nothing else."""
    stream = File.read(jed.read_bytes()).stream()
    return b"".join(part.rows()) == stream.ljust(PAGES * 16, b"\0")


@pytest.mark.nightly("synth")
def test_openfpgaloader_writes_the_same_pages(packed, part):
    jed = packed.with_suffix(".jed")
    done = openfpgaloader(part, "-f", "--verify", "-v", jed)
    assert done.returncode == 0, done.stdout + done.stderr
    assert holds(part, jed)
    assert (part.feature_row, part.feabits, part.done, part.failed) == (0, jedec.FEABITS, True, False)
    # How it reads the FEABITS.
    pins = dict(re.findall(r"^\t([\w ]+?) *: (enable|disable)$", done.stdout, re.MULTILINE))
    assert {name for name, state in pins.items() if state == "enable"} == {"JTAG port"}
