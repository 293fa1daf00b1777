# SPDX-License-Identifier: Apache-2.0
"""The fast part of the measuring bench: a case over its limit fails.

The card runs at its own clock and is measured on the pins (campaigns/bench). Times are simulated: a busy
machine changes nothing. The second half tampers with measurements in each way that the judge must detect.
"""

from __future__ import annotations

import copy
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from campaigns.bench import fingerprint
from campaigns.bench.card import EXTRA_SILENCE_BITS, UNIT_ADDRESS, Bench
from campaigns.bench.cases import CASES, Model, random_requests
from campaigns.bench.conformance import boundary
from campaigns.bench.judge import Outcome, measure
from campaigns.bench.traffic import example_drive
from campaigns.bench.wave import CLK_HZ, edges_of
from campaigns.bench.work import Piece, fast
from sim.harness.pins import decode
from sw.tools import stack
from tb.agents import rtu
from tb.lib.rows import each_row
from tb.model.card import Step
from tb.model.fc_telegram import build_process
from tb.model.wire import CardCharacter, LineFormat, drive_line

SEED = int(os.environ.get("COCOTB_RANDOM_SEED", "1"))
PIECES = list(fast(SEED))
# `make test` takes these of the pieces of `make bench-fast`, the nightly run all.
DAILY = (
    *("standard-turnaround-19200-8E1", "standard-turnaround-115200-8E1", "standard-random-1200-8N1"),
    *("standard-gate-19200-8E1", "standard-gate-115200-8E1", "standard-overtaken-115200-8E1"),
)


def pieces(*kinds: str) -> pytest.MarkDecorator:
    chosen = [piece for piece in PIECES if piece.kind in kinds]
    marks = {piece.name: [] if piece.name in DAILY else [pytest.mark.nightly] for piece in chosen}
    return pytest.mark.parametrize(
        "piece", [pytest.param(piece, id=piece.name, marks=marks[piece.name]) for piece in chosen]
    )


def run(piece: Piece) -> None:
    print(f"repeat with COCOTB_RANDOM_SEED={SEED}")
    outcome = piece.run()
    assert not outcome.faults, "\n".join(outcome.faults)
    assert outcome.checks, "nothing was checked"


