/* SPDX-License-Identifier: Apache-2.0 */
/*
 * For the fuzzer: input, checks, requests and drive replies made from input, and an independent model of the settings
 * that a request changes.
 */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dialect.h"
#include "translate.h"

enum { PDU_MAX = 253, PDU_KEPT = 31, DATA_MAX = 253, PATTERN = 0xA5 };

/* Checks a fact. If it does not hold, the run ends and the input is a finding. */
#define HOLDS(fact) ((fact) ? (void)0 : fuzz_wrong(__FILE__, __LINE__, #fact))
#define NEVER(event) fuzz_wrong(__FILE__, __LINE__, event)
__attribute__((noreturn)) void fuzz_wrong(const char *file, int line, const char *fact);

/* A run; libFuzzer or replay.c calls it. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct input {
    const uint8_t *at;
    const uint8_t *end;
};

/* The next byte or word of the input; 0 at its end. */
uint32_t take(struct input *in);
uint32_t take_word(struct input *in);

/* Makes a request PDU, in most cases a valid one; returns its length. pdu has PDU_MAX bytes, of which the card
 * stores the first PDU_KEPT. */
uint32_t take_request(struct input *in, uint8_t *pdu);

/* Makes telegram data of the drive (without STX, LGE, ADR, BCC), in most cases a reply to `asked`; returns its
 * length. */
uint32_t take_telegram(struct input *in, const uint8_t *asked, uint32_t asked_length, uint8_t *data);

/* True if STX, LGE and the telegram from ADR to BCC xor to 0 (FC-1). */
bool bcc_fits(const uint8_t *telegram, uint32_t length);

/* The settings that a master can write. */
struct model {
    bool coils[128];
    uint16_t ind;
    uint16_t network_timeout;
    uint16_t drive_timeout;
};

/* The kind of access to the drive that a request may cause. */
enum intent { INTENT_LOCAL, INTENT_PROCESS, INTENT_READ, INTENT_WRITE };

void model_init(struct model *m);
uint32_t model_word(const struct model *m, uint32_t first);
/* Compares the settings of the firmware with the model. */
void check_settings(const struct settings *s, const struct model *m);
/* Applies a committed request to m. */
enum intent model_request(struct model *m, const uint8_t *pdu, uint32_t length);

/* True for a function of MAP-10, whose replies have forms of their own. */
static inline bool diagnoses(uint32_t function)
{
    return DIAGNOSTICS && (function == 0x08 || function == 0x0B || function == 0x11 || function == 0x2B);
}

#endif
