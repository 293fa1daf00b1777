/* SPDX-License-Identifier: Apache-2.0 */
#include "gateway.h"

#include "dialect.h"
#include "mailbox_port.h"
#include "ticks.h"

/* ---- towards the network */

/* Only the newest request is answered (FRAME-7), and no older reply may overwrite its own. */
static void queue_reply(const struct gateway *g, const struct transaction *txn, uint32_t after_drive)
{
    volatile struct frame_slot *frame = mailbox_frame(REPLY_FRAME);
    const uint8_t *from = txn->reply;
    const uint8_t *const end = from + txn->reply_length;

    if (txn != g->newest)
        return;
    while (from != end)
        (++frame)->byte = *from++;
    mailbox_write(REPLY, (txn->reply_length + 1u) << MAILBOX__REPLY__LENGTH_bp | after_drive |
                             (uint32_t)g->ticket << MAILBOX__REPLY__TICKET_bp);
}

/* A reply prepared from a telegram whose BCC was wrong: the hardware drops one that it already had. */
static void cancel_reply(const struct gateway *g)
{
    if (g->at_drive == g->newest)
        mailbox_write(REPLY, (uint32_t)g->ticket << MAILBOX__REPLY__TICKET_bp);
}

/* ---- towards the drive */

/* The pause before a telegram (FC-8) is 2.3 ms. */
enum { PAUSE = TICKS(5) };

static void queue_telegram(struct gateway *g, uint32_t how)
{
    mailbox_write(TELEGRAM, how | (uint32_t)g->ticket << MAILBOX__TELEGRAM__TICKET_bp);
    g->verdict = OUTCOME_NOT_A_REPLY;
    g->exchange = EXCHANGE_LEAVING;
    g->since = g->now;
}

static void start_exchange(struct gateway *g)
{
    const struct transaction *txn = g->newest;
    volatile struct frame_slot *frame = mailbox_frame(TELEGRAM_FRAME) + txn->telegram_length;
    const uint8_t *from = txn->telegram + txn->telegram_length;

    /* ADR last: until then the older one's is 0, and what is there no drive takes (SAFE-4). */
    while (from != txn->telegram)
        (--frame)->byte = *--from;
    g->wants_drive = false;
    g->repeated = false;
    g->at_drive = g->newest;
    queue_telegram(g, (uint32_t)txn->telegram_length << MAILBOX__TELEGRAM__LENGTH_bp |
                          (txn->broadcast ? MAILBOX__TELEGRAM__NO_REPLY_bm : 0u));
}

/* FC-9: how long the drive, or a line that is never silent, is waited for. The clock may tick right after
 * it was read: only one more than the wait is surely the wait. */
static bool waited_enough(const struct gateway *g)
{
    return g->now - g->since > ticks_of_tens(g->translator.settings.word[LOCAL_DRIVE_TIMEOUT]);
}

/* A write to its memory ends the telegram's licence: nothing sends it again (SAFE-4). */
static void end_exchange(struct gateway *g)
{
    mailbox_frame(TELEGRAM_FRAME)->byte = 0;
    g->exchange = EXCHANGE_IDLE;
}

static void give_up(struct gateway *g)
{
    (*mailbox_counter(COUNT_DRIVE_NO_REPLY))++;
    g->drive_online = false;
    if (translate_drive_silent(g->at_drive) == OUTCOME_REPLY)
        queue_reply(g, g->at_drive, 0);
    end_exchange(g);
}

static void repeat_or_give_up(struct gateway *g)
{
    mailbox_write(LISTEN, 0);
    /* Once, and not behind a newer request: what that one asks for must not wait for an older command, and the gate
     * lets none leave once it is committed (FRAME-7, SAFE-4). */
    if (g->repeated || g->at_drive != g->newest) {
        give_up(g);
        return;
    }
    g->repeated = true;
    (*mailbox_counter(COUNT_DRIVE_REPEAT))++;
    queue_telegram(g, MAILBOX__TELEGRAM__REPEAT_bm);
}

/* Beyond the pause of FC-8 only a line that is not silent holds a telegram back. It must not leave when its
 * time is over, nor after a newer request: a write to its memory takes it back, unless it starts first. */
static void poll_queued(struct gateway *g)
{
    const bool newest = g->at_drive == g->newest;

    if (newest && g->uncommitted)
        g->since = g->now;
    else if (waited_enough(g) || (!newest && !g->uncommitted && g->now - g->since > PAUSE))
        mailbox_frame(TELEGRAM_FRAME)->byte = 0;
}

