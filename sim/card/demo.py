# SPDX-License-Identifier: Apache-2.0
"""Runs examples 1 to 6 of the option card manual on the virtual card, with independent Modbus masters.

    python -m sim.card.demo            exit 0: all passed, 1: something failed, 2: something is missing

pymodbus runs every example; mbpoll then reads and writes one parameter. In examples 1 to 3 the simulated
drive obeys: each stop meets a running motor and ends in 'stopped'. In the others it keeps the state of the
manual's examples, so that every reply is the printed one. The bytes of both lines come from the card's log
and are compared with tb/model/examples.json. Turnaround: from the last stop bit of the request to the first
start bit of the reply, in simulated ms.
"""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import tempfile
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rtl.command import run_main
from sim.card.masters import Exchange, Pymodbus, ask_mbpoll
from sim.card.run_card import ROOT, CardError, Frame, RunningCard
from tb.model import fc_telegram

EXAMPLES = ROOT / "tb/model/examples.json"
FROM_MANUAL = re.compile(r"(manual p\d+) example (\d+)")
WIDTH = 100
LABEL = 15
START, READ_CURRENT = "ex1-start-40", "ex5-read-514"
STOPPED = "stopped, output frequency 0.0 %"
# What the drive says some seconds after a command.
ENDS_IN = {
    START: "running, on reference, output frequency 40.0 %",
    "ex2-ramp-stop": STOPPED,
    "ex3-coast-stop": STOPPED,
}
# Line and sender of each frame of an example, in the order in which they are shown.
ON_LINES = {
    "request": ("modbus", "master"),
    "FC telegram": ("drive", "card"),
    "drive's reply": ("drive", "drive"),
    "Modbus reply": ("modbus", "card"),
}
RAMP_S = 15.0  # simulated time for the drive's ramp
END_TEXT_ACCESS = bytes.fromhex("01 06 00 00 00 00 89 CA")  # register 40001 (IND) = 0


@dataclass(frozen=True)
class Example:
    title: str
    request: bytes
    reply: bytes
    drive: list[tuple[bytes, bytes]]  # telegram, reply
    ends_in: str = ""  # state of a drive that obeys, whose replies are its own


@dataclass(frozen=True)
class Result:
    title: str
    master: str
    passed: bool
    turnaround_ms: float | None


def spaced(data: bytes) -> str:
    return data.hex(" ").upper()


def manual_examples() -> dict[str, Example]:
    """The manual's numbered examples by id, in its order."""
    found = {}
    for entry in json.loads(EXAMPLES.read_text()):
        match = FROM_MANUAL.search(entry["source"])
        if match is None:
            continue
        found[entry["id"]] = Example(
            f"Example {match[2]} ({match[1]}): {entry['what']}",
            bytes.fromhex(entry["request"]),
            bytes.fromhex(entry["reply"]),
            [(bytes.fromhex(d["telegram"]), bytes.fromhex(d["reply"])) for d in entry["drive"]],
            ENDS_IN.get(entry["id"], ""),
        )
    return found


# ---------------------------------------------------------------- traffic of one example
def show(label: str, text: str) -> None:
    for row in textwrap.wrap(text, WIDTH - LABEL - 2) or [""]:
        print(f"  {label:<{LABEL}}{row}")
        label = ""


def show_frame(label: str, frame: Frame | None) -> None:
    show(label, spaced(frame.data) if frame else "-")
    if frame:
        show("", frame.what if frame.ok else f"BAD: {frame.what}")


def differences(example: Example, seen: dict[str, list[Frame]], exchange: Exchange) -> Iterator[str]:
    """Deviations from the manual, described."""
    expected = {
        "request": [example.request],
        "FC telegram": [telegram for telegram, _ in example.drive],
        "drive's reply": [reply for _, reply in example.drive],
        "Modbus reply": [example.reply],
    }
    if example.ends_in:
        del expected["drive's reply"]
    for what, wanted in expected.items():
        if [frame.data for frame in seen[what]] != wanted:
            yield f"{what}: expected {', '.join(map(spaced, wanted)) or 'none'}"
    if not exchange.accepted:
        yield f"the master says: {exchange.answer}"


