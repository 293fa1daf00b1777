// SPDX-License-Identifier: Apache-2.0

#include "line_settings.h"

#include "card_tables.h"

namespace card {

namespace {

// FRAME-1 and FC-8 in half characters of 11 bits, so that 1.5 and 3.5 stay whole numbers.
constexpr int kT15HalfCharacters = 3;
constexpr int kT35HalfCharacters = 7;
constexpr int kDrivePauseHalfCharacters = 4;
// Above this rate (bit/s) the two network silences are fixed.
constexpr int kFastAboveBaud = 19200;
constexpr int kFastT15Us = 750;
constexpr int kFastT35Us = 1750;

Cycles half_characters(int count, int baud, const SimClock& clock) {
  return clock.half_bits(static_cast<std::int64_t>(count) * card_tables::kCharacterBits, baud);
}

}  // namespace

std::string LineSettings::name() const {
  return std::to_string(baud) + " 8" + parity + std::to_string(stop_bits);
}

LineSettings network_settings(unsigned sw_baud, const SimClock& clock) {
  LineSettings line{};
  line.baud = card_tables::kBaud[sw_baud & 7];
  const card_tables::Format& format = card_tables::kFormat[sw_baud >> 3 & 3];
  line.parity = format.parity;
  line.stop_bits = format.stop_bits;
  const bool fast = line.baud > kFastAboveBaud;
  line.frame_gap =
      fast ? clock.from_microseconds(kFastT35Us) : half_characters(kT35HalfCharacters, line.baud, clock);
  line.same_burst =
      fast ? clock.from_microseconds(kFastT15Us) : half_characters(kT15HalfCharacters, line.baud, clock);
  line.burst_gap = line.frame_gap + half_characters(1, line.baud, clock);
  return line;
}

LineSettings drive_settings(const SimClock& clock) {
  LineSettings line{};
  line.baud = card_tables::kDriveBaud;
  line.parity = card_tables::kDriveFormat.parity;
  line.stop_bits = card_tables::kDriveFormat.stop_bits;
  line.frame_gap = half_characters(kDrivePauseHalfCharacters, line.baud, clock);
  line.same_burst = line.frame_gap;
  // The frame gap is also the longest gap FC-8 allows inside a telegram: a quarter more ends it for sure.
  line.burst_gap = line.frame_gap + half_characters(1, line.baud, clock);
  return line;
}

}  // namespace card
