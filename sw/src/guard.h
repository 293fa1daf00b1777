/* SPDX-License-Identifier: Apache-2.0 */
/* Detects flipped bits in the settings and in a telegram being made (docs/hardening.md, Guarded settings). */
#ifndef GUARD_H
#define GUARD_H

#include "transaction.h"

/* Copies the settings. Returns the sum of all words: 0 if the settings are intact. from may equal to. */
uint32_t guard_copy(struct settings *to, const struct settings *from);

/* Changes one of the settings, and the guard word by as much: an error before stays visible. */
void guard_set(struct settings *settings, uint32_t which, uint32_t value);

/* A check word of the telegram of txn and of the next settings (docs/hardening.md, Telegram made twice). */
uint32_t guard_of(const struct translator *t, const struct transaction *txn);

/* Invalidates the guard word of the settings if `difference`, of two passes, is not 0. */
void guard_require_zero(struct settings *settings, uint32_t difference);

#endif
