/* SPDX-License-Identifier: Apache-2.0 */
/* The way in (a request's PDU) and back (the drive's reply); the table of functions; EXC 1-3. */
#include "translate.h"
#include "transaction.h"

enum form {
    FORM_READ,    /* address, quantity */
    FORM_SINGLE,  /* address, value */
    FORM_COUNTED, /* address, quantity, byte count, data */
};

static const struct function {
    uint8_t code;
    uint8_t form;
    uint8_t coils; /* largest quantity of them; 0: registers, see registers_limit */
    handler *handle;
} functions[] = {
    {READ_COILS, FORM_READ, 128, coils_read},
    {READ_REGISTERS, FORM_READ, 0, registers_read},
    {WRITE_COIL, FORM_SINGLE, 1, coil_write},
    {WRITE_REGISTER, FORM_SINGLE, 0, register_write},
    {WRITE_COILS, FORM_COUNTED, 32, coils_write},
    {WRITE_REGISTERS, FORM_COUNTED, 0, registers_write},
};

/* Bytes of a PDU before the data, and where in it things are. */
enum { AT_ADDRESS = 1, AT_OPERAND = 3, AT_COUNT = 5, AT_DATA = 6, PDU_PLAIN = 5 };

enum { DEFAULT_NETWORK_TIMEOUT = 1000, DEFAULT_DRIVE_TIMEOUT = 15 };

/* Returns the sum of all words. The guard makes it 0, any one flipped bit something else. */
static uint32_t copy_settings(struct settings *to, const struct settings *from)
{
    uint32_t sum = 0;
    uint32_t i;

    for (i = 0; i < SETTINGS; i++)
        sum += to->word[i] = from->word[i];
    return sum;
}

static void seal(struct settings *settings)
{
    settings->word[GUARD] -= copy_settings(settings, settings);
}

void translate_init(struct translator *t)
{
    t->settings.word[LOCAL_NETWORK_TIMEOUT] = DEFAULT_NETWORK_TIMEOUT;
    t->settings.word[LOCAL_DRIVE_TIMEOUT] = DEFAULT_DRIVE_TIMEOUT;
    seal(&t->settings);
}

bool translate_is_sound(struct translator *t)
{
    return copy_settings(&t->settings, &t->settings) == 0;
}

enum outcome refuse(struct transaction *txn, uint32_t code)
{
    txn->reply[0] = txn->function | 0x80u;
    txn->reply[1] = (uint8_t)code;
    txn->reply_length = 2;
    return OUTCOME_REPLY;
}

enum outcome refuse_fault(struct transaction *txn, uint32_t fault)
{
    return refuse(txn, TRAITS.drive_fault ? TRAITS.drive_fault : fault);
}

enum outcome confirm(struct transaction *txn)
{
    txn->reply[0] = txn->function;
    txn->reply[1] = (uint8_t)(txn->address >> 8);
    txn->reply[2] = (uint8_t)txn->address;
    txn->reply[3] = (uint8_t)(txn->operand >> 8);
    txn->reply[4] = (uint8_t)txn->operand;
    txn->reply_length = 5;
    return OUTCOME_REPLY;
}

static const struct function *find_function(uint32_t code)
{
    const struct function *function;

    for (function = functions; function < functions + sizeof functions / sizeof *functions; function++)
        if (function->code == code)
            return function;
    return 0;
}

