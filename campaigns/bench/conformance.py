# SPDX-License-Identifier: Apache-2.0
"""The network side of the card against the requirements of a Modbus RTU slave, row by row.

Other open slaves were measured with the same rows and units (bits of the line); the silence after the card's
own reply is an additional row. Limits are found by halving the interval, so each number is the point where
the card's behaviour changes.
"""

from __future__ import annotations

from collections.abc import Callable

from campaigns.bench.card import MODBUS, STANDARD, UNIT_ADDRESS, Bench, Build, Talk
from campaigns.bench.judge import T35_ACCURACY_BITS, Outcome, measure
from campaigns.bench.traffic import FOREIGN, example_drive
from tb.agents import rtu
from tb.model import card as card_model
from tb.model.wire import LineFormat

RESOLUTION_BITS = 0.02
RESOLUTION_RATE = 0.001
AFTER_T35_BITS = 6.5  # pause before the good frame in the rows with a disturbance: 45 bits up to 19200 bit/s
TOLERANCE = 0.04  # LINE-5
READ = rtu.build(UNIT_ADDRESS, rtu.read_coils(0, 8))
FOREIGN_READ = rtu.build(FOREIGN, rtu.read_coils(0, 8))
# Many edges and few edges.
PATTERNS = (
    READ,
    rtu.build(UNIT_ADDRESS, rtu.write_register(1, 0x5555)),
    rtu.build(UNIT_ADDRESS, rtu.write_registers(0, [0, 0xFFFF, 0xFF])),
)
ROWS = {
    "inside": "largest idle inside a frame still accepted (bits)",
    "foreign": "smallest idle after a foreign frame (bits)",
    "own": "smallest idle after its own reply (bits)",
    "latency": "reply latency, request end → start bit (bits)",
    "de": "DE before first / after last bit (bits)",
    "rate": "baud tolerance, sender slow / fast",
    "damage": "parity error / framing error in frame",
    "crc": "bad CRC",
    "function": "unsupported FC 0x2B",
    "arguments": "bad address / qty 0 / qty 126",
    "noise": "noise byte, 45 bits, good frame",
    "truncated": "truncated frame, 45 bits, good frame",
    "glitch": "0.3-bit glitch, 45 bits, good frame",
    "break": "30-bit break, 45 bits, good frame",
}


def boundary(passes: Callable[[float], bool], good: float, bad: float, resolution: float) -> float:
    """The last value on the good side."""
    if not passes(good) or passes(bad):
        return float("nan")
    while abs(good - bad) > resolution:
        middle = (good + bad) / 2
        good, bad = (middle, bad) if passes(middle) else (good, middle)
    return good


