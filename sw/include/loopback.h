/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The loop-back test of the manual (p13, LOOP-1), with both ports wired to each other.
 *
 * For 1 s the card listens on both lines. Then the drive port sends a pattern, which the network port must receive byte
 * for byte, and then the network port, to the drive port. A character of somebody else ends the test at any time: it
 * has failed, and nothing more is sent. After the power-up show both LEDs show the result for 12 s: orange if passed,
 * red if failed. After a failure the card serves requests at once. Times in ticks (ticks.h).
 */
#ifndef LOOPBACK_H
#define LOOPBACK_H

#include <stdbool.h>
#include <stdint.h>

#include "leds.h"

struct loopback {
    uint32_t stage_start;
    uint8_t stage;
    bool passed;
};

/* Begins the test, or closes it if the switches do not select it. l is all zero. */
void loopback_init(struct loopback *l, uint32_t now);

/* One step of the test, which shows its result after the power-up show of the LEDs. True while no request may be
 * served. */
bool loopback_poll(struct loopback *l, uint32_t now, const struct leds *leds);

/* The value for the LED register after the power-up show; 0 without a result to show. */
uint32_t loopback_leds(const struct loopback *l);

#endif
