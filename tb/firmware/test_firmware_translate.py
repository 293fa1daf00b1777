# SPDX-License-Identifier: Apache-2.0
"""The translation core of the firmware: PDU in, PDU or telegram out. Bytes are hex, by hand."""

from __future__ import annotations

import ctypes
import random
from collections.abc import Iterator
from functools import partial

import pytest

from regs.dialects import DIALECTS, OPTIONS
from tb.lib.rows import each_row
from tb.lib.seeds import seeded
from tb.model.card import DIALECTS as MODEL_DIALECTS
from tb.model.card import CardModel, Step, without_counts
from tb.model.examples import EXAMPLES
from tb.model.firmware import EXCHANGE, JUNK, NOT_A_REPLY, REPLY, SILENT, Transaction, Translator

H = bytes.fromhex
RUNNING = "0F03 2000"  # status word and output frequency of a healthy drive


@pytest.fixture
def card(request: pytest.FixtureRequest) -> Translator:
    return Translator(dialect=getattr(request, "param", "card"))


# Tests of common behaviour run in every dialect, because each dialect is a build of its own.
in_every_dialect = pytest.mark.parametrize("card", DIALECTS, indirect=True)


def refused(code: int, function: int) -> bytes:
    return bytes([function | 0x80, code])


def status(card: Translator) -> bytes:
    """Coils 33-64, as 01 reads them."""
    return card.state()[-4:]


def reply_to(card: Translator, pdu: str) -> str:
    """Sends a local request; returns the reply."""
    txn = card.do(H(pdu))
    assert txn.outcome == REPLY
    return txn.reply.hex()


def sent_for(card: Translator, pdu: str, broadcast: bool = False) -> str:
    """Sends a request for the drive; returns ADR and data of the telegram."""
    txn = card.do(H(pdu), broadcast=broadcast)
    assert txn.outcome == EXCHANGE
    return txn.telegram.hex()


def answered(card: Translator, pdu: str, drive: str) -> bytes:
    """Sends a request that the drive answers with good telegram data; returns the reply."""
    txn = card.do(H(pdu))
    assert txn.outcome == EXCHANGE
    assert txn.drive_reply(H(drive)) == REPLY
    return txn.drive_commit().reply


def same(left: str, right: str) -> bool:
    return H(left) == H(right)


@in_every_dialect
@pytest.mark.rule("MAP-5")
def test_a_read_of_local_registers_writes_no_byte_after_its_reply(card: Translator):
    txn, length = card.do(H("03 0001 0001")), ctypes.c_uint32()
    start = card.lib.host_reply(txn.memory, ctypes.byref(length))
    assert length.value == 4
    assert ctypes.string_at(start, 8)[length.value :] == bytes([JUNK] * 4)


# ---------------------------------------------------------------- the manuals' examples


def play(card: Translator, example: dict) -> None:
    """Plays one example after those it depends on; checks every byte that the core decides."""
    if "after" in example:
        play(card, EXAMPLES[example["after"]])
    for step in example.get("setup", []):
        play(card, step)
    request = H(example["request"])
    txn = card.do(request[1:-2], broadcast=request[0] == 0)
    for exchange in example["drive"]:
        telegram = H(exchange["telegram"])
        assert txn.outcome == EXCHANGE
        assert txn.telegram == telegram[2:-1]
        if exchange["reply"]:
            answer = H(exchange["reply"])
            assert txn.drive_reply(answer[3:-1], answer[1]) == REPLY
            txn.drive_commit()
    if example["drive"] and example["reply"] and not example["drive"][-1]["reply"]:
        txn.drive_silent()
    if example["reply"]:
        assert txn.reply == H(example["reply"])[1:-2]
    else:
        assert txn.outcome in (SILENT, EXCHANGE)


@pytest.mark.rule("FC-3", "FC-4", "FC-5", "MAP-3", "MAP-7", "MAP-8")
@each_row("name", EXAMPLES)
def test_example_of_the_manuals(card: Translator, name: str):
    play(card, EXAMPLES[name])


# ---------------------------------------------------------------- exceptions and their order


@in_every_dialect
@pytest.mark.rule("EXC")
@each_row("function", [0x80, 0x83, 0x90, 0xFF])
def test_the_echo_of_an_exception_is_no_request(card: Translator, function: int):
    """At the length of an exception and at others."""
    for more in (b"", b"\x02", H("0000 0001")):
        assert card.do(bytes([function]) + more).outcome == SILENT


@pytest.mark.rule("EXC")
@each_row("function", [f for f in range(0x80) if f not in (1, 3, 5, 6, 0x0F, 0x10)])
def test_unknown_function_gets_67_at_any_length(card: Translator, function: int):
    assert card.do(bytes([function])).reply == refused(67, function)
    assert card.do(bytes([function]) + H("0000 0001")).reply == refused(67, function)


