/* SPDX-License-Identifier: Apache-2.0 */
#include "exchange.h"

#include "codes.h"
#include "dialect.h"
#include "mailbox_port.h"
#include "orders.h"
#include "request.h"
#include "ticks.h"

static bool is_newest(const struct gateway *g)
{
    return g->at_drive == g->newest;
}

/* FC-9: the time-out for the drive's reply, and for a line that is never silent. A dead drive holds up nobody: the
 * time-out is the default at most while another telegram waits. '>' covers the part of a tick before wait_start was
 * sampled, the additional tick a long round before that. So the wait is never too short. */
static bool timed_out(const struct gateway *g)
{
    uint32_t tens = g->translator.settings.word[LOCAL_DRIVE_TIMEOUT];

    if (tens > DEFAULT_DRIVE_TIMEOUT && orders_wait(g))
        tens = DEFAULT_DRIVE_TIMEOUT;
    return g->now - g->wait_start > ticks_of_tens(tens) + 1;
}

/* ---- end */

ONE_COPY static void end(struct gateway *g)
{
    g->exchange = EXCHANGE_IDLE;
    g->image_change |= g->image_ordered;
    g->image_ordered = 0;
}

/* The drive gave no good reply (FC-9). An image that has not left stays changed, a parameter write stays in its place. */
static void abandon(struct gateway *g)
{
    mailbox_count(mailbox_counter(COUNT_DRIVE_NO_REPLY));
    g->drive_online = false;
    if (is_newest(g))
        request_answer_silence(g);
    end(g);
}

/* One repeat, and none while another telegram waits. */
static void repeat_or_abandon(struct gateway *g)
{
    mailbox_write(LISTEN, 0);
    if (g->repeated || orders_wait(g)) {
        abandon(g);
        return;
    }
    orders_repeat(g);
}

/* ---- a telegram that leaves */

/* Only a line that is not silent holds a telegram back. Stop and image go before all else, and whatever is committed before
 * a reading that is not the newest request any more, and before a repeat. */
static bool is_to_wait(struct gateway *g)
{
    if (is_newest(g) && g->state == REQUEST_PREPARED) {
        g->wait_start = g->now;
        return true;
    }
    if (timed_out(g) || g->image_change != 0 || orders_stop_is_due(g))
        return false;
    return !((g->repeated || (g->at_drive->target == TARGET_READING && !is_newest(g))) && orders_wait(g));
}

static void left(struct gateway *g)
{
    g->image_ordered = 0;
    orders_stop_waiting(g);
    g->wait_start = g->now;
    g->exchange = EXCHANGE_WAITING;
    if (!g->at_drive->broadcast)
        return;
    request_finish(g);
    end(g);
}

/* The line was busy for the whole wait. It held up the newest request as well, if that was committed before, whichever
 * telegram is next to leave. */
static void give_up_line(struct gateway *g)
{
    if (g->state == REQUEST_COMMITTED && g->newest->telegram_length != 0 &&
        (int32_t)(g->wait_start - g->committed_at) >= 0)
        g->at_drive = g->newest;
    abandon(g);
}

/* Taken back, or dropped with its candidate or for a commit of its own kind. What waits is ordered anew, and so is the
 * repeat of a write if that commit asks the drive for nothing (FC-9). */
static void dropped(struct gateway *g)
{
    if (timed_out(g))
        give_up_line(g);
    else if (g->repeated && (g->at_drive->target == TARGET_READING || orders_wait(g)))
        abandon(g);
    else if (!g->repeated)
        end(g);
    else if (g->state != REQUEST_PREPARED)
        orders_repeat_anew(g);
}

static void poll_leaving(struct gateway *g, uint32_t state)
{
    if (state & MAILBOX__EXCHANGE__STARTED_bm)
        left(g);
    else if (!(state & MAILBOX__EXCHANGE__QUEUED_bm) || (!is_to_wait(g) && orders_take_back()))
        dropped(g);
}

/* ---- the drive's reply */

/* Prepares the reply while the BCC of the drive's telegram is still on the line (PERF-3). Nobody gets that of an older
 * reading: like a write it is only confirmed, for a long text would hide the commit of the newer one (gateway.h). */
static void evaluate(struct gateway *g)
{
    if (!is_newest(g) && g->at_drive->target == TARGET_READING)
        g->at_drive->function = WRITE_REGISTER;
    g->reply_outcome = (uint8_t)translate_drive_reply(&g->translator, g->at_drive, mailbox_frame(DRIVE_FRAME),
                                                      mailbox_byte(&mailbox_frame(DRIVE_LGE)->byte));
    if (g->reply_outcome == OUTCOME_REPLY)
        request_reply(g, g->at_drive, MAILBOX__REPLY__AFTER_DRIVE_bm);
}

static void take_reply(struct gateway *g)
{
    translate_drive_commit(&g->translator);
    g->drive_online = true;
    end(g);
    if (TRAITS.text_by_size && g->reply_outcome == OUTCOME_EXCHANGE) {
        translate_drive_again(g->at_drive);
        orders_again(g);
        return;
    }
    request_confirm_reply(g);
    request_finish(g);
}

static void poll_waiting(struct gateway *g, uint32_t state)
{
    const bool good = (state & MAILBOX__EXCHANGE__GOOD_bm) != 0;
    const bool received = good || state & MAILBOX__EXCHANGE__CANDIDATE_bm;

    if (received && g->reply_outcome == OUTCOME_NOT_A_REPLY)
        evaluate(g);
    if (!received && g->reply_outcome != OUTCOME_NOT_A_REPLY) {
        g->reply_outcome = OUTCOME_NOT_A_REPLY;
        request_cancel_reply(g);
    }
    if (good && g->reply_outcome != OUTCOME_NOT_A_REPLY) {
        take_reply(g);
        return;
    }
    if (good)
        mailbox_write(LISTEN, MAILBOX__LISTEN__ON_bm);
    /* A BCC on the line may extend the wait by two characters at most. */
    if (g->reply_outcome == OUTCOME_NOT_A_REPLY && timed_out(g))
        repeat_or_abandon(g);
}

void exchange_poll(struct gateway *g)
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
        orders_next(g);
}
