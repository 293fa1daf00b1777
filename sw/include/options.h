/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Build options of the firmware; override with -D.
 *
 * DIALECT         register and exception conventions (docs/guide/dialects.md): DIALECT_CARD, those of the option card;
 *                 DIALECT_BUILTIN, those of the Modbus built into VLT 2800, 6000 HVAC and 8000 AQUA;
 *                 DIALECT_HVAC_BASIC, those of the VLT HVAC Basic Drive.
 * STATUS_REFRESH  1: a read that touches coils 33-64 first asks the drive for them (MAP-1); default 0 with DIALECT_CARD,
 *                 else 1, for in those drives the coils are the drive's own.
 * REPLY_DELAY     ms from t3.5 to the earliest start of a reply, 0 to 250, for masters that need time to turn their
 *                 driver around (LINE-9); default 0.
 * ADR_SHORT       0: ADR 81h, broadcast 80h (address format 1-126); 1: 01h and 20h (format 1-31) (FC-2).
 * MASTER_LOSS_STOP
 *                 1: one stop for the drive after 40002 x 10 ms without a good frame (SAFE-7); the card needs the
 *                 parameter MASTER_LOSS_STOP of rtl/rtu2fc.v, too (docs/guide/dialects.md).
 * DIAGNOSTICS     1: the functions 08, 0B, 11 and 2B/0E (MAP-10); default 1 with DIALECT_HVAC_BASIC, else 0.
 *
 * The small card runs DIALECT_CARD only: build/firmware.elf must fit the smallest memory of configs.toml, and
 * STATUS_REFRESH, MASTER_LOSS_STOP and DIAGNOSTICS do not fit there. The images of build/large are for boards with
 * 16 KiB; build/large/all has all options. Every other image must fit the standard card's memory. The linker reports an
 * error if one does not. sw/firmware.mk names the images with one other option.
 */
#ifndef OPTIONS_H
#define OPTIONS_H

#define DIALECT_CARD 0
#define DIALECT_BUILTIN 1
#define DIALECT_HVAC_BASIC 2

#ifndef DIALECT
#define DIALECT DIALECT_CARD
#endif
#if DIALECT < DIALECT_CARD || DIALECT > DIALECT_HVAC_BASIC
#error "DIALECT: unknown dialect"
#endif

#ifndef STATUS_REFRESH
#define STATUS_REFRESH (DIALECT != DIALECT_CARD)
#endif

#ifndef REPLY_DELAY
#define REPLY_DELAY 0
#endif
#if REPLY_DELAY < 0 || REPLY_DELAY > 250
#error "REPLY_DELAY: 0 to 250 ms"
#endif

#ifndef ADR_SHORT
#define ADR_SHORT 0
#endif

#ifndef MASTER_LOSS_STOP
#define MASTER_LOSS_STOP 0
#endif

#ifndef DIAGNOSTICS
#define DIAGNOSTICS (DIALECT == DIALECT_HVAC_BASIC)
#endif

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