@pytest.mark.rule("EXC")
@each_row("function", [1, 3, 5, 6])
@each_row("length", [1, 2, 4, 6, 31, 253])
def test_wrong_length_of_a_plain_request_gets_65(card: Translator, function: int, length: int):
    pdu = (bytes([function]) + H("0000 0001")).ljust(length, b"\0")[:length]
    assert card.do(pdu).reply == refused(65, function)


@pytest.mark.rule("EXC", "MAP-1", "MAP-2", "MAP-5", "MAP-6")
@each_row(
    ("pdu", "code", "what"),
    [
        ("0F", 65, "nothing but the function"),
        ("0F 0000 0010", 65, "no byte count"),
        ("0F 0000 0010 02 FF", 65, "a byte less than counted"),
        ("0F 0000 0010 02 FF FF FF", 65, "a byte more than counted"),
        ("10 0001 0002 04 00 0A 01", 65, "half a register missing"),
        ("10 0001 0002 04 00 0A 01 02 00", 65, "a byte too many"),
        ("10 0001 0002 00", 66, "counts no bytes and has none: the length is right, the count is not"),
        ("01 0000 0000", 66, "no coils"),
        ("01 0000 0081", 66, "129 coils"),
        ("01 0000 0100", 66, "256 coils: the high byte counts"),
        ("03 1413 0000", 66, "no registers"),
        ("03 1413 0003", 66, "three registers of a number"),
        ("03 1413 0102", 66, "258 registers: the high byte counts"),
        ("03 0000 0004", 66, "four of the card's own registers"),
        ("03 0000 8001", 66, "bit 15 counts"),
        ("0F 0000 0000 00", 66, "no coils to write"),
        ("0F 0000 0021 05 00 00 00 00 00", 66, "33 coils"),
        ("0F 0000 0010 01 FF", 66, "16 coils in one byte"),
        ("10 1413 0000 00", 66, "no registers to write"),
        ("10 1413 0003 06 00 00 00 00 00 00", 66, "three registers of a number"),
        ("10 0000 0004 08 0000 0000 0001 0000", 66, "four of the card's own registers"),
        ("10 1413 0001 04 00 00 00 00", 66, "one register in four bytes"),
        ("01 0080 0001", 64, "coil 129"),
        ("01 0079 0008", 64, "runs out of the 128 coils"),
        ("01 FFFF 0001", 64, "the last address"),
        ("05 0020 FF00", 64, "a status coil"),
        ("05 0041 FF00", 64, "coil 66"),
        ("0F 001F 0002 01 03", 64, "runs out of coils 1-32"),
        ("0F 0001 0020 04 00 00 00 00", 64, "32 coils from coil 2"),
        ("0F 003F 0002 01 03", 64, "runs into coil 65"),
        ("0F 0040 0002 01 03", 64, "runs out of coil 65"),
        ("03 0003 0001", 64, "reserved register 40004"),
        ("03 0008 0001", 64, "reserved register 40009"),
        ("03 0002 0002", 64, "runs out of 40001-40003"),
        ("10 0002 0002 04 0001 0001", 64, "runs out of 40001-40003"),
        ("03 1414 0001", 64, "the second register of parameter 514"),
        ("03 1412 0001", 64, "one before parameter 514"),
        ("03 4FFF 0001", 64, "parameter 2048"),
        ("03 FFFF 0001", 64, "the last address"),
        ("10 1414 0002 04 0000 0001", 64, "not aligned"),
        ("07 0000 0001 00", 67, "function before length"),
        ("01 0080 0000 00", 65, "length before quantity and address"),
        ("0F 0080 0000 03 00", 65, "length before byte count, quantity and address"),
        ("10 0003 0000 02 00", 65, "length before quantity and address"),
        ("05 0080 1234 00", 65, "length before address and value"),
        ("01 0080 0000", 66, "quantity before address"),
        ("03 0003 0003", 66, "quantity before address"),
        ("0F 0020 0010 01 FF", 66, "byte count before address"),
        ("10 0003 0001 04 0000 0000", 66, "byte count before address"),
        ("05 0020 1234", 64, "address before value"),
        ("10 0002 0002 04 0000 0000", 64, "address before value"),
    ],
)
def test_an_invalid_request_gets_the_code_of_its_first_error(
    card: Translator, pdu: str, code: int, what: str
):
    """In the order of EXC: function 67, length 65, quantity 66, address 64."""
    before = card.state()
    assert card.do(H(pdu)).reply == refused(code, H(pdu)[0]), what
    assert card.state() == before


@pytest.mark.rule("EXC", "FRAME-5")
def test_request_longer_than_the_memory_kept_gets_its_exception(card: Translator):
    # 123 registers, 246 bytes of data: the byte count is right, so the quantity is wrong.
    pdu = H("10 1413 007B F6") + bytes(246)
    assert len(pdu) == 252
    assert card.do(pdu).reply == refused(66, 0x10)
    assert card.do(pdu[:-1]).reply == refused(65, 0x10)
    # 32 bytes of ADU are kept: 10 registers of text are complete, one byte more is not.
    assert card.request(H("10 1413 000A 14") + bytes(20), length=27).reply == refused(65, 0x10)


