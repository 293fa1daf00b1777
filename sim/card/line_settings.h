// SPDX-License-Identifier: Apache-2.0
// Rate, format and silences of the two serial lines, as the card's switches set them (LINE-1..3, FRAME-1,
// FC-8).

#ifndef LINE_SETTINGS_H
#define LINE_SETTINGS_H

#include <cstdint>
#include <string>

#include "sim_clock.h"

namespace card {

// The silences of a line: a longer one than `inside` may not be in a frame, a longer one than `between` ends
// it. Where both are the same, as on the drive line, there is nothing in between.
struct Silences {
  Cycles inside;
  Cycles between;
  Cycles character;  // in which they are told; longer than 11 bits above 19200 bit/s, as they are (FRAME-1)
};

struct LineSettings {
  int baud;           // bit/s
  char parity;        // 'N', 'O' or 'E'
  int stop_bits;      // sent; a receiver needs the first only
  Silences silences;  // bytes that come sooner than `inside` after the last one belong to it
  Cycles burst_gap;   // silence that a polite sender leaves before its next frame

  int char_bits() const { return 1 + 8 + (parity == 'N' ? 0 : 1) + stop_bits; }
  std::string name() const;  // "9600 8N2"
};

// Switch values as the pins take them: bit n-1 = switch n, 1 = ON.
LineSettings network_settings(unsigned sw_baud, const SimClock& clock);
LineSettings drive_settings(const SimClock& clock);

}  // namespace card

#endif
