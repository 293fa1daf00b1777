# SPDX-License-Identifier: Apache-2.0
"""The requests of the matrix, in their order, and the answer to each by the rules.

Expected values are those of the simulated drive's table after power-up (sim/drive/*.csv); expected codes are
those of the reference model (tb/model/card.py). Addresses are on-wire.
"""

from __future__ import annotations

from dataclasses import dataclass

from regs.dialects import DIALECTS as TABLE
from regs.dialects import STANDARD_DRIVE
from tb.agents import rtu
from tb.model.card import DIALECTS

# The drive of each dialect.
PROFILES = {name: dialect.profiles[0] for name, dialect in TABLE.items()}
RAMP_STOP, READY = 0x043C, 0x0607  # control word; status word of a drive that is stopped and ready
SILENCE = "silence"
LONGER, CUT = "longer", "cut"
READ_INPUTS = 0x04


@dataclass(frozen=True)
class Parameters:
    """Of the drive's table. `word`: 16 bits, may be written while the motor stands. `double`: 32 bits."""

    word: int
    word_value: int
    word_low: int  # below its minimum
    double: int
    double_value: int
    text: int
    text_value: str
    text_write: int
    absent: int


PARAMETERS = {
    "vlt6000": Parameters(104, 50, 20, 5, 10000, 621, "VLT600", 533, 32),
    STANDARD_DRIVE: Parameters(123, 50, 10, 1500, 1234, 1540, "FC-101", 37, 1999),
}
TEXT = "PUMP 1"


@dataclass(frozen=True)
class Case:
    """One request of the matrix. `expect` is an answer of the adapter, an exception's code, or SILENCE.

    `trick`: LONGER adds a byte to the request on its way, CUT cuts the drive off.
    `before` and `after` are writes of the same master that must be accepted.
    """

    id: str
    title: str
    request: str
    expect: dict | int | str
    trick: str = ""
    before: str = ""
    after: str = ""

    @property
    def is_error(self) -> bool:
        return not isinstance(self.expect, dict)


def bits(word: int) -> list[int]:
    return [word >> i & 1 for i in range(16)]


def register(number: int) -> int:
    return 10 * number - 1


def cases(dialect: str) -> list[Case]:
    """All requests in one dialect."""
    codes = DIALECTS[dialect].codes
    of = PARAMETERS[PROFILES[dialect]]
    done = {"done": True}

    def drive(fault: int) -> int:
        return codes.get("drive", fault)

    def text_mode(ind: int) -> dict[str, str]:
        """IND is for `card` alone (MAP-8)."""
        around = {"before": f"write-register 0 {ind}", "after": "write-register 0 0"}
        return around if dialect == "card" else {}

    word, double, absent = register(of.word), register(of.double), register(of.absent)
    words = [of.double_value >> 16, of.double_value & 0xFFFF]
    stop = " ".join(map(str, bits(RAMP_STOP) + bits(0)))
    status, text, back = (
        {"values": bits(READY)},
        {"text": of.text_value.ljust(8)},
        "write-registers 1 1000 15",
    )
    write_text = f"write-text {register(of.text_write)} {TEXT.encode().hex()}"
    old_word, silent = f"write-register {word} {of.word_value}", codes.get("silent", SILENCE)
    read_word = f"read-registers {word} 1"
    return [
        Case("write-coils", "write coils 1-32: ramp stop", f"write-coils 0 {stop}", done),
        Case("read-coils", "read coils 33-48: status word", "read-coils 32 16", status),
        Case("write-coil", "write coil 65 = 1", "write-coil 64 1", done, after="write-coil 64 0"),
        Case("read-local", "read 40002 and 40003", "read-registers 1 2", {"values": [1000, 15]}),
        Case("write-register", "write 40002 = 500", "write-register 1 500", done, after=back),
        Case("read-word", "read a parameter of 16 bits", read_word, {"values": [of.word_value]}),
        Case("read-double", "read a parameter of 32 bits", f"read-registers {double} 2", {"values": words}),
        Case("write-word", "write a parameter of 16 bits", f"write-register {word} 60", done, after=old_word),
        Case(
            "read-text",
            "read a text, 4 registers",
            f"read-text {register(of.text)} 4",
            text,
            **text_mode(0x0400),
        ),
        Case("write-text", "write a text, 3 registers", write_text, done, **text_mode(0x0500)),
        Case("fault-0", "a parameter that does not exist", f"read-registers {absent} 1", drive(0)),
        Case("fault-2", "a value below the minimum", f"write-register {word} {of.word_low}", drive(2)),
        Case("value", "40003 = 0", "write-register 2 0", codes["value"]),
        Case("address", "read coil 129", "read-coils 128 1", codes["address"]),
        Case("length", "a frame with a byte too many", "read-coils 0 16", codes["length"], LONGER),
        Case("quantity", "read 11 registers", f"read-registers {word} 11", codes["quantity"]),
        Case("function", "read input registers, function 04", f"read-inputs {word} 1", codes["function"]),
        Case("silent", "the drive is cut off", read_word, silent, CUT),
    ]


def pdu_of(request: str) -> bytes:
    """The PDU that a master has to make of a request."""
    what, address, *rest = request.split()
    at = int(address)
    if what == "write-text":
        data = bytes.fromhex(rest[0])
        return rtu.write_registers(
            at, [int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2)]
        )
    values = [int(value) for value in rest]
    match what:
        case "read-coils":
            return rtu.read_coils(at, values[0])
        case "read-registers" | "read-text":
            return rtu.read_registers(at, values[0])
        case "read-inputs":
            return bytes([READ_INPUTS]) + rtu.read_registers(at, values[0])[1:]
        case "write-coil":
            return rtu.write_coil(at, bool(values[0]))
        case "write-register":
            return rtu.write_register(at, values[0])
        case "write-coils":
            return rtu.write_coils(at, [bool(value) for value in values])
        case "write-registers":
            return rtu.write_registers(at, values)
    raise ValueError(f"no PDU for {request}")


def reply_of(case: Case) -> bytes | None:
    """The PDU that the card has to answer with; None: silence."""
    request = pdu_of(case.request)
    if case.expect == SILENCE:
        return None
    if isinstance(case.expect, int):
        return rtu.exception(request[0], case.expect)
    if "text" in case.expect:
        data = case.expect["text"].encode("latin-1")
        return bytes([request[0], len(data)]) + data
    if "values" not in case.expect:
        return request[:5]
    values = case.expect["values"]
    if request[0] == rtu.READ_COILS:
        data = sum(bit << i for i, bit in enumerate(values)).to_bytes(-(-len(values) // 8), "little")
    else:
        data = b"".join(value.to_bytes(2, "big") for value in values)
    return bytes([request[0], len(data)]) + data