@pytest.mark.rule("EXC", "MAP-8")
@each_row(
    ("ind", "pdu", "code", "what"),
    [
        ("0400", "03 1842 000A 00", 65, "length before address"),
        ("0400", "03 1842 000B", 66, "quantity before address"),
        ("0400", "03 1841 000B", 66, "eleven registers"),
        ("0400", "10 14D1 0003 06 313233343536", 66, "0400 is no text write"),
        ("0500", "03 1841 0003", 66, "0500 is no text read"),
        ("0500", "10 14D2 000B 16" + "31" * 22, 66, "quantity before address"),
        ("0500", "10 14D2 000A 13" + "31" * 19, 66, "byte count before address"),
        ("0400", "03 1842 000A", 64, "the largest text, not aligned"),
        ("0500", "10 14D2 000A 14" + "31" * 20, 64, "the largest text, not aligned"),
    ],
)
def test_only_the_first_error_of_a_text_is_reported(
    card: Translator, ind: str, pdu: str, code: int, what: str
):
    reply_to(card, f"06 0000 {ind}")
    assert card.do(H(pdu)).reply == refused(code, H(pdu)[0]), what


@pytest.mark.rule("EXC")
@each_row("value", ["FF01", "0001", "00FF", "FFFF", "0100", "FE00"])
def test_single_coil_takes_0000_and_ff00_only(card: Translator, value: str):
    for coil in ("0000", "0040"):
        assert same(reply_to(card, f"05 {coil} {value}"), "85 02")
    assert same(reply_to(card, "01 0000 0020"), "01 04 00 00 00 00")


# ---------------------------------------------------------------- coils


@pytest.mark.rule("MAP-1", "MAP-4")
def test_all_coils_read_0_at_power_up(card: Translator):
    assert same(reply_to(card, "01 0000 0080"), "01 10" + "00" * 16)


def write_pattern(card: Translator) -> None:
    """CTW 047C, REF 1999, STW 0F03, MAV 2000, coil 65 on."""
    answered(card, "0F 0000 0020 04 7C 04 99 19", RUNNING)
    reply_to(card, "05 0040 FF00")


@pytest.mark.rule("MAP-1", "FC-6")
@each_row(
    ("address", "quantity", "data"),
    [
        ("0000", "0080", "7C 04 99 19 03 0F 00 20 01 00 00 00 00 00 00 00"),
        ("0020", "0020", "03 0F 00 20"),
        ("0002", "0001", "01"),
        ("0004", "000A", "47 00"),  # 0000_0100_0111 of 047C, six bits of the second byte cut
        ("000A", "000B", "41 06"),  # from bit 10: CTW 000001, REF 11001
        ("001D", "000B", "18 00"),  # over the end of the control words: REF 000, STW 00000011
        ("003D", "0008", "09"),  # MAV 001, coil 65, reserved
        ("0040", "0040", "01 00 00 00 00 00 00 00"),
        ("007F", "0001", "00"),
    ],
)
def test_any_run_of_coils_reads_from_the_image(card: Translator, address: str, quantity: str, data: str):
    write_pattern(card)
    before = card.state()
    assert same(reply_to(card, f"01 {address} {quantity}"), f"01 {len(H(data)):02x} {data}")
    assert card.state() == before


@in_every_dialect
@pytest.mark.rule("MAP-2", "MAP-3", "FC-5")
@each_row(
    ("pdu", "process"),
    [
        ("05 0000 FF00", "047D 1999"),
        ("05 0002 0000", "0478 1999"),
        ("05 001F FF00", "047C 9999"),
        ("05 0010 0000", "047C 1998"),
        ("0F 0000 000A 02 FF 03", "07FF 1999"),
        ("0F 0000 000A 02 FF FF", "07FF 1999"),  # bits beyond the quantity are ignored
        ("0F 000C 0008 01 A5", "547C 199A"),
        ("0F 0010 0010 02 00 40", "047C 4000"),
        ("0F 001F 0001 01 FF", "047C 9999"),
        ("0F 0000 0020 04 00 00 00 00", "0000 0000"),
    ],
)
def test_coil_write_merges_and_sends_the_whole_process_block(card: Translator, pdu: str, process: str):
    write_pattern(card)
    assert same(sent_for(card, pdu), f"81 {process}")
    control = H(process)
    coils = bytes([control[1], control[0], control[3], control[2]])
    assert reply_to(card, "01 0000 0020") == (b"\x01\x04" + coils).hex()


