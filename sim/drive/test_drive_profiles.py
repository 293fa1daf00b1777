# SPDX-License-Identifier: Apache-2.0
"""The other drives: each profile against its table, its words, and the examples of its document.

An example gives the Modbus side and the telegram that results, worked out by hand. The translation between
them is tested elsewhere, so no test here carries a rule id. Features common to all drives are tested on the
VLT 6000 in test_vlt_drive.py.
"""

from __future__ import annotations

import pytest

from sim.drive.drive_bench import (
    ACCESS_FAULT,
    COAST,
    DC_BRAKE,
    FULL_SPEED,
    JOG,
    QUICK_STOP,
    RAMP_2,
    RAMP_STOP,
    RELAY_1,
    RELAY_2,
    RESET,
    SECOND,
    START,
    Expected,
    Row,
    ask,
    brought_to,
    by_role,
    control,
    first_index,
    hertz,
    is_double,
    read_text,
    setting,
    table,
    write_command,
    write_text,
)
from tb.lib.seeds import seeded
from tb.model import fc_telegram as fc
from tb.model.vlt_drive import PROFILES, DriveError, VltDrive

FC_STATUS = ("vlt2800", "hvac_basic")
STAND_BY_STATUS = tuple(name for name in PROFILES if name not in FC_STATUS)
TWO_RAMPS = ("vlt5000", "vlt2800", "hvac_basic")


def rows(wanted=lambda row: True) -> list:
    """The wanted rows of every profile, as test parameters."""
    return [
        pytest.param(name, row, id=f"{name}-{row['pnu']}")
        for name in PROFILES
        for row in table(name)
        if wanted(row)
    ]


def write_setting(drive: VltDrive, profile: str, role: str, value: int, index: int = 0) -> None:
    """Writes the parameter with this role over the bus, in its width."""
    row = next(row for row in table(profile) if row["role"] == role)
    reply = ask(drive, write_command(row), int(row["pnu"]), value, index)
    assert reply.fault is None


# ---- each profile agrees with its table --------------------------------------------------------


def test_there_are_five_drives():
    assert set(PROFILES) == {"vlt6000", "vlt5000", "vlt2800", "vlt8000", "hvac_basic"}
    with pytest.raises(ValueError, match="no drive profile 'vlt7000', only hvac_basic, vlt2800, "):
        VltDrive("vlt7000")


@pytest.mark.parametrize("profile", PROFILES)
def test_table_is_small_and_its_rows_have_sources(profile: str):
    assert profile == "vlt6000" or 30 <= len(table(profile)) <= 80
    sources = {row["source"] for row in table(profile)}
    assert sources <= {"document", "partly", "memory", "simulator"}
    invented = {row["pnu"] for row in table(profile) if row["source"] == "simulator"}
    faults = {row["pnu"] for row in table(profile) if row["access"] in ("reset", "fixed", "denied")}
    assert invented == faults, "nothing is invented but what shows the fault numbers 6, 7 and 11"


@pytest.mark.parametrize(("profile", "row"), rows(lambda row: row["type"] != "text"))
def test_number_agrees_with_its_row(profile: str, row: Row):
    """Reply AK by type, default, limits, rights, array length: each parameter over the bus."""
    pnu, low, high, double = int(row["pnu"]), int(row["min"]), int(row["max"]), is_double(row)
    bits = 0xFFFFFFFF if double else 0xFFFF
    length, index = int(row["array"]), first_index(profile, row)
    drive = VltDrive(profile)
    reply = ask(drive, fc.AK_READ, pnu, ind=index)
    assert (reply.ak, reply.pnu, reply.ind) == (2 if double else 1, pnu, index)
    if not row["role"].startswith("show_"):
        assert reply.pwe == int(row["default"]) & bits
    assert ask(drive, fc.AK_READ, pnu, ind=index + max(length, 1)).fault == (3 if length else 4)
    if length:
        assert ask(drive, fc.AK_READ, pnu, ind=index + length - 1).fault is None
        assert index == 0 or ask(drive, fc.AK_READ, pnu, ind=0).fault == 3

    write = write_command(row)
    if row["access"] in ACCESS_FAULT:
        assert ask(drive, write, pnu, low, index).fault == ACCESS_FAULT[row["access"]]
        return
    assert ask(drive, fc.AK_WRITE_WORD if double else fc.AK_WRITE_DOUBLE, pnu, high, index).fault == 5
    if row["access"] == "reset":
        assert ask(drive, write, pnu, 1, index).fault == 6
        assert ask(drive, write, pnu, 0, index).fault is None
        assert drive.get(pnu, index) == 0
        return
    reply = ask(drive, write, pnu, high, index)
    assert (reply.fault, reply.pwe) == (None, high & bits)
    assert drive.get(pnu, index) == high
    for outside in (low - 1, high + 1):
        if outside & bits == outside or low < 0:
            assert ask(drive, write, pnu, outside, index).fault == 2
            assert drive.get(pnu, index) == high
    reply = ask(drive, write, pnu, low, index)
    assert (reply.fault, reply.pwe) == (None, low & bits)


