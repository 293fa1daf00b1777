/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Translation between Modbus PDUs and FC telegrams, free of hardware.
 *
 * One request is one transaction. Its way, prepare early and commit late (FRAME-6):
 *   translate_request       decodes the PDU and prepares all that follows; changes nothing
 *   translate_commit        the request holds: its effects come into force (a revoked one is just forgotten)
 *   translate_drive_reply   prepares the Modbus reply while the telegram's BCC is still to come
 *   translate_drive_commit  the BCC was good: the status image follows (FC-6)
 *   translate_drive_again   and the drive is to be asked once more: prepares the second telegram
 *   translate_drive_silent  no good reply: exception 255, or silence (FC-9)
 * Two transactions may live at once: one at the drive, and a newer request (FRAME-7).
 *
 * PDU: function code and data, no address, no CRC. Telegram: ADR, data and BCC, no STX and LGE;
 * its length is its LGE.
 * Lengths are in bytes. Frames lie as in the frame memory (frame.h).
 */
#ifndef TRANSLATE_H
#define TRANSLATE_H

#include <stdbool.h>
#include <stdint.h>

#include "frame.h"

enum {
    REPLY_PDU_MAX = 22, /* function, byte count, 10 registers of text */
    TELEGRAM_MAX = 30,  /* ADR, PKE, IND, 20 characters, PCD1, PCD2, BCC */
};

enum outcome {
    OUTCOME_NOT_A_REPLY, /* this telegram does not fit what was asked (FC-8): go on waiting */
    OUTCOME_SILENT,      /* nothing to send to the master */
    OUTCOME_REPLY,       /* the reply PDU is ready */
    OUTCOME_EXCHANGE,    /* the drive answers first: the telegram is ready, or translate_drive_again's */
};

/* What a master can write, a word each: first the card's own registers (MAP-5), 40001-40003, but that IND may
 * lie elsewhere (docs/guide/dialects.md). */
enum setting {
    LOCAL_IND,
    LOCAL_NETWORK_TIMEOUT, /* 10 ms, 0 = never */
    LOCAL_DRIVE_TIMEOUT,   /* 10 ms, never 0 */
    LOCAL_REGISTERS,
    CONTROL = LOCAL_REGISTERS, /* coils 1-32: CTW, and REF in the high half */
    EEPROM,                    /* coil 65 */
    GUARD,                     /* makes the sum of all words 0 (translate_is_sound) */
    SETTINGS,
};

struct settings {
    uint32_t word[SETTINGS];
};

struct translator {
    struct settings settings;
    uint32_t status; /* coils 33-64: STW, and MAV in the high half */
};

struct transaction {
    struct settings settings; /* the card's settings once this request commits */
    uint32_t status;          /* PCD of the drive reply under judgement */
    uint16_t address;         /* first coil or register, on-wire */
    uint16_t operand;         /* quantity, or the value of 05 and 06 */
    uint16_t pnu;
    uint8_t function;
    uint8_t expects; /* enum expectation */
    bool broadcast;
    uint8_t reply_length;
    uint8_t telegram_length;
    uint8_t reply[REPLY_PDU_MAX];
    uint8_t telegram[TELEGRAM_MAX];
};

/* t: all zero. */
void translate_init(struct translator *t);

/* False: a bit of what masters wrote has flipped. The next command would be built on it, so nothing is
 * translated any more (SAFE-4); only translate_init makes it sound again. */
bool translate_is_sound(struct translator *t);

/* pdu_length: the true length, even if only the first 31 bytes were kept (FRAME-5). */
enum outcome translate_request(const struct translator *t, struct transaction *txn, frame_byte *pdu,
                               uint32_t pdu_length, bool broadcast);

void translate_commit(struct translator *t, const struct transaction *txn);

/* data: byte i of the telegram's data at i, from 24 on at 24 + i % 4; lge as received. */
enum outcome translate_drive_reply(const struct translator *t, struct transaction *txn, frame_byte *data,
                                   uint32_t lge);

void translate_drive_commit(struct translator *t, const struct transaction *txn);

/* After OUTCOME_EXCHANGE from translate_drive_reply: a number refused as text (MAP-8 of some dialects). */
void translate_drive_again(struct transaction *txn);

enum outcome translate_drive_silent(struct transaction *txn);

#endif
