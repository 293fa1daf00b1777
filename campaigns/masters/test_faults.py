# SPDX-License-Identifier: Apache-2.0
"""`rtu2fc` as the master of pymodbus' slave with its faults, and the virtual card among others' traffic."""

from __future__ import annotations

import asyncio
import threading
import time

import pytest
from pymodbus import FramerType
from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from campaigns.masters.faults import FAULTS, TRAFFIC, Fault, Traffic
from regs.dialects import STANDARD
from sim.card.run_card import RunningCard
from sim.card.test_virtual_card import RawPort
from sw.rtu2fc import card, cli, port
from tb.agents.crc16 import with_crc

INDEX, DRIVE_TIMEOUT, PARAMETERS = 8, 2, (3019, 3029)  # registers on-wire
DELAYS_S = {"delay": 0.3, "slow": card.ANSWER_S + 0.5, "late": 4.0}
APART_S = 2.0
RIGHT = [
    "302 Minimum reference = 1.500 Hz  (raw 1500, conversion -3)",
    "303 Maximum reference = 50.000 Hz  (raw 50000, conversion -3)",
]


class Server(ModbusTcpServer):
    """Keeps its connections: a reply may come in parts."""

    def callback_new_connection(self):
        self.newest = super().callback_new_connection()
        return self.newest


class PymodbusSlave(threading.Thread):
    """A slave with two parameters behind RTU over TCP. `fault` spoils the replies with their registers."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.fault, self.port = "", 0
        self.ready, self.loop = threading.Event(), asyncio.new_event_loop()
        self.start()
        assert self.ready.wait(30)

    def run(self) -> None:
        self.loop.run_until_complete(self.serve())

    async def serve(self) -> None:
        there = {DRIVE_TIMEOUT: [15], INDEX: [0], PARAMETERS[0]: [0, 1500], PARAMETERS[1]: [0, 50000]}
        values = [SimData(at, values=words, datatype=DataType.REGISTERS) for at, words in there.items()]
        device = SimDevice(1, simdata=values, action=self.act)
        self.server = Server(device, framer=FramerType.RTU, address=("127.0.0.1", 0), trace_packet=self.spoil)
        await self.server.serve_forever(background=True)
        self.port = self.server.transport.sockets[0].getsockname()[1]
        self.ready.set()
        await self.server.serving

    async def act(self, function, start, address, count, registers, values) -> ExcCodes | None:
        if address not in PARAMETERS:
            return None
        await asyncio.sleep(DELAYS_S.get(self.fault, 0))
        return ExcCodes.DEVICE_FAILURE if self.fault == "error" else None

    def send(self, data: bytes) -> None:
        self.server.newest.transport.write(data)

    def flood(self) -> None:
        if self.fault == "endless" and not self.server.newest.transport.is_closing():
            self.send(bytes(range(200)))
            self.loop.call_later(0.01, self.flood)

    def spoil(self, sending: bool, data: bytes) -> bytes:
        if not sending or len(data) != 9:  # the reply with two registers
            return data
        if self.fault in ("split", "apart"):
            self.loop.call_later(0.04 if self.fault == "split" else APART_S, self.send, data[5:])
        if self.fault == "endless":
            self.flood()
        if self.fault == "close":
            self.server.newest.transport.abort()
        return {
            "split": data[:5],
            "apart": data[:5],
            "cut": data[:5],
            "empty": b"",
            "close": b"",
            "junk": bytes(range(1, 11)),
            "bit": data[:4] + bytes([data[4] ^ 1]) + data[5:],
            "unit": with_crc(b"\2" + data[1:-2]),
            "other": with_crc(b"\1\3\2\0\1"),
        }.get(self.fault, data)

    def stop(self) -> None:
        asyncio.run_coroutine_threadsafe(self.server.shutdown(), self.loop)
        self.join(30)


@pytest.fixture(scope="module")
def slave():
    running = PymodbusSlave()
    yield running
    running.stop()


@pytest.fixture
def read(slave, capsys, monkeypatch):
    """The command in this process. A busy machine splits a reply by itself, so that it waits longer."""
    monkeypatch.setattr(cli.signal, "signal", lambda *_: None)
    assert port.SLACK_S > 0.04
    monkeypatch.setattr(port, "SLACK_S", 0.5)

    def run() -> tuple[int, list[str]]:
        # pymodbus has no exception for an unknown function, so that it does not tell its dialect.
        code = cli.main(["read", f"socket://127.0.0.1:{slave.port}", "302", "303", "--dialect", STANDARD])
        output, errors = capsys.readouterr()
        return code, (output + errors).splitlines()

    return run


@pytest.mark.nightly
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_of_the_slave_is_one_line_and_the_next_request_works(slave, read, fault: Fault):
    slave.fault = fault.name
    code, lines = read()
    slave.fault = ""
    assert code == fault.code, lines
    if code == 0:
        assert lines == RIGHT
    else:
        assert fault.says in lines[0]
        assert all(line.startswith("  ") or fault.says in line for line in lines[1:])
    assert read() == (0, RIGHT)


@pytest.mark.nightly
@pytest.mark.parametrize("traffic", TRAFFIC, ids=lambda traffic: traffic.title)
def test_the_card_among_the_traffic_of_others(tmp_path, traffic: Traffic):
    with RunningCard(tmp_path, "--quiet") as running, RawPort(running.link) as master:
        for frame in (*traffic.sent, "01 03 0002 0001"):
            parts = frame.removeprefix("+ ").split(" & ")
            data = [bytes.fromhex(part) for part in parts]
            sent = data[0] if frame.startswith("+") else b"".join(map(with_crc, data))
            before = len(running.frames())
            master.write(sent)
            assert running.wait_for_frames(before, "modbus", "master", 30)
            if sent[0] == 1 and not frame.startswith("+"):
                running.wait_for_frames(before, "modbus", "card", 30)
            time.sleep(0.04)
        assert running.stop() == 0
        *replies, last = [f for f in running.frames() if (f.line, f.sender) == ("modbus", "card")]
    assert last.data == with_crc(bytes.fromhex("01 03 02 000F"))
    assert len(replies) == traffic.answers and all(reply.data[0] == 1 for reply in replies)
