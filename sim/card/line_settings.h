// SPDX-License-Identifier: Apache-2.0
// Rate, format and silences of the two serial lines, as the card's switches set them (LINE-1..3, FRAME-1,
// FC-8).

#ifndef LINE_SETTINGS_H
#define LINE_SETTINGS_H

#include <cstdint>
#include <string>

#include "sim_clock.h"

namespace card {

// Silences of a line. A silence longer than `inside` may not occur in a frame; one longer than `between` ends
// the frame. On the drive line both are equal.
struct Silences {
  Cycles inside;
  Cycles between;
  Cycles character;  // unit in which silences are reported; above 19200 bit/s longer than 11 bits (FRAME-1)
};

struct LineSettings {
  int baud;           // bit/s
  char parity;        // 'N', 'O' or 'E'
  int stop_bits;      // sent; a receiver needs only the first
  Silences silences;  // a byte that starts within `inside` of the previous one belongs to its frame
  Cycles burst_gap;   // silence before a new burst

  int char_bits() const { return 1 + 8 + (parity == 'N' ? 0 : 1) + stop_bits; }
  std::string name() const;  // "9600 8N2"
};

// Switch values as the pins take them: bit n-1 = switch n, 1 = ON.
LineSettings network_settings(unsigned sw_baud, const SimClock& clock);
LineSettings drive_settings(const SimClock& clock);

}  // namespace card

#endif
