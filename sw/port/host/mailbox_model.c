/* SPDX-License-Identifier: Apache-2.0 */
#include "mailbox_model.h"

#include <string.h>

#include "mailbox_port.h"
#include "options.h"

enum { ADDRESS_AND_CRC = 3, DRIVE_BYTES = 28 };
enum { WRITE_COIL = 0x05, WRITE_REGISTER = 0x06, WRITE_COILS = 0x0F, WRITE_REGISTERS = 0x10 };

#define MAILBOX_NAME(name) #name " "
const char mailbox_fields[] = MAILBOX_STATE(MAILBOX_NAME);

const uint32_t mailbox_size = sizeof(struct mailbox);

#define SHOWN(reg, field, value) ((uint32_t)(value) << MAILBOX__##reg##__##field##_bp)

static void soil(volatile struct frame_slot *frame, uint32_t bytes)
{
    while (bytes-- != 0)
        frame[bytes].byte = MAILBOX_JUNK;
}

/* ---- what leaves (telegram_slot.v, reply_slot.v) */

static void drop(struct mailbox *m)
{
    m->telegram_queued = m->licensed = false;
}

uint32_t mailbox_is_touched(const struct mailbox *m)
{
    uint32_t i;

    for (i = 0; i < m->telegram_length; i++)
        if (mailbox_frame(TELEGRAM_FRAME)[i].byte != m->telegram[i])
            return true;
    return false;
}

/* A write to the telegram's memory drops it; here it shows by the changed bytes. */
static void drop_if_touched(struct mailbox *m)
{
    if ((m->telegram_queued || m->licensed) && mailbox_is_touched(m))
        drop(m);
}

/* At most one tick more than limit passes (master_loss.v). */
static bool stop_is_due(const struct mailbox *m)
{
    return m->armed && m->limit != 0 && m->ticks - m->since > m->limit;
}

/* Decides on a telegram that was ordered, once no candidate is pending. */
static void license(struct mailbox *m)
{
    const bool newest = m->is_committed && !m->answered && !m->is_broadcast;

    if (!m->telegram_queued || m->licensed || m->is_candidate)
        return;
    if (m->loopback || (m->kind == KIND_NEWEST ? newest : m->valid[m->kind])) {
        m->licensed = true;
        m->asker = m->loopback || m->kind == KIND_NEWEST ? m->request : m->given_by[m->kind];
        m->without_start = m->kind == KIND_IMAGE && (!m->free || m->is_stop);
        /* A stop is licensed once; one that was dropped stays due (SAFE-7). */
        m->armed &= !(m->without_start && stop_is_due(m));
    } else {
        drop(m);
    }
}

static void telegram_leaves(struct mailbox *m)
{
    m->telegram_queued = m->listening = m->drive_candidate = m->drive_good = false;
    m->started = m->sending = true;
    m->licensed = m->repeatable && !m->again;
    if (!m->left && !m->loopback) {
        m->valid[m->kind] -= m->valid[m->kind] != 0;
        m->free &= m->kind != KIND_IMAGE;
    }
    m->left = true;
    m->sent_telegrams++;
    mailbox_left(m, true);
}

/* Reply and telegram may leave in one clock. */
static void settle(struct mailbox *m)
{
    bool starts;

    drop_if_touched(m);
    license(m);
    starts = m->telegram_queued && m->licensed && m->quiet && !m->sending;
    if (m->reply_queued && (m->answerable || m->loopback) && (!m->wait_drive || m->drive_good)) {
        m->reply_queued = m->answerable = false;
        m->answered = true;
        m->sent_replies++;
        mailbox_left(m, false);
    }
    if (starts)
        telegram_leaves(m);
}

/* ---- the newest request (request_state.v, licences.v) */

void mailbox_init(struct mailbox *m)
{
    memset(m, 0, sizeof *m);
    m->quiet = true;
    m->address = 1;
    memset((void *)host_frames, 0, sizeof host_frames);
}

