# SPDX-License-Identifier: Apache-2.0
"""A model slave with one planted fault or none, in virtual time. The suite is tested against it.

`Slave` turns frames into replies. `ModelLine` is the driver around it: it plays the edges of each
transmission to a model receiver, and returns the edges of the reply.
"""

from __future__ import annotations

from campaigns.conformance.cases import BYTES, EDGES, PARITY, PINS, Heard, Profile, Send
from tb.agents import rtu
from tb.agents.crc16 import crc_good
from tb.agents.edges import Trace
from tb.agents.rs485 import Pulse
from tb.agents.uart import Character, Flaws, Format, waveform, with_gaps

# Each fault has the number of the test that must find it.
FAULTS = {
    "replies with address 0": "SL-1",
    "replies with a swapped CRC": "SL-1",
    "adds a byte to each reply": "SL-1",
    "replies with another function": "SL-1",
    "answers every unit": "SL-2",
    "answers unit 255": "SL-2",
    "obeys writes for others": "SL-3",
    "ignores broadcasts": "SL-4",
    "answers broadcasts": "SL-5",
    "is silent after a broadcast": "SL-5",
    "accepts any CRC": "SL-6",
    "accepts a swapped CRC": "SL-6",
    "writes before it checks the CRC": "SL-6",
    "compares the low byte of the CRC only": "SL-6",
    "keeps a part of a frame": "SL-7",
    "hangs after a long frame": "SL-8",
    "answers a long frame with five bytes": "SL-8",
    "loses a request after foreign traffic": "SL-9",
    "loses a request after noise": "SL-10",
    "takes gaps of a character as an end": "SL-11",
    "accepts gaps beyond 1.5 characters": "SL-12",
    "needs 5 characters between frames": "SL-13",
    "ends a frame after 2 characters": "SL-14",
    "accepts a write that a byte follows": "SL-15",
    "replies after 2 characters": "SL-16",
    "replies with gaps": "SL-17",
    "ignores parity": "SL-18",
    "ignores stop bits": "SL-19",
    "sends odd parity": "SL-20",
    "sends without parity": "SL-20",
    "sends 1.5 % too slow": "SL-21",
    "receives 4 % too fast": "SL-22",
    "hangs after a break": "SL-23",
    "drops DE a bit too soon": "SL-24",
    "holds DE for 60 bits": "SL-24",
    "never raises DE": "SL-24",
    "never lowers DE": "SL-24",
    "raises DE for every frame": "SL-24",
    "is deaf for 60 bits after a reply": "SL-25",
    "counts registers, not bytes": "AP-1",
    "sends one register only": "AP-1",
    "06 does not write": "AP-2",
    "06 echoes the address only": "AP-2",
    "16 writes the first register only": "AP-3",
    "16 echoes the data": "AP-3",
    "16 swaps the bytes": "AP-3",
    "sends exception 2 for a wrong quantity": "AP-4",
    "reads 126 registers": "AP-4",
    "has every register": "AP-5",
    "sends exception 3 for a wrong address": "AP-5",
    "wraps beyond 65535": "AP-5",
    "writes to no register": "AP-6",
    "ignores the byte count": "AP-7",
    "16 of nothing is good": "AP-8",
    "pads coils with ones": "AP-9",
    "05 inverts the coil": "AP-10",
    "05 takes any value": "AP-11",
    "packs coils from the highest bit": "AP-12",
    "reads 2001 coils": "AP-13",
    "has every coil": "AP-14",
    "is silent for an unknown function": "AP-15",
    "sends exceptions without 80h": "AP-15",
    "sends exceptions without a code": "AP-15",
    "answers function 131": "AP-16",
    "answers function 0 with five bytes": "AP-16",
    "ignores the length": "AP-17",
}
REGISTERS, COILS = 8, 16
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3


class Refused(Exception):
    """The request gets an exception with this code."""


