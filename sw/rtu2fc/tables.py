# SPDX-License-Identifier: Apache-2.0
# Generated from regs/fc.toml by `make regs`; edit that, not this one.

REQUEST = {
    0: "no parameter",
    1: "read",
    2: "write word to RAM",
    3: "write double word to RAM",
    13: "write double word to RAM and EEPROM",
    14: "write word to RAM and EEPROM",
    15: "text",
}

REPLY = {
    0: "no parameter",
    1: "word",
    2: "double word",
    7: "refused",
    15: "text",
}

FAULT = {
    0: "parameter does not exist",
    1: "no write access",
    2: "value exceeds limits",
    3: "sub-index does not exist",
    4: "parameter is no array",
    5: "data type does not match",
    6: "can only be reset",
    7: "cannot be changed",
    11: "no right to write",
    17: "not possible in the present mode",
    18: "other fault of the drive",
    130: "no bus access",
    131: "factory setup selected",
}

# Bit, the kind of drive that has it, the phrases for 0 and 1; "" says nothing.
CONTROL = (
    (0, None, "", "Preset reference LSB"),
    (1, None, "", "Preset reference MSB"),
    (2, None, "DC brake", ""),
    (3, None, "coast stop", ""),
    (4, None, "quick stop", ""),
    (5, None, "freeze", ""),
    (6, None, "ramp stop", "start"),
    (7, None, "", "reset"),
    (8, None, "", "jog"),
    (9, "one_ramp", "", "bit 9"),
    (9, "two_ramps", "ramp 1", "ramp 2"),
    (10, None, "data not valid", "data valid"),
    (11, None, "", "Relay 1"),
    (12, None, "", "Relay 2"),
    (13, None, "", "Setup LSB"),
    (14, None, "", "Setup MSB"),
    (15, None, "", "reversing"),
)

STATUS = (
    (0, None, "", "Control ready"),
    (1, None, "", "Drive ready"),
    (2, "vlt_status", "", "stand by"),
    (2, "fc_status", "coasting", ""),
    (3, None, "", "trip"),
    (4, None, "", "bit 4"),
    (5, None, "", "bit 5"),
    (6, "vlt_status", "", "bit 6"),
    (6, "fc_status", "", "trip lock"),
    (7, None, "", "Warning"),
    (8, None, "", "Speed = reference"),
    (9, None, "local control", "Serial control"),
    (10, None, "", "Frequency in range"),
    (11, None, "", "running"),
    (12, None, "", "bit 12"),
    (13, None, "", "Voltage warning"),
    (14, None, "", "Current limit"),
    (15, None, "", "Thermal warning"),
)
