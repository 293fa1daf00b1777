/* SPDX-License-Identifier: Apache-2.0
 *
 * Simulated VLT drive; interface and use: vlt_drive.h.
 *
 * Choices where the documents are silent (all of them the simulator's own):
 * - An AK that no table lists (4 to 12) is refused: fault 130, or what the profile says.
 * - Word replies carry PWE high = 0, also for a negative int16. Word writes ignore PWE high.
 * - AK 0 is answered with AK 0, index and value zero.
 * - Order of the fault checks: 0, unknown AK, 5 (text read as number or the reverse), 4, 3,
 *   then for writes the access (1, 130, 7, 11), 5 (word against double word), 131, 17, 6, 2.
 * - The first element of a log array is the newest entry.
 * - In one telegram the parameter part is executed before the process part.
 * - A text write is answered with the text; texts are always kept in EEPROM.
 * - Digital inputs are not wired: nothing started or reversed there, terminal 27 closed (no coasting).
 * - The references of bus and preset are added, whatever the parameter for that says.
 * - Jog counts as a start and overrides freeze; every stop overrides freeze.
 * - The control word's bits 11 to 14 (relays, setup) do nothing that an observer sees.
 */
#include "vlt_drive.h"

#include <string.h>

#include "drive_profiles.h" /* made from the profiles: the array drive_profiles */

enum { STX = 0x02, NOWHERE = 0xFFFF };

enum { /* control word */
  CTW_PRESET = 0x0003,
  CTW_NO_DC_BRAKE = 1 << 2,
  CTW_NO_COAST = 1 << 3,
  CTW_NO_QUICK_STOP = 1 << 4,
  CTW_NO_FREEZE = 1 << 5,
  CTW_START = 1 << 6,
  CTW_RESET = 1 << 7,
  CTW_JOG = 1 << 8,
  CTW_RAMP_2 = 1 << 9,
  CTW_VALID = 1 << 10,
  CTW_REVERSE = 1 << 15
};

enum { /* status word */
  STW_CONTROL_READY = 1 << 0,
  STW_DRIVE_READY = 1 << 1,
  STW_STAND_BY = 1 << 2,
  STW_NOT_COASTING = 1 << 2, /* the same bit of another drive */
  STW_TRIP = 1 << 3,
  STW_ON_REFERENCE = 1 << 8,
  STW_BUS_CONTROL = 1 << 9,
  STW_IN_RANGE = 1 << 10,
  STW_RUNNING = 1 << 11,
  STW_CURRENT_LIMIT = 1 << 14
};

enum { BUS_FUNCTION_OFF, BUS_FREEZE, BUS_STOP, BUS_JOG, BUS_MAX, BUS_STOP_AND_TRIP };
enum { ALARM_BUS_TIME_OUT = 17, ALARM_MAX = 99 };

typedef enum { GO_COAST, GO_QUICK_STOP, GO_DC_BRAKE, GO_STOP, GO_RUN } command_t;

#define FULL_SCALE 16384          /* 4000h = 100 % of reference or output frequency */
#define FULL_SUM (FULL_SCALE * INT64_C(10000))
#define NANO 9                    /* decimals: frequency in nHz */
#define MILLI 3                   /* decimals: time in ms */
#define NHZ_PER_MHZ INT64_C(1000000)
#define MAGNETISING_PERCENT 50    /* of rated current, no-load current of the motor */
#define CURRENT_MAX_PERCENT 150   /* of rated current */

/* ---- parameters ------------------------------------------------------------------------------ */

const drive_profile_t *drive_profile(const char *name) {
  for (size_t i = 0; i < sizeof drive_profiles / sizeof drive_profiles[0]; i++) {
    if (strcmp(drive_profiles[i].name, name) == 0) return &drive_profiles[i];
  }
  return NULL;
}

const char *drive_profile_name(size_t index) {
  return index < sizeof drive_profiles / sizeof drive_profiles[0] ? drive_profiles[index].name : NULL;
}

/* Index of a parameter in the profile's table, NOWHERE if there is none. */
static uint16_t find(const drive_t *d, uint16_t pnu) {
  uint16_t low = 0;
  uint16_t high = d->profile->count;
  while (low < high) {
    uint16_t middle = (uint16_t)((low + high) / 2);
    if (d->profile->parameters[middle].pnu < pnu) {
      low = (uint16_t)(middle + 1);
    } else {
      high = middle;
    }
  }
  return low < d->profile->count && d->profile->parameters[low].pnu == pnu ? low : NOWHERE;
}

static const drive_parameter_t *by_role(const drive_t *d, drive_role_t role) {
  uint16_t at = d->by_role[role];
  return at == NOWHERE ? NULL : &d->profile->parameters[at];
}

static int64_t setting(const drive_t *d, drive_role_t role, int64_t fallback) {
  const drive_parameter_t *p = by_role(d, role);
  return p == NULL ? fallback : d->ram[p->slot];
}

