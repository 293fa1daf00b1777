/* SPDX-License-Identifier: Apache-2.0 */
/* Makes FC telegrams (FC-3) in the transaction, from ADR to BCC. The two that start an exchange return
 * OUTCOME_EXCHANGE. */
#ifndef TELEGRAM_H
#define TELEGRAM_H

#include "codes.h"

/* A telegram of process data alone; control: CTW, and REF in the high half. */
uint32_t telegram_process(struct transaction *txn, uint32_t control, enum target target);

/* A telegram with a parameter field: a number or a text, as txn->expects says. bytes: of the data to be written, 0 for a
 * reading. ak: of a number. index: the low byte of IND. */
uint32_t telegram_parameter(struct transaction *txn, uint32_t ak, uint32_t index, uint32_t bytes, frame_byte *data);

/* Turns the telegram of a number into that of a text with the same content, or that of a text reading into that of a
 * number reading. */
void telegram_as_other(struct transaction *txn);

#endif
