/* SPDX-License-Identifier: Apache-2.0 */
/* Decodes request PDUs by the table of function codes (EXC 1-3), and evaluates the drive's replies. */
#include "translate.h"

#include "coils.h"
#include "diagnostics.h"
#include "dialect.h"
#include "registers.h"
#include "telegram.h"

enum form {
    FORM_READ,    /* address, quantity */
    FORM_SINGLE,  /* address, value */
    FORM_COUNTED, /* address, quantity, byte count, data */
    FORM_OWN,     /* the handler checks the length */
};

static const struct function {
    uint8_t code;
    uint8_t form;
    uint8_t coils; /* largest quantity of coils; 0: registers (registers_limit) */
    handler *handle;
} functions[] = {
    {READ_COILS, FORM_READ, 128, coils_read},
    {READ_REGISTERS, FORM_READ, 0, registers_read},
    {WRITE_COIL, FORM_SINGLE, 1, coils_write},
    {WRITE_REGISTER, FORM_SINGLE, 0, registers_write},
    {WRITE_COILS, FORM_COUNTED, 32, coils_write},
    {WRITE_REGISTERS, FORM_COUNTED, 0, registers_write},
#if DIAGNOSTICS
    {DIAGNOSTIC, FORM_OWN, 0, diagnose},
    {EVENT_COUNTER, FORM_OWN, 0, report_events},
    {SERVER_ID, FORM_OWN, 0, report_server},
    {ENCAPSULATED, FORM_OWN, 0, identify},
#endif
};

/* Offsets in a PDU, and the length of a PDU without a byte count. */
enum { AT_ADDRESS = 1, AT_OPERAND = 3, AT_COUNT = 5, AT_DATA = 6, PDU_PLAIN = 5 };

void translate_init(struct translator *t)
{
    t->settings.word[LOCAL_NETWORK_TIMEOUT] = DEFAULT_NETWORK_TIMEOUT;
    t->settings.word[LOCAL_DRIVE_TIMEOUT] = DEFAULT_DRIVE_TIMEOUT;
}

ONE_COPY static void copy_settings(struct settings *to, const struct settings *from)
{
    uint32_t i;

    for (i = 0; i < SETTINGS; i++) /* at most 5 turns: SETTINGS */
        to->word[i] = from->word[i];
}

