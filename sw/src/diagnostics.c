/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Modbus application protocol V1.1b3, 6.8, 6.9, 6.13, 6.21. A reply is prepared before its request is committed
 * (FRAME-6). So a reply reports the counter of requests plus one.
 */
#include "diagnostics.h"

#include "dialect.h"
#include "mailbox_port.h"
#include "version.h"

enum { IDENTIFICATION = 0x0E };

enum sub_function {
    SUB_ECHO = 0,
    SUB_RESTART = 1,
    SUB_REGISTER = 2,
    SUB_CLEAR = 10,
    SUB_MESSAGES = 11,
    SUB_ERRORS = 12,
    SUB_EXCEPTIONS = 13,
    SUB_REQUESTS = 14,
};

enum { AT_SUB = 1, AT_DATA = 3, PDU_DIAGNOSTIC = 5, PDU_CODE_ONLY = 1, PDU_IDENTIFICATION = 4 };

/* Basic objects as a stream, or one object (6.21). */
enum { READ_BASIC = 1, READ_EXTENDED = 3, READ_ONE = 4, CONFORMITY = 0x81, OBJECTS = 3, AT_OBJECTS = 7 };

/* One answer holds all three. */
static const struct object {
    uint8_t length;
    const char *text;
} objects[OBJECTS] = {
    {6, "rtu2fc"},
    {4, "card"},
    {sizeof CARD_VERSION - 1, CARD_VERSION},
};

enum { TEXTS = sizeof "rtu2fc" + sizeof "card" + sizeof CARD_VERSION - OBJECTS };

/* A version that is too long for the answer with all objects does not compile. */
typedef char version_fits[!DIAGNOSTICS || AT_OBJECTS + 2 * OBJECTS + TEXTS <= REPLY_PDU_MAX ? 1 : -1];

static const char server_id[] = "rtu2fc " CARD_VERSION "\xFF"; /* the last byte: it runs */

enum { COUNTERS = (COUNT_COMPLETED_address - COUNT_CRC_address) / FRAME_STRIDE + 1 };

static volatile uint16_t *counter_at(uint32_t i)
{
    return mailbox_counter(COUNT_CRC) + i * (FRAME_STRIDE / sizeof(uint16_t));
}

/* Sub-function 12: network frames that were discarded or revoked. */
static uint32_t errors(void)
{
    return (uint32_t)*mailbox_counter(COUNT_CRC) + *mailbox_counter(COUNT_PARITY) + *mailbox_counter(COUNT_FRAMING) +
           *mailbox_counter(COUNT_T15) + *mailbox_counter(COUNT_OVERRUN) + *mailbox_counter(COUNT_REVOKED);
}

/* The diagnostic register: restarts since the reset, and a bit for each kind of fault that was counted. */
static uint32_t faults(void)
{
    uint32_t found = mailbox_read(RESTARTS) << 8;
    uint32_t i;

    for (i = 0; i < 8; i++) /* at most 8 turns: the counters of EVENTS */
        if (i != MAILBOX__EVENTS__FOREIGN_bp && *counter_at(i) != 0)
            found |= 1u << i;
    if (*mailbox_counter(COUNT_DRIVE_NO_REPLY) != 0 || *mailbox_counter(COUNT_DRIVE_REPEAT) != 0)
        found |= 1u << MAILBOX__EVENTS__FOREIGN_bp; /* no fault, so its bit says: no good reply */
    return found;
}

static void clear(void)
{
    uint32_t i;

    for (i = 0; i < COUNTERS; i++) /* at most 13 turns: COUNTERS */
        *counter_at(i) = 0;
}

static uint32_t value_of(uint32_t sub)
{
    const uint32_t requests = *mailbox_counter(COUNT_REQUESTS) + 1u;

    switch (sub) {
    case SUB_REGISTER:
        return faults();
    case SUB_MESSAGES:
        return requests + *mailbox_counter(COUNT_FOREIGN);
    case SUB_ERRORS:
        return errors();
    case SUB_EXCEPTIONS:
        return *mailbox_counter(COUNT_EXCEPTIONS);
    case SUB_REQUESTS:
        return requests;
    default:
        return 0;
    }
}

static uint32_t finish(struct transaction *txn, uint32_t length)
{
    txn->out.reply[0] = txn->function;
    txn->reply_length = (uint8_t)length;
    return OUTCOME_REPLY;
}

static void echo(struct transaction *txn, frame_byte *pdu, uint32_t length)
{
    uint32_t i;

    for (i = AT_SUB; i < length; i++) /* at most 29 turns: an echo of 30 bytes without its function */
        txn->out.reply[i] = pdu[i].byte;
    (void)finish(txn, length);
}

static bool is_sub_function(uint32_t sub)
{
    return sub <= SUB_REGISTER || (sub >= SUB_CLEAR && sub <= SUB_REQUESTS);
}

