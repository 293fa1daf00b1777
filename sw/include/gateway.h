/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Connects mailbox and translation core: decides when to decode, queue, commit, wait, repeat and abandon.
 *
 * There are no interrupts. gateway_poll is one step of the poll loop. It must run at least once between a commit
 * and the next candidate: 0.6 ms at 115200 bit/s, four characters of 8N1 and half a character of silence.
 */
#ifndef GATEWAY_H
#define GATEWAY_H

#include "leds.h"
#include "loopback.h"
#include "options.h"
#include "translate.h"

/* The exchange with the drive. */
enum exchange_stage {
    EXCHANGE_IDLE,
    EXCHANGE_LEAVING, /* telegram queued or on the line */
    EXCHANGE_WAITING, /* for the drive's reply (FC-9) */
};

/* The places of committed writes that wait for the end of an exchange (FRAME-7). The first PLACES of them exist. */
enum place { PLACE_BROADCAST, PLACE_UNICAST };

struct gateway {
    struct translator translator;
    struct transaction transactions[PLACES + 2 + MASTER_LOSS_STOP]; /* the last one may be the stop's (SAFE-7) */
    struct transaction *newest;          /* the newest request */
    struct transaction *at_drive;        /* the last one sent to the drive, maybe the newest */
    struct transaction *waiting[PLACES]; /* by enum place; 0: nothing waits there */
    uint32_t now;                 /* ticks (ticks.h), as the next two */
    uint32_t committed_at;        /* last commit */
    uint32_t wait_start;          /* start of the wait for the line, then for the drive */
    uint8_t ticket;               /* of newest */
    uint8_t exchange;             /* enum exchange_stage */
    uint8_t next;                 /* the place of the older waiting write, if any waits */
    uint8_t committed_ticket;     /* of the last commit; another while a commit is due */
    bool uncommitted;             /* newest has not taken effect yet (FRAME-6) */
    bool wants_drive;             /* the telegram of newest is still to be sent */
    uint8_t reply_outcome;        /* enum outcome: of the telegram received for at_drive */
    bool repeated;                /* the repeat of FC-9 has been sent */
    bool network_online;          /* LED-3 */
    bool drive_online;            /* LED-4 */
    struct leds leds;
    struct loopback loopback;
};

/* g is all zero. */
void gateway_init(struct gateway *g);

/* No request and no exchange is in progress. */
bool gateway_is_idle(const struct gateway *g);

/* Returns whether there is time for other work: the card is idle, and no tick has made this round a long one. */
bool gateway_poll(struct gateway *g);

#endif
