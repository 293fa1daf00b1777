// SPDX-License-Identifier: Apache-2.0
// Turns the levels of one two-colour LED into what a person sees: off, red, green, orange, red-flash,
// green-flash (LED-1, LED-2). Flashing is 1 Hz: half a second lit, half a second dark.

#ifndef LED_WATCH_H
#define LED_WATCH_H

#include <functional>
#include <string>

#include "sim_clock.h"

namespace card {

struct LedChange {
  Cycles at;
  std::string led;  // "modbus" or "drive"
  std::string shows;
};

// What a steady LED shows is told at once, but for red and green that come on: they may be the first half
// period of a flash, which is known when it ends, and told with the time at which it began. A flashing LED
// that changes its colour is taken to go on flashing; when it does not, that is told as soon as it is seen.
class LedWatch {
 public:
  using Listener = std::function<void(const LedChange&)>;
  LedWatch(std::string led, const SimClock& clock, Listener listener);
  // The pins as they are; to be called at least every few milliseconds.
  void sample(bool red, bool green, Cycles now);
  // Beginning of what cannot be told yet, kNever when there is nothing: no change to come is older.
  Cycles undecided_since() const { return lit_ != 0 ? lit_since_ : kNever; }

 private:
  void changed(unsigned colour, Cycles now);
  void decide(unsigned next, Cycles now);
  void lasting(Cycles now);
  void solid(unsigned colour, Cycles at);
  void flash(unsigned colour, Cycles at);
  void show(const std::string& shows, Cycles at);

  const std::string led_;
  const Cycles half_period_least_;
  const Cycles half_period_most_;
  Listener listener_;
  // Colours: bit 0 red, bit 1 green.
  unsigned colour_ = ~0u;  // of the pins; none before the first sample
  Cycles since_ = 0;
  unsigned flashing_ = 0;  // colour that flashes, 0 = none
  unsigned lit_ = 0;       // colour that came on and cannot be told yet, 0 = none
  Cycles lit_since_ = 0;
  std::string shows_;
};

}  // namespace card

#endif
