/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the fuzzers share: input, oracles, requests and drive replies made from input, and a second opinion
 * on what a request changes. libFuzzer calls LLVMFuzzerTestOneInput of one of the fuzz_*.c.
 */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "options.h"

enum { PDU_MAX = 253, PDU_KEPT = 31, DATA_MAX = 253, PATTERN = 0xA5 };

/* A fact that must hold whatever came in; if not, the run ends and the input is a finding. */
#define HOLDS(fact) ((fact) ? (void)0 : fuzz_wrong(__FILE__, __LINE__, #fact))
#define NEVER(what) fuzz_wrong(__FILE__, __LINE__, what)
void fuzz_wrong(const char *file, int line, const char *fact);

struct input {
    const uint8_t *at;
    const uint8_t *end;
};

/* 0 when all is taken. */
uint32_t take(struct input *in);
uint32_t take_word(struct input *in);

/* A request's PDU, mostly one that makes sense; pdu has PDU_MAX bytes, those beyond PDU_KEPT mean nothing. */
uint32_t take_request(struct input *in, uint8_t *pdu);

/* Telegram data of the drive (no STX, LGE, ADR, BCC), mostly a reply to the telegram asked; returns bytes. */
uint32_t take_telegram(struct input *in, const uint8_t *asked, uint32_t asked_length, uint8_t *data);

/* Where byte i of a telegram's data is stored: only the last four of a long text stay (FC-7). */
static inline uint32_t place_of(uint32_t i)
{
    return i < 24 ? i : 24 + (i & 3u);
}

/* FC-1: a telegram from ADR to BCC, before which STX and LGE go out, xors to 0. */
bool bcc_fits(const uint8_t *telegram, uint32_t length);

/* What a master can write, and what of a request is meant for the drive. */
struct model {
    bool coils[128];
    uint16_t ind;
    uint16_t network_timeout;
    uint16_t drive_timeout;
};

enum intent { INTENT_LOCAL, INTENT_PROCESS, INTENT_READ, INTENT_WRITE };

void model_init(struct model *m);
uint32_t model_word(const struct model *m, uint32_t first);
/* A committed request: changes m; says what may reach the drive because of it. */
enum intent model_request(struct model *m, const uint8_t *pdu, uint32_t length);

/* Largest parameter number; whether the size of a request makes it a text. */
#if DIALECT == DIALECT_HVAC_BASIC
enum { PNU_MAX = 4095 };
#else
enum { PNU_MAX = 2047 };
#endif
enum { BY_SIZE = DIALECT != DIALECT_CARD, INDEX_REGISTER = BY_SIZE ? 8 : 0 };

#endif
