// SPDX-License-Identifier: Apache-2.0
// For the cover of drive_port, and proved as well: 352 ticks are too deep to be reached. Read behind card_defs.v.
`undef CARD_DRIVE_PAUSE_TICKS
`define CARD_DRIVE_PAUSE_TICKS 12'd12
