/* SPDX-License-Identifier: Apache-2.0 */
#include "orders.h"

#include "mailbox_port.h"
#include "request.h"

#define ACTION(name) (MAILBOX__TELEGRAM__ACTION__##name << MAILBOX__TELEGRAM__ACTION_bp)

#if MAILBOX__TELEGRAM__ACTION__FIRST != 0 || MAILBOX__TELEGRAM__ACTION__WRITE != 2 || MAILBOX__TELEGRAM__ACTION__IMAGE != 3
#error "enum target is not as the register TELEGRAM has it"
#endif

/* ---- what waits */

/* A newer write of the same kind takes the place of one that has not left (FRAME-7). */
static void keep_write(struct gateway *g)
{
    struct transaction **const waiting = g->waiting;

    if (waiting[0] && waiting[0]->broadcast == g->newest->broadcast) {
        waiting[0] = waiting[1];
        waiting[1] = 0;
    }
    if (waiting[0])
        waiting[1] = g->newest;
    else
        waiting[0] = g->newest;
    g->image_is_newer = false;
}

/* If its telegram is ordered already, this stands for the newest image. */
static void keep_image(struct gateway *g)
{
    const bool is_ordered = g->exchange == EXCHANGE_LEAVING && g->at_drive == g->newest;
    uint8_t *const change = is_ordered ? &g->image_ordered : &g->image_change;

    g->image_is_newer = true;
    *change |= g->newest->broadcast ? IMAGE_FOR_ALL : IMAGE_FOR_ONE;
}

/* The image is a level, a parameter write has a place; its telegram may be ordered already. A reading waits as the newest
 * request. */
void orders_keep(struct gateway *g)
{
    if (g->newest->target == TARGET_READING)
        return;
    g->asks_drive = false;
    if (g->newest->target == TARGET_IMAGE)
        keep_image(g);
    else
        keep_write(g);
}

/* The second telegram of a request (MAP-8). That of a write gets the place of the first, if no newer write has it. Only
 * the newest request gets that of a reading. */
void orders_again(struct gateway *g)
{
    struct transaction **const waiting = g->waiting;

    if (g->at_drive->target == TARGET_READING) {
        g->asks_drive |= g->at_drive == g->newest;
    } else if (!waiting[1] && !(waiting[0] && !waiting[0]->broadcast)) {
        waiting[1] = waiting[0];
        waiting[0] = g->at_drive;
    }
}

void orders_stop_waiting(struct gateway *g)
{
    if (g->waiting[0] != g->at_drive)
        return;
    g->waiting[0] = g->waiting[1];
    g->waiting[1] = 0;
}

bool orders_stop_is_due(const struct gateway *g)
{
    return MASTER_LOSS_STOP && !g->network_online && translate_is_running(&g->translator) &&
           mailbox_read(EXCHANGE) & MAILBOX__EXCHANGE__STOP_DUE_bm;
}

static bool newer_write_waits(const struct gateway *g)
{
    return !g->image_is_newer && (g->waiting[1] || (g->waiting[0] && g->waiting[0] != g->at_drive));
}

bool orders_wait(const struct gateway *g)
{
    return g->image_change != 0 || newer_write_waits(g) || (g->asks_drive && g->state == REQUEST_COMMITTED) ||
           orders_stop_is_due(g);
}

/* ---- the order */

/* The ticket shows the gate that no request came since the one on which this telegram is based. Made for a candidate, it
 * needs its commit. */
ONE_COPY static void order(struct gateway *g, uint32_t action)
{
    mailbox_write(TELEGRAM, action | (uint32_t)g->ticket << MAILBOX__TELEGRAM__TICKET_bp |
                                (g->state == REQUEST_PREPARED ? MAILBOX__TELEGRAM__EARLY_bm : 0u));
    g->reply_outcome = OUTCOME_NOT_A_REPLY;
    g->exchange = EXCHANGE_LEAVING;
}