/* Quotient rounded to the nearest, halves away from 0; the divisor is positive. */
static int64_t divide(int64_t value, int64_t divisor) {
  return (value < 0 ? value - divisor / 2 : value + divisor / 2) / divisor;
}

static int64_t scale(int64_t raw, int power_of_ten) {
  int64_t factor = 1;
  for (int i = power_of_ten < 0 ? -power_of_ten : power_of_ten; i > 0; i--) factor *= 10;
  return power_of_ten < 0 ? divide(raw, factor) : raw * factor;
}

/* A setting in units of 10^-decimals, for any conversion index. */
static int64_t scaled(const drive_t *d, drive_role_t role, int decimals, int64_t fallback) {
  const drive_parameter_t *p = by_role(d, role);
  return p == NULL ? fallback : scale(d->ram[p->slot], p->conversion + decimals);
}

static bool is_double(const drive_parameter_t *p) {
  return p->type == DRIVE_INT32 || p->type == DRIVE_UINT32;
}

/* Rated motor frequency in mHz; a safe divisor for every value that drive_set() can store. */
static int64_t rated_mhz(const drive_t *d) {
  int64_t mhz = scaled(d, DRIVE_ROLE_MOTOR_FREQUENCY, MILLI, 50000);
  return mhz > 0 ? mhz : 1;
}

static void log_fault(drive_t *d, drive_role_t role, int64_t newest) {
  const drive_parameter_t *p = by_role(d, role);
  if (p == NULL) return;
  for (uint16_t i = (uint16_t)(p->length - 1); i > 0; i--) {
    d->ram[p->slot + i] = d->ram[p->slot + i - 1];
    d->eeprom[p->slot + i] = d->ram[p->slot + i];
  }
  d->ram[p->slot] = newest;
  d->eeprom[p->slot] = newest;
}

/* ---- motor ----------------------------------------------------------------------------------- */

static int64_t magnitude(int64_t value) { return value < 0 ? -value : value; }

static bool bus_timed_out(const drive_t *d) {
  uint64_t limit_ms = (uint64_t)scaled(d, DRIVE_ROLE_BUS_TIME, MILLI, 0);
  return d->controlled && setting(d, DRIVE_ROLE_BUS_TIME_FUNCTION, BUS_FUNCTION_OFF) != BUS_FUNCTION_OFF &&
         d->bus_idle_us > limit_ms * 1000;
}

static int64_t bus_time_out_function(const drive_t *d) {
  return bus_timed_out(d) ? setting(d, DRIVE_ROLE_BUS_TIME_FUNCTION, BUS_FUNCTION_OFF) : BUS_FUNCTION_OFF;
}

/* A command from bus and (unwired, so false) digital input, joined as the selector says: 0 digital
 * input, 1 bus, 2 logic and, 3 logic or. A drive without this selector: the bus alone. */
static bool selected(const drive_t *d, drive_role_t selector, bool bus) {
  int64_t how = setting(d, selector, 3);
  return bus && (how == 1 || how == 3);
}

/* Command for the motor; precedence of the stops: coast, quick stop, DC brake, ramp stop. */
static command_t command(const drive_t *d) {
  uint16_t ctw = d->control;
  if (d->alarm != 0) return GO_COAST;
  if (!d->controlled) return GO_STOP;
  switch (bus_time_out_function(d)) {
    case BUS_STOP:
    case BUS_STOP_AND_TRIP:
      return GO_STOP;
    case BUS_JOG:
    case BUS_MAX:
      return GO_RUN;
    default:
      break;
  }
  if (selected(d, DRIVE_ROLE_SELECT_COAST, !(ctw & CTW_NO_COAST))) return GO_COAST;
  if (selected(d, DRIVE_ROLE_SELECT_QUICK_STOP, !(ctw & CTW_NO_QUICK_STOP))) return GO_QUICK_STOP;
  if (selected(d, DRIVE_ROLE_SELECT_DC_BRAKE, !(ctw & CTW_NO_DC_BRAKE))) return GO_DC_BRAKE;
  if (ctw & CTW_JOG) return GO_RUN;
  if (selected(d, DRIVE_ROLE_SELECT_START, (ctw & CTW_START) != 0)) return GO_RUN;
  return GO_STOP;
}

/* Sum of bus and preset reference (in 0.01 %), -FULL_SUM..FULL_SUM for -100..100 %. */
static int64_t reference_sum(const drive_t *d) {
  const drive_parameter_t *presets = by_role(d, DRIVE_ROLE_PRESETS);
  int64_t external = d->reference >= 0x8000 ? (int64_t)d->reference - 0x10000 : d->reference;
  unsigned choice = selected(d, DRIVE_ROLE_SELECT_PRESET, true) ? d->control & CTW_PRESET : 0;
  int64_t preset = presets == NULL ? 0 : scale(d->ram[presets->slot + choice], presets->conversion + 2);
  int64_t sum = external * 10000 + preset * FULL_SCALE;
  if (sum > FULL_SUM) sum = FULL_SUM;
  if (sum < -FULL_SUM) sum = -FULL_SUM;
  return d->controlled ? sum : 0;
}