@pytest.mark.parametrize(("profile", "row"), rows(lambda row: row["access"] == "rw"))
def test_parameters_that_need_a_stopped_motor_are_refused_while_it_runs(profile: str, row: Row):
    pnu = int(row["pnu"])
    drive = VltDrive(profile)
    control(drive, START, FULL_SPEED)
    if row["type"] == "text":
        reply = write_text(drive, pnu, b"RUN")
    else:
        reply = ask(drive, write_command(row), pnu, int(row["default"]), first_index(profile, row))
    assert reply.fault == (None if row["while_running"] == "1" else 17)


@pytest.mark.parametrize(("profile", "row"), rows(lambda row: row["type"] == "text"))
def test_text_has_its_own_length_and_is_written_where_allowed(profile: str, row: Row):
    pnu, writable = int(row["pnu"]), row["access"] == "rw"
    drive = VltDrive(profile)
    assert read_text(drive, pnu) == row["default"].encode()
    assert write_text(drive, pnu, b"NEW").fault == (None if writable else 1)
    assert read_text(drive, pnu) == (b"NEW" if writable else row["default"].encode())


@pytest.mark.parametrize(
    ("profile", "texts"),
    [
        ("vlt6000", {533, 534}),
        ("vlt8000", {533, 534}),
        ("vlt5000", set()),
        ("vlt2800", set()),
        ("hvac_basic", {37, 38, 39}),
    ],
)
def test_which_texts_can_be_written(profile: str, texts: set[int]):
    assert {int(r["pnu"]) for r in table(profile) if r["type"] == "text" and r["access"] == "rw"} == texts


