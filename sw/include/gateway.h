/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Between mailbox and translation core: when to decode, queue, commit, wait, repeat, give up.
 *
 * No interrupts: gateway_poll is one step of the poll loop and must come round at least once in the
 * shortest time between a commit and the next candidate (1.1 ms at 115200 baud).
 */
#ifndef GATEWAY_H
#define GATEWAY_H

#include "leds.h"
#include "loopback.h"
#include "translate.h"

/* The exchange with the drive. */
enum exchange_stage {
    EXCHANGE_IDLE,
    EXCHANGE_LEAVING, /* telegram queued or on the line */
    EXCHANGE_WAITING, /* for the drive's reply (FC-9) */
};

struct gateway {
    struct translator translator;
    struct transaction transactions[2];
    struct transaction *newest;   /* the newest request */
    struct transaction *at_drive; /* the one last sent to the drive, maybe the same */
    uint32_t now;                 /* ticks (ticks.h), like the two below */
    uint32_t heard_at;            /* last good frame for this card */
    uint32_t since;               /* when the wait for the line or, then, for the drive began */
    uint8_t ticket;               /* of newest */
    uint8_t exchange;             /* enum exchange_stage */
    bool uncommitted;             /* newest has not changed anything yet (FRAME-6) */
    bool wants_drive;             /* newest still has to be sent to the drive */
    uint8_t verdict;              /* enum outcome: what the telegram coming in is to at_drive */
    bool repeated;                /* the one repeat of FC-9 is used up */
    bool network_online;          /* LED-3 */
    bool drive_online;            /* LED-4 */
    struct leds leds;
    bool testing; /* the loop-back test is on, no request is served */
    struct loopback loopback;
};

/* g: all zero. */
void gateway_init(struct gateway *g);
void gateway_poll(struct gateway *g);

/* Nothing is under way on either line: time for something else. */
bool gateway_is_idle(const struct gateway *g);

#endif