def state(card: RunningCard, ask: Callable[[], Exchange], wanted: str) -> str:
    """What the drive says as soon as that begins with `wanted`, or at the end of its ramp."""
    began, shown = card.frames()[-1].end, ""
    while not shown.startswith(wanted) and card.frames()[-1].end < began + RAMP_S:
        before = len(card.frames())
        ask()
        for frame in card.wait_for_frames(before, "modbus", "card"):
            if frame.sender == "drive":
                reply = fc_telegram.parse(frame.data, reply=True)
                shown = fc_telegram.describe_status(reply.pcd1, reply.pcd2)
    return shown


def run_example(
    card: RunningCard,
    example: Example,
    ask: Callable[[], Exchange],
    read: Callable[[], Exchange] | None = None,
) -> Result:
    """Runs one example and prints the comparison; `read` asks a drive that obeys for its state."""
    before = len(card.frames())
    exchange = ask()
    frames = card.wait_for_frames(before, "modbus", "card")
    seen = {what: [f for f in frames if (f.line, f.sender) == of] for what, of in ON_LINES.items()}
    print(example.title)
    show("asked by", exchange.call)
    for what in ON_LINES:
        show_frame(what, next(iter(seen[what]), None))
    show("expected", spaced(example.reply))
    show("master got", exchange.answer)
    wrong = list(differences(example, seen, exchange))
    if read:
        show("drive then", shown := state(card, read, example.ends_in))
        wrong += [f"drive then: expected {example.ends_in}"] * (shown != example.ends_in)
    request, reply = seen["request"], seen["Modbus reply"]
    turnaround = (reply[0].start - request[0].end) * 1000 if request and reply else None
    show("turnaround", f"{turnaround:.2f} ms simulated" if turnaround else "no reply")
    show("verdict", "FAILED" if wrong else "passed")
    for line in wrong:
        show("", line)
    print()
    return Result(example.title, exchange.call.split()[0], not wrong, turnaround)


def summary(results: list[Result]) -> None:
    for result in results:
        verdict = "passed" if result.passed else "FAILED"
        turnaround = f"{result.turnaround_ms:6.2f} ms" if result.turnaround_ms else "        -"
        print(f"  {verdict}  {turnaround}  {result.master:<8}  {result.title}")
    passed = sum(result.passed for result in results)
    print(f"{passed} passed, {len(results) - passed} failed")


def commands(folder: Path, examples: dict[str, Example]) -> list[Result]:
    """The examples that start and stop the motor, each stop with a motor that runs."""
    results = []
    current, start = manual_examples()[READ_CURRENT].request, examples[START]
    with (
        RunningCard(folder, "--drive", "sim", "--speed", "max", "--quiet") as card,
        Pymodbus(card.link) as master,
    ):
        read = partial(master.ask, current)
        for name, example in examples.items():
            if name != START:
                before = len(card.frames())
                master.ask(start.request)
                card.wait_for_frames(before, "modbus", "card")
                state(card, read, "running")
            results.append(run_example(card, example, partial(master.ask, example.request), read))
    return results


def demo(folder: Path) -> int:
    examples = manual_examples()
    if not examples:
        raise CardError(f"no example of the manual in {EXAMPLES.relative_to(ROOT)}")
    results = commands(folder, {name: one for name, one in examples.items() if one.ends_in})
    with RunningCard(folder, "--drive", "example", "--quiet") as card:
        master = Pymodbus(card.link)
        for example in examples.values():
            if not example.ends_in:
                results.append(
                    run_example(card, example, lambda example=example: master.ask(example.request))
                )
        before = len(card.frames())
        master.ask(END_TEXT_ACCESS)  # example 6 leaves the card in text access
        card.wait_for_frames(before, "modbus", "card")  # else the next example would count it
        master.close()
        link = card.link
        by_mbpoll = {
            "ex5-read-514": lambda: ask_mbpoll(link, 5140, count=2),
            "ex4-write-104": lambda: ask_mbpoll(link, 1040, values=(60,)),
        }
        for name, ask in by_mbpoll.items():
            results.append(run_example(card, examples[name], ask))
        code = card.stop()
    if code != 0:
        raise CardError(f"build/card ended with code {code}")
    summary(results)
    return 0 if all(result.passed for result in results) else 1


def main() -> int:
    if shutil.which("mbpoll") is None:
        raise CardError("mbpoll is missing: run `make setup`")
    if importlib.util.find_spec("pymodbus") is None:
        raise CardError("pymodbus is missing: run `make setup` and use .venv/bin/python")
    with tempfile.TemporaryDirectory() as folder:
        return demo(Path(folder))


if __name__ == "__main__":
    run_main("demo", main, CardError, ConnectionError)
