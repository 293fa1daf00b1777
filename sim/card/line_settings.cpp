// SPDX-License-Identifier: Apache-2.0

#include "line_settings.h"

#include "card_tables.h"

namespace card {

namespace {

// Characters added to the required silence, so that the next frame is certain to count as new.
constexpr double kExtraCharacters = 0.5;

int extra_ticks(const card_tables::Format& format) {
  return static_cast<int>(kExtraCharacters * format.character_bits * card_tables::kTicksPerBit);
}

Cycles ticks(int count, int baud, const SimClock& clock) {
  return clock.bit_parts(count, card_tables::kTicksPerBit, baud);
}

}  // namespace

std::string LineSettings::name() const {
  return std::to_string(baud) + " 8" + parity + std::to_string(stop_bits);
}

LineSettings network_settings(unsigned sw_baud, const SimClock& clock) {
  const auto& lines = CARD_EXTENDED_SWITCHES ? card_tables::kExtendedLine : card_tables::kLine;
  const card_tables::Line& set = lines[sw_baud & 31];
  LineSettings line{};
  line.baud = set.baud;
  line.parity = set.format.parity;
  line.stop_bits = set.format.stop_bits;
  const Cycles t35 = ticks(set.t35_ticks, line.baud, clock);
  line.silences = {ticks(set.t15_ticks, line.baud, clock), t35, t35 * 2 / 7};
  line.burst_gap = ticks(set.t35_ticks + extra_ticks(set.format), line.baud, clock);
  return line;
}

LineSettings drive_settings(const SimClock& clock) {
  LineSettings line{};
  line.baud = card_tables::kDriveBaud;
  line.parity = card_tables::kDriveFormat.parity;
  line.stop_bits = card_tables::kDriveFormat.stop_bits;
  // The pause before a telegram is also the longest gap FC-8 allows inside one.
  const Cycles pause = ticks(card_tables::kDrivePauseTicks, line.baud, clock);
  line.silences = {pause, pause, pause / 2};
  line.burst_gap = ticks(card_tables::kDrivePauseTicks + extra_ticks(card_tables::kDriveFormat), line.baud, clock);
  return line;
}

}  // namespace card
