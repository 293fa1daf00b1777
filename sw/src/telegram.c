/* SPDX-License-Identifier: Apache-2.0 */
#include "telegram.h"

#include "options.h"

/* Words go out high byte first. Returns the place after the word. */
static uint8_t *put_word(uint8_t *at, uint32_t value)
{
    at[0] = (uint8_t)(value >> 8);
    at[1] = (uint8_t)value;
    return at + 2;
}

static uint8_t *begin(struct transaction *txn)
{
    txn->out.telegram.byte[0] = txn->broadcast ? ADR_BROADCAST : ADR_DRIVE;
    return txn->out.telegram.byte + 1;
}

/* Adds PCD and BCC, which end every telegram (docs/hardening.md, BCC made with the telegram). */
static enum outcome end(struct transaction *txn, uint8_t *at, uint32_t pcd1, uint32_t pcd2)
{
    const uint32_t *from = txn->out.telegram.word;
    uint32_t check = 0;
    uint32_t bcc;

    at = put_word(put_word(at, pcd1), pcd2);
    txn->telegram_length = (uint8_t)(at - txn->out.telegram.byte + 1);
    bcc = (uint32_t)STX ^ txn->telegram_length;
    /* By words, which is faster (PERF-2): the last one ends with zeros. */
    at[0] = 0;
    at[1] = 0;
    at[2] = 0;
    do { /* at most 8 turns: TELEGRAM_WORDS */
        bcc ^= *from;
        check += check + bcc;
        from++;
        __asm__("" : "+r"(from)); /* or the compiler computes its last value anew */
    } while ((const uint8_t *)from < at);
    bcc ^= bcc >> 16;
    *at = (uint8_t)(bcc ^ bcc >> 8);
    /* The last word once more, with BCC: a BCC at another place leaves the sum of all bytes as it is. For the shift see
     * guard_of(). */
    txn->check = check + (from[-1] >> 3);
    return OUTCOME_EXCHANGE;
}

/* Offsets in a telegram with a parameter field, and bytes of PWE. */
enum { AT_PKE = 1, AT_IND = 3, AT_VALUE = 5, PWE_BYTES = 4 };

enum outcome telegram_process(struct transaction *txn, uint32_t control)
{
    txn->expects = EXPECT_PROCESS;
    return end(txn, begin(txn), control, control >> 16);
}

enum outcome telegram_parameter(struct transaction *txn, uint32_t ak, uint32_t zeros, uint32_t ind,
                                uint32_t bytes, frame_byte *data)
{
    uint8_t *at = begin(txn);
    uint8_t *to;

    at = put_word(put_word(at, ak << 12 | txn->pnu), ind);
    at[0] = 0;
    at[1] = 0;
    at[2] = 0;
    at[3] = 0;
    at += zeros;
    /* Four bytes a step (PERF-2). Up to two bytes after the data come along; PCD takes their place. */
    to = at + bytes;
    if (at != to)
        do { /* at most 5 turns: 10 registers of 2 characters, 4 a turn */
            at[0] = data[0].byte;
            at[1] = data[1].byte;
            at[2] = data[2].byte;
            at[3] = data[3].byte;
            at += 4;
            data += 4;
        } while (at < to);
    /* Bit 10 of the control word is 0: the drive ignores the process data (FC-5). */
    return end(txn, to, 0, 0);
}

void telegram_as_text(struct transaction *txn)
{
    const bool read = txn->function == READ_REGISTERS;
    const uint32_t bytes = read ? PWE_BYTES : (uint32_t)txn->operand << 1;
    uint8_t *at = txn->out.telegram.byte + AT_VALUE;
    uint32_t i;

    txn->expects = EXPECT_TEXT;
    txn->out.telegram.byte[AT_PKE] |= AK_TEXT << 4;
    txn->out.telegram.byte[AT_IND] = (read ? IND_TEXT_READ : IND_TEXT_WRITE) >> 8;
    /* A text has no leading zeros. */
    for (i = PWE_BYTES - bytes; i < PWE_BYTES; i++) /* at most 4 turns: PWE */
        *at++ = txn->out.telegram.byte[AT_VALUE + i];
    end(txn, at, 0, 0);
}