@in_every_dialect
@pytest.mark.rule("MAP-2")
@each_row(("on", "off"), [("05 0040 FF00", "05 0040 0000"), ("0F 0040 0001 01 FF", "0F 0040 0001 01 FE")])
def test_coil_65_is_written_locally_without_a_telegram(card: Translator, on: str, off: str):
    assert card.do(H(on)).reply == H(on)[:5]
    assert same(reply_to(card, "01 0040 0001"), "01 01 01")
    assert card.do(H(off)).reply == H(off)[:5]
    assert same(reply_to(card, "01 0040 0001"), "01 01 00")


# ---------------------------------------------------------------- the card's own registers


@pytest.mark.rule("MAP-5")
@each_row(
    ("pdu", "after"),
    [
        ("06 0000 0507", "0507 03E8 000F"),
        ("06 0001 0000", "0000 0000 000F"),
        ("06 0002 FFFF", "0000 03E8 FFFF"),
        ("10 0000 0001 02 0102", "0102 03E8 000F"),
        ("10 0001 0002 04 000A 0102", "0000 000A 0102"),
        ("10 0000 0003 06 0001 0002 0003", "0001 0002 0003"),
    ],
)
def test_local_registers_are_written_one_or_several_at_once(card: Translator, pdu: str, after: str):
    assert card.do(H(pdu)).reply == H(pdu)[:5]
    assert same(reply_to(card, "03 0000 0003"), f"03 06 {after}")
    assert same(reply_to(card, "03 0001 0001"), f"03 02 {after.split()[1]}")


@pytest.mark.rule("MAP-5", "EXC")
@each_row("pdu", ["06 0002 0000", "10 0002 0001 02 0000", "10 0000 0003 06 0001 0002 0000"])
def test_drive_timeout_0_is_refused_and_nothing_of_the_request_is_written(card: Translator, pdu: str):
    assert card.do(H(pdu)).reply == refused(2, H(pdu)[0])
    assert same(reply_to(card, "03 0000 0003"), "03 06 0000 03E8 000F")


# ---------------------------------------------------------------- parameters by number


@pytest.mark.rule("MAP-6", "FC-3", "FC-4", "FC-5")
@each_row("pnu", [1, 2, 9, 10, 11, 99, 104, 514, 999, 1023, 1024, 1638, 2046, 2047])
def test_every_parameter_starts_at_ten_times_its_number(card: Translator, pnu: int):
    address = (10 * pnu - 1).to_bytes(2, "big").hex()
    assert same(sent_for(card, f"03 {address} 0001"), f"81 {0x1000 | pnu:04x} 0000 0000 0000 0000 0000")


@in_every_dialect
@pytest.mark.rule("MAP-7", "FC-4")
@each_row(
    ("pdu", "ram", "eeprom"),
    [
        ("06 040F 003C", "2068", "E068"),
        ("10 040F 0001 02 003C", "2068", "E068"),
        ("10 040F 0002 04 1234 003C", "3068", "D068"),
    ],
)
def test_coil_65_chooses_ram_or_eeprom(card: Translator, pdu: str, ram: str, eeprom: str):
    value = "1234 003C" if "1234" in pdu else "0000 003C"
    assert same(sent_for(card, pdu), f"81 {ram} 0000 {value} 0000 0000")
    reply_to(card, "05 0040 FF00")
    assert same(sent_for(card, pdu), f"81 {eeprom} 0000 {value} 0000 0000")


@in_every_dialect
@pytest.mark.rule("MAP-7", "FC-4")
@each_row("ak", ["1", "2"])
@each_row("pdu", ["06 040F FFC4", "10 040F 0001 02 FFC4", "10 040F 0002 04 FFFF FFC4"])
def test_a_parameter_write_is_confirmed_by_its_head(card: Translator, ak: str, pdu: str):
    assert answered(card, pdu, f"{ak}068 0000 FFFF FFC4 {RUNNING}") == H(pdu)[:5]


@in_every_dialect
@pytest.mark.rule("MAP-7")
@each_row(
    ("pwe", "one", "two"),
    [
        ("0000 012C", "012C", "0000 012C"),
        ("0000 FFFF", "FFFF", "0000 FFFF"),  # 65535 fits unsigned
        ("FFFF FFFF", "FFFF", "FFFF FFFF"),  # -1 fits signed
        ("FFFF 8000", "8000", "FFFF 8000"),  # -32768 fits
        ("FFFF 7FFF", None, "FFFF 7FFF"),  # -32769 does not
        ("0001 0000", None, "0001 0000"),  # 65536 does not
        ("8000 0000", None, "8000 0000"),
        ("0001 FFFF", None, "0001 FFFF"),
    ],
)
@each_row("ak", ["1", "2"])
def test_one_register_never_shows_a_cut_double_word(
    card: Translator, ak: str, pwe: str, one: str | None, two: str
):
    drive = f"{ak}202 0000 {pwe} {RUNNING}"
    wrong_type = f"83 {MODEL_DIALECTS[card.dialect].code(5):02x}"
    assert answered(card, "03 1413 0001", drive) == H(f"03 02 {one}" if one else wrong_type)
    assert answered(card, "03 1413 0002", drive) == H(f"03 04 {two}")


