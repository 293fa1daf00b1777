# SPDX-License-Identifier: Apache-2.0
"""The other drives: each profile against its table, its words, and the examples of its document.

An example gives the Modbus side and the telegram that results, worked out by hand. The translation between
them is tested elsewhere, so no test here carries a rule id. Features common to all drives are tested on the
VLT 6000 in test_vlt_drive.py.
"""

from __future__ import annotations

import pytest

from regs.dialects import DIALECTS, STANDARD_DRIVE
from sim.drive.drive_bench import (
    ACCESS_FAULT,
    COAST,
    DC_BRAKE,
    FREEZE,
    FULL_SPEED,
    JOG,
    QUICK_STOP,
    RAMP_2,
    RAMP_STOP,
    RESET,
    SECOND,
    START,
    Row,
    ask,
    brought_to,
    by_role,
    control,
    first_index,
    hertz,
    is_double,
    read_text,
    table,
    write_command,
    write_text,
)
from tb.model import fc_telegram as fc
from tb.model.vlt_drive import PROFILES, VltDrive

FC_STATUS = ("vlt2800", STANDARD_DRIVE)
TWO_RAMPS = ("vlt5000", "vlt2800", STANDARD_DRIVE)


each_drive = pytest.mark.parametrize("profile", PROFILES)


def write_setting(drive: VltDrive, profile: str, role: str, value: int) -> None:
    """Writes the parameter with this role over the bus, in its width."""
    row = next(row for row in table(profile) if row["role"] == role)
    reply = ask(drive, write_command(row), int(row["pnu"]), value)
    assert reply.fault is None


# ---- each profile agrees with its table --------------------------------------------------------


def test_every_drive_has_its_dialect():
    assert set(PROFILES) == {profile for one in DIALECTS.values() for profile in one.profiles}
    with pytest.raises(ValueError, match=r"no drive profile 'vlt7000', only .*vlt2800, "):
        VltDrive("vlt7000")


@each_drive
def test_only_faults_are_invented(profile: str):
    invented = {row["pnu"] for row in table(profile) if row["source"] == "simulator"}
    faults = {row["pnu"] for row in table(profile) if row["access"] in ("reset", "fixed", "denied")}
    assert invented == faults, "nothing is invented but what shows the fault numbers 6, 7 and 11"
    assert {row["source"] for row in table(profile)} <= {"document", "partly", "memory", "simulator"}


@each_drive
def test_numbers_agree_with_their_rows(profile: str):
    """Reply AK by type, default, limits, rights, array length: each parameter over the bus."""
    for row in table(profile):
        if row["type"] != "text":
            differing = row_differs(profile, row)
            assert not differing, f"{profile}, parameter {row['pnu']}: {', '.join(differing)}"


def row_differs(profile: str, row: Row) -> list[str]:
    """What a drive does otherwise than the row says."""
    pnu, low, high, double = int(row["pnu"]), int(row["min"]), int(row["max"]), is_double(row)
    bits = 0xFFFFFFFF if double else 0xFFFF
    length, index, write = int(row["array"]), first_index(profile, row), write_command(row)
    drive = VltDrive(profile)
    wrong: list[str] = []

    def expect(what: str, got: object, wanted: object) -> None:
        wrong.extend([f"{what}: {got} instead of {wanted}"] * (got != wanted))

    def read(ind: int) -> fc.Telegram:
        return ask(drive, fc.AK_READ, pnu, ind=ind)

    def written(value: int, ak: int = write) -> int | None:
        return ask(drive, ak, pnu, value, index).fault

    reply = read(index)
    expect("reply", (reply.ak, reply.pnu, reply.ind), (2 if double else 1, pnu, index))
    if not row["role"].startswith("show_"):
        expect("default", reply.pwe, int(row["default"]) & bits)
    expect("index after the last", read(index + max(length, 1)).fault, 3 if length else 4)
    if length:
        expect("last index", read(index + length - 1).fault, None)
        expect("index 0", read(0).fault, 3 if index else None)
    if row["access"] in ACCESS_FAULT:
        expect("write", written(low), ACCESS_FAULT[row["access"]])
        return wrong
    expect("write of the other width", written(high, fc.AK_WRITE_WORD if double else fc.AK_WRITE_DOUBLE), 5)
    if row["access"] == "reset":
        expect("write of 1 and 0", (written(1), written(0), drive.get(pnu, index)), (6, None, 0))
        return wrong
    for value in (high, low):
        reply = ask(drive, write, pnu, value, index)
        expect(f"write of {value}", (reply.fault, reply.pwe), (None, value & bits))
        expect("then", drive.get(pnu, index), value)
    for outside in (low - 1, high + 1):
        if outside & bits == outside or low < 0:
            expect(f"write of {outside}", (written(outside), drive.get(pnu, index)), (2, low))
    return wrong


