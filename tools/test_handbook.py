# SPDX-License-Identifier: Apache-2.0
"""The owner's handbook: every code, coil, register, LED state, switch and example of the card has its row.

The tables are written by hand. The expected values come from the rules, from the model (tb/model), from the
manuals and, for the examples, from a run of the card.
"""

from __future__ import annotations

import re
import tomllib

import pytest

from regs.dialects import STANDARD
from regs.generated.card_tables import EXTENDED_RATES, RATES
from rtl.sources import ROOT
from sim.card.masters import as_pymodbus_call
from tb.agents import rtu
from tb.model import fc_telegram
from tb.model.card import DIALECTS, FUNCTIONS, CardModel
from tools import handbook_examples
from tools.handbook import rows
from tools.symptoms import Bus

PAGES = ROOT / "docs/guide/handbook"
FC = tomllib.loads((ROOT / "regs/fc.toml").read_text())
Row = dict[str, str]
# Those of docs/pictures/leds.svg.
LED_STATES = {"red, green, orange, off, 250 ms each, once", "green, flashing, 1 Hz", "red, flashing, 1 Hz"}
LED_STATES |= {"red, steady, both LEDs", "orange, steady, both LEDs, 12 s"}
LED_STATES |= {"red, steady, both LEDs, 12 s, then flashing"}


def switch_rows(head: str) -> list[Row]:
    return rows("switches-and-leds", head)


def numbers(text: str) -> range:
    """'33-48' or '65'."""
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def hexadecimal(text: str) -> int:
    assert re.fullmatch(r"[0-9A-F]+h", text)
    return int(text[:-1], 16)


def is_on(row: Row, *switches: str) -> str:
    return "".join({"ON": "1", "OFF": "0"}[row[switch]] for switch in switches)


# ---------------------------------------------------------------- switches, LEDs, drive


@pytest.mark.rule("LINE-2")
def test_every_rate_has_its_switches():
    found = {
        is_on(row, "SW1", "SW2", "SW3"): (row["bit/s"], row["with extended switches"].strip("*"))
        for row in switch_rows("bit/s")
    }
    assert found == {
        positions: (str(rate.baud), str(EXTENDED_RATES[positions].baud)) for positions, rate in RATES.items()
    }


@pytest.mark.rule("LINE-3")
def test_every_format_has_its_switches():
    found = {
        is_on(row, "SW4", "SW5"): (row["short"], row["with extended switches"].strip("*"))
        for row in switch_rows("parity")
    }
    assert found == {"11": ("8N2", "8N2"), "01": ("8O1", "8O1"), "00": ("8E1", "8E1"), "10": ("8N2", "8N1")}


@pytest.mark.rule("LOOP-1")
def test_switches_of_the_loop_back_test():
    (row,) = switch_rows("SW1")
    assert is_on(row, *(f"SW{n}" for n in range(1, 10))) == "111001111"


@pytest.mark.rule("LED-1", "LED-5")
def test_every_state_of_the_leds_has_its_row():
    """The states of the virtual card's log, and all that LED-1 to LED-5 and LOOP-1 name."""
    code = (ROOT / "sim/card/led_watch.cpp").read_text()
    states = set(re.findall(r'"([\w-]+)"', "".join(re.findall(r"\bk(?:Solid|Flash)\[\] = \{(.*?)\};", code))))
    assert states == {"off", "red", "green", "orange", "red-flash", "green-flash"}
    shown = {row["shows"] for row in switch_rows("shows")}
    assert shown > LED_STATES
    assert any(text.startswith("both LEDs dark") for text in shown)
    assert all(row["do"] for row in switch_rows("shows"))


@pytest.mark.rule("FC-1")
def test_drive_parameters_are_those_of_the_manual():
    found = {row["parameter"]: row["value"] for row in rows("installing", "parameter")}
    assert found == {"500": "FC protocol", "501": "1", "502": "9600 baud"}


# ---------------------------------------------------------------- coils, words, functions


def serves(pdu: bytes) -> bool:
    """True if the model of the card does not refuse the request."""
    step = CardModel().request(pdu)
    return not (step.reply and step.reply[0] & 0x80)


@pytest.mark.rule("MAP-1", "MAP-2")
def test_every_coil_has_one_row_with_its_access():
    found = {n: row for row in rows("coils-and-words", "coils") for n in numbers(row["coils"])}
    assert sorted(found) == list(range(1, 129))
    assert sum(len(numbers(row["coils"])) for row in rows("coils-and-words", "coils")) == 128
    assert not serves(rtu.read_coils(128, 1))
    for coil, row in found.items():
        wire = numbers(row["address on the wire"])
        assert wire == range(numbers(row["coils"])[0] - 1, numbers(row["coils"])[-1])
        assert ("write" in row["access"]) == serves(rtu.write_coil(coil - 1, True))
        assert "read" in row["access"] and serves(rtu.read_coils(coil - 1, 1))