@pytest.mark.parametrize("profile", PROFILES)
def test_drive_and_table_agree_on_random_parameter_telegrams(profile: str):
    rng = seeded(f"parameter telegrams of a {profile}")
    numbers = [int(row["pnu"]) for row in table(profile)]
    setup, bits = by_role(profile, "active_setup"), setting(profile, "pnu_bits", 11)
    lowest_setup = int(next(row["min"] for row in table(profile) if row["role"] == "active_setup"))
    answers: set[tuple[int, int | None]] = set()
    for turn in range(8000):
        if turn % 1000 == 0:
            drive, expected = VltDrive(profile), Expected(profile)
            drive.force_process(0x0607, 0)
        pnu = rng.choice([*numbers, *[setup] * 10, *[rng.randrange(1 << bits)] * 10])
        row = expected.rows.get(pnu, table(profile)[0])
        if row["role"].startswith("show_") or row["role"] == "address":
            continue
        is_text = row["type"] == "text"
        ak = rng.choice([15, 15, 1, 2] if is_text else [1, 1, 2, 2, 3, 3, 13, 14, rng.randrange(16)])
        index = rng.randrange(int(row["array"]) + 2) if rng.random() < 0.3 else first_index(profile, row)
        ind = index | rng.choice([4, 5, 5, rng.randrange(256)]) << 8
        near = [int(row[key]) + rng.randrange(-1, 2) for key in ("min", "max")] if not is_text else [0]
        pwe = rng.choice([*near, 0, rng.randrange(1 << 32), rng.randrange(1 << 16)]) & 0xFFFFFFFF
        adr = rng.choice([0x01, 0x81])
        text = rng.randbytes(rng.choice([4, rng.randrange(24)]))
        if ak == 15 and ind >> 8 == 5:
            request = fc.build_text(pnu, text, ind, adr=adr)
        else:
            request = fc.build_parameter(ak, pnu, ind, pwe, adr=adr)
        raw = drive.telegram(request)
        reply = fc.parse(raw, reply=True)
        wanted_ak, wanted = expected.reply(ak, pnu, ind, pwe, text)
        assert (reply.ak, reply.pwe if reply.text is None else reply.text) == (wanted_ak, wanted), (
            f"{request.hex(' ')}: {fc.describe(request)}: {fc.describe(raw, True)}"
        )
        if ak:
            assert (reply.adr, reply.pnu, reply.ind) == (adr, pnu, ind)
        assert (reply.pcd1, reply.pcd2) == (0x0607, 0)
        answers.add((reply.ak, reply.fault))
    faults = {0, 1, 2, 3, 4, 5, setting(profile, "fault_unknown_ak", 130)}
    faults |= {ACCESS_FAULT[row["access"]] for row in table(profile) if row["access"] in ACCESS_FAULT}
    faults -= set() if any(row["access"] == "local" for row in table(profile)) else {130}
    faults |= {6} if any(row["access"] == "reset" for row in table(profile)) else set()
    faults |= {131} if lowest_setup == 0 else set()
    assert answers <= {(0, None), (1, None), (2, None), (15, None), *((7, n) for n in faults)}
    assert {(1, None), (2, None), (15, None), (7, 0), (7, 1), (7, 2), (7, 3), (7, 4), (7, 5)} <= answers


# ---- numbers, indices, faults ------------------------------------------------------------------


@pytest.mark.parametrize("profile", [name for name in PROFILES if name != "hvac_basic"])
def test_older_drives_ignore_bit_11_of_pke(profile: str):
    reply = VltDrive(profile).telegram(fc.build_parameter(fc.AK_READ, 0x800 | 104))
    assert reply[3:5] == bytes.fromhex("10 68")


def test_the_hvac_basic_drive_uses_bit_11_of_pke():
    """3022 = BCEh, and 974 (the same number without bit 11) does not exist."""
    drive = VltDrive("hvac_basic")
    assert ask(drive, fc.AK_WRITE_WORD, 3022, 1).fault is None
    reply = drive.telegram(fc.build_parameter(fc.AK_READ, 3022))
    assert (reply[3:5], reply[7:11]) == (bytes.fromhex("1B CE"), bytes(3) + b"\x01")
    assert ask(drive, fc.AK_READ, 974).fault == 0
    greatest = ask(drive, fc.AK_READ, 4095)
    assert (greatest.pnu, greatest.fault) == (4095, 0)


def test_arrays_of_the_hvac_basic_drive_count_from_0():
    drive = VltDrive("hvac_basic")
    for index in range(8):
        assert ask(drive, fc.AK_WRITE_WORD, 310, 100 * index, index).fault is None
    assert [ask(drive, fc.AK_READ, 310, ind=i).pwe for i in range(8)] == [100 * i for i in range(8)]
    assert ask(drive, fc.AK_READ, 310, ind=8).fault == 3
    drive.trip(14)
    assert ask(drive, fc.AK_READ, 1530, ind=0).pwe == 14, "the newest alarm"


@pytest.mark.parametrize("profile", ["vlt6000", "vlt5000", "vlt2800", "vlt8000"])
def test_logs_of_the_older_drives_count_from_1(profile: str):
    drive = VltDrive(profile)
    drive.trip(14)
    assert ask(drive, fc.AK_READ, 615, ind=1).pwe == 14
    assert ask(drive, fc.AK_READ, 615, ind=0).fault == 3


