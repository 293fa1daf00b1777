/* SPDX-License-Identifier: Apache-2.0 */
/* The short replies: exceptions, and the confirmation of a write. Each makes the reply and returns OUTCOME_REPLY. */
#ifndef REPLY_H
#define REPLY_H

#include "codes.h"

/* An exception with this code (EXC). */
enum outcome reply_exception(struct transaction *txn, uint32_t code);

/* The exception for a fault number of the drive (AK 7), which the dialect may replace by one code for all. */
enum outcome reply_fault(struct transaction *txn, uint32_t fault);

/* Confirms a write: 05 and 06 echo address and value, 0F and 10 address and quantity. */
enum outcome reply_confirm(struct transaction *txn);

#endif
