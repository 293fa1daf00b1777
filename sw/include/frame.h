/* SPDX-License-Identifier: Apache-2.0 */
/* A frame in the frame memory: one byte in each 32-bit word, because each line has a byte lane of its own. */
#ifndef FRAME_H
#define FRAME_H

#include <stdint.h>

struct frame_slot {
    uint8_t byte;
    uint8_t others[3];
};

/* A byte of a frame that the hardware writes. */
typedef const volatile struct frame_slot frame_byte;

#endif