# ---------------------------------------------------------------- IND and text


@pytest.mark.rule("MAP-8")
@each_row(
    ("pdu", "telegram", "inds"),
    [
        ("03 17C9 0001", "1261 0007 0000 0000", "0007 0107 0507 FF07"),
        ("06 17C9 0102", "2261 0007 0000 0102", "0007 0407 0507 FF07"),
        ("10 17C9 0002 04 0001 0002", "3261 0007 0001 0002", "0007 0407 FF07"),
    ],
)
def test_the_index_is_sent_with_every_number(card: Translator, pdu: str, telegram: str, inds: str):
    """06 writes a number even in text mode."""
    for ind in inds.split():
        reply_to(card, f"06 0000 {ind}")
        assert same(sent_for(card, pdu), f"81 {telegram} 0000 0000"), ind


@pytest.mark.rule("MAP-7", "MAP-8")
def test_ind_and_coil_65_stay_as_written(card: Translator):
    """Whatever request comes between, until the master writes them again."""
    reply_to(card, "05 0040 FF00")
    for ind, pdu, telegram in (
        ("0503", "10 14D1 0001 02 4142", "F215 0503 4142"),
        ("0403", "03 1841 0004", "F26D 0403 0000 0000"),
        ("0003", "06 040F 003C", "E068 0003 0000 003C"),
        ("0003", "10 040F 0002 04 0001 003C", "D068 0003 0001 003C"),
    ):
        reply_to(card, f"06 0000 {ind}")
        for _ in range(2):
            txn = card.do(H(pdu))
            assert txn.telegram == H(f"81 {telegram} 0000 0000")
            txn.drive_silent()
            assert card.do(H("05 0006 FF00")).outcome == EXCHANGE
            assert same(reply_to(card, "03 0000 0001"), f"03 02 {ind}")
            assert same(reply_to(card, "01 0040 0001"), "01 01 01")


@pytest.mark.rule("MAP-8", "FC-7")
@each_row(
    ("stored", "registers", "data"),
    [
        ("", 1, "2020"),
        ("VLT600", 1, "564C"),
        ("VLT600", 3, "564C54363030"),
        ("VLT600", 4, "564C543630302020"),
        ("VLT6000", 4, "564C543630303020"),
        ("1234567890123456", 1, "3132"),
        ("1234567890123456789", 1, "3132"),
        ("12345678901234567890", 10, "3132333435363738393031323334353637383930"),
        ("12345678901234567890", 9, "313233343536373839303132333435363738"),
        ("ABCDEFGHIJKLMNOPQRSTUVWXYZ", 10, "4142434445464748494A4B4C4D4E4F5051525354"),
        ("A" * 245, 2, "41414141"),
        ("WXYZ", 10, "5758595A" + "20" * 16),
    ],
)
def test_text_is_filled_with_spaces_or_cut(card: Translator, stored: str, registers: int, data: str):
    reply_to(card, "06 0000 0400")
    drive = f"F26D 0400 {stored.encode().hex()} 0607 1234"
    pdu = f"03 1841 {registers:04x}"
    assert answered(card, pdu, drive) == bytes([3, 2 * registers]) + H(data)
    # PCD follows the text, at any length.
    assert same(reply_to(card, "01 0020 0020"), "01 04 07 06 34 12")


@pytest.mark.rule("MAP-8", "FC-7")
@each_row("registers", range(1, 11))
def test_text_of_every_length_is_written(card: Translator, registers: int):
    text = "1234567890abcdefghij"[: 2 * registers].encode().hex()
    reply_to(card, "06 0000 0500")
    txn = card.do(H(f"10 14D1 {registers:04x} {2 * registers:02x} {text}"))
    assert txn.telegram == H(f"81 F215 0500 {text} 0000 0000")
    for reply in (f"F215 0500 {text} {RUNNING}", f"F215 0500 {RUNNING}"):
        assert txn.drive_reply(H(reply)) == REPLY
        assert txn.reply == H(f"10 14D1 {registers:04x}")


@pytest.mark.rule("MAP-8", "EXC", "FC-4")
def test_a_refused_text_is_answered_by_a_parameter_telegram(card: Translator):
    reply_to(card, "06 0000 0400")
    assert answered(card, "03 1841 0004", f"726D 0400 0000 0005 {RUNNING}") == H("83 05")
    reply_to(card, "06 0000 0500")
    assert answered(card, "10 14D1 0002 04 31323334", f"7215 0500 0000 0001 {RUNNING}") == H("90 01")


# ---------------------------------------------------------------- fitting and misfitting replies


NUMBER, TEXT, PROCESS = "03 1413 0002", "03 1841 0004", "05 0000 FF00"