@pytest.mark.rule("PERF-1", "PERF-2", "PERF-3", "FRAME-8")
@pieces("turnaround")
def test_turnaround_keeps_its_limits(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("FRAME-6", "FRAME-3")
@pieces("gate")
def test_character_between_t15_and_t35_revokes_the_frame(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("FRAME-7")
@pieces("overtaken")
def test_newer_frame_while_the_drive_answers(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("PERF-1", "PERF-2", "PERF-3", "EXC", "FRAME-4")
@pieces("random")
def test_random_requests_have_no_outlier(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("FRAME-1", "LINE-5", "LINE-6")
@pieces("conformance")
def test_conformance_rows(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("FC-8", "FC-9", "EXC")
@pieces("drive_faults")
def test_faults_of_the_drive(piece: Piece) -> None:
    run(piece)


# ---------------------------------------------------------------- the judge


# Outputs of a broken card, made from edges of the real one: edges in, changed edges out.
Edges = dict[str, list[tuple[float, int]]]
RATE = 115200
LINE, DRIVE_LINE = LineFormat(RATE, "8E1", CLK_HZ), drive_line(CLK_HZ)
LINES = {"modbus": LINE, "drive": DRIVE_LINE}


def characters(line: str, edges: Edges) -> list[CardCharacter]:
    return decode(LINES[line], edges[f"{line}_tx"], 0)


def later(name: str, bits: float, level: int | None = None) -> Callable[[Edges], None]:
    """Moves edges of one signal: those to one level, or all."""
    by = bits * LINES[name.split("_")[0]].bit

    def change(edges: Edges) -> None:
        edges[name] = [(at + by * (level in (None, to)), to) for at, to in edges[name]]

    return change


def both(one: Callable[[Edges], None], other: Callable[[Edges], None]) -> Callable[[Edges], None]:
    def change(edges: Edges) -> None:
        one(edges)
        other(edges)

    return change


def doubled(line: str) -> Callable[[Edges], None]:
    """Repeats a frame ten characters after it."""

    def change(edges: Edges) -> None:
        driven = edges[f"{line}_de"]
        by = driven[-1][0] - driven[0][0] + 10 * LINES[line].character_bits * LINES[line].bit
        for name in (f"{line}_tx", f"{line}_de"):
            edges[name] = edges[name] + [(at + by, to) for at, to in edges[name]]

    return change


def rewritten(line: str, like: LineFormat) -> Callable[[Edges], None]:
    """The same bytes at another rate or in another format."""

    def change(edges: Edges) -> None:
        sent = characters(line, edges)
        edges[f"{line}_tx"] = edges_of(like, bytes(c.byte for c in sent), sent[0].start)

    return change


def gap(line: str, after: int, bits: float) -> Callable[[Edges], None]:
    """Idle time between two characters with the driver on."""

    def change(edges: Edges) -> None:
        place = characters(line, edges)[after].end - 1
        for name in (f"{line}_tx", f"{line}_de"):
            edges[name] = [(at + bits * LINES[line].bit * (at > place), to) for at, to in edges[name]]

    return change


def other_byte(line: str) -> Callable[[Edges], None]:
    def change(edges: Edges) -> None:
        sent = characters(line, edges)
        data = bytes(c.byte for c in sent)
        edges[f"{line}_tx"] = edges_of(LINES[line], data[:-1] + bytes([data[-1] ^ 1]), sent[0].start)

    return change


def nothing(line: str) -> Callable[[Edges], None]:
    def change(edges: Edges) -> None:
        edges[f"{line}_tx"], edges[f"{line}_de"] = [], []

    return change


def extra(name: str, at: float, bits: float) -> Callable[[Edges], None]:
    """A pulse at a time in s, before all other edges."""

    def change(edges: Edges) -> None:
        level = int(name.endswith("_de"))
        start = at * LINE.clk_hz
        edges[name] = [(start, level), (start + bits * LINE.bit, 1 - level), *edges[name]]

    return change


class Kept(Bench):
    """The bench, which keeps the card's outputs as they were before the evaluation."""

    def _take(self, talk) -> None:
        self.kept, self.ended = copy.deepcopy((self.edges, talk)), self._card.now
        super()._take(talk)

    @property
    def now(self) -> int:
        return self.ended if hasattr(self, "ended") else self._card.now


@pytest.fixture(scope="module")
def started() -> Kept:
    """After one start of the motor. The card itself is no longer there."""
    with Kept(LINE, drive=example_drive()) as bench:
        request = rtu.build(UNIT_ADDRESS, CASES["start motor"].pdu)
        bench.ask(request, start=bench.next_start(EXTRA_SILENCE_BITS))
        return bench


def verdict_on(started: Kept, change: Callable[[Edges], None]) -> str:
    """Faults that the judge finds in the changed outputs."""
    case, outcome, model = CASES["start motor"], Outcome(), Model()
    started.edges, talk = copy.deepcopy(started.kept)
    change(started.edges)
    Bench._take(started, talk)
    outcome.add(measure(started, talk, case.name), "here")
    due = model.due(model.ask(case.pdu), talk)
    outcome.compare(talk, due.telegrams, due.reply, "here")
    return "; ".join(outcome.faults)


BROKEN = {
    "reply a bit late": (both(later("modbus_tx", 3), later("modbus_de", 3)), "PERF-3"),
    "reply before t3.5": (both(later("modbus_tx", -9000), later("modbus_de", -9000)), "FRAME-8"),
    "telegram a bit late": (both(later("drive_tx", 1), later("drive_de", 1)), "PERF-2"),
    "telegram a bit early": (both(later("drive_tx", -1), later("drive_de", -1)), "FRAME-1"),
    "DE rises too soon": (later("modbus_de", -0.9, 1), "modbus DE rises"),
    "DE rises too late": (later("modbus_de", 0.7, 1), "modbus (DE rises|line: .* driver off)"),
    "DE falls too late": (later("modbus_de", 1.1, 0), "modbus DE falls"),
    "DE falls too soon": (later("modbus_de", -0.5, 0), "modbus DE falls"),
    "drive DE rises too soon": (later("drive_de", -0.9, 1), "drive DE rises"),
    "drive DE falls too late": (later("drive_de", 1.1, 0), "drive DE falls"),
    "drive DE falls too soon": (later("drive_de", -0.5, 0), "drive DE falls"),
    "two replies": (doubled("modbus"), "2 replies.*rises 2 times"),
    "two telegrams": (doubled("drive"), "telegrams .*, .*drive_de rises 2 times"),
    "no reply": (nothing("modbus"), "replies none"),
    "another byte in the reply": (other_byte("modbus"), "replies "),
    "another byte in the telegram": (other_byte("drive"), "telegrams "),
    "odd parity": (rewritten("modbus", LineFormat(RATE, "8O1", CLK_HZ)), "malformed"),
    "drive's line without parity": (rewritten("drive", LineFormat(9600, "8N2", CLK_HZ)), "malformed"),
    "bits 1 % too long": (rewritten("modbus", LineFormat(round(RATE * 0.99), "8E1", CLK_HZ)), "LINE-4"),
    "drive bits 0.5 % too short": (
        rewritten("drive", LineFormat(9648, "8E1", CLK_HZ)),
        "LINE-4",
    ),
    "a gap in the reply": (gap("modbus", 3, 0.2), "bits between characters 3 and 4"),
    "a gap in the telegram": (gap("drive", 3, 0.2), "bits between characters 3 and 4"),
    "DE for nothing": (extra("modbus_de", 0.021, 1), "without a character.*rises 2 times"),
    "drive DE for nothing": (extra("drive_de", 0.021, 1), "without a character.*rises 2 times"),
    "a level with the driver off": (extra("modbus_tx", 0.021, 0.1), "driver off"),
}


def test_correct_card_passes(started) -> None:
    assert verdict_on(started, lambda edges: None) == ""


@each_row("broken", BROKEN)
def test_judge_detects(started, broken: str) -> None:
    change, expected = BROKEN[broken]
    assert re.search(expected, verdict_on(started, change))


def test_bench_detects_unrequested_traffic() -> None:
    """Between two requests, and after the last one."""
    outcome = Outcome()
    honest = Bench(LINE)
    real_run = honest.run

    def run_and_send(until, stops=()):
        now = real_run(until, stops)
        honest.edges["drive_de"] += [(now - 9, 1), (now - 8, 0)]
        return now

    honest.run = run_and_send
    outcome.finish(honest)
    assert "drive_de moves" in "".join(outcome.faults)


def test_bench_detects_an_image_that_the_drive_was_not_told() -> None:
    """SAFE-8: the image of a card that was just switched on is zero."""
    outcome, honest = Outcome(), Bench(LINE)
    honest.told = [(build_process(0x047C, 0x2000), True)]
    outcome.finish(honest)
    assert "(SAFE-8)" in "".join(outcome.faults)


def test_every_random_request_is_compared_with_the_model(monkeypatch) -> None:
    """Against a card whose model knows no parameter."""
    monkeypatch.setattr(Model, "ask", lambda *_, **__: Step(reply=bytes([0x83, 0x40])))
    outcome = random_requests(RATE, "8E1", 6, seed=SEED)
    assert any("replies" in fault or "telegrams" in fault for fault in outcome.faults)


def test_boundary_is_found_from_both_sides() -> None:
    assert boundary(lambda x: x <= 3, 0, 10, 0.01) == pytest.approx(3, abs=0.01)
    assert boundary(lambda x: x >= 3, 10, 0, 0.01) == pytest.approx(3, abs=0.01)
    assert boundary(lambda x: True, 0, 10, 0.01) != boundary(lambda x: True, 0, 10, 0.01)  # nan: no boundary


# ---------------------------------------------------------------- fingerprints of results


def test_comments_and_docstrings_do_not_change_the_fingerprint(tmp_path: Path) -> None:
    verilog, python = tmp_path / "a.v", tmp_path / "a.py"
    found = set()
    for text in ("module a;\n  wire b;\nendmodule\n", "// new\nmodule a; wire b;  // b\nendmodule\n"):
        verilog.write_text(text)
        found.add(fingerprint._code(verilog))
    for text in ("a = 1\n", "# new\na = (\n    1\n)\n", '"""New."""\na = 1\n'):
        python.write_text(text)
        found.add(fingerprint._python(python))
    assert len(found) == 2
    verilog.write_text("module a;\n  wire c;\nendmodule\n")
    python.write_text("a = 2\n")
    assert not found & {fingerprint._code(verilog), fingerprint._python(python)}


# ---------------------------------------------------------------- sw/tools/stack.py

STACK_C = """
int counter = 5;
int zeroed[3];
int leaf(int x) { volatile char room[100]; room[x] = (char)x; return room[0]; }
int by_pointer(int x) { volatile char room[300]; room[x] = 1; return leaf(x) + room[1]; }
int (*handler)(int) = by_pointer;
void _start(void) { counter = handler(counter) + zeroed[1]; }
"""


def compiled(folder: Path, source: str) -> Path:
    (folder / "a.c").write_text(source)
    flags = "-march=rv32i -mabi=ilp32 -Os -ffreestanding -nostdlib -fno-inline -fno-optimize-sibling-calls"
    command = ["riscv64-unknown-elf-gcc", *flags.split(), "-o", folder / "a.elf", folder / "a.c"]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "a.elf"


def test_stack_follows_pointers_and_counts_all_variables(tmp_path: Path) -> None:
    elf = compiled(tmp_path, STACK_C)
    size, path = stack.deepest(elf)
    assert path == ["_start", "by_pointer", "leaf"]
    assert 400 < size < 500
    _, variables = stack.sizes(elf)
    assert variables == 4 + 4 + 12


def test_stack_refuses_recursion(tmp_path: Path) -> None:
    source = "int f(int x) { return x ? f(x - 1) * 3 + x : 1; } void _start(void) { f(4); }"
    with pytest.raises(stack.StackError, match="recursion: _start -> f -> f"):
        stack.deepest(compiled(tmp_path, source))