@pytest.mark.parametrize(
    ("profile", "reset", "fixed", "denied"),
    [("vlt2800", 602, 640, 18), ("vlt8000", 602, 640, 4), ("hvac_basic", 1502, 1550, 1422)],
)
def test_the_built_in_drives_have_the_faults_6_7_11_and_18(profile: str, reset: int, fixed: int, denied: int):
    drive = VltDrive(profile)
    assert ask(drive, fc.AK_WRITE_DOUBLE, reset, 1).fault == 6
    assert ask(drive, fc.AK_READ, reset).pwe == 890
    assert ask(drive, fc.AK_EEPROM_DOUBLE, reset, 0).fault is None
    assert ask(drive, fc.AK_READ, reset).pwe == 0
    assert ask(drive, fc.AK_WRITE_WORD, fixed, 1).fault == 7
    assert ask(drive, fc.AK_WRITE_WORD, denied, 1).fault == 11
    assert ask(drive, 9, fixed, 1).fault == 18, "AK 9 is none"


@pytest.mark.parametrize("profile", ["vlt6000", "vlt5000"])
def test_option_card_drives_have_these_faults_only_on_demand(profile: str):
    drive = VltDrive(profile)
    assert ask(drive, 9, 104).fault == 130
    for fault in (6, 7, 11, 18):
        drive.refuse(104, fault)
        assert ask(drive, fc.AK_READ, 104).fault == fault


# ---- status word -------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", PROFILES)
def test_every_drive_powers_up_ready_with_0607(profile: str):
    drive = VltDrive(profile)
    assert control(drive, 0) == (0x0607, 0)
    assert drive.get(by_role(profile, "show_status_word")) == 0x0607


@pytest.mark.parametrize("profile", STAND_BY_STATUS)
def test_bit_2_is_stand_by(profile: str):
    """Set while the motor neither runs nor has a start command, coasting or not; bit 6 is never used."""
    drive = brought_to(50, profile)
    assert control(drive, 0)[0] == 0x0F03
    assert control(drive, COAST)[0] == 0x0607
    drive.trip_lock(4)
    assert control(drive, 0)[0] == 0x0608


@pytest.mark.parametrize("profile", FC_STATUS)
def test_bit_2_is_coasting_and_bit_6_trip_lock(profile: str):
    drive = brought_to(50, profile)
    assert control(drive, 0)[0] == 0x0F07, "running"
    assert control(drive, COAST)[0] == 0x0603, "bit 2 = 0: the motor is let go"
    assert control(drive, RAMP_STOP)[0] == 0x0607
    drive.trip(4)
    assert control(drive, 0)[0] == 0x0608
    assert control(drive, RAMP_STOP | RESET)[0] == 0x0607
    control(drive, RAMP_STOP)
    drive.trip_lock(4)
    assert control(drive, RAMP_STOP | RESET)[0] == 0x0648, "no reset before the mains have been off"
    drive.power_cycle()
    assert control(drive, 0)[0] == 0x0607


def test_bit_10_of_a_vlt_5000_goes_by_225_and_226():
    drive = brought_to(25, "vlt5000")
    assert control(drive, 0)[0] & 0x0400
    for pnu, value in ((225, 260), (225, 0), (226, 240)):
        assert ask(drive, fc.AK_WRITE_WORD, pnu, value).fault is None
        assert bool(control(drive, 0)[0] & 0x0400) == (value == 0)


# ---- control word ------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", PROFILES)
def test_every_drive_ramps_to_its_reference_and_jogs_and_stops(profile: str):
    drive = brought_to(50, profile)
    assert control(drive, 0)[1] == 0x4000
    jog = drive.get(by_role(profile, "jog_frequency"))
    control(drive, JOG)
    drive.step(20 * SECOND)
    assert hertz(drive) == jog / 10
    control(drive, RAMP_STOP)
    drive.step(10 * SECOND)
    assert control(drive, 0) == (0x0607, 0)


