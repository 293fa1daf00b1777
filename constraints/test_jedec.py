# SPDX-License-Identifier: Apache-2.0
"""JEDEC files for the MachXO2's flash: form, refusals, openFPGALoader writing them."""

from __future__ import annotations

import os
import random
import re
import subprocess
from dataclasses import dataclass, replace

import pytest

from constraints import flow, image, jedec, synth
from constraints.boards import boards
from constraints.flash_model import Part, cable
from constraints.test_image import plant_build, sealed_image
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
    """What a .jed file says; `areas` are the fuses by their first number."""

    text: str
    areas: dict[int, str]

    @classmethod
    def read(cls, content: bytes) -> File:
        text = content.decode("ascii")
        fields = re.findall(r"NOTE [^*]*\*\nL(\d+)\n([01\n]*)\*\n", text)
        return cls(text, {int(at): fuses.replace("\n", "") for at, fuses in fields})

    def field(self, letters: str) -> str:
        (found,) = re.findall(rf"^{letters}([^*]*)\*$", self.text, re.MULTILINE)
        return found

    def fuses(self) -> str:
        return "".join(fuses for _, fuses in sorted(self.areas.items()))

    def stream(self) -> bytes:
        """The first area as bytes."""
        fuses = self.areas[0]
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
    for start, fuses in sorted(made.areas.items()):
        assert start == at
        at += len(fuses)
    assert at == int(made.field("QF")) == (PAGES + USER_PAGES) * 128 == 343936
    lines = re.findall(r"^[01]{17,}$", made.text, re.MULTILINE)
    assert {len(line) for line in lines} == {128}


def test_the_checksums_are_those_of_the_standard(made):
    fuses = made.fuses()
    total = sum(1 << number % 8 for number, fuse in enumerate(fuses) if fuse == "1")
    assert int(made.field("C"), 16) == total % 65536
    inside, _, after = made.text.partition("\x03")
    assert inside.startswith("\x02") and after == f"{sum(map(ord, inside + chr(3))) % 65536:04X}\n"


def test_feature_row_and_feabits_are_the_chosen_ones(made):
    row, feabits = made.field("E").split("\n")
    assert row == "0" * 64
    # Off are PROGRAMN, 5, slave SPI, 9, and I2C, 10. JTAG, 8, stays on.
    assert feabits == "0000010001100000"


def test_a_full_flash_is_still_accepted():
    full = File.read(jedec.jedec(bitstream(size=PAGES * 16), BOARD))
    assert len(full.areas[0]) == PAGES * 128 and len(full.fuses()) == int(full.field("QF"))


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


# ---------------------------------------------------------------- a packed design


@pytest.fixture(scope="module")
def packed():
    """The bitstream of an empty design with a random image; the .jed is beside it."""
    folder = ROOT / "build/tests" / f"jedec-{os.environ.get('PYTEST_XDIST_WORKER', '0')}"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flow, "BUILD", folder)
        plant_build(patch, ".device LCMXO2-1200\n\n.variant LCMXO2-1200HC\n\n")
        synth.build(BOARD)
        firmware = folder / BOARD.name / "random.hex"
        firmware.write_text(sealed_image(BOARD, 7))
        yield image.make(BOARD, firmware, folder / BOARD.name / "random.bit")


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


@pytest.mark.nightly("synth")
def test_openfpgaloader_writes_the_same_pages(packed):
    part, jed = Part(IDCODE, PAGES), packed.with_suffix(".jed")
    with cable(part) as port:
        command = ["openFPGALoader", "-c", "xvc-client", "--ip", "127.0.0.1", "--port", str(port)]
        command += ["-f", "--verify", "-v", str(jed)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    # The stream and nothing else.
    assert b"".join(part.rows()) == File.read(jed.read_bytes()).stream().ljust(PAGES * 16, b"\0")
    assert (part.feature_row, part.feabits, part.done, part.failed) == (0, jedec.FEABITS, True, False)
    # How it reads the FEABITS.
    pins = dict(re.findall(r"^\t([\w ]+?) *: (enable|disable)$", done.stdout, re.MULTILINE))
    assert {name for name, state in pins.items() if state == "enable"} == {"JTAG port"}
