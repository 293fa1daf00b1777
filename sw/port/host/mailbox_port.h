/* SPDX-License-Identifier: Apache-2.0 */
/* The mailbox on the host: registers are functions of the test, frame memory is plain memory. */
#ifndef MAILBOX_PORT_H
#define MAILBOX_PORT_H

#include <stddef.h>

#include "mailbox.h"

extern volatile MAILBOX_t host_memory;

uint32_t host_read(uint32_t offset);
void host_write(uint32_t offset, uint32_t value);

#define mailbox_read(reg) host_read((uint32_t)offsetof(MAILBOX_t, reg))
#define mailbox_write(reg, value) host_write((uint32_t)offsetof(MAILBOX_t, reg), value)
#define mailbox_frame(area) (host_memory.area.BYTE)
#define mailbox_counter(name) &host_memory.name.LO, &host_memory.name.HI

#endif
