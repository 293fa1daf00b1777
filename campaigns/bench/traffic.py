# SPDX-License-Identifier: Apache-2.0
"""Random traffic: requests of masters, damage of their frames, and misbehaviour of the drive.

Other tests cover: breaks and line noise inside a frame (conformance.py, tb/rtl/test_uart.py), senders beside
the nominal rate (conformance.py), a frame while the card still answers (cases.py), resets.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from campaigns.bench.card import CORRECT, UNIT_ADDRESS, DriveAnswer
from campaigns.soak.run import Traffic
from regs.dialects import DEFAULT
from tb.agents import rtu
from tb.agents.crc16 import crc_good
from tb.model import fc_telegram
from tb.model.vlt_drive import VltDrive
from tb.model.wire import LineFormat

PROFILE = "vlt6000"
TEXT = "TWENTY CHARACTERS OK"
TEXT_PNU = 533
FOREIGN = UNIT_ADDRESS + 1


def parameter(pnu: int) -> int:
    """On-wire register of a parameter (MAP-6)."""
    return 10 * pnu - 1


def example_drive() -> VltDrive:
    drive = VltDrive(PROFILE, example=True)
    drive.set_text(TEXT_PNU, TEXT)
    return drive


# ---------------------------------------------------------------- behaviour of the drive


def _with_bad_bcc(reply: bytes) -> tuple[bytes, dict]:
    return reply[:-1] + bytes([reply[-1] ^ 0x01]), {}


def _from_another(reply: bytes) -> bytes:
    return fc_telegram.build(reply[3:-1], adr=fc_telegram.ADR + 1)


def _with_long_lge(reply: bytes) -> bytes:
    body = bytes([reply[0], reply[1] + 2]) + reply[2:-1]
    return body + bytes([fc_telegram.bcc(body)])


def _of_another_parameter(reply: bytes) -> bytes:
    return fc_telegram.build(bytes([reply[3], reply[4] ^ 0x01]) + reply[5:-1])


def _refusal(fault: int) -> Callable[[bytes], bytes]:
    def refuse(reply: bytes) -> bytes:
        pke = fc_telegram.words(
            fc_telegram.pke(fc_telegram.REPLY_REFUSED, (reply[3] << 8 | reply[4]) & 0x7FF)
        )
        return fc_telegram.build(pke + reply[5:7] + fc_telegram.words(0, fault) + reply[-5:-1])

    return refuse


# Idle bits before a character. Allowed are two characters, 22 bits, and 1.5 times the nominal time in all.
SHORT_GAP_BITS, LONG_GAP_BITS, DRAGGING_BITS = 19.8, 27.5, 8.0
GARBAGE = bytes([0x55] * 7)
REFUSALS = (0, 1, 2, 3, 4, 5, 17, 130, 131, 200)

TAKEN = (
    DriveAnswer("a gap of 1.8 characters", wire=lambda reply: (reply, {"gaps": {4: SHORT_GAP_BITS}})),
    DriveAnswer("a stray character before it", wire=lambda reply: (b"\xff" + reply, {})),
    DriveAnswer("at the last moment of the wait", at_the_end="ends"),
)
REFUSED = (
    DriveAnswer("no answer", False, content=lambda reply: None),
    DriveAnswer("too late", False, at_the_end="starts"),
    DriveAnswer("wrong BCC", False, wire=_with_bad_bcc),
    DriveAnswer("wrong ADR", False, content=_from_another),
    DriveAnswer("LGE too great", False, content=_with_long_lge),
    DriveAnswer("parity error", False, wire=lambda reply: (reply, {"bad_parity": len(reply) // 2})),
    DriveAnswer("bad stop bit", False, wire=lambda reply: (reply, {"bad_stop": len(reply) - 2})),
    DriveAnswer("a gap of 2.5 characters", False, wire=lambda reply: (reply, {"gaps": {4: LONG_GAP_BITS}})),
    DriveAnswer(
        "dragging, 1.7 times the time",
        False,
        wire=lambda reply: (reply, {"gaps": dict.fromkeys(range(1, len(reply)), DRAGGING_BITS)}),
    ),
    DriveAnswer("garbage", False, content=lambda reply: GARBAGE),
)
# Only after a request for a parameter.
UNFIT = DriveAnswer("another parameter's reply", False, content=_of_another_parameter)


def refusal(fault: int) -> DriveAnswer:
    return DriveAnswer(f"fault telegram, {fault}", content=_refusal(fault))


def some_answers(rng: random.Random, process: bool) -> list[DriveAnswer]:
    """The drive's answers to a telegram and its repeat; the first answer, at least, is a special one."""
    refused = REFUSED if process else (*REFUSED, UNFIT)
    roll = rng.random()
    if roll < 0.25:
        return [rng.choice(TAKEN)]
    if roll < 0.45 and not process:
        return [refusal(rng.choice(REFUSALS))]
    second = rng.random()
    again = CORRECT if second < 0.55 else rng.choice(refused) if second < 0.9 else rng.choice(TAKEN)
    return [rng.choice(refused), again]


