/* SPDX-License-Identifier: Apache-2.0 */
#include "guard.h"

uint32_t guard_copy(struct settings *to, const struct settings *from)
{
    uint32_t sum = 0;
    uint32_t i;

    /* Without the loop the copy takes half as long (PERF-2). */
#pragma GCC unroll 6
    for (i = 0; i < SETTINGS; i++) /* at most 6 turns: SETTINGS */
        if (i == CONTROL || i == EEPROM)
            sum -= to->word[i] = from->word[i];
        else
            sum += to->word[i] = from->word[i];
    /* The addresses last: a flip of their registers during the copy shows, too (SAFE-4). */
    __asm__("" : "+r"(from), "+r"(to), "+r"(sum));
    return sum + (uint32_t)(uintptr_t)from + (uint32_t)(uintptr_t)to;
}

void guard_set_local(struct settings *settings, uint32_t which, uint32_t value)
{
    uint32_t *word = &settings->word[which];

    settings->word[GUARD] += *word - value;
    *word = value;
}

void guard_set_coils(struct settings *settings, uint32_t which, uint32_t value)
{
    uint32_t *word = &settings->word[which];

    settings->word[GUARD] += value - *word;
    *word = value;
}

/* A control word with one bit flipped changes the guard word from that bit on, and the check of its telegram from the
 * same bit on, or one 16 bits away. The BCC changes by the same bit of its byte, three bits lower in the check
 * (telegram.c). After both shifts the lowest bits differ, so neither a sum nor XOR cancels the difference. */
uint32_t guard_of(const struct translator *t, const struct transaction *txn)
{
    return t->next.word[GUARD] << 2 ^ txn->check;
}
