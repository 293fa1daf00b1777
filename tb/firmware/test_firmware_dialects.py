# SPDX-License-Identifier: Apache-2.0
"""The firmware in each dialect (docs/guide/dialects.md): translation core and poll loop. Bytes are hex.

`S2` is the manual of the Modbus built into VLT 2800, 6000 HVAC and 8000 AQUA (MG.10.S2.02), `S3` the
design guide of the VLT HVAC Basic Drive (MG.18.C2.02).
"""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from regs.dialects import CODES, DIALECTS, STANDARD, Dialect, having
from rtl.sources import ROOT
from tb.firmware.test_firmware_gateway import (
    ASK_514,
    OVERDUE_MS,
    READ_514,
    READ_IND,
    REPLY_514,
    TELL_514,
    Bench,
    instructions_until,
    play,
    scenarios,
)
from tb.firmware.test_firmware_translate import (
    RUNNING,
    H,
    answered,
    refused,
    reply_to,
    same,
    sent_for,
    status,
)
from tb.lib.rows import each_row
from tb.lib.seeds import seeded
from tb.model.card import DIALECTS as MODEL_DIALECTS
from tb.model.card import OBJECTS, VERSION
from tb.model.card import Dialect as ModelDialect
from tb.model.firmware import EXCHANGE, NOT_A_REPLY, REPLY, SILENT, Build, Transaction, Translator

GUIDE = ROOT / "docs/guide/dialects.md"


def spoken_in(*dialects: str) -> pytest.MarkDecorator:
    """Runs the test in these dialects."""
    names = [pytest.param(name, marks=pytest.mark.rule("DIALECT")) for name in dialects]
    return pytest.mark.parametrize("card", names, indirect=True)


LATER = having(text_by_size=True)
in_all = spoken_in(*DIALECTS)
in_later = spoken_in(*LATER)
in_standard = spoken_in(STANDARD)


@pytest.fixture
def card(request: pytest.FixtureRequest) -> Translator:
    return Translator(dialect=request.param)


def tried_as_text(card: Translator, pdu: str, number: str) -> Transaction:
    """A request sent as a number, which the drive rejects with fault 5; its second telegram is next."""
    txn = card.do(H(pdu))
    assert txn.outcome == EXCHANGE
    assert txn.telegram == H(number)
    head = txn.telegram[1:5]
    assert txn.drive_reply(bytes([0x70 | head[0] & 0xF]) + head[1:] + H(f"0000 0005 {RUNNING}")) == EXCHANGE
    return txn.drive_commit().drive_again()


def row_of(one: Dialect) -> ModelDialect:
    """The row of tb/model/card.py that says the same."""
    traits = dict(one.traits)
    codes = {why: code for why, trait in CODES.items() if (code := traits.pop(trait))}
    options = {"refreshes": "STATUS_REFRESH" in one.options, "diagnoses": "DIAGNOSTICS" in one.options}
    return ModelDialect(codes, **traits, **options)


@pytest.mark.parametrize("name", DIALECTS)
def test_the_model_has_each_value_of_the_table_and_notices_a_change_of_any(name: str):
    one = DIALECTS[name]
    assert row_of(one) == MODEL_DIALECTS[name]
    for trait, value in one.traits.items():
        other = not value if isinstance(value, bool) else value + 1
        assert row_of(replace(one, traits=one.traits | {trait: other})) != MODEL_DIALECTS[name], trait


# ---------------------------------------------------------------- the documents' examples


@in_later
@each_row("registers", range(1, 11))
def test_s3_reads_1_to_10_registers(card: Translator, registers: int):
    """Texts of 2 to 20 characters; numbers have 1 or 2 registers."""
    pdu, text = f"03 1841 {registers:04x}", "VLT HVAC Basic Drive"[: 2 * registers].encode()
    drive = f"F26D 0400 {text.hex()} {RUNNING}"
    by_text = H("81 F26D 0400 0000 0000 0000 0000")
    if registers <= 2:
        txn = tried_as_text(card, pdu, "81 126D 0000 0000 0000 0000 0000")
        assert txn.telegram == by_text
        assert txn.drive_reply(H(drive)) == REPLY
        assert txn.reply == bytes([3, 2 * registers]) + text
        value = H(f"126D 0000 0000 1234 {RUNNING}")
        assert card.do(H(pdu)).drive_reply(value) == REPLY
    else:
        assert card.do(H(pdu)).telegram == by_text
        assert answered(card, pdu, drive) == bytes([3, 2 * registers]) + text


# ---------------------------------------------------------------- exceptions


@in_all
@each_row(
    ("pdu", "why", "what"),
    [
        ("07 0000 0001", "function", "an unknown function"),
        ("03 1413", "length", "a request too short"),
        ("10 0419 0002 04 0000 02", "length", "a byte less than counted"),
        ("01 0000 0000", "quantity", "no coils"),
        ("03 1413 000B", "quantity", "11 registers"),
        ("10 0419 0002 02 0000", "quantity", "two registers in two bytes"),
        ("01 0080 0001", "address", "coil 129"),
        ("05 0020 FF00", "address", "a status coil"),
        ("03 1414 0001", "address", "the second register of a parameter"),
        ("06 0003 0001", "address", "a reserved register"),
        ("05 0000 1234", "value", "a single coil neither on nor off"),
        ("06 0002 0000", "value", "a drive time-out of 0"),
        ("10 0001 0002 04 0001 0000", "value", "a drive time-out of 0 in a run"),
    ],
)
def test_an_invalid_request_gets_the_code_of_the_dialect(card: Translator, pdu: str, why: str, what: str):
    before = card.state()
    code = MODEL_DIALECTS[card.dialect].codes[why]
    assert card.do(H(pdu)).reply == refused(code, H(pdu)[0]), what
    assert card.state() == before