def conformance(baud: int, form: str, build: Build = STANDARD) -> Outcome:
    line = LineFormat(baud, form, build.clk_hz)
    bench = Bench(line, build=build, drive=example_drive())
    outcome, rows = Outcome(), {}
    here = f"at {baud} {form}"

    def ready() -> float:
        """Earliest time at which the card is idle and expects a frame."""
        bench.idle_until(bench.next_start(5))
        return bench.now + 1.0

    def send(data: bytes, start: float, error: float = 0.0, **how: object) -> Talk:
        return Talk(data, start, bench.send(MODBUS, data, start, error=error, **how))

    def answered(talk: Talk, error: float = 0.0) -> bool:
        """Whether the one right reply came; any other reply is a fault. All these requests are local."""
        bench.follow(talk)
        if talk.request != FOREIGN_READ:
            where = f"{talk.request.hex(' ')} {here}"
            outcome.add(measure(bench, talk, "conformance", error), where)
            due = rtu.build(UNIT_ADDRESS, card_model.CardModel().request(talk.request[1:-2]).reply)
            outcome.compare(talk, [], due if talk.answers else None, where)
        return bool(talk.answers)

    def after(disturbance: Callable[[float], float]) -> str:
        """Outcome of a disturbance, a silence and a good frame."""
        end = disturbance(ready())
        good = answered(send(READ, end + (line.t35_bits + AFTER_T35_BITS) * line.bit))
        outcome.check(good, f"good frame lost after a disturbance {here}")
        return "answered" if good else "lost"

    def low(bits: float) -> Callable[[float], float]:
        def play(start: float) -> float:
            bench.play(MODBUS, [(start, 0), (start + bits * line.bit, 1)])
            return start + bits * line.bit

        return play

    def after_own(bits: float) -> bool:
        answered(send(READ, ready()))
        start = bench.silent_since[MODBUS] + bits * line.bit
        bench.idle_until(start)
        return answered(send(READ, start))

    # Silences.
    inside = boundary(
        lambda bits: answered(send(READ, ready(), gaps={4: bits})), 5, line.t15_bits + 20, RESOLUTION_BITS
    )
    foreign = boundary(
        lambda bits: answered(send(READ, send(FOREIGN_READ, ready()).request_end + bits * line.bit)),
        line.t35_bits + 20,
        1,
        RESOLUTION_BITS,
    )
    own = boundary(after_own, line.t35_bits + 20, 1, RESOLUTION_BITS)
    rows["inside"], rows["foreign"], rows["own"] = f"{inside:.1f}", f"{foreign:.1f}", f"{own:.1f}"
    # FRAME-1: accurate to a quarter of a bit.
    for what, limit, ideal in (
        ("t1.5", inside, line.t15_bits),
        ("t3.5", foreign, line.t35_bits),
        ("t3.5 after the own reply", own, line.t35_bits),
    ):
        right = abs(limit - ideal) <= T35_ACCURACY_BITS + RESOLUTION_BITS
        outcome.check(right, f"{what} {here}: {limit:.2f} bits instead of {ideal:.2f} (FRAME-1)")

    # The reply.
    talk = send(READ, ready())
    outcome.check(answered(talk), f"no reply {here}")
    if talk.answers:
        rows["latency"] = f"{(talk.reply_start - talk.request_end) / line.bit:.1f}"
        sample = outcome.samples[-1]
        lead, lag = sample.de_lead["modbus"][0], sample.de_lag["modbus"][0]
        rows["de"] = f"{lead:.2f} / {abs(lag):.2f}"
    else:
        rows["latency"] = rows["de"] = "no reply"

    # The sender's rate.
    def understands(error: float) -> bool:
        return all(answered(send(pattern, ready(), error=error), error) for pattern in PATTERNS)

    slow = boundary(lambda error: understands(-error), 0, 0.15, RESOLUTION_RATE)
    fast = boundary(understands, 0, 0.15, RESOLUTION_RATE)
    rows["rate"] = f"{100 * slow:.1f} / {100 * fast:.1f} %"
    if baud * 64 <= build.clk_hz:
        outcome.check(min(slow, fast) >= TOLERANCE, f"tolerance {here}: {slow:.3f} {fast:.3f} (LINE-5)")

    # Damage.
    def silent(name: str, data: bytes, **how: object) -> str:
        quiet = not answered(send(data, ready(), **how))
        outcome.check(quiet, f"{name} {here}: answered (FRAME-4)")
        return "silent" if quiet else "answered"

    parity = "n.a." if not line.parity else silent("parity error", READ, bad_parity=2)
    rows["damage"] = f"{parity} / {silent('framing error', READ, bad_stop=2)}"
    rows["crc"] = silent("bad CRC", READ[:-1] + bytes([READ[-1] ^ 1]))

    # Requests that cannot be served: the card's own codes (EXC).
    def code(pdu: bytes, expected: int) -> str:
        talk = send(rtu.build(UNIT_ADDRESS, pdu), ready())
        found = talk.reply[2] if answered(talk) and len(talk.reply) == 5 else None
        outcome.check(found == expected, f"{pdu.hex(' ')} {here}: exception {found}")
        return "silent" if found is None else str(found)

    rows["function"] = "exc " + code(bytes([0x2B, 0x0E, 0x01, 0x00]), 67)
    rows["arguments"] = " / ".join(
        code(rtu.read_registers(start, count), expected)
        for start, count, expected in ((0xFFF0, 2, 64), (0, 0, 66), (0, 126, 66))
    )

    # Disturbances.
    rows["noise"] = after(lambda start: send(b"\x55", start).request_end)
    rows["truncated"] = after(lambda start: send(READ[:5], start).request_end)
    rows["glitch"] = after(low(0.3))
    rows["break"] = after(low(30))
    outcome.rows = rows
    return outcome.finish(bench)
