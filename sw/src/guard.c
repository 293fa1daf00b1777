/* SPDX-License-Identifier: Apache-2.0 */
#include "guard.h"

#include <limits.h>

uint32_t guard_copy(struct settings *to, const struct settings *from)
{
    uint32_t sum = 0;
    uint32_t i;

    for (i = 0; i < SETTINGS; i++)
        sum += to->word[i] = from->word[i];
    return sum;
}

void guard_seal(struct settings *settings)
{
    settings->word[GUARD] -= guard_copy(settings, settings);
}

/* One flipped bit of the control word changes one bit of the BCC and a run of bits of the guard word. The BCC enters
 * at two places, so XOR cannot cancel the difference. */
uint32_t guard_of(const struct translator *t, const struct transaction *txn)
{
    const uint32_t bcc = txn->out.telegram[txn->telegram_length - 1];

    return t->next.word[GUARD] ^ bcc ^ bcc << CHAR_BIT;
}

void guard_require_equal(struct settings *settings, uint32_t first, uint32_t second)
{
    settings->word[GUARD] ^= first ^ second;
}
