# SPDX-License-Identifier: Apache-2.0
"""Turns a compressed bitstream into a JEDEC file, which openFPGALoader writes into a MachXO2's own flash.

A MachXO2 configures itself from pages of 16 bytes: the compressed bitstream from its preamble on, its last
page filled up with FF. A .jed holds one fuse for each bit, the first bit of the stream first. All pages with
content are one field of fuses, block RAMs too, because openFPGALoader verifies one field only.

Form, checksums and feature row are those of vendor files for the same part. Nothing here has been on silicon.
"""

from __future__ import annotations

from constraints.boards import Board

PAGE = 16
# The feature row keeps no custom id and no I2C address.
FEATURE_ROW = 0
# The FEABITS say which configuration pins stay such in a part with a written flash. The others become user
# pins, here unused inputs. JTAG stays (bit 8 is 0), because it is the way to write over a bad image. INITN
# and DONE do not (bits 6 and 7 are 0): a disturbed pin must not hold up the start. All other bits are 0:
# start from this flash alone, no password. The bits mean what openFPGALoader's decoder says. Vendor files
# have the same value.
PROGRAMN_OFF = 1 << 5  # A disturbed pin must not restart the card beside an inverter.
SLAVE_SPI_OFF = 1 << 9  # Nothing but JTAG reaches the flash.
I2C_OFF = 1 << 10  # Likewise.
FEABITS = PROGRAMN_OFF | SLAVE_SPI_OFF | I2C_OFF

PREAMBLE = b"\xff\xff\xbd\xb3"
DUMMY, IDCODE, COMPRESSED, UNCOMPRESSED = 0xFF, 0xE2, 0xB8, 0x82
# Commands before the configuration, and the number of bytes after each.
BEFORE = {DUMMY: 0, 0x3B: 3, IDCODE: 7, 0x22: 7, 0x46: 3, 0x02: 11}
DONE = b"\x5e\x00\x00\x00"
STX, ETX = "\x02", "\x03"


class JedecError(Exception):
    """Error for the user, in one line."""


def check(stream: bytes, board: Board) -> None:
    """Refuses a stream from which the part could not configure itself."""
    idcode = None
    at = len(PREAMBLE)
    while at < len(stream) and stream[at] in BEFORE:
        if stream[at] == IDCODE:
            idcode = int.from_bytes(stream[at + 4 : at + 8], "big")
        at += 1 + BEFORE[stream[at]]
    if at >= len(stream):
        raise JedecError("the bitstream ends before its configuration")
    command = stream[at]
    if command == UNCOMPRESSED:
        raise JedecError("the bitstream is not compressed, and the flash takes compressed ones only")
    if command != COMPRESSED:
        raise JedecError(f"byte {at} is command {command:02x}, not the configuration")
    if idcode != (wanted := board.flash["idcode"]):
        of = "no part" if idcode is None else f"part {idcode:#010x}"
        raise JedecError(f"the bitstream is for {of}, but {board.part} is {wanted:#010x}")
    if not stream.rstrip(bytes([DUMMY])).endswith(DONE):
        raise JedecError("the bitstream is incomplete: its last command is not DONE")


def pages(bitstream: bytes, board: Board) -> list[bytes]:
    """The pages of flash with the content of a .bit file."""
    start = bitstream.find(PREAMBLE)
    if start < 0:
        raise JedecError("no bitstream: there is no preamble in it")
    stream = bitstream[start:]
    check(stream, board)
    found = [stream[at : at + PAGE].ljust(PAGE, bytes([DUMMY])) for at in range(0, len(stream), PAGE)]
    if len(found) > (most := board.flash["pages"]):
        raise JedecError(f"the bitstream takes {len(found)} pages, but the flash of {board.part} has {most}")
    return found


def fuses(data: bytes) -> str:
    return "".join(f"{byte:08b}" for byte in data)


def bits(value: int, width: int) -> str:
    """A register of the feature sector: its bit 0 comes first."""
    return f"{value:0{width}b}"[::-1]


def fuse_sum(data: bytes) -> int:
    """Sum of the bytes, the first fuse of each as its bit 0."""
    return sum(int(f"{byte:08b}"[::-1], 2) for byte in data) & 0xFFFF


def jedec(bitstream: bytes, board: Board) -> bytes:
    """The JEDEC file of a board's compressed .bit file."""
    used = pages(bitstream, board)
    unused = board.flash["pages"] + board.flash["user_pages"] - len(used)
    lines = [
        f"{STX}*",
        f"NOTE {board.title}, made by constraints/jedec.py*",
        f"NOTE DEVICE NAME:\t{board.part}*",
        f"QF{(len(used) + unused) * PAGE * 8}*",
        "G0*",
        "F0*",
        "NOTE CONFIGURATION AND BLOCK RAM*",
        "L000000",
        *map(fuses, used),
        "*",
        # openFPGALoader leaves out the field with this name.
        "NOTE END CONFIG DATA*",
        f"L{len(used) * PAGE * 8}",
        *[fuses(bytes(PAGE))] * unused,
        "*",
        f"C{fuse_sum(b''.join(used)):04X}*",
        "NOTE FEATURE_ROW*",
        f"E{bits(FEATURE_ROW, 64)}",
        f"{bits(FEABITS, 16)}*",
        "NOTE User Electronic Signature Data*",
        "UH00000000*",
        ETX,
    ]
    text = "\n".join(lines)
    return f"{text}{sum(text.encode()) & 0xFFFF:04X}\n".encode()
