/* SPDX-License-Identifier: Apache-2.0 */
#include "telegram.h"

#include "options.h"

/* Offsets in a telegram with a parameter field, and bytes of PWE. */
enum { AT_PKE = 1, AT_IND = 3, AT_VALUE = 5, PWE_BYTES = 4 };

ONE_COPY static uint32_t finish(struct transaction *txn, uint32_t pcd_at, uint32_t pcd1, uint32_t pcd2)
{
    uint8_t *telegram = txn->out.telegram;
    const uint8_t *const end = telegram + pcd_at + 4;
    uint32_t bcc = STX ^ (pcd_at + 5);

    telegram[0] = txn->broadcast ? ADR_BROADCAST : ADR_DRIVE;
    put_word(telegram + pcd_at, pcd1);
    put_word(telegram + pcd_at + 2, pcd2);
    for (; telegram != end; telegram++) /* at most 29 turns: TELEGRAM_MAX without BCC */
        bcc ^= *telegram;
    *telegram = (uint8_t)bcc;
    txn->telegram_length = (uint8_t)(pcd_at + 5);
    return OUTCOME_EXCHANGE;
}

uint32_t telegram_process(struct transaction *txn, uint32_t control, enum target target)
{
    txn->expects = EXPECT_PROCESS;
    txn->target = (uint8_t)target;
    return finish(txn, AT_PKE, control, control >> 16);
}

uint32_t telegram_parameter(struct transaction *txn, uint32_t ak, uint32_t index, uint32_t bytes, frame_byte *data)
{
    uint8_t *const telegram = txn->out.telegram;
    const frame_byte *const end = data + bytes;
    uint32_t at = AT_VALUE;
    uint8_t *to;

    txn->target = bytes == 0 ? TARGET_READING : TARGET_PARAMETER;
    if (txn->expects == EXPECT_TEXT) {
        ak = AK_TEXT;
        index |= bytes == 0 ? IND_TEXT_READ : IND_TEXT_WRITE;
    }
    put_word(telegram + AT_PKE, ak << 12 | txn->pnu);
    put_word(telegram + AT_IND, index);
    /* A number ends its four bytes, a text begins them. */
    put_word(telegram + AT_VALUE, 0);
    put_word(telegram + AT_VALUE + 2, 0);
    if (txn->expects == EXPECT_NUMBER)
        at += PWE_BYTES - bytes;
    to = telegram + at;
    for (; data != end; data++) /* at most 20 turns: 10 registers of 2 characters */
        *to++ = data->byte;
    if (bytes == 0)
        to = telegram + AT_VALUE + PWE_BYTES;
    /* Bit 10 of the control word is 0: the drive ignores the process data (FC-5). */
    return finish(txn, (uint32_t)(to - telegram), 0, 0);
}

void telegram_as_other(struct transaction *txn)
{
    const bool read = txn->function == READ_REGISTERS;
    const uint32_t bytes = read ? PWE_BYTES : (uint32_t)txn->operand << 1;
    uint8_t *telegram = txn->out.telegram;
    uint32_t i;

    if (txn->expects == EXPECT_TEXT) {
        txn->expects = EXPECT_NUMBER;
        telegram[AT_PKE] = (uint8_t)((telegram[AT_PKE] & 0x0Fu) | AK_READ << 4);
        telegram[AT_IND] = 0;
    } else {
        txn->expects = EXPECT_TEXT;
        telegram[AT_PKE] |= AK_TEXT << 4;
        telegram[AT_IND] = (read ? IND_TEXT_READ : IND_TEXT_WRITE) >> 8;
    }
    /* A text has no leading zeros. */
    for (i = 0; i < bytes; i++) /* at most 4 turns: PWE */
        telegram[AT_VALUE + i] = telegram[AT_VALUE + PWE_BYTES - bytes + i];
    (void)finish(txn, AT_VALUE + bytes, 0, 0);
}
