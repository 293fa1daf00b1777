/* SPDX-License-Identifier: Apache-2.0 */
/* Power-up show and blinking of the two LEDs (LED-1...LED-4). Times in ticks (ticks.h). */
#ifndef LEDS_H
#define LEDS_H

#include <stdbool.h>
#include <stdint.h>

struct leds {
    uint32_t step_at; /* start of the current step */
    uint8_t step;
};

/* leds is all zero. */
void leds_init(struct leds *leds, uint32_t now);

/* The value for the LED register. */
uint32_t leds_show(struct leds *leds, uint32_t now, bool network_online, bool drive_online);

bool leds_show_is_over(const struct leds *leds);

#endif
