/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The differences between the dialects (docs/guide/dialects.md). DIALECT selects a row at build time. Every use is a
 * constant, so the compiler drops the code that the row does not need.
 */
#ifndef DIALECT_H
#define DIALECT_H

#include <stdbool.h>
#include <stdint.h>

#include "options.h"

struct traits {
    uint16_t pnu_max;
    uint8_t index_register; /* on-wire number of the register for IND, or for its index byte alone */
    bool text_by_size;      /* instead of by IND: 3-10 registers are text, and 1-2 if the drive says so */
    /* Exception codes (EXC). */
    uint8_t bad_function;
    uint8_t bad_length;
    uint8_t bad_quantity;
    uint8_t bad_address;
    uint8_t bad_value;
    uint8_t drive_fault;  /* 0: the drive's fault number */
    uint8_t drive_silent; /* 0: no reply to the master */
};

/* From regs/dialects.toml by make regs: dialects */
static const struct traits dialects[] = {
    [DIALECT_CARD] = {
        .pnu_max = 2047,
        .index_register = 0,
        .text_by_size = false,
        .bad_function = 67,
        .bad_length = 65,
        .bad_quantity = 66,
        .bad_address = 64,
        .bad_value = 2,
        .drive_fault = 0,
        .drive_silent = 255,
    },
    [DIALECT_BUILTIN] = {
        .pnu_max = 2047,
        .index_register = 8,
        .text_by_size = true,
        .bad_function = 67,
        .bad_length = 65,
        .bad_quantity = 66,
        .bad_address = 64,
        .bad_value = 66,
        .drive_fault = 0,
        .drive_silent = 0,
    },
    [DIALECT_HVAC_BASIC] = {
        .pnu_max = 4095,
        .index_register = 8,
        .text_by_size = true,
        .bad_function = 1,
        .bad_length = 3,
        .bad_quantity = 3,
        .bad_address = 2,
        .bad_value = 3,
        .drive_fault = 4,
        .drive_silent = 0,
    },
};
/* end of dialects */

#define TRAITS (dialects[DIALECT])

/* The exception code for a fault number of the drive (AK 7). */
static inline uint32_t drive_fault(uint32_t fault)
{
    return TRAITS.drive_fault ? TRAITS.drive_fault : fault;
}

#endif
