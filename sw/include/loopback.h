/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The loop-back test of the manual (p13, LOOP-1): both ports wired to each other.
 *
 * The drive port sends a telegram that the network port must hear byte for byte, then the network port
 * sends a frame that the drive port must find to be a good telegram. Both LEDs show the verdict for 12 s
 * after the power-up show: orange or red. Times in ticks (ticks.h).
 */
#ifndef LOOPBACK_H
#define LOOPBACK_H

#include <stdbool.h>
#include <stdint.h>

struct loopback {
    uint32_t since; /* when this stage began */
    uint8_t stage;
    bool passed;
};

/* False if the switches do not ask for it. */
bool loopback_init(struct loopback *l, uint32_t now);

/* One step of the poll loop. show_over: the power-up show is over. False when the test is over. */
bool loopback_poll(struct loopback *l, uint32_t now, bool show_over);

/* The value for the LED register once the show is over. */
uint32_t loopback_leds(const struct loopback *l);

#endif
