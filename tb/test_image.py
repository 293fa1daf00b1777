# SPDX-License-Identifier: Apache-2.0
"""A new firmware into a finished design: what comes out is what a full build with that firmware gives."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tb.lib.runner import ROOT
from tb.test_tools import command, one_line
from tools import image, synth
from tools.bin2hex import WORD_BITS, hex_line, with_parity, without_parity
from tools.boards import Board, boards

BOARDS = boards()
# A board of each family; the small configuration is routed sooner, the standard one is quick on ECP5 alone.
FULL = {
    "ice40": replace(BOARDS["hx8k-breakout"], config="tiny", clk_hz=24_000_000),
    "machxo2": BOARDS["card-xo2-1200"],
    "ecp5": BOARDS["ulx3s-25"],
    "machxo3": replace(BOARDS["card-xo3-4300"], config="tiny", clk_hz=24_000_000),
}


@pytest.fixture
def other_folder(monkeypatch, request) -> Path:
    """Where this test builds, so that no finished design is touched."""
    folder = (
        ROOT / "build/tests" / f"image-{request.node.callspec.id if hasattr(request.node, 'callspec') else 0}"
    )
    shutil.rmtree(folder, ignore_errors=True)
    for module in (image, synth):
        monkeypatch.setattr(module, "BUILD", folder)
    return folder


def random_image(seed: int, words: int) -> list[int]:
    rng = random.Random(seed)
    return [rng.getrandbits(WORD_BITS) for _ in range(words)]


@pytest.mark.parametrize("family", FULL)
def test_bitstream_is_that_of_a_full_build(family, other_folder):
    entry = FULL[family]
    folder = other_folder / entry.name
    built = synth.build(entry)
    # Zeros where the program ends, as in a real image, and no word like another before.
    program = [with_parity(without_parity(word)) for word in random_image(2, entry.memory_words - 100)]
    words = program + [0] * 100
    firmware = folder / "other.hex"
    firmware.write_text("".join(hex_line(word).upper() for word in words))
    patched = image.make(entry, firmware, folder / "patched")

    synth.synthesise(entry, folder, firmware, "rebuilt")
    synth.place_and_route(entry, folder, "rebuilt", built["seed"])
    rebuilt = folder / f"rebuilt{image.result_suffix(entry)}"
    if entry.packs:
        image.tool(image.PACK[entry.family], folder / f"rebuilt{image.suffix(entry)}", rebuilt)
    assert patched.read_bytes() == rebuilt.read_bytes()
    assert patched.read_bytes() != (ROOT / built["bitstream"]).read_bytes()


# ---------------------------------------------------------------- the memory in the text configuration


@pytest.mark.parametrize("width", image.WIDTHS)
def test_lanes_and_raw_words_are_inverse(width):
    raw = [word & (0x1FF if width >= image.RAW_BITS else 0xFF) for word in random_image(width, 1024)]
    content = image.lanes(raw, width)
    assert len(content) == width
    assert image.raw_words(content, width) == raw


def configuration(memory: list[int]) -> str:
    """512 words by 36 bits in two block RAMs of 18 bits each, and another."""
    halves = [[word & 0x3FFFF for word in memory], [word >> 18 for word in memory]]
    text = ".device x\n\n"
    for number, half in enumerate([*halves, [7] * 512]):
        raw = [part for word in half for part in (word & 0x1FF, word >> 9)]
        rows = [" ".join(f"{word:03x}" for word in raw[at : at + 8]) for at in range(0, len(raw), 8)]
        text += f".bram_init {number}\n" + "\n".join(rows) + "\n\n"
    return text


def test_only_the_memory_s_own_bits_change():
    old, new = random_image(1, 512), [*range(500), *[0] * 12]
    assert image.replace(configuration(old), old, new) == configuration(new)


def test_a_design_without_the_memory_is_refused():
    old = random_image(1, 512)
    for text in (configuration(random_image(3, 512)), configuration(old).split(".bram_init 1")[0], ""):
        with pytest.raises(image.ImageError, match="was not found"):
            image.replace(text, old, old)


# ---------------------------------------------------------------- what is said when something is wrong


def refused(*words: str | Path) -> str:
    """Exit 2, one line, nothing else."""
    command = [sys.executable, "-m", "tools.image", *map(str, words)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stdout + done.stderr
    return done.stderr.rstrip("\n")


@pytest.fixture
def hex_file(tmp_path):
    def write(text: str | bytes) -> Path:
        path = tmp_path / "x.hex"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def test_unknown_board(hex_file):
    said = refused("nosuch", hex_file(""))
    assert said == f"no board 'nosuch' in constraints/boards.toml; there are: {', '.join(BOARDS)}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("000000000\n" * 1535, "{path}: 1535 words, but the memory of card-xo2-1200 has 1536"),
        ("000000000\n" * 2048, "{path}: 2048 words, but the memory of card-xo2-1200 has 1536"),
        ("", "{path}: 0 words, but the memory of card-xo2-1200 has 1536"),
        ("000000000\n00000000g\n", "{path}:2: '00000000g' is no 36-bit word in hex"),
        ("000000000\n\n000000000\n", "{path}:2: '' is no 36-bit word in hex"),
        ("00000013\n", "{path}:1: '00000013' is no 36-bit word in hex"),
        ("000000000\n100000000\n" * 768, "{path}:2: 100000000 has not the parity that the card asks for"),
        (b"\x7fELF\xff\xfe", "{path}: no text"),
    ],
)
def test_bad_image(hex_file, text, message):
    path = hex_file(text)
    assert refused("card-xo2-1200", path) == message.format(path=path)


def test_missing_image(tmp_path):
    assert (
        refused("card-xo2-1200", tmp_path / "no.hex") == f"{tmp_path / 'no.hex'}: No such file or directory"
    )


def test_unfinished_design(hex_file, other_folder):
    """A good image, but the board was never built."""
    entry: Board = BOARDS["icebreaker"]
    output = other_folder / "out.bin"
    with pytest.raises(image.ImageError, match="no finished design yet; run `make synth BOARD=icebreaker`"):
        image.make(entry, hex_file(hex_line(0) * entry.memory_words), output)
    assert not output.exists()


@pytest.mark.parametrize("words", [(), ("BOARD=icebreaker",), ("FIRMWARE=x.hex",)])
def test_make_image_wants_a_board_and_a_firmware(words):
    done = command("make", "image", *words)
    assert done.returncode == 2
    assert one_line(done.stderr) == "say which: make image BOARD=name FIRMWARE=file.hex"


def test_make_synth_with_an_unknown_board():
    done = command("make", "synth", "BOARD=nosuch")
    assert done.returncode == 2
    assert one_line(done.stderr).startswith("no board 'nosuch' in constraints/boards.toml; there are: ")
