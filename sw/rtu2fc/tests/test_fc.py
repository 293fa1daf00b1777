# SPDX-License-Identifier: Apache-2.0
"""sw/rtu2fc/fc.py: telegrams of a line in words. Their meaning comes from tb/model and the drives' tables."""

from __future__ import annotations

import os
import random
import re

import pytest

from regs.dialects import STANDARD_DRIVE
from sim.drive.drive_bench import table
from sw.rtu2fc import fc
from sw.rtu2fc.capture import Heard
from tb.model import fc_telegram

NAMES = {int(row["pnu"]): row["name"] for row in table("vlt6000")}
START, STATUS = bytes.fromhex("02 06 81 04 7C 19 99 7D"), bytes.fromhex("02 06 81 0F 03 20 00 A9")
READ_514 = fc_telegram.build_parameter(1, 514)
IS_300 = fc_telegram.build_parameter(2, 514, pwe=300, pcd1=0x0F03, pcd2=0x2000)
BAD_BCC = STATUS[:-1] + b"\xa8"


def shown(*sent: tuple, drive: str = "vlt6000") -> fc.Telegrams:
    """Telegrams, each after characters of silence, with gaps before bytes and parity errors in bytes."""
    line, now = fc.Telegrams(drive), 0.0
    for after, data, *flaws in sent:
        gaps, wrong = (*flaws, {}, ())[:2] if flaws else ({}, ())
        now += after
        for at, byte in enumerate(data):
            now += gaps.get(at, 0)
            line.character(Heard(now, now + 1, byte, fault="parity" if at in wrong else ""))
            now += 1
    line.end()
    texts = [(name in fc.TELEGRAMS, text) for name, _, _, text in line.found if name not in fc.FIELDS]
    line.telegrams, line.warnings = ([text for of, text in texts if of is wanted] for wanted in (True, False))
    return line


def percent(word: int) -> str:
    return f"{100 * (word - 0x10000 if word & 0x8000 else word) / 0x4000:.1f} %"


def some_telegram(rng: random.Random, reply: bool) -> bytes:
    words = (rng.getrandbits(16), rng.getrandbits(16))
    pnu = rng.choice([*NAMES, rng.randrange(2048)])
    kind = rng.choice(("process", "parameter", "text"))
    if kind == "process":
        return fc_telegram.build_process(*words)
    if kind == "parameter":
        ak = rng.choice((0, 1, 2, 7) if reply else (0, 1, 2, 3, 13, 14))
        return fc_telegram.build_parameter(ak, pnu, rng.randrange(100), rng.getrandbits(32), *words)
    text = bytes(rng.choice(range(0x23, 0x7F)) for _ in range(rng.randrange(21)))
    return fc_telegram.build_text(pnu, text, pcd1=words[0], pcd2=words[1])


def test_random_telegrams_agree_with_the_model():
    rng = random.Random(os.environ.get("COCOTB_RANDOM_SEED") or "1")
    for number in range(400):
        reply = number % 2 == 1
        data = some_telegram(rng, reply)
        parts, got = fc_telegram.parse(data, reply), fc.Meaning(data, reply, fc.DRIVES["vlt6000"])
        fields = {name: text for name, _, _, text in got.fields}
        assert got.fault is None and fields["bcc-right"] == f"BCC {data[-1]:02X}h right"
        assert f" {parts.pcd1:04X}h" in fields["pcd1"] and fields["pcd2"].endswith(percent(parts.pcd2))
        if parts.kind != "process":
            name = NAMES.get(parts.pnu, "unknown")
            assert fields["pke"].startswith(
                f"PKE {fc_telegram.pke(parts.ak, parts.pnu):04X}h: AK {parts.ak} "
            )
            assert fields["pke"].endswith(f", PNU {parts.pnu} {name}") and f" {parts.pnu} {name}" in got.words
            assert fields["ind"] == f"IND {parts.ind:04X}h"
        if parts.kind == "parameter":
            assert fields["pwe"].startswith(f"PWE {parts.pwe:08X}h: ")
        if parts.kind == "text":
            assert f" = '{parts.text.decode('latin-1')}'; " in got.words


@pytest.mark.parametrize(
    ("drive", "said"),
    [
        ("vlt6000", "Control ready, stand by, bit 6, local control, running"),
        (STANDARD_DRIVE, "Control ready, trip lock, local control, running"),
    ],
)
def test_the_words_are_those_of_the_chosen_drive(drive, said):
    got = shown((9, START), (2.1, fc_telegram.build_process(0x0845, 0xE000)), drive=drive)
    ramp = "ramp 1, " * (drive == STANDARD_DRIVE)
    assert got.telegrams[0] == f"Request: control 047Ch (start, {ramp}data valid), reference 40.0 %"
    assert got.telegrams[1] == f"Reply: status 0845h ({said}), frequency -50.0 %"


