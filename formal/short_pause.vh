// SPDX-License-Identifier: Apache-2.0
// A short pause for the cover of drive_port, which cannot reach 352 ticks; proved as well. Read after card_defs.v.
`undef CARD_DRIVE_PAUSE_TICKS
`define CARD_DRIVE_PAUSE_TICKS 12'd12
