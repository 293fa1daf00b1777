/* SPDX-License-Identifier: Apache-2.0 */
/* Access to the mailbox on the card: memory-mapped registers and frames. */
#ifndef MAILBOX_PORT_H
#define MAILBOX_PORT_H

#include "frame.h"
#include "mailbox.h"

/* A register that is read has 8 bits, as a byte of a frame. After a volatile byte the compiler clears the upper bits once
 * more, which LBU has done (PERF-2). */
static inline __attribute__((always_inline)) uint32_t mailbox_byte(const volatile uint8_t *at)
{
    uint32_t value;

    __asm__ volatile("lbu %0, %1" : "=r"(value) : "m"(*at));
    return value;
}

/* One event more. After its addition the compiler would clear the upper bits, which SH does not store. */
static inline __attribute__((always_inline)) void mailbox_count(volatile uint16_t *counter)
{
    uint32_t value;

    __asm__ volatile("lhu %0, %1\n\taddi %0, %0, 1\n\tsh %0, %1" : "=&r"(value), "+m"(*counter));
}

#define mailbox_read(reg) mailbox_byte(&MAILBOX.reg)
#define mailbox_write(reg, value) (MAILBOX.reg = (value))
#define mailbox_frame(area) ((volatile struct frame_slot *)area##_address)
#define mailbox_counter(name) ((volatile uint16_t *)name##_address)

#endif
