/* SPDX-License-Identifier: Apache-2.0 */
/* Time in ticks of 1/1200 s, the unit of the register TIME: 10 ms are twelve. */
#ifndef TICKS_H
#define TICKS_H

#include <stdint.h>

#define TICKS(ms) ((ms) * 6 / 5)

/* Registers 40002 and 40003 count in 10 ms; no multiplication on this CPU. */
static inline uint32_t ticks_of_tens(uint32_t tens)
{
    return (tens << 3) + (tens << 2);
}

#endif
