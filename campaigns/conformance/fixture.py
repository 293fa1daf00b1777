# SPDX-License-Identifier: Apache-2.0
"""A model slave with one planted fault or none, in virtual time. The suite is tested against it.

`Slave` turns frames into replies. `ModelLine` is the driver around it: it plays the edges of each
transmission to a model receiver, and returns the edges of the reply.
"""

from __future__ import annotations

import re

from sw.rtu2fc.cases import (
    BYTES,
    EDGES,
    FUNCTIONS,
    PARITY,
    PINS,
    Heard,
    Profile,
    Send,
    pattern,
)
from tb.agents import rtu
from tb.agents.crc16 import crc_good
from tb.agents.edges import Trace
from tb.agents.rs485 import Pulse
from tb.agents.uart import Character, Flaws, Format, waveform, with_gaps

UNIT = 17
# The faults by the test that must find them. A test has a fault for each of its steps.
PLANTED = """
SL-1  replies with address 0; replies with a swapped CRC; adds a byte to each reply; replies with another
      function
SL-2  answers every unit; answers unit 18; answers unit 247; answers unit 248; answers unit 255; is silent
      after a request for another unit
SL-3  obeys writes for others; answers writes for others
SL-4  ignores broadcasts; ignores a broadcast of 06; ignores a broadcast of 16
SL-5  answers broadcasts; answers a broadcast of 03; answers a broadcast of 06; sends exception 1 to a
      broadcast; sends exception 2 to a broadcast; is silent after a broadcast
SL-6  accepts any CRC; accepts a swapped CRC; accepts a CRC of 0; writes before it checks the CRC; compares
      the low byte of the CRC only; compares the high byte of the CRC only; leaves a bit of the address out of
      the CRC; leaves a bit of the value out of the CRC
SL-7  keeps a part of a frame; answers a part of a frame
SL-8  hangs after a long frame; answers a long frame with five bytes; answers a long frame
SL-9  answers another unit's read of four registers; takes another unit's reply for a request; loses a request
      after foreign traffic
SL-10 answers a noise byte; loses a request after noise
SL-11 takes gaps of 1.2 characters as an end
SL-12 accepts gaps beyond 1.5 characters; accepts gaps of 2.3 characters; accepts a gap before byte 2; accepts
      a gap before byte 5; accepts a gap before byte 8; accepts a gap before byte 8, silently; accepts a gap
      before byte 8, without effect
SL-13 needs 5 characters between frames
SL-14 ends a frame after 2.3 characters; ends a frame after 2.3 characters, silently; ends a frame after 2.3
      characters, without effect
SL-15 accepts a write that a byte follows; accepts a write that a byte follows, silently
SL-16 replies after 2 characters; replies half a bit too soon; replies to 03 after 2 characters; replies to 06
      after 2 characters
SL-17 replies with gaps
SL-18 ignores parity; ignores parity of byte 1; ignores parity of byte 2; ignores parity of byte 5; ignores
      parity of byte 8; ignores parity of byte 8, silently
SL-19 ignores stop bits; ignores the stop bit of byte 3; ignores the stop bit of byte 7; ignores the stop bit
      of byte 7, silently
SL-20 sends odd parity; sends without parity; sends 0.7 stop bits
SL-21 refuses each read; sends 1.5 % too slow; sends 1.5 % too fast
SL-22 receives 4 % too fast; receives 4 % too slow
SL-23 hangs after a break; answers a break
SL-24 drops DE a bit too soon; raises DE 60 bits too soon; holds DE for 60 bits; never raises DE; never lowers
      DE; raises DE twice; raises DE for every frame
SL-25 is deaf for 60 bits after a reply
SL-26 ignores a broadcast of 05; ignores a broadcast of 15; takes every broadcast of 05 as ON; takes every
      broadcast of 05 as OFF
AP-1  counts registers, not bytes; sends one register only; sends two registers for one
AP-2  06 does not write; sends a register of 0 before each; 06 echoes the address only; 06 keeps its first
      value
AP-3  16 writes the first register only; 16 echoes the data; 16 swaps the bytes; 16 keeps its first value
AP-4  sends exception 2 for a wrong quantity; reads 0 registers; reads 126 registers
AP-5  has every register; sends exception 3 for a wrong address; wraps registers beyond 65535
AP-6  06 writes to no register; 16 writes to no register
AP-7  ignores the byte count; 16 takes too many bytes; 16 takes too few bytes; 16 refuses too many bytes and
      writes
AP-8  16 of nothing is good; 16 takes 124 registers; 16 takes 124 registers, silently; 16 counts its bytes
      modulo 256
AP-9  pads one coil with ones; pads the second byte of coils with ones; sends one byte of coils too many
AP-10 05 inverts the coil; 05 only switches on; 05 only switches off; 05 echoes the address only
AP-11 05 takes any value; 05 refuses a value and switches off
AP-12 packs coils from the highest bit; 15 only switches on; 15 writes once; 15 echoes the data
AP-13 reads 0 coils; reads 2001 coils
AP-14 has every coil; wraps coils beyond 65535
AP-15 is silent for an unknown function; sends exceptions without 80h; sends exceptions without a code; hangs
      after an unknown function
AP-16 answers function 131; answers function 0 with five bytes; hangs after function 0
AP-17 ignores the length; hangs after a wrong length; 01 takes a byte too many; 01 takes a byte too few; 03
      takes a byte too many; 03 takes a byte too few
AP-18 03 ignores the address; 06 ignores the address; 16 ignores the address
AP-19 keeps the low byte of a register; 06 loses the high byte; 16 loses the high byte; 03 loses the high byte
AP-20 01 ignores the address; 05 ignores the address; 15 ignores the address
AP-21 05 clears the coil's byte; 05 sets the coil's byte; 15 clears the other coils of a byte; 15 sets the
      other coils of a byte
AP-22 01 reads 0 from the ninth coil on; 01 reads 1 from the ninth coil on; 15 writes the first byte only; 01
      begins at the byte of its first coil; 01 reads 0 from the tenth coil on; 15 writes the second byte once
AP-23 refuses 03 of more than 100 registers; refuses 16 of more than 100 registers; keeps the address of a
      register in 6 bits
AP-24 refuses 01 of more than 1000 coils; refuses 15 of more than 1000 coils; keeps the address of a coil in
      10 bits
AP-25 03 reads across the end
AP-26 16 writes across the end; 16 refuses the end and writes
AP-27 01 reads across the end
AP-28 15 writes across the end; 15 refuses the end and writes
AP-29 06 takes a byte too many; 06 takes a byte too few; 16 takes a byte too many; 16 takes a byte too few; 06
      takes a byte too many, silently
AP-30 05 takes a byte too many; 05 takes a byte too few; 15 takes a byte too many; 15 takes a byte too few; 05
      takes a byte too many, silently
AP-31 15 of nothing is good; 15 takes 1969 coils; 15 takes too many bytes; 15 takes too few bytes; 15 refuses
      too many bytes and writes
AP-32 05 writes to no coil; 15 writes to no coil
AP-33 02 counts inputs, not bytes; 02 pads inputs with ones; 04 counts inputs, not bytes; 04 sends two
      registers for one
AP-34 reads 0 inputs by 02; reads 2001 inputs by 02; reads 0 inputs by 04; reads 126 inputs by 04
AP-35 02 has every input; 04 has every input
"""
FAULTS = {
    " ".join(fault.split()): number
    for number, faults in re.findall(r"^(\S+) +(.*(?:\n .*)*)", PLANTED, re.MULTILINE)
    for fault in faults.split(";")
}
# What the specification allows a good slave.
MANNERS = ("is silent for a wrong length",)
# The fault obeys without a reply, or replies without effect.
SILENTLY, IDLY = ", silently", ", without effect"
REGISTERS, COILS, INPUTS = 125, 2000, 10
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
PROFILE = Profile(
    unit=UNIT,
    functions=frozenset(FUNCTIONS),
    registers=REGISTERS,
    coils=COILS,
    inputs=INPUTS,
    no_register=REGISTERS,
    no_coil=COILS,
    no_input=INPUTS,
)


