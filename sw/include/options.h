/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Build options of the firmware; override with -D.
 *
 * DIALECT         register and exception conventions (docs/guide/dialects.md): DIALECT_CARD, those of the option card;
 *                 DIALECT_BUILTIN, those of the Modbus built into VLT 2800, 6000 HVAC and 8000 AQUA;
 *                 DIALECT_HVAC_BASIC, those of the VLT HVAC Basic Drive.
 * STATUS_REFRESH  1: a read that touches coils 33-64 first asks the drive for them (MAP-1).
 * PLACES          committed writes that can wait for the end of an exchange (FRAME-7): 2, a broadcast and another
 *                 write; 1, a broadcast only. The same as `waiting_places` in configs.toml.
 * ADR_SHORT       0: ADR 81h, broadcast 80h (address format 1-126); 1: 01h and 20h (format 1-31) (FC-2).
 * MASTER_LOSS_STOP
 *                 1: one stop for the drive after 40002 x 10 ms without a good frame (SAFE-7); the card needs the
 *                 parameter MASTER_LOSS_STOP of rtl/rtu2fc.v, too (docs/guide/master-loss.md).
 * DIAGNOSTICS     1: the functions 08, 0B, 11 and 2B/0E (MAP-10); default 1 with DIALECT_HVAC_BASIC, else 0.
 *
 * The small card runs DIALECT_CARD only: build/firmware.elf must fit the smallest memory of configs.toml, and
 * STATUS_REFRESH, MASTER_LOSS_STOP and DIAGNOSTICS do not fit there. The images of build/large are for boards with
 * 16 KiB; build/large/all has all options. Every other image must fit the standard card's memory. The linker reports an
 * error if one does not. build/refresh has the images with STATUS_REFRESH, one for each dialect. build/stop has those
 * with MASTER_LOSS_STOP, without hvac_basic: with DIAGNOSTICS they do not fit 8 KiB.
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
#define STATUS_REFRESH 0
#endif

#ifndef PLACES
#define PLACES 2
#endif
#if PLACES < 1 || PLACES > 2
#error "PLACES: 1 or 2"
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

#if ADR_SHORT
#define ADR_DRIVE 0x01u
#define ADR_BROADCAST 0x20u
#else
#define ADR_DRIVE 0x81u
#define ADR_BROADCAST 0x80u
#endif

#endif
