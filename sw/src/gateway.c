/* SPDX-License-Identifier: Apache-2.0 */
#include "gateway.h"

#include "codes.h"
#include "diagnostics.h"
#include "dialect.h"
#include "guard.h"
#include "mailbox_port.h"
#include "ticks.h"

/* ---- replies to the network */

/* Only the newest request is answered (FRAME-7). A reply to an older one must not overwrite its reply. */
static void queue_reply(const struct gateway *g, const struct transaction *txn, uint32_t after_drive)
{
    volatile struct frame_slot *frame = mailbox_frame(REPLY_FRAME);
    const uint8_t *from = txn->out.reply;
    const uint8_t *const end = from + txn->reply_length;

    if (txn != g->newest)
        return;
    while (from != end) /* at most 29 turns: an echo of 29 bytes (MAP-10) */
        (++frame)->byte = *from++;
    mailbox_write(REPLY, (txn->reply_length + 1u) << MAILBOX__REPLY__LENGTH_bp | after_drive |
                             (uint32_t)g->ticket << MAILBOX__REPLY__TICKET_bp);
}

/* Queues a reply of no bytes, which replaces one prepared from a telegram with a wrong BCC. The hardware drops only
 * a reply that was queued before the BCC. */
static void cancel_reply(const struct gateway *g)
{
    if (g->at_drive == g->newest)
        mailbox_write(REPLY, (uint32_t)g->ticket << MAILBOX__REPLY__TICKET_bp);
}

/* ---- exchange with the drive */

/* The pause before a telegram (FC-8) is 2.3 ms; this wait is longer. */
enum { PAUSE = TICKS(5) };

#define ACTION(name) (MAILBOX__TELEGRAM__ACTION__##name << MAILBOX__TELEGRAM__ACTION_bp)

/* The ticket shows the gate whether the telegram is of the newest request; STALE makes it another's. */
enum { STALE = 8 };

static void queue_telegram(struct gateway *g, uint32_t options)
{
    const uint32_t ticket = g->at_drive == g->newest ? g->ticket : g->ticket ^ STALE;

    mailbox_write(TELEGRAM, options | ticket << MAILBOX__TELEGRAM__TICKET_bp);
    g->reply_outcome = OUTCOME_NOT_A_REPLY;
    g->exchange = EXCHANGE_LEAVING;
    g->wait_start = g->now;
}

/* Copies the telegram to the frame memory from its end (docs/hardening.md, Telegram address last). Four bytes a step
 * (PERF-2): up to two bytes after the BCC come along, and are not sent. Each byte has a register of its own. With one
 * register for all, a skipped store could exchange two bytes, which the BCC does not show (SAFE-4). */
static void copy_telegram(const struct transaction *txn)
{
    const uint32_t length = (txn->telegram_length + 3u) & ~3u;
    volatile struct frame_slot *frame = mailbox_frame(TELEGRAM_FRAME) + length;
    const uint8_t *from = txn->out.telegram.byte + length;

    do { /* at most 8 turns: TELEGRAM_WORDS */
        uint8_t byte0 = from[-4];
        uint8_t byte1 = from[-3];
        uint8_t byte2 = from[-2];
        uint8_t byte3 = from[-1];

        __asm__("" : "+r"(byte0), "+r"(byte1), "+r"(byte2), "+r"(byte3));
        from -= 4;
        frame -= 4;
        frame[3].byte = byte3;
        frame[2].byte = byte2;
        frame[1].byte = byte1;
        frame[0].byte = byte0;
    } while (from != txn->out.telegram.byte);
}

static void start_exchange(struct gateway *g, struct transaction *txn, uint32_t action)
{
    copy_telegram(txn);
    g->repeated = false;
    g->at_drive = txn;
    queue_telegram(g, (uint32_t)txn->telegram_length << MAILBOX__TELEGRAM__LENGTH_bp |
                          (txn->broadcast ? MAILBOX__TELEGRAM__NO_REPLY_bm : 0u) | action);
}

/* All functions but 01 and 03, those of DIAGNOSTICS included: they are translated twice. */
static bool is_write(const struct transaction *txn)
{
    return txn->function > READ_REGISTERS;
}

static uint32_t place_of(const struct transaction *txn)
{
    return txn->broadcast ? PLACE_BROADCAST : PLACE_UNICAST;
}

static uint32_t other(uint32_t place)
{
    return PLACES - 1 - place;
}