@in_all
@each_row("fault", [0, 1, 2, 3, 4, 6, 7, 11, 17, 18, 130, 131, 254, 255])
@each_row("pdu", ["03 1413 0001", "06 1413 0001", "10 1413 0002 04 0000 0001"])
def test_a_drive_fault_is_reported_unchanged_or_as_4(card: Translator, fault: int, pdu: str):
    code = MODEL_DIALECTS[card.dialect].code(fault)
    assert answered(card, pdu, f"7202 0000 0000 00{fault:02x} {RUNNING}") == refused(code, H(pdu)[0])


@in_all
def test_a_double_word_that_does_not_fit_is_a_fault_of_type(card: Translator):
    code = MODEL_DIALECTS[card.dialect].code(5)
    assert answered(card, "03 1413 0001", f"2202 0000 0001 0000 {RUNNING}") == refused(code, 3)
    assert answered(card, "03 1413 0002", f"2202 0000 0001 0000 {RUNNING}") == H("03 04 0001 0000")


@in_all
@each_row("pdu", ["03 1413 0002", "06 1413 0001", "05 0000 FF00", "0F 0000 0001 01 01"])
def test_a_silent_drive_gets_255_or_silence(card: Translator, pdu: str):
    txn = card.do(H(pdu))
    reply = txn.drive_silent()
    code = MODEL_DIALECTS[card.dialect].codes.get("silent")
    assert reply == refused(code, H(pdu)[0]) if code else txn.outcome == SILENT


# ---------------------------------------------------------------- the card's own registers


@in_later
def test_the_index_is_in_register_9_and_the_time_outs_keep_their_registers(card: Translator):
    assert same(reply_to(card, "03 0008 0001"), "03 02 0000")
    assert same(reply_to(card, "03 0001 0002"), "03 04 03E8 000F")
    assert same(reply_to(card, "06 0008 0102"), "06 0008 0102")
    assert same(reply_to(card, "10 0001 0002 04 000A 0014"), "10 0001 0002")
    assert same(reply_to(card, "03 0008 0001"), "03 02 0102")
    assert same(reply_to(card, "03 0001 0002"), "03 04 000A 0014")
    assert same(reply_to(card, "10 0008 0001 02 0003"), "10 0008 0001")
    assert same(reply_to(card, "03 0008 0001"), "03 02 0003")


@in_later
@each_row(
    "pdu",
    [
        "03 0000 0001",
        "06 0000 0400",
        "03 0000 0003",
        "10 0000 0003 06 0001 0002 0003",
        "03 0001 0003",
        "03 0002 0002",
        "03 0007 0002",
        "03 0008 0002",
        "10 0008 0002 04 0001 0001",
        "10 0002 0002 04 0001 0001",
        *(f"03 {register:04x} 0001" for register in range(3, 8)),
        *(f"06 {register:04x} 0001" for register in range(3, 8)),
    ],
)
def test_no_other_register_below_10_exists(card: Translator, pdu: str):
    before = card.state()
    code = MODEL_DIALECTS[card.dialect].codes["address"]
    assert card.do(H(pdu)).reply == refused(code, H(pdu)[0])
    assert card.state() == before


@in_later
@each_row("value", ["0003", "0103", "0403", "0503"])
def test_only_the_index_of_register_9_is_sent(card: Translator, value: str):
    reply_to(card, f"06 0008 {value}")
    assert same(sent_for(card, "03 17C9 0002"), "81 1261 0003 0000 0000 0000 0000")
    assert same(sent_for(card, "06 17C9 0102"), "81 2261 0003 0000 0102 0000 0000")
    assert same(sent_for(card, "03 17C9 0003"), "81 F261 0403 0000 0000 0000 0000")
    assert same(sent_for(card, "10 17C9 0003 06 414243444546"), "81 F261 0503 414243444546 0000 0000")


# ---------------------------------------------------------------- numbers and texts without IND


@in_later
@each_row("registers", range(3, 11))
def test_a_write_of_3_to_10_registers_is_text(card: Translator, registers: int):
    text = "1234567890abcdefghij"[: 2 * registers].encode().hex()
    pdu = f"10 14D1 {registers:04x} {2 * registers:02x} {text}"
    assert same(sent_for(card, pdu), f"81 F215 0500 {text} 0000 0000")
    assert answered(card, pdu, f"F215 0500 {text} {RUNNING}") == H(pdu)[:5]


@in_later
@each_row(
    ("stored", "registers", "data"),
    [
        ("", 3, "20" * 6),
        ("VLT", 3, "564C54202020"),
        ("1234567", 3, "313233343536"),
        ("AB", 10, "4142" + "20" * 18),
    ],
)
def test_text_is_filled_with_spaces_or_cut(card: Translator, stored: str, registers: int, data: str):
    pdu, drive = f"03 1841 {registers:04x}", f"F26D 0400 {stored.encode().hex()} {RUNNING}"
    assert answered(card, pdu, drive) == bytes([3, 2 * registers]) + H(data)


