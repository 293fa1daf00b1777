/* SPDX-License-Identifier: Apache-2.0 */
/* Access to the mailbox on the host: functions of the test serve the registers; the frame memory is an array. */
#ifndef MAILBOX_PORT_H
#define MAILBOX_PORT_H

#include <stddef.h>

#include "frame.h"
#include "mailbox.h"

extern volatile uint32_t host_frames[FRAMES_bytes / sizeof(uint32_t)];

uint32_t host_read(uint32_t offset);
void host_write(uint32_t offset, uint32_t value);

static inline uint32_t mailbox_byte(const volatile uint8_t *at)
{
    return *at;
}

static inline void mailbox_count(volatile uint16_t *counter)
{
    ++*counter;
}

#define mailbox_read(reg) host_read((uint32_t)offsetof(MAILBOX_t, reg))
#define mailbox_write(reg, value) host_write((uint32_t)offsetof(MAILBOX_t, reg), value)
#define host_frame(area) (volatile void *)((volatile uint8_t *)host_frames + (area##_address - FRAMES_address))
#define mailbox_frame(area) ((volatile struct frame_slot *)host_frame(area))
#define mailbox_counter(name) ((volatile uint16_t *)host_frame(name))

#endif