# ---------------------------------------------------------------- requests of masters

LONGEST_FRAME = 256  # FRAME-5
SLOW_BAUD = 9600
# Distance in bits between a silence inside or after a frame and the limit that it must keep to one side of.
CLEAR_BITS = 1.0
GLITCH_BITS = 0.2  # LINE-5: shorter than a quarter


@dataclass(frozen=True)
class Request:
    """Traffic of one request; `harm` is the reason why it must not be served, if any."""

    address: int
    pdu: bytes
    harm: str | None = None
    bad_parity: int | None = None
    bad_stop: int | None = None
    gap: tuple[int, float] | None = None  # before a character, bits
    then: tuple[int, float] | None = None  # a further character, so many bits after the frame
    noise: int | None = None  # a character, t3.5 or more before the frame
    glitch: float | None = None  # bits before the frame

    def adu(self) -> bytes:
        adu = bytearray(rtu.build(self.address, self.pdu))
        adu[-1] ^= 0x10 if self.harm == "bad CRC" else 0
        return bytes(adu)


def _breaks_apart(rng: random.Random, line: LineFormat, adu: bytes) -> tuple[int, float]:
    """A silence between t1.5 and t3.5 in the frame, such that no part of it is good by chance."""
    while True:
        at = rng.randrange(1, len(adu))
        if not any(len(part) >= 4 and crc_good(part) for part in (adu[:at], adu[at:])):
            return at, rng.uniform(line.t15_bits + CLEAR_BITS, line.t35_bits - CLEAR_BITS)


def some_requests(rng: random.Random, line: LineFormat, count: int) -> list[Request]:
    """Legal and illegal ones (campaigns/soak/run.py), with their disturbances."""
    made = Traffic(rng, DEFAULT, PROFILE).requests(count)
    return [_disturbed(rng, line, asked.unit, asked.pdu) for asked in made]


def _disturbed(rng: random.Random, line: LineFormat, address: int, pdu: bytes) -> Request:
    size = len(pdu) + 3
    harm = rng.random()
    if harm < 0.02:
        return Request(address, pdu, "bad CRC")
    if harm < 0.04 and line.parity:
        return Request(address, pdu, "parity error", bad_parity=rng.randrange(size))
    if harm < 0.05:
        return Request(address, pdu, "bad stop bit", bad_stop=rng.randrange(size))
    if harm < 0.06:
        gap = _breaks_apart(rng, line, rtu.build(address, pdu))
        return Request(address, pdu, "silence of 1.5 to 3.5 characters in it", gap=gap)
    if harm < 0.07:
        pause = rng.uniform(line.t15_bits + CLEAR_BITS, line.t35_bits - CLEAR_BITS)
        return Request(
            address, pdu, "a character after 1.5 to 3.5 characters", then=(rng.randrange(256), pause)
        )
    if harm < 0.075 and line.baud > SLOW_BAUD:
        excess = rng.randint(1, 40) + LONGEST_FRAME - 3 - len(pdu)
        return Request(address, pdu + rng.randbytes(excess), "more than 256 bytes")
    # The remaining disturbances must not keep the card from serving it.
    if harm < 0.09:
        return Request(address, pdu, gap=(rng.randrange(1, size), rng.uniform(0, line.t15_bits - CLEAR_BITS)))
    if harm < 0.10:
        return Request(address, pdu, noise=rng.randrange(256))
    if harm < 0.11:
        return Request(address, pdu, glitch=rng.uniform(GLITCH_BITS, 3))
    return Request(address, pdu)
