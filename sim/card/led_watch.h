// SPDX-License-Identifier: Apache-2.0
// Turns the levels of one two-colour LED into what a person sees: off, red, green, orange, red-flash,
// green-flash (LED-1, LED-2). Flashing is 1 Hz: half a second lit, half a second off.

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

class LedWatch {
 public:
  using Listener = std::function<void(const LedChange&)>;
  LedWatch(std::string led, const SimClock& clock, Listener listener);
  // The pins as they are; to be called at least every few milliseconds.
  void sample(bool red, bool green, Cycles now);

 private:
  // A stretch of time in which the pins did not change.
  struct Phase {
    unsigned colour = 0;  // bit 0 red, bit 1 green
    Cycles start = 0;
    bool told = false;
  };

  void phase_ended(Cycles end);
  void solid(Phase& phase);
  void flash(const Phase& lit);
  void show(const std::string& shows, Cycles at);

  const std::string led_;
  const Cycles half_period_least_;
  const Cycles half_period_most_;
  Listener listener_;
  Phase previous_;  // told, or too short to be half a flash period
  Phase now_;
  std::string shows_;
  unsigned flashing_ = 0;  // colour that flashes, 0 = none
};

}  // namespace card

#endif
