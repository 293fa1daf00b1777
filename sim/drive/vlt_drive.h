/* SPDX-License-Identifier: Apache-2.0
 *
 * Simulated VLT drive: a slave of the FC protocol (FC-1 to FC-7) with a parameter table and a motor that
 * ramps. A profile selects the drive. The virtual card (C++) and the test benches (Python, ctypes) share it.
 *
 * Bytes in, bytes out: characters and waiting times are the caller's. The caller collects a whole telegram,
 * calls drive_telegram() and sends the reply after the response time. Simulated time passes only in
 * drive_step().
 *
 * No global state, no heap: a drive_t holds the whole state, so several drives can stand on one line.
 *
 * Values of parameters are raw, as transferred: 300 with conversion index -2 is 3.00.
 */
#ifndef VLT_DRIVE_H
#define VLT_DRIVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Longest text of a parameter. Longer than the 20 characters that the card passes on, so that
 * drive_set_text() can set a text that the card has to cut. */
#define DRIVE_TEXT_MAX 60

/* Longest request accepted (LGE is one byte) and longest reply (a text of DRIVE_TEXT_MAX). */
#define DRIVE_REQUEST_MAX 257
#define DRIVE_REPLY_MAX (12 + DRIVE_TEXT_MAX)

/* Capacity of one drive; a profile that needs more does not compile. */
#define DRIVE_PARAMETERS_MAX 512
#define DRIVE_SLOTS_MAX 1024
#define DRIVE_TEXTS_MAX 24

/* Outcome of a telegram. Only DRIVE_REPLIED comes with bytes to send. */
typedef enum {
  DRIVE_REPLIED = 0,   /* executed or refused, reply made */
  DRIVE_BROADCAST = 1, /* executed, a broadcast is never answered */
  DRIVE_NOT_MINE = 2,  /* good telegram for another address: silence */
  DRIVE_DAMAGED = 3    /* STX, LGE or BCC wrong, or an impossible length: silence */
} drive_outcome_t;

/* Fault numbers in PWE low of a reply with AK 7; DRIVE_OK means success in functions that return them. */
enum {
  DRIVE_OK = -1,
  DRIVE_FAULT_NO_PARAMETER = 0,
  DRIVE_FAULT_READ_ONLY = 1,
  DRIVE_FAULT_LIMITS = 2,
  DRIVE_FAULT_SUB_INDEX = 3,
  DRIVE_FAULT_NOT_ARRAY = 4,
  DRIVE_FAULT_TYPE = 5,
  DRIVE_FAULT_RESET_ONLY = 6,
  DRIVE_FAULT_NOT_CHANGEABLE = 7,
  DRIVE_FAULT_NO_RIGHTS = 11,
  DRIVE_FAULT_MODE = 17,
  DRIVE_FAULT_OTHER = 18,
  DRIVE_FAULT_BUS_ACCESS = 130,
  DRIVE_FAULT_FACTORY_SETUP = 131
};

typedef enum {
  DRIVE_INT16 = 3,
  DRIVE_INT32 = 4,
  DRIVE_UINT8 = 5,
  DRIVE_UINT16 = 6,
  DRIVE_UINT32 = 7,
  DRIVE_TEXT = 9
} drive_type_t;

typedef enum {
  DRIVE_READ_WRITE,
  DRIVE_READ_ONLY,
  DRIVE_LOCAL, /* readable, but set at the drive's own panel only: fault 130 */
  DRIVE_RESET, /* may be set to 0 only: fault 6 */
  DRIVE_FIXED, /* fault 7 */
  DRIVE_DENIED /* fault 11 */
} drive_access_t;

/* Meaning of a parameter for the simulation, so that profiles with other numbers share this code: column "role"
 * of a profile, in lower case. */
