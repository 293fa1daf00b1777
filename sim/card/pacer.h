// SPDX-License-Identifier: Apache-2.0
// Keeps simulated time at wall time and measures the speed that this machine could reach.

#ifndef PACER_H
#define PACER_H

#include <chrono>
#include <vector>

#include "sim_clock.h"

namespace card {

class Pacer {
 public:
  explicit Pacer(const SimClock& clock);

  // Simulated time has advanced by `cycles` since the last call. If it is ahead of wall time, sleeps until
  // wall time has caught up or a descriptor is readable. If it is behind, makes up for a little of the delay;
  // the rest is dropped and counted.
  void keep_to_wall_time(Cycles cycles, const std::vector<int>& wake_up);
  // As keep_to_wall_time(), but without sleeping.
  void run_free(Cycles cycles);

  // Simulated seconds per second of processor time so far: above 1, one free core keeps up.
  double possible_ratio() const;
  // Simulated seconds per wall second since the last call; 1 if no time was dropped.
  double take_shortfall();
  double simulated_seconds() const { return simulated_; }
  double wall_seconds() const;

 private:
  using Wall = std::chrono::steady_clock;
  static double now();

  const SimClock clock_;
  const double began_;
  double simulated_ = 0;
  double ahead_base_;    // wall time that corresponds to simulated_ == 0
  double dropped_ = 0;   // wall seconds since take_shortfall()
  double window_began_;
};

}  // namespace card

#endif