/* Reference in nHz: 0..100 % is the span of minimum to maximum reference; the sign is the direction. */
static int64_t reference_nhz(const drive_t *d) {
  int64_t sum = reference_sum(d);
  int64_t low = scaled(d, DRIVE_ROLE_REFERENCE_MIN, MILLI, 0);
  int64_t high = scaled(d, DRIVE_ROLE_REFERENCE_MAX, MILLI, 50000);
  int64_t mhz = low + divide((high - low) * magnitude(sum), FULL_SUM);
  return (sum < 0 ? -mhz : mhz) * NHZ_PER_MHZ;
}

static bool jogging(const drive_t *d, int64_t bus_function) {
  return bus_function == BUS_JOG || (bus_function == BUS_FUNCTION_OFF && (d->control & CTW_JOG));
}

/* Output frequency that the references demand, within the limits of the output frequency. */
static int64_t wanted_nhz(const drive_t *d) {
  int64_t low = scaled(d, DRIVE_ROLE_FREQUENCY_MIN, NANO, 0);
  int64_t high = scaled(d, DRIVE_ROLE_FREQUENCY_MAX, NANO, 50 * INT64_C(1000000000));
  int64_t function = bus_time_out_function(d);
  bool reverse = selected(d, DRIVE_ROLE_SELECT_REVERSING, (d->control & CTW_REVERSE) != 0);
  int64_t wanted = reference_nhz(d);
  if (jogging(d, function)) {
    wanted = scaled(d, DRIVE_ROLE_JOG_FREQUENCY, NANO, 0);
  } else if (function == BUS_MAX) {
    wanted = high;
  }
  bool negative = (wanted < 0) != reverse;
  wanted = magnitude(wanted);
  if (wanted < low) wanted = low;
  if (wanted > high) wanted = high;
  return negative ? -wanted : wanted;
}

/* True while freeze holds the output frequency. Jog overrides freeze. */
static bool frozen(const drive_t *d) {
  int64_t function = bus_time_out_function(d);
  if (jogging(d, function) || function == BUS_MAX) return false;
  return function == BUS_FREEZE || !(d->control & CTW_NO_FREEZE);
}

/* The ramp that bit 9 of the control word selects, if the drive has two. */
static drive_role_t chosen_ramp(const drive_t *d, drive_role_t first, drive_role_t second) {
  return (d->control & CTW_RAMP_2) && by_role(d, second) != NULL ? second : first;
}

static drive_role_t ramp_down(const drive_t *d) {
  return chosen_ramp(d, DRIVE_ROLE_RAMP_DOWN, DRIVE_ROLE_RAMP_DOWN_2);
}

static drive_role_t quick_stop_ramp(const drive_t *d) {
  return by_role(d, DRIVE_ROLE_QUICK_STOP_RAMP) != NULL ? DRIVE_ROLE_QUICK_STOP_RAMP : ramp_down(d);
}

/* Move the output frequency towards a target for 1 ms; a ramp time is that from 0 to the rated
 * motor frequency. Frequencies fall on the ramp-down time, also towards a reversal. */
static void ramp(drive_t *d, int64_t target, drive_role_t down) {
  int64_t from = d->frequency_nhz;
  int64_t rated = scaled(d, DRIVE_ROLE_MOTOR_FREQUENCY, NANO, 50 * INT64_C(1000000000));
  bool rising = (from >= 0 && target > from) || (from <= 0 && target < from);
  drive_role_t up = chosen_ramp(d, DRIVE_ROLE_RAMP_UP, DRIVE_ROLE_RAMP_UP_2);
  int64_t time_ms = scaled(d, rising ? up : down, MILLI, 0);
  int64_t step = time_ms > 0 ? rated / time_ms : INT64_MAX;
  int64_t stop_at = !rising && (from > 0) != (target > 0) ? 0 : target; /* turn round at standstill */
  if (magnitude(stop_at - from) <= step) {
    d->frequency_nhz = stop_at;
  } else {
    d->frequency_nhz += stop_at > from ? step : -step;
  }
}

/* Effects without a ramp: output off, brake on. */
static void settle(drive_t *d) {
  command_t go = d->forced ? GO_COAST : command(d);
  if (go == GO_DC_BRAKE) {
    if (!d->dc_braking && d->frequency_nhz != 0) {
      d->dc_brake_us = scaled(d, DRIVE_ROLE_DC_BRAKE_TIME, MILLI, 0) * 1000;
    }
    d->dc_braking = true;
    d->frequency_nhz = 0;
    return;
  }
  d->dc_braking = false;
  d->dc_brake_us = 0;
  if (go == GO_COAST) d->frequency_nhz = 0;
}