typedef enum {
  DRIVE_ROLE_NONE,
  /* settings the simulation obeys */
  DRIVE_ROLE_ACTIVE_SETUP, /* 0 = factory setup: writes are refused with 131 */
  DRIVE_ROLE_ADDRESS,
  DRIVE_ROLE_MOTOR_POWER,
  DRIVE_ROLE_MOTOR_VOLTAGE,
  DRIVE_ROLE_MOTOR_FREQUENCY,
  DRIVE_ROLE_MOTOR_CURRENT,
  DRIVE_ROLE_DC_BRAKE_CURRENT,
  DRIVE_ROLE_DC_BRAKE_TIME,
  DRIVE_ROLE_FREQUENCY_MIN,
  DRIVE_ROLE_FREQUENCY_MAX,
  DRIVE_ROLE_RANGE_LOW, /* for bit 10 of the status word; without this role: the two above */
  DRIVE_ROLE_RANGE_HIGH,
  DRIVE_ROLE_REFERENCE_MIN,
  DRIVE_ROLE_REFERENCE_MAX,
  DRIVE_ROLE_RAMP_UP,
  DRIVE_ROLE_RAMP_DOWN,
  DRIVE_ROLE_RAMP_UP_2, /* chosen by bit 9 of the control word; without this role bit 9 has no function */
  DRIVE_ROLE_RAMP_DOWN_2,
  DRIVE_ROLE_QUICK_STOP_RAMP, /* without this role a quick stop takes the ramp-down time */
  DRIVE_ROLE_JOG_FREQUENCY,
  DRIVE_ROLE_PRESETS, /* the first of four parameters in a row, or an array of four and more */
  DRIVE_ROLE_CURRENT_LIMIT,
  DRIVE_ROLE_SELECT_COAST, /* selectors: 0 digital input, 1 bus, 2 logic and, 3 logic or */
  DRIVE_ROLE_SELECT_QUICK_STOP,
  DRIVE_ROLE_SELECT_DC_BRAKE,
  DRIVE_ROLE_SELECT_START,
  DRIVE_ROLE_SELECT_REVERSING,
  DRIVE_ROLE_SELECT_PRESET,
  DRIVE_ROLE_BUS_TIME, /* seconds between valid control words */
  DRIVE_ROLE_BUS_TIME_FUNCTION,
  /* readouts that the simulation calculates */
  DRIVE_ROLE_SHOW_REFERENCE_PERCENT,
  DRIVE_ROLE_SHOW_REFERENCE,
  DRIVE_ROLE_SHOW_FREQUENCY,
  DRIVE_ROLE_SHOW_CURRENT,
  DRIVE_ROLE_SHOW_POWER_W,
  DRIVE_ROLE_SHOW_POWER_HP,
  DRIVE_ROLE_SHOW_VOLTAGE,
  DRIVE_ROLE_SHOW_THERMAL_MOTOR,
  DRIVE_ROLE_SHOW_STATUS_WORD,
  DRIVE_ROLE_SHOW_ALARM_WORD,
  DRIVE_ROLE_SHOW_CONTROL_WORD,
  DRIVE_ROLE_FAULT_CODE, /* arrays, newest entry first */
  DRIVE_ROLE_FAULT_TIME,
  DRIVE_ROLE_HOURS_RUN,
  DRIVE_ROLE_COUNT
} drive_role_t;

typedef struct {
  uint16_t pnu;
  uint8_t type;       /* drive_type_t */
  uint8_t access;     /* drive_access_t */
  uint8_t role;       /* drive_role_t */
  int8_t conversion;  /* conversion index: value = raw x 10^index; 74 = operating hours */
  bool while_running; /* may be changed while the motor runs; else fault 17 */
  uint16_t length;    /* elements of an array; 0 = not an array */
  uint16_t slot;      /* first place in drive_t.ram (numbers) or drive_t.text (texts) */
  int64_t min;        /* numbers: limits; texts: least and greatest number of characters */
  int64_t max;
  int64_t initial;
  const char *text; /* initial text */
  const char *name;
  const char *unit;
} drive_parameter_t;

/* A value of the example state. */
typedef struct {
  uint16_t pnu;
  uint8_t index;
  int64_t value;
} drive_example_t;

/* A model of drive, generated from sim/drive/NAME.csv by sim/drive/drive_table.py. */
typedef struct {
  const char *name;
  uint16_t pnu_mask;                  /* 07FFh: bit 11 of PKE is ignored; 0FFFh: it is used */
  uint8_t index_first;                /* index of an array's first element */
  uint8_t fault_unknown_ak;           /* fault number for an AK that the drive does not know */
  bool fc_status; /* status word: bit 2 = 0 coasting; else bit 2 = 1 stand by */
  uint16_t example_status, example_frequency;
  uint16_t example_count;
  const drive_example_t *examples;
  uint16_t count; /* parameters, rising numbers */
  const drive_parameter_t *parameters;
} drive_profile_t;

