/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <modbus/modbus.h>
#include <stdio.h>

int main(void) {
  uint16_t words[2];
  uint8_t coils[32] = {0};
  modbus_t *drive = modbus_new_rtu("/dev/ttyUSB0", 9600, 'N', 8, 2);
  if (drive == NULL || modbus_set_slave(drive, 1) < 0 || modbus_connect(drive) < 0) return 1;
  modbus_set_response_timeout(drive, 1, 0);
  if (modbus_read_registers(drive, 2, 1, words) == 1) printf("40003: %u\n", (unsigned)words[0]);
  if (modbus_read_registers(drive, 5139, 2, words) == 2)
    printf("motor current: %.2f A\n", ((uint32_t)words[0] << 16 | words[1]) / 100.0);
  if (modbus_read_bits(drive, 128, 1, coils) < 0) puts(modbus_strerror(errno));
  for (int i = 0; i < 16; i++) coils[i] = 0x043C >> i & 1;
  if (modbus_write_bits(drive, 0, 32, coils) == 32) puts("ramp stop accepted");
  /* Coil 44 is of the drive's last reply: read a parameter first. */
  while (modbus_read_registers(drive, 5139, 2, words) != 2 || modbus_read_bits(drive, 43, 1, coils) != 1 || coils[0])
    continue;
  puts("stopped");
  modbus_close(drive);
  modbus_free(drive);
  return 0;
}