@each_drive
def test_parameters_that_need_a_stopped_motor_are_refused_while_it_runs(profile: str):
    for row in (row for row in table(profile) if row["access"] == "rw"):
        pnu, drive = int(row["pnu"]), VltDrive(profile)
        control(drive, START, FULL_SPEED)
        if row["type"] == "text":
            reply = write_text(drive, pnu, b"RUN")
        else:
            reply = ask(drive, write_command(row), pnu, int(row["default"]), first_index(profile, row))
        assert reply.fault == (None if row["while_running"] == "1" else 17), pnu


@each_drive
def test_texts_have_their_own_length_and_are_written_where_allowed(profile: str):
    writable = set()
    for row in (row for row in table(profile) if row["type"] == "text"):
        pnu, drive, old = int(row["pnu"]), VltDrive(profile), row["default"].encode()
        assert read_text(drive, pnu) == old, pnu
        fault = write_text(drive, pnu, b"NEW").fault
        assert (fault, read_text(drive, pnu)) == ((None, b"NEW") if row["access"] == "rw" else (1, old)), pnu
        writable |= {pnu} if fault is None else set()
    wanted = {"vlt6000": {533, 534}, "vlt8000": {533, 534}, STANDARD_DRIVE: {37, 38, 39}}
    assert writable == wanted.get(profile, set())


# ---- numbers, indices, faults ------------------------------------------------------------------


def test_older_drives_ignore_bit_11_of_pke():
    for profile in set(PROFILES) - {STANDARD_DRIVE}:
        reply = VltDrive(profile).telegram(fc.build_parameter(fc.AK_READ, 0x800 | 104))
        assert reply[3:5] == bytes.fromhex("10 68"), profile


def test_the_basic_drive_uses_bit_11_of_pke():
    """3022 = BCEh, and 974 (the same number without bit 11) does not exist."""
    drive = VltDrive(STANDARD_DRIVE)
    assert ask(drive, fc.AK_WRITE_WORD, 3022, 1).fault is None
    reply = drive.telegram(fc.build_parameter(fc.AK_READ, 3022))
    assert (reply[3:5], reply[7:11]) == (bytes.fromhex("1B CE"), bytes(3) + b"\x01")
    assert ask(drive, fc.AK_READ, 974).fault == 0
    greatest = ask(drive, fc.AK_READ, 4095)
    assert (greatest.pnu, greatest.fault) == (4095, 0)


@each_drive
def test_fault_log_has_the_newest_trip_first_and_survives_a_power_cycle(profile: str):
    drive, log = VltDrive(profile), by_role(profile, "fault_code")
    for alarm in (7, 8, 9):
        drive.trip(alarm)
        drive.trip(99)  # already tripped
        control(drive, RAMP_STOP)
        control(drive, RAMP_STOP | RESET)
    drive.power_cycle()
    first = 0 if profile == STANDARD_DRIVE else 1
    assert [ask(drive, fc.AK_READ, log, ind=first + i).pwe for i in range(4)] == [9, 8, 7, 0]
    hours = ask(drive, fc.AK_READ, by_role(profile, "fault_time"), ind=first).pwe
    assert hours == 567, "hours run at the trip"