@in_every_dialect
@pytest.mark.rule("FC-8")
@each_row(
    ("pdu", "drive", "what"),
    [
        (NUMBER, "0F03 2000", "a process telegram"),
        (NUMBER, f"1203 0000 0000 0001 {RUNNING}", "another parameter"),
        (NUMBER, f"1A02 0000 0000 0001 {RUNNING}", "PNU with bit 11"),
        (NUMBER, f"0202 0000 0000 0001 {RUNNING}", "AK 0"),
        (NUMBER, f"3202 0000 0000 0001 {RUNNING}", "AK 3"),
        (NUMBER, f"F202 0400 4142 4344 {RUNNING}", "text instead of a number"),
        (NUMBER, f"1202 0000 0001 {RUNNING}", "a word too short"),
        (NUMBER, f"1202 0000 0000 0001 0000 {RUNNING}", "a word too long"),
        (NUMBER, f"7202 0000 0001 {RUNNING}", "a refusal too short"),
        (NUMBER, f"7203 0000 0000 0001 {RUNNING}", "a refusal of another parameter"),
        (TEXT, f"126D 0400 0000 0001 {RUNNING}", "a number instead of text"),
        (TEXT, f"F26E 0400 4142 {RUNNING}", "text of another parameter"),
        (TEXT, f"726D 0400 4142 {RUNNING}", "a refusal of the wrong length"),
        (TEXT, "F26D 0F03 2000 00", "shorter than an empty text"),
        (TEXT, "0F03 2000", "a process telegram"),
        (PROCESS, f"0000 0000 0000 0000 {RUNNING}", "a parameter telegram"),
        (PROCESS, "0F03 2000 00", "a byte too long"),
    ],
)
def test_a_telegram_that_does_not_fit_is_no_reply(card: Translator, pdu: str, drive: str, what: str):
    if pdu == TEXT and not DIALECTS[card.dialect].traits["text_by_size"]:
        reply_to(card, "06 0000 0400")
    txn = card.do(H(pdu))
    before = card.state()
    assert txn.drive_reply(H(drive)) == NOT_A_REPLY, what
    assert card.state() == before
    # The fitting telegram is still accepted.
    right = {
        NUMBER: (f"1202 0000 0000 0001 {RUNNING}", "03 04 0000 0001"),
        TEXT: (f"F26D 0400 414243 {RUNNING}", "03 08 4142432020202020"),
        PROCESS: (RUNNING, PROCESS),
    }[pdu]
    assert txn.drive_reply(H(right[0])) == REPLY
    assert txn.reply == H(right[1])


@pytest.mark.rule("FC-6")
@each_row(
    ("setup", "pdu", "drive"),
    [
        ("06 0000 0000", "05 0000 FF00", "8421 C0DE"),
        ("06 0000 0000", "03 1413 0002", "1202 0000 0000 0001 8421 C0DE"),
        ("06 0000 0000", "06 040F 003C", "7068 0000 0000 0011 8421 C0DE"),
        ("06 0000 0400", "03 1841 0004", "F26D 0400 414243 8421 C0DE"),
    ],
)
def test_every_good_reply_updates_the_status_coils(card: Translator, setup: str, pdu: str, drive: str):
    reply_to(card, setup)
    txn = card.do(H(pdu))
    txn.drive_reply(H(drive))
    assert same(reply_to(card, "01 0020 0020"), "01 04 00 00 00 00"), "not before the BCC was good"
    txn.drive_commit()
    assert same(reply_to(card, "01 0020 0020"), "01 04 21 84 DE C0")


# ---------------------------------------------------------------- prepare early, commit late


@in_every_dialect
@pytest.mark.rule("FRAME-6")
@each_row(
    "pdu",
    [
        "05 0000 FF00",
        "0F 0000 0020 04 FF FF FF FF",
        "05 0040 FF00",
        "06 0001 0400",
        "10 0001 0002 04 0001 0002",
    ],
)
def test_a_request_changes_nothing_until_it_commits(card: Translator, pdu: str):
    before = card.state()
    txn = card.request(H(pdu))
    assert card.state() == before
    txn.commit()
    assert card.state() != before


# ---------------------------------------------------------------- broadcast


@in_every_dialect
@pytest.mark.rule("MAP-9", "FC-2")
@each_row(
    ("pdu", "telegram"),
    [
        ("0F 0000 0020 04 7C 04 99 19", "80 047C 1999"),
        ("05 000A FF00", "80 0400 0000"),
        ("06 040F 003C", "80 2068 0000 0000 003C 0000 0000"),
        ("10 040F 0002 04 0001 003C", "80 3068 0000 0001 003C 0000 0000"),
    ],
)
def test_a_broadcast_write_goes_to_all_drives(card: Translator, pdu: str, telegram: str):
    assert same(sent_for(card, pdu, broadcast=True), telegram)


