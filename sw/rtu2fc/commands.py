# SPDX-License-Identifier: Apache-2.0
"""The short commands: ports, status, the motor, parameters, switches, the virtual card."""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

from . import fc, switches, tables
from .card import (
    COAST,
    RAMP_STOP,
    RESET,
    RUNNING,
    START,
    START_BIT,
    TRIP,
    VALID_BIT,
    Card,
    Parameter,
    control_in_words,
    parameter,
    parameters,
    percent_word,
    status_in_words,
)
from .drives import DRIVES
from .port import known_ports
from .problem import DONE, FAILED, Problem, Refused
from .screen import Screen

TURN_S = 3.0  # until a started motor must turn
STOP_S = 120.0  # until a motor must have stopped by its ramp
VIRTUAL_CARD = "RTU2FC_CARD"


def ports(args: argparse.Namespace, screen: Screen) -> int:
    found = known_ports()
    screen.result["ports"] = [{"port": device, "description": text} for device, text in found]
    for device, text in found:
        screen.say(f"{device:14} {text}".rstrip())
    if not found:
        screen.say("This computer has no serial port; is the adapter plugged in?")
    return DONE


def switch_positions(args: argparse.Namespace, screen: Screen) -> int:
    baud, unit = switches.BAUDS[args.baud] + switches.FORMS[args.format], switches.address(args.unit)
    screen.result |= {"baud_switches": baud, "address_switches": unit}
    screen.say(f"{args.baud} {args.format}, unit {args.unit}: baud 1-5 {baud}, address 1-8 {unit} (1 = ON)")
    screen.say()
    for line in switches.lines(args.baud, args.format, args.unit):
        screen.say(line)
    return DONE


def simulate(args: argparse.Namespace, screen: Screen) -> int:
    """The virtual card's program, with its own options and messages."""
    program = args.program or os.environ.get(VIRTUAL_CARD) or "build/card"
    if not Path(program).is_file():
        raise Problem(
            f"the virtual card's program is not here: {program}",
            f"Build it from the sources by `make card`, and name it by --program or {VIRTUAL_CARD}.",
        )
    return subprocess.call([program, *(word for word in args.options if word != "--")])


# ---------------------------------------------------------------- the drive's state


def _alarms(drive: str) -> list[Parameter]:
    """The alarm word, and the newest entry of the fault log."""
    known = parameters(drive).values()
    found = [one for part in ("alarm word", "error code") for one in known if part in one.name.lower()]
    newest = DRIVES[drive]["first_index"]
    return [replace(one, index=newest if "log" in one.name.lower() else 0) for one in found]