@in_later
@each_row(
    ("pdu", "number", "text", "reply"),
    [
        ("03 14D1 0001", "1215 0003 0000 0000", "F215 0403 0000 0000", "03 02 5859"),
        ("03 14D1 0002", "1215 0003 0000 0000", "F215 0403 0000 0000", "03 04 5859 2020"),
        ("10 14D1 0001 02 4142", "2215 0003 0000 4142", "F215 0503 4142", "10 14D1 0001"),
        ("10 14D1 0002 04 41424344", "3215 0003 4142 4344", "F215 0503 41424344", "10 14D1 0002"),
    ],
)
@each_row("stored", [False, True])
def test_1_or_2_registers_that_the_drive_refuses_with_5_are_tried_as_text(
    card: Translator, pdu: str, number: str, text: str, reply: str, stored: bool
):
    reply_to(card, "06 0008 0003")
    if stored:
        reply_to(card, "05 0040 FF00")
        number = {"2": "E", "3": "D"}.get(number[0], number[0]) + number[1:]
    txn = tried_as_text(card, pdu, f"81 {number} 0000 0000")
    assert txn.telegram == H(f"81 {text} 0000 0000")
    assert status(card) == H("03 0F 00 20"), "the refusal was a good reply"
    assert txn.drive_reply(H(f"F215 {text[5:9]} 5859 0607 1234")) == REPLY
    assert txn.reply == H(reply)
    txn.drive_commit()
    assert status(card) == H("07 06 34 12")


@in_later
@each_row("registers", range(3, 11))
def test_a_text_that_the_drive_refuses_by_type_is_read_as_the_number_and_filled_with_zeros(
    card: Translator, registers: int
):
    reply_to(card, "06 0008 0003")
    txn = card.do(H(f"03 14D1 {registers:04x}"))
    assert txn.telegram == H("81 F215 0403 0000 0000 0000 0000")
    assert txn.drive_reply(H(f"7215 0403 0000 0005 {RUNNING}")) == EXCHANGE
    assert txn.drive_commit().drive_again().telegram == H("81 1215 0003 0000 0000 0000 0000")
    assert txn.drive_reply(H(f"2215 0003 1234 5678 {RUNNING}")) == REPLY
    assert txn.reply == bytes([3, 2 * registers]) + H("1234 5678") + bytes(2 * registers - 4)


@in_later
@each_row("fault", [0, 5, 130])
def test_a_number_that_is_refused_after_the_text_is_not_tried_again(card: Translator, fault: int):
    txn = card.do(H("03 14D1 0003"))
    assert txn.drive_reply(H(f"7215 0400 0000 0005 {RUNNING}")) == EXCHANGE
    txn.drive_commit().drive_again()
    assert txn.drive_reply(H(f"7215 0000 0000 00{fault:02x} {RUNNING}")) == REPLY
    assert txn.reply == refused(MODEL_DIALECTS[card.dialect].code(fault), 3)


@in_later
@each_row("fault", [0, 1, 3, 5, 130])
@each_row("pdu", ["03 14D1 0001", "10 14D1 0002 04 41424344"])
def test_a_fault_on_the_text_is_reported_without_another_try(card: Translator, fault: int, pdu: str):
    number = {"03": "1215 0000 0000 0000", "10": "3215 0000 4142 4344"}[pdu[:2]]
    txn = tried_as_text(card, pdu, f"81 {number} 0000 0000")
    assert txn.drive_reply(H(f"7215 0400 0000 00{fault:02x} {RUNNING}")) == REPLY
    assert txn.reply == refused(MODEL_DIALECTS[card.dialect].code(fault), H(pdu)[0])


@in_later
@each_row(
    ("pdu", "why"),
    [
        ("06 14D1 4142", "06 writes numbers only"),
        ("10 14D1 0003 06 414243444546", "it was a text already"),
    ],
)
def test_fault_5_is_reported_when_no_text_can_be_tried(card: Translator, pdu: str, why: str):
    code = MODEL_DIALECTS[card.dialect].code(5)
    assert answered(card, pdu, f"7215 0000 0000 0005 {RUNNING}") == refused(code, H(pdu)[0]), why


@in_later
def test_a_refusal_whose_bcc_was_wrong_changes_nothing(card: Translator):
    txn = card.do(H("10 14D1 0001 02 4142"))
    before = txn.telegram
    assert txn.drive_reply(H(f"7215 0000 0000 0005 {RUNNING}")) == EXCHANGE
    assert txn.telegram == before
    assert txn.drive_reply(H(f"1215 0000 0000 4142 {RUNNING}")) == REPLY
    assert txn.reply == H("10 14D1 0001")


@in_later
def test_the_reply_to_a_text_must_be_a_text(card: Translator):
    txn = tried_as_text(card, "03 1841 0001", "81 126D 0000 0000 0000 0000 0000")
    for misfit in (f"126D 0000 0000 0001 {RUNNING}", f"F26E 0400 4142 {RUNNING}", RUNNING):
        assert txn.drive_reply(H(misfit)) == NOT_A_REPLY
    assert txn.drive_reply(H(f"F26D 0400 414243 {RUNNING}")) == REPLY
    assert txn.reply == H("03 02 4142")


@in_later
def test_a_broadcast_of_1_or_2_registers_is_a_number_and_of_more_a_text(card: Translator):
    assert same(sent_for(card, "10 14D1 0001 02 4142", broadcast=True), "80 2215 0000 0000 4142 0000 0000")
    assert same(
        sent_for(card, "10 14D1 0002 04 41424344", broadcast=True), "80 3215 0000 4142 4344 0000 0000"
    )
    assert same(
        sent_for(card, "10 14D1 0003 06 414243444546", broadcast=True), "80 F215 0500 414243444546 0000 0000"
    )


# ---------------------------------------------------------------- parameter numbers


