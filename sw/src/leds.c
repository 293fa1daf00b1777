/* SPDX-License-Identifier: Apache-2.0 */
#include "leds.h"

#include "mailbox.h"
#include "ticks.h"

enum { STEP = TICKS(250) };

enum {
    NETWORK_RED = MAILBOX__LED__MODBUS_RED_bm,
    NETWORK_GREEN = MAILBOX__LED__MODBUS_GREEN_bm,
    DRIVE_RED = MAILBOX__LED__DRIVE_RED_bm,
    DRIVE_GREEN = MAILBOX__LED__DRIVE_GREEN_bm,
    ALL = NETWORK_RED | NETWORK_GREEN | DRIVE_RED | DRIVE_GREEN,
};

enum {
    SHOW_STEPS = 8, /* the power-up show, once (LED-1) */
    STEPS = 12,     /* then 1 Hz: two steps lit, two dark (LED-2) */
};

/* The LEDs that a step may light. The power-up show lights all of them. */
static const uint8_t steps[STEPS] = {
    DRIVE_RED,   DRIVE_GREEN,   DRIVE_RED | DRIVE_GREEN,     0, /* drive LED first */
    NETWORK_RED, NETWORK_GREEN, NETWORK_RED | NETWORK_GREEN, 0, /* then the network LED */
    ALL,         ALL,           0,                           0,
};

void leds_init(struct leds *leds, uint32_t now)
{
    leds->step_at = now;
}

uint32_t leds_show(struct leds *leds, uint32_t now, bool network_online, bool drive_online)
{
    uint32_t state = ALL;
    uint32_t step = leds->step;

    if (now - leds->step_at >= STEP) {
        leds->step_at += STEP;
        if (++step == STEPS)
            step = SHOW_STEPS;
        leds->step = (uint8_t)step;
    }
    if (leds_show_is_over(leds))
        state = (network_online ? NETWORK_GREEN : NETWORK_RED) | (drive_online ? DRIVE_GREEN : DRIVE_RED);
    return state & steps[step];
}

bool leds_show_is_over(const struct leds *leds)
{
    return leds->step >= SHOW_STEPS;
}
