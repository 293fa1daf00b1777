/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Register numbers in this file are on-wire: 40001 is 0. The first registers are the card's own (local) ones.
 * Parameter PNU starts at register 10 x PNU.
 */
#include "registers.h"

#include "dialect.h"
#include "guard.h"
#include "reply.h"
#include "telegram.h"

enum { LIMIT_NUMBER = 2, LIMIT_TEXT = 10, PWE_BYTES = 4 };

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
    /* The telegram's kind follows from this, too. Never that of an older request (SAFE-4). */
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

/* Puts a register at offset `at` of the reply; returns the offset after it. */
static uint32_t put_register(struct transaction *txn, uint32_t at, uint32_t value)
{
    txn->out.reply[at] = (uint8_t)(value >> 8);
    txn->out.reply[at + 1] = (uint8_t)value;
    return at + 2;
}

/* Function code, byte count and length of a reply to 03. */
static void begin_answer(struct transaction *txn)
{
    const uint32_t bytes = (uint32_t)txn->operand << 1;

    txn->out.reply[0] = txn->function;
    txn->out.reply[1] = (uint8_t)bytes;
    txn->reply_length = (uint8_t)(2 + bytes);
}

enum outcome registers_answer_number(struct transaction *txn, uint16_t high, uint16_t low)
{
    uint32_t at = 2;

    if (txn->operand == 2)
        at = put_register(txn, at, high);
    else if (high != 0 && !(high == 0xFFFF && low >= 0x8000))
        return reply_fault(txn, FAULT_TYPE); /* a value is never truncated (MAP-7) */
    put_register(txn, at, low);
    begin_answer(txn);
    return OUTCOME_REPLY;
}

enum outcome registers_answer_text(struct transaction *txn, frame_byte *text, uint32_t characters)
{
    uint32_t i;

    begin_answer(txn);
    for (i = 0; i < txn->out.reply[1]; i++) /* at most 20 turns: 10 registers of 2 characters */
        txn->out.reply[2 + i] = i < characters ? text[i].byte : ' ';
    return OUTCOME_REPLY;
}

static enum outcome read_local(const struct translator *t, struct transaction *txn)
{
    uint32_t i = find_local(txn, txn->operand);
    const uint32_t end = i + txn->operand;
    uint32_t at = 2;

    if (i == LOCAL_REGISTERS)
        return reply_exception(txn, TRAITS.bad_address);
    for (; i < end; i++) /* at most 3 turns: LOCAL_REGISTERS */
        at = put_register(txn, at, t->settings.word[i]);
    begin_answer(txn);
    return OUTCOME_REPLY;
}

enum outcome registers_read(struct translator *t, struct transaction *txn, frame_byte *data)
{
    uint32_t ind = t->settings.word[LOCAL_IND] & IND_INDEX;
    uint32_t ak = AK_READ;

    if (is_local(txn))
        return read_local(t, txn);
    if (!find_parameter(txn))
        return reply_exception(txn, TRAITS.bad_address);
    if (txn->expects == EXPECT_TEXT) {
        ak = AK_TEXT;
        ind |= IND_TEXT_READ;
    }
    return telegram_parameter(txn, ak, PWE_BYTES, ind, 0, data);
}

static enum outcome write_local(struct translator *t, struct transaction *txn, frame_byte *data, uint32_t quantity)
{
    uint32_t i = find_local(txn, quantity);
    const uint32_t end = i + quantity;

    if (i == LOCAL_REGISTERS)
        return reply_exception(txn, TRAITS.bad_address);
    /* The drive time-out, never 0, is the last local register, so it ends the run. */
    if (end == LOCAL_REGISTERS && word_at(data + (quantity << 1) - 2) == 0)
        return reply_exception(txn, TRAITS.bad_value);
    for (; i < end; i++, data += 2) /* at most 3 turns: LOCAL_REGISTERS */
        guard_set_local(&t->next, i, word_at(data));
    return reply_confirm(txn);
}

/* Writes `quantity` registers from data, to the card or to a parameter. */
static enum outcome write_run(struct translator *t, struct transaction *txn, frame_byte *data,
                              uint32_t quantity)
{
    const uint32_t index = t->settings.word[LOCAL_IND] & IND_INDEX;
    const bool store = t->settings.word[EEPROM] != 0;
    const uint32_t bytes = quantity << 1;
    uint32_t ak;

    if (is_local(txn))
        return write_local(t, txn, data, quantity);
    if (!find_parameter(txn))
        return reply_exception(txn, TRAITS.bad_address);
    if (txn->expects == EXPECT_TEXT)
        return telegram_parameter(txn, AK_TEXT, 0, IND_TEXT_WRITE | index, bytes, data);
    if (quantity == 1)
        ak = store ? AK_STORE_WORD : AK_WRITE_WORD;
    else
        ak = store ? AK_STORE_DOUBLE : AK_WRITE_DOUBLE;
    return telegram_parameter(txn, ak, PWE_BYTES - bytes, index, bytes, data);
}

enum outcome register_write(struct translator *t, struct transaction *txn, frame_byte *data)
{
    return write_run(t, txn, data, 1);
}

enum outcome registers_write(struct translator *t, struct transaction *txn, frame_byte *data)
{
    return write_run(t, txn, data, txn->operand);
}
