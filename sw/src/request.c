/* SPDX-License-Identifier: Apache-2.0 */
#include "request.h"

#include "diagnostics.h"
#include "mailbox_port.h"
#include "orders.h"
#include "ticks.h"

/* ---- its reply */

ONE_COPY static void order_reply(struct gateway *g, uint32_t order)
{
    mailbox_write(REPLY, order | (uint32_t)g->ticket << MAILBOX__REPLY__TICKET_bp);
}

void request_reply(struct gateway *g, const struct transaction *txn, uint32_t flags)
{
    const uint32_t order = (txn->reply_length + 1u) << MAILBOX__REPLY__LENGTH_bp | flags;
    volatile struct frame_slot *frame = mailbox_frame(REPLY_FRAME) + 1;
    uint32_t i;

    if (txn != g->newest)
        return;
    for (i = 0; i < txn->reply_length; i++) /* at most 30 turns: REPLY_PDU_MAX */
        frame[i].byte = txn->out.reply[i];
    if (REPLY_DELAY > 0)
        g->held_reply = order;
    else
        order_reply(g, order);
}

void request_cancel_reply(struct gateway *g)
{
    if (g->at_drive != g->newest)
        return;
    if (REPLY_DELAY > 0)
        g->held_reply = 0;
    order_reply(g, 0);
}

void request_confirm_reply(struct gateway *g)
{
    if (REPLY_DELAY > 0)
        g->held_reply &= ~(uint32_t)MAILBOX__REPLY__AFTER_DRIVE_bm;
}

/* LINE-9: from the commit, which comes at t3.5. '>' covers the part of a tick before it was seen. */
static void release_reply(struct gateway *g)
{
    if (g->held_reply == 0 || g->held_reply & MAILBOX__REPLY__AFTER_DRIVE_bm || g->state < REQUEST_COMMITTED ||
        g->now - g->committed_at < TICKS(REPLY_DELAY) + 1)
        return;
    order_reply(g, g->held_reply);
    g->held_reply = 0;
}

/* ---- candidate */

static bool is_in_use(const struct gateway *g, const struct transaction *txn)
{
    return txn == g->newest || txn == g->waiting[0] || txn == g->waiting[1] ||
           (txn == g->at_drive && g->exchange != EXCHANGE_IDLE);
}

/* The line is free while an image needs one, and a candidate replaces the newest request. */
struct transaction *request_spare(struct gateway *g)
{
    struct transaction *txn = g->transactions;

    while (is_in_use(g, txn)) /* at most 3 turns: of four transactions one is in no use */
        txn++;
    return txn;
}

/* The newest request, from unit address to CRC. */
static frame_byte *request_adu(void)
{
    return mailbox_read(REQUEST) & MAILBOX__REQUEST__BANK_bm ? mailbox_frame(REQUEST_FRAME_1)
                                                             : mailbox_frame(REQUEST_FRAME_0);
}

/* The reply's unit address is copied now: a later request overwrites the bank. */
static void prepare(struct gateway *g, uint8_t ticket)
{
    enum { ADDRESS_AND_CRC = 3 };
    frame_byte *adu = request_adu();
    enum outcome outcome;

    g->newest = 0; /* its transaction is free, if it is not in use otherwise */
    g->newest = request_spare(g);
    g->ticket = ticket;
    g->state = REQUEST_PREPARED;
    if (REPLY_DELAY > 0)
        g->held_reply = 0;
    mailbox_frame(REPLY_FRAME)->byte = adu->byte;
    /* LENGTH shows an ADU of 256 bytes as 0. */
    outcome = translate_request(&g->translator, g->newest, adu + 1, (mailbox_read(LENGTH) - ADDRESS_AND_CRC) & 0xFF,
                                adu->byte == 0);
    g->asks_drive = outcome == OUTCOME_EXCHANGE;
    if (outcome == OUTCOME_REPLY)
        request_reply(g, g->newest, 0);
}

/* ---- commit */

/* Each commit gives the gate its wait, and a write of coils whether the drive runs (SAFE-7). */
static void watch_master(const struct gateway *g)
{
    const uint32_t period = ticks_of_tens(g->translator.settings.word[LOCAL_NETWORK_TIMEOUT]);

    mailbox_write(SUPERVISOR, MAILBOX__SUPERVISOR__WATCH_bm | period << MAILBOX__SUPERVISOR__PERIOD_bp |
                                  (uint32_t)g->ticket << MAILBOX__SUPERVISOR__TICKET_bp |
                                  (translate_is_running(&g->translator) ? MAILBOX__SUPERVISOR__RUNNING_bm : 0u));
}

static void commit(struct gateway *g)
{
    translate_commit(&g->translator);
    g->state = REQUEST_COMMITTED;
    g->committed_at = g->now;
    g->network_online = true;
    if (MASTER_LOSS_STOP)
        watch_master(g);
    if (DIAGNOSTICS)
        diagnostics_commit(g->newest);
    orders_keep(g);
}

/* ---- its end */

void request_finish(struct gateway *g)
{
    if (g->at_drive != g->newest)
        return;
    if (DIAGNOSTICS && !g->at_drive->broadcast)
        diagnostics_done(g->at_drive);
    g->state = REQUEST_DONE;
}

void request_answer_silence(struct gateway *g)
{
    struct transaction *answer = request_spare(g);

    answer->function = g->at_drive->function;
    g->newest = answer;
    g->state = REQUEST_DONE;
    g->asks_drive = false;
    if (translate_drive_silent(answer) != OUTCOME_REPLY)
        return;
    request_reply(g, answer, 0); /* the hardware answers no broadcast */
    if (DIAGNOSTICS && !g->at_drive->broadcast)
        diagnostics_done(answer);
}

/* ---- the newest request */

/* Preparing takes time, in which a newer request may arrive; the next round sees it. A ticket returns after 16
 * candidates, so that of a revoked request may be of a new one. */
void request_poll(struct gateway *g)
{
    const uint32_t request = mailbox_read(REQUEST);
    const uint32_t ticket = request & MAILBOX__REQUEST__TICKET_bm;

    if (!(request & (MAILBOX__REQUEST__CANDIDATE_bm | MAILBOX__REQUEST__COMMITTED_bm))) {
        g->ticket = (uint8_t)ticket; /* for what was committed before */
        g->state = REQUEST_NONE;
        g->asks_drive = false;
    } else if (ticket != g->ticket || g->state == REQUEST_NONE) {
        prepare(g, (uint8_t)ticket);
    } else if (request & MAILBOX__REQUEST__COMMITTED_bm && g->state == REQUEST_PREPARED) {
        commit(g);
    }
    if (REPLY_DELAY > 0)
        release_reply(g);
}