@in_all
def test_parameters_end_with_the_bits_of_pnu(card: Translator):
    highest = MODEL_DIALECTS[card.dialect].pnu_max
    (row,) = re.findall(r"^\| parameter numbers \|(.*)\|$", GUIDE.read_text(), re.MULTILINE)
    stated = dict(zip(DIALECTS, row.split("|"), strict=True))
    assert stated[card.dialect].split()[0] == f"1…{highest}"
    starts = [a for a in range(9, 65536) if card.request(H(f"03 {a:04x} 0001")).outcome == EXCHANGE]
    assert starts == [10 * pnu - 1 for pnu in range(1, highest + 1)]


@in_standard
@each_row("pnu", [2047, 2048, 2049, 3039, 4094, 4095])
def test_bit_11_belongs_to_pnu(card: Translator, pnu: int):
    address = f"{10 * pnu - 1:04x}"
    assert same(sent_for(card, f"03 {address} 0001"), f"81 {0x1000 | pnu:04x} 0000 0000 0000 0000 0000")
    assert same(sent_for(card, f"06 {address} 0007"), f"81 {0x2000 | pnu:04x} 0000 0000 0007 0000 0000")
    assert same(sent_for(card, f"03 {address} 0005"), f"81 {0xF000 | pnu:04x} 0400 0000 0000 0000 0000")
    assert answered(card, f"03 {address} 0001", f"{0x1000 | pnu:04x} 0000 0000 002A {RUNNING}") == H(
        "03 02 002A"
    )
    txn = card.do(H(f"03 {address} 0001"))
    assert txn.drive_reply(H(f"{0x1000 | pnu ^ 0x800:04x} 0000 0000 002A {RUNNING}")) == NOT_A_REPLY
    txn = tried_as_text(card, f"03 {address} 0001", f"81 {0x1000 | pnu:04x} 0000 0000 0000 0000 0000")
    assert txn.telegram == H(f"81 {0xF000 | pnu:04x} 0400 0000 0000 0000 0000")


# ---------------------------------------------------------------- the second exchange, on both lines

READ_TEXT, WRITE_TEXT = H("03 1841 0002"), H("10 14D1 0001 02 4142")
ASK_NUMBER, ASK_TEXT = H("81 126D 0000 0000 0000 0000 0000"), H("81 F26D 0400 0000 0000 0000 0000")
NOT_WRITTEN, WRITTEN = H("7215 0000 0000 0005 0F03 2000"), H("F215 0500 4142 0F03 2000")
TELL_AB = H("81 F215 0500 4142 0000 0000")
NO_NUMBER, TELL_TEXT = H(f"726D 0000 0000 0005 {RUNNING}"), H(f"F26D 0400 564C54 {RUNNING}")
REPLY_TEXT = H("01 03 04 564C5420")
READ_INDEX, REPLY_INDEX = H("03 0008 0001"), H("01 03 02 0000")
START, SEND_START = H("05 0006 FF00"), H("81 0040 0000")


@pytest.fixture(
    params=[
        pytest.param(
            Build(dialect, on_card=on_card), marks=pytest.mark.rule("DIALECT"), id=f"{dialect}-{name}"
        )
        for dialect in LATER
        for name, on_card in (("host", False), ("card", True))
    ]
)
def bench(request: pytest.FixtureRequest) -> Bench:
    """The same sources twice: compiled for the host, and as the dialect's image on an RV32I machine."""
    return Bench(request.param)


def refused_number(bench: Bench, pdu: bytes = READ_TEXT) -> None:
    """Sends a request whose number the drive rejects."""
    bench.ask_drive(pdu)
    head = bench.telegrams[-1][1:5]
    bench.drive(bytes([0x70 | head[0] & 0xF]) + head[1:] + H(f"0000 0005 {RUNNING}"))


@pytest.mark.rule("FRAME-7")
def test_a_newer_request_while_the_second_telegram_is_being_queued_drops_it(bench: Bench):
    mailbox = bench.mailbox

    bench.ask_drive(READ_TEXT)
    bench.before_write("TELEGRAM", lambda: (mailbox.character(), mailbox.candidate(READ_INDEX)))
    bench.drive(NO_NUMBER)
    bench.commit()
    assert bench.telegrams == [ASK_NUMBER]
    assert bench.replies == [REPLY_INDEX]
    bench.request(READ_TEXT)
    assert bench.telegrams == [ASK_NUMBER, ASK_NUMBER]