class Refused(Exception):
    """The request gets an exception with this code."""


class Slave:
    """Registers, coils, inputs, and the reply to each frame, with one fault or none."""

    def __init__(self, profile: Profile, fault: str | None = None):
        assert fault is None or fault in (*FAULTS, *MANNERS), fault
        self.unit, self.functions, self.whole_fault = profile.unit, profile.functions, fault or ""
        self.fault = self.whole_fault.removesuffix(SILENTLY).removesuffix(IDLY)
        self.registers = [
            pattern(n, profile.values[::-1]) for n in range(profile.register + profile.registers)
        ]
        self.coils = [pattern(n, (False, True)) for n in range(profile.coil + profile.coils)]
        self.kept = b""
        self._sleeps = self._silent = self._loses = False
        self._written: set[int] = set()  # functions that have written

    def has(self, fault: str) -> bool:
        """Whether it is the planted fault, or the same one without a reply to what should be ignored."""
        assert fault in FAULTS, fault
        return self.fault == fault

    def does(self, function: int, what: str) -> bool:
        """Like `has`, for a fault whose name begins with the function."""
        return self.fault == f"{function:02} {what}"

    # ------------------------------------------------------------ a frame

    def reply(self, frame: bytes) -> bytes | None:
        """The reply to a frame with good characters and silences; its CRC may be wrong."""
        self._silent = False
        sent = self._reply(frame)
        return None if self._silent else sent

    def _reply(self, frame: bytes) -> bytes | None:
        if self._sleeps:
            return None
        if self._loses and frame[0] == self.unit:
            self._loses = False
            return None
        if self.has("keeps a part of a frame"):
            frame, self.kept = self.kept + frame, b"" if crc_good(self.kept + frame) else self.kept + frame
        if self.has("writes before it checks the CRC") and frame[:1] == bytes([self.unit]):
            self._answer(frame[1:-2])
        if len(frame) == 5 and self.has("answers a part of a frame"):
            return rtu.build(self.unit, bytes([frame[1], 0]))
        if len(frame) == 1:
            noise = self.has("answers a noise byte") and frame != b"\0"
            return bytes(1) if noise or (self.has("answers a break") and frame == b"\0") else None
        if not self._crc_good(frame):
            return None
        address, pdu = frame[0], frame[1:-2]
        if address not in (0, self.unit) and not self._answers_others(address, pdu):
            return None
        if address == 0:
            pdu = self._broadcast(pdu)
        if not pdu:
            return None
        if pdu[0] == 0 and self.has("answers function 0 with five bytes"):
            return rtu.build(self.unit, bytes(2))
        answer = self._answer(pdu)
        if answer is None or (address == 0 and not self._answers_broadcast(answer)):
            return None
        if self.has("replies with another function"):
            answer = bytes([answer[0] ^ 1]) + answer[1:]
        sent = rtu.build(0 if self.has("replies with address 0") else self.unit, answer)
        if self.has("replies with a swapped CRC"):
            sent = sent[:-2] + sent[:-3:-1]
        return sent + b"\0" if self.has("adds a byte to each reply") else sent

    def _answers_others(self, address: int, pdu: bytes) -> bool:
        """Whether a request for another unit is answered."""
        self._loses |= self.has("is silent after a request for another unit")
        if self.has("obeys writes for others"):
            self._answer(pdu)
        if self.has("answers writes for others") and pdu[0] in (6, 16):
            return True
        if self.has("takes another unit's reply for a request") and len(pdu) != 5:
            return True
        if self.has("answers another unit's read of four registers") and pdu[-2:] == b"\0\4":
            return True
        return self.has("answers every unit") or self.fault == f"answers unit {address}"

    def _broadcast(self, pdu: bytes) -> bytes:
        """The PDU of a broadcast as it is obeyed, or nothing."""
        self._sleeps = self.has("is silent after a broadcast")
        for on in (True, False):
            if pdu[0] == 5 and self.has(f"takes every broadcast of 05 as {'ON' if on else 'OFF'}"):
                pdu = pdu[:3] + (b"\xff\0" if on else bytes(2))
        ignored = self.has("ignores broadcasts") or self.fault == f"ignores a broadcast of {pdu[0]:02}"
        return b"" if ignored else pdu

    def _answers_broadcast(self, answer: bytes) -> bool:
        if answer[0] & 0x80:
            return self.fault == f"sends exception {answer[1]} to a broadcast"
        return self.has("answers broadcasts") or self.fault == f"answers a broadcast of {answer[0]:02}"

    def _crc_good(self, frame: bytes) -> bool:
        if len(frame) < 4:
            return False
        if self.has("accepts any CRC") or crc_good(frame):
            return True
        if self.has("accepts a swapped CRC"):
            return crc_good(frame[:-2] + frame[:-3:-1])
        if self.has("accepts a CRC of 0"):
            return frame[-2:] == bytes(2)
        for fault, place in (("address", 3), ("value", len(frame) - 3)):
            if self.has(f"leaves a bit of the {fault} out of the CRC"):
                return crc_good(frame[:place] + bytes([frame[place] ^ 4]) + frame[place + 1 :])
        right = rtu.build(frame[0], frame[1:-2])
        if self.has("compares the low byte of the CRC only"):
            return frame[-2] == right[-2]
        return self.has("compares the high byte of the CRC only") and frame[-1] == right[-1]

    # ------------------------------------------------------------ a request

    def _answer(self, pdu: bytes) -> bytes | None:
        function = pdu[0]
        try:
            return self._served(function, pdu)
        except Refused as refused:
            code = refused.args[0]
        if code == ILLEGAL_FUNCTION and self.has("is silent for an unknown function"):
            return None
        self._sleeps |= code == ILLEGAL_FUNCTION and self.has("hangs after an unknown function")
        if code == ILLEGAL_ADDRESS and self.has("sends exception 3 for a wrong address"):
            code = ILLEGAL_VALUE
        if self.has("sends exceptions without a code"):
            return bytes([function | 0x80])
        return bytes([function if self.has("sends exceptions without 80h") else function | 0x80, code])

    def _served(self, function: int, pdu: bytes) -> bytes:
        if function == 131 and self.has("answers function 131"):
            function = 3
        serve = {
            1: self._read_coils,
            2: self._read_inputs,
            3: self._read,
            4: self._read_inputs,
            5: self._write_coil,
            6: self._write,
            15: self._write_coils,
            16: self._write_many,
        }
        if function == 0:
            self._sleeps = self.has("hangs after function 0")
        if function not in serve or function not in self.functions | {131}:
            raise Refused(ILLEGAL_FUNCTION)
        pdu = self._of_right_length(function, pdu)
        return serve[function](pdu, int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big"))

    def _of_right_length(self, function: int, pdu: bytes) -> bytes:
        due = 5 if function < 15 else 6 + pdu[5] if len(pdu) > 5 else 6
        if len(pdu) == due:
            return pdu
        any_length = function in (1, 3) and self.has("ignores the length")
        if any_length or self.does(function, f"takes a byte too {'many' if len(pdu) > due else 'few'}"):
            self._silent = self.whole_fault.endswith(SILENTLY)
            return pdu[:due].ljust(due, b"\1" if function < 5 else b"\0")
        self._sleeps |= self.has("hangs after a wrong length")
        self._silent = self.fault == "is silent for a wrong length"
        raise Refused(ILLEGAL_VALUE)

    def _in(self, function: int, first: int, count: int, size: int) -> int:
        """The place of the first coil or register; the faults of addresses are here."""
        coils = function in (1, 5, 15)
        if self.does(function, "ignores the address"):
            return 0
        if first + count > 0x10000:
            if self.has(f"wraps {'coils' if coils else 'registers'} beyond 65535"):
                return 0
        elif first >= size and self._has_every(function, coils):
            return 0
        if first < size < first + count:
            if self.does(function, f"{'reads' if function < 5 else 'writes'} across the end"):
                return first
            if self.does(function, "refuses the end and writes"):
                self._store(function, first)
        if first + count > size:
            raise Refused(ILLEGAL_ADDRESS)
        if not coils and self.has("keeps the address of a register in 6 bits"):
            return first & 0x3F
        return first & 0x3FF if coils and self.has("keeps the address of a coil in 10 bits") else first

    def _has_every(self, function: int, coils: bool) -> bool:
        if function in (1, 3):
            return self.has("has every coil" if coils else "has every register")
        return self.does(function, "writes to no coil" if coils else "writes to no register")

    def _store(self, function: int, place: int) -> None:
        """The effect of a write that is refused."""
        if function == 15:
            self.coils[place] = True
        else:
            self.registers[place] = 0

    def _quantity(self, good: bool) -> None:
        if not good:
            raise Refused(
                ILLEGAL_ADDRESS if self.has("sends exception 2 for a wrong quantity") else ILLEGAL_VALUE
            )

    def _read(self, pdu: bytes, first: int, count: int) -> bytes:
        if count == 126 and self.has("reads 126 registers"):
            return bytes([3, 252, *bytes(248)])
        if count == 0 and self.has("reads 0 registers"):
            return bytes([3, 0])
        self._quantity(1 <= count <= (100 if self.has("refuses 03 of more than 100 registers") else 125))
        first = self._in(3, first, count, len(self.registers))
        mask = 0xFF if self.does(3, "loses the high byte") else 0xFFFF
        words = [(value & mask).to_bytes(2, "big") for value in self.registers[first : first + count]]
        if self.has("sends one register only"):
            words = words[:1]
        if self.has("refuses each read"):
            raise Refused(ILLEGAL_VALUE)
        if count == 1 and self.has("sends two registers for one"):
            words *= 2
        if self.has("sends a register of 0 before each"):
            words.insert(0, bytes(2))
        size = count if self.has("counts registers, not bytes") else 2 * len(words)
        return bytes([3, size]) + b"".join(words)

    def _keep(self, function: int, register: int, value: int) -> None:
        if self.has("keeps the low byte of a register") or self.does(function, "loses the high byte"):
            value &= 0xFF
        self.registers[register] = value

    def _write(self, pdu: bytes, first: int, value: int) -> bytes:
        first = self._in(6, first, 1, len(self.registers))
        kept = 6 in self._written and self.does(6, "keeps its first value")
        if not kept and not self.does(6, "does not write"):
            self._keep(6, first, value)
        self._written.add(6)
        return pdu[:3] if self.does(6, "echoes the address only") else pdu[:5]

    def _write_many(self, pdu: bytes, first: int, count: int) -> bytes:
        size = len(pdu) - 6
        if count == 0 and self.does(16, "of nothing is good"):
            return pdu[:5]
        more, fewer = size > 2 * count, size < 2 * count
        wrong = (more and not self.does(16, "takes too many bytes")) or (
            fewer and not self.does(16, "takes too few bytes")
        )
        if more and self.does(16, "refuses too many bytes and writes"):
            self._store(16, first)
        if wrong and self.does(16, "counts its bytes modulo 256") and 2 * count & 0xFF == size:
            wrong, count = False, size // 2
        if count == 124 and self.does(16, "takes 124 registers"):
            self._silent = self.whole_fault.endswith(SILENTLY)
        else:
            most = 100 if self.has("refuses 16 of more than 100 registers") else 123
            self._quantity(1 <= count <= most and (not wrong or self.has("ignores the byte count")))
        first = self._in(16, first, count, len(self.registers))
        order = "little" if self.does(16, "swaps the bytes") else "big"
        places = range(1 if self.does(16, "writes the first register only") else count)
        if self.does(16, "keeps its first value") and 16 in self._written:
            places = range(0)
        self._written.add(16)
        for n in places[: len(self.registers) - first]:
            self._keep(16, first + n, int.from_bytes(pdu[6 + 2 * n : 8 + 2 * n], order))
        return pdu if self.does(16, "echoes the data") else pdu[:5]

    def _packed(self, function: int, bits: list[bool], count: int, ones: bool) -> bytes:
        size = (count + 7) // 8
        packed = sum(on << n for n, on in enumerate(bits))
        if ones:
            packed |= (1 << 8 * size) - (1 << count)
        return bytes([function, size]) + packed.to_bytes(size, "little")

    def _read_coils(self, pdu: bytes, first: int, count: int) -> bytes:
        if count == 2001 and self.has("reads 2001 coils"):
            return bytes([1, 251, *bytes(247)])
        if count == 0 and self.has("reads 0 coils"):
            return bytes([1, 0])
        self._quantity(1 <= count <= (1000 if self.has("refuses 01 of more than 1000 coils") else 2000))
        first = self._in(1, first, count, len(self.coils))
        if self.does(1, "begins at the byte of its first coil"):
            first -= first % 8
        bits = self.coils[first : first + count]
        for level, place, name in ((0, 8, "ninth"), (1, 8, "ninth"), (0, 9, "tenth")):
            if self.does(1, f"reads {level} from the {name} coil on"):
                bits[place:] = [bool(level)] * len(bits[place:])
        padded = self.has(
            "pads one coil with ones" if count == 1 else "pads the second byte of coils with ones"
        )
        sent = self._packed(1, bits, count, padded and count in (1, *range(9, 16)))
        return (
            bytes([1, sent[1] + 1]) + sent[2:] + b"\0"
            if self.has("sends one byte of coils too many")
            else sent
        )

    def _clobber(self, function: int, first: int, count: int, off: str, on: str) -> None:
        """The coils of the same bytes that are not written."""
        for level, fault in ((False, off), (True, on)):
            if self.does(function, fault):
                last = min(-(-(first + count) // 8) * 8, len(self.coils))
                self.coils[first // 8 * 8 : last] = [level] * (last - first // 8 * 8)

    def _write_coil(self, pdu: bytes, first: int, value: int) -> bytes:
        if value not in (0, 0xFF00) and not self.does(5, "takes any value"):
            if self.does(5, "refuses a value and switches off"):
                self.coils[first] = False
            raise Refused(ILLEGAL_VALUE)
        first = self._in(5, first, 1, len(self.coils))
        on = (value == 0xFF00) ^ self.does(5, "inverts the coil")
        self._clobber(5, first, 1, "clears the coil's byte", "sets the coil's byte")
        if not self.does(5, f"only switches {'off' if on else 'on'}"):
            self.coils[first] = on
        return pdu[:3] if self.does(5, "echoes the address only") else pdu[:5]

    def _write_coils(self, pdu: bytes, first: int, count: int) -> bytes:
        size, due = len(pdu) - 6, (count + 7) // 8
        if count == 0 and self.does(15, "of nothing is good"):
            return pdu[:5]
        if size > due and self.does(15, "refuses too many bytes and writes"):
            self.coils[first] = not self.coils[first]
        right = (
            size == due
            or (size > due and self.does(15, "takes too many bytes"))
            or (size < due and self.does(15, "takes too few bytes"))
        )
        most = 1000 if self.has("refuses 15 of more than 1000 coils") else 0x7B0
        self._quantity(1 <= count <= most + self.does(15, "takes 1969 coils") and right)
        first = self._in(15, first, count, len(self.coils))
        self._clobber(15, first, count, "clears the other coils of a byte", "sets the other coils of a byte")
        again = 15 in self._written
        short = self.does(15, "writes the first byte only") or (
            again and self.does(15, "writes the second byte once")
        )
        end = 0 if again and self.does(15, "writes once") else 8 if short else count
        if count > 8 or self.does(15, "writes once"):
            self._written.add(15)
        for n in range(min(count, len(self.coils) - first, end)):
            place = 7 - n % 8 if self.has("packs coils from the highest bit") else n % 8
            on = bool(pdu[6 + n // 8 : 7 + n // 8] and pdu[6 + n // 8] >> place & 1)
            self.coils[first + n] = on or (self.coils[first + n] and self.does(15, "only switches on"))
        return pdu if self.does(15, "echoes the data") else pdu[:5]

    def _read_inputs(self, pdu: bytes, first: int, count: int) -> bytes:
        function = pdu[0]
        most = 2000 if function == 2 else 125
        if self.fault != f"reads {count} inputs by {function:02}":
            self._quantity(1 <= count <= most)
        if first + count > INPUTS and not self.does(function, "has every input"):
            if 1 <= count <= most:
                raise Refused(ILLEGAL_ADDRESS)
            return bytes([function, 0])
        if function == 2:
            sent = self._packed(2, [True] * count, count, self.does(2, "pads inputs with ones"))
        else:
            words = count + (count == 1 and self.does(4, "sends two registers for one"))
            sent = bytes([4, 2 * words]) + b"\x12\x34" * words
        return (
            bytes([function, count]) + sent[2:] if self.does(function, "counts inputs, not bytes") else sent
        )


class ModelLine:
    """The driver: a slave with its receiver and sender on a line in virtual time."""

    sees = frozenset({BYTES, EDGES, PARITY, PINS})

    def __init__(self, profile: Profile, fault: str | None = None):
        self.profile, self.slave = profile, Slave(profile, fault)
        self.fmt = profile.fmt
        self._end_ps = 0.0
        self._edges: list[tuple[int, int]] = []  # not read by the slave yet
        self._pause_bits = float("inf")
        self._deaf = self._spoilt = self._after_reply = False

    def has(self, fault: str) -> bool:
        return self.slave.has(fault)

    @property
    def t15_ps(self) -> float:
        return rtu.t15_ps(self.fmt.baud)

    @property
    def t35_ps(self) -> float:
        return rtu.t35_ps(self.fmt.baud)

    def exchange(self, send: Send) -> Heard:
        bit = self.fmt.bit_ps
        pause = 2 * self.t35_ps if send.pause_bits is None else send.pause_bits * bit
        start = self._end_ps + pause
        self._pause_bits = pause / bit
        if send.low_bits:
            edges, length = [(0.0, 0), (send.low_bits * bit, 1)], send.low_bits * bit
        else:
            edges, length = waveform(self.fmt, send.data, send.flaws or Flaws())
        self._edges += [(round(start + at), level) for at, level in edges]
        self._end_ps = end = start + length
        if not send.wait:
            self._after_reply = False
            return Heard()
        heard = self._heard(end)
        self._edges = []
        self._after_reply = bool(heard.data)
        return heard

    # ------------------------------------------------------------ receiving

    def _heard(self, end: float) -> Heard:
        """The reply to the last frame. Earlier frames of the same transmission are obeyed without a reply."""
        reply, pulses, function = None, [], 0
        for data, good, clean in self._frames():
            kept = list(self.slave.registers)
            reply = self._obeyed(data, good)
            function = data[1] if len(data) > 1 else 0
            if not clean and self.slave.whole_fault.endswith(SILENTLY):
                reply = None
            if not clean and self.slave.whole_fault.endswith(IDLY):
                self.slave.registers = kept
        if self.has("raises DE for every frame"):
            pulses.append(Pulse(round(end + self.t35_ps), round(end + 1.5 * self.t35_ps)))
        if reply is None:
            return Heard(pulses=pulses, trace=Trace(self.fmt, []), request_end_ps=end)
        return self._sent(reply, end, function)

    def _characters(self) -> list[Character]:
        rate = self.fmt.baud
        if self.has("receives 4 % too fast"):
            rate = round(rate * 1.04)
        if self.has("receives 4 % too slow"):
            rate = round(rate / 1.04)
        return Trace(Format(rate, self.fmt.parity, self.fmt.stop_bits), self._edges).characters

    def _frames(self) -> list[tuple[bytes, bool, bool]]:
        """Bytes of each frame, whether the slave takes it, and whether its line has no fault."""
        frames: list[tuple[bytes, bool, bool]] = []
        inner = self.t15_ps * (0.8 if self.has("takes gaps of 1.2 characters as an end") else 1.0)
        outer = self.t35_ps
        if self.has("ends a frame after 2.3 characters"):
            outer = inner * 2.3 / 1.5
        if self.has("needs 5 characters between frames"):
            outer = self.t35_ps * 5 / 3.5
        last_end, place = float("-inf"), 0
        for c in self._characters():
            gap = c.start_ps - last_end
            last_end = c.end_ps
            place = 1 if gap >= outer - 2 else place + 1
            good = self._taken(c, place)
            if place == 1:
                frames.append((bytes([c.byte]), good, c.ok and gap >= self.t35_ps - 2))
                continue
            data, so_far, clean = frames[-1]
            clean &= c.ok and gap <= self.t15_ps
            if gap > inner * (2.3 / 1.5 if self.has("accepts gaps of 2.3 characters") else 1):
                if self.has("accepts a write that a byte follows") and crc_good(data):
                    frames[-1] = (data, so_far, False)
                    continue
                so_far &= (
                    self.has("accepts gaps beyond 1.5 characters")
                    or self.slave.fault == f"accepts a gap before byte {place}"
                )
            frames[-1] = (data + bytes([c.byte]), so_far and good, clean)
        return frames

    def _taken(self, c: Character, place: int) -> bool:
        """Whether the slave takes a character; `place` is its place in the frame, from 1 on."""
        fault = self.slave.fault
        parity = c.parity_ok or fault in ("ignores parity", f"ignores parity of byte {place}")
        stop = c.stop_ok or fault in ("ignores stop bits", f"ignores the stop bit of byte {place}")
        return parity and (stop or fault == "answers a break")

    def _obeyed(self, data: bytes, good: bool) -> bytes | None:
        near = self._after_reply and self._pause_bits < 60
        if self._deaf or (near and self.has("is deaf for 60 bits after a reply")):
            return None
        lost, self._spoilt = self._spoilt, False
        if self.has("hangs after a break") and data == b"\0":
            self._deaf = True
        if self.has("hangs after a long frame") and len(data) > 256:
            self._deaf = True
        if self.has("loses a request after noise") and len(data) == 1:
            self._spoilt = True
        if self.has("loses a request after foreign traffic") and crc_good(data) and len(data) > 8:
            self._spoilt = data[0] not in (0, self.profile.unit)
        if len(data) > 256 and not (len(data) == 257 and self.has("16 takes 124 registers")):
            if self.has("answers a long frame"):
                return rtu.build(self.profile.unit, data[1:6])
            return bytes(5) if self.has("answers a long frame with five bytes") else None
        return None if lost or not good else self.slave.reply(data)

    # ------------------------------------------------------------ sending

    def _sent(self, reply: bytes, end: float, function: int) -> Heard:
        fmt, bit, flaws = self.fmt, self.fmt.bit_ps, Flaws()
        if self.has("sends odd parity"):
            fmt = Format(fmt.baud, "O", fmt.stop_bits)
        if self.has("sends without parity"):
            fmt = Format(fmt.baud, "N", 1)
        if self.has("sends 0.7 stop bits"):
            flaws = with_gaps(len(reply), -0.3)
        for percent, ppm in (("slow", -15_000), ("fast", 15_000)):
            if self.has(f"sends 1.5 % too {percent}"):
                flaws = Flaws(ppm=ppm)
        if self.has("replies with gaps"):
            flaws = with_gaps(len(reply), 2 * self.t15_ps / bit)
        early = ("replies after 2 characters", f"replies to {function:02} after 2 characters")
        start = end + (self.t15_ps * 2 / 1.5 if self.slave.fault in early else self.t35_ps + bit / 2)
        if self.has("replies half a bit too soon"):
            start = end + self.t35_ps - bit / 2
        edges, length = waveform(fmt, reply, flaws)
        trace = Trace(self.fmt, [(round(start + at), level) for at, level in edges])
        self._end_ps = start + length
        return Heard(bytes(c.byte for c in trace.characters), trace, self._pulses(start, length), end)

    def _pulses(self, start: float, length: float) -> list[Pulse]:
        """DE around a reply."""
        bit = self.fmt.bit_ps
        if self.has("never raises DE"):
            return []
        rise, fall = start - bit / 2, start + length + 0.5 * bit
        if self.has("raises DE 60 bits too soon"):
            rise = start - 60 * bit
        if self.has("drops DE a bit too soon"):
            fall = start + length - 1.0 * bit
        if self.has("holds DE for 60 bits"):
            fall = start + length + 60 * bit
        pulses = [Pulse(round(rise), None if self.has("never lowers DE") else round(fall))]
        if self.has("raises DE twice"):
            pulses.append(Pulse(round(fall + bit), round(fall + 2 * bit)))
        return pulses
