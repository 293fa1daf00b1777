/* SPDX-License-Identifier: Apache-2.0
 *
 * A Modbus RTU master based on libmodbus, as an independent reference: sends one request, prints one line.
 *
 *   libmodbus_client DEVICE UNIT read-coils ADDRESS COUNT
 *   libmodbus_client DEVICE UNIT read-registers ADDRESS COUNT
 *   libmodbus_client DEVICE UNIT write-coil ADDRESS VALUE
 *   libmodbus_client DEVICE UNIT write-register ADDRESS VALUE
 *   libmodbus_client DEVICE UNIT write-coils ADDRESS VALUE...
 *   libmodbus_client DEVICE UNIT write-registers ADDRESS VALUE...
 *   libmodbus_client DEVICE UNIT raw BYTE...          hex, unit and function first, without CRC
 *
 * 9600 8N2; addresses as on the wire. Prints "values ...", "done", "exception N", "bytes ..." (raw) or
 * "error ...". libmodbus does not report codes outside the standard: "exception ?". Exit 2 for a wrong
 * command line or a port that cannot be opened.
 */
#include <errno.h>
#include <modbus/modbus.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BAUD = 9600, DATA_BITS = 8, STOP_BITS = 2, REPLY_S = 5, VALUES_MAX = 128, FIRST_ARGUMENT = 4 };

static int usage(void) {
  fputs("usage: libmodbus_client DEVICE UNIT OPERATION ARGUMENT...\n", stderr);
  return 2;
}

static bool number(const char *text, int base, long max, long *value) {
  char *end = NULL;
  *value = strtol(text, &end, base);
  return *text != '\0' && *end == '\0' && *value >= 0 && *value <= max;
}

static int tell_failure(void) {
  if (errno > MODBUS_ENOBASE && errno < MODBUS_ENOBASE + MODBUS_EXCEPTION_MAX) {
    printf("exception %d\n", errno - MODBUS_ENOBASE);
  } else if (errno == EMBBADEXC) {
    puts("exception ?");
  } else {
    printf("error %s\n", modbus_strerror(errno));
  }
  return 0;
}

static int read_values(modbus_t *bus, bool coils, int address, int count) {
  uint8_t bits[VALUES_MAX] = {0};
  uint16_t words[VALUES_MAX] = {0};
  const int got = coils ? modbus_read_bits(bus, address, count, bits)
                        : modbus_read_registers(bus, address, count, words);
  if (got < 0) return tell_failure();
  fputs("values", stdout);
  for (int i = 0; i < got; i++) printf(" %u", coils ? (unsigned)bits[i] : (unsigned)words[i]);
  putchar('\n');
  return 0;
}

static int write_values(modbus_t *bus, const char *operation, int address, int count, const long *values) {
  uint8_t bits[VALUES_MAX] = {0};
  uint16_t words[VALUES_MAX] = {0};
  for (int i = 0; i < count; i++) {
    bits[i] = values[i] != 0;
    words[i] = (uint16_t)values[i];
  }
  int done = -1;
  if (strcmp(operation, "write-coil") == 0) {
    done = modbus_write_bit(bus, address, (int)values[0]);
  } else if (strcmp(operation, "write-register") == 0) {
    done = modbus_write_register(bus, address, words[0]);
  } else if (strcmp(operation, "write-coils") == 0) {
    done = modbus_write_bits(bus, address, count, bits);
  } else {
    done = modbus_write_registers(bus, address, count, words);
  }
  if (done < 0) return tell_failure();
  puts("done");
  return 0;
}

static int raw(modbus_t *bus, int count, const long *values) {
  uint8_t bytes[VALUES_MAX];
  uint8_t reply[MODBUS_RTU_MAX_ADU_LENGTH];
  for (int i = 0; i < count; i++) bytes[i] = (uint8_t)values[i];
  if (modbus_send_raw_request(bus, bytes, count) < 0) return tell_failure();
  const int got = modbus_receive_confirmation(bus, reply);
  if (got < 0) return tell_failure();
  fputs("bytes", stdout);
  for (int i = 0; i < got; i++) printf(" %02X", reply[i]);
  putchar('\n');
  return 0;
}

static int run(modbus_t *bus, const char *operation, int count, const long *values) {
  if (strcmp(operation, "raw") == 0) return raw(bus, count, values);
  if (count < 2) return usage();
  if (strcmp(operation, "read-coils") == 0 || strcmp(operation, "read-registers") == 0) {
    if (values[1] > VALUES_MAX) return usage();
    return read_values(bus, operation[5] == 'c', (int)values[0], (int)values[1]);
  }
  if (strncmp(operation, "write-", 6) != 0) return usage();
  return write_values(bus, operation, (int)values[0], count - 1, values + 1);
}

int main(int argc, char **argv) {
  long unit, values[VALUES_MAX];
  const int count = argc - FIRST_ARGUMENT;
  if (count < 1 || count > VALUES_MAX || !number(argv[2], 10, 247, &unit)) return usage();
  const int base = strcmp(argv[3], "raw") == 0 ? 16 : 10;
  for (int i = 0; i < count; i++)
    if (!number(argv[FIRST_ARGUMENT + i], base, 65535, &values[i])) return usage();

  modbus_t *bus = modbus_new_rtu(argv[1], BAUD, 'N', DATA_BITS, STOP_BITS);
  if (bus == NULL || modbus_set_slave(bus, (int)unit) < 0 || modbus_connect(bus) < 0) {
    fprintf(stderr, "libmodbus_client: %s: %s\n", argv[1], modbus_strerror(errno));
    modbus_free(bus);
    return 2;
  }
  modbus_set_response_timeout(bus, REPLY_S, 0);
  const int code = run(bus, argv[3], count, values);
  modbus_close(bus);
  modbus_free(bus);
  return code;
}