@pytest.mark.rule("MAP-9", "MAP-8")
def test_a_broadcast_text_goes_to_all_drives(card: Translator):
    assert card.do(H("06 0000 0500"), broadcast=True).outcome == SILENT
    assert same(sent_for(card, "10 14D1 0001 02 4142", broadcast=True), "80 F215 0500 4142 0000 0000")


@pytest.mark.rule("MAP-9", "MAP-5")
@each_row("pdu", ["06 0000 0102", "10 0000 0002 04 0102 03E8"])
def test_a_broadcast_write_to_local_registers_gets_no_reply(card: Translator, pdu: str):
    assert card.do(H(pdu), broadcast=True).outcome == SILENT
    assert same(reply_to(card, "03 0000 0003"), "03 06 0102 03E8 000F")
    assert card.do(H("05 0040 FF00"), broadcast=True).outcome == SILENT
    assert same(reply_to(card, "01 0040 0001"), "01 01 01")


@in_every_dialect
@pytest.mark.rule("MAP-9", "EXC")
@each_row(
    "pdu",
    [
        "01 0000 0010",
        "01 0000 0000",
        "03 1413 0002",
        "03 0000 0003",
        "07",
        "05 0000 FF00 00",
        "05 0000 1234",
        "05 0020 FF00",
        "0F 0000 0021 05 FF FF FF FF FF",
        "06 0003 0001",
        "06 0002 0000",
        "10 0000 0003 06 0102 0304 0000",
    ],
)
def test_a_broadcast_read_or_invalid_request_has_no_effect_and_no_reply(card: Translator, pdu: str):
    before = card.state()
    assert card.do(H(pdu), broadcast=True).outcome == SILENT
    assert card.state() == before


# ---------------------------------------------------------------- build options


@pytest.mark.rule("MAP-1")
@each_row(
    ("address", "quantity", "data"),
    [
        ("0020", "0020", "21 84 DE C0"),
        ("001F", "0002", "02"),
        ("003F", "0002", "03"),
        ("0000", "0080", "00" * 4 + "21 84 DE C0 01" + "00" * 7),
    ],
)
def test_with_status_refresh_a_read_of_the_status_asks_the_drive_first(
    address: str, quantity: str, data: str
):
    card = Translator("STATUS_REFRESH")
    reply_to(card, "05 0040 FF00")
    txn = card.do(H(f"01 {address} {quantity}"))
    assert txn.outcome == EXCHANGE
    assert txn.telegram == H("81 0000 0000"), "control word 0: nothing valid in it"
    assert txn.drive_reply(H("8421 C0DE")) == REPLY
    assert txn.reply == H(f"01 {len(H(data)):02x} {data}")
    assert txn.drive_silent() == H("81 FF")


# ---------------------------------------------------------------- against the model, at random


EDGES = [0, 1, 2, 3, 8, 9, 10, 16, 31, 32, 33, 64, 65, 128, 129, 0x7FFF, 0x8000, 0xFF00, 0xFFFE, 0xFFFF]


def some_word(rng: random.Random) -> int:
    return rng.choice([*EDGES, *[rng.randrange(65536)] * 4])