/* The place of the waiting write that was committed first. */
static struct transaction **first_waiting(struct gateway *g)
{
    return &g->waiting[PLACES == 1 ? 0 : g->next];
}

/* SAFE-7: the stop waits for the end of the exchange. The gate's clock and the firmware's must agree on the loss
 * (docs/hardening.md, Loss of the master). A candidate decides first: with its commit the master is back. */
static bool stop_is_due(const struct gateway *g)
{
    return !g->network_online && !g->uncommitted && translate_is_running(&g->translator) &&
           mailbox_read(EXCHANGE) & MAILBOX__EXCHANGE__STOP_DUE_bm;
}

/* A committed request, or the loss of the master, has a telegram that waits for the end of the exchange. */
static bool drive_is_wanted(struct gateway *g)
{
    return *first_waiting(g) || (g->wants_drive && !g->uncommitted) ||
           (MASTER_LOSS_STOP && stop_is_due(g));
}

/* FC-9: the time-out for the drive's reply, and for a line that is never silent. A dead drive holds up nobody: the
 * time-out is the default at most while a telegram waits. '>' covers the part of a tick before wait_start was sampled,
 * the additional tick a long round before that. So the wait is never too short. */
static bool timed_out(struct gateway *g)
{
    uint32_t tens = g->translator.settings.word[LOCAL_DRIVE_TIMEOUT];

    if (tens > DEFAULT_DRIVE_TIMEOUT && drive_is_wanted(g))
        tens = DEFAULT_DRIVE_TIMEOUT;
    return g->now - g->wait_start > ticks_of_tens(tens) + 1;
}

/* Cancels a queued telegram and clears its address (docs/hardening.md, Licence ends with the exchange). */
static void revoke_telegram(void)
{
    mailbox_frame(TELEGRAM_FRAME)->byte = 0;
}

/* Ends the licence, and fills the telegram's memory with 32 different bytes. If one of them stays in the next telegram, its
 * BCC is wrong (docs/hardening.md, Telegram's place filled). */
static void end_exchange(struct gateway *g)
{
    enum { BYTES = 32, ADR_OF_NO_DRIVE = 0xFF, STEP = 4 };
    uint32_t i;

    for (i = 0; i < BYTES; i++) /* at most 32 turns: BYTES */
        mailbox_put(&mailbox_frame(TELEGRAM_FRAME)[i].byte, ADR_OF_NO_DRIVE + STEP * i);
    g->exchange = EXCHANGE_IDLE;
}

static void abandon_exchange(struct gateway *g)
{
    mailbox_count(mailbox_counter(COUNT_DRIVE_NO_REPLY));
    g->drive_online = false;
    if (translate_drive_silent(g->at_drive) == OUTCOME_REPLY) {
        queue_reply(g, g->at_drive, 0);
        if (DIAGNOSTICS && g->at_drive == g->newest)
            diagnostics_done(g->at_drive);
    }
    end_exchange(g);
}

/* FC-9 allows one repeat, and none while another telegram waits. The gate refuses to repeat a reading after a newer
 * commit. */
static void repeat_or_abandon(struct gateway *g)
{
    mailbox_write(LISTEN, 0);
    if (g->repeated || drive_is_wanted(g)) {
        abandon_exchange(g);
        return;
    }
    g->repeated = true;
    mailbox_count(mailbox_counter(COUNT_DRIVE_REPEAT));
    queue_telegram(g, ACTION(REPEAT));
}

/* A newer write of the same kind takes the place of a telegram that never left (FRAME-7). */
static bool is_replaced(struct gateway *g)
{
    const uint32_t place = place_of(g->at_drive);

    return place < PLACES ? g->waiting[place] != 0 : drive_is_wanted(g);
}

/* After the pause of FC-8 only a line that is not silent holds a telegram back. */
static void poll_queued(struct gateway *g)
{
    if (g->at_drive == g->newest && g->uncommitted)
        g->wait_start = g->now;
    else if (timed_out(g) || (is_replaced(g) && g->now - g->wait_start > PAUSE))
        revoke_telegram();
}

