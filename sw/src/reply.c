/* SPDX-License-Identifier: Apache-2.0 */
#include "reply.h"

#include "dialect.h"

enum outcome reply_exception(struct transaction *txn, uint32_t code)
{
    txn->out.reply[0] = txn->function | 0x80u;
    txn->out.reply[1] = (uint8_t)code;
    txn->reply_length = 2;
    return OUTCOME_REPLY;
}

enum outcome reply_fault(struct transaction *txn, uint32_t fault)
{
    return reply_exception(txn, TRAITS.drive_fault ? TRAITS.drive_fault : fault);
}

enum outcome reply_confirm(struct transaction *txn)
{
    txn->out.reply[0] = txn->function;
    txn->out.reply[1] = (uint8_t)(txn->address >> 8);
    txn->out.reply[2] = (uint8_t)txn->address;
    txn->out.reply[3] = (uint8_t)(txn->operand >> 8);
    txn->out.reply[4] = (uint8_t)txn->operand;
    txn->reply_length = 5;
    return OUTCOME_REPLY;
}