static void step_ms(drive_t *d) {
  if (d->controlled) d->bus_idle_us += 1000;
  if (bus_time_out_function(d) == BUS_STOP_AND_TRIP && d->frequency_nhz == 0) {
    drive_trip(d, ALARM_BUS_TIME_OUT);
  }
  settle(d);
  if (d->forced) return;
  if (d->dc_brake_us > 0) d->dc_brake_us -= d->dc_brake_us < 1000 ? d->dc_brake_us : 1000;
  switch (command(d)) {
    case GO_RUN:
      if (!frozen(d)) ramp(d, wanted_nhz(d), ramp_down(d));
      break;
    case GO_STOP:
      ramp(d, 0, ramp_down(d));
      break;
    case GO_QUICK_STOP:
      ramp(d, 0, quick_stop_ramp(d));
      break;
    default:
      break;
  }
  if (d->frequency_nhz != 0) d->run_us += 1000;
}

void drive_step(drive_t *d, uint32_t microseconds) {
  uint64_t us = (uint64_t)d->fraction_us + microseconds;
  for (; us >= 1000; us -= 1000) step_ms(d);
  d->fraction_us = (uint32_t)us;
}

bool drive_running(const drive_t *d) {
  if (d->forced) return false;
  return d->frequency_nhz != 0 || d->dc_brake_us > 0 || command(d) == GO_RUN;
}

/* Load model of a fan, in units of the rated current's raw value. At rest 0. Braking: the DC brake's. Turning:
 * the magnetising current, rising with the square of the speed to the rated current at rated frequency (never
 * above CURRENT_MAX_PERCENT). */
static int64_t current_raw(const drive_t *d) {
  int64_t rated = setting(d, DRIVE_ROLE_MOTOR_CURRENT, 600);
  int64_t mhz = magnitude(d->frequency_nhz) / NHZ_PER_MHZ;
  if (d->alarm != 0) return 0;
  if (d->dc_brake_us > 0) return rated * setting(d, DRIVE_ROLE_DC_BRAKE_CURRENT, 0) / 100;
  if (!drive_running(d)) return 0;
  int64_t magnetising = rated * MAGNETISING_PERCENT / 100;
  int64_t load = mhz * 1000 / rated_mhz(d); /* speed in 0.1 % */
  int64_t current = magnetising + (rated - magnetising) * (load * load) / 1000000;
  int64_t most = rated * CURRENT_MAX_PERCENT / 100;
  return current > most ? most : current;
}

/* Power of the fan in mW, rising with the cube of the speed. */
static int64_t power_mw(const drive_t *d) {
  int64_t speed = magnitude(d->frequency_nhz) / NHZ_PER_MHZ * 1000 / rated_mhz(d); /* 0.1 % */
  if (speed > 1500) speed = 1500;
  return scaled(d, DRIVE_ROLE_MOTOR_POWER, MILLI, 0) * (speed * speed * speed / 1000) / 1000000;
}

static uint16_t live_status(const drive_t *d) {
  unsigned status = STW_BUS_CONTROL;
  int64_t output = magnitude(d->frequency_nhz);
  bool running = d->frequency_nhz != 0 || command(d) == GO_RUN;
  bool fc = d->profile->fc_status;
  if (d->alarm != 0) {
    status |= STW_TRIP;
  } else {
    status |= STW_CONTROL_READY | STW_DRIVE_READY;
    if (running) status |= STW_RUNNING;
    if (fc && command(d) != GO_COAST) status |= STW_NOT_COASTING;
    if (!fc && !running) status |= STW_STAND_BY;
    if (command(d) == GO_RUN && d->frequency_nhz == wanted_nhz(d)) status |= STW_ON_REFERENCE;
    const drive_parameter_t *limit = by_role(d, DRIVE_ROLE_CURRENT_LIMIT);
    const drive_parameter_t *rated = by_role(d, DRIVE_ROLE_MOTOR_CURRENT);
    if (limit != NULL && rated != NULL &&
        scale(current_raw(d), rated->conversion + MILLI) > scaled(d, DRIVE_ROLE_CURRENT_LIMIT, MILLI, 0)) {
      status |= STW_CURRENT_LIMIT;
    }
  }
  int64_t low = scaled(d, DRIVE_ROLE_FREQUENCY_MIN, NANO, 0);
  int64_t high = scaled(d, DRIVE_ROLE_FREQUENCY_MAX, NANO, INT64_MAX);
  if (output >= scaled(d, DRIVE_ROLE_RANGE_LOW, NANO, low) &&
      output <= scaled(d, DRIVE_ROLE_RANGE_HIGH, NANO, high)) {
    status |= STW_IN_RANGE;
  }
  return (uint16_t)status;
}