typedef struct {
  const drive_profile_t *profile;
  uint16_t by_role[DRIVE_ROLE_COUNT]; /* place in the profile's parameters, FFFFh = none */
  int64_t ram[DRIVE_SLOTS_MAX];
  int64_t eeprom[DRIVE_SLOTS_MAX]; /* AK 13 and 14 write here too; survives drive_power_cycle() */
  char text[DRIVE_TEXTS_MAX][DRIVE_TEXT_MAX + 1];
  uint8_t text_length[DRIVE_TEXTS_MAX];
  bool pinned[DRIVE_PARAMETERS_MAX];      /* readout fixed by drive_set() */

  uint16_t control, reference; /* last valid ones: bit 10 was 1 */
  bool controlled;             /* a valid control word has come since power-up */
  uint64_t bus_idle_us;        /* since the last valid control word */
  bool forced;
  uint16_t forced_status, forced_frequency;

  uint8_t alarm; /* 0 = not tripped */
  int64_t frequency_nhz; /* output frequency, negative = reverse */
  int64_t dc_brake_us;   /* braking time left */
  bool dc_braking;       /* the command is DC brake */
  uint32_t fraction_us;  /* time not yet stepped, < 1 ms */
  uint64_t run_us;
} drive_t;

/* Finds a profile by name, which is that of its table in this folder. NULL if unknown. */
const drive_profile_t *drive_profile(const char *name);

/* The names of all profiles; NULL after the last. */
const char *drive_profile_name(size_t index);

/* Power the drive up with every parameter at its default: motor stopped, no trip, status word 0607h. */
void drive_init(drive_t *d, const drive_profile_t *profile);

/* Mains off and on: RAM values are restored from EEPROM, texts and fault log stay, trip and pins are
 * cleared. A forced process block stays forced. */
void drive_power_cycle(drive_t *d);

/* One whole telegram off the line, STX to BCC. `reply` has room for DRIVE_REPLY_MAX bytes;
 * *reply_n is 0 unless DRIVE_REPLIED is returned. */
drive_outcome_t drive_telegram(drive_t *d, const uint8_t *request, size_t n, uint8_t *reply,
                               size_t *reply_n);

/* Let simulated time pass. */
void drive_step(drive_t *d, uint32_t microseconds);

/* The state in the examples of the profile's document: status and output frequency word forced, the
 * values of the examples set. A VLT 6000: 0F03h, 2000h, parameter 514 = 3.00 A. */
void drive_example_state(drive_t *d);

/* Pins status and output frequency word of every reply. The motor then stands still for every control
 * word (which is still recorded), so parameters that need a stopped motor can be written. */
void drive_force_process(drive_t *d, uint16_t status, uint16_t frequency);

/* Access without the bus: no limits, access rights or modes; index 0 for a parameter that is not an
 * array. drive_set() of a readout pins it. Both return DRIVE_OK or the fault number 0, 3, 4 or 5
 * (drive_set_text(): 2 for more than DRIVE_TEXT_MAX characters). Sets RAM and EEPROM alike. */
int drive_set(drive_t *d, uint16_t pnu, uint8_t index, int64_t value);
int drive_set_text(drive_t *d, uint16_t pnu, const char *text);
int drive_get(const drive_t *d, uint16_t pnu, uint8_t index, int64_t *value);
int drive_get_text(const drive_t *d, uint16_t pnu, char text[DRIVE_TEXT_MAX + 1]);

/* Trip with an alarm number 1 to 99: output off, entry in the fault log. Ignored while tripped. */
void drive_trip(drive_t *d, uint8_t alarm);

/* State visible to an observer of the drive. */
uint16_t drive_status_word(const drive_t *d);
uint16_t drive_frequency_word(const drive_t *d);
uint16_t drive_control_word(const drive_t *d);   /* last valid one, 0 before the first */
uint16_t drive_reference_word(const drive_t *d); /* sent with that control word */
int32_t drive_frequency_mhz(const drive_t *d);
uint8_t drive_alarm(const drive_t *d); /* 0 = none */
bool drive_running(const drive_t *d);  /* turning, started, or DC-braking: writes may give fault 17 */

/* Size of a drive_t in bytes, for callers without the structure. */
size_t drive_size(void);

#ifdef __cplusplus
}
#endif
#endif