SCENARIOS = """
FC-6: a text is written after the number was refused
    exchange WRITE_TEXT 7215_0000_0000_0005_0F03_2000; answers F215_0500_4142_0F03_2000;
    sent 81_2215_0000_0000_4142_0000_0000 81_F215_0500_4142_0000_0000; replied 01_10_14D1_0001
FC-9: a silent drive gets one repeat and the master no reply
    request START; sent-count 1; silent; sent-count 2; silent; wait 1000; sent SEND_START*2; replied;
    count DRIVE_NO_REPLY 1; local READ_INDEX
FC-6: the text is requested after the number and answers the request
    exchange READ_TEXT NO_NUMBER; sent ASK_NUMBER ASK_TEXT; replied; answers TELL_TEXT;
    replied REPLY_TEXT; wait 500; sent-count 2; local READ_INDEX
PERF-3: the first exchange queues no reply
    ask READ_TEXT; +data NO_NUMBER; poll; not reply_queued; +bcc; sent ASK_NUMBER; poll;
    sent ASK_NUMBER ASK_TEXT; ends; +data TELL_TEXT; poll; is reply_queued; +bcc; replied REPLY_TEXT
FC-8: the second telegram waits for its pause
    ask READ_TEXT; busy; drive NO_NUMBER; sent ASK_NUMBER; wait 3; +free; sent ASK_NUMBER ASK_TEXT
FC-8: a refusal with a wrong bcc starts no second exchange
    exchange-bad READ_TEXT NO_NUMBER; sent ASK_NUMBER; drive 126D_0000_0000_012C_0F03_2000;
    sent ASK_NUMBER; replied 01_03_04_0000_012C
FRAME-7: a newer request ends the older one before its second exchange
    ask READ_TEXT; local READ_INDEX; drive NO_NUMBER; wait 500; sent ASK_NUMBER; replied REPLY_INDEX;
    request START; sent ASK_NUMBER SEND_START
FRAME-7: a newer request for the drive is sent instead of the second exchange
    ask READ_TEXT; request START; drive NO_NUMBER; sent ASK_NUMBER SEND_START; answers RUNNING;
    replied 01_05_0006_FF00
FRAME-7: a newer reading is sent instead of the second exchange
    ask READ_TEXT; request READ_514; drive NO_NUMBER;
    sent-from 1 81_1202_0000_0000_0000_0000_0000; answers 1202_0000_0000_012C_0F03_2000;
    replied 01_03_04_0000_012C
FRAME-7: the second telegram of a write keeps its place, and leaves before a newer reading
    ask WRITE_TEXT; request READ_514; drive NOT_WRITTEN; sent-from 1 TELL_AB; answers WRITTEN;
    sent-from 2 81_1202_0000_0000_0000_0000_0000; answers 1202_0000_0000_012C_0F03_2000;
    replied 01_03_04_0000_012C
FRAME-7, FRAME-6: neither a revoked request nor a local one takes that place
    ask WRITE_TEXT; offer START; character; drive NOT_WRITTEN; local READ_INDEX; sent-from 1 TELL_AB; ends;
    silent; sent-from 1 TELL_AB*2; answers WRITTEN; wait 500; sent-count 3
FRAME-7: a newer image leaves before it
    ask WRITE_TEXT; request START; drive NOT_WRITTEN; sent-from 1 SEND_START; answers RUNNING;
    replied 01_05_0006_FF00; sent-from 2 TELL_AB; answers WRITTEN; wait 500; sent-count 3
MAP-8: a write by 06 has no second telegram, whether it is the newest request or not
    ask 06_14D1_4142; drive NOT_WRITTEN; sent-count 1; ask 06_14D1_4142; local READ_INDEX;
    drive NOT_WRITTEN; wait 500; sent-count 2; local READ_INDEX
FRAME-7: a newer reading is not lost as an older one is refused
    ask READ_TEXT; +data NO_NUMBER; poll; offer READ_514; +bcc; poll; commit;
    sent ASK_NUMBER 81_1202_0000_0000_0000_0000_0000; answers 1202_0000_0000_012C_0F03_2000;
    replied 01_03_04_0000_012C
FRAME-7: a newer write of its kind takes its place
    ask WRITE_TEXT; request 06_040F_003C; drive NOT_WRITTEN; sent-from 1 81_2068_0000_0000_003C_0000_0000;
    answers 1068_0000_0000_003C_0F03_2000; replied 01_06_040F_003C; wait 500; sent-count 2
FRAME-7: a newer write for all leaves behind it
    ask WRITE_TEXT; request-all 06_040F_003C; drive NOT_WRITTEN; sent-from 1 TELL_AB; answers WRITTEN;
    sent-from 2 80_2068_0000_0000_003C_0000_0000; wait 500; sent-count 3
FRAME-7, FRAME-6: a newer request that is revoked ends the older one too
    ask READ_TEXT; offer START; character; drive NO_NUMBER; wait 500; sent ASK_NUMBER; replied;
    local READ_INDEX
FRAME-7, FRAME-6: a newer request that the firmware did not see ends the older one too
    # Good BCC, candidate and revoke fall between two rounds of the poll loop.
    ask READ_TEXT; +data NO_NUMBER; +bcc; +character; +candidate START; +character; poll; wait 500;
    sent ASK_NUMBER; request READ_TEXT; sent ASK_NUMBER ASK_NUMBER
FRAME-7: a newer request during the second exchange waits for it
    exchange READ_TEXT NO_NUMBER; ask START; sent ASK_NUMBER ASK_TEXT; drive TELL_TEXT;
    sent ASK_NUMBER ASK_TEXT SEND_START; answers RUNNING; replied 01_05_0006_FF00
FRAME-7: an exchange whose reply was dropped is still completed
    ask WRITE_TEXT; character; drive 7215_0000_0000_0005_0F03_2000;
    sent-from 1 81_F215_0500_4142_0000_0000; answers F215_0500_4142_0F03_2000; replied
FC-9: the second exchange has a repeat of its own
    ask READ_TEXT; wait 152; answers NO_NUMBER; sent ASK_NUMBER ASK_NUMBER ASK_TEXT; silent;
    sent-from 3 ASK_TEXT; answers TELL_TEXT; replied REPLY_TEXT
FC-9, SAFE-8: an image keeps its repeat although its place held a second telegram
    exchange READ_TEXT NO_NUMBER; request START; local READ_INDEX; answers TELL_TEXT;
    sent ASK_NUMBER ASK_TEXT SEND_START; ends; local 05_0040_FF00; wait 160; sent-from 2 SEND_START*2
FRAME-7, FC-9: a reading that was given up on a busy line sends nothing later
    busy; request 06_040F_003C; request READ_TEXT; wait 400; +free; poll;
    sent 81_2068_0000_0000_003C_0000_0000; answers 1068_0000_0000_003C_0F03_2000; wait 400; sent-count 1;
    replied
FC-9, LED-4: a drive silent in the second exchange gives no reply
    exchange READ_TEXT NO_NUMBER; silent 2; wait 3000; sent ASK_NUMBER ASK_TEXT ASK_TEXT; replied;
    lit DRIVE_RED
"""


