// SPDX-License-Identifier: Apache-2.0
// Generated from regs/card.toml by `make regs`; edit that file, not this one.
//
// The fixed format of the drive line (FC-1, FC-8).
// Pause in ticks of 1/16 bit, mask of baud_divider. SILENCE_START: what the count of silence_timer
// begins a half character with; the ends in card_tables.v count from it.
// CARD_x_BITS: all bits of vector x between two modules; CARD_x_y_BITS: its field y, a bit select.

`define CARD_BASE_HZ 1843200
`define CARD_DRIVE_MASK 7'd3
`define CARD_DRIVE_PAUSE_TICKS 12'd352
`define CARD_DRIVE_PARITY_ENABLE 1'b1
`define CARD_DRIVE_PARITY_ODD 1'b0
`define CARD_DRIVE_TWO_STOP 1'b0
`define CARD_SILENCE_START 9'd18

`define CARD_LINE_BITS 12:0
`define CARD_LINE_PARITY_ENABLE_BITS 0
`define CARD_LINE_PARITY_ODD_BITS 1
`define CARD_LINE_TWO_STOP_BITS 2
`define CARD_LINE_HALF_UNEVEN_BITS 3
`define CARD_LINE_HALF_END_BITS 12:4

`define CARD_REQUEST_BITS 13:0
`define CARD_REQUEST_CANDIDATE_BITS 0
`define CARD_REQUEST_COMMIT_BITS 1
`define CARD_REQUEST_BROADCAST_BITS 2
`define CARD_REQUEST_WRITES_COILS_BITS 3
`define CARD_REQUEST_BANK_BITS 4
`define CARD_REQUEST_LENGTH_BITS 12:5
`define CARD_REQUEST_SILENT_BITS 13

`define CARD_TELEGRAM_BITS 7:0
`define CARD_TELEGRAM_LENGTH_BITS 4:0
`define CARD_TELEGRAM_NO_REPLY_BITS 5
`define CARD_TELEGRAM_CONTROL_BITS 6
`define CARD_TELEGRAM_STOP_BITS 7

`define CARD_SUPERVISION_BITS 3:0
`define CARD_SUPERVISION_KICK_BITS 0
`define CARD_SUPERVISION_HALT_BITS 1
`define CARD_SUPERVISION_LOOPBACK_CLOSE_BITS 2
`define CARD_SUPERVISION_FAULT_BITS 3

`define CARD_EXCHANGE_BITS 4:0
`define CARD_EXCHANGE_SENDING_BITS 0
`define CARD_EXCHANGE_QUIET_BITS 1
`define CARD_EXCHANGE_CANDIDATE_BITS 2
`define CARD_EXCHANGE_GOOD_BITS 3
`define CARD_EXCHANGE_BAD_BITS 4