class Slave:
    """Registers, coils, and the reply to each frame, with one fault or none."""

    def __init__(self, unit: int = 1, fault: str | None = None):
        assert fault is None or fault in FAULTS, fault
        self.unit, self.fault = unit, fault
        self.registers, self.coils = [0] * REGISTERS, [False] * COILS
        self.kept = b""
        self._sleeps = False

    def has(self, fault: str) -> bool:
        return self.fault == fault

    # ------------------------------------------------------------ a frame

    def reply(self, frame: bytes) -> bytes | None:
        """The reply to a frame with good characters and silences; its CRC may be wrong."""
        if self._sleeps:
            return None
        if self.has("keeps a part of a frame"):
            frame, self.kept = self.kept + frame, b"" if crc_good(self.kept + frame) else self.kept + frame
        if self.has("writes before it checks the CRC") and frame[:1] == bytes([self.unit]):
            self._answer(frame[1:-2])
        if not self._crc_good(frame):
            return None
        address, pdu = frame[0], frame[1:-2]
        others = address not in (0, self.unit)
        if others and self.has("obeys writes for others"):
            self._answer(pdu)
        if (
            others
            and not self.has("answers every unit")
            and not (address == 255 and self.has("answers unit 255"))
        ):
            return None
        if address == 0 and self.has("ignores broadcasts"):
            return None
        self._sleeps = address == 0 and self.has("is silent after a broadcast")
        if pdu[0] == 0 and self.has("answers function 0 with five bytes"):
            return rtu.build(self.unit, bytes(2))
        answer = self._answer(pdu)
        if answer is None or (address == 0 and not self.has("answers broadcasts")):
            return None
        if self.has("replies with another function"):
            answer = bytes([answer[0] ^ 1]) + answer[1:]
        sent = rtu.build(0 if self.has("replies with address 0") else self.unit, answer)
        if self.has("replies with a swapped CRC"):
            sent = sent[:-2] + sent[:-3:-1]
        return sent + b"\0" if self.has("adds a byte to each reply") else sent

    def _crc_good(self, frame: bytes) -> bool:
        if len(frame) < 4:
            return False
        if self.has("accepts any CRC") or crc_good(frame):
            return True
        if self.has("accepts a swapped CRC"):
            return crc_good(frame[:-2] + frame[:-3:-1])
        low = rtu.build(frame[0], frame[1:-2])[-2]
        return self.has("compares the low byte of the CRC only") and frame[-2] == low

    # ------------------------------------------------------------ a request

    def _answer(self, pdu: bytes) -> bytes | None:
        function = pdu[0]
        try:
            return self._served(function, pdu)
        except Refused as refused:
            code = refused.args[0]
        if code == ILLEGAL_FUNCTION and self.has("is silent for an unknown function"):
            return None
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
            3: self._read,
            5: self._write_coil,
            6: self._write,
            15: self._write_coils,
            16: self._write_many,
        }
        if function not in serve:
            raise Refused(ILLEGAL_FUNCTION)
        if len(pdu) < 5 and self.has("ignores the length"):
            pdu = pdu.ljust(5, b"\0")
        if len(pdu) < 5 or (
            function in (1, 3, 5, 6) and len(pdu) != 5 and not self.has("ignores the length")
        ):
            raise Refused(ILLEGAL_VALUE)
        return serve[function](pdu, int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big"))

    def _in(self, first: int, count: int, size: int, every: bool) -> int:
        if first + count > 0x10000 and self.has("wraps beyond 65535"):
            return 0
        if first + count > size and not (every and first + count <= 0x10000):
            raise Refused(ILLEGAL_ADDRESS)
        return first if first + count <= size else 0

    def _quantity(self, good: bool) -> None:
        if not good:
            raise Refused(
                ILLEGAL_ADDRESS if self.has("sends exception 2 for a wrong quantity") else ILLEGAL_VALUE
            )

    def _read(self, pdu: bytes, first: int, count: int) -> bytes:
        if count == 126 and self.has("reads 126 registers"):
            return bytes([3, 252, *bytes(248)])
        self._quantity(1 <= count <= 125)
        first = self._in(first, count, REGISTERS, self.has("has every register"))
        words = [value.to_bytes(2, "big") for value in self.registers[first : first + count]]
        if self.has("sends one register only"):
            words = words[:1]
        size = count if self.has("counts registers, not bytes") else 2 * len(words)
        return bytes([3, size]) + b"".join(words)

    def _write(self, pdu: bytes, first: int, value: int) -> bytes:
        first = self._in(first, 1, REGISTERS, self.has("writes to no register"))
        if not self.has("06 does not write"):
            self.registers[first] = value
        return pdu[:3] if self.has("06 echoes the address only") else pdu[:5]

    def _write_many(self, pdu: bytes, first: int, count: int) -> bytes:
        if count == 0 and self.has("16 of nothing is good"):
            return pdu[:5]
        right = len(pdu) == 6 + pdu[5] and pdu[5] == 2 * count if len(pdu) > 5 else False
        self._quantity(1 <= count <= 123 and (right or self.has("ignores the byte count")))
        first = self._in(first, count, REGISTERS, False)
        order = "little" if self.has("16 swaps the bytes") else "big"
        for n in range(1 if self.has("16 writes the first register only") else count):
            self.registers[first + n] = int.from_bytes(pdu[6 + 2 * n : 8 + 2 * n], order)
        return pdu if self.has("16 echoes the data") else pdu[:5]

    def _read_coils(self, pdu: bytes, first: int, count: int) -> bytes:
        if count == 2001 and self.has("reads 2001 coils"):
            return bytes([1, 251, *bytes(247)])
        self._quantity(1 <= count <= 2000)
        first = self._in(first, count, COILS, self.has("has every coil"))
        size = (count + 7) // 8
        bits = sum(on << n for n, on in enumerate(self.coils[first : first + count]))
        if self.has("pads coils with ones"):
            bits |= (1 << 8 * size) - (1 << count)
        return bytes([1, size]) + bits.to_bytes(size, "little")

    def _write_coil(self, pdu: bytes, first: int, value: int) -> bytes:
        if value not in (0, 0xFF00) and not self.has("05 takes any value"):
            raise Refused(ILLEGAL_VALUE)
        first = self._in(first, 1, COILS, False)
        self.coils[first] = (value == 0xFF00) ^ self.has("05 inverts the coil")
        return pdu[:5]

    def _write_coils(self, pdu: bytes, first: int, count: int) -> bytes:
        size = (count + 7) // 8
        self._quantity(1 <= count <= 0x7B0 and len(pdu) == 6 + size and pdu[5] == size)
        first = self._in(first, count, COILS, False)
        for n in range(count):
            place = 7 - n % 8 if self.has("packs coils from the highest bit") else n % 8
            self.coils[first + n] = bool(pdu[6 + n // 8] >> place & 1)
        return pdu[:5]


class ModelLine:
    """The driver: a slave with its receiver and sender on a line in virtual time."""

    sees = frozenset({BYTES, EDGES, PARITY, PINS})

    def __init__(self, profile: Profile, fault: str | None = None):
        self.profile, self.slave = profile, Slave(profile.unit, fault)
        self.fmt = profile.fmt
        self._end_ps = 0.0
        self._edges: list[tuple[int, int]] = []  # not read by the slave yet
        self._pause_bits = float("inf")
        self._deaf = self._spoilt = False

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
            return Heard()
        heard = self._heard(end)
        self._edges = []
        return heard

    # ------------------------------------------------------------ receiving

    def _heard(self, end: float) -> Heard:
        """The reply to the last frame. Earlier frames of the same transmission are obeyed without a reply."""
        reply, pulses = None, []
        for frame in self._frames():
            reply = self._obeyed(frame)
        if self.has("raises DE for every frame"):
            pulses.append(Pulse(round(end + self.t35_ps), round(end + 1.5 * self.t35_ps)))
        if reply is None:
            return Heard(pulses=pulses, trace=Trace(self.fmt, []), request_end_ps=end)
        return self._sent(reply, end)

    def _characters(self) -> list[Character]:
        fast = self.has("receives 4 % too fast")
        fmt = Format(round(self.fmt.baud * 1.04), self.fmt.parity, self.fmt.stop_bits) if fast else self.fmt
        return Trace(fmt, self._edges).characters

    def _frames(self) -> list[tuple[bytes, bool]]:
        """Bytes of each frame, and whether its characters and silences were good."""
        characters = self._characters()
        frames: list[tuple[bytes, bool]] = []
        inner = self.t15_ps * (0.6 if self.has("takes gaps of a character as an end") else 1.0)
        outer = self.t35_ps
        if self.has("ends a frame after 2 characters"):
            outer = inner * 2 / 1.5
        if self.has("needs 5 characters between frames"):
            outer = self.t35_ps * 5 / 3.5
        last_end = float("-inf")
        for c in characters:
            good = (c.parity_ok or self.has("ignores parity")) and (
                c.stop_ok or self.has("ignores stop bits")
            )
            gap = c.start_ps - last_end
            last_end = c.end_ps
            if gap >= outer - 2:
                frames.append((bytes([c.byte]), good))
                continue
            data, so_far = frames[-1]
            if gap > inner:
                if self.has("accepts a write that a byte follows") and crc_good(data):
                    continue
                so_far &= self.has("accepts gaps beyond 1.5 characters")
            frames[-1] = (data + bytes([c.byte]), so_far and good)
        return frames

    def _obeyed(self, frame: tuple[bytes, bool]) -> bytes | None:
        data, good = frame
        if self._deaf or (self._pause_bits < 60 and self.has("is deaf for 60 bits after a reply")):
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
        if len(data) > 256:
            return bytes(5) if self.has("answers a long frame with five bytes") else None
        return None if lost or not good else self.slave.reply(data)

    # ------------------------------------------------------------ sending

    def _sent(self, reply: bytes, end: float) -> Heard:
        fmt, bit, flaws = self.fmt, self.fmt.bit_ps, Flaws()
        if self.has("sends odd parity"):
            fmt = Format(fmt.baud, "O", fmt.stop_bits)
        if self.has("sends without parity"):
            fmt = Format(fmt.baud, "N", 1)
        if self.has("sends 1.5 % too slow"):
            flaws = Flaws(ppm=-15_000)
        if self.has("replies with gaps"):
            flaws = with_gaps(len(reply), 2 * self.t15_ps / bit)
        start = end + (
            self.t15_ps * 2 / 1.5 if self.has("replies after 2 characters") else self.t35_ps + bit / 2
        )
        edges, length = waveform(fmt, reply, flaws)
        trace = Trace(self.fmt, [(round(start + at), level) for at, level in edges])
        fall = start + length + (0.5 * bit)
        if self.has("drops DE a bit too soon"):
            fall = start + length - 1.0 * bit
        if self.has("holds DE for 60 bits"):
            fall = start + length + 60 * bit
        self._end_ps = start + length
        pulses = [Pulse(round(start - bit / 2), None if self.has("never lowers DE") else round(fall))]
        if self.has("never raises DE"):
            pulses = []
        return Heard(bytes(c.byte for c in trace.characters), trace, pulses, end)