static void poll_leaving(struct gateway *g, uint32_t state)
{
    if (state & MAILBOX__EXCHANGE__QUEUED_bm) {
        poll_queued(g);
        return;
    }
    if (state & MAILBOX__EXCHANGE__SENDING_bm)
        return;
    if (!(state & MAILBOX__EXCHANGE__STARTED_bm) && g->now - g->since > PAUSE) {
        give_up(g);
        return;
    }
    g->since = g->now;
    /* Either dropped with its request, or sent; a broadcast is not answered, and has no other end than this. */
    if (state & MAILBOX__EXCHANGE__STARTED_bm && !g->at_drive->broadcast) {
        g->exchange = EXCHANGE_WAITING;
        return;
    }
    cancel_reply(g);
    end_exchange(g);
}

/* The telegram's data are in: prepare the reply while its BCC is still on the line (PERF-3). */
static void judge(struct gateway *g)
{
    g->verdict = (uint8_t)translate_drive_reply(&g->translator, g->at_drive, mailbox_frame(DRIVE_FRAME),
                                                mailbox_frame(DRIVE_LGE)->byte);
    if (g->verdict == OUTCOME_REPLY)
        queue_reply(g, g->at_drive, MAILBOX__REPLY__AFTER_DRIVE_bm);
}

static void finish_exchange(struct gateway *g)
{
    translate_drive_commit(&g->translator, g->at_drive);
    g->drive_online = true;
    end_exchange(g);
    /* Its second telegram, but not before a newer request (FRAME-7): only the newest is licensed. */
    if (TRAITS.text_by_size && g->verdict == OUTCOME_EXCHANGE && g->at_drive == g->newest) {
        translate_drive_again(g->at_drive);
        g->wants_drive = true;
    }
}

static void poll_waiting(struct gateway *g, uint32_t state)
{
    const bool good = (state & MAILBOX__EXCHANGE__GOOD_bm) != 0;
    const bool there = good || state & MAILBOX__EXCHANGE__CANDIDATE_bm;

    if (there && g->verdict == OUTCOME_NOT_A_REPLY)
        judge(g);
    if (!there && g->verdict != OUTCOME_NOT_A_REPLY) {
        g->verdict = OUTCOME_NOT_A_REPLY;
        cancel_reply(g);
    }
    if (good && g->verdict != OUTCOME_NOT_A_REPLY) {
        finish_exchange(g);
        return;
    }
    if (good)
        mailbox_write(LISTEN, MAILBOX__LISTEN__ON_bm);
    /* A BCC under way may come after the wait: two characters at most. */
    if (g->verdict == OUTCOME_NOT_A_REPLY && waited_enough(g))
        repeat_or_give_up(g);
}

static void poll_exchange(struct gateway *g)
{
    const uint32_t state = mailbox_read(EXCHANGE);

    if (g->exchange == EXCHANGE_LEAVING)
        poll_leaving(g, state);
    else if (g->exchange == EXCHANGE_WAITING)
        poll_waiting(g, state);
}

/* ---- from the network */

/* What stands for the telegram, and for the settings that the commit brings. A bit of the control image changes both,
 * the BCC in one place and the guard in a run of bits: twice, the one never undoes the other. */
static uint32_t check_of(const struct transaction *txn)
{
    const uint32_t bcc = txn->telegram[txn->telegram_length - 1];

    return txn->settings.word[GUARD] ^ bcc ^ bcc << 8;
}

static void prepare(struct gateway *g, uint8_t ticket)
{
    uint32_t passes = 2;
    uint32_t once = 0;
    uint32_t check = 0;
    frame_byte *adu;
    enum outcome outcome;

    g->ticket = ticket;
    g->uncommitted = true;
    /* Not the one at the drive: that goes on, but is the newest no longer. */
    g->newest = &g->transactions[g->at_drive == &g->transactions[0]];
    /* What goes to the drive is made twice, from the registers on: a bit that flips in the core on the way makes
     * two telegrams of it. Then none leaves, and the commit leaves no settings to go on with (SAFE-4). */
    do {
        adu = mailbox_read(REQUEST) & MAILBOX__REQUEST__BANK_bm ? mailbox_frame(REQUEST_FRAME_1)
                                                                : mailbox_frame(REQUEST_FRAME_0);
        once = check;
        /* The ADU has address and CRC besides the PDU; 256 shows as 0. */
        outcome = translate_request(&g->translator, g->newest, adu + 1, (mailbox_read(LENGTH) - 3u) & 0xFF,
                                    adu->byte == 0);
        if (outcome == OUTCOME_EXCHANGE)
            check = check_of(g->newest);
    } while (outcome == OUTCOME_EXCHANGE && --passes != 0);
    /* Now, for its bank is not kept until the drive has answered. */
    mailbox_frame(REPLY_FRAME)->byte = adu->byte;
    g->wants_drive = outcome == OUTCOME_EXCHANGE && once == check;
    if (outcome == OUTCOME_EXCHANGE)
        g->newest->settings.word[GUARD] += once ^ check;
    if (outcome == OUTCOME_REPLY)
        queue_reply(g, g->newest, 0);
}

