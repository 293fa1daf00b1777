/* SPDX-License-Identifier: Apache-2.0 */
/* Access for tests on the host: a mailbox with registers of the test, and the content of the core's structs. */
#include "host.h"

#include <string.h>

#include "guard.h"
#include "mailbox_port.h"

volatile uint32_t host_frames[FRAMES_bytes / sizeof(uint32_t)];

static host_read_hook *read_hook;
static host_write_hook *write_hook;

void host_connect(host_read_hook *on_read, host_write_hook *on_write)
{
    read_hook = on_read;
    write_hook = on_write;
}

uint32_t host_read(uint32_t offset)
{
    return read_hook(offset);
}

void host_write(uint32_t offset, uint32_t value)
{
    write_hook(offset, value);
}

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

void host_soil(struct gateway *g, uint8_t value)
{
    memset(g->newest, value, sizeof *g->newest);
}

void host_commit(struct translator *t)
{
    translate_commit(t, t->next.word[GUARD] + GUARD_KEY);
}

const uint8_t *host_reply(const struct transaction *txn, uint32_t *length)
{
    *length = txn->reply_length;
    return txn->out.reply;
}

const uint8_t *host_telegram(const struct transaction *txn, uint32_t *length)
{
    *length = txn->telegram_length;
    return txn->out.telegram.byte;
}
