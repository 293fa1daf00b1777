/* SPDX-License-Identifier: Apache-2.0 */
/* Decodes request PDUs by the table of function codes (EXC 1-3), and evaluates the drive's replies. */
#include "translate.h"

#include "coils.h"
#include "diagnostics.h"
#include "dialect.h"
#include "guard.h"
#include "registers.h"
#include "reply.h"
#include "telegram.h"

enum form {
    FORM_READ,    /* address, quantity */
    FORM_SINGLE,  /* address, value */
    FORM_COUNTED, /* address, quantity, byte count, data */
};

/* Searched from the front: the requests that take longest come first (PERF-2). */
static const struct function {
    uint8_t code;
    uint8_t form;
    uint8_t coils; /* largest quantity of coils; 0: registers (registers_limit) */
    handler *handle;
} functions[] = {
    {WRITE_REGISTERS, FORM_COUNTED, 0, registers_write},
    {WRITE_COILS, FORM_COUNTED, 32, coils_write},
    {WRITE_REGISTER, FORM_SINGLE, 0, register_write},
    {WRITE_COIL, FORM_SINGLE, 1, coil_write},
    {READ_REGISTERS, FORM_READ, 0, registers_read},
    {READ_COILS, FORM_READ, 128, coils_read},
};

/* Offsets in a PDU, and the length of a PDU without a byte count. */
enum { AT_ADDRESS = 1, AT_OPERAND = 3, AT_COUNT = 5, AT_DATA = 6, PDU_PLAIN = 5 };

void translate_init(struct translator *t)
{
    t->settings.word[LOCAL_NETWORK_TIMEOUT] = DEFAULT_NETWORK_TIMEOUT;
    t->settings.word[LOCAL_DRIVE_TIMEOUT] = DEFAULT_DRIVE_TIMEOUT;
    t->settings.word[GUARD] = 0u - DEFAULT_NETWORK_TIMEOUT - DEFAULT_DRIVE_TIMEOUT - guard_addresses(t);
}

bool translate_copy_settings(struct translator *t)
{
    const uint32_t sum = guard_copy(&t->next, &t->settings);

    t->next.word[GUARD] -= GUARD_KEY;
    return sum == 0;
}

static const struct function *find_function(uint32_t code)
{
    const struct function *function;

    /* at most 6 turns: the table of functions */
    for (function = functions; function < functions + sizeof functions / sizeof *functions; function++)
        if (function->code == code)
            return function;
    return 0;
}

/* Checks quantity and byte count (EXC 3). */
static bool quantity_fits(const struct translator *t, struct transaction *txn,
                          const struct function *function, frame_byte *pdu)
{
    const bool coils = function->coils != 0;
    const uint32_t limit = coils ? function->coils : registers_limit(t, txn);
    const uint32_t bytes = coils ? (txn->operand + 7u) >> 3 : (uint32_t)txn->operand << 1;

    if (function->form == FORM_SINGLE)
        return true;
    if (txn->operand == 0 || txn->operand > limit)
        return false;
    return function->form != FORM_COUNTED || pdu[AT_COUNT].byte == bytes;
}

static enum outcome decode(struct translator *t, struct transaction *txn, frame_byte *pdu,
                           uint32_t pdu_length)
{
    const struct function *function = find_function(txn->function);
    uint32_t expected = PDU_PLAIN;

    if (!function)
        return DIAGNOSTICS ? diagnostics_serve(txn, pdu, pdu_length) : reply_exception(txn, TRAITS.bad_function);
    if (txn->broadcast && function->form == FORM_READ)
        return OUTCOME_SILENT;
    /* Too short for a byte count is too short for any value that is read in its place. */
    if (function->form == FORM_COUNTED)
        expected = AT_DATA + pdu[AT_COUNT].byte;
    if (pdu_length != expected)
        return reply_exception(txn, TRAITS.bad_length);
    txn->address = word_at(pdu + AT_ADDRESS);
    txn->operand = word_at(pdu + AT_OPERAND);
    if (!quantity_fits(t, txn, function, pdu))
        return reply_exception(txn, TRAITS.bad_quantity);
    return function->handle(t, txn, pdu + (function->form == FORM_SINGLE ? AT_OPERAND : AT_DATA));
}

