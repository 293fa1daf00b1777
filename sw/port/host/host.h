/* SPDX-License-Identifier: Apache-2.0 */
/* Access for tests on the host (host.c). */
#ifndef HOST_H
#define HOST_H

#include "gateway.h"

typedef uint32_t host_read_hook(uint32_t offset);
typedef void host_write_hook(uint32_t offset, uint32_t value);

/* Sets the functions that serve register accesses. Offsets are in bytes from the mailbox base. */
void host_connect(host_read_hook *on_read, host_write_hook *on_write);

/* Sizes in bytes. */
uint32_t host_size_of_translator(void);
uint32_t host_size_of_images(void); /* settings and status, the first in struct translator */
uint32_t host_size_of_transaction(void);
uint32_t host_size_of_gateway(void);

/* Fills the newest request, which is about to be translated: bytes that the firmware leaves out show this value. */
void host_soil(struct gateway *g, uint8_t value);

/* Commits the settings that translate_request left, as the gateway does. */
void host_commit(struct translator *t);

const uint8_t *host_reply(const struct transaction *txn, uint32_t *length);
const uint8_t *host_telegram(const struct transaction *txn, uint32_t *length);

#endif