uint16_t drive_status_word(const drive_t *d) { return d->forced ? d->forced_status : live_status(d); }

/* 4000h = 100 % of minimum to maximum output frequency, 0 below the minimum, negative in reverse. */
uint16_t drive_frequency_word(const drive_t *d) {
  if (d->forced) return d->forced_frequency;
  int64_t low = scaled(d, DRIVE_ROLE_FREQUENCY_MIN, MILLI, 0);
  int64_t high = scaled(d, DRIVE_ROLE_FREQUENCY_MAX, MILLI, 50000);
  int64_t over = magnitude(d->frequency_nhz) / NHZ_PER_MHZ - low;
  if (over <= 0 || high <= low) return 0;
  int64_t word = divide(over * FULL_SCALE, high - low);
  if (word > INT16_MAX) word = INT16_MAX;
  return (uint16_t)(d->frequency_nhz < 0 ? 0x10000 - word : word);
}

uint16_t drive_control_word(const drive_t *d) { return d->control; }

uint16_t drive_reference_word(const drive_t *d) { return d->reference; }

int32_t drive_frequency_mhz(const drive_t *d) { return (int32_t)(d->frequency_nhz / NHZ_PER_MHZ); }

uint8_t drive_alarm(const drive_t *d) { return d->alarm; }

void drive_trip(drive_t *d, uint8_t alarm) {
  if (d->alarm != 0 || alarm == 0 || alarm > ALARM_MAX) return;
  d->alarm = alarm;
  log_fault(d, DRIVE_ROLE_FAULT_CODE, alarm);
  int64_t hours = setting(d, DRIVE_ROLE_HOURS_RUN, 0) + (int64_t)(d->run_us / 3600000000U);
  log_fault(d, DRIVE_ROLE_FAULT_TIME, hours);
  settle(d);
}

/* Executes the PCD of a request. Bit 10 = 0: both words are ignored. */
static void control(drive_t *d, uint16_t ctw, uint16_t reference) {
  if (!(ctw & CTW_VALID)) return;
  bool reset = (ctw & CTW_RESET) && !(d->control & CTW_RESET);
  d->control = ctw;
  d->reference = reference;
  d->controlled = true;
  d->bus_idle_us = 0;
  if (reset) d->alarm = 0;
  settle(d);
}

/* ---- readouts -------------------------------------------------------------------------------- */

/* Value of a calculated readout; false for every other parameter. */
static bool live(const drive_t *d, const drive_parameter_t *p, int64_t *value) {
  int64_t mhz = drive_frequency_mhz(d);
  int64_t rated;
  int digits = -p->conversion;
  switch ((drive_role_t)p->role) {
    case DRIVE_ROLE_SHOW_REFERENCE_PERCENT:
      *value = divide(scale(reference_sum(d) * 100, digits), FULL_SUM);
      break;
    case DRIVE_ROLE_SHOW_REFERENCE:
      *value = scale(reference_nhz(d), digits - NANO);
      break;
    case DRIVE_ROLE_SHOW_FREQUENCY:
      *value = scale(magnitude(mhz), digits - MILLI);
      break;
    case DRIVE_ROLE_SHOW_CURRENT:
      *value = current_raw(d);
      break;
    case DRIVE_ROLE_SHOW_POWER_W:
      *value = scale(power_mw(d), digits - MILLI);
      break;
    case DRIVE_ROLE_SHOW_POWER_HP:
      *value = divide(scale(power_mw(d), digits), 745700);
      break;
    case DRIVE_ROLE_SHOW_VOLTAGE: /* in proportion to the frequency, up to the rated one */
      mhz = magnitude(mhz) > rated_mhz(d) ? rated_mhz(d) : magnitude(mhz);
      *value = divide(scale(setting(d, DRIVE_ROLE_MOTOR_VOLTAGE, 400) * mhz, digits), rated_mhz(d));
      break;
    case DRIVE_ROLE_SHOW_THERMAL_MOTOR: /* % of the rated current */
      rated = setting(d, DRIVE_ROLE_MOTOR_CURRENT, 600);
      *value = rated > 0 ? current_raw(d) * 100 / rated : 0;
      break;
    case DRIVE_ROLE_SHOW_STATUS_WORD:
      *value = drive_status_word(d);
      break;
    case DRIVE_ROLE_SHOW_ALARM_WORD: /* bit n - 1 for alarm n; alarms above 32 have no bit */
      *value = d->alarm >= 1 && d->alarm <= 32 ? INT64_C(1) << (d->alarm - 1) : 0;
      break;
    case DRIVE_ROLE_SHOW_CONTROL_WORD:
      *value = d->control;
      break;
    default:
      return false;
  }
  return true;
}

/* ---- parameter access ------------------------------------------------------------------------ */

