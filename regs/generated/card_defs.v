// SPDX-License-Identifier: Apache-2.0
// Generated from regs/card.toml by `make regs`; edit that file, not this one.
//
// The fixed format of the drive line (FC-1, FC-8).
// Pause in ticks of 1/16 bit, mask of baud_divider. SILENCE_START: what the count of silence_timer
// begins a half character with; the ends in card_tables.v count from it.

`define CARD_BASE_HZ 1843200
`define CARD_DRIVE_MASK 7'd3
`define CARD_DRIVE_PAUSE_TICKS 12'd352
`define CARD_DRIVE_PARITY_ENABLE 1'b1
`define CARD_DRIVE_PARITY_ODD 1'b0
`define CARD_DRIVE_TWO_STOP 1'b0
`define CARD_SILENCE_START 9'd18
