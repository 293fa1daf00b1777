/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Register numbers in this file are on-wire: 40001 is 0. The first registers are the card's own (local) ones.
 * Parameter PNU starts at register 10 x PNU.
 */
#include "registers.h"

#include "dialect.h"
#include "telegram.h"

enum { LIMIT_NUMBER = 2, LIMIT_TEXT = 10 };

static bool is_local(const struct transaction *txn)
{
    return txn->address < LOCAL_REGISTERS || txn->address == TRAITS.index_register;
}

/* The index in settings.word of a run of local registers; LOCAL_REGISTERS if one of the run does not exist. */
static uint32_t find_local(const struct transaction *txn, uint32_t quantity)
{
    if (TRAITS.index_register != LOCAL_IND) {
        if (txn->address == TRAITS.index_register && quantity == 1)
            return LOCAL_IND;
        if (txn->address == LOCAL_IND)
            return LOCAL_REGISTERS;
    }
    return txn->address + quantity <= LOCAL_REGISTERS ? txn->address : LOCAL_REGISTERS;
}

static bool is_text(const struct translator *t, const struct transaction *txn)
{
    const uint32_t mode = t->settings.word[LOCAL_IND] & IND_TEXT;

    if (TRAITS.text_by_size)
        return txn->function != WRITE_REGISTER && txn->operand > LIMIT_NUMBER;
    return (txn->function == READ_REGISTERS && mode == IND_TEXT_READ) ||
           (txn->function == WRITE_REGISTERS && mode == IND_TEXT_WRITE);
}

uint32_t registers_limit(const struct translator *t, struct transaction *txn)
{
    txn->expects = EXPECT_NUMBER;
    if (is_local(txn))
        return LOCAL_REGISTERS;
    if (!is_text(t, txn))
        return LIMIT_NUMBER;
    txn->expects = EXPECT_TEXT;
    return LIMIT_TEXT;
}

/* Finds the parameter that starts at the address (MAP-6). The CPU cannot divide: n/10 is computed as 0.8n/8. */
static bool find_parameter(struct transaction *txn)
{
    const uint32_t n = txn->address + 1u;
    uint32_t tenth = (n >> 1) + (n >> 2);
    uint32_t rest;

    tenth += tenth >> 4;
    tenth += tenth >> 8;
    tenth >>= 3; /* n/10, or 1 less */
    rest = n - (tenth << 3) - (tenth << 1);
    if (rest == 10) {
        tenth++;
        rest = 0;
    }
    txn->pnu = (uint16_t)tenth;
    return rest == 0 && tenth <= TRAITS.pnu_max; /* n is not 0, so tenth is not */
}

/* Function code, byte count and length of a reply to 03. Returns the first register. */
ONE_COPY static uint8_t *begin_answer(struct transaction *txn)
{
    const uint32_t bytes = (uint32_t)txn->operand << 1;

    txn->out.reply[0] = txn->function;
    txn->out.reply[1] = (uint8_t)bytes;
    txn->reply_length = (uint8_t)(2 + bytes);
    return txn->out.reply + 2;
}

uint32_t registers_answer_number(struct transaction *txn, uint16_t high, uint16_t low)
{
    uint8_t *at = begin_answer(txn);
    uint32_t i;

    if (txn->operand != 1) {
        put_word(at, high);
        at += 2;
    } else if (high != 0 && !(high == 0xFFFF && low >= 0x8000)) {
        return EXCEPTION + drive_fault(FAULT_TYPE); /* a value is never truncated (MAP-7) */
    }
    put_word(at, low);
    for (i = 2; i < txn->operand; i++) /* at most 8 turns: asked for as a text (MAP-8) */
        put_word(at += 2, 0);
    return OUTCOME_REPLY;
}

uint32_t registers_answer_text(struct transaction *txn, frame_byte *text, uint32_t characters)
{
    uint8_t *at = begin_answer(txn);
    uint32_t i;

    for (i = 0; i < txn->out.reply[1]; i++) /* at most 20 turns: 10 registers of 2 characters */
        at[i] = i < characters ? text[i].byte : ' ';
    return OUTCOME_REPLY;
}

static uint32_t read_local(const struct translator *t, struct transaction *txn)
{
    uint32_t i = find_local(txn, txn->operand);
    const uint32_t end = i + txn->operand;
    uint8_t *at = begin_answer(txn);

    if (i == LOCAL_REGISTERS)
        return EXCEPTION + TRAITS.bad_address;
    for (; i < end; i++, at += 2) /* at most 3 turns: LOCAL_REGISTERS */
        put_word(at, t->settings.word[i]);
    return OUTCOME_REPLY;
}

uint32_t registers_read(struct translator *t, struct transaction *txn, frame_byte *data)
{
    if (is_local(txn))
        return read_local(t, txn);
    if (!find_parameter(txn))
        return EXCEPTION + TRAITS.bad_address;
    return telegram_parameter(txn, AK_READ, t->settings.word[LOCAL_IND] & IND_INDEX, 0, data);
}

static uint32_t write_local(struct translator *t, struct transaction *txn, frame_byte *data, uint32_t quantity)
{
    uint32_t i = find_local(txn, quantity);
    const uint32_t end = i + quantity;

    if (i == LOCAL_REGISTERS)
        return EXCEPTION + TRAITS.bad_address;
    /* The drive time-out, never 0, is the last local register, so it ends the run. */
    if (end == LOCAL_REGISTERS && word_at(data + (quantity << 1) - 2) == 0)
        return EXCEPTION + TRAITS.bad_value;
    for (; i < end; i++, data += 2) /* at most 3 turns: LOCAL_REGISTERS */
        t->next.word[i] = word_at(data);
    return confirm(txn);
}

uint32_t registers_write(struct translator *t, struct transaction *txn, frame_byte *data)
{
    const uint32_t quantity = txn->function == WRITE_REGISTER ? 1 : txn->operand;
    uint32_t ak = quantity == 1 ? AK_WRITE_WORD : AK_WRITE_DOUBLE;

    if (is_local(txn))
        return write_local(t, txn, data, quantity);
    if (!find_parameter(txn))
        return EXCEPTION + TRAITS.bad_address;
    if (t->settings.word[EEPROM] != 0)
        ak = AK_STORE - ak; /* 14 for a word, 13 for a double word */
    return telegram_parameter(txn, ak, t->settings.word[LOCAL_IND] & IND_INDEX, quantity << 1, data);
}
