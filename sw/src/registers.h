/* SPDX-License-Identifier: Apache-2.0 */
/* Holding registers (MAP-5...MAP-8): handlers of functions 03, 06 and 10. */
#ifndef REGISTERS_H
#define REGISTERS_H

#include "codes.h"

handler registers_read, registers_write;

/* Decides what a parameter at txn->address is: a number or a text. Returns the largest quantity (EXC 3). */
uint32_t registers_limit(const struct translator *t, struct transaction *txn);

/* The reply to 03 after the drive sent a number: the two words of PWE. */
uint32_t registers_answer_number(struct transaction *txn, uint16_t high, uint16_t low);

/* The reply to 03 after the drive sent a text, padded with spaces. */
uint32_t registers_answer_text(struct transaction *txn, frame_byte *text, uint32_t characters);

#endif
