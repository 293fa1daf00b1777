# SPDX-License-Identifier: Apache-2.0
"""Each image of a release does what its folder says: a build rule may give it another dialect or option."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from rtl.command import own_environment
from rtl.sources import ROOT
from sw.tools.bin2hex import without_parity
from tb.firmware.test_firmware_gateway import (
    OVERDUE_MS,
    SEND_START,
    SEND_STOP,
    SET_TIMEOUT,
    START,
    TIMEOUT_MS,
    Bench,
)
from tb.firmware.test_firmware_translate import H
from tb.model.card import DIALECTS
from tb.model.fake_mailbox import FakeMailbox
from tb.model.firmware import Build, Machine, build

MEMORIES = {"tiny": 6144, "large": 16384}  # bytes; 8192 elsewhere
DELAYS_MS = {"delay5": 5, "delay20": 20}
STACK = 160


def images() -> list[str]:
    command = ["make", "-s", "-f", "sw/firmware.mk", f"FIRMWARE_PYTHON={sys.executable}", "firmware-images"]
    return subprocess.run(
        command, cwd=ROOT, env=own_environment(), capture_output=True, text=True, check=True
    ).stdout.split()


@dataclass(frozen=True)
class Released(Build):
    """An image as it is in a file of a release."""

    path: str = ""

    @property
    def parts(self) -> tuple[str, ...]:
        return Path(self.path).parent.parts

    @property
    def memory(self) -> int:
        return next((MEMORIES[part] for part in self.parts if part in MEMORIES), 8192)

    def start(self, mailbox: FakeMailbox) -> Machine:
        lines = build(self.path).read_text().split()
        assert 4 * len(lines) == self.memory
        program = b"".join(without_parity(int(line, 16)).to_bytes(4, "little") for line in lines)
        return Machine(mailbox, program, self.memory)


@pytest.mark.rule("DIALECT", "TOP-2")
@pytest.mark.parametrize("path", images())
def test_an_image_answers_as_its_folder_says(path: str):
    image = Released(path=path)
    dialect = DIALECTS[next((part for part in image.parts if part in DIALECTS), "card")]
    all_options = "all" in image.parts
    refreshes = "norefresh" not in image.parts and (
        dialect.refreshes or all_options or "refresh" in image.parts
    )
    delay_ms = next((DELAYS_MS[part] for part in image.parts if part in DELAYS_MS), 0)
    bench = Bench(image)

    def ask(pdu: str) -> bytes:
        before = len(bench.replies)
        bench.request(H(pdu))
        if delay_ms:
            bench.wait(delay_ms)
            assert len(bench.replies) == before
            bench.wait(OVERDUE_MS)
        assert len(bench.replies) == before + 1
        return bench.replies[-1][1:]

    assert ask("06 0002 0000") == bytes([0x86, dialect.codes["value"]])
    known = dialect.diagnoses or all_options
    assert ask("08 0000 1234") == (H("08 0000 1234") if known else bytes([0x88, dialect.codes["function"]]))

    bench.request(H("01 0020 0010"))
    if refreshes:
        bench.drive_answers(H("0607 2000"))
    bench.wait(delay_ms + OVERDUE_MS)
    assert bench.replies[-1][1:] == H("01 02 0706" if refreshes else "01 02 0000")
    assert bench.telegrams == [H("81 0000 0000")] * refreshes

    ask(SET_TIMEOUT.hex())
    bench.request(START)
    bench.drive_answers(H("0F03 2000"))
    bench.wait(TIMEOUT_MS + delay_ms + OVERDUE_MS)
    stops = "stop" in image.parts or all_options
    assert bench.telegrams[refreshes:] == [SEND_START, *[SEND_STOP] * stops]

    below = bench.gateway.state.memory_size - bench.gateway.state.lowest_sp
    assert 0 < below <= STACK, "linked for a memory of another size"