/* Finds the slot of an element; returns a fault number if the index does not fit. */
static int locate(const drive_t *d, const drive_parameter_t *p, uint8_t index, size_t *slot) {
  uint8_t first = d->profile->index_first;
  *slot = p->slot;
  if (p->length == 0) return index == 0 ? DRIVE_OK : DRIVE_FAULT_NOT_ARRAY;
  if (index < first || index - first >= p->length) return DRIVE_FAULT_SUB_INDEX;
  *slot = (size_t)p->slot + index - first;
  return DRIVE_OK;
}

int drive_get(const drive_t *d, uint16_t pnu, uint8_t index, int64_t *value) {
  uint16_t at = find(d, pnu);
  size_t slot;
  if (at == NOWHERE) return DRIVE_FAULT_NO_PARAMETER;
  const drive_parameter_t *p = &d->profile->parameters[at];
  if (p->type == DRIVE_TEXT) return DRIVE_FAULT_TYPE;
  int fault = locate(d, p, index, &slot);
  if (fault == DRIVE_OK && (d->pinned[at] || !live(d, p, value))) *value = d->ram[slot];
  return fault;
}

int drive_set(drive_t *d, uint16_t pnu, uint8_t index, int64_t value) {
  uint16_t at = find(d, pnu);
  size_t slot;
  if (at == NOWHERE) return DRIVE_FAULT_NO_PARAMETER;
  const drive_parameter_t *p = &d->profile->parameters[at];
  if (p->type == DRIVE_TEXT) return DRIVE_FAULT_TYPE;
  int fault = locate(d, p, index, &slot);
  if (fault != DRIVE_OK) return fault;
  d->ram[slot] = value;
  d->eeprom[slot] = value;
  d->pinned[at] = true;
  settle(d);
  return DRIVE_OK;
}

int drive_get_text(const drive_t *d, uint16_t pnu, char text[DRIVE_TEXT_MAX + 1]) {
  uint16_t at = find(d, pnu);
  if (at == NOWHERE) return DRIVE_FAULT_NO_PARAMETER;
  const drive_parameter_t *p = &d->profile->parameters[at];
  if (p->type != DRIVE_TEXT) return DRIVE_FAULT_TYPE;
  memcpy(text, d->text[p->slot], d->text_length[p->slot]);
  text[d->text_length[p->slot]] = '\0';
  return DRIVE_OK;
}

static void store_text(drive_t *d, const drive_parameter_t *p, const uint8_t *characters, size_t n) {
  memset(d->text[p->slot], 0, sizeof d->text[p->slot]);
  memcpy(d->text[p->slot], characters, n);
  d->text_length[p->slot] = (uint8_t)n;
}

int drive_set_text(drive_t *d, uint16_t pnu, const char *text) {
  uint16_t at = find(d, pnu);
  size_t n = strlen(text);
  if (at == NOWHERE) return DRIVE_FAULT_NO_PARAMETER;
  const drive_parameter_t *p = &d->profile->parameters[at];
  if (p->type != DRIVE_TEXT) return DRIVE_FAULT_TYPE;
  if (n > DRIVE_TEXT_MAX) return DRIVE_FAULT_LIMITS;
  store_text(d, p, (const uint8_t *)text, n);
  return DRIVE_OK;
}

/* Access rights without the present mode: fault number or DRIVE_OK. */
static int writable(const drive_parameter_t *p) {
  switch ((drive_access_t)p->access) {
    case DRIVE_READ_ONLY:
      return DRIVE_FAULT_READ_ONLY;
    case DRIVE_LOCAL:
      return DRIVE_FAULT_BUS_ACCESS;
    case DRIVE_FIXED:
      return DRIVE_FAULT_NOT_CHANGEABLE;
    case DRIVE_DENIED:
      return DRIVE_FAULT_NO_RIGHTS;
    default:
      return DRIVE_OK;
  }
}

static int writable_now(const drive_t *d, const drive_parameter_t *p) {
  if (p->role != DRIVE_ROLE_ACTIVE_SETUP && setting(d, DRIVE_ROLE_ACTIVE_SETUP, 1) == 0) {
    return DRIVE_FAULT_FACTORY_SETUP;
  }
  if (!p->while_running && drive_running(d)) return DRIVE_FAULT_MODE;
  return DRIVE_OK;
}

/* ---- telegrams ------------------------------------------------------------------------------- */

enum { AK_NONE, AK_READ, AK_WRITE_WORD, AK_WRITE_DOUBLE, AK_EEPROM_DOUBLE = 13, AK_EEPROM_WORD, AK_TEXT };
enum { REPLY_WORD = 1, REPLY_DOUBLE = 2, REPLY_REFUSED = 7 };
enum { TEXT_READ = 0x04, TEXT_WRITE = 0x05 }; /* IND high byte */

enum { /* offsets in the data part of a telegram */
  DATA_PKE = 0,
  DATA_IND = 2,
  DATA_PWE = 4,
  PROCESS_BYTES = 4,
  PARAMETER_BYTES = 12,
  TEXT_OVERHEAD = 8 /* PKE, IND, PCD1, PCD2 */
};