static void poll_request(struct gateway *g)
{
    const uint32_t request = mailbox_read(REQUEST);

    /* None yet, or revoked: its ticket never comes back, so what was prepared for it is forgotten. */
    if (!(request & (MAILBOX__REQUEST__CANDIDATE_bm | MAILBOX__REQUEST__COMMITTED_bm))) {
        g->uncommitted = false;
        g->wants_drive = false;
        return;
    }
    /* A newer one may have come meanwhile: whether this is the one that is committed, the next round sees. */
    if ((request & MAILBOX__REQUEST__TICKET_bm) != g->ticket) {
        prepare(g, request & MAILBOX__REQUEST__TICKET_bm);
        return;
    }
    if (g->wants_drive && g->exchange == EXCHANGE_IDLE)
        start_exchange(g);
    /* Never both: a bit that flips on the way here commits no candidate, which may still be revoked (SAFE-4). */
    if ((request & (MAILBOX__REQUEST__CANDIDATE_bm | MAILBOX__REQUEST__COMMITTED_bm)) == MAILBOX__REQUEST__COMMITTED_bm &&
        g->uncommitted) {
        g->uncommitted = false;
        translate_commit(&g->translator, g->newest);
        g->heard_at = g->now;
        g->network_online = true;
    }
}

/* ---- time and LEDs */

static void poll_time(struct gateway *g)
{
    const uint32_t timeout = ticks_of_tens(g->translator.settings.word[LOCAL_NETWORK_TIMEOUT]);
    const uint32_t passed = (mailbox_read(TIME) - g->now) & MAILBOX__TIME__TICKS_bm;
    uint32_t leds;

    if (passed == 0)
        return;
    g->now += passed;
    if (timeout != 0 && g->now - g->heard_at >= timeout)
        g->network_online = false;
    leds = leds_show(&g->leds, g->now, g->network_online, g->drive_online);
    if (g->testing && leds_show_is_over(&g->leds))
        leds = loopback_leds(&g->loopback);
    mailbox_write(LED, leds);
}

/* The hardware's flags become counts. */
static void poll_events(void)
{
    uint8_t events = (uint8_t)mailbox_read(EVENTS);
    volatile uint16_t *counter = mailbox_counter(COUNT_CRC);

    if (events == 0)
        return;
    mailbox_write(EVENTS, events);
    for (; events != 0; events >>= 1, counter += FRAME_STRIDE / sizeof *counter)
        if (events & 1u)
            ++*counter;
}

/* A request from before a restart, or from the time of the loop-back test, is not served. */
static void forget_request(struct gateway *g)
{
    g->ticket = mailbox_read(REQUEST) & MAILBOX__REQUEST__TICKET_bm;
}

void gateway_init(struct gateway *g)
{
    translate_init(&g->translator);
    g->now = mailbox_read(TIME);
    forget_request(g);
    leds_init(&g->leds, g->now);
    g->testing = loopback_init(&g->loopback, g->now);
    /* Without the test nothing may open it later, no flipped switch either (SAFE-4). */
    if (!g->testing)
        mailbox_write(SUPERVISOR, MAILBOX__SUPERVISOR__LOOPBACK_bm);
}

void gateway_poll(struct gateway *g)
{
    poll_time(g);
    poll_events();
    if (g->testing) {
        g->testing = loopback_poll(&g->loopback, g->now, leds_show_is_over(&g->leds));
        forget_request(g);
        return;
    }
    poll_exchange(g);
    poll_request(g);
}

bool gateway_is_idle(const struct gateway *g)
{
    return g->exchange == EXCHANGE_IDLE && !g->uncommitted && !g->testing;
}