def test_an_unknown_ak_has_the_fault_of_the_profile():
    """Those of access 6, 7 and 11 are in the rows."""
    for profile in PROFILES:
        wanted = 130 if profile in ("vlt6000", "vlt5000") else 18
        assert ask(VltDrive(profile), 9, by_role(profile, "jog_frequency")).fault == wanted, profile


# ---- status word -------------------------------------------------------------------------------


@each_drive
def test_every_drive_powers_up_ready_with_0607(profile: str):
    drive = VltDrive(profile)
    assert control(drive, 0) == (0x0607, 0)
    assert drive.get(by_role(profile, "show_status_word")) == 0x0607


def test_bit_2_is_stand_by():
    """Set while the motor neither runs nor has a start command, coasting or not."""
    for profile in set(PROFILES) - set(FC_STATUS):
        drive = brought_to(50, profile)
        assert control(drive, 0)[0] == 0x0F03, profile
        assert control(drive, COAST)[0] == 0x0607, profile


@pytest.mark.parametrize("profile", FC_STATUS)
def test_bit_2_is_coasting(profile: str):
    drive = brought_to(50, profile)
    assert control(drive, 0)[0] == 0x0F07, "running"
    assert control(drive, COAST)[0] == 0x0603, "bit 2 = 0: the motor is let go"
    assert control(drive, RAMP_STOP)[0] == 0x0607
    drive.trip(4)
    assert control(drive, 0)[0] == 0x0608
    assert control(drive, RAMP_STOP | RESET)[0] == 0x0607


def test_bit_10_of_a_vlt_5000_goes_by_225_and_226():
    drive = brought_to(25, "vlt5000")
    assert control(drive, 0)[0] & 0x0400
    for pnu, value in ((225, 260), (225, 0), (226, 240)):
        assert ask(drive, fc.AK_WRITE_WORD, pnu, value).fault is None
        assert bool(control(drive, 0)[0] & 0x0400) == (value == 0)


# ---- control word ------------------------------------------------------------------------------


@each_drive
def test_every_drive_ramps_to_its_reference_and_jogs_and_stops(profile: str):
    drive = brought_to(50, profile)
    assert control(drive, 0)[1] == 0x4000
    jog = drive.get(by_role(profile, "jog_frequency"))
    control(drive, JOG & ~0x0040, FULL_SPEED)  # jog needs no start, and takes no reference
    drive.step(20 * SECOND)
    assert hertz(drive) == jog / 10
    control(drive, RAMP_STOP)
    drive.step(10 * SECOND)
    assert control(drive, 0) == (0x0607, 0)


@each_drive
def test_stronger_of_two_stops_is_obeyed(profile: str):
    """Coast, quick stop, DC brake, ramp stop: each beats those after it and freeze; only the last not jog."""
    stops = {"coast": COAST, "quick": QUICK_STOP, "brake": DC_BRAKE, "ramp": RAMP_STOP}
    two = profile in TWO_RAMPS
    after = {"coast": 0, "quick": 40 if two else 45, "brake": 0, "ramp": 45}
    names = list(stops)
    for first, stronger in enumerate(names):
        for weaker in names[first:]:
            drive = VltDrive(profile)
            if two:
                for role, value in (("ramp_up", 1000), ("ramp_down", 1000), ("quick_stop_ramp", 500)):
                    write_setting(drive, profile, role, value)
            write_setting(drive, profile, "dc_brake_time", 20)
            control(drive, START, FULL_SPEED)
            drive.step(10 * SECOND)
            assert hertz(drive) == 50
            jog = 0 if stronger == "ramp" else JOG & ~START
            control(drive, stops[stronger] & stops[weaker] & FREEZE | jog, FULL_SPEED)
            drive.step(SECOND)
            assert hertz(drive) == after[stronger], f"{stronger} with {weaker}"
            assert drive.running == (stronger != "coast")