uint32_t diagnose(struct translator *t, struct transaction *txn, frame_byte *pdu)
{
    const uint32_t length = txn->operand;
    uint32_t data;

    (void)t;
    if (length < PDU_DIAGNOSTIC)
        return EXCEPTION + TRAITS.bad_length;
    txn->address = word_at(pdu + AT_SUB);
    data = word_at(pdu + AT_DATA);
    if (!is_sub_function(txn->address))
        return EXCEPTION + TRAITS.bad_function;
    if (txn->address == SUB_ECHO ? length > REPLY_PDU_MAX || !(length & 1u) : length != PDU_DIAGNOSTIC)
        return EXCEPTION + TRAITS.bad_length;
    if (txn->address != SUB_ECHO && data != 0 && !(txn->address == SUB_RESTART && data == 0xFF00))
        return EXCEPTION + TRAITS.bad_value;
    echo(txn, pdu, length);
    if (txn->address >= SUB_MESSAGES || txn->address == SUB_REGISTER)
        put_word(txn->out.reply + AT_DATA, value_of(txn->address));
    return OUTCOME_REPLY;
}

static uint32_t put_text(struct transaction *txn, uint32_t at, const char *text, uint32_t length)
{
    uint32_t i;

    for (i = 0; i < length; i++) /* at most 20 turns: server_id */
        txn->out.reply[at + i] = (uint8_t)text[i];
    return at + length;
}

static uint32_t put_objects(struct transaction *txn, uint32_t id, uint32_t end)
{
    uint32_t at = AT_OBJECTS;

    for (; id < end; id++) { /* at most 3 turns: OBJECTS */
        txn->out.reply[at] = (uint8_t)id;
        txn->out.reply[at + 1] = objects[id].length;
        at = put_text(txn, at + 2, objects[id].text, objects[id].length);
    }
    return at;
}

uint32_t identify(struct translator *t, struct transaction *txn, frame_byte *pdu)
{
    const uint32_t length = txn->operand;
    const uint32_t code = pdu[2].byte;
    uint32_t id = pdu[3].byte;

    (void)t;
    /* Another MEI type, or none, is another function (MAP-10). */
    if (length < PDU_CODE_ONLY + 1 || pdu[1].byte != IDENTIFICATION)
        return EXCEPTION + TRAITS.bad_function;
    if (length != PDU_IDENTIFICATION)
        return EXCEPTION + TRAITS.bad_length;
    if (code < READ_BASIC || code > READ_ONE)
        return EXCEPTION + TRAITS.bad_value;
    if (id >= OBJECTS) {
        if (code == READ_ONE)
            return EXCEPTION + TRAITS.bad_address;
        id = 0;
    }
    txn->out.reply[1] = IDENTIFICATION;
    txn->out.reply[2] = (uint8_t)code;
    txn->out.reply[3] = CONFORMITY;
    put_word(txn->out.reply + 4, 0); /* nothing follows */
    txn->out.reply[6] = (uint8_t)(code == READ_ONE ? 1 : OBJECTS - id);
    return finish(txn, put_objects(txn, id, code == READ_ONE ? id + 1 : OBJECTS));
}

uint32_t report_server(struct translator *t, struct transaction *txn, frame_byte *pdu)
{
    (void)t;
    (void)pdu;
    if (txn->operand != PDU_CODE_ONLY)
        return EXCEPTION + TRAITS.bad_length;
    txn->out.reply[1] = sizeof server_id - 1;
    return finish(txn, put_text(txn, 2, server_id, sizeof server_id - 1));
}

uint32_t report_events(struct translator *t, struct transaction *txn, frame_byte *pdu)
{
    (void)t;
    (void)pdu;
    if (txn->operand != PDU_CODE_ONLY)
        return EXCEPTION + TRAITS.bad_length;
    put_word(txn->out.reply + 1, 0); /* not busy */
    put_word(txn->out.reply + 3, *mailbox_counter(COUNT_COMPLETED));
    return finish(txn, 5);
}

void diagnostics_commit(const struct transaction *txn)
{
    mailbox_count(mailbox_counter(COUNT_REQUESTS));
    /* Without a reply the drive is asked first, which is enough for a broadcast; or there is never one. */
    if (txn->reply_length == 0 && !(txn->broadcast && txn->telegram_length != 0))
        return;
    diagnostics_done(txn);
    if (txn->function == DIAGNOSTIC && txn->reply_length == PDU_DIAGNOSTIC &&
        (txn->address == SUB_RESTART || txn->address == SUB_CLEAR))
        clear();
}

void diagnostics_done(const struct transaction *txn)
{
    if (txn->reply_length != 0 && txn->out.reply[0] & 0x80)
        mailbox_count(mailbox_counter(COUNT_EXCEPTIONS));
    else if (txn->function != EVENT_COUNTER)
        mailbox_count(mailbox_counter(COUNT_COMPLETED));
}