enum outcome translate_request(struct translator *t, struct transaction *txn, frame_byte *pdu,
                               uint32_t pdu_length, bool broadcast)
{
    enum outcome outcome;

    txn->function = pdu->byte;
    txn->broadcast = broadcast;
    if (DIAGNOSTICS)
        txn->reply_length = 0; /* without a reply there is none to count (MAP-10) */
    outcome = decode(t, txn, pdu, pdu_length);
    /* A broadcast is never answered (MAP-9). */
    return broadcast && outcome == OUTCOME_REPLY ? OUTCOME_SILENT : outcome;
}

void translate_commit(struct translator *t, uint32_t guard)
{
    t->next.word[GUARD] = guard;
    __asm__("" ::: "memory"); /* or the compiler mixes this with the copy (SAFE-4) */
    if (guard_copy(&t->settings, &t->next) != 0)
        t->settings.word[GUARD] = NEVER_INTACT;
}

/* The PCD at the end of the data: STW, and MAV in the high half. */
static uint32_t status_of(frame_byte *data, uint32_t length)
{
    uint8_t pcd[4];
    uint32_t i;

    for (i = 0; i < 4; i++) { /* at most 4 turns: PCD */
        const uint32_t at = length - 4 + i;

        pcd[i] = data[at < 24 ? at : 24 + (at & 3u)].byte;
    }
    return (uint32_t)pcd[2] << 24 | (uint32_t)pcd[3] << 16 | (uint32_t)pcd[0] << 8 | pcd[1];
}

static enum outcome answer_process(const struct translator *t, struct transaction *txn, uint32_t lge)
{
    if (lge != LGE_PROCESS)
        return OUTCOME_NOT_A_REPLY;
    return STATUS_REFRESH && txn->function == READ_COILS ? coils_answer(t, txn, t->next_status) : reply_confirm(txn);
}

/* The parameter may be a text although a number was asked for. 06 never writes text. */
static bool may_be_text(const struct transaction *txn, uint32_t fault)
{
    return fault == FAULT_TYPE && txn->expects == EXPECT_NUMBER && txn->function != WRITE_REGISTER;
}

static enum outcome answer_parameter(struct transaction *txn, frame_byte *data, uint32_t lge)
{
    const uint32_t ak = (uint32_t)data->byte >> 4;
    const bool read = txn->function == READ_REGISTERS;

    /* FC-8. All 12 bits below AK count: bit 11 must be 0 in dialects with a PNU of 11 bits (FC-3). */
    if (lge < LGE_TEXT || (word_at(data) & 0x0FFF) != txn->pnu)
        return OUTCOME_NOT_A_REPLY;
    if (txn->expects == EXPECT_TEXT && ak == AK_TEXT)
        return read ? registers_answer_text(txn, data + 4, lge - LGE_TEXT) : reply_confirm(txn);
    if (lge != LGE_PARAMETER)
        return OUTCOME_NOT_A_REPLY;
    if (ak == AK_REFUSED)
        return TRAITS.text_by_size && may_be_text(txn, data[7].byte) ? OUTCOME_EXCHANGE
                                                                     : reply_fault(txn, data[7].byte);
    if (txn->expects != EXPECT_NUMBER || (ak != AK_IS_WORD && ak != AK_IS_DOUBLE))
        return OUTCOME_NOT_A_REPLY;
    return read ? registers_answer_number(txn, word_at(data + 4), word_at(data + 6)) : reply_confirm(txn);
}

enum outcome translate_drive_reply(struct translator *t, struct transaction *txn, frame_byte *data,
                                   uint32_t lge)
{
    t->next_status = status_of(data, lge - 2);
    if (txn->expects == EXPECT_PROCESS)
        return answer_process(t, txn, lge);
    return answer_parameter(txn, data, lge);
}

void translate_drive_commit(struct translator *t)
{
    t->status = t->next_status;
}

void translate_drive_again(struct transaction *txn)
{
    telegram_as_text(txn);
}

enum outcome translate_drive_silent(struct transaction *txn)
{
    return TRAITS.drive_silent ? reply_exception(txn, TRAITS.drive_silent) : OUTCOME_SILENT;
}

bool translate_is_running(const struct translator *t)
{
    return (t->settings.word[CONTROL] & CONTROL_START) != 0;
}

bool translate_stop(struct translator *t, struct transaction *txn)
{
    const uint32_t control = (t->settings.word[CONTROL] & ~(uint32_t)CONTROL_START) | CONTROL_VALID;

    if (!translate_copy_settings(t))
        return false; /* (docs/hardening.md, Guarded settings) */
    guard_set_coils(&t->next, CONTROL, control);
    txn->function = WRITE_COIL;
    txn->broadcast = false;
    telegram_process(txn, control);
    return true;
}