@pytest.mark.parametrize("profile", TWO_RAMPS)
def test_bit_9_chooses_the_second_ramp_up_and_down(profile: str):
    drive = VltDrive(profile)
    for role, value in (("ramp_up", 1000), ("ramp_down", 500), ("ramp_up_2", 2000), ("ramp_down_2", 2500)):
        write_setting(drive, profile, role, value)
    control(drive, START, FULL_SPEED)
    drive.step(2 * SECOND)
    assert hertz(drive) == 10, "50 Hz in 10 s"
    control(drive, START | RAMP_2, FULL_SPEED)
    drive.step(2 * SECOND)
    assert hertz(drive) == 15, "and on in 20 s"
    control(drive, RAMP_STOP | RAMP_2)
    drive.step(2 * SECOND)
    assert hertz(drive) == 11, "down in 25 s"
    control(drive, RAMP_STOP)
    drive.step(SECOND)
    assert hertz(drive) == 1, "and in 5 s"


@pytest.mark.parametrize("profile", TWO_RAMPS)
def test_quick_stop_has_its_own_selector(profile: str):
    """Selector 0 leaves the quick stop to the digital input, which is not wired."""
    drive = brought_to(50, profile)
    write_setting(drive, profile, "select_quick_stop", 0)
    control(drive, QUICK_STOP, FULL_SPEED)
    drive.step(SECOND)
    assert hertz(drive) == 50


@pytest.mark.parametrize(
    ("profile", "places"),
    [
        *((name, [(211, 0), (212, 0), (213, 0), (214, 0)]) for name in ("vlt6000", "vlt8000")),
        *((name, [(215, 0), (216, 0), (217, 0), (218, 0)]) for name in ("vlt5000", "vlt2800")),
        (STANDARD_DRIVE, [(310, 0), (310, 1), (310, 2), (310, 3)]),
    ],
)
def test_bits_0_and_1_choose_the_drives_own_presets(profile: str, places: list):
    for choice, both in enumerate((17.5, 22.5, -2.5, 32.5)):
        drive = VltDrive(profile)
        for (pnu, index), percent in zip(places, (1000, 2000, -3000, 4000), strict=True):
            assert ask(drive, fc.AK_WRITE_WORD, pnu, percent, index).fault is None
        control(drive, START | choice, 0x1000)  # 25 % from the bus
        drive.step(30 * SECOND)
        assert hertz(drive) == both, f"sum of bus and preset {choice}"


@pytest.mark.parametrize("profile", [name for name in PROFILES if name != "vlt5000"])
def test_bus_timeout_acts_as_selected(profile: str):
    """Off, freeze, stop, jog, max, stop and trip."""
    jog = VltDrive(profile).get(by_role(profile, "jog_frequency")) / 10
    for function, (after_hz, alarm) in enumerate(((25, 0), (25, 0), (0, 0), (jog, 0), (50, 0), (0, 17))):
        drive = brought_to(25, profile)
        write_setting(drive, profile, "bus_time", 20 if profile == STANDARD_DRIVE else 2)  # 2 s
        write_setting(drive, profile, "bus_time_function", function)
        control(drive, START, 0x2000)
        drive.step(2 * SECOND)
        assert (hertz(drive), drive.alarm) == (25, 0)
        for _ in range(20):
            drive.step(SECOND)
            control(drive, 0)  # telegrams without a valid control word do not count
        assert (hertz(drive), drive.alarm) == (after_hz, alarm), function


# ---- each document's examples on its own drive -------------------------------------------------


def test_the_example_state_is_that_of_the_profiles_document():
    for profile in PROFILES:
        drive = VltDrive(profile, example=True)
        wanted = (0x0607, 0) if profile in FC_STATUS else (0x0F03, 0x2000)
        assert control(drive, START, FULL_SPEED) == wanted, f"{profile}: no command changes it"


def test_the_built_in_drives_example_6_reads_an_element_of_a_log():
    """Register 9 = 8, then 609 at 6089: log reference of index 8 is 40.0 %."""
    drive = VltDrive("vlt8000", example=True)
    request = bytes.fromhex("02 0E 81 12 61 00 08 00 00 00 00 00 00 00 00 F6")
    assert drive.telegram(request) == bytes.fromhex("02 0E 81 12 61 00 08 00 00 01 90 0F 03 20 00 4B")