static void start(struct gateway *g, struct transaction *txn, uint32_t action)
{
    volatile struct frame_slot *frame = mailbox_frame(TELEGRAM_FRAME);
    const uint8_t *byte = txn->out.telegram;
    const uint8_t *const end = byte + txn->telegram_length;

    for (; byte != end; byte++, frame++) /* at most 30 turns: TELEGRAM_MAX. SERV needs every instruction (PERF-2) */
        frame->byte = *byte;
    g->at_drive = txn;
    g->repeated = false;
    g->wait_start = g->now;
    order(g, (uint32_t)txn->telegram_length << MAILBOX__TELEGRAM__LENGTH_bp |
                 (txn->broadcast ? MAILBOX__TELEGRAM__NO_REPLY_bm : 0u) | action);
}

void orders_repeat(struct gateway *g)
{
    g->repeated = true;
    g->wait_start = g->now;
    mailbox_count(mailbox_counter(COUNT_DRIVE_REPEAT));
    order(g, ACTION(REPEAT));
}

void orders_repeat_anew(struct gateway *g)
{
    order(g, (uint32_t)g->at_drive->telegram_length << MAILBOX__TELEGRAM__LENGTH_bp |
                 (uint32_t)g->at_drive->target << MAILBOX__TELEGRAM__ACTION_bp);
}

bool orders_take_back(void)
{
    mailbox_frame(TELEGRAM_FRAME)->byte = 0;
    return !(mailbox_read(EXCHANGE) & MAILBOX__EXCHANGE__STARTED_bm);
}

/* ---- the next telegram */

/* One telegram for all writes that changed the image. It answers the newest request if that is one of them. */
static void start_image(struct gateway *g)
{
    const bool to_all = g->image_change == IMAGE_FOR_ALL;
    struct transaction *txn = g->newest;

    if (g->state != REQUEST_COMMITTED || txn->target != TARGET_IMAGE || txn->broadcast != to_all)
        txn = request_spare(g);
    translate_image(txn, g->translator.settings.word[CONTROL], to_all);
    start(g, txn, ACTION(IMAGE));
    g->image_ordered = g->image_change;
    g->image_change = 0;
}

/* The newest request asked the drive and has no answer, for its telegram has not left. A parameter write leaves later. */
static bool is_overtaken(const struct gateway *g)
{
    return g->state == REQUEST_COMMITTED && g->newest->telegram_length != 0 && g->newest->target != TARGET_PARAMETER;
}

/* SAFE-7: in place of a start that has not left. A reading that has not left is over, too, for the stop is newer and keeps
 * its repeat. The image shows the stop only if the gate took the order: with a commit just now its licence is gone. */
static void start_stop(struct gateway *g)
{
    const uint32_t control = translate_stopped(&g->translator);
    struct transaction *txn;

    if (MASTER_LOSS_STOP && is_overtaken(g)) { /* without the option the compiler leaves all of it out */
        g->at_drive = g->newest;
        request_answer_silence(g);
    }
    txn = request_spare(g);
    translate_image(txn, control, false);
    start(g, txn, ACTION(IMAGE) | MAILBOX__TELEGRAM__STOP_bm);
    if (!(mailbox_read(EXCHANGE) & (MAILBOX__EXCHANGE__QUEUED_bm | MAILBOX__EXCHANGE__STARTED_bm)))
        return;
    g->translator.settings.word[CONTROL] = control;
    g->image_change = 0;
    g->image_ordered = IMAGE_FOR_ONE;
    g->image_is_newer = true;
}

/* The second telegram of a reading has no licence but that of the newest request. */
static uint32_t action_of(const struct gateway *g)
{
    return g->state == REQUEST_PREPARED ? (uint32_t)g->newest->target << MAILBOX__TELEGRAM__ACTION_bp : ACTION(FIRST);
}

/* The stop or the image, the writes in the order of commit, the newest request (FRAME-7). While a candidate decides, only
 * its own telegram may be ordered: what waits may look different after its commit. */
void orders_next(struct gateway *g)
{
    if (g->state == REQUEST_PREPARED && (g->image_change != 0 || g->waiting[0]))
        return;
    if (g->state != REQUEST_PREPARED && orders_stop_is_due(g))
        start_stop(g);
    else if (g->image_change != 0)
        start_image(g);
    else if (g->waiting[0]) {
        g->image_is_newer = false; /* what else waits is newer than this write */
        start(g, g->waiting[0], ACTION(WRITE));
    } else if (g->asks_drive) {
        g->asks_drive = false;
        start(g, g->newest, action_of(g));
    }
}
