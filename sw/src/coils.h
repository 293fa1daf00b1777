/* SPDX-License-Identifier: Apache-2.0 */
/* Coils 1-128 (MAP-1...MAP-4): handlers of functions 01, 05 and 0F. */
#ifndef COILS_H
#define COILS_H

#include "codes.h"

handler coils_read, coils_write;

/* The reply to 01; status: coils 33-64. */
uint32_t coils_answer(const struct translator *t, struct transaction *txn, uint32_t status);

#endif