def test_every_function_has_its_row():
    found = {int(row["function, hex (decimal)"][:2], 16): row for row in rows("exceptions", "function, hex")}
    assert set(found) == FUNCTIONS
    for function, build in (
        (0x01, rtu.read_coils),
        (0x0F, lambda start, n: rtu.write_coils(start, [False] * n)),
    ):
        most = int(found[function]["items at most"])
        assert serves(build(0, most)) and not serves(build(0, most + 1))
    for function in (0x03, 0x10):
        assert found[function]["items at most"] == "2 of a number, 10 of a text, 3 of 40001-40003"
    for function, row in found.items():
        assert row["as a broadcast"] == ("ignored" if function in (0x01, 0x03) else "carried out")


def word_rows(name: str) -> list[Row]:
    return rows("coils-and-words", "bit", f"## {name.capitalize()} word")


@pytest.mark.parametrize(("name", "first"), [("control", 1), ("status", 33)])
def test_every_bit_of_both_words_has_its_row(name, first):
    """Bits that differ have a row for each kind of drive; together all drives have each bit once."""
    found: dict[int, list[Row]] = {}
    for row in word_rows(name):
        bit = int(row["bit"])
        found.setdefault(bit, []).append(row)
        assert int(row["coil"]) == first + bit and hexadecimal(row["value"]) == 1 << bit
    assert sorted(found) == list(range(16))
    known = {(entry["bit"], entry["name"], entry["zero"], entry["one"]) for entry in FC[name].values()}
    shown = {(bit, row["name"], row["0"], row["1"]) for bit, same in found.items() for row in same}
    assert shown == known
    drives = sorted(["VLT 2800", "VLT 5000", "VLT 6000", "VLT 8000", "VLT HVAC Basic Drive"])
    for same in found.values():
        named = [drive for row in same for drive in row["drives"].split(", ")]
        assert named == ["all"] or sorted(named) == drives
    kinds = {int(row["bit"]): row["name"] for row in word_rows(name) if "VLT 6000" in row["drives"]}
    assert kinds == {"control": {9: "No function"}, "status": {2: "Stand by", 6: "Not in use"}}[name]


# ---------------------------------------------------------------- registers, parameters


@pytest.mark.rule("MAP-5")
def test_every_local_register_has_its_row_with_its_default():
    found = {n: row for row in rows("registers-and-parameters", "register") for n in numbers(row["register"])}
    assert sorted(found) == list(range(40001, 40010))
    model = CardModel()
    for number, row in found.items():
        wire = number - 40001
        assert wire in numbers(row["address on the wire"])
        assert serves(rtu.read_registers(wire, 1)) == (wire in model.registers)
        if wire in model.registers:
            assert row["at power-up"] == str(model.registers[wire])
        else:
            assert row["note"] == "refused with exception 64"
    defaults = {row["value"]: row["at power-up"] for row in rows("exceptions", "value")}
    assert defaults["40002, network time-out"] == "1000 (10 s)"
    assert defaults["40003, drive time-out"] == "15 (150 ms)"


# ---------------------------------------------------------------- exceptions, time-outs


@pytest.mark.rule("EXC")
def test_every_exception_code_has_its_row_with_cause_and_cure():
    found = rows("exceptions", "`card`")
    for row in found:
        assert row["cause"] and row["cure"] and row["meaning"]
        assert row["hex"] == f"{int(row['`card`'].strip('*')):02X}h"
    for name, dialect in DIALECTS.items():
        column = {row[f"`{name}`"].strip("*") for row in found} - {"silence"}
        own = {code for why, code in dialect.codes.items() if why != "drive"}
        of_drive = {dialect.codes["drive"]} if "drive" in dialect.codes else set(map(int, FC["fault"]))
        assert set(map(int, column)) == own | of_drive
    drive = {int(row["`card`"].strip("*")): row for row in found if row["meaning"].startswith("drive: ")}
    assert set(drive) == set(map(int, FC["fault"]))
    silent = [row for row in found if row["`builtin`"] == row[f"`{STANDARD}`"] == "silence"]
    assert [row["`card`"] for row in silent] == ["**255**"]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_reason_has_the_code_of_the_model(dialect):
    """One request for each fault that the card itself finds."""
    asked = {
        "unknown function code": b"\x07",
        "wrong length of the message": rtu.read_coils(0, 1) + b"\0",
        "wrong quantity": rtu.read_coils(0, 0),
        "no such coil or register": rtu.read_coils(128, 1),
        "value refused by the card": rtu.write_register(2, 0),
    }
    found = {row["meaning"]: row for row in rows("exceptions", "`card`")}
    for meaning, pdu in asked.items():
        reply = CardModel(name=dialect).request(pdu).reply
        assert found[meaning][f"`{dialect}`"].strip("*") == str(reply[1])


