/* SPDX-License-Identifier: Apache-2.0 */
/* Codes of both protocols, shared by the files of the translation core. Includes and calls go one way: translate calls
 * coils, registers and diagnostics; translate, coils and registers call telegram. */
#ifndef CODES_H
#define CODES_H

#include "frame.h"
#include "transaction.h"

/* Fault number of the drive (AK 7): the data type does not match. It is the only one that the card interprets. */
enum { FAULT_TYPE = 5 };

enum function_code {
    READ_COILS = 0x01,
    READ_REGISTERS = 0x03,
    WRITE_COIL = 0x05,
    WRITE_REGISTER = 0x06,
    WRITE_COILS = 0x0F,
    WRITE_REGISTERS = 0x10,
    /* With the option DIAGNOSTICS (MAP-10). */
    DIAGNOSTIC = 0x08,
    EVENT_COUNTER = 0x0B,
    SERVER_ID = 0x11,
    ENCAPSULATED = 0x2B,
};

/* Bits of the control word: coils 7 and 11 (SAFE-7). */
enum { CONTROL_START = 1 << 6, CONTROL_VALID = 1 << 10 };

/* Kind of the telegram sent (FC-3), which the reply must match. */
enum expectation { EXPECT_PROCESS, EXPECT_NUMBER, EXPECT_TEXT };

/* AK, of requests and of replies (FC-4). */
enum {
    AK_READ = 1,
    AK_WRITE_WORD = 2,
    AK_WRITE_DOUBLE = 3,
    AK_STORE = 16, /* less the AK of the same write to RAM alone */
    AK_TEXT = 15,
    AK_IS_WORD = 1,
    AK_IS_DOUBLE = 2,
    AK_REFUSED = 7,
};

/* IND: the high byte selects text, the low byte is the index (MAP-8). */
enum { IND_TEXT_READ = 0x0400, IND_TEXT_WRITE = 0x0500, IND_TEXT = 0xFF00, IND_INDEX = 0x00FF };

/* FC-1. LGE_TEXT is the LGE of a text of no characters. */
enum { STX = 0x02 };
enum { LGE_PROCESS = 0x06, LGE_PARAMETER = 0x0E, LGE_TEXT = 10 };

static inline uint16_t word_at(frame_byte *bytes)
{
    return (uint16_t)(bytes[0].byte << 8 | bytes[1].byte);
}

/* Puts a word, high byte first. */
static inline void put_word(uint8_t *at, uint32_t value)
{
    at[0] = (uint8_t)(value >> 8);
    at[1] = (uint8_t)value;
}

/* Handles one function code; returns an outcome, or EXCEPTION + code. The last argument is the PDU after address and
 * quantity, or for the functions of diagnostics the whole PDU. */
typedef uint32_t handler(struct translator *, struct transaction *, frame_byte *);

/* Makes the reply that confirms a write: 05 and 06 echo address and value, 0F and 10 address and quantity. */
uint32_t confirm(struct transaction *txn);

#endif