def status(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    """Reads a parameter first: its answer brings the status image up to date, and commands nothing (FC-6)."""
    alarms = {}
    for one in _alarms(card.drive):
        with contextlib.suppress(Refused):  # a drive may lack it
            alarms[str(one)] = card.read(one)
    image = card.coils(0, 64)
    control, reference, word, frequency = (image >> at & 0xFFFF for at in (0, 16, 32, 48))
    screen.result |= {
        "dialect": card.dialect,
        "drive": card.drive,
        "control_word": control,
        "reference_percent": round(fc.share(reference), 2),
        "status_word": word,
        "status": fc.bits_in_words(word, tables.STATUS, DRIVES[card.drive]).split(", "),
        "output_frequency_percent": round(fc.share(frequency), 2),
        "alarms": alarms,
    }
    screen.say(f"unit {card.unit}, dialect {card.dialect}, words of {card.drive}")
    screen.say(f"  {control_in_words(control, card.drive)}")
    screen.say(f"  reference {fc.percent(reference)}")
    screen.say(f"  {status_in_words(word, card.drive)}", "bold red" if word & TRIP else None)
    screen.say(f"  output frequency {fc.percent(frequency)}")
    for name, raw in alarms.items():
        screen.say(f"  {name} = {f'{raw:08X}h' if 'word' in name.lower() else raw}")
    return DONE


# ---------------------------------------------------------------- the motor


def _told(screen: Screen, card: Card, word: int, reference: int | None) -> None:
    said = control_in_words(word, card.drive)
    share = "" if reference is None else f", reference {reference:04X}h ({fc.percent(reference)})"
    screen.say(f"telegram: {said}{share}")
    screen.result |= {"sent_control_word": word, "sent_reference": reference}


def agreed(args: argparse.Namespace, what: str) -> None:
    """A motor moves after `yes` only; the motor of a recorded line does not move."""
    if args.yes or args.replay:
        return
    if not sys.stdin.isatty():
        raise Problem(f"{what}; nobody can be asked without a terminal: add --yes")
    print(f"{what}. Type yes to go on: ", end="", file=sys.stderr, flush=True)
    if sys.stdin.readline().strip().lower() != "yes":
        raise Problem("not confirmed, nothing was sent")


def _state(screen: Screen, card: Card) -> tuple[int, int]:
    word, frequency = card.process_words()
    screen.result |= {"status_word": word, "output_frequency_percent": round(fc.share(frequency), 2)}
    return word, frequency


def _show(screen: Screen, card: Card, word: int, frequency: int) -> None:
    screen.say(f"{status_in_words(word, card.drive)}, output frequency {fc.percent(frequency)}")


def _refresh(card: Card) -> None:
    """Reads a parameter, whose answer brings the status image up to date."""
    card.read(_alarms(card.drive)[0])


def _until_it_runs(screen: Screen, card: Card) -> int:
    until = time.monotonic() + TURN_S
    word, frequency = _state(screen, card)
    while not (word & RUNNING and frequency) and time.monotonic() < until:
        _refresh(card)
        word, frequency = _state(screen, card)
    _show(screen, card, word, frequency)
    if word & RUNNING:
        return DONE
    page = "docs/guide/debugging.md, Drive does not start though written"
    screen.say(f"The motor does not run. Read: {page}", "bold red")
    return FAILED


def _until_it_stops(screen: Screen, card: Card) -> int:
    began, shown = time.monotonic(), None
    while True:
        _refresh(card)
        word, frequency = _state(screen, card)
        stands, late = not (word & RUNNING or frequency), time.monotonic() - began > STOP_S
        if stands or late or shown is None or time.monotonic() - shown > 2:
            shown = time.monotonic()
            _show(screen, card, word, frequency)
        if stands:
            card.motor_may_turn = False
            screen.say("stopped")
            return DONE
        if late:
            screen.say(f"THE MOTOR STILL TURNS after {STOP_S:g} s. Use the drive's own stop.", "bold red")
            return FAILED


def start(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    reference = percent_word(args.percent)
    _told(screen, card, START, reference)
    agreed(args, f"the motor of unit {card.unit} will turn at {args.percent:g} %")
    card.control(START, reference)
    if args.percent:
        return _until_it_runs(screen, card)
    _show(screen, card, *_state(screen, card))
    return DONE


def _stopped(screen: Screen, card: Card, *words: int) -> int:
    """Prints after it has sent: an output that fails keeps no stop from the line."""
    for word in words:
        card.control(word)
    card.motor_may_turn = True  # the reply comes before the ramp
    for word in words:
        _told(screen, card, word, None)
    return _until_it_stops(screen, card)


def stop(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    """By the ramp; the reference stays."""
    return _stopped(screen, card, RAMP_STOP)


def coast(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    code = _stopped(screen, card, COAST)
    screen.say("The drive gives no output; a motor with a heavy load turns on until friction stops it.")
    return code


def reset(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    """The change of bit 7 resets a trip. The start bit is 0: a motor that runs is stopped."""
    return _stopped(screen, card, RAMP_STOP, RESET, RAMP_STOP)


def reference(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    """The control word stays as it is in the card; a running motor follows."""
    word, value = card.coils(0, 16), percent_word(args.percent)
    _told(screen, card, word, value)
    if not word & VALID_BIT:
        raise Problem(
            f"the control word in the card is {word:04X}h: the drive takes no reference from it",
            f"Start the motor with this reference: rtu2fc start {card.line.name} {args.percent:g}",
        )
    if word & START_BIT:
        agreed(args, f"the motor of unit {card.unit} will turn at {args.percent:g} %")
    card.control(word, value)
    _show(screen, card, *_state(screen, card))
    return DONE


# ---------------------------------------------------------------- parameters


def read(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    code, found = DONE, []
    for word in args.parameters:
        one = parameter(card.drive, word)
        try:
            value = card.read(one)
        except Refused as refused:
            screen.say(f"{one}: {refused}", "bold red")
            found.append({"number": one.number, "index": one.index, "error": str(refused)})
            code = Refused.code
            continue
        shown = card.shown(one, value)
        known = one.type not in ("", "text")
        raw = f"  (raw {value}, conversion {one.conversion})" if known and one.conversion else ""
        screen.say(f"{one} = {shown}{raw}")
        found.append({"number": one.number, "index": one.index, "name": one.name, "raw": value,
                      "value": shown, "unit": one.unit, "conversion": one.conversion})  # fmt: skip
    screen.result["parameters"] = found
    return code


def write(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    one = parameter(card.drive, args.parameter)
    before = card.shown(one, card.read(one))
    with card.storing() if args.store else contextlib.nullcontext():
        card.write(one, args.value)
    after = card.read(one)
    screen.say(f"{one}: {before} -> {card.shown(one, after)}{', stored in the EEPROM' if args.store else ''}")
    screen.result |= {"number": one.number, "before": before, "after": card.shown(one, after), "raw": after}
    return DONE


def table(args: argparse.Namespace, screen: Screen) -> int:
    drive = "vlt6000" if args.drive == "auto" else args.drive
    fits = [
        one for one in parameters(drive).values() if args.word.lower() in f"{one.number} {one.name}".lower()
    ]
    width = max((len(one.name) for one in fits), default=0)
    for one in fits:
        step = f"10^{one.conversion}" if one.conversion else ""
        screen.say(f"{one.number:5}  {one.name:{width}}  {one.type:7} {step:6} {one.unit}".rstrip())
    screen.result |= {"drive": drive, "parameters": [vars(one) for one in fits]}
    if not fits:
        raise Problem(f"no parameter of {drive} has '{args.word}' in its number or name")
    return DONE