@pytest.mark.parametrize("profile", PROFILES)
def test_stronger_of_two_stops_is_obeyed(profile: str):
    """Coast, quick stop, DC brake, ramp stop: each beats those after it, on every drive."""
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
            control(drive, stops[stronger] & stops[weaker])
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


@pytest.mark.parametrize("choice", range(4))
@pytest.mark.parametrize(
    ("profile", "places"),
    [
        ("vlt6000", [(211, 0), (212, 0), (213, 0), (214, 0)]),
        ("vlt8000", [(211, 0), (212, 0), (213, 0), (214, 0)]),
        ("vlt5000", [(215, 0), (216, 0), (217, 0), (218, 0)]),
        ("vlt2800", [(215, 0), (216, 0), (217, 0), (218, 0)]),
        ("hvac_basic", [(310, 0), (310, 1), (310, 2), (310, 3)]),
    ],
)
def test_bits_0_and_1_choose_the_drives_own_presets(profile: str, places: list, choice: int):
    drive = VltDrive(profile)
    for (pnu, index), percent in zip(places, (1000, 2000, -3000, 4000), strict=True):
        assert ask(drive, fc.AK_WRITE_WORD, pnu, percent, index).fault is None
    control(drive, START | choice, 0x1000)  # 25 % from the bus
    drive.step(30 * SECOND)
    assert hertz(drive) == (17.5, 22.5, -2.5, 32.5)[choice], "sum of both"


@pytest.mark.parametrize(
    ("profile", "first", "second"),
    [
        ("vlt6000", (323, 0), (326, 0)),
        ("vlt8000", (323, 0), (326, 0)),
        ("vlt5000", (323, 0), (326, 0)),
        ("vlt2800", (323, 0), (341, 0)),
        ("hvac_basic", (540, 0), (540, 1)),
    ],
)
def test_bits_11_and_12_control_the_drives_outputs(profile: str, first: tuple, second: tuple):
    """Relays 1 and 2; on a VLT 2800 relay 01 and digital output 46."""
    bus = setting(profile, "relay_bus", 255)
    drive = VltDrive(profile)
    control(drive, RAMP_STOP | RELAY_1 | RELAY_2)
    assert (drive.relay(1), drive.relay(2)) == (False, False)
    for pnu, index in (first, second):
        assert ask(drive, fc.AK_WRITE_WORD, pnu, bus, index).fault is None
    assert (drive.relay(1), drive.relay(2)) == (True, True)
    control(drive, RAMP_STOP | RELAY_1)
    assert (drive.relay(1), drive.relay(2)) == (True, False)
    control(drive, RAMP_STOP | RELAY_2)
    assert (drive.relay(1), drive.relay(2)) == (False, True)
    running, alarm = (setting(profile, key, 255) for key in ("relay_running", "relay_alarm"))
    ask(drive, fc.AK_WRITE_WORD, first[0], running, first[1])
    ask(drive, fc.AK_WRITE_WORD, second[0], alarm, second[1])
    control(drive, START, FULL_SPEED)
    assert (drive.relay(1), drive.relay(2)) == (True, False)
    drive.trip(4)
    assert (drive.relay(1), drive.relay(2)) == (False, True)


@pytest.mark.parametrize(("profile", "seconds"), [("vlt2800", 1), ("vlt8000", 60), ("hvac_basic", 1)])
def test_bus_timeout_is_detected(profile: str, seconds: int):
    drive = brought_to(25, profile)
    write_setting(drive, profile, "bus_time_function", 5)
    control(drive, START, 0x2000)
    drive.step(seconds * SECOND)
    assert hertz(drive) == 25
    drive.step(6 * SECOND)
    assert (hertz(drive), drive.alarm) == (0, 17), "stop and trip"


# ---- each document's examples on its own drive -------------------------------------------------


@pytest.mark.parametrize(
    ("profile", "status", "frequency"),
    [
        ("vlt6000", 0x0F03, 0x2000),
        ("vlt5000", 0x0F03, 0x2000),
        ("vlt8000", 0x0F03, 0x2000),
        ("vlt2800", 0x0607, 0),
        ("hvac_basic", 0x0607, 0),
    ],
)
def test_the_example_state_is_that_of_the_profiles_document(profile: str, status: int, frequency: int):
    drive = VltDrive(profile, example=True)
    assert control(drive, START, FULL_SPEED) == (status, frequency), "and no command changes it"