@pytest.mark.parametrize("steps", scenarios(SCENARIOS))
def test_scenario(bench: Bench, steps: str):
    play(bench, steps, globals())


# ---------------------------------------------------------------- speed of the dialects' images


@pytest.mark.rule("DIALECT", "PERF-2", "PERF-3")
@pytest.mark.parametrize("dialect", LATER)
def test_the_second_telegram_is_queued_within_its_pause(dialect: str):
    """Two characters of the drive line take 2290 us: 27500 clocks, 5 to 6 per instruction."""
    bench = Bench(Build(dialect, on_card=True))
    bench.ask_drive(READ_TEXT)
    bench.mailbox.drive_data(NO_NUMBER)
    bench.poll()
    bench.mailbox.quiet = False
    bench.mailbox.bcc()
    needed = instructions_until(bench, "telegram_queued")
    print(f"{dialect}, second telegram: {needed} instructions")
    assert needed < 2000


# ---------------------------------------------------------------- diagnostics (MAP-10)

DIAGNOSTIC_REQUESTS = ("08 0000 1234", "08 0002 0000", "08 000B 0000", "0B", "11", "2B 0E 01 00")


def diagnosing(option: str) -> Translator:
    return Translator("DIAGNOSTICS") if option == "card" else Translator(dialect=option)


@pytest.mark.rule("MAP-10")
@pytest.mark.parametrize("option", ["card", STANDARD])
def test_the_version_is_that_of_the_release(option: str):
    card = diagnosing(option)
    identity = b"".join(
        bytes([i, len(text)]) + text for i, text in enumerate([b"rtu2fc", b"card", VERSION.encode()])
    )
    for code in (1, 2, 3):
        assert (
            card.do(bytes([0x2B, 0x0E, code, 0])).reply == bytes([0x2B, 0x0E, code, 0x81, 0, 0, 3]) + identity
        )
    for i, text in enumerate(OBJECTS):
        one = bytes([0x2B, 0x0E, 4, 0x81, 0, 0, 1, i, len(text)]) + text
        assert card.do(bytes([0x2B, 0x0E, 4, i])).reply == one
    text = b"rtu2fc " + VERSION.encode() + b"\xff"
    assert card.do(b"\x11").reply == bytes([0x11, len(text)]) + text


@pytest.mark.rule("MAP-10", "EXC")
@each_row(
    ("pdu", "kind", "what"),
    [
        ("08 0003 0000", "function", "a sub-function between"),
        ("08 000F 0000", "function", "a sub-function above"),
        ("08 0100 0000", "function", "the high byte counts"),
        ("08 0001", "length", "no data"),
        ("08 000B 0000 00", "length", "data too long"),
        ("08 0000 00", "length", "half a word to echo"),
        ("08 0000" + 28 * "00", "length", "more to echo than a reply holds"),
        ("08 0001 0001", "value", "restart with other data"),
        ("08 000A FF00", "value", "clear with other data"),
        ("08 000E 0001", "value", "a count with data"),
        ("0B 00", "length", "event counter with data"),
        ("11 00", "length", "server id with data"),
        ("2B 0D 01 00", "function", "another kind of encapsulation"),
        ("2B 0E 01", "length", "no object"),
        ("2B 0E 01 00 00", "length", "too long"),
        ("2B 0E 00 00", "value", "no such code"),
        ("2B 0E 05 00", "value", "no such code"),
        ("2B 0E 04 03", "address", "no such object"),
    ],
)
@pytest.mark.parametrize("option", ["card", STANDARD])
def test_wrong_diagnostics_get_the_dialects_exceptions(option: str, pdu: str, kind: str, what: str):
    assert diagnosing(option).do(H(pdu)).reply == refused(MODEL_DIALECTS[option].codes[kind], H(pdu)[0]), what


@pytest.mark.rule("MAP-10")
def test_an_echo_returns_up_to_27_bytes():
    for size in range(2, 28, 2):
        pdu = H("08 0000") + bytes(range(size))
        assert diagnosing(STANDARD).do(pdu).reply == pdu


@pytest.mark.rule("MAP-10", "MAP-9")
@each_row("pdu", [*DIAGNOSTIC_REQUESTS, "08 0001 0000", "08 000A 0000"])
def test_diagnostics_to_all_are_ignored(pdu: str):
    assert diagnosing(STANDARD).do(H(pdu), broadcast=True).outcome == SILENT


class DiagnosedBench(Bench):
    def asks(self, pdu: str) -> bytes:
        """A local request's reply, without the unit address."""
        self.local(H(pdu))
        return self.replies[-1][1:]

    def count(self, sub: int) -> int:
        reply = self.asks(f"08 {sub:04X} 0000")
        assert reply[:3] == H(f"08 {sub:04X}")
        return int.from_bytes(reply[3:], "big")

    def events(self) -> int:
        reply = self.asks("0B")
        assert reply[:3] == H("0B 0000")
        return int.from_bytes(reply[3:], "big")

    def happens(self, *names: str) -> None:
        for name in names:
            self.mailbox.event(name)
            self.poll()


