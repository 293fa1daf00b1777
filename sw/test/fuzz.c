/* SPDX-License-Identifier: Apache-2.0 */
#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void fuzz_wrong(const char *file, int line, const char *fact)
{
    (void)fprintf(stderr, "%s:%d: does not hold: %s\n", file, line, fact);
    abort();
}

uint32_t take(struct input *in)
{
    return in->at < in->end ? *in->at++ : 0;
}

uint32_t take_word(struct input *in)
{
    const uint32_t high = take(in);

    return high << 8 | take(in);
}

static uint32_t take_address(struct input *in, uint32_t how)
{
    switch (how) {
    case 0:
        return take(in) % 70; /* coils and the card's own registers */
    case 1:
        return 10 * (1 + take_word(in) % 4100) - 1; /* a parameter */
    case 2:
        return take(in) % 10;
    default:
        return take_word(in);
    }
}

static void take_bytes(struct input *in, uint8_t *to, uint32_t from, uint32_t end)
{
    for (; from < end; from++)
        to[from] = (uint8_t)take(in);
}

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* A request of MAP-10: 08 with any sub-function, 0B, 11, 2B/0E. pdu is filled with PATTERN. */
static uint32_t take_diagnosis(struct input *in, uint8_t *pdu, uint32_t how)
{
    static const uint8_t functions[8] = {0x08, 0x08, 0x08, 0x08, 0x0B, 0x11, 0x2B, 0x2B};

    pdu[0] = functions[how & 7];
    if (pdu[0] == 0x0B || pdu[0] == 0x11)
        return 1;
    if (pdu[0] == 0x2B) {
        pdu[1] = 0x0E;
        pdu[2] = take(in) & 7;
        pdu[3] = take(in) & 7;
        return 4;
    }
    pdu[1] = 0;
    pdu[2] = take(in) & 15;
    pdu[3] = pdu[4] = 0;
    return pdu[2] == 0 ? 29 : 5;
}

uint32_t take_request(struct input *in, uint8_t *pdu)
{
    static const uint8_t functions[8] = {0x01, 0x03, 0x05, 0x06, 0x0F, 0x10, 0x03, 0x10};
    static const uint16_t single[4] = {0x0000, 0xFF00, 0x0001, 0xFF01};
    const uint32_t how = take(in);
    uint32_t length = 5;
    uint32_t address;
    uint32_t operand;

    memset(pdu, PATTERN, PDU_MAX);
    if (how >= 0xC0) {
        length = 1 + take(in) % PDU_MAX;
        take_bytes(in, pdu, 0, least(length, PDU_KEPT));
        return length;
    }
    if (DIAGNOSTICS && (how & 0xF8) == 0xB8)
        return take_diagnosis(in, pdu, how);
    pdu[0] = functions[how & 7];
    address = take_address(in, how >> 3 & 3);
    operand = how & 0x20 ? take_word(in) : 1 + take(in) % 33;
    if (pdu[0] == 0x05 && !(how & 0x20))
        operand = single[operand & 3];
    pdu[1] = (uint8_t)(address >> 8);
    pdu[2] = (uint8_t)address;
    pdu[3] = (uint8_t)(operand >> 8);
    pdu[4] = (uint8_t)operand;
    if (pdu[0] >= 0x0F) {
        const uint32_t bytes = pdu[0] == 0x0F ? (operand + 7) / 8 : 2 * operand;

        pdu[5] = (uint8_t)least(bytes, PDU_MAX - 6);
        length = 6u + pdu[5];
        take_bytes(in, pdu, 6, least(length, PDU_KEPT));
    }
    if (how & 0x80) { /* one error */
        const uint32_t wrong = take(in);

        if (wrong & 0x80)
            length = least(PDU_MAX, length + (wrong & 1 ? 1u : 0u) - (wrong & 2 ? 1u : 0u));
        else
            pdu[wrong % 7] = (uint8_t)take(in);
    }
    return length;
}

uint32_t take_telegram(struct input *in, const uint8_t *asked, uint32_t asked_length, uint8_t *data)
{
    static const uint8_t aks[8] = {1, 2, 7, 15, 7, 1, 0, 3};
    const uint32_t how = take(in);
    uint32_t length = 4;

    memset(data, PATTERN, DATA_MAX);
    if (how >= 0xE0) {
        length = take(in) % (DATA_MAX + 1);
        take_bytes(in, data, 0, least(length, 28));
        return length;
    }
    if (asked_length > 6 && !(how & 0x80)) {
        const uint32_t ak = aks[how & 7];

        memcpy(data, asked + 1, 4);
        data[0] = (uint8_t)(ak << 4 | (data[0] & 0x0F));
        length = 4 + (ak == 15 ? take(in) % 246 : 4);
        take_bytes(in, data, 4, least(length, 28));
        if (how & 0x08)
            data[take(in) & 3] ^= (uint8_t)take(in);
        if (how & 0x10) /* small numbers: faults, words */
            data[4] = data[5] = data[6] = 0;
        length += 4;
    }
    take_bytes(in, data, length - 4, length);
    return length;
}

