/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The loop-back test of the manual (p13, LOOP-1), with both ports wired to each other.
 *
 * The drive port sends a telegram, which the network port must receive byte for byte. Then the network port sends a
 * frame, which the drive port must accept as a telegram. After the power-up show both LEDs show the result for 12 s:
 * orange if passed, red if failed. Times in ticks (ticks.h).
 */
#ifndef LOOPBACK_H
#define LOOPBACK_H

#include <stdbool.h>
#include <stdint.h>

struct loopback {
    uint32_t stage_start;
    uint8_t stage;
    bool passed;
};

/* False if the switches do not select the test. */
bool loopback_init(struct loopback *l, uint32_t now);

/* One step of the test. show_over: the power-up show is over. False when the test is over. */
bool loopback_poll(struct loopback *l, uint32_t now, bool show_over);

/* The value for the LED register after the power-up show. */
uint32_t loopback_leds(const struct loopback *l);

#endif