/* The lines go on: a telegram that is being sent, and the receiver (rtl/rtu2fc.v). */
void mailbox_restart(struct mailbox *m)
{
    drop(m);
    m->restarts += m->restarts != MAILBOX__RESTARTS__COUNT_bm;
    m->is_candidate = m->is_committed = m->answerable = m->answered = false;
    m->reply_queued = m->started = m->armed = m->free = false;
    m->led = m->asker = 0;
    memset(m->valid, 0, sizeof m->valid);
}

void mailbox_candidate(struct mailbox *m, uint32_t number, const uint8_t *pdu, uint32_t length, uint32_t broadcast)
{
    volatile struct frame_slot *frame;
    uint32_t i;

    m->heard |= !m->sending;
    m->bank ^= 1u;
    frame = m->bank ? mailbox_frame(REQUEST_FRAME_1) : mailbox_frame(REQUEST_FRAME_0);
    soil(frame, MAILBOX_FRAME_MAX);
    soil(mailbox_frame(REPLY_FRAME), MAILBOX_FRAME_MAX);
    frame->byte = broadcast ? 0 : (uint8_t)m->address;
    for (i = 0; i < length && i < MAILBOX_FRAME_MAX - 1; i++)
        frame[i + 1].byte = pdu[i];
    m->length = length + ADDRESS_AND_CRC;
    m->request = number;
    m->ticket = (m->ticket + 1) & MAILBOX__REQUEST__TICKET_bm;
    m->is_broadcast = broadcast;
    m->writes_coils = length != 0 && (*pdu == WRITE_COIL || *pdu == WRITE_COILS);
    m->writes_parameter = length != 0 && (*pdu == WRITE_REGISTER || *pdu == WRITE_REGISTERS);
    m->is_candidate = true;
    m->is_committed = m->answerable = m->answered = m->reply_queued = false;
    m->telegram_queued &= m->licensed;
}

static uint32_t kind_of_newest(const struct mailbox *m)
{
    if (m->writes_coils)
        return KIND_IMAGE;
    return !m->writes_parameter ? KIND_NEWEST : m->is_broadcast ? KIND_ALL : KIND_ONE;
}

/* A telegram of the same kind that was made before this commit may not leave any more. */
void mailbox_commit(struct mailbox *m)
{
    const uint32_t kind = kind_of_newest(m);
    const bool reading_left = m->kind == KIND_NEWEST && m->left;

    if (!m->is_candidate)
        return;
    m->is_candidate = false;
    m->is_committed = m->answerable = true;
    m->since = m->ticks;
    m->valid[kind] = kind == KIND_ONE ? TELEGRAMS_OF_A_WRITE : kind != KIND_NEWEST;
    m->given_by[kind] = m->request;
    m->free |= m->writes_coils;
    if (m->licensed && ((m->kind == kind && kind != KIND_NEWEST) || reading_left))
        drop(m);
    settle(m);
}

void mailbox_character(struct mailbox *m)
{
    m->heard |= !m->sending;
    if (m->is_candidate || m->is_committed)
        m->reply_queued = false;
    m->answerable = false;
    if (m->is_candidate) {
        m->is_candidate = false;
        m->telegram_queued &= m->licensed;
    }
}

/* ---- the drive line (fc_rx.v) */

void mailbox_pause_over(struct mailbox *m)
{
    m->quiet = true;
    settle(m);
}

void mailbox_telegram_ends(struct mailbox *m)
{
    if (m->sending) {
        m->broken |= mailbox_is_touched(m) ? BROKEN_TOUCHED : 0;
        m->sending = false;
        m->listening = !m->no_reply;
    }
}

void mailbox_drive_data(struct mailbox *m, const uint8_t *data, uint32_t length, uint32_t lge)
{
    volatile struct frame_slot *frame = mailbox_frame(DRIVE_FRAME);
    uint32_t i;

    if (!m->listening || m->drive_good)
        return;
    if (!m->loopback) /* the loop-back test has a filler of its own there */
        soil(frame, DRIVE_BYTES);
    for (i = 0; i < length; i++)
        frame[mailbox_drive_slot(i)].byte = data[i];
    mailbox_frame(DRIVE_LGE)->byte = (uint8_t)lge;
    m->drive_candidate = true;
}

