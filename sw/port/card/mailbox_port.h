/* SPDX-License-Identifier: Apache-2.0 */
/* The mailbox on the card: memory-mapped, aligned 32-bit accesses only. */
#ifndef MAILBOX_PORT_H
#define MAILBOX_PORT_H

#include "mailbox.h"

#define mailbox_read(reg) (MAILBOX.reg)
#define mailbox_write(reg, value) (MAILBOX.reg = (value))
#define mailbox_frame(area) (MAILBOX.area.BYTE)
/* Both halves of a counter, as two arguments. */
#define mailbox_counter(name) &MAILBOX.name.LO, &MAILBOX.name.HI

#endif
