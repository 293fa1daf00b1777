/* SPDX-License-Identifier: Apache-2.0 */
/* The firmware on the host: which mailbox it sees, its rounds, what left, and the content of the core's structs. */
#ifndef HOST_H
#define HOST_H

#include "gateway.h"
#include "machine.h"
#include "mailbox_model.h"

typedef uint32_t host_read_hook(uint32_t offset);
typedef void host_write_hook(uint32_t offset, uint32_t value);

/* The mailbox of all register accesses from now on. With g, each translation starts from a soiled transaction: bytes that
 * the firmware leaves out show MAILBOX_JUNK. */
void host_connect(struct mailbox *m, struct gateway *g);

/* Registers that functions of the test serve in place of the model: bit n for the one at offset n. */
void host_watch(uint32_t reads, uint32_t writes, host_read_hook *on_read, host_write_hook *on_write);

bool host_is_halted(void);

/* Plays the rounds of a gateway or of a machine: `rounds` of them after each of `ms` milliseconds from `time` on, or once if
 * ms is 0. Ends early when the firmware halts the card. False: the firmware hangs. */
bool host_run(struct gateway *g, struct machine *cpu, uint32_t time, uint32_t ms, uint32_t rounds);

/* The last telegrams and replies that left, all counted in host_sent_count. */
enum { HOST_SENT_KEPT = 1024 };
struct host_sent {
    uint8_t telegram;
    uint8_t loopback;
    uint8_t length;
    uint8_t byte[MAILBOX_FRAME_MAX];
};
extern struct host_sent host_sent[HOST_SENT_KEPT];
extern uint32_t host_sent_count;

/* ---- the translation core */

/* Sizes in bytes. */
uint32_t host_size_of_translator(void);
uint32_t host_size_of_images(void); /* settings and status, the first in struct translator */
uint32_t host_size_of_transaction(void);
uint32_t host_size_of_gateway(void);

/* translate_request() with a PDU of `kept` bytes as laid out in a bank, in a transaction full of MAILBOX_JUNK. */
int host_request(struct translator *t, struct transaction *txn, const uint8_t *pdu, uint32_t kept, uint32_t length,
                 bool broadcast);

/* translate_drive_reply() with telegram data as the receiver stores them (FC-7). */
int host_drive_reply(struct translator *t, struct transaction *txn, const uint8_t *data, uint32_t length, uint32_t lge);

/* Commits the settings that translate_request left, as the gateway does. */
void host_commit(struct translator *t);

const uint8_t *host_reply(const struct transaction *txn, uint32_t *length);
const uint8_t *host_telegram(const struct transaction *txn, uint32_t *length);

#endif
