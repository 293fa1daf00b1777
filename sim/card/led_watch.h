// SPDX-License-Identifier: Apache-2.0
// Turns the levels of one two-colour LED into a state: off, red, green, orange, red-flash or green-flash
// (LED-1, LED-2). Flashing is 1 Hz: half a second lit, half a second dark.

#pragma once

#include <functional>
#include <string>

#include "sim_clock.h"

namespace card {

struct LedChange {
  Cycles at;
  std::string led;  // "modbus" or "drive"
  std::string shows;
};

// Reports a change at once, except when red or green comes on: that may be the first half period of a flash.
// Such a change is reported, with its start time, when the phase ends or lasts too long for a flash.
// A flashing LED that changes its colour is assumed to go on flashing until its pins show otherwise.
class LedWatch {
 public:
  using Listener = std::function<void(const LedChange&)>;
  LedWatch(std::string led, const SimClock& clock, Listener listener);
  // Call at least every few milliseconds. Colours: bit 0 red, bit 1 green.
  void sample(unsigned colour, Cycles now);
  // Start of a change that is not yet decided, kNever if there is none: no later report is older.
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
  unsigned colour_ = ~0u;  // of the pins; none before the first sample
  Cycles since_ = 0;
  unsigned flashing_ = 0;  // colour that flashes, 0 = none
  unsigned lit_ = 0;       // colour that came on and is not yet decided, 0 = none
  Cycles lit_since_ = 0;
  std::string shows_;
};

}  // namespace card
