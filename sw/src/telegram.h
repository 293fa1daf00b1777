/* SPDX-License-Identifier: Apache-2.0 */
/* Makes FC telegrams (FC-3) in the transaction, from ADR to BCC. The two that start an exchange return
 * OUTCOME_EXCHANGE. */
#ifndef TELEGRAM_H
#define TELEGRAM_H

#include "codes.h"

/* A telegram of process data alone; control: CTW, and REF in the high half. */
enum outcome telegram_process(struct transaction *txn, uint32_t control);

/* A telegram with a parameter field. PWE, or the text, is `zeros` zero bytes and then `bytes` bytes of data. */
enum outcome telegram_parameter(struct transaction *txn, uint32_t ak, uint32_t zeros, uint32_t ind,
                                uint32_t bytes, frame_byte *data);

/* Turns the telegram of a number into the telegram of a text with the same content. */
void telegram_as_text(struct transaction *txn);

#endif