static void poll_leaving(struct gateway *g, uint32_t state)
{
    if (state & MAILBOX__EXCHANGE__QUEUED_bm) {
        poll_queued(g);
        return;
    }
    if (!(state & MAILBOX__EXCHANGE__STARTED_bm) && (g->repeated || g->now - g->wait_start > PAUSE)) {
        abandon_exchange(g);
        return;
    }
    g->wait_start = g->now;
    if (state & MAILBOX__EXCHANGE__STARTED_bm && !g->at_drive->broadcast) {
        g->exchange = EXCHANGE_WAITING;
        return;
    }
    /* A broadcast was sent, or the telegram was dropped with its request. For the broadcast this marks the request
     * spent (docs/hardening.md, Spent requests). */
    cancel_reply(g);
    if (DIAGNOSTICS && state & MAILBOX__EXCHANGE__STARTED_bm)
        diagnostics_done(g->at_drive);
    end_exchange(g);
}

/* Prepares the reply while the BCC of the drive's telegram is still on the line (PERF-3). */
static void evaluate_reply(struct gateway *g)
{
    const enum outcome outcome = translate_drive_reply(&g->translator, g->at_drive, mailbox_frame(DRIVE_FRAME),
                                                       mailbox_byte(&mailbox_frame(DRIVE_LGE)->byte));

    g->reply_outcome = (uint8_t)outcome;
    if (outcome == OUTCOME_REPLY)
        queue_reply(g, g->at_drive, MAILBOX__REPLY__AFTER_DRIVE_bm);
}

static void finish_exchange(struct gateway *g)
{
    translate_drive_commit(&g->translator);
    g->drive_online = true;
    if (DIAGNOSTICS && g->reply_outcome == OUTCOME_REPLY && g->at_drive == g->newest)
        diagnostics_done(g->at_drive);
    end_exchange(g);
    /* Only the newest request gets its second telegram (FRAME-7): the gate licenses no other. */
    if (TRAITS.text_by_size && g->reply_outcome == OUTCOME_EXCHANGE && g->at_drive == g->newest) {
        translate_drive_again(g->at_drive);
        g->wants_drive = true;
    }
}

static void poll_waiting(struct gateway *g, uint32_t state)
{
    const bool good = (state & MAILBOX__EXCHANGE__GOOD_bm) != 0;
    const bool received = good || state & MAILBOX__EXCHANGE__CANDIDATE_bm;

    if (received && g->reply_outcome == OUTCOME_NOT_A_REPLY)
        evaluate_reply(g);
    if (!received && g->reply_outcome != OUTCOME_NOT_A_REPLY) {
        g->reply_outcome = OUTCOME_NOT_A_REPLY;
        cancel_reply(g);
    }
    if (good && g->reply_outcome != OUTCOME_NOT_A_REPLY) {
        finish_exchange(g);
        return;
    }
    if (good)
        mailbox_write(LISTEN, MAILBOX__LISTEN__ON_bm);
    /* A BCC on the line may extend the wait by two characters at most. */
    if (g->reply_outcome == OUTCOME_NOT_A_REPLY && timed_out(g))
        repeat_or_abandon(g);
}

/* Made twice, as a request's telegram (docs/hardening.md, Telegram made twice); if the two differ, the next round tries
 * again. The image shows the stop only if the gate took the order: with a commit just now the licence is gone. */
static void start_stop(struct gateway *g)
{
    struct transaction *txn = g->transactions + PLACES + 2;
    bool same = translate_stop(&g->translator, txn);
    const uint32_t first = guard_of(&g->translator, txn);

    same &= translate_stop(&g->translator, txn);
    same &= guard_of(&g->translator, txn) == first;
    if (!same)
        return;
    start_exchange(g, txn, ACTION(WAITING) | MAILBOX__TELEGRAM__STOP_bm);
    if (mailbox_read(EXCHANGE) & (MAILBOX__EXCHANGE__QUEUED_bm | MAILBOX__EXCHANGE__STARTED_bm))
        translate_commit(&g->translator, g->translator.next.word[GUARD] + GUARD_KEY);
    else
        end_exchange(g);
}

/* Waiting writes leave in the order of commit, before the stop and the telegram of the newest request (FRAME-7). The
 * gate refuses the telegram of a request that was revoked meanwhile. */
static void start_next(struct gateway *g)
{
    struct transaction *txn = *first_waiting(g);
    uint32_t action = ACTION(WAITING);

    if (txn) {
        *first_waiting(g) = 0;
        if (PLACES > 1)
            g->next = (uint8_t)other(g->next);
    } else if (MASTER_LOSS_STOP && stop_is_due(g)) {
        start_stop(g);
        return;
    } else {
        txn = g->newest;
        action = ACTION(FIRST);
        if (!g->wants_drive)
            return;
        g->wants_drive = false;
    }
    start_exchange(g, txn, action);
}