@pytest.fixture
def diagnosed() -> DiagnosedBench:
    return DiagnosedBench(Build(STANDARD))


@pytest.fixture
def diagnosed_card() -> DiagnosedBench:
    """Of the dialect that answers for a silent drive (MAP-7)."""
    return DiagnosedBench(Build(option="DIAGNOSTICS"))


@pytest.mark.rule("MAP-10", "FC-9")
def test_an_answer_for_a_silent_drive_is_counted_as_an_exception(diagnosed_card: DiagnosedBench):
    bench = diagnosed_card
    bench.request(H("03 1413 0002"))
    bench.drive_is_silent(times=2)
    assert bench.replies[-1] == H("01 83 FF") and bench.count(13) == 1 and bench.events() == 1


@pytest.mark.rule("MAP-10", "FC-9")
def test_a_command_that_got_255_is_not_counted_as_done_when_it_leaves(diagnosed_card: DiagnosedBench):
    bench = diagnosed_card
    bench.ask_drive(START)
    bench.request(START)
    bench.drive(H(RUNNING))
    bench.drive_answers(H(RUNNING))
    bench.mailbox.quiet = False
    bench.request(START)
    bench.wait(200)
    assert bench.replies[-1] == H("01 85 FF")
    bench.mailbox.pause_over()
    bench.drive_answers(H(RUNNING))
    assert bench.events() == 1 and bench.count(13) == 1


@pytest.mark.rule("MAP-10", "FRAME-7")
@each_row("end", ["silence", "a value", "a refusal"])
def test_a_request_that_was_overtaken_counts_as_no_reply(diagnosed_card: DiagnosedBench, end: str):
    bench = diagnosed_card
    bench.ask_drive(H("03 1413 0002"))
    assert bench.count(13) == 0 and bench.events() == 1
    replies = len(bench.replies)
    if end == "silence":
        bench.drive_is_silent(times=2)
    else:
        bench.drive(
            H("1202 0000 0000 012C 0F03 2000" if end == "a value" else "7202 0000 0000 0002 0F03 2000")
        )
    assert len(bench.replies) == replies
    assert bench.count(13) == 0 and bench.events() == 2, "two counts that were read"


@pytest.mark.rule("MAP-10", "FRAME-3")
def test_a_request_whose_telegram_was_dropped_is_not_counted(diagnosed_card: DiagnosedBench):
    bench = diagnosed_card
    bench.offer(H("03 1413 0002"))
    bench.character()
    bench.wait(20)
    assert bench.events() == 0 and bench.telegrams == []


@pytest.mark.rule("MAP-10", "MAP-8")
def test_a_request_with_two_telegrams_is_counted_once(diagnosed: DiagnosedBench):
    refused_number(diagnosed)
    diagnosed.drive_answers(TELL_TEXT)
    assert diagnosed.replies == [REPLY_TEXT]
    assert diagnosed.events() == 1


@pytest.mark.rule("MAP-10", "FRAME-7")
def test_a_broadcast_is_counted_although_it_leaves_with_a_write_for_this_card(diagnosed: DiagnosedBench):
    bench = diagnosed
    bench.mailbox.quiet = False
    bench.request(START)
    bench.request(START, broadcast=True)
    assert bench.events() == 1, "the master of the first write gave up on its reply"
    bench.mailbox.pause_over()
    bench.drive_answers(H(RUNNING))
    assert bench.telegrams == [SEND_START] and bench.events() == 1


@pytest.mark.rule("MAP-10", "MAP-9")
@each_row("pdu", ["05 000A FF00", "05 0001 0000", "0F 000A 0001 01 01"])
def test_a_broadcast_clears_no_counter(pdu: str):
    """Although its transaction was that of a diagnostic request, whose bytes it still has."""
    bench = DiagnosedBench(Build(STANDARD, on_card=True))
    bench.asks("08 0000 1234")
    bench.ask_drive(H(pdu), broadcast=True)
    bench.wait(10)
    assert bench.count(14) == 3 and bench.events() == 3


@pytest.mark.rule("MAP-10")
def test_the_counters_say_what_was_on_the_line(diagnosed: DiagnosedBench):
    bench = diagnosed
    assert bench.count(14) == 1 and bench.count(11) == 2 and bench.count(13) == 0 and bench.count(12) == 0
    bench.happens(
        "foreign", "foreign", "foreign", "crc", "parity", "parity", "framing", "t15", "overrun", "revoked"
    )
    assert bench.count(12) == 7
    assert bench.count(11) == 3 + 6
    assert bench.count(14) == 7
    assert bench.count(2) == 0b111111
    assert bench.events() == 8
    assert bench.asks("07") == H("87 01") and bench.asks("01 0000 0081") == H("81 03")
    assert bench.count(13) == 2
    assert bench.events() == 9, "neither exceptions nor 0B itself"
    # The drive's answers: a value, a fault, silence.
    bench.exchange(H("03 1413 0002"), H("1202 0000 0000 012C 0F03 2000"))
    assert bench.events() == 10
    bench.exchange(H("06 1413 0002"), H("7202 0000 0000 0002 0F03 2000"))
    assert bench.replies[-1] == H("01 86 04") and bench.events() == 10 and bench.count(13) == 3
    bench.request(H("03 1413 0002"))
    bench.drive_is_silent(times=2)
    assert bench.replies[-1][1:3] != H("83 04") and bench.count(13) == 3, "no reply, no count"
    assert bench.count(2) == 0b0111_1111
    # To all: counted as done, as refused, or not at all.
    before, requests = bench.events(), bench.count(14)
    for pdu in ("05 000A FF00", "06 0008 0001"):
        bench.ask_drive(H(pdu), broadcast=True)
        bench.wait(10)
    bench.request(H("05 0028 FF00"), broadcast=True)
    bench.request(H("01 0000 0001"), broadcast=True)
    bench.request(H("0B"), broadcast=True)
    assert bench.count(14) == requests + 6
    assert bench.events() == before + 4, "two writes, and two counts that were read"
    assert bench.count(13) == 4
    # A revoked request is one error, and counts as nothing else.
    requests = bench.count(14)
    bench.offer(H("01 0000 0001"))
    bench.character()
    bench.happens("revoked")
    assert bench.count(14) == requests + 1 and bench.count(12) == 8


