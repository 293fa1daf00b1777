/* SPDX-License-Identifier: Apache-2.0
 *
 * Adapter of libmodbus: requests and answers as in common.py. `code` stands in an answer for the codes 1-11 of the
 * standard alone, because libmodbus gives no number for others. Exit 2 for a wrong command line.
 */
#include <errno.h>
#include <modbus/modbus.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BAUD = 9600, DATA_BITS = 8, STOP_BITS = 2, UNIT = 1, VALUES_MAX = 128, LINE_MAX_BYTES = 1024 };

static int shows(void) {
  const bool is_standard = errno > MODBUS_ENOBASE && errno < MODBUS_ENOBASE + MODBUS_EXCEPTION_MAX;
  printf("{\"shows\": \"%s\"", modbus_strerror(errno));
  if (is_standard) printf(", \"code\": %d", errno - MODBUS_ENOBASE);
  puts("}");
  return 0;
}

static void list(const uint16_t *values, int count) {
  fputs("{\"values\": [", stdout);
  for (int i = 0; i < count; i++) printf("%s%u", i == 0 ? "" : ", ", (unsigned)values[i]);
  puts("]}");
}

static void text(const uint16_t *values, int count) {
  fputs("{\"text\": \"", stdout);
  for (int i = 0; i < count; i++) printf("%c%c", values[i] >> 8, values[i] & 0xFF);
  puts("\"}");
}

static int read_values(modbus_t *bus, const char *what, int address, int count) {
  uint8_t bits[VALUES_MAX];
  uint16_t words[VALUES_MAX];
  int got;
  if (strcmp(what, "read-coils") == 0) {
    got = modbus_read_bits(bus, address, count, bits);
    for (int i = 0; i < got; i++) words[i] = bits[i];
  } else if (strcmp(what, "read-inputs") == 0) {
    got = modbus_read_input_registers(bus, address, count, words);
  } else {
    got = modbus_read_registers(bus, address, count, words);
  }
  if (got < 0) return shows();
  if (strcmp(what, "read-text") == 0) {
    text(words, got);
  } else {
    list(words, got);
  }
  return 0;
}

static int write_values(modbus_t *bus, const char *what, int address, int count, const uint16_t *words) {
  uint8_t bits[VALUES_MAX];
  int done;
  for (int i = 0; i < count; i++) bits[i] = words[i] != 0;
  if (strcmp(what, "write-coil") == 0) {
    done = modbus_write_bit(bus, address, words[0]);
  } else if (strcmp(what, "write-register") == 0) {
    done = modbus_write_register(bus, address, words[0]);
  } else if (strcmp(what, "write-coils") == 0) {
    done = modbus_write_bits(bus, address, count, bits);
  } else {
    done = modbus_write_registers(bus, address, count, words);
  }
  if (done < 0) return shows();
  puts("{\"done\": true}");
  return 0;
}

/* The characters of a text, two a register, from hex digits. */
static int registers_of(const char *hex, uint16_t *words) {
  int count = 0;
  unsigned value;
  while (count < VALUES_MAX && sscanf(hex, "%4x", &value) == 1) {
    words[count++] = (uint16_t)value;
    hex += 4;
  }
  return count;
}

static int ask(modbus_t *bus, char *line) {
  uint16_t words[VALUES_MAX] = {0};
  int count = 0;
  const char *what = strtok(line, " \n");
  const char *address = strtok(NULL, " \n");
  if (what == NULL || address == NULL) return 2;
  const int at = atoi(address);
  const char *rest = strtok(NULL, " \n");
  if (strcmp(what, "write-text") == 0) {
    count = registers_of(rest, words);
  } else {
    for (; rest != NULL && count < VALUES_MAX; rest = strtok(NULL, " \n")) words[count++] = (uint16_t)atoi(rest);
  }
  if (count == 0) return 2;
  return strncmp(what, "read-", 5) == 0 ? read_values(bus, what, at, words[0]) : write_values(bus, what, at, count, words);
}

int main(int argc, char **argv) {
  char line[LINE_MAX_BYTES];
  int code = 0;
  if (argc != 4) {
    fputs("usage: libmodbus PORT TIMEOUT|default N|E\n", stderr);
    return 2;
  }
  modbus_t *bus = modbus_new_rtu(argv[1], BAUD, argv[3][0], DATA_BITS, STOP_BITS);
  if (bus == NULL || modbus_set_slave(bus, UNIT) < 0 || modbus_connect(bus) < 0) {
    code = shows();
    modbus_free(bus);
    return code;
  }
  if (strcmp(argv[2], "default") != 0) {
    const double seconds = atof(argv[2]);
    const uint32_t whole = (uint32_t)seconds;
    modbus_set_response_timeout(bus, whole, (uint32_t)(1e6 * (seconds - whole)));
  }
  printf("{\"ready\": \"%s\"}\n", LIBMODBUS_VERSION_STRING);
  fflush(stdout);
  while (code == 0 && fgets(line, sizeof line, stdin) != NULL) {
    code = ask(bus, line);
    fflush(stdout);
  }
  modbus_close(bus);
  modbus_free(bus);
  return code;
}