static void poll_exchange(struct gateway *g)
{
    const uint32_t state = mailbox_read(EXCHANGE);

    /* Also a telegram that began before a restart of the firmware (WDG-1). */
    if (state & MAILBOX__EXCHANGE__SENDING_bm)
        return;
    if (g->exchange == EXCHANGE_LEAVING)
        poll_leaving(g, state);
    else if (g->exchange == EXCHANGE_WAITING)
        poll_waiting(g, state);
    if (g->exchange == EXCHANGE_IDLE)
        start_next(g);
}

/* ---- requests from the network */

/* The newest request, from unit address to CRC. */
static frame_byte *request_adu(void)
{
    return mailbox_read(REQUEST) & MAILBOX__REQUEST__BANK_bm ? mailbox_frame(REQUEST_FRAME_1)
                                                             : mailbox_frame(REQUEST_FRAME_0);
}

/* A slot that is neither at the drive, where an exchange may go on, nor waits. There is one more than these. */
static struct transaction *free_slot(struct gateway *g)
{
    struct transaction *txn = g->transactions;

    /* at most 3 turns: one slot is neither at the drive nor in a place */
    while (txn == g->at_drive || txn == g->waiting[0] || txn == g->waiting[PLACES - 1])
        txn++;
    return txn;
}

/* Translates the newest request. The reply's unit address is copied now: a later request overwrites the bank. */
static enum outcome translate_newest(struct gateway *g)
{
    enum { ADDRESS_AND_CRC = 3 };
    frame_byte *adu;
    uint32_t address;

    g->newest = free_slot(g);
    g->newest->check = 0; /* or the second pass could leave the check word of the first */
    /* Now, while no register holds anything that the call would move to the stack (PERF-2). */
    if (!translate_copy_settings(&g->translator))
        return OUTCOME_NOT_A_REPLY; /* (docs/hardening.md, Guarded settings) */
    adu = request_adu();
    address = mailbox_byte(&adu->byte);
    mailbox_put(&mailbox_frame(REPLY_FRAME)->byte, address);
    /* LENGTH shows an ADU of 256 bytes as 0. */
    return translate_request(&g->translator, g->newest, adu + 1, (mailbox_read(LENGTH) - ADDRESS_AND_CRC) & 0xFF,
                             address == 0);
}

/* A telegram leaves, and settings change, only if both passes agree, each from the mailbox registers on (docs/hardening.md,
 * Telegram made twice). A reading without a telegram has one pass; its commit leaves the settings as they are. */
static enum outcome translate_twice(struct gateway *g)
{
    uint32_t passes = 2;
    uint32_t difference = 0;
    enum outcome outcome;

    g->wants_drive = false;
    do { /* at most 2 turns: passes */
        outcome = translate_newest(g);
        if (outcome == OUTCOME_NOT_A_REPLY)
            return outcome;
        if (outcome != OUTCOME_EXCHANGE && !is_write(g->newest)) {
            g->newest->check = g->translator.settings.word[GUARD] - GUARD_KEY;
            return outcome;
        }
        difference ^= guard_of(&g->translator, g->newest);
    } while (--passes != 0);
    g->newest->check = g->translator.next.word[GUARD] ^ difference;
    if (difference != 0)
        return OUTCOME_NOT_A_REPLY;
    g->wants_drive = outcome == OUTCOME_EXCHANGE;
    return outcome;
}

/* As the last committed ticket: a commit is due. */
enum { NO_TICKET = 16 };

static void prepare(struct gateway *g, uint8_t ticket)
{
    g->ticket = ticket;
    g->committed_ticket = NO_TICKET;
    g->uncommitted = true;
    if (translate_twice(g) == OUTCOME_REPLY)
        queue_reply(g, g->newest, 0);
}

/* GUARD_KEY for a committed request. */
static uint32_t state_of(uint32_t request)
{
#if MAILBOX__REQUEST__COMMITTED_bm != GUARD_KEY
#error "GUARD_KEY is not the register's bit"
#endif
    return request & (MAILBOX__REQUEST__CANDIDATE_bm | MAILBOX__REQUEST__COMMITTED_bm);
}

