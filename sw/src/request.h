/* SPDX-License-Identifier: Apache-2.0 */
/* The newest request: prepared as a candidate, then committed or revoked (FRAME-6), and its reply. */
#ifndef REQUEST_H
#define REQUEST_H

#include "gateway.h"

/* Follows the newest request one step. */
void request_poll(struct gateway *g);

/* A transaction that is in no use. */
struct transaction *request_spare(struct gateway *g);

/* Queues the reply of txn if txn is the newest request: only that is answered (FRAME-7). flags: of REPLY. */
void request_reply(struct gateway *g, const struct transaction *txn, uint32_t flags);

/* Drops a reply that was prepared from a telegram with a wrong BCC. */
void request_cancel_reply(struct gateway *g);

/* The drive's telegram was good: a reply that waits for it need not wait any more. */
void request_confirm_reply(struct gateway *g);

/* The request at the drive is over; if it is the newest one, its outcome counts (MAP-10). */
void request_finish(struct gateway *g);

/* The newest request, for which the drive was silent, gets its answer in another transaction: its telegram may still
 * have to leave. */
void request_answer_silence(struct gateway *g);

#endif
