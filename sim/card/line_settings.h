// SPDX-License-Identifier: Apache-2.0
// Rate, format and silences of the two serial lines, as the card's switches set them (LINE-1..3, FRAME-1,
// FC-8).

#ifndef LINE_SETTINGS_H
#define LINE_SETTINGS_H

#include <cstdint>
#include <string>

#include "sim_clock.h"

namespace card {

struct LineSettings {
  int baud;           // bit/s
  char parity;        // 'N', 'O' or 'E'
  int stop_bits;      // sent; a receiver needs the first only
  Cycles frame_gap;   // silence that ends a frame or telegram
  Cycles burst_gap;   // silence that a polite sender leaves before its next one
  Cycles same_burst;  // bytes that come sooner than this after the last one belong to it

  int char_bits() const { return 1 + 8 + (parity == 'N' ? 0 : 1) + stop_bits; }
  std::string name() const;  // "9600 8N2"
};

// Switch values as the pins take them: bit n-1 = switch n, 1 = ON.
LineSettings network_settings(unsigned sw_baud, const SimClock& clock);
LineSettings drive_settings(const SimClock& clock);

}  // namespace card

#endif