/* The committed write takes the place of its kind; a write that waited there is replaced (FRAME-7). */
static void keep(struct gateway *g)
{
    const uint32_t place = place_of(g->newest);

    if (place >= PLACES)
        return;
    mailbox_write(TELEGRAM, ACTION(KEEP) | (uint32_t)g->ticket << MAILBOX__TELEGRAM__TICKET_bp);
    g->wants_drive = false;
    g->waiting[place] = g->newest;
    if (PLACES > 1)
        g->next = (uint8_t)(g->waiting[other(place)] ? other(place) : place);
}

/* Each commit gives the gate its wait, and a write of coils whether the drive runs (SAFE-7). */
static void watch_master(const struct gateway *g)
{
    const uint32_t period = ticks_of_tens(g->translator.settings.word[LOCAL_NETWORK_TIMEOUT]);

    mailbox_write(SUPERVISOR, MAILBOX__SUPERVISOR__WATCH_bm | period << MAILBOX__SUPERVISOR__PERIOD_bp |
                                  (uint32_t)g->ticket << MAILBOX__SUPERVISOR__TICKET_bp |
                                  (translate_is_running(&g->translator) ? MAILBOX__SUPERVISOR__RUNNING_bm : 0u));
}

/* request: the second reading of REQUEST; poll_request() decided with the first (docs/hardening.md, Committed by two
 * bits). */
static void commit(struct gateway *g, uint32_t request)
{
    translate_commit(&g->translator, g->newest->check + state_of(request));
    __asm__("" ::: "memory"); /* with the settings in place (SAFE-4) */
    g->committed_ticket = g->ticket;
    g->uncommitted = false;
    if (MASTER_LOSS_STOP)
        watch_master(g);
    if (DIAGNOSTICS)
        diagnostics_commit(g->newest);
    g->committed_at = g->now;
    g->network_online = true;
    if (g->wants_drive && is_write(g->newest))
        keep(g);
}

static void poll_request(struct gateway *g)
{
    const uint32_t request = mailbox_read(REQUEST);
    const uint32_t again = mailbox_read(REQUEST);
    uint32_t difference = request ^ again;

    __asm__("" : "+r"(difference)); /* or the compiler takes one of the two for both after the comparison */
    if (difference != 0)
        return; /* (docs/hardening.md, Request read twice) */
    /* None yet, or revoked. */
    if (!((request | again) & (MAILBOX__REQUEST__CANDIDATE_bm | MAILBOX__REQUEST__COMMITTED_bm))) {
        g->uncommitted = false;
        g->wants_drive = false;
        return;
    }
    /* Preparing takes time, in which a newer request may arrive. The next round reads the status again. A ticket
     * returns after 16 candidates, so the one of a dropped request may be of a new one (FRAME-3). */
    if ((request & MAILBOX__REQUEST__TICKET_bm) != g->ticket ||
        (!g->uncommitted && g->committed_ticket != g->ticket)) {
        prepare(g, request & MAILBOX__REQUEST__TICKET_bm);
        return;
    }
    /* Not by `uncommitted` alone: a skipped store must not lose the settings of a telegram that leaves (SAFE-4). */
    if (state_of(request) == GUARD_KEY && g->committed_ticket != g->ticket)
        commit(g, again);
}

/* ---- time, LEDs, event counters */

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
    /* at most 8 turns: the flags of EVENTS */
    for (; events != 0; events >>= 1, counter += FRAME_STRIDE / sizeof *counter)
        if (events & 1u)
            mailbox_count(counter);
}

/* ---- the poll loop */

/* A request that came before a restart, or during the loop-back test, is not served. */
static void forget_request(struct gateway *g)
{
    g->ticket = g->committed_ticket = mailbox_read(REQUEST) & MAILBOX__REQUEST__TICKET_bm;
}

void gateway_init(struct gateway *g)
{
    translate_init(&g->translator);
    g->now = mailbox_read(TIME);
    forget_request(g);
    leds_init(&g->leds, g->now);
    loopback_init(&g->loopback, g->now);
}

bool gateway_is_idle(const struct gateway *g)
{
    return g->exchange == EXCHANGE_IDLE && !g->uncommitted;
}

/* The exchange follows the request: its telegram leaves before the rest of the round (PERF-2). In a loop-back test
 * there is none: no request is served since the start. */
bool gateway_poll(struct gateway *g)
{
    if (loopback_poll(&g->loopback, g->now, &g->leds))
        forget_request(g);
    else
        poll_request(g);
    poll_exchange(g);
    poll_events();
    return !poll_time(g) && gateway_is_idle(g);
}