bool bcc_fits(const uint8_t *telegram, uint32_t length)
{
    uint32_t sum = 0x02 ^ length;

    while (length-- != 0)
        sum ^= *telegram++;
    return sum == 0;
}

void model_init(struct model *m)
{
    memset(m, 0, sizeof *m);
    m->network_timeout = 1000;
    m->drive_timeout = 15;
}

uint32_t model_word(const struct model *m, uint32_t first)
{
    uint32_t word = 0;
    uint32_t i;

    for (i = 0; i < 16; i++)
        word |= (m->coils[first + i] ? 1u : 0u) << i;
    return word;
}

void check_settings(const struct settings *s, const struct model *m)
{
    HOLDS((s->word[CONTROL] & 0xFFFF) == model_word(m, 0));
    HOLDS(s->word[CONTROL] >> 16 == model_word(m, 16));
    HOLDS(s->word[EEPROM] == (m->coils[64] ? 1u : 0u));
    HOLDS(s->word[LOCAL_IND] == m->ind);
    HOLDS(s->word[LOCAL_NETWORK_TIMEOUT] == m->network_timeout);
    HOLDS(s->word[LOCAL_DRIVE_TIMEOUT] == m->drive_timeout && m->drive_timeout != 0);
}

static uint16_t word_of(const uint8_t *data)
{
    return (uint16_t)(data[0] << 8 | data[1]);
}

static enum intent write_coils(struct model *m, uint32_t first, uint32_t quantity, const uint8_t *bits)
{
    uint32_t i;

    if (first + quantity > 32 && !(first == 64 && quantity == 1))
        return INTENT_LOCAL;
    for (i = 0; i < quantity; i++)
        m->coils[first + i] = bits[i / 8] >> i % 8 & 1;
    return first < 32 ? INTENT_PROCESS : INTENT_LOCAL;
}

static enum intent write_registers(struct model *m, uint32_t first, uint32_t quantity, const uint8_t *data)
{
    uint16_t *const places[3] = {TRAITS.text_by_size ? NULL : &m->ind, &m->network_timeout, &m->drive_timeout};
    /* A text may be longer than a number; 06 writes one register. */
    const uint32_t limit = TRAITS.text_by_size || m->ind >> 8 == 5 ? 10 : 2;
    uint32_t i;

    if (first == TRAITS.index_register && quantity == 1)
        m->ind = word_of(data);
    else if (first + quantity <= 3 && places[first]) {
        if (first + quantity == 3 && word_of(data + (size_t)2 * (quantity - 1)) == 0)
            return INTENT_LOCAL;
        for (i = 0; i < quantity; i++)
            *places[first + i] = word_of(data + (size_t)2 * i);
    } else if (first > 8 && first % 10 == 9 && (first + 1) / 10 <= TRAITS.pnu_max && quantity <= limit)
        return INTENT_WRITE;
    return INTENT_LOCAL;
}

enum intent model_request(struct model *m, const uint8_t *pdu, uint32_t length)
{
    const uint32_t address = length < 5 ? 0 : (uint32_t)pdu[1] << 8 | pdu[2];
    const uint32_t operand = length < 5 ? 0 : (uint32_t)pdu[3] << 8 | pdu[4];
    const uint8_t on = 1;
    const uint8_t off = 0;

    if (length == 5 && (pdu[0] == 0x03 || (STATUS_REFRESH && pdu[0] == 0x01)))
        return INTENT_READ;
    if (length == 5 && pdu[0] == 0x05 && (operand == 0xFF00 || operand == 0))
        return write_coils(m, address, 1, operand ? &on : &off);
    if (length == 5 && pdu[0] == 0x06)
        return write_registers(m, address, 1, pdu + 3);
    if (length < 6 || length != 6u + pdu[5] || operand == 0)
        return INTENT_LOCAL;
    if (pdu[0] == 0x0F && operand <= 32 && pdu[5] == (operand + 7) / 8)
        return write_coils(m, address, operand, pdu + 6);
    if (pdu[0] == 0x10 && operand <= 10 && pdu[5] == 2 * operand)
        return write_registers(m, address, operand, pdu + 6);
    return INTENT_LOCAL;
}
