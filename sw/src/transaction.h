/* SPDX-License-Identifier: Apache-2.0 */
/* What the files of the translation core share: exceptions, simple replies, telegrams, the two maps. */
#ifndef TRANSACTION_H
#define TRANSACTION_H

#include "dialect.h"
#include "translate.h"

/* The one fault of the drive (AK 7) with a meaning for the card: the data type does not match. */
enum { FAULT_TYPE = 5 };

enum function_code {
    READ_COILS = 0x01,
    READ_REGISTERS = 0x03,
    WRITE_COIL = 0x05,
    WRITE_REGISTER = 0x06,
    WRITE_COILS = 0x0F,
    WRITE_REGISTERS = 0x10,
};

/* The three telegrams (FC-3), and so what their replies must look like. */
enum expectation { EXPECT_PROCESS, EXPECT_NUMBER, EXPECT_TEXT };

/* AK, both ways (FC-4). */
enum {
    AK_READ = 1,
    AK_WRITE_WORD = 2,
    AK_WRITE_DOUBLE = 3,
    AK_STORE_DOUBLE = 13,
    AK_STORE_WORD = 14,
    AK_TEXT = 15,
    AK_IS_WORD = 1,
    AK_IS_DOUBLE = 2,
    AK_REFUSED = 7,
};

/* IND: the high byte says text, the low byte is the index (MAP-8). */
enum { IND_TEXT_READ = 0x0400, IND_TEXT_WRITE = 0x0500, IND_TEXT = 0xFF00, IND_INDEX = 0x00FF };

/* FC-1. */
enum { STX = 0x02 };
enum { LGE_PROCESS = 0x06, LGE_PARAMETER = 0x0E, LGE_TEXT = 10 };

static inline uint16_t word_at(frame_byte *bytes)
{
    return (uint16_t)(bytes[0].byte << 8 | bytes[1].byte);
}

/* A function's handler: data is what follows address and quantity in the PDU. */
typedef enum outcome handler(const struct translator *t, struct transaction *txn, frame_byte *data);

handler coils_read, coil_write, coils_write;
handler registers_read, register_write, registers_write;

/* The largest quantity at txn->address (EXC 3). */
uint32_t registers_limit(const struct translator *t, const struct transaction *txn);

/* The replies once the drive has answered. */
enum outcome coils_answer(const struct translator *t, struct transaction *txn, uint32_t status);
enum outcome registers_answer_number(struct transaction *txn, uint16_t high, uint16_t low);
enum outcome registers_answer_text(struct transaction *txn, frame_byte *text, uint32_t characters);

enum outcome refuse(struct transaction *txn, uint32_t code);
/* As the drive does, or in its name. */
enum outcome refuse_fault(struct transaction *txn, uint32_t fault);
/* 05 and 06 echo the request, 0F and 10 its address and quantity: the same five bytes. */
enum outcome confirm(struct transaction *txn);

enum outcome telegram_process(struct transaction *txn, uint32_t control);
/* Between IND and PCD: PWE or text, as so many zeros and then bytes of the request's data. */
enum outcome telegram_parameter(struct transaction *txn, uint32_t ak, uint32_t ind, uint32_t zeros,
                                frame_byte *data, uint32_t bytes);
/* Turns the telegram of a number into that of a text with the same content. */
void telegram_as_text(struct transaction *txn);

#endif