void mailbox_bcc(struct mailbox *m, uint32_t good)
{
    if (!m->drive_candidate)
        return;
    m->drive_candidate = false;
    m->drive_good = good;
    if (!good && m->wait_drive)
        m->reply_queued = false;
    settle(m);
}

/* ---- registers (mailbox_regs.v) */

uint32_t mailbox_on_read(struct mailbox *m, uint32_t offset)
{
    switch (offset) {
    case offsetof(MAILBOX_t, REQUEST):
        return SHOWN(REQUEST, TICKET, m->ticket) | SHOWN(REQUEST, CANDIDATE, m->is_candidate) |
               SHOWN(REQUEST, COMMITTED, m->is_committed) | SHOWN(REQUEST, BROADCAST, m->is_broadcast) |
               SHOWN(REQUEST, BANK, m->bank);
    case offsetof(MAILBOX_t, EXCHANGE):
        drop_if_touched(m);
        return SHOWN(EXCHANGE, QUEUED, m->telegram_queued) | SHOWN(EXCHANGE, SENDING, m->sending) |
               SHOWN(EXCHANGE, STARTED, m->started) | SHOWN(EXCHANGE, CANDIDATE, m->drive_candidate) |
               SHOWN(EXCHANGE, GOOD, m->drive_good) | SHOWN(EXCHANGE, LOOPBACK, m->loopback) |
               SHOWN(EXCHANGE, HEARD, m->heard) |
               SHOWN(EXCHANGE, STOP_DUE, stop_is_due(m));
    case offsetof(MAILBOX_t, LENGTH):
        return m->length & MAILBOX__LENGTH__BYTES_bm;
    case offsetof(MAILBOX_t, TIME):
        return m->ticks & MAILBOX__TIME__TICKS_bm;
    case offsetof(MAILBOX_t, EVENTS):
        return m->events;
    case offsetof(MAILBOX_t, RESTARTS):
        return m->restarts;
    default:
        return m->outside & 0xFFu;
    }
}

static void order_reply(struct mailbox *m, uint32_t value)
{
    const bool mine = MAILBOX_FIELD(REPLY, TICKET, value) == m->ticket;
    const bool takes = mine && !m->is_broadcast && (m->is_candidate || (m->is_committed && m->answerable));

    m->reply_length = MAILBOX_FIELD(REPLY, LENGTH, value);
    m->wait_drive = MAILBOX_FIELD(REPLY, AFTER_DRIVE, value);
    m->reply_queued = m->reply_length != 0 && (takes || m->loopback);
}

static void order_repeat(struct mailbox *m)
{
    if (m->left && m->licensed) {
        m->again = true;
        m->telegram_queued = true;
    }
}

static uint32_t kind_of(uint32_t value)
{
    switch (MAILBOX_FIELD(TELEGRAM, ACTION, value)) {
    case MAILBOX__TELEGRAM__ACTION__IMAGE:
        return KIND_IMAGE;
    case MAILBOX__TELEGRAM__ACTION__WRITE:
        return MAILBOX_FIELD(TELEGRAM, NO_REPLY, value) ? KIND_ALL : KIND_ONE;
    default:
        return KIND_NEWEST;
    }
}

/* The stop gives the image a licence, if it has none (master_loss.v). */
static void take_stop(struct mailbox *m)
{
    m->is_stop = stop_is_due(m);
    if (!m->is_stop || m->valid[KIND_IMAGE])
        return;
    m->valid[KIND_IMAGE] = true;
    m->given_by[KIND_IMAGE] = 0;
    m->free = false;
}

/* XOR of STX, LGE, all bytes and BCC. */
static bool bcc_fits(uint32_t length)
{
    uint32_t bcc = 0x02u ^ length;

    while (length-- != 0)
        bcc ^= mailbox_frame(TELEGRAM_FRAME)[length].byte;
    return bcc == 0;
}

