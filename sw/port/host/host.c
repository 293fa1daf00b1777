/* SPDX-License-Identifier: Apache-2.0 */
#include "host.h"

#include <string.h>

#include "mailbox_port.h"
#include "ticks.h"

enum { LONGEST_ROUND = 100000 }; /* instructions; the check of the whole image at the start is the longest */

volatile uint32_t host_frames[FRAMES_bytes / sizeof(uint32_t)];

static struct mailbox nobodys; /* of a test of the translation alone */
static struct mailbox *mailbox = &nobodys;
static struct gateway *gateway;
static uint32_t watched_reads, watched_writes;
static host_read_hook *read_hook;
static host_write_hook *write_hook;

/* ---- registers */

void host_connect(struct mailbox *m, struct gateway *g)
{
    mailbox = m ? m : &nobodys;
    gateway = g;
    watched_reads = watched_writes = 0;
}

void host_watch(uint32_t reads, uint32_t writes, host_read_hook *on_read, host_write_hook *on_write)
{
    watched_reads = reads;
    watched_writes = writes;
    read_hook = on_read;
    write_hook = on_write;
}

uint32_t host_read(uint32_t offset)
{
    /* The length is read at the beginning of each translation. */
    if (gateway && offset == offsetof(MAILBOX_t, LENGTH))
        memset(gateway->newest, MAILBOX_JUNK, sizeof *gateway->newest);
    return watched_reads >> offset & 1 ? read_hook(offset) : mailbox_on_read(mailbox, offset);
}

void host_write(uint32_t offset, uint32_t value)
{
    if (watched_writes >> offset & 1)
        write_hook(offset, value);
    else
        mailbox_on_write(mailbox, offset, value);
}

/* ---- rounds, and what left */

bool host_is_halted(void)
{
    return mailbox->halted != 0;
}

bool host_run(struct gateway *g, struct machine *cpu, uint32_t time, uint32_t ms, uint32_t rounds)
{
    const uint32_t end = time + ms;
    uint32_t i;

    do {
        if (ms != 0) {
            time++;
            mailbox->ticks += TICKS(time) - TICKS(time - 1);
        }
        for (i = 0; i < rounds && !mailbox->halted; i++)
            if (g)
                (void)gateway_poll(g);
            else if (!machine_round(cpu, LONGEST_ROUND))
                return false;
    } while (time != end);
    return true;
}

struct host_sent host_sent[HOST_SENT_KEPT];
uint32_t host_sent_count;

void mailbox_left(const struct mailbox *m, bool telegram)
{
    struct host_sent *sent = &host_sent[host_sent_count++ % HOST_SENT_KEPT];
    uint32_t i;

    sent->telegram = telegram;
    sent->loopback = m->loopback != 0;
    sent->length = (uint8_t)(telegram ? m->telegram_length : m->reply_length);
    for (i = 0; i < sent->length && i < MAILBOX_FRAME_MAX; i++)
        sent->byte[i] = telegram ? m->telegram[i] : mailbox_frame(REPLY_FRAME)[i].byte;
}

/* ---- the translation core */

uint32_t host_size_of_translator(void)
{
    return sizeof(struct translator);
}

uint32_t host_size_of_images(void)
{
    return offsetof(struct translator, next);
}

uint32_t host_size_of_transaction(void)
{
    return sizeof(struct transaction);
}

uint32_t host_size_of_gateway(void)
{
    return sizeof(struct gateway);
}

int host_request(struct translator *t, struct transaction *txn, const uint8_t *pdu, uint32_t kept, uint32_t length,
                 bool broadcast)
{
    struct frame_slot bank[MAILBOX_FRAME_MAX];
    uint32_t i;

    memset(bank, MAILBOX_JUNK, sizeof bank);
    memset(txn, MAILBOX_JUNK, sizeof *txn);
    for (i = 0; i < kept; i++)
        bank[i].byte = pdu[i];
    return (int)translate_request(t, txn, bank, length, broadcast);
}

int host_drive_reply(struct translator *t, struct transaction *txn, const uint8_t *data, uint32_t length, uint32_t lge)
{
    struct frame_slot bank[MAILBOX_FRAME_MAX];
    uint32_t i;

    memset(bank, MAILBOX_JUNK, sizeof bank);
    for (i = 0; i < length; i++)
        bank[mailbox_drive_slot(i)].byte = data[i];
    return (int)translate_drive_reply(t, txn, bank, lge);
}

void host_commit(struct translator *t)
{
    translate_commit(t);
}

const uint8_t *host_reply(const struct transaction *txn, uint32_t *length)
{
    *length = txn->reply_length;
    return txn->out.reply;
}

const uint8_t *host_telegram(const struct transaction *txn, uint32_t *length)
{
    *length = txn->telegram_length;
    return txn->out.telegram;
}
