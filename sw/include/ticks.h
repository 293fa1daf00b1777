/* SPDX-License-Identifier: Apache-2.0 */
/* Time in ticks of 1/1200 s, the unit of the register TIME. 10 ms are 12 ticks; a part of a tick counts as one. */
#ifndef TICKS_H
#define TICKS_H

#include <stdint.h>

#define TICKS(ms) (((ms) * 6 + 4) / 5)

/* Ticks of a time in units of 10 ms, as in registers 40002 and 40003. The CPU cannot multiply. */
static inline uint32_t ticks_of_tens(uint32_t tens)
{
    return (tens << 3) + (tens << 2);
}

#endif