@pytest.mark.rule("MAP-10")
@each_row("clear", ["08 000A 0000", "08 0001 0000", "08 0001 FF00"])
def test_a_restart_or_a_clear_changes_nothing_but_counters(diagnosed: DiagnosedBench, clear: str):
    bench = diagnosed
    bench.asks("06 0008 0003")
    bench.asks("07")
    bench.happens("crc", "foreign", "drive_bad")
    assert bench.asks(clear) == H(clear)
    assert bench.count(14) == 1 and bench.count(11) == 2 and bench.events() == 2
    assert bench.count(12) == bench.count(13) == bench.count(2) == 0
    assert bench.asks("03 0008 0001") == H("03 02 0003")
    bench.offer(H(clear))
    bench.character()
    assert bench.count(14) == 8, "a revoked one clears nothing"
    assert bench.asks("08 000A 0001")[0] == 0x88 and bench.count(14) == 10, "nor does a refused one"


@pytest.mark.rule("MAP-10", "WDG-1")
def test_restarts_are_counted_until_the_reset(diagnosed: DiagnosedBench):
    bench = diagnosed
    for restarts in range(258):
        assert bench.count(2) == min(restarts, 255) << 8
        bench.restart()
    bench.happens("crc")
    assert bench.count(2) == 0xFF01
    bench.asks("08 000A 0000")
    assert bench.count(2) == 0xFF00, "a clear is for the faults"


@pytest.mark.rule("MAP-10")
def test_counts_run_over_to_0(diagnosed: DiagnosedBench):
    bench = diagnosed
    for _ in range(0xFFFF):
        bench.mailbox.event("crc")
        bench.gateway.poll()
    assert bench.count(12) == 0xFFFF
    bench.happens("crc", "crc")
    assert bench.count(12) == 1


# By dialect: requests, the drive's telegrams, and the exchange that must still work in the end.
BY_NUMBER = (
    [READ_514, READ_IND, H("05 000A FF00"), H("06 040F 003C"), H("07"), H("10 00")],
    [TELL_514, H(RUNNING)],
    ("ask READ_514; drive TELL_514", [ASK_514], REPLY_514),
)
BY_SIZE = (
    [READ_TEXT, READ_TEXT, READ_INDEX, H("05 000A FF00"), WRITE_TEXT, H("07")],
    [NO_NUMBER, NO_NUMBER, TELL_TEXT, H(RUNNING)],
    ("exchange READ_TEXT NO_NUMBER; answers TELL_TEXT", [ASK_NUMBER, ASK_TEXT], REPLY_TEXT),
)


@pytest.mark.rule("SAFE-3", "SAFE-1", "FRAME-6", "FRAME-7", "DIALECT")
@pytest.mark.parametrize("dialect", DIALECTS)
def test_after_any_sequence_of_events_the_next_request_is_answered(dialect: str):
    rng = seeded(f"gateway events, {dialect}")
    requests, told, (last, asked, reply) = BY_SIZE if dialect in LATER else BY_NUMBER
    second = 0
    for _ in range(150):
        bench = Bench(Build(dialect))
        mailbox = bench.mailbox
        committed: list[bytes] = []
        for _ in range(rng.randrange(200)):
            # Requests are rare and exchanges usually continue, so that some reach the second telegram.
            event = rng.choice("rccctttddddbbbbwqx")
            if event == "r" and not mailbox.is_candidate:
                pdu = rng.choice(requests)
                mailbox.candidate(pdu, broadcast=rng.random() < 0.15)
            elif event == "c" and mailbox.is_candidate:
                mailbox.commit()
                committed.append(pdu)
            elif event == "t":
                mailbox.telegram_ends()
            elif event == "d":
                mailbox.drive_data(rng.choice([*told, rng.randbytes(rng.randint(4, 40))]))
            elif event == "b":
                mailbox.bcc(rng.random() < 0.8)
            elif event == "w":
                bench.wait(rng.choice([1, 10, 150 + OVERDUE_MS]))
            elif event == "q":
                mailbox.quiet = rng.random() < 0.7
            elif event == "x" and rng.random() < 0.3:
                mailbox.character()
            if rng.random() < 0.7:
                bench.gateway.poll()
        assert not (H("81 0400 0000") in bench.telegrams and H("05 000A FF00") not in committed)
        second += bench.telegrams.count(ASK_TEXT)
        # Let both lines become idle.
        mailbox.character()
        for _ in range(6):
            mailbox.pause_over()
            mailbox.telegram_ends()
            mailbox.bcc(good=False)
            bench.wait(155)
        replies, telegrams = len(bench.replies), len(bench.telegrams)
        play(bench, last, globals())
        assert bench.telegrams[telegrams:] == asked and bench.replies[replies:] == [reply]
    print(f"{second} second exchanges")
    assert second > 5 or dialect not in LATER, "too few second exchanges to mean anything"
