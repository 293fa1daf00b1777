/* SPDX-License-Identifier: Apache-2.0 */
/* Detects flipped bits in the settings and in a telegram being made (docs/hardening.md, Guarded settings). */
#ifndef GUARD_H
#define GUARD_H

#include "transaction.h"

/* A guard word that the next check refuses. No small number, positive or negative: the sum of wrong settings may differ by
 * one from 0. */
#define NEVER_INTACT 0x5A5A5000u

/* The addresses of the settings and of the next ones, as their sum has them. */
static inline uint32_t guard_addresses(const struct translator *t)
{
    return (uint32_t)(uintptr_t)&t->settings + (uint32_t)(uintptr_t)&t->next;
}

/* Copies the settings to the next ones, or back. Returns the sum of all words, those of coils subtracted, and of both
 * addresses: 0 if the words are intact. */
uint32_t guard_copy(struct settings *to, const struct settings *from);

/* Changes a local register, and the guard word by as much: an error before stays visible. */
void guard_set_local(struct settings *settings, uint32_t which, uint32_t value);

/* The same for CONTROL and EEPROM. Their other sign in the sum shows a value that is stored in a local register's place. */
void guard_set_coils(struct settings *settings, uint32_t which, uint32_t value);

/* A check word of the telegram of txn and of the next settings (docs/hardening.md, Telegram made twice). */
uint32_t guard_of(const struct translator *t, const struct transaction *txn);

/* The guard word of the next settings is too small by this key until the commit adds it (docs/hardening.md, Prepared
 * settings). */
#define GUARD_KEY 0x20u

#endif
