/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Connects mailbox and translation core. One step of the poll loop: request.c follows the newest request from candidate
 * to answer, exchange.c the telegram at the drive; orders.c has what waits for the drive line, gateway.c the time, the LEDs
 * and the counters.
 *
 * The life of a write: request.c translates the candidate (PREPARED). If nothing else waits, orders.c orders its
 * telegram at once; the hardware sends it with the commit. With the commit (COMMITTED) the settings take effect. A write
 * of coils marks the control image as changed; a parameter write is kept in its place. orders.c orders what waits as
 * soon as the drive line is free, the image first (FRAME-7). A telegram that has left takes the mark or the place away.
 *
 * There are no interrupts. gateway_poll must run at least once between a commit and the next candidate: 0.6 ms at
 * 115200 bit/s, four characters of 8N1 and half a character of silence.
 */
#ifndef GATEWAY_H
#define GATEWAY_H

#include "leds.h"
#include "loopback.h"
#include "options.h"
#include "translate.h"

/* The newest request. */
enum request_state {
    REQUEST_NONE,      /* none yet, or it was revoked */
    REQUEST_PREPARED,  /* translated, not committed (FRAME-6) */
    REQUEST_COMMITTED, /* its settings have taken effect */
    REQUEST_DONE,      /* committed, and its exchange is over */
};

/* The exchange with the drive. */
enum exchange_stage {
    EXCHANGE_IDLE,
    EXCHANGE_LEAVING, /* telegram ordered or on the line */
    EXCHANGE_WAITING, /* for the drive's reply (FC-9) */
};

/* Whom the changed control image is for; both: for the drive's own address. */
enum image_change { IMAGE_FOR_ALL = 1, IMAGE_FOR_ONE = 2 };

/* Committed parameter writes that can wait: one for this card, one for all (FRAME-7). */
enum { WAITING = 2 };

struct gateway {
    struct translator translator;
    struct transaction transactions[WAITING + 2];
    struct transaction *newest;           /* the newest request */
    struct transaction *at_drive;         /* whose telegram was ordered last, maybe the newest */
    struct transaction *waiting[WAITING]; /* committed parameter writes that have not left, in order; 0: none */
    uint32_t now;                         /* ticks (ticks.h), as the next two */
    uint32_t committed_at;                /* last commit */
    uint32_t wait_start;                  /* start of the wait for the line, then for the drive */
    uint32_t held_reply;                  /* value for REPLY that REPLY_DELAY holds back; 0: none */
    uint8_t ticket;                       /* of newest */
    uint8_t state;                        /* enum request_state */
    bool asks_drive;                      /* the newest request has a telegram, still to be ordered */
    uint8_t image_change;                 /* of enum image_change: committed, and in no ordered telegram */
    uint8_t image_ordered;                /* likewise: committed, and in one that has not left */
    bool image_is_newer;                  /* than each parameter write that waits (FC-9) */
    uint8_t exchange;                     /* enum exchange_stage */
    uint8_t reply_outcome;                /* enum outcome: of the telegram received for at_drive */
    bool repeated;                        /* the repeat of FC-9 has been ordered */
    bool network_online;                  /* LED-3 */
    bool drive_online;                    /* LED-4 */
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
