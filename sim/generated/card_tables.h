// SPDX-License-Identifier: Apache-2.0
// Generated from regs/card.toml by `make regs`; edit that file, not this one.
//
// Rates and formats by switch bits (LINE-2, LINE-3); bit 0 of an index: the group's first switch.

#ifndef CARD_TABLES_H
#define CARD_TABLES_H

namespace card_tables {

struct Format {
  char parity;    // 'N', 'O' or 'E'
  int stop_bits;  // stop bits that are sent
};

constexpr int kCharacterBits = 11;
constexpr int kDriveBaud = 9600;  // bit/s
constexpr Format kDriveFormat = {'E', 1};

// index: switches 1, 2, 3; bit/s
constexpr int kBaud[8] = {300, 38400, 2400, 115200, 1200, 19200, 4800, 9600};

// index: switches 4, 5
constexpr Format kFormat[4] = {
    {'E', 1},
    {'N', 1},
    {'O', 1},
    {'N', 2},
};

}  // namespace card_tables

#endif
