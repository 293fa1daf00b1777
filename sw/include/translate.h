/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Translation between Modbus PDUs and FC telegrams, free of hardware.
 *
 * One request is one transaction. It is prepared early and committed late (FRAME-6), in these calls:
 *   translate_request       decodes the PDU and prepares reply or telegram; changes no settings
 *   translate_commit        applies the settings of a committed request; a revoked request gets no such call
 *   translate_drive_reply   prepares the Modbus reply before the BCC of the drive's telegram arrives
 *   translate_drive_commit  after a good BCC: updates the status coils (FC-6)
 *   translate_drive_again   after translate_drive_commit: prepares a second telegram, if one is needed
 *   translate_drive_silent  after the time-out (FC-9): prepares exception 255, or no reply
 * Two transactions may exist at once: one at the drive, and a newer request (FRAME-7).
 *
 * PDU: function code and data, without address and CRC. Telegram: ADR, data and BCC, without STX and LGE; its
 * length is the LGE. Lengths are in bytes. Frames are laid out as in the frame memory (frame.h).
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
    OUTCOME_NOT_A_REPLY, /* the telegram is no reply to the request (FC-8): keep waiting */
    OUTCOME_SILENT,      /* no reply to the master */
    OUTCOME_REPLY,       /* the reply PDU is ready */
    OUTCOME_EXCHANGE,    /* the drive is asked first: telegram ready, or translate_drive_again needed */
};

/* The settings that a master can write, one word each. The first three are the local registers 40001-40003 (MAP-5);
 * some dialects have IND in another register (docs/guide/dialects.md). */
enum setting {
    LOCAL_IND,
    LOCAL_NETWORK_TIMEOUT, /* 10 ms, 0 = never */
    LOCAL_DRIVE_TIMEOUT,   /* 10 ms, never 0 */
    LOCAL_REGISTERS,
    CONTROL = LOCAL_REGISTERS, /* coils 1-32: CTW, and REF in the high half */
    EEPROM,                    /* coil 65 */
    GUARD,                     /* makes the sum of all words 0 (docs/hardening.md, Guarded settings) */
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
    struct settings settings; /* settings after the commit of this request */
    uint32_t status;          /* PCD of the drive's reply */
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

/* t is all zero. */
void translate_init(struct translator *t);

/* False after a bit of the settings flipped: translate_request then prepares nothing, until translate_init
 * (docs/hardening.md, Guarded settings). */
bool translate_is_sound(struct translator *t);

/* pdu_length: the length received, even if only the first 31 bytes were stored (FRAME-5). */
enum outcome translate_request(const struct translator *t, struct transaction *txn, frame_byte *pdu,
                               uint32_t pdu_length, bool broadcast);

void translate_commit(struct translator *t, const struct transaction *txn);

/* data: byte i of the telegram's data at index i, from byte 24 on at 24 + i % 4; lge as received. */
enum outcome translate_drive_reply(const struct translator *t, struct transaction *txn, frame_byte *data,
                                   uint32_t lge);

void translate_drive_commit(struct translator *t, const struct transaction *txn);

/* After OUTCOME_EXCHANGE of translate_drive_reply: asks for the number as text (MAP-8 of some dialects). */
void translate_drive_again(struct transaction *txn);

enum outcome translate_drive_silent(struct transaction *txn);

#endif