def test_times_of_the_card():
    values = {row["time"]: row["value"] for row in rows("exceptions", "time")}
    assert values["start"] == "20 ms, small card (`tiny`) 60 ms"
    assert values["pause on the drive line"] == "2.29 ms"
    assert values["wait for the drive"] == "40003 \N{MULTIPLICATION SIGN} 10 ms, 150 ms by default"
    never = "0: never, also for the option"
    assert values["network time-out"] == f"40002 \N{MULTIPLICATION SIGN} 10 ms, 10 s by default; {never}"
    assert values["loop-back test"] == "listens 1 s, shows its result 12 s"


# ---------------------------------------------------------------- worked examples


def ends_in(example: handbook_examples.Example) -> str:
    """The state in the drive's last reply of an example, or nothing."""
    replies = [reply for one in handbook_examples.play(example) for _, reply in one.drive if reply]
    if not replies:
        return ""
    status = fc_telegram.parse(replies[-1], reply=True)
    return fc_telegram.describe_status(status.pcd1, status.pcd2)


def test_the_drive_does_what_it_was_asked():
    found = {example.title: ends_in(example) for example in handbook_examples.EXAMPLES}
    assert found["Start at 40 %"].startswith("running, on reference, output frequency 40.0 %")
    for title in ("Ramp stop", "Coast stop", "Stop all drives by a broadcast", "Reset of a trip"):
        assert found[title] == "stopped, output frequency 0.0 %"


def test_an_example_that_leaves_a_motor_running_tells_how_to_stop_it():
    for example in handbook_examples.EXAMPLES:
        if ends_in(example).startswith("running"):
            assert "runs" in example.note or "#ramp-stop" in example.after, example.title


@pytest.mark.parametrize("example", handbook_examples.EXAMPLES, ids=lambda one: one.title)
def test_the_card_does_the_examples(example):
    """The whole card with its firmware and the simulated drive: the bytes of the page."""
    with Bus(example=False) as card:
        example.before(card.vlt)
        for one in handbook_examples.play(example):
            card.vlt.step(round(1e6 * one.step.wait))
            card.drive_spoils = (lambda reply: None) if one.step.silent else (lambda reply: reply)
            before = len(card.modbus.frames()), len(card.drive.frames())
            card.ask(one.request, wait_ms=500)
            card.run(20)
            assert [frame.data for frame in card.modbus.frames()[before[0] :]] == [one.reply] * bool(
                one.reply
            )
            assert [frame.data for frame in card.drive.frames()[before[1] :]] == [
                sent for sent, _ in one.drive
            ]


class Recorder:
    """A client that keeps its call."""

    def __getattr__(self, method: str):
        def call(*arguments, device_id: int, **options):
            return device_id, method, list(arguments), options

        return call


def test_the_calls_of_pymodbus_make_the_requests():
    shown = re.findall(r"^pymodbus  (.*) → ", (PAGES / "examples.md").read_text(), re.MULTILINE)
    played = (one for example in handbook_examples.EXAMPLES for one in handbook_examples.play(example))
    for text, request in zip(shown, (one.request for one in played if one.reply is not None), strict=True):
        called = eval(text, {"client": Recorder(), "bool": bool, "range": range})
        assert called == (request[0], *as_pymodbus_call(request)), text


def made_by_mbpoll(command: str) -> bytes:
    """The request of this command line: one value goes out by 05 or 06, several by 0F or 10."""
    words, values = command.split(f" {handbook_examples.PORT}")
    program, *options = words.split()
    assert program == "mbpoll" and options.count("-1") == 1, command
    options.remove("-1")
    given = dict(zip(options[::2], options[1::2], strict=True))
    assert {given.pop("-m"), given.pop("-b"), given.pop("-P"), given.pop("-s")} == {
        "rtu",
        "9600",
        "none",
        "2",
    }
    unit, first, coils = int(given.pop("-a")), int(given.pop("-r")) - 1, given.pop("-t") == "0"
    written = [int(value) for value in values.split()]
    if not written:
        read = rtu.read_coils if coils else rtu.read_registers
        return rtu.build(unit, read(first, int(given.pop("-c"))))
    assert not given, f"{command}: {given}"
    if len(written) > 1:
        return rtu.build(unit, (rtu.write_coils if coils else rtu.write_registers)(first, written))
    return rtu.build(unit, (rtu.write_coil if coils else rtu.write_register)(first, written[0]))


def test_the_commands_of_mbpoll_make_the_requests():
    shown = re.findall(r"^mbpoll    (.*) → ", (PAGES / "examples.md").read_text(), re.MULTILINE)
    played = (one for example in handbook_examples.EXAMPLES for one in handbook_examples.play(example))
    for command, request in zip(shown, (one.request for one in played if one.reply is not None), strict=True):
        assert made_by_mbpoll(command) == request, command
