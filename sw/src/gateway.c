/* SPDX-License-Identifier: Apache-2.0 */
#include "gateway.h"

#include "exchange.h"
#include "mailbox_port.h"
#include "request.h"
#include "ticks.h"

/* Returns whether a tick has passed. */
static bool poll_time(struct gateway *g)
{
    const uint32_t passed = (mailbox_read(TIME) - g->now) & MAILBOX__TIME__TICKS_bm;
    uint32_t timeout;
    uint32_t result;
    uint32_t leds;

    if (passed == 0)
        return false;
    timeout = ticks_of_tens(g->translator.settings.word[LOCAL_NETWORK_TIMEOUT]);
    result = loopback_leds(&g->loopback);
    g->now += passed;
    if (timeout != 0 && g->now - g->committed_at >= timeout)
        g->network_online = false;
    leds = leds_show(&g->leds, g->now, g->network_online, g->drive_online);
    if (result != 0 && leds_show_is_over(&g->leds))
        leds = result;
    mailbox_write(LED, leds);
    return true;
}

/* Adds the hardware's event flags to the counters, and clears them. */
static void poll_events(void)
{
    uint8_t events = (uint8_t)mailbox_read(EVENTS);
    volatile uint16_t *counter = mailbox_counter(COUNT_CRC);

    if (events == 0)
        return;
    mailbox_write(EVENTS, events);
    for (; events != 0; events >>= 1, counter += FRAME_STRIDE / sizeof *counter) /* at most 8 turns: the flags of EVENTS */
        if (events & 1u)
            mailbox_count(counter);
}

void gateway_init(struct gateway *g)
{
    translate_init(&g->translator);
    g->now = mailbox_read(TIME);
    leds_init(&g->leds, g->now);
    loopback_init(&g->loopback, g->now);
}

bool gateway_is_idle(const struct gateway *g)
{
    return g->exchange == EXCHANGE_IDLE && g->state != REQUEST_PREPARED;
}

/* The exchange follows the request: its telegram leaves before the rest of the round (PERF-2). In a loop-back test
 * there is neither. */
bool gateway_poll(struct gateway *g)
{
    if (!loopback_poll(&g->loopback, g->now, &g->leds))
        request_poll(g);
    exchange_poll(g);
    poll_events();
    return !poll_time(g) && gateway_is_idle(g);
}