static const struct function *find_function(uint32_t code)
{
    const struct function *function;

    /* at most 10 turns: the table of functions */
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

static uint32_t decode(struct translator *t, struct transaction *txn, frame_byte *pdu, uint32_t pdu_length)
{
    const struct function *function = find_function(txn->function);
    uint32_t expected = PDU_PLAIN;

    /* A function code of 80h and above is the echo of an exception, not a request. */
    if (!function)
        return txn->function & 0x80u ? OUTCOME_SILENT : EXCEPTION + TRAITS.bad_function;
    if (txn->broadcast && (function->form == FORM_READ || function->form == FORM_OWN))
        return OUTCOME_SILENT;
    if (function->form == FORM_OWN) {
        txn->operand = (uint16_t)pdu_length;
        return function->handle(t, txn, pdu);
    }
    /* Too short for a byte count is too short for any value that is read in its place. */
    if (function->form == FORM_COUNTED)
        expected = AT_DATA + pdu[AT_COUNT].byte;
    if (pdu_length != expected)
        return EXCEPTION + TRAITS.bad_length;
    txn->address = word_at(pdu + AT_ADDRESS);
    txn->operand = word_at(pdu + AT_OPERAND);
    if (!quantity_fits(t, txn, function, pdu))
        return EXCEPTION + TRAITS.bad_quantity;
    return function->handle(t, txn, pdu + (function->form == FORM_SINGLE ? AT_OPERAND : AT_DATA));
}

/* The one place that makes an exception (EXC); any other outcome passes. */
ONE_COPY static enum outcome outcome_of(struct transaction *txn, uint32_t result)
{
    if (!(result & EXCEPTION))
        return (enum outcome)result;
    txn->out.reply[0] = txn->function | 0x80u;
    txn->out.reply[1] = (uint8_t)result;
    txn->reply_length = 2;
    return OUTCOME_REPLY;
}

enum outcome translate_request(struct translator *t, struct transaction *txn, frame_byte *pdu,
                               uint32_t pdu_length, bool broadcast)
{
    enum outcome outcome;

    copy_settings(&t->next, &t->settings);
    txn->function = pdu->byte;
    txn->broadcast = broadcast;
    txn->target = TARGET_READING;
    txn->telegram_length = 0;
    txn->again = false;
    txn->reply_length = 0;
    outcome = outcome_of(txn, decode(t, txn, pdu, pdu_length));
    /* A broadcast is never answered (MAP-9). */
    return broadcast && outcome == OUTCOME_REPLY ? OUTCOME_SILENT : outcome;
}

void translate_commit(struct translator *t)
{
    copy_settings(&t->settings, &t->next);
}

/* The PCD at the end of the data: STW, and MAV in the high half. */
static uint32_t status_of(frame_byte *data, uint32_t length)
{
    uint32_t pcd = 0;
    uint32_t at;

    for (at = length - 4; at != length; at++) /* at most 4 turns: PCD */
        pcd = pcd << 8 | data[at < 24 ? at : 24 + (at & 3u)].byte;
    return pcd << 16 | pcd >> 16;
}

/* Confirms a write: 05 and 06 echo address and value, 0F and 10 address and quantity. */
ONE_COPY uint32_t confirm(struct transaction *txn)
{
    txn->out.reply[0] = txn->function;
    put_word(txn->out.reply + 1, txn->address);
    put_word(txn->out.reply + 3, txn->operand);
    txn->reply_length = 5;
    return OUTCOME_REPLY;
}

static uint32_t answer_process(const struct translator *t, struct transaction *txn, uint32_t lge)
{
    if (lge != LGE_PROCESS)
        return OUTCOME_NOT_A_REPLY;
    return STATUS_REFRESH && txn->target == TARGET_READING ? coils_answer(t, txn, t->next_status) : confirm(txn);
}

/* What the drive refuses by type may be there as the other kind: a number of 1 or 2 registers as a text, a text of 3 to
 * 10 registers as a number (MAP-8). 06 never writes text, and only a reading falls back to the number. */
static bool may_be_other(const struct transaction *txn, uint32_t fault)
{
    if (fault != FAULT_TYPE || txn->again)
        return false;
    return txn->expects == EXPECT_NUMBER ? txn->function != WRITE_REGISTER : txn->function == READ_REGISTERS;
}

static uint32_t refused(const struct transaction *txn, uint32_t fault)
{
    if (TRAITS.text_by_size && may_be_other(txn, fault))
        return OUTCOME_EXCHANGE;
    return EXCEPTION + drive_fault(fault);
}

static uint32_t answer_parameter(struct transaction *txn, frame_byte *data, uint32_t lge)
{
    const uint32_t ak = (uint32_t)data->byte >> 4;
    const bool read = txn->function == READ_REGISTERS;

    /* FC-8. All 12 bits below AK count: bit 11 must be 0 in dialects with a PNU of 11 bits (FC-3). */
    if (lge < LGE_TEXT || (word_at(data) & 0x0FFF) != txn->pnu)
        return OUTCOME_NOT_A_REPLY;
    if (txn->expects == EXPECT_TEXT && ak == AK_TEXT)
        return read ? registers_answer_text(txn, data + 4, lge - LGE_TEXT) : confirm(txn);
    if (lge != LGE_PARAMETER)
        return OUTCOME_NOT_A_REPLY;
    if (ak == AK_REFUSED)
        return refused(txn, data[7].byte);
    if (txn->expects != EXPECT_NUMBER || (ak != AK_IS_WORD && ak != AK_IS_DOUBLE))
        return OUTCOME_NOT_A_REPLY;
    return read ? registers_answer_number(txn, word_at(data + 4), word_at(data + 6)) : confirm(txn);
}

enum outcome translate_drive_reply(struct translator *t, struct transaction *txn, frame_byte *data,
                                   uint32_t lge)
{
    t->next_status = status_of(data, lge - 2);
    return outcome_of(txn, txn->expects == EXPECT_PROCESS ? answer_process(t, txn, lge)
                                                          : answer_parameter(txn, data, lge));
}

void translate_drive_commit(struct translator *t)
{
    t->status = t->next_status;
}

void translate_drive_again(struct transaction *txn)
{
    txn->again = true;
    telegram_as_other(txn);
}

enum outcome translate_drive_silent(struct transaction *txn)
{
    return outcome_of(txn, TRAITS.drive_silent ? EXCEPTION + TRAITS.drive_silent : OUTCOME_SILENT);
}

bool translate_is_running(const struct translator *t)
{
    return (t->settings.word[CONTROL] & CONTROL_START) != 0;
}

uint32_t translate_stopped(const struct translator *t)
{
    return (t->settings.word[CONTROL] & ~(uint32_t)CONTROL_START) | CONTROL_VALID;
}

void translate_image(struct transaction *txn, uint32_t control, bool broadcast)
{
    txn->broadcast = broadcast;
    (void)telegram_process(txn, control, TARGET_IMAGE);
}