/* EXC 3: quantity and byte count. */
static bool quantity_fits(const struct translator *t, const struct transaction *txn,
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

static enum outcome decode(const struct translator *t, struct transaction *txn, frame_byte *pdu,
                           uint32_t pdu_length)
{
    const struct function *function = find_function(txn->function);
    uint32_t expected = PDU_PLAIN;

    if (!function)
        return refuse(txn, TRAITS.bad_function);
    if (txn->broadcast && function->form == FORM_READ)
        return OUTCOME_SILENT;
    /* A PDU too short to have a byte count is shorter than any byte count asks for. */
    if (function->form == FORM_COUNTED)
        expected = AT_DATA + pdu[AT_COUNT].byte;
    if (pdu_length != expected)
        return refuse(txn, TRAITS.bad_length);
    txn->address = word_at(pdu + AT_ADDRESS);
    txn->operand = word_at(pdu + AT_OPERAND);
    if (!quantity_fits(t, txn, function, pdu))
        return refuse(txn, TRAITS.bad_quantity);
    return function->handle(t, txn, pdu + (function->form == FORM_SINGLE ? AT_OPERAND : AT_DATA));
}

enum outcome translate_request(const struct translator *t, struct transaction *txn, frame_byte *pdu,
                               uint32_t pdu_length, bool broadcast)
{
    enum outcome outcome;

    if (copy_settings(&txn->settings, &t->settings) != 0)
        return OUTCOME_SILENT;
    txn->function = pdu->byte;
    txn->broadcast = broadcast;
    outcome = decode(t, txn, pdu, pdu_length);
    /* What a reading left alone still fits, or shows that a bit of it flipped. */
    if (txn->function > READ_REGISTERS)
        seal(&txn->settings);
    /* MAP-9: a broadcast is done, or is not, but never answered. */
    return broadcast && outcome == OUTCOME_REPLY ? OUTCOME_SILENT : outcome;
}

void translate_commit(struct translator *t, const struct transaction *txn)
{
    copy_settings(&t->settings, &txn->settings);
}

/* Four PCD bytes at the end of the data: status word and output frequency. */
static uint32_t status_of(frame_byte *data, uint32_t length)
{
    uint8_t pcd[4];
    uint32_t i;

    for (i = 0; i < 4; i++) {
        const uint32_t at = length - 4 + i;

        pcd[i] = data[at < 24 ? at : 24 + (at & 3u)].byte;
    }
    return (uint32_t)pcd[2] << 24 | (uint32_t)pcd[3] << 16 | (uint32_t)pcd[0] << 8 | pcd[1];
}

static enum outcome answer_process(const struct translator *t, struct transaction *txn, uint32_t lge)
{
    if (lge != LGE_PROCESS)
        return OUTCOME_NOT_A_REPLY;
    return STATUS_REFRESH && txn->function == READ_COILS ? coils_answer(t, txn, txn->status) : confirm(txn);
}

/* A text that was asked for as a number: 06 never writes text. */
static bool may_be_text(const struct transaction *txn, uint32_t fault)
{
    return fault == FAULT_TYPE && txn->expects == EXPECT_NUMBER && txn->function != WRITE_REGISTER;
}

static enum outcome answer_parameter(struct transaction *txn, frame_byte *data, uint32_t lge)
{
    const uint32_t ak = (uint32_t)data->byte >> 4;
    const bool read = txn->function == READ_REGISTERS;

    /* FC-8. All 12 bits beside AK: where bit 11 is not part of PNU, it must be 0 (FC-3). */
    if (lge < LGE_TEXT || (word_at(data) & 0x0FFF) != txn->pnu)
        return OUTCOME_NOT_A_REPLY;
    if (txn->expects == EXPECT_TEXT && ak == AK_TEXT)
        return read ? registers_answer_text(txn, data + 4, lge - LGE_TEXT) : confirm(txn);
    if (lge != LGE_PARAMETER)
        return OUTCOME_NOT_A_REPLY;
    if (ak == AK_REFUSED)
        return TRAITS.text_by_size && may_be_text(txn, data[7].byte) ? OUTCOME_EXCHANGE
                                                                     : refuse_fault(txn, data[7].byte);
    if (txn->expects != EXPECT_NUMBER || (ak != AK_IS_WORD && ak != AK_IS_DOUBLE))
        return OUTCOME_NOT_A_REPLY;
    return read ? registers_answer_number(txn, word_at(data + 4), word_at(data + 6)) : confirm(txn);
}

enum outcome translate_drive_reply(const struct translator *t, struct transaction *txn, frame_byte *data,
                                   uint32_t lge)
{
    txn->status = status_of(data, lge - 2);
    if (txn->expects == EXPECT_PROCESS)
        return answer_process(t, txn, lge);
    return answer_parameter(txn, data, lge);
}

void translate_drive_commit(struct translator *t, const struct transaction *txn)
{
    t->status = txn->status;
}

void translate_drive_again(struct transaction *txn)
{
    telegram_as_text(txn);
}

enum outcome translate_drive_silent(struct transaction *txn)
{
    return TRAITS.drive_silent ? refuse(txn, TRAITS.drive_silent) : OUTCOME_SILENT;
}