@pytest.mark.parametrize(
    ("modbus", "request_hex", "reply_hex"),
    [
        (  # example 4: 040Fh = 1039 = 104 x 10 - 1
            "01 06 04 0F 00 3C",
            "02 0E 81 20 68 00 00 00 00 00 3C 00 00 00 00 F9",
            "02 0E 81 10 68 00 00 00 00 00 3C 0F 03 20 00 E5",
        ),
        (  # example 5: 1413h = 5139 = 514 x 10 - 1
            "01 03 14 13 00 02",
            "02 0E 81 12 02 00 00 00 00 00 00 00 00 00 00 9D",
            "02 0E 81 22 02 00 00 00 00 01 2C 0F 03 20 00 AC",
        ),
    ],
    ids=["4", "5"],
)
@pytest.mark.parametrize("profile", ["vlt5000", "vlt6000", "vlt8000"])
def test_the_option_cards_examples_4_and_5(profile: str, modbus: str, request_hex: str, reply_hex: str):
    """The page says VLT 5000; the manuals of VLT 6000 and built-in drives have the same examples."""
    pnu = (int(modbus[6:11].replace(" ", ""), 16) + 1) // 10
    assert int(request_hex[9:14].replace(" ", ""), 16) & 0x07FF == pnu
    drive = VltDrive(profile, example=True)
    assert drive.telegram(bytes.fromhex(request_hex)) == bytes.fromhex(reply_hex)


def test_a_vlt_5000_shows_the_motor_current_at_its_own_number_too():
    drive = brought_to(50, "vlt5000")
    assert drive.get(514) == drive.get(520) == 600
    example = VltDrive("vlt5000", example=True)
    assert example.get(514) == example.get(520) == 300


def test_the_built_in_drives_example_6_reads_an_element_of_a_log():
    """Register 9 = 8, then 609 at 6089: log reference of index 8 is 40.0 %."""
    drive = VltDrive("vlt8000", example=True)
    request = bytes.fromhex("02 0E 81 12 61 00 08 00 00 00 00 00 00 00 00 F6")
    assert drive.telegram(request) == bytes.fromhex("02 0E 81 12 61 00 08 00 00 01 90 0F 03 20 00 4B")


STATUS_0607 = "02 06 81 06 07 00 00 84"


@pytest.mark.parametrize("profile", FC_STATUS)
@pytest.mark.parametrize(
    ("modbus", "request_hex", "control_word"),
    [
        ("0F coils 1-32: nothing set", "02 06 81 00 00 00 00 85", 0),
        ("05 coil 1: on", "02 06 81 00 01 00 00 84", 0),
        ("0F coils 1-10: FF 03", "02 06 81 03 FF 00 00 79", 0),
        ("0F coils 1-32: start, 40 %", "02 06 81 04 7C 19 99 7D", 0x047C),
    ],
    ids=lambda text: text if isinstance(text, str) and "coil" in text else "",
)
def test_status_example_is_0607_after_any_coil_write(
    profile: str, modbus: str, request_hex: str, control_word: int
):
    """Coils 33-48 are then 07 06; words without bit 10 are no command."""
    drive = VltDrive(profile, example=True)
    assert drive.telegram(bytes.fromhex(request_hex)) == bytes.fromhex(STATUS_0607), modbus
    assert drive.control_word == control_word


def test_the_built_in_drives_page_with_status_55_aa():
    """The coils 33-48 of that page, 55 AA, are status word AA55h."""
    drive = VltDrive("vlt2800")
    drive.force_process(0xAA55, 0)
    assert control(drive, 0) == (0xAA55, 0)


