// SPDX-License-Identifier: Apache-2.0
// Simulated time in cycles of the card's clock, counted from the release of the reset.

#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace card {

using Cycles = std::int64_t;

constexpr Cycles kNever = std::numeric_limits<Cycles>::max();

struct SimClock {
  std::int64_t hz;  // cycles in a second

  double seconds(Cycles cycles) const { return static_cast<double>(cycles) / static_cast<double>(hz); }
  // Rounded to nearest, so that all outputs name the same microsecond.
  std::int64_t microseconds(Cycles cycles) const {
    return cycles / hz * 1'000'000 + (cycles % hz * 1'000'000 + hz / 2) / hz;
  }
  // Seconds with six decimals.
  std::string text(Cycles cycles) const {
    const std::int64_t us = microseconds(cycles);
    const std::string decimals = std::to_string(1'000'000 + us % 1'000'000);
    return std::to_string(us / 1'000'000) + "." + decimals.substr(1);
  }
  std::int64_t nanoseconds(Cycles cycles) const {
    return cycles / hz * 1'000'000'000 + cycles % hz * 1'000'000'000 / hz;
  }
  Cycles from_microseconds(std::int64_t us) const { return us * hz / 1'000'000; }
  Cycles from_seconds(double s) const { return static_cast<Cycles>(s * static_cast<double>(hz)); }
  // Length of `count` parts of a bit at `baud` bit/s, `parts` to the bit, rounded to the nearest cycle.
  Cycles bit_parts(std::int64_t count, std::int64_t parts, std::int64_t baud) const {
    return (2 * count * hz + parts * baud) / (2 * parts * baud);
  }
  Cycles half_bits(std::int64_t count, std::int64_t baud) const { return bit_parts(count, 2, baud); }
};

}  // namespace card