@pytest.mark.parametrize(
    ("pnu", "ak", "pwe", "said"),
    [
        (514, 2, 300, " = 3.00 A;"),
        (211, 1, 0xFFFF, " = -0.01 %;"),
        (225, 2, 0x80000000, " = -2147483.648 Hz;"),
        (225, 2, 0xFFFF, " = 65.535 Hz;"),
        (104, 7, 17, f"refused 104 {NAMES[104]}: not possible in the present mode;"),
    ],
)
def test_a_value_is_scaled_and_signed_and_a_refusal_is_in_words(pnu, ak, pwe, said):
    request, reply = fc_telegram.build_parameter(1, pnu), fc_telegram.build_parameter(ak, pnu, pwe=pwe)
    assert said in shown((9, request), (2.1, reply)).telegrams[1]


@pytest.mark.parametrize(
    ("reply", "said", "warned"),
    [
        ((2.1, BAD_BCC), "BCC A8h, A9h would be right", []),
        ((2.1, STATUS, {}, (3,)), "parity wrong in byte 4", ["Parity error in 0Fh"]),
        (
            (2.1, STATUS, {5: 3.0}),
            "cut after 5 of 8 bytes",
            ["No STX: 20 00 A9", "Gap of 3.0 characters in a telegram, at most 2"],
        ),
        ((2.1, STATUS[:1]), "cut after STX", []),
        ((2.1, STATUS, {2: 1.5, 4: 1.5, 6: 1.9}), "took 1.61 times its nominal time, at most 1.5", []),
        ((2.1, b"\x03" + STATUS[1:]), None, ["No STX: 03 06 81 0F 03 20 00 A9"]),
    ],
)
def test_a_spoilt_reply_is_bad_and_the_next_telegram_is_good(reply, said, warned):
    got = shown((9, START), reply, (20, READ_514), (2.1, IS_300))
    assert [text for text in got.telegrams if text.startswith("Bad")] == ([f"Bad: {said}"] if said else [])
    good = [text for text in got.telegrams if not text.startswith("Bad")]
    assert [text.split(":")[0] for text in good] == ["Request", "Request", "Reply"]
    assert sorted(got.warnings) == sorted([*warned, "No reply"])


def test_silence_tells_telegrams_apart():
    """FC-8: up to 2 characters inside, at least 2 before; what follows a bad one without it is its rest."""
    assert shown((9, START), (2.1, STATUS, {5: 2.0})).warnings == []
    assert shown((9, START), (1.5, STATUS)).warnings == [
        "Pause of 1.5 characters before a telegram, at least 2"
    ]
    assert shown((9, START), (1.0, b"\0"), (0.5, STATUS)).warnings == ["Phantom before STX: 00"]
    got = shown((9, BAD_BCC), (1.0, START), (2.2, START))
    assert [text[:3] for text in got.telegrams] == ["Bad", "Req"]
    assert got.warnings == ["No STX: 02 06 81 04 7C 19 99 7D", "No reply"]


@pytest.mark.parametrize(
    ("sent", "kinds"),
    [
        ([(9, READ_514), (60, READ_514), (2.1, IS_300)], "Request, No reply, Request, Reply"),
        ([(9, START), (130, STATUS)], "Request, Reply"),
        ([(9, START), (133, STATUS)], "Request, No reply, Request, No reply"),
        ([(9, READ_514), (2.1, fc_telegram.build_parameter(1, 515))], "Request, No reply, Request, No reply"),
        (
            [(9, fc_telegram.build_process(0x47C, 0, 0x80)), (2.1, START), (2.1, STATUS)],
            "To all, Request, Reply",
        ),
    ],
)
def test_a_reply_is_told_from_a_request(sent, kinds):
    """By its parameter and the card's wait of 150 ms, 131 characters (FC-9)."""
    got = shown(*sent)
    assert sorted(re.split(":", text)[0] for text in got.telegrams + got.warnings) == sorted(
        kinds.split(", ")
    )


def test_of_noise_no_character_is_lost():
    """Random bytes, many of them of telegrams: each is in exactly one telegram or outside of all."""
    rng = random.Random(os.environ.get("COCOTB_RANDOM_SEED") or "1")
    usual, now, middles, sent = [*b"\x02\x02\x06\x0e\x81\xf2\x72\x05", *START], 0.0, [], []
    for _ in range(60):
        data = bytes(rng.choice([*usual, rng.randrange(256)]) for _ in range(rng.randrange(1, 30)))
        after = rng.choice((0.5, 1.9, 2.2, 5.0, 140.0))
        sent.append((after, data, {}, (rng.randrange(60),)))
        middles += [now + after + at + 0.5 for at in range(len(data))]
        now += after + len(data)
    spans = [s for s in shown(*sent).found if s[0] in (*fc.TELEGRAMS, "phantom", "no-stx")]
    assert [sum(ss < middle < es for _, ss, es, _ in spans) for middle in middles] == [1] * len(middles)
