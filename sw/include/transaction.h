/* SPDX-License-Identifier: Apache-2.0 */
/* Types of the translation core: its settings, a transaction, and the outcome of each step (translate.h). */
#ifndef TRANSACTION_H
#define TRANSACTION_H

#include <stdbool.h>
#include <stdint.h>

#include "options.h"

enum {
    /* Function, byte count, 10 registers of text; or an identification. */
    REPLY_PDU_MAX = DIAGNOSTICS ? 30 : 22,
    TELEGRAM_MAX = 30,  /* ADR, PKE, IND, 20 characters, PCD1, PCD2, BCC */
};

/* What a step leads to. A handler may also return EXCEPTION + code: translate.c makes that reply. */
enum outcome {
    OUTCOME_NOT_A_REPLY, /* the telegram is no reply to the request (FC-8): keep waiting */
    OUTCOME_SILENT,      /* no reply to the master */
    OUTCOME_REPLY,       /* the reply PDU is ready */
    OUTCOME_EXCHANGE,    /* the drive is asked first: telegram ready, or translate_drive_again needed */
    EXCEPTION = 0x100,
};

/* Defaults of the local registers, in 10 ms (MAP-5). */
enum { DEFAULT_NETWORK_TIMEOUT = 1000, DEFAULT_DRIVE_TIMEOUT = 15 };

/* The settings that a master can write, one word each. The first three are the local registers 40001-40003 (MAP-5);
 * some dialects have IND in another register (docs/guide/dialects.md). */
enum setting {
    LOCAL_IND,
    LOCAL_NETWORK_TIMEOUT, /* 10 ms, 0 = never */
    LOCAL_DRIVE_TIMEOUT,   /* 10 ms, never 0 */
    LOCAL_REGISTERS,
    CONTROL = LOCAL_REGISTERS, /* coils 1-32: CTW, and REF in the high half */
    EEPROM,                    /* coil 65 */
    SETTINGS,
};

struct settings {
    uint32_t word[SETTINGS];
};

struct translator {
    struct settings settings;
    uint32_t status; /* coils 33-64: STW, and MAV in the high half */
    /* Prepared: the settings after the commit of the newest request, the status after a good BCC of the drive. */
    struct settings next;
    uint32_t next_status;
};

/* The reply takes the place of its telegram, where no second telegram is made from the first (text_by_size). */
#if DIALECT == DIALECT_CARD
#define OUT_FRAMES union
#else
#define OUT_FRAMES struct
#endif

/* What the telegram of a request is for, as the actions of the register TELEGRAM. */
enum target { TARGET_READING = 0, TARGET_PARAMETER = 2, TARGET_IMAGE = 3 };

struct transaction {
    uint16_t address; /* first coil or register, on-wire */
    uint16_t operand; /* quantity, or the value of 05 and 06 */
    uint16_t pnu;
    uint8_t function;
    uint8_t expects; /* enum expectation */
    uint8_t target; /* enum target; of a request without a telegram, that of a reading */
    bool broadcast;
    bool again; /* the second telegram of the request (MAP-8) */
    uint8_t reply_length;
    uint8_t telegram_length; /* 0: the request asks the drive for nothing */
    OUT_FRAMES
    {
        uint8_t reply[REPLY_PDU_MAX];
        uint8_t telegram[TELEGRAM_MAX]; /* from ADR to BCC */
    } out;
};

#endif
