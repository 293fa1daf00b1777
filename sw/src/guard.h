/* SPDX-License-Identifier: Apache-2.0 */
/* Detects flipped bits in the settings and in a telegram being made (docs/hardening.md, Guarded settings). */
#ifndef GUARD_H
#define GUARD_H

#include "transaction.h"

/* Copies the settings. Returns the sum of all words: 0 if the settings are intact. from may equal to. */
uint32_t guard_copy(struct settings *to, const struct settings *from);

/* Sets the guard word after a change of the settings. */
void guard_seal(struct settings *settings);

/* A check word of the telegram of txn and of the next settings (docs/hardening.md, Telegram made twice). */
uint32_t guard_of(const struct translator *t, const struct transaction *txn);

/* Invalidates the guard word of the settings if two check words differ. */
void guard_require_equal(struct settings *settings, uint32_t first, uint32_t second);

#endif
