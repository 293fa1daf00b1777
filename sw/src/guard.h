/* SPDX-License-Identifier: Apache-2.0 */
/* Detects flipped bits in the settings and in a telegram being made (docs/hardening.md, Guarded settings). */
#ifndef GUARD_H
#define GUARD_H

#include "transaction.h"

/* A guard word that the next check refuses. With 0, settings copied from one word too far could pass: the sum of what
 * they lack, of IND and of EEPROM, is a number of 16 bits. */
#define NEVER_INTACT 0xFFFFFFFFu

/* The addresses of the settings and of the next ones, as their sum has them. */
static inline uint32_t guard_addresses(const struct translator *t)
{
    return (uint32_t)(uintptr_t)&t->settings + (uint32_t)(uintptr_t)&t->next;
}

/* Copies the settings to the next ones, or back. Returns the sum of all words and both addresses: 0 if the words are
 * intact. */
uint32_t guard_copy(struct settings *to, const struct settings *from);

/* Changes one of the settings, and the guard word by as much: an error before stays visible. */
void guard_set(struct settings *settings, uint32_t which, uint32_t value);

/* A check word of the telegram of txn and of the next settings (docs/hardening.md, Telegram made twice). */
uint32_t guard_of(const struct translator *t, const struct transaction *txn);

/* Invalidates the guard word of the settings if `difference`, of two passes, is not 0. */
void guard_require_zero(struct settings *settings, uint32_t difference);

#endif
