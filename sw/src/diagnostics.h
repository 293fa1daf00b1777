/* SPDX-License-Identifier: Apache-2.0 */
/* Functions 08, 0B, 11 and 2B/0E (MAP-10), and the counters that they report. Only with the option DIAGNOSTICS. */
#ifndef DIAGNOSTICS_H
#define DIAGNOSTICS_H

#include "codes.h"

/* Each gets the PDU from its function code on, and its length as txn->operand. */
handler diagnose, identify, report_server, report_events;

/* Counts a committed request, and its reply if that needs no drive. Clears the counters if it asked for that. */
void diagnostics_commit(const struct transaction *txn);

/* Counts the reply that txn->out.reply holds, or a broadcast at its commit. */
void diagnostics_done(const struct transaction *txn);

#endif
