# SPDX-License-Identifier: Apache-2.0
"""What tests of firmware images share: images with a random program, and the refusals of `make image`."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

from constraints.boards import Board
from rtl.sources import ROOT
from sw.tools.bin2hex import WORD_BITS, hex_line, without_parity
from sw.tools.bin2hex import words as memory
from sw.tools.seal import seal


def random_image(seed: int, words: int) -> list[int]:
    rng = random.Random(seed)
    return [rng.getrandbits(WORD_BITS) for _ in range(words)]


def sealed_image(entry: Board, seed: int) -> str:
    """Image file with a random program followed by zeros."""
    program = [without_parity(word) for word in random_image(seed, entry.memory_words - 102)]
    packed = seal(b"".join(word.to_bytes(4, "little") for word in program) + bytes(8))
    return "".join(map(hex_line, memory(packed, 4 * entry.memory_words)))


def refused(*words: str | Path) -> str:
    """Expects exit 2 and exactly one line; returns the line."""
    command = [sys.executable, "-m", "constraints.image", *map(str, words)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stdout + done.stderr
    return done.stderr.rstrip("\n")
