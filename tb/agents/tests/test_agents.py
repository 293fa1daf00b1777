# SPDX-License-Identifier: Apache-2.0
"""The agents on a simulated wire (wire_bench.py), and their parts that need no simulator."""

from __future__ import annotations

from pathlib import Path

import pytest
from cocotb_tools.runner import get_results, get_runner
from cocotbext.rtu import fc_slave
from cocotbext.rtu.uart import Flaws, Format, waveform

HERE = Path(__file__).parent
DATA = b"\x00\xff\x55\xaa\x01\x80\x7e"
BUILD_ARGS = {"icarus": [], "verilator": ["-Wno-fatal", "--no-timing"]}


def test_agents(sim, tmp_path):
    runner = get_runner(sim)
    names = {"hdl_toplevel": "wire_bench", "build_dir": tmp_path}
    sources = [HERE / "wire_bench.v"]
    runner.build(sources=sources, build_args=BUILD_ARGS[sim], timescale=("1ns", "1ps"), **names)
    results = runner.test(test_module="wire_bench", test_dir=tmp_path, hdl_toplevel_lang="verilog", **names)
    ran, failed = get_results(results)
    assert ran and not failed


def test_an_exact_waveform_is_decided_without_a_simulator():
    fmt = Format.named(9600, "8N1")
    played, length = waveform(fmt, b"\x01", Flaws())
    bit = fmt.bit_ps
    assert [level for _, level in played] == [0, 1, 0, 1]
    assert [at / bit for at, _ in played] == pytest.approx([0, 1, 2, 9])
    assert length == pytest.approx(10 * bit)


def test_jitter_moves_each_edge_within_its_limit_and_repeats_by_its_seed():
    fmt = Format.named(9600, "8E1")
    exact, _ = waveform(fmt, DATA, Flaws())
    moved = {seed: waveform(fmt, DATA, Flaws(jitter=0.1, jitter_seed=seed))[0] for seed in (1, 2)}
    assert moved[1] == waveform(fmt, DATA, Flaws(jitter=0.1, jitter_seed=1))[0] != moved[2]
    # A jitter before the first edge shifts the whole transmission by up to as much again.
    places = [(at - due) / fmt.bit_ps for (at, _), (due, _) in zip(moved[1], exact, strict=True)]
    assert 0.1 < max(places) - min(places) <= 0.2


@pytest.mark.parametrize("fault", fc_slave.FAULTS)
def test_each_fault_of_the_drive_differs_from_a_good_reply(fault):
    """In its bytes or in its line, and every two faults from each other."""
    reply = bytes.fromhex("02 06 81 0F 03 20 00 A9")
    sent = {name: make(reply) for name, make in fc_slave.FAULTS.items()}
    assert sent[fault] != (reply, Flaws())
    assert [name for name, other in sent.items() if other == sent[fault]] == [fault]


def test_a_script_reports_each_telegram_that_differs():
    script = fc_slave.Script([(b"one", b"reply"), (b"two", None)])
    assert (script(b"one"), script(b"2"), script(b"three")) == (b"reply", None, None)
    with pytest.raises(AssertionError, match="telegram 32 instead of 74 77 6f; unexpected telegram 74"):
        script.check()
    with pytest.raises(AssertionError, match="never sent: 6f 6e 65"):
        fc_slave.Script([(b"one", None)]).check()
