# SPDX-License-Identifier: Apache-2.0
"""Tests of the reference models against published values and pymodbus."""

import random

import pytest
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, WriteMultipleRegistersRequest

from tb.agents import crc16, rtu


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
@pytest.mark.parametrize(
    ("baud", "t15_us", "t35_us"),
    [(300, 55_000, 128_333), (9600, 1719, 4010), (19200, 859, 2005), (38400, 750, 1750), (115200, 750, 1750)],
)
def test_silences_are_the_published_ones(baud: int, t15_us: int, t35_us: int):
    assert rtu.t15_ps(baud) / 1e6 == pytest.approx(t15_us, abs=1)
    assert rtu.t35_ps(baud) / 1e6 == pytest.approx(t35_us, abs=1)
