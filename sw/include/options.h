/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Build options of the firmware; override with -D.
 *
 * DIALECT is a row of sw/src/dialect.h (docs/guide/dialects.md). The small card runs the first of them only:
 * build/firmware.elf must fit the smallest memory of configs.toml. The images of build/large are for boards with 16 KiB;
 * build/large/all has all options. Every other image must fit the standard card's memory. The linker reports an error if
 * one does not.
 */
#ifndef OPTIONS_H
#define OPTIONS_H

/* From regs/dialects.toml by make regs: options */
#define DIALECT_CARD 0
#define DIALECT_BUILTIN 1
#define DIALECT_HVAC_BASIC 2

#ifndef DIALECT
#define DIALECT DIALECT_CARD
#endif
#if DIALECT < DIALECT_CARD || DIALECT > DIALECT_HVAC_BASIC
#error "DIALECT: unknown dialect"
#endif

/* 1: a read that touches coils 33-64 first asks the drive for them (MAP-1). */
#ifndef STATUS_REFRESH
#define STATUS_REFRESH (DIALECT != DIALECT_CARD)
#endif

/* ms from t3.5 to the earliest start of a reply, for masters that need time to turn their driver around (LINE-9). */
#ifndef REPLY_DELAY
#define REPLY_DELAY 0
#endif
#if REPLY_DELAY < 0 || REPLY_DELAY > 250
#error "REPLY_DELAY: 0 to 250 ms"
#endif

/* 1: ADR 01h and broadcast 20h (address format 1-31) instead of 81h and 80h (format 1-126) (FC-2). */
#ifndef ADR_SHORT
#define ADR_SHORT 0
#endif

/*
 * 1: one stop for the drive after 40002 x 10 ms without a good frame (SAFE-7); the card needs that parameter of
 * rtl/rtu2fc.v, too.
 */
#ifndef MASTER_LOSS_STOP
#define MASTER_LOSS_STOP 0
#endif

/* 1: the functions 08, 0B, 11 and 2B/0E (MAP-10). */
#ifndef DIAGNOSTICS
#define DIAGNOSTICS (DIALECT == DIALECT_HVAC_BASIC)
#endif

/*
 * 1: a silence of 1.5 characters ends a frame; 0: only one of 3.5 does, for masters with a USB adapter (FRAME-2,
 * FRAME-3).
 */
#ifndef STRICT_T15
#define STRICT_T15 1
#endif

/* 1: a low of a character or more after a good frame is silence, for a bus without bias (FRAME-3). */
#ifndef BREAK_TOLERANT
#define BREAK_TOLERANT 0
#endif
/* end of options */

/* A function with one copy, so that the firmware fits the small card. */
#define ONE_COPY __attribute__((noinline))

#if ADR_SHORT
#define ADR_DRIVE 0x01u
#define ADR_BROADCAST 0x20u
#else
#define ADR_DRIVE 0x81u
#define ADR_BROADCAST 0x80u
#endif

#endif
