-- SPDX-License-Identifier: Apache-2.0
-- Generated from regs/fc.toml by `make regs`; edit that, not this one.

local t = {}

t.request = {
  [0] = "no parameter",
  [1] = "read",
  [2] = "write word to RAM",
  [3] = "write double word to RAM",
  [13] = "write double word to RAM and EEPROM",
  [14] = "write word to RAM and EEPROM",
  [15] = "text",
}

t.reply = {
  [0] = "no parameter",
  [1] = "word",
  [2] = "double word",
  [7] = "refused",
  [15] = "text",
}

t.fault = {
  [0] = "parameter does not exist",
  [1] = "no write access",
  [2] = "value exceeds limits",
  [3] = "sub-index does not exist",
  [4] = "parameter is no array",
  [5] = "data type does not match",
  [6] = "can only be reset",
  [7] = "cannot be changed",
  [11] = "no right to write",
  [17] = "not possible in the present mode",
  [18] = "other fault of the drive",
  [130] = "no bus access",
  [131] = "factory setup selected",
}

t.control = {
  { id = "preset_lsb", bit = 0, name = "Preset reference LSB", zero = "0", one = "1" },
  { id = "preset_msb", bit = 1, name = "Preset reference MSB", zero = "0", one = "1" },
  { id = "dc_brake", bit = 2, name = "DC brake", zero = "DC brake", one = "no DC brake" },
  { id = "coast", bit = 3, name = "Coast stop", zero = "coast stop", one = "no coast stop" },
  { id = "quick_stop", bit = 4, name = "Quick stop", zero = "quick stop", one = "no quick stop" },
  { id = "freeze", bit = 5, name = "Freeze frequency", zero = "freeze", one = "no freeze" },
  { id = "start", bit = 6, name = "Ramp stop / start", zero = "ramp stop", one = "start" },
  { id = "reset", bit = 7, name = "Reset", zero = "no reset", one = "reset" },
  { id = "jog", bit = 8, name = "Jog", zero = "no jog", one = "jog" },
  { id = "bit9", bit = 9, name = "No function", zero = "0", one = "1", only = "one_ramp" },
  { id = "ramp", bit = 9, name = "Ramp", zero = "ramp 1", one = "ramp 2", only = "two_ramps" },
  { id = "valid", bit = 10, name = "Data valid", zero = "data not valid", one = "data valid" },
  { id = "relay1", bit = 11, name = "Relay 1", zero = "off", one = "on" },
  { id = "relay2", bit = 12, name = "Relay 2", zero = "off", one = "on" },
  { id = "setup_lsb", bit = 13, name = "Setup LSB", zero = "0", one = "1" },
  { id = "setup_msb", bit = 14, name = "Setup MSB", zero = "0", one = "1" },
  { id = "reverse", bit = 15, name = "Reversing", zero = "no reversing", one = "reversing" },
}

t.status = {
  { id = "control_ready", bit = 0, name = "Control ready", zero = "not ready", one = "ready" },
  { id = "drive_ready", bit = 1, name = "Drive ready", zero = "not ready", one = "ready" },
  { id = "stand_by", bit = 2, name = "Stand by", zero = "no", one = "stand by", only = "vlt_status" },
  { id = "not_coasting", bit = 2, name = "Coasting", zero = "coasting", one = "not coasting", only = "fc_status" },
  { id = "trip", bit = 3, name = "Trip", zero = "no trip", one = "trip" },
  { id = "bit4", bit = 4, name = "Not in use", zero = "0", one = "1" },
  { id = "bit5", bit = 5, name = "Not in use", zero = "0", one = "1" },
  { id = "bit6", bit = 6, name = "Not in use", zero = "0", one = "1", only = "vlt_status" },
  { id = "trip_lock", bit = 6, name = "Trip lock", zero = "no trip lock", one = "trip lock", only = "fc_status" },
  { id = "warning", bit = 7, name = "Warning", zero = "no warning", one = "warning" },
  { id = "on_reference", bit = 8, name = "Speed = reference", zero = "no", one = "yes" },
  { id = "bus_control", bit = 9, name = "Serial control", zero = "local control", one = "possible" },
  { id = "in_range", bit = 10, name = "Frequency in range", zero = "out of range", one = "in range" },
  { id = "running", bit = 11, name = "Running", zero = "not running", one = "running" },
  { id = "bit12", bit = 12, name = "No function", zero = "0", one = "1" },
  { id = "voltage_warning", bit = 13, name = "Voltage warning", zero = "no warning", one = "warning" },
  { id = "current_limit", bit = 14, name = "Current limit", zero = "no", one = "at the limit" },
  { id = "thermal_warning", bit = 15, name = "Thermal warning", zero = "no warning", one = "warning" },
}

t.drive_names = { "hvac_basic", "vlt2800", "vlt5000", "vlt6000", "vlt8000" }

return t
