/* SPDX-License-Identifier: Apache-2.0 */
#include "mailbox_model.h"

#include <string.h>

#include "mailbox_port.h"
#include "options.h"

enum { ADDRESS_AND_CRC = 3, DRIVE_BYTES = 28, WRITE_COIL = 0x05, WRITE_COILS = 0x0F };

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

static void end_licence(struct mailbox *m)
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

/* A write to the telegram's memory ends the licence; here it shows by the changed bytes. A telegram that has left
 * gives way to a write that waits. */
static void end_lost_licence(struct mailbox *m)
{
    if (!m->telegram_queued && !m->licensed)
        return;
    if ((m->begun && (m->waiting[0] || m->waiting[1])) || mailbox_is_touched(m))
        end_licence(m);
}

/* Reply and telegram may leave in one clock. */
static void settle(struct mailbox *m)
{
    bool starts;

    end_lost_licence(m);
    starts = m->telegram_queued && m->licensed && m->quiet && !m->sending;
    if (m->reply_queued && (m->answerable || m->loopback) && (!m->wait_drive || m->drive_good)) {
        m->reply_queued = m->answerable = false;
        m->spent = true;
        m->sent_replies++;
        mailbox_left(m, false);
        if (m->newest && !m->loopback)
            end_licence(m);
    }
    if (starts) {
        m->telegram_queued = m->listening = m->drive_candidate = m->drive_good = false;
        m->started = m->sending = true;
        m->licensed &= m->repeatable && !m->begun;
        m->spent |= m->newest && m->control;
        m->begun = true;
        m->sent_telegrams++;
        mailbox_left(m, true);
        end_lost_licence(m);
    }
}

/* ---- the newest request (request_fate.v, waiting_place.v) */

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
    end_licence(m);
    m->is_candidate = m->is_committed = m->answerable = m->spent = m->kept = false;
    m->reply_queued = m->started = m->begun = m->armed = false;
    m->led = m->asker = 0;
    memset(m->waiting, 0, sizeof m->waiting);
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
    m->is_candidate = true;
    m->is_committed = m->answerable = m->reply_queued = m->kept = false;
    m->telegram_queued &= m->licensed;
}

/* The licence of the newest request moves to the place of its kind. */
static void keep(struct mailbox *m)
{
    m->waiting[m->is_broadcast] = m->request;
    m->waiting_control[m->is_broadcast] = m->writes_coils;
    m->spent |= m->writes_coils;
}

void mailbox_commit(struct mailbox *m)
{
    const bool granted = !m->licensed && m->telegram_queued;

    if (!m->is_candidate)
        return;
    m->is_candidate = m->spent = false;
    m->is_committed = m->answerable = true;
    m->since = m->ticks;
    if (granted) {
        m->licensed = true;
        m->control = m->writes_coils;
    } else if (m->licensed) {
        m->newest = false;
        m->repeatable &= m->from_place;
        if (m->begun && !m->from_place)
            end_licence(m);
    }
    if (m->kept && !granted)
        keep(m);
    m->kept = false;
    settle(m);
}

void mailbox_character(struct mailbox *m)
{
    m->heard |= !m->sending;
    if (m->is_candidate || m->is_committed)
        m->reply_queued = false;
    m->answerable = false;
    if (m->is_candidate) {
        m->is_candidate = m->kept = false;
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

/* At most one tick more than limit passes (master_loss.v). */
static bool stop_is_due(const struct mailbox *m)
{
    return m->armed && m->limit != 0 && m->ticks - m->since > m->limit;
}

uint32_t mailbox_on_read(struct mailbox *m, uint32_t offset)
{
    switch (offset) {
    case offsetof(MAILBOX_t, REQUEST):
        return SHOWN(REQUEST, TICKET, m->ticket) | SHOWN(REQUEST, CANDIDATE, m->is_candidate) |
               SHOWN(REQUEST, COMMITTED, m->is_committed) | SHOWN(REQUEST, BROADCAST, m->is_broadcast) |
               SHOWN(REQUEST, BANK, m->bank);
    case offsetof(MAILBOX_t, EXCHANGE):
        end_lost_licence(m);
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
    default:
        m->unknown++;
        return 0;
    }
}

static void order_reply(struct mailbox *m, uint32_t value)
{
    const bool mine = MAILBOX_FIELD(REPLY, TICKET, value) == m->ticket;
    const bool takes = mine && !m->is_broadcast && (m->is_candidate || (m->is_committed && m->answerable));

    m->reply_length = MAILBOX_FIELD(REPLY, LENGTH, value);
    m->wait_drive = MAILBOX_FIELD(REPLY, AFTER_DRIVE, value);
    m->reply_queued = m->reply_length != 0 && (takes || m->loopback);
    m->spent |= mine && m->is_broadcast;
}

/* The newest request licenses once: the telegram that is queued, or its place. */
static void order_keep(struct mailbox *m, bool mine)
{
    if (!mine || (PLACES == 1 && !m->is_broadcast))
        return;
    if (m->is_candidate)
        m->kept = true;
    else if (m->is_committed && !m->spent && !(m->licensed && m->newest))
        keep(m);
}

static void order_first(struct mailbox *m, bool mine)
{
    const bool licenses = mine && m->is_committed && !m->spent;

    m->licensed = licenses || m->loopback;
    m->telegram_queued = m->licensed || (mine && m->is_candidate);
    m->control = m->writes_coils && licenses;
    m->newest = true;
    m->repeatable = !m->is_broadcast;
    m->from_place = false;
    if (m->telegram_queued)
        m->asker = m->request;
}

static void order_waiting(struct mailbox *m, bool mine, bool stop, uint32_t to_all)
{
    const uint32_t number = m->waiting[to_all];

    m->licensed = stop ? stop_is_due(m) : number != 0;
    m->control = stop || m->waiting_control[to_all];
    if (m->licensed)
        m->asker = stop ? 0 : number;
    if (stop)
        m->armed &= !m->licensed;
    else
        m->waiting[to_all] = 0;
    m->telegram_queued = m->licensed;
    m->newest = mine;
    m->repeatable = m->from_place = stop || !to_all;
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
    const uint32_t action = MAILBOX_FIELD(TELEGRAM, ACTION, value);
    uint32_t i;

    if (action == MAILBOX__TELEGRAM__ACTION__KEEP) {
        order_keep(m, mine);
        return;
    }
    if (m->sending) {
        m->broken |= BROKEN_OVERWRITTEN;
        return;
    }
    m->started = false;
    end_lost_licence(m);
    if (action == MAILBOX__TELEGRAM__ACTION__REPEAT) {
        m->telegram_queued = m->licensed && m->begun && m->repeatable;
        return;
    }
    m->begun = false;
    m->telegram_length = MAILBOX_FIELD(TELEGRAM, LENGTH, value);
    m->broken |= broken_by(m, m->telegram_length, MAILBOX_FIELD(TELEGRAM, STOP, value));
    m->no_reply = MAILBOX_FIELD(TELEGRAM, NO_REPLY, value);
    if (action == MAILBOX__TELEGRAM__ACTION__WAITING)
        order_waiting(m, mine, MAILBOX_FIELD(TELEGRAM, STOP, value), m->no_reply);
    else
        order_first(m, mine);
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
        end_licence(m);
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