def test_two_registers_set_105_of_a_vlt_2800_to_7_38_a():
    """10h at 0419h, 0000 02E2: 105 is a double word."""
    drive = VltDrive("vlt2800", example=True)
    request = bytes.fromhex("02 0E 81 30 69 00 00 00 00 02 E2 00 00 00 00 34")
    assert drive.telegram(request) == bytes.fromhex("02 0E 81 20 69 00 00 00 00 02 E2 06 07 00 00 25")
    assert drive.get(105) == 738
    drive.power_cycle()
    assert drive.get(105) == 370, "coil 65 off: RAM alone"
    drive.telegram(fc.build_parameter(fc.AK_EEPROM_DOUBLE, 105, pwe=738))
    drive.power_cycle()
    assert drive.get(105) == 738, "coil 65 on"
    assert ask(drive, fc.AK_WRITE_WORD, 105, 738).fault == 5, "one register does not do"


@pytest.mark.parametrize(
    ("profile", "request_pke", "value", "reply_pke"),
    [
        ("vlt2800", 0xE0CA, 0x03E8, 0x10CA),  # 202 = 100.0 Hz
        ("vlt6000", 0xE19F, 0x0014, 0x119F),  # 415 = choice 20
        ("hvac_basic", 0xE19E, 0x03E8, 0x119E),  # 4-14 = 100.0 Hz
    ],
)
def test_the_design_guides_write_examples(profile: str, request_pke: int, value: int, reply_pke: int):
    drive = VltDrive(profile)
    request = fc.build(fc.words(request_pke, 0, 0, value, 0, 0))
    reply = drive.telegram(request)
    assert reply[3:11] == fc.words(reply_pke, 0, 0, value)
    drive.power_cycle()
    assert drive.get(request_pke & 0x07FF) == value, "E: kept in EEPROM"


def test_the_design_guide_reads_a_ramp_time_of_10_s():
    """207 of a VLT 2800 in hundredths of a second, a double word."""
    drive = VltDrive("vlt2800")
    drive.set(207, 1000)
    reply = drive.telegram(fc.build(fc.words(0x10CF, 0, 0, 0, 0, 0)))
    assert reply[3:11] == fc.words(0x20CF, 0, 0, 0x03E8)


@pytest.mark.parametrize(
    ("registers", "pnu", "kind"),
    [(1, 1613, "word"), (2, 1614, "double"), *((n, 37, "text") for n in range(1, 11))],
)
def test_reads_of_1_to_10_registers_find_their_data_on_the_hvac_basic_drive(
    registers: int, pnu: int, kind: str
):
    """Word in one register, double word in two, text of 2 to 20 characters in 1 to 10."""
    drive = VltDrive("hvac_basic", example=True)
    if kind == "text":
        text = b"ABCDEFGHIJKLMNOPQRST"[: 2 * registers]
        assert write_text(drive, pnu, text).fault is None
        assert read_text(drive, pnu) == text
        assert ask(drive, fc.AK_READ, pnu).fault == 5, "tried as a number first"
    else:
        drive.set(pnu, 0x01234567 if kind == "double" else 0x0123)
        reply = ask(drive, fc.AK_READ, pnu)
        assert (reply.ak, reply.pwe) == ((2, 0x01234567) if kind == "double" else (1, 0x0123))


@pytest.mark.parametrize("on", [False, True])
def test_coil_65_selects_eeprom_on_the_hvac_basic_drive(on: bool):
    drive = VltDrive("hvac_basic", example=True)
    assert ask(drive, fc.AK_EEPROM_WORD if on else fc.AK_WRITE_WORD, 123, 60).fault is None
    assert ask(drive, fc.AK_EEPROM_DOUBLE if on else fc.AK_WRITE_DOUBLE, 124, 738).fault is None
    drive.power_cycle()
    assert (drive.get(123), drive.get(124)) == ((60, 738) if on else (50, 600))
    assert drive.eeprom_writes == (2 if on else 0)


def test_direct_access_uses_the_indices_of_the_profile():
    drive = VltDrive("hvac_basic")
    drive.set(310, 2500, index=7)
    assert drive.get(310, 7) == 2500
    with pytest.raises(DriveError):
        drive.get(310, 8)
