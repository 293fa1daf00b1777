/* SPDX-License-Identifier: Apache-2.0 */
/* Coil numbers in this file are on-wire: coil 1 is 0. */
#include "coils.h"

#include "dialect.h"
#include "telegram.h"

enum { CONTROL_COILS = 32, STATUS_COILS_END = 64, COIL_EEPROM = 64, COILS = 128 };

uint32_t coils_answer(const struct translator *t, struct transaction *txn, uint32_t status)
{
    /* The fifth word serves a byte that starts in the last of the four. */
    const uint32_t image[] = {t->settings.word[CONTROL], status, t->settings.word[EEPROM], 0, 0};
    const uint32_t bytes = (txn->operand + 7u) >> 3;
    uint32_t coil = txn->address;
    uint32_t i;

    txn->out.reply[0] = txn->function;
    txn->out.reply[1] = (uint8_t)bytes;
    for (i = 0; i < bytes; i++, coil += 8) { /* at most 16 turns: 128 coils, 8 in each byte */
        const uint32_t *word = &image[coil >> 5];
        const uint32_t shift = coil & 31u;
        uint32_t bits = word[0] >> shift;

        if (shift > 24)
            bits |= word[1] << (32 - shift);
        txn->out.reply[2 + i] = (uint8_t)bits;
    }
    txn->out.reply[1 + bytes] &= (uint8_t)(0xFFu >> (-(uint32_t)txn->operand & 7u));
    txn->reply_length = (uint8_t)(2 + bytes);
    return OUTCOME_REPLY;
}

uint32_t coils_read(struct translator *t, struct transaction *txn, frame_byte *data)
{
    const uint32_t end = (uint32_t)txn->address + txn->operand;

    (void)data;
    if (end > COILS)
        return EXCEPTION + TRAITS.bad_address;
#if STATUS_REFRESH
    if (txn->address < STATUS_COILS_END && end > CONTROL_COILS)
        return telegram_process(txn, 0, TARGET_READING);
#endif
    return coils_answer(t, txn, t->status);
}

/* Writable are runs within coils 1-32, and coil 65 alone (MAP-2). The lowest bit of the data is the first coil. */
uint32_t coils_write(struct translator *t, struct transaction *txn, frame_byte *data)
{
    const bool single = txn->function == WRITE_COIL;
    const uint32_t quantity = single ? 1 : txn->operand;
    const bool eeprom = txn->address == COIL_EEPROM && quantity == 1;
    uint32_t bits = 0;
    uint32_t mask;
    uint32_t shift;

    if (txn->address + quantity > CONTROL_COILS && !eeprom)
        return EXCEPTION + TRAITS.bad_address;
    if (single && txn->operand != 0 && txn->operand != 0xFF00)
        return EXCEPTION + TRAITS.bad_value;
    for (shift = 0; shift < quantity; shift += 8) /* at most 4 turns: 32 coils, 8 in each byte */
        bits |= (uint32_t)data++->byte << shift;
    if (eeprom) {
        t->next.word[EEPROM] = bits & 1u;
        return confirm(txn);
    }
    /* NOLINTNEXTLINE(clang-analyzer-core.UndefinedBinaryOperatorResult): decode() admits 1 to 32 (EXC 3) */
    mask = UINT32_MAX >> (CONTROL_COILS - quantity) << txn->address;
    bits = (t->next.word[CONTROL] & ~mask) | (bits << txn->address & mask);
    t->next.word[CONTROL] = bits;
    return telegram_process(txn, bits, TARGET_IMAGE);
}