def some_data(rng: random.Random, size: int) -> bytes:
    """Words from the edges as often as not: a high word FFFFh makes a number of one register."""
    return b"".join(some_word(rng).to_bytes(2, "big") for _ in range((size + 1) // 2))[:size]


def some_diagnostic(rng: random.Random) -> bytes:
    """A request of MAP-10, right or almost right."""
    sub = rng.randrange(24)
    pdu = rng.choice(
        [
            bytes([8, 0, sub]) + rng.choice([bytes(2), H("FF00"), some_data(rng, 2)]),
            bytes([8, 0, 0]) + rng.randbytes(rng.randrange(33)),
            bytes([rng.choice([0x0B, 0x11])]),
            bytes([0x2B, rng.choice([0x0E, 0x0E, 0x0D]), rng.randrange(6), rng.choice([0, 1, 2, 3, 200])]),
        ]
    )
    return pdu if rng.random() < 0.9 else pdu + rng.randbytes(rng.randint(1, 3))


def some_request(rng: random.Random) -> bytes:
    """A mostly valid request, sometimes with one error, rarely random bytes."""
    kind = rng.random()
    if kind < 0.05:
        return rng.randbytes(rng.randint(1, 40))
    if kind < 0.1:
        return some_diagnostic(rng)
    if kind < 0.2:  # text modes, index, drive time-out 0
        return H(rng.choice(["06 0000 0400", "06 0000 0500", "06 0000 0000", "06 0000 0403", "06 0002 0000"]))
    function = rng.choice([1, 3, 3, 5, 6, 0x0F, 0x10, 0x10])
    address = rng.choice([rng.randrange(12), rng.randrange(68), some_word(rng)])
    if function in (3, 6, 0x10) and rng.random() < 0.7:
        address = 10 * rng.choice([rng.randint(1, 2050), rng.randint(2040, 4100)]) - 1
    operand = rng.choice([1, 2, rng.randint(1, 11), rng.randint(1, 33), some_word(rng)])
    pdu = bytes([function]) + address.to_bytes(2, "big") + operand.to_bytes(2, "big")
    if function == 5:
        pdu = pdu[:3] + rng.choice([H("FF00"), H("0000"), some_data(rng, 2)])
    if function in (0x0F, 0x10):
        size = (operand + 7) // 8 if function == 0x0F else 2 * operand
        size = min(size, 246) if rng.random() < 0.9 else rng.randrange(20)
        pdu += bytes([size]) + some_data(rng, size)
    if rng.random() < 0.05:
        pdu = pdu[: rng.randint(1, len(pdu))] + rng.randbytes(rng.randrange(3))
    return pdu


def some_drive_replies(rng: random.Random, telegram: bytes) -> Iterator[bytes]:
    """Telegram data of the drive: first misfits, then nearly always a reply that fits."""
    head, status = telegram[1:5], rng.randbytes(4)
    value, text = some_data(rng, 4), rng.randbytes(rng.choice([0, 1, 4, 6, 19, 20, 21, rng.randrange(246)]))
    fault = bytes(3) + bytes([rng.choice([0, 5, 5, 5, 17, rng.randrange(256)])])

    def telling(ak: int, content: bytes) -> bytes:
        return bytes([ak << 4 | head[0] & 0xF]) + head[1:] + content + status

    while rng.random() < 0.3:
        misfit = telling(rng.randrange(16), rng.choice([value, text]))
        yield rng.choice([status, misfit, rng.randbytes(12), bytes([misfit[0] ^ 8]) + misfit[1:]])
    if rng.random() < 0.1:
        return
    if len(telegram) == 5:
        yield status
    elif rng.random() < 0.4:
        yield telling(7, fault)
    elif head[0] >> 4 == 15:
        yield telling(15, text)
    else:
        yield telling(rng.choice([1, 2]), value)


def play_exchange(rng: random.Random, txn: Transaction, model: CardModel, telegram: bytes) -> int:
    """Plays until the request is answered or the drive falls silent; returns the number of exchanges."""
    for data in some_drive_replies(rng, telegram):
        expected = model.drive_reply(telegram[:1] + data) if len(data) >= 4 else Step()
        if expected.telegram:
            assert txn.drive_reply(data) == EXCHANGE
            assert txn.drive_commit().drive_again().telegram == expected.telegram
            return 1 + play_exchange(rng, txn, model, expected.telegram)
        if expected.reply:
            assert txn.drive_reply(data) == REPLY
            assert txn.drive_commit().reply == expected.reply
            return 1
        assert txn.drive_reply(data) == NOT_A_REPLY
    reply, expected = txn.drive_silent(), model.drive_silent().reply
    assert (reply if txn.outcome == REPLY else None) == expected
    return 1


# Of an option that changes replies or telegrams.
MODELS = {
    "STATUS_REFRESH": partial(CardModel, status_refresh=True),
    "ADR_SHORT": partial(CardModel, adr=0x01, adr_broadcast=0x20),
    "DIAGNOSTICS": partial(CardModel, diagnostics=True),
}


@pytest.mark.rule("EXC", "FRAME-6", "MAP-1", "MAP-2", "MAP-3", "MAP-6", "MAP-7", "MAP-8", "MAP-9")
@pytest.mark.parametrize(
    ("dialect", "option"),
    [
        *((dialect, "") for dialect in DIALECTS),
        *(("card", option) for option in OPTIONS),
    ],
)
def test_random_requests_agree_with_the_model(dialect: str, option: str):
    rng = seeded(f"firmware against model, {dialect} {option}")
    card, model = Translator(option, dialect), MODELS.get(option, CardModel)(name=dialect)
    exchanges = [0, 0, 0]
    for _ in range(8000):
        pdu, broadcast = some_request(rng), rng.random() < 0.1
        txn = card.request(pdu, broadcast=broadcast)
        if rng.random() < 0.1:  # revoked: must have no effect
            continue
        txn.commit()
        expected = model.request(pdu, broadcast)
        context = f"{pdu.hex(' ')} broadcast={broadcast} registers={model.registers}"
        if expected.telegram:
            assert txn.outcome == EXCHANGE, context
            assert txn.telegram == expected.telegram, context
            if not broadcast:
                exchanges[play_exchange(rng, txn, model, expected.telegram)] += 1
        elif expected.reply:
            assert txn.outcome == REPLY, context
            assert without_counts(txn.reply) == without_counts(expected.reply), context
        else:
            assert txn.outcome == SILENT, context
        coils = (sum(model.coils[at + bit] << bit for bit in range(8)) for at in range(32, 64, 8))
        assert status(card) == bytes(coils), context
    assert exchanges[1] > 1000, "too few requests reached the drive"
    assert (exchanges[2] > 40) == model.dialect.text_by_size