static uint16_t get16(const uint8_t *from) { return (uint16_t)(from[0] << 8 | from[1]); }

static void put16(uint8_t *to, unsigned value) {
  to[0] = (uint8_t)(value >> 8);
  to[1] = (uint8_t)value;
}

static uint8_t check_byte(const uint8_t *bytes, size_t n) {
  uint8_t bcc = 0;
  for (size_t i = 0; i < n; i++) bcc ^= bytes[i];
  return bcc;
}

/* Puts the value of a parameter into PWE of the reply, as word or double word by its type. */
static unsigned answer_value(const drive_parameter_t *p, int64_t value, uint8_t *pwe) {
  uint32_t bits = (uint32_t)(uint64_t)value;
  put16(pwe, is_double(p) ? bits >> 16 : 0);
  put16(pwe + 2, bits & 0xFFFF);
  return is_double(p) ? REPLY_DOUBLE : REPLY_WORD;
}

/* Reads PWE by the parameter's type: a word is PWE low only. */
static int64_t request_value(const drive_parameter_t *p, const uint8_t *pwe) {
  uint32_t bits = (uint32_t)get16(pwe) << 16 | get16(pwe + 2);
  switch (p->type) {
    case DRIVE_INT32:
      return bits >= 0x80000000U ? (int64_t)bits - INT64_C(0x100000000) : (int64_t)bits;
    case DRIVE_UINT32:
      return bits;
    case DRIVE_INT16:
      return (bits & 0xFFFF) >= 0x8000 ? (int64_t)(bits & 0xFFFF) - 0x10000 : (int64_t)(bits & 0xFFFF);
    default:
      return bits & 0xFFFF;
  }
}

static int write_number(drive_t *d, const drive_parameter_t *p, size_t slot, unsigned ak,
                        const uint8_t *pwe) {
  bool as_double = ak == AK_WRITE_DOUBLE || ak == AK_EEPROM_DOUBLE;
  int64_t value = request_value(p, pwe);
  int fault = writable(p);
  if (fault != DRIVE_OK) return fault;
  if (as_double != is_double(p)) return DRIVE_FAULT_TYPE;
  fault = writable_now(d, p);
  if (fault != DRIVE_OK) return fault;
  if (p->access == DRIVE_RESET && value != 0) return DRIVE_FAULT_RESET_ONLY;
  if (value < p->min || value > p->max) return DRIVE_FAULT_LIMITS;
  d->ram[slot] = value;
  if (ak == AK_EEPROM_DOUBLE || ak == AK_EEPROM_WORD) {
    d->eeprom[slot] = value;
  }
  settle(d);
  return DRIVE_OK;
}

/* Executes a parameter or text task. `data` is the request's data part. PKE, IND and the following bytes
 * of the reply up to PCD go to `out`; returns their number. */
static size_t parameter_job(drive_t *d, const uint8_t *data, size_t n, uint8_t *out) {
  uint16_t pke = get16(data + DATA_PKE);
  unsigned ak = pke >> 12;
  uint16_t pnu = pke & d->profile->pnu_mask;
  uint16_t at = find(d, pnu);
  const drive_parameter_t *p = at == NOWHERE ? NULL : &d->profile->parameters[at];
  uint8_t how = data[DATA_IND];
  uint8_t index = data[DATA_IND + 1];
  bool known = ak <= AK_WRITE_DOUBLE || ak >= AK_EEPROM_DOUBLE;
  unsigned answer = 0;
  size_t slot = 0;
  size_t length = PARAMETER_BYTES - 4;
  int fault = DRIVE_OK;

  memset(out, 0, PARAMETER_BYTES - 4);
  if (ak == AK_NONE) return length;
  out[DATA_IND] = how;
  out[DATA_IND + 1] = index;

  if (p == NULL) {
    fault = DRIVE_FAULT_NO_PARAMETER;
  } else if (!known) {
    fault = d->profile->fault_unknown_ak;
  } else if ((ak == AK_TEXT) != (p->type == DRIVE_TEXT)) {
    fault = DRIVE_FAULT_TYPE;
  } else {
    fault = locate(d, p, index, &slot);
  }

  if (fault == DRIVE_OK && ak == AK_TEXT) {
    if (how == TEXT_WRITE) {
      size_t characters = n - TEXT_OVERHEAD;
      fault = writable(p);
      if (fault == DRIVE_OK) fault = writable_now(d, p);
      if (fault == DRIVE_OK && (int64_t)characters > p->max) fault = DRIVE_FAULT_LIMITS;
      if (fault == DRIVE_OK) store_text(d, p, data + DATA_PWE, characters);
    } else if (how != TEXT_READ) {
      fault = DRIVE_FAULT_SUB_INDEX;
    }
    if (fault == DRIVE_OK) {
      answer = AK_TEXT;
      memcpy(out + DATA_PWE, d->text[p->slot], d->text_length[p->slot]);
      length = (size_t)DATA_PWE + d->text_length[p->slot];
    }
  } else if (fault == DRIVE_OK) {
    int64_t value = 0;
    if (ak != AK_READ) fault = write_number(d, p, slot, ak, data + DATA_PWE);
    if (fault == DRIVE_OK) fault = drive_get(d, pnu, index, &value);
    if (fault == DRIVE_OK) answer = answer_value(p, value, out + DATA_PWE);
  }

  if (fault != DRIVE_OK) {
    answer = REPLY_REFUSED;
    put16(out + DATA_PWE + 2, (unsigned)fault);
  }
  put16(out + DATA_PKE, answer << 12 | pnu);
  return length;
}

