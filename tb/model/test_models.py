# SPDX-License-Identifier: Apache-2.0
"""Tests of the reference models against published values and pymodbus."""

import ctypes
import random

import pytest
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, WriteMultipleRegistersRequest

from tb.agents import crc16, rtu
from tb.lib.rows import each_row
from tb.model.firmware import MEMORY, Cpu, library


@pytest.mark.rule("FRAME-4")
def test_crc_has_the_published_check_value():
    assert crc16.crc16(crc16.CHECK_INPUT) == crc16.CHECK_VALUE


@pytest.mark.rule("FRAME-4")
def test_crc_agrees_with_pymodbus_on_random_frames():
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    for _ in range(200):
        data = rng.randbytes(rng.randint(1, 254))
        # pymodbus returns the CRC byte-swapped, ready to be packed high byte first.
        assert crc16.with_crc(data) == data + FramerRTU.compute_CRC(data).to_bytes(2, "big")


@pytest.mark.rule("FRAME-4")
def test_residue_is_zero_and_any_single_bit_error_is_seen():
    adu = rtu.build(1, rtu.write_coils(0, [True] * 32))
    assert crc16.crc_good(adu)
    for bit in range(8 * len(adu)):
        damaged = bytearray(adu)
        damaged[bit // 8] ^= 1 << (bit % 8)
        assert not crc16.crc_good(bytes(damaged))


def test_crc_printed_in_the_manual():
    """Example 1: start, 40 % (manual p19)."""
    request = rtu.build(1, bytes.fromhex("0F 00 00 00 20 04 7C 04 99 19"))
    assert request[-2:] == bytes.fromhex("37 43")


def test_pdus_agree_with_pymodbus():
    framer = FramerRTU(DecodePDU(is_server=False))
    request = ReadHoldingRegistersRequest(address=0x1413, count=2, dev_id=1)
    assert framer.buildFrame(request) == rtu.build(1, rtu.read_registers(0x1413, 2))
    request = WriteMultipleRegistersRequest(address=1, registers=[0x000A, 0x0102], dev_id=1)
    assert framer.buildFrame(request) == rtu.build(1, rtu.write_registers(1, [0x000A, 0x0102]))


@pytest.mark.rule("FRAME-1")
@each_row(
    ("baud", "t15_us", "t35_us"),
    [(300, 55_000, 128_333), (9600, 1719, 4010), (19200, 859, 2005), (38400, 750, 1750), (115200, 750, 1750)],
)
def test_silences_are_the_published_ones(baud: int, t15_us: int, t35_us: int):
    assert rtu.t15_ps(baud) / 1e6 == pytest.approx(t15_us, abs=1)
    assert rtu.t35_ps(baud) / 1e6 == pytest.approx(t35_us, abs=1)


@each_row(
    ("words", "result"),
    [
        ([0x40C58533], 0xFFFFFFF9),  # sub a0,a1,a2: 5 - 12
        ([0x00C5A533], 1),  # slt a0,a1,a2
        ([0x00D5B533], 1),  # sltu a0,a1,a3: 5 < FFFFFFF0h
        ([0x4026D513], 0xFFFFFFFC),  # srai a0,a3,2
        ([0x0026D513], 0x3FFFFFFC),  # srli a0,a3,2
        ([0x00C59533], 0x5000),  # sll a0,a1,a2
        ([0x12345537], 0x12345000),  # lui a0,12345h
        ([0x10D02023, 0x10000503], 0xFFFFFFF0),  # sw a3,256(zero); lb a0,256(zero)
        ([0x10D02023, 0x10004503], 0xF0),  # sw a3,256(zero); lbu a0,256(zero)
        ([0x10D02023, 0x10005503], 0xFFF0),  # sw a3,256(zero); lhu a0,256(zero)
        ([0x00C5C463, 0x00158513, 0x00858513], 13),  # blt a1,a2,+8; addi a0,a1,1; addi a0,a1,8
        ([0x00D5C463, 0x00158513], 6),  # blt a1,a3,+8; addi a0,a1,1
        ([0x0080056F], 4),  # jal a0,+8
    ],
)
def test_the_machine_of_the_images_computes_as_rv32i(words: list[int], result: int):
    """With a1 = 5, a2 = 12 and a3 = FFFFFFF0h; the result is in a0. Words and results are written by hand."""
    program = b"".join(word.to_bytes(4, "little") for word in words)
    cpu, lib = Cpu(), library()
    lib.machine_load(ctypes.byref(cpu), program, len(program), MEMORY)
    cpu.x[11:14] = [5, 12, 0xFFFFFFF0]
    while cpu.pc < len(program):
        assert lib.machine_step(ctypes.byref(cpu))
    assert cpu.x[10] == result


@each_row(
    ("word", "what"), [(0x02C58533, "mul"), (0x00102503, "lw a0,1(zero)"), (0xFFFFFFFF, "no instruction")]
)
def test_the_machine_stops_at_what_the_card_does_not_have(word: int, what: str):
    cpu, lib = Cpu(), library()
    lib.machine_load(ctypes.byref(cpu), word.to_bytes(4, "little"), 4, MEMORY)
    assert not lib.machine_step(ctypes.byref(cpu)), what
