// SPDX-License-Identifier: Apache-2.0
// Generated from regs/card.toml by `make regs`; edit that file, not this one.
//
// Rate, silences and format of the network line by switch bits, first switch = bit 0 (LINE-2,
// LINE-3, FRAME-1), and of the drive line (FC-1, FC-8).

#ifndef CARD_TABLES_H
#define CARD_TABLES_H

namespace card_tables {

struct Rate {
  int baud;       // bit/s
  int t15_ticks;  // silences in ticks of 1/kTicksPerBit bit
  int t35_ticks;
};

struct Format {
  char parity;    // 'N', 'O' or 'E'
  int stop_bits;  // stop bits that are sent
};

constexpr int kTicksPerBit = 16;
constexpr int kCharacterBits = 11;
constexpr int kDriveBaud = 9600;  // bit/s
constexpr int kDrivePauseTicks = 352;
constexpr Format kDriveFormat = {'E', 1};

// index: switches 1, 2, 3
constexpr Rate kRate[8] = {
    {300, 264, 616},
    {38400, 461, 1076},
    {2400, 264, 616},
    {115200, 1383, 3226},
    {1200, 264, 616},
    {19200, 264, 616},
    {4800, 264, 616},
    {9600, 264, 616},
};

// index: switches 4, 5
constexpr Format kFormat[4] = {
    {'E', 1},
    {'N', 1},
    {'O', 1},
    {'N', 2},
};

}  // namespace card_tables

#endif