/* Whether a telegram with this data can have length `n`. */
static bool length_fits(const uint8_t *data, size_t n) {
  if (n == PROCESS_BYTES) return true;
  if (n < TEXT_OVERHEAD) return false;
  bool text_write = data[DATA_PKE] >> 4 == AK_TEXT && data[DATA_IND] == TEXT_WRITE;
  return text_write || n == PARAMETER_BYTES;
}

drive_outcome_t drive_telegram(drive_t *d, const uint8_t *request, size_t n, uint8_t *reply,
                               size_t *reply_n) {
  *reply_n = 0;
  if (n < 8 || n > DRIVE_REQUEST_MAX || request[0] != STX || request[1] != n - 2) return DRIVE_DAMAGED;
  if (check_byte(request, n) != 0) return DRIVE_DAMAGED;

  const uint8_t *data = request + 3;
  size_t data_n = n - 4;
  uint8_t adr = request[2];
  int64_t own = setting(d, DRIVE_ROLE_ADDRESS, 1);
  bool broadcast = adr == 0x80 || (adr >= 0x20 && adr <= 0x3F);
  bool mine = adr == (0x80 | own) || (adr < 0x20 && adr == own);
  if (!length_fits(data, data_n)) return DRIVE_DAMAGED;
  if (!broadcast && !mine) return DRIVE_NOT_MINE;

  size_t made = 0;
  if (data_n != PROCESS_BYTES) made = parameter_job(d, data, data_n, reply + 3);
  const uint8_t *pcd = data + data_n - 4;
  control(d, get16(pcd), get16(pcd + 2));
  if (broadcast) return DRIVE_BROADCAST;

  put16(reply + 3 + made, drive_status_word(d));
  put16(reply + 3 + made + 2, drive_frequency_word(d));
  made += 4;
  reply[0] = STX;
  reply[1] = (uint8_t)(made + 2);
  reply[2] = adr;
  reply[3 + made] = check_byte(reply, 3 + made);
  *reply_n = made + 4;
  return DRIVE_REPLIED;
}

/* ---- power ----------------------------------------------------------------------------------- */

static void power_up(drive_t *d) {
  memcpy(d->ram, d->eeprom, sizeof d->ram);
  memset(d->pinned, 0, sizeof d->pinned);
  d->control = 0;
  d->reference = 0;
  d->controlled = false;
  d->bus_idle_us = 0;
  d->alarm = 0;
  d->frequency_nhz = 0;
  d->dc_brake_us = 0;
  d->dc_braking = false;
  d->fraction_us = 0;
}

void drive_init(drive_t *d, const drive_profile_t *profile) {
  memset(d, 0, sizeof *d);
  d->profile = profile;
  memset(d->by_role, 0xFF, sizeof d->by_role);
  for (uint16_t i = 0; i < profile->count; i++) {
    const drive_parameter_t *p = &profile->parameters[i];
    if (p->role != DRIVE_ROLE_NONE) d->by_role[p->role] = i;
    if (p->type == DRIVE_TEXT) {
      store_text(d, p, (const uint8_t *)p->text, strlen(p->text));
    } else {
      d->eeprom[p->slot] = p->initial;
      for (uint16_t k = 1; k < p->length; k++) d->eeprom[p->slot + k] = p->initial;
    }
  }
  power_up(d);
}

void drive_power_cycle(drive_t *d) { power_up(d); }

void drive_force_process(drive_t *d, uint16_t status, uint16_t frequency) {
  d->forced = true;
  d->forced_status = status;
  d->forced_frequency = frequency;
  settle(d);
}

void drive_example_state(drive_t *d) {
  const drive_profile_t *profile = d->profile;
  drive_force_process(d, profile->example_status, profile->example_frequency);
  for (uint16_t i = 0; i < profile->example_count; i++) {
    const drive_example_t *example = &profile->examples[i];
    (void)drive_set(d, example->pnu, example->index, example->value);
  }
}

size_t drive_size(void) { return sizeof(drive_t); }
