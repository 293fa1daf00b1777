/* SPDX-License-Identifier: Apache-2.0 */
/* Access to the mailbox on the card: memory-mapped registers and frames. */
#ifndef MAILBOX_PORT_H
#define MAILBOX_PORT_H

#include "frame.h"
#include "mailbox.h"

#define mailbox_read(reg) (MAILBOX.reg)
#define mailbox_write(reg, value) (MAILBOX.reg = (value))
#define mailbox_frame(area) ((volatile struct frame_slot *)area##_address)
#define mailbox_counter(name) ((volatile uint16_t *)name##_address)

#endif