static uint32_t broken_by(const struct mailbox *m, uint32_t length, bool stop)
{
    const bool starts = mailbox_frame(TELEGRAM_FRAME)[2].byte & 1u << 6; /* bit 6 of the control word */

    if (length < 2 || (!m->loopback && !bcc_fits(length)))
        return BROKEN_BCC;
    return stop && (length < 3 || starts) ? BROKEN_STOP : 0;
}

static void order_telegram(struct mailbox *m, uint32_t value)
{
    const bool mine = MAILBOX_FIELD(TELEGRAM, TICKET, value) == m->ticket;
    const bool meant =
        MAILBOX_FIELD(TELEGRAM, EARLY, value) ? m->is_candidate || m->is_committed : !m->is_candidate;
    uint32_t i;

    if (m->sending) {
        m->broken |= BROKEN_OVERWRITTEN;
        return;
    }
    m->started = false;
    drop_if_touched(m);
    if (MAILBOX_FIELD(TELEGRAM, ACTION, value) == MAILBOX__TELEGRAM__ACTION__REPEAT) {
        order_repeat(m);
        return;
    }
    m->licensed = m->left = m->again = false;
    m->telegram_length = MAILBOX_FIELD(TELEGRAM, LENGTH, value);
    m->broken |= broken_by(m, m->telegram_length, MAILBOX_FIELD(TELEGRAM, STOP, value));
    m->kind = m->loopback ? KIND_NEWEST : kind_of(value);
    m->no_reply = MAILBOX_FIELD(TELEGRAM, NO_REPLY, value);
    m->repeatable = !m->no_reply;
    m->is_stop = false;
    m->telegram_queued = m->loopback || (mine && meant);
    if (m->kind == KIND_IMAGE && mine && !m->is_candidate && MAILBOX_FIELD(TELEGRAM, STOP, value))
        take_stop(m);
    for (i = 0; i < m->telegram_length; i++)
        m->telegram[i] = mailbox_frame(TELEGRAM_FRAME)[i].byte;
}

static void supervise(struct mailbox *m, uint32_t value)
{
    m->halted |= MAILBOX_FIELD(SUPERVISOR, HALT, value);
    if (MAILBOX_FIELD(SUPERVISOR, WATCH, value) && MAILBOX_FIELD(SUPERVISOR, TICKET, value) == m->ticket &&
        m->is_committed) {
        m->limit = MAILBOX_FIELD(SUPERVISOR, PERIOD, value);
        m->since = m->ticks;
        if (m->writes_coils)
            m->armed = MAILBOX_FIELD(SUPERVISOR, RUNNING, value);
    }
    if (MAILBOX_FIELD(SUPERVISOR, LOOPBACK, value) && m->loopback) {
        m->loopback = m->reply_queued = false;
        drop(m);
    }
}

void mailbox_on_write(struct mailbox *m, uint32_t offset, uint32_t value)
{
    switch (offset) {
    case offsetof(MAILBOX_t, EVENTS):
        m->events &= ~value;
        break;
    case offsetof(MAILBOX_t, REPLY):
        order_reply(m, value);
        break;
    case offsetof(MAILBOX_t, TELEGRAM):
        order_telegram(m, value);
        break;
    case offsetof(MAILBOX_t, LED):
        m->led = value & (MAILBOX__LED__MODBUS_RED_bm | MAILBOX__LED__MODBUS_GREEN_bm |
                          MAILBOX__LED__DRIVE_RED_bm | MAILBOX__LED__DRIVE_GREEN_bm);
        break;
    case offsetof(MAILBOX_t, LISTEN):
        m->listening = MAILBOX_FIELD(LISTEN, ON, value);
        m->drive_candidate = m->drive_good = false;
        break;
    case offsetof(MAILBOX_t, WATCHDOG):
        m->kicks += MAILBOX_FIELD(WATCHDOG, KEY, value) == MAILBOX__WATCHDOG__KEY_reset;
        break;
    case offsetof(MAILBOX_t, SUPERVISOR):
        supervise(m, value);
        break;
    default:
        m->unknown++;
        break;
    }
    settle(m);
}
