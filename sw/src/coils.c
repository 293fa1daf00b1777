/* SPDX-License-Identifier: Apache-2.0 */
/* Coil numbers in this file are on-wire: coil 1 is 0. */
#include "coils.h"

#include "dialect.h"
#include "guard.h"
#include "reply.h"
#include "telegram.h"

enum { CONTROL_COILS = 32, STATUS_COILS_END = 64, COIL_EEPROM = 64, COILS = 128 };

enum outcome coils_answer(const struct translator *t, struct transaction *txn, uint32_t status)
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
    if (txn->operand & 7u)
        txn->out.reply[1 + bytes] &= (uint8_t)((1u << (txn->operand & 7u)) - 1u);
    txn->reply_length = (uint8_t)(2 + bytes);
    return OUTCOME_REPLY;
}

enum outcome coils_read(struct translator *t, struct transaction *txn, frame_byte *data)
{
    const uint32_t end = (uint32_t)txn->address + txn->operand;

    (void)data;
    if (end > COILS)
        return reply_exception(txn, TRAITS.bad_address);
#if STATUS_REFRESH
    if (txn->address < STATUS_COILS_END && end > CONTROL_COILS)
        return telegram_process(txn, 0);
#endif
    return coils_answer(t, txn, t->status);
}

/* Writable are runs within coils 1-32, and coil 65 alone (MAP-2). */
static bool writable(const struct transaction *txn, uint32_t quantity)
{
    return txn->address + quantity <= CONTROL_COILS || (txn->address == COIL_EEPROM && quantity == 1);
}

/* Writes `quantity` coils, the lowest bit first, into the settings that the commit brings. */
static enum outcome write_run(struct translator *t, struct transaction *txn, uint32_t quantity, uint32_t bits)
{
    uint32_t control = t->next.word[CONTROL];
    uint32_t mask;

    if (txn->address == COIL_EEPROM) {
        guard_set_coils(&t->next, EEPROM, bits & 1u);
        return reply_confirm(txn);
    }
    /* NOLINTNEXTLINE(clang-analyzer-core.UndefinedBinaryOperatorResult): decode() admits 1 to 32 (EXC 3) */
    mask = UINT32_MAX >> (CONTROL_COILS - quantity) << txn->address;
    control = (control & ~mask) | (bits << txn->address & mask);
    guard_set_coils(&t->next, CONTROL, control);
    return telegram_process(txn, control);
}

enum outcome coil_write(struct translator *t, struct transaction *txn, frame_byte *data)
{
    (void)data;
    if (!writable(txn, 1))
        return reply_exception(txn, TRAITS.bad_address);
    if (txn->operand != 0 && txn->operand != 0xFF00)
        return reply_exception(txn, TRAITS.bad_value);
    return write_run(t, txn, 1, txn->operand != 0);
}

enum outcome coils_write(struct translator *t, struct transaction *txn, frame_byte *data)
{
    uint32_t bits = 0;
    uint32_t shift;

    if (!writable(txn, txn->operand))
        return reply_exception(txn, TRAITS.bad_address);
    for (shift = 0; shift < txn->operand; shift += 8) /* at most 4 turns: 32 coils, 8 in each byte */
        bits |= (uint32_t)data++->byte << shift;
    return write_run(t, txn, txn->operand, bits);
}
